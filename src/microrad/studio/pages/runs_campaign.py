"""The figures of a campaign within its job: read from the ledger while it grows, the same in every tab."""

from __future__ import annotations

from pathlib import Path

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from microrad.studio.jobs.ledgers import Live
from microrad.studio.pages import layout
from microrad.studio.pages.elements import Figure
from microrad.studio.pages.in_thread import in_thread
from microrad.studio.session import Session
from microrad.studio.views.campaign import Figures, Table, figures

_LOOK_S = 1.0
_LONG = 60  # characters that may not stand on one line


class CampaignPanel:
    """What the rows of a ledger say; it looks by itself while it is open."""

    def __init__(self, session: Session, ledger: Path) -> None:
        """Closed, with nothing read."""
        self.session, self.ledger = session, ledger
        self._last: Live | None = None
        self._found: Figures | None = None
        self._tables: list[_Table] = []
        self.place = ui.element("section").classes("runs-figures").props('aria-label="Figures of the campaign"')
        self.place.visible = False
        with self.place:
            self._rows = ui.label("Reading the ledger ...").classes("runs-rows")
            self._headline = ui.label().classes("kept")
            with ui.element("div").classes("runs-side"):
                self._left = ui.element("div").classes("runs-tables")
                with ui.element("div").classes("runs-plot") as self._right:
                    self._chosen = ui.select({}, label="Shown", on_change=self._draw).props("dense outlined")
                    self._plot = Figure("Distribution over the rows")
            self._below = ui.element("div").classes("runs-tables")
            self._notes = ui.label().classes("small kept soft")
            self._fault = ui.label().classes("no kept")
        self._timer = ui.timer(_LOOK_S, self._look, active=False)
        self._clear()

    @property
    def open(self) -> bool:
        """Whether it is shown, and looks."""
        return bool(self.place.visible)

    @open.setter
    def open(self, wanted: bool) -> None:
        self.place.visible = self._timer.active = wanted

    async def _look(self) -> None:
        """Read what is new, and show it."""
        live = await in_thread(self.place, self.session.campaigns.look, self.ledger)
        if live is self._last:  # nothing is new
            return
        self._last = live
        found = await in_thread(self.place, figures, live)
        self._fault.text = live.fault
        self._fault.visible = bool(live.fault)
        if found is None:
            self._clear()
        else:
            self._show(found)

    def _clear(self) -> None:
        """Say that there are no rows yet."""
        self._found = None
        self._rows.text = "No row is in the ledger yet."
        for each in (self._headline, self._left, self._right, self._below, self._notes, self._fault):
            each.visible = False

    def _show(self, found: Figures) -> None:
        self._found = found
        self._rows.text, self._headline.text, self._notes.text = found.rows, found.headline, "\n".join(found.notes)
        self._headline.visible = self._left.visible = self._below.visible = True
        self._notes.visible = bool(found.notes)
        self._show_tables(found.tables)
        self._right.visible = bool(found.plots)
        names = {name: name for name in found.plots}
        if names != self._chosen.options:
            keep = self._chosen.value if self._chosen.value in names else next(iter(names), None)
            self._chosen.set_options(names, value=keep)
        self._chosen.visible = len(names) > 1
        self._draw()

    def _show_tables(self, tables: tuple[Table, ...]) -> None:
        """Texts change in place: what one reads or has marked stays."""
        if [each.form for each in self._tables] != [_form(table) for table in tables]:
            for place in (self._left, self._below):
                place.clear()
            self._tables = [_Table(table, self._below if table.wide else self._left) for table in tables]
        for shown, table in zip(self._tables, tables, strict=True):
            shown.set(table)

    def _draw(self) -> None:
        plot = None if self._found is None else self._found.plots.get(self._chosen.value or "")
        if plot is not None:
            self._plot.props["aria-label"] = f"Distribution over the rows: {self._chosen.value}"
            self._plot.show(plot)


def _form(table: Table) -> tuple[str, tuple[str, ...], int]:
    """What of a table is built once."""
    return table.title, table.headings, len(table.rows)


class _Table:
    """A table whose cells change."""

    def __init__(self, table: Table, place: ui.element) -> None:
        self.form = _form(table)
        self._cells: list[TextElement] = []
        with (
            place,
            ui.element("div").classes("compare-scroll"),
            layout.words("table").classes("compare-table runs-table"),
        ):
            layout.words("caption", table.title)
            with ui.element("thead"), ui.element("tr"):
                for heading in table.headings:
                    layout.words("th", heading).props("scope=col")
            with ui.element("tbody"):
                for row in table.rows:
                    with ui.element("tr"):
                        for column, text in enumerate(row):
                            tag, kind = ("th", "") if column == 0 else ("td", "text" if len(text) > _LONG else "number")
                            self._cells.append(layout.words(tag, text).classes(kind))

    def set(self, table: Table) -> None:
        """Show the texts of another table of the same form."""
        for cell, text in zip(self._cells, (text for row in table.rows for text in row), strict=True):
            cell.text = text
