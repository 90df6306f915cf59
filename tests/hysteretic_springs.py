"""Mirrors of two axes on hysteretic springs of both families, references of sines, and loops that are given drives."""

from dataclasses import dataclass, replace

import numpy as np

from microrad.core import lti
from microrad.loop.disturbance import Reference
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop
from microrad.mirror.coupled import Actuator, CoupledMirror, Output
from microrad.mirror.hysteresis import BoucWen, PrandtlIshlinskii
from microrad.mirror.model import Mirror

GAIN_RAD_V, RESONANCES_HZ, DAMPING = 20e-6, (640.0, 700.0), 0.02
AMPLITUDE_RAD, SINES_HZ = 300e-6, (15.0, 25.0)
BODY_HZ = 0.1


BOUC_WEN = BoucWen(0.0, 0.0, -0.25, 0.0, 0.1, -0.025)
"""Half of its loop is 13 % of a swing of 15 V."""

PLAYS = PrandtlIshlinskii((0.0, 0.5, 2.0, 8.0), (0.0, 0.05, 0.05, 0.08), polynomial_rad=(0.3, 2.0, -1.0), reach_v=50.0)

FAMILIES = {"Bouc-Wen": BOUC_WEN, "plays": PLAYS}


def on_springs(spring):
    """Two axes, each on a spring of this kind; drives and angles of one show on the other by some percent."""
    natural = [2 * np.pi * f for f in RESONANCES_HZ]
    roots = [(-DAMPING * w, w * np.sqrt(1 - DAMPING**2)) for w in natural]
    B, E, F, C = np.zeros((4, 2)), np.zeros((4, 2)), np.zeros((2, 4)), np.zeros((2, 4))
    stiffness = [-(s * s + w * w) / w for s, w in roots]  # states 1 and 3 are the strains, in V
    B[1::2] = np.array([[1.0, 0.05], [-0.03, 1.0]]) * np.array(stiffness)[:, None]
    E[1::2], F[:, ::2] = np.diag(stiffness), np.eye(2)
    C[:, ::2] = GAIN_RAD_V * np.array([[1.0, 0.04], [-0.02, 1.0]])
    none = np.zeros((2, 2))
    bank = (spring, spring) if isinstance(spring, BoucWen) else ()
    plays = (spring, spring) if isinstance(spring, PrandtlIshlinskii) else ()
    mirror = Mirror("two springs", lti.modal_matrix(roots), B, E, F, none, C, none, none, bank, plays, ())
    actuators = tuple(Actuator(f"tilt {axis}", 50.0, 0.0, 100.0, 1e5) for axis in "xy")
    outputs = tuple(Output(axis, "angle") for axis in "xy")
    return CoupledMirror(mirror, actuators, outputs, 0.0, 10e3, 2, (0.1, 3e3))


def with_errors(mirror, gain=1.0, width=1.0, resonance=1.0):
    """The mirror with so many times its gain, the width of its loops in the drives of its elements, and its poles."""
    return replace(
        mirror,
        **{key: resonance * getattr(mirror, key) for key in "ABE"},
        **{key: gain * getattr(mirror, key) for key in "CDK"},
        bouc_wen=tuple(replace(b, alpha_1_v=b.alpha_1_v / width, beta_1_v=b.beta_1_v / width) for b in mirror.bouc_wen),
        plays=tuple(replace(p, thresholds_v=tuple(width * r for r in p.thresholds_v)) for p in mirror.plays),
    )


@dataclass(frozen=True)
class Sampled:
    """A reference that is given at the control samples, and held beyond their end."""

    values: np.ndarray
    period_s: float
    body_bandwidth_hz: float = BODY_HZ

    def at(self, time_s):
        places = np.rint(np.asarray(time_s) / self.period_s).astype(int)
        return self.values[np.minimum(places, len(self.values) - 1)]


def sines(point_ahead_rad=0.0, rate_rad_s=0.0, amplitude_rad=AMPLITUDE_RAD):
    """A point-ahead and a slow rate on x, and a sine on each axis."""
    slow = ((point_ahead_rad, rate_rad_s), (0.0, 0.0))
    pairs = zip(slow, SINES_HZ, strict=True)
    return tuple(Reference(ahead, rate, BODY_HZ, amplitude_rad, freq) for (ahead, rate), freq in pairs)


def quiet(loop):
    """Without disturbances, noise and resolutions: what its reference alone leaves."""
    optical = replace(loop.optical, noise_rad=0.0, resolution_rad=0.0)
    drive = replace(loop.drive, drive_resolution_v=0.0)
    return replace(loop, disturbances=((),) * loop.axes, optical=optical, drive=drive)


RAD_V = 1e-9
"""Drives are given as references of axes that see nothing; so small that the field of view does not count them."""


def driven(loop: PointingLoop, controller: LoopController, drive_v, wanted_rad=None):
    """A loop and its controller with drives (samples, actuators) added to the commands, for the kernel itself.

    ``wanted_rad`` (samples, axes) is taken off the optical error ahead of the controller. The loop has axes more, one
    for each number that is given; those of the line of sight are the first.
    """
    s, axes, m, outputs = controller.system, loop.axes, loop.mirror.actuators, loop.mirror.axes
    wanted = np.zeros((len(drive_v), axes)) if wanted_rad is None else wanted_rad
    given = [Sampled(RAD_V * column, loop.timing.period_s) for column in np.hstack([drive_v, wanted]).T]
    more = len(given)
    wider = replace(
        loop,
        optics=np.vstack([loop.optics, np.zeros((more, outputs))]),
        disturbances=(*loop.disturbances, *((),) * more),
        references=(*loop.references, *given),
    )

    def columns(matrix, drives):
        optical, rest = matrix[:, :axes], matrix[:, axes:]
        return np.hstack([optical, np.zeros((len(matrix), more)), rest, drives / RAD_V, -optical / RAD_V])

    B, D = columns(s.B, np.zeros((s.order, m))), columns(s.D, np.eye(m))
    return wider, LoopController("driven", lti.StateSpace(s.A, B, s.C, D), controller.anti_windup)


def idle(loop):
    """A controller that commands nothing."""
    m, inputs = loop.mirror.actuators, 2 * loop.axes + loop.mirror.axes
    nothing = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, inputs)), np.zeros((m, 0)), np.zeros((m, inputs)))
    return LoopController("idle", nothing, np.zeros((0, m)))
