"""The door: from the mission's tables to orbits, terminals and stations, which all else takes."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from microrad.core.earth import EARTH_RADIUS_M
from microrad.mission.file import NamedFile, content_of
from microrad.mission.tables.link import Terminals
from microrad.mission.tables.operations import Constellation, Downlink, OpticalDownlink
from microrad.mission.tables.orbit import Orbits, OrbitTable, VisibilityLimits
from microrad.orbit.base import Orbit, OrbitError, required
from microrad.orbit.earth.epoch import Epoch
from microrad.orbit.earth.figure import Earth, GroundSite, Station
from microrad.orbit.files import read_elements, read_oem
from microrad.orbit.propagation.analytic import (
    GeostationarySlot,
    KeplerOrbit,
    node_of_local_time,
    sun_synchronous_inclination_rad,
)
from microrad.orbit.propagation.ephemeris import EphemerisOrbit
from microrad.orbit.propagation.mean_elements import (
    MOST_ELEMENTS_AGE_S,
    ElementSet,
    Sgp4Orbit,
    closest_elements,
)
from microrad.orbit.visibility.limits import UNLIMITED, Limits, Terminal

Contents = tuple[NamedFile, ...]
"""The files that a mission names, read once with it."""

TAIL_S = 86400.0
"""Time behind the span in which data of the span may still arrive."""
REPEATED = ("circular", "keplerian")
"""Kinds of orbits that the pattern of a constellation can repeat."""


@dataclass(frozen=True, slots=True)
class Pair:
    """Both terminals of the mission's link over the same Earth. `tail_s` is how far behind `span_s` the orbits hold."""

    epoch: Epoch
    earth: Earth
    leo: Terminal
    geo: Terminal
    span_s: tuple[float, float]
    tail_s: float

    @property
    def whole_s(self) -> tuple[float, float]:
        """The span with its tail."""
        return self.span_s[0], self.span_s[1] + self.tail_s


def pair(orbits: Orbits | None, ends: Terminals, folder: Path, contents: Contents = ()) -> Pair:
    """The terminals of a mission on their orbits; files are looked for in ``contents``, and then in ``folder``.

    Args:
        orbits: The mission's table `orbit`.
        ends: Its table `terminals`, with their names.
        folder: The folder of its file.
        contents: The files that it names, where they were read with it.

    Raises:
        OrbitError: If an orbit is impossible, or does not hold over the mission's span.
    """
    orbits = required(orbits, "orbit", OrbitError)
    try:
        epoch = Epoch(orbits.epoch)
    except OrbitError as error:
        raise OrbitError(f"orbit.epoch: {error}") from None
    names = ends.called("leo"), ends.called("geo")
    if names[0] == names[1]:  # two terminals of one make
        names = f"{names[0]} (own)", f"{names[1]} (partner)"
    found, tail = [], TAIL_S
    for end, name in zip(("leo", "geo"), names, strict=True):
        given = getattr(orbits, end)
        try:
            own = _orbit(given, name, epoch, folder, contents)
            tail = min(tail, _tail(own, epoch, orbits.duration_s))
        except OrbitError as error:
            raise OrbitError(f"orbit.{end}: {error}") from None
        found.append(Terminal(own, _limits(given.limits), name))
    earth = Earth(orbits.earth, orbits.grazing_height_m)
    return Pair(epoch, earth, found[0], found[1], (0.0, orbits.duration_s), tail)


def _tail(orbit: Orbit, epoch: Epoch, duration_s: float) -> float:
    """How far behind the span an orbit holds; raises OrbitError where it does not hold over it."""
    if isinstance(orbit, EphemerisOrbit):
        orbit.require(0.0, duration_s)
        return min(TAIL_S, max(orbit.span_s[1] - duration_s, 0.0))
    tail = TAIL_S
    if isinstance(orbit, Sgp4Orbit):
        orbit.require(0.0, duration_s)
        tail = min(TAIL_S, max(MOST_ELEMENTS_AGE_S - orbit.elements_age_s - duration_s, 0.0))
    try:
        if isinstance(orbit, Sgp4Orbit):
            orbit.require(0.0, duration_s + tail)
        else:
            epoch.utc(duration_s + tail)
    except OrbitError:  # it decays behind the span, or the rotation of the Earth is not known there
        return 0.0
    return tail


def _orbit(t: OrbitTable, name: str, epoch: Epoch, folder: Path, contents: Contents) -> Orbit:
    """The orbit that a table describes, whose own checks have seen to the keys of each kind."""
    if t.kind == "station":
        assert t.latitude_rad is not None and t.longitude_rad is not None  # the table's own check
        assert t.height_m is not None and t.mask_rad is not None
        return GroundSite(Station(name, t.latitude_rad, t.longitude_rad, t.height_m, t.mask_rad), epoch)
    if t.longitude_rad is not None:
        return GeostationarySlot(name, epoch, t.longitude_rad)
    if t.file is None:
        return _kepler(t, name, epoch)
    path, data = folder / t.file, content_of(t.file, contents)
    if t.kind == "ephemeris":
        return read_oem(path, epoch, t.object, data)
    return Sgp4Orbit(closest_elements(read_elements(path, t.object, data), epoch), epoch)


def _kepler(t: OrbitTable, name: str, epoch: Epoch) -> KeplerOrbit:
    """The orbit of a table with elements; a circular one has an altitude and a phase, and not what is 0 then."""
    assert t.inclination_rad is not None
    axis = t.semi_major_axis_m or EARTH_RADIUS_M + (t.altitude_m or 0.0)
    eccentricity, perigee = t.eccentricity or 0.0, t.argument_of_perigee_rad or 0.0
    inclination, node = t.inclination_rad, t.node_rad
    if isinstance(inclination, str):
        inclination = sun_synchronous_inclination_rad(axis - EARTH_RADIUS_M, eccentricity)
    if node is None:
        node = node_of_local_time(epoch, (t.local_time_s or 0.0) / 3600.0 % 24.0)
    anomaly = t.phase_rad or t.mean_anomaly_rad or 0.0
    return KeplerOrbit(name, epoch, axis, eccentricity, inclination, node, perigee, anomaly, t.gravity == "j2")


def _limits(t: VisibilityLimits | None) -> Limits:
    """What a terminal can point at; anything without the table."""
    if t is None:
        return UNLIMITED
    return Limits(
        attitude=t.attitude,
        boresight=t.boresight or UNLIMITED.boresight,
        field_of_regard_rad=t.field_of_regard_rad or math.pi,
        slew_limit_rad_s=t.slew_limit_rad_s,
        sun_exclusion_rad=t.sun_exclusion_rad,
        in_eclipse=t.in_eclipse,
    )


def stations(of: Downlink | OpticalDownlink | Constellation) -> tuple[Station, ...]:
    """The ground stations of a mission's direct downlink, by radio or optical, or those of its constellation."""
    return tuple(
        Station(name, s.latitude_rad, s.longitude_rad, s.height_m, s.mask_rad) for name, s in of.stations.items()
    )


def relays(c: Constellation, orbits: Orbits, epoch: Epoch) -> tuple[Terminal, ...]:
    """The relays of a constellation in their geostationary slots, each limited as the mission's own partner is.

    Args:
        c: The mission's table of its constellation.
        orbits: The mission's table of orbits, for the partner's limits.
        epoch: Instant from which times count.

    Raises:
        OrbitError: For a longitude beyond a full turn, and for limits that are out of range.
    """
    shared = _limits(orbits.geo.limits)
    return tuple(
        Terminal(GeostationarySlot(name, epoch, relay.longitude_rad), shared, name) for name, relay in c.relays.items()
    )


def _names(sets: Sequence[ElementSet], path: Path) -> list[str]:
    """A name for each of several satellites: the catalogue number parts those of one name."""
    counted = Counter(each.name for each in sets)
    names = [e.name if counted[e.name] == 1 else f"{e.name} ({e.catalogue_number})" for e in sets]
    again = [name for name, count in Counter(names).items() if count > 1]
    if again:
        raise OrbitError(f"{path}: several element sets are of {again[0]}; leave one for each satellite")
    return names


def repeats(c: Constellation, orbits: Orbits) -> bool:
    """Whether the constellation has satellites: from a file, or from elements that its pattern can repeat.

    Args:
        c: The mission's table of its constellation.
        orbits: The mission's table of orbits, whose own satellite the pattern repeats.
    """
    return c.pattern == "file" or orbits.leo.kind in REPEATED


def satellites(
    c: Constellation, orbits: Orbits, epoch: Epoch, folder: Path, contents: Contents = ()
) -> Iterator[Terminal]:
    """The satellites of a constellation, one after the other, each limited as the mission's own is.

    Walker's patterns i: t/p/f: plane k of p has its node 2 pi k / p further ("star": pi k / p), and satellite j of it
    its phase 2 pi (j p / t + f k / t) further (J. G. Walker, J. Br. Interplanet. Soc. 37, 1984).

    Args:
        c: The mission's table of its constellation.
        orbits: The mission's table of orbits, whose own satellite the pattern repeats.
        epoch: Instant from which times count.
        folder: Where files are looked for that are not among the contents.
        contents: The files that the mission names.

    Raises:
        OrbitError: For a file that is refused, and an orbit that no pattern can repeat.
    """
    shared = _limits(orbits.leo.limits)
    if c.file is not None:
        sets = read_elements(folder / c.file, data=content_of(c.file, contents))
        for elements, name in zip(sets, _names(sets, folder / c.file), strict=True):
            own = Sgp4Orbit(elements, epoch)
            own.require(0.0, orbits.duration_s)
            yield Terminal(own, shared, name)
        return
    assert c.satellites is not None and c.planes is not None and c.phasing is not None
    if orbits.leo.kind not in REPEATED:
        raise OrbitError(
            f'constellation.pattern is "{c.pattern}", and orbit.leo of kind "{orbits.leo.kind}" has nothing to repeat: '
            'give pattern = "file", or an orbit.leo of kind "circular" or "keplerian"'
        )
    base, turn = _kepler(orbits.leo, "", epoch), 2.0 * math.pi
    each, round_rad = c.satellites // c.planes, turn if c.pattern == "delta" else turn / 2.0
    for plane in range(c.planes):
        node = base.node_rad + round_rad * plane / c.planes
        for place in range(each):
            phase = turn * (place * c.planes + c.phasing * plane) / c.satellites
            name, anomaly = f"{plane + 1}-{place + 1}", base.mean_anomaly_rad + phase
            yield Terminal(replace(base, name=name, node_rad=node, mean_anomaly_rad=anomaly), shared, name)
