"""Frames of ephemerides turned into TEME: the Earth-fixed ITRF, the inertial EME2000, GCRF and ICRF, and TOD.

Precession and nutation are those of skyfield; polar motion is neglected.
"""

import math
import re

import numpy as np

from microrad.core.arrays import Floats
from microrad.orbit.base import States
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.earth.figure import ROTATION_RAD_S

FRAMES = re.compile(r"TEME|TOD|EME2000|GCRF\d*|ICRF\d*|ITRF-?\d*")
"""Names of the frames that are read, as `frame_name` gives them."""

_KNOT_S = 10800.0  # between two rotations of a frame; nutation changes over days
_KNOTS_AT_ONCE = 2048  # bounds the memory that the series of nutation takes
_ALIASES = {"TEMEOFDATE": "TEME", "J2000": "EME2000", "TOD_EARTH": "TOD"}


def frame_name(text: str) -> str:
    """The name of a frame in capitals without spaces, other names for the same frame replaced."""
    name = text.upper().replace(" ", "")
    return _ALIASES.get(name, name)


def to_teme(frame: str, epoch: Epoch, time: Floats, values: Floats) -> States:
    """States turned into TEME; the velocity is the rate of the coordinates there.

    Args:
        frame: The frame in which they are given, one of `FRAMES`.
        epoch: Instant from which the times count.
        time: Times after the epoch, s, rising, shape (n,).
        values: Position in m, then velocity in m/s, shape (6, n).

    Raises:
        OrbitError: For a time outside the tables of `Epoch`, in a frame that turns with the Earth.
    """
    position, velocity = values[:3], values[3:]
    if frame == "TEME":
        return States(position, velocity)
    if frame.startswith("ITRF"):
        return _from_earth_fixed(epoch.earth_rotation_rad(time), position, velocity)
    matrix, rate = _rotations(frame, epoch, time)
    turn = "nij,jn->in"
    moved = np.einsum(turn, matrix, velocity) + np.einsum(turn, rate, position)
    return States(np.einsum(turn, matrix, position), moved)


def _from_earth_fixed(angle: Floats, position: Floats, velocity: Floats) -> States:
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = position
    vx, vy, vz = velocity[0] - ROTATION_RAD_S * y, velocity[1] + ROTATION_RAD_S * x, velocity[2]
    return States(np.array([c * x - s * y, s * x + c * y, z]), np.array([c * vx - s * vy, s * vx + c * vy, vz]))


def _rotations(frame: str, epoch: Epoch, time: Floats) -> tuple[Floats, Floats]:
    """Matrices from `frame` to TEME and their rates, each of shape (n, 3, 3), by splines between knots."""
    from scipy.interpolate import CubicSpline
    from skyfield.api import load

    first, last = float(time[0]), float(time[-1])
    knots = np.linspace(first, last, max(4, math.ceil((last - first) / _KNOT_S) + 1))
    scale = load.timescale(builtin=True)
    days = 2451545.0 + 36525.0 * epoch.terrestrial_centuries(knots)
    parts = [
        _matrices(frame, scale.tt_jd(part)) for part in np.array_split(days, math.ceil(days.size / _KNOTS_AT_ONCE))
    ]
    spline = CubicSpline(knots, np.concatenate(parts))
    return spline(time), spline(time, 1)


def _matrices(frame: str, instants: object) -> Floats:
    """From `frame` to TEME at instants of skyfield; shape (n, 3, 3)."""
    from skyfield.framelib import ICRS_to_J2000, true_equator_and_equinox_of_date
    from skyfield.sgp4lib import TEME

    from_gcrf = np.moveaxis(TEME.rotation_at(instants), -1, 0)
    if frame == "EME2000":
        turned: Floats = from_gcrf @ ICRS_to_J2000.T
    elif frame == "TOD":
        turned = from_gcrf @ np.moveaxis(true_equator_and_equinox_of_date.rotation_at(instants), -1, 0).swapaxes(1, 2)
    else:
        turned = from_gcrf
    return turned
