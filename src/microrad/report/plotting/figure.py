"""One figure of a report: its sheet with a title, a caption and the data it shows."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from microrad.report.plotting import interactive
from microrad.report.plotting.inlined import inlined
from microrad.report.plotting.sheet import Sheet
from microrad.report.plotting.svg import svg_of
from microrad.report.tables import Column, rows_of


@dataclass(frozen=True)
class Figure:
    """File name without ending, title, caption, what is drawn, and columns of data by heading with unit."""

    name: str
    title: str
    caption: str
    sheet: Sheet
    columns: Mapping[str, Column]
    alive: bool = True

    @cached_property
    def svg(self) -> str:
        """The static picture, as the text of an <svg> element."""
        return svg_of(self.sheet)

    @cached_property
    def plot(self) -> str:
        """The JSON that the page draws the interactive figure from; "" where the picture stands alone."""
        return interactive.text_of(interactive.plot_of(self.sheet)) if self.alive and self.sheet.panels else ""

    @property
    def labelled(self) -> str:
        """The picture with its text alternative and ids of its own, for the page."""
        return inlined(self.svg, self.name, self.title)

    @property
    def static(self) -> "Figure":
        """The figure without its interactive form."""
        return replace(self, alive=False)

    def rows(self, digits: int) -> list[tuple[str, ...]]:
        """The data as rows of text, numbers to so many digits."""
        return rows_of(self.columns, digits)
