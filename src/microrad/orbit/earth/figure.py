"""The Earth: its figure (WGS84), its gravity, what stands in the way of a line of sight, and stations on the ground."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple, get_args

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.earth import EARTH_RADIUS_M, FLATTENING, MU_M3_S2, ROTATION_RAD_S, place_m
from microrad.mission.fields import Quantity, Share
from microrad.orbit.base import Bounded, OrbitError, States
from microrad.orbit.earth.epoch import Epoch

J2 = 1.08262668355e-3
"""Unnormalised second zonal harmonic (EGM96)."""

Shape = Literal["oblate", "sphere"]
"""Figure of the Earth: the ellipsoid of WGS84, or a sphere of its equatorial radius."""


class Subpoint(NamedTuple):
    """Where a satellite stands over the Earth: geodetic (WGS84) latitude, longitude in [-pi, pi), height."""

    latitude_rad: Floats
    longitude_rad: Floats
    height_m: Floats


def semi_axes_m(shape: Shape, height_m: float = 0.0) -> tuple[float, float]:
    """Equatorial and polar semi-axis of a figure of the Earth, m, both made longer by a height.

    Args:
        shape: The figure.
        height_m: What is added to both semi-axes, m.

    Raises:
        OrbitError: For another shape.
    """
    if shape not in get_args(Shape):
        raise OrbitError(f"the shape of the Earth {shape!r} is not known; write oblate or sphere")
    polar = EARTH_RADIUS_M * (1.0 - FLATTENING) if shape == "oblate" else EARTH_RADIUS_M
    return EARTH_RADIUS_M + height_m, polar + height_m


@dataclass(frozen=True, slots=True)
class Earth(Bounded):
    """The surface that a line of sight must clear: the figure of the Earth, raised by the grazing height.

    Raised means that both semi-axes are longer by `grazing_height_m`. For the sphere that is the surface of this
    height. For the oblate Earth it lies below the surface of this geodetic height, by at most 1.4 millionths of the
    grazing height (14 cm for 100 km).

    Raises OrbitError for another shape, and for a grazing height below 0 or above 1000 km.
    """

    shape: Shape
    grazing_height_m: Annotated[
        float, Quantity("m", "km", least=0.0, most=1e6), "it is the height below which the air is not to be crossed"
    ]

    def __post_init__(self) -> None:
        """Raises OrbitError if the shape is unknown or the height out of range."""
        semi_axes_m(self.shape)
        Bounded.__post_init__(self)

    def height_m(self, position_m: Floats) -> Floats:
        """Height of positions of shape (3, n) over the figure itself: geodetic over the oblate Earth."""
        if self.shape == "oblate":
            return subpoint(position_m, np.zeros(())).height_m
        return np.sqrt(_square(np.asarray(position_m, dtype=np.float64))) - EARTH_RADIUS_M

    def clearance_rad(self, first_m: Floats, second_m: Floats) -> Floats:
        """Angle by which the line of sight between two terminals clears the surface, shape (n,): above 0 it is free.

        In coordinates in which the surface is the unit sphere it is acos(1/|r1|) + acos(1/|r2|) less the angle between
        r1 and r2: by how much further the two could stand apart, seen from the centre. Straight lines and tangents stay
        such in those coordinates. The result is smooth in the positions and is the same to the last bit when the two
        are swapped.

        Args:
            first_m: Positions of one terminal, m, shape (3, n).
            second_m: Those of the other one at the same times, likewise.

        Raises:
            OrbitError: For a terminal below the surface, or a position that is not a number.
        """
        first, second = self._scaled(first_m, "first"), self._scaled(second_m, "second")
        cross_x = first[1] * second[2] - first[2] * second[1]
        cross_y = first[2] * second[0] - first[0] * second[2]
        cross_z = first[0] * second[1] - first[1] * second[0]
        cross = np.sqrt((cross_x * cross_x + cross_y * cross_y) + cross_z * cross_z)
        # products and sums written out: a library's dot product may round differently when the two are swapped
        dot = (first[0] * second[0] + first[1] * second[1]) + first[2] * second[2]
        horizons = _horizon_rad(first) + _horizon_rad(second)
        return np.asarray(horizons - np.arctan2(cross, dot))

    def _scaled(self, position_m: Floats, which: str) -> Floats:
        """The position in units of the raised semi-axes; raises OrbitError below the surface."""
        scaled = to_unit_sphere(position_m, *semi_axes_m(self.shape, self.grazing_height_m))
        square = np.atleast_1d(_square(scaled))
        worst = int(np.argmin(square)) if square.size else 0
        if square.size and not square[worst] >= 1.0:  # argmin finds nan first
            depth_m = (1.0 - math.sqrt(square[worst])) * EARTH_RADIUS_M
            raise OrbitError(
                f"the {which} terminal (sample {worst}) is {depth_m / 1e3:.6g} km below the surface that lines of "
                f"sight must clear, {self.grazing_height_m / 1e3:.6g} km over the Earth; lower the grazing height or "
                "raise the orbit"
            )
        return scaled


def to_unit_sphere(position_m: Floats, equatorial_m: float, polar_m: float) -> Floats:
    """Positions in coordinates in which an ellipsoid of revolution is the unit sphere, shape (3, n).

    Args:
        position_m: Positions or other vectors in TEME, m, shape (3, n).
        equatorial_m: Equatorial semi-axis of the ellipsoid, m.
        polar_m: Its polar semi-axis, m.
    """
    position = np.asarray(position_m, dtype=np.float64)
    return np.stack((position[0] / equatorial_m, position[1] / equatorial_m, position[2] / polar_m))


def _square(vector: Floats) -> Floats:
    """Square of the length of each vector."""
    return np.asarray((vector[0] * vector[0] + vector[1] * vector[1]) + vector[2] * vector[2])


def _horizon_rad(scaled: Floats) -> Floats:
    """acos(1/r), the angle at the centre of the unit sphere from a point to its horizon."""
    return np.arctan(np.sqrt(_square(scaled) - 1.0))


def gravity(position_m: Floats, j2: bool) -> Floats:
    """Acceleration of gravity in TEME, m/s^2, shape (3, n): that of a point mass, with or without the flattening.

    Source: Vallado, Fundamentals of Astrodynamics, chapter 8 (J2 alone).

    Args:
        position_m: Positions in TEME, m, shape (3, n).
        j2: Whether the flattening is in it.
    """
    position = np.asarray(position_m, dtype=np.float64)
    square = _square(position)
    central = -MU_M3_S2 / (square * np.sqrt(square))
    if not j2:
        return central * position
    oblate = 1.5 * J2 * EARTH_RADIUS_M**2 / square
    sine_square = position[2] * position[2] / square
    equatorial = 1.0 + oblate * (1.0 - 5.0 * sine_square)
    factor = np.stack((equatorial, equatorial, equatorial + 2.0 * oblate))
    return np.asarray(central * factor * position)


def subpoint(position_m: Floats, rotation_rad: Floats) -> Subpoint:
    """Geodetic (WGS84) latitude, longitude in [-pi, pi) and height of positions in TEME.

    Two rounds of Bowring's iteration (Survey Review 23, 1976) leave less than 1e-12 rad and a micrometre from the
    surface outwards.

    Args:
        position_m: Positions in TEME, m, shape (3, n).
        rotation_rad: Angle of the Earth at the same times, `Epoch.earth_rotation_rad`, shape (n,).
    """
    x, y, z = np.asarray(position_m, dtype=np.float64)
    cosine, sine = np.cos(rotation_rad), np.sin(rotation_rad)
    longitude = np.arctan2(cosine * y - sine * x, cosine * x + sine * y)
    polar = EARTH_RADIUS_M * (1.0 - FLATTENING)
    square = FLATTENING * (2.0 - FLATTENING)
    radius = np.hypot(x, y)
    reduced = np.arctan2(z, (1.0 - FLATTENING) * radius)
    for _ in range(2):
        sine, cosine = np.sin(reduced), np.cos(reduced)
        rise = z + square / (1.0 - square) * polar * (sine * sine * sine)
        run = radius - square * EARTH_RADIUS_M * (cosine * cosine * cosine)
        reduced = np.arctan2((1.0 - FLATTENING) * rise, run)
    latitude = np.arctan2(rise, run)
    sine = np.sin(latitude)
    height = radius * np.cos(latitude) + z * sine - EARTH_RADIUS_M * np.sqrt(1.0 - square * sine * sine)
    return Subpoint(latitude, np.where(longitude >= math.pi, -math.pi, longitude), height)


# --------------------------------------------------------------------------------------------------------------- ground
@dataclass(frozen=True, slots=True)
class Station(Bounded):
    """A place fixed to the Earth: geodetic latitude (north positive), longitude (east positive), height (WGS84).

    `mask_rad` is the elevation below which nothing is received. Raises OrbitError for a latitude beyond the poles, a
    longitude beyond a full turn, a height outside -1 to 50 km, a mask outside [0, 90) deg.
    """

    name: str
    latitude_rad: Annotated[float, Quantity("rad", "deg", least=-math.pi / 2, most=math.pi / 2)]
    longitude_rad: Annotated[float, Quantity("rad", "deg", least=-2.0 * math.pi, most=2.0 * math.pi)]
    height_m: Annotated[float, Quantity("m", least=-1e3, most=5e4), "it is the height over the ellipsoid"]
    mask_rad: Annotated[float, Share("rad", "deg", least=0.0, below=math.pi / 2)]

    def position(self, epoch: Epoch, time_s: Floats) -> States:
        """Position and velocity of the station in TEME; it turns with the Earth.

        Args:
            epoch: Instant from which the times count.
            time_s: Times after the epoch, s, shape (n,).

        Raises:
            OrbitError: For a time outside the tables of `Epoch`.
        """
        across, z = place_m(self.latitude_rad, self.height_m)
        angle = epoch.earth_rotation_rad(time_s) + self.longitude_rad
        x, y = across * np.cos(angle), across * np.sin(angle)
        velocity = np.stack((-ROTATION_RAD_S * y, ROTATION_RAD_S * x, np.zeros_like(x)))
        return States(np.stack((x, y, np.full_like(x, z))), velocity)

    def vertical(self, epoch: Epoch, time_s: Floats) -> Floats:
        """Unit vectors in TEME upwards from the station, along the normal of the ellipsoid, shape (3, n).

        Args:
            epoch: Instant from which the times count.
            time_s: Times after the epoch, s, shape (n,).

        Raises:
            OrbitError: For a time outside the tables of `Epoch`.
        """
        angle = epoch.earth_rotation_rad(time_s) + self.longitude_rad
        level, rise = math.cos(self.latitude_rad), math.sin(self.latitude_rad)
        return np.stack((level * np.cos(angle), level * np.sin(angle), np.full_like(angle, rise)))


@dataclass(frozen=True, slots=True)
class GroundSite:
    """A station as one end of a link: it moves as the Earth turns. Times count from ``epoch``."""

    station: Station
    epoch: Epoch

    @property
    def name(self) -> str:
        """What the station is called in tables and messages."""
        return self.station.name

    def states(self, time_s: Floats) -> States:
        """Position and velocity in TEME, see `Station.position`."""
        return self.station.position(self.epoch, np.asarray(time_s, dtype=np.float64))

    def above_mask(self, time_s: Floats, satellite_m: Floats) -> Floats:
        """Elevation of a satellite less that of the mask, rad, shape (n,).

        Args:
            time_s: Times after the epoch, s, shape (n,).
            satellite_m: Positions of the satellite in TEME at these times, m, shape (3, n).
        """
        return elevation_rad(self.station, self.epoch, time_s, satellite_m) - self.station.mask_rad


def elevation_rad(station: Station, epoch: Epoch, time_s: Floats, position_m: Floats) -> Floats:
    """Elevation of positions over a station's horizon, rad, shape (n,); negative below it.

    It is geometric: the angle over the plane across the ellipsoid's normal, without refraction (which lifts a satellite
    by 0.5 deg at the horizon, 0.1 deg at an elevation of 9 deg).

    Args:
        station: The station.
        epoch: Instant from which the times count.
        time_s: Times after the epoch, s, shape (n,).
        position_m: Positions in TEME at these times, m, shape (3, n).

    Raises:
        OrbitError: For a time outside the tables of `Epoch`.
    """
    line = np.asarray(position_m, dtype=np.float64) - station.position(epoch, time_s).position_m
    up = station.vertical(epoch, time_s)
    rise = np.sum(line * up, axis=0)
    level = line - rise * up
    return np.asarray(np.arctan2(rise, np.sqrt(np.sum(level * level, axis=0))))
