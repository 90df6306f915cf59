"""From a contact and the moment of lock to the data rate over time, by a table of rates and the ranges they reach."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.orbit.base import OperationsError

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

    A largest range of inf never ends; one of 0 m is a rate at which the link never closes. The rates fall and the
    ranges rise from step to step. Raises OperationsError for a range that is negative or nan.
    """

    steps: tuple[Step, ...]

    def __post_init__(self) -> None:
        """Raises OperationsError if a range is negative or nan."""
        for place, step in enumerate(self.steps):
            if not step.largest_range_m >= 0.0:
                raise OperationsError(
                    f"the largest range of step {place} is {step.largest_range_m:g} m; give at least 0 m, inf allowed"
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

    The edges rise. Raises OperationsError for an availability that is not from 0 to 1.
    """

    edges_s: Floats
    rate_bit_s: Floats
    availability: float

    def __post_init__(self) -> None:
        """Raises OperationsError if the availability is not from 0 to 1."""
        if not 0.0 <= self.availability <= 1.0:
            raise OperationsError(f"the availability is {self.availability:g}; give a share of time from 0 to 1")

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

    def locked_at(self, lock_s: float) -> "Service":
        """The same contact without data before `lock_s`, inf where lock never comes."""
        if lock_s <= self.start_s:
            return self
        if lock_s >= self.end_s:
            return Service(np.array([self.start_s, self.end_s]), np.zeros(1), self.availability)
        after = self.edges_s > lock_s
        first = int(np.argmax(after))
        edges = np.concatenate(([self.start_s, lock_s], self.edges_s[after]))
        return Service(edges, np.concatenate(([0.0], self.rate_bit_s[first - 1 :])), self.availability)


def service(table: RateTable, contact: tuple[float, float], range_m: Range, availability: float) -> Service:
    """What a contact carries: the table's rate at the range of each moment.

    The moments where the range crosses a step's limit are found to 1 ms: the range is sampled at most 60 s apart and at
    its turning points, which may not lie closer together than two samples.

    Args:
        table: Data rates and the ranges they reach.
        contact: Start and end of the contact, s.
        range_m: Gives the range in m at times in s, both of shape (n,).
        availability: 1 less the share of time in outage, from 0 to 1.

    Raises:
        OperationsError: For an availability out of range.
    """
    edges = np.concatenate((contact[:1], _crossings(table, contact, range_m), contact[1:]))
    edges = edges[np.concatenate(([True], np.diff(edges) > 0.0))]
    rates = table.rate_bit_s(range_m(0.5 * (edges[1:] + edges[:-1])))
    inner = np.flatnonzero(np.diff(rates)) + 1  # pieces of the same rate are one
    return Service(
        edges[np.concatenate(([0], inner, [edges.size - 1]))], rates[np.concatenate(([0], inner))], availability
    )


def _crossings(table: RateTable, contact: tuple[float, float], range_m: Range) -> Floats:
    """Moments, rising, at which the range crosses the limit of a step, by bisection of "closes or not"."""
    limits = np.unique([s.largest_range_m for s in table.steps if 0.0 < s.largest_range_m < math.inf])
    if not limits.size:
        return np.zeros(0)
    time = _samples(contact, range_m, limits)
    closes = range_m(time) <= limits[:, None]
    step, place = np.nonzero(closes[:, 1:] != closes[:, :-1])
    low, high, before = time[place], time[place + 1], closes[step, place]
    while low.size and np.any(high - low > _FINE_S):
        middle = 0.5 * (low + high)
        same = (range_m(middle) <= limits[step]) == before
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return np.sort(0.5 * (low + high))


def _samples(contact: tuple[float, float], range_m: Range, limits: Floats) -> Floats:
    """Even samples, and the turning points of the range between them: it is monotonic from each to the next.

    Turning points are looked for only where a limit is as near to the samples as they are to one another.
    """
    start, end = contact
    time = np.linspace(start, end, max(math.ceil((end - start) / _SPACING_S), _FEWEST) + 1)
    ranges = range_m(time)
    reach = float(np.max(np.abs(np.diff(ranges))))
    if not np.any((np.min(ranges) - reach <= limits) & (limits <= np.max(ranges) + reach)):
        return time
    turns = [_turning_points(time, sign * ranges, range_m, sign) for sign in (1.0, -1.0)]
    return np.unique(np.concatenate((time, *turns)))


def _turning_points(time: Floats, value: Floats, range_m: Range, sign: float) -> Floats:
    """Minima of `sign` times the range, of which `value` are samples, by golden-section search of all at once.

    A minimum may lie about each sample that is one, and in the first and the last interval.
    """
    lowest = np.flatnonzero((value[1:-1] <= value[:-2]) & (value[1:-1] <= value[2:])) + 1
    low = np.concatenate((time[lowest - 1], time[[0, -2]]))
    high = np.concatenate((time[lowest + 1], time[[1, -1]]))
    while np.any(high - low > _FINE_S):
        width = _GOLDEN * (high - low)
        left, right = high - width, low + width
        values = sign * range_m(np.concatenate((left, right)))
        keep_left = values[: low.size] <= values[low.size :]
        low, high = np.where(keep_left, low, left), np.where(keep_left, right, high)
    return 0.5 * (low + high)
