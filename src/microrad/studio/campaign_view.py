"""What the page of runs shows of a campaign's rows, finished or not: how they keep the limits, and how they spread."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from microrad.studio.campaign_live import Live
from microrad.studio.plots import BLUE, GREY, VERMILION, Plot, empty, marker_line, plot

if TYPE_CHECKING:
    from microrad.campaign.records import CampaignSummary, CellSummary, Interval, Limit, OutputSummary, Tail
    from microrad.report.campaign.numbers import Scale

# The report's own words and tables load numpy, and with the package that they are in far more.

_QUANTILES = 3  # in a table, each with its interval
_FAILED = 5  # failed rows that are shown
_TWICE = re.compile(r"^(\S+) (\S+) to (\S+) \2$", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Table:
    """A table of texts; a line break within one is kept. A `wide` one takes the whole page, others stand by a plot."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    wide: bool = False


@dataclass(frozen=True, slots=True)
class Figures:
    """What the rows of a ledger say: `rows` tells which rows that is; `plots` by the title that they are chosen by."""

    rows: str
    headline: str
    notes: tuple[str, ...]
    tables: tuple[Table, ...]
    plots: dict[str, Plot]


def figures(live: Live) -> Figures | None:
    """The figures of a ledger, None where it has no rows yet. It takes a while the first time."""
    from microrad.report.campaign import words as campaign_words

    summary = live.summary
    if summary is None or not live.rows:
        return None
    cell = campaign_words.best(summary)
    failed = f"{live.failed} of them failed." if live.failed else ""
    more = f"{live.failed - _FAILED} more rows failed; the export has them all." if live.failed > _FAILED else ""
    notes = (failed, *summary.findings, *(f"Warning: {each}" for each in summary.warnings), more)
    return Figures(
        rows=_rows(live, summary),
        headline=_sentence(campaign_words.headline(summary)),
        notes=tuple(filter(None, notes)),
        tables=tuple(table for table in _tables(summary, cell) if table.rows),
        plots={} if cell is None else _plots(summary, cell),
    )


def _sentence(headline: str) -> str:
    """The headline below the words that say of which rows it is."""
    said = headline.removeprefix("So far: ")
    return said[:1].upper() + said[1:]


def _rows(live: Live, summary: CampaignSummary) -> str:
    count = "1 row" if live.rows == 1 else f"{live.rows} rows"
    if summary.progress.state == "complete" and not live.behind:
        return f"Of all {count}" if live.rows > 1 else "Of the only row"
    wanted = summary.progress.rows_total
    more = f" ({wanted} are wanted)" if wanted > live.rows else ""
    read = "; the others in the ledger are being read" if live.behind else ""
    return f"Of {count} so far{more}{read}"


# --------------------------------------------------------------------------------------------------------------- tables
def _tables(summary: CampaignSummary, cell: CellSummary | None) -> list[Table]:
    from microrad.report.campaign import tables as campaign_tables

    headings, failed = campaign_tables.failed_table(summary, _FAILED)
    told = Table("Failed rows", headings, tuple(failed), wide=True)
    if cell is None:
        return [told]
    of = f" where {cell.label}" if cell.values else ""
    found = [_limits(summary, cell, of)]
    if cell.tail is not None:
        headings, rows = campaign_tables.tail_table(cell.tail)
        found.append(Table(f"Radial errors that are exceeded{of}", headings, _short(rows)))
    headings, rows = campaign_tables.output_table(cell, _QUANTILES, intervals=True)
    found.append(Table(f"Outputs and their quantiles over the rows{of}", headings, _short(rows), wide=True))
    if len(summary.cells) > 1:
        headings, rows = campaign_tables.cell_table(summary, summary.cells)
        found.append(Table("Combinations", headings, _short(rows), wide=True))
    return [*found, told]


def _limits(summary: CampaignSummary, cell: CellSummary, of: str) -> Table:
    """Each limit with the share of the rows that keep it, and of those that keep all."""
    from microrad.report.campaign import numbers as campaign_numbers
    from microrad.report.campaign import tables as campaign_tables

    named = [
        (campaign_numbers.limit_text(limit, campaign_tables.unit_of(summary, limit.output)), missed)
        for limit in summary.limits
        if (missed := cell.missed_by.get(limit.output))
    ]
    named += [("all of them", cell.missed)] if len(named) > 1 else []
    rows = tuple(
        (name, campaign_numbers.share(kept.value), campaign_numbers.ends(kept, "", "outage"))
        for name, missed in named
        if not math.isnan((kept := campaign_numbers.complement(missed)).value)
    )
    return Table(f"Limits{of}", ("limit", "kept by", f"{100.0 * cell.missed.confidence:g} % interval"), _short(rows))


def _short(rows: Iterable[tuple[str, ...]]) -> tuple[tuple[str, ...], ...]:
    """Intervals with one unit for both ends: "4.18 to 4.26 µrad"."""
    return tuple(tuple(_TWICE.sub(r"\1 to \3 \2", text) for text in row) for row in rows)


# ---------------------------------------------------------------------------------------------------------------- plots
def _plots(summary: CampaignSummary, cell: CellSummary) -> dict[str, Plot]:
    """How each output that varies is spread, those whose limit is missed most first, and the tail of the error."""
    from microrad.report.campaign.numbers import label

    limits = {limit.output: limit for limit in summary.limits}
    varied = [output for output in cell.outputs.values() if output.rows and output.most > output.least]
    ordered = sorted(varied, key=lambda output: _last(cell.missed_by.get(output.name)))
    found = {label(output.name): distribution_plot(output, limits.get(output.name)) for output in ordered}
    if cell.tail is not None and any(cell.tail.survival > 0.0):
        found["tail of the radial error"] = tail_plot(cell.tail)
    return found


def _last(missed: Interval | None) -> float:
    """What is missed most comes first, what has no limit last."""
    return 1.0 if missed is None else -missed.value if missed.value > 0.0 else 0.0


def distribution_plot(output: OutputSummary, limit: Limit | None) -> Plot:
    """How many rows have at most a value of an output, with its quantiles, their intervals and its limit."""
    import numpy as np

    from microrad.report.campaign.numbers import label, scale_of

    if not output.counts.size:
        return empty(f"{label(output.name)} is infinite in every row")
    scale = scale_of(np.array([output.least, output.most]), output.unit, output.name)
    below = itertools.accumulate(output.counts.tolist(), initial=0.0)
    total = float(output.counts.sum())
    rows = {
        "type": "scatter",
        "mode": "lines",
        "x": _digits(output.edges * scale.factor),
        "y": [100.0 * each / total for each in below],
        "name": "rows",
        "line": {"color": BLUE, "width": 2},
        "hovertemplate": "%{y:.1f} % of the rows are at or below %{x:.4g} " + scale.label + "<extra></extra>",
    }
    data = [rows, *_quantiles(output, scale), *_limit_lines(output, limit, scale)]
    share = {"title": "rows at or below (%)", "range": [-2.0, 102.0]}
    return plot(data, {"title": scale.title(label(output.name))}, share, height=_HEIGHT)


_HEIGHT = 340


def _quantiles(output: OutputSummary, scale: Scale) -> list[dict[str, Any]]:
    """The quantiles that the rows know, each with its interval as a bar."""
    from microrad.report.campaign.tables import is_known

    known = [(100.0 * p, each) for p, each in sorted(output.quantiles.items()) if is_known(each)]
    if not known:
        return []
    down, up = ([max(d * scale.factor, 0.0) for d in ds] for ds in zip(*(_arms(q) for _, q in known), strict=True))
    confidence = f"{100.0 * known[0][1].confidence:g} %"
    return [
        {
            "type": "scatter",
            "mode": "markers",
            "x": _digits([each.value * scale.factor for _, each in known]),
            "y": [p for p, _ in known],
            "error_x": {"type": "data", "symmetric": False, "array": up, "arrayminus": down, "color": GREY},
            "marker": {"color": GREY, "size": 5},
            "name": f"quantiles, {confidence} intervals",
            "hovertemplate": "%{y:g} % quantile: %{x:.4g} " + scale.label + "<extra></extra>",
        }
    ]


def _arms(found: Any) -> tuple[float, float]:
    return found.value - found.low, found.high - found.value


def _limit_lines(output: OutputSummary, limit: Limit | None, scale: Scale) -> list[dict[str, Any]]:
    """The limit as a line; in the legend alone where it is far from all rows."""
    from microrad.report.campaign.numbers import SYMBOL, bound

    sides = [] if limit is None else [("least", limit.least), ("most", limit.most)]
    reach, found = output.most - output.least, []
    for side, at in sides:
        if at is not None:
            near = output.least - reach <= at <= output.most + reach
            where = "" if near else ", left of here" if at < output.least else ", right of here"
            name = f"limit {SYMBOL[side]} {bound(at, output.unit, output.name)}{where}"
            line = marker_line(at * scale.factor, name, VERMILION, "dash", (0.0, 100.0))
            found.append(line if near else {**line, "x": [None], "y": [None]})
    return found


def tail_plot(tail: Tail) -> Plot:
    """How likely a larger radial error than each is, with the interval."""
    seen = tail.survival > 0.0
    radius = _digits(tail.radius_rad[seen] * 1e6)
    band = f"{100.0 * tail.confidence:g} % interval"
    edge: dict[str, Any] = {"type": "scatter", "mode": "lines", "x": radius, "line": {"width": 0}, "hoverinfo": "skip"}
    data: list[dict[str, Any]] = [
        {**edge, "y": _digits(tail.low[seen].clip(1e-300)), "showlegend": False, "name": "lower end"},
        {**edge, "y": _digits(tail.high[seen]), "fill": "tonexty", "fillcolor": "rgba(86,180,233,0.45)", "name": band},
        {
            "type": "scatter",
            "mode": "lines",
            "x": radius,
            "y": _digits(tail.survival[seen]),
            "name": "probability",
            "line": {"color": BLUE, "width": 2},
            "hovertemplate": "beyond %{x:.4g} µrad: %{y:.2g}<extra></extra>",
        },
    ]
    least = math.floor(math.log10(float(tail.survival[seen].min()))) - 0.3
    likely = {"title": "probability of a larger error", "type": "log", "range": [least, 0.1], "exponentformat": "power"}
    return plot(data, {"title": "radial error (µrad)", "rangemode": "tozero"}, likely, height=_HEIGHT)


def _digits(values: Any) -> list[float]:
    return [float(f"{value:.6g}") for value in values]
