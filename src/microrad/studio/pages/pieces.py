"""Pieces that several pages are made of: plots and tables with their look, and the file that a command reads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from nicegui import ui

from microrad.studio.plots import CONFIG, Plot
from microrad.studio.workshop import Workshop


class Column(NamedTuple):
    """A column of a table: the key of its cells, its heading, and whether it holds numbers."""

    name: str
    label: str
    number: bool = False


def plot(label: str) -> ui.plotly:
    """A plot that is still empty; `label` says what it shows and where the same stands in words."""
    made = ui.plotly({"data": [], "layout": {}, "config": CONFIG}).classes("w-full")
    return made.props(f'role="figure" aria-label="{label}"')


class LivePlot:
    """A plot that is drawn many times a second: from the second time on its data go to plotly as they are.

    NiceGUI would have each number watched by Vue, through which plotly reads it again; that takes longer than drawing.
    `box` is what may be styled: a change of the plot's own element would draw its first figure again.
    """

    def __init__(self, label: str, classes: str) -> None:
        """Build it, still empty."""
        with ui.element("div").classes(f"w-full {classes}-box") as self.box:
            self._plot = plot(label).classes(classes)
        self._drawn = False
        self._plot.on("plotly_afterplot.once", self._ready, args=[])

    def _ready(self) -> None:
        self._drawn = True

    def show(self, figure: Plot) -> None:
        """Draw a figure."""
        if self._drawn:
            self._plot.run_plot_method("react", figure["data"], figure["layout"], figure["config"])
        else:
            self._plot.update_figure(figure)


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


def file_of(workshop: Workshop) -> Path:
    """The mission's file, seen from the working folder; says so where it lacks what is shown."""
    if workshop.draft.changed:
        ui.notify("The command reads the file: save the mission first, for the same numbers.", type="warning")
    return Path(workshop.name_of(workshop.draft.path))
