"""A fitted model run over a recording, beside the straight line through the same samples."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import plain
from microrad.lab.identify.hysteresis.bouc_wen import BoucWenFit
from microrad.lab.identify.hysteresis.joint import JointFit
from microrad.lab.identify.hysteresis.prandtl_ishlinskii import PrandtlIshlinskiiFit
from microrad.lab.identify.records import IdentificationError, SiRecord, Units, lead, memory, transient
from microrad.lab.recording import Recording

Fit = BoucWenFit | PrandtlIshlinskiiFit | JointFit


@dataclass(frozen=True, eq=False)
class Prediction:
    """Model against measurement over one record, offset included (rad); samples before `start` count nowhere.

    Behind `split` the record is unseen. What a record may add by itself (an offset; what the mirror remembers from
    before, see `records.memory`; with creep the tail of what went before it) is fitted over the samples from `start` to
    `split`, or over all where the whole record is unseen.
    """

    model_rad: Floats
    measured_rad: Floats
    start: int
    split: int
    clamped: int

    @property
    def residual_rad(self) -> Floats:
        """Measured less modelled."""
        return self.measured_rad - self.model_rad


@dataclass(frozen=True)
class Score:
    """Residuals of one model in per cent of the peak-to-peak output, on the fitted and on the held-out samples."""

    model: str
    fit_rms_percent: float
    fit_peak_percent: float
    held_out_rms_percent: float
    held_out_peak_percent: float


@dataclass(frozen=True, eq=False)
class ScoredModel:
    """A model as soon as it is fitted: its score, and its predictions in the order of the recordings judged on."""

    model: str
    score: Score
    predictions: tuple[Prediction, ...]
    recordings: tuple[Recording, ...]


@dataclass(frozen=True, slots=True)
class Evidence:
    """On what the error on unseen samples rests: names of recordings with their seconds, and the worst of all."""

    judged: tuple[tuple[str, float], ...]
    worst: str
    worst_rms_rad: float
    worst_peak_rad: float

    @property
    def seconds(self) -> float:
        """Length of what is judged, in s."""
        return sum(seconds for _, seconds in self.judged)

    @property
    def text(self) -> str:
        """How much is judged, of which recordings."""
        count = len(self.judged)
        named = " and ".join(f"{name} ({plain(seconds)} s)" for name, seconds in self.judged) if count < 4 else ""
        return f"{plain(self.seconds)} s of {count} recording{'s' * (count > 1)}{f', {named}' if named else ''}"


def evidence(recordings: Sequence[Recording], predictions: Sequence[Prediction]) -> Evidence:
    """On what the error of a model rests, and the recording on which its residual has the largest rms.

    Args:
        recordings: The recordings, fitted or not.
        predictions: The model's prediction of each of them.
    """
    pairs = list(zip(recordings, predictions, strict=True))
    unseen = [(Path(r.path).name, (r.samples - p.split) * r.step_s) for r, p in pairs if r.samples > p.split]
    residuals = [p.residual_rad[p.start :] for p in predictions]
    rms = [float(np.sqrt(np.mean(residual**2))) for residual in residuals]
    worst = int(np.argmax(rms))
    name, peak = Path(recordings[worst].path).name, float(np.max(np.abs(residuals[worst])))
    return Evidence(tuple(unseen), name, rms[worst], peak)


def predict(fit: Fit, recording: Recording, split: int | None = None) -> Prediction:
    """Run a fitted model over a recording with the units of the fit, states carried through from the first sample.

    A sensor's zero is not part of the model: the offset is taken from the samples before `split`.

    Args:
        fit: A fitted model.
        recording: The recording, in the units of the fit.
        split: First sample that the fit has not seen; None where it has seen all (the default), 0 where it has seen
            none: then the offset is taken from all samples, too.

    Raises:
        IdentificationError: For a split outside the recording.
    """
    drive, measured = recording.drive[:, 0] * fit.units.volts, recording.output[:, 0] * fit.units.radians
    end = recording.samples if split is None or split == 0 else split
    if not 2 <= end <= recording.samples:
        raise IdentificationError(
            f"split {split} does not lie within the {recording.samples} samples of {recording.path}; give a number "
            "from 2 to that."
        )
    start = transient(drive) if split == 0 else lead(end)
    model, clamped = fit.response(drive, recording.step_s)
    if isinstance(fit, JointFit):
        columns = fit.nuisance(drive, recording.step_s, end)
    else:
        columns = np.column_stack([np.ones(drive.size), memory(drive, end)])
    own = np.linalg.lstsq(columns[start:end], (measured - model)[start:end], rcond=None)[0]
    model = model + columns @ own
    return Prediction(model, measured, start, start if split == 0 else end, clamped)


def straight_line(
    prepared: Sequence[SiRecord], recordings: Sequence[Recording], splits: Sequence[int], units: Units
) -> list[Prediction]:
    """One slope for all recordings and one offset for each, from the fitted samples.

    Args:
        prepared: The fitted parts in SI units.
        recordings: The recordings to predict: loops, then validation.
        splits: Samples at the begin of each recording that were fitted; 0 where all are unseen.
        units: Units of the recordings.
    """
    above = [(p.drive_v[p.start :], p.output_rad[p.start :]) for p in prepared]
    slope = sum(float((u - u.mean()) @ (y - y.mean())) for u, y in above) / sum(
        float((u - u.mean()) @ (u - u.mean())) for u, _ in above
    )
    lines = []
    for recording, split in zip(recordings, splits, strict=True):
        drive = recording.drive[:, 0] * units.volts
        model, measured = slope * drive, recording.output[:, 0] * units.radians
        start = lead(split) if split else transient(drive)
        offset = float(np.mean((measured - model)[start : split or None]))
        lines.append(Prediction(model + offset, measured, start, split or start, 0))
    return lines
