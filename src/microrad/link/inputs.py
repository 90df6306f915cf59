"""The numbers of a mission's link tables, one at a time: found by their rules, replaced, and kept possible."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic.fields import FieldInfo

from microrad.link.budget.assembly import communication_beam
from microrad.link.receivers import RateError
from microrad.mission.fields import Quantity, Several, Share, Table
from microrad.mission.model import LinkMission
from microrad.mission.tables.link import divergence_fits

LINK_TABLES = (
    "terminals",
    "communication",
    "communication.receiver",
    "communication.receiver.background",
    "communication.beam",
    "channel",
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
        """The tables with this number replaced."""
        if self.item is None:
            return tables.with_value(f"{self.table}.{self.field}", value)
        items = list(getattr(_table(tables, self.table), self.field))
        items[self.item] = value
        return tables.with_value(f"{self.table}.{self.field}", tuple(items))


def inputs(tables: Table, name: str) -> Iterator[Input]:
    """Every quantity of one of the tables that has a value."""
    table = _table(tables, name)
    if table is None:
        return
    for field, info in type(table).model_fields.items():
        value, key = getattr(table, field), f"{name}.{info.alias or field}"
        rules = _rules(info)
        if rules and isinstance(value, float):
            yield Input(key, name, field, None, value, rules[0])
        for rule in (each for each in info.metadata if isinstance(each, Several)):
            for item, number in enumerate(value):
                yield Input(key, name, field, item, number, rule.each)


def moved(tables: Varied, found: tuple[Input, ...], value: float) -> Varied | None:
    """The tables with the input at a value, its axes in proportion, or None where their rule does not allow it."""
    largest = max(each.value for each in found)
    for each in found:
        own = value if each.value == largest else value * each.value / largest
        if each.rule.out_of_bounds(own) or (isinstance(each.rule, Share) and not 0.0 < own < each.rule.below):
            return None
        tables = each.moved(tables, own)
    return tables


def _rules(info: FieldInfo) -> list[Quantity]:
    """The rule of a quantity; that of one that may be left out stands inside the union."""
    kinds = getattr(info.annotation, "__args__", ())
    inner = [rule for kind in kinds for rule in getattr(kind, "__metadata__", ())]
    return [rule for rule in (*info.metadata, *inner) if isinstance(rule, Quantity)]


def unit_of(each: Input, strehl: str) -> str:
    """Unit of an input; a Strehl has one of its own where the convention reads it as a loss."""
    return "dB" if (each.field, strehl) == ("strehl", "decibel") else each.rule.unit


def _table(tables: Table, name: str) -> Table | None:
    table: Table | None = tables
    for part in name.split("."):
        table = None if table is None else getattr(table, part)
    return table


def lit(m: LinkMission) -> bool:
    """Whether the obscuration lets some of the data's beam pass."""
    try:
        communication_beam(m.terminals, m.communication, m.conventions.pointing_loss)
    except ValueError:
        return False
    return True


def margin_or_none(of: _Link, margin_db: Callable[[_Link], float]) -> float:
    """The margin of a link; a receiver too slow for the rate has none."""
    try:
        return margin_db(of)
    except RateError:
        return -math.inf


def fits(name: str) -> Callable[[Any], bool]:
    """Whether the aperture of the beacon, or of the answer, can make its divergence; asked of a mission."""
    too_narrow = divergence_fits(name, "geo" if name == "answer" else "leo")
    return lambda m: not any(too_narrow(m.conventions, m.terminals, getattr(m, name)))
