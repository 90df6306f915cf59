"""An identification as text for a terminal."""

import math
import shlex
from pathlib import Path
from typing import Any

from microrad.lab.identify import Identification, Score
from microrad.lab.identify.linear.fit import LinearFit
from microrad.lab.identify.records import rounded_to_error
from microrad.lab.identify.selection.predictions import Fit
from microrad.report.identification import words
from microrad.report.identification.parameters import (
    not_identified,
    parameter_rows,
    starts_text,
    two_digits,
)

_WIDTH = 42
_MOST_REASONS = 6  # one a line; of more only the names are printed


def identification_text(
    found: Identification, written: str, *, mirror_file: Path | None = None, report_file: Path | None = None
) -> str:
    """The identification as text to read; the files that were written, and what to do next, stand at its end.

    Parameters are those of the model written and of the paper's; the report and the plain data have all.
    """
    lines = [f"{'residual in % of the peak-to-peak':{_WIDTH}}{'fitted samples':>20}{'held-out samples':>20}"]
    lines += [" " * _WIDTH + 2 * f"{'rms':>10}{'peak':>10}"]
    lines += [_score_line(score, written) for score in (*found.scores, found.straight_line)]
    lines += ["", *words.verdict(found, written), "", found.reason, "", "recordings"]
    lines += [_source_line(source) for source in found.sources]
    lines += ["", *_linear_lines(found.linear)] if found.linear is not None else []
    for score, fit in zip(found.scores, found.fits, strict=True):
        if score.model in (written, "bouc_wen"):
            lines += ["", score.model, *_parameter_lines(fit)]
    lines += ["", " ".join(words.residual_sentences(found))]
    if found.refused:
        lines += ["", *(f"refused: {refused.model}, {refused.reason}" for refused in found.refused)]
    lines += ["", *(f"warning: {text}" for text in words.warnings(found, written))]
    return "\n".join([*lines, *_files(written, mirror_file, report_file)])


def _score_line(score: Score, written: str) -> str:
    mark = " (written)" if score.model == written else ""
    fitted = f"{score.fit_rms_percent:10.3f}{score.fit_peak_percent:10.2f}"
    return f"{score.model + mark:{_WIDTH}}{fitted}{score.held_out_rms_percent:10.3f}{score.held_out_peak_percent:10.2f}"


def _source_line(source: Any) -> str:
    return f"  {source.role:11}{source.fitted:9} fitted {source.held_out:9} held out  {words.one_line(source.path)}"


def _linear_lines(linear: LinearFit) -> list[str]:
    """The linear part: fit, order with its reason, poles and zeros, gains."""
    low, high = linear.excited_hz
    lines = [
        f"linear part, excited from {low:.4g} Hz to {high:.4g} Hz: order {linear.order}, fit "
        f"{linear.fit_percent[0]:.2f} %",
        f"  {linear.reason}",
    ]
    lines += [
        f"  {r.kind} {rounded_to_error(r.freq_hz, r.freq_error_hz):>10} ± {two_digits(r.freq_error_hz)} Hz  "
        f"damping {rounded_to_error(r.damping, r.damping_error)}"
        for r in words.roots(linear)
    ]
    return lines + [
        f"  gain at {name}: {rounded_to_error(1e3 * g, 1e3 * e)} ± {two_digits(1e3 * e)} mrad/V"
        for name, g, e in words.gains(linear)
    ]


def _parameter_lines(fit: Fit) -> list[str]:
    rows = [row for row in parameter_rows(fit) if row.value or not row.note]
    width = max(9, *(len(row.name) for row in rows))
    lines = []
    for row in rows:
        value, error, unit = row.shown
        given = f"± {two_digits(error)} {unit}".rstrip() if math.isfinite(error) else f"{unit} ({row.note})".strip()
        lines.append(f"  {row.name:{width}}{rounded_to_error(value, error):>12} {given}")
    unknown = not_identified(fit)
    if len(unknown) > _MOST_REASONS:
        lines.append(f"  not identified: {len(unknown)} of {len(rows)}, {', '.join(name for name, _ in unknown)}")
    else:
        lines += [f"  not identified: {name}, {why}" for name, why in unknown]
    return [*lines, f"  {starts_text(fit)}"]


def _files(written: str, mirror_file: Path | None, report_file: Path | None) -> list[str]:
    lines = [] if report_file is None else [f"{report_file} written: what was found, with pictures."]
    if mirror_file is not None:
        run_it = ["microrad", "run", "leo-geo.toml", "--mirror", str(mirror_file)]
        run_it += ["--output", f"{mirror_file.stem}-study"]
        lines.append(f"{mirror_file} written ({written}). Next: {shlex.join(run_it)}")
    return ["", *lines] if lines else []
