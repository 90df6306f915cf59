"""A day of the link as tables in a terminal, as CSV, and as a page."""

import csv
import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from microrad.day_study import DayStudy
from microrad.link_study import LinkStudy
from microrad.report import day_words
from microrad.report.tables import tables_text

if TYPE_CHECKING:  # drawing takes longer to load than a table needs
    from microrad.report.figures import Figure

_CSV = (
    "by",
    "with",
    "rise (UTC)",
    "set (UTC)",
    "rise (s)",
    "set (s)",
    "begins by",
    "ends by",
    "smallest range (m)",
    "largest range (m)",
    "largest point-ahead (rad)",
    "largest rate of the line of sight (rad/s)",
    "largest Doppler shift (Hz)",
    "could carry (bit)",
)


def way_headings(day: DayStudy) -> tuple[str, ...]:
    """Headings of relay and direct downlink side by side."""
    return ("", day.relay.name) if day.direct is None else ("", day.relay.name, day.direct.name)


SWING_HEADINGS = ("assumption", "changed to", "relay", "direct", "ratio", "99 % by relay", "99 % direct")


def text(day: DayStudy, width: int) -> str:
    """Tables of at most ``width`` columns, the answers, and the warnings."""
    found = [
        ("Contacts", day_words.CONTACT_COLUMNS, day_words.contact_rows(day)),
        ("Relay and direct downlink", way_headings(day), day_words.way_rows(day)),
        ("One assumption changed", SWING_HEADINGS, day_words.swing_rows(day)),
    ]
    warnings = [f"Warning: {warning}." for warning in day.warnings]
    return tables_text(found, [*day_words.sentences(day), *warnings], width)


def csv_text(day: DayStudy) -> str:
    """One line a contact by either way, each number with every digit."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(_CSV)
    whole = day_words.data(day)
    rows = [(day.relay.name, day.view.pair.geo.name, each) for each in whole["contacts"]]
    if day.direct is not None:
        rows += [(day.direct.name, each["station"], each) for each in whole["direct"]["passes"]]
    keys = ["start_utc", "end_utc", "start_s", "end_s", "begins", "ends", "range_least_m", "range_most_m"]
    keys += ["point_ahead_most_rad", "line_of_sight_rate_most_rad_s", "doppler_most_hz", "could_carry_bit"]
    for way, partner, each in sorted(rows, key=lambda row: row[2]["start_s"]):
        writer.writerow([way, _plain(partner), *(each.get(key, "") for key in keys)])
    return buffer.getvalue().rstrip("\n")


def _plain(name: str) -> str:
    """A name that a spreadsheet does not take for a formula."""
    return "'" + name if name.startswith(("=", "+", "-", "@", "\t", "'")) else name


def context(day: DayStudy, figures: Sequence["Figure"], *, files: bool, run: Any = None) -> dict[str, Any]:
    """What the template of a day needs; ``files`` says whether the figures' data stand beside the page."""
    return {
        "delivers": day.relay.capacity_bit > 0.0,
        "sentences": day_words.sentences(day),
        "warnings": day.warnings,
        "contact_headings": day_words.CONTACT_COLUMNS,
        "contacts": day_words.contact_rows(day),
        "way_headings": way_headings(day),
        "ways": day_words.way_rows(day),
        "swing_headings": SWING_HEADINGS,
        "swings": day_words.swing_rows(day),
        "figures": figures,
        "files": files,
        "run": run,
        "constellation": None,
    }


def html(day: DayStudy, links: LinkStudy) -> str:
    """The day as one page that loads nothing, with its figures."""
    from microrad.report import day_plots, page

    figures = day_plots.draw(day)
    return (
        page.pages()
        .get_template("day_page.html")
        .render(
            study=links,
            mission=day.mission,
            day=context(day, figures, files=False),
            inputs=list(links.file.sources.items()),
        )
    )
