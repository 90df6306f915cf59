"""Assemble one sampled loop, run the kernel, and keep what came out with its counters."""

import math
from dataclasses import dataclass

import numpy as np

from microrad import mirror
from microrad.core import kernels, lti
from microrad.core.arrays import Floats
from microrad.loop import control
from microrad.loop.control import Drive, Inverse, Timing, amplifier_factor, anti_windup
from microrad.mirror import Mirror

# Plant steps between two returns from the kernel, about 0.1 s, so that an interrupt is answered promptly.
SLICE_STEPS = 1_000_000


@dataclass(frozen=True, slots=True)
class Counts:
    """What a result must be read with; each over the whole run, all actuators together.

    clamped: plant steps beyond the identified rate. inverse_clamped: the same in the feedforward. saturated: samples at
    the drive's limits. slew_limited: plant steps at the amplifier's slew limit. alternating: reversals of the command
    within 10 samples of the last one, in moves larger than two steps of the converter.
    """

    clamped: int
    inverse_clamped: int
    saturated: int
    slew_limited: int
    alternating: int


@dataclass(frozen=True, slots=True)
class Trace:
    """One run of the sampled loop, at the control samples.

    ``reference_rad``, ``output_rad``: (samples, axes). ``command_v``, ``drive_v``: (samples, actuators), before and
    behind the amplifier, about the bias. ``steady`` is the part that statistics are taken of.
    """

    name: str
    time_s: Floats
    reference_rad: Floats
    output_rad: Floats
    command_v: Floats
    drive_v: Floats
    steady: slice
    counts: Counts

    @property
    def error_rad(self) -> Floats:
        """Reference minus output, (samples, axes)."""
        return self.reference_rad - self.output_rad

    @property
    def peak_rad(self) -> float:
        """Largest magnitude of the error in the steady part, over all axes."""
        return float(np.max(np.abs(self.error_rad[self.steady])))

    @property
    def rms_rad(self) -> float:
        """Root mean square of the error in the steady part, over all axes."""
        return float(np.sqrt(np.mean(self.error_rad[self.steady] ** 2)))

    def left_rad(self, statistic: str) -> float:
        """The error that is left in the steady part, by its "peak" or by its "rms"."""
        return self.peak_rad if statistic == "peak" else self.rms_rad


@dataclass(frozen=True, slots=True)
class Setup:
    """What stands around a mirror: amplifier and converters, the clock, and the controller (one axis each)."""

    drive: Drive
    timing: Timing
    controller: lti.StateSpace


def sampled_loop(m: Mirror, setup: Setup) -> lti.StateSpace:
    """Controller and sampled mirror in series: from the error to the angle (rad), discrete at the control period.

    Each hysteresis element is replaced by its slow gain.

    Args:
        m: Mirror of one axis.
        setup: What stands around it.

    Raises:
        ValueError: For a mirror of more than one axis.
    """
    return lti.series(setup.controller, control.sampled_plant(m, setup.drive, setup.timing))


def margins(m: Mirror, setup: Setup) -> control.LoopMargins:
    """Margins of the loop as it is sampled.

    Args:
        m: Mirror of one axis.
        setup: What stands around it.

    Raises:
        ValueError: The loop is unstable, or the mirror has more than one axis.
    """
    plant = control.sampled_plant(m, setup.drive, setup.timing)
    return control.margins(setup.controller, plant, setup.timing.period_s)


def assemble(m: Mirror, setup: Setup, inverse: Inverse) -> kernels.Loop:
    """The loop around a mirror as the kernel's arrays. Axis i commands actuator i.

    Args:
        m: The mirror.
        setup: What stands around it.
        inverse: The feedforward.
    """
    drive, timing, controller = setup.drive, setup.timing, setup.controller
    actuators = m.actuators

    follow, slew = amplifier_factor(drive, timing.step_s), drive.slew_v_s * timing.step_s
    row = np.array([drive.minimum_v, drive.maximum_v, drive.drive_resolution_v, follow, slew])
    unrolled = mirror.unrolled(m) and controller.order <= kernels.UNROLLED_CONTROLLER
    loop = kernels.Loop(
        **kernels.counts(unrolled, actuators=actuators, axes=m.axes, states=controller.order),
        feedforward=bool(any(inverse.direct) or inverse.bouc_wen),
        steps_per_sample=timing.steps_per_sample,
        delay_steps=timing.delay_steps,
        Ac=controller.A.copy(),
        Bc=controller.B.copy(),
        Cc=controller.C.copy(),
        Dc=controller.D.copy(),
        L=anti_windup(controller),
        actuator=np.tile(row, (actuators, 1)),
        sensor_resolution=np.full(m.axes, drive.sensor_resolution_rad),
        allocation=np.eye(actuators, m.axes),
        **control.inverse_arrays(inverse, timing.period_s),
    )
    return kernels.by_rows(loop)


def at_rest(loop: kernels.Loop) -> kernels.LoopState:
    """A fresh state of the loop: everything zero."""
    states, actuators = loop.L.shape
    axes = loop.sensor_resolution.size
    return kernels.LoopState(
        x=np.zeros(states),
        x_next=np.zeros(states),
        error=np.zeros(axes),
        output=np.zeros(actuators),
        command=np.zeros(actuators),
        target=np.zeros((actuators, 2)),
        inverse_h=np.zeros(loop.inverse_bouc_wen.shape[0]),
        inverse_p=np.zeros(loop.inverse_play_threshold.size),
        inverse_lag=np.zeros(loop.inverse_lag_keep.size),
        pending=np.zeros((loop.delay_steps + 1, actuators)),
        position=np.zeros(1, dtype=np.int64),
        counts=np.zeros((actuators, 2), dtype=np.int64),
        inverse_clamped=np.zeros(loop.inverse_bouc_wen.shape[0] + actuators, dtype=np.int64),
    )


def track(name: str, m: Mirror, setup: Setup, inverse: Inverse, reference_rad: Floats, steady: slice) -> Trace:
    """Run the sampled loop from rest over a reference.

    Args:
        name: What the run is called.
        m: The mirror.
        setup: What stands around it.
        inverse: The feedforward.
        reference_rad: Wanted angles at the control samples, shape (samples, axes).
        steady: The samples that statistics are taken of.

    Raises:
        ValueError: The mirror cannot be simulated at the plant's step, see `mirror.discretise`.
    """
    drive, timing = setup.drive, setup.timing
    plant = mirror.discretise(m, timing.step_s)
    loop = assemble(m, setup, inverse)
    plant_state, loop_state = mirror.at_rest(plant), at_rest(loop)
    samples = reference_rad.shape[0]
    output = np.empty((samples, m.axes))
    command, applied = np.empty((samples, m.actuators)), np.empty((samples, m.actuators))
    block = max(1, SLICE_STEPS // timing.steps_per_sample)
    for start in range(0, samples, block):
        part = slice(start, start + block)
        kernels.closed_loop(
            plant, plant_state, loop, loop_state, reference_rad[part], output[part], command[part], applied[part]
        )
    counts = Counts(
        clamped=int(plant_state.clamped.sum()),
        inverse_clamped=int(loop_state.inverse_clamped.sum()),
        saturated=int(loop_state.counts[:, kernels.SATURATED].sum()),
        slew_limited=int(loop_state.counts[:, kernels.SLEW_LIMITED].sum()),
        alternating=alternations(command, 2.0 * drive.drive_resolution_v),
    )
    time: Floats = np.arange(samples, dtype=float) * timing.period_s
    return Trace(name, time, reference_rad, output, command, applied, steady, counts)


CHATTER_SAMPLES = 10  # reversals nearer to each other than this are chatter, not the reference


def alternations(command: Floats, threshold: float) -> int:
    """Count the reversals of the command that follow the last one within 10 samples.

    A zigzag from sample to sample counts at every sample, a limit cycle of a few samples twice a cycle, and a reversal
    of a smooth reference not at all.

    Args:
        command: The command (V), shape (samples, actuators).
        threshold: Moves of the command (V) up to this size are not looked at.
    """
    count = 0
    for column in command.T:
        step = np.diff(column)
        moves = np.flatnonzero(np.abs(step) > threshold)
        turns = moves[1:][step[moves[1:]] * step[moves[:-1]] < 0.0]
        count += int(np.count_nonzero(np.diff(turns) <= CHATTER_SAMPLES))
    return count


def track_sine(name: str, m: Mirror, setup: Setup, inverse: Inverse, amplitude_rad: float, freq_hz: float) -> Trace:
    """Track a sine on one axis, with statistics over its steady part, see `sine`.

    Args:
        name: What the run is called.
        m: Mirror of one axis.
        setup: What stands around it.
        inverse: The feedforward.
        amplitude_rad: Amplitude of the sine.
        freq_hz: Its frequency.

    Raises:
        ValueError: The mirror cannot be simulated at the plant's step, see `mirror.discretise`.
    """
    return track(name, m, setup, inverse, *sine(amplitude_rad, freq_hz, setup.timing.period_s))


def sine(amplitude_rad: float, freq_hz: float, period_s: float, settle_s: float = 0.2) -> tuple[Floats, slice]:
    """A sine reference of one axis, shape (samples, 1), and its steady part.

    The steady part is whole periods, as many as make 200 samples or more; before it come whole periods, one at least.

    Args:
        amplitude_rad: Amplitude of the sine.
        freq_hz: Its frequency.
        period_s: Control period.
        settle_s: Least time before the steady part.
    """
    shown = math.ceil(200 * freq_hz * period_s)
    periods = shown + max(1, math.ceil(settle_s * freq_hz))
    samples = round(periods / freq_hz / period_s)
    steady = slice(samples - round(shown / freq_hz / period_s), samples)
    time = np.arange(samples) * period_s
    return amplitude_rad * np.sin(2 * np.pi * freq_hz * time)[:, None], steady
