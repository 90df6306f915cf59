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
from microrad.link.error_budget.correlation import Correlation, correlated
from microrad.link.error_budget.distributions import Bundle, Series, Sum, each_without
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
        contribution: The source's part of the error.
        total_rad: The total, by the distribution.
        mean_rad: Its mean about each axis of the requirement.
        sigma_rad: Its standard deviation about each of them.
        without_rad: The total, by the distribution, without it.
        growth: Growth of the total for a small growth of the source, both as a share: 0.3 where 1 % makes 0.3 %.
        allowed: How many times as large it may be, the others unchanged, until the limit is met; 0 where the others
            alone miss it, None without a limit, infinite where it does not matter.
    """

    contribution: Contribution
    total_rad: float
    mean_rad: Floats
    sigma_rad: Floats
    without_rad: float
    growth: float
    allowed: float | None

    @property
    def name(self) -> str:
        """The source."""
        return self.contribution.name

    @property
    def key(self) -> tuple[str, str]:
        """Its name and class: the loop may have a source of the name of another one."""
        return self.name, self.contribution.kind

    @property
    def part_rad(self) -> float:
        """Its part of the total (rad): those of all sources add up to it, as the total grows in proportion to them."""
        return self.growth * self.total_rad


def total(found: Sequence[Contribution], required: Requirement) -> Total:
    """Add the parts of a budget up under a requirement.

    Args:
        found: The parts, from `contributions` or a loop.
        required: Axes, confidence and limit.

    Raises:
        ValueError: For no part.
    """
    return _total(found, _bundled(found), required)


def budget(
    sources: Sequence[ErrorSource], requirements: Sequence[Requirement], correlations: Sequence[Correlation] = ()
) -> tuple[Total, ...]:
    """The totals of the same sources under several requirements.

    Args:
        sources: The sources, of the same axes.
        requirements: What has to be kept.
        correlations: Which sources are correlated, and how.

    Raises:
        ValueError: As `contributions` and `correlated`, and for no source.
    """
    known: dict[Requirement, tuple[tuple[Contribution, ...], Bundle]] = {}
    totals = []
    for required in requirements:
        alike = replace(required, axes=(0,), limit_rad=None)
        if alike not in known:
            found = correlated(contributions(sources, required), sources, required, correlations)
            known[alike] = found, _bundled(found)
        totals.append(_total(*known[alike], required))
    return tuple(totals)


def _bundled(found: Sequence[Contribution]) -> Bundle:
    if not found:
        raise ValueError("a budget without a source: give one or more")
    return Bundle.of([part for each in found for part in each.parts])


def _total(found: Sequence[Contribution], bundle: Bundle, required: Requirement) -> Total:
    whole = bundle.about(required.axes)
    multiple = sigma_multiple(required.confidence)
    rules = float(np.linalg.norm(whole.mean) + multiple * np.linalg.norm(whole.sigma))
    return Total(required, tuple(found), whole.mean, whole.sigma, rules, whole.quantile(required.confidence))


def beyond(of: Total, size_rad: Floats) -> Floats:
    """Probability of an error that is larger, radial for two axes, shape (sizes,).

    Args:
        of: The total.
        size_rad: The sizes (rad), shape (sizes,).
    """
    return 1.0 - _bundled(of.contributions).about(of.required.axes).within(size_rad)


_SMALL = 1e-3  # growth of a source by which that of the total is seen
_FAR = 1e6  # times its size, beyond which a source does not matter
_STEP = 4.0  # between two sizes that are tried
_FAR_OFF = 0.045  # deviation beside the length of a mean, up to which shares are those along it
_HELD = 2.0  # limits, or totals, up to which the range of a series reaches
_NO_GROWTH = 1e-9  # below which it is rounding
_NOTHING = 1e-12  # of a variance, below which others have none
_DIGITS = 1e-5  # part to which a size or a total of others is found


def shares(of: Total) -> tuple[Share, ...]:
    """What each source means for a total, that of the largest growth first.

    Args:
        of: The total.
    """
    required = of.required
    parts = [Bundle.of(each.parts).about(required.axes) for each in of.contributions]
    whole = _bundled(of.contributions).about(required.axes)
    if all(part.constant for part in parts):
        found = [_of_constant(of, each, own) for each, own in zip(of.contributions, parts, strict=True)]
    else:
        far_off = whole.is_far_off(_FAR_OFF)
        along = [each.along(whole.mean / np.linalg.norm(whole.mean)) for each in parts] if far_off else parts
        far = near = each_without(along, _HELD * max(of.quantile_rad, required.limit_rad or 0.0))
        if not all(series.whole for series in far):  # one that reaches less far has more of its terms
            near = each_without(along, _HELD * of.quantile_rad)
        found = [
            _share(of, each, both, (close, wide), _without(of, at, both[0], None if far_off else close))
            for at, (each, *both, close, wide) in enumerate(zip(of.contributions, parts, along, near, far, strict=True))
        ]
    return tuple(sorted(found, key=lambda each: -float(f"{each.growth:.2e}")))  # what is alike keeps its order


def _without(of: Total, at: int, own: Sum, others: Series | None) -> float:
    """The total without a source: by its series, or anew where there is none, or it ends too early."""
    left, spread = of.mean_rad - own.mean, of.sigma_rad**2 - own.covariance.diagonal()
    if np.max(spread) <= _NOTHING * np.max(of.sigma_rad) ** 2:
        return float(np.linalg.norm(left))
    if others is not None and others.whole:
        return others.quantile(of.required.confidence, _DIGITS)
    rest = [each for place, each in enumerate(of.contributions) if place != at]
    return _bundled(rest).about(of.required.axes).quantile(of.required.confidence)


def _share(of: Total, each: Contribution, both: Sequence[Sum], others: tuple[Series, Series], without: float) -> Share:
    """``both`` is the source's part as it is, and as it counts; ``others`` near the total, and as far as the limit."""
    whole, confidence, limit, (near, far) = of.quantile_rad, of.required.confidence, of.required.limit_rad, others
    own, counted = both

    def spare(series: Series, size_rad: float, times: float) -> float:
        return series.within(size_rad, counted.at(times * series.u)) - confidence

    spread = float(np.linalg.norm(of.sigma_rad)) / max(whole, np.finfo(float).tiny)
    small = _SMALL * min(1.0, spread / _FAR_OFF)  # short beside what is spread, too
    by_source = spare(near, whole, 1.0 + small) - spare(near, whole, 1.0 - small)
    by_size = spare(near, whole * (1.0 + small), 1.0) - spare(near, whole * (1.0 - small), 1.0)
    growth = -by_source / by_size if by_size > 0.0 else 0.0
    growth = growth if abs(growth) > _NO_GROWTH else 0.0
    allowed = None
    if limit is not None:
        others_rad = float(np.linalg.norm(of.mean_rad - own.mean))
        allowed = _allowed(own, others_rad, limit, lambda times: spare(far, limit, times))
    return Share(each, of.quantile_rad, own.mean, own.sigma, without, growth, allowed)


def _of_constant(of: Total, each: Contribution, own: Sum) -> Share:
    """The same where nothing of the budget is spread, so that lengths of means are all."""
    limit, others = of.required.limit_rad, of.mean_rad - own.mean
    without = float(np.linalg.norm(others))
    growth = float(own.mean @ of.mean_rad) / of.quantile_rad**2 if of.quantile_rad else 0.0
    allowed = None
    if limit is not None:
        allowed = _allowed(own, without, limit, lambda times: limit - float(np.linalg.norm(others + times * own.mean)))
    return Share(each, of.quantile_rad, own.mean, own.sigma, without, growth, allowed)


def _allowed(own: Sum, others_rad: float, limit_rad: float, spare: Callable[[float], float]) -> float:
    """How many times as large a source may be while something is to spare; its own size counts as one that may do.

    What lies beyond the range of a series comes in again from its other end, so that a mean walks out of the limit in
    steps that are short beside it.
    """
    from scipy.optimize import brentq

    if not own.mean.any() and not own.sigma.any():
        return np.inf
    low, high, mean_rad = 0.0, 1.0, float(np.linalg.norm(own.mean))
    if spare(high) < 0.0 and spare(low) < 0.0:
        return 0.0
    while spare(high) >= 0.0:
        walks = 0.0 < high * mean_rad < others_rad + _HELD * limit_rad
        low, high = high, min(high * _STEP, high + 0.5 * limit_rad / mean_rad if walks else np.inf)
        if high > _FAR:
            return np.inf
    return float(brentq(spare, low, high, xtol=_DIGITS * high, rtol=_DIGITS))
