"""How a mission's numbers are founded, by the evidence of the release, and where its inputs leave that ground."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from microrad.core.units import format_quantity, parse_quantity, plain
from microrad.mission.model import Source
from microrad.report.tables import Table
from microrad.report.view import Block, Points, Soft, View

_UNVALIDATED = (
    "No link, loop or day of microrad was compared with one that flew. Of the mirror, identified models were compared"
    " with recordings of two devices. So every number here is outside the validated domain, unless it is the error of a"
    " mirror model on records that are held out: it is computed as it was meant to be, and how far nature departs from"
    " it is not known."
)

_STATUSES = "validated", "verified", "traced", "none"


@dataclass(frozen=True, slots=True)
class Placard:
    """An input beyond what a part of the chain was checked at.

    Args:
        part: Of the chain.
        key: Of the mission.
        value: In SI units, as are the limits.
        limit: The nearest value at which the part was still checked.
        unit: Of both.
    """

    part: str
    key: str
    value: float
    limit: float
    unit: str

    @property
    def text(self) -> str:
        """Which limit is exceeded, by how much, and what follows."""
        value, limit = (format_quantity(each, self.unit, 3) for each in (self.value, self.limit))
        if self.value > self.limit:
            how = f"{plain(self.value / self.limit)} times the largest"
        else:
            by = f", by a factor of {plain(self.limit / self.value)}," if self.value else ""
            how = f"below the least{by}"
        part = f"{self.part[0].lower()}{self.part[1:]}"
        return (
            f"{self.key} = {value} is {how} at which {part} were held against independent methods, {limit}. Figures"
            " that depend on it are extrapolated"
        )


@cache
def shipped() -> Mapping[str, Any]:
    """Domains and statuses as `microrad verify --full` has found them at the release."""
    text = resources.files("microrad.report").joinpath("domains.json").read_text("utf-8")
    found: Mapping[str, Any] = json.loads(text)
    return found


def placards(sources: Mapping[str, Source]) -> list[Placard]:
    """The inputs of a mission that are beyond the domains, the farthest first.

    Args:
        sources: Of each value of the mission, by its dotted key.
    """
    found = []
    for part, domain in shipped()["domains"].items():
        for key, extent in domain["extents"].items():
            if key not in sources:
                continue
            try:
                value = parse_quantity(sources[key].value.strip('"'), extent["unit"])
            except ValueError:  # a word in place of a value, as "largest"
                continue
            if not extent["least"] * (1.0 - 1e-3) <= value <= extent["most"] * (1.0 + 1e-3):
                limit = extent["least"] if value < extent["least"] else extent["most"]
                found.append(Placard(part, key, value, limit, extent["unit"]))
    return sorted(found, key=lambda each: -max(each.value / each.limit, each.limit / max(each.value, 1e-300)))


@dataclass(frozen=True, slots=True)
class Measured:
    """How a part of a mission's mirror model stands to the recordings on which its error was measured.

    Args:
        part: Of the model.
        inside: Whether all that the mission states of it lies within what was measured.
        beyond: What does not, with the extent.
        said: Both and what follows, in sentences.
    """

    part: str
    inside: bool
    beyond: tuple[str, ...]
    said: str


def measured(sources: Mapping[str, Source]) -> list[Measured]:
    """The parts of a mission's mirror model, each against the recordings of the release; none without a mirror.

    The largest drive amplitude, the frequencies and the fastest rate are judged. Travel is not: recordings have it in
    metres at a point of the mirror, missions as an angle.

    Args:
        sources: Of each value of the mission, by its dotted key.
    """
    found = []
    drive = _values(sources, ("mirror.drive_min", "mirror.drive_max"), "V")
    for record in shipped()["recordings"].values():
        works = {
            "drive": [(max(drive) - min(drive)) / 2.0] if drive else [],
            "frequency": _values(sources, record["frequencies"], "Hz"),
            "rate": _values(sources, ("control.rate", "fine_pointing.rate"), "Hz"),
        }
        if not works["drive"] or not works["frequency"]:
            continue
        beyond = [text for name in works for text in _past(name, works[name], record["extents"][name])]
        found.append(_measured(record, beyond))
    return found


_WORKS = {"drive": "a drive amplitude of", "frequency": "a frequency of", "rate": "a rate of"}


def _past(name: str, values: Sequence[float], extent: Mapping[str, Any]) -> Iterator[str]:
    """The largest value beyond an extent, and of frequencies the least, each with how far it is beyond."""
    least, most, unit = extent["least"], extent["most"], extent["unit"]
    if values and max(values) > most * (1.0 + 1e-3):
        far = plain(max(values) / most)
        yield f"{_WORKS[name]} {format_quantity(max(values), unit, 3)}, {far} times the largest"
    if values and name == "frequency" and min(values) < least * (1.0 - 1e-3):
        far = plain(least / min(values))
        yield f"{_WORKS[name]} {format_quantity(min(values), unit, 3)}, {far} times below the least"


def _measured(record: Mapping[str, Any], beyond: Sequence[str]) -> Measured:
    by = {
        name: " to ".join(dict.fromkeys(format_quantity(each[end], each["unit"], 3) for end in ("least", "most")))
        for name, each in record["extents"].items()
    }
    errors = " and ".join(map(error_text, record["errors"]))
    part = f"{record['part'][0].upper()}{record['part'][1:]}"
    count = f"{record['inputs']} drive{'s' if record['inputs'] > 1 else ''}"
    known = (
        f"{part} was identified on recordings of another device, with {count} of {by['drive']} amplitude,"
        f" {by['frequency']} and {by['position']} of travel, sampled at {by['rate']}. On records that were held out the"
        f" model's error was {errors}."
    )
    follows = (
        f"This mission goes beyond that, with {'; '.join(beyond)}. There the error of the mirror model is not known."
        if beyond
        else "This mission lies within that: there the error of the mirror model is validated."
    )
    return Measured(record["part"], not beyond, tuple(beyond), f"{known} {follows}")


def error_text(error: Mapping[str, Any]) -> str:
    """An error on held-out records with what is allowed.

    Args:
        error: As the domains have it.
    """
    percent = error["unit"] == "%"
    value, allowed = (each if percent else 100.0 * each for each in (error["error"], error["allowed"]))
    return f"{value:.3g} % ({allowed:.3g} % allowed)"


def _values(sources: Mapping[str, Source], keys: Sequence[str], unit: str) -> list[float]:
    """The values that a mission states under keys, lists among them, in SI units."""
    texts = [
        text for key in keys if key in sources for text in re.findall(r'[^"\[\],]*\d[^"\[\],]*', sources[key].value)
    ]
    return [parse_quantity(text.strip(), unit) for text in texts]


def foundation_view(sources: Mapping[str, Source], signs: Points | None = None) -> View:
    """The part of a mission's report on how its numbers are founded.

    Args:
        sources: Of each value of the mission, by its dotted key.
        signs: What the signs behind its numbers mean.
    """
    beyond = placards(sources)
    rows = [
        (subject, *(str(counts.get(status, 0)) for status in _STATUSES))
        for subject, counts in shipped()["statuses"].items()
    ]
    table = Table("", ("quantities of", *_STATUSES), rows, folded="How many quantities have which status")
    lines = [] if signs is None else list(signs.lines)
    unsigned = [f"{each.text}." for each in beyond if not any(each.text in line for line in lines)]
    inside = "All inputs lie where the parts of the chain were held against independent methods."
    said: list[Block] = [] if beyond else [inside]
    said += ["Behind a number:"] if lines else []
    said += [Points([*lines, *unsigned])] if lines or unsigned else []
    about = Soft(
        "As found at the release. microrad verify runs the evidence in this installation, and has the comparisons, the"
        " domains and the sources one by one."
    )
    mirror = [Points([each.said for each in found])] if (found := measured(sources)) else []
    blocks = [_UNVALIDATED, *mirror, *said, table, about]
    return View("How these numbers are founded", blocks, "foundation")
