"""How well a model predicts the records that no fit has seen, in SI units, and which models do as well as the best."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.lab.identify.coupled.channels import Channels
from microrad.lab.identify.statistics import may_be_chance
from microrad.lab.recording import Recording
from microrad.mirror.coupled import CoupledMirror

BANDS = 8
_RETURN = 0.125  # part of a record that does not repeat in which its drive goes back to rest


@dataclass(frozen=True, eq=False)
class Judged:
    """The error of one model on the held-out records, see `Candidate`; `losses` are squares by sample and record.

    A loss is the mean over the outputs, and over the periods of a record that repeats, of the squared error over the
    mean-square output of the record.
    """

    error_rms: Floats
    band_error_rms: Floats
    record_share: Floats
    losses: tuple[Floats, ...]

    @property
    def share(self) -> float:
        """Root of the mean loss over all records, each of the same weight."""
        return float(np.sqrt(np.mean([loss.mean() for loss in self.losses])))


def judge(model: CoupledMirror, records: Channels, bands_hz: Floats) -> Judged:
    """Errors of a model on the held-out records.

    Args:
        model: The model.
        records: The recordings with those held out.
        bands_hz: Edges of the bands, in Hz, shape (bands + 1,).
    """
    errors = [held_out_error(model, record) for record in records.held_out]
    rms = _rms_by_amplitude(records, [np.mean(e**2, axis=0) for e in errors])
    in_bands = _rms_by_amplitude(records, [_band_power(e, records.rate_hz, bands_hz) for e in errors])
    losses = tuple(_loss(e, r) for e, r in zip(errors, records.held_out, strict=True))
    shares = np.array([e.std(axis=0) / r.output.std(axis=0) for e, r in zip(errors, records.held_out, strict=True)])
    return Judged(rms, in_bands, shares, losses)


def held_out_error(model: CoupledMirror, record: Recording) -> Floats:
    """Measured less modelled output (samples, outputs) of a record, without its mean.

    A periodic record is compared with the steady state of its drive: one more period of it runs before. Another begins
    at rest at its first drive value.

    Args:
        model: The model.
        record: The record, in SI units, its drive about the bias.
    """
    modelled = modelled_output(model, record)
    error = record.output - modelled
    return np.asarray(error - error.mean(axis=0))


def modelled_output(model: CoupledMirror, record: Recording) -> Floats:
    """Output (samples, outputs) that a model makes of the drive of a record, see `held_out_error`.

    Args:
        model: The model.
        record: The record, in SI units, its drive about the bias.
    """
    drive = record.drive
    if record.period_samples:
        before = record.period_samples
        return model.response(np.concatenate([drive[:before], drive]))[before:]
    moved = drive - drive[:1]
    back = max(round(_RETURN * record.samples), 1)
    fall = 0.5 + 0.5 * np.cos(np.pi * np.arange(1, back + 1) / back)  # the drive's ends are to meet, at rest
    return model.response(np.concatenate([moved, moved[-1:] * fall[:, None]]))[: record.samples]


def output_rms(records: Channels) -> Floats:
    """Rms output of the held-out records without its mean, shape (amplitudes, outputs); nan where there are none."""
    return _rms_by_amplitude(records, [r.output.var(axis=0) for r in records.held_out])


def noise_rms(records: Channels) -> Floats:
    """Rms of what changes from period to period, less its mean, of the held-out records; as `output_rms`.

    It is that of a single period; nan where a record has one alone.
    """
    return _rms_by_amplitude(records, [_period_scatter(r) for r in records.held_out])


def _rms_by_amplitude(records: Channels, squares: Sequence[Floats]) -> Floats:
    """Root of the mean of squares, one array a held-out record, over those of each amplitude; nan where there are none.

    A nan of one record is that of its amplitude.
    """
    each = np.array(squares)
    found = np.full((records.amplitudes_v.size, *each.shape[1:]), np.nan)
    for number in np.unique(records.held_class):
        found[number] = np.sqrt(np.mean(each[records.held_class == number], axis=0))
    return found


def _period_scatter(record: Recording) -> Floats:
    """Mean square of what changes from period to period, by output; nan with fewer than two periods."""
    if not record.period_samples or record.samples < 2 * record.period_samples:
        return np.full(record.output.shape[1], np.nan)
    periods = _by_period(record.output, record.period_samples)
    periods = periods - periods.mean(axis=1, keepdims=True)
    return np.asarray(periods.var(axis=0, ddof=1).mean(axis=0))


def _by_period(values: Floats, period: int) -> Floats:
    """Whole periods of a record, shape (periods, samples, channels)."""
    count = len(values) // period
    return values[: count * period].reshape(count, period, -1)


def _band_power(error: Floats, rate_hz: float, bands_hz: Floats) -> Floats:
    """Mean-square error in each band, shape (bands, outputs)."""
    freq = np.fft.rfftfreq(len(error), 1 / rate_hz)
    power = 2 * np.abs(np.fft.rfft(error, axis=0) / len(error)) ** 2
    band = np.searchsorted(bands_hz, freq, side="right") - 1
    band[freq == bands_hz[-1]] = bands_hz.size - 2
    return np.stack([power[band == k].sum(axis=0) for k in range(bands_hz.size - 1)])


def _loss(error: Floats, record: Recording) -> Floats:
    """Squared error over the mean-square output, mean over outputs and periods: one value for each sample of a period.

    Periods share their drive, and so the error of a model: counted one by one, it would seem twice as certain.
    """
    squared = np.mean(error**2 / record.output.var(axis=0), axis=1)
    period = record.period_samples or record.samples
    return np.asarray(_by_period(squared[:, None], period).mean(axis=0)[:, 0])


def smallest_within_noise(judged: Sequence[Judged], parameters: Sequence[int]) -> tuple[int, int, list[int]]:
    """Numbers of the model that is chosen, of the one with the least error, and of all that differ from it by chance.

    The smallest of the latter is chosen; of two with as many parameters the one with the lower error.

    Args:
        judged: The models' errors.
        parameters: Number of parameters of each.
    """
    best = int(np.argmin([own.share for own in judged]))
    ties = [k for k, own in enumerate(judged) if may_be_chance(own.losses, judged[best].losses)]
    return min(ties, key=lambda k: (parameters[k], judged[k].share)), best, ties
