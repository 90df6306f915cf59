"""Tables, views of them as text for a terminal, and columns of data as rows of text."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Column = NDArray[np.float64] | tuple[str, ...]
"""Of a table of data: numbers, or what the rows are called."""

_ROOM = 120  # columns for a table with several columns of words at its end
_LEGIBLE = 16  # columns in which even the longest words may be folded


def rows_of(columns: Mapping[str, Column], digits: int) -> list[tuple[str, ...]]:
    """Columns as rows of text: nothing for a nan and behind the end of a short column.

    Args:
        columns: by heading.
        digits: significant ones.
    """
    return [*zip_longest(*(_texts(column, digits) for column in columns.values()), fillvalue="")]


def _texts(column: Column, digits: int) -> Sequence[str]:
    if isinstance(column, tuple):
        return column
    found = (f"%.{digits}g\n" * column.size % tuple(column.tolist())).split("\n")[:-1]  # all in one go
    return ["" if text == "nan" else text for text in found] if "nan" in found else found


def numbers_text(columns: Sequence[NDArray[np.float64]], digits: int, between: str, end: str) -> str:
    """Columns of numbers as `rows_of` has them, as one text: the quickest way for many of them.

    Args:
        columns: of any lengths.
        digits: significant ones.
        between: two numbers of a row.
        end: of a row.
    """
    rows = np.full((max(column.size for column in columns), len(columns)), np.nan)
    for place, column in enumerate(columns):
        rows[: column.size, place] = column
    row = between.join([f"%.{digits}g"] * len(columns)) + end
    return (row * len(rows) % tuple(rows.ravel().tolist())).replace("nan", "")


class Rows(NamedTuple):
    """Headings and rows of a table that has its title elsewhere."""

    headings: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]


class Cell(NamedTuple):
    """A cell with a mark behind its text: PASS, FAIL, yes, no or "!", with a hint of what that means; or a key."""

    text: str
    mark: str = ""
    hint: str = ""
    code: bool = False

    def __str__(self) -> str:
        """Text and mark."""
        return f"{self.text} {self.mark}".strip()


@dataclass(frozen=True, slots=True)
class Table:
    """A table with its title; "" where that stands elsewhere.

    Columns in ``words`` hold words, which give way where a line has no room for all; the others hold numbers. Further
    lines of a cell explain its first. ``groups`` are headings over several columns, with how many. Rows in ``best``
    stand out, the last ``totals`` are sums. A page shows a ``folded`` table behind that sentence, one in ``cards`` with
    each row as a card where it is narrow, and for each of ``filters`` a button that leaves only those rows. A terminal
    that has no room for all columns shows those in ``brief``.

    ``names`` says of a column what its numbers are in the JSON: one dotted name, or one for each row; "" is none. By
    them `marks` finds those that have a sign.
    """

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str | Cell]]
    words: Sequence[int] = (0,)
    groups: Sequence[tuple[str, int]] = ()
    best: Sequence[int] = ()
    totals: int = 0
    folded: str = ""
    cards: bool = False
    filters: Mapping[str, Sequence[int]] = field(default_factory=dict)
    brief: Sequence[int] = ()
    names: Mapping[int, str | Sequence[str]] = field(default_factory=dict)

    def name(self, row: int, column: int) -> str:
        """The dotted name of a number in the JSON; "" for words, and where it is not told."""
        told = self.names.get(column, "")
        return told if isinstance(told, str) else told[row]

    def columns(self, kept: Sequence[int]) -> "Table":
        """The table with some of its columns."""
        words = [place for place, column in enumerate(kept) if column in self.words]
        headings, rows = [self.headings[k] for k in kept], [[row[k] for k in kept] for row in self.rows]
        names = {place: self.names[column] for place, column in enumerate(kept) if column in self.names}
        return replace(self, headings=headings, rows=rows, words=words, names=names)

    def for_width(self, width: int) -> "Table":
        """The table as a terminal of so many columns has room for it."""
        return self if width >= max(_ROOM, self._least()) else self.narrowed()

    def _least(self) -> int:
        """Columns of a terminal that the table takes with its numbers whole and with a word in each line of words."""
        return sum(least + 3 for least, _ in self._ranges())

    def _ranges(self) -> list[tuple[int, int]]:
        """Columns of a terminal that each column needs, and that it takes with no line folded."""
        found = []
        for place, cells in enumerate(zip(self.headings, *self.rows, strict=True)):
            texts = [line for cell in cells for line in str(cell).split("\n")]
            least = most = max(map(len, texts))
            if place in self.words:
                least = min(max((len(word) for text in texts for word in text.split()), default=0), _LEGIBLE)
            found.append((least, most))
        return found

    def widths(self, width: int) -> list[int]:
        """Columns of a terminal for each column, of so many: what is left goes first where the least is lacking."""
        ranges, room = self._ranges(), width + 1 - self._least()
        found = [least for least, _ in ranges]
        for place in sorted(range(len(ranges)), key=lambda k: ranges[k][1] - ranges[k][0]):
            more = min(max(room, 0), ranges[place][1] - found[place])
            found[place] += more
            room -= more
        return found

    def parts(self, width: int) -> list["Table"]:
        """The table as tables that fit into so many columns of a terminal, each with the first column."""
        shown = self.for_width(width)
        ranges = shown._ranges()
        kept, found = [0], []
        for column in range(1, len(ranges)):
            if len(kept) > 1 and sum(ranges[k][0] + 3 for k in (*kept, column)) > width + 1:
                found.append(kept)
                kept = [0]
            kept.append(column)
        first, *others = (shown.columns(each) for each in [*found, kept])
        return [first, *(replace(each, title="") for each in others)]

    def narrowed(self) -> "Table":
        """The table with what a narrow terminal has room for: its last words below each other, with their headings."""
        return (self.columns(self.brief) if self.brief else self)._stacked()

    def _stacked(self) -> "Table":
        count = len(self.headings)
        first = next((k for k in range(count, 0, -1) if k - 1 not in self.words), 1)
        if first + 1 >= count:
            return self
        more = self.headings[first + 1 :]

        def last(row: Sequence[str | Cell]) -> str:
            said = (f"{heading}: {cell}" for heading, cell in zip(more, row[first + 1 :], strict=True) if str(cell))
            return "\n".join([str(row[first]), *said])

        rows = [[*row[:first], last(row)] for row in self.rows]
        return replace(self.columns(range(first + 1)), rows=rows)


def tables_text(tables: Sequence[Table], sentences: Sequence[str], width: int) -> str:
    """Tables and below them sentences, for a terminal.

    Args:
        tables: each with its title above it.
        sentences: a paragraph each.
        width: columns of the terminal.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table as Drawn

    console = Console(file=io.StringIO(), width=width, color_system=None, highlight=False, markup=False)
    for shown in (part for each in tables for part in each.parts(width)):
        table = Drawn(title=shown.title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
        for place, (heading, columns) in enumerate(zip(shown.headings, shown.widths(width), strict=True)):
            table.add_column(heading, overflow="fold", no_wrap=place not in shown.words, width=columns)
        for row in shown.rows:
            table.add_row(*map(str, row))
        console.print(table)
    for sentence in sentences:
        console.print(sentence)
    written = console.file
    assert isinstance(written, io.StringIO)
    return "\n".join(line.rstrip() for line in written.getvalue().splitlines())


def table_text(table: Table, width: int) -> str:
    """One table for a terminal, without blank lines around it.

    Args:
        table: with its title.
        width: columns of the terminal.
    """
    return tables_text([table], [], width).strip("\n")
