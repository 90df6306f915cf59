"""A budget of pointing errors as plain data, angles in rad."""

import math
from typing import Any

from microrad.link.error_budget import Share
from microrad.link.error_budget.assembly import Judged, PointingErrorBudget
from microrad.report.error_budget.words import AXES


def budget_data(budget: PointingErrorBudget) -> list[dict[str, Any]]:
    """Each requirement with its totals and what each source means for it, as its page shows; no curves.

    Args:
        budget: what was found.
    """
    return [_requirement(each) for each in budget.judged]


def _requirement(of: Judged) -> dict[str, Any]:
    total, required = of.total, of.total.required
    return {
        "requirement": of.name,
        "index": required.index.kind,
        "window_s": required.index.window_s,
        "spacing_s": required.index.spacing_s,
        "observation_s": required.observation_s,
        "confidence": required.confidence,
        "interpretation": required.interpretation,
        "axes": AXES[required.axes],
        "limit_rad": required.limit_rad,
        "mean_rad": total.mean_rad.tolist(),
        "sigma_rad": total.sigma_rad.tolist(),
        "by_rules_rad": total.by_rules_rad,
        "by_distribution_rad": total.quantile_rad,
        "holds": total.holds,
        "sources": [_source(each) for each in of.shares],
    }


def _source(each: Share) -> dict[str, Any]:
    allowed = None if each.allowed is None or math.isinf(each.allowed) else each.allowed
    return {
        "name": each.name,
        "class": each.contribution.kind,
        "statistic": each.contribution.statistic,
        "mean_rad": each.mean_rad.tolist(),
        "sigma_rad": each.sigma_rad.tolist(),
        "weight": each.growth,
        "contribution_rad": each.part_rad,
        "total_without_it_rad": each.without_rad,
        "may_be_times": allowed,
        "origin": each.contribution.origin,
    }
