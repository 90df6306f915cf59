"""When smooth functions of time are positive: the intervals, to a microsecond, and the algebra of sets of intervals.

A set of intervals is an array of shape (k, 2), start and end of each, sorted and disjoint; (0, 2) is the empty set.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.orbit.base import OrbitError

Rows = NDArray[np.intp]
Intervals = NDArray[np.float64]
Function = Callable[[Floats], Floats]
"""Values (n,) at the times (n,), in any order of the times."""
RowFunction = Callable[[Floats, Rows], Floats]
"""Values (n,) at the times (n,), each of the row (the partner, say) with that index; several are solved for at once."""

TOLERANCE_S = 1e-6
"""Width of the bracket in which a change of sign is left."""
SHORTEST_S = 1e-3
"""An event at least this long between two samples is found."""

_CUT = 16  # points within a bracket at a time, in the search for an extremum
_MOST_STEPS = 200  # bisection alone takes 50; a guard against a function that is not one


# ----------------------------------------------------------------------------------------------------------- intervals
def positive(function: Function, time_s: Floats) -> Intervals:
    """The intervals in which a function of time is above 0, between the first and the last of its samples.

    Their ends are within `TOLERANCE_S`. A boundary at the first or last sample is that sample exactly.

    Args:
        function: The function.
        time_s: Times of the samples, s, rising, shape (n,), so dense that the function has at most one extremum between
            two; see `positive_rows`.

    Raises:
        OrbitError: For fewer than three samples, samples that do not rise and values that are not finite.
    """
    time_s = np.asarray(time_s, dtype=np.float64)
    return positive_rows(lambda time, _: function(time), time_s, np.asarray(function(time_s))[None, :])[0]


def positive_rows(function: RowFunction, time_s: Floats, values: Floats) -> tuple[Intervals, ...]:
    """As `positive`, for several functions at once: a set of intervals for each.

    A local extremum of the samples on the same side of 0 as its neighbours may hide an event shorter than the step:
    where a parabola through the three comes close to 0 (eight times its own height above the samples), the extremum is
    searched for and, on the other side of 0, split at. Events of `SHORTEST_S` and longer are found so.

    Args:
        function: The functions, told apart by their row.
        time_s: Times of the samples, s, rising, shape (n,), the same for all.
        values: The samples, shape (rows, n).

    Raises:
        OrbitError: As `positive`.
    """
    if time_s.size < 3 or values.shape[1:] != time_s.shape:
        raise OrbitError(f"{values.shape} values at {time_s.size} times; give as many values as times, at least 3")
    if not np.all(np.diff(time_s) > 0.0):
        raise OrbitError("the times of the samples do not rise; sort them, each once")
    if np.any(wrong := np.any(~np.isfinite(values), axis=0)):
        first_s = time_s[np.argmax(wrong)]
        raise OrbitError(f"a function whose sign is asked for is not finite at {first_s:g} s; check the orbits there")
    points = _hidden(function, time_s, values)
    rows, times, levels = _merged(time_s, values, points)
    change = np.flatnonzero((rows[1:] == rows[:-1]) & ((levels[1:] > 0.0) != (levels[:-1] > 0.0)))
    low, high = change, change + 1
    edges = crossings(function, _Brackets(rows[low], times[low], times[high], levels[low], levels[high]))
    found = []
    for index, row in enumerate(values):
        first, last = time_s[:1][: int(row[0] > 0.0)], time_s[-1:][: int(row[-1] > 0.0)]
        found.append(union(np.concatenate((first, edges[rows[change] == index], last)).reshape(-1, 2)))
    return tuple(found)


# ------------------------------------------------------------------------------------------ extrema between the samples
class _Points(NamedTuple):
    rows: Rows
    times: Floats
    levels: Floats


class _Triples(NamedTuple):
    """Brackets of extrema: three times and levels each, (3, k); the levels times their `side` of 0 are >= 0."""

    rows: Rows
    times: Floats
    heights: Floats
    side: Floats
    near: NDArray[np.bool_]

    def chosen(self, which: NDArray[np.bool_]) -> "_Triples":
        return _Triples._make(part[..., which] for part in self)


def _drop(times: Sequence[Floats], heights: Sequence[Floats]) -> Floats:
    """Eight times what the parabola through three points can dip below the lowest of them when that is the middle one.

    Its second divided difference c, on steps h, lets it dip by c h^2 / 4.
    """
    first, second = times[1] - times[0], times[2] - times[1]
    slopes = (heights[1] - heights[0]) / first, (heights[2] - heights[1]) / second
    return np.asarray(0.5 * np.abs(slopes[1] - slopes[0]) * (first + second))


def _hidden(function: RowFunction, time_s: Floats, values: Floats) -> _Points:
    """Times between the samples at which the function is on the other side of 0 than at the samples about them."""
    triples = _suspects(time_s, values)
    found = [_Points(np.empty(0, np.intp), np.empty(0), np.empty(0))]
    while triples.rows.size:
        triples = _narrowed(function, triples)
        crossed = triples.heights[1] < 0.0
        if np.any(crossed):
            hit = triples.chosen(crossed)
            found.append(_Points(hit.rows, hit.times[1], hit.side * hit.heights[1]))
        wide = triples.times[2] - triples.times[0] > 0.5 * SHORTEST_S
        triples = triples.chosen(~crossed & wide & triples.near)
    return _Points._make(np.concatenate(parts) for parts in zip(*found, strict=True))


def _suspects(time_s: Floats, values: Floats) -> _Triples:
    """The extrema of the samples that come close to 0; at the first and last sample, half a bracket."""
    side = np.where(values > 0.0, 1.0, -1.0)
    left, middle, right = values[:, :-2], values[:, 1:-1], values[:, 2:]
    sign = side[:, 1:-1]
    height = sign * middle
    bound = _drop((time_s[:-2], time_s[1:-1], time_s[2:]), (left, middle, right))
    inner = (height <= sign * left) & (height <= sign * right) & (height <= bound)
    rows, at = np.nonzero(inner)
    at += 1
    starts = (side[:, 0] * (values[:, 1] - values[:, 0]) >= 0.0) & (side[:, 0] * values[:, 0] <= bound[:, 0])
    ends = (side[:, -1] * (values[:, -2] - values[:, -1]) >= 0.0) & (side[:, -1] * values[:, -1] <= bound[:, -1])
    first, last = np.flatnonzero(starts), np.flatnonzero(ends)
    rows = np.concatenate((rows, first, last))
    low = np.concatenate((at - 1, np.zeros_like(first), np.full_like(last, time_s.size - 2)))
    high = np.concatenate((at + 1, np.ones_like(first), np.full_like(last, time_s.size - 1)))
    centre = np.concatenate((at, np.zeros_like(first), np.full_like(last, time_s.size - 1)))
    index = np.stack((low, centre, high))
    one = side[rows, centre]
    return _Triples(rows, time_s[index], one * values[rows, index], one, np.ones(rows.size, np.bool_))


def _narrowed(function: RowFunction, triples: _Triples) -> _Triples:
    """Every bracket cut at `_CUT` points and narrowed to the two cuts about the lowest."""
    rows, low, high = triples.rows, triples.times[0], triples.times[2]
    times = low + (high - low) * (np.arange(1, _CUT + 1) / (_CUT + 1.0))[:, None]
    levels = function(times.ravel(), np.tile(rows, _CUT)).reshape(_CUT, -1)
    times = np.concatenate((low[None, :], times, high[None, :]))
    heights = np.concatenate((triples.heights[:1], triples.side * levels, triples.heights[2:]))
    each = np.arange(rows.size)
    lowest = np.argmin(heights, axis=0)
    about = np.clip(lowest, 1, _CUT) + np.array([-1, 0, 1])[:, None]
    near = heights[lowest, each] <= _drop(tuple(times[about, each]), tuple(heights[about, each]))
    index = np.stack((np.maximum(lowest - 1, 0), lowest, np.minimum(lowest + 1, _CUT + 1)))
    return _Triples(rows, times[index, each], heights[index, each], triples.side, near)


def _merged(time_s: Floats, values: Floats, points: _Points) -> _Points:
    """Samples and points of all rows, by row and time."""
    count = values.shape[0]
    all_of = _Points(np.repeat(np.arange(count), time_s.size), np.tile(time_s, count), values.ravel())
    if not points.rows.size:
        return all_of
    joined = _Points._make(np.concatenate(parts) for parts in zip(all_of, points, strict=True))
    order = np.lexsort((joined.times, joined.rows))
    return _Points._make(part[order] for part in joined)


# ------------------------------------------------------------------------------------------------------ changes of sign
class _Brackets(NamedTuple):
    rows: Rows
    low: Floats
    high: Floats
    at_low: Floats
    at_high: Floats


def crossings(function: RowFunction, brackets: _Brackets) -> Floats:
    """The time in each bracket at which the function changes its sign, s, shape (brackets,); all are found at once.

    T. R. Chandrupatla, "A new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear function without
    using derivatives", Adv. Eng. Softw. 28 (1997) 145-149; the first step is a secant.

    Args:
        function: The functions, told apart by their row.
        brackets: Row, both times in s, and both values, on different sides of 0.

    Raises:
        OrbitError: Where the change of sign is not found within `TOLERANCE_S`.
    """
    rows, b, a, fb, fa = brackets
    c, fc = b, fb
    best, todo = np.where(np.abs(fa) < np.abs(fb), a, b), np.arange(rows.size)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip(fa / (fa - fb), 0.02, 0.98)
    for _ in range(_MOST_STEPS):
        if not todo.size:
            return best
        new = a + share * (b - a)
        f_new = function(new, rows)
        same = (f_new > 0.0) == (fa > 0.0)
        c, fc, b, fb = (
            np.where(same, a, b),
            np.where(same, fa, fb),
            np.where(same, b, a),
            np.where(same, fb, fa),
        )
        a, fa = new, f_new
        nearer = np.abs(fa) < np.abs(fb)
        best[todo] = np.where(nearer, a, b)
        # a bracket cannot be narrower than a few steps of the clock
        least = np.maximum(TOLERANCE_S, 4.0 * np.spacing(np.abs(a))) / np.abs(b - a)
        left = (least <= 0.5) & (np.where(nearer, fa, fb) != 0.0)
        share = _next_share(a, b, c, fa, fb, fc, least)[left]
        todo, rows, a, b, c, fa, fb, fc = (part[left] for part in (todo, rows, a, b, c, fa, fb, fc))
    raise OrbitError(
        f"no change of sign was found to {TOLERANCE_S:g} s near {best[todo][0]:g} s; check the orbits there"
    )


def _next_share(a: Floats, b: Floats, c: Floats, fa: Floats, fb: Floats, fc: Floats, least: Floats) -> Floats:
    """Where to cut from a to b: inverse quadratic interpolation where it is safe, else half."""
    with np.errstate(divide="ignore", invalid="ignore"):
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        safe = (phi**2 < xi) & ((1.0 - phi) ** 2 < 1.0 - xi)
        cut = fa / (fb - fa) * (fc / (fb - fc)) + (c - a) / (b - a) * (fa / (fc - fa)) * (fb / (fc - fb))
    least = np.minimum(least, 0.5)
    return np.asarray(np.clip(np.where(safe, cut, 0.5), least, 1.0 - least))


# -------------------------------------------------------------------------------------------------- largest in a window
def largest(function: Function, windows: Intervals, step_s: float) -> tuple[Floats, Floats]:
    """Time in s and value of the largest value in each of the windows, ends included; shape (k,) each.

    The time is within `SHORTEST_S`. All windows are searched at once: in the given step or finer first, then in `_CUT`
    pieces of the two steps about the largest value.

    Args:
        function: The function, which must have at most one maximum in twice the step.
        windows: Start and end of each window, s, shape (k, 2).
        step_s: The step of the first search, s.
    """
    if not windows.size:
        return np.empty(0), np.empty(0)
    cuts = [max(int(np.ceil((end - start) / step_s)) + 1, _CUT) for start, end in windows]
    samples = [np.linspace(start, end, cut) for (start, end), cut in zip(windows, cuts, strict=True)]
    levels = np.split(function(np.concatenate(samples)), np.cumsum(cuts)[:-1])
    about = [time[_neighbours(int(np.argmax(level)), time.size)] for time, level in zip(samples, levels, strict=True)]
    low, when, high = np.array(about).T
    value = np.array([np.max(level) for level in levels])
    each = np.arange(when.size)
    while np.any(high - low > SHORTEST_S):
        times = np.linspace(low, high, _CUT + 1)
        values = function(times.ravel()).reshape(times.shape)
        at = np.argmax(values, axis=0)
        value = values[at, each]
        low, when, high = times[_neighbours(at, _CUT + 1), each]
    return when, value


def _neighbours(at: int | Rows, count: int) -> Rows:
    """The places before, at and after `at` among `count`, the ends their own neighbours."""
    return np.stack((np.maximum(at - 1, 0), np.asarray(at), np.minimum(at + 1, count - 1)))


# ------------------------------------------------------------------------------------------------------ finer sampling
def refined(directions: Callable[[Floats], Floats], time_s: Floats, most_rad: float) -> Floats:
    """Times with more of them put between, until no direction turns too far from one to the next.

    Steps of `SHORTEST_S` are not cut further.

    Args:
        directions: Gives unit vectors at times (n,), shape (k, 3, n).
        time_s: The times, s, rising, shape (n,).
        most_rad: The largest turn of a direction between two times, rad.
    """
    least_chord = 2.0 * np.sin(0.5 * most_rad)
    while True:
        chord = np.max(np.linalg.norm(np.diff(directions(time_s), axis=-1), axis=1), axis=0)
        cut = np.flatnonzero((chord > least_chord) & (np.diff(time_s) > SHORTEST_S))
        if not cut.size:
            return time_s
        time_s = np.insert(time_s, cut + 1, 0.5 * (time_s[cut] + time_s[cut + 1]))


# ------------------------------------------------------------------------------------------------------------- algebra
def intersection(*sets: Intervals) -> Intervals:
    """What lies in all of the sets; a single instant does not count. At least one set."""
    return _covered(sets, len(sets))


def union(*sets: Intervals) -> Intervals:
    """What lies in any of the sets; intervals that touch become one. At least one set."""
    return _covered(sets, 1)


def complement(intervals: Intervals, span_s: tuple[float, float]) -> Intervals:
    """What of a span is not in the set.

    Args:
        intervals: The set, s, shape (k, 2).
        span_s: Start and end of the span, s.
    """
    edges = np.concatenate(([span_s[0]], np.clip(intervals, *span_s).ravel(), [span_s[1]])).reshape(-1, 2)
    return np.asarray(edges[edges[:, 0] < edges[:, 1]])


def _covered(sets: tuple[Intervals, ...], needed: int) -> Intervals:
    """Where at least `needed` intervals overlap. The ends are those of the sets, to the last bit."""
    together = np.concatenate(sets)
    times = together.T.ravel()  # all starts, then all ends
    step = np.repeat([1, -1], together.shape[0])
    order = np.lexsort((-step, times))  # a start before an end at the same time, so that touching intervals join
    inside = np.cumsum(step[order]) >= needed
    change = np.flatnonzero(inside != np.concatenate(([False], inside[:-1])))
    edges = times[order][change].reshape(-1, 2)
    return np.asarray(edges[edges[:, 0] < edges[:, 1]])
