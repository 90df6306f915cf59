"""A folder or file of results appears whole or not at all, and never replaces what microrad did not write.

And what a file holds, without a wait for one that never ends.
"""

import json
import os
import shutil
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

MANIFEST = "manifest.json"


class FolderError(ValueError):
    """The output folder cannot be used; the message says why and what to do."""


def read_bytes(path: Path, most: int) -> bytes:
    """At most so many bytes of a file. Raises OSError, also where they are not there yet, as of a log of the kernel."""

    def at_once(name: str, flags: int) -> int:
        return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))

    with open(path, "rb", buffering=0, opener=at_once) as file:
        parts: list[bytes] = []
        while most > 0 and (part := file.read(most)) != b"":
            if part is None:
                raise BlockingIOError(0, "it is no file on disk: its content is not there yet")
            parts.append(part)
            most -= len(part)
    return b"".join(parts)


def check_folder(folder: Path, overwrite: bool, kind: str = "mission", what: str = "results") -> None:
    """Raise FolderError when ``folder`` holds something that must not be replaced.

    What may be has a manifest of microrad with the key ``kind``; ``what`` it holds is said in the message.
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
        data = json.loads(manifest.read_text(encoding="utf-8"))
        return "microrad" in data["versions"] and kind in data
    except (OSError, ValueError, KeyError, TypeError):
        return False


@contextmanager
def whole_folder(folder: Path, overwrite: bool, kind: str = "mission", what: str = "results") -> Iterator[Path]:
    """A folder beside ``folder`` to write into; it becomes ``folder`` at the end, or vanishes on any error."""
    check_folder(folder, overwrite, kind, what)
    folder.parent.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", suffix=".part", dir=folder.parent))
    try:
        yield draft
        draft.chmod(0o755)  # mkdtemp's 0700 is for secrets
        _replace(draft, folder)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _replace(draft: Path, folder: Path) -> None:
    """Put ``draft`` where ``folder`` is; the old one is put back when that fails."""
    if not folder.exists():
        draft.rename(folder)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", suffix=".old", dir=folder.parent))
    folder.rename(old / folder.name)
    try:
        draft.rename(folder)
    except BaseException:
        (old / folder.name).rename(folder)
        raise
    finally:
        shutil.rmtree(old, ignore_errors=True)


def write_whole(path: Path, content: str | bytes, *, durable: bool = True) -> None:
    """Write a file whole or not at all: beside its place first. Text is written in UTF-8, its line ends as they are.

    What is not ``durable`` may be cut by a failure of the machine: a file that its readers check.
    """
    part = path.with_name(f".microrad-{os.getpid()}-{threading.get_ident()}.part")
    try:
        with part.open("xb") as file:
            file.write(content.encode("utf-8") if isinstance(content, str) else content)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
