"""Sentences and names of a budget of pointing errors."""

import math
from collections.abc import Iterable, Sequence

from microrad.core.units import format_quantity
from microrad.link.error_budget import Contribution, Requirement, Share
from microrad.link.error_budget.assembly import Judged
from microrad.report.fine_pointing.windows import BY_GAINS, index_text
from microrad.report.fine_pointing.words import source_name
from microrad.report.quantities import angle, micro, percent, plain, share_of_time

AXES = {(0,): "about x", (1,): "about y", (2,): "about z", (0, 1): "radial"}
_SHARE_OF = {
    "temporal": "of the time, on the worst satellite",
    "ensemble": "of the satellites, at their worst time",
    "mixed": "of the satellites and times",
}
_RULED = 1e-3  # part of a total up to which rules and distribution are the same


def shown(name: str) -> str:
    """A key of a file as words."""
    return name.replace("_", " ")


def source_shown(of: Contribution) -> str:
    """What a source is called."""
    return source_name(of.name) if of.kind == "loop" else shown(of.name)


def requirement_text(required: Requirement) -> str:
    """An index with its times, its share, and its axes, in words."""
    observed = "" if required.observation_s is None else f" within {format_quantity(required.observation_s, 's')}"
    share = f"{share_of_time(required.confidence)} {_SHARE_OF[required.interpretation]}"
    return f"{index_text(required.index)}{observed}, {AXES[required.axes]}, {share}"


def sources(judged: Sequence[Judged]) -> dict[tuple[str, str], Contribution]:
    """Every source of a budget by its name and class, in the order in which it matters.

    Args:
        judged: the requirements.
    """
    return {share.key: share.contribution for each in judged for share in each.shares}


def most(of: Judged) -> str:
    """The source that contributes most to a requirement, with its numbers."""
    share = of.shares[0]
    sizes = f"{angle(share.part_rad)} of {angle(share.total_rad)}"
    return f"{source_shown(share.contribution)}: {sizes}, {percent(share.growth)} of the total"


def allowed(share: Share) -> str:
    """How many times as large a source may be."""
    if share.allowed is None:
        return ""
    if share.allowed == 0.0:
        return "nothing is left"
    return "any" if math.isinf(share.allowed) else f"{plain(share.allowed)} times"


def remarks(judged: Sequence[Judged]) -> list[str]:
    """How to read the tables, and what they do not hold."""
    said = [
        "By the rules: abs(mean) + n_p deviations, about two axes of their lengths (ECSS-E-ST-60-10C 4.2.4). By the "
        "distribution: the sources convolved, without the central limit; by it a requirement is judged.",
        "Weight: growth of the total for a source that grows by 1 %, in percent. Contribution: that share of the "
        "total, so that contributions add up to it. May be: how many times as large a source may be until the limit "
        "is met, the others as they are.",
    ]
    kinds = {share.contribution.kind for each in judged for share in each.shares}
    if "loop" in kinds:
        said.append(f"What the loop leaves is that of linear theory: {BY_GAINS}.")
    return [*said, *_too_small(judged)]


def _too_small(judged: Iterable[Judged]) -> list[str]:
    totals = {shown(each.name): each.total for each in judged if each.total.quantile_rad}
    off = {name: total.by_rules_rad / total.quantile_rad - 1.0 for name, total in totals.items()}
    low = [f"{name} ({percent(-each)})" for name, each in off.items() if each < -_RULED]
    return [f"The rules are too small for {', '.join(low)}."] if low else []


def limit_text(limit_rad: float | None) -> str:
    """A limit (µrad), nothing without one."""
    return "" if limit_rad is None else micro(limit_rad)
