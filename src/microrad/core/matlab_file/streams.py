"""Bytes of one variable, stored or packed; no more of them are in memory than are asked for."""

from __future__ import annotations

import zlib
from typing import IO

from microrad.core.matlab_file.records import MatlabFileError

_CHUNK, _MOST_CHUNK = 1 << 16, 1 << 20


class Stream:
    """Stored bytes in order, from byte `start` of the file on; `position` counts from there, up to `end`."""

    packed = False

    def __init__(self, file: IO[bytes], start: int, size: int) -> None:
        """The file stands at the first byte."""
        self._file, self.start, self.end, self.position = file, start, size, 0

    def take(self, count: int, end: int) -> bytes:
        """The next bytes, which must not go beyond an end.

        Args:
            count: How many bytes.
            end: Position in the stream behind the last byte that may be taken.

        Raises:
            MatlabFileError: Where they go beyond it, or there are fewer.
        """
        if self.position + count > end:
            raise self.beyond(self.position + count - end, end)
        return self.read(count)

    def read(self, count: int) -> bytes:
        """The next bytes.

        Raises:
            MatlabFileError: Where there are fewer.
        """
        data = self._file.read(count)
        if len(data) < count:
            raise cut_off(count - len(data))
        self.position += count
        return data

    def skip(self, count: int) -> None:
        """Leave bytes out."""
        self._file.seek(count, 1)
        self.position += count

    def finish(self) -> None:
        """Go to the end, where what was packed has its checksum.

        Raises:
            MatlabFileError: Where the packed data are cut off, or unpack to too much.
            zlib.error: Where they are damaged.
        """

    def beyond(self, missing: int, end: int) -> MatlabFileError:
        """The error for data that are said to go beyond an end.

        Args:
            missing: Bytes that are beyond it.
            end: The position of that end.
        """
        return too_much(end) if self.packed and end == self.end else cut_off(missing)


class Packed(Stream):
    """What zlib packed into `size` bytes, unpacked as far as it is asked for, up to `most` bytes."""

    packed = True

    def __init__(self, file: IO[bytes], start: int, size: int, most: int) -> None:
        """The file stands at the first packed byte."""
        super().__init__(file, start, most)
        self._left, self._zlib, self._ready = size, zlib.decompressobj(), bytearray()

    def read(self, count: int) -> bytes:
        """The next bytes.

        Raises:
            MatlabFileError: Where there are fewer, or more than `most` before them.
        """
        while len(self._ready) < count:
            self._unpack(count - len(self._ready))
        data = bytes(memoryview(self._ready)[:count])
        del self._ready[:count]
        self.position += count
        return data

    def skip(self, count: int) -> None:
        """Unpack bytes and leave them out."""
        while count > 0:
            part = min(count, _MOST_CHUNK)
            self.read(part)
            count -= part

    def finish(self) -> None:
        """Unpack to the end, where the checksum stands."""
        while not self._zlib.eof:
            self.position += len(self._ready)
            self._ready.clear()
            self._unpack(_MOST_CHUNK)

    def _unpack(self, wanted: int) -> None:
        """Some bytes more; none where the end has just been seen."""
        if self._zlib.eof:
            raise _cut_off_packed()
        packed = self._zlib.unconsumed_tail
        if not packed:
            packed = self._file.read(min(_CHUNK, self._left))
            self._left -= len(packed)
        found = self._zlib.decompress(packed, max(min(wanted, _MOST_CHUNK), _CHUNK))
        if not (found or packed or self._zlib.eof):
            raise _cut_off_packed()
        if self.position + len(self._ready) + len(found) > self.end:
            raise too_much(self.end)
        self._ready += found


def cut_off(missing: int) -> MatlabFileError:
    """Words for bytes that are said to be there and are not."""
    return MatlabFileError(f"an element is cut off, {missing} bytes of it are missing")


def _cut_off_packed() -> MatlabFileError:
    return MatlabFileError("its compressed data are cut off")


def too_much(most: int) -> MatlabFileError:
    """Words for a file that unpacks to more than may be."""
    return MatlabFileError(
        f"it unpacks to more than {most} bytes", "save it without compression (-v6), or the part that is needed"
    )
