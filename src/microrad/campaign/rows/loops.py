"""The fine-pointing loop of a campaign: its controller, tuned for a cell, and the loop that a row simulates."""

from collections.abc import Hashable, Mapping
from dataclasses import replace

from microrad import mirror
from microrad.campaign.definition.records import CampaignFile
from microrad.campaign.definition.tables import LoopTable
from microrad.campaign.records import CampaignError
from microrad.campaign.rows.missions import MissionBuilder
from microrad.core.progress import Progress
from microrad.link.tracking_light import tracking_light_w
from microrad.loop import fine_pointing
from microrad.loop.control import AxisController
from microrad.loop.fine_loop.ensemble import Span
from microrad.loop.fine_loop.loop import LoopController, PointingLoop
from microrad.mission.file import LinkFile, MissionFile
from microrad.mission.model import Mission
from microrad.mission.tables.fine_pointing import FinePointing


def settings(file: LinkFile) -> FinePointing:
    """The fine-pointing table of a mission that has a loop: the campaign file's own check has seen to it."""
    m = file.mission
    assert isinstance(m, Mission)
    return fine_pointing.table(m.fine_pointing)


def tuned(file: LinkFile, table: LoopTable) -> AxisController:
    """The controller that the campaign names, tuned for this mission.

    Raises `CampaignError` for a name that the mission has no controller of, and with the reason when none can be tuned.
    """
    f = settings(file)
    if table.controller not in fine_pointing.names(f):
        names = ", ".join(f'"{name}"' for name in fine_pointing.names(f))
        raise CampaignError(f'loop.controller = "{table.controller}" is no controller of the mission; it has {names}')
    try:
        of = fine_pointing.plants(_scene(file, table), f.seed)
        return fine_pointing.tune(table.controller, f, of).controller
    except ValueError as error:
        raise CampaignError(f"the controller {table.controller!r} cannot be tuned: {error}") from error


class ControllerTuner:
    """Tunes the campaign's controller for missions, once for all that have the same loop."""

    def __init__(self, campaign: CampaignFile) -> None:
        """Nothing is tuned yet."""
        self._table, self._builder = campaign.table.loop, MissionBuilder(campaign)
        self._tuned: dict[Hashable, AxisController] = {}

    def tuned(self, cell: int, values: Mapping[str, float]) -> AxisController:
        """The controller for a cell's mission with values of its keys in SI units. Raises `CampaignError`."""
        assert self._table is not None
        key = self._builder.loop_key(cell, values)
        if key not in self._tuned:
            self._tuned[key] = tuned(self._builder.mission(cell, values), self._table)
        return self._tuned[key]


def controllers(campaign: CampaignFile, on_progress: Progress) -> tuple[AxisController, ...]:
    """The controller of each cell, tuned; none without a loop."""
    table, tuner, found = campaign.table.loop, ControllerTuner(campaign), []
    if table is not None:
        for cell in range(len(campaign.cells)):
            on_progress(cell, len(campaign.cells), f"tuning {table.controller}")
            found.append(tuner.tuned(cell, {}))
    return tuple(found)


def cell_controller(file: LinkFile, table: LoopTable, axis: AxisController) -> LoopController:
    """The tuned controller on the axes of a cell's own mission: what all its rows are flown with."""
    built = replace(_scene(file, table), loop=row_loop(file, table))
    return fine_pointing.build(table.controller, built, axis)


def row_loop(file: LinkFile, table: LoopTable) -> PointingLoop:
    """The loop of a row's mission."""
    return fine_pointing.on_variant(_scene(file, table), table.mirror)


def _scene(file: LinkFile, table: LoopTable) -> fine_pointing.Scene:
    """The scene of a mission that has a loop, with the axes that the campaign simulates."""
    assert isinstance(file, MissionFile)
    built = fine_pointing.scene(file, mirror.of(file.mission), tracking_light_w(file))
    return replace(built, loop=built.axis) if table.axes == "one" else built


def span(campaign: CampaignFile, file: LinkFile) -> Span:
    """How long the runs of a row are: as the campaign's table `loop` says, else its mission; seeded by the campaign."""
    table, f = campaign.table.loop, settings(file)
    assert table is not None
    duration = f.duration_s if table.duration_s is None else table.duration_s
    settle = f.settle_s if table.settle_s is None else table.settle_s
    return Span(duration, settle, campaign.table.seed)
