"""A day of the link in words and as plain data."""

import math

from microrad.orbit.day import NOTHING, Closing, DayStudy, Numbers, Swing, Way
from microrad.report.quantities import duration, plain, quantity, volume

MATTERS = 1.1
"""Factor by which an assumption has to change the comparison to be named."""


def sentences(day: DayStudy) -> list[str]:
    """The answers of the day, a sentence each."""
    said = [*headline(day), contact_words(day), rate_words(day), *sky_words(day)]
    return [*said, *latency_words(day), *assumption_words(day)]


def headline(day: DayStudy) -> list[str]:
    """What the relay and the downlinks could carry."""
    relay, span = day.relay, duration(day.view.duration_s)
    whole = day.operations is None or day.operations.relay_share == 1.0
    said = (
        f"In {span} the {day.view.partner} {_how_much(day, relay, whole)}, and could carry "
        f"{volume(relay.capacity_bit)}{_a_day(day, volume(relay.capacity_bit / day.view.days))}"
    )
    parts = [said]
    if day.direct is not None:
        d, down = day.direct, day.operations.downlink if day.operations else None
        stations = ", ".join(down.stations) if down else ""
        carried = f"{volume(d.capacity_bit)}{_a_day(day, volume(d.capacity_bit / day.view.days))}"
        ground = f"The ground ({stations}) {_how_much(day, d)}, and could carry {carried}"
        parts.append(f"{ground}{_compared(day, day.ratio)}")
    if day.optical is not None:
        parts.append(f"{_optical_words(day, day.optical)}{_compared(day, day.optical_ratio)}")
    return [f"{'. '.join(parts)}."]


def _optical_words(day: DayStudy, way: Way) -> str:
    """What the optical stations could carry, the mean of the drawn skies and how far those part."""
    down, days = day.operations.optical, day.view.days
    assert down is not None  # the way is of this table
    stations = f"Optical ground stations ({', '.join(down.stations)})"
    if not way.contacts:
        return f"{stations} are never used"
    least, most = (volume(bit) for bit in way.capacity_spread_bit)
    spread = "" if least == most else f", from {least} to {most} by the weather drawn"
    return (
        f"{stations} are in use for {contact_time(way.contact_s)}{_a_day(day, contact_time(way.contact_s / days))}, "
        f"and could carry {volume(way.capacity_bit)}{_a_day(day, volume(way.capacity_bit / days))}{spread}"
    )


def sky_words(day: DayStudy) -> list[str]:
    """How often some optical station is clear; nothing without any."""
    sky = day.sky
    if sky is None:
        return []
    skies = "the one drawn sky" if day.operations.runs == 1 else f"the {day.operations.runs} drawn skies"
    drawn = f"{percent(sky.any_drawn)} in {skies}"
    if len(sky.names) == 1:
        return [f"The sky over {sky.names[0]} is clear for {percent(sky.any_clear)} of the time ({drawn})."]
    return [
        f"At least one of the {len(sky.names)} optical stations is clear for {percent(sky.any_clear)} of the time "
        f"({drawn}); with clouds that are independent from site to site it would be {percent(sky.any_independent)}."
    ]


def percent(share: float) -> str:
    """A share of the time."""
    return f"{100.0 * share:.1f} %"


def _compared(day: DayStudy, ratio: float) -> str:
    """The direct downlink against the relay, in words; nothing where one of them carries nothing."""
    if not 0.0 < ratio < math.inf:
        return ""
    return f"; the {day.view.partner} could carry {plain(ratio)} times as much"


def times(count: float) -> str:
    """How often, in three digits; a count of more has all of its own."""
    shown = f"{count:.0f}" if count >= 100.0 else f"{count:.3g}"
    return "once" if shown == "1" else "never" if count == 0 else f"{shown} times"


def _how_much(day: DayStudy, way: Way, whole: bool = True) -> str:
    """Number and time of the contacts of a way, all of them or those that are granted."""
    if not way.contacts:
        return "is never in view" if whole else "never grants the link"
    days = day.view.days
    a_day = _a_day(day, f"{times(len(way.contacts) / days)}, {contact_time(way.contact_s / days)}")
    seen = "is in view" if whole else "grants the link"
    return f"{seen} {times(len(way.contacts))}, {contact_time(way.contact_s)} in all{a_day}"


def contact_time(time_s: float) -> str:
    """Time in contact, in minutes up to a thousand of them."""
    return f"{time_s / 60.0:.0f} min" if time_s < 6e4 else f"{time_s / 3600.0:.1f} h"


def _a_day(day: DayStudy, said: str) -> str:
    """What that is in a day, where the span has more than one."""
    return f" ({said} a day)" if day.view.days > 1.0 + 1e-9 else ""


def contact_words(day: DayStudy) -> str:
    """The contacts with the relay, and what their line of sight reaches."""
    v = day.view
    if not v.encounters:
        return f"There is no contact: {_never(day)}."
    least = min(e.range_least_m for e in v.encounters)
    doppler = round(v.largest("doppler_most_hz"))  # two slots have only what rounding leaves
    hand = ""
    if v.closed_form is not None:
        hand = (
            f" Over the equator a contact would take {v.closed_form.duration_s / 60.0:.2f} min, by the formula for "
            "coplanar circular orbits."
        )
    ahead, rate = v.largest("point_ahead_most_rad"), v.largest("rate_most_rad_s")
    parts, hidden = "", "the Earth" if v.partner == "relay" else "the mask"
    if v.rises < len(v.encounters):
        parts = f" It rises {times(v.rises)} only: a limit other than {hidden} cuts some contacts in two."
    at_a_time = "" if math.isnan(v.median_s) else f" {duration(v.median_s)} at a time (median),"
    return (
        f"The {v.partner} is in view for {100 * v.visible_share:.1f} % of the time,{at_a_time} and out of it for "
        f"{duration(v.gap_s)} at most. Range {kilometres(least)} to "
        f"{kilometres(v.largest('range_most_m'))} km, point-ahead up to {quantity(ahead, 'rad')}, line of sight up to "
        f"{quantity(rate, 'rad/s')}, Doppler shift up to {quantity(doppler, 'Hz')} either way.{parts}{hand}"
    )


def _never(day: DayStudy) -> str:
    leo, geo = day.view.pair.leo.name, day.view.pair.geo.name
    return f"within the span and the limits of the mission, {leo} and {geo} do not see one another"


def rate_words(day: DayStudy) -> str:
    """The rates, and how far each reaches."""
    o, furthest = day.operations, day.view.largest("range_most_m")
    assert o is not None
    if not day.closings:
        return "The receiver takes none of the mission's data rates."

    def reaches(c: Closing) -> bool:
        return 0.0 < furthest <= c.largest_range_m

    said = "; ".join(
        f"{quantity(c.rate_bit_s, 'bit/s')} "
        + ("at every range of the contacts" if reaches(c) else f"up to {kilometres(c.largest_range_m)} km")
        for c in day.closings
    )
    ends = max((c.largest_range_m for c in day.closings), default=0.0)
    circular = ""
    if day.derived and 0.0 < ends < furthest:
        circular = f" How far it reaches, and so the volume, follows from {'; '.join(day.derived)}."
    lost = f"; {plain(100 * day.loss.outage, 2)} % of the time is lost in outage" if day.loss.outage else ""
    idle = ""
    if all(c.largest_range_m < furthest for c in day.closings):
        idle = f" Beyond that no data flow: the contacts reach {kilometres(furthest)} km."
    return (
        f"With a pointing loss of {day.loss.loss_db:.2f} dB ({day.loss.source}) the laser link has the demanded "
        f"{o.margin_db:g} dB for {said}{lost}.{idle}{circular}"
    )


def kilometres(range_m: float) -> str:
    """A range in kilometres."""
    return f"{range_m / 1e3:.0f}"


def latency_words(day: DayStudy) -> list[str]:
    """How long the instrument's data take to the user."""
    made = volume(day.relay.generated_bit)
    said = [f"What becomes of the {made} that the instrument makes: by the {day.view.partner} {_arrived(day.relay)}"]
    if day.direct is not None:
        said.append(f"by the direct downlink {_arrived(day.direct)}")
    if day.optical is not None:
        said.append(f"by the optical downlink {_arrived(day.optical)}")
    return ["; ".join(said) + "."]


def _arrived(way: Way) -> str:
    """What becomes of the instrument's data by one way; the latency is that of what the store has kept."""
    if way.arrived_bit <= 0.0:
        return "nothing arrives"
    slow = "less than 99 % by the end" if math.isinf(way.slow_s) else f"99 % within {duration(way.slow_s)}"
    half = "less than half arrives" if math.isinf(way.median_s) else f"half arrives within {duration(way.median_s)}"
    late = f", {volume(way.on_board_bit)} are still on board at the end" if way.on_board_bit > 1.0 else ""
    if way.lost_bit <= 0.0:
        return f"{half}, and {slow}{late}"
    lost = f"{volume(way.lost_bit)} find the store full"
    return f"{volume(way.arrived_bit)} arrive (of what is kept {half}, and {slow}), {lost}{late}"


def assumption_words(day: DayStudy) -> list[str]:
    """Which assumption matters most, for the volumes and for the latencies."""
    moving = sorted((s for s in day.swings if s.of_relay > MATTERS), key=lambda s: -s.of_relay)
    found = []
    both = day.direct is not None and day.direct.capacity_bit > 0.0
    if moving:
        what = "ratio of the two volumes" if both else f"{day.view.partner}'s volume"
        named = "; ".join(f"{s.name} ({_ends(s, both, day.view.partner)})" for s in moving[:3])
        found.append(f"What matters most to the {what}, each assumption changed alone: {named}.")
    if weighty := sorted((s for s in day.swings if s.of_optical > MATTERS), key=lambda s: -s.of_optical):
        named = "; ".join(f"{s.name} ({_optical_ends(s)})" for s in weighty[:3])
        found.append(f"What matters most to the optical downlink's volume: {named}.")
    waits = sorted(day.swings, key=lambda s: -_wait_factor(s))
    if waits and _wait_factor(waits[0]) > MATTERS:
        s = waits[0]
        by = [f"within {_both(s, 'relay_slow_s')} by the {day.view.partner}"]
        if day.direct is not None:
            by.append(f"within {_both(s, 'direct_slow_s')} directly")
        if day.optical is not None:
            by.append(f"within {_both(s, 'optical_slow_s')} by the optical downlink")
        found.append(
            f"How late data arrive depends most on {s.name}: with {s.low} or {s.high}, 99 % arrive {', '.join(by)}."
        )
    return found


def _ends(s: Swing, ratio: bool, partner: str) -> str:
    def shown(n: Numbers) -> str:
        if n.relay_bit == 0.0:
            return f"nothing by {partner}"
        return (ratio_text(n) or "nothing direct") if ratio else volume(n.relay_bit)

    return f"{s.low}: {shown(s.at_low)}, {s.high}: {shown(s.at_high)}"


def _optical_ends(s: Swing) -> str:
    ends = ((s.low, s.at_low), (s.high, s.at_high))
    return ", ".join(f"{text}: {volume(n.optical_bit)}" for text, n in ends if text != NOTHING)


def ratio_text(n: Numbers) -> str:
    """Volume by relay over volume direct; nothing where the latter is none."""
    return plain(n.ratio) if n.direct_bit > 0.0 else ""


def _both(s: Swing, name: str) -> str:
    ends = [duration(getattr(n, name)) for n in (s.at_low, s.at_high)]
    return ends[0] if ends[0] == ends[1] else f"{ends[0]} or {ends[1]}"


def _wait_factor(s: Swing) -> float:
    """Largest over smallest 99 % latency, as it is and at both sides, of the way that an assumption changes more."""
    factors = [1.0]
    for name in ("relay_slow_s", "direct_slow_s", "optical_slow_s"):
        low, middle, high = sorted(getattr(n, name) for n in (s.here, s.at_low, s.at_high))
        if low > 0.0 and low != high and not math.isnan(low + middle + high):
            factors.append(high / low)
    return max(factors)
