"""Statistics of rows: means, quantiles and shares, with intervals that hold for few rows."""

import math
from bisect import bisect_left
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from microrad.campaign.definition.outputs import Output
from microrad.campaign.records import Interval, OutputSummary
from microrad.core.arrays import Floats
from microrad.core.intervals import binomial_band, student

PICTURE_BINS = 40


@dataclass(frozen=True, slots=True)
class Moments:
    """Weighted moments of values: their number, sum of weights and of squared weights, mean, spread and range.

    ``spread`` is the sum of w (x - mean)^2; ``skewed`` and ``square`` are those of w^2 (x - mean) and
    w^2 (x - mean)^2, from which the error of the mean follows.
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


def moments(values: Floats, weights: Floats | None = None) -> Moments:
    """Moments of values; nan is left out.

    Args:
        values: the values (n,).
        weights: their weights (n,), above 0; 1 by default.
    """
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
    """Mean of the rows with its interval by Student's t; that is not known with less than two rows or blocks.

    Args:
        rows: moments of the rows.
        confidence: that of the interval, within (0, 1).
        blocks: moments of the means of independent blocks, one Latin hypercube or Sobol set each: rows of one block
            are not independent, so the spread from block to block gives the interval then. None: the rows are
            independent.
    """
    parts = blocks or rows
    if parts.count < 2:
        return Interval(rows.mean, math.nan, math.nan, confidence)
    half = student(confidence, parts.count - 1) * math.sqrt(parts.mean_variance)
    return Interval(rows.mean, rows.mean - half, rows.mean + half, confidence)


def proportion_interval(hits: float, trials: float, confidence: float) -> Interval:
    """Share of trials that hit, with the interval of C. J. Clopper and E. S. Pearson, Biometrika 26 (1934) 404.

    Never too narrow. Without trials nothing is known.

    Args:
        hits: trials that hit; any number from 0 to all, not whole ones alone.
        trials: all trials.
        confidence: that of the interval, within (0, 1).
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

    Args:
        rows: moments of 1 (hit) and 0 over the rows.
        confidence: that of the interval, within (0, 1).
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


@dataclass(frozen=True, slots=True)
class Ordered:
    """Values (n,), rising, with the sums (n + 1,) of the weights before each, and of their squares, from 0 on."""

    values: Floats
    weight: Floats
    square: Floats

    def quantile(self, probability: float) -> float:
        """Smallest value that a share of the weight is at most equal to; nan without values."""
        if not self.values.size:
            return math.nan
        at = int(np.searchsorted(self.weight[1:], probability * float(self.weight[-1])))
        return float(self.values[min(at, self.values.size - 1)])


def ordered(values: Floats, weights: Floats | None = None) -> Ordered:
    """Values in their order; nan is left out.

    Args:
        values: the values (n,).
        weights: their weights (n,), above 0; 1 by default.
    """
    given = np.ones(values.shape) if weights is None else weights
    order = np.argsort(values, kind="stable")[: int(np.count_nonzero(~np.isnan(values)))]  # nan comes last
    given = given[order]
    weight, square = (np.concatenate([[0.0], np.cumsum(each)]) for each in (given, given**2))
    return Ordered(values[order], weight, square)


def quantile_interval(rows: Ordered, probability: float, confidence: float) -> Interval:
    """Quantile of the rows, with an interval that holds for any distribution.

    Its ends are the order statistics between which the quantile is by the binomial distribution (H. A. David and H. N.
    Nagaraja, Order Statistics, 2003, section 7.1). With weights the number of rows is that of independent ones which
    would know the share below as well. An end that so few rows cannot have is nan.

    Args:
        rows: the values in their order.
        probability: share of the rows below the quantile.
        confidence: that of the interval, within (0, 1).
    """
    value, count, beyond = rows.quantile(probability), rows.values.size, (1.0 - confidence) / 2.0
    if not count:
        return Interval(value, math.nan, math.nan, confidence)
    # the tails rise and fall with the rank, but with weights not to the ends: at none and at all of the rows they go by
    # what all rows are worth, next to them by one row, which may be worth many; so the ends are asked last
    inner = range(1, count)
    above = 1 + bisect_left(inner, True, key=lambda rank: _tails(rows, rank, probability)[0] >= beyond)
    below = 1 + bisect_left(inner, True, key=lambda rank: _tails(rows, rank, probability)[1] < beyond)
    has_low = above > 1 or _tails(rows, 0, probability)[0] < beyond
    has_high = below < count or _tails(rows, count, probability)[1] < beyond
    return Interval(
        value,
        float(rows.values[above - 1]) if has_low else math.nan,
        float(rows.values[below - 1]) if has_high else math.nan,
        confidence,
    )


def _tails(rows: Ordered, rank: int, probability: float) -> tuple[float, float]:
    """Probability of a share as small as that of the first ``rank`` rows, and of one as large.

    Each of as many independent rows as would know that share hits with ``probability``.
    """
    from scipy.special import betainc, betaincc

    total, squares = float(rows.weight[-1]), float(rows.square[-1])
    share = float(rows.weight[rank]) / total
    size = total**2 / squares
    if 0.0 < share < 1.0:
        square = float(rows.square[rank])
        spread = (1.0 - share) ** 2 * square + share**2 * (squares - square)
        size = share * (1.0 - share) * total**2 / spread
    hits = share * size
    few = float(betaincc(hits + 1.0, max(size - hits, 1e-300), probability)) if hits < size else 1.0
    many = float(betainc(max(hits, 1e-300), size - hits + 1.0, probability)) if hits > 0.0 else 1.0
    return few, many


# ---------------------------------------------------------------------------------------------------------- one output
def block_means(rows: Floats, values: Floats, weights: Floats, block: int) -> Moments:
    """Moments of the means of the whole blocks; each mean is a draw of the mean, unless all its rows have failed.

    A block of which rows are missing says nothing about the mean's interval.

    Args:
        rows: numbers of the rows (n,), rising.
        values: an output (n,), nan where a row has failed.
        weights: their weights (n,).
        block: rows of a block.
    """
    _, first, count = np.unique(rows // block, return_index=True, return_counts=True)
    whole = [slice(at, at + block) for at in first[count == block].tolist()]
    means = [moments(values[each], weights[each]).mean for each in whole]
    return moments(np.array(means))


def output_summary(
    output: Output, columns: Mapping[str, Floats], probabilities: Iterable[float], confidence: float, block: int = 0
) -> OutputSummary:
    """What rows say of an output.

    Args:
        output: the output.
        columns: columns (rows,) by name, with ``row`` and ``weight``.
        probabilities: those of the quantiles.
        confidence: that of all intervals, within (0, 1).
        block: rows in a block of the sampling, 0 where rows are independent.
    """
    values, weights = columns[output.name], columns["weight"]
    known, in_order = moments(values, weights), ordered(values, weights)
    blocks = block_means(columns["row"], values, weights, block) if block else None
    edges, counts = histogram(values, weights)
    return OutputSummary(
        name=output.name,
        unit=output.unit,
        meaning=output.meaning,
        rows=known.count,
        mean=mean_interval(known, confidence, blocks),
        deviation=known.deviation,
        least=known.least,
        most=known.most,
        quantiles={p: quantile_interval(in_order, p, confidence) for p in probabilities},
        edges=edges,
        counts=counts,
    )


def histogram(values: Floats, weights: Floats, count: int = PICTURE_BINS) -> tuple[Floats, Floats]:
    """Edges (count + 1,) and weights (count,) of even bins over the finite values, for a picture.

    Values that are all the same get one bin about them; without any finite value both are empty.

    Args:
        values: the values (n,).
        weights: their weights (n,).
        count: how many bins.
    """
    finite = np.isfinite(values)
    values, weights = values[finite], weights[finite]
    if not values.size:
        return np.empty(0), np.empty(0)
    least, most = float(values.min()), float(values.max())
    if least == most:
        half = max(abs(least), 1e-30) * 1e-3
        return np.array([least - half, least + half]), np.array([float(np.sum(weights))])
    edges = np.linspace(least, most, count + 1)  # np.histogram refuses values a few steps of rounding apart
    bins = np.searchsorted(edges[1:-1], values, side="right")
    return edges, np.bincount(bins, weights, count).astype(float)
