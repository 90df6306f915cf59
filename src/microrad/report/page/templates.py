"""The templates of all pages, and the scripts that a page carries: drawing library, and what the keyboard reaches."""

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from microrad.report.tables import Cell, Table
from microrad.report.view import Block, View, anchored

if TYPE_CHECKING:
    from microrad.mission.file import LinkFile
    from microrad.mission.model import Source

MARK = '<script type="application/json" class="plot">'
_LIBRARY = "vendor/plotly-cartesian.min.js"


@cache
def templates() -> Environment:
    """The templates by their path in this room, with every text escaped and a missing one an error."""
    made = Environment(
        loader=PackageLoader("microrad.report", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    made.filters["kind"] = lambda block: type(block).__name__
    return made


def drawing(template: str, name: str, *arguments: object) -> Markup:
    """A picture made by a macro of a template.

    Args:
        template: by its path in this room.
        name: of the macro.
        arguments: of the macro, in their order.
    """
    made: Markup = getattr(templates().get_template(template).module, name)(*arguments)
    return made


def mission_page(
    file: "LinkFile", kind: str, lead: Sequence[Block], views: Sequence[View], *, data: str = "", manifest: bool = False
) -> str:
    """A page on a mission.

    Args:
        file: the mission's file.
        kind: what was made of it.
        lead: what stands above all views.
        views: the parts of the page.
        data: where the data of its figures are: "beside" the page, "below" each, or nowhere.
        manifest: whether it has an element for its manifest at its end.
    """
    of = Markup("<code>{}</code>, SHA-256 <code>{}\u2026</code>").format(file.path.name, file.sha256[:16])
    return page_of(file.mission.name, kind, of, lead, views, sha256=file.sha256, data=data, manifest=manifest)


def page_of(  # noqa: PLR0913  all but the first five are named options
    title: str,
    kind: str,
    of: Markup,
    lead: Sequence[Block],
    views: Sequence[View],
    *,
    sha256: str,
    data: str = "",
    manifest: bool = False,
    made_by: str = "",
    badge: str = "",
) -> str:
    """A page that loads nothing, with its scripts at its end: the drawing library only where a figure needs it.

    Args:
        title: its heading.
        kind: what was made, behind "microrad".
        of: of what.
        lead: what stands above all views.
        views: the parts of the page.
        sha256: stands at the foot of each printed sheet.
        data: where the data of its figures are: "beside" the page, "below" each, or nowhere.
        manifest: whether it has an element for its manifest at its end.
        made_by: the command that marks the page as ours, or "".
        badge: a warning beside the title, or "".
    """
    context = {"title": title, "kind": kind, "of": of, "lead": lead, "views": anchored(views), "sha256": sha256}
    more = {"data": data, "manifest": manifest, "made_by": made_by, "badge": badge}
    return with_scripts(templates().get_template("page/page.html").render(context | more))


def inputs_view(sources: "Mapping[str, Source]") -> View:
    """Every input with its source; buttons leave the assumptions, what was inferred, and what is changed.

    Changed is a value that no shipped mission or preset has for its key, one with the comment that a shipped mission
    has behind another value, and one that names the paper and is not its own. The hundreds of numbers of a correlation
    are left to the mirror file.
    """
    from microrad.mission.file import changed_from_shipped
    from microrad.mission.origins import is_shipped

    given = [item for item in sources.items() if item[0] != "mirror.uncertainty.correlation"]
    changed = {key for key, *_ in changed_from_shipped(sources)}
    changed |= {key for key, s in given if s.was or not is_shipped(key, s.value)}
    filters = {
        "assumptions": [k for k, (_, s) in enumerate(given) if s.kind == "assumption"],
        "inferred from others": [k for k, (_, s) in enumerate(given) if s.kind == "derived"],
        "changed from what is shipped": [k for k, (key, _) in enumerate(given) if key in changed],
    }
    counts = ", ".join(f"{len(rows)} {name}" for name, rows in filters.items())
    rows = [(Cell(key, code=True), s.value, s.text) for key, s in given]
    folded = f"All {len(given)} inputs with their sources: {counts}"
    table = Table("", ("input", "value", "source"), rows, (0, 1, 2), filters=filters, folded=folded)
    return View("Assumptions and inputs", [table], "assumptions")


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
