"""The frame of every page: what is being edited and whether it is saved, the way to the other pages, one style."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from microrad.studio.commands import Action
from microrad.studio.draft.draft import Draft, OnDisk
from microrad.studio.session import Session

POLL_S = 0.5
"""Between two looks at what another tab or a job has changed."""

COPY_S = 60.0
"""In which a browser copies a text, or is asked by its user whether it may."""

_COPY = """
return navigator.clipboard
    ? navigator.clipboard.writeText(TEXT).then(() => "", (error) => error.message)
    : "the browser lets pages copy over https or from this machine only"
"""

_ON_DISK: dict[OnDisk, str] = {"": "", "changed": "changed on disk; open it again", "gone": "gone from disk"}


@contextmanager
def frame(session: Session, title: str, entries: tuple[tuple[str, str], ...]) -> Iterator[None]:
    """Header with state and navigation, a heading, and the body to be filled.

    Args:
        session: the session of all tabs.
        title: that of the page.
        entries: titles and paths of all pages.
    """
    style = resources.files(__package__).joinpath("style.css").read_text("utf-8")
    ui.add_head_html(f"<style>{style}</style>")  # ui.add_css would add a script, which the guard's policy stops
    ui.colors(primary="#0a4f96", negative="#a63c00", positive="#00664a")
    with ui.header().classes("studio-header"):
        _state(session)
        with ui.element("nav").props('aria-label="Pages"').classes("studio-nav"):
            for name, path in entries:
                here = ' aria-current="page"' if name == title else ""
                ui.link(name, path).props(here.strip())
    with ui.column().classes("studio-body"):
        heading(title, 1)
        yield


def _state(session: Session) -> None:
    async def late_save() -> None:  # a task, as writing a slider is, and so behind the one that this click has let go
        save_draft(session)

    with ui.row().classes("studio-state"):
        ui.label("microrad studio").classes("studio-name")
        mission = ui.label().classes("studio-mission")
        state = ui.label().props('role="status"').classes("studio-saved")
        save = ui.button("Save", on_click=late_save).props("dense no-caps outline")

    def show() -> None:
        draft, disk = session.draft, session.disk
        mission.text = session.name_of(draft.path)
        state.text = _words(draft, disk)
        save.enabled = draft.changed or disk == "gone"

    follow(session, show)


def _words(draft: Draft, disk: OnDisk) -> str:
    faults = len(draft.problems)
    saved = "not saved" if draft.changed or disk == "gone" else "" if disk else "saved"
    count = f"{faults} fault{'s' if faults > 1 else ''} to correct" if faults else ""
    return ", ".join(filter(None, (saved, count, _ON_DISK[disk])))


def save_draft(session: Session) -> bool:
    """Save the mission to its own file; says what went wrong, and whether it is saved."""
    return attempt(session.save)


def attempt(do: Callable[[], object]) -> bool:
    """Do something that may be refused; the refusal is shown until it is dismissed, and False returned."""
    try:
        do()
    except (ValueError, OSError) as error:
        refuse(str(error))
        return False
    return True


def grey(element: ui.element, old: bool) -> None:
    """Show an element in grey while it belongs to a mission or a question before the one that stands.

    Args:
        element: the element.
        old: whether it belongs to what was before.
    """
    element.classes(**{"add" if old else "remove": "behind"})


def refuse(words: str) -> None:
    """Show a refusal until it is dismissed."""
    ui.notify(words, type="negative", multi_line=True, timeout=0, close_button="Dismiss", position="top")


def follow(session: Session, show: Callable[[], Any]) -> Callable[[], None]:
    """Call `show` now and whenever the session has changed; what is returned says that this page has shown it.

    Args:
        session: the session of all tabs.
        show: brings the page up to date.
    """
    seen = -1

    def look() -> None:
        nonlocal seen
        _ = session.disk  # looking is what finds out that another program has changed it
        if seen != session.revision:
            seen = session.revision
            show()

    def mark() -> None:
        nonlocal seen
        seen = session.revision

    look()
    ui.timer(POLL_S, look)
    return mark


def words(tag: str, text: str = "") -> TextElement:
    """An element of this tag with a text, which is escaped; its text can be changed.

    Args:
        tag: that of HTML.
        text: what it says.
    """
    return TextElement(tag=tag, text=text)


def heading(text: str, level: int = 2) -> TextElement:
    """A heading of the page's outline: 1 is the page's own, and there already.

    Args:
        text: what it says.
        level: from 2 on.
    """
    return words(f"h{level}", text)


def file_of(session: Session) -> Path:
    """The mission's file, seen from the working folder, for a command to be copied; says so where it is not saved."""
    if session.draft.changed:
        ui.notify("The command reads the file: save the mission first, for the same numbers.", type="warning")
    return Path(session.name_of(session.draft.path))


def copy_buttons(action: Callable[[], Action | None]) -> None:
    """Buttons that copy what `action` returns as a command and as Python; None says why by a notice of its own."""
    with ui.row().classes("studio-copy"):
        ui.button("Copy as command", on_click=lambda: _copy(action(), python=False)).props("dense no-caps flat")
        ui.button("Copy as Python", on_click=lambda: _copy(action(), python=True)).props("dense no-caps flat")


async def _copy(action: Action | None, python: bool) -> None:
    """Say "Copied" once the browser has done it: a page that is not from this machine may not, nor an idle tab."""
    if action is None:
        return
    text = action.python if python else action.command
    refused = await ui.run_javascript(_COPY.replace("TEXT", json.dumps(text)), timeout=COPY_S)
    if refused:
        ui.notify(f"Not copied, {refused}: {text}", type="negative", multi_line=True)
    else:
        ui.notify(f"Copied: {text.splitlines()[0]}{' ...' if python else ''}", type="positive")
