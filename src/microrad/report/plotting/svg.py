"""The static picture of a sheet: what is in the page before its script runs, in print, and as a file."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from html import escape
from typing import Any

import numpy as np

from microrad.core.arrays import Floats
from microrad.report.plotting import scales
from microrad.report.plotting.layout import (
    ENTRY_GAP,
    INCH,
    PAD,
    SWATCH,
    SWATCH_GAP,
    TICK,
    TITLE,
    Box,
    Entry,
    Key,
    Layout,
    Placed,
    at,
    corners,
    layout,
)
from microrad.report.plotting.palette import BLACK, WHITE, colour_at, thinned
from microrad.report.plotting.scales import LINE
from microrad.report.plotting.sheet import Area, Bars, Dash, Field, Line, Rule, Sheet, Span, Words, region

_GRID, _FRAME = "#dddddd", "#1b1f24"
_DASHES: dict[str, tuple[float, ...]] = {"-": (), "--": (3.7, 1.6), "-.": (6.4, 1.6, 1.0, 1.6), ":": (1.0, 1.65)}
HATCH_ID, HATCH_FILL = 'id="hatch"', 'fill="url(#hatch)"'
_HATCH = (
    f'<defs><pattern {HATCH_ID} width="5" height="5" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
    '<path d="M0 0V5" stroke="#000000" stroke-width="1.2"/></pattern></defs>'
)
_FONT = "system-ui, 'DejaVu Sans', sans-serif"


def svg_of(sheet: Sheet, found: Layout | None = None) -> str:
    """The sheet as the text of an <svg> element, its coordinates to a hundredth of a point.

    Args:
        sheet: what is drawn.
        found: its layout where there is one already.
    """
    found = found or layout(sheet)
    size = f'width="{found.width / INCH * 96:.0f}" height="{found.height / INCH * 96:.0f}"'
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {found.width:.5g} {found.height:.5g}" '
        f'font-family="{_FONT}" fill="{_FRAME}" stroke-linejoin="round">'
    )
    hatched = any(area.hatched for panel in sheet.panels for area in panel.all_of(Area))
    parts = [head, _HATCH if hatched else "", *_heading(found)]
    parts += [part for each in found.placed for part in _panel(each)]
    parts += [part for key in found.keys for part in _key(key)]
    return "\n".join([*filter(None, parts), "</svg>\n"])


def _heading(found: Layout) -> Iterator[str]:
    sheet = found.sheet
    if sheet.heading and not sheet.panels:
        x, y = found.width / 2.0, found.height / 2.0
        yield _text(sheet.heading, x, y, TITLE, "middle", "middle", sheet.heading_colour)
    elif sheet.heading:
        x, anchor = (PAD, "start") if sheet.heading_at_left else (found.width - PAD, "end")
        yield _text(sheet.heading, x, PAD, TITLE, anchor, "top", sheet.heading_colour)


# ------------------------------------------------------------------------------------------------ a panel
def _panel(of: Placed) -> Iterator[str]:
    panel, (left, top, *_) = of.panel, of.inner
    if panel.face:
        yield f'<rect {_rect(of.inner)} fill="{panel.face}"/>'
    yield from _grid(of)
    # An element of its own cuts off what lies outside of the data's box.
    yield f'<svg {_rect(of.inner)}><g transform="translate({-left:.2f} {-top:.2f})">'
    over: list[str] = []
    for mark in panel.marks:
        made = _MAKERS[type(mark)](of, mark)
        free = isinstance(mark, Words) or (isinstance(mark, Line) and not mark.clip)
        if free:
            over += made
        else:
            yield from made
    yield "</g></svg>"
    yield from _frame(of)
    yield from over
    yield from _bar(of)


def _grid(of: Placed) -> Iterator[str]:
    left, top, right, bottom = of.inner
    for axis, found, upright in ((of.panel.x, of.x_ticks, True), (of.panel.y, of.y_ticks, False)):
        if axis.grid and found:
            lines = "".join(
                f"M{p:.2f} {top:.2f}V{bottom:.2f}" if upright else f"M{left:.2f} {p:.2f}H{right:.2f}"
                for p in _along(of, found, upright)
            )
            yield f'<path d="{lines}" stroke="{_GRID}" stroke-width="0.6" fill="none"/>'


def _along(of: Placed, values: Any, upright: bool) -> list[float]:
    """Points of values of x, or of y."""
    values = np.array([*values], dtype=np.float64)
    low = np.full(values.shape, of.y_ends[0] if upright else of.x_ends[0])
    x, y = at(of, values, low) if upright else at(of, low, values)
    return list((x if upright else y).tolist())


def _frame(of: Placed) -> Iterator[str]:
    """Axes, ticks, their texts and titles."""
    left, top, right, bottom = of.inner
    panel = of.panel
    outline = f"M{left:.2f} {top:.2f}V{bottom:.2f}H{right:.2f}" + (f"V{top:.2f}Z" if panel.framed else "")
    small = scales.minor(panel.x, of.x_ends), scales.minor(panel.y, of.y_ends)
    strokes = ""
    for long, x_ticks, y_ticks in ((TICK, of.x_ticks, of.y_ticks), (2, *small)):
        strokes += "".join(f"M{p:.2f} {bottom:.2f}v{long}" for p in _along(of, x_ticks, True))
        strokes += "".join(f"M{left:.2f} {p:.2f}h-{long}" for p in _along(of, y_ticks, False))
    yield f'<path d="{outline}{strokes}" stroke="{_FRAME}" stroke-width="0.8" fill="none"/>'
    if of.x_shown:
        for p, text in zip(_along(of, of.x_ticks, True), of.x_ticks.values(), strict=True):
            yield _text(text, p, bottom + TICK + PAD, panel.x.size, "middle", "top")
    if of.y_shown:
        for p, text in zip(_along(of, of.y_ticks, False), of.y_ticks.values(), strict=True):
            yield _text(text, left - TICK - PAD, p, panel.y.size, "end", "middle")
    if panel.x.title:
        below = scales.height_of(max(of.x_ticks.values(), key=lambda t: t.count("\n"), default=""), panel.x.size)
        beneath = TICK + PAD + below if of.x_shown else PAD
        yield _text(panel.x.title, (left + right) / 2.0, bottom + beneath + PAD, TITLE, "middle", "top")
    if panel.y.title:
        texts = [scales.width_of(text, panel.y.size) for text in of.y_ticks.values()]
        beside = TICK + PAD + max(texts, default=0.0) if of.y_shown else PAD
        high = scales.height_of(panel.y.title, TITLE)
        x = left - beside - PAD - high / 2.0
        yield _text(panel.y.title, x, (top + bottom) / 2.0, TITLE, "middle", "middle", turned=True)
    if panel.title:
        yield _text(panel.title, left, top - PAD, panel.title_size, "start", "bottom")


def _bar(of: Placed) -> Iterator[str]:
    """The colour bar of a field."""
    if of.bar is None or (field := of.colours) is None:
        return
    left, top, right, bottom = of.bar
    ends = field.levels if field.levels is not None else np.linspace(field.low, field.high, 65)
    for low, high in itertools.pairwise(ends):
        a, b = (bottom - (v - field.low) / (field.high - field.low) * (bottom - top) for v in (low, high))
        tint = colour_at(((low + high) / 2.0 - field.low) / (field.high - field.low))
        yield f'<rect x="{left:.2f}" y="{b:.2f}" width="{right - left:.2f}" height="{a - b + 0.3:.2f}" fill="{tint}"/>'
    widest = 0.0
    for value, text in of.bar_ticks.items():
        p = bottom - (value - field.low) / (field.high - field.low) * (bottom - top)
        widest = max(widest, scales.width_of(text, TITLE))
        yield f'<path d="M{right:.2f} {p:.2f}h{TICK}" stroke="{_FRAME}" stroke-width="0.8"/>'
        yield _text(text, right + TICK + PAD, p, TITLE, "start", "middle")
    x = right + TICK + 2 * PAD + widest + scales.height_of(field.title, TITLE) / 2.0
    yield _text(field.title, x, (top + bottom) / 2.0, TITLE, "middle", "middle", turned=True)


# ------------------------------------------------------------------------------------------------ marks
def _line(of: Placed, line: Line) -> list[str]:
    if not line.x.size:
        return []
    kept = line.kept
    x, y = at(of, line.x, line.y)
    made = []
    if line.dash:
        a, b = (np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]) if line.steps else (x[kept], y[kept])
        made.append(f'<path d="{_curve(a, b)}" fill="none" {_stroke(line.colour, line.width, line.dash)}/>')
    if line.x_arms is not None or line.y_arms is not None:
        made.append(_arms(of, line))
    if line.marker:
        points = slice(None) if line.every is None else list(line.every)
        made += _markers(x[points], y[points], line)
    return made


def _curve(x: Floats, y: Floats) -> str:
    """A path through points in hundredths; gaps stay gaps."""
    known = np.isfinite(x) & np.isfinite(y)
    begins = known & ~np.r_[False, known[:-1]]
    # Far outside nothing can be seen, and large numbers are not drawn well.
    a = np.clip(np.round(x[known], 2), -1e5, 1e5).tolist()
    b = np.clip(np.round(y[known], 2), -1e5, 1e5).tolist()
    return "".join(f"{'M' if new else 'L'}{p:g} {q:g}" for p, q, new in zip(a, b, begins[known].tolist(), strict=True))


def _stroke(colour: str, width: float, dash: Dash) -> str:
    lengths = _DASHES[dash] if isinstance(dash, str) else dash
    dashes = f' stroke-dasharray="{" ".join(f"{each * width:.3g}" for each in lengths)}"' if lengths else ""
    return f'stroke="{colour}" stroke-width="{width:g}"{dashes}'


def _arms(of: Placed, line: Line) -> str:
    """Error bars with caps."""
    zeros = np.zeros((2, line.x.size))
    path = ""
    for arms, level in ((line.x_arms, True), (line.y_arms, False)):
        if arms is None:
            continue
        dx, dy = (arms, zeros) if level else (zeros, arms)
        ends = np.stack([*at(of, line.x - dx[0], line.y - dy[0]), *at(of, line.x + dx[1], line.y + dy[1])], axis=1)
        for a, b, c, d in ends[np.isfinite(ends).all(axis=1)].tolist():
            cap = (0.0, 3.0) if level else (3.0, 0.0)
            stroke = f"l{2 * cap[0]:g} {2 * cap[1]:g}"
            caps = "".join(f"M{p - cap[0]:.2f} {q - cap[1]:.2f}{stroke}" for p, q in ((a, b), (c, d)))
            path += f"M{a:.2f} {b:.2f}L{c:.2f} {d:.2f}{caps}" if (a, b) != (c, d) else ""
    return f'<path d="{path}" fill="none" stroke="{line.colour}" stroke-width="1"/>' if path else ""


def _markers(x: Floats, y: Floats, line: Line) -> list[str]:
    known = np.isfinite(x) & np.isfinite(y)
    half = line.size / 2.0
    shape: Callable[[float, float], str] = {
        "o": lambda p, q: _circle(p, q, half),
        ".": lambda p, q: _circle(p, q, half / 2.0),
        "s": lambda p, q: f"M{p - half:.2f} {q - half:.2f}h{line.size:g}v{line.size:g}h{-line.size:g}Z",
        "D": lambda p, q: f"M{p - half:.2f} {q:.2f}l{half:g} {half:g}l{half:g} {-half:g}l{-half:g} {-half:g}Z",
        "^": lambda p, q: f"M{p - half:.2f} {q + half:.2f}h{line.size:g}l{-half:g} {-line.size:g}Z",
        "x": lambda p, q: _cross(p - half, q - half, line.size),
        "|": lambda p, q: f"M{p:.2f} {q - half:.2f}v{line.size:g}",
    }[line.marker]
    path = "".join(shape(p, q) for p, q in zip(x[known].tolist(), y[known].tolist(), strict=True))
    fill = "none" if line.marker in "x|" or not line.inside else line.inside
    width = 0.0 if line.marker == "." else line.edge_width
    return [f'<path d="{path}" fill="{fill}" stroke="{line.around}" stroke-width="{width:g}"/>']


def _circle(x: float, y: float, radius: float) -> str:
    half = f"a{radius:g} {radius:g} 0 1 0 "
    return f"M{x - radius:.2f} {y:.2f}{half}{2.0 * radius:g} 0{half}{-2.0 * radius:g} 0Z"


def _cross(left: float, top: float, size: float) -> str:
    return f"M{left:.2f} {top:.2f}l{size:g} {size:g}m0 {-size:g}l{-size:g} {size:g}"


def _rule(of: Placed, rule: Rule) -> list[str]:
    left, top, right, bottom = of.inner
    (p,) = _along(of, [rule.at], rule.upright)
    path = f"M{p:.2f} {bottom:.2f}V{top:.2f}" if rule.upright else f"M{left:.2f} {p:.2f}H{right:.2f}"
    return [f'<path d="{path}" fill="none" {_stroke(rule.colour, rule.width, rule.dash)}/>']


def _span(of: Placed, span: Span) -> list[str]:
    left, top, right, bottom = of.inner
    a, b = sorted(_along(of, of.within(span), span.upright))
    if not np.isfinite([a, b]).all():
        return []
    box = (a, top, b, bottom) if span.upright else (left, a, right, b)
    return [f'<rect {_rect(box)} fill="{span.colour}" fill-opacity="{span.opacity:g}"/>']


def _rect(box: Box) -> str:
    left, top, right, bottom = box
    return f'x="{left:.2f}" y="{top:.2f}" width="{right - left:.2f}" height="{bottom - top:.2f}"'


def _area(of: Placed, area: Area) -> list[str]:
    path = "".join(_curve(*at(of, *ring[thinned(*ring.T)].T)) + "Z" for ring in area.rings if len(ring) > 2)
    fill = HATCH_FILL if area.hatched else f'fill="{area.colour}"'
    edge = f' stroke="{area.edge}" stroke-width="{area.edge_width:g}"' if area.edge else ""
    return [f'<path d="{path}" {fill} fill-opacity="{area.opacity:g}" fill-rule="evenodd"{edge}/>'] if path else []


def _bars(of: Placed, bars: Bars) -> list[str]:
    (a, c), (b, d) = corners(of, bars)
    known = np.isfinite(a) & np.isfinite(b) & np.isfinite(c) & np.isfinite(d)
    path = "".join(
        f"M{p:.2f} {q:.2f}H{r:.2f}V{s:.2f}H{p:.2f}Z" for p, q, r, s in np.stack([a, b, c, d], axis=1)[known].tolist()
    )
    edge = f' stroke="{bars.edge}" stroke-width="0.5"' if bars.edge else ""
    return [f'<path d="{path}" fill="{bars.colour}" fill-opacity="{bars.opacity:g}"{edge}/>'] if path else []


def _field(of: Placed, field: Field) -> list[str]:
    """Cells of one colour each, those beside each other of the same colour together; filled contours between levels."""
    if field.levels is not None:
        return _levels(of, field, field.levels)
    x, y = (scales.edges_of(field, which) for which in "xy")
    across, down = at(of, x, np.full(x.shape, of.y_ends[0]))[0], at(of, np.full(y.shape, of.x_ends[0]), y)[1]
    made = []
    for row, values in enumerate(field.z):
        for column, value in enumerate(values):
            if np.isfinite(value):
                (a, b), (c, d) = sorted(across[column : column + 2]), sorted(down[row : row + 2])
                tint = colour_at((value - field.low) / (field.high - field.low))
                made.append(f'<rect {_rect((a, c, b, d))} fill="{tint}" stroke="{tint}" stroke-width="0.6"/>')
    return made


def _levels(of: Placed, field: Field, levels: Floats) -> list[str]:
    """Areas between levels, and beyond the first and the last of them."""
    ends = [-1e300, *levels.tolist(), 1e300]
    made = []
    for low, high in itertools.pairwise(ends):
        middle = (max(low, field.low) + min(high, field.high)) / 2.0
        tint = colour_at((middle - field.low) / (field.high - field.low))
        rings = region(field.x, field.y, field.z, low, high)
        path = "".join(_curve(*at(of, *ring.T)) + "Z" for ring in rings)
        if path:
            made.append(f'<path d="{path}" fill="{tint}" fill-rule="evenodd" stroke="{tint}" stroke-width="0.4"/>')
    return made


def _words(of: Placed, words: Words) -> list[str]:
    left, top, right, bottom = of.inner
    x, y = (float(each) for each in at(of, words.x, words.y))
    x = left + words.x * (right - left) if "x" in words.of_panel else x
    y = bottom - words.y * (bottom - top) if "y" in words.of_panel else y
    if not (np.isfinite(x) and np.isfinite(y)) or not words.text:
        return []
    x, y = x + words.shift[0], y - words.shift[1]
    made = [_text(words.text, x, y, words.size, words.anchor, words.base, words.colour)]
    if words.box:
        wide, high = scales.width_of(words.text, words.size), scales.height_of(words.text, words.size)
        from_x = x - {"start": 0.0, "middle": 0.5, "end": 1.0}[words.anchor] * wide
        from_y = y - {"top": 0.0, "middle": 0.5, "bottom": 1.0}[words.base] * high
        box = _rect((from_x, from_y, from_x + wide, from_y + high))
        made.insert(0, f'<rect {box} fill="{WHITE}" fill-opacity="0.75"/>')
    return made


_MAKERS: dict[type, Callable[[Placed, Any], list[str]]] = {
    Line: _line,
    Rule: _rule,
    Span: _span,
    Area: _area,
    Bars: _bars,
    Field: _field,
    Words: _words,
}


# ------------------------------------------------------------------------------------------------ texts and legends
def _text(
    text: str, x: float, y: float, size: float, anchor: str, base: str, colour: str = "", *, turned: bool = False
) -> str:
    """Lines of text, of which the first, the middle or the last one stands at y."""
    lines = text.split("\n")
    high = LINE * size * len(lines)
    above = {"top": 0.0, "middle": high / 2.0, "bottom": high}[base]
    first = 0.95 * size - above  # to the line that letters stand on
    turn = f' transform="rotate(-90 {x:.2f} {y:.2f})"' if turned else ""
    fill = f' fill="{colour}"' if colour and colour not in (BLACK, _FRAME) else ""
    where = f'font-size="{size:g}"' + (f' text-anchor="{anchor}"' if anchor != "start" else "")
    head = f'<text x="{x:.2f}" y="{y + first:.2f}" {where}{fill}{turn}>'
    if len(lines) == 1:
        return f"{head}{escape(text, quote=False)}</text>"
    parts = "".join(
        f'<tspan x="{x:.2f}" y="{y + first + LINE * size * k:.2f}">{escape(line, quote=False)}</tspan>'
        for k, line in enumerate(lines)
    )
    return f"{head}{parts}</text>"


def _key(key: Key) -> Iterator[str]:
    size, colour = key.of.size, key.of.colour
    line = LINE * 1.15 * size
    y = key.y
    if key.of.title:
        yield _text(key.of.title, key.x, y, size, "start", "top", colour)
        y += line
    x = key.x
    for number, wide in enumerate(key.columns):
        down = y
        for entry in key.entries[number * key.rows : (number + 1) * key.rows]:
            yield from _swatch(entry, x, down + line / 2.0)
            left, top = x + SWATCH + SWATCH_GAP, down + (line - LINE * size) / 2.0
            yield _text(entry.label, left, top, size, "start", "top", colour)
            down += line + LINE * size * entry.label.count("\n")
        x += wide + ENTRY_GAP


def _swatch(entry: Entry, x: float, y: float) -> Sequence[str]:
    """What stands beside a label."""
    middle = np.array([x + SWATCH / 2.0]), np.array([y])
    if isinstance(entry, Line | Rule):
        stroke = _stroke(entry.colour, entry.width, entry.dash or "-")
        made = [f'<path d="M{x:.2f} {y:.2f}h{SWATCH:g}" fill="none" {stroke}/>'] if entry.dash else []
        if isinstance(entry, Line) and entry.marker:
            made += _markers(*middle, entry)
        return made
    opacity = entry.opacity
    edge = f' stroke="{entry.edge}" stroke-width="0.5"' if isinstance(entry, Area | Bars) and entry.edge else ""
    box = _rect((x, y - 3.2, x + SWATCH, y + 3.2))
    return [f'<rect {box} fill="{entry.colour}" fill-opacity="{opacity:g}"{edge}/>']
