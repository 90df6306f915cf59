"""A picture on a page that holds others: ids that no other element has, and no style beyond its own element."""

import re
from html import escape

_TAG = re.compile(r"<[A-Za-z][^<>]*>")
_ID = re.compile(r'\sid="([^"]*)"')
_TO = re.compile(r'(href="#|url\(#)([^")]*)')
_STYLE = re.compile(r"\s*<defs>\s*<style[^<>]*>[^<]*</style>\s*</defs>")
_NO_ID = re.compile(r"[^A-Za-z0-9_.-]")


def inlined(svg: str, name: str, title: str) -> str:
    """The SVG with its text alternative, ready to stand in a page.

    Ids that something in it refers to are numbered behind ``name``, which no other figure of the page has; the others
    are left out, and so is a style element, which would hold for the whole page (`style.css` has it for pictures).
    """
    svg = _STYLE.sub("", svg, count=1)
    wanted = dict.fromkeys(to for tag in _TAG.findall(svg) for _, to in _TO.findall(tag))
    prefix = _NO_ID.sub("-", name)
    own = {each: f"{prefix}-{number}" for number, each in enumerate(wanted, start=1)}

    def id_of(found: re.Match[str]) -> str:
        return f' id="{own[found[1]]}"' if found[1] in own else ""

    def tag_of(found: re.Match[str]) -> str:
        return _TO.sub(lambda to: to[1] + own[to[2]], _ID.sub(id_of, found[0]))

    return _TAG.sub(tag_of, svg).replace("<svg ", f'<svg role="img" aria-label="{escape(title)}" ', 1)
