"""Run a report again from the manifest that it carries, and say what differs, number by number."""

import json
import math
import re
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import escape

from microrad import study
from microrad.folder import MANIFEST
from microrad.report import compared
from microrad.report.carried import ENDING, OPENING, Carried, ReproduceError, altered, read, unpack
from microrad.report.compared import Difference, clipped

Progress = Callable[[int, int, str], None]

TOLERANCE = 1e-6
"""Relative difference up to which two numbers count as the same: more than another machine's last digits make up."""
MOST_SHOWN = 40
"""Differences that the text lists."""

_TAG = re.compile(r"<[^<>]*>")


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What came out of running a report again.

    ``differences`` are those of the numbers and words beyond ``tolerance``; ``largest`` is the largest relative
    difference of all ``numbers`` compared. ``altered`` says what was changed after the report was written, ``versions``
    what it was made with (then, now), ``files`` which figures' data are not byte for byte the same, and ``page``
    which lines of the page.
    """

    path: Path
    tolerance: float
    numbers: int
    largest: float
    differences: tuple[Difference, ...]
    altered: tuple[str, ...]
    versions: Mapping[str, tuple[str, str]]
    files: tuple[str, ...]
    page: tuple[str, ...]

    @property
    def same(self) -> bool:
        """Whether nothing differs: bytes count only where versions and machine are those of the report."""
        bytes_differ = not self.versions and bool(self.files or self.page)
        return not (self.differences or self.altered or bytes_differ)


# ------------------------------------------------------------------------------------------------------------- running
def reproduce(
    path: Path, tolerance: float = TOLERANCE, on_progress: Progress = lambda done, total, what: None
) -> Reproduction:
    """Run the study of a report again and compare.

    Raises ReproduceError for a file that is no whole report, lacks a file that its mission names, or has a mission that
    does not run, and MissionError for one that this version does not read.
    """
    from microrad import report  # this package draws: it takes longer to load than reading takes

    carried = read(path)
    with tempfile.TemporaryDirectory(prefix="microrad-reproduce-") as folder:
        file, moved = unpack(carried, Path(folder) / "study")
        try:
            ran = study.run(file, on_progress)
        except ValueError as error:  # an unstable loop, a mirror without inverse, a table that is none
            raise ReproduceError(f"{path}: the mission that it carries does not run: {error}") from error
        page = report.write(ran, Path(folder) / "again", on_progress=on_progress)
        now = json.loads(restored((page.parent / MANIFEST).read_text(encoding="utf-8"), moved, _in_json))
        text = restored(page.read_text(encoding="utf-8"), moved, lambda name: str(escape(name)))
        return _compared(carried, now, text, tolerance)


def restored(text: str, moved: Mapping[str, str], written: Callable[[str], str]) -> str:
    """The text with the names that the mission gives to its files in place of those that they were written under."""
    for name, own in moved.items():
        text = text.replace(written(own), written(name))
    return text


def _in_json(name: str) -> str:
    return json.dumps(name, ensure_ascii=False)[1:-1]


# ----------------------------------------------------------------------------------------------------------- comparing
def _compared(carried: Carried, now: Mapping[str, Any], page: str, tolerance: float) -> Reproduction:
    was = carried.data
    found = compared.compare(was["summary"], now["summary"], tolerance)
    then = {**was["versions"], "machine": str(was.get("machine", ""))}
    today = {**now["versions"], "machine": now["machine"]}
    versions = {
        clipped(name): (clipped(then.get(name, "none")), today.get(name, "none"))
        for name in dict.fromkeys([*then, *today])
        if then.get(name) != today.get(name)
    }
    stated = was.get("files_sha256") or {}
    every = sorted({*stated, *now["files_sha256"]})
    data = [name for name in every if name.startswith("figures/") and name.endswith(".csv")]
    return Reproduction(
        path=carried.path,
        tolerance=tolerance,
        numbers=found.numbers,
        largest=found.largest,
        differences=found.differences,
        altered=altered(carried),
        versions=versions,
        files=tuple(clipped(name) for name in data if stated and stated.get(name) != now["files_sha256"].get(name)),
        page=_lines(carried.page, page) if carried.page else (),
    )


def _lines(was: str, now: str) -> tuple[str, ...]:
    """Lines of a page that this run's page does not have, and how many it lacks; the manifest is left out."""
    then, today = (_shown_part(text).splitlines() for text in (was, now))
    own = Counter(then) - Counter(today)
    found = []
    for number, line in enumerate(then, start=1):
        if own[line]:
            own[line] -= 1
            found.append(f"line {number}: {clipped(_TAG.sub(' ', line).strip())}")
    missing = (Counter(today) - Counter(then)).total()
    return (*found, *([f"{missing} lines of this run's page are not in it"] if missing else []))


def _shown_part(page: str) -> str:
    before, _, behind = page.partition(OPENING)
    return before + behind.partition(ENDING)[2]


def words(found: Reproduction) -> str:
    """What differs, as text."""
    lines = [headline(found), *found.altered]
    lines += [str(each) for each in found.differences[:MOST_SHOWN]]
    if len(found.differences) > MOST_SHOWN:
        lines.append(f"and {len(found.differences) - MOST_SHOWN} more (all of them with --json)")
    lines += [f"{name} was {was} and is {now}" for name, (was, now) in found.versions.items()]
    if found.files:
        lines.append(f"data of figures, not byte for byte the same: {', '.join(found.files)}")
    if found.page:
        shown_lines = "; ".join(found.page[:3]) + (f"; and {len(found.page) - 3} more" if len(found.page) > 3 else "")
        lines.append(f"the page's text is not what this run writes: {shown_lines}")
    return "\n".join(lines)


def headline(found: Reproduction) -> str:
    """The outcome in a sentence."""
    compared_ = f"{found.numbers} numbers compared, largest relative difference {found.largest:.2g}"
    limit = f"tolerance {found.tolerance:g}"
    if found.same:
        return f"{found.path}: nothing differs ({compared_}, {limit})."
    what = f"{len(found.differences)} differ{'s' if len(found.differences) == 1 else ''} beyond it"
    return f"{found.path}: the report is not reproduced ({compared_}, {limit}; {what})."


def data(found: Reproduction) -> dict[str, Any]:
    """The outcome as plain data."""
    return {
        "report": str(found.path),
        "same": found.same,
        "tolerance": found.tolerance,
        "numbers": found.numbers,
        "largest_relative_difference": found.largest if math.isfinite(found.largest) else None,
        "differences": [each.data() for each in found.differences],
        "altered": list(found.altered),
        "versions": {name: {"was": was, "now": now} for name, (was, now) in found.versions.items()},
        "figure_data": list(found.files),
        "page": list(found.page),
    }
