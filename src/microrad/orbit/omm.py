"""Orbit mean-elements messages (OMM) as keywords and values (KVN), XML, JSON or CSV.

Source: CCSDS 502.0-B-3, Orbit Data Messages, section 4; JSON and CSV as the public catalogues write them.
"""

import csv
import json
import math
from collections.abc import Iterator
from pathlib import Path

from microrad.orbit.base import OrbitError
from microrad.orbit.elements import REVOLUTION_RAD, ElementSet, check_theory, checked
from microrad.orbit.epoch import DAY_S
from microrad.orbit.instants import utc_epoch
from microrad.orbit.messages import Field, add_field, finite, kvn_field, xml_fields

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


def kvn_elements(path: Path, text: str) -> Iterator[ElementSet]:
    """Element sets of messages in keywords and values; raises `OrbitError` for the first fault, with its line."""
    return _messages(path, _kvn_messages(path, text), complete=True)


def xml_elements(path: Path, text: str) -> Iterator[ElementSet]:
    """Element sets of messages in XML; raises `OrbitError` for the first fault, with its line."""
    return _messages(path, _xml_messages(path, text), complete=True)


def json_elements(path: Path, text: str) -> Iterator[ElementSet]:
    """Element sets of messages in JSON; raises `OrbitError` for the first fault, with its entry."""
    return _messages(path, _json_messages(path, text), complete=False)


def csv_elements(path: Path, text: str) -> Iterator[ElementSet]:
    """Element sets of messages in CSV; raises `OrbitError` for the first fault, with its line."""
    return _messages(path, _csv_messages(path, text), complete=False)


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
        yield checked(_of_message(path, where, given))


def _of_message(path: Path, where: str, given: dict[str, Field]) -> ElementSet:
    def degrees(key: str) -> float:
        return math.radians(finite(path, given[key]))

    return ElementSet(
        name=given["OBJECT_NAME"].value,
        catalogue_number=given["NORAD_CAT_ID"].value.lstrip("0") or "0",
        epoch=utc_epoch(path, given["EPOCH"]),
        mean_motion_rad_s=finite(path, given["MEAN_MOTION"]) * REVOLUTION_RAD / DAY_S,
        eccentricity=finite(path, given["ECCENTRICITY"]),
        inclination_rad=degrees("INCLINATION"),
        node_rad=degrees("RA_OF_ASC_NODE"),
        argument_of_perigee_rad=degrees("ARG_OF_PERICENTER"),
        mean_anomaly_rad=degrees("MEAN_ANOMALY"),
        drag_per_earth_radius=finite(path, given["BSTAR"]),
        place=where,
    )


def _kvn_messages(path: Path, text: str) -> Iterator[tuple[str, dict[str, Field]]]:
    """Messages in keywords and values, each of which begins with CCSDS_OMM_VERS."""
    place, fields = "", dict[str, Field]()
    for number, line in enumerate(text.split("\n"), 1):
        if not line.strip() or line.split()[0] == "COMMENT":
            continue
        given = kvn_field(path, number, line)
        if given.key == "CCSDS_OMM_VERS":
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
            place, fields = given.place, {}
        elif given.key == "</omm":
            yield place, fields
            place = ""
        elif place and given.key[0] != "<":
            add_field(fields, given, path)


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
        yield (
            place,
            {
                k.upper(): Field(k, str(v), "", place)
                for k, v in record.items()
                if isinstance(v, str | int | float) and not isinstance(v, bool)
            },
        )


def _csv_messages(path: Path, text: str) -> Iterator[tuple[str, dict[str, Field]]]:
    """Messages in CSV: keys in the first line, a satellite in each of the others."""
    rows = csv.reader(text.lstrip("\n").split("\n"))
    skipped = len(text) - len(text.lstrip("\n"))
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
            yield place, {k: Field(k, v.strip(), "", place) for k, v in zip(keys, values, strict=True)}
    except csv.Error as error:
        raise OrbitError(
            f"{path}, line {rows.line_num + skipped}: not CSV ({error}); download the file again"
        ) from None
