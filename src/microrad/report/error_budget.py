"""A budget of pointing errors: each requirement with its totals, and what each source means for it."""

import math
from collections.abc import Mapping
from typing import Any

from microrad.core.units import format_quantity
from microrad.link.error_budget import Requirement, Share, Total, shares
from microrad.report.fine_pointing.windows import index_text
from microrad.report.fine_pointing.words import source_name
from microrad.report.quantities import micro, percent
from microrad.report.tables import Cell, Table
from microrad.report.view import Points, View

_AXES = {(0,): "about x", (1,): "about y", (2,): "about z", (0, 1): "radial"}
_SHARE_OF = {
    "temporal": "of the time, on the worst satellite",
    "ensemble": "of the satellites, at their worst time",
    "mixed": "of the satellites and times",
}


def budget_view(totals: Mapping[str, Total]) -> View:
    """All that a budget comes to.

    Args:
        totals: What was found, by the name of its requirement.
    """
    sources = [_sources(name, total) for name, total in totals.items()]
    return View("Pointing error budget", [_summary(totals), *sources, Points(_remarks(totals))])


def requirement_text(required: Requirement) -> str:
    """An index with its times, its share, and its axes, in words."""
    observed = "" if required.observation_s is None else f" within {format_quantity(required.observation_s, 's')}"
    share = f"{percent(required.confidence, 4)} {_SHARE_OF[required.interpretation]}"
    return f"{index_text(required.index)}{observed}, {_AXES[required.axes]}, {share}"


def _summary(totals: Mapping[str, Total]) -> Table:
    rows = []
    for name, total in totals.items():
        limit = total.required.limit_rad
        mark = "" if total.holds is None else "PASS" if total.holds else "FAIL"
        rules = "" if limit is None else "PASS" if total.by_rules_rad <= limit else "FAIL"
        shown = "" if limit is None else micro(limit)
        rows.append(
            (
                _shown(name),
                requirement_text(total.required),
                Cell(micro(total.by_rules_rad), rules),
                Cell(micro(total.quantile_rad), mark),
                shown,
            )
        )
    headings = ("requirement", "what is kept, how often", "by the rules", "by the distribution", "limit")
    return Table("Requirements, µrad", headings, rows, (0, 1))


def _sources(name: str, total: Total) -> Table:
    limited = total.required.limit_rad is not None
    rows = [(*_row(each), *([_allowed(each)] if limited else [])) for each in shares(total)]
    rows.append(
        (
            "all",
            "",
            _length(total.mean_rad),
            _length(total.sigma_rad),
            "100 %",
            micro(total.quantile_rad),
            *[""] * limited,
        )
    )
    more = ("may be",) if limited else ()
    headings = ("source", "class", "mean", "deviation", "weight", "total without it", *more)
    title = f"{_shown(name)}: {requirement_text(total.required)}, µrad"
    return Table(title, headings, rows, (0, 1), totals=1, brief=(0, 2, 3, 4, *([6] if limited else [5])))


def _row(each: Share) -> tuple[str, ...]:
    kind = each.contribution.kind
    return (
        source_name(each.name) if kind == "loop" else _shown(each.name),
        kind,
        _length(each.mean_rad),
        _length(each.sigma_rad),
        percent(each.growth),
        micro(each.without_rad),
    )


def _shown(name: str) -> str:
    """A key of a file as words."""
    return name.replace("_", " ")


def _length(of: Any) -> str:
    return micro(math.hypot(*of.tolist()))


def _allowed(each: Share) -> str:
    assert each.allowed is not None
    if each.allowed == 0.0:
        return "nothing is left"
    return "any" if math.isinf(each.allowed) else f"{each.allowed:.3g} times"


def _remarks(totals: Mapping[str, Total]) -> list[str]:
    said = [
        "By the rules: abs(mean) + n_p deviations, about two axes of their lengths (ECSS-E-ST-60-10C 4.2.4). By the "
        "distribution: the sources convolved, without the central limit.",
        "Weight: growth of the total for a source that grows by 1 %, in percent. May be: how many times as large it "
        "may be until the limit is met, the others as they are.",
    ]
    off = {name: total.by_rules_rad / total.quantile_rad - 1.0 for name, total in totals.items() if total.quantile_rad}
    low = [f"{name} ({percent(-each)})" for name, each in off.items() if each < -1e-3]
    return [*said, *([f"The rules are too small for {', '.join(low)}."] if low else [])]


def budget_data(totals: Mapping[str, Total]) -> list[dict[str, Any]]:
    """The same as data, angles in rad.

    Args:
        totals: What was found, by the name of its requirement.
    """
    return [_data(name, total) for name, total in totals.items()]


def _data(name: str, total: Total) -> dict[str, Any]:
    required = total.required
    return {
        "requirement": name,
        "index": required.index.kind,
        "window_s": required.index.window_s,
        "spacing_s": required.index.spacing_s,
        "observation_s": required.observation_s,
        "confidence": required.confidence,
        "interpretation": required.interpretation,
        "axes": _AXES[required.axes],
        "limit_rad": required.limit_rad,
        "mean_rad": total.mean_rad.tolist(),
        "sigma_rad": total.sigma_rad.tolist(),
        "by_rules_rad": total.by_rules_rad,
        "by_distribution_rad": total.quantile_rad,
        "holds": total.holds,
        "sources": [_source_data(each) for each in shares(total)],
    }


def _source_data(each: Share) -> dict[str, Any]:
    allowed = None if each.allowed is None or math.isinf(each.allowed) else each.allowed
    return {
        "name": each.name,
        "class": each.contribution.kind,
        "mean_rad": each.mean_rad.tolist(),
        "sigma_rad": each.sigma_rad.tolist(),
        "weight": each.growth,
        "total_without_it_rad": each.without_rad,
        "may_be_times": allowed,
        "origin": each.contribution.origin,
    }
