"""A folder of results appears whole or not at all, and never replaces what microrad did not write."""

import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

MANIFEST = "manifest.json"


class FolderError(ValueError):
    """The output folder cannot be used; the message says why and what to do."""


def check_folder(folder: Path, overwrite: bool) -> None:
    """Raise FolderError when ``folder`` holds something that must not be replaced."""
    if not folder.exists():
        return
    if not folder.is_dir():
        raise FolderError(f"{folder} is a file, not a folder: choose another --output")
    if not any(folder.iterdir()):
        return
    if not _ours(folder / MANIFEST):
        raise FolderError(f"{folder} holds files that are not results of microrad: choose another --output")
    if not overwrite:
        raise FolderError(f"{folder} already holds results: choose another --output, or replace them with --overwrite")


def _ours(manifest: Path) -> bool:
    """Whether this is a manifest that microrad wrote."""
    try:
        return "microrad" in json.loads(manifest.read_text(encoding="utf-8"))["versions"]
    except (OSError, ValueError, KeyError, TypeError):
        return False


@contextmanager
def whole_folder(folder: Path, overwrite: bool) -> Iterator[Path]:
    """A folder beside ``folder`` to write into; it becomes ``folder`` at the end, or vanishes on any error."""
    check_folder(folder, overwrite)
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
