"""Sheets of the report as figures for a page, which plotly draws as wide as their place is."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

from microrad.report.plotting.figure import Figure
from microrad.report.plotting.interactive import plot_of, words
from microrad.report.plotting.sheet import Axis, Legend, Mark, Sheet, grid
from microrad.report.view import Block, Drawing, Verdict, View

Plot = dict[str, Any]

WIDTH = 6.4
"""Of a sheet, in inches; in its place on a page it is stretched."""

CONFIG: dict[str, Any] = {
    "displaylogo": False,
    "responsive": True,
    "modeBarButtonsToRemove": ["lasso2d", "select2d", "autoScale2d"],
}
"""Plotly's own controls: no logo, nothing that sends a plot anywhere."""

_KEYS_PX = 30  # for a line of the legend
_LEGEND = {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0.0, "font": {"size": 12}}
_WHITE = {"paper_bgcolor": "white", "plot_bgcolor": "white"}


def plot(x: Axis, y: Axis, *marks: Mark, height: float = 3.6) -> Plot:
    """Marks on one pair of axes as a figure.

    Args:
        x: the axis across.
        y: the axis up.
        marks: what is drawn, the first below.
        height: that of the sheet (inches).
    """
    sheet, (panel,) = grid(WIDTH, height)
    panel.x, panel.y, sheet.legend = x, y, Legend("above")
    panel.add(*marks)
    return figure(sheet)


def rows(names: list[str]) -> Axis:
    """An axis with a name at each row, the first on top."""
    return Axis(low=len(names) - 0.4, high=-0.6, ticks=dict(enumerate(names)), grid=False)


def empty(text: str) -> Plot:
    """A figure that says why there is nothing to see."""
    note = {"text": words(text), "xref": "paper", "yref": "paper", "x": 0.5, "y": 0.5, "showarrow": False}
    hidden = {"visible": False}
    layout = {**_WHITE, "margin": dict.fromkeys("lrtb", 10), "xaxis": hidden, "yaxis": hidden, "annotations": [note]}
    return {"data": [], "layout": layout, "config": CONFIG}


def drawn(blocks: Sequence[Block]) -> dict[str, Plot | str]:
    """The figures among these blocks by their names; the address of its picture for one that does not move."""
    found: dict[str, Plot | str] = {}
    for block in blocks:
        match block:
            case View() | Verdict():
                found |= drawn(block.blocks)
            case Figure():
                found[block.name] = figure(block.sheet) if block.alive else address(block.svg)
            case Drawing():
                found[block.name] = address(block.svg)
    return found


def address(svg: str) -> str:
    """A picture as the address of an image."""
    return f"data:image/svg+xml;base64,{base64.b64encode(svg.encode()).decode()}"


def figure(sheet: Sheet) -> Plot:
    """A sheet as a figure: its height stays, its width is that of its place, and its legend is plotly's."""
    made = plot_of(sheet)
    if not made["panels"]:
        return empty(sheet.heading)
    data, layout, panels = made["data"], made["layout"], made["panels"]
    left, top, right, bottom = (end(p["inner"][k] for p in panels) for k, end in enumerate((min, min, max, max)))
    for panel in panels:
        x0, y0, x1, y1 = panel["inner"]
        layout[panel["x"]]["domain"] = [(x0 - left) / (right - left), (x1 - left) / (right - left)]
        layout[panel["y"]]["domain"] = [(bottom - y1) / (bottom - top), (bottom - y0) / (bottom - top)]
        layout[panel["y"]]["automargin"] = True
    around = [max(abs(p["outer"][k] - p["inner"][k]) for p in panels) for k in range(4)]
    layout |= {**_WHITE, "margin": dict(zip("ltrb", around, strict=True)), "legend": _LEGEND, "showlegend": True}
    rows_px = round(bottom - top)  # which the page keeps free for the data, however long the legend is
    layout["height"] = round(rows_px + around[1] + around[3] + _KEYS_PX * bool(made["keys"]))
    for trace in data:
        trace["showlegend"] = False
    for entry in (entry for key in made["keys"] for entry in key["entries"]):
        named = [data[k] for k in entry["data"]] + [layout["shapes"][k] for k in entry["shapes"]]
        if not named:  # it stands in the legend alone
            named = [{"type": "scatter", "mode": "lines", "x": [None], "y": [None], "line": entry["line"]}]
            data += named
        for place, each in enumerate(named):
            each |= {"name": words(entry["label"]), "legendgroup": words(entry["label"]), "showlegend": not place}
    return {"data": data, "layout": layout, "config": CONFIG, "rows": rows_px}
