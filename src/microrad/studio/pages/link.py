"""The links: sliders for what they are made of, and margins, budgets and the margin map that follow at once."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from functools import partial

from nicegui import ui

from microrad.core.progress import Progress
from microrad.link import study as link_study
from microrad.link.study import LinkStudy
from microrad.mission.file import LinkFile
from microrad.report.links.views import budget_table
from microrad.report.marks import Marks
from microrad.report.view import Block
from microrad.studio import commands
from microrad.studio.pages import layout
from microrad.studio.pages.elements import Blocks, Figure, MarginCards, put, table
from microrad.studio.pages.in_thread import in_thread
from microrad.studio.pages.sliders import SliderPage
from microrad.studio.session import Session
from microrad.studio.views import link as link_view
from microrad.studio.views.latest import Latest, shared
from microrad.studio.views.link import LinkView
from microrad.studio.views.plots import Plot, drawn

TITLE = "Links"
PATH = "/link"

_LOOK_S, _REST_S = 0.25, 0.8


def page(session: Session) -> None:
    """Sliders at the left; margins, map and tables at the right."""
    LinkPage(session)


class LinkPage(SliderPage[LinkView]):
    """The page of one tab."""

    def __init__(self, session: Session) -> None:
        """Build the body, and have it follow the session."""
        self.study: Latest[LinkStudy] = shared(session, "links")
        self.shown, self.rested = "", ("", 0.0)
        layout.copy_buttons(lambda: commands.budget(layout.file_of(session)))
        super().__init__(session, link_view.sliders, self._view, link_view.second)
        ui.timer(_LOOK_S, self._look)

    def build(self) -> None:
        """Margins, map, budgets, and what takes a second."""
        layout.heading("Margins")
        self.cards = MarginCards()
        layout.heading("Margin map")
        self.map = Figure("Link margin over data rate and pointing error; in words below").classes("margin-map")
        self.key = ui.label().classes("soft")
        self.words = ui.label().props('role="status"')
        layout.heading("Budgets")
        self.which = ui.toggle([], on_change=self._show_table).props('no-caps dense aria-label="Budget shown"')
        self.table = table()
        layout.heading("What follows")
        self.state = ui.label().classes("soft").props('role="status"')
        self.told = Blocks()
        self.dimmed = (self.cards, self.map, self.key, self.words, self.table)

    async def show(self, view: LinkView) -> None:
        """Margins and map."""
        self.cards.show(view.margins)
        await self.map.draw(link_view.map_plot(view))

    def show_rest(self, view: LinkView) -> None:
        """The map in words, and the budgets."""
        self.key.text = link_view.map_key(view.data.requirement.margin_db)
        self.words.text = link_view.map_words(view)
        self._tabs()

    def _view(self, file: LinkFile) -> LinkView:
        """Budgets and map, on the axes that the map has."""
        return link_view.view(file, None if self.view_now is None else self.view_now.frame)

    def _tabs(self) -> None:
        names = [b.name for b in self.view_now.budgets] if self.view_now else []
        if names != self.which.options:
            chosen = self.which.value if self.which.value in names else names[0] if names else None
            self.which.set_options(names, value=chosen)
        self._show_table()

    def _show_table(self) -> None:
        if self.view_now is None:
            return
        marks = Marks.of(self.view_now.sources)
        for budget in self.view_now.budgets:
            if budget.name == self.which.value:
                put(self.table, marks.table(budget_table(budget)))

    async def _look(self) -> None:
        """Have the study of the links made once a draft rests, and show it once it is there."""
        self._ask_study()
        state = self.study.state
        now = state.key == self.session.key and state.result is not None
        before = "" if now or self.shown == "" else "Of the mission before this:"
        computing = "Computing acquisition and what moves the margins ..." if state.running else ""
        self.state.text = computing or state.error or before
        self.state.visible = bool(self.state.text)
        layout.grey(self.told, not now)
        if state.result is None or state.key == self.shown:
            return
        self.shown = state.key
        self.told.show_blocks(*await in_thread(self.told, _told, state.result))

    def _ask_study(self) -> None:
        """It takes a second of a core: not for every step of a slider."""
        key, now = self.session.key, time.monotonic()
        if self.rested[0] != key:
            self.rested = (key, now)
        elif now - self.rested[1] > _REST_S and self.study.state.key != key:
            file = self.session.link()
            if file is not None:
                self.study.ask(key, partial(_study, file))


def _told(study: LinkStudy) -> tuple[Sequence[Block], Mapping[str, Plot | str]]:
    """What follows from a study, and the figures of it."""
    blocks = link_view.blocks(study)
    return blocks, drawn(blocks)


def _study(file: LinkFile, progress: Progress) -> LinkStudy:
    progress(0, 0, "links")
    return link_study.run_link_study(file)
