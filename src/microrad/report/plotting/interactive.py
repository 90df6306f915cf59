"""A sheet as the JSON that the page's script draws it from with plotly: to hover, zoom and switch curves.

The static picture stays in the page; it is what prints, and what shows without JavaScript. Numbers keep six significant
digits, curves at most `palette.MOST_POINTS` points with their extremes.
"""

import html
import json
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from microrad.core.arrays import Floats
from microrad.report.plotting import scales
from microrad.report.plotting.layout import INCH, Box, Entry, Key, Layout, Placed, layout
from microrad.report.plotting.palette import BLACK, CIVIDIS, GREY, WHITE, clear, thinned
from microrad.report.plotting.sheet import Area, Axis, Bars, Dash, Field, Line, Rule, Sheet, Span, Words

DIGITS = 5
_POWERS = 1.25  # by so much plotly sets powers of ten larger than other texts
_PER_POINT = 96.0 / INCH  # CSS pixels
_WITH_UNIT = re.compile(r"(?P<name>.*\S)\s*\((?P<unit>[^()]+)\)", re.DOTALL)
_DASHES = {"-": "solid", "--": "dash", "-.": "dashdot", ":": "dot"}
_SYMBOLS = {"o": "circle", ".": "circle", "s": "square", "D": "diamond", "^": "triangle-up"}
_OPEN = {"x": "x-thin-open", "|": "line-ns-open"}
_CLEAR, _FONT_PX, _ABOVE_PX = "rgba(0,0,0,0)", 12, 3
_QUIET: dict[str, Any] = {"hoverinfo": "skip", "hovertemplate": None}


def plot_of(sheet: Sheet, found: Layout | None = None) -> dict[str, Any]:
    """A sheet as plain data.

    ``data`` and ``layout`` are plotly's but for the places of the panels: those stand in ``panels`` and ``scales``
    (colour bars) as boxes in CSS pixels for the width ``size[0]``, from which the page's script makes them for the
    width that it has. ``keys`` are the legends.

    Args:
        sheet: what is drawn.
        found: its layout where there is one already.
    """
    found = found or layout(sheet)
    drawn = Drawn(found)
    for number, each in enumerate(found.placed):
        pen = Pen(drawn, number, each)
        for mark in each.panel.marks:
            _MAKERS[type(mark)](pen, mark)
        pen.background()
        pen.title()
    return {
        "size": [round(found.width * _PER_POINT, 1), round(found.height * _PER_POINT, 1)],
        "keys": [_key(key, drawn) for key in found.keys],
        "data": drawn.data,
        "layout": {**_COMMON, **_axes(found), "shapes": drawn.shapes, "annotations": drawn.annotations},
        "panels": [_panel(number, each) for number, each in enumerate(found.placed)],
        "scales": drawn.scales,
        "heading": [{"text": sheet.heading, "color": sheet.heading_colour}] if sheet.heading else [],
        "ratio": any(panel.equal for panel in sheet.panels),
    }


def text_of(plot: dict[str, Any]) -> str:
    """The plot as text that may stand in a page: nothing in it ends the element around it."""
    text = json.dumps(plot, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


# ------------------------------------------------------------------------------------------------ numbers and words
def numbers(values: Any) -> list[float | int | None]:
    """Numbers with five significant digits, more where they differ by little; None for what is not finite."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    finite = flat[np.isfinite(flat)]
    span, most = (float(np.ptp(finite)), float(np.abs(finite).max())) if finite.size else (0.0, 0.0)
    digits = DIGITS + (max(0, math.floor(math.log10(most / span))) if span > 0.0 else 0)
    short = map(float, (f"%.{min(digits, 16)}g " * flat.size % tuple(flat.tolist())).split())  # all in one go
    return [int(s) if abs(s) < 1e15 and s.is_integer() else s if math.isfinite(s) else None for s in short]


def words(text: str) -> str:
    """A text as plotly's markup: nothing in it is a tag, a link or a place to fill."""
    escaped = html.escape(text, quote=False).replace("%{", "%&#123;")
    return escaped.replace("\n", "<br>")


def spoken(title: str, placeholder: str) -> str:
    """Part of a hover label: an axis's title with a value in it, the unit behind the value.

    Args:
        title: the axis's, with its unit in brackets at the end.
        placeholder: name of the value in plotly.
    """
    name, unit = _parts(title)
    unit = f" {words(unit)}".rstrip().replace(" °", "°")
    return f"{words(name) or placeholder}: %{{{placeholder}:.5~g}}{unit}"


def _parts(title: str) -> tuple[str, str]:
    """Name and unit of an axis's title, in one line; either may be missing."""
    line = " ".join(title.split())
    found = _WITH_UNIT.fullmatch(line)
    return (found["name"], found["unit"]) if found else (line, "")


def _word(axis: Axis, title: str, value: float) -> str:
    """A value in the words of the ticks, those nearest to it; "" for plain numbers."""
    named = axis.words
    if not named:
        return ""
    text = named[min(named, key=lambda at: abs(at - value))].replace("\n", " ")
    name, unit = _parts(title)
    return words(f"{name}: {text} {unit}".rstrip() if name and text[:1].isdigit() else text)


# ------------------------------------------------------------------------------------------------ axes and panels
_COMMON: dict[str, Any] = {
    "font": {"size": _FONT_PX, "color": "#1b1f24", "family": "system-ui, DejaVu Sans, sans-serif"},
    "hoverlabel": {"align": "left", "namelength": -1},
    "paper_bgcolor": _CLEAR,
    "plot_bgcolor": _CLEAR,
    "margin": dict.fromkeys("lrtb", 0),
    "showlegend": False,
    "hovermode": "closest",
    "dragmode": "zoom",
    "barmode": "overlay",
}


def _axes(found: Layout) -> dict[str, Any]:
    """Plotly's axes of all panels."""
    made: dict[str, Any] = {}
    for number, each in enumerate(found.placed):
        other = _name("y", number), _name("x", number)
        x = _axis(each, each.panel.x, each.x_ends, each.x_shown, other[0])
        y = _axis(each, each.panel.y, each.y_ends, each.y_shown, other[1])
        x |= {"matches": "x"} if found.sheet.share_x and number else {}
        y |= {"matches": "y"} if found.sheet.share_y and number else {}
        y |= {"scaleanchor": other[1], "scaleratio": 1.0} if each.panel.equal else {}
        made |= {f"xaxis{_number(number)}": x, f"yaxis{_number(number)}": y}
    return made


def _number(number: int) -> str:
    return str(number + 1) if number else ""


def _name(which: str, number: int) -> str:
    return f"{which}{_number(number)}"


def _axis(of: Placed, axis: Axis, ends: tuple[float, float], shown: bool, other: str) -> dict[str, Any]:
    made: dict[str, Any] = {
        "type": "log" if axis.log else "linear",
        "range": numbers([math.log10(end) if axis.log else end for end in ends]),
        "anchor": other,
        "showticklabels": shown,
        "ticks": "outside",
        "ticklen": 4,
        "ticklabeloverflow": "allow",
        "gridcolor": "#dddddd",
        "linecolor": "#1b1f24",
        "showgrid": axis.grid,
        "mirror": of.panel.framed,
        "showline": True,
        "zeroline": False,
        "title": {"text": words(axis.title), "standoff": 5},
        "tickfont": {"size": _pixels(axis.size)},
    }
    if axis.ticks is not None and (axis.words or axis.log):
        texts = [words(text) for text in axis.words.values()] or [f"{at:g}" for at in axis.ticks]
        return made | {"tickmode": "array", "tickvals": numbers([*axis.ticks]), "ticktext": texts}
    if axis.ticks is not None and not len(axis.ticks):
        return made | {"showticklabels": False, "ticks": ""}
    if axis.log:
        low, high = sorted(math.log10(end) for end in ends)
        made["nticks"] = max(math.ceil(high - low) + 1, 5)
        if scales.plain([*(of.x_ticks if axis is of.panel.x else of.y_ticks)]):
            return made | {"tickformat": "~g"}
        return made | {"exponentformat": "power", "tickfont": {"size": _pixels(axis.size / _POWERS)}}
    return made | {"exponentformat": "power", "minexponent": 5}


def _panel(number: int, of: Placed) -> dict[str, Any]:
    """Names of the axes, boxes in CSS pixels, and titles for when it stands alone."""
    x, y = f"xaxis{_number(number)}", f"yaxis{_number(number)}"
    left, top, right, bottom = of.outer
    beside = of.bar[2] if of.bar is not None else right  # the bar has a box of its own
    outer = (left, top, min(right, of.inner[2] + 14.0) if of.bar is not None else beside, bottom)
    titles = {x: words(of.x_title), y: words(of.y_title)}
    return {"x": x, "y": y, "inner": _box(of.inner), "outer": _box(outer), "titles": titles}


def _box(box: Box) -> list[float]:
    return [round(each * _PER_POINT, 1) for each in box]


def _pixels(points: float) -> float:
    return round(points * _PER_POINT, 2)


# ------------------------------------------------------------------------------------------------ marks
class Look(NamedTuple):
    """What a reader tells a thing by: its colour, how a line is dashed (or "area"), and its marker."""

    colour: str
    dash: Dash = ""
    marker: str = ""


class Turned(NamedTuple):
    """One thing that a legend may switch: in ``data`` or in ``shapes``, its place there, its panel, label and look."""

    kind: str
    number: int
    panel: int
    label: str
    look: Look


@dataclass(slots=True)
class Drawn:
    """Plotly's traces, shapes and annotations so far, and what legends need to know of them."""

    of: Layout
    data: list[dict[str, Any]] = field(default_factory=list)
    shapes: list[dict[str, Any]] = field(default_factory=list)
    annotations: list[dict[str, Any]] = field(default_factory=list)
    scales: list[dict[str, Any]] = field(default_factory=list)
    turned: list[Turned] = field(default_factory=list)


class Pen:
    """Adds what stands in one panel."""

    def __init__(self, to: Drawn, number: int, of: Placed) -> None:
        """A pen for the panel of that number."""
        self.to, self.number, self.of = to, number, of
        self.x, self.y = _name("x", number), _name("y", number)

    def trace(self, made: dict[str, Any], label: str, look: Look) -> None:
        """Add a trace, named by its label.

        Args:
            made: plotly's trace without axes and name.
            label: its name.
            look: what a reader tells it by.
        """
        self.to.data.append({"xaxis": self.x, "yaxis": self.y, "name": words(label), **made})
        self.to.turned.append(Turned("data", len(self.to.data) - 1, self.number, label, look))

    def shape(self, made: dict[str, Any], label: str, look: Look) -> None:
        """Add a shape, unless one of its places is none.

        Args:
            made: plotly's shape.
            label: what a legend calls it, or "".
            look: what a reader tells it by.
        """
        if None in made.values():
            return
        self.to.shapes.append(made)
        self.to.turned.append(Turned("shapes", len(self.to.shapes) - 1, self.number, label, look))

    def said(self, x: float, y: float) -> str:
        """The words at the ticks next to a point, where an axis has words.

        Args:
            x: on the horizontal axis.
            y: on the upright axis.
        """
        return _joined([_word(self.of.panel.y, self.of.y_title, y), _word(self.of.panel.x, self.of.x_title, x)])

    @property
    def named(self) -> bool:
        """Whether an axis has words for numbers."""
        return bool(self.of.panel.x.words or self.of.panel.y.words)

    def hover(self, *more: str) -> dict[str, Any]:
        """Hover label with both values and more, each with its name and unit, beside the name of the curve."""
        x = "" if self.of.panel.x.words else spoken(self.of.x_title, "x")
        y = "" if self.of.panel.y.words else spoken(self.of.y_title, "y")
        said = _joined(["%{text}" if self.named else "", x, y, *more])
        return {"hovertemplate": f"{said}<extra>%{{fullData.name}}</extra>"}

    def scatter(self, x: Floats, y: Floats, mode: str) -> dict[str, Any]:
        """Points or a curve.

        Args:
            x: on the horizontal axis, (n,).
            y: on the upright axis, (n,).
            mode: plotly's: lines, markers or both.
        """
        made = {"type": "scatter", "mode": mode, "x": numbers(x), "y": numbers(y), **self.hover()}
        if self.named:
            made["text"] = [self.said(a, b) for a, b in zip(np.ravel(x), np.ravel(y), strict=True)]
        return made

    def across(self, kind: str, ends: Sequence[float], upright: bool) -> dict[str, Any]:
        """A shape over the whole panel, between two values of one axis.

        Args:
            kind: line or rect.
            ends: the two values.
            upright: whether they are of x.
        """
        first, last = numbers(ends)
        values = {"x0": first, "x1": last, "xref": self.x, "y0": 0, "y1": 1, "yref": f"{self.y} domain"}
        if not upright:
            values = {"x0": 0, "x1": 1, "xref": f"{self.x} domain", "y0": first, "y1": last, "yref": self.y}
        return {"type": kind, "layer": "above" if kind == "line" else "below", **values}

    def background(self) -> None:
        """A background that is not the page's."""
        if self.of.panel.face:
            box = {"type": "rect", "x0": 0, "x1": 1, "y0": 0, "y1": 1, "layer": "below", "line": {"width": 0}}
            refs = {"xref": f"{self.x} domain", "yref": f"{self.y} domain", "fillcolor": self.of.panel.face}
            self.shape({**box, **refs}, "", Look(""))

    def title(self) -> None:
        """The title above the panel."""
        if self.of.panel.title:
            refs = {"xref": f"{self.x} domain", "yref": f"{self.y} domain", "x": 0, "y": 1, "yshift": _ABOVE_PX}
            place = {"xanchor": "left", "yanchor": "bottom", "showarrow": False, "font": {"size": _FONT_PX}}
            self.to.annotations.append({"text": words(self.of.panel.title), **refs, **place})


def _joined(parts: Sequence[str]) -> str:
    """Lines of a hover label; those without words are left out."""
    return "<br>".join(part for part in parts if part)


def _line(pen: Pen, line: Line) -> None:
    if not line.x.size:
        return
    label, look = line.label, Look(line.colour, line.dash, line.marker)
    name = {"name": words(line.name)} if line.name and not label else {}
    outside = {} if line.clip else {"cliponaxis": False}
    kept = line.kept
    if line.dash:
        shape = "hv" if line.steps else "linear"
        style = {**_pen(line.colour, line.width, line.dash), "shape": shape, "simplify": False}
        curve = {**pen.scatter(line.x[kept], line.y[kept], "lines"), "line": style, **outside, **name}
        whole = line.marker and line.every is None and kept.size == line.x.size
        marked = {"mode": "lines+markers", "marker": marker(line)} if whole else {}
        pen.trace({**curve, **marked, **_arms(line)}, label, look)
        if whole:
            return
    if line.marker:
        every: Any = slice(None) if line.every is None else list(line.every)
        points = {**pen.scatter(line.x[every], line.y[every], "markers"), "marker": marker(line), **outside, **name}
        pen.trace({**points, **(_QUIET if line.dash else {}), **({} if line.dash else _arms(line))}, label, look)


def _pen(colour: str, width: float, dash: Dash) -> dict[str, Any]:
    lengths = dash if isinstance(dash, str) else ",".join(f"{_pixels(length * width):g}px" for length in dash)
    return {"color": colour, "width": _pixels(width), "dash": _DASHES.get(lengths, lengths) or "solid"}


def _arms(line: Line) -> dict[str, Any]:
    """Error bars."""
    made = {}
    for which, arms in (("x", line.x_arms), ("y", line.y_arms)):
        if arms is not None:
            lengths = {"arrayminus": numbers(arms[0]), "array": numbers(arms[1])}
            look = {"color": line.colour, "thickness": 1.3, "width": 4}
            made[f"error_{which}"] = {"type": "data", "symmetric": False, **lengths, **look}
    return made


def marker(line: Line) -> dict[str, Any]:
    """The markers of a line; an open one has the colour of its edge."""
    size = _pixels(line.size * (0.5 if line.marker == "." else 1.0))
    open_ = line.marker in _OPEN or not line.inside
    symbol = _OPEN.get(line.marker) or _SYMBOLS[line.marker] + ("-open" if open_ else "")
    made: dict[str, Any] = {"symbol": symbol, "size": size, "color": line.around if open_ else line.inside}
    if line.marker != ".":
        made["line"] = {"color": line.around, "width": _pixels(line.edge_width)}
    return made


def _rule(pen: Pen, rule: Rule) -> None:
    shape = {**pen.across("line", [rule.at, rule.at], rule.upright), "line": _pen(rule.colour, rule.width, rule.dash)}
    pen.shape(shape, rule.label, Look(rule.colour, rule.dash))


def _span(pen: Pen, span: Span) -> None:
    tint = clear(span.colour, span.opacity)
    shape = pen.across("rect", pen.of.within(span), span.upright) | {"fillcolor": tint, "line": {"width": 0}}
    pen.shape(shape, span.label, Look(tint, "area"))


def _area(pen: Pen, area: Area) -> None:
    """Closed outlines, filled where an odd number of them is around: a shape; hatched ones are a trace."""
    tint = clear(area.colour, area.opacity)
    rings = [ring[thinned(*ring.T)] for ring in area.rings if len(ring) > 2]
    if not rings:
        return
    if area.hatched:
        gap = np.full((1, 2), np.nan)
        x, y = np.concatenate([part for ring in rings for part in (ring, gap)])[:-1].T
        pattern = {"shape": "/", "size": 6, "solidity": 0.15, "fgcolor": "#000000", "bgcolor": _CLEAR}
        made: dict[str, Any] = {"type": "scatter", "mode": "lines", "x": numbers(x), "y": numbers(y)}
        made |= {"fill": "toself", "fillpattern": pattern}
        pen.trace({**made, "line": {"width": 0, "color": "#000000"}, "hoverinfo": "skip"}, area.label, Look(""))
        return
    points = [zip(*map(numbers, ring.T), strict=True) for ring in rings]
    path = "".join("M" + "L".join(f"{a},{b}" for a, b in ring) + "Z" for ring in points)
    edge = {"color": area.edge, "width": _pixels(area.edge_width)} if area.edge else {"width": 0}
    shape = {"type": "path", "path": path, "fillrule": "evenodd", "xref": pen.x, "yref": pen.y, "layer": "between"}
    pen.shape({**shape, "fillcolor": tint, "line": edge}, area.label, Look(tint, "area"))


def _bars(pen: Pen, bars: Bars) -> None:
    along, across = ("y", "x") if bars.upright else ("x", "y")
    value, row = (pen.of.y_title, pen.of.x_title) if bars.upright else (pen.of.x_title, pen.of.y_title)
    axis = pen.of.panel.x if bars.upright else pen.of.panel.y

    def said(at: float, breadth: float, start: float, end: float) -> str:
        ends = f"{at - breadth / 2:.5g} to {at + breadth / 2:.5g}"
        of = _word(axis, row, at) or spoken(row, "@").replace("%{@:.5~g}", ends)
        shown = f"{end:.5g}" if start == 0.0 else f"{start:.5g} to {end:.5g}"
        return _joined([of, spoken(value, "@").replace("%{@:.5~g}", shown)])

    each = zip(bars.at.tolist(), bars.breadth.tolist(), bars.start.tolist(), bars.end.tolist(), strict=True)
    tint = clear(bars.colour, bars.opacity)
    made = {
        "type": "bar",
        "orientation": "v" if bars.upright else "h",
        along: numbers(bars.end - bars.start),
        across: numbers(bars.at),
        "width": numbers(bars.breadth),
        "base": numbers(bars.start),
        "marker": {"color": tint, "line": {"width": 0.5 if bars.edge else 0, "color": bars.edge or tint}},
        "hovertext": [said(*one) for one in each],
        "hovertemplate": "%{hovertext}<extra>%{fullData.name}</extra>",
    }
    pen.trace(made, bars.label, Look(tint, "area"))


def _field(pen: Pen, of: Field) -> None:
    z = np.reshape(np.array(numbers(of.z), dtype=object), of.z.shape).tolist()
    steps = [[round(k / (len(CIVIDIS) - 1), 4), colour] for k, colour in enumerate(CIVIDIS)]
    values = {"z": z, "x": numbers(of.x), "y": numbers(of.y), "colorscale": steps, "zauto": False, "showscale": False}
    low, high = numbers([of.low, of.high])
    trace: dict[str, Any] = {"type": "heatmap", **values, "zmin": low, "zmax": high}
    trace |= pen.hover(spoken(of.title or of.spoken or pen.of.panel.title, "z"))
    if of.levels is not None:
        first, last, step = float(of.levels[0]), float(of.levels[-1]), float(of.levels[1] - of.levels[0])
        contours = {"start": first, "end": last, "size": step, "coloring": "fill"}
        trace |= {"type": "contour", "line": {"width": 0}, "contours": contours}
    elif pen.named:
        trace["text"] = [[pen.said(a, b) for a in of.x] for b in of.y]
    if of.title and pen.of.bar is not None:
        title = {"text": words(of.title), "side": "right"}
        bar = {"title": title, "tickvals": numbers([*pen.of.bar_ticks]), "outlinewidth": 0}
        trace |= {"showscale": True, "colorbar": bar}
        left, top, _, bottom = pen.of.bar
        boxes = {"inner": _box(pen.of.bar), "outer": _box((left, top, pen.of.outer[2], bottom))}
        pen.to.scales.append({"trace": len(pen.to.data), "panel": pen.number, **boxes})
    pen.trace(trace, "", Look(""))


def _words(pen: Pen, text: Words) -> None:
    made: dict[str, Any] = {"text": words(text.text), "showarrow": False, "borderpad": 0}
    made["font"] = {"size": _pixels(text.size), "color": text.colour}
    for which, value, axis, name, shift in (
        ("x", text.x, pen.of.panel.x, pen.x, text.shift[0]),
        ("y", text.y, pen.of.panel.y, pen.y, text.shift[1]),
    ):
        free = which in text.of_panel
        at = value if free or not axis.log else math.log10(value) if value > 0.0 else math.nan
        made[which] = numbers([at])[0]
        made[f"{which}ref"] = f"{name} domain" if free else name
        made[f"{which}shift"] = _pixels(shift)
    made |= {"xanchor": {"start": "left", "middle": "center", "end": "right"}[text.anchor], "yanchor": text.base}
    if text.box:
        made["bgcolor"] = clear(WHITE, 0.75)
    if text.text and None not in (made["x"], made["y"]):
        pen.to.annotations.append(made)


_MAKERS: dict[type, Callable[[Pen, Any], None]] = {
    Line: _line,
    Rule: _rule,
    Span: _span,
    Area: _area,
    Bars: _bars,
    Field: _field,
    Words: _words,
}


# ------------------------------------------------------------------------------------------------ legends
def _key(key: Key, drawn: Drawn) -> dict[str, Any]:
    """A legend as a list of switches: a label, a swatch, and the traces and shapes that it switches."""
    looks = [_look(entry) for entry in key.entries]
    entries = []
    for entry, look in zip(key.entries, looks, strict=True):
        alone = [each.colour for each in looks].count(look.colour) == 1 and look.colour not in (BLACK, GREY, WHITE)
        found = [t for t in drawn.turned if _switched(t, entry.label, look, alone, key.panel)]
        for each in found:
            if each.kind == "data" and not drawn.data[each.number].get("name"):
                drawn.data[each.number]["name"] = words(entry.label)
        by_kind = {kind: [t.number for t in found if t.kind == kind] for kind in ("data", "shapes")}
        entries.append({"label": entry.label, **_swatch(entry), **by_kind})
    several = key.panel is not None and len(drawn.of.placed) > 1
    panel = drawn.of.placed[key.panel].panel.title if several and key.panel is not None else ""
    return {"title": " ".join(part for part in (panel, key.of.title) if part), "entries": entries}


def _switched(of: Turned, label: str, look: Look, alone: bool, panel: int | None) -> bool:
    """Whether an entry switches a thing: by its label; or by its look or the colour that the entry alone has."""
    if of.label:
        return of.label == label and panel in (None, of.panel)
    return bool(of.look.colour) and (of.look == look or (alone and of.kind == "data" and of.look.colour == look.colour))


def _look(entry: Entry) -> Look:
    if isinstance(entry, Line | Rule):
        return Look(entry.colour, entry.dash, entry.marker if isinstance(entry, Line) else "")
    return Look(clear(entry.colour, entry.opacity), "area")


def _swatch(entry: Entry) -> dict[str, Any]:
    """What stands beside a label: a line, a marker on it or alone, or an area."""
    if not isinstance(entry, Line | Rule):
        return {"area": clear(entry.colour, entry.opacity)}
    made: dict[str, Any] = {"line": _pen(entry.colour, entry.width, entry.dash)} if entry.dash else {}
    if isinstance(entry, Line) and entry.marker:
        made["marker"] = marker(entry)
    return made
