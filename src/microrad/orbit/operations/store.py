"""On-board store between an instrument and the link: volumes, what is stored when, and the latency of the data."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from microrad.orbit.operations.base import (
    Floats,
    OperationsError,
    check_number,
    check_span,
)
from microrad.orbit.operations.latency import Latency, latency_of
from microrad.orbit.operations.rates import Service


@dataclass(frozen=True, slots=True)
class Production:
    """Data produced at a constant rate over the observed span.

    Raises `OperationsError` for a rate that is negative or not finite, and a span that does not end after it starts.
    """

    rate_bit_s: float
    start_s: float
    end_s: float

    def __post_init__(self) -> None:
        """Refuse a negative rate or a span that ends before it starts."""
        check_number(self.rate_bit_s, "the rate of production", "bit/s")
        check_span((self.start_s, self.end_s), "the observed span")


@dataclass(frozen=True, slots=True, eq=False)
class StoreHistory:
    """The store over the span: cumulative data at the moments where a rate changes, linear in between.

    `time_s`, `generated_bit`, `lost_bit`, `delivered_bit` and `stored_bit` have the shape (n,); at each moment
    generated = delivered + lost + stored. `contact_bit` is what each contact delivered and `contact_capacity_bit` what
    it could have sent, both of shape (contacts,).
    """

    time_s: Floats
    generated_bit: Floats
    lost_bit: Floats
    delivered_bit: Floats
    stored_bit: Floats
    contact_bit: Floats
    contact_capacity_bit: Floats
    latency: Latency

    @property
    def total_generated_bit(self) -> float:
        """Data produced in the observed span."""
        return float(self.generated_bit[-1])

    @property
    def total_delivered_bit(self) -> float:
        """Data sent by the end of the span."""
        return float(self.delivered_bit[-1])

    @property
    def total_lost_bit(self) -> float:
        """Data that found the store full."""
        return float(self.lost_bit[-1])

    @property
    def not_delivered_bit(self) -> float:
        """Data still on board at the end of the span."""
        return float(self.stored_bit[-1])

    @property
    def largest_stored_bit(self) -> float:
        """Most data on board at any moment."""
        return float(np.max(self.stored_bit))

    @property
    def delivered_share(self) -> float:
        """Share of the data produced that was sent by the end of the span; nan where none was produced."""
        total = self.total_generated_bit
        return self.total_delivered_bit / total if total > 0.0 else math.nan


def deliver(
    production: Production,
    capacity_bit: float,
    services: Sequence[Service],
    span: tuple[float, float],
    delay_s: float,
) -> StoreHistory:
    """Run a store that is empty at the start of `span` (start_s, end_s) through its contacts.

    The store is a fluid queue, first in, first out, of `capacity_bit` (inf allowed). What does not fit is lost, the
    newest: a full store still takes in what the link takes out. Between two changes of rate the stored data is linear
    in time until it meets 0 or the capacity, so the result is exact and there is no time step. The span may begin
    before and end after the observed one; what is on board at its end counts as not delivered. `delay_s` is added to
    every latency: from the satellite to where the data is wanted. Mean rates count, outages spread evenly.

    Raises `OperationsError` for a capacity that is not above 0, contacts that overlap, are unsorted or leave the span,
    an observed span that leaves the span, a negative delay, and nan anywhere.
    """
    if not capacity_bit > 0.0:
        raise OperationsError(f"the capacity of the store is {capacity_bit:g} bit; give more than 0 bit, inf allowed")
    check_span(span, "the span")
    check_number(delay_s, "the delay", "s")
    _check_inside(production, services, span)
    grid = np.unique(np.concatenate([span, (production.start_s, production.end_s), *(s.edges_s for s in services)]))
    middle = 0.5 * (grid[1:] + grid[:-1])
    made = np.where((production.start_s < middle) & (middle < production.end_s), production.rate_bit_s, 0.0)
    time, stored, kept, lost = _march(grid, made, _sent_bit_s(services, middle), capacity_bit)
    # kept less stored, not a sum of its own: an empty store has then delivered all, to the last bit
    delivered = np.maximum.accumulate(np.minimum(kept - stored, kept))
    at_edges = [np.interp((s.start_s, s.end_s), time, delivered) for s in services]
    return StoreHistory(
        time_s=time,
        generated_bit=kept + lost,
        lost_bit=lost,
        delivered_bit=delivered,
        stored_bit=stored,
        contact_bit=np.array([after - before for before, after in at_edges], dtype=np.float64),
        contact_capacity_bit=np.array([s.capacity_bit for s in services], dtype=np.float64),
        latency=latency_of(time, kept, delivered, delay_s),
    )


def _check_inside(production: Production, services: Sequence[Service], span: tuple[float, float]) -> None:
    start, end = span
    if not (start <= production.start_s and production.end_s <= end):
        raise OperationsError(
            f"data is produced from {production.start_s:.9g} s to {production.end_s:.9g} s, outside the span from "
            f"{start:.9g} s to {end:.9g} s; lengthen the span"
        )
    for number, one in enumerate(services):
        if one.start_s < start or one.end_s > end:
            raise OperationsError(
                f"contact {number} runs from {one.start_s:.9g} s to {one.end_s:.9g} s, outside the span from "
                f"{start:.9g} s to {end:.9g} s; cut it at the span or lengthen the span"
            )
    for number, (first, second) in enumerate(pairwise(services)):
        if second.start_s < first.end_s:
            raise OperationsError(
                f"contact {number + 1} starts at {second.start_s:.9g} s, before contact {number} ends at "
                f"{first.end_s:.9g} s; give contacts in order that do not overlap"
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
