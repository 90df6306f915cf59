"""Where the Sun stands, and when it is behind the Earth."""

import math

import numpy as np

from microrad.core.arrays import Floats
from microrad.orbit.base import OrbitError
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.earth.figure import Shape, semi_axes_m, to_unit_sphere

ASTRONOMICAL_UNIT_M = 149_597_870_700.0
"""Mean distance of the Sun, exact by definition (IAU 2012 B2)."""
SUN_RADIUS_M = 6.957e8
"""Nominal radius of the Sun (IAU 2015 B3)."""


def sun_direction(epoch: Epoch, time_s: Floats) -> Floats:
    """Unit vectors in TEME from the centre of the Earth to the apparent Sun, shape (3, n).

    Within 0.02 deg from 1973 to 2050. Source: the low-precision formulas of the Astronomical Almanac, section C; their
    longitude counts from the mean equinox of date, and aberration is in it.

    Args:
        epoch: Instant from which the times count.
        time_s: Times after the epoch, s, shape (n,).
    """
    day = 36525.0 * epoch.terrestrial_centuries(time_s)
    mean_longitude = np.radians(280.460 + 0.9856474 * day)
    anomaly = np.radians(357.528 + 0.9856003 * day)
    longitude = mean_longitude + np.radians(1.915 * np.sin(anomaly) + 0.020 * np.sin(2.0 * anomaly))
    obliquity = np.radians(23.439 - 0.0000004 * day)
    sine = np.sin(longitude)
    return np.stack((np.cos(longitude), np.cos(obliquity) * sine, np.sin(obliquity) * sine))


def shadow_rad(position_m: Floats, sun_direction: Floats, shape: Shape) -> Floats:
    """Depth of positions in the umbra of the Earth, rad, shape (n,): above 0 it is night.

    In coordinates in which the Earth (no air) is the unit sphere it is the angular radius of the Earth less that of the
    Sun less the angle between their centres, all seen from the satellite: above 0 the whole disc of the Sun is hidden.
    It is smooth but on the axis of the shadow, where it is largest. The Sun is taken at its mean distance: its radius
    is then off by up to 1.7 % (80 urad) in January and July, for the oblate Earth by up to 16 urad more. That moves the
    limits of an eclipse by about 0.1 s in a low orbit and by 1.3 s in the geostationary one. Light bent by the air is
    left out.

    Args:
        position_m: Positions in TEME, m, shape (3, n).
        sun_direction: Unit vectors to the Sun at the same times, shape (3, n).
        shape: Figure of the Earth.

    Raises:
        OrbitError: For a position inside the Earth, and for another shape.
    """
    position = np.asarray(position_m, dtype=np.float64)
    to_sun = ASTRONOMICAL_UNIT_M * sun_direction - position
    axes = semi_axes_m(shape)
    place, light = to_unit_sphere(position, *axes), to_unit_sphere(to_sun, *axes)
    square = np.sum(place * place, axis=0)
    if not np.all(square >= 1.0):
        worst = int(np.argmin(square))
        raise OrbitError(
            f"sample {worst} is at {math.sqrt(np.ravel(square)[worst]):.6g} Earth radii, inside the Earth, where there "
            "is no day or night; check the orbit"
        )
    earth = np.arctan2(1.0, np.sqrt(square - 1.0))
    sun = np.arcsin(SUN_RADIUS_M / np.sqrt(np.sum(to_sun * to_sun, axis=0)))
    across = np.cross(place, light, axis=0)
    apart = np.arctan2(np.sqrt(np.sum(across * across, axis=0)), -np.sum(place * light, axis=0))
    return np.asarray(earth - sun - apart)
