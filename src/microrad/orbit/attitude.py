"""How the body that carries a terminal is held: the directions of its axes, and how fast it turns."""

from typing import Literal

import numpy as np

from microrad.orbit.base import Floats, States
from microrad.orbit.earth import gravity
from microrad.orbit.line_of_sight import cross, dot

Attitude = Literal["nadir", "sun", "free"]
"""nadir: z to the centre of the Earth, y opposite to the orbit normal, x completing them, along the flight.

sun: x towards the Sun, z as near to nadir as that allows. free: the body turns its boresight onto the partner.
"""

_TINY = 1e-300  # keeps a division finite in the instant in which Sun and nadir are in one line


def body_axes(attitude: Literal["nadir", "sun"], states: States, sun: Floats) -> Floats:
    """The axes x, y and z of the body as unit vectors in TEME: shape (3 axes, 3 components, n).

    `sun` holds the unit vectors towards the Sun, (3, n).
    """
    if attitude == "nadir":
        y, z = -_unit(_momentum(states)), -_unit(states.position_m)
        return np.stack((cross(y, z), y, z))
    z, _ = _towards_nadir(states, sun)
    return np.stack((sun, cross(z, sun), z))


def body_rate_rad_s(attitude: Attitude, states: States, sun: Floats) -> Floats:
    """Angular velocity of the body against the stars, (3, n) in TEME; 0 for "free", whose turning is the pointing.

    nadir: h / r^2 about the orbit normal, and r a_n / h about the radius, a_n the part of gravity (with J2) along the
    normal. sun: about the Sun's direction, which is taken to stand still (it moves by 0.2 urad/s).
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


def in_body(axes: Floats, direction: Floats) -> Floats:
    """Components of directions (3, n) along the axes of the body."""
    return np.stack([dot(axis, direction) for axis in axes])


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
