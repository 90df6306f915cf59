"""The report of an identification as one self-contained page, written whole or not at all."""

import hashlib
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from microrad.core.folder import write_whole
from microrad.core.machine import versions
from microrad.core.units import format_quantity
from microrad.lab.identify import Identification
from microrad.lab.identify.selection.predictions import Fit
from microrad.lab.identify.statistics import rounded_to_error
from microrad.lab.recording import Finding, Recording
from microrad.report.identification import parameters, words
from microrad.report.identification.figures import identification_figures
from microrad.report.page.templates import render

BEGINS = '<!DOCTYPE html>\n<html lang="en" data-made-by="microrad identify">'


class ReportError(ValueError):
    """The report's file cannot be written; the message says why and what to do."""


def check_identification(target: Path, overwrite: bool) -> None:
    """Raises ReportError if ``target`` must not be written: no folder for it, or a file that must not be replaced."""
    if not target.parent.is_dir():
        raise ReportError(f"{target}: there is no folder {target.parent}; create it first.")
    if not os.path.lexists(target):
        return
    if not _ours(target):
        raise ReportError(
            f"{target} is not a report that microrad identify wrote and is left as it is; name another file."
        )
    if not overwrite:
        raise ReportError(f"{target} exists and is left as it is; name another file, or replace it with --overwrite.")


def _ours(target: Path) -> bool:
    if not target.is_file():
        return False
    with target.open("rb") as file:
        return file.read(len(BEGINS)) == BEGINS.encode()


def write_identification(  # noqa: PLR0913  all but the first two are named options
    found: Identification,
    target: Path,
    *,
    mirror_file: Path,
    mirror_text: str,
    title: str,
    written: str | None = None,
    recordings: Sequence[Recording] = (),
    overwrite: bool = False,
    virtual: bool = False,
) -> Path:
    """Write the report of an identification as one HTML file that loads nothing, and return its path.

    Args:
        found: what was identified.
        target: the file of the report; it appears whole or not at all.
        mirror_file: the mirror file that goes with it.
        mirror_text: its text.
        title: the heading of the page.
        written: the model in the mirror file; the chosen one unless it is given.
        recordings: those that `identify` was given to fit: ``found`` does not keep the broadband ones, and without them
            their excitation and time response are not drawn.
        overwrite: whether a report that is there may be replaced.
        virtual: whether they come from the virtual bench: the page and each figure say so.

    Raises ReportError if ``target`` holds something that must not be replaced.
    """
    check_identification(target, overwrite)
    text = identification_page(
        found,
        mirror_file=mirror_file,
        mirror_text=mirror_text,
        title=title,
        written=written or found.chosen,
        recordings=recordings,
        virtual=virtual,
    )
    check_identification(target, overwrite)  # it may have appeared meanwhile
    write_whole(target, text)
    return target


def identification_page(
    found: Identification,
    *,
    mirror_file: Path,
    mirror_text: str,
    title: str,
    written: str,
    recordings: Sequence[Recording] = (),
    virtual: bool = False,
) -> str:
    """The page's HTML; every text that is not ours is escaped, and nothing is loaded from anywhere."""

    everything = [*found.recordings, *words.shown_recordings(found, recordings)]
    context: dict[str, Any] = {
        "begins": BEGINS,
        "found": found,
        "title": title,
        "virtual": virtual,
        "written": written,
        "mirror_file": mirror_file,
        "mirror_text": mirror_text,
        "mirror_sha256": hashlib.sha256(mirror_text.encode()).hexdigest(),
        "verdict": words.verdict(found, written),
        "sound": words.sound(found),
        "warnings": words.warnings(found, written),
        "recordings": _recordings(found, everything),
        "findings": _findings(everything),
        "no_linear": words.no_linear(found),
        "roots": [] if found.linear is None else words.roots(found.linear),
        "gains": words.gains(found.linear),
        "errors": _errors(found),
        "residual": words.residual_sentences(found),
        "models": [_model(s.model, fit) for s, fit in zip(found.scores, found.fits, strict=True)],
        "ranking": _ranking(found),
        "span": format_quantity(found.span_rad, "rad", 4),
        "two_digits": parameters.two_digits,
        "rounded_to_error": rounded_to_error,
        "figures": identification_figures(found, recordings, virtual=virtual),
        "versions": versions(),
    }
    return render("identification/identification.html", context)


def _recordings(found: Identification, everything: Sequence[Recording]) -> list[dict[str, Any]]:
    """A row for each source; what only the recording knows is left out where it was not given."""
    known = {(r.path, r.sha256): r for r in everything}
    rows = []
    for source in found.sources:
        recording = known.get((source.path, source.sha256))
        row = {"name": Path(source.path).name, "role": source.role, "fitted": source.fitted}
        row |= {"held_out": source.held_out, "drive": "", "rate": "", "duration": ""}
        if recording is not None:
            row["drive"] = words.drive_text(recording, found.units.volts)
            row["rate"] = format_quantity(recording.rate_hz, "Hz")
            row["duration"] = format_quantity(recording.samples * recording.step_s, "s")
        rows.append(row)
    return rows


def _findings(everything: Sequence[Recording]) -> list[tuple[str, Finding]]:
    return [(Path(r.path).name, finding) for r in everything for finding in r.findings]


def _errors(found: Identification) -> list[dict[str, Any]]:
    """The choice's error on each recording by itself."""
    rows = []
    for recording, prediction in zip(found.recordings, words.chosen_predictions(found), strict=True):
        fitted, unseen = words.split_errors(prediction)
        rows.append(
            {
                "name": Path(recording.path).name,
                "drive": words.drive_text(recording, found.units.volts),
                "fitted": _angle(fitted),
                "unseen": _angle(unseen),
                "percent": "" if math.isnan(unseen) else f"{100 * unseen / found.span_rad:.3g} %",
                "clamped": prediction.clamped,
            }
        )
    return rows


def _angle(value_rad: float) -> str:
    return "" if math.isnan(value_rad) else f"{1e6 * value_rad:.3g} µrad"


def _model(name: str, fit: Fit) -> dict[str, Any]:
    unknown = dict(parameters.not_identified(fit))
    rows = []
    for row in parameters.parameter_rows(fit):
        value, error, unit = row.shown
        note = row.note or (f"not identified: {unknown[row.name]}" if row.name in unknown else "")
        shown = {"value": rounded_to_error(value, error), "error": parameters.two_digits(error)}
        rows.append({"name": row.name, **shown, "unit": unit, "note": note})
    return {"name": name, "rows": rows, "notes": parameters.notes(fit)}


def _ranking(found: Identification) -> list[dict[str, Any]]:
    """All models and the straight line by their error on unseen samples, the lowest first."""
    marks = {
        s.model: "yes" if parameters.admissible(f) else "no" for s, f in zip(found.scores, found.fits, strict=True)
    }
    rows = [
        {
            "model": score.model,
            "score": score,
            "rms": _angle(score.held_out_rms_percent * found.span_rad / 100),
            "admissible": marks.get(score.model, ""),
        }
        for score in (*found.scores, found.straight_line)
    ]
    return sorted(rows, key=lambda row: row["score"].held_out_rms_percent)
