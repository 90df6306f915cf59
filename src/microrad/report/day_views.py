"""A day of the link as tables in a terminal, as CSV, and as a page."""

import csv
import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from microrad.orbit.day import DayStudy
from microrad.orbit.operations import spreadsheet_text
from microrad.report import day_tables, day_words
from microrad.report.tables import Table, tables_text

if TYPE_CHECKING:  # drawing takes longer to load than a table needs
    from microrad.report.plotting.figure import Figure

Row = tuple[str, ...]
WIDE = 136
"""Columns from which every cell of a contact has its place."""
_CSV = (
    "by",
    "with",
    "rise (UTC)",
    "set (UTC)",
    "rise (s)",
    "set (s)",
    "duration (s)",
    "begins by",
    "ends by",
    "smallest range (m)",
    "largest range (m)",
    "largest point-ahead (rad)",
    "largest rate of the line of sight (rad/s)",
    "largest acceleration of the line of sight (rad/s^2)",
    "largest range rate (m/s)",
    "largest Doppler shift (Hz)",
    "largest elevation (rad)",
    "could carry (bit)",
)


def way_headings(day: DayStudy) -> tuple[str, ...]:
    """Headings of relay and direct downlink side by side."""
    return ("", day.relay.name) if day.direct is None else ("", day.relay.name, day.direct.name)


SWING_HEADINGS = ("assumption", "changed to", "relay", "direct", "ratio", "99 % by\nrelay", "99 %\ndirect")


def text(day: DayStudy, width: int) -> str:
    """Tables of at most ``width`` columns, the answers, and the warnings."""
    headings, rows = _columns(day_tables.CONTACT_COLUMNS, day_tables.contact_rows(day), width)
    found = [
        Table("Contacts", headings, rows, (len(headings) - 1,)),
        Table("Relay and direct downlink", way_headings(day), day_tables.way_rows(day), (0,)),
        Table("One assumption changed", SWING_HEADINGS, day_tables.swing_rows(day), (0, 1)),
    ]
    warnings = [f"Warning: {warning}." for warning in day.warnings]
    return tables_text(found, [*day_words.sentences(day), *warnings], width)


def _columns(headings: Row, rows: Sequence[Row], width: int) -> tuple[Row, list[Row]]:
    """Headings and rows with the columns that there is room for."""
    kept = range(len(headings)) if width >= WIDE else day_tables.NARROW
    return tuple(headings[k] for k in kept), [tuple(row[k] for k in kept) for row in rows]


def csv_text(day: DayStudy) -> str:
    """One line a contact by either way, each number with every digit."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(_CSV)
    whole = day_tables.data(day)
    rows = [(day.relay.name, day.view.pair.geo.name, each) for each in whole["contacts"]]
    if day.direct is not None:
        rows += [(day.direct.name, each["station"], each) for each in whole["direct"]["passes"]]
    keys = ["start_utc", "end_utc", "start_s", "end_s", "duration_s", "begins", "ends", "range_least_m", "range_most_m"]
    keys += ["point_ahead_most_rad", "line_of_sight_rate_most_rad_s"]
    keys += ["line_of_sight_acceleration_most_rad_s2", "range_rate_most_m_s", "doppler_most_hz"]
    keys += ["highest_elevation_rad", "could_carry_bit"]
    for way, partner, each in sorted(rows, key=lambda row: row[2]["start_s"]):
        writer.writerow([way, spreadsheet_text(partner), *(each.get(key, "") for key in keys)])
    return buffer.getvalue().rstrip("\n")


def context(day: DayStudy, figures: Sequence["Figure"], *, files: bool, run: Any = None) -> dict[str, Any]:
    """What the template of a day needs; ``files`` says whether the figures' data stand beside the page."""
    return {
        "delivers": day.relay.capacity_bit > 0.0,
        "sentences": day_words.sentences(day)[0 if files else 1 :],  # a page of its own has the first as its verdict
        "headline": day_words.headline(day)[0],
        "warnings": day.warnings,
        "contact_headings": day_tables.CONTACT_COLUMNS,
        "contacts": day_tables.contact_rows(day),
        "way_headings": way_headings(day),
        "ways": day_tables.way_rows(day),
        "swing_headings": SWING_HEADINGS,
        "swings": day_tables.swing_rows(day),
        "figures": figures,
        "files": files,
        "run": run,
        "constellation": None,
    }
