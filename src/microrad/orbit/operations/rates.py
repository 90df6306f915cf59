"""From a contact and the moment of lock to the data rate over time, by a table of rates and the ranges they reach."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from microrad.orbit.operations.base import (
    Floats,
    OperationsError,
    check_number,
    check_positive,
    check_span,
    vector,
)

Range = Callable[[Floats], Floats]
"""Range in m over time in s, both of shape (n,); smooth."""

_SPACING_S = 60.0  # of the samples of the range, at most
_FEWEST = 16  # intervals of a contact, however short
_FINE_S = 1e-4  # to which a crossing is found: a tenth of what is promised
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


class Step(NamedTuple):
    """A data rate, and the largest range at which the link closes at that rate with the required margin."""

    rate_bit_s: float
    largest_range_m: float


@dataclass(frozen=True, slots=True)
class RateTable:
    """Steps of the data rate, the highest first; in service is the first whose largest range is not exceeded.

    A largest range of inf never ends; one of 0 m is a rate at which the link never closes. Raises `OperationsError`
    for no step at all, a rate that is not above 0 or does not fall from step to step, a range that is negative or nan,
    and a lower rate that reaches less far than a higher one.
    """

    steps: tuple[Step, ...]

    def __post_init__(self) -> None:
        """Refuse what is not a table of rates."""
        if not self.steps:
            raise OperationsError("the rate table has no step; give at least one data rate with its largest range")
        for place, (rate, largest) in enumerate(self.steps):
            check_positive(rate, f"the data rate of step {place}", "bit/s")
            check_number(largest, f"the largest range of step {place}", "m", infinite=True)
        for place, (high, low) in enumerate(pairwise(self.steps)):
            if low.rate_bit_s >= high.rate_bit_s:
                raise OperationsError(
                    f"the data rate does not fall from step {place} ({high.rate_bit_s:g} bit/s) to step {place + 1} "
                    f"({low.rate_bit_s:g} bit/s); give the highest rate first, each once"
                )
            if low.largest_range_m < high.largest_range_m:
                raise OperationsError(
                    f"step {place + 1} ({low.rate_bit_s:g} bit/s) reaches {low.largest_range_m:g} m, less far than "
                    f"the higher rate before it ({high.largest_range_m:g} m): it would never serve; leave it out"
                )

    def rate_bit_s(self, range_m: ArrayLike) -> Floats:
        """Rate at each range, of the shape of `range_m`; 0 beyond every step. At its largest range a step serves."""
        limits = np.array([s.largest_range_m for s in self.steps])
        rates = np.array([*(s.rate_bit_s for s in self.steps), 0.0])
        return np.asarray(rates[np.searchsorted(limits, np.asarray(range_m, dtype=np.float64), side="left")])


@dataclass(frozen=True, slots=True, eq=False)
class Service:
    """What a contact carries: piecewise-constant data rate, `edges_s` of shape (k + 1,) and `rate_bit_s` (k,).

    `availability` is 1 less the share of time in outage. Outages are taken as short against the pieces and their data
    as sent again: they cost volume, spread evenly, and no latency of their own.

    Raises `OperationsError` for edges that do not rise, rates that are negative, shapes that do not fit, values that
    are not finite, and an availability that is not from 0 to 1.
    """

    edges_s: Floats
    rate_bit_s: Floats
    availability: float

    def __post_init__(self) -> None:
        """Refuse what is not a piecewise-constant rate."""
        edges, rates = vector(self.edges_s, "the edges of a service"), vector(self.rate_bit_s, "the rate of a service")
        if edges.size < 2 or rates.size != edges.size - 1:
            raise OperationsError(
                f"{edges.size} edges and {rates.size} rates do not fit; give one more edge than rates"
            )
        if np.any(np.diff(edges) <= 0.0):
            raise OperationsError("the edges of a service do not rise; give its moments in order, each once")
        if np.any(rates < 0.0):
            raise OperationsError(f"a service has the data rate {rates.min():g} bit/s; give at least 0 bit/s")
        if not 0.0 <= self.availability <= 1.0:
            raise OperationsError(f"the availability is {self.availability:g}; give a share of time from 0 to 1")
        object.__setattr__(self, "edges_s", edges)
        object.__setattr__(self, "rate_bit_s", rates)

    @property
    def start_s(self) -> float:
        """Start of the contact."""
        return float(self.edges_s[0])

    @property
    def end_s(self) -> float:
        """End of the contact."""
        return float(self.edges_s[-1])

    @property
    def mean_rate_bit_s(self) -> Floats:
        """Rate of each piece with the outages averaged in, shape (k,)."""
        return self.rate_bit_s * self.availability

    @property
    def capacity_bit(self) -> float:
        """What could be sent in the contact: the integral of the rate, times the availability."""
        return float(np.dot(self.mean_rate_bit_s, np.diff(self.edges_s)))


def service(
    table: RateTable, contact: tuple[float, float], lock_s: float, range_m: Range, availability: float
) -> Service:
    """Data rate over a contact `(start_s, end_s)` that is locked at the time `lock_s`.

    Before lock the rate is 0, after it the table's rate at the range of the moment. The moments where the range crosses
    a step's limit are found to 1 ms: the range is sampled at most 60 s apart and at its turning points, which may
    not lie closer together than two samples. A `lock_s` at or after the end, or inf, is a contact that never locks.

    Raises `OperationsError` for a contact that does not end after it starts, a lock that is nan or before the
    contact, a range that is not finite and above 0 m or of another shape, and an availability that is not from 0 to 1.
    """
    check_span(contact, "the contact")
    start, end = contact
    if not lock_s >= start:
        raise OperationsError(
            f"the moment of lock is {lock_s:.9g} s, before the contact's start at {start:.9g} s; give it on the same "
            "clock as the contact, or inf where lock never comes"
        )
    if lock_s >= end:
        return Service(np.array([start, end]), np.zeros(1), availability)
    edges = np.concatenate(([lock_s], _crossings(table, (lock_s, end), range_m), [end]))
    edges = edges[np.concatenate(([True], np.diff(edges) > 0.0))]
    rates = table.rate_bit_s(_ranges(range_m, 0.5 * (edges[1:] + edges[:-1])))
    if lock_s > start:
        edges, rates = np.concatenate(([start], edges)), np.concatenate(([0.0], rates))
    inner = np.flatnonzero(np.diff(rates)) + 1  # pieces of the same rate are one
    return Service(
        edges[np.concatenate(([0], inner, [edges.size - 1]))], rates[np.concatenate(([0], inner))], availability
    )


def _ranges(range_m: Range, time_s: Floats) -> Floats:
    """The range at each time, checked."""
    found = np.asarray(range_m(time_s), dtype=np.float64)
    if found.shape != time_s.shape:
        raise OperationsError(f"the range at {time_s.size} times has the shape {found.shape}; give one range for each")
    bad = np.flatnonzero(~(np.isfinite(found) & (found > 0.0)))
    if bad.size:
        raise OperationsError(
            f"the range at {time_s[bad[0]]:.9g} s is {found[bad[0]]:g} m; give a finite range above 0 m throughout"
        )
    return found


def _crossings(table: RateTable, locked: tuple[float, float], range_m: Range) -> Floats:
    """Moments, rising, at which the range crosses the limit of a step, by bisection of "closes or not"."""
    limits = np.unique([s.largest_range_m for s in table.steps if 0.0 < s.largest_range_m < math.inf])
    if not limits.size:
        return np.zeros(0)
    time = _samples(locked, range_m, limits)
    closes = _ranges(range_m, time) <= limits[:, None]
    step, place = np.nonzero(closes[:, 1:] != closes[:, :-1])
    low, high, before = time[place], time[place + 1], closes[step, place]
    while low.size and np.any(high - low > _FINE_S):
        middle = 0.5 * (low + high)
        same = (_ranges(range_m, middle) <= limits[step]) == before
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return np.sort(0.5 * (low + high))


def _samples(locked: tuple[float, float], range_m: Range, limits: Floats) -> Floats:
    """Even samples, and the turning points of the range between them: it is monotonic from each to the next.

    Turning points are looked for only where a limit is as near to the samples as they are to one another.
    """
    start, end = locked
    time = np.linspace(start, end, max(math.ceil((end - start) / _SPACING_S), _FEWEST) + 1)
    ranges = _ranges(range_m, time)
    reach = float(np.max(np.abs(np.diff(ranges))))
    if not np.any((np.min(ranges) - reach <= limits) & (limits <= np.max(ranges) + reach)):
        return time
    turns = [
        _turning_points(low, high, range_m, sign)
        for sign in (1.0, -1.0)
        for low, high in [_brackets(time, sign * ranges)]
    ]
    return np.unique(np.concatenate((time, *turns)))


def _brackets(time: Floats, value: Floats) -> tuple[Floats, Floats]:
    """Spans that may hold a minimum: about each sample that is one, and the first and the last interval."""
    lowest = np.flatnonzero((value[1:-1] <= value[:-2]) & (value[1:-1] <= value[2:])) + 1
    low = np.concatenate((time[lowest - 1], time[[0, -2]]))
    high = np.concatenate((time[lowest + 1], time[[1, -1]]))
    return low, high


def _turning_points(low: Floats, high: Floats, range_m: Range, sign: float) -> Floats:
    """Minimum of `sign` times the range in each span, by golden-section search of all at once."""
    while np.any(high - low > _FINE_S):
        width = _GOLDEN * (high - low)
        left, right = high - width, low + width
        values = sign * _ranges(range_m, np.concatenate((left, right)))
        keep_left = values[: low.size] <= values[low.size :]
        low, high = np.where(keep_left, low, left), np.where(keep_left, right, high)
    return 0.5 * (low + high)
