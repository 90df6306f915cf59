"""Axes of a drawn figure as plotly's: limits, scales, ticks, titles, and where each panel stands in CSS pixels."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.figure import Figure as Canvas
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator, FuncFormatter
from matplotlib.transforms import Bbox

from microrad.report.interactive_style import StaticOnlyError, colour, numbers, pixels, words

_WITH_UNIT = re.compile(r"(?P<name>.*\S)\s*\((?P<unit>[^()]+)\)", re.DOTALL)
_PER_INCH = 96.0
_FONT_PX = 12
_END_PX = (12.0, 8.0)  # right and top
_LINE_PX = 3.0  # a browser's line is higher


@dataclass(frozen=True, slots=True)
class Side:
    """One axis of a panel: plotly's name for it ("x2"), its title, and words that stand for its values, if any."""

    name: str
    of: Axis
    title: str
    named: dict[float, str]

    @property
    def key(self) -> str:
        """Name in plotly's layout."""
        return f"{self.name[0]}axis{self.name[1:]}"

    @property
    def log(self) -> bool:
        """Whether the scale is logarithmic."""
        return self.of.get_scale() == "log"

    def place(self, value: float) -> float:
        """A value as plotly's ranges and annotations have it."""
        return float(np.log10(value)) if self.log else float(value)

    def said(self, placeholder: str) -> str:
        """A value with its name and unit in a hover label; ``placeholder`` is x, y or z."""
        return "" if self.named else spoken(self.title, placeholder)

    def word(self, value: float) -> str:
        """A value in the words of the ticks: those nearest to it, unless they follow from it; "" for plain numbers."""
        if not self.named:
            return ""
        formatter = self.of.get_major_formatter()
        if isinstance(formatter, FuncFormatter):
            text = formatter(value)
        else:
            text = self.named[min(self.named, key=lambda at: abs(at - value))].replace("\n", " ")
        name, unit = _parts(self.title)
        return f"{name}: {text} {unit}".rstrip() if name and text[:1].isdigit() else text


@dataclass(frozen=True, slots=True)
class Panel:
    """Axes that stand in the page by themselves: inner is the box of the data, outer holds ticks and titles, too.

    Boxes are left, top, right, bottom in CSS pixels from the picture's top left corner.
    """

    axes: Axes
    x: Side
    y: Side
    inner: tuple[float, ...]
    outer: tuple[float, ...]
    over: str = ""  # the axis that lies under the second one of a pair


def spoken(title: str, placeholder: str) -> str:
    """Part of a hover label: an axis's title with a value in it, the unit behind the value."""
    name, unit = _parts(title)
    unit = f" {words(unit)}".rstrip().replace(" °", "°")
    return f"{words(name) or placeholder}: %{{{placeholder}:.5~g}}{unit}"


def _parts(title: str) -> tuple[str, str]:
    """Name and unit of an axis's title, in one line; either may be missing."""
    line = " ".join(title.split())
    found = _WITH_UNIT.fullmatch(line)
    return (found["name"], found["unit"]) if found else (line, "")


def panels(canvas: Canvas, left_out: Iterable[Axes]) -> list[Panel]:
    """Panels of a drawn canvas, but for axes left out, such as those of colour bars."""
    shown = [axes for axes in canvas.axes if axes not in set(left_out) and axes.get_visible()]
    made: list[Panel] = []
    for axes in shown:
        if axes.name != "rectilinear" or axes.child_axes:
            raise StaticOnlyError("axes that are not a plain panel")
        made.append(_panel(canvas, axes, made, shown))
    return made


def _panel(canvas: Canvas, axes: Axes, before: list[Panel], shown: list[Axes]) -> Panel:
    number = len(before) + 1
    name = str(number) if number > 1 else ""
    inner = inner_box(canvas, axes)
    under = next((p for p in before if np.allclose(p.inner, inner)), None)
    x, y = (_side(which + name, axes, shown) for which in "xy")
    over = ""
    if under is not None and axes.get_shared_x_axes().joined(axes, under.axes):
        x, over = under.x, under.y.name
    elif under is not None and axes.get_shared_y_axes().joined(axes, under.axes):
        y, over = under.y, under.x.name
    elif under is not None:
        raise StaticOnlyError("panels that lie on one another")
    return Panel(axes, x, y, inner, outer_box(canvas, axes), over)


def _side(name: str, axes: Axes, shown: list[Axes]) -> Side:
    axis = axes.xaxis if name[0] == "x" else axes.yaxis
    if axis.get_scale() not in ("linear", "log"):
        raise StaticOnlyError(f"a {axis.get_scale()} scale")
    title = axis.get_label_text() or _shared_title(name[0], axes, shown)
    return Side(name, axis, title, _names(axis))


def _shared_title(which: str, axes: Axes, shown: list[Axes]) -> str:
    """Title of the axis that this one shares its limits with, where it has none of its own."""
    group = axes.get_shared_x_axes() if which == "x" else axes.get_shared_y_axes()
    others = [other.xaxis if which == "x" else other.yaxis for other in shown if group.joined(axes, other)]
    return next((axis.get_label_text() for axis in others if axis.get_label_text()), "")


def ticks(axis: Axis) -> dict[float, str]:
    """Places and words of ticks that were set; empty where they follow from the limits."""
    locator = axis.get_major_locator()
    if not isinstance(locator, FixedLocator):
        return {}
    at = [float(place) for place in np.asarray(locator())]
    return dict(zip(at, axis.get_major_formatter().format_ticks(at), strict=True))


def _names(axis: Axis) -> dict[float, str]:
    """Words at ticks that stand for something else than the number there."""
    found = ticks(axis)
    return {} if all(_is_number(text, at) for at, text in found.items()) else found


def _is_number(text: str, at: float) -> bool:
    try:
        return bool(np.isclose(float(text.replace("\u2212", "-")), at, rtol=1e-6, atol=1e-12))
    except ValueError:
        return False


# ------------------------------------------------------------------------------------------------ layout
def layout_of(panel: Panel, first_of: dict[str, str]) -> dict[str, Any]:
    """Entries of plotly's layout for both axes of a panel; ``first_of`` names the axis that each one follows."""
    sides = (panel.x, panel.y)
    entries = {}
    for side, other in (sides, sides[::-1]):
        if side.of.axes is panel.axes:
            entries[side.key] = _axis(side, other, first_of.get(side.name, ""), panel.over)
    return entries


def _axis(side: Side, other: Side, follows: str, over: str) -> dict[str, Any]:
    axis, axes = side.of, side.of.axes
    horizontal = side.name[0] == "x"
    low, high = axes.get_xlim() if horizontal else axes.get_ylim()
    spines = [axes.spines[name].get_visible() for name in (("bottom", "top") if horizontal else ("left", "right"))]
    labels = tick_labels(axis)
    made: dict[str, Any] = {
        "type": "log" if side.log else "linear",
        "range": numbers([side.place(low), side.place(high)]),
        "anchor": other.name,
        "showticklabels": labels,
        "ticks": "outside",
        "ticklen": 4,
        "ticklabeloverflow": "allow",
        "gridcolor": "#dddddd",
        "linecolor": "#1b1f24",
        "showgrid": _grid(axis),
        "mirror": all(spines),
        "showline": any(spines),
        "zeroline": False,
        "title": {"text": words(axis.get_label_text()), "standoff": 5},
        "tickfont": {"size": _tick_size(axis)},
        **_tick_layout(side),
    }
    if over.startswith(side.name[0]):
        made |= {"overlaying": over, "side": "top" if horizontal else axis.get_label_position(), "showgrid": False}
    if follows:
        made["matches"] = follows
    if axes.get_aspect() not in ("auto", "none") and not horizontal:
        made |= {"scaleanchor": other.name, "scaleratio": float(axes.get_aspect())}
    return made


def _tick_layout(side: Side) -> dict[str, Any]:
    found = ticks(side.of)
    if side.named or (found and side.log):
        return {"tickmode": "array", "tickvals": numbers([*found]), "ticktext": [words(t) for t in found.values()]}
    if not side.of.get_majorticklocs().size:
        return {"showticklabels": False, "ticks": ""}
    return {"exponentformat": "power", **({"nticks": _decades(side)} if side.log else {"minexponent": 5})}


def _decades(side: Side) -> int:
    """At most so many ticks, so that they stand at powers of ten where several of those are shown."""
    low, high = sorted(side.place(v) for v in side.of.get_view_interval())
    return max(math.ceil(high - low) + 1, 5)


def _grid(axis: Axis) -> bool:
    lines = axis.get_gridlines()
    return bool(lines) and bool(lines[0].get_visible())


def _tick_size(axis: Axis) -> float:
    found = axis.get_major_ticks()
    return pixels(float(found[0].label1.get_fontsize())) if found else _FONT_PX


def tick_labels(axis: Axis) -> bool:
    """Whether numbers stand at the ticks."""
    found = axis.get_major_ticks()
    return bool(found) and any(tick.label1.get_visible() or tick.label2.get_visible() for tick in found)


def common() -> dict[str, Any]:
    """What all panels have in common."""
    return {
        "font": {"size": _FONT_PX, "color": "#1b1f24", "family": "system-ui, DejaVu Sans, sans-serif"},
        "hoverlabel": {"align": "left", "namelength": -1},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "margin": dict.fromkeys("lrtb", 0),
        "showlegend": False,
        "hovermode": "closest",
        "dragmode": "zoom",
        "barmode": "overlay",
    }


def background(panel: Panel) -> str:
    """Colour behind the data; "" for that of the page."""
    return "" if panel.over or colour(panel.axes.get_facecolor()) == "#ffffff" else colour(panel.axes.get_facecolor())


# ------------------------------------------------------------------------------------------------ boxes
def size(canvas: Canvas) -> list[float]:
    """Width and height of the picture in CSS pixels."""
    return [round(float(inches) * _PER_INCH, 1) for inches in canvas.get_size_inches()]


def inner_box(canvas: Canvas, axes: Axes) -> tuple[float, ...]:
    """Where the data are drawn."""
    return _pixels(canvas, axes.get_window_extent())


def outer_box(canvas: Canvas, axes: Axes) -> tuple[float, ...]:
    """Where data, ticks, titles and texts beside the data are drawn."""
    measure = RendererAgg(1, 1, canvas.dpi)  # type: ignore[no-untyped-call]  # the text's own may be that of the SVG, which has other units
    parts: list[Any] = [axes.get_window_extent(), *(axis.get_tightbbox(measure) for axis in (axes.xaxis, axes.yaxis))]
    texts = [child for child in axes.get_children() if isinstance(child, Text)]
    parts += [
        text.get_window_extent(measure).padded(_LINE_PX) for text in texts if text.get_text() and text.get_visible()
    ]
    within = [Bbox.intersection(part, canvas.bbox) for part in parts if part is not None]
    return _pixels(canvas, Bbox.union([_for_ends(canvas, axes), *(part for part in within if part is not None)]))


def _for_ends(canvas: Canvas, axes: Axes) -> Bbox:
    """Room for half of a number at the end of each axis."""
    box, pixel = axes.get_window_extent(), canvas.dpi / _PER_INCH
    return Bbox([[box.x0, box.y0], [box.x1 + _END_PX[0] * pixel, box.y1 + _END_PX[1] * pixel]])


def _pixels(canvas: Canvas, box: Any) -> tuple[float, ...]:
    factor, height = _PER_INCH / canvas.dpi, canvas.bbox.height
    corners = (box.x0, height - box.y1, box.x1, height - box.y0)
    return tuple(round(float(each * factor), 1) for each in corners)
