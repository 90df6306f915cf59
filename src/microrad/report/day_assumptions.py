"""Figure of what each assumption decides: bars about the value as assumed."""

import math
import textwrap
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.patches import Patch

from microrad.report.day_figures import GREY, PLAIN, WIDTH, empty, short
from microrad.report.figures import BLACK, BLUE, ORANGE, Figure, svg_of

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


@rc_context(PLAIN)
def assumptions(swings: Sequence[Assumed], value: float, quantity: str) -> Figure:
    """A number over each assumption, one at a time, the first on top. ``quantity`` is its name with unit."""
    shown = swings[:MOST_BARS]
    if shown and math.isfinite(value):
        svg = _tornado(shown, value, f"{quantity}; as assumed: {value:.4g}")
    else:
        svg = empty("no assumption was varied" if math.isfinite(value) else f"{quantity}: no finite value")
    caption = f"{quantity[:1].upper()}{quantity[1:]}: one assumption at a time at its lower and at its higher value."
    if len(swings) > len(shown):
        caption += f" {len(swings) - len(shown)} more, which change less, are in the data only."
    columns = {"as assumed": np.array([value])}
    columns |= {f"{s.label}, lower": np.array([s.low]) for s in swings}
    columns |= {f"{s.label}, higher": np.array([s.high]) for s in swings}
    return Figure("assumptions", "What the assumptions decide", caption, svg, columns)


def _tornado(shown: Sequence[Assumed], value: float, label: str) -> str:
    labels = [in_lines(s.label) for s in shown]
    most = max(label.count("\n") + 1 for label in labels)
    canvas = Canvas(figsize=(WIDTH, 1.0 + max(0.27, 0.14 * most + 0.06) * len(shown)), layout="constrained")
    axes = canvas.subplots()
    swing_bars(axes, labels, [(s.low, s.high) for s in shown], value)
    axes.set_xlabel(label)
    keys = [Patch(color=ORANGE, label="assumption lower"), Patch(color=BLUE, label="assumption higher")]
    canvas.legend(handles=keys, loc="outside upper center", ncols=2, fontsize=8)
    return svg_of(canvas)


def in_lines(label: str) -> str:
    """A label too long for its line in several: broken behind the assumption, then between its values."""
    lines = [short(label, _MOST_LABEL)]
    for mark in (": ", " / "):
        head, found, tail = lines[-1].partition(mark)
        if found and len(lines[-1]) > _LINE:
            lines[-1:] = [head + mark.rstrip(), tail]
    return "\n".join(textwrap.fill(line, _LINE, max_lines=2, placeholder="…") for line in lines)


def swing_bars(axes: Axes, labels: Sequence[str], ends: Sequence[tuple[float, float]], value: float) -> None:
    """Bars from a value to what it becomes with each input lower and higher, the first row on top.

    A bar to infinity stops beyond all others and says so; where there is no value (nan) words stand for the bar.
    """
    reach = max((abs(end - value) for both in ends for end in both if math.isfinite(end)), default=0.0)
    reach = reach or abs(value) or 1.0
    for row, both in enumerate(ends):
        bars = [(end, colour) for end, colour in zip(both, (ORANGE, BLUE), strict=True) if not math.isnan(end)]
        for end, colour in sorted(bars, key=lambda bar: -abs(bar[0] - value)):
            bounded = math.isfinite(end)
            width = end - value if bounded else math.copysign(1.4 * reach, end)
            axes.barh(row, width, left=value, color=colour, height=0.7, alpha=1.0 if bounded else 0.5)
        _remark(axes, row, both, value)
    axes.axvline(value, color=BLACK, linewidth=0.8)
    axes.set_yticks(range(len(labels)), labels, fontsize=8)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.grid(visible=False, axis="y")


def _remark(axes: Axes, row: int, both: tuple[float, float], value: float) -> None:
    """Words at the right of a row whose bars do not say it."""
    words = [
        f"{which}: {'no value' if math.isnan(end) else 'without bound'}"
        for end, which in zip(both, ("lower", "higher"), strict=True)
        if not math.isfinite(end)
    ]
    if all(end == value for end in both):
        words = ["no change"]
    place, transform = (1, row), axes.get_yaxis_transform()
    axes.annotate(
        ", ".join(words), place, (5, 0), transform, textcoords="offset points", va="center", color=GREY, fontsize=8
    )
