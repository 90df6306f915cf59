"""The templates of all pages, and the scripts that a page carries: drawing library, and what the keyboard reaches."""

from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from microrad.report.quantities import given_angle, quantity

MARK = '<script type="application/json" class="plot">'
_LIBRARY = "vendor/plotly-cartesian.min.js"


@cache
def templates() -> Environment:
    """The templates by their path in this room, with every text escaped and a missing one an error."""
    made = Environment(
        loader=PackageLoader("microrad.report", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    made.globals |= {"quantity": quantity, "angle": given_angle}
    return made


def render(template: str, context: Mapping[str, Any]) -> str:
    """A page of a template, named by its path in this room, with its scripts at its end."""
    return with_scripts(templates().get_template(template).render(context))


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
    folder = resources.files("microrad.report.page")
    return "".join(f"<script>\n{folder.joinpath(name).read_text(encoding='utf-8')}</script>\n" for name in names)
