"""Closed loop, variances and margins against closed forms, simulation, scipy and python-control."""

import math
import re
from dataclasses import astuple, replace
from functools import partial

import control as python_control
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import solve_discrete_lyapunov

from design_plants import axis_plant
from microrad.core import lti
from microrad.loop.control import analysis
from microrad.loop.control.problem import GAUGE, OPTICAL, RESIDUAL, AxisController, DesignPlant

PERIOD = 2e-4
near = partial(pytest.approx, abs=0.0, rel=1e-6)  # variances are far below the default of 1e-12


def controller_of(A, B, C, D, name="test"):
    """From plain lists; columns of B and D: optical, gauge."""
    A, B, C, D = (np.array(m, dtype=float) for m in (A, B, C, D))
    return AxisController(name, lti.StateSpace(A, B, C, D), np.zeros((A.shape[0], 1)))


def integrator(step):
    """v[k] = v[k-1] + step e[k]."""
    return controller_of([[1.0]], [[step, 0.0]], [[1.0]], [[step, 0.0]], "integral")


def pi(proportional, integral, period_s=PERIOD):
    """Backward differences, on the optical sensor."""
    step = integral * period_s
    return controller_of([[1.0]], [[step, 0.0]], [[1.0]], [[proportional + step, 0.0]], "PI")


def proportional(gain):
    return controller_of(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), [[gain, 0.0]], "proportional")


def both_sensors(plant, damping=-0.3):
    """PI on the optical sensor and a high-passed gauge that damps."""
    k = 1.0 / plant.gain_rad_v
    step = 500.0 * PERIOD * k
    return controller_of(
        [[1.0, 0.0], [0.0, 0.6]],
        [[step, 0.0], [0.0, 0.4]],
        [[1.0, damping * k]],
        [[0.1 * k + step, -damping * k]],
        "dual",
    )


def pure_gain(period_s, rms_rad=1e-6, noise_rad=0.0):
    """y[k+1] = gain v[k], nothing else."""
    return axis_plant(
        delay=0,
        amplifier_hz=math.inf,
        gauge=False,
        noise_rad=noise_rad,
        disturbance_rad=rms_rad,
        corner_hz=1.0,
        period_s=period_s,
    )


def simulate(plant, controller, white, burn):
    """Difference equations of plant and controller, run by run: residual and command, shape (steps, runs)."""
    p, c = plant.system, controller.system
    x, xc = np.zeros((p.order, white.shape[2])), np.zeros((c.order, white.shape[2]))
    residual, command = [], []
    for w in white:
        out = p.C @ x + p.D[:, 1:] @ w
        m = out[[OPTICAL, GAUGE]]
        v = c.C @ xc + c.D @ m
        residual.append(out[RESIDUAL])
        command.append(v[0])
        x = p.A @ x + p.B[:, :1] @ v + p.B[:, 1:] @ w
        xc = c.A @ xc + c.B @ m
    return np.array(residual)[burn:], np.array(command)[burn:]


def radius(plant, controller):
    """Largest |z|, from the difference equations written out as one matrix."""
    p, c = plant.system, controller.system
    n = p.order
    step = np.zeros((n + c.order, n + c.order))
    for j in range(n + c.order):
        x = np.eye(n + c.order)[j]
        m = p.C[[OPTICAL, GAUGE]] @ x[:n]
        v = c.C @ x[n:] + c.D @ m
        step[:, j] = np.concatenate([p.A @ x[:n] + p.B[:, 0] * v, c.A @ x[n:] + c.B @ m])
    return np.max(np.abs(np.linalg.eigvals(step)))


def scaled(controller, factor):
    s = controller.system
    return replace(controller, system=lti.StateSpace(s.A, s.B, factor * s.C, factor * s.D))


# ------------------------------------------------------------------------------------------------ variances


@pytest.mark.promise("sampled-loop-7")
@pytest.mark.parametrize("bandwidth_hz", [10.0, 100.0, 500.0])
def test_a_first_order_loop_leaves_80_pi_over_1_plus_fb_of_olympus(bandwidth_hz):
    period_s = 1e-6
    plant = pure_gain(period_s, rms_rad=math.sqrt(80 * math.pi) * 1e-6)  # the radial spectrum 160/(1 + f^2) urad^2/Hz
    share = 2 * math.pi * bandwidth_hz * period_s
    found = analysis.h2(analysis.close(plant, integrator(share / plant.gain_rad_v)))[RESIDUAL].sum()
    assert found == near(80 * math.pi / (1 + bandwidth_hz) * 1e-12, rel=0.6 * share + 1e-5)
    a, b = math.exp(-2 * math.pi * period_s), 1 - share  # and the sampled loop in closed form
    exact = 2 * 80 * math.pi * 1e-12 * (1 - a) / ((1 + b) * (1 - a * b))
    assert found == near(exact, rel=1e-8)


@pytest.mark.parametrize("share", [0.01, 0.3, 1.0, 1.9])
def test_white_sensor_noise_through_a_first_order_loop(share):
    plant = pure_gain(PERIOD, rms_rad=0.0, noise_rad=2e-6)
    variance = analysis.h2(analysis.close(plant, integrator(share / plant.gain_rad_v)))
    assert variance[RESIDUAL].sum() == near(4e-12 * share / (2 - share), rel=1e-12)
    assert variance[OPTICAL].sum() == near(4e-12 * (share / (2 - share) + 1), rel=1e-12)
    assert variance[analysis.COMMAND].sum() * plant.gain_rad_v**2 == near(variance[RESIDUAL].sum(), rel=1e-12)


@pytest.mark.promise("sampled-loop-4")
def test_variances_are_those_of_a_long_simulation():
    plant = axis_plant(resonance=(900.0, 0.05), corner_hz=50.0)
    controller = both_sensors(plant)
    runs, steps, burn = 300, 900, 400
    white = np.random.Generator(np.random.Philox(5)).standard_normal((steps, plant.disturbances + 2, runs))
    residual, command = simulate(plant, controller, white, burn)
    closed = analysis.h2(analysis.close(plant, controller))
    for trace, output in ((residual, RESIDUAL), (command, analysis.COMMAND)):
        squares = np.mean(trace**2, axis=0)  # one independent number a run
        expected, error = closed[output].sum(), np.std(squares, ddof=1) / math.sqrt(runs)
        print(f"simulated {np.mean(squares):.4e}, stationary {expected:.4e}, standard error {error:.1e}")
        assert error < 0.03 * expected
        assert abs(np.mean(squares) - expected) < 4 * error


@pytest.mark.promise("sampled-loop-4")
@pytest.mark.parametrize("corner_hz", [1e-3, 0.01, 0.1])
def test_variances_are_those_of_scipy_even_for_time_constants_of_a_million_samples(corner_hz):
    plant = axis_plant(resonance=(900.0, 0.005), corner_hz=corner_hz, disturbance_rad=1e-4)
    closed = analysis.close(plant, both_sensors(plant))
    slowest = np.max(np.abs(np.linalg.eigvals(closed.A)))
    assert 1.0 - slowest == near(2 * math.pi * corner_hz * PERIOD, rel=1e-3)
    covariance = solve_discrete_lyapunov(closed.A, closed.B @ closed.B.T)
    expected = np.diag(closed.C @ covariance @ closed.C.T + closed.D @ closed.D.T)
    assert_allclose(analysis.h2(closed).sum(axis=1), expected, rtol=1e-6)


def test_variances_by_source_add_up_and_name_the_right_one():
    plant = axis_plant(gauge_noise_rad=0.5e-6)
    parts = analysis.by_source(plant, both_sensors(plant))
    assert sum(parts.values()) == near(analysis.h2(analysis.close(plant, both_sensors(plant)))[RESIDUAL].sum())
    louder = analysis.by_source(axis_plant(gauge_noise_rad=1e-6), both_sensors(plant))
    assert louder["gauge noise"] == near(4 * parts["gauge noise"])
    assert louder["optical noise"] == near(parts["optical noise"])
    assert parts["gauge noise"] > 0.0
    assert analysis.by_source(plant, pi(1e3, 5e6))["gauge noise"] == 0.0


def test_an_undamped_disturbance_has_no_variance():
    plant = pure_gain(PERIOD)
    A = plant.system.A.copy()
    A[-1, -1] = 1.0
    drifting = replace(plant, system=replace(plant.system, A=A))
    controller = integrator(0.1 / plant.gain_rad_v)
    analysis.refuse_unstable(drifting, controller)  # the loop itself is stable
    with pytest.raises(
        ValueError, match=r"no stationary variance: a pole at \|z\| = 1\.0.*give the disturbance some damp"
    ):
        analysis.h2(analysis.close(drifting, controller))


# ------------------------------------------------------------------------------------------------ the loop


@pytest.mark.parametrize("resonance", [None, (900.0, 0.01)])
def test_poles_are_those_of_the_difference_equations(resonance):
    plant = axis_plant(resonance=resonance, lines=((87.0, 1e-6),), delay=2)
    controller = both_sensors(plant)
    found = analysis.loop_poles(plant, controller)
    whole = np.linalg.eigvals(analysis.close(plant, controller).A)
    assert radius(plant, controller) == near(np.max(np.abs(whole)), rel=1e-12)
    assert whole.size - found.size == 3  # drift and line are not the loop's
    for pole in found:
        assert np.min(np.abs(whole - pole)) < 1e-6


def test_the_loop_cut_at_the_command_is_what_comes_back_from_it():
    plant = axis_plant(resonance=(900.0, 0.01))
    controller = both_sensors(plant)
    freq_hz = np.array([0.5, 30.0, 400.0, 899.0, 2400.0])
    L = -lti.frequency_response(lti.series(plant.from_command, controller.system), freq_hz, PERIOD)[:, 0, 0]
    assert_allclose(analysis.loop_response(plant, controller, freq_hz), L, rtol=1e-9)


def test_the_loop_cut_at_the_optical_sensor_keeps_the_gauges_loop_closed():
    plant = axis_plant(resonance=(900.0, 0.01))
    controller = both_sensors(plant)
    p, c = plant.system, controller.system
    b, gauge = p.B[:, :1], p.C[GAUGE : GAUGE + 1]
    cut = lti.StateSpace(
        np.block([[p.A + b @ c.D[:, 1:] @ gauge, b @ c.C], [c.B[:, 1:] @ gauge, c.A]]),
        np.vstack([b @ c.D[:, :1], c.B[:, :1]]),
        -np.hstack([p.C[OPTICAL : OPTICAL + 1], np.zeros((1, c.order))]),
        np.zeros((1, 1)),
    )
    freq_hz = np.array([0.5, 30.0, 400.0, 899.0, 2400.0])
    expected = lti.frequency_response(cut, freq_hz, PERIOD)[:, 0, 0]
    assert_allclose(analysis.loop_response(plant, controller, freq_hz, "optical"), expected, rtol=1e-8)
    whole = analysis.loop_response(plant, controller, freq_hz)
    assert np.all(np.abs(whole - expected)[2:] > 0.1 * np.abs(expected)[2:])


def test_a_plant_that_is_not_in_blocks_has_the_same_loop():
    plant = axis_plant(resonance=(900.0, 0.02))
    s = plant.system
    T = np.eye(s.order) + 0.1 * np.random.Generator(np.random.Philox(2)).normal(size=(s.order, s.order))
    mixed = replace(plant, system=lti.StateSpace(np.linalg.solve(T, s.A @ T), np.linalg.solve(T, s.B), s.C @ T, s.D))
    assert (analysis.moved(mixed).system.order, analysis.moved(plant).system.order) == (s.order, s.order - 1)
    ours, theirs = (analysis.loop_margins(p, both_sensors(plant)) for p in (mixed, plant))
    assert ours.modulus == near(theirs.modulus, rel=1e-6)
    assert ours.disk == near(theirs.disk, rel=1e-6)
    assert ours.bandwidth_hz == near(theirs.bandwidth_hz, rel=1e-3)


def test_a_frequency_above_half_the_control_rate_is_refused():
    plant = pure_gain(PERIOD)
    assert analysis.loop_response(plant, integrator(1.0), np.array([2500.0])).shape == (1,)
    with pytest.raises(ValueError, match=r"2600 Hz lies above half the control rate, 2500 Hz"):
        analysis.loop_response(plant, integrator(1.0), np.array([100.0, 2600.0]))


# ------------------------------------------------------------------------------------------------ margins


PLAIN = axis_plant(gauge=False)
LOOPS = {
    "integral": (PLAIN, pi(0.0, 4e6)),
    "PI": (PLAIN, pi(2e3, 9e6)),
    "PI, three samples late": (axis_plant(gauge=False, delay=3), pi(500.0, 4e6)),
    "resonance": (axis_plant(resonance=(900.0, 0.05)), pi(0.0, 5e6)),
    "sharp resonance": (axis_plant(resonance=(700.0, 0.003)), pi(0.0, 3e5)),
    "resonance beyond half a turn": (axis_plant(gauge=False, resonance=(700.0, 0.003), delay=2), pi(0.0, 2e6)),
    "proportional": (PLAIN, proportional(1.3e4)),
}


def python_loop(plant, controller):
    """The loop gain as python-control's own system, its numerator and denominator from roots."""
    K = controller.system
    K = lti.StateSpace(K.A, K.B[:, :1], K.C, K.D[:, :1])
    s = analysis.moved(plant).from_command
    G = lti.StateSpace(s.A, s.B, -s.C[:1], -s.D[:1])
    return python_control.ss(*(getattr(lti.series(G, K), key) for key in "ABCD"), plant.period_s)


@pytest.mark.promise("sampled-loop-8")
@pytest.mark.parametrize("name", LOOPS)
def test_margins_are_those_of_python_control(name):
    plant, controller = LOOPS[name]
    dense = analysis.around_poles(analysis.loop_poles(plant, controller), PERIOD, 1.02)
    omega = 2 * math.pi * np.unique(np.concatenate([np.geomspace(0.1, 2499.999, 4000), dense]))
    response = python_control.frd(python_loop(plant, controller), omega, smooth=True)
    gain, phase, modulus, _, crossover, _ = python_control.stability_margins(response)
    ours = analysis.loop_margins(plant, controller)
    assert ours.gain_up == near(gain, rel=1e-3)
    assert ours.gain_down == 0.0
    assert ours.modulus == near(modulus, rel=1e-3)
    assert ours.peak == near(1 / modulus, rel=1e-3)
    assert math.degrees(ours.phase_rad) == near(abs(phase), rel=1e-3)
    if phase < 0.0:  # theirs is the crossover of the smallest phase margin, ours the highest
        assert ours.crossover_hz > crossover / (2 * math.pi)
    else:
        assert ours.crossover_hz == near(crossover / (2 * math.pi), rel=1e-3)


@pytest.mark.promise("sampled-loop-8")
@pytest.mark.parametrize("name", LOOPS)
def test_disk_margins_are_those_of_python_control(name):
    plant, controller = LOOPS[name]
    ours = analysis.loop_margins(plant, controller)
    dense = analysis.around_poles(analysis.loop_poles(plant, controller), PERIOD, 1.05)
    omega = 2 * math.pi * np.unique(np.concatenate([np.geomspace(0.1, 2499.9, 6000), dense]))
    disk, gain_db, phase_deg = python_control.disk_margins(python_loop(plant, controller), omega)
    assert ours.disk == near(disk, rel=1e-3)
    assert 20 * math.log10(ours.disk_gain[1]) == near(gain_db, rel=1e-3)
    assert ours.disk_gain[0] * ours.disk_gain[1] == near(1.0)
    assert math.degrees(ours.disk_phase_rad) == near(phase_deg, rel=1e-3)


@pytest.mark.parametrize("name", LOOPS)
def test_gain_margins_are_where_the_loop_turns_unstable(name):
    plant, controller = LOOPS[name]
    limit = analysis.loop_margins(plant, controller).gain_up
    assert radius(plant, scaled(controller, 0.999 * limit)) < 1.0 < radius(plant, scaled(controller, 1.001 * limit))


@pytest.mark.promise("sampled-loop-10")
@pytest.mark.parametrize("name", LOOPS)
def test_margins_end_where_dense_computation_and_poles_say(name):
    plant, controller = LOOPS[name]
    found = analysis.loop_margins(plant, controller)
    L = python_loop(plant, controller)

    def at(freq_hz):
        return L(np.exp(2j * math.pi * np.asarray(freq_hz) * PERIOD))

    def least(of):
        """Smallest value on 2000 frequencies, then three times on 201 around the best one."""
        freq_hz = np.geomspace(0.01, 2500.0, 2000)
        for _ in range(4):
            size = of(at(freq_hz))
            best = int(np.argmin(size))
            freq_hz = np.linspace(freq_hz[max(best - 1, 0)], freq_hz[min(best + 1, freq_hz.size - 1)], 201)
        return float(np.min(size))

    assert abs(at(found.crossover_hz)) == near(1.0, rel=1e-9)
    assert found.modulus == near(least(lambda L: np.abs(1.0 + L)), rel=1e-9)
    assert found.disk == near(2.0 * least(lambda L: np.abs((1.0 + L) / (1.0 - L))), rel=1e-9)
    assert radius(plant, scaled(controller, found.gain_up * (1.0 - 1e-8))) < 1.0
    assert radius(plant, scaled(controller, found.gain_up * (1.0 + 1e-8))) > 1.0


@pytest.mark.promise("sampled-loop-8", "sampled-loop-9")
@pytest.mark.parametrize("name", LOOPS)
def test_a_modulus_margin_implies_margins_of_gain_and_phase_and_bounds_the_peak(name):
    found = analysis.loop_margins(*LOOPS[name])
    m = found.modulus
    assert 0.0 < m < 1.0
    assert found.gain_up >= 1.0 / (1.0 - m) * (1.0 - 1e-9)
    assert found.phase_rad >= 2.0 * math.asin(m / 2.0) * (1.0 - 1e-9)
    assert found.peak == near(1.0 / m, rel=1e-9)
    low, high = found.disk_gain
    assert low == near((2.0 - found.disk) / (2.0 + found.disk), rel=1e-12)
    assert high == near(1.0 / low, rel=1e-12)
    assert found.disk_phase_rad == near(2.0 * math.atan(found.disk / 2.0), rel=1e-12)


@pytest.mark.promise("sampled-loop-10")
@pytest.mark.parametrize("name", LOOPS)
def test_margins_do_not_depend_on_the_grid(name):
    plant, controller = LOOPS[name]
    poles = (np.linalg.eigvals(s.A) for s in (analysis.moved(plant).system, controller.system))
    grid = analysis.resolving(np.concatenate([analysis.loop_poles(plant, controller), *poles]), PERIOD)
    response = partial(analysis.loop_response, plant, controller)
    found = analysis.margins_of(response, grid)
    between = analysis.margins_of(response, np.append(np.sqrt(grid[1:] * grid[:-1]), grid[-1]))
    assert_allclose(astuple(between)[:-1], astuple(found)[:-1], rtol=1e-9)
    assert between.peak_hz == near(found.peak_hz, rel=1e-6)  # a dip is flat


def test_a_conditionally_stable_loop_has_a_gain_margin_downwards():
    plant = axis_plant(gauge=False, amplifier_hz=math.inf, delay=0)
    one = lti.StateSpace(np.eye(1), np.ones((1, 1)), np.array([[0.1]]), np.ones((1, 1)))  # 1 + 0.1 / (z - 1)
    third = lti.StateSpace(np.eye(1), np.ones((1, 1)), np.array([[0.5]]), np.array([[0.5]]))  # 0.5 z / (z - 1)
    s = lti.series(lti.series(one, one), third)
    cubic = controller_of(
        s.A, np.pad(s.B, ((0, 0), (0, 1))), s.C / plant.gain_rad_v, np.pad(s.D, ((0, 0), (0, 1))) / plant.gain_rad_v
    )
    found = analysis.loop_margins(plant, cubic)
    assert 0.0 < found.gain_down < 1.0 < found.gain_up < math.inf
    for limit, inside, outside in ((found.gain_down, 1.002, 0.998), (found.gain_up, 0.998, 1.002)):
        assert radius(plant, scaled(cubic, inside * limit)) < 1.0 < radius(plant, scaled(cubic, outside * limit))


@pytest.mark.promise("sampled-loop-8")
@pytest.mark.parametrize("resonance", [None, (700.0, 0.003)])
def test_the_delay_margin_is_the_number_of_samples_that_the_loop_bears(resonance):
    plants = [axis_plant(gauge=False, resonance=resonance, delay=2 + n) for n in range(45)]
    controller = pi(0.0, 2e6)
    found = analysis.loop_margins(plants[0], controller)
    bears = found.delay_s / PERIOD
    print(f"delay margin {bears:.3f} samples, phase margin {math.degrees(found.phase_rad):.2f} degrees")
    assert 2.0 < bears < 43.0
    later = [radius(plants[int(bears) + more], controller) for more in (0, 1)]
    assert later[0] < 1.0 < later[1]
    if resonance:  # the phase margin is a lead here, the delay margin all of a turn but that
        turn = found.phase_rad + 2 * math.pi * found.crossover_hz * found.delay_s
        assert math.degrees(turn) < 270.0
        assert math.degrees(found.phase_rad) < 60.0 < 360.0 * found.crossover_hz * found.delay_s


@pytest.mark.parametrize("period_s", [PERIOD, 2e-5, 1 / 7000])
@pytest.mark.parametrize("share", [0.03, 0.4, 0.9])
def test_bandwidth_and_crossover_of_a_first_order_loop_in_closed_form(share, period_s):
    plant = pure_gain(period_s)
    found = analysis.loop_margins(plant, integrator(share / plant.gain_rad_v))
    angle = 2 * math.pi * period_s
    assert found.bandwidth_hz == near(math.acos(1 - share / 2) / angle, rel=1e-3)
    assert found.crossover_hz == near(math.acos(1 - share**2 / 2) / angle, rel=1e-3)
    assert found.gain_up == near(2 / share, rel=1e-9)
    assert found.peak == near(1 / (1 - share / 2), rel=1e-9)
    assert found.peak_hz == near(0.5 / period_s, rel=1e-6)
    assert found.phase_rad == near(math.pi / 2 - found.crossover_hz * angle / 2, rel=1e-3)


def test_a_positive_feedback_is_limited_at_rest():
    plant = pure_gain(PERIOD)
    controller = proportional(-0.5 / plant.gain_rad_v)
    assert analysis.loop_margins(plant, controller).gain_up == near(2.0, rel=1e-6)
    assert radius(plant, scaled(controller, 1.999)) < 1.0 < radius(plant, scaled(controller, 2.001))


def test_a_loop_without_gain_has_every_margin_and_no_reach():
    plant = pure_gain(PERIOD)
    found = analysis.loop_margins(plant, proportional(0.0))
    assert (found.gain_up, found.phase_rad, found.delay_s) == (math.inf, math.inf, math.inf)
    assert (found.modulus, found.disk, found.bandwidth_hz) == (1.0, 2.0, 0.0)
    assert math.isnan(found.crossover_hz)
    assert found.disk_gain == (0.0, math.inf)
    assert found.disk_phase_rad == near(math.pi / 2)


@pytest.mark.promise("sampled-loop-11")
def test_two_sensors_report_the_worse_of_both_cuts():
    plant = axis_plant(resonance=(900.0, 0.02))
    controller = both_sensors(plant)
    whole, optical = (analysis.margins_at(plant, controller, cut) for cut in analysis.BREAKS)
    found = analysis.loop_margins(plant, controller)
    assert (whole, optical) == analysis.margins_of_cuts(plant, controller)
    assert abs(whole.modulus - optical.modulus) > 0.01
    assert found.modulus == min(whole.modulus, optical.modulus)
    assert found.disk == min(whole.disk, optical.disk)
    assert found.delay_s == min(whole.delay_s, optical.delay_s)
    assert found.bandwidth_hz == optical.bandwidth_hz != whole.bandwidth_hz
    single = pi(0.0, 2e6)
    assert analysis.loop_margins(plant, single) == analysis.margins_at(plant, single)


@pytest.mark.promise("sampled-loop-11")
@pytest.mark.parametrize("first", analysis.BREAKS)
def test_each_margin_is_the_worse_one_of_both_cuts(first, monkeypatch):
    """Of two sets of numbers, each of which is the worse one throughout: by hand, since few loops have a way down."""
    plant = axis_plant()
    real = analysis.margins_at(plant, both_sensors(plant))
    worse = replace(real, gain_up=1.5, gain_down=0.8, phase_rad=0.3, delay_s=1e-4, modulus=0.4, disk=0.5)
    better = replace(real, gain_up=3.0, gain_down=0.2, phase_rad=0.9, delay_s=9e-4, modulus=0.7, disk=0.9)

    def cuts(plant, controller):
        return tuple(worse if broken_at == first else better for broken_at in analysis.BREAKS)

    monkeypatch.setattr(analysis, "margins_of_cuts", cuts)
    found = analysis.loop_margins(plant, both_sensors(plant))
    for name in ("gain_up", "gain_down", "phase_rad", "delay_s", "modulus", "disk"):
        assert getattr(found, name) == getattr(worse, name), name


@pytest.mark.promise("sampled-loop-9")
def test_the_peak_is_the_largest_rejection_of_the_disturbance():
    """A sine on the line of sight, against the closed loop's own response from it to the residual."""
    plant = axis_plant(resonance=(900.0, 0.02))
    controller = both_sensors(plant)
    found = analysis.loop_margins(plant, controller)
    closed = analysis.close(plant, controller)
    freq_hz = np.linspace(1.0, 2499.0, 20000)
    shaped = lti.frequency_response(closed, freq_hz, PERIOD)[:, RESIDUAL, 0]
    own = lti.frequency_response(plant.system, freq_hz, PERIOD)[:, RESIDUAL, 1]
    rejection = np.abs(shaped / own)
    assert found.peak == near(np.max(rejection), rel=1e-3)
    assert found.peak_hz == near(freq_hz[np.argmax(rejection)], abs=2.0)
    assert found.bandwidth_hz == near(freq_hz[np.argmax(rejection >= 1.0)], rel=2e-3)


# ------------------------------------------------------------------------------------------------ two axes


SATELLITE = lti.StateSpace(
    np.array([[0.0, 10], [-10, 0]]), np.eye(2), np.array([[1.0, 10], [-10, 1]]), np.zeros((2, 2))
)
"""The spinning satellite of Seiler, Packard and Gahinet, under the feedback [[1, -2], [0, 1]]."""


@pytest.mark.promise("sampled-loop-8")
def test_the_spinning_satellite_has_its_published_multiloop_margin():
    freq_hz = np.concatenate([[1e-6], np.geomspace(1e-3, 1e3, 4001)])
    L = lti.frequency_response(SATELLITE, freq_hz) @ np.array([[1.0, -2.0], [0.0, 1.0]])
    found = analysis.multiloop_disk_margin(freq_hz, L)
    assert found.disk == near(0.3754, rel=3e-3)  # published from bounds 0.2 % apart
    assert math.degrees(found.disk_phase_rad) == near(21.26, rel=3e-3)
    assert 20 * math.log10(found.disk_gain[1]) == near(3.30, rel=3e-3)
    assert found.freq_hz < 1e-3


def test_loops_that_do_not_know_each_other_have_the_margin_of_the_worse_one():
    freq_hz = np.geomspace(1.0, 2500.0, 4000)
    controllers = [pi(0.0, 4e6), pi(2e3, 9e6)]
    loops = [analysis.loop_response(PLAIN, c, freq_hz) for c in controllers]
    L = np.zeros((freq_hz.size, 2, 2), dtype=complex)
    L[:, 0, 0], L[:, 1, 1] = loops
    worse = min(analysis.loop_margins(PLAIN, c).disk for c in controllers)
    assert analysis.multiloop_disk_margin(freq_hz, L).disk == near(worse, rel=1e-4)
    L[:, 0, 1] = 5.0 * loops[0]  # a triangular coupling does not change what each loop bears
    assert analysis.multiloop_disk_margin(freq_hz, L).disk == near(worse, rel=1e-4)
    L[:, 1, 0] = 0.1 * loops[1]
    assert analysis.multiloop_disk_margin(freq_hz, L).disk < 0.95 * worse


def test_the_multiloop_margin_is_the_least_pair_of_changes_that_makes_the_loop_singular():
    """Both changes (1 + a u/2) / (1 - a u/2) with |u| = 1, by brute force over their phases, at one frequency."""
    rng = np.random.Generator(np.random.Philox(3))
    for _ in range(20):
        L = rng.normal(size=(2, 2)) + 1j * rng.normal(size=(2, 2))
        found = analysis.multiloop_disk_margin(np.array([1.0]), L[None]).disk
        M = np.linalg.inv(np.eye(2) + L) - 0.5 * np.eye(2)
        phases = np.exp(1j * np.linspace(0, 2 * math.pi, 4001))
        turned = np.stack([np.broadcast_to(M[0], (phases.size, 2)), phases[:, None] * M[1]], axis=1)
        sizes = np.max(np.abs(np.linalg.eigvals(turned)), axis=1)
        assert found == near(1.0 / np.max(sizes), rel=1e-5)
        at = np.diag([1.0, phases[np.argmax(sizes)]]) @ M
        u = np.array([1.0, phases[np.argmax(sizes)]]) * np.exp(-1j * np.angle(_largest(np.linalg.eigvals(at))))
        for factor, singular in ((1.0, True), (0.8, False)):
            change = (1 + 0.5 * factor * found * u) / (1 - 0.5 * factor * found * u)
            smallest = np.min(np.abs(np.linalg.eigvals(np.eye(2) + L @ np.diag(change))))
            assert (smallest < 2e-3) == singular


def _largest(values):
    return values[np.argmax(np.abs(values))]


def test_a_loop_of_another_shape_is_refused():
    with pytest.raises(ValueError, match=r"shape \(5, 3, 3\) is not two loops at 5 frequencies"):
        analysis.multiloop_disk_margin(np.arange(5.0), np.zeros((5, 3, 3), dtype=complex))


# ------------------------------------------------------------------------------------------------ refusals


@pytest.mark.promise("pointing-31")
def test_an_unstable_loop_is_refused_with_pole_frequency_and_modulus():
    plant = pure_gain(PERIOD)
    controller = integrator(2.5 / plant.gain_rad_v)  # pole at 1 - 2.5, L = -1.25 at half the rate
    with pytest.raises(
        ValueError, match=r"'integral'.*unstable: a pole at \|z\| = 1\.500000 \(the limit is 1\)"
    ) as read:
        analysis.loop_margins(plant, controller)
    assert "2500 Hz, at a control period of 0.0002 s" in str(read.value)
    assert "modulus min |1 + L| of 0.25; lower its gains" in str(read.value)
    analysis.refuse_unstable(plant, integrator(1.99 / plant.gain_rad_v))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"D": np.array([[math.nan, 0.0]])}, "D holds a number that is not finite; look for a gain"),
        ({"A": np.array([[math.inf]])}, "A holds a number that is not finite"),
        ({"B": np.ones((1, 1))}, "B has shape (1, 1), not (1, 2): a controller of one axis has the inputs optical and"),
        ({"C": np.ones((2, 1))}, "C has shape (2, 1), not (1, 1)"),
        ({"D": np.ones((2, 2))}, "D has shape (2, 2), not (1, 2)"),
    ],
)
def test_a_controller_that_does_not_fit_is_refused(change, reason):
    controller = integrator(1.0)
    wrong = replace(controller, system=replace(controller.system, **change))
    with pytest.raises(ValueError, match=re.escape(f"controller 'integral': {reason}")):
        analysis.close(pure_gain(PERIOD), wrong)


def test_an_anti_windup_column_that_does_not_fit_is_refused():
    for column, reason in ((np.zeros((2, 1)), "shape (2, 1), not (1, 1)"), (np.full((1, 1), math.nan), "not finite")):
        with pytest.raises(ValueError, match="anti-windup .*" + re.escape(reason)):
            analysis.refuse_misfit(pure_gain(PERIOD), replace(integrator(1.0), anti_windup=column))


@pytest.mark.promise("pointing-31")
def test_a_controller_of_another_rate_is_refused():
    analysis.refuse_misfit(pure_gain(PERIOD), integrator(1.0), period_s=PERIOD)
    with pytest.raises(
        ValueError, match=r"made for a period of 0\.0001 s, the plant is sampled every 0\.0002 s: design"
    ):
        analysis.refuse_misfit(pure_gain(PERIOD), integrator(1.0), period_s=1e-4)


@pytest.mark.promise("sampled-loop-2")
def test_a_plant_without_delay_is_refused():
    plant = pure_gain(PERIOD)
    D = plant.system.D.copy()
    D[OPTICAL, 0] = 1e-4
    quick = DesignPlant(PERIOD, replace(plant.system, D=D), 1, 1e-4)
    with pytest.raises(ValueError, match="answers the command of its own sample: give it its delay"):
        analysis.close(quick, integrator(1.0))


def test_of_several_crossings_the_gain_margins_are_those_nearest_to_one():
    """A loop that crosses the negative real axis at 10, 20, 30 and 40 Hz, with so many times less or more than 1."""
    sizes = np.array([0.2, 0.5, 3.0, 1.6])

    def response(freq_hz):
        return -np.interp(freq_hz, [10.0, 20.0, 30.0, 40.0], sizes) + 1j * np.sin(math.pi * np.asarray(freq_hz) / 10.0)

    freq = np.linspace(5.0, 45.0, 401) + 1e-3
    up, down = analysis._gain_margins(response, freq, response(freq))
    assert (up, down) == (pytest.approx(2.0, rel=1e-6), pytest.approx(1.0 / 1.6, rel=1e-6))


@pytest.mark.parametrize("apart", [1e-15, 1e-9, 3e-4])
def test_poles_that_are_the_same_but_for_rounding_count_once(apart):
    """And twice where they are apart: by a half of their half width."""
    pole = np.exp(2 * math.pi * PERIOD * (-5.0 + 400.0j))

    def points(relative):
        second = np.exp(2 * math.pi * PERIOD * (-5.0 + 400.0j + 5.0 * relative))
        return analysis.around_poles(np.array([second, pole, 0.9]), PERIOD, 1.1)

    alone = analysis.around_poles(np.array([pole]), PERIOD, 1.1)
    assert_allclose(np.sort(points(apart)), np.sort(alone), rtol=apart)
    assert points(0.5).size > 1.9 * alone.size


# ------------------------------------------------------------------------------------------------ loops in closed form
def test_each_margin_of_a_loop_in_closed_form_with_crossings_on_both_sides():
    """L = 3 / ((1 + i f / 5) (1 + i f / 90)) with a delay of 4 ms: every field from its own equation."""

    def response(freq_hz):
        f = np.asarray(freq_hz)
        return 3.0 / ((1 + 1j * f / 5.0) * (1 + 1j * f / 90.0)) * np.exp(-2j * np.pi * f * 4e-3)

    dense = np.linspace(1e-3, 400.0, 1_000_001)
    L = response(dense)
    found = analysis.margins_of(response, np.geomspace(1e-3, 400.0, 700))
    cross = dense[np.argmax(np.abs(L) < 1.0)]
    at = np.flatnonzero((L.imag[:-1] < 0) & (L.imag[1:] >= 0) & (L.real[1:] < 0))[0]
    lag = np.angle(-response(cross))
    sensitivity = 1.0 / np.abs(1.0 + L)
    expected = {
        "gain_up": -1.0 / L.real[at], "gain_down": 0.0, "phase_rad": abs(lag), "delay_s": lag / (2 * np.pi * cross),
        "modulus": 1.0 / np.max(sensitivity), "disk": 2.0 * np.min(np.abs(1.0 + L) / np.abs(1.0 - L)),
        "crossover_hz": cross, "bandwidth_hz": dense[np.argmax(sensitivity >= 1.0)], "peak": np.max(sensitivity),
        "peak_hz": dense[np.argmax(sensitivity)],
    }  # fmt: skip
    for name, value in expected.items():
        assert getattr(found, name) == pytest.approx(value, rel=2e-4, abs=1e-12), name
    low, high = found.disk_gain
    assert (low, low * high) == pytest.approx(((1 - found.disk / 2) / (1 + found.disk / 2), 1.0), rel=1e-12)
    assert found.disk_phase_rad == pytest.approx(2 * math.atan(found.disk / 2), rel=1e-12)


@pytest.mark.parametrize(("disk", "gain"), [(2.0, (0.0, math.inf)), (3.5, (0.0, math.inf)), (math.inf, (0.0, math.inf)),
                                            (0.5, (0.6, 1 / 0.6)), (0.0, (1.0, 1.0))])  # fmt: skip
def test_a_disk_of_two_or_more_bears_any_gain(disk, gain):
    assert analysis.DiskMargin(disk).disk_gain == pytest.approx(gain, rel=1e-12)


@pytest.mark.parametrize(
    ("distance", "bandwidth"),
    [
        ([1.0, 2.0, 3.0, 4.0], 0.0), ([4.0, 3.0, 2.0, 1.5], 27.0), ([4.0, 2.0, 0.5, 3.0], 3.0 * math.sqrt(3.0)),
        ([2.0, 1.0, 4.0, 0.5], 3.0), ([3.0, 2.0, 1.5, 1.0], 27.0),
    ],
)  # fmt: skip
def test_a_bandwidth_lies_between_the_points_of_its_grid_as_a_power_of_frequency(distance, bandwidth):
    assert analysis.bandwidth_hz(np.array([1.0, 3.0, 9.0, 27.0]), np.array(distance)) == pytest.approx(
        bandwidth, rel=1e-12
    )


def test_what_an_input_reaches_goes_by_the_entries_of_the_states_in_any_order():
    """A chain 3 -> 0 -> 4 -> 1 that a second input enters at 4, and state 2 that drives all and is driven by none."""
    A = np.zeros((5, 5))
    A[0, 3], A[4, 0], A[1, 4], A[:, 2] = -0.2, 1e-12, 3.0, 5.0
    B = np.zeros((5, 2))
    B[3, 0], B[4, 1] = 1e-9, -2.0
    assert analysis.reachable(A, B[:, :1]).tolist() == [True, True, False, True, True]
    assert analysis.reachable(A, B[:, 1:]).tolist() == [False, True, False, False, True]
    assert analysis.reachable(A, B * 0).tolist() == [False] * 5


def test_variances_of_three_outputs_by_two_sequences_are_the_sums_of_their_squared_answers():
    A, B = np.array([[0.5, 0.3], [-0.2, 0.7]]), np.array([[1.0, 0.2], [0.0, -3.0]])
    C, D = np.array([[1.0, 0.0], [2.0, -1.0], [0.0, 0.5]]), np.array([[0.0, 1.0], [0.3, 0.0], [0.0, -2.0]])
    expected, power = D**2, B
    for _ in range(400):
        expected, power = expected + (C @ power) ** 2, A @ power
    assert_allclose(analysis.h2(lti.StateSpace(A, B, C, D)), expected, rtol=1e-12)


@pytest.mark.parametrize("ratio", [1.1, 2.0])
def test_points_around_a_pole_reach_five_times_its_frequency_or_twice_its_width_in_even_factors(ratio):
    s = -0.05 * 300.0 + 300.0j
    found = analysis.around_poles(np.exp(2 * np.pi * PERIOD * np.array([s, s.conjugate()])), PERIOD, ratio)
    above = found[found > 300.0 * (1 + 1e-9)] - 300.0
    whole = 0.2 * 15.0 * np.exp(np.linspace(0, math.log(100.0), math.ceil(math.log(100.0) / math.log(ratio)) + 1))
    assert_allclose(above, whole[whole < 0.5 / PERIOD - 300.0], rtol=1e-6)
    assert_allclose(300.0 - found[found < 300.0 * (1 - 1e-9)][::-1], whole[whole < 300.0 * (1 - 1e-9)], rtol=1e-6)


@pytest.mark.parametrize("output", range(4))
def test_variances_by_source_are_those_of_the_output_that_is_asked_for(output):
    """Residual, optical reading, gauge and command, each by disturbance, optical noise and gauge noise."""
    plant = axis_plant(gauge_noise_rad=0.5e-6)
    controller = both_sensors(plant)
    row = analysis.h2(analysis.close(plant, controller))[output]
    found = analysis.by_source(plant, controller, output)
    n = plant.disturbances
    assert found == {
        "disturbance": near(row[:n].sum()), "optical noise": near(row[n]), "gauge noise": near(row[n + 1 :].sum())
    }  # fmt: skip
    own = analysis.by_source(plant, controller)
    assert (found == own) == (output == RESIDUAL)


def test_margins_at_either_cut_are_those_of_both_cuts_at_once():
    plant = axis_plant(gauge_noise_rad=0.5e-6)
    controller = both_sensors(plant)
    command, optical = analysis.margins_of_cuts(plant, controller)
    for found, expected in (
        (analysis.margins_at(plant, controller), command),
        (analysis.margins_at(plant, controller, "optical"), optical),
    ):
        assert (found.modulus, found.disk, found.phase_rad) == near(
            (expected.modulus, expected.disk, expected.phase_rad)
        )
    assert abs(command.modulus - optical.modulus) > 1e-3


@pytest.mark.parametrize(("off", "fits"), [(5e-10, True), (-5e-10, True), (2e-9, False), (-1e-7, False)])
def test_a_controller_fits_a_plant_of_its_own_period_but_for_rounding(off, fits):
    plant, controller = axis_plant(), pi(1e3, 5e6)
    if fits:
        assert analysis.refuse_misfit(plant, controller, plant.period_s * (1.0 + off)) is None
        return
    with pytest.raises(ValueError, match=r"is made for a period of .* s, the plant is sampled every .*design it again"):
        analysis.refuse_misfit(plant, controller, plant.period_s * (1.0 + off))


def test_a_loop_whose_sensitivity_begins_above_1_has_no_bandwidth_and_one_that_never_reaches_it_all_of_the_grid():
    freq = np.geomspace(1.0, 100.0, 50)
    for gain, expected in ((-0.5, 0.0), (0.5, 100.0), (-2.5, 100.0)):
        found = analysis.margins_of(lambda f, gain=gain: gain * (1.0 + 1e-6j) * np.ones(np.shape(f)), freq)
        assert found.bandwidth_hz == pytest.approx(expected, rel=1e-12)
    for most, expected in ((4.0, 7.0 * math.sqrt(15.0)), (0.8, 0.0)):  # of |1 + L|, which falls from there on
        found = analysis.margins_of(lambda f, most=most: most / (1.0 + 1j * np.asarray(f) / 7.0) - 1.0, freq)
        assert found.bandwidth_hz == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("of", [analysis.margins_of_cuts, analysis.margins_at, analysis.loop_margins])
def test_each_way_to_margins_refuses_what_does_not_fit_and_what_is_unstable(of):
    plant = axis_plant()
    dual = both_sensors(plant)
    wrong = replace(dual, anti_windup=np.zeros((3, 1)))
    with pytest.raises(ValueError, match=re.escape("controller 'dual': anti-windup has shape (3, 1), not (2, 1)")):
        of(plant, wrong)
    D = plant.system.D.copy()
    D[GAUGE, 0] = 1e-4
    with pytest.raises(ValueError) as refused:
        of(replace(plant, system=replace(plant.system, D=D)), dual)
    assert str(refused.value) == (
        "the plant answers the command of its own sample: give it its delay before a loop is closed"
    )
    s = dual.system
    loud = replace(dual, system=replace(s, B=40.0 * s.B, D=40.0 * s.D))
    with pytest.raises(ValueError, match=r"'dual'.*unstable: a pole at"):
        of(plant, loud)
    assert analysis.margins_at(plant, dual).modulus > 0.0


def test_a_loop_is_real_at_half_the_rate_and_nowhere_below():
    L = np.array([[1.0 + 2.0j, -3.0 + 4.0j, 5.0 - 6.0j, 7.0 + 8.0j]])
    cycles = np.array([0.1, 0.5 - 1e-8, 0.5 * (1.0 - 1e-10), 0.5])
    found = analysis.real_at_half_the_rate(L, cycles)
    assert found.tolist() == [[1.0 + 2.0j, -3.0 + 4.0j, 5.0, 7.0]]


@pytest.mark.parametrize("output", [RESIDUAL, OPTICAL, GAUGE])
@pytest.mark.parametrize("gain", [-2e-4, 2e-4])
def test_no_output_of_a_plant_answers_the_command_of_its_own_sample(output, gain):
    plant = pure_gain(PERIOD)
    D = plant.system.D.copy()
    D[output, 0] = gain
    with pytest.raises(ValueError, match="answers the command of its own sample"):
        analysis.refuse_misfit(replace(plant, system=replace(plant.system, D=D)), integrator(1.0))


@pytest.mark.parametrize(
    ("rest", "up"),
    [(-5e-4 + 1e-4j, math.inf), (-5e-4 + 1e-7j, 2e3), (-0.25 + 2e-4j, 4.0), (-0.25 + 3e-4j, math.inf)],
)
def test_a_loop_is_real_at_rest_where_its_phase_is_that_of_feedback_to_a_thousandth(rest, up):
    """Above rest the loop turns away from the real axis and ends on its positive side."""
    freq = np.array([1e-3, 1.0, 10.0, 100.0])
    L = np.array([rest, 0.1 + 0.1j, 0.1 + 0.1j, 0.05 + 0j])
    found = analysis._gain_margins(lambda f: np.interp(f, freq, L.real) + 1j * np.interp(f, freq, L.imag), freq, L)
    assert found == (pytest.approx(up, rel=1e-12), 0.0)


@pytest.mark.parametrize(("optical", "gauge"), [(True, False), (False, True), (True, True)])
def test_a_plant_that_is_reduced_to_what_moves_keeps_which_sensors_it_has(optical, gauge):
    plant = replace(axis_plant(gain=-3e-5, delay=2, lines=((40.0, 1e-6),)), has_optical=optical, has_gauge=gauge)
    kept = {key: getattr(plant.system, key).copy() for key in "ABCD"}
    found = analysis.moved(plant)
    assert (found.has_optical, found.has_gauge, found.disturbances) == (optical, gauge, 0)
    assert (found.period_s, found.gain_rad_v) == (plant.period_s, -3e-5)
    assert found.system.B.shape == (found.system.order, 1) and found.system.order < plant.system.order
    assert all(np.array_equal(getattr(plant.system, key), kept[key]) for key in "ABCD")
