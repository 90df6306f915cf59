"""Axes of a campaign's figures: plain numbers at the ticks, short names of keys."""

import textwrap
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import ScalarFormatter

from microrad.report import figures
from microrad.report.campaign_numbers import power
from microrad.report.day_figures import short

_LABEL = 30  # characters


def label_of(key: str, keys: Sequence[str]) -> str:
    """The end of a dotted key that tells it from the others, two parts at least, on lines that leave room for data."""
    parts = key.split(".")
    for count in range(2, len(parts)):
        tail_ = ".".join(parts[-count:])
        if sum(other == tail_ or other.endswith(f".{tail_}") for other in keys) == 1:
            break
    else:
        count = len(parts)
    whole = short(".".join(parts[-count:]), 90)
    return textwrap.fill(whole.replace(".", ". "), _LABEL, max_lines=2, placeholder="…").replace(". ", ".")


def logarithm(axes: Axes, which: str) -> None:
    """Make an axis logarithmic, its decades in plain text."""
    (axes.set_xscale if which == "x" else axes.set_yscale)("log")
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_formatter(lambda x, _: f"{x:g}" if 1e-3 < x < 1e4 else power(x))
    axis.set_minor_formatter(lambda x, _: "")


class _Plain(ScalarFormatter):
    """Numbers at ticks whole, without a power of ten or an offset at the end of the axis."""

    def __init__(self, of: Axis) -> None:
        super().__init__(useOffset=False)
        self._of = of
        self.set_scientific(False)

    def __call__(self, x: float, pos: int | None = None) -> str:
        largest = max((abs(float(at)) for at in self._of.get_majorticklocs()), default=0.0)
        if x and largest < 1e-3:
            return _power(x)
        return str(super().__call__(x, pos))


def _power(number: float) -> str:
    """A number with as many digits as it has, up to three, and its power of ten."""
    mantissa, _, exponent = f"{number:.2e}".partition("e")
    return f"{float(mantissa):g}e{int(exponent)}".replace("-", "\u2212")


def svg_of(canvas: Canvas) -> str:
    """The picture, no axis of which has a factor beside it."""
    for axes in canvas.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if type(axis.get_major_formatter()) is ScalarFormatter:
                axis.set_major_formatter(_Plain(axis))
    return figures.svg_of(canvas)
