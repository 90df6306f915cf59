"""Two-line element sets (TLE), with or without a line for the name.

Source: Hoots & Roehrich 1980 (Spacetrack Report 3).
"""

import math
import re
from collections.abc import Iterator
from datetime import date, timedelta
from decimal import Decimal
from pathlib import Path

from microrad.orbit.base import OrbitError
from microrad.orbit.elements import REVOLUTION_RAD, ElementSet, check_theory, checked
from microrad.orbit.epoch import DAY_S, Epoch

_LINE_CHARACTERS = 69
_MOST_NAME_CHARACTERS = 60

# columns counted from 0, what stands there, and how it must look
_NUMBER = r" *[-+]?\d*\.\d+ *"
_RATE = r"[-+ ][ \d]{5}[-+ ]\d"
_TLE_FIELDS = {
    "1": (
        (2, 7, "catalogue number", r" *\d+|[A-HJ-NP-Z]\d{4}"), (18, 20, "year of the epoch", r"[ \d]\d"),
        (20, 32, "day of the epoch", r"[ \d]{2}\d\.\d{1,8} *"),
        (33, 43, "first derivative of the mean motion", _NUMBER),
        (44, 52, "second derivative of the mean motion", _RATE), (53, 61, "drag term B*", _RATE),
        (62, 63, "type of the ephemeris", r"[ \d]"), (64, 68, "number of the element set", r"[ \d]{4}"),
    ),
    "2": (
        (2, 7, "catalogue number", r" *\d+|[A-HJ-NP-Z]\d{4}"), (8, 16, "inclination", _NUMBER),
        (17, 25, "right ascension of the node", _NUMBER), (26, 33, "eccentricity", r" *\d+"),
        (34, 42, "argument of perigee", _NUMBER), (43, 51, "mean anomaly", _NUMBER), (52, 63, "mean motion", _NUMBER),
        (63, 68, "number of the revolution", r"[ \d]{5}"),
    ),
}  # fmt: skip


def checksum(line: str) -> int:
    """Sum of the digits of the first 68 characters, a minus counting 1, modulo 10 (Spacetrack Report 3)."""
    return sum(int(c) if c in "0123456789" else c == "-" for c in line[:68]) % 10


def two_lines(path: Path, text: str) -> Iterator[ElementSet]:
    """Element sets of two lines each, with or without a line before them that holds the name.

    Raises `OrbitError` for the first fault, with its line.
    """
    name: tuple[int, str] | None = None
    first: tuple[int, str] | None = None
    for number, whole in enumerate(text.split("\n"), 1):
        line = whole.rstrip()
        if not line or line.startswith("#"):
            continue
        if first is not None:
            _check_line(path, number, line, "2")
            yield _element_set(path, name, first, (number, line))
            name = first = None
        elif line.startswith("1 ") and len(line) > _MOST_NAME_CHARACTERS // 2:
            _check_line(path, number, line, "1")
            first = number, line
        elif name is not None or len(line) > _MOST_NAME_CHARACTERS or line.startswith("2 "):
            _check_line(path, number, line, "1")
        else:
            name = number, line.removeprefix("0 ").strip()
    if first is not None or name is not None:
        where, missing = (first[0], "line 2") if first is not None else (name[0] if name else 0, "line 1")
        raise OrbitError(
            f"{path}, line {where}: the file ends where {missing} of an element set must follow; it is cut off, or "
            "no element set: download it again"
        )


def _check_line(path: Path, number: int, line: str, kind: str) -> None:
    """Refuse a line that is not line 1 or 2 (`kind`) of an element set, as long and as summed as it must be."""
    where = f"{path}, line {number}"
    if not line.startswith(f"{kind} "):
        raise OrbitError(
            f"{where}: line {kind} of an element set must stand here and begin with '{kind} ', but the line begins "
            f"with {line[:12]!r}; restore the line, with its number"
        )
    if len(line) != _LINE_CHARACTERS:
        raise OrbitError(
            f"{where}: line {kind} of an element set has {_LINE_CHARACTERS} characters, this one {len(line)}; copy it "
            "whole, with all its spaces"
        )
    for start, end, what, pattern in _TLE_FIELDS[kind]:
        if not line.isascii() or not re.fullmatch(pattern, line[start:end]):
            raise OrbitError(
                f"{where}: the {what} in columns {start + 1} to {end} is {line[start:end]!r}, and digits belong there; "
                "download the elements again"
            )
    if line[68] != str(checksum(line)):
        raise OrbitError(
            f"{where}: the checksum of line {kind} is {line[68]}, but its characters sum to {checksum(line)}; a "
            "character is wrong: download the elements again"
        )


def _element_set(
    path: Path, name: tuple[int, str] | None, first: tuple[int, str], second: tuple[int, str]
) -> ElementSet:
    """The elements of two checked lines."""
    (number, one), (_, two) = first, second
    where = f"{path}, line {number}"
    if one[2:7] != two[2:7]:
        raise OrbitError(
            f"{where}: line 1 is of catalogue number {one[2:7].strip()}, the line below it of {two[2:7].strip()}; put "
            "the two lines of one satellite together"
        )
    check_theory(where, one[62].strip())
    catalogue = one[2:7].strip().lstrip("0") or "0"
    degrees = [math.radians(float(two[a:b])) for a, b in ((8, 16), (17, 25), (34, 42), (43, 51))]
    elements = ElementSet(
        name=name[1] if name else catalogue,
        catalogue_number=catalogue,
        epoch=_tle_epoch(where, one[18:20], one[20:32].strip()),
        mean_motion_rad_s=float(two[52:63]) * REVOLUTION_RAD / DAY_S,
        eccentricity=float("0." + two[26:33].replace(" ", "0")),
        inclination_rad=degrees[0],
        node_rad=degrees[1],
        argument_of_perigee_rad=degrees[2],
        mean_anomaly_rad=degrees[3],
        drag_per_earth_radius=_with_exponent(one[53:61]),
        place=where,
    )
    return checked(elements)


def _with_exponent(text: str) -> float:
    """Number of a field such as "-12345-6", which is -0.12345e-6."""
    return float(f"{text[0].strip()}.{text[1:6].replace(' ', '0')}e{text[6:].replace(' ', '+')}")


def _tle_epoch(where: str, year: str, day: str) -> Epoch:
    """The epoch of a year in two digits (57 to 99 are of the last century) and a day with its fraction."""
    full = int(year) + (1900 if int(year) >= 57 else 2000)
    whole, _, digits = day.partition(".")
    second = Decimal("0." + digits) * 86400
    try:
        if not 1 <= int(whole) <= 366:
            raise OrbitError("the day of the year must be from 1 to 366")
        hours, rest = divmod(second, 3600)
        clock = f"{int(hours):02d}:{int(rest // 60):02d}:{rest % 60:012.9f}"
        return Epoch.from_text(f"{date(full, 1, 1) + timedelta(int(whole) - 1)}T{clock}Z")
    except OrbitError as error:
        raise OrbitError(
            f"{where}: the epoch, day {day} of {full}, is refused: {error}; download the elements again"
        ) from None
