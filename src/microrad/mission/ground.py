"""The path between a station on the ground and a satellite: its elevation and range from the mission's tables."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from microrad.core.earth import EARTH_RADIUS_M, GEOSTATIONARY_RADIUS_M, place_m
from microrad.core.units import format_quantity
from microrad.mission.fields import Problem
from microrad.mission.tables.channel import Channel
from microrad.mission.tables.link import Beacon, Beam, Communication, LinkRequirement
from microrad.mission.tables.orbit import Orbits, OrbitTable

_AIR_M = 100e3


@dataclass(frozen=True, slots=True)
class GroundPath:
    """The path between a station on the ground and a satellite, over a round Earth.

    ``station`` is the terminal on the ground, "leo" or "geo". ``elevation_rad`` is the one at which the link is
    budgeted. ``height_m`` is the station's above the sea. Radii count from the Earth's centre (m);
    ``satellite_radius_m`` is None where each table's distance says how far the satellite is. ``sources`` are the keys
    that elevation and range follow from, and ``doubt`` says where they stand beside orbits that do not confirm them.
    """

    station: str
    elevation_rad: float
    height_m: float
    station_radius_m: float
    satellite_radius_m: float | None
    sources: tuple[str, ...]
    doubt: str = ""

    def range_at(self, elevation_rad: float) -> float:
        """Slant range (m) at an elevation (rad): sqrt(r^2 - s^2 cos^2 e) - s sin e, r satellite's, s station's radius.

        The satellite's radius must be known.
        """
        radius, own = self.satellite_radius_m, self.station_radius_m
        assert radius is not None
        rise, level = own * math.sin(elevation_rad), own * math.cos(elevation_rad)
        return math.sqrt(radius**2 - level**2) - rise

    def elevation_at(self, range_m: float) -> float:
        """Elevation (rad) at which the satellite is at a slant range (m), that of the zenith or more."""
        radius, own = self.satellite_radius_m, self.station_radius_m
        assert radius is not None
        sine = (radius**2 - own**2 - range_m**2) / (2.0 * own * range_m)
        return math.asin(min(max(sine, -1.0), 1.0))

    def altitude_of(self, range_m: float) -> float:
        """Altitude (m) over the equatorial radius of a satellite that is at a range (m) at the budget's elevation."""
        own = self.station_radius_m
        square = own**2 + range_m**2 + 2.0 * own * range_m * math.sin(self.elevation_rad)
        return math.sqrt(square) - EARTH_RADIUS_M

    def at(self, elevation_rad: float) -> "GroundPath":
        """The path at another elevation (rad)."""
        return replace(self, elevation_rad=elevation_rad)


def geocentric_radius_m(latitude_rad: float, height_m: float) -> float:
    """Distance (m) of a place from the Earth's centre (WGS 84).

    Args:
        latitude_rad: Geodetic latitude (rad).
        height_m: Height above the ellipsoid (m).
    """
    return math.hypot(*place_m(latitude_rad, height_m))


def path_of(orbit: Orbits | None, channel: Channel | None) -> GroundPath | None:
    """The path of a mission's links through the air; None where there is no air.

    With a station in the table `orbit` the links are budgeted at its mask, and from the slot of a geostationary
    satellite at the elevation that this has. An eccentric orbit counts with its apogee.

    Args:
        orbit: The mission's table `orbit`, None where it has none.
        channel: Its table `channel`, likewise.
    """
    if channel is None:
        return None
    if orbit is None or not orbit.station:
        elevation, height = channel.elevation_rad, channel.height_m or 0.0
        if elevation is None:
            return None
        radius = None if channel.altitude_m is None else EARTH_RADIUS_M + channel.altitude_m
        keys = ("channel.elevation",) if radius is None else ("channel.elevation", "channel.altitude")
        own = EARTH_RADIUS_M + height
        path = GroundPath(channel.station or "", elevation, height, own, radius, keys)
        return path if orbit is None else replace(path, doubt=_beside(path, orbit))
    end = orbit.station
    site, other = (orbit.leo, orbit.geo) if end == "leo" else (orbit.geo, orbit.leo)
    if site.latitude_rad is None or site.height_m is None or site.mask_rad is None:
        return None
    flying = "geo" if end == "leo" else "leo"
    radius, key = _satellite_radius_m(other, channel)
    source = "channel.altitude" if key == "altitude" and other.altitude_m is None else f"orbit.{flying}.{key}"
    path = GroundPath(
        end,
        site.mask_rad,
        site.height_m,
        geocentric_radius_m(site.latitude_rad, site.height_m),
        radius,
        (f"orbit.{end}.mask", source),
    )
    if other.kind == "geostationary":
        elevation = _slot_elevation_rad(site, other)
        return replace(path, elevation_rad=elevation, sources=(f"orbit.{end}.latitude", f"orbit.{flying}.longitude"))
    return path


def _beside(path: GroundPath, orbit: Orbits) -> str:
    """That elevation and distance are typed beside orbits without a station, with the range of the lower one."""
    said = "elevation and distance are typed beside the table orbit, in which both terminals fly"
    if orbit.leo.altitude_m is None:
        return said
    low = replace(path, satellite_radius_m=EARTH_RADIUS_M + orbit.leo.altitude_m)
    at = f"{math.degrees(path.elevation_rad):.4g} deg"
    range_m = format_quantity(low.range_at(path.elevation_rad), "m")
    return f"{said}: from {format_quantity(orbit.leo.altitude_m, 'm')} up the range at {at} is {range_m}"


def range_of(beam: Beam, path: GroundPath | None) -> float:
    """Distance (m) of the terminals for a link: as its table says, or as the path has it.

    Args:
        beam: The table of the link.
        path: The path through the air, None in vacuum.
    """
    if beam.distance_m is not None:
        return beam.distance_m
    assert path is not None  # the relations of the mission
    return path.range_at(path.elevation_rad)


def _satellite_radius_m(orbit: OrbitTable, channel: Channel) -> tuple[float | None, str]:
    """The satellite's largest distance from the Earth's centre, and the key that says it."""
    if orbit.kind == "geostationary":
        return GEOSTATIONARY_RADIUS_M, "longitude"
    if orbit.semi_major_axis_m is not None:
        return orbit.semi_major_axis_m * (1.0 + (orbit.eccentricity or 0.0)), "semi_major_axis"
    altitude = channel.altitude_m if orbit.altitude_m is None else orbit.altitude_m
    return None if altitude is None else EARTH_RADIUS_M + altitude, "altitude"


def _slot_elevation_rad(site: OrbitTable, slot: OrbitTable) -> float:
    """Elevation (rad) of a geostationary satellite above a station's horizon, below 0 where the Earth hides it."""
    latitude, height = site.latitude_rad or 0.0, site.height_m or 0.0
    apart = (slot.longitude_rad or 0.0) - (site.longitude_rad or 0.0)
    across, along = place_m(latitude, height)
    line = (
        GEOSTATIONARY_RADIUS_M * math.cos(apart) - across,
        GEOSTATIONARY_RADIUS_M * math.sin(apart),
        -along,
    )
    return math.asin((math.cos(latitude) * line[0] + math.sin(latitude) * line[2]) / math.hypot(*line))


# -------------------------------------------------------------------------------------------------------- what must fit
def ground_fits(
    orbit: Orbits | None,
    channel: Channel | None,
    communication: Communication,
    beacon: Beacon | None,
    answer: Beacon | None,
    requirement: LinkRequirement,
) -> Iterator[Problem]:
    """Elevation, altitude and distances said once; a station that sees its satellite; what turbulence needs.

    Args:
        orbit: The mission's table `orbit`.
        channel: Its table `channel`.
        communication: Its table `communication`.
        beacon: Its table `beacon`.
        answer: Its table `answer`.
        requirement: Its table `requirement`.
    """
    beams = {"communication": communication, "beacon": beacon, "answer": answer}
    end = "" if orbit is None else orbit.station
    if orbit is not None and end:
        yield from _station_problems(orbit, channel, end)
    elif channel is not None:
        yield from _without_station(channel)
    path = path_of(orbit, channel)
    if channel is not None and channel.turbulence is not None and requirement.outage is None:
        reason = "is missing, and the margin under channel.turbulence is the one that is kept but for it"
        yield Problem("requirement.outage", reason, "a share of the time, outage = 0.01 for 1 %")
    known = path is not None and path.satellite_radius_m is not None
    for name, beam in beams.items():
        if beam is None:
            continue
        if beam.distance_m is None and not known and not end:
            yield Problem(f"{name}.distance", "is missing", 'distance = "42000 km" would do')
        if beam.distance_m is not None and beam.distance_m < _AIR_M and channel is not None and channel.turbulence:
            reason = f"is below {format_quantity(_AIR_M, 'm')}, up to which the air of channel.turbulence reaches"
            yield Problem(f"{name}.distance", reason, 'distance = "1000 km" would do')
        if beam.distance_m is not None and known and path is not None and path.elevation_rad > 0.0:
            keys = " and ".join(path.sources)
            true = format_quantity(path.range_at(path.elevation_rad), "m")
            yield Problem(
                f"{name}.distance", f"stands beside {keys}, of which a range of {true} follows", "no distance"
            )


def _station_problems(orbit: Orbits, channel: Channel | None, end: str) -> Iterator[Problem]:
    flying = "geo" if end == "leo" else "leo"
    site, other = getattr(orbit, end), getattr(orbit, flying)
    if channel is None:
        reason = f'is missing, and orbit.{end} is of kind "station": its links cross the air'
        yield Problem("channel", reason, "a table such as [channel] with zenith_transmission = 0.9")
        return
    said = {"elevation": channel.elevation_rad, "station": channel.station, "height": channel.height_m}
    for key, value in said.items():
        if value is not None:
            follows = f"orbit.{end}.mask" if key == "elevation" else f"orbit.{end}"
            yield Problem(f"channel.{key}", f"stands beside {follows}, of which it follows", "this line removed")
    known = other.kind not in ("elements", "ephemeris")
    if known and channel.altitude_m is not None:
        yield Problem("channel.altitude", f"stands beside orbit.{flying}, of which it follows", "this line removed")
    if not known and channel.altitude_m is None:
        reason = f'is missing, and orbit.{flying} of kind "{other.kind}" does not say it'
        yield Problem("channel.altitude", reason, 'altitude = "500 km" would do: the largest over the station')
    path = path_of(orbit, channel)
    if other.kind == "geostationary" and path is not None and path.elevation_rad < site.mask_rad:
        shown, mask = (f"{math.degrees(each):.4g} deg" for each in (path.elevation_rad, site.mask_rad))
        where = "below the horizon" if path.elevation_rad <= 0.0 else f"below orbit.{end}.mask of {mask}"
        reason = f"leaves the satellite at an elevation of {shown} over the station, {where}"
        yield Problem(f"orbit.{flying}.longitude", reason, "a slot that the station sees, or another station")


def _without_station(channel: Channel) -> Iterator[Problem]:
    needed: dict[str, tuple[object, str]] = {"elevation": (channel.elevation_rad, '"30 deg"')}
    if channel.turbulence is not None:
        needed |= {"station": (channel.station, '"geo"'), "height": (channel.height_m, '"0 m"')}
    if channel.aerosol_depth is not None:
        needed["height"] = (channel.height_m, '"0 m"')
    for key, (value, example) in needed.items():
        if value is None:
            yield Problem(
                f"channel.{key}", "is missing, and no station in the table orbit says it", f"{key} = {example} would do"
            )
