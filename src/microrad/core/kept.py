"""Parts of a study that are kept from one run to the next, in a folder of the user's.

A part is a function of frozen records. What it returned is taken again where everything that it has read is the same
(see `reads`), and the code, its libraries and whatever of the machine changes its arithmetic are, too. What is damaged,
or was written by other code, is made again without a word. The folder may be deleted at any time.
"""

import hashlib
import os
import pickle
import stat
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar, cast

from microrad.core.folder import write_whole
from microrad.core.machine import machine, source_sha256, versions
from microrad.core.reads import Reads, digest, watched_call

_Result = TypeVar("_Result")

MOST_BYTES = 500_000_000
"""Size of the folder beyond which the parts that were not used for longest are deleted."""

MOST_OF_A_PART = 40
"""Results of one part that are kept: some are made many times in one run, and a sweep goes back and forth."""

OFF = "MICRORAD_KEEP"
"""Variable of the environment that turns it off where it is "no"."""

_MARK = b"microrad part 1\n"
_DIGEST = 32


def folder_of_user() -> Path | None:
    """Where the parts of this user stand; None for a user without a home."""
    try:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    except RuntimeError:
        return None
    return Path(base) / "microrad" / "parts"


class Kept:
    """The kept parts of one run. ``trouble`` says, in one sentence, why nothing can be kept; it is empty otherwise."""

    def __init__(
        self, folder: Path | None, beside: Callable[[], Any] = lambda: None, most_bytes: int = MOST_BYTES
    ) -> None:
        """Keep parts in a folder, or none without one; ``beside`` returns what all of them read beside their arguments.

        That is the content of files. It is asked again when a part was made: none is kept of files that have changed.
        """
        self.trouble = ""
        self._folder, self._most_bytes, self._beside = folder, most_bytes, beside
        if folder is not None:
            self._read_beside = digest(beside())
            self._stamp = digest((source_sha256(), machine(), versions(), self._read_beside)).hex()
            self._try(lambda: _prepare(folder))

    def part(self, function: Callable[..., _Result], *args: Any, **beside: Any) -> _Result:
        """What ``function(*args, **beside)`` returns; what stands ``beside`` does not change the result.

        The function reads its arguments alone, and returns what can be pickled.
        """
        if self._folder is None:
            return function(*args, **beside)
        name = f"{function.__module__}.{function.__qualname__}".removeprefix("microrad.")
        place = self._folder / f"{name}-{self._stamp}"
        for path in _latest_first(place):
            found = _read(path, args)
            if found is not None:
                return cast("_Result", found[0])
        result, reads = watched_call(function, *args, **beside)
        whole = pickle.dumps(result, protocol=5)
        text = pickle.dumps(reads.digests, protocol=5)
        if reads.known and digest(self._beside()) == self._read_beside:
            self._try(lambda: self._write(place, text, whole))
        return cast("_Result", pickle.loads(whole))  # as a later run will have it, and nothing in it is watched

    def _try(self, do: Callable[[], None]) -> None:
        """Do something with the folder; after an error nothing is kept any more."""
        try:
            do()
        except OSError as error:
            reason = error.strerror or str(error)
            self.trouble = f"{self._folder}: {reason}: nothing is kept for a quicker next run"
            self._folder = None

    def _write(self, place: Path, reads: bytes, result: bytes) -> None:
        place.mkdir(mode=0o700, exist_ok=True)
        body = len(reads).to_bytes(8, "little") + reads + result
        path = place / f"{hashlib.sha256(reads).hexdigest()[:32]}.part"
        write_whole(path, _MARK + hashlib.sha256(body).digest() + body, durable=False)
        _touch(path)
        for old in _latest_first(place)[MOST_OF_A_PART:]:
            old.unlink(missing_ok=True)
        assert self._folder is not None
        _make_room(self._folder, self._most_bytes)


NOTHING = Kept(None)
"""Keeps nothing: each part is computed."""


def of_user(beside: Callable[[], Any] = lambda: None) -> Kept:
    """The parts of this user; nothing is kept where the environment says so."""
    return NOTHING if os.environ.get(OFF) == "no" else Kept(folder_of_user(), beside)


def _prepare(folder: Path) -> None:
    """Make the folder. Raises OSError where it cannot be written, or where somebody else could have written into it."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if sys.platform != "win32":
        found = folder.stat()
        if found.st_uid != os.getuid() or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            raise PermissionError(0, "others may write into this folder", str(folder))
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(0, "the folder cannot be written", str(folder))


def _latest_first(place: Path) -> list[Path]:
    return sorted(place.glob("*.part"), key=_used, reverse=True)


def _touch(path: Path) -> None:
    """Note that a part was used now: finer than the clock of a file system."""
    now = time.time_ns()
    os.utime(path, ns=(now, now))


def _used(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:  # deleted by another run meanwhile
        return 0


def _read(path: Path, args: Sequence[Any]) -> tuple[Any] | None:
    """The result in a file, in a tuple; None where it is damaged or belongs to other arguments."""
    try:
        content = path.read_bytes()
        start = len(_MARK) + _DIGEST
        body = content[start:]
        if content[:start] != _MARK + hashlib.sha256(body).digest():
            path.unlink(missing_ok=True)
            return None
        reads, end = Reads(), 8 + int.from_bytes(body[:8], "little")
        reads.digests = pickle.loads(body[8:end])  # written by this user, and whole
        if not reads.agree(tuple(args)):
            return None
        _touch(path)
        return (pickle.loads(body[end:]),)
    except OSError:
        return None


def _make_room(folder: Path, most_bytes: int) -> None:
    """Delete what was not used for longest until the folder is within its size."""
    found = sorted(((_used(path), path) for path in folder.glob("*/*.part")), reverse=True)
    size = 0
    for _, path in found:
        try:
            size += path.stat().st_size
        except OSError:
            continue
        if size > most_bytes:
            path.unlink(missing_ok=True)
    for place in folder.iterdir():
        if not any(place.iterdir()) and time.time() - place.stat().st_mtime > 60.0:
            place.rmdir()
