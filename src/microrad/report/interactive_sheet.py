"""What has been turned of a figure so far, and the pen that adds to it from one panel."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from matplotlib.contour import ContourSet
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from microrad.core.arrays import Floats
from microrad.report.interactive_axes import Panel
from microrad.report.interactive_style import colour, dash, joined, numbers, symbol, words

_GRID = "_microrad_grid"


class Look(NamedTuple):
    """What a reader tells a thing by: its colour, how a line is dashed (or "area"), and its marker."""

    colour: str
    dash: str = ""
    marker: str = ""


class Mark(NamedTuple):
    """One thing that a legend may switch: in ``data`` or in ``shapes``, its place there, its label and its look."""

    kind: str
    number: int
    label: str
    look: Look


class Grid(NamedTuple):
    """Values (m, n) over x (n,) and y (m,)."""

    x: Floats
    y: Floats
    z: Floats


class Coloured(NamedTuple):
    """A trace whose colours are values: its number, and what was drawn."""

    trace: int
    of: Any


@dataclass(slots=True)
class Sheet:
    """Plotly's traces, shapes and annotations, and what legends and colour bars need to know of them."""

    data: list[dict[str, Any]] = field(default_factory=list)
    shapes: list[dict[str, Any]] = field(default_factory=list)
    annotations: list[dict[str, Any]] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)
    coloured: list[Coloured] = field(default_factory=list)


def keep_values(contours: ContourSet, x: Floats, y: Floats, z: Floats) -> None:
    """Give filled contours the values (m, n) over x (n,) and y (m,) that they were drawn from: they keep none."""
    setattr(contours, _GRID, Grid(x, y, z))


def kept_values(contours: ContourSet) -> Grid | None:
    """What `keep_values` gave them."""
    return getattr(contours, _GRID, None)


def look_of(artist: Any) -> Look:
    """The look of a line or of an area; one without a colour where it is neither."""
    if isinstance(artist, Line2D):
        return Look(colour(artist.get_color()), dash(artist), symbol(artist.get_marker()))
    return Look(colour(artist.get_facecolor()), "area") if isinstance(artist, Patch) else Look("")


def label_of(artist: Any) -> str:
    """Its label as a legend shows it; "" where it shows none."""
    label = artist.get_label()
    return label if isinstance(label, str) and not label.startswith("_") else ""


class Pen:
    """Adds what is drawn in one panel to the sheet."""

    def __init__(self, panel: Panel, sheet: Sheet) -> None:
        """A pen for one panel."""
        self.panel, self.sheet, self.axes = panel, sheet, panel.axes
        self._refs = {"xaxis": panel.x.name, "yaxis": panel.y.name}

    def add(self, trace: dict[str, Any], label: str, look: Look) -> int:
        """Add a trace, named by its label; returns its number."""
        self.sheet.data.append({**self._refs, "name": words(label), **trace})
        number = len(self.sheet.data) - 1
        self.sheet.marks.append(Mark("data", number, label, look))
        return number

    def shape(self, shape: dict[str, Any], label: str, look: Look) -> None:
        """Add a shape."""
        self.sheet.shapes.append(shape)
        self.sheet.marks.append(Mark("shapes", len(self.sheet.shapes) - 1, label, look))

    def hover(self, *more: str) -> dict[str, Any]:
        """Hover label with both values and more, each with its name and unit, beside the name of the curve."""
        x, y = self.panel.x, self.panel.y
        parts = ["%{text}" if x.named or y.named else "", x.said("x"), y.said("y"), *more]
        return {"hovertemplate": f"{joined(parts)}<extra>%{{fullData.name}}</extra>"}

    def at(self, x: float, y: float) -> str:
        """The words at the ticks next to a point, where an axis has words."""
        return joined([words(self.panel.y.word(y)), words(self.panel.x.word(x))])

    def scatter(self, x: Floats, y: Floats, mode: str) -> dict[str, Any]:
        """Points or a curve."""
        made = {"type": "scatter", "mode": mode, "x": numbers(x), "y": numbers(y), **self.hover()}
        if self.panel.x.named or self.panel.y.named:
            made["text"] = [self.at(a, b) for a, b in zip(np.ravel(x), np.ravel(y), strict=True)]
        return made

    def frame(self, kind: str, x: Floats, y: Floats, inside: Sequence[bool]) -> dict[str, Any]:
        """A shape between two corners; ``inside`` says of x and of y whether they are data or parts of the panel."""
        layer = "above" if kind == "line" else "between" if all(inside) else "below"  # plotly knows no other
        ends: dict[str, Any] = {"type": kind, "layer": layer}
        for which, name, values, data in zip("xy", self._refs.values(), (x, y), inside, strict=True):
            first, last = numbers(values)
            ends |= {f"{which}0": first, f"{which}1": last, f"{which}ref": name if data else f"{name} domain"}
        return ends
