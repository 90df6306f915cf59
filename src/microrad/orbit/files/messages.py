"""CCSDS orbit data messages as text: fields as keywords and values (KVN) or as XML, and their times.

Mean-elements messages and ephemeris messages share both notations. Sources: CCSDS 502.0-B-3, Orbit Data Messages;
CCSDS 301.0-B, Time Code Formats.
"""

import math
import re
import stat
from collections.abc import Iterator
from datetime import date
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.folder import read_bytes
from microrad.orbit.base import OrbitError
from microrad.orbit.earth.epoch import DAY_S, Epoch

MOST_BYTES = 50_000_000
"""Largest file that is read: a state vector each second for four days, or each minute for most of a year."""

_BLOCK = 1 << 16  # characters of XML parsed at a time
_MOST_LINE = 1000  # characters of a line of keywords; matching takes their square
_KVN = re.compile(r"\s*([A-Za-z]\w*)\s*=\s*(?:([-+.\d][^\[\]]*?)\s*\[([^\[\]]*)\]|(.*?))\s*")  # a unit follows a number


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

    def refused(self, path: Path, why: str) -> OrbitError:
        """The error that refuses the value: it says where it stands, what it is, and why it will not do.

        Args:
            path: The file.
            why: The reason, put behind the value as it is: it begins with a comma, a semicolon or a blank.
        """
        return OrbitError(f"{path}, {self.place}: {self.key} is {self.shown}{why}")


def read_text(path: Path, data: bytes | None = None) -> str:
    """Text of a file in UTF-8, its lines ending in a newline.

    Args:
        path: The file.
        data: The bytes of the file, where it was read already; it is then not read again.

    Raises:
        OrbitError: For a file that is not there or cannot be read, is no text, is empty, or is larger than
            `MOST_BYTES`.
    """
    try:
        if data is None:
            _check_file(path)
            data = read_bytes(path, MOST_BYTES + 1)
        _check_size(path, len(data))
    except OrbitError:
        raise
    except (FileNotFoundError, NotADirectoryError, ValueError):  # the last for a name that holds a NUL
        tried = "" if path.is_absolute() else f" ({path.absolute()} was tried)"
        raise OrbitError(
            f"{path}: there is no such file{tried}; check the path: a name in a mission is seen from the mission file"
        ) from None
    except OSError as error:
        what = "permissions of the file and of its folders" if isinstance(error, PermissionError) else "path"
        raise OrbitError(f"{path}: cannot be read ({error.strerror}); check the {what}") from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise _binary(path, error.start) from None
    if "\0" in text:
        raise _binary(path, data.index(b"\0"))
    if not text.strip():
        raise OrbitError(f"{path}: the file holds blanks and nothing else; download or export it again")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _check_file(path: Path) -> None:
    """Raises OrbitError for a folder, a device, an empty file and one too large, `OSError` for one not found."""
    found = path.stat()
    if stat.S_ISDIR(found.st_mode):
        raise OrbitError(f"{path}: this is a folder; name the file in it")
    if not stat.S_ISREG(found.st_mode):
        raise OrbitError(f"{path}: this is a device or a pipe; give a file with an orbit")
    _check_size(path, found.st_size)


def _check_size(path: Path, size: int) -> None:
    if size == 0:
        raise OrbitError(f"{path}: the file is empty; download or export it again")
    if size > MOST_BYTES:
        raise OrbitError(
            f"{path}: {math.ceil(size / 1e6)} MB, more than the {MOST_BYTES / 1e6:.0f} MB that are read; keep only "
            "the satellites and the days that the mission needs"
        )


def _binary(path: Path, byte: int) -> OrbitError:
    return OrbitError(
        f"{path}: byte {byte + 1} is not text in UTF-8, so this is a binary or a compressed file; unpack it, or export "
        "element sets (TLE, OMM) or an ephemeris (OEM) as text"
    )


def kvn_field(path: Path, number: int, line: str) -> Field:
    """The key, value and unit of a line `KEY = value [unit]`.

    Args:
        path: The file, for messages.
        number: Number of the line, from 1.
        line: The line.

    Raises:
        OrbitError: For any other line.
    """
    match = _KVN.fullmatch(line) if len(line) <= _MOST_LINE else None
    if match is None:
        raise OrbitError(
            f"{path}, line {number}: {line.strip()[:60]!r} is neither 'KEY = value' nor a keyword that may stand here; "
            "repair or remove the line"
        )
    return Field(match[1].upper(), match[2] or match[4] or "", match[3] or "", f"line {number}")


def add_field(fields: dict[str, Field], new: Field, path: Path) -> None:
    """Put a field among the others; comments and keys of the user's own are passed over.

    Args:
        fields: The fields so far by key; the new one is added here.
        new: The field.
        path: The file, for messages.

    Raises:
        OrbitError: When its key is there with another value.
    """
    if new.key == "COMMENT" or new.key.startswith("USER_DEFINED"):
        return
    old = fields.setdefault(new.key, new)
    if old.value != new.value:
        raise new.refused(path, f", but {old.place} has {old.shown}; keep one of them")


def check_version(path: Path, given: Field, key: str) -> None:
    """Refuse a message of a version that is not read; XML may leave it out.

    Args:
        path: The file, for messages.
        given: The field whose value is the version.
        key: What the version is called in keywords and values.

    Raises:
        OrbitError: For a version that is not 1, 2 or 3.
    """
    if given.value.partition(".")[0] not in ("", "1", "2", "3"):
        raise given._replace(key=key).refused(path, "; read are 1, 2 and 3: export one of these")


class _XmlReader:
    """Turns the events of the parser into fields; containers become fields with the keys `<tag` and `</tag`.

    The value of `<tag` is its version, where it has one.
    """

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
            outer, version, place = self.open[-1]
            self.found.append(Field(f"<{outer}", version, "", place))
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

    Args:
        path: The file, for messages.
        text: The text.

    Raises:
        OrbitError: For text that is not well formed, and for any document type.
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
    """The number of a field.

    Args:
        path: The file, for messages.
        given: The field.

    Raises:
        OrbitError: For anything but a finite number: nan and inf are refused, too.
    """
    try:
        number = float(given.value) if "_" not in given.value else math.nan
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise given.refused(path, ", not a finite number; write one such as 12.5 or 1.25e1")
    return number


# --------------------------------------------------------------------------------------------------------------- times
_AHEAD_OF_TAI_S = {"TAI": 0.0, "TT": 32.184, "TDT": 32.184, "GPS": -19.0}
_Y2K = Epoch("2000-01-01T00:00:00Z")
_Y2K_TAI_MINUS_UTC_S = 32.0
_CLOCK = re.compile(r"([0-9]{2}):([0-9]{2}):([0-9]{2}(?:\.[0-9]*)?)(Z?)")
TIME_SYSTEMS = ("UTC", *_AHEAD_OF_TAI_S)
"""Time systems that are read."""


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
    """Ordinal of the day and seconds in it of a time code of CCSDS 301.0-B, A or B.

    Args:
        path: The file, for messages.
        given: The field with the time code.
        system: Its time system, one of `TIME_SYSTEMS`.

    Raises:
        OrbitError: For what is no date and time, a leap second that was not inserted, and a Z in another system than
            UTC.
    """
    day, _, clock = given.value.partition("T")
    match = _CLOCK.fullmatch(clock)
    try:
        ordinal = _ordinal(day)
    except ValueError:
        match = None
    if match is None or int(match[1]) > 23 or int(match[2]) > 59 or float(match[3]) >= 61.0:
        example = "2026-03-20T12:00:00.000 or 2026-079T12:00:00.000"
        raise given.refused(path, f", not a date and time; write it as {example}")
    if match[4] and system != "UTC":
        but = f"which means UTC, but TIME_SYSTEM is {system}; remove the Z or correct TIME_SYSTEM"
        raise given.refused(path, f" and ends in Z, {but}")
    if float(match[3]) >= 60.0:
        try:
            if system != "UTC":
                raise OrbitError(f"{system} has no leap seconds")
            Epoch(f"{date.fromordinal(ordinal)}T{match[1]}:{match[2]}:60Z")
        except OrbitError as error:
            raise given.refused(path, f", a second that does not exist: {error}") from None
    return ordinal, int(match[1]) * 3600 + int(match[2]) * 60 + float(match[3])


def plain_instant(text: str) -> tuple[int, float] | None:
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


def utc_epoch(path: Path, given: Field) -> Epoch:
    """The instant of a field in UTC.

    Args:
        path: The file, for messages.
        given: The field with the time code.

    Raises:
        OrbitError: For what is no instant, with its place in the file.
    """
    day, _ = instant(path, given, "UTC")
    clock = given.value.partition("T")[2].rstrip("Z").rstrip(".")
    try:
        return Epoch(f"{date.fromordinal(day)}T{clock}Z")
    except OrbitError as error:
        raise OrbitError(f"{path}, {given.place}: {given.key}: {error}") from None


def elapsed_s(system: str, epoch: Epoch, instants: list[tuple[int, float]], where: str) -> Floats:
    """Seconds since an epoch of instants in one time system, leap seconds included; shape (n,), negative before it.

    Args:
        system: The time system, one of `TIME_SYSTEMS`.
        epoch: The epoch.
        instants: The ordinal of the day and the seconds in it, for each instant.
        where: What a message begins with: the place in the file.

    Raises:
        OrbitError: For a day of UTC outside the years of `Epoch`.
    """
    days = np.array([day for day, _ in instants], dtype=np.int64)
    seconds = np.array([second for _, second in instants])
    try:
        if system == "UTC":  # by days, since a leap second makes one longer
            unique, index = np.unique(days, return_inverse=True)
            zero = [epoch.seconds_to(Epoch(f"{date.fromordinal(int(d))}T00:00:00Z")) for d in unique]
            return np.asarray(np.array(zero)[index] + seconds)
        midnight = Epoch(f"{epoch.text[:10]}T00:00:00Z")
    except OrbitError as error:
        raise OrbitError(f"{where}: {error}") from None
    day = date.fromisoformat(epoch.text[:10]).toordinal()
    whole_days_s = (day - date(2000, 1, 1).toordinal()) * DAY_S
    tai_minus_utc_s = _Y2K_TAI_MINUS_UTC_S + _Y2K.seconds_to(midnight) - whole_days_s
    after_midnight = (days - day) * DAY_S + (seconds - tai_minus_utc_s - _AHEAD_OF_TAI_S[system])
    return after_midnight + epoch.seconds_to(midnight)
