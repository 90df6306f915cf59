"""The pointing budget: its lines by class, the totals of each rule against the beacon, what is left, point-ahead."""

from __future__ import annotations

from collections.abc import Mapping

from nicegui import background_tasks, ui

from microrad.mission.file import LinkFile
from microrad.studio import commands
from microrad.studio.draft.draft import Draft
from microrad.studio.pages import layout
from microrad.studio.pages.elements import Figure, fill, table
from microrad.studio.pages.in_thread import in_thread
from microrad.studio.pages.sliders import SliderPage
from microrad.studio.session import Session
from microrad.studio.views import pointing as pointing_view
from microrad.studio.views.pointing import PointingView
from microrad.studio.views.sliders import Slider

TITLE = "Pointing"
PATH = "/pointing"

_LINES = (
    "Error",
    "Half width",
    "Share of squares",
    "Left for it, root sum square",
    "Left for it, ECSS two axes",
    "How it counts, and where it is from",
)
_TOTALS = ("Rule", "Total", "Beacon's half angle", "Formula and authority", "What speaks against it here")


def page(session: Session) -> None:
    """Sliders at the left; plots and tables at the right."""
    PointingPage(session)


class PointingPage(SliderPage[PointingView]):
    """The page of one tab."""

    def __init__(self, session: Session) -> None:
        """Build the body, and have it follow the session."""
        layout.copy_buttons(lambda: commands.budget(layout.file_of(session)))
        super().__init__(session)

    def build(self) -> None:
        """Coverage, lines and totals, point-ahead."""
        layout.heading("What the beacon covers")
        self.words = ui.label().props('role="status"')
        self.coverage = Figure("Probability that the pointing error is below an angle; totals in the table below")
        layout.heading("Lines and totals")
        self.bars = Figure("Half widths of the lines and totals of the rules; in numbers in the tables below")
        self.lines = table(_LINES, numbers=range(1, 5))
        ui.label(
            "Left for it: the largest half width, all others as they are, with which the total equals the beacon's "
            "half angle."
        ).classes("soft")
        layout.heading("Root sum square against ECSS")
        self.totals = table(_TOTALS, numbers=(1,))
        layout.heading("Point-ahead")
        self.ahead = table(("Point-ahead", "Value"), numbers=(1,)).style("max-width: 36rem")
        self.no_ahead = ui.label("The mission has no table [point_ahead].").classes("soft")
        self.dimmed = (self.words, self.coverage, self.bars, self.lines, self.totals, self.ahead)

    def sliders(self, draft: Draft) -> Mapping[str, tuple[Slider, ...]]:
        """The numbers that move the budget."""
        return pointing_view.sliders(draft)

    def view(self, file: LinkFile) -> PointingView:
        """The budget."""
        return pointing_view.view(file)

    async def show(self, view: PointingView) -> None:
        """Both plots."""
        await self.coverage.draw(pointing_view.coverage_plot(view))
        await self.bars.draw(pointing_view.lines_plot(view))

    def show_rest(self, view: PointingView) -> None:
        """The tables, and the sentences when they are there."""
        fill(self.lines, pointing_view.line_rows(view))
        fill(self.totals, pointing_view.total_rows(view))
        fill(self.ahead, pointing_view.ahead_rows(view))
        self.ahead.visible = bool(self.ahead.rows)
        self.no_ahead.visible = not self.ahead.rows
        background_tasks.create_lazy(self._say(view), name=f"pointing words {id(self)}")

    async def _say(self, view: PointingView) -> None:
        """The sentences, apart from the rest: their module takes a second to load the first time."""
        self.words.text = " ".join(await in_thread(self.words, pointing_view.words, view))
