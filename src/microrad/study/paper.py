"""The paper's closed-loop claims, and the search for gains and a composition with which they hold together.

The paper (SPIE 11852, 118523B) prints neither its PID gains nor how it joins Eq. 2 and Eq. 3. Its claims: hysteresis
makes the tracking errors worse at 1 and 15 Hz, and more so at the higher frequency (Fig. 6); the inverse takes about 10
and 25 µrad off the error at 15 and 25 Hz (Fig. 8); and the control reaches 10 µrad (section 3.1).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import product
from pathlib import Path

import numpy as np

from microrad import mirror
from microrad.core.progress import Progress
from microrad.core.threads import in_threads
from microrad.loop import control, sine_run
from microrad.loop.paper_cases import PaperCases
from microrad.mirror import Mirror, MirrorParts, Variant, hysteresis
from microrad.mission.file import LinkFile, load_link
from microrad.mission.presets import PAPER, preset_text
from microrad.mission.tables import mirror as mirror_table

FIG6_HZ = (1.0, 15.0)
CLAIMED_DROP_RAD = {15.0: 10e-6, 25.0: 25e-6}  # Fig. 8, by frequency in Hz
DROP_TOLERANCE = 0.25  # "about", as a share of the claimed drop
CLAIMED_ACCURACY_RAD = 10e-6  # section 3.1
COMPOSITIONS = ("cascade", "additive")
# Proportional gains in V/mrad and integral gains in V/(mrad s), for the paper's mirror.
GAINS_FOR_RAD_V = 0.089e-3
PROPORTIONAL_V_MRAD = (0.0, 1.0, 4.0)
INTEGRAL_V_MRAD_S = (4e3, 8e3, 1.1e4, 1.3e4, 1.4e4, 1.5e4, 1.6e4, 1.8e4, 2.5e4, 4e4)


@dataclass(frozen=True, slots=True)
class Point:
    """Errors (rad) at one pair of gains, by frequency in Hz.

    ``linear_rms``: PID on the mirror without hysteresis. ``added_rms``: error signal with hysteresis minus without.
    ``pid_rms``, ``pid_peak``, ``inverse_peak``: the hysteretic mirror under PID, and under PID + inverse.
    """

    composition: str
    proportional_v_rad: float
    integral_v_rad_s: float
    stable: bool
    linear_rms: dict[float, float]
    added_rms: dict[float, float]
    pid_rms: dict[float, float]
    pid_peak: dict[float, float]
    inverse_peak: dict[float, float]

    def holds(self) -> dict[str, bool]:
        """Which claims hold here; an unstable loop holds none."""
        return {name: self.stable and test(self) for name, test in CLAIMS.items()}

    def drop_rad(self, freq_hz: float) -> float:
        """How much the inverse takes off the peak error."""
        return self.pid_peak[freq_hz] - self.inverse_peak[freq_hz]


def _worse(p: Point) -> bool:
    return all(p.pid_rms[f] > 1.01 * p.linear_rms[f] for f in FIG6_HZ)


def _worse_with_frequency(p: Point) -> bool:
    return p.added_rms[FIG6_HZ[1]] > p.added_rms[FIG6_HZ[0]]


def _drops(freq_hz: float) -> Callable[[Point], bool]:
    claimed = CLAIMED_DROP_RAD[freq_hz]
    return lambda p: abs(p.drop_rad(freq_hz) - claimed) <= DROP_TOLERANCE * claimed


def _accurate(p: Point) -> bool:
    return all(peak <= CLAIMED_ACCURACY_RAD for peak in p.inverse_peak.values())


CLAIMS: dict[str, Callable[[Point], bool]] = {
    "hysteresis raises the rms error by over 1 % at 1 and 15 Hz": _worse,
    "the error signal it adds is larger at 15 Hz than at 1 Hz": _worse_with_frequency,
    "the inverse takes 10 µrad ± 25 % off the peak at 15 Hz": _drops(15.0),
    "the inverse takes 25 µrad ± 25 % off the peak at 25 Hz": _drops(25.0),
    "PID + inverse stays within 10 µrad at its peaks": _accurate,
}


@dataclass(frozen=True, slots=True)
class Scan:
    """Every scanned point, and which of them hold which claims."""

    points: tuple[Point, ...]

    def holding(self, names: tuple[str, ...]) -> tuple[Point, ...]:
        """Points at which all the named claims hold."""
        return tuple(p for p in self.points if all(p.holds()[n] for n in names))

    def together(self) -> tuple[tuple[str, ...], tuple[Point, ...]]:
        """The largest set of claims that hold together somewhere, and the points where they do."""
        held = [tuple(n for n, ok in p.holds().items() if ok) for p in self.points]
        names = max(held, key=len)
        return names, self.holding(names) if names else ()


@cache
def links() -> LinkFile:
    """The paper's own links, as the preset has them."""
    return load_link(Path(f"{PAPER}.toml"), text=preset_text(PAPER))


def applies(given: mirror_table.Mirror) -> bool:
    """Whether the mission's mirror is of the paper's kind, a linear part and a Bouc-Wen model: else nothing to scan."""
    return given.linear is not None and given.bouc_wen is not None


def scan(cases: PaperCases, on_progress: Progress | None = None) -> Scan:
    """Errors over both compositions and the grid of gains, for the claims of Fig. 6 and 8.

    The plant takes one step a control period here: the errors compared are tens of µrad.

    Args:
        cases: The paper's cases: mirrors, loop and claims.
        on_progress: Called with the points done, their number and what is done.
    """
    timing = cases.setup.timing
    delay = math.ceil(timing.delay_steps / timing.steps_per_sample)
    coarse = replace(timing, steps_per_sample=1, delay_steps=delay)
    straight = _composed(cases.mirrors, Variant.STRAIGHT, "cascade")
    plants = {composition: _composed(cases.mirrors, Variant.GIVEN, composition) for composition in COMPOSITIONS}
    grid = product(COMPOSITIONS, PROPORTIONAL_V_MRAD, INTEGRAL_V_MRAD_S)
    jobs = [partial(_point, cases, coarse, straight, plants[at[0]], *at) for at in grid]
    said = on_progress or (lambda done, total, what: None)
    points = in_threads(jobs, lambda done, total: said(done, total, "scan of gains and compositions"))
    return Scan(tuple(points))


def _composed(mirrors: MirrorParts, variant: Variant, composition: str) -> Mirror:
    """A variant at the line of sight in this composition, which may be another than the mission's."""
    axis = mirrors.line_of_sight[variant]
    if composition == mirrors.table.composition:
        return axis.plant
    return mirror.from_mission(mirrors.table, axis.model, composition, mirrors.line_of_sight_per_own)


def _point(
    cases: PaperCases,
    timing: control.Timing,
    straight: Mirror,
    hysteretic: Mirror,
    composition: str,
    proportional_v_mrad: float,
    integral_v_mrad_s: float,
) -> Point:
    printed = control.Gains(proportional_v_mrad * 1e3, integral_v_mrad_s * 1e3, 0.0, cases.control.derivative_filter_s)
    scale = GAINS_FOR_RAD_V / hysteresis.slow_gain(cases.mirrors.line_of_sight[Variant.GIVEN].model)
    gains = replace(printed, proportional=printed.proportional * scale, integral=printed.integral * scale)
    setup = sine_run.Setup(cases.setup.drive, timing, control.pid(gains, timing.period_s))
    loop = sine_run.sampled_loop(straight, setup)
    blank = Point(composition, printed.proportional, printed.integral, False, {}, {}, {}, {}, {})
    if control.slowest_pole(loop) >= 1.0:
        return blank
    feedback, inverse = control.no_feedforward(hysteretic), control.inverse(hysteretic)
    amplitude = cases.scenario.amplitude_rad

    def run(feedforward: control.Inverse, freq_hz: float) -> sine_run.Trace:
        return sine_run.track_sine("", hysteretic, setup, feedforward, amplitude, freq_hz)

    frequencies = sorted({*FIG6_HZ, *CLAIMED_DROP_RAD})
    pid = {f: run(feedback, f) for f in frequencies}
    linear = {f: amplitude * control.sensitivity(loop, f, timing.period_s) for f in FIG6_HZ}
    return replace(
        blank,
        stable=True,
        linear_rms={f: abs(e) / np.sqrt(2.0) for f, e in linear.items()},
        added_rms={f: _added_rms(pid[f], f, e) for f, e in linear.items()},
        pid_rms={f: trace.rms_rad for f, trace in pid.items()},
        pid_peak={f: trace.peak_rad for f, trace in pid.items()},
        inverse_peak={f: run(inverse, f).peak_rad for f in CLAIMED_DROP_RAD},
    )


def _added_rms(trace: sine_run.Trace, freq_hz: float, linear_error: complex) -> float:
    """Rms of the error beyond the linear loop's, whose steady error is the phasor ``linear_error`` of a sine."""
    turn = np.exp(2j * np.pi * freq_hz * trace.time_s[trace.steady])
    added = trace.error_rad[trace.steady, 0] - (linear_error * turn).imag
    return float(np.sqrt(np.mean(added**2)))
