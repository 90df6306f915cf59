"""How far single precision takes an inverse that learns from double: from many runs with random roundings.

A bound of the worst that roundings may do together, as `rounding` has it for other controllers, says nothing here. What
is learnt adds up errors, and where a bound leaves open whether what was learnt is in use already, it grows by what the
two inverses differ by: it is beyond the limits within some thousand samples, where single precision strays by
microvolts. So roundings are taken as independent (Higham and Mary, SIAM J. Sci. Comput. 41 (2019) A2815). The recorded
run is repeated `RUNS` times with coefficients and readings as the code has them, each operation rounded up or down at
random by as much as rounding may do, and the bound is `SIGMAS` times the rms of what these runs are off.
"""

import numpy as np

from microrad.core.arrays import Floats
from microrad.export.flight.double_run import Run
from microrad.export.flight.learning_run import UNIT, Learner, Roundings, laws
from microrad.export.linear_part.sections import Sections, compensated_states
from microrad.export.records import FlightController

RUNS, SIGMAS = 64, 6.0
"""Runs with random roundings, and the bound over the rms of what they are off."""


def learning_errors(of: FlightController, form: Sections, r: Run, inputs: Floats | None) -> Floats:
    """Bound of the error of each command ahead of clip and converter in V, shape (samples, actuators).

    Args:
        of: A controller whose inverse learns.
        form: Its linear part.
        r: The recorded run in double precision.
        inputs: The readings, (samples, numbers), SI units; None where the linear part is exact, and the inverse alone
            in single precision.
    """
    code = _Single(of, form)
    found = np.empty_like(r.free)
    for k in range(len(found)):
        free = code.beside(r.outputs[k]) if inputs is None else code.step(_in_single(inputs[k]))
        found[k] = np.sqrt(np.mean((free - r.free[k][:, None]) ** 2, axis=1))
    return SIGMAS * found


def _in_single(x: Floats) -> Floats:
    return np.asarray(x).astype(np.float32).astype(float)


class _Single:
    """The code in single precision, with random roundings, many runs side by side along the last index."""

    def __init__(self, of: FlightController, form: Sections) -> None:
        assert of.inverse is not None
        assert of.adaptation is not None
        self.of, self.n, law = of, of.actuators, of.inverse
        slow = np.array(compensated_states(form), dtype=bool)
        moves = form.A - np.diag(slow.astype(float))
        A, B, C, D, self.L = (_in_single(each) for each in (moves, form.B, form.C, form.D, form.L))
        self.matrix, self.slow = np.block([[C, D], [A, B]]), slow[:, None]
        self.terms = np.count_nonzero(self.matrix, axis=1)[:, None] + 3.0
        self.x, self.rounded = np.zeros((form.order, RUNS)), Roundings(UNIT, RUNS)
        self.learners = [Learner(each, a, self.rounded) for a, each in enumerate(laws(of.adaptation, np.float32))]
        self.lag_share, self.lag_weight = (_in_single(each)[:, None] for each in (1.0 - law.lag_keep, law.lag_weight))
        self.lag = np.zeros((law.lag_keep.size, RUNS))

    def step(self, m: Floats) -> Floats:
        """Commands ahead of the clip for these readings; states are kept with what rounding leaves out of them."""
        of, rows = self.of, len(self.terms) - len(self.x)
        signals = np.vstack([self.x, np.repeat(m[:, None], RUNS, axis=1)])
        found = self.rounded.product(self.matrix, signals, self.terms)
        free = self._commands(found[:rows])
        excess = np.clip(free, of.minimum_v, of.maximum_v) - free
        if np.any(excess):
            found[rows:] += self.rounded.product(self.L, excess, self.n + 1.0)
        self.x = np.where(self.slow, self.x, 0.0) + found[rows:]
        return free

    def beside(self, outputs: Floats) -> Floats:
        """Commands ahead of the clip for outputs of a linear part that is exact."""
        return self._commands(self.rounded(np.repeat(outputs[:, None], RUNS, axis=1), 2))

    def _commands(self, outputs: Floats) -> Floats:
        return self.rounded(outputs[: self.n] + self._inverse(outputs))

    def _inverse(self, outputs: Floats) -> Floats:
        of, n, rounded = self.of.inverse, self.n, self.rounded
        assert of is not None
        target, drive = outputs[n : 2 * n].copy(), np.empty((n, RUNS))
        for j, a in enumerate(of.lag_actuator.tolist()):
            target[a] = rounded(target[a] - rounded(self.lag_weight[j] * self.lag[j]))
        for a, learner in enumerate(self.learners):
            target[a], drive[a] = learner.step(target[a], outputs[3 * n + a])
        at = of.lag_actuator.astype(int)
        self.lag = self.lag + rounded(self.lag_share * (drive[at] - self.lag), 3)
        return drive
