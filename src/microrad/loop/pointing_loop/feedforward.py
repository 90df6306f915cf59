"""Feedforward of the known reference for a mirror whose hysteresis lies in a stiffness.

A hysteretic spring needs no inverse. What moves it is the mirror's own motion, and that is to follow the reference: the
springs are run forward on the motion that is wanted, and the drives make up for their forces.

    q = Q r        z = H[q]        u = P (r - Y (z - k q))

P are the slow drives for line-of-sight angles, Y the slow line of sight by element and Q the slow motion of the
elements, all about rest, where each element has the gain k. Weights and thresholds may be any, as no operator is
inverted. For slow motions it is exact where the line of sight fixes what moves the elements, as on one axis with one
spring; where springs bend other modes as well it is so to first order in z - k q.

What follows a drive late (delay, hold, amplifier, mirror below its resonances) is made up for by the reference's rate:
r stands for the filtered reference plus so many seconds of its rate. What is left is of second order in frequency times
delay. Zeros in the right half plane do not matter: of the mirror nothing but its slow answer is inverted.
"""

from dataclasses import replace

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.loop.pointing_loop.design import whole_plant
from microrad.loop.pointing_loop.loop import (
    ForwardHysteresis,
    LoopController,
    PointingLoop,
    ReferenceFilter,
    decoupling,
    nominal_axis_gain,
)
from microrad.mirror.hysteresis import rest_gain
from microrad.mirror.model import linearised


def with_feedforward(name: str, loop: PointingLoop, feedback: LoopController, path: ReferenceFilter) -> LoopController:
    """The controller with a feedforward of the reference that runs the mirror's hysteresis on the wanted motion.

    Args:
        name: What the controller is called.
        loop: The loop, with the mirror and its hysteresis.
        feedback: The controller that it is added to.
        path: The reference filter.

    Raises:
        ValueError: The mirror's hysteresis lies ahead of its linear part, or the controller has an inverse or a
            feedforward already.
    """
    m, f, axes = loop.mirror, feedback.system, loop.axes
    if m.inverse:
        raise ValueError(
            f"controller {name!r}: the hysteresis of mirror {m.name!r} lies ahead of its linear part, where it has an "
            "inverse; use with_inverse"
        )
    if feedback.inverse is not None or feedback.forward is not None:
        raise ValueError(
            f"controller {name!r}: {feedback.name!r} has an inverse or a feedforward of the reference already, and two "
            "would drive the mirror twice as far; give the feedback alone"
        )
    gains = np.array([rest_gain(model) for model in m.bank])
    rest = replace(loop, mirror=linearised(m, gains.tolist()))
    angles = decoupling(rest) / nominal_axis_gain(rest)  # P; motion is Q, and drives are -P Y
    moved, bent = np.linalg.solve(-rest.mirror.A, rest.mirror.B), np.linalg.solve(-rest.mirror.A, m.E)
    motion = (m.F @ moved + m.G) @ angles
    drives = -angles @ loop.optics @ (rest.mirror.C @ bent + m.K)
    outputs = lti.to_bits(np.vstack([angles - drives * gains @ motion, motion]), lti.DESIGN_BITS)
    wanted = _ahead(rest, path)
    known = np.eye(axes, f.B.shape[1], f.B.shape[1] - axes)  # the references among the inputs
    more = ((0, len(m.bank)), (0, 0))  # feedback drives no element
    system = lti.StateSpace(
        np.block([[f.A, np.zeros((f.order, wanted.order))], [np.zeros((wanted.order, f.order)), wanted.A]]),
        np.vstack([f.B, wanted.B @ known]),
        np.hstack([np.pad(f.C, more), outputs @ wanted.C]),
        np.pad(f.D, more) + outputs @ wanted.D @ known,
    )
    windup = np.vstack([feedback.anti_windup, np.zeros((wanted.order, m.actuators))])
    forward = ForwardHysteresis(m.bouc_wen, m.plays, lti.to_bits(drives, lti.DESIGN_BITS))
    return LoopController(name, system, windup, forward=forward)


def _ahead(rest: PointingLoop, path: ReferenceFilter) -> lti.StateSpace:
    """From the references to where the line of sight is to be when a drive has its effect, at the control rate.

    Target, and the delays times its rate: those of the filter and of all that lies between a command and the line of
    sight, which need not be the same for both axes.
    """
    period, eye, low_pass = rest.timing.period_s, np.eye(rest.axes), path.discrete(rest.timing.period_s)
    s = whole_plant(rest, decoupling(rest)).system
    seen = lti.StateSpace(s.A, s.B[:, : rest.axes], -s.C[: rest.axes], -s.D[: rest.axes, : rest.axes])
    late = -(slow_slope_s(low_pass, period)[0] * eye + slow_slope_s(seen, period) / nominal_axis_gain(rest))
    late = late / slow_slope_s(low_pass, period)[1]  # the rate at the end of a hold is not quite that of the input
    late = lti.to_bits(late, lti.DESIGN_BITS)
    A, B, target, rate, target_now, rate_now = (
        np.asarray(np.kron(eye, each), dtype=float)
        for each in (low_pass.A, low_pass.B, low_pass.C[:1], low_pass.C[1:], low_pass.D[:1], low_pass.D[1:])
    )
    return lti.StateSpace(A, B, target + late @ rate, target_now + late @ rate_now)


def slow_slope_s(system: lti.StateSpace, period_s: float) -> Floats:
    """dH/ds of a discrete system at s = 0, shape (outputs, inputs): for a gain of 1 minus its delay for slow inputs.

    Args:
        system: The system, without a pole at 1.
        period_s: Its period.
    """
    still = np.eye(system.order) - system.A
    return np.asarray(-period_s * system.C @ np.linalg.solve(still, np.linalg.solve(still, system.B)))
