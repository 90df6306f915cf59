"""What a job leaves on disk, and what follows from it: its state, its progress, its output.

A job is a folder with a number for its name. `job.json` says what is to be done, `started.json` that a process of its
own has taken it up, `exit.json` how it ended; `cancel` asks that process to stop. While it lives, that process holds a
lock on `alive`, which the operating system drops however it ends: so what is running is told from what is lost.

`job.code` shows that this user queued the job (`signing`). Nothing is believed of a folder without it, and no link in
a folder of jobs is followed.
"""

from __future__ import annotations

import json
import math
import re
import sqlite3
import stat
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from microrad.core.folder import write_whole
from microrad.studio.guard import plain_files, signing
from microrad.studio.guard.signing import SigningError

Kind = Literal["study", "campaign", "identification", "export"]
State = Literal["queued", "running", "done", "failed", "cancelled", "lost", "unreadable"]

KINDS: tuple[Kind, ...] = ("study", "campaign", "identification", "export")
FINISHED: tuple[State, ...] = ("done", "failed", "cancelled", "lost", "unreadable")
JOB, CODE, STARTED, EXIT, CANCEL = "job.json", "job.code", "started.json", "exit.json", "cancel"
ALIVE, PROGRESS = "alive", "progress"
STDOUT, STDERR = "stdout", "stderr"

_NUMBER = re.compile(r"[1-9][0-9]{0,11}")
_TAIL_BYTES = 64_000
_OUTPUT_BYTES = 200_000
_RATE_S = 60.0  # of the past that the rate is taken over
_FEW = 20
_MOST_STEPS = 10**15  # whole numbers beyond are none that a program counts to


class JobError(ValueError):
    """Something that cannot be done with a job; the message says which, why and what to do."""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a job is: `done` of `total` of `what`, at `rate_1_s` of them a second (None while it is not known)."""

    done: int
    total: int
    what: str
    rate_1_s: float | None = None

    @property
    def share(self) -> float:
        """Of the work of this phase, 0 to 1."""
        return min(max(self.done / self.total, 0.0), 1.0) if self.total > 0 else 0.0


@dataclass(frozen=True, slots=True)
class Job:
    """A job as its folder tells it.

    `arguments` are those of microrad, `cwd` the folder they are seen from, `results` what it writes, seen from there.
    `code` is the exit code (0: done, 1: done, and what was judged does not hold, else: failed). `cancelling` says that
    a running job was asked to stop, `words` what went wrong. Times are UTC, ISO 8601.
    """

    number: int
    folder: Path
    state: State
    kind: Kind = "study"
    title: str = ""
    arguments: tuple[str, ...] = ()
    cwd: Path = Path()
    results: tuple[str, ...] = ()
    queued: str = ""
    started: str = ""
    ended: str = ""
    code: int | None = None
    progress: Progress | None = None
    cancelling: bool = False
    words: str = ""

    @property
    def finished(self) -> bool:
        """Whether nothing more will happen to it."""
        return self.state in FINISHED


# ------------------------------------------------------------------------------------------------------------- reading
def read_job(folder: Path) -> Job:
    """A job from its folder alone; one whose description cannot be read is "unreadable" and says why."""
    number = int(folder.name)
    try:
        said, home = _described(folder)
        told = {
            "kind": said["kind"],
            "title": str(said["title"]),
            "arguments": tuple(map(str, said["arguments"])),
            "cwd": Path(said["cwd"]),
            "results": tuple(map(str, said["results"])),
            "queued": str(said["queued"]),
        }
    except OSError as error:
        return _unreadable(number, folder, str(error.strerror))
    except (SigningError, JobError) as error:
        return _unreadable(number, folder, str(error))
    except (ValueError, KeyError, TypeError):
        return _unreadable(number, folder, "it is cut off, or was not written by microrad")
    state, began, end = _state(folder, home)
    code = _code(end)
    return Job(
        number=number,
        folder=folder,
        state=state,
        started=str(began.get("at", "")),
        ended=str(end.get("at", "")),
        code=code,
        progress=read_progress(folder) if began else None,
        cancelling=state == "running" and (folder / CANCEL).exists(),
        words=_words(folder, state, code),
        **told,
    )


def _described(folder: Path) -> tuple[dict[str, Any], bool]:
    """What a job is to do, and whether it was queued in just this place; `JobError` where this user did not queue it.

    A copy elsewhere is never started: it would do again, and in its old place, what was asked for once.
    """
    text = plain_files.content(folder / JOB)
    try:
        code = plain_files.content(folder / CODE, 1000).decode("ascii", "replace")
    except OSError:
        code = ""
    if not signing.is_ours(text, code):
        raise JobError("it was not queued by you with this installation of microrad, so it is not started")
    said = json.loads(text)
    return said, said["folder"] == str(folder.parent.absolute())


def _unreadable(number: int, folder: Path, why: str) -> Job:
    words = f"{folder / JOB} is not taken: {why}; remove this job, its results are where they were"
    return Job(number, folder, "unreadable", title="(unreadable)", words=words)


def _state(folder: Path, home: bool) -> tuple[State, dict[str, Any], dict[str, Any]]:
    """The state of a job, and what was noted at its begin and at its end."""
    asked = (folder / CANCEL).exists()
    began = _noted(folder / STARTED)
    if began is None:
        waits: State = "queued" if home else "lost"
        return "cancelled" if asked else waits, {}, {}
    lives = is_held(folder / ALIVE)
    end = _noted(folder / EXIT)  # looked at behind the lock: a job that ends between the two is no lost one
    if end is None:
        return ("running", began, {}) if lives else ("cancelled" if asked else "lost", began, {})
    if _code(end) == 0 or (_code(end) == 1 and (not asked or output(folder, STDOUT))):
        return "done", began, end
    return "cancelled" if asked else "failed", began, end  # a Python interrupted as it begins ends with 1, too


def _code(end: dict[str, Any]) -> int | None:
    """The exit code in a note of the end, which does not have the code of a signature and may hold anything."""
    found = end.get("code")
    return found if isinstance(found, int) else None


def _noted(path: Path) -> dict[str, Any] | None:
    """What a note holds: nothing for a damaged one, None where there is none."""
    try:
        data = json.loads(plain_files.content(path))
    except FileNotFoundError:
        return None
    except (OSError, ValueError, RecursionError):
        return {}
    return data if isinstance(data, dict) else {}


def _words(folder: Path, state: State, code: int | None) -> str:
    """Why a job came to nothing: its own last words on stderr, or what is known without them."""
    if state == "lost" and not (folder / STARTED).exists():
        return "its folder was moved or copied before it was started, so it is not started here; start it anew"
    if state == "lost":
        return "its process is gone without an exit code: the machine went down, it was killed, or the disk is full"
    if state != "failed":
        return ""
    said = [line for line in output(folder, STDERR).splitlines() if line.strip()]
    first = max((n for n, line in enumerate(said) if line.startswith("microrad: ")), default=len(said) - 1)
    if said:
        return "\n".join(said[max(first, 0) :]).removeprefix("microrad: ")
    if code is not None and code < 0:
        return f"its process was ended by signal {-code}; signal 9 is often that of a machine out of memory"
    return f"it ended {'without an exit code' if code is None else f'with exit code {code}'} and said nothing"


def read_progress(folder: Path) -> Progress | None:
    """The last progress that a job has noted, with its rate over the last minute; None where there is none."""
    notes = [note for line in _tail(folder / PROGRESS, _TAIL_BYTES).splitlines() if (note := _progress(line))]
    if not notes:
        return None
    at, done, total, what = notes[-1]
    since = notes[-1]
    for earlier in reversed(notes):  # of this phase: the same total, and never more than later
        of_its_own = earlier[3] != what and total < _FEW  # steps with a name each take a time of their own
        if earlier[2] != total or earlier[1] > since[1] or at - earlier[0] > _RATE_S or of_its_own:
            break
        since = earlier
    rate = (done - since[1]) / (at - since[0]) if at > since[0] and done > since[1] else None
    return Progress(done, total, what, rate)


def _progress(line: str) -> tuple[float, int, int, str] | None:
    try:
        note = json.loads(line)
        at, done, total = float(note["at"]), int(note["done"]), int(note["total"])
        sound = math.isfinite(at) and 0 <= done < _MOST_STEPS and 0 <= total < _MOST_STEPS
        return (at, done, total, str(note["what"])) if sound else None
    except (ValueError, LookupError, TypeError, OverflowError, RecursionError):
        return None  # the first line may be cut, and the last is being written


def output(folder: Path, name: str) -> str:
    """What a job has printed so far, the last 200 kB of it.

    Args:
        folder: that of the job.
        name: "stdout" or "stderr".
    """
    return _tail(folder / name, _OUTPUT_BYTES)


def _tail(path: Path, most: int) -> str:
    try:
        with plain_files.opened(path) as file:
            size = file.seek(0, 2)
            file.seek(max(size - most, 0))
            return file.read(most).decode("utf-8", "replace")
    except OSError:
        return ""


# ------------------------------------------------------------------------------------------------------------- writing
def note(path: Path, **data: Any) -> None:
    """Write a note whole, with the time in "at".

    Args:
        path: file of the note.
        data: what it says, by name: what JSON can hold.
    """
    write_whole(path, json.dumps({**data, "at": now()}))


def now() -> str:
    """The time in UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")


# --------------------------------------------------------------------------------------------------------------- locks
@contextmanager
def held(path: Path, patience_s: float) -> Iterator[bool]:
    """Hold the lock of a file, for this process alone; False when another one has it for all of `patience_s`.

    It is SQLite's, as that of a campaign's ledger: the same on each operating system, and gone with its process.
    Raises `JobError` where there is something else in its place, which SQLite would open, and where it cannot be made.

    Args:
        path: the file, made where there is none.
        patience_s: how long to wait for another process (s).
    """
    _refuse_strange(path)
    with closing(_lock(path, patience_s)) as lock:
        try:
            lock.execute("PRAGMA journal_mode = MEMORY")  # no further file beside it
            lock.execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:
            if not _is_busy(error):
                raise JobError(_unlocked(path, error)) from error
            yield False
            return
        yield True


def _lock(path: Path, patience_s: float) -> sqlite3.Connection:
    try:
        return sqlite3.connect(path, timeout=patience_s, isolation_level=None)
    except sqlite3.OperationalError as error:
        raise JobError(_unlocked(path, error)) from error


def _unlocked(path: Path, error: sqlite3.OperationalError) -> str:
    return f"{path} cannot be locked: {error}; check free space and permissions"


def _is_busy(error: sqlite3.Error) -> bool:
    """Whether another process holds what was asked for."""
    return error.sqlite_errorcode & 0xFF == sqlite3.SQLITE_BUSY


def _refuse_strange(path: Path) -> None:
    with suppress(FileNotFoundError):
        found = path.lstat()
        if not stat.S_ISREG(found.st_mode) or found.st_size:
            raise JobError(f"{path} is no lock of the studio, but a link or another program's; remove it")


def is_held(path: Path) -> bool:
    """Whether some process holds the lock; to look never keeps another one from looking."""
    if not path.exists():
        return False
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=0.0)) as glance:
            glance.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except sqlite3.DatabaseError as error:  # else it was removed meanwhile, or is none
        return _is_busy(error)
    return False


def wait_for(happened: Any, patience_s: float, step_s: float = 0.01) -> bool:
    """Wait until `happened()` is true; False when it is not after `patience_s`.

    Args:
        happened: a function without arguments.
        patience_s: how long to wait (s).
        step_s: between two looks (s).
    """
    end = time.monotonic() + patience_s
    while not happened():
        if time.monotonic() > end:
            return False
        time.sleep(step_s)
    return True


def job_folders(folder: Path) -> list[Path]:
    """The folders of the jobs, the newest first; a link is none."""
    found = []
    with suppress(FileNotFoundError):
        found = [each for each in folder.iterdir() if _NUMBER.fullmatch(each.name) and plain_files.is_folder(each)]
    return sorted(found, key=lambda each: int(each.name), reverse=True)
