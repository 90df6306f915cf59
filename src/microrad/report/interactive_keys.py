"""Legends of a drawn figure as lists of switches: a label, a swatch, and the traces and shapes that it switches."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure as Canvas
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from microrad.report.interactive_axes import Panel
from microrad.report.interactive_sheet import Look, Mark, Sheet, look_of
from microrad.report.interactive_style import colour, dash, marker_of, pixels, symbol_of, words

_NEUTRAL = ("#000000", "#777777", "#ffffff")


def keys(canvas: Canvas, panels: list[Panel], sheet: Sheet) -> list[dict[str, Any]]:
    """Every legend with its entries; a curve without a label that looks like an entry goes with it under its name."""
    return [_legend(legend, axes, panels, sheet) for legend, axes in _legends(canvas, panels)]


def _legends(canvas: Canvas, panels: list[Panel]) -> Iterator[tuple[Legend, Axes | None]]:
    for legend in canvas.legends:
        yield legend, None
    for panel in panels:
        own = panel.axes.get_legend()
        if own is not None:
            yield own, panel.axes


def _legend(legend: Legend, axes: Axes | None, panels: list[Panel], sheet: Sheet) -> dict[str, Any]:
    of = {p.x.name for p in panels if p.axes is axes}
    entries = []
    looks = [look_of(handle) for handle in legend.legend_handles]
    colours = [look.colour for look in looks]
    for handle, text, look in zip(legend.legend_handles, legend.get_texts(), looks, strict=True):
        label = text.get_text()
        alone = colours.count(look.colour) == 1
        found = [*_labelled(label, sheet, of), *_alike(label, look, alone, sheet, of)]
        for mark in found:
            if mark.kind == "data" and not sheet.data[mark.number].get("name"):
                sheet.data[mark.number]["name"] = words(label)
        entry = {"label": label, **(_of_points(handle, found, sheet) or swatch(handle))}
        entries.append(entry | {kind: [m.number for m in found if m.kind == kind] for kind in ("data", "shapes")})
    title = legend.get_title().get_text()
    panel = axes.get_title(loc="left") if axes is not None and len(panels) > 1 else ""
    return {"title": " ".join(part for part in (panel, title) if part), "entries": entries}


def _labelled(label: str, sheet: Sheet, of: set[str]) -> list[Mark]:
    """Marks with the label, in the panels of the legend."""
    return [m for m in sheet.marks if m.label == label and (not of or _panel(m, sheet) in of)]


def _alike(label: str, look: Look, alone: bool, sheet: Sheet, of: set[str]) -> list[Mark]:
    """Marks without a label that look like an entry, or have the colour that it alone has; that of axes is no sign."""
    looks = {look, *(mark.look for mark in _labelled(label, sheet, of))}
    tint = look.colour if alone and look.colour not in _NEUTRAL else ""
    unlabelled = [m for m in sheet.marks if not m.label and m.look.colour]
    return [m for m in unlabelled if m.look in looks or (m.kind == "data" and m.look.colour == tint)]


def _panel(mark: Mark, sheet: Sheet) -> str:
    if mark.kind == "data":
        return str(sheet.data[mark.number]["xaxis"])
    return str(sheet.shapes[mark.number]["xref"]).removesuffix(" domain")


def _of_points(handle: Any, found: list[Mark], sheet: Sheet) -> dict[str, Any]:
    """The marker of points with error bars, whose handle is a bar."""
    data = [sheet.data[m.number] for m in found if m.kind == "data"]
    marked = isinstance(handle, LineCollection) and data and "marker" in data[0]
    return {"marker": data[0]["marker"]} if marked else {}


def swatch(handle: Any) -> dict[str, Any]:
    """What stands beside a label: a line, a marker on it or alone, or an area."""
    if isinstance(handle, Line2D):
        made: dict[str, Any] = {}
        if dash(handle):
            made["line"] = {"color": colour(handle.get_color()), "width": pixels(float(handle.get_linewidth()))}
            made["line"]["dash"] = dash(handle)
        if handle.get_marker() not in ("None", "none", " ", ""):
            made["marker"] = marker_of(handle)
        return made
    if isinstance(handle, PathCollection):
        faces, edges = handle.get_facecolor(), handle.get_edgecolor()
        shown = faces if len(faces) else edges
        size = pixels(float(np.sqrt(handle.get_sizes()[0])))
        return {"marker": {"symbol": symbol_of(handle), "size": size, "color": colour(shown[0])}}
    if isinstance(handle, LineCollection):
        width = pixels(float(np.ravel(handle.get_linewidth())[0]))
        return {"line": {"color": colour(handle.get_colors()[0]), "width": width, "dash": "solid"}}
    return {"area": colour(handle.get_facecolor())} if isinstance(handle, Patch) else {}
