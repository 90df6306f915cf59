"""Map of a day in orbit: ground track, relays and what they see, stations and their horizons, over the land."""

import json
import math
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.report.day_figures import PLAIN, duration, short
from microrad.report.figures import BLACK, BLUE, GREEN, ORANGE, SKY, VERMILION, Figure, svg_of

LAND, COAST, SHADE = "#e9e6df", "#b5b0a5", "#0072B21F"
_HALF_TURN = 180.0
_TURN = 360.0
_OVER_A_POLE = 60.0  # degrees: beyond this latitude, so wide a step in longitude goes over the pole
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


@rc_context(PLAIN)
def world_map(
    track: Places,
    contact: Mapping[str, NDArray[np.bool_]],
    relays: Mapping[str, Marked],
    stations: Mapping[str, Marked],
    first_s: float | None = None,
) -> Figure:
    """Ground track, its parts in contact (a name and (n,) flags of the track's points), relays and stations.

    ``first_s`` is the time that the track takes, where it is the beginning of a longer span only.
    """
    canvas = Canvas(figsize=(7.6, 4.6), layout="constrained")
    axes = canvas.subplots()
    _earth(axes)
    for relay in relays.values():
        _hidden(axes, relay)
    _track(axes, track, contact)
    for name, relay in relays.items():
        _marked(axes, name, relay, BLUE, "D")
    for name, station in stations.items():
        _marked(axes, name, station, VERMILION, "^")
    canvas.legend(
        handles=_entries(axes, [*relays.values()], [*stations.values()]),
        loc="outside lower center",
        ncols=3,
        fontsize=8,
    )
    columns = _columns("track", track) | {f"in contact: {name}": flags.astype(float) for name, flags in contact.items()}
    for name, each in (*relays.items(), *stations.items()):
        columns |= _columns(name, each.place) | _columns(f"{name}, outline", each.outline)
    caption = _caption([*relays.values()], [*stations.values()], first_s)
    return Figure("world-map", "Ground track, relays and stations", caption, svg_of(canvas), columns)


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


def _entries(axes: Axes, relays: Sequence[Marked], stations: Sequence[Marked]) -> list[Any]:
    """What the legend explains: the track and its parts, then what a relay's and a station's marks mean."""
    handles, _ = axes.get_legend_handles_labels()

    def mark(label: str, **style: Any) -> Line2D:
        return Line2D([], [], label=label, markeredgecolor="white", markersize=7, **style)

    if any(r.outlined for r in relays):
        handles.append(Patch(color=SHADE, label="hidden from a relay"))
        handles.append(mark("relay, limit of its view", color=BLUE, marker="D", linewidth=1.0, linestyle="--"))
    if any(r.moves for r in relays):
        handles.append(mark("relay at the start, its track", color=BLUE, marker="D", linewidth=_THIN))
    if any(not r.outlined and not r.moves for r in relays):
        handles.append(mark("relay", color=BLUE, marker="D", linestyle=""))
    if any(s.outlined for s in stations):
        handles.append(mark("station, its horizon", color=VERMILION, marker="^", linewidth=1.0))
    if any(not s.outlined for s in stations):
        handles.append(mark("station", color=VERMILION, marker="^", linestyle=""))
    return handles


def land() -> tuple[Floats, ...]:
    """Rings of the coasts, each (n, 2): longitude and latitude in degrees, land on the left, closed."""
    text = resources.files("microrad.report").joinpath("land.json").read_text(encoding="utf-8")
    return tuple(np.reshape(ring, (-1, 2)) for ring in json.loads(text)["rings"])


def _earth(axes: Axes) -> None:
    path = Path.make_compound_path(*(Path(ring, closed=True) for ring in land()))
    axes.add_patch(PathPatch(path, facecolor=LAND, edgecolor=COAST, linewidth=0.4, zorder=0.5))
    axes.set(xlim=(-180, 180), ylim=(-90, 90), aspect="equal")
    axes.set_xticks(range(-180, 181, 60))
    axes.xaxis.set_major_formatter(lambda degrees, _: _degrees(degrees, "WE"))
    axes.set_yticks(range(-90, 91, 30))
    axes.yaxis.set_major_formatter(lambda degrees, _: _degrees(degrees, "SN"))
    for side in ("top", "right"):
        axes.spines[side].set_visible(True)


def _degrees(value: float, sides: str) -> str:
    """An angle to one side: 60.5° E."""
    size = f"{abs(value):.4g}"
    return f"{size}°" if size in ("0", "180") else f"{size}° {sides[int(value > 0.0)]}"


def _track(axes: Axes, track: Places, contact: Mapping[str, NDArray[np.bool_]]) -> None:
    """The track, and over it the parts in contact; a part runs from its first point with contact to its last."""
    longitude, latitude = track.degrees
    if not longitude.size:
        axes.text(0, 0, "no ground track", ha="center", va="center")
        return
    for place, (name, flags) in enumerate(contact.items()):
        style: dict[str, Any] = {
            "color": _CONTACT[place % 3],
            "linewidth": 3.4 - 1.0 * min(place, 2),
            "solid_capstyle": "butt",
        }
        x, y = broken(np.where(flags, longitude, np.nan), latitude)
        axes.plot(x, y, label=short(name) + ("" if flags.any() else ": none"), zorder=2.0 + 0.1 * place, **style)
    axes.plot(*broken(longitude, latitude), color=BLACK, linewidth=0.5, label="ground track", zorder=2.5)
    axes.plot(longitude[:1], latitude[:1], "o", color=BLACK, markersize=4, label="start", zorder=3)


def broken(longitude: Floats, latitude: Floats) -> tuple[Floats, Floats]:
    """The line in degrees with its breaks (nan): at ±180°, drawn up to the edge, and over a pole, drawn up to it.

    Longitudes in [-180, 180]; a nan among them is a gap already.
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


def _marked(axes: Axes, name: str, each: Marked, colour: str, marker: str) -> None:
    """Marker, name, outline, and the way of a sub-satellite point that moves."""
    x, y = each.place.degrees
    axes.plot(*broken(*each.outline.degrees), color=colour, linewidth=1.0, linestyle="-" if marker == "^" else "--")
    axes.plot(*broken(x, y), color=colour, linewidth=_THIN)
    axes.plot(x[:1], y[:1], marker, color=colour, markeredgecolor="white", markersize=7, zorder=4, clip_on=False)
    side = -1 if x[0] > 120.0 else 1
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.8}
    axes.annotate(
        short(name, 24),
        (float(x[0]), float(y[0])),
        (6 * side, 0),
        textcoords="offset points",
        ha="left" if side > 0 else "right",
        va="center",
        fontsize=8,
        bbox=box,
        zorder=5,
    )


# ------------------------------------------------------------------------------------------------ hidden region


def _hidden(axes: Axes, relay: Marked) -> None:
    """Shade the side of the outline on which the relay's sub-satellite point is not."""
    if relay.outlined:
        axes.add_patch(PathPatch(other_side(relay), color=SHADE, linewidth=0.0, zorder=1.0))


def other_side(each: Marked) -> Path:
    """The region of the map (degrees) that a closed outline parts from the marked place."""
    x, y = each.outline.degrees
    x = np.unwrap(x, period=_TURN)
    here = (float(each.place.degrees[0][0]), float(each.place.degrees[1][0]))
    turns = round((x[-1] - x[0]) / _TURN)
    if turns == 0:
        inside = _shifted(np.stack([x, y], axis=1))
        return _complement(inside) if _holds(inside, here) else Path.make_compound_path(*inside)
    # About a pole: the outline runs once around the map, and the region's other edge is that of the map.
    northern, southern = (_shifted(_to_the_pole(x, y, pole)) for pole in (90.0, -90.0))
    return Path.make_compound_path(*(southern if _holds(northern, here) else northern))


def _to_the_pole(x: Floats, y: Floats, pole: float) -> Floats:
    return np.stack([np.r_[x, x[-1], x[0]], np.r_[y, pole, pole]], axis=1)


def _shifted(ring: Floats) -> list[Path]:
    """The ring anticlockwise, here and a turn to either side: what leaves the map at one edge enters at the other."""
    x, y = ring.T
    doubled_area = float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    ring = (ring if doubled_area > 0.0 else ring[::-1]) - [_TURN * round(float(np.mean(x)) / _TURN), 0.0]
    closed = np.vstack([ring, ring[:1]])
    return [Path(closed + np.array([k * _TURN, 0.0]), closed=True) for k in (-1, 0, 1)]


def _holds(paths: list[Path], point: tuple[float, float]) -> bool:
    return any(path.contains_point(point) for path in paths)


def _complement(paths: list[Path]) -> Path:
    """The map but for the paths: its frame runs clockwise, they run anticlockwise."""
    return Path.make_compound_path(Path(np.array(_FRAME), closed=True), *paths)


def _columns(name: str, places: Places) -> dict[str, Floats]:
    longitude, latitude = places.degrees
    return {f"{name}, latitude (deg)": latitude, f"{name}, longitude (deg)": longitude}
