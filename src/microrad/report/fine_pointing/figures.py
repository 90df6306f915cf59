"""The figures of the fine-pointing loop: spectra before and after, errors by controller, error budget, sensitivity."""

import math
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.kept import NOTHING, Kept
from microrad.loop.controller_study import ErrorBudget, FinePointingStudy, Verified
from microrad.loop.pointing_loop.linear import close, sensitivity
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop
from microrad.mirror import Variant
from microrad.mission.model import Mission
from microrad.report.fine_pointing.words import NAMES, source_name
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.palette import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    SKY,
    VERMILION,
    WHITE,
    thinned_by_logarithm,
)
from microrad.report.plotting.sheet import Bars, Dash, Legend, Line, Panel, Rule, Sheet, Words, grid
from microrad.report.quantities import micro, share_of_time
from microrad.study.study import Study

_COLOURS = (VERMILION, BLUE, GREEN)
_SHAPES = ("o", "s", "^")  # beside the colours, for print in grey
_MARKERS = {Variant.GIVEN: ("o", BLUE), Variant.COMPARISON: ("s", ORANGE), Variant.STRAIGHT: ("D", WHITE)}
_PREDICTED: tuple[Dash, float] = ((4.0, 3.0), 0.9)
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

    def line(self, freq_hz: Floats, values: Floats, place: int) -> Line:
        """Its line, with markers at even distances on a logarithmic axis of frequency.

        Args:
            freq_hz: frequencies (points,) in Hz, above 0, rising.
            values: the curve there (points,), in the unit of the axis.
            place: place of the controller among those shown, 0 to 2, which shifts its markers away from theirs.
        """
        freq_hz, values = seen(freq_hz, values)
        at = np.geomspace(freq_hz[0], freq_hz[-1], 3 * _MARKS + 1)[1 + place :: 3]
        marks = [int(i) for i in np.unique(np.searchsorted(freq_hz, at[at <= freq_hz[-1]]))]
        return Line(freq_hz, values, self.colour, label=self.name, marker=self.marker, size=5.0, every=marks)


def fine_pointing_figures(study: Study, parts: Kept = NOTHING) -> tuple[Figure, ...]:
    """The figures of the study's fine-pointing loop; none without one.

    Args:
        study: the study.
        parts: the parts that earlier runs have kept.
    """
    fine, m = study.fine_pointing, study.file.mission
    if fine is None:
        return ()
    controllers = shown(fine)
    figures = [spectra(fine, controllers), errors(fine, m), error_budget(fine.budget)]
    if fine.scene.loop.optical.every == 1:
        figures.append(sensitivities(fine, m, controllers, parts))
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


def seen(freq_hz: Floats, values: Floats) -> tuple[Floats, Floats]:
    """The points of a curve that a logarithmic axis of frequency tells apart."""
    kept = thinned_by_logarithm(freq_hz, values)
    return freq_hz[kept], values[kept]


def cumulative_rms(freq_hz: Floats, density: Floats) -> Floats:
    """Rms from the first frequency up to each, of a one-sided density on a uniform grid.

    Args:
        freq_hz: frequencies (points,) in Hz, evenly spaced, rising, at least two.
        density: the density there (points,), a square per Hz, such as rad^2/Hz.
    """
    return np.asarray(np.sqrt(np.cumsum(density) * (freq_hz[1] - freq_hz[0])))


# ------------------------------------------------------------------------------------------------ spectra


def spectrum_sheet(freq_hz: Floats) -> tuple[Sheet, Panel, Panel]:
    """A sheet with a panel for spectra (µrad²/Hz) and one for the rms (µrad) that gathers below each frequency.

    Args:
        freq_hz: frequencies (points,) in Hz, above 0, rising: from the first to the last of them.
    """
    sheet = Sheet(7.6, 4.3, widths=(1.45, 1.0), legend=Legend("above", 3))
    left, right = sheet.panel(0, 0), sheet.panel(0, 1)
    left.y.title, left.y.log = "spectrum of one axis (µrad²/Hz)", True
    right.y.title, right.y.low = "rms below that frequency, one axis (µrad)", 0.0
    for panel in (left, right):
        panel.x.title, panel.x.log, panel.x.low, panel.x.high = "frequency (Hz)", True, freq_hz[0], freq_hz[-1]
    return sheet, left, right


def spectra(fine: FinePointingStudy, controllers: tuple[Shown, ...]) -> Figure:
    """Spectrum of axis x before and after the loop, and the rms that gathers below each frequency.

    Args:
        fine: the study, with the frequencies.
        controllers: those shown.
    """
    inner = slice(1, -1)  # neither the mean nor half the control rate
    freq = fine.freq_hz[inner]
    sheet, left, right = spectrum_sheet(freq)
    before = fine.disturbed_rad2_hz[inner]
    columns = {"frequency (Hz)": freq, "before the loop (rad^2/Hz)": before}
    left.add(Line(*seen(freq, before * 1e12), label="before the loop"))
    noise = _noise_density(fine)
    if noise > 0.0:
        left.add(Rule(noise * 1e12, False, GREY, ":", 1.2, "sensor noise"))
    for place, each in enumerate(controllers):
        after, predicted = each.of.spectrum_rad2_hz[inner, 0], each.of.predicted_rad2_hz[inner, 0]
        for panel, found, linear in (
            (left, after * 1e12, predicted * 1e12),
            (right, cumulative_rms(freq, after) * 1e6, cumulative_rms(freq, predicted) * 1e6),
        ):
            panel.add(each.line(freq, found, place))
            panel.add(Line(*seen(freq, linear), each.colour, *_PREDICTED, name=f"{each.name}, predicted, linear"))
        columns[f"{each.name}, simulated (rad^2/Hz)"] = after
        columns[f"{each.name}, predicted (rad^2/Hz)"] = predicted
    left.add(Line(freq[:0], freq[:0], GREY, *_PREDICTED, label="dashed: predicted, linear"))
    left.y.low = _floor(controllers, inner)
    caption = (
        "One-sided spectrum of the line of sight about axis x, on the mission's mirror: the disturbances before the "
        "loop, what is left behind it (simulated, with hysteresis), and what linear theory predicts without. "
        "Right: the rms that has gathered up to each frequency."
    )
    caption += " Lines of the reaction wheel are not in the spectrum before the loop." if _lines(fine) else ""
    title = "Spectrum of the line of sight before and behind the loop"
    return Figure("fine-pointing-spectrum", title, caption, sheet, columns)


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
    """Radial error at the mission's share of the time, by controller and variant of the mirror.

    Args:
        fine: the study.
        m: the mission, for the error that it allows.
    """
    names = [v.design.name for v in fine.verified]
    rows = np.arange(len(names))[::-1]
    sheet, (panel,) = grid(7.6, 1.3 + 0.36 * len(names))
    sheet.legend = Legend("above", 4)
    columns: dict[str, Floats] = {}
    required = m.requirement.pointing_error_rad
    for i, (variant, (marker, colour)) in enumerate(_MARKERS.items()):
        found = {
            name: (row - 0.22 * (i - 1), v.simulated[variant].quantile_rad)
            for name, row, v in zip(names, rows, fine.verified, strict=True)
            if variant in v.simulated
        }
        at, values = np.array([*found.values()]).reshape(-1, 2).T
        edge = BLACK if colour == WHITE else colour
        if values.size:
            panel.add(Line(values * 1e6, at, colour, "", label=NAMES[variant], marker=marker, edge=edge))
        columns |= {f"{name}, {NAMES[variant]} (rad)": np.array([value]) for name, (_, value) in found.items()}
    panel.add(Rule(required * 1e6, True, BLACK, "--", 1.2, f"required: {required * 1e6:g} µrad"))
    panel.y.ticks = {int(row): name for row, name in zip(rows, names, strict=True)}
    panel.y.low, panel.y.high, panel.x.low = -0.6, len(names) - 0.4, 0.0
    panel.x.title = f"radial error at {share_of_time(fine.quantile)} of the time (µrad)"
    caption = (
        f"Simulated radial error that is not exceeded for {share_of_time(fine.quantile)} of the time, by controller "
        "and variant of the mirror."
    )
    return Figure("fine-pointing-errors", "Radial error by controller", caption, sheet, columns)


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
    rows = np.arange(len(bars), dtype=np.float64)[::-1]
    sheet, (panel,) = grid(7.6, 0.9 + 0.28 * len(bars))
    sheet.legend = Legend("above")
    values, theory = (1e6 * np.array([getattr(bar, key) for bar in bars]) for key in ("rms_rad", "theory_rad"))
    for colour in dict.fromkeys(bar.colour for bar in bars):
        of = np.array([bar.colour == colour for bar in bars])
        panel.add(Bars(rows[of], 0.0 * values[of], values[of], np.full(int(of.sum()), 0.65), colour))
    panel.add(Line(theory, rows, BLACK, "", label="theory (linear)", marker="|", size=13.0, edge_width=1.8))
    for row, value, expected in zip(rows, values, theory, strict=True):
        panel.add(Words(micro(value * 1e-6), np.nanmax([value, expected]), row, shift=(5.0, 0.0)))
    for edge in (len(bars) - len(parts), len(changes)):
        panel.add(Rule(edge - 0.5, False, GREY, width=0.8))
    panel.y.ticks, panel.y.grid = {int(row): bar.name for row, bar in zip(rows, bars, strict=True)}, False
    panel.y.low, panel.y.high = -0.6, len(bars) - 0.4
    panel.x.low, panel.x.high, panel.x.title = 0.0, 1.12 * float(np.nanmax([*values, *theory])), "radial rms (µrad)"
    caption = (
        f"Error budget of {b.controller}. Above: each part by itself, simulated without hysteresis. Middle: combined. "
        "Below: what a part changes when it alone is left out of the full loop, as a root of the difference of squares."
    )
    columns = {f"{bar.name} (rad)": np.array([bar.rms_rad]) for bar in bars}
    columns |= {f"{p.name}, theory (rad)": np.array([p.theory_rad]) for p in parts if not math.isnan(p.theory_rad)}
    title = "What the residual is made of"
    return Figure("fine-pointing-budget", title, caption, sheet, columns)


# ------------------------------------------------------------------------------------------------ sensitivity


def sensitivities(fine: FinePointingStudy, m: Mission, controllers: tuple[Shown, ...], parts: Kept = NOTHING) -> Figure:
    """|S| of the same controllers, with the ceiling that the modulus margin asked for puts on it.

    Args:
        fine: the study.
        m: the mission, for the modulus margin that it asks for.
        controllers: those shown.
        parts: the parts that earlier runs have kept.
    """
    half = 0.5 / fine.scene.loop.timing.period_s
    freq = np.geomspace(half * 1e-4, half * 0.999, _SENSITIVITY_POINTS)
    sheet, (whole, peak) = grid(7.6, 3.7, 1, 2)
    sheet.legend = Legend("above", 2)
    columns: dict[str, Floats] = {"frequency (Hz)": freq}
    for place, each in enumerate(controllers):
        size = parts.part(sensitivity_size, fine.scene.loop, each.of.design.controller, freq)
        for panel in (whole, peak):
            panel.add(each.line(freq, size, place))
        columns[each.name] = size
    for panel in (whole, peak):
        panel.x.title, panel.x.log, panel.y.title = "frequency (Hz)", True, "|S|, error over disturbance"
        _ceiling(panel, m)
    whole.y.log, whole.x.low, whole.x.high = True, freq[0], half
    peak.x.low, peak.x.high, peak.y.low = 0.02 * half, half, 0.0
    caption = (
        "Sensitivity of axis x at the control samples, linear, with delay: what the loop leaves of a disturbance at "
        "each frequency. Below 1 it rejects, above 1 it amplifies; the inverse of the modulus margin is its ceiling. "
        "Right: the same about its peak."
    )
    return Figure("fine-pointing-sensitivity", "Sensitivity", caption, sheet, columns)


def sensitivity_size(loop: PointingLoop, controller: LoopController, freq_hz: Floats) -> Floats:
    """|S| of axis x at each frequency, shape (frequencies,): what is left of a disturbance, of 1.

    Args:
        loop: the pointing loop.
        controller: its controller.
        freq_hz: frequencies in Hz, shape (frequencies,).
    """
    return np.asarray(np.abs(sensitivity(close(loop, controller), freq_hz)[:, 0, 0]))


def _ceiling(panel: Panel, m: Mission) -> None:
    panel.add(Rule(1.0, False, GREY, width=0.8))
    if m.fine_pointing is not None:
        margin = m.fine_pointing.modulus_margin
        panel.add(Rule(1.0 / margin, False, BLACK, "--", 1.2, f"1 / modulus margin asked for ({margin:g})"))
