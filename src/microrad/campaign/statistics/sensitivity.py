"""Which inputs an output depends on: Sobol indices and rank correlations from rows as they were drawn."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from microrad.campaign.records import Interval, Sensitivity
from microrad.core.arrays import Floats
from microrad.core.intervals import student
from microrad.core.units import format_limit

MOST_ROWS = 20_000
SURROGATE_ROWS = 4_096
FEWEST_ROWS = 64
SURROGATE_Q2 = 0.8
"""Share of the variance that a surrogate has to predict in rows it has not seen, or there are no total indices."""

CORRELATED = 0.3
"""Rank correlation of two inputs beyond which a total index would not be that of one of them."""

_GROUPS = 24  # parts of the rows that are left out in turn
_AS_GOOD_AS_IT_GETS = 0.999
_DEGREE = 12
_TERMS = 256
_APART = 1e-3  # least share of a term that those before it do not already have


def sensitivity(inputs: dict[str, Floats], output: Floats, name: str, confidence: float = 0.95) -> Sensitivity:
    """Sobol indices and Spearman's correlations of an output (rows,) with each input (rows,), with intervals.

    First-order indices are correlation ratios on bins of equal probability (E. Plischke, E. Borgonovo and C. L. Smith,
    Global sensitivity measures from given data, Eur. J. Oper. Res. 226 (2013) 536), with a straight line in each bin
    and without the bias (T. L. Kelley, PNAS 21 (1935) 554): no special design of the rows is needed. Total
    indices come from a polynomial surrogate (`_fit`) and are left out where it is not good enough or inputs depend on
    each other; ``note`` says so. What the surrogate leaves unexplained, the noise of the runs included, may belong to
    any input: it is in the upper end of their intervals. Intervals are from leaving out parts of the rows in turn.
    Rows with nan or without end in the output are left out, and those behind the first `MOST_ROWS`.

    Args:
        inputs: the drawn inputs (rows,) by key.
        output: the output (rows,).
        name: what it is called.
        confidence: that of all intervals, within (0, 1).
    """
    good = np.isfinite(output)
    for column in inputs.values():
        good &= np.isfinite(column)
    rows = np.flatnonzero(good)[:MOST_ROWS]
    reason = _refused(output[rows], inputs)
    if reason:
        return Sensitivity(name, rows.size, {}, {}, {}, math.nan, reason)
    columns = {key: column[rows] for key, column in inputs.items()}
    y = output[rows]
    first = {key: _first(column, y, confidence) for key, column in columns.items()}
    ranks = {key: _rank_correlation(column, y, confidence) for key, column in columns.items()}
    total, q2, note = _totals(columns, y, confidence)
    return Sensitivity(name, rows.size, first, total, ranks, q2, note)


def _refused(y: Floats, inputs: dict[str, Floats]) -> str:
    """Why there is nothing to say; empty where there is."""
    if not inputs:
        return "no inputs are drawn"
    if y.size < FEWEST_ROWS:
        return f"{y.size} good rows are too few to say what matters: {FEWEST_ROWS} are needed"
    if np.ptp(y) <= 1e-12 * np.max(np.abs(y)):
        return "the output is the same in all rows"
    return ""


# ---------------------------------------------------------------------------------------------------------- first order
def _first(x: Floats, y: Floats, confidence: float) -> Interval:
    """First-order index: share of the variance of y that straight lines in bins of x explain."""
    place, bins = _bins(x)
    if bins == 1:
        return Interval(0.0, 0.0, 0.0, confidence)
    at = _groups(y.size) * bins + place
    across, off = _inside(x, place), (y - np.mean(y)) / np.std(y)
    parts = (np.ones(y.size), across, across**2, off, across * off, off**2)
    sums = np.stack([np.bincount(at, part, _GROUPS * bins).reshape(_GROUPS, bins) for part in parts])
    whole = np.sum(sums, axis=1)
    value, biased = (float(ratio) for ratio in _ratio(whole))
    index = _jackknifed(value, _ratio(whole[:, None] - sums)[0], confidence)
    return Interval(index.value, index.low, min(max(index.high, biased), 1.0), confidence)


def _bins(x: Floats) -> tuple[NDArray[np.intp], int]:
    """Bin of each value, and their number: one for each of few values, else equally probable, tied values together."""
    most = min(max(round(x.size ** (1 / 3)), 4), 24)
    values, place = np.unique(x, return_inverse=True)
    if values.size > most:
        smaller = np.searchsorted(np.sort(x), values)
        place = np.unique(smaller * most // x.size, return_inverse=True)[1][place]
    return np.asarray(place, dtype=np.intp), int(place.max()) + 1


def _inside(x: Floats, place: NDArray[np.intp]) -> Floats:
    """Each value from the middle of its bin in widths of the bin."""
    low, high = np.full(place.max() + 1, math.inf), np.full(place.max() + 1, -math.inf)
    np.minimum.at(low, place, x)
    np.maximum.at(high, place, x)
    width = np.where(high > low, high - low, 1.0)
    return np.asarray((x - (low + 0.5 * (high - low))[place]) / width[place])


def _ratio(sums: Floats) -> tuple[Floats, Floats]:
    """Share of the variance that is explained, without and with its bias, from the sums (6, ..., bins) of `_first`.

    The first is unbiased for random rows; rows of a Latin hypercube or a Sobol set lie between the two.
    """
    count, x, xx, y, xy, yy = sums
    rows, filled = np.sum(count, axis=-1), np.maximum(count, 1.0)
    spread, both = xx - x**2 / filled, xy - x * y / filled
    sloped = spread > 1e-9 * filled
    explained = y**2 / filled + np.where(sloped, both**2 / np.where(sloped, spread, 1.0), 0.0)
    used = np.count_nonzero(count, axis=-1) + np.count_nonzero(sloped, axis=-1)
    whole = np.sum(yy, axis=-1) - np.sum(y, axis=-1) ** 2 / rows
    rest = np.maximum(np.sum(yy - explained, axis=-1), 0.0) / whole
    return np.asarray(1.0 - rest * (rows - 1) / (rows - used)), np.asarray(1.0 - rest)


def _groups(rows: int) -> NDArray[np.intp]:
    """Group of each row, at random: rows in order would be strata of a Sobol set."""
    order = np.random.Generator(np.random.Philox(rows)).permutation(rows)
    return np.asarray(order % _GROUPS, dtype=np.intp)


def _jackknifed(value: float, left_out: Floats, confidence: float) -> Interval:
    """An index with its interval from what it is without each of the groups (delete-a-group jackknife), in 0 to 1."""
    groups = left_out.size
    error = math.sqrt((groups - 1) / groups * float(np.sum((left_out - np.mean(left_out)) ** 2)))
    half = student(confidence, groups - 1) * error
    low, value, high = (min(max(v, 0.0), 1.0) for v in (value - half, value, value + half))
    return Interval(value, low, high, confidence)


# ---------------------------------------------------------------------------------------------------------------- ranks
def _ranks(x: Floats) -> Floats:
    """Ranks from 0 to 1, the mean of tied ones."""
    _, place, count = np.unique(x, return_inverse=True, return_counts=True)
    last = np.cumsum(count)
    return np.asarray(((last - 0.5 * count) / x.size)[place])


def _correlation(a: Floats, b: Floats) -> float:
    """Spearman's; nan where one of them does not vary."""
    a, b = _ranks(a) - 0.5, _ranks(b) - 0.5
    size = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    return float(np.sum(a * b)) / size if size > 0.0 else math.nan


def _rank_correlation(x: Floats, y: Floats, confidence: float) -> Interval:
    """Spearman's correlation; interval after D. G. Bonett and T. A. Wright, Psychometrika 65 (2000) 23."""
    value = _correlation(x, y)
    if math.isnan(value):
        return Interval(value, math.nan, math.nan, confidence)
    half = student(confidence, math.inf) * math.sqrt((1.0 + value**2 / 2.0) / (x.size - 3))
    middle = math.atanh(min(max(value, -1.0 + 1e-12), 1.0 - 1e-12))
    return Interval(value, math.tanh(middle - half), math.tanh(middle + half), confidence)


# --------------------------------------------------------------------------------------------------------------- totals
@dataclass(frozen=True, slots=True)
class _Surrogate:
    """A polynomial in the inputs and its leave-one-out score: products (rows, terms) of polynomials of each input.

    ``degrees`` (terms, inputs) tell which.
    """

    polynomials: list[Floats]
    degrees: NDArray[np.int64]
    columns: Floats
    q2: float


def _totals(columns: dict[str, Floats], y: Floats, confidence: float) -> tuple[dict[str, Interval], float, str]:
    """Total indices by input, the surrogate's score, and why there are none."""
    moving = [key for key, column in columns.items() if np.ptp(column) > 0.0]
    if not moving:
        return {}, math.nan, "no total indices: no input varies"
    pair = _most_correlated({key: columns[key] for key in moving})
    if pair:
        return {}, math.nan, f"no total indices: {pair}"
    x, y = np.column_stack([columns[key][:SURROGATE_ROWS] for key in moving]), y[:SURROGATE_ROWS]
    surrogate = _fit(_coordinates(x, as_ranks=False), y)
    if surrogate.q2 < _AS_GOOD_AS_IT_GETS:
        surrogate = max(surrogate, _fit(_coordinates(x, as_ranks=True), y), key=lambda s: s.q2)
    if surrogate.q2 < SURROGATE_Q2:
        share = format_limit(100.0 * max(surrogate.q2, 0.0), "", 3)  # never rounded up to what is needed
        reason = f"predicts {share} % of the variance where {100.0 * SURROGATE_Q2:g} % are needed"
        return {}, surrogate.q2, f"no total indices: the polynomial surrogate {reason}"
    found = {key: Interval(0.0, 0.0, 0.0, confidence) for key in columns}
    found.update(zip(moving, _total_indices(surrogate, y, confidence), strict=True))
    return found, surrogate.q2, ""


def _most_correlated(columns: dict[str, Floats]) -> str:
    """The two inputs that depend on each other most, in words; empty where none do by more than `CORRELATED`."""
    keys, ranks = list(columns), np.column_stack([_ranks(column) for column in columns.values()])
    shared = np.triu(np.atleast_2d(np.corrcoef(ranks, rowvar=False)), 1)
    a, b = np.unravel_index(int(np.argmax(np.abs(shared))), shared.shape)
    if abs(shared[a, b]) <= CORRELATED:
        return ""
    return f"{keys[a]} and {keys[b]} are not independent (rank correlation {shared[a, b]:.2f})"


def _coordinates(x: Floats, as_ranks: bool) -> list[Floats]:
    """Polynomials (rows, degree + 1) of each input, orthonormal over the rows (arbitrary polynomial chaos).

    S. Oladyshkin and W. Nowak, Reliab. Eng. Syst. Saf. 106 (2012) 179. An input with few values has few degrees.
    """
    found = []
    for column in x.T:
        scaled = _ranks(column) if as_ranks else column
        scaled = 2.0 * (scaled - scaled.min()) / np.ptp(scaled) - 1.0
        degree = min(_DEGREE, np.unique(column).size - 1)
        found.append(np.linalg.qr(np.polynomial.legendre.legvander(scaled, degree))[0] * math.sqrt(column.size))
    return found


def _fit(polynomials: list[Floats], y: Floats) -> _Surrogate:
    """Least squares in products of the polynomials up to a total degree: that which predicts best.

    The score is 1 minus the leave-one-out error over the variance, with the correction for few rows of G. Blatman and
    B. Sudret, J. Comput. Phys. 230 (2011) 2345. The terms are in the order of their degree, so one orthogonalisation
    serves all degrees.
    """
    degrees, ends = _terms([p.shape[1] - 1 for p in polynomials], min(_TERMS, y.size // 3))
    columns = np.ones((y.size, degrees.shape[0]))
    for polynomial, degree in zip(polynomials, degrees.T, strict=True):
        columns *= polynomial[:, degree]
    q, r = np.linalg.qr(columns)
    apart = int(np.argmin(np.append(np.abs(np.diag(r)) > _APART * math.sqrt(y.size), False)))  # leading such columns
    best, rows = _Surrogate(polynomials, degrees[:1], columns[:, :1], -math.inf), y.size
    rest, leverage, begin = y.copy(), np.zeros(rows), 0
    inverse_square = np.sum(np.linalg.inv(r[:apart, :apart]) ** 2, axis=0)
    for end in (end for end in ends if end <= apart):
        part = q[:, begin:end]
        rest, leverage, begin = rest - part @ (part.T @ y), leverage + np.sum(part**2, axis=1), end
        missed = float(np.mean((rest / np.maximum(1.0 - leverage, 1e-9)) ** 2))
        few = rows / (rows - end) * (1.0 + float(np.sum(inverse_square[:end])))
        q2 = 1.0 - missed * few / float(np.var(y))
        if q2 > best.q2:
            best = _Surrogate(polynomials, degrees[:end], columns[:, :end], q2)
    return best


def _terms(most: list[int], count: int) -> tuple[NDArray[np.int64], list[int]]:
    """Degrees (terms, inputs) of all products of no more than ``count``, and the number of terms up to each degree."""
    terms, ends = [(0,) * len(most)], []
    for total in range(1, _DEGREE + 1):
        more = list(itertools.islice(_degrees(total, most), count - len(terms) + 1))
        if not more or len(terms) + len(more) > count:
            break
        terms += more
        ends.append(len(terms))
    return np.array(terms, dtype=np.int64), ends or [1]


def _degrees(total: int, most: list[int]) -> Iterator[tuple[int, ...]]:
    """All products of one total degree, which ends with the last input."""
    if not most:
        yield ()
        return
    for here in range(min(total, most[0]), -1, -1):
        if total - here <= sum(most[1:]):
            for others in _degrees(total - here, most[1:]):
                yield (here, *others)


@dataclass(frozen=True, slots=True)
class _Sums:
    """What total indices need of a part of the rows: products of the columns with each other and with y.

    ``marginals`` are the products of each input's own polynomials with each other: its distribution in these rows.
    """

    gram: Floats
    right: Floats
    square: float
    rows: int
    marginals: list[Floats]

    def without(self, part: "_Sums") -> "_Sums":
        """The sums of all rows but those of a part."""
        return _Sums(
            self.gram - part.gram,
            self.right - part.right,
            self.square - part.square,
            self.rows - part.rows,
            [whole - less for whole, less in zip(self.marginals, part.marginals, strict=True)],
        )


def _sums(surrogate: _Surrogate, y: Floats, rows: NDArray[np.bool_]) -> _Sums:
    columns, y = surrogate.columns[rows], y[rows]
    marginals = [polynomial[rows].T @ polynomial[rows] for polynomial in surrogate.polynomials]
    return _Sums(columns.T @ columns, columns.T @ y, float(y @ y), y.size, marginals)


def _indices(sums: _Sums, degrees: NDArray[np.int64]) -> Floats:
    """Total index (inputs,): variance of the surrogate less that of its mean over an input, without their bias."""
    spread = np.linalg.inv(sums.gram)
    weight = spread @ sums.right
    noise = max(sums.square - float(weight @ sums.right), 0.0) / (sums.rows - weight.size)
    bias = noise * np.diag(spread)
    product, others, averaged = _product_measure([m / sums.rows for m in sums.marginals], degrees)
    whole = float(weight @ product @ weight)
    variance = whole - float(averaged[0] @ weight) ** 2 - float(np.sum(bias[1:])) + noise  # the first term is the mean
    left = [
        w @ other @ w for w, other in ((weight * mean, other) for mean, other in zip(averaged[1:], others, strict=True))
    ]
    return np.asarray((whole - np.array(left) - bias @ (degrees > 0)) / variance)


def _total_indices(surrogate: _Surrogate, y: Floats, confidence: float) -> list[Interval]:
    """Total index of each input, its upper end with all that the surrogate does not explain."""
    off, groups = (y - np.mean(y)) / np.std(y), _groups(y.size)
    whole = _sums(surrogate, off, groups >= 0)
    parts = (_sums(surrogate, off, groups == group) for group in range(_GROUPS))
    left_out = np.array([_indices(whole.without(part), surrogate.degrees) for part in parts])
    unexplained = max(1.0 - surrogate.q2, 0.0)
    found = []
    for value, others in zip(_indices(whole, surrogate.degrees), left_out.T, strict=True):
        index = _jackknifed(float(value), others, confidence)
        found.append(Interval(index.value, index.low, min(index.high + unexplained, 1.0), confidence))
    return found


def _product_measure(marginals: list[Floats], degrees: NDArray[np.int64]) -> tuple[Floats, list[Floats], list[Floats]]:
    """Means over independent inputs of the products of two terms (terms, terms).

    Of all inputs; by input, of all others; and the mean (terms,) of each term, then by input of its own factor: up to
    the sign of the constant among an input's polynomials, which a square form in them does not see.
    """
    own = [m[np.ix_(d, d)] for m, d in zip(marginals, degrees.T, strict=True)]
    means = [m[0][d] for m, d in zip(marginals, degrees.T, strict=True)]
    behind = [np.ones_like(own[0])]
    for factor in reversed(own[1:]):
        behind.append(behind[-1] * factor)
    before, others = np.ones_like(own[0]), []
    for factor, rest in zip(own, reversed(behind), strict=True):
        others.append(before * rest)
        before = before * factor
    return before, others, [np.prod(means, axis=0), *means]
