"""Statistics of rows as they come: means, quantiles, shares and tails, with intervals that hold for few rows."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from microrad.campaign.records import Floats, Interval, OutputSummary, Tail
from microrad.campaign.sketch import Sketch

PICTURE_BINS = 40
TAIL_POINTS = 200
_MOST = 1e12  # independent errors, where rows hardly differ
_ENOUGH = 20.0  # events below which the variance of a share is not trusted


@dataclass(frozen=True, slots=True)
class Moments:
    """Weighted moments of values: their number, sum of weights and of squared weights, mean, spread and range.

    ``spread`` is the sum of w (x - mean)^2; ``skewed`` and ``square`` are those of w^2 (x - mean) and
    w^2 (x - mean)^2, from which the error of the mean follows. Parts are merged as in T. F. Chan, G. H. Golub and R. J.
    LeVeque, Algorithms for computing the sample variance, Am. Stat. 37 (1983) 242, without loss of figures.
    """

    count: int = 0
    weight: float = 0.0
    weight_square: float = 0.0
    mean: float = math.nan
    spread: float = 0.0
    skewed: float = 0.0
    square: float = 0.0
    least: float = math.nan
    most: float = math.nan

    @property
    def variance(self) -> float:
        """Variance of the values, unbiased; nan for less than two."""
        rest = self.weight - self.weight_square / self.weight if self.count > 1 else 0.0
        return self.spread / rest if rest > 0.0 else math.nan

    @property
    def deviation(self) -> float:
        """Standard deviation of the values; nan for less than two."""
        return math.sqrt(self.variance)

    @property
    def mean_variance(self) -> float:
        """Variance of the mean of independent values; nan for less than two."""
        if self.count < 2:
            return math.nan
        return self.square / self.weight**2 * self.count / (self.count - 1)

    def merged(self, other: "Moments") -> "Moments":
        """Moments of both together."""
        if not self.count or not other.count:
            return self if self.count else other
        weight = self.weight + other.weight
        with np.errstate(invalid="ignore"):  # a value without end
            apart = float(np.subtract(other.mean, self.mean))
        mean = self.mean + apart * (other.weight / weight)
        here, there = self._about(mean), other._about(mean)
        return Moments(
            count=self.count + other.count,
            weight=weight,
            weight_square=self.weight_square + other.weight_square,
            mean=mean,
            spread=self.spread + other.spread + apart * apart * (self.weight * other.weight / weight),
            skewed=here[0] + there[0],
            square=here[1] + there[1],
            least=min(self.least, other.least),
            most=max(self.most, other.most),
        )

    def _about(self, mean: float) -> tuple[float, float]:
        """Sums of w^2 (x - mean) and of w^2 (x - mean)^2 about another mean."""
        moved = self.mean - mean
        skewed = self.skewed + moved * self.weight_square
        return skewed, self.square + moved * (2.0 * self.skewed + moved * self.weight_square)


def moments(values: Floats, weights: Floats | None = None) -> Moments:
    """Moments of values (n,), nan left out, with weights (n,) above 0 that are 1 by default."""
    given = np.ones(values.shape) if weights is None else weights
    known = ~np.isnan(values)
    values, given = values[known], given[known]
    if not values.size:
        return Moments()
    weight, first = float(np.sum(given)), float(values[0])
    with np.errstate(invalid="ignore"):  # values without end
        mean = first + float(np.sum(given * (values - first))) / weight
        off = values - mean
        weighted = given * off
        return Moments(
            count=values.size,
            weight=weight,
            weight_square=float(np.sum(given**2)),
            mean=mean,
            spread=float(np.sum(weighted * off)),
            skewed=float(np.sum(given * weighted)),
            square=float(np.sum(weighted**2)),
            least=float(values.min()),
            most=float(values.max()),
        )


# ------------------------------------------------------------------------------------------------------------ intervals
def mean_interval(rows: Moments, confidence: float, blocks: Moments | None = None) -> Interval:
    """Mean of the rows with its interval by Student's t.

    ``blocks`` are the moments of the means of independent blocks (one Latin hypercube or Sobol set each): the spread
    from block to block gives the interval then, since rows of one block are not independent. Without blocks the rows
    are. With less than two of either the interval is not known.
    """
    parts = blocks or rows
    if parts.count < 2:
        return Interval(rows.mean, math.nan, math.nan, confidence)
    half = _student(confidence, parts.count - 1) * math.sqrt(parts.mean_variance)
    return Interval(rows.mean, rows.mean - half, rows.mean + half, confidence)


def proportion_interval(hits: float, trials: float, confidence: float) -> Interval:
    """Share of trials that hit, with the interval of C. J. Clopper and E. S. Pearson, Biometrika 26 (1934) 404.

    Never too narrow. Without trials nothing is known.
    """
    if trials <= 0.0:
        return Interval(math.nan, math.nan, math.nan, confidence)
    low, high = _binomial_band(np.array([hits]), np.array([trials]), confidence)
    return Interval(hits / trials, float(low[0]), float(high[0]), confidence)


def share_interval(rows: Moments, confidence: float) -> Interval:
    """Share of the rows that hit, from the moments of 1 (hit) and 0, with its interval.

    Rows without weights: `proportion_interval`. With weights it is the same for the number of independent rows that
    would know the share as well: E. L. Korn and B. I. Graubard, Confidence intervals for proportions with small
    expected number of positive counts estimated from survey data, Survey Methodology 24 (1998) 193. It is no more than
    the number of rows, and Kish's (sum w)^2 / sum w^2 where all or none hit. For rows of Latin hypercubes or Sobol sets
    it is wider than needed.
    """
    if not rows.count:
        return proportion_interval(0.0, 0.0, confidence)
    share = min(max(rows.mean, 0.0), 1.0)
    size = rows.weight**2 / rows.weight_square
    if 0.0 < share < 1.0 and rows.weight_square != rows.weight:
        size = min(share * (1.0 - share) / rows.mean_variance, float(rows.count))
    return proportion_interval(share * size, size, confidence)


def quantile_interval(sketch: Sketch, probability: float, confidence: float) -> Interval:
    """Quantile of the rows in a sketch, with an interval that holds for any distribution.

    Its ends are the order statistics between which the quantile is by the binomial distribution, to the sketch's error
    outwards (H. A. David and H. N. Nagaraja, Order Statistics, 2003, section 7.1). With weights the number of rows is
    that of independent ones which would know the share below as well. An end that so few rows cannot have is nan.
    """
    value = sketch.quantile(probability)
    if not sketch.bins:
        return Interval(value, math.nan, math.nan, confidence)
    share, size = _share_below(sketch)
    above, below = _binomial_tails(share, size, probability)
    low, high = sketch.edges()
    start = int(np.count_nonzero(above < (1.0 - confidence) / 2.0))  # the true share below is surely less there
    stop = share.size - int(np.count_nonzero(below < (1.0 - confidence) / 2.0)) - 1
    return Interval(
        value,
        float(low[start - 1]) if start > 0 else math.nan,
        float(high[stop]) if stop < high.size else math.nan,
        confidence,
    )


def _share_below(sketch: Sketch) -> tuple[Floats, Floats]:
    """Share of the weight up to nothing and to each bin (bins + 1,), and the rows that would know it as well."""
    weight, square = (np.concatenate([[0.0], sums]) for sums in sketch.cumulative())
    share = weight / weight[-1]
    spread = (1.0 - share) ** 2 * square + share**2 * (square[-1] - square)
    most = weight[-1] ** 2 / square[-1]
    with np.errstate(invalid="ignore", divide="ignore"):
        size = share * (1.0 - share) * weight[-1] ** 2 / spread
    return share, np.where((share > 0.0) & (share < 1.0), size, most)


def _binomial_tails(share: Floats, size: Floats, probability: float) -> tuple[Floats, Floats]:
    """Probability of so few hits as share x size, and of so many, where each of ``size`` hits with ``probability``."""
    from scipy.special import betainc, betaincc  # slow to import, not needed to show help

    hits = share * size
    few = np.where(hits < size, betaincc(hits + 1.0, np.maximum(size - hits, 1e-300), probability), 1.0)
    many = np.where(hits > 0.0, betainc(np.maximum(hits, 1e-300), size - hits + 1.0, probability), 1.0)
    return few, many


def _binomial_band(hits: Floats, trials: Floats, confidence: float) -> tuple[Floats, Floats]:
    """Ends of Clopper and Pearson's interval, for real numbers of hits and trials, too."""
    from scipy.special import betaincinv  # slow to import, not needed to show help

    beyond, missed = (1.0 - confidence) / 2.0, np.maximum(trials - hits, 0.0)
    low = np.where(hits > 0.0, betaincinv(np.maximum(hits, 1e-300), missed + 1.0, beyond), 0.0)
    high = np.where(missed > 0.0, betaincinv(hits + 1.0, np.maximum(missed, 1e-300), 1.0 - beyond), 1.0)
    return low, high


def _student(confidence: float, freedom: float) -> float:
    from scipy.special import stdtrit  # slow to import, not needed to show help

    return float(stdtrit(freedom, 0.5 + confidence / 2.0))


# ---------------------------------------------------------------------------------------------------------------- folds
class Fold:
    """One output of one cell, folded row by row in their order, in memory that does not grow with them.

    ``block`` is the number of rows in a block of the sampling, 0 where rows are independent.
    """

    __slots__ = ("_block", "_number", "_part", "_rows", "blocks", "moments", "sketch")

    def __init__(self, block: int = 0) -> None:
        """Nothing folded yet."""
        self.moments, self.sketch, self.blocks = Moments(), Sketch(), Moments()
        self._block, self._number, self._rows, self._part = block, 0, 0, Moments()

    def add(self, first_row: int, values: Floats, weights: Floats | None = None) -> None:
        """Take in the rows from ``first_row`` on, nan where a row has failed.

        Chunks come in order. Some may be missing: a block that is not whole says nothing about the mean's interval.
        """
        given = np.ones(values.shape) if weights is None else weights
        self.moments = self.moments.merged(moments(values, given))
        self.sketch.add(values, given)
        begin = 0
        while self._block and begin < values.size:
            number, done = divmod(first_row + begin, self._block)
            end = min(values.size, begin + self._block - done)
            self._take(number, moments(values[begin:end], given[begin:end]), end - begin)
            begin = end

    def _take(self, number: int, part: Moments, rows: int) -> None:
        """Take in rows of one block; the mean of a whole one is a draw of the mean, unless all its rows have failed."""
        if number != self._number:
            self._number, self._rows, self._part = number, 0, Moments()
        self._rows, self._part = self._rows + rows, self._part.merged(part)
        if self._rows == self._block and self._part.count:
            self.blocks = self.blocks.merged(moments(np.array([self._part.mean])))

    def mean(self, confidence: float) -> Interval:
        """Mean with its interval, from block to block where the sampling has blocks."""
        return mean_interval(self.moments, confidence, self.blocks if self._block else None)

    def summary(
        self, name: str, unit: str, meaning: str, probabilities: Iterable[float], confidence: float
    ) -> OutputSummary:
        """What is known of the output so far."""
        edges, counts = self.sketch.histogram(PICTURE_BINS)
        return OutputSummary(
            name=name,
            unit=unit,
            meaning=meaning,
            rows=self.moments.count,
            mean=self.mean(confidence),
            deviation=self.moments.deviation,
            least=self.moments.least,
            most=self.moments.most,
            quantiles={p: quantile_interval(self.sketch, p, confidence) for p in probabilities},
            sketch_error=self.sketch.error,
            edges=edges,
            counts=counts,
        )


# ---------------------------------------------------------------------------------------------------------------- tails
def tail_of_time(
    survival: Floats,
    survival_square: Floats,
    rows: int,
    edges_rad: Floats,
    probabilities: Iterable[float],
    confidence: float,
) -> Tail:
    """Share of the time that the radial error exceeds a radius, from the sums over rows that a `Chunk` has.

    ``survival`` (bins,) and ``survival_square`` (bins,) belong to the first ``bins`` of ``edges_rad``. Errors of one
    row are correlated in time, rows are not: the spread of the rows' own shares gives the number of independent errors
    that would know the share as well, and the interval is that of Korn and Graubard (see `share_interval`) with their
    correction for few rows. Where few events are left, that number is held to what it was before them: it rises
    further out, where excursions are shorter. The interval of a radius has those radii whose own interval holds the
    probability; an end that the rows cannot tell is nan. Raises ValueError for less than one row.
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
        method=f"share of the time of {rows} rows, which are independent",
        effective_runs=_effective(band, wanted),
    )


def tail_weighted(radius_rad: Floats, log_weight: Floats, probabilities: Iterable[float], confidence: float) -> Tail:
    """Probability that one error exceeds a radius, from draws (n,) with the logarithm of their weights (n,).

    The weights are those of importance sampling, of mean 1. The interval is as in `tail_of_time`, each draw a row by
    itself; in the tail it is that of Poisson's distribution for as many exceedances as would be known as well. The
    tail has at most `TAIL_POINTS` radii, while ``wanted`` is from all draws. Raises ValueError without draws.
    """
    if not radius_rad.size:
        raise ValueError("a tail of no draws: at least one run has to have succeeded")
    order, draws = np.argsort(radius_rad, kind="stable"), radius_rad.size
    radius, weight = radius_rad[order], np.exp(log_weight[order])
    share = np.cumsum(weight[::-1])[::-1] / draws
    spread = np.maximum(np.cumsum(weight[::-1] ** 2)[::-1] / draws - share**2, 0.0) / max(draws - 1, 1)
    band = _band(share, _size(share, spread), draws, confidence)
    wanted = {p: _radius(radius, band, p, confidence) for p in probabilities}
    even = np.linspace(radius[0], radius[-1], TAIL_POINTS)
    shown = np.unique(np.minimum(np.searchsorted(radius, even), draws - 1))
    return Tail(
        radius_rad=radius[shown],
        survival=band.share[shown],
        low=band.low[shown],
        high=band.high[shown],
        wanted=wanted,
        confidence=confidence,
        method=f"importance sampling of the noise in {draws} runs",
        effective_runs=_effective(band, wanted),
    )


@dataclass(frozen=True, slots=True)
class _Band:
    """Falling shares with the ends of their intervals, and the number of independent errors that know them as well."""

    share: Floats
    low: Floats
    high: Floats
    size: Floats


def _band(share: Floats, size: Floats, rows: int, confidence: float) -> _Band:
    share, size = np.clip(share, 0.0, 1.0), np.where(np.isnan(size), float(rows), size)
    normal = _student(confidence, math.inf)
    few = (normal / _student(confidence, rows - 1)) ** 2 if rows > 1 else 1.0
    low, high = _binomial_band(share * size * few, size * few, confidence)
    # a share is no less than one further out and no more than one further in, so neither are the ends of its interval
    return _Band(share, np.maximum.accumulate(low[::-1])[::-1], np.minimum.accumulate(high), size)


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
