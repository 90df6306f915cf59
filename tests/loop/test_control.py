"""Controllers, inverses and margins against difference equations, the compiled loop and python-control."""

import re
from dataclasses import replace
from math import cos, expm1, inf, isnan, pi, sqrt
from types import SimpleNamespace

import control as python_control
import numpy as np
import pytest
from numpy.testing import assert_allclose

import oracles
from loops import IDEAL_DRIVE
from microrad.core import lti
from microrad.loop import control
from microrad.loop import sine_run as simulate
from microrad.loop.control import Drive, Gains, Inverse, Timing, sampled
from microrad.mirror import hysteresis
from microrad.mirror import model as mirror
from microrad.mirror.hysteresis import BoucWen, Creep, PrandtlIshlinskii
from microrad.mission.file import load_mission
from places import ROOT

SHIPPED = ROOT / "missions" / "paper.toml"
PERIOD = 20e-6
PI = Gains(1e3, 16e6, 0.0, 1e-4)
PID = Gains(1.2e3, 9e6, 0.05, 2e-4)
PAPER = BoucWen(0.089e-3, -2.96e-7, -0.048e-3, 4.7e-4, 38.421, 34.635, 3770.0, 6.0)


@pytest.fixture(scope="module")
def mission():
    return load_mission(SHIPPED).mission


@pytest.fixture(scope="module")
def straight(mission):
    """The mission's mirror without hysteresis."""
    return mirror.from_mission(mission.mirror, hysteresis.gain_only(PAPER))


def respond(system, inputs):
    """Output of a discrete system of one input from rest."""
    x, y = np.zeros(system.order), []
    for u in inputs:
        y.append(system.C @ x + system.D[:, 0] * u)
        x = system.A @ x + system.B[:, 0] * u
    return np.array(y)


# ------------------------------------------------------------------------------------------------ PID


@pytest.mark.parametrize("gains", [PI, PID, replace(PID, proportional=0.0), replace(PID, integral=0.0)])
def test_pid_is_its_difference_equation(gains):
    """Backward differences; the derivative behind the filter tau d' + d = Kd e'."""
    error = np.random.default_rng(1).normal(size=200) * 1e-4
    integral, derivative, previous = 0.0, 0.0, 0.0
    expected = []
    for e in error:
        integral += gains.integral * PERIOD * e
        tau = gains.derivative_filter_s
        derivative = (tau * derivative + gains.derivative * (e - previous)) / (tau + PERIOD)
        previous = e
        expected.append(gains.proportional * e + integral + derivative)
    ours = respond(control.pid(gains, PERIOD), error)[:, 0]
    assert_allclose(ours, expected, rtol=0, atol=1e-13 * np.max(np.abs(expected)))


@pytest.mark.parametrize("gains", [PI, PID, Gains(0.0, 0.0, 0.05, 2e-4)], ids=["PI", "PID", "D"])
def test_pid_is_the_continuous_one_at_low_frequency(gains):
    freq_hz = np.geomspace(0.1, 50, 20)
    s = 2j * pi * freq_hz
    continuous = gains.proportional + gains.integral / s
    continuous += gains.derivative * s / (gains.derivative_filter_s * s + 1)
    ours = lti.frequency_response(control.pid(gains, PERIOD), freq_hz, PERIOD)[:, 0, 0]
    assert np.max(np.abs(ours / continuous - 1)) < 2 * pi * 50 * PERIOD
    fast = lti.frequency_response(control.pid(gains, PERIOD), np.array([10e3]), PERIOD)[0, 0, 0]
    s = 2j * pi * 10e3
    there = gains.proportional + gains.integral / s + gains.derivative * s / (gains.derivative_filter_s * s + 1)
    assert abs(fast / there - 1) > 0.01


def test_gains_keep_the_loop_gain(mission):
    half = control.gains_from_mission(mission.control, 2 * 0.089e-3)
    same = control.gains_from_mission(mission.control, 0.089e-3)
    assert_allclose([same.proportional, same.integral, same.derivative], [1e3, 16e6, 0.0], rtol=1e-12)
    assert_allclose([half.proportional, half.integral], [0.5e3, 8e6], rtol=1e-12)
    damping = mission.control.model_copy(update={"derivative_v_s_rad": 3.0})
    assert control.gains_from_mission(damping, 2 * 0.089e-3).derivative == pytest.approx(1.5, rel=1e-12)
    assert half.derivative_filter_s == same.derivative_filter_s == pytest.approx(1e-4)


@pytest.mark.promise("mirror-file-7")
@pytest.mark.promise("sampled-loop-1")
def test_the_drive_is_seen_at_the_amplifiers_input_about_the_bias(mission):
    drive = control.drive_from_mission(mission)
    assert_allclose([drive.minimum_v, drive.maximum_v], [-6.0, 6.0], rtol=1e-12)
    assert_allclose([drive.bandwidth_hz, drive.slew_v_s], [5e3, 1e6 / 15], rtol=1e-12)
    assert_allclose([drive.drive_resolution_v, drive.sensor_resolution_rad], [0.305e-3, 0.027e-6], rtol=1e-12)


@pytest.mark.promise("sampled-loop-1")
def test_timing_is_in_whole_plant_steps(mission):
    timing = control.timing_from_mission(mission.control)
    assert (timing.steps_per_sample, timing.delay_steps) == (2, 2)
    assert_allclose([timing.period_s, timing.step_s], [20e-6, 10e-6], rtol=1e-12)


@pytest.mark.parametrize("gains", [PI, PID, replace(PID, proportional=0.0)], ids=["PI", "PID", "ID"])
def test_anti_windup_takes_the_error_that_just_reaches_the_limit(gains):
    """Hanus: the states after a clipped sample are those of the error with C x + D e = limit."""
    c = control.pid(gains, PERIOD)
    L = control.anti_windup(c)
    x, e, limit = np.array([0.7, -2e-4])[: c.order], 5e-4, 0.6
    v = float((c.C @ x)[0] + c.D[0, 0] * e)
    assert v > limit
    conditioned = (limit - float((c.C @ x)[0])) / c.D[0, 0]
    ours = c.A @ x + c.B[:, 0] * e + L[:, 0] * (limit - v)
    assert_allclose(ours, c.A @ x + c.B[:, 0] * conditioned, rtol=1e-12)
    assert np.any(np.abs(ours - (c.A @ x + c.B[:, 0] * e)) > 1e-3 * np.abs(ours))


def test_anti_windup_without_direct_path_is_zero():
    integrator = lti.StateSpace(np.eye(1), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)))
    assert_allclose(control.anti_windup(integrator), 0.0)


# ------------------------------------------------------------------------------------------------ inverses


@pytest.mark.promise("choose-3")
@pytest.mark.promise("hysteresis-14", "hysteresis-15")
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_inverse_of_plays_is_exact(seed):
    rng = np.random.default_rng(seed)
    thresholds = np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 1.0, 6))])
    weights = rng.uniform(0.0, 0.03e-3, 7)
    weights[0], weights[3] = 0.05e-3, 0.0
    model = PrandtlIshlinskii(tuple(thresholds), tuple(weights))
    wanted = 0.4e-3 * np.cumsum(rng.normal(size=500)) / 10
    drive = model.inverse(wanted, 1e-3)
    reached = oracles.play_response(drive, thresholds, [0.0] * 7) @ weights
    assert_allclose(reached, wanted, rtol=0, atol=1e-16)
    without = oracles.play_response(wanted / weights.sum(), thresholds, [0.0] * 7) @ weights
    assert np.max(np.abs(without - wanted)) > 1e-5


@pytest.mark.promise("mirror-file-21")
def test_plays_that_stand_still_after_a_reversal_have_no_inverse():
    with pytest.raises(ValueError, match=r"no weight at threshold 0.*identify it again"):
        PrandtlIshlinskii((0.0, 0.5), (0.0, 1e-4)).inverted()
    bent = PrandtlIshlinskii((0.0, 0.5), (1e-4, 1e-4), polynomial_rad=(0.0, 1e-5, 0.0), reach_v=2.0)
    with pytest.raises(ValueError, match="has a polynomial beside its plays, and the inverse knows plays alone"):
        bent.inverted()
    with pytest.raises(ValueError, match="has no inverse"):
        control.inverse(mirror.assemble("axis", "static", None, PrandtlIshlinskii((0.0, 0.5), (0.0, 1e-4))))


@pytest.mark.promise("hysteresis-15")
def test_the_inverse_of_several_axes_names_its_actuators():
    plays = PrandtlIshlinskii((0.0, 0.4), (0.06e-3, 0.02e-3))
    parts = [mirror.assemble("axis", "static", None, model) for model in (plays, PAPER, plays)]
    inverse = control.inverse(mirror.combine(*parts))
    assert inverse.bouc_wen == (PAPER,)
    assert inverse.bouc_wen_actuator == (1,)
    assert inverse.play_actuator == (0, 2)
    assert_allclose(inverse.direct, [1 / 0.06e-3, 0.0, 1 / 0.06e-3])
    assert_allclose(inverse.play_thresholds, [0.06e-3 * 0.4] * 2)
    assert_allclose(inverse.play_weights, [1 / 0.08e-3 - 1 / 0.06e-3] * 2)


def test_no_feedforward_does_nothing(straight):
    assert control.no_feedforward(straight) == Inverse(direct=(0.0,))


# ------------------------------------------------------------------------------------------------ the sampled plant

SILENT = lti.StateSpace(np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)))


@pytest.mark.promise("sampled-loop-1")
@pytest.mark.parametrize("composition", ["cascade", "additive"])
@pytest.mark.parametrize("bandwidth_hz", [inf, 5e3])
@pytest.mark.parametrize("steps", [1, 2, 4])
@pytest.mark.parametrize("delay", [0, 1, 2, 5])
def test_the_sampled_plant_is_what_the_compiled_loop_does(mission, composition, bandwidth_hz, steps, delay):
    """The loop opened: the feedforward passes the reference on as volts, and the controller is silent.

    The additive plant has a direct path too: an output that follows the amplifier at once.
    """
    drive, timing = Drive(-inf, inf, bandwidth_hz, inf, 0.0, 0.0), Timing(4 * PERIOD, steps, delay)
    model = (
        PrandtlIshlinskii((0.0, 0.0), (0.06e-3, 0.029e-3)) if composition == "additive" else hysteresis.gain_only(PAPER)
    )
    m = mirror.assemble("axis", composition, mirror.linear_part(mission.mirror.linear)[0], model)
    volts = np.random.default_rng(4).normal(size=150)
    setup = simulate.Setup(drive, timing, SILENT)
    trace = simulate.track("open", m, setup, Inverse(direct=(1.0,)), volts[:, None], slice(None))
    expected = respond(control.sampled_plant(m, drive, timing), volts)
    assert_allclose(trace.command_v[:, 0], volts, rtol=1e-14)
    assert_allclose(trace.output_rad, expected, rtol=0, atol=1e-9 * np.max(np.abs(expected)))
    assert np.max(np.abs(expected)) > 10e-6


def test_the_sampled_plant_of_a_static_mirror_by_hand():
    """Gain, amplifier and two steps of delay: the first sample arrives after the delay, the rest exponentially."""
    static = mirror.assemble("axis", "static", None, PrandtlIshlinskii((0.0,), (0.5,)))
    drive, timing = replace(IDEAL_DRIVE, bandwidth_hz=2e3), Timing(4e-5, 2, 3)
    left = np.exp(-2 * pi * 2e3 * 2e-5)
    expected = [0.0, 0.0, 0.5 * (1 - left), 0.5 * (1 - left**3), 0.5 * (1 - left**5)]
    assert_allclose(respond(control.sampled_plant(static, drive, timing), np.ones(5))[:, 0], expected, rtol=1e-12)


@pytest.mark.promise("hysteresis-9")
@pytest.mark.parametrize(("bandwidth_hz", "share"), [(5e3, 0.02), (inf, None)])
def test_an_amplifier_with_a_bandwidth_keeps_the_rate_finite_and_an_ideal_one_leaves_it_to_the_step(
    bandwidth_hz, share
):
    """A step of 0.5 V on a mirror whose growth with the rate has no limit, in plant steps of 20 us and of half."""
    model = BoucWen(0.089e-3, 0.0, -0.022e-3, 1e-4, 2.4, 0.6)
    m, drive = mirror.assemble("axis", "static", None, model), replace(IDEAL_DRIVE, bandwidth_hz=bandwidth_hz)
    ends = []
    for steps in (5, 10):
        setup = simulate.Setup(drive, Timing(100e-6, steps, 0), SILENT)
        trace = simulate.track("step", m, setup, Inverse(direct=(1.0,)), np.full((40, 1), 0.5), slice(None))
        ends.append(trace.output_rad[-1, 0] - 0.089e-3 * 0.5)
    if share is None:
        assert abs(ends[1]) > 2.0 * abs(ends[0]) > 1e-6
    else:
        assert_allclose(ends[1], ends[0], rtol=share)


# ------------------------------------------------------------------------------------------------ margins


def loops(mission):
    """Controller, sampled plant and period of loops that differ in what limits them."""
    linear = mirror.linear_part(mission.mirror.linear)[0]
    paper = mirror.assemble("paper", "cascade", linear, hysteresis.gain_only(PAPER))
    static = mirror.assemble("static", "static", None, hysteresis.gain_only(PAPER))
    w = 2 * pi * 300
    light = lti.modal_from_polynomials((w * w,), (1.0, 0.04 * w, w * w))
    resonant = mirror.assemble("resonant", "cascade", light, PrandtlIshlinskii((0.0,), (1.0,)))
    real, slow = replace(IDEAL_DRIVE, bandwidth_hz=5e3), Timing(1e-4, 2, 3)
    cases = {
        "the mission's": (paper, real, Timing(PERIOD, 2, 2), PI),
        "four times its gains": (paper, real, Timing(PERIOD, 2, 2), Gains(4e3, 64e6, 0.0, 1e-4)),
        "with a derivative": (paper, real, Timing(PERIOD, 2, 2), PID),
        "proportional, fast": (paper, real, Timing(PERIOD, 2, 2), Gains(8e3, 16e6, 0.0, 1e-4)),
        "static, long delay": (static, real, Timing(PERIOD, 1, 20), Gains(0.0, 16e6, 0.0, 1e-4)),
        "resonant": (resonant, real, slow, Gains(0.0, 30.0, 0.0, 1e-4)),
    }
    return {
        name: (control.pid(gains, timing.period_s), control.sampled_plant(m, drive, timing), timing.period_s)
        for name, (m, drive, timing, gains) in cases.items()
    }


LOOPS = [
    "the mission's",
    "four times its gains",
    "with a derivative",
    "proportional, fast",
    "static, long delay",
    "resonant",
]


def scaled(controller, factor):
    return replace(controller, C=factor * controller.C, D=factor * controller.D)


def largest_pole(controller, plant, period_s):
    """Spectral radius of the closed loop, by python-control."""
    series = [python_control.ss(s.A, s.B, s.C, s.D, period_s) for s in (controller, plant)]
    return float(np.max(np.abs(python_control.feedback(series[1] * series[0], 1).poles())))


@pytest.mark.parametrize("name", LOOPS)
def test_the_gain_margin_is_where_the_loop_becomes_unstable(mission, name):
    controller, plant, period = loops(mission)[name]
    low, high = 1.0, 1000.0
    assert largest_pole(controller, plant, period) < 1 < largest_pole(scaled(controller, high), plant, period)
    while high / low > 1 + 1e-6:
        middle = sqrt(low * high)
        stable = largest_pole(scaled(controller, middle), plant, period) < 1
        low, high = (middle, high) if stable else (low, middle)
    gain = control.margins(controller, plant, period).gain_up
    print(f"{name}: gain margin {gain:.4f}, unstable from {high:.4f}")
    assert_allclose(gain, low, rtol=0.01)


def test_the_gain_margin_of_an_integrator_is_at_half_the_sample_rate():
    """L = k / (z - 1) is -k/2 at z = -1: unstable from k = 2 on, whatever the clock."""
    static = mirror.assemble("axis", "static", None, PrandtlIshlinskii((0.0,), (1.0,)))
    plant = control.sampled_plant(static, IDEAL_DRIVE, Timing(1e-3, 1, 0))
    margins = control.margins(control.pid(Gains(0.0, 500.0, 0.0, 1.0), 1e-3), plant, 1e-3)
    assert_allclose(margins.gain_up, 4.0, rtol=1e-3)


def test_the_phase_margin_of_a_resonance_that_rises_through_one():
    """A light mode past the crossover, turned by delay to where it is stable: 20 degrees at its rising flank."""
    w = 2 * pi * 300
    light = lti.modal_from_polynomials((w * w,), (1.0, 0.01 * w, w * w))
    m = mirror.assemble("resonant", "cascade", light, PrandtlIshlinskii((0.0,), (1.0,)))
    timing = Timing(1e-4, 1, 8)
    setup = simulate.Setup(IDEAL_DRIVE, timing, control.pid(Gains(0.0, 56.0, 0.0, 1e-4), timing.period_s))
    response = lti.frequency_response(simulate.sampled_loop(m, setup), np.linspace(250, 350, 20_001), 1e-4)[:, 0, 0]
    rising = np.flatnonzero((np.abs(response[:-1]) < 1) & (np.abs(response[1:]) >= 1))
    assert_allclose(np.degrees(np.abs(np.angle(-response[rising]))), 19.6, atol=0.1)
    assert simulate.margins(m, setup).phase_rad < np.radians(21)


@pytest.mark.parametrize("name", [name for name in LOOPS if name != "resonant"])
def test_margins_against_python_control(mission, name):
    """But for the resonant loop, for which python-control's own grid is too coarse."""
    controller, plant, period = loops(mission)[name]
    ours = control.margins(controller, plant, period)
    loop = lti.series(controller, plant)
    rad_s = 2 * pi * np.geomspace(0.5, 0.5 / period, 2000)
    response = python_control.ss(loop.A, loop.B, loop.C, loop.D, period)(np.exp(1j * rad_s * period))
    margins = python_control.stability_margins((np.abs(response), np.degrees(np.unwrap(np.angle(response))), rad_s))
    gain, phase_deg, modulus, _, crossover_rad_s, _ = margins
    print(f"{name}: {ours}")
    assert_allclose(ours.gain_up, gain, rtol=0.005)
    assert_allclose(ours.phase_rad, np.radians(phase_deg), rtol=1e-3)
    assert_allclose(ours.crossover_hz, crossover_rad_s / (2 * pi), rtol=1e-3)
    assert_allclose(ours.modulus, modulus, rtol=1e-3)
    assert_allclose(
        control.slowest_pole(lti.series(controller, plant)), largest_pole(controller, plant, period), rtol=1e-12
    )


@pytest.mark.parametrize("name", LOOPS)
def test_the_modulus_margin_on_a_dense_grid(mission, name):
    controller, plant, period = loops(mission)[name]
    loop = lti.series(controller, plant)
    freq_hz = np.concatenate([np.geomspace(1e-2, 0.5 / period, 8000), np.linspace(1, 0.5 / period, 8000)])
    dense = np.min(np.abs(1 + lti.frequency_response(loop, freq_hz, period)))
    assert_allclose(control.margins(controller, plant, period).modulus, dense, rtol=1e-3)
    assert dense < 0.99


def test_the_delay_margin_is_the_delay_that_destabilises(mission, straight):
    """As many more plant steps of delay, and the loop is at its limit: 1 % to either side of it."""
    drive, timing = control.drive_from_mission(mission), Timing(PERIOD, 1, 1)
    controller = control.pid(PI, PERIOD)
    spare = control.margins(controller, control.sampled_plant(straight, drive, timing), PERIOD).delay_s / PERIOD
    assert 45 < spare < 55

    def largest(steps):
        return largest_pole(
            controller, control.sampled_plant(straight, drive, replace(timing, delay_steps=steps)), PERIOD
        )

    assert largest(1 + int(0.99 * spare)) < 1 < largest(1 + int(1.01 * spare) + 1)


def test_a_loop_that_never_reaches_one_has_no_crossover(straight):
    weak = control.pid(Gains(10.0, 1e-3, 0.0, 1e-4), PERIOD)
    plant = control.sampled_plant(straight, IDEAL_DRIVE, Timing(PERIOD, 1, 0))
    margins = control.margins(weak, plant, PERIOD)
    assert isnan(margins.crossover_hz)
    assert margins.phase_rad == margins.delay_s == inf
    assert 0.99 < margins.modulus <= 1.0 + 1e-6


def test_an_unstable_loop_is_refused_with_its_pole(straight):
    controller = control.pid(Gains(1e3, 50 * 16e6, 0.0, 1e-4), PERIOD)
    plant = control.sampled_plant(straight, replace(IDEAL_DRIVE, bandwidth_hz=5e3), Timing(PERIOD, 2, 2))
    with pytest.raises(ValueError, match=r"unstable: a pole at \|z\| = .*2e-05 s; lower the gains") as refusal:
        control.margins(controller, plant, PERIOD)
    share = float(re.search(r"all of them at (\S+) of what they are it has 6 dB", str(refusal.value)).group(1))
    less = control.pid(Gains(share * 1e3, share * 50 * 16e6, 0.0, 1e-4), PERIOD)
    assert control.margins(less, plant, PERIOD).gain_up == pytest.approx(2.0, rel=0.06)
    named = float(re.search(r"\|z\| = (\S+)", str(refusal.value)).group(1))
    assert named > 1.0
    assert_allclose(named, largest_pole(controller, plant, PERIOD), atol=1e-6)


@pytest.mark.parametrize("freq_hz", [15.0, 80.0, 250.0])
def test_the_sensitivity_is_the_error_of_a_simulated_sine(straight, freq_hz):
    timing = Timing(PERIOD, 2, 2)
    setup = simulate.Setup(replace(IDEAL_DRIVE, bandwidth_hz=5e3), timing, control.pid(PI, PERIOD))
    s = control.sensitivity(simulate.sampled_loop(straight, setup), freq_hz, PERIOD)
    trace = simulate.track_sine("sine", straight, setup, control.no_feedforward(straight), 300e-6, freq_hz)
    amplitude = sqrt(2) * trace.rms_rad
    print(f"{freq_hz:g} Hz: {300 * abs(s):.4f} µrad, simulated {1e6 * amplitude:.4f}")
    assert_allclose(300e-6 * abs(s), amplitude, rtol=1e-3)
    time = trace.time_s[trace.steady]
    expected = 300e-6 * np.imag(s * np.exp(2j * pi * freq_hz * time))
    assert_allclose(trace.error_rad[trace.steady, 0], expected, rtol=0, atol=2e-3 * amplitude)


def test_the_sensitivity_of_an_integrator_by_hand():
    """v[k] = sum e, y[k] = v[k-1] / 10 through one sample of hold: 1 + L with L = 0.1 / (z - 1)."""
    static = mirror.assemble("axis", "static", None, PrandtlIshlinskii((0.0,), (1.0,)))
    setup = simulate.Setup(IDEAL_DRIVE, Timing(1e-3, 1, 0), control.pid(Gains(0.0, 100.0, 0.0, 1.0), 1e-3))
    z = np.exp(2j * pi * 20 * 1e-3)
    s = control.sensitivity(simulate.sampled_loop(static, setup), 20.0, 1e-3)
    assert s == pytest.approx((z - 1) / (z - 0.9), rel=1e-12)
    assert abs(s) > 2 * (1 - cos(0.1))


@pytest.mark.parametrize(("bandwidth_hz", "share"), [(inf, 1.0), (5e3, 1 - np.exp(-0.1 * pi)), (1.0, 2e-5 * pi)])
def test_the_amplifiers_share_of_one_step(bandwidth_hz, share):
    assert control.amplifier_factor(replace(IDEAL_DRIVE, bandwidth_hz=bandwidth_hz), 1e-5) == pytest.approx(
        share, rel=1e-4
    )


def test_a_direct_path_that_no_double_can_divide_by_is_none():
    one = lti.StateSpace(np.array([[1.0]]), np.array([[1e-4]]), np.array([[2.0]]), np.array([[1e-320]]))
    assert np.array_equal(control.anti_windup(one), [[0.0]])
    there = lti.StateSpace(one.A, one.B, one.C, np.array([[1e-20]]))
    assert control.anti_windup(there) == pytest.approx(1e16, rel=1e-12)


# ---------------------------------------------------------------------- recursions of numbers unlike each other
@pytest.mark.parametrize(
    "gains", [(3e3, 4e6, 2.5, 3e-4), (3e3, 0, 2.5, 0), (0, 4e6, 0, 1e-3), (-7.0, -4.0, -2.0, 0.1), (5.0, 0, 0, 0.2)]
)
def test_a_pid_is_its_difference_equations_with_a_state_for_each_part_that_is_there(gains):
    p, i, d, tau = gains
    period, errors = 1.6e-3, np.random.default_rng(2).standard_normal(30)
    s = control.pid(control.Gains(*gains), period)
    assert s.order == (i != 0.0) + (d != 0.0)
    x, total, slope, before = np.zeros(s.order), 0.0, 0.0, 0.0
    for e in errors:
        total, slope, before = total + i * period * e, (tau * slope + d * (e - before)) / (tau + period), e
        assert (s.C @ x + s.D[:, 0] * e).item() == pytest.approx(p * e + total + slope, rel=1e-9)
        x = s.A @ x + s.B[:, 0] * e


@pytest.mark.parametrize(("steps", "delay"), [(1, 0), (1, 3), (4, 0), (4, 3), (4, 4), (4, 11)])
@pytest.mark.parametrize("bandwidth_hz", [700.0, inf])
def test_a_sampled_path_is_the_plant_step_by_step_behind_delay_and_amplifier(steps, delay, bandwidth_hz):
    """A mirror with a direct term and two outputs, advanced by hand; more delay than a sample, too."""
    linear = lti.StateSpace(
        np.array([[-300.0, 900.0], [-900.0, -200.0]]), np.array([[70.0], [-40.0]]), np.array([[1.0, 0.3], [0.2, 2.0]]),
        np.array([[0.01], [0.4]]),
    )  # fmt: skip
    timing = control.Timing(8e-4, steps, delay)
    found = control.sampled_path(linear, control.Drive(-1.0, 1.0, bandwidth_hz, 1e9, 0.0, 0.0), timing)
    Ad, B0, B1 = lti.first_order_hold(linear.A, linear.B, 8e-4 / steps)
    follow = -expm1(-2 * pi * bandwidth_hz * 8e-4 / steps)
    x, drive, waiting, z = np.zeros(2), 0.0, [0.0] * delay, np.zeros(found.order)
    for command in np.random.default_rng(1).standard_normal(12):
        assert_allclose(found.C @ z, linear.C @ x + linear.D[:, 0] * drive, rtol=1e-9, atol=1e-12)
        z = found.A @ z + found.B[:, 0] * command
        for _ in range(steps):
            waiting.append(command)
            then = drive + follow * (waiting.pop(0) - drive)
            x, drive = Ad @ x + B0[:, 0] * drive + B1[:, 0] * then, then
    assert found.order == 3 + delay and not found.D.any()


def test_an_inverse_of_several_actuators_keeps_which_element_belongs_to_which():
    models = (
        PrandtlIshlinskii((0.0, 1.0, 3.0), (40e-6, 6e-6, 4e-6)), PrandtlIshlinskii((0.0, 2.5), (30e-6, 9e-6)),
    )  # fmt: skip
    creep = (Creep((1e-6, 2e-6), (0.5, 8.0)), Creep((3e-6,), (2.0,)))
    made = SimpleNamespace(actuators=2, inverse=models, inverse_creep=creep)
    found = control.inverse(made)
    own = [model.inverted() for model in models]
    assert found.direct == tuple(each.weights_rad_v[0] for each in own)
    assert found.play_thresholds == (*own[0].thresholds_v[1:], *own[1].thresholds_v[1:])
    assert found.play_weights == (*own[0].weights_rad_v[1:], *own[1].weights_rad_v[1:])
    assert (found.play_actuator, found.bouc_wen, found.creep) == ((0, 0, 1), (), creep)
    arrays = control.inverse_arrays(found, 0.2)
    assert_allclose(arrays["inverse_lag_keep"], np.exp([-0.4, -0.025, -0.1]), rtol=1e-12)
    assert_allclose(arrays["inverse_lag_weight"], [1e-6, 2e-6, 3e-6])
    assert [arrays[f"inverse_{of}_actuator"].tolist() for of in ("lag", "play")] == [[0, 0, 1]] * 2
    assert_allclose(arrays["inverse_play_weight"], found.play_weights)
    assert_allclose(arrays["inverse_widening"], found.widening)
    plain = control.inverse_arrays(control.Inverse((1.0, 2.0, 3.0)), 0.2)
    assert_allclose(plain["inverse_widening"], [[0, inf]] * 3)


def test_a_mirror_of_several_axes_has_no_sampled_plant_and_is_told_with_both_its_counts(straight):
    one = mirror.combine(straight, straight, straight)
    three = replace(one, name="tripod", C=one.C[:2], D=one.D[:2], K=one.K[:2])
    with pytest.raises(ValueError) as refused:
        control.sampled_plant(three, IDEAL_DRIVE, Timing(PERIOD, 1, 0))
    assert str(refused.value) == "mirror 'tripod' has 3 actuators and 2 axes: give one axis at a time"


def test_a_loop_without_states_has_no_pole_and_a_slow_one_its_largest():
    none = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[0.5]]))
    assert control.slowest_pole(none) == 0.0
    A, B = np.diag([0.5, -0.9]), np.array([[1.0], [0.0]])
    assert control.slowest_pole(lti.StateSpace(A, B, np.array([[0.25, 0.0]]), np.zeros((1, 1)))) == pytest.approx(0.9)
    assert control.slowest_pole(lti.StateSpace(A, B, np.array([[-0.75, 0.0]]), np.zeros((1, 1)))) == pytest.approx(1.25)


@pytest.mark.parametrize(("steps", "late"), [(13, 28), (29, 7), (15, 31), (8, 0)])
def test_a_ratio_just_below_a_whole_number_of_plant_steps_is_that_number(steps, late):
    step = 1e-5
    clock = SimpleNamespace(rate_hz=1.0 / (steps * 1e-5), plant_step_s=step, delay_s=float(f"{late}e-5"))
    timing = control.timing_from_mission(clock)
    assert (timing.steps_per_sample, timing.delay_steps) == (steps, late)
    assert_allclose(timing.period_s, steps * step, rtol=1e-12)


@pytest.mark.parametrize(
    ("unstable", "share"), [([(0.5, 2.0)], 0.25), ([(0.5, 2.0), (0.2, 0.3)], 0.2), ([(0.0, 2.0)], 0.0)]
)
def test_gains_are_advised_that_are_stable_with_themselves_and_with_twice_as_much(monkeypatch, unstable, share):
    """Gains of these open ranges make the loop unstable; what is advised is half of the largest that does."""

    def slowest(loop):
        gain = abs(loop.D[0, 0])
        return 1.5 if any(low < gain < high for low, high in unstable) else 0.5

    one = lti.StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1)))
    monkeypatch.setattr(sampled, "slowest_pole", slowest)
    said = sampled._advice(one, one)
    if not share:
        assert said == ""
    else:
        told = re.fullmatch(r" \(with all of them at (\S+) of what they are it has 6 dB of gain margin\)", said)
        assert 0.94 * share < float(told[1]) <= 1.01 * share
