"""The list of jobs: each with its state, progress, output and results, read anew from its folder."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from pathlib import Path

from nicegui import ui

from microrad.studio import commands
from microrad.studio.jobs.ledgers import Live
from microrad.studio.jobs.queue import Job, JobError, Order
from microrad.studio.pages import layout
from microrad.studio.pages.elements import Blocks, Figure
from microrad.studio.pages.in_thread import in_thread
from microrad.studio.session import Session
from microrad.studio.views.campaign import Figures, figures
from microrad.studio.views.runs import (
    Others,
    ledger_of,
    ledger_path,
    order,
    others,
    progress_words,
    report_order,
    result_files,
    state_words,
    time_words,
)

_LOOK_S = 1.0


RESULTS = "/results"


class JobList:
    """Every job of the session, the newest first; `open_page` is called with the address of a page to show."""

    def __init__(self, session: Session, open_page: Callable[[str, str], None]) -> None:
        """An empty list in the place where it is made; it fills and follows by itself.

        Args:
            session: the session of all tabs.
            open_page: called with address and title of a page to show.
        """
        self.session, self.open_page = session, open_page
        self._empty = ui.label("Nothing was run in this folder yet.").classes("soft")
        self._place = ui.column().classes("runs-list")
        self._cards: dict[int, _Card] = {}
        self._busy = asyncio.Lock()
        ui.timer(layout.POLL_S, self.refresh)

    async def refresh(self) -> None:
        """Read every job and show what has changed."""
        if self._busy.locked():
            return
        async with self._busy:
            jobs = await in_thread(self._place, self.session.jobs.listed)
            self._empty.visible = not jobs
            there = {job.number for job in jobs}
            for number in self._cards.keys() - there:
                self._cards.pop(number).element.delete()
            for job in reversed(jobs):
                if job.number not in self._cards:
                    self._add(job)
                await self._cards[job.number].show(job, others(jobs, job))

    def _add(self, job: Job) -> None:
        with self._place:
            card = self._cards[job.number] = _Card(self, job)
        card.element.move(target_index=0)


class _Card:
    """One job. What stays is built once; what changes is set where it does."""

    def __init__(self, jobs: JobList, job: Job) -> None:
        self.jobs, self.session, self.number = jobs, jobs.session, job.number
        self._last: Job | None = None
        self._beside: Others | None = None
        self._panel: CampaignPanel | None = None
        with ui.element("article").classes("runs-job") as self.element:
            with ui.row().classes("runs-head"):
                layout.heading(f"{job.number}. {job.title}", 3)
                self.state = ui.label().props('role="status"').classes("runs-state")
                self.cancel = ui.button("Cancel", on_click=self._cancel).props("no-caps outline dense")
                self.again = ui.button("Go on", on_click=self._go_on).props("no-caps outline dense")
                self.figures = ui.button("Show its figures", on_click=self._toggle).props("no-caps outline dense")
                self.page = ui.button("Write its report", on_click=self._write_page).props("no-caps outline dense")
                self.drop = ui.button("Remove from the list", on_click=self._remove).props("no-caps flat dense")
            self.bar = ui.linear_progress(0.0, show_value=False, size="8px").props("instant-feedback")
            self.bar.props["aria-label"] = f"Progress of job {job.number}"
            self.progress = ui.label().classes("small")
            self.when = ui.label().classes("small soft")
            self.fault = ui.label().classes("no kept")
            with ui.row().classes("runs-results"):
                self.report, self.results = (ui.row().classes("runs-results") for _ in range(2))
            self.place = ui.element("div")
            with ui.element("details").classes("runs-details") as self.details:
                layout.words("summary", "What it printed")
                self.said = layout.words("pre").classes("runs-said").props("tabindex=0")
            if job.kind not in ("campaign", "identification"):  # figures and the page of the mirror say the same
                self.details.props("open")
            if job.arguments:
                layout.words("code", commands.Action(job.arguments).command).classes("mono runs-command")

    async def show(self, job: Job, beside: Others) -> None:
        """Show the job as it is now, beside the others."""
        self.when.text = time_words(job)
        if job == self._last and beside == self._beside:
            return
        ended = job.finished and (self._last is None or not self._last.finished)
        self._last, self._beside = job, beside
        self.state.text = state_words(job)
        self.state.classes(add=_class(job), remove="yes no soft".replace(_class(job), ""))
        running = job.state == "running"
        self.bar.visible = self.progress.visible = running
        self.cancel.visible, self.drop.visible = not job.finished and not job.cancelling, job.finished
        self.bar.value = 0.0 if job.progress is None else round(job.progress.share, 4)
        self.progress.text = progress_words(job.progress)
        self.fault.text = job.words
        self.fault.visible = bool(job.words)
        self._campaign(job, beside)
        if ended:
            await self._ended(job)
        else:
            self.details.visible = job.finished and bool(self.said.text)

    def _campaign(self, job: Job, beside: Others) -> None:
        """What a campaign has beside other jobs: its figures, the way on, and its report."""
        path = ledger_path(self.session, job) if beside.newest else None
        there = path is not None and path.is_file()
        self.results.visible = job.kind != "campaign" or beside.newest  # else another job may be writing to it
        self.again.visible = there and job.state in ("cancelled", "failed", "lost")
        self.page.visible = there and job.state == "done" and beside.report is None
        self.figures.visible = path is not None and (there or job.state == "running")
        if path is None or not self.figures.visible:
            if self._panel is not None:
                self._panel.open = False
        elif self._panel is None:
            with self.place:
                self._panel = CampaignPanel(self.session, path)
            self._panel.open = beside.latest or job.state == "running"
        self._name_figures()
        self._link_report(beside.report)

    def _link_report(self, report: Job | None) -> None:
        """The report of a campaign, where it is written or is being written."""
        self.report.clear()
        if report is None:
            return
        with self.report:
            if report.state == "done":
                self._open_links(report, 0, report.results[0])
            else:
                ui.label(f"Its report is written by job {report.number}: {state_words(report)}").classes("small soft")

    def _toggle(self) -> None:
        if self._panel is not None:
            self._panel.open = not self._panel.open
            self._name_figures()

    def _name_figures(self) -> None:
        self.figures.text = "Hide its figures" if self._panel is not None and self._panel.open else "Show its figures"

    async def _ended(self, job: Job) -> None:
        """What a job has said and written, read once it is over."""
        said = await in_thread(self.element, self.session.jobs.output, job.number)
        self.said.text = said.strip()
        self.details.visible = bool(self.said.text)
        self.results.clear()
        with self.results:
            for place, name in result_files(self.session, job):
                self._open_links(job, place, name)

    def _open_links(self, job: Job, place: int, name: str) -> None:
        """A result of a job: to be shown here where it is a page, else to be saved."""
        address = f"{RESULTS}/{job.number}/{place}"
        if not name.endswith(".html"):
            ui.link(f"Save {name}", address)
            return
        show = partial(self.jobs.open_page, address, f"{job.number}. {name}")
        ui.button(f"Show {Path(name).name} here", on_click=show).props("no-caps dense")
        ui.link(f"{name} in a tab of its own", address, new_tab=True)

    # --------------------------------------------------------------------------------------------------------- buttons
    def _cancel(self) -> None:
        layout.attempt(lambda: self.session.jobs.cancel(self.number))

    def _remove(self) -> None:
        layout.attempt(lambda: self.session.jobs.remove(self.number))

    async def _go_on(self) -> None:
        await self._with_ledger(lambda ledger: order(self.session, "campaign", commands.resume(ledger)))

    async def _write_page(self) -> None:
        await self._with_ledger(partial(report_order, self.session))

    async def _with_ledger(self, make: Callable[[Path], Order]) -> None:
        """Queue what is made of the campaign's ledger."""
        ledger = None if self._last is None else ledger_of(self._last)
        if ledger is not None:
            await submit(self.element, self.session, partial(make, Path(ledger)))


def _class(job: Job) -> str:
    if job.state == "done":
        return "no" if job.code == 1 else "yes"
    return "no" if job.state in ("failed", "lost", "unreadable") else "soft"


async def submit(page: ui.element, session: Session, make: Callable[[], Order]) -> bool:
    """Queue what `make` returns; says on the page of this element why it cannot be, and returns whether it is.

    Args:
        page: an element of the page.
        session: the session of all tabs.
        make: makes the order, in a thread.
    """
    try:
        await in_thread(page, lambda: session.jobs.submit(make()))
    except (JobError, OSError) as error:
        layout.refuse(str(error))
        return False
    return True


# ------------------------------------------------------------------------------------------------ figures of a campaign
class CampaignPanel:
    """What the rows of a ledger say; it looks by itself while it is open."""

    def __init__(self, session: Session, ledger: Path) -> None:
        """Closed, with nothing read.

        Args:
            session: the session of all tabs.
            ledger: path of the ledger; it may not be there yet.
        """
        self.session, self.ledger = session, ledger
        self._last: Live | None = None
        self._found: Figures | None = None
        self.place = ui.element("section").classes("runs-figures").props('aria-label="Figures of the campaign"')
        self.place.visible = False
        with self.place:
            self._rows = ui.label().classes("runs-rows")
            self._headline = ui.label().classes("kept")
            with ui.element("div").classes("runs-plot") as self._drawn:
                self._chosen = ui.select({}, label="Shown", on_change=self._draw).props("dense outlined")
                self._plot = Figure("Distribution over the rows")
            self._told = Blocks()
            self._fault = ui.label().classes("no kept")
        self._timer = ui.timer(_LOOK_S, self._look, active=False)
        self._clear("Reading the ledger ...")

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
        if found is None:
            self._clear("No row is in the ledger yet.")
        else:
            self._show(found)
        self._fault.text = live.fault
        self._fault.visible = bool(live.fault)
        self._rows.visible = found is not None or not live.fault

    def _clear(self, said: str) -> None:
        """Say why there are no rows to show."""
        self._found = None
        self._rows.text = said
        for each in (self._headline, self._drawn, self._told, self._fault):
            each.visible = False

    def _show(self, found: Figures) -> None:
        self._found = found
        self._rows.text, self._headline.text = found.rows, found.headline
        self._headline.visible = self._told.visible = True
        self._told.show_blocks(found.blocks)
        self._drawn.visible = bool(found.plots)
        names = {name: name for name in found.plots}
        if names != self._chosen.options:
            keep = self._chosen.value if self._chosen.value in names else next(iter(names), None)
            self._chosen.set_options(names, value=keep)
        self._chosen.visible = len(names) > 1
        self._draw()

    def _draw(self) -> None:
        plot = None if self._found is None else self._found.plots.get(self._chosen.value or "")
        if plot is not None:
            self._plot.props["aria-label"] = f"Distribution over the rows: {self._chosen.value}"
            self._plot.show(plot)
