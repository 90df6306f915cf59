"""An optimum in words and as data: what it costs, what binds it, and how it does on rows it has not seen."""

from dataclasses import asdict
from math import isnan
from typing import Any

from microrad.campaign.definition.outputs import OUTPUTS
from microrad.campaign.definition.records import Variable
from microrad.campaign.optimisation.candidates import INTERVAL_CONFIDENCE, Candidate, Kept, percent
from microrad.campaign.optimisation.search import Optimum
from microrad.report.quantities import counted, quantity

_SLACK = "for slack draw more rows (optimise.rows) or ask for a larger share (optimise.confidence)"


def optimum_text(optimum: Optimum) -> str:
    """The optimum for the terminal."""
    lines = [_headline(optimum), *([fresh_rows_sentence(optimum)] if optimum.feasible else [])]
    if optimum.best is not None:
        lines += [] if optimum.feasible else ["", "The best of the designs tried:"]
        lines += ["", *_table(_variables(optimum, optimum.best)), *_costs(optimum, optimum.best)]
    if optimum.best is not None and optimum.best.kept:
        lines += ["", *_table(_limits(optimum)), *_legend(optimum)]
    if optimum.bound_by:
        lines += ["", f"Bound by: {', '.join(optimum.bound_by)}"]
    count = counted(optimum.evaluations, "candidate")
    lines += ["", count + (f", {optimum.refused} of them no mission" if optimum.refused else "")]
    return "\n".join([*lines, *(f"warning: {warning}" for warning in optimum.warnings)])


def _headline(optimum: Optimum) -> str:
    problem = optimum.problem
    if optimum.best is None or not optimum.feasible:
        return f"NO DESIGN KEEPS THE LIMITS: {optimum.reason}"
    verb = "largest" if problem.minimise.startswith("-") else "least"
    cost = f"{verb} {_cost_name(optimum)}: {_quantity(optimum.best.cost, problem.cost_unit)}"
    if problem.limits:
        cost += f", with each limit kept by at least {percent(problem.confidence)} of the searched rows"
    return cost if optimum.confirmed else f"NOT CONFIRMED: {cost}"


def fresh_rows_sentence(optimum: Optimum) -> str:
    """What fresh rows say of a feasible optimum, in a sentence."""
    fresh, wanted = optimum.fresh, percent(optimum.problem.confidence)
    if fresh is None:
        return "It has not been checked with fresh rows."
    if fresh.refused:
        return f"Fresh rows refuse it: {fresh.refused}."
    below = [kept for kept in fresh.kept if not (kept.holds and kept.agrees(optimum.problem.confidence))]
    if not below:
        return "Fresh rows agree." if fresh.kept else "There is no limit for fresh rows to check."
    if optimum.confirmed:
        shares = " and ".join(_share_of(kept) for kept in below)
        return f"Fresh rows keep {shares}, below {wanted}: this agrees within its interval; {_SLACK}."
    shares = " and ".join(_share_of(kept) for kept in below if not kept.agrees(optimum.problem.confidence))
    return f"Fresh rows keep {shares}, which is less often than the {wanted} wanted; {_SLACK}."


def _share_of(kept: Kept) -> str:
    return f"{_limit(kept)} in {percent(kept.share.value)} ({_band(kept)})"


# -------------------------------------------------------------------------------------------------------------- tables
def _variables(optimum: Optimum, best: Candidate) -> list[tuple[str, ...]]:
    rows = [(v.key, _quantity(best.values[v.key], v.unit), _range(v)) for v in optimum.problem.variables]
    return [("variable", "value", "searched range"), *rows]


def _range(variable: Variable) -> str:
    return f"{_quantity(variable.low, variable.unit)} to {_quantity(variable.high, variable.unit)}"


def _costs(optimum: Optimum, best: Candidate) -> list[str]:
    """What an output as cost is on both sets of rows; a variable as cost is in the table."""
    problem = optimum.problem
    if problem.cost_name in best.values:
        return []
    costs = f"{_quantity(best.cost, problem.cost_unit)} of the searched rows"
    if optimum.fresh is not None and not optimum.fresh.refused:
        costs += f", {_quantity(optimum.fresh.cost, problem.cost_unit)} of fresh rows"
    return ["", f"{_cost_name(optimum)}: {costs}"]


def _cost_name(optimum: Optimum) -> str:
    """The cost, and for an output that it is the mean."""
    problem = optimum.problem
    if problem.cost_name in {variable.key for variable in problem.variables}:
        return problem.cost_name
    return f"{problem.cost_name} (mean over the rows)"


def _limits(optimum: Optimum) -> list[tuple[str, ...]]:
    level = f"{percent(INTERVAL_CONFIDENCE)} interval"
    head = ("limit", "rows", "value in the deciding row", "share that keeps it", level)
    sets = (("searched", optimum.best), ("fresh", optimum.fresh))
    return [head, *(_kept(kept, rows) for rows, each in sets if each is not None for kept in each.kept)]


def _kept(kept: Kept, rows: str) -> tuple[str, ...]:
    value = "failed" if isnan(kept.value) else _quantity(kept.value, OUTPUTS[kept.limit.output].unit)
    return _limit(kept), rows, value, percent(kept.share.value), _band(kept)


def _legend(optimum: Optimum) -> list[str]:
    share = optimum.problem.confidence
    return [
        f"deciding row: no row is worse but the {percent(1.0 - share)} that may miss the limit.",
        f"{percent(share)} (optimise.confidence) is the share of the rows that is to keep each limit.",
    ]


def _table(rows: list[tuple[str, ...]]) -> list[str]:
    """Lines with the columns below each other."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def _limit(kept: Kept) -> str:
    return kept.wanted.replace(">=", "≥").replace("<=", "≤")


def _band(kept: Kept) -> str:
    return f"{percent(kept.share.low).removesuffix(' %')} to {percent(kept.share.high)}"


def _quantity(value: float, unit: str) -> str:
    return quantity(value, unit).strip()  # a plain number has a space where its unit would be


# ---------------------------------------------------------------------------------------------------------------- data
def optimum_data(optimum: Optimum) -> dict[str, Any]:
    """The optimum as one JSON document, all values in SI units."""

    def candidate(each: Candidate | None) -> dict[str, Any] | None:
        return None if each is None else {**asdict(each), "feasible": each.feasible}

    return {
        "problem": asdict(optimum.problem),
        "feasible": optimum.feasible,
        "confirmed": optimum.confirmed,
        "check": fresh_rows_sentence(optimum) if optimum.feasible else "",
        "best": candidate(optimum.best),
        "fresh": candidate(optimum.fresh),
        "bound_by": list(optimum.bound_by),
        "evaluations": optimum.evaluations,
        "refused": optimum.refused,
        "reason": optimum.reason,
        "warnings": list(optimum.warnings),
        "trace": [candidate(each) for each in optimum.trace],
    }
