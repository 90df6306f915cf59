"""How the values of a campaign file are read, whichever table they stand in, and how a fault is said of them."""

import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from microrad.campaign.definition.keys import Key, UnknownKeyError, find, nearest
from microrad.campaign.definition.outputs import OUTPUTS
from microrad.core.units import UnitError
from microrad.mission.fields import Quantity, Table
from microrad.mission.file import check_table, check_value
from microrad.mission.toml import Document, shown

T = TypeVar("T")
TableT = TypeVar("TableT", bound=Table)

FILE_WORD = "campaign file"
"""What messages call it."""


class NotedError(Exception):
    """A value is wrong, which has been noted."""


@dataclass(frozen=True, slots=True)
class ValueReader:
    """Reads values of a campaign file; keys are dotted and begin with the table that they stand in."""

    document: Document

    def fault(self, key: str, value: object, reason: str, expected: str, nearest: str = "") -> None:
        """Note a fault on the line of a key."""
        self.document.fault(key, "" if value is None else shown(value), reason, expected, nearest=nearest)

    def noted(self, key: str, value: object, reason: str, expected: str, nearest: str = "") -> NotedError:
        """Note a fault; returns what to raise."""
        self.fault(key, value, reason, expected, nearest)
        return NotedError()

    def each(self, read: Callable[..., T], items: Iterable[tuple[Any, ...]]) -> tuple[T, ...]:
        """What is read of each of some items; those with a fault, which is noted, are left out."""
        found = []
        for item in items:
            with suppress(NotedError):
                found.append(read(*item))
        return tuple(found)

    def table(self, at: str, model: type[TableT], raw: Mapping[str, Any]) -> TableT:
        """A table that stands at a key. Raises `NotedError`."""
        found = check_table(replace(self.document, prefix=at), model, raw)
        if found is None:
            raise NotedError
        return found

    def key(self, at: str, key: str, value: object, data: Mapping[str, Any]) -> Key:
        """A key of the mission. Raises `NotedError`."""
        try:
            return find(key, data)
        except UnknownKeyError as error:
            raise self.noted(f"{at}.{key}", value, error.reason, error.expected, error.nearest) from None

    def fits(self, at: str, key: Key, value: object) -> bool:
        """Whether a value fits a key by itself; what is wrong with it is noted at a key of the campaign."""
        if key.item is not None:
            assert isinstance(key.rule, Quantity)
            return bool(self.each(self.number, [(at, key.rule, value)]))
        scratch = replace(self.document, faults=[], prefix=key.text.rpartition(".")[0])
        if check_value(scratch, key.table, key.name, value):
            return True
        for fault in scratch.faults:
            self.fault(at, value, fault.reason, fault.expected, fault.nearest)
        return False

    def numbers(self, at: str, raw: Mapping[str, tuple[Quantity, object]]) -> tuple[float, ...]:
        """The SI values of keys of a table by their rules. Raises `NotedError` with all that is wrong noted."""
        found = self.each(self.number, [(f"{at}.{name}", rule, value) for name, (rule, value) in raw.items()])
        if len(found) < len(raw):
            raise NotedError
        return found

    def number(self, at: str, rule: Quantity, raw: object, example: str = "") -> float:
        """The SI value of a quantity. Raises `NotedError` with what would do noted: ``example`` or the rule's own."""
        try:
            return float(rule.read(raw))
        except UnitError as error:
            example = example or (f'"{error.example}"' if " " in error.example else error.example)
            name = at.rpartition(".")[2]
            raise self.noted(at, raw, error.reason, f"{error.expected}; for example {name} = {example}") from None

    def tell_missing(self, key: str, expected: str) -> None:
        """Say of a key that was noted as missing what would do in its place."""
        for i, fault in enumerate(self.document.faults):
            if fault.key == key and fault.reason == "is missing":
                self.document.faults[i] = replace(fault, expected=expected)

    def is_output(self, at: str, name: object, *others: str) -> bool:
        """Whether a name is that of an output, or one of ``others``; what is wrong with it is noted."""
        names = (*OUTPUTS, *others)
        if isinstance(name, str) and name in names:
            return True
        self.fault(at, name, "is no output", f"one of {', '.join(names)}", quoted_near(name, names))
        return False


def text_of(value: object) -> str:
    """A value of a campaign file as text, in full: strings without their quotes."""
    if isinstance(value, list):
        return f"[{', '.join(text_of(each) for each in value)}]"
    return str(value).lower() if isinstance(value, bool) else str(value)


def is_number(value: object) -> bool:
    """Whether a value is a finite plain number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def quoted_near(word: object, words: Iterable[str]) -> str:
    """The choice that a word resembles, in quotes, or ""."""
    near = nearest(word, words)
    return near and f'"{near}"'
