"""What both engines know of jobs: which are to come, the time by which one is late, and what is said of it then."""

import threading
import time
from collections import deque
from collections.abc import Iterator

from microrad.campaign.records import Job

SLICE_S = 0.1  # a wait lasts this long at most, so that Ctrl-C is prompt on every system


class Clock:
    """Seconds that this process was awake: a laptop asleep, or a process stopped by Ctrl-Z, makes no job late."""

    def __init__(self) -> None:
        """Start at 0."""
        self._awake_s = 0.0
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._tick, daemon=True, name="clock")
        self._thread.start()

    def _tick(self) -> None:
        last = time.monotonic()
        while not self._end.wait(SLICE_S):
            now = time.monotonic()
            self._awake_s += min(now - last, 2.0 * SLICE_S)
            last = now

    def now(self) -> float:
        """The time (s)."""
        return self._awake_s

    def close(self) -> None:
        """Stop."""
        self._end.set()
        self._thread.join()


def late_reason(late_s: float) -> str:
    """Why a late job was stopped."""
    return f"gave no sign of life for {late_s:g} s and was stopped"


class JobQueue:
    """The jobs to come: those to be started again first, then the caller's, asked for one at a time.

    The caller's iterator is asked again after it had none, so that it may have more once outcomes are known.
    """

    def __init__(self, jobs: Iterator[Job]) -> None:
        """Nothing is asked yet."""
        self._jobs = jobs
        self._again: deque[Job] = deque()

    def next(self) -> Job | None:
        """The next job, None where there is none now."""
        return self._again.popleft() if self._again else next(self._jobs, None)

    def put_back(self, job: Job) -> None:
        """Have this one first."""
        self._again.appendleft(job)
