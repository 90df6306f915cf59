"""What all tabs of the studio share: the mission being edited, a second one beside it, the jobs, the working folder.

Unsaved changes and the second mission are kept in the working folder's `.microrad-studio`, so that they survive a
closed tab and a restart.
"""

from __future__ import annotations

import json
import threading
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from microrad.document import MissionError
from microrad.folder import write_whole
from microrad.missionfile import LinkFile, MissionFile
from microrad.studio import plain_files
from microrad.studio.campaign_live import LiveCampaigns
from microrad.studio.draft import Draft
from microrad.studio.jobs import Jobs
from microrad.studio.names import within

__all__ = ["STUDIO", "Workshop"]

STUDIO = ".microrad-studio"
"""Name of the studio's own folder in the working folder."""

_DEFAULT = "leo-geo.toml"
_KEPT, _OTHER = "draft.json", "other.json"


class Workshop:
    """The one working place behind all tabs; safe to use from several threads.

    `folder` is the working folder: nothing outside of it is written or listed. `studio` is the studio's own folder in
    it, `jobs` what runs, `campaigns` what their ledgers say so far. `revision` grows with each change of `draft` or
    `other`, so a page sees that it is behind.
    """

    def __init__(self, folder: Path, file: Path | None = None) -> None:
        """Open `file`, which lies in `folder`; else what was being edited there, or the paper's mission.

        Raises `MissionError` for a file that cannot be read, `JobError` and `NameRefusedError` for a folder or file
        that cannot be used.
        """
        self.folder = folder.resolve()
        self.studio = self.folder / STUDIO
        self.revision = 0
        self._lock = threading.RLock()
        self._draft = self._begin(None if file is None else within(self.folder, file.absolute()))
        self.jobs = Jobs(self.studio)  # behind what may be refused: nothing is written then
        _keep_out_of_repositories(self.studio)
        self.campaigns = LiveCampaigns()
        self._other = self._kept(_OTHER)
        self._mission: tuple[Draft, MissionFile | None, str] | None = None
        self._link: tuple[Draft, LinkFile | None] | None = None

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

    def set(self, key: str, typed: str) -> None:
        """Set a key of the draft as it is now, so that no change of another tab is lost; raises `DraftError`."""
        with self._lock:
            self.change(self._draft.set(key, typed))

    def mission(self) -> MissionFile | None:
        """The whole mission of the draft, or None while it has faults; see `faults`."""
        return self._read()[0]

    def faults(self) -> str:
        """Why there is no mission, in the words of `microrad run`; "" when there is one."""
        return self._read()[1]

    def link(self) -> LinkFile | None:
        """What a link budget needs, or None while the draft has faults."""
        draft, kept = self._draft, self._link
        if kept is None or kept[0] is not draft:
            found = None
            with suppress(MissionError):
                found = draft.link()
            kept = self._link = (draft, found)
        return kept[1]

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

    # ---------------------------------------------------------------------------------------------------- kept on disk
    def _keep(self, draft: Draft, name: str) -> None:
        self.studio.mkdir(mode=0o700, exist_ok=True)  # "git clean" may have removed it meanwhile
        noted = {"path": self.name_of(draft.path), "disk_sha256": draft.disk_sha256, "text": draft.text}
        write_whole(self.studio / name, json.dumps(noted))

    def _begin(self, file: Path | None) -> Draft:
        """The unsaved changes of `file` where there are some, else the file, else the paper's mission."""
        found = self._kept(_KEPT, file)
        if found is not None:
            return found
        path = file or self.folder / _DEFAULT
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


def _keep_out_of_repositories(studio: Path) -> None:
    """Have git overlook the studio's own folder."""
    with suppress(FileExistsError), (studio / ".gitignore").open("x", encoding="utf-8") as file:
        file.write("*\n")
