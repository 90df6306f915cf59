"""The pointing budget: its lines by class, the totals of each rule against the beacon, what is left, point-ahead.

Below them stands the budget of pointing errors in time windows, for a mission that has one.
"""

from __future__ import annotations

from nicegui import background_tasks, ui

from microrad.mission.file import LinkFile
from microrad.mission.tables.error_budget import ErrorBudget
from microrad.report.view import View
from microrad.studio import commands
from microrad.studio.pages import layout
from microrad.studio.pages.elements import Blocks, Figure
from microrad.studio.pages.in_thread import in_thread
from microrad.studio.pages.sliders import SliderPage
from microrad.studio.session import Session
from microrad.studio.views import pointing as pointing_view
from microrad.studio.views.plots import drawn
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
        with ui.column().classes("w-full") as self.errors:
            layout.heading("Pointing error budget")
            self.state = ui.label().classes("soft").props('role="status"')
            self.budget = Blocks()
        self.errors.visible = False
        self.dimmed = (self.coverage, self.bars, self.told, self.errors)

    async def show(self, view: PointingView) -> None:
        """Both plots."""
        await self.coverage.draw(pointing_view.coverage_plot(view))
        await self.bars.draw(pointing_view.lines_plot(view))

    def show_rest(self, view: PointingView) -> None:
        """Tables and sentences; the budget of errors, which takes longer, comes behind them."""
        self.told.show_blocks(pointing_view.blocks(view))
        table = view.file.mission.error_budget
        self.errors.visible = table is not None
        if table is not None:
            self.state.text = "Computing ..."
            layout.grey(self.budget, True)
            background_tasks.create_lazy(self._errors(view, table), name=f"errors {id(self)}")

    async def _errors(self, view: PointingView, table: ErrorBudget) -> None:
        try:
            found = await in_thread(self.errors, _budget, view.file, table)
        except ValueError as error:
            found = View("", [str(error)])
        if view is self.view_now:
            self.state.text = ""
            layout.grey(self.budget, False)
            self.budget.show_blocks(found.blocks, await in_thread(self.errors, drawn, found.blocks))


def _budget(file: LinkFile, table: ErrorBudget) -> View:
    from microrad.studio.views import errors

    return errors.view(file, table)
