"""The day: contacts over time, what they deliver and how soon, by the relay and directly; computed beside the page."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from nicegui import ui

from microrad.core.progress import Progress
from microrad.mission.file import LinkFile
from microrad.mission.model import Source
from microrad.orbit.day import DayStudy
from microrad.studio import commands
from microrad.studio.pages import layout
from microrad.studio.pages.elements import Blocks
from microrad.studio.pages.in_thread import in_thread
from microrad.studio.session import Session
from microrad.studio.views import day as day_view
from microrad.studio.views.latest import Latest, State, shared
from microrad.studio.views.plots import drawn

TITLE = "Day"
PATH = "/day"

_LOOK_S = 0.25
_Computed = tuple[DayStudy, Mapping[str, Source]]


def page(session: Session) -> None:
    """Progress, then timeline, volumes, latencies and tables."""
    DayPage(session)


class DayPage:
    """The page of one tab; the day is computed once for all tabs."""

    def __init__(self, session: Session) -> None:
        """Build the body, and have it follow the session."""
        self.session, self.shown = session, ""
        self.latest: Latest[_Computed] = shared(session, "day")
        layout.copy_buttons(lambda: commands.contacts(layout.file_of(session)))
        self._progress()
        with ui.column().classes("w-full") as self.results:
            ui.label(
                "A study of a whole mission takes the pointing loss that its loop leaves in place of this one."
            ).classes("soft")
            self.told = Blocks()
        self.results.visible = False
        layout.follow(session, self.reload)
        ui.timer(_LOOK_S, self.look)

    def _progress(self) -> None:
        with ui.row().classes("items-center w-full"):
            self.state = ui.label().props('role="status"')
            self.bar = ui.linear_progress(show_value=False).props('aria-label="Progress"').classes("day-bar")
            self.bar.style("max-width: 20rem")
            self.cancel = ui.button("Cancel", on_click=self.latest.cancel).props("dense no-caps outline")
            self.again = ui.button("Compute", on_click=self.reload).props("dense no-caps outline")
        self.faults = ui.label().classes("faults kept").props('role="alert"')
        self.faults.visible = False

    def reload(self) -> None:
        """Have the day of the draft computed, if it can be."""
        key, draft, file = self.session.key, self.session.draft, self.session.link()
        lacking = "" if file is None else day_view.missing(file)
        self.faults.text = draft.report if file is None else lacking
        self.faults.visible = file is None or bool(lacking)
        if file is not None and not lacking:
            self.latest.ask(key, partial(_computed, file))

    async def look(self) -> None:
        """Show how far it is, and the day once it is there."""
        state = self.latest.state
        self._show_progress(state)
        key = state.key
        if state.result is None or key == self.shown:
            return
        self.shown = key
        blocks = await in_thread(self.results, day_view.blocks, *state.result)
        self.told.show_blocks(blocks, await in_thread(self.results, drawn, blocks))
        self.results.visible = True

    def _show_progress(self, state: State[_Computed]) -> None:
        step = f": {state.done} of {state.total}" if state.total else ""
        now = state.key == self.session.key
        known = "The day of the mission as it stands." if now else "The day of the mission before this."
        words = known if state.result else "Not computed."
        self.state.text = f"Computing, {state.what or 'links'}{step}" if state.running else state.error or words
        self.bar.visible = self.cancel.visible = state.running
        self.again.visible = not state.running and state.result is None and not self.faults.visible
        self.bar.value = state.done / state.total if state.total else 0.0
        layout.grey(self.results, not (now and state.result))


def _computed(file: LinkFile, on_progress: Progress) -> _Computed:
    """The day of a mission, with the sources of its inputs."""
    return day_view.compute_day(file, on_progress), file.sources
