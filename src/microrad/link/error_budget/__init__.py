"""The pointing budget: sources of every class in the error indices, by the standard's rules and as distributions."""

from microrad.link.error_budget.budget import Share, Total, budget, shares, total
from microrad.link.error_budget.contributions import Contribution, Interpretation, Requirement, contributions
from microrad.link.error_budget.correlation import Correlation, correlated
from microrad.link.error_budget.sources import ErrorSource, Spread

__all__ = [
    "Contribution",
    "Correlation",
    "ErrorSource",
    "Interpretation",
    "Requirement",
    "Share",
    "Spread",
    "Total",
    "budget",
    "contributions",
    "correlated",
    "shares",
    "total",
]
