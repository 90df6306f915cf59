"""A sketch of a distribution: quantiles of any number of values with a guaranteed relative error, in little memory."""

import math

import numpy as np
from numpy.typing import NDArray

from microrad.campaign.records import Floats

RELATIVE_ERROR = 5e-4
"""Width of a bin over its smaller end, so that no quantile is further off than this share of itself."""

SMALLEST = 1e-30
LARGEST = 1e30
_WAITING = 4096  # values that are put into bins at once
_STEP = math.log1p(RELATIVE_ERROR)
_LAST = math.ceil(math.log(LARGEST / SMALLEST) / _STEP) + 1  # the bin of everything beyond LARGEST


class Sketch:
    """Weights of values in bins of their logarithm, for both signs and zero.

    Bins are kept where there are values only: some 5000 for values that span a factor of ten, and never more than 0.6
    million (13 MB), whatever the data. A magnitude below `SMALLEST` counts as zero and one above `LARGEST` as
    infinite. Sketches of parts merge into the sketch of the whole without any loss. After DDSketch: C. Masson, J. E.
    Rim and H. K. Lee, DDSketch: a fast and fully-mergeable quantile sketch with relative-error guarantees, Proc. VLDB
    Endowment 12 (2019) 2195; here with weights, their squares beside them, and interpolation inside a bin.
    """

    __slots__ = ("_keys", "_square", "_waiting", "_weight", "largest", "smallest")

    def __init__(self) -> None:
        """A sketch of nothing."""
        self._keys: NDArray[np.int64] = np.empty(0, dtype=np.int64)
        self._weight: Floats = np.empty(0)
        self._square: Floats = np.empty(0)
        self._waiting: list[tuple[Floats, Floats]] = []
        self.smallest, self.largest = math.inf, -math.inf

    @property
    def error(self) -> float:
        """Largest relative error of a quantile."""
        return RELATIVE_ERROR

    @property
    def weight(self) -> float:
        """Sum of the weights; their number where all are 1."""
        self._settle()
        return float(np.sum(self._weight))

    @property
    def bins(self) -> int:
        """Bins that are kept."""
        self._settle()
        return int(self._keys.size)

    def add(self, values: Floats, weights: Floats | None = None) -> None:
        """Take in values (n,), nan left out, with weights (n,) above 0 that are 1 by default."""
        given = np.ones(values.shape) if weights is None else weights
        known = ~np.isnan(values)
        values, given = values[known], given[known]
        if not values.size:
            return
        self.smallest = min(self.smallest, float(values.min()))
        self.largest = max(self.largest, float(values.max()))
        self._waiting.append((values, given))
        if sum(waiting.size for waiting, _ in self._waiting) >= _WAITING:
            self._settle()

    def merge(self, other: "Sketch") -> None:
        """Take in all that another sketch has; the other stays as it is."""
        self._settle()
        other._settle()
        self.smallest, self.largest = min(self.smallest, other.smallest), max(self.largest, other.largest)
        self._take(other._keys, other._weight, other._square)

    def _settle(self) -> None:
        """Put the values that wait into their bins: many at once, since each time costs as much as all bins do."""
        if self._waiting:
            values, weights = (np.concatenate(parts) for parts in zip(*self._waiting, strict=True))
            self._waiting.clear()
            self._take(_keys(values), weights, weights**2)

    def _take(self, keys: NDArray[np.int64], weight: Floats, square: Floats) -> None:
        self._keys, place = np.unique(np.concatenate([self._keys, keys]), return_inverse=True)
        self._weight = _summed(place, np.concatenate([self._weight, weight]), self._keys.size)
        self._square = _summed(place, np.concatenate([self._square, square]), self._keys.size)

    def quantile(self, probability: float) -> float:
        """Value that a share of the weight is at most equal to; nan for an empty sketch."""
        if not self.bins:
            return math.nan
        total = np.cumsum(self._weight)
        wanted = probability * float(total[-1])
        at = min(int(np.searchsorted(total, wanted)), self.bins - 1)
        low, high = (float(edge[at]) for edge in self.edges())
        if low == high or math.isinf(low) or math.isinf(high):
            return high
        inside = 1.0 - (float(total[at]) - wanted) / float(self._weight[at])
        return low + min(max(inside, 0.0), 1.0) * (high - low)

    def edges(self) -> tuple[Floats, Floats]:
        """Smallest and largest value (bins,) that each bin can hold, rising, no further out than the values are."""
        self._settle()
        low, high = _edges(self._keys)
        return np.clip(low, self.smallest, self.largest), np.clip(high, self.smallest, self.largest)

    def cumulative(self) -> tuple[Floats, Floats]:
        """Sums (bins,) of the weights and of their squares up to the upper end of each bin."""
        self._settle()
        return np.cumsum(self._weight), np.cumsum(self._square)

    def histogram(self, count: int) -> tuple[Floats, Floats]:
        """Edges (count + 1,) and weights (count,) of even bins over the finite values, for a picture.

        Values that are all the same get one bin about them; without any finite value both are empty.
        """
        low, high = self.edges()
        finite = np.isfinite(low) & np.isfinite(high)
        if not finite.any():
            return np.empty(0), np.empty(0)
        low, high, weight = low[finite], high[finite], self._weight[finite]
        if low[0] == high[-1]:
            half = max(abs(float(low[0])), SMALLEST) * 1e-3
            return np.array([low[0] - half, low[0] + half]), np.array([float(np.sum(weight))])
        edges = np.linspace(low[0], high[-1], count + 1)
        return edges, _spread(edges, low, high, weight)


def _keys(values: Floats) -> NDArray[np.int64]:
    """Number of the bin of each value: 0 for zero, with the value's sign."""
    magnitude = np.clip(np.abs(values), SMALLEST / 2.0, LARGEST * 2.0)
    number = np.floor(np.log(magnitude / SMALLEST) / _STEP).astype(np.int64) + 1
    number = np.where(magnitude < SMALLEST, 0, np.where(magnitude > LARGEST, _LAST, np.clip(number, 1, _LAST - 1)))
    return np.where(values < 0.0, -number, number)


def _summed(place: NDArray[np.intp], weight: Floats, size: int) -> Floats:
    return np.bincount(place, weight, size).astype(np.float64, copy=False)


def _edges(keys: NDArray[np.int64]) -> tuple[Floats, Floats]:
    number = np.abs(keys)
    inner, outer = (SMALLEST * np.exp((number - back) * _STEP) for back in (1, 0))
    inner = np.where(number == 0, 0.0, np.where(number == _LAST, math.inf, inner))
    outer = np.where(number == 0, 0.0, np.where(number == _LAST, math.inf, outer))
    return np.where(keys < 0, -outer, inner), np.where(keys < 0, -inner, outer)


def _spread(edges: Floats, low: Floats, high: Floats, weight: Floats) -> Floats:
    """Weight of each bin of the picture: even over the bin of the sketch that it comes from."""
    total = np.cumsum(weight)
    before = np.interp(edges, np.ravel([low, high], "F"), np.ravel([total - weight, total], "F"))
    before[0], before[-1] = 0.0, total[-1]  # a first or last value that its bin is no wider than is in there, too
    return np.diff(before)
