"""A fine-pointing loop as data: mirror, optics, amplifier, clock, disturbances, sensors, reference; its controller."""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.loop.control import Adaptation, AxisController, Drive, Inverse, Timing, adaptation, sampled_path
from microrad.loop.disturbance import Disturbance, Misalignment, Reference, SampledReference
from microrad.loop.sensor import OpticalSensor, StrainGauge
from microrad.mirror.hysteresis import BoucWen, PrandtlIshlinskii, gain_only, slow_gain
from microrad.mirror.model import Mirror


@dataclass(frozen=True, slots=True)
class PointingLoop:
    """What a pointing controller works in. All angles are line-of-sight angles outside the telescope, in rad.

    ``optics`` (axes, outputs) turns the mirror's outputs into line-of-sight angles. ``disturbances`` has, by axis, what
    adds to the error; ``references`` the known part of it. ``drive_range_v`` is the range about the bias in which the
    mirror was identified. ``held`` (rows, outputs) are sums of the mirror's outputs that its drives are to leave where
    they are, such as a piston. ``unknown`` has, by axis, the course of what else adds to the error, of which no
    controller knows; it may be empty. The error is reference + unknown + disturbance - mirror.
    """

    mirror: Mirror
    optics: Floats
    drive: Drive
    timing: Timing
    disturbances: tuple[tuple[Disturbance, ...], ...]
    optical: OpticalSensor
    gauge: StrainGauge | None
    references: tuple[Reference, ...]
    drive_range_v: tuple[float, float] = (-math.inf, math.inf)
    held: Floats | None = None
    unknown: tuple[Misalignment | SampledReference, ...] = ()

    @property
    def axes(self) -> int:
        """Number of line-of-sight axes."""
        return int(self.optics.shape[0])


def in_band_gain(m: Mirror) -> Floats:
    """Slow gain from drives to outputs without what creep adds, shape (outputs, actuators).

    A mirror whose hysteresis lies in a stiffness names no model to invert: its gain at rest counts.
    """
    if m.inverse:
        return np.diag([slow_gain(model) for model in m.inverse])
    linear = m.linear_loop
    return np.asarray(linear.D - linear.C @ np.linalg.solve(linear.A, linear.B))


def without_hysteresis(loop: PointingLoop) -> PointingLoop:
    """The loop with each hysteresis element replaced by its slow gain."""
    m = loop.mirror
    straight = tuple(gain_only(model) for model in m.bank)
    inverse = tuple(gain_only(model) for model in m.inverse)
    return replace(loop, mirror=replace(m, bouc_wen=straight, plays=(), inverse=inverse))


@dataclass(frozen=True, slots=True, eq=False)
class ForwardHysteresis:
    """Hysteresis elements that a controller runs on the wanted motion: a bank as that of `Mirror`, Bouc-Wen first.

    ``drives`` (actuators, elements) are the volts that a unit of each element's output adds to the commands.
    """

    bouc_wen: tuple[BoucWen, ...]
    plays: tuple[PrandtlIshlinskii, ...]
    drives: Floats

    @property
    def bank(self) -> tuple[BoucWen | PrandtlIshlinskii, ...]:
        """The elements in the order of the columns of ``drives``."""
        return (*self.bouc_wen, *self.plays)


@dataclass(frozen=True, slots=True)
class LoopController:
    """A controller of all axes: x[k+1] = A x + B m + L (clip(v) - v), as `kernels.Ensemble` takes it.

    ``system`` has the inputs optical error by axis, gauge reading by mirror output, reference by axis (all rad), and
    the outputs v by actuator (V) and, with an ``inverse``, the inverse's target (rad at the mirror's output) and its
    rate (rad/s) by actuator, and then, with ``forward``, what drives each of its elements. ``anti_windup`` is L,
    (states, actuators). With an ``adaptation`` the inverse's plays learn on line; the last outputs are then the gauge's
    readings less those that the targets make expect, rad, by actuator, and no rate is needed.
    """

    name: str
    system: lti.StateSpace
    anti_windup: Floats
    inverse: Inverse | None = None
    forward: ForwardHysteresis | None = None
    adaptation: Adaptation | None = None


@dataclass(frozen=True, slots=True)
class ReferenceFilter:
    """Second-order low-pass that a feedforward's target and its rate are taken from, critically damped.

    Its state is the target and the rate, so the rate is never a difference of noisy samples.
    """

    bandwidth_hz: float

    def discrete(self, period_s: float) -> lti.StateSpace:
        """Input: wanted angle; outputs: target and its rate, at the control period, for an input held over it."""
        w = 2.0 * math.pi * self.bandwidth_hz
        A, B = np.array([[0.0, 1.0], [-w * w, -2.0 * w]]), np.array([[0.0], [w * w]])
        Ad, Bd = lti.zero_order_hold(A, B, period_s)
        # Outputs are those at the end of the sample: the input of a sample acts in it, without a sample's delay.
        return lti.StateSpace(Ad, Bd, Ad, Bd)


def assemble(name: str, loop: PointingLoop, axis: AxisController) -> LoopController:
    """The same controller on each axis, with commands and gauge readings decoupled by the loop's optics.

    Args:
        name: What the controller is called.
        loop: The loop.
        axis: The controller of one axis.

    Raises:
        ValueError: It reads a gauge that the loop lacks.
    """
    axes = loop.axes
    eye, s, to_drives = np.eye(axes), axis.system, decoupling(loop)
    by_gauge = np.kron(loop.optics, s.B[:, 1:2]), s.D[0, 1] * loop.optics
    if loop.gauge is None and (np.any(s.B[:, 1]) or np.any(s.D[:, 1])):
        raise ValueError(f"controller {name!r} reads a strain gauge, and this loop has none: give it one, or another")
    B = np.hstack([np.kron(eye, s.B[:, :1]), by_gauge[0], np.zeros((axes * s.order, axes))])
    D = np.hstack([s.D[0, 0] * eye, by_gauge[1], np.zeros((axes, axes))])
    A, C, windup = (np.asarray(np.kron(eye, each), dtype=float) for each in (s.A, s.C, axis.anti_windup))
    return _on_drives(name, to_drives, lti.StateSpace(A, B, C, D), windup)


def assemble_whole(name: str, loop: PointingLoop, system: lti.StateSpace, anti_windup: Floats) -> LoopController:
    """One controller of all axes, with its commands decoupled; it looks at the optical errors alone.

    Args:
        name: What the controller is called.
        loop: The loop.
        system: From the optical error of each axis (rad) to the command of each (V).
        anti_windup: What a cut-off command of each axis adds to the states, shape (states, axes).
    """
    others = loop.mirror.axes + loop.axes  # gauge readings, references
    B, D = (np.pad(each, ((0, 0), (0, others))) for each in (system.B, system.D))
    return _on_drives(name, decoupling(loop), lti.StateSpace(system.A, B, system.C, D), anti_windup)


def _on_drives(name: str, to_drives: Floats, axes: lti.StateSpace, anti_windup: Floats) -> LoopController:
    """A controller of axis commands as one of drives."""
    system = lti.StateSpace(axes.A, axes.B, to_drives @ axes.C, to_drives @ axes.D)
    return LoopController(name, system, anti_windup @ np.linalg.pinv(to_drives))


def with_inverse(
    name: str, loop: PointingLoop, axis: AxisController, inverse: Inverse, path: ReferenceFilter, in_series: bool
) -> LoopController:
    """The controller with an inverse of the mirror's hysteresis, driven through the reference filter.

    Args:
        name: What the controller is called.
        loop: The loop.
        axis: The controller of one axis.
        inverse: Inverse of the mirror's hysteresis.
        path: The reference filter.
        in_series: Whether the controller's own command goes through the inverse too, as an angle, so that it
            straightens the mirror inside the loop; else the reference alone drives it (feedforward, as in the paper).

    Raises:
        ValueError: The inverse inverts nothing (a mirror whose hysteresis lies in a stiffness has none), or the
            controller reads a gauge that the loop lacks.
    """
    if not any(inverse.direct) and not inverse.bouc_wen:
        raise ValueError(
            f"controller {name!r}: mirror {loop.mirror.name!r} has no inverse: its hysteresis lies in a stiffness, "
            "inside the resonance, and not ahead of it; use with_feedforward, which runs it forward"
        )
    feedback = assemble(name, loop, axis)
    f, m, axes = feedback.system, loop.mirror.actuators, loop.axes
    to_mirror, share = np.linalg.pinv(loop.optics), 1.0 if in_series else 0.0
    # Wanted mirror angles (outputs): the reference's, and what the command would move a straight mirror by.
    gains = in_band_gain(loop.mirror)
    reference = np.hstack([np.zeros((gains.shape[0], f.B.shape[1] - axes)), to_mirror])
    into, through = share * gains @ f.C, reference + share * gains @ f.D
    low_pass = path.discrete(loop.timing.period_s)
    eye = np.eye(gains.shape[0])
    A, B = np.kron(eye, low_pass.A), np.kron(eye, low_pass.B)
    outputs = [np.kron(eye, row) for row in np.eye(2)[:, None, :]]  # the target, then its rate
    volts = 1.0 - share
    system = lti.StateSpace(
        np.block([[f.A, np.zeros((f.order, A.shape[0]))], [B @ into, A]]),
        np.vstack([f.B, B @ through]),
        np.vstack(
            [
                np.hstack([volts * f.C, np.zeros((m, A.shape[0]))]),
                *(np.hstack([row @ B @ into, row @ A]) for row in outputs),
            ]
        ),
        np.vstack([volts * f.D, *(row @ B @ through for row in outputs)]),
    )
    windup = np.vstack([feedback.anti_windup, np.zeros((A.shape[0], m))])
    return LoopController(name, system, windup, inverse)


EXPECTED_WITHIN = 0.02
"""Largest error of the response from a target to the reading that is expected of it, as a share of the slow one."""


def expected_reading(loop: PointingLoop, actuator: int) -> lti.StateSpace:
    """From the target of an inverse to the gauge's reading: delay, amplifier and linear mirror, of low order.

    Args:
        loop: The loop.
        actuator: Which of its actuators, from 0; it has the mirror's output of that number.
    """
    m = loop.mirror
    linear = m.linear([slow_gain(model) for model in m.bank])
    own = slice(actuator, actuator + 1)  # what goes through the hysteresis: creep is on the inverse's side
    through = lti.StateSpace(linear.A, (linear.B - m.B)[:, own], linear.C[own], (linear.D - m.D)[own, own])
    sampled = sampled_path(through, loop.drive, loop.timing)
    unit = replace(sampled, C=sampled.C / slow_gain(m.inverse[actuator]))
    return lti.system_to_bits(lti.reduced(unit, EXPECTED_WITHIN), lti.EXACT_BITS)


def with_adaptation(made: LoopController, loop: PointingLoop) -> LoopController:
    """The controller with its inverse in series made one that learns from the strain gauge.

    Args:
        made: A controller `with_inverse`, in series.
        loop: The loop.

    Raises:
        ValueError: The loop has no strain gauge, or its mirror's hysteresis is none that can be learnt; says why.
    """
    if loop.gauge is None:
        raise ValueError(
            f"controller {made.name!r} learns from a strain gauge, and this loop has none: give it one "
            "(fine_pointing.strain_gauge), or take the frozen inverse"
        )
    s, m = made.system, loop.mirror.actuators
    expected = [expected_reading(loop, a) for a in range(m)]
    A, B, C, D = (block_diag(*(getattr(each, key) for each in expected)) for key in "ABCD")
    reading = np.zeros((m, s.B.shape[1]))
    reading[:, loop.axes : loop.axes + m] = np.eye(m)
    target = slice(m, 2 * m)
    C_made, D_made = s.C.copy(), s.D.copy()
    C_made[2 * m :], D_made[2 * m :] = 0.0, 0.0  # plays that do not widen need no rate
    system = lti.StateSpace(
        np.block([[s.A, np.zeros((s.order, len(A)))], [B @ s.C[target], A]]),
        np.vstack([s.B, B @ s.D[target]]),
        np.block([[C_made, np.zeros((len(s.C), len(A)))], [-D @ s.C[target], -C]]),
        np.vstack([D_made, reading - D @ s.D[target]]),
    )
    windup = np.vstack([made.anti_windup, np.zeros((len(A), m))])
    noise = math.hypot(loop.gauge.noise_rad, loop.gauge.resolution_rad / math.sqrt(12.0))
    drive = loop.drive
    swing = max(abs(drive.minimum_v), abs(drive.maximum_v))
    delay = max(1, round(max(map(_delay_samples, expected))))
    learnt = adaptation(loop.mirror.inverse, noise, delay, swing)
    return replace(made, system=system, anti_windup=windup, adaptation=learnt)


def _delay_samples(system: lti.StateSpace) -> float:
    """Delay of slow signals through a discrete system of unit slow gain: -dG/dz at z = 1."""
    resolvent = np.linalg.inv(np.eye(system.order) - system.A)
    return float((system.C @ resolvent @ resolvent @ system.B)[0, 0])


def decoupling(loop: PointingLoop) -> Floats:
    """Axis commands (V) to drives, (actuators, axes): each moves its axis by `nominal_axis_gain`, and no piston."""
    return np.asarray(nominal_axis_gain(loop) * _drives_for_angles(loop))


def nominal_axis_gain(loop: PointingLoop) -> float:
    """Slow gain from an axis command (V) to its line-of-sight angle (rad/V): what axis controllers are designed for.

    The largest with which no drive gets more than the axis command.
    """
    return float(1.0 / np.max(np.abs(_drives_for_angles(loop))))


def _drives_for_angles(loop: PointingLoop) -> Floats:
    """Slow drives (V) for line-of-sight angles (rad), shape (actuators, axes): those that move least of what is held.

    Of what is free beyond that, the drives are the least.
    """
    gain = in_band_gain(loop.mirror)
    if loop.mirror.inverse:  # each actuator has its own output, and the least strokes are wanted
        return np.asarray(np.linalg.pinv(loop.optics) / np.diag(gain)[:, None])
    seen = loop.optics @ gain
    drives = np.linalg.pinv(seen)
    if loop.held is None:
        return np.asarray(drives)
    free = np.linalg.svd(seen)[2][loop.axes :].T  # drives that move no axis
    return np.asarray(drives - free @ np.linalg.pinv(loop.held @ gain @ free) @ (loop.held @ gain @ drives))
