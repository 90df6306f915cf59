"""Files of mean elements: two-line element sets (TLE), and mean-elements messages (OMM) as KVN, XML, JSON or CSV.

Sources: Hoots & Roehrich 1980 (Spacetrack Report 3); CCSDS 502.0-B-3, Orbit Data Messages, section 4; JSON and CSV as
the public catalogues write them.
"""

import csv
import difflib
import json
import math
import re
from collections.abc import Iterator
from datetime import date, timedelta
from decimal import Decimal
from pathlib import Path

from microrad.orbit.base import OrbitError
from microrad.orbit.earth.epoch import DAY_S, Epoch
from microrad.orbit.files.messages import (
    Field,
    add_field,
    check_version,
    finite,
    kvn_field,
    read_text,
    utc_epoch,
    xml_fields,
)
from microrad.orbit.propagation.mean_elements import REVOLUTION_RAD, ElementSet, check_theory, checked


def read_elements(path: str | Path, name: str | None = None, data: bytes | None = None) -> tuple[ElementSet, ...]:
    """All element sets of a TLE or OMM file in its order, or those of one satellite.

    Args:
        path: The file, in one of the formats of TLE and OMM.
        name: Name or catalogue number of the satellite; None for all.
        data: The bytes of the file, where it was read already; it is then not read again.

    Raises:
        OrbitError: For a file that is not one of the formats, for the first fault in it with its line, and for a name
            that is not in it.

    Example:
        ```python
        import microrad

        for elements in microrad.read_elements("satellites.tle"):
            print(elements.name, elements.epoch.text, elements.eccentricity)
        ```
    """
    path = Path(path)
    text = read_text(path, data)
    found = list(_parsed(path, text))
    if not found:
        raise OrbitError(f"{path}: no element set is in the file; give a TLE or an OMM")
    if name is None:
        return tuple(found)
    wanted, number = name.strip().casefold(), name.strip().casefold().lstrip("0") or "0"
    chosen = tuple(e for e in found if wanted == e.name.casefold() or number == e.catalogue_number.casefold())
    if not chosen:
        near = difflib.get_close_matches(wanted, list({e.name.casefold(): e for e in found}), 3, 0.0)
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
        return _messages(path, _xml_messages(path, text), complete=True)
    if first.startswith(("{", "[")):
        return _messages(path, _json_messages(path, text), complete=False)
    if re.match(r"[A-Z_]+\s*=", first) or first.startswith("COMMENT"):
        return _messages(path, _kvn_messages(path, text), complete=True)
    if first.count(",") >= 5:  # a name has fewer
        return _messages(path, _csv_messages(path, text), complete=False)
    return _two_lines(path, text)


# ------------------------------------------------------------------------------------------------------------ two lines
_LINE_CHARACTERS = 69
_MOST_NAME_CHARACTERS = 60

# columns counted from 0, what stands there, and how it must look
_NUMBER = r" *[-+]?\d*\.\d+ *"
_RATE = r"[-+ ][ \d]{5}[-+ ]\d"
_TLE_FIELDS = {
    "1": (
        (2, 7, "catalogue number", r" *\d+|[A-HJ-NP-Z]\d{4}"), (18, 20, "year of the epoch", r"[ \d]\d"),
        (20, 32, "day of the epoch", r"( {2}| \d|\d\d)\d\.\d{1,8} *"),
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


def _two_lines(path: Path, text: str) -> Iterator[ElementSet]:
    """Element sets of two lines each, with or without a line before them that holds the name.

    Raises OrbitError for the first fault, with its line.
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
    """Raises OrbitError unless this is line 1 or 2 (`kind`) of an element set, with its length and its checksum."""
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
    drag = one[53:61]  # such as "-12345-6", which is -0.12345e-6
    degrees = [math.radians(float(two[a:b])) for a, b in ((8, 16), (17, 25), (34, 42), (43, 51))]
    return checked(
        ElementSet(
            name=name[1] if name else catalogue,
            catalogue_number=catalogue,
            epoch=_tle_epoch(where, one[18:20], one[20:32].strip()),
            mean_motion_rad_s=float(two[52:63]) * REVOLUTION_RAD / DAY_S,
            eccentricity=float("0." + two[26:33].replace(" ", "0")),
            inclination_rad=degrees[0],
            node_rad=degrees[1],
            argument_of_perigee_rad=degrees[2],
            mean_anomaly_rad=degrees[3],
            drag_per_earth_radius=float(
                f"{drag[0].strip()}.{drag[1:6].replace(' ', '0')}e{drag[6:].replace(' ', '+')}"
            ),
            place=where,
        )
    )


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
        return Epoch(f"{date(full, 1, 1) + timedelta(int(whole) - 1)}T{clock}Z")
    except OrbitError as error:
        raise OrbitError(
            f"{where}: the epoch, day {day} of {full}, is refused: {error}; download the elements again"
        ) from None


# ------------------------------------------------------------------------------------------------------------- messages
_EXPECTED = {
    "CENTER_NAME": ("EARTH",),
    "REF_FRAME": ("TEME", "TEMEOFDATE"),
    "TIME_SYSTEM": ("UTC",),
    "MEAN_ELEMENT_THEORY": ("SGP4", "SGP/SGP4"),
}
_UNITS = {
    "MEAN_MOTION": "rev/day", "INCLINATION": "deg", "RA_OF_ASC_NODE": "deg", "ARG_OF_PERICENTER": "deg",
    "MEAN_ANOMALY": "deg", "BSTAR": "1/ER",
}  # fmt: skip
_NEEDED = ("OBJECT_NAME", "NORAD_CAT_ID", "EPOCH", "ECCENTRICITY", *_UNITS)


def _messages(path: Path, found: Iterator[tuple[str, dict[str, Field]]], complete: bool) -> Iterator[ElementSet]:
    """Element sets of messages, each with its place; the metadata may be absent unless `complete`.

    JSON and CSV files of the public catalogues leave out what is the same for all.
    """
    for place, given in found:
        where = f"{path}, {place}"
        for key in (*(_EXPECTED if complete else ()), *_NEEDED):
            if key not in given or not given[key].value:
                raise OrbitError(f"{where}: {key} is missing in this mean-elements message; add it or export it again")
        for key, allowed in _EXPECTED.items():
            if key in given and given[key].value.upper() not in allowed:
                raise OrbitError(
                    f"{path}, {given[key].place}: {key} is {given[key].shown}; SGP4 takes {' or '.join(allowed)}: "
                    "export the elements so"
                )
        for key, unit in _UNITS.items():
            if given[key].unit.lower() not in ("", unit.lower()):
                raise OrbitError(f"{path}, {given[key].place}: {key} is in {given[key].unit!r}; write it in {unit!r}")
        check_theory(where, given["EPHEMERIS_TYPE"].value if "EPHEMERIS_TYPE" in given else "")
        yield checked(
            ElementSet(
                name=given["OBJECT_NAME"].value,
                catalogue_number=given["NORAD_CAT_ID"].value.lstrip("0") or "0",
                epoch=utc_epoch(path, given["EPOCH"]),
                mean_motion_rad_s=finite(path, given["MEAN_MOTION"]) * REVOLUTION_RAD / DAY_S,
                eccentricity=finite(path, given["ECCENTRICITY"]),
                inclination_rad=math.radians(finite(path, given["INCLINATION"])),
                node_rad=math.radians(finite(path, given["RA_OF_ASC_NODE"])),
                argument_of_perigee_rad=math.radians(finite(path, given["ARG_OF_PERICENTER"])),
                mean_anomaly_rad=math.radians(finite(path, given["MEAN_ANOMALY"])),
                drag_per_earth_radius=finite(path, given["BSTAR"]),
                place=where,
            )
        )


def _kvn_messages(path: Path, text: str) -> Iterator[tuple[str, dict[str, Field]]]:
    """Messages in keywords and values, each of which begins with CCSDS_OMM_VERS."""
    place, fields = "", dict[str, Field]()
    for number, line in enumerate(text.split("\n"), 1):
        if not line.strip() or line.split()[0] == "COMMENT":
            continue
        given = kvn_field(path, number, line)
        if given.key == "CCSDS_OMM_VERS":
            check_version(path, given, given.key)
            if fields:
                yield place, fields
            place, fields = given.place, {}
        elif not place:
            raise OrbitError(
                f"{path}, {given.place}: the file begins with {given.key}, not with CCSDS_OMM_VERS; give a CCSDS Orbit "
                "Mean-Elements Message, and an ephemeris (OEM) by its own key"
            )
        add_field(fields, given, path)
    yield place, fields


def _xml_messages(path: Path, text: str) -> Iterator[tuple[str, dict[str, Field]]]:
    """Messages in XML: the elements of each <omm> without children."""
    place, fields = "", dict[str, Field]()
    for given in xml_fields(path, text):
        if given.key == "<omm":
            check_version(path, given, "CCSDS_OMM_VERS")
            place, fields = given.place, {}
        elif given.key == "</omm":
            yield place, fields
            place = ""
        elif place and given.key[0] != "<":
            add_field(fields, given, path)


def _by_key(path: Path, given: list[Field]) -> dict[str, Field]:
    fields = dict[str, Field]()
    for each in given:
        add_field(fields, each, path)
    return fields


def _json_messages(path: Path, text: str) -> Iterator[tuple[str, dict[str, Field]]]:
    """Messages in JSON: an object or a list of them."""
    try:
        data = json.loads(text)
    except json.JSONDecodeError as error:
        raise OrbitError(f"{path}, line {error.lineno}: not JSON ({error.msg}); download the file again") from None
    except (RecursionError, ValueError):
        raise OrbitError(
            f"{path}: JSON nested too deeply or a number too long for element sets; give OMM records"
        ) from None
    for entry, record in enumerate(data if isinstance(data, list) else [data], 1):
        place = f"entry {entry}"
        if not isinstance(record, dict):
            raise OrbitError(
                f"{path}, {place}: {str(record)[:40]!r} is not an object with the keys of an OMM; repair it"
            )
        plain = {k: v for k, v in record.items() if isinstance(v, str | int | float) and not isinstance(v, bool)}
        yield place, _by_key(path, [Field(k.upper(), str(v), "", place) for k, v in plain.items()])


def _csv_messages(path: Path, text: str) -> Iterator[tuple[str, dict[str, Field]]]:
    """Messages in CSV: keys in the first line, a satellite in each of the others."""
    rows = csv.reader(text.lstrip().split("\n"))
    skipped = text[: len(text) - len(text.lstrip())].count("\n")
    try:
        keys = [key.strip().upper() for key in next(rows)]
        for values in rows:
            place = f"line {rows.line_num + skipped}"
            if not any(values):
                continue
            if len(values) != len(keys):
                raise OrbitError(
                    f"{path}, {place}: {len(values)} values, but the first line names {len(keys)} columns; repair it"
                )
            yield place, _by_key(path, [Field(k, v.strip(), "", place) for k, v in zip(keys, values, strict=True)])
    except csv.Error as error:
        raise OrbitError(
            f"{path}, line {rows.line_num + skipped}: not CSV ({error}); download the file again"
        ) from None
