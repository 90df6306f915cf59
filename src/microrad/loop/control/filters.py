"""Second-order sections for controllers, discrete at the control period: notch, low-pass with lead, and peak."""

import math

import numpy as np

from microrad.core import lti


def second_order(
    numerator: tuple[float, float, float], denominator: tuple[float, float, float], freq_hz: float, period_s: float
) -> lti.StateSpace:
    """Discrete section of a ratio of polynomials in q = s / (2 pi ``freq_hz``), highest power first.

    Tustin's rule prewarped to be exact at ``freq_hz``: q = (z - 1) / (t (z + 1)), t = tan(pi f T) (Franklin, Powell
    and Workman, Digital Control of Dynamic Systems, 3rd ed., section 6.1). A stable filter stays stable. Raises
    ValueError for a frequency that is not between 0 and half the rate.
    """
    refuse_beyond_rate(freq_hz, period_s, "a second-order section")
    t = math.tan(math.pi * freq_hz * period_s)
    powers = np.array([[1.0, t, t * t], [-2.0, 0.0, 2.0 * t * t], [1.0, -t, t * t]])
    b, a = powers @ numerator, powers @ denominator
    b, a = b / a[0], a / a[0]
    return lti.StateSpace(
        A=np.array([[-a[1], 1.0], [-a[2], 0.0]]),
        B=(b[1:] - a[1:] * b[0])[:, None],
        C=np.array([[1.0, 0.0]]),
        D=np.array([[b[0]]]),
    )


def notch(centre_hz: float, depth: float, width: float, period_s: float) -> lti.StateSpace:
    """(q^2 + depth width q + 1) / (q^2 + width q + 1): ``depth`` at its centre, 1 at 0 and half the rate.

    ``width`` is the range of frequency, over the centre, that a deep notch attenuates by 3 dB or more; a depth above 1
    raises the band instead. Raises ValueError as `second_order` does.
    """
    return second_order((1.0, depth * width, 1.0), (1.0, width, 1.0), centre_hz, period_s)


def low_pass(freq_hz: float, damping: float, period_s: float, lead_hz: float = math.inf) -> lti.StateSpace:
    """(1 + s/lead) / (q^2 + 2 damping q + 1): second order, 1 at 0, with a zero where a lead is given.

    Raises ValueError as `second_order` does.
    """
    return second_order((0.0, freq_hz / lead_hz, 1.0), (1.0, 2.0 * damping, 1.0), freq_hz, period_s)


def peak(freq_hz: float, damping: float, at_centre: complex, period_s: float) -> lti.StateSpace:
    """Resonator c/(z - p) + c*/(z - p*) with p = exp((i - damping) w T), whose response at w is ``at_centre``.

    Its response around w is ``at_centre`` / (1 + i (w' - w) / (damping w)): the complex residue carries the phase.
    Raises ValueError for a frequency that is not between 0 and half the rate.
    """
    refuse_beyond_rate(freq_hz, period_s, "a peak filter")
    turn = 2.0 * math.pi * freq_hz * period_s
    centre, pole = np.exp(1j * turn), np.exp((1j - damping) * turn)
    near, far = 1.0 / (centre - pole), 1.0 / (centre - np.conj(pole))
    residue = (at_centre * np.conj(near) - np.conj(at_centre) * far) / (abs(near) ** 2 - abs(far) ** 2)
    return lti.StateSpace(
        A=np.array([[pole.real, -pole.imag], [pole.imag, pole.real]]),
        B=np.array([[1.0], [0.0]]),
        C=2.0 * np.array([[residue.real, -residue.imag]]),
        D=np.zeros((1, 1)),
    )


def refuse_beyond_rate(freq_hz: float, period_s: float, what: str) -> None:
    """Raise ValueError for a frequency that is not between 0 and half the control rate."""
    if not 0.0 < freq_hz < 0.5 / period_s:
        raise ValueError(
            f"{what} at {freq_hz:g} Hz: a controller with a period of {period_s:g} s has no such frequency; "
            f"give one above 0 and below {0.5 / period_s:g} Hz, or raise the control rate"
        )


def parallel(*systems: lti.StateSpace) -> lti.StateSpace:
    """Sum of the outputs of systems that share their input."""
    from scipy.linalg import block_diag

    return lti.StateSpace(
        A=block_diag(*(s.A for s in systems)),
        B=np.vstack([s.B for s in systems]),
        C=np.hstack([s.C for s in systems]),
        D=np.sum([s.D for s in systems], axis=0),
    )
