"""When two terminals can see each other, and a ground station a satellite; and what begins and ends each contact."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.earth import EARTH_RADIUS_M, GEOSTATIONARY_RADIUS_M, MU_M3_S2, ROTATION_RAD_S
from microrad.core.units import format_quantity
from microrad.orbit.base import Orbit, OrbitError, States
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.earth.figure import Earth, GroundSite, Station, elevation_rad
from microrad.orbit.visibility.events import Intervals, Rows, intersection, largest, positive, positive_rows
from microrad.orbit.visibility.limits import Condition, Side, Terminal, conditions
from microrad.orbit.visibility.line_of_sight import dot

Span = tuple[float, float]

START, END = "start of the span", "end of the span"
EARTH = "Earth"
RANGE = "range"

_STEPS_PER_TURN = 85.0  # 60 s for every orbit with its perigee above 100 km
_MOST_SAMPLES = 5_000_000


# ------------------------------------------------------------------------------------------------------------ contacts
@dataclass(frozen=True, slots=True)
class Contact:
    """One contact, in seconds after the epoch, and what begins and ends it, in words; two at once joined by "and"."""

    start_s: float
    end_s: float
    begins: str
    ends: str

    @property
    def duration_s(self) -> float:
        """How long it takes."""
        return self.end_s - self.start_s


@dataclass(frozen=True, slots=True)
class Pass(Contact):
    """A contact with a ground station, with its largest elevation and when that is."""

    highest_rad: float
    highest_s: float


# ---------------------------------------------------------------------------------------------------------- the samples
def coarse_step_s(orbit: Orbit, time_s: float) -> float:
    """Step in s in which an orbit is sampled: 60 s times a power of two, at most an 85th of a turn at perigee's rate.

    The perigee is that of the ellipse through the state at one time: with the angular momentum h its radius is
    h^2 / (mu (1 + e)), and its rate h over that squared. Every low orbit has 60 s, so that samples can be shared.

    Args:
        orbit: The orbit.
        time_s: The time, s since the epoch.

    Raises:
        OrbitError: For a state that falls straight to the Earth's centre.
    """
    if isinstance(orbit, GroundSite):
        return 60.0
    position, velocity = (vector[:, 0] for vector in orbit.states(np.array([time_s])))
    with np.errstate(over="ignore", invalid="ignore"):  # of a state that is no number
        momentum = np.cross(position, velocity)
        eccentricity = np.linalg.norm(np.cross(velocity, momentum) / MU_M3_S2 - position / np.linalg.norm(position))
        square = float(momentum @ momentum)
        perigee = square / (MU_M3_S2 * (1.0 + float(eccentricity)))
        longest = 2.0 * math.pi * perigee**2 / math.sqrt(square) / _STEPS_PER_TURN if square > 0.0 else 0.0
    if not 0.0 < longest < math.inf:
        raise OrbitError(
            f"{orbit.name}: the state at {time_s:g} s moves straight to or from the Earth's centre, or is no number; "
            "check its velocity"
        )
    return 60.0 * 2.0 ** math.floor(math.log2(longest / 60.0))


def coarse_times(span_s: Span, step_s: float) -> Floats:
    """Even samples over the span in s, both ends among them, at least five.

    Args:
        span_s: Start and end of the span, s.
        step_s: Largest distance of two samples, s.

    Raises:
        OrbitError: For a span that does not end after its start, and for one of more than 5 million steps.
    """
    start, end = span_s
    if not (math.isfinite(start) and math.isfinite(end) and start < end):
        raise OrbitError(f"the span from {start:g} s to {end:g} s holds no time; give a start and a later end")
    if not (end - start) / step_s <= _MOST_SAMPLES:
        raise OrbitError(
            f"the span from {start:g} s to {end:g} s would be searched in steps of {step_s:.3g} s, more than "
            f"{_MOST_SAMPLES:.0e} of them; give a shorter span, or check the velocities of the orbits"
        )
    return np.linspace(start, end, max(math.ceil((end - start) / step_s), 4) + 1)


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """The states of an orbit at the samples of a span, for use with many partners; `step_s` is its own coarse step."""

    orbit: Orbit
    step_s: float
    time_s: Floats
    states: States

    @classmethod
    def over(cls, orbit: Orbit, span_s: Span, step_s: float = math.inf) -> "Sampled":
        """Sample an orbit in its own coarse step, or in a finer one.

        Args:
            orbit: The orbit.
            span_s: Start and end of the span, s.
            step_s: Another step, s (that of a faster partner), which counts where it is finer.

        Raises:
            OrbitError: As `coarse_step_s` and `coarse_times`, and where the orbit does not hold.
        """
        own = coarse_step_s(orbit, span_s[0])
        time_s = coarse_times(span_s, min(own, step_s))
        return cls(orbit, own, time_s, orbit.states(time_s))

    def at(self, time_s: Floats) -> States:
        """The states at these samples, kept ones if they are the same."""
        return self.states if np.array_equal(time_s, self.time_s) else self.orbit.states(time_s)


# ------------------------------------------------------------------------------------------------------------- contacts
def contacts(first: Terminal, second: Terminal, earth: Earth, epoch: Epoch, span_s: Span) -> tuple[Contact, ...]:
    """The contacts of two terminals in the span (start, end), in order; the ends as exact as the orbits, to 1e-6 s.

    The same to the last bit when the two are swapped. Light time (0.15 s over 44 000 km) is left out; the ends may move
    by as much.

    Args:
        first: A terminal on its orbit.
        second: The other one, of another name.
        earth: What hides one from the other.
        epoch: Instant from which all times count.
        span_s: Start and end of the search, s.

    Raises:
        OrbitError: For two terminals of one name, a span that holds no time, two orbits that meet, a terminal below the
            surface that the line of sight must clear, or a time at which an orbit does not hold.
    """
    return contacts_with_each(first, (second,), earth, epoch, span_s)[0]


def contacts_with_each(
    satellite: Terminal,
    relays: Sequence[Terminal],
    earth: Earth,
    epoch: Epoch,
    span_s: Span,
    sampled: Sequence[Sampled] = (),
    furthest_m: float = math.inf,
) -> tuple[tuple[Contact, ...], ...]:
    """`contacts` of a satellite with each of the relays, solved together, up to a range of `furthest_m`.

    Limits that are not set cost nothing.

    Args:
        satellite: One terminal on its orbit.
        relays: The others, none of them of the satellite's name.
        earth: What hides one from the other.
        epoch: Instant from which all times count.
        span_s: Start and end of the search, s.
        sampled: States of each relay, which several satellites may share:
            ``Sampled.over(relay.orbit, span_s, coarse_step_s(satellite.orbit, span_s[0]))``. Those in another step are
            left aside.
        furthest_m: Largest range of a contact, m; infinite without a limit.

    Raises:
        OrbitError: As `contacts`.
    """
    for relay in relays:
        if relay.name == satellite.name:
            raise OrbitError(f'two terminals are called "{relay.name}"; give each a name of its own')
    own = coarse_step_s(satellite.orbit, span_s[0])
    others = tuple(sampled) or tuple(Sampled.over(relay.orbit, span_s, own) for relay in relays)
    time_s = coarse_times(span_s, min(own, *(other.step_s for other in others), math.inf))
    if furthest_m <= 0.0:  # the link closes nowhere
        return ((),) * len(relays)
    if not relays:
        return ()
    both = partial(_when, satellite.orbit, others, time_s)
    shared = [(EARTH, both(partial(_clearance_rad, (satellite, *relays), earth)))]
    if furthest_m < math.inf:
        shared.append((RANGE, both(partial(_spare, furthest_m))))
    found = []
    for place, relay in enumerate(relays):
        hidden = hidden_by(satellite, relay)
        kept = [(hidden if cause == EARTH else cause, intervals[place]) for cause, intervals in shared]
        for one, other in ((satellite, relay), (relay, satellite)):
            kept.extend(conditions(Side(one, other, earth, epoch), time_s))
        found.append(_combined(kept, span_s))
    return tuple(found)


def _clearance_rad(
    terminals: Sequence[Terminal], earth: Earth, time_s: Floats, row: Rows, first_m: Floats, second_m: Floats
) -> Floats:
    """By how much the line from the first terminal to that of each row clears the Earth; raises OrbitError.

    A station sees what stands above its mask.
    """
    if any(isinstance(each.orbit, GroundSite) for each in terminals):
        return _above_masks(terminals, earth, time_s, row, first_m, second_m)
    try:
        return earth.clearance_rad(first_m, second_m)
    except OrbitError:
        heights = np.stack((earth.height_m(first_m), earth.height_m(second_m)))
        which, worst = np.unravel_index(np.argmin(heights), heights.shape)  # argmin finds nan first
        name = terminals[0 if which == 0 else row[worst] + 1].name
        height_m, when_s = float(heights[which, worst]), float(time_s[worst])
        if math.isnan(height_m):
            raise OrbitError(f"the position of {name} at {when_s:.9g} s is not a number; check its orbit") from None
        raise OrbitError(
            f"{name} is {height_m / 1e3:.3f} km over the Earth at {when_s:.9g} s, not above the "
            f"{earth.grazing_height_m / 1e3:.6g} km that lines of sight must clear; lower orbit.grazing_height, or "
            "raise the orbit"
        ) from None


def hidden_by(first: Terminal, second: Terminal) -> str:
    """What hides two terminals from one another, in words: the Earth, or the mask of a station.

    Args:
        first: One terminal.
        second: The other one.
    """
    site = next((each.orbit for each in (first, second) if isinstance(each.orbit, GroundSite)), None)
    return EARTH if site is None else mask_of(site.station)


def mask_of(station: Station) -> str:
    """What begins and ends a contact at the elevation mask of a station, in words.

    Args:
        station: The station.
    """
    return f"elevation mask of {station.name}"


def _above_masks(
    terminals: Sequence[Terminal], earth: Earth, time_s: Floats, row: Rows, first_m: Floats, second_m: Floats
) -> Floats:
    """As `_clearance_rad`, but where one end is a station: the elevation less that of its mask."""
    own, found = terminals[0].orbit, np.empty(row.size)
    for index in np.unique(row):
        chosen, other = row == index, terminals[index + 1]
        time, first, second = time_s[chosen], first_m[:, chosen], second_m[:, chosen]
        if isinstance(own, GroundSite):
            found[chosen] = own.above_mask(time, second)
        elif isinstance(other.orbit, GroundSite):
            found[chosen] = other.orbit.above_mask(time, first)
        else:
            pair, alone = (terminals[0], other), np.zeros(int(np.sum(chosen)), dtype=row.dtype)
            found[chosen] = _clearance_rad(pair, earth, time, alone, first, second)
    return found


def _spare(furthest_m: float, _time_s: Floats, _row: Rows, first_m: Floats, second_m: Floats) -> Floats:
    """One less the square of the range in units of the largest."""
    apart = second_m - first_m
    return np.asarray(1.0 - dot(apart, apart) / furthest_m**2)


def _when(
    orbit: Orbit, others: Sequence[Sampled], time_s: Floats, function: Callable[[Floats, Rows, Floats, Floats], Floats]
) -> tuple[Intervals, ...]:
    """When a function of time, row, and the places of an orbit and of that row's other is positive: for each row."""

    def along(time: Floats, row: Rows) -> Floats:
        second = np.empty((3, time.size))
        for index in np.unique(row):
            chosen = row == index
            second[:, chosen] = others[index].orbit.states(time[chosen]).position_m
        return function(time, row, orbit.states(time).position_m, second)

    first, values = orbit.states(time_s).position_m, np.empty((len(others), time_s.size))
    for index, other in enumerate(others):
        values[index] = function(time_s, np.full(time_s.size, index), first, other.at(time_s).position_m)
    return positive_rows(along, time_s, values)


def _combined(kept: Sequence[Condition], span_s: Span) -> tuple[Contact, ...]:
    """The contacts in which all conditions hold."""

    def cause(time_s: float, edge: int) -> str:
        if time_s == span_s[edge]:
            return (START, END)[edge]
        return " and ".join(sorted(each for each, intervals in kept if np.any(intervals[:, edge] == time_s)))

    both = intersection(*(intervals for _, intervals in kept)).tolist()
    return tuple(Contact(start, end, cause(start, 0), cause(end, 1)) for start, end in both)


# --------------------------------------------------------------------------------------------------------------- passes
def passes(orbit: Orbit, station: Station, epoch: Epoch, span_s: Span) -> tuple[Pass, ...]:
    """The passes of a satellite over a ground station in the span: its elevation, geometric, is above the mask.

    Args:
        orbit: Orbit of the satellite.
        station: Place and elevation mask.
        epoch: Instant from which all times count.
        span_s: Start and end of the search, s.

    Raises:
        OrbitError: If the span holds no time, or the orbit does not hold over it.
    """
    step = coarse_step_s(orbit, span_s[0])
    time_s = coarse_times(span_s, step)
    mask = mask_of(station)

    def elevation(time: Floats) -> Floats:
        return elevation_rad(station, epoch, time, orbit.states(time).position_m)

    windows = positive(lambda time: elevation(time) - station.mask_rad, time_s)
    found = []
    for (start, end), when, highest in zip(windows.tolist(), *largest(elevation, windows, step), strict=True):
        begins, ends = START if start == span_s[0] else mask, END if end == span_s[1] else mask
        found.append(Pass(start, end, begins, ends, float(highest), float(when)))
    return tuple(found)


def station_range(orbit: Orbit, station: Station, epoch: Epoch) -> Callable[[Floats], Floats]:
    """What gives the range in m from a station to a satellite at times in s, both of shape (n,).

    Args:
        orbit: Orbit of the satellite.
        station: The station.
        epoch: Instant from which all times count.
    """

    def range_m(time_s: Floats) -> Floats:
        line = orbit.states(time_s).position_m - station.position(epoch, time_s).position_m
        return np.asarray(np.sqrt(dot(line, line)))

    return range_m


# -------------------------------------------------------------------------------------------------------------- by hand
class CoplanarContact(NamedTuple):
    """One contact, the time from the start of one to the start of the next, and the ranges while in contact."""

    duration_s: float
    repeat_s: float
    shortest_range_m: float
    longest_range_m: float

    @property
    def visible_share(self) -> float:
        """Share of the time in contact."""
        return self.duration_s / self.repeat_s


def coplanar_contact(radius_m: float, grazing_height_m: float) -> CoplanarContact:
    """The contact of a satellite on a circular orbit over the equator, eastward, with one in a geostationary slot.

    In closed form, with a the radius of the lower orbit, R = `EARTH_RADIUS_M` + grazing height what the line of sight
    must clear, and b = `GEOSTATIONARY_RADIUS_M`. The angle between the two as seen from the Earth's centre is at most
    acos(R/a) + acos(R/b) either way and grows by the difference of the two rates, n - w: the contact takes

        T (acos(R/a) + acos(R/b)) / pi,   T = 2 pi / (n - w),   n = sqrt(mu / a^3),

    the range goes from b - a to sqrt(a^2 - R^2) + sqrt(b^2 - R^2), where the line grazes the surface. Two bodies, no
    flattening: on the equator the oblate Earth hides what the sphere hides.

    Args:
        radius_m: Radius of the lower orbit from the Earth's centre, m.
        grazing_height_m: Height over the equatorial radius that the line of sight must clear, m.

    Raises:
        OrbitError: Unless R < a < b.
    """
    high, least = GEOSTATIONARY_RADIUS_M, EARTH_RADIUS_M + grazing_height_m
    if not (math.isfinite(radius_m) and 0.0 < least < radius_m < high):
        raise OrbitError(
            f"an orbit of radius {format_quantity(radius_m, 'm')} is not between the surface to clear, "
            f"{format_quantity(least, 'm')}, and the geostationary {format_quantity(high, 'm')}; give a radius between"
        )
    half = math.acos(least / radius_m) + math.acos(least / high)
    repeat = 2.0 * math.pi / (math.sqrt(MU_M3_S2 / radius_m**3) - ROTATION_RAD_S)
    longest = math.sqrt(radius_m**2 - least**2) + math.sqrt(high**2 - least**2)
    return CoplanarContact(repeat * half / math.pi, repeat, high - radius_m, longest)
