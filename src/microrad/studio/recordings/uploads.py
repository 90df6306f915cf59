"""Recordings dropped into the studio: streamed into a private folder, under limits of size and number.

Each has a folder of its own with a random key, in which it keeps its name. The files are there after a reload and for a
second tab; nothing is read from them here (see `microrad.studio.recordings.reading`).
"""

from __future__ import annotations

import asyncio
import os
import re
import secrets
import shutil
import tempfile
import time
from collections.abc import AsyncIterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from microrad.report.quantities import counted
from microrad.studio.guard import plain_files
from microrad.studio.guard.names import safe_name, shown

_KEY = re.compile(r"[0-9a-f]{16}")
_BLOCK_BYTES = 1 << 20
_PART = ".part"
_FORGOTTEN_NS = 3600 * 10**9  # nothing was written there for so long


class UploadError(ValueError):
    """A file that is not taken, or is not there; the message names it and says what to do."""


@dataclass(frozen=True, slots=True)
class UploadLimits:
    """Bytes of one file, number of files, and bytes of all of them together."""

    file_bytes: int = 200_000_000
    files: int = 20
    total_bytes: int = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Upload:
    """A stored file: its key among the uploads, its name as dropped, where it is, and its size in bytes."""

    key: str
    name: str
    path: Path
    size: int


class Uploads:
    """The uploads of a working folder, in `folder`, which nobody else may read."""

    def __init__(self, folder: Path, limits: UploadLimits | None = None) -> None:
        """Make the folder private; raises `UploadError` where it is something else or somebody else's.

        Args:
            folder: where the files lie.
            limits: of their sizes and number.
        """
        self.limits = limits or UploadLimits()
        self.folder = _private(folder)

    def hold_temporary_files(self) -> None:
        """Have this program's temporary files lie in the private folder, too: a form is spooled before it is read.

        It is called by the only studio of the folder as it starts: no file is on its way then, and what an earlier
        studio or a stranger has left there without a recording in it would count for one.
        """
        for place in self._places():
            if _stored(place) is None:
                shutil.rmtree(place, ignore_errors=True)
        spool = _private(self.folder / "spool")
        for path in _files(spool):
            if _status(path)[1] < time.time_ns() - _FORGOTTEN_NS:
                _remove(path)
        tempfile.tempdir = str(spool)

    async def save(self, name: str, blocks: AsyncIterator[bytes]) -> Upload:
        """Store a file as it arrives; what breaks off or is refused leaves nothing behind.

        Raises `NameRefusedError` for its name, and `UploadError` for its size, for one file too many, and for a disk
        that is full.

        Args:
            name: as it was dropped.
            blocks: the file's bytes as they arrive.
        """
        name = safe_name(name)
        try:
            place = self._reserve(name)
            try:
                with plain_files.new(place / _PART) as file:
                    await self._fill(file, name, blocks)
                    await asyncio.to_thread(os.fsync, file.fileno())
                (place / _PART).rename(place / name)
            except BaseException:  # the browser went away, too
                shutil.rmtree(place, ignore_errors=True)
                raise
        except OSError as error:
            raise UploadError(f"the file {shown(name)} could not be stored: {error.strerror or error}") from error
        return Upload(place.name, name, place / name, _status(place / name)[0])

    def too_large(self, name: str) -> str:
        """The refusal of a file that is over the limit."""
        return (
            f"the file {shown(name)} has more than {self.limits.file_bytes / 1e6:.4g} MB; cut out the part that you "
            "need, keep every n-th sample, or run microrad identify on the file, which needs no upload"
        )

    def _reserve(self, name: str) -> Path:
        """A new folder for one file: files on their way count, so that none slips in beside another."""
        places = self._places()
        if len(places) >= self.limits.files:
            there = f"{counted(len(places), 'recording')} {'is' if len(places) == 1 else 'are'} here already"
            raise UploadError(f"the file {shown(name)} is not taken: {there}; remove one first")
        place = plain_files.private(self.folder) / secrets.token_hex(8)  # the folder may have been removed meanwhile
        place.mkdir(mode=0o700)
        return place

    async def _fill(self, file: BinaryIO, name: str, blocks: AsyncIterator[bytes]) -> None:
        """Write the blocks, many at a time and in a thread, since a disk may stall."""
        size, waiting = 0, bytearray()
        async for block in blocks:
            size += len(block)
            if size > self.limits.file_bytes:
                raise UploadError(self.too_large(name))
            waiting += block
            if len(waiting) >= _BLOCK_BYTES:
                await self._write(file, name, waiting)
        await self._write(file, name, waiting)

    async def _write(self, file: BinaryIO, name: str, waiting: bytearray) -> None:
        if self._total() + len(waiting) > self.limits.total_bytes:
            raise UploadError(
                f"the file {shown(name)} is not taken: all recordings together may have "
                f"{self.limits.total_bytes / 1e6:.4g} MB; remove one first"
            )
        await asyncio.to_thread(file.write, bytes(waiting))
        await asyncio.to_thread(file.flush)
        waiting.clear()

    def listed(self) -> tuple[Upload, ...]:
        """The stored files, the oldest first."""
        places = sorted(self._places(), key=lambda place: (_status(place)[1], place.name))
        found = (_stored(place) for place in places)
        return tuple(each for each in found if each is not None)

    def get(self, key: str) -> Upload:
        """The stored file with this key; raises `UploadError`."""
        found = next((each for each in self.listed() if each.key == key), None)
        if found is None:
            raise UploadError("this recording is not here any more; drop the file again")
        return found

    def remove(self, key: str) -> None:
        """Delete a stored file; raises `UploadError` where there is none of this key."""
        shutil.rmtree(self.get(key).path.parent)

    def _places(self) -> list[Path]:
        return [p for p in _files(self.folder) if _KEY.fullmatch(p.name) and p.is_dir() and not p.is_symlink()]

    def _total(self) -> int:
        return sum(_status(path)[0] for place in self._places() for path in _files(place))


def _stored(place: Path) -> Upload | None:
    """The file in a folder of its own; None while it is on its way, and when another tab has removed it.

    A link is none: the folder may have come from a stranger, and a link could name any file of this machine.
    """
    found = next(
        (path for path in _files(place) if path.name != _PART and path.is_file() and not path.is_symlink()), None
    )
    return None if found is None else Upload(place.name, found.name, found, _status(found)[0])


def _files(place: Path) -> list[Path]:
    try:
        return list(place.iterdir())
    except FileNotFoundError:
        return []


def _status(path: Path) -> tuple[int, int]:
    """Size in bytes and last change in ns of a file, and of a link itself; 0 and 0 where there is none any more."""
    try:
        found = path.lstat()
    except FileNotFoundError:
        return 0, 0
    return found.st_size, found.st_mtime_ns


def _remove(path: Path) -> None:
    """Remove a file, or a folder with all that is in it; what cannot be removed stays."""
    if plain_files.is_folder(path):
        shutil.rmtree(path, ignore_errors=True)
        return
    with suppress(OSError):
        path.unlink()


def _private(folder: Path) -> Path:
    """The folder, made or made private; a link or another one's folder could be looked into."""
    try:
        return plain_files.private(folder)
    except OSError as error:
        where = f"{folder} cannot be made or made private: {error.strerror}"
        raise UploadError(f"{where}; choose another working folder") from error
