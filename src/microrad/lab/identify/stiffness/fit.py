"""One mirror for all amplitudes: linear modes in feedback with hysteresis, fitted to multisines of several amplitudes.

The gain of a piezo mirror rises and its resonances fall with the amplitude, because its actuators are hysteretic
springs that soften: plays and a polynomial of the strain act back on every mode. A linear model that is right at one
amplitude is wrong at the next. `fit_hysteretic_stiffness` fits modes and springs together, with exact derivatives along
the simulated path and so that no drive makes the mirror run away (`springs`), and `predicted_error` says how well the
result predicts a record that it has not seen.
"""

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.core.units import counted
from microrad.lab.identify.linear.response import check_alike, response_from_periods
from microrad.lab.identify.records import IdentificationError, no_progress
from microrad.lab.identify.stiffness import springs as springs_of
from microrad.lab.identify.stiffness import tangents
from microrad.lab.identify.stiffness.model import LinearStart, Numbers, linear_start, scaled
from microrad.lab.identify.stiffness.search import Search
from microrad.lab.identify.stiffness.tangents import Steady
from microrad.lab.recording import Recording
from microrad.mirror import coupled
from microrad.mirror.hysteresis import PrandtlIshlinskii
from microrad.mirror.model import Mirror, contraction

THRESHOLDS = (0.02, 0.06, 0.15, 0.4)

_REFRESH = 5  # steps on all records until the curvature is taken anew
_SMALL = 1e-3  # of a standard error: the poles follow in proportion
_AT_LIMIT = 0.99  # of the largest softening: a search that ends there has not converged
_WINDOW = 8  # steps over which a search is judged


@dataclass(frozen=True, slots=True)
class StiffnessOptions:
    """What is fitted and how, for `fit_hysteretic_stiffness`.

    ``springs`` is the number of hysteretic springs, by default twice that of actuators and outputs, but no more than
    twice that of pairs of poles. Beside them each actuator has an operator that its drive alone moves. ``thresholds``
    of their plays are parts of the largest drive. The mirror takes ``sub_steps`` steps a sample. ``delay_s`` is fitted
    along, from the best on a grid up to two samples, unless it is given. ``exchanges`` is for the linear start, see
    `fit_linear`. The search ends when its last eight steps have gained less than ``tolerance`` of the error. It begins
    with up to ``few_first`` steps on one record of each amplitude and set of driven actuators alone, which cost less
    and lead nearly as far.
    """

    springs: int | None = None
    thresholds: tuple[float, ...] = THRESHOLDS
    sub_steps: int = 2
    delay_s: float | None = None
    exchanges: int = 12
    tolerance: float = 0.01
    few_first: int = 15


DEFAULTS = StiffnessOptions()


@dataclass(frozen=True, eq=False)
class HystereticStiffnessFit:
    """A mirror with hysteretic stiffness, and how well it follows the records it was fitted to.

    `mirror` takes the drive of ``delay_s`` ago: the pure delay belongs to the recording chain (converters, anti-alias
    filter, amplifier), not to the mirror, and is counted beside the mirror's ``order`` states. ``parameters`` is the
    number of free numbers, of which ``redundant`` change nothing (the scale of each operator that the drive moves, and
    of the state of a mode that carries no spring).
    ``softening`` is the share of the stiffness that the springs take away where all plays slide; below 1 no drive makes
    the mirror run away (see `springs`). ``sub_steps`` is the number of plant steps a sample that was fitted; a plant of
    another step is another approximation of the loop through the plays.

    ``error_rms`` (records,) is the rms over samples and outputs of the steady state of each record less its mean,
    ``unseen_error_rms`` what is expected of a fit without it, whose numbers are a Newton step away, and
    ``start_error_rms`` that of the linear model where the search began. ``amplitudes`` is the rms drive of each class
    of records of one amplitude and ``classes`` the class of each record; ``motion`` is the largest drive of each
    operator in them. ``costs`` is the root of the weighed mean-square error, see `fit_hysteretic_stiffness`, where the
    search on all records began and after each of its steps.

    ``poles_rad_s`` are those at rest, and ``poles_error_rad_s`` their standard errors (real and imaginary part as a
    complex number), with ``delay_error_s``. These count each record as one independent draw of drive, noise and
    distortion (cluster-robust sandwich): they say how far another set of such records would move the estimate, and
    nothing about what the model leaves out. With few records they are rough, as is ``unseen_error_rms``, and nan for a
    single one per amplitude.
    ``names`` are those of all numbers as in a mirror file, the delay last, and ``moved`` (records, numbers) a root of
    their covariance in SI units, moved.T @ moved, None for a single record per amplitude.
    """

    mirror: Mirror
    delay_s: float
    delay_error_s: float
    rate_hz: float
    sub_steps: int
    order: int
    parameters: int
    redundant: int
    softening: float
    poles_rad_s: np.ndarray
    poles_error_rad_s: np.ndarray
    error_rms: Floats
    unseen_error_rms: Floats
    start_error_rms: Floats
    amplitudes: tuple[float, ...]
    classes: tuple[int, ...]
    motion: Floats
    costs: tuple[float, ...]
    iterations: int
    converged: bool
    names: tuple[str, ...]
    moved: Floats | None


def simulate_hysteretic_stiffness(fit: HystereticStiffnessFit, drive: Floats) -> Floats:
    """Output (samples, outputs) of a fitted mirror from rest.

    Between samples the drive is interpolated without content above half the rate and shifted by the delay, both around
    the corner: the drive is to hold whole periods, or to begin and end at rest. Then the mirror runs from rest, the
    drive straight over each of its steps.

    Args:
        fit: The fit.
        drive: The drive, shape (samples, inputs), at the rate of the fit.
    """
    return coupled.response(fit.mirror, drive, fit.rate_hz, fit.sub_steps, fit.delay_s)


class Trust(NamedTuple):
    """How far a drive takes a mirror beyond the records of its fit, and the rms error to expect at least.

    ``motion`` is the largest drive q of any operator, in the largest that it had in the records: above 1 it is beyond
    them. ``error_rms`` is made of ``left``, what the fit leaves, continued over the amplitude by the power that its
    amplitudes show, and of ``open``, by how much the output changes where the polynomials go on beyond their reach.
    """

    motion: float
    error_rms: float
    left: float
    open: float


def trust(fit: HystereticStiffnessFit, drive: Floats) -> Trust:
    """How far a fit is to be trusted under a drive: beyond the records its error is this or more.

    On the CubeSpec mirror at 1.8 times the motion that was recorded, 4.2 times as much was left.

    Args:
        fit: The fit.
        drive: The drive, shape (samples, inputs), at the rate of the fit; whole periods, or at rest at both ends.
    """
    own, classes = fit.mirror, np.asarray(fit.classes)
    inside = replace(own, C=own.F, D=own.G, K=np.zeros((len(own.F), len(own.plays))))
    largest = np.abs(coupled.response(inside, drive, fit.rate_hz, fit.sub_steps, fit.delay_s)).max(axis=0)
    further = replace(own, plays=tuple(_further(p, float(q)) for p, q in zip(own.plays, largest, strict=True)))
    step_s, fine = 1.0 / (fit.rate_hz * fit.sub_steps), 1
    while contraction(further, step_s / fine) >= 1.0:
        fine *= 2
    ends = (coupled.response(m, drive, fit.rate_hz, fine * fit.sub_steps, fit.delay_s) for m in (own, further))
    opened = float(np.sqrt(np.mean(np.subtract(*ends) ** 2)))
    errors = [float(np.sqrt(np.mean(fit.error_rms[classes == c] ** 2))) for c in range(len(fit.amplitudes))]
    power = max(float(np.polyfit(np.log(fit.amplitudes), np.log(errors), 1)[0]), 0.0)
    amplitude = float(np.sqrt(np.mean(np.var(drive, axis=0))))
    left = amplitude**power * math.exp(np.mean(np.log(errors)) - power * np.mean(np.log(fit.amplitudes)))
    return Trust(float((largest / fit.motion).max()), math.hypot(left, opened), left, opened)


def _further(play: PrandtlIshlinskii, largest: float) -> PrandtlIshlinskii:
    """The same operator with a polynomial that goes on to its largest drive, where that is beyond its reach."""
    if not math.isfinite(play.reach_v) or largest <= play.reach_v:
        return play
    times, (c1, c2, c3) = largest / play.reach_v, play.polynomial_rad
    return replace(play, reach_v=largest, polynomial_rad=(times**2 * c1, times**2 * c2, times**3 * c3))


def predicted_error(fit: HystereticStiffnessFit, record: Recording, drop: int = 0) -> Floats:
    """Measured less predicted output (samples, outputs) of a record from rest.

    Args:
        fit: The fit.
        record: A record with the rate and channels of those fitted.
        drop: First samples that are left out.

    Raises:
        IdentificationError: If the record has another rate or other channels.
    """
    shape = (record.drive.shape[1], record.output.shape[1])
    if record.rate_hz != fit.rate_hz or shape != (fit.mirror.actuators, fit.mirror.axes):
        raise IdentificationError(
            f"{record.path}: {counted(shape[0], 'input')} and {counted(shape[1], 'output')} at {record.rate_hz:g} Hz, "
            f"where the model has {fit.mirror.actuators} and {fit.mirror.axes} at {fit.rate_hz:g} Hz; give a record "
            "like those fitted."
        )
    return np.asarray((record.output - simulate_hysteretic_stiffness(fit, record.drive))[drop:])


def fit_hysteretic_stiffness(
    records: Sequence[Recording],
    *,
    order: int = 28,
    options: StiffnessOptions = DEFAULTS,
    skip_periods: int = 0,
    iterations: int = 60,
    start: LinearStart | None = None,
    on_progress: Progress | None = None,
) -> HystereticStiffnessFit:
    """Fit one mirror to periodic multisines of several amplitudes, any number of inputs and outputs.

    The search begins at a linear model of the middle amplitude (at least as many records of it as inputs), behind a
    pure delay. Each record counts by its mean-square error (steady state, mean of the periods, without its mean) over
    what no linear model of its amplitude could follow, where there are more records of each amplitude than inputs, and
    else over its mean-square output. No drive makes a mirror run away that is returned, see `springs`.

    Records are worked on in parallel, one a processor. Each takes the path that is simulated and its derivative, 16
    bytes x steps of two periods x (2 states + 3 operators + plays), and now and then a Jacobian in single precision: 4
    bytes x samples of a period x outputs x parameters, and about as much for what it is made from.

    Args:
        records: The multisines, of one rate, with the same channels and `period_samples`.
        order: States of the linear model.
        options: What is fitted and how.
        skip_periods: First periods of each record that are dropped as transient.
        iterations: Largest number of steps on all records.
        start: Linear model to begin with, which then gives the order; by default that of the middle amplitude.
        on_progress: Called with the steps done, their largest number, and the error.

    Raises:
        IdentificationError: If all records have one amplitude (they cannot tell hysteresis from linear stiffness), if
            they differ in rate or channels or have no period, or if the thresholds do not ascend from above 0,
            or if the linear model has no pair of poles in the recorded band.
    """
    _check(records, skip_periods, options)
    amplitudes, classes = _classes(records)
    units = _unit(records, "drive"), _unit(records, "output")
    steady = [_steady(r, units, options.sub_steps, skip_periods) for r in records]
    groups = [[r for r, c in zip(records, classes, strict=True) if c == own] for own in range(len(amplitudes))]
    if start is None:
        response = response_from_periods(groups[_middle(amplitudes, classes)], skip_periods=skip_periods)
        start = linear_start(response, order, options.sub_steps, options.delay_s, options.exchanges)
    linear = _in_units(start, units)
    largest, middle = (
        [r for r, c in zip(steady, classes, strict=True) if c == own]
        for own in (len(amplitudes) - 1, _middle(amplitudes, classes))
    )
    fixed = options.delay_s is not None
    springs, free = springs_of.begin(linear, largest, middle, options.springs, options.thresholds, fixed_delay=fixed)
    expected = _expected_squares(records, classes, skip_periods) / units[1] ** 2
    weights = 1.0 / (expected * np.array([r.output.size for r in steady]) * len(steady))
    few = _few(steady, classes)
    told = _Told(on_progress or no_progress, options.few_first + iterations, options.tolerance)
    with ThreadPoolExecutor(min(len(steady), os.cpu_count() or 1)) as pool:
        search = Search(springs, steady, weights, few, pool)
        before, _ = _judged(search, free)
        if options.few_first:
            share = weights.sum() / weights[few].sum()
            first = Search(springs, [steady[k] for k in few], share * weights[few], range(len(few)), pool)
            free = first.minimise(free, options.few_first, 1, told)
        told.begin(options.few_first, search.cost(free))
        free = search.minimise(free, iterations, _REFRESH, told)
        limited = springs.softening(springs.numbers(free)) > _AT_LIMIT * springs_of.MOST_SOFTENING
        unseen, moved = _other_records(search, free, classes)
        after, motion = _judged(search, free)
    numbers = springs.numbers(free)
    delay_error_s = math.nan if moved is None else float(np.linalg.norm(moved[:, -1]))
    return HystereticStiffnessFit(
        mirror=scaled(numbers, *units).mirror("identified"),
        delay_s=numbers.delay_s,
        delay_error_s=delay_error_s,
        rate_hz=records[0].rate_hz,
        sub_steps=options.sub_steps,
        order=int(numbers.B.shape[0]),
        parameters=free.size,
        redundant=springs.redundant,
        softening=springs.softening(numbers),
        poles_rad_s=numbers.poles_at_rest,
        poles_error_rad_s=_pole_errors(numbers, moved),
        error_rms=units[1] * after,
        unseen_error_rms=units[1] * unseen,
        start_error_rms=units[1] * before,
        amplitudes=amplitudes,
        classes=classes,
        motion=units[0] * motion,
        costs=tuple(told.costs),
        iterations=len(told.costs) - 1,
        converged=len(told.costs) <= iterations and not limited,
        names=numbers.names,
        moved=None if moved is None else _in_si(numbers, moved, units),
    )


def _in_units(start: LinearStart, units: tuple[float, float]) -> LinearStart:
    """The linear model with drive and output counted in units of the search, each vector at a scale that suits both."""
    model = start.model
    b, c = model.input_vectors * units[0], model.output_vectors / units[1]
    even = np.sqrt(np.linalg.norm(c, axis=0) / np.maximum(np.linalg.norm(b, axis=1), 1e-300))
    modes = replace(
        model, input_vectors=b * even[:, None], output_vectors=c / even, direct=model.direct * units[0] / units[1]
    )
    return start._replace(model=modes)


def _few(records: Sequence[Steady], classes: Sequence[int]) -> list[int]:
    """Numbers of one record for each amplitude and set of actuators that are driven."""
    first: dict[tuple[int, tuple[bool, ...]], int] = {}
    for k, (record, own) in enumerate(zip(records, classes, strict=True)):
        driven = np.ptp(record.drive, axis=0) > 0.0
        first.setdefault((own, tuple(driven.tolist())), k)
    return sorted(first.values())


class _Told:
    """Passes on how far a search is, keeps its costs and says when it may end."""

    def __init__(self, on_progress: Progress, total: int, tolerance: float) -> None:
        self.on_progress, self.total, self.tolerance = on_progress, total, tolerance
        self.before = 0
        self.costs: list[float] = []

    def begin(self, before: int, cost: float) -> None:
        """Begin anew at a cost, behind the steps of the search before."""
        self.before, self.costs = before, [math.sqrt(cost)]

    def __call__(self, done: int, free: Floats, cost: float) -> bool:
        """Whether the search may end: its last steps gained next to nothing."""
        self.costs.append(math.sqrt(cost))
        self.on_progress(self.before + done, self.total, f"error {self.costs[-1]:.4f}")
        return len(self.costs) > _WINDOW and self.costs[-1] > (1.0 - self.tolerance) * self.costs[-1 - _WINDOW]


def _judged(search: Search, free: Floats) -> tuple[Floats, Floats]:
    """Rms error of each record, and the largest drive of each operator in all of them, in the search's units."""
    numbers = search.springs.numbers(free)
    plant = tangents.play_plant(numbers, search.records[0].step_s)

    def judged(record: Steady) -> tuple[float, Floats]:
        error, path, _ = tangents.steady_error(plant, record, numbers.delay_s)
        return float(np.sqrt(np.mean(error**2))), np.abs(path.q).max(axis=0)

    errors, motions = zip(*search.pool.map(judged, search.records), strict=True)
    return np.array(errors), np.max(motions, axis=0)


def _other_records(search: Search, free: Floats, classes: Sequence[int]) -> tuple[Floats, Floats | None]:
    """What other records would have given: expected rms error of each record unseen, and a root of the covariance.

    Without a record the numbers would be a Newton step away (infinitesimal jackknife; R. Giordano et al., Proceedings
    of AISTATS 2019), where its error is continued to second order. The root of the cluster-robust covariance, shape
    (records, numbers), is made of the same pulls. With a single record in an amplitude there is neither: nan and None.
    Numbers at their limits are counted as known (weights at 0), and the softening as free.
    """
    count = len(search.records)
    if int(np.bincount(np.asarray(classes)).min()) < 2:
        return np.full(count, math.nan), None
    springs, numbers, weights = search.springs, search.springs.numbers(free), search.weights
    plant, T = tangents.play_plant(numbers, search.records[0].step_s), springs.matrix[:, springs.inside(free)]
    wanted = T[search.wanted]

    def equations(record: Steady) -> tuple[float, Floats, Floats]:
        normal = tangents.normal_equations(plant, numbers, record, search.wanted)
        return normal.cost, wanted.T @ normal.matrix @ wanted, wanted.T @ normal.gradient

    costs, matrices, slopes = zip(*search.pool.map(equations, search.records), strict=True)
    matrix = sum((w * part for w, part in zip(weights, matrices, strict=True)), np.zeros(()))
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    pulls = np.array([w * slope for w, slope in zip(weights, slopes, strict=True)])

    def inverse(part: Floats) -> Floats:
        """Over what its records tell apart; zero over the rest."""
        return np.asarray(
            np.linalg.pinv(part / np.outer(size, size), rcond=1e-6, hermitian=True) / np.outer(size, size)
        )

    def unseen(k: int) -> float:
        step = inverse(matrix - weights[k] * matrices[k]) @ pulls[k]
        cost = costs[k] + 2.0 * slopes[k] @ step + step @ matrices[k] @ step
        return math.sqrt(cost / search.records[k].output.size)

    expected = np.array(list(search.pool.map(unseen, range(count))))
    return expected, np.asarray((pulls - pulls.mean(axis=0)) @ inverse(matrix) @ T.T * math.sqrt(count / (count - 1)))


def _pole_errors(numbers: Numbers, moved: Floats | None) -> np.ndarray:
    """Standard errors of real and imaginary part of each pole at rest: how far each row of ``moved`` moves it."""
    poles = numbers.poles_at_rest
    if moved is None:
        return np.full(poles.size, complex(math.nan, math.nan))
    square = np.zeros((2, poles.size))
    for row in moved:
        other = numbers.at(numbers.vector() + _SMALL * row).poles_at_rest
        nearest = other[np.argmin(np.abs(other[None, :] - poles[:, None]), axis=1)]
        change = (nearest - poles) / _SMALL
        square += change.real**2, change.imag**2
    return np.asarray(np.sqrt(square[0]) + 1j * np.sqrt(square[1]))


def _in_si(numbers: Numbers, moved: Floats, units: tuple[float, float]) -> Floats:
    """Changes of all numbers, in the search's units, as changes of the numbers of a mirror file in SI units."""
    rows = np.array([scaled(numbers.at(row), *units).vector() for row in moved])
    rows[:, : numbers.decay.size] *= -1.0  # a file's decay is above 0
    return rows


# --------------------------------------------------------------------------------------------------------- the records
def _check(records: Sequence[Recording], skip_periods: int, options: StiffnessOptions) -> None:
    if not records:
        raise IdentificationError("no recording was given; name records of at least two amplitudes.")
    if skip_periods < 0:
        raise IdentificationError(f"{skip_periods} periods are to be skipped; skip none or more.")
    for other in records:
        whole = other.samples // other.period_samples if other.period_samples else 0
        if whole <= skip_periods:
            raise IdentificationError(
                f"{other.path}: the record has {whole} whole periods and {skip_periods} are to be skipped; this "
                "fit needs periodic excitation (multisines) in its steady state: give period_samples, or record more "
                "periods."
            )
    check_alike(records, "fitted")
    thresholds = options.thresholds
    if not thresholds or thresholds[0] <= 0 or np.any(np.diff(thresholds) <= 0):
        raise IdentificationError(
            f"the thresholds {list(thresholds)} do not ascend from above 0; sort them, each once, and leave out 0."
        )
    if options.sub_steps < 1:
        raise IdentificationError(f"{options.sub_steps} steps a sample were asked for; give at least 1.")
    if options.springs is not None and options.springs < 1:
        raise IdentificationError(f"{options.springs} springs were asked for; give at least 1.")


def amplitude_classes(records: Sequence[Recording]) -> tuple[tuple[float, ...], tuple[int, ...]]:
    """Rms drive of each class of records whose drives are within a tenth of the next, and the class of each record.

    Raises:
        IdentificationError: If the drive of a record does not change.
    """
    size = np.array([float(np.sqrt(np.mean(np.var(r.drive, axis=0)))) for r in records])
    if not (size > 0).all():
        raise IdentificationError(
            f"{records[int(np.argmin(size))].path}: the drive does not change; excite the mirror."
        )
    rank = np.argsort(size, kind="stable")
    jumps = np.concatenate([[False], size[rank][1:] > 1.1 * size[rank][:-1]])
    classes = np.empty(size.size, dtype=int)
    classes[rank] = np.cumsum(jumps)
    return tuple(float(np.mean(size[classes == c])) for c in range(int(classes.max()) + 1)), tuple(classes.tolist())


def _classes(records: Sequence[Recording]) -> tuple[tuple[float, ...], tuple[int, ...]]:
    """As `amplitude_classes`, but refused where there is only one."""
    amplitudes, classes = amplitude_classes(records)
    if len(amplitudes) < 2:
        raise IdentificationError(
            f"all {len(records)} records have one amplitude, {amplitudes[0]:.3g} rms of the drive: hysteresis cannot "
            "be told from linear stiffness; add records of another amplitude, twice as large for example."
        )
    return amplitudes, classes


def _middle(amplitudes: Sequence[float], classes: Sequence[int]) -> int:
    """Number of the amplitude that is next to the geometric mean over all records."""
    size = np.log(amplitudes)
    return int(np.argmin(np.abs(size - np.mean(size[np.asarray(classes)]))))


def _unit(records: Sequence[Recording], channel: str) -> float:
    """Rms of the drives or outputs of all records: the unit in which the search counts them."""
    return float(np.sqrt(np.mean([np.mean(np.var(getattr(r, channel), axis=0)) for r in records])))


def _periods(record: Recording, values: Floats, skip_periods: int) -> Floats:
    """Whole periods of a channel group behind those skipped, shape (periods, samples, channels)."""
    period = record.period_samples or record.samples
    used = values[skip_periods * period : record.samples // period * period]
    return np.asarray(used.reshape(-1, period, values.shape[1]))


def _steady(record: Recording, units: tuple[float, float], sub_steps: int, skip_periods: int) -> Steady:
    """Mean of the record's whole periods behind those skipped, in the search's units."""
    drive, output = (_periods(record, v, skip_periods).mean(axis=0) for v in (record.drive, record.output))
    output = (output - output.mean(axis=0)) / units[1]
    return Steady(record.path, drive / units[0], output, record.rate_hz, sub_steps)


def _expected_squares(records: Sequence[Recording], classes: Sequence[int], skip_periods: int) -> Floats:
    """Mean-square error to be expected in each record: what no linear model of its amplitude follows, and its noise.

    The former is what the best linear approximation of its class leaves, less its noise. Where a class has too few
    records for one, the mean square of each class's output stands for both.
    """
    group, kinds = np.asarray(classes), range(max(classes) + 1)
    own = [[r for r, c in zip(records, classes, strict=True) if c == kind] for kind in kinds]
    if any(len(each) <= each[0].drive.shape[1] for each in own):
        squares = np.array([np.mean(np.var(r.output, axis=0)) for r in records])
        return np.asarray(np.array([np.mean(squares[group == kind]) for kind in kinds])[group])
    left = [response_from_periods(each, skip_periods=skip_periods).residual_power.sum(axis=0).mean() for each in own]
    noise = np.array([_noise_square(r, skip_periods) for r in records])
    distortion = [float(left[kind]) - noise[group == kind].mean() for kind in kinds]
    return np.asarray(np.maximum(distortion, 0.0)[group] + noise)


def _noise_square(record: Recording, skip_periods: int) -> float:
    """Mean square over outputs of the noise that the mean of a record's periods has; 0 for a single period."""
    periods = _periods(record, record.output, skip_periods)
    return float(np.var(periods, axis=0, ddof=1).mean()) / len(periods) if len(periods) > 1 else 0.0
