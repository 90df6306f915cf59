"""LabVIEW measurement files: a header, then segments with a header of their own, then rows of numbers.

The format is National Instruments' "Specification for the LabVIEW Measurement File (.lvm)". The rows are read by the
same compiled reader as other text, so that a bad cell is refused with its line instead of becoming nan.
"""

import io
import mmap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from microrad.core.arrays import Floats
from microrad.lab.recording.files import sha256_of
from microrad.lab.recording.formats.source import Container, StatedRate
from microrad.lab.recording.formats.text import short
from microrad.lab.recording.records import RecordingError

_END = b"***End_of_Header***"
_SEPARATORS = {"tab": "\t", "comma": ",", "": "\t"}
_ENCODING = "latin-1"


@dataclass(frozen=True)
class _Segment:
    """One segment: its tags, the names of its columns, its rows, and where they stand in lines and in bytes."""

    tags: dict[str, list[str]]
    names: list[str]
    first_line: int
    rows: int
    span: tuple[int, int]


class LvmSource(Container):
    """An .lvm file. Segments that continue each other in time are joined; others are named `segment/channel`."""

    def __init__(self, path: Path) -> None:
        """Read the headers and count the rows."""
        self._header, segments = _structure(path)
        self._comma = self._header.get("Decimal_Separator", ".") == ","
        self._separator = _separator(path, self._header)
        self._x_columns = self._header.get("X_Columns", "One").casefold()
        self._segments = segments
        self._joined = len(segments) == 1 or self._contiguous()
        self._columns: list[tuple[int, int]] = []  # (segment, column in its rows) of each channel
        names, units = [], []
        for number, segment in enumerate(segments[:1] if self._joined else segments):
            for column, name, unit in self._channels(segment):
                self._columns.append((number, column))
                names.append(name if self._joined else f"{number}/{name}")
                units.append(unit)
        self.path, self.kind, self.channels, self.unusable, self.stated = path, "LVM", (), {}, {}
        self.names, self.units, self.sha256 = tuple(names), tuple(units), sha256_of(path)
        if not names:
            raise RecordingError(f"{path}: the LVM file has headers and no channel; record again.")

    def load(self, indices: Sequence[int]) -> list[Floats]:
        """The columns of the channels, segment behind segment where they are joined."""
        chosen = [self._columns[i] for i in indices]
        parts: dict[int, list[Floats]] = {}
        for number in dict.fromkeys(segment for segment, _ in chosen):
            mine = [k for k, (segment, _) in enumerate(chosen) if segment == number]
            followers = range(len(self._segments)) if self._joined else (number,)
            for n in followers:
                columns = self._parse(self._segments[n], [chosen[k][1] for k in mine], [indices[k] for k in mine])
                for k, values in zip(mine, columns, strict=True):
                    parts.setdefault(k, []).append(values)
        return [parts[k][0] if len(parts[k]) == 1 else np.concatenate(parts[k]) for k in range(len(indices))]

    def samples(self) -> tuple[int | None, ...]:
        """How many samples each channel has: the rows of its segments."""
        rows = [segment.rows for segment in self._segments]
        return tuple(sum(rows) if self._joined else rows[number] for number, _ in self._columns)

    def rates(self, indices: Sequence[int]) -> list[StatedRate]:
        """Sample rates of the channels, 1 / Delta_X, where the header states it."""
        found = []
        for index in indices:
            number, column = self._columns[index]
            values = self._segments[number].tags.get("Delta_X", [])
            channel = self._channel_number(column)
            step = self._number(values[channel]) if 0 <= channel < len(values) else None
            if step:
                found.append(StatedRate(1 / step, f"Delta_X = {step:g} s of '{self.names[index]}'"))
        return list(dict.fromkeys(found))

    def find_time(self, used: Sequence[int]) -> int | None:
        """The X column before the first channel in use, unless it is the segments' own and they are joined."""
        if self._x_columns == "no" or not used or (self._joined and len(self._segments) > 1):
            return None
        number, column = self._columns[used[0]]
        own = max((c for s, c in self._columns if s == number and c < column and self._is_x(c)), default=None)
        return None if own is None else self._columns.index((number, own))

    def place(self, row: int) -> str:
        """`line 12`, counted from 1, of the first segment that holds the row."""
        for segment in self._segments:
            if row < segment.rows:
                return f"line {segment.first_line + row}"
            row -= segment.rows
        return "the end"

    # ------------------------------------------------------------------------------------------------------ layout
    def _is_x(self, column: int) -> bool:
        return column == 0 if self._x_columns == "one" else self._x_columns == "multi" and column % 2 == 0

    def _channel_number(self, column: int) -> int:
        return column // 2 if self._x_columns == "multi" else column - 1

    def _channels(self, segment: _Segment) -> Iterator[tuple[int, str, str]]:
        """Column, name and unit of each column that holds numbers."""
        names = segment.names[:-1] if segment.names[-1:] == ["Comment"] else segment.names
        units = segment.tags.get("Y_Unit_Label", [])
        seen: dict[str, int] = {}
        for column, name in enumerate(names):
            if column == 0 and self._x_columns == "no":
                continue
            k = self._channel_number(column)
            unit = "" if self._is_x(column) or not 0 <= k < len(units) else units[k]
            seen[name] = seen.get(name, 0) + 1
            yield column, name if seen[name] == 1 else f"{name}_{seen[name] - 1}", unit

    def _number(self, text: str) -> float | None:
        try:
            return float(text.replace(",", ".") if self._comma else text)
        except ValueError:
            return None

    def _start_s(self, segment: _Segment) -> float | None:
        """Time of the first sample, from date, time and X0."""
        tags = segment.tags
        try:
            clock = tags["Time"][0].replace(",", ".")[:15]
            x0 = self._number(tags.get("X0", ["0"])[0]) or 0.0
            return datetime.strptime(f"{tags['Date'][0]} {clock}", "%Y/%m/%d %H:%M:%S.%f").timestamp() + x0
        except (KeyError, IndexError, ValueError):
            return None

    def _contiguous(self) -> bool:
        """Whether each segment has the channels of the first and starts one step behind the end of the one before."""
        for before, after in zip(self._segments, self._segments[1:], strict=False):
            starts = self._start_s(before), self._start_s(after)
            step = self._number((before.tags.get("Delta_X") or [""])[0])
            if before.names != after.names or before.tags.get("Delta_X") != after.tags.get("Delta_X"):
                return False
            # The clock of the header is cut to microseconds.
            if None in starts or not step or abs(starts[1] - starts[0] - before.rows * step) > 0.5 * step + 2e-6:  # type: ignore[operator]
                return False
        return True

    # ----------------------------------------------------------------------------------------------------- reading
    def _parse(self, segment: _Segment, columns: list[int], indices: list[int]) -> list[Floats]:
        layout: dict[str, Any] = {"delimiter": self._separator, "comments": None, "usecols": tuple(columns), "ndmin": 2}
        with self.path.open("rb") as file:
            file.seek(segment.span[0])
            rows = file.read(segment.span[1] - segment.span[0])
        try:
            rows = rows.replace(b",", b".") if self._comma else rows
            table = np.loadtxt(io.BytesIO(rows), encoding=_ENCODING, **layout) if rows else np.empty((0, len(columns)))
        except (ValueError, IndexError):
            table = np.empty((0, 0))
        if len(table) != segment.rows or not np.isfinite(table).all():
            self._find_fault(segment, columns, indices)
        return [np.ascontiguousarray(table[:, k]) for k in range(len(columns))]

    def _find_fault(self, segment: _Segment, columns: list[int], indices: list[int]) -> None:
        with self.path.open(encoding=_ENCODING, newline="\n") as file:
            for number, line in enumerate(islice(file, segment.first_line - 1, None), start=segment.first_line):
                cells = line.rstrip("\r\n").split(self._separator)
                for column, index in zip(columns, indices, strict=True):
                    cell = cells[column].strip() if column < len(cells) else ""
                    value = self._number(cell)
                    if value is None or not np.isfinite(value):
                        what = f"'{short(cell)}' is not a finite number" if cell else "the cell is empty"
                        raise RecordingError(
                            f"{self.path}: line {number}, {self.label(index)}: {what}; repair the cell or cut the "
                            "recording there, because hysteresis remembers what happened in a gap."
                        )
        raise RecordingError(
            f"{self.path}: the rows from line {segment.first_line} cannot be read as numbers; export the recording "
            "again from LabVIEW."
        )


def _separator(path: Path, header: dict[str, str]) -> str:
    word = header.get("Separator", "Tab")
    if word.casefold() not in _SEPARATORS:
        raise RecordingError(
            f"{path}: the header names the separator '{short(word)}'; LVM files have Tab or Comma: correct that word, "
            "or export the recording again from LabVIEW."
        )
    return _SEPARATORS[word.casefold()]


def _structure(path: Path) -> tuple[dict[str, str], list[_Segment]]:
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        end = data.find(_END)
        if end < 0:
            raise RecordingError(f"{path}: the LVM file has no '***End_of_Header***': it is truncated; copy it again.")
        lines = bytes(data[:end]).decode(_ENCODING).splitlines()
        separator = "," if any(line.casefold().startswith("separator,comma") for line in lines) else "\t"
        pairs = (line.split(separator) for line in lines)
        header = {cells[0]: cells[1] for cells in pairs if len(cells) > 1}
        segments, position, blanks = [], _next_line(data, end), _Blanks(data, separator)
        line = bytes(data[:position]).count(b"\n") + 1
        while (mark := data.find(_END, position)) >= 0:
            segment, position, line = _segment(path, data, position, mark, line, separator, blanks)
            segments.append(segment)
    if not segments:
        raise RecordingError(
            f"{path}: the LVM file has no segment with a header, so its channels have no names and no time; write it "
            "with 'one header per segment', or cut the file header off and name the rest .csv."
        )
    return header, segments


def _next_line(data: mmap.mmap, position: int) -> int:
    end = data.find(b"\n", position)
    return len(data) if end < 0 else end + 1


def _segment(
    path: Path, data: mmap.mmap, position: int, mark: int, line: int, separator: str, blanks: "_Blanks"
) -> tuple[_Segment, int, int]:
    tags = {}
    for row in bytes(data[position:mark]).decode(_ENCODING).splitlines():
        cells = row.split(separator)
        tags[cells[0]] = cells[1:]
    names_at = _next_line(data, mark)
    rows_at = _next_line(data, names_at)
    names = bytes(data[names_at:rows_at]).decode(_ENCODING).strip("\r\n").split(separator)
    while names and not names[-1]:
        names.pop()
    first_line = line + bytes(data[position:rows_at]).count(b"\n")
    end = blanks.behind(rows_at)
    rows = _count_lines(data, rows_at, end)
    if names[:1] != ["X_Value"]:
        raise RecordingError(
            f"{path}: line {first_line - 1} should name the columns, beginning with 'X_Value', and reads "
            f"'{separator.join(names)[:40]}'; export the recording again from LabVIEW."
        )
    return _Segment(tags, names, first_line, rows, (rows_at, end)), end, first_line + rows


class _Blanks:
    """Where the rows of segments end: at a blank line, or at the end of the file. Each kind is searched for once."""

    def __init__(self, data: mmap.mmap, separator: str) -> None:
        self._data, self._kinds = data, (b"\n\r\n", b"\n\n", f"\n{separator}\r\n".encode(), f"\n{separator}\n".encode())
        self._next = dict.fromkeys(self._kinds, -1)

    def behind(self, start: int) -> int:
        """Position behind the last of the rows that begin at `start`, which rises from call to call."""
        for kind, at in self._next.items():
            if at < start - 1:
                found = self._data.find(kind, start - 1)
                self._next[kind] = len(self._data) if found < 0 else found
        return min(min(self._next.values()) + 1, len(self._data))


def _count_lines(data: mmap.mmap, start: int, end: int) -> int:
    count, step = 0, 1 << 24
    for at in range(start, end, step):
        count += bytes(data[at : min(at + step, end)]).count(b"\n")
    return count + (end > start and data[end - 1 : end] != b"\n")
