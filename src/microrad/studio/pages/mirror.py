"""The mirror: recordings dropped in, their channels chosen, and a model identified while one looks on."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from contextlib import suppress
from dataclasses import replace
from typing import Any

from nicegui import ui

from microrad.lab.recording import ACCEPTABLE
from microrad.studio.commands import Action
from microrad.studio.jobs.queue import JobError
from microrad.studio.pages import layout
from microrad.studio.pages.drop import Drop
from microrad.studio.pages.elements import Figure
from microrad.studio.pages.in_thread import in_thread, stay
from microrad.studio.pages.mirror_job import JobView
from microrad.studio.recordings import reading
from microrad.studio.recordings.uploads import Upload, UploadError, Uploads
from microrad.studio.session import Session
from microrad.studio.views import mirror as mirror_view
from microrad.studio.views import mirror_form
from microrad.studio.views.mirror_form import Dropped, Form, Setting, SettingError

TITLE = "Mirror"
PATH = "/mirror"

_LOOK_S = 0.5


def page(session: Session) -> None:
    """The form at the left; the recording and the identification at the right."""
    MirrorPage(session)


class MirrorPage:
    """The page of one tab; recordings and form lie in the studio's folder, the identification in its job's."""

    def __init__(self, session: Session) -> None:
        """Build the body, and look at the folder and the job from time to time."""
        self.session = session
        self.uploads = Uploads(session.studio / "uploads")
        self.path = session.studio / "mirror-form.json"
        self.form = mirror_form.kept_form(self.path)
        self.shown, self.question, self.filling, self.kept = "", 0, False, True
        self.listings: dict[str, reading.Listing | str] = {}  # by key: a recording stays as it is
        self.listing_turn = asyncio.Lock()
        self.faults: dict[tuple[str, reading.Columns], str] = {}
        self.drawn: object = None
        layout.copy_buttons(self.action)
        with ui.element("div").classes("mirror-page"):
            with ui.element("div").classes("mirror-form"):
                self._inputs()
            with ui.element("div").classes("mirror-seen"):
                self._plots()
                self.job = JobView(session)
        ui.timer(_LOOK_S, self.look)
        ui.timer(_LOOK_S, self.check)

    # ------------------------------------------------------------------------------------------------------- the parts
    def _inputs(self) -> None:
        layout.heading("Recordings")
        self.drop = Drop(self.uploads, self.take, self.refuse)
        ui.label("Drop files on the field: CSV, text, LVM, TDMS, MAT, NPY, NPZ or HDF5; up to 200 MB each.").classes(
            "soft small"
        )
        self.refused = ui.label().classes("no kept").props('role="alert"')
        self.list = ui.column().classes("w-full gap-1")
        layout.heading("Channels")
        self.fields: dict[str, Any] = {}
        self._select("drive", "Drive", {})
        self._select("output", "Angle or displacement", {})
        with ui.element("div").classes("pair"):
            self._select("drive_unit", "Unit of the drive", list(mirror_form.DRIVE_UNITS))
            units = {unit: mirror_form.written(unit) for unit in mirror_form.OUTPUT_UNITS}
            self._select("output_unit", "Unit of the output", units)
            self._text("rate", "Sample rate", "empty: as in the file")
            self._text("lever_arm", "Lever arm", "50 mm; for a displacement")
        self._select("accept", "Go on in spite of", list(ACCEPTABLE), "multiple use-chips clearable")
        layout.heading("Identification")
        self._text("name", "Name of the mirror", "its file has this name and .toml")
        self.fields["static"] = ui.checkbox("Hysteresis alone: two models, in seconds", on_change=self.typed)
        self.fields["admissible"] = ui.checkbox("No model that moves the wrong way", on_change=self.typed)
        self.words = ui.label().classes("no kept").props('role="alert"')
        ui.button("Identify", on_click=self.start).props("no-caps")

    def _select(self, key: str, label: str, options: Any, props: str = "") -> None:
        found = ui.select(options, label=label, on_change=self.typed, multiple="multiple" in props)
        self.fields[key] = found.props(f"dense outlined options-dense {props.replace('multiple', '')}")

    def _text(self, key: str, label: str, hint: str) -> None:
        found = ui.input(label, on_change=self.typed).props(f'dense outlined hint="{hint}" debounce=400')
        self.fields[key] = found

    def _plots(self) -> None:
        layout.heading("Measured")
        self.about = ui.label().props('role="status"')
        self.findings = ui.column().classes("gap-1")
        with ui.element("div").classes("plots"):
            self.loop = Figure("Measured loop: output over drive", mirror_view.nothing())
            self.time = Figure("Drive and output over time", mirror_view.nothing())

    # -------------------------------------------------------------------------------------------------- the recordings
    async def take(self, upload: Upload) -> None:
        """Look into a file that was dropped; one that is no recording is thrown away, in the reader's words."""
        async with self.listing_turn:
            found = await in_thread(self.list, self._read_in, upload.key)
        if isinstance(found, str):
            self.refuse(found)
            return
        self.listings[upload.key], self.refused.text = found, ""
        self._turn_to(found, upload.key, upload.name)
        await self.look()

    async def _listing(self, key: str) -> reading.Listing | str:
        """The channels of a recording, or why there are none."""
        async with self.listing_turn:
            if key not in self.listings:
                self.listings[key] = await in_thread(self.list, self._channels, key)
        stay(self.list)  # the turn may have come after the page was closed
        return self.listings[key]

    def _channels(self, key: str) -> reading.Listing | str:
        try:
            return reading.list_channels(self.uploads.get(key).path)
        except (UploadError, reading.ReadingError) as error:
            return str(error)

    def _read_in(self, key: str) -> reading.Listing | str:
        found = self._channels(key)
        if isinstance(found, str):  # here, for the page may be closed by now
            with suppress(UploadError):  # another tab has removed it
                self.uploads.remove(key)
        return found

    def refuse(self, words: str) -> None:
        """Say why a file is not taken."""
        self.refused.text = words

    def dropped(self) -> tuple[Dropped, ...]:
        """The recordings in the folder, with what each is used for, and the channels of those that were looked into."""
        uses = self.form.uses
        return tuple(
            Dropped(u.key, u.name, u.path, uses.get(u.key, "fit"), self._known(u.key)) for u in self.uploads.listed()
        )

    def _known(self, key: str) -> reading.Listing | None:
        found = self.listings.get(key)
        return found if isinstance(found, reading.Listing) else None

    def _rows(self, files: tuple[Dropped, ...]) -> None:
        """List the recordings, where there is something new to be said of them."""
        faults = [self._fault(each) for each in files]
        if self.drawn == (drawn := ([replace(each, listing=None) for each in files], self.form.seen, faults)):
            return
        self.drawn = drawn
        self.list.clear()
        with self.list:
            for each, fault in zip(files, faults, strict=True):
                self._row(each, fault)

    def _row(self, each: Dropped, fault: str) -> None:
        with ui.element("div").classes("mirror-file w-full"):
            name = ui.label(each.name).classes("name" + (" seen" if each.key == self.form.seen else ""))
            name.tooltip(each.name)
            use = ui.select(mirror_form.USES, value=each.use, on_change=lambda e: self.use(each.key, e.value))
            use.props(f'dense outlined options-dense aria-label="Use of {_attribute(each.name)}"')
            ui.button("Show", on_click=lambda: self.see(each.key)).props("dense no-caps flat")
            ui.button("Remove", on_click=lambda: self.remove(each.key)).props("dense no-caps flat")
        if fault and each.use != "leave":
            ui.label(fault).classes("no kept small")

    def _fault(self, each: Dropped) -> str:
        """Why a recording cannot be used with the channels of the form, as far as it is known."""
        found = self.listings.get(each.key)
        if isinstance(found, str):
            return found
        with suppress(SettingError):
            return self.faults.get((each.key, mirror_form.columns(self.form.setting)), "")
        return ""

    async def check(self) -> None:
        """Read one recording that was not read yet with the channels of the form: a fit would stumble over it."""
        with suppress(SettingError):
            columns = mirror_form.columns(self.form.setting)
            for each in self.dropped():
                if each.use != "leave" and each.key != self.form.seen and (each.key, columns) not in self.faults:
                    await self._checked(each, columns)
                    break

    async def _checked(self, each: Dropped, columns: reading.Columns) -> None:
        await self._listing(each.key)
        self.faults[each.key, columns] = (await in_thread(self.list, self._view, each.key, columns))[1]

    async def see(self, key: str) -> None:
        """Show another recording, with the form as it is for its channels."""
        name = next((each.name for each in self.dropped() if each.key == key), "")
        found = await self._listing(key) if key else None
        if isinstance(found, reading.Listing):
            self._turn_to(found, key, name)
        else:
            self.keep(replace(self.form, seen=key))
            self._fill()
        self._rows(self.dropped())
        await self._measured()

    def _turn_to(self, listing: reading.Listing, key: str, name: str) -> None:
        """Show the form for a recording; what was typed since it is shown stays, whoever has found it first."""
        first = key != self.form.seen and (not self.form.seen or self.form.setting.drive is None)
        self.keep(mirror_form.shown(self.form, listing, key, name, alone=first))
        self._fill()

    async def remove(self, key: str) -> None:
        """Delete a recording from the studio's folder."""
        if layout.attempt(lambda: self.uploads.remove(key)):
            await self.look()

    def use(self, key: str, use: str) -> None:
        """Have a recording serve for something else.

        Args:
            key: that of the recording.
            use: one of `mirror_form.USES`.
        """
        self.keep(replace(self.form, uses={**self.form.uses, key: use}))

    # -------------------------------------------------------------------------------------------------------- the form
    def typed(self) -> Awaitable[None] | None:
        """Take over what the form says, unless it is only being filled; a task would begin when it is full."""
        return None if self.filling else self._take_over()

    async def _take_over(self) -> None:
        values = {key: field.value for key, field in self.fields.items()}
        values["accept"] = tuple(values["accept"] or ())
        self.keep(mirror_form.edited(self.form, self._known(self.form.seen), Setting(**values)))
        self._fill()
        await self._measured()

    def keep(self, form: Form) -> None:
        """Keep the form where other tabs and a reload find it."""
        self.form = form
        self.kept = layout.attempt(lambda: mirror_form.keep_form(self.path, form))

    def _fill(self) -> None:
        """Show the form as it is kept, with the channels of the recording that is shown."""
        self.filling = True
        listing = self._known(self.form.seen)
        options = {} if listing is None else mirror_form.labels(listing)
        setting = self.form.setting
        for key, field in self.fields.items():
            value = getattr(setting, key)
            if key in ("drive", "output"):
                there = value if value in options else None
                if (field.options, field.value) != (options, there):  # one that is just being chosen from stays open
                    field.set_options(options, value=there)
            elif key == "accept":
                field.value = list(value)
            elif field.value != value:
                field.value = value
        self.fields["lever_arm"].enabled = setting.output_unit in mirror_form.LENGTHS
        self.filling = False

    def action(self) -> Action | None:
        """The identification that the form asks for; None where it says why there is none."""
        self.words.text = ""
        try:
            return mirror_form.identification(self.session.folder, self.dropped(), self.form.setting)
        except SettingError as error:
            self.words.text = str(error)
            return None

    async def start(self) -> None:
        """Queue the identification as a job."""
        action = self.action()
        if action is None:
            return
        try:
            job = await in_thread(self.list, self.session.jobs.submit, mirror_form.order(self.session.folder, action))
        except JobError as error:
            self.words.text = str(error)
            return
        await self.job.follow(job.number)

    # --------------------------------------------------------------------------------------------------------- looking
    async def look(self) -> None:
        """Follow the folder and what other tabs have typed."""
        form = mirror_form.kept_form(self.path) if self.kept else self.form
        if form != self.form:
            self.form = form
            self._fill()
        files = self.dropped()
        if self.form.seen not in {"", *(each.key for each in files)} or (files and not self.form.seen):
            await self.see(files[-1].key if files else "")
        self._rows(self.dropped())
        await self._measured()

    async def _measured(self) -> None:
        """Show the recording, unless it is shown already; a late answer to an old question is dropped."""
        seen, setting = self.form.seen, self.form.setting
        key = f"{seen} {setting}"
        if key == self.shown:
            return
        self.shown, self.question = key, self.question + 1
        mine = self.question
        found = await self._look_into(seen, setting)
        if mine == self.question:
            self._show(*found)

    async def _look_into(self, key: str, setting: Setting) -> tuple[reading.View | None, str]:
        """The samples of a recording, and why there are none."""
        listing = await self._listing(key) if key else ""
        if not isinstance(listing, reading.Listing):
            return None, listing
        try:
            columns = mirror_form.columns(setting)
        except SettingError as error:
            return None, str(error)
        found = await in_thread(self.list, self._view, key, columns)
        self.faults[key, columns] = found[1]
        return found

    def _view(self, key: str, columns: reading.Columns) -> tuple[reading.View | None, str]:
        try:
            return reading.view(self.uploads.get(key).path, columns), ""
        except (UploadError, reading.ReadingError) as error:
            return None, mirror_form.in_the_form(str(error))

    def _show(self, view: reading.View | None, words: str) -> None:
        self._fill()
        self.words.text = words
        setting = self.form.setting
        empty = mirror_view.nothing()
        self.loop.show(empty if view is None else mirror_view.recording_plot(view, setting))
        self.time.show(empty if view is None else mirror_view.time_plot(view, setting))
        self.about.text = "" if view is None else mirror_view.about(view)
        self.findings.clear()
        with self.findings:
            for finding in [] if view is None else mirror_view.findings(view):
                ui.label(finding).classes("soft small")


def _attribute(text: str) -> str:
    """A name inside of a quoted property."""
    return "".join(c if c.isalnum() or c in " ._-" else " " for c in text)
