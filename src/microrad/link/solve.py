"""Which values of one input leave a margin: as intervals, since a larger aperture gains light and narrows its beam."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from microrad.link.inputs import Input, Varied, margin_or_none, moved

DECADES = 6
"""How far from its own value an input is looked for, up and down."""
STEPS = 16
"""Of a decade, or of ten decibels: an interval that is narrower than one step may be missed."""

_BISECTIONS = 60
_MOVES_DB = 1e-9
_BESIDE = 1e-6  # of a step: just outside of an interval


@dataclass(frozen=True, slots=True)
class Interval:
    """Values from ``low`` to ``high`` that leave the margin.

    An end is open where they go on as far as was looked, or as the rule of the input allows.
    """

    low: float
    high: float
    low_open: bool
    high_open: bool


@dataclass(frozen=True, slots=True)
class Solved:
    """The intervals of an input that leave a margin, and the value with the largest one, with that margin.

    ``searched`` are the least and the most value that was looked at: `DECADES` from its own, or as far as its rule
    allows. Values of an input of two axes are those of the larger one.
    """

    intervals: tuple[Interval, ...]
    searched: tuple[float, float]
    best: float
    best_db: float


def solve(
    mission: Varied,
    found: tuple[Input, ...],
    unit: str,
    margin_db: Callable[[Varied], float],
    required_db: float,
    possible: Callable[[Varied], bool],
) -> Solved:
    """Where an input leaves a margin, looked for in steps and then found to the last digits.

    ``found`` is the input in its ``unit``, or its axes, which keep their proportion. A value that its rule or
    ``possible`` does not allow leaves none. Raises ValueError for an input that is 0 and no decibels, which no factor
    moves.
    """
    value, count = max(each.value for each in found), DECADES * STEPS
    linear = unit.startswith("dB")
    if not linear and value == 0.0:
        raise ValueError(f"{found[0].key} is 0, which no factor moves: give it a value to begin with")

    def at(step: float) -> float:
        return value + 10.0 * step / STEPS if linear else value * 10.0 ** (step / STEPS)

    def margin(step: float) -> float:
        m = moved(mission, found, at(step))
        return -math.inf if m is None or not possible(m) else margin_or_none(m, margin_db)

    def enough(step: float) -> bool:
        return margin(step) >= required_db

    def allowed(step: float) -> bool:
        return moved(mission, found, at(step)) is not None

    margins = [margin(float(step)) for step in range(-count, count + 1)]
    known = [each for each in margins if each > -math.inf]
    if known and max(known) - min(known) < _MOVES_DB:
        raise ValueError(f"{found[0].key} moves this margin by nothing")
    intervals, begin = [], None
    for place, here in enumerate(margins):
        step = float(place - count)
        if here >= required_db and begin is None:
            begin = step if place == 0 else _edge(step, step - 1.0, enough)
        last = place == len(margins) - 1
        if begin is not None and (here < required_db or last):
            end = step if here >= required_db else _edge(step - 1.0, step, enough)
            beyond = begin - _BESIDE, end + _BESIDE
            low_open, high_open = (not allowed(each) or abs(each) >= count for each in beyond)
            intervals.append(Interval(at(begin), at(end), low_open, high_open))
            begin = None
    best = max(range(len(margins)), key=margins.__getitem__)
    searched = at(_farthest(-count, allowed)), at(_farthest(count, allowed))
    return Solved(tuple(intervals), searched, at(float(best - count)), margins[best])


def _farthest(last: int, allowed: Callable[[float], bool]) -> float:
    """The step farthest from 0 that is allowed, between 0 and the last one."""
    outward = 1 if last > 0 else -1
    step = next((each for each in range(0, last, outward) if not allowed(float(each + outward))), last)
    return float(step) if step == last else _edge(float(step), float(step + outward), allowed)


def _edge(inside: float, outside: float, enough: Callable[[float], bool]) -> float:
    for _ in range(_BISECTIONS):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if enough(middle) else (inside, middle)
    return inside
