"""The identification as it goes on: which model is being fitted, the best so far over the measured loop, the end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nicegui import ui

from microrad.lab.live_fit import LiveFit
from microrad.studio.draft.tables import with_mirror_file
from microrad.studio.jobs.queue import Job
from microrad.studio.pages import layout
from microrad.studio.pages.elements import Blocks, Figure, fill, table
from microrad.studio.pages.in_thread import in_thread
from microrad.studio.session import Session
from microrad.studio.views import mirror as mirror_view

_LOOK_S = 0.5
_BEST = -1


class JobView:
    """The newest identification, or the one that was chosen; everything is read from its job's folder."""

    def __init__(self, session: Session) -> None:
        """Build the panel, and look at the job from time to time."""
        self.session, self.number = session, 0
        self.fits: tuple[LiveFit, ...] = ()
        self.drive_unit, self.chosen = "V", ""
        self.state: object = None
        self.drawn: object = None
        layout.heading("Identification")
        self.which = ui.select({}, label="Identification", on_change=self.choose).props("dense outlined options-dense")
        self.which.visible = False
        self.words = ui.label("Nothing was identified yet.").props('role="status"').classes("kept")
        self.bar = ui.linear_progress(0.0, show_value=False).props('aria-label="Progress of the identification"')
        self.cancel = ui.button("Cancel", on_click=self.stop).props("dense no-caps outline").classes("self-start")
        self._live()
        self.end = ui.column().classes("w-full gap-1")
        self.told = Blocks()
        for each in (self.bar, self.cancel, self.live):
            each.visible = False
        ui.timer(_LOOK_S, self.look)

    def _live(self) -> None:
        with ui.column().classes("w-full") as self.live:
            with ui.row():
                self.model = ui.select({_BEST: "best so far"}, value=_BEST, label="Model shown", on_change=self.draw)
                self.recording = ui.select({0: ""}, value=0, label="Recording shown", on_change=self.draw)
                for each in (self.model, self.recording):
                    each.props("dense outlined options-dense").style("min-width: 14rem")
            with ui.element("div").classes("plots"):
                self.loop = Figure("Measured loop and that of the model")
                self.residual = Figure("Residual over time")
            ui.label("Residuals in per cent of the peak-to-peak output.").classes("soft small")
            self.table = table(("Model", "Held out (rms)", "Fitted (rms)", "Note"), numbers=(1, 2))

    # --------------------------------------------------------------------------------------------------------- the job
    async def follow(self, number: int) -> None:
        """Show another identification."""
        self.number, self.state = number, None
        await self.look()

    async def choose(self, event: Any) -> None:
        """Show the identification that was chosen."""
        if event.value and event.value != self.number:
            await self.follow(event.value)

    def stop(self) -> None:
        """Cancel the identification."""
        layout.attempt(lambda: self.session.jobs.cancel(self.number))

    async def look(self) -> None:
        """Read the jobs, and show what has changed."""
        asked = self.number
        jobs, fits = await in_thread(self.end, self._read)
        if not jobs or self.number != asked:  # another one was chosen meanwhile, and is read by itself
            return
        found = next((job for job in jobs if job.number == self.number), jobs[0])
        self.number = found.number
        names = {job.number: f"{job.number}: {job.title} ({job.state})" for job in jobs}
        if names != self.which.options or self.which.value != self.number:
            self.which.set_options(names, value=self.number)
        self.which.visible = len(jobs) > 1
        state = (found, len(fits))
        if state != self.state:
            self.state, self.fits = state, fits
            self._show(found)

    def _read(self) -> tuple[list[Job], tuple[LiveFit, ...]]:
        jobs = [job for job in self.session.jobs.listed() if job.kind == "identification"]
        found = next((job for job in jobs if job.number == self.number), jobs[0] if jobs else None)
        return jobs, () if found is None else mirror_view.read_fits(found.folder)

    # --------------------------------------------------------------------------------------------------------- showing
    def _show(self, job: Job) -> None:
        self.drive_unit = mirror_view.argument(job, "--input-unit", "V")
        end = mirror_view.outcome(self.session.jobs.output(job.number)) if job.state == "done" else None
        self.chosen, said = end or ("", ())
        self.words.text = mirror_view.state_words(job, mirror_view.leader(self.fits, self.chosen))
        self.bar.visible = self.cancel.visible = not job.finished
        self.bar.value = 0.0 if job.progress is None else job.progress.share
        self.live.visible = bool(self.fits)
        fill(self.table, mirror_view.score_rows(self.fits, self.chosen))
        models = {k: fit.model for k, fit in enumerate(self.fits)}
        self.model.set_options(
            {_BEST: "the chosen one" if self.chosen else "best so far", **models},
            value=min(self.model.value, len(models) - 1),
        )
        if self.fits:
            names = {k: loop.name for k, loop in enumerate(self.fits[0].loops)}
            self.recording.set_options(names, value=self.recording.value if self.recording.value in names else 0)
            self.recording.visible = len(names) > 1
        self.draw()
        self.told.show_blocks(said)
        self._end(job)

    def draw(self) -> None:
        """Draw the model and the recording that were chosen."""
        chosen = self.model.value
        fit = (
            mirror_view.leader(self.fits, self.chosen)
            if chosen == _BEST or chosen >= len(self.fits)
            else self.fits[chosen]
        )
        number = self.recording.value or 0
        if fit is None or number >= len(fit.loops) or (id(fit), number) == self.drawn:
            return
        self.drawn = (id(fit), number)
        self.loop.show(mirror_view.loop_plot(fit, number, self.drive_unit))
        self.residual.show(mirror_view.residual_plot(fit, number))

    def _end(self, job: Job) -> None:
        """The files of an identification that has found a model, and the way into the mission."""
        self.end.clear()
        if not self.chosen:
            return
        mirror = self.session.folder / job.results[0]
        with self.end, ui.row().classes("items-center"):
            ui.button("Use this mirror in the mission", on_click=lambda: self.use(mirror)).props("no-caps")
            ui.link("Open the report", f"/results/{job.number}/1", new_tab=True)
            ui.link(f"Mirror file {mirror.name}", f"/results/{job.number}/0", new_tab=True)

    def use(self, mirror: Path) -> None:
        """Put the mirror into the mission that is being edited."""
        if layout.attempt(lambda: self.session.edit(lambda draft: with_mirror_file(draft, mirror))):
            ui.notify(f"[mirror] of the mission names {mirror.name} now; save the mission to keep it.", type="positive")
