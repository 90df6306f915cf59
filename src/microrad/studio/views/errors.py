"""What the page of pointing shows of the mission's budget of pointing errors: the report's view of it."""

from __future__ import annotations

from microrad import link, mirror
from microrad.core import kept
from microrad.link.error_budget import assembly
from microrad.loop import controller_study
from microrad.loop.pointing_loop.linear import ClosedLoop, close
from microrad.mission.file import LinkFile, MissionFile, mirror_of_loop
from microrad.mission.tables.error_budget import ErrorBudget
from microrad.report.error_budget.figures import budget_figures
from microrad.report.error_budget.page import budget_view
from microrad.report.view import View

LOOP = "PI"
"""The controller under which the loop is a source, as `microrad pointing` has it; a study takes its best one."""


def view(file: LinkFile, table: ErrorBudget) -> View:
    """The budget with its figures; takes seconds where a loop is in it that was not designed before.

    Args:
        file: the mission.
        table: its table of the budget.

    Raises:
        ValueError: As the budget does, and for a loop that is not there, or of a mirror of several axes.
    """
    asked = assembly.of_mission(table, file.sources)
    if not asked.with_loop:
        found, said = assembly.judge(asked, None), []
    else:
        found = assembly.judge(asked, _closed(file))
        said = [f"The loop is under {LOOP} here; microrad run takes the best controller of its study."]
    return budget_view(found, budget_figures(found, stacked=True), said)


def _closed(file: LinkFile) -> ClosedLoop:
    if not isinstance(file, MissionFile):
        raise ValueError("error_budget.with_loop is true, and the mission has no mirror and no loop to be a source")
    if mirror_of_loop(file) is not None:
        raise ValueError("the loop's mirror has several axes: microrad run has the budget with what that loop leaves")
    scene = controller_study.scene(file, mirror.of(file.mission), link.tracking_light_w(file), link.arrival_of(file))
    return close(scene.theory, kept.of_user().part(_designed, scene).controller)


def _designed(scene: controller_study.Scene) -> controller_study.Design:
    (made,) = controller_study.design(scene, only=[LOOP])
    return made
