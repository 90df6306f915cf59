"""Titles of panels and texts in them as plotly's annotations."""

from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.text import Annotation, Text

from microrad.report.interactive_axes import Panel
from microrad.report.interactive_style import StaticOnlyError, colour, numbers, pixels, words

_UPRIGHT = {"center": "middle", "center_baseline": "middle", "baseline": "bottom"}
_TITLES: dict[Literal["left", "center", "right"], float] = {"left": 0, "center": 0.5, "right": 1}
_ABOVE_PX = 3


def texts(panel: Panel) -> list[dict[str, Any]]:
    """All texts of a panel."""
    axes = panel.axes
    titles = {where: axes.get_title(loc=where) for where in _TITLES}
    found = [_title(panel, where, title) for where, title in titles.items() if title.strip()]
    return found + [_text(panel, t) for t in axes.texts if t.get_visible() and t.get_text().strip()]


def _title(panel: Panel, where: Literal["left", "center", "right"], title: str) -> dict[str, Any]:
    refs = {"xref": f"{panel.x.name} domain", "yref": f"{panel.y.name} domain"}
    place = {"x": _TITLES[where], "xanchor": where, "y": 1, "yanchor": "bottom", "yshift": _ABOVE_PX}
    return {"text": words(title), **refs, **place, "showarrow": False}


def _text(panel: Panel, text: Text) -> dict[str, Any]:
    place, inside, shift = _place(text, panel.axes)
    font = {"size": pixels(float(text.get_fontsize())), "color": colour(text.get_color())}
    made: dict[str, Any] = {"text": words(text.get_text()), "showarrow": False, "font": font, "borderpad": 0}
    for which, value, data, side, move in zip("xy", place, inside, (panel.x, panel.y), shift, strict=True):
        made[which] = numbers([side.place(value) if data else value])[0]
        made[f"{which}ref"] = side.name if data else f"{side.name} domain"
        made[f"{which}shift"] = pixels(move)
    upright = text.get_verticalalignment()
    made |= {"xanchor": text.get_horizontalalignment(), "yanchor": _UPRIGHT.get(upright, upright)}
    if text.get_rotation():
        made["textangle"] = round(-float(text.get_rotation()), 1)
    box = text.get_bbox_patch()
    if box is not None and colour(box.get_facecolor()):
        made["bgcolor"] = colour(box.get_facecolor())
    return made


def _place(text: Text, axes: Axes) -> tuple[tuple[float, float], tuple[bool, bool], tuple[float, float]]:
    """Where a text stands: coordinates, whether each is in data or in parts of the panel, and a shift in points."""
    (x, y), of, shift = _anchor(text, axes)
    if of is None or not all(of.contains_branch_seperately(axes.transAxes)):
        raise StaticOnlyError("a text that is not in the coordinates of its panel")
    in_x, in_y = of.contains_branch_seperately(axes.transData)
    return (float(x), float(y)), (bool(in_x), bool(in_y)), shift


def _anchor(text: Text, axes: Axes) -> tuple[tuple[float, float], Any, tuple[float, float]]:
    if not isinstance(text, Annotation):
        return text.get_position(), text.get_transform(), (0.0, 0.0)
    if text.arrow_patch is not None:
        raise StaticOnlyError("an arrow")
    coords: Any = text.xycoords
    of = {"data": axes.transData, "axes fraction": axes.transAxes}.get(coords) if isinstance(coords, str) else coords
    if text.anncoords == "offset points":
        return text.xy, of, (float(text.xyann[0]), float(text.xyann[1]))
    if text.anncoords != coords or tuple(text.xyann) != tuple(text.xy):
        raise StaticOnlyError("a text away from what it belongs to")
    return text.xy, of, (0.0, 0.0)
