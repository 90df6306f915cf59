"""What a page has done beside it, and the end of whoever waits for it once the page is closed.

A handler that goes on after its page was closed would build parts of a page that is gone, of which NiceGUI complains.
What it waits for therefore raises `asyncio.CancelledError` then, which ends a handler without a word. So it does where
the handler itself was cancelled: `nicegui.run` would return None.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

from nicegui import app, run
from nicegui.element import Element

P = ParamSpec("P")
R = TypeVar("R")


async def in_thread(page: Element, work: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """What `work` returns or raises, done in a thread; the caller ends when the page of this element is closed.

    Args:
        page: an element of the page.
        work: what is called in the thread.
        args: passed on to it, as named ones are.
    """
    try:
        return cast(R, await run.io_bound(work, *args, **kwargs))
    finally:
        stay(page)


async def pause(page: Element, seconds: float) -> None:
    """Wait; the caller ends when the page of this element is closed.

    Args:
        page: an element of the page.
        seconds: how long.
    """
    await asyncio.sleep(seconds)
    stay(page)


def stay(page: Element) -> None:
    """End the caller if the page of this element is closed, the caller was cancelled, or the studio ends."""
    task = asyncio.current_task()
    if page.is_deleted or app.is_stopping or (task is not None and task.cancelling()):
        raise asyncio.CancelledError
