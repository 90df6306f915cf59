"""How tests wait: for an event, however busy the machine is, and with one limit for what hangs.

No test asserts how long something took. `test_waiting.py` holds the other files to that.
"""

import faulthandler
import os
import subprocess
import threading
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

HANG_S = 300.0
"""What has not happened after this time (s) never will, on a machine with other work to do, too."""
HANG_MS = 1000.0 * HANG_S
ALL_S = 2 * 3600.0
"""What a run of all tests may take (s), on a busy machine, too; four times as long with all repetitions."""
_LOOK_S = 0.02


def until(condition, what, pause=time.sleep):
    """Wait until ``condition()`` is true, and return what it said; fails with `what` was waited for where it hangs.

    ``pause`` passes the seconds between two looks.
    """
    end_s = time.monotonic() + HANG_S
    while not (found := condition()):
        if time.monotonic() > end_s:
            pytest.fail(f"waited in vain for {what}")
        pause(_LOOK_S)
    return found


def any_moment(draw, most_s, process=None):
    """Go on at a moment that ``draw`` (a `random.Random`) chooses, after ``most_s`` at most: nothing is waited for.

    Where a process is given, one that ends before the moment ends it.
    """
    moment_s = draw.uniform(0.0, most_s)
    if process is None:
        time.sleep(moment_s)
        return
    with suppress(subprocess.TimeoutExpired):
        process.wait(moment_s)


def alive(pid):
    """Whether a process lives; one that has ended and was not waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def gone(*pids):
    """Wait until these processes have ended."""
    for pid in pids:
        until(lambda pid=pid: not alive(pid), f"the end of process {pid}")
    return True


def lines_of(path, count=1):
    """The whole lines of a file, once another process has written so many of them."""

    def read():
        lines = path.read_text("utf-8").splitlines(keepends=True) if path.exists() else []
        whole = [line.rstrip("\n") for line in lines if line.endswith("\n")]
        return (whole,) if len(whole) >= count else ()

    return until(read, f"{count} lines in {path}")[0]


def beside(work):
    """A thread that does ``work()``; it does not outlive the tests."""
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


told = 2
"""Where `no_hang` says so: pytest takes in what is written to the usual place, and `conftest` gives another."""


@contextmanager
def no_hang():
    """End the tests, and say where they are, when what is done here has not ended after `HANG_S`."""
    faulthandler.dump_traceback_later(HANG_S, exit=True, file=told)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


def end_all_later():
    """End this process, and say where it is, when it has not ended by itself after `ALL_S`: a gate that hangs fails."""
    most_s = ALL_S * (4 if os.environ.get("MICRORAD_ENDURANCE") else 1)
    faulthandler.dump_traceback_later(most_s, exit=True, file=told)
