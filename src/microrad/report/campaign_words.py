"""A campaign in words: for a terminal, and as plain data."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from microrad.campaign.records import CampaignSummary, CellSummary, Interval, Limit, OutputSummary, Sensitivity, Tail
from microrad.report.day_words import duration, volume
from microrad.report.quantities import quantity
from microrad.report.tables import Table, tables_text

Row = tuple[str, ...]
MATTERS = 0.05
"""Sobol index from which an input is named."""
MOST_FAILED = 10
"""Failed rows of a table in a terminal; the rest are counted."""
_MOST_CELLS = 40
_USUAL = (0.5, 0.01, 0.99, 0.997, 0.003, 0.9, 0.1, 0.999, 0.001)  # quantiles, those to be shown before others first
_UNKNOWN, _TINY = "not known", 1e-300
SYMBOL = {"least": "≥", "most": "≤"}


# ------------------------------------------------------------------------------------------------------------- numbers
def share(probability: float) -> str:
    """A probability: in per cent with the digits that tell it from 0 and 1, below a thousandth as a power of ten."""
    if math.isnan(probability):
        return _UNKNOWN
    if 0.0 < probability < 1e-3:
        return power(probability)
    rest = 1.0 - probability
    if 0.0 < rest < 0.1:
        return f"{100.0 * probability:.{min(max(1 - math.floor(math.log10(100.0 * rest)), 1), 8)}f} %"
    return f"{100.0 * probability:.3g} %"


def power(number: float) -> str:
    """A number in two digits with its power of ten: "1.3e-6"."""
    mantissa, _, exponent = f"{number:.1e}".partition("e")
    return f"{mantissa.removesuffix('.0')}e{int(exponent)}"


def is_share(name: str, unit: str) -> bool:
    """Whether an output is a share of something, shown as a probability."""
    return unit in ("", "1") and (name in ("outage", "short") or name.endswith("_share"))


def value(number: float, unit: str, name: str = "") -> str:
    """A value of the output ``name`` with its unit as it stands in words."""
    if math.isnan(number):
        return _UNKNOWN
    if is_share(name, unit):
        return share(number)
    if unit in ("", "1"):
        return f"{number:.4g}"
    by_unit = {"s": duration, "bit": volume}
    return by_unit[unit](number) if unit in by_unit else quantity(number, unit)


def ends(interval: Interval, unit: str, name: str = "") -> str:
    """The interval alone: "3.1 dB to 3.3 dB", "at least 3.1 dB" where one end is not known, "" where neither is."""
    low, high = (value(end, unit, name) for end in (interval.low, interval.high))
    if math.isnan(interval.low):
        return "" if math.isnan(interval.high) else f"at most {high}"
    return f"at least {low}" if math.isnan(interval.high) else f"{low} to {high}"


def with_ends(interval: Interval, unit: str, name: str = "") -> str:
    """The estimate with its interval."""
    found = ends(interval, unit, name)
    return value(interval.value, unit, name) + (f" ({found})" if found else "")


def share_ends(interval: Interval) -> str:
    """A probability with its interval."""
    return with_ends(interval, "", "outage")


def limit_text(limit: Limit, unit: str) -> str:
    """What an output has to keep, as an inequality."""
    both = [
        f"{SYMBOL[side]} {value(bound, unit, limit.output)}"
        for side in ("least", "most")
        if (bound := getattr(limit, side)) is not None
    ]
    return f"{limit.output} {' and '.join(both)}"


# -------------------------------------------------------------------------------------------------------------- choice
def good(cell: CellSummary) -> int:
    """Rows of a cell that have results."""
    return cell.rows - cell.failed


def best(summary: CampaignSummary) -> CellSummary | None:
    """The cell shown in detail: of those with results the one that misses its limits least, the first of equals."""
    cells = [cell for cell in summary.cells if good(cell)]
    return min(cells, key=lambda cell: _last(cell.missed.value), default=None)


def _last(number: float) -> float:
    return math.inf if math.isnan(number) else number


def unit_of(summary: CampaignSummary, output: str) -> str:
    """The unit of an output; nothing where no cell has it."""
    return next((cell.outputs[output].unit for cell in summary.cells if output in cell.outputs), "")


def ranked(found: Sensitivity) -> list[tuple[str, Interval]]:
    """Inputs and their total indices (first-order ones where there are no total ones), the largest first."""
    known = {key: index for key, index in (found.total or found.first).items() if not math.isnan(index.value)}
    return sorted(known.items(), key=lambda item: -item[1].value)


def beyond(tail: Tail, radius_rad: float) -> Interval | None:
    """Probability of a larger radial error, read off the tail in its logarithm; None below its radii.

    Beyond the largest error seen it is 0, its interval that of the last radius.
    """
    radius, seen = tail.radius_rad, tail.survival > 0.0
    if not seen.any() or radius_rad < radius[0]:
        return None
    if radius_rad > radius[seen][-1]:
        return Interval(0.0, 0.0, float(np.interp(radius_rad, radius, tail.high)), tail.confidence)
    read = [
        math.exp(np.interp(radius_rad, radius[seen], np.log(np.maximum(curve[seen], _TINY))))
        for curve in (tail.survival, tail.low, tail.high)
    ]
    return Interval(read[0], 0.0 if read[1] < math.sqrt(_TINY) else read[1], read[2], tail.confidence)


# ----------------------------------------------------------------------------------------------------------- sentences
def verdict(summary: CampaignSummary) -> str:
    """What the campaign comes to, in one word for the page.

    "pass" where in some cell of a complete campaign all rows keep all limits, "fail" where no row in any cell does,
    "open" else.
    """
    found = [cell.missed.value for cell in summary.cells if good(cell)]
    if not found:
        return "open" if summary.progress.state in ("waiting", "running") and not summary.failed else "fail"
    shown = best(summary)
    if min(found) == 0.0 and shown is not None and not shown.failed and summary.progress.state == "complete":
        return "pass"
    return "fail" if min(found) == 1.0 else "open"


def headline(summary: CampaignSummary) -> str:
    """The verdict in one sentence: how likely a row keeps the limits."""
    failed = sum(cell.failed for cell in summary.cells)
    shown = best(summary)
    if shown is None:
        if not failed:
            return "No row has been simulated yet."
        return "No row has results: " + ("the only one failed." if failed == 1 else f"all {failed} failed.")
    said = _said(summary, shown)
    return said if summary.progress.state == "complete" else f"So far: {said[0].lower()}{said[1:]}"


def _said(summary: CampaignSummary, shown: CellSummary) -> str:
    """How likely a row keeps the limits, where some rows have results."""
    if not shown.outputs and shown.tail is not None:
        return (tail_sentences(summary, shown) or ["The radius that is wanted is not known from these rows."])[0]
    if not summary.limits or math.isnan(shown.missed.value):
        return f"{_rows(sum(good(cell) for cell in summary.cells))} with results; no limit is set."
    if len(summary.cells) > 1:
        return _cells_said(summary, shown)
    return f"{_kept(shown, _limits_named(summary))}."


def _rows(count: int) -> str:
    return "1 row" if count == 1 else f"{count} rows"


def _limits_named(summary: CampaignSummary) -> str:
    if len(summary.limits) > 1:
        return "both limits" if len(summary.limits) == 2 else f"all {len(summary.limits)} limits"
    return limit_text(summary.limits[0], unit_of(summary, summary.limits[0].output))


def _kept(cell: CellSummary, limits: str) -> str:
    """What share of a cell's rows keeps the limits."""
    missed, rows = cell.missed, good(cell)
    sure, kept = f"at {100.0 * missed.confidence:g} % confidence", complement(missed)
    if missed.value == 0.0:
        which = "The only row keeps" if rows == 1 else f"All {rows} rows keep"
        return f"{which} {limits}" + _bound(f"{sure} at least", kept.low)
    if missed.value == 1.0:
        which = "The only row misses" if rows == 1 else f"None of {rows} rows keeps"
        return f"{which} {limits}" + _bound(f"{sure} at most", kept.high)
    between = ends(kept, "", "outage")
    return f"{share(kept.value)} of the rows keep {limits}" + (f" ({between} {sure})" if between else "")


def _bound(words: str, probability: float) -> str:
    return "" if math.isnan(probability) else f"; {words} {share(probability)} of all draws do"


def complement(missed: Interval) -> Interval:
    """The probability of the opposite."""
    return Interval(1.0 - missed.value, 1.0 - missed.high, 1.0 - missed.low, missed.confidence)


def _cells_said(summary: CampaignSummary, shown: CellSummary) -> str:
    limits, count = _limits_named(summary), len(summary.cells)
    known = [cell for cell in summary.cells if good(cell) and not math.isnan(cell.missed.value)]
    worst = max(known, key=lambda cell: cell.missed.value)
    if shown.missed.value == worst.missed.value:
        return f"In each of {count} combinations {share(1.0 - worst.missed.value)} of the rows keep {limits}."
    sure = f"intervals at {100.0 * shown.missed.confidence:g} %"
    kept, least = (share_ends(complement(cell.missed)) for cell in (shown, worst))
    whole = sum(cell.missed.value == 0.0 for cell in known)
    most = f"{shown.label} keeps {limits} most often, in {kept} of its rows"
    if whole > 1:
        most = f"{whole} keep {limits} in all of their rows, the first of them {shown.label}"
    return f"Of {count} combinations, {most}; {worst.label} least often, in {least} ({sure})."


def matters(summary: CampaignSummary) -> list[str]:
    """Which inputs act most on each output that has a limit; on the first ones where none has."""
    limited = [limit.output for limit in summary.limits]
    wanted = [s for s in summary.sensitivities if s.output in limited] or list(summary.sensitivities[:3])
    return [_matters(each) for each in wanted]


def _matters(found: Sensitivity) -> str:
    named = [f"{key} {_index(index)}" for key, index in ranked(found) if index.value >= MATTERS][:3]
    kind = "total" if found.total else "first-order"
    if not named:
        return f"No input by itself decides {found.output}{f': {found.note}' if found.note else ''}."
    note = f"; {found.note}" if found.note else ""
    return f"What matters most to {found.output} ({kind} Sobol index): {', '.join(named)}{note}."


def tail_sentences(summary: CampaignSummary, cell: CellSummary | None) -> list[str]:
    """The radius exceeded with the least probability that is known, and how likely the error is beyond its limit."""
    if cell is None or cell.tail is None:
        return []
    tail, found = cell.tail, []
    known = {p: radius for p, radius in tail.wanted.items() if not math.isnan(radius.value)}
    if known:
        p, radius = min(known.items())
        exceeded = f"The radial error exceeds {value(radius.value, 'rad')} with probability {share(p)}"
        found.append(f"{exceeded}{_sure(radius)}.")
    for bound in sorted({limit.most for limit in summary.limits if limit.most and limit.output.startswith("residual")}):
        if (past := beyond(tail, bound)) and not past.value:
            found.append(f"No radial error beyond {value(bound, 'rad')} was seen{_sure(past, 'outage', '')}.")
        elif past:
            likely = f"The radial error is beyond {value(bound, 'rad')} with probability {share(past.value)}"
            found.append(f"{likely}{_sure(past, 'outage', '')}.")
    return found


def answers(summary: CampaignSummary, cell: CellSummary | None) -> list[str]:
    """What follows the verdict: what matters most, and the tail."""
    said = headline(summary)
    return [each for each in (*matters(summary), *tail_sentences(summary, cell)) if each != said]


def tail_method(tail: Tail) -> str:
    """Where a tail comes from, and what it is worth."""
    worth = f", worth {power(tail.effective_runs)} independent errors" if math.isfinite(tail.effective_runs) else ""
    return f"From {tail.method}{worth}."


def _sure(interval: Interval, name: str = "", unit: str = "rad") -> str:
    found = ends(interval, unit, name)
    return f" ({found} at {100.0 * interval.confidence:g} % confidence)" if found else ""


def progress_words(summary: CampaignSummary) -> str:
    """How far the campaign is, its pace and the time left."""
    p = summary.progress
    pace = f"{p.rows_per_s:.3g} rows a second" if p.rows_per_s > 0.0 else ""
    if p.state == "complete":
        return ", ".join([f"Complete: {_rows(p.rows_done)} in {duration(p.seconds)}", *filter(None, [pace])]) + "."
    done = f"{p.rows_done} of {p.rows_total} rows" if p.rows_done <= p.rows_total else _rows(p.rows_done)
    if p.state == "waiting":
        return f"Not begun: {done}."
    if p.state == "stopped":
        return f"Stopped after {done}; microrad campaign resume goes on from there."
    left = f"{duration(p.left_s)} left" if math.isfinite(p.left_s) else ""
    return ", ".join([f"Running: {done}", *filter(None, [pace, left])]) + "."


def setting(summary: CampaignSummary) -> list[str]:
    """How the rows were made."""
    drawn = "1 drawn input" if len(summary.inputs) == 1 else f"{len(summary.inputs) or 'no'} drawn inputs"
    loop = f"Loop: {summary.loop}." if summary.loop else "No loop is simulated: the links are at their budgeted errors."
    fixed = [f"Set: {', '.join(f'{key} = {text}' for key, text in summary.fixed.items())}."] if summary.fixed else []
    return [f"Sampling {summary.sampling}, {drawn}, seed {summary.seed}.", loop, *fixed]


# -------------------------------------------------------------------------------------------------------------- tables
def limit_table(summary: CampaignSummary, cell: CellSummary) -> tuple[Row, list[Row]]:
    """Headings and rows: each limit, how many rows miss it, and where it comes from."""
    rows: list[Row] = []
    for limit in summary.limits:
        if missed := cell.missed_by.get(limit.output):
            kept = limit_text(limit, unit_of(summary, limit.output))
            rows.append((kept, share(missed.value), ends(missed, "", "outage"), limit.source))
    return ("limit", "missed by", f"{100.0 * cell.missed.confidence:g} % interval", "from"), rows


def chosen_quantiles(outputs: Sequence[OutputSummary], most: int) -> list[float]:
    """Probabilities of at most ``most`` quantiles, rising, the usual ones before others."""
    known = sorted({p for output in outputs for p in output.quantiles})
    order = sorted(known, key=lambda p: (_USUAL.index(p) if p in _USUAL else len(_USUAL), p))
    return sorted(order[:most])


def output_table(cell: CellSummary, most: int) -> tuple[Row, list[Row]]:
    """Headings and rows: each output that differs, with mean, deviation and at most ``most`` quantiles."""
    outputs = [output for output in cell.outputs.values() if output.rows and output.most > output.least]
    chosen = chosen_quantiles(outputs, most)
    rows = [
        (
            o.name,
            value(o.mean.value, o.unit, o.name),
            value(o.deviation, o.unit, o.name),
            *(value(o.quantiles[p].value, o.unit, o.name) if p in o.quantiles else "" for p in chosen),
        )
        for o in outputs
    ]
    return ("output", "mean", "deviation", *(f"{100.0 * p:.6g} %" for p in chosen)), rows


def even(cell: CellSummary | None) -> list[str]:
    """The outputs that are the same in every row."""
    outputs = [] if cell is None else [o for o in cell.outputs.values() if o.rows and o.most == o.least]
    named = ", ".join(f"{o.name} {value(o.least, o.unit, o.name)}" for o in outputs)
    return [f"The same in every row: {named}."] if named else []


def cell_table(summary: CampaignSummary) -> tuple[Row, list[Row]]:
    """Headings and rows: each combination of the grid, and how many rows keep the limits there."""
    keys = list(dict.fromkeys(key for cell in summary.cells for key in cell.values))
    names = [limit.output for limit in summary.limits]
    headings = (*keys, *(("keep all",) if names else ()), "rows", "failed", *(f"miss {name}" for name in names))
    return headings, [_cell_row(cell, keys, names) for cell in summary.cells]


def _cell_row(cell: CellSummary, keys: Sequence[str], names: Sequence[str]) -> Row:
    kept = [share_ends(complement(cell.missed))] if names else []
    by = [share(cell.missed_by[name].value) if name in cell.missed_by else "" for name in names]
    if not good(cell):
        kept, by = [""] * len(kept), [""] * len(by)
    return (*(cell.values.get(key, "") for key in keys), *kept, str(good(cell)), str(cell.failed), *by)


def tail_table(tail: Tail) -> tuple[Row, list[Row]]:
    """Headings and rows: the radii that are exceeded with the wanted probabilities."""
    wanted = sorted(tail.wanted.items(), reverse=True)
    rows: list[Row] = [(share(p), value(radius.value, "rad"), ends(radius, "rad")) for p, radius in wanted]
    return ("probability", "radial error", f"{100.0 * tail.confidence:g} % interval"), rows


INDEX_HEADINGS = ("output", "input", "first order", "total", "rank correlation")


def index_rows(found: Sequence[Sensitivity]) -> list[Row]:
    """Sobol indices and rank correlations of each output, the inputs that act most on it first."""
    return [
        (s.output, key, _index(s.first.get(key)), _index(s.total.get(key)), _index(s.rank_correlation.get(key)))
        for s in found
        for key, _ in ranked(s)
    ]


def _index(index: Interval | None) -> str:
    if index is None or math.isnan(index.value):
        return ""
    text = f"{index.value:.2f} ({index.low:.2f} to {index.high:.2f})"
    return text.replace("-", "\u2212")  # a minus sign, not a hyphen


FAILED_HEADINGS = ("row", "seed", "tries", "reason")


def failed_rows(summary: CampaignSummary, most: int) -> list[Row]:
    """Rows without results, with the combination of the grid where there is one."""
    return [
        (
            f"{each.row}" + (f" of {summary.cells[cell].label}" if summary.cells[cell].values else ""),
            str(each.seed),
            str(each.attempts),
            each.reason,
        )
        for cell, each in summary.failed[:most]
    ]


def more_failed(summary: CampaignSummary, shown: int) -> str:
    """How many failed rows are not shown; nothing where all are."""
    more = sum(cell.failed for cell in summary.cells) - shown
    return f"{more} more failed rows are in the export." if more > 0 else ""


def text(summary: CampaignSummary, width: int) -> str:
    """The campaign for a terminal of ``width`` columns: the verdict first, how far it is last."""
    cell = best(summary)
    tables, below = _tables(summary, cell, width), [*even(cell), *answers(summary, cell)]
    last = [*(f"Warning: {warning}" for warning in summary.warnings), progress_words(summary)]
    failed = failed_rows(summary, MOST_FAILED)
    if more := more_failed(summary, len(failed)):
        last = [more, *last]
    parts = [tables_text([], [headline(summary), ""], width), tables_text(tables, below, width)]
    if failed:
        parts.append("\n" + tables_text([Table("Failed rows", FAILED_HEADINGS, failed, (0, 3))], [], width))
    return "\n".join([*filter(None, parts), tables_text([], last, width)])


def _tables(summary: CampaignSummary, cell: CellSummary | None, width: int) -> list[Table]:
    found = []
    if len(summary.cells) > 1:
        keys = len(summary.cells[0].values)
        headings, rows = _narrowed(*cell_table(summary), keys + 2, width)
        found.append(Table("Combinations", headings, rows[:_MOST_CELLS], tuple(range(keys))))
    if cell is None:
        return found
    of = f" of {cell.label}" if cell.values else ""
    if summary.limits:
        found.append(Table(f"Limits{of}", *limit_table(summary, cell), (0, 3)))
    narrower = (output_table(cell, most) for most in range(len(_USUAL), 0, -1))
    headings, rows = next((t for t in narrower if _wide(*t) <= width), output_table(cell, 1))
    if rows:
        found.append(Table(f"Outputs{of}, and their quantiles over the rows", headings, rows, (0,)))
    if cell.tail is not None:
        found.append(Table(f"Radial errors{of} that are exceeded", *tail_table(cell.tail), (2,)))
    return found


def _wide(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> int:
    """Columns of a terminal that a table takes."""
    return sum(max(map(len, column)) + 3 for column in zip(headings, *rows, strict=True))


def _narrowed(headings: Row, rows: Sequence[Row], least: int, width: int) -> tuple[Row, list[Row]]:
    """A table without the last columns that there is no room for, ``least`` columns at least."""
    kept = next(
        (n for n in range(len(headings), least, -1) if _wide(headings[:n], [row[:n] for row in rows]) <= width), least
    )
    return headings[:kept], [row[:kept] for row in rows]


# ---------------------------------------------------------------------------------------------------------------- data
def data(summary: CampaignSummary) -> dict[str, Any]:
    """The summary as plain data in SI units, each output with its unit; single rows and traces are the export's."""
    return {
        "name": summary.name,
        "mission": summary.mission_name,
        "verdict": headline(summary),
        "hashes": dict(summary.hashes),
        "seed": summary.seed,
        "sampling": summary.sampling,
        "loop": summary.loop,
        "inputs": [asdict(each) for each in summary.inputs],
        "set": dict(summary.fixed),
        "limits": [{**asdict(limit), "unit": unit_of(summary, limit.output)} for limit in summary.limits],
        "cells": [_cell_data(cell) for cell in summary.cells],
        "sensitivities": [asdict(each) for each in summary.sensitivities],
        "worst": [{key: getattr(each, key) for key in ("cell", "row", "output", "value")} for each in summary.worst],
        "failed": [{"cell": cell, **asdict(each)} for cell, each in summary.failed],
        "progress": asdict(summary.progress),
        "warnings": list(summary.warnings),
    }


def _cell_data(cell: CellSummary) -> dict[str, Any]:
    return {
        "values": dict(cell.values),
        "rows": good(cell),
        "failed": cell.failed,
        "missed": asdict(cell.missed),
        "missed_by": {name: asdict(missed) for name, missed in cell.missed_by.items()},
        "outputs": [_output_data(output) for output in cell.outputs.values()],
        "tail": None if cell.tail is None else _tail_data(cell.tail),
    }


def _output_data(output: OutputSummary) -> dict[str, Any]:
    return {
        **{key: getattr(output, key) for key in ("name", "unit", "meaning", "rows", "deviation", "least", "most")},
        "mean": asdict(output.mean),
        "quantiles": [{"probability": p, **asdict(each)} for p, each in output.quantiles.items()],
        "sketch_error": output.sketch_error,
        "edges": output.edges.tolist(),
        "counts": output.counts.tolist(),
    }


def _tail_data(tail: Tail) -> dict[str, Any]:
    curves = {key: getattr(tail, key).tolist() for key in ("radius_rad", "survival", "low", "high")}
    wanted = [{"probability": p, "unit": "rad", **asdict(each)} for p, each in tail.wanted.items()]
    kept = {key: getattr(tail, key) for key in ("confidence", "method", "effective_runs")}
    return {**curves, "wanted": wanted, **kept}
