"""Plots of the studio as plain data for plotly: one look, axes with units, colours told apart by the colour-blind."""

from __future__ import annotations

import math
from typing import Any

from microrad.core.units import format_quantity

Plot = dict[str, Any]
Trace = dict[str, Any]

# Okabe and Ito's palette, as in the report.
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION = "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00"
GREY, GRID = "#777777", "#dddddd"
DASHES = ("solid", "dash", "dashdot", "dot")
_MOST_TICKS = 8

CONFIG: dict[str, Any] = {
    "displaylogo": False,
    "responsive": True,
    "modeBarButtonsToRemove": ["lasso2d", "select2d", "autoScale2d"],
}
"""Plotly's own controls: no logo, nothing that sends a plot anywhere."""


def plot(data: list[Trace], x: dict[str, Any], y: dict[str, Any], **layout: Any) -> Plot:
    """Traces on one pair of axes, whose titles carry their units."""
    common: dict[str, Any] = {
        "margin": {"l": 70, "r": 20, "t": 30, "b": 55},
        "font": {"family": "sans-serif", "size": 13, "color": BLACK},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "hovermode": "closest",
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0.0},
        "xaxis": axis(**x),
        "yaxis": axis(**y),
    }
    return {"data": data, "layout": {**common, **layout}, "config": CONFIG}


def axis(title: str, **more: Any) -> dict[str, Any]:
    """An axis with its title."""
    return {"title": {"text": title}, "gridcolor": GRID, "zeroline": False, "automargin": True, **more}


def empty(words: str) -> Plot:
    """A plot that says why there is nothing to see."""
    hidden = {"title": "", "visible": False}
    note = {"text": plain(words), "xref": "paper", "yref": "paper", "x": 0.5, "y": 0.5, "showarrow": False}
    return plot([], hidden, hidden, annotations=[note])


def plain(text: str, most: int = 40) -> str:
    """A name from a mission or recording as it stands in a plot: on one line, cut, and never taken for markup."""
    line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    line = line if len(line) <= most else line[: most - 1] + "…"
    return line.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def decades(low: float, high: float, unit: str) -> tuple[list[float], list[str]]:
    """Ticks at 1, 2 and 5 times the powers of ten between two values of the SI unit, as log10 and in words.

    At 1 and 3 times them, or at them alone, where these would be more than eight, whose words turn.
    """
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    for steps in ((1.0, 2.0, 5.0), (1.0, 3.0), (1.0,)):
        values = [step * 10.0**power for power in range(first, last + 1) for step in steps]
        shown = [value for value in values if low * (1 - 1e-9) <= value <= high * (1 + 1e-9)]
        if len(shown) <= _MOST_TICKS:
            break
    return [math.log10(value) for value in shown], [format_quantity(value, unit) for value in shown]


def marker_line(
    x: float, name: str, color: str, dash: str, y: tuple[float, float] | tuple[str, str] = (0.0, 1.0)
) -> Trace:
    """A vertical line over the plot as a trace of its own, so that the legend names it and switches it."""
    return {
        "type": "scatter",
        "mode": "lines",
        "x": [x, x],
        "y": [*y],
        "name": name,
        "line": {"color": color, "width": 2, "dash": dash},
        "hovertemplate": f"{name}<extra></extra>",
    }
