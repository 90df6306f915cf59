"""What pages show of a day: its section in the page of a study, and a page of its own."""

from collections.abc import Sequence
from typing import Any

from microrad.link.study import LinkStudy
from microrad.orbit.day import DayStudy
from microrad.report.day import words
from microrad.report.day.figures import day_figures
from microrad.report.day.tables import assumptions_table, contacts_table, ways_table
from microrad.report.page.templates import render
from microrad.report.plotting.figure import Figure


def day_page(day: DayStudy, links: LinkStudy) -> str:
    """The day as one page that loads nothing, with its figures.

    Args:
        day: what the links deliver.
        links: the study of the links that the day is of; its file has the sources of the inputs.
    """
    section = day_section(day, day_figures(day), files=False)
    context = {
        "study": links,
        "mission": links.file.mission,
        "day": section,
        "inputs": list(links.file.sources.items()),
    }
    return render("day/day_page.html", context)


def day_section(day: DayStudy, figures: Sequence[Figure], *, files: bool) -> dict[str, Any]:
    """What the template of a day needs.

    ``figures`` are those of the day, and ``files`` says whether their data stand beside the page.
    """
    return {
        "delivers": day.relay.capacity_bit > 0.0,
        "sentences": words.sentences(day)[0 if files else 1 :],  # a page of its own has the first as its verdict
        "headline": words.headline(day)[0],
        "warnings": day.warnings,
        "ways": ways_table(day),
        "contacts": contacts_table(day),
        "assumptions": assumptions_table(day),
        "figures": figures,
        "files": files,
        "run": None,
        "constellation": None,
    }
