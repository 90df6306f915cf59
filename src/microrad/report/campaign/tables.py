"""The tables of a campaign: limits, outputs, combinations of the grid, the tail, indices, failed rows."""

import math
from collections.abc import Sequence

from microrad.campaign.records import CampaignSummary, CellSummary, Interval, OutputSummary, Sensitivity, Tail
from microrad.report.campaign.numbers import complement, ends, label, limit_text, share, share_ends, value
from microrad.report.quantities import are, counted, minus
from microrad.report.tables import Rows

Row = tuple[str, ...]
UNKNOWN = "\u2013"
"""In place of a quantile that so few rows cannot tell."""
_USUAL = ((0.5,), (0.01, 0.99), (0.003, 0.997), (0.05, 0.95), (0.1, 0.9), (0.001, 0.999))
"""Quantiles, those to be shown before others first; both of a pair or neither."""
MOST_QUANTILES = 9


# -------------------------------------------------------------------------------------------------------------- choice
def good(cell: CellSummary) -> int:
    """Rows of a cell that have results."""
    return cell.rows - cell.failed


def unit_of(summary: CampaignSummary, output: str) -> str:
    """The unit of an output; nothing where no cell has it.

    Args:
        summary: the campaign.
        output: name of the output.
    """
    return next((cell.outputs[output].unit for cell in summary.cells if output in cell.outputs), "")


def ranked(found: Sensitivity) -> list[tuple[str, Interval]]:
    """Inputs and their total indices (first-order ones where there are no total ones), the largest first."""
    known = {key: index for key, index in (found.total or found.first).items() if not math.isnan(index.value)}
    return sorted(known.items(), key=lambda item: -item[1].value)


# -------------------------------------------------------------------------------------------------------------- tables
def limit_table(summary: CampaignSummary, cell: CellSummary) -> Rows:
    """Each limit, how many rows miss it, and where it comes from.

    Args:
        summary: the campaign, for its limits.
        cell: the cell whose rows are counted.
    """
    rows: list[Row] = []
    for limit in summary.limits:
        if missed := cell.missed_by.get(limit.output):
            kept = limit_text(limit, unit_of(summary, limit.output))
            rows.append((kept, share(missed.value), ends(missed, "", "outage"), limit.source))
    return Rows(("limit", "missed by", f"{100.0 * cell.missed.confidence:g} % interval", "from"), rows)


def is_known(quantile: Interval) -> bool:
    """Whether the rows tell both ends of a quantile's interval."""
    return math.isfinite(quantile.low) and math.isfinite(quantile.high)


def chosen_quantiles(outputs: Sequence[OutputSummary], most: int) -> list[float]:
    """Probabilities of some quantiles, rising: those that are known and the usual ones before others.

    Args:
        outputs: the outputs that are to have them.
        most: how many at most.
    """
    there = {p for output in outputs for p in output.quantiles}
    known = {p for output in outputs for p, quantile in output.quantiles.items() if is_known(quantile)}
    usual = [group for group in _USUAL if there.issuperset(group)]
    groups = [*usual, *((p,) for p in sorted(there) if not any(p in group for group in _USUAL))]
    chosen: list[float] = []
    for group in sorted(groups, key=known.isdisjoint):  # else in their order
        chosen += group if len(chosen) + len(group) <= most else ()
    return sorted(chosen)


def output_table(cell: CellSummary, most: int, *, intervals: bool = False) -> Rows:
    """Each output that differs from row to row, with mean, deviation and some quantiles.

    Args:
        cell: the cell whose rows are summed up.
        most: how many quantiles at most.
        intervals: whether each quantile has a second line with the ends of its interval.
    """
    outputs = [output for output in cell.outputs.values() if output.rows and output.most > output.least]
    chosen = chosen_quantiles(outputs, most)
    rows = [
        (
            label(o.name),
            value(o.mean.value, o.unit, o.name),
            value(o.deviation, o.unit, o.name),
            *(_quantile(o, p, intervals=intervals) for p in chosen),
        )
        for o in outputs
    ]
    return Rows(("output", "mean", "deviation", *(f"{100.0 * p:.6g} %" for p in chosen)), rows)


def _quantile(output: OutputSummary, probability: float, *, intervals: bool) -> str:
    found = output.quantiles.get(probability)
    if found is None:
        return ""
    if not is_known(found):
        return UNKNOWN
    said = value(found.value, output.unit, output.name)
    return f"{said}\n{ends(found, output.unit, output.name)}" if intervals else said


def meanings_table(cell: CellSummary | None) -> Rows:
    """What each output means, in their order."""
    outputs = [] if cell is None else [output for output in cell.outputs.values() if output.rows]
    return Rows(("output", "meaning"), [(label(output.name), output.meaning) for output in outputs])


def cell_table(summary: CampaignSummary, cells: Sequence[CellSummary]) -> Rows:
    """Each combination of the grid, and how many rows keep all limits there.

    Args:
        summary: the campaign, for its limits and the keys of its grid.
        cells: the combinations to list, in their order.
    """
    keys = _keys(summary)
    headings = (*keys, *(("keep all",) if summary.limits else ()), "rows", "failed")
    kept = [[share_ends(complement(cell.missed)) if good(cell) else ""] if summary.limits else [] for cell in cells]
    rows = [
        (*(cell.values.get(key, "") for key in keys), *of, str(good(cell)), str(cell.failed))
        for cell, of in zip(cells, kept, strict=True)
    ]
    return Rows(headings, rows)


def limited_table(summary: CampaignSummary, cells: Sequence[CellSummary]) -> Rows:
    """Each combination of the grid, the mean of each limited output, and the share of the rows that miss its limit.

    Args:
        summary: the campaign, for its limits and the keys of its grid.
        cells: the combinations to list, in their order.
    """
    keys, names = _keys(summary), [limit.output for limit in summary.limits]
    headings = [heading for name in names for heading in (f"mean {label(name)}", f"miss {label(name)}")]
    return Rows((*keys, *headings), [_limited_row(cell, keys, names) for cell in cells])


def _keys(summary: CampaignSummary) -> list[str]:
    return list(dict.fromkeys(key for cell in summary.cells for key in cell.values))


def _limited_row(cell: CellSummary, keys: Sequence[str], names: Sequence[str]) -> Row:
    found: list[str] = []
    for name in names:
        output, missed = cell.outputs.get(name), cell.missed_by.get(name)
        there = good(cell) > 0
        found.append(value(output.mean.value, output.unit, name) if there and output is not None else "")
        found.append(share(missed.value) if there and missed is not None else "")
    return (*(cell.values.get(key, "") for key in keys), *found)


def tail_table(tail: Tail) -> Rows:
    """The radii that are exceeded with the wanted probabilities."""
    wanted = sorted(tail.wanted.items(), reverse=True)
    rows: list[Row] = [(share(p), value(radius.value, "rad"), ends(radius, "rad")) for p, radius in wanted]
    return Rows(("probability", "radial error", f"{100.0 * tail.confidence:g} % interval"), rows)


def index_table(found: Sequence[Sensitivity]) -> Rows:
    """Sobol indices and rank correlations of each output, the inputs that act most on it first."""
    rows = [
        (s.output, key, *(index_text(of.get(key)) for of in (s.first, s.total, s.rank_correlation)))
        for s in found
        for key, _ in ranked(s)
    ]
    return Rows(("output", "input", "first order", "total", "rank correlation"), rows)


def index_text(index: Interval | None) -> str:
    """A Sobol index or correlation with its interval; nothing where it is not known."""
    if index is None or math.isnan(index.value):
        return ""
    text = f"{index.value:.2f} ({index.low:.2f} to {index.high:.2f})"
    return minus(text)


def failed_table(summary: CampaignSummary, most: int) -> Rows:
    """Rows without results, with the combination of the grid where there is one.

    Args:
        summary: the campaign.
        most: how many rows are listed at most, the first ones.
    """
    rows = []
    for number, each in summary.failed[:most]:
        cell = summary.cells[number]
        of = f" of {cell.label}" if cell.values else ""
        rows.append((f"{each.row}{of}", str(each.seed), str(each.attempts), each.reason))
    return Rows(("row", "seed", "tries", "reason"), rows)


def more_failed(summary: CampaignSummary, shown: int) -> str:
    """How many failed rows are not shown; nothing where all are.

    Args:
        summary: the campaign.
        shown: how many failed rows are shown.
    """
    more = sum(cell.failed for cell in summary.cells) - shown
    return f"{counted(more, 'more failed row')} {are(more)} in the export." if more > 0 else ""
