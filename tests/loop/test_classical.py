"""Families of classical controllers against textbook transfer functions, the saturated loop, and what they refuse."""

import math
from dataclasses import replace

import control as python_control
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import solve_discrete_lyapunov
from scipy.signal import tf2ss

from design_plants import axis_plant
from microrad.core import lti
from microrad.loop.control import classical, filters
from microrad.loop.control.classical import (
    DISTURBANCE_OBSERVER,
    PI,
    PI_NOTCH,
    PID,
    RESONANT_DAMPING,
    peak_family,
)
from microrad.loop.control.problem import DesignPlant, Parameter

PERIOD = 2e-4
GAIN = 0.089e-3
FREQ = np.geomspace(0.01, 2499.0, 200)

PLAIN = axis_plant()
RESONANT = axis_plant(resonance=(900.0, 0.02))
WHEEL = axis_plant(lines=((80.0, 4e-6), (160.0, 2e-6)))
PEAKS = peak_family((80.0, 160.0))

DESIGNS = {
    "PI": (PI, PLAIN, (224.0, 939.0)),
    "PI with a delay of two samples": (PI, axis_plant(delay=2), (130.0, 900.0)),
    "PID": (PID, PLAIN, (240.0, 1350.0, 1390.0, 7100.0)),
    "PI + notch": (PI_NOTCH, RESONANT, (161.0, 373.0, 898.0, 0.05, 1.76)),
    "resonant damping": (RESONANT_DAMPING, RESONANT, (181.0, 1300.0, 0.1, 0.16)),
    "disturbance observer": (DISTURBANCE_OBSERVER, PLAIN, (900.0, 800.0, 1.0)),
    "disturbance observer, resonance": (DISTURBANCE_OBSERVER, RESONANT, (2200.0, 635.0, 0.41)),
    "PI + peaks": (PEAKS, WHEEL, (216.0, 731.0, 50.0, 1e-3)),
}
each_design = pytest.mark.parametrize(("family", "plant", "values"), DESIGNS.values(), ids=DESIGNS)


def at(freq_hz):
    return np.exp(2j * np.pi * np.atleast_1d(freq_hz) * PERIOD)


def respond(system, freq_hz):
    """Response at points of the unit circle, one point at a time: (frequencies, outputs, inputs)."""
    eye = np.eye(system.A.shape[0])
    return np.array([system.C @ np.linalg.solve(z * eye - system.A, system.B) + system.D for z in at(freq_hz)])


def textbook_plant(freq_hz, *, delay=1, resonance=None):
    """P by python-control: the zero-order hold of amplifier and resonance, behind its delay."""
    s = python_control.tf("s")
    w = 2 * np.pi * 1e3
    hardware = GAIN / (1 + s / w)
    if resonance is not None:
        wr = 2 * np.pi * resonance[0]
        hardware = hardware * wr**2 / (s**2 + 2 * resonance[1] * wr * s + wr**2)
    sampled = python_control.sample_system(hardware, PERIOD, method="zoh")
    return sampled(at(freq_hz)) * at(freq_hz) ** -delay


def sensitivity(plant, controller, freq_hz):
    """d to e with every path closed: e = d - P v, v = K e + Kg y, y = G v."""
    paths = respond(plant.from_command, freq_hz)[:, :, 0]
    K = respond(controller.system, freq_hz)[:, 0, :]
    return 1.0 / (1.0 - K[:, 0] * paths[:, 0] / (1.0 - K[:, 1] * paths[:, 1]))


def poles(plant, controller):
    """Poles of the closed loop, the disturbance's own among them."""
    p, c = plant.system, controller.system
    seen = p.C[1:]
    return np.linalg.eigvals(np.block([[p.A + p.B[:, :1] @ c.D @ seen, p.B[:, :1] @ c.C], [c.B @ seen, c.A]]))


def tustin(freq_hz, prewarped_hz):
    """q = s / w on the unit circle by Tustin's rule, exact at w."""
    z = at(freq_hz)
    return (z - 1) / (z + 1) / np.tan(np.pi * prewarped_hz * PERIOD)


# ------------------------------------------------------------------------------------------------ test plants, sections


@pytest.mark.promise("sampled-loop-2")
@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("resonance", [None, (300.0, 0.02)])
def test_the_test_plants_are_their_zero_order_hold(delay, resonance):
    plant = axis_plant(delay=delay, resonance=resonance)
    optical, gauge = respond(plant.from_command, FREQ)[:, :, 0].T
    assert_allclose(gauge, textbook_plant(FREQ, delay=delay, resonance=resonance), rtol=1e-7)
    assert_allclose(optical, -gauge, rtol=1e-12)


def test_the_test_plants_disturb_with_the_variance_asked_for():
    s = axis_plant(disturbance_rad=11.2e-6, lines=((80.0, 4e-6),), noise_rad=0.0, period_s=2e-3).system
    covariance = solve_discrete_lyapunov(s.A, s.B[:, 1:] @ s.B[:, 1:].T)
    assert_allclose(s.C[0] @ covariance @ s.C[0], 11.2e-6**2 + 4e-6**2, rtol=1e-9)


def test_the_model_of_the_optical_path_leaves_out_everything_else():
    plant = axis_plant(delay=2, lines=((80.0, 1e-6),))
    model = classical.optical_model(plant)
    assert model.order == 3  # amplifier and two delays
    assert_allclose(respond(model, FREQ)[:, 0, 0], textbook_plant(FREQ, delay=2), rtol=1e-9)


def test_resonances_and_corner_are_the_plants_own():
    (found,) = classical.resonances(axis_plant(resonance=(300.0, 0.02), delay=3))
    assert_allclose((found.freq_hz, found.damping), (300.0, 0.02), rtol=1e-9)
    assert found.prominence == pytest.approx(25.0, rel=0.05)
    assert classical.resonances(axis_plant(resonance=(300.0, 0.4), lines=((80.0, 1e-6),))) == ()
    assert classical.corner_hz(axis_plant(amplifier_hz=50.0)) == pytest.approx(50.0, rel=0.12)
    assert classical.corner_hz(axis_plant(amplifier_hz=np.inf)) == pytest.approx(1250.0)


def test_a_notch_has_its_depth_at_its_centre_and_3_db_at_its_width():
    """A deep one: |N|^2 = 1/2 where q - 1/q = +-width."""
    deep, width = filters.notch(700.0, 1e-6, 0.4, PERIOD), 0.4
    edges = np.sqrt(1 + width**2 / 4) + np.array([-1, 1]) * width / 2
    unwarped = np.arctan(edges * np.tan(np.pi * 700.0 * PERIOD)) / (np.pi * PERIOD)
    assert_allclose(np.abs(respond(deep, unwarped)[:, 0, 0]), np.sqrt(0.5), rtol=1e-6)
    shallow = np.abs(respond(filters.notch(700.0, 0.1, 0.4, PERIOD), [1e-3, 700.0, 2499.999])[:, 0, 0])
    assert_allclose(shallow, [1.0, 0.1, 1.0], rtol=1e-6)


def test_a_peak_is_exact_at_its_centre_and_half_its_power_a_damping_ratio_away():
    wanted = 3.0 * np.exp(2.0j)
    for freq_hz in (20.0, 300.0, 2300.0):
        section = filters.peak(freq_hz, 1e-3, wanted, PERIOD)
        response = respond(section, freq_hz * np.array([1.0, 1 - 1e-3, 1 + 1e-3]))[:, 0, 0]
        assert_allclose(response[0], wanted, rtol=1e-9)
        assert_allclose(response[1:], wanted / (1 + np.array([-1j, 1j])), rtol=0.01)


# ------------------------------------------------------------------------------------------------ linear theory


@pytest.mark.promise("pointing-16")
def test_pi_is_proportional_plus_backward_integral():
    controller = PI.build(PLAIN, np.array([200.0, 800.0]))
    z, Ki = at(FREQ), 2 * np.pi * 200.0 / GAIN
    K = respond(controller.system, FREQ)[:, 0, :]
    assert_allclose(K[:, 0], Ki / (2 * np.pi * 800.0) + Ki * PERIOD * z / (z - 1), rtol=1e-9)
    assert not np.any(K[:, 1])


def test_pure_integral_lies_within_the_bounds_of_pi():
    zero = PI.parameters(PLAIN)[1]
    K = respond(PI.build(PLAIN, np.array([100.0, zero.most])).system, FREQ)[:, 0, 0]
    z = at(FREQ)
    assert_allclose(K, 2 * np.pi * 100.0 / GAIN * PERIOD * z / (z - 1), rtol=0.04)


def test_pid_adds_a_filtered_derivative():
    controller = PID.build(PLAIN, np.array([200.0, 800.0, 500.0, 2000.0]))
    z, Ki = at(FREQ), 2 * np.pi * 200.0 / GAIN
    Kp = Ki / (2 * np.pi * 800.0)
    rate = (1 - 1 / z) / PERIOD
    textbook = Kp + Ki / rate + Kp / (2 * np.pi * 500.0) * rate / (1 + rate / (2 * np.pi * 2000.0))
    assert_allclose(respond(controller.system, FREQ)[:, 0, 0], textbook, rtol=1e-9)


@pytest.mark.promise("pointing-17")
def test_pi_notch_is_pi_times_the_prewarped_biquad():
    values = np.array([150.0, 900.0, 890.0, 0.05, 0.8])
    K = respond(PI_NOTCH.build(RESONANT, values).system, FREQ)[:, 0, 0]
    q = tustin(FREQ, 890.0)
    without = respond(PI.build(RESONANT, values[:2]).system, FREQ)[:, 0, 0]
    assert_allclose(K / without, (q**2 + 0.05 * 0.8 * q + 1) / (q**2 + 0.8 * q + 1), rtol=1e-8)
    centre = [respond(f.build(RESONANT, v).system, 890.0)[0, 0, 0] for f, v in ((PI_NOTCH, values), (PI, values[:2]))]
    assert_allclose(centre[0] / centre[1], 0.05, rtol=1e-8)


@pytest.mark.promise("choose-7")
def test_a_notch_carries_the_loop_past_a_resonance_that_pi_cannot_pass():
    values = np.array([161.0, 373.0, 898.0, 0.05, 1.76])
    S = sensitivity(RESONANT, PI_NOTCH.build(RESONANT, values), FREQ)
    assert np.max(np.abs(poles(RESONANT, PI_NOTCH.build(RESONANT, values)))) < 1.0
    assert np.max(np.abs(S)) < 2.0
    assert np.max(np.abs(poles(RESONANT, PI.build(RESONANT, values[:2])))) > 1.0


@pytest.mark.promise("pointing-17")
def test_the_notch_is_sought_at_the_resonance_and_spans_the_band_without_one():
    centre, depth = PI_NOTCH.parameters(RESONANT)[2:4]
    assert_allclose((centre.least, centre.most, depth.most), (600.0, 1350.0, 1.0), rtol=1e-6)
    centre, depth = PI_NOTCH.parameters(PLAIN)[2:4]
    assert_allclose((centre.least, centre.most, depth.most), (25.0, 2450.0, 3.0), rtol=1e-6)


@pytest.mark.promise("pointing-18")
def test_resonant_damping_is_integral_of_the_error_and_a_second_order_filter_of_the_gauge():
    K = respond(RESONANT_DAMPING.build(RESONANT, np.array([100.0, 1100.0, 0.3, 0.4])).system, FREQ)[:, 0, :]
    z, q = at(FREQ), tustin(FREQ, 1100.0)
    assert_allclose(K[:, 0], 2 * np.pi * 100.0 * (1 - 0.4) / GAIN * PERIOD * z / (z - 1), rtol=1e-9)
    assert_allclose(K[:, 1], 0.4 / GAIN / (q**2 + 2 * 0.3 * q + 1), rtol=1e-8)


@pytest.mark.promise("choose-7")
@pytest.mark.promise("pointing-18")
@pytest.mark.parametrize(
    ("resonance_hz", "values"),
    [(300.0, (360.0, 0.45, 0.2)), (900.0, (1300.0, 0.1, 0.15)), (1200.0, (1300.0, 0.2, -0.1))],
)
def test_position_feedback_damps_a_resonance_that_the_integral_alone_does_not(resonance_hz, values):
    """Positive while delay and amplifier turn the phase by less than a quarter at the resonance, negative beyond."""
    plant = axis_plant(resonance=(resonance_hz, 0.02))
    least = []
    for feedback in (0.0, values[2], -values[2]):
        controller = RESONANT_DAMPING.build(plant, np.array([20.0, *values[:2], feedback]))
        s = np.log(poles(plant, controller).astype(complex)) / PERIOD
        near = s[(np.abs(s) > np.pi * resonance_hz) & (np.abs(s) < 4 * np.pi * resonance_hz) & (s.imag > 0)]
        least.append(float(np.min(-near.real / np.abs(near))))
    alone, damped, wrong_way = least
    assert alone < 0.025
    assert damped > max(0.05, 2 * alone)
    assert wrong_way < 0.0  # unstable


@pytest.mark.promise("choose-7")
@pytest.mark.promise("pointing-19")
def test_disturbance_observer_has_the_sensitivity_of_internal_model_control():
    bandwidth, lead, damping = 600.0, 700.0, 0.8
    controller = DISTURBANCE_OBSERVER.build(PLAIN, np.array([bandwidth, lead, damping]))
    q = tustin(FREQ, bandwidth)
    F = (1 + q * bandwidth / lead) / (q**2 + 2 * damping * q + 1) / GAIN
    assert_allclose(sensitivity(PLAIN, controller, FREQ), 1 - F * textbook_plant(FREQ), rtol=1e-6)


@pytest.mark.promise("pointing-19")
def test_disturbance_observer_inverts_a_prominent_resonance():
    controller = DISTURBANCE_OBSERVER.build(RESONANT, np.array([2200.0, 635.0, 0.41]))
    q, qr = tustin(FREQ, 2200.0), tustin(FREQ, 900.0)
    F = (1 + q * 2200.0 / 635.0) / (q**2 + 0.82 * q + 1) * (qr**2 + 0.04 * qr + 1) / (qr**2 + 1.4 * qr + 1) / GAIN
    S = sensitivity(RESONANT, controller, FREQ)
    slow = 2.0**-lti.EXACT_BITS  # to that the inverse's slow gain is rounded
    assert_allclose(S, 1 - F * textbook_plant(FREQ, resonance=(900.0, 0.02)), rtol=1e-6, atol=slow)
    assert np.max(np.abs(S)) < 2.0
    assert np.max(np.abs(poles(RESONANT, controller))) < 1.0


def test_disturbance_observer_integrates_also_where_the_plant_is_not_its_model():
    controller = DISTURBANCE_OBSERVER.build(PLAIN, np.array([400.0, 900.0, 0.8]))
    assert np.min(np.abs(np.linalg.eigvals(controller.system.A) - 1.0)) < 1e-9
    other = axis_plant(gain=1.3 * GAIN, amplifier_hz=700.0)
    assert np.max(np.abs(poles(other, controller))) < 1.0
    assert np.abs(sensitivity(other, controller, 1e-4))[0] < 1e-5


@pytest.mark.promise("choose-7")
@pytest.mark.promise("pointing-21")
def test_peaks_take_out_their_lines_and_nothing_else_does():
    values = np.array([216.0, 731.0, 50.0, 1e-3])
    lines = np.array([80.0, 160.0])
    with_peaks, without = PEAKS.build(WHEEL, values), PI.build(WHEEL, values[:2])
    assert np.all(np.abs(sensitivity(WHEEL, with_peaks, lines)) < 0.05)
    assert np.all(np.abs(sensitivity(WHEEL, without, lines)) > 0.2)
    between = np.array([10.0, 40.0, 113.0, 400.0, 1000.0])
    assert_allclose(
        np.abs(sensitivity(WHEEL, with_peaks, between) / sensitivity(WHEEL, without, between)), 1.0, atol=0.15
    )


@pytest.mark.promise("pointing-21")
@pytest.mark.parametrize("line_hz", [5.0, 80.0, 700.0, 1800.0])
def test_one_peak_divides_the_sensitivity_by_one_plus_its_gain_wherever_the_line(line_hz):
    """Also where the loop without it has long lost its phase."""
    values = np.array([200.0, 900.0, 30.0, 5e-4])
    controller, base = peak_family((line_hz,)).build(PLAIN, values), PI.build(PLAIN, values[:2])
    ratio = sensitivity(PLAIN, controller, line_hz) / sensitivity(PLAIN, base, line_hz)
    assert_allclose(ratio, 1 / 31.0, rtol=1e-7)
    assert np.max(np.abs(poles(PLAIN, controller))) < 1.0


def test_every_design_is_stable_and_rejects_ten_times_more_a_decade_below():
    for name, (family, plant, values) in DESIGNS.items():
        controller = family.build(plant, np.array(values))
        assert np.max(np.abs(poles(plant, controller))) < 1.0, name
        S = np.abs(sensitivity(plant, controller, np.array([0.01, 0.1])))
        assert S[0] < 1e-3, name
        assert S[1] / S[0] == pytest.approx(10.0, rel=1e-3), name


@pytest.mark.promise("pointing-16")
@pytest.mark.parametrize("name", ["PI", "PI + notch"])
def test_the_integral_frequency_is_where_the_integral_crosses_the_slow_gain(name):
    """S = f / f_i far below it."""
    family, plant, values = DESIGNS[name]
    S = sensitivity(plant, family.build(plant, np.array(values)), 0.01)
    assert_allclose(np.abs(S), 0.01 / values[0], rtol=1e-3)


def test_resonant_damping_keeps_its_integral_frequency_whatever_the_feedback():
    for feedback in (-0.8, 0.0, 0.8):
        controller = RESONANT_DAMPING.build(RESONANT, np.array([50.0, 1300.0, 1.0, feedback]))
        assert_allclose(np.abs(sensitivity(RESONANT, controller, 0.01)), 0.01 / 50.0, rtol=1e-3)


# ------------------------------------------------------------------------------------------------ saturation


def saturated_loop(plant, controller, disturbance, limit_v=np.inf):
    """Residual, command before its limit and controller states, one row a sample, of the loop from rest."""
    p, c = plant.system, controller.system
    x, xc = np.zeros(p.A.shape[0]), np.zeros(c.A.shape[0])
    rows = []
    for d in disturbance:
        m = p.C[1:] @ x + np.array([d, 0.0])
        v = float(c.C[0] @ xc + c.D[0] @ m)
        given = min(max(v, -limit_v), limit_v)
        rows.append((m[0], v, xc))
        xc = c.A @ xc + c.B @ m + controller.anti_windup[:, 0] * (given - v)
        x = p.A @ x + p.B[:, 0] * given
    return tuple(np.array(part) for part in zip(*rows, strict=True))


def without_anti_windup(controller):
    return replace(controller, anti_windup=np.zeros_like(controller.anti_windup))


LIMIT = 10.0
REACH = LIMIT * GAIN


def out_of_reach(seconds):
    """Four times what the mirror can follow, then a third of it."""
    count = round(seconds / PERIOD)
    return np.concatenate([np.full(count, 4.0 * REACH), np.full(2500, REACH / 3.0)]), count


@each_design
def test_anti_windup_ends_the_saturation_at_once(family, plant, values):
    controller = family.build(plant, np.array(values))
    disturbance, end = out_of_reach(0.12)
    settled, overshoot = {}, {}
    for case in (controller, without_anti_windup(controller)):
        error, command, _ = saturated_loop(plant, case, disturbance, LIMIT)
        assert np.all(command[end - 500 : end] >= LIMIT * (1 - 1e-9))
        after = np.abs(error[end:]) / REACH
        key = "without" if case is not controller else "with"
        settled[key] = int(np.flatnonzero(after > 0.02)[-1]) + 1 if np.any(after > 0.02) else 0
        overshoot[key] = float(np.sum(after))  # in samples of full stroke
    assert settled["with"] < 60e-3 / PERIOD
    assert settled["with"] < 0.1 * settled["without"]
    assert overshoot["with"] < 0.1 * overshoot["without"]


@each_design
def test_states_stay_bounded_however_long_the_saturation(family, plant, values):
    controller = family.build(plant, np.array(values))
    long, growing = (
        saturated_loop(plant, c, np.full(4_000, 4.0 * REACH), LIMIT)[2]
        for c in (controller, without_anti_windup(controller))
    )
    assert np.max(np.abs(long[2000:] - long[-1])) < 1e-3 * np.max(np.abs(long))
    assert np.max(np.abs(growing[-1])) > 1.5 * np.max(np.abs(growing[2000]))


@each_design
def test_anti_windup_changes_nothing_inside_the_limits(family, plant, values):
    controller = family.build(plant, np.array(values))
    disturbance = np.cumsum(np.random.Generator(np.random.Philox(3)).normal(size=1500)) * 1e-6
    found = saturated_loop(plant, controller, disturbance, 1e3)
    plain = saturated_loop(plant, without_anti_windup(controller), disturbance)
    assert 0.0 < np.max(np.abs(found[1])) < 1e3
    for a, b in zip(found, plain, strict=True):
        assert np.array_equal(a, b)


@pytest.mark.parametrize("drift", [[], [(0.9999, 0.9996)], [(0.9999, 0.9996), (0.9995, 0.9997)]])
def test_the_observers_filter_is_the_inverse_at_rest(drift, monkeypatch):
    """Also of a plant whose creep it undoes: F P = 1 at frequency 0, so that a constant disturbance is cancelled."""
    monkeypatch.setattr(classical, "_drift", lambda plant: drift)
    F = classical.observer_filter(PLAIN, 600.0, 700.0, 0.8)
    slow = F.C @ np.linalg.solve(np.eye(F.order) - F.A, F.B) + F.D
    assert_allclose(slow * PLAIN.gain_rad_v, 1.0, rtol=1e-6)  # the gain is kept to 32 bits


def test_a_saturated_disturbance_observer_still_knows_the_disturbance():
    """With an exact model driven by the clipped command, what it asks for is F d, as if there were no limit."""
    controller = DISTURBANCE_OBSERVER.build(PLAIN, np.array([600.0, 700.0, 0.8]))
    F = classical.observer_filter(PLAIN, 600.0, 700.0, 0.8)
    disturbance = 3.0 * REACH * np.sin(2 * np.pi * 40.0 * PERIOD * np.arange(2000))
    _, command, _ = saturated_loop(PLAIN, controller, disturbance, LIMIT)
    x, wanted = np.zeros(2), []
    for d in disturbance:
        wanted.append((F.C @ x + F.D[:, 0] * d)[0])
        x = F.A @ x + F.B[:, 0] * d
    assert np.mean(np.abs(command) > LIMIT) > 0.5
    assert_allclose(command, wanted, atol=1e-9 * np.max(np.abs(wanted)))


@each_design
def test_what_follows_the_clipped_command_is_stable(family, plant, values):
    controller = family.build(plant, np.array(values))
    c = controller.system
    assert np.max(np.abs(np.linalg.eigvals(c.A - controller.anti_windup @ c.C))) < 1.0
    assert np.max(np.abs(np.linalg.eigvals(c.A))) == pytest.approx(1.0, abs=1e-9)


# ------------------------------------------------------------------------------------------------ bounds, refusals


@each_design
def test_every_place_within_the_bounds_is_a_controller_of_the_right_shape(family, plant, values):
    parameters = family.parameters(plant)
    assert len({p.name for p in parameters}) == len(parameters)
    rng = np.random.Generator(np.random.Philox(5))
    for p, v in zip(parameters, values, strict=True):
        assert p.least < v < p.most
    for _ in range(20):
        place = rng.random(len(parameters)).round()  # corners, where trouble is
        drawn = [
            p.least * (p.most / p.least) ** x if p.log else p.least + x * (p.most - p.least)
            for p, x in zip(parameters, place, strict=True)
        ]
        c = family.build(plant, np.array(drawn))
        n = c.system.order
        shapes = [m.shape for m in (c.system.A, c.system.B, c.system.C, c.system.D, c.anti_windup)]
        assert shapes == [(n, n), (n, 2), (1, n), (1, 2), (n, 1)]
        assert all(np.all(np.isfinite(m)) for m in (c.system.A, c.system.B, c.system.C, c.system.D, c.anti_windup))


@each_design
def test_values_that_are_no_number_are_refused_with_their_name(family, plant, values):
    for i, p in enumerate(family.parameters(plant)):
        spoilt = np.array(values)
        spoilt[i] = np.nan
        with pytest.raises(ValueError, match=rf"{p.name} is nan; give a"):
            family.build(plant, spoilt)
        if p.log:
            spoilt[i] = -1.0
            with pytest.raises(ValueError, match=rf"{p.name} is -1; give a number above 0"):
                family.build(plant, spoilt)


@each_design
def test_a_wrong_number_of_values_is_refused_with_what_is_wanted(family, plant, values):
    with pytest.raises(ValueError, match=rf"takes {len(values)} values, not 1: .*{family.parameters(plant)[-1].name}"):
        family.build(plant, np.ones(1))


@pytest.mark.parametrize(
    "family", [PI, PID, PI_NOTCH, RESONANT_DAMPING, DISTURBANCE_OBSERVER, PEAKS], ids=lambda f: f.name
)
def test_a_plant_without_optical_sensor_is_refused(family):
    s = PLAIN.system
    blind = DesignPlant(PERIOD, lti.StateSpace(s.A, s.B, s.C * [[1], [0], [1]], s.D), 1, GAIN, has_optical=False)
    with pytest.raises(ValueError, match=r"no optical sensor: .* add a tracking sensor"):
        family.parameters(blind)


@pytest.mark.promise("choose-7")
def test_resonant_damping_is_refused_without_a_gauge():
    plant = axis_plant(resonance=(900.0, 0.02), gauge=False)
    for call in (lambda: RESONANT_DAMPING.parameters(plant), lambda: RESONANT_DAMPING.build(plant, np.ones(4))):
        with pytest.raises(ValueError, match="has no gauge that reads it; add a strain gauge"):
            call()
    assert PI_NOTCH.parameters(plant)


def test_position_feedback_that_diverges_at_rest_is_refused():
    with pytest.raises(ValueError, match=r"position feedback of 1 .* diverges at rest; keep it below 1"):
        RESONANT_DAMPING.build(RESONANT, np.array([50.0, 1300.0, 1.0, 1.0]))


def test_a_disturbance_observer_of_a_plant_that_does_not_settle_is_refused():
    s = PLAIN.system
    A = s.A.copy()
    A[0, 0] = 1.01
    with pytest.raises(ValueError, match=r"a pole at \|z\| = 1.01.* \(the limit is 1\) and would drift"):
        DISTURBANCE_OBSERVER.parameters(replace(PLAIN, system=lti.StateSpace(A, s.B, s.C, s.D)))


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        ((), "need the frequencies of the lines that they take out; give at least one"),
        ((80.0, 2500.0), "a line at 2500 Hz: .* below 2500 Hz, or raise the control rate"),
        ((-5.0,), "a line at -5 Hz"),
        ((float("nan"),), "a line at nan Hz"),
        ((80.0, 160.0, 80.0), "the line at 80 Hz is given twice"),
    ],
)
def test_lines_that_no_peak_can_take_out_are_refused(lines, reason):
    family = peak_family(lines)
    for call in (lambda: family.parameters(PLAIN), lambda: family.build(PLAIN, np.ones(4))):
        with pytest.raises(ValueError, match=reason):
            call()


def test_a_filter_beyond_half_the_rate_is_refused():
    with pytest.raises(
        ValueError, match=r"second-order section at 2600 Hz: .* below 2500 Hz, or raise the control rate"
    ):
        PI_NOTCH.build(RESONANT, np.array([161.0, 373.0, 2600.0, 0.05, 1.76]))


@pytest.mark.parametrize("freq_hz", [0.0, -10.0, 2500.0, 2600.0, float("nan")])
def test_a_peak_stands_between_rest_and_half_the_rate(freq_hz):
    with pytest.raises(ValueError, match=rf"a peak filter at {freq_hz:g} Hz: a controller with a period of 0.0002 s"):
        filters.peak(freq_hz, 0.05, 1.0, 2e-4)
    assert filters.peak(2499.0, 0.05, 1.0, 2e-4).order == 2


# ------------------------------------------------------------------------------------------------ parts by hand
@pytest.mark.parametrize(("lead_hz", "rise"), [(math.inf, 0.0), (250.0, 1.6), (1e4, 0.04)])
def test_a_low_pass_with_a_lead_is_exact_at_its_frequency_and_1_at_rest(lead_hz, rise):
    """At q = i it is (1 + i f / lead) / (2 i damping)."""
    f, damping, period = 400.0, 0.35, 2e-4
    s = filters.low_pass(f, damping, period, lead_hz)
    found = lti.frequency_response(s, np.array([1e-6, f]), period)[:, 0, 0]
    assert_allclose(found, [1.0, (1.0 + 1j * rise) / (2j * damping)], rtol=1e-6)


def test_systems_side_by_side_share_their_input_and_add_their_outputs():
    each = [filters.notch(300.0, 0.2, 0.5, 2e-4), filters.peak(80.0, 0.01, 2.0 - 1j, 2e-4)]
    each.append(filters.low_pass(50.0, 1.0, 2e-4))
    freq = np.array([3.0, 80.0, 310.0, 2000.0])
    found = lti.frequency_response(filters.parallel(*each), freq, 2e-4)
    assert_allclose(found, sum(lti.frequency_response(s, freq, 2e-4) for s in each), rtol=1e-9)
    assert found.shape == (4, 1, 1)


@pytest.mark.parametrize(
    ("poles", "zeros", "below", "pairs"),
    [
        ([0.999, 0.99, 0.5], [0.998, 0.985, 0.4], 0.05, [(0.999, 0.998), (0.99, 0.985)]),
        ([0.999, 0.99, 0.5], [0.998, -0.3, 0.4], 0.05, [(0.999, 0.998)]),
        ([0.999, 0.99], [0.998, 0.985], 1e-3, [(0.999, 0.998)]),
        ([1.0, 0.99], [0.98, 1.02], 0.05, [(0.99, 0.98)]),
        ([0.5, 0.2], [0.3, 0.1], 0.05, []),
    ],
)
def test_drift_is_each_slow_real_pole_with_the_zero_of_its_rank(poles, zeros, below, pairs):
    numerator, denominator = np.poly(zeros), np.poly(poles)
    A, B, C, D = tf2ss(numerator, denominator)
    found = classical.drift(lti.StateSpace(A, B, C, D), below)
    assert found == [(pytest.approx(p, abs=1e-6), pytest.approx(z, abs=1e-6)) for p, z in pairs]


@pytest.mark.parametrize(
    ("frequencies", "around", "least", "band"),
    [([], 1.5, 0.005, (25.0, 2450.0)), ([700.0], 1.5, 0.005, (700.0 / 1.5, 1050.0)),
     ([300.0, 1200.0], 4.0, 0.02, (75.0, 2450.0)), ([900.0, 400.0, 600.0], 1.5, 0.1, (400.0 / 1.5, 1350.0))],
)  # fmt: skip
def test_filters_are_sought_about_the_resonances_or_over_the_band(monkeypatch, frequencies, around, least, band):
    found = tuple(classical.Resonance(f, 0.1, 3.0) for f in frequencies)
    monkeypatch.setattr(classical, "resonances", lambda plant: found)
    assert classical._band(axis_plant(), around, least) == pytest.approx(band)


@pytest.mark.parametrize("which", ["PI", "PID", "PI + notch"])
def test_bounds_of_a_family_come_from_the_rate_and_the_corner_of_its_plant(which):
    plant = axis_plant(amplifier_hz=300.0, period_s=1e-3)
    corner = classical.corner_hz(plant)
    family = {"PI": classical.PI, "PID": classical.PID, "PI + notch": classical.PI_NOTCH}[which]
    told = {p.name: (p.unit, p.least, p.most, p.log, p.gentle) for p in family.parameters(plant)}
    expected = {
        "integral frequency": ("Hz", 0.01, 250.0, True, None), "zero": ("Hz", 0.1 * corner, 1e4, True, 1e4),
        "derivative zero": ("Hz", 0.1 * corner, 1e4, True, 1e4), "derivative filter": ("Hz", 20.0, 2000.0, True, None),
        "notch centre": ("Hz", 5.0, 490.0, True, None), "notch depth": ("", 0.01, 3.0, True, 1.0),
        "notch width": ("", 0.05, 4.0, True, None),
    }  # fmt: skip
    names = {"PI": [0, 1], "PID": [0, 1, 2, 3], "PI + notch": [0, 1, 4, 5, 6]}[which]
    assert [*told] == [[*expected][i] for i in names]
    for name, (unit, least, most, log, gentle) in told.items():
        assert (unit, log) == (expected[name][0], expected[name][3])
        assert (least, most) == (pytest.approx(expected[name][1]), pytest.approx(expected[name][2]))
        assert gentle == (expected[name][4] and pytest.approx(expected[name][4]))
    base = np.array([30.0, 500.0])
    more = {"PI": [], "PID": [1e4, 20.0], "PI + notch": [5.0, 1.0, 0.05]}[which]
    assert family.extended(plant, base).tolist() == pytest.approx([30.0, 500.0, *more])
    assert (family.base and family.base.name) == (None if which == "PI" else "PI")


def test_what_follows_the_command_is_the_predictor_of_the_states_by_white_noise_in_error():
    integral = lti.StateSpace(*(np.array([[x]]) for x in (1.0, 0.3, 1.0, 0.7)))
    s = filters.parallel(filters.peak(80.0, 0.01, 2.0 - 1j, 2e-4), integral)
    P = np.eye(3)
    for _ in range(20_000):
        K = s.A @ P @ s.C.T / (s.C @ P @ s.C.T + 0.49)
        P = s.A @ P @ s.A.T + s.B @ s.B.T - K @ s.C @ P @ s.A.T
    assert_allclose(classical.follow_command(s), K, rtol=1e-6)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ((160.0, 80.0, 80.0), "the line at 80 Hz is given twice; give each line one peak filter"),
        ((40.0, 622.08, 80.0, 622.08), "the line at 622.08 Hz is given twice; give each line one peak filter"),
        ((40.0, 2600.0, 80.0), "a peak filter for a line at 2600 Hz: "),
        ((40.0, 80.0, 2600.0, 80.0), "a peak filter for a line at 2600 Hz: "),
    ],
)
def test_a_line_that_no_peak_can_take_out_is_named_wherever_it_stands(lines, words):
    family = peak_family(lines)
    with pytest.raises(ValueError) as refused:
        family.build(PLAIN, np.array([216.0, 731.0, 50.0, 1e-3]))
    assert str(refused.value).startswith(words)


@pytest.mark.parametrize(
    ("family", "expected", "more"),
    [
        (RESONANT_DAMPING, {
            "integral frequency": ("Hz", 0.01, 250.0, True, None), "filter frequency": ("Hz", 20.0, 490.0, True, None),
            "filter damping": ("", 0.05, 2.0, True, 2.0), "position feedback": ("", -0.9, 0.9, False, 0.0),
        }, None),
        (DISTURBANCE_OBSERVER, {
            "Q bandwidth": ("Hz", 0.1, 450.0, True, None), "lead": ("Hz", None, 1e4, True, 1e4),
            "Q damping": ("", 0.3, 4.0, True, 4.0),
        }, None),
        (peak_family((40, 31.104, 7.5)), {
            "integral frequency": ("Hz", 0.01, 250.0, True, None), "zero": ("Hz", None, 1e4, True, 1e4),
            "peak gain": ("", 0.1, 300.0, True, None), "peak damping": ("", 1e-4, 2e-2, True, None),
        }, [0.1, 1e-4]),
    ],
    ids=["resonant damping", "disturbance observer", "PI + peaks"],
)  # fmt: skip
def test_a_family_beside_the_pi_has_its_parameters_in_their_order_with_bounds_and_gentle_ends(family, expected, more):
    """At a control period of 1 ms; the least zero is a tenth of the plant's corner."""
    plant = axis_plant(amplifier_hz=300.0, period_s=1e-3)
    told = {p.name: (p.unit, p.least, p.most, p.log, p.gentle) for p in family.parameters(plant)}
    assert [*told] == [*expected]
    for name, (unit, least, most, log, gentle) in expected.items():
        lowest = 0.1 * classical.corner_hz(plant) if least is None else least
        assert told[name] == (unit, pytest.approx(lowest), pytest.approx(most), log, gentle and pytest.approx(gentle))
    assert (family.base and family.base.name, family.final) == (None if more is None else "PI", None)
    if more is not None:
        assert family.extended(plant, np.array([30.0, 500.0])).tolist() == pytest.approx([30.0, 500.0, *more])
        made = family.build(plant, np.array([30.0, 500.0, 50.0, 1e-3]))
        assert (made.name, made.system.order) == ("PI + peaks", 1 + 2 * 3)


@pytest.mark.parametrize("pole", [1.0, -1.0, 1.01, -3.0])
def test_a_model_that_would_drift_away_is_refused_whichever_way_its_pole_lies(pole):
    s = PLAIN.system
    A = s.A.copy()
    A[0, 0] = pole
    for ask in (DISTURBANCE_OBSERVER.parameters, lambda plant: DISTURBANCE_OBSERVER.build(plant, np.ones(3))):
        with pytest.raises(ValueError) as refused:
            ask(replace(PLAIN, system=replace(s, A=A)))
        assert str(refused.value) == (
            f"a disturbance observer runs a model of the plant, which has a pole at |z| = {abs(pole):.6f} (the limit "
            "is "
            "1) and would drift away from it; use a PI or LQG controller for this plant"
        )
    A[0, 0] = 0.999 * pole / abs(pole)
    assert len(DISTURBANCE_OBSERVER.parameters(replace(PLAIN, system=replace(s, A=A)))) == 3


@pytest.mark.parametrize(("damping", "order"), [(0.02, 4), (0.1, 4), (0.3, 2), (0.7, 2)])
def test_an_observer_undoes_a_resonance_that_stands_out_and_leaves_one_that_hardly_does(damping, order):
    """One of damping 0.3 is a resonance yet, but not twice as high as what lies beside it."""
    plant = axis_plant(resonance=(900.0, damping))
    assert bool(classical.resonances(plant)) == (damping < 0.5)
    found = classical.observer_filter(plant, 400.0, 800.0, 1.0)
    assert found.order == order
    slow = respond(found, 0.001)[0, 0, 0] * respond(plant.from_command, 0.001)[0, 0, 0]
    assert abs(slow) == pytest.approx(1.0, rel=1e-3)
    ratio = (
        respond(found, 900.0)[0, 0, 0] / respond(classical.observer_filter(PLAIN, 400.0, 800.0, 1.0), 900.0)[0, 0, 0]
    )
    assert abs(ratio) < 2.5 * damping if order == 4 else abs(ratio) == pytest.approx(1.0, rel=1e-6)


@each_design
def test_a_value_too_many_or_without_an_end_is_refused(family, plant, values):
    wanted = len(values)
    with pytest.raises(ValueError, match=rf"takes {wanted} values, not {wanted + 1}: "):
        family.build(plant, np.append(values, 1.0))
    for value in (math.inf, -math.inf, math.nan):
        spoilt = np.array(values, dtype=float)
        spoilt[-1] = value
        with pytest.raises(ValueError, match=rf"the {family.parameters(plant)[-1].name} is {value:g}; give a "):
            family.build(plant, spoilt)


@pytest.mark.parametrize("resonance", [None, (300.0, 0.4), (900.0, 0.05)])
def test_the_corner_and_the_resonances_of_a_plant_are_the_same_whichever_way_it_turns(resonance):
    one, other = (axis_plant(gain=gain, amplifier_hz=400.0, resonance=resonance) for gain in (3e-5, -3e-5))
    assert classical.corner_hz(other) == pytest.approx(classical.corner_hz(one), rel=1e-9)
    assert classical.corner_hz(one) < 0.25 / one.period_s
    for a, b in zip(classical.resonances(one), classical.resonances(other), strict=True):
        assert (a.freq_hz, a.damping, a.prominence) == pytest.approx((b.freq_hz, b.damping, b.prominence), rel=1e-6)
        assert b.prominence > 0.0


def test_an_observer_undoes_the_most_prominent_of_several_resonances(monkeypatch):
    plant = axis_plant()
    several = tuple(classical.Resonance(*each) for each in ((700.0, 0.02, 9.0), (310.0, 0.05, 4.0), (90.0, 0.2, 1.5)))
    monkeypatch.setattr(classical, "resonances", lambda given: several)
    found = classical.observer_filter(plant, 200.0, 5e3, 0.8)
    monkeypatch.setattr(classical, "resonances", lambda given: ())
    plain = classical.observer_filter(plant, 200.0, 5e3, 0.8)
    freq = np.array([50.0, 90.0, 310.0, 700.0, 1500.0])
    notch = filters.notch(700.0, 0.02 / classical.INVERSE_DAMPING, 2 * classical.INVERSE_DAMPING, plant.period_s)
    answers = (lti.frequency_response(each, freq, plant.period_s)[:, 0, 0] for each in (found, plain, notch))
    whole, without, undone = answers
    assert_allclose(whole, without * undone, rtol=1e-9)


def test_a_value_out_of_place_is_told_with_its_bounds_and_a_unit_where_it_has_one():
    parameters = (
        Parameter("filter frequency", "Hz", 2.5, 75.0),
        Parameter("depth", "", 0.01, 3.0),
        Parameter("feedback", "", -0.9, 0.9, log=False),
    )
    said = []
    for values in ([0.0, 1.0, 0.0], [5.0, -1.0, 0.0], [5.0, 1.0, np.inf], [5.0, 1.0]):
        with pytest.raises(ValueError) as refused:
            classical._checked("own", parameters, np.array(values))
        said.append(str(refused.value))
    assert said == [
        "own: the filter frequency is 0; give a number above 0, for this plant between 2.5 and 75 Hz",
        "own: the depth is -1; give a number above 0, for this plant between 0.01 and 3",
        "own: the feedback is inf; give a finite number, for this plant between -0.9 and 0.9",
        "own takes 3 values, not 2: filter frequency (Hz), depth, feedback",
    ]
    assert classical._checked("own", parameters, np.array([[90.0], [1e-4], [-5.0]])) == [90.0, 1e-4, -5.0]
