"""Lines, markers, error bars and scatter plots as plotly's traces; lines across a panel as its shapes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.container import ErrorbarContainer
from matplotlib.lines import Line2D

from microrad.core.arrays import Floats
from microrad.report.interactive_sheet import Look, Pen, label_of, look_of
from microrad.report.interactive_style import (
    StaticOnlyError,
    colour,
    dash,
    marker,
    marker_of,
    numbers,
    pixels,
    symbol_of,
    thin_curve,
    words,
)

_UNNAMED = ("_child", "_nolegend_")
_STEPS = {"default": "linear", "steps": "vh", "steps-pre": "vh", "steps-post": "hv", "steps-mid": "hvh"}


def line(pen: Pen, drawn: Line2D) -> None:
    """A curve, its markers, or both; a line across the panel."""
    x, y = _points(drawn)
    inside = drawn.get_transform().contains_branch_seperately(pen.axes.transData)
    if x.size and not all(inside):
        _across(pen, drawn, x, y, inside)
    elif x.size:
        _curve_and_markers(pen, drawn, x, y)


def _points(drawn: Line2D) -> tuple[Floats, Floats]:
    x, y = drawn.get_data(orig=False)
    return np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)


def _curve_and_markers(pen: Pen, drawn: Line2D, x: Floats, y: Floats) -> None:
    look, label, every = look_of(drawn), label_of(drawn), drawn.get_markevery()
    kept = _kept(drawn, x, y)
    if look.dash and look.marker and every is None and kept.size == x.size:
        pen.add({**curve(pen, drawn, x, y), "mode": "lines+markers", "marker": marker_of(drawn)}, label, look)
        return
    if look.dash:
        pen.add(curve(pen, drawn, x[kept], y[kept]), label, look)
    if look.marker:
        at: Any = slice(None) if every is None else every
        quiet = {"hoverinfo": "skip", "hovertemplate": None} if look.dash else {}
        pen.add({**markers(pen, drawn, x[at], y[at]), **quiet}, label, look)


def _kept(drawn: Line2D, x: Floats, y: Floats) -> Any:
    return thin_curve(x, y) if drawn.get_drawstyle() == "default" else np.arange(x.size)


def curve(pen: Pen, drawn: Line2D, x: Floats, y: Floats) -> dict[str, Any]:
    """Points joined by a line."""
    style = {**_stroke(drawn), "shape": _STEPS[drawn.get_drawstyle()], "simplify": False}
    return {**pen.scatter(x, y, "lines"), "line": style, **_outside(drawn), **quiet_name(drawn)}


def markers(pen: Pen, drawn: Line2D, x: Floats, y: Floats) -> dict[str, Any]:
    """Points by themselves."""
    alpha = {} if drawn.get_alpha() is None else {"opacity": drawn.get_alpha()}
    return {**pen.scatter(x, y, "markers"), "marker": {**marker_of(drawn), **alpha}, **_outside(drawn)}


def quiet_name(drawn: Line2D) -> dict[str, str]:
    """The name of a curve that no legend shows: its label behind an underscore, which matplotlib keeps out of them."""
    label = str(drawn.get_label())
    return {"name": words(label[1:])} if label.startswith("_") and not label.startswith(_UNNAMED) else {}


def _stroke(drawn: Line2D) -> dict[str, Any]:
    tint = colour(drawn.get_color(), drawn.get_alpha())
    return {"color": tint, "width": pixels(float(drawn.get_linewidth())), "dash": dash(drawn)}


def _outside(drawn: Line2D) -> dict[str, Any]:
    return {} if drawn.get_clip_on() else {"cliponaxis": False}


def _across(pen: Pen, drawn: Line2D, x: Floats, y: Floats, inside: Sequence[bool]) -> None:
    """A line over the whole panel, at one value."""
    if x.size != 2 or not all(drawn.get_transform().contains_branch_seperately(pen.axes.transAxes)):
        raise StaticOnlyError("a line that is not in the coordinates of its panel")
    pen.shape({**pen.frame("line", x, y, inside), "line": _stroke(drawn)}, label_of(drawn), look_of(drawn))


def segments(pen: Pen, drawn: LineCollection) -> None:
    """Lines between pairs of points, of one colour, as one curve with gaps."""
    parts = [part for each in drawn.get_segments() for part in (np.asarray(each), np.full((1, 2), np.nan))]
    if len(drawn.get_colors()) > 1:
        raise StaticOnlyError("lines of several colours")
    if parts:
        x, y = np.concatenate(parts)[:-1].T
        style = {"color": colour(drawn.get_colors()[0]), "width": pixels(float(np.ravel(drawn.get_linewidth())[0]))}
        pen.add({**pen.scatter(x, y, "lines"), "line": style}, label_of(drawn), Look(str(style["color"]), "solid"))


def points(pen: Pen, drawn: PathCollection) -> None:
    """A scatter plot of one colour and size."""
    sizes, faces, edges = drawn.get_sizes(), drawn.get_facecolor(), drawn.get_edgecolor()
    if max(len(sizes), len(faces), len(edges)) > 1 or drawn.get_array() is not None:
        raise StaticOnlyError("a scatter plot of several sizes or colours")
    x, y = np.ma.filled(np.ma.asarray(drawn.get_offsets(), dtype=np.float64), np.nan).T
    face, edge = (colour(several[0]) if len(several) else "" for several in (faces, edges))
    name, size = symbol_of(drawn), pixels(float(np.sqrt(sizes[0])))
    dots = marker(name, size, face, edge, float(np.ravel(drawn.get_linewidth())[0]))
    pen.add({**pen.scatter(x, y, "markers"), "marker": dots}, label_of(drawn), Look(face or edge, "", name))


# ------------------------------------------------------------------------------------------------ error bars
def error_bars(axes: Axes) -> tuple[dict[int, ErrorbarContainer], set[int]]:
    """Points with error bars by the identity of their line, and the identities of caps and bars, which go with them.

    Error bars without points between stay lines by themselves.
    """
    several = [each for each in axes.containers if isinstance(each, ErrorbarContainer)]
    found = {id(each.lines[0]): each for each in several if isinstance(each.lines[0], Line2D)}
    return found, {id(part) for each in found.values() for parts in each.lines[1:] for part in parts}


def with_errors(pen: Pen, each: ErrorbarContainer) -> None:
    """Points with their error bars."""
    pen.add(_with_errors(pen, each), label_of(each), look_of(each.lines[0]))


def _with_errors(pen: Pen, each: ErrorbarContainer) -> dict[str, Any]:
    drawn, caps, bars = each.lines
    x, y = _points(drawn)
    made = markers(pen, drawn, x, y)
    if dash(drawn):
        made |= {"mode": "lines+markers", "line": _stroke(drawn)}
    width = pixels(float(caps[0].get_markersize())) / 2 if caps else 0
    directions = [which for which, has in zip("xy", (each.has_xerr, each.has_yerr), strict=True) if has]
    for which, several in zip(directions, bars, strict=True):
        arms = _arms(several, x if which == "x" else y, "xy".index(which))
        stroke = {
            "color": colour(several.get_colors()[0]),
            "thickness": pixels(float(np.ravel(several.get_linewidth())[0])),
        }
        made[f"error_{which}"] = {"type": "data", "symmetric": False, **arms, **stroke, "width": width}
    return made


def _arms(several: LineCollection, centre: Floats, which: int) -> dict[str, Any]:
    ends = np.array(several.get_segments()).reshape(-1, 2, 2)[:, :, which]
    if len(ends) != centre.size:
        raise StaticOnlyError("error bars at some of the points only")
    return {"array": numbers(ends[:, 1] - centre), "arrayminus": numbers(centre - ends[:, 0])}
