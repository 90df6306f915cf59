"""Figures of a budget of pointing errors: contributions, distributions, and spectra beside what windows count."""

import math
from collections.abc import Mapping, Sequence
from itertools import cycle

import numpy as np

from microrad.core.arrays import Floats
from microrad.link.error_budget.assembly import Judged, PointingErrorBudget
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.report.error_budget import words
from microrad.report.fine_pointing.windows import index_text
from microrad.report.plotting import sheet as sheets
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.palette import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION
from microrad.report.plotting.sheet import WIDTH, Axis, Bars, Dash, Legend, Line, Panel, Rule, Sheet, Words, shortened
from microrad.report.quantities import micro, percent
from microrad.report.tables import Column

_LOOKS: tuple[tuple[str, Dash], ...] = (
    (BLUE, "-"), (VERMILION, "--"), (GREEN, "-."), (ORANGE, ":"), (SKY, (6.0, 1.5, 1.0, 1.5, 1.0, 1.5)), (BLACK, "--"),
)  # fmt: skip
_CLASSES = {
    "constant": BLUE,
    "per-observation": PURPLE,
    "random": ORANGE,
    "process": SKY,
    "periodic": GREEN,
    "drift": VERMILION,
    "transient": BLACK,
    "loop": GREY,
    "others": "#bbbbbb",
}
_ACROSS = 3  # panels of contributions beside each other
_MOST_ROWS = 16  # sources that are drawn by themselves
_ROOM = 1.35  # of the longest bar, with its number
_TAIL = 30.0  # times rarer than a requirement allows, down to where distributions are drawn
_FALL = 1e6  # of a spectrum, below its largest, that is drawn
_ABOUT = 3.0 * (np.arange(96) * (math.sqrt(5.0) - 1.0) / 2.0 % 1.0 - 0.5)  # steps of the scale with one mean weight


def budget_figures(budget: PointingErrorBudget, stacked: bool = False) -> tuple[Figure, ...]:
    """The figures of a budget; that of the spectra where a source has one.

    Args:
        budget: what was found.
        stacked: whether requirements stand below each other, for a page that does not part what stands side by side.
    """
    drawn = contributions(budget.judged, stacked), distributions(budget.judged, stacked)
    return (*drawn, spectra(budget)) if budget.spectra else drawn


# ------------------------------------------------------------------------------------------------ contributions
def contributions(judged: Sequence[Judged], stacked: bool = False) -> Figure:
    """What each source contributes to each total, as bars by its class.

    Args:
        judged: the requirements.
        stacked: whether they stand below each other.
    """
    sources = words.sources(judged)
    parts = [{share.key: share.part_rad for share in each.shares} for each in judged]
    weights = {key: max(_weight(each, own, key) for each, own in zip(judged, parts, strict=True)) for key in sources}
    ranked = sorted(sources, key=lambda key: -weights[key])
    drawn = ranked[: _MOST_ROWS if len(ranked) <= _MOST_ROWS else _MOST_ROWS - 1]
    others = ranked[len(drawn) :]
    texts, kinds = [words.source_shown(sources[key]) for key in drawn], [sources[key].kind for key in drawn]
    looks = [*kinds, "others"] if others else kinds
    names = [shortened(each, 26) for each in (*texts, f"{len(others)} others")][: len(looks)]
    across = 1 if stacked else 2 if len(judged) == _ACROSS + 1 else min(len(judged), _ACROSS)
    down = math.ceil(len(judged) / across)
    sheet = Sheet(WIDTH, 0.4 + down * (0.9 + 0.26 * len(names)), (1.0,) * down, (1.0,) * across, share_y=True)
    sheet.legend = Legend("above", 8)
    columns: dict[str, Column] = {"source": tuple(sources[key].name for key in ranked)}
    for place, (each, own) in enumerate(zip(judged, parts, strict=True)):
        panel = sheet.panel(*divmod(place, across))
        values = [*(own.get(key, 0.0) for key in drawn), sum(own.get(key, 0.0) for key in others)][: len(looks)]
        _bars(panel, 1e6 * np.array(values), looks)
        panel.y, panel.title = sheets.rows(names), shortened(words.shown(each.name), 26)
        panel.x.title, panel.x.most = "contribution (µrad)", 4
        columns[f"contribution to {each.name} (rad)"] = np.array([own.get(key, math.nan) for key in ranked])
    caption = (
        "What each source contributes to the total by the distribution, in the share by which the total grows with it: "
        "the bars of a requirement add up to its total. Colours are the classes."
    )
    return Figure("pointing-errors-contributions", "What each source contributes", caption, sheet, columns)


def _weight(of: Judged, parts: Mapping[tuple[str, str], float], key: tuple[str, str]) -> float:
    return parts.get(key, 0.0) / of.total.quantile_rad if of.total.quantile_rad else 0.0


def _bars(panel: Panel, values: Floats, looks: Sequence[str]) -> None:
    """A bar in each row, with its number."""
    for look in dict.fromkeys(looks):
        at = np.flatnonzero(np.array(looks) == look)
        place, breadth = at.astype(np.float64), np.full(at.size, 0.68)
        panel.add(Bars(place, np.zeros(at.size), values[at], breadth, _CLASSES[look], label=look))
    for row, value in enumerate(values.tolist()):
        panel.add(Words(micro(1e-6 * value), max(value, 0.0), float(row), size=7.5, shift=(3.0, 0.0)))
    panel.x.low, panel.x.high = 1.1 * min(0.0, *values), _ROOM * max(0.0, *values) or 1.0


# ------------------------------------------------------------------------------------------------ distributions
def distributions(judged: Sequence[Judged], stacked: bool = False) -> Figure:
    """How often each error is larger than a size, with its limit and its totals.

    Args:
        judged: the requirements.
        stacked: whether they stand below each other.
    """
    across = 1 if stacked else min(len(judged), 2)
    down = math.ceil(len(judged) / across)
    sheet = Sheet(WIDTH, 0.4 + 2.85 * down, (1.0,) * down, (1.0,) * across, legend=Legend("above", 5))
    columns: dict[str, Column] = {}
    for place, each in enumerate(judged):
        _distribution(sheet.panel(*divmod(place, across)), each)
        columns[f"size, {each.name} (rad)"] = each.size_rad
        columns[f"share beyond it, {each.name}"] = each.beyond
    caption = (
        "Share of the times, satellites or both, as the requirement counts them, with a larger error, by the full "
        "distribution. The dot is the total, where no more than the share that is allowed lies beyond: left of the "
        "limit the requirement is met."
    )
    return Figure("pointing-errors-distribution", "Distribution of each pointing error", caption, sheet, columns)


def _distribution(panel: Panel, of: Judged) -> None:
    total, required = of.total, of.total.required
    allowed, axes = 1.0 - required.confidence, words.AXES[required.axes]
    low = allowed / _TAIL
    beyond = 100.0 * np.maximum(of.beyond, 0.1 * low)
    panel.add(Line(1e6 * of.size_rad, beyond, BLUE, width=1.6, label="larger errors"))
    if required.limit_rad is not None:
        panel.add(Rule(1e6 * required.limit_rad, True, VERMILION, "--", 1.4, "limit"))
    panel.add(Rule(1e6 * total.by_rules_rad, True, GREY, "-.", 1.2, "total by the rules"))
    panel.add(Rule(100.0 * allowed, False, BLACK, ":", 0.9, "share allowed"))
    size, share = np.array([[1e6 * total.quantile_rad], [100.0 * allowed]])
    panel.add(Line(size, share, BLACK, "", label="total by the distribution", marker="o"))
    kept = f"{index_text(required.index)}, {percent(required.confidence, 4)}"
    panel.title = shortened(f"{words.shown(of.name)}: {kept}", 46)
    panel.x = Axis("radial error (µrad)" if axes == "radial" else f"error {axes} (µrad)", low=0.0, most=6)
    panel.x.high = 1e6 * max(float(of.size_rad[-1]), 1.1 * total.by_rules_rad) or 1.0
    panel.y = Axis("larger errors (%)", log=True, low=100.0 * low, high=200.0)


# ------------------------------------------------------------------------------------------------ spectra
def spectra(budget: PointingErrorBudget) -> Figure:
    """Spectra of all axes together above the share of them that each window counts.

    Args:
        budget: what was found, with spectra.
    """
    freq, looks = budget.freq_hz, cycle(_LOOKS)
    sheet = Sheet(WIDTH, 5.2, (1.25, 1.0), share_x=True, legend=Legend("above", 2))
    above, below = sheet.panel(0), sheet.panel(1)
    columns: dict[str, Column] = {"frequency (Hz)": freq}
    for name, density in budget.spectra.items():
        above.add(Line(freq, 1e12 * density, *next(looks), label=shortened(words.shown(name))))
        columns[f"{name} (rad^2/Hz)"] = density
    periodic = shortened(f"periodic: {', '.join(map(words.shown, budget.lines_hz))}", 48)
    above.add(*(Rule(each, True, GREY, ":", 1.2, periodic) for each in budget.lines_hz.values()))
    for index, names in _windows(budget.judged).items():
        label, weight = f"weight of {index_text(index)}", mean_weight(index, freq)
        below.add(Line(freq, weight, *next(looks), label=shortened(f"{label}: {names}", 54)))
        columns[label] = weight
    most = 1e12 * max(float(np.nanmax(density)) for density in budget.spectra.values()) or 1.0
    above.y = Axis("spectrum, all axes (µrad²/Hz)", log=True, low=most / _FALL, high=3.0 * most)
    below.y = Axis("weight of the window (1)", low=0.0)
    above.x, below.x = (Axis(title, log=True, low=freq[0], high=freq[-1]) for title in ("", "frequency (Hz)"))
    caption = (
        "Above: one-sided spectra of the sources that have one, about all axes together. Below: the share of them that "
        "each window counts, where it ripples its mean about a frequency. Of an APE all counts, and of the difference "
        "of two means up to four times as much."
    )
    return Figure("pointing-errors-spectrum", "Spectra of pointing errors and the windows", caption, sheet, columns)


def _windows(judged: Sequence[Judged]) -> dict[ErrorIndex, str]:
    """The indices that have a window, each with the requirements that it is of."""
    found: dict[ErrorIndex, list[str]] = {}
    for each in judged:
        if (index := each.total.required.index).window_s is not None:
            found.setdefault(index, []).append(words.shown(each.name))
    return {index: ", ".join(names) for index, names in found.items()}


def mean_weight(index: ErrorIndex, freq_hz: Floats) -> Floats:
    """The weight of an index about each frequency, shape (frequencies,): the mean of ripples that nobody can see.

    Args:
        index: what counts of an error.
        freq_hz: frequencies (Hz), shape (frequencies,), evenly spaced by their logarithm.
    """
    about = freq_hz[:, None] * (freq_hz[1] / freq_hz[0]) ** _ABOUT
    return np.asarray(index.weight(about.ravel()).reshape(about.shape).mean(axis=1))
