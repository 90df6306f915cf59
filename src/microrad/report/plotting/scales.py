"""Limits of axes, round ticks between them and their texts, and how wide a text is."""

import itertools
import math
import unicodedata
from collections.abc import Iterator, Sequence

import numpy as np

from microrad.core.arrays import Floats
from microrad.report.plotting.sheet import Area, Axis, Bars, Field, Line, Mark, Panel, Rule, Span
from microrad.report.quantities import minus, power_text

LINE = 1.2  # height of a line of text over its size
_MARGIN = 0.05  # of the data, to either side
EACH = {"x": 40.0, "y": 22.0}  # points that a tick needs
_LEAST_GAP = 6.0
_DECADES_WITH_MINOR_TICKS = 6
_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
# Advance widths of DejaVu Sans from the blank to the tilde, hundredths of an em; other fonts are mostly narrower.
_WIDTHS = (
    32, 40, 46, 84, 64, 95, 78, 27, 39, 39, 50, 84, 32, 36, 32, 34, 64, 64, 64, 64, 64, 64, 64, 64, 64, 64, 34, 34, 84,
    84, 84, 53, 100, 68, 69, 70, 77, 63, 58, 77, 75, 29, 29, 66, 56, 86, 75, 79, 60, 79, 69, 63, 61, 73, 68, 99, 69, 61,
    69, 39, 34, 39, 84, 50, 50, 61, 63, 55, 63, 62, 35, 63, 63, 28, 28, 58, 28, 97, 63, 61, 63, 63, 41, 52, 39, 63, 59,
    82, 59, 59, 52, 64, 34, 64, 84,
)  # fmt: skip


def width_of(text: str, size: float) -> float:
    """Width of the longest line of a text, points.

    Args:
        text: with its line breaks.
        size: of its letters, points.
    """
    return max((sum(map(_hundredths, line)) for line in text.split("\n")), default=0.0) * size / 100.0


def height_of(text: str, size: float) -> float:
    """Height of all lines of a text, points.

    Args:
        text: with its line breaks.
        size: of its letters, points.
    """
    return LINE * size * (text.count("\n") + 1) if text else 0.0


def _hundredths(character: str) -> int:
    place = ord(character) - 32
    if 0 <= place < len(_WIDTHS):
        return _WIDTHS[place]
    return 100 if unicodedata.east_asian_width(character) in "WF" else 66


# ------------------------------------------------------------------------------------------------ limits
def limits(axis: Axis, which: str, panels: Sequence[Panel]) -> tuple[float, float]:
    """Those that the axis sets, and else those of the data of the panels that share it, with a margin.

    A logarithmic axis has no place for an end that is not positive: it follows from the data.

    Args:
        axis: of which the ends are asked for.
        which: "x" or "y".
        panels: those that share it.
    """
    given_low, given_high = (None if end is None or (axis.log and end <= 0.0) else end for end in (axis.low, axis.high))
    if given_low is not None and given_high is not None:
        return given_low, given_high
    marks = [mark for panel in panels for mark in panel.marks]
    known = [np.ravel(values) for mark in marks for values in _extent(mark, which)]
    values = np.concatenate([np.empty(0), *known])
    values = values[np.isfinite(values) & ((values > 0.0) | (not axis.log))]
    low, high = (float(values.min()), float(values.max())) if values.size else (1.0, 10.0) if axis.log else (0.0, 1.0)
    below, above = _margins(marks, which, low, high)
    if axis.log:
        low, high = (low, high) if low < high else (low / 3.0, high * 3.0)
        wide = math.log10(high / low)
        low, high = low * 10.0 ** (-below * wide), high * 10.0 ** (above * wide)
    else:
        wide = high - low or abs(high) or 1.0
        low, high = (
            low - (below * wide if high > low else 0.5 * wide),
            high + (above * wide if high > low else 0.5 * wide),
        )
    return low if given_low is None else given_low, high if given_high is None else given_high


def _extent(mark: Mark, which: str) -> Iterator[Floats]:
    """Values along an axis that have to be seen."""
    along = which == "x"
    if isinstance(mark, Line):
        values, arms = (mark.x, mark.x_arms) if along else (mark.y, mark.y_arms)
        yield values
        if arms is not None:
            yield values - arms[0]
            yield values + arms[1]
    elif isinstance(mark, Rule | Span) and mark.upright == along:
        yield np.array([mark.at] if isinstance(mark, Rule) else [mark.low, mark.high])
    elif isinstance(mark, Area):
        yield from (ring[:, 0 if along else 1] for ring in mark.rings)
    elif isinstance(mark, Bars) and mark.upright != along:
        yield mark.start
        yield mark.end
    elif isinstance(mark, Bars):
        yield mark.at - mark.breadth / 2.0
        yield mark.at + mark.breadth / 2.0
    elif isinstance(mark, Field):
        yield edges_of(mark, which)


def edges_of(of: Field, which: str) -> Floats:
    """Where the cells of a field end along an axis; the points themselves of one with levels.

    Args:
        of: the field.
        which: "x" or "y".
    """
    middle = of.x if which == "x" else of.y
    if of.levels is not None or middle.size < 2:
        return middle if middle.size > 1 else np.array([middle[0] - 0.5, middle[0] + 0.5])
    half = (middle[1] - middle[0]) / 2.0
    return np.append(middle - half, middle[-1] + half)


def _margins(marks: Sequence[Mark], which: str, low: float, high: float) -> tuple[float, float]:
    """None at the edge of a field, and none where bars stand on the end of the data."""
    if any(isinstance(mark, Field) for mark in marks):
        return 0.0, 0.0
    bases = [mark.start for mark in marks if isinstance(mark, Bars) and mark.upright == (which == "y") and mark.at.size]
    stand = (
        [bool(np.all(base == end)) for end in (low, high) for base in [np.concatenate(bases)] if bases] if bases else []
    )
    below, above = stand or (False, False)
    return (0.0 if below else _MARGIN), (0.0 if above else _MARGIN)


# ------------------------------------------------------------------------------------------------ ticks
def place(axis: Axis, value: Floats | float, ends: tuple[float, float]) -> Floats:
    """Where values stand between the ends of an axis: 0 to 1.

    Args:
        axis: linear or logarithmic.
        value: on it, of any shape.
        ends: of the axis, the first at 0.
    """
    low, high = ends
    with np.errstate(divide="ignore", invalid="ignore"):
        if axis.log:
            found = np.log10(np.maximum(np.asarray(value, dtype=np.float64), 1e-300) / low) / math.log10(high / low)
        else:
            found = (np.asarray(value, dtype=np.float64) - low) / (high - low)
    return np.asarray(found)


def ticks(axis: Axis, which: str, ends: tuple[float, float], length: float) -> dict[float, str]:
    """Places of ticks and their texts.

    Args:
        axis: with its own ticks, if it sets some.
        which: "x" or "y".
        ends: of the axis.
        length: of the axis, points.
    """
    low, high = min(ends), max(ends)
    if axis.ticks is not None:
        at = [float(each) for each in axis.ticks if low - 1e-9 * abs(low) <= each <= high + 1e-9 * abs(high)]
        return {each: axis.words[each] for each in at} if axis.words else dict(zip(at, texts(at), strict=True))
    most = max(2, min(axis.most, int(length / EACH[which])))
    while True:
        at = decades(low, high, most) if axis.log else rounds(low, high, most)
        found = dict(zip(at, powers(at) if axis.log else texts(at), strict=True))
        if which == "y" or most <= 2 or _apart(axis, found, ends, length):
            return found
        most -= 1


def _apart(axis: Axis, found: dict[float, str], ends: tuple[float, float], length: float) -> bool:
    """Whether the texts below an axis stand apart."""
    at = [(float(place(axis, each, ends)) * length, width_of(text, axis.size)) for each, text in found.items()]
    return all(abs(b - a) > (wa + wb) / 2.0 + _LEAST_GAP for (a, wa), (b, wb) in itertools.pairwise(at))


def rounds(low: float, high: float, most: int) -> list[float]:
    """At most so many round numbers from low to high.

    Args:
        low: the least.
        high: the largest.
        most: how many there may be.
    """
    if not high > low:
        return [low]
    power = 10.0 ** math.floor(math.log10((high - low) / most))
    for step in (scale * each for scale in (power, 10.0 * power) for each in _STEPS):
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
        if last - first < most:
            break
    return [float(f"{k * step:.12g}") for k in range(first, last + 1)]


def decades(low: float, high: float, most: int) -> list[float]:
    """At most so many ticks of a logarithmic axis: powers of ten, with numbers between where those are few.

    Args:
        low: the least, above 0.
        high: the largest.
        most: how many there may be.
    """
    first, last = math.floor(math.log10(low) + 1e-9), math.ceil(math.log10(high) - 1e-9)
    whole = [power for power in range(first, last + 1) if low * (1 - 1e-9) <= 10.0**power <= high * (1 + 1e-9)]
    if len(whole) >= 3:
        step = math.ceil(len(whole) / most)
        at = [10.0**power for power in whole if power % step == 0]
        return at if len(at) >= min(most, 2) else [10.0 ** whole[0], 10.0 ** whole[-1]]  # one alone tells no scale
    for steps in ((1, 2, 3, 5, 7), (1, 2, 5), (1, 3), (1,)):
        at = [float(f"{k * 10.0**power:.3g}") for power in range(first - 1, last + 1) for k in steps]
        at = [each for each in at if low * (1 - 1e-9) <= each <= high * (1 + 1e-9)]
        if len(at) <= most:
            break
    return at if len(at) > 1 else rounds(low, high, most)


def minor(axis: Axis, ends: tuple[float, float]) -> list[float]:
    """Ticks without a text between those of a logarithmic axis.

    Args:
        axis: linear ones have none.
        ends: of the axis.
    """
    low, high = min(ends), max(ends)
    if not axis.log or axis.ticks is not None or math.log10(high / low) > _DECADES_WITH_MINOR_TICKS:
        return []
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    at = [k * 10.0**power for power in range(first, last + 1) for k in range(1, 10)]
    return [each for each in at if low <= each <= high]


def texts(at: Sequence[float]) -> list[str]:
    """Ticks as text, all to the same decimals; with a power of ten where they are very small or large."""
    most = max((abs(each) for each in at), default=0.0)
    if most and not 1e-3 <= most < 1e7:
        return [power_text(each) for each in at]
    decimals = next((d for d in range(9) if all(abs(round(each, d) - each) <= 1e-9 * most for each in at)), 9)
    return [minus(f"{each:.{decimals}f}") if each else "0" for each in at]


def powers(at: Sequence[float]) -> list[str]:
    """Ticks of a logarithmic axis: plain numbers where none is very small or large, else powers of ten."""
    if plain(at):
        return [f"{each:g}" for each in at]
    return [power_text(each) for each in at]


def plain(numbers: Sequence[float]) -> bool:
    """Whether numbers on a logarithmic axis are read best without powers of ten."""
    return all(1e-3 <= each <= 1e4 for each in numbers)
