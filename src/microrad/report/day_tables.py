"""A day of the link as rows of text and as plain data."""

import math
from typing import Any

from microrad.orbit import Contact, Pass
from microrad.orbit.day import NOTHING, DayStudy, Encounter, Numbers, Way
from microrad.report.day_words import contact_time, duration, kilometres, ratio_text, sentences, volume

CONTACT_COLUMNS = (
    "by",
    "rise (UTC)",
    "set",
    "min",
    "range\n(km)",
    "point-ahead\n(µrad)",
    "rate\n(µrad/s)",
    "Doppler\n(GHz)",
    "highest\n(deg)",
    "could\ncarry",
    "begins and ends by",
)
NARROW = (0, 1, 2, 3, 9, 10)
"""Columns that are left where there is little room."""


def contact_rows(day: DayStudy) -> list[tuple[str, ...]]:
    """Each contact by both ways as text, in the order of their rise."""
    rows = [
        (e.contact.start_s, _relay_row(day, e, bit))
        for e, bit in zip(day.encounters, day.relay.carried_bit, strict=True)
    ]
    if day.direct is not None:
        d = day.direct
        rows += [
            (c.start_s, _row(day, station, c, ("", "", "", "", f"{math.degrees(c.highest_rad):.1f}"), bit))
            for c, station, bit in zip(d.contacts, d.stations, d.carried_bit, strict=True)
            if isinstance(c, Pass)
        ]
    return [row for _, row in sorted(rows, key=lambda item: item[0])]


def _row(day: DayStudy, partner: str, c: Contact, between: tuple[str, ...], bit: float) -> tuple[str, ...]:
    rise, sets = (day.view.pair.epoch.utc(t)[:19] for t in (c.start_s, c.end_s))
    causes = " to ".join(dict.fromkeys((_cause(c.begins), _cause(c.ends))))
    first = partner, rise.replace("T", " "), sets[11:], f"{c.duration_s / 60.0:.2f}"
    return (*first, *between, volume(bit), causes)


def _cause(words: str) -> str:
    """A cause as it stands in a table beside the partner's name."""
    return "mask" if words.startswith("elevation mask of ") else words


def _relay_row(day: DayStudy, e: Encounter, bit: float) -> tuple[str, ...]:
    between = (
        f"{kilometres(e.range_least_m)} to {kilometres(e.range_most_m)}",
        f"{e.point_ahead_most_rad * 1e6:.1f}",
        f"{e.rate_most_rad_s * 1e6:.0f}",
        f"{e.doppler_most_hz / 1e9:.2f}",
        "",
    )
    return _row(day, day.view.pair.geo.name, e.contact, between, bit)


def way_rows(day: DayStudy) -> list[tuple[str, ...]]:
    """Relay and direct downlink side by side: what, by relay, direct."""
    ways = (day.relay,) if day.direct is None else (day.relay, day.direct)

    def row(what: str, *cells: str) -> tuple[str, ...]:
        return what, *cells

    return [
        row("contacts", *(str(len(w.contacts)) for w in ways)),
        row("time in contact", *(contact_time(w.contact_s) for w in ways)),
        row("longest time without contact", *(duration(w.gap_s) for w in ways)),
        row("could carry", *(volume(w.capacity_bit) for w in ways)),
        row("contacts without acquisition", f"{day.relay.failed_contacts:.3g}", *[""] * (len(ways) - 1)),
        row("made by the instrument", *(volume(w.generated_bit) for w in ways)),
        row("lost for want of room", *(volume(w.lost_bit) for w in ways)),
        row("on board at most", *(volume(w.history.largest_stored_bit) for w in ways)),
        row("on board at the end of what is followed", *(volume(w.on_board_bit) for w in ways)),
        row("arrive", *(volume(w.arrived_bit) for w in ways)),
        row("latency of what is kept, median", *(duration(w.median_s) for w in ways)),
        row("latency of what is kept, 99 %", *(duration(w.slow_s) for w in ways)),
    ]


def swing_rows(day: DayStudy) -> list[tuple[str, ...]]:
    """Each assumption with both of its values and what they come to."""
    direct = day.direct is not None
    rows = []
    for s in day.swings:
        for text, n in ((s.low, s.at_low), (s.high, s.at_high)):
            if text == NOTHING:
                continue
            rows.append((s.name, text, *_numbers(n, direct)))
    return rows


def _numbers(n: Numbers, direct: bool) -> tuple[str, ...]:
    if not direct:
        return volume(n.relay_bit), "", "", duration(n.relay_slow_s), ""
    return (
        volume(n.relay_bit),
        volume(n.direct_bit),
        ratio_text(n),
        duration(n.relay_slow_s),
        duration(n.direct_slow_s),
    )


# ---------------------------------------------------------------------------------------------------------------- data
def data(day: DayStudy) -> dict[str, Any]:
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
        "rates": [
            {"rate_bit_s": c.rate_bit_s, "margin_db": c.margin_db, "largest_range_m": c.largest_range_m}
            for c in day.closings
        ],
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
        "verdict": sentences(day),
    }


def _encounter_data(day: DayStudy, e: Encounter, bit: float) -> dict[str, Any]:
    c, utc = e.contact, day.view.pair.epoch.utc
    return {
        **_contact_data(c, utc(c.start_s), utc(c.end_s)),
        "range_least_m": e.range_least_m,
        "range_most_m": e.range_most_m,
        "point_ahead_most_rad": e.point_ahead_most_rad,
        "line_of_sight_rate_most_rad_s": e.rate_most_rad_s,
        "line_of_sight_acceleration_most_rad_s2": e.acceleration_most_rad_s2,
        "range_rate_most_m_s": e.range_rate_most_m_s,
        "doppler_most_hz": e.doppler_most_hz,
        "could_carry_bit": float(bit),
    }


def _contact_data(c: Contact, rise: str, sets: str) -> dict[str, Any]:
    return {
        "start_utc": rise,
        "end_utc": sets,
        "start_s": c.start_s,
        "end_s": c.end_s,
        "duration_s": c.duration_s,
        "begins": c.begins,
        "ends": c.ends,
    }


def _passes_data(day: DayStudy, way: Way) -> list[dict[str, Any]]:
    utc = day.view.pair.epoch.utc
    return [
        {
            **_contact_data(c, utc(c.start_s), utc(c.end_s)),
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
        "generated_bit": w.generated_bit,
        "arrived_bit": w.arrived_bit,
        "lost_bit": w.lost_bit,
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
