"""Mean elements for SGP4: two-line element sets (TLE) and orbit mean-elements messages (OMM), and the orbit they give.

A file holds one satellite or many: TLE with or without a line for the name, or OMM as keywords and values (KVN), XML,
JSON or CSV. Sources: Hoots & Roehrich 1980 (Spacetrack Report 3), Vallado et al. 2006 (AIAA 2006-6753), CCSDS 502.0-B-3
section 4. SGP4 is that of the package sgp4, with the constants WGS 72.
"""

import csv
import difflib
import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import date, timedelta
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

from microrad.orbit.base import Floats, OrbitError, States
from microrad.orbit.epoch import DAY_S, Epoch
from microrad.orbit.oem import Field, add_field, finite, kvn_field, read_text, utc_epoch, xml_fields

MOST_ELEMENTS_AGE_S = 14.0 * DAY_S
"""From the epoch of the elements to the time of a state, either way; further off SGP4 errs by tens of kilometres."""
LEAST_PERIGEE_HEIGHT_M = 120e3
"""Height of perigee below which drag ends an orbit within about a revolution."""

_SGP4_RADIUS_M = 6_378_135.0  # of WGS 72, over which SGP4 counts heights
_SGP4_EPOCH_JULIAN = 2433281.5  # 1949-12-31, from which sgp4init counts days
_LINE_CHARACTERS = 69
_MOST_NAME_CHARACTERS = 60
_REVOLUTION = 2.0 * math.pi

_DECAYED = "the satellite has decayed, or the time is too far from the epoch of the elements"
REASONS = {
    1: f"the mean eccentricity leaves 0 to 1: {_DECAYED}",
    2: f"the mean motion falls below zero: {_DECAYED}",
    3: f"the perturbed eccentricity leaves 0 to 1: {_DECAYED}",
    4: f"the semi-latus rectum falls below zero: {_DECAYED}",
    5: f"the orbit lies below the Earth's surface: {_DECAYED}",
    6: "the satellite is below the Earth's surface: it has decayed",
}
"""What the error codes of SGP4 mean."""


@dataclass(frozen=True, slots=True)
class ElementSet:
    """Mean elements of a satellite at an epoch, in the sense of SGP4 and in TEME.

    `mean_motion_rad_s` is Kozai's, as TLE and OMM state it; `drag_per_earth_radius` is B*, per radius of the Earth.
    `place` says where in which file the elements stand.
    """

    name: str
    catalogue_number: str
    epoch: Epoch
    mean_motion_rad_s: float
    eccentricity: float
    inclination_rad: float
    node_rad: float
    argument_of_perigee_rad: float
    mean_anomaly_rad: float
    drag_per_earth_radius: float
    place: str


# --------------------------------------------------------------------------------------------------------------- orbit
@dataclass(frozen=True, slots=True)
class Sgp4Orbit:
    """The orbit that SGP4 computes from an element set, in seconds since `epoch`; satisfies `Orbit`.

    Raises `OrbitError` for elements that SGP4 refuses, and for a perigee below `LEAST_PERIGEE_HEIGHT_M`.
    """

    elements: ElementSet
    epoch: Epoch
    elements_age_s: float = field(init=False)
    """From the epoch of the elements to that of the mission; negative when the elements are newer."""
    _satellite: Any = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Initialise SGP4."""
        object.__setattr__(self, "elements_age_s", self.elements.epoch.seconds_to(self.epoch))
        object.__setattr__(self, "_satellite", _satellite(self.elements))
        self._check_perigee(-self.elements_age_s)

    def __reduce__(self) -> tuple[type["Sgp4Orbit"], tuple[ElementSet, Epoch]]:
        """Copied to other processes by its elements: the satellite of the package sgp4 cannot be."""
        return Sgp4Orbit, (self.elements, self.epoch)

    @property
    def name(self) -> str:
        """The satellite's name; its catalogue number where the file has no name."""
        return self.elements.name

    def states(self, time_s: Floats) -> States:
        """States in TEME at `time_s`, of shape (3, n).

        Raises `OrbitError` where SGP4 reports an error, and further than `MOST_ELEMENTS_AGE_S` from the elements.
        """
        time = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
        self._check_times(time)
        days = (time + self.elements_age_s) / DAY_S + self._satellite.jdsatepochF
        error, position_km, velocity_km_s = self._satellite.sgp4_array(
            np.full(time.shape, self._satellite.jdsatepoch), days
        )
        if np.any(error):
            first = int(np.flatnonzero(error)[0])
            raise self._failed(int(error[first]), float(time[first]))
        position = np.ascontiguousarray(1000.0 * position_km.T)
        velocity = np.ascontiguousarray(1000.0 * velocity_km_s.T)
        if np.ndim(time_s) == 0:
            return States(position[:, 0], velocity[:, 0])
        return States(position, velocity)

    def require(self, start_s: float, end_s: float) -> None:
        """Raise `OrbitError` unless the elements hold from `start_s` to `end_s`: their age, and the height of perigee.

        The mean perigee is looked at each day and at both ends.
        """
        self._check_times(np.array([start_s, end_s]))
        for time_s in np.linspace(start_s, end_s, 2 + math.ceil(abs(end_s - start_s) / DAY_S)):
            self._check_perigee(float(time_s))

    def _check_times(self, time: Floats) -> None:
        if not time.size:
            return
        furthest = float(time[np.argmax(np.abs(time + self.elements_age_s))])
        if not math.isfinite(furthest):
            raise OrbitError(f"{self._where()}: a time is not a finite number; give seconds since {self.epoch.text}")
        age_s = furthest + self.elements_age_s
        if abs(age_s) > MOST_ELEMENTS_AGE_S + 1e-6:
            state = "expired" if age_s > 0 else "not valid yet"
            raise OrbitError(
                f"{self._where()}: the elements are {state}: their epoch is {self.elements.epoch.text}, the "
                f"mission's {self.epoch.text}, and {self.epoch.utc(furthest)} is {abs(age_s) / DAY_S:.1f} days from "
                f"the elements; SGP4 is trusted for {MOST_ELEMENTS_AGE_S / DAY_S:.0f} days: take "
                f"{'newer' if age_s > 0 else 'older'} elements, or set orbit.epoch near theirs"
            )

    def _check_perigee(self, time_s: float) -> None:
        """Refuse a mean perigee that is too low at a time; also what SGP4 itself refuses there."""
        satellite = self._satellite
        days = (time_s + self.elements_age_s) / DAY_S + satellite.jdsatepochF
        error, _, _ = satellite.sgp4(satellite.jdsatepoch, days)
        if error:
            raise self._failed(error, time_s)
        height_m = (satellite.am * (1.0 - satellite.em) - 1.0) * _SGP4_RADIUS_M
        if height_m < LEAST_PERIGEE_HEIGHT_M:
            raise OrbitError(
                f"{self._where()}: the perigee is {height_m / 1e3:.0f} km high at {self.epoch.utc(time_s)}; below "
                f"{LEAST_PERIGEE_HEIGHT_M / 1e3:.0f} km an orbit decays within about a revolution: choose another "
                "satellite, or an epoch before its decay"
            )

    def _failed(self, error: int, time_s: float) -> OrbitError:
        reason = REASONS.get(error, f"error {error}")
        return OrbitError(
            f"{self._where()}: SGP4 stops at {self.epoch.utc(time_s)}, {time_s + self.elements_age_s:.0f} s from the "
            f"epoch of the elements: {reason}; take newer elements or an earlier epoch"
        )

    def _where(self) -> str:
        return f"{self.elements.place} ({self.name})"


def sgp4_orbit(elements: ElementSet, epoch: Epoch) -> Sgp4Orbit:
    """The orbit of an element set for a mission that begins at `epoch`; raises `OrbitError` as `Sgp4Orbit` does."""
    return Sgp4Orbit(elements, epoch)


def _satellite(elements: ElementSet) -> Any:
    """The satellite as the package sgp4 has it."""
    from sgp4.api import WGS72, Satrec

    # Added in this order as the published code does: it rounds the epoch to 40 us, which moves the Moon by millimetres.
    days = sum(elements.epoch.julian_date) - _SGP4_EPOCH_JULIAN
    satellite = Satrec()
    satellite.sgp4init(
        WGS72, "i", 0, days, elements.drag_per_earth_radius, 0.0, 0.0,
        elements.eccentricity, elements.argument_of_perigee_rad, elements.inclination_rad, elements.mean_anomaly_rad,
        60.0 * elements.mean_motion_rad_s, elements.node_rad,
    )  # fmt: skip
    return satellite


# --------------------------------------------------------------------------------------------------------------- files
def read_elements(path: Path, name: str | None = None) -> tuple[ElementSet, ...]:
    """All element sets of a file, in its order; with `name`, those of the satellite with that name or number.

    Raises `OrbitError` for a file that is not one of the formats, for the first fault in it with its line, and for a
    name that is not in it.
    """
    text = read_text(path)
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


def closest_elements(sets: tuple[ElementSet, ...], epoch: Epoch) -> ElementSet:
    """The set whose epoch is nearest to `epoch` among sets of one satellite; raises `OrbitError` for several."""
    if len({e.catalogue_number for e in sets}) > 1:
        listed = ", ".join(f"{e.name} ({e.catalogue_number})" for e in sets[:8])
        raise OrbitError(
            f"{sets[0].place}: {len(sets)} element sets of different satellites, {listed}"
            f"{' and others' if len(sets) > 8 else ''}; name one of them, by its number where names repeat"
        )
    return min(sets, key=lambda e: abs(e.epoch.seconds_to(epoch)))


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


# ----------------------------------------------------------------------------------------------------------------- TLE
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


def _two_lines(path: Path, text: str) -> Iterator[ElementSet]:
    """Element sets of two lines each, with or without a line before them that holds the name."""
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
    _check_type(where, one[62].strip())
    catalogue = one[2:7].strip().lstrip("0") or "0"
    degrees = [math.radians(float(two[a:b])) for a, b in ((8, 16), (17, 25), (34, 42), (43, 51))]
    elements = ElementSet(
        name=name[1] if name else catalogue,
        catalogue_number=catalogue,
        epoch=_tle_epoch(where, one[18:20], one[20:32].strip()),
        mean_motion_rad_s=float(two[52:63]) * _REVOLUTION / DAY_S,
        eccentricity=float("0." + two[26:33].replace(" ", "0")),
        inclination_rad=degrees[0],
        node_rad=degrees[1],
        argument_of_perigee_rad=degrees[2],
        mean_anomaly_rad=degrees[3],
        drag_per_earth_radius=_with_exponent(one[53:61]),
        place=where,
    )
    return _checked(elements)


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


def _check_type(where: str, kind: str) -> None:
    """Refuse elements that are not of SGP4 (0, 2 or blank; 3 for its deep-space part)."""
    if kind not in ("", "0", "2", "3"):
        raise OrbitError(
            f"{where}: the type of the ephemeris is {kind}, elements of another theory than SGP4 (4 is SGP4-XP), which "
            "SGP4 would misread by kilometres; take elements of type 0"
        )


def _checked(elements: ElementSet) -> ElementSet:
    """The elements when they are those of a closed orbit."""
    ranges = (
        ("eccentricity", elements.eccentricity, 0.0, 1.0, "at least 0 and below 1"),
        ("inclination", math.degrees(elements.inclination_rad), 0.0, 180.0 + 1e-9, "0 to 180 deg"),
        ("mean motion", elements.mean_motion_rad_s * DAY_S / _REVOLUTION, 1e-3, 20.0, "0.001 to 20 revolutions a day"),
    )
    for what, value, low, high, words in ranges:
        if not low <= value < high:
            raise OrbitError(
                f"{elements.place} ({elements.name}): the {what} is {value:.8g}, and an orbit about the Earth has "
                f"{words}; download the elements again"
            )
    return elements


# ----------------------------------------------------------------------------------------------------------------- OMM
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
        _check_type(where, given["EPHEMERIS_TYPE"].value if "EPHEMERIS_TYPE" in given else "")
        yield _checked(_of_message(path, where, given))


def _of_message(path: Path, where: str, given: dict[str, Field]) -> ElementSet:
    def degrees(key: str) -> float:
        return math.radians(finite(path, given[key]))

    return ElementSet(
        name=given["OBJECT_NAME"].value,
        catalogue_number=given["NORAD_CAT_ID"].value.lstrip("0") or "0",
        epoch=utc_epoch(path, given["EPOCH"]),
        mean_motion_rad_s=finite(path, given["MEAN_MOTION"]) * _REVOLUTION / DAY_S,
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
