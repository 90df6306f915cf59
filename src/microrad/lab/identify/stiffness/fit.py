"""One mirror for all amplitudes: linear modes in feedback with hysteresis, fitted to multisines of several amplitudes.

The gain of a piezo mirror rises and its resonances fall with the amplitude, because its actuators are hysteretic
springs: plays driven by the strain of the actuators act back on every mode. A linear model that is right at one
amplitude is wrong at the next. `fit_hysteretic_stiffness` fits modes and plays together (Levenberg-Marquardt with exact
derivatives along the simulated path), and `predicted_error` says how well the result predicts a record that it has not
seen.
"""

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.lab.identify.linear.response import check_alike, response_from_periods
from microrad.lab.identify.records import IdentificationError, no_progress
from microrad.lab.identify.stiffness import tangents
from microrad.lab.identify.stiffness.model import (
    FIELDS,
    HysteresisSource,
    LinearStart,
    Numbers,
    balanced,
    linear_start,
    scaled,
    starting_numbers,
)
from microrad.lab.identify.stiffness.tangents import Normal, Steady
from microrad.lab.recording import Recording
from microrad.mirror import coupled
from microrad.mirror.model import Mirror

SOURCES: tuple[HysteresisSource, ...] = ("strain", "drive")
THRESHOLDS = tuple(np.geomspace(0.006, 0.6, 6).tolist())

_DAMPING = 1e-2
_TRIALS = 8
_PATIENCE = 3
_BOUNDS = 8  # poles that a step is kept from taking across zero


@dataclass(frozen=True, slots=True)
class StiffnessOptions:
    """What is fitted and how, for `fit_hysteretic_stiffness`.

    Each of ``sources`` gives one Prandtl-Ishlinskii operator per actuator, begun with the strain of the actuator or
    with its drive; in the fit each may take up any mixture of both. ``thresholds`` are parts of the largest drive that
    any operator of the start meets. The mirror takes ``sub_steps`` steps a sample. ``delay_s`` is fitted along, from
    the best on a grid up to two samples, unless it is given. ``exchanges`` is for the linear start, see `fit_linear`.
    The search ends when three iterations in a row gain less than ``tolerance`` of the error. It begins with up to
    ``few_first`` iterations on one record of each amplitude alone, which cost less and lead nearly as far.
    """

    sources: tuple[HysteresisSource, ...] = SOURCES
    thresholds: tuple[float, ...] = THRESHOLDS
    sub_steps: int = 2
    delay_s: float | None = None
    exchanges: int = 12
    tolerance: float = 1e-3
    few_first: int = 0


DEFAULTS = StiffnessOptions()


@dataclass(frozen=True, eq=False)
class HystereticStiffnessFit:
    """A mirror with hysteretic stiffness, and how well it follows the records it was fitted to.

    `mirror` takes the drive of ``delay_s`` ago: the pure delay belongs to the recording chain (converters, anti-alias
    filter, amplifier), not to the mirror, and is counted beside the mirror's ``order`` states. ``parameters`` is the
    number of free numbers, of which ``redundant`` change nothing (the scale of each state and operator). ``sub_steps``
    is the number of plant steps a sample that was fitted; a plant of another step is another approximation of the loop
    through the plays.

    ``error_rms`` (records,) is the rms over samples and outputs of the steady state of each record less its mean,
    ``start_error_rms`` that where the search on all records began: at the linear start, or where iterations on a few
    of them have led. ``amplitudes`` is the rms drive of each class of records of one amplitude and ``classes`` the
    class of each record. ``costs`` is the root of the weighed mean-square error, see
    `fit_hysteretic_stiffness`, at the start and after each iteration. ``poles_rad_s`` are those at rest, and
    ``poles_error_rad_s`` their standard errors (real and imaginary part as a complex number), with ``delay_error_s``.
    These count each record as one independent draw of drive, noise and distortion (cluster-robust sandwich): they say
    how far another set of such records would move the estimate, and nothing about what the model leaves out. With few
    records they are rough, and nan for a single one per amplitude. ``names`` are those of all numbers as in a mirror
    file, the delay last, and ``moved`` (records, numbers) a root of their covariance in SI units, moved.T @ moved, None
    for a single record per amplitude. ``held`` says that the search ended where a step would have run away.
    """

    mirror: Mirror
    delay_s: float
    delay_error_s: float
    rate_hz: float
    sub_steps: int
    order: int
    parameters: int
    redundant: int
    poles_rad_s: np.ndarray
    poles_error_rad_s: np.ndarray
    error_rms: Floats
    start_error_rms: Floats
    amplitudes: tuple[float, ...]
    classes: tuple[int, ...]
    costs: tuple[float, ...]
    iterations: int
    converged: bool
    held: bool
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
            f"{record.path}: {shape[0]} inputs and {shape[1]} outputs at {record.rate_hz:g} Hz, where the model has "
            f"{fit.mirror.actuators} and {fit.mirror.axes} at {fit.rate_hz:g} Hz; give a record like those fitted."
        )
    return np.asarray((record.output - simulate_hysteretic_stiffness(fit, record.drive))[drop:])


def fit_hysteretic_stiffness(
    records: Sequence[Recording],
    *,
    order: int = 28,
    options: StiffnessOptions = DEFAULTS,
    skip_periods: int = 0,
    iterations: int = 40,
    start: LinearStart | None = None,
    on_progress: Progress | None = None,
) -> HystereticStiffnessFit:
    """Fit one mirror to periodic multisines of several amplitudes, any number of inputs and outputs.

    The search begins at a linear model of the middle amplitude (at least as many records of it as inputs), behind a
    pure delay. Each record counts by its mean-square error (steady state, mean of the periods, without its mean) over
    what no linear model of its amplitude could follow, where there are more records of each amplitude than inputs, and
    else over its mean-square output. No step leads to a mirror that runs away where plays slide; a search that ends at
    that bound has not converged.

    Records are worked on in parallel, one a processor, each with a Jacobian in single precision: 4 bytes x samples of a
    period x outputs x parameters, and about as much for what it is made from. With two processors, 15 records of 8192
    samples, 3 outputs and 613 parameters the whole process has been seen to take 640 MB.

    Args:
        records: The multisines, of one rate, with the same channels and `period_samples`.
        order: States of the linear model.
        options: What is fitted and how.
        skip_periods: First periods of each record that are dropped as transient.
        iterations: Largest number of iterations.
        start: Linear model to begin with, which then gives the order; by default that of the middle amplitude.
        on_progress: Called with the iterations done, their largest number, and the error.

    Raises:
        IdentificationError: If all records have one amplitude (they cannot tell hysteresis from linear stiffness), if
            they differ in rate or channels or have no period, if the thresholds do not ascend from 0, or if the mirror
            runs away all the same.
    """
    _check(records, skip_periods, options)
    amplitudes, classes = _classes(records)
    units = _unit(records, "drive"), _unit(records, "output")
    steady = [_steady(r, units, options.sub_steps, skip_periods) for r in records]
    groups = [[r for r, c in zip(records, classes, strict=True) if c == own] for own in range(len(amplitudes))]
    if start is None:
        response = response_from_periods(groups[_middle(amplitudes, classes)], skip_periods=skip_periods)
        start = linear_start(response, order, options.sub_steps, options.delay_s, options.exchanges)
    numbers = starting_numbers(start, options.sources, len(options.thresholds))
    numbers = _with_thresholds(scaled(numbers, 1 / units[0], 1 / units[1]), steady, options.thresholds)
    squares, group = np.array([np.mean(r.output**2) for r in steady]), np.asarray(classes)
    outputs = np.sqrt([np.mean(squares[group == c]) for c in range(len(amplitudes))])
    levels = _levels(groups, outputs, units[1], skip_periods)
    few = [classes.index(c) for c in range(len(amplitudes))]
    every = range(len(steady))
    stages = [(few, options.few_first), (every, iterations)] if options.few_first else [(every, iterations)]
    report, done = on_progress or no_progress, 0
    with ThreadPoolExecutor(min(len(steady), os.cpu_count() or 1)) as pool:
        for used, most in stages:
            search = _Search([steady[k] for k in used], [classes[k] for k in used], levels, options.delay_s is not None)
            told = partial(_report, report, done, iterations + options.few_first)
            search.minimise(balanced(numbers), pool, most, options.tolerance, told)
            numbers, done = search.numbers, done + most
    if (growth := search.numbers.growth_1_s) >= 0.0:
        raise IdentificationError(
            f"the fitted mirror runs away: where its plays slide it grows by {growth:.3g} 1/s, whatever the drive; fit "
            "another order or fewer sources, or add records of other amplitudes."
        )
    return _result(search, units, amplitudes, records[0].rate_hz)


def _report(on_progress: Progress, before: int, total: int, done: int, _: int, text: str) -> None:
    """Steps done of one stage as those of all."""
    on_progress(before + done, total, text)


# --------------------------------------------------------------------------------------------------------- the records
def _check(records: Sequence[Recording], skip_periods: int, options: StiffnessOptions) -> None:
    if not records:
        raise IdentificationError("no recording was given; name records of at least two amplitudes.")
    for other in records:
        whole = other.samples // other.period_samples if other.period_samples else 0
        if whole <= max(skip_periods, 0):
            raise IdentificationError(
                f"{other.path}: the record has {whole} whole periods and {skip_periods} are to be skipped; this "
                "fit needs periodic excitation (multisines) in its steady state: give period_samples, or record more "
                "periods."
            )
    check_alike(records, "fitted")
    thresholds = options.thresholds
    if not thresholds or thresholds[0] < 0 or np.any(np.diff(thresholds) <= 0):
        raise IdentificationError(f"the thresholds {list(thresholds)} do not ascend from 0; sort them, each once.")
    if options.sub_steps < 1:
        raise IdentificationError(f"{options.sub_steps} steps a sample were asked for; give at least 1.")
    if not options.sources:
        raise IdentificationError('no source of hysteresis was named; give "strain", "drive" or both.')


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


def _steady(record: Recording, units: tuple[float, float], sub_steps: int, skip_periods: int) -> Steady:
    """Mean of the record's whole periods behind those skipped, in the search's units."""
    period = record.period_samples or record.samples
    used = slice(skip_periods * period, record.samples // period * period)

    def mean(values: Floats) -> Floats:
        return np.asarray(values[used].reshape(-1, period, values.shape[1]).mean(axis=0))

    output = mean(record.output)
    output = (output - output.mean(axis=0)) / units[1]
    return Steady(record.path, mean(record.drive) / units[0], output, record.rate_hz, sub_steps)


def _levels(groups: Sequence[Sequence[Recording]], outputs: Floats, output_unit: float, skip_periods: int) -> Floats:
    """Rms of each class in the search's units: what its best linear approximation leaves, or else its output."""
    if any(len(group) <= group[0].drive.shape[1] for group in groups):
        return outputs
    left = [response_from_periods(group, skip_periods=skip_periods).residual_power for group in groups]
    return np.array([math.sqrt(float(power.sum(axis=0).mean())) / output_unit for power in left])


def _with_thresholds(numbers: Numbers, steady: Sequence[Steady], thresholds: Sequence[float]) -> Numbers:
    """Thresholds as parts of the largest drive of any operator in the record with the largest drive."""
    largest = max(steady, key=lambda record: float(np.mean(record.drive**2)))
    far = replace(numbers, thresholds=np.full_like(numbers.thresholds, 1e300))  # plays that never move: the linear part
    plant = tangents.play_plant(far, largest.step_s)
    drive = tangents.two_periods(largest, numbers.delay_s)
    path = tangents.simulate_path(plant, drive)
    half = drive.shape[0] // 2
    q = path.x[half:, : numbers.B.shape[0]] @ numbers.F.T + drive[half:] @ numbers.G.T
    return replace(numbers, thresholds=np.zeros_like(numbers.thresholds) + np.abs(q).max() * np.asarray(thresholds))


# ---------------------------------------------------------------------------------------------------------- the search
class _Search:
    """Levenberg-Marquardt over all records, the error of each counted in units of its amplitude's ``levels``."""

    def __init__(self, steady: Sequence[Steady], classes: Sequence[int], levels: Floats, fixed_delay: bool) -> None:
        self.steady, self.classes, self.fixed_delay = steady, classes, fixed_delay
        self.sizes = np.array([record.output.size for record in steady])
        self.weights = 1.0 / (levels[np.asarray(classes)] ** 2 * self.sizes * len(steady))
        self.costs: list[float] = []
        self.start_error = np.zeros(len(steady))
        self.converged = False
        self.held = False
        """Whether the last step was shortened, or a trial of it refused, because it would run away."""

    def minimise(
        self, start: Numbers, pool: ThreadPoolExecutor, iterations: int, tolerance: float, on_progress: Progress
    ) -> None:
        """Search from a start to the end; the result is in `numbers` and `parts`.

        Args:
            start: The numbers to begin with.
            pool: Threads in which the records are simulated side by side.
            iterations: Largest number of steps.
            tolerance: The search ends after several steps in a row that lower the logarithm of the error by less.
            on_progress: Called with the steps done, their largest number and the error.
        """
        self.numbers, damping, small = start, _DAMPING, 0
        self._linearise(pool)
        self.start_error = self.error
        for done in range(1, iterations + 1):
            damping, gained = self._step(pool, damping)
            if gained:
                self._linearise(pool)
            small = small + 1 if not gained or math.log(self.costs[-2] / self.costs[-1]) < tolerance else 0
            on_progress(done, iterations, f"error {self.costs[-1]:.4f} from {self.costs[0]:.4f}")
            if not gained or small >= _PATIENCE:
                self.converged = not self.held
                break

    @property
    def error(self) -> Floats:
        """Rms error of each record."""
        return np.asarray(np.sqrt(np.array([part.cost for part in self.parts]) / self.sizes))

    def _plant(self, numbers: Numbers) -> kernels.PlayPlant:
        return tangents.play_plant(numbers, self.steady[0].step_s)

    def _linearise(self, pool: ThreadPoolExecutor) -> None:
        plant = self._plant(self.numbers)
        parts = pool.map(lambda r: tangents.normal_equations(plant, self.numbers, r), self.steady)
        self.parts: list[Normal] = list(parts)
        self.costs.append(math.sqrt(float(self.weights @ np.array([part.cost for part in self.parts]))))

    def normal_equations(self) -> tuple[Floats, Floats]:
        """Weighed normal matrix and gradient over all numbers."""
        matrix = sum((w * p.matrix for w, p in zip(self.weights, self.parts, strict=True)), np.zeros(()))
        gradient = sum((w * p.gradient for w, p in zip(self.weights, self.parts, strict=True)), np.zeros(()))
        return np.asarray(matrix), np.asarray(gradient)

    def _step(self, pool: ThreadPoolExecutor, damping: float) -> tuple[float, bool]:
        """Try damped steps until one lowers the cost; the damping for the next one."""
        self.held = False
        matrix, gradient = self.normal_equations()
        free = np.ones(gradient.size, dtype=bool)
        free[-1] = not self.fixed_delay
        size = np.sqrt(np.diag(matrix) + self._floors(np.diag(matrix)))[free]
        scaled_matrix = matrix[np.ix_(free, free)] / np.outer(size, size)
        cost, growths = self.costs[-1] ** 2, self.numbers.growths()
        room, slopes = np.array([-0.5 * g.rate_1_s for g in growths]), np.array([g.slope[free] for g in growths])
        for _ in range(_TRIALS):
            move = np.zeros(gradient.size)
            move[free], bounded = _bounded_move((scaled_matrix, gradient[free], size), damping, (room, slopes))
            trial = self.numbers.at(self.numbers.vector() + move)
            runs_away = trial.growth_1_s >= 0.0
            self.held = self.held or bounded or runs_away
            if not runs_away and self._cost(trial, pool) < cost:
                self.numbers = balanced(trial)
                return max(damping / 4, 1e-6), True
            if runs_away and bounded:  # what is beyond first order took a pole across: stay further away
                room, damping = room / 4, damping * 2
            else:
                damping *= 4
        return damping, False

    def _cost(self, numbers: Numbers, pool: ThreadPoolExecutor) -> float:
        if (numbers.frequency <= 0).any():
            return math.inf
        try:
            plant = self._plant(numbers)
        except ValueError:  # the loop through the plays is no contraction at this step
            return math.inf
        found = pool.map(lambda r: tangents.squared_error(plant, r, numbers.delay_s), self.steady)
        return float(self.weights @ np.array(list(found)))

    def _floors(self, diagonal: Floats) -> Floats:
        """Least curvature of each number, from the mean of its kind: one that hardly acts yet is not to run away."""
        floors, start = np.full(diagonal.size, 1e-12 * float(diagonal.max())), 0
        for name in FIELDS:
            part = slice(start, start + getattr(self.numbers, name).size)
            floors[part] += 0.03 * float(diagonal[part].mean()) if part.stop > part.start else 0.0
            start = part.stop
        return floors


def _bounded_move(
    system: tuple[Floats, Floats, Floats], damping: float, bounds: tuple[Floats, Floats]
) -> tuple[Floats, bool]:
    """A damped step that, to first order, takes no pole further than half of its way to zero; whether one held it.

    Args:
        system: Normal matrix, scaled by the size of each number, gradient and sizes.
        damping: What is added to the diagonal.
        bounds: Of each pole, how far it may rise in 1/s, and its derivative by each number.
    """
    matrix, gradient, size = system
    inverse = np.asarray(np.linalg.inv(matrix + damping * np.eye(size.size)), dtype=np.float64)
    room: Floats = np.maximum(bounds[0], 1e-9)
    slopes = np.asarray(bounds[1] / size, dtype=np.float64)
    free: Floats = np.asarray(-(inverse @ (gradient / size)), dtype=np.float64)
    move: np.ndarray = free
    active: list[int] = []
    for _ in range(_BOUNDS):
        beyond = (slopes @ move - room) / room
        worst = int(np.argmax(beyond))
        if beyond[worst] <= 1e-6:
            break
        active, pull = _pulls([*active, worst], slopes, inverse, np.asarray(slopes @ free - room))
        move = free - inverse @ (slopes[active].T @ pull)
    return np.asarray(move / size), bool(active)


def _pulls(active: list[int], slopes: Floats, inverse: Floats, beyond: np.ndarray) -> tuple[list[int], Floats]:
    """How hard each bound pulls on a step so that all are met, without those that would push."""
    while True:
        own = slopes[active]
        pull = np.asarray(np.linalg.lstsq(own @ inverse @ own.T, beyond[active], rcond=1e-9)[0], dtype=np.float64)
        if (pull >= 0.0).all():
            return active, pull
        active = [k for k, p in zip(active, pull, strict=True) if p >= 0.0]


def _result(
    search: _Search, units: tuple[float, float], amplitudes: tuple[float, ...], rate_hz: float
) -> HystereticStiffnessFit:
    numbers, moved = search.numbers, _moved(search)
    modes, pairs = numbers.decay.size, numbers.frequency.size
    error = np.full(numbers.vector().size, np.nan) if moved is None else np.sqrt(np.sum(moved**2, axis=0))
    poles_error = error[:modes].astype(complex)
    poles_error[:pairs] += 1j * error[modes : modes + pairs]
    return HystereticStiffnessFit(
        mirror=scaled(numbers, *units).mirror("identified"),
        delay_s=numbers.delay_s,
        delay_error_s=float(error[-1]),
        rate_hz=rate_hz,
        sub_steps=search.steady[0].sub_steps,
        order=int(numbers.B.shape[0]),
        parameters=numbers.vector().size - (1 if search.fixed_delay else 0),
        redundant=numbers.redundant,
        poles_rad_s=numbers.poles,
        poles_error_rad_s=poles_error,
        error_rms=units[1] * search.error,
        start_error_rms=units[1] * search.start_error,
        amplitudes=amplitudes,
        classes=tuple(search.classes),
        costs=tuple(search.costs),
        iterations=len(search.costs) - 1,
        converged=search.converged,
        held=search.held,
        names=numbers.names,
        moved=None if moved is None else _in_si(numbers, moved, units),
    )


def _moved(search: _Search) -> Floats | None:
    """Root of the cluster-robust covariance, shape (records, numbers); None with a single record in an amplitude."""
    if int(np.bincount(np.asarray(search.classes)).min()) < 2:
        return None
    matrix, total = search.normal_equations()
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse = np.linalg.pinv(matrix / np.outer(size, size), rcond=1e-6, hermitian=True) / np.outer(size, size)
    pulls = np.array(
        [w * p.gradient - total / len(search.parts) for w, p in zip(search.weights, search.parts, strict=True)]
    )
    count = len(search.parts)
    moved = pulls @ inverse * math.sqrt(count / (count - 1))
    moved[:, -1] *= not search.fixed_delay
    return np.asarray(moved)


def _in_si(numbers: Numbers, moved: Floats, units: tuple[float, float]) -> Floats:
    """Changes of all numbers, in the search's units, as changes of the numbers of a mirror file in SI units."""
    rows = np.array([scaled(numbers.at(row), *units).vector() for row in moved])
    rows[:, : numbers.decay.size] *= -1.0  # a file's decay is above 0
    return rows
