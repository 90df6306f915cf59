"""The figures of an identification: excitation, response, poles, loops, time responses and residuals, each an SVG.

Measured is blue (light where the fit saw it), modelled is vermilion and dashed, everywhere.
"""

import itertools
import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import LogFormatter
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.core.threads import shared_out
from microrad.lab.identify import Identification
from microrad.lab.identify.ladder.predictions import Prediction
from microrad.lab.identify.ladder.roles import roles
from microrad.lab.identify.linear.fit import LinearFit, fit_percent, output_error
from microrad.lab.recording import Recording
from microrad.report import identification_words as words
from microrad.report.figures import BLACK, BLUE, GREEN, ORANGE, SKY, STYLE, VERMILION, Figure, svg_of, thin

MOST_RECORDINGS = 12  # drawn, a row each
VIRTUAL = "virtual bench"
_SPECTRUM_POINTS = 500
_SPECTRUM_FLOOR = 1e-5  # of the strongest line
_PAPER_LOOPS_HZ = {60, 80, 100}
_ZOOM_SAMPLES = 300
_MOST_RESPONSES = 3
_MOST_CROSSINGS = 40
_LOOP_POINTS = 1800
_LEVEL_BANDS = 60

_FITTED: dict[str, Any] = {"color": SKY, "linewidth": 2.0}
_UNSEEN: dict[str, Any] = {"color": BLUE, "linewidth": 2.0}
_MODEL: dict[str, Any] = {"color": VERMILION, "linestyle": "--", "linewidth": 1.0}


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure before it becomes text."""

    canvas: Canvas
    title: str
    caption: str


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


def draw(found: Identification, recordings: Sequence[Recording], *, virtual: bool = False) -> dict[str, Figure]:
    """All figures by name. `recordings` are those given to `identify`, of which `found` keeps no broadband ones."""
    everything = shown(found, recordings)
    makers: dict[str, Callable[[], Drawing | None]] = {
        "excitation": lambda: excitation(everything, found),
        "response": lambda: response(found.linear) if found.linear else None,
        "poles": lambda: poles(found.linear) if found.linear else None,
        "loops": lambda: loops(everything, found),
        "time": lambda: time_response(found, recordings) if found.linear else None,
        "residuals": lambda: residuals(everything),
        "tests": lambda: residual_tests(found),
    }
    with rc_context({**STYLE, "path.simplify_threshold": 0.2}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")  # of a file name: the page's reader has the glyph
        with shared_out([partial(_figure, name, maker, virtual) for name, maker in makers.items()]) as figures:
            return {figure.name: figure for figure in figures() if figure is not None}


def _figure(name: str, maker: Callable[[], Drawing | None], virtual: bool) -> Figure | None:
    """The finished figure; of the virtual bench it says so in the picture too, which may be copied by itself."""
    drawing = maker()
    if drawing is None:
        return None
    if virtual:
        drawing.canvas.suptitle(VIRTUAL, x=0.995, horizontalalignment="right", fontsize=8, color=VERMILION)
    title = f"{drawing.title} ({VIRTUAL})" if virtual else drawing.title
    return Figure(name, title, drawing.caption, svg_of(drawing.canvas), {})


def shown(found: Identification, recordings: Sequence[Recording]) -> list[Shown]:
    """Loops, validation and broadband recordings, in this order, in volts and radians."""
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


def _title(axes: Axes, text: str) -> None:
    axes.set_title(text, fontsize=9, loc="left", parse_math=False)  # a name may hold a dollar sign


def _panels(rows: int, columns: int, height: float) -> tuple[Canvas, Any]:
    canvas = Canvas(figsize=(8.2, 0.5 + height * rows), layout="constrained")
    return canvas, canvas.subplots(rows, columns, squeeze=False)


def _not_drawn(everything: Sequence[Shown]) -> str:
    left = len(everything) - MOST_RECORDINGS
    return f" {left} more recordings are not drawn." if left > 0 else ""


# ------------------------------------------------------------------------------------------------------- excitation
def excitation(everything: Sequence[Shown], found: Identification) -> Drawing:
    """Drive against time, and its spectrum, a row for each recording."""
    drawn = everything[:MOST_RECORDINGS]
    canvas, axes = _panels(len(drawn), 2, 1.7)
    for (left, right), one in zip(axes, drawn, strict=True):
        left.plot(*thin(one.time_s, one.drive_v), color=BLACK, linewidth=0.7)
        left.set(xlabel="time (s)", ylabel="drive (V)")
        _title(left, f"{one.name} ({one.role})")
        freq, amplitude = amplitude_spectrum(one.drive_v, one.rate_hz)
        shown_lines = amplitude > _SPECTRUM_FLOOR * amplitude.max()
        right.vlines(freq[shown_lines], _SPECTRUM_FLOOR * amplitude.max(), amplitude[shown_lines], BLACK, linewidth=0.8)
        right.set(xscale="log", yscale="log", xlabel="frequency (Hz)", ylabel="amplitude (V)")
        right.set_ylim(bottom=_SPECTRUM_FLOOR * amplitude.max())
        right.set_xlim(freq[0], freq[-1])
        left.locator_params(axis="x", nbins=7)
        if one.role == "broadband" and found.linear is not None:
            right.axvspan(*found.linear.excited_hz, color=SKY, alpha=0.3, linewidth=0)
        elif one.sine is not None:
            _title(right, f"{one.sine.freq_hz:.4g} Hz")
    caption = (
        "Drive of each recording, and the amplitude of its spectral lines (the strongest of those that fall on one "
        "point). Shaded: the band that counts as excited for the linear part." + _not_drawn(everything)
    )
    return Drawing(canvas, "Excitation", caption)


def amplitude_spectrum(signal: Floats, rate_hz: float) -> tuple[Floats, Floats]:
    """Amplitude of the lines of a signal about its mean, the largest of each of at most 500 logarithmic bins."""
    size = 2 * np.abs(np.fft.rfft(signal - signal.mean()))[1:] / signal.size
    freq = np.arange(1, size.size + 1) * (rate_hz / signal.size)
    edges = np.unique(np.geomspace(1, size.size, _SPECTRUM_POINTS).astype(int)) - 1
    picks = np.array([a + int(np.argmax(size[a:b])) for a, b in zip(edges, [*edges[1:], size.size], strict=True)])
    return freq[picks], size[picks]


# --------------------------------------------------------------------------------------------------------- response
def response(linear: LinearFit) -> Drawing:
    """Measured response with its confidence, the linear model on top, levels of what disturbs it, coherence."""
    found = linear.response
    freq = found.freq_hz
    measured, error = found.response[:, 0, 0] * 1e6, found.standard_error[:, 0, 0] * 1e6
    model = measured - linear.residual[:, 0, 0] * 1e6
    # 95 % of one component of a complex value whose mean squared distance is the square of the error.
    half = 1.96 / math.sqrt(2.0) * error
    canvas = Canvas(figsize=(8.2, 8.4), layout="constrained")
    size, phase, levels, coherence = canvas.subplots(4, 1, sharex=True, height_ratios=(3, 2, 2.4, 1.2))
    magnitude = np.abs(measured)
    size.fill_between(freq, np.maximum(magnitude - half, 1e-3 * magnitude), magnitude + half, color=SKY, alpha=0.6,
                      linewidth=0, label="95 % confidence")  # fmt: skip
    size.plot(freq, magnitude, ".", color=BLUE, markersize=2.5, label="measured")
    size.plot(freq, np.abs(model), label=f"linear model, order {linear.order}", **{**_MODEL, "linewidth": 1.4})
    size.set(xscale="log", yscale="log", ylabel="gain (µrad/V)")
    for axis_format in (size.yaxis.set_major_formatter, size.yaxis.set_minor_formatter):
        axis_format(LogFormatter(minor_thresholds=(2.0, 0.5)))  # 60, not 6 × 10¹
    turn = np.degrees(np.unwrap(np.angle(model)))
    off = np.degrees(np.angle(measured / np.where(model == 0, 1.0, model)))
    spread = np.degrees(np.arcsin(np.minimum(half / np.maximum(magnitude, 1e-300), 1.0)))
    phase.fill_between(freq, turn + off - spread, turn + off + spread, color=SKY, alpha=0.6, linewidth=0)
    phase.plot(freq, turn + off, ".", color=BLUE, markersize=2.5)
    phase.plot(freq, turn, **{**_MODEL, "linewidth": 1.4})
    phase.set(ylabel="phase (°)")
    low, high = float(np.min(turn + off)), float(np.max(turn + off))
    phase.set_ylim(min(low, float(turn.min())) - 20, max(high, float(turn.max())) + 20)
    _levels(levels, linear)
    coherence.plot(freq, found.coherence[:, 0], ".", color=BLUE, markersize=2.5)
    coherence.set(ylim=(min(0.9, float(np.min(found.coherence)) - 0.02), 1.01), ylabel="coherence (1)")
    coherence.set_xlabel("frequency (Hz)")
    for axes in (size, levels):
        axes.legend(fontsize=8, loc="best", markerscale=3)
    caption = (
        f"Frequency response without a model ({found.method}) and the linear model behind the same {linear.hold} hold. "
        "Below: what the model leaves at each frequency, and as rms over bands one standard error of the response with "
        "the parts of it that are noise and nonlinear distortion, where the recordings tell them apart."
    )
    return Drawing(canvas, "Frequency response of the linear part", caption)


def _levels(axes: Axes, linear: LinearFit) -> None:
    found = linear.response
    lines: list[tuple[str, Floats | None, dict[str, Any]]] = [
        ("standard error", found.standard_error, {"color": BLACK}),
        ("noise", found.noise_standard_error, {"color": GREEN, "linestyle": "-."}),
        ("nonlinear distortion", found.distortion_standard_error, {"color": BLUE, "linestyle": ":"}),
    ]
    left = np.abs(linear.residual[:, 0, 0]) * 1e6
    axes.plot(found.freq_hz, left, ".", color=ORANGE, markersize=2.0, label="measured less modelled")
    for label, values, style in lines:
        if values is not None:
            axes.plot(*banded_rms(found.freq_hz, values[:, 0, 0] * 1e6), label=label, linewidth=1.6, **style)
    axes.set(yscale="log", ylabel="level (µrad/V)")


def banded_rms(freq_hz: Floats, level: Floats) -> tuple[Floats, Floats]:
    """Mean frequency and rms of a level in each of at most 60 logarithmic bands: single lines of it scatter widely."""
    edges = np.geomspace(freq_hz[0], freq_hz[-1], _LEVEL_BANDS + 1)
    band = np.clip(np.searchsorted(edges, freq_hz, side="right") - 1, 0, _LEVEL_BANDS - 1)
    counts = np.bincount(band, minlength=_LEVEL_BANDS)
    filled = counts > 0
    sums = (np.bincount(band, weights=values, minlength=_LEVEL_BANDS) for values in (freq_hz, level**2))
    centre, square = (total[filled] / counts[filled] for total in sums)
    return centre, np.where(square > 0.0, np.sqrt(square), np.nan)


# ------------------------------------------------------------------------------------------------------------ poles
def poles(linear: LinearFit) -> Drawing:
    """Poles and zeros with their standard errors: damping against natural frequency."""
    canvas = Canvas(figsize=(8.2, 3.4), layout="constrained")
    axes = canvas.subplots()
    low, high = linear.excited_hz
    axes.axvspan(low, high, color=SKY, alpha=0.2, linewidth=0, label="excited band")
    found = words.roots(linear)
    freq = np.array([root.freq_hz for root in found if root.freq_hz > 0.0])
    for kind, mark, colour in (("pole", "x", VERMILION), ("zero", "o", BLUE)):
        here = [root for root in found if root.kind == kind and root.freq_hz > 0.0]
        if not here:
            continue
        x = np.array([root.freq_hz for root in here])
        wide = np.array([root.freq_error_hz for root in here])
        errors = np.stack([np.minimum(wide, 0.9 * x), wide])
        axes.errorbar(
            x,
            [root.damping for root in here],
            yerr=[root.damping_error for root in here],
            xerr=errors,
            label=f"{kind}s",
            capsize=3,
            markersize=8,
            markerfacecolor="none",
            fmt=mark,
            color=colour,
        )
    axes.axhline(0.0, color=BLACK, linewidth=0.7)
    axes.set(xscale="log", xlabel="natural frequency (Hz)", ylabel="damping ratio (1)")
    axes.set_xlim(0.3 * min(low, *freq), 3.0 * max(high, *freq))
    axes.legend(fontsize=8, loc="best")
    caption = (
        "Poles and zeros with one standard error. A damping of 1 is a real one; zeros below 0 lie in the right half "
        "plane. What lies outside the shaded band is extrapolated."
    )
    return Drawing(canvas, "Poles and zeros of the linear part", caption)


# ------------------------------------------------------------------------------------------------------------ loops
def loops(everything: Sequence[Shown], found: Identification) -> Drawing:
    """Output over drive, measured and modelled, and what a straight line leaves of both, a row for each recording."""
    judged = [one for one in everything if one.prediction is not None]
    drawn = judged[:MOST_RECORDINGS]
    canvas, axes = _panels(len(drawn), 2, 2.5)
    for (left, right), one in zip(axes, drawn, strict=True):
        assert one.prediction is not None
        _loop(left, right, one, one.prediction)
    _legend(canvas, any(one.prediction.split < one.drive_v.size for one in drawn if one.prediction))
    caption = (
        f"Measured against modelled by {found.chosen}. Right: the same less the straight line that fits the measured "
        "output of that recording best, which leaves the hysteresis, and at high frequency the phase lag with it. Of a "
        "sine of constant amplitude the last period of either part is drawn, of others at most some twenty swings; the "
        "initial transient is left out." + _not_drawn(judged)
    )
    title = "Loops, measured against modelled"
    rounded = {round(one.sine.freq_hz) for one in judged if one.sine is not None}
    if rounded >= _PAPER_LOOPS_HZ:
        title = "Fig. 5  Rate-dependent hysteresis, measured against modelled"
    return Drawing(canvas, title, caption)


def _loop(left: Axes, right: Axes, one: Shown, prediction: Prediction) -> None:
    used = slice(prediction.start, None)
    slope, offset = np.polyfit(one.drive_v[used], prediction.measured_rad[used], 1)
    line = slope * one.drive_v + offset
    measured, model = prediction.measured_rad - line, prediction.model_rad - line
    parts = (slice(prediction.start, prediction.split), slice(prediction.split, one.drive_v.size))
    picks = [_picks(_stretch(one, part), (one.drive_v, measured, model)) for part in parts]
    for axes, level, scale in ((left, line - offset, 1e3), (right, 0.0 * line, 1e6)):
        for pick, style in zip(picks, (_FITTED, _UNSEEN), strict=True):
            _curve(axes, one.drive_v[pick], scale * (measured + level)[pick], style)
        for pick in picks:
            _curve(axes, one.drive_v[pick], scale * (model + level)[pick], _MODEL)
    left.set(xlabel="drive (V)", ylabel="output (mrad)")
    right.set(xlabel="drive (V)", ylabel="output less line (µrad)")
    _title(left, one.name + ("" if one.role == "loops" else f" ({one.role})"))
    fitted, unseen = words.split_errors(prediction)
    driven = "many frequencies" if one.sine is None else f"{one.sine.freq_hz:.3g} Hz, ± {one.sine.amplitude_v:.3g} V"
    error = f"unseen {1e6 * unseen:.3g} µrad rms" if math.isfinite(unseen) else f"fitted {1e6 * fitted:.3g} µrad rms"
    _title(right, f"{driven}: {error}")


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


def _picks(part: slice, curves: Sequence[Floats]) -> NDArray[np.intp]:
    """Samples to draw of curves over each other: the same of all, with the extremes of each in every stretch."""
    size = part.stop - part.start
    stretch = size // (_LOOP_POINTS // (2 * len(curves)))
    if stretch < 2 * len(curves):
        return np.arange(part.start, part.stop)
    first = np.arange(part.start, part.stop - stretch + 1, stretch)
    blocks = [curve[part][: first.size * stretch].reshape(-1, stretch) for curve in curves]
    kept = [first + pick for block in blocks for pick in (block.argmin(axis=1), block.argmax(axis=1))]
    return np.unique(np.concatenate([*kept, [part.start, part.stop - 1]]))


def _curve(axes: Axes, x: Floats, y: Floats, style: dict[str, Any]) -> None:
    if x.size:
        axes.plot(x, y, **style)


def _legend(canvas: Canvas, held_out: bool) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], label="measured, fitted", **_FITTED)]
    handles += [Line2D([], [], label="measured, unseen by the fit", **_UNSEEN)] if held_out else []
    handles += [Line2D([], [], label="modelled", **_MODEL)]
    canvas.legend(handles=handles, loc="outside upper center", ncols=3, fontsize=8)


# ---------------------------------------------------------------------------------------------------- time response
def time_response(found: Identification, recordings: Sequence[Recording]) -> Drawing | None:
    """Output of the broadband recordings against time, measured and by the linear model; None without any."""
    linear = found.linear
    judged = {(s.path, s.sha256) for s in found.sources if s.role == "validation"}
    given = [r for r in recordings or found.recordings if (r.path, r.sha256) not in judged]
    if linear is None or not given or not roles(given).broadband:
        return None
    fitted, drawn, _ = roles(given)
    drawn = drawn[:_MOST_RESPONSES]
    canvas = Canvas(figsize=(8.2, 0.5 + 4.0 * len(drawn)), layout="constrained")
    percents = []
    for figure, recording in zip(np.atleast_1d(np.asarray(canvas.subfigures(len(drawn), 1))), drawn, strict=True):
        panels = figure.subplot_mosaic([["whole", "whole"], ["early", "late"]])
        seen = "fitted" if any(recording is one for one in fitted) else "unseen by the linear model"
        percents.append(_response_panels(panels, recording, found, linear, seen))
    chirps = [i for i, recording in enumerate(drawn) if is_chirp(recording)]
    title = "Fig. 4  Time response to the chirp" if chirps else "Time response of the linear part"
    caption = (
        f"Output of the broadband recordings and of the linear model of order {linear.order}. Fit: "
        "100 (1 − |y − ŷ| / |y − mean y|), the MATLAB-style percentage, offsets removed. Above the whole record, below "
        "two stretches of it; the mirror rests at the first value of its drive, or a periodic drive has settled."
    )
    return Drawing(canvas, f"{title}, fit {percents[chirps[0] if chirps else 0]:.2f} %", caption)


def _response_panels(
    panels: dict[str, Axes], recording: Recording, found: Identification, linear: LinearFit, seen: str
) -> float:
    """Draw one recording; returns its fit percentage."""
    # The mirror rests at the first drive value, not at 0 V.
    drive = (recording.drive - recording.drive[:1]) * found.units.volts
    scaled = replace(recording, drive=drive, output=recording.output * found.units.radians)
    error = output_error(linear.modes, scaled, linear.hold, steady=recording.period_samples is not None)
    measured = scaled.output[: len(error)] - scaled.output[: len(error)].mean(axis=0)
    percent = float(fit_percent(measured, error)[0])
    time = np.arange(len(error)) / recording.rate_hz
    y, e = 1e6 * measured[:, 0], 1e6 * error[:, 0]
    whole = panels["whole"]
    whole.plot(*thin(time, y), color=BLUE, linewidth=0.8, label="measured")
    whole.plot(*thin(time, e), color=ORANGE, linewidth=0.8, label="measured less modelled")
    whole.legend(fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    _title(whole, f"{_short(recording.path)}: fit {percent:.2f} % ({seen})")
    late = int(0.8 * e.size)
    early = max(_ZOOM_SAMPLES, e.size // 4 if is_chirp(recording) else 0)
    for name, part in (("early", slice(0, early)), ("late", slice(late, late + _ZOOM_SAMPLES))):
        panels[name].plot(*thin(time[part], y[part]), label="measured", **{**_UNSEEN, "linewidth": 1.6})
        panels[name].plot(*thin(time[part], (y - e)[part]), label="linear model", **_MODEL)
    panels["early"].legend(fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    for axes in panels.values():
        axes.set(xlabel="time (s)", ylabel="output (µrad)")
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
def residuals(everything: Sequence[Shown]) -> Drawing:
    """Measured less modelled against time, a panel for each recording."""
    judged = [one for one in everything if one.prediction is not None]
    drawn = judged[:MOST_RECORDINGS]
    columns = 1 if len(drawn) == 1 else 2
    canvas, axes = _panels(-(-len(drawn) // columns), columns, 1.9)
    for panel in axes.flat[len(drawn) :]:
        panel.remove()
    for panel, one in zip(axes.flat, drawn, strict=False):
        p = one.prediction
        assert p is not None
        for part, colour in ((slice(p.start, p.split), SKY), (slice(p.split, None), BLUE)):
            if p.residual_rad[part].size:
                panel.plot(*thin(one.time_s[part], 1e6 * p.residual_rad[part]), color=colour, linewidth=0.7)
        panel.axhline(0.0, color=BLACK, linewidth=0.7)
        panel.locator_params(axis="x", nbins=7)
        panel.set(xlabel="time (s)", ylabel="residual (µrad)")
        _title(panel, f"{one.name}" + ("" if one.role == "loops" else f" ({one.role})"))
    caption = (
        "Measured less modelled. Light: samples that the model was fitted to; dark: samples that no fit has seen. The "
        "initial transient is left out." + _not_drawn(judged)
    )
    return Drawing(canvas, "Residuals", caption)


def residual_tests(found: Identification) -> Drawing:
    """Autocorrelation, cross-correlation with the drive, and spectrum of the longest unseen residual."""
    from scipy.signal import welch  # here, to keep start-up cheap

    test = found.residual
    canvas = Canvas(figsize=(8.2, 2.9), layout="constrained")
    auto, cross, spectrum = canvas.subplots(1, 3)
    for axes, values, first, label in (
        (auto, test.autocorrelation, 1, "autocorrelation (1)"),
        (cross, test.cross_correlation, 0, "correlation with drive (1)"),
    ):
        axes.axhspan(-test.bound, test.bound, color=SKY, alpha=0.4, linewidth=0)
        lags = np.arange(first, first + values.size)
        axes.vlines(lags, 0.0, values, color=BLUE, linewidth=1.2)
        axes.axhline(0.0, color=BLACK, linewidth=0.7)
        axes.set(xlabel="lag (samples)", ylabel=label)
        largest = max(float(np.max(np.abs(values))), 2.0 * test.bound)
        axes.set_ylim(-1.1 * largest, 1.1 * largest)
    best = words.chosen_predictions(found)
    pairs = zip(found.recordings, best, strict=True)
    recording, p = max(pairs, key=lambda pair: pair[1].residual_rad.size - pair[1].split)
    for values, style, label in (
        (p.measured_rad[p.split :], {"color": BLACK, "linestyle": "--"}, "output"),
        (p.residual_rad[p.split :], {"color": BLUE}, "residual"),
    ):
        freq, power = welch(values, recording.rate_hz, nperseg=min(values.size, 2048))
        spectrum.plot(freq[1:], np.sqrt(np.maximum(power[1:], 1e-300)) * 1e6, label=label, linewidth=1.0, **style)
    spectrum.set(xscale="log", yscale="log", xlabel="frequency (Hz)", ylabel="density (µrad/√Hz)")
    spectrum.legend(fontsize=8)
    caption = (
        f"Of the longest unseen part, {_short(recording.path)}: of a residual that is noise 95 % of the lines lie "
        f"within the shaded ± {test.bound:.2g}. For the correlation with the drive both are whitened first."
    )
    return Drawing(canvas, "Tests of the residual", caption)
