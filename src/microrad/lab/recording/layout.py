"""How a text of numbers is laid out: delimiter, columns, names, units, first row, encoding."""

from __future__ import annotations

import csv
import difflib
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from microrad.lab.recording.files import read_head
from microrad.lab.recording.records import RecordingError
from microrad.lab.recording.sources import bracketed_unit

_HEAD_BYTES = 1_000_000
_TYPICAL_LINES = 200
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
        """`column 1 ('output')`, or the number alone where the file has no names."""
        name = self.headers[0][column] if self.headers and column < len(self.headers[0]) else ""
        return f"column {column} ('{name}')" if name else f"column {column}"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, else their numbers."""
        return self.headers[0] if self.headers else tuple(map(str, range(self.columns)))

    @property
    def units(self) -> tuple[str, ...]:
        """Units in a row of their own, or in brackets behind the names; '' where there is none."""
        for row in self.headers[1:]:
            cells = tuple(cell.strip("()[] ") for cell in row)
            if _are_units(cells):
                return cells
        return tuple(bracketed_unit(name) for name in self.names)


def _are_units(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if cell.strip("()[] ")]
    return bool(filled) and all(cell.strip("()[] ") in _UNITS for cell in filled)


def layout_of(path: Path) -> Layout:
    """Judge the layout from the first megabyte; raises `RecordingError` where it is no table of numbers."""
    head, complete = _read_start(path)
    encoding = _encoding(path, head)
    text = head.decode(encoding, errors="replace").replace("\r\n", "\n").replace("\r", "\n")
    lines = text.split("\n")
    if not complete:
        lines = lines[:-1]
    content = [line for line in lines if line.strip() and not line.lstrip().startswith(COMMENT)]
    if not content:
        reason = "holds only blank lines and comments" if complete else "has no line break in its first megabyte"
        raise RecordingError(f"{path}: the file {reason}; export the recording as rows of numbers, one per sample.")
    typical = content[-_TYPICAL_LINES:]
    delimiter = Counter(_guess_delimiter(line) for line in typical).most_common(1)[0][0]
    columns = Counter(len(split(line, delimiter)) for line in typical).most_common(1)[0][0]
    first, headers = _header(path, lines, delimiter, columns)
    if columns == 1:
        raise RecordingError(
            f"{path}: only one column was found (line {first}: '{short(lines[first - 1])}'); drive and output must "
            "stand side by side, separated by comma, semicolon, tab or white space."
        )
    return Layout(delimiter, columns, headers, first, encoding)


def _read_start(path: Path) -> tuple[bytes, bool]:
    head = read_head(path, _HEAD_BYTES + 1)
    return head[:_HEAD_BYTES], len(head) <= _HEAD_BYTES


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
    """Refuse what is no text, by the name of what it is."""
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
    """Cells of a line."""
    if delimiter is None:
        return line.split()
    if '"' in line:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
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
        if not _is_preamble(cells, columns):
            _check_comma_pairs(path, names, columns, delimiter, cells)
            rows = [row for row in names or commented[::-1] if len(row) == columns]
            return number, tuple(sorted(rows, key=_are_units))
        names.append(tuple(cells))
    raise RecordingError(
        f"{path}: no row of numbers was found; the first line reads '{short(lines[0])}'. Export the recording as "
        "text with one row of numbers per sample."
    )


def _is_preamble(cells: Sequence[str], columns: int) -> bool:
    words = any(cell and not _is_number(cell) for cell in cells)
    return words and (len(cells) != columns or not any(_is_number(cell) for cell in cells))


def _check_comma_pairs(
    path: Path, names: Sequence[tuple[str, ...]], columns: int, delimiter: str | None, cells: Sequence[str]
) -> None:
    if (
        delimiter == ","
        and names
        and 2 * len(names[-1]) == columns
        and all(re.fullmatch(r"[+-]?\d+", c) for c in cells)
    ):
        raise RecordingError(
            f"{path}: the header names {len(names[-1])} columns and the rows have {columns}: decimal commas, which "
            "cannot be told from separating commas here; export with decimal points."
        )


def short(text: str, limit: int = 40) -> str:
    """The beginning of a text, fit for a message."""
    text = text.strip()
    return text if len(text) <= limit else text[: limit - 1] + "…"


def column_of(path: Path, layout: Layout, wanted: int | str, role: str) -> int:
    """Number of the wanted column; a text of digits is a number unless it is a name in the header."""
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
