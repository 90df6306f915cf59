"""A day of the link in words and as plain data."""

import math
from typing import Any

from microrad.day_study import NOTHING, Closing, DayStudy, Encounter, Numbers, Swing, Way
from microrad.orbit import Contact
from microrad.report.quantities import quantity

MATTERS = 1.1
"""Factor by which an assumption has to change the comparison to be named."""


def volume(bit: float) -> str:
    """Data in bytes."""
    return quantity(bit / 8.0, "B")


def duration(time_s: float) -> str:
    """A length of time in the unit that reads best."""
    if math.isinf(time_s):
        return "never"
    for unit_s, unit in ((3600.0, "h"), (60.0, "min")):
        if abs(time_s) >= 2.0 * unit_s:
            return f"{time_s / unit_s:.3g} {unit}"
    return f"{time_s:.3g} s"


def sentences(day: DayStudy) -> list[str]:
    """The answers of the day, a sentence each."""
    return [*headline(day), contact_words(day), rate_words(day), *latency_words(day), *assumption_words(day)]


def headline(day: DayStudy) -> list[str]:
    """What the relay and the direct downlink could carry."""
    relay, span = day.relay, duration(day.view.duration_s)
    whole = day.mission.operations is None or day.mission.operations.relay_share == 1.0
    said = (
        f"In {span} the relay {'is in view' if whole else 'grants the link'} {_how_much(day, relay)}, and could take "
        f"{volume(relay.capacity_bit)}{_a_day(day, volume(relay.capacity_bit / _days(day)))}"
    )
    if day.direct is None:
        return [f"{said}."]
    d, down = day.direct, day.mission.operations.downlink if day.mission.operations else None
    stations = ", ".join(down.stations) if down else ""
    times = f", {day.ratio:.3g} times less" if math.isfinite(day.ratio) and day.ratio > 1.0 else ""
    carried = f"{volume(d.capacity_bit)}{_a_day(day, volume(d.capacity_bit / _days(day)))}"
    return [f"{said}; the ground ({stations}) {_how_much(day, d)}, and could take {carried}{times}."]


def _how_much(day: DayStudy, way: Way) -> str:
    """Number and time of the contacts of a way."""
    minutes, days = way.contact_s / 60.0, _days(day)
    a_day = _a_day(day, f"{len(way.contacts) / days:.3g} times, {minutes / days:.0f} min")
    return f"{len(way.contacts)} times, {minutes:.0f} min in all{a_day}"


def _days(day: DayStudy) -> float:
    return day.view.duration_s / 86400.0


def _a_day(day: DayStudy, said: str) -> str:
    """What that is in a day, where the span is not one."""
    return "" if math.isclose(_days(day), 1.0) else f" ({said} a day)"


def contact_words(day: DayStudy) -> str:
    """The contacts with the relay, and what their line of sight reaches."""
    v = day.view
    if not v.encounters:
        return f"There is no contact: {_never(day)}."
    least = min(e.range_least_m for e in v.encounters)
    doppler = v.largest("doppler_most_hz")
    hand = ""
    if v.closed_form is not None:
        hand = (
            f" Over the equator a contact would take {v.closed_form.duration_s / 60.0:.2f} min, by the formula for "
            "coplanar circular orbits."
        )
    ahead, rate = v.largest("point_ahead_most_rad"), v.largest("rate_most_rad_s")
    at_a_time = "" if math.isnan(v.median_s) else f" {duration(v.median_s)} at a time (median),"
    return (
        f"The relay is in view for {100 * v.visible_share:.1f} % of the time,{at_a_time} and out of it for "
        f"{duration(v.gap_s)} at most. Range {_km(least)} to "
        f"{_km(v.largest('range_most_m'))} km, point-ahead up to {quantity(ahead, 'rad')}, line of sight up to "
        f"{quantity(rate, 'rad/s')}, Doppler shift up to {quantity(doppler, 'Hz')} either way.{hand}"
    )


def _never(day: DayStudy) -> str:
    leo, geo = day.view.pair.leo.name, day.view.pair.geo.name
    return f"within the span and the limits of the mission, {leo} and {geo} do not see one another"


def rate_words(day: DayStudy) -> str:
    """The rates, and how far each reaches."""
    o, furthest = day.mission.operations, day.view.largest("range_most_m")
    assert o is not None
    if not day.closings:
        return "The receiver takes none of the mission's data rates."

    def reaches(c: Closing) -> bool:
        return 0.0 < furthest <= c.largest_range_m

    said = "; ".join(
        f"{quantity(c.rate_bit_s, 'bit/s')} "
        + ("at every range of the contacts" if reaches(c) else f"up to {_km(c.largest_range_m)} km")
        for c in day.closings
    )
    lost = f"; {100 * day.loss.outage:.2g} % of the time is lost in outage" if day.loss.outage else ""
    idle = ""
    if all(c.largest_range_m < furthest for c in day.closings):
        idle = f" Beyond that no data flow: the contacts reach {_km(furthest)} km."
    return (
        f"With a pointing loss of {day.loss.loss_db:.2f} dB ({day.loss.source}) the laser link has the demanded "
        f"{o.margin_db:g} dB for {said}{lost}.{idle}"
    )


def _km(range_m: float) -> str:
    return f"{range_m / 1e3:.0f}"


def latency_words(day: DayStudy) -> list[str]:
    """How long the instrument's data take to the user."""
    made = volume(day.relay.generated_bit)
    said = [f"Of the {made} that the instrument makes, {_arrived(day.relay)} by the relay"]
    if day.direct is not None:
        said.append(f"{_arrived(day.direct)} by the direct downlink")
    return ["; ".join(said) + "."]


def _arrived(way: Way) -> str:
    slow = "99 % do not arrive" if math.isinf(way.slow_s) else f"99 % within {duration(way.slow_s)}"
    half = "less than half arrive" if math.isinf(way.median_s) else f"half arrive within {duration(way.median_s)}"
    lost = f", {volume(way.lost_bit)} find the store full" if way.lost_bit > 0.0 else ""
    late = f", {volume(way.on_board_bit)} are still on board at the end" if way.on_board_bit > 1.0 else ""
    return f"{half} and {slow}{lost}{late}"


def assumption_words(day: DayStudy) -> list[str]:
    """Which assumption matters most, for the volumes and for the latencies."""
    moving = [s for s in day.swings if s.factor > MATTERS]
    found = []
    if moving:
        what = "ratio of the two volumes" if day.direct is not None else "relay's volume"
        named = "; ".join(f"{s.name} ({_ends(s, day.direct is not None)})" for s in moving[:3])
        found.append(f"What matters most to the {what}, each assumption changed alone: {named}.")
    waits = sorted(day.swings, key=lambda s: -_wait_factor(s))
    if waits and _wait_factor(waits[0]) > MATTERS:
        s = waits[0]
        by = [f"relay {_both(s, 'relay_slow_s')}"]
        if day.direct is not None:
            by.append(f"direct {_both(s, 'direct_slow_s')}")
        found.append(f"What matters most to the latency: {s.name}, {s.low} or {s.high}; 99 % by {', '.join(by)}.")
    return found


def _ends(s: Swing, ratio: bool) -> str:
    def shown(n: Numbers) -> str:
        if n.relay_bit == 0.0:
            return "nothing by relay"
        return (_ratio(n) or "nothing direct") if ratio else volume(n.relay_bit)

    return f"{s.low}: {shown(s.at_low)}, {s.high}: {shown(s.at_high)}"


def _ratio(n: Numbers) -> str:
    """Volume by relay over volume direct; nothing where the latter is none."""
    return f"{n.ratio:.3g}" if n.direct_bit > 0.0 else ""


def _both(s: Swing, name: str) -> str:
    ends = [duration(getattr(n, name)) for n in (s.at_low, s.at_high)]
    return ends[0] if ends[0] == ends[1] else f"{ends[0]} or {ends[1]}"


def _wait_factor(s: Swing) -> float:
    """By how much an assumption changes the 99 % latency of the way that it changes more."""
    factors = [1.0]
    for name in ("relay_slow_s", "direct_slow_s"):
        low, high = sorted(getattr(n, name) for n in (s.at_low, s.at_high))
        if low > 0.0 and low != high and not math.isnan(low + high):
            factors.append(high / low)
    return max(factors)


# -------------------------------------------------------------------------------------------------------------- tables
CONTACT_COLUMNS = (
    "by",
    "with",
    "rise (UTC)",
    "set (UTC)",
    "min",
    "begins by",
    "ends by",
    "range (km)",
    "point-ahead (µrad)",
    "rate (µrad/s)",
    "Doppler (GHz)",
    "could carry",
)


def contact_rows(day: DayStudy) -> list[tuple[str, ...]]:
    """Each contact by both ways as text, in the order of their rise."""
    rows = [
        (c.start_s, _relay_row(day, c, e, bit))
        for c, e, bit in zip(day.relay.contacts, day.view.encounters, day.relay.carried_bit, strict=True)
    ]
    if day.direct is not None:
        d = day.direct
        rows += [
            (c.start_s, (*_first(day, d.name, station, c), "", "", "", "", volume(bit)))
            for c, station, bit in zip(d.contacts, d.stations, d.carried_bit, strict=True)
        ]
    return [row for _, row in sorted(rows, key=lambda item: item[0])]


def _first(day: DayStudy, way: str, partner: str, c: Contact) -> tuple[str, ...]:
    rise, sets = (day.view.pair.epoch.utc(t)[:19].replace("T", " ") for t in (c.start_s, c.end_s))
    return way, partner, rise, sets, f"{c.duration_s / 60.0:.2f}", c.begins, c.ends


def _relay_row(day: DayStudy, c: Contact, e: Encounter, bit: float) -> tuple[str, ...]:
    return (
        *_first(day, day.relay.name, day.view.pair.geo.name, c),
        f"{_km(e.range_least_m)} to {_km(e.range_most_m)}",
        f"{e.point_ahead_most_rad * 1e6:.1f}",
        f"{e.rate_most_rad_s * 1e6:.0f}",
        f"{e.doppler_most_hz / 1e9:.2f}",
        volume(bit),
    )


def way_rows(day: DayStudy) -> list[tuple[str, ...]]:
    """Relay and direct downlink side by side: what, by relay, direct."""
    ways = (day.relay,) if day.direct is None else (day.relay, day.direct)

    def row(what: str, *cells: str) -> tuple[str, ...]:
        return what, *cells

    return [
        row("contacts", *(str(len(w.contacts)) for w in ways)),
        row("time in contact", *(f"{w.contact_s / 60.0:.0f} min" for w in ways)),
        row("longest time without contact", *(duration(w.gap_s) for w in ways)),
        row("could carry", *(volume(w.capacity_bit) for w in ways)),
        row("contacts without acquisition (mean of the runs)", *(f"{w.failed_contacts:.3g}" for w in ways)),
        row("made by the instrument", *(volume(w.generated_bit) for w in ways)),
        row("lost for want of room", *(volume(w.lost_bit) for w in ways)),
        row("on board at the end", *(volume(w.on_board_bit) for w in ways)),
        row("latency, median", *(duration(w.median_s) for w in ways)),
        row("latency, 99 %", *(duration(w.slow_s) for w in ways)),
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
        _ratio(n),
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
        "contacts": [_encounter_data(day, e, bit) for e, bit in zip(v.encounters, day.relay.carried_bit, strict=True)],
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
        "doppler_most_hz": e.doppler_most_hz,
        "could_carry_bit": float(bit),
    }


def _contact_data(c: Contact, rise: str, sets: str) -> dict[str, Any]:
    return {
        "start_utc": rise,
        "end_utc": sets,
        "start_s": c.start_s,
        "end_s": c.end_s,
        "begins": c.begins,
        "ends": c.ends,
    }


def _passes_data(day: DayStudy, way: Way) -> list[dict[str, Any]]:
    utc = day.view.pair.epoch.utc
    return [
        {**_contact_data(c, utc(c.start_s), utc(c.end_s)), "station": station, "could_carry_bit": float(bit)}
        for c, station, bit in zip(way.contacts, way.stations, way.carried_bit, strict=True)
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
