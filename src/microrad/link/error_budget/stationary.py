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
    A, B, C = process.A, process.B, process.C
    if not isinstance(transfer, lti.StateSpace):
        return Motion.of(lti.StateSpace(A, B, np.outer(transfer, C), np.zeros((len(transfer), B.shape[1]))))
    n, outputs = transfer.order, len(transfer.C)
    series = np.block([[A, np.zeros((len(A), n))], [transfer.B @ C, transfer.A]])
    fed = np.vstack([B, np.zeros((n, B.shape[1]))])
    seen = np.hstack([transfer.D @ C, transfer.C])
    return Motion.of(lti.StateSpace(series, fed, seen, np.zeros((outputs, B.shape[1]))))
