"""A day of the link as text for a terminal and as CSV."""

import csv
import io

from microrad.orbit.day import DayStudy
from microrad.orbit.operations import spreadsheet_text
from microrad.report.day import words
from microrad.report.day.data import day_data
from microrad.report.day.tables import assumptions_table, contacts_table, ways_table
from microrad.report.tables import tables_text

_COLUMNS = {
    "rise (UTC)": "start_utc",
    "set (UTC)": "end_utc",
    "rise (s)": "start_s",
    "set (s)": "end_s",
    "duration (s)": "duration_s",
    "begins by": "begins",
    "ends by": "ends",
    "smallest range (m)": "range_least_m",
    "largest range (m)": "range_most_m",
    "largest point-ahead (rad)": "point_ahead_most_rad",
    "largest rate of the line of sight (rad/s)": "line_of_sight_rate_most_rad_s",
    "largest acceleration of the line of sight (rad/s^2)": "line_of_sight_acceleration_most_rad_s2",
    "largest range rate (m/s)": "range_rate_most_m_s",
    "largest Doppler shift (Hz)": "doppler_most_hz",
    "largest elevation (rad)": "highest_elevation_rad",
    "could carry (bit)": "could_carry_bit",
}
"""Columns of the CSV behind the names of way and partner, and where their numbers stand in the plain data."""


def day_text(day: DayStudy, width: int) -> str:
    """Tables of the day for a terminal, then the answers and the warnings.

    Args:
        day: what the links deliver.
        width: columns of the terminal.
    """
    warnings = [f"Warning: {warning}." for warning in day.warnings]
    tables = [contacts_table(day), ways_table(day), assumptions_table(day)]
    return tables_text(tables, [*words.sentences(day), *warnings], width)


def day_csv(day: DayStudy) -> str:
    """One line a contact by either way, each number with every digit."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(("by", "with", *_COLUMNS))
    whole = day_data(day)
    rows = [(day.relay.name, day.view.pair.geo.name, each) for each in whole["contacts"]]
    if day.direct is not None:
        rows += [(day.direct.name, each["station"], each) for each in whole["direct"]["passes"]]
    for way, partner, each in sorted(rows, key=lambda row: row[2]["start_s"]):
        writer.writerow([way, spreadsheet_text(partner), *(each.get(key, "") for key in _COLUMNS.values())])
    return buffer.getvalue().rstrip("\n")
