"""Standards as data: what public sources print of each requirement, with its number where they print one."""

import difflib
import tomllib
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from importlib import resources
from typing import Any, Literal, cast

from microrad.core.units import parse_quantity

Comparison = Literal["at least", "at most", "between", "one of", "on the grid"]
"""How what a mission has is held against the values: on the grid, it is the first and whole steps of the second."""


@dataclass(frozen=True, slots=True)
class Asked:
    """One requirement of a standard.

    ``number`` is the standard's own in its version ``numbered_in``; both are "" where none of its sources prints it.
    ``values`` are in ``unit`` (SI; "" for plain numbers), empty for words; ``texts`` are the values as the source
    prints them. ``distance_m`` and ``bit_error_ratio`` say where the values are asked for, None where they are not.
    ``outside`` is why microrad cannot answer, "" where it can.
    """

    key: str
    number: str
    numbered_in: str
    subject: str
    asks: str
    comparison: Comparison | None
    values: tuple[float, ...]
    texts: tuple[str, ...]
    unit: str
    distance_m: float | None
    bit_error_ratio: float | None
    source: str
    outside: str


@dataclass(frozen=True, slots=True)
class Standard:
    """A standard: ``name`` is what the command line calls it, ``note`` how far what stands here may be trusted."""

    name: str
    title: str
    version: str
    note: str
    requirements: tuple[Asked, ...]


def standards() -> tuple[str, ...]:
    """The names of all standards that are known."""
    found = (each.name for each in resources.files("microrad.link.compliance").iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in found if name.endswith(".toml")))


@cache
def standard(name: str) -> Standard:
    """The standard of this name.

    Raises:
        ValueError: For a name that none has, with the nearest, or with all of them.
    """
    if name not in standards():
        near = difflib.get_close_matches(name[:60].lower(), standards(), n=1, cutoff=0.4)
        hint = f"did you mean {near[0]}?" if near else f"there is {', '.join(standards())}"
        raise ValueError(f'there is no standard "{name[:60]}"; {hint}')
    text = resources.files("microrad.link.compliance").joinpath(f"{name}.toml").read_text("utf-8")
    data = tomllib.loads(text)
    asked = tuple(_asked(each, data["sources"]) for each in data["requirements"])
    return Standard(name, data["title"], data["version"], data["note"], asked)


def _asked(entry: dict[str, Any], sources: dict[str, str]) -> Asked:
    texts, unit, distance = tuple(entry.get("values", ())), entry.get("unit", ""), entry.get("distance")
    return Asked(
        key=entry["key"],
        number=entry.get("number", ""),
        numbered_in=entry.get("numbered_in", ""),
        subject=entry["subject"],
        asks=entry["asks"],
        comparison=cast("Comparison | None", entry.get("comparison")),
        values=tuple(_value(text, unit) for text in texts if unit or text[0].isdigit()),
        texts=texts,
        unit=unit,
        distance_m=None if distance is None else parse_quantity(distance, "m"),
        bit_error_ratio=entry.get("bit_error_ratio"),
        source=sources[entry["source"]],
        outside=entry.get("outside", ""),
    )


def _value(text: str, unit: str) -> float:
    return parse_quantity(text, unit) if unit else float(Fraction(text))
