"""What several pages are made of: plots, tables and the cards of margins.

Plots and cards keep what they show in the browser, and are told what is new: for a change of an element's properties or
text NiceGUI builds the whole page anew, which takes longer than drawing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from nicegui import ui
from nicegui.element import Element

from microrad.report.tables import Cell, Table
from microrad.report.view import Block, Points, Soft, Verbatim, Verdict, View
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


def table(headings: Sequence[str] = (), numbers: Collection[int] = ()) -> ui.table:
    """A table of text that is still empty; the columns in `numbers` hold numbers, counted from 0."""
    made = ui.table(rows=[], columns=_columns(headings, numbers), row_key="id").props(
        "flat dense wrap-cells hide-bottom"
    )
    made.props(""":pagination='{rowsPerPage: 0}' :table-row-class-fn="row => row.total ? 'total' : ''" """)
    return made.classes("wide-table")


def fill(made: ui.table, rows: Sequence[Sequence[str | Cell]], totals: int = 0) -> None:
    """Show these rows, of which the last `totals` stand out; nothing is sent where nothing changes."""
    found = [
        {"id": place, "total": place >= len(rows) - totals, **{f"c{k}": str(text) for k, text in enumerate(row)}}
        for place, row in enumerate(rows)
    ]
    if found != made.rows:
        made.rows = found


def put(made: ui.table, of: Table) -> None:
    """Show a table of the report."""
    made.columns = _columns(of.headings, [k for k in range(len(of.headings)) if k not in of.words])
    fill(made, of.rows, of.totals)


class Blocks(ui.column):
    """What a view of the report holds; what is folded stays open, or shut, as its reader has left it."""

    def __init__(self) -> None:
        """Nothing is shown yet."""
        super().__init__()
        self.classes("w-full")
        self._opened: set[str] = set()

    def show_blocks(self, blocks: Sequence[Block], figures: Mapping[str, Plot | str] | None = None) -> None:
        """Show these in place of what was there, with their figures as `views.plots.drawn` has them."""
        self.clear()
        with self:
            self._add(blocks, figures or {}, 2)

    def _add(self, blocks: Sequence[Block], figures: Mapping[str, Plot | str], level: int) -> None:
        for block in blocks:
            match block:
                case str():
                    ui.label(block)
                case Soft():
                    ui.label(block.text).classes("soft")
                case Points():
                    with ui.element("ul").classes("points"):
                        for line in block.lines:
                            layout.words("li", line)
                case Verbatim():
                    layout.words("pre", block.text).classes("kept mono")
                case Verdict():
                    ui.label(block.headline).classes({True: "PASS", False: "FAIL", None: ""}[block.good])
                    self._add(block.blocks, figures, level)
                case Table():
                    with self._under(block.title, block.folded, level):
                        put(table(), block)
                case View():
                    with self._under(block.title, block.title if block.folded else "", level):
                        self._add(block.blocks, figures, level + 1)
                case _:
                    self._figure(block.title, block.caption, figures[block.name])

    @contextmanager
    def _under(self, title: str, folded: str, level: int) -> Iterator[None]:
        """Under a heading, or behind the sentence of what is folded."""
        if not folded:
            if title:
                layout.heading(title, level)
            yield
            return
        with ui.expansion(folded, value=folded in self._opened).props("dense").classes("w-full") as fold:
            yield
        fold.on_value_change(lambda event: (self._opened.add if event.value else self._opened.discard)(folded))

    def _figure(self, title: str, caption: str, figure: Plot | str) -> None:
        if isinstance(figure, str):
            ui.element("img").classes("picture").props["src"] = figure
        else:
            Figure(title, figure)
        ui.label(f"{title}. {caption}").classes("soft small")


def _columns(headings: Sequence[str], numbers: Collection[int] = ()) -> list[dict[str, Any]]:
    """Columns as the table takes them, their headings on one line each."""
    return [
        {
            "name": f"c{place}",
            "label": heading[:1].upper() + heading[1:].replace("\n", " "),
            "field": f"c{place}",
            "align": "right" if place in numbers else "left",
            "classes": "text-no-wrap" if place in numbers else "",
        }
        for place, heading in enumerate(headings)
    ]


@contextmanager
def text_table(*headings: str, caption: str = "") -> Iterator[None]:
    """A table of elements, as wide as it must be, with its headings; the rows are filled in."""
    with ui.element("div").classes("compare-scroll"), layout.words("table").classes("compare-table"):
        if caption:
            layout.words("caption", caption)
        with ui.element("thead"), ui.element("tr"):
            for heading in headings:
                layout.words("th", heading).props("scope=col")
        with ui.element("tbody"):
            yield


def numbers(pairs: Sequence[tuple[str, str]]) -> None:
    """Names and values side by side, in the present container, a "dl" of the class "numbers"."""
    for name, value in pairs:
        with ui.element("div"):
            layout.words("dt", name)
            layout.words("dd", value)
