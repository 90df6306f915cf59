"""The report of an identification of several channels: one view for the page and for a terminal."""

import hashlib
import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from types import MappingProxyType

import numpy as np
from markupsafe import Markup

from microrad.core.folder import write_whole
from microrad.core.machine import versions
from microrad.lab.identify.coupled import Candidate, CoupledIdentification
from microrad.mirror.coupled import Actuator
from microrad.report.identification import coupled_words as words
from microrad.report.identification.coupled_figures import coupled_figures
from microrad.report.identification.figures import VIRTUAL
from microrad.report.identification.page import check_identification
from microrad.report.identification.terminal import MOST_LINES, warnings_text
from microrad.report.page.templates import page_of
from microrad.report.plotting.figure import Figure
from microrad.report.quantities import are, counted, quantity, signed
from microrad.report.tables import Cell, Table
from microrad.report.view import Block, Points, Soft, Verbatim, Verdict, View, told, views_text

_OF_THE_BENCH = "The recordings are those of the virtual bench: nothing here was measured on a mirror."
_MOST_ROWS = 4  # of a table of a terminal
_MOST_UNFOLDED = 12  # rows of a table of records
_MOST_FILE_LINES = 60  # of the mirror file that a page shows
_MOST_COLUMNS = 5  # of errors by amplitude or by output


def write_coupled_identification(
    found: CoupledIdentification,
    page: Path,
    *,
    mirror_file: Path,
    mirror_text: str,
    title: str,
    overwrite: bool = False,
    virtual: bool = False,
) -> Path:
    """Write the report of an identification of several channels as one HTML file that loads nothing; return its path.

    Args:
        found: what was identified.
        page: the file of the report; it appears whole or not at all.
        mirror_file: the mirror file that goes with it.
        mirror_text: its text.
        title: the heading of the page.
        overwrite: whether a report that is there may be replaced.
        virtual: whether the recordings come from the virtual bench: the page says so.

    Raises:
        ReportError: if ``page`` holds something that must not be replaced.
    """
    check_identification(page, overwrite)
    text = coupled_identification_page(
        found, mirror_file=mirror_file, mirror_text=mirror_text, title=title, virtual=virtual
    )
    check_identification(page, overwrite)  # it may have appeared meanwhile
    write_whole(page, text)
    return page


def coupled_identification_page(
    found: CoupledIdentification, *, mirror_file: Path, mirror_text: str, title: str, virtual: bool = False
) -> str:
    """The page's HTML; every text that is not ours is escaped, and nothing is loaded from anywhere.

    Args:
        found: what was identified.
        mirror_file: the mirror file that goes with it.
        mirror_text: its text.
        title: the heading of the page.
        virtual: whether the recordings come from the virtual bench: the page says so.
    """
    views = (*_views(found, coupled_figures(found)), _origin(found, mirror_file, mirror_text))
    model = found.candidate().model
    of = Markup("{} and {}, mirror file <code>{}</code>").format(
        counted(len(model.actuators), "actuator"), counted(len(model.outputs), "output"), mirror_file
    )
    return page_of(
        title,
        "identification",
        of,
        [_lead(found, _OF_THE_BENCH if virtual else "")],
        views,
        sha256=hashlib.sha256(mirror_text.encode()).hexdigest(),
        made_by="microrad identify",
        badge=VIRTUAL if virtual else "",
    )


def coupled_identification_text(
    found: CoupledIdentification,
    width: int = 80,
    *,
    mirror_file: Path | None = None,
    report_file: Path | None = None,
) -> str:
    """The identification in at most 23 lines for a terminal of 80 columns; the files stand at its end.

    Args:
        found: what was identified.
        width: columns of the terminal.
        mirror_file: the mirror file, if one was written.
        report_file: the report, if one was written.
    """
    files = [] if report_file is None else [f"{report_file} written: what was found, with pictures."]
    files += [] if mirror_file is None else [f"{mirror_file} written ({found.chosen})."]
    first = views_text([words.headline(found), words.worst_text(found)], width)
    tables = views_text([_amplitudes(found, short=True), _candidates(found, short=True)], width)
    last = "\n".join(line for each in files for line in wrap(each, width))
    room = MOST_LINES - sum(part.count("\n") + 2 for part in (first, tables, last) if part)
    parts = [first, tables, warnings_text(found.warnings, len(found.refused), width, room), last]
    return "\n\n".join(filter(None, parts))


# ----------------------------------------------------------------------------------------------------------- the view
def _lead(found: CoupledIdentification, own: str = "") -> Verdict:
    headline, *sentences = words.verdict(found)
    return Verdict(headline, told(" ".join(sentences), own), words.sound(found))


def _views(found: CoupledIdentification, figures: Mapping[str, Figure] = MappingProxyType({})) -> tuple[View, ...]:
    """What a page shows, in the order of its parts."""
    own = found.candidate()
    return (
        View("Warnings", [Points(found.warnings or ["No warnings."])]),
        _choice(found, figures),
        View("Error on held-out records", told(_amplitudes(found), Soft(_READING), _records(found))),
        View("Response", told(figures.get("response", _NO_RESPONSE))),
        _dependence(found, figures),
        View("Poles", told(_poles(own), Soft(words.pole_error_text(own.poles_error_rad_s)))),
        View("Error by output and band", told(figures.get("bands"), _bands(found))),
        View("Where it holds", told(_range(own), words.delay_text(own))),
        View("What the mirror file does not hold", [Points(words.not_held(found))]),
    )


_READING = (
    "Per cent are of the rms output, the mean over outputs in power. The best linear model is the measured response of "
    "that amplitude: what it leaves of the fitted records is distortion and noise, and no linear model leaves less. "
    "Noise is what changes from period to period."
)
_NO_RESPONSE = (
    "No amplitude has enough records for a response of its own: as many realisations with different drives as there "
    "are actuators, or broadband drives of one actuator at a time."
)
_STOPPED_BEFORE = "The ladder was stopped before gain and resonance were compared over the amplitude."
_NO_DEPENDENCE = (
    "Gain and resonance were not compared over the amplitude: that takes two amplitudes with a response each, and a "
    "resonance in the excited band."
)


def _choice(found: CoupledIdentification, figures: Mapping[str, Figure]) -> View:
    """Error over parameters, and all candidates with those that were refused."""
    refused = [f"{each.model}: {each.reason}" for each in found.refused]
    stopped = (
        "The ladder was stopped before its last model: what is chosen is the smallest within noise so far."
        if found.stopped
        else None
    )
    none = "" if refused else "No model was refused."
    which = "Models that were refused, with the reason:" if refused else none
    picture = figures.get("error-over-parameters")
    notes = Points([f"{c.name}: {c.note}" for c in found.candidates if c.note])
    return View("Which model", told(picture, stopped, _candidates(found), notes, which, Points(refused)))


def _candidates(found: CoupledIdentification, *, short: bool = False) -> Table:
    """The candidates by their error, the lowest first; a short table has the chosen one and the best of each kind."""
    ranked = sorted(found.candidates, key=lambda candidate: candidate.error_share)
    if short:
        best = {candidate.kind: candidate.name for candidate in reversed(ranked)}
        ranked = [candidate for candidate in ranked if candidate.name in (found.chosen, *best.values())]
    known = [k for k in range(found.amplitudes_v.size) if np.isfinite(found.output_rms[k]).all()]
    shown = [] if short or len(known) > _MOST_COLUMNS else known
    rows = []
    for candidate in ranked:
        shares = words.shares(candidate, found)
        cells = (words.part(float(shares[k]), candidate) for k in shown)
        name, count, error = candidate.name, str(candidate.parameters), words.part(candidate.error_share, candidate)
        rows.append((name, count, error, *cells, _standing(candidate, found)))
    at = [f"at {quantity(float(found.amplitudes_v[k]), 'V')} rms" for k in shown]
    headings = ("model", "parameters", "held-out error", *at, "")
    standing_out = [k for k, candidate in enumerate(ranked) if candidate.name == found.chosen]
    return Table("", headings, rows, (0, len(headings) - 1), best=standing_out, cards=True)


def _standing(candidate: Candidate, found: CoupledIdentification) -> str:
    if candidate.name == found.chosen:
        return "chosen"
    return "within noise" if candidate.name in found.within_noise else ""


def _amplitudes(found: CoupledIdentification, *, short: bool = False) -> Table:
    """The error of the chosen model at each amplitude, beside what no linear model can leave less of, and noise."""
    own, unit = found.candidate(), words.unit_of(found)
    error, output, noise = (words.over_outputs(v) for v in (own.error_rms, found.output_rms, found.noise_rms))
    floor = words.linear_floor(found)
    linear, shares = words.over_outputs(floor), words.shares(own, found)
    scale = words.scale(error, unit)
    rows = []
    for k in _few(found.amplitudes_v.size) if short else range(found.amplitudes_v.size):
        numbers = [scale.text(float(values[k])) for values in (output, error, linear, noise)]
        worst = "" if np.isnan(error[k]) else _worst_output(own, found, k)
        first = quantity(float(found.amplitudes_v[k]), "V")
        rows.append((first, numbers[0], numbers[1], words.part(float(shares[k])), *numbers[2:], worst))
    rms = [f"{name} ({scale.unit})" for name in ("output", "error", "best linear", "noise")]
    headings = ("drive, rms", *rms[:2], "of output", *rms[2:], "worst output")
    return Table("", headings, rows, (6,) if short else (0, 6), cards=True, brief=(0, 2, 3, 4, 6))


def _few(count: int) -> Sequence[int]:
    """Numbers of the rows that a terminal has room for: the first ones and the last."""
    return range(count) if count <= _MOST_ROWS else [*range(_MOST_ROWS - 1), count - 1]


def _worst_output(own: Candidate, found: CoupledIdentification, number: int) -> str:
    shares = own.error_rms[number] / found.output_rms[number]
    place = int(np.argmax(shares))
    return f"{own.model.outputs[place].name}, {words.part(float(shares[place]))}"


def _records(found: CoupledIdentification) -> Table:
    """The error of the chosen model on each held-out record, by output."""
    own = found.candidate()
    outputs = own.model.outputs[:_MOST_COLUMNS]
    rows: list[tuple[str | Cell, ...]] = []
    for name, share in zip(found.held_out, own.record_share, strict=True):
        total = words.part(float(words.over_outputs(share)))
        rows.append((Cell(name, code=True), total, *(words.part(float(s)) for s in share[: len(outputs)])))
    headings = ("held-out record", "error", *(output.name for output in outputs))
    folded = "" if len(rows) <= _MOST_UNFOLDED else f"All {len(rows)} held-out records"
    return Table("", headings, rows, (0,), folded=folded, cards=True)


def _dependence(found: CoupledIdentification, figures: Mapping[str, Figure]) -> View:
    of, title = found.dependence, "Dependence on the amplitude"
    if of is None:
        return View(title, [_STOPPED_BEFORE if found.stopped else _NO_DEPENDENCE])
    unit = words.unit_of(found)
    gain = words.scale(of.gain, unit)
    rows = []
    for k in range(of.gain.size):
        freq, error = words.with_error(float(of.resonance_hz[k]), float(of.resonance_error_hz[k]))
        drive = quantity(float(of.drive_rms[k]), "V")
        rows.append((drive, gain.text(float(of.gain[k]), 4), freq, error, f"{of.damping_ratio[k]:.3g}"))
    headings = ("drive, rms", f"gain ({gain.unit}/V)", "main resonance (Hz)", "± (Hz)", "damping ratio")
    change = (
        f"From the smallest to the largest amplitude the gain changes by {signed(of.gain_rise_percent, '%', 2)} and "
        f"the main resonance by {signed(of.resonance_shift_hz, 'Hz')}."
    )
    return View(title, told(change, figures.get("amplitude"), Table("", headings, rows)))


def _poles(own: Candidate) -> Table:
    inside, outside = (Cell("", "yes"), ""), (Cell("", "no"), "extrapolated")
    rows: list[tuple[str | Cell, ...]] = [
        (
            "real pole" if pole.real else "pair",
            *pole.texts,
            *(inside if pole.excited else outside),
        )
        for pole in words.poles(own)
    ]
    headings = ("pole at rest", "frequency (Hz)", "± (Hz)", "damping ratio (1)", "± (1)", "excited", "")
    return Table("", headings, rows, (0, 5, 6))


def _bands(found: CoupledIdentification) -> Table | None:
    """The error of the chosen model in each band with its limits, rows for each amplitude and output."""
    own, edges = found.candidate(), found.bands_hz
    levels = (own.band_error_rms, *words.band_floors(found))
    scale = words.scale(own.band_error_rms, words.unit_of(found))
    rows = []
    for k in range(found.amplitudes_v.size):
        if not np.isfinite(own.error_rms[k]).all():
            continue
        for o, output in enumerate(own.model.outputs):
            name = f"{quantity(float(found.amplitudes_v[k]), 'V')}, {output.name}"
            for what, values in zip(("error", "best linear", "noise"), levels, strict=True):
                if np.isfinite(values[k, :, o]).any():
                    rows.append((name, what, *(scale.text(float(value)) for value in values[k, :, o])))
    ends = [words.Scale("Hz", 1.0).text(float(edge)) for edge in edges]
    headings = [f"{low} to {high} Hz" for low, high in itertools.pairwise(ends)]
    folded = f"The same as numbers: rms in each band ({scale.unit})"
    return Table("", ("drive, output", "rms of", *headings), rows, (0, 1), folded=folded) if rows else None


def _range(own: Candidate) -> Table:
    rows: list[tuple[str | Cell, ...]] = [
        (
            Cell(a.name, code=True),
            *(quantity(v, "V", 4) for v in (_bias(a), a.drive_min_v, a.drive_max_v)),
            quantity(a.rate_limit_v_s, "V/s", 4),
        )
        for a in own.model.actuators
    ]
    return Table("", ("actuator", "bias", "lowest drive", "highest drive", "fastest rate"), rows)


def _bias(actuator: Actuator) -> float:
    """The bias (V) to a thousandth of the range: what a mean leaves of none is none."""
    span = actuator.drive_max_v - actuator.drive_min_v
    return round(actuator.bias_v, 3 - math.floor(math.log10(span))) + 0.0 if span > 0.0 else actuator.bias_v


def _origin(found: CoupledIdentification, mirror_file: Path, mirror_text: str) -> View:
    """What was fitted, the beginning of the mirror file, and what made them."""
    sha256 = hashlib.sha256(mirror_text.encode()).hexdigest()
    lines = mirror_text.splitlines()
    more = len(lines) - _MOST_FILE_LINES
    begins = "\n".join(line if len(line) <= 160 else f"{line[:150]} …" for line in lines[:_MOST_FILE_LINES])
    left = f"{counted(more, 'more line')} {are(more)} in the file; long ones are cut here." if more > 0 else None
    made = ", ".join(f"{name} {version}" for name, version in versions().items())
    fitted = [(Cell(name, code=True),) for name in found.fitted]
    file = View(f"Mirror file {mirror_file.name}", told(Verbatim(begins), left), folded=True, listed=False)
    blocks: list[Block] = [
        Table("", ("fitted record",), fitted, (0,), folded=f"All {len(fitted)} fitted records"),
        file,
        Soft(f"Mirror file SHA-256 {sha256}. Every number above is computed from these recordings."),
        Soft(f"Made with {made}."),
    ]
    return View("Mirror file and origin", blocks)
