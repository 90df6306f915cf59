"""A mission with one value changed, before it is the mission: what a page shows of it, or why it shows nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from microrad.mission.file import LinkFile
from microrad.studio.draft.draft import Draft

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Attempt(Generic[T]):
    """A draft and its view; without one, the draft's own faults say why, or `refusal` does."""

    draft: Draft
    view: T | None
    refusal: str = ""


def attempt(draft: Draft, key: str, typed: str, view: Callable[[LinkFile], T]) -> Attempt[T]:
    """What a value would do, read as the mission file is; raises `DraftError` for a key that has no place."""
    return seen(draft.set(key, typed), view)


def seen(draft: Draft, view: Callable[[LinkFile], T]) -> Attempt[T]:
    """A draft as it is; a ValueError of `view` becomes the refusal."""
    if draft.problems:
        return Attempt(draft, None)
    try:
        return Attempt(draft, view(draft.link()))
    except ValueError as error:  # a mission that is read, and cannot be budgeted
        return Attempt(draft, None, str(error))
