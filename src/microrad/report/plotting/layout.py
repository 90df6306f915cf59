"""Where everything of a sheet stands, in points from its top left corner: boxes of data, ticks, titles, legends."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from microrad.report.plotting import scales
from microrad.report.plotting.scales import LINE, height_of, width_of
from microrad.report.plotting.sheet import (
    Area,
    Bars,
    Ends,
    Field,
    Legend,
    Line,
    Panel,
    Rule,
    Sheet,
    Span,
    Words,
    labelled,
)

INCH = 72.0
TICK, PAD = 3.5, 3.0  # length of a tick, and what is free between two things
TITLE = 9.0  # size of titles of axes
SWATCH, SWATCH_GAP, ENTRY_GAP = 20.0, 5.0, 14.0
BAR, BAR_GAP = 11.0, 9.0  # a colour bar, and what is free before it
_LEAST = 30.0  # of a panel
LEAST_MARKER = 3.5  # in a legend
Box = tuple[float, float, float, float]  # left, top, right, bottom
Entry = Line | Rule | Span | Area | Bars


@dataclass(slots=True)
class Key:
    """A legend with its place: its top left corner, the width of each column, and its entries, column by column."""

    of: Legend
    entries: list[Entry]
    width: float
    height: float
    columns: list[float]
    rows: int
    panel: int | None = None
    x: float = 0.0
    y: float = 0.0


@dataclass(slots=True)
class Placed:
    """A panel with its place: the box of its data, the box with ticks and titles, limits and ticks of both axes."""

    panel: Panel
    x_ends: Ends
    y_ends: Ends
    x_shown: bool
    y_shown: bool
    x_title: str
    y_title: str
    inner: Box = (0.0, 0.0, 0.0, 0.0)
    outer: Box = (0.0, 0.0, 0.0, 0.0)
    x_ticks: dict[float, str] = field(default_factory=dict)
    y_ticks: dict[float, str] = field(default_factory=dict)
    bar: Box | None = None
    bar_ticks: dict[float, str] = field(default_factory=dict)

    @property
    def size(self) -> Ends:
        """Width and height of the data's box."""
        return self.inner[2] - self.inner[0], self.inner[3] - self.inner[1]

    @property
    def colours(self) -> Field | None:
        """The field that the colour bar is of."""
        return next((each for each in self.panel.all_of(Field) if each.title), None)

    def within(self, span: Span) -> Ends:
        """The ends of a span; those of the panel in place of infinite ones."""
        low, high = sorted(self.x_ends if span.upright else self.y_ends)
        return low if math.isinf(span.low) else span.low, high if math.isinf(span.high) else span.high


@dataclass(slots=True)
class Layout:
    """A sheet with the places of everything in it."""

    sheet: Sheet
    width: float
    height: float
    placed: list[Placed]
    keys: list[Key]


def layout(sheet: Sheet) -> Layout:
    """Places of everything; where panels leave no room for their data the sheet grows."""
    placed = [_panel(sheet, panel) for panel in sheet.panels]
    width, height = sheet.width * INCH, sheet.height * INCH
    keys = [key for number, each in enumerate(placed) if (key := _key(each.panel.legend, [each.panel], number))]
    whole = _key(sheet.legend, sheet.panels)
    left, top, right, bottom = PAD, PAD, width - PAD, height - PAD
    if sheet.heading:
        top += height_of(sheet.heading, TITLE) + PAD
    if whole is not None:
        top, right, bottom = _outside(whole, left, top, right, bottom)
        keys.append(whole)
    for _ in range(3):  # ticks need a length, which needs the room that ticks take
        sides = [_sides(each, [key for key in keys if key.panel == number]) for number, each in enumerate(placed)]
        grown = _share(sheet, placed, sides, (left, top, right, bottom))
        _ticks(placed)
    height += grown
    for key in keys:
        _place(key, placed)
    return Layout(sheet, width, height, placed, keys)


def _panel(sheet: Sheet, panel: Panel) -> Placed:
    """Limits, and what of ticks and titles is shown where panels share axes."""
    x_like = [each for each in sheet.panels if sheet.share_x or each is panel]
    y_like = [each for each in sheet.panels if sheet.share_y or each is panel]
    last = max(each.row for each in sheet.panels if each.column == panel.column)
    return Placed(
        panel,
        scales.limits(panel.x, "x", x_like),
        scales.limits(panel.y, "y", y_like),
        panel.x.labelled and (not sheet.share_x or panel.row == last),
        panel.y.labelled and (not sheet.share_y or panel.column == 0),
        panel.x.title or next((each.x.title for each in x_like[::-1] if each.x.title), ""),
        panel.y.title or next((each.y.title for each in y_like if each.y.title), ""),
    )


# ------------------------------------------------------------------------------------------------ legends
def _key(legend: Legend | None, panels: Sequence[Panel], number: int | None = None) -> Key | None:
    """The legend of panels with the size that it needs, of the one with a ``number`` or of a whole sheet."""
    if legend is None:
        return None
    entries = [_seen(each) for each in legend.only or labelled([mark for panel in panels for mark in panel.marks])]
    if not entries:
        return None
    rows = -(-len(entries) // legend.columns)
    parts = [entries[k : k + rows] for k in range(0, len(entries), rows)]
    columns = [SWATCH + SWATCH_GAP + max(width_of(each.label, legend.size) for each in part) for part in parts]
    lines = [max(each.label.count("\n") + 1 for each in entries[k::rows]) for k in range(rows)]
    height = LINE * 1.15 * legend.size * (sum(lines) + (1 if legend.title else 0))
    width = max(sum(columns) + ENTRY_GAP * (len(columns) - 1), width_of(legend.title, legend.size))
    return Key(legend, entries, width, height, columns, rows, number)


def _seen(entry: Entry) -> Entry:
    """The entry with a marker large enough to be seen."""
    if not isinstance(entry, Line) or not entry.marker:
        return entry
    return replace(entry, size=max(entry.size, 2.0 * LEAST_MARKER if entry.marker == "." else LEAST_MARKER))


def _outside(key: Key, left: float, top: float, right: float, bottom: float) -> tuple[float, float, float]:
    """Place the legend of a sheet at its edge; the top, right and bottom of what is left."""
    middle = left + (right - left - key.width) / 2.0
    if key.of.place == "below":
        key.x, key.y = middle, bottom - key.height
        return top, right, bottom - key.height - 2 * PAD
    if key.of.place in ("right", "upper right", "lower right"):
        key.x, key.y = right - key.width, bottom - key.height if key.of.place == "lower right" else top + 2 * PAD
        return top, right - key.width - 3 * PAD, bottom
    key.x, key.y = middle, top
    return top + key.height + 2 * PAD, right, bottom


def _place(key: Key, placed: Sequence[Placed]) -> None:
    """Place the legend of a panel in, above or below its data."""
    if key.panel is None:
        return
    of = placed[key.panel]
    left, top, right, bottom = of.inner
    middle = min(left + (right - left - key.width) / 2.0, of.outer[2] - key.width)
    corners = {
        "upper right": (right - key.width - 2 * PAD, top + PAD),
        "upper left": (left + 2 * PAD, top + PAD),
        "lower left": (left + 2 * PAD, bottom - key.height - PAD),
        "lower right": (right - key.width - 2 * PAD, bottom - key.height - PAD),
    }
    if key.of.place == "above":
        key.x, key.y = middle, of.outer[1]
    elif key.of.place == "below":
        key.x, key.y = middle, of.outer[3] - key.height
    elif key.of.place in corners:
        key.x, key.y = corners[key.of.place]
    else:
        key.x, key.y = min(corners.values(), key=lambda corner: _covered(of, key, *corner))


def _covered(of: Placed, key: Key, x: float, y: float) -> int:
    """How many points of curves, and how many bars, lie under a legend there."""
    count = 0
    for mark in of.panel.marks:
        if isinstance(mark, Line) and mark.x.size:
            a, b = at(of, mark.x, mark.y)
            count += int(np.sum((a > x) & (a < x + key.width) & (b > y) & (b < y + key.height)))
        elif isinstance(mark, Bars):
            (a, c), (b, d) = (np.sort(pair, axis=0) for pair in corners(of, mark))
            count += int(np.sum((c > x) & (a < x + key.width) & (d > y) & (b < y + key.height)))
    return count


def corners(of: Placed, bars: Bars) -> tuple[np.ndarray, np.ndarray]:
    """Places of two opposite corners of bars, across and down, (2, n) each.

    Args:
        of: the panel in its place.
        bars: drawn in it.
    """
    half = bars.breadth / 2.0
    along, across = np.stack([bars.start, bars.end]), np.stack([bars.at - half, bars.at + half])
    return at(of, across, along) if bars.upright else at(of, along, across)


def at(of: Placed, x: object, y: object) -> tuple[np.ndarray, np.ndarray]:
    """Points from the top left corner of the sheet for values of both axes.

    Args:
        of: the panel in its place.
        x: on the horizontal axis, (n,).
        y: on the upright axis, (n,).
    """
    left, top, right, bottom = of.inner
    across = scales.place(of.panel.x, np.asarray(x, dtype=np.float64), of.x_ends)
    up = scales.place(of.panel.y, np.asarray(y, dtype=np.float64), of.y_ends)
    return left + across * (right - left), bottom - up * (bottom - top)


# ------------------------------------------------------------------------------------------------ room
def _sides(of: Placed, keys: Sequence[Key]) -> Box:
    """Room that ticks, titles, legends and texts need at the left, above, at the right and below of the data."""
    panel = of.panel
    x_texts, y_texts = [*of.x_ticks.values()], [*of.y_ticks.values()]
    left = TICK + PAD + max((width_of(text, panel.y.size) for text in y_texts), default=0.0) if of.y_shown else PAD
    left += height_of(panel.y.title, TITLE) + PAD if panel.y.title else 0.0
    bottom = TICK + PAD + max((height_of(text, panel.x.size) for text in x_texts), default=0.0) if of.x_shown else PAD
    bottom += height_of(panel.x.title, TITLE) + PAD if panel.x.title else 0.0
    top = height_of(panel.title, panel.title_size) + PAD if panel.title else 0.6 * TITLE
    ends = [*x_texts][-1:] if of.x_shown else []
    right = max([2 * PAD, *(width_of(text, panel.x.size) / 2.0 for text in ends)])
    beside = [w for w in panel.all_of(Words) if "x" in w.of_panel and w.x == 1.0 and w.anchor == "start"]
    right = max([right, *(w.shift[0] + width_of(w.text, w.size) + PAD for w in beside)])
    if (field_ := of.colours) is not None:
        widest = max(map(len, scales.texts([field_.low, field_.high])))
        right = BAR_GAP + BAR + TICK + PAD + width_of("0" * widest, TITLE) + height_of(field_.title, TITLE) + 2 * PAD
    for key in keys:
        top += key.height + PAD if key.of.place == "above" else 0.0
        bottom += key.height + PAD if key.of.place == "below" else 0.0
    return left, top, right, bottom


def _share(sheet: Sheet, placed: Sequence[Placed], sides: Sequence[Box], room: Box) -> float:
    """Give each panel its box; returns by how much the sheet grows for it."""
    columns, rows = range(len(sheet.widths)), range(len(sheet.heights))
    panels = [each.panel for each in placed]

    def most(side: int, at: Sequence[int], numbers: range) -> list[float]:
        """The room at a side of the panels in each column or row, which ``at`` has by panel."""
        return [
            max((each[side] for each, place in zip(sides, at, strict=True) if place == number), default=0.0)
            for number in numbers
        ]

    left = most(0, [panel.column for panel in panels], columns)
    right = most(2, [panel.column + panel.columns - 1 for panel in panels], columns)
    top, bottom = (most(side, [panel.row for panel in panels], rows) for side in (1, 3))
    across = room[2] - room[0] - sum(left) - sum(right)
    down = room[3] - room[1] - sum(top) - sum(bottom)
    wide = [max(across * share / sum(sheet.widths), _LEAST) for share in sheet.widths]
    high = [max(down * share / sum(sheet.heights), _LEAST) for share in sheet.heights]
    grown = sum(high) - down
    x = [room[0] + sum(left[:c]) + sum(wide[:c]) + sum(right[:c]) for c in columns]
    y = [room[1] + sum(top[:r]) + sum(high[:r]) + sum(bottom[:r]) for r in rows]
    for each, side in zip(placed, sides, strict=True):
        c, r = each.panel.column, each.panel.row
        last = c + each.panel.columns - 1
        a, b = x[c] + left[c], y[r] + top[r]
        each.inner = (a, b, x[last] + left[last] + wide[last], b + high[r])
        if each.panel.equal:
            each.inner = _equal(each)
        each.outer = (a - side[0], b - side[1], each.inner[2] + side[2], each.inner[3] + side[3])
        if each.colours is not None:
            each.bar = (each.inner[2] + BAR_GAP, b, each.inner[2] + BAR_GAP + BAR, each.inner[3])
    return grown if grown > 1e-9 else 0.0


def _equal(of: Placed) -> Box:
    """The largest box in the middle of the panel's on which both axes have the same scale."""
    left, top, right, bottom = of.inner
    ratio = abs((of.y_ends[1] - of.y_ends[0]) / (of.x_ends[1] - of.x_ends[0]))
    wide, high = right - left, bottom - top
    wide, high = min(wide, high / ratio), min(high, wide * ratio)
    a, b = left + (right - left - wide) / 2.0, top + (bottom - top - high) / 2.0
    return a, b, a + wide, b + high


def _ticks(placed: Sequence[Placed]) -> None:
    for each in placed:
        each.x_ticks = scales.ticks(each.panel.x, "x", each.x_ends, each.size[0])
        each.y_ticks = scales.ticks(each.panel.y, "y", each.y_ends, each.size[1])
        if (field_ := each.colours) is not None:
            found = [*field_.ticks] or scales.rounds(field_.low, field_.high, 8)
            each.bar_ticks = dict(zip(found, scales.texts(found), strict=True))
