"""Hysteresis, linear part and creep of one axis, fitted together to all recordings of it.

The start comes from fits that are linear in most of their numbers; `plant_fit` then moves everything at once. Each
recording counts alike, whatever its length and size: its residual is divided by its rms output.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.lab.identify.hysteresis.bouc_wen import BoucWenFit, fit_bouc_wen, made_rising
from microrad.lab.identify.hysteresis.plant_fit import (
    FitRecord,
    PlantFit,
    PlantProblem,
    fit_plant,
    held,
    without_nuisance,
)
from microrad.lab.identify.hysteresis.prandtl_ishlinskii import non_negative_weights, threshold_grid
from microrad.lab.identify.hysteresis.structures import AxisStructure, LinearPoles, one_axis
from microrad.lab.identify.linear.modal import HOLD, Hold, beyond, late
from microrad.lab.identify.records import SiRecord, Units, fastest_rate, memory, orthonormal, si_records, span
from microrad.lab.recording import Recording
from microrad.mirror import model as mirror
from microrad.mirror.hysteresis import NO_CREEP, BoucWen, Creep, PrandtlIshlinskii, slow_gain
from microrad.mirror.model import Mirror

_OPERATORS = 15
_MOST_SAMPLES = 20_000
_STRAIGHT = 2e-3  # a drive is, whose distance from straight lines is at most this part of its rms
_SCREENED_SAMPLES, _NEARLY_STRAIGHT = 4_000, 2e-2
_EVALUATIONS = 200
_POLISHING = 60  # each is long: the broadband recordings belong to it


@dataclass(frozen=True, slots=True)
class Form:
    """What a joint fit may contain: a family, its free extras, and creep."""

    family: str  # "bouc_wen", "prandtl_ishlinskii" or "linear", which is one play without threshold
    free: tuple[str, ...] = ()
    creep: bool = False
    needs_linear: bool = False  # without a linear part another model says the same


FORMS = {
    "linear": Form("linear", needs_linear=True),
    "bouc_wen_classical": Form("bouc_wen", ("exponent",)),
    "bouc_wen_joint": Form("bouc_wen", ("d2", "delta"), needs_linear=True),
    "bouc_wen_asymmetric": Form("bouc_wen", ("d2", "delta", "gamma", "eta")),
    "bouc_wen_creep": Form("bouc_wen", ("d2", "delta"), creep=True),
    "prandtl_ishlinskii_joint": Form("prandtl_ishlinskii", needs_linear=True),
    "prandtl_ishlinskii_rate": Form("prandtl_ishlinskii", ("widening",)),
    "prandtl_ishlinskii_creep": Form("prandtl_ishlinskii", creep=True),
    "prandtl_ishlinskii_rate_creep": Form("prandtl_ishlinskii", ("widening",), creep=True),
}
"""The joint forms by name; each has the linear part in cascade where there is one."""


@dataclass(frozen=True, eq=False)
class JointFit:
    """A joint fit of one axis in volts and radians.

    `model`, `creep` and `linear` are what the mirror consists of; `fit` holds the parameters of `structure` with their
    covariance.
    `time_constants_s` of the creep are chosen (decades that the recordings cover), not fitted. `hold` is what the
    drive does between samples, and `delay_s` the delay of the recording chain: `response` has it, `mirror` has not.
    `begun` says that the search began at an earlier fit of the same form, and nowhere else.
    """

    name: str
    form: Form
    structure: AxisStructure
    fit: PlantFit
    mirror: Mirror
    model: BoucWen | PrandtlIshlinskii
    creep: Creep
    linear: LinearPoles | None
    rate_limit_v_per_s: float
    units: Units
    residual_rms_rad: float
    residual_rms_percent: float
    samples_used: int
    hold: Hold = HOLD
    begun: bool = False

    @property
    def delay_s(self) -> float:
        """Pure delay of the recording chain; 0 without a linear part."""
        return 0.0 if self.linear is None else self.linear.delay_s

    @property
    def falling(self) -> bool:
        """Whether the output falls with the drive."""
        return slow_gain(self.model) < 0

    @property
    def parameter_count(self) -> int:
        """Number of parameters that were fitted."""
        return len(self.structure.parameters)

    @property
    def admissible(self) -> bool:
        """Whether the modelled mirror never moves against its drive just after a slow reversal."""
        if isinstance(self.model, PrandtlIshlinskii):
            return all(w * slow_gain(self.model) >= 0.0 for w in self.model.weights_rad_v)
        turned = made_rising(self.model)
        return turned.reversal_slope_rad_v() >= -1e-3 * turned.d1_rad_v

    @property
    def not_identified(self) -> tuple[tuple[str, str], ...]:
        """Parameters that the recordings do not fix: name, and the number that says so with what would help."""
        reversals = "loops fix the settled hysteresis, only the samples behind a reversal its parts; record small loops"
        found = self.fit.not_identified
        if self.creep.time_constants_s:
            slow = f"no record lasts long enough for a lag beyond {max(self.creep.time_constants_s):g} s"
            found = (*found, ("creep that is slower", slow))
        return tuple((name, f"{fact}; {_WHY.get(name.partition(' ')[0], reversals)}") for name, fact in found)

    def response(self, drive_v: Floats, step_s: float) -> tuple[Floats, int]:
        """Output (rad) without offset from rest at the first drive value, and the number of rate-clamped samples.

        Args:
            drive_v: Drive, in V, shape (samples,).
            step_s: Time between samples, in s.
        """
        plant = mirror.discretise(self.mirror, step_s)
        if self.hold == "zero-order":
            plant = held(plant)
        state = mirror.at_rest(plant)
        drive = beyond((drive_v - drive_v[0])[:, None], self.delay_s).copy()
        output = np.empty((len(drive), 1))
        mirror.respond(plant, state, drive, output, np.empty((len(drive), 0)))
        return late(output, self.delay_s / step_s)[: drive_v.size, 0], int(state.clamped.sum())

    def nuisance(self, drive_v: Floats, step_s: float, known: int) -> Floats:
        """What a record may add by itself: an offset, its `memory`, and the tail of a creep begun before it.

        Args:
            drive_v: Drive, in V, shape (samples,).
            step_s: Time between samples, in s.
            known: Samples from which it is fitted.
        """
        return _nuisance(drive_v, step_s, self.creep.time_constants_s, known)


_WHY = {
    "weight": "neighbouring thresholds do nearly the same; loops of more amplitudes tell them apart",
    "widening": "the loops widen too little with the rate to tell; record faster loops",
    "creep": "over a short record creep looks like gain; record a staircase with long dwells",
    "d1": "a large hysteresis or creep looks like gain; larger loops or longer records tell them apart",
    "d2": "its effect on the output is below what is left; faster loops would show it",
    "delta": "the loops widen too little with the rate to tell; record faster loops",
    "exponent": "only the shape of the branches fixes it; record loops of several amplitudes",
    "delay": "poles and zeros beyond the band turn the phase as a delay does",
    "pole": "a pole and a zero side by side nearly cancel, and one beyond the band is a flank only",
    "zero": "a pole and a zero side by side nearly cancel, and one beyond the band is a flank only",
}


def fit_joint(  # noqa: PLR0913  all but the first three are named options
    recordings: Sequence[Recording],
    name: str,
    units: Units,
    *,
    linear: LinearPoles | None = None,
    free_linear: bool = False,
    admissible: bool = False,
    broadband: Sequence[Recording] = (),
    static: BoucWenFit | None = None,
    hold: Hold = HOLD,
    begin: JointFit | None = None,
    evaluations: int | None = None,
    starts: int = 2,
    seed: int = 0,
    on_progress: Progress | None = None,
) -> JointFit:
    """Fit one of `FORMS` to all recordings at once, in cascade with a linear part where one is given.

    Args:
        recordings: Loops of one drive and one output each.
        name: Name of the form.
        units: Units of the recordings.
        linear: The linear part.
        free_linear: Whether its poles, zeros and delay are fitted with the rest.
        admissible: Whether epsilon is bounded so that the slope behind a slow reversal never turns.
        broadband: Recordings that belong to the fit where `free_linear` is set, so that they keep hold of the poles.
        static: The fit of Eq. 3 at which a Bouc-Wen form begins; by default it is made here.
        hold: What the drive does between samples: "zero-order" where the record is what a converter was told,
            "first-order" where the drive itself was measured.
        begin: A fit of the same form where the search begins; by default that is found here.
        evaluations: Largest number of simulations in a search, without those for derivatives; 1 searches nothing, and
            the errors are those where it begins.
        starts: Number of starts of a Bouc-Wen form; those behind the first are scattered about it.
        seed: Seed of the Philox stream that scatters them.
        on_progress: Called with the starts done, their number and the name.

    Raises:
        IdentificationError: If a recording cannot be used, or if no start can be simulated.
    """
    form = FORMS[name]
    if linear is None:
        hold = "first-order"  # where nothing lags, what is between the samples changes nothing
    whole = si_records(recordings, units)
    records = tuple(thin_record(record, _MOST_SAMPLES, _STRAIGHT) for record in whole)
    creep_times = time_constants(records) if form.creep else ()

    def prepared(chosen: Sequence[SiRecord]) -> list[FitRecord]:
        pairs = zip(chosen, whole, strict=True)
        return [_between(_fit_record(record, creep_times), hold, of.step_s) for record, of in pairs]

    fit_list = prepared(records)
    model: BoucWen | PrandtlIshlinskii
    if begin is not None:
        model, creep_rad_v = begin.model, begin.creep.weights_rad_v
    elif form.family == "bouc_wen":
        static = static or fit_bouc_wen(recordings, starts=6, seed=seed, units=units)
        model = replace(static.model, bias_v=float(np.mean([r.drive_v[0] for r in records])))
        if "delta" not in form.free:
            model = replace(model, d2_s_v=0.0, delta_s_v=0.0)
        creep_rad_v = (1e-3 * model.d1_rad_v,) * len(creep_times)
    else:
        model, creep_rad_v = _play_start(form, records, fit_list, linear, creep_times)
    structure = one_axis(
        name,
        model,
        linear=linear,
        creep=Creep(creep_rad_v, creep_times) if creep_times else NO_CREEP,
        free=form.free,
        free_linear=free_linear,
        admissible=admissible,
    )
    if broadband:
        # Of periods that only repeat, two say it all.
        short = [r.first(2 * r.period_samples) if r.period_samples else r for r in broadband]
        fit_list += [
            _between(_fit_record(record, creep_times), hold, record.step_s) for record in si_records(short, units)
        ]
    if begin is not None:
        fit_list = _weighed(structure, fit_list)
    coarse = [thin_record(record, _SCREENED_SAMPLES, _NEARLY_STRAIGHT) for record in records]
    fit = fit_plant(
        structure,
        fit_list,
        screen=() if free_linear else prepared(coarse),
        starts=_scattered_starts(structure, starts, seed) if form.family == "bouc_wen" and begin is None else (),
        # Candidates are only compared. Of N samples a gain of e moves a value by sqrt(N e) of its error at most.
        tolerance=1e-10 if free_linear else 1e-9,
        most_evaluations=evaluations or (_POLISHING if free_linear else _EVALUATIONS),
        on_progress=on_progress,
    )
    axis = structure.parts(fit.values)
    residual = np.concatenate([r[:, 0] for r in fit.residuals[: len(records)]])  # the broadband ones come behind
    rms = float(np.sqrt(np.mean(residual**2)))
    return JointFit(
        name=name,
        form=form,
        structure=structure,
        fit=fit,
        mirror=fit.mirror,
        model=axis.model,
        creep=axis.creep,
        linear=axis.linear,
        rate_limit_v_per_s=axis.model.rate_limit_v_s,
        units=units,
        residual_rms_rad=rms,
        residual_rms_percent=100 * rms / span(records),
        samples_used=residual.size,
        hold=hold,
        begun=begin is not None,
    )


# ---------------------------------------------------------------------------------------------------------- starts
def time_constants(records: Sequence[SiRecord]) -> tuple[float, ...]:
    """Decades of creep that the records show: from ten samples or 10 ms up to the longest record.

    A slower lag has hardly begun there: what it would come to is not known, and it would change the gain at rest.
    """
    longest = max(r.drive_v.size * r.step_s for r in records)
    shortest = max(10 * min(r.step_s for r in records), 1e-2)
    last = math.floor(math.log10(longest))
    first = min(math.ceil(math.log10(shortest)), last)
    return tuple(10.0**k for k in range(first, last + 1))


def thin_record(record: SiRecord, most: int, bent: float) -> SiRecord:
    """Every n-th sample of a long record, as long as straight lines between them still make the drive.

    The kernel is exact for such a drive at any step, so only samples are lost, and neighbouring ones say the same.

    Args:
        record: The record.
        most: Number of samples from which it is thinned.
        bent: Largest rms distance of the drive from the straight lines, in parts of its own rms.
    """
    size = record.drive_v.size
    stride = -(-size // most)
    spread = float(np.std(record.drive_v))
    while stride > 1:
        kept = np.arange(0, size, stride)
        away = np.interp(np.arange(kept[-1] + 1), kept, record.drive_v[kept]) - record.drive_v[: kept[-1] + 1]
        if float(np.sqrt(np.mean(away**2))) <= bent * spread:
            break
        stride //= 2
    return record.every(stride)


def _nuisance(drive_v: Floats, step_s: float, creep_times: Sequence[float], known: int) -> Floats:
    """Columns: an offset, the memory and, with creep, the tail that a level before the record leaves in all lags."""
    columns = [np.ones(drive_v.size), memory(drive_v, known)]
    if creep_times:
        time = np.arange(drive_v.size) * step_s
        columns.append(np.sum([np.exp(-time / tau) for tau in creep_times], axis=0))
    return np.column_stack(columns)


def _fit_record(record: SiRecord, creep_times: Sequence[float]) -> FitRecord:
    """A record about its first drive value; its weight makes it count as every other does."""
    used = record.output_rad[record.start :]
    nuisance = _nuisance(record.drive_v, record.step_s, creep_times, record.drive_v.size)[record.start :]
    weight = 1.0 / (float(np.std(used)) * math.sqrt(used.size))
    return FitRecord(
        record.name,
        (record.drive_v - record.drive_v[0])[:, None].copy(),
        record.output_rad[:, None],
        record.step_s,
        1,
        record.start,
        orthonormal(nuisance),
        weight,
    )


def _weighed(structure: AxisStructure, records: Sequence[FitRecord]) -> list[FitRecord]:
    """The records, each weighed by what the structure leaves of it where the search begins: a sum of squares of 1."""
    problem = PlantProblem(structure, records)
    start = np.array([p.start for p in structure.parameters]) / problem.scale
    left = np.split(problem.modelled(start) - problem.measured, problem.edges)
    rms = [float(np.sqrt(np.mean(part**2))) / record.weight for part, record in zip(left, records, strict=True)]
    whole = math.sqrt(problem.size)
    return [replace(record, weight=1.0 / (each * whole)) for each, record in zip(rms, records, strict=True)]


def _between(record: FitRecord, hold: Hold, step_s: float) -> FitRecord:
    """The record with what its drive does between the samples.

    A held drive of which only some samples are kept is a straight one that comes half a sample later.

    Args:
        record: The record.
        hold: What the drive does between the samples that were recorded.
        step_s: Time between those, in s.
    """
    if hold != "zero-order" or record.step_s == step_s:
        return replace(record, hold=hold)
    return replace(record, hold="first-order", late_s=0.5 * step_s)


def _scattered_starts(structure: AxisStructure, starts: int, seed: int) -> list[Floats]:
    """Values of `starts` - 1 more starts, epsilon and alpha scattered about those of the structure."""
    own = np.array([p.start for p in structure.parameters])
    rng = np.random.Generator(np.random.Philox(seed))
    shaken = np.array([p.name in ("epsilon", "alpha", "epsilon over its limit") for p in structure.parameters])
    return [own * np.exp(0.3 * shaken * rng.standard_normal(own.size)) for _ in range(starts - 1)]


def _play_start(
    form: Form,
    records: tuple[SiRecord, ...],
    fit_list: Sequence[FitRecord],
    linear: LinearPoles | None,
    creep_times: Sequence[float],
) -> tuple[PrandtlIshlinskii, tuple[float, ...]]:
    """Weights >= 0 of plays and creep by non-negative least squares, the linear part held."""
    operators = 1 if form.family == "linear" else _OPERATORS
    thresholds = threshold_grid(max(float(np.ptp(r.drive_v)) for r in records), operators)
    columns, targets = [], []
    for record, run in zip(records, fit_list, strict=True):
        drive = run.drive[:, 0]
        plays = behind_linear_part(kernels.play_response(drive, thresholds, np.zeros(operators)), linear, run)
        lags = kernels.lag_response(drive, record.step_s, np.array(creep_times), np.zeros(len(creep_times)))
        both = np.column_stack([plays, lags])
        columns.append(run.weight * without_nuisance(run.nuisance, both[run.first :]))
        targets.append(run.weight * run.target[:, 0])
    matrix, target = np.concatenate(columns), np.concatenate(targets)
    sign = 1.0 if float(matrix[:, 0] @ target) >= 0.0 else -1.0
    weights = sign * non_negative_weights(matrix, sign * target)
    limit = fastest_rate(records)
    model = PrandtlIshlinskii(tuple(thresholds.tolist()), tuple(weights[:operators].tolist()), 0.0, limit)
    return model, tuple(weights[operators:].tolist())


def behind_linear_part(columns: Floats, linear: LinearPoles | None, run: FitRecord) -> Floats:
    """Columns filtered by the linear part and its delay, each from rest.

    Args:
        columns: The columns, shape (samples, any).
        linear: The linear part, None to leave the columns as they are.
        run: The record that they belong to, with its step and what is between the samples.
    """
    if linear is None:
        return columns
    system = linear.system
    no_bank = Mirror(
        name="linear",
        A=system.A,
        B=system.B,
        E=np.zeros((system.order, 0)),
        F=np.zeros((0, system.order)),
        G=np.zeros((0, 1)),
        C=system.C,
        D=system.D,
        K=np.zeros((1, 0)),
        bouc_wen=(),
        plays=(),
        inverse=(),
    )
    plant = mirror.discretise(no_bank, run.step_s)
    if run.hold == "zero-order":
        plant = held(plant)
    behind = np.empty_like(columns)
    output, bank = np.empty((columns.shape[0], 1)), np.empty((columns.shape[0], 0))
    for j, column in enumerate(columns.T):
        mirror.respond(plant, mirror.at_rest(plant), column[:, None].copy(), output, bank)
        behind[:, j] = output[:, 0]
    return late(behind, (linear.delay_s + run.late_s) / run.step_s)
