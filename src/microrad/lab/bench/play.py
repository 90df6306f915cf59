"""Playing a plan: converter, mirror, sensor and converter again, for each record of it."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.errors import MicroradError
from microrad.core.progress import Progress
from microrad.core.units import format_quantity
from microrad.lab.bench.mirrors import Amplifier, bench_output, bouc_wen_output, linear_output
from microrad.lab.bench.plan import ConvertersTable, Plan, Record
from microrad.lab.recording.records import Recording, digest_of, frozen

_MRAD = 1e3  # recordings are in volts and mrad


class BenchError(MicroradError):
    """A plan that the bench cannot play, or a folder that it cannot write; the message says what to do."""

    page = "bench"


@dataclass(frozen=True, slots=True)
class Converter:
    """A converter with a code every `step` from `low` on, `codes` of them; beyond its range it holds the last code."""

    low: float
    step: float
    codes: int

    def convert(self, values: Floats) -> Floats:
        """The nearest code of each value, in the unit of the values."""
        code = np.clip(np.round((values - self.low) / self.step), 0, self.codes - 1)
        return np.asarray(self.low + code * self.step)


def converters(table: ConvertersTable) -> tuple[Converter, Converter]:
    """The converters of drive (V) and sensor (mrad)."""
    codes = 2**table.bits
    drive = Converter(table.drive_min_v, (table.drive_max_v - table.drive_min_v) / codes, codes)
    low, high = table.output_min_rad * _MRAD, table.output_max_rad * _MRAD
    return drive, Converter(low, (high - low) / codes, codes)


def play(plan: Plan, seed: int, on_progress: Progress | None = None) -> tuple[Recording, ...]:
    """What the bench records when it plays the plan: one recording a record, drives in V and outputs in mrad.

    The drive is what the converter of the function generator gave out, the output what the converter of the sensor
    took in at the same instants; true values are not in it. Each record has its own random stream, told by the seed and
    the record's name, so that it does not depend on the others.

    Args:
        plan: The plan to play.
        seed: Seed of the sensor's noise, 0 or more.
        on_progress: Called with the records done, their number and the name of the next one.

    Raises:
        BenchError: If an output leaves the range of its converter, or if the seed is negative.
    """
    return tuple(recording for _, recording in play_records(plan, seed, on_progress))


def play_records(plan: Plan, seed: int, on_progress: Progress | None = None) -> Iterator[tuple[Record, Recording]]:
    """Play the records of a plan and give each with its recording, one after the other, as `play` does all at once.

    Args:
        plan: The plan.
        seed: Seed of the noise, at least 0.
        on_progress: Called with the records done, their number and the name of what is played.

    Raises:
        BenchError: For a negative seed.
    """
    if seed < 0:
        raise BenchError(f"the seed is {seed}; give a whole number of at least 0")
    report = on_progress or (lambda *_: None)
    for done, record in enumerate(plan.records):
        report(done, len(plan.records), record.excitation.name)
        yield record, _recorded(plan, record, seed)
    report(len(plan.records), len(plan.records), plan.name)


def true_output(plan: Plan, record: Record) -> tuple[Floats, Floats]:
    """Drive given out by the converter (V) and true angle (mrad), before any sensor, both of shape (samples, axes).

    Args:
        plan: The plan, which describes the bench.
        record: The record of it that is played.
    """
    excitation, bench = record.excitation, plan.bench
    drive = converters(bench.converters)[0].convert(excitation.drive)
    rest_v = float(converters(bench.converters)[0].convert(np.array(excitation.rest_v)))
    amplifier = Amplifier(bench.amplifier.bandwidth_hz, bench.amplifier.slew_v_s / bench.amplifier.gain)
    columns = []
    for column in np.ascontiguousarray(drive.T):
        if record.truth == "linear":
            columns.append(linear_output(column, rest_v, excitation.rate_hz))
        elif record.truth == "bouc-wen":
            columns.append(bouc_wen_output(column, rest_v, excitation.rate_hz))
        else:
            columns.append(bench_output(column, rest_v, excitation.rate_hz, amplifier))
    mixing = np.where(np.eye(bench.axes, dtype=bool), 1.0, bench.crosstalk)
    return drive, np.stack(columns, axis=1) @ mixing.T


def _recorded(plan: Plan, record: Record, seed: int) -> Recording:
    axes = plan.bench.axes
    numbers = [""] if axes == 1 else [str(i + 1) for i in range(axes)]
    drive, angle = true_output(plan, record)
    measured = angle + _sensor_error(plan, record, angle, seed)
    _check_range(plan, record, measured)
    drive, output = frozen(drive), frozen(converters(plan.bench.converters)[1].convert(measured))
    return Recording(
        path=record.excitation.name,
        sha256=digest_of(drive, output),
        drive=drive,
        output=output,
        rate_hz=record.excitation.rate_hz,
        input_names=tuple(f"drive{n}" for n in numbers),
        output_names=tuple(f"angle{n}" for n in numbers),
        period_samples=record.excitation.period_samples,
        input_units=("V",) * axes,
        output_units=("mrad",) * axes,
    )


def _sensor_error(plan: Plan, record: Record, angle: Floats, seed: int) -> Floats:
    """White noise, mains and drift (mrad) of each axis; the mains have the same phase on all."""
    sensor = plan.bench.sensor
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(record.stream,))))
    share = sensor.noise_share if record.noise_share is None else record.noise_share
    rms = np.full(angle.shape[1], (sensor.noise_rad or 0.0) * _MRAD) if share is None else share * angle.std(axis=0)
    time_s = np.arange(angle.shape[0]) / record.excitation.rate_hz
    phase = 2 * math.pi * rng.random()
    mains = sensor.mains_rad * _MRAD * np.sin(2 * math.pi * sensor.mains_frequency_hz * time_s + phase)
    common = mains + sensor.drift_rad_s * _MRAD * time_s
    return np.asarray(common[:, None] + rms * rng.standard_normal(angle.shape))


def _check_range(plan: Plan, record: Record, measured: Floats) -> None:
    """Raises BenchError if the converter would clip the output: a clipped record is of no use."""
    table = plan.bench.converters
    low, high = float(measured.min()) / _MRAD, float(measured.max()) / _MRAD
    if low < table.output_min_rad or high > table.output_max_rad:
        reached, allowed = (
            f"{format_quantity(a, 'rad')} to {format_quantity(b, 'rad')}"
            for a, b in ((low, high), (table.output_min_rad, table.output_max_rad))
        )
        raise BenchError(
            f"{plan.path}: excitation '{record.excitation.name}' moves the mirror over {reached}, but "
            f"bench.converters take in {allowed}; widen output_min and output_max, or drive less"
        )
