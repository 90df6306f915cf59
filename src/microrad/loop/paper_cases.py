"""The paper's tracking cases on the mission's mirror (Fig. 5, 6 and 8), and the residual that they leave."""

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from microrad.loop import control
from microrad.loop.sine_run import Setup, Trace, margins, track_sine
from microrad.mirror import MirrorParts, Variant
from microrad.mirror.hysteresis import HysteresisLoop, secant_gain
from microrad.mission.model import Control, Conventions, Mission, Requirement, Scenario

PID, PID_WITH_INVERSE = "PID", "PID + inverse"
"""Controllers of the paper's loop, by name."""


@dataclass(frozen=True, slots=True)
class PaperCases:
    """The loop of `[control]` around the mission's mirror and the sines that it tracks; one axis, line of sight.

    The controller's gains are scaled for the mirror's gain at the amplitude of the sines.
    """

    mirrors: MirrorParts
    setup: Setup
    control: Control
    scenario: Scenario


def of(m: Mission, mirrors: MirrorParts) -> PaperCases:
    """Assemble the loop of `[control]` around the mission's mirror.

    Args:
        m: The mission.
        mirrors: Its mirror, as `mirror.of` assembles it.
    """
    gain = secant_gain(mirrors.line_of_sight[Variant.GIVEN].model, m.scenario.amplitude_rad)
    timing = control.timing_from_mission(m.control)
    pid = control.pid(control.gains_from_mission(m.control, gain), timing.period_s)
    return PaperCases(mirrors, Setup(control.drive_from_mission(m), timing, pid), m.control, m.scenario)


@dataclass(frozen=True, slots=True)
class Run:
    """One tracked sine: which mirror, which of the two controllers, and what came out, at the line of sight."""

    mirror: Variant
    controller: str
    freq_hz: float
    trace: Trace

    @property
    def at_limits(self) -> str:
        """In words, what the amplifier held back during the run, or nothing."""
        c, samples = self.trace.counts, self.trace.time_s.size
        if c.saturated:
            return f"the amplifier's limits ({c.saturated} of {samples} samples)"
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


def simulate(cases: PaperCases) -> tuple[tuple[HysteresisLoop, ...], control.LoopMargins, tuple[Run, ...]]:
    """The settled loops, the margins and the tracked sines.

    Raises:
        ValueError: The loop is unstable, or the mirror has no inverse.
    """
    return hysteresis_loops(cases), loop_margins(cases), sine_runs(cases)


def hysteresis_loops(cases: PaperCases) -> tuple[HysteresisLoop, ...]:
    """Fig. 5: settled loops of the static model at the mission's frequencies, in the mirror's own angle."""
    model, s = cases.mirrors.own[Variant.GIVEN].model, cases.scenario
    return tuple(model.loop(s.loop_amplitude_v, f, round(cases.control.rate_hz / f)) for f in s.loop_frequencies_hz)


def loop_margins(cases: PaperCases) -> control.LoopMargins:
    """Margins of the loop as it is sampled.

    Raises:
        ValueError: The loop is unstable.
    """
    return margins(cases.mirrors.line_of_sight[Variant.GIVEN].plant, cases.setup)


def sine_runs(cases: PaperCases, variants: Collection[Variant] = tuple(Variant)) -> tuple[Run, ...]:
    """Fig. 6 and 8: the sines of the scenario under PID and PID + inverse.

    Args:
        cases: The paper's loop.
        variants: Variants of the mirror that they are run on; those that it does not have are passed over.

    Raises:
        ValueError: The mirror has no inverse.
    """
    s, runs = cases.scenario, []
    both = sorted({*s.pid_frequencies_hz, *s.inverse_frequencies_hz})
    tracked = [(PID, f) for f in both] + [(PID_WITH_INVERSE, f) for f in s.inverse_frequencies_hz]
    for variant in (Variant.GIVEN, Variant.STRAIGHT, Variant.COMPARISON):
        if variant not in variants or variant not in cases.mirrors.line_of_sight:
            continue
        plant = cases.mirrors.line_of_sight[variant].plant
        controllers = {PID: control.no_feedforward(plant), PID_WITH_INVERSE: control.inverse(plant)}
        for controller, f in tracked:
            name = f"{variant}, {controller}, {f:g} Hz"
            trace = track_sine(name, plant, cases.setup, controllers[controller], s.amplitude_rad, f)
            runs.append(Run(variant, controller, f, trace))
    return tuple(runs)


def worst(runs: tuple[Run, ...], statistic: str, variant: Variant = Variant.GIVEN) -> Run:
    """The run of PID + inverse on one variant of the mirror that leaves the largest error.

    Args:
        runs: Runs as `sine_runs` gives them.
        statistic: What the error is measured by, "peak" or "rms".
        variant: The variant, the mission's own by default.
    """
    candidates = [r for r in runs if (r.mirror, r.controller) == (variant, PID_WITH_INVERSE)]
    return max(candidates, key=lambda r: r.trace.left_rad(statistic))


def residual_rad(required: Requirement, conventions: Conventions, trace: Trace) -> float:
    """The residual that the link sees, in the mission's statistic and convention (per axis, or radial).

    Args:
        required: Says which statistic has to meet the requirement, "peak" or "rms".
        conventions: Says whether the residual is that of an axis or radial, which is sqrt(2) times as large.
        trace: Run of one axis.
    """
    one_axis = trace.left_rad(required.residual_statistic)
    return one_axis * math.sqrt(2.0) if conventions.residual == "radial" else one_axis
