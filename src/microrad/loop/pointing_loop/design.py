"""The plant that a controller of one axis, or of all of them, is designed for."""

from dataclasses import replace

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.loop.control import AxisController, DesignPlant, WholePlant
from microrad.loop.disturbance import Disturbance
from microrad.loop.pointing_loop.linear import ClosedLoop, close, gauge_noise_rad, open_loop
from microrad.loop.pointing_loop.loop import PointingLoop, assemble, decoupling, nominal_axis_gain


def design_plant(loop: PointingLoop) -> DesignPlant:
    """What a controller of one axis of this loop is designed for. ``loop`` has one axis.

    A sensor slower than the control is taken as one that delivers every sample, later by half of what its hold adds and
    with the noise that it spreads to low frequencies; disturbance lines are taken as narrow bands of noise.

    Raises:
        ValueError: For a loop of more axes or actuators.
    """
    if loop.axes != 1 or loop.mirror.actuators != 1:
        raise ValueError(
            f"a design needs a loop of one axis with one actuator, not of {loop.axes} with {loop.mirror.actuators}: "
            "design each axis by itself"
        )
    sampled, disturbances = _sampled(loop, decoupling(loop))
    s, rows = sampled, np.zeros((1, sampled.order))
    gauge = np.zeros((1, s.B.shape[1]))
    has_gauge = loop.gauge is not None
    if has_gauge:
        rows, gauge[0, -1] = s.C[2:], gauge_noise_rad(loop) * abs(float(loop.optics[0, 0]))
    found = lti.StateSpace(s.A, s.B, np.vstack([s.C[:2], rows]), np.vstack([s.D[:2], gauge]))
    exact = lti.system_to_bits(found, lti.DESIGN_BITS)
    return DesignPlant(loop.timing.period_s, exact, disturbances, nominal_axis_gain(loop), True, has_gauge)


def whole_plant(loop: PointingLoop, to_drives: Floats) -> WholePlant:
    """What controllers of all axes of this loop are designed for; sensor and lines as in `design_plant`.

    Args:
        loop: The loop; a gauge is not looked at.
        to_drives: Commands of the axes to drives, shape (actuators, axes): `decoupling` of this loop or of one like it.
    """
    m = loop.mirror
    commanded = replace(m, B=m.B @ to_drives, G=m.G @ to_drives, D=m.D @ to_drives)  # an amplifier for each command
    s, disturbances = _sampled(replace(loop, mirror=commanded), np.eye(loop.axes))
    white, axes = s.B.shape[1] - 1, loop.axes  # without the gauge's noise
    seen = lti.StateSpace(s.A, s.B[:, :white], s.C[: 2 * axes], s.D[: 2 * axes, :white])
    exact = lti.system_to_bits(seen, lti.DESIGN_BITS)
    return WholePlant(loop.timing.period_s, exact, axes, disturbances, nominal_axis_gain(loop))


def driven_plant(loop: PointingLoop) -> lti.StateSpace:
    """All axes of this loop over a control period, without disturbances and noise; sensor as in `design_plant`.

    Inputs: commands of the actuators. Outputs: residuals, optical readings, and the mirror at the line of sight.

    Args:
        loop: The loop.
    """
    actuators = loop.mirror.actuators
    s, _ = _sampled(loop, np.eye(actuators))
    return lti.system_to_bits(lti.StateSpace(s.A, s.B[:, :actuators], s.C, s.D[:, :actuators]), lti.DESIGN_BITS)


def _sampled(loop: PointingLoop, to_drives: Floats) -> tuple[lti.StateSpace, int]:
    """The loop over a control period, and the number of white sequences behind its disturbances.

    Inputs: commands, white sequences, optical noise by axis, one for a gauge. Outputs: residuals, optical readings, and
    the mirror at the line of sight without a gauge's noise.
    """
    spread = np.sqrt(loop.optical.every)  # of a hold's noise to low frequencies
    random = tuple(tuple(narrow_band(each) for each in several) for several in loop.disturbances)
    loop = replace(read_each_sample(loop), disturbances=random)
    o, axes = open_loop(loop), loop.axes
    keep = np.ones(o.at.order, dtype=bool)
    keep[o.at.held] = False
    shift = o.shift.copy()
    shift[o.newest] = 0.0
    period, command, factor = (
        np.eye(o.at.order),
        np.zeros((o.at.order, to_drives.shape[1])),
        np.zeros((o.at.order, o.at.order)),
    )
    for step in o.steps:
        period = step @ period
        factor = step @ factor @ step.T + o.noise @ o.noise.T
    command[o.newest] = to_drives
    root = lti.covariance_root(factor)
    noises = root[:, np.any(root != 0.0, axis=0)]
    B = np.hstack([(period @ command), noises, np.zeros((o.at.order, axes + 1))])[keep]
    A = (period @ shift)[np.ix_(keep, keep)]
    rows = np.vstack([o.error, o.reading, loop.optics @ o.mirror])[:, keep]
    D = np.zeros((3 * axes, B.shape[1]))
    D[axes : 2 * axes, -1 - axes : -1] = loop.optical.noise_rad * spread * np.eye(axes)
    noise = to_drives.shape[1]
    B[:, noise:] = lti.to_bits(B[:, noise:], lti.EXACT_BITS)
    return lti.StateSpace(A, B, rows, D), noises.shape[1]


def sampled_mirrors(loop: PointingLoop, mirrors: lti.StateSpace) -> lti.StateSpace:
    """A stack of mirrors in the loop over a control period, without disturbances; sensor as in `design_plant`.

    Inputs: commands of the actuators. Outputs: optical readings by axis, and the mirror's own outputs.

    Args:
        loop: The loop.
        mirrors: A stack of linear mirrors, continuous, of the size of the loop's own.
    """
    o = open_loop(replace(read_each_sample(loop), disturbances=((),) * loop.axes), mirrors)
    keep = np.ones(o.at.order, dtype=bool)
    keep[o.at.held] = False
    shift, period = o.shift.copy(), np.eye(o.at.order)
    shift[o.newest] = 0.0
    for step in o.steps:
        period = step @ period
    reading = np.broadcast_to(o.reading, (*o.mirror.shape[:-2], *o.reading.shape))
    rows = np.concatenate([reading, o.mirror], axis=-2)[..., keep]
    A, B = (period @ shift)[..., keep, :][..., keep], period[..., keep, o.newest]
    return lti.StateSpace(A, B, rows, np.zeros((rows.shape[-2], B.shape[-1])))


def read_each_sample(loop: PointingLoop) -> PointingLoop:
    """The loop with an optical sensor that delivers every control sample, later by half of what its hold adds."""
    extra = round(0.5 * (loop.optical.every - 1) * loop.timing.steps_per_sample)
    return replace(loop, optical=replace(loop.optical, every=1, delay_steps=loop.optical.delay_steps + extra))


def close_axis(loop: PointingLoop, controller: AxisController) -> ClosedLoop:
    """The linear loop of one axis under an axis controller.

    Args:
        loop: Loop of one axis.
        controller: Its controller.

    Raises:
        ValueError: The controller reads a gauge that the loop lacks.
    """
    return close(loop, assemble(controller.name, loop, controller))


LINE_DAMPING = 1e-3
"""Damping ratio of the narrow band that stands for a line in a design: a wheel's speed is known to about that."""


def narrow_band(each: Disturbance) -> Disturbance:
    """The disturbance with each line replaced by noise of the same power in a narrow band about its frequency."""
    size = each.A.shape[0] + 2 * len(each.lines)
    A, B = np.zeros((size, size)), np.zeros((size, each.B.shape[1] + 2 * len(each.lines)))
    C = np.zeros((1, size))
    n, w = each.B.shape
    A[:n, :n], B[:n, :w], C[:, :n] = each.A, each.B, each.C
    for i, line in enumerate(each.lines):
        here, natural = slice(n + 2 * i, n + 2 * i + 2), 2.0 * np.pi * line.freq_hz
        A[here, here] = natural * np.array([[-LINE_DAMPING, 1.0], [-1.0, -LINE_DAMPING]])
        B[here, w + 2 * i : w + 2 * i + 2] = line.amplitude_rad * np.sqrt(LINE_DAMPING * natural) * np.eye(2)
        C[0, n + 2 * i] = 1.0
    return replace(each, A=A, B=B, C=C, lines=())


def behind_filter(plant: DesignPlant, low_pass: lti.StateSpace) -> DesignPlant:
    """The plant with a filter in its command path: for an inverse in series.

    Args:
        plant: The plant of one axis.
        low_pass: Filter from the command to the command that the plant gets, discrete at the plant's control period;
            its first output counts.
    """
    s, f = plant.system, low_pass
    first = lti.StateSpace(f.A, f.B, f.C[:1], f.D[:1])
    n, k = s.order, f.order
    through = s.B[:, :1] @ first.C
    A = np.block([[s.A, through], [np.zeros((k, n)), f.A]])
    B = np.vstack([s.B, np.zeros((k, s.B.shape[1]))])
    B[:n, :1], B[n:, :1] = s.B[:, :1] @ first.D, f.B
    C = np.hstack([s.C, np.zeros((s.C.shape[0], k))])
    return replace(plant, system=lti.StateSpace(A, B, C, s.D))
