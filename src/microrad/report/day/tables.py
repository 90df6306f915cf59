"""A day of the link as tables: every contact, the ways side by side, the sky, and each assumption changed."""

import math

from microrad.orbit import Contact, Pass
from microrad.orbit.day import NOTHING, DayStudy, Encounter, Numbers
from microrad.report.day.words import contact_time, kilometres, percent, ratio_text
from microrad.report.quantities import duration, plain, volume
from microrad.report.tables import Table

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


def contacts_table(day: DayStudy) -> Table:
    """Each contact by every way, in the order of their rise."""
    rows = [
        (e.contact.start_s, _relay_row(day, e, bit))
        for e, bit in zip(day.encounters, day.relay.carried_bit, strict=True)
    ]
    for way, behind in ((day.direct, ""), (day.optical, ", optical")):
        if way is None:
            continue
        rows += [
            (c.start_s, _row(day, station + behind, c, ("", "", "", "", f"{math.degrees(c.highest_rad):.1f}"), bit))
            for c, station, bit in zip(way.contacts, way.stations, way.carried_bit, strict=True)
            if isinstance(c, Pass)
        ]
    found = [row for _, row in sorted(rows, key=lambda item: item[0])]
    of = ["start_s", "end_s", "duration_s", "range_most_m", "point_ahead_most_rad", "line_of_sight_rate_most_rad_s"]
    of += ["doppler_most_hz", "highest_elevation_rad", "could_carry_bit"]
    names = {place: f"day.contacts.{name}" for place, name in enumerate(of, 1)}
    brief = (0, 1, 2, 3, 9, 10)
    return Table("Contacts", CONTACT_COLUMNS, found, (0, 10), brief=brief, folded="Every contact", names=names)


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


def ways_table(day: DayStudy) -> Table:
    """Relay and downlinks side by side."""
    ways = day.ways
    rows = [
        ("contacts", *(str(len(w.contacts)) for w in ways)),
        ("time in contact", *(contact_time(w.contact_s) for w in ways)),
        ("longest time without contact", *(duration(w.gap_s) for w in ways)),
        ("could carry", *(volume(w.capacity_bit) for w in ways)),
        ("contacts without acquisition", plain(day.relay.failed_contacts), *[""] * (len(ways) - 1)),
        ("made by the instrument", *(volume(w.generated_bit) for w in ways)),
        ("lost for want of room", *(volume(w.lost_bit) for w in ways)),
        ("on board at most", *(volume(w.history.largest_stored_bit) for w in ways)),
        ("on board at the end of what is followed", *(volume(w.on_board_bit) for w in ways)),
        ("arrive", *(volume(w.arrived_bit) for w in ways)),
        ("latency of what is kept, median", *(duration(w.median_s) for w in ways)),
        ("latency of what is kept, 99 %", *(duration(w.slow_s) for w in ways)),
    ]
    of = ["contacts", "contact_s", "longest_gap_s", "could_carry_bit", "contacts_without_acquisition"]
    of += ["generated_bit", "lost_bit", "", "on_board_at_end_bit", "arrived_bit", "latency_median_s"]
    of.append("latency_99_percent_s")
    keys = ["relay", *(["direct"] if day.direct else []), *(["optical"] if day.optical else [])]
    names = {place: [f"day.{way}.{name}" if name else "" for name in of] for place, way in enumerate(keys, 1)}
    carried = " and ".join(f"{volume(w.capacity_bit)} by {w.name}" for w in ways)
    folded = f"What the ways could carry: {carried}; line by line"
    first = day.view.partner.capitalize()
    title = f"{first} and direct downlink" if day.optical is None else f"{first} and downlinks"
    return Table(title, ("", *(w.name for w in ways)), rows, (0,), folded=folded, names=names)


def sky_table(day: DayStudy) -> Table | None:
    """How often each optical station is clear, and any of them; None without any."""
    if day.sky is None:
        return None
    s = day.sky
    rows = [(n, percent(a), percent(d)) for n, a, d in zip(s.names, s.availability, s.drawn, strict=True)]
    rows.append(("any of them", percent(s.any_clear), percent(s.any_drawn)))
    rows.append(("any of them, were clouds independent", percent(s.any_independent), ""))
    given, drawn = ([f"day.sky.sites.{n}.{of}" for n in s.names] for of in ("availability", "drawn"))
    names = {
        1: [*given, "day.sky.any_clear", "day.sky.any_clear_independent"],
        2: [*drawn, "day.sky.any_clear_drawn", ""],
    }
    headings, folded = ("optical station", "clear", "in the runs"), "Share of the time without clouds"
    return Table("Clear sky over the stations", headings, rows, (0,), folded=folded, names=names)


def assumptions_table(day: DayStudy) -> Table:
    """Each assumption with both of its values and what they come to."""
    rows = [
        (s.name, text, *_numbers(n, day.direct is not None, day.optical is not None))
        for s in day.swings
        for text, n in ((s.low, s.at_low), (s.high, s.at_high))
        if text != NOTHING
    ]
    behind = () if day.optical is None else ("optical", "99 %\noptical")
    way = day.view.partner
    headings = ("assumption", "changed to", way, "direct", "ratio", f"99 % by\n{way}", "99 %\ndirect", *behind)
    of = ("relay_could_carry_bit", "direct_could_carry_bit", "", "relay_latency_99_percent_s")
    names = {place: f"day.{name}" if name else "" for place, name in enumerate((*of, "direct_latency_99_percent_s"), 2)}
    if day.optical is not None:
        more = ("optical_could_carry_bit", "optical_latency_99_percent_s")
        names |= {place: f"day.{name}" for place, name in enumerate(more, len(headings) - 2)}
    folded = "One assumption changed, all others as they are"
    return Table("One assumption changed", headings, rows, (0, 1), folded=folded, names=names)


def _numbers(n: Numbers, direct: bool, optical: bool) -> tuple[str, ...]:
    more = (volume(n.optical_bit), duration(n.optical_slow_s)) if optical else ()
    if not direct:
        return volume(n.relay_bit), "", "", duration(n.relay_slow_s), "", *more
    waits = duration(n.relay_slow_s), duration(n.direct_slow_s)
    return volume(n.relay_bit), volume(n.direct_bit), ratio_text(n), *waits, *more
