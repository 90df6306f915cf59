"""The stationary motion of a process behind the transfer of its source."""

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.loop.disturbance import Disturbance
from microrad.loop.disturbance.windows import Motion


def motion_behind(process: Disturbance, transfer: Floats | lti.StateSpace) -> Motion:
    """The motion about each axis, its spectral lines left out.

    Args:
        process: What drives the transfer, of one axis.
        transfer: Gains, shape (axes,), or a system of one input.
    """
    A, B = process.A, process.B
    if isinstance(transfer, lti.StateSpace):
        return Motion.of(lti.series(lti.StateSpace(A, B, process.C, np.zeros((1, B.shape[1]))), transfer))
    return Motion.of(lti.StateSpace(A, B, np.outer(transfer, process.C), np.zeros((len(transfer), B.shape[1]))))
