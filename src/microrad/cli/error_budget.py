"""The budget of pointing errors of a mission, for `microrad pointing`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from microrad.cli.frame import Refusal

if TYPE_CHECKING:
    from microrad.link.error_budget import ErrorSource, Requirement, Total
    from microrad.loop.disturbance.windows import ErrorIndex
    from microrad.loop.pointing_loop.linear import ClosedLoop
    from microrad.mission.file import LinkFile
    from microrad.mission.tables.error_budget import ErrorBudget


def sources_beside(
    mission: "LinkFile", listed: Path | None, indices: "Sequence[ErrorIndex]"
) -> "tuple[tuple[ErrorSource, ...], dict[str, Requirement]] | None":
    """Sources and requirements of a mission's table and of a list beside it; None where there is neither.

    A list without requirements in the mission is taken in the given indices, at 99.73 % of the time.

    Args:
        mission: The mission.
        listed: A list of sources.
        indices: What is asked for where the mission has no requirement.

    Raises:
        Refusal: For a list that cannot be taken, or that has a source of the mission.
    """
    from microrad.link.error_budget import Requirement
    from microrad.link.error_budget.assembly import requirement_of, source_of, sources_of
    from microrad.mission.model import source_text
    from microrad.mission.source_list import SourceListError, read_sources
    from microrad.report.fine_pointing.windows import index_text

    table = mission.mission.error_budget
    if table is None and listed is None:
        return None
    found: list[ErrorSource] = []
    if table is not None:
        keys = {name: [f"error_budget.sources.{name}.{key}" for key in ("size", "rate")] for name in table.sources}
        said = {name: next((key for key in both if key in mission.sources), both[0]) for name, both in keys.items()}
        found += sources_of(table, {name: source_text(mission.sources, key) for name, key in said.items()})
    if listed is not None:
        try:
            more = [source_of(each.name, each.source, each.origin) for each in read_sources(listed)]
        except SourceListError as error:
            raise Refusal(str(error)) from None
        if twice := {each.name for each in found} & {each.name for each in more}:
            raise Refusal(f'{listed}: "{min(twice)}" is a source of {mission.path}, too: give it once')
        found += more
    if table is None:
        asked = {index_text(index): Requirement(index, observation_s=_observed(index)) for index in indices}
    else:
        asked = {name: requirement_of(each) for name, each in table.requirements.items()}
    return tuple(found), asked


def _observed(index: "ErrorIndex") -> float | None:
    return None if index.spacing_s is None or index.window_s is None else index.spacing_s + index.window_s


def totals_of(
    sources: "Sequence[ErrorSource]",
    asked: "Mapping[str, Requirement]",
    table: "ErrorBudget | None",
    closed: "ClosedLoop | None",
) -> "dict[str, Total]":
    """The totals by the names of their requirements.

    Args:
        sources: The sources.
        asked: The requirements.
        table: The mission's table, which has correlations and says whether the loop is a source.
        closed: The mission's loop; None without.

    Raises:
        ValueError: As the budget does.
    """
    from microrad.link.error_budget import budget, contributions, correlated, total
    from microrad.link.error_budget.assembly import correlations_of, loop_contributions

    correlations = correlations_of(table)
    if closed is None or table is None or not table.with_loop:
        return dict(zip(asked, budget(sources, list(asked.values()), correlations), strict=True))
    found = {}
    for name, required in asked.items():
        own = correlated(contributions(sources, required), sources, required, correlations)
        found[name] = total([*own, *loop_contributions(closed, required)], required)
    return found
