"""Areas, spans, images and contours as plotly's traces and shapes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection, QuadMesh
from matplotlib.colors import Normalize
from matplotlib.contour import ContourSet
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.path import Path

from microrad.core.arrays import Floats
from microrad.report import interactive_bars
from microrad.report.interactive_axes import spoken
from microrad.report.interactive_sheet import Coloured, Grid, Look, Pen, kept_values, label_of, look_of
from microrad.report.interactive_style import (
    StaticOnlyError,
    colour,
    dash,
    numbers,
    outlines,
    pixels,
    scale_of,
    thin_curve,
)

_CLEAR = "rgba(0,0,0,0)"


def polygons(pen: Pen, drawn: PolyCollection) -> None:
    """Bars of a row, or areas of one colour."""
    if not interactive_bars.broken(pen, drawn):
        areas(pen, drawn)


def areas(pen: Pen, drawn: PolyCollection) -> None:
    """Areas of one colour."""
    faces = drawn.get_facecolor()
    if len(faces) > 1:
        raise StaticOnlyError("areas of several colours")
    tint = colour(faces[0]) if len(faces) else ""
    _area(pen, drawn.get_paths(), {"fillcolor": tint or _CLEAR}, label_of(drawn), Look(tint, "area"))


def _area(pen: Pen, paths: Sequence[Path], fill: dict[str, Any], label: str, look: Look) -> None:
    """Closed outlines, filled."""
    x, y = _rings(paths)
    if x.size:
        ring = {"type": "scatter", "mode": "lines", "x": numbers(x), "y": numbers(y), "fill": "toself"}
        edge = {"line": {"width": 0, "color": look.colour or "#000000"}, "hoverinfo": "skip"}
        pen.add({**ring, **edge, **fill}, label, look)


def _rings(paths: Sequence[Path]) -> tuple[Floats, Floats]:
    """Outlines of several parts as one curve with gaps."""
    gap = np.full((1, 2), np.nan)
    rings = [ring for path in paths for ring in outlines(path) if len(ring) > 1]
    parts = [part for ring in rings for part in (ring[thin_curve(*ring.T)], gap)]
    x, y = np.concatenate([gap, *parts])[1:-1].T if parts else np.empty((2, 0))
    return x, y


def patch(pen: Pen, drawn: Patch) -> None:
    """A span over the whole panel, or an outline in the panel's coordinates."""
    inside = drawn.get_data_transform().contains_branch_seperately(pen.axes.transData)
    fill = colour(drawn.get_facecolor()) if drawn.get_fill() else ""
    edge = {"color": colour(drawn.get_edgecolor()), "width": pixels(float(drawn.get_linewidth()))}
    style = {"fillcolor": fill or _CLEAR, "line": edge if edge["color"] else {"width": 0}}
    if drawn.get_hatch():
        raise StaticOnlyError("a hatched patch")
    if isinstance(drawn, Rectangle) and not drawn.get_angle():
        x, y = drawn.get_x() + np.array([0.0, drawn.get_width()]), drawn.get_y() + np.array([0.0, drawn.get_height()])
        pen.shape({**pen.frame("rect", x, y, inside), **style}, label_of(drawn), look_of(drawn))
        return
    if not all(inside):
        raise StaticOnlyError(type(drawn).__name__)
    path = _svg_path(drawn.get_patch_transform().transform_path(drawn.get_path()))
    refs = {"xref": pen.panel.x.name, "yref": pen.panel.y.name, "layer": "between"}
    pen.shape({"type": "path", "path": path, "fillrule": "evenodd", **refs, **style}, label_of(drawn), look_of(drawn))


def _svg_path(path: Path) -> str:
    """Outlines as the text of an SVG path in data coordinates."""
    parts = []
    for ring in outlines(path):
        x, y = (numbers(values) for values in ring[thin_curve(*ring.T)].T)
        parts.append("M" + "L".join(f"{a},{b}" for a, b in zip(x, y, strict=True)) + "Z")
    return "".join(parts)


# ------------------------------------------------------------------------------------------------ values as colours
def image(pen: Pen, drawn: AxesImage) -> None:
    """A picture of values, its rows and columns at their centres."""
    values = np.ma.filled(np.ma.asarray(drawn.get_array(), dtype=np.float64), np.nan)
    if values.ndim != 2:
        raise StaticOnlyError("a picture without values")
    left, right, bottom, top = drawn.get_extent()
    rows, columns = values.shape
    x = left + (np.arange(columns) + 0.5) * (right - left) / columns
    y = bottom + (np.arange(rows) + 0.5) * (top - bottom) / rows
    _field(pen, drawn, Grid(x, y, values if drawn.origin == "lower" else values[::-1]))


def mesh(pen: Pen, drawn: QuadMesh) -> None:
    """Fields between lines of a grid."""
    corners = np.asarray(drawn.get_coordinates())
    x, y = corners[0, :, 0], corners[:, 0, 1]
    values = np.ma.filled(np.ma.asarray(drawn.get_array(), dtype=np.float64), np.nan)
    if not (np.allclose(corners[..., 0], x) and np.allclose(corners[..., 1], y[:, None])):
        raise StaticOnlyError("a mesh that is not a grid")
    if values.size != (x.size - 1) * (y.size - 1):
        raise StaticOnlyError("a shaded mesh")
    _field(pen, drawn, Grid(x, y, values.reshape(y.size - 1, x.size - 1)))


def _field(pen: Pen, drawn: Any, grid: Grid) -> None:
    """Fields of colour; x and y are their centres or their edges."""
    trace = {"type": "heatmap", **_values(pen, drawn, grid)}
    if pen.panel.x.named or pen.panel.y.named:
        trace["text"] = [[pen.at(a, b) for a in grid.x] for b in grid.y]
    pen.sheet.coloured.append(Coloured(pen.add(trace, "", Look("")), drawn))


def _values(pen: Pen, drawn: Any, grid: Grid) -> dict[str, Any]:
    if type(drawn.norm) is not Normalize:
        raise StaticOnlyError("colours that are not linear in their values")
    title = drawn.colorbar.ax.get_ylabel() if drawn.colorbar is not None else pen.axes.get_title(loc="left")
    z = np.reshape(np.array(numbers(grid.z), dtype=object), grid.z.shape).tolist()
    low, high = numbers([drawn.norm.vmin, drawn.norm.vmax])
    limits = {"zauto": False, "zmin": low, "zmax": high, "showscale": False}
    scale = {"z": z, "x": numbers(grid.x), "y": numbers(grid.y), "colorscale": scale_of(drawn.cmap)}
    return {**scale, **limits, **pen.hover(spoken(title, "z"))}


def contours(pen: Pen, drawn: ContourSet) -> None:
    """Filled contours with their values, hatched ones as areas, others as one curve a level."""
    hatches = [hatch for hatch in (drawn.hatches or []) if hatch]
    if drawn.filled and hatches:
        pattern = {"shape": hatches[0][0], "size": 6, "solidity": 0.15, "fgcolor": "#000000", "bgcolor": _CLEAR}
        _area(pen, drawn.get_paths(), {"fillpattern": pattern}, label_of(drawn), Look(""))
    elif drawn.filled:
        _filled(pen, drawn)
    else:
        _levels(pen, drawn)


def _filled(pen: Pen, drawn: ContourSet) -> None:
    grid, levels = kept_values(drawn), np.asarray(drawn.levels, dtype=np.float64)
    if grid is None or not np.allclose(np.diff(levels), levels[1] - levels[0]):
        raise StaticOnlyError("filled contours without their values, or at uneven levels")
    steps = {"start": float(levels[0]), "end": float(levels[-1]), "size": float(levels[1] - levels[0])}
    trace = {"type": "contour", **_values(pen, drawn, grid), "contours": {**steps, "coloring": "fill"}}
    number = pen.add({**trace, "line": {"width": 0}}, "", Look(""))
    pen.sheet.coloured.append(Coloured(number, drawn))


def _levels(pen: Pen, drawn: ContourSet) -> None:
    count = len(list(drawn.levels))
    tints, widths = drawn.get_edgecolor(), np.resize(np.ravel(drawn.get_linewidth()), count)
    styles = np.resize(np.ravel(np.asarray(drawn.linestyles or "solid", dtype=object)), count)
    for number, path in enumerate(drawn.get_paths()):
        x, y = _rings([path])
        if x.size:
            dashes = dash(Line2D([], [], linestyle=styles[number]))
            style = {"color": colour(tints[number % len(tints)]), "width": pixels(float(widths[number]))}
            curve = {"type": "scatter", "mode": "lines", "x": numbers(x), "y": numbers(y), "hoverinfo": "skip"}
            look = Look(str(style["color"]), dashes)
            pen.add({**curve, "line": {**style, "dash": dashes}}, label_of(drawn), look)
