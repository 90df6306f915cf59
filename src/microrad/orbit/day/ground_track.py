"""The satellite over the map: its track, and from where it sees relay and stations, where that stays in place."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from microrad import orbit
from microrad.core.arrays import Floats
from microrad.mission.tables.operations import Downlink, OpticalDownlink
from microrad.orbit.day.flow import Way
from microrad.orbit.day.geometry import View

STEP_S = 30.0
LONGEST_S = 86400.0
"""A longer track covers the map."""
STILL_RAD = math.radians(1.0)
"""A relay whose sub-point stays within this angle of where it began stands still on a map."""
SAME_HEIGHT = 0.05
"""Part of its distance from the Earth's centre by which a satellite's height may vary for one outline to hold."""
_POINTS = 181  # of an outline
_NONE: Floats = np.empty(0)


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Points of the Earth that something stands over, and a line around them, geodetic; arrays of shape (n,).

    One point, or its way over the track's times where it moves. The line is empty where none holds all the time.
    """

    name: str
    latitude_rad: Floats
    longitude_rad: Floats
    around_latitude_rad: Floats
    around_longitude_rad: Floats


@dataclass(frozen=True, slots=True, eq=False)
class GroundTrack:
    """Where the satellite stands over the Earth, and which ways are open to it there; arrays of shape (n,).

    A relay that stands still has a line around it, within which a satellite at the mean height of the track sees it;
    a link to a station has no relay, and its station is the first of the others.
    The line around a station is its elevation mask. Neither has a line where the satellite's height varies by
    `SAME_HEIGHT`.
    """

    time_s: Floats
    latitude_rad: Floats
    longitude_rad: Floats
    open: dict[str, NDArray[np.bool_]]
    relay: Outline | None
    stations: tuple[Outline, ...]


def ground_track(
    seen: View, ways: tuple[Way, ...], downlink: Downlink | None, optical: OpticalDownlink | None = None
) -> GroundTrack:
    """The track of the mission's satellite over its span, of a day at most.

    Args:
        seen: The terminals, and when they see each other.
        ways: The ways down, each shown where it is open.
        downlink: The mission's ground stations; None without any.
        optical: Its optical ground stations, likewise.
    """
    pair = seen.pair
    time_s = np.arange(0.0, min(seen.duration_s, LONGEST_S), STEP_S)
    turned = pair.epoch.earth_rotation_rad(time_s)
    partner = [each.orbit.station for each in (pair.leo, pair.geo) if isinstance(each.orbit, orbit.GroundSite)]
    flying = pair.geo if isinstance(pair.leo.orbit, orbit.GroundSite) else pair.leo
    own = orbit.subpoint(flying.orbit.states(time_s).position_m, turned)
    mean_m = float(np.mean(own.height_m))  # or None, where the height varies too much for one to stand for all
    height_m = mean_m if np.ptp(own.height_m) < SAME_HEIGHT * (orbit.EARTH_RADIUS_M + mean_m) else None
    found = {}
    for way in ways:
        found[way.name] = np.zeros(time_s.size, dtype=bool)
        for contact in way.contacts:
            found[way.name] |= (contact.start_s <= time_s) & (time_s <= contact.end_s)
    heard = [station for of in (downlink, optical) if of is not None for station in orbit.stations(of)]
    return GroundTrack(
        time_s=time_s,
        latitude_rad=own.latitude_rad,
        longitude_rad=own.longitude_rad,
        open=found,
        relay=None if partner else _relay(pair, time_s, turned, height_m),
        stations=tuple(_station(s, height_m) for s in (*partner, *heard)),
    )


def _relay(pair: orbit.Pair, time_s: Floats, turned_rad: Floats, height_m: float | None) -> Outline:
    """The relay with the limit of what it sees, or with its own way over the Earth."""
    far_m = pair.geo.orbit.states(time_s).position_m
    under = orbit.subpoint(far_m, turned_rad)
    if not isinstance(pair.geo.orbit, orbit.GeostationarySlot) and _moves(under.latitude_rad, under.longitude_rad):
        return Outline(pair.geo.name, under.latitude_rad, under.longitude_rad, _NONE, _NONE)
    reach = None
    if height_m is not None:
        least = orbit.EARTH_RADIUS_M + pair.earth.grazing_height_m
        both = orbit.EARTH_RADIUS_M + height_m, float(np.linalg.norm(far_m[:, 0]))
        reach = sum(math.acos(min(least / r, 1.0)) for r in both)
    return _outline(pair.geo.name, float(under.latitude_rad[0]), float(under.longitude_rad[0]), reach)


def _moves(latitude_rad: Floats, longitude_rad: Floats) -> bool:
    """Whether a point leaves where it began, by the haversine of the angle between both."""
    first, turn = latitude_rad[0], longitude_rad - longitude_rad[0]
    across = np.cos(first) * np.cos(latitude_rad) * np.sin(turn / 2.0) ** 2
    haversine = np.sin((latitude_rad - first) / 2.0) ** 2 + across
    return bool(np.max(haversine) >= math.sin(STILL_RAD / 2.0) ** 2)


def _station(station: orbit.Station, height_m: float | None) -> Outline:
    """The station, and around it where a satellite that high stands at the elevation of its mask."""
    reach, radius, mask = None, orbit.EARTH_RADIUS_M, station.mask_rad
    if height_m is not None:
        reach = math.acos(radius * math.cos(mask) / (radius + height_m)) - mask
    return _outline(station.name, station.latitude_rad, station.longitude_rad, reach)


def _outline(name: str, latitude_rad: float, longitude_rad: float, radius_rad: float | None) -> Outline:
    """A point of a sphere, and the circle of an angular radius around it unless that is None."""
    place = np.array([latitude_rad]), np.array([longitude_rad])
    if radius_rad is None:
        return Outline(name, *place, _NONE, _NONE)
    bearing = np.linspace(0.0, 2.0 * math.pi, _POINTS)
    rise = math.sin(latitude_rad) * math.cos(radius_rad)
    latitude = np.arcsin(np.clip(rise + math.cos(latitude_rad) * math.sin(radius_rad) * np.cos(bearing), -1.0, 1.0))
    east = np.sin(bearing) * math.sin(radius_rad) * math.cos(latitude_rad)
    turn = np.arctan2(east, math.cos(radius_rad) - math.sin(latitude_rad) * np.sin(latitude))
    longitude = (longitude_rad + turn + math.pi) % (2.0 * math.pi) - math.pi
    return Outline(name, *place, latitude, longitude)
