"""One figure of a report: its sheet with a title, a caption and the data it shows."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from typing import ClassVar

from microrad.report.plotting import interactive
from microrad.report.plotting.layout import Layout, layout
from microrad.report.plotting.sheet import Sheet
from microrad.report.plotting.svg import HATCH_FILL, HATCH_ID, svg_of
from microrad.report.tables import Column, rows_of


@dataclass(frozen=True)
class Figure:
    """File name without ending, title, caption, what is drawn, and columns of data by heading with unit."""

    kind: ClassVar[str] = "figure"
    name: str
    title: str
    caption: str
    sheet: Sheet
    columns: Mapping[str, Column]
    alive: bool = True

    @cached_property
    def placed(self) -> Layout:
        """Where everything of the sheet stands, in both forms."""
        return layout(self.sheet)

    @cached_property
    def svg(self) -> str:
        """The static picture, as the text of an <svg> element."""
        return svg_of(self.sheet, self.placed)

    @cached_property
    def plot(self) -> str:
        """The JSON that the page draws the interactive figure from; "" where the picture stands alone."""
        alive = self.alive and self.sheet.panels
        return interactive.text_of(interactive.plot_of(self.sheet, self.placed)) if alive else ""

    def take(self, svg: str, plot: str) -> None:
        """Have both forms as they were drawn earlier, from the same sheet.

        Args:
            svg: the static picture.
            plot: what the page's script draws.
        """
        vars(self).update(svg=svg, plot=plot)

    @property
    def id(self) -> str:
        """The name as one of an element."""
        return re.sub("[^A-Za-z0-9_.-]", "-", self.name)

    @property
    def labelled(self) -> str:
        """The picture with its text alternative, for the page, where the id of its hatching is this figure's own."""
        own = f"{self.id}-1"
        text = self.svg.replace(HATCH_ID, f'id="{own}"', 1).replace(HATCH_FILL, f'fill="url(#{own})"')
        return text.replace("<svg ", f'<svg role="img" aria-label="{escape(self.title)}" ', 1)

    @property
    def static(self) -> "Figure":
        """The figure without its interactive form."""
        return replace(self, alive=False)

    def rows(self, digits: int) -> list[tuple[str, ...]]:
        """The data as rows of text, numbers to so many digits."""
        return rows_of(self.columns, digits)
