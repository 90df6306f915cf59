"""Tables for a terminal, and columns of data as rows of text."""

import io
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Column = NDArray[np.float64] | tuple[str, ...]
"""Of a table of data: numbers, or what the rows are called."""


def rows_of(columns: Mapping[str, Column], digits: int) -> list[tuple[str, ...]]:
    """Columns as rows of text: numbers to so many digits, nothing for a nan and behind the end of a short column."""
    return [*zip_longest(*(_texts(column, digits) for column in columns.values()), fillvalue="")]


def _texts(column: Column, digits: int) -> Sequence[str]:
    if isinstance(column, tuple):
        return column
    found = (f"%.{digits}g\n" * column.size % tuple(column.tolist())).split("\n")[:-1]  # all in one go
    return ["" if text == "nan" else text for text in found] if "nan" in found else found


class Rows(NamedTuple):
    """Headings and rows of a table that has its title elsewhere."""

    headings: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]


class Table(NamedTuple):
    """A table with its title; the columns in ``broken`` give way where a line has no room for all."""

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    broken: Sequence[int]


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
    for each in tables:
        table = Drawn(title=each.title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
        for place, heading in enumerate(each.headings):
            table.add_column(heading, overflow="fold", no_wrap=place not in each.broken)
        for row in each.rows:
            table.add_row(*row)
        console.print(table)
    for sentence in sentences:
        console.print(sentence)
    written = console.file
    assert isinstance(written, io.StringIO)
    return "\n".join(line.rstrip() for line in written.getvalue().splitlines())


def table_text(table: Table, width: int) -> str:
    """One table for a terminal of ``width`` columns, without blank lines around it."""
    return tables_text([table], [], width).strip("\n")
