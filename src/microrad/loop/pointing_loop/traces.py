"""Runs of a fine-pointing loop in full, sample by sample: each to the last bit a run of an ensemble."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core import kernels
from microrad.core.arrays import Floats
from microrad.core.labelled import Dataset, Group, variables
from microrad.loop.pointing_loop.ensemble import SLICE_SAMPLES, Span, axis_names, control_samples
from microrad.loop.pointing_loop.kernel_arrays import LANES, References, arrays, reference, start
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop


@dataclass(frozen=True, slots=True)
class PointingTrace:
    """One run at its control samples: all arrays (samples, axes), (samples, actuators) or (samples, outputs).

    ``error_rad``, ``reference_rad`` and ``disturbance_rad`` at the line of sight, ``drive_v`` behind the amplifier and
    from the bias, ``mirror_rad`` the mirror's own outputs, ``measured_rad`` the optical sensor's readings.
    """

    time_s: Floats
    reference_rad: Floats
    disturbance_rad: Floats
    error_rad: Floats
    measured_rad: Floats
    drive_v: Floats
    mirror_rad: Floats

    def to_xarray(self) -> Dataset:
        """The same by time in s and, where there are several, by axis, actuator and output of the mirror."""
        by_axis = variables(
            "time axis",
            reference=("rad", "pointing reference", self.reference_rad),
            disturbance=("rad", "disturbance before the loop, at the line of sight", self.disturbance_rad),
            error=("rad", "pointing error at the line of sight", self.error_rad),
            measured=("rad", "reading of the optical sensor", self.measured_rad),
        )
        drive = variables("time actuator", drive=("V", "drive behind the amplifier, from the bias", self.drive_v))
        mirror = variables("time output", mirror=("rad", "outputs of the mirror", self.mirror_rad))
        time = variables("time", time=("s", "time", self.time_s))
        return Group({**by_axis, **drive, **mirror}, {**time, **axis_names(self.error_rad.shape[1])}).to_xarray()


def trace(loop: PointingLoop, controller: LoopController, span: Span, run_number: int = 0) -> PointingTrace:
    """One run in full: the run of that number of an ensemble, to the last bit. The settling time is part of it.

    Args:
        loop: The loop.
        controller: The controller of all its axes.
        span: How long the run is, and the seed.
        run_number: Number of the run, from 0.

    Raises:
        ValueError: For a controller that does not fit, and a run that ends before it has settled.
    """
    p = arrays(loop, controller, span.seed)
    total, _ = control_samples(loop, span)
    axes, m, outputs = loop.axes, loop.mirror.actuators, loop.mirror.axes
    errors, rest = np.empty((total, axes)), np.empty((total, _channels(loop, p)))
    for part, residual, recorded in _recorded(loop, p, total, run_number):
        errors[part], rest[part] = residual[:, :, 0], recorded[:, :, 0]
    drives, driven = axes + kernels.DRIVE_FIELDS * m, reference(loop, 0, total)[:-1, :, 0]
    return PointingTrace(
        time_s=np.arange(total, dtype=float) * loop.timing.period_s,
        reference_rad=driven[:, -axes:],
        disturbance_rad=rest[:, :axes] + (driven[:, :axes] - driven[:, -axes:]),
        error_rad=errors,
        measured_rad=rest[:, drives + outputs : drives + outputs + axes],
        drive_v=rest[:, axes + kernels.DRIVE_NOW : drives : kernels.DRIVE_FIELDS],
        mirror_rad=rest[:, drives : drives + outputs],
    )


def side_by_side(
    loop: PointingLoop, controller: LoopController, span: Span, references: Sequence[References], first_run: int = 0
) -> tuple[Floats, Floats]:
    """Error and mirror's outputs (rad) of one run for each of several references.

    Their shapes are (runs, samples, axes) and (runs, samples, outputs), at the control samples; the settling time is
    part of them.

    Args:
        loop: The loop; its own references are not used.
        controller: The controller of all its axes.
        span: How long a run is, and the seed.
        references: References of each run, by axis.
        first_run: Number of the first run; the others follow it.

    Raises:
        ValueError: For a controller that does not fit, and a run that ends before it has settled.
    """
    p = arrays(loop, controller, span.seed)
    total, _ = control_samples(loop, span)
    axes, outputs = loop.axes, loop.mirror.axes
    before = axes + kernels.DRIVE_FIELDS * loop.mirror.actuators
    errors, turned = np.empty((len(references), total, axes)), np.empty((len(references), total, outputs))
    for first in range(0, len(references), LANES):
        own = references[first : first + LANES]
        runs = slice(first, first + len(own))
        for part, residual, recorded in _recorded(loop, p, total, first_run + first, own):
            errors[runs, part] = np.moveaxis(residual[:, :, : len(own)], 2, 0)
            turned[runs, part] = np.moveaxis(recorded[:, before : before + outputs, : len(own)], 2, 0)
    return errors, turned


def _channels(loop: PointingLoop, p: kernels.Ensemble) -> int:
    """Channels of a recorded run beside its error: disturbance, drives, the mirror's outputs, readings."""
    return loop.axes + kernels.DRIVE_FIELDS * loop.mirror.actuators + loop.mirror.axes + int(p.B.shape[1])


def _recorded(
    loop: PointingLoop, p: kernels.Ensemble, total: int, first_run: int, references: Sequence[References] = ()
) -> Iterator[tuple[slice, Floats, Floats]]:
    """Error and channels of LANES runs, (samples, axes, LANES) and (samples, channels, LANES), slice by slice."""
    state = start(loop, p, first_run, references)
    for at in range(0, total, SLICE_SAMPLES):
        end = min(at + SLICE_SAMPLES, total)
        residual, recorded = np.empty((end - at, loop.axes, LANES)), np.empty((end - at, _channels(loop, p), LANES))
        driven = reference(loop, at, end, references)
        kernels.ensemble_loop(p, state, driven, residual, recorded, kernels.UNSHIFTED)
        yield slice(at, end), residual, recorded


@dataclass(frozen=True, slots=True)
class Replay:
    """A run at its control samples, from rest.

    ``inputs`` (samples, numbers) are the readings in the order of `LoopController`, ``commands`` (samples, actuators)
    what the controller made of them, in V from the bias. ``disturbance_rad`` and ``error_rad`` (samples, axes) are at
    the line of sight; ``counts`` (kernels.COUNT_*) are of the whole run.
    """

    inputs: Floats
    commands: Floats
    disturbance_rad: Floats
    error_rad: Floats
    counts: Floats


def replay(loop: PointingLoop, controller: LoopController, samples: int, seed: int, run_number: int = 0) -> Replay:
    """Run a loop and keep what its controller read and what it made of it, sample by sample.

    It is the run of that number of an ensemble with this seed, to the last bit. It enters the kernel once a sample,
    some 0.1 ms each: for a trace of the loop alone take `trace`.

    Args:
        loop: The loop.
        controller: The controller of all its axes.
        samples: Number of control samples.
        seed: Seed of the ensemble.
        run_number: Number of the run, from 0.

    Raises:
        ValueError: For a controller that does not fit.
    """
    p = arrays(loop, controller, seed)
    state = start(loop, p, run_number)
    axes, m, read = loop.axes, loop.mirror.actuators, p.B.shape[1]
    inputs, commands = np.empty((samples, read)), np.empty((samples, m))
    disturbance, error = np.empty((samples, axes)), np.empty((samples, axes))
    references = reference(loop, 0, samples)
    length = state.command.size // (m * kernels.LANES)
    nothing = np.empty((0, 0, 0))

    def first(rows: Floats, begin: int, count: int) -> Floats:
        return rows.reshape(-1, kernels.LANES)[begin : begin + count, 0]

    for k in range(samples):
        disturbance[k], error[k] = first(state.disturbance, 0, axes), first(state.error, 0, axes)
        kernels.ensemble_loop(p, state, references[k : k + 2], nothing, nothing, kernels.UNSHIFTED)
        inputs[k], commands[k] = first(state.measured, 0, read), first(state.command, k % length * m, m)
    disturbance += references[:-1, :axes, 0] - references[:-1, -axes:, 0]  # what is not known
    return Replay(inputs, commands, disturbance, error, first(state.counts, 0, kernels.COUNT_FIELDS).copy())
