"""A station on the ground, and how high a satellite stands over its horizon."""

import math
from dataclasses import dataclass

import numpy as np

from microrad.orbit.base import Floats, OrbitError, States
from microrad.orbit.earth import EARTH_RADIUS_M, FLATTENING, ROTATION_RAD_S
from microrad.orbit.epoch import Epoch


@dataclass(frozen=True, slots=True)
class Station:
    """A place fixed to the Earth: geodetic latitude (north positive), longitude (east positive), height (WGS84).

    `mask_rad` is the elevation below which nothing is received. Raises `OrbitError` for a latitude beyond the poles, a
    longitude beyond a full turn, a height outside -1 to 50 km, a mask outside [0, 90) deg.
    """

    name: str
    latitude_rad: float
    longitude_rad: float
    height_m: float
    mask_rad: float

    def __post_init__(self) -> None:
        """Refuse what is no place on the Earth."""
        self._require(abs(self.latitude_rad) <= math.pi / 2, "latitude", self.latitude_rad, "from -90 to 90 deg")
        self._require(abs(self.longitude_rad) <= 2 * math.pi, "longitude", self.longitude_rad, "from -360 to 360 deg")
        self._require(0.0 <= self.mask_rad < math.pi / 2, "elevation mask", self.mask_rad, "from 0 to below 90 deg")
        if not -1e3 <= self.height_m <= 5e4:
            raise OrbitError(
                f"station {self.name}: its height of {self.height_m:.6g} m is not from -1 to 50 km; give the height "
                "over the ellipsoid in metres"
            )

    def position(self, epoch: Epoch, time_s: Floats) -> States:
        """Position and velocity of the station in TEME, `time_s` after `epoch`; it turns with the Earth."""
        across, z = self._meridian_m()
        angle = epoch.earth_rotation_rad(time_s) + self.longitude_rad
        x, y = across * np.cos(angle), across * np.sin(angle)
        velocity = np.stack((-ROTATION_RAD_S * y, ROTATION_RAD_S * x, np.zeros_like(x)))
        return States(np.stack((x, y, np.full_like(x, z))), velocity)

    def vertical(self, epoch: Epoch, time_s: Floats) -> Floats:
        """Unit vectors in TEME upwards from the station, along the normal of the ellipsoid, of shape (3, n)."""
        angle = epoch.earth_rotation_rad(time_s) + self.longitude_rad
        level, rise = math.cos(self.latitude_rad), math.sin(self.latitude_rad)
        return np.stack((level * np.cos(angle), level * np.sin(angle), np.full_like(angle, rise)))

    def _meridian_m(self) -> tuple[float, float]:
        """Distance from the axis of the Earth and height over its equator."""
        square = FLATTENING * (2.0 - FLATTENING)
        sine = math.sin(self.latitude_rad)
        normal = EARTH_RADIUS_M / math.sqrt(1.0 - square * sine * sine)
        across = (normal + self.height_m) * math.cos(self.latitude_rad)
        return across, (normal * (1.0 - square) + self.height_m) * sine

    def _require(self, holds: bool, what: str, angle_rad: float, wanted: str) -> None:
        """Refuse an angle outside its bounds."""
        if not holds:
            raise OrbitError(
                f"station {self.name}: its {what} of {math.degrees(angle_rad):.6g} deg is not {wanted}; check its sign "
                "and its unit"
            )


def elevation_rad(station: Station, epoch: Epoch, time_s: Floats, position_m: Floats) -> Floats:
    """Elevation in rad over the station's horizon of positions (3, n) in TEME at `time_s` after `epoch`.

    Geometric: the angle over the plane normal to the ellipsoid's normal, without refraction (which lifts a satellite by
    0.5 deg at the horizon, 0.1 deg at an elevation of 9 deg).
    """
    line = np.asarray(position_m, dtype=np.float64) - station.position(epoch, time_s).position_m
    up = station.vertical(epoch, time_s)
    rise = np.sum(line * up, axis=0)
    level = line - rise * up
    elevation: Floats = np.arctan2(rise, np.sqrt(np.sum(level * level, axis=0)))
    return elevation
