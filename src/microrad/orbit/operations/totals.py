"""What a schedule gives each satellite and each relay: time, volume and the longest gap."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from microrad.orbit.operations.base import Floats, Integers, OperationsError, check_span, vector
from microrad.orbit.operations.schedule import Sessions


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


def totals_by_satellite(
    sessions: Sessions, satellites: int, volume_bit: ArrayLike, span: tuple[float, float]
) -> Totals:
    """What each satellite got over the span (start_s, end_s); `volume_bit` (n,) is the data of each session.

    Raises `OperationsError` for a volume that is negative, not finite or not one for each session, a span that does
    not end after it starts or leaves out part of a session, and an index beyond the count.
    """
    return _totals(sessions, sessions.satellite, satellites, volume_bit, span)


def totals_by_relay(sessions: Sessions, relays: int, volume_bit: ArrayLike, span: tuple[float, float]) -> Totals:
    """What each relay carried over all its terminals; arguments and errors as `totals_by_satellite`."""
    return _totals(sessions, sessions.relay, relays, volume_bit, span)


def _totals(
    sessions: Sessions, index: Integers, count: int, volume_bit: ArrayLike, span: tuple[float, float]
) -> Totals:
    volume = vector(volume_bit, "the volumes of the sessions")
    if volume.shape != index.shape or np.any(volume < 0.0):
        raise OperationsError(
            f"{volume.size} volumes for {index.size} sessions, the least {np.min(volume, initial=0.0):g} bit; give one "
            "of at least 0 bit for each"
        )
    check_span(span, "the span of the totals")
    if index.size and index.max() >= count:
        raise OperationsError(f"a session names index {index.max()}, but there are {count}; give their number")
    if index.size and not (span[0] <= sessions.start_s.min() and sessions.end_s.max() <= span[1]):
        raise OperationsError(
            f"sessions run from {sessions.start_s.min():.9g} s to {sessions.end_s.max():.9g} s, outside the span from "
            f"{span[0]:.9g} s to {span[1]:.9g} s; lengthen the span"
        )

    def add(each: Floats) -> Floats:
        return np.bincount(index, each, minlength=count).astype(np.float64)

    return Totals(
        sessions=np.bincount(index, minlength=count).astype(np.int64),
        busy_s=add(sessions.end_s - sessions.start_s),
        served_s=add(sessions.end_s - sessions.locked_s),
        volume_bit=add(volume),
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
