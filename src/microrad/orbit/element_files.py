"""Files of mean elements: one satellite or many, as two-line element sets or as mean-elements messages."""

import difflib
import re
from collections.abc import Iterator
from pathlib import Path

from microrad.orbit.base import OrbitError
from microrad.orbit.elements import ElementSet
from microrad.orbit.messages import read_text
from microrad.orbit.omm import csv_elements, json_elements, kvn_elements, xml_elements
from microrad.orbit.tle import two_lines


def read_elements(path: Path, name: str | None = None, data: bytes | None = None) -> tuple[ElementSet, ...]:
    """All element sets of a file, in its order; with `name`, those of the satellite with that name or number.

    With `data`, these are the bytes of the file, which is not read again.

    Raises `OrbitError` for a file that is not one of the formats, for the first fault in it with its line, and for a
    name that is not in it.
    """
    text = read_text(path, data)
    found = list(_parsed(path, text))
    if not found:
        raise OrbitError(f"{path}: no element set is in the file; give a TLE or an OMM")
    if name is None:
        return tuple(found)
    wanted, number = name.strip().casefold(), name.strip().casefold().lstrip("0")
    chosen = tuple(e for e in found if wanted == e.name.casefold() or number == e.catalogue_number.casefold())
    if not chosen:
        near = difflib.get_close_matches(wanted, [e.name.casefold() for e in found], 3, 0.0)
        likely = [next(e.name for e in found if e.name.casefold() == n) for n in near]
        raise OrbitError(
            f"{path}: none of its {len(found)} element sets is of {name!r}; nearest are {', '.join(likely)}: name one "
            "of them, or a catalogue number"
        )
    return chosen


def _parsed(path: Path, text: str) -> Iterator[ElementSet]:
    """Element sets in the format that the first characters tell."""
    first = next(line.strip() for line in text.split("\n") if line.strip())
    if first.startswith("<"):
        return xml_elements(path, text)
    if first.startswith(("{", "[")):
        return json_elements(path, text)
    if re.match(r"[A-Z_]+\s*=", first) or first.startswith("COMMENT"):
        return kvn_elements(path, text)
    if first.count(",") >= 5:  # a name has fewer
        return csv_elements(path, text)
    return two_lines(path, text)
