"""Tables for a terminal."""

import io
from collections.abc import Sequence

Named = tuple[str, Sequence[str], Sequence[Sequence[str]]]
"""Title, headings and rows of a table."""


def tables_text(tables: Sequence[Named], sentences: Sequence[str], width: int) -> str:
    """Tables of at most ``width`` columns, and sentences below them."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    console = Console(file=io.StringIO(), width=width, color_system=None, highlight=False, markup=False)
    for title, headings, rows in tables:
        table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
        for heading in headings:
            table.add_column(heading, overflow="fold")
        for row in rows:
            table.add_row(*row)
        console.print(table)
    for sentence in sentences:
        console.print(sentence, soft_wrap=True)
    written = console.file
    assert isinstance(written, io.StringIO)
    return "\n".join(line.rstrip() for line in written.getvalue().splitlines())
