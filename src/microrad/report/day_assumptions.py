"""Figure of what each assumption decides: bars about the value as assumed."""

import math
import textwrap
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from microrad.report.day_figures import WIDTH, empty, short
from microrad.report.plotting.figure import Figure
from microrad.report.plotting.sheet import (
    BLUE,
    GREY,
    ORANGE,
    Area,
    Bars,
    Legend,
    Panel,
    Rule,
    Sheet,
    Words,
    grid,
)

MOST_BARS = 14
_LINE = 44  # characters
_MOST_LABEL = 1000


class Assumed(NamedTuple):
    """What one assumption does to a number: that number with the assumption at its lower and at its higher value.

    ``label`` names the assumption and its values, a side that is as assumed left out. A number may be infinite, or nan
    where there is none.
    """

    label: str
    low: float
    high: float


def assumptions(swings: Sequence[Assumed], value: float, quantity: str) -> Figure:
    """A number over each assumption, one at a time, the first on top. ``quantity`` is its name with unit."""
    shown = swings[:MOST_BARS]
    if shown and math.isfinite(value):
        sheet = _tornado(shown, value, f"{quantity}; as assumed: {value:.4g}")
    else:
        sheet = empty("no assumption was varied" if math.isfinite(value) else f"{quantity}: no finite value")
    caption = f"{quantity[:1].upper()}{quantity[1:]}: one assumption at a time at its lower and at its higher value."
    if len(swings) > len(shown):
        caption += f" {len(swings) - len(shown)} more, which change less, are in the data only."
    columns = {"as assumed": np.array([value])}
    columns |= {f"{s.label}, lower": np.array([s.low]) for s in swings}
    columns |= {f"{s.label}, higher": np.array([s.high]) for s in swings}
    return Figure("assumptions", "What the assumptions decide", caption, sheet, columns)


def _tornado(shown: Sequence[Assumed], value: float, label: str) -> Sheet:
    labels = [in_lines(s.label) for s in shown]
    most = max(label.count("\n") + 1 for label in labels)
    sheet, (panel,) = grid(WIDTH, 1.0 + max(0.27, 0.14 * most + 0.06) * len(shown))
    swing_bars(panel, labels, [(s.low, s.high) for s in shown], value)
    panel.x.title = label
    keys = Area((), ORANGE, label="assumption lower"), Area((), BLUE, label="assumption higher")
    sheet.legend = Legend("above", 2, only=keys)
    return sheet


def in_lines(label: str) -> str:
    """A label too long for its line in several: broken behind the assumption, then between its values."""
    lines = [short(label, _MOST_LABEL)]
    for mark in (": ", " / "):
        head, found, tail = lines[-1].partition(mark)
        if found and len(lines[-1]) > _LINE:
            lines[-1:] = [head + mark.rstrip(), tail]
    return "\n".join(textwrap.fill(line, _LINE, max_lines=2, placeholder="…") for line in lines)


def swing_bars(panel: Panel, labels: Sequence[str], ends: Sequence[tuple[float, float]], value: float) -> None:
    """Bars from a value to what it becomes with each input lower and higher, the first row on top.

    A bar to infinity stops beyond all others and says so; where there is no value (nan) words stand for the bar.
    """
    reach = max((abs(end - value) for both in ends for end in both if math.isfinite(end)), default=0.0)
    reach = reach or abs(value) or 1.0
    for row, both in enumerate(ends):
        bars = [(end, colour) for end, colour in zip(both, (ORANGE, BLUE), strict=True) if not math.isnan(end)]
        for end, colour in sorted(bars, key=lambda bar: -abs(bar[0] - value)):
            bounded = math.isfinite(end)
            shown = end if bounded else value + math.copysign(1.4 * reach, end)
            at, start, end_, breadth = (np.array([each]) for each in (float(row), value, shown, 0.7))
            panel.add(Bars(at, start, end_, breadth, colour, opacity=1.0 if bounded else 0.5))
        panel.add(Words(_remark(both, value), 1.0, row, GREY, shift=(5.0, 0.0), of_panel="x"))
    panel.add(Rule(value, True, width=0.8))
    panel.y.ticks, panel.y.size, panel.y.grid = dict(enumerate(labels)), 8.0, False
    panel.y.low, panel.y.high = len(labels) - 0.4, -0.6


def _remark(both: tuple[float, float], value: float) -> str:
    """Words at the right of a row whose bars do not say it."""
    if all(end == value for end in both):
        return "no change"
    return ", ".join(
        f"{which}: {'no value' if math.isnan(end) else 'without bound'}"
        for end, which in zip(both, ("lower", "higher"), strict=True)
        if not math.isfinite(end)
    )
