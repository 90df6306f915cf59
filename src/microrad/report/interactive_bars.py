"""Bars, broken bars and steps as plotly's bars, each with the row or bin that it stands for in its hover label."""

from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.container import BarContainer
from matplotlib.patches import Rectangle, StepPatch
from matplotlib.path import Path

from microrad.core.arrays import Floats
from microrad.report.interactive_axes import Side, spoken
from microrad.report.interactive_sheet import Look, Pen, label_of, look_of
from microrad.report.interactive_style import StaticOnlyError, colour, joined, numbers, pixels, words

_VALUE = "%{@:.5~g}"


def bars(pen: Pen) -> set[int]:
    """Bars of one colour and direction as one trace, those that lie on others as one behind it.

    Returns what has been turned.
    """
    groups: dict[tuple[int, bool, str, Look], list[Rectangle]] = {}
    containers = [each for each in pen.axes.containers if isinstance(each, BarContainer)]
    before: list[tuple[Rectangle, Look]] = []
    for each in containers:
        for bar in each.patches:
            look = look_of(bar)
            layer = sum(other != look and _on(bar, under) for under, other in before)
            groups.setdefault((layer, each.orientation == "horizontal", label_of(each), look), []).append(bar)
            before.append((bar, look))
    for (_, flat, label, look), several in sorted(groups.items(), key=lambda group: group[0][0]):
        made = np.array([[b.get_x(), b.get_y(), b.get_width(), b.get_height()] for b in several])
        pen.add(boxes(pen, made, flat, look), label, look)
    return {id(bar) for each in containers for bar in each.patches}


def _on(bar: Rectangle, under: Rectangle) -> bool:
    """Whether two bars have some area in common."""
    one, other = bar.get_bbox(), under.get_bbox()
    wide = min(one.xmax, other.xmax) - max(one.xmin, other.xmin)
    high = min(one.ymax, other.ymax) - max(one.ymin, other.ymin)
    return bool(wide > 0.0 and high > 0.0)


def boxes(pen: Pen, made: Floats, flat: bool, look: Look, edge: str = "") -> dict[str, Any]:
    """Bars from boxes (n, 4): left, bottom, width, height; ``flat`` ones lie along x."""
    left, bottom, wide, high = made.T
    base, length, centre, breadth = (left, wide, bottom + high / 2, high)
    if not flat:
        base, length, centre, breadth = (bottom, high, left + wide / 2, wide)
    along, across = ("x", "y") if flat else ("y", "x")
    return {
        "type": "bar",
        "orientation": "h" if flat else "v",
        along: numbers(length),
        across: numbers(centre),
        "width": numbers(breadth),
        "base": numbers(base),
        "marker": {"color": look.colour, "line": {"width": 0.5 if edge else 0, "color": edge or look.colour}},
        "hovertext": _said(pen, np.stack([base, base + length, centre - breadth / 2, centre + breadth / 2], 1), flat),
        "hovertemplate": "%{hovertext}<extra>%{fullData.name}</extra>",
    }


def _said(pen: Pen, ends: Floats, flat: bool) -> list[str]:
    """Hover labels of bars: the row or the bin, and from where to where the bar goes."""
    value, row = (pen.panel.x, pen.panel.y) if flat else (pen.panel.y, pen.panel.x)
    return [joined([_row(row, low, high), _value(value, start, end)]) for start, end, low, high in ends.tolist()]


def _row(side: Side, low: float, high: float) -> str:
    if side.named:
        return words(side.word((low + high) / 2))
    return spoken(side.title, "@").replace(_VALUE, f"{low:.5g} to {high:.5g}")


def _value(side: Side, start: float, end: float) -> str:
    shown = f"{end:.5g}" if start == 0.0 else f"{start:.5g} to {end:.5g}"
    return spoken(side.title, "@").replace(_VALUE, shown)


def stairs(pen: Pen, drawn: StepPatch) -> None:
    """A histogram: bars where it is filled, else its outline."""
    values, edges, baseline = drawn.get_data()
    floor = np.broadcast_to(0.0 if baseline is None else baseline, len(values))
    if drawn.orientation != "vertical":
        raise StaticOnlyError("steps that run upwards")
    if drawn.get_fill() and colour(drawn.get_facecolor()):
        made, look = np.stack([edges[:-1], floor, np.diff(edges), values - floor], axis=1), look_of(drawn)
        pen.add(boxes(pen, made, False, look), label_of(drawn), look)
        return
    x, y = np.r_[edges[0], edges, edges[-1]], np.r_[floor[0], values, values[-1], floor[-1]]
    style = {"color": colour(drawn.get_edgecolor()), "width": pixels(float(drawn.get_linewidth())), "shape": "hv"}
    outline = {**pen.scatter(x, y, "lines"), "line": style, "hoverinfo": "skip", "hovertemplate": None}
    pen.add(outline, label_of(drawn), Look(str(style["color"]), "solid"))


def broken(pen: Pen, drawn: PolyCollection) -> bool:
    """Bars of a row, where all outlines are upright rectangles; returns whether they are."""
    made = [_rectangle(path) for path in drawn.get_paths()]
    found = [box for box in made if box is not None]
    if len(found) < len(made):
        return False
    if found:
        look, edges = Look(colour(drawn.get_facecolor()[0]), "area"), drawn.get_edgecolor()
        edge = colour(edges[0]) if len(edges) else ""
        pen.add(boxes(pen, np.array(found), True, look, edge), label_of(drawn), look)
    return True


def _rectangle(path: Path) -> list[float] | None:
    """Left, bottom, width and height of a path that is an upright rectangle."""
    points = np.asarray(path.vertices)
    corners = points[:4]
    if len(points) not in (4, 5) or not np.allclose(points[-1], corners[0 if len(points) == 5 else 3]):
        return None
    (left, bottom), (right, top) = corners.min(axis=0), corners.max(axis=0)
    upright = np.isin(corners[:, 0], (left, right)).all() and np.isin(corners[:, 1], (bottom, top)).all()
    return [left, bottom, right - left, top - bottom] if upright else None
