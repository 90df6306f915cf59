"""A figure as data: panels with axes, and in them curves, rules, spans, areas, bars, fields and words.

Nothing here draws. `svg` makes the static picture of a sheet, `interactive` what the page's script draws it from.
Lengths are points; colours are "#rrggbb"; a dash is "-", "--", "-.", ":", "" for none, or lengths of lines and gaps in
widths of the line.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.report.plotting.palette import BLACK, GREY, thinned

Dash = str | tuple[float, ...]
Ends = tuple[float, float]
Place = Literal["above", "below", "right", "upper left", "upper right", "lower left", "lower right", "best"]
WIDTH = 7.6
"""Of most sheets, in inches."""
_Mark = TypeVar("_Mark", bound="Mark")


@dataclass(frozen=True, slots=True)
class Line:
    """A curve through x and y (n,), its markers, or both; a nan is a gap.

    ``marker`` is one of "o", ".", "s", "D", "^", "x" and "|", with ``every`` at those points only. ``face`` is the
    colour inside of a marker, ``edge`` that around it, both as the line unless given; "" is none. ``x_arms`` and
    ``y_arms`` are lengths (2, n) of error bars downwards and upwards. ``label`` stands in the legend, ``name`` is what
    a curve without a label is called when it is pointed at. A curve without points is an entry of the legend alone.
    Of one that is ``whole``, or runs in ``steps``, no point is left out where it has many.
    """

    x: Floats
    y: Floats
    colour: str = BLACK
    dash: Dash = "-"
    width: float = 1.3
    label: str = ""
    name: str = ""
    marker: str = ""
    size: float = 6.0
    face: str | None = None
    edge: str | None = None
    edge_width: float = 1.0
    every: Sequence[int] | None = None
    x_arms: Floats | None = None
    y_arms: Floats | None = None
    steps: bool = False
    whole: bool = False
    clip: bool = True

    @property
    def kept(self) -> NDArray[np.int64]:
        """Places of the points that are drawn."""
        return np.arange(self.x.size) if self.steps or self.whole else thinned(self.x, self.y)

    @property
    def inside(self) -> str:
        """Colour inside of a marker; "" where it is open."""
        return self.colour if self.face is None else self.face

    @property
    def around(self) -> str:
        """Colour around a marker."""
        return self.colour if self.edge is None else self.edge


@dataclass(frozen=True, slots=True)
class Rule:
    """A line across the panel: an upright one at a value of x, else one at a value of y."""

    at: float
    upright: bool
    colour: str = BLACK
    dash: Dash = "-"
    width: float = 1.0
    label: str = ""


@dataclass(frozen=True, slots=True)
class Span:
    """A shade across the panel: an upright one between two values of x, else one between two of y.

    An infinite end is that of the panel.
    """

    low: float
    high: float
    upright: bool
    colour: str
    opacity: float = 0.3
    label: str = ""


@dataclass(frozen=True, slots=True)
class Area:
    """Closed rings (n, 2), filled where an odd number of them is around, or hatched."""

    rings: tuple[Floats, ...]
    colour: str
    opacity: float = 1.0
    label: str = ""
    edge: str = ""
    edge_width: float = 0.4
    hatched: bool = False


@dataclass(frozen=True, slots=True)
class Bars:
    """Bars of one colour from ``start`` to ``end`` (n,) about ``at`` (n,), lying along x unless upright."""

    at: Floats
    start: Floats
    end: Floats
    breadth: Floats
    colour: str
    upright: bool = False
    opacity: float = 1.0
    edge: str = ""
    label: str = ""


@dataclass(frozen=True, slots=True)
class Field:
    """Values (m, n) as colours over the middles x (n,) and y (m,) of their cells, between ``low`` and ``high``.

    With ``levels``, evenly apart, the colours change at those and x and y are points. ``title`` and ``ticks`` are those
    of the colour bar, which a field without a title has not.
    """

    x: Floats
    y: Floats
    z: Floats
    low: float
    high: float
    title: str = ""
    levels: Floats | None = None
    ticks: Sequence[float] = ()
    spoken: str = ""


@dataclass(frozen=True, slots=True)
class Words:
    """A text at a place: in data, or in parts of the panel along an axis that is named in ``of_panel`` ("x", "xy").

    ``anchor`` and ``base`` say which of its sides stands there; ``shift`` moves it by points to the right and up.
    """

    text: str
    x: float
    y: float
    colour: str = BLACK
    size: float = 8.0
    anchor: Literal["start", "middle", "end"] = "start"
    base: Literal["top", "middle", "bottom"] = "middle"
    shift: Ends = (0.0, 0.0)
    of_panel: str = ""
    box: bool = False


Mark = Line | Rule | Span | Area | Bars | Field | Words


@dataclass(slots=True)
class Axis:
    """One axis: its title with unit, its scale, and limits, which follow from the data where they are None.

    ``ticks`` are places, with words where they have any; without them they follow from the limits. ``most`` bounds
    their number. Limits may be turned: the first row of bars is on top then.
    """

    title: str = ""
    log: bool = False
    low: float | None = None
    high: float | None = None
    ticks: Mapping[float, str] | Sequence[float] | None = None
    most: int = 9
    grid: bool = True
    size: float = 9.0
    labelled: bool = True

    @property
    def words(self) -> dict[float, str]:
        """Ticks with words of their own; empty where they have none."""
        return {float(at): text for at, text in self.ticks.items()} if isinstance(self.ticks, Mapping) else {}


@dataclass(frozen=True, slots=True)
class Legend:
    """Where the labels of a panel or of a sheet stand, and in how many columns."""

    place: Place = "best"
    columns: int = 1
    title: str = ""
    colour: str = BLACK
    size: float = 8.0
    only: tuple[Line | Area, ...] = ()  # these entries in place of those of the marks


@dataclass(slots=True)
class Panel:
    """A pair of axes with what they show, in the order in which it is drawn."""

    row: int
    column: int
    columns: int = 1
    x: Axis = field(default_factory=Axis)
    y: Axis = field(default_factory=Axis)
    marks: list[Mark] = field(default_factory=list)
    title: str = ""
    title_size: float = 9.0
    legend: Legend | None = None
    face: str = ""
    framed: bool = False
    equal: bool = False

    def add(self, *marks: Mark) -> None:
        """Draw more, over what is there."""
        self.marks += marks

    def all_of(self, kind: type[_Mark]) -> list[_Mark]:
        """The marks of a kind."""
        return [mark for mark in self.marks if isinstance(mark, kind)]


@dataclass(slots=True)
class Sheet:
    """Panels on a grid of rows and columns, on a sheet of a width and a height in inches.

    ``heights`` and ``widths`` are the shares of rows and columns. Panels that share an axis have its limits in common,
    and its ticks at the outer ones only. ``heading`` stands above all of them at the right or at the left, and in the
    middle of a sheet without panels.
    """

    width: float
    height: float
    heights: tuple[float, ...] = (1.0,)
    widths: tuple[float, ...] = (1.0,)
    share_x: bool = False
    share_y: bool = False
    legend: Legend | None = None
    heading: str = ""
    heading_colour: str = BLACK
    heading_at_left: bool = False
    panels: list[Panel] = field(default_factory=list)

    def panel(self, row: int = 0, column: int = 0, columns: int = 1) -> Panel:
        """A new panel at a place of the grid.

        Args:
            row: from 0 on top.
            column: from 0 at the left.
            columns: over how many it goes.
        """
        self.panels.append(Panel(row, column, columns))
        return self.panels[-1]


def grid(width: float, height: float, rows: int = 1, columns: int = 1, **more: bool) -> tuple[Sheet, list[Panel]]:
    """A sheet with a panel in each field of its grid, row by row.

    Args:
        width: of the sheet, inches.
        height: of the sheet, inches.
        rows: of the grid.
        columns: of the grid.
        more: further fields of the sheet.
    """
    sheet = Sheet(width, height, (1.0,) * rows, (1.0,) * columns, **more)  # type: ignore[arg-type]
    return sheet, [sheet.panel(row, column) for row in range(rows) for column in range(columns)]


def rows(texts: Sequence[str], size: float = 8.0) -> Axis:
    """An upright axis with a text at each row from 0 on, the first on top.

    Args:
        texts: from the top.
        size: of its letters, points.
    """
    return Axis(low=len(texts) - 0.4, high=-0.6, ticks=dict(enumerate(texts)), size=size, grid=False)


def between(x: Floats, low: Floats, high: Floats, colour: str, opacity: float, label: str = "") -> Area:
    """The area between two curves, parted where one of them is nan.

    Args:
        x: (n,).
        low: (n,).
        high: (n,).
        colour: "#rrggbb".
        opacity: 0 to 1.
        label: for the legend.
    """
    known = np.isfinite(low) & np.isfinite(high)
    parts = np.split(np.arange(x.size), np.flatnonzero(np.diff(known.astype(np.int8))) + 1)
    rings = tuple(
        np.stack([np.r_[x[part], x[part][::-1]], np.r_[low[part], high[part][::-1]]], axis=1)
        for part in parts
        if part.size and known[part[0]]
    )
    return Area(rings, colour, opacity, label)


def segments(x: Floats, low: Floats | float, high: Floats, colour: str, width: float) -> Line:
    """Upright strokes from low to high at each x, as one curve with gaps.

    Args:
        x: (n,).
        low: (n,), or one for all.
        high: (n,).
        colour: "#rrggbb".
        width: points.
    """
    low = np.broadcast_to(low, x.shape)
    gaps = np.full(x.shape, np.nan)
    return Line(np.repeat(x, 3), np.stack([low, high, gaps], axis=1).ravel(), colour, width=width, whole=True)


def stairs(edges: Floats, values: Floats, colour: str, edge: str) -> tuple[Bars, Line]:
    """A histogram: bars, and their outline.

    Args:
        edges: (n + 1,).
        values: (n,).
        colour: of the bars.
        edge: colour of the outline.
    """
    zeros = np.zeros(values.size)
    bars = Bars((edges[:-1] + edges[1:]) / 2.0, zeros, values, np.diff(edges), colour, upright=True)
    x, y = np.repeat(edges, 2), np.r_[0.0, np.repeat(values, 2), 0.0]
    return bars, Line(x, y, edge, width=0.8)


def contour(x: Floats, y: Floats, z: Floats, level: float) -> tuple[Floats, Floats]:
    """Where values have a level, as one curve with gaps.

    Args:
        x: (n,).
        y: (m,).
        z: (m, n).
        level: of z.
    """
    import contourpy

    lines = [line for line in contourpy.contour_generator(x, y, z).lines(level) if len(line)]
    gap = np.full((1, 2), np.nan)
    points = np.concatenate([gap, *(part for line in lines for part in (line, gap))])[1:-1] if lines else gap[:0]
    return points[:, 0], points[:, 1]


def region(x: Floats, y: Floats, z: Floats, least: float, most: float) -> tuple[Floats, ...]:
    """Rings around where the values lie between two levels.

    Args:
        x: (n,).
        y: (m,).
        z: (m, n).
        least: lower level.
        most: upper level.
    """
    import contourpy

    filled: Any = contourpy.contour_generator(x, y, z, fill_type="OuterOffset").filled(least, most)
    parts, offsets = filled
    return tuple(
        np.asarray(points[first:last])
        for points, offset in zip(parts, offsets, strict=True)
        for first, last in itertools.pairwise(offset)
    )


def labelled(marks: Sequence[Mark]) -> Iterator[Line | Rule | Span | Area | Bars]:
    """Marks with a label, the first of each."""
    seen: set[str] = set()
    for mark in marks:
        if not isinstance(mark, Field | Words) and mark.label and mark.label not in seen:
            seen.add(mark.label)
            yield mark


def shortened(name: str, most: int = 34) -> str:
    """The name as it stands in a figure: on one line, and cut where data would have no room.

    Args:
        name: of any length.
        most: characters.
    """
    plain = " ".join("".join(c if c.isprintable() else " " for c in name).split())
    return plain if len(plain) <= most else plain[: most - 1] + "…"


def empty(words: str) -> Sheet:
    """A picture that says why there is nothing to see."""
    return Sheet(WIDTH, 0.9, heading=words, heading_colour=GREY)
