"""Which input moves a margin most: each one alone, a little down and up."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from microrad.link.budget.assembly import Shared
from microrad.link.budget.lines import beam_budget
from microrad.link.inputs import Input, Varied, fits, inputs, margin_or_none, unit_of
from microrad.mission.fields import Quantity, Share
from microrad.mission.model import LinkMission, Source, source_text

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
    """The margin of the "beacon" or of the "answer", asked of a mission, which has that beam."""
    return lambda m: beam_budget(name, Shared.of(m), getattr(m, name), sources).margin_db


def beam_tornado(m: LinkMission, sources: Mapping[str, Source], name: str) -> tuple[Swing, ...]:
    """The margin of the "beacon" or of the "answer" over each of its inputs, as `swings` moves them.

    Raises `ValueError` for a beam that the mission has not.
    """
    tables = ("terminals", name, "channel", "point_ahead")
    return swings(m, sources, tables, m.conventions.strehl, beam_margin(name, sources), fits(name))


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
    ten; none beyond the bounds that its key has, nor to a mission that is not ``possible``, such as one whose
    obscuration stops the beam. ``strehl`` is the convention by which a Strehl is read. Inputs that do not move the
    margin are left out.
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
