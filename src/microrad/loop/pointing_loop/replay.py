"""One run of the fine-pointing loop as its controller sees it: what it reads and what it commands, sample by sample."""

from dataclasses import dataclass

import numpy as np

from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.loop.pointing_loop import ensemble
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop


@dataclass(frozen=True, slots=True)
class Replay:
    """A run at its control samples, from rest.

    ``inputs`` (samples, numbers) are the readings in the order of `LoopController`, ``commands`` (samples, actuators)
    what it made of them, in V from the bias. ``disturbance_rad`` and ``error_rad`` (samples, axes) are at the line of
    sight; ``counts`` (kernels.COUNT_*) are of the whole run.
    """

    inputs: Floats
    commands: Floats
    disturbance_rad: Floats
    error_rad: Floats
    counts: Floats


def replay(loop: PointingLoop, controller: LoopController, samples: int, seed: int, run_number: int = 0) -> Replay:
    """The run of that number of an ensemble with this seed, to the last bit.

    It enters the kernel once a sample, some 0.1 ms each: for a trace of the loop alone take `ensemble.trace`.
    """
    p = ensemble.arrays(loop, controller, seed)
    state = ensemble.start(loop, p, run_number)
    axes, m, read = loop.axes, loop.mirror.actuators, p.B.shape[1]
    inputs, commands = np.empty((samples, read)), np.empty((samples, m))
    disturbance, error = np.empty((samples, axes)), np.empty((samples, axes))
    reference = ensemble.reference(loop, 0, samples)
    length = state.command.size // (m * kernels.LANES)
    nothing = np.empty((0, 0, 0))

    def first(rows: Floats, begin: int, count: int) -> Floats:
        return rows.reshape(-1, kernels.LANES)[begin : begin + count, 0]

    for k in range(samples):
        disturbance[k], error[k] = first(state.disturbance, 0, axes), first(state.error, 0, axes)
        kernels.ensemble_loop(p, state, reference[k : k + 2], nothing, nothing, kernels.UNSHIFTED)
        inputs[k], commands[k] = first(state.measured, 0, read), first(state.command, k % length * m, m)
    return Replay(inputs, commands, disturbance, error, first(state.counts, 0, kernels.COUNT_FIELDS).copy())
