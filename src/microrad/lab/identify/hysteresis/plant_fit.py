"""Joint fit of everything in a mirror, linear part, hysteresis and its place in the loop, by simulating the plant form.

A `Structure` turns a list of parameters into a mirror in the plant form (`microrad.mirror.model`); the fit runs that
mirror over the recordings with the kernel that every simulation uses and minimises measured less modelled by
trust-region least squares. So phase lag is counted once, and a hysteretic stiffness (q = F x) is fitted like any other
element.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from microrad.core import kernels, periodic
from microrad.core.arrays import Complexes, Floats, Integers
from microrad.core.progress import Progress
from microrad.core.threads import in_threads
from microrad.lab.identify.linear.modal import Hold, beyond, late
from microrad.lab.identify.records import IdentificationError, no_progress
from microrad.lab.identify.statistics import Estimate, colour_inflation, correlation
from microrad.lab.recording import Recording
from microrad.mirror import model as mirror
from microrad.mirror.model import Mirror

Interpolation = Literal["linear", "band-limited"]

_ROUGH = 1e-8  # relative change of cost or place from which a search goes on by central differences
_SCREENED = 1e-5  # and that at which it ends on fewer samples
_DIFFERENCE = 1e-5
_BANK = ("bouc_wen", "operator", "play_start", "play_threshold", "play_weight")  # fields of a plant
_KEPT = 100  # discretised mirrors
_SLICE = 2_000_000
_OFTEN = 100_000  # steps of all runs, above which loops that a search runs a thousand times are worth being unrolled
_LINES = 30  # of the spectrum of a residual to either side, at least, that tell its power
_AS_GOOD_AS_NONE = 1e-6  # of the mean power of J over all lines
_LEFT = 1e-3  # share of a line's power, at least, that a fit is taken to leave
_NO_SLOPE, _UNKNOWN = 1e-150, 1e3  # length of a column of zeros, and the error of such a parameter over its size
_AT = 1e-7  # of its size: a parameter nearer to its bound is there
_FAR = 1e3  # times the largest output: a model further off is as good as none


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number to be fitted: name, unit, where the search begins, its bounds, and a change of it that is of order one.

    `size` is the size of the start where it is left at 0. `linear` says that the output is linear in all such
    parameters together, the others held: then a single simulation with no other of them gives its derivative.
    """

    name: str
    unit: str
    start: float
    lower: float = -math.inf
    upper: float = math.inf
    size: float = 0.0
    linear: bool = False

    @property
    def scale(self) -> float:
        """The change of order one."""
        return self.size or abs(self.start) or 1.0


def _no_delay(_values: Floats) -> float:
    return 0.0


@dataclass(frozen=True, eq=False)
class Structure:
    """Parameters, and how they make a mirror: `build` takes their values, in their order, and raises nothing.

    `late` gives, of the same values, the delay of the recording chain behind that mirror (s). `beside` holds what the
    mirror contains beside the rest and what never changes: number of a linear parameter, and the mirror for 1 of it
    alone. It is simulated once.
    """

    name: str
    parameters: tuple[Parameter, ...]
    build: Callable[[Floats], Mirror]
    late: Callable[[Floats], float] = _no_delay
    beside: tuple[tuple[int, Mirror], ...] = ()


@dataclass(frozen=True, eq=False)
class FitRecord:
    """One record as the fit sees it.

    `drive` (steps of `step_s`, actuators) goes to the plant, about its rest; every `stride`-th output, from the first,
    belongs to a row of `output` (samples, outputs). Rows before `first` are the transient. `nuisance` (used samples,
    columns) is what every output may add to itself freely: an offset, the tail of an older creep. `weight` is what one
    unit of residual counts. `hold` is what the drive does between two steps; `late_s` is a known delay of this record.
    """

    name: str
    drive: Floats
    output: Floats
    step_s: float
    stride: int
    first: int
    nuisance: Floats
    weight: float = 1.0
    hold: Hold = "first-order"
    late_s: float = 0.0

    @property
    def target(self) -> Floats:
        """The used part of the output without its nuisance."""
        return without_nuisance(self.nuisance, self.output[self.first :])


def without_nuisance(nuisance: Floats, signal: Floats) -> Floats:
    """A signal less its projection onto orthonormal columns.

    Args:
        nuisance: The orthonormal columns, shape (samples, columns).
        signal: The signal, shape (samples, outputs).
    """
    return np.asarray(signal - nuisance @ (nuisance.T @ signal)) if nuisance.size else signal


def upsampled(drive: Floats, factor: int, hold: Interpolation) -> Floats:
    """A drive at a multiple of its rate; row factor * k belongs to sample k.

    Args:
        drive: The drive, shape (samples, inputs).
        factor: The multiple.
        hold: "linear": straight between samples; "band-limited": trigonometric, for a drive of whole periods.
    """
    if factor == 1 or hold == "band-limited":
        return periodic.upsampled(drive, factor)
    samples = drive.shape[0]
    fine = np.arange(factor * (samples - 1) + 1) / factor
    return np.column_stack([np.interp(fine, np.arange(samples), column) for column in drive.T])


def fit_records(
    recordings: Sequence[Recording],
    *,
    factor: int = 1,
    hold: Interpolation = "linear",
    drop: int = 0,
    offset: bool = True,
) -> tuple[FitRecord, ...]:
    """Recordings as the records of a fit.

    A periodic recording (period_samples) whose periods share their drive is reduced to one period, the mean of its
    periods from the second on, behind a run-in of one period of the same drive. Others start at rest at their first
    drive value.

    Args:
        recordings: The recordings.
        factor: Plant steps a sample.
        hold: How the drive is interpolated, see `upsampled`.
        drop: First samples that are left out of the fit, where a recording is not periodic.
        offset: Whether each output has a free zero.

    Raises:
        IdentificationError: If nothing is left to fit.
    """
    made = []
    for recording in recordings:
        if _repeats(recording):
            drive, output, first = _one_period(recording, factor, hold)
        elif drop >= recording.samples - 1:
            raise IdentificationError(
                f"{recording.path}: {recording.samples} samples, of which the first {drop} are left out: nothing is "
                "left to fit; leave out fewer or record longer."
            )
        else:
            drive, output, first = (
                upsampled(recording.drive - recording.drive[:1], factor, hold),
                recording.output,
                drop,
            )
        used = len(output) - first
        nuisance = np.full((used, 1), 1.0 / math.sqrt(used)) if offset else np.zeros((used, 0))
        made.append(FitRecord(recording.path, drive.copy(), output, recording.step_s / factor, factor, first, nuisance))
    return tuple(made)


def _repeats(recording: Recording) -> bool:
    period = recording.period_samples
    if period is None or recording.samples < 2 * period:
        return False
    spread = np.abs(recording.drive[period : 2 * period] - recording.drive[:period]).max()
    return bool(spread <= 1e-6 * np.abs(recording.drive).max())


def _one_period(recording: Recording, factor: int, hold: Interpolation) -> tuple[Floats, Floats, int]:
    """Two periods of the drive, the output with its mean period as the second one, and the first sample of that."""
    period = recording.period_samples or recording.samples
    whole = recording.samples // period
    if hold == "linear":
        wrapped = np.concatenate([recording.drive[:period], recording.drive[:1]])
        one = upsampled(wrapped, factor, hold)[: period * factor]
    else:
        one = upsampled(recording.drive[:period], factor, hold)
    mean = recording.output[period : whole * period].reshape(whole - 1, period, -1).mean(axis=0)
    return np.concatenate([one, one]), np.concatenate([np.zeros((period, mean.shape[1])), mean]), period


def held(plant: kernels.Plant) -> kernels.Plant:
    """The plant for a drive that is held over each step: drive and bank act with their values at its start."""
    nothing = np.zeros_like(plant.E1)
    return plant._replace(B0=plant.B0 + plant.B1, B1=np.zeros_like(plant.B1), E1=nothing, CE1=np.zeros_like(plant.CE1))


def simulate_record(plant: kernels.Plant, run: FitRecord, delay_s: float = 0.0) -> Floats:
    """Output (samples, outputs) of the plant over a run, from rest.

    Args:
        plant: The discrete plant, with the time step and the hold of the run's drive.
        run: The run, whose drive has `stride` steps in each sample of the output.
        delay_s: Delay of the recording chain behind it, in s.
    """
    return _delayed(_undelayed(plant, run), run, delay_s)


def _delayed(output: Floats, run: FitRecord, delay_s: float) -> Floats:
    return late(output, (delay_s + run.late_s) / run.step_s)[: run.drive.shape[0] : run.stride]


def _undelayed(plant: kernels.Plant, run: FitRecord) -> Floats:
    state = mirror.at_rest(plant)
    drive = beyond(run.drive, math.inf)  # as far as any delay looks
    output = np.empty((drive.shape[0], len(plant.outputs)))
    bank = np.empty((drive.shape[0], 0))
    for begin in range(0, drive.shape[0], _SLICE):  # the interpreter answers Ctrl-C between two of them
        part = slice(begin, begin + _SLICE)
        mirror.respond(plant, state, drive[part], output[part], bank[part])
    return output


@dataclass(frozen=True, eq=False)
class PlantFit(Estimate):
    """What came out: the mirror, its parameters with their covariance, and how well it follows the records.

    `covariance`, over the parameters in their order, comes from the residuals of each run by themselves (the sandwich
    (J'J)^-1 J'VJ (J'J)^-1), with their colour counted for each direction (`coloured_scatter`). `colour_inflation`
    (see `statistics`) is that of the most coloured residual.
    `residual_rms` has the shape (runs, outputs), in the units of the recordings, without the weights. `start_costs` are
    the costs reached from each start, before the search went on from the best, `agreeing_starts` how many came to
    within 0.1 % of it. `not_identified` names each parameter that the records do not fix, with the reason. Where the
    search was not `converged` it stopped at its last evaluation on the way down, and the standard errors are those of a
    point that is no minimum.
    """

    structure: Structure
    values: Floats
    covariance: Floats
    colour_inflation: float
    condition_number: float
    not_identified: tuple[tuple[str, str], ...]
    residual_rms: Floats
    residuals: tuple[Floats, ...]
    start_costs: tuple[float, ...]
    agreeing_starts: int
    evaluations: int
    converged: bool

    @property
    def mirror(self) -> Mirror:
        """The fitted mirror."""
        return self.structure.build(self.values)


class PlantProblem:
    """The weighted residual of a structure on its runs, and its derivatives by differences, as functions of the values.

    A search sees both turned so that the residual lies along the first axis: costs, gradients and steps are the same,
    and there are no more rows than parameters and one.
    """

    def __init__(self, structure: Structure, records: Sequence[FitRecord]) -> None:
        """The parameters are searched in units of their scale."""
        self.structure, self.runs = structure, tuple(records)
        self.steps = {(run.step_s, run.hold) for run in self.runs}
        self.often = sum(run.drive.shape[0] for run in self.runs) > _OFTEN
        self.scale = np.array([p.scale for p in structure.parameters])
        self.lower = np.array([p.lower for p in structure.parameters]) / self.scale
        self.upper = np.array([p.upper for p in structure.parameters]) / self.scale
        self.targets = [run.target for run in self.runs]
        self.edges = np.cumsum([target.size for target in self.targets])[:-1]
        self.size = sum(target.size for target in self.targets)
        largest = [run.weight * float(np.max(np.abs(t))) for run, t in zip(self.runs, self.targets, strict=True)]
        self.far = _FAR * max(largest)
        self.measured = np.concatenate([r.weight * t.ravel() for r, t in zip(self.runs, self.targets, strict=True)])
        # A point is asked for up to three times: by the search, by the derivatives there and by the report.
        self.simulated = lru_cache(maxsize=2 * self.scale.size + 2)(self._simulate)
        self.discrete: dict[tuple[int | bytes, ...], dict[float, kernels.Plant]] = {}  # by what is not the bank
        self.beside = {i: [self.scale[i] * each for each in self._outputs(model)] for i, model in structure.beside}
        self.used_beside = lru_cache(maxsize=len(self.beside))(lambda i, delay_s: self._used(self.beside[i], delay_s))
        self.linear = np.array([p.linear for p in structure.parameters], dtype=bool)

    def modelled(self, point: Floats) -> Floats:
        """All used outputs as one vector, at a scaled point; far off where the plant cannot be stepped or runs away."""
        return self.simulated(point.tobytes())

    def _simulate(self, point: bytes) -> Floats:
        place = np.frombuffer(point)
        values = place * self.scale
        rest = values.copy()
        rest[list(self.beside)] = 0.0
        try:
            outputs = self._outputs(self.structure.build(rest))
        except ValueError:
            return np.full(self.size, self.far)
        for number, each in self.beside.items():
            for output, one in zip(outputs, each, strict=True):
                np.add(output, place[number] * one, out=output)
        return self._used(outputs, self.structure.late(values))

    def _outputs(self, model: Mirror) -> list[Floats]:
        """Of each run the output of a mirror at every step, without the delay behind it."""
        longest = max(run.step_s for run in self.runs)  # where one of them has no plant, it is this
        own = mirror.discretise(model, longest, often=self.often)
        bank = {field: getattr(own, field) for field in _BANK}
        linear = (len(model.bouc_wen), *(getattr(model, field).tobytes() for field in "ABEFGCDK"))
        shared = self.discrete.get(linear)
        if shared is None:
            shared = {
                step: mirror.discretise(model, step, often=self.often) for step, _ in self.steps if step != longest
            }
            shared[longest] = own
            if len(self.discrete) > _KEPT:  # those of places that the search has left
                self.discrete.clear()
            self.discrete[linear] = shared
        plants = {step: plant._replace(**bank) for step, plant in shared.items()}
        of = {(step, hold): plants[step] if hold == "first-order" else held(plants[step]) for step, hold in self.steps}
        return [_undelayed(of[run.step_s, run.hold], run) for run in self.runs]

    def _used(self, outputs: Sequence[Floats], delay_s: float) -> Floats:
        """The used part of such outputs, weighted, as one vector."""
        pairs = [(r, _delayed(output, r, delay_s)[r.first :]) for r, output in zip(self.runs, outputs, strict=True)]
        whole = np.concatenate([run.weight * without_nuisance(run.nuisance, used).ravel() for run, used in pairs])
        return np.where(np.abs(whole) < self.far, whole, self.far)  # nan and inf too

    def residual(self, point: Floats) -> Floats:
        """Modelled less measured, weighted, at a scaled point, turned onto the first axis."""
        turned = np.zeros(1 + point.size)
        turned[0] = np.linalg.norm(self.modelled(point) - self.measured)
        return turned

    def slopes(self, point: Floats, *, central: bool, free: Sequence[int] | None = None) -> Floats:
        """Derivative of the residual by the scaled parameters, turned as it is.

        Args:
            point: The scaled point.
            central: Whether differences are taken to both sides; those to one side, good enough on the way, need half
                as many simulations.
            free: Numbers of the parameters, None for all.
        """
        count = point.size if free is None else len(free)
        rows = np.vstack([*self.triangles(point, central, free), np.zeros((1 + point.size, 1 + count))])
        turned = _triangle(rows)
        turned[0] *= math.copysign(1.0, turned[0, 0])
        return np.vstack([turned[:, 1:], np.zeros((point.size - count, count))])

    def triangles(self, point: Floats, central: bool, free: Sequence[int] | None = None) -> list[Floats]:
        """Of each run the triangle of a QR decomposition of its residual (first column) and derivatives.

        Args:
            point: The scaled point.
            central: Whether differences are taken to both sides.
        """
        return in_threads([partial(_triangle, part) for part in self.rows(point, central, free)])

    def rows(self, point: Floats, central: bool, free: Sequence[int] | None = None) -> list[Floats]:
        """Of each run its residual (first column) and derivatives, shape (used values, 1 + parameters).

        Args:
            point: The scaled point.
            central: Whether differences are taken to both sides.
            free: Numbers of the parameters, None for all.
        """
        here = self.modelled(point)
        few = self.linear.sum() <= len(self.beside) + 1
        base = point if few else np.where(self.linear, 0.0, point)  # of several, each is simulated without the others
        from_base = self.modelled(base)
        delay_s = self.structure.late(point * self.scale)

        def column(i: int) -> Floats:
            step, size = np.zeros(point.size), _DIFFERENCE
            if i in self.beside:
                return self.used_beside(i, delay_s)
            if self.linear[i]:
                step[i] = 1.0
                return np.asarray(self.modelled(base + step) - from_base)
            if not central:
                step[i] = size if point[i] + size <= self.upper[i] else -size
                return np.asarray((self.modelled(point + step) - here) / step[i])
            up = min(point[i] + size, self.upper[i]) - point[i]
            down = point[i] - max(point[i] - size, self.lower[i])
            step[i] = up + down
            above, below = point + (up / step[i]) * step, point - (down / step[i]) * step
            return np.asarray((self.modelled(above) - self.modelled(below)) / step[i])

        columns = in_threads([partial(column, i) for i in (range(point.size) if free is None else free)])
        return [part.T for part in np.split(np.array([here - self.measured, *columns]), self.edges, axis=1)]


def _triangle(rows: Floats) -> Floats:
    return np.asarray(np.linalg.qr(rows, mode="r"))


def fit_plant(
    structure: Structure,
    records: Sequence[FitRecord],
    *,
    screen: Sequence[FitRecord] = (),
    starts: Sequence[Floats] = (),
    tolerance: float = 1e-9,
    most_evaluations: int = 60,
    on_progress: Progress | None = None,
) -> PlantFit:
    """Fit all parameters of a structure to all records at once, by trust-region least squares within their bounds.

    Of several starts the search goes on, with derivatives to both sides, from the place of the least cost.

    Args:
        structure: The parameters, with the point where the search begins, and the mirror that they make.
        records: What is fitted to.
        screen: The same records in fewer samples, where the searches from all starts are made on those first.
        starts: Further points where a search begins, values in the order of the parameters.
        tolerance: Relative change of cost or place at which a search ends.
        most_evaluations: Largest number of simulations of all records in a search, without those for derivatives.
        on_progress: Called with the searches done, their number and the name of the structure.

    Raises:
        IdentificationError: If no start can be simulated.
    """
    problem = PlantProblem(structure, records)
    screened = PlantProblem(structure, screen) if screen else problem
    own, ending = np.array([p.start for p in structure.parameters]), _SCREENED if screen else _ROUGH
    near = []
    for done, start in enumerate([own, *starts], 1):
        near.append(_search(screened, start / problem.scale, ending, most_evaluations, central=False))
        (on_progress or no_progress)(done, 1 + len(starts), structure.name)
    first = min(near, key=lambda s: float(s.cost))
    if screen:
        first = _search(problem, first.x, _ROUGH, most_evaluations, central=False)
    best = _search(problem, first.x, tolerance, max(most_evaluations - first.nfev, 1), central=True)
    best.nfev += first.nfev
    if best.cost >= 0.4 * problem.size * problem.far**2:
        raise IdentificationError(
            f"{structure.name}: the mirror cannot be simulated from any start at a step of "
            f"{max(run.step_s for run in records):g} s; begin nearer, or take more steps a sample."
        )
    return _report(problem, best, [float(s.cost) for s in near])


def _search(problem: PlantProblem, start: Floats, tolerance: float, most_evaluations: int, *, central: bool) -> Any:
    """Least squares within the bounds. What is at its bound is held, until it would gain by leaving.

    A search that keeps such parameters within their bounds is slow, and a grid of play operators has many.
    """
    point = np.clip(start, problem.lower, problem.upper)
    held = _at_bound(problem, point)
    evaluations = 0
    while True:
        free = np.flatnonzero(~held | held.all())
        found = _search_free(problem, point, free, tolerance, most_evaluations - evaluations, central=central)
        point, evaluations = _placed(point, free, found.x), evaluations + found.nfev
        at = _at_bound(problem, point)
        point = np.where(at, np.where(point - problem.lower < _AT, problem.lower, problem.upper), point)
        leaving = at & _would_leave(problem, point, tolerance * found.cost)
        if evaluations >= most_evaluations or (np.array_equal(at, held) and not leaving.any()):
            break
        held = at & ~leaving
    found.x, found.nfev = point, evaluations
    return found


def _search_free(
    problem: PlantProblem, point: Floats, free: Integers, tolerance: float, most: int, *, central: bool
) -> Any:
    from scipy.optimize import least_squares

    return least_squares(
        lambda values: problem.residual(_placed(point, free, values)),
        point[free],
        jac=lambda values: problem.slopes(_placed(point, free, values), central=central, free=free.tolist()),
        bounds=(problem.lower[free], problem.upper[free]),
        method="trf",
        x_scale="jac",
        ftol=tolerance,
        xtol=tolerance,
        gtol=1e-12,
        max_nfev=max(most, 1),
    )


def _placed(point: Floats, where: Integers, values: Floats) -> Floats:
    moved = point.copy()
    moved[where] = values
    return moved


def _at_bound(problem: PlantProblem, point: Floats) -> NDArray[np.bool_]:
    return np.asarray(np.minimum(point - problem.lower, problem.upper - point) < _AT)


def _would_leave(problem: PlantProblem, point: Floats, gain: float) -> NDArray[np.bool_]:
    """Which parameters at a bound would gain more than that by leaving it, to first order."""
    at = np.flatnonzero(_at_bound(problem, point))
    leaving = np.zeros(point.size, dtype=bool)
    if at.size:
        slopes = problem.slopes(point, central=False, free=at.tolist())
        pull = -(slopes.T @ problem.residual(point))
        inward = np.where(point[at] - problem.lower[at] < _AT, 1.0, -1.0)
        worth = pull**2 / np.maximum(np.einsum("ij,ij->j", slopes, slopes), 1e-300) / 2
        leaving[at] = (pull * inward > 0.0) & (worth > gain)
    return leaving


# ---------------------------------------------------------------------------------------------------------- report
def _report(problem: PlantProblem, best: Any, costs: list[float]) -> PlantFit:
    values = best.x * problem.scale
    residuals = tuple(
        target - out.reshape(target.shape) / run.weight
        for run, target, out in zip(
            problem.runs, problem.targets, np.split(problem.modelled(best.x), problem.edges), strict=True
        )
    )
    colours = [colour_inflation(list(residual.T)) for residual in residuals]
    rows = problem.rows(best.x, central=True)
    covariance, condition = _covariance([part[:, 1:] for part in rows], _scatter(problem, rows), problem)
    problem.simulated.cache_clear()
    return PlantFit(
        structure=problem.structure,
        values=values,
        covariance=covariance,
        colour_inflation=max(colours),
        condition_number=condition,
        not_identified=tuple(_not_identified(problem.structure, values, covariance)),
        residual_rms=np.array([np.sqrt(np.mean(r**2, axis=0)) for r in residuals]),
        residuals=residuals,
        start_costs=tuple(costs),
        agreeing_starts=int(np.sum(np.array(costs) <= min(costs) * (1 + 1e-3))),
        evaluations=int(best.nfev),
        converged=best.status > 0,
    )


def _scatter(problem: PlantProblem, rows: Sequence[Floats]) -> Floats:
    """Covariance of the gradient J'r over all runs, each with the colour of its residual.

    Args:
        problem: The problem.
        rows: Of each run its residual and J.
    """
    squares = [part[:, 1:].T @ part[:, 1:] for part in rows]
    gram = np.sum(squares, axis=0)
    if not np.isfinite(gram).all():  # `_covariance` says so
        return np.zeros_like(gram)
    length = np.maximum(np.sqrt(np.diag(gram)), _NO_SLOPE)
    inverse = np.linalg.pinv(gram / np.outer(length, length), rcond=1e-13, hermitian=True) / np.outer(length, length)
    variances = [float(np.mean(part[:, 0] ** 2)) for part in rows]
    moved = inverse @ np.sum([v * each for v, each in zip(variances, squares, strict=True)], axis=0) @ inverse
    jobs = [
        partial(coloured_scatter, part, target.shape[1], run.nuisance, 2 * inverse - moved / (v + 1e-300))
        for part, target, run, v in zip(rows, problem.targets, problem.runs, variances, strict=True)
    ]
    return np.asarray(np.sum(in_threads(jobs), axis=0))


def coloured_scatter(rows: Floats, outputs: int, nuisance: Floats, taken: Floats) -> Floats:
    """Covariance of the gradient J'r of a run, the colour of its residual counted line by line.

    The residual is taken for stationary noise: then the covariance is the sum over frequencies of its power times the
    transforms of the columns of J. That power is a mean over a quarter octave and at least some lines: the larger one
    of the plain mean and of that which weighs each line by what J has there, as the residual of loops that repeat has
    its power at the same lines as J. What the fit has taken out of a line is given back: of white noise of variance v,
    1 - j T j' - n is left there, with j the transform of J, n the share of the nuisance and T = 2 G - G J'VJ G / v,
    where G = (J'J)^-1 and V holds the variances of all runs. (With one run T is G: the leverage, as in the estimator
    HC2 of J. MacKinnon and H. White, J. Econometrics 29 (1985) 305.)

    Args:
        rows: Residual and J of the run, shape (samples x outputs, 1 + parameters).
        outputs: Number of outputs.
        nuisance: Its orthonormal columns, shape (samples, columns).
        taken: T, shape (parameters, parameters).
    """
    samples = len(rows) // outputs
    total = np.zeros((rows.shape[1] - 1,) * 2)
    of_nuisance = np.sum(np.abs(np.fft.rfft(nuisance, axis=0)) ** 2, axis=1) if nuisance.size else 0.0
    for part in rows.reshape(samples, outputs, -1).transpose(1, 0, 2):
        lines = np.fft.rfft(part, axis=0)
        twice = np.full(len(lines), 2.0)
        twice[0] = 1.0
        if samples % 2 == 0:
            twice[-1] = 1.0
        size = np.linalg.norm(part[:, 1:], axis=0) + 1e-300
        worth = np.sum(np.abs(lines[:, 1:] / size) ** 2, axis=1)
        worth += _AS_GOOD_AS_NONE * worth.mean() + 1e-300  # lines at which J has nothing: rounding tells nothing there
        of_fit = np.einsum("kj,kj->k", lines[:, 1:].conj() @ taken, lines[:, 1:]).real
        left = np.clip(1.0 - (of_fit + of_nuisance) / samples, _LEFT, 1.0)
        power = np.maximum(_mean_power(lines[:, 0], left, worth), _mean_power(lines[:, 0], left, np.ones(worth.size)))
        weighed = lines[:, 1:] * np.sqrt(power * twice)[:, None] / samples
        total += (weighed.conj().T @ weighed).real
    return total


def _mean_power(residual: Complexes, left: Floats, worth: Floats) -> Floats:
    """Power of a residual about each line, of which a fit has left a share, as a mean that weighs by `worth`."""
    number = np.arange(residual.size)
    half = np.maximum(_LINES, number // 10)
    low, high = np.maximum(number - half, 0), np.minimum(number + half + 1, residual.size)

    def over(values: Floats) -> Floats:
        added = np.append(0.0, np.cumsum(values))
        return np.asarray(np.maximum(added[high] - added[low], 0.0))

    return over(worth * np.abs(residual) ** 2) / over(worth * left)


def _covariance(slopes: Sequence[Floats], scatter: Floats, problem: PlantProblem) -> tuple[Floats, float]:
    """The sandwich in the parameters' units, and the condition number of J with columns of length 1.

    Of each run there are the rows of J; `scatter` is the covariance of the whole gradient.
    """
    lengths = [np.einsum("ij,ij->j", part, part) for part in slopes]
    length = np.maximum(np.sqrt(np.sum(lengths, axis=0)), _NO_SLOPE)
    if not np.isfinite(length).all():
        raise IdentificationError(
            f"{problem.structure.name}: a small change of the best parameters leads to a mirror that cannot be "
            "simulated, so nothing can be said of their errors; record loops over the whole range of the drive as well."
        )
    gram = np.sum([part.T @ part for part in slopes], axis=0) / np.outer(length, length)
    values, vectors = np.linalg.eigh(gram)
    values = np.maximum(values, 1e-15)
    bread = (vectors / values) @ vectors.T
    inner, turned = np.linalg.eigh(scatter / np.outer(length, length))
    half = bread @ (turned * np.sqrt(np.maximum(inner, 0.0)))  # a square cannot come out negative
    unknown = length <= _NO_SLOPE  # nothing depends on it here
    size = np.where(unknown, 0.0, problem.scale / length)
    covariance = size[:, None] * (half @ half.T) * size + np.diag(np.where(unknown, _UNKNOWN * problem.scale, 0.0) ** 2)
    return np.asarray(covariance), float(math.sqrt(values[-1] / values[0]))


def _not_identified(structure: Structure, values: Floats, covariance: Floats) -> list[tuple[str, str]]:
    """Parameters with a relative standard error above 0.5, or a correlation above 0.95 with another, and why."""
    errors = np.sqrt(np.diag(covariance))
    between = np.abs(correlation(covariance)) - np.eye(values.size)
    found = []
    for i, p in enumerate(structure.parameters):
        partner = int(np.argmax(between[i])) if values.size > 1 else i
        if values[i] <= p.lower or values[i] >= p.upper:
            found.append((p.name, f"at its bound, {values[i]:g} {p.unit}".rstrip()))
        elif errors[i] > abs(values[i]):
            found.append((p.name, f"not told from 0: standard error {errors[i]:.2g} {p.unit}".rstrip()))
        elif errors[i] > 0.5 * abs(values[i]):
            found.append((p.name, f"relative standard error {100 * errors[i] / abs(values[i]):.0f} %"))
        elif between[i, partner] > 0.95:
            other = structure.parameters[partner].name
            found.append((p.name, f"correlation {between[i, partner]:.3f} with {other}"))
    return found
