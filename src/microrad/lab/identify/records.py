"""Recordings of one axis in volts and radians: their units, the initial transient, the rates of their drives."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.core.errors import MicroradError
from microrad.core.units import counted
from microrad.lab.recording import Recording


def no_progress(done: int, total: int, what: str) -> None:
    """Say nothing: what is called with the progress where nobody asked for it.

    Args:
        done: Steps done.
        total: Their number.
        what: What is being done.
    """


_VOLTS = {"V": 1.0, "mV": 1e-3}
_RADIANS = {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6}
_METRES = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
_RAMPS = 8  # twice as many predict the virtual bench no better
_SAME = 1e-6  # a column whose own part is smaller than this says the same as others
_MEDIAN_OF_NORMAL = 0.6745  # median size of a normal variable, in standard deviations


class IdentificationError(MicroradError):
    """An identification that cannot be done as asked: the message says why and what to do."""

    page = "identify"


@dataclass(frozen=True)
class Units:
    """Units of a recording's columns, and the lever arm that turns a displacement into a tilt (small angle)."""

    drive: str = "V"
    output: str = "mrad"
    lever_arm_m: float | None = None

    def __post_init__(self) -> None:
        """Raises IdentificationError if a unit is unknown, a length has no lever arm or an angle has one."""
        if self.drive not in _VOLTS:
            raise IdentificationError(f"input unit '{self.drive}' is not known; use one of {', '.join(_VOLTS)}.")
        if self.output not in _RADIANS | _METRES:
            raise IdentificationError(
                f"output unit '{self.output}' is not known; use an angle ({', '.join(_RADIANS)}) or a length "
                f"({', '.join(_METRES)}) with its lever arm."
            )
        arm = self.lever_arm_m
        if self.output in _METRES and arm is None:
            raise IdentificationError(
                f"the output is a length ({self.output}) and a mirror model needs an angle: give the lever arm "
                "(--lever-arm, lever_arm_m), the distance in metres from the axis of rotation to the point measured "
                "(tilt = displacement / lever arm)."
            )
        if arm is not None and not 0 < arm < math.inf:
            raise IdentificationError(f"the lever arm is {arm!r} m; give a positive length in metres.")
        if arm is not None and self.output in _RADIANS:
            raise IdentificationError(
                f"a lever arm of {arm} m was given for an output that is already an angle ({self.output}); leave the "
                "lever arm out, or name the unit of length."
            )

    @property
    def volts(self) -> float:
        """Volts per unit of the input column."""
        return _VOLTS[self.drive]

    @property
    def radians(self) -> float:
        """Radians per unit of the output column."""
        return _RADIANS.get(self.output) or _METRES[self.output] / (self.lever_arm_m or math.nan)


DEFAULT_UNITS = Units()
ANGLES = tuple(_RADIANS)
"""Units of an output that needs no lever arm."""


@dataclass(frozen=True, eq=False)
class SiRecord:
    """A recording in volts and radians; the samples before `start` are left out."""

    name: str
    sha256: str
    drive_v: Floats
    output_rad: Floats
    step_s: float
    start: int

    @cached_property
    def _own(self) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
        """Stretches in which the drive sweeps nothing new, and orthonormal columns of an offset and the memory.

        They are the first used sample of each, its length, and the row that all its samples have in the columns.
        """
        swept = _swept(self.drive_v)[self.start :]
        starts = np.flatnonzero(np.diff(swept, prepend=-1.0))
        lengths = np.diff(starts, append=swept.size)
        ramps = memory(self.drive_v, self.drive_v.size)[self.start :][starts]
        root = np.sqrt(lengths)[:, None]
        return starts, lengths, orthonormal(root * np.column_stack([np.ones(starts.size), ramps])) / root

    @property
    def own_count(self) -> int:
        """How many numbers a fit leaves to it."""
        return int(self._own[2].shape[1])

    def less_own(self, values: Floats) -> Floats:
        """Values over the used samples less what a fit leaves to the record itself: an offset, and its `memory`.

        Args:
            values: Shape (used samples,) or (used samples, columns).
        """
        starts, lengths, rows = self._own
        return values - np.repeat(rows @ (rows.T @ np.add.reduceat(values, starts)), lengths, axis=0)

    def every(self, stride: int) -> "SiRecord":
        """Every `stride`-th sample of it; what is exact for a drive linear between samples loses only samples."""
        return replace(
            self,
            drive_v=self.drive_v[::stride].copy(),
            output_rad=self.output_rad[::stride].copy(),
            step_s=self.step_s * stride,
            start=-(-self.start // stride),
        )

    @property
    def used(self) -> int:
        """Samples behind `start`."""
        return self.drive_v.size - self.start


def si_records(recordings: Sequence[Recording], units: Units) -> tuple[SiRecord, ...]:
    """Recordings in volts and radians.

    Args:
        recordings: One drive and one output each.
        units: Their units.

    Raises:
        IdentificationError: If there is no recording, one has several channels, or its drive is constant or never
            reverses.
    """
    if not recordings:
        raise IdentificationError("no recording was given; name at least one.")
    return tuple(_si_record(recording, units) for recording in recordings)


def _si_record(recording: Recording, units: Units) -> SiRecord:
    if recording.drive.shape[1] != 1 or recording.output.shape[1] != 1:
        raise IdentificationError(
            f"{recording.path}: {counted(recording.drive.shape[1], 'drive')} and "
            f"{counted(recording.output.shape[1], 'output')}; one of each is identified here: choose one column, or "
            "identify all of them with coupled.identify_coupled."
        )
    drive = recording.drive[:, 0] * units.volts
    if np.ptp(drive) == 0 or np.ptp(recording.output) == 0:
        raise IdentificationError(f"{recording.path}: drive or output is constant in the part that is fitted.")
    if not turning_points(drive).size:
        raise IdentificationError(
            f"{recording.path}: the drive never reverses in the part that is fitted, and hysteresis shows only "
            "behind a reversal; record at least one full period of the drive."
        )
    output = recording.output[:, 0] * units.radians
    return SiRecord(recording.path, recording.sha256, drive, output, recording.step_s, lead(drive.size))


def lead(samples: int) -> int:
    """Number of first samples that no fit uses, a twentieth: dynamics that were under way before them are over then.

    For what the hysteresis remembers see `memory`.

    Args:
        samples: Length of a record in samples.
    """
    return samples // 20


def memory(drive: Floats, known: int) -> Floats:
    """What a mirror remembers from before a record adds to its output there, as columns (samples, 8) of free weight.

    A play operator follows its drive u by p = min(max(p, u - r), u + r). Until the drive has swept 2 r since the first
    sample, that is the value it came with, pushed up by the highest drive so far and down by the lowest; then it is the
    same whatever it came with. So all that is unknown is a function of the range swept so far, which stands still while
    a loop is repeated. The columns are ramps, whose sum is any such function, straight between eighths of the range
    and constant beyond it. A Bouc-Wen term forgets sooner.

    Args:
        drive: Drive, in V, shape (samples,).
        known: Samples from which the weights are fitted: the range is what they sweep.
    """
    swept = _swept(drive)
    step = float(swept[known - 1]) / _RAMPS or 1.0
    return np.clip(swept[:, None] / step - np.arange(_RAMPS), 0.0, 1.0)


def orthonormal(columns: Floats) -> Floats:
    """Orthonormal columns that span the same as some columns, of which several may say the same.

    Args:
        columns: The columns, shape (samples, columns).
    """
    from scipy.linalg import orth

    return np.asarray(orth(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), _SAME))


def transient(drive: Floats) -> int:
    """Number of first samples by which nothing is judged where no fit has seen the record, at most half of them.

    That is until the drive has swept 95 % of its range: only then are nearly all play operators where they would be
    whatever they came with. What is left is in the `memory`.

    Args:
        drive: Drive, in V, shape (samples,).
    """
    swept = _swept(drive)
    return min(int(np.argmax(swept >= 0.95 * swept[-1])) + 1, drive.size // 2)


def _swept(drive: Floats) -> Floats:
    """Range that the drive has swept so far, in V."""
    return np.asarray(np.maximum.accumulate(drive) - np.minimum.accumulate(drive))


def turning_points(drive: Floats) -> NDArray[np.intp]:
    """Samples at which the drive reverses: it goes on by more than a twentieth of its range both before and behind.

    What is smaller (noise, ripple) is no reversal, and neither is a spike of one sample.

    Args:
        drive: Drive, in V, shape (samples,).
    """
    from scipy.signal import find_peaks

    smooth = _without_spikes(drive)
    band = 0.05 * float(np.ptp(smooth)) or math.inf
    return np.sort(np.concatenate([find_peaks(side, prominence=band)[0] for side in (smooth, -smooth)]))


def _without_spikes(drive: Floats) -> Floats:
    """The median of each sample and its neighbours: steps stay, and single samples that stand out go."""
    from scipy.ndimage import median_filter

    return np.asarray(median_filter(drive, size=3, mode="nearest"))


def _fastest_tenth(sweep: Floats) -> tuple[float, int]:
    """The fastest tenth of a sweep's travel: how far the drive goes in it (V), and in how many samples."""
    rising = np.maximum.accumulate(sweep if sweep[-1] > sweep[0] else -sweep)
    ends = np.searchsorted(rising, rising + 0.1 * (rising[-1] - rising[0]))
    begins = np.flatnonzero(ends < rising.size)
    ends = ends[begins]
    best = int(np.argmax((rising[ends] - rising[begins]) / (ends - begins)))
    return float(rising[ends[best]] - rising[begins[best]]), int(ends[best] - begins[best])


def _sweeps(drive: Floats) -> list[tuple[float, int]]:
    """The fastest tenth of each sweep from reversal to reversal; those below a fifth of the longest are left out.

    What lies before the first reversal or behind the last one belongs to no loop, and counts where there is nothing
    else.
    """
    smooth, turns = _without_spikes(drive), turning_points(drive)
    edges = turns if turns.size > 1 else np.array([0, *turns, drive.size - 1])
    travel = np.abs(np.diff(smooth[edges]))
    pairs = [pair for pair, long in zip(pairwise(edges), travel >= 0.2 * travel.max(), strict=True) if long]
    return [_fastest_tenth(smooth[begin : end + 1]) for begin, end in pairs]


def _sweep_rates(drive: Floats, step_s: float) -> Floats:
    """Rates (V/s) of the fastest tenths of the sweeps, in ascending order, without the highest of three or more."""
    rates = np.sort([volts / (samples * step_s) for volts, samples in _sweeps(drive)])
    return rates[:-1] if rates.size > 2 else rates


def smoothed_rate(drive: Floats, step_s: float) -> Floats:
    """Rate of the drive (V/s), smoothed so that noise does not count.

    It is taken over a hundredth of the period of the drive's highest strong line, or over half of the time that the
    steepest sweeps but one take for a tenth of their travel, where that is shorter.

    Args:
        drive: Drive, in V, shape (samples,).
        step_s: Time between samples, in s.
    """
    smooth = _without_spikes(drive)
    spectrum = np.abs(np.fft.rfft(smooth - smooth.mean()))
    highest = int(np.flatnonzero(spectrum >= 0.05 * spectrum.max())[-1])
    shortest = sorted(samples for _, samples in _sweeps(drive))
    edge = shortest[1 if len(shortest) > 2 else 0] // 2
    span = max(1, min(drive.size // (100 * max(highest, 1)), edge))
    return (smooth[span:] - smooth[:-span]) / (span * step_s)


def fastest_rate(records: Sequence[SiRecord]) -> float:
    """Fastest rate of the drive (V/s) over all records: 99.5 % of the smoothed rate, so that a spike does not count.

    Samples at rest do not count either: a drive of steps moves in few of them. Where that is a quarter above the rates
    of all sweeps but one it comes from a single step, such as that to the first sample of a sine, and theirs counts.
    """
    return max(_fastest_rate(r.drive_v, r.step_s) for r in records)


def _fastest_rate(drive: Floats, step_s: float) -> float:
    rate = np.abs(smoothed_rate(drive, step_s))
    highest, sweeps = float(np.quantile(rate[rate > 0], 0.995)), float(_sweep_rates(drive, step_s)[-1])
    return sweeps if highest > 1.25 * sweeps else highest


def noisiness(records: Sequence[SiRecord]) -> float:
    """Scatter of the sample-to-sample rate about the smoothed rate (from its median size), over the fastest rate."""
    scatter = 0.0
    for record in records:
        smooth = smoothed_rate(record.drive_v, record.step_s)
        sample = np.diff(record.drive_v) / record.step_s
        lag = (sample.size - smooth.size) // 2
        away = np.abs(sample[lag : lag + smooth.size] - smooth)
        scatter = max(scatter, float(np.median(away)) / _MEDIAN_OF_NORMAL)
    return scatter / fastest_rate(records)


def loop_rates(records: Sequence[SiRecord]) -> tuple[float, float]:
    """Slowest and fastest rate (V/s) of the sweeps of all records, without the outermost twentieths."""
    rates = [_sweep_rates(r.drive_v, r.step_s) for r in records]
    medians = [float(np.median(each)) for each in rates]
    low, high = np.quantile(np.concatenate(rates), [0.05, 0.95])
    return min(float(low), *medians), max(float(high), *medians)


def one_rate_only(records: Sequence[SiRecord]) -> bool:
    """True where all loops have the same peak rate within a quarter, so that rate dependence rests on one rate."""
    slowest, fastest = loop_rates(records)
    return fastest < 1.25 * slowest


def span(records: Sequence[SiRecord]) -> float:
    """Largest peak-to-peak output (rad) of the records: the measure for every percentage."""
    return max(float(np.ptp(r.output_rad)) for r in records)


def centred(columns: Floats, records: Sequence[SiRecord]) -> Floats:
    """Stacked columns less what each record may add by itself; to fit them is to fit that too.

    Args:
        columns: Values of the used samples of all records one behind the other, shape (samples,) or (samples, columns).
        records: The records, in the same order.
    """
    pairs = zip(split_by_record(columns, records), records, strict=True)
    return np.concatenate([record.less_own(part) for part, record in pairs])


def split_by_record(values: Floats, records: Sequence[SiRecord]) -> list[Floats]:
    """Stacked values of the used samples, one array per record.

    Args:
        values: Values of the used samples of all records one behind the other.
        records: The records, in the same order.
    """
    return np.split(values, np.cumsum([r.used for r in records])[:-1])
