"""Two models on the same recordings, judged on samples that neither has seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from microrad.identify.bouc_wen import BoucWenFit, fit_bouc_wen
from microrad.identify.prandtl_ishlinskii import PrandtlIshlinskiiFit, fit_prandtl_ishlinskii
from microrad.identify.records import (
    FloatArray,
    IdentificationError,
    Prepared,
    Progress,
    Units,
    colour_inflation,
    loop_rates,
    noisiness,
    one_rate_only,
    percent,
    prepare,
    span,
    transient,
)
from microrad.recording import Recording

Fit = BoucWenFit | PrandtlIshlinskiiFit

MODELS = ("prandtl_ishlinskii", "bouc_wen", "bouc_wen_admissible")
_STARTS = 12
_MIN_PART = 100
_DRIFT_PERCENT = 0.2
_NOISY_RATE = 0.2


@dataclass(frozen=True, eq=False)
class Prediction:
    """Model against measurement over one record, offset included (rad); samples before `start` are the transient.

    The offset is the mean difference over the samples from `start` to `split`; behind `split` the record is unseen.
    """

    model_rad: FloatArray
    measured_rad: FloatArray
    start: int
    split: int
    clamped: int

    @property
    def residual_rad(self) -> FloatArray:
        """Measured less modelled."""
        return self.measured_rad - self.model_rad


@dataclass(frozen=True)
class Score:
    """Residuals of one model in per cent of the peak-to-peak output, on the fitted and on the held-out samples."""

    model: str
    fit_rms_percent: float
    fit_peak_percent: float
    held_out_rms_percent: float
    held_out_peak_percent: float


@dataclass(frozen=True)
class Source:
    """One recording: path, digest of the file, samples fitted and samples held out."""

    path: str
    sha256: str
    fitted: int
    held_out: int


@dataclass(frozen=True, eq=False)
class Identification:
    """The fits, their scores, the choice with its reason, and the limits within which it holds.

    `fits` are made on the first part of each recording alone; `scores` has the same order, and `straight_line` is the
    best line through the same samples. `span_rad` is the peak-to-peak output that the percentages refer to, and
    `travel_rad` the range of the chosen model's output over the fitted drive from `drive_min_v` to `drive_max_v`.
    """

    fits: tuple[Fit, ...]
    scores: tuple[Score, ...]
    straight_line: Score
    chosen: str
    reason: str
    warnings: tuple[str, ...]
    sources: tuple[Source, ...]
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


def predict(fit: Fit, recording: Recording, split: int | None = None) -> Prediction:
    """Run a fitted model over a recording with the units of the fit, states carried through from the first sample.

    A sensor's zero is not part of the model: the offset is taken from the samples before `split` (default: all), or is
    zero where the fit was made without one. Raises `IdentificationError` for a split outside the recording.
    """
    drive, measured = recording.drive * fit.units.volts, recording.output * fit.units.radians
    split = recording.samples if split is None else split
    if not 2 <= split <= recording.samples:
        raise IdentificationError(
            f"split {split} does not lie within the {recording.samples} samples of {recording.path}; give a number "
            "from 2 to that."
        )
    start = transient(drive[:split])
    model, clamped = fit.response(drive, recording.step_s)
    offset = float(np.mean(measured[start:split] - model[start:split])) if fit.free_offset else 0.0
    return Prediction(model + offset, measured, start, split, clamped)


def identify(
    recordings: Sequence[Recording],
    hold_out: float = 0.5,
    seed: int = 0,
    models: Sequence[str] = MODELS[:2],
    on_progress: Progress | None = None,
    *,
    output_unit: str = "mrad",
    lever_arm_m: float | None = None,
    input_unit: str = "V",
) -> Identification:
    """Fit the models on the first part of each recording and choose the one that is better on the rest.

    `hold_out` is the share of each recording, at its end, that no fit sees; states are carried through into it.
    "bouc_wen_admissible" is the Bouc-Wen fit whose local slope never turns against its gain. The lowest residual rms
    over all held-out samples wins; where the difference may be chance an admissible model goes before one that is not.
    `on_progress(done, total, what)` counts the starts of all fits. Raises `IdentificationError`.
    """
    units = Units(input_unit, output_unit, lever_arm_m)
    splits = _splits(recordings, hold_out)
    _check_models(models)
    pairs = list(zip(recordings, splits, strict=True))
    heads = [replace(r, drive=r.drive[:k], output=r.output[:k]) for r, k in pairs]
    prepared = prepare(heads, units)
    span_rad = span(prepared)
    fits = _fit_all(heads, models, seed, on_progress, units)
    predictions = [[predict(fit, recording, split) for recording, split in pairs] for fit in fits]
    scores = tuple(_score(m, p, span_rad) for m, p in zip(models, predictions, strict=True))
    line = _score("straight line", _straight_line(prepared, recordings, splits, units), span_rad)
    best = _best(fits, [[p.residual_rad[p.split :] for p in each] for each in predictions])
    fit, chosen = fits[best], predictions[best]
    low, high = min(float(r.drive_v.min()) for r in prepared), max(float(r.drive_v.max()) for r in prepared)
    drift_rad, drift_warnings = _drift(chosen, recordings, span_rad)
    warnings = [
        *_range_warnings((low, high), fit.rate_limit_v_per_s),
        *_rate_warnings(prepared, fit),
        *_held_out_warnings(recordings, units, (low, high), chosen),
        *_score_warnings(scores[best], line),
        *fit_warnings(fit),
        *drift_warnings,
    ]
    return Identification(
        fits=fits,
        scores=scores,
        straight_line=line,
        chosen=models[best],
        reason=_reason(scores, line, best),
        warnings=tuple(warnings),
        sources=tuple(Source(r.path, r.sha256, k, r.samples - k) for r, k in pairs),
        units=units,
        span_rad=span_rad,
        travel_rad=max(float(np.ptp(p.model_rad[p.start : p.split])) for p in chosen),
        drive_min_v=low,
        drive_max_v=high,
        rate_limit_v_per_s=fit.rate_limit_v_per_s,
        drift_rad=drift_rad,
    )


# --------------------------------------------------------------------------------------------------- fitting, scoring
def _splits(recordings: Sequence[Recording], hold_out: float) -> list[int]:
    if not 0 < hold_out < 1:
        raise IdentificationError(
            f"--hold-out (hold_out) is {hold_out}; give the share of each recording kept for the check, between 0 "
            "and 1, e.g. 0.5."
        )
    splits = [round(r.samples * (1 - hold_out)) for r in recordings]
    for recording, split in zip(recordings, splits, strict=True):
        if min(split, recording.samples - split) < _MIN_PART:
            raise IdentificationError(
                f"{recording.path}: {split} samples to fit and {recording.samples - split} to check; each part needs "
                f"at least {_MIN_PART}; record longer or choose hold_out nearer to 0.5."
            )
    return splits


def _check_models(models: Sequence[str]) -> None:
    unknown = [m for m in models if m not in MODELS]
    if unknown or not models or len(set(models)) != len(models):
        raise IdentificationError(f"models {tuple(models)} cannot be used; name each once, out of {', '.join(MODELS)}.")


def _fit_all(
    heads: Sequence[Recording], models: Sequence[str], seed: int, on_progress: Progress | None, units: Units
) -> tuple[Fit, ...]:
    efforts = [1 if model == "prandtl_ishlinskii" else _STARTS for model in models]
    fits = []
    for i, model in enumerate(models):
        progress = _shifted(on_progress, sum(efforts[:i]), sum(efforts))
        fits.append(_fit_one(heads, model, seed, progress, units))
    return tuple(fits)


def _fit_one(heads: Sequence[Recording], model: str, seed: int, progress: Progress, units: Units) -> Fit:
    if model == "prandtl_ishlinskii":
        plays = fit_prandtl_ishlinskii(
            heads, output_unit=units.output, lever_arm_m=units.lever_arm_m, input_unit=units.drive
        )
        progress(1, 1, "play operators")
        return plays
    return fit_bouc_wen(
        heads,
        starts=_STARTS,
        seed=seed,
        admissible=model == "bouc_wen_admissible",
        on_progress=progress,
        output_unit=units.output,
        lever_arm_m=units.lever_arm_m,
        input_unit=units.drive,
    )


def _shifted(on_progress: Progress | None, before: int, total: int) -> Progress:
    def progress(done: int, _total: int, what: str) -> None:
        if on_progress is not None:
            on_progress(before + done, total, what)

    return progress


def _best(fits: Sequence[Fit], residuals: Sequence[Sequence[FloatArray]]) -> int:
    """Lowest residual on the held-out samples; an admissible model goes first where the difference may be chance."""
    losses = [[residual**2 for residual in each] for each in residuals]
    sums = [float(sum(np.sum(loss) for loss in each)) for each in losses]
    lowest = int(np.argmin(sums))
    ties = [i for i, each in enumerate(losses) if _may_be_chance(each, losses[lowest])]
    return min(ties, key=lambda i: (not _admissible(fits[i]), sums[i]))


def _may_be_chance(losses: Sequence[FloatArray], best: Sequence[FloatArray]) -> bool:
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


def _straight_line(
    prepared: Sequence[Prepared], recordings: Sequence[Recording], splits: Sequence[int], units: Units
) -> list[Prediction]:
    """One slope for all recordings and one offset for each, from the fitted samples."""
    above = [(p.drive_v[p.start :], p.output_rad[p.start :]) for p in prepared]
    slope = sum(float((u - u.mean()) @ (y - y.mean())) for u, y in above) / sum(
        float((u - u.mean()) @ (u - u.mean())) for u, _ in above
    )
    lines = []
    for recording, split, p in zip(recordings, splits, prepared, strict=True):
        model, measured = slope * recording.drive * units.volts, recording.output * units.radians
        offset = float(np.mean((measured - model)[p.start : split]))
        lines.append(Prediction(model + offset, measured, p.start, split, 0))
    return lines


def _score(model: str, predictions: Sequence[Prediction], span_rad: float) -> Score:
    fitted = np.concatenate([p.residual_rad[p.start : p.split] for p in predictions])
    held_out = np.concatenate([p.residual_rad[p.split :] for p in predictions])
    return Score(model, *percent(fitted, span_rad), *percent(held_out, span_rad))


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
            f" The difference to {' and '.join(lower)} is below two standard errors, and a model that moves the wrong "
            "way after reversals is not preferred for that."
        )
    return reason


def _range_warnings(drive_range: tuple[float, float], rate: float) -> list[str]:
    low, high = drive_range
    freq_hz = rate / (math.pi * (high - low))
    return [
        f"Valid for drives from {low:.4g} V to {high:.4g} V; outside that range the model is an extrapolation.",
        f"Not valid above {rate:.4g} V/s, the fastest rate of the recordings: a sine over the whole drive range "
        f"reaches it at {freq_hz:.4g} Hz.",
    ]


def _rate_warnings(records: Sequence[Prepared], fit: Fit) -> list[str]:
    warnings = []
    slowest, fastest = loop_rates(records)
    if one_rate_only(records):
        warnings.append(
            f"One loop rate only (peaks from {slowest:.4g} V/s to {fastest:.4g} V/s): how the hysteresis changes with "
            "frequency is not known from these recordings, and delta and d2 only describe the shape of this loop; "
            "record the same loop at two more frequencies."
        )
    elif isinstance(fit, PrandtlIshlinskiiFit):
        warnings.append(
            f"The loops have peak rates from {slowest:.4g} V/s to {fastest:.4g} V/s, and play operators do not depend "
            "on rate: one average loop stands for all."
        )
    if noisiness(records) > _NOISY_RATE:
        warnings.append(
            f"The drive is noisy: its rate from sample to sample scatters by {100 * noisiness(records):.0f} % of the "
            "fastest rate; use the commanded drive, or filter it, before trusting rate-dependent parameters."
        )
    return warnings


def _held_out_warnings(
    recordings: Sequence[Recording], units: Units, drive_range: tuple[float, float], predictions: Sequence[Prediction]
) -> list[str]:
    low, high = drive_range
    margin = 0.02 * (high - low)
    outside = 0
    for recording, prediction in zip(recordings, predictions, strict=True):
        held_out = recording.drive[prediction.split :] * units.volts
        outside += int(np.sum((held_out < low - margin) | (held_out > high + margin)))
    if not outside:
        return []
    return [f"{outside} held-out samples lie outside the fitted drive range; the held-out residual judges them too."]


def _score_warnings(score: Score, line: Score) -> list[str]:
    warnings = []
    if score.held_out_rms_percent >= line.held_out_rms_percent:
        warnings.append("No model is better than a straight line on the held-out samples: do not use the hysteresis.")
    if score.held_out_rms_percent > 1.5 * score.fit_rms_percent:
        warnings.append(
            f"The residual grows from {score.fit_rms_percent:.2f} % on the fitted samples to "
            f"{score.held_out_rms_percent:.2f} % on the held-out ones: drift, another regime, or too short a record."
        )
    return warnings


def fit_warnings(fit: Fit) -> list[str]:
    """Warnings that belong to one fit, whichever model is chosen."""
    if isinstance(fit, PrandtlIshlinskiiFit) or fit.admissible:
        return []
    lowest = min(fit.slope_after_reversal_rad_per_v, fit.lowest_slope_rad_per_v)
    return [
        "Not admissible: just after a reversal the modelled mirror first moves the wrong way "
        f"({1e3 * lowest:.3g} mrad/V against d1 = {1e3 * abs(fit.d1_rad_per_v):.3g} mrad/V); "
        "the model bouc_wen_admissible excludes it."
    ]


def _drift(
    predictions: Sequence[Prediction], recordings: Sequence[Recording], span_rad: float
) -> tuple[float, list[str]]:
    """Largest linear trend of a record's residual over its length (rad), and a warning where it stands out.

    It stands out above three standard errors (noise colour counted) and above 0.2 % of the peak-to-peak output.
    """
    largest, warnings = 0.0, []
    for prediction, recording in zip(predictions, recordings, strict=True):
        residual = prediction.residual_rad[prediction.start :]
        time = np.linspace(-0.5, 0.5, residual.size)
        trend = float(time @ residual) / float(time @ time)
        rest = residual - residual.mean() - trend * time
        error = math.sqrt(colour_inflation([rest]) * float(rest @ rest) / rest.size / float(time @ time))
        if abs(trend) > abs(largest):
            largest = trend
        if abs(trend) > max(3 * error, _DRIFT_PERCENT / 100 * span_rad):
            warnings.append(
                f"{recording.path}: the residual drifts by {1e6 * trend:.3g} ± {1e6 * error:.2g} urad "
                f"({100 * trend / span_rad:.2g} % of the peak-to-peak output) in "
                f"{residual.size * recording.step_s:.3g} s: creep or a warming sensor; no model here describes it."
            )
    return largest, warnings
