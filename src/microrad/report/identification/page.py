"""The report of an identification as one self-contained page, written whole or not at all."""

import hashlib
import math
import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from markupsafe import Markup

from microrad.core.folder import path_argument, write_whole
from microrad.core.machine import versions
from microrad.core.units import format_quantity
from microrad.lab.identify import Identification
from microrad.lab.identify.linear.axis import NOT_SHOWN
from microrad.lab.identify.linear.fit import LinearFit
from microrad.lab.identify.linear.pole_zero import UNSEEN
from microrad.lab.identify.selection.predictions import Fit
from microrad.lab.recording import Recording
from microrad.report.identification import parameters, words
from microrad.report.identification.figures import identification_figures
from microrad.report.identification.terminal import MOST_LINES, warnings_text
from microrad.report.page.templates import page_of
from microrad.report.plotting.figure import Figure
from microrad.report.quantities import plain
from microrad.report.tables import Cell, Table
from microrad.report.view import Points, Soft, Verbatim, Verdict, View, told, views_text

_MOST_POLES = 7  # of a terminal, with their dampings

BEGINS = '<!DOCTYPE html>\n<html lang="en" data-made-by="microrad identify">'


class ReportError(ValueError):
    """The report's file cannot be written; the message says why and what to do."""


def check_identification(target: Path, overwrite: bool) -> None:
    """Raises ReportError if ``target`` must not be written: no folder for it, or a file that must not be replaced.

    Args:
        target: the file of the report.
        overwrite: whether a report that is there may be replaced.
    """
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
    """The page's HTML; every text that is not ours is escaped, and nothing is loaded from anywhere.

    Args:
        found: what was identified.
        mirror_file: the mirror file that goes with it.
        mirror_text: its text.
        title: the heading of the page.
        written: the model in the mirror file.
        recordings: those that `identify` was given to fit: it keeps no broadband ones.
        virtual: whether they come from the virtual bench: the page and each figure say so.
    """
    figures = identification_figures(found, recordings, virtual=virtual)
    own = "The recordings are those of the virtual bench: nothing here was measured on a mirror." if virtual else ""
    views = (*_views(found, written, recordings, figures), _origin(found, mirror_file, mirror_text, written))
    count = len(found.sources)
    of = Markup("{} recording{}, mirror file <code>{}</code>").format(count, "s" * (count > 1), mirror_file)
    return page_of(
        title,
        "identification",
        of,
        [_lead(found, written, own)],
        views,
        sha256=hashlib.sha256(mirror_text.encode()).hexdigest(),
        made_by="microrad identify",
        badge="virtual bench" if virtual else "",
    )


def identification_text(
    found: Identification,
    written: str,
    width: int = 80,
    *,
    mirror_file: Path | None = None,
    report_file: Path | None = None,
) -> str:
    """The identification in at most 23 lines of a terminal; what was written, and what to do next, stand at its end.

    Args:
        found: what was identified.
        written: the model in the mirror file, of which it has the poles; the report and the plain data have all.
        width: columns of the terminal.
        mirror_file: the mirror file, if one was written.
        report_file: the report, if one was written.
    """
    files = [] if report_file is None else [f"{report_file} written: what was found, with pictures."]
    if mirror_file is not None:
        run_it = ["microrad", "run", "leo-geo.toml", "--mirror", path_argument(mirror_file)]
        run_it += ["--output", f"{mirror_file.stem}-study"]
        files += [f"{mirror_file} written ({written}).", f"Next: {shlex.join(run_it)}"]
    last = "\n".join(files)
    first = views_text([" ".join(words.brief_verdict(found, written)), *_poles(found, written)], width)
    room = MOST_LINES - sum(1 + part.count("\n") + 1 for part in (first, last) if part)
    told_of = warnings_text(words.pressing(found, written), len(found.refused), width, room)
    return "\n\n".join(filter(None, [first, told_of, last]))


def _poles(found: Identification, written: str) -> list[Table]:
    """The poles of the model that is written, with the delay, as the report has them among its parameters."""
    whole = _model(found.fit(written))
    rows = [row for row in whole.rows if str(row[0]).startswith(("pole", "delay"))][:_MOST_POLES]
    return [replace(whole, rows=rows).columns(range(4))] if rows else []


def _lead(found: Identification, written: str, own: str = "") -> Verdict:
    headline, *sentences = words.verdict(found, written)
    return Verdict(headline, told(" ".join(sentences), own), words.sound(found))


def _views(
    found: Identification,
    written: str,
    recordings: Sequence[Recording] = (),
    figures: Mapping[str, Figure] = MappingProxyType({}),
) -> tuple[View, ...]:
    """What a page shows."""
    everything = [*found.recordings, *words.shown_recordings(found, recordings)]
    no_time = "No broadband recording was used: there is no linear model to compare." if figures else None
    return (
        _warnings(found, written),
        _recordings(found, everything, figures),
        _linear(found, figures),
        View("Loops", told(figures.get("loops"), f"Error of {found.chosen} on each recording:", _errors(found))),
        View("Time response", told(figures.get("time", no_time))),
        View(
            "Residuals",
            told(figures.get("residuals"), " ".join(words.residual_sentences(found)), figures.get("tests")),
        ),
        _parameters(found, written),
        _ranking(found),
    )


def _warnings(found: Identification, written: str) -> View:
    refused = [f"{r.model}: {r.reason}" for r in found.refused]
    cannot = "Models that these recordings cannot support:" if refused else ""
    said = words.warnings(found, written) or ["No warnings."]
    return View("Warnings and refusals", told(Points(said), cannot, Points(refused)))


def _recordings(found: Identification, everything: Sequence[Recording], figures: Mapping[str, Figure]) -> View:
    """A row for each source; what only the recording knows is left out where it was not given."""
    known = {(r.path, r.sha256): r for r in everything}
    rows = []
    for source in found.sources:
        recording = known.get((source.path, source.sha256))
        drive = rate = duration = ""
        if recording is not None:
            drive = words.drive_text(recording, found.units.volts)
            rate = format_quantity(recording.rate_hz, "Hz")
            duration = format_quantity(recording.samples * recording.step_s, "s")
        name = Cell(Path(source.path).name, code=True)
        rows.append((name, source.role, drive, rate, str(source.fitted), str(source.held_out), duration))
    headings = ("file", "serves as", "drive", "sample rate", "fitted", "held out", "duration")
    noticed = [
        f"{Path(r.path).name}, {f.kind}{' (accepted)' * f.refused}: {f.message}" for r in everything for f in r.findings
    ]
    checks = (
        "What the checks of the recordings noticed:" if noticed else "The checks of the recordings noticed nothing."
    )
    table = Table("", headings, rows, (0, 1, 2), brief=(0, 1, 4, 5))
    return View("Recordings", told(table, checks, Points(noticed), figures.get("excitation")))


def _linear(found: Identification, figures: Mapping[str, Figure]) -> View:
    linear = found.linear
    if linear is None:
        return View("Linear part", [words.no_linear(found)])
    order = View("Order", told(f"{linear.reason[0].upper()}{linear.reason[1:]}.", _scan(linear)))
    roots = View("Poles, zeros and gains", told(figures.get("poles"), _roots(linear)))
    return View("Linear part", told(figures.get("response"), order, roots))


def _scan(linear: LinearFit) -> Table | None:
    """Each order that was tried, with its criterion."""
    rows = [
        (
            str(s.order),
            str(s.parameters),
            plain(s.chi_square / max(s.freedom, 1), 4),
            plain(s.criterion, 5) if s.criterion < UNSEEN else "",
            f"{plain(s.output_error_rms * 1e6, 4)} µrad",
            "chosen" if s.order == linear.order else "" if s.criterion < UNSEEN else NOT_SHOWN,
        )
        for s in linear.scan
    ]
    headings = ("order", "parameters", "chi-square per degree of freedom", "criterion", "output error (rms)", "")
    return Table("", headings, rows, (5,), brief=(0, 1, 3, 5)) if rows else None


def _roots(linear: LinearFit) -> Table:
    outside, inside = (Cell("", "no"), "extrapolated"), (Cell("", "yes"), "")
    rows: list[tuple[str | Cell, ...]] = [
        (
            f"{r.kind}{', real' if abs(r.damping) == 1.0 else ' pair'}",
            f"{parameters.to_error(r.freq_hz, r.freq_error_hz)} Hz",
            f"{parameters.two_digits(r.freq_error_hz)} Hz",
            parameters.to_error(r.damping, r.damping_error),
            parameters.two_digits(r.damping_error) if r.damping_error else "",
            *(inside if r.excited else outside),
        )
        for r in words.roots(linear)
    ]
    for place, (name, gain, error) in enumerate(words.gains(linear)):
        known = parameters.to_error(gain * 1e3, error * 1e3), parameters.two_digits(error * 1e3)
        rows.append((f"gain at {name}", *(f"{text} mrad/V" for text in known), "", "", *(inside if place else outside)))
    return Table(
        "", ("", "natural frequency", "±", "damping ratio", "±", "excited", ""), rows, (0, 5, 6), brief=(0, 1, 2, 3, 5)
    )


def _errors(found: Identification) -> Table:
    """The choice's error on each recording by itself."""
    rows = []
    for recording, prediction in zip(found.recordings, words.chosen_predictions(found), strict=True):
        fitted, unseen = words.split_errors(prediction)
        share = "" if math.isnan(unseen) else f"{plain(100 * unseen / found.span_rad)} %"
        name, drive = Cell(Path(recording.path).name, code=True), words.drive_text(recording, found.units.volts)
        rows.append((name, drive, _angle(fitted), _angle(unseen), share, str(prediction.clamped)))
    headings = ("file", "drive", "fitted, rms", "unseen, rms", "unseen, rms", "rate-clamped")
    return Table("", headings, rows, (0, 1), brief=(0, 2, 3, 4))


def _angle(value_rad: float) -> str:
    return "" if math.isnan(value_rad) else f"{plain(1e6 * value_rad)} µrad"


def _parameters(found: Identification, written: str) -> View:
    """The parameters of each model; those of the choice and of the mirror file stand open."""
    views = []
    for score, fit in zip(found.scores, found.fits, strict=True):
        choice, held = ", the choice" * (score.model == found.chosen), ", in the mirror file" * (score.model == written)
        notes = Soft(" ".join(parameters.notes(fit)))
        views.append(View(f"{score.model}{choice}{held}", (_model(fit), notes), folded=not (choice or held)))
    return View("Parameters", views)


def _model(fit: Fit) -> Table:
    unknown = dict(parameters.not_identified(fit))
    rows = []
    for row in parameters.parameter_rows(fit):
        value, error, unit = row.shown
        note = row.note or (f"not identified: {unknown[row.name]}" if row.name in unknown else "")
        rows.append((row.name, parameters.to_error(value, error), parameters.two_digits(error), unit, note))
    return Table("", ("parameter", "value", "± standard error", "unit", "note"), rows, (0, 3, 4))


def _ranking(found: Identification) -> View:
    """All models and the straight line by their error on unseen samples, the lowest first."""
    fits = dict(zip((s.model for s in found.scores), found.fits, strict=True))
    scores = sorted((*found.scores, found.straight_line), key=lambda s: s.held_out_rms_percent)
    rows = [
        (
            f"{s.model}{' (chosen)' * (s.model == found.chosen)}",
            f"{s.fit_rms_percent:.3f}",
            f"{s.fit_peak_percent:.2f}",
            f"{s.held_out_rms_percent:.3f}",
            f"{s.held_out_peak_percent:.2f}",
            _angle(s.held_out_rms_percent * found.span_rad / 100),
            Cell("", "yes" if parameters.admissible(fits[s.model]) else "no") if s.model in fits else "",
        )
        for s in scores
    ]
    first = f"residual in % of the peak-to-peak output, {format_quantity(found.span_rad, 'rad', 4)}"
    headings = ("fitted, rms", "fitted, peak", "unseen, rms", "unseen, peak", "unseen, rms", "admissible")
    best = [k for k, s in enumerate(scores) if s.model == found.chosen]
    table = Table("", (first, *headings), rows, (0, 6), best=best, brief=range(5))
    return View("All models", (found.reason, table))


def _origin(found: Identification, mirror_file: Path, mirror_text: str, written: str) -> View:
    sha256 = hashlib.sha256(mirror_text.encode()).hexdigest()
    rows = [(Cell(s.path, code=True), Cell(s.sha256, code=True)) for s in found.sources]
    made = ", ".join(f"{name} {version}" for name, version in versions().items())
    return View(
        "Mirror file and origin",
        (
            f"{mirror_file} holds {written}:",
            Verbatim(mirror_text),
            Table("", ("recording", "SHA-256"), rows, (0, 1)),
            Soft(
                f"Mirror file SHA-256 {sha256}. Every number above is computed from these recordings. Standard errors "
                "come from the residuals of the fitted samples."
            ),
            Soft(f"Made with {made}."),
        ),
    )
