"""Parts of a study that are kept from one run to the next, in a folder of the user's.

A part is a function of frozen records. What it returned is taken again where everything that it has read is the same
(see `reads`), and the code, its libraries and whatever of the machine changes its arithmetic are, too. What is damaged,
or was written by other code, is made again without a word. The folder may be deleted at any time.
"""

import contextlib
import hashlib
import os
import pickle
import stat
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar, cast

from microrad.core.folder import DRAFT, write_whole
from microrad.core.machine import machine, source_sha256, versions
from microrad.core.reads import Reads, UnknownValueError, digest, watched_call

_Result = TypeVar("_Result")

MOST_BYTES = 500_000_000
"""Size of the folder beyond which the parts that were not used for longest are deleted."""

MOST_OF_A_PART = 40
"""Results of one part that are kept: some are made many times in one run, and a sweep goes back and forth."""

OFF = "MICRORAD_KEEP"
"""Variable of the environment that turns it off where it is "no"."""

LONGEST_DRAFT_S = 3600.0
"""Age from which a file that is not whole is one that a killed run has left."""

LONGEST_EMPTY_S = 60.0
"""Age from which the folder of a part that holds nothing is deleted."""

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

    def __init__(self, folder: Path | None, most_bytes: int = MOST_BYTES) -> None:
        """Keep parts in a folder, or none without one."""
        self.trouble = ""
        self._folder, self._most_bytes = folder, most_bytes
        if folder is not None:
            self._stamp = digest((source_sha256(), machine(), versions())).hex()
            self._try(lambda: _prepare(folder))

    def part(self, function: Callable[..., _Result], *args: Any, **beside: Any) -> _Result:
        """What ``function(*args, **beside)`` returns, from the folder where it has been kept.

        Args:
            function: It reads its arguments alone, and returns what can be pickled.
            args: What the result depends on.
            beside: What does not change the result, as who hears of the progress.
        """
        folder = self._folder
        if folder is None:
            return function(*args, **beside)
        name = f"{function.__module__}.{function.__qualname__}".removeprefix("microrad.")
        place = folder / f"{name}-{self._stamp}"
        for path in _latest_first(place):
            found = _read(path, args)
            if found is not None:
                return cast("_Result", found[0])
        result, reads = watched_call(function, *args, **beside)
        whole = pickle.dumps(result, protocol=5)
        text = pickle.dumps(reads.digests, protocol=5)
        if reads.known:
            self._try(lambda: _write(place, text, whole, self._most_bytes))
        return cast("_Result", pickle.loads(whole))  # as a later run will have it, and nothing in it is watched

    def _try(self, do: Callable[[], None]) -> None:
        """Do something with the folder; after an error nothing is kept any more."""
        try:
            do()
        except OSError as error:
            reason = error.strerror or str(error)
            self.trouble = f"{self._folder}: {reason}: nothing is kept for a quicker next run"
            self._folder = None


NOTHING = Kept(None)
"""Keeps nothing: each part is computed."""


def of_user() -> Kept:
    """The parts of this user; nothing is kept where the environment says so."""
    return NOTHING if os.environ.get(OFF) == "no" else Kept(folder_of_user())


def _prepare(folder: Path) -> None:
    """Make the folder. Raises OSError where it cannot be written, or where somebody else could have written into it."""
    for place in (*reversed(folder.parents), folder):
        place.mkdir(mode=0o700, exist_ok=True)
    if sys.platform != "win32":
        _refuse_others(folder)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(0, "the folder cannot be written", str(folder))


def _refuse_others(folder: Path) -> None:
    """Raise PermissionError where another user may change what is in the folder, or put another one in its place.

    Above it a folder that all may write into will do where nobody can take away what is another's, as among the
    temporary files; and any will do below a folder of the user's that nobody else may enter.
    """
    found = folder.stat()
    if found.st_uid != os.getuid() or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PermissionError(0, "others may write into this folder")
    ways = [folder.absolute()]
    for way in ways:
        reason = ""
        for place in (way, *way.parents):
            found = place.lstat()
            mine = found.st_uid == os.getuid()
            if not mine and found.st_uid != 0:
                reason = f"{place} is another user's"
            elif stat.S_ISLNK(found.st_mode):
                reason = ""
                ways.append(place.parent / place.readlink() / way.relative_to(place))
            elif mine and not found.st_mode & (stat.S_IXGRP | stat.S_IXOTH):
                reason = ""
            elif found.st_mode & (stat.S_IWGRP | stat.S_IWOTH) and not found.st_mode & stat.S_ISVTX:
                reason = f"others may write into {place}"
        if reason:
            raise PermissionError(0, reason)


def _write(place: Path, reads: bytes, result: bytes, most_bytes: int) -> None:
    """Write a part; it is not kept where another run, or the user, deletes its folder meanwhile."""
    body = len(reads).to_bytes(8, "little") + reads + result
    path = place / f"{hashlib.sha256(reads).hexdigest()[:32]}.part"
    with contextlib.suppress(FileNotFoundError):
        place.mkdir(mode=0o700, exist_ok=True)
        write_whole(path, _MARK + hashlib.sha256(body).digest() + body, durable=False)
        _touch(path)
    for old in _latest_first(place)[MOST_OF_A_PART:]:
        _delete(old)
    _make_room(place.parent, most_bytes)


def _in(folder: Path) -> list[Path]:
    """What stands in a folder; nothing where it is none, or is no longer there."""
    try:
        return list(folder.iterdir())
    except OSError:
        return []


def _delete(path: Path) -> None:
    """Delete a file; it stays where that is not possible."""
    with contextlib.suppress(OSError):
        path.unlink()


def _latest_first(place: Path) -> list[Path]:
    return sorted((path for path in _in(place) if path.suffix == ".part"), key=_used, reverse=True)


def _touch(path: Path) -> None:
    """Note that a part was used now: finer than the clock of a file system."""
    now = time.time_ns()
    os.utime(path, ns=(now, now))


def _used(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:  # deleted by another run meanwhile
        return 0


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _read(path: Path, args: Sequence[Any]) -> tuple[Any] | None:
    """The result in a file, in a tuple; None where it is damaged or belongs to other arguments."""
    try:
        content = path.read_bytes()
        start = len(_MARK) + _DIGEST
        body = content[start:]
        if content[:start] != _MARK + hashlib.sha256(body).digest():
            _delete(path)
            return None
        reads, end = Reads(), 8 + int.from_bytes(body[:8], "little")
        reads.digests = pickle.loads(body[8:end])  # written by this user, and whole
        if not reads.agree(tuple(args)):
            return None
        _touch(path)
        return (pickle.loads(body[end:]),)
    except (OSError, UnknownValueError):  # deleted meanwhile, or one of the values now has no digest
        return None


def _make_room(folder: Path, most_bytes: int) -> None:
    """Delete what was not used for longest until the folder is within its size, and what killed runs have left."""
    places = [place for place in _in(folder) if not place.is_symlink()]
    size = 0
    for path in sorted((path for place in places for path in _in(place)), key=_used, reverse=True):
        if path.suffix == DRAFT and time.time() - _used(path) / 1e9 > LONGEST_DRAFT_S:
            _delete(path)
        elif path.suffix == ".part":
            size += _size(path)
            if size > most_bytes:
                _delete(path)
    for place in places:
        with contextlib.suppress(OSError):  # it is another's file, or another run has deleted it or writes into it
            if time.time() - place.stat().st_mtime > LONGEST_EMPTY_S:
                place.rmdir()
