"""A TOML file from disk with its lines, its comments and its faults: what tomllib parses, and what it does not tell.

tomllib stops at the first fault and gives no positions. Here a scanner finds every statement first; what would stop the
parser is noted as a fault and blanked out, so that the rest is parsed and every fault of a file can be shown at once.
"""

import hashlib
import re
import tomllib
import unicodedata
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, Self

from microrad.core.errors import MicroradError
from microrad.core.folder import read_bytes
from microrad.core.units import printable

MAX_BYTES = 1_000_000
MAX_LINES = 10_000
_MAX_FAULTS_SHOWN = 50
_MAX_FAULTS = 500  # a file with more is no mission file
_MAX_VALUE_SHOWN = 60
_MAX_RETRIED_CHARACTERS = 100_000  # beyond it a file is parsed once: each syntax fault costs another pass
_MAX_SYNTAX_FAULTS = 20
_MAX_DEPTH = 16
_MAX_KEY = 200
_MAX_PARTS = re.compile(r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){50}""")  # of a key
_MAX_NUMBER = 400
_NO_TOML = "is not TOML"
_LINES = 'key = "value", [table] or # comment'


# ------------------------------------------------------------------------------------------------------------- faults
@dataclass(frozen=True, slots=True)
class Fault:
    """One thing to correct: dotted key, the value as it stands (shortened), line, what is wrong, what is expected.

    `nearest` is the valid key or choice that an unknown one resembles. `file` is the file that holds the line, and
    `line` is 0 when the fault is on no line in particular.
    """

    key: str
    value: str
    line: int
    reason: str
    expected: str
    nearest: str = ""
    file: str = ""

    def __str__(self) -> str:
        """Two to four short lines for a terminal."""
        place = f"{self.file}, line {self.line}" if self.line else self.file
        shown = f"{self.key} = {self.value}" if self.key and self.value else self.key or self.value
        text = [f"{place}: {shown}" if shown else place, f"    {self.reason}"]
        if self.nearest:
            text.append(f"    did you mean {self.nearest}?")
        return "\n".join([*text, f"    expected: {self.expected}"])


class MissionError(MicroradError):
    """A mission or mirror file that cannot be used: `path`, and every fault found in `faults`, by file and line."""

    def __init__(self, path: Path, faults: Iterable[Fault]) -> None:
        """Write the report that `str` shows."""
        self.path = path
        self.faults = tuple(sorted(faults, key=lambda f: (f.file != clipped(str(path)), f.file, f.line)))
        count = len(self.faults)
        head = f"{clipped(str(path))}: {count} fault{'s' if count > 1 else ''} to correct"
        tail = [f"and {count - _MAX_FAULTS_SHOWN} more"] if count > _MAX_FAULTS_SHOWN else []
        super().__init__("\n".join([head, *(str(fault) for fault in self.faults[:_MAX_FAULTS_SHOWN]), *tail]))


def shown(value: object) -> str:
    """A parsed value as it might stand in the file: on one line, shortened, control characters escaped."""
    if isinstance(value, dict):
        return "(a table)"
    if isinstance(value, list):
        items = [shown(item) for item in value[:10]]
        return clipped(f"[{', '.join(items + ['…'] * (len(value) > 10))}]")
    if isinstance(value, str):
        return f'"{clipped(value)}"'
    if isinstance(value, int) and value.bit_length() > 200:
        return f"(a whole number of {value.bit_length()} bits)"
    return clipped(str(value).lower())  # true and false as TOML has them


def clipped(text: str) -> str:
    """Text fit for a report: shortened, control characters escaped."""
    return printable(text if len(text) <= _MAX_VALUE_SHOWN * 2 else text[:_MAX_VALUE_SHOWN] + "…")


def _apart(given: str, meant: str) -> str:
    """What sets a text apart from one that it may look the same as: another script's letter, a blank at an end."""
    other = next((c for c in given if not c.isascii() and c not in meant), "")
    if other:
        return f", it holds U+{ord(other):04X} ({unicodedata.name(other, 'a character without a name')})"
    return "" if given == given.strip() else ", it begins or ends with a blank"


# ------------------------------------------------------------------------------------------------------------ scanner
@dataclass(frozen=True, slots=True)
class Statement:
    """One statement of a TOML file, with its full dotted key, its lines, its raw value and the comment behind it.

    `kind` is a key with a value, a table header, the header of a table in a list ("tables"), or what is neither:
    a header that is not one ("broken") and "junk". `depth` counts the brackets of a value, `closed` says whether each
    was closed; `place` is the character of the text that a value begins at.
    """

    kind: Literal["key", "table", "tables", "broken", "junk"]
    key: str
    line: int
    last_line: int
    value: str = ""
    comment: str = ""
    depth: int = 0
    closed: bool = True
    place: int = 0


_PART = r"""(?:[A-Za-z0-9_-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')"""
_KEY = rf"{_PART}(?:[ \t]*\.[ \t]*{_PART})*"
_ASSIGNED = re.compile(rf"[ \t]*({_KEY})[ \t]*=[ \t]*")
_HEADER = re.compile(rf"[ \t]*(\[\[?)[ \t]*({_KEY})[ \t]*\]\]?[ \t]*(?:#[^\n]*)?(?=\n|\Z)")
_BROKEN_HEADER = re.compile(rf"[ \t]*\[+[ \t]*({_KEY})")
_ITEM = re.compile(r"""[ \t]*\[[ \t]*(?:true|false|inf|nan|[0-9"'+-])""")
_TOKEN = re.compile(
    r'"""(?:[^\\]|\\.)*?(?:"""|\Z)'
    r"|'''.*?(?:'''|\Z)"
    r'|"(?:[^"\\\n]|\\[^\n])*"?'
    r"|'[^'\n]*'?"
    r"|\#[^\n]*|[\[\]{}]|\n|[^\"'\#\[\]{}\n]+",
    re.DOTALL,
)


@lru_cache(maxsize=8)
def scan(text: str) -> tuple[Statement, ...]:
    """Every statement of a TOML text, in order. Never fails: what is no statement is "junk".

    A list that is not closed ends where the next key or table begins.
    """
    statements: list[Statement] = []
    table, position, line = "", 0, 1
    while position < len(text):
        if assigned := _ASSIGNED.match(text, position):
            statement, end = _assignment(text, assigned, line, table)
            statements.append(statement)
        else:
            end = text.find("\n", position) + 1 or len(text)
            if stripped := text[position:end].strip().partition("#")[0]:
                statements.append(_header(text, position, line, stripped))
                table = _table_of(statements[-1], table)
        line += text.count("\n", position, end)
        position = end
    return tuple(statements)


def _header(text: str, position: int, line: int, stripped: str) -> Statement:
    if header := _HEADER.match(text, position):
        return Statement("tables" if header[1] == "[[" else "table", _plain_key(header[2]), line, line)
    if broken := _BROKEN_HEADER.match(text, position):
        return Statement("broken", _plain_key(broken[1]), line, line, stripped)
    return Statement("junk", "", line, line, stripped)


def _table_of(statement: Statement, table: str) -> str:
    """The table that the keys below a statement belong to; tables of a list are told apart by their lines."""
    if statement.kind == "junk":
        return table
    return f"{statement.key}#{statement.line}" if statement.kind == "tables" else statement.key


def _assignment(text: str, assigned: re.Match[str], line: int, table: str) -> tuple[Statement, int]:
    """The statement of a key, and where the next one begins."""
    start = position = value_end = assigned.end()
    depth = deepest = 0
    inside, behind = "", ""
    while token := _TOKEN.match(text, position):
        position, first = token.end(), token[0][0]
        if first == "\n" and (depth <= 0 or _begins_another(text, position)):
            break
        if first == "#":
            inside, behind = (inside or token[0], behind) if depth > 0 else (inside, token[0])
        else:
            depth += (first in "[{") - (first in "]}")
            deepest = max(deepest, depth)
            value_end = position
    value = text[start:value_end].strip()
    place = text.index(value, start)
    last_line = line + text.count("\n", start, start + len(text[start:value_end].rstrip()))
    key = _joined(table, _plain_key(assigned[1]))
    comment = (behind or inside).lstrip("#").strip()
    return Statement("key", key, line, last_line, value, comment, deepest, closed=depth <= 0, place=place), position


def _begins_another(text: str, position: int) -> bool:
    """Whether a line inside brackets can only be a new statement, so that the bracket was never closed."""
    if _ASSIGNED.match(text, position):
        return True
    return bool(_HEADER.match(text, position)) and not _ITEM.match(text, position)


def _plain_key(raw: str) -> str:
    """A dotted key without the quotes and spaces that TOML allows around its parts."""
    return ".".join(part.strip("\"'") for part in re.findall(_PART, raw))


def _joined(*parts: str) -> str:
    return ".".join(part for part in parts if part)


# ----------------------------------------------------------------------------------------------------------- document
class UnreadableError(Exception):
    """A file that cannot be taken at all: `reason`, and what is `expected` instead."""

    def __init__(self, reason: str, expected: str) -> None:
        """Keep both texts."""
        super().__init__(f"{reason}; expected {expected}")
        self.reason = reason
        self.expected = expected


@dataclass(slots=True)
class Document:
    """A file on its way to a record: its text, its data, what stands on which line, and the faults found so far.

    `label` is what a reader calls it ("mission file"). `prefix` is the table that the root of the file stands for, ""
    or "mirror"; keys are full ones everywhere. `damaged` keys were blanked out for a fault of their own and are not
    missed again. `inner` holds the documents that stand for a whole table. `names` are those of the keys that such a
    file has; what stands behind another one is not quoted, as it may be no file of ours. None is any name.
    """

    path: Path
    label: str
    prefix: str
    names: Collection[str] | None = None
    text: str = ""
    sha256: str = ""
    statements: dict[str, Statement] = field(default_factory=dict)
    data: dict[str, Any] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)
    damaged: set[str] = field(default_factory=set)
    inner: "dict[str, Document]" = field(default_factory=dict)

    @classmethod
    def read(
        cls,
        path: Path,
        label: str,
        prefix: str = "",
        names: Collection[str] | None = None,
        most_bytes: int = MAX_BYTES,
    ) -> Self:
        """Read, scan and parse a file.

        Args:
            path: The file.
            label: What a reader calls it, such as "mission file".
            prefix: Table that the root of the file stands for, empty for the whole mission.
            names: Keys that such a file has, None for any.
            most_bytes: Size beyond which it is no such file.

        Raises:
            UnreadableError: When it is no text.
            MissionError: When nothing in it can be parsed.
        """
        return cls.of(_content(path, most_bytes), path, label, prefix, names, most_bytes)

    @classmethod
    def of(
        cls,
        content: bytes,
        path: Path,
        label: str,
        prefix: str = "",
        names: Collection[str] | None = None,
        most_bytes: int = MAX_BYTES,
    ) -> Self:
        """Scan and parse the content of a file.

        Args:
            content: What the file holds, or would hold if it were written.
            path: Where it stands, or would stand.
            label: What a reader calls it, such as "mission file".
            prefix: Table that the root of the file stands for, empty for the whole mission.
            names: Keys that such a file has, None for any.
            most_bytes: Size beyond which it is no such file.

        Raises:
            UnreadableError: When it is no text.
            MissionError: When nothing in it can be parsed.
        """
        document = cls(path, label, prefix, names, _decoded(content, most_bytes), hashlib.sha256(content).hexdigest())
        _Parser(document).run()
        return document

    def fault(self, key: str, value: str, reason: str, expected: str, *, line: int = 0, nearest: str = "") -> None:
        """Note a fault on the line of its key, or of the nearest table above it, or else of the first one below it.

        Args:
            key: Full dotted key at fault.
            value: Its value as raw TOML, empty where there is none to show.
            reason: What is wrong, in words that follow the key.
            expected: What would be right.
            line: Line of the fault; 0 for that of the key.
            nearest: The right word that the wrong one resembles, in quotes where it stands for the value; empty for
                none.
        """
        holder = self.holder(key)
        if nearest:
            given = value[1:-1] if nearest.startswith('"') else key.rpartition(".")[2]
            reason += _apart(given, nearest)
        found = holder.statement(key)
        if found is None:  # a table that only has others inside it
            found = next((each for name, each in holder.statements.items() if name.startswith(f"{key}.")), None)
        line = line or (found.line if found else 0)
        if len(holder.faults) < _MAX_FAULTS:
            file = clipped(str(holder.path))
            quoted = value if holder.has(key) else ""
            holder.faults.append(Fault(clipped(key), quoted, line, reason, expected, nearest, file))

    def has(self, key: str) -> bool:
        """Whether a file of this kind has keys of this name."""
        return self.names is None or key.rpartition(".")[2] in self.names

    def holder(self, key: str) -> "Document":
        """The document that a key stands in."""
        return self.inner.get(key.partition(".")[0], self)

    def statement(self, key: str) -> Statement | None:
        """The statement of a key, or of the nearest table above it."""
        while key and key not in self.statements:
            key = key.rpartition(".")[0]
        return self.statements.get(key)

    def all_faults(self) -> list[Fault]:
        """The faults of this document and of those inside it."""
        return self.faults + [fault for document in self.inner.values() for fault in document.faults]


def _content(path: Path, most_bytes: int) -> bytes:
    try:
        if path.is_dir():
            raise UnreadableError("is a directory", "the path of a file")
        if path.exists() and not path.is_file():  # a pipe or a device may never end
            raise UnreadableError("is not a regular file", "the path of a file on disk")
        content = read_bytes(path, most_bytes + 1)
    except FileNotFoundError:
        raise UnreadableError("does not exist", "an existing file; `microrad init` writes one to start from") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise UnreadableError(f"cannot be read: {reason}", "a file that you may read") from None
    return content


def too_large(most_bytes: int) -> UnreadableError:
    """Why a file of more bytes cannot be taken."""
    return UnreadableError(f"is larger than {most_bytes // 1000} kB", "a TOML file of a few kB")


def _decoded(content: bytes, most_bytes: int) -> str:
    if len(content) > most_bytes:
        raise too_large(most_bytes)
    if b"\0" in content:
        raise UnreadableError("holds binary data", "a TOML file, plain text in UTF-8")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise UnreadableError(f"is not UTF-8 text (line {line})", "the file saved again as UTF-8") from None
    if content.count(b"\n") > MAX_LINES:
        raise UnreadableError(f"has more than {MAX_LINES} lines", "a TOML file of a few hundred lines")
    if not text.strip():
        raise UnreadableError("is empty", "a TOML file; `microrad init` writes one to start from")
    return text.replace("\r\n", "\n")


class _Parser:
    """Parses a document around its faults: what stops tomllib is noted and blanked out."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.lines = document.text.split("\n")
        self.statements = [
            replace(s, key=_joined(document.prefix, s.key)) if document.prefix else s for s in scan(document.text)
        ]

    def run(self) -> None:
        """Fill in the document's statements and data."""
        self._set_aside()
        tries = _MAX_SYNTAX_FAULTS if len(self.document.text) < _MAX_RETRIED_CHARACTERS else 1
        for _ in range(tries):
            try:
                self.document.data = tomllib.loads("\n".join(self.lines))
                self._check_names(self.document.data, self.document.prefix)
                return
            except tomllib.TOMLDecodeError as error:
                self._note_syntax(error)
            except (RecursionError, ValueError):  # nesting or digits that the scan did not see
                reason = "has a value that cannot be parsed: nested too deep, or a number of too many digits"
                self.document.fault("", "", reason, "simple values")
                break
        raise MissionError(self.document.path, self.document.faults)

    def _check_names(self, table: Mapping[str, Any], prefix: str) -> None:
        """Note names that would steer a terminal, which they are printed to, or hide what stands beside them."""
        for name, value in table.items():
            key = _joined(prefix, name)
            if not name.isprintable():
                reason = f'has the name "{clipped(name)}", with characters that cannot be printed'
                self.document.fault(key, "", reason, "a name of letters, digits and signs")
            for item in value if isinstance(value, list) else [value]:
                if isinstance(item, dict):
                    self._check_names(item, key)

    def _set_aside(self) -> None:
        """Note and blank out what the scan alone shows to be wrong."""
        place = 0
        while place < len(self.statements):
            statement = self.statements[place]
            first = self.document.statements.setdefault(statement.key, statement) if statement.key else statement
            trouble = _trouble(statement, first)
            if trouble:
                self._note(statement, *trouble)
                place = self._blank(place)
                if len(self.document.faults) == _MAX_FAULTS:
                    raise MissionError(self.document.path, self.document.faults)
            else:
                place += 1

    def _note(self, statement: Statement, reason: str, expected: str) -> None:
        value = "" if statement.kind == "table" else clipped(statement.value)
        key = "" if statement.kind == "broken" else statement.key
        if not self.document.has(statement.key):
            own = key.removeprefix(f"{self.document.prefix}.")
            key = key if any(map(self.document.has, own.split("."))) else ""
            if statement.kind == "broken" or reason.startswith(_NO_TOML):  # both texts may quote the line
                reason, expected = reason.partition(":")[0], _LINES
        self.document.fault(key, value, reason, expected, line=statement.line)

    def _blank(self, place: int) -> int:
        """Take a statement out of the lines to be parsed, a header with its keys; returns the place of the next one."""
        head = self.statements[place]
        self.document.damaged.add(head.key)
        end = place + 1
        if head.kind in ("table", "tables", "broken"):
            while end < len(self.statements) and self.statements[end].kind in ("key", "junk"):
                end += 1
        for each in self.statements[place:end]:
            self.lines[each.line - 1 : each.last_line] = [""] * (each.last_line - each.line + 1)
        return end

    def _note_syntax(self, error: tomllib.TOMLDecodeError) -> None:
        found = re.search(r"\(at line (\d+), column \d+\)", str(error))
        line = int(found[1]) if found else len(self.lines)
        # the parser stops behind an unclosed value: to blame is the last statement that began and still stands
        standing = [p for p, s in enumerate(self.statements) if s.line <= line and self.lines[s.line - 1].strip()]
        if not standing:
            self.document.fault("", "", f"{_NO_TOML}: {error}", "lines of key = value", line=line)
            raise MissionError(self.document.path, self.document.faults)
        statement = self.statements[standing[-1]]
        self._note(statement, *_syntax_advice(statement, re.sub(r" \(at .*\)$", "", str(error))))
        self._blank(standing[-1])


def _trouble(statement: Statement, first: Statement) -> tuple[str, str] | None:
    """Why a statement cannot be parsed, and what would do; `first` is the first statement of the same key."""
    if oversize := _oversize(statement):
        return oversize
    if first is not statement and statement.kind in ("key", "table"):
        what = "key" if statement.kind == "key" else "table"
        return f"this {what} stands twice, on lines {first.line} and {statement.line}", "one of the two removed"
    if statement.kind == "broken":
        return "is no table header", f"[{clipped(statement.key)}]"
    if statement.kind == "junk":
        return "is neither a key with its value nor a table header", _LINES
    if not statement.closed:
        return "has a bracket that is not closed", "a closing bracket before the next key"
    return None


def _oversize(statement: Statement) -> tuple[str, str] | None:
    """Why a statement would keep the parser busy for nothing."""
    if statement.depth > _MAX_DEPTH:
        return f"is nested {statement.depth} brackets deep", "a value, or a list of values"
    if len(statement.key) > _MAX_KEY:
        return f"is a key of {len(statement.key)} characters", "a key of the mission file"
    if _has_long_key(statement.value):
        return "holds a key of more than 50 parts", "a table with keys of its own"
    if len(statement.value) > _MAX_NUMBER and statement.value[0] in "+-0123456789":
        return f"is a number of {len(statement.value)} characters", "a number of at most 17 digits"
    return None


def _has_long_key(raw: str) -> bool:
    """Whether a value holds an inline table with a key of so many parts that parsing it takes minutes."""
    return "{" in raw and _MAX_PARTS.search(raw) is not None


def value_of(raw: str, parse_float: Callable[[str], Any] = float) -> object:
    """A raw value of TOML as data; None where it is none, or holds a key of more than 50 parts.

    Args:
        raw: The value, as it stands in a file.
        parse_float: Called with the text of each number that is not whole.
    """
    if _has_long_key(raw):
        return None
    try:
        return tomllib.loads(f"x = {raw}", parse_float=parse_float)["x"]
    except (ValueError, RecursionError):
        return None


def _syntax_advice(statement: Statement, detail: str) -> tuple[str, str]:
    """What is wrong with a statement that the parser refuses, and what would do."""
    name = statement.key.rpartition(".")[2]
    if statement.kind == "key" and not statement.value:
        return "has no value", f'{name} = "value"'
    if statement.kind == "key" and re.match(r"[^\"'\[{]", statement.value):
        return f"{_NO_TOML}: {detail}", f'text in quotes: {name} = "{clipped(statement.value)}"'
    return f"{_NO_TOML}: {detail}", "quotes and brackets closed, and one key = value on a line"
