"""Files that the studio keeps in a working folder, which may have come from a stranger: read with care, or not at all.

A link there could name any file of this machine, and a pipe or a device would never end.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

MOST_BYTES = 16_000_000
"""Of a file that is read whole; a draft is the largest."""


def opened(path: Path) -> BinaryIO:
    """A plain file to read from. Raises OSError where there is none, a link included."""
    if path.is_symlink():
        raise OSError(errno.ELOOP, "it is a link", str(path))
    flags = ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY")  # those that this system has
    file = os.fdopen(os.open(path, sum((getattr(os, each, 0) for each in flags), os.O_RDONLY)), "rb")
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise OSError(errno.EINVAL, "it is no plain file", str(path))
    return file


def new(path: Path) -> BinaryIO:
    """A file to write to that was not there before, and that only its owner may read. Raises OSError."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    return os.fdopen(os.open(path, flags, 0o600), "wb")


def write_new(path: Path, content: bytes) -> None:
    """Write a file that was not there before, for its owner alone; it is on the disk on return. Raises OSError.

    Args:
        path: the file.
        content: its bytes.
    """
    with new(path) as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def content(path: Path, most: int = MOST_BYTES) -> bytes:
    """The bytes of a plain file. Raises OSError where there is none, a link included, and for more than `most`.

    Args:
        path: the file.
        most: bytes.
    """
    with opened(path) as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise OSError(errno.EFBIG, f"it is larger than {most} bytes", str(path))
    return data


def private(folder: Path) -> Path:
    """A folder that only its owner may look into, made where there is none. Raises OSError for a link, or another's."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    found = folder.lstat()
    owner = getattr(os, "getuid", lambda: found.st_uid)()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != owner:
        raise OSError(errno.EPERM, "it is a link or belongs to somebody else; remove it", str(folder))
    folder.chmod(0o700)
    return folder.absolute()


def is_folder(folder: Path) -> bool:
    """Whether this is a folder, and no link to one."""
    return folder.is_dir() and not folder.is_symlink()
