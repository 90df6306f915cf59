"""A day of the link as plain data, in SI units with the unit in each key, and as CSV."""

import csv
import io
from typing import Any

from microrad.orbit import Contact, Pass
from microrad.orbit.day import DayStudy, Encounter, Numbers, Way
from microrad.orbit.operations import spreadsheet_text
from microrad.report.data import fields
from microrad.report.day import words

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


def day_data(day: DayStudy) -> dict[str, Any]:
    """The day as plain data, in SI units with the unit in each key."""
    v = day.view
    return {
        "epoch": v.pair.epoch.text,
        "duration_s": v.duration_s,
        "contacts": [
            _encounter_data(day, e, bit) for e, bit in zip(day.encounters, day.relay.carried_bit, strict=True)
        ],
        "visible_share": v.visible_share,
        "median_contact_s": v.median_s,
        "closed_form_contact_s": None if v.closed_form is None else v.closed_form.duration_s,
        "pointing_loss_db": day.loss.loss_db,
        "pointing_loss_source": day.loss.source,
        "outage": day.loss.outage,
        "rates": [fields(c, "rate_bit_s", "margin_db", "largest_range_m") for c in day.closings],
        "relay": _way_data(day.relay),
        "direct": None if day.direct is None else {**_way_data(day.direct), "passes": _passes_data(day, day.direct)},
        **({} if day.optical is None else _optical_data(day, day.optical)),
        "assumptions": [
            {
                "name": s.name,
                "factor": s.factor,
                "low": {"value": s.low, **_numbers_data(s.at_low, day)},
                "high": {"value": s.high, **_numbers_data(s.at_high, day)},
            }
            for s in day.swings
        ],
        "warnings": list(day.warnings),
        "verdict": words.sentences(day),
    }


def _optical_data(day: DayStudy, way: Way) -> dict[str, Any]:
    """The optical downlink and the sky over it; a mission without them has none of these keys."""
    sky = day.sky
    assert sky is not None  # both or none
    return {
        "optical": {**_way_data(way), "passes": _passes_data(day, way)},
        "sky": {
            "sites": [
                {"name": name, "availability": given, "drawn": drawn}
                for name, given, drawn in zip(sky.names, sky.availability, sky.drawn, strict=True)
            ],
            "any_clear": sky.any_clear,
            "any_clear_drawn": sky.any_drawn,
            "any_clear_independent": sky.any_independent,
            "correlation": sky.correlation.tolist(),
        },
    }


def _encounter_data(day: DayStudy, e: Encounter, bit: float) -> dict[str, Any]:
    return {
        **_contact_data(day, e.contact),
        **fields(e, "range_least_m", "range_most_m", "point_ahead_most_rad"),
        "line_of_sight_rate_most_rad_s": e.rate_most_rad_s,
        "line_of_sight_acceleration_most_rad_s2": e.acceleration_most_rad_s2,
        **fields(e, "range_rate_most_m_s", "doppler_most_hz"),
        "could_carry_bit": float(bit),
    }


def _contact_data(day: DayStudy, c: Contact) -> dict[str, Any]:
    utc = day.view.pair.epoch.utc
    spans = fields(c, "start_s", "end_s", "duration_s", "begins", "ends")
    return {"start_utc": utc(c.start_s), "end_utc": utc(c.end_s), **spans}


def _passes_data(day: DayStudy, way: Way) -> list[dict[str, Any]]:
    return [
        {
            **_contact_data(day, c),
            "station": station,
            "highest_elevation_rad": c.highest_rad,
            "could_carry_bit": float(bit),
        }
        for c, station, bit in zip(way.contacts, way.stations, way.carried_bit, strict=True)
        if isinstance(c, Pass)
    ]


def _way_data(w: Way) -> dict[str, Any]:
    return {
        "contacts": len(w.contacts),
        "contact_s": w.contact_s,
        "longest_gap_s": w.gap_s,
        "could_carry_bit": w.capacity_bit,
        "could_carry_least_bit": w.capacity_spread_bit[0],
        "could_carry_most_bit": w.capacity_spread_bit[1],
        **fields(w, "generated_bit", "arrived_bit", "lost_bit"),
        "on_board_at_end_bit": w.on_board_bit,
        "contacts_without_acquisition": w.failed_contacts,
        "latency_median_s": w.median_s,
        "latency_99_percent_s": w.slow_s,
    }


def _numbers_data(n: Numbers, day: DayStudy) -> dict[str, float]:
    more = {"optical_could_carry_bit": n.optical_bit, "optical_latency_99_percent_s": n.optical_slow_s}
    return {
        "relay_could_carry_bit": n.relay_bit,
        "direct_could_carry_bit": n.direct_bit,
        "relay_latency_99_percent_s": n.relay_slow_s,
        "direct_latency_99_percent_s": n.direct_slow_s,
        **({} if day.optical is None else more),
    }


def day_csv(day: DayStudy) -> str:
    """One line a contact by any way, each number with every digit."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(("by", "with", *_COLUMNS))
    whole = day_data(day)
    rows = [(day.relay.name, day.view.pair.geo.name, each) for each in whole["contacts"]]
    for to_ground, key in ((day.direct, "direct"), (day.optical, "optical")):
        if to_ground is not None:
            rows += [(to_ground.name, each["station"], each) for each in whole[key]["passes"]]
    for way, partner, each in sorted(rows, key=lambda row: row[2]["start_s"]):
        writer.writerow([way, spreadsheet_text(partner), *(each.get(key, "") for key in _COLUMNS.values())])
    return buffer.getvalue().rstrip("\n")
