"""Two trees of plain data, or two tables of figures, number by number: what differs beyond what is allowed."""

import csv
import io
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from microrad.report.data import fields

SMALLEST = 1e-15
"""Two numbers closer than this are the same within any tolerance: in SI units nothing of a study is that small."""
WORDS_SHARE = 0.05
"""Share by which a number in a sentence may differ within any tolerance: it is a rounded copy of one with its own."""
DIGITS_SHARE = 1e-8
"""Share by which a number of a figure's data may differ within any tolerance: it is written to nine digits."""
_NUMBER = re.compile(r"[-+\u2212]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_LONGEST = 120

Allowed = Callable[[str, str, float, float], float]
"""The distance up to which two values are the same, from their place, their unit, and both."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One value that differs: its place, what it was and is, the relative difference (nan for what is no number).

    ``allowed`` is the distance up to which the two would be the same.
    """

    place: str
    was: Any
    now: Any
    relative: float
    allowed: float = 0.0

    def __str__(self) -> str:
        """A line for a terminal."""
        apart = "" if math.isnan(self.relative) else f", relative difference {self.relative:.2g}"
        limit = f" ({self.allowed:.2g} apart is allowed)" if self.allowed else ""
        digits = 9 if _value(self.was, 9) != _value(self.now, 9) else 17
        was, now = _value(self.was, digits), _value(self.now, digits)
        return f"{clipped(self.place)}: was {was} and is {now}{apart}{limit}"

    def data(self) -> dict[str, Any]:
        """The difference as plain data."""
        share = self.relative if math.isfinite(self.relative) else None
        return {**fields(self, "place", "was", "now"), "relative_difference": share, "allowed_distance": self.allowed}


@dataclass(frozen=True, slots=True)
class Comparison:
    """How many numbers were held against each other, their largest relative difference, and what differs."""

    numbers: int = 0
    largest: float = 0.0
    differences: tuple[Difference, ...] = ()

    def __add__(self, other: "Comparison") -> "Comparison":
        """Both together."""
        largest = max(self.largest, other.largest)
        return Comparison(self.numbers + other.numbers, largest, (*self.differences, *other.differences))


def compare(was: Any, now: Any, allowed: Allowed | None) -> Comparison:
    """Compare two trees of plain data, number by number.

    Texts are the same where their words are, and their numbers to `WORDS_SHARE` or one in the last digit.

    Args:
        was: one tree.
        now: the other one.
        allowed: the distance up to which two numbers are the same; None asks for the last bit and letter.
    """
    return _compared(leaves(was, now, ""), allowed)


def compare_tables(name: str, was: str, now: str, allowed: Allowed | None) -> Comparison:
    """Compare two figures' data, texts of CSV with a heading, in the same way: column by column.

    Args:
        name: the figure's.
        was: the text of its CSV with a heading.
        now: the other one.
        allowed: the distance up to which two numbers are the same; None asks for the last bit and letter.
    """
    return _compared(_cells(name, _columns(was), _columns(now)), allowed)


def _compared(pairs: Iterator[tuple[str, str, Any, Any]], allowed: Allowed | None) -> Comparison:
    numbers, largest, found = 0, 0.0, []
    for place, unit, a, b in pairs:
        if is_number(a) and is_number(b):
            numbers += 1
            apart = relative(a, b)
            largest = max(largest, apart)
            limit = allowed(place, unit, a, b) if allowed else 0.0
            if not _near(a, b, limit, allowed is None):
                found.append(Difference(place, a, b, apart, limit))
        elif not _same(a, b, allowed is None):
            found.append(Difference(place, a, b, math.nan))
    return Comparison(numbers, largest, tuple(found))


def _near(was: float, now: float, limit: float, exactly: bool) -> bool:
    if was == now or exactly:
        return was == now
    return math.isfinite(was) and math.isfinite(now) and abs(was - now) <= max(limit, SMALLEST)


def leaves(was: Any, now: Any, place: str, unit: str = "") -> Iterator[tuple[str, str, Any, Any]]:
    """Each pair of values at the same place, with the unit that stands beside them, or "".

    A value that only one side has stands beside `MISSING`.

    Args:
        was: one tree.
        now: the other one.
        place: of both within the whole, "" for all of it.
        unit: that stands beside them.
    """
    if isinstance(was, dict) and isinstance(now, dict):
        beside = now.get("unit")
        for key in dict.fromkeys([*was, *now]):
            inner = f"{place}.{key}" if place else str(key)
            of = beside if isinstance(beside, str) else ""
            yield from leaves(was.get(key, MISSING), now.get(key, MISSING), inner, of)
    elif isinstance(was, list) and isinstance(now, list):
        for i in range(max(len(was), len(now))):
            a, b = (each[i] if i < len(each) else MISSING for each in (was, now))
            yield from leaves(a, b, f"{place}[{i}]", unit)
    else:
        yield place, unit, was, now


MISSING = "(none)"


def _columns(text: str) -> dict[str, list[str]]:
    try:
        heading, *rows = list(csv.reader(io.StringIO(text))) or [[]]
    except csv.Error:  # what is no table has no columns
        return {}
    return dict(zip(heading, map(list, zip_longest(*rows, fillvalue="")), strict=False))


def _cells(
    name: str, was: dict[str, list[str]], now: dict[str, list[str]]
) -> Iterator[tuple[str, str, float | str, float | str]]:
    for heading in dict.fromkeys([*was, *now]):
        place = f"{name}: {heading}"
        if heading not in was or heading not in now:
            a, b = ("a column" if heading in each else MISSING for each in (was, now))
            yield place, "", a, b
            continue
        for row, (a, b) in enumerate(zip_longest(was[heading], now[heading], fillvalue=""), start=1):
            yield f"{place}, row {row}", unit_of_column(heading), _cell(a), _cell(b)


def unit_of_column(heading: str) -> str:
    """The unit in brackets at the end of a column's heading, or ""."""
    found = re.search(r"\(([^()]*)\)$", heading)
    return found[1] if found else ""


def _cell(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def relative(was: float, now: float) -> float:
    """Distance of two numbers over the larger of them; 0 for two that are both below `SMALLEST`.

    Args:
        was: one number.
        now: the other one.
    """
    if not (math.isfinite(was) and math.isfinite(now)):
        return 0.0 if was == now else math.inf
    larger = max(abs(was), abs(now))
    return 0.0 if larger <= SMALLEST else abs(was - now) / larger


def is_number(value: Any) -> bool:
    """Whether a value of plain data is a number, which a truth value is not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _same(was: Any, now: Any, exactly: bool) -> bool:
    if exactly or not (isinstance(was, str) and isinstance(now, str)):
        return type(was) is type(now) and bool(was == now)
    words = [_NUMBER.sub("#", text) for text in (was, now)]
    return words[0] == words[1] and all(map(_near_in_words, _NUMBER.findall(was), _NUMBER.findall(now)))


def _near_in_words(was: str, now: str) -> bool:
    """Whether two numbers of a sentence may be roundings of one: a whole number may be a count."""
    if was == now:  # one beyond all floats has no distance from itself
        return True
    a, b = _float(was), _float(now)
    digits = len(was.partition(".")[2]) if "e" not in was else 0
    last = 1.0001 * 10.0**-digits if digits else 0.0
    return abs(a - b) <= max(WORDS_SHARE * max(abs(a), abs(b)), last)


def _float(text: str) -> float:
    return float(text.replace("\u2212", "-"))


def clipped(text: str) -> str:
    """Text fit for a terminal: shortened, control characters escaped."""
    short = text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"
    return "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in short)


def _value(value: Any, digits: int) -> str:
    return f"{value:.{digits}g}" if is_number(value) else clipped(str(value))
