"""The figures of a campaign: its grid, its outputs, the tail, what matters, where rows miss a limit, the worst rows."""

import math
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np

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
from microrad.report.campaign import numbers, tables, words
from microrad.report.campaign.numbers import Scale, scale_of
from microrad.report.plotting import scales
from microrad.report.plotting import sheet as sheets
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.palette import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILION, WHITE
from microrad.report.plotting.sheet import (
    WIDTH,
    Axis,
    Bars,
    Dash,
    Field,
    Legend,
    Line,
    Panel,
    Rule,
    Sheet,
    Span,
    Words,
    between,
    shortened,
    stairs,
)
from microrad.report.quantities import are, counted, plain

MOST_INPUTS, MOST_CELLS, MOST_POINTS = 14, 40, 1500
_ACROSS = 3  # panels beside each other
_LABEL = 30  # characters
_NONE = np.empty(0)
_LIMIT: dict[str, Any] = {"colour": VERMILION, "dash": (5.0, 2.0), "width": 1.4}
_DASHES: tuple[Dash, ...] = ("-", "--", "-.", ":", (8.0, 2.0, 2.0, 2.0))
_MARKED = tuple(zip((BLACK, GREEN, ORANGE, BLACK, GREY), _DASHES, strict=True))


def label_of(key: str, keys: Sequence[str]) -> str:
    """The end of a dotted key that tells it from the others, two parts at least, on lines that leave room for data.

    Args:
        key: the dotted key.
        keys: all keys that it is told from, itself among them.
    """
    parts = key.split(".")
    for count in range(2, len(parts)):
        tail_ = ".".join(parts[-count:])
        if sum(other == tail_ or other.endswith(f".{tail_}") for other in keys) == 1:
            break
    else:
        count = len(parts)
    whole = shortened(".".join(parts[-count:]), 90)
    return textwrap.fill(whole.replace(".", ". "), _LABEL, max_lines=2, placeholder="…").replace(". ", ".")


def limit_of(summary: CampaignSummary, output: str) -> Limit | None:
    """The limit of an output; None where it has none.

    Args:
        summary: the campaign.
        output: name of the output.
    """
    return next((limit for limit in summary.limits if limit.output == output), None)


def _bounds(limit: Limit | None) -> list[tuple[str, float]]:
    """Its sides that are set."""
    if limit is None:
        return []
    return [(side, bound) for side, bound in (("least", limit.least), ("most", limit.most)) if bound is not None]


# ------------------------------------------------------------------------------------------------------- distributions
def distribution(output: OutputSummary, limit: Limit | None) -> Figure:
    """How an output is spread over the rows, with its limit and some quantiles.

    Args:
        output: the output over the rows of a cell.
        limit: its limit, if it has one.
    """
    scale = scale_of(np.array([output.least, output.most]), output.unit, output.name)
    sheet, (panel,) = sheets.grid(WIDTH, 2.3)
    sheet.legend = Legend("upper right")
    shares = 100.0 * output.counts / output.counts.sum()
    panel.x, panel.y = Axis(scale.title(numbers.label(output.name))), Axis("rows (%)", low=0.0)
    panel.add(*stairs(output.edges * scale.factor, shares, SKY, BLUE))
    chosen = tables.chosen_quantiles([output], len(_MARKED))
    styles = dict(zip(sorted(chosen, key=lambda p: abs(p - 0.5)), _MARKED, strict=False))
    for p in chosen:
        found, (colour, dash) = output.quantiles[p], styles[p]
        if tables.is_known(found):
            label = f"{100.0 * p:.6g} %: {numbers.value(found.value, output.unit, output.name)}"
            panel.add(Rule(found.value * scale.factor, True, colour, dash, 1.1, label))
    _mark_limits(panel, limit, output, scale)
    columns = {
        f"{output.name}, lower edge ({output.unit})": output.edges[:-1],
        f"{output.name}, upper edge ({output.unit})": output.edges[1:],
        "rows (%)": shares,
    }
    meaning = f"{output.meaning[:1].upper()}{output.meaning[1:]}"
    caption = f"{meaning}: share of the rows in each bin, and quantiles over them."
    return Figure(f"campaign-{output.name}", f"Distribution of {numbers.label(output.name)}", caption, sheet, columns)


def _mark_limits(panel: Panel, limit: Limit | None, output: OutputSummary, scale: Scale) -> None:
    """The limit as a line with the side that misses it shaded; in words alone where it is far from all rows."""
    reach = output.edges[-1] - output.edges[0]
    for side, bound in _bounds(limit):
        label, at = _limit_label(side, bound, output.unit, output.name), bound * scale.factor
        if output.edges[0] - reach <= bound <= output.edges[-1] + reach:
            span = (-math.inf, at) if side == "least" else (at, math.inf)
            panel.add(Rule(at, True, label=label, **_LIMIT), Span(*span, True, VERMILION, 0.1))
        else:
            panel.add(_far(label))


def _limit_label(side: str, bound: float, unit: str, name: str) -> str:
    return f"limit {numbers.SYMBOL[side]} {numbers.bound(bound, unit, name)}"


def _far(label: str) -> Line:
    """A limit in the legend alone."""
    return Line(_NONE, _NONE, label=f"{label},\nfar from here", **_LIMIT)


# ---------------------------------------------------------------------------------------------------------------- tail
def tail(summary: CampaignSummary, cell: CellSummary) -> tuple[Figure, ...]:
    """How likely a radial error is exceeded: with its band in the cell shown, beside it the other cells.

    Nothing for a cell without a tail.

    Args:
        summary: the campaign.
        cell: the cell whose band is shown, one of the campaign's.
    """
    if cell.tail is None or not np.any(cell.tail.survival > 0.0):
        return ()
    sheet, (panel,) = sheets.grid(WIDTH, 3.8)
    sheet.legend = Legend("upper right")
    panel.x = Axis("radial error (µrad)", low=0.0)
    panel.y = Axis("probability of a larger one", log=True, low=_floor(cell.tail), high=1.0)
    others = [each.tail for each in summary.cells if each is not cell and each.tail is not None]
    panel.add(*(Line(*_shown(t, t.survival), GREY, width=0.7, label="other combinations") for t in others))
    columns = _tail_band(panel, cell)
    _tail_marks(panel, summary, cell.tail)
    of = f" of {cell.label}" if cell.values else ""
    caption = (
        f"Probability that the radial error{of} exceeds a radius. {words.tail_method(cell.tail)} Shaded: its "
        f"interval at {100.0 * cell.tail.confidence:g} %."
    )
    return (Figure("campaign-tail", "Tail of the radial error", caption, sheet, columns),)


def _shown(tail: Tail, curve: Floats) -> tuple[Floats, Floats]:
    """Radius (µrad) and one of its curves where the error has been seen beyond it."""
    seen = tail.survival > 0.0
    return tail.radius_rad[seen] * 1e6, curve[seen]


def _tail_band(panel: Panel, cell: CellSummary) -> dict[str, Floats]:
    found = cell.tail
    assert found is not None
    x, y = _shown(found, found.survival)
    low, high = (_shown(found, curve)[1] for curve in (found.low, found.high))
    panel.add(between(x, np.maximum(low, 1e-300), np.minimum(high, 1.0), SKY, 0.5))
    panel.add(Line(x, y, BLUE, label=textwrap.fill(cell.label, 24) or "all rows"))
    names = ("radius (rad)", "probability", "lower end", "upper end")
    return dict(zip(names, (found.radius_rad, found.survival, found.low, found.high), strict=True))


def _tail_marks(panel: Panel, summary: CampaignSummary, found: Tail) -> None:
    """The radii that were asked for, each with its interval, and the limit of the residual."""
    looks = zip(cycle((VERMILION, GREEN, BLACK)), cycle("osD"))
    for (p, radius), (colour, marker) in zip(found.wanted.items(), looks, strict=False):
        if math.isfinite(radius.value):
            at = np.array([radius.value * 1e6]), np.array([p])
            arms = _arms([radius], 1e6) if numbers.ends(radius, "rad") else None
            label = f"{numbers.share(p)}: {numbers.value(radius.value, 'rad')}"
            panel.add(Line(*at, colour, "", label=label, marker=marker, x_arms=arms))
    residuals = [limit.most for limit in summary.limits if limit.output.startswith("residual")]
    for bound in sorted(most for most in residuals if most is not None)[:1]:
        label = _limit_label("most", bound, "rad", "")
        near = bound <= 2.0 * float(found.radius_rad[found.survival > 0.0].max())
        panel.add(Rule(bound * 1e6, True, label=label, **_LIMIT) if near else _far(label))


def _floor(found: Tail) -> float:
    """Lower end of the axis: the decade below the least probability that is seen or asked for."""
    least = min(float(found.survival[found.survival > 0.0].min()), *(p for p in found.wanted), 0.1)
    return float(10.0 ** max(math.floor(math.log10(least)) - 0.3, -15.0))


def _arms(found: Sequence[Interval], factor: float = 1.0) -> Floats:
    """Lengths of error bars (2, n) downwards and upwards; none where an interval is not known."""
    arms = np.array([(i.value - i.low, i.high - i.value) for i in found]).reshape(-1, 2).T
    return np.asarray(np.where(np.isfinite(arms), np.maximum(arms, 0.0), 0.0) * factor)


# --------------------------------------------------------------------------------------------------------- sensitivity
def sensitivity(summary: CampaignSummary) -> tuple[Figure, ...]:
    """Sobol indices of the inputs, a panel for each output; outputs that no input moves have none."""
    found = [s for s in summary.sensitivities if tables.ranked(s)]
    if not found:
        return ()
    size = {key: max(dict(tables.ranked(s)).get(key, _UNRANKED).value for s in found) for s in found for key in s.first}
    keys = sorted(size, key=lambda key: -size[key])
    groups = [found[k : k + _ACROSS] for k in range(0, len(found), _ACROSS)]
    return tuple(_sensitivity(group, keys, k + 1, summary) for k, group in enumerate(groups))


_UNRANKED = Interval(-math.inf, math.nan, math.nan, 0.0)


def _sensitivity(group: Sequence[Sensitivity], keys: Sequence[str], number: int, summary: CampaignSummary) -> Figure:
    shown = keys[:MOST_INPUTS]
    sheet, panels = sheets.grid(WIDTH, 1.2 + 0.36 * len(shown), 1, len(group), share_y=True)
    sheet.legend = Legend("above", 2)
    for panel, each in zip(panels, group, strict=True):
        panel.title = shortened(each.output, 30)
        panel.x = Axis("index", low=0.0, high=1.05, ticks=(0.0, 0.5, 1.0))
        panel.y = sheets.rows([label_of(key, keys) for key in shown])
        panel.add(*_index_bars(each, shown))
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
        + "".join(f" {note}." for note in notes)
    )
    if more := len(keys) - len(shown):
        caption += f" {counted(more, 'input')} with smaller indices {are(more)} in the table only."
    names = ", ".join(each.output for each in group)
    return Figure(f"campaign-sensitivity-{number}", f"What matters to {names}", caption, sheet, columns)


def _index_bars(each: Sensitivity, shown: Sequence[str]) -> Iterator[Bars | Line]:
    both = (("first order", each.first, BLUE), ("total", each.total, ORANGE))
    drawn = [kind for kind in both if kind[1]]
    high = 0.76 / len(drawn)
    for k, (label, indices, colour) in enumerate(drawn):
        rows = [(row, indices[key]) for row, key in enumerate(shown) if key in indices and _known(indices[key])]
        at = np.array([row for row, _ in rows]) - 0.38 + high * (k + 0.5)
        values, low, highest = np.maximum([(i.value, i.low, i.high) for _, i in rows], 0.0).reshape(-1, 3).T
        yield Bars(at, np.zeros(at.size), values, np.full(at.size, high), colour, label=label)
        arms = _arms([Interval(*ends, 0.0) for ends in zip(values, low, highest, strict=True)])
        yield Line(values, at, dash="", label=label, marker=".", size=1.0, x_arms=arms)


def _known(interval: Interval) -> bool:
    return math.isfinite(interval.value)


# ------------------------------------------------------------------------------------------------------ failure region
def region(summary: CampaignSummary, limit: Limit, number: int, inputs: Sequence[str], note: str = "") -> Figure:
    """Rows of a cell that keep and that miss a limit, over two inputs, or over one with the output beside it.

    Args:
        summary: the campaign; its sample has the inputs and the output.
        limit: the limit.
        number: number of the cell, from 0.
        inputs: keys of one or two inputs.
        note: a sentence that ends the caption, with a space before it.
    """
    cell, units = summary.cells[number], {each.key: each.unit for each in summary.inputs}
    rows = np.flatnonzero(summary.sample["cell"] == number)
    rows = rows[:: max(-(-rows.size // MOST_POINTS), 1)]
    columns = {key: summary.sample[key][rows] for key in (*inputs, limit.output)}
    output = cell.outputs[limit.output]
    axes_of = [(label_of(key, list(units)), columns[key], units.get(key, "")) for key in inputs]
    if len(inputs) == 1:
        axes_of.append((numbers.label(limit.output), columns[limit.output], output.unit))
    sheet = _scatter(axes_of, limit, columns[limit.output], output, second=len(inputs) == 1)
    of = f" of {cell.label}" if cell.values else ""
    caption = (
        f"{rows.size} rows{of}: those that keep {numbers.limit_text(limit, output.unit)} and those that miss it, over "
        f"{' and '.join(inputs)}{_mattering(summary, limit.output, inputs)}. Of all rows "
        f"{numbers.share(cell.missed_by[limit.output].value)} miss it.{note}"
    )
    return Figure("campaign-region", f"Where {numbers.label(limit.output)} misses its limit", caption, sheet, columns)


def _mattering(summary: CampaignSummary, output: str, inputs: Sequence[str]) -> str:
    """That the inputs matter most to an output, where that is known of each."""
    if not set(inputs) <= set(words.leading(summary, output)):
        return ""
    return ", the inputs that matter most to it" if len(inputs) > 1 else ", the input that matters most to it"


def _scatter(
    axes_of: Sequence[tuple[str, Floats, str]], limit: Limit, values: Floats, output: OutputSummary, *, second: bool
) -> Sheet:
    sheet, (panel,) = sheets.grid(WIDTH, 4.0)
    sheet.legend = Legend("upper right")
    named = ("", limit.output if second else "")
    scales_ = [scale_of(column, unit, name) for (_, column, unit), name in zip(axes_of, named, strict=True)]
    x, y = (column * scale.factor for (_, column, _), scale in zip(axes_of, scales_, strict=True))
    low = -math.inf if limit.least is None else limit.least
    high = math.inf if limit.most is None else limit.most
    failed, missed = np.isnan(values), (values < low) | (values > high)
    kinds = (("kept", ~(failed | missed), "o", BLUE, 3.0), ("missed", missed, "x", VERMILION, 4.7))
    for label, which, marker, colour, size in (*kinds, ("no results", failed & np.isfinite(y), "^", GREY, 4.7)):
        if which.any():
            panel.add(Line(x[which], y[which], colour, "", label=label, marker=marker, size=size))
    if second:
        for side, bound in _bounds(limit):
            label = _limit_label(side, bound, output.unit, output.name)
            panel.add(Rule(bound * scales_[1].factor, False, label=label, **_LIMIT))
    panel.x, panel.y = (
        Axis(scale.title(name.replace("\n", "")), log=_wide(column))
        for (name, column, _), scale in zip(axes_of, scales_, strict=True)
    )
    return sheet


def _wide(column: Floats) -> bool:
    """Whether values are spread over decades."""
    known = column[np.isfinite(column)]
    return bool(known.size and known.min() > 0.0 and known.max() > 30.0 * known.min())


# ---------------------------------------------------------------------------------------------------------------- grid
_WHAT = ("value", "low", "high")


class Shown(NamedTuple):
    """A number of each cell: its title, the scale, and by cell the interval drawn (nan where there is none)."""

    name: str
    scale: Scale
    of: Sequence[Interval]


def grid(summary: CampaignSummary) -> tuple[Figure, ...]:
    """What the rows come to over the values of the grid: maps for two keys, else a row for each combination."""
    keys = list(dict.fromkeys(key for cell in summary.cells for key in cell.values))
    if not keys or len(summary.cells) < 2:
        return ()
    shown = list(_shown_cells(summary, summary.cells))
    levels = [list(dict.fromkeys(cell.values[key] for cell in summary.cells)) for key in keys]
    maps = len(keys) == 2 and min(map(len, levels)) > 1 and max(map(len, levels)) <= 12 and min(map(len, levels)) <= 8
    sheet = _maps(summary, keys, levels, shown[:2]) if maps else _dots(summary, keys, shown)
    columns = {f"{p.name}, {what}": np.array([getattr(i, what) for i in p.of]) for p in shown for what in _WHAT}
    bars = "bars: intervals of a share, else from the known quantiles nearest to 1 % and 99 %, or of all values"
    drawn = "a number in each field" if maps else bars
    caption = f"Over {' and '.join(keys)}: {', '.join(p.name for p in shown[: 2 if maps else None])}; {drawn}."
    if not maps and len(summary.cells) > MOST_CELLS:
        caption += f" The first {MOST_CELLS} of {len(summary.cells)} combinations."
    return (Figure("campaign-grid", "Over the grid", caption, sheet, columns),)


def _shown_cells(summary: CampaignSummary, cells: Sequence[CellSummary]) -> Iterator[Shown]:
    """The share of rows that miss a limit, and medians of the outputs that have one, of two others where none has."""
    limited = [limit.output for limit in summary.limits]
    unknown = Interval(math.nan, math.nan, math.nan, 0.0)
    if limited:
        missed = [cell.missed if tables.good(cell) else unknown for cell in cells]
        yield Shown("rows that miss a limit", Scale(100.0, "%"), missed)
    names = [name for name in dict.fromkeys(limited) if any(name in cell.outputs for cell in cells)]
    for name in (names or list(dict.fromkeys(o for cell in cells for o in cell.outputs)))[: _ACROSS - bool(limited)]:
        spans = [_span(cell.outputs[name]) if name in cell.outputs else unknown for cell in cells]
        every = np.array([[getattr(span, what) for what in _WHAT] for span in spans])
        yield Shown(f"median {numbers.label(name)}", scale_of(every, tables.unit_of(summary, name), name), spans)


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


def _dots(summary: CampaignSummary, keys: Sequence[str], shown: Sequence[Shown]) -> Sheet:
    cells = summary.cells[:MOST_CELLS]
    rows = np.arange(len(cells), dtype=np.float64)
    sheet, panels = sheets.grid(WIDTH, 1.0 + 0.24 * len(cells), 1, len(shown), share_y=True)
    sheet.heading, sheet.heading_at_left = shortened(", ".join(label_of(key, keys) for key in keys), 90), True
    for panel, each in zip(panels, shown, strict=True):
        found = each.of[: len(cells)]
        values = np.array([i.value for i in found]) * each.scale.factor
        arms = _arms(found, each.scale.factor)
        panel.x = Axis("\n".join(textwrap.wrap(each.scale.title(each.name), 28)))
        panel.y = replace(sheets.rows([shortened(", ".join(cell.values.values()), 34) for cell in cells]), grid=True)
        panel.add(Line(values, rows, BLUE, "", marker="o", size=4.5, x_arms=arms))
        panel.add(*_limit_lines(panel, summary, each))
    return sheet


def _limit_lines(panel: Panel, summary: CampaignSummary, each: Shown) -> list[Rule]:
    """The limits of the output of a panel that are near what is drawn."""
    low, high = scales.limits(panel.x, "x", [panel])
    named = {f"median {numbers.label(limit.output)}": limit for limit in summary.limits}
    bounds = [bound * each.scale.factor for _, bound in _bounds(named.get(each.name))]
    return [Rule(at, True, **_LIMIT) for at in bounds if 2.0 * low - high <= at <= 2.0 * high - low]


def _maps(
    summary: CampaignSummary, keys: Sequence[str], levels: Sequence[Sequence[str]], shown: Sequence[Shown]
) -> Sheet:
    across = 0 if len(levels[0]) < len(levels[1]) else 1
    down = 1 - across
    sheet, panels = sheets.grid(WIDTH, 1.2 + 0.32 * max(len(levels[down]), 3), 1, len(shown), share_y=True)
    for panel, each in zip(panels, shown, strict=True):
        values = np.full((len(levels[down]), len(levels[across])), np.nan)
        for cell, found in zip(summary.cells, each.of, strict=True):
            at = levels[down].index(cell.values[keys[down]]), levels[across].index(cell.values[keys[across]])
            values[at] = found.value * each.scale.factor
        panel.title, panel.face = each.scale.title(each.name), "#dddddd"
        panel.x = _steps(label_of(keys[across], keys).replace("\n", ""), levels[across], 12)
        panel.y = _steps("" if panel.column else label_of(keys[down], keys), levels[down], 24)
        panel.y.low, panel.y.high = len(levels[down]) - 0.5, -0.5  # the first on top
        panel.add(*_numbered(values))
    return sheet


def _steps(title: str, levels: Sequence[str], most: int) -> Axis:
    """An axis with a text at each step."""
    return Axis(title, ticks={k: shortened(text, most) for k, text in enumerate(levels)}, grid=False, size=8.0)


def _numbered(values: Floats) -> Iterator[Field | Words]:
    """Coloured fields with their number in each; grey where there is none."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    high = high if high > low else low + 1.0
    y, x = (np.arange(n, dtype=np.float64) for n in values.shape)
    yield Field(x, y, values, low, high)
    for (row, column), number in np.ndenumerate(values):
        known_ = math.isfinite(number)
        tint = WHITE if known_ and number < 0.5 * (low + high) else BLACK
        yield Words(plain(number) if known_ else "none", column, row, tint, anchor="middle")


# --------------------------------------------------------------------------------------------------------------- worst
def worst(summary: CampaignSummary, trace: WorstTrace, number: int) -> Figure:
    """One of the worst rows: radial error and drive over time.

    Args:
        summary: the campaign that it is of.
        trace: the row's trace.
        number: how bad it is among the rows of its cell, from 1.
    """
    sheet, (above, below) = sheets.grid(WIDTH, 3.4, 2, share_x=True)
    sheet.heights = (1.3, 1.0)
    error = np.reshape(trace.error_rad, (trace.time_s.size, -1))
    radial = np.hypot.reduce(error, axis=1) if error.shape[1] > 1 else np.abs(error[:, 0])
    rest = float(radial[radial.size // 20 :].max())
    cut = radial.max() > 3.0 * rest > 0.0  # where the loop only closes, nothing else could be seen
    scale = scale_of(np.array([rest if cut else radial.max()]), "rad")
    below.x = Axis("time (s)", low=float(trace.time_s[0]), high=float(trace.time_s[-1]))
    above.x = replace(below.x, title="")
    above.y = Axis(scale.title("radial error"), low=0.0, high=1.1 * rest * scale.factor if cut else None)
    above.add(Line(trace.time_s, radial * scale.factor, BLUE, width=0.8))
    columns = {"time (s)": trace.time_s, "radial error (rad)": radial}
    drive = np.reshape(trace.drive_v, (trace.time_s.size, -1))
    for k, (column, colour) in enumerate(zip(drive.T, (BLUE, ORANGE, GREEN, SKY), strict=False)):
        below.add(Line(trace.time_s, column, colour, width=0.8, label=f"drive {k + 1}"))
        columns[f"drive {k + 1} (V)"] = column
    below.y = Axis("drive (V)")
    sheet.legend = Legend("lower right") if drive.shape[1] > 1 else None
    cell, unit = summary.cells[trace.cell], tables.unit_of(summary, trace.output)
    of = f" of {cell.label}" if cell.values else ""
    found = numbers.value(trace.value, unit, trace.output)
    caption = f"Row {trace.row}{of}: of its rows the {_rank(number)}in {trace.output}, {found}."
    caption += " Shown is the first run of the row's."
    caption += f" Its begin, up to {numbers.value(float(radial.max()), 'rad')}, is cut off." if cut else ""
    title = f"{_rank(number).capitalize()}row in time"
    return Figure(f"campaign-worst-{trace.cell + 1}-{number}", title, caption, sheet, columns)


def _rank(number: int) -> str:
    """How bad a row is, in words."""
    ranks = ("", "second ", "third ", "fourth ", "fifth ", "sixth ")
    return (ranks[number - 1] if number <= len(ranks) else f"{number}th ") + "worst "
