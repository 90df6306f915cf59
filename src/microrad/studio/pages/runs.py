"""Studies and campaigns: started as jobs of their own, which survive the page, with progress, results and reports."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from nicegui import ui

from microrad.studio import commands
from microrad.studio.commands import Action
from microrad.studio.guard.names import NameRefusedError, safe_name, typed_words
from microrad.studio.pages import layout
from microrad.studio.pages.in_thread import in_thread
from microrad.studio.pages.runs_jobs import JobList, submit
from microrad.studio.session import Session
from microrad.studio.views.runs import campaign_files, free_name, ledgers, order, write_campaign

TITLE = "Runs"
PATH = "/runs"


def page(session: Session) -> None:
    """What can be started, the jobs, and a report in its frame."""
    with ui.element("div").classes("runs-start"):
        _Study(session)
        _Campaign(session)
    layout.heading("Jobs")
    ui.label("They run in processes of their own, one after the other, and go on when this page is closed.").classes(
        "soft"
    )
    viewer = _Viewer()
    JobList(session, viewer.show)
    viewer.build()


class _Study:
    """The study of the mission, into a folder."""

    def __init__(self, session: Session) -> None:
        self.session = session
        with ui.element("section").classes("runs-card").props('aria-label="Study"'):
            layout.heading("Study of the mission")
            self.about = ui.label().classes("soft")
            self.folder = ui.input("Folder for the results").props("dense outlined").classes("runs-name")
            with ui.row().classes("runs-go"):
                self.button = ui.button("Run the study", on_click=self._run).props("no-caps")
                layout.copy_buttons(self._copied)
            self.fault = ui.label().classes("no kept").props('role="alert"')
        layout.follow(session, self._look)
        ui.timer(0.0, self._name, once=True)

    def _look(self) -> None:
        draft, faults = self.session.draft, self._faults()
        self.about.text = f"Everything that follows from {self.session.name_of(draft.path)}: verdict, figures, report."
        self.button.text = "Save and run the study" if draft.changed else "Run the study"
        self.button.enabled = not faults
        self.fault.text = faults

    def _faults(self) -> str:
        return self.session.faults() or self.session.disk_words()

    async def _name(self) -> None:
        """Propose a folder, unless one was typed meanwhile."""
        before, stem = self.folder.value, f"{self.session.draft.path.stem}-study"
        name = await in_thread(self.folder, free_name, self.session, stem)
        if self.folder.value == before:
            self.folder.value = name

    def _copied(self) -> Action | None:
        layout.file_of(self.session)
        return self._action()

    def _action(self) -> Action | None:
        try:
            name = safe_name(self.folder.value or "")
        except NameRefusedError as error:
            self.fault.text = typed_words(error)
            return None
        self.fault.text = self._faults()
        return commands.study(Path(self.session.name_of(self.session.draft.path)), Path(name))

    async def _run(self) -> None:
        action = self._action()
        if action is None or self._faults() or (self.session.draft.changed and not layout.save_draft(self.session)):
            return
        if await submit(self.folder, self.session, partial(order, self.session, "study", action)):
            await self._name()


class _Campaign:
    """Campaigns of the folder: a new one from a file, or one that goes on from its ledger."""

    def __init__(self, session: Session) -> None:
        self.session = session
        with ui.element("section").classes("runs-card").props('aria-label="Campaign"'):
            layout.heading("Campaign")
            ui.label("Many runs of a mission with drawn inputs: tails, sweeps, sensitivity.").classes("soft")
            self.file = ui.select([], label="Campaign file", on_change=self._name)
            self.file.props("dense outlined").classes("runs-name")
            self.ledger = ui.input("Ledger").props("dense outlined").classes("runs-name")
            with ui.row().classes("runs-go"):
                self.button = ui.button("Run the campaign", on_click=self._run).props("no-caps")
                ui.button("Write an example", on_click=self._example).props("no-caps outline")
                layout.copy_buttons(self._action)
            self.fault = ui.label().classes("no kept").props('role="alert"')
        ui.timer(0.0, self._look, once=True)
        ui.timer(4.0, self._look)

    async def _look(self) -> None:
        """The files that there are, which others may write meanwhile."""
        names = await in_thread(self.file, campaign_files, self.session)
        going = [f"{name} (go on)" for name in await in_thread(self.file, ledgers, self.session)]
        options = [*names, *going]
        if options != self.file.options:
            keep = self.file.value if self.file.value in options else next(iter(options), None)
            self.file.set_options(options, value=keep)
            await self._name()
        self.button.enabled = bool(options)

    async def _name(self) -> None:
        self.fault.text = ""
        chosen = self.file.value or ""
        self.ledger.enabled = not chosen.endswith(" (go on)")
        stem = chosen.removesuffix(" (go on)").rpartition(".")[0]
        if chosen.endswith(" (go on)"):
            self.ledger.value = chosen.removesuffix(" (go on)")
        elif stem:
            self.ledger.value = await in_thread(self.file, free_name, self.session, stem, ".ledger")

    def _action(self) -> Action | None:
        chosen = self.file.value or ""
        try:
            ledger = safe_name(self.ledger.value or "")
        except NameRefusedError as error:
            self.fault.text = typed_words(error)
            return None
        self.fault.text = ""
        if not chosen:
            self.fault.text = "There is no campaign file in this folder yet; write an example, and change it."
            return None
        if chosen.endswith(" (go on)"):
            return commands.resume(Path(ledger))
        return commands.campaign(Path(chosen), Path(ledger))

    async def _run(self) -> None:
        self.fault.text = ""
        action = self._action()
        if action is None:
            return
        if await submit(self.file, self.session, partial(order, self.session, "campaign", action)):
            await self._name()

    async def _example(self) -> None:
        self.fault.text = ""
        try:
            path = await in_thread(self.file, write_campaign, self.session)
        except (ValueError, OSError) as error:
            self.fault.text = str(error)
            return
        await self._look()
        if path is not None and path.name in self.file.options:
            self.file.value = path.name


class _Viewer:
    """A finished report in a frame of the page, below the list."""

    def build(self) -> None:
        """The place where a report is shown."""
        self.place = ui.element("section").classes("runs-viewer").props('aria-label="Report"')

    def show(self, address: str, title: str) -> None:
        """Show the document at an address of the studio."""
        self.place.clear()
        with self.place:
            with ui.row().classes("runs-head"):
                layout.heading(title)
                ui.button("Close the report", on_click=self.place.clear).props("no-caps outline dense")
            frame = ui.element("iframe").classes("runs-frame")
            frame.props["src"], frame.props["title"] = address, title
        ui.run_javascript("document.querySelector('.runs-viewer').scrollIntoView({behavior: 'smooth'})")
