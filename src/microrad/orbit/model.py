"""From the mission's tables to orbits, terminals and stations."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from microrad.mission.file import NamedFile, content_of
from microrad.mission.model import LinkMission
from microrad.mission.tables.operations import Constellation, Downlink
from microrad.mission.tables.orbit import Orbits, OrbitTable, VisibilityLimits
from microrad.orbit.analytic import GeostationarySlot, KeplerOrbit, node_of_local_time, sun_synchronous_inclination_rad
from microrad.orbit.base import Orbit, OrbitError
from microrad.orbit.earth import EARTH_RADIUS_M, Earth
from microrad.orbit.element_files import read_elements
from microrad.orbit.elements import MOST_ELEMENTS_AGE_S, ElementSet, Sgp4Orbit, closest_elements, sgp4_orbit
from microrad.orbit.ephemeris import EphemerisOrbit
from microrad.orbit.epoch import Epoch
from microrad.orbit.ground import Station
from microrad.orbit.limits import UNLIMITED, Limits, Terminal
from microrad.orbit.oem import read_oem

Contents = tuple[NamedFile, ...]

TAIL_S = 86400.0
"""Time behind the span in which data of the span may still arrive."""


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


def pair(m: LinkMission, folder: Path, contents: Contents = ()) -> Pair:
    """The terminals of a mission with a table `orbit`; files are looked for in ``contents``, and then in ``folder``.

    Raises `OrbitError` for an orbit that is none, or that does not hold over the mission's span.
    """
    orbits = table(m)
    epoch = _epoch(orbits)
    names = m.terminals.called("leo"), m.terminals.called("geo")
    if names[0] == names[1]:  # two terminals of one make
        names = f"{names[0]} (own)", f"{names[1]} (partner)"
    found, tail = [], TAIL_S
    for end, name in zip(("leo", "geo"), names, strict=True):
        try:
            one = terminal(getattr(orbits, end), name, epoch, folder, contents)
            tail = min(tail, _tail(one.orbit, epoch, orbits.duration_s))
        except OrbitError as error:
            raise OrbitError(f"orbit.{end}: {error}") from None
        found.append(one)
    return Pair(epoch, earth(orbits), found[0], found[1], (0.0, orbits.duration_s), tail)


def table(m: LinkMission) -> Orbits:
    """The mission's table of orbits; `OrbitError` without one."""
    if m.orbit is None:
        raise OrbitError("the mission has no table [orbit]: microrad init writes one")
    return m.orbit


def _epoch(orbits: Orbits) -> Epoch:
    try:
        return Epoch.from_text(orbits.epoch)
    except OrbitError as error:
        raise OrbitError(f"orbit.epoch: {error}") from None


def earth(orbits: Orbits) -> Earth:
    """What hides a partner."""
    return Earth(orbits.earth, orbits.grazing_height_m)


def _tail(orbit: Orbit, epoch: Epoch, duration_s: float) -> float:
    """How far behind the span an orbit holds; raises `OrbitError` where it does not hold over it."""
    if not isinstance(orbit, Sgp4Orbit | EphemerisOrbit):
        return TAIL_S if _tabulated(epoch, duration_s + TAIL_S) else 0.0
    orbit.require(0.0, duration_s)
    if isinstance(orbit, Sgp4Orbit):
        tail = min(TAIL_S, max(MOST_ELEMENTS_AGE_S - orbit.elements_age_s - duration_s, 0.0))
        try:
            orbit.require(0.0, duration_s + tail)
        except OrbitError:  # it decays behind the span
            return 0.0
        return tail
    return min(TAIL_S, max(orbit.span_s[1] - duration_s, 0.0))


def _tabulated(epoch: Epoch, time_s: float) -> bool:
    """Whether the rotation of the Earth is known at that time."""
    try:
        epoch.utc(time_s)
    except OrbitError:
        return False
    return True


def terminal(t: OrbitTable, name: str, epoch: Epoch, folder: Path, contents: Contents = ()) -> Terminal:
    """A terminal on its orbit, with what it can point at."""
    return Terminal(orbit_of(t, name, epoch, folder, contents), limits(t.limits), name)


def orbit_of(t: OrbitTable, name: str, epoch: Epoch, folder: Path, contents: Contents = ()) -> Orbit:
    """The orbit that a table describes; its own checks have seen to the keys."""
    if t.kind == "geostationary":
        assert t.longitude_rad is not None
        return GeostationarySlot(name, epoch, t.longitude_rad)
    if t.kind == "ephemeris":
        assert t.file is not None
        return read_oem(folder / t.file, epoch, t.object, content_of(t.file, contents))
    if t.kind == "elements":
        assert t.file is not None
        sets = read_elements(folder / t.file, t.object, content_of(t.file, contents))
        return sgp4_orbit(closest_elements(sets, epoch), epoch)
    return _kepler(t, name, epoch)


def _kepler(t: OrbitTable, name: str, epoch: Epoch) -> KeplerOrbit:
    assert t.inclination_rad is not None
    if t.kind == "circular":
        assert t.altitude_m is not None and t.phase_rad is not None
        axis, eccentricity, perigee, anomaly = EARTH_RADIUS_M + t.altitude_m, 0.0, 0.0, t.phase_rad
    else:
        assert t.semi_major_axis_m is not None and t.eccentricity is not None
        assert t.argument_of_perigee_rad is not None and t.mean_anomaly_rad is not None
        axis, eccentricity, perigee = t.semi_major_axis_m, t.eccentricity, t.argument_of_perigee_rad
        anomaly = t.mean_anomaly_rad
    inclination = t.inclination_rad
    if isinstance(inclination, str):
        inclination = sun_synchronous_inclination_rad(axis - EARTH_RADIUS_M, eccentricity)
    node = t.node_rad
    if node is None:
        assert t.local_time_s is not None
        node = node_of_local_time(epoch, t.local_time_s / 3600.0 % 24.0)
    return KeplerOrbit(name, epoch, axis, eccentricity, inclination, node, perigee, anomaly, t.gravity == "j2")


def limits(t: VisibilityLimits | None) -> Limits:
    """What a terminal can point at; anything without the table."""
    if t is None:
        return UNLIMITED
    boresight = UNLIMITED.boresight if t.boresight is None else (t.boresight[0], t.boresight[1], t.boresight[2])
    return Limits(
        attitude=t.attitude,
        boresight=boresight,
        field_of_regard_rad=math.pi if t.field_of_regard_rad is None else t.field_of_regard_rad,
        slew_limit_rad_s=t.slew_limit_rad_s,
        sun_exclusion_rad=t.sun_exclusion_rad,
        in_eclipse=t.in_eclipse,
    )


def stations(downlink: Downlink) -> tuple[Station, ...]:
    """The ground stations of a mission's direct downlink."""
    return tuple(
        Station(name, s.latitude_rad, s.longitude_rad, s.height_m, s.mask_rad) for name, s in downlink.stations.items()
    )


def relays(c: Constellation, m: LinkMission, epoch: Epoch) -> tuple[Terminal, ...]:
    """The relays of a constellation, each limited as the mission's own partner is."""
    shared = limits(table(m).geo.limits)
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


def repeats(c: Constellation, m: LinkMission) -> bool:
    """Whether the constellation has satellites: from a file, or from elements that its pattern can repeat."""
    return c.pattern == "file" or table(m).leo.kind in ("circular", "keplerian")


def satellites(
    c: Constellation, m: LinkMission, epoch: Epoch, folder: Path, contents: Contents = ()
) -> Iterator[Terminal]:
    """The satellites of a constellation, one after the other, each limited as the mission's own is.

    Walker's patterns i: t/p/f: plane k of p has its node 2 pi k / p further ("star": pi k / p), and satellite j of it
    its phase 2 pi (j p / t + f k / t) further (J. G. Walker, J. Br. Interplanet. Soc. 37, 1984).
    """
    shared = limits(table(m).leo.limits)
    if c.pattern == "file":
        assert c.file is not None
        sets = read_elements(folder / c.file, data=content_of(c.file, contents))
        for elements, name in zip(sets, _names(sets, folder / c.file), strict=True):
            own = sgp4_orbit(elements, epoch)
            own.require(0.0, table(m).duration_s)
            yield Terminal(own, shared, name)
        return
    assert c.satellites is not None and c.planes is not None and c.phasing is not None
    if not repeats(c, m):
        raise OrbitError(
            f'constellation.pattern is "{c.pattern}", and orbit.leo of kind "{table(m).leo.kind}" has nothing to '
            'repeat: give pattern = "file", or an orbit.leo of kind "circular" or "keplerian"'
        )
    base, turn = _kepler(table(m).leo, "", epoch), 2.0 * math.pi
    each, round_rad = c.satellites // c.planes, turn if c.pattern == "delta" else turn / 2.0
    for plane in range(c.planes):
        for place in range(each):
            phase = turn * (place * c.planes + c.phasing * plane) / c.satellites
            name = f"{plane + 1}-{place + 1}"
            orbit = KeplerOrbit(
                name,
                epoch,
                base.semi_major_axis_m,
                base.eccentricity,
                base.inclination_rad,
                base.node_rad + round_rad * plane / c.planes,
                base.argument_of_perigee_rad,
                base.mean_anomaly_rad + phase,
                base.j2,
            )
            yield Terminal(orbit, shared, name)
