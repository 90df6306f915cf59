"""What the control page shows of a controller: responses by frequency and in time as plots, and answers in words.

`controllers` computes it, and loads the kernels for it. Times are in s, angles in rad, drives in V from the bias.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import UnitError, format_quantity, parse_quantity
from microrad.report.plotting.palette import BLACK, BLUE, GREEN, GREY, VERMILION
from microrad.report.plotting.sheet import Axis, Line, Mark, Rule
from microrad.report.quantities import angle, given_angle, quantity
from microrad.studio.views.plots import Plot, empty, plot

if TYPE_CHECKING:
    from microrad.loop.control import LoopMargins

PID, PID_INVERSE = "PID of [control]", "PID of [control] + inverse"
WITH, WITHOUT = "with hysteresis", "without hysteresis"

SHOWN = {"both": (WITH, WITHOUT), "with": (WITH,), "without": (WITHOUT,)}
"""What the switch of the hysteresis shows."""

_STYLES = {WITH: (VERMILION, "-"), WITHOUT: (BLUE, "--")}
MILLISECONDS, SECONDS = "time (ms)", "time (s)"
_NOTHING = "Nothing disturbs this loop, or nothing was asked."
_LEAST = 1e-4  # of what is drawn on a logarithmic axis


@dataclass(frozen=True, slots=True)
class Ask:
    """What a loop is to answer: a step and a sine of the reference on axis x, the sine's frequency in Hz."""

    step_rad: float
    sine_rad: float
    sine_hz: float
    seed: int = 1


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """One run: time, wanted and found line of sight of axis x, error by axis (samples, axes), drives, disturbance.

    ``disturbance_rad`` is what the loop has to reject, (samples, axes), None where there is nothing.
    """

    time_s: Floats
    wanted_rad: Floats
    found_rad: Floats
    error_rad: Floats
    drive_v: Floats
    disturbance_rad: Floats | None = None

    @property
    def rms_rad(self) -> float:
        """Root mean square of the radial error over what is shown."""
        return float(np.sqrt(np.mean(np.sum(self.error_rad**2, axis=1))))

    @property
    def peak_rad(self) -> float:
        """Largest radial error of what is shown."""
        return float(np.max(np.linalg.norm(self.error_rad, axis=1)))


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """What a loop does, by the variant of its mirror (`WITH` or `WITHOUT`); no jitter where nothing disturbs it."""

    step: dict[str, Curve]
    sine: dict[str, Curve]
    jitter: dict[str, Curve]


@dataclass(frozen=True, slots=True, eq=False)
class Controller:
    """A controller, ready to be asked.

    ``tuned`` says what it was tuned to. ``residual_rad`` is the rms of an axis in theory, nan where nothing shakes it.
    ``asked_modulus`` is the margin that was asked for, nan for none. ``loop_gain`` and ``sensitivity`` are magnitudes
    at ``freq_hz``, None where a slower sensor folds frequencies. ``limits_v`` are the amplifier's about the bias,
    ``identified_v`` the range that the mirror was identified in. ``rate_hz`` is that of the control,
    ``field_of_view_rad`` the radial error beyond which the sensor holds its last reading. ``warnings`` say what the
    mirror leaves out.
    """

    name: str
    margins: LoopMargins
    tuned: str
    residual_rad: float
    bound_by: tuple[str, ...]
    asked_modulus: float
    freq_hz: Floats
    loop_gain: Floats | None
    sensitivity: Floats | None
    limits_v: tuple[float, float]
    identified_v: tuple[float, float]
    rate_hz: float
    field_of_view_rad: float
    warnings: tuple[str, ...]
    ask: Callable[[Ask, tuple[str, ...]], Answers]


class AskError(ValueError):
    """Something typed that no loop can be asked; the message names the field."""


def ask_of(step: str, amplitude: str, frequency: str, rate_hz: float) -> Ask:
    """Step, amplitude and frequency as they are typed, for a loop of this rate. Raises `AskError`.

    Args:
        step: an angle with its unit.
        amplitude: an angle with its unit, of the sine.
        frequency: with its unit, of the sine.
        rate_hz: that of the loop's control.
    """
    return Ask(_angle("step", step), _angle("amplitude of the sine", amplitude), _frequency(frequency, rate_hz))


def _angle(name: str, typed: str) -> float:
    return _quantity(name, typed, "rad", 1e-9, 0.1)


def _frequency(typed: str, rate_hz: float) -> float:
    """The frequency of a sine that the samples of the loop can tell from a slower one."""
    found = _quantity("frequency of the sine", typed, "Hz", 0.1, 10_000.0)
    if found < 0.5 * rate_hz:
        return found
    half, rate = format_quantity(0.5 * rate_hz, "Hz"), format_quantity(rate_hz, "Hz")
    raise AskError(
        f"frequency of the sine: {typed.strip()} is not below {half}, half the rate of the loop, {rate}, which would "
        "take it for a slower one; type one below"
    )


def _quantity(name: str, typed: str, unit: str, least: float, most: float) -> float:
    try:
        found = parse_quantity(typed.strip(), unit)
    except UnitError as error:
        raise AskError(f"{name}: {error}") from None
    if not least <= found <= most:
        bounds = f"{format_quantity(least, unit)} to {format_quantity(most, unit)}"
        raise AskError(f"{name}: {typed.strip()} is outside {bounds}; type one between")
    return found


# --------------------------------------------------------------------------------------------------------------- words
def notes(of: Controller) -> tuple[str, ...]:
    """What has to be known to read the numbers."""
    told = []
    if of.name in (PID, PID_INVERSE):
        told.append(
            "The gains of [control] as they stand in the mission: this loop is not tuned, and nothing shakes it."
        )
    if of.sensitivity is None:
        told.append("The optical sensor is slower than the control: the loop has no response by frequency of its own.")
    return (*told, *of.warnings)


def answer_words(curves: dict[str, Curve], what: str, field_of_view_rad: float = math.inf) -> str:
    """Rms and peak of the error of each variant in a sentence, and one on a sensor that has lost sight of it.

    Args:
        curves: a run for each variant of the mirror.
        what: what the error is called.
        field_of_view_rad: the radial error up to which the sensor sees.
    """
    told = [f"{variant} {angle(c.rms_rad)} rms, at most {angle(c.peak_rad)}" for variant, c in curves.items()]
    words = f"{what}: {'; '.join(told)}." if told else ""
    if not any(c.peak_rad > field_of_view_rad for c in curves.values()):
        return words
    view = given_angle(field_of_view_rad)
    return f"{words} The sensor sees errors up to {view}: beyond, it holds its last reading, and the loop does not act."


# ------------------------------------------------------------------------------------------------ plots by frequency
def sensitivity_plot(of: Controller) -> Plot:
    """|S|: what the loop leaves of a disturbance at each frequency, below the inverse of the margin asked for."""
    if of.sensitivity is None:
        return empty("No response by frequency.")
    marks: list[Mark] = [Line(of.freq_hz, of.sensitivity, VERMILION, label="|S|")]
    if math.isfinite(of.asked_modulus):
        name = f"1 / modulus margin asked for ({of.asked_modulus:g})"
        marks.append(Rule(1.0 / of.asked_modulus, False, BLACK, "--", 1.3, name))
    return _by_frequency(of, of.sensitivity, "|S|, error over disturbance", "bandwidth", of.margins.bandwidth_hz, marks)


def gain_plot(of: Controller) -> Plot:
    """|L|: the loop gain."""
    if of.loop_gain is None:
        return empty("No response by frequency.")
    line = Line(of.freq_hz, of.loop_gain, BLUE, label="|L|")
    return _by_frequency(of, of.loop_gain, "|L|, loop gain", "crossover", of.margins.crossover_hz, [line])


def _by_frequency(of: Controller, values: Floats, title: str, mark: str, at: float, marks: Sequence[Mark]) -> Plot:
    """Curves over the frequency, both axes logarithmic, with the frequency of a margin."""
    low, high = max(float(np.min(values)), _LEAST), float(np.max(values))
    shown: list[Mark] = [*marks, Rule(1.0, False, GREY, ":")]
    if math.isfinite(at) and at > 0.0:
        shown.append(Rule(at, True, GREEN, "-.", 1.3, f"{mark} {quantity(at, 'Hz')}"))
    x = Axis("frequency (Hz)", log=True, low=of.freq_hz[0], high=of.freq_hz[-1])
    return plot(x, Axis(title, log=True, low=low, high=1.3 * high), *shown)


# ---------------------------------------------------------------------------------------------------- plots over time
def step_plot(answers: Answers) -> Plot:
    """The line of sight behind a step of the reference."""
    wanted = [Line(_ms(c), 1e6 * c.wanted_rad, GREY, ":", label="wanted") for c in [*answers.step.values()][:1]]
    return _over_time(MILLISECONDS, "line of sight, axis x (µrad)", *wanted, *_lines(answers.step, _ms, _found))


def sine_plot(answers: Answers) -> Plot:
    """The error of axis x while the loop follows a sine, settled; the time is that since it has settled."""
    return _over_time(MILLISECONDS, "error, axis x (µrad)", *_lines(answers.sine, _ms, _error))


def jitter_plot(answers: Answers) -> Plot:
    """The error of axis x under everything that disturbs the loop."""
    return _over_time(SECONDS, "error, axis x (µrad)", *_lines(answers.jitter, _s, _error, 0.7))


def motion_plot(answers: Answers) -> Plot:
    """What the mirror has to follow on axis x, and what it does: the closed loop's trace."""
    shaken = [(_s(c), c.disturbance_rad) for c in answers.jitter.values() if c.disturbance_rad is not None]
    followed = [Line(time_s, 1e6 * angle[:, 0], GREY, "-", 3.0, "to be followed") for time_s, angle in shaken[:1]]
    return _over_time(SECONDS, "angle, axis x (µrad)", *followed, *_lines(answers.jitter, _s, _found))


def drive_plot(of: Controller, curves: dict[str, Curve], over: str = MILLISECONDS) -> Plot:
    """The drive of the first actuator from the bias, with the amplifier's limits and the identified range.

    Args:
        of: the controller, for its limits.
        curves: a run for each variant of the mirror.
        over: title of the axis of time, `MILLISECONDS` or `SECONDS`.
    """
    if not curves:
        return empty(_NOTHING)
    lines = _lines(curves, _ms if over == MILLISECONDS else _s, lambda c: c.drive_v[:, 0])
    sides = [("amplifier's limits", "--", BLACK, each) for each in of.limits_v]
    if of.identified_v != of.limits_v:
        sides = [("range of the identification", ":", GREY, each) for each in of.identified_v] + sides
    limits = [Rule(at, False, colour, dash, 1.3, name) for name, dash, colour, at in sides if math.isfinite(at)]
    return _over_time(over, "drive from the bias (V)", *lines, *limits)


def _over_time(over: str, title: str, *marks: Mark) -> Plot:
    return plot(Axis(over), Axis(title), *marks) if marks else empty(_NOTHING)


def _lines(
    curves: dict[str, Curve], time: Callable[[Curve], Floats], value: Callable[[Curve], Floats], width: float = 1.3
) -> list[Line]:
    """A line for each variant of the mirror."""
    return [Line(time(c), value(c), *_STYLES[variant], width, variant) for variant, c in curves.items()]


def _found(curve: Curve) -> Floats:
    return 1e6 * curve.found_rad


def _error(curve: Curve) -> Floats:
    return 1e6 * curve.error_rad[:, 0]


def _ms(curve: Curve) -> Floats:
    return np.asarray(1e3 * (curve.time_s - curve.time_s[0]))


def _s(curve: Curve) -> Floats:
    return curve.time_s
