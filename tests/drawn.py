"""What a figure draws and what data hold as words and numbers of six digits, so that a test can hold all of it."""

import dataclasses
import math
import textwrap

import numpy as np

from microrad.report.tables import Table
from microrad.report.view import Points, Verdict, View

WIDE = 96
LEFT_OUT = ("row", "column", "marks", "panels")


def plain(value):
    """The value with its numbers in six digits: arrays as lists, records as dicts, nan as a word."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {each.name: plain(getattr(value, each.name)) for each in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if isinstance(value, float | np.floating):
        return float(f"{value:.6g}") + 0.0 if math.isfinite(value) else str(float(value))
    return value.item() if isinstance(value, np.generic) else value


def worded(value):
    """A value on one line."""
    if dataclasses.is_dataclass(value):
        return f"<{fields(value)}>"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{worded(key)}: {worded(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list | tuple | np.ndarray):
        return f"[{' '.join(map(worded, value))}]"
    found = plain(value)
    return f"{found:g}" if isinstance(found, float) else str(found)


def fields(of):
    """The fields of a record that are not as they are by themselves."""
    found = []
    for each in dataclasses.fields(of):
        usual = each.default if each.default_factory is dataclasses.MISSING else each.default_factory()
        text = worded(getattr(of, each.name))
        if each.name not in LEFT_OUT and (usual is dataclasses.MISSING or text != worded(usual)):
            found.append(f"{each.name}={text}")
    return " ".join(found)


def lines_of(sheet):
    """The whole sheet: a paragraph for it, for each panel and for each mark, as lines."""
    found = [f"Sheet {fields(sheet)}"]
    for panel in sheet.panels:
        found.append(f"Panel {panel.row} {panel.column} {fields(panel)}")
        found += [f"{type(mark).__name__} {fields(mark)}" for mark in panel.marks]
    apart = {"subsequent_indent": "  ", "break_long_words": False, "break_on_hyphens": False}
    return [line for each in found for line in textwrap.wrap(each, WIDE, **apart)]


def figure_of(figure):
    """A figure's sheet with its name, its title, its caption and its data."""
    return [figure.name, figure.title, figure.caption, plain(figure.columns), *lines_of(figure.sheet)]


def outlined(block):
    """A block as lines: titles with a #, tables with headings, columns of words and rows, names of figures."""
    named = f"[{getattr(block, 'name', '')}]"
    found = getattr(block, "text", block if isinstance(block, str) else named).split("\n")
    match block:
        case View(title=title):
            found = [f"# {title}{' (folded)' * block.folded}", *(x for b in block.blocks for x in outlined(b))]
        case Verdict(headline=said):
            found = [f"= {block.good}: {said}", *(x for b in block.blocks for x in outlined(b))]
        case Table(headings=headings, rows=rows):
            more = [f" {name} {list(of)}" for name, of in (("best", block.best), ("brief", block.brief)) if of]
            more += [f" totals {int(block.totals)}"] * bool(block.totals) + [" cards"] * block.cards
            more += [" " + ", ".join(f"{title} {count}" for title, count in block.groups)] * bool(block.groups)
            head = f"| {block.folded or block.title or '-'}: {' / '.join(headings)} {list(block.words)}"
            found = [head + "".join(more), *(" / ".join(map(str, row)) for row in rows)]
        case Points(lines=lines):
            found = [f"- {line}" for line in lines]
    return found


def outline(*blocks):
    """Blocks of a page as one text, in lines of a width that a test can hold."""
    lines = [line.replace("\n", "; ") for block in blocks for line in outlined(block)]
    return "\n".join(part.rstrip() for line in lines for part in textwrap.wrap(line, 116, subsequent_indent="  "))


def one_text(text):
    """What an outline has to be, from a text between lines of quotes."""
    return text.strip("\n")


def plot_lines(figure):
    """A figure of the studio's pages: its height, then a line for each axis, trace and shape in their order."""
    layout, found = figure["layout"], [f"height {figure['layout']['height']}, {figure['rows']} of it rows"]
    for name, axis in ((name, axis) for name, axis in layout.items() if name[1:].startswith("axis")):
        ticks = ", ".join(text for text in axis.get("ticktext", ()) if text)
        ends = " to ".join(f"{end:.4g}" for end in axis["range"])
        title, look = axis.get("title", {}).get("text", ""), "grid" if axis["showgrid"] else "bare"
        found.append(f"{name}: {title} {axis['type']} {ends} {look} {ticks}")
    for trace in figure["data"]:
        data = " ".join(f"{key}={_ends(trace[key])}" for key in ("x", "y", "base", "z") if key in trace)
        look = f"{_pen(trace.get('line', {}))} {_pen(trace.get('marker', {}))}"
        found.append(f"{trace['type']} {trace.get('name')}{' (keyed)' * trace['showlegend']}: {look} {data}")
    for each in layout["shapes"]:
        places = " ".join(f"{key}={each[key]:.6g}" for key in ("x0", "x1", "y0", "y1"))
        name = f"{each['type']} {each.get('name')}{' (keyed)' * bool(each.get('showlegend'))}"
        found.append(f"{name}: {_pen(each['line'])} {each.get('fillcolor', '')} {places} {each['layer']}")
    return [" ".join(line.split()) for line in found]


def _pen(of):
    return " ".join(worded(of[key]) for key in ("color", "width", "dash", "size", "symbol") if key in of)


def _ends(values):
    """Of few values all, of many the number, the first, one within and the last."""
    flat = [each for row in values for each in row] if isinstance(values[0], list) else list(values)
    told = [f"{each:.5g}" if isinstance(each, int | float) else str(each) for each in flat]
    return ",".join(told) if len(told) < 7 else f"{len(told)}:{told[0]}..{told[len(told) // 3]}..{told[-1]}"


def block_lines(blocks, depth=0):
    """What a view of the report holds: a line for each block, each row of a table and each point of a list."""
    found, lead = [], "  " * depth
    for block in blocks:
        kind, title = type(block).__name__, getattr(block, "title", getattr(block, "headline", ""))
        folded, good = getattr(block, "folded", ""), getattr(block, "good", None)
        text = block if isinstance(block, str) else f"{kind} {title or getattr(block, 'text', '')}"
        text += " (folded)" if folded is True else f" ({folded})" * bool(folded)
        found.append(f"{lead}{text}{f' {good}' * (good is not None)}")
        if kind == "Table":
            rows = [block.headings, *block.rows]
            found += [f"{lead}| {' | '.join(map(str, row))}" + f" = {block.totals}" * (row is rows[0]) for row in rows]
        found += [f"{lead}- {line}" for line in getattr(block, "lines", ())]
        found += block_lines(getattr(block, "blocks", ()), depth + 1)
    return [" / ".join(line.split("\n")).rstrip() for line in found]
