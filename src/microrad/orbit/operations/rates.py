"""From a contact and the moment of lock to the data rate over time, by a table of rates and the ranges they reach."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.mission.fields import Bounded, Quantity
from microrad.orbit.base import OperationsError
from microrad.orbit.visibility.events import TOLERANCE_S, positive_rows

Range = Callable[[Floats], Floats]
"""Range in m over time in s, both of shape (n,); smooth."""

_SPACING_S = 60.0  # of the samples of the range, at most
_FEWEST = 16  # intervals of a contact, however short


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
class Service(Bounded):
    """What a contact carries: piecewise-constant data rate, `edges_s` of shape (k + 1,) and `rate_bit_s` (k,).

    `availability` is 1 less the share of time in outage. Outages are taken as short against the pieces and their data
    as sent again: they cost volume, spread evenly, and no latency of their own.

    The edges rise. Raises OperationsError for an availability that is not from 0 to 1.
    """

    REFUSAL = OperationsError

    edges_s: Floats
    rate_bit_s: Floats
    availability: Annotated[float, Quantity("", least=0.0, most=1.0), "it is a share of time"]

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

    def within(self, start_s: float, end_s: float) -> "Service":
        """The part of the contact in a span that it overlaps; the contact itself where the span holds all of it."""
        if start_s <= self.start_s and end_s >= self.end_s:
            return self
        inside = (start_s < self.edges_s) & (self.edges_s < end_s)
        edges = np.concatenate(([max(start_s, self.start_s)], self.edges_s[inside], [min(end_s, self.end_s)]))
        piece = np.searchsorted(self.edges_s, edges[:-1], side="right") - 1
        return Service(edges, self.rate_bit_s[piece], self.availability)


def service(table: RateTable, contact: tuple[float, float], range_m: Range, availability: float) -> Service:
    """What a contact carries: the table's rate at the range of each moment.

    The moments where the range crosses a step's limit are found as those of contacts are (`events.positive_rows`); the
    range is sampled at most 60 s apart, and its turning points may not lie closer together than two samples.

    Args:
        table: Data rates and the ranges they reach.
        contact: Start and end of the contact, s.
        range_m: Gives the range in m at times in s, both of shape (n,).
        availability: 1 less the share of time in outage, from 0 to 1.

    Raises:
        OperationsError: For an availability out of range.
    """
    edges = np.unique(np.concatenate((contact, _crossings(table, contact, range_m))))
    rates = table.rate_bit_s(range_m(0.5 * (edges[1:] + edges[:-1])))
    inner = np.flatnonzero(np.diff(rates)) + 1  # pieces of the same rate are one
    return Service(
        edges[np.concatenate(([0], inner, [edges.size - 1]))], rates[np.concatenate(([0], inner))], availability
    )


def _crossings(table: RateTable, contact: tuple[float, float], range_m: Range) -> Floats:
    """Moments at which the range crosses the limit of a step, in any order and with ends of the contact among them."""
    limits = np.array([s.largest_range_m for s in table.steps if 0.0 < s.largest_range_m < math.inf])
    start, end = contact
    if not limits.size or end - start <= TOLERANCE_S:
        return np.zeros(0)
    time = np.linspace(start, end, max(math.ceil((end - start) / _SPACING_S), _FEWEST) + 1)
    closes = positive_rows(lambda time, row: limits[row] - range_m(time), time, limits[:, None] - range_m(time))
    return np.concatenate(closes).ravel()
