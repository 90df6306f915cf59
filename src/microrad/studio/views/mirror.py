"""What the mirror page shows of a recording and of an identification: loops and scores as plots and rows."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from microrad.core.units import format_quantity
from microrad.lab.live_fit import LIVE_FITS, LiveFit
from microrad.report.plotting.palette import BLACK, BLUE, GREY, SKY, VERMILION
from microrad.report.plotting.sheet import Axis, Line, Span, grid
from microrad.report.quantities import counted
from microrad.report.view import Block, Points, told
from microrad.studio.guard import plain_files
from microrad.studio.jobs.queue import Job
from microrad.studio.recordings.reading import View
from microrad.studio.views.mirror_form import Setting, written
from microrad.studio.views.plots import WIDTH, Plot, empty, figure, plot

_MOST_BYTES = 20_000_000  # of the fits of a job


# ------------------------------------------------------------------------------------------------ what a job has fitted
def read_fits(folder: Path) -> tuple[LiveFit, ...]:
    """The models of a job so far, in the order in which they were fitted; a line that is being written is left out."""
    try:
        with plain_files.opened(folder / LIVE_FITS) as file:
            lines = file.read(_MOST_BYTES).splitlines()
    except OSError:
        return ()
    found, kind = [], TypeAdapter(LiveFit)
    for line in lines:
        with suppress(ValueError):
            found.append(kind.validate_json(line))
    return tuple(found)


def leader(fits: tuple[LiveFit, ...], chosen: str = "") -> LiveFit | None:
    """The model that was chosen in the end, as it was fitted last; until then the best so far. None without one.

    Of models that differ by chance alone the end prefers what never moves the wrong way: it need not choose the best.

    Args:
        fits: the models so far.
        chosen: name of the model that was chosen, "" before the end.
    """
    ended = [fit for fit in fits if fit.model == chosen]
    return ended[-1] if ended else best(fits)


def best(fits: tuple[LiveFit, ...]) -> LiveFit | None:
    """The model with the least residual on the held-out samples, of two that are alike the later; None without one."""
    return min(reversed(fits), key=lambda fit: fit.held_out_rms_percent, default=None)


# ----------------------------------------------------------------------------------------------------------- the plots
def recording_plot(view: View, setting: Setting) -> Plot:
    """The measured loop: output over drive, each sample that is shown a point.

    Args:
        view: the recording.
        setting: the form, for the units.
    """
    points = Line(np.array(view.drive[0]), np.array(view.output[0]), BLUE, "", marker=".", size=5.0, label="measured")
    return plot(Axis(_drive_title(setting)), Axis(_output_title(setting)), points)


def time_plot(view: View, setting: Setting) -> Plot:
    """Drive and output over time, one above the other.

    Args:
        view: the recording.
        setting: the form, for the units.
    """
    sheet, (above, below) = grid(WIDTH, 3.6, 2, share_x=True)
    time_s = np.array(view.rows) / view.rate_hz
    above.add(Line(time_s, np.array(view.drive[0]), BLACK, name="drive", whole=True))
    below.add(Line(time_s, np.array(view.output[0]), BLUE, name="output", whole=True))
    above.y.title, below.y.title, below.x.title = _drive_title(setting), _output_title(setting), "time (s)"
    return figure(sheet)


def _drive_title(setting: Setting) -> str:
    return f"drive ({setting.drive_unit})"


def _output_title(setting: Setting) -> str:
    return f"output ({written(setting.output_unit)})"


def loop_plot(fit: LiveFit, number: int, drive_unit: str) -> Plot:
    """The last periods of a recording: what was measured, and what the model makes of the same drive.

    Args:
        fit: the model.
        number: which of its recordings, counted from 0.
        drive_unit: that of the drive.
    """
    loop = fit.loops[number]
    drive = np.array(loop.drive)
    measured = Line(drive, 1e6 * np.array(loop.measured_rad), GREY, "-", 3.0, "measured")
    model = Line(drive, 1e6 * np.array(loop.model_rad), VERMILION, "--", label=fit.model)
    return plot(Axis(f"drive ({drive_unit})"), Axis("angle (µrad)"), measured, model)


def residual_plot(fit: LiveFit, number: int) -> Plot:
    """What the model leaves of a recording over time, with the part that no fit has seen shaded.

    Args:
        fit: the model.
        number: which of its recordings, counted from 0.
    """
    loop = fit.loops[number]
    residual = Line(np.array(loop.time_s), 1e6 * np.array(loop.residual_rad), BLUE, label="measured less model")
    unseen = Span(loop.split_s, loop.time_s[-1], True, SKY, 0.2, "seen by no fit")
    return plot(Axis("time (s)"), Axis("residual (µrad)"), unseen, residual)


def nothing() -> Plot:
    """The plot before there is anything to show."""
    return empty("Drop a recording to see it here.")


# ---------------------------------------------------------------------------------------------------------- the scores
def score_rows(fits: Sequence[LiveFit], chosen: str = "") -> list[tuple[str, ...]]:
    """Model, rms held out and fitted, and a note that marks the one that leads or was chosen; the best comes first.

    Args:
        fits: the models so far.
        chosen: name of the model that was chosen, "" before the end.
    """
    first, mark = leader(tuple(fits), chosen), "chosen" if chosen else "best so far"
    return [
        (fit.model, f"{fit.held_out_rms_percent:.3g} %", f"{fit.fit_rms_percent:.3g} %", mark if fit is first else "")
        for fit in sorted(fits, key=lambda fit: fit.held_out_rms_percent)
    ]


def outcome(said: str) -> tuple[str, tuple[Block, ...]] | None:
    """The model that an identification has chosen and what it says of it, from what its job has printed; else None."""
    try:
        data = json.loads(said)
        warnings = [f"Warning: {each}" for each in map(str, data["warnings"])]
        refused = [f"Not fitted: {model}: {why}" for model, why in data["refused"].items()]
        return str(data["model"]), told(*map(str, data["verdict"]), Points(warnings), Points(refused))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def doing(what: str) -> str:
    """The phase of an identification in words."""
    phases = {"play operators": "fitting prandtl_ishlinskii", "Bouc-Wen starts": "fitting bouc_wen, start by start"}
    return phases.get(what, what)


def about(view: View) -> str:
    """The recording in a sentence."""
    rate = format_quantity(view.rate_hz, "Hz")
    return f"{counted(view.samples, 'sample')} at {rate}, {format_quantity(view.samples / view.rate_hz, 's')}."


def findings(view: View) -> list[str]:
    """What the checks of a recording have found, a sentence each."""
    begun = (each[:1].upper() if each[:1].isascii() else each[:1] for each in view.findings)  # a unit is no word
    return [f"{first}{each[1:].rstrip('.')}." for first, each in zip(begun, view.findings, strict=True)]


def state_words(job: Job, first: LiveFit | None) -> str:
    """An identification in a sentence: how far it is, which model leads, or how it ended.

    Args:
        job: the identification.
        first: the model that leads, None without one.
    """
    told = {
        "queued": "Waiting for another job to end.",
        "running": "Begins.",
        "done": "Done.",
        "cancelled": "Cancelled; nothing was written.",
    }
    words = told.get(job.state, f"{job.state}: {job.words}")
    if job.state == "running" and job.progress is not None:
        words = f"{job.progress.done} of {job.progress.total} fits: {doing(job.progress.what)}."
    if job.state == "running" and job.cancelling:
        words = f"{words[:-1]}, stopping."
    if first is None:
        return words
    lead = "Chosen" if job.state == "done" else "Best so far"
    return f"{words} {lead}: {first.model}, {first.held_out_rms_percent:.3g} % rms on samples that no fit has seen."


def argument(job: Job, flag: str, otherwise: str) -> str:
    """The value of an option of a job's command.

    Args:
        job: the job.
        flag: name of the option.
        otherwise: what is returned without it.
    """
    said = dict(pairwise(job.arguments))
    return said.get(flag, otherwise)
