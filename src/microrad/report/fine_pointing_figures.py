"""The figures of the fine-pointing loop: spectra before and after, errors by controller, error budget, sensitivity."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from microrad.core.arrays import Floats
from microrad.core.kept import NOTHING, Kept
from microrad.loop.fine_loop.linear import close, sensitivity
from microrad.loop.fine_pointing import ErrorBudget, FinePointingStudy, Verified
from microrad.mission.model import Mission
from microrad.report.figures import BLACK, BLUE, GREEN, ORANGE, SKY, STYLE, VERMILION, Figure, svg_of
from microrad.report.fine_pointing_words import micro, share_of_time, source_name
from microrad.study.story import Study

_COLOURS = (VERMILION, BLUE, GREEN)
_SHAPES = ("o", "s", "^")  # beside the colours, for print in grey
_GREY = "#777777"
_MARKERS = {"given": ("o", BLUE), "comparison": ("s", ORANGE), "no hysteresis": ("D", "white")}
_VARIANTS = {"given": "mission's mirror", "comparison": "comparison model", "no hysteresis": "no hysteresis"}
_PREDICTED: dict[str, Any] = {"linewidth": 0.9, "linestyle": (0, (4, 3))}
_SENSITIVITY_POINTS = 400
_MARKS = 9


@dataclass(frozen=True, slots=True)
class Shown:
    """A controller as the figures show it: the same colour and marker everywhere."""

    of: Verified
    colour: str
    marker: str

    @property
    def name(self) -> str:
        """Of the design."""
        return self.of.design.name

    def style(self, freq_hz: Floats, place: int) -> dict[str, Any]:
        """Keywords of its line: markers at even distances on a logarithmic axis, elsewhere for each place."""
        at = np.geomspace(freq_hz[0], freq_hz[-1], 3 * _MARKS + 1)[1 + place :: 3]
        marks = [int(i) for i in np.unique(np.searchsorted(freq_hz, at[at <= freq_hz[-1]]))]
        return {"color": self.colour, "marker": self.marker, "markevery": marks, "markersize": 5}


def draw(study: Study, parts: Kept = NOTHING) -> tuple[Figure, ...]:
    """The figures of the study's fine-pointing loop; none without one."""
    fine, m = study.fine_pointing, study.file.mission
    if fine is None:
        return ()
    controllers = shown(fine)
    with rc_context(STYLE):
        figures = [
            parts.part(spectra, fine, controllers),
            parts.part(errors, fine, m),
            parts.part(error_budget, fine.budget),
        ]
        if fine.scene.loop.optical.every == 1:
            figures.append(parts.part(sensitivities, fine, m, controllers))
    return tuple(figures)


def shown(fine: FinePointingStudy) -> tuple[Shown, ...]:
    """Baseline, best, and one more: an inverse in series where it is neither, else the lowest in theory."""
    chosen = [fine.verified[0]]
    in_series = [v for v in fine.verified if v.design.inverse == "in series"]
    by_theory = sorted(fine.verified, key=lambda v: v.theory.radial_rms_rad)
    for v in (fine.best, *in_series, *by_theory):
        if len(chosen) < len(_COLOURS) and v.design.name not in {c.design.name for c in chosen}:
            chosen.append(v)
    return tuple(Shown(*each) for each in zip(chosen, _COLOURS, _SHAPES, strict=False))


def cumulative_rms(freq_hz: Floats, density: Floats) -> Floats:
    """Rms from the first frequency up to each, of a one-sided density on a uniform grid."""
    return np.asarray(np.sqrt(np.cumsum(density) * (freq_hz[1] - freq_hz[0])))


# ------------------------------------------------------------------------------------------------ spectra


def spectra(fine: FinePointingStudy, controllers: tuple[Shown, ...]) -> Figure:
    """Spectrum of axis x before and after the loop, and the rms that gathers below each frequency."""
    inner = slice(1, -1)  # neither the mean nor half the control rate
    freq = fine.freq_hz[inner]
    canvas = Canvas(figsize=(7.6, 4.3), layout="constrained")
    left, right = canvas.subplots(1, 2, width_ratios=(1.45, 1))
    before = fine.disturbed_rad2_hz[inner]
    columns = {"frequency (Hz)": freq, "before the loop (rad^2/Hz)": before}
    left.plot(freq, before * 1e12, color=BLACK, label="before the loop")
    noise = _noise_density(fine)
    if noise > 0.0:
        left.axhline(noise * 1e12, color=_GREY, linestyle=":", linewidth=1.2, label="sensor noise")
    for place, each in enumerate(controllers):
        after, predicted = each.of.spectrum_rad2_hz[inner, 0], each.of.predicted_rad2_hz[inner, 0]
        style = each.style(freq, place)
        left.plot(freq, after * 1e12, label=each.name, **style)
        name = f"_{each.name}, predicted, linear"
        left.plot(freq, predicted * 1e12, label=name, color=each.colour, **_PREDICTED)
        right.plot(freq, cumulative_rms(freq, after) * 1e6, **style)
        right.plot(freq, cumulative_rms(freq, predicted) * 1e6, label=name, color=each.colour, **_PREDICTED)
        columns[f"{each.name}, simulated (rad^2/Hz)"] = after
        columns[f"{each.name}, predicted (rad^2/Hz)"] = predicted
    left.plot([], [], color=_GREY, label="dashed: predicted, linear", **_PREDICTED)
    left.set(xscale="log", yscale="log", xlabel="frequency (Hz)", ylabel="spectrum of one axis (µrad²/Hz)")
    left.set_ylim(bottom=_floor(controllers, inner))
    right.set(xscale="log", xlabel="frequency (Hz)", ylabel="rms below that frequency, one axis (µrad)")
    right.set_ylim(bottom=0.0)
    for axes in (left, right):
        axes.set_xlim(freq[0], freq[-1])
    canvas.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=3, fontsize=8)
    caption = (
        "One-sided spectrum of the line of sight about axis x, on the mission's mirror: the disturbances before the "
        "loop, what is left behind it (simulated, with hysteresis), and what linear theory predicts without. "
        "Right: the rms that has gathered up to each frequency."
    )
    caption += " Lines of the reaction wheel are not in the spectrum before the loop." if _lines(fine) else ""
    title = "Spectrum of the line of sight before and behind the loop"
    return Figure("fine-pointing-spectrum", title, caption, svg_of(canvas), columns)


def _noise_density(fine: FinePointingStudy) -> float:
    """One-sided density (rad^2/Hz) of the optical sensor's noise, white up to half its own rate."""
    loop = fine.scene.loop
    return 2.0 * loop.optical.noise_rad**2 * loop.timing.period_s * loop.optical.every


def _floor(controllers: tuple[Shown, ...], inner: slice) -> float:
    """Lower end of the spectra's axis (µrad²/Hz): a little below what is left; before the loop it may fall further."""
    least = min(float(np.min(each.of.spectrum_rad2_hz[inner, 0])) for each in controllers)
    return float(10.0 ** math.floor(math.log10(max(least * 1e12, 1e-12))))


def _lines(fine: FinePointingStudy) -> bool:
    return any(each.lines for several in fine.scene.loop.disturbances for each in several)


# ------------------------------------------------------------------------------------------------ errors


def errors(fine: FinePointingStudy, m: Mission) -> Figure:
    """Radial error at the mission's share of the time, by controller and variant of the mirror."""
    names = [v.design.name for v in fine.verified]
    rows = np.arange(len(names))[::-1]
    canvas = Canvas(figsize=(7.6, 1.3 + 0.36 * len(names)), layout="constrained")
    axes = canvas.subplots()
    columns: dict[str, Floats] = {}
    required = m.requirement.pointing_error_rad
    for i, (variant, (marker, colour)) in enumerate(_MARKERS.items()):
        found = {
            name: (row - 0.22 * (i - 1), v.simulated[variant].quantile_rad)
            for name, row, v in zip(names, rows, fine.verified, strict=True)
            if variant in v.simulated
        }
        at, values = np.array([*found.values()]).reshape(-1, 2).T
        if values.size:
            edge = BLACK if colour == "white" else colour
            axes.plot(values * 1e6, at, marker, label=_VARIANTS[variant], color=colour, markeredgecolor=edge)
        columns |= {f"{name}, {_VARIANTS[variant]} (rad)": np.array([value]) for name, (_, value) in found.items()}
    axes.axvline(required * 1e6, color=BLACK, linestyle="--", linewidth=1.2, label=f"required: {required * 1e6:g} µrad")
    axes.set_yticks(rows, names)
    axes.set_ylim(-0.6, len(names) - 0.4)
    axes.set_xlim(left=0.0)
    axes.set_xlabel(f"radial error at {share_of_time(fine.quantile)} of the time (µrad)")
    canvas.legend(loc="outside upper center", ncols=4, fontsize=8)
    caption = (
        f"Simulated radial error that is not exceeded for {share_of_time(fine.quantile)} of the time, by controller "
        "and variant of the mirror."
    )
    return Figure("fine-pointing-errors", "Radial error by controller", caption, svg_of(canvas), columns)


# ------------------------------------------------------------------------------------------------ error budget


@dataclass(frozen=True, slots=True)
class Bar:
    """One bar of the error budget: radial rms (rad), and what theory expects (nan where it says nothing)."""

    name: str
    rms_rad: float
    theory_rad: float
    colour: str


def bars_of(b: ErrorBudget) -> tuple[list[Bar], list[Bar], list[Bar]]:
    """Parts alone, their combinations, and the size of what each difference changes."""
    parts = [Bar(source_name(p.name), p.rms_rad, p.theory_rad, SKY) for p in b.parts]
    totals = {
        "root sum square of the parts": b.combined_rad,
        "all together, without hysteresis": b.together_rad,
        "all together, mission's mirror": b.full_rad,
    }
    changes = [
        Bar(f"{'added' if d.added_rad >= 0.0 else 'taken off'} by {d.name}", abs(d.added_rad), math.nan, ORANGE)
        for d in b.differences
    ]
    return parts, [Bar(name, value, math.nan, BLUE) for name, value in totals.items()], changes


def error_budget(b: ErrorBudget) -> Figure:
    """Each part alone beside theory, the parts together, and what hysteresis and the rest change."""
    parts, totals, changes = bars_of(b)
    bars = [*parts, *totals, *changes]
    rows = np.arange(len(bars))[::-1]
    canvas = Canvas(figsize=(7.6, 0.9 + 0.28 * len(bars)), layout="constrained")
    axes = canvas.subplots()
    values, theory = (1e6 * np.array([getattr(bar, key) for bar in bars]) for key in ("rms_rad", "theory_rad"))
    axes.barh(rows, values, color=[bar.colour for bar in bars], height=0.65)
    axes.plot(theory, rows, "|", color=BLACK, markersize=13, markeredgewidth=1.8, label="theory (linear)")
    for row, value, expected in zip(rows, values, theory, strict=True):
        end = np.nanmax([value, expected])
        axes.annotate(micro(value * 1e-6), (end, row), (5, 0), textcoords="offset points", va="center", fontsize=8)
    for edge in (len(bars) - len(parts), len(changes)):
        axes.axhline(edge - 0.5, color=_GREY, linewidth=0.8)
    axes.set_yticks(rows, [bar.name for bar in bars])
    axes.set_ylim(-0.6, len(bars) - 0.4)
    axes.set_xlim(0.0, 1.12 * float(np.nanmax([*values, *theory])))
    axes.set_xlabel("radial rms (µrad)")
    axes.grid(visible=False, axis="y")
    canvas.legend(loc="outside upper right", fontsize=8)
    caption = (
        f"Error budget of {b.controller}. Above: each part by itself, simulated without hysteresis. Middle: combined. "
        "Below: what a part changes when it alone is left out of the full loop, as a root of the difference of squares."
    )
    columns = {f"{bar.name} (rad)": np.array([bar.rms_rad]) for bar in bars}
    columns |= {f"{p.name}, theory (rad)": np.array([p.theory_rad]) for p in parts if not math.isnan(p.theory_rad)}
    title = "What the residual is made of"
    return Figure("fine-pointing-budget", title, caption, svg_of(canvas), columns)


# ------------------------------------------------------------------------------------------------ sensitivity


def sensitivities(fine: FinePointingStudy, m: Mission, controllers: tuple[Shown, ...]) -> Figure:
    """|S| of the same controllers, with the ceiling that the modulus margin asked for puts on it."""
    half = 0.5 / fine.scene.loop.timing.period_s
    freq = np.geomspace(half * 1e-4, half * 0.999, _SENSITIVITY_POINTS)
    canvas = Canvas(figsize=(7.6, 3.7), layout="constrained")
    whole, peak = canvas.subplots(1, 2)
    columns: dict[str, Floats] = {"frequency (Hz)": freq}
    for axes in (whole, peak):
        axes.set(xscale="log", xlabel="frequency (Hz)", ylabel="|S|, error over disturbance")
    for place, each in enumerate(controllers):
        size = np.abs(sensitivity(close(fine.scene.loop, each.of.design.controller), freq)[:, 0, 0])
        for axes in (whole, peak):
            axes.plot(freq, size, label=each.name, **each.style(freq, place))
        columns[each.name] = size
    for axes in (whole, peak):
        _ceiling(axes, m)
    whole.set(yscale="log", xlim=(freq[0], half))
    peak.set(xlim=(0.02 * half, half), ylim=(0.0, None))
    canvas.legend(*whole.get_legend_handles_labels(), loc="outside upper center", ncols=2, fontsize=8)
    caption = (
        "Sensitivity of axis x at the control samples, linear, with delay: what the loop leaves of a disturbance at "
        "each frequency. Below 1 it rejects, above 1 it amplifies; the inverse of the modulus margin is its ceiling. "
        "Right: the same about its peak."
    )
    return Figure("fine-pointing-sensitivity", "Sensitivity", caption, svg_of(canvas), columns)


def _ceiling(axes: Axes, m: Mission) -> None:
    axes.axhline(1.0, color=_GREY, linewidth=0.8)
    if m.fine_pointing is not None:
        margin = m.fine_pointing.modulus_margin
        label = f"1 / modulus margin asked for ({margin:g})"
        axes.axhline(1.0 / margin, color=BLACK, linestyle="--", linewidth=1.2, label=label)
