"""An inverse that learns, sample by sample: in double precision, or in many runs side by side with random roundings.

The law is that of `kernels.adaptive`, an actuator by itself, in the order of templates/controller.c.j2.
"""

from dataclasses import dataclass
from functools import reduce

import numpy as np

from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.export.records import AdaptiveLaw

UNIT = 2.0**-24
"""Largest relative error of rounding to single precision."""


class Roundings:
    """Roundings of sums and products to ``unit``, drawn at random: each is up or down, as large as it can be.

    Vignes, Mathematics and Computers in Simulation 35 (1993) 233; Parker, Monte Carlo Arithmetic, UCLA CSD-970002
    (1997). How large that may be for sums in whatever order: Higham, Accuracy and Stability of Numerical Algorithms,
    2nd ed., SIAM 2002, ch. 4. A ``unit`` of 0 rounds nothing.
    """

    def __init__(self, unit: float, runs: int) -> None:
        """``runs`` is how many runs are side by side, along the last index of each array."""
        self.unit, self.runs = unit, runs
        self._rng = np.random.Generator(np.random.SFC64(1))
        self._sides: Floats = np.zeros(0)
        self._at = 0

    def __call__(self, value: Floats, operations: int = 1) -> Floats:
        """The value rounded so many times, each for itself; its last index are the runs."""
        return value if self.unit == 0.0 else np.asarray(value + self._error(value, operations))

    def total(self, *parts: Floats, operations: int = 2) -> Floats:
        """The sum of these, rounded so many times by as much as the sum of their sizes."""
        value = reduce(np.add, parts)
        return value if self.unit == 0.0 else value + self._error(reduce(np.add, map(np.abs, parts)), operations)

    def product(self, row: Floats, column: Floats, operations: Floats | float) -> Floats:
        """The same of the terms of a product of matrices; the runs are the columns of ``column``."""
        value = row @ column
        return value if self.unit == 0.0 else value + self._error(np.abs(row) @ np.abs(column), operations)

    def totals_from_beyond(self, parts: Floats, operations: int) -> Floats:
        """The same from each place to the end."""
        value = np.cumsum(parts[::-1], axis=0)[::-1]
        if self.unit == 0.0:
            return value
        return value + self._error(np.cumsum(np.abs(parts)[::-1], axis=0)[::-1], operations)

    def _error(self, size: Floats, operations: Floats | float) -> Floats:
        count = size.size
        if self._at + count > self._sides.size:
            self._sides, self._at = np.asarray(2.0 * self._rng.integers(0, 2, max(2**18, count)) - 1.0), 0
        sides = self._sides[self._at : self._at + count].reshape(size.shape)
        self._at += count
        return np.asarray(self.unit * np.sqrt(operations) * size * sides)


@dataclass(frozen=True, slots=True)
class Law:
    """How one actuator's inverse learns: a row of `AdaptiveLaw` by name, with ``gaps`` between its thresholds (V)."""

    cycle: int
    delay: int
    gain: float
    share: float
    forgotten: float
    dead_zone: float
    speed: float
    least_size: float
    least_travel: float
    least: Floats
    most_weight: float
    offset_limit: float
    weight: Floats
    gaps: Floats


def laws(of: AdaptiveLaw, number: type[np.floating] = np.float64) -> tuple[Law, ...]:
    """The law of each actuator.

    Args:
        of: How the inverse learns.
        number: What its numbers are rounded to.
    """

    def held(x: float) -> float:
        return float(number(x))

    found = []
    for row, first, last in zip(of.settings, of.start[:-1], of.start[1:], strict=True):
        own = slice(int(first), int(last))
        weight, threshold = (a[own].astype(number) for a in (of.weight, of.threshold))
        least = np.zeros((weight.size, 1))
        least[0] = held(row[kernels.LEAST_WEIGHT])
        found.append(
            Law(
                cycle=int(row[kernels.CYCLE]),
                delay=int(row[kernels.DELAY]),
                gain=held(row[kernels.GAIN]),
                share=held(row[kernels.SHARE]),
                forgotten=held(1.0 - row[kernels.KEEP]),
                dead_zone=held(row[kernels.DEAD_ZONE]),
                speed=held(row[kernels.SPEED]),
                least_size=held(row[kernels.LEAST_SIZE]),
                least_travel=held(row[kernels.LEAST_TRAVEL]),
                least=least,
                most_weight=held(row[kernels.MOST_WEIGHT]),
                offset_limit=held(row[kernels.OFFSET_LIMIT]),
                weight=weight.astype(float)[:, None],
                gaps=np.diff(threshold.astype(float))[:, None],
            )
        )
    return tuple(found)


class Learner:
    """An actuator's inverse that learns. Its numbers have the runs as their last index, the plays ahead of it."""

    def __init__(self, law: Law, phase: int, rounded: Roundings) -> None:
        """At rest with the frozen weights; ``phase`` is where its cycle begins."""
        n, runs = law.weight.size, rounded.runs
        self.law, self.phase, self.rounded = law, phase % law.cycle, rounded
        self.learnt, self.weight = (law.weight + np.zeros((n, runs)) for _ in range(2))
        self.slope = np.cumsum(self.weight, axis=0)
        self.next_reciprocal = 1.0 / self.slope
        self.play, self.sum, self.mean, self.swung = (np.zeros((n, runs)) for _ in range(4))
        self.slow, self.offset, self.total, self.pivot, self.stride = (np.zeros(runs) for _ in range(5))
        self.misfit, self.frozen_misfit, self.swing, self.size = (np.zeros(runs) for _ in range(4))
        self.in_use = np.zeros(runs, dtype=bool)
        self._take_over()

    def step(self, target: Floats, raw: Floats) -> tuple[Floats, Floats]:
        """The target without the slow offset, and the drive for it, from target and error of the reading (rad)."""
        self._adapt()
        law, rounded, limit = self.law, self.rounded, self.law.offset_limit
        fast = rounded.total(raw, self.offset, -self.slow)
        self.total = rounded(self.total + fast)
        slow = rounded.total(self.slow, law.share * fast)
        self.slow = np.minimum(np.maximum(slow, -limit), limit)
        self.offset = rounded(self.offset + law.share * (self.slow * self.in_use - self.offset))
        target = rounded(target - self.offset)
        low, high = target - self.threshold, target + self.threshold
        play = np.maximum(low, np.minimum(high, self.play))
        if rounded.unit:
            play = np.where((play != self.play) & (self.threshold > 0.0), rounded(play), play)
        self.play = play
        self.sum = rounded(self.sum + self.play)
        self.phase = (self.phase + 1) % law.cycle
        return target, rounded.total(*(self.volts * self.play), operations=len(play) + 1)

    def _adapt(self) -> None:
        law, behind = self.law, self.phase - self.law.delay
        if self.phase == 0:
            self._look()
        elif behind == 0:
            self._judge()
        elif 0 < behind <= law.weight.size:
            self._learn(behind - 1)

    def _take_over(self) -> None:
        """The new weights come into use."""
        rounded, n = self.rounded, len(self.slope)
        steps = np.cumsum(self.slope[:-1] * self.law.gaps, axis=0)
        self.threshold = np.vstack([np.zeros((1, self.rounded.runs)), rounded(steps, n + 1)])
        self.reciprocal = self.next_reciprocal.copy()
        self.volts = rounded(np.diff(self.reciprocal, axis=0, prepend=0.0))

    def _look(self) -> None:
        law, n = self.law, len(self.slope)
        self.slow, self.offset = (self.rounded(each + self.pivot) for each in (self.slow, self.offset))
        self.pivot = np.zeros_like(self.pivot)
        plays = self.slope * self.reciprocal * -np.diff(self.play, axis=0, append=0.0)
        self.play = self.rounded.totals_from_beyond(plays, n + 4)
        mirrors = self.reciprocal * -np.diff(self.sum, axis=0, append=0.0) / law.cycle
        mirror = self.rounded.totals_from_beyond(mirrors, n + 4)
        self.sum = np.zeros_like(self.sum)
        self.mean = self.rounded.total(self.mean, law.forgotten * (mirror - self.mean), operations=3)
        swung = self.rounded(mirror - self.mean)
        self.swung = np.where(np.abs(swung) > law.least_travel, swung, 0.0)
        self._take_over()

    def _judge(self) -> None:
        law, q, rounded = self.law, self.swung, self.rounded
        fast = rounded(self.total / law.cycle, 2)
        self.total = np.zeros_like(self.total)
        error, frozen_error = (self._beside(fast, self.weight - each) for each in (self.learnt, law.weight))
        swing, size = (rounded.total(*(each * q), operations=len(q) + 1) for each in (law.weight, q))
        e, e_frozen = (rounded(x - np.clip(x, -law.dead_zone, law.dead_zone)) for x in (error, frozen_error))
        self.misfit = self._averaged(self.misfit, e * e)
        self.frozen_misfit = self._averaged(self.frozen_misfit, e_frozen * e_frozen)
        self.swing, self.size = self._averaged(self.swing, swing * swing), self._averaged(self.size, size)
        suspect = np.minimum(self.misfit, self.frozen_misfit) > kernels.SUSPECT * self.swing
        comes = rounded(self.misfit + law.dead_zone**2) < kernels.TAKE_UP * self.frozen_misfit
        stays = self.in_use & (self.misfit <= kernels.KEEP_UP * self.frozen_misfit)
        self.in_use = ~suspect & (comes | stays)
        stride = rounded(law.gain * e / (np.maximum(self.size, size) + law.least_size), 3)
        self.stride = np.where(suspect, 0.0, stride)

    def _beside(self, fast: Floats, weights: Floats) -> Floats:
        """The error of the prediction with weights that are so much less than those in use."""
        return self.rounded.total(fast, *(weights * self.swung), operations=2 * len(weights) + 1)

    def _averaged(self, mean: Floats, now: Floats) -> Floats:
        return self.rounded(mean + self.law.forgotten * (now - mean), 4)

    def _learn(self, j: int) -> None:
        law, rounded, below = self.law, self.rounded, self.slope[j - 1] if j else 0.0
        change = np.clip(rounded(self.stride * self.swung[j]), -law.speed, law.speed)
        self.learnt[j] = np.clip(rounded(self.learnt[j] + change), law.least[j], law.most_weight)
        goal = np.where(self.in_use, self.learnt[j], law.weight[j])
        move = np.clip(rounded(goal - self.weight[j]), -law.speed, law.speed)
        self.pivot = rounded.total(self.pivot, -move * self.mean[j])
        moved = rounded(self.weight[j] + move)
        self.weight[j] = np.where(np.abs(goal - self.weight[j]) <= law.speed, goal, moved)  # exact between near numbers
        self.slope[j] = rounded(self.weight[j] + below)
        self.next_reciprocal[j] = rounded(1.0 / self.slope[j])
