"""Distribution of the time from the production of data to its arrival, exact for a fluid store."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from microrad.orbit.operations.base import Floats, OperationsError

_ROUNDING = 1e-12  # of a share that is a sum of many


@dataclass(frozen=True, slots=True, eq=False)
class Latency:
    """Latency of the data that was kept: slabs of data, in each of which it changes linearly, and what never arrived.

    `first_s` and `last_s` are the latencies of the first and the last bit of each slab and `volume_bit` the slab's
    data, each of shape (m,). `missing_bit` was still on board at the end: it counts as later than any latency. Data
    lost for want of room is not in the distribution.
    """

    first_s: Floats
    last_s: Floats
    volume_bit: Floats
    missing_bit: float

    @property
    def delivered_bit(self) -> float:
        """Data that arrived."""
        return float(np.sum(self.volume_bit))

    @property
    def delivered_share(self) -> float:
        """Share of the data kept that arrived; nan where no data was kept."""
        total = self.delivered_bit + self.missing_bit
        return self.delivered_bit / total if total > 0.0 else math.nan

    @property
    def mean_s(self) -> float:
        """Mean over the delivered data alone; nan where nothing was delivered. See `delivered_share` for the rest."""
        delivered = self.delivered_bit
        if delivered <= 0.0:
            return math.nan
        return float(np.dot(self.volume_bit, 0.5 * (self.first_s + self.last_s))) / delivered

    def cdf(self, latency_s: ArrayLike) -> Floats:
        """Share of the data kept that arrived within each latency, of the shape of `latency_s`; nan without data."""
        wanted = np.asarray(latency_s, dtype=np.float64)
        shares = [self._share(value, at=True) for value in wanted.ravel()]
        return np.array(shares, dtype=np.float64).reshape(wanted.shape)

    def quantile(self, share: float) -> float:
        """Least latency within which `share` of the data kept has arrived, in s.

        It is inf where more than 1 - `share` was still on board at the end, nan where no data was kept. Raises
        `OperationsError` for a share that is not above 0 and at most 1.
        """
        if not 0.0 < share <= 1.0:
            raise OperationsError(f"the quantile is asked for the share {share:g}; give one above 0 and at most 1")
        if math.isnan(self.delivered_share):
            return math.nan
        wanted = share * (1.0 - _ROUNDING)
        if self.delivered_share < wanted:
            return math.inf
        knots = np.unique(np.concatenate((self.first_s, self.last_s)))
        low, high = -1, knots.size - 1  # at `high` the share is reached, at `low` it is not
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if self._share(knots[middle], at=True) >= wanted else (middle, high)
        return self._between(knots, high, wanted)

    def _between(self, knots: Floats, place: int, wanted: float) -> float:
        """Latency up to knot `place` where the share is reached: the distribution is linear from knot to knot."""
        high = float(knots[place])
        if place == 0:
            return high
        low = float(knots[place - 1])
        below, above = self._share(low, at=True), self._share(high, at=False)
        if wanted >= above:
            return high  # reached by the jump at the knot
        return low + (high - low) * (wanted - below) / (above - below)

    def _share(self, latency_s: float, *, at: bool) -> float:
        """Share of the data kept that arrived within a latency; `at` counts the data that has exactly this latency."""
        total = self.delivered_bit + self.missing_bit
        if total <= 0.0:
            return math.nan
        low, high = np.minimum(self.first_s, self.last_s), np.maximum(self.first_s, self.last_s)
        reached = (low <= latency_s) if at else (low < latency_s)
        inside = np.divide(latency_s - low, high - low, out=np.ones(low.size), where=high > low)
        return float(np.dot(self.volume_bit, np.where(reached, np.clip(inside, 0.0, 1.0), 0.0))) / total


def latency_of(time_s: Floats, kept_bit: Floats, delivered_bit: Floats, delay_s: float) -> Latency:
    """Latency from the piecewise-linear cumulative data kept and delivered at the times `time_s`, all (n,), rising.

    First in, first out: the bit number b is made when the kept data reach b and delivered when the delivered data do;
    it arrives `delay_s` later. Between two levels at which either curve bends both moments are linear in b.
    """
    end = delivered_bit[-1]
    levels = np.unique(np.concatenate((kept_bit, delivered_bit)))
    levels = levels[levels <= end]
    low, high = levels[:-1], levels[1:]
    waits = [
        _moment(delivered_bit, time_s, low, high, level) - _moment(kept_bit, time_s, low, high, level)
        for level in (low, high)
    ]
    first, last = (np.maximum(wait, 0.0) + delay_s for wait in waits)
    return Latency(first, last, high - low, float(kept_bit[-1] - end))


def _moment(curve: Floats, time_s: Floats, low: Floats, high: Floats, level: Floats) -> Floats:
    """Moment at which a curve that does not fall is at `level`, by its piece that spans `low` to `high`."""
    piece = np.clip(np.searchsorted(curve, 0.5 * (low + high), side="right") - 1, 0, curve.size - 2)
    rise = curve[piece + 1] - curve[piece]
    part = np.divide(level - curve[piece], rise, out=np.zeros(level.size), where=rise > 0.0)
    return np.asarray(time_s[piece] + np.clip(part, 0.0, 1.0) * (time_s[piece + 1] - time_s[piece]))


def pool(latencies: Sequence[Latency]) -> Latency:
    """Latency over the data of several runs together: each run counts by its data.

    Raises `OperationsError` for no run at all.
    """
    if not latencies:
        raise OperationsError("no latencies to pool; give those of at least one run")
    return Latency(
        np.concatenate([x.first_s for x in latencies]),
        np.concatenate([x.last_s for x in latencies]),
        np.concatenate([x.volume_bit for x in latencies]),
        math.fsum(x.missing_bit for x in latencies),
    )
