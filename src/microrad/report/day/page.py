"""What pages show of a day: its view in the page of a study, and a page of its own."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from microrad.link.study import LinkStudy
from microrad.mission.model import Source
from microrad.orbit.day import DayStudy
from microrad.report.day import words
from microrad.report.day.tables import assumptions_table, contacts_table, sky_table, ways_table
from microrad.report.marks import marked
from microrad.report.plotting.figure import Figure
from microrad.report.view import Points, Verdict, View, opened, told, views_text

OPEN = ("day-timeline", "data-volume")
"""Figures that a page shows at once; the others when it is asked."""


def day_page(day: DayStudy, links: LinkStudy) -> str:
    """The day as one page that loads nothing, with its figures.

    Args:
        day: what the links deliver.
        links: the study of the links that the day is of; its file has the sources of the inputs.
    """
    from microrad.report.day.figures import day_figures
    from microrad.report.page.templates import inputs_view, mission_page

    headline, *sentences = words.sentences(day)
    lead = Verdict(headline, good=day.relay.capacity_bit > 0.0)
    shown = marked([day_view(day, sentences, day_figures(day))], links.file.sources)
    views = [*(each for each in shown if isinstance(each, View)), inputs_view(links.file.sources)]
    return mission_page(links.file, "contacts", [lead], views)


def day_text(day: DayStudy, width: int, sources: Mapping[str, Source] = MappingProxyType({})) -> str:
    """The day for a terminal: its answers, its warnings and its tables.

    Args:
        day: what the links deliver.
        width: columns of the terminal.
        sources: of each value of the mission, by its dotted key, for the signs of its numbers.
    """
    return views_text(marked([day_view(day, words.sentences(day), ())], sources), width)


def day_view(
    day: DayStudy, sentences: Sequence[str], figures: Sequence[Figure], *more: View | None, warned: bool = False
) -> View:
    """What a day delivers.

    Args:
        day: what the links deliver.
        sentences: its answers.
        figures: those of the day.
        more: views at the end.
        warned: whether the day's warnings stand elsewhere on the page.
    """
    tables = (ways_table(day), contacts_table(day), sky_table(day), assumptions_table(day))
    return View(
        "What the link delivers",
        told(
            *sentences,
            *(() if warned or not day.warnings else ("Warnings:", Points(day.warnings))),
            *tables,
            *opened(figures, OPEN),
            *more,
        ),
        "delivers",
    )
