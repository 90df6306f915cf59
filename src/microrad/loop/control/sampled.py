"""The sampled loop: amplifier, clock, PID, the inverse of a hysteresis model, and margins of one axis.

Every controller is one discrete state-space form, xc[k+1] = A xc + B e, v = C xc + D e, so a loop is data.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from microrad.core import kernels, lti
from microrad.core.arrays import Complexes, Floats
from microrad.core.units import LEAST
from microrad.loop.control.analysis import LoopMargins, margins_of, real_at_half_the_rate, resolving
from microrad.mirror.hysteresis import LINE_OF_SIGHT, BoucWen, Creep
from microrad.mirror.model import Mirror
from microrad.mission.model import Control, Mission


@dataclass(frozen=True, slots=True)
class Drive:
    """Amplifier and converters between controller and mirror, seen at the amplifier's input (volts, about the bias).

    ``bandwidth_hz`` and ``slew_v_s`` may be infinite: the ideal amplifier, behind which rate-dependent hysteresis
    depends on the numerical step. A resolution of 0 is an ideal converter.
    """

    minimum_v: float
    maximum_v: float
    bandwidth_hz: float
    slew_v_s: float
    drive_resolution_v: float
    sensor_resolution_rad: float


def drive_from_mission(m: Mission) -> Drive:
    """The mission's amplifier and converters, referred to the amplifier's input and counted from the mirror's bias."""
    a = m.amplifier
    return Drive(
        minimum_v=a.output_min_v / a.gain - m.mirror.bias_v,
        maximum_v=a.output_max_v / a.gain - m.mirror.bias_v,
        bandwidth_hz=a.bandwidth_hz,
        slew_v_s=a.slew_v_s / a.gain,
        drive_resolution_v=m.control.drive_resolution_v,
        sensor_resolution_rad=m.control.sensor_resolution_rad * LINE_OF_SIGHT[m.conventions.mirror_angle],
    )


@dataclass(frozen=True, slots=True)
class Timing:
    """The sampled loop's clock: control period, plant steps in it, and computation delay in plant steps."""

    period_s: float
    steps_per_sample: int
    delay_steps: int

    @property
    def step_s(self) -> float:
        """The plant's step."""
        return self.period_s / self.steps_per_sample


def timing_from_mission(control: Control) -> Timing:
    """Whole numbers of plant steps; the mission file has already refused anything else."""
    period = 1.0 / control.rate_hz
    return Timing(period, round(period / control.plant_step_s), round(control.delay_s / control.plant_step_s))


@dataclass(frozen=True, slots=True)
class Gains:
    """PID gains: volts per radian, volts per radian second, volt seconds per radian, and the derivative's filter."""

    proportional: float
    integral: float
    derivative: float
    derivative_filter_s: float


def gains_from_mission(control: Control, mirror_gain_rad_v: float) -> Gains:
    """The mission's gains, scaled to keep the loop gain for a mirror of another gain than they are given for.

    Args:
        control: The mission's table of the control.
        mirror_gain_rad_v: Gain of the mirror that the loop is closed around.
    """
    scale = control.for_mirror_gain_rad_v / mirror_gain_rad_v
    return Gains(
        control.proportional_v_rad * scale,
        control.integral_v_rad_s * scale,
        control.derivative_v_s_rad * scale,
        control.derivative_filter_s,
    )


def pid(gains: Gains, period_s: float) -> lti.StateSpace:
    """Digital PID of one axis: v = Kp e + Ki T sum(e) + Kd filtered difference, all by backward differences.

    States, where their gains are not 0: the integral part in volts, and e behind the derivative's first-order filter.

    Args:
        gains: Its gains, from the error (rad) to the command (V).
        period_s: Control period T.
    """
    step = gains.integral * period_s
    keep = gains.derivative_filter_s / (gains.derivative_filter_s + period_s)
    edge = gains.derivative / (gains.derivative_filter_s + period_s)
    used = [step != 0.0, edge != 0.0]
    return lti.StateSpace(
        A=np.array([[1.0, 0.0], [0.0, keep]])[used][:, used],
        B=np.array([[step], [1.0 - keep]])[used],
        C=np.array([[1.0, -edge]])[:, used],
        D=np.array([[gains.proportional + step + edge]]),
    )


def anti_windup(controller: lti.StateSpace) -> Floats:
    """Conditioning gain L = B D^-1: the states follow the error that would just have reached the limit.

    Source: Hanus, Kinnaert and Henrotte, Automatica 23 (1987) 729. Zero where the controller has no direct path, and
    where it has one that no double can divide by.
    """
    direct = np.where(np.abs(controller.D) < LEAST, 0.0, controller.D)
    return np.asarray(controller.B @ np.linalg.pinv(direct))


@dataclass(frozen=True, slots=True)
class Inverse:
    """Feedforward by actuator: a direct gain (V/rad), Bouc-Wen models for Eq. 4, and play operators on the reference.

    Play thresholds are in radians and weights in V/rad; ``*_actuator`` says which drive an element belongs to.
    ``widening`` holds, by actuator, the growth of the thresholds with the reference's rate (s) and the rate in rad/s
    where it ends; none where it is empty. ``creep`` is taken off the reference, by actuator.
    """

    direct: tuple[float, ...]
    bouc_wen: tuple[BoucWen, ...] = ()
    bouc_wen_actuator: tuple[int, ...] = ()
    play_thresholds: tuple[float, ...] = ()
    play_weights: tuple[float, ...] = ()
    play_actuator: tuple[int, ...] = ()
    widening: tuple[tuple[float, float], ...] = ()
    creep: tuple[Creep, ...] = ()


def no_feedforward(m: Mirror) -> Inverse:
    """Feedback alone."""
    return Inverse(direct=(0.0,) * m.actuators)


def inverse(m: Mirror) -> Inverse:
    """Inverse of the mirror's hysteresis and creep: Eq. 4 for Bouc-Wen, the closed form for Prandtl-Ishlinskii.

    Raises:
        ValueError: For a Prandtl-Ishlinskii model without an inverse, see `PrandtlIshlinskii.inverted`.
    """
    direct = [0.0] * m.actuators
    bouc_wen, plays = [], []
    widening = [(0.0, math.inf)] * m.actuators
    for j, model in enumerate(m.inverse):
        if isinstance(model, BoucWen):
            bouc_wen.append((model, j))
        else:
            own = model.inverted()
            direct[j], widening[j] = own.weights_rad_v[0], (own.widening_s, own.rate_limit_v_s)
            plays += [(r, w, j) for r, w in zip(own.thresholds_v[1:], own.weights_rad_v[1:], strict=True)]
    return Inverse(
        tuple(direct),
        tuple(b for b, _ in bouc_wen),
        tuple(j for _, j in bouc_wen),
        tuple(r for r, _, _ in plays),
        tuple(w for _, w, _ in plays),
        tuple(j for _, _, j in plays),
        tuple(widening),
        m.inverse_creep,
    )


def inverse_arrays(of: Inverse, period_s: float) -> dict[str, Any]:
    """The inverse as the kernels' arrays, by field of `kernels.Loop` and `kernels.Ensemble`.

    Args:
        of: The inverse.
        period_s: Control period, at which its creep is advanced.
    """
    lags = [
        (weight, tau, a)
        for a, creep in enumerate(of.creep)
        for weight, tau in zip(creep.weights_rad_v, creep.time_constants_s, strict=True)
    ]
    return {
        "inverse_direct": np.array(of.direct),
        "inverse_bouc_wen": kernels.bouc_wen_rows([b.row for b in of.bouc_wen]),
        "inverse_bouc_wen_actuator": np.array(of.bouc_wen_actuator, dtype=np.uint64),
        "inverse_play_threshold": np.array(of.play_thresholds, dtype=float),
        "inverse_play_weight": np.array(of.play_weights, dtype=float),
        "inverse_play_actuator": np.array(of.play_actuator, dtype=np.uint64),
        "inverse_widening": np.array(of.widening or [(0.0, math.inf)] * len(of.direct)),
        "inverse_lag_keep": np.array([math.exp(-period_s / tau) for _, tau, _ in lags]),
        "inverse_lag_weight": np.array([weight for weight, _, _ in lags]),
        "inverse_lag_actuator": np.array([a for _, _, a in lags], dtype=np.uint64),
    }


def sampled_plant(m: Mirror, drive: Drive, timing: Timing) -> lti.StateSpace:
    """Delay, amplifier and linear mirror of one axis as the controller sees them: discrete, at the control period.

    From the command (V) to the angle (rad). The same recursion as the simulation's, at the plant's step, with the
    hysteresis replaced by its slow gain. States: mirror, amplifier output, commands on their way.

    Args:
        m: Mirror of one axis.
        drive: Its amplifier, of which the bandwidth alone counts here.
        timing: Clock of the loop.

    Raises:
        ValueError: For more than one axis or actuator.
    """
    if (m.actuators, m.axes) != (1, 1):
        raise ValueError(f"mirror {m.name!r} has {m.actuators} actuators and {m.axes} axes: give one axis at a time")
    return sampled_path(m.linear_loop, drive, timing)


def sampled_path(linear: lti.StateSpace, drive: Drive, timing: Timing) -> lti.StateSpace:
    """Delay, amplifier and a linear mirror from one of its drives, at the control period; see `sampled_plant`.

    Args:
        linear: The mirror from one drive (V) to its outputs (rad), continuous.
        drive: Its amplifier, of which the bandwidth alone counts here.
        timing: Clock of the loop.
    """
    n, d, outputs = linear.order, timing.delay_steps, linear.C.shape[0]
    Ad, B0, B1 = lti.first_order_hold(linear.A, linear.B, timing.step_s)
    follow = amplifier_factor(drive, timing.step_s)
    A, B = np.zeros((n + 1 + d, n + 1 + d)), np.zeros((n + 1 + d, 1))
    A[:n, :n], A[:n, n] = Ad, (B0 + B1 * (1.0 - follow))[:, 0]
    A[n, n] = 1.0 - follow
    source = A[:, -1] if d else B[:, 0]  # what the amplifier follows: the oldest command, or the new one
    source[:n] += B1[:, 0] * follow
    source[n] += follow
    if d:
        B[n + 1, 0] = 1.0
        A[n + 2 :, n + 1 : -1] += np.eye(d - 1)
    power, held = np.eye(n + 1 + d), np.zeros_like(B)
    for _ in range(timing.steps_per_sample):
        held = A @ held + B
        power = A @ power
    return lti.StateSpace(power, held, np.hstack([linear.C, linear.D, np.zeros((outputs, d))]), np.zeros((outputs, 1)))


def amplifier_factor(drive: Drive, step_s: float) -> float:
    """Share of the way to its target that a first-order amplifier covers in one step; 1 when ideal.

    Args:
        drive: The amplifier.
        step_s: Length of a step.
    """
    return 1.0 if math.isinf(drive.bandwidth_hz) else -math.expm1(-2.0 * math.pi * drive.bandwidth_hz * step_s)


def margins(controller: lti.StateSpace, plant: lti.StateSpace, period_s: float) -> LoopMargins:
    """Margins of controller and sampled plant under unit negative feedback.

    Args:
        controller: From the error to the command (V), one axis, discrete.
        plant: From the command (V) to the angle (rad), one axis, discrete at the same period.
        period_s: Control period.

    Raises:
        ValueError: The closed loop is unstable; names the pole.
    """
    loop = lti.series(controller, plant)
    poles = lti.feedback_poles(loop)
    worst = float(np.max(np.abs(poles), initial=0.0))
    if worst >= 1.0:
        raise ValueError(
            f"the closed loop is unstable: a pole at |z| = {worst:.6f} (the limit is 1) for a control period of "
            f"{period_s:g} s; lower the gains in [control]{_advice(controller, plant)}, or shorten its delay"
        )

    def response(freq_hz: Floats) -> Complexes:
        L = lti.frequency_response(loop, freq_hz, period_s)[:, 0, 0]
        return real_at_half_the_rate(L, freq_hz * period_s)

    return margins_of(response, resolving(np.concatenate([poles, np.linalg.eigvals(loop.A)]), period_s))


def _advice(controller: lti.StateSpace, plant: lti.StateSpace) -> str:
    """By how much, for 6 dB of gain margin; nothing where no smaller gain makes the loop stable."""

    def stable(share: float) -> bool:
        less = lti.StateSpace(controller.A, controller.B, share * controller.C, share * controller.D)
        return slowest_pole(lti.series(less, plant)) < 1.0

    share = next((float(s) for s in 0.95 ** np.arange(1, 200) if stable(s) and stable(s / 2)), 0.0)
    return f" (with all of them at {share / 2:.2g} of what they are it has 6 dB of gain margin)" if share else ""


def slowest_pole(loop: lti.StateSpace) -> float:
    """Largest |z| among the poles of the discrete ``loop`` closed with unit negative feedback; unstable from 1 up."""
    return float(np.max(np.abs(lti.feedback_poles(loop)), initial=0.0))


def sensitivity(loop: lti.StateSpace, freq_hz: float, period_s: float) -> complex:
    """Error over reference, 1 / (1 + L), of a closed loop at one frequency.

    Args:
        loop: Loop gain L, discrete, from the error to the output of one axis.
        freq_hz: The frequency, up to half the control rate.
        period_s: Control period.
    """
    return complex(1.0 / (1.0 + lti.frequency_response(loop, np.array([freq_hz]), period_s)[0, 0, 0]))
