"""A sketch of a distribution: quantiles of any number of values with a guaranteed relative error, in little memory."""

import math

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats

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

    __slots__ = ("_high", "_keys", "_low", "_square", "_waiting", "_weight")

    def __init__(self) -> None:
        """A sketch of nothing."""
        self._keys: NDArray[np.int64] = np.empty(0, dtype=np.int64)
        self._weight: Floats = np.empty(0)
        self._square: Floats = np.empty(0)
        self._low: Floats = np.empty(0)
        self._high: Floats = np.empty(0)
        self._waiting: list[tuple[Floats, Floats]] = []

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
        self._waiting.append((values, given))
        if sum(waiting.size for waiting, _ in self._waiting) >= _WAITING:
            self._settle()

    def merge(self, other: "Sketch") -> None:
        """Take in all that another sketch has; the other stays as it is."""
        self._settle()
        other._settle()
        self._take(other._keys, other._weight, other._square, other._low, other._high)

    def _settle(self) -> None:
        """Put the values that wait into their bins: many at once, since each time costs as much as all bins do."""
        if self._waiting:
            values, weights = (np.concatenate(parts) for parts in zip(*self._waiting, strict=True))
            self._waiting.clear()
            keys = _keys(values)
            held = np.where(keys == 0, 0.0, np.where(np.abs(keys) == _LAST, np.copysign(math.inf, values), values))
            self._take(keys, weights, weights**2, held, held)

    def _take(self, keys: NDArray[np.int64], weight: Floats, square: Floats, low: Floats, high: Floats) -> None:
        self._keys, place = np.unique(np.concatenate([self._keys, keys]), return_inverse=True)
        lowest, highest = np.full(self._keys.size, math.inf), np.full(self._keys.size, -math.inf)
        np.minimum.at(lowest, place, np.concatenate([self._low, low]))
        np.maximum.at(highest, place, np.concatenate([self._high, high]))
        self._low, self._high = lowest, highest
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
        """Smallest and largest value (bins,) that each bin holds, rising: what has few values keeps them exactly."""
        self._settle()
        return self._low, self._high

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


def _spread(edges: Floats, low: Floats, high: Floats, weight: Floats) -> Floats:
    """Weight of each bin of the picture: even over the bin of the sketch that it comes from."""
    total = np.cumsum(weight)
    before = np.interp(edges, np.ravel([low, high], "F"), np.ravel([total - weight, total], "F"))
    before[0], before[-1] = 0.0, total[-1]  # a first or last value that its bin is no wider than is in there, too
    return np.diff(before)
