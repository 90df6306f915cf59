"""A number of the mission as a field and a slider side by side, with what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from nicegui import ui
from nicegui.element import Element

from microrad.studio.views.sliders import Slider

Told = Callable[[str, str], Any]


class SliderRow(Element, component="slider.js"):
    """One slider. `on_try` is told key and text while it moves or is typed, `on_set` when it is let go.

    It is `busy` from then on until the mission has its value.
    """

    def __init__(self, slider: Slider, on_try: Told, on_set: Told) -> None:
        """Build the row in the present container."""
        super().__init__()
        self.slider, self._try, self._set = slider, on_try, on_set
        self.busy, self._changes = False, 0
        self._shown: dict[str, Any] = {"fault": "", **_shown(slider)}
        self._props["label"] = slider.label
        self._props["begin"] = dict(self._shown)
        self.on("try_text", lambda event: self._tried(event.args))
        self.on("set_text", lambda event: self._let_go(event.args))
        self.on("try_place", lambda event: self._tried(self._turned(event.args)))
        self.on("set_place", lambda event: self._let_go(self._turned(event.args)))

    @property
    def typed(self) -> str:
        """What its field says."""
        return str(self._shown["text"])

    def show(self, slider: Slider) -> None:
        """Show the value that the mission has; what is being moved stays as it is."""
        if not self.busy and not slider.typed == self.typed == self.slider.typed:
            self._hold(slider.typed)

    def fault(self, words: str) -> None:
        """Show what is wrong with the value, or nothing."""
        self._tell(fault=words)

    def _hold(self, typed: str) -> None:
        self.slider = self.slider.holding(typed)
        self._tell(**_shown(self.slider))

    def _tell(self, **now: Any) -> None:
        """Have the browser show what it does not show yet."""
        new = {key: value for key, value in now.items() if self._shown[key] != value}
        if new:
            self._shown |= new
            self.run_method("show", new)

    def _turned(self, place: float) -> str:
        """What the slider has come to, which its field then says."""
        self._shown["place"] = int(place)
        typed = self.slider.at(int(place))
        self._tell(text=typed)
        return typed

    async def _tried(self, typed: str) -> None:
        self._begin(typed)
        await self._try(self.slider.key, typed)

    async def _let_go(self, typed: str) -> None:
        if not self.busy and typed == self.slider.typed:
            return
        mine = self._begin(typed)
        self._hold(typed)
        await self._set(self.slider.key, typed)
        self.busy = mine != self._changes  # else it has been moved again meanwhile

    def _begin(self, typed: str) -> int:
        """Note a change that is not the mission's yet."""
        self.busy, self._shown["text"] = True, typed
        self._changes += 1
        return self._changes


def _shown(slider: Slider) -> dict[str, Any]:
    """What the browser shows of a slider; no steps where it has no slider."""
    return {"text": slider.typed, "place": slider.position, "steps": 0 if slider.scale == "none" else slider.steps}


class SliderBoard:
    """The sliders of a page in groups; the numbers that are seldom moved stand folded behind each group."""

    def __init__(self, on_try: Told, on_set: Told, seldom: Callable[[str], bool] = lambda key: False) -> None:
        """Build an empty board in the present container."""
        self._try, self._set, self._seldom = on_try, on_set, seldom
        self.rows: dict[str, SliderRow] = {}
        self._box = ui.column().classes("sliders")

    def show(self, groups: Mapping[str, tuple[Slider, ...]]) -> None:
        """Show these sliders: in the rows that are there, or in new ones where the keys have changed."""
        sliders = {slider.key: slider for group in groups.values() for slider in group}
        if [*sliders] != [*self.rows]:
            self._build(groups)
        for key, slider in sliders.items():
            self.rows[key].show(slider)

    @property
    def moved(self) -> tuple[str, str] | None:
        """Key and text of a slider that shows what the mission does not have yet, or None."""
        return next(((key, row.typed) for key, row in self.rows.items() if row.busy), None)

    def faults(self, of: Mapping[str, str]) -> None:
        """Show what is wrong with each key; nothing where nothing is."""
        for key, row in self.rows.items():
            row.fault(of.get(key, ""))

    def _build(self, groups: Mapping[str, tuple[Slider, ...]]) -> None:
        self._box.clear()
        self.rows = {}
        with self._box:
            for name, group in groups.items():
                with ui.element("h2"):
                    ui.label(name)
                self._add([slider for slider in group if not self._seldom(slider.key)])
                seldom = [slider for slider in group if self._seldom(slider.key)]
                if seldom:
                    with ui.expansion(f"{name}: {len(seldom)} more").props("dense").classes("w-full"):
                        self._add(seldom)
        self.rows = {key: self.rows[key] for key in (slider.key for group in groups.values() for slider in group)}

    def _add(self, sliders: list[Slider]) -> None:
        for slider in sliders:
            self.rows[slider.key] = SliderRow(slider, self._try, self._set)
