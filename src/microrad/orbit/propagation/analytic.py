"""Orbits that a formula gives: Kepler's ellipse, with the secular drifts by the flattening; a geostationary slot."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.earth import EARTH_RADIUS_M, GEOSTATIONARY_RADIUS_M, MU_M3_S2, ROTATION_RAD_S
from microrad.core.units import format_beyond, format_limit
from microrad.mission.fields import Quantity, Share
from microrad.orbit.base import Bounded, OrbitError, States
from microrad.orbit.earth.epoch import DAY_S, Epoch
from microrad.orbit.earth.figure import J2

LOWEST_PERIGEE_M = 120e3
"""Height over the equatorial radius below which the air ends an orbit within about one turn."""
TROPICAL_YEAR_S = 365.24219 * DAY_S
"""Time in which the mean Sun goes once round the equator from equinox to equinox."""


@dataclass(frozen=True, slots=True)
class KeplerOrbit(Bounded):
    """An ellipse about the Earth; its elements hold at `epoch`, from which the times of `states` count.

    `node_rad` is the right ascension of the ascending node, in TEME as all else. With `j2` the elements are mean ones:
    node, perigee and mean anomaly move at the constant rates that the flattening gives them in first order, and the
    periodic terms (up to about 10 km in a low orbit) are left out.

    Raises OrbitError for an orbit that is no ellipse, a perigee below 120 km over the equatorial radius, an
    inclination outside [0, 180] deg, an element that is not a number.
    """

    name: str
    epoch: Epoch
    semi_major_axis_m: Annotated[float, Quantity("m")]
    eccentricity: Annotated[float, Share("", least=0.0), "else the orbit is not closed"]
    inclination_rad: Annotated[
        float,
        Quantity("rad", "deg", least=0.0, most=math.pi),
        "an orbit against the rotation of the Earth has more than 90 deg",
    ]
    node_rad: Annotated[float, Quantity("rad")]
    argument_of_perigee_rad: Annotated[float, Quantity("rad")]
    mean_anomaly_rad: Annotated[float, Quantity("rad")]
    j2: bool

    def __post_init__(self) -> None:
        """Raises OrbitError if an element is out of range."""
        Bounded.__post_init__(self)
        height_m = self.semi_major_axis_m * (1.0 - self.eccentricity) - EARTH_RADIUS_M
        if height_m < LOWEST_PERIGEE_M:
            height = format_beyond(height_m, LOWEST_PERIGEE_M, "m", 6)
            raise OrbitError(
                f"orbit {self.name}: its perigee is {height} over the equator, below "
                f"{LOWEST_PERIGEE_M / 1e3:.0f} km: it has decayed; raise the altitude or the semi-major axis, or "
                "lower the eccentricity (a semi-major axis counts from the centre of the Earth)"
            )

    @property
    def mean_motion_rad_s(self) -> float:
        """Mean motion of the two-body orbit, sqrt(mu / a^3)."""
        return math.sqrt(MU_M3_S2 / self.semi_major_axis_m**3)

    def secular_rates_rad_s(self) -> tuple[float, float, float]:
        """Rates of node, argument of perigee and mean anomaly (its mean motion included).

        Source: Vallado, Fundamentals of Astrodynamics, chapter 9; first order in J2.
        """
        motion = self.mean_motion_rad_s
        if not self.j2:
            return 0.0, 0.0, motion
        round_part = 1.0 - self.eccentricity**2
        factor = 1.5 * J2 * (EARTH_RADIUS_M / (self.semi_major_axis_m * round_part)) ** 2 * motion
        sine_square = math.sin(self.inclination_rad) ** 2
        node = -factor * math.cos(self.inclination_rad)
        perigee = factor * (2.0 - 2.5 * sine_square)
        return node, perigee, motion + factor * math.sqrt(round_part) * (1.0 - 1.5 * sine_square)

    def states(self, time_s: Floats) -> States:
        """States at `time_s` after the epoch; the velocity is the derivative of the position, drifts included.

        Raises:
            OrbitError: For a time that is not a number.
        """
        time = np.asarray(time_s, dtype=np.float64)
        if not np.all(np.isfinite(time)):
            raise OrbitError(f"orbit {self.name}: a time is not a finite number of seconds; check the span")
        node_rate, perigee_rate, anomaly_rate = self.secular_rates_rad_s()
        anomaly = self.mean_anomaly_rad + anomaly_rate * time
        (x, y), (vx, vy) = self._in_plane(anomaly, anomaly_rate)
        perigee = self.argument_of_perigee_rad + perigee_rate * time if perigee_rate else self.argument_of_perigee_rad
        x, y, vx, vy = _turned(perigee, perigee_rate, x, y, vx, vy)
        cosine, sine = math.cos(self.inclination_rad), math.sin(self.inclination_rad)
        z, vz = sine * y, sine * vy
        node = self.node_rad + node_rate * time if node_rate else self.node_rad
        x, y, vx, vy = _turned(node, node_rate, x, cosine * y, vx, cosine * vy)
        return States(np.stack((x, y, z)), np.stack((vx, vy, vz)))

    def _in_plane(self, anomaly: Floats, rate: float) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
        """Position and velocity in the plane of the orbit, x towards the perigee."""
        eccentric = eccentric_anomaly_rad(anomaly, self.eccentricity)
        cosine, sine = np.cos(eccentric), np.sin(eccentric)
        major = self.semi_major_axis_m
        minor = major * math.sqrt((1.0 - self.eccentricity) * (1.0 + self.eccentricity))
        turn = rate / (1.0 - self.eccentricity * cosine)
        return (major * (cosine - self.eccentricity), minor * sine), (-major * sine * turn, minor * cosine * turn)


def eccentric_anomaly_rad(mean_anomaly_rad: Floats, eccentricity: float) -> Floats:
    """Eccentric anomaly E that solves Kepler's equation E - e sin E = M, for any M and 0 <= e < 1.

    Newton's method until no step is above 1e-14 rad. For M in [0, pi], where E - e sin E is convex, it starts from
    M + e, M / (1 - e) or pi, whichever is least: all are above the root, so every step goes down to it.

    Args:
        mean_anomaly_rad: Mean anomaly M, rad, of any shape and any size; it need not be within one turn.
        eccentricity: Eccentricity e, from 0 to below 1.
    """
    if eccentricity == 0.0:
        return np.array(mean_anomaly_rad, dtype=np.float64)
    turns = 2.0 * math.pi * np.round(np.asarray(mean_anomaly_rad) / (2.0 * math.pi))
    signed = mean_anomaly_rad - turns
    mean = np.abs(signed)
    guess = np.minimum(np.minimum(mean + eccentricity, mean / (1.0 - eccentricity)), np.pi)
    for _ in range(100):
        step = (guess - eccentricity * np.sin(guess) - mean) / (1.0 - eccentricity * np.cos(guess))
        guess = guess - step
        if np.max(np.abs(step), initial=0.0) <= 1e-14:
            break
    return turns + np.copysign(guess, signed)


def circular(
    name: str, epoch: Epoch, altitude_m: float, inclination_rad: float, node_rad: float, phase_rad: float, j2: bool
) -> KeplerOrbit:
    """A circular orbit from its altitude, plane and phase.

    Args:
        name: What it is called.
        epoch: Instant at which the elements hold and from which times count.
        altitude_m: Height over the equatorial radius, m.
        inclination_rad: Inclination, rad, from 0 to pi.
        node_rad: Right ascension of the ascending node in TEME, rad.
        phase_rad: Angle past the ascending node at the epoch, rad.
        j2: Whether the flattening turns node, perigee and mean anomaly.

    Raises:
        OrbitError: As `KeplerOrbit`.
    """
    return KeplerOrbit(name, epoch, EARTH_RADIUS_M + altitude_m, 0.0, inclination_rad, node_rad, 0.0, phase_rad, j2)


def sun_synchronous_inclination_rad(altitude_m: float, eccentricity: float = 0.0) -> float:
    """Inclination at which the flattening turns the node with the mean Sun, once in a tropical year.

    Args:
        altitude_m: Semi-major axis less the equatorial radius, m.
        eccentricity: Eccentricity, from 0 to below 1.

    Raises:
        OrbitError: Where no inclination does it (above 5974 km for a circular orbit), for an altitude not above
            the centre of the Earth, and for another eccentricity.
    """
    if not 0.0 <= eccentricity < 1.0:
        raise OrbitError(f"the eccentricity {eccentricity:.6g} is not from 0 to below 1; check the elements")
    axis_m = EARTH_RADIUS_M + altitude_m
    if not axis_m > 0.0:
        raise OrbitError(f"an altitude of {altitude_m / 1e3:.6g} km is not above the centre of the Earth; raise it")
    wanted = 2.0 * math.pi / TROPICAL_YEAR_S
    turned = 1.5 * J2 * EARTH_RADIUS_M**2 * math.sqrt(MU_M3_S2) / (1.0 - eccentricity**2) ** 2  # rad/s m^(7/2)
    cosine = -wanted / turned * axis_m**3.5
    if not cosine >= -1.0:
        most = format_limit((turned / wanted) ** (2.0 / 7.0) - EARTH_RADIUS_M, "m")
        raise OrbitError(
            f"no orbit {altitude_m / 1e3:.6g} km over the equator can be sun-synchronous: the flattening turns its "
            f"node too slowly; take an altitude of at most {most}"
        )
    return math.acos(cosine)


def node_of_local_time(epoch: Epoch, local_time_h: float) -> float:
    """Right ascension in [0, 2 pi) of the ascending node that has a given mean local time at an epoch.

    The mean local time of a place is UTC plus one hour for every 15 deg of its east longitude.

    Args:
        epoch: The instant.
        local_time_h: Mean local time of the node, h, from 0 to below 24.

    Raises:
        OrbitError: For hours outside [0, 24).
    """
    if not 0.0 <= local_time_h < 24.0:
        raise OrbitError(f"a local time of {local_time_h:.6g} h is not from 0 to below 24; give hours, such as 10.5")
    longitude = 2.0 * math.pi * (local_time_h / 24.0 - epoch.julian_date[1])
    return (longitude + float(epoch.earth_rotation_rad(np.asarray(0.0)))) % (2.0 * math.pi)


@dataclass(frozen=True, slots=True)
class GeostationarySlot(Bounded):
    """A satellite that stands over the equator at a longitude (east positive), fixed in the turning Earth.

    Times count from `epoch`. Raises OrbitError for a longitude beyond a full turn.
    """

    name: str
    epoch: Epoch
    longitude_rad: Annotated[float, Quantity("rad", "deg", least=-2.0 * math.pi, most=2.0 * math.pi)]

    def states(self, time_s: Floats) -> States:
        """States at `time_s` after the epoch.

        Raises:
            OrbitError: For a time outside the tables of `Epoch`.
        """
        angle = self.epoch.earth_rotation_rad(time_s) + self.longitude_rad
        x, y = GEOSTATIONARY_RADIUS_M * np.cos(angle), GEOSTATIONARY_RADIUS_M * np.sin(angle)
        zero = np.zeros_like(x)
        return States(np.stack((x, y, zero)), np.stack((-ROTATION_RAD_S * y, ROTATION_RAD_S * x, zero)))


def _turned(
    angle: Floats | float, rate: float, x: Floats, y: Floats, vx: Floats, vy: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """A vector and its derivative in axes turned by `angle`, which grows at `rate`."""
    cosine, sine = np.cos(angle), np.sin(angle)
    new_x, new_y = cosine * x - sine * y, sine * x + cosine * y
    new_vx, new_vy = cosine * vx - sine * vy, sine * vx + cosine * vy
    if not rate:
        return new_x, new_y, new_vx, new_vy
    return new_x, new_y, new_vx - rate * new_y, new_vy + rate * new_x
