"""What a figure draws and what data hold as words and numbers of six digits, so that a test can hold all of it."""

import dataclasses
import math
import textwrap

import numpy as np

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
