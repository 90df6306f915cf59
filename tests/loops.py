"""Pieces of loops that only tests put together."""

import math

import numpy as np
from scipy.linalg import block_diag

from microrad.core import lti
from microrad.loop.control import Drive

IDEAL_DRIVE = Drive(-math.inf, math.inf, math.inf, math.inf, 0.0, 0.0)


def side_by_side(*controllers):
    """One controller an axis, without coupling."""
    return lti.StateSpace(*(block_diag(*(getattr(c, key) for c in controllers)) for key in "ABCD"))


def discrete_psd(discrete, freq_hz, step_s):
    """One-sided density (rad^2/Hz) of a sampled disturbance, 2 step |C (z - Ad)^-1 Bd|^2; lines are not in it.

    What the continuous density has above half the sample rate is folded into it.
    """
    noise = slice(2 * discrete.line_amplitude_rad.size, None)
    system = lti.StateSpace(
        discrete.Ad[noise, noise], discrete.Bd[noise], discrete.C[:, noise], np.zeros((1, discrete.Bd.shape[1]))
    )
    response = lti.frequency_response(system, freq_hz, step_s)[:, 0, :]
    return 2.0 * step_s * np.sum(np.abs(response) ** 2, axis=1)
