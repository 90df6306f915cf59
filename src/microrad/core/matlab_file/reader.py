"""The variables of a MATLAB file of version 5 to 7, from their elements."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from microrad.core.matlab_file.records import Left, MatlabFileError, Structure, Unread
from microrad.core.matlab_file.streams import Packed, Stream, cut_off

MOST_DEPTH = 16
"""Structures and cells within each other."""
MOST_ARRAYS = 100_000
"""Variables, fields and cells of one file."""
_HEADER = 128
_KEPT = 16  # numbers; longer arrays are left in the file where it is listed only
_MOST_AXES, _MOST_NAME, _MOST_NAMES = 32, 4096, 1_000_000
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCTURE, _OBJECT, _TEXT, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_NUMBERS = range(6, 16)  # double, single, and whole numbers of 8 to 64 bits
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_ENCODINGS = {1: "utf-8", 2: "utf-8", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_COMPLEX, _LOGICAL = 0x0800, 0x0200

_UNREAD = {
    _CELL: Unread("cells", "save the numbers of each cell as an array"),
    _OBJECT: Unread("an object of MATLAB", "only MATLAB reads it: save its numbers as arrays"),
    _TEXT: Unread("text", "save numbers"),
    _SPARSE: Unread("a sparse matrix", "save it as full"),
    _FUNCTION: Unread("a function", "save numbers"),
    _OPAQUE: Unread("an object of MATLAB", "only MATLAB reads it: save its numbers as arrays"),
}
_LINES = Unread("text of several lines", "save it as cells of one line each")
_UNKNOWN = Unread("data of a kind that is not known", "save numbers")


class MatlabFile:
    """The variables of a file, by name.

    Each is an array of float, complex or bool, `Left`, `Structure`, or `Unread`; text and cells (an array of objects)
    are read only where the `whole` file is.
    """

    def __init__(self, path: Path, most_bytes: int, *, whole: bool = False) -> None:
        """Go through the variables; what is compressed may unpack to `most_bytes`.

        Raises `MatlabFileError` for a file that is damaged, of another version, or beyond the bounds, and OSError.
        """
        self._path, self._most, self._whole, self._arrays = path, most_bytes, whole, 0
        self._size = path.stat().st_size
        with path.open("rb") as file:
            self._order = _order(file.read(_HEADER))
            found = list(self._walk(file))
        self.variables = dict(zip(_distinct([name for name, _ in found]), (value for _, value in found), strict=True))

    def numbers(self, left: Left) -> NDArray[Any]:
        """Read the numbers that were left.

        Raises:
            MatlabFileError: Where they are damaged.
            OSError: Where the file cannot be read.
        """
        with self._path.open("rb") as file, _placed(left.variable):
            stream, _ = self._stream(file, left.variable, self._most)
            stream.skip(left.offset)
            values = self._values(stream, stream.end, left.shape, left.dtype)
            stream.finish()
            return values

    # -------------------------------------------------------------------------------------------------------- elements
    def _walk(self, file: IO[bytes]) -> Iterator[tuple[str, Any]]:
        """Name and value of each variable behind the header."""
        position, allowed = _HEADER, self._most
        while position < self._size:
            with _placed(position):
                stream, following = self._stream(file, position, allowed)
                kind, end, _ = self._tag(stream, stream.end)
                if kind != _MATRIX:
                    raise MatlabFileError(f"a variable of type {kind}")
                name, value = self._matrix(stream, end, MOST_DEPTH)
                if not isinstance(value, Left):
                    stream.finish()
            if stream.packed:
                allowed -= stream.position
            position = following
            if name:  # what MATLAB keeps of its objects has none
                yield name, value

    def _stream(self, file: IO[bytes], position: int, most: int) -> tuple[Stream, int]:
        """The variable there, from its (unpacked) tag on, and the place of the next one."""
        file.seek(position)
        tag = file.read(8)
        kind, size = self._unsigned(tag) if len(tag) == 8 else (0, 8)
        following = position + 8 + size
        if following > self._size:
            raise cut_off(following - self._size)
        if kind == _COMPRESSED:
            return Packed(file, position, size, most), following
        file.seek(position)
        return Stream(file, position, 8 + size), following

    def _unsigned(self, data: bytes) -> tuple[int, ...]:
        return struct.unpack(f"{self._order}{len(data) // 4}I", data)

    def _tag(self, stream: Stream, end: int) -> tuple[int, int, int]:
        """Type of an element, and where its data and its padding end; the stream then stands at its data."""
        (kind,) = self._unsigned(stream.take(4, end))
        if kind >> 16:  # small data stand in the tag
            kind, size, room = kind & 0xFFFF, kind >> 16, 4
        else:
            (size,) = self._unsigned(stream.take(4, end))
            room = size if kind == _MATRIX else size + -size % 8
        last = stream.position + size
        if last > end or size > room:
            raise stream.beyond(last - end if last > end else size - room, end)
        return kind, last, min(stream.position + room, end)

    def _short(self, stream: Stream, end: int, most: int) -> tuple[int, bytes]:
        """Type and data of an element that no writer makes longer than `most` bytes."""
        kind, last, following = self._tag(stream, end)
        size = last - stream.position
        if size > most:
            raise MatlabFileError(f"a header of {size} bytes where at most {most} stand")
        data = stream.read(size)
        stream.skip(following - stream.position)
        return kind, data

    # -------------------------------------------------------------------------------------------------------- matrices
    def _matrix(self, stream: Stream, end: int, depth: int) -> tuple[str, Any]:
        """Name and value of a matrix: flags, dimensions, name, then what its class says."""
        self._arrays += 1
        if self._arrays > MOST_ARRAYS:
            raise _too_many()
        if not depth:
            raise MatlabFileError(f"structures and cells nest deeper than {MOST_DEPTH}", "save the arrays themselves")
        if stream.position == end:
            return "", np.zeros((0, 0))
        flags = self._whole_numbers(stream, end, 2)[0]
        if flags & 0xFF == _OPAQUE:
            return self._name(stream, end), _UNREAD[_OPAQUE]
        shape = self._whole_numbers(stream, end, _MOST_AXES)
        if min(shape) < 0:
            raise MatlabFileError(f"an array of shape {shape}")
        name = self._name(stream, end)
        return name, self._value(stream, end, flags, shape, depth)

    def _value(self, stream: Stream, end: int, flags: int, shape: tuple[int, ...], depth: int) -> Any:
        """Value of a matrix from its remaining elements."""
        kind = flags & 0xFF
        if kind in _NUMBERS:
            return self._array(stream, end, shape, _dtype(flags))
        if kind == _STRUCTURE:
            return self._structure(stream, end, math.prod(shape), depth)
        if self._whole and kind == _TEXT:
            return self._text(stream, end) if shape[0] <= 1 else _LINES
        if self._whole and kind == _CELL:
            return self._cells(stream, end, shape, depth)
        return _UNREAD.get(kind, _UNKNOWN)

    def _inner(self, stream: Stream, end: int, depth: int) -> Any:
        """Value of a field or a cell; the stream then stands behind it."""
        kind, last, following = self._tag(stream, end)
        if kind != _MATRIX:
            raise MatlabFileError(f"a field or cell of type {kind}")
        value = self._matrix(stream, last, depth - 1)[1]
        stream.skip(following - stream.position)
        return value

    def _array(self, stream: Stream, end: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any] | Left:
        """The numbers, or where they stand; how many there are is checked."""
        if self._whole or math.prod(shape) <= _KEPT:
            return self._values(stream, end, shape, dtype)
        left = Left(shape, dtype, stream.start, stream.position)
        self._counted(stream, end, math.prod(shape))
        return left

    def _counted(self, stream: Stream, end: int, count: int) -> tuple[str, int, int]:
        """Type, end and end of the padding of an element of `count` numbers."""
        kind, last, following = self._tag(stream, end)
        code = _TYPES.get(kind)
        size = last - stream.position
        if code is None:
            raise MatlabFileError(f"numbers of type {kind}")
        if size != count * int(code[1]):
            raise MatlabFileError(f"{size} bytes where {count} numbers of {code[1]} bytes are said to be")
        return code, last, following

    def _values(self, stream: Stream, end: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
        count = math.prod(shape)
        if not count:
            return np.zeros(shape, dtype)
        values = self._numbers(stream, end, count)
        if dtype.kind == "c":
            both = np.empty(count, complex)
            both.real, both.imag = values, self._numbers(stream, end, count)
            values = both
        return (values != 0 if dtype.kind == "b" else values).reshape(shape, order="F")

    def _numbers(self, stream: Stream, end: int, count: int) -> NDArray[Any]:
        """Numbers of an element as floats."""
        code, last, following = self._counted(stream, end, count)
        found = np.frombuffer(stream.read(last - stream.position), dtype=self._order + code)
        stream.skip(following - stream.position)
        with np.errstate(invalid="ignore"):  # a signalling NaN becomes a quiet one
            return found.astype(float, copy=False)

    def _whole_numbers(self, stream: Stream, end: int, most: int) -> tuple[int, ...]:
        """Flags or dimensions."""
        kind, data = self._short(stream, end, 4 * most)
        if kind not in (5, 6) or not data or len(data) % 4:
            raise MatlabFileError(f"a header of type {kind} with {len(data)} bytes")
        return struct.unpack(f"{self._order}{len(data) // 4}{'i' if kind == 5 else 'I'}", data)

    def _name(self, stream: Stream, end: int) -> str:
        return self._decoded(*self._short(stream, end, _MOST_NAME)).partition("\0")[0]

    def _text(self, stream: Stream, end: int) -> str:
        return self._decoded(*self._short(stream, end, self._most)) if stream.position < end else ""

    def _decoded(self, kind: int, data: bytes) -> str:
        if not data:
            return ""
        if kind not in _ENCODINGS:
            raise MatlabFileError(f"text of type {kind}")
        encoding = _ENCODINGS[kind]
        order = "" if encoding == "utf-8" else "-le" if self._order == "<" else "-be"
        return data.decode(encoding + order, "replace")

    def _cells(self, stream: Stream, end: int, shape: tuple[int, ...], depth: int) -> NDArray[Any]:
        # A list grows with what is there; the shape is a claim.
        found = [self._inner(stream, end, depth) for _ in range(math.prod(shape))]
        cells = np.empty(len(found), dtype=object)
        for place, each in enumerate(found):
            cells[place] = each
        return cells.reshape(shape, order="F")

    def _structure(self, stream: Stream, end: int, size: int, depth: int) -> Structure:
        """Length of a field's name, the names, then the fields of each structure."""
        length = self._whole_numbers(stream, end, 1)[0]
        _, data = self._short(stream, end, _MOST_NAMES)
        if length < 1 and data:
            raise MatlabFileError("a structure whose fields have no names")
        if len(data) > MOST_ARRAYS * max(length, 1):
            raise _too_many()
        fields = [data[i : i + length].split(b"\0")[0] for i in range(0, len(data), max(length, 1))]
        names = _distinct([field.decode("utf-8", "replace") for field in fields])
        elements = tuple({name: self._inner(stream, end, depth) for name in names} for _ in range(size if names else 0))
        return Structure(size, names, elements)


def _too_many() -> MatlabFileError:
    return MatlabFileError(f"it holds more than {MOST_ARRAYS} arrays", "save the arrays that are needed alone")


def _distinct(names: list[str]) -> tuple[str, ...]:
    """Names that stand more than once, which MATLAB never writes, numbered as SciPy does: x, _1_x, _2_x."""
    seen: dict[str, int] = {}
    for name in names:
        made = name
        while made in seen:
            seen[name] += 1
            made = f"_{seen[name]}_{name}"
        seen[made] = 0
    return tuple(seen)


@contextmanager
def _placed(position: int) -> Iterator[None]:
    """Say where what goes wrong stands, and call whatever damage leads to damage."""
    try:
        yield
    except MatlabFileError as error:
        raise MatlabFileError(f"the variable at byte {position}: {error}", error.remedy) from None
    except (ValueError, OverflowError, zlib.error) as error:
        raise MatlabFileError(f"the variable at byte {position}: {error}") from None


def _order(header: bytes) -> str:
    mark = header[126:128]
    if mark not in (b"IM", b"MI"):
        if 0 in header[:4]:
            raise MatlabFileError("it is of version 4 or none of MATLAB", "load it in MATLAB and save it with -v7")
        raise MatlabFileError("it has no header of version 5")
    return "<" if mark == b"IM" else ">"


def _dtype(flags: int) -> np.dtype[Any]:
    return np.dtype(complex if flags & _COMPLEX else bool if flags & _LOGICAL else float)
