"""A folder or file of results appears whole or not at all, and never replaces what microrad did not write.

And what a file holds, without a wait for one that never ends.
"""

import json
import os
import platform
import re
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from microrad.core.errors import MicroradError

MANIFEST = "manifest.json"
_MOST_MANIFEST = 64_000_000
_OLD = ".old"

_DRAFTS = ".microrad"
DRAFT = ".draft"
"""End of the name of a file that is not whole yet."""


class FolderError(MicroradError):
    """The output folder cannot be used; the message says why and what to do."""


def read_bytes(path: Path, most: int) -> bytes:
    """The first bytes of a file.

    Whatever a user names is read by this: /proc/kmsg is a regular file to all who ask, and waits for ever.

    Args:
        path: The file.
        most: Most bytes to read.

    Raises:
        OSError: The file cannot be read, or its bytes are not there yet, as of a log of the kernel.
    """

    def at_once(name: str, flags: int) -> int:
        return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))

    with open(path, "rb", buffering=0, opener=at_once) as file:
        parts: list[bytes] = []
        while most > 0 and (part := file.read(most)) != b"":
            if part is None:
                raise BlockingIOError(0, "it is no file on disk: its content is not there yet", str(path))
            parts.append(part)
            most -= len(part)
    return b"".join(parts)


def path_argument(path: Path) -> str:
    """A path as an argument of a command: one that begins like an option is led by its folder."""
    return f"./{path}" if str(path).startswith("-") else str(path)


def check_folder(folder: Path, overwrite: bool, kind: str = "mission", what: str = "results") -> None:
    """Refuse a folder of results that holds something which must not be replaced.

    Args:
        folder: The folder, which need not exist.
        overwrite: Whether results of microrad may be replaced.
        kind: Key of the manifest that tells a folder of such results.
        what: What such a folder holds, for the message.

    Raises:
        FolderError: It is a file, or holds other files, or results that are not to be replaced.
    """
    if not folder.exists():
        return
    if not folder.is_dir():
        raise FolderError(f"{folder} is a file, not a folder: choose another --output")
    if not any(folder.iterdir()):
        return
    if not _ours(folder / MANIFEST, kind):
        raise FolderError(f"{folder} holds files that are not {what} of microrad: choose another --output")
    if not overwrite:
        raise FolderError(f"{folder} already holds {what}: choose another --output, or replace them with --overwrite")


def _ours(manifest: Path, kind: str) -> bool:
    """Whether this is a manifest that microrad wrote for this kind of folder."""
    try:
        data = json.loads(read_bytes(manifest, _MOST_MANIFEST))
        return "microrad" in data["versions"] and kind in data
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return False


@contextmanager
def whole_folder(folder: Path, overwrite: bool, kind: str = "mission", what: str = "results") -> Iterator[Path]:
    """A folder beside ``folder`` to write into; it becomes ``folder`` at the end, or vanishes on any error.

    Args:
        folder: Where the results go; folders above it are made.
        overwrite: As for `check_folder`, like the next two.
        kind: Key of the manifest.
        what: What the folder holds.

    Raises:
        FolderError: The folder must not be replaced.
    """
    check_folder(folder, overwrite, kind, what)
    folder.parent.mkdir(parents=True, exist_ok=True)
    draft = new_folder(folder.parent, f".{folder.name}", ".part")
    try:
        with naming(draft, folder):
            yield draft
            draft.chmod(0o755)  # mkdtemp's 0700 is for secrets
            _sync(draft)
            _replace(draft, folder)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def scratch_folder(what: str) -> Path:
    """A new folder among the temporary files, which whoever asks for it removes."""
    return new_folder(Path(tempfile.gettempdir()), f"microrad-{what}")


def sweep_scratch(what: str) -> None:
    """Remove the scratch folders that processes of this machine left behind when they were killed."""
    _sweep(Path(tempfile.gettempdir()), f"microrad-{what}", "")


@contextmanager
def scratch(what: str) -> Iterator[Path]:
    """A folder among the temporary files, which vanishes at the end."""
    folder = scratch_folder(what)
    try:
        with naming(folder, folder):
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def new_folder(parent: Path, name: str, suffix: str = "") -> Path:
    """A new folder for this process; those of the name that processes left here when they were killed are removed.

    Args:
        parent: Where it is made.
        name: Begin of its name.
        suffix: End of its name.
    """
    _sweep(parent, name, suffix)
    return Path(tempfile.mkdtemp(prefix=f"{_on_this_machine(name)}{os.getpid()}-", suffix=suffix, dir=parent))


def _sweep(parent: Path, name: str, suffix: str) -> None:
    """Remove the folders and files of the name that processes left here when they were killed."""
    form = re.compile(rf"{re.escape(_on_this_machine(name))}(\d{{1,9}})-\w+{re.escape(suffix)}")
    with suppress(OSError):  # of a folder that may be written and not be read
        for path in parent.iterdir():
            if (found := form.fullmatch(path.name)) and _left_behind(path, int(found[1])):
                _remove(path)


def _remove(path: Path) -> None:
    """Remove a file, or a folder with all that is in it; what cannot be removed stays."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


def _on_this_machine(name: str) -> str:
    return f"{name}-{re.sub(r'[^A-Za-z0-9]', '_', platform.node())}-"


def _left_behind(path: Path, process: int) -> bool:
    """Whether this is a folder or file of the same user, and its process is gone; never where that cannot be asked."""
    if os.name != "posix":
        return False
    try:
        status = path.lstat()
        if not (stat.S_ISDIR(status.st_mode) or stat.S_ISREG(status.st_mode)) or status.st_uid != os.getuid():
            return False
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except OSError:
        return False
    return False


def _replace(draft: Path, folder: Path) -> None:
    """Put ``draft`` where ``folder`` is; the old one is put back when that fails.

    A kill between the two leaves the old one aside. It goes once there is another in its place.
    """
    if not folder.exists():
        draft.rename(folder)
        _sweep(folder.parent, f".{folder.name}", _OLD)
        return
    old = new_folder(folder.parent, f".{folder.name}", _OLD)
    try:
        folder.rename(old / folder.name)
        try:
            draft.rename(folder)
        except BaseException:
            (old / folder.name).rename(folder)
            raise
    finally:
        if folder.exists():  # else the old one is all that there is
            shutil.rmtree(old, ignore_errors=True)


def _sync(folder: Path) -> None:
    """Have what is in a folder on the disk before its name is: a failure of the machine leaves no half of a file."""
    for path in folder.rglob("*"):
        if path.is_file():
            with path.open("r+b") as file:
                os.fsync(file.fileno())


@contextmanager
def naming(draft: Path, place: Path) -> Iterator[None]:
    """Within it, an error of the file system names the place that is written to, not the draft, or nothing.

    Args:
        draft: What is written.
        place: What it becomes.
    """
    try:
        yield
    except OSError as error:
        at = Path(place if error.filename is None else os.fsdecode(error.filename))
        at = place / at.relative_to(draft) if at.is_relative_to(draft) else at
        raise OSError(error.errno, error.strerror or str(error), str(at)) from error


def write_whole(path: Path, content: str | bytes, *, durable: bool = True, mode: int | None = None) -> None:
    """Write a file whole or not at all: beside its place first.

    What processes left beside it when they were killed is removed.

    Args:
        path: The file, which is replaced.
        content: Bytes, or text that is written in UTF-8 with its line ends as they are.
        durable: Whether it is on the disk on return. If not, a failure of the machine may cut the file: for one that
            its readers check.
        mode: Who may read and write it; by default what the user's new files have.
    """
    with whole_file(path) as draft, draft.open("xb") as file:
        if mode is not None:
            draft.chmod(mode)
        file.write(content.encode("utf-8") if isinstance(content, str) else content)
        if durable:
            file.flush()
            os.fsync(file.fileno())


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A name beside ``path`` for a new file; it becomes ``path`` at the end, or vanishes on any error."""
    with draft_beside(path) as draft:
        yield draft
        draft.replace(path)


@contextmanager
def draft_beside(path: Path) -> Iterator[Path]:
    """A name beside ``path`` for a file that is not whole yet: what has it at the end is removed.

    So is what processes left there when they were killed.
    """
    _sweep(path.parent, _DRAFTS, DRAFT)
    draft = path.with_name(f"{_on_this_machine(_DRAFTS)}{os.getpid()}-{secrets.token_hex(8)}{DRAFT}")
    try:
        with naming(draft, path):
            yield draft
    finally:
        _remove(draft)
