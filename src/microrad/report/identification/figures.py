"""The figures of an identification: excitation, response, poles, loops, time responses and residuals, as data.

Measured is blue (light where the fit saw it), modelled is vermilion and dashed, everywhere.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.core.units import format_quantity
from microrad.lab.identify import Identification
from microrad.lab.identify.linear.axis import axis_error
from microrad.lab.identify.linear.fit import LinearFit, fit_percent
from microrad.lab.identify.selection.predictions import Prediction
from microrad.lab.identify.selection.roles import roles, single_period, whole_periods
from microrad.lab.recording import Recording
from microrad.report.identification import words
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.palette import BLACK, BLUE, GREEN, ORANGE, SKY, VERMILION
from microrad.report.plotting.sheet import Axis, Legend, Line, Panel, Rule, Sheet, Span, between, grid, segments
from microrad.report.quantities import are, counted, plain

MOST_RECORDINGS = 12  # drawn, a row each
VIRTUAL = "virtual bench"
_WIDTH = 8.2
_SPECTRUM_POINTS = 400  # strokes of three points, all of which are drawn
_SPECTRUM_FLOOR = 1e-5  # of the strongest line
_ZOOM_SAMPLES = 300
_MOST_RESPONSES = 3
_MOST_CROSSINGS = 40
_LEVEL_BANDS = 60

_FITTED: dict[str, Any] = {"colour": SKY, "width": 2.0, "label": "measured, fitted"}
_UNSEEN: dict[str, Any] = {"colour": BLUE, "width": 2.0, "label": "measured, unseen by the fit"}
_MODEL: dict[str, Any] = {"colour": VERMILION, "dash": "--", "width": 1.0, "label": "modelled"}
_DOTS: dict[str, Any] = {"colour": BLUE, "dash": "", "marker": ".", "size": 4.5}


@dataclass(frozen=True, slots=True)
class Shown:
    """One recording as it is drawn: drive (V), output (rad), what it served for, and the prediction of the choice."""

    name: str
    role: str
    drive_v: Floats
    output_rad: Floats
    rate_hz: float
    sine: words.Sine | None
    prediction: Prediction | None

    @property
    def time_s(self) -> Floats:
        """From the first sample on."""
        return np.arange(self.drive_v.size) / self.rate_hz


def identification_figures(
    found: Identification, recordings: Sequence[Recording], *, virtual: bool = False
) -> dict[str, Figure]:
    """All figures by name.

    Args:
        found: what was identified.
        recordings: those that `identify` was given to fit: it keeps no broadband ones.
        virtual: whether they come from the virtual bench: each figure says so.
    """
    everything = shown(found, recordings)
    figures = [excitation(everything, found)]
    if found.linear is not None:
        figures += [response(found.linear), poles(found.linear)]
    timed = time_response(found, recordings)
    figures += [loops(everything, found), *([timed] if timed else []), residuals(everything), residual_tests(found)]
    return {figure.name: _virtual(figure) if virtual else figure for figure in figures}


def _virtual(figure: Figure) -> Figure:
    """The figure that says where it comes from in the picture too, which may be copied by itself."""
    sheet = replace(figure.sheet, heading=VIRTUAL, heading_colour=VERMILION)
    return replace(figure, title=f"{figure.title} ({VIRTUAL})", sheet=sheet)


def shown(found: Identification, recordings: Sequence[Recording]) -> list[Shown]:
    """Loops, validation and broadband recordings, in this order, in volts and radians.

    Args:
        found: what was identified.
        recordings: those that `identify` was given to fit: it keeps no broadband ones.
    """
    best = words.chosen_predictions(found)
    kept = {(s.path, s.sha256): s.role for s in found.sources}
    pairs: list[tuple[Recording, Prediction | None]] = list(zip(found.recordings, best, strict=True))
    pairs += [(r, None) for r in words.shown_recordings(found, recordings)]
    return [_shown(r, kept.get((r.path, r.sha256), "not used"), p, found) for r, p in pairs]


def _shown(recording: Recording, role: str, prediction: Prediction | None, found: Identification) -> Shown:
    drive = recording.drive[:, 0] * found.units.volts
    return Shown(
        _short(recording.path),
        role,
        drive,
        recording.output[:, 0] * found.units.radians,
        recording.rate_hz,
        words.sine_of(drive, recording.rate_hz),
        prediction,
    )


def _short(path: str) -> str:
    name = words.one_line(Path(path).name)
    return name if len(name) <= 36 else f"{name[:20]}…{name[-15:]}"


def _not_drawn(everything: Sequence[Shown]) -> str:
    left = len(everything) - MOST_RECORDINGS
    return f" {counted(left, 'more recording')} {are(left)} not drawn." if left > 0 else ""


# ------------------------------------------------------------------------------------------------------- excitation
def excitation(everything: Sequence[Shown], found: Identification) -> Figure:
    """Drive against time, and its spectrum, a row for each recording.

    Args:
        everything: the recordings as they are drawn.
        found: what was identified.
    """
    drawn = everything[:MOST_RECORDINGS]
    sheet, panels = grid(_WIDTH, 0.5 + 1.7 * len(drawn), len(drawn), 2)
    for left, right, one in zip(panels[::2], panels[1::2], drawn, strict=True):
        left.x, left.y, left.title = Axis("time (s)", most=7), Axis("drive (V)"), f"{one.name} ({one.role})"
        left.add(Line(one.time_s, one.drive_v, width=0.7))
        freq, amplitude = amplitude_spectrum(one.drive_v, one.rate_hz)
        floor = _SPECTRUM_FLOOR * float(amplitude.max())
        seen = amplitude > floor
        right.x = Axis("frequency (Hz)", log=True, low=float(freq[0]), high=float(freq[-1]))
        right.y = Axis("amplitude (V)", log=True, low=floor or None)  # a drive at rest has no lines
        if one.role == "broadband" and found.linear is not None:
            right.add(Span(*found.linear.excited_hz, True, SKY))
        elif one.sine is not None:
            right.title = format_quantity(one.sine.freq_hz, "Hz")
        right.add(segments(freq[seen], floor, amplitude[seen], BLACK, 0.8))
    caption = (
        "Drive of each recording, and the amplitude of its spectral lines (the strongest of those that fall on one "
        "point). Shaded: the band that counts as excited for the linear part." + _not_drawn(everything)
    )
    return Figure("excitation", "Excitation", caption, sheet, {})


def amplitude_spectrum(signal: Floats, rate_hz: float) -> tuple[Floats, Floats]:
    """Amplitude of the lines of a signal about its mean, the largest of each of at most 400 logarithmic bins.

    Args:
        signal: even samples, (n,).
        rate_hz: of the samples, Hz.
    """
    size = 2 * np.abs(np.fft.rfft(signal - signal.mean()))[1:] / signal.size
    freq = np.arange(1, size.size + 1) * (rate_hz / signal.size)
    edges = np.unique(np.geomspace(1, size.size, _SPECTRUM_POINTS).astype(int)) - 1
    picks = np.array([a + int(np.argmax(size[a:b])) for a, b in zip(edges, [*edges[1:], size.size], strict=True)])
    return freq[picks], size[picks]


# --------------------------------------------------------------------------------------------------------- response
class Measured(NamedTuple):
    """A measured response over frequency (Hz), and half the width of its confidence in one component; each (n,)."""

    freq_hz: Floats
    value: Complexes
    half: Floats | None = None


class Modelled(NamedTuple):
    """A model's response over frequency (Hz), its label, and half the widths of its confidence; each (n,).

    ``along`` is the confidence of the size, in its unit, and ``across`` that of the phase, in radians.
    """

    freq_hz: Floats
    value: Complexes
    label: str
    along: Floats | None = None
    across: Floats | None = None


def half_width(standard_error: Floats) -> Floats:
    """Half the width of 95 % confidence in one component of a complex value.

    Args:
        standard_error: root of the mean squared distance of the value from the true one, (n,).
    """
    return 1.96 / math.sqrt(2.0) * standard_error


def bode(panels: tuple[Panel, Panel], measured: Measured, model: Modelled | None = None) -> None:
    """Size and phase of a measured response, and a model of it on top, each with its confidence where that is known.

    Args:
        panels: those of size and phase.
        measured: at frequencies above 0 that rise.
        model: at frequencies that rise, those of the measured ones among them.
    """
    size, phase = panels
    freq, magnitude = measured.freq_hz, np.abs(measured.value)
    off = np.degrees(np.unwrap(np.angle(measured.value)))
    turn = off
    if model is not None:
        turn = np.degrees(np.unwrap(np.angle(model.value)))
        places = np.searchsorted(model.freq_hz, freq)
        value = model.value[places]
        off = turn[places] + np.degrees(np.angle(measured.value / np.where(value == 0, 1.0, value)))
    if measured.half is not None:
        low = np.maximum(magnitude - measured.half, 1e-3 * magnitude)
        size.add(between(freq, low, magnitude + measured.half, SKY, 0.6, "95 % confidence"))
        spread = np.degrees(np.arcsin(np.minimum(measured.half / np.maximum(magnitude, 1e-300), 1.0)))
        phase.add(between(freq, off - spread, off + spread, SKY, 0.6))
    size.add(Line(freq, magnitude, label="measured", **_DOTS))
    phase.add(Line(freq, off, **_DOTS))
    if model is not None:
        _modelled(panels, model, turn)
    both = np.concatenate([turn, off])
    size.x.log = phase.x.log = size.y.log = True
    phase.y = Axis("phase (°)", low=float(both.min()) - 20.0, high=float(both.max()) + 20.0)


def _modelled(panels: tuple[Panel, Panel], model: Modelled, turn: Floats) -> None:
    """A model's curves, its phase (degrees) without jumps, and its confidence below them."""
    (size, phase), magnitude = panels, np.abs(model.value)
    look = {**_MODEL, "width": 1.4}
    if model.along is not None and model.across is not None:
        size.y.low = 0.5 * min(float(magnitude.min()), *(float(line.y.min()) for line in size.all_of(Line)))
        low, spread = np.maximum(magnitude - model.along, 1e-3 * magnitude), np.degrees(model.across)
        label = "95 % confidence of the model"
        size.add(between(model.freq_hz, low, magnitude + model.along, VERMILION, 0.3, label))
        phase.add(between(model.freq_hz, turn - spread, turn + spread, VERMILION, 0.3))
    size.add(Line(model.freq_hz, magnitude, **{**look, "label": model.label}))
    phase.add(Line(model.freq_hz, turn, **{**look, "label": ""}))


def response(linear: LinearFit) -> Figure:
    """Measured response with its confidence, the linear model on top, levels of what disturbs it, coherence."""
    found = linear.response
    freq = found.freq_hz
    measured, error = found.response[:, 0, 0] * 1e6, found.standard_error[:, 0, 0] * 1e6
    model = measured - linear.residual[:, 0, 0] * 1e6
    sheet, panels = grid(_WIDTH, 8.4, 4, share_x=True)
    sheet.heights = (3.0, 2.0, 2.4, 1.2)
    size, phase, levels, coherence = panels
    levels.x.log = coherence.x.log = True
    label = f"linear model, order {linear.order}"
    bode((size, phase), Measured(freq, measured, half_width(error)), Modelled(freq, model, label))
    size.y.title = "gain (µrad/V)"
    levels.add(*_levels(linear))
    levels.y = Axis("level (µrad/V)", log=True)
    coherence.add(Line(freq, found.coherence[:, 0], **_DOTS))
    coherence.y = Axis("coherence (1)", low=min(0.9, float(np.min(found.coherence)) - 0.02), high=1.01)
    coherence.x.title = "frequency (Hz)"
    size.legend = levels.legend = Legend("best")
    caption = (
        f"Frequency response without a model ({found.method}) and the linear model behind the same {linear.hold} hold. "
        "Below: what the model leaves at each frequency, and as rms over bands one standard error of the response with "
        "the parts of it that are noise and nonlinear distortion, where the recordings tell them apart."
    )
    return Figure("response", "Frequency response of the linear part", caption, sheet, {})


def _levels(linear: LinearFit) -> list[Line]:
    """What the model leaves, and the errors of the response as rms over bands."""
    found = linear.response
    errors = (
        ("standard error", found.standard_error, BLACK, "-"),
        ("noise", found.noise_standard_error, GREEN, "-."),
        ("nonlinear distortion", found.distortion_standard_error, BLUE, ":"),
    )
    left = np.abs(linear.residual[:, 0, 0]) * 1e6
    return [
        Line(found.freq_hz, left, ORANGE, "", label="measured less modelled", marker=".", size=4.0),
        *(
            Line(*banded_rms(found.freq_hz, values[:, 0, 0] * 1e6), colour, dash, 1.6, label)
            for label, values, colour, dash in errors
            if values is not None
        ),
    ]


def banded_rms(freq_hz: Floats, level: Floats) -> tuple[Floats, Floats]:
    """Mean frequency and rms of a level in each of at most 60 logarithmic bands: single lines of it scatter widely.

    Args:
        freq_hz: rising, above 0, (n,), Hz.
        level: its value at each, (n,).
    """
    edges = np.geomspace(freq_hz[0], freq_hz[-1], _LEVEL_BANDS + 1)
    band = np.clip(np.searchsorted(edges, freq_hz, side="right") - 1, 0, _LEVEL_BANDS - 1)
    counts = np.bincount(band, minlength=_LEVEL_BANDS)
    filled = counts > 0
    sums = (np.bincount(band, weights=values, minlength=_LEVEL_BANDS) for values in (freq_hz, level**2))
    centre, square = (total[filled] / counts[filled] for total in sums)
    return centre, np.where(square > 0.0, np.sqrt(square), np.nan)


# ------------------------------------------------------------------------------------------------------------ poles
def poles(linear: LinearFit) -> Figure:
    """Poles and zeros with their standard errors: damping against natural frequency."""
    sheet, (panel,) = grid(_WIDTH, 3.4)
    low, high = linear.excited_hz
    panel.add(Span(low, high, True, SKY, 0.2, "excited band"))
    found = [root for root in words.roots(linear) if root.freq_hz > 0.0]
    freq = [root.freq_hz for root in found]
    for kind, mark, colour in (("pole", "x", VERMILION), ("zero", "o", BLUE)):
        here = [root for root in found if root.kind == kind]
        if not here:
            continue
        rows = [(root.freq_hz, root.damping, root.freq_error_hz, root.damping_error) for root in here]
        x, y, wide, tall = np.array(rows).T
        marks = Line(x, y, colour, "", label=f"{kind}s", marker=mark, size=8.0, face="")
        arms = np.stack([np.minimum(wide, 0.9 * x), wide]), np.stack([tall, tall])
        panel.add(replace(marks, x_arms=arms[0], y_arms=arms[1]))
    panel.add(Rule(0.0, False, width=0.7))
    panel.x = Axis("natural frequency (Hz)", log=True, low=0.3 * min(low, *freq), high=3.0 * max(high, *freq))
    panel.y, panel.legend = Axis("damping ratio (1)"), Legend("above", 3)
    caption = (
        "Poles and zeros with one standard error. A damping of 1 is a real one; zeros below 0 lie in the right half "
        "plane. What lies outside the shaded band is extrapolated."
    )
    return Figure("poles", "Poles and zeros of the linear part", caption, sheet, {})


# ------------------------------------------------------------------------------------------------------------ loops
def loops(everything: Sequence[Shown], found: Identification) -> Figure:
    """Output over drive, measured and modelled, and what a straight line leaves of both, a row for each recording.

    Args:
        everything: the recordings as they are drawn.
        found: what was identified.
    """
    judged = [one for one in everything if one.prediction is not None]
    drawn = judged[:MOST_RECORDINGS]
    sheet, panels = grid(_WIDTH, 0.5 + 2.5 * len(drawn), len(drawn), 2)
    sheet.legend = Legend("above", 3)
    for left, right, one in zip(panels[::2], panels[1::2], drawn, strict=True):
        assert one.prediction is not None
        _loop(left, right, one, one.prediction)
    caption = (
        f"Measured against modelled by {found.chosen}. Right: the same less the straight line that fits the measured "
        "output of that recording best, which leaves the hysteresis, and at high frequency the phase lag with it. Of a "
        "sine of constant amplitude the last period of either part is drawn, of others at most some twenty swings; the "
        "initial transient is left out." + _not_drawn(judged)
    )
    return Figure("loops", "Loops, measured against modelled", caption, sheet, {})


def _loop(left: Panel, right: Panel, one: Shown, prediction: Prediction) -> None:
    used = slice(prediction.start, None)
    slope, offset = np.polyfit(one.drive_v[used], prediction.measured_rad[used], 1)
    line = slope * one.drive_v + offset
    measured, model = prediction.measured_rad - line, prediction.model_rad - line
    parts = (slice(prediction.start, prediction.split), slice(prediction.split, one.drive_v.size))
    drawn = [(_stretch(one, part), style) for part, style in zip(parts, (_FITTED, _UNSEEN), strict=True)]
    drawn = [(part, style) for part, style in drawn if part.stop > part.start]
    for panel, level, scale in ((left, line - offset, 1e3), (right, 0.0 * line, 1e6)):
        panel.add(*(Line(one.drive_v[part], scale * (measured + level)[part], **style) for part, style in drawn))
        panel.add(*(Line(one.drive_v[part], scale * (model + level)[part], **_MODEL) for part, _ in drawn))
    left.x, left.y = Axis("drive (V)"), Axis("output (mrad)")
    right.x, right.y = Axis("drive (V)"), Axis("output less line (µrad)")
    left.title = one.name + ("" if one.role == "loops" else f" ({one.role})")
    fitted, unseen = words.split_errors(prediction)
    driven = "many frequencies"
    if one.sine is not None:
        driven = f"{format_quantity(one.sine.freq_hz, 'Hz', 3)}, ± {plain(one.sine.amplitude_v)} V"
    error = f"unseen {plain(1e6 * unseen)}" if math.isfinite(unseen) else f"fitted {plain(1e6 * fitted)}"
    right.title = f"{driven}: {error} µrad rms"


def _stretch(one: Shown, part: slice) -> slice:
    """What of a part is drawn: the last period of a sine of constant amplitude, else the last forty crossings or so.

    More of them would hide each other.
    """
    drive = one.drive_v[part]
    if one.sine is not None:
        period = math.ceil(one.rate_hz / one.sine.freq_hz) + 1
        spans = [float(np.ptp(drive[k : k + period])) for k in range(0, drive.size - period + 1, period)]
        if spans and min(spans) > 0.98 * 2 * one.sine.amplitude_v:
            return slice(max(part.start, part.stop - period), part.stop)
    above = drive > one.drive_v.mean()
    crossings = int(np.sum(above[1:] != above[:-1]))
    kept = drive.size if crossings <= _MOST_CROSSINGS else drive.size * _MOST_CROSSINGS // crossings
    return slice(part.stop - kept, part.stop)


# ---------------------------------------------------------------------------------------------------- time response
def time_response(found: Identification, recordings: Sequence[Recording]) -> Figure | None:
    """Output of the broadband recordings against time, measured and by the linear model; None without any.

    Args:
        found: what was identified.
        recordings: those that `identify` was given to fit: it keeps no broadband ones.
    """
    linear = found.linear
    judged = {(s.path, s.sha256) for s in found.sources if s.role == "validation"}
    given = [r for r in recordings or found.recordings if (r.path, r.sha256) not in judged]
    if linear is None or not given or not roles(given).broadband:
        return None
    fitted, drawn, _ = roles(given)
    drawn = drawn[:_MOST_RESPONSES]
    rows = 2 * len(drawn)
    sheet = Sheet(_WIDTH, 0.5 + 2.0 * rows, (1.0,) * rows, (1.0, 1.0))
    percents = []
    for row, recording in zip(range(0, rows, 2), drawn, strict=True):
        panels = sheet.panel(row, columns=2), sheet.panel(row + 1), sheet.panel(row + 1, 1)
        seen = "fitted" if any(recording is one for one in fitted) else "unseen by the linear model"
        alone = single_period(fitted) and seen == "fitted"
        percents.append(_response_panels(panels, whole_periods(recording) if alone else recording, found, linear, seen))
    chirps = [i for i, recording in enumerate(drawn) if is_chirp(recording)]
    title = "Time response to the chirp" if chirps else "Time response of the linear part"
    caption = (
        f"Output of the broadband recordings and of the linear model of order {linear.order}. Fit: "
        "100 (1 − |y − ŷ| / |y − mean y|), the MATLAB-style percentage, without offsets, drift and creep. Above the "
        "whole record, below two stretches of it; the mirror rests at the first value of its drive, or a periodic "
        "drive has settled."
    )
    return Figure("time", f"{title}, fit {percents[chirps[0] if chirps else 0]:.2f} %", caption, sheet, {})


def _response_panels(
    panels: Sequence[Panel], recording: Recording, found: Identification, linear: LinearFit, seen: str
) -> float:
    """Draw one recording; returns its fit percentage."""
    # The mirror rests at the first drive value, not at 0 V.
    drive = (recording.drive - recording.drive[:1]) * found.units.volts
    scaled = replace(recording, drive=drive, output=recording.output * found.units.radians)
    error = axis_error(linear.modes, scaled, linear.hold)
    measured = scaled.output[: len(error)] - scaled.output[: len(error)].mean(axis=0)
    percent = float(fit_percent(measured, error)[0])
    time = np.arange(len(error)) / recording.rate_hz
    y, e = 1e6 * measured[:, 0], 1e6 * error[:, 0]
    whole, *parts = panels
    whole.add(Line(time, y, BLUE, width=0.8, label="measured"))
    whole.add(Line(time, e, ORANGE, width=0.8, label="measured less modelled"))
    whole.title = f"{_short(recording.path)}: fit {percent:.2f} % ({seen})"
    late = int(0.8 * e.size)
    early = max(_ZOOM_SAMPLES, e.size // 4 if is_chirp(recording) else 0)
    for panel, part in zip(parts, (slice(0, early), slice(late, late + _ZOOM_SAMPLES)), strict=True):
        panel.add(Line(time[part], y[part], **{**_UNSEEN, "width": 1.6, "label": "measured"}))
        panel.add(Line(time[part], (y - e)[part], **{**_MODEL, "label": "linear model"}))
    whole.legend = parts[0].legend = Legend("above", 2)
    for panel in panels:
        panel.x, panel.y = Axis("time (s)"), Axis("output (µrad)")
    return percent


def is_chirp(recording: Recording) -> bool:
    """Whether the drive crosses its middle ever more often: eight stretches, each with more crossings than the last."""
    if recording.period_samples is not None:
        return False
    drive = recording.drive[:, 0]
    above = drive > (drive.max() + drive.min()) / 2
    counts = [int(np.sum(part[1:] != part[:-1])) for part in np.array_split(above, 8)]
    return all(b >= a for a, b in itertools.pairwise(counts)) and counts[-1] > 5 * max(counts[0], 1)


# -------------------------------------------------------------------------------------------------------- residuals
def residuals(everything: Sequence[Shown]) -> Figure:
    """Measured less modelled against time, a panel for each recording."""
    judged = [one for one in everything if one.prediction is not None]
    drawn = judged[:MOST_RECORDINGS]
    columns = 1 if len(drawn) == 1 else 2
    rows = -(-len(drawn) // columns)
    sheet = Sheet(_WIDTH, 0.5 + 1.9 * rows, (1.0,) * rows, (1.0,) * columns)
    for number, one in enumerate(drawn):
        panel, p = sheet.panel(*divmod(number, columns)), one.prediction
        assert p is not None
        for part, colour, name in ((slice(p.start, p.split), SKY, "fitted"), (slice(p.split, None), BLUE, "unseen")):
            panel.add(Line(one.time_s[part], 1e6 * p.residual_rad[part], colour, width=0.7, name=name))
        panel.add(Rule(0.0, False, width=0.7))
        panel.x, panel.y = Axis("time (s)", most=7), Axis("residual (µrad)")
        panel.title = one.name + ("" if one.role == "loops" else f" ({one.role})")
    caption = (
        "Measured less modelled. Light: samples that the model was fitted to; dark: samples that no fit has seen. The "
        "initial transient is left out." + _not_drawn(judged)
    )
    return Figure("residuals", "Residuals", caption, sheet, {})


def residual_tests(found: Identification) -> Figure:
    """Autocorrelation, cross-correlation with the drive, and spectrum of the longest unseen residual."""
    test = found.residual
    sheet, (auto, cross, spectrum) = grid(_WIDTH, 2.9, 1, 3)
    for panel, values, first, label in (
        (auto, test.autocorrelation, 1, "autocorrelation (1)"),
        (cross, test.cross_correlation, 0, "correlation with drive (1)"),
    ):
        panel.add(Span(-test.bound, test.bound, False, SKY, 0.4))
        lags = np.arange(first, first + values.size, dtype=np.float64)
        panel.add(segments(lags, 0.0, values, BLUE, 1.2), Rule(0.0, False, width=0.7))
        largest = 1.1 * max(float(np.max(np.abs(values))), 2.0 * test.bound)
        panel.x, panel.y = Axis("lag (samples)"), Axis(label, low=-largest, high=largest)
    best = words.chosen_predictions(found)
    pairs = zip(found.recordings, best, strict=True)
    recording, p = max(pairs, key=lambda pair: pair[1].residual_rad.size - pair[1].split)
    for values, colour, dash, label in (
        (p.measured_rad[p.split :], BLACK, "--", "output"),
        (p.residual_rad[p.split :], BLUE, "-", "residual"),
    ):
        freq, power = _spectrum(values, recording.rate_hz)
        density = np.sqrt(np.maximum(power[1:], 1e-300)) * 1e6
        spectrum.add(Line(freq[1:], density, colour, dash, 1.0, label))
    spectrum.x, spectrum.y = Axis("frequency (Hz)", log=True), Axis("density (µrad/√Hz)", log=True)
    spectrum.legend = Legend("best")
    caption = (
        f"Of the longest unseen part, {_short(recording.path)}: of a residual that is noise 95 % of the lines lie "
        f"within the shaded ± {test.bound:.2g}. For the correlation with the drive both are whitened first."
    )
    return Figure("tests", "Tests of the residual", caption, sheet, {})


def _spectrum(values: Floats, rate_hz: float) -> tuple[Floats, Floats]:
    """Frequencies (Hz) and one-sided density (per Hz): the mean over half-overlapping segments, each about its mean.

    Source: Welch, IEEE Transactions on Audio and Electroacoustics 15 (1967) 70, with Hann's window. Without SciPy's,
    whose package takes longer to load than the page to draw.
    """
    size = min(values.size, 2048)
    window = np.hanning(size + 1)[:-1]
    segments = np.lib.stride_tricks.sliding_window_view(values, size)[:: size - size // 2]
    transformed = np.fft.rfft((segments - segments.mean(axis=1, keepdims=True)) * window)
    density = np.mean(np.abs(transformed) ** 2, axis=0) / (rate_hz * float(np.sum(window**2)))
    density[1 : (size + 1) // 2] *= 2.0
    return np.asarray(np.fft.rfftfreq(size, 1.0 / rate_hz)), density
