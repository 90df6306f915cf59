"""What is said of a subject, whoever shows it: paragraphs, lists, tables, figures and further views under a title.

A view holds finished text: numbers are formatted and sentences are worded where it is made, once. `page` makes HTML of
views, `tables` text for a terminal, the studio elements of its pages.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from textwrap import fill
from typing import Any

from markupsafe import Markup

from microrad.report.plotting.figure import Figure
from microrad.report.tables import Table, table_text, tables_text


@dataclass(frozen=True, slots=True)
class Soft:
    """A paragraph that explains how to read what is above it."""

    text: str


@dataclass(frozen=True, slots=True)
class Points:
    """A list, a sentence each."""

    lines: Sequence[str]


@dataclass(frozen=True, slots=True)
class Verbatim:
    """Text whose lines stay as they are."""

    text: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """A judgement: its sentence, what belongs to it, and whether it is good news; None where it is open."""

    headline: str
    blocks: Sequence["Block"] = ()
    good: bool | None = None


@dataclass(frozen=True, slots=True)
class Drawing:
    """A picture without data of its own, as markup that is safe to show, with its title and caption."""

    name: str
    title: str
    caption: str
    svg: Markup


@dataclass(frozen=True, slots=True)
class View:
    """A title and what stands under it; a page shows one that is ``folded`` when it is asked for.

    ``anchor`` is the name that links lead to, made from the title unless given. ``listed`` says whether the contents of
    a page name it.
    """

    title: str
    blocks: Sequence["Block"] = ()
    anchor: str = ""
    folded: bool = False
    listed: bool = True

    @property
    def views(self) -> Iterator["View"]:
        """The views directly within."""
        return (block for block in self.blocks if isinstance(block, View))


_POINT: dict[str, Any] = {"initial_indent": "- ", "subsequent_indent": "  ", "break_on_hyphens": False}

Block = str | Soft | Points | Verbatim | Verdict | Drawing | Table | Figure | View


def opened(figures: Sequence[Figure], names: Sequence[str]) -> list[Block]:
    """Figures of which a page shows those of these names at once, the others when it is asked.

    Args:
        figures: in their order.
        names: of those that are shown at once.
    """
    return [f if f.name in names else View(f.title, [f], folded=True, listed=False) for f in figures]


def slug(text: str) -> str:
    """A text as the name of an anchor."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "part"


def anchored(views: Sequence[View], taken: set[str] | None = None) -> tuple[View, ...]:
    """The same views, each with an anchor that no other has.

    Args:
        views: in the order of the page.
        taken: anchors that others have; those given here are added.
    """
    taken = set() if taken is None else taken
    found = []
    for view in views:
        wanted = view.anchor or slug(view.title)
        anchor = next(name for name in (wanted, *(f"{wanted}-{n}" for n in range(2, 1000))) if name not in taken)
        taken.add(anchor)
        blocks = [anchored([b], taken)[0] if isinstance(b, View) else b for b in view.blocks]
        found.append(replace(view, anchor=anchor, blocks=blocks))
    return tuple(found)


def told(*blocks: Block | None) -> tuple[Block, ...]:
    """The blocks that say something."""
    return tuple(b for b in blocks if not (b is None or b == "" or (isinstance(b, Points) and not b.lines)))


def views_text(blocks: Sequence[Block], width: int) -> str:
    """All that is not drawn, for a terminal; no line is free between sentences in a row.

    Args:
        blocks: in their order.
        width: columns of the terminal.
    """
    parts: list[str] = []
    for alike, several in groupby(blocks, lambda block: isinstance(block, str)):
        found = list(several)
        parts += [tables_text([], list(map(str, found)), width)] if alike else [_text(each, width) for each in found]
    return "\n\n".join(filter(None, parts))


def _text(block: Block, width: int) -> str:
    match block:
        case View():
            inner = views_text(block.blocks, width)
            text = f"{block.title}\n\n{inner}" if inner else ""
        case Verdict():
            text = views_text([block.headline, *block.blocks], width)
        case Table():
            text = table_text(block, width)
        case Points():
            text = "\n".join(fill(each, width, **_POINT) for each in block.lines)
        case Soft():
            text = tables_text([], [block.text], width)
        case Verbatim():
            text = block.text
        case _:
            text = ""
    return text
