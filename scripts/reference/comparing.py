"""The reference in files, what differs from it, and what the changelog has to say about it.

`reference/CASE.json` holds a quantity a line: name, value, unit, tolerance. `reference/VERSION/CASE.json` holds the
same as of the last release: a quantity of both that has moved needs a line in the changelog.
"""

import json
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple, TypeGuard

from reference.quantities import Quantity, Value

Quantities = Mapping[str, Quantity]

SHOWN = 20
"""Quantities of a case that are listed one by one."""


class Moved(NamedTuple):
    """A quantity that is not what it was; None where there is or was none of its name."""

    case: str
    name: str
    was: Quantity | None
    now: Quantity | None

    def __str__(self) -> str:
        """One line: case, name, was, is, relative change, tolerance."""
        if self.was is None:
            return f"{self.case}: {self.name}: new, {_said(self.now)}"
        if self.now is None:
            return f"{self.case}: {self.name}: was {_said(self.was)}, is gone"
        text = f"{self.case}: {self.name}: was {_said(self.was)}, is {_said(self.now)}"
        change = relative_change(self.was.value, self.now.value)
        return text if change is None else f"{text}, by {change:.2g}; tolerance {self.was.tolerance:g} {self.was.unit}"


def _said(quantity: Quantity | None) -> str:
    return f"{json.dumps(quantity.value)} {quantity.unit}".rstrip() if quantity else "nothing"


def relative_change(was: Value, now: Value) -> float | None:
    """Change as a share of what it was; None where one of them is no number, infinite from 0."""
    if not (_is_number(was) and _is_number(now)):
        return None
    return abs(now - was) / abs(was) if was else math.inf


# --------------------------------------------------------------------------------------------------------------- files
def load(path: Path) -> dict[str, Quantity]:
    """Quantities of a file of the reference, by name; none where there is no such file."""
    if not path.exists():
        return {}
    return {name: Quantity(*line) for name, line in json.loads(path.read_text(encoding="utf-8")).items()}


def save(path: Path, found: Quantities) -> None:
    """Write a file of the reference: sorted, a line each."""
    lines = [f"{json.dumps(name)}: {json.dumps(list(found[name]))}" for name in sorted(found)]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def renewed(was: Quantities, now: Quantities) -> dict[str, Quantity]:
    """What is to be written: what did not move keeps its digits, so that a difference of files shows what did."""
    return {
        name: quantity._replace(value=was[name].value)
        if name in was and not differs(was[name]._replace(tolerance=quantity.tolerance), quantity)
        else quantity
        for name, quantity in now.items()
    }


# ----------------------------------------------------------------------------------------------------------- comparing
def differs(was: Quantity, now: Quantity) -> bool:
    """Whether a quantity moved by more than its tolerance, or changed its unit or its kind."""
    if was.unit != now.unit:
        return True
    if _is_number(was.value) and _is_number(now.value) and math.isfinite(was.value):
        return not abs(now.value - was.value) <= was.tolerance
    return json.dumps(was.value) != json.dumps(now.value)


def moved(case: str, was: Quantities, now: Quantities) -> list[Moved]:
    """Quantities that moved, are missing, or are new, by name."""
    return [
        Moved(case, name, was.get(name), now.get(name))
        for name in sorted({*was, *now})
        if name not in was or name not in now or differs(was[name], now[name])
    ]


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


# ----------------------------------------------------------------------------------------------------------- changelog
LINE = re.compile(r'- (?P<case>[\w-]+): (?P<name>.+?) (?P<was>"[^"]*"|\S+) -> (?P<now>"[^"]*"|\S+): (?P<why>\S.*)')
"""A line of "Numbers that moved": `- case: quantity was -> is: why`; a quantity may end with `*`."""

SECTION = "### Numbers that moved"


class Line(NamedTuple):
    """What a line of the changelog says about a case: a quantity or the beginning of several, was, is, and why."""

    case: str
    name: str
    was: str
    now: str
    why: str

    def covers(self, other: Moved) -> bool:
        """Whether the line is about a quantity, by its name or by its beginning."""
        name = self.name
        same = other.name.startswith(name[:-1]) if name.endswith("*") else other.name == name
        return self.case == other.case and same

    def tells(self, other: Moved) -> bool:
        """Whether the line has its values, in as many digits as it writes."""
        return all(
            agrees(text, quantity.value if quantity else "gone")
            for text, quantity in ((self.was, other.was), (self.now, other.now))
        )


def lines(changelog: str) -> list[Line]:
    """The lines of the unreleased part of a changelog; a line may go on below, indented."""
    part = re.search(r"(?ms)^## [^\n]*\(unreleased\)$(.*?)(?=^## |\Z)", changelog)
    section = part[1].partition(f"{SECTION}\n")[2].partition("\n### ")[0] if part else ""
    joined = re.sub(r"\n +", " ", section).splitlines()
    return [Line(**found.groupdict()) for found in map(LINE.fullmatch, joined) if found]


def agrees(text: str, value: Value) -> bool:
    """Whether a text says a value: a word as it is, a number in its own digits."""
    if not _is_number(value):
        return text.strip('"') == (value if isinstance(value, str) else json.dumps(value))
    try:
        said = float(text)
    except ValueError:
        return False
    digits = len(re.sub(r"[eE].*|\D", "", text).lstrip("0")) or 1
    return said == float(f"{value:.{digits - 1}e}")


def lacking(reference: Path, changelog: str) -> Iterator[str]:
    """What a changelog lacks about the numbers of a folder that moved since the release kept in it."""
    said = lines(changelog)
    for path in sorted(reference.glob("*/*.json")):
        now = reference / path.name
        yield from unexplained(path.stem, load(path), load(now), said)


def unexplained(case: str, released: Quantities, now: Quantities, said: list[Line]) -> Iterator[str]:
    """What the changelog lacks about a case: quantities without a line, and lines with other values."""
    changes = [each for each in moved(case, released, now) if each.was is not None]
    silent = [each for each in changes if not any(line.covers(each) for line in said)]
    for each in silent[:SHOWN]:
        yield f"{SECTION} of CHANGELOG.md lacks: - {case}: {each.name} {_text(each.was)} -> {_text(each.now)}: why"
    if len(silent) > SHOWN:
        yield f"... and {len(silent) - SHOWN} more of {case}; one line may end with * for all that begin alike"
    for line in said:
        covered = [each for each in changes if line.covers(each)]
        if line.case == case and not any(line.tells(each) for each in covered):
            yield f"CHANGELOG.md: {case}: {line.name}: {line.was} -> {line.now} is no quantity that moved so"


def _text(quantity: Quantity | None) -> str:
    if quantity is None:
        return "gone"
    return f"{quantity.value:.4g}" if isinstance(quantity.value, float) else json.dumps(quantity.value)
