"""What several pages are made of: plots, tables and the cards of margins.

Plots and cards keep what they show in the browser, and are told what is new: for a change of an element's properties or
text NiceGUI builds the whole page anew, which takes longer than drawing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from typing import Any

from nicegui import ui
from nicegui.element import Element

from microrad.report.plotting.figure import Figure as Drawn
from microrad.report.tables import Cell, Table
from microrad.report.view import Block, Drawing, Points, Soft, Verbatim, Verdict, View
from microrad.studio.pages import layout
from microrad.studio.pages.in_thread import stay
from microrad.studio.views.link import Margin
from microrad.studio.views.plots import Plot, empty

_DRAWN_S = 5.0
"""For how long a browser may draw before it is asked for more."""


class Figure(Element, component="figure.js"):
    """A plot; `label` says what it shows and where the same stands in words, `begin` is what is drawn at first."""

    def __init__(self, label: str, begin: Plot | None = None) -> None:
        """Build it in the present container.

        Args:
            label: what it shows, and where the same stands in words.
            begin: what is drawn at first.
        """
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
    """A table of text that is still empty.

    Args:
        headings: of the columns.
        numbers: columns that hold numbers, counted from 0.
    """
    made = ui.table(rows=[], columns=_columns(headings, numbers), row_key="id").props(
        "flat dense wrap-cells hide-bottom tabindex=0"
    )
    made.props(""":pagination='{rowsPerPage: 0}' :table-row-class-fn="row => row.total ? 'total' : ''" """)
    return made.classes("wide-table")


def fill(made: ui.table, rows: Sequence[Sequence[str | Cell]], totals: int = 0) -> None:
    """Show these rows, of which the last `totals` stand out, each cell in the colour of its mark.

    Nothing is sent where nothing changes.

    Args:
        made: the table.
        rows: what it is to show.
        totals: how many of the last rows are sums.
    """
    found = [
        {"id": place, "total": place >= len(rows) - totals}
        | {f"c{k}": str(cell) for k, cell in enumerate(row)}
        | {f"mark{k}": cell.mark for k, cell in enumerate(row) if isinstance(cell, Cell)}
        for place, row in enumerate(rows)
    ]
    if found != made.rows:
        made.rows = found


def put(made: ui.table, of: Table) -> None:
    """Show a table of the report.

    Args:
        made: the table on the page.
        of: what it is to show.
    """
    columns = _columns(of.headings, [k for k in range(len(of.headings)) if k not in of.words])
    if columns != made.columns:
        made.columns = columns
    fill(made, of.rows, of.totals)


class Blocks(ui.column):
    """What a view of the report holds; others of the same form change in place: what one reads or unfolds stays."""

    def __init__(self) -> None:
        """Nothing is shown yet."""
        super().__init__()
        self.classes("w-full")
        self._form: tuple[Any, ...] = ()
        self._parts: list[Any] = []

    def show_blocks(self, blocks: Sequence[Block], figures: Mapping[str, Plot | str] | None = None) -> None:
        """Show these in place of what was there.

        Args:
            blocks: what is to be shown.
            figures: their figures by name, as `views.plots.drawn` has them.
        """
        drawn, form = figures or {}, _form(blocks)
        if form != self._form:
            self._form, self._parts = form, []
            self.clear()
            with self:
                self._build(blocks, drawn, 2)
        else:
            for part, block in zip(self._parts, _each(blocks), strict=True):
                if isinstance(block, Drawn | Drawing):
                    _draw(part[0], drawn[block.name])
                _say(part, block)

    def _build(self, blocks: Sequence[Block], drawn: Mapping[str, Plot | str], level: int) -> None:
        for block in blocks:
            part, inside = _part(block, drawn, level)
            self._parts.append(part)
            _say(part, block)
            with inside:
                self._build(getattr(block, "blocks", ()), drawn, level + isinstance(block, View))


def _part(block: Block, drawn: Mapping[str, Plot | str], level: int) -> tuple[Any, AbstractContextManager[Any]]:
    """What is built once for a block, and where the blocks within it go."""
    match block:
        case View() | Table():
            fold = ui.expansion().props("dense").classes("w-full") if block.folded else None
            if fold is None and block.title:
                layout.heading(block.title, level)
            inside = fold or nullcontext()
            with inside:
                return (fold, table() if isinstance(block, Table) else None), inside
        case Points():
            return ui.element("ul").classes("points"), nullcontext()
        case Drawn() | Drawing():
            return (_figure(block.title, drawn[block.name]), ui.label().classes("soft small")), nullcontext()
    look = _LOOKS.get(block.good if isinstance(block, Verdict) else type(block), "")
    return ui.label().classes(look), nullcontext()


def _figure(title: str, drawn: Plot | str) -> Element:
    if not isinstance(drawn, str):
        return Figure(title, drawn)
    made = ui.element("img").classes("picture")
    made.props["alt"], made.props["src"] = title, drawn
    return made


def _draw(made: Element, drawn: Plot | str) -> None:
    if isinstance(made, Figure) and not isinstance(drawn, str):
        made.show(drawn)
    else:
        made.props["src"] = drawn


def _say(part: Any, block: Block) -> None:
    """Show the texts of a block in what was built for one of its form."""
    match block:
        case View() | Table():
            fold, made = part
            if isinstance(block, Table):
                put(made, block)
            if fold is not None:
                fold.text = block.folded if isinstance(block, Table) else block.title
        case Points():
            part.clear()
            with part:
                for line in block.lines:
                    layout.words("li", line)
        case Drawn() | Drawing():
            part[1].text = f"{block.title}. {block.caption}"
        case Verdict():
            part.text = block.headline
        case _:
            part.text = getattr(block, "text", block)


_LOOKS: dict[object, str] = {Soft: "soft", Verbatim: "kept mono", True: "PASS kept", False: "FAIL kept"}


def _form(blocks: Sequence[Block]) -> tuple[Any, ...]:
    """What of blocks is built once."""
    return tuple(
        (
            type(block),
            "" if isinstance(block, str) else getattr(block, "title", ""),
            bool(getattr(block, "folded", "")),
            getattr(block, "good", None),
            _form(getattr(block, "blocks", ())),
        )
        for block in blocks
    )


def _each(blocks: Sequence[Block]) -> Iterator[Block]:
    """Every block, those within others behind them."""
    for block in blocks:
        yield block
        yield from _each(getattr(block, "blocks", ()))


def _columns(headings: Sequence[str], numbers: Collection[int] = ()) -> list[dict[str, Any]]:
    """Columns as the table takes them, their headings on one line each."""
    return [
        {
            "name": f"c{place}",
            "label": heading[:1].upper() + heading[1:].replace("\n", " "),
            "field": f"c{place}",
            "align": "right" if place in numbers else "left",
            ":classes": f"row => `{'text-no-wrap' if place in numbers else ''} ${{row.mark{place} ?? ''}}`",
        }
        for place, heading in enumerate(headings)
    ]
