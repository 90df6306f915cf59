"""An identified mirror put into a mission: its `[mirror]` table names the mirror's file and nothing else."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

from microrad.mission.toml import Statement, scan
from microrad.studio.draft.draft import Draft

_HEADERS = ("table", "tables", "broken")
_LINE = re.compile(r"[^\n]*\n|[^\n]+")


def with_mirror_file(draft: Draft, mirror: Path) -> Draft:
    """The draft with the mirror of a file in place of its own: tables `[mirror]` and `[mirror.…]` make room for it.

    The comments between the tables stay where they are, and so does everything else. The path is written as seen from
    the mission's file. Raises `DraftError` for a path that no file of text can hold.
    """
    lines = _LINE.findall(draft.text.removeprefix("\ufeff"))
    end = "\r\n" if any(line.endswith("\r\n") for line in lines) else "\n"
    seen_from_there = Path(os.path.relpath(mirror.absolute(), draft.path.absolute().parent)).as_posix()
    new = f"[mirror]{end}file = {json.dumps(seen_from_there, ensure_ascii=False)}{end}"
    gone = _lines_of_mirror("".join(lines).replace("\r\n", "\n"))
    kept: list[str] = []
    for number, line in enumerate(lines, start=1):
        if number == min(gone, default=0):
            kept.append(new)
        if number not in gone:
            kept.append(line)
    if not gone:
        kept.append(f"{'' if not lines or lines[-1].endswith(end) else end}{end}{new}")
    return draft.with_text("".join(kept))


def _lines_of_mirror(text: str) -> set[int]:
    """The numbers of the lines that belong to the mirror, with what stands between two tables of it."""
    statements = [each for each in scan(text) if each.kind in (*_HEADERS, "key")]
    found: set[int] = set()
    inside, last = False, 0
    for each in statements:
        header = each.kind in _HEADERS
        mine = _of_mirror(each) if header else inside
        if mine:
            found |= set(range(last + 1 if inside else each.line, each.last_line + 1))
            last = each.last_line
        inside = mine
    return found


def _of_mirror(header: Statement) -> bool:
    return header.key == "mirror" or header.key.startswith("mirror.")
