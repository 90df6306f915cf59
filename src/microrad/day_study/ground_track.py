"""The satellite over the map: its track, and from where it sees the relay and the stations."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from microrad import orbit
from microrad.day_study.flow import Way
from microrad.day_study.geometry import View
from microrad.operations_table import Downlink

Floats = NDArray[np.float64]

STEP_S = 30.0
LONGEST_S = 86400.0
"""A longer track covers the map."""
_POINTS = 181  # of an outline


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """A point of the Earth and a line around it, geodetic; arrays of shape (n,)."""

    name: str
    latitude_rad: float
    longitude_rad: float
    around_latitude_rad: Floats
    around_longitude_rad: Floats


@dataclass(frozen=True, slots=True, eq=False)
class GroundTrack:
    """Where the satellite stands over the Earth, and which ways are open to it there; arrays of shape (n,).

    Around the relay: from within, a satellite at the mean height of the track sees it. Around a station: its mask.
    """

    time_s: Floats
    latitude_rad: Floats
    longitude_rad: Floats
    open: dict[str, NDArray[np.bool_]]
    relay: Outline
    stations: tuple[Outline, ...]


def ground_track(seen: View, ways: tuple[Way, ...], downlink: Downlink | None) -> GroundTrack:
    """The track of the mission's satellite over its span, of a day at most."""
    pair = seen.pair
    time_s = np.arange(0.0, min(seen.duration_s, LONGEST_S), STEP_S)
    turned = pair.epoch.earth_rotation_rad(time_s)
    own = orbit.subpoint(pair.leo.orbit.states(time_s).position_m, turned)
    far_m = pair.geo.orbit.states(time_s[:1]).position_m
    under = orbit.subpoint(far_m, turned[:1])
    least = orbit.EARTH_RADIUS_M + pair.earth.grazing_height_m
    height = float(np.mean(own.height_m))
    reach = sum(math.acos(min(least / r, 1.0)) for r in (orbit.EARTH_RADIUS_M + height, np.linalg.norm(far_m)))
    relay = _outline(pair.geo.name, float(under.latitude_rad[0]), float(under.longitude_rad[0]), reach)
    stations = () if downlink is None else tuple(_horizon(s, height) for s in orbit.stations(downlink))
    return GroundTrack(
        time_s=time_s,
        latitude_rad=own.latitude_rad,
        longitude_rad=own.longitude_rad,
        open={way.name: _during(time_s, way.contacts) for way in ways},
        relay=relay,
        stations=stations,
    )


def _during(time_s: Floats, contacts: tuple[orbit.Contact, ...]) -> NDArray[np.bool_]:
    found = np.zeros(time_s.size, dtype=bool)
    for contact in contacts:
        found |= (contact.start_s <= time_s) & (time_s <= contact.end_s)
    return found


def _horizon(station: orbit.Station, height_m: float) -> Outline:
    """Where a satellite that high stands at the elevation of the station's mask."""
    radius, mask = orbit.EARTH_RADIUS_M, station.mask_rad
    reach = math.acos(radius * math.cos(mask) / (radius + height_m)) - mask
    return _outline(station.name, station.latitude_rad, station.longitude_rad, reach)


def _outline(name: str, latitude_rad: float, longitude_rad: float, radius_rad: float) -> Outline:
    """The circle of an angular radius around a point of a sphere."""
    bearing = np.linspace(0.0, 2.0 * math.pi, _POINTS)
    rise = math.sin(latitude_rad) * math.cos(radius_rad)
    latitude = np.arcsin(np.clip(rise + math.cos(latitude_rad) * math.sin(radius_rad) * np.cos(bearing), -1.0, 1.0))
    east = np.sin(bearing) * math.sin(radius_rad) * math.cos(latitude_rad)
    turn = np.arctan2(east, math.cos(radius_rad) - math.sin(latitude_rad) * np.sin(latitude))
    longitude = (longitude_rad + turn + math.pi) % (2.0 * math.pi) - math.pi
    return Outline(name, latitude_rad, longitude_rad, latitude, longitude)
