"""Files of the mission page: open, begin from a link of the literature, save under another name, add a table."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui

from microrad.mission import presets
from microrad.studio.draft.draft import Draft
from microrad.studio.draft.tables import offered, with_table
from microrad.studio.guard.names import NameRefusedError, safe_name, typed_words
from microrad.studio.pages import layout
from microrad.studio.session import Session

_SHIPPED = "shipped mission"


def file_buttons(session: Session, shown: Callable[[str], None]) -> None:
    """Buttons for everything that is done with files; `shown` is called with the table to look at, "" for any."""
    with ui.row().classes("mission-files"):
        ui.button("Open ...", on_click=lambda: _open(session, shown)).props("no-caps outline dense")
        ui.button("New ...", on_click=lambda: _new(session, shown)).props("no-caps outline dense")
        ui.button("Save as ...", on_click=lambda: _save_as(session, shown)).props("no-caps outline dense")
        back = ui.button("Back to the saved file", on_click=lambda: _revert(session, shown))
        back.props("no-caps outline dense")
        ui.button("Add a table ...", on_click=lambda: _add_table(session, shown)).props("no-caps outline dense")

    def look() -> None:
        back.enabled = session.draft.path.exists() and (session.draft.changed or session.disk == "changed")

    layout.follow(session, look)


def _open(session: Session, shown: Callable[[str], None]) -> None:
    names = [path.name for path in session.missions()]
    if not names:
        layout.refuse(f"There is no TOML file in {session.folder} yet; save this mission there first.")
        return

    def do(name: str) -> None:
        session.replace(Draft.open(session.inside(name)))

    _ask(f"Open a mission in {session.folder}", "File", "Open", names, do, shown, _lost(session))


def _new(session: Session, shown: Callable[[str], None]) -> None:
    texts = {_SHIPPED: "", **{each.name: f"{each.name}: {each.title}" for each in presets.presets()}}
    texts[_SHIPPED] = "the shipped mission, with mirror, loop and orbit"

    def do(name: str) -> None:
        file = "leo-geo.toml" if name == _SHIPPED else f"{name}.toml"
        draft = Draft.shipped(_free(session, file))
        session.replace(draft if name == _SHIPPED else draft.with_text(presets.preset_text(name)))

    _ask("Begin a new mission", "From", "Begin", texts, do, shown, _lost(session))


def _free(session: Session, name: str) -> str:
    """The path of a name that no file has yet."""
    stem, number, path = name.removesuffix(".toml"), 1, session.inside(name)
    while path.exists():
        number += 1
        path = session.inside(f"{stem}-{number}.toml")
    return str(path)


def _lost(session: Session) -> str:
    """What is lost with the draft, where that is more than one can begin from again."""
    draft, disk = session.draft, session.disk
    if disk == "gone" or (draft.changed and not draft.disk_sha256 and draft.text not in _beginnings()):
        return f"{draft.path.name} is not on disk and will be lost; save it first to keep it."
    return "Changes that are not saved will be lost." if draft.changed and draft.disk_sha256 else ""


def _beginnings() -> set[str]:
    """The texts that a new mission begins with."""
    return {Draft.shipped("").text, *(presets.preset_text(each.name) for each in presets.presets())}


def _add_table(session: Session, shown: Callable[[str], None]) -> None:
    names = [f"[{name}]" for name in offered(session.draft)]
    if not names:
        layout.refuse("This mission has every table that there is an example of.")
        return

    def do(name: str) -> None:
        session.edit(lambda draft: with_table(draft, name.strip("[]")))

    _ask("Add a table, with example values to be changed", "Table", "Add", names, do, shown)


def _revert(session: Session, shown: Callable[[str], None]) -> None:
    def do() -> None:
        if layout.attempt(session.reopen):
            shown("")
        dialog.close()

    with ui.dialog() as dialog, ui.card():
        lost = session.draft.changed
        asked = "and lose the changes?" if lost else "as it is on disk now?"
        layout.heading(f"Open {session.draft.path.name} again {asked}")
        with ui.row():
            ui.button("Lose the changes" if lost else "Open again", on_click=do).props("no-caps")
            ui.button("Cancel", on_click=dialog.close).props("no-caps outline")
    dialog.open()


def _save_as(session: Session, shown: Callable[[str], None]) -> None:
    def save() -> None:
        fault.text = ""
        try:
            given = safe_name(name.value or "")
            session.save(given if given.endswith(".toml") else f"{given}.toml")
        except NameRefusedError as error:
            fault.text = typed_words(error)
            return
        except (ValueError, OSError) as error:
            fault.text = str(error)
            return
        dialog.close()
        shown("")

    with ui.dialog() as dialog, ui.card().classes("mission-dialog"):
        layout.heading(f"Save the mission in {session.folder}")
        name = ui.input("Name of the file", value=session.draft.path.name).props("outlined").classes("w-full")
        name.on("keydown.enter", save)
        fault = ui.label().classes("no kept").props('role="alert"')
        with ui.row():
            ui.button("Save", on_click=save).props("no-caps")
            ui.button("Cancel", on_click=dialog.close).props("no-caps outline")
    dialog.open()


def _ask(
    title: str,
    label: str,
    verb: str,
    options: list[str] | dict[str, str],
    do: Callable[[str], None],
    shown: Callable[[str], None],
    warning: str = "",
) -> None:
    """A dialog that asks for one of several, and says in itself why it cannot be done."""

    def go() -> None:
        try:
            do(choice.value)
        except (ValueError, OSError) as error:
            fault.text = str(error)
            return
        dialog.close()
        shown(choice.value if choice.value.startswith("[") else "")

    with ui.dialog() as dialog, ui.card().classes("mission-dialog"):
        layout.heading(title)
        choice = ui.select(options, label=label, value=next(iter(options))).props("outlined").classes("w-full")
        if warning:
            ui.label(warning)
        fault = ui.label().classes("no kept").props('role="alert"')
        with ui.row():
            ui.button(verb, on_click=go).props("no-caps")
            ui.button("Cancel", on_click=dialog.close).props("no-caps outline")
    dialog.open()
