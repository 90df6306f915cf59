"""Families of controllers with few parameters: PI, PID, notch, resonant damping, disturbance observer, peak filters.

Each is tuned by frequencies, damping ratios and ratios of gain, within bounds that come from the plant. ``e`` is the
optical sensor's line-of-sight error and -P the plant from command to it, delays included; every family has integral
action on e. A filter driven by a measurement does not wind up, so only integrals, oscillators and plant models are
corrected by what the limits cut off.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core import lti
from microrad.core.arrays import Complexes, Floats
from microrad.loop.control import filters
from microrad.loop.control.analysis import reachable
from microrad.loop.control.problem import OPTICAL, AxisController, DesignPlant, Family, Parameter, once_per_plant
from microrad.loop.control.sampled import Gains, pid

LIGHT_DAMPING = 0.3
"""Damping ratio below which a pole pair counts as a resonance."""

SLOW_SHARE = 0.2
"""Share of the plant's corner below which its real poles and zeros are drift, which an inverse undoes."""

INVERSE_DAMPING = 0.7
"""Damping ratio that the disturbance observer's inverse puts in the place of the plant's resonance."""

PROMINENT = 2.0
"""Factor over the slow gain from which the disturbance observer's inverse takes in a resonance."""

STATIC_FEEDBACK = 0.9
"""Bound of the slow gain of positive position feedback through the mirror; it diverges at 1."""


# ------------------------------------------------------------------------------------------------ the plant


@dataclass(frozen=True, slots=True)
class Resonance:
    """A lightly damped pole pair: natural frequency, damping ratio, and |P| there over the slow gain."""

    freq_hz: float
    damping: float
    prominence: float


@once_per_plant
def optical_model(plant: DesignPlant) -> lti.StateSpace:
    """P: command (V) to the reading that its answer takes off the optical error (rad), delays included.

    Of the plant's states it keeps those that lie between the two.

    Raises:
        ValueError: The plant has no optical sensor.
    """
    if not plant.has_optical:
        raise ValueError(
            "the plant has no optical sensor: every controller of this kind integrates its error; add a tracking "
            "sensor, or use a controller on the gauge"
        )
    s = plant.system
    between = reachable(s.A, s.B[:, :1]) & reachable(s.A.T, s.C[[OPTICAL]].T)
    return lti.StateSpace(
        s.A[np.ix_(between, between)],
        s.B[between, :1],
        -s.C[OPTICAL : OPTICAL + 1, between],
        np.zeros((1, 1)),
    )


@once_per_plant
def resonances(plant: DesignPlant) -> tuple[Resonance, ...]:
    """Lightly damped pole pairs of P below half the control rate, the most prominent first."""
    model = optical_model(plant)
    poles = np.linalg.eigvals(model.A).astype(complex)
    s = np.log(poles[(poles.imag > 0.0) & (np.abs(poles) > 1e-3)]) / plant.period_s
    light = s[-s.real < LIGHT_DAMPING * np.abs(s)]
    freq_hz = np.abs(light) / (2 * math.pi)
    freq_hz, light = freq_hz[freq_hz < 0.5 / plant.period_s], light[freq_hz < 0.5 / plant.period_s]
    height = np.abs(_at(model, freq_hz, plant.period_s) / plant.gain_rad_v)
    order = np.argsort(-height)
    return tuple(Resonance(float(freq_hz[i]), float(-light[i].real / abs(light[i])), float(height[i])) for i in order)


@once_per_plant
def corner_hz(plant: DesignPlant) -> float:
    """Lowest frequency at which |P| is 3 dB below the slow gain; a quarter of the control rate where there is none.

    On a grid of steps of 11 %: it is a scale for bounds.
    """
    model = optical_model(plant)
    f = np.geomspace(1e-5, 0.25, 100) / plant.period_s
    low = np.abs(_at(model, f, plant.period_s)) < math.sqrt(0.5) * abs(plant.gain_rad_v)
    return float(f[np.argmax(low)]) if np.any(low) else float(f[-1])


def drift(model: lti.StateSpace, below: float) -> list[tuple[float, float]]:
    """Real stable poles and zeros of a discrete model below a frequency, in pairs (pole, zero), slowest first.

    Args:
        model: Discrete model with one input and one output.
        below: Frequency in cycles a sample.
    """
    found = []
    for roots in (np.linalg.eigvals(model.A).astype(complex), lti.zeros(model)):
        real = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > math.exp(-2.0 * math.pi * below)) & (roots.real < 1.0)]
        found.append(lti.decay_to_bits(np.sort(real.real)[::-1], lti.DESIGN_BITS))
    return [(float(pole), float(zero)) for pole, zero in zip(*found, strict=False)]


@once_per_plant
def _drift(plant: DesignPlant) -> list[tuple[float, float]]:
    """What of P an inverse undoes as drift."""
    return drift(optical_model(plant), SLOW_SHARE * corner_hz(plant) * plant.period_s)


def _slow(model: lti.StateSpace) -> float:
    """Response at frequency 0."""
    return float((model.C @ np.linalg.solve(np.eye(model.order) - model.A, model.B))[0, 0])


def _at(system: lti.StateSpace, freq_hz: Floats, period_s: float) -> Complexes:
    return np.asarray(lti.frequency_response(system, freq_hz, period_s)[:, 0, 0])


# ------------------------------------------------------------------------------------------------ what families share

Design = Callable[..., tuple[lti.StateSpace, Floats]]
"""From a plant and checked values to the controller's system and its anti-windup gain."""


def _family(
    name: str,
    parameters: Callable[[DesignPlant], tuple[Parameter, ...]],
    design: Design,
    base: Family | None = None,
    neutral: Callable[[DesignPlant], tuple[float, ...]] = lambda plant: (),
) -> Family:
    """A family whose `build` refuses what `parameters` refuses, and values that are not what it takes.

    ``neutral`` are the values behind those of the ``base`` with which its controller is that of the base, or nearly so.
    """
    parameters = once_per_plant(parameters)

    def build(plant: DesignPlant, values: Floats) -> AxisController:
        return AxisController(name, *design(plant, *_checked(name, parameters(plant), values)))

    return Family(name, parameters, build, base, lambda plant, values: np.append(values, neutral(plant)))


def _checked(name: str, parameters: tuple[Parameter, ...], values: Floats) -> list[float]:
    """The values as floats: one for each parameter, finite, and above 0 where the search is logarithmic."""
    values = np.asarray(values, dtype=float).ravel()
    if values.size != len(parameters):
        names = ", ".join(f"{p.name} ({p.unit})" if p.unit else p.name for p in parameters)
        raise ValueError(f"{name} takes {len(parameters)} values, not {values.size}: {names}")
    for p, v in zip(parameters, values, strict=True):
        if not math.isfinite(v) or (p.log and v <= 0.0):
            raise ValueError(
                f"{name}: the {p.name} is {v:g}; give a {'number above 0' if p.log else 'finite number'}, "
                f"for this plant between {p.least:g} and {p.most:g} {p.unit}".rstrip()
            )
    return [float(v) for v in values]


def _integral_frequency(plant: DesignPlant) -> Parameter:
    """Crossover of the integral part over the slow gain alone; a delay of one sample allows 0.16 of the rate."""
    return Parameter("integral frequency", "Hz", 1e-5 / plant.period_s, 0.25 / plant.period_s)


def _zero(plant: DesignPlant, name: str) -> Parameter:
    """From a tenth of the plant's corner to ten times the rate, where the part it adds vanishes."""
    most = 10.0 / plant.period_s
    return Parameter(name, "Hz", 0.1 * corner_hz(plant), most, gentle=most)


def _band(plant: DesignPlant, around: float, least: float) -> tuple[float, float]:
    """Frequencies within a factor of the plant's resonances, or from a share of the rate up where it has none."""
    found = [r.freq_hz for r in resonances(plant)]
    if not found:
        return least / plant.period_s, 0.49 / plant.period_s
    return min(found) / around, min(max(found) * around, 0.49 / plant.period_s)


def _pi(plant: DesignPlant, integral_hz: float, zero_hz: float) -> lti.StateSpace:
    """Ki (1 / s + 1 / (2 pi zero)) by backward differences, Ki = 2 pi f / slow gain."""
    integral = 2 * math.pi * integral_hz / plant.gain_rad_v
    return pid(Gains(integral / (2 * math.pi * zero_hz), integral, 0.0, 0.0), plant.period_s)


def _on_error(system: lti.StateSpace) -> lti.StateSpace:
    """The controller with a second input, the gauge, that it does not use."""
    B, D = np.zeros((system.order, 2)), np.zeros((1, 2))
    B[:, :1], D[:, :1] = system.B, system.D
    return lti.StateSpace(system.A, B, system.C, D)


# ------------------------------------------------------------------------------------------------ PI, PID, notch


def _pi_parameters(plant: DesignPlant) -> tuple[Parameter, ...]:
    return _integral_frequency(plant), _zero(plant, "zero")


def _pi_design(plant: DesignPlant, integral_hz: float, zero_hz: float) -> tuple[lti.StateSpace, Floats]:
    system = _pi(plant, integral_hz, zero_hz)
    return _on_error(system), system.B / system.D


PI = _family("PI", _pi_parameters, _pi_design)
"""v = (Kp + Ki T / (1 - 1/z)) e, by the integral's frequency and the zero Ki / (2 pi Kp), at the top of whose bounds
nothing but the integral is left. Anti-windup: the integral follows the error that would just have reached the limit
(Hanus, Kinnaert and Henrotte, Automatica 23 (1987) 729)."""


def _pid_parameters(plant: DesignPlant) -> tuple[Parameter, ...]:
    roll_off = Parameter("derivative filter", "Hz", 0.02 / plant.period_s, 2.0 / plant.period_s)
    return *_pi_parameters(plant), _zero(plant, "derivative zero"), roll_off


def _pid_design(
    plant: DesignPlant, integral_hz: float, zero_hz: float, derivative_hz: float, filter_hz: float
) -> tuple[lti.StateSpace, Floats]:
    integral = 2 * math.pi * integral_hz / plant.gain_rad_v
    proportional = integral / (2 * math.pi * zero_hz)
    derivative = proportional / (2 * math.pi * derivative_hz)
    system = pid(Gains(proportional, integral, derivative, 1.0 / (2 * math.pi * filter_hz)), plant.period_s)
    return _on_error(system), np.array([[1.0], [0.0]]) * system.B / system.D


def _pid_neutral(plant: DesignPlant) -> tuple[float, ...]:
    derivative, roll_off = _pid_parameters(plant)[2:]
    return derivative.most, roll_off.least


PID = _family("PID", _pid_parameters, _pid_design, PI, _pid_neutral)
"""PI and a filtered derivative, Kd = Kp / (2 pi derivative zero): the numerator is 1 + s/wz + s^2/(wz wd), with complex
zeros below wd = 4 wz. Anti-windup: that of the PI with the derivative in its direct gain; the filter sees e alone."""


def _notch_parameters(plant: DesignPlant) -> tuple[Parameter, ...]:
    deepest_to = 1.0 if resonances(plant) else 3.0
    return (
        *_pi_parameters(plant),
        Parameter("notch centre", "Hz", *_band(plant, around=1.5, least=0.005)),
        Parameter("notch depth", "", 0.01, deepest_to, gentle=1.0),
        Parameter("notch width", "", 0.05, 4.0),
    )


def _notch_design(
    plant: DesignPlant, integral_hz: float, zero_hz: float, centre_hz: float, depth: float, width: float
) -> tuple[lti.StateSpace, Floats]:
    behind = _pi(plant, integral_hz, zero_hz)
    system = lti.series(filters.notch(centre_hz, depth, width, plant.period_s), behind)
    return _on_error(system), np.vstack([np.zeros((2, 1)), behind.B / behind.D])


def _no_notch(plant: DesignPlant) -> tuple[float, ...]:
    centre, _, width = _notch_parameters(plant)[2:]
    return centre.least, 1.0, width.least


PI_NOTCH = _family("PI + notch", _notch_parameters, _notch_design, PI, _no_notch)
"""PI behind a notch on the error: `filters.notch` by its centre, depth (gain there) and width (over the centre).

Its centre is sought around the plant's own resonances. On a plant that has none the bounds span the band and the depth
may exceed 1: the notch is a second-order section to be tuned, whose phase lead or lag the loop can use. Anti-windup:
that of the PI; the notch sees e alone."""


# ------------------------------------------------------------------------------------------------ resonant damping


def _damping_parameters(plant: DesignPlant) -> tuple[Parameter, ...]:
    if not plant.has_gauge:
        raise ValueError(
            "resonant damping feeds the mirror's own position back, and the plant has no gauge that reads it; add a "
            "strain gauge, or filter the resonance on the optical error (PI + notch)"
        )
    return (
        _integral_frequency(plant),
        Parameter("filter frequency", "Hz", *_band(plant, around=4.0, least=0.02)),
        Parameter("filter damping", "", 0.05, 2.0, gentle=2.0),
        Parameter("position feedback", "", -STATIC_FEEDBACK, STATIC_FEEDBACK, log=False, gentle=0.0),
    )


def _damping_design(
    plant: DesignPlant, integral_hz: float, filter_hz: float, damping: float, feedback: float
) -> tuple[lti.StateSpace, Floats]:
    if feedback >= 1.0:
        raise ValueError(
            f"resonant damping: a position feedback of {feedback:g} (its gain times the mirror's slow gain) diverges "
            f"at rest; keep it below 1, the bounds end at {STATIC_FEEDBACK:g}"
        )
    step = 2 * math.pi * integral_hz * (1.0 - feedback) / plant.gain_rad_v * plant.period_s
    f, gain = filters.low_pass(filter_hz, damping, plant.period_s), feedback / plant.gain_rad_v
    system = lti.StateSpace(
        A=np.block([[np.ones((1, 1)), np.zeros((1, 2))], [np.zeros((2, 1)), f.A]]),
        B=np.block([[np.full((1, 1), step), np.zeros((1, 1))], [np.zeros((2, 1)), f.B]]),
        C=np.hstack([np.ones((1, 1)), gain * f.C]),
        D=np.hstack([np.full((1, 1), step), gain * f.D]),
    )
    return system, np.array([[1.0], [0.0], [0.0]])


RESONANT_DAMPING = _family("resonant damping", _damping_parameters, _damping_design)
"""Integral of e plus positive position feedback: g w^2 / (s^2 + 2 zeta w s + w^2) on the gauge (Goh and Caughey,
International Journal of Control 41 (1985) 787; Fanson and Caughey, AIAA Journal 28 (1990) 717).

``position feedback`` is g times the mirror's slow gain; the integral is scaled by 1 - that, so that its frequency stays
the crossover of the stiffened or softened mirror. The filter's quarter turn at the resonance makes the feedback a
velocity's; where delay and amplifier already turn the phase by more than that, a negative feedback damps. Anti-windup:
the integral becomes the clipped command less the position feedback."""


# ------------------------------------------------------------------------------------------------ disturbance observer


def _observer_parameters(plant: DesignPlant) -> tuple[Parameter, ...]:
    _refuse_unstable_model(plant)
    return (
        Parameter("Q bandwidth", "Hz", 1e-4 / plant.period_s, 0.45 / plant.period_s),
        _zero(plant, "lead"),
        Parameter("Q damping", "", 0.3, 4.0, gentle=4.0),
    )


@once_per_plant
def _refuse_unstable_model(plant: DesignPlant) -> None:
    """Raise ValueError where the model that runs in the controller would not settle."""
    worst = float(np.max(np.abs(np.linalg.eigvals(optical_model(plant).A)), initial=0.0))
    if worst >= 1.0:
        raise ValueError(
            f"a disturbance observer runs a model of the plant, which has a pole at |z| = {worst:.6f} (the limit is 1) "
            "and would drift away from it; use a PI or LQG controller for this plant"
        )


def _observer_design(
    plant: DesignPlant, bandwidth_hz: float, lead_hz: float, damping: float
) -> tuple[lti.StateSpace, Floats]:
    model, f = optical_model(plant), observer_filter(plant, bandwidth_hz, lead_hz, damping)
    n, m = model.order, f.order
    system = lti.StateSpace(
        A=np.block([[model.A + model.B @ f.D @ model.C, model.B @ f.C], [f.B @ model.C, f.A]]),
        B=np.vstack([model.B @ f.D, f.B]),
        C=np.hstack([f.D @ model.C, f.C]),
        D=f.D,
    )
    return _on_error(system), np.vstack([model.B, np.zeros((m, 1))]).reshape(n + m, 1)


def observer_filter(plant: DesignPlant, bandwidth_hz: float, lead_hz: float, damping: float) -> lti.StateSpace:
    """Q over P's approximate inverse: from the disturbance's estimate (rad) to the command (V) that cancels it.

    Q is a low-pass of second order with a lead. The inverse divides by the slow gain, and undoes the plant's drift
    (real poles and zeros far below its corner, as creep leaves them) and its most prominent resonance, where it has
    one.

    Args:
        plant: The plant of one axis.
        bandwidth_hz: Natural frequency of Q, below half the control rate.
        lead_hz: Frequency of Q's zero, the lead.
        damping: Damping ratio of Q.

    Raises:
        ValueError: For a plant without optical sensor, and for a bandwidth that is not between 0 and half the rate.
    """
    model = optical_model(plant)
    low_pass = filters.low_pass(bandwidth_hz, damping, plant.period_s, lead_hz)
    slow = float(lti.to_bits(np.array(_slow(model)), lti.EXACT_BITS))
    for pole, zero in _drift(plant):
        gain = (1.0 - zero) / (1.0 - pole)
        undone = lti.StateSpace(
            np.array([[zero]]), np.ones((1, 1)), np.array([[gain * (zero - pole)]]), np.array([[gain]])
        )
        low_pass = lti.series(undone, low_pass)
    found = [r for r in resonances(plant) if r.prominence > PROMINENT]
    if found:
        depth = found[0].damping / INVERSE_DAMPING
        low_pass = lti.series(filters.notch(found[0].freq_hz, depth, 2 * INVERSE_DAMPING, plant.period_s), low_pass)
    return lti.StateSpace(low_pass.A, low_pass.B, low_pass.C / slow, low_pass.D / slow)


DISTURBANCE_OBSERVER = _family("disturbance observer", _observer_parameters, _observer_design)
"""v = F (e + P v): the disturbance is what the error has in excess of the model's answer, delays included, and F is a
low-pass Q times an approximate inverse of P, with F P = 1 at rest. With an exact model the sensitivity is 1 - F P.
Source: Ohnishi, Transactions of the Japanese Society of Electrical Engineers 107-D (1987) 83; internal model control:
Morari and Zafiriou, Robust Process Control, 1989. Anti-windup: the model is driven by the clipped command, so that what
the mirror was not asked to do is not taken for a disturbance."""


# ------------------------------------------------------------------------------------------------ peak filters


def peak_family(line_freqs_hz: Sequence[float]) -> Family:
    """PI and one narrow resonator for each line (a wheel's harmonics are several lines), all of one gain and damping.

    A resonator's phase undoes that of P / (1 + C P), C the PI, at its line: there the sensitivity falls by 1 + the peak
    gain, and what the resonator adds to the loop is a circle in the right half plane. Source: Sievers and von Flotow,
    IEEE Transactions on Signal Processing 40 (1992) 2377; Steinbuch, Automatica 38 (2002) 2103, for the repetitive
    control of which these are single lines. Anti-windup: `follow_command`. ``parameters`` and ``build`` raise
    ValueError without lines, for one given twice, and for one that is not below half the control rate.
    """
    lines = tuple(float(f) for f in line_freqs_hz)

    def parameters(plant: DesignPlant) -> tuple[Parameter, ...]:
        _refuse_lines(lines, plant.period_s)
        gain = Parameter("peak gain", "", *_PEAK_GAIN)
        return *_pi_parameters(plant), gain, Parameter("peak damping", "", *_PEAK_DAMPING)

    def design(
        plant: DesignPlant, integral_hz: float, zero_hz: float, gain: float, damping: float
    ) -> tuple[lti.StateSpace, Floats]:
        base, model = _pi(plant, integral_hz, zero_hz), optical_model(plant)
        P, C = (_at(s, np.array(lines), plant.period_s) for s in (model, base))
        centre = gain * (1.0 + C * P) / P
        peaks = [filters.peak(f, damping, complex(h), plant.period_s) for f, h in zip(lines, centre, strict=True)]
        system = filters.parallel(base, *peaks)
        return _on_error(system), follow_command(system)

    return _family("PI + peaks", parameters, design, PI, lambda plant: (_PEAK_GAIN[0], _PEAK_DAMPING[0]))


_PEAK_GAIN, _PEAK_DAMPING = (0.1, 300.0), (1e-4, 2e-2)


def _refuse_lines(lines: tuple[float, ...], period_s: float) -> None:
    if not lines:
        raise ValueError(
            "peak filters need the frequencies of the lines that they take out; give at least one, or use PI"
        )
    for f in lines:
        filters.refuse_beyond_rate(f, period_s, "a peak filter for a line")
    if len(set(lines)) < len(lines):
        twice = next(f for f in lines if lines.count(f) > 1)
        raise ValueError(f"the line at {twice:g} Hz is given twice; give each line one peak filter")


def follow_command(system: lti.StateSpace) -> Floats:
    """Anti-windup gain of a controller with oscillating states: a Kalman predictor of them from the clipped command.

    The process noise is white e in the states, the measurement noise the same through the direct path, taken as
    independent: A - L C is stable wherever the controller's zeros are. Source: the observer form of Astrom and
    Wittenmark, Computer-Controlled Systems, 3rd ed., chapter 9, Nonlinear actuators.
    """
    from scipy.linalg import solve_discrete_are

    A, C, R = system.A, system.C, system.D @ system.D.T
    P = solve_discrete_are(A.T, C.T, system.B @ system.B.T, R)
    return np.asarray(A @ P @ C.T / (C @ P @ C.T + R))
