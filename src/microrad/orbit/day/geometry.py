"""When both terminals of the link see one another, and what the line of sight does meanwhile."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from microrad import orbit
from microrad.core.arrays import Floats
from microrad.core.units import SPEED_OF_LIGHT_M_S, format_quantity
from microrad.mission.model import LinkMission
from microrad.orbit.earth.sun import shadow_rad
from microrad.orbit.from_mission import TAIL_S
from microrad.orbit.visibility.contacts import END, START, coarse_step_s, coarse_times, hidden_by
from microrad.orbit.visibility.events import positive

_C = TypeVar("_C", bound=orbit.Contact)

SAMPLE_S = 10.0
"""Step in which a contact is looked at: a range turns within minutes."""
_CIRCULAR = 1e-6  # eccentricity up to which the closed form holds
_TOLERANCE = 0.01  # by which a constant of the mission may fall short of its orbits


@dataclass(frozen=True, slots=True)
class Encounter:
    """A contact with its line of sight at the moments of `times`, and what that reaches.

    All are largest in magnitude but for ``range_least_m``.
    """

    contact: orbit.Contact
    sight: orbit.LineOfSight
    range_least_m: float
    range_most_m: float
    point_ahead_most_rad: float
    rate_most_rad_s: float
    acceleration_most_rad_s2: float
    range_rate_most_m_s: float
    doppler_most_hz: float


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """The contacts of the mission's two terminals.

    ``encounters`` are those of the span of ``pair``, cut at its end. ``contacts`` are all of them whole, those behind
    the span too, in which its data may still be sent. ``range_m`` has the range over time for each, a spline that is
    exact to a millimetre. ``umbra_s`` (n, 2) are the eclipses of the lower satellite in the span. ``closed_form`` is
    the contact of an orbit of the same radius over the equator, where that orbit and no field of regard decide.
    """

    pair: orbit.Pair
    encounters: tuple[Encounter, ...]
    contacts: tuple[orbit.Contact, ...]
    range_m: tuple[Callable[[Floats], Floats], ...]
    umbra_s: Floats
    closed_form: orbit.CoplanarContact | None

    @property
    def duration_s(self) -> float:
        """The span that is looked at."""
        return self.pair.span_s[1]

    @property
    def days(self) -> float:
        """The span in days of 86 400 s."""
        return self.duration_s / 86400.0

    @property
    def contact_s(self) -> float:
        """Time in contact within the span."""
        return sum(e.contact.duration_s for e in self.encounters)

    @property
    def visible_share(self) -> float:
        """Share of the span in contact."""
        return self.contact_s / self.duration_s

    @property
    def gap_s(self) -> float:
        """Longest time without a contact, see `longest_gap_s`."""
        return longest_gap_s(self.contacts, self.pair)

    @property
    def rises(self) -> int:
        """How often the partner comes out from behind the Earth, or is there at the beginning.

        A contact that the Sun or a limit cuts in two counts once.
        """
        hidden = hidden_by(self.pair.leo, self.pair.geo)
        return sum(hidden in e.contact.begins or START in e.contact.begins for e in self.encounters)

    @property
    def median_s(self) -> float:
        """Median duration of the contacts that neither end of what is looked at cuts; nan without one."""
        inside = (e.contact for e in self.encounters if START not in e.contact.begins and END not in e.contact.ends)
        whole = [contact.duration_s for contact in inside]
        return float(np.median(whole)) if whole else math.nan

    def largest(self, name: str) -> float:
        """Largest of one of the quantities of `Encounter` over all contacts; 0 without any."""
        return max((getattr(e, name) for e in self.encounters), default=0.0)


def longest_gap_s(contacts: Sequence[orbit.Contact], pair: orbit.Pair) -> float:
    """The longest time in s without a contact, of the gaps that begin within the span; it may end behind the span.

    The last gap ends with the tail of the span. Without any contact it is the span.

    Args:
        contacts: The contacts of the span and of its tail, in order.
        pair: The two terminals, for the span and its tail.
    """
    begin_s, end_s = pair.span_s
    if not contacts:
        return end_s - begin_s
    edges = [begin_s, *(t for c in contacts for t in (c.start_s, c.end_s)), pair.whole_s[1]]
    return max(b - a for a, b in zip(edges[::2], edges[1::2], strict=True) if a < end_s)


def cut_at(contact: _C, end_s: float) -> _C:
    """The contact up to the end of the span; itself where it ends before.

    Args:
        contact: A contact that begins within the span.
        end_s: End of the span, s.
    """
    return contact if contact.end_s <= end_s else replace(contact, end_s=end_s, ends=END)


def view(pair: orbit.Pair, wavelength_m: float) -> View:
    """The contacts of the mission's two terminals, with what their line of sight does meanwhile.

    Args:
        pair: The terminals on their orbits.
        wavelength_m: Wavelength of the laser, m, for the Doppler shift.

    Raises:
        OrbitError: For orbits that do not hold or meet, and a terminal below the surface that the line of sight must
            clear.
    """
    from scipy.interpolate import CubicHermiteSpline

    found = orbit.contacts(pair.leo, pair.geo, pair.earth, pair.epoch, pair.whole_s)
    sights, own, end = [_sight(pair, c) for c in found], pair.leo.orbit, pair.span_s[1]

    def depth_rad(time_s: Floats) -> Floats:
        sun = orbit.sun_direction(pair.epoch, time_s)
        return shadow_rad(own.states(time_s).position_m, sun, pair.earth.shape)

    return View(
        pair=pair,
        encounters=tuple(encounter(pair, cut_at(c, end), wavelength_m) for c in found if c.start_s < end),
        contacts=found,
        range_m=tuple(CubicHermiteSpline(s.time_s, s.range_m, s.range_rate_m_s) for s in sights),
        umbra_s=positive(depth_rad, coarse_times(pair.span_s, coarse_step_s(own, pair.span_s[0]))),
        closed_form=_closed_form(pair),
    )


def times(contact: orbit.Contact) -> Floats:
    """Moments of a contact, both ends among them."""
    return np.linspace(contact.start_s, contact.end_s, max(math.ceil(contact.duration_s / SAMPLE_S), 20) + 1)


def _sight(pair: orbit.Pair, contact: orbit.Contact) -> orbit.LineOfSight:
    return orbit.sight(pair.leo.orbit, pair.geo.orbit, times(contact))


def encounter(pair: orbit.Pair, contact: orbit.Contact, wavelength_m: float) -> Encounter:
    """A contact with its line of sight, sampled as `times` says, and the largest values that it reaches.

    Args:
        pair: The terminals on their orbits.
        contact: The contact.
        wavelength_m: Wavelength of the laser, m, for the Doppler shift.

    Raises:
        OrbitError: For orbits that do not hold.
    """
    seen = _sight(pair, contact)
    return Encounter(
        contact,
        seen,
        float(np.min(seen.range_m)),
        float(np.max(seen.range_m)),
        float(np.max(seen.point_ahead_rad)),
        float(np.max(seen.rate_rad_s)),
        float(np.max(seen.acceleration_rad_s2)),
        float(np.max(np.abs(seen.range_rate_m_s))),
        float(np.max(np.abs(seen.doppler_hz(wavelength_m)))),
    )


def _closed_form(pair: orbit.Pair) -> orbit.CoplanarContact | None:
    """The contact by hand, for a circular orbit and a slot."""
    low, slot = pair.leo.orbit, pair.geo.orbit
    if not isinstance(low, orbit.KeplerOrbit) or not isinstance(slot, orbit.GeostationarySlot):
        return None
    if low.eccentricity > _CIRCULAR or low.semi_major_axis_m >= orbit.GEOSTATIONARY_RADIUS_M:
        return None
    off_nadir = math.asin(low.semi_major_axis_m / orbit.GEOSTATIONARY_RADIUS_M)
    if pair.leo.limits.field_of_regard_rad < math.pi or pair.geo.limits.field_of_regard_rad < off_nadir:
        return None
    return orbit.coplanar_contact(low.semi_major_axis_m, pair.earth.grazing_height_m)


def short_tail(pair: orbit.Pair) -> tuple[str, ...]:
    """That the orbits do not hold for long enough behind the span to deliver all of its data."""
    if pair.tail_s >= TAIL_S:
        return ()
    held = format_quantity(pair.tail_s, "s")
    return (f"the orbits hold for {held} behind the span: data still on board then count as never arrived",)


def beyond_the_mission(m: LinkMission, seen: View) -> tuple[str, ...]:
    """Constants of the mission that its own orbits exceed by more than 1 %, a sentence each.

    Args:
        m: The mission.
        seen: The contacts of its terminals.
    """
    if not seen.encounters:
        return ()
    ahead, rate, furthest = (seen.largest(n) for n in ("point_ahead_most_rad", "rate_most_rad_s", "range_most_m"))
    checks = [("communication.distance", m.range_m(m.communication), furthest, "m", "range")]
    for name, beam in (("beacon", m.beacon), ("answer", m.answer)):
        if beam is not None:
            checks.append((f"{name}.distance", m.range_m(beam), furthest, "m", "range"))
    if m.point_ahead is not None:
        velocity = ahead * SPEED_OF_LIGHT_M_S / 2.0
        given = m.point_ahead.transverse_velocity_m_s
        checks.append(("point_ahead.transverse_velocity", given, velocity, "m/s", "velocity across the line of sight"))
    fine = getattr(m, "fine_pointing", None)
    if fine is not None:
        given = fine.reference.line_of_sight_rate_rad_s
        checks.append(("fine_pointing.reference.line_of_sight_rate", given, rate, "rad/s", "rate of the line of sight"))
    return tuple(
        f"{key} is {format_quantity(given, unit)}, and the contacts reach a {what} of {format_quantity(most, unit, 5)}"
        + (f", which costs {20.0 * math.log10(most / given):.2f} dB more than budgeted" if what == "range" else "")
        for key, given, most, unit, what in checks
        if most > given * (1.0 + _TOLERANCE)
    )
