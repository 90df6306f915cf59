"""What was queued here is told from what came with a folder: by a key of the user's, outside of any working folder.

A working folder may be cloned or unpacked, and hold what looks like a waiting job. The studio writes the code of
H. Krawczyk, M. Bellare and R. Canetti (HMAC, RFC 2104, with SHA-256) beside each job that it queues, and believes no
other.
"""

from __future__ import annotations

import hmac
import os
import secrets
import stat
import sys
import time
from contextlib import suppress
from pathlib import Path

from microrad.core.folder import draft_beside
from microrad.studio.guard import plain_files

_NAME = "studio-key"
_LENGTH = 64  # figures, of 256 bits
_PATIENCE_S = 2.0  # for another process that is just writing the key
_REMEDY = "remove it: the next job makes a new one, and jobs queued before are not started any more"
_ELSEWHERE = "give XDG_STATE_HOME a folder that you may write to"
_PURPOSE = b"microrad studio job\0"


class SigningError(ValueError):
    """The key cannot be read or made; the message says why and what to do."""


def code(text: bytes) -> str:
    """The code of a text, by the key of this user, which is made where there is none yet. Raises `SigningError`."""
    return _code(_key() or _new_key(), text)


def is_ours(text: bytes, given: str) -> bool:
    """Whether the code given with a text is that of this user's key. Raises `SigningError`.

    Args:
        text: what was signed.
        given: the code beside it.
    """
    key = _key()
    return key is not None and hmac.compare_digest(_code(key, text).encode(), given.encode())


def key_file() -> Path:
    """The file of the key, in the folder where this user's programs keep what outlives them."""
    return _state_folder() / "microrad" / _NAME


def _state_folder() -> Path:
    if os.name == "nt":
        return Path(os.environ.get("LOCALAPPDATA") or _home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return _home() / "Library" / "Application Support"
    given = os.environ.get("XDG_STATE_HOME", "")  # a relative one is to be ignored, as its specification says
    return Path(given) if Path(given).is_absolute() else _home() / ".local" / "state"


def _home() -> Path:
    try:
        return Path.home()
    except RuntimeError as error:
        raise SigningError("this user has no home folder for the studio's key; set HOME or XDG_STATE_HOME") from error


def _code(key: bytes, text: bytes) -> str:
    return hmac.new(key, _PURPOSE + text, "sha256").hexdigest()


def _key() -> bytes | None:
    """The key, None where there is none yet. Raises `SigningError` for one that others may know or that is damaged."""
    path, end = key_file(), time.monotonic() + _PATIENCE_S
    while True:
        try:
            with plain_files.opened(path) as file:
                found, key = os.fstat(file.fileno()), file.read(_LENGTH + 1)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except PermissionError as error:
            where = f"the studio's key {path} cannot be read: {error.strerror}"
            raise SigningError(f"{where}; {_ELSEWHERE}") from error
        except OSError as error:
            raise SigningError(f"the studio's key {path} cannot be read: {error.strerror}; {_REMEDY}") from error
        if os.name == "posix" and (found.st_uid != os.geteuid() or stat.S_IMODE(found.st_mode) & 0o077):
            raise SigningError(f"the studio's key {path} is not this user's alone; {_REMEDY}")
        if len(key) == _LENGTH:
            return key
        if time.monotonic() > end:
            raise SigningError(f"the studio's key {path} is damaged; {_REMEDY}")
        time.sleep(0.01)


def _write_new(path: Path, content: bytes) -> None:
    """Write a file whole that is not there yet, for its owner alone. Raises FileExistsError where it is."""
    with draft_beside(path) as draft:
        plain_files.write_new(draft, content)
        os.link(draft, path)


def _new_key() -> bytes:
    """Make the key, unless another process was first."""
    path = key_file()
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with suppress(FileExistsError):
            _write_new(path, secrets.token_hex(_LENGTH // 2).encode())
    except OSError as error:
        where = f"the studio's key {path} cannot be made: {error.strerror}"
        raise SigningError(f"{where}; {_ELSEWHERE}") from error
    key = _key()
    if key is None:
        raise SigningError(f"the studio's key {path} was removed at once; try again")
    return key
