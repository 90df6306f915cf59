"""A pointing loop around a mirror of plays, the same mirror softened, and an inverse in series."""

from dataclasses import replace

import numpy as np

from microrad.core import lti
from microrad.loop import control, disturbance
from microrad.loop.pointing_loop import loop as fine
from microrad.loop.sensor import OpticalSensor, StrainGauge
from microrad.mirror import model as mirror
from microrad.mirror.hysteresis import NO_CREEP, Creep, PrandtlIshlinskii
from microrad.mission.file import load_mission
from shipped import SHIPPED

PLAYS = PrandtlIshlinskii((0.0, 0.05, 0.2, 0.5, 1.2), (50e-6, 10e-6, 10e-6, 10e-6, 9e-6))
CREEP = Creep((1e-6, 1e-6), (0.1, 1.0))
STILL = disturbance.Reference(0.0, 0.0, 1.0)


def with_plays(folder):
    """The shipped mission with these plays as its mirror, in a file of this folder."""
    text = SHIPPED.read_text(encoding="utf-8")
    given = text[text.index("[mirror.linear]") : text.index("[amplifier]")]
    thresholds, weights = (
        ", ".join(f'"{each:.6g} {unit}"' for each in values)
        for values, unit in ((PLAYS.thresholds_v, "V"), (PLAYS.weights_rad_v, "rad/V"))
    )
    plays = f"[mirror.prandtl_ishlinskii]\nthresholds = [{thresholds}]\nweights = [{weights}]\n\n"
    text = text.replace(given, plays).replace('composition = "cascade"', 'composition = "static"')
    path = folder / "plays.toml"
    path.write_text(text, encoding="utf-8")
    return load_mission(path)


def softened(model, gain=0.8, width=1.3):
    """The same plays with other weights: gain over the whole, and width of the loops."""
    w = np.array(model.weights_rad_v)
    w[1:] *= width
    w[0] = sum(model.weights_rad_v) - w[1:].sum()
    return replace(model, weights_rad_v=tuple((gain * w).tolist()))


def resonance(freq_hz, damping):
    w = 2.0 * np.pi * freq_hz
    return lti.StateSpace(
        w * np.array([[0.0, 1.0], [-1.0, -2.0 * damping]]), np.array([[0.0], [w]]), np.eye(2)[:1], np.zeros((1, 1))
    )


def loop_of(model=PLAYS, creep=NO_CREEP, system=None, axes=1):
    one = mirror.assemble("plays", "static" if system is None else "cascade", system, model, creep)
    shaken = (disturbance.olympus(), disturbance.body_pointing(100e-6, 1.0, 0.1))
    return fine.PointingLoop(
        mirror=mirror.combine(*[one] * axes),
        optics=np.eye(axes),
        drive=control.Drive(-6.0, 6.0, 1e3, 1e5, 0.305e-3, 0.0),
        timing=control.Timing(2e-4, 5, 5),
        disturbances=(shaken,) * axes,
        optical=OpticalSensor(1e-6, 2e-3, 0.12e-6, 1, 0),
        gauge=StrainGauge(0.1e-6, 0.027e-6),
        references=(STILL,) * axes,
    )


def in_series(loop):
    gain = fine.nominal_axis_gain(loop)
    step = 2.0 * np.pi * 150.0 * loop.timing.period_s / gain
    system = lti.StateSpace(
        np.ones((1, 1)), np.array([[step, 0.0]]), np.ones((1, 1)), np.array([[step + 0.2 / gain, 0.0]])
    )
    axis = control.AxisController("PI", system, np.ones((1, 1)))
    return fine.with_inverse("PI", loop, axis, control.inverse(loop.mirror), fine.ReferenceFilter(1000.0), True)
