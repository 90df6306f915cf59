"""Who wants to know that loops are about to be compiled, which the first command on a machine waits for."""

import os
from collections.abc import Callable

_waiting: dict[int, Callable[[], None]] = {}
"""By process: a forked one says nothing for the one that it comes from."""


def on_first(tell: Callable[[], None]) -> None:
    """Call ``tell`` once, before the first loop of this process is compiled; never where all come from the cache."""
    _waiting[os.getpid()] = tell


def begins() -> None:
    """A loop is about to be compiled."""
    if tell := _waiting.pop(os.getpid(), None):
        tell()
