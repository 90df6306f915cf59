"""Run a report again from the manifest that it carries, and say which of its quantities differ."""

import json
import math
import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import escape

from microrad import report
from microrad.core.folder import MANIFEST, scratch
from microrad.core.machine import ARCHITECTURE, as_stated
from microrad.core.progress import Progress
from microrad.report.results import comparison, tolerances
from microrad.report.results.comparison import Comparison, Difference, clipped
from microrad.report.results.manifest import shown_part
from microrad.report.results.manifest_reader import (
    ReadManifest,
    ReproduceError,
    altered_parts,
    content_beside,
    read_manifest,
    unpack_mission,
)
from microrad.report.results.tolerances import ConverterSteps, converter_steps
from microrad.study import study

MOST_SHOWN = 40
"""Differences that the text lists."""

_DRAWN = re.compile(r"(?s)<(script|style|svg)\b.*?</\1>")
_TAG = re.compile(r"<[^<>]*>")


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What came out of running a report again.

    ``unlike`` says what of versions and machine is not that of the report (then, now): with nothing of it, quantities
    are compared to the last bit, else to their tolerances; ``undetailed`` is the machine of a report that says no more
    of it than its architecture. ``differences`` are the quantities and words that are not the same by that;
    ``largest`` is the largest relative difference of all ``numbers`` compared. ``altered`` says what was changed after
    the report was written, ``files`` which figures' data are not byte for byte the same, those of ``read`` compared as
    numbers. ``layout`` says whether drawings or markup of the page differ, and ``page`` which lines of its text.
    """

    path: Path
    numbers: int
    largest: float
    differences: tuple[Difference, ...]
    altered: tuple[str, ...]
    unlike: Mapping[str, tuple[str, str]]
    undetailed: str
    files: tuple[str, ...]
    read: tuple[str, ...]
    layout: bool
    page: tuple[str, ...]

    @property
    def same(self) -> bool:
        """Whether all quantities agree, and nothing was changed after the report was written."""
        return not (self.differences or self.altered)

    @property
    def to_the_last_bit(self) -> bool:
        """Whether quantities were compared to the last bit: on the same machine, with the same versions."""
        return not self.unlike


# ------------------------------------------------------------------------------------------------------------- running
def reproduce(path: Path, on_progress: Progress = lambda done, total, what: None) -> Reproduction:
    """Run the study of a report again and compare.

    Args:
        path: a report.html, a manifest.json, or a folder of results.
        on_progress: is told how far the study is.

    Raises ReproduceError for a file that is no whole report, lacks a file that its mission names, or has a mission that
    does not run, and MissionError for one that this version does not read.
    """
    manifest = read_manifest(path)
    with scratch("reproduce") as folder:
        file, moved = unpack_mission(manifest, folder / "study")
        try:
            ran = study.run_study(file, on_progress)
        except ValueError as error:  # an unstable loop, a mirror without inverse, a table that is none
            raise ReproduceError(f"{path}: the mission that it carries does not run: {error}") from error
        page = report.write(ran, folder / "again", on_progress=on_progress)
        now = json.loads(restored((page.parent / MANIFEST).read_text(encoding="utf-8"), moved, _in_json))
        text = restored(page.read_text(encoding="utf-8"), moved, lambda name: str(escape(name)))
        return _compared(manifest, Again(now, text, page.parent, converter_steps(ran)))


def restored(text: str, moved: Mapping[str, str], written: Callable[[str], str]) -> str:
    """The text with the names that the mission gives to its files in place of those that they were written under.

    Args:
        text: of a page or a manifest.
        moved: names that they were written under, by those that the mission gives.
        written: how a name stands in the text.
    """
    names = {written(own): written(name) for name, own in moved.items()}
    longest_first = "|".join(map(re.escape, sorted(names, key=len, reverse=True)))
    return re.sub(longest_first, lambda found: names[found[0]], text) if names else text


def _in_json(name: str) -> str:
    return json.dumps(name, ensure_ascii=False)[1:-1]


# ----------------------------------------------------------------------------------------------------------- comparing
@dataclass(frozen=True, slots=True)
class Again:
    """What the run gave now: its manifest, the text of its page, its folder, and the steps of its converters."""

    manifest: Mapping[str, Any]
    page: str
    folder: Path
    steps: ConverterSteps


def _compared(manifest: ReadManifest, again: Again) -> Reproduction:
    was, now = manifest.data, again.manifest
    machine = as_stated(was.get("machine"))
    then, today = {**was["versions"], **machine}, {**now["versions"], **now["machine"]}
    unlike = {
        clipped(name): (clipped(then.get(name, "none")), today.get(name, "none"))
        for name in dict.fromkeys([*then, *today])
        if then.get(name) != today.get(name)
    }
    files = _other_files(manifest, now)
    read = tuple(name for name in files if _comparable(manifest, again, name, bool(unlike)))
    found = comparison.compare(was["summary"], now["summary"], of_summary(again.steps) if unlike else None)
    for name in read:
        found += _of_tables(manifest, again, name, bool(unlike))
    return Reproduction(
        path=manifest.path,
        numbers=found.numbers,
        largest=found.largest,
        differences=found.differences,
        altered=altered_parts(manifest),
        unlike=unlike,
        undetailed=clipped(machine[ARCHITECTURE]) if list(machine) == [ARCHITECTURE] else "",
        files=tuple(clipped(name) for name in files),
        read=tuple(clipped(name) for name in read),
        layout=bool(manifest.page) and shown_part(manifest.page).splitlines() != shown_part(again.page).splitlines(),
        page=_lines(manifest.page, again.page) if manifest.page else (),
    )


def _other_files(manifest: ReadManifest, now: Mapping[str, Any]) -> list[str]:
    """Which figures' data are not byte for byte those of the report."""
    stated = manifest.data.get("files_sha256") or {}
    every = sorted({*stated, *now["files_sha256"]})
    data = [name for name in every if name.startswith("figures/") and name.endswith(".csv")]
    return [name for name in data if stated and stated.get(name) != now["files_sha256"].get(name)]


def _comparable(manifest: ReadManifest, again: Again, name: str, elsewhere: bool) -> bool:
    """Whether both have a figure's data at hand, in rows that belong together."""
    curve = tolerances.stated_for_figure(Path(name).stem) == "curve"
    return (again.folder / name).is_file() and content_beside(manifest, name) is not None and not (curve and elsewhere)


def of_summary(steps: ConverterSteps) -> comparison.Allowed:
    """What is allowed at a place of the summary; a number without a stated tolerance has to be the same."""
    known = tolerances.tolerances(steps)

    def allowed(place: str, unit: str, was: float, now: float) -> float:
        found = known[tolerances.stated(place) or "exact"]
        return found.allowed(was, now, tolerances.unit_of(place) or unit)

    return allowed


def _of_tables(manifest: ReadManifest, again: Again, name: str, elsewhere: bool) -> Comparison:
    """The numbers of a figure's data, which stand beside the report, held against those of now."""
    was = (content_beside(manifest, name) or b"").decode("utf-8", "replace")
    now = (again.folder / name).read_text(encoding="utf-8")
    if not elsewhere:  # to the last bit: a curve has no tolerance
        return comparison.compare_tables(name, was, now, None)
    found = tolerances.tolerances(again.steps)[tolerances.stated_for_figure(Path(name).stem) or "exact"]

    def allowed(place: str, unit: str, was: float, now: float) -> float:
        return found.allowed(was, now, unit) + comparison.DIGITS_SHARE * max(abs(was), abs(now))

    return comparison.compare_tables(name, was, now, allowed)


def _lines(was: str, now: str) -> tuple[str, ...]:
    """Lines of a page's text that this run's page does not have, and how many it lacks."""
    then, today = _text_lines(was), _text_lines(now)
    own = Counter(then.values()) - Counter(today.values())
    found = []
    for number, line in then.items():
        if own[line]:
            own[line] -= 1
            found.append(f"line {number}: {clipped(line)}")
    missing = (Counter(today.values()) - Counter(then.values())).total()
    return (*found, *([f"{missing} lines of this run's page are not in it"] if missing else []))


def _text_lines(page: str) -> dict[int, str]:
    """What a reader reads of a page, by the number of the line: no drawing, script or markup."""
    text = _DRAWN.sub(lambda drawn: "\n" * drawn[0].count("\n"), shown_part(page))
    lines = (" ".join(_TAG.sub(" ", line).split()) for line in text.splitlines())
    return {number: line for number, line in enumerate(lines, start=1) if line}


# --------------------------------------------------------------------------------------------------------------- words
def reproduction_text(found: Reproduction) -> str:
    """What differs, as text."""
    lines = [headline(found), basis(found), *found.altered]
    lines += [str(each) for each in found.differences[:MOST_SHOWN]]
    if len(found.differences) > MOST_SHOWN:
        lines.append(f"and {len(found.differences) - MOST_SHOWN} more (all of them with --json)")
    unread = [name for name in found.files if name not in found.read]
    if found.read:
        lines.append(f"data of figures, compared as numbers, not byte for byte the same: {', '.join(found.read)}")
    if unread:
        lines.append(
            f"data of figures, not byte for byte the same: {', '.join(unread)}; their numbers are not compared, since "
            "they do not stand beside the report, or have rows of their own on each machine"
        )
    if found.page:
        shown_lines = "; ".join(found.page[:3]) + (f"; and {len(found.page) - 3} more" if len(found.page) > 3 else "")
        lines.append(f"the page's text is not what this run writes: {shown_lines}")
    elif found.layout:
        lines.append("the page's layout or drawings are not what this run writes; its text is")
    return "\n".join(lines)


def headline(found: Reproduction) -> str:
    """The outcome in a sentence."""
    compared_ = f"{found.numbers} numbers compared, largest relative difference {found.largest:.2g}"
    if not found.same:
        count = len(found.differences)
        what = [f"{count} differ{'s' if count == 1 else ''}"] if count else []
        what += ["it was changed after it was written"] if found.altered else []
        return f"{found.path}: the report is not reproduced ({compared_}): {', and '.join(what)}."
    other = [
        *(["data of figures"] if set(found.files) - set(found.read) else []),
        *(["the page's text"] if found.page else ["the page's layout"] if found.layout else []),
    ]
    if other:
        return f"{found.path}: the numbers agree ({compared_}); other than this run's: {', '.join(other)}."
    apart = found.largest > 0.0 or found.files
    return f"{found.path}: {'the numbers agree' if apart else 'nothing differs'} ({compared_})."


def basis(found: Reproduction) -> str:
    """Whether quantities were compared to the last bit or to their tolerances, and why."""
    if found.to_the_last_bit:
        return "Same machine and versions: compared to the last bit."
    said = [f"{name} was {was} and is {now}" for name, (was, now) in found.unlike.items()]
    if found.undetailed:
        said = [text for text in said if " was none " not in text]
        said.append(f"of its machine the report says no more than {found.undetailed}, as version 0.1.0 wrote it")
    return f"Another machine or other versions: compared to stated tolerances ({'; '.join(said)})."


def reproduction_data(found: Reproduction) -> dict[str, Any]:
    """The outcome as plain data."""
    return {
        "report": str(found.path),
        "same": found.same,
        "compared": "to the last bit" if found.to_the_last_bit else "to stated tolerances",
        "because": basis(found),
        "numbers": found.numbers,
        "largest_relative_difference": found.largest if math.isfinite(found.largest) else None,
        "differences": [each.data() for each in found.differences],
        "altered": list(found.altered),
        "machine_and_versions": {name: {"was": was, "now": now} for name, (was, now) in found.unlike.items()},
        "figure_data": list(found.files),
        "figure_data_compared": list(found.read),
        "layout": found.layout,
        "page": list(found.page),
    }
