"""A controller over a recorded run in double precision: what its states, its outputs and its inverse go through."""

import math
from dataclasses import dataclass

import numpy as np

from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.export.flight.learning_run import Learner, Roundings, laws
from microrad.export.linear_part.sections import Sections
from microrad.export.records import FlightController, InverseLaw


@dataclass(frozen=True, slots=True)
class InverseRun:
    """The inverse over a run, by sample.

    ``target`` behind creep (rad), its ``rate`` (rad/s) and what is ``added`` to the commands (V) have the shape
    (samples, actuators), ``travel`` of the drive (V) and ``h`` (samples, elements), ``lag`` at the begin of each sample
    (samples, lags).
    """

    target: Floats
    rate: Floats
    travel: Floats
    h: Floats
    lag: Floats
    added: Floats


@dataclass(frozen=True, slots=True)
class ForwardRun:
    """A feedforward's hysteresis over a run: drives ``q`` and outputs ``z`` (samples, elements), Bouc-Wen's ``h``."""

    q: Floats
    h: Floats
    z: Floats


@dataclass(frozen=True, slots=True)
class Run:
    """A controller over a run in double precision, by sample.

    ``states`` (samples, states) are those before the sample, ``outputs`` (samples, outputs) those of the linear part.
    ``free`` are the commands ahead of the clip, and ``excess`` is clip(free) - free, which goes to the anti-windup;
    both (samples, actuators), V.
    """

    states: Floats
    outputs: Floats
    free: Floats
    excess: Floats
    inverse: InverseRun | None
    forward: ForwardRun | None = None


class Inverse:
    """The inverse in double precision, sample by sample, as `kernels.ensemble_loop` has it."""

    def __init__(self, of: FlightController, samples: int) -> None:
        """At rest; ``samples`` is how many it can record."""
        assert of.inverse is not None
        self.law, self.period_s, self.actuators = of.inverse, of.period_s, of.actuators
        self.before, self.k = np.zeros(of.actuators), 0
        self.play = np.zeros(self.law.play_threshold.size)
        self.lag = np.zeros(self.law.lag_keep.size)
        n, elements = of.actuators, len(self.law.bouc_wen)
        learns, exactly = () if of.adaptation is None else laws(of.adaptation), Roundings(0.0, 1)
        self.learners = [Learner(each, a, exactly) for a, each in enumerate(learns)]
        self.record = InverseRun(*(np.zeros((samples, w)) for w in (n, n, elements, elements, self.lag.size, n)))

    def step(self, outputs: Floats) -> Floats:
        """What the inverse adds to each command, from the linear part's outputs of this sample."""
        law, r, k, n = self.law, self.record, self.k, self.actuators
        target = outputs[n : 2 * n].copy()
        np.subtract.at(target, law.lag_actuator.astype(int), law.lag_weight * self.lag)
        rate = (target - self.before) / self.period_s if law.by_difference else outputs[2 * n : 3 * n]
        added = np.zeros(n) if self.learners else law.direct * target
        for a, learner in enumerate(self.learners):
            target[a : a + 1], added[a : a + 1] = learner.step(target[a : a + 1], outputs[3 * n + a : 3 * n + a + 1])
        r.target[k], r.rate[k], r.lag[k] = target, rate, self.lag
        for e, a in enumerate(law.bouc_wen_actuator.tolist()):
            added[a] += self._bouc_wen(e, float(target[a]), float(target[a] - self.before[a]), float(rate[a]))
        if not self.learners:
            self._plays(target, rate, added)
        self.lag = law.lag_keep * self.lag + (1.0 - law.lag_keep) * added[law.lag_actuator.astype(int)]
        self.before, self.k = target, k + 1
        r.added[k] = added
        return added

    def _bouc_wen(self, e: int, now: float, change: float, rate: float) -> float:
        row, k = self.law.bouc_wen[e].tolist(), self.k
        d1, limit, bias = row[kernels.D1], row[kernels.RATE_LIMIT], row[kernels.BIAS]
        drive_rate = min(max(rate / d1, -limit), limit)
        grown = row[kernels.EPSILON] * math.exp(row[kernels.DELTA] * abs(drive_rate))
        h, travel = self.record.h[k - 1, e] if k else 0.0, change / d1
        if row[kernels.POWER] != 0.0:
            h = kernels.bouc_wen_power_step(h, travel, grown, self.law.bouc_wen, e)
        else:
            decay = (row[kernels.ALPHA], row[kernels.BETA], row[kernels.GAMMA], row[kernels.ETA])
            h = kernels.bouc_wen_step(h, travel, grown, *decay)
        self.record.travel[k, e], self.record.h[k, e] = travel, h
        return float((now - h + d1 * bias) / (d1 * math.exp(-row[kernels.D2] * drive_rate)) - bias)

    def _plays(self, target: Floats, rate: Floats, added: Floats) -> None:
        law = self.law
        if not law.play_threshold.size:
            return
        at = law.play_actuator.astype(int)
        wide = law.play_threshold + np.where(law.play_threshold > 0.0, widened(law, rate)[at], 0.0)
        self.play = np.maximum(target[at] - wide, np.minimum(target[at] + wide, self.play))
        np.add.at(added, at, law.play_weight * self.play)


def widened(law: InverseLaw, rate: Floats) -> Floats:
    """How far the inverse's plays widen at a rate of the target: what is added to each threshold above 0, in its unit.

    Args:
        law: The inverse.
        rate: Rate of the target in rad/s, of any shape with the actuators last; the sign does not matter.
    """
    return np.asarray(law.widening[:, 0] * np.minimum(np.abs(rate), law.widening[:, 1]))


class Forward:
    """A feedforward's hysteresis in double precision, sample by sample, as `kernels.ensemble_loop` has it."""

    def __init__(self, of: kernels.ForwardBank, samples: int) -> None:
        """At rest; ``samples`` is how many it can record."""
        self.bank, self.k, elements = of, 0, of.drives.shape[1]
        self.play = np.zeros(of.play_threshold.size)
        self.record = ForwardRun(*(np.zeros((samples, w)) for w in (elements, len(of.bouc_wen), elements)))

    def step(self, q: Floats) -> Floats:
        """What it adds to each command, from what drives its elements in this sample."""
        r, k, first = self.record, self.k, len(self.bank.bouc_wen)
        r.q[k] = q
        travel = q - r.q[k - 1] if k else q
        for e in range(q.size):
            found = self._bouc_wen if e < first else self._operator
            r.z[k, e] = found(e, float(q[e]), float(travel[e]))
        self.k = k + 1
        return np.asarray(self.bank.drives @ r.z[k])

    def _bouc_wen(self, e: int, q: float, travel: float) -> float:
        row, k, h = self.bank.bouc_wen[e].tolist(), self.k, self.record.h
        d1, limit, bias = row[kernels.D1], row[kernels.RATE_LIMIT], row[kernels.BIAS]
        rate = min(max(travel / self.bank.step_s, -limit), limit)
        grown, before = row[kernels.EPSILON] * math.exp(row[kernels.DELTA] * abs(rate)), h[k - 1, e] if k else 0.0
        if row[kernels.POWER] != 0.0:
            h[k, e] = kernels.bouc_wen_power_step(before, travel, grown, self.bank.bouc_wen, e)
        else:
            decay = (row[kernels.ALPHA], row[kernels.BETA], row[kernels.GAMMA], row[kernels.ETA])
            h[k, e] = kernels.bouc_wen_step(before, travel, grown, *decay)
        return float(d1 * math.exp(-row[kernels.D2] * rate) * (q + bias) - d1 * bias + h[k, e])

    def _operator(self, e: int, q: float, travel: float) -> float:
        bank, o = self.bank, e - len(self.bank.bouc_wen)
        own = slice(int(bank.play_start[o]), int(bank.play_start[o + 1]))
        widening, limit, quadratic, signed, cubic, reach = bank.operator[o].tolist()
        wide = widening * min(abs(travel) / bank.step_s, limit) if widening else 0.0
        threshold = bank.play_threshold[own]
        half = threshold + np.where(threshold > 0.0, wide, 0.0)
        self.play[own] = np.maximum(q - half, np.minimum(q + half, self.play[own]))
        s = min(max(q, -reach), reach) / reach if math.isfinite(reach) else 0.0
        bent = s * (quadratic * s + signed * abs(s) + cubic * s * s)
        return float(bank.play_weight[own] @ self.play[own] + bent)


def run_in_double(of: FlightController, form: Sections, inputs: Floats) -> Run:
    """Run the controller over a recorded run in double precision, from rest.

    Args:
        of: The controller, for its limits and its inverse.
        form: Its linear part.
        inputs: The recorded readings, shape (samples, numbers), SI units.
    """
    samples, A, pushed = inputs.shape[0], form.A, inputs @ form.B.T
    x, direct = np.zeros(A.shape[0]), inputs @ form.D.T
    states, outputs = np.empty((samples, x.size)), np.empty((samples, form.C.shape[0]))
    free, excess = np.empty((samples, of.actuators)), np.zeros((samples, of.actuators))
    inverse = None if of.inverse is None else Inverse(of, samples)
    forward = None if of.forward is None else Forward(of.forward, samples)
    for k in range(samples):
        y = form.C @ x + direct[k]
        v = y[: of.actuators] if inverse is None else y[: of.actuators] + inverse.step(y)
        if forward is not None:
            v = v + forward.step(y[-forward.record.q.shape[1] :])
        states[k], outputs[k], free[k] = x, y, v
        x = A @ x + pushed[k]
        over = np.clip(v, of.minimum_v, of.maximum_v) - v
        if np.any(over):
            excess[k] = over
            x += form.L @ over
    ran = None if inverse is None else inverse.record, None if forward is None else forward.record
    return Run(states, outputs, free, excess, *ran)
