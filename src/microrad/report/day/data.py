"""A day of the link as plain data, in SI units with the unit in each key."""

from typing import Any

from microrad.orbit import Contact, Pass
from microrad.orbit.day import DayStudy, Encounter, Numbers, Way
from microrad.report.data import fields
from microrad.report.day import words


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
        "assumptions": [
            {
                "name": s.name,
                "factor": s.factor,
                "low": {"value": s.low, **_numbers_data(s.at_low)},
                "high": {"value": s.high, **_numbers_data(s.at_high)},
            }
            for s in day.swings
        ],
        "warnings": list(day.warnings),
        "verdict": words.sentences(day),
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


def _numbers_data(n: Numbers) -> dict[str, float]:
    return {
        "relay_could_carry_bit": n.relay_bit,
        "direct_could_carry_bit": n.direct_bit,
        "relay_latency_99_percent_s": n.relay_slow_s,
        "direct_latency_99_percent_s": n.direct_slow_s,
    }
