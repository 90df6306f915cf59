"""The rate-dependent Bouc-Wen mirror of Eq. 3 (SPIE 11852, 118523B) from recordings, with its uncertainty.

    y = d1 exp(-d2 u') u + h + offset
    h' = epsilon exp(delta |u'|) u' - beta u' |h| - alpha |u'| h

h is homogeneous in epsilon, so y is linear in d1, epsilon and one offset per record; they are solved exactly at every
trial (variable projection) and four numbers are searched: d2, delta and the two decay constants

    k_settled = alpha + sign(epsilon) beta        k_reversal = alpha - sign(epsilon) beta        (1/V)

Both positive is alpha > |beta|, hence a bounded h, whatever the signs. At a rate |u'| a settled loop has
|h| = |epsilon| exp(delta |u'|) / k_settled, and just after a reversal

    dh/du = epsilon exp(delta |u'|) + sign(epsilon) k_reversal |h| = epsilon exp(delta |u'|) 2 alpha / k_settled
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.kernels import bouc_wen_response
from microrad.core.progress import Progress
from microrad.lab.identify.records import (
    DEFAULT_UNITS,
    IdentificationError,
    SiRecord,
    Units,
    centred,
    fastest_rate,
    no_progress,
    one_rate_only,
    si_records,
    span,
    split_by_record,
)
from microrad.lab.identify.statistics import Estimate, central_differences, colour_inflation, correlation, percent
from microrad.lab.recording import Recording
from microrad.mirror.hysteresis import BoucWen, sign_reversed

SLOPE_TOLERANCE = 1e-3
_LOWER = np.array([-1.0, -3.0, math.log(0.05), math.log(0.05)])
_UPPER = np.array([1.0, 10.0, math.log(1e5), math.log(1e5)])


class BoucWenProblem:
    """The projected residual of a set of records as a function of the four searched numbers, scaled to order one."""

    def __init__(self, records: tuple[SiRecord, ...], share: float, rate_limit: float | None = None) -> None:
        """`share` is the largest part of d1 that epsilon may take back after a slow reversal; inf leaves it free."""
        self.records = records
        self.share = share
        self.rate_limit = rate_limit or fastest_rate(records)
        self.drive_span_v = max(float(np.ptp(r.drive_v)) for r in records)
        self.output_span_rad = span(records)
        self.measured = np.concatenate([r.output_rad[r.start :] for r in records])
        self.target = centred(self.measured, records)
        self.scale = 1.0 / (self.output_span_rad * math.sqrt(self.target.size))

    def physical(self, theta: Floats) -> tuple[float, float, float, float]:
        """The searched numbers in their units: d2, delta (s/V), k_settled and k_reversal (1/V)."""
        return (
            float(theta[0]) / self.rate_limit,
            float(theta[1]) / self.rate_limit,
            math.exp(theta[2]) / self.drive_span_v,
            math.exp(theta[3]) / self.drive_span_v,
        )

    def columns(self, theta: Floats) -> Floats:
        """Responses to unit d1 and to unit epsilon over the used samples, less their mean in each record."""
        d2, delta, settled, reversal = self.physical(theta)
        alpha, beta = (settled + reversal) / 2, (settled - reversal) / 2
        row = np.array([1.0, d2, 1.0, delta, alpha, beta, self.rate_limit, 0.0])
        parts = []
        for record in self.records:
            output, h, _ = bouc_wen_response(record.drive_v, record.step_s, row, 0.0)
            parts.append(np.column_stack((output - h, h))[record.start :])
        return centred(np.concatenate(parts), self.records)

    def linear(self, columns: Floats, theta: Floats) -> Floats:
        """The best d1 and epsilon, shape (2,).

        Where epsilon would take back more of d1 than allowed, they are the best on that bound.

        Args:
            columns: Responses to unit d1 and to unit epsilon, as `columns` gives them, shape (samples, 2).
            theta: The four searched numbers, scaled.
        """
        size = np.sqrt(np.einsum("ij,ij->j", columns, columns)) + 1e-300
        gram = (columns.T @ columns) / np.outer(size, size) + 1e-13 * np.eye(2)
        best = np.linalg.solve(gram, (columns.T @ self.target) / size) / size
        bound = self.bound(theta)
        if best[1] / best[0] >= -bound:
            return np.asarray(best)
        joint = columns[:, 0] - bound * columns[:, 1]
        d1 = float(joint @ self.target) / float(joint @ joint)
        return np.array([d1, -bound * d1])

    def bound(self, theta: Floats) -> float:
        """Largest -epsilon / d1: after a slow reversal dy/du = d1 + epsilon 2 alpha / k_settled >= (1 - share) d1."""
        _, _, settled, reversal = self.physical(theta)
        return self.share * settled / (settled + reversal)

    def residual(self, theta: Floats) -> Floats:
        """Measured less modelled, scaled so that half the squared norm is half the squared relative rms."""
        columns = self.columns(theta)
        return np.asarray((self.target - columns @ self.linear(columns, theta)) * self.scale)

    def solve(self, theta: Floats) -> Floats:
        """The six parameters at a point: the signs of epsilon and beta follow from the linear part."""
        d2, delta, settled, reversal = self.physical(theta)
        d1, epsilon = self.linear(self.columns(theta), theta)
        beta = math.copysign(1.0, epsilon) * (settled - reversal) / 2
        return np.array([d1, d2, epsilon, delta, (settled + reversal) / 2, beta])


def _thin_problem(problem: BoucWenProblem) -> BoucWenProblem:
    """The same problem on at most about 12 000 samples: the kernel is exact for a drive linear between any samples."""
    stride = math.ceil(sum(r.drive_v.size for r in problem.records) / 12_000)
    if stride == 1:
        return problem
    return BoucWenProblem(tuple(r.every(stride) for r in problem.records), problem.share, problem.rate_limit)


# ----------------------------------------------------------------------------------------------------------- search
def search_from_starts(problem: BoucWenProblem, starts: int, seed: int, on_progress: Progress) -> tuple[Floats, Floats]:
    """Cost reached from each start, shape (starts,), and the best point polished on all samples, shape (4,).

    Args:
        problem: The problem, with all samples.
        starts: Number of scattered starts.
        seed: Seed of the starts.
        on_progress: Called with the starts done, their number and what is done.
    """
    screen = _thin_problem(problem)
    points, costs = [], []
    for done, start in enumerate(_starts(screen, starts, seed), start=1):
        solution = _search(screen, start)
        points.append(solution.x)
        costs.append(float(solution.cost))
        on_progress(done, starts, "Bouc-Wen starts")
    return np.array(costs), _search(problem, points[int(np.argmin(costs))]).x


def _starts(problem: BoucWenProblem, starts: int, seed: int) -> list[Floats]:
    """The four best points of a coarse grid in turn, the first as it is and the rest scattered.

    The scatter is log-normal (e^0.4) in delta and in the two decay constants, and normal in d2, whose sign is open.
    """
    grid = [
        np.array([0.0, delta, math.log(settled), math.log(settled * ratio)])
        for delta in (0.0, 1.0, 2.0, 4.0)
        for settled in (2.0, 8.0, 30.0, 120.0)
        for ratio in (0.3, 1.0, 4.0, 20.0)
    ]
    centres = sorted(grid, key=lambda theta: float(np.sum(problem.residual(theta) ** 2)))[:4]
    rng = np.random.Generator(np.random.Philox(seed))
    scatter = 0.4 * rng.standard_normal((starts, 4))
    scatter[0] = 0.0
    scatter[:, 0] *= 0.1
    found = []
    for i in range(starts):
        point = centres[i % 4] + scatter[i]
        point[1] = max(centres[i % 4][1], 0.2) * math.exp(scatter[i, 1])
        found.append(np.clip(point, _LOWER + 1e-6, _UPPER - 1e-6))
    return found


def _search(problem: BoucWenProblem, start: Floats) -> Any:
    from scipy.optimize import least_squares

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


def with_tightened_bound(problem: BoucWenProblem, best: Floats) -> tuple[BoucWenProblem, Floats]:
    """The problem and its best point once no slope along the recordings is negative any more.

    For that the share of d1 that epsilon may take back is lowered. The bound holds for slow reversals; at a fast one h
    is larger than its slow settled value by exp(delta |u'|).

    Args:
        problem: The problem, whose share is changed in place.
        best: The best point so far, the four searched numbers.
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
def stacked_output(problem: BoucWenProblem, values: Floats) -> Floats:
    """Model output (rad) of the used samples of all records one behind the other, without offset.

    Args:
        problem: The problem with its records.
        values: The six parameters in the order of `PARAMETERS`.
    """
    row = np.array([*values, problem.rate_limit, 0.0])
    return np.concatenate([bouc_wen_response(r.drive_v, r.step_s, row, 0.0)[0][r.start :] for r in problem.records])


def k_settled(values: Floats) -> float:
    """Decay (1/V) towards the settled loop, alpha + sign(epsilon) beta."""
    return float(values[4] + math.copysign(1.0, values[2]) * values[5])


def made_rising(model: BoucWen) -> BoucWen:
    """The model, turned over where its d1 is negative."""
    return model if model.d1_rad_v > 0.0 else sign_reversed(model)


def lowest_slope(problem: BoucWenProblem, values: Floats) -> float:
    """Lowest slope dy/du (rad/V) along the used samples, at the begin of each step, positive in the direction of d1.

    Args:
        problem: The problem with its records.
        values: The six parameters in the order of `PARAMETERS`.
    """
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


PARAMETERS = ("d1", "d2", "epsilon", "delta", "alpha", "beta")
PARAMETER_UNITS = ("rad/V", "s/V", "rad/V", "s/V", "1/V", "1/V")

_SAME_COST = 0.5e-12  # a residual of one millionth of the peak-to-peak is no residual


class NotIdentified(NamedTuple):
    """A parameter that the recordings do not fix, and why."""

    name: str
    reason: str


@dataclass(frozen=True, eq=False)
class BoucWenFit(Estimate):
    """A model of Eq. 3 in SI units, with what is known about the uncertainty of its six parameters.

    The signs follow the recordings: d1 is negative where the output falls with the drive. `covariance` (6 x 6, order
    of `PARAMETERS`) is estimated from the residuals and inflated by `colour_inflation`, because residuals of
    neighbouring samples are alike. `start_rms_percent` is the residual reached from each start, `agreeing_starts` how
    many came to the cost of the best one within 0.1 %. `slope_after_reversal_rad_per_v` is dy/du just after a slow
    reversal of a settled loop and `lowest_slope_rad_per_v` the lowest along the recordings, both counted positive in
    the direction of d1: a negative value is a mirror that first moves the wrong way, so `admissible` is false. (The
    small lag or lead that d2 gives is none of it: both slopes are taken at constant rate.)
    """

    model: BoucWen
    offsets_rad: tuple[float, ...]
    units: Units
    covariance: Floats
    colour_inflation: float
    condition_number: float
    not_identified: tuple[NotIdentified, ...]
    residual_rms_percent: float
    start_rms_percent: tuple[float, ...]
    agreeing_starts: int
    slope_after_reversal_rad_per_v: float
    lowest_slope_rad_per_v: float
    admissible: bool
    constrained: bool
    samples_used: int

    parameter_count = 6

    @property
    def name(self) -> str:
        """The name of the model, as in `MODELS`."""
        return "bouc_wen_admissible" if self.constrained else "bouc_wen"

    @property
    def falling(self) -> bool:
        """Whether the output falls with the drive."""
        return self.model.d1_rad_v < 0

    @property
    def values(self) -> Floats:
        """The six parameters in the order of `PARAMETERS`, SI units."""
        return np.array(self.model.row[:6])

    @property
    def rate_limit_v_per_s(self) -> float:
        """Fastest rate of the drive that the fit has seen."""
        return self.model.rate_limit_v_s

    @property
    def settled_hysteresis_rad(self) -> tuple[float, float]:
        """|h| of a slow settled loop, |epsilon| / k_settled, and its standard error; better fixed than its parts."""
        settled = k_settled(self.values)
        value = abs(self.model.epsilon_rad_v) / settled
        sign = math.copysign(1.0, self.model.epsilon_rad_v)
        gradient = np.array([0, 0, sign / settled, 0, -value / settled, -sign * value / settled])
        return value, float(math.sqrt(max(0.0, gradient @ self.covariance @ gradient)))

    def response(self, drive_v: Floats, step_s: float) -> tuple[Floats, int]:
        """Output (rad) without offset for a drive (V) from h = 0, and the number of rate-clamped samples.

        Args:
            drive_v: Drive, in V, shape (samples,).
            step_s: Time between samples, in s.
        """
        output, _, clamped = bouc_wen_response(drive_v, step_s, np.array(self.model.row[:8]), 0.0)
        return output, int(clamped)


def fit_bouc_wen(
    recordings: Sequence[Recording],
    *,
    starts: int = 12,
    seed: int = 0,
    admissible: bool = False,
    on_progress: Progress | None = None,
    units: Units = DEFAULT_UNITS,
) -> BoucWenFit:
    """Fit Eq. 3 to all recordings at once, every sample with equal weight; each has an offset and a memory of its own.

    Trust-region-reflective least squares from several starts: the best points of a coarse grid, scattered log-normally.
    h starts at zero, and the residuals of the first twentieth are left out (`records.lead`, `records.memory`). The rate
    in the exponents is clamped at the fastest rate of the recordings, as it is in simulation.

    Args:
        recordings: Loops of one drive and one output each.
        starts: Number of starts, at least 1.
        seed: Seed of the Philox stream that scatters them.
        admissible: Whether the local slope behind a reversal is kept from turning against d1.
        on_progress: Called with the starts done, their number and what is done.
        units: Units of the recordings.

    Raises:
        IdentificationError: For recordings without a reversal, with several channels, or without a start.
    """
    if starts < 1:
        raise IdentificationError(f"{starts} starts were asked for; give at least 1, better 10 or more.")
    problem = BoucWenProblem(si_records(recordings, units), 1.0 if admissible else math.inf)
    costs, best = search_from_starts(problem, starts, seed, on_progress or no_progress)
    if admissible:
        problem, best = with_tightened_bound(problem, best)
    return _report(problem, problem.solve(best), units, costs, admissible)


# ---------------------------------------------------------------------------------------------------------- report
def _report(problem: BoucWenProblem, values: Floats, units: Units, costs: Floats, constrained: bool) -> BoucWenFit:
    residual = problem.measured - stacked_output(problem, values)
    offsets = tuple(float(part.mean()) for part in split_by_record(residual, problem.records))
    residual = centred(residual, problem.records)
    colour = colour_inflation(split_by_record(residual, problem.records))
    own = sum(record.own_count for record in problem.records)
    variance = colour * float(residual @ residual) / max(1, residual.size - values.size - own)
    share = -float(values[2] * 2 * values[4] / values[0]) / k_settled(values)
    at_bound = constrained and share > 0.999 * problem.share
    sizes = _sizes(problem, values)
    jacobian = _jacobian(problem, values, sizes)
    covariance = _covariance(jacobian, sizes, variance, values if at_bound else None)
    rms, _ = percent(residual, problem.output_span_rad)
    d1, d2, epsilon, delta, alpha, beta = values.tolist()
    model = BoucWen(d1, d2, epsilon, delta, alpha, beta, problem.rate_limit)
    slope, lowest = made_rising(model).reversal_slope_rad_v(), lowest_slope(problem, values)
    return BoucWenFit(
        model=model,
        offsets_rad=offsets,
        units=units,
        covariance=covariance,
        colour_inflation=colour,
        condition_number=float(np.linalg.cond(jacobian * sizes)),
        not_identified=_not_identified(values, covariance, one_rate_only(problem.records), at_bound),
        residual_rms_percent=rms,
        start_rms_percent=tuple(100 * math.sqrt(2 * cost) for cost in costs),
        agreeing_starts=int(np.sum(costs <= costs.min() * (1 + 1e-3) + _SAME_COST)),
        slope_after_reversal_rad_per_v=slope,
        lowest_slope_rad_per_v=lowest,
        admissible=bool(min(slope, lowest) >= -SLOPE_TOLERANCE * abs(values[0])),
        constrained=constrained,
        samples_used=residual.size,
    )


def _sizes(problem: BoucWenProblem, values: Floats) -> Floats:
    """A step of order one for each parameter: its own size, or what matters at the fastest rate."""
    least = np.array(
        [0, 1e-3 / problem.rate_limit, 1e-9 * abs(values[0]), 1e-2 / problem.rate_limit, 0, 1e-3 * values[4]]
    )
    return np.asarray(np.maximum(np.abs(values), least))


def _jacobian(problem: BoucWenProblem, values: Floats, sizes: Floats) -> Floats:
    """d output / d parameter by central differences, less the mean in each record (the offsets are marginalised)."""
    return centred(central_differences(partial(stacked_output, problem), values, 1e-4 * sizes), problem.records)


def _covariance(jacobian: Floats, sizes: Floats, variance: float, bounded: Floats | None) -> Floats:
    """variance (J^T J)^-1, on the plane of the active slope bound where there is one."""
    free = np.eye(6)
    if bounded is not None:
        normal = _bound_gradient(bounded) * sizes
        free = np.linalg.svd(normal[None, :])[2][1:].T
    _, singular, vectors = np.linalg.svd(jacobian * sizes @ free, full_matrices=False)
    singular = np.maximum(singular, 1e-14 * singular[0])
    root = sizes[:, None] * (free @ vectors.T / singular)
    return np.asarray(variance * root @ root.T)


def _bound_gradient(values: Floats) -> Floats:
    """Gradient of epsilon 2 alpha / (k_settled d1), which the active bound holds constant, over the six parameters."""
    d1, _, epsilon, _, alpha, _ = values
    settled = k_settled(values)
    share = epsilon * 2 * alpha / (settled * d1)
    sign = math.copysign(1.0, epsilon)
    return np.array([-share / d1, 0, share / epsilon, 0, share / alpha - share / settled, -sign * share / settled])


def _not_identified(values: Floats, covariance: Floats, one_rate: bool, at_bound: bool) -> tuple[NotIdentified, ...]:
    """Parameters with a relative standard error above 0.5 or a correlation above 0.95, each with its reason."""
    error = np.sqrt(np.diag(covariance)) / np.maximum(np.abs(values), 1e-300)
    between = np.abs(correlation(covariance)) - np.eye(6)
    found = []
    for i, name in enumerate(PARAMETERS):
        partner = int(np.argmax(between[i]))
        if error[i] > 0.5:
            fact = f"relative standard error {100 * error[i]:.0f} %"
        elif between[i, partner] > 0.95:
            fact = f"correlation {between[i, partner]:.3f} with {PARAMETERS[partner]}"
        else:
            continue
        found.append(NotIdentified(name, f"{fact}: {_reason(name, one_rate, at_bound)}"))
    return tuple(found)


def _reason(name: str, one_rate: bool, at_bound: bool) -> str:
    if name in ("d2", "delta") and one_rate:
        return "the recordings hold loops of one rate only; record the same loop at two more frequencies"
    if name == "d2":
        return "its effect on the output is below the noise; faster loops would show it"
    if name == "delta":
        return "the loops widen too little with rate to tell; record faster loops"
    if name in ("epsilon", "alpha", "beta"):
        bound = " (on the bound of the admissible slope)" if at_bound else ""
        return (
            "loops fix the settled hysteresis |epsilon| / (alpha + sign(epsilon) beta), and only the few samples "
            f"behind each reversal separate its parts{bound}; record small loops with many reversals"
        )
    return (
        "a large hysteresis that settles soon after each reversal looks like part of the linear slope; larger loops "
        "tell them apart"
    )
