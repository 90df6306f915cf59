"""A budget of pointing errors as a view: requirements with their totals, and what each source means for them."""

import math
from collections.abc import Sequence

from microrad.core.arrays import Floats
from microrad.link.error_budget import Share
from microrad.link.error_budget.assembly import Judged, PointingErrorBudget
from microrad.report.error_budget import words
from microrad.report.plotting.figure import Figure
from microrad.report.quantities import micro, percent
from microrad.report.tables import Cell, Table
from microrad.report.view import Points, View


def budget_view(budget: PointingErrorBudget, figures: Sequence[Figure] = (), said: Sequence[str] = ()) -> View:
    """All that a budget comes to.

    Args:
        budget: what was found.
        figures: its figures.
        said: further remarks.
    """
    each = [_each_source(one) for one in budget.judged]
    remarks = Points([*words.remarks(budget.judged), *said])
    return View(
        "Pointing error budget",
        [_requirements(budget.judged), _sources(budget.judged), *figures, *each, remarks],
        "pointing-error-budget",
    )


def _requirements(judged: Sequence[Judged]) -> Table:
    """Totals by the rules and by the distribution."""
    rows = []
    for each in judged:
        total, limit = each.total, each.total.required.limit_rad
        rows.append(
            (
                words.shown(each.name),
                words.requirement_text(total.required),
                _marked(total.by_rules_rad, limit),
                _marked(total.quantile_rad, limit),
                words.limit_text(limit),
            )
        )
    headings = ("requirement", "what is kept, how often", "by the rules", "by the distribution", "limit")
    return Table("Requirements, µrad", headings, rows, (0, 1), cards=True)


def _marked(total_rad: float, limit_rad: float | None) -> Cell:
    mark = "" if limit_rad is None else "PASS" if total_rad <= limit_rad else "FAIL"
    return Cell(micro(total_rad), mark)


def _sources(judged: Sequence[Judged]) -> Table:
    """Every source, with its contribution to each requirement and the share of the total that it is."""
    by_key = [{share.key: share for share in each.shares} for each in judged]
    rows = []
    for key, of in words.sources(judged).items():
        cells = [cell for own in by_key for cell in _contribution(own.get(key))]
        rows.append((words.source_shown(of), of.kind, of.statistic, *cells, of.origin))
    totals = [cell for each in judged for cell in (micro(each.total.quantile_rad), "")]
    rows.append(("all", "", "", *totals, ""))
    parts = [part for each in judged for part in (words.shown(each.name), "share")]
    headings = ("source", "class", "statistic", *parts, "from")
    brief = (0, *range(3, 3 + len(parts), 2))
    words_in = 0, 1, 2, 3 + len(parts)
    return Table("Contributions, µrad", headings, rows, words_in, totals=1, cards=True, brief=brief)


def _contribution(share: Share | None) -> tuple[str, str]:
    """A source that has become one with another for a requirement stands there with that one alone."""
    return ("", "") if share is None else (micro(share.part_rad), percent(share.growth))


def _each_source(of: Judged) -> View:
    """Moments of each source, what the others come to, and how large it may become."""
    rows = [
        (
            words.source_shown(share.contribution),
            _length(share.mean_rad),
            _length(share.sigma_rad),
            percent(share.growth),
            micro(share.without_rad),
            words.allowed(share),
        )
        for share in of.shares
    ]
    total = of.total
    rows.append(("all", _length(total.mean_rad), _length(total.sigma_rad), "100 %", micro(total.quantile_rad), ""))
    headings = ("source", "mean", "deviation", "weight", "total without it", "may be")
    table = Table("", headings, rows, totals=1)
    if total.required.limit_rad is None:
        table = table.columns(range(len(headings) - 1))
    about = f"{words.requirement_text(total.required)}, µrad."
    return View(f"{words.shown(of.name)}: each source", [about, table], folded=True, listed=False)


def _length(of: Floats) -> str:
    return micro(math.hypot(*of.tolist()))
