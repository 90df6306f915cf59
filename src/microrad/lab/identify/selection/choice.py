"""Many models on the same recordings, judged on samples that none of them has seen."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.progress import Progress
from microrad.lab.identify.hysteresis.joint import JointFit
from microrad.lab.identify.linear.fit import LinearFit
from microrad.lab.identify.linear.modal import HOLD, Hold
from microrad.lab.identify.records import IdentificationError, SiRecord, Units, no_progress, si_records, span
from microrad.lab.identify.selection.candidates import (
    MODELS,
    STATIC,
    Candidates,
    Refused,
    fit_linear_part,
    has_linear,
    refit,
    supported_models,
    within_reach,
)
from microrad.lab.identify.selection.predictions import (
    Evidence,
    Fit,
    Prediction,
    Score,
    ScoredModel,
    evidence,
    straight_line,
)
from microrad.lab.identify.selection.roles import for_validation, roles, single_period, whole_periods
from microrad.lab.identify.selection.splits import split_points, split_warnings
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
    use_warnings,
)
from microrad.lab.identify.statistics import may_be_chance
from microrad.lab.identify.travel import check_travel
from microrad.lab.recording import Recording
from microrad.mirror.hysteresis import BoucWen, PrandtlIshlinskii
from microrad.mirror.model import Mirror, assemble

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
class RecordingUse:
    """One recording: path, digest of the file, samples fitted and held out, and what it served for.

    `role` is "loops", "broadband" (for the linear part) or "validation" (for the scores alone).
    """

    path: str
    sha256: str
    fitted: int
    held_out: int
    role: str = "loops"


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
    sources: tuple[RecordingUse, ...]
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

    @property
    def model(self) -> BoucWen | PrandtlIshlinskii:
        """The hysteresis of the chosen model, from V to rad: its response, loop and inverse."""
        return self.fit().model

    @property
    def mirror(self) -> Mirror:
        """The mirror of the chosen model, about its bias; without a linear part the hysteresis alone."""
        fit = self.fit()
        return fit.mirror if isinstance(fit, JointFit) else assemble(fit.name, "static", None, fit.model)

    def fit(self, model: str | None = None) -> Fit:
        """The fit of a model, of the chosen one by default."""
        return self.fits[self._index(model)]

    def score(self, model: str | None = None) -> Score:
        """The score of a model, of the chosen one by default."""
        return self.scores[self._index(model)]

    def _index(self, model: str | None) -> int:
        names = [score.model for score in self.scores]
        if (model or self.chosen) not in names:
            why = next((f": {each.reason.rstrip('.')}" for each in self.refused if each.model == model), "")
            raise IdentificationError(f"no model '{model}' was fitted{why}; there are {', '.join(names)}.")
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
    on_fit: Callable[[ScoredModel], None] = lambda judged: None,
    hold: Hold = HOLD,
    side_by_side: bool = False,
) -> Identification:
    """Fit the models on the first part of each recording and choose the one that is better on the rest.

    Broadband recordings (chirps, multisines; see `roles`) give the linear part, which the joint models have in cascade;
    they are not split. The lowest residual rms over all held-out samples wins; where the difference may be chance an
    admissible model goes before one that is not, and fewer parameters before more. Before that the best few with a
    linear part are fitted once more with everything free.

    Args:
        recordings: One drive and one output each.
        hold_out: Share at the end of each loop that no fit sees; states are carried through into it. By default 0.5, or
            less where the drive has not swept its range before, and 0 where there are recordings for validation.
        seed: Seed of the scattered starts of the Bouc-Wen fits.
        models: The models to fit, out of `MODELS`.
        on_progress: Called with the fits done, their number and what is done.
        validation: Recordings that no fit sees at all.
        admissible: Whether each Bouc-Wen model is kept from moving against its gain behind a reversal.
        output_unit: Unit of the outputs: rad, mrad, urad, or m, mm, um with a lever arm.
        lever_arm_m: Distance from the axis of rotation to the point measured, where that is a length.
        input_unit: Unit of the drives: V or mV.
        on_fit: Given each model as soon as it is fitted, and the winner again when everything was free.
        hold: What a drive does between samples: "zero-order" where the record is what a converter was told,
            "first-order" where the drive itself was measured.
        side_by_side: Whether several models are fitted at once, in another process too; then `on_fit` is given them
            when all are fitted.

    Raises:
        IdentificationError: For what cannot be fitted as asked, and where not even the best model follows the output.

    Example:
        ```python
        import microrad

        loop = microrad.read_recording("loop.csv", inputs="drive", outputs="angle")
        found = microrad.identify_mirror([loop], output_unit="urad")
        print(found.chosen, found.reason, *found.warnings)
        print(found.model.inverse([0.0, 50e-6], step_s=1e-3), found.mirror.axes)
        ```
    """
    units, on_progress = Units(input_unit, output_unit, lever_arm_m), on_progress or no_progress
    if not models or not set(models) <= set(MODELS) or len(set(models)) != len(models):
        raise IdentificationError(f"models {tuple(models)} cannot be used; name each once, out of {', '.join(MODELS)}.")
    if admissible:
        models = tuple(dict.fromkeys("bouc_wen_admissible" if m == "bouc_wen" else m for m in models))
    if not recordings:
        raise IdentificationError("no recording was given; name at least one.")
    recordings, validation = for_validation(recordings, validation)
    _check_distinct(recordings, validation)
    check_travel([*recordings, *validation], units.output, units.lever_arm_m)
    served = roles(recordings)
    response, broadband, loops = served
    splits = split_points(loops, hold_out, validated=bool(validation))
    heads = [r.first(k) for r, k in zip(loops, splits, strict=True)]
    prepared = si_records(heads, units)
    seen = {id(r): head for r, head in zip(loops, heads, strict=True)}
    alone = single_period(response)
    response = [whole_periods(seen.get(id(r), r)) if alone or id(r) in seen else r for r in response]
    linear = fit_linear_part(response, units, models, hold, on_progress)
    names, refused = supported_models(models, prepared, linear is not None)
    candidates = Candidates(
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
        hold=hold,
    )
    predictions: list[tuple[Prediction, ...]] = []

    def judge(fit: Fit) -> None:
        predictions.append(candidates.predict(fit))
        on_fit(candidates.scored(fit, predictions[-1]))

    fits, failed = candidates.fit_all(names, on_progress, judge, side_by_side=side_by_side and len(names) > 1)
    best = _polished(candidates, fits, predictions, on_progress, on_fit)
    sources = _sources(candidates, broadband, served.response if linear is not None else ())
    notes = use_warnings(served, linear=linear is not None)
    return _identification(candidates, prepared, fits, predictions, best, [*refused, *failed], sources, notes)


def _polished(
    candidates: Candidates,
    fits: list[Fit],
    predictions: list[tuple[Prediction, ...]],
    on_progress: Progress,
    on_fit: Callable[[ScoredModel], None],
) -> int:
    """Number of the best fit, the best few and it fitted once more with everything free, in place."""
    done: set[int] = set()
    turns = within_reach(fits, predictions)
    while turns:
        for i in turns:
            before = fits[i]
            fits[i], predictions[i] = refit(candidates, before, predictions[i], on_progress)
            if fits[i] is not before:
                on_fit(candidates.scored(fits[i], predictions[i]))
        done |= set(turns)
        best = _best(fits, predictions)
        turns = [best] if has_linear(fits[best]) and best not in done else []
    return _best(fits, predictions)


def _best(fits: Sequence[Fit], predictions: Sequence[Sequence[Prediction]]) -> int:
    return choose_best(fits, [[r for p in each if (r := p.residual_rad[p.split :]).size] for each in predictions])


def _check_distinct(recordings: Sequence[Recording], validation: Sequence[Recording]) -> None:
    """Raises IdentificationError if a recording is given twice, or both to fit and for validation."""
    seen: dict[str, str] = {}
    for recording in (*recordings, *validation):
        key = f"{recording.sha256} {recording.rate_hz}"
        if recording.sha256 and key in seen:
            raise IdentificationError(
                f"{recording.path}: the same data as {seen[key]}; give each recording once, and for validation one "
                "that is not fitted."
            )
        seen[key] = recording.path


def _identification(
    candidates: Candidates,
    prepared: tuple[SiRecord, ...],
    fits: Sequence[Fit],
    predictions: Sequence[tuple[Prediction, ...]],
    best: int,
    refused: Sequence[Refused],
    sources: tuple[RecordingUse, ...],
    notes: Sequence[str],
) -> Identification:
    scores = tuple(candidates.score(f.name, p) for f, p in zip(fits, predictions, strict=True))
    straight = straight_line(prepared, candidates.recordings, candidates.all_splits, candidates.units)
    line = candidates.score("straight line", straight)
    fit, chosen, linear = fits[best], predictions[best], candidates.linear
    of_loops = chosen[: len(candidates.loops)]
    fitted = [(p.measured_rad[p.start : p.split], p.residual_rad[p.start : p.split]) for p in of_loops]
    if text := _unexplained(scores[best], fitted, "on the very samples it was fitted to"):
        raise IdentificationError(f"{text} {_HARDLY}")
    low, high = min(float(r.drive_v.min()) for r in prepared), max(float(r.drive_v.max()) for r in prepared)
    drift_rad, drift_warnings = drift(chosen, candidates.recordings, candidates.span_rad)
    # Of the longest held-out part: correlations across the joint of two records would mean nothing.
    pairs = zip(candidates.recordings, chosen, strict=True)
    recording, longest = max(pairs, key=lambda pair: pair[1].residual_rad.size - pair[1].split)
    test = residual_test(longest.residual_rad[longest.split :], recording.drive[longest.split :, 0])
    warnings = [
        *range_warnings((low, high), fit.rate_limit_v_per_s),
        *score_warnings(scores[best], line),
        *fit_warnings(fit),
        *drift_warnings,
        *rate_warnings(prepared, fit),
        *notes,
        *split_warnings(candidates.loops, candidates.splits, candidates.units.volts),
        *set_aside_warnings(candidates.recordings, chosen),
        *held_out_warnings(candidates.recordings, candidates.units, (low, high), chosen),
        *residual_warnings(test),
        *(f"Linear part (in rad/V): {text}" for text in (linear.warnings if linear is not None else ())),
    ]
    return Identification(
        fits=tuple(fits),
        scores=scores,
        straight_line=line,
        chosen=fit.name,
        reason=f"{_reason(scores, line, best)} {_rests_on(evidence(candidates.recordings, chosen))}",
        warnings=tuple(warnings),
        refused=tuple(refused),
        unsupported=_unsupported(scores[best], line, chosen),
        sources=sources,
        recordings=candidates.recordings,
        predictions=tuple(predictions),
        linear=linear,
        residual=test,
        units=candidates.units,
        span_rad=candidates.span_rad,
        travel_rad=max(float(np.ptp(p.model_rad[p.start : p.split])) for p in of_loops),
        drive_min_v=low,
        drive_max_v=high,
        rate_limit_v_per_s=fit.rate_limit_v_per_s,
        drift_rad=drift_rad,
    )


def _rests_on(found: Evidence) -> str:
    return (
        f"It rests on {found.text}; the worst of all recordings is {found.worst}, with "
        f"{1e6 * found.worst_rms_rad:.3g} µrad rms and {1e6 * found.worst_peak_rad:.3g} µrad at most."
    )


def _sources(
    candidates: Candidates, broadband: Sequence[Recording], response: Sequence[Recording]
) -> tuple[RecordingUse, ...]:
    """What each recording served for; a broadband one counts where the linear part was fitted to it."""
    pairs = zip(candidates.loops, candidates.splits, strict=True)
    loops = [RecordingUse(r.path, r.sha256, k, r.samples - k) for r, k in pairs]
    both, used = {id(r) for r in candidates.loops}, {id(r) for r in response}
    others = [r for r in broadband if id(r) not in both]
    wide = [RecordingUse(r.path, r.sha256, r.samples * (id(r) in used), 0, "broadband") for r in others]
    return (*loops, *wide, *(RecordingUse(r.path, r.sha256, 0, r.samples, "validation") for r in candidates.validation))


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


def choose_best(fits: Sequence[Fit], residuals: Sequence[Sequence[Floats]]) -> int:
    """Number of the fit with the lowest residual on the held-out samples.

    Where the difference may be chance an admissible model goes first, then the one with fewer parameters.

    Args:
        fits: The fits.
        residuals: Of each fit, the residual (rad) on the held-out samples of each recording.
    """
    losses = [[residual**2 for residual in each] for each in residuals]
    sums = [float(sum(np.sum(loss) for loss in each)) for each in losses]
    lowest = int(np.argmin(sums))
    ties = [i for i, each in enumerate(losses) if may_be_chance(each, losses[lowest])]
    return min(ties, key=lambda i: (not fits[i].admissible, fits[i].parameter_count, sums[i]))


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
