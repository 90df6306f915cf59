"""Which input moves the margin most: each one alone, a little down and up."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from microrad.fields import Quantity, Share, Table
from microrad.link.budget import communication_budget
from microrad.link.model import lit_aperture
from microrad.link.receivers import RateError
from microrad.mission import LinkMission, Source, source_text

RELATIVE = 0.1
"""How far a quantity is moved, as a share of itself."""
STEP_DB = 0.5
"""How far a quantity in decibels is moved."""
_TABLES = (
    "terminals",
    "communication",
    "communication.receiver",
    "communication.receiver.background",
    "communication.beam",
    "channel",
    "point_ahead",
)
_BY_TEN = "bit_error_ratio"  # a ratio that is judged by its order of magnitude


@dataclass(frozen=True, slots=True)
class Swing:
    """The margin with one input moved down to ``low`` and up to ``high``, both in ``unit``, all others as they are.

    ``kind`` is the kind of source that the input has, "assumption" for one.
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


def tornado(mission: LinkMission, sources: Mapping[str, Source]) -> tuple[Swing, ...]:
    """The margin of the communication link over each of its inputs, one at a time, the largest swing first.

    Every quantity is moved by 10 % both ways, one in decibels by 0.5 dB, a bit error ratio by a factor of ten; none
    beyond the bounds that its key has. Inputs that do not move the margin are left out.
    """
    swings = [swing for name in _TABLES for swing in _swings(mission, sources, name)]
    moving = [swing for swing in swings if swing.swing_db > 1e-9]
    return tuple(sorted(moving, key=lambda swing: -swing.swing_db))


def _swings(mission: LinkMission, sources: Mapping[str, Source], name: str) -> Iterator[Swing]:
    table = _table(mission, name)
    if table is None:
        return
    for field, info in type(table).model_fields.items():
        value = getattr(table, field)
        rules = [rule for rule in info.metadata if isinstance(rule, Quantity)] or _inner(info.annotation)
        if not rules or not isinstance(value, float):
            continue
        low, high = (
            _lit(mission, name, field, value, moved)
            for moved in _moved(field, value, rules[0], mission.conventions.strehl)
        )
        key = f"{name}.{info.alias or field}"
        yield Swing(
            key=key,
            unit=_unit(mission, field, rules[0]),
            value=value,
            low=low,
            high=high,
            margin_low_db=_margin(mission, sources, name, field, low),
            margin_high_db=_margin(mission, sources, name, field, high),
            kind=sources[key].kind if key in sources else "",
            source=source_text(sources, key),
        )


def _unit(mission: LinkMission, field: str, rule: Quantity) -> str:
    """Unit of a field; a Strehl has one of its own where it is read as a loss."""
    return "dB" if field == "strehl" and mission.conventions.strehl == "decibel" else rule.unit


def _inner(annotation: object) -> list[Quantity]:
    """The rule of a quantity that may be left out: it stands inside the union."""
    kinds = getattr(annotation, "__args__", ())
    return [rule for kind in kinds for rule in getattr(kind, "__metadata__", ()) if isinstance(rule, Quantity)]


def _moved(field: str, value: float, rule: Quantity, strehl: str) -> tuple[float, float]:
    step = STEP_DB if field.endswith("_db") or (field, strehl) == ("strehl", "decibel") else RELATIVE * abs(value)
    low, high = (value / 10.0, value * 10.0) if field == _BY_TEN else (value - step, value + step)
    ratio = (field, strehl) == ("strehl", "ratio")
    least = -math.inf if rule.least is None else rule.least
    most = 1.0 if ratio else math.inf if rule.most is None else rule.most
    # bounds that are not reached are approached by half
    if rule.above is not None and low <= rule.above:
        low = (value + rule.above) / 2.0
    if isinstance(rule, Share) and high >= rule.below:
        high = (value + rule.below) / 2.0
    return max(low, least), min(high, most)


def _table(mission: LinkMission, name: str) -> Table | None:
    table: Table | None = mission
    for part in name.split("."):
        table = None if table is None else getattr(table, part)
    return table


def _lit(mission: LinkMission, name: str, field: str, value: float, moved: float) -> float:
    """The moved value, its step halved until the obscuration still lets some of the beam pass."""
    while moved != value and mission.conventions.pointing_loss == "pattern":
        try:
            lit_aperture(_changed(mission, name, field, moved))
            break
        except ValueError:
            moved = (value + moved) / 2.0
    return moved


def _margin(mission: LinkMission, sources: Mapping[str, Source], name: str, field: str, value: float) -> float:
    """The margin with one field of one table replaced; a receiver too slow for the rate has none."""
    try:
        return communication_budget(_changed(mission, name, field, value), sources).margin_db
    except RateError:
        return -math.inf


def _changed(mission: LinkMission, name: str, field: str, value: float) -> LinkMission:
    """The mission with one field of one table replaced."""
    parts = name.split(".")
    table = _table(mission, name)
    assert table is not None
    changed: Table = table.model_copy(update={field: value})
    for depth in range(len(parts) - 1, 0, -1):
        outer = _table(mission, ".".join(parts[:depth]))
        assert outer is not None
        changed = outer.model_copy(update={parts[depth]: changed})
    return mission.model_copy(update={parts[0]: changed})
