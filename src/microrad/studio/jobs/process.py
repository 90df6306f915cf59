"""The process that a job runs under: it starts the command, waits for it, stops it when asked, and notes how it ended.

It belongs to no server: a server that ends, or is ended with Ctrl-C, leaves it running, since a campaign may take days
and the page is only there to look on. When its job is over it starts the next one of the queue. Should it be killed,
its command ends with it (`command`).
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from microrad.studio.jobs.files import (
    ALIVE,
    CANCEL,
    EXIT,
    PROGRESS,
    STARTED,
    STDERR,
    STDOUT,
    Job,
    held,
    job_folders,
    note,
    read_job,
    wait_for,
)

WAITS_S = (30.0, 30.0)
"""How long a command that is to stop has behind SIGINT, and then behind SIGTERM, before SIGKILL ends it."""

QUEUE_S = 360.0
"""For the queue's lock, which is held while one job is started."""

_OWN = "microrad.studio.jobs.process"  # spelled out: its name is another one while it runs
_ENVIRONMENT = {"PYTHONIOENCODING": "utf-8:replace", "PYTHONUNBUFFERED": "1"}
_LOOK_S = 0.2  # between two looks at whether the job is to stop
_START_S = 300.0  # for a process of Python to begin, on a machine that is busy; one that ends is noticed at once
_NICENESS = 5  # the pages stay quick while a study has every core
_started: list[subprocess.Popen[bytes]] = []  # kept until they end: none is left a zombie


# ------------------------------------------------------------------------------------------------------------ the queue
def start_waiting(jobs: Path) -> None:
    """Start the oldest job that waits, unless one runs; whoever comes second finds it started."""
    _started[:] = [each for each in _started if each.poll() is None]
    if not _waiting(jobs):
        return
    with held(jobs / "lock", QUEUE_S) as mine:
        while mine and (folder := _waiting(jobs)):
            _start(folder)


def _waiting(jobs: Path) -> Path | None:
    """The job that may start now, or None."""
    # at a glance: most of a long list have ended
    found = [(folder, read_job(folder).state) for folder in job_folders(jobs) if not (folder / EXIT).exists()]
    if any(state == "running" for _, state in found):
        return None
    return next((folder for folder, state in reversed(found) if state == "queued"), None)


def _start(folder: Path) -> None:
    """Start the process of a job, and wait until it has taken the job up."""
    command = [sys.executable, "-P", "-m", _OWN, str(folder.absolute())]
    with (folder / STDERR).open("ab") as errors:
        own = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            cwd=folder.parent,
            env=_environment(),
            **apart(),
        )
    _started.append(own)
    wait_for(lambda: (folder / STARTED).exists() or own.poll() is not None, _START_S)
    if not (folder / STARTED).exists():  # it could not even begin: no other one shall try it again and again
        note(folder / STARTED)
        note(folder / EXIT, code=70)


def _environment() -> dict[str, str]:
    """That of this process, for one that runs in another folder and prints into a file."""
    paths = [str(Path(each).absolute()) for each in os.environ.get("PYTHONPATH", "").split(os.pathsep) if each]
    return {**os.environ, **_ENVIRONMENT, **({"PYTHONPATH": os.pathsep.join(paths)} if paths else {})}


def apart() -> dict[str, Any]:
    """Settings of a process in a group of its own, which a Ctrl-C in the server's terminal does not reach."""
    if os.name == "nt":
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.CREATE_NO_WINDOW}  # type: ignore[attr-defined, unused-ignore]
    return {"start_new_session": True}


# --------------------------------------------------------------------------------------------------------------- a job
def run_job(
    folder: Path,
    program: tuple[str, ...] | None = None,
    waits_s: tuple[float, float] = WAITS_S,
    look_s: float = _LOOK_S,
) -> None:
    """Run a job to its end, whichever it is, and note how it ended; nothing where another process has it.

    Nothing either where this user did not queue it, in this place.

    Args:
        folder: that of the job.
        program: what the job's arguments are given to; microrad unless told else.
        waits_s: how long a command has behind SIGINT, then behind SIGTERM (s).
        look_s: between two looks at whether it is to stop (s).
    """
    job = read_job(folder)
    if job.state not in ("queued", "cancelled"):
        return
    with held(folder / ALIVE, 2.0) as mine:
        if not mine or (folder / STARTED).exists():
            return
        note(folder / STARTED, pid=os.getpid())
        if (folder / CANCEL).exists():
            note(folder / EXIT, code=130)
            return
        with (folder / STDOUT).open("ab") as out, (folder / STDERR).open("ab") as errors:
            try:
                command = _command(job, program or _program(), out, errors)
            except OSError as error:
                errors.write(f"microrad: {job.cwd}: {error.strerror}; the job cannot be started there.\n".encode())
                note(folder / EXIT, code=2)
                return
            with command:
                code = _ended(command, folder / CANCEL, waits_s, look_s)
        note(folder / EXIT, code=code)


def _program() -> tuple[str, ...]:
    """What a job's arguments are given to, by this process; no file of the working folder is a module for it (-P)."""
    return (sys.executable, "-P", "-m", "microrad.studio.jobs.command", str(os.getpid()))


def _command(job: Job, program: tuple[str, ...], out: IO[bytes], errors: IO[bytes]) -> subprocess.Popen[bytes]:
    """The command of a job, which ends when this process does, since nobody else holds its stdin."""
    return subprocess.Popen(
        [*program, *job.arguments],
        stdin=subprocess.PIPE,
        stdout=out,
        stderr=errors,
        cwd=job.cwd,
        env={**_environment(), "MICRORAD_PROGRESS": str(job.folder.absolute() / PROGRESS)},
        **apart(),
    )


def _ended(command: subprocess.Popen[bytes], cancel: Path, waits_s: tuple[float, float], look_s: float) -> int:
    """Wait for a command and stop it when asked to; its exit code, negative for a signal."""
    while not cancel.exists():
        with suppress(subprocess.TimeoutExpired):
            return command.wait(look_s)
    interrupt = getattr(signal, "CTRL_BREAK_EVENT", signal.SIGINT)  # what a campaign has finished is in its ledger
    for number, patience_s in zip((interrupt, signal.SIGTERM), waits_s, strict=True):
        _signal(command, number)
        with suppress(subprocess.TimeoutExpired):
            return command.wait(patience_s)
    _signal(command, getattr(signal, "SIGKILL", signal.SIGTERM))
    return command.wait()


def _signal(command: subprocess.Popen[bytes], number: int) -> None:
    """A signal to the command's group, which it leads; where there are no groups, to the command."""
    with suppress(OSError):
        if hasattr(os, "killpg"):
            os.killpg(command.pid, number)  # its number is taken until it was waited for
        else:
            command.send_signal(number)


def main() -> None:
    """Run the job of the folder that the first argument names, then go on with the queue."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: None)  # a handler, not SIG_IGN: the command shall not inherit deafness
    if hasattr(os, "nice"):
        os.nice(_NICENESS)
    folder = Path(sys.argv[1])
    with suppress(OSError):  # of a full disk: this job is lost, the next may find room
        run_job(folder)
    start_waiting(folder.parent)


if __name__ == "__main__":
    main()
