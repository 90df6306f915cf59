"""The worker process of a campaign: jobs come in at stdin, and what became of them goes out at stdout.

Started by `local.LocalEngine` as ``python -m microrad.campaign.engines.worker TARGET LATE_S PARENT``. It
ends when its parent does, in whatever way that ends.
"""

import ctypes
import faulthandler
import importlib
import json
import os
import signal
import struct
import sys
import threading
import time
from collections.abc import Callable
from enum import IntEnum
from queue import SimpleQueue
from typing import IO, NamedTuple, Protocol

from microrad.campaign.records import CampaignError, Job

_HEAD = struct.Struct("<BQ")  # kind, bytes that follow
_LONGEST_REASON = 1000
_STUCK_S = 600.0


class Work(Protocol):
    """What a target's function makes of the specification: it does jobs."""

    def do(self, job: Job, beat: Callable[[], None]) -> bytes:
        """The job's result.

        Args:
            job: what to do.
            beat: called at each sign of life, at least every 0.2 s or so.
        """
        ...


class Kind(IntEnum):
    """What a message says: the first two go to the worker, the others come from it."""

    OPEN = 1
    JOB = 2
    READY = 3
    BEAT = 4
    DONE = 5
    RAISED = 6
    REFUSED = 7


class Message(NamedTuple):
    """One message: what it says, and its content."""

    kind: Kind
    body: bytes = b""


def read_message(stream: IO[bytes]) -> Message | None:
    """The next message, None where the other side has ended, be it within a message."""
    head = stream.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    kind, size = _HEAD.unpack(head)
    body = stream.read(size)
    return Message(Kind(kind), body) if len(body) == size else None


def write_message(stream: IO[bytes], message: Message) -> None:
    """Write a message whole; OSError where the other side has ended.

    Args:
        stream: where to.
        message: the message.
    """
    stream.write(_HEAD.pack(message.kind, len(message.body)))
    stream.write(message.body)
    stream.flush()


def open_target(target: str, spec: bytes) -> Work:
    """The work that a function makes of a specification.

    Args:
        target: the function, "module:function".
        spec: the specification.
    """
    module, function = target.split(":")
    work: Work = getattr(importlib.import_module(module), function)(spec)
    return work


def code_sha256(target: str) -> str:
    """SHA-256 of the code that the target runs: what its module's ``code_sha256()`` says."""
    module = importlib.import_module(target.partition(":")[0])
    return str(module.code_sha256())


def words(error: BaseException) -> str:
    """An error in one line: its kind and message, for a `CampaignError` the message alone."""
    text = " ".join(str(error).split())[:_LONGEST_REASON]
    if isinstance(error, CampaignError):
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def die_with_parent(parent: int) -> bool:
    """Be killed when the parent (its process number) ends, even with all threads stuck; False where only Linux can."""
    if sys.platform != "linux":
        return False
    set_parent_death_signal = 1
    ctypes.CDLL(None).prctl(set_parent_death_signal, signal.SIGKILL)
    if os.getppid() != parent:  # it ended before the call
        os._exit(1)
    return True


def end_when_stuck(stuck_s: float) -> None:
    """End this process when its interpreter has been stuck for ``stuck_s``: in code that never gives its lock back.

    Then the thread that would notice the parent's end cannot run. A thread winds the alarm of faulthandler, which
    needs no lock itself, again and again.
    """

    def wind() -> None:
        while True:
            time.sleep(stuck_s / 5.0)
            faulthandler.dump_traceback_later(stuck_s, exit=True)

    faulthandler.dump_traceback_later(stuck_s, exit=True)  # that thread may come too late
    threading.Thread(target=wind, daemon=True, name="alarm").start()


def _tell(parent: IO[bytes], message: Message) -> None:
    """Tell the parent; without a parent the process ends."""
    try:
        write_message(parent, message)
    except OSError:
        os._exit(1)


class Beat:
    """Tells of a job's signs of life, at most every ``every_s``; the first at once."""

    def __init__(self, tell: Callable[[], None], every_s: float) -> None:
        """Nothing is told yet.

        Args:
            tell: tells of a sign of life.
            every_s: least time (s) between two of them.
        """
        self._tell = tell
        self._every_s = every_s
        self._next_s = 0.0

    def __call__(self) -> None:
        """A sign of life."""
        now = time.monotonic()
        if now >= self._next_s:
            self._next_s = now + self._every_s
            self._tell()


def beat_every_s(late_s: float) -> float:
    """How often beats are worth telling where ``late_s`` without one is too late (both s)."""
    return min(1.0, late_s / 10.0)


def _serve(target: str, late_s: float, messages: "SimpleQueue[Message]", parent: IO[bytes]) -> None:
    """Open the work with the first message, then do job after job.

    The parent is told of which code the work is, or why it cannot be opened.
    """
    try:
        work = open_target(target, messages.get().body)
        code = code_sha256(target)
    except BaseException as error:
        _tell(parent, Message(Kind.REFUSED, words(error).encode()))
        return
    _tell(parent, Message(Kind.READY, code.encode()))
    while True:
        asked = messages.get()
        beat = Beat(lambda: _tell(parent, Message(Kind.BEAT)), beat_every_s(late_s))
        beat()  # says that it has begun
        try:
            answer = Message(Kind.DONE, work.do(Job(*json.loads(asked.body)), beat))
        except BaseException as error:  # whatever it was, it is this job's
            answer = Message(Kind.RAISED, words(error).encode())
        _tell(parent, answer)


def _take_pipes() -> tuple[IO[bytes], IO[bytes]]:
    """The pipes at stdin and stdout for the messages alone: what anything prints goes to stderr instead."""
    incoming, outgoing = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return incoming, outgoing


def main() -> None:
    """Work until the parent ends; this thread only reads, so that it notices at once."""
    target, late_s, parent = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's matter
    if not die_with_parent(parent):
        end_when_stuck(late_s + _STUCK_S)  # a living parent is quicker
    incoming, outgoing = _take_pipes()
    messages: SimpleQueue[Message] = SimpleQueue()
    arguments = (target, late_s, messages, outgoing)
    threading.Thread(target=_serve, args=arguments, daemon=True, name="jobs").start()
    while (message := read_message(incoming)) is not None:
        messages.put(message)
    os._exit(0)


if __name__ == "__main__":
    main()
