"""The links to a station as a whole: what the air does over elevation, and what each convention of it costs."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import get_args

from microrad import link
from microrad.core.budget import Line
from microrad.link.budget.air import UPLINK, Turbulent, source_of_air, wind_of
from microrad.link.budget.assembly import at_elevation
from microrad.link.pointing.outage import margin_db
from microrad.mission.model import LinkMission, Source
from microrad.mission.tables.channel import TurbulenceTable
from microrad.mission.tables.link import half_angle_rad

_ELEVATIONS_DEG = (10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0)
_CONVENTIONS = ("fades", "wander", "tilt")


@dataclass(frozen=True, slots=True)
class AtElevation:
    """The communication link where its satellite stands at an elevation; losses are positive.

    ``air_db`` is lost of the mean power in the air, ``fade_db`` to fades for the mission's outage. ``fried_m``,
    ``isoplanatic_rad`` and ``index`` are nan in still air.
    """

    elevation_rad: float
    range_m: float
    air_db: float
    fade_db: float
    fried_m: float
    isoplanatic_rad: float
    rytov: float
    index: float
    margin_db: float


@dataclass(frozen=True, slots=True)
class OtherConvention:
    """A convention that the literature leaves open, read another way: what each margin gains by it (dB)."""

    key: str
    given: str
    other: str
    gained_db: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class GroundLink:
    """The links of a mission to a station.

    ``end`` is the terminal on the ground, "leo" or "geo". ``elevations`` begin with that of the budget. ``beams`` are
    what turbulence does to each beam in figures, a list of lines for each name; ``conventions`` are none in still air.
    """

    end: str
    station: str
    elevations: tuple[AtElevation, ...]
    beams: tuple[tuple[str, tuple[Line, ...]], ...]
    conventions: tuple[OtherConvention, ...]


def ground_link(m: LinkMission, sources: Mapping[str, Source], data: link.DataLink) -> GroundLink | None:
    """The links of a mission to a station, or None where nothing of them crosses the air at a known elevation.

    Args:
        m: The mission's tables on its links.
        sources: Where each value of the mission comes from, by its dotted key.
        data: Its communication link.
    """
    path = m.path
    if path is None or not path.station:
        return None
    fixed = path.satellite_radius_m is None or any(key.endswith("longitude") for key in path.sources)
    higher = [math.radians(each) for each in _ELEVATIONS_DEG if math.radians(each) > path.elevation_rad + 1e-9]
    return GroundLink(
        path.station,
        m.terminals.called(path.station),
        tuple(_at(data, each) for each in (path.elevation_rad, *([] if fixed else higher))),
        tuple(_beams(m, sources, data)),
        tuple(_conventions(m, sources)),
    )


def _at(data: link.DataLink, elevation_rad: float) -> AtElevation:
    there = at_elevation(data, elevation_rad)
    turbulent = there.turbulent
    return AtElevation(
        elevation_rad,
        there.range_m,
        there.air_db,
        there.fade_db,
        math.nan if turbulent is None else turbulent.path.fried_m,
        math.nan if turbulent is None else turbulent.path.isoplanatic_rad,
        math.nan if turbulent is None else turbulent.path.rytov,
        math.nan if turbulent is None else turbulent.index,
        margin_db(there),
    )


def _of_beams(m: LinkMission, data: link.DataLink) -> dict[str, Turbulent | None]:
    shared = link.Shared.of(m)
    found = {"Communication": data.turbulent}
    for name, sender, beam in (("Beacon", "leo", m.beacon), ("Answer", "geo", m.answer)):
        if beam is not None:
            half = half_angle_rad(beam.divergence_rad, m.conventions.divergence)
            found[name] = shared.turbulent(beam, sender, half, None)
    return found


def _beams(m: LinkMission, sources: Mapping[str, Source], data: link.DataLink) -> list[tuple[str, tuple[Line, ...]]]:
    table = None if m.channel is None else m.channel.turbulence
    if table is None:
        return []
    source, of_beams = source_of_air(sources), _of_beams(m, data).items()
    return [(name, tuple(_lines(table, each, source))) for name, each in of_beams if each is not None]


def _lines(table: TurbulenceTable, t: Turbulent, source: str) -> list[Line]:
    path, regime = t.path, "Kolmogorov's turbulence, flat air"
    at = f"at {math.degrees(path.elevation_rad):.4g} deg of elevation"
    found = [
        Line(
            "Fried's parameter",
            path.fried_m,
            "m",
            f"(0.423 k^2 times the integral of Cn2)^(-3/5), {at}",
            source,
            regime,
        ),
        Line(
            "Isoplanatic angle",
            path.isoplanatic_rad,
            "rad",
            "(2.914 k^2 times that of Cn2 z^(5/3))^(-3/5)",
            source,
            regime,
        ),
        Line(
            "Greenwood frequency",
            path.greenwood_hz(wind_of(table)),
            "Hz",
            "(0.102 k^2 times that of Cn2 v^(5/3))^(3/5), in air that the satellite does not turn through",
            source,
            regime,
        ),
        Line("Rytov variance", path.rytov, "", "2.25 k^(7/6) times the integral of Cn2 z^(5/6)", source, "plane wave"),
        Line("Scintillation index", t.index, "", _index_basis(t), source, "any strength", "; ".join(path.regimes)),
    ]
    if t.direction == UPLINK:
        found.append(Line("Beam wander", t.wander_rad, "rad", f"radial rms, {table.wander}", source, regime))
    else:
        found.append(
            Line("Angle of arrival", t.arrival_rad, "rad", f"rms about one axis, {table.tilt}", source, regime)
        )
    return found


def _index_basis(t: Turbulent) -> str:
    return "Gaussian beam on its axis" if t.direction == UPLINK else "plane wave, averaged over the aperture"


def _conventions(m: LinkMission, sources: Mapping[str, Source]) -> list[OtherConvention]:
    table = None if m.channel is None else m.channel.turbulence
    if table is None:
        return []
    own, found = _margins(m, sources), []
    for key in _CONVENTIONS:
        given = getattr(table, key)
        for other in get_args(TurbulenceTable.model_fields[key].annotation):
            if other == given:
                continue
            margins = _margins(m.with_value(f"channel.turbulence.{key}", other), sources)
            gained = {name: margins[name] - own[name] for name in own}
            found.append(OtherConvention(f"channel.turbulence.{key}", given, other, gained))
    return found


def _margins(m: LinkMission, sources: Mapping[str, Source]) -> dict[str, float]:
    """Margins of the links by name (dB)."""
    shared, found = link.Shared.of(m), {"Communication": margin_db(link.of(m))}
    for name, beam in (("Beacon", m.beacon), ("Answer", m.answer)):
        if beam is not None:
            found[name] = link.beam_budget(name.lower(), shared, beam, sources).margin_db
    return found
