"""The budget of pointing errors of a mission with a list of sources beside it, for `microrad pointing`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from microrad.cli.frame import Refusal

if TYPE_CHECKING:
    from microrad.link.error_budget.assembly import Stated
    from microrad.loop.disturbance.windows import ErrorIndex
    from microrad.mission.file import LinkFile


def stated_beside(mission: "LinkFile", listed: Path | None, indices: "Sequence[ErrorIndex]") -> "Stated | None":
    """What a mission's table and a list beside it ask for; None where there is neither.

    A list without requirements in the mission is taken in the given indices, at 99.73 % of the time.

    Args:
        mission: The mission.
        listed: A list of sources.
        indices: What is asked for where the mission has no requirement.

    Raises:
        Refusal: For a list that cannot be taken, or that has a source of the mission.
        ValueError: As `stated` of a budget.
    """
    from microrad.link.error_budget import Requirement
    from microrad.link.error_budget.assembly import of_mission, source_of, stated
    from microrad.mission.source_list import SourceListError, read_sources
    from microrad.report.fine_pointing.windows import index_text

    table = mission.mission.error_budget
    own = None if table is None else of_mission(table, mission.sources)
    if listed is None:
        return own
    try:
        more = tuple(source_of(each.name, each.source, each.origin) for each in read_sources(listed))
    except SourceListError as error:
        raise Refusal(str(error)) from None
    if own is None:
        return stated(more, {index_text(each): Requirement(each, observation_s=_observed(each)) for each in indices})
    if twice := {each.name for each in own.sources} & {each.name for each in more}:
        raise Refusal(f'{listed}: "{min(twice)}" is a source of {mission.path}, too: give it once')
    return stated((*own.sources, *more), own.required, table)


def _observed(index: "ErrorIndex") -> float | None:
    return None if index.spacing_s is None or index.window_s is None else index.spacing_s + index.window_s
