"""What the page of the day shows: contacts over time, volumes and latencies, and the tables beside them."""

from __future__ import annotations

import base64

from microrad.core.progress import Progress
from microrad.link import study as link_study
from microrad.mission.file import LinkFile
from microrad.orbit import day as day_study
from microrad.orbit.day import DayStudy
from microrad.report.day import words as day_words
from microrad.report.day.tables import assumptions_table, contacts_table, ways_table
from microrad.report.plotting.figure import Figure
from microrad.report.tables import Table


def compute_day(file: LinkFile, on_progress: Progress) -> DayStudy:
    """The links of a mission, then its day; raises ValueError with the reason where a day cannot be had."""
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


# -------------------------------------------------------------------------------------------------- tables and words
def tables(day: DayStudy) -> tuple[Table, Table, Table]:
    """Relay and direct downlink side by side, the contacts by both, and what each assumption changes alone."""
    return ways_table(day), contacts_table(day), assumptions_table(day)


def words(day: DayStudy) -> list[str]:
    """The answers of the day, a sentence each, and the warnings."""
    return [*day_words.sentences(day), *(f"Warning: {warning}." for warning in day.warnings)]


# ------------------------------------------------------------------------------------------------------------ figures
def figures(day: DayStudy) -> dict[str, Figure]:
    """The report's figures of a day by their names, without that of a simulated contact."""
    from microrad.report.day.figures import day_figures

    return {figure.name: figure for figure in day_figures(day)}


def image(figure: Figure) -> str:
    """A figure's picture as the address of an image."""
    return f"data:image/svg+xml;base64,{base64.b64encode(figure.svg.encode()).decode()}"
