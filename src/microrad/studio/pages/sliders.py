"""A page with sliders: what it shows follows them at once, and the mission when one is let go."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Generic, TypeVar

from nicegui import background_tasks, ui
from nicegui.element import Element

from microrad.mission.file import LinkFile
from microrad.studio.draft.draft import Draft
from microrad.studio.pages import layout
from microrad.studio.pages.in_thread import in_thread, pause, stay
from microrad.studio.session import Session
from microrad.studio.views.sliders import Attempt, Slider, attempt, faulty, seen

Told = Callable[[str, str], Any]


class SliderRow(Element, component="slider.js"):
    """One slider. `on_try` is told key and text while it moves or is typed, `on_set` when it is let go.

    It is `busy` from then on until the mission has its value.
    """

    def __init__(self, slider: Slider, on_try: Told, on_set: Told) -> None:
        """Build the row in the present container.

        Args:
            slider: what it shows at first.
            on_try: told key and text while it moves or is typed.
            on_set: told key and text when it is let go.
        """
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
        """Build an empty board in the present container.

        Args:
            on_try: told key and text while a slider moves.
            on_set: told key and text when one is let go.
            seldom: whether a key stands folded.
        """
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


T = TypeVar("T")
_SHORT_S, _REST_S = 0.01, 0.15
_OLD = "Shown in grey: the mission before this."
_NONE = "Nothing can be shown before the mission is corrected."


class SliderPage(Generic[T]):
    """The sliders of one tab and what follows them.

    It shows the session's draft, and while a slider moves, the draft with its value. Answers are computed in a thread;
    of questions that wait, the newest alone is asked, once the browser has drawn the answer before. `dimmed` turns grey
    while the draft has no view.
    """

    dimmed: tuple[Element, ...] = ()

    def __init__(
        self,
        session: Session,
        sliders: Callable[[Draft], Mapping[str, tuple[Slider, ...]]],
        view: Callable[[LinkFile], T],
        seldom: Callable[[str], bool] = lambda key: False,
    ) -> None:
        """Build sliders at the left and results at the right, and have them follow the session.

        Args:
            session: the session of all tabs.
            sliders: the sliders of a draft in groups.
            view: what is to be shown of a mission; runs in a thread. Its ValueError says why nothing can be.
            seldom: whether a key stands folded.
        """
        self.session, self.sliders, self.view = session, sliders, view
        self.view_now: T | None = None
        self.last: Attempt[T] | None = None
        self._wanted: Callable[[], Attempt[T]] | None = None
        self._busy = self._grey = False
        self._inputs = session.inputs
        with ui.element("div").classes("beside"):
            with ui.element("div").classes("slider-column"):
                self.board = SliderBoard(self._try, self._set, seldom)
            with ui.column():
                self._faults = ui.label().classes("faults kept").props('role="alert"')
                self._faults.visible = False
                self.build()
        self._mark = layout.follow(session, lambda: background_tasks.create(self._reload()))

    # ------------------------------------------------------------------------------------------ what a page is made of
    def build(self) -> None:
        """Build what stands at the right."""
        raise NotImplementedError

    async def show(self, view: T) -> None:
        """Show at once what one looks at while a slider moves; returns when the browser has drawn it."""
        raise NotImplementedError

    def show_rest(self, view: T) -> None:
        """Show what is read, and not looked at, once the sliders rest."""
        raise NotImplementedError

    # --------------------------------------------------------------------------------------------------------- changes
    async def _try(self, key: str, typed: str) -> None:
        """Show what a value would do, without writing it."""
        await self._ask(partial(attempt, self.session.draft, key, typed, self.view))

    async def _set(self, key: str, typed: str) -> None:
        """Write a value into the draft at once, before anything else that the same click asks for, and show it."""
        try:
            self.session.set(key, typed)
        except (ValueError, OSError) as error:
            layout.refuse(str(error))
            return
        while self._busy:
            await pause(self._faults, _SHORT_S)
        self._mark()
        await self._reload()

    async def _reload(self) -> None:
        """Show the draft as it is, but for a slider that moves."""
        stay(self._faults)
        inputs = self.session.inputs
        if inputs != self._inputs:
            self.last, self._inputs = None, inputs
        draft, moved = self.session.draft, self.board.moved
        self.board.show(self.sliders(draft))
        if moved is not None:
            await self._try(*moved)
        elif self.last is None or self.last.draft.text != draft.text:
            await self._ask(partial(seen, draft, self.view))

    async def _ask(self, question: Callable[[], Attempt[T]]) -> None:
        """Have a question answered in a thread; one that waits is dropped for it."""
        self._wanted = question
        if self._busy:
            return
        self._busy = True
        try:
            while self._wanted is not None:
                question, self._wanted = self._wanted, None
                await self._answer(await in_thread(self._faults, question))
        except ValueError as error:
            layout.refuse(str(error))
        finally:
            self._busy = False

    # --------------------------------------------------------------------------------------------------------- showing
    async def _answer(self, found: Attempt[T]) -> None:
        """Show a draft, or why it has no view."""
        same = self.last is not None and self.last.draft.text == found.draft.text and self.last.view is not None
        self.last = found
        rows = {key: row.slider for key, row in self.board.rows.items()}
        told = faulty(found.draft, rows)
        self.board.faults(told)
        others = [str(fault) for fault in found.draft.problems if fault.key not in told]
        state = _NONE if self.view_now is None else _OLD
        self._faults.text = "\n".join([state, *others, *([found.refusal] if found.refusal else [])])
        self._faults.visible = found.view is None
        self._dim(found.view is None)
        if found.view is not None and not same:
            self.view_now = found.view
            background_tasks.create_lazy(self._rest(found.view), name=f"rest {id(self)}")
            await self.show(found.view)

    async def _rest(self, view: T) -> None:
        await pause(self._faults, _REST_S)
        if view is self.view_now:
            self.show_rest(view)

    def _dim(self, grey: bool) -> None:
        if grey != self._grey:
            self._grey = grey
            for element in self.dimmed:
                layout.grey(element, grey)
