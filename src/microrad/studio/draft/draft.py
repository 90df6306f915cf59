"""A mission being edited: its text with its comments, its values for forms, its faults in the command line's words.

A change replaces the one value in the text; every other byte stays, line ends and byte order mark included. A text
with faults is a draft, too.
"""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from decimal import Decimal
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Literal

from microrad.core.folder import read_bytes, write_whole
from microrad.mission.file import LinkFile, MissionFile, load_link, load_mission
from microrad.mission.model import Source
from microrad.mission.origins import written_for
from microrad.mission.toml import MAX_BYTES, Fault, MissionError, Statement, clipped, scan, value_of
from microrad.studio.draft.keys import Key, key_of, keys_in, loose_toml, typed_from

_MARK = "\ufeff"
_HEADERS = ("table", "tables", "broken")
_saving = threading.Lock()

OnDisk = Literal["", "changed", "gone"]
"""What another program has done with a draft's file; "" for nothing."""


class DraftError(ValueError):
    """A change that cannot be made, or a file that must not be overwritten; the message says why and what to do."""


@dataclass(frozen=True, slots=True)
class Value:
    """A value of a draft: as it stands in the text, as one types it, its comment (its source), its line, its faults.

    `about` says what the key may hold, and is None for a key that the mission does not know.
    """

    key: str
    raw: str
    typed: str
    comment: str
    line: int
    about: Key | None
    problems: tuple[Fault, ...]

    @property
    def source(self) -> str:
        """Where the value comes from, as budgets say it; "" without a comment."""
        was = written_for(self.key, self.comment, self.raw)
        return Source(self.line, self.comment, self.raw, was=was).text if self.comment else ""


@dataclass(frozen=True, slots=True)
class Draft:
    """A mission's text, the path it is read from or goes to, and its faults, with key and line, in the file's order.

    `disk_sha256` is that of the file at `path` when it was read or written here, "" for a file not written yet.
    """

    text: str
    path: Path
    problems: tuple[Fault, ...]
    disk_sha256: str = ""
    _link: LinkFile | None = field(default=None, repr=False, compare=False)  # what finding the faults has read

    @classmethod
    def open(cls, path: str | Path) -> Draft:
        """The draft of a file. Raises `MissionError` for a file that cannot be read as text."""
        path = Path(path)
        content = _content(path)
        return _draft(content.decode("utf-8"), path, hashlib.sha256(content).hexdigest())

    @classmethod
    def shipped(cls, path: str | Path) -> Draft:
        """The shipped mission as `microrad init` writes it, to be saved at `path`."""
        text = resources.files("microrad.mission").joinpath("missions", "leo-geo.toml").read_text("utf-8")
        return _draft(text, Path(path), "")

    @property
    def sha256(self) -> str:
        """SHA-256 of the text as it would be saved."""
        return hashlib.sha256(_encoded(self.text)).hexdigest()

    @property
    def changed(self) -> bool:
        """Whether the text is not what stands on disk, as far as is known here."""
        return self.sha256 != self.disk_sha256

    def on_disk(self) -> OnDisk:
        """What has become of the file since it was read or written here; a file not written yet has changed if it is
        there.
        """
        try:
            if not self.path.exists():
                return "gone" if self.disk_sha256 else ""
            content = read_bytes(self.path, MAX_BYTES + 1) if self.path.is_file() else b""
        except OSError:
            return "changed"
        return "" if hashlib.sha256(content).hexdigest() in (self.disk_sha256, self.sha256) else "changed"

    @property
    def report(self) -> str:
        """Every fault, as the command line prints them; "" when there is none."""
        return str(MissionError(self.path, self.problems)) if self.problems else ""

    @property
    def values(self) -> dict[str, Value]:
        """Each key that has a line of its own, in the order of the text."""
        return dict(_values(self.text, self.problems))

    @property
    def absent(self) -> tuple[Key, ...]:
        """Keys that the tables of the text may have or need, and do not have."""
        statements = _statements(self.text)
        tables = ["", *(each.key for each in statements if each.kind == "table")]
        there = {each.key for each in statements}
        return tuple(key for table in tables for key in keys_in(table) if key.key not in there)

    def set(self, key: str, typed: str) -> Draft:
        """The draft with another value of a key, typed without quotes: "5 cm", "0.4", "1 Hz, 15 Hz", "true".

        A key that its table may have, and does not, gets a line behind the table's others. What is wrong with the value
        is among the problems. Raises `DraftError` for a key that has no place in the text.

        Args:
            key: its dotted name.
            typed: the value as one types it.
        """
        _encoded(typed)
        typed = _plain(typed)
        plain, about = _plain(self.text), key_of(key)
        found = next((each for each in scan(plain) if each.kind == "key" and each.key == key), None)
        raw = about.toml(typed) if about else loose_toml(typed)
        if found is None:
            return self._with_line(plain, about, key, raw)
        if repr(value_of(found.value, Decimal)) == repr(value_of(raw, Decimal)) != "None":
            return self
        if "#" in found.value and "\n" in found.value:
            raise DraftError(f"{key} holds comments between its items (line {found.line}); change it in the text")
        return self._spliced(plain, found.place, found.place + len(found.value), raw)

    def without(self, key: str) -> Draft:
        """The draft without the line of a key, its comment included. Raises `DraftError` where it has none."""
        plain = _plain(self.text)
        found = next((each for each in scan(plain) if each.kind == "key" and each.key == key), None)
        if found is None:
            raise DraftError(f"{key} has no line of its own in {self.path}; change it in the text")
        return self._spliced(plain, _line_begin(plain, found.line), _line_begin(plain, found.last_line + 1), "")

    def with_text(self, text: str) -> Draft:
        """The draft with another text, in the line ends and with the byte order mark that the file has.

        Raises `DraftError` for characters that no file can hold.
        """
        _encoded(text)
        if self.text.startswith(_MARK) and not text.startswith(_MARK):
            text = _MARK + text
        if "\r\n" in self.text and "\r" not in text and self.text.count("\n") == self.text.count("\r\n"):
            text = text.replace("\n", "\r\n")
        return self if text == self.text else _draft(text, self.path, self.disk_sha256)

    def again(self) -> Draft:
        """The draft with the files that it names read anew."""
        return _draft(self.text, self.path, self.disk_sha256)

    def file(self) -> MissionFile:
        """The mission of the text. Raises `MissionError` with every fault, as `microrad run` says them."""
        return load_mission(self.path, text=self.text)

    def link(self) -> LinkFile:
        """What a link budget needs, also of a text without mirror and loop. Raises `MissionError`."""
        return load_link(self.path, text=self.text) if self._link is None else self._link

    def save(self, path: str | Path | None = None) -> Draft:
        """Write the text whole, to its own path or to another; returns the draft of the written file.

        Raises `DraftError` where the file was changed since it was read here, by another tab or program, where another
        path holds a file already, and where nothing can be written.
        """
        target = self.path if path is None else Path(path)
        with _saving:
            self._check(target)
            try:
                _write(target, self.text)
            except OSError as error:
                where = f"{target} cannot be written: {error.strerror or error}"
                raise DraftError(f"{where}; check free space and permissions, or save under another name") from error
        return _draft(self.text, target, self.sha256)

    def _check(self, target: Path) -> None:
        """Raise `DraftError` where what is on disk is not what this draft comes from."""
        try:
            now = hashlib.sha256(read_bytes(target, MAX_BYTES + 1)).hexdigest()
        except FileNotFoundError:
            return
        except OSError as error:
            raise DraftError(f"{target} cannot be written: {error.strerror}; choose another name") from error
        own = self.disk_sha256 and target.absolute() == self.path.absolute()
        if now == self.sha256 or (own and now == self.disk_sha256):
            return
        if not own:
            raise DraftError(f"{target} exists and is left as it is; choose another name, or open that file instead")
        raise DraftError(
            f"{target} was changed since it was opened here, in another tab or by another program, and is left as it "
            "is; save this text under another name, or open the file again and lose the changes made here"
        )

    def _with_line(self, plain: str, about: Key | None, key: str, raw: str) -> Draft:
        """The draft with a new line behind the last key of its table."""
        table, _, name = key.rpartition(".")
        if about is None:
            known = ", ".join(each.key.rpartition(".")[2] for each in keys_in(table))
            where = f"[{table}], which has {known}" if known else "the mission"
            raise DraftError(f"{clipped(key)} is no key of {where}")
        statements = scan(plain)
        begin = next((n + 1 for n, each in enumerate(statements) if (each.kind, each.key) == ("table", table)), 0)
        if table and not begin:
            raise DraftError(f"{key} needs the table [{table}], which has no header in {self.path}; change the text")
        place = _line_begin(plain, _last_line(statements, begin) + 1)
        lead = "\n" if place and plain[place - 1] != "\n" else ""
        return self._spliced(plain, place, place, f"{lead}{name} = {raw}\n")

    def _spliced(self, plain: str, begin: int, end: int, new: str) -> Draft:
        """The draft with characters of the plain text replaced in the text as it is."""
        first, last = _as_written(self.text, begin), _as_written(self.text, end)
        if self.text.count("\r\n") * 2 > plain.count("\n"):
            new = new.replace("\n", "\r\n")
        return _draft(self.text[:first] + new + self.text[last:], self.path, self.disk_sha256)


def _draft(text: str, path: Path, disk_sha256: str) -> Draft:
    """A draft with the faults that the text has if it stands at the path."""
    try:
        return Draft(text, path, (), disk_sha256, load_link(path, text=text))
    except MissionError as error:
        return Draft(text, path, error.faults, disk_sha256)


@lru_cache(maxsize=4)  # a page asks for them a dozen times, and a long text takes its time
def _statements(text: str) -> tuple[Statement, ...]:
    return tuple(scan(_plain(text)))


@lru_cache(maxsize=4)
def _values(text: str, problems: tuple[Fault, ...]) -> Mapping[str, Value]:
    faults: dict[str, list[Fault]] = {}
    for fault in problems:
        faults.setdefault(fault.key, []).append(fault)
    found: dict[str, Value] = {}
    for each in _statements(text):
        if each.kind == "key" and each.key not in found:
            told = tuple(faults.get(clipped(each.key), ()))
            typed, about = typed_from(each.value), key_of(each.key)
            found[each.key] = Value(each.key, each.value, typed, each.comment, each.line, about, told)
    return found


def _content(path: Path) -> bytes:
    """The bytes of a file of text; MissionError, with the command line's words, for what is none."""
    with suppress(OSError, ValueError):
        if path.is_file() and path.stat().st_size <= MAX_BYTES:
            content = read_bytes(path, MAX_BYTES)
            content.decode("utf-8")
            if b"\0" not in content:
                return content
    load_link(path)
    raise DraftError(f"{path} changed while it was read; open it again")


def _encoded(text: str) -> bytes:
    try:
        return text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise DraftError(f"{clipped(text)} holds half of a character at {error.start + 1}; type it again") from None


def _write(target: Path, text: str) -> None:
    """Write whole, through a link to what it names, and keep who may read it."""
    target = target.resolve()
    mode = target.stat().st_mode & 0o777 if target.exists() else None
    write_whole(target, text, mode=mode)


def _plain(text: str) -> str:
    """The text as it is parsed: without byte order mark, lines ended by "\\n"."""
    return text.removeprefix(_MARK).replace("\r\n", "\n")


def _as_written(text: str, place: int) -> int:
    """Where a character of the plain text stands in the text as it is."""
    at = len(_MARK) if text.startswith(_MARK) else 0
    for piece in text[at:].split("\r\n"):
        if place <= len(piece):
            break
        place, at = place - len(piece) - 1, at + len(piece) + 2
    return at + place


def _line_begin(plain: str, line: int) -> int:
    """The first character of a line, counted from 1; the end of the text for a line behind the last."""
    begin = 0
    for _ in range(line - 1):
        begin = plain.find("\n", begin) + 1
        if begin == 0:
            return len(plain)
    return begin


def _last_line(statements: Sequence[Statement], begin: int) -> int:
    """The last line of the keys of the table whose header stands before `begin`; 0 at the very top."""
    line = statements[begin - 1].last_line if begin else 0
    for each in statements[begin:]:
        if each.kind in _HEADERS:
            break
        line = each.last_line
    return line
