"""Lines of a budget as a table."""

from collections.abc import Sequence

from microrad.core.budget import Line
from microrad.report.quantities import quantity
from microrad.report.tables import Cell, Table

LINES = ("line", "value", "basis", "source", "holds for")


def lines_table(title: str, lines: Sequence[Line], totals: Sequence[Line] = (), names: Sequence[str] = ()) -> Table:
    """Lines of a budget with its sums; a page shows the sums, and the lines when it is asked.

    Args:
        title: what a page shows in place of the folded lines, before the sums.
        lines: the lines.
        totals: their sums.
        names: dotted ones of all of these in the JSON.
    """
    sums = "; ".join(f"{line.name.lower()} {quantity(line.value, line.unit)}" for line in totals)
    rows = [_row(line) for line in (*lines, *totals)]
    folded = f"{title}: {sums}" if sums else title
    named = {1: names} if names else {}
    return Table(title, LINES, rows, (0, 2, 3, 4), totals=len(totals), folded=folded, names=named)


def line_names(name: str, lines: Sequence[Line], totals: Sequence[Line] = ()) -> list[str]:
    """The dotted names of lines and their sums in the JSON.

    Args:
        name: dotted, of the record that has both.
        lines: the lines.
        totals: their sums.
    """
    named = (("lines", lines), ("totals", totals))
    return [f"{name}.{of}.{line.name}.value" for of, several in named for line in several]


def _row(line: Line) -> tuple[str | Cell, ...]:
    name = Cell(line.name, "!", line.warning) if line.warning else line.name
    return name, quantity(line.value, line.unit), line.basis, line.source, line.regime
