"""Laboratory recordings: two columns of a text file, read fast, checked, and refused with the cell that is wrong.

Columns are named by the header or numbered from 0. Lines are counted from 1, as a text editor counts them. The values
keep the units of the file; `identify` is told what they are.
"""

from __future__ import annotations

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
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

MIN_SAMPLES = 200
MAX_BYTES = 2_000_000_000
_HEAD_BYTES = 1_000_000
_CHUNK_BYTES = 1 << 24
_TYPICAL_LINES = 200
_COMMENT = ("#", "%")
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]")
_DELIMITER_NAMES = {",": "comma", ";": "semicolon", "\t": "tab", None: "white space"}


class RecordingError(ValueError):
    """A recording that cannot be used: the message names the file, the place, the fault and the remedy."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Drive and output sampled together at a constant rate; the arrays are read-only.

    `drive` and `output` carry the units of their source. `sha256` is the digest of the file's bytes, or of the arrays
    where there was no file.
    """

    path: str
    sha256: str
    drive: FloatArray
    output: FloatArray
    rate_hz: float
    input_name: str
    output_name: str

    @property
    def step_s(self) -> float:
        """Time between two samples."""
        return 1.0 / self.rate_hz

    @property
    def samples(self) -> int:
        """Number of samples."""
        return int(self.drive.size)


@dataclass(frozen=True)
class _Layout:
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


def read_recording(path: str | Path, input_column: int | str, output_column: int | str, rate_hz: float) -> Recording:
    """Read drive and output from a text file of numbers.

    Comma, semicolon, tab or white space separates the columns; lines before the first row of numbers, and lines that
    start with # or %, are not data. A column is a header name or a number counted from 0. `rate_hz` is the sample rate.
    Raises `RecordingError`, naming line and column, for anything that is not two full columns of finite numbers.
    """
    path = Path(path)
    _check_rate(str(path), rate_hz)
    _check_file(path)
    layout = _layout(path)
    pair = (_column(path, layout, input_column, "input"), _column(path, layout, output_column, "output"))
    if pair[0] == pair[1]:
        raise RecordingError(
            f"{path}: input and output are both {layout.label(pair[0])}, so there is nothing to identify; "
            "give the drive as input and the sensor as output."
        )
    digest, regular = _scan(path, layout)
    values = _parse_fast(path, layout, pair) if regular else None
    if values is None:
        values = _parse_slowly(path, layout, pair)
    labels = (layout.label(pair[0]), layout.label(pair[1]))
    _check_values(str(path), values[0], values[1], labels)
    names = [layout.headers[0][c] if layout.headers else str(c) for c in pair]
    return Recording(str(path), digest, _frozen(values[0]), _frozen(values[1]), float(rate_hz), names[0], names[1])


def recording_from_arrays(drive: ArrayLike, output: ArrayLike, rate_hz: float, name: str = "arrays") -> Recording:
    """Make a recording from two one-dimensional arrays of equal length, under the same checks as a file.

    `name` stands where the path of a file would. Raises `RecordingError`.
    """
    _check_rate(name, rate_hz)
    u, y = (np.array(a, dtype=np.float64) for a in (drive, output))
    if u.ndim != 1 or u.shape != y.shape:
        raise RecordingError(
            f"{name}: drive has shape {u.shape} and output {y.shape}; give two one-dimensional arrays of equal length."
        )
    for label, values in (("the drive", u), ("the output", y)):
        if not np.isfinite(values).all():
            index = int(np.argmin(np.isfinite(values)))
            raise RecordingError(f"{name}: sample {index} of {label} is {values[index]}; remove or repair it.")
    _check_values(name, u, y, ("the drive", "the output"))
    digest = hashlib.sha256(u.tobytes() + y.tobytes()).hexdigest()
    return Recording(name, digest, _frozen(u), _frozen(y), float(rate_hz), "drive", "output")


# ---------------------------------------------------------------------------------------------------------- checks
def _frozen(values: FloatArray) -> FloatArray:
    values = np.ascontiguousarray(values)
    values.flags.writeable = False
    return values


def _check_rate(where: str, rate_hz: float) -> None:
    if isinstance(rate_hz, bool) or not isinstance(rate_hz, (int, float, np.number)) or not 0 < rate_hz < math.inf:
        raise RecordingError(
            f"{where}: the sample rate is {rate_hz!r}; give the samples per second as a positive number in Hz."
        )


def _check_file(path: Path) -> None:
    try:
        if path.is_dir():
            raise RecordingError(f"{path}: this is a directory; name one file in it.")
        if not path.exists():
            raise RecordingError(f"{path}: there is no such file; check the path{_nearest_file(path)}.")
        if not path.is_file():
            raise RecordingError(f"{path}: this is not a regular file; copy the data into a file first.")
        size = path.stat().st_size
    except (OSError, ValueError) as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(f"{path}: the file cannot be examined ({error}); check path and permissions.") from None
    if size == 0:
        raise RecordingError(f"{path}: the file is empty; record again or name another file.")
    if size > MAX_BYTES:
        raise RecordingError(
            f"{path}: the file has {size / 1e9:.1f} GB and at most {MAX_BYTES / 1e9:.0f} GB are read, because the "
            "columns are held in memory; cut out the part you need or keep every n-th sample."
        )


def _nearest_file(path: Path) -> str:
    try:
        names = [p.name for p in path.parent.iterdir()]
    except OSError:
        return ""
    near = difflib.get_close_matches(path.name, names, n=1)
    return f" (nearest name in that directory: '{near[0]}')" if near else ""


def _check_values(where: str, drive: FloatArray, output: FloatArray, labels: tuple[str, str]) -> None:
    if drive.size < MIN_SAMPLES:
        raise RecordingError(
            f"{where}: {drive.size} samples; at least {MIN_SAMPLES} are needed to tell a hysteresis loop from noise "
            "and to hold some back for the check; record longer or faster."
        )
    remedies = ("drive the mirror up and down", "check the sensor's wiring and range")
    for role, values, label, remedy in zip(("input", "output"), (drive, output), labels, remedies, strict=True):
        if np.ptp(values) <= 1e-12 * float(np.max(np.abs(values))):
            raise RecordingError(
                f"{where}: the {role}, {label}, is constant at {values[0]:g}, so nothing can be learnt from it; "
                f"choose another column or {remedy}."
            )


# ---------------------------------------------------------------------------------------------------------- layout
def _layout(path: Path) -> _Layout:
    head, complete = _read_head(path)
    encoding = _encoding(path, head)
    text = head.decode(encoding, errors="replace").replace("\r\n", "\n").replace("\r", "\n")
    lines = text.split("\n")
    if not complete:
        lines = lines[:-1]
    content = [line for line in lines if line.strip() and not line.lstrip().startswith(_COMMENT)]
    if not content:
        reason = "holds only blank lines and comments" if complete else "has no line break in its first megabyte"
        raise RecordingError(f"{path}: the file {reason}; a recording needs rows of numbers, one row per sample.")
    typical = content[-_TYPICAL_LINES:]
    delimiter = Counter(_guess_delimiter(line) for line in typical).most_common(1)[0][0]
    columns = Counter(len(_split(line, delimiter)) for line in typical).most_common(1)[0][0]
    first, headers = _header(path, lines, delimiter, columns)
    if columns == 1:
        raise RecordingError(
            f"{path}: only one column was found (line {first}: '{_short(lines[first - 1])}'); drive and output must "
            "stand side by side, separated by comma, semicolon, tab or white space."
        )
    return _Layout(delimiter, columns, headers, first, encoding)


def _read_head(path: Path) -> tuple[bytes, bool]:
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES + 1)
    except OSError as error:
        raise RecordingError(f"{path}: the file cannot be read ({error}); check its permissions.") from None
    return head[:_HEAD_BYTES], len(head) <= _HEAD_BYTES


def _encoding(path: Path, head: bytes) -> str:
    if _CONTROL.search(head):
        _refuse_binary(path, head)
    try:
        # The cut after a megabyte may fall inside a character: three bytes are forgiven.
        head[: max(len(head) - 3, 0) if len(head) == _HEAD_BYTES else None].decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def _refuse_binary(path: Path, chunk: bytes) -> None:
    what = "UTF-16 text" if chunk[:2] in (b"\xff\xfe", b"\xfe\xff") else "a binary file, not text"
    raise RecordingError(f"{path}: this is {what}; export the recording as plain text (CSV, UTF-8).")


def _guess_delimiter(line: str) -> str | None:
    if ";" in line:
        return ";"
    if "\t" in line.strip():
        return "\t"
    if "," in line:
        cells = line.split()
        commas = len(cells) > 1 and all(_DECIMAL_COMMA.fullmatch(cell) for cell in cells)
        return None if commas else ","
    return None


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    if '"' in line:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    return [cell.strip() for cell in line.split(delimiter)]


def _is_number(cell: str) -> bool:
    if _DECIMAL_COMMA.fullmatch(cell):
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
        if stripped.startswith(_COMMENT):
            commented.append(tuple(_split(stripped.lstrip("#% \t"), delimiter)))
            continue
        cells = _split(line, delimiter)
        if not _is_preamble(cells, columns):
            _check_comma_pairs(path, names, columns, delimiter, cells)
            rows = [row for row in names or commented[::-1] if len(row) == columns]
            return number, tuple(rows)
        names.append(tuple(cells))
    raise RecordingError(
        f"{path}: no row of numbers was found; the first line reads '{_short(lines[0])}'. Export the recording as "
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


def _short(text: str, limit: int = 40) -> str:
    text = text.strip()
    return text if len(text) <= limit else text[: limit - 1] + "…"


def _column(path: Path, layout: _Layout, wanted: int | str, role: str) -> int:
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
            f"{layout.columns - 1} ({_DELIMITER_NAMES[layout.delimiter]} between them)."
        )
    return number


def _unknown_name(path: Path, layout: _Layout, wanted: str, role: str) -> str:
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


# --------------------------------------------------------------------------------------------------------- reading
def _scan(path: Path, layout: _Layout) -> tuple[str, bool]:
    """Digest of the file, and whether each line from the first data line on has the expected number of cells."""
    digest, regular, skip = hashlib.sha256(), True, layout.first_line - 1
    for block in _blocks(path):
        digest.update(block)
        if b"\x00" in block:
            _refuse_binary(path, block)
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
        while chunk := file.read(_CHUNK_BYTES):
            head, newline, tail = chunk.rpartition(b"\n")
            if newline:
                yield b"".join([*parts, head, newline])
                parts = []
            parts.append(tail)
    if any(parts):
        yield b"".join(parts)


def _is_regular(text: bytes, layout: _Layout) -> bool:
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


def _parse_fast(path: Path, layout: _Layout, pair: tuple[int, int]) -> tuple[FloatArray, FloatArray] | None:
    """Both columns by the compiled reader, or nothing where it stumbles: the slow reader then says where."""
    try:
        table = np.loadtxt(
            str(path.resolve()),
            delimiter=layout.delimiter,
            comments=None,
            skiprows=layout.first_line - 1,
            usecols=pair,
            encoding=layout.encoding,
            ndmin=2,
        )
    except (ValueError, OSError, EOFError):
        return None
    if not np.isfinite(table).all():
        return None
    return table[:, 0].copy(), table[:, 1].copy()


def _parse_slowly(path: Path, layout: _Layout, pair: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Both columns line by line; raises at the first line or cell that is wrong."""
    columns: tuple[list[float], list[float]] = ([], [])
    with path.open(encoding=layout.encoding, errors="replace") as file:
        for number, line in enumerate(file, start=1):
            if number < layout.first_line or not line.strip() or line.lstrip().startswith(_COMMENT):
                continue
            cells = _split(line.rstrip("\n"), layout.delimiter)
            if len(cells) != layout.columns:
                raise RecordingError(
                    f"{path}: line {number} has {len(cells)} cells where {layout.columns} are expected, separated by "
                    f"{_DELIMITER_NAMES[layout.delimiter]} ('{_short(line)}'); repair or remove the line."
                )
            for column, values in zip(pair, columns, strict=True):
                values.append(_number(cells[column], path, layout, number, column))
    return np.array(columns[0]), np.array(columns[1])


def _number(cell: str, path: Path, layout: _Layout, line: int, column: int) -> float:
    where = f"{path}: line {line}, {layout.label(column)}"
    if not cell:
        raise RecordingError(f"{where}: the cell is empty; fill the gap or cut the recording there.")
    if _DECIMAL_COMMA.fullmatch(cell):
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
            f"{where}: '{_short(cell)}' is not a number; repair the cell, or start the line with # if it is a remark."
        )
    if not math.isfinite(value):
        raise RecordingError(
            f"{where}: '{_short(cell)}' is not a finite number; a gap or an overflow of the sensor must be cut out or "
            "repaired, because hysteresis remembers what happened in it."
        )
    return value
