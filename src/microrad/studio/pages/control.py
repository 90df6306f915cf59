"""Control: the mission's controllers with their margins, and what the loop of a chosen one does."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from nicegui import background_tasks, ui

from microrad.mission.file import MissionFile
from microrad.mission.tables.fine_pointing import FinePointing
from microrad.report.view import Block
from microrad.studio import commands
from microrad.studio.pages import layout
from microrad.studio.pages.elements import Blocks, Figure
from microrad.studio.pages.in_thread import in_thread, stay
from microrad.studio.session import Session
from microrad.studio.views import control as control_view
from microrad.studio.views.control import Answers, Controller
from microrad.studio.views.plots import empty

TITLE = "Control"
PATH = "/control"

_PLOTS = {
    "sensitivity": "Sensitivity by frequency",
    "gain": "Loop gain by frequency",
    "step": "Step response",
    "step_drive": "Drive behind a step",
    "sine": "Error while a sine is followed",
    "sine_drive": "Drive while a sine is followed",
    "jitter": "Error under disturbance",
    "motion": "What is to be followed and what the mirror does",
    "jitter_drive": "Drive under disturbance",
}
_OWN = ("sensitivity", "gain")  # of the controller, whatever is asked


def page(session: Session) -> None:
    """A table of all controllers, and below it one of them."""
    ControlPage(session)


class ControlPage:
    """The page of one tab; what is tuned is kept for all tabs by `controllers`."""

    def __init__(self, session: Session) -> None:
        """Build the body, and have it follow the session."""
        self.session = session
        self.file: MissionFile | None = None
        self.asked: MissionFile | None = None
        self.key = ""
        self.question, self.round, self.filling = 0, 0, False
        self.found: dict[str, Controller | str] = {}
        self.plots: dict[str, Any] = {}
        layout.copy_buttons(lambda: commands.design(layout.file_of(session)))
        self.words = ui.label().classes("no kept").props('role="alert"')
        self._all()
        self._one()
        layout.follow(session, lambda: background_tasks.create(self.reload()))

    def _all(self) -> None:
        layout.heading("Controllers of the mission")
        ui.label("Each is tuned for the least residual under the modulus margin of the mission.").classes("soft")
        with ui.row().classes("items-center"):
            self.tune = ui.button("Tune all", on_click=self.tune_all).props("no-caps dense outline")
            self.stop = ui.button("Stop", on_click=self.stop_all).props("no-caps dense flat")
            self.stop.visible = False
        self.table = Blocks()

    def _one(self) -> None:
        layout.heading("One controller")
        with ui.element("div").classes("control-asked w-full"):
            self.name = ui.select([], label="Controller", on_change=self.show).props("dense outlined options-dense")
            self.step = self._text("Step", "100 urad")
            self.amplitude = self._text("Sine, amplitude", "300 urad")
            self.frequency = self._text("Sine, frequency", "15 Hz")
            names = {"both": "both", "with": "with hysteresis", "without": "without"}
            self.variants = ui.toggle(names, value="both", on_change=self.show)
            self.variants.props('dense no-caps aria-label="Hysteresis of the mirror"')
        self.state = ui.label().classes("soft").props('role="status"')
        self.fault = ui.label().classes("no kept").props('role="alert"')
        self.notes = ui.column().classes("gap-0")
        layout.heading("By frequency", 3)
        self._plots("sensitivity", "gain")
        layout.heading("A step of the reference on axis x", 3)
        self.told_step = self._told()
        self._plots("step", "step_drive")
        layout.heading("A sine of the reference on axis x", 3)
        self.told_sine = self._told()
        self._plots("sine", "sine_drive")
        with ui.column().classes("w-full") as self.shaken:
            layout.heading("Everything that disturbs the loop", 3)
            self.told_jitter = self._told()
            self._plots("jitter", "motion", "jitter_drive")

    def _text(self, label: str, value: str) -> Any:
        return ui.input(label, value=value, on_change=self.show).props("dense outlined debounce=500")

    def _told(self) -> Any:
        return ui.label().props('role="status"')

    def _plots(self, *names: str) -> None:
        with ui.element("div").classes("plots"):
            for name in names:
                self.plots[name] = Figure(_PLOTS[name], empty("Nothing simulated yet."))

    # ------------------------------------------------------------------------------------------------------ the mission
    async def reload(self) -> None:
        """Take over the mission as it is now; while it has faults, the last one stays."""
        stay(self.table)
        key, file = self.session.key, self.session.mission()
        self.words.text = self.session.faults()
        if file is None:
            return
        self.asked = file
        if key == self.key and file == self.file:
            return
        names = await in_thread(self.table, _names, file.mission.fine_pointing)
        if self.asked is not file:  # the mission has changed again
            return
        self.file, self.key = file, key
        self.stop_all()
        self.found = dict.fromkeys(names, "not looked at yet")
        self._table()
        self.filling = True
        if not self.name.value:
            self.amplitude.value = f"{1e6 * file.mission.scenario.amplitude_rad:g} urad"
            self.frequency.value = f"{file.mission.scenario.pid_frequencies_hz[-1]:g} Hz"
        first = names[1] if len(names) > 3 else names[0]  # the tuned PI rather than the baseline
        self.name.set_options(list(names), value=self.name.value if self.name.value in names else first)
        self.filling = False
        await self.show()

    # -------------------------------------------------------------------------------------------------------------- all
    async def tune_all(self) -> None:
        """Tune one controller after the other, each shown as soon as it is there."""
        if self.file is None:
            return
        self.round += 1
        mine, file = self.round, self.file
        self.tune.visible, self.stop.visible = False, True
        for name in list(self.found):
            if mine != self.round:
                break
            await self._tuned(file, name)
        if mine == self.round:
            self.stop_all()

    def stop_all(self) -> None:
        """Leave the others untuned."""
        self.round += 1
        self.tune.visible, self.stop.visible = True, False

    async def _tuned(self, file: MissionFile, name: str) -> Controller | None:
        """A controller, and its row; None where it cannot be built, which its row says."""

        def told(now: Controller | str) -> None:
            if file is self.file:
                self.found[name] = now
                self._table()

        if isinstance(self.found[name], str):
            told("being tuned ...")
        try:
            found = await in_thread(self.table, _controller, file, name)
        except ValueError as error:
            told(str(error))
            return None
        told(found)
        return found

    def _table(self) -> None:
        self.table.show_blocks(_blocks(self.found))

    # -------------------------------------------------------------------------------------------------------------- one
    async def show(self) -> None:
        """Show the chosen controller; a late answer to an older question is dropped."""
        file, name = self.file, self.name.value
        if self.filling or file is None or not name:
            return
        self.question += 1
        mine = self.question
        self.state.text = f"Tuning {name} ..."
        found = await self._tuned(file, name)
        if mine != self.question:
            return
        self.state.text = ""
        if found is None:
            self.fault.text = f"{name} cannot be built for this mission; the table says why."
            self._dim(self.plots)
            return
        self._controller(found)
        try:
            ask = control_view.ask_of(self.step.value, self.amplitude.value, self.frequency.value, found.rate_hz)
            self.state.text = "Simulating ..."
            answers = await in_thread(self.table, found.ask, ask, control_view.SHOWN[self.variants.value])
        except ValueError as error:
            if mine != self.question:
                return
            self.fault.text, self.state.text = str(error), ""
            self._dim([name for name in self.plots if name not in _OWN])
            return
        if mine == self.question:
            self.state.text = self.fault.text = ""
            self._answers(found, answers)
            self._dim([])

    def _dim(self, plots: Collection[str]) -> None:
        """Turn grey the plots that answer another question than the one that is typed, and the words."""
        told = self.told_step, self.told_sine, self.told_jitter
        grey = [self.plots[name] for name in plots] + [*(told if plots else ())]
        grey += [self.notes] if any(name in plots for name in _OWN) else []
        for each in (*self.plots.values(), *told, self.notes):
            layout.grey(each, each in grey)

    def _controller(self, found: Controller) -> None:
        self.notes.clear()
        with self.notes:
            for note in control_view.notes(found):
                ui.label(note).classes("soft")
        self.plots["sensitivity"].show(control_view.sensitivity_plot(found))
        self.plots["gain"].show(control_view.gain_plot(found))

    def _answers(self, found: Controller, answers: Answers) -> None:
        self.shaken.visible = bool(answers.jitter)
        self.told_step.text = control_view.answer_words(answers.step, "Error", found.field_of_view_rad)
        self.told_sine.text = control_view.answer_words(answers.sine, "Radial error", found.field_of_view_rad)
        self.told_jitter.text = control_view.answer_words(answers.jitter, "Radial error", found.field_of_view_rad)
        drawn = {
            "step": control_view.step_plot(answers),
            "step_drive": control_view.drive_plot(found, answers.step),
            "sine": control_view.sine_plot(answers),
            "sine_drive": control_view.drive_plot(found, answers.sine),
            "jitter": control_view.jitter_plot(answers),
            "motion": control_view.motion_plot(answers),
            "jitter_drive": control_view.drive_plot(found, answers.jitter, control_view.SECONDS),
        }
        for name, figure in drawn.items():
            self.plots[name].show(figure)


def _names(table: FinePointing | None) -> tuple[str, ...]:
    from microrad.studio.views import controllers

    return controllers.names(table)


def _blocks(found: Mapping[str, Controller | str]) -> Sequence[Block]:
    from microrad.studio.views import controllers

    return controllers.blocks(found)


def _controller(file: MissionFile, name: str) -> Controller:
    from microrad.studio.views import controllers

    return controllers.controller(file, name)
