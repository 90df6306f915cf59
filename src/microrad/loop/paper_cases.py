"""The paper's tracking cases on the mission's mirror (Fig. 5, 6 and 8), and the residual that the link lives with."""

import math
from dataclasses import dataclass

import numpy as np

from microrad.loop import control
from microrad.loop import sine_run as simulate
from microrad.mirror import hysteresis
from microrad.mirror import model as mirror
from microrad.mission.model import Mission
from microrad.mission.tables.mirror import Comparison
from microrad.mission.tables.mirror import Mirror as MirrorTable

VARIANTS = ("given", "no hysteresis", "comparison")
"""The mission's mirror, the same with a gain in place of its hysteresis, and its comparison model."""

Model = hysteresis.BoucWen | hysteresis.Play


@dataclass(frozen=True, slots=True)
class Run:
    """One tracked sine: which mirror, which controller, and what came out, at the line of sight."""

    mirror: str  # "given", "comparison" or "no hysteresis"
    controller: str  # "PID" or "PID + inverse"
    freq_hz: float
    trace: simulate.Trace

    @property
    def at_limits(self) -> str:
        """In words, what the amplifier held back during the run, or nothing."""
        c, samples = self.trace.counts, self.trace.time_s.size
        if c.saturated:
            return f"the amplifier's limits ({100 * c.saturated / samples:.0f} % of the samples)"
        return "the amplifier's slew limit" if c.slew_limited else ""

    @property
    def drive_span_v(self) -> tuple[float, float]:
        """Lowest and highest drive behind the amplifier, about the bias (V)."""
        return float(np.min(self.trace.drive_v)), float(np.max(self.trace.drive_v))

    @property
    def fastest_drive_v_s(self) -> float:
        """Largest rate of the drive behind the amplifier, from sample to sample (V/s)."""
        period = self.trace.time_s[1] - self.trace.time_s[0]
        return float(np.max(np.abs(np.diff(self.trace.drive_v, axis=0))) / period)


def mirror_model(m: Mission, table: MirrorTable | Comparison) -> Model:
    """The hysteresis of the mission's mirror, or of its comparison, with its output at the line of sight."""
    model = mirror.hysteresis_model(table, m.mirror.rate_limit_v_s, m.mirror.bias_v)
    return mirror.line_of_sight(model, m.conventions.mirror_angle)


def _times(m: Mission) -> float:
    """What turns the angle of the mirror table into the line of sight's."""
    return hysteresis.LINE_OF_SIGHT[m.conventions.mirror_angle]


def hysteresis_loops(m: Mission) -> tuple[simulate.HysteresisLoop, ...]:
    """Fig. 5: settled loops of the static model at the mission's frequencies, in the mirror's own angle."""
    model = mirror.hysteresis_model(m.mirror, m.mirror.rate_limit_v_s, m.mirror.bias_v)
    s = m.scenario
    return tuple(
        simulate.hysteresis_loop(model, f, s.loop_amplitude_v, 1.0 / m.control.rate_hz) for f in s.loop_frequencies_hz
    )


def loop_margins(m: Mission) -> control.Margins:
    """Margins of the mission's loop as it is sampled; raises ValueError when it is unstable."""
    model = mirror_model(m, m.mirror)
    setup = simulate.setup_from_mission(m, hysteresis.secant_gain(model, m.scenario.amplitude_rad))
    return simulate.margins(mirror.from_mission(m.mirror, model, times=_times(m)), setup)


def tracking_runs(m: Mission, variants: tuple[str, ...] = VARIANTS) -> tuple[Run, ...]:
    """Fig. 6 and 8: the sines of the scenario under PID and PID + inverse, on variants of the mirror that it has.

    Raises ValueError when the mirror has no inverse.
    """
    model = mirror_model(m, m.mirror)
    amplitude = m.scenario.amplitude_rad
    setup = simulate.setup_from_mission(m, hysteresis.secant_gain(model, amplitude))
    models = {"given": model, "no hysteresis": hysteresis.gain_only(model, amplitude)}
    if m.mirror.comparison is not None:
        models["comparison"] = mirror_model(m, m.mirror.comparison)
    runs = []
    for which, variant in ((name, models[name]) for name in models if name in variants):
        plant = mirror.from_mission(m.mirror, variant, times=_times(m))
        controllers = {"PID": control.no_feedforward(plant), "PID + inverse": control.inverse(plant)}
        for controller, f in _cases(m):
            trace = simulate.track_sine(
                f"{which}, {controller}, {f:g} Hz", plant, setup, controllers[controller], m.scenario.amplitude_rad, f
            )
            runs.append(Run(which, controller, f, trace))
    return tuple(runs)


def _cases(m: Mission) -> list[tuple[str, float]]:
    both = sorted({*m.scenario.pid_frequencies_hz, *m.scenario.inverse_frequencies_hz})
    return [("PID", f) for f in both] + [("PID + inverse", f) for f in m.scenario.inverse_frequencies_hz]


def worst(m: Mission, runs: tuple[Run, ...], which: str = "given") -> Run:
    """The run of PID + inverse on one variant of the mirror that leaves the largest residual."""
    candidates = [r for r in runs if (r.mirror, r.controller) == (which, "PID + inverse")]
    return max(candidates, key=lambda r: residual_rad(m, r.trace))


def residual_rad(m: Mission, trace: simulate.Trace) -> float:
    """The residual that the link sees, in the mission's statistic and convention (per axis, or radial)."""
    one_axis = trace.peak_rad if m.requirement.residual_statistic == "peak" else trace.rms_rad
    return one_axis * math.sqrt(2.0) if m.conventions.residual == "radial" else one_axis
