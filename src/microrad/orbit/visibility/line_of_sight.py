"""The line of sight between two orbits over time: range, rates, point-ahead, Doppler shift."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.core.units import SPEED_OF_LIGHT_M_S, format_quantity
from microrad.orbit.base import Orbit, OrbitError
from microrad.orbit.earth.figure import gravity


@dataclass(frozen=True, slots=True, eq=False)
class LineOfSight:
    """From a first terminal to a second, both at the same instant: no light time. One entry for each of `time_s` (n,).

    `range_rate_m_s` is positive while they recede. `rate_rad_s` is the angular rate against the stars and
    `acceleration_rad_s2` the magnitude of its change, as a vector: both are what a pointing that follows must do beside
    the body's own motion. `transverse_velocity_m_s` is of one against the other across the line, `point_ahead_rad` the
    angle 2 v / c by which the beam has to lead the direction in which the partner is seen. `direction` (3, n) is the
    unit vector in TEME from the first to the second. Seen from the second, only the direction is another.
    """

    time_s: Floats
    range_m: Floats
    range_rate_m_s: Floats
    rate_rad_s: Floats
    acceleration_rad_s2: Floats
    transverse_velocity_m_s: Floats
    point_ahead_rad: Floats
    direction: Floats

    def doppler_hz(self, wavelength_m: float) -> Floats:
        """Frequency received less frequency sent, first order: -range rate / wavelength; positive on approach.

        The second order, (v/c)^2 / 2 of the carrier, is below 0.1 MHz at 1.55 µm for satellites of the Earth.

        Raises:
            OrbitError: For a wavelength not above 0.
        """
        if not wavelength_m > 0.0:
            raise OrbitError(f"a wavelength of {format_quantity(wavelength_m, 'm')} is none; give one above 0 m")
        return np.asarray(-self.range_rate_m_s / wavelength_m)


def sight(first: Orbit, second: Orbit, time_s: ArrayLike) -> LineOfSight:
    """The line of sight from `first` to `second` at the times (n,), whether or not the Earth stands in it.

    With the relative position p, velocity v and acceleration a, w = p x v / p^2 turns the line, and
    dw/dt = p x a / p^2 - 2 (p . v) / p^2 w. The acceleration is that of gravity with the flattening (J2); thrust, drag,
    Sun and Moon, together below a ten-thousandth of it, are left out. An orbit without the
    periodic terms of J2 (two bodies, or mean elements) has an acceleration of its own, up to 0.3 % off.

    Args:
        first: The orbit from which the line is seen.
        second: The orbit that it leads to.
        time_s: Times since the epoch of both, s, shape (n,).

    Raises:
        OrbitError: If both are at the same place, or an orbit does not hold at one of the times.
    """
    time = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
    one, other = first.states(time), second.states(time)
    apart, speed = other.position_m - one.position_m, other.velocity_m_s - one.velocity_m_s
    pull = gravity(other.position_m, True) - gravity(one.position_m, True)
    square = dot(apart, apart)
    if not np.all(square > 0.0):
        where = f"{time[np.argmin(square)]:g} s"
        raise OrbitError(f"{first.name} and {second.name} are at the same place at {where}; give two different orbits")
    closing = dot(apart, speed)
    turn = cross(apart, speed) / square
    change = cross(apart, pull) / square - 2.0 * closing / square * turn
    distance, rate = np.sqrt(square), np.sqrt(dot(turn, turn))
    across = rate * distance
    return LineOfSight(
        time_s=time,
        range_m=distance,
        range_rate_m_s=closing / distance,
        rate_rad_s=rate,
        acceleration_rad_s2=np.sqrt(dot(change, change)),
        transverse_velocity_m_s=across,
        point_ahead_rad=2.0 * across / SPEED_OF_LIGHT_M_S,
        direction=apart / distance,
    )


def dot(a: Floats, b: Floats) -> Floats:
    """Scalar product of vectors, shape (n,), in the same order of sums whichever comes first.

    Args:
        a: Vectors, shape (3, n).
        b: Vectors, shape (3, n).
    """
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def cross(a: Floats, b: Floats) -> Floats:
    """Vector product of vectors, shape (3, n); a third of the time of `numpy.cross`.

    Args:
        a: Left factors, shape (3, n).
        b: Right factors, shape (3, n).
    """
    return np.stack((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))
