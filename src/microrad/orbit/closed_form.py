"""Contact of two circular orbits in the plane of the equator, by hand: the check on every search."""

import math
from typing import NamedTuple

from microrad.core.units import format_quantity
from microrad.orbit.base import OrbitError
from microrad.orbit.earth import EARTH_RADIUS_M, GEOSTATIONARY_RADIUS_M, MU_M3_S2, ROTATION_RAD_S


class CoplanarContact(NamedTuple):
    """One contact, the time from the start of one to the start of the next, and the ranges while in contact."""

    duration_s: float
    repeat_s: float
    shortest_range_m: float
    longest_range_m: float

    @property
    def visible_share(self) -> float:
        """Share of the time in contact."""
        return self.duration_s / self.repeat_s


def coplanar_contact(radius_m: float, grazing_height_m: float) -> CoplanarContact:
    """A satellite on a circular orbit over the equator, eastward, and one fixed in the rotating Earth.

    `radius_m` is the radius of the lower orbit a, R = `EARTH_RADIUS_M` + `grazing_height_m` what the line of sight must
    clear, b = `GEOSTATIONARY_RADIUS_M`. The angle between the two as seen from the Earth's centre is at most
    acos(R/a) + acos(R/b) either way and grows by the difference of the two rates, n - w: the contact takes

        T (acos(R/a) + acos(R/b)) / pi,   T = 2 pi / (n - w),   n = sqrt(mu / a^3),

    the range goes from b - a to sqrt(a^2 - R^2) + sqrt(b^2 - R^2), where the line grazes the surface. Two bodies, no
    flattening: on the equator the oblate Earth hides what the sphere hides.

    Raises `OrbitError` unless R < a < b.
    """
    high, least = GEOSTATIONARY_RADIUS_M, EARTH_RADIUS_M + grazing_height_m
    if not (math.isfinite(radius_m) and 0.0 < least < radius_m < high):
        raise OrbitError(
            f"an orbit of radius {format_quantity(radius_m, 'm')} is not between the surface to clear, "
            f"{format_quantity(least, 'm')}, and the geostationary {format_quantity(high, 'm')}; give a radius between"
        )
    half = math.acos(least / radius_m) + math.acos(least / high)
    repeat = 2.0 * math.pi / (math.sqrt(MU_M3_S2 / radius_m**3) - ROTATION_RAD_S)
    longest = math.sqrt(radius_m**2 - least**2) + math.sqrt(high**2 - least**2)
    return CoplanarContact(repeat * half / math.pi, repeat, high - radius_m, longest)
