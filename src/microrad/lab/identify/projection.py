"""The search behind a Bouc-Wen fit: variable projection, many starts, and the slope bound of an admissible mirror.

`theta` holds the four searched numbers, scaled to order one: d2 and delta times the rate limit, and the logarithms of
k_settled and k_reversal times the peak-to-peak drive (see `bouc_wen`). `values` holds the six parameters in SI units.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from microrad.core.kernels import bouc_wen_response
from microrad.lab.identify.records import FloatArray, Prepared, Progress, centred, fastest_rate, span
from microrad.mirror.hysteresis import BoucWen

SLOPE_TOLERANCE = 1e-3
_LOWER = np.array([-1.0, -3.0, math.log(0.05), math.log(0.05)])
_UPPER = np.array([1.0, 10.0, math.log(1e5), math.log(1e5)])
_GRID_DELTA = (0.0, 1.0, 2.0, 4.0)
_GRID_SETTLED = (2.0, 8.0, 30.0, 120.0)
_GRID_REVERSAL = (0.3, 1.0, 4.0, 20.0)
_SCREEN_SAMPLES = 12_000


class Problem:
    """The projected residual of a set of records as a function of the four searched numbers, scaled to order one."""

    def __init__(
        self, records: tuple[Prepared, ...], share: float, free_offset: bool = True, rate_limit: float | None = None
    ) -> None:
        """`share` is the largest part of d1 that epsilon may take back after a slow reversal; inf leaves it free."""
        self.records = records
        self.free_offset = free_offset
        self.share = share
        self.rate_limit = rate_limit or fastest_rate(records)
        self.drive_span_v = max(float(np.ptp(r.drive_v)) for r in records)
        self.output_span_rad = span(records)
        self.measured = np.concatenate([r.output_rad[r.start :] for r in records])
        self.target = self.centred(self.measured)
        self.scale = 1.0 / (self.output_span_rad * math.sqrt(self.target.size))

    def centred(self, columns: FloatArray) -> FloatArray:
        """Columns less their mean in each record, which marginalises the offsets; unchanged where there is none."""
        return centred(columns, self.records) if self.free_offset else columns

    def physical(self, theta: FloatArray) -> tuple[float, float, float, float]:
        """d2, delta (s/V), k_settled and k_reversal (1/V)."""
        return (
            float(theta[0]) / self.rate_limit,
            float(theta[1]) / self.rate_limit,
            math.exp(theta[2]) / self.drive_span_v,
            math.exp(theta[3]) / self.drive_span_v,
        )

    def columns(self, theta: FloatArray) -> FloatArray:
        """Responses to unit d1 and to unit epsilon over the used samples, less their mean in each record."""
        d2, delta, settled, reversal = self.physical(theta)
        alpha, beta = (settled + reversal) / 2, (settled - reversal) / 2
        row = np.array([1.0, d2, 1.0, delta, alpha, beta, self.rate_limit, 0.0])
        parts = []
        for record in self.records:
            output, h, _ = bouc_wen_response(record.drive_v, record.step_s, row, 0.0)
            parts.append(np.column_stack((output - h, h))[record.start :])
        return self.centred(np.concatenate(parts))

    def linear(self, columns: FloatArray, theta: FloatArray) -> FloatArray:
        """The best d1 and epsilon; where epsilon takes back more of d1 than allowed, the best on that bound."""
        size = np.sqrt(np.einsum("ij,ij->j", columns, columns)) + 1e-300
        gram = (columns.T @ columns) / np.outer(size, size) + 1e-13 * np.eye(2)
        best = np.linalg.solve(gram, (columns.T @ self.target) / size) / size
        bound = self.bound(theta)
        if best[1] / best[0] >= -bound:
            return np.asarray(best)
        joint = columns[:, 0] - bound * columns[:, 1]
        d1 = float(joint @ self.target) / float(joint @ joint)
        return np.array([d1, -bound * d1])

    def bound(self, theta: FloatArray) -> float:
        """Largest -epsilon / d1: after a slow reversal dy/du = d1 + epsilon 2 alpha / k_settled >= (1 - share) d1."""
        _, _, settled, reversal = self.physical(theta)
        return self.share * settled / (settled + reversal)

    def residual(self, theta: FloatArray) -> FloatArray:
        """Measured less modelled, scaled so that half the squared norm is half the squared relative rms."""
        columns = self.columns(theta)
        return np.asarray((self.target - columns @ self.linear(columns, theta)) * self.scale)

    def solve(self, theta: FloatArray) -> FloatArray:
        """The six parameters at a point: the signs of epsilon and beta follow from the linear part."""
        d2, delta, settled, reversal = self.physical(theta)
        d1, epsilon = self.linear(self.columns(theta), theta)
        beta = math.copysign(1.0, epsilon) * (settled - reversal) / 2
        return np.array([d1, d2, epsilon, delta, (settled + reversal) / 2, beta])


def _thinned(problem: Problem) -> Problem:
    """The same problem on at most about 12 000 samples: the kernel is exact for a drive linear between any samples."""
    stride = math.ceil(sum(r.drive_v.size for r in problem.records) / _SCREEN_SAMPLES)
    if stride == 1:
        return problem
    records = tuple(
        Prepared(r.name, r.sha256, r.drive_v[::stride].copy(), r.output_rad[::stride].copy(), r.step_s * stride, start)
        for r in problem.records
        for start in (-(-r.start // stride),)
    )
    return Problem(records, problem.share, problem.free_offset, problem.rate_limit)


# ----------------------------------------------------------------------------------------------------------- search
def multi_start(
    problem: Problem, starts: int, seed: int, on_progress: Progress | None
) -> tuple[FloatArray, FloatArray]:
    """Cost reached from each start, and the best point polished on all samples."""
    screen = _thinned(problem)
    points, costs = [], []
    for done, start in enumerate(_starts(screen, starts, seed), start=1):
        solution = _search(screen, start)
        points.append(solution.x)
        costs.append(float(solution.cost))
        if on_progress is not None:
            on_progress(done, starts, "Bouc-Wen starts")
    return np.array(costs), _search(problem, points[int(np.argmin(costs))]).x


def _starts(problem: Problem, starts: int, seed: int) -> list[FloatArray]:
    """The four best points of a coarse grid in turn, the first as it is and the rest scattered by a factor e^0.4."""
    grid = [
        np.array([0.0, delta, math.log(settled), math.log(settled * ratio)])
        for delta in _GRID_DELTA
        for settled in _GRID_SETTLED
        for ratio in _GRID_REVERSAL
    ]
    centres = sorted(grid, key=lambda theta: float(np.sum(problem.residual(theta) ** 2)))[:4]
    rng = np.random.Generator(np.random.Philox(seed))
    scatter = 0.4 * rng.standard_normal((starts, 4))
    scatter[0] = 0.0
    scatter[:, 0] *= 0.1
    return [np.clip(_scattered(centres[i % 4], scatter[i]), _LOWER + 1e-6, _UPPER - 1e-6) for i in range(starts)]


def _scattered(centre: FloatArray, scatter: FloatArray) -> FloatArray:
    """Log-normal in delta and in the two decay constants, normal in d2, whose sign is open."""
    point = centre + scatter
    point[1] = max(centre[1], 0.2) * math.exp(scatter[1])
    return np.asarray(point)


def _search(problem: Problem, start: FloatArray) -> Any:
    from scipy.optimize import least_squares  # here, to keep start-up cheap

    return least_squares(
        problem.residual,
        start,
        method="trf",
        bounds=(_LOWER, _UPPER),
        diff_step=1e-6,
        ftol=1e-10,
        xtol=1e-8,
        gtol=1e-12,
        max_nfev=100,
    )


def tightened(problem: Problem, best: FloatArray) -> tuple[Problem, FloatArray]:
    """Lower the share of d1 that epsilon may take back until no slope along the recordings is negative.

    The bound holds for slow reversals; at a fast one h is larger than its slow settled value by exp(delta |u'|).
    """
    for _ in range(12):
        values = problem.solve(best)
        lowest = lowest_slope(problem, values) / abs(values[0])
        if lowest >= -SLOPE_TOLERANCE / 2:
            break
        problem.share *= max(0.3, 0.995 / (1.0 - lowest))
        best = _search(problem, best).x
    return problem, best


# ---------------------------------------------------------------------------------------------------------- values
def stacked(problem: Problem, values: FloatArray) -> FloatArray:
    """Model output of the used samples of all records, without offset."""
    row = np.array([*values, problem.rate_limit, 0.0])
    return np.concatenate([bouc_wen_response(r.drive_v, r.step_s, row, 0.0)[0][r.start :] for r in problem.records])


def k_settled(values: FloatArray) -> float:
    """Decay (1/V) towards the settled loop, alpha + sign(epsilon) beta."""
    return float(values[4] + math.copysign(1.0, values[2]) * values[5])


def slope_after_reversal(values: FloatArray) -> float:
    """dy/du just after a slow reversal of a settled loop, positive in the direction of d1 (see hysteresis.BoucWen)."""
    d1, d2, epsilon, delta, alpha, beta = (float(v) for v in values)
    falling = math.copysign(1.0, d1)
    return BoucWen(falling * d1, d2, falling * epsilon, delta, alpha, falling * beta).reversal_slope_rad_v()


def lowest_slope(problem: Problem, values: FloatArray) -> float:
    """Lowest dy/du along the used samples, at the begin of each step, positive in the direction of d1."""
    d1, d2, epsilon, delta, alpha, beta = values
    row = np.array([*values, problem.rate_limit, 0.0])
    lowest = math.inf
    for record in problem.records:
        _, h, _ = bouc_wen_response(record.drive_v, record.step_s, row, 0.0)
        rate = np.diff(record.drive_v)[record.start :] / record.step_s
        before = h[record.start : -1]
        limited = np.clip(rate, -problem.rate_limit, problem.rate_limit)
        slope = d1 * np.exp(-d2 * limited) + epsilon * np.exp(delta * np.abs(limited))
        slope -= beta * np.abs(before) + alpha * np.sign(rate) * before
        lowest = min(lowest, float(np.min(np.sign(d1) * slope[rate != 0.0])))
    return lowest
