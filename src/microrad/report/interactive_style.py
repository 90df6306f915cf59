"""Colours, dashes, markers, numbers and words of a drawn figure as plotly writes them."""

import html
import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.collections import PathCollection
from matplotlib.colors import to_hex, to_rgba
from matplotlib.lines import Line2D
from matplotlib.markers import MarkerStyle
from matplotlib.path import Path
from numpy.typing import NDArray

from microrad.core.arrays import Floats

MOST_POINTS = 1200  # of a curve; extremes are kept
DIGITS = 6
_PER_POINT = 96.0 / 72.0  # CSS pixels
_PICKS = 5  # of a stretch: lowest and highest of both coordinates, and a gap
_DASHES = {"-": "solid", "--": "dash", "-.": "dashdot", ":": "dot"}
_SYMBOLS = {
    "o": "circle",
    ".": "circle",
    ",": "circle",
    "s": "square",
    "D": "diamond",
    "d": "diamond-tall",
    "^": "triangle-up",
    "v": "triangle-down",
    "<": "triangle-left",
    ">": "triangle-right",
    "x": "x-thin-open",
    "X": "x",
    "+": "cross-thin-open",
    "P": "cross",
    "|": "line-ns-open",
    "_": "line-ew-open",
    "*": "star",
}


class StaticOnlyError(ValueError):
    """A figure holds something that has no interactive form; the message says what."""


def pixels(points: float) -> float:
    """A length in points as CSS pixels."""
    return round(points * _PER_POINT, 2)


def colour(of: Any, alpha: float | None = None) -> str:
    """A colour with its opacity; "" for none."""
    red, green, blue, opacity = to_rgba(of, alpha)
    if opacity == 0.0:
        return ""
    if opacity == 1.0:
        return to_hex((red, green, blue))
    return f"rgba({255 * red:.0f},{255 * green:.0f},{255 * blue:.0f},{opacity:.3g})"


def dash(line: Line2D) -> str:
    """How a line is dashed; "" where no line is drawn between its points."""
    style = line.get_linestyle()
    if style in ("None", "none", " ", ""):
        return ""
    given = getattr(line, "_unscaled_dash_pattern", (0, None))[1]  # a pattern of its own has no public name
    named = getattr(Line2D([], [], linestyle=style), "_unscaled_dash_pattern", (0, None))[1]
    if given is None or given == named:
        return _DASHES.get(str(style), "solid")
    return ",".join(f"{pixels(length * line.get_linewidth()):g}px" for length in given)


def symbol(marker: Any) -> str:
    """Name of a marker; "" for none. Raises StaticOnlyError for one that plotly does not have."""
    if marker in ("None", "none", " ", "", None):
        return ""
    if marker not in _SYMBOLS:
        raise StaticOnlyError(f"marker {marker!r}")
    return _SYMBOLS[marker]


def symbol_of(points: PathCollection) -> str:
    """Name of the marker of a scatter plot, which keeps its outline only."""
    vertices = np.asarray(points.get_paths()[0].vertices)
    for marker, name in _SYMBOLS.items():
        style = MarkerStyle(marker)
        outline = np.asarray(style.get_path().transformed(style.get_transform()).vertices)
        if outline.shape == vertices.shape and np.allclose(outline, vertices):
            return name
    raise StaticOnlyError("a marker of a scatter plot")


def marker_of(line: Line2D) -> dict[str, Any]:
    """The markers of a line."""
    name = symbol(line.get_marker())
    edge, face = colour(line.get_markeredgecolor()), colour(line.get_markerfacecolor())
    size = pixels(float(line.get_markersize()) * (0.5 if line.get_marker() == "." else 1.0))
    return marker(name, size, face, edge, float(line.get_markeredgewidth()))


def marker(name: str, size: float, face: str, edge: str, width: float) -> dict[str, Any]:
    """A marker of plotly: an open one has the colour of its edge."""
    made: dict[str, Any] = {"symbol": name, "size": size, "color": face}
    if name.endswith("-open") or not face:
        made |= {"symbol": name if name.endswith("-open") else f"{name}-open", "color": edge}
    if edge:
        made["line"] = {"color": edge, "width": pixels(width)}
    return made


def numbers(values: Any) -> list[float | int | None]:
    """Numbers with six significant digits, more where they differ by little; None for what is not finite."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    finite = flat[np.isfinite(flat)]
    span, most = (float(np.ptp(finite)), float(np.abs(finite).max())) if finite.size else (0.0, 0.0)
    digits = DIGITS + (max(0, math.floor(math.log10(most / span))) if span > 0.0 else 0)
    return [_short(value, min(digits, 16)) for value in flat.tolist()]


def _short(value: float, digits: int) -> float | int | None:
    if not math.isfinite(value):
        return None
    short = float(f"{value:.{digits}g}")
    return int(short) if short.is_integer() and abs(short) < 1e15 else short


def words(text: str) -> str:
    """A text as plotly's markup: nothing in it is a tag, a link or a place to fill."""
    escaped = html.escape(text, quote=False).replace("%{", "%&#123;")
    return escaped.replace("\n", "<br>")


def thin_curve(x: Floats, y: Floats, most: int = MOST_POINTS) -> NDArray[np.int64]:
    """Places of the points to keep: both ends, and the lowest and highest of both coordinates of each stretch.

    Gaps (nan) stay gaps.
    """
    if x.size <= most:
        return np.arange(x.size)
    for picks in range(2, _PICKS + 1):  # a stretch of a smooth curve has two extremes, its ends
        kept = _of_stretches(x, y, max((most - 2) // picks, 1))
        if kept.size <= most:
            break
    return kept


def _of_stretches(x: Floats, y: Floats, count: int) -> NDArray[np.int64]:
    """Both ends, and of each of ``count`` stretches its extremes and its first gap; of one that is a gap, its first."""
    edges = np.linspace(0, x.size, count + 1, dtype=np.int64)
    first, gaps = edges[:-1], np.isnan(x) | np.isnan(y)
    stretch = np.repeat(np.arange(count), np.diff(edges))
    broken = np.add.reduceat(gaps.astype(np.int64), first) == np.diff(edges)
    picked = [_firsts(gaps, stretch)]
    for values in (x, y):
        for extreme in (np.fmin, np.fmax):
            found = _firsts(values == extreme.reduceat(values, first)[stretch], stretch)
            picked.append(found[~broken[stretch[found]]])
    return np.unique(np.concatenate([[0, x.size - 1], *picked]))


def _firsts(held: NDArray[np.bool_], stretch: NDArray[np.int64]) -> NDArray[np.int64]:
    """Place of the first point of each stretch at which it holds."""
    places = np.flatnonzero(held)
    return places[np.unique(stretch[places], return_index=True)[1]]


def scale_of(colours: Any, count: int = 17) -> list[list[Any]]:
    """A colour map as steps of plotly's scale."""
    return [[round(float(at), 4), to_hex(colours(float(at)))] for at in np.linspace(0.0, 1.0, count)]


def joined(parts: Sequence[str]) -> str:
    """Lines of a hover label; those without words are left out."""
    return "<br>".join(part for part in parts if part)


def outlines(path: Path) -> list[Floats]:
    """Parts (n, 2) of a path of straight lines; a closed one ends where it begins.

    `Path.to_polygons` would simplify them in units of the data.
    """
    vertices = np.asarray(path.vertices, dtype=np.float64)
    if path.codes is None:
        return [vertices] if len(vertices) else []
    codes = np.asarray(path.codes)
    if set(codes.tolist()) - {Path.MOVETO, Path.LINETO, Path.CLOSEPOLY, Path.STOP}:
        raise StaticOnlyError("curved outlines")
    starts = [*np.flatnonzero(codes == Path.MOVETO).tolist(), len(codes)]
    parts = []
    for first, last in pairwise(starts):
        part = vertices[first:last].copy()
        part[codes[first:last] == Path.CLOSEPOLY] = part[0]
        parts.append(part)
    return parts
