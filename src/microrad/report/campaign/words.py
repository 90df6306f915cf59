"""A campaign in sentences."""

import math

import numpy as np

from microrad.campaign.records import CampaignSummary, CellSummary, Interval, OutputSummary, Sensitivity, Tail
from microrad.core.units import format_quantity
from microrad.report.campaign.numbers import bound, complement, ends, label, limit_text, share, share_ends, value
from microrad.report.campaign.tables import good, index_text, ranked, unit_of
from microrad.report.quantities import duration

MATTERS = 0.05
"""Sobol index from which an input is named."""
_TINY = 1e-300


# -------------------------------------------------------------------------------------------------------------- choice
def best(summary: CampaignSummary) -> CellSummary | None:
    """The cell shown in detail: of those with results the one that misses its limits least, the first of equals."""
    cells = [cell for cell in summary.cells if good(cell)]
    return min(cells, key=lambda cell: _last(cell.missed.value), default=None)


def _last(number: float) -> float:
    return math.inf if math.isnan(number) else number


def beyond(tail: Tail, radius_rad: float) -> Interval | None:
    """Probability of a larger radial error, read off the tail in its logarithm; None below its radii.

    Beyond the largest error seen it is 0, its interval that of the last radius.

    Args:
        tail: the tail of the radial error.
        radius_rad: the radius, in rad.
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
    """The verdict in one sentence: which rows failed, and how likely the others keep the limits."""
    failed = sum(cell.failed for cell in summary.cells)
    shown = best(summary)
    if shown is None:
        if not failed:
            return "No row has been simulated yet."
        return "No row has results: " + ("the only one failed." if failed == 1 else f"all {failed} failed.")
    said = _said(summary, shown)
    if failed:
        said = f"{failed} of {_rows(sum(cell.rows for cell in summary.cells))} failed; {_lower(said)}"
    return said if summary.progress.state == "complete" else f"So far: {_lower(said)}"


def _lower(sentence: str) -> str:
    """A sentence that goes on from a colon; names of keys stay as they are."""
    return sentence[0].lower() + sentence[1:]


def _said(summary: CampaignSummary, shown: CellSummary) -> str:
    """How likely a row keeps the limits, where some rows have results."""
    if not shown.outputs and shown.tail is not None:
        return (tail_sentences(summary, shown) or ["The radius that is wanted is not known from these rows."])[0]
    count = sum(good(cell) for cell in summary.cells)
    if not summary.limits:
        return f"{_rows(count)} with results; no limit is set."
    if math.isnan(shown.missed.value):
        they = "it keeps" if count == 1 else "they keep"
        return f"{_rows(count)} with results; whether {they} {_limits_named(summary)} is not known."
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
    others = f"other {rows}" if cell.failed else f"{rows}"
    if missed.value == 0.0:
        which = "The only row keeps" if cell.rows == 1 else f"All {others} rows keep"
        which = "The only other row keeps" if cell.failed and rows == 1 else which
        return f"{which} {limits}" + _bound(f"{sure} at least", kept.low)
    if missed.value == 1.0:
        which = (
            "The only row misses"
            if cell.rows == 1
            else f"None of {f'the {others}' if cell.failed else rows} rows keeps"
        )
        which = "The only other row misses" if cell.failed and rows == 1 else which
        return f"{which} {limits}" + _bound(f"{sure} at most", kept.high)
    between = ends(kept, "", "outage")
    of = f"the other {rows}" if cell.failed else "the"
    return f"{share(kept.value)} of {of} rows keep {limits}" + (f" ({between} {sure})" if between else "")


def _bound(words: str, probability: float) -> str:
    return "" if math.isnan(probability) else f"; {words} {share(probability)} of all draws do"


def _cells_said(summary: CampaignSummary, shown: CellSummary) -> str:
    limits = _limits_named(summary)
    known = [cell for cell in summary.cells if good(cell) and not math.isnan(cell.missed.value)]
    count = f"{len(known)} combinations{' with results' * (len(known) < len(summary.cells))}"
    worst = max(known, key=lambda cell: cell.missed.value)
    if shown.missed.value == worst.missed.value:
        where = "the only combination with results" if len(known) == 1 else f"each of {count}"
        return f"In {where} {share(1.0 - worst.missed.value)} of the rows keep {limits}."
    sure = f"intervals at {100.0 * shown.missed.confidence:g} %"
    kept, least = (share_ends(complement(cell.missed)) for cell in (shown, worst))
    whole = sum(cell.missed.value == 0.0 for cell in known)
    most = f"{shown.label} keeps {limits} most often, in {kept} of its rows"
    if whole > 1:
        most = f"{whole} keep {limits} in all of their rows, the first of them {shown.label}"
    return f"Of {count}, {most}; {worst.label} least often, in {least} ({sure})."


def matters(summary: CampaignSummary) -> list[str]:
    """Which inputs act most on each output that has a limit; on the first ones where none has."""
    limited = [limit.output for limit in summary.limits]
    wanted = [s for s in summary.sensitivities if s.output in limited] or list(summary.sensitivities[:3])
    unknown: dict[str, list[str]] = {}
    for each in wanted:
        if not ranked(each):
            unknown.setdefault(each.note, []).append(each.output)
    said = [_matters(each) for each in wanted if ranked(each)]
    return said + [f"What matters to {' and '.join(names)} is not known: {why}." for why, names in unknown.items()]


def leading(summary: CampaignSummary, output: str) -> list[str]:
    """The inputs that matter to an output, the one that matters most first; none where it is not known.

    Args:
        summary: the campaign, with its sensitivities.
        output: name of the output.
    """
    found = [s for s in summary.sensitivities if s.output == output]
    return [key for s in found for key, index in ranked(s) if index.value >= MATTERS]


def _matters(found: Sensitivity) -> str:
    named = [f"{key} {index_text(index)}" for key, index in ranked(found) if index.value >= MATTERS][:3]
    kind = "total" if found.total else "first-order"
    if not named:
        return f"No input by itself decides {found.output}{f'; {found.note}' if found.note else ''}."
    note = f"; {found.note}" if found.note else ""
    return f"What matters most to {found.output} ({kind} Sobol index): {', '.join(named)}{note}."


def tail_sentences(summary: CampaignSummary, cell: CellSummary | None) -> list[str]:
    """The radius exceeded with the least probability that is known, and how likely the error is beyond its bounds.

    Args:
        summary: the campaign; the upper bounds of its residual are radii that are asked for, too.
        cell: the cell whose tail is told; nothing is said without one.
    """
    if cell is None or cell.tail is None:
        return []
    tail, found = cell.tail, []
    known = {p: radius for p, radius in tail.wanted.items() if not math.isnan(radius.value)}
    if known:
        p, radius = min(known.items())
        exceeded = f"The radial error exceeds {value(radius.value, 'rad')} with probability {share(p)}"
        found.append(f"{exceeded}{_sure(radius)}.")
    bounds = [limit.most for limit in summary.limits if limit.most and limit.output.startswith("residual")]
    asked = {at: past for at in bounds if (past := beyond(tail, at))}
    for at, past in sorted({**asked, **tail.beyond}.items()):
        likely = f"The radial error is beyond {bound(at, 'rad')} with probability {share(past.value)}"
        unseen = f"No radial error beyond {bound(at, 'rad')} was seen"
        found.append(f"{likely if past.value else unseen}{_sure(past, 'outage', '')}.{_worth(tail, at, past)}")
    return found


def _worth(tail: Tail, radius_rad: float, past: Interval) -> str:
    """The variance of an estimate by importance sampling, and how many plain draws have the same."""
    variance = tail.variance.get(radius_rad, 0.0)
    if not variance:
        return ""
    draws = _many(past.value * (1.0 - past.value) / variance)
    return f" The variance of that estimate is {variance:.2g}, that of {draws} draws without importance sampling."


def answers(summary: CampaignSummary, cell: CellSummary | None) -> list[str]:
    """What follows the verdict: what matters most, and the tail.

    Args:
        summary: the campaign.
        cell: the cell whose tail is told, if there is one.
    """
    said = headline(summary)
    return [each for each in (*matters(summary), *tail_sentences(summary, cell)) if each != said]


def tail_method(tail: Tail) -> str:
    """Where a tail comes from, and how many independent samples of the error would tell as much."""
    known = [p for p, radius in tail.wanted.items() if not math.isnan(radius.value)]
    said = f"It comes from {'the ' if tail.method.startswith('share') else ''}{tail.method}."
    if not known or not math.isfinite(tail.effective_runs):
        return said
    count, of = _many(tail.effective_runs), share(min(known))
    return f"{said} It knows {of} as well as {count} independent samples of the error would."


def _many(count: float) -> str:
    """A number in two digits, as it is spoken: "24 million"."""
    count = float(f"{count:.2g}")
    for size, name in ((1e9, "billion"), (1e6, "million")):
        if count >= size:
            return f"{count / size:g} {name}"
    return f"{count:.0f}"


def _sure(interval: Interval, name: str = "", unit: str = "rad") -> str:
    found = ends(interval, unit, name)
    return f" ({found} at {100.0 * interval.confidence:g} % confidence)" if found else ""


def progress_words(summary: CampaignSummary) -> str:
    """How far the campaign is, its pace and the time left."""
    p = summary.progress
    pace = format_quantity(p.rows_per_s, "rows a second", 3) if p.rows_per_s > 0.0 else ""
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


def few_values(cell: CellSummary | None) -> list[str]:
    """The outputs that are the same in every row, and those of two values."""
    outputs = [] if cell is None else [o for o in cell.outputs.values() if o.rows]
    same = ", ".join(f"{label(o.name)} {_at(o, o.least)}" for o in outputs if o.most == o.least)
    two = [
        f"{label(o.name)} has two values: {_at(o, o.least)} in {share(1.0 - high)} of the rows, "
        f"{_at(o, o.most)} in {share(high)}."
        for o in outputs
        if (high := two_values(o)) is not None
    ]
    return [*([f"The same in every row: {same}."] if same else []), *two]


def _at(output: OutputSummary, number: float) -> str:
    return value(number, output.unit, output.name)


def two_values(output: OutputSummary) -> float | None:
    """Share of the rows at the larger of two values; None where there are more values, or one.

    No values between two ends spread as much about their mean as those that are all at an end (Bhatia and Davis,
    Amer. Math. Monthly 107, 2000, 353), so that mean and deviation tell.
    """
    reach, rows = output.most - output.least, output.rows
    if rows < 2 or not reach > 0.0:
        return None
    high = (output.mean.value - output.least) / reach
    spread = (output.deviation / reach) ** 2 * (rows - 1) / rows
    return high if math.isclose(spread, high * (1.0 - high), rel_tol=1e-6) else None
