"""The Earth's constants, and where a place on its ellipsoid lies."""

import math

EARTH_RADIUS_M = 6378137.0
"""Equatorial radius (WGS84)."""
FLATTENING = 1.0 / 298.257223563
"""(a - b) / a of the ellipsoid (WGS84)."""
MU_M3_S2 = 3.986004418e14
"""Gravitational constant times mass of the Earth, atmosphere included (WGS84)."""
ROTATION_RAD_S = 2.0 * math.pi * 1.002737909350795 / 86400.0
"""Rate of Greenwich mean sidereal time (Aoki et al. 1982): against the moving equinox, as TEME is; 7.292115855e-5."""
GEOSTATIONARY_RADIUS_M = (MU_M3_S2 / ROTATION_RAD_S**2) ** (1.0 / 3.0)
"""Radius at which a two-body circular orbit turns with the Earth, 42 164.17 km."""


def place_m(latitude_rad: float, height_m: float) -> tuple[float, float]:
    """Distances (m) of a place from the Earth's axis, and from the plane of its equator, north positive (WGS84).

    Args:
        latitude_rad: Geodetic latitude (rad).
        height_m: Height above the ellipsoid (m).
    """
    square, sine = FLATTENING * (2.0 - FLATTENING), math.sin(latitude_rad)
    normal = EARTH_RADIUS_M / math.sqrt(1.0 - square * sine * sine)
    return (normal + height_m) * math.cos(latitude_rad), (normal * (1.0 - square) + height_m) * sine
