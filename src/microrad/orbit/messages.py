"""Text of CCSDS orbit data messages: reading a file, and its fields as keywords and values (KVN) or as XML.

Mean-elements messages and ephemeris messages share both notations. Source: CCSDS 502.0-B-3, Orbit Data Messages.
"""

import math
import re
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

from microrad.core.folder import read_bytes
from microrad.orbit.base import OrbitError

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


def read_text(path: Path, data: bytes | None = None) -> str:
    """Text of a file in UTF-8, lines ending in a newline; raises `OrbitError` for one that is none, or too large.

    With ``data``, these are the bytes of the file, which is not read again.
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
    """Refuse what is no file, an empty one and one too large; raises what asking the system for it raises."""
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
            f"{path}: {size / 1e6:.0f} MB, more than the {MOST_BYTES / 1e6:.0f} MB that are read; keep only "
            "the satellites and the days that the mission needs"
        )


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
