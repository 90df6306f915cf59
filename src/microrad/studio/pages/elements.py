"""What several pages are made of: plots, tables and the cards of margins.

Plots and cards keep what they show in the browser, and are told what is new: for a change of an element's properties or
text NiceGUI builds the whole page anew, which takes longer than drawing.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NamedTuple

from nicegui import ui
from nicegui.element import Element

from microrad.studio.pages import layout
from microrad.studio.pages.in_thread import stay
from microrad.studio.views.link import Margin
from microrad.studio.views.plots import Plot, empty

_DRAWN_S = 5.0
"""For how long a browser may draw before it is asked for more."""


class Figure(Element, component="figure.js"):
    """A plot; `label` says what it shows and where the same stands in words, `begin` is what is drawn at first."""

    def __init__(self, label: str, begin: Plot | None = None) -> None:
        """Build it in the present container."""
        super().__init__()
        self.classes("w-full js-plotly-plot").props["role"] = "figure"
        self.props["aria-label"], self.props["begin"] = label, begin or empty("")

    def show(self, figure: Plot) -> None:
        """Have a figure drawn."""
        self.run_method("draw", figure)

    async def draw(self, figure: Plot) -> None:
        """Draw a figure; returns when the browser has done so, or does not answer any more."""
        with suppress(TimeoutError):
            await self.run_method("draw", figure, timeout=_DRAWN_S)
        stay(self)


class MarginCards(Element, component="margin_cards.js"):
    """The margins of the links side by side."""

    def show(self, margins: Sequence[Margin]) -> None:
        """Show these margins."""
        self.run_method("show", [{"name": m.name, "value": m.words, "needs": m.needs, "met": m.met} for m in margins])


class Column(NamedTuple):
    """A column of a table: the key of its cells, its heading, and whether it holds numbers."""

    name: str
    label: str
    number: bool = False


def table(of: Sequence[Column], key: str = "id") -> ui.table:
    """A table of text that is still empty; `key` tells its rows apart, and those with a true "total" stand out."""
    made = ui.table(rows=[], columns=columns(of), row_key=key).props("flat dense wrap-cells hide-bottom")
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


def numbers(pairs: Sequence[tuple[str, str]]) -> None:
    """Names and values side by side, in the present container, a "dl" of the class "numbers"."""
    for name, value in pairs:
        with ui.element("div"):
            layout.words("dt", name)
            layout.words("dd", value)
