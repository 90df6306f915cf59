"""Which input moves a margin most: each one alone, a little down and up."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from microrad.link.budget.assembly import Shared, communication_beam, receiving_end
from microrad.link.budget.lines import beam_budget
from microrad.link.receivers import RateError
from microrad.mission.fields import Quantity, Several, Share, Table, rule_of_field
from microrad.mission.model import LinkMission, Source, source_text
from microrad.mission.tables.link import divergence_fits, half_angle_rad

AIR_TABLES = ("channel", "channel.turbulence", "channel.turbulence.wind")
"""The tables with the inputs of the air."""

LINK_TABLES = (
    "terminals",
    "communication",
    "communication.receiver",
    "communication.receiver.background",
    "communication.beam",
    "communication.coupling",
    "communication.coupling.jitter",
    *AIR_TABLES,
    "point_ahead",
)
"""The tables with the inputs of the communication link."""

_Link = TypeVar("_Link")
Varied = TypeVar("Varied", bound=Table)
"""A table of tables, such as a mission, of which one number after the other is moved."""


@dataclass(frozen=True, slots=True)
class Input:
    """One number of a mission: a field of a table, or an item of one that holds a list."""

    key: str
    table: str
    field: str
    item: int | None
    value: float
    rule: Quantity

    @property
    def shown(self) -> str:
        """The key, of an item with its place from 1 behind it, as campaigns name it."""
        return self.key if self.item is None else f"{self.key}.{self.item + 1}"

    def moved(self, tables: Varied, value: float) -> Varied:
        """The tables with this number replaced.

        Args:
            tables: The tables that hold the number.
            value: The new number, in the SI unit of the field.
        """
        if self.item is None:
            return tables.with_value(f"{self.table}.{self.field}", value)
        items = list(getattr(_table(tables, self.table), self.field))
        items[self.item] = value
        return tables.with_value(f"{self.table}.{self.field}", tuple(items))


def inputs(tables: Table, name: str) -> Iterator[Input]:
    """Every quantity of one of the tables that has a value, each item of a list by itself.

    Args:
        tables: The tables of the mission.
        name: Dotted name of the table meant; one that the mission does not have gives nothing.
    """
    table = _table(tables, name)
    if table is None:
        return
    for field, info in type(table).model_fields.items():
        value, key = getattr(table, field), f"{name}.{info.alias or field}"
        rule = rule_of_field(info)
        if isinstance(rule, Quantity) and isinstance(value, float) and not math.isnan(value):  # no word in its place
            yield Input(key, name, field, None, value, rule)
        if isinstance(rule, Several):
            for item, number in enumerate(value or ()):
                yield Input(key, name, field, item, number, rule.each)


def moved(tables: Varied, found: tuple[Input, ...], value: float) -> Varied | None:
    """The tables with an input at another value, or None where its rule does not allow it.

    Where the input has several items, the largest in size takes the value, the others stay in proportion to it.

    Args:
        tables: The tables that hold the input.
        found: The input, or its items.
        value: The new value, in the SI unit of the input.
    """
    largest = max((each.value for each in found), key=abs)
    for each in found:
        own = value if each.value == largest else value * each.value / largest
        if each.rule.out_of_bounds(own):
            return None
        tables = each.moved(tables, own)
    return tables


def unit_of(each: Input, strehl: str) -> str:
    """Unit of an input; a Strehl has one of its own where the convention reads it as a loss.

    Args:
        each: The input.
        strehl: The mission's convention for a Strehl, "decibel" or "ratio".
    """
    return "dB" if (each.field, strehl) == ("strehl", "decibel") else each.rule.unit


def _table(tables: Table, name: str) -> Table | None:
    table: Table | None = tables
    for part in name.split("."):
        table = None if table is None else getattr(table, part)
    return table


def beam_passes(m: LinkMission) -> bool:
    """Whether obscuration and air let the data's beam pass, and the receiver can take and do with some light."""
    beam, receiver = m.communication, m.communication.receiver
    if receiver is not None and not receiver.reaches_ratio:
        return False
    try:
        sent, end = communication_beam(m.terminals, beam, m.conventions.pointing_loss), None
        if beam.coupling is not None:
            end = receiving_end(m.terminals, beam.coupling, beam.wavelength_m)
        Shared.of(m).turbulent(beam, "leo", sent.fall.half_angle_rad, end)
    except ValueError:  # turbulence beyond a closed form is one
        return False
    return True


def margin_or_none(of: _Link, margin_db: Callable[[_Link], float]) -> float:
    """The margin of a link in dB; minus infinity where the receiver is too slow for the rate.

    Args:
        of: The link, or the mission that it is part of.
        margin_db: The margin in dB of such a link.
    """
    try:
        return margin_db(of)
    except RateError:
        return -math.inf


def divergence_possible(name: str) -> Callable[[Any], bool]:
    """A check of a mission: whether its beacon, or its answer, has an aperture wide enough, and air that it passes."""
    sender = "geo" if name == "answer" else "leo"
    too_narrow = divergence_fits(name, sender)

    def possible(m: LinkMission) -> bool:
        beam = getattr(m, name)
        if any(too_narrow(m.conventions, m.terminals, beam)):
            return False
        try:
            half = half_angle_rad(beam.divergence_rad, m.conventions.divergence)
            Shared.of(m).turbulent(beam, sender, half, None)
        except ValueError:  # turbulence beyond a closed form
            return False
        return True

    return possible


RELATIVE = 0.1
"""How far a quantity is moved, as a share of itself."""
STEP_DB = 0.5
"""How far a quantity in decibels is moved."""
_BY_TEN = ("bit_error_ratio", "outage")  # shares that are judged by their order of magnitude
_TIE_DIGITS = 6  # of decibels: equal swings stand as the mission has their keys, not as a processor rounds them


@dataclass(frozen=True, slots=True)
class Swing:
    """The margin with one input moved down to ``low`` and up to ``high``, both in ``unit``, all others as they are.

    ``kind`` is the kind of source that the input has, "assumption" for one. An item of a list has its place
    from 1 behind the key.
    """

    key: str
    unit: str
    value: float
    low: float
    high: float
    margin_low_db: float
    margin_high_db: float
    kind: str
    source: str

    @property
    def swing_db(self) -> float:
        """Distance between the two margins."""
        return abs(self.margin_high_db - self.margin_low_db)


@dataclass(frozen=True, slots=True)
class Tornado:
    """One margin, ``of`` what it is, and its swings over each of its inputs, the largest first."""

    of: str
    margin_db: float
    swings: tuple[Swing, ...]


def beam_margin(name: str, sources: Mapping[str, Source]) -> Callable[[LinkMission], float]:
    """A function that gives the margin in dB of the beacon or the answer of a mission, which must have it.

    Args:
        name: "beacon" or "answer".
        sources: Where each value of the mission comes from, by its dotted key.
    """
    return lambda m: beam_budget(name, Shared.of(m), getattr(m, name), sources).margin_db


def beam_tornado(m: LinkMission, sources: Mapping[str, Source], name: str) -> tuple[Swing, ...]:
    """The margin of the beacon or the answer over each of its inputs, as `swings` moves them.

    Args:
        m: The mission's tables on its links.
        sources: Where each value of the mission comes from, by its dotted key.
        name: "beacon" or "answer".

    Raises:
        ValueError: If the mission has no such beam.
    """
    tables = ("terminals", name, *AIR_TABLES, "point_ahead", "requirement")
    return swings(m, sources, tables, m.conventions.strehl, beam_margin(name, sources), divergence_possible(name))


def swings(
    mission: Varied,
    sources: Mapping[str, Source],
    tables: tuple[str, ...],
    strehl: str,
    margin_db: Callable[[Varied], float],
    possible: Callable[[Varied], bool],
) -> tuple[Swing, ...]:
    """A margin over each input of these tables, one at a time, the largest swing first.

    Every quantity is moved by 10 % both ways, one in decibels by 0.5 dB, a bit error ratio and an outage by a factor of
    ten; none beyond the bounds of its key. Inputs that do not move the margin are left out.

    Args:
        mission: The tables as they are.
        sources: Where each value comes from, by key.
        tables: Names of the tables whose inputs are moved.
        strehl: The convention by which a Strehl is read, "ratio" or "decibel".
        margin_db: The margin (dB) of the tables.
        possible: Whether such tables can be, so that no obscuration stops the whole beam, for instance.
    """

    def swing(each: Input) -> Swing:
        ends = _ends(each.field, each.value, each.rule, strehl)
        low, high = (_nearest(mission, each, end, possible) for end in ends)
        return Swing(
            key=each.shown,
            unit=unit_of(each, strehl),
            value=each.value,
            low=low,
            high=high,
            margin_low_db=margin_or_none(each.moved(mission, low), margin_db),
            margin_high_db=margin_or_none(each.moved(mission, high), margin_db),
            kind=sources[each.key].kind if each.key in sources else "",
            source=source_text(sources, each.key),
        )

    found = [swing(each) for name in tables for each in inputs(mission, name)]
    return tuple(sorted((s for s in found if s.swing_db > 1e-9), key=lambda swing: -round(swing.swing_db, _TIE_DIGITS)))


def _ends(field: str, value: float, rule: Quantity, strehl: str) -> tuple[float, float]:
    step = STEP_DB if field.endswith("_db") or (field, strehl) == ("strehl", "decibel") else RELATIVE * abs(value)
    low, high = (value / 10.0, value * 10.0) if field in _BY_TEN else (value - step, value + step)
    ratio = (field, strehl) == ("strehl", "ratio")
    least = -math.inf if rule.least is None else rule.least
    most = 1.0 if ratio else math.inf if rule.most is None else rule.most
    # bounds that are not reached are approached by half
    if rule.above is not None and low <= rule.above:
        low = (value + rule.above) / 2.0
    if isinstance(rule, Share) and high >= rule.below:
        high = (value + rule.below) / 2.0
    return max(low, least), min(high, most)


def _nearest(mission: Varied, each: Input, end: float, possible: Callable[[Varied], bool]) -> float:
    """The end of a swing, its step halved until there is such a mission."""
    while end != each.value and not possible(each.moved(mission, end)):
        end = (each.value + end) / 2.0
    return end


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
    allows. Values of an input of two axes are those of the one that is larger in size.
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

    Args:
        mission: The tables as they are.
        found: The input, or its axes, which keep their proportion.
        unit: Its unit; decibels are moved by steps, all else by factors.
        margin_db: The margin (dB) of the tables; none where their rule or ``possible`` does not allow the value.
        required_db: The margin that has to be left, dB.
        possible: Whether such tables can be.

    Raises:
        ValueError: If the input is 0 and no decibels, which no factor moves, or does not move the margin.
    """
    value, count = max((each.value for each in found), key=abs), DECADES * STEPS
    name = found[0].shown if len(found) == 1 else found[0].key
    linear, rising = unit.startswith("dB"), math.copysign(1.0, value)
    if not linear and value == 0.0:
        raise ValueError(f"{name} is 0, which no factor moves: give it a value to begin with")

    def at(step: float) -> float:
        return value + 10.0 * step / STEPS if linear else value * 10.0 ** (rising * step / STEPS)

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
        raise ValueError(f"{name} moves this margin by nothing")
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
