"""The pointing budget: its lines by class, the totals of each rule against the beacon, what is left, point-ahead."""

from __future__ import annotations

from microrad.studio import commands
from microrad.studio.pages import layout
from microrad.studio.pages.elements import Blocks, Figure
from microrad.studio.pages.sliders import SliderPage
from microrad.studio.session import Session
from microrad.studio.views import pointing as pointing_view
from microrad.studio.views.pointing import PointingView

TITLE = "Pointing"
PATH = "/pointing"


def page(session: Session) -> None:
    """Sliders at the left; plots and tables at the right."""
    PointingPage(session)


class PointingPage(SliderPage[PointingView]):
    """The page of one tab."""

    def __init__(self, session: Session) -> None:
        """Build the body, and have it follow the session."""
        layout.copy_buttons(lambda: commands.budget(layout.file_of(session)))
        super().__init__(session, pointing_view.sliders, pointing_view.view)

    def build(self) -> None:
        """Coverage, lines and totals, point-ahead."""
        layout.heading("What the beacon covers")
        self.coverage = Figure("Probability that the pointing error is below an angle; totals in the table below")
        layout.heading("Lines and totals")
        self.bars = Figure("Half widths of the lines and totals of the rules; in numbers in the tables below")
        self.told = Blocks()
        self.dimmed = (self.coverage, self.bars, self.told)

    async def show(self, view: PointingView) -> None:
        """Both plots."""
        await self.coverage.draw(pointing_view.coverage_plot(view))
        await self.bars.draw(pointing_view.lines_plot(view))

    def show_rest(self, view: PointingView) -> None:
        """Tables and sentences."""
        self.told.show_blocks(pointing_view.blocks(view))
