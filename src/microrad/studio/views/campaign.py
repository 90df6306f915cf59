"""What the page of runs shows of a campaign's rows, finished or not: how they keep the limits, and how they spread."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from microrad.campaign.records import CampaignSummary, CellSummary, Interval, Limit, OutputSummary
from microrad.report.campaign import figures as campaign_figures
from microrad.report.campaign import numbers, tables, words
from microrad.report.campaign.numbers import Scale, scale_of
from microrad.report.plotting.palette import BLUE, GREY, VERMILION
from microrad.report.plotting.sheet import Axis, Line, Mark, Rule
from microrad.studio.jobs.ledgers import Live
from microrad.studio.views.plots import Plot, empty, figure, plot

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
    summary = live.summary
    if summary is None or not live.rows:
        return None
    cell = words.best(summary)
    failed = f"{live.failed} of them failed." if live.failed else ""
    more = f"{live.failed - _FAILED} more rows failed; the export has them all." if live.failed > _FAILED else ""
    notes = (failed, *summary.findings, *(f"Warning: {each}" for each in summary.warnings), more)
    return Figures(
        rows=_rows(live, summary),
        headline=_sentence(words.headline(summary)),
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
    headings, failed = tables.failed_table(summary, _FAILED)
    told = Table("Failed rows", headings, tuple(failed), wide=True)
    if cell is None:
        return [told]
    of = f" where {cell.label}" if cell.values else ""
    found = [_limits(summary, cell, of)]
    if cell.tail is not None:
        headings, rows = tables.tail_table(cell.tail)
        found.append(Table(f"Radial errors that are exceeded{of}", headings, _short(rows)))
    headings, rows = tables.output_table(cell, _QUANTILES, intervals=True)
    found.append(Table(f"Outputs and their quantiles over the rows{of}", headings, _short(rows), wide=True))
    if len(summary.cells) > 1:
        headings, rows = tables.cell_table(summary, summary.cells)
        found.append(Table("Combinations", headings, _short(rows), wide=True))
    return [*found, told]


def _limits(summary: CampaignSummary, cell: CellSummary, of: str) -> Table:
    """Each limit with the share of the rows that keep it, and of those that keep all."""
    named = [
        (numbers.limit_text(limit, tables.unit_of(summary, limit.output)), missed)
        for limit in summary.limits
        if (missed := cell.missed_by.get(limit.output))
    ]
    named += [("all of them", cell.missed)] if len(named) > 1 else []
    rows = tuple(
        (name, numbers.share(kept.value), numbers.ends(kept, "", "outage"))
        for name, missed in named
        if not math.isnan((kept := numbers.complement(missed)).value)
    )
    return Table(f"Limits{of}", ("limit", "kept by", f"{100.0 * cell.missed.confidence:g} % interval"), _short(rows))


def _short(rows: Iterable[tuple[str, ...]]) -> tuple[tuple[str, ...], ...]:
    """Intervals with one unit for both ends: "4.18 to 4.26 µrad"."""
    return tuple(tuple(_TWICE.sub(r"\1 to \3 \2", text) for text in row) for row in rows)


# ---------------------------------------------------------------------------------------------------------------- plots
def _plots(summary: CampaignSummary, cell: CellSummary) -> dict[str, Plot]:
    """How each output that varies is spread, those whose limit is missed most first, and the tail of the error."""
    limits = {limit.output: limit for limit in summary.limits}
    varied = [output for output in cell.outputs.values() if output.rows and output.most > output.least]
    ordered = sorted(varied, key=lambda output: _last(cell.missed_by.get(output.name)))
    found = {numbers.label(output.name): distribution_plot(output, limits.get(output.name)) for output in ordered}
    return found | {each.title: figure(each.sheet) for each in campaign_figures.tail(summary, cell)}


def _last(missed: Interval | None) -> float:
    """What is missed most comes first, what has no limit last."""
    return 1.0 if missed is None else -missed.value if missed.value > 0.0 else 0.0


def distribution_plot(output: OutputSummary, limit: Limit | None) -> Plot:
    """How many rows have at most a value of an output, with its quantiles, their intervals and its limit."""
    if not output.counts.size:
        return empty(f"{numbers.label(output.name)} is infinite in every row")
    scale = scale_of(np.array([output.least, output.most]), output.unit, output.name)
    below = np.concatenate([[0.0], np.cumsum(output.counts)]) / output.counts.sum()
    found: list[Mark] = [Line(output.edges * scale.factor, 100.0 * below, BLUE, width=1.5, label="rows")]
    known = [(p, each) for p, each in sorted(output.quantiles.items()) if tables.is_known(each)]
    if known:
        share, value, low, high = np.array([(100.0 * p, q.value, q.low, q.high) for p, q in known]).T
        arms = np.maximum([value - low, high - value], 0.0) * scale.factor
        name = f"quantiles, {100.0 * known[0][1].confidence:g} % intervals"
        found.append(Line(value * scale.factor, share, GREY, "", label=name, marker="o", size=4.0, x_arms=arms))
    found += _limit_lines(output, limit, scale)
    share_axis = Axis("rows at or below (%)", low=-2.0, high=102.0)
    return plot(Axis(scale.title(numbers.label(output.name))), share_axis, *found)


def _limit_lines(output: OutputSummary, limit: Limit | None, scale: Scale) -> list[Mark]:
    """The limit as a line; in the legend alone where it is far from all rows."""
    sides = [] if limit is None else [("least", limit.least), ("most", limit.most)]
    reach, found = output.most - output.least, list[Mark]()
    for side, at in sides:
        if at is not None:
            near = output.least - reach <= at <= output.most + reach
            where = "" if near else ", left of here" if at < output.least else ", right of here"
            name = f"limit {numbers.SYMBOL[side]} {numbers.bound(at, output.unit, output.name)}{where}"
            drawn = Rule(at * scale.factor, True, VERMILION, "--", 1.5, name)
            found.append(drawn if near else Line(np.empty(0), np.empty(0), VERMILION, "--", label=name))
    return found
