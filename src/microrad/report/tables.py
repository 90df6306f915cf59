"""Tables for a terminal."""

import io
from collections.abc import Sequence
from typing import NamedTuple


class Table(NamedTuple):
    """A table with its title; the columns in ``broken`` give way where a line has no room for all."""

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    broken: Sequence[int]


def tables_text(tables: Sequence[Table], sentences: Sequence[str], width: int) -> str:
    """Tables and below them sentences, in lines of at most ``width`` columns."""
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
