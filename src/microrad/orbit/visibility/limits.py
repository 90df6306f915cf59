"""What a terminal can point at beside what the Earth hides: attitude, field of regard, slew limit, Sun, eclipse."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple, get_args

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import format_quantity
from microrad.mission.fields import Quantity, Share
from microrad.orbit.base import Bounded, Orbit, OrbitError, States
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.earth.figure import Earth, gravity
from microrad.orbit.earth.sun import shadow_rad, sun_direction
from microrad.orbit.visibility.events import Function, Intervals, complement, positive, refined, union
from microrad.orbit.visibility.line_of_sight import cross, dot

Attitude = Literal["nadir", "sun", "free"]
"""nadir: z to the centre of the Earth, y opposite to the orbit normal, x completing them, along the flight.

sun: x towards the Sun, z as near to nadir as that allows. free: the body turns its boresight onto the partner.
"""

_TINY = 1e-300  # keeps a division finite in the instant in which Sun and nadir are in one line

Condition = tuple[str, Intervals]
"""What can stand in the way, and when it does not."""

_TURN_RAD = 0.1  # by which the line of sight may turn in the body from one sample to the next


@dataclass(frozen=True, slots=True)
class Limits(Bounded):
    """What a terminal can point at, beside what the Earth hides.

    `boresight` is fixed in the body, along the axes of `Attitude`, of any length. The line of sight is at most
    `field_of_regard_rad` (pi: no limit) away from it. `slew_limit_rad_s` (infinite: none) bounds the rate of the line
    of sight in the body, with the attitude "free" that against the stars. Within `sun_exclusion_rad` (0: none) of the
    Sun nothing is received, unless the Sun is behind the Earth. `in_eclipse` is whether the terminal works in the
    umbra.

    Raises OrbitError for an unknown attitude, a boresight without direction, an angle or rate out of range, and a
    field of regard with the attitude "free", where the body turns and it means nothing.
    """

    attitude: Attitude
    boresight: tuple[float, ...]
    field_of_regard_rad: Annotated[float, Quantity("rad", "deg", above=0.0, most=math.pi), "it is a half angle"]
    slew_limit_rad_s: float
    sun_exclusion_rad: Annotated[float, Share("rad", "deg", least=0.0, below=math.pi)]
    in_eclipse: bool

    def __post_init__(self) -> None:
        """Raises OrbitError if a limit is out of range or means nothing."""
        if self.attitude not in get_args(Attitude):
            raise OrbitError(f"the attitude {self.attitude!r} is not known; write nadir, sun or free")
        size = math.hypot(*self.boresight)
        if len(self.boresight) != 3 or not (math.isfinite(size) and size > 0.0):
            raise OrbitError(f"the boresight {self.boresight} has no direction; give three numbers, such as (0, 0, 1)")
        Bounded.__post_init__(self)
        if not self.slew_limit_rad_s > 0.0:  # it may be infinite
            raise OrbitError(f"a slew limit of {format_quantity(self.slew_limit_rad_s, 'rad/s')} is not above 0")
        if self.attitude == "free" and self.field_of_regard_rad < math.pi:
            raise OrbitError(
                'a field of regard means nothing with the attitude "free": the body turns its boresight onto the '
                'partner; leave it out, or hold the body "nadir" or "sun"'
            )


UNLIMITED = Limits("free", (0.0, 0.0, 1.0), math.pi, math.inf, 0.0, True)
"""Only the Earth stands in the way."""


@dataclass(frozen=True, slots=True)
class Terminal:
    """A terminal on an orbit; the causes of its contacts name it by `name`."""

    orbit: Orbit
    limits: Limits
    name: str


class _Look(NamedTuple):
    """A terminal looking at its partner."""

    own: States
    direction: Floats
    rate_rad_s: Floats
    sun: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One terminal of a pair: functions of time that are positive while a limit of its own is kept.

    Cosines and squares take the place of angles and rates: they have no kink where those are 0.
    """

    terminal: Terminal
    partner: Terminal
    earth: Earth
    epoch: Epoch

    def look(self, time_s: Floats) -> _Look:
        """Directions and rates, in TEME.

        Args:
            time_s: Times since the epoch, s, shape (times,).

        Raises:
            OrbitError: Both terminals are at the same place at one of them.
        """
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
        return np.stack([dot(axis, look.direction) for axis in body_axes(attitude, look.own, look.sun)])

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


def conditions(side: Side, time_s: Floats) -> Iterator[Condition]:
    """The limits that the terminal of this side has, each with the intervals in which it is kept.

    Args:
        side: The terminal and its partner.
        time_s: Coarse samples of the span, s, rising, shape (n,); they are made finer where the line of sight turns
            fast.

    Raises:
        OrbitError: Where the two are at the same place, or an orbit does not hold.
    """
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


# ------------------------------------------------------------------------------------------------------------- attitude
def body_axes(attitude: Literal["nadir", "sun"], states: States, sun: Floats) -> Floats:
    """The axes x, y and z of the body as unit vectors in TEME: shape (3 axes, 3 components, n).

    Args:
        attitude: How the body is held.
        states: Position and velocity of the satellite.
        sun: Unit vectors towards the Sun, shape (3, n).
    """
    if attitude == "nadir":
        y, z = -_unit(_momentum(states)), -_unit(states.position_m)
        return np.stack((cross(y, z), y, z))
    z, _ = _towards_nadir(states, sun)
    return np.stack((sun, cross(z, sun), z))


def body_rate_rad_s(attitude: Attitude, states: States, sun: Floats) -> Floats:
    """Angular velocity of the body against the stars, rad/s, shape (3, n) in TEME.

    nadir: h / r^2 about the orbit normal, and r a_n / h about the radius, a_n the part of gravity (with J2) along the
    normal. sun: about the Sun's direction, which is taken to stand still (it moves by 0.2 urad/s). free: 0, as the
    body's turning is the pointing.

    Args:
        attitude: How the body is held.
        states: Position and velocity of the satellite.
        sun: Unit vectors towards the Sun, shape (3, n).
    """
    position, velocity = states
    if attitude == "free":
        return np.zeros_like(position)
    if attitude == "nadir":
        momentum = _momentum(states)
        size, square = np.sqrt(dot(momentum, momentum)), dot(position, position)
        normal = momentum / size
        lift = dot(gravity(position, True), normal)
        return np.asarray(size / square * normal + lift / size * position)
    z, share = _towards_nadir(states, sun)
    up = _unit(position)
    sink = -(velocity - dot(up, velocity) * up) / np.sqrt(dot(position, position))
    return np.asarray(-dot(sink, cross(z, sun)) / share * sun)


def _towards_nadir(states: States, sun: Floats) -> tuple[Floats, Floats]:
    """The unit vector nearest to nadir across the Sun's direction, and the sine of the angle between those two."""
    down = -_unit(states.position_m)
    across = down - dot(down, sun) * sun
    size = np.maximum(np.sqrt(dot(across, across)), _TINY)
    return across / size, size


def _momentum(states: States) -> Floats:
    return cross(states.position_m, states.velocity_m_s)


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.sqrt(dot(vector, vector)))
