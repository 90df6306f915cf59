"""Bars from a value to what it becomes with each input lower and higher."""

import math
import textwrap
from collections.abc import Sequence

import numpy as np

from microrad.report.plotting.palette import BLUE, GREY, ORANGE
from microrad.report.plotting.sheet import Area, Bars, Legend, Panel, Place, Rule, Words, rows, shortened

_LINE = 44  # characters
_MOST_LABEL = 1000
_KEPT = "\u00a0"  # a blank at which no line is broken


def in_lines(label: str) -> str:
    """A label too long for its line in several: broken behind the assumption, then between its values."""
    lines = [shortened(label, _MOST_LABEL)]
    for mark in (": ", " / "):
        head, found, tail = lines[-1].partition(mark)
        if found and len(lines[-1]) > _LINE:
            lines[-1:] = [head + mark.rstrip().replace(" ", _KEPT), tail]
    return "\n".join(textwrap.fill(line, _LINE, max_lines=2, placeholder="…") for line in lines).replace(_KEPT, " ")


def swing_bars(panel: Panel, labels: Sequence[str], ends: Sequence[tuple[float, float]], value: float) -> None:
    """Bars from a value to what it becomes with each input lower and higher, the first row on top.

    A bar to infinity stops beyond all others and says so; where there is no value (nan) words stand for the bar.

    Args:
        panel: gets the bars.
        labels: of the rows.
        ends: of each row, with the input lower and higher; nan for none.
        value: as it is.
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
    panel.y = rows(labels)


def swing_legend(what: str, place: Place, columns: int = 1) -> Legend:
    """What the colours of the bars say of an input or assumption.

    Args:
        what: an input, or an assumption.
        place: of the legend.
        columns: of its entries.
    """
    return Legend(
        place, columns, only=(Area((), ORANGE, label=f"{what} lower"), Area((), BLUE, label=f"{what} higher"))
    )


def _remark(both: tuple[float, float], value: float) -> str:
    """Words at the right of a row whose bars do not say it."""
    if all(end == value for end in both):
        return "no change"
    return ", ".join(
        f"{which}: {'no value' if math.isnan(end) else 'without bound'}"
        for end, which in zip(both, ("lower", "higher"), strict=True)
        if not math.isfinite(end)
    )
