"""The list of jobs: each with its state, progress, output and results, read anew from its folder."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import run, ui

from microrad.studio import commands
from microrad.studio.jobs import Job, JobError
from microrad.studio.pages import layout
from microrad.studio.runs_view import (
    CampaignReport,
    free_name,
    order,
    progress_words,
    result_files,
    state_words,
    time_words,
)
from microrad.studio.workshop import Workshop

RESULTS = "/results"


class JobList:
    """Every job of the workshop, the newest first; `open_page` is called with the address of a page to show."""

    def __init__(self, workshop: Workshop, open_page: Callable[[str, str], None]) -> None:
        """An empty list in the place where it is made; it fills and follows by itself."""
        self.workshop, self.open_page = workshop, open_page
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
            jobs = await run.io_bound(self.workshop.jobs.listed)
            if jobs is None:  # the server is ending
                return
            self._empty.visible = not jobs
            there = {job.number for job in jobs}
            for number in self._cards.keys() - there:
                self._cards.pop(number).element.delete()
            for job in reversed(jobs):
                if job.number not in self._cards:
                    self._add(job)
                await self._cards[job.number].show(job)

    def _add(self, job: Job) -> None:
        with self._place:
            card = self._cards[job.number] = _Card(self, job)
        card.element.move(target_index=0)


class _Card:
    """One job. What stays is built once; what changes is set where it does."""

    def __init__(self, jobs: JobList, job: Job) -> None:
        self.jobs, self.workshop, self.number = jobs, jobs.workshop, job.number
        self._last: Job | None = None
        with ui.element("article").classes("runs-job") as self.element:
            with ui.row().classes("runs-head"):
                layout.heading(f"{job.number}. {job.title}", 3)
                self.state = ui.label().props('role="status"').classes("runs-state")
                self.cancel = ui.button("Cancel", on_click=self._cancel).props("no-caps outline dense")
                self.again = ui.button("Go on", on_click=self._go_on).props("no-caps outline dense")
                self.page = ui.button("Write its report", on_click=self._write_page).props("no-caps outline dense")
                self.drop = ui.button("Remove from the list", on_click=self._remove).props("no-caps flat dense")
            self.bar = ui.linear_progress(0.0, show_value=False, size="8px").props("instant-feedback")
            self.bar.props["aria-label"] = f"Progress of job {job.number}"
            self.progress = ui.label().classes("small")
            self.when = ui.label().classes("small soft")
            self.fault = ui.label().classes("no kept")
            self.results = ui.row().classes("runs-results")
            self.said = layout.words("pre").classes("runs-said").props("tabindex=0")
            if job.arguments:
                layout.words("code", commands.command(_Done(job))).classes("mono runs-command")

    async def show(self, job: Job) -> None:
        """Show the job as it is now."""
        self.when.text = time_words(job)
        if job == self._last:
            return
        ended = job.finished and (self._last is None or not self._last.finished)
        self._last = job
        self.state.text = state_words(job)
        self.state.classes(add=_class(job), remove="yes no soft".replace(_class(job), ""))
        running = job.state == "running"
        self.bar.visible = self.progress.visible = running
        self.cancel.visible, self.drop.visible = not job.finished and not job.cancelling, job.finished
        self.bar.value = 0.0 if job.progress is None else round(job.progress.share, 4)
        self.progress.text = progress_words(job.progress)
        self.fault.text = job.words
        self.fault.visible = bool(job.words)
        stopped = job.state in ("cancelled", "failed", "lost")
        ledger = _ledger(job)
        self.again.visible = stopped and ledger is not None and (job.cwd / ledger).is_file()
        self.page.visible = job.state == "done" and ledger is not None
        if ended:
            await self._ended(job)
        else:
            self.said.visible = self.said.visible and job.finished

    async def _ended(self, job: Job) -> None:
        """What a job has said and written, read once it is over."""
        said = await run.io_bound(self.workshop.jobs.output, job.number)
        self.said.text = (said or "").strip()
        self.said.visible = bool(self.said.text)
        self.results.clear()
        with self.results:
            for place, name in result_files(self.workshop, job):
                address = f"{RESULTS}/{job.number}/{place}"
                if name.endswith(".html"):
                    show = partial(self.jobs.open_page, address, f"{job.number}. {name}")
                    ui.button(f"Show {Path(name).name} here", on_click=show).props("no-caps dense")
                    ui.link(f"{name} in a tab of its own", address, new_tab=True)
                else:
                    ui.link(f"Save {name}", address)

    # --------------------------------------------------------------------------------------------------------- buttons
    def _cancel(self) -> None:
        layout.attempt(lambda: self.workshop.jobs.cancel(self.number))

    def _remove(self) -> None:
        layout.attempt(lambda: self.workshop.jobs.remove(self.number))

    async def _go_on(self) -> None:
        job = self._last
        ledger = None if job is None else _ledger(job)
        if ledger is not None:
            action = commands.CampaignResume(Path(ledger))
            await submit(self.workshop, "campaign", f"Campaign {ledger}, going on", action)

    async def _write_page(self) -> None:
        job = self._last
        ledger = None if job is None else _ledger(job)
        if ledger is not None:
            page = await run.io_bound(free_name, self.workshop, Path(ledger).stem, ".html") or ""
            await submit(self.workshop, "export", f"Report of {ledger}", CampaignReport(Path(ledger), Path(page)))


class _Done:
    """A job as an action, for its command."""

    def __init__(self, job: Job) -> None:
        self.arguments, self.results, self.python = job.arguments, job.results, ""


def _class(job: Job) -> str:
    if job.state == "done":
        return "no" if job.code == 1 else "yes"
    return "no" if job.state in ("failed", "lost", "unreadable") else "soft"


def _ledger(job: Job) -> str | None:
    """The ledger that a campaign writes."""
    return next((name for name in job.results if name.endswith(".ledger")), None) if job.kind == "campaign" else None


async def submit(workshop: Workshop, kind: Any, title: str, action: commands.Action) -> bool:
    """Put an action into the queue; says why it cannot be, and whether it is."""
    try:
        await run.io_bound(workshop.jobs.submit, order(workshop, kind, title, action))
    except (JobError, OSError) as error:
        layout.refuse(str(error))
        return False
    return True
