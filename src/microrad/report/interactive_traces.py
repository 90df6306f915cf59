"""Everything that is drawn in a panel, in that order, as plotly's traces, shapes and annotations."""

from collections.abc import Callable
from typing import Any

from matplotlib.artist import Artist
from matplotlib.collections import (
    Collection,
    FillBetweenPolyCollection,
    LineCollection,
    PathCollection,
    PolyCollection,
    QuadMesh,
)
from matplotlib.contour import ContourSet
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, StepPatch

from microrad.report import interactive_areas as areas
from microrad.report import interactive_bars as bars
from microrad.report import interactive_lines as lines
from microrad.report.interactive_axes import Panel, background
from microrad.report.interactive_sheet import Look, Pen, Sheet
from microrad.report.interactive_style import StaticOnlyError
from microrad.report.interactive_texts import texts

_MAKERS: tuple[tuple[type, Callable[[Pen, Any], None]], ...] = (  # the first that fits
    (Line2D, lines.line),
    (ContourSet, areas.contours),
    (FillBetweenPolyCollection, areas.areas),
    (PolyCollection, areas.polygons),
    (LineCollection, lines.segments),
    (PathCollection, lines.points),
    (QuadMesh, areas.mesh),
    (AxesImage, areas.image),
    (StepPatch, bars.stairs),
    (Patch, areas.patch),
)


def turn(panel: Panel, sheet: Sheet) -> None:
    """Add everything in a panel to the sheet. Raises StaticOnlyError for what has no interactive form."""
    axes, pen = panel.axes, Pen(panel, sheet)
    if axes.artists or axes.tables:
        raise StaticOnlyError("artists beside lines, areas, images and texts")
    _behind(pen)
    errors, taken = lines.error_bars(axes)
    taken |= bars.bars(pen)
    drawn = [*axes.images, *axes.collections, *axes.patches, *axes.lines]
    for artist in sorted(drawn, key=lambda each: each.get_zorder()):
        if id(artist) in errors:
            lines.with_errors(pen, errors[id(artist)])
        elif artist.get_visible() and id(artist) not in taken:
            _one(pen, artist)
    sheet.annotations += texts(panel)


def _one(pen: Pen, artist: Artist) -> None:
    if isinstance(artist, Collection):
        of = artist.get_offset_transform() if isinstance(artist, PathCollection) else artist.get_transform()
        if not all(of.contains_branch_seperately(pen.axes.transData)):
            raise StaticOnlyError(f"{type(artist).__name__} that is not in the coordinates of its panel")
    maker = next((maker for kind, maker in _MAKERS if isinstance(artist, kind)), None)
    if maker is None:
        raise StaticOnlyError(type(artist).__name__)
    maker(pen, artist)


def _behind(pen: Pen) -> None:
    """A background that is not the page's."""
    tint = background(pen.panel)
    if tint:
        box = {"type": "rect", "x0": 0, "x1": 1, "y0": 0, "y1": 1, "layer": "below", "line": {"width": 0}}
        refs = {"xref": f"{pen.panel.x.name} domain", "yref": f"{pen.panel.y.name} domain"}
        pen.shape({**box, **refs, "fillcolor": tint}, "", Look(""))
