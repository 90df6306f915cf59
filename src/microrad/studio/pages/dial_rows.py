"""A number of the mission as a field and a slider side by side, with what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from nicegui import ui

from microrad.studio.dials import Dial

CSS = """
.dials { width: 100%; gap: 0; flex-wrap: nowrap; }
.dial { position: relative; display: grid; grid-template-columns: 9.5rem minmax(0, 1fr); column-gap: .9rem;
        align-items: end; width: 100%; padding-right: .6rem; min-height: 3.1rem; }
.dial-fault { position: absolute; top: 100%; left: 0; right: 0; z-index: 3; background: #fff4ee; color: #7a2c00;
              border: 1px solid #a63c00; border-radius: 3px; padding: .2rem .45rem; font-size: .82rem;
              line-height: 1.3; }
.dial .q-field__label { font-size: .85rem; color: var(--soft); }
.beside { display: grid; grid-template-columns: minmax(17.5rem, 23rem) minmax(0, 1fr); column-gap: 1.5rem;
          align-items: start; width: 100%; }
.beside > * { min-width: 0; width: 100%; }
.dial-column { position: sticky; top: 6.2rem; max-height: calc(100vh - 7rem); overflow-y: auto;
               padding-bottom: 3.5rem; }
.behind { opacity: .45; }
.faults { background: #fff4ee; border-left: 4px solid #a63c00; padding: .4rem .7rem; width: 100%; color: #7a2c00; }
.wide-table { width: 100%; } .wide-table td { white-space: normal !important; vertical-align: top; }
.wide-table td.text-no-wrap { white-space: nowrap !important; } .wide-table tr.total td { font-weight: 600; }
.wide-table th { font-weight: 600; white-space: normal !important; vertical-align: bottom; }
"""


def add_style(more: str = "") -> None:
    """Add the style of dials, and some more, to the page; `ui.add_css` would add a script, which the guard stops."""
    ui.add_head_html(f"<style>{CSS}{more}</style>")


Told = Callable[[str, str], Any]


class _Slider(ui.slider):
    """A slider whose knob the browser moves by itself; an echo of the server would come late."""

    LOOPBACK = False


class DialRow:
    """One dial. `on_try` is told key and text while it moves or is typed, `on_set` when it is let go."""

    def __init__(self, dial: Dial, on_try: Told, on_set: Told) -> None:
        """Build the row in the present container."""
        self.dial, self._try, self._set = dial, on_try, on_set
        self.busy = False
        with ui.element("div").classes("dial"):
            self.field = ui.input(dial.label, value=dial.typed).props("dense autocomplete=off spellcheck=false")
            self.slider = _Slider(min=0, max=dial.steps, step=1, value=dial.position)
            self.slider.props(f'aria-label="{dial.label}, slider" color=primary')
            self.told = ui.label().classes("dial-fault").props('role="alert"')
            self.told.visible = False
        self.slider.visible = dial.scale != "none"
        self.field.on("update:model-value", self._typing, throttle=0.15, leading_events=False)
        self.field.on("blur", self._let_go)
        self.field.on("keydown.enter", self._let_go)
        self.slider.on("update:model-value", self._moving, throttle=0.04)
        self.slider.on("change", self._released)

    def show(self, dial: Dial) -> None:
        """Show the value that the mission has; what is being moved stays as it is."""
        if self.busy or dial.typed == self.field.value == self.dial.typed:
            return
        self.dial = self.dial.holding(dial.typed)
        self.field.value = dial.typed
        self._place()

    def fault(self, words: str) -> None:
        """Show what is wrong with the value, or nothing."""
        self.told.text = words
        self.told.visible = bool(words)
        self.field.props(f"aria-invalid={'true' if words else 'false'}")

    def _place(self) -> None:
        self.slider.visible = self.dial.scale != "none"
        self.slider._props["max"] = self.dial.steps
        self.slider.value = self.dial.position
        self.slider.update()

    async def _moving(self) -> None:
        self.busy = True
        typed = self.dial.at(int(self.slider.value or 0))
        self.field.value = typed
        await self._try(self.dial.key, typed)

    async def _released(self) -> None:
        self.busy = False
        typed = self.dial.at(int(self.slider.value or 0))
        self.dial = self.dial.holding(typed)
        await self._set(self.dial.key, typed)

    async def _typing(self) -> None:
        self.busy = True
        await self._try(self.dial.key, str(self.field.value or ""))

    async def _let_go(self) -> None:
        self.busy = False
        typed = str(self.field.value or "")
        if typed == self.dial.typed:
            return
        self.dial = self.dial.holding(typed)
        self._place()
        await self._set(self.dial.key, typed)


class DialBoard:
    """The dials of a page in groups; the numbers that are seldom moved stand folded behind each group."""

    def __init__(self, on_try: Told, on_set: Told, seldom: Callable[[str], bool] = lambda key: False) -> None:
        """Build an empty board in the present container."""
        self._try, self._set, self._seldom = on_try, on_set, seldom
        self.rows: dict[str, DialRow] = {}
        self._box = ui.column().classes("dials")

    def show(self, groups: Mapping[str, tuple[Dial, ...]]) -> None:
        """Show these dials: in the rows that are there, or in new ones where the keys have changed."""
        dials = {dial.key: dial for group in groups.values() for dial in group}
        if [*dials] != [*self.rows]:
            self._build(groups)
        for key, dial in dials.items():
            self.rows[key].show(dial)

    def faults(self, of: Mapping[str, str]) -> None:
        """Show what is wrong with each key; nothing where nothing is."""
        for key, row in self.rows.items():
            row.fault(of.get(key, ""))

    def _build(self, groups: Mapping[str, tuple[Dial, ...]]) -> None:
        self._box.clear()
        self.rows = {}
        with self._box:
            for name, group in groups.items():
                with ui.element("h2"):
                    ui.label(name)
                self._add([dial for dial in group if not self._seldom(dial.key)])
                seldom = [dial for dial in group if self._seldom(dial.key)]
                if seldom:
                    with ui.expansion(f"{name}: {len(seldom)} more").props("dense").classes("w-full"):
                        self._add(seldom)
        self.rows = {key: self.rows[key] for key in (dial.key for group in groups.values() for dial in group)}

    def _add(self, dials: list[Dial]) -> None:
        for dial in dials:
            self.rows[dial.key] = DialRow(dial, self._try, self._set)
