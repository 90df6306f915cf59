"""What a page carries to come alive: the drawing library, what draws figures with it, and what the keyboard reaches."""

from importlib import resources

MARK = '<script type="application/json" class="plot">'
_LIBRARY = "vendor/plotly-cartesian.min.js"


def with_scripts(page: str) -> str:
    """The page with its scripts at its end: the drawing library only where a figure of it is interactive."""
    body, end, rest = page.rpartition("</body>")
    return body + keyboard() + (library() if MARK in page else "") + end + rest


def keyboard() -> str:
    """The script element that lets the keyboard scroll what is wider than the page."""
    return _elements("reach.js")


def library() -> str:
    """The script elements of figures: plotly (MIT licence, in ``vendor/``), and what draws the figures with it."""
    return _elements(_LIBRARY, "figure.js")


def _elements(*names: str) -> str:
    folder = resources.files("microrad.report")
    return "".join(f"<script>\n{folder.joinpath(name).read_text(encoding='utf-8')}</script>\n" for name in names)
