"""The newest result of a slow function: it runs in a thread, the latest question wins, any page reads how far it is."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

from microrad.core.progress import Progress

T = TypeVar("T")


class SupersededError(Exception):
    """Raised inside a computation whose result nobody waits for any more."""


@dataclass(frozen=True, slots=True)
class State(Generic[T]):
    """How far a question is: `key` names it; `result` and `error` belong to it and to no earlier one.

    `done` of `total` steps of `what` are made; a total of 0 means that the number of steps is not known.
    """

    key: str = ""
    running: bool = False
    done: int = 0
    total: int = 0
    what: str = ""
    result: T | None = None
    error: str = ""


class Latest(Generic[T]):
    """One question at a time, for all pages; safe to use from several threads.

    A result stays until another question is asked, so a page that is opened later finds it.
    """

    def __init__(self) -> None:
        """Nothing is asked yet."""
        self._lock = threading.Lock()
        self._state: State[T] = State()
        self._thread: threading.Thread | None = None

    @property
    def state(self) -> State[T]:
        """How far the latest question is."""
        return self._state

    def ask(self, key: str, work: Callable[[Progress], T]) -> None:
        """Begin the work of a question, unless the same is being or has been worked on; an older one is dropped.

        `work` may raise ValueError and OSError, whose words become the error; it calls its progress often, so that it
        can be dropped. What else it raises is told as the error, too, and ends its thread.

        Args:
            key: what tells the question from others.
            work: answers it, told how to report progress.
        """
        with self._lock:
            if key == self._state.key and (self._state.running or self._state.result is not None or self._state.error):
                return
            self._state = State(key, running=True)
            self._thread = threading.Thread(target=self._run, args=(self._state, work), daemon=True)
            self._thread.start()

    def cancel(self) -> None:
        """Drop what is running; it can be asked for again."""
        with self._lock:
            if self._state.running:
                self._state = State()

    def wait(self, timeout_s: float) -> State[T]:
        """The state once the question's thread has ended, or after the time."""
        thread = self._thread
        if thread is not None:
            thread.join(timeout_s)
        return self._state

    def _run(self, mine: State[T], work: Callable[[Progress], T]) -> None:
        current = mine

        def note(new: State[T]) -> None:
            nonlocal current
            with self._lock:
                if self._state is not current:
                    raise SupersededError
                self._state = current = new

        def progress(done: int, total: int, what: str) -> None:
            note(replace(current, done=done, total=total, what=what))

        try:
            try:
                result = work(progress)
            except (ValueError, OSError) as error:
                note(replace(current, running=False, error=str(error)))
            except MemoryError:
                note(replace(current, running=False, error="the memory does not suffice; make the mission smaller"))
            except SupersededError:
                raise
            except Exception as error:
                note(replace(current, running=False, error=f"it ended with {type(error).__name__}: {error}"))
                raise
            else:
                note(replace(current, running=False, result=result))
        except SupersededError:
            return


_shared: weakref.WeakKeyDictionary[Any, dict[str, Latest[Any]]] = weakref.WeakKeyDictionary()
_sharing = threading.Lock()


def shared(owner: object, name: str) -> Latest[Any]:
    """The one question of that name that all pages of `owner` share; it ends with its owner.

    Args:
        owner: what the pages have in common.
        name: that of the question.
    """
    with _sharing:
        return _shared.setdefault(owner, {}).setdefault(name, Latest())
