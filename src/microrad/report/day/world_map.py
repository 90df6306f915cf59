"""Map of a day in orbit: ground track, relays and what they see, stations and their horizons, over the land."""

import json
import math
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.palette import BLACK, BLUE, GREEN, ORANGE, SKY, VERMILION, WHITE
from microrad.report.plotting.sheet import WIDTH, Area, Dash, Legend, Line, Panel, Words, grid, shortened
from microrad.report.quantities import duration

LAND, COAST, SHADE = "#e9e6df", "#b5b0a5", 0.12  # the last an opacity
_HALF_TURN = 180.0
_TURN = 360.0
_OVER_A_POLE = 60.0  # degrees: beyond this latitude, so wide a step in longitude goes over the pole
_NEAR_A_POLE = 90.0 - 1e-9  # degrees: the edge of the map is in no region
_THIN = 0.7  # line of a relay that moves
_CONTACT = (SKY, ORANGE, GREEN)
_FRAME = ((-180.0, -90.0), (-180.0, 90.0), (180.0, 90.0), (180.0, -90.0), (-180.0, -90.0))


class Places(NamedTuple):
    """Points on the Earth, each (n,), radians: geodetic latitude, and longitude eastward, of any turn."""

    latitude_rad: Floats
    longitude_rad: Floats

    @property
    def degrees(self) -> tuple[Floats, Floats]:
        """Longitude in [-180, 180) and latitude."""
        longitude = (np.degrees(np.atleast_1d(self.longitude_rad)) + _HALF_TURN) % _TURN - _HALF_TURN
        return longitude, np.degrees(np.atleast_1d(self.latitude_rad))


class Marked(NamedTuple):
    """A relay or a station: where it is, and the outline of what it sees at the satellite's altitude.

    ``place`` has one point, or several where the sub-satellite point moves (the first is marked, a line joins all).
    ``outline`` is closed: its last point is its first. Empty where there is none.
    """

    place: Places
    outline: Places

    @property
    def outlined(self) -> bool:
        """Whether there is an outline."""
        return self.outline.latitude_rad.size > 0

    @property
    def moves(self) -> bool:
        """Whether there is a way instead of one point."""
        return self.place.latitude_rad.size > 1


def world_map(
    track: Places,
    contact: Mapping[str, NDArray[np.bool_]],
    relays: Mapping[str, Marked],
    stations: Mapping[str, Marked],
    first_s: float | None = None,
) -> Figure:
    """Ground track, its parts in contact, relays and stations.

    Args:
        track: sub-satellite points, (n,), in their order.
        contact: by name the flags (n,) of the points in contact.
        relays: by name, with what they see.
        stations: by name, with their horizons.
        first_s: the time that the track takes, s, where it is the beginning of a longer span only.
    """
    sheet, (panel,) = grid(WIDTH, 4.6)
    _earth(panel)
    for relay in relays.values():
        if relay.outlined:
            panel.add(Area(other_side(relay), BLUE, SHADE))
    _track(panel, track, contact)
    for name, relay in relays.items():
        _marked(panel, name, relay, BLUE, "D")
    for name, station in stations.items():
        _marked(panel, name, station, VERMILION, "^")
    entries = _entries(panel, [*relays.values()], [*stations.values()])
    sheet.legend = Legend("below", 3, only=tuple(entries))
    columns = _columns("track", track) | {f"in contact: {name}": flags.astype(float) for name, flags in contact.items()}
    for name, each in (*relays.items(), *stations.items()):
        columns |= _columns(name, each.place) | _columns(f"{name}, outline", each.outline)
    caption = _caption([*relays.values()], [*stations.values()], first_s)
    return Figure("world-map", "Ground track, relays and stations", caption, sheet, columns)


def _caption(relays: Sequence[Marked], stations: Sequence[Marked], first_s: float | None) -> str:
    """What is drawn, and nothing else."""
    part = "" if first_s is None else f" in the first {duration(first_s)} of the span"
    said = [f"Ground track of the satellite{part}, thick where it is in contact."]
    if any(r.outlined for r in relays):
        said.append("At its altitude a satellite over the shaded region has no line of sight to the relay.")
    if any(r.moves for r in relays):
        said.append("The relay moves: marked where it is at the start, with its own ground track as a thin line.")
    if any(s.outlined for s in stations):
        said.append("Inside a station's circle the satellite is above the lowest elevation of that station.")
    return " ".join([*said, "Land: Natural Earth."])


def _entries(panel: Panel, relays: Sequence[Marked], stations: Sequence[Marked]) -> list[Line | Area]:
    """What the legend explains: the track and its parts, then what a relay's and a station's marks mean."""
    entries: list[Line | Area] = [line for line in panel.all_of(Line) if line.label]

    def mark(label: str, colour: str, marker: str, dash: Dash = "", width: float = 1.0) -> Line:
        return Line(np.empty(0), np.empty(0), colour, dash, width, label, marker=marker, size=7.0, edge=WHITE)

    if any(r.outlined for r in relays):
        entries.append(Area((), BLUE, SHADE, "hidden from a relay"))
        entries.append(mark("relay, limit of its view", BLUE, "D", "--"))
    if any(r.moves for r in relays):
        entries.append(mark("relay at the start, its track", BLUE, "D", "-", _THIN))
    if any(not r.outlined and not r.moves for r in relays):
        entries.append(mark("relay", BLUE, "D"))
    if any(s.outlined for s in stations):
        entries.append(mark("station, its horizon", VERMILION, "^", "-"))
    if any(not s.outlined for s in stations):
        entries.append(mark("station", VERMILION, "^"))
    return entries


def land() -> tuple[Floats, ...]:
    """Rings of the coasts, each (n, 2): longitude and latitude in degrees, land on the left, closed."""
    text = resources.files("microrad.report.day").joinpath("land.json").read_text(encoding="utf-8")
    return tuple(np.reshape(ring, (-1, 2)) for ring in json.loads(text)["rings"])


def _earth(panel: Panel) -> None:
    panel.add(Area(land(), LAND, edge=COAST))
    panel.x.low, panel.x.high, panel.y.low, panel.y.high = -180.0, 180.0, -90.0, 90.0
    panel.x.ticks = {degrees: _degrees(degrees, "WE") for degrees in range(-180, 181, 60)}
    panel.y.ticks = {degrees: _degrees(degrees, "SN") for degrees in range(-90, 91, 30)}
    panel.framed = panel.equal = True


def _degrees(value: float, sides: str) -> str:
    """An angle to one side: 60.5° E."""
    size = f"{abs(value):.4g}"
    return f"{size}°" if size in ("0", "180") else f"{size}° {sides[int(value > 0.0)]}"


def _track(panel: Panel, track: Places, contact: Mapping[str, NDArray[np.bool_]]) -> None:
    """The track, and over it the parts in contact; a part runs from its first point with contact to its last."""
    longitude, latitude = track.degrees
    if not longitude.size:
        panel.add(Words("no ground track", 0.0, 0.0, size=9.0, anchor="middle"))
        return
    for place, (name, flags) in enumerate(contact.items()):
        x, y = broken(np.where(flags, longitude, np.nan), latitude)
        label = shortened(name) + ("" if flags.any() else ": none")
        panel.add(Line(x, y, _CONTACT[place % 3], width=3.4 - 1.0 * min(place, 2), label=label))
    panel.add(Line(*broken(longitude, latitude), BLACK, width=0.5, label="ground track"))
    panel.add(Line(longitude[:1], latitude[:1], BLACK, "", label="start", marker="o", size=4.0))


def broken(longitude: Floats, latitude: Floats) -> tuple[Floats, Floats]:
    """The line in degrees with its breaks (nan): at ±180°, drawn up to the edge, and over a pole, drawn up to it.

    Args:
        longitude: in [-180, 180], (n,), degrees; a nan is a gap already.
        latitude: (n,), degrees.
    """
    x, y = [longitude[:1]], [latitude[:1]]
    for (a, b), (low, high) in zip(_pairs(longitude), _pairs(latitude), strict=True):
        step = (b - a + _HALF_TURN) % _TURN - _HALF_TURN  # the short way
        if abs(step) > _OVER_A_POLE and abs(low + high) > 2.0 * _OVER_A_POLE:
            pole = math.copysign(90.0, low + high)
            x.append(np.array([a, np.nan, b]))
            y.append(np.array([pole, np.nan, pole]))
        elif abs(b - a) > _HALF_TURN:
            edge = math.copysign(_HALF_TURN, a)
            at = low + (high - low) * (edge - a) / step if step else low
            x.append(np.array([edge, np.nan, -edge]))
            y.append(np.array([at, np.nan, at]))
        x.append(np.array([b]))
        y.append(np.array([high]))
    return np.concatenate(x), np.concatenate(y)


def _pairs(values: Floats) -> list[tuple[float, float]]:
    return [*zip(values[:-1].tolist(), values[1:].tolist(), strict=True)]


def _marked(panel: Panel, name: str, each: Marked, colour: str, marker: str) -> None:
    """Marker, name, outline, and the way of a sub-satellite point that moves."""
    x, y = each.place.degrees
    panel.add(Line(*broken(*each.outline.degrees), colour, "-" if marker == "^" else "--", 1.0))
    panel.add(Line(*broken(x, y), colour, width=_THIN))
    panel.add(Line(x[:1], y[:1], colour, "", marker=marker, size=7.0, edge=WHITE, clip=False))
    east = x[0] > 120.0
    shift, anchor = (-6.0 if east else 6.0, 0.0), "end" if east else "start"
    panel.add(Words(shortened(name, 24), float(x[0]), float(y[0]), shift=shift, anchor=anchor, box=True))  # type: ignore[arg-type]


# ------------------------------------------------------------------------------------------------ hidden region
def other_side(each: Marked) -> tuple[Floats, ...]:
    """Rings (degrees) of the region of the map that a closed outline parts from the marked place.

    A place is in the region where an odd number of rings is around it.
    """
    x, y = each.outline.degrees
    x = np.unwrap(x, period=_TURN)
    (longitude, *_), (latitude, *_) = each.place.degrees
    here = (float(longitude), min(max(float(latitude), -_NEAR_A_POLE), _NEAR_A_POLE))
    turns = round((x[-1] - x[0]) / _TURN)
    if turns == 0:
        inside = _shifted(np.stack([x, y], axis=1))
        return (np.array(_FRAME), *inside) if odd(inside, here) else inside
    # About a pole: the outline runs once around the map, and the region's other edge is that of the map.
    northern, southern = (_shifted(_to_the_pole(x, y, pole)) for pole in (90.0, -90.0))
    return southern if odd(northern, here) else northern


def _to_the_pole(x: Floats, y: Floats, pole: float) -> Floats:
    return np.stack([np.r_[x, x[-1], x[0]], np.r_[y, pole, pole]], axis=1)


def _shifted(ring: Floats) -> tuple[Floats, ...]:
    """The ring here and a turn to either side: what leaves the map at one edge enters at the other."""
    ring = ring - [_TURN * round(float(np.mean(ring[:, 0])) / _TURN), 0.0]
    closed = np.vstack([ring, ring[:1]])
    return tuple(closed + np.array([k * _TURN, 0.0]) for k in (-1, 0, 1))


def odd(rings: Sequence[Floats], point: tuple[float, float]) -> bool:
    """Whether an odd number of closed rings is around a point.

    Args:
        rings: each (m, 2), closed.
        point: its two coordinates.
    """
    crossings = 0
    for ring in rings:
        (x, y), (ahead_x, ahead_y) = ring[:-1].T, ring[1:].T
        over = (y > point[1]) != (ahead_y > point[1])
        at = x[over] + (point[1] - y[over]) * (ahead_x[over] - x[over]) / (ahead_y[over] - y[over])
        crossings += int(np.sum(at > point[0]))
    return crossings % 2 == 1


def _columns(name: str, places: Places) -> dict[str, Floats]:
    longitude, latitude = places.degrees
    return {f"{name}, latitude (deg)": latitude, f"{name}, longitude (deg)": longitude}
