"""The fine-pointing loop of a campaign: its controller, tuned for a cell, and the runs of rows that share a loop."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from microrad import mirror
from microrad.campaign.definition import CampaignFile
from microrad.campaign.records import CampaignError
from microrad.campaign.tables import LoopTable
from microrad.link import tracking_light_w
from microrad.loop import fine_pointing
from microrad.loop.control import AxisController
from microrad.loop.fine_loop import ensemble
from microrad.loop.fine_loop.loop import LoopController, PointingLoop
from microrad.mirror import Variant
from microrad.mission.file import LinkFile, MissionFile
from microrad.mission.model import Mission
from microrad.mission.tables.fine_pointing import FinePointing

Beat = Callable[[], None]


def settings(file: LinkFile) -> FinePointing:
    """The fine-pointing table of a mission that has a loop: the campaign file's own check has seen to it."""
    m = file.mission
    assert isinstance(m, Mission)
    return fine_pointing.table(m.fine_pointing)


def scene(file: LinkFile, table: LoopTable) -> fine_pointing.Scene:
    """The scene of a mission that has a loop, with the axes that the campaign simulates."""
    assert isinstance(file, MissionFile)
    built = fine_pointing.scene(file, mirror.of(file.mission), tracking_light_w(file))
    return replace(built, loop=built.axis) if table.axes == "one" else built


def tuned(file: LinkFile, table: LoopTable) -> AxisController:
    """The controller that the campaign names, tuned for this mission.

    Raises `CampaignError` for a name that the mission has no controller of, and with the reason when none can be tuned.
    """
    f = settings(file)
    if table.controller not in fine_pointing.names(f):
        names = ", ".join(f'"{name}"' for name in fine_pointing.names(f))
        raise CampaignError(f'loop.controller = "{table.controller}" is no controller of the mission; it has {names}')
    try:
        of = fine_pointing.plants(scene(file, table), f.seed)
        return fine_pointing.tune(table.controller, f, of).controller
    except ValueError as error:
        raise CampaignError(f"the controller {table.controller!r} cannot be tuned: {error}") from error


def held(of: fine_pointing.Scene, table: LoopTable, axis: AxisController) -> LoopController:
    """The tuned controller on the axes of a cell's own mission: what all its rows are flown with."""
    built = replace(of, loop=fine_pointing.on_variant(of, Variant(table.mirror)))
    return fine_pointing.build(table.controller, built, axis)


def row_loop(file: LinkFile, table: LoopTable) -> PointingLoop:
    """The loop of a row's mission."""
    return fine_pointing.on_variant(scene(file, table), Variant(table.mirror))


def span(campaign: CampaignFile, f: FinePointing) -> ensemble.Span:
    """How long the runs of a campaign are: as its table `loop` says, else the mission's; seeded by the campaign."""
    table = campaign.table.loop
    assert table is not None
    duration = f.duration_s if table.duration_s is None else table.duration_s
    settle = f.settle_s if table.settle_s is None else table.settle_s
    return ensemble.Span(duration, settle, campaign.table.seed)


@dataclass(frozen=True, slots=True)
class Simulated:
    """The runs of consecutive rows that share a loop, from ``first_row`` on, ``realisations`` for each."""

    first_row: int
    realisations: int
    runs: ensemble.Ensemble

    def row(self, row: int) -> ensemble.Ensemble:
        """The runs of one row."""
        return self.runs.part((row - self.first_row) * self.realisations, self.realisations)


def simulate(
    loop: PointingLoop,
    controller: LoopController,
    span: ensemble.Span,
    rows: range,
    realisations: int,
    beat: Beat,
) -> Simulated:
    """All runs of these rows, one batch after the other on this thread; the numbers of the runs follow the rows'."""
    numbers = range(rows.start * realisations, rows.stop * realisations)
    found = ensemble.run(loop, controller, span, len(numbers), first_run=numbers.start, threads=1, beat=beat)
    return Simulated(rows.start, realisations, found)
