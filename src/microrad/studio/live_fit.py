"""The models of an identification as they are fitted: written by the command, read by the page that looks on.

A job's folder has one line of JSON for each model: its score, and its curve beside the measured one, thinned.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from microrad.studio import plain_files

if TYPE_CHECKING:
    from microrad.lab.identify.ladder.predictions import Judged, Prediction
    from microrad.lab.recording import Recording

FITS = "fits"
"""Name of the file, beside that of the progress."""

_LOOPS = 6  # recordings that are kept; a bench writes a dozen
_PERIODS = 2.0
_LOOP_POINTS = 600
_RESIDUAL_POINTS = 600
_MOST_BYTES = 20_000_000


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


# ------------------------------------------------------------------------------------------------------------- writing
def looker_on(progress: str | None) -> Callable[[Judged], None]:
    """What `identify` gives its models to: a file beside that of the progress, or nobody where there is none.

    A disk that is full costs the picture, not the identification.
    """
    if not progress:
        return lambda judged: None
    path = Path(progress).with_name(FITS)

    def write(judged: Judged) -> None:
        line = json.dumps(asdict(live_fit(judged)), allow_nan=False)
        with suppress(OSError), path.open("a", encoding="ascii") as file:
            file.write(f"{line}\n")

    return write


def live_fit(judged: Judged) -> LiveFit:
    """A model with its curves, thinned for drawing."""
    pairs = zip(judged.recordings[:_LOOPS], judged.predictions[:_LOOPS], strict=True)
    loops = tuple(_loop(recording, prediction) for recording, prediction in pairs)
    return LiveFit(judged.model, judged.score.fit_rms_percent, judged.score.held_out_rms_percent, loops)


def _loop(recording: Recording, prediction: Prediction) -> Loop:
    import numpy as np

    from microrad.studio.parse_process import extremes

    drive, step_s = recording.drive[:, 0], recording.step_s
    last = drive.size - min(drive.size, round(_PERIODS * _period(recording)))
    shown = np.unique(np.linspace(last, drive.size - 1, _LOOP_POINTS).astype(int))
    rows = prediction.start + extremes([prediction.residual_rad[prediction.start :]], _RESIDUAL_POINTS)
    return Loop(
        Path(recording.path).name,
        _digits(drive[shown]),
        _digits(prediction.measured_rad[shown]),
        _digits(prediction.model_rad[shown]),
        _digits(rows * step_s),
        _digits(prediction.residual_rad[rows]),
        float(prediction.split * step_s),
    )


def _period(recording: Recording) -> float:
    """Samples in a period of the strongest line of the drive."""
    import numpy as np

    drive = recording.drive[:, 0]
    spectrum = np.abs(np.fft.rfft(drive - drive.mean()))
    return float(drive.size / max(int(np.argmax(spectrum)), 1))


def _digits(values: object) -> tuple[float, ...]:
    import numpy as np

    return tuple(float(f"{value:.7g}") for value in np.asarray(values, dtype=float))


# ------------------------------------------------------------------------------------------------------------- reading
def read_fits(folder: Path) -> tuple[LiveFit, ...]:
    """The models of a job so far, in the order in which they were fitted; a line that is being written is left out."""
    from pydantic import TypeAdapter

    try:
        with plain_files.opened(folder / FITS) as file:
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
    """
    ended = [fit for fit in fits if fit.model == chosen]
    return ended[-1] if ended else best(fits)


def best(fits: tuple[LiveFit, ...]) -> LiveFit | None:
    """The model with the least residual on the held-out samples, of two that are alike the later; None without one."""
    return min(reversed(fits), key=lambda fit: fit.held_out_rms_percent, default=None)
