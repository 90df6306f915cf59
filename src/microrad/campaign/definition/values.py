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

    def fault(self, key: str, value: object, reason: str, expected: str, nearest: str = "") -> NotedError:
        """Note a fault on the line of a key; returns what to raise where nothing can be read of it.

        Args:
            key: the key in the campaign file.
            value: what stands there, None where nothing does.
            reason: what is wrong with it.
            expected: what would do.
            nearest: the word that it resembles, "" without one.
        """
        self.document.fault(key, "" if value is None else shown(value), reason, expected, nearest=nearest)
        return NotedError()

    def each(self, read: Callable[..., T], items: Iterable[tuple[Any, ...]]) -> tuple[T, ...]:
        """What is read of each of some items; those with a fault, which is noted, are left out.

        Args:
            read: reads one item.
            items: the arguments of each call.
        """
        found = []
        for item in items:
            with suppress(NotedError):
                found.append(read(*item))
        return tuple(found)

    def table(self, at: str, model: type[TableT], raw: Mapping[str, Any]) -> TableT:
        """A table that stands at a key. Raises `NotedError`.

        Args:
            at: the key in the campaign file.
            model: what the table has to be.
            raw: the table as written.
        """
        found = check_table(replace(self.document, prefix=at), model, raw)
        if found is None:
            raise NotedError
        return found

    def key(self, at: str, key: str, value: object, data: Mapping[str, Any]) -> Key:
        """A key of the mission. Raises `NotedError`.

        Args:
            at: the table of the campaign file.
            key: the key of the mission.
            value: what stands there, None where nothing is told of it.
            data: raw data of the mission.
        """
        try:
            return find(key, data)
        except UnknownKeyError as error:
            raise self.fault(f"{at}.{key}", value, error.reason, error.expected, error.nearest) from None

    def fits(self, at: str, key: Key, value: object) -> bool:
        """Whether a value fits a key of the mission by itself; what is wrong with it is noted.

        Args:
            at: the key in the campaign file.
            key: the key of the mission.
            value: the value as written.
        """
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
        """The SI values of keys of a table by their rules. Raises `NotedError` with all that is wrong noted.

        Args:
            at: the key of the table.
            raw: rule and value as written, by their names in it.
        """
        found = self.each(self.number, [(f"{at}.{name}", rule, value) for name, (rule, value) in raw.items()])
        if len(found) < len(raw):
            raise NotedError
        return found

    def number(self, at: str, rule: Quantity, raw: object, example: str = "") -> float:
        """The SI value of a quantity. Raises `NotedError` with what would do noted.

        Args:
            at: the key in the campaign file.
            rule: what it may be.
            raw: the value as written.
            example: what would do; "" for the rule's own example.
        """
        try:
            return float(rule.read(raw))
        except UnitError as error:
            example = example or (f'"{error.example}"' if " " in error.example else error.example)
            name = at.rpartition(".")[2]
            raise self.fault(at, raw, error.reason, f"{error.expected}; for example {name} = {example}") from None

    def tell_missing(self, key: str, expected: str) -> bool:
        """Say of a key that was noted as missing what would do in its place; whether one was.

        Args:
            key: the key in the campaign file.
            expected: what would do.
        """
        faults = self.document.faults
        missing = [i for i, fault in enumerate(faults) if fault.key == key and fault.reason == "is missing"]
        for i in missing:
            faults[i] = replace(faults[i], expected=expected)
        return bool(missing)

    def is_output(self, at: str, name: object, *others: str) -> bool:
        """Whether a name is that of an output; what is wrong with it is noted.

        Args:
            at: the key in the campaign file.
            name: what stands there.
            others: names that will do as well.
        """
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
    """The choice that a word resembles, in quotes, or "".

    Args:
        word: what was written.
        words: what could have been meant.
    """
    near = nearest(word, words)
    return near and f'"{near}"'
