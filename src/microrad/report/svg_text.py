"""A canvas as the text of an <svg> element."""

import io
import re
from typing import Any

from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.backends.backend_mixed import MixedModeRenderer
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.figure import Figure as Canvas

_PER_INCH = 72.0  # points, the unit of matplotlib's SVG
_NO_METADATA = {"Date": None, "Creator": None}
_PATH = re.compile(r' d="[^"]*"')
_DECIMALS = re.compile(r"(\.\d\d)\d+")


class _Measuring(FigureCanvasBase):
    """What a layout measures texts with: the renderer that will draw them, which remembers their sizes."""

    def __init__(self, canvas: Canvas, renderer: Any) -> None:
        super().__init__(canvas)
        self._renderer = renderer

    def get_renderer(self) -> Any:
        return self._renderer


def svg_text(canvas: Canvas) -> str:
    """The canvas as an <svg> element, its coordinates to a hundredth of a point.

    It is what ``savefig`` writes, in less time: that draws a canvas with a layout twice and measures each text anew.
    """
    buffer, before, dpi = io.StringIO(), canvas.canvas, canvas.dpi
    width, height = canvas.get_size_inches()
    vectors: Any = RendererSVG  # both without types
    mixed: Any = MixedModeRenderer
    canvas.dpi = _PER_INCH
    try:
        svg = vectors(width * _PER_INCH, height * _PER_INCH, buffer, image_dpi=dpi, metadata=_NO_METADATA)
        renderer = mixed(canvas, width, height, dpi, svg)
        _Measuring(canvas, renderer)
        canvas.draw(renderer)
        renderer.finalize()
    finally:
        canvas.dpi = dpi
        canvas.set_canvas(before)
    text = buffer.getvalue()
    return _PATH.sub(lambda path: _DECIMALS.sub(r"\1", path.group()), text[text.index("<svg") :])
