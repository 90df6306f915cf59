"""The register of printed quantities: what each figure of a document is, and who says how it is computed."""

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from fnmatch import fnmatchcase
from functools import cache
from importlib import resources
from typing import Any

_TITLES = ("name", "rule", "of", "input", "controller", "station", "parameter")
"""Keys by which records of a list are told apart, the first that all of them have with values of their own."""


class Status(StrEnum):
    """How well a quantity is founded, the best first."""

    VALIDATED = "validated"
    """Compared with a measurement, and within its tolerance."""
    VERIFIED = "verified"
    """Compared with an independent method or another tool's published output, and within its tolerance."""
    TRACED = "traced"
    """Its definition has a source; nothing was compared here."""
    NONE = "none"
    """Neither compared nor sourced."""
    FAILED = "failed"
    """A comparison is beyond its tolerance, or did not run."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A printed quantity.

    Args:
        title: What it is, in words.
        subject: Under which heading of the report it stands.
        names: Ends of dotted names that are this quantity; ``*`` stands for anything within a part.
        source: Paper, standard or equation that defines it; "" where it is our own.
        given: Whether it is an input that is told again, and no result.
    """

    title: str
    subject: str
    names: tuple[str, ...]
    source: str = ""
    given: bool = False

    def matches(self, parts: tuple[str, ...]) -> bool:
        """Whether a dotted name, in its parts, is this quantity."""
        for name in self.names:
            wanted = name.split(".")
            tail = parts[-len(wanted) :]
            if len(tail) == len(wanted) and all(map(fnmatchcase, tail, wanted)):
                return True
        return False


@cache
def quantities() -> tuple[Quantity, ...]:
    """All registered quantities in the order of the report; the first that matches a name has it."""
    text = resources.files("microrad.report").joinpath("quantities.toml").read_text("utf-8")
    found = []
    for subject, entries in tomllib.loads(text).items():
        for title, entry in entries.items():
            names = tuple(entry["names"])
            found.append(Quantity(title, subject, names, entry.get("source", ""), entry.get("given", False)))
    return tuple(found)


@cache
def quantity_of(name: str) -> Quantity | None:
    """The quantity that a dotted name of a document is; None where it is not registered.

    Args:
        name: As `workspace.flattened` gives it; places in lists and sums over them do not count.
    """
    parts = tuple(part for part in name.split(".") if not part.isdigit())
    return next((q for q in _ending(parts[-1] if parts else "") if q.matches(parts)), None)


@cache
def _ending(last: str) -> tuple[Quantity, ...]:
    """The quantities whose names may end in this part, in their order."""
    return tuple(q for q in quantities() if any(fnmatchcase(last, name.rpartition(".")[2]) for name in q.names))


_LINKS = ("budgets", "margin_db", "other_tornados")
_JUDGED = ("requirements", "papers_loop")
_WAYS = ("relay", "direct")


def kind_of(name: str) -> str:
    """What a number is: its quantity, and of which line of a budget, requirement or way of the data.

    Args:
        name: Dotted name of a result, as for `quantity_of`.

    Returns:
        "" for what is told again, and for what is not registered.
    """
    quantity, parts = quantity_of(name), name.split(".")
    if quantity is None or quantity.given or parts[-1] == "required":
        return ""
    scope = ""
    for place, part in enumerate(parts[:-1]):
        if part in _LINKS:
            line = parts[place + 3 : place + 4] if parts[place + 2 : place + 3] in (["lines"], ["totals"]) else []
            scope = " ".join([parts[place + 1].partition("_")[0].capitalize(), *line])
        elif part in _JUDGED:
            scope = " ".join(parts[place + 1].split()[:2])
    ways = [part.partition("_")[0] for part in parts if part.partition("_")[0] in _WAYS]
    scope = scope or " ".join(ways[:1])
    return f"{quantity.title} | {scope}" if scope else quantity.title


def unregistered(names: Iterable[str]) -> list[str]:
    """The dotted names that no registered quantity has."""
    return [name for name in names if quantity_of(name) is None]


_UNITS = {"db": "dB", "rad": "rad", "s": "s", "hz": "Hz", "m": "m", "w": "W", "bit": "bit", "v": "V", "percent": "%"}
_PER = {**_UNITS, "photons": "photon"}
_PAIRS = {
    **{"m_s": "m/s", "bit_s": "bit/s", "rad_s": "rad/s", "rad_s2": "rad/s^2", "w_m2": "W/m^2", "w_sr": "W/sr"},
    **{"v_s": "V/s", "rad_v": "rad/V"},
}


def unit_of(name: str) -> str:
    """The SI unit that the end of a dotted name says, or that which it stands under; "" for a share or a count."""
    above, _, last = name.rpartition(".")
    return _said_unit(last) or _said_unit(above.rpartition(".")[2])


def _said_unit(part: str) -> str:
    """The unit that a key ends with, as in "rate_bit_s" or "fades_per_s"."""
    words = part.split("_")
    if pair := _PAIRS.get("_".join(words[-2:])):
        return pair
    if words[0] == "seconds":
        return "s"
    unit = _UNITS.get(words[-1], "") if len(words) > 1 else ""
    return f"{_PER.get(words[-3], '1')}/{unit}" if unit and len(words) > 2 and words[-2] == "per" else unit


def stated_units(document: Any) -> dict[str, str]:
    """The unit of each number of a document that stands beside a "unit" and says none itself, by its dotted name.

    Args:
        document: As JSON has it.
    """
    told = [(record["unit"], names) for record, names in _records(document) if isinstance(record.get("unit"), str)]
    return {name: unit for unit, names in told for name in names if unit and not _said_unit(name.rpartition(".")[2])}


def _records(document: Any, name: str = "") -> Iterator[tuple[Mapping[str, Any], list[str]]]:
    """Every record of a document with the dotted names of the numbers in it."""
    if isinstance(document, Mapping):
        yield document, [f"{name}.{key}" if name else str(key) for key, value in document.items() if _is_number(value)]
    for title, _, value in _within(document):
        yield from _records(value, f"{name}.{title}" if name else title)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _within(document: Any) -> list[tuple[str, str, Any]]:
    """What a document holds, with its title and its place; records of a list go by what tells them apart."""
    if isinstance(document, Mapping):
        return [(str(key), str(key), value) for key, value in document.items()]
    if isinstance(document, list | tuple):
        return [(title, str(k), each) for k, (title, each) in enumerate(zip(_titles(document), document, strict=True))]
    return []


def placed(document: Any, name: str = "", path: str = "") -> Iterator[tuple[str, str, float]]:
    """Every number of a document with its dotted name and its path, in which records of a list go by their place.

    Args:
        document: As JSON has it.
        name: Of the document; records of a list go by what tells them apart, other lists by their place.
        path: Of the document.
    """
    if _is_number(document):
        yield name, path, float(document)
    for title, place, value in _within(document):
        yield from placed(value, f"{name}.{title}" if name else title, f"{path}.{place}" if path else place)


def flattened(document: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Every number of a document with its dotted name.

    Args:
        document: As JSON has it.
        name: Of the document.
    """
    yield from ((title, value) for title, _, value in placed(document, name))


def _titles(records: list[Any] | tuple[Any, ...]) -> list[str]:
    for key in _TITLES:
        if all(isinstance(each, Mapping) and isinstance(each.get(key), str) for each in records):
            found = [each[key] for each in records]
            if len(set(found)) == len(found):
                return found
    return [str(place) for place in range(len(records))]
