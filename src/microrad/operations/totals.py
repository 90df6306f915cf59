"""What a schedule gives each satellite and each relay: time, volume and the longest gap."""

from dataclasses import dataclass

import numpy as np

from microrad.operations.base import Floats, Integers, OperationsError, check_number, check_span
from microrad.operations.schedule import Sessions


@dataclass(frozen=True, slots=True, eq=False)
class Totals:
    """Per satellite or per relay, all of shape (count,): sessions, busy time with overhead, time with data, its volume.

    `longest_gap_s` is the longest time within the span without data, its start and end counted as data: the whole span
    where there was none. A relay has data while one of its terminals has.
    """

    sessions: Integers
    busy_s: Floats
    served_s: Floats
    volume_bit: Floats
    longest_gap_s: Floats


def totals_by_satellite(sessions: Sessions, satellites: int, rate_bit_s: float, span: tuple[float, float]) -> Totals:
    """What each satellite got at the data rate `rate_bit_s` over the span (start_s, end_s).

    Raises `OperationsError` for a rate that is negative or not finite, a span that does not end after it starts or
    leaves out part of a session, and an index beyond the count.
    """
    return _totals(sessions, sessions.satellite, satellites, rate_bit_s, span)


def totals_by_relay(sessions: Sessions, relays: int, rate_bit_s: float, span: tuple[float, float]) -> Totals:
    """What each relay carried over all its terminals; arguments and errors as `totals_by_satellite`."""
    return _totals(sessions, sessions.relay, relays, rate_bit_s, span)


def _totals(sessions: Sessions, index: Integers, count: int, rate_bit_s: float, span: tuple[float, float]) -> Totals:
    check_number(rate_bit_s, "the data rate", "bit/s")
    check_span(span, "the span of the totals")
    if index.size and index.max() >= count:
        raise OperationsError(f"a session names index {index.max()}, but there are {count}; give their number")
    if index.size and not (span[0] <= sessions.start_s.min() and sessions.end_s.max() <= span[1]):
        raise OperationsError(
            f"sessions run from {sessions.start_s.min():.9g} s to {sessions.end_s.max():.9g} s, outside the span from "
            f"{span[0]:.9g} s to {span[1]:.9g} s; lengthen the span"
        )

    def add(duration_s: Floats) -> Floats:
        return np.bincount(index, duration_s, minlength=count).astype(np.float64)

    served = add(sessions.end_s - sessions.locked_s)
    return Totals(
        sessions=np.bincount(index, minlength=count).astype(np.int64),
        busy_s=add(sessions.end_s - sessions.start_s),
        served_s=served,
        volume_bit=served * rate_bit_s,
        longest_gap_s=_longest_gaps(sessions, index, count, span),
    )


def _longest_gaps(sessions: Sessions, index: Integers, count: int, span: tuple[float, float]) -> Floats:
    order = np.lexsort((sessions.locked_s, index))
    edges = np.searchsorted(index[order], np.arange(count + 1))
    gaps = np.empty(count)
    for one in range(count):
        mine = order[edges[one] : edges[one + 1]]
        data_until = np.maximum.accumulate(np.concatenate(([span[0]], sessions.end_s[mine])))
        gaps[one] = np.max(np.concatenate((sessions.locked_s[mine], [span[1]])) - data_until)
    return gaps
