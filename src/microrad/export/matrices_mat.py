"""Reader of MATLAB files of version 5 to 7, for the few kinds of variable that a linear model is made of.

It is written here because a file from elsewhere may be damaged or hostile: the reader of SciPy 1.17 ends the process on
some of them. Nothing in a file is executed, and what a file may ask for in memory and depth is bounded.
Source of the format: MAT-File Format, MathWorks, chapter 1.
"""

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from microrad.export.records import ExportError

MOST_BYTES = 64_000_000
"""Bytes of a file, and of what it unpacks to, beyond which it holds no linear model."""
_MOST_DEPTH = 4  # cells in a structure in a structure
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCTURE, _OBJECT, _TEXT, _SPARSE, _OPAQUE = 1, 2, 3, 4, 5, 17
_NUMBERS = range(6, 16)  # double, single, and whole numbers of 8 to 64 bits
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_ENCODINGS = {1: "utf-8", 2: "utf-8", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_COMPLEX = 0x0800
_SAVE = "s = struct('A', sys.A, 'B', sys.B, 'C', sys.C, 'D', sys.D, 'Ts', sys.Ts); save('model.mat', 's', '-v7')"


@dataclass(frozen=True, slots=True)
class Structure:
    """A structure: how many elements it has, and its fields; their values only where it has one element."""

    size: int
    fields: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Unread:
    """A variable that is no array of numbers, text, cells or structure: what it is, in words."""

    kind: str


class _DamagedError(Exception):
    """Why the bytes are no MATLAB file."""


def load(path: Path) -> dict[str, Any]:
    """Variables by name: arrays of float or complex, arrays of objects for cells, str, `Structure` and `Unread`.

    Raises ExportError for a file that cannot be read: missing, too large, damaged, nested too deep, version 7.3.
    """
    data = _bytes(path)
    if data[:10] == b"MATLAB 7.3" or data[:8] == b"\x89HDF\r\n\x1a\n":
        raise ExportError(f"{path} is of version 7.3; save it as version 7: {_SAVE}")
    try:
        return dict(_Reader(data[126:128]).variables(data))
    except (_DamagedError, ValueError) as error:
        raise ExportError(f"{path} is no MATLAB file that can be read: {error}. Save it again: {_SAVE}") from error


def _bytes(path: Path) -> bytes:
    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise ExportError(f"{path} has {size} bytes; a linear model has at most {MOST_BYTES}: is it a recording?")
        return path.read_bytes()
    except OSError as error:
        raise ExportError(f"{path} cannot be read ({error.strerror or error}); check the path") from error


class _Reader:
    """Elements of one byte order: a tag of type and size, then data; small data stand in their tag."""

    def __init__(self, mark: bytes) -> None:
        if mark not in (b"IM", b"MI"):
            raise _DamagedError("it has no header of version 5")
        self.order = "<" if mark == b"IM" else ">"
        self.left = MOST_BYTES

    def variables(self, data: bytes) -> Iterator[tuple[str, Any]]:
        """Name and value of each variable behind the header of 128 bytes."""
        for kind, inner in self.elements(data[128:]):
            if kind == _COMPRESSED:
                kind, inner = next(self.elements(self.unpacked(inner)), (0, b""))  # noqa: PLW2901
            if kind != _MATRIX:
                raise _DamagedError(f"a variable of type {kind}")
            name, value = self.matrix(inner, _MOST_DEPTH)
            if name:  # what MATLAB keeps of its objects has none
                yield name, value

    def elements(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """Type and data of each element."""
        position = 0
        while position < len(data):
            if len(data) - position < 8:
                raise _DamagedError("an element is cut off")
            kind, size = struct.unpack_from(f"{self.order}II", data, position)
            start, padding = position + 8, 0 if kind == _COMPRESSED else -size % 8
            if kind >> 16:
                kind, size, start, padding = kind & 0xFFFF, kind >> 16, position + 4, 4 - (kind >> 16)
            if padding < 0 or start + size > len(data):
                raise _DamagedError("an element is cut off")
            yield kind, data[start : start + size]
            position = start + size + padding

    def unpacked(self, data: bytes) -> bytes:
        """What zlib packed, as far as the file may go."""
        try:
            found = zlib.decompressobj().decompress(data, self.left + 1)
        except zlib.error as error:
            raise _DamagedError(str(error)) from error
        self.left -= len(found)
        if self.left < 0:
            raise _DamagedError(f"it unpacks to more than {MOST_BYTES} bytes, a linear model has less")
        return found

    def matrix(self, data: bytes, depth: int) -> tuple[str, Any]:
        """Name and value of a matrix: flags, dimensions, name, then what its class says."""
        if not data:
            return "", np.zeros((0, 0))
        if not depth:
            raise _DamagedError(f"structures and cells nest deeper than {_MOST_DEPTH}")
        parts = self.elements(data)
        flags = int(self.numbers(*self.next(parts))[0])
        kind = flags & 0xFF
        if kind == _OPAQUE:
            return self.text(*self.next(parts)), Unread("an object of MATLAB")
        shape = tuple(int(n) for n in self.numbers(*self.next(parts)))
        name = self.text(*self.next(parts))
        if len(shape) != 2 or min(shape) < 0:
            return name, Unread(f"an array of {len(shape)} axes")
        return name, self.value(kind, shape, bool(flags & _COMPLEX), parts, depth)

    def value(
        self, kind: int, shape: tuple[int, ...], is_complex: bool, parts: Iterator[tuple[int, bytes]], depth: int
    ) -> Any:
        """Value of a matrix from its remaining elements."""
        if kind in _NUMBERS:
            real = self.numbers(*self.next(parts), math.prod(shape))
            values = real + 1j * self.numbers(*self.next(parts), real.size) if is_complex else real
            return values.reshape(shape, order="F")
        if kind == _TEXT:
            return self.text(*self.next(parts))
        if kind == _CELL:
            found = [self.matrix(self.next(parts)[1], depth - 1)[1] for _ in range(math.prod(shape))]
            cells = np.empty(len(found), dtype=object)
            for place, each in enumerate(found):
                cells[place] = each
            return cells.reshape(shape, order="F")
        if kind == _STRUCTURE:
            return self.structure(math.prod(shape), parts, depth)
        return Unread(
            {_SPARSE: "a sparse matrix (save it as full)", _OBJECT: "an object of MATLAB"}.get(kind, "no data")
        )

    def structure(self, size: int, parts: Iterator[tuple[int, bytes]], depth: int) -> Structure:
        """Length of a field's name, the names, then the fields."""
        length = int(self.numbers(*self.next(parts))[0])
        _, names = self.next(parts)
        if length < 1:
            raise _DamagedError("a structure whose fields have no names")
        fields = [
            names[i : i + length].split(b"\0")[0].decode("ascii", "replace") for i in range(0, len(names), length)
        ]
        if size != 1:
            return Structure(size, dict.fromkeys(fields))
        return Structure(size, {field: self.matrix(self.next(parts)[1], depth - 1)[1] for field in fields})

    @staticmethod
    def next(parts: Iterator[tuple[int, bytes]]) -> tuple[int, bytes]:
        """The next element of a matrix, which must have one."""
        found = next(parts, None)
        if found is None:
            raise _DamagedError("a variable lacks its data")
        return found

    def numbers(self, kind: int, data: bytes, count: int = -1) -> Any:
        """Numbers of an element as floats; ``count`` of them where it is known."""
        if kind not in _TYPES:
            raise _DamagedError(f"numbers of type {kind}")
        found = np.frombuffer(data, dtype=self.order + _TYPES[kind]).astype(float)
        if found.size != count if count >= 0 else not found.size:
            raise _DamagedError(f"{found.size} numbers where {count if count >= 0 else 'some'} are said to be")
        return found

    def text(self, kind: int, data: bytes) -> str:
        """Text of an element."""
        if kind not in _ENCODINGS:
            raise _DamagedError(f"text of type {kind}")
        encoding = _ENCODINGS[kind]
        return data.decode(encoding if encoding == "utf-8" else encoding + ("-le" if self.order == "<" else "-be"))
