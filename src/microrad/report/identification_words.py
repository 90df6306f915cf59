"""What an identification found, in words, as tables to print and as plain data."""

import math
import shlex
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import format_quantity
from microrad.lab.identify import Identification, PrandtlIshlinskiiFit, Score
from microrad.lab.identify.hysteresis.joint import JointFit
from microrad.lab.identify.linear.fit import LinearFit
from microrad.lab.identify.records import rounded_to_error
from microrad.lab.identify.selection.predictions import Fit, Prediction
from microrad.lab.identify.selection.warnings import fit_warnings
from microrad.lab.recording import Recording
from microrad.mirror.hysteresis import Play
from microrad.report.identification_parameters import (
    admissible,
    colour,
    condition_number,
    not_identified,
    parameter_rows,
    starts,
    starts_text,
    two_digits,
)

PAPER_MODEL = "bouc_wen"  # Eq. 3 of SPIE 11852, 118523B
_SINE_POWER = 0.8  # in the strongest line of a drive and its neighbours


# --------------------------------------------------------------------------------------------------------- the drive
@dataclass(frozen=True, slots=True)
class Sine:
    """A drive of one frequency, and half of its largest peak-to-peak."""

    freq_hz: float
    amplitude_v: float


def sine_of(drive_v: Floats, rate_hz: float) -> Sine | None:
    """The sine that a drive is, its amplitude growing or not, of two periods or more; None where it is none."""
    centred = drive_v - drive_v.mean()
    spectrum = np.abs(np.fft.rfft(centred * np.hanning(drive_v.size))) ** 2
    peak = int(np.argmax(spectrum[1:])) + 1
    wide = min(3, peak // 2)
    if wide == 0 or spectrum[peak - wide : peak + wide + 1].sum() < _SINE_POWER * spectrum[1:].sum():
        return None
    freq_hz = peak * rate_hz / drive_v.size
    rising = np.flatnonzero((centred[:-1] < 0.0) & (centred[1:] >= 0.0))
    if rising.size > 1:  # finer than a line of the spectrum, unless noise crosses as well
        at = rising - centred[rising] / (centred[rising + 1] - centred[rising])
        counted = (rising.size - 1) * rate_hz / float(at[-1] - at[0])
        freq_hz = counted if abs(counted - freq_hz) < rate_hz / drive_v.size else freq_hz
    return Sine(freq_hz, float(np.ptp(drive_v)) / 2)


def drive_text(recording: Recording, volts: float) -> str:
    """How a recording was driven: "60 Hz, ± 6 V about 6 V"."""
    drive = recording.drive[:, 0] * volts
    sine = sine_of(drive, recording.rate_hz)
    half = float(np.ptp(drive)) / 2
    middle = _rounded(float(drive.max() + drive.min()) / 2, half)
    return f"{'many frequencies' if sine is None else f'{sine.freq_hz:.3g} Hz'}, ± {half:.3g} V about {middle:.3g} V"


def _rounded(value: float, span: float) -> float:
    """A value to a thousandth of a span: the codes of a converter seldom fall on a round number."""
    step = 10.0 ** math.floor(math.log10(span / 1000)) if span > 0.0 else 1e-12
    return round(value / step) * step + 0.0


# ---------------------------------------------------------------------------------------------------------- verdict
def error_text(score: Score, span_rad: float) -> str:
    """The rms error on unseen samples in µrad and per cent of the peak-to-peak output."""
    rms = score.held_out_rms_percent
    return f"{rms * span_rad * 1e4:.3g} µrad rms ({rms:.3g} %)"


def full_range_hz(found: Identification) -> float:
    """The frequency of a sine over the whole drive range that just reaches the fastest rate of the recordings."""
    return found.rate_limit_v_per_s / (math.pi * (found.drive_max_v - found.drive_min_v))


def drive_range(found: Identification) -> tuple[str, str]:
    """The fitted drive range."""
    span = found.drive_max_v - found.drive_min_v
    return f"{_rounded(found.drive_min_v, span):.4g} V", f"{_rounded(found.drive_max_v, span):.4g} V"


def verdict(found: Identification, written: str | None = None) -> list[str]:
    """What was found and where it holds, a sentence each; the first one is the headline."""
    own, fit = found.score(), found.fit()
    headline = (
        f"{found.chosen} predicts samples that no fit has seen with an error of "
        f"{error_text(own, found.span_rad)}, {own.held_out_peak_percent * found.span_rad * 1e4:.3g} µrad at most."
    )
    low, high, rate = *drive_range(found), found.rate_limit_v_per_s
    sentences = [
        headline,
        _against(found),
        f"Per cent are of the largest peak-to-peak output, {format_quantity(found.span_rad, 'rad', 4)}.",
        f"It holds for drives from {low} to {high} and rates up to {format_quantity(rate, 'V/s', 4)}, "
        f"which a sine over that range reaches at {full_range_hz(found):.4g} Hz. {_band(found)}",
        "Admissible: the modelled mirror never moves against its drive after a reversal."
        if admissible(fit)
        else "Not admissible: after a reversal the modelled mirror first moves the wrong way.",
        f"{starts_text(fit)[0].upper()}{starts_text(fit)[1:]}.",
    ]
    if written is not None and written != found.chosen:
        error = error_text(found.score(written), found.span_rad)
        sentences.append(f"The mirror file holds {written} as asked, which leaves {error}.")
    return sentences


def _against(found: Identification) -> str:
    """The chosen model beside the paper's and the straight line."""
    line = f"a straight line leaves {_times(found.straight_line, found)}"
    if found.chosen == PAPER_MODEL:
        return f"It is the paper's model (Eq. 3); {line}."
    names = [score.model for score in found.scores]
    if PAPER_MODEL not in names:
        return f"{line[0].upper()}{line[1:]}; the paper's model ({PAPER_MODEL}) was not fitted."
    return f"The paper's model ({PAPER_MODEL}) leaves {_times(found.score(PAPER_MODEL), found)}, {line}."


def _times(score: Score, found: Identification) -> str:
    own = found.score().held_out_rms_percent
    ratio = f", {score.held_out_rms_percent / own:.3g} times as much" if own > 0.0 else ""
    return f"{error_text(score, found.span_rad)}{ratio}"


def sound(found: Identification) -> bool:
    """Whether the choice can be used as it stands: admissible, and better than a straight line on unseen samples."""
    better = found.score().held_out_rms_percent < found.straight_line.held_out_rms_percent
    return better and admissible(found.fit())


def no_linear(found: Identification) -> str:
    """Why there is no linear part."""
    if any(source.role == "broadband" for source in found.sources):
        return "No model with a linear part was asked for, so the broadband recordings were not used."
    return (
        "No recording is broadband, so the dynamics of the mirror are not known: record a small chirp or multisine as "
        "well."
    )


def _band(found: Identification) -> str:
    if found.linear is None:
        return "There is no linear part: its dynamics are not known from these recordings."
    low, high = found.linear.excited_hz
    return f"The linear part was excited from {low:.3g} Hz to {format_quantity(high, 'Hz', 3)}" + (
        "." if _has_linear(found.fit()) else ", but the model does not use it."
    )


def _has_linear(fit: Fit) -> bool:
    return isinstance(fit, JointFit) and fit.linear is not None


def warnings(found: Identification, written: str | None = None) -> list[str]:
    """Warnings of the identification and of the model that is written, each once."""
    return list(dict.fromkeys([*found.warnings, *fit_warnings(found.fit(written))]))


def chosen_predictions(found: Identification) -> tuple[Prediction, ...]:
    """Those of the chosen model, in the order of the recordings."""
    return found.predictions[[score.model for score in found.scores].index(found.chosen)]


def split_errors(prediction: Prediction) -> tuple[float, float]:
    """Rms residual (rad) on the fitted and on the unseen samples of a record; nan where there are none."""
    parts = (prediction.residual_rad[prediction.start : prediction.split], prediction.residual_rad[prediction.split :])
    fitted, unseen = (float(np.sqrt(np.mean(part**2))) if part.size else math.nan for part in parts)
    return fitted, unseen


# ------------------------------------------------------------------------------------------------------------- text
_WIDTH = 42
_MOST_REASONS = 6  # one a line; of more only the names are printed


def identification_text(
    found: Identification, written: str, *, mirror_file: Path | None = None, report_file: Path | None = None
) -> str:
    """The identification as text to read; the files that were written, and what to do next, stand at its end.

    Parameters are those of the model written and of the paper's; the report and the plain data have all.
    """
    lines = [f"{'residual in % of the peak-to-peak':{_WIDTH}}{'fitted samples':>20}{'held-out samples':>20}"]
    lines += [" " * _WIDTH + 2 * f"{'rms':>10}{'peak':>10}"]
    lines += [_score_line(score, written) for score in (*found.scores, found.straight_line)]
    lines += ["", *verdict(found, written), "", found.reason, "", "recordings"]
    lines += [_source_line(source) for source in found.sources]
    lines += ["", *_linear_lines(found.linear)] if found.linear is not None else []
    for score, fit in zip(found.scores, found.fits, strict=True):
        if score.model in (written, "bouc_wen"):
            lines += ["", score.model, *_parameter_lines(fit)]
    lines += ["", " ".join(residual_sentences(found))]
    if found.refused:
        lines += ["", *(f"refused: {refused.model}, {refused.reason}" for refused in found.refused)]
    lines += ["", *(f"warning: {text}" for text in warnings(found, written))]
    return "\n".join([*lines, *_files(written, mirror_file, report_file)])


def _score_line(score: Score, written: str) -> str:
    mark = " (written)" if score.model == written else ""
    fitted = f"{score.fit_rms_percent:10.3f}{score.fit_peak_percent:10.2f}"
    return f"{score.model + mark:{_WIDTH}}{fitted}{score.held_out_rms_percent:10.3f}{score.held_out_peak_percent:10.2f}"


def _source_line(source: Any) -> str:
    return f"  {source.role:11}{source.fitted:9} fitted {source.held_out:9} held out  {one_line(source.path)}"


def _linear_lines(linear: LinearFit) -> list[str]:
    """The linear part: fit, order with its reason, poles and zeros, gains."""
    low, high = linear.excited_hz
    lines = [
        f"linear part, excited from {low:.4g} Hz to {high:.4g} Hz: order {linear.order}, fit "
        f"{linear.fit_percent[0]:.2f} %",
        f"  {linear.reason}",
    ]
    lines += [
        f"  {r.kind} {rounded_to_error(r.freq_hz, r.freq_error_hz):>10} ± {two_digits(r.freq_error_hz)} Hz  "
        f"damping {rounded_to_error(r.damping, r.damping_error)}"
        for r in roots(linear)
    ]
    return lines + [
        f"  gain at {name}: {rounded_to_error(1e3 * g, 1e3 * e)} ± {two_digits(1e3 * e)} mrad/V"
        for name, g, e in gains(linear)
    ]


def _parameter_lines(fit: Fit) -> list[str]:
    rows = [row for row in parameter_rows(fit) if row.value or not row.note]
    width = max(9, *(len(row.name) for row in rows))
    lines = []
    for row in rows:
        value, error, unit = row.shown
        given = f"± {two_digits(error)} {unit}".rstrip() if math.isfinite(error) else f"{unit} ({row.note})".strip()
        lines.append(f"  {row.name:{width}}{rounded_to_error(value, error):>12} {given}")
    unknown = not_identified(fit)
    if len(unknown) > _MOST_REASONS:
        lines.append(f"  not identified: {len(unknown)} of {len(rows)}, {', '.join(name for name, _ in unknown)}")
    else:
        lines += [f"  not identified: {name}, {why}" for name, why in unknown]
    return [*lines, f"  {starts_text(fit)}"]


def residual_sentences(found: Identification) -> list[str]:
    """The tests of the chosen model's residual on unseen samples, each in a sentence."""
    test = found.residual
    auto, cross = (100 * share for share in test.outside)
    return [
        f"The residual is {'white' if test.white else 'not white'}: {auto:.0f} % of its autocorrelations lie outside "
        f"± {test.bound:.2g}.",
        f"It {'is independent of' if test.independent else 'follows'} the drive: {cross:.0f} % of the "
        "cross-correlations lie outside; 5 % would be noise.",
    ]


def _files(written: str, mirror_file: Path | None, report_file: Path | None) -> list[str]:
    lines = [] if report_file is None else [f"{report_file} written: what was found, with pictures."]
    if mirror_file is not None:
        run_it = ["microrad", "run", "leo-geo.toml", "--mirror", str(mirror_file)]
        run_it += ["--output", f"{mirror_file.stem}-study"]
        lines.append(f"{mirror_file} written ({written}). Next: {shlex.join(run_it)}")
    return ["", *lines] if lines else []


def one_line(text: str) -> str:
    """A text without characters that cannot be printed on a line."""
    return "".join(c if c.isprintable() else " " for c in text)


# --------------------------------------------------------------------------------------------------- poles and zeros
@dataclass(frozen=True, slots=True)
class Root:
    """A pole or zero, one of a conjugate pair: natural frequency and damping ratio (1 or -1 where it is real).

    The errors are one standard error of the complex value, taken along either.
    """

    kind: str
    freq_hz: float
    freq_error_hz: float
    damping: float
    damping_error: float
    excited: bool


def roots(linear: LinearFit) -> list[Root]:
    """Poles, then zeros, by frequency; a damping below 0 lies in the right half plane."""
    low, high = linear.excited_hz
    found = []
    for kind, values, errors in (
        ("pole", linear.poles_rad_s, linear.poles_error_rad_s),
        ("zero", linear.zeros_rad_s, linear.zeros_error_rad_s),
    ):
        pairs = sorted(zip(values.tolist(), errors.tolist(), strict=True), key=lambda pair: abs(pair[0]))
        for value, error in pairs:
            if value.imag < 0.0:
                continue
            size = abs(value) or math.nan
            freq, real = abs(value) / (2 * math.pi), value.imag == 0.0
            damping_error = 0.0 if real else error / size
            inside = low <= freq <= high
            found.append(Root(kind, freq, error / (2 * math.pi), -value.real / size, damping_error, inside))
    return found


def gains(linear: LinearFit | None) -> list[tuple[str, float, float]]:
    """Gain (rad/V) and standard error at zero frequency, which is extrapolated, and at the lowest excited one."""
    if linear is None:
        return []
    return [
        ("zero frequency", float(linear.dc_gain[0, 0]), float(linear.dc_gain_error[0, 0])),
        (f"{linear.excited_hz[0]:.3g} Hz", float(linear.edge_gain[0, 0]), float(linear.edge_gain_error[0, 0])),
    ]


# ------------------------------------------------------------------------------------------------------------- data
def identification_data(
    found: Identification, written: str, *, mirror_file: Path | None = None, report_file: Path | None = None
) -> dict[str, Any]:
    """The identification as plain data, in SI units with the unit in each key; what is not finite is None."""
    names = [score.model for score in found.scores]
    data = {
        "model": written,
        "best_model": found.chosen,
        "verdict": verdict(found, written),
        "reason": found.reason,
        "scores": [_score_data(score, found.span_rad) for score in (*found.scores, found.straight_line)],
        "parameters": {name: _parameter_data(fit) for name, fit in zip(names, found.fits, strict=True)},
        "refused": {refused.model: refused.reason for refused in found.refused},
        "linear": None if found.linear is None else _linear_data(found.linear),
        "residual": _residual_data(found),
        "span_rad": found.span_rad,
        "travel_rad": found.travel_rad,
        "drive_min_v": found.drive_min_v,
        "drive_max_v": found.drive_max_v,
        "rate_limit_v_s": found.rate_limit_v_per_s,
        "full_range_hz": full_range_hz(found),
        "drift_rad": found.drift_rad,
        "recordings": [asdict(source) for source in found.sources],
        "warnings": warnings(found, written),
        "mirror_file": None if mirror_file is None else str(mirror_file),
        "report_file": None if report_file is None else str(report_file),
    }
    plain: dict[str, Any] = _plain(data)
    return plain


def _plain(data: Any) -> Any:
    """The same with None for numbers that JSON cannot say, and Python's own types."""
    if isinstance(data, dict):
        return {key: _plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_plain(value) for value in data]
    if isinstance(data, np.generic):
        return _plain(data.item())
    return None if isinstance(data, float) and not math.isfinite(data) else data


def _score_data(score: Score, span_rad: float) -> dict[str, Any]:
    share = span_rad / 100
    return asdict(score) | {
        "fit_rms_rad": share * score.fit_rms_percent,
        "held_out_rms_rad": share * score.held_out_rms_percent,
    }


def _parameter_data(fit: Fit) -> dict[str, Any]:
    found = starts(fit)
    common = {
        "admissible": admissible(fit),
        "not_identified": dict(not_identified(fit)),
        "agreeing_starts": None if found is None else found[0],
        "starts": None if found is None else found[1],
        "condition_number": condition_number(fit),
        "colour_inflation": colour(fit),
    }
    if isinstance(fit, PrandtlIshlinskiiFit):
        return common | {
            "thresholds_v": fit.thresholds_v.tolist(),
            "weights_rad_v": fit.weights_rad_per_v.tolist(),
            "standard_errors_rad_v": fit.standard_errors_rad_per_v.tolist(),
            "sign": fit.sign,
        }
    values = {
        row.name: {"value": row.value, "standard_error": row.standard_error, "unit": row.unit}
        for row in parameter_rows(fit)
    }
    plays = isinstance(fit, JointFit) and isinstance(fit.model, Play)
    return common | values | ({"thresholds_v": list(fit.model.thresholds_v)} if plays else {})  # type: ignore[union-attr]


def _linear_data(linear: LinearFit) -> dict[str, Any]:
    return {
        "order": linear.order,
        "reason": linear.reason,
        "fit_percent": float(linear.fit_percent[0]),
        "residual_rms_rad": float(linear.residual_rms[0]),
        "excited_hz": list(linear.excited_hz),
        "rate_hz": linear.rate_hz,
        "dc_gain_rad_v": float(linear.dc_gain[0, 0]),
        "dc_gain_standard_error_rad_v": float(linear.dc_gain_error[0, 0]),
        "edge_gain_rad_v": float(linear.edge_gain[0, 0]),
        "edge_gain_standard_error_rad_v": float(linear.edge_gain_error[0, 0]),
        "poles_and_zeros": [asdict(root) for root in roots(linear)],
        "orders": [asdict(score) for score in linear.scan],
    }


def _residual_data(found: Identification) -> dict[str, Any]:
    test = found.residual
    return {
        "samples": test.samples,
        "bound": test.bound,
        "white": test.white,
        "independent_of_drive": test.independent,
        "share_of_autocorrelations_outside": test.outside[0],
        "share_of_cross_correlations_outside": test.outside[1],
        "autocorrelation": test.autocorrelation.tolist(),
        "cross_correlation": test.cross_correlation.tolist(),
    }


def shown_recordings(found: Identification, recordings: Sequence[Recording]) -> list[Recording]:
    """The recordings of `recordings` that the identification itself does not keep: the broadband ones."""
    kept = {(r.path, r.sha256) for r in found.recordings}
    return [r for r in recordings if (r.path, r.sha256) not in kept]
