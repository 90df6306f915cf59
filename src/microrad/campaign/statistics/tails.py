"""Tails of the radial error, with intervals that hold for few rows: of plain runs, or by importance sampling."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from microrad.campaign.records import Interval, Tail
from microrad.core import units
from microrad.core.arrays import Floats
from microrad.core.intervals import binomial_band, counted

TAIL_POINTS = 200
_MOST = 1e12  # independent errors, where rows hardly differ
_ENOUGH = 20.0  # events below which the variance of a share is not trusted


# -------------------------------------------------------------------------------------------------------- of plain runs
def tail_of_time(
    survival: Floats,
    survival_square: Floats,
    rows: int,
    edges_rad: Floats,
    probabilities: Iterable[float],
    confidence: float,
) -> Tail:
    """Share of the time that the radial error exceeds a radius, from the sums over rows that a `Chunk` has.

    Errors of one row are correlated in time, rows are not: the spread of the rows' own shares gives the number of
    independent errors that would know the share as well, and the interval is that of Korn and Graubard (see
    `share_interval`) with their correction for few rows. Where few events are left, that number is held to what it was
    before them: it rises further out, where excursions are shorter. The interval of a radius has those radii whose own
    interval holds the probability; an end that the rows cannot tell is nan. Raises ValueError for less than one row.

    Args:
        survival: sum over the rows of the share of their time beyond the lower edge of each bin (bins,).
        survival_square: sum of the squares of these shares (bins,).
        rows: how many rows were summed.
        edges_rad: edges of the bins (at least bins,) in rad, rising.
        probabilities: those of the radii that are wanted.
        confidence: that of the interval, within (0, 1).
    """
    if rows < 1:
        raise ValueError("a tail of no rows: at least one row has to have succeeded")
    share = survival / rows
    variance = np.maximum(survival_square / rows - share**2, 0.0) / max(rows - 1, 1)
    if rows == 1:
        variance = share * (1.0 - np.minimum(share, 1.0))  # one row knows as much as one error
    band = _band(share, _held(share, _size(share, variance)), rows, confidence)
    edges = edges_rad[: share.size]
    wanted = {p: _radius(edges, band, p, confidence) for p in probabilities}
    seen = slice(max(int(np.count_nonzero(share >= 1.0)) - 1, 0), int(np.count_nonzero(share)) + 1)
    return Tail(
        radius_rad=edges[seen],
        survival=band.share[seen],
        low=band.low[seen],
        high=band.high[seen],
        wanted=wanted,
        confidence=confidence,
        method=f"share of the time of {units.counted(rows, 'row')}{', which are independent' * (rows > 1)}",
        effective_runs=_effective(band, wanted),
    )


# ---------------------------------------------------------------------------------------------- of importance sampling
def tail_weighted(
    radius_rad: Floats,
    log_weight: Floats,
    probabilities: Iterable[float],
    confidence: float,
    errors_rad: Sequence[float] = (),
) -> Tail:
    """Probability that one error exceeds a radius, from draws of importance sampling.

    The share beyond a radius is the mean of weight times 1(draw >= radius), or 1 less that of the other draws where
    these tell it better. Its interval is that of a weighted sum of Poisson numbers: M. P. Fay and E. J. Feuer,
    Confidence intervals for directly standardized rates, Stat. Med. 16 (1997) 791, where the upper end has one more
    draw of the heaviest weight among those summed (among all, where none is), with Student's correction for few draws.
    It holds as long as some draws are plain ones, as they are in `importance_sampling`: weights without bound would be
    heavy where no draw has been.

    The tail has at most `TAIL_POINTS` radii, while all draws tell of ``wanted`` and ``beyond``. Raises ValueError
    without draws.

    Args:
        radius_rad: the draws (n,) in rad.
        log_weight: logarithms of their weights (n,), which have a mean of 1.
        probabilities: those of the radii that are wanted.
        confidence: that of the interval, within (0, 1).
        errors_rad: radii (rad) whose probability of a larger error is wanted; its upper end counts the nearest
            smaller draw as larger, so that it is known beyond all draws, too.
    """
    if not radius_rad.size:
        raise ValueError("a tail of no draws: at least one run has to have succeeded")
    order, draws = np.argsort(radius_rad, kind="stable"), radius_rad.size
    radius, weight = radius_rad[order], np.exp(log_weight[order])
    band = _weighted_band(*_both_sides(weight), draws, confidence)
    from_zero, whole = np.concatenate([[0.0], radius]), _from_one(band)
    wanted = {p: _radius(from_zero, whole, p, confidence) for p in probabilities}
    even = np.linspace(radius[0], radius[-1], TAIL_POINTS)
    shown = np.unique(np.minimum(np.searchsorted(radius, even), draws - 1))
    return Tail(
        radius_rad=radius[shown],
        survival=band.share[shown],
        low=band.low[shown],
        high=band.high[shown],
        wanted=wanted,
        confidence=confidence,
        method=f"importance sampling of the noise in {units.counted(draws, 'run')}",
        effective_runs=_effective(whole, wanted),
        beyond={error: _beyond(radius, band, error, confidence) for error in errors_rad},
        variance={error: _variance(weight[radius > error], draws) for error in errors_rad},
    )


def _variance(weight: Floats, draws: int) -> float:
    """Variance of the mean of weight times 1(draw > radius), from the weights of those that are larger."""
    share = float(np.sum(weight)) / draws
    return max(float(np.sum(weight**2)) / draws - share**2, 0.0) / max(draws - 1, 1)


def _beyond(radius_rad: Floats, band: "_Band", error_rad: float, confidence: float) -> Interval:
    larger = int(np.searchsorted(radius_rad, error_rad, side="right"))
    high = float(band.high[larger - 1]) if larger else 1.0
    if larger == radius_rad.size:
        return Interval(0.0, 0.0, high, confidence)
    return Interval(float(band.share[larger]), float(band.low[larger]), high, confidence)


@dataclass(frozen=True, slots=True)
class _Weights:
    """Weights of some of the draws: summed, summed in squares, and the heaviest, of all draws where there is none."""

    sum: Floats
    square: Floats
    heaviest: Floats


def _both_sides(weight: Floats) -> tuple[_Weights, _Weights]:
    """Of the draws from each one on, where they are in the order of their radius, and of those before it."""
    upto, onward = _summed(weight), _summed(weight[::-1])
    first = (0.0, 0.0, float(weight.max()))
    before = (np.concatenate([[none], each[:-1]]) for none, each in zip(first, upto, strict=True))
    return _Weights(*(each[::-1] for each in onward)), _Weights(*before)


def _summed(weight: Floats) -> tuple[Floats, Floats, Floats]:
    """What `_Weights` has, of the first draw, of the first two, and so on."""
    return np.cumsum(weight), np.cumsum(weight**2), np.maximum.accumulate(weight)


def _weighted_band(beyond: _Weights, within: _Weights, draws: int, confidence: float) -> "_Band":
    """Shares beyond, each told by the draws beyond or within, whichever tell it better, and never rising."""
    share, variance, low, high = _poisson(beyond, draws, confidence)
    rest, variance_rest, few, many = _poisson(within, draws, confidence)
    # the variances are the same for draws of one weight, where the fewer ones tell how far the interval reaches
    inner = (variance_rest <= 1.000001 * variance) & (rest <= 0.5)
    share = np.where(inner, 1.0 - rest, share)
    size = _size(share, np.where(inner, variance_rest, variance))
    band = _falling(share, np.where(inner, 1.0 - many, low), np.where(inner, 1.0 - few, high))
    return _Band(*band, np.where(np.isnan(size), float(draws), size))


def _poisson(of: _Weights, draws: int, confidence: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Share that the weights make, its variance and the ends of its interval, see `tail_weighted`."""
    from scipy.special import gammaincinv

    share, one = of.sum / draws, of.heaviest / draws
    rest = np.maximum(of.square / draws - share**2, 0.0)
    variance = rest / (draws - 1) if draws > 1 else share**2  # that of one event
    few, beyond = counted(draws, confidence), (1.0 - confidence) / 2.0

    def end(share: Floats, variance: Floats, level: float) -> Floats:
        """Quantile of the gamma distribution with this mean, and with the variance of few draws."""
        known = np.maximum(share, 1e-300)
        events = few / np.maximum(variance / known / known, 1.0 / _MOST)
        return np.where(share > 0.0, share * gammaincinv(events, level) / events, 0.0)

    return share, variance, end(share, variance, beyond), end(share + one, variance + one**2, 1.0 - beyond)


def _from_one(band: "_Band") -> "_Band":
    """The band with a share of 1 before it: no error is smaller than 0."""
    share, low, high = (np.concatenate([[1.0], each]) for each in (band.share, band.low, band.high))
    return _Band(share, low, high, np.concatenate([band.size[:1], band.size]))


# ------------------------------------------------------------------------------------------------------- bands and ends
@dataclass(frozen=True, slots=True)
class _Band:
    """Falling shares with the ends of their intervals, and the number of independent errors that know them as well."""

    share: Floats
    low: Floats
    high: Floats
    size: Floats


def _band(share: Floats, size: Floats, rows: int, confidence: float) -> _Band:
    share, size = np.clip(share, 0.0, 1.0), np.where(np.isnan(size), float(rows), size)
    few = counted(rows, confidence)
    return _Band(*_falling(share, *binomial_band(share * size * few, size * few, confidence)), size)


def _falling(share: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats, Floats]:
    """A share is no less than one further out and no more than one further in, and so are its interval's ends."""
    share, low, high = (np.clip(each, 0.0, 1.0) for each in (share, low, high))
    return np.minimum.accumulate(share), np.maximum.accumulate(low[::-1])[::-1], np.minimum.accumulate(high)


def _size(share: Floats, variance: Floats) -> Floats:
    """Independent errors that would know a share as well; nan where none or all exceed."""
    known = (share > 0.0) & (share < 1.0)
    some = share * (1.0 - share)
    return np.where(known, some / np.maximum(variance, np.abs(some) / _MOST + 1e-300), math.nan)


def _held(share: Floats, size: Floats) -> Floats:
    """The sizes, no larger in the tail than at the last share that enough events have told of."""
    with np.errstate(invalid="ignore"):
        told = np.flatnonzero((size * share >= _ENOUGH) & (size * (1.0 - share) >= _ENOUGH))
    if not told.size:
        return size
    nearest = told[np.clip(np.searchsorted(told, np.arange(size.size), side="right") - 1, 0, told.size - 1)]
    return np.fmin(size, size[nearest])


def _radius(radius_rad: Floats, band: _Band, probability: float, confidence: float) -> Interval:
    value, low, high = (_crossing(radius_rad, falling, probability) for falling in (band.share, band.low, band.high))
    return Interval(value, low, high, confidence)


def _crossing(radius_rad: Floats, falling: Floats, probability: float) -> float:
    """Radius where a falling share reaches a probability; nan where it does not.

    Between two radii its logarithm is linear in the square of the radius, as that of Rayleigh's distribution is; next
    to a share of 0 it is itself linear.
    """
    if not falling.size or falling[0] < probability or falling[-1] > probability:
        return math.nan
    at = min(max(int(np.count_nonzero(falling > probability)), 1), falling.size - 1)
    before, behind = float(falling[at - 1]), float(falling[at])
    if before == behind:
        return float(radius_rad[at])
    if behind > 0.0:
        inside = math.log(before / probability) / math.log(before / behind)
    else:
        inside = (before - probability) / before
    low, high = float(radius_rad[at - 1]) ** 2, float(radius_rad[at]) ** 2
    return math.sqrt(low + min(max(inside, 0.0), 1.0) * (high - low))


def _effective(band: _Band, wanted: dict[float, Interval]) -> float:
    """Independent errors that would know as well the smallest probability with a known radius; nan without any."""
    known = [probability for probability, radius in wanted.items() if not math.isnan(radius.value)]
    return float(band.size[max(int(np.count_nonzero(band.share > min(known))) - 1, 0)]) if known else math.nan
