"""An optimum in words and as data: what it costs, what binds it, and how it does on rows it has not seen."""

from dataclasses import asdict
from typing import Any

from microrad.campaign.optimise import Candidate, Kept, Optimum
from microrad.campaign.outputs import OUTPUTS
from microrad.report.quantities import quantity

_NAMES = 46  # columns of names in the text


def text(optimum: Optimum) -> str:
    """The optimum for the terminal."""
    problem, best = optimum.problem, optimum.best
    lines = [f"{'' if optimum.feasible else 'NO DESIGN KEEPS THE LIMITS: '}{_headline(optimum)}", ""]
    if best is not None:
        lines += [_line(v.key, quantity(best.values[v.key], v.unit), _bounds(v)) for v in problem.variables]
        lines += ["", *(_kept(kept, "searched rows") for kept in best.kept)]
    if optimum.fresh is not None:
        lines += [_kept(kept, "fresh rows") for kept in optimum.fresh.kept]
    if optimum.bound_by:
        lines += ["", f"Bound by: {', '.join(optimum.bound_by)}"]
    count = f"{optimum.evaluations} candidates"
    lines += ["", count + (f", {optimum.refused} of them no mission" if optimum.refused else "")]
    return "\n".join([*lines, *(f"warning: {warning}" for warning in optimum.warnings)])


def _headline(optimum: Optimum) -> str:
    problem = optimum.problem
    if optimum.best is None or not optimum.feasible:
        return optimum.reason
    verb = "largest" if problem.minimise.startswith("-") else "least"
    cost = quantity(optimum.best.cost, problem.cost_unit)
    return f"{verb} {problem.cost_name}: {cost}, with each limit kept by {100 * problem.confidence:g} % of the rows"


def _line(name: str, value: str, note: str) -> str:
    return f"{name:{_NAMES}} {value:>14}  {note}"


def _bounds(variable: Any) -> str:
    return f"searched from {quantity(variable.low, variable.unit)} to {quantity(variable.high, variable.unit)}"


def _kept(kept: Kept, rows: str) -> str:
    unit, share = OUTPUTS[kept.limit.output].unit, kept.share
    band = f"{100 * share.value:.4g} % of {rows} keep it ({100 * share.low:.4g} to {100 * share.high:.4g} %)"
    return _line(kept.wanted, quantity(kept.value, unit), band)


def data(optimum: Optimum) -> dict[str, Any]:
    """The optimum as one JSON document, all values in SI units."""

    def candidate(each: Candidate | None) -> dict[str, Any] | None:
        return None if each is None else {**asdict(each), "feasible": each.feasible}

    return {
        "problem": asdict(optimum.problem),
        "feasible": optimum.feasible,
        "best": candidate(optimum.best),
        "fresh": candidate(optimum.fresh),
        "bound_by": list(optimum.bound_by),
        "evaluations": optimum.evaluations,
        "refused": optimum.refused,
        "reason": optimum.reason,
        "warnings": list(optimum.warnings),
        "trace": [candidate(each) for each in optimum.trace],
    }
