"""When two terminals can see each other, and a ground station a satellite; and what begins and ends each contact."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, get_args

import numpy as np

from microrad.orbit.attitude import Attitude, body_axes, body_rate_rad_s, in_body
from microrad.orbit.base import Floats, Orbit, OrbitError, States
from microrad.orbit.earth import MU_M3_S2, Earth
from microrad.orbit.epoch import Epoch
from microrad.orbit.events import (
    Function,
    Intervals,
    Rows,
    complement,
    intersection,
    largest,
    positive,
    positive_rows,
    refined,
    union,
)
from microrad.orbit.ground import Station, elevation_rad
from microrad.orbit.line_of_sight import cross, dot
from microrad.orbit.sun import shadow_rad, sun_direction
from microrad.units import format_quantity

Span = tuple[float, float]

START, END = "start of the span", "end of the span"
EARTH = "Earth"

_STEPS_PER_TURN = 85.0  # 60 s for every orbit with its perigee above 100 km
_TURN_RAD = 0.1  # by which the line of sight may turn in the body from one sample to the next


# ------------------------------------------------------------------------------------------------------------ terminals
@dataclass(frozen=True, slots=True)
class Limits:
    """What a terminal can point at, beside what the Earth hides.

    `boresight` is fixed in the body, along the axes of `Attitude`, of any length. The line of sight is at most
    `field_of_regard_rad` (pi: no limit) away from it. `slew_limit_rad_s` (infinite: none) bounds the rate of the line
    of sight in the body, with the attitude "free" that against the stars. Within `sun_exclusion_rad` (0: none) of the
    Sun nothing is received, unless the Sun is behind the Earth. `in_eclipse` is whether the terminal works in the
    umbra.

    Raises `OrbitError` for an unknown attitude, a boresight without direction, an angle or rate out of range, and a
    field of regard with the attitude "free", where the body turns and it means nothing.
    """

    attitude: Attitude
    boresight: tuple[float, float, float]
    field_of_regard_rad: float
    slew_limit_rad_s: float
    sun_exclusion_rad: float
    in_eclipse: bool

    def __post_init__(self) -> None:
        """Refuse limits that mean nothing."""
        if self.attitude not in get_args(Attitude):
            raise OrbitError(f"the attitude {self.attitude!r} is not known; write nadir, sun or free")
        size = math.hypot(*self.boresight)
        if len(self.boresight) != 3 or not (math.isfinite(size) and size > 0.0):
            raise OrbitError(f"the boresight {self.boresight} has no direction; give three numbers, such as (0, 0, 1)")
        self._require("field of regard", self.field_of_regard_rad, "rad", 0.0 < self.field_of_regard_rad <= math.pi)
        self._require("slew limit", self.slew_limit_rad_s, "rad/s", self.slew_limit_rad_s > 0.0)
        self._require("Sun exclusion", self.sun_exclusion_rad, "rad", 0.0 <= self.sun_exclusion_rad < math.pi)
        if self.attitude == "free" and self.field_of_regard_rad < math.pi:
            raise OrbitError(
                'a field of regard means nothing with the attitude "free": the body turns its boresight onto the '
                'partner; leave it out, or hold the body "nadir" or "sun"'
            )

    @staticmethod
    def _require(what: str, value: float, unit: str, holds: bool) -> None:
        if not holds:
            raise OrbitError(
                f"a {what} of {format_quantity(value, unit)} is out of range; give the half angle of a field of regard "
                "above 0 to pi, a slew limit above 0, a Sun exclusion from 0 to below pi"
            )


UNLIMITED = Limits("free", (0.0, 0.0, 1.0), math.pi, math.inf, 0.0, True)
"""Only the Earth stands in the way."""


@dataclass(frozen=True, slots=True)
class Terminal:
    """A terminal on an orbit; the causes of its contacts name it by `name`."""

    orbit: Orbit
    limits: Limits
    name: str


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
    """Step in which an orbit is sampled: 60 s times a power of two, at most an 85th of a turn at its perigee's rate.

    The perigee is that of the ellipse through the state at `time_s`: with the angular momentum h its radius is
    h^2 / (mu (1 + e)), and its rate h over that squared. Every low orbit has 60 s, so that samples can be shared.
    """
    position, velocity = (vector[:, 0] for vector in orbit.states(np.array([time_s])))
    momentum = np.cross(position, velocity)
    eccentricity = np.linalg.norm(np.cross(velocity, momentum) / MU_M3_S2 - position / np.linalg.norm(position))
    square = float(momentum @ momentum)
    perigee = square / (MU_M3_S2 * (1.0 + float(eccentricity)))
    longest = 2.0 * math.pi * perigee**2 / math.sqrt(square) / _STEPS_PER_TURN
    return 60.0 * 2.0 ** math.floor(math.log2(longest / 60.0))


def coarse_times(span_s: Span, step_s: float) -> Floats:
    """Samples over the span, both ends among them, evenly, at most `step_s` apart and at least five.

    Raises `OrbitError` for a span that does not end after its start.
    """
    start, end = span_s
    if not (math.isfinite(start) and math.isfinite(end) and start < end):
        raise OrbitError(f"the span from {start:g} s to {end:g} s holds no time; give a start and a later end")
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
        """Sampled in its own coarse step, or in `step_s` where that is finer (that of a faster partner)."""
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

    Raises `OrbitError` for two terminals of one name, a span that is none, two orbits that meet, a terminal below the
    surface that the line of sight must clear, and what the orbits raise.
    """
    return contacts_with_each(first, (second,), earth, epoch, span_s)[0]


def contacts_with_each(
    satellite: Terminal,
    relays: Sequence[Terminal],
    earth: Earth,
    epoch: Epoch,
    span_s: Span,
    sampled: Sequence[Sampled] = (),
) -> tuple[tuple[Contact, ...], ...]:
    """`contacts` of a satellite with each of the relays, solved together.

    `sampled`, one for each relay, saves to compute their states anew for every satellite:
    ``Sampled.over(relay.orbit, span_s, coarse_step_s(satellite.orbit, span_s[0]))``; samples in another step are left
    aside. Limits that are not set cost nothing.

    Raises `OrbitError` as `contacts`.
    """
    _check_names(satellite, relays)
    own = coarse_step_s(satellite.orbit, span_s[0])
    others = tuple(sampled) or tuple(Sampled.over(relay.orbit, span_s, own) for relay in relays)
    time_s = coarse_times(span_s, min(own, *(other.step_s for other in others), math.inf))
    clear = _clear_of_earth(satellite.orbit, others, earth, time_s)
    found = []
    for relay, seen in zip(relays, clear, strict=True):
        conditions = [(EARTH, seen)]
        for one, other in ((satellite, relay), (relay, satellite)):
            conditions.extend(_conditions(_Side(one, other, earth, epoch), time_s))
        found.append(_combined(conditions, span_s))
    return tuple(found)


def _check_names(satellite: Terminal, relays: Sequence[Terminal]) -> None:
    for relay in relays:
        if relay.name == satellite.name:
            raise OrbitError(f'two terminals are called "{relay.name}"; give each a name of its own')


def _clear_of_earth(orbit: Orbit, others: Sequence[Sampled], earth: Earth, time_s: Floats) -> tuple[Intervals, ...]:
    """When the Earth is not in the way, for each of the others."""
    if not others:
        return ()

    def clearance(time: Floats, row: Rows) -> Floats:
        first = orbit.states(time).position_m
        second = np.empty_like(first)
        for index in np.unique(row):
            chosen = row == index
            second[:, chosen] = others[index].orbit.states(time[chosen]).position_m
        return earth.clearance_rad(first, second)

    first = orbit.states(time_s).position_m
    values = np.empty((len(others), time_s.size))
    for index, other in enumerate(others):
        try:
            values[index] = earth.clearance_rad(first, other.at(time_s).position_m)
        except OrbitError as error:
            raise OrbitError(f"{orbit.name} (first) and {other.orbit.name} (second): {error}") from None
    return positive_rows(clearance, time_s, values)


Condition = tuple[str, Intervals]


def _combined(conditions: Sequence[Condition], span_s: Span) -> tuple[Contact, ...]:
    """The contacts in which all conditions hold."""
    both = intersection(*(intervals for _, intervals in conditions))
    return tuple(
        Contact(
            float(start),
            float(end),
            START if start == span_s[0] else _causes(conditions, start, 0),
            END if end == span_s[1] else _causes(conditions, end, 1),
        )
        for start, end in both
    )


def _causes(conditions: Sequence[Condition], time_s: float, edge: int) -> str:
    return " and ".join(sorted(cause for cause, intervals in conditions if np.any(intervals[:, edge] == time_s)))


# ----------------------------------------------------------------------------------------------- limits of one terminal
class _Look(NamedTuple):
    """A terminal looking at its partner."""

    own: States
    direction: Floats
    rate_rad_s: Floats
    sun: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """One terminal of a pair: functions of time that are positive while a limit of its own is kept.

    Cosines and squares take the place of angles and rates: they have no kink where those are 0.
    """

    terminal: Terminal
    partner: Terminal
    earth: Earth
    epoch: Epoch

    def look(self, time_s: Floats) -> _Look:
        """Directions and rates, in TEME."""
        own, other = self.terminal.orbit.states(time_s), self.partner.orbit.states(time_s)
        apart, speed = other.position_m - own.position_m, other.velocity_m_s - own.velocity_m_s
        square = dot(apart, apart)
        if not np.all(square > 0.0):
            where = f"{time_s[np.argmin(square)]:g} s"
            names = " and ".join(sorted((self.terminal.name, self.partner.name)))
            raise OrbitError(f"{names} are at the same place at {where}; give two different orbits")
        sun = sun_direction(self.epoch, time_s)
        return _Look(own, apart / np.sqrt(square), cross(apart, speed) / square, sun)

    def in_body(self, time_s: Floats) -> Floats:
        """The direction to the partner in the body; in TEME when the body is free."""
        look, attitude = self.look(time_s), self.terminal.limits.attitude
        if attitude == "free":
            return look.direction
        return in_body(body_axes(attitude, look.own, look.sun), look.direction)

    def field_of_regard(self, time_s: Floats) -> Floats:
        """Cosine of the angle off the boresight, above that of the half angle."""
        limits = self.terminal.limits
        boresight = np.array(limits.boresight) / math.hypot(*limits.boresight)
        return np.asarray(dot(boresight, self.in_body(time_s)) - math.cos(limits.field_of_regard_rad))

    def slew(self, time_s: Floats) -> Floats:
        """One less the square of the rate of the line of sight in the body, in units of the limit."""
        look, limits = self.look(time_s), self.terminal.limits
        rate = look.rate_rad_s - body_rate_rad_s(limits.attitude, look.own, look.sun)
        across = cross(rate, look.direction)
        return np.asarray(1.0 - dot(across, across) / limits.slew_limit_rad_s**2)

    def off_sun(self, time_s: Floats) -> Floats:
        """Cosine of the exclusion angle, above that of the angle between partner and Sun."""
        look = self.look(time_s)
        return np.asarray(math.cos(self.terminal.limits.sun_exclusion_rad) - dot(look.direction, look.sun))

    def shadow(self, time_s: Floats) -> Floats:
        """Depth in the umbra."""
        position = self.terminal.orbit.states(time_s).position_m
        return shadow_rad(position, sun_direction(self.epoch, time_s), self.earth.shape)


def _conditions(side: _Side, time_s: Floats) -> Iterator[Condition]:
    """The limits that the terminal of this side has, each with the intervals in which it is kept."""
    limits, name = side.terminal.limits, side.terminal.name
    aims: list[tuple[str, Function]] = []
    if limits.field_of_regard_rad < math.pi:
        aims.append((f"field of regard of {name}", side.field_of_regard))
    if limits.slew_limit_rad_s < math.inf:
        aims.append((f"slew limit of {name}", side.slew))
    if aims or limits.sun_exclusion_rad > 0.0:
        time_s = refined(lambda time: side.in_body(time)[None], time_s, _TURN_RAD)
    for cause, function in aims:
        yield cause, positive(function, time_s)
    if limits.sun_exclusion_rad == 0.0 and limits.in_eclipse:
        return
    night = positive(side.shadow, time_s)
    if limits.sun_exclusion_rad > 0.0:
        yield f"Sun near the line of sight of {name}", union(positive(side.off_sun, time_s), night)
    if not limits.in_eclipse:
        yield f"eclipse of {name}", complement(night, (time_s[0], time_s[-1]))


# --------------------------------------------------------------------------------------------------------------- passes
def passes(orbit: Orbit, station: Station, epoch: Epoch, span_s: Span) -> tuple[Pass, ...]:
    """The passes of a satellite over a ground station in the span: its elevation, geometric, is above the mask.

    Raises `OrbitError` for a span that is none, and what the orbit raises.
    """
    step = coarse_step_s(orbit, span_s[0])
    time_s = coarse_times(span_s, step)
    mask = f"elevation mask of {station.name}"

    def elevation(time: Floats) -> Floats:
        return elevation_rad(station, epoch, time, orbit.states(time).position_m)

    windows = positive(lambda time: elevation(time) - station.mask_rad, time_s)
    return tuple(
        Pass(
            float(start),
            float(end),
            START if start == span_s[0] else mask,
            END if end == span_s[1] else mask,
            float(highest),
            float(when),
        )
        for (start, end), when, highest in zip(windows, *largest(elevation, windows, step), strict=True)
    )
