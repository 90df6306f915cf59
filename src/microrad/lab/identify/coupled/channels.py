"""Recordings of several channels in SI units, their actuators and outputs, and what is held out of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from microrad.core.arrays import Floats, Integers
from microrad.core.units import counted
from microrad.lab.identify.linear.response import check_alike
from microrad.lab.identify.records import IdentificationError
from microrad.lab.identify.stiffness.fit import amplitude_classes
from microrad.lab.recording import Recording
from microrad.mirror.coupled import Actuator, Output

_VOLTS = {"V": 1.0, "mV": 1e-3}
_ANGLES = {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6}
_LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
_DRIVEN = 1e-3  # part of the strongest drive's power from which another counts as driven


@dataclass(frozen=True, eq=False)
class Channels:
    """The recordings of an identification in volts and in metres or radians, drives about their bias.

    `fitted` are those that the models are fitted to and `held_out` those that judge them; `amplitudes_v` is the rms
    drive of each class of records of one amplitude, and `fitted_class` and `held_class` the class of each record.
    """

    fitted: tuple[Recording, ...]
    held_out: tuple[Recording, ...]
    amplitudes_v: Floats
    fitted_class: Integers
    held_class: Integers
    actuators: tuple[Actuator, ...]
    outputs: tuple[Output, ...]
    periodic: bool

    @property
    def rate_hz(self) -> float:
        """Sample rate of all records."""
        return self.fitted[0].rate_hz

    def of_amplitude(self, number: int) -> list[Recording]:
        """The fitted records of one amplitude."""
        return [r for r, own in zip(self.fitted, self.fitted_class, strict=True) if own == number]


def channels(
    recordings: Sequence[Recording],
    validation: Sequence[Recording],
    drive_unit: str,
    output_unit: str,
    positions_m: Sequence[tuple[float, float]] | None,
) -> Channels:
    """Recordings in SI units, split into those that are fitted and those that are held out.

    Without recordings for validation the last record of each amplitude and set of driven channels is held out, where
    there are at least two.

    Args:
        recordings: The recordings, all periodic or none.
        validation: Recordings that no fit sees.
        drive_unit: Unit of all drives: V or mV.
        output_unit: Unit of all outputs: rad, mrad, urad, m, mm or um.
        positions_m: Where each output is measured on the mirror, (x, y) in m; None where that is not known.

    Raises:
        IdentificationError: For recordings that do not belong together, and where nothing can be held out.
    """
    if not recordings:
        raise IdentificationError("no recording was given; name at least one.")
    every = [*recordings, *validation]
    check_alike(every, "used")
    periodic = _periodic(recordings)
    volts, quantity, size = _units(drive_unit, output_unit)
    bias = _rounded_bias(recordings)
    si = [replace(r, drive=(r.drive - bias) * volts, output=r.output * size) for r in every]
    amplitudes, each = amplitude_classes(si)
    count, classes = len(recordings), np.asarray(each, dtype=np.int64)
    held = np.arange(count, len(every)) if validation else _held_out(si, classes)
    fitted = np.setdiff1d(np.arange(count), held)
    return Channels(
        fitted=tuple(si[k] for k in fitted),
        held_out=tuple(si[k] for k in held),
        amplitudes_v=np.array(amplitudes),
        fitted_class=classes[fitted],
        held_class=classes[held],
        actuators=_actuators(si[:count], bias * volts),
        outputs=_outputs(recordings[0], quantity, positions_m),
        periodic=periodic,
    )


def _periodic(recordings: Sequence[Recording]) -> bool:
    """Whether all records are periodic; raises where some are, some are not, or they differ in length."""
    first = recordings[0]
    for other in recordings[1:]:
        if (other.period_samples is None) != (first.period_samples is None):
            raise IdentificationError(
                f"{other.path}: of this record and {first.path} one is periodic and the other is not; fit records of "
                "one kind, and give the others for validation."
            )
        if other.samples != first.samples or other.period_samples != first.period_samples:
            raise IdentificationError(
                f"{other.path}: {_length(other)}, where {first.path} has {_length(first)}; cut all records to one "
                "length and period."
            )
    return first.period_samples is not None


def _length(record: Recording) -> str:
    return f"{record.samples} samples" + (f" in periods of {record.period_samples}" if record.period_samples else "")


def _units(drive_unit: str, output_unit: str) -> tuple[float, Literal["displacement", "angle"], float]:
    """Volts per unit of the drive; what the outputs are, and their SI value per unit."""
    if drive_unit not in _VOLTS:
        raise IdentificationError(f"input unit '{drive_unit}' is not known; use one of {', '.join(_VOLTS)}.")
    if output_unit in _ANGLES:
        return _VOLTS[drive_unit], "angle", _ANGLES[output_unit]
    if output_unit in _LENGTHS:
        return _VOLTS[drive_unit], "displacement", _LENGTHS[output_unit]
    raise IdentificationError(
        f"output unit '{output_unit}' is not known; use an angle ({', '.join(_ANGLES)}) or a length "
        f"({', '.join(_LENGTHS)})."
    )


def _held_out(records: Sequence[Recording], classes: Integers) -> Integers:
    """Number of the last record of each amplitude and set of driven channels that has at least two."""
    kinds: dict[tuple[int, tuple[bool, ...]], list[int]] = {}
    for k, record in enumerate(records):
        power = record.drive.var(axis=0)
        driven = tuple((power > _DRIVEN * power.max()).tolist())
        kinds.setdefault((int(classes[k]), driven), []).append(k)
    held = sorted(members[-1] for members in kinds.values() if len(members) > 1)
    inputs = records[0].drive.shape[1]
    if not held:
        raise IdentificationError(
            f"{len(records)} records, no two of one amplitude with the same channels driven: none can be held out to "
            "judge the models by; record another realisation, or give recordings for validation."
        )
    if len(records) - len(held) < inputs and records[0].period_samples:
        raise IdentificationError(
            f"{len(records)} records for {inputs} actuators: {len(held)} held out to judge the models by leave "
            f"{len(records) - len(held)}, and at least {inputs} realisations with different drives are needed; record "
            "more, or give recordings for validation."
        )
    return np.array(held)


def _rounded_bias(recordings: Sequence[Recording]) -> Floats:
    """Rest of each drive, to a billionth of the largest: what rounding leaves of a mean is no bias."""
    rest = np.mean([r.drive.mean(axis=0) if r.period_samples else r.drive[0] for r in recordings], axis=0)
    largest = max(float(np.abs(r.drive).max()) for r in recordings)
    return np.asarray(np.round(rest, 9 - math.ceil(math.log10(largest))) + 0.0 if largest else rest)


def _actuators(records: Sequence[Recording], bias_v: Floats) -> tuple[Actuator, ...]:
    """Ranges and largest rate of each drive over the records, about the bias."""
    low = np.min([r.drive.min(axis=0) for r in records], axis=0) + bias_v
    high = np.max([r.drive.max(axis=0) for r in records], axis=0) + bias_v
    fastest = np.max([np.abs(np.diff(r.drive, axis=0)).max(axis=0) * r.rate_hz for r in records], axis=0)
    columns = (v.tolist() for v in (bias_v, low, high, fastest))
    return tuple(Actuator(name, *each) for name, *each in zip(records[0].input_names, *columns, strict=True))


def _outputs(
    record: Recording, quantity: Literal["displacement", "angle"], positions_m: Sequence[tuple[float, float]] | None
) -> tuple[Output, ...]:
    names = record.output_names
    if positions_m is None:
        return tuple(Output(name, quantity, None) for name in names)
    if len(positions_m) != len(names):
        raise IdentificationError(
            f"{counted(len(positions_m), 'position')} for {counted(len(names), 'output')} ({', '.join(names)}); give "
            "one for each."
        )
    for name, place in zip(names, positions_m, strict=True):
        if np.shape(place) != (2,) or not np.all(np.isfinite(place)):
            raise IdentificationError(f"the position of the output '{name}' is {place}; give x and y in m.")
    return tuple(
        Output(name, quantity, (float(place[0]), float(place[1])))
        for name, place in zip(names, positions_m, strict=True)
    )
