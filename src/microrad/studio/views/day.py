"""What the page of the day shows: the report's view of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from microrad.core.progress import Progress
from microrad.link import study as link_study
from microrad.mission.file import LinkFile
from microrad.mission.model import Source
from microrad.orbit import day as day_study
from microrad.orbit.day import DayStudy
from microrad.report.day.words import sentences
from microrad.report.marks import marked
from microrad.report.view import Block


def compute_day(file: LinkFile, on_progress: Progress) -> DayStudy:
    """The links of a mission, then its day; raises ValueError with the reason where a day cannot be had.

    Args:
        file: the mission.
        on_progress: told how far it is.
    """
    on_progress(0, 0, "links")
    links = link_study.run_link_study(file)
    on_progress(0, 0, "contacts")
    return day_study.run_day_study(links, on_progress=on_progress)


def missing(file: LinkFile) -> str:
    """Why a mission has no day, or ""."""
    lacking = [f"[{name}]" for name in ("orbit", "operations") if getattr(file.mission, name) is None]
    if not lacking:
        return ""
    return f"The mission has no {' and no '.join(lacking)}, so it has no day; microrad init writes such tables."


def blocks(day: DayStudy, sources: Mapping[str, Source] = MappingProxyType({})) -> Sequence[Block]:
    """The report's view of the day with its figures, of which the map is a picture.

    Args:
        day: what the links deliver.
        sources: of each value of the mission, by its dotted key, for the signs of its numbers.
    """
    from microrad.report.day.figures import day_figures
    from microrad.report.day.page import day_view

    figures = [each.static if each.name == "world-map" else each for each in day_figures(day)]
    return marked(day_view(day, sentences(day), figures).blocks, sources)
