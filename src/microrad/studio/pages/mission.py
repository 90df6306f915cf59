"""The mission as forms with units and sources, checked as one types, with its text beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import islice
from typing import Any

from nicegui import ui

from microrad.mission import presets
from microrad.studio import commands
from microrad.studio.draft.draft import Draft, DraftError
from microrad.studio.draft.tables import offered, with_table
from microrad.studio.guard.names import NameRefusedError, safe_name, typed_words
from microrad.studio.pages import layout
from microrad.studio.pages.mission_form import Form, fault_words, table_of, tables
from microrad.studio.session import Session
from microrad.studio.views.runs import free_name

TITLE = "Mission"
PATH = "/"

_SHIPPED = "shipped mission"
_MOST_TABLES = _MOST_FAULTS = 50  # in a list; the command line shows as many faults, a mission has some 20 tables
_MOST_PASTED = 500_000
"""Characters: a message of two bytes each still comes through to the server, and a mission has some ten thousand."""
_TOO_MUCH = """
(event) => {
  const given = event.clipboardData ?? event.dataTransfer;
  const size = [...given.files].reduce((sum, file) => sum + file.size, given.getData("text").length);
  if (size <= MOST) return;
  event.preventDefault();
  event.stopPropagation();
  emit();
}
""".replace("MOST", str(_MOST_PASTED))

_NAME_EDITOR = """
document.querySelectorAll('.mission-text .cm-content').forEach(e => e.ariaLabel = 'Text of the mission');
document.querySelectorAll('.mission-text .cm-scroller').forEach(e => e.tabIndex = 0);
"""


class _BehindError(ValueError):
    """What was typed belongs to a text that is not the mission's any more."""


def page(session: Session) -> None:
    """The form of one table at a time, the text, and what is wrong with it."""
    _Page(session)


class _Page:
    """The page of one tab: which table it shows is its own, everything else is the session's."""

    def __init__(self, session: Session) -> None:
        self.session = session
        with ui.row().classes("mission-tools"):
            file_buttons(session, self._other)
            layout.copy_buttons(lambda: commands.budget(layout.file_of(session)))
        with ui.element("div").classes("mission-columns"):
            with ui.element("nav").classes("mission-tables").props('aria-label="Tables"'):
                self.search = ui.input("Find a key", on_change=self._search).props(
                    "dense outlined clearable debounce=200"
                )
                self.list = ui.column().classes("mission-list")
            self.form = Form(session, self._edited, self._reveal)
            with ui.element("section").classes("mission-text").props('aria-label="Text"') as self.section:
                self.editor = self._editor()
                self.faults = ui.column().classes("mission-faults")
        for event in ("paste.capture", "drop.capture"):
            self.section.on(event, self._too_much, js_handler=_TOO_MUCH)
        self.entries: dict[str, tuple[Any, Any]] = {}
        self._list()
        self.form.show(next(iter(tables(session.draft)), ""))
        self._choose(self.form.table)
        self._faults()
        self.mark = layout.follow(session, self._all)

    # ---------------------------------------------------------------------------------------------------- what is shown
    def _all(self) -> None:
        """Everything anew, after a change that was not made in this page's form or text."""
        if self.form.table not in tables(self.session.draft):
            self.form.show(next(iter(tables(self.session.draft)), ""))
        self.form.refresh()
        self._edited()

    def _other(self, table: str) -> None:
        """Another text is in place, which may have got a table to look at."""
        self._all()
        if table:
            self._show(table_of(table.strip("[]") + "."))

    def _edited(self) -> None:
        """The text, the faults and the list, after a change in the form."""
        if self.opened != self.session.opened:
            self._new_editor()
        self.shown = self.editor.value = _plain(self.session.draft)
        self._around()

    def _around(self) -> None:
        if hasattr(self, "mark"):
            self.mark()
        self._list()
        self._faults()

    def _list(self) -> None:
        """The tables, each with the number of its faults."""
        found = dict(islice(tables(self.session.draft).items(), _MOST_TABLES))
        if list(found) != list(self.entries):
            self.list.clear()
            with self.list:
                self.entries = {name: self._entry(name) for name in found}
            self._choose(self.form.table)
        for name, (_, badge) in self.entries.items():
            badge.text = str(found[name]) if found[name] else ""

    def _entry(self, name: str) -> tuple[Any, Any]:
        button = ui.button(on_click=partial(self._show, name)).props("flat no-caps align=left").classes("mission-entry")
        with button:
            layout.words("span", name)
            badge = layout.words("span").classes("mission-badge")
        return button, badge

    def _show(self, name: str) -> None:
        self.search.value = ""
        self.form.show(name)
        self._choose(name)
        self._reveal(next((key for key in self.session.draft.values if table_of(key) == name), ""))

    def _reveal(self, key: str) -> None:
        """Scroll the text to the line of a key."""
        value = self.session.draft.values.get(key)
        if value is not None:
            self.editor.reveal_line(value.line)

    def _choose(self, chosen: str) -> None:
        for name, (button, _) in self.entries.items():
            here = name == chosen and not self.form.sought
            button.props(add="aria-current=true" if here else "", remove="" if here else "aria-current")

    def _search(self, event: Any) -> None:
        sought = (event.value or "").strip().lower()
        if sought != self.form.sought:
            self.form.show(self.form.table, sought)
            self._choose(self.form.table)

    # ------------------------------------------------------------------------------------------------------------- text
    def _editor(self) -> ui.codemirror:
        self.opened, self.shown = self.session.opened, _plain(self.session.draft)
        ui.timer(0.5, lambda: ui.run_javascript(_NAME_EDITOR), once=True)
        return ui.codemirror(self.shown, language="TOML", theme="vscodeLight", on_change=self._text)

    def _new_editor(self) -> None:
        """An editor that cannot undo its way back into another mission; what is typed in the one before is dropped."""
        self.editor.delete()
        with self.section:
            self.editor = self._editor().move(target_index=0)

    def _text(self, event: Any) -> None:
        if event.value == self.shown:
            return
        try:
            self.session.edit(lambda draft: self._followed(draft, event.value))
        except _BehindError as error:
            self._new_editor()
            self._all()
            ui.notify(str(error), type="warning")
            return
        except (DraftError, OSError) as error:
            layout.refuse(str(error))
            return
        self.shown = _plain(self.session.draft)
        if self.form.table not in tables(self.session.draft):
            self.form.show(next(iter(tables(self.session.draft)), ""))
        self.form.refresh()
        self._around()

    def _followed(self, draft: Draft, text: str) -> Draft:
        """The draft with this page's text; `_BehindError` where the page does not show the draft as it is."""
        if self.opened != self.session.opened or self.shown != _plain(draft):
            raise _BehindError("The mission was changed in another tab just now: the text shows it; type that again.")
        return draft.with_text(text)

    def _too_much(self) -> None:
        layout.refuse(f"that text has more than {_MOST_PASTED} characters and is no mission: it was not put in")

    def _faults(self) -> None:
        """Every fault with its line, each a way to its key."""
        problems = self.session.draft.problems
        self.faults.clear()
        with self.faults:
            count = f"{len(problems)} fault{'s' if len(problems) > 1 else ''} to correct" if problems else "No faults."
            ui.label(count).props('role="status"').classes("no" if problems else "soft")
            for fault in problems[:_MOST_FAULTS]:
                place = f"line {fault.line}: {fault.key}" if fault.line else fault.key
                with ui.element("div").classes("mission-fault"):
                    go = ui.button(place, on_click=partial(self._go, fault.key, fault.line))
                    go.props("flat dense no-caps")
                    ui.label(fault_words(fault)).classes("small")
            if len(problems) > _MOST_FAULTS:
                ui.label(f"and {len(problems) - _MOST_FAULTS} more").classes("small")

    def _go(self, key: str, line: int) -> None:
        found = tables(self.session.draft)
        name = key.split(".", maxsplit=1)[0]
        self._show(name if name in found else table_of(key))
        if line:
            self.editor.reveal_line(line)


def _plain(draft: Draft) -> str:
    """The text as an editor holds it."""
    return draft.text.removeprefix("\ufeff").replace("\r\n", "\n")


# --------------------------------------------------------------------------------------------------------------- files
def file_buttons(session: Session, shown: Callable[[str], None]) -> None:
    """Buttons for everything that is done with files.

    Args:
        session: the session of all tabs.
        shown: called with the table to look at, "" for any.
    """
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
        file = free_name(session, "leo-geo" if name == _SHIPPED else name, ".toml")
        draft = Draft.shipped(session.inside(file))
        session.replace(draft if name == _SHIPPED else draft.with_text(presets.preset_text(name)))

    _ask("Begin a new mission", "From", "Begin", texts, do, shown, _lost(session))


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
    lost = session.draft.changed
    asked = "and lose the changes?" if lost else "as it is on disk now?"

    def again() -> None:
        session.reopen()
        shown("")

    with _dialog(f"Open {session.draft.path.name} again {asked}", "Lose the changes" if lost else "Open again", again):
        pass


def _save_as(session: Session, shown: Callable[[str], None]) -> None:
    def save() -> None:
        try:
            given = safe_name(name.value or "")
        except NameRefusedError as error:
            raise ValueError(typed_words(error)) from None
        session.save(given if given.endswith(".toml") else f"{given}.toml")
        shown("")

    with _dialog(f"Save the mission in {session.folder}", "Save", save) as go:
        name = ui.input("Name of the file", value=session.draft.path.name).props("outlined").classes("w-full")
        name.on("keydown.enter", go)


def _ask(
    title: str,
    label: str,
    verb: str,
    options: list[str] | dict[str, str],
    do: Callable[[str], None],
    shown: Callable[[str], None],
    warning: str = "",
) -> None:
    """A dialog that asks for one of several options."""

    def chosen() -> None:
        do(choice.value)
        shown(choice.value if choice.value.startswith("[") else "")

    with _dialog(title, verb, chosen):
        choice = ui.select(options, label=label, value=next(iter(options))).props("outlined").classes("w-full")
        if warning:
            ui.label(warning)


@contextmanager
def _dialog(title: str, verb: str, do: Callable[[], None]) -> Iterator[Callable[[], None]]:
    """An open dialog to be filled; its button does something, or says in the dialog why it cannot be done.

    Yields what the button does.
    """

    def go() -> None:
        fault.text = ""
        try:
            do()
        except (ValueError, OSError) as error:
            fault.text = str(error)
        else:
            dialog.close()

    with ui.dialog() as dialog, ui.card().classes("mission-dialog"):
        layout.heading(title)
        yield go
        fault = ui.label().classes("no kept").props('role="alert"')
        with ui.row():
            ui.button(verb, on_click=go).props("no-caps")
            ui.button("Cancel", on_click=dialog.close).props("no-caps outline")
    dialog.open()
