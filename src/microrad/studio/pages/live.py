"""Parts of a page that change many times a second: they keep what they show in the browser, and are told what is new.

For a change of an element's properties or text NiceGUI builds the whole page anew, which takes longer than drawing.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from nicegui.element import Element

from microrad.studio.pages.in_thread import stay
from microrad.studio.views.link import Margin
from microrad.studio.views.plots import Plot

_DRAWN_S = 5.0
"""For how long a browser may draw before it is asked for more."""


class LivePlot(Element, component="live_plot.js"):
    """A plot; `label` says what it shows and where the same stands in words."""

    def __init__(self, label: str) -> None:
        """Build it, still empty."""
        super().__init__()
        self.classes("w-full js-plotly-plot").props(f'role="figure" aria-label="{label}"')

    async def draw(self, figure: Plot) -> None:
        """Draw a figure; returns when the browser has done so, or does not answer any more."""
        with suppress(TimeoutError):
            await self.run_method("draw", figure, timeout=_DRAWN_S)
        stay(self)


class MarginCards(Element, component="margin_cards.js"):
    """The margins of the links side by side."""

    def show(self, margins: Sequence[Margin]) -> None:
        """Show these margins."""
        self.run_method("show", [{"name": m.name, "value": m.words, "needs": m.needs, "met": m.met} for m in margins])
