"""Runs as processes of their own: started, queued, looked at, cancelled and removed by files alone.

A job outlives its page, a reload, a second tab and the server: a campaign may take days, and whoever closes the studio
does not mean to throw its rows away. The next server finds it by its folder. What the page shows is read from there
each time, and nothing is kept here.
"""

from __future__ import annotations

import json
import os
import shutil
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from microrad.core.folder import new_folder, write_whole
from microrad.studio.guard import plain_files, signing
from microrad.studio.guard.signing import SigningError
from microrad.studio.jobs.files import (
    CANCEL,
    CODE,
    JOB,
    KINDS,
    Job,
    JobError,
    Kind,
    Progress,
    State,
    held,
    job_folders,
    now,
    output,
    read_job,
)
from microrad.studio.jobs.process import QUEUE_S, start_waiting

__all__ = ["Job", "JobError", "Jobs", "Kind", "Order", "Progress", "State"]

_LAST = "last"
_LAST_FIGURES = 9  # of a last number that is believed
_NEW = ".new"  # a folder that is a job not yet


@dataclass(frozen=True, slots=True)
class Order:
    """What is to be run: `arguments` of microrad, seen from the folder `cwd`, and the `results` that it writes there.

    `commands` makes the arguments; `title` is what the page calls the job.
    """

    kind: Kind
    title: str
    arguments: tuple[str, ...]
    cwd: Path
    results: tuple[str, ...] = ()


class Jobs:
    """The jobs in the studio's working folder, `studio` / jobs; one runs, the others wait in order."""

    def __init__(self, studio: Path) -> None:
        """Make the folders, for their owner alone; raises `JobError` where one is a link or cannot be made."""
        self.folder = (studio / "jobs").absolute()
        for folder in (studio, self.folder):
            _make_private(folder)

    def submit(self, order: Order) -> Job:
        """Put a job into the queue, and start it if there is room. Raises `JobError`."""
        if order.kind not in KINDS:
            raise JobError(f"'{order.kind}' is no kind of job; it is one of {', '.join(KINDS)}")
        if not order.cwd.is_dir():
            raise JobError(f"{order.cwd} is no folder to run a job in; choose another working folder")
        place = {"cwd": str(order.cwd.absolute()), "queued": now(), "folder": str(self.folder)}
        try:
            for each in (self.folder.parent, self.folder):  # both may have been removed meanwhile
                _make_private(each)
            folder = self._put(json.dumps(asdict(order) | place, indent=2))
        except OSError as error:
            raise JobError(f"{self.folder}: {error.strerror}; check free space and permissions") from error
        except SigningError as error:
            raise JobError(str(error)) from error
        self._go_on()
        return read_job(folder)

    def _put(self, description: str) -> Path:
        """A new folder with the description of a job and its code, which appears with all or not at all."""
        code = signing.code(description.encode())
        draft = new_folder(self.folder, _NEW)  # its mode is 0700
        try:
            write_whole(draft / JOB, description)
            write_whole(draft / CODE, code)
            with held(self.folder / "lock", QUEUE_S) as mine:
                if not mine:
                    raise JobError(f"the queue in {self.folder} is taken by another program; try again")
                folder = self.folder / str(self._next_number())
                write_whole(self.folder / _LAST, folder.name)
                draft.rename(folder)  # at last: what is refused is not in the queue
        except BaseException:
            shutil.rmtree(draft, ignore_errors=True)
            raise
        return folder

    def _next_number(self) -> int:
        """One more than any job had, the removed ones included: a number is never used again."""
        last = 0
        with suppress(OSError, ValueError):
            last = int(plain_files.content(self.folder / _LAST, _LAST_FIGURES))
        there = [read_job(folder) for folder in job_folders(self.folder)]
        number = max([last, *(job.number for job in there if job.state != "unreadable")]) + 1
        while os.path.lexists(self.folder / str(number)):
            number += 1
        return number

    def listed(self) -> tuple[Job, ...]:
        """Every job, the newest first; one that waits is started if there is room meanwhile, and if it can be."""
        self._go_on()
        found = [read_job(folder) for folder in job_folders(self.folder)]
        return tuple(job for job in found if job.folder.is_dir())  # one may have been removed meanwhile

    def _go_on(self) -> None:
        """Start what waits; a full disk or a lock that is none keeps it waiting, and nobody from looking."""
        with suppress(JobError, OSError):
            start_waiting(self.folder)

    def get(self, number: int) -> Job:
        """The job of this number. Raises `JobError` where there is none."""
        folder = self.folder / str(number)
        if number < 1 or not plain_files.is_folder(folder):
            raise JobError(f"there is no job {number} any more; it was removed, or never started")
        return read_job(folder)

    def cancel(self, number: int) -> Job:
        """Ask a job to stop: Ctrl-C at once, and harder when it does not listen (`process.WAITS_S`).

        One that waits never starts. A campaign keeps its finished rows, and can be resumed. Raises `JobError`.
        """
        job = self.get(number)
        if job.finished:
            raise JobError(f"job {number} is not running any more ({job.state}); there is nothing to cancel")
        try:
            (job.folder / CANCEL).touch()
        except OSError as error:
            where = f"job {number} cannot be asked to stop: {job.folder}: {error.strerror}"
            raise JobError(f"{where}; check free space and permissions") from error
        return self.get(number)

    def remove(self, number: int) -> None:
        """Remove a finished job from the list, with what it printed; its results stay. Raises `JobError`."""
        job = self.get(number)
        if not job.finished:
            raise JobError(f"job {number} is {job.state}; cancel it first")
        try:
            shutil.rmtree(job.folder)
        except OSError as error:
            where = f"job {number} cannot be removed: {self.folder}: {error.strerror}"
            raise JobError(f"{where}; check free space and permissions") from error

    def output(self, number: int, name: str = "stdout") -> str:
        """What a job has printed so far, the last 200 kB. Raises `JobError`.

        Args:
            number: that of the job.
            name: "stdout" or "stderr".
        """
        job = self.get(number)
        return "" if job.state == "unreadable" else output(job.folder, "stderr" if name == "stderr" else "stdout")


def _make_private(folder: Path) -> None:
    """Make a folder that only its owner may read; JobError where it is something else."""
    try:
        plain_files.private(folder)
    except OSError as error:
        raise JobError(f"{folder} cannot be made or made private: {error.strerror}; choose another folder") from error
