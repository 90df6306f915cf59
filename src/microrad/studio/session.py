"""What all tabs of the studio share: the mission being edited, a second one beside it, the jobs, the working folder.

Unsaved changes and the second mission are kept in the working folder's `.microrad-studio`, so that they survive a
closed tab and a restart.
"""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from microrad.core.folder import write_whole
from microrad.mission.file import LinkFile, MissionFile, named_files
from microrad.mission.toml import MissionError
from microrad.studio.draft.draft import Draft, DraftError, OnDisk
from microrad.studio.guard import plain_files
from microrad.studio.guard.names import within
from microrad.studio.jobs.ledgers import LiveCampaigns
from microrad.studio.jobs.queue import Jobs

__all__ = ["STUDIO", "Session"]

STUDIO = ".microrad-studio"
"""Name of the studio's own folder in the working folder."""

_DEFAULT = "leo-geo.toml"
_KEPT, _OTHER = "draft.json", "other.json"


class Session:
    """The one working place behind all tabs; safe to use from several threads.

    `folder` is the working folder: nothing outside of it is written or listed. `studio` is the studio's own folder in
    it, `jobs` what runs, `campaigns` what their ledgers say so far. `revision` grows with each change of `draft`, of
    `other`, of the file or of what it names on disk, so a page sees that it is behind; `opened` with each draft that
    replaces another instead of changing it.
    """

    def __init__(self, folder: Path, file: Path | None = None) -> None:
        """Open `file`, which lies in `folder`; else what was being edited there, or the shipped mission.

        Raises `MissionError` for a file that cannot be read, `JobError` and `NameRefusedError` for a folder or file
        that cannot be used.

        Args:
            folder: the working folder.
            file: a mission in it.
        """
        self.folder = folder.resolve()
        self.studio = self.folder / STUDIO
        self.revision = self.opened = 0
        self._lock = threading.RLock()
        self._draft = self._begin(None if file is None else within(self.folder, file.absolute()))
        self.jobs = Jobs(self.studio)  # behind what may be refused: nothing is written then
        _keep_out_of_repositories(self.studio)
        self.campaigns = LiveCampaigns()
        self._other = self._kept(_OTHER)
        self._disk: tuple[Draft, object, OnDisk] | None = None
        self._inputs: tuple[str, tuple[Path, ...], tuple[object, ...]] = ("", (), ())
        self._mission: tuple[Draft, MissionFile | None, str] | None = None

    # ------------------------------------------------------------------------------------------------------- missions
    @property
    def draft(self) -> Draft:
        """The mission being edited."""
        return self._draft

    @property
    def other(self) -> Draft | None:
        """The second mission, which the first is compared with; kept on disk, too. Setting it raises OSError."""
        return self._other

    @other.setter
    def other(self, draft: Draft | None) -> None:
        with self._lock:
            if draft is None:
                (self.studio / _OTHER).unlink(missing_ok=True)
            else:
                self._keep(draft, _OTHER)
            self._other = draft
            self.revision += 1

    def change(self, draft: Draft) -> None:
        """Put another draft in place; it is kept on disk, too, so that it survives a restart. Raises OSError."""
        with self._lock:
            if draft == self._draft:
                return
            self._keep(draft, _KEPT)
            self._draft = draft
            self.revision += 1

    def edit(self, how: Callable[[Draft], Draft]) -> None:
        """Change the draft as it is now, so that no change of another tab or thread is lost.

        Raises what `how` raises, and OSError.
        """
        with self._lock:
            self.change(how(self._draft))

    def set(self, key: str, typed: str) -> None:
        """Set a key of the draft as it is now; raises `DraftError`.

        Args:
            key: its dotted name.
            typed: the value as one types it.
        """
        self.edit(lambda draft: draft.set(key, typed))

    def replace(self, draft: Draft) -> None:
        """Put another mission in place of the draft, whose changes end with it. Raises OSError."""
        with self._lock:
            self.change(draft)
            self.opened += 1
            self.revision += 1

    def reopen(self) -> None:
        """Put the file as it is on disk in place of the draft, whose changes are lost.

        Raises `MissionError`, `NameRefusedError` where a link has come in its place, and OSError.
        """
        with self._lock:
            self.replace(Draft.open(self.inside(str(self._draft.path))))

    def save(self, name: str | None = None) -> None:
        """Save the draft to its own file, or under a name in the working folder.

        Raises `DraftError`, `NameRefusedError` and OSError.
        """
        path = None if name is None else self.inside(name)
        self.edit(lambda draft: _unlinked(draft).save(path) if path is None else draft.save(path))

    def mission(self) -> MissionFile | None:
        """The whole mission of the draft, or None while it has faults; see `faults`."""
        return self._read()[0]

    def faults(self) -> str:
        """Why there is no mission, in the words of `microrad run`; "" when there is one."""
        return self._read()[1]

    def link(self) -> LinkFile | None:
        """What a link budget needs, or None while the draft has faults."""
        draft = self._draft
        return None if draft.problems else draft.link()

    def _read(self) -> tuple[MissionFile | None, str]:
        draft, kept = self._draft, self._mission
        if kept is None or kept[0] is not draft:
            try:
                kept = (draft, draft.file(), "")
            except MissionError as error:
                kept = (draft, None, str(error))
            self._mission = kept
        return kept[1:]

    # --------------------------------------------------------------------------------------------------------- folder
    def inside(self, name: str) -> Path:
        """The path of a name in the working folder; raises `NameRefusedError` where it leaves it."""
        return within(self.folder, name)

    def name_of(self, path: Path) -> str:
        """How a path of the working folder is called in it; a path elsewhere keeps its full name."""
        with suppress(ValueError):
            return str(path.absolute().relative_to(self.folder))
        return str(path)

    def missions(self) -> tuple[Path, ...]:
        """The TOML files of the working folder itself, by name."""
        found = (path for path in self.folder.glob("*.toml") if path.is_file() and not path.name.startswith("."))
        return tuple(sorted(found, key=lambda path: path.name))

    # ------------------------------------------------------------------------------------------------ the file on disk
    @property
    def disk(self) -> OnDisk:
        """What has become of the draft's file on disk, by another program; looks at it now, and at `inputs`."""
        with self._lock:
            self._look_at_inputs()
            draft, kept = self._draft, self._disk
            sign = _sign(draft.path)
            if kept is None or kept[0] is not draft or kept[1] != sign:
                self._disk = (draft, sign, draft.on_disk())
                if kept is not None and kept[2] != self._disk[2]:
                    self.revision += 1
            return self._disk[2] if self._disk else ""

    @property
    def inputs(self) -> tuple[object, ...]:
        """What tells the files that the draft names, as they are on disk now, from what they were before."""
        with self._lock:
            self._look_at_inputs()
            return self._inputs[2]

    @property
    def key(self) -> str:
        """What tells the draft's results from those of another text, or of other files that it names."""
        return f"{self._draft.sha256}{self.inputs or ''}"

    def _look_at_inputs(self) -> None:
        """Read the draft anew where a file that it names was changed; one with faults names those that it named."""
        draft, file, (text, paths, signs) = self._draft, self.link(), self._inputs
        if file is not None or draft.text != text:
            paths = () if file is None else _named(file)
        now = tuple(_sign(path) for path in paths)
        self._inputs = (draft.text, paths, now)
        if draft.text == text and now != signs:
            self._draft = draft.again()
            self.revision += 1

    def disk_words(self) -> str:
        """Why the file must not be run as it is on disk, and what to do; "" where it is what was read or saved here."""
        name, disk = self.name_of(self._draft.path), self.disk
        if disk == "changed":
            again = 'open it again ("Back to the saved file" on the page Mission), or save this text under another name'
            return f"{name} was changed on disk by another program since it was opened here; {again}"
        return f"{name} is not on disk any more; save it again" if disk == "gone" else ""

    # ---------------------------------------------------------------------------------------------------- kept on disk
    def _keep(self, draft: Draft, name: str) -> None:
        self.studio.mkdir(mode=0o700, exist_ok=True)  # "git clean" may have removed it meanwhile
        noted = {"path": self.name_of(draft.path), "disk_sha256": draft.disk_sha256, "text": draft.text}
        write_whole(self.studio / name, json.dumps(noted))

    def _begin(self, file: Path | None) -> Draft:
        """The unsaved changes of `file` where there are some, else the file, else the shipped mission."""
        found = self._kept(_KEPT, file)
        if found is not None:
            return found
        path = file or self.inside(_DEFAULT)
        return Draft.open(path) if file is not None or path.exists() else Draft.shipped(path)

    def _kept(self, name: str, file: Path | None = None) -> Draft | None:
        """What an earlier studio has kept under a name, if that was `file` or no file is asked for."""
        try:
            noted = json.loads(plain_files.content(self.studio / name))
            path, disk, text = within(self.folder, noted["path"]), str(noted["disk_sha256"]), str(noted["text"])
            if file is not None and path != file:
                return None
            base = Draft.open(path) if path.exists() else Draft.shipped(path)
            draft = replace(base.with_text(text), text=text, disk_sha256=disk)
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return None
        return base if base.text == text or not draft.changed else draft


def _unlinked(draft: Draft) -> Draft:
    """The draft; `DraftError` where a link has come in its file's place, which may lead anywhere."""
    if draft.path.resolve() == draft.path:
        return draft
    where = f"{draft.path} is or lies behind a link to {draft.path.resolve()} now"
    raise DraftError(f"{where}, which it was not when it was opened; remove the link, or save under another name")


def _named(file: LinkFile) -> tuple[Path, ...]:
    """The files that a mission names, its mirror's among them."""
    inner = file.mirror_file if isinstance(file, MissionFile) else None
    own = () if inner is None else (inner.path,)
    return (*own, *(file.path.parent / name for name in named_files(file.mission)))


def _sign(path: Path) -> object:
    """What differs when a file was changed, at the price of a look; None where there is none."""
    try:
        now = path.stat()
    except (OSError, ValueError):  # the last for a name that holds a NUL
        return None
    return (now.st_mtime_ns, now.st_size, now.st_ino, now.st_mode)


def _keep_out_of_repositories(studio: Path) -> None:
    """Have git overlook the studio's own folder."""
    if not os.path.lexists(studio / ".gitignore"):
        write_whole(studio / ".gitignore", "*\n")
