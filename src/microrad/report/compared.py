"""Two trees of plain data, number by number: what differs beyond a relative tolerance."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

SMALLEST = 1e-15
"""Two numbers closer than this are the same whatever their ratio: in SI units nothing of a study is that small."""
_NUMBER = re.compile(r"[-+\u2212]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_LONGEST = 120


@dataclass(frozen=True, slots=True)
class Difference:
    """One value that differs: its place, what it was and is, the relative difference (nan for what is no number)."""

    place: str
    was: Any
    now: Any
    relative: float

    def __str__(self) -> str:
        """A line for a terminal."""
        apart = "" if math.isnan(self.relative) else f", relative difference {self.relative:.2g}"
        return f"{clipped(self.place)}: was {_value(self.was)} and is {_value(self.now)}{apart}"

    def data(self) -> dict[str, Any]:
        """The difference as plain data."""
        share = self.relative if math.isfinite(self.relative) else None
        return {"place": self.place, "was": self.was, "now": self.now, "relative_difference": share}


@dataclass(frozen=True, slots=True)
class Comparison:
    """How many numbers were held against each other, their largest relative difference, and what differs."""

    numbers: int
    largest: float
    differences: tuple[Difference, ...]


def compare(was: Any, now: Any, tolerance: float) -> Comparison:
    """Compare two trees of plain data; texts are the same where their words are and their numbers within tolerance."""
    numbers, largest, found = 0, 0.0, []
    for place, a, b in leaves(was, now, ""):
        if _is_number(a) and _is_number(b):
            numbers += 1
            apart = relative(a, b)
            largest = max(largest, apart)
            if apart > tolerance:
                found.append(Difference(place, a, b, apart))
        elif not _same(a, b, tolerance):
            found.append(Difference(place, a, b, math.nan))
    return Comparison(numbers, largest, tuple(found))


def leaves(was: Any, now: Any, place: str) -> Iterator[tuple[str, Any, Any]]:
    """Each pair of values at the same place; a value that only one side has stands beside `MISSING`."""
    if isinstance(was, dict) and isinstance(now, dict):
        for key in dict.fromkeys([*was, *now]):
            yield from leaves(was.get(key, MISSING), now.get(key, MISSING), f"{place}.{key}" if place else str(key))
    elif isinstance(was, list) and isinstance(now, list):
        for i in range(max(len(was), len(now))):
            a, b = (each[i] if i < len(each) else MISSING for each in (was, now))
            yield from leaves(a, b, f"{place}[{i}]")
    else:
        yield place, was, now


MISSING = "(none)"


def relative(was: float, now: float) -> float:
    """Distance of two numbers over the larger of them; 0 for two that are closer than `SMALLEST`."""
    if not (math.isfinite(was) and math.isfinite(now)):
        return 0.0 if was == now else math.inf
    apart = abs(was - now)
    return 0.0 if apart <= SMALLEST else apart / max(abs(was), abs(now))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _same(was: Any, now: Any, tolerance: float) -> bool:
    if not (isinstance(was, str) and isinstance(now, str)):
        return type(was) is type(now) and bool(was == now)
    if was == now:
        return True
    words = [_NUMBER.sub("#", text) for text in (was, now)]
    pairs = zip(_NUMBER.findall(was), _NUMBER.findall(now), strict=False)
    # a rounded number may fall to the other side: then its words still tell it from another one
    return words[0] == words[1] and all(relative(_float(a), _float(b)) <= tolerance for a, b in pairs)


def _float(text: str) -> float:
    return float(text.replace("\u2212", "-"))


def clipped(text: str) -> str:
    """Text fit for a terminal: shortened, control characters escaped."""
    short = text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"
    return "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in short)


def _value(value: Any) -> str:
    return f"{value:.9g}" if _is_number(value) else clipped(str(value))
