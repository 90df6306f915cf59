"""Two missions side by side: the keys that differ, the links of both, and the verdicts of their studies."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from nicegui import ui

from microrad.mission import presets
from microrad.report.view import Soft
from microrad.studio import commands
from microrad.studio.commands import Action
from microrad.studio.draft.draft import Draft
from microrad.studio.pages import layout
from microrad.studio.pages.elements import Blocks
from microrad.studio.pages.in_thread import in_thread
from microrad.studio.session import Session
from microrad.studio.views import compare as compare_view
from microrad.studio.views.runs import campaign_files

TITLE = "Compare"
PATH = "/compare"

_SHIPPED, _SAVED = "the shipped mission", "saved file of this mission"
_PRESET = "the preset "
"""What missions that are no files of the folder are called in it: by no name that a file could have."""


def page(session: Session) -> None:
    """The choice of the other mission, and the tables of both."""
    _Page(session)


class _Page:
    """The page of one tab. The other mission is the session's, so every tab compares with the same."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.asked = 0
        self.shown: str | None = None
        with ui.row().classes("compare-choice"):
            self.choice = ui.select(self._options(), label="Compare with", on_change=self._chosen)
            self.choice.props("outlined dense").classes("compare-select")
            layout.copy_buttons(partial(self._action, other=False))
            ui.label("for the other:").classes("soft")
            layout.copy_buttons(partial(self._action, other=True))
        self.fault = ui.label().classes("no kept").props('role="alert"')
        self.told = Blocks()
        layout.follow(session, self._look)

    def _options(self) -> dict[str, str]:
        """The missions that can be chosen, by what they are called inside, with their names."""
        draft, found = self.session.draft, {}
        if draft.path.exists() and draft.changed:
            found[_SAVED] = f"{self.session.name_of(draft.path)} as it is saved"
        campaigns = campaign_files(self.session)
        files = (path.name for path in self.session.missions() if path != draft.path and path.name not in campaigns)
        found |= {f"file {name}": name for name in files} | {_SHIPPED: _SHIPPED}
        return found | {_PRESET + each.name: f"{each.name}: {each.title}" for each in presets.presets()}

    def _compared(self, options: dict[str, str]) -> str | None:
        """The option that the other mission is."""
        other = self.session.other
        if other is None:
            return None
        name = self.session.name_of(other.path)
        own = _SAVED if other.path == self.session.draft.path else f"file {name}"
        return next((option for option in (own, name) if option in options), None)

    def _chosen(self, event: Any) -> None:
        if not event.value or event.value == self.shown:
            return
        self.shown, self.fault.text = event.value, ""
        try:
            self.session.other = self._draft(event.value)
        except (ValueError, OSError) as error:
            self.fault.text = str(error)

    def _draft(self, name: str) -> Draft:
        if name == _SAVED:
            return Draft.open(self.session.draft.path)
        if name.startswith("file "):
            return Draft.open(self.session.inside(name.removeprefix("file ")))
        shipped = Draft.shipped(self.session.folder / name)
        return shipped if name == _SHIPPED else shipped.with_text(presets.preset_text(name.removeprefix(_PRESET)))

    def _action(self, other: bool) -> Action | None:
        draft = self.session.other if other else self.session.draft
        if draft is None:
            layout.refuse("There is no other mission yet; choose one.")
            return None
        if not draft.path.exists():
            layout.refuse(f"{self.session.name_of(draft.path)} is not a file of this folder yet; save it there first.")
            return None
        return commands.budget(Path(self.session.name_of(draft.path)) if other else layout.file_of(self.session))

    # ------------------------------------------------------------------------------------------------------- the tables
    def _look(self) -> None:
        options = self._options()
        if options != self.choice.options:
            self.choice.set_options(options, value=self.choice.value if self.choice.value in options else None)
        compared = self._compared(options)
        if self.choice.value is None and compared is not None:
            self.shown = compared
            self.choice.value = compared
        self.asked += 1
        ui.timer(0.0, partial(self._show, self.asked), once=True)

    async def _show(self, asked: int) -> None:
        """Compute in a thread, and show it if nothing has changed meanwhile."""
        here, there = self.session.draft, self.session.other
        if there is None:
            self.told.show_blocks([Soft("Choose the mission that this one is to be compared with.")])
            return
        names = (self.session.name_of(here.path), self._name(there))
        blocks = await in_thread(self.told, compare_view.blocks, self.session, here, there, names)
        if asked == self.asked:
            self.told.show_blocks(blocks)

    def _name(self, draft: Draft) -> str:
        name = self.session.name_of(draft.path)
        return f"{name} (saved)" if draft.path == self.session.draft.path else name
