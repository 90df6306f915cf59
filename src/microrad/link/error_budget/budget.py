"""Totals of a pointing budget: by the rules of ECSS-E-ST-60-10C and as a full distribution, and what is left of it.

The rules take a mean and a standard deviation of each source and the central limit: abs(mean) + n_p sigma about one
axis, and about two the lengths of both in its place (4.2.4.1, 4.2.4.2.1). The distribution convolves the sources. Both
are of the same parts, so that they differ by the rule alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from microrad.core.arrays import Floats
from microrad.link.error_budget.contributions import Contribution, Requirement, contributions
from microrad.link.error_budget.distributions import Bundle
from microrad.link.error_budget.sources import ErrorSource
from microrad.link.pointing.summation import sigma_multiple


@dataclass(frozen=True, slots=True)
class Total:
    """What all sources of a budget add up to under one requirement.

    Args:
        required: The requirement.
        contributions: The parts, in the order of their sources.
        mean_rad: Mean of the sum about each axis of the requirement, shape (axes,).
        sigma_rad: Standard deviation about each of them, shape (axes,).
        by_rules_rad: Total by the rules of the standard.
        quantile_rad: Error that is kept with the confidence, by the full distribution.
    """

    required: Requirement
    contributions: tuple[Contribution, ...]
    mean_rad: Floats
    sigma_rad: Floats
    by_rules_rad: float
    quantile_rad: float

    @property
    def holds(self) -> bool | None:
        """Whether the full distribution keeps the limit; None without one."""
        limit = self.required.limit_rad
        return None if limit is None else self.quantile_rad <= limit


@dataclass(frozen=True, slots=True)
class Share:
    """What one source means for a total.

    Args:
        name: The source.
        mean_rad: Its mean about each axis of the requirement.
        sigma_rad: Its standard deviation about each of them.
        without_rad: The total, by the distribution, without it.
        growth: Growth of the total for a small growth of the source, both as a share: 0.3 where 1 % makes 0.3 %.
        allowed: How many times as large it may be, the others unchanged, until the limit is met; 0 where the others
            alone miss it, None without a limit, infinite where it does not matter.
    """

    name: str
    mean_rad: Floats
    sigma_rad: Floats
    without_rad: float
    growth: float
    allowed: float | None


def total(found: Sequence[Contribution], required: Requirement) -> Total:
    """Add the parts of a budget up under a requirement.

    Args:
        found: The parts, from `contributions` or a loop.
        required: Axes, confidence and limit.

    Raises:
        ValueError: For no part.
    """
    return _total(found, _bundled(found), required)


def budget(sources: Sequence[ErrorSource], requirements: Sequence[Requirement]) -> tuple[Total, ...]:
    """The totals of the same sources under several requirements.

    Args:
        sources: The sources, of the same axes.
        requirements: What has to be kept.

    Raises:
        ValueError: As `contributions`, and for no source.
    """
    known: dict[Requirement, tuple[tuple[Contribution, ...], Bundle]] = {}
    totals = []
    for required in requirements:
        alike = replace(required, axes=(0,), limit_rad=None)
        if alike not in known:
            found = contributions(sources, required)
            known[alike] = found, _bundled(found)
        totals.append(_total(*known[alike], required))
    return tuple(totals)


def _bundled(found: Sequence[Contribution]) -> Bundle:
    if not found:
        raise ValueError("a budget without a source: give one or more")
    return Bundle.of([each.part for each in found])


def _total(found: Sequence[Contribution], bundle: Bundle, required: Requirement) -> Total:
    whole = bundle.about(required.axes)
    multiple = sigma_multiple(required.confidence)
    rules = float(np.linalg.norm(whole.mean) + multiple * np.linalg.norm(whole.sigma))
    return Total(required, tuple(found), whole.mean, whole.sigma, rules, whole.quantile(required.confidence))


_SMALL = 1e-3  # growth of a source by which that of the total is seen
_FAR = 1e6  # times its size, beyond which a source does not matter


def shares(of: Total) -> tuple[Share, ...]:
    """What each source means for a total, that of the largest growth first.

    Args:
        of: The total.
    """
    bundle = _bundled(of.contributions)
    found = [_share(of, bundle, at) for at in range(len(of.contributions))]
    return tuple(sorted(found, key=lambda each: -each.growth))


def _share(of: Total, bundle: Bundle, at: int) -> Share:
    required, part = of.required, of.contributions[at].part

    def times(factor: float) -> float:
        return bundle.without(at, part.times(factor)).about(required.axes).quantile(required.confidence)

    about, whole = Bundle.of([part]).about(required.axes), of.quantile_rad
    growth = (times(1.0 + _SMALL) / whole - 1.0) / _SMALL if whole else 0.0
    allowed = None if required.limit_rad is None else _allowed(times, required.limit_rad)
    return Share(of.contributions[at].name, about.mean, about.sigma, times(0.0), growth, allowed)


def _allowed(times: Callable[[float], float], limit_rad: float) -> float:
    from scipy.optimize import brentq

    if times(0.0) > limit_rad:
        return 0.0
    high = 1.0
    while times(high) <= limit_rad:
        high *= 4.0
        if high > _FAR:
            return np.inf
    return float(brentq(lambda factor: times(factor) - limit_rad, 0.0, high, xtol=1e-9 * high, rtol=1e-9))
