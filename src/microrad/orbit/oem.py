"""Ephemeris files: CCSDS Orbit Ephemeris Message (OEM), versions 1 to 3, as keywords and values (KVN) or as XML.

State vectors are turned into TEME once, when the file is read, and interpolated between them as the file asks; nothing
is extrapolated. Source: CCSDS 502.0-B-3, Orbit Data Messages, section 5. The first part of this module reads the two
notations, which orbit mean-elements messages share.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import date
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

import numpy as np

from microrad.orbit.base import Floats, OrbitError, States
from microrad.orbit.earth import ROTATION_RAD_S
from microrad.orbit.epoch import DAY_S, Epoch

MOST_BYTES = 50_000_000
"""Largest file that is read: a state vector each second for four days, or each minute for most of a year."""
DEFAULT_DEGREE = 7
"""Degree of the Hermite interpolation of a file that names no method: four state vectors around each time."""
DEGREES = (3, 25)
"""Degrees of interpolation that are taken: below, the track between points is not an orbit's; above, rounding grows."""

_BLOCK = 1 << 16  # characters of XML parsed at a time
_MOST_LINE = 1000  # characters of a line of keywords; matching takes their square
_SLACK_S = 1e-6  # rounding of times at the ends of a span
_KNOT_S = 10800.0  # between two rotations of a frame; nutation changes over days
_TIMES_AT_ONCE = 4096  # interpolated; what they take stays in the cache of the processor
_KNOTS_AT_ONCE = 2048  # bounds the memory that the series of nutation takes
_RADII_M = (6_356_000.0, 1.5e9)  # from the surface at the poles to where the Earth's gravity ceases to lead
_AHEAD_OF_TAI_S = {"TAI": 0.0, "TT": 32.184, "TDT": 32.184, "GPS": -19.0}
_Y2K = Epoch("2000-01-01T00:00:00Z")
_Y2K_TAI_MINUS_UTC_S = 32.0
_REQUIRED = ("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM", "START_TIME", "STOP_TIME")
_COLUMNS = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
_KVN = re.compile(r"\s*([A-Za-z]\w*)\s*=\s*(?:([-+.\d][^\[\]]*?)\s*\[([^\[\]]*)\]|(.*?))\s*")  # a unit follows a number
_CLOCK = re.compile(r"([0-9]{2}):([0-9]{2}):([0-9]{2}(?:\.[0-9]*)?)(Z?)")
_FRAMES = {"TEMEOFDATE": "TEME", "J2000": "EME2000", "TOD_EARTH": "TOD"}


# --------------------------------------------------------------------------------------------------- text of a message
class Field(NamedTuple):
    """A key with its value as text, its unit where one is written, and its place in the file, such as "line 12"."""

    key: str
    value: str
    unit: str
    place: str

    @property
    def shown(self) -> str:
        """The value for a message, in quotes and not longer than a line."""
        return repr(self.value if len(self.value) <= 60 else self.value[:57] + "...")


def read_text(path: Path) -> str:
    """Text of a file in UTF-8, lines ending in a newline; raises `OrbitError` for one that is none, or too large."""
    try:
        if not path.is_file():
            raise OrbitError(f"{path}: there is no such file; check the path, relative to the current folder")
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise OrbitError(
                f"{path}: {size / 1e6:.0f} MB, more than the {MOST_BYTES / 1e6:.0f} MB that are read; keep only the "
                "satellites and the days that the mission needs"
            )
        data = path.read_bytes()
    except OSError as error:
        raise OrbitError(f"{path}: cannot be read ({error.strerror}); check the permissions of the file") from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise _binary(path, error.start) from None
    if "\0" in text:
        raise _binary(path, data.index(b"\0"))
    if not text.strip():
        raise OrbitError(f"{path}: the file is empty; download or export it again")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _binary(path: Path, byte: int) -> OrbitError:
    return OrbitError(
        f"{path}: byte {byte + 1} is not text in UTF-8, so this is a binary or a compressed file; unpack it, or export "
        "element sets (TLE, OMM) or an ephemeris (OEM) as text"
    )


def kvn_field(path: Path, number: int, line: str) -> Field:
    """The key, value and unit of a line `KEY = value [unit]`; raises `OrbitError` for any other line."""
    match = _KVN.fullmatch(line) if len(line) <= _MOST_LINE else None
    if match is None:
        raise OrbitError(
            f"{path}, line {number}: {line.strip()[:60]!r} is neither 'KEY = value' nor a keyword that may stand here; "
            "repair or remove the line"
        )
    return Field(match[1].upper(), match[2] or match[4] or "", match[3] or "", f"line {number}")


def add_field(fields: dict[str, Field], new: Field, path: Path) -> None:
    """Put a field among the others; raises `OrbitError` when its key is there with another value."""
    if new.key == "COMMENT" or new.key.startswith("USER_DEFINED"):
        return
    old = fields.setdefault(new.key, new)
    if old.value != new.value:
        raise OrbitError(
            f"{path}, {new.place}: {new.key} is {new.shown}, but {old.place} has {old.shown}; keep one of them"
        )


class _XmlReader:
    """Turns the events of the parser into fields; containers become fields with the keys `<tag` and `</tag`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.found: list[Field] = []
        self.open: list[tuple[str, str, str]] = []  # tag, unit, place
        self.text: list[str] = []
        self.leaf = False
        self.parser = expat.ParserCreate()
        self.parser.StartDoctypeDeclHandler = self._doctype
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self.text.append

    def _doctype(self, *_: object) -> None:
        # Entities that expand without end need a document type to be declared in; CCSDS messages have none.
        raise OrbitError(
            f"{self.path}, line {self.parser.CurrentLineNumber}: a document type (DOCTYPE) is declared, which no CCSDS "
            "message has and which can make a parser expand text without end; remove it"
        )

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        if self.leaf:
            outer, _, place = self.open[-1]
            self.found.append(Field(f"<{outer}", "", "", place))
        tag = tag.rsplit(":", 1)[-1]
        place = f"line {self.parser.CurrentLineNumber}"
        self.open.append((tag, attributes.get("units", attributes.get("version", "")), place))
        self.text.clear()
        self.leaf = True

    def _end(self, _: str) -> None:
        tag, unit, place = self.open.pop()
        if self.leaf:
            self.found.append(Field(tag, "".join(self.text).strip(), unit, place))
        else:
            self.found.append(Field(f"</{tag}", "", "", place))
        self.leaf = False


def xml_fields(path: Path, text: str) -> Iterator[Field]:
    """The elements of an XML text in their order: those without children as fields, others as `<tag` and `</tag`.

    Raises `OrbitError` for text that is not well formed, and for any document type.
    """
    reader = _XmlReader(path)
    for start in range(0, len(text) + 1, _BLOCK):
        try:
            reader.parser.Parse(text[start : start + _BLOCK], start + _BLOCK > len(text))
        except expat.ExpatError as error:
            raise OrbitError(
                f"{path}, line {error.lineno}: not well-formed XML ({expat.ErrorString(error.code)}); the file may be "
                "cut off: download or export it again"
            ) from None
        yield from reader.found
        reader.found.clear()


def finite(path: Path, given: Field) -> float:
    """The number of a field; raises `OrbitError` for anything else, nan and inf among it."""
    try:
        number = float(given.value) if "_" not in given.value else math.nan
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise OrbitError(
            f"{path}, {given.place}: {given.key} is {given.shown}, not a finite number; write one such as 12.5 or "
            "1.25e1"
        )
    return number


@lru_cache(maxsize=1024)
def _ordinal(text: str) -> int:
    """Ordinal of a day written as 2026-03-20 or as 2026-079, the number of the day in its year."""
    if re.fullmatch(r"[0-9]{4}-[0-9]{3}", text):
        first = date(int(text[:4]), 1, 1).toordinal()
        day = first + int(text[5:]) - 1
        if date.fromordinal(day).year != int(text[:4]) or int(text[5:]) < 1:
            raise ValueError("no such day of the year")
        return day
    if not re.fullmatch(r"[0-9]{4}-[0-9]{2}-[0-9]{2}", text):
        raise ValueError("not a date")
    return date.fromisoformat(text).toordinal()


def instant(path: Path, given: Field, system: str) -> tuple[int, float]:
    """Ordinal of the day and seconds in it of a time code of CCSDS 301.0-B, A or B; raises `OrbitError`."""
    day, _, clock = given.value.partition("T")
    match = _CLOCK.fullmatch(clock)
    try:
        ordinal = _ordinal(day)
    except ValueError:
        match = None
    if match is None or int(match[1]) > 23 or int(match[2]) > 59 or float(match[3]) >= 61.0:
        raise OrbitError(
            f"{path}, {given.place}: {given.key} is {given.shown}, not a date and time; write it as "
            "2026-03-20T12:00:00.000 or 2026-079T12:00:00.000"
        )
    if match[4] and system != "UTC":
        raise OrbitError(
            f"{path}, {given.place}: {given.key} is {given.shown} and ends in Z, which means UTC, but TIME_SYSTEM is "
            f"{system}; remove the Z or correct TIME_SYSTEM"
        )
    if float(match[3]) >= 60.0:
        _check_leap_second(path, given, ordinal, match, system)
    return ordinal, int(match[1]) * 3600 + int(match[2]) * 60 + float(match[3])


def _plain_instant(text: str) -> tuple[int, float] | None:
    """As `instant`, quickly, for 2026-03-20T12:00:00 with any decimals; None for all that looks otherwise."""
    second = text[17:]
    if text[10:11] != "T" or text[16:17] != ":" or not second.replace(".", "", 1).isdecimal() or not text.isascii():
        return None
    try:
        day, minute = _ordinal(text[:10]), _minutes(text[11:16])
    except ValueError:
        return None
    return (day, 60 * minute + float(second)) if float(second) < 60.0 else None


@lru_cache(maxsize=1440)
def _minutes(text: str) -> int:
    """Minutes of the day of a clock such as 12:34."""
    if not re.fullmatch("([01][0-9]|2[0-3]):[0-5][0-9]", text):
        raise ValueError("not a time of the day")
    return 60 * int(text[:2]) + int(text[3:])


def _check_leap_second(path: Path, given: Field, day: int, match: re.Match[str], system: str) -> None:
    """Refuse second 60 but in a leap second of UTC."""
    try:
        if system != "UTC":
            raise OrbitError(f"{system} has no leap seconds")
        Epoch.from_text(f"{date.fromordinal(day)}T{match[1]}:{match[2]}:60Z")
    except OrbitError as error:
        raise OrbitError(
            f"{path}, {given.place}: {given.key} is {given.shown}, a second that does not exist: {error}"
        ) from None


def utc_epoch(path: Path, given: Field) -> Epoch:
    """The instant of a field in UTC; raises `OrbitError` with its place."""
    day, _ = instant(path, given, "UTC")
    clock = given.value.partition("T")[2].rstrip("Z").rstrip(".")
    try:
        return Epoch.from_text(f"{date.fromordinal(day)}T{clock}Z")
    except OrbitError as error:
        raise OrbitError(f"{path}, {given.place}: {given.key}: {error}") from None


# ------------------------------------------------------------------------------------------------------------ segments
@dataclass(slots=True)
class _Draft:
    """A segment as it is read: its metadata, and a place, a time and six numbers for each state vector."""

    place: str
    metadata: dict[str, Field] = field(default_factory=dict)
    places: list[str] = field(default_factory=list)
    times: list[str] = field(default_factory=list)
    values: list[list[float]] = field(default_factory=list)

    def add(self, path: Path, place: str, time: str, words: list[str]) -> None:
        """Take a state vector; raises `OrbitError` for what is not a number."""
        try:
            numbers = list(map(float, words))
        except ValueError:
            numbers = [finite(path, Field(key, w, "", place)) for key, w in zip(_COLUMNS, words, strict=False)]
        self.places.append(place)
        self.times.append(time)
        self.values.append(numbers)


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """State vectors in TEME, how to interpolate them, and when they may be used.

    `time_s` of shape (n,) rises; `position_m` and `velocity_m_s` have the shape (3, n). `points` of them around a time
    make its polynomial.
    """

    time_s: Floats
    position_m: Floats
    velocity_m_s: Floats
    method: str
    points: int
    start_s: float
    stop_s: float

    def states(self, time_s: Floats) -> States:
        """Interpolated states, which must lie within the state vectors; shape (3, n)."""
        position, velocity = np.empty((3, time_s.size)), np.empty((3, time_s.size))
        weigh = _hermite if self.method == "HERMITE" else _lagrange
        for start in range(0, time_s.size, _TIMES_AT_ONCE):
            part = slice(start, start + _TIMES_AT_ONCE)
            before = np.searchsorted(self.time_s, time_s[part], side="right") - 1
            first = np.clip(before - (self.points - 1) // 2, 0, self.time_s.size - self.points)
            window = first + np.arange(self.points)[:, np.newaxis]
            weights = weigh(self.time_s[window], time_s[part])
            x, v = self.position_m[:, window], self.velocity_m_s[:, window]
            position[:, part] = _sum(weights[0], x) + _sum(weights[1], v)
            velocity[:, part] = _sum(weights[2], x) + _sum(weights[3], v)
        return States(position, velocity)


def _lagrange_basis(node: Floats, time: Floats) -> tuple[Floats, Floats, Floats]:
    """Lagrange's polynomials l_j at `time`, their slopes there, and their slopes at their own nodes; (points, n)."""
    value, slope, own = np.ones_like(node), np.zeros_like(node), np.zeros_like(node)
    for j in range(len(node)):
        for i in range(len(node)):
            if i != j:
                inverse = 1.0 / (node[j] - node[i])
                factor = (time - node[i]) * inverse
                slope[j] = slope[j] * factor + value[j] * inverse
                value[j] *= factor
                own[j] += inverse
    return value, slope, own


def _lagrange(node: Floats, time: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Weights as of `_hermite`; positions and velocities have a polynomial each."""
    value, _, _ = _lagrange_basis(node, time)
    none = np.zeros_like(value)
    return value, none, none, value


def _hermite(node: Floats, time: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Weights of positions and velocities in the position, then in the velocity; of shape (points, n) each.

    The position is the polynomial through positions and velocities at the nodes, x(t) = sum over j of
    [1 - 2 (t - t_j) l_j'(t_j)] l_j(t)^2 x_j + (t - t_j) l_j(t)^2 v_j, and the velocity its slope.
    """
    value, slope, own = _lagrange_basis(node, time)
    since = time - node
    square, square_rate = value * value, 2.0 * value * slope
    tilt = 1.0 - 2.0 * since * own
    return tilt * square, since * square, tilt * square_rate - 2.0 * own * square, square + since * square_rate


def _sum(weight: Floats, vectors: Floats) -> Floats:
    """Weighted sum over the points of each time's window, of shape (3, n)."""
    total: Floats = np.einsum("pn,kpn->kn", weight, vectors)
    return total


# --------------------------------------------------------------------------------------------------------------- orbit
@dataclass(frozen=True, slots=True, eq=False)
class EphemerisOrbit:
    """The orbit of an object whose state vectors a file lists, in segments that do not overlap.

    Satisfies `Orbit`. At an instant where two segments meet, the later one holds.
    """

    name: str
    epoch: Epoch
    segments: tuple[Segment, ...]
    source: str

    @property
    def span_s(self) -> tuple[float, float]:
        """First and last usable time, in seconds of the mission; there may be gaps between segments."""
        return self.segments[0].start_s, self.segments[-1].stop_s

    def states(self, time_s: Floats) -> States:
        """States in TEME at `time_s`, of shape (3, n); raises `OrbitError` outside the usable times."""
        time = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
        self._check_finite(time)
        states = self._interpolated(time)
        if np.ndim(time_s) == 0:
            return States(states.position_m[:, 0], states.velocity_m_s[:, 0])
        return states

    def _interpolated(self, time: Floats) -> States:
        starts = np.array([segment.start_s for segment in self.segments])
        stops = np.array([segment.stop_s for segment in self.segments])
        index = np.searchsorted(starts, time + _SLACK_S, side="right") - 1
        missed = (index < 0) | (time > stops[index] + _SLACK_S)
        if np.any(missed):
            worst = float(time[missed][0])
            raise self._outside(worst, worst)
        position, velocity = np.empty((3, time.size)), np.empty((3, time.size))
        for k, segment in enumerate(self.segments):
            chosen = index == k
            if np.any(chosen):
                states = segment.states(np.clip(time[chosen], segment.start_s, segment.stop_s))
                position[:, chosen], velocity[:, chosen] = states
        return States(position, velocity)

    def require(self, start_s: float, end_s: float) -> None:
        """Raise `OrbitError` when a part of the mission from `start_s` to `end_s` has no usable state vectors."""
        self._check_finite(np.array([start_s, end_s]))
        first, last = self.span_s
        if start_s < first - _SLACK_S or end_s > last + _SLACK_S:
            raise self._outside(start_s, end_s)
        for one, two in pairwise(self.segments):
            if two.start_s - one.stop_s > _SLACK_S and start_s < two.start_s - _SLACK_S and end_s > one.stop_s:
                raise self._outside(start_s, end_s)

    def _check_finite(self, time: Floats) -> None:
        if not np.all(np.isfinite(time)):
            raise OrbitError(f"{self.source}: a time is not a finite number; give seconds since {self.epoch.text}")

    def _outside(self, start_s: float, end_s: float) -> OrbitError:
        spans = [f"{self.epoch.utc(s.start_s)} to {self.epoch.utc(s.stop_s)}" for s in self.segments[:4]]
        listed = ", ".join(spans) + (f" and {len(self.segments) - 4} more" if len(self.segments) > 4 else "")
        wanted = self.epoch.utc(start_s) + (f" to {self.epoch.utc(end_s)}" if end_s > start_s else "")
        return OrbitError(
            f"{self.source}: the ephemeris of {self.name} may be used from {listed}, and the mission needs {wanted}; "
            "nothing is extrapolated: choose an epoch and a duration inside, or take an ephemeris that covers them"
        )


def read_oem(path: Path, epoch: Epoch, name: str | None = None) -> EphemerisOrbit:
    """The orbit of an object from a CCSDS OEM, KVN or XML; `name` (or its identifier) chooses among several.

    Time systems: UTC, TAI, TT, GPS. Frames: TEME, TOD, EME2000 (J2000), GCRF, ICRF, and ITRF without polar motion;
    velocities of ITRF gain the Earth's rotation. Interpolation: LAGRANGE (degree + 1 state vectors) or HERMITE
    ((degree + 1) / 2, rounded up); Hermite of degree 7 when the file names none. Covariances and accelerations are
    passed over. Raises `OrbitError` with file, line and value for all else.
    """
    text = read_text(path)
    drafts = list(_xml_drafts(path, text) if text.lstrip().startswith("<") else _kvn_drafts(path, text))
    if not drafts:
        raise OrbitError(
            f"{path}: no segment of an ephemeris (META_START to META_STOP, or <segment>) is in the file; give a CCSDS "
            "OEM, and element sets (TLE, OMM) by their own key"
        )
    for draft in drafts:
        _check_metadata(path, draft)
    chosen = _of_object(path, drafts, name)
    segments = tuple(_segment(path, draft, epoch) for draft in chosen)
    for (one, two), draft in zip(pairwise(segments), chosen[1:], strict=True):
        if two.start_s < one.stop_s - _SLACK_S:
            raise OrbitError(
                f"{path}, {draft.place}: this segment may be used from {epoch.utc(two.start_s)}, but the one before "
                f"it until {epoch.utc(one.stop_s)}, so the orbit is stated twice; sort the segments by time and let "
                "USEABLE_START_TIME and USEABLE_STOP_TIME meet"
            )
    return EphemerisOrbit(chosen[0].metadata["OBJECT_NAME"].value, epoch, segments, str(path))


def _kvn_drafts(path: Path, text: str) -> Iterator[_Draft]:
    """The segments of a text in keywords and values."""
    moves = {
        ("head", "META_START"): "meta", ("data", "META_START"): "meta", ("meta", "META_STOP"): "data",
        ("data", "COVARIANCE_START"): "covariance", ("covariance", "COVARIANCE_STOP"): "data",
    }  # fmt: skip
    block, draft, header = "head", _Draft(""), dict[str, Field]()
    for number, line in enumerate(text.split("\n"), 1):
        words = line.split()
        if not words or words[0] == "COMMENT":
            continue
        if len(words) == 1 and words[0] in {marker for _, marker in moves}:
            if (block, words[0]) not in moves:
                raise OrbitError(f"{path}, line {number}: {words[0]} has no place here; repair the order of the blocks")
            block = moves[block, words[0]]
            if block == "meta":
                if draft.place:
                    yield draft
                draft = _Draft(f"line {number}")
        elif block == "head":
            add_field(header, kvn_field(path, number, line), path)
            _check_version(path, header)
        elif block == "meta":
            add_field(draft.metadata, kvn_field(path, number, line), path)
        elif block == "data":
            _kvn_row(path, draft, number, words)
    if block in ("meta", "covariance"):
        raise OrbitError(
            f"{path}: the file ends before {block.upper()}_STOP; it is cut off: download or export it again"
        )
    if draft.place:
        yield draft


def _kvn_row(path: Path, draft: _Draft, number: int, words: list[str]) -> None:
    if len(words) not in (7, 10):
        raise OrbitError(
            f"{path}, line {number}: {len(words)} columns; a state vector has a time, three of position in km and "
            "three of velocity in km/s, and may have three of acceleration"
        )
    draft.add(path, f"line {number}", words[0], words[1:7])


def _check_version(path: Path, header: dict[str, Field]) -> None:
    """Refuse what does not begin as an OEM of a version that is read."""
    first = next(iter(header.values()))
    if first.key != "CCSDS_OEM_VERS" or first.value.partition(".")[0] not in ("1", "2", "3"):
        raise OrbitError(
            f"{path}, {first.place}: the file begins with {first.key} = {first.shown}, not with CCSDS_OEM_VERS = 1, 2 "
            "or 3; give a CCSDS Orbit Ephemeris Message"
        )


def _xml_drafts(path: Path, text: str) -> Iterator[_Draft]:
    """The segments of a text in XML."""
    draft: _Draft | None = None
    row: dict[str, Field] | None = None
    container: list[str] = []
    for given in xml_fields(path, text):
        if given.key.startswith("</"):
            container.pop()
            if given.key == "</stateVector" and draft is not None and row is not None:
                _xml_row(path, draft, row, given.place)
                row = None
            elif given.key == "</segment" and draft is not None:
                yield draft
                draft = None
        elif given.key.startswith("<"):
            container.append(given.key[1:])
            if given.key == "<segment" and "oem" in container:
                draft = _Draft(given.place)
            elif given.key == "<stateVector":
                row = {}
        elif row is not None:
            add_field(row, given, path)
        elif draft is not None and container[-1] == "metadata":
            add_field(draft.metadata, given, path)


def _xml_row(path: Path, draft: _Draft, row: dict[str, Field], place: str) -> None:
    for key in ("EPOCH", *_COLUMNS):
        unit = "" if key == "EPOCH" else "km/s" if key.endswith("DOT") else "km"
        if key not in row:
            raise OrbitError(f"{path}, {place}: {key} is missing in this stateVector; add it")
        if row[key].unit not in ("", unit):
            raise OrbitError(
                f"{path}, {row[key].place}: {key} is in {row[key].unit!r}; an OEM has it in {unit!r}: convert the file"
            )
    draft.add(path, place, row["EPOCH"].value, [row[key].value for key in _COLUMNS])


def _check_metadata(path: Path, draft: _Draft) -> None:
    """Refuse a segment whose keys are missing, or whose centre, time system or frame is not read."""
    given = draft.metadata
    for key in _REQUIRED:
        if not given.get(key, Field(key, "", "", "")).value:
            raise OrbitError(f"{path}, {draft.place}: {key} is missing in this segment's metadata; add it")
    if given["CENTER_NAME"].value.upper() != "EARTH":
        raise _unread(path, given["CENTER_NAME"], "EARTH")
    if _system(given) not in ("UTC", *_AHEAD_OF_TAI_S):
        raise _unread(path, given["TIME_SYSTEM"], "UTC, TAI, TT, GPS")
    if not re.fullmatch(r"TEME|TOD|EME2000|GCRF\d*|ICRF\d*|ITRF-?\d*", _frame(given)):
        raise _unread(path, given["REF_FRAME"], "TEME, TOD, EME2000, GCRF, ICRF, ITRF")
    if "REF_FRAME_EPOCH" in given and _frame(given) in ("TEME", "TOD"):
        raise OrbitError(
            f"{path}, {given['REF_FRAME_EPOCH'].place}: REF_FRAME_EPOCH holds {_frame(given)} still at "
            f"{given['REF_FRAME_EPOCH'].value}, and only the frame of date is read; export in EME2000 or GCRF"
        )


def _unread(path: Path, given: Field, allowed: str) -> OrbitError:
    return OrbitError(f"{path}, {given.place}: {given.key} is {given.shown}; read are {allowed}: export one of these")


def _system(metadata: dict[str, Field]) -> str:
    return metadata["TIME_SYSTEM"].value.upper()


def _frame(metadata: dict[str, Field]) -> str:
    name = metadata["REF_FRAME"].value.upper().replace(" ", "")
    return _FRAMES.get(name, name)


def _of_object(path: Path, drafts: list[_Draft], name: str | None) -> list[_Draft]:
    """The segments of the object that is meant."""
    objects = {(d.metadata["OBJECT_NAME"].value, d.metadata["OBJECT_ID"].value): d for d in drafts}
    keys = [key for key in objects if name is None or name.casefold() in (key[0].casefold(), key[1].casefold())]
    if len(keys) != 1:
        listed = ", ".join(f"{n} ({i})" for n, i in list(objects)[:8])
        wanted = "no object is named" if name is None else f"{name!r} names {len(keys)} of them"
        raise OrbitError(f"{path}: it holds the objects {listed}, and {wanted}; name one of them")
    return [d for d in drafts if (d.metadata["OBJECT_NAME"].value, d.metadata["OBJECT_ID"].value) == keys[0]]


# ------------------------------------------------------------------------------------------ times, frames, checked data
def _segment(path: Path, draft: _Draft, epoch: Epoch) -> Segment:
    """A segment in seconds of the mission and in TEME."""
    system = _system(draft.metadata)
    instants = [
        _plain_instant(t) or instant(path, Field("the epoch", t, "", p), system)
        for t, p in zip(draft.times, draft.places, strict=True)
    ]
    method, points = _method(path, draft)
    time = _elapsed_s(system, epoch, instants, f"{path}, {draft.place}")
    _check_rows(path, draft, time)
    values = 1000.0 * np.array(draft.values).T
    states = _to_teme(_frame(draft.metadata), epoch, time, values)
    start, stop = _usable(path, draft, epoch, time)
    return Segment(time, states.position_m, states.velocity_m_s, method, points, start, stop)


def _elapsed_s(system: str, epoch: Epoch, instants: list[tuple[int, float]], where: str) -> Floats:
    """Seconds of the mission of days and seconds in a time system."""
    days = np.array([day for day, _ in instants], dtype=np.int64)
    seconds = np.array([second for _, second in instants])
    try:
        if system == "UTC":  # by days, since a leap second makes one longer
            unique, index = np.unique(days, return_inverse=True)
            zero = [epoch.seconds_to(Epoch.from_text(f"{date.fromordinal(int(d))}T00:00:00Z")) for d in unique]
            of_utc: Floats = np.array(zero)[index] + seconds
            return of_utc
        midnight = Epoch.from_text(f"{epoch.text[:10]}T00:00:00Z")
    except OrbitError as error:
        raise OrbitError(f"{where}: {error}") from None
    day = date.fromisoformat(epoch.text[:10]).toordinal()
    whole_days_s = (day - date(2000, 1, 1).toordinal()) * DAY_S
    tai_minus_utc_s = _Y2K_TAI_MINUS_UTC_S + _Y2K.seconds_to(midnight) - whole_days_s
    after_midnight = (days - day) * DAY_S + (seconds - tai_minus_utc_s - _AHEAD_OF_TAI_S[system])
    elapsed: Floats = after_midnight + epoch.seconds_to(midnight)
    return elapsed


def _check_rows(path: Path, draft: _Draft, time: Floats) -> None:
    """Refuse numbers that are not finite, times that do not rise and distances that no satellite has."""
    values = np.array(draft.values)
    bad = np.flatnonzero(~np.all(np.isfinite(values), axis=1))
    if bad.size:
        raise OrbitError(
            f"{path}, {draft.places[bad[0]]}: the state vector at {draft.times[bad[0]]} holds nan or inf; remove or "
            "repair it"
        )
    fallen = np.flatnonzero(np.diff(time) <= 0.0)
    if fallen.size:
        k = int(fallen[0]) + 1
        raise OrbitError(
            f"{path}, {draft.places[k]}: the epoch {draft.times[k]} does not come after {draft.times[k - 1]} "
            f"({draft.places[k - 1]}); sort the state vectors by time, each once"
        )
    radius = 1000.0 * np.linalg.norm(values[:, :3], axis=1)
    bad = np.flatnonzero((radius < _RADII_M[0]) | (radius > _RADII_M[1]))
    if bad.size:
        raise OrbitError(
            f"{path}, {draft.places[bad[0]]}: {radius[bad[0]] / 1000.0:.6g} km from the Earth's centre, where no "
            "satellite of the Earth is; positions are in km and velocities in km/s"
        )


def _method(path: Path, draft: _Draft) -> tuple[str, int]:
    """The method of interpolation and how many state vectors it takes."""
    given = draft.metadata
    method = given.get("INTERPOLATION", Field("INTERPOLATION", "HERMITE", "", draft.place))
    degree = given.get("INTERPOLATION_DEGREE")
    if "INTERPOLATION" in given and degree is None:
        raise OrbitError(f"{path}, {method.place}: INTERPOLATION stands without INTERPOLATION_DEGREE; add the degree")
    kind = method.value.upper()
    if kind not in ("HERMITE", "LAGRANGE"):
        raise OrbitError(
            f"{path}, {method.place}: INTERPOLATION is {method.shown}; an orbit is read with HERMITE or LAGRANGE, "
            "because other curves miss it by kilometres or jump in velocity: export with one of these"
        )
    number = DEFAULT_DEGREE if degree is None else finite(path, degree)
    if degree is not None and not (number == int(number) and DEGREES[0] <= number <= DEGREES[1]):
        raise OrbitError(
            f"{path}, {degree.place}: INTERPOLATION_DEGREE is {degree.shown}; take a whole number from {DEGREES[0]} "
            f"to {DEGREES[1]}"
        )
    points = int(number) + 1 if kind == "LAGRANGE" else (int(number) + 2) // 2
    if len(draft.times) < points:
        raise OrbitError(
            f"{path}, {draft.place}: {len(draft.times)} state vectors in this segment, too few for {kind} "
            f"interpolation of degree {int(number)}, which takes {points}; add state vectors or lower "
            "INTERPOLATION_DEGREE"
        )
    return kind, points


def _usable(path: Path, draft: _Draft, epoch: Epoch, time: Floats) -> tuple[float, float]:
    """The usable times, those of the metadata as far as state vectors reach."""
    given, system = draft.metadata, _system(draft.metadata)
    ends = [given.get(f"USEABLE_{key}", given[key]) for key in ("START_TIME", "STOP_TIME")]
    instants = [instant(path, end, system) for end in ends]
    start, stop = (float(t) for t in _elapsed_s(system, epoch, instants, f"{path}, {ends[0].place}"))
    usable = max(start, float(time[0])), min(stop, float(time[-1]))
    if usable[1] <= usable[0]:
        raise OrbitError(
            f"{path}, {ends[1].place}: the usable span from {ends[0].value} to {ends[1].value} has nothing in common "
            f"with the state vectors, {draft.times[0]} to {draft.times[-1]}; correct {ends[0].key} and {ends[1].key}"
        )
    return usable


def _to_teme(frame: str, epoch: Epoch, time: Floats, values: Floats) -> States:
    """Rotate position and velocity, the rows of `values`; the velocity is the rate of the coordinates in TEME."""
    position, velocity = values[:3], values[3:]
    if frame == "TEME":
        return States(position, velocity)
    if frame.startswith("ITRF"):
        return _from_earth_fixed(epoch.earth_rotation_rad(time), position, velocity)
    matrix, rate = _rotations(frame, epoch, time)
    turn = "nij,jn->in"
    moved = np.einsum(turn, matrix, velocity) + np.einsum(turn, rate, position)
    return States(np.einsum(turn, matrix, position), moved)


def _from_earth_fixed(angle: Floats, position: Floats, velocity: Floats) -> States:
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = position
    vx, vy, vz = velocity[0] - ROTATION_RAD_S * y, velocity[1] + ROTATION_RAD_S * x, velocity[2]
    return States(np.array([c * x - s * y, s * x + c * y, z]), np.array([c * vx - s * vy, s * vx + c * vy, vz]))


def _rotations(frame: str, epoch: Epoch, time: Floats) -> tuple[Floats, Floats]:
    """Matrices from `frame` to TEME and their rates, each of shape (n, 3, 3), by splines between knots."""
    from scipy.interpolate import CubicSpline  # heavy, and only files in such frames need them
    from skyfield.api import load

    first, last = float(time[0]), float(time[-1])
    knots = np.linspace(first, last, max(4, math.ceil((last - first) / _KNOT_S) + 1))
    scale = load.timescale(builtin=True)
    days = 2451545.0 + 36525.0 * epoch.terrestrial_centuries(knots)
    parts = [
        _matrices(frame, scale.tt_jd(part)) for part in np.array_split(days, math.ceil(days.size / _KNOTS_AT_ONCE))
    ]
    spline = CubicSpline(knots, np.concatenate(parts))
    return spline(time), spline(time, 1)


def _matrices(frame: str, instants: object) -> Floats:
    """From `frame` to TEME at instants of skyfield; shape (n, 3, 3)."""
    from skyfield.framelib import ICRS_to_J2000, true_equator_and_equinox_of_date
    from skyfield.sgp4lib import TEME

    from_gcrf = np.moveaxis(TEME.rotation_at(instants), -1, 0)
    if frame == "EME2000":
        turned: Floats = from_gcrf @ ICRS_to_J2000.T
    elif frame == "TOD":
        turned = from_gcrf @ np.moveaxis(true_equator_and_equinox_of_date.rotation_at(instants), -1, 0).swapaxes(1, 2)
    else:
        turned = from_gcrf
    return turned
