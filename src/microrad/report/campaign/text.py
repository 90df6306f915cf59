"""A campaign as text for a terminal."""

from collections.abc import Sequence

from microrad.campaign.records import CampaignSummary, CellSummary
from microrad.report.campaign import tables, words
from microrad.report.campaign.tables import Row
from microrad.report.tables import Rows, Table, tables_text

MOST_FAILED = 10
"""Failed rows of a table in a terminal; the rest are counted."""
_MOST_CELLS = 40


def campaign_text(summary: CampaignSummary, width: int) -> str:
    """The campaign for a terminal: the verdict first, how far it is last.

    Args:
        summary: what the rows of the ledger come to.
        width: columns of the terminal.
    """
    cell = words.best(summary)
    found, below = _tables(summary, cell, width), [*words.few_values(cell), *words.answers(summary, cell)]
    last = [*(f"Warning: {warning}" for warning in summary.warnings), words.progress_words(summary)]
    failed = tables.failed_table(summary, MOST_FAILED)
    if more := tables.more_failed(summary, len(failed.rows)):
        last = [more, *last]
    first = [tables_text([], [words.headline(summary), ""], width)]
    first += [tables_text([], [*summary.findings, ""], width)] if summary.findings else []
    parts = [*first, tables_text(found, below, width)]
    if failed.rows:
        table = Table("Failed rows", *failed, (0, 3))
        parts.append("\n" + tables_text([table], [], width))
    return "\n".join([*filter(None, parts), tables_text([], last, width)])


def _tables(summary: CampaignSummary, cell: CellSummary | None, width: int) -> list[Table]:
    found = _over_the_grid(summary, width) if len(summary.cells) > 1 else []
    if cell is None:
        return found
    of = f" of {cell.label}" if cell.values else ""
    if summary.limits:
        found.append(Table(f"Limits{of}", *tables.limit_table(summary, cell), (0, 3)))
    narrower = (tables.output_table(cell, most) for most in range(tables.MOST_QUANTILES, 0, -1))
    headings, rows = next((t for t in narrower if _wide(*t) <= width), tables.output_table(cell, 1))
    if rows:
        unknown = f" ({_UNKNOWN_QUANTILE})" if any(tables.UNKNOWN in row for row in rows) else ""
        found.append(Table(f"Outputs{of}, and their quantiles over the rows{unknown}", headings, rows, (0,)))
    if (meanings := tables.meanings_table(cell)).rows:
        found.append(Table("What they are", *meanings, (1,)))
    if cell.tail is not None:
        found.append(Table(f"Radial errors{of} that are exceeded", *tables.tail_table(cell.tail), (2,)))
    return found


_UNKNOWN_QUANTILE = f"{tables.UNKNOWN}: not known, there are too few rows"


def _over_the_grid(summary: CampaignSummary, width: int) -> list[Table]:
    """Every combination, in two tables where one is too wide: the rows that keep all, then limit by limit."""
    keys, cells = len(summary.cells[0].values), summary.cells[:_MOST_CELLS]
    both = [tables.cell_table(summary, cells), tables.limited_table(summary, cells)]
    joined = both[0][0] + both[1][0][keys:], [a + b[keys:] for a, b in zip(both[0][1], both[1][1], strict=True)]
    broken = tuple(range(keys))
    if _wide(*joined) <= width or not summary.limits:
        return [Table("Combinations", *joined, broken)]
    return [
        Table(title, *_narrowed(*table, keys + 2, width), broken)
        for title, table in zip(("Combinations", "Limits by combination"), both, strict=True)
    ]


def _wide(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> int:
    """Columns of a terminal that a table takes."""
    return sum(max(map(len, column)) + 3 for column in zip(headings, *rows, strict=True))


def _narrowed(headings: Row, rows: Sequence[Row], least: int, width: int) -> Rows:
    """A table without the last columns that there is no room for, ``least`` columns at least."""
    kept = next(
        (n for n in range(len(headings), least, -1) if _wide(headings[:n], [row[:n] for row in rows]) <= width), least
    )
    return Rows(headings[:kept], [row[:kept] for row in rows])
