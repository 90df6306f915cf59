"""Tables put into a mission: one that it may have, from an example, and `[mirror]` that names an identified mirror."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from functools import cache
from importlib import resources
from pathlib import Path

from microrad.mission.toml import Statement, scan
from microrad.studio.draft.draft import Draft, DraftError
from microrad.studio.draft.keys import keys_in

_HEADER = re.compile(r"#[ \t]*\[([A-Za-z0-9_.]+)\][ \t]*")
_KEY = re.compile(r"#[ \t]*[A-Za-z0-9_]+[ \t]*=.*")
_MARK = re.compile(r"#[ \t]?")
_HEADERS = ("table", "tables", "broken")
_LINE = re.compile(r"[^\n]*\n|[^\n]+")
_RULE = re.compile(r"#[ \t]*-{20,}.*")


def offered(draft: Draft) -> tuple[str, ...]:
    """Names of the tables that the draft could get, in the order of the shipped mission."""
    text = draft.text.removeprefix("\ufeff")
    there, taken = _tables(text), _tables(text, ("table", "tables", "key"))
    names = dict.fromkeys((*_commented(text), *_examples()))
    return tuple(name for name in names if name not in taken and _has_home(name, there))


def with_table(draft: Draft, name: str) -> Draft:
    """The draft with a table more: its commented example comes to life where it stands, else it goes to the end.

    Raises `DraftError` for a table that is there already or is none.

    Args:
        draft: the mission.
        name: the dotted name of the table, one of `offered`.
    """
    if name not in offered(draft):
        raise DraftError(f"[{name}] cannot be added: it is there already, or a mission has no such table")
    text = draft.text.removeprefix("\ufeff")
    revived = _revived(text, name)
    if revived is None:
        revived = text.rstrip() + f"\n\n{_examples()[name]}\n".replace("\n", _line_end(text))
    return draft.with_text(revived)


def _has_home(name: str, there: set[str]) -> bool:
    """Whether the table belongs to none, or to one that is there: an inner table alone would only bring faults."""
    outer = name.split(".")[:-1]
    return not outer or outer[0] in there


def _tables(text: str, kinds: tuple[str, ...] = ("table", "tables")) -> set[str]:
    """Tables of a text by statements of these kinds: those that these name, and those that dotted names imply."""
    found = {each.key for each in scan(text.replace("\r\n", "\n")) if each.kind in kinds}
    return found | {name.rsplit(".", n)[0] for name in found for n in range(1, name.count(".") + 1)}


# ------------------------------------------------------------------------------------------------- commented examples
def _commented(text: str) -> dict[str, tuple[int, int]]:
    """Tables that stand in a text as comments: the first line and the one behind the last, counted from 0."""
    lines, found = text.split("\n"), {}
    for first, line in enumerate(lines):
        if header := _HEADER.fullmatch(line.rstrip("\r")):
            behind = first + 1
            while behind < len(lines) and _KEY.fullmatch(lines[behind].rstrip("\r")):
                behind += 1
            if behind > first + 1 and keys_in(header[1]):
                found[header[1]] = (first, behind)
    return found


def _revived(text: str, name: str) -> str | None:
    """The text with a commented table made a table; None where there is none, or keys below it would fall into it."""
    place = _commented(text).get(name)
    if place is None:
        return None
    lines = text.split("\n")
    first, behind = place
    rest = scan("\n".join(lines[behind:]))
    if rest and rest[0].kind == "key":
        return None
    lines[first:behind] = [_MARK.sub("", line, count=1) for line in lines[first:behind]]
    return "\n".join(lines)


# ---------------------------------------------------------------------------------------------------- shipped examples
@cache
def _examples() -> dict[str, str]:
    """Each table that there is an example of, with its text; an outermost one with all that it holds."""
    own = resources.files(__package__).joinpath("optional_tables.toml").read_text("utf-8")
    shipped = resources.files("microrad.mission").joinpath("missions", "leo-geo.toml").read_text("utf-8")
    active = dict(_blocks(shipped))
    added = dict(_blocks(own))
    found = {name: _whole(name, active) for name in active} | {name: _with_named(name, added) for name in added}
    found |= _uncommented(shipped)
    return {name: found[name] for name in sorted(found, key=lambda name: name.count("."))}


def _uncommented(text: str) -> dict[str, str]:
    """The commented tables of a text as tables."""
    lines = text.split("\n")
    return {
        name: "\n".join(_MARK.sub("", line, count=1) for line in lines[first:behind])
        for name, (first, behind) in _commented(text).items()
    }


def _whole(name: str, blocks: dict[str, str]) -> str:
    """A table's block; that of an outermost one with the blocks of its inner tables behind it."""
    inner = [] if "." in name else [text for each, text in blocks.items() if each.startswith(f"{name}.")]
    return "\n\n".join((blocks[name], *inner))


def _with_named(name: str, blocks: dict[str, str]) -> str:
    """A table's block with those of its stations behind it; other inner tables are added by themselves."""
    named = (text for each, text in blocks.items() if each.startswith(f"{name}.stations."))
    return "\n\n".join((blocks[name], *named))


def _blocks(text: str) -> Iterator[tuple[str, str]]:
    """Each table of a text: the comment right above its header, the header, its keys."""
    lines, statements = text.split("\n"), scan(text)
    for place, header in enumerate(statements):
        if header.kind != "table":
            continue
        last = header.last_line
        for each in statements[place + 1 :]:
            if each.kind != "key":
                break
            last = each.last_line
        first = header.line - 1
        while first > 0 and lines[first - 1].startswith("#") and not _of_an_example(lines[first - 1]):
            first -= 1
        yield header.key, "\n".join(lines[first:last])


def _of_an_example(line: str) -> bool:
    return bool(_KEY.fullmatch(line) or _HEADER.fullmatch(line) or _RULE.fullmatch(line))


# ------------------------------------------------------------------------------------------------ an identified mirror
def with_mirror_file(draft: Draft, mirror: Path) -> Draft:
    """The draft with the mirror of a file in place of its own: tables `[mirror]` and `[mirror.…]` make room for it.

    The comments between the tables stay where they are, and so does everything else; a mirror that stands in keys
    above all tables is named by such a key. The path is written as seen from the mission's file. Raises `DraftError`
    for a path that no file of text can hold.

    Args:
        draft: the mission.
        mirror: the path of the mirror's file.
    """
    lines = _LINE.findall(draft.text.removeprefix("\ufeff"))
    end = _line_end(draft.text)
    seen_from_there = Path(os.path.relpath(mirror.absolute(), draft.path.absolute().parent)).as_posix()
    gone = _lines_of_mirror("".join(lines).replace("\r\n", "\n"))
    first = min(gone, default=0)
    by_key = gone and not lines[first - 1].lstrip().startswith("[")  # other keys may follow
    file = f"file = {json.dumps(seen_from_there, ensure_ascii=False)}{end}"
    new = f"mirror.{file}" if by_key else f"[mirror]{end}{file}"
    kept: list[str] = []
    for number, line in enumerate(lines, start=1):
        if number == first:
            kept.append(new)
        if number not in gone:
            kept.append(line)
    if not gone:
        kept.append(f"{'' if not lines or lines[-1].endswith(end) else end}{end}{new}")
    return draft.with_text("".join(kept))


def _line_end(text: str) -> str:
    return "\r\n" if "\r\n" in text else "\n"


def _lines_of_mirror(text: str) -> set[int]:
    """The numbers of the lines that belong to the mirror, with what stands between two tables of it."""
    statements = [each for each in scan(text) if each.kind in (*_HEADERS, "key")]
    found: set[int] = set()
    inside, last = False, 0
    for each in statements:
        header = each.kind in _HEADERS
        mine = _of_mirror(each) or (inside and not header)
        if mine:
            found |= set(range(last + 1 if inside else each.line, each.last_line + 1))
            last = each.last_line
        inside = mine and (header or inside)
    return found


def _of_mirror(each: Statement) -> bool:
    return each.key == "mirror" or each.key.startswith("mirror.")
