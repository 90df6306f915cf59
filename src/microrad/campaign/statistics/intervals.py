"""Statistics of rows as they come: means, quantiles and shares, with intervals that hold for few rows."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from microrad.campaign.definition.outputs import Output
from microrad.campaign.records import Interval, OutputSummary
from microrad.campaign.statistics.sketch import Sketch
from microrad.core.arrays import Floats

PICTURE_BINS = 40


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
    half = student(confidence, parts.count - 1) * math.sqrt(parts.mean_variance)
    return Interval(rows.mean, rows.mean - half, rows.mean + half, confidence)


def proportion_interval(hits: float, trials: float, confidence: float) -> Interval:
    """Share of trials that hit, with the interval of C. J. Clopper and E. S. Pearson, Biometrika 26 (1934) 404.

    Never too narrow. Without trials nothing is known.
    """
    if trials <= 0.0:
        return Interval(math.nan, math.nan, math.nan, confidence)
    low, high = binomial_band(np.array([hits]), np.array([trials]), confidence)
    return Interval(hits / trials, float(low[0]), float(high[0]), confidence)


def share_interval(rows: Moments, confidence: float) -> Interval:
    """Share of the rows that hit, from the moments of 1 (hit) and 0, with its interval.

    Rows without weights: `proportion_interval`. Weights are those of importance sampling, of mean 1: the share is the
    sum of the weights that hit (or miss, where those weigh less) over the number of rows, not over the sum of all
    weights, since few heavy rows far from what is rare would decide that. The interval is that of the independent rows
    that would know the share as well: E. L. Korn and B. I. Graubard, Confidence intervals for proportions with small
    expected number of positive counts estimated from survey data, Survey Methodology 24 (1998) 193; of Kish's
    (sum w)^2 / sum w^2 where all or none hit. For rows of Latin hypercubes or Sobol sets it is wider than needed.
    """
    if not rows.count:
        return proportion_interval(0.0, 0.0, confidence)
    share = min(max(rows.mean, 0.0), 1.0)
    size = rows.weight**2 / rows.weight_square
    if rows.weight_square == rows.weight or not 0.0 < share < 1.0:
        return proportion_interval(share * size, size, confidence)
    hits, hits_square = rows.mean * rows.weight, rows.skewed + rows.mean * rows.weight_square
    rare = hits <= rows.weight - hits
    total, square = (hits, hits_square) if rare else (rows.weight - hits, rows.weight_square - hits_square)
    part = min(total / rows.count, 1.0)
    variance = max(square / rows.count - part**2, 0.0) / max(rows.count - 1, 1)
    size = part * (1.0 - part) / variance if variance > 0.0 else size
    found = proportion_interval(part * size, size, confidence)
    return found if rare else Interval(1.0 - found.value, 1.0 - found.high, 1.0 - found.low, confidence)


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
    from scipy.special import betainc, betaincc

    hits = share * size
    few = np.where(hits < size, betaincc(hits + 1.0, np.maximum(size - hits, 1e-300), probability), 1.0)
    many = np.where(hits > 0.0, betainc(np.maximum(hits, 1e-300), size - hits + 1.0, probability), 1.0)
    return few, many


def binomial_band(hits: Floats, trials: Floats, confidence: float) -> tuple[Floats, Floats]:
    """Ends of Clopper and Pearson's interval, for real numbers of hits and trials, too."""
    from scipy.special import betaincinv

    beyond, missed = (1.0 - confidence) / 2.0, np.maximum(trials - hits, 0.0)
    low = np.where(hits > 0.0, betaincinv(np.maximum(hits, 1e-300), missed + 1.0, beyond), 0.0)
    high = np.where(missed > 0.0, betaincinv(hits + 1.0, np.maximum(missed, 1e-300), 1.0 - beyond), 1.0)
    return low, high


def student(confidence: float, freedom: float) -> float:
    """Half width of the interval of Student's t with so many degrees of freedom, inf for the normal distribution."""
    from scipy.special import stdtrit

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

    def summary(self, output: Output, probabilities: Iterable[float], confidence: float) -> OutputSummary:
        """What is known of the output so far."""
        edges, counts = self.sketch.histogram(PICTURE_BINS)
        return OutputSummary(
            name=output.name,
            unit=output.unit,
            meaning=output.meaning,
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
