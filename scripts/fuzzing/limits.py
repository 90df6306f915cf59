"""A limit of time for what is called in this process; compiled code is stopped when it comes back only."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class TooLongError(BaseException):
    """A case was ended by its timer; it is no Exception, so that nothing takes it for one of its own."""


@contextmanager
def timer(most_s: float) -> Iterator[None]:
    """Raise `TooLongError` in what takes more processor time."""

    def ring(number: int, frame: FrameType | None) -> None:
        raise TooLongError(f"more than {most_s:g} s")

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, most_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
