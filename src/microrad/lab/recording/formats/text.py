"""Columns of a text file: read fast where every line is regular, else line by line to name the cell that is wrong."""

import csv
import difflib
import hashlib
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from microrad.core.arrays import Floats
from microrad.lab.recording.files import read_head
from microrad.lab.recording.formats.source import Source, StatedRate, bracketed_unit
from microrad.lab.recording.records import RecordingError

_HEAD_BYTES = 1_000_000
COMMENT = ("#", "%")
DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]")
DELIMITER_NAMES = {",": "comma", ";": "semicolon", "\t": "tab", None: "white space"}
# fmt: off
_UNITS = frozenset({
    "s", "ms", "us", "µs", "μs", "ns", "V", "mV", "uV", "kV", "volt", "volts", "Volt", "Volts", "A", "mA", "uA", "µA",
    "N", "mN", "m", "mm", "um", "µm", "μm", "nm", "pm", "rad", "mrad", "urad", "µrad", "μrad", "nrad", "deg", "°", "K",
    "°C", "Hz", "kHz", "%", "-", "1",
})
# fmt: on


@dataclass(frozen=True)
class Layout:
    """How the text is laid out, judged from its first megabyte."""

    delimiter: str | None
    columns: int
    headers: tuple[tuple[str, ...], ...]
    first_line: int
    encoding: str

    def label(self, column: int) -> str:
        """The column in the words of a message: `column 1 ('output')`, or its number alone where it has no name."""
        name = self.headers[0][column] if self.headers and column < len(self.headers[0]) else ""
        return f"column {column} ('{name}')" if name else f"column {column}"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, else their numbers."""
        return self.headers[0] if self.headers else tuple(map(str, range(self.columns)))

    @property
    def units(self) -> tuple[str, ...]:
        """Units in a row of their own, or in brackets behind the names; '' where there is none."""
        own = next((row for row in self.headers[1:] if _are_units(row)), None)
        return tuple(cell.strip("()[] ") for cell in own) if own else tuple(map(bracketed_unit, self.names))


def _are_units(cells: Sequence[str]) -> bool:
    filled = {cell.strip("()[] ") for cell in cells} - {""}
    return bool(filled) and filled <= _UNITS


def layout_of(path: Path, alone: bool = False) -> Layout:
    """Judge the layout from the first megabyte.

    Args:
        path: The file.
        alone: Whether there may be a single column.

    Raises:
        RecordingError: Where it is no table of numbers.
    """
    head = read_head(path, _HEAD_BYTES + 1)
    head, complete = head[:_HEAD_BYTES], len(head) <= _HEAD_BYTES
    encoding = _encoding(path, head)
    text = head.decode(encoding, errors="replace").replace("\r\n", "\n").replace("\r", "\n")
    lines = text.split("\n")[: None if complete else -1]
    content = [line for line in lines if line.strip() and not line.lstrip().startswith(COMMENT)]
    if not content:
        reason = "holds only blank lines and comments" if complete else "has no line break in its first megabyte"
        raise RecordingError(f"{path}: the file {reason}; export the recording as rows of numbers, one per sample.")
    typical = content[-200:]
    delimiter = Counter(_guess_delimiter(line) for line in typical).most_common(1)[0][0]
    columns = Counter(len(split(line, delimiter)) for line in typical).most_common(1)[0][0]
    if columns == 1 and alone:
        delimiter = ","  # a header of several words is one name
    first, headers = _header(path, lines, delimiter, columns)
    if columns == 1 and not alone:
        raise RecordingError(
            f"{path}: only one column was found (line {first}: '{short(lines[first - 1])}'); drive and output must "
            "stand side by side, separated by comma, semicolon, tab or white space."
        )
    return Layout(delimiter, columns, headers, first, encoding)


def _encoding(path: Path, head: bytes) -> str:
    if _CONTROL.search(head):
        refuse_binary(path, head)
    try:
        # The cut after a megabyte may fall inside a character: three bytes are forgiven.
        head[: max(len(head) - 3, 0) if len(head) == _HEAD_BYTES else None].decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def refuse_binary(path: Path, chunk: bytes) -> None:
    """Refuse a file that is no text; the message names what it is instead.

    Args:
        path: The file.
        chunk: Its first bytes.

    Raises:
        RecordingError: Always.
    """
    what = "UTF-16 text" if chunk[:2] in (b"\xff\xfe", b"\xfe\xff") else "a binary file, not text"
    raise RecordingError(f"{path}: this is {what}; export the recording as plain text (CSV, UTF-8).")


def _guess_delimiter(line: str) -> str | None:
    if ";" in line:
        return ";"
    if "\t" in line.strip():
        return "\t"
    if "," in line:
        cells = line.split()
        commas = len(cells) > 1 and all(DECIMAL_COMMA.fullmatch(cell) for cell in cells)
        return None if commas else ","
    return None


def split(line: str, delimiter: str | None) -> list[str]:
    """Cells of a line, without the white space about them.

    Args:
        line: The line.
        delimiter: What stands between two cells, None for white space.
    """
    if delimiter is None:
        return line.split()
    if '"' in line:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))]
    return [cell.strip() for cell in line.split(delimiter)]


def _is_number(cell: str) -> bool:
    if DECIMAL_COMMA.fullmatch(cell):
        return True
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell


def _header(
    path: Path, lines: Sequence[str], delimiter: str | None, columns: int
) -> tuple[int, tuple[tuple[str, ...], ...]]:
    """Number of the first data line, and the lines before it that have one name for each column."""
    names: list[tuple[str, ...]] = []
    commented: list[tuple[str, ...]] = []
    for number, line in enumerate(lines, start=1):
        stripped = line.strip()
        if not stripped:
            continue
        if stripped.startswith(COMMENT):
            commented.append(tuple(split(stripped.lstrip("#% \t"), delimiter)))
            continue
        cells = split(line, delimiter)
        words = any(cell and not _is_number(cell) for cell in cells)
        if not words or (len(cells) == columns and any(_is_number(cell) for cell in cells)):
            _check_comma_pairs(path, names, columns, delimiter, cells)
            rows = [row for row in names or commented[::-1] if len(row) == columns]
            return number, tuple(sorted(rows, key=_are_units))
        names.append(tuple(cells))
    raise RecordingError(
        f"{path}: no row of numbers was found; the first line reads '{short(lines[0])}'. Export the recording as "
        "text with one row of numbers per sample."
    )


def _check_comma_pairs(
    path: Path, names: Sequence[tuple[str, ...]], columns: int, delimiter: str | None, cells: Sequence[str]
) -> None:
    twice = bool(names) and 2 * len(names[-1]) == columns
    if delimiter == "," and twice and all(re.fullmatch(r"[+-]?\d+", c) for c in cells):
        raise RecordingError(
            f"{path}: the header names {len(names[-1])} columns and the rows have {columns}: decimal commas, which "
            "cannot be told from separating commas here; export with decimal points."
        )


def short(text: str, limit: int = 40) -> str:
    """The beginning of a text, fit for a message.

    Args:
        text: The text.
        limit: Largest number of characters.
    """
    text = text.strip()
    return text if len(text) <= limit else text[: limit - 1] + "…"


def column_of(path: Path, layout: Layout, wanted: int | str, role: str) -> int:
    """Number of the wanted column; a text of digits is a number unless it is a name in the header.

    Args:
        path: The file, for the message.
        layout: Its columns and headers.
        wanted: Name in a header, or number from 0.
        role: What the column is wanted for, in the words of a message.

    Raises:
        RecordingError: For no such column, or a name that several have.
    """
    matches = [[i for i, name in enumerate(row) if name == wanted] for row in layout.headers]
    hits = next((hit for hit in matches if hit), [])
    if len(hits) > 1:
        raise RecordingError(
            f"{path}: columns {', '.join(map(str, hits))} are all named '{wanted}'; give the {role} column by its "
            "number, counted from 0."
        )
    if hits:
        return hits[0]
    try:
        number = int(wanted)
    except ValueError:
        raise RecordingError(_unknown_name(path, layout, str(wanted), role)) from None
    if isinstance(wanted, bool) or not 0 <= number < layout.columns:
        raise RecordingError(
            f"{path}: there is no {role} column {wanted}: the file has {layout.columns} columns, numbered from 0 to "
            f"{layout.columns - 1} ({DELIMITER_NAMES[layout.delimiter]} between them)."
        )
    return number


def _unknown_name(path: Path, layout: Layout, wanted: str, role: str) -> str:
    if not layout.headers:
        return (
            f"{path}: no {role} column is named '{wanted}', because the file has no header line; give the column by "
            f"its number, 0 to {layout.columns - 1}."
        )
    names = layout.headers[0]
    folded = {name.casefold(): name for name in names}
    near = difflib.get_close_matches(wanted.casefold(), folded, n=1, cutoff=0.0)
    return (
        f"{path}: no {role} column is named '{wanted}'; the nearest is '{folded[near[0]]}'. The columns are "
        f"{', '.join(repr(name) for name in names[:20])}; a number counted from 0 does as well."
    )


class TextSource(Source):
    """A text of numbers: CSV, or columns separated by semicolon, tab or white space."""

    def __init__(self, path: Path, alone: bool = False) -> None:
        """Judge the layout from the head, then walk once through the file; a column may stand ``alone``."""
        self.path = path
        self.layout = layout_of(path, alone)
        self.names, self.units = self.layout.names, self.layout.units
        self.sha256, self._regular = _scan(path, self.layout)

    def label(self, index: int) -> str:
        """The column in the words of a message, such as `column 1 ('output')`."""
        return self.layout.label(index)

    def resolve(self, wanted: int | str, role: str) -> int:
        """Number of the column with a name in the header, or a number.

        Args:
            wanted: Name in a header, or number from 0.
            role: What the column is wanted for, in the words of a message.

        Raises:
            RecordingError: For no such column, or a name that several have.
        """
        return column_of(self.path, self.layout, wanted, role)

    def load(self, indices: Sequence[int]) -> list[Floats]:
        """Finite values of the columns; raises `RecordingError` at the first line or cell that is wrong."""
        values = _parse_fast(self.path, self.layout, indices) if self._regular else None
        return _parse_slowly(self.path, self.layout, indices) if values is None else values

    def rates(self, indices: Sequence[int]) -> list[StatedRate]:
        """None: such a text states its rate in a time column only."""
        return []

    def place(self, row: int) -> str:
        """The place of a sample in the words of a message, such as `line 12`, counted from 1."""
        with self.path.open(encoding=self.layout.encoding, errors="replace") as file:
            for number, line in enumerate(file, start=1):
                if number >= self.layout.first_line and line.strip() and not line.lstrip().startswith(COMMENT):
                    row -= 1
                    if row < 0:
                        return f"line {number}"
        return "the end"


def _scan(path: Path, layout: Layout) -> tuple[str, bool]:
    """Digest of the file, and whether each line from the first data line on has the expected number of cells."""
    digest, regular, skip = hashlib.sha256(), True, layout.first_line - 1
    for block in _blocks(path):
        digest.update(block)
        if b"\x00" in block:
            refuse_binary(path, block)
        if regular:
            text = block.replace(b"\r\n", b"\n")
            while skip and b"\n" in text:
                text, skip = text.partition(b"\n")[2], skip - 1
            regular = _is_regular(text, layout)
    return digest.hexdigest(), regular


def _blocks(path: Path) -> Iterator[bytes]:
    """Blocks of the file that end with a line."""
    parts: list[bytes] = []
    with path.open("rb") as file:
        while chunk := file.read(1 << 24):
            head, newline, tail = chunk.rpartition(b"\n")
            if newline:
                yield b"".join([*parts, head, newline])
                parts = []
            parts.append(tail)
    if any(parts):
        yield b"".join(parts)


def _is_regular(text: bytes, layout: Layout) -> bool:
    if b'"' in text or b"\r" in text:
        return False
    array = np.frombuffer(text if text.endswith(b"\n") else text + b"\n", dtype=np.uint8)
    ends = np.flatnonzero(array == 10)
    filled = np.diff(ends, prepend=-1) > 1
    if layout.delimiter is None:
        blank = array <= 32
        marks = np.flatnonzero(~blank & np.concatenate(([True], blank[:-1])))
        expected = layout.columns
    else:
        marks = np.flatnonzero(array == ord(layout.delimiter))
        expected = layout.columns - 1
    counts = np.diff(np.searchsorted(marks, ends), prepend=0)
    return bool(np.all(counts[filled] == expected))


def _parse_fast(path: Path, layout: Layout, indices: Sequence[int]) -> list[Floats] | None:
    """The columns by the compiled reader, or nothing where it stumbles: the slow reader then says where."""
    try:
        table = np.loadtxt(
            str(path.resolve()),
            delimiter=layout.delimiter,
            comments=None,
            skiprows=layout.first_line - 1,
            usecols=tuple(indices),
            encoding=layout.encoding,
            ndmin=2,
        )
    except (ValueError, OSError, EOFError):
        return None
    columns = [np.ascontiguousarray(table[:, k]) for k in range(len(indices))]
    return columns if all(np.isfinite(column).all() for column in columns) else None


def _parse_slowly(path: Path, layout: Layout, indices: Sequence[int]) -> list[Floats]:
    """The columns line by line; raises at the first line or cell that is wrong."""
    columns: list[list[float]] = [[] for _ in indices]
    with path.open(encoding=layout.encoding, errors="replace") as file:
        for number, line in enumerate(file, start=1):
            if number < layout.first_line or not line.strip() or line.lstrip().startswith(COMMENT):
                continue
            cells = split(line.rstrip("\n"), layout.delimiter)
            if len(cells) != layout.columns:
                count = f"{len(cells)} cell{'s' if len(cells) != 1 else ''}"
                raise RecordingError(
                    f"{path}: line {number} has {count} where {layout.columns} are expected, separated by "
                    f"{DELIMITER_NAMES[layout.delimiter]} ('{short(line)}'); repair or remove the line."
                )
            for column, values in zip(indices, columns, strict=True):
                values.append(_number(cells[column], path, layout, number, column))
    return [np.array(column) for column in columns]


def _number(cell: str, path: Path, layout: Layout, line: int, column: int) -> float:
    where = f"{path}: line {line}, {layout.label(column)}"
    if not cell:
        raise RecordingError(f"{where}: the cell is empty; fill the gap or cut the recording there.")
    if DECIMAL_COMMA.fullmatch(cell):
        raise RecordingError(
            f"{where}: '{cell}' has a decimal comma; export with decimal points, so that it reads "
            f"'{cell.replace(',', '.')}'."
        )
    try:
        value = float(cell) if "_" not in cell else None
    except ValueError:
        value = None
    if value is None:
        raise RecordingError(
            f"{where}: '{short(cell)}' is not a number; repair the cell, or start the line with # if it is a remark."
        )
    if not math.isfinite(value):
        raise RecordingError(
            f"{where}: '{short(cell)}' is not a finite number; a gap or an overflow of the sensor must be cut out or "
            "repaired, because hysteresis remembers what happened in it."
        )
    return value
