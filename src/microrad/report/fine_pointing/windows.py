"""Pointing errors in time windows, by source: tables for people, and the same as data."""

import math
from collections.abc import Sequence
from typing import Any

from microrad.core.units import format_quantity
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.loop.pointing_loop.windows import WindowedErrors
from microrad.report.fine_pointing.words import source_name
from microrad.report.quantities import micro, percent
from microrad.report.tables import Table, tables_text

BY_GAINS = "each hysteresis element counts by its slow gain, in a mirror of several axes by that about rest"
"""What linear theory makes of hysteresis."""


def index_name(index: ErrorIndex) -> str:
    """What an index is called at the head of a column, a line for each of its times."""
    lines: list[str] = [index.kind]
    lines += [] if index.window_s is None else [format_quantity(index.window_s, "s")]
    lines += [] if index.spacing_s is None else [f"{format_quantity(index.spacing_s, 's')} apart"]
    return "\n".join(lines)


def index_text(index: ErrorIndex) -> str:
    """The same in one line."""
    return index_name(index).replace("\n", " ")


def windows_text(errors: Sequence[WindowedErrors], controller: str, width: int, said: Sequence[str] = ()) -> str:
    """What is left by the loop, what there is without it, and what the rational forms make of that, for a terminal.

    Args:
        errors: One for each index.
        controller: Name of the loop's controller.
        width: Columns of the terminal.
        said: Sentences on the loop's disturbances, above the tables.
    """
    heads = [index_name(each.index) for each in errors]
    left = _by_source(f"Left by the loop under {controller}", heads, [each.left for each in errors])
    before = _by_source("Without the loop", heads, [each.before for each in errors])
    rows = []
    for each in errors:
        exact = _total(each.before)
        if not math.isnan(each.rational) and each.index.window_s is not None and exact > 0.0:
            off = percent(each.rational / exact - 1.0)
            rows.append((index_text(each.index), micro(exact), micro(each.rational), off))
    filters = Table("Without the loop, by linear filters", ("index", "exact", "rational", "off by"), rows)
    about = f"Radial rms in µrad, in theory: {BY_GAINS}."
    tables = tables_text([left, before, filters], [], width)
    return f"{tables_text([], [about, *said], width).strip()}\n\n{tables.rstrip()}"


def _by_source(title: str, heads: Sequence[str], columns: Sequence[dict[str, float]]) -> Table:
    rows = [(source_name(name), *(micro(column[name]) for column in columns)) for name in columns[0]]
    rows.append(("all", *(micro(_total(column)) for column in columns)))
    return Table(title, ("source", *heads), rows, totals=1)


def _total(rms_by_source: dict[str, float]) -> float:
    return math.hypot(*rms_by_source.values())


def windows_data(errors: Sequence[WindowedErrors]) -> list[dict[str, Any]]:
    """The same as data: radial rms in rad.

    Args:
        errors: One for each index.
    """
    return [
        {
            "index": each.index.kind,
            "window_s": each.index.window_s,
            "spacing_s": each.index.spacing_s,
            "left_rad": {**each.left, "all": _total(each.left)},
            "without_the_loop_rad": {**each.before, "all": _total(each.before)},
            "without_the_loop_rational_rad": None if math.isnan(each.rational) else each.rational,
        }
        for each in errors
    ]
