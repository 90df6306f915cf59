"""A drawn figure as the JSON that the page's script draws it from with plotly: to hover, zoom and switch curves.

The static picture stays in the page; it is what prints, and what shows without JavaScript. Numbers keep six
significant digits, curves at most `interactive_style.MOST_POINTS` points with their extremes.
"""

import json
from importlib import resources
from typing import Any

from matplotlib.figure import Figure as Canvas

from microrad.report import interactive_axes as axes_
from microrad.report.interactive_axes import Panel
from microrad.report.interactive_keys import keys
from microrad.report.interactive_sheet import Sheet, keep_values
from microrad.report.interactive_style import StaticOnlyError, colour, numbers, words
from microrad.report.interactive_traces import turn

__all__ = ["StaticOnlyError", "keep_values", "keyboard", "library", "plot_of", "text_of", "with_scripts"]

MARK = '<script type="application/json" class="plot">'
_LIBRARY = "vendor/plotly-cartesian.min.js"


def plot_of(canvas: Canvas) -> dict[str, Any]:
    """A canvas that has been drawn once (its layout is final) as plain data.

    ``data`` and ``layout`` are plotly's but for the places of the panels: those stand in ``panels`` and ``scales``
    (colour bars) as boxes in CSS pixels for the width ``size[0]``, from which the page's script makes them for the
    width that it has. ``keys`` are the legends. Raises StaticOnlyError where something has no interactive form.
    """
    drawn = [*canvas.axes]
    if not drawn:
        raise StaticOnlyError("no axes")
    if canvas.lines or canvas.patches or canvas.images or canvas.artists:
        raise StaticOnlyError("artists beside the axes")
    bars = {mappable.colorbar.ax: mappable for axes in drawn for mappable in _coloured(axes)}
    panels, sheet = axes_.panels(canvas, bars), Sheet()
    for panel in panels:
        turn(panel, sheet)
    legends = keys(canvas, panels, sheet)
    scales = _scales(canvas, panels, sheet)
    layout = axes_.common()
    for panel in panels:
        layout |= axes_.layout_of(panel, _followed(panels))
    layout |= {"shapes": sheet.shapes, "annotations": sheet.annotations}
    return {
        "size": axes_.size(canvas),
        "data": sheet.data,
        "layout": layout,
        "panels": [_placed(panel) for panel in panels if not panel.over],
        "scales": scales,
        "keys": legends,
        "heading": _heading(canvas),
        "ratio": any("scaleratio" in axis for axis in layout.values() if isinstance(axis, dict)),
    }


def text_of(plot: dict[str, Any]) -> str:
    """The plot as text that may stand in a page: nothing in it ends the element around it."""
    text = json.dumps(plot, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def with_scripts(page: str) -> str:
    """The page with its scripts at its end: the drawing library only where a figure of it is interactive."""
    body, end, rest = page.rpartition("</body>")
    return body + keyboard() + (library() if MARK in page else "") + end + rest


def keyboard() -> str:
    """The script element that lets the keyboard scroll what is wider than the page."""
    return _scripts("reach.js")


def library() -> str:
    """The script elements of figures: plotly (MIT licence, in ``vendor/``), and what draws the figures with it."""
    return _scripts(_LIBRARY, "figure.js")


def _scripts(*names: str) -> str:
    folder = resources.files("microrad.report")
    return "".join(f"<script>\n{folder.joinpath(name).read_text(encoding='utf-8')}</script>\n" for name in names)


def _coloured(axes: Any) -> list[Any]:
    """What has a colour bar."""
    return [each for each in (*axes.images, *axes.collections) if getattr(each, "colorbar", None) is not None]


def _followed(panels: list[Panel]) -> dict[str, str]:
    """For each axis that shares its limits with that of an earlier panel, the name of that one."""
    found: dict[str, str] = {}
    for number, panel in enumerate(panels):
        groups = ((panel.x, panel.axes.get_shared_x_axes()), (panel.y, panel.axes.get_shared_y_axes()))
        for which, (side, group) in enumerate(groups):
            before = (p for p in panels[:number] if group.joined(p.axes, panel.axes))
            first = next(before, None)
            name = "" if first is None else (first.x, first.y)[which].name
            if name and name != side.name:
                found[side.name] = name
    return found


def _placed(panel: Panel) -> dict[str, Any]:
    titles = {side.key: words(side.title) for side in (panel.x, panel.y)}
    return {"x": panel.x.key, "y": panel.y.key, "inner": panel.inner, "outer": panel.outer, "titles": titles}


def _scales(canvas: Canvas, panels: list[Panel], sheet: Sheet) -> list[dict[str, Any]]:
    """Colour bars: each is shown by the trace that it belongs to."""
    made = []
    for number, of in sheet.coloured:
        if of.colorbar is None:
            continue
        bar, trace = of.colorbar, sheet.data[number]
        title = {"text": words(bar.ax.get_ylabel()), "side": "right"}
        trace |= {
            "showscale": True,
            "colorbar": {"title": title, "tickvals": numbers(bar.get_ticks()), "outlinewidth": 0},
        }
        panel = next(k for k, p in enumerate(panels) if p.x.name == trace["xaxis"])
        boxes = {"inner": axes_.inner_box(canvas, bar.ax), "outer": axes_.outer_box(canvas, bar.ax)}
        made.append({"trace": number, "panel": panel, **boxes})
    return made


def _heading(canvas: Canvas) -> list[dict[str, str]]:
    """Texts above the panels."""
    shown = [each for each in canvas.texts if each.get_visible() and each.get_text().strip()]
    return [{"text": each.get_text(), "color": colour(each.get_color())} for each in shown]
