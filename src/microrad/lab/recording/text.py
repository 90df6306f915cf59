"""Columns of a text file: read fast where every line is regular, else line by line to name the cell that is wrong."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from microrad.lab.recording.layout import (
    COMMENT,
    DECIMAL_COMMA,
    DELIMITER_NAMES,
    Layout,
    column_of,
    layout_of,
    refuse_binary,
    short,
    split,
)
from microrad.lab.recording.records import FloatArray, RecordingError
from microrad.lab.recording.sources import Source, StatedRate

_CHUNK_BYTES = 1 << 24


class TextSource(Source):
    """A text of numbers: CSV, or columns separated by semicolon, tab or white space."""

    def __init__(self, path: Path) -> None:
        """Judge the layout from the head, then walk once through the file for digest and regularity."""
        self.path = path
        self.layout = layout_of(path)
        self.names, self.units = self.layout.names, self.layout.units
        self.sha256, self._regular = _scan(path, self.layout)

    def label(self, index: int) -> str:
        """`column 1 ('output')`."""
        return self.layout.label(index)

    def resolve(self, wanted: int | str, role: str) -> int:
        """Header name or number."""
        return column_of(self.path, self.layout, wanted, role)

    def load(self, indices: Sequence[int]) -> list[FloatArray]:
        """Finite values of the columns; raises `RecordingError` at the first line or cell that is wrong."""
        values = _parse_fast(self.path, self.layout, indices) if self._regular else None
        return _parse_slowly(self.path, self.layout, indices) if values is None else values

    def rates(self, indices: Sequence[int]) -> list[StatedRate]:
        """None: such a text states its rate in a time column only."""
        return []

    def place(self, row: int) -> str:
        """`line 12`, counted from 1."""
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
        while chunk := file.read(_CHUNK_BYTES):
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


def _parse_fast(path: Path, layout: Layout, indices: Sequence[int]) -> list[FloatArray] | None:
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


def _parse_slowly(path: Path, layout: Layout, indices: Sequence[int]) -> list[FloatArray]:
    """The columns line by line; raises at the first line or cell that is wrong."""
    columns: list[list[float]] = [[] for _ in indices]
    with path.open(encoding=layout.encoding, errors="replace") as file:
        for number, line in enumerate(file, start=1):
            if number < layout.first_line or not line.strip() or line.lstrip().startswith(COMMENT):
                continue
            cells = split(line.rstrip("\n"), layout.delimiter)
            if len(cells) != layout.columns:
                raise RecordingError(
                    f"{path}: line {number} has {len(cells)} cells where {layout.columns} are expected, separated by "
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
