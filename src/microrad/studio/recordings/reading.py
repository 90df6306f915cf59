"""A recording from outside is read by a process of its own, under limits of time, memory and what it may answer.

A file may claim 10¹² samples, unpack to a thousand times its size, or hit a fault of a library that reads it: then that
process ends, and the studio says so. The functions wait for it; call them from a thread, not from the event loop.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from microrad.studio.guard.names import shown

_PROCESS = "microrad.studio.recordings.process"
_MAX_REQUEST_BYTES = 32_768  # fits into a pipe at once
_GRACE_S = 5.0
_TURNS = threading.BoundedSemaphore(2)  # as many files at a time, whatever is dropped

Found = TypeVar("Found", "Listing", "View")


class ReadingError(ValueError):
    """The recording cannot be used: the reader's own words, or the limit that it hit; without the folder's path."""


@dataclass(frozen=True, slots=True)
class ReadingLimits:
    """What one reading may take; `cpu_s` and `memory_bytes` (address space) hold on POSIX, the others everywhere.

    `samples` is that of one channel, `channels` how many are listed, `points` about how many of a channel are shown.
    """

    wall_s: float = 300.0
    cpu_s: int = 30
    memory_bytes: int = 4_000_000_000
    answer_bytes: int = 4_000_000
    samples: int = 20_000_000
    channels: int = 1000
    points: int = 2000


@dataclass(frozen=True, slots=True)
class Columns:
    """Which channels are read, by number counted from 0 or by name; the rest as in `recording.read_recording`."""

    inputs: tuple[int | str, ...]
    outputs: tuple[int | str, ...]
    rate_hz: float | None = None
    accept: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ChannelInfo:
    """A channel as the file names it, its unit ('' where none is stated) and its samples, None for a text."""

    name: str
    unit: str
    samples: int | None


@dataclass(frozen=True, slots=True)
class Listing:
    """The channels of a file, the first of them where there are many.

    `time` is the number of the channel that is plainly time, `rates_hz` the sample rates that the file states. Texts
    are as the file has them, cut at 200 characters: data, to be shown as text.
    """

    channels: tuple[ChannelInfo, ...]
    time: int | None
    rates_hz: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class View:
    """A recording that passed the checks, thinned for drawing.

    `findings` are those that let it pass, in words. `rows` are the numbers of the samples shown, in order: in each
    stretch the extremes of every channel. `drive` and `output` hold the values of each channel at these rows, to seven
    digits, in the units of the file.
    """

    samples: int
    rate_hz: float
    findings: tuple[str, ...]
    rows: tuple[int, ...]
    drive: tuple[tuple[float, ...], ...]
    output: tuple[tuple[float, ...], ...]


def list_channels(path: Path, limits: ReadingLimits | None = None) -> Listing:
    """The channels of a file; raises `ReadingError`.

    Args:
        path: the recording.
        limits: what the reading may take.
    """
    return _read(path, {"task": "channels"}, limits or ReadingLimits(), Listing)


def view(path: Path, columns: Columns, limits: ReadingLimits | None = None) -> View:
    """Read and check a recording as `recording.read_recording` does, and thin it; raises `ReadingError`.

    Args:
        path: the recording.
        columns: the channels that are read.
        limits: what the reading may take.
    """
    return _read(path, {"task": "view", "columns": asdict(columns)}, limits or ReadingLimits(), View)


def _read(path: Path, request: dict[str, Any], limits: ReadingLimits, kind: type[Found]) -> Found:
    request |= {"folder": str(path.parent), "name": path.name, "limits": asdict(limits)}
    text = json.dumps(request).encode("ascii")
    if len(text) > _MAX_REQUEST_BYTES:
        raise ReadingError(f"{path.name}: the names of the channels are too long; give their numbers instead.")
    with _TURNS:
        data, code = _run(text, limits, path.name)
    try:
        answer = json.loads(data)
        if "refused" in answer:
            raise ReadingError(str(answer["refused"]))
        return TypeAdapter(kind).validate_json(data)
    except (ValidationError, ValueError, TypeError, RecursionError) as error:
        if isinstance(error, ReadingError):
            raise
        raise ReadingError(_stopped(path.name, code, limits)) from None


def _run(request: bytes, limits: ReadingLimits, name: str) -> tuple[bytes, int]:
    """What the process wrote, and its exit code; it is ended with everything it started, whatever happens."""
    process = subprocess.Popen(
        # -P: the current folder is no place to import from.
        [sys.executable, "-P", "-m", _PROCESS],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=_environment(),
        start_new_session=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    found: list[bytes] = []
    out = process.stdout
    reader = threading.Thread(target=lambda: found.append(out.read(limits.answer_bytes + 1)), daemon=True)
    try:
        reader.start()
        _hand_over(process, request)
        reader.join(limits.wall_s)
        in_time = list(found)
        if in_time and len(in_time[0]) <= limits.answer_bytes:
            _await_end(process, _GRACE_S)
    finally:
        _end(process)
        reader.join(_GRACE_S)
        if not reader.is_alive():
            out.close()
    if not in_time:
        raise ReadingError(f"{shown(name)} was not read within {limits.wall_s:g} s{_ADVICE}.")
    if len(in_time[0]) > limits.answer_bytes:
        raise ReadingError(f"{shown(name)} has more to say than {limits.answer_bytes / 1e6:g} MB{_ADVICE}.")
    return in_time[0], process.returncode


_ADVICE = "; cut out the part of the recording that you need, or keep every n-th sample"


def _hand_over(process: subprocess.Popen[bytes], request: bytes) -> None:
    assert process.stdin is not None
    with contextlib.suppress(OSError):  # it ended already; its answer is missing, which is noticed
        process.stdin.write(request)
        process.stdin.close()


def _environment() -> dict[str, str]:
    """One thread, whose stack counts as memory, and no plug-ins of HDF5 that a file could ask for."""
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return os.environ | threads | {"HDF5_PLUGIN_PRELOAD": "::", "PYTHONDONTWRITEBYTECODE": "1"}


def _await_end(process: subprocess.Popen[bytes], most_s: float) -> None:
    """Let the process end by itself, or its exit code would be that of the kill; it keeps its number meanwhile."""
    end_s = time.monotonic() + most_s
    while hasattr(os, "waitid") and time.monotonic() < end_s:
        if os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT | os.WNOHANG) is not None:
            return
        time.sleep(0.002)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Kill the process and what it started, and wait for it; it is not waited for before, so its number is its own."""
    if sys.platform == "win32":
        process.kill()
    else:
        with contextlib.suppress(OSError):  # it has ended, and its group with it
            os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _stopped(name: str, code: int, limits: ReadingLimits) -> str:
    """Words for a process that ended without an answer."""
    if code in (-getattr(signal, "SIGXCPU", 256), -getattr(signal, "SIGKILL", 256)):
        return f"{shown(name)} took more than {limits.cpu_s} s of computing or too much memory to read{_ADVICE}."
    return (
        f"{shown(name)} broke the program that reads it (code {code}): it is damaged, or made to do so; copy it again."
    )
