"""The form of a mission: one table at a time, a row for each key, each checked as one types."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from microrad.mission.toml import Fault
from microrad.studio.draft.draft import Draft, DraftError, Value
from microrad.studio.draft.keys import Key, typed_from
from microrad.studio.pages import layout
from microrad.studio.session import Session

ROOT = "general"
"""What the keys outside of every table are called."""

_MOST = 300  # rows; a mission has some two hundred keys in all, and a page with thousands stops the browser
_WAIT_MS = 150  # behind the last character, before what was typed is checked


def table_of(key: str) -> str:
    """The outermost table of a key."""
    return key.split(".", maxsplit=1)[0] if "." in key else ROOT


def tables(draft: Draft) -> dict[str, int]:
    """The outermost tables of a draft, in its order, each with the number of its faults."""
    found = dict.fromkeys((table_of(key) for key in draft.values), 0)
    for fault in draft.problems:
        name = fault.key.split(".")[0] if fault.key.split(".")[0] in found else table_of(fault.key)
        found[name] = found.get(name, 0) + 1
    return found


def fault_words(fault: Fault) -> str:
    """A fault below its key, in the words of the command line."""
    near = f"did you mean {fault.nearest}? " if fault.nearest else ""
    return f"{fault.reason}; {near}expected: {fault.expected}"


@dataclass(slots=True)
class _Row:
    """What a row shows, to be kept up to date."""

    typed: str
    field: Any
    note: TextElement
    said: str = ""


class Form:
    """The rows of one table of the session's draft, or of the keys that hold a text.

    `changed` is called when a row has changed the draft, `entered` with the key whose field is entered. Raises nothing:
    what is wrong stands in the row.
    """

    def __init__(self, session: Session, changed: Callable[[], None], entered: Callable[[str], None]) -> None:
        """An empty form in the place where it is made; `show` fills it.

        Args:
            session: the session of all tabs.
            changed: called when a row has changed the draft.
            entered: called with the key whose field is entered.
        """
        self.session, self.table, self.sought = session, "", ""
        self._changed, self._entered = changed, entered
        self._rows: dict[str, _Row] = {}
        self._left = 0
        self._place = ui.column().classes("mission-form")

    def show(self, table: str, sought: str = "") -> None:
        """Build the rows of a table, or of every key whose name, value or comment has the text `sought`.

        Args:
            table: name of an outermost table, or `ROOT`.
            sought: the text, in any case; "" for the table.
        """
        self.table, self.sought, self._rows = table, sought.strip().lower(), {}
        self._place.clear()
        with self._place:
            values = self._chosen()
            if not values:
                ui.label("No key has this text." if self.sought else "This table has no keys of its own.")
            inner = None
            for value in values:
                if inner != (inner := value.key.rpartition(".")[0]) or not self._rows:
                    layout.heading(f"[{inner}]" if inner else "General")
                self._row(value)
            if self._left:
                more = f"Only the first {_MOST} of {_MOST + self._left} keys have a row here"
                ui.label(f'{more}; look for others with "Find a key", or change them in the text.').classes("no")
            if not self.sought:
                self._more()

    def refresh(self, typed: str = "") -> None:
        """Take over what has changed elsewhere, but for the key that is being typed here.

        The rows are built anew only when there are others.
        """
        values = {value.key: value for value in self._chosen()}
        if list(values) != list(self._rows) and not (self.sought and set(values) < set(self._rows)):
            self.show(self.table, self.sought)
            return
        for key, value in values.items():
            row = self._rows[key]
            if value.typed != row.typed and key != typed:
                row.typed = value.typed
                _put(row.field, value)
        self.judge()

    def judge(self) -> None:
        """Show in each row what its key is, or what is wrong with it."""
        values = self.session.draft.values
        for key, row in self._rows.items():
            if key in values:
                _judge(row, values[key])

    def _chosen(self) -> list[Value]:
        """The values that get a row; notes how many do not."""
        values = [*self.session.draft.values.values()]
        if self.sought:
            values = [v for v in values if self.sought in f"{v.key} = {v.typed} {v.comment}".lower()]
        else:
            values = [v for v in values if table_of(v.key) == self.table]
        self._left = max(0, len(values) - _MOST)
        return values[:_MOST]

    # ------------------------------------------------------------------------------------------------------------ rows
    def _row(self, value: Value) -> None:
        about, name = value.about, value.key.rpartition(".")[2]
        wide = about is not None and about.kind in ("text", "list")
        with ui.element("div").classes("mission-row wide" if wide else "mission-row"):
            with layout.words("label").classes("mission-key") as label:
                layout.words("span", name).classes("mission-name")
                if about is not None and about.unit:
                    layout.words("span", f"such as {typed_from(about.toml(about.example))}")
            field = _field(value)
            label.props["for"] = field.props["for"] = f"key-{len(self._rows)}"
            note = layout.words("div").classes("mission-note")
            note.props["id"] = f"note-{len(self._rows)}"
            with ui.element("div").classes("mission-drop"):
                if about is None or not about.required:
                    button = ui.button(icon="close", on_click=lambda: self._drop(value.key))
                    button.props("dense flat round size=sm").props["aria-label"] = f"Remove {value.key}"
                    button.tooltip("Remove this line")
        row = self._rows[value.key] = _Row(value.typed, field, note)
        field.on_value_change(lambda event: self._typed(value.key, event.value))
        field.on("focus", lambda: self._entered(value.key))
        _judge(row, value)

    def _typed(self, key: str, given: object) -> None:
        row = self._rows.get(key)
        typed = str(given).lower() if isinstance(given, bool) else str(given or "")
        if row is None or typed == row.typed:
            return
        row.typed = typed
        try:
            self.session.set(key, typed)
        except (DraftError, OSError) as error:
            _say(row, str(error), wrong=True)
            return
        self.refresh(key)
        self._changed()

    def _drop(self, key: str) -> None:
        if layout.attempt(lambda: self.session.edit(lambda draft: draft.without(key))):
            self.refresh()
            self._changed()

    # ------------------------------------------------------------------------------------------------------- more keys
    def _more(self) -> None:
        """A choice of the keys that this table may have, and does not."""
        absent = {k.key: k for k in self.session.draft.absent if table_of(k.key) == self.table}
        if not absent:
            return
        with ui.row().classes("mission-more"):
            names = {name: f"{name}{' (needed)' if key.required else ''}" for name, key in absent.items()}
            choice = ui.select(names, label="Another key").classes("mission-choice").props("dense outlined")
            ui.button("Add", on_click=lambda: self._add(absent.get(choice.value))).props("no-caps outline")
            about = ui.label().classes("soft small mission-about")
            about.bind_text_from(choice, "value", lambda name: _about(absent[name]) if name in absent else "")

    def _add(self, key: Key | None) -> None:
        if key is None:
            return
        example = key.example or "to be given"
        if layout.attempt(lambda: self.session.set(key.key, example)):
            self.refresh()
            self._changed()


# -------------------------------------------------------------------------------------------------------------- fields
def _field(value: Value) -> Any:
    """The field for a value: a choice, a switch, or a line of text."""
    about = value.about
    if about is not None and about.kind == "choice":
        options = list(dict.fromkeys((*about.choices, value.typed)))
        field: Any = ui.select(options, value=value.typed).props("dense outlined options-dense")
    elif about is not None and about.kind == "switch" and value.typed in ("true", "false"):
        field = ui.select(["true", "false"], value=value.typed).props("dense outlined options-dense")
    else:
        field = ui.input(value=value.typed).props(f"dense outlined debounce={_WAIT_MS} spellcheck=false")
    return field.classes("mission-field")


def _put(field: Any, value: Value) -> None:
    """Show a value that was changed elsewhere."""
    if isinstance(field, ui.select) and value.typed not in field.options:
        field.set_options([*field.options, value.typed], value=value.typed)
    else:
        field.value = value.typed


def _judge(row: _Row, value: Value) -> None:
    wrong = " ".join(map(fault_words, value.problems))
    _say(row, wrong or _explained(value), wrong=bool(wrong))


def _say(row: _Row, words: str, wrong: bool) -> None:
    """Put words into a row's note, and mark its field; nothing is sent where nothing changes."""
    if row.said == words:
        return
    row.said = row.note.text = words
    row.note.classes(add="wrong" if wrong else "", remove="" if wrong else "wrong")
    row.field.props(add="error" if wrong else "", remove="" if wrong else "error")


def _explained(value: Value) -> str:
    """What a key is, what it takes, and where its value comes from."""
    about = "a key that no mission has" if value.about is None else _about(value.about)
    return f"{about}\n{value.source}" if value.comment else about


def _about(key: Key) -> str:
    if key.kind == "choice":
        return key.description or key.wanted
    return "; ".join(filter(None, (key.description, key.wanted)))
