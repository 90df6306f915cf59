"""The fine-pointing loop of a campaign: its controller, tuned for a cell, and the loop that a row simulates."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace

from microrad import mirror
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.definition.tables import LoopTable
from microrad.campaign.records import CampaignError
from microrad.campaign.rows.missions import MissionBuilder
from microrad.core.progress import Progress
from microrad.link import arrival_of, tracking_light_w
from microrad.loop import controller_study, coupled_study
from microrad.loop.control import AxisController
from microrad.loop.pointing_loop.ensemble import Span
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop
from microrad.mirror.coupled import CoupledMirror
from microrad.mission.file import LinkFile, MissionFile
from microrad.mission.model import Mission
from microrad.mission.tables.fine_pointing import FinePointing


def settings(file: LinkFile) -> FinePointing:
    """The fine-pointing table of a mission that has a loop: the campaign file's own check has seen to it."""
    m = file.mission
    assert isinstance(m, Mission)
    return controller_study.table(m.fine_pointing)


def span(table: LoopTable, f: FinePointing, seed: int) -> Span:
    """How long the runs of a row are: as the campaign's table `loop` says, else its mission; seeded by the campaign.

    Args:
        table: what the campaign says of its loop.
        f: what its mission says.
        seed: the campaign's.
    """
    duration = f.duration_s if table.duration_s is None else table.duration_s
    settle = f.settle_s if table.settle_s is None else table.settle_s
    return Span(duration, settle, seed)


@dataclass(frozen=True, slots=True)
class MissionLoop:
    """The fine-pointing loop of a mission, on the axes that the campaign simulates.

    ``row`` is what a row flies, ``span`` how long.
    """

    table: LoopTable
    scene: controller_study.AnyScene
    row: PointingLoop
    span: Span

    def tuned(self) -> AxisController:
        """The controller that the campaign names, tuned for this loop. Raises `ValueError` if none can be.

        It is that of one axis, or the feedback of all drives of a mirror of several axes.
        """
        name, f = self.table.controller, self.scene.table
        if isinstance(self.scene, controller_study.Scene):
            return controller_study.tune(name, f, controller_study.plants(self.scene, f.seed)).controller
        assert isinstance(self.scene, coupled_study.CoupledScene)
        whole = coupled_study.design(self.scene, only=(coupled_study.feedback_of(name),)).made[0].controller
        return AxisController(name, whole.system, whole.anti_windup)

    def controller(self, tuned: AxisController) -> LoopController:
        """A tuned controller on the axes of this loop."""
        if isinstance(self.scene, controller_study.Scene):
            return controller_study.build(self.table.controller, replace(self.scene, loop=self.row), tuned)
        assert isinstance(self.scene, coupled_study.CoupledScene)
        feedback = LoopController(tuned.name, tuned.system, tuned.anti_windup)
        return coupled_study.as_named(self.scene, self.table.controller, feedback)


def mission_loop(file: LinkFile, table: LoopTable, seed: int, several_axes: CoupledMirror | None = None) -> MissionLoop:
    """The loop of a mission that has one. Raises `ValueError` if it cannot be built.

    Args:
        file: the mission.
        table: what the campaign simulates of it.
        seed: the campaign's.
        several_axes: a mirror that is drawn, in place of that of the mission.
    """
    assert isinstance(file, MissionFile)
    light_w, arrival = tracking_light_w(file), arrival_of(file)
    scene: controller_study.AnyScene
    if several_axes is None:
        scene = coupled_study.of_mission(file, mirror.of(file.mission), light_w, arrival)
    else:
        scene = coupled_study.scene(file, several_axes, light_w, arrival)
    if isinstance(scene, controller_study.Scene) and table.axes == "one":
        scene = replace(scene, loop=scene.axis)
    return MissionLoop(table, scene, scene.on(table.mirror), span(table, settings(file), seed))


class ControllerTuner:
    """Tunes the campaign's controller for missions, once for all that have the same loop."""

    def __init__(self, campaign: CampaignFile) -> None:
        """Nothing is tuned yet."""
        self._campaign, self._builder = campaign.table, MissionBuilder(campaign)
        self._tuned: dict[Hashable, AxisController] = {}

    def tuned(self, cell: int, values: Mapping[str, float]) -> AxisController:
        """The controller for a cell's mission. Raises `CampaignError` if none can be tuned.

        Args:
            cell: the cell.
            values: values of its mission's keys, in SI units.
        """
        table, key = self._campaign.loop, self._builder.loop_key(cell, values)
        assert table is not None
        if key not in self._tuned:
            file = self._builder.mission(cell, values)
            try:
                self._tuned[key] = mission_loop(file, table, self._campaign.seed).tuned()
            except ValueError as error:
                raise CampaignError(f"the controller {table.controller!r} cannot be tuned: {error}") from error
        return self._tuned[key]


def controllers(campaign: CampaignFile, on_progress: Progress) -> tuple[AxisController, ...]:
    """The controller of each cell, tuned; none without a loop.

    Args:
        campaign: the campaign.
        on_progress: called with the cells done, all cells and what is being tuned.
    """
    table, tuner, found = campaign.table.loop, ControllerTuner(campaign), []
    if table is not None:
        for cell in range(len(campaign.cells)):
            on_progress(cell, len(campaign.cells), f"tuning {table.controller}")
            found.append(tuner.tuned(cell, {}))
    return tuple(found)
