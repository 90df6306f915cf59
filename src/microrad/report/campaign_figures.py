"""The figures of a campaign: its grid, its outputs, the tail, what matters, where rows miss a limit, the worst rows."""

import math
import textwrap
from collections.abc import Iterator, Sequence
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from numpy.typing import NDArray

from microrad.campaign.records import (
    CampaignSummary,
    CellSummary,
    Interval,
    Limit,
    OutputSummary,
    Sensitivity,
    Tail,
    WorstTrace,
)
from microrad.core.arrays import Floats
from microrad.report import campaign_numbers as numbers
from microrad.report import campaign_tables as tables
from microrad.report import campaign_words as words
from microrad.report.campaign_axes import label_of, logarithm, svg_of
from microrad.report.campaign_scale import Scale, scale_of
from microrad.report.day_figures import GREY, PLAIN, WIDTH, short
from microrad.report.figures import BLACK, BLUE, GREEN, ORANGE, SKY, VERMILION, Figure, thin

MOST_INPUTS, MOST_CELLS, MOST_POINTS = 14, 40, 1500
_ACROSS = 3  # panels beside each other
_SMALL: dict[str, Any] = {"fontsize": 8}
_LIMIT: dict[str, Any] = {"color": VERMILION, "linestyle": (0, (5, 2)), "linewidth": 1.4}
_MARKED = ((BLACK, "-"), (GREEN, "--"), (ORANGE, "-."), (BLACK, ":"), (GREY, (0, (8, 2, 2, 2))))


def limit_of(summary: CampaignSummary, output: str) -> Limit | None:
    """The limit of an output."""
    return next((limit for limit in summary.limits if limit.output == output), None)


def _bounds(limit: Limit | None) -> list[tuple[str, float]]:
    """Its sides that are set."""
    if limit is None:
        return []
    return [(side, bound) for side, bound in (("least", limit.least), ("most", limit.most)) if bound is not None]


# ------------------------------------------------------------------------------------------------------- distributions
@rc_context(PLAIN)
def distribution(output: OutputSummary, limit: Limit | None) -> Figure:
    """How an output is spread over the rows, with its limit and some quantiles."""
    scale = scale_of(np.array([output.least, output.most]), output.unit, output.name)
    canvas = Canvas(figsize=(WIDTH, 2.3), layout="constrained")
    axes = canvas.subplots()
    shares = 100.0 * output.counts / output.counts.sum()
    edges = output.edges * scale.factor
    axes.stairs(shares, edges, fill=True, color=SKY)
    axes.stairs(shares, edges, color=BLUE, linewidth=0.8)
    chosen = tables.chosen_quantiles([output], len(_MARKED))
    styles = dict(zip(sorted(chosen, key=lambda p: abs(p - 0.5)), _MARKED, strict=False))
    for p in chosen:
        found, (colour, line) = output.quantiles[p], styles[p]
        if tables.is_known(found):
            label = f"{100.0 * p:.6g} %: {numbers.value(found.value, output.unit, output.name)}"
            axes.axvline(found.value * scale.factor, color=colour, linestyle=line, linewidth=1.1, label=label)
    _mark_limits(axes, limit, output, scale)
    axes.set(xlabel=scale.title(numbers.label(output.name)), ylabel="rows (%)")
    axes.set_ylim(bottom=0.0)
    if axes.get_legend_handles_labels()[0]:  # few rows know no quantile
        canvas.legend(loc="outside right upper", **_SMALL)
    columns = {
        f"{output.name}, lower edge ({output.unit})": output.edges[:-1],
        f"{output.name}, upper edge ({output.unit})": output.edges[1:],
        "rows (%)": shares,
    }
    caption = (
        f"{output.meaning[:1].upper()}{output.meaning[1:]}: share of the rows in each bin, and quantiles over them."
    )
    return Figure(
        f"campaign-{output.name}", f"Distribution of {numbers.label(output.name)}", caption, svg_of(canvas), columns
    )


def _mark_limits(axes: Axes, limit: Limit | None, output: OutputSummary, scale: Scale) -> None:
    """The limit as a line with the side that misses it shaded; in words alone where it is far from all rows."""
    reach = output.edges[-1] - output.edges[0]
    for side, bound in _bounds(limit):
        label = f"limit {numbers.SYMBOL[side]} {numbers.bound(bound, output.unit, output.name)}"
        if output.edges[0] - reach <= bound <= output.edges[-1] + reach:
            axes.axvline(bound * scale.factor, label=label, **_LIMIT)
            low, high = axes.get_xlim()
            span = (low, bound * scale.factor) if side == "least" else (bound * scale.factor, high)
            axes.axvspan(*span, color=VERMILION, alpha=0.1, linewidth=0.0)
            axes.set_xlim(low, high)
        else:
            axes.plot([], [], label=f"{label},\nfar from here", **_LIMIT)


# ---------------------------------------------------------------------------------------------------------------- tail
@rc_context(PLAIN)
def tail(summary: CampaignSummary, cell: CellSummary) -> tuple[Figure, ...]:
    """How likely a radial error is exceeded: with its band in the cell shown, beside it the other cells."""
    if cell.tail is None or not np.any(cell.tail.survival > 0.0):
        return ()
    canvas = Canvas(figsize=(WIDTH, 3.8), layout="constrained")
    axes = canvas.subplots()
    others = [each.tail for each in summary.cells if each is not cell and each.tail is not None]
    for k, other in enumerate(others):
        x, y = _shown(other, other.survival)
        axes.plot(x, y, color=GREY, linewidth=0.7, label="other combinations" if k == 0 else None)
    columns = _tail_band(axes, cell)
    _tail_marks(axes, summary, cell.tail)
    logarithm(axes, "y")
    axes.set(xlabel="radial error (µrad)", ylabel="probability of a larger one")
    axes.set_xlim(left=0.0)
    axes.set_ylim(_floor(cell.tail), 1.0)
    canvas.legend(loc="outside right upper", **_SMALL)
    of = f" of {cell.label}" if cell.values else ""
    caption = (
        f"Probability that the radial error{of} exceeds a radius. {words.tail_method(cell.tail)} Shaded: its "
        f"interval at {100.0 * cell.tail.confidence:g} %."
    )
    return (Figure("campaign-tail", "Tail of the radial error", caption, svg_of(canvas), columns),)


def _shown(tail: Tail, curve: Floats) -> tuple[Floats, Floats]:
    """Radius (µrad) and one of its curves where the error has been seen beyond it."""
    seen = tail.survival > 0.0
    return tail.radius_rad[seen] * 1e6, curve[seen]


def _tail_band(axes: Axes, cell: CellSummary) -> dict[str, Floats]:
    found = cell.tail
    assert found is not None
    x, y = _shown(found, found.survival)
    low, high = (_shown(found, curve)[1] for curve in (found.low, found.high))
    axes.fill_between(x, np.maximum(low, 1e-300), np.minimum(high, 1.0), color=SKY, alpha=0.5, linewidth=0.0)
    axes.plot(x, y, color=BLUE, label=textwrap.fill(cell.label, 24) or "all rows")
    names = ("radius (rad)", "probability", "lower end", "upper end")
    return dict(zip(names, (found.radius_rad, found.survival, found.low, found.high), strict=True))


def _tail_marks(axes: Axes, summary: CampaignSummary, found: Tail) -> None:
    """The radii that were asked for, each with its interval, and the limit of the residual."""
    for (p, radius), (colour, marker) in zip(
        found.wanted.items(), zip(cycle((VERMILION, GREEN, BLACK)), cycle("osD")), strict=False
    ):
        if math.isfinite(radius.value):
            span = None if not numbers.ends(radius, "rad") else _arms([radius], 1e6)
            label = f"{numbers.share(p)}: {numbers.value(radius.value, 'rad')}"
            axes.errorbar(radius.value * 1e6, p, xerr=span, fmt=marker, color=colour, capsize=3, label=label, zorder=4)
    limits = [limit for limit in summary.limits if limit.most is not None and limit.output.startswith("residual")]
    for bound in sorted({limit.most for limit in limits if limit.most is not None})[:1]:
        if bound <= 2.0 * float(found.radius_rad[found.survival > 0.0].max()):
            axes.axvline(bound * 1e6, label=f"limit ≤ {numbers.bound(bound, 'rad')}", **_LIMIT)
        else:
            axes.plot([], [], label=f"limit ≤ {numbers.bound(bound, 'rad')},\nfar from here", **_LIMIT)


def _floor(found: Tail) -> float:
    """Lower end of the axis: the decade below the least probability that is seen or asked for."""
    least = min(float(found.survival[found.survival > 0.0].min()), *(p for p in found.wanted), 0.1)
    return float(10.0 ** max(math.floor(math.log10(least)) - 0.3, -15.0))


def _arms(found: Sequence[Interval], factor: float = 1.0) -> NDArray[np.float64]:
    """Lengths of error bars (2, n) downwards and upwards; none where an interval is not known."""
    arms = np.array([(i.value - i.low, i.high - i.value) for i in found]).reshape(-1, 2).T
    return np.asarray(np.where(np.isfinite(arms), np.maximum(arms, 0.0), 0.0) * factor)


# --------------------------------------------------------------------------------------------------------- sensitivity
def sensitivity(summary: CampaignSummary) -> tuple[Figure, ...]:
    """Sobol indices of the inputs, a panel for each output; outputs that no input moves have none."""
    found = [s for s in summary.sensitivities if tables.ranked(s)]
    if not found:
        return ()
    size = {key: max(dict(tables.ranked(s)).get(key, _NONE).value for s in found) for s in found for key in s.first}
    keys = sorted(size, key=lambda key: -size[key])
    groups = [found[k : k + _ACROSS] for k in range(0, len(found), _ACROSS)]
    return tuple(_sensitivity(group, keys, size, k + 1, summary) for k, group in enumerate(groups))


_NONE = Interval(-math.inf, math.nan, math.nan, 0.0)


@rc_context(PLAIN)
def _sensitivity(
    group: Sequence[Sensitivity], keys: Sequence[str], size: dict[str, float], number: int, summary: CampaignSummary
) -> Figure:
    shown = keys[:MOST_INPUTS]
    canvas = Canvas(figsize=(WIDTH, 1.2 + 0.36 * len(shown)), layout="constrained")
    panels = canvas.subplots(1, len(group), sharey=True, squeeze=False)[0]
    for axes, each in zip(panels, group, strict=True):
        _index_bars(axes, each, shown)
    panels[0].set_yticks(range(len(shown)), [label_of(key, keys) for key in shown], **_SMALL)
    panels[0].set_ylim(len(shown) - 0.4, -0.6)
    handles = {
        label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    canvas.legend(handles.values(), handles.keys(), loc="outside upper right", ncols=2, **_SMALL)
    columns = {
        f"{each.output}, {key}, {kind} index": np.array([i.value, i.low, i.high])
        for each in group
        for kind, indices in (("first", each.first), ("total", each.total))
        for key, i in indices.items()
    }
    notes = [f"{each.output}: {each.note}" for each in group if each.note]
    of = f" of {summary.cells[0].label}" if summary.cells[0].values else ""
    caption = (
        f"Sobol indices{of} from {min(each.rows for each in group)} rows: the share of an output's variance that an "
        "input makes by itself (first order), and with all its interactions (total); with intervals."
        + ("".join(f" {note}." for note in notes))
        + (
            f" {len(keys) - len(shown)} inputs with smaller indices are in the table only."
            if len(keys) > len(shown)
            else ""
        )
    )
    names = ", ".join(each.output for each in group)
    return Figure(f"campaign-sensitivity-{number}", f"What matters to {names}", caption, svg_of(canvas), columns)


def _index_bars(axes: Axes, each: Sensitivity, shown: Sequence[str]) -> None:
    both = (("first order", each.first, BLUE), ("total", each.total, ORANGE))
    drawn = [kind for kind in both if kind[1]]
    high = 0.76 / len(drawn)
    for k, (label, indices, colour) in enumerate(drawn):
        rows = [(row, indices[key]) for row, key in enumerate(shown) if key in indices and _known(indices[key])]
        at = np.array([row for row, _ in rows]) - 0.38 + high * (k + 0.5)
        values = [max(i.value, 0.0) for _, i in rows]
        arms = _arms(
            [
                Interval(v, max(i.low, 0.0), max(i.high, 0.0), i.confidence)
                for v, (_, i) in zip(values, rows, strict=True)
            ]
        )
        axes.barh(at, values, height=high, color=colour, label=label)
        axes.errorbar(values, at, xerr=arms, fmt="none", ecolor=BLACK, elinewidth=0.9, capsize=1.5)
    axes.set_title(short(each.output, 30), fontsize=9, loc="left")
    axes.set_xlabel("index")
    axes.set_xlim(0.0, 1.05)
    axes.set_xticks([0.0, 0.5, 1.0])
    axes.grid(visible=False, axis="y")


def _known(interval: Interval) -> bool:
    return math.isfinite(interval.value)


# ------------------------------------------------------------------------------------------------------ failure region
@rc_context(PLAIN)
def region(summary: CampaignSummary, limit: Limit, number: int, inputs: Sequence[str], note: str = "") -> Figure:
    """Rows of a cell that keep and that miss a limit, over two inputs, or over one with the output beside it.

    ``note`` ends the caption.
    """
    cell, units = summary.cells[number], {each.key: each.unit for each in summary.inputs}
    rows = np.flatnonzero(summary.sample["cell"] == number)
    rows = rows[:: max(-(-rows.size // MOST_POINTS), 1)]
    columns = {key: summary.sample[key][rows] for key in (*inputs, limit.output)}
    output = cell.outputs[limit.output]
    axes_of = [(label_of(key, list(units)), columns[key], units.get(key, "")) for key in inputs]
    if len(inputs) == 1:
        axes_of.append((numbers.label(limit.output), columns[limit.output], output.unit))
    svg = _scatter(axes_of, limit, columns[limit.output], output, second=len(inputs) == 1)
    of = f" of {cell.label}" if cell.values else ""
    caption = (
        f"{rows.size} rows{of}: those that keep {numbers.limit_text(limit, output.unit)} and those that miss it, over "
        f"{' and '.join(inputs)}{_mattering(summary, limit.output, inputs)}. Of all rows "
        f"{numbers.share(cell.missed_by[limit.output].value)} miss it.{note}"
    )
    return Figure("campaign-region", f"Where {numbers.label(limit.output)} misses its limit", caption, svg, columns)


def _mattering(summary: CampaignSummary, output: str, inputs: Sequence[str]) -> str:
    """That the inputs matter most to an output, where that is known of each."""
    if not set(inputs) <= set(words.leading(summary, output)):
        return ""
    return ", the inputs that matter most to it" if len(inputs) > 1 else ", the input that matters most to it"


def _scatter(
    axes_of: Sequence[tuple[str, Floats, str]], limit: Limit, values: Floats, output: OutputSummary, *, second: bool
) -> str:
    canvas = Canvas(figsize=(WIDTH, 4.0), layout="constrained")
    axes = canvas.subplots()
    scales = [
        scale_of(column, unit, limit.output if second and k else "") for k, (_, column, unit) in enumerate(axes_of)
    ]
    x, y = (column * scale.factor for (_, column, _), scale in zip(axes_of, scales, strict=True))
    low = -math.inf if limit.least is None else limit.least
    high = math.inf if limit.most is None else limit.most
    failed, missed = np.isnan(values), (values < low) | (values > high)
    kinds = (("kept", ~(failed | missed), "o", BLUE, 9), ("missed", missed, "x", VERMILION, 22))
    for label, which, marker, colour, size in (*kinds, ("no results", failed & np.isfinite(y), "^", GREY, 22)):
        if which.any():
            axes.scatter(x[which], y[which], size, colour, marker=marker, label=label, linewidths=1.0)
    if second:
        for side, bound in _bounds(limit):
            label = f"limit {numbers.SYMBOL[side]} {numbers.bound(bound, output.unit, output.name)}"
            axes.axhline(bound * scales[1].factor, label=label, **_LIMIT)
    titles = [scale.title(name.replace("\n", "")) for (name, _, _), scale in zip(axes_of, scales, strict=True)]
    axes.set(xlabel=titles[0], ylabel=titles[1])
    for which_axis, (_, column, _) in zip("xy", axes_of, strict=True):
        if _wide(column):
            logarithm(axes, which_axis)
    canvas.legend(loc="outside right upper", **_SMALL)
    return svg_of(canvas)


def _wide(column: Floats) -> bool:
    """Whether values are spread over decades."""
    known = column[np.isfinite(column)]
    return bool(known.size and known.min() > 0.0 and known.max() > 30.0 * known.min())


# ---------------------------------------------------------------------------------------------------------------- grid
_WHAT = ("value", "low", "high")


class Panel(NamedTuple):
    """A number of each cell: its title, the scale, and by cell the interval drawn (nan where there is none)."""

    name: str
    scale: Scale
    of: Sequence[Interval]


@rc_context(PLAIN)
def grid(summary: CampaignSummary) -> tuple[Figure, ...]:
    """What the rows come to over the values of the grid: maps for two keys, else a row for each combination."""
    keys = list(dict.fromkeys(key for cell in summary.cells for key in cell.values))
    if not keys or len(summary.cells) < 2:
        return ()
    panels = list(_panels(summary, summary.cells))
    levels = [list(dict.fromkeys(cell.values[key] for cell in summary.cells)) for key in keys]
    maps = len(keys) == 2 and min(map(len, levels)) > 1 and max(map(len, levels)) <= 12 and min(map(len, levels)) <= 8
    svg = _maps(summary, keys, levels, panels[:2]) if maps else _dots(summary, keys, panels)
    columns = {f"{p.name}, {what}": np.array([getattr(i, what) for i in p.of]) for p in panels for what in _WHAT}
    shown = (
        "a number in each field"
        if maps
        else "bars: intervals of a share, else from the known quantiles nearest to 1 % and 99 %, or of all values"
    )
    caption = f"Over {' and '.join(keys)}: {', '.join(p.name for p in panels[: 2 if maps else None])}; {shown}."
    if not maps and len(summary.cells) > MOST_CELLS:
        caption += f" The first {MOST_CELLS} of {len(summary.cells)} combinations."
    return (Figure("campaign-grid", "Over the grid", caption, svg, columns),)


def _panels(summary: CampaignSummary, cells: Sequence[CellSummary]) -> Iterator[Panel]:
    """The share of rows that miss a limit, and medians of the outputs that have one, of two others where none has."""
    limited = [limit.output for limit in summary.limits]
    unknown = Interval(math.nan, math.nan, math.nan, 0.0)
    if limited:
        missed = [cell.missed if tables.good(cell) else unknown for cell in cells]
        yield Panel("rows that miss a limit", Scale(100.0, "%"), missed)
    names = [name for name in dict.fromkeys(limited) if any(name in cell.outputs for cell in cells)]
    for name in (names or list(dict.fromkeys(o for cell in cells for o in cell.outputs)))[: _ACROSS - bool(limited)]:
        spans = [_span(cell.outputs[name]) if name in cell.outputs else unknown for cell in cells]
        every = np.array([[getattr(span, what) for what in _WHAT] for span in spans])
        yield Panel(f"median {numbers.label(name)}", scale_of(every, tables.unit_of(summary, name), name), spans)


def _span(output: OutputSummary) -> Interval:
    """Median, with the known quantiles nearest to 1 % and 99 %; with all values where none are known."""
    if not output.rows or 0.5 not in output.quantiles:
        return Interval(output.mean.value, output.least, output.most, 0.0)
    known = [p for p, quantile in output.quantiles.items() if tables.is_known(quantile) and p != 0.5]
    ends = {
        p < 0.5: min((q for q in known if (q < 0.5) == (p < 0.5)), key=lambda q: abs(q - p), default=None)
        for p in (0.01, 0.99)
    }
    low, high = ends[True], ends[False]
    first = output.least if low is None else output.quantiles[low].value
    last = output.most if high is None else output.quantiles[high].value
    return Interval(output.quantiles[0.5].value, first, last, 0.98)


def _dots(summary: CampaignSummary, keys: Sequence[str], panels: Sequence[Panel]) -> str:
    cells = summary.cells[:MOST_CELLS]
    rows = np.arange(len(cells))
    canvas = Canvas(figsize=(WIDTH, 1.0 + 0.24 * len(cells)), layout="constrained")
    for axes, panel in zip(canvas.subplots(1, len(panels), sharey=True, squeeze=False)[0], panels, strict=True):
        found = panel.of[: len(cells)]
        values = np.array([i.value for i in found]) * panel.scale.factor
        arms = _arms(found, panel.scale.factor)
        axes.errorbar(values, rows, xerr=arms, fmt="o", color=BLUE, capsize=2, markersize=4.5)
        _limit_line(axes, summary, panel)
        axes.set_xlabel("\n".join(textwrap.wrap(panel.scale.title(panel.name), 28)))
        axes.grid(visible=True, axis="x")
        axes.set_yticks(rows, [short(", ".join(cell.values.values()), 34) for cell in cells])
        axes.set_ylim(len(cells) - 0.4, -0.6)
    canvas.suptitle(short(", ".join(label_of(key, keys) for key in keys), 90), x=0.01, ha="left", fontsize=9)
    return svg_of(canvas)


def _limit_line(axes: Axes, summary: CampaignSummary, panel: Panel) -> None:
    """The limit of the output of a panel, where it is near what is drawn."""
    low, high = axes.get_xlim()
    named = {f"median {numbers.label(limit.output)}": limit for limit in summary.limits}
    limit = named.get(panel.name)
    for _, bound in _bounds(limit):
        if low - (high - low) <= bound * panel.scale.factor <= high + (high - low):
            axes.axvline(bound * panel.scale.factor, **_LIMIT)


def _maps(
    summary: CampaignSummary, keys: Sequence[str], levels: Sequence[Sequence[str]], panels: Sequence[Panel]
) -> str:
    across = 0 if len(levels[0]) < len(levels[1]) else 1
    down = 1 - across
    canvas = Canvas(figsize=(WIDTH, 1.2 + 0.32 * max(len(levels[down]), 3)), layout="constrained")
    for number, (axes, panel) in enumerate(
        zip(canvas.subplots(1, len(panels), sharey=True, squeeze=False)[0], panels, strict=True)
    ):
        field = np.full((len(levels[down]), len(levels[across])), np.nan)
        for cell, found in zip(summary.cells, panel.of, strict=True):
            at = levels[down].index(cell.values[keys[down]]), levels[across].index(cell.values[keys[across]])
            field[at] = found.value * panel.scale.factor
        _field(axes, field)
        axes.set_title(panel.scale.title(panel.name), fontsize=9, loc="left")
        axes.set_xticks(range(len(levels[across])), [short(text, 12) for text in levels[across]], **_SMALL)
        axes.set_xlabel(label_of(keys[across], keys).replace("\n", ""))
        if number == 0:
            axes.set_yticks(range(len(levels[down])), [short(text, 24) for text in levels[down]], **_SMALL)
            axes.set_ylabel(label_of(keys[down], keys))
    return svg_of(canvas)


def _field(axes: Axes, field: Floats) -> None:
    """Coloured fields with their number in each; hatched grey where there is none."""
    known = field[np.isfinite(field)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    axes.set_facecolor("#dddddd")
    axes.imshow(field, cmap="cividis", aspect="auto", vmin=low, vmax=high if high > low else low + 1.0)
    for (row, column), number in np.ndenumerate(field):
        dark = math.isfinite(number) and number < 0.5 * (low + high if high > low else 2.0 * low + 1.0)
        shown = f"{number:.3g}" if math.isfinite(number) else "none"
        axes.text(column, row, shown, ha="center", va="center", color="white" if dark else "black", fontsize=8)
    axes.grid(visible=False)


# --------------------------------------------------------------------------------------------------------------- worst
@rc_context(PLAIN)
def worst(summary: CampaignSummary, trace: WorstTrace, number: int) -> Figure:
    """The ``number``-th worst row, from 1: radial error and drive over time."""
    canvas = Canvas(figsize=(WIDTH, 3.4), layout="constrained")
    above, below = canvas.subplots(2, 1, sharex=True, height_ratios=(1.3, 1))
    error = np.reshape(trace.error_rad, (trace.time_s.size, -1))
    radial = np.hypot.reduce(error, axis=1) if error.shape[1] > 1 else np.abs(error[:, 0])
    rest = float(radial[radial.size // 20 :].max())
    cut = radial.max() > 3.0 * rest > 0.0  # where the loop only closes, nothing else could be seen
    scale = scale_of(np.array([rest if cut else radial.max()]), "rad")
    above.plot(*thin(trace.time_s, radial * scale.factor), color=BLUE, linewidth=0.8)
    above.set(ylabel=scale.title("radial error"), xlim=(trace.time_s[0], trace.time_s[-1]))
    above.set_ylim(0.0, 1.1 * rest * scale.factor if cut else None)
    columns = {"time (s)": trace.time_s, "radial error (rad)": radial}
    drive = np.reshape(trace.drive_v, (trace.time_s.size, -1))
    for k, (column, colour) in enumerate(zip(drive.T, (BLUE, ORANGE, GREEN, SKY), strict=False)):
        below.plot(*thin(trace.time_s, column), color=colour, linewidth=0.8, label=f"drive {k + 1}")
        columns[f"drive {k + 1} (V)"] = column
    below.set(xlabel="time (s)", ylabel="drive (V)")
    if drive.shape[1] > 1:
        canvas.legend(*below.get_legend_handles_labels(), loc="outside right lower", **_SMALL)
    cell, unit = summary.cells[trace.cell], tables.unit_of(summary, trace.output)
    of = f" of {cell.label}" if cell.values else ""
    found = numbers.value(trace.value, unit, trace.output)
    caption = f"Row {trace.row}{of}: of its rows the {_rank(number)}in {trace.output}, {found}."
    caption += " Shown is the first run of the row's."
    caption += f" Its begin, up to {numbers.value(float(radial.max()), 'rad')}, is cut off." if cut else ""
    return Figure(
        f"campaign-worst-{trace.cell + 1}-{number}",
        f"{_rank(number).capitalize()}row in time",
        caption,
        svg_of(canvas),
        columns,
    )


def _rank(number: int) -> str:
    """How bad a row is, in words."""
    return (
        ("", "second ", "third ", "fourth ", "fifth ", "sixth ")[number - 1] + "worst "
        if number <= 6
        else f"{number}th worst "
    )
