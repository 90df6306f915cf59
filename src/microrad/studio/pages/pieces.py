"""Pieces that several pages are made of: plots and tables with their look, and the file that a command reads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from nicegui import ui

from microrad.studio.session import Session
from microrad.studio.views.plots import CONFIG


class Column(NamedTuple):
    """A column of a table: the key of its cells, its heading, and whether it holds numbers."""

    name: str
    label: str
    number: bool = False


def plot(label: str) -> ui.plotly:
    """A plot that is still empty; `label` says what it shows and where the same stands in words."""
    made = ui.plotly({"data": [], "layout": {}, "config": CONFIG}).classes("w-full")
    return made.props(f'role="figure" aria-label="{label}"')


def table(of: Sequence[Column]) -> ui.table:
    """A table of text that is still empty; rows with a true "total" stand out."""
    made = ui.table(rows=[], columns=columns(of), row_key="id").props("flat dense wrap-cells hide-bottom")
    made.props(""":pagination='{rowsPerPage: 0}' :table-row-class-fn="row => row.total ? 'total' : ''" """)
    return made.classes("wide-table")


def columns(of: Sequence[Column]) -> list[dict[str, Any]]:
    """Columns as the table takes them."""
    return [
        {
            "name": each.name,
            "label": each.label,
            "field": each.name,
            "align": "right" if each.number else "left",
            "classes": "text-no-wrap" if each.number else "",
        }
        for each in of
    ]


def file_of(session: Session) -> Path:
    """The mission's file, seen from the working folder, for a command to be copied; says so where it is not saved."""
    if session.draft.changed:
        ui.notify("The command reads the file: save the mission first, for the same numbers.", type="warning")
    return Path(session.name_of(session.draft.path))
