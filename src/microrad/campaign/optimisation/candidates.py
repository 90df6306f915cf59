"""Candidates of an optimisation: what is asked of them, and how the rows of one judge it.

The share of rows that keep a limit moves in steps, so a candidate is judged by the row that decides it: of all rows
ordered by how far they are inside the limit, the first that may not miss it any more.
"""

import math
from dataclasses import dataclass

import numpy as np

from microrad.campaign.definition.outputs import OUTPUTS
from microrad.campaign.definition.records import Variable
from microrad.campaign.records import CampaignError, Interval, Limit
from microrad.campaign.statistics.intervals import moments, share_interval
from microrad.core.arrays import Floats
from microrad.core.units import format_quantity

INTERVAL_CONFIDENCE = 0.95
"""Confidence of the interval of a share of rows."""


@dataclass(frozen=True, slots=True)
class Problem:
    """What to minimise over which variables, and what each row has to keep.

    ``minimise`` is the key of a variable or an output, with a minus in front to maximise it; an output counts by its
    mean over the rows. Each of ``limits`` is to be kept by the share ``confidence``
    of the rows. ``evaluations`` is the most candidates that may be looked at.
    """

    variables: tuple[Variable, ...]
    minimise: str
    limits: tuple[Limit, ...]
    confidence: float
    evaluations: int
    seed: int

    @property
    def cost_name(self) -> str:
        """The variable or output that is minimised or maximised."""
        return self.minimise.removeprefix("-")

    @property
    def cost_unit(self) -> str:
        """Its SI unit."""
        units = {v.key: v.unit for v in self.variables}
        return units[self.cost_name] if self.cost_name in units else OUTPUTS[self.cost_name].unit

    @property
    def sign(self) -> float:
        """-1 where the cost is maximised."""
        return -1.0 if self.minimise.startswith("-") else 1.0


@dataclass(frozen=True, slots=True)
class Kept:
    """How a candidate stands to a limit.

    ``value`` is the output in the row that decides: all rows but the share that may miss the limit are no worse.
    ``excess`` is how far inside the limit that row is, below 0 where too many miss it. ``share`` of the rows keep it.
    """

    limit: Limit
    value: float
    excess: float
    share: Interval

    @property
    def holds(self) -> bool:
        """Whether enough rows keep the limit."""
        return self.excess >= 0.0

    def agrees(self, wanted: float) -> bool:
        """Whether the interval of the share that keeps the limit reaches the wanted share."""
        return self.share.high >= wanted

    @property
    def wanted(self) -> str:
        """The limit in words: "margin >= 3 dB"."""
        unit = OUTPUTS[self.limit.output].unit
        sides = ((">=", self.limit.least), ("<=", self.limit.most))
        return f"{self.limit.output} " + " and ".join(
            f"{sign} {quantity_text(bound, unit)}" for sign, bound in sides if bound is not None
        )


@dataclass(frozen=True, slots=True)
class Candidate:
    """One choice of the variables by key (SI), the cost as it is named (not turned round), and the limits under it.

    ``refused`` says why it is no mission; then the cost is nan and ``kept`` is empty.
    """

    values: dict[str, float]
    cost: float
    kept: tuple[Kept, ...]
    refused: str = ""

    @property
    def feasible(self) -> bool:
        """Whether it is a mission and keeps all limits."""
        return not self.refused and all(k.holds for k in self.kept)


# -------------------------------------------------------------------------------------------------------------- judging
def judged(problem: Problem, values: dict[str, float], columns: dict[str, Floats]) -> Candidate:
    """The candidate with these outputs of its rows.

    Args:
        problem: what is asked of it.
        values: its variables by key, in SI units.
        columns: outputs (rows,) by name, nan in failed rows, and their ``weight`` where rows do not count alike.
    """
    weight = columns.get("weight", np.ones(len(next(iter(columns.values())))))
    _check_rows(problem, weight.size)
    kept = tuple(_kept(limit, _column(columns, limit.output), weight, problem.confidence) for limit in problem.limits)
    name = problem.cost_name
    cost = values[name] if name in values else moments(_column(columns, name), weight).mean
    return Candidate(values, cost, kept, "" if not np.isnan(cost) else f"no row has a {name}")


def _column(columns: dict[str, Floats], name: str) -> Floats:
    if name not in columns:
        raise CampaignError(f"the rows have no output {name}, which the optimisation needs; add it to keep")
    return columns[name]


def _kept(limit: Limit, output: Floats, weight: Floats, confidence: float) -> Kept:
    """Failed rows (nan) have missed the limit: nothing shows that they would keep it."""
    inside = np.minimum(
        np.inf if limit.least is None else output - limit.least, np.inf if limit.most is None else limit.most - output
    )
    inside = np.where(np.isnan(inside), -np.inf, inside)
    deciding = _at(inside, weight, 1.0 - confidence)
    share = share_interval(moments((inside >= 0.0).astype(np.float64), weight), INTERVAL_CONFIDENCE)
    return Kept(limit, float(output[deciding]), float(inside[deciding]), share)


def _at(values: Floats, weight: Floats, probability: float) -> int:
    """Index of the first value, rising, up to which the weights add up to more than `probability` of them all."""
    order = np.argsort(values, kind="stable")
    share = np.cumsum(weight[order]) / np.sum(weight)
    # rounding must not turn the last row that may miss the limit into one that may not
    first = int(np.searchsorted(share, probability + 1e-9, side="right"))
    return int(order[min(first, order.size - 1)])


def _check_rows(problem: Problem, rows: int) -> None:
    """Raises `CampaignError` if one row that misses a limit is already too many."""
    if problem.limits and rows * (1.0 - problem.confidence) < 1.0 - 1e-9:
        raise CampaignError(
            f"optimise.rows: {rows} rows cannot tell whether {percent(problem.confidence)} of them keep a limit; "
            f"draw at least {int(np.ceil(1.0 / (1.0 - problem.confidence) - 1e-6))}"
        )


def percent(share: float) -> str:
    """A share as it stands in messages: one that is not all of it is told from it."""
    digits = max(4, 1 - math.floor(math.log10(1.0 - share))) if share < 1.0 else 4
    return f"{100.0 * share:.{digits}g} %"


def quantity_text(value: float, unit: str) -> str:
    """A value with its unit as it stands in messages.

    Args:
        value: the value in its SI unit.
        unit: that unit.
    """
    return format_quantity(value, unit).strip()
