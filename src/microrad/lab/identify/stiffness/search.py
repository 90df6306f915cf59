"""Search for the numbers of a mirror: least squares over many records whose gradient is cheap and curvature dear.

The gradient of all records comes from one pass back along each path (`gradient`). The curvature is that of a few of
them (Gauss-Newton, `tangents.curvature`), taken anew every few steps and corrected in between by the gradients
(limited-memory BFGS; J. Nocedal and S. Wright, Numerical Optimization, 2nd ed., 2006, algorithm 7.4). Numbers
are kept within their limits: those that a step would take beyond stop there, and the step of the others is worked out
anew for that.
"""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.lab.identify.stiffness import tangents
from microrad.lab.identify.stiffness.gradient import squared_error_slope
from microrad.lab.identify.stiffness.model import Numbers
from microrad.lab.identify.stiffness.springs import MOST_SOFTENING, Springs
from microrad.lab.identify.stiffness.tangents import Steady

_DAMPING, _LEAST_DAMPING = 1e-2, 1e-5  # the matrix is summed in single precision
_MEMORY = 30
_PER_NUMBER = 40  # samples for each number, of which the curvature is taken
_ENDS = (0.5, 1.0)  # where in the period they end, in equal parts: small enough to keep all processors busy
_TRIALS, _HALVINGS = 2, 12  # trials of a step that are simulated, and in all
_REFUSED = 8  # steps in a row that lead nowhere: the end
_REFUSAL, _SUCCESS = 3.0, 2.0  # what a step that leads nowhere raises the damping by, and what others change it by
_BOUNDED = 6  # most times that a step is worked out anew for the numbers that it takes to their limits
_FLOOR = 0.03  # least curvature of a number, in the mean of its kind: one that hardly acts yet is not to run away


class _Step(NamedTuple):
    """Where a step leads, its cost and slope, and how many were tried in vain."""

    free: Floats
    cost: float
    slope: Floats
    refusals: int


class Search:
    """Least squares over records."""

    def __init__(
        self, springs: Springs, records: Sequence[Steady], weights: Floats, few: Sequence[int], pool: ThreadPoolExecutor
    ) -> None:
        """What is searched.

        Args:
            springs: The free numbers, and how they make a mirror.
            records: The records.
            weights: What a squared error counts in each of them.
            few: Numbers of the records of which the curvature is taken.
            pool: Threads in which records are simulated side by side.
        """
        self.springs, self.records, self.weights, self.few, self.pool = springs, records, weights, list(few), pool
        self.wanted = np.asarray(springs.matrix.any(axis=1))

    def cost(self, free: Floats) -> float:
        """Weighed squared error of all records; infinite for numbers that are not admitted."""
        numbers = self.springs.numbers(free)
        if (plant := self._plant(numbers)) is None:
            return math.inf
        found = self.pool.map(lambda r: tangents.squared_error(plant, r, numbers.delay_s), self.records)
        return float(self.weights @ np.array(list(found)))

    def _plant(self, numbers: Numbers) -> kernels.PlayPlant | None:
        """The discrete plant; None for numbers that are not admitted."""
        if self.springs.softening(numbers) > MOST_SOFTENING:
            return None
        try:
            return tangents.play_plant(numbers, self.records[0].step_s)
        except ValueError:  # the loop through the plays is no contraction at this step
            return None

    def slope(self, free: Floats) -> tuple[float, Floats]:
        """The cost and its derivative by each free number; no slope where the cost is infinite."""
        numbers = self.springs.numbers(free)
        if (plant := self._plant(numbers)) is None:
            return math.inf, np.zeros_like(free)
        found = list(self.pool.map(lambda r: squared_error_slope(plant, numbers, r), self.records))
        cost = float(self.weights @ np.array([each.cost for each in found]))
        return cost, np.asarray(self.springs.matrix.T @ (self.weights @ np.array([each.gradient for each in found])))

    def curvature(self, free: Floats) -> Floats:
        """Gauss-Newton matrix of the few records, scaled to all as if they were alike in length."""
        numbers = self.springs.numbers(free)
        plant = tangents.play_plant(numbers, self.records[0].step_s)
        own, samples = self.weights[self.few], sum(self.records[k].output.size for k in self.few)
        part = min(_PER_NUMBER * free.size / samples, 1.0) / len(_ENDS)

        def weighed(at: tuple[int, float]) -> Floats:
            k, end = at
            found = tangents.curvature(plant, numbers, self.records[k], end, part, self.wanted)
            return np.asarray(self.weights[k] / len(_ENDS) * found)

        matrix = sum(self.pool.map(weighed, product(self.few, _ENDS)), np.zeros(()))
        T = self.springs.matrix[self.wanted]
        return np.asarray(2.0 * self.weights.sum() / own.sum() * (T.T @ matrix @ T))

    def size(self, curvature: Floats) -> Floats:
        """Scale of each free number."""
        diagonal = np.diag(curvature).copy()
        for kind in dict.fromkeys(self.springs.kinds.tolist()):
            own = self.springs.kinds == kind
            diagonal[own] += _FLOOR * diagonal[own].mean()
        return np.asarray(np.sqrt(np.maximum(diagonal, 1e-12 * diagonal.max())))

    def minimise(
        self, free: Floats, iterations: int, refresh: int, on_step: Callable[[int, Floats, float], bool]
    ) -> Floats:
        """The free numbers at the end of the search.

        Args:
            free: Those to begin with.
            iterations: Largest number of steps.
            refresh: Steps until the curvature is taken anew.
            on_step: Told the steps done, the numbers and the cost; ends the search by what it returns.
        """
        damping = _DAMPING
        cost, slope = self.slope(free)
        pairs: list[tuple[Floats, Floats]] = []
        since, refused, done = refresh, 0, 0
        while done < iterations:
            if since >= refresh:
                matrix, since = self.curvature(free), 0
                size = self.size(matrix)
                matrix = matrix / np.outer(size, size)
                pairs.clear()
            move, damping = self._bounded_step(free, slope, (matrix, size, pairs), damping)
            step = self._along(free, move, cost, slope)
            if step is None:
                damping, since, refused = _REFUSAL * damping, refresh if since else 0, refused + 1
                if refused > _REFUSED:
                    break
                continue
            damping = _SUCCESS * damping if step.refusals else max(damping / _SUCCESS, _LEAST_DAMPING)
            refused, since, done = 0, since + 1, done + 1
            pairs = [*pairs, (step.free - free, step.slope - slope)][-_MEMORY:]
            free, cost, slope = step.free, step.cost, step.slope
            if on_step(done, free, cost):
                break
        return free

    def _bounded_step(
        self, free: Floats, slope: Floats, curvature: tuple[Floats, Floats, list[tuple[Floats, Floats]]], damping: float
    ) -> tuple[Floats, float]:
        """The step to the least cost within the limits, as far as the curvature knows, and the damping it took.

        Args:
            free: The numbers to begin with.
            slope: Derivative of the cost by each of them.
            curvature: The matrix in units of each number's size, the sizes, and what the last steps add to it.
            damping: The least damping.
        """
        matrix, size, pairs = curvature
        loose, move = self.springs.loose(free, slope), np.zeros_like(free)
        for _ in range(_BOUNDED):
            pull = slope + size * (matrix @ (size * np.where(loose, 0.0, move)))
            factor, damping = _factor(matrix[np.ix_(loose, loose)], damping)
            move[loose] = -_newton(factor, pairs, pull, size, loose)
            allowed = self.springs.within(free + move)
            beyond = loose & (allowed != free + move)
            if not beyond.any():
                break
            move[beyond] = allowed[beyond] - free[beyond]
            loose &= ~beyond
        return move, damping

    def _along(self, free: Floats, move: Floats, cost: float, slope: Floats) -> "_Step | None":
        """Where a step leads that lowers the cost; None where none does. The whole step is tried with its slope."""
        step, refusals = 1.0, 0
        for _ in range(_HALVINGS):
            trial = self.springs.within(free + step * move)
            bound = cost + 1e-4 * min(float(slope @ (trial - free)), 0.0)
            found, its_slope = self.slope(trial) if step == 1.0 else (self.cost(trial), None)
            if found < bound:
                return _Step(trial, found, self.slope(trial)[1] if its_slope is None else its_slope, refusals)
            refusals += math.isfinite(found)
            if refusals >= _TRIALS:
                break
            step *= 0.3 if math.isfinite(found) else 0.5
        return None


def _factor(matrix: Floats, damping: float) -> tuple[tuple[Floats, bool], float]:
    """Cholesky factor of a matrix with damping, raised until there is one."""
    while True:
        try:
            return cho_factor(matrix + damping * np.eye(len(matrix))), damping
        except np.linalg.LinAlgError:
            damping *= 8.0


def _newton(
    factor: tuple[Floats, bool],
    pairs: Sequence[tuple[Floats, Floats]],
    slope: Floats,
    size: Floats,
    loose: np.ndarray,
) -> Floats:
    """Inverse curvature times the slope over the loose numbers: that of a few records, corrected by the last steps."""
    scaled = [((s * size)[loose], (y / size)[loose]) for s, y in pairs]
    scaled = [(s, y) for s, y in scaled if s @ y > 0.0]
    direction, shares = (slope / size)[loose], []
    for s, y in reversed(scaled):
        shares.append((s @ direction) / (s @ y))
        direction = direction - shares[-1] * y
    direction = cho_solve(factor, direction)
    for (s, y), share in zip(scaled, reversed(shares), strict=True):
        direction = direction + s * (share - (y @ direction) / (s @ y))
    return np.asarray(direction / size[loose])
