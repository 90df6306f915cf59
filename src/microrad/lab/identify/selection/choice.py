"""Many models on the same recordings, judged on samples that none of them has seen."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.lab.identify.hysteresis.bouc_wen import BoucWenFit, fit_bouc_wen
from microrad.lab.identify.hysteresis.joint import FORMS, JointFit, fit_joint, static_fit, time_constants
from microrad.lab.identify.hysteresis.prandtl_ishlinskii import PrandtlIshlinskiiFit, fit_prandtl_ishlinskii
from microrad.lab.identify.hysteresis.structures import LinearPoles, poles_of
from microrad.lab.identify.linear.fit import LinearFit, fit_linear
from microrad.lab.identify.records import (
    IdentificationError,
    Prepared,
    Units,
    colour_inflation,
    percent,
    prepare,
    span,
    unheard,
)
from microrad.lab.identify.selection.predictions import Fit, Judged, Prediction, Score, predict, straight_line
from microrad.lab.identify.selection.roles import roles, whole_periods
from microrad.lab.identify.selection.warnings import (
    ResidualTest,
    drift,
    fit_warnings,
    held_out_warnings,
    range_warnings,
    rate_warnings,
    residual_test,
    residual_warnings,
    score_warnings,
    set_aside_warnings,
)
from microrad.lab.recording import Recording

STATIC = ("prandtl_ishlinskii", "bouc_wen", "bouc_wen_admissible")
"""Models of the hysteresis alone; bouc_wen is the paper's Eq. 3."""

MODELS = (*STATIC, *FORMS)
_STARTS = 12
_MIN_PART = 100
_EXPLAINED = 0.5
_HARDLY = (
    "The output hardly follows the drive: check that the channels belong together, and record a larger drive, or with "
    "less noise and drift."
)
_OTHER_MOTION = (
    "It follows the part that was fitted, so the rest moves in another way (a chirp goes on to other frequencies), or "
    "drowns in noise or drift: record loops of several periods, a chirp or multisine beside them for the dynamics, and "
    "another recording to judge by."
)


@dataclass(frozen=True)
class Source:
    """One recording: path, digest of the file, samples fitted and held out, and what it served for.

    `role` is "loops", "broadband" (for the linear part) or "validation" (for the scores alone).
    """

    path: str
    sha256: str
    fitted: int
    held_out: int
    role: str = "loops"


@dataclass(frozen=True)
class Refused:
    """A model that the recordings cannot support, and why."""

    model: str
    reason: str


@dataclass(frozen=True, eq=False)
class Identification:
    """The fits, their scores, the choice with its reason, and the limits within which it holds.

    `fits` see the first part of each recording alone; `scores` has the same order, as has `predictions` (models, then
    recordings in the order of `recordings`: loops, then validation), and `straight_line` is the best line through the
    same samples. `refused` names the models that were not fitted, and `unsupported` says, where it is not empty, why
    not even the chosen one should be used. `linear` is the linear part of the broadband recordings (volts and radians),
    where there are any. `span_rad` is the peak-to-peak output that the percentages refer to, and `travel_rad` the range
    of the chosen model's output over the fitted drive from `drive_min_v` to `drive_max_v`. `residual` tests the chosen
    model's residual on the held-out samples.
    """

    fits: tuple[Fit, ...]
    scores: tuple[Score, ...]
    straight_line: Score
    chosen: str
    reason: str
    warnings: tuple[str, ...]
    refused: tuple[Refused, ...]
    unsupported: str
    sources: tuple[Source, ...]
    recordings: tuple[Recording, ...]
    predictions: tuple[tuple[Prediction, ...], ...]
    linear: LinearFit | None
    residual: ResidualTest
    units: Units
    span_rad: float
    travel_rad: float
    drive_min_v: float
    drive_max_v: float
    rate_limit_v_per_s: float
    drift_rad: float

    @property
    def bias_v(self) -> float:
        """Middle of the fitted drive range."""
        return (self.drive_min_v + self.drive_max_v) / 2

    def fit(self, model: str | None = None) -> Fit:
        """The fit of a model, of the chosen one by default."""
        return self.fits[self._index(model)]

    def score(self, model: str | None = None) -> Score:
        """The score of a model, of the chosen one by default."""
        return self.scores[self._index(model)]

    def _index(self, model: str | None) -> int:
        names = [score.model for score in self.scores]
        if (model or self.chosen) not in names:
            raise IdentificationError(f"no model '{model}' was fitted; there are {', '.join(names)}.")
        return names.index(model or self.chosen)


def identify(  # noqa: PLR0913  all but the first are named options in practice
    recordings: Sequence[Recording],
    hold_out: float | None = None,
    seed: int = 0,
    models: Sequence[str] = STATIC[:2],
    on_progress: Progress | None = None,
    *,
    validation: Sequence[Recording] = (),
    admissible: bool = False,
    output_unit: str = "mrad",
    lever_arm_m: float | None = None,
    input_unit: str = "V",
    on_fit: Callable[[Judged], None] = lambda judged: None,
) -> Identification:
    """Fit the models on the first part of each recording and choose the one that is better on the rest.

    Broadband recordings (chirps, multisines; see `roles`) give the linear part, which the joint models have in cascade;
    they are not split. The lowest residual rms over all held-out samples wins; where the difference may be chance an
    admissible model goes before one that is not, and fewer parameters before more. A winner with a linear part is
    fitted once more with everything free.

    Args:
        recordings: One drive and one output each.
        hold_out: Share at the end of each loop that no fit sees; states are carried through into it. By default 0.5,
            and 0 where there are recordings for validation.
        seed: Seed of the scattered starts of the Bouc-Wen fits.
        models: The models to fit, out of `MODELS`.
        on_progress: Called with the fits done, their number and what is done.
        validation: Recordings that no fit sees at all.
        admissible: Whether each Bouc-Wen model is kept from moving against its gain behind a reversal.
        output_unit: Unit of the outputs: rad, mrad, urad, or m, mm, um with a lever arm.
        lever_arm_m: Distance from the axis of rotation to the point measured, where that is a length.
        input_unit: Unit of the drives: V or mV.
        on_fit: Given each model as soon as it is fitted, and the winner again when everything was free.

    Raises:
        IdentificationError: For what cannot be fitted as asked, and where not even the best model follows the output.
    """
    units, on_progress = Units(input_unit, output_unit, lever_arm_m), on_progress or unheard
    if not models or not set(models) <= set(MODELS) or len(set(models)) != len(models):
        raise IdentificationError(f"models {tuple(models)} cannot be used; name each once, out of {', '.join(MODELS)}.")
    if admissible:
        models = tuple(dict.fromkeys("bouc_wen_admissible" if m == "bouc_wen" else m for m in models))
    if not recordings:
        raise IdentificationError("no recording was given; name at least one.")
    _check_distinct(recordings, validation)
    response, broadband, loops = roles(recordings)
    splits = _splits(loops, hold_out, bool(validation))
    heads = [replace(r, drive=r.drive[:k], output=r.output[:k]) for r, k in zip(loops, splits, strict=True)]
    prepared = prepare(heads, units)
    seen = {id(r): head for r, head in zip(loops, heads, strict=True)}
    response = [whole_periods(seen[id(r)]) if id(r) in seen else r for r in response]
    linear = _linear(response, units, models, on_progress)
    names, refused = _supported(models, prepared, linear)
    ladder = _Ladder(
        loops=loops,
        splits=splits,
        heads=heads,
        validation=tuple(validation),
        broadband=response[:1],
        linear=linear,
        units=units,
        span_rad=span(prepared),
        seed=seed,
        admissible=admissible,
    )
    predictions: list[tuple[Prediction, ...]] = []

    def look(fit: Fit) -> None:
        predictions.append(ladder.predictions(fit))
        on_fit(ladder.judged(fit, predictions[-1]))

    fits, failed = ladder.fits(names, on_progress, look)
    best = _best(fits, [[r for p in each if (r := p.residual_rad[p.split :]).size] for each in predictions])
    winner = fits[best]
    fits[best], predictions[best] = _polished(ladder, winner, predictions[best], on_progress)
    if fits[best] is not winner:
        on_fit(ladder.judged(fits[best], predictions[best]))
    sources = _sources(ladder, broadband, response if linear is not None else ())
    return _identification(ladder, prepared, fits, predictions, best, [*refused, *failed], sources)


# ---------------------------------------------------------------------------------------------------------- fitting
def _splits(recordings: Sequence[Recording], hold_out: float | None, validated: bool) -> list[int]:
    share = (0.0 if validated else 0.5) if hold_out is None else hold_out
    if not (0 < share < 1 or (share == 0 and validated)):
        raise IdentificationError(
            f"--hold-out (hold_out) is {share}; give the share of each recording kept for the check, between 0 "
            "and 1, e.g. 0.5, or 0 with recordings for validation."
        )
    splits = [round(r.samples * (1 - share)) for r in recordings]
    for recording, split in zip(recordings, splits, strict=True):
        if split < _MIN_PART or (share > 0 and recording.samples - split < _MIN_PART):
            raise IdentificationError(
                f"{recording.path}: {split} samples to fit and {recording.samples - split} to check; each part needs "
                f"at least {_MIN_PART}; record longer or choose hold_out nearer to 0.5."
            )
    return splits


def _check_distinct(recordings: Sequence[Recording], validation: Sequence[Recording]) -> None:
    """Raises `IdentificationError` for a recording that is given twice, or to fit and for validation."""
    seen: dict[str, str] = {}
    for recording in (*recordings, *validation):
        key = f"{recording.sha256} {recording.rate_hz}"
        if recording.sha256 and key in seen:
            raise IdentificationError(
                f"{recording.path}: the same data as {seen[key]}; give each recording once, and for validation one "
                "that is not fitted."
            )
        seen[key] = recording.path


def _linear(
    response: Sequence[Recording], units: Units, models: Sequence[str], on_progress: Progress
) -> LinearFit | None:
    """The linear part of the broadband recordings, in volts and radians, where a model asks for it."""
    if not response or not set(models) & set(FORMS):
        return None
    scaled = [  # about the first drive value, where the mirror rests
        replace(r, drive=(r.drive - r.drive[:1]) * units.volts, output=r.output * units.radians) for r in response
    ]
    return fit_linear(scaled, strictly_proper=True, on_progress=on_progress)


def _supported(
    models: Sequence[str], records: Sequence[Prepared], linear: LinearFit | None
) -> tuple[list[str], list[Refused]]:
    """Models that the recordings can support, and the others with the number that speaks against each."""
    names, refused = [], []
    longest = max(r.drive_v.size * r.step_s for r in records)
    for model in models:
        form = FORMS.get(model)
        if form is not None and form.creep and (longest < 1.0 or len(time_constants(records)) < 2):
            why = (
                f"the longest recording lasts {longest:.3g} s, and creep shows over seconds; record a staircase of 10 s"
            )
            refused.append(Refused(model, why))
        elif form is not None and form.needs_linear and linear is None:
            why = "no recording is broadband, so there is no linear part; record a small chirp or multisine as well"
            refused.append(Refused(model, why))
        else:
            names.append(model)
    if not names:
        raise IdentificationError(f"the recordings do not support {refused[0].model}: {refused[0].reason}.")
    return names, refused


@dataclass(frozen=True, eq=False)
class _Ladder:
    """The recordings to fit and to judge by, and how: `heads` are the fitted parts of `loops`, up to `splits`."""

    loops: Sequence[Recording]
    splits: Sequence[int]
    heads: Sequence[Recording]
    validation: tuple[Recording, ...]
    broadband: Sequence[Recording]
    linear: LinearFit | None
    units: Units
    span_rad: float
    seed: int
    admissible: bool

    def fits(
        self, models: Sequence[str], on_progress: Progress, on_fit: Callable[[Fit], None]
    ) -> tuple[list[Fit], list[Refused]]:
        """One fit a model; a joint fit that fails is refused with its reason, a static one raises."""
        poles = None
        if self.linear is not None:
            poles = poles_of(self.linear.system, self.linear.excited_hz, self.linear.rate_hz)
        efforts = [1 if model not in ("bouc_wen", "bouc_wen_admissible") else _STARTS for model in models]
        fits: list[Fit] = []
        failed = []
        for i, model in enumerate(models):

            def progress(done: int, _total: int, what: str, before: int = sum(efforts[:i])) -> None:
                on_progress(before + done, sum(efforts), what)

            try:
                fits.append(self.static(model, progress) if model in STATIC else self.joint(model, poles, progress))
            except IdentificationError as error:
                if model in STATIC:
                    raise
                failed.append(Refused(model, str(error)))
            else:
                on_fit(fits[-1])
            if model not in STATIC:
                progress(1, 1, model)
        if not fits:
            raise IdentificationError(failed[0].reason)
        return fits, failed

    def static(self, model: str, progress: Progress) -> Fit:
        if model == "prandtl_ishlinskii":
            plays = fit_prandtl_ishlinskii(self.heads, units=self.units)
            progress(1, 1, "play operators")
            return plays
        return fit_bouc_wen(
            self.heads,
            starts=_STARTS,
            seed=self.seed,
            admissible=model == "bouc_wen_admissible",
            on_progress=progress,
            units=self.units,
        )

    def joint(
        self, model: str, poles: LinearPoles | None, progress: Progress, *, free_linear: bool = False
    ) -> JointFit:
        progress(0, 1, "linear part, hysteresis and creep together" if free_linear else f"fitting {model}")
        return fit_joint(
            self.heads,
            model,
            self.units,
            linear=poles,
            free_linear=free_linear,
            admissible=self.admissible,
            broadband=self.broadband if free_linear else (),
            static=self._static_start if FORMS[model].family == "bouc_wen" else None,
            seed=self.seed,
        )

    @cached_property
    def _static_start(self) -> BoucWenFit:
        return static_fit(self.heads, self.units, self.seed)

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """All that is judged by."""
        return (*self.loops, *self.validation)

    @property
    def all_splits(self) -> list[int]:
        """First sample of each of them that no fit has seen."""
        return [*self.splits, *(0 for _ in self.validation)]

    def predictions(self, fit: Fit) -> tuple[Prediction, ...]:
        pairs = zip(self.recordings, self.all_splits, strict=True)
        return tuple(predict(fit, recording, split) for recording, split in pairs)

    def judged(self, fit: Fit, predictions: tuple[Prediction, ...]) -> Judged:
        name = fit_name(fit)
        return Judged(name, self.score(name, predictions), predictions, self.recordings)

    def score(self, model: str, predictions: Sequence[Prediction]) -> Score:
        fitted = [p.residual_rad[p.start : p.split] for p in predictions[: len(self.loops)]]
        unseen = [p.residual_rad[p.split :] for p in predictions]
        return Score(
            model,
            *percent(np.concatenate(fitted), self.span_rad),
            *percent(np.concatenate(unseen), self.span_rad),
        )


def _polished(
    ladder: _Ladder, winner: Fit, predictions: tuple[Prediction, ...], on_progress: Progress
) -> tuple[Fit, tuple[Prediction, ...]]:
    """The winner with all its numbers free, its linear part among them, where that is no worse on the held-out part."""
    if not isinstance(winner, JointFit) or winner.linear is None:
        return winner, predictions
    free = ladder.joint(winner.name, winner.linear, on_progress, free_linear=True)
    seen = ladder.predictions(free)
    return (free, seen) if _held_out(seen) <= _held_out(predictions) else (winner, predictions)


def _held_out(predictions: Sequence[Prediction]) -> float:
    return float(sum(np.sum(p.residual_rad[p.split :] ** 2) for p in predictions))


# ---------------------------------------------------------------------------------------------------------- judging
def _identification(
    ladder: _Ladder,
    prepared: tuple[Prepared, ...],
    fits: Sequence[Fit],
    predictions: Sequence[tuple[Prediction, ...]],
    best: int,
    refused: Sequence[Refused],
    sources: tuple[Source, ...],
) -> Identification:
    scores = tuple(ladder.score(fit_name(f), p) for f, p in zip(fits, predictions, strict=True))
    straight = straight_line(prepared, ladder.recordings, ladder.all_splits, ladder.units)
    line = ladder.score("straight line", straight)
    fit, chosen, linear = fits[best], predictions[best], ladder.linear
    of_loops = chosen[: len(ladder.loops)]
    fitted = [(p.measured_rad[p.start : p.split], p.residual_rad[p.start : p.split]) for p in of_loops]
    if text := _unexplained(scores[best], fitted, "on the very samples it was fitted to"):
        raise IdentificationError(f"{text} {_HARDLY}")
    low, high = min(float(r.drive_v.min()) for r in prepared), max(float(r.drive_v.max()) for r in prepared)
    drift_rad, drift_warnings = drift(chosen, ladder.recordings, ladder.span_rad)
    # Of the longest held-out part: correlations across the joint of two records would mean nothing.
    pairs = zip(ladder.recordings, chosen, strict=True)
    recording, longest = max(pairs, key=lambda pair: pair[1].residual_rad.size - pair[1].split)
    test = residual_test(longest.residual_rad[longest.split :], recording.drive[longest.split :, 0])
    warnings = [
        *range_warnings((low, high), fit.rate_limit_v_per_s),
        *rate_warnings(prepared, fit),
        *set_aside_warnings(ladder.loops, of_loops),
        *held_out_warnings(ladder.recordings, ladder.units, (low, high), chosen),
        *score_warnings(scores[best], line),
        *fit_warnings(fit),
        *drift_warnings,
        *residual_warnings(test),
        *(f"Linear part (in rad/V): {text}" for text in (linear.warnings if linear is not None else ())),
    ]
    return Identification(
        fits=tuple(fits),
        scores=scores,
        straight_line=line,
        chosen=fit_name(fit),
        reason=_reason(scores, line, best),
        warnings=tuple(warnings),
        refused=tuple(refused),
        unsupported=_unsupported(scores[best], line, chosen),
        sources=sources,
        recordings=ladder.recordings,
        predictions=tuple(predictions),
        linear=linear,
        residual=test,
        units=ladder.units,
        span_rad=ladder.span_rad,
        travel_rad=max(float(np.ptp(p.model_rad[p.start : p.split])) for p in of_loops),
        drive_min_v=low,
        drive_max_v=high,
        rate_limit_v_per_s=fit.rate_limit_v_per_s,
        drift_rad=drift_rad,
    )


def fit_name(fit: Fit) -> str:
    """The name of a fit's model, as in `MODELS`."""
    return "bouc_wen_admissible" if getattr(fit, "constrained", False) else fit.name


def _sources(ladder: _Ladder, broadband: Sequence[Recording], response: Sequence[Recording]) -> tuple[Source, ...]:
    """What each recording served for; a broadband one counts where the linear part was fitted to it."""
    loops = [Source(r.path, r.sha256, k, r.samples - k) for r, k in zip(ladder.loops, ladder.splits, strict=True)]
    both, used = {id(r) for r in ladder.loops}, {id(r) for r in response}
    others = [r for r in broadband if id(r) not in both]
    wide = [Source(r.path, r.sha256, r.samples * (id(r) in used), 0, "broadband") for r in others]
    return (*loops, *wide, *(Source(r.path, r.sha256, 0, r.samples, "validation") for r in ladder.validation))


def _unsupported(score: Score, line: Score, predictions: Sequence[Prediction]) -> str:
    """Why the chosen model should not be used at all, judged by the held-out samples; nothing where it may be."""
    if score.held_out_rms_percent <= 0.9 * line.held_out_rms_percent:
        return ""
    unseen = [(p.measured_rad[p.split :], p.residual_rad[p.split :]) for p in predictions]
    text = _unexplained(score, unseen, "on the held-out samples, where a straight line does as well")
    return f"{text} {_OTHER_MOTION}" if text else ""


def _unexplained(score: Score, parts: Sequence[tuple[Floats, Floats]], where: str) -> str:
    filled = [(measured, residual) for measured, residual in parts if measured.size]
    spread = math.sqrt(float(np.mean(np.concatenate([m - m.mean() for m, _ in filled]) ** 2)))
    left = math.sqrt(float(np.mean(np.concatenate([r for _, r in filled]) ** 2)))
    if left <= _EXPLAINED * spread:
        return ""
    return (
        f"the recordings do not support a model: the chosen one, {score.model}, leaves {left:.3g} rad rms of "
        f"{spread:.3g} rad {where} ({100 * left / spread:.0f} %, at most {100 * _EXPLAINED:.0f} % is a model)."
    )


def _best(fits: Sequence[Fit], residuals: Sequence[Sequence[Floats]]) -> int:
    """Lowest residual on the held-out samples.

    Where the difference may be chance an admissible model goes first, then the one with fewer parameters.
    """
    losses = [[residual**2 for residual in each] for each in residuals]
    sums = [float(sum(np.sum(loss) for loss in each)) for each in losses]
    lowest = int(np.argmin(sums))
    ties = [i for i, each in enumerate(losses) if _may_be_chance(each, losses[lowest])]
    return min(ties, key=lambda i: (not _admissible(fits[i]), _parameters(fits[i]), sums[i]))


def _may_be_chance(losses: Sequence[Floats], best: Sequence[Floats]) -> bool:
    """Whether the mean difference of squared residuals is below two of its standard errors, noise colour counted.

    F. X. Diebold and R. S. Mariano, Comparing predictive accuracy, J. Business & Economic Statistics 13 (1995) 253.
    """
    difference = np.concatenate([a - b for a, b in zip(losses, best, strict=True)])
    if not difference.any():
        return True
    colour = colour_inflation([a - b for a, b in zip(losses, best, strict=True)])
    return float(difference.mean()) <= 2 * math.sqrt(colour * float(difference.var()) / difference.size)


def _admissible(fit: Fit) -> bool:
    """Play operators with weights >= 0 never turn against the drive."""
    return isinstance(fit, PrandtlIshlinskiiFit) or fit.admissible


def _parameters(fit: Fit) -> int:
    if isinstance(fit, JointFit):
        return len(fit.fit.structure.parameters)
    return int(np.sum(fit.weights_rad_per_v > 0)) if isinstance(fit, PrandtlIshlinskiiFit) else 6


# ------------------------------------------------------------------------------------------------------------- words
def _reason(scores: Sequence[Score], line: Score, best: int) -> str:
    others = [f"{s.held_out_rms_percent:.3g} % by {s.model}" for i, s in enumerate(scores) if i != best]
    rest = ", ".join([*others, f"{line.held_out_rms_percent:.3g} % by a straight line"])
    reason = (
        f"{scores[best].model} leaves {scores[best].held_out_rms_percent:.3g} % of the peak-to-peak output (rms) on "
        f"the held-out samples, against {rest}."
    )
    lower = [s.model for s in scores if s.held_out_rms_percent < scores[best].held_out_rms_percent]
    if lower:
        reason += (
            f" The difference to {' and '.join(lower)} is below two standard errors; among such models those that "
            "never move the wrong way after a reversal go first, then those with fewer parameters."
        )
    return reason
