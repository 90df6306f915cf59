"""The models of an identification as they are fitted, written to a file that the studio shows meanwhile.

The file has one line of JSON for each model: its score, and its curve beside the measured one, thinned.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats

if TYPE_CHECKING:
    from microrad.lab.identify.selection.predictions import Prediction, ScoredModel
    from microrad.lab.recording import Recording

LIVE_FITS = "fits"
"""Name of the file, beside that of the progress."""

_LOOPS = 6  # recordings that are kept; a bench writes a dozen


@dataclass(frozen=True, slots=True)
class Loop:
    """A recording beside the model: the last periods of the drive, and the residual behind the initial transient.

    `drive` is in the unit of the recording, angles are in rad, times in s. The fit has seen what lies before `split_s`.
    """

    name: str
    drive: tuple[float, ...]
    measured_rad: tuple[float, ...]
    model_rad: tuple[float, ...]
    time_s: tuple[float, ...]
    residual_rad: tuple[float, ...]
    split_s: float


@dataclass(frozen=True, slots=True)
class LiveFit:
    """A fitted model: its residual in per cent of the peak-to-peak output (rms), fitted and held out, and its loops."""

    model: str
    fit_rms_percent: float
    held_out_rms_percent: float
    loops: tuple[Loop, ...]


def live_fit_writer(progress: str | None) -> Callable[[ScoredModel], None]:
    """A function that writes each fitted model to a file beside that of the progress, or does nothing without one.

    A disk that is full does not end the identification.
    """
    if not progress:
        return lambda judged: None
    path = Path(progress).with_name(LIVE_FITS)

    def write(judged: ScoredModel) -> None:
        line = json.dumps(asdict(thin_fit(judged)), allow_nan=False)
        with suppress(OSError), path.open("a", encoding="ascii") as file:
            file.write(f"{line}\n")

    return write


def thin_fit(judged: ScoredModel) -> LiveFit:
    """A model with its curves, thinned for drawing."""
    pairs = zip(judged.recordings[:_LOOPS], judged.predictions[:_LOOPS], strict=True)
    loops = tuple(_loop(recording, prediction) for recording, prediction in pairs)
    return LiveFit(judged.model, judged.score.fit_rms_percent, judged.score.held_out_rms_percent, loops)


def _loop(recording: Recording, prediction: Prediction) -> Loop:
    drive, step_s = recording.drive[:, 0], recording.step_s
    spectrum = np.abs(np.fft.rfft(drive - drive.mean()))
    period = float(drive.size / max(int(np.argmax(spectrum)), 1))  # of the strongest line of the drive, in samples
    last = drive.size - min(drive.size, round(2.0 * period))
    shown = np.unique(np.linspace(last, drive.size - 1, 600).astype(int))
    rows = prediction.start + extremes([prediction.residual_rad[prediction.start :]], 600)
    return Loop(
        Path(recording.path).name,
        _digits(drive[shown]),
        _digits(prediction.measured_rad[shown]),
        _digits(prediction.model_rad[shown]),
        _digits(rows * step_s),
        _digits(prediction.residual_rad[rows]),
        float(prediction.split * step_s),
    )


def _digits(values: object) -> tuple[float, ...]:
    return tuple(float(f"{value:.7g}") for value in np.asarray(values, dtype=float))


def extremes(columns: list[Floats], points: int) -> NDArray[np.intp]:
    """Rows, in order, that hold the smallest and largest value of every column in each of `points`/2 stretches.

    A recording of at most `points` samples is kept whole.

    Args:
        columns: Columns of equal length.
        points: Number of points to draw.
    """
    samples = len(columns[0])
    if samples <= points:
        return np.arange(samples)
    edges = np.linspace(0, samples, points // 2 + 1).astype(int)
    found = {0, samples - 1}
    for begin, end in pairwise(edges):
        for column in columns:
            stretch = column[begin:end]
            found |= {int(begin + stretch.argmin()), int(begin + stretch.argmax())}
    return np.array(sorted(found))
