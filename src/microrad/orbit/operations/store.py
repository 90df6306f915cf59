"""The store on board between an instrument and the link: what is on board when, and how late the data arrives."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.orbit.operations.rates import Service

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

    def cdf(self, latency_s: ArrayLike) -> Floats:
        """Share of the data kept that arrived within each latency, of the shape of `latency_s`; nan without data."""
        wanted = np.asarray(latency_s, dtype=np.float64)
        shares = [self._share(value, at=True) for value in wanted.ravel()]
        return np.array(shares, dtype=np.float64).reshape(wanted.shape)

    def quantile(self, share: float) -> float:
        """Least latency within which `share` of the data kept has arrived, in s.

        It is inf where more than 1 - `share` was still on board at the end, nan where no data was kept.
        """
        if math.isnan(self.delivered_share):
            return math.nan
        wanted = share * (1.0 - _ROUNDING)
        knots = np.unique(np.concatenate((self.first_s, self.last_s)))
        if self.delivered_share < wanted or not knots.size:
            return math.inf
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


@dataclass(frozen=True, slots=True, eq=False)
class StoreHistory:
    """The store over the span: cumulative data at the moments where a rate changes, linear in between.

    `time_s`, `generated_bit`, `lost_bit`, `delivered_bit` and `stored_bit` have the shape (n,); at each moment
    generated = delivered + lost + stored.
    """

    time_s: Floats
    generated_bit: Floats
    lost_bit: Floats
    delivered_bit: Floats
    stored_bit: Floats
    latency: Latency

    @property
    def largest_stored_bit(self) -> float:
        """Most data on board at any moment."""
        return float(np.max(self.stored_bit))


def deliver(
    rate_bit_s: float,
    observed_s: tuple[float, float],
    capacity_bit: float,
    services: Sequence[Service],
    span_s: tuple[float, float],
    delay_s: float,
) -> StoreHistory:
    """Run a store that is empty at the start of `span_s` through its contacts.

    The store is a fluid queue, first in, first out. What does not fit is lost, the newest: a full store still takes in
    what the link takes out. Between two changes of rate the stored data is linear in time until it meets 0 or the
    capacity, so the result is exact and there is no time step. Mean rates count, outages spread evenly.

    Args:
        rate_bit_s: Data produced over the observed time, at least 0.
        observed_s: Start and end of the production, within the span.
        capacity_bit: Room of the store, above 0; inf allowed.
        services: The contacts, in order, which do not overlap and lie within the span.
        span_s: Start and end. What is on board at its end counts as not delivered.
        delay_s: Added to every latency: from the satellite to where the data is wanted.
    """
    grid = np.unique(np.concatenate([span_s, observed_s, *(s.edges_s for s in services)]))
    middle = 0.5 * (grid[1:] + grid[:-1])
    made = np.where((observed_s[0] < middle) & (middle < observed_s[1]), rate_bit_s, 0.0)
    time, stored, kept, lost = _march(grid, made, _sent_bit_s(services, middle), capacity_bit)
    # kept less stored, not a sum of its own: an empty store has then delivered all, to the last bit
    delivered = np.maximum.accumulate(np.minimum(kept - stored, kept))
    return StoreHistory(
        time_s=time,
        generated_bit=kept + lost,
        lost_bit=lost,
        delivered_bit=delivered,
        stored_bit=stored,
        latency=_latency(time, kept, delivered, delay_s),
    )


def _sent_bit_s(services: Sequence[Service], middle: Floats) -> Floats:
    """Rate of the link at each time, 0 between contacts."""
    sent = np.zeros(middle.size)
    for one in services:
        first, last = np.searchsorted(middle, (one.start_s, one.end_s))
        piece = np.searchsorted(one.edges_s, middle[first:last], side="right") - 1
        sent[first:last] = one.mean_rate_bit_s[piece]
    return sent


def _march(grid: Floats, made: Floats, sent: Floats, capacity: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Time, data stored, and cumulative data kept and lost, at the grid and where the store fills or empties."""
    rows = [(float(grid[0]), 0.0, 0.0, 0.0)]
    for end, rate_in, rate_out in zip(grid[1:].tolist(), made.tolist(), sent.tolist(), strict=True):
        while rows[-1][0] < end:
            row = _piece(rows[-1], end, rate_in, rate_out, capacity)
            if row[0] == rows[-1][0]:  # a bound within rounding
                rows.pop()
            rows.append(row)
    time, stored, kept, lost = np.array(rows).T.copy()
    return time, stored, kept, lost


_Row = tuple[float, float, float, float]


def _piece(row: _Row, end: float, rate_in: float, rate_out: float, capacity: float) -> _Row:
    """The store at `end`, or where it fills or empties if that comes first."""
    time, stored, kept, lost = row
    net = rate_in - rate_out
    if net == 0.0 or (stored >= capacity and net > 0.0) or (stored <= 0.0 and net < 0.0):  # stays as it is
        taken = min(rate_in, rate_out) if stored >= capacity else rate_in
        return end, stored, kept + taken * (end - time), lost + (rate_in - taken) * (end - time)
    bound = capacity if net > 0.0 else 0.0
    until = time + (bound - stored) / net
    if until < end:
        return until, bound, kept + rate_in * (until - time), lost
    within = min(max(stored + net * (end - time), 0.0), capacity)
    return end, within, kept + rate_in * (end - time), lost


# ------------------------------------------------------------------------------------------------------------- latency
def _latency(time_s: Floats, kept_bit: Floats, delivered_bit: Floats, delay_s: float) -> Latency:
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
    """Latency over the data of several runs together: each run counts by its data."""
    return Latency(
        np.concatenate([x.first_s for x in latencies]),
        np.concatenate([x.last_s for x in latencies]),
        np.concatenate([x.volume_bit for x in latencies]),
        math.fsum(x.missing_bit for x in latencies),
    )
