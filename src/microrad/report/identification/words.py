"""What an identification found, in sentences."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import format_quantity
from microrad.lab.identify import Identification, Score
from microrad.lab.identify.hysteresis.joint import JointFit
from microrad.lab.identify.linear.fit import LinearFit
from microrad.lab.identify.selection.predictions import Evidence, Fit, Prediction, evidence
from microrad.lab.identify.selection.warnings import fit_warnings, range_warnings
from microrad.lab.recording import Recording
from microrad.report.identification.parameters import (
    admissible,
    starts_text,
)
from microrad.report.quantities import plain

PAPER_MODEL = "bouc_wen"  # Eq. 3 of SPIE 11852, 118523B
_SINE_POWER = 0.8  # in the strongest line of a drive and its neighbours


# --------------------------------------------------------------------------------------------------------- the drive
@dataclass(frozen=True, slots=True)
class Sine:
    """A drive of one frequency, and half of its largest peak-to-peak."""

    freq_hz: float
    amplitude_v: float


def sine_of(drive_v: Floats, rate_hz: float) -> Sine | None:
    """The sine that a drive is, its amplitude growing or not, of two periods or more; None where it is none.

    Args:
        drive_v: even samples, (n,), V.
        rate_hz: of the samples, Hz.
    """
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
    """How a recording was driven: "60 Hz, ± 6 V about 6 V".

    Args:
        recording: with its drive in its own unit.
        volts: volts in one of that unit.
    """
    drive = recording.drive[:, 0] * volts
    sine = sine_of(drive, recording.rate_hz)
    half = float(np.ptp(drive)) / 2
    middle = _rounded(float(drive.max() + drive.min()) / 2, half)
    kind = "many frequencies" if sine is None else format_quantity(sine.freq_hz, "Hz", 3)
    return f"{kind}, ± {plain(half)} V about {plain(middle)} V"


def _rounded(value: float, span: float) -> float:
    """A value to a thousandth of a span: the codes of a converter seldom fall on a round number."""
    step = 10.0 ** math.floor(math.log10(span / 1000)) if span > 0.0 else 1e-12
    return round(value / step) * step + 0.0


# ---------------------------------------------------------------------------------------------------------- verdict
def error_text(score: Score, span_rad: float) -> str:
    """The rms error on unseen samples in µrad and per cent of the peak-to-peak output.

    Args:
        score: one model's.
        span_rad: largest peak-to-peak output, rad.
    """
    rms = score.held_out_rms_percent
    return f"{plain(rms * span_rad * 1e4)} µrad rms ({plain(rms)} %)"


def full_range_hz(found: Identification) -> float:
    """The frequency of a sine over the whole drive range that just reaches the fastest rate of the recordings."""
    return found.rate_limit_v_per_s / (math.pi * (found.drive_max_v - found.drive_min_v))


def drive_range(found: Identification) -> tuple[str, str]:
    """The fitted drive range."""
    span = found.drive_max_v - found.drive_min_v
    return f"{plain(_rounded(found.drive_min_v, span), 4)} V", f"{plain(_rounded(found.drive_max_v, span), 4)} V"


def verdict(found: Identification, written: str | None = None) -> list[str]:
    """What was found and where it holds, a sentence each; the first one is the headline.

    Args:
        found: what was identified.
        written: the model in the mirror file; None says nothing of one.
    """
    own, fit, rests = found.score(), found.fit(), evidence(found.recordings, chosen_predictions(found))
    headline = (
        f"{found.chosen} predicts samples that no fit has seen with an error of "
        f"{error_text(own, found.span_rad)}, {plain(own.held_out_peak_percent * found.span_rad * 1e4)} µrad at most, "
        f"over {rests.text}."
    )
    sentences = [
        headline,
        worst_text(rests, found.span_rad),
        _against(found),
        f"Per cent are of the largest peak-to-peak output, {format_quantity(found.span_rad, 'rad', 4)}.",
        f"{range_text(found)} {_band(found)}",
        "Admissible: the modelled mirror never moves against its drive after a reversal."
        if admissible(fit)
        else "Not admissible: after a reversal the modelled mirror first moves the wrong way.",
        f"{starts_text(fit)[0].upper()}{starts_text(fit)[1:]}.",
    ]
    if written is not None and written != found.chosen:
        sentences.append(written_text(found, written))
    return sentences


def brief_verdict(found: Identification, written: str) -> list[str]:
    """What a terminal has of the verdict: the error, what it rests on and where it holds.

    Args:
        found: what was identified.
        written: the model in the mirror file.
    """
    headline, worst, *_ = verdict(found)
    line = f"A straight line leaves {_times(found.straight_line, found)}."
    as_asked = [] if written == found.chosen else [written_text(found, written)]
    return [headline, worst, line, range_text(found), *as_asked]


def worst_text(rests: Evidence, span_rad: float) -> str:
    """The recording on which the choice leaves most, seen by a fit or not.

    Args:
        rests: what the error rests on.
        span_rad: largest peak-to-peak output, rad.
    """
    rms, share = 1e6 * rests.worst_rms_rad, 100 * rests.worst_rms_rad / span_rad
    return (
        f"The worst of all recordings, fitted or not, is {rests.worst}, with {plain(rms)} µrad rms ({plain(share)} %) "
        f"and {plain(1e6 * rests.worst_peak_rad)} µrad at most."
    )


def range_text(found: Identification) -> str:
    """The drives and rates that were fitted."""
    low, high = drive_range(found)
    return (
        f"It holds for drives from {low} to {high} and rates up to "
        f"{format_quantity(found.rate_limit_v_per_s, 'V/s', 4)}, which a sine over that range reaches at "
        f"{format_quantity(full_range_hz(found), 'Hz')}."
    )


def written_text(found: Identification, written: str) -> str:
    """The error of another model than the choice in the mirror file.

    Args:
        found: what was identified.
        written: the model in the mirror file.
    """
    return f"The mirror file holds {written} as asked, which leaves {error_text(found.score(written), found.span_rad)}."


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
    ratio = f", {plain(score.held_out_rms_percent / own)} times as much" if own > 0.0 else ""
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
    return f"The linear part was excited from {format_quantity(low, 'Hz', 3)} to {format_quantity(high, 'Hz', 3)}" + (
        "." if _has_linear(found.fit()) else ", but the model does not use it."
    )


def _has_linear(fit: Fit) -> bool:
    return isinstance(fit, JointFit) and fit.linear is not None


def warnings(found: Identification, written: str | None = None) -> list[str]:
    """Warnings of the identification and of the model that is written, each once.

    Args:
        found: what was identified.
        written: the model in the mirror file; the chosen one unless it is given.
    """
    return list(dict.fromkeys([*found.warnings, *fit_warnings(found.fit(written))]))


def pressing(found: Identification, written: str) -> list[str]:
    """The warnings but for those of drives and rates, which the verdict has.

    Args:
        found: what was identified.
        written: the model in the mirror file.
    """
    known = range_warnings((found.drive_min_v, found.drive_max_v), found.rate_limit_v_per_s)
    return [text for text in warnings(found, written) if text not in known]


def chosen_predictions(found: Identification) -> tuple[Prediction, ...]:
    """Those of the chosen model, in the order of the recordings."""
    return found.predictions[[score.model for score in found.scores].index(found.chosen)]


def split_errors(prediction: Prediction) -> tuple[float, float]:
    """Rms residual (rad) on the fitted and on the unseen samples of a record; nan where there are none."""
    parts = (prediction.residual_rad[prediction.start : prediction.split], prediction.residual_rad[prediction.split :])
    fitted, unseen = (float(np.sqrt(np.mean(part**2))) if part.size else math.nan for part in parts)
    return fitted, unseen


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
            freq, real = abs(value) / (2 * math.pi), value.imag == 0.0
            damping, damping_error = (-value.real / abs(value), error / abs(value)) if value else (1.0, 0.0)
            inside = low <= freq <= high
            found.append(Root(kind, freq, error / (2 * math.pi), damping, 0.0 if real else damping_error, inside))
    return found


def gains(linear: LinearFit | None) -> list[tuple[str, float, float]]:
    """Gain (rad/V) and standard error at zero frequency, which is extrapolated, and at the lowest excited one."""
    if linear is None:
        return []
    return [
        ("zero frequency", float(linear.dc_gain[0, 0]), float(linear.dc_gain_error[0, 0])),
        (
            format_quantity(linear.excited_hz[0], "Hz", 3),
            float(linear.edge_gain[0, 0]),
            float(linear.edge_gain_error[0, 0]),
        ),
    ]


def shown_recordings(found: Identification, recordings: Sequence[Recording]) -> list[Recording]:
    """The recordings that the identification itself does not keep: the broadband ones.

    Args:
        found: what was identified.
        recordings: those that `identify` was given.
    """
    kept = {(r.path, r.sha256) for r in found.recordings}
    return [r for r in recordings if (r.path, r.sha256) not in kept]
