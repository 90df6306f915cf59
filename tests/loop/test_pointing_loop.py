"""The fine-pointing loop against closed forms, plain recursions, Lyapunov equations, seeded ensembles; and refusals."""

from dataclasses import dataclass, replace
from functools import cache, lru_cache
from itertools import pairwise
from math import exp, inf, nan, pi, sqrt

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import expm, solve_discrete_lyapunov
from scipy.stats import kstest

from microrad.core import kernels, lti
from microrad.loop import control, disturbance
from microrad.loop.control import AxisController, Drive, Timing
from microrad.loop.disturbance import Disturbance, Misalignment, Reference, SampledReference
from microrad.loop.pointing_loop import ensemble, kernel_arrays, linear, traces
from microrad.loop.pointing_loop import loop as fine
from microrad.loop.pointing_loop.design import (
    LINE_DAMPING,
    behind_filter,
    close_axis,
    design_plant,
    driven_plant,
    narrow_band,
    read_each_sample,
    sampled_mirrors,
)
from microrad.loop.pointing_loop.ensemble import Span
from microrad.loop.pointing_loop.feedforward import slow_slope_s
from microrad.loop.pointing_loop.linear import residual_spectrum
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop
from microrad.loop.sensor import OpticalSensor, StrainGauge
from microrad.mirror import model as mirror
from microrad.mirror.geometry import Geometry, line_of_sight_matrix
from microrad.mirror.hysteresis import BoucWen, PrandtlIshlinskii
from microrad.mission.file import load_mission
from shipped import SHIPPED

URAD = 1e-6
SIGMAS_99 = 2.576
OLYMPUS_AXIS_RAD2 = 40 * pi * URAD**2  # variance of each axis: half of 80 pi
STILL = Reference(0.0, 0.0, 1.0)


# ------------------------------------------------------------------------------------------------ loops


@lru_cache
def paper_mission():
    return load_mission(SHIPPED).mission


@lru_cache
def paper_mirror():
    """One axis of the paper's mirror, hysteresis and all."""
    table = paper_mission().mirror
    return mirror.from_mission(table, mirror.hysteresis_model(table, table.rate_limit_v_s, table.bias_v))


def straight(gain_rad_v):
    """A hysteresis model that is a gain."""
    return BoucWen(gain_rad_v, 0.0, 0.0, 0.0, 0.0, 0.0)


def static_mirror(gain_rad_v=1e-4):
    return mirror.assemble("static mirror", "static", None, straight(gain_rad_v))


def resonant_mirror(freq_hz=900.0, damping=0.03, gain_rad_v=1e-4):
    w = 2 * pi * freq_hz
    turn = w * sqrt(1 - damping**2)
    A = np.array([[-damping * w, turn], [-turn, -damping * w]])
    part = lti.StateSpace(A, np.array([[1.0], [0.0]]), np.array([[0.0, -w * w / turn]]), np.zeros((1, 1)))
    return mirror.assemble("resonant mirror", "cascade", part, straight(gain_rad_v))


def scenario(axes=1, of=None, **changes):
    """The shipped scenario, 5 kHz, one sample of delay, 1 kHz amplifier, 1 urad, OLYMPUS, hysteresis off, no limits."""
    of = of or paper_mirror()
    loop = PointingLoop(
        mirror=mirror.combine(*[of] * axes) if axes > 1 else of,
        optics=np.eye(axes),
        drive=Drive(-inf, inf, 1e3, inf, 0.0, 0.0),
        timing=Timing(2e-4, 10, 10),
        disturbances=((disturbance.olympus(),),) * axes,
        optical=OpticalSensor(URAD, inf, 0.0, 1, 0),
        gauge=StrainGauge(0.1 * URAD, 0.0),
        references=(STILL,) * axes,
    )
    return fine.without_hysteresis(replace(loop, **changes))


def fast(period_s, axes=1, **changes):
    """A static mirror behind an ideal amplifier without delay, one plant step a sample."""
    ideal = Drive(-inf, inf, inf, inf, 0.0, 0.0)
    given = {"drive": ideal, "timing": Timing(period_s, 1, 0), "optical": OpticalSensor(0.0, inf, 0.0, 1, 0)}
    return scenario(axes, static_mirror(), gauge=None, **{**given, **changes})


def integral(step):
    """v[k] = v[k-1] + step e[k], reading e alone."""
    g = np.array([[step]])
    none = np.zeros((1, 1))
    return AxisController(
        "integral", lti.StateSpace(np.eye(1), np.hstack([g, none]), np.eye(1), np.hstack([g, none])), np.eye(1)
    )


def pi_for(loop, integral_hz=200.0, zero_hz=1500.0):
    """PI of the gains that the loop's first axis asks for, on all its axes."""
    return fine.assemble("PI", loop, pi_axis(fine.nominal_axis_gain(loop), loop.timing.period_s, integral_hz, zero_hz))


def pi_axis(gain_rad_v, period_s, integral_hz, zero_hz):
    ki = 2 * pi * integral_hz / gain_rad_v
    system = control.pid(control.Gains(ki / (2 * pi * zero_hz), ki, 0.0, 0.0), period_s)
    B, D = np.hstack([system.B, [[0.0]]]), np.hstack([system.D, [[0.0]]])
    return AxisController("PI", lti.StateSpace(system.A, B, system.C, D), system.B / system.D)


def quiet(loop):
    """The loop without disturbance and noise."""
    gauge = None if loop.gauge is None else StrainGauge(0.0, 0.0)
    optical = replace(loop.optical, noise_rad=0.0)
    return replace(loop, disturbances=((),) * loop.axes, optical=optical, gauge=gauge)


# ------------------------------------------------------------------------------------------------ 1. first order


def first_order_rad2(bandwidth_hz, period_s):
    """e[k+1] = p e[k] + d[k+1] - d[k], d Ornstein-Uhlenbeck: R(m) = s a^|m| gives 2 s (1 - a) / ((1 + p)(1 - a p))."""
    a, p = exp(-2 * pi * period_s), exp(-2 * pi * bandwidth_hz * period_s)
    return 2 * OLYMPUS_AXIS_RAD2 * (1 - a) / ((1 + p) * (1 - a * p))


def first_order_loop(bandwidth_hz, period_s, axes=2):
    """Loop and controller with the error rejection of a first-order loop, but for the sampling."""
    loop = fast(period_s, axes)
    step = -np.expm1(-2 * pi * bandwidth_hz * period_s) / fine.nominal_axis_gain(loop)
    return loop, fine.assemble("integral", loop, integral(step))


@pytest.mark.promise("sampled-loop-7")
@pytest.mark.parametrize(
    "bandwidth_hz", [10.0, *(pytest.param(hz, marks=pytest.mark.endurance) for hz in (100.0, 500.0))]
)
def test_a_first_order_loop_on_olympus_leaves_80_pi_over_1_plus_bandwidth(bandwidth_hz):
    """With 1000 samples in each radian of the bandwidth: the exact variance of the sampled loop is 0.1 % above it."""
    period, theory = 1 / (2 * pi * bandwidth_hz * 1000), 80 * pi / (1 + bandwidth_hz) * URAD**2
    assert_allclose(2 * first_order_rad2(bandwidth_hz, period), theory, rtol=1.1e-3)
    loop, controller = first_order_loop(bandwidth_hz, period)
    settle = 5 / (2 * pi * bandwidth_hz)
    found = ensemble.simulate(loop, controller, Span(settle + 2.5e5 * period, settle, 1), 64)
    half = found.radial_rms_interval_rad()
    print(f"{bandwidth_hz:g} Hz: {found.radial_rms_rad / URAD:.4f} +- {half / URAD:.4f} urad radial")
    assert abs(found.radial_rms_rad - sqrt(theory)) < half
    assert half < 0.013 * found.radial_rms_rad


@pytest.mark.parametrize("bandwidth_hz", [10.0, 100.0, 500.0])
def test_the_linear_loop_is_the_recursion_of_the_sampled_first_order_loop(bandwidth_hz):
    loop, controller = first_order_loop(bandwidth_hz, 20e-6)
    found = linear.stationary(linear.close(loop, controller))
    assert_allclose(found.error, first_order_rad2(bandwidth_hz, 20e-6), rtol=1e-9)


def test_at_50_khz_the_simulated_loop_is_the_sampled_one_and_not_the_continuous_one():
    """At 500 Hz and 50 kHz sampling adds 6 % to the variance: the ensemble tells the two closed forms apart."""
    sampled, continuous = sqrt(2 * first_order_rad2(500.0, 20e-6)), sqrt(80 * pi / 501) * URAD
    loop, controller = first_order_loop(500.0, 20e-6)
    found = ensemble.simulate(loop, controller, Span(2.0, 0.01, 2), 64)
    assert abs(found.radial_rms_rad - sampled) < found.radial_rms_interval_rad()
    assert found.radial_rms_rad - continuous > 3 * found.radial_rms_interval_rad()


# ------------------------------------------------------------------------------------------------ plain recursion


@dataclass
class Plain:
    """The linear loop step by step, a column for each impulse: nothing of the code under test but its records."""

    loop: PointingLoop
    controller: LoopController

    def march(self, samples, columns, disturbed=None, sensed=None, gauged=None):
        """Errors at the end of each plant step, (samples x steps, axes, columns).

        ``disturbed`` (step) gives (axes, columns); ``sensed`` (sample) what is added to the optical reading, and
        ``gauged`` (sample) to the gauge's.
        """
        lp, c = self.loop, self.controller.system
        m, drive, N = lp.mirror, lp.drive, lp.timing.steps_per_sample
        Ad, B0, B1, through = held_linearly(m, lp.timing.step_s)
        follow = 1.0 if drive.bandwidth_hz == inf else 1 - exp(-2 * pi * drive.bandwidth_hz * lp.timing.step_s)
        nothing = np.zeros((lp.axes, columns))
        disturbed = disturbed or (lambda step: nothing)
        x, u, xc = np.zeros((len(Ad), columns)), np.zeros((m.actuators, columns)), np.zeros((c.order, columns))
        y, reading, commands, errors = np.zeros((m.axes, columns)), nothing, {}, {}
        for k in range(samples):
            if k % lp.optical.every == 0:
                reading = errors.get(k * N - lp.optical.delay_steps, nothing) + (sensed(k) if sensed else 0.0)
            gauge = y + (gauged(k) if gauged else 0.0)
            measured = np.vstack([reading, gauge, nothing])
            commands[k] = c.C @ xc + c.D @ measured
            xc = c.A @ xc + c.B @ measured
            for step in range(k * N, (k + 1) * N):
                due = commands.get((step - lp.timing.delay_steps) // N, np.zeros_like(u))
                before, u = u, u + follow * (due - u)
                x = Ad @ x + B0 @ before + B1 @ u
                y = m.C @ x + through @ u
                errors[step + 1] = disturbed(step + 1) - lp.optics @ y
        return np.array([errors[i + 1] for i in range(samples * N)])

    def variances(self, seconds=0.12):
        """By source, (2, axes): the mean over all plant steps, and over the control samples; sums of squared answers.

        A column for each source, place and time of a sensor period; OLYMPUS's second behind the end goes on as a
        geometric series.
        """
        lp = self.loop
        N, every, axes, outputs = lp.timing.steps_per_sample, lp.optical.every, lp.axes, lp.mirror.axes
        cycle, keep = N * every, exp(-2 * pi * lp.timing.step_s)
        samples = every * round(seconds / lp.timing.period_s / every)
        size = sqrt(OLYMPUS_AXIS_RAD2 * (1 - keep**2)) if any(lp.disturbances) else 0.0
        gauge_noise = lp.gauge.noise_rad if lp.gauge else 0.0
        columns = (axes * cycle, axes, outputs * every)
        kicked = 1 + np.tile(np.arange(cycle), axes)
        place = np.kron(np.eye(axes), np.ones(cycle))

        def olympus(step):
            age = step - kicked
            return np.hstack([np.where(age >= 0, size * keep ** np.maximum(age, 0), 0.0) * place, others])

        others = np.zeros((axes, sum(columns[1:])))
        once = np.hstack(
            [np.zeros((axes, columns[0])), lp.optical.noise_rad * np.eye(axes), np.zeros((axes, columns[2]))]
        )
        before = np.zeros((outputs, sum(columns[:2])))
        errors = self.march(
            samples,
            sum(columns),
            disturbed=olympus,
            sensed=lambda k: once * (k == 0),
            gauged=lambda k: np.hstack([before, gauge_noise * np.kron(np.eye(outputs), np.arange(every) == k)]),
        )
        power = errors**2
        tail = np.sum(power[-cycle:], axis=0) * keep ** (2 * cycle) / (1 - keep ** (2 * cycle))
        tail_at_samples = np.sum(power[-cycle:][N - 1 :: N], axis=0) * keep ** (2 * cycle) / (1 - keep ** (2 * cycle))
        tail[:, columns[0] :] = tail_at_samples[:, columns[0] :] = 0.0
        means = np.stack(
            [(np.sum(power, axis=0) + tail) / cycle, (np.sum(power[N - 1 :: N], axis=0) + tail_at_samples) / every]
        )
        parts = np.split(means, np.cumsum(columns)[:2], axis=2)
        names = ("OLYMPUS", "optical sensor noise", "gauge noise")
        return {name: np.sum(part, axis=2) for name, part in zip(names, parts, strict=True)}


def held_linearly(m, step_s):
    """Exact step of the mirror for a drive that is linear over it, by the exponential of drive and slope."""
    gains = np.array([model.d1_rad_v for model in m.bouc_wen])[:, None]
    B, through = m.B + m.E @ (gains * m.G), m.D + m.K @ (gains * m.G)
    n, k = B.shape
    big = np.zeros((n + 2 * k, n + 2 * k))
    big[:n, :n], big[:n, n : n + k], big[n : n + k, n + k :] = m.A, B, np.eye(k)
    moved = expm(big * step_s)
    start, slope = moved[:n, n : n + k], moved[:n, n + k :] / step_s
    return moved[:n, :n], start - slope, slope, through


def coupled(**changes):
    """Two axes turned by 25 degrees against the mirror's, 20 % of each on the other, oblique incidence, a telescope."""
    geometry = Geometry(
        "optical", incidence_rad=0.3, magnification=2.0, rotation_rad=0.44, coupling=((1.0, 0.2), (-0.1, 0.9))
    )
    return scenario(2, optics=line_of_sight_matrix(geometry), **changes)


def tripod():
    """Three mirrors as actuators, with different gains."""
    gains = (80e-6, 90e-6, 100e-6)
    of = mirror.combine(*(replace(paper_mirror(), bouc_wen=(straight(g),), inverse=(straight(g),)) for g in gains))
    optics = line_of_sight_matrix(Geometry("mechanical", layout="tripod", actuator_radius_m=0.01))
    return replace(scenario(2), mirror=of, optics=optics)


def damped():
    """A mirror with a resonance at 400 Hz, 3 % damped, under an integral and feedback of its strain gauge."""
    loop = scenario(1, resonant_mirror(400.0, 0.03), gauge=StrainGauge(URAD, 0.0))
    axis = control.RESONANT_DAMPING.build(design_plant(loop), np.array([150.0, 800.0, 1.0, 0.4]))
    return loop, fine.assemble(axis.name, loop, axis)


def damped_coupled():
    """Two such mirrors behind optics that turn, couple and magnify; a part of the gauges' reading acts at once."""
    loop = coupled(of=resonant_mirror(400.0, 0.03), gauge=StrainGauge(URAD, 0.0))
    return loop, fine.assemble("resonant damping", loop, axis_like(loop, resonant_mirror(400.0, 0.03))[1])


def axis_like(loop, of):
    """One axis with the gain that the axes of the loop have, and a controller of it that reads its gauge."""
    gain = fine.nominal_axis_gain(loop)
    one = scenario(1, of, optics=np.array([[gain / fine.in_band_gain(of)[0, 0]]]))
    axis = control.RESONANT_DAMPING.build(design_plant(one), np.array([150.0, 800.0, 1.0, 0.4]))
    at_once = replace(axis.system, D=axis.system.D + np.array([[0.0, 0.1 / gain]]))
    return one, replace(axis, system=at_once)


def with_pi(loop, *frequencies_hz):
    return loop, pi_for(loop, *frequencies_hz)


VARIANTS = {
    "one axis": lambda: with_pi(scenario()),
    "sensor 70 % of a sample late": lambda: with_pi(scenario(optical=OpticalSensor(URAD, inf, 0.0, 1, 7)), 130.0),
    "sensor every third sample": lambda: with_pi(scenario(optical=OpticalSensor(URAD, inf, 0.0, 3, 0)), 100.0),
    "resonance damped by the gauge": damped,
    "two coupled axes": lambda: with_pi(coupled()),
    "two coupled resonances damped by the gauge": damped_coupled,
    "tripod": lambda: with_pi(tripod()),
    "half a sample of delay": lambda: with_pi(scenario(timing=Timing(2e-4, 10, 5)), 300.0),
    "two and a half samples of delay": lambda: with_pi(scenario(timing=Timing(2e-4, 4, 10)), 100.0),
}
variants = pytest.mark.parametrize("variant", VARIANTS)
SIMULATED = (
    "sensor every third sample",
    "two coupled resonances damped by the gauge",
    "tripod",
    "two and a half samples of delay",
)
"""What has, together, all that a variant has; the linear theory of each is held against a plain recursion."""
ENDURANCE = pytest.mark.endurance


@cache
def marched(variant):
    """Variances of a variant by source, by the plain recursion."""
    return Plain(*VARIANTS[variant]()).variances()


# ------------------------------------------------------------------------------------------------ 2. Lyapunov values


@pytest.mark.parametrize("gain", [0.05, 0.5, 1.7])
def test_white_noise_through_an_integrator_leaves_g_over_2_minus_g_of_its_variance(gain):
    """e[k+1] = (1 - g) e[k] - g n[k]; the readings pass through a first-order filter."""
    loop = fast(1e-3, optical=OpticalSensor(3 * URAD, inf, 0.0, 1, 0), disturbances=((),))
    controller = fine.assemble("integral", loop, integral(gain / fine.nominal_axis_gain(loop)))
    found = linear.stationary(linear.close(loop, controller))
    assert_allclose(found.error, gain / (2 - gain) * (3 * URAD) ** 2, rtol=1e-12)
    assert_allclose(found.error_by_source["optical sensor noise"], found.error, rtol=1e-12)
    assert_allclose(found.drive, found.error / fine.nominal_axis_gain(loop) ** 2, rtol=1e-12)


@pytest.mark.promise("sampled-loop-4")
def test_stationary_is_the_lyapunov_solution_of_matrices_written_by_hand():
    """One plant step a sample, one sample of delay, a slow amplifier, PI on the error, a gauge fed back, OLYMPUS."""
    T, K, kp, ki, kg, follow = 1e-4, 1.0, 0.15, 0.09, -0.12, 0.3
    a, n, ng = exp(-2 * pi * T), 2 * URAD, 3 * URAD
    amplifier = Drive(-inf, inf, -np.log(1 - follow) / (2 * pi * T), inf, 0.0, 0.0)
    sensors = {"optical": OpticalSensor(n, inf, 0.0, 1, 0), "gauge": StrainGauge(ng, 0.0)}
    loop = scenario(1, static_mirror(K), drive=amplifier, timing=Timing(T, 1, 1), **sensors)
    B, D = np.array([[ki, 0.0]]), np.array([[kp + ki, kg]])
    axis = AxisController("PI", lti.StateSpace(np.eye(1), B, np.eye(1), D), np.zeros((1, 1)))
    found = linear.stationary(linear.close(loop, fine.assemble("PI", loop, axis)))
    # states: drive u, last command v, integral x, disturbance d; e = d - K u
    command = np.array([-(kp + ki) * K + kg * K, 0.0, 1.0, kp + ki])
    A = np.array([[1 - follow, follow, 0.0, 0.0], command, [-ki * K, 0.0, 1.0, ki], [0.0, 0.0, 0.0, a]])
    noises = {
        "OLYMPUS": [0.0, 0.0, 0.0, sqrt(OLYMPUS_AXIS_RAD2 * (1 - a * a))],
        "optical sensor noise": [0.0, (kp + ki) * n, ki * n, 0.0],
        "gauge noise": [0.0, kg * ng, 0.0, 0.0],
    }
    read = np.array([-K, 0.0, 0.0, 1.0])
    spread = {name: solve_discrete_lyapunov(A, np.outer(b, b)) for name, b in noises.items()}
    for name, P in spread.items():
        assert_allclose(found.error_by_source[name], read @ P @ read, rtol=1e-9)
        assert P[0, 0] > 0.0
    assert_allclose(found.error, sum(read @ P @ read for P in spread.values()), rtol=1e-9)
    assert_allclose(found.drive, sum(P[0, 0] for P in spread.values()), rtol=1e-9)


@variants
def test_stationary_by_source_is_the_sum_of_squared_answers_of_a_plain_recursion(variant):
    loop, controller = VARIANTS[variant]()
    found = linear.stationary(linear.close(loop, controller))
    plain = marched(variant)
    for name, (everywhere, _) in plain.items():
        share = 2e-5 if name == "OLYMPUS" else 1e-8  # what OLYMPUS's own second leaves behind the end
        assert_allclose(found.error_by_source[name], everywhere, rtol=share)
    assert_allclose(found.error, sum(found.error_by_source.values()), rtol=1e-12)
    if "gauge" in variant:
        assert np.all(found.error_by_source["gauge noise"] > 0.01 * found.error)


def test_white_sensor_noise_simulated_leaves_the_lyapunov_value_within_1_percent():
    """Noise alone in the shipped loop; the 99 % interval of the variance is below 1 %."""
    loop = replace(scenario(2), disturbances=((), ()))
    controller = pi_for(loop)
    found = ensemble.simulate(loop, controller, Span(2.0, 0.5, 3), 64)
    theory = linear.stationary(linear.close(loop, controller))
    assert 2 * found.radial_rms_interval_rad() < 0.01 * found.radial_rms_rad
    assert_allclose(found.radial_rms_rad**2, np.sum(theory.error), rtol=0.01)
    assert_allclose(found.axis_rms_rad**2, theory.error, rtol=0.01)
    louder = replace(loop, optical=replace(loop.optical, noise_rad=1.02 * URAD))
    assert np.sum(linear.stationary(linear.close(louder, controller)).error) > 1.02 * found.radial_rms_rad**2


# ------------------------------------------------------------------------------------------------ 3. sensitivity


@dataclass(frozen=True)
class Multisine:
    """A reference of several sines at multiples of a frequency."""

    freqs_hz: tuple[float, ...]
    amplitude_rad: float = URAD

    def at(self, time_s):
        phases = 2 * pi * np.modf(0.618 * np.arange(len(self.freqs_hz)) ** 2)[0]
        return self.amplitude_rad * np.sum(
            [np.sin(2 * pi * f * np.asarray(time_s) + p) for f, p in zip(self.freqs_hz, phases, strict=True)], axis=0
        )


LINES_HZ = (5.0, 10.0, 25.0, 60.0, 120.0, 190.0, 300.0, 480.0, 700.0, 1000.0, 1300.0, 1600.0, 1900.0, 2100.0, 2250.0)


def measured_sensitivity(loop, controller, freqs_hz=LINES_HZ, settle_s=0.6, amplitude_rad=URAD):
    """Error over reference at the control samples, (frequencies, axes, axes): one axis excited after the other."""
    period = loop.timing.period_s
    per_line = round(1 / (freqs_hz[0] * period))  # the longest sine's period in samples
    at = np.rint(np.array(freqs_hz) * per_line * period).astype(int)
    columns = []
    for axis in range(loop.axes):
        given = [STILL] * loop.axes
        given[axis] = Multisine(freqs_hz, amplitude_rad)
        found = traces.trace(
            replace(loop, references=tuple(given)), controller, Span(settle_s + 5 * per_line * period, 0.0, 1)
        )
        last = slice(-4 * per_line, None)
        spectrum = np.fft.rfft(found.error_rad[last], axis=0)[4 * at]
        columns.append(spectrum / np.fft.rfft(found.reference_rad[last, axis])[4 * at, None])
    return np.stack(columns, axis=2)


@pytest.mark.parametrize(
    "variant",
    [
        *(pytest.param(v, marks=ENDURANCE) for v in ("one axis", "resonance damped by the gauge")),
        *("two coupled axes", "half a sample of delay"),
    ],
)
def test_the_sensitivity_measured_by_multisine_is_the_designed_one_up_to_0_45_of_the_rate(variant):
    loop, controller = VARIANTS[variant]()
    found = measured_sensitivity(quiet(loop), controller)
    designed = linear.sensitivity(linear.close(loop, controller), np.array(LINES_HZ))
    size = np.linalg.norm(designed, axis=(1, 2))
    assert np.all(np.linalg.norm(found - designed, axis=(1, 2)) < 0.01 * size)
    assert size[0] < 0.1 * size[-1]


# ------------------------------------------------------------------------------------------------ 4. simulated residual


@pytest.mark.parametrize("variant", [pytest.param(v, marks=[] if v in SIMULATED else ENDURANCE) for v in VARIANTS])
def test_without_hysteresis_the_simulated_residual_is_the_lyapunov_value(variant):
    loop, controller = VARIANTS[variant]()
    found = ensemble.simulate(loop, controller, Span(1.3, 0.3, 4), 64)
    theory = linear.stationary(linear.close(loop, controller))
    assert_allclose(found.axis_rms_rad, np.sqrt(theory.error), rtol=0.01)
    assert abs(found.radial_rms_rad - theory.radial_rms_rad) < found.radial_rms_interval_rad()
    assert found.radial_rms_interval_rad() < 0.01 * found.radial_rms_rad


DECOUPLED = {
    "two axes": lambda: (coupled(of=resonant_mirror(400.0, 0.03)), resonant_mirror(400.0, 0.03)),
    "tripod": lambda: (tripod(), paper_mirror()),
}


@pytest.mark.promise("pointing-9")
@pytest.mark.parametrize("layout", DECOUPLED)
def test_coupled_axes_are_decoupled_and_each_is_the_loop_of_one_axis(layout):
    """With a controller that reads the gauges: the optics turn commands and readings, and no axis moves another."""
    loop, of = DECOUPLED[layout]()
    one, axis = axis_like(loop, of)
    freq = np.array(LINES_HZ)
    both = linear.sensitivity(linear.close(loop, fine.assemble(axis.name, loop, axis)), freq)
    alone = linear.sensitivity(close_axis(one, axis), freq)[:, 0, 0]
    assert_allclose(both, alone[:, None, None] * np.eye(2), rtol=0, atol=1e-8 * np.max(np.abs(alone)))
    assert not np.allclose(loop.optics[:, :2], loop.optics[:, :2].T, rtol=0.05)
    blind = replace(axis, system=replace(axis.system, D=axis.system.D * np.array([[1.0, 0.0]])))
    assert np.max(np.abs(linear.sensitivity(close_axis(one, blind), freq)[:, 0, 0] / alone - 1)) > 0.02


@pytest.mark.parametrize("late", [7, *(pytest.param(n, marks=pytest.mark.endurance) for n in (3, 5, 10, 13))])
def test_the_sensitivity_of_a_late_sensor_is_the_error_that_sines_leave(late):
    """Exact for whole samples; for a part of one within 0.4 %: the mirror's path between samples is no sine."""
    loop = scenario(1, resonant_mirror(), optical=OpticalSensor(0.0, inf, 0.0, 1, late), gauge=None)
    controller, freq = pi_for(loop, 60.0), np.array(LINES_HZ)
    turns = np.outer(freq, np.arange(20_001) * loop.timing.step_s)
    sines = np.vstack([np.cos(2 * pi * turns), np.sin(2 * pi * turns)])
    errors = Plain(loop, controller).march(2000, 2 * freq.size, disturbed=lambda step: sines[None, :, step])
    last = np.arange(10_010, 20_001, 10)  # 1000 samples, whole periods of each
    turned = errors[last - 1, 0, : freq.size] + 1j * errors[last - 1, 0, freq.size :]
    found = np.mean(turned * np.exp(-2j * pi * turns[:, last].T), axis=0)
    designed = linear.sensitivity(linear.close(loop, controller), freq)[:, 0, 0]
    assert_allclose(found, designed, rtol=0, atol=(1e-6 if late == 10 else 0.004) * np.max(np.abs(designed)))


def on_a_line(freq_hz, every=1, **changes):
    """A wheel's line of 1 urad alone, a sensor that delivers every so many samples, and a PI."""
    line = disturbance.wheels(freq_hz, (1.0,), (URAD / freq_hz**2,), convention="per-axis")
    sensor = OpticalSensor(0.0, inf, 0.0, every, 0)
    loop = scenario(disturbances=((line,),), optical=sensor, gauge=None, **changes)
    return loop, pi_for(loop, 100.0)


@pytest.mark.parametrize("freq_hz", [50.0, 900.0, 1700.0])
def test_a_line_leaves_half_the_square_of_what_the_sensitivity_makes_of_its_amplitude(freq_hz):
    """With one plant step a sample; with ten the mean over them is another, as the mirror's path between is no sine."""
    closed = linear.close(*on_a_line(freq_hz, timing=Timing(2e-4, 1, 1)))
    gain = abs(linear.sensitivity(closed, np.array([freq_hz]))[0, 0, 0])
    theory = linear.stationary(closed)
    assert_allclose(theory.error_by_source["reaction wheel"], 0.5 * (URAD * gain) ** 2, rtol=1e-9)
    assert_allclose(theory.error, 0.5 * (URAD * gain) ** 2, rtol=1e-9)
    between = linear.close(*on_a_line(freq_hz))
    gain = abs(linear.sensitivity(between, np.array([freq_hz]))[0, 0, 0])
    assert 1e-3 < abs(linear.stationary(between).error[0] / (0.5 * (URAD * gain) ** 2) - 1) < 6e-3


@pytest.mark.parametrize("every", [1, 2, 3])
@pytest.mark.parametrize("freq_hz", [50.0, 900.0, 1700.0])
def test_a_line_leaves_in_theory_what_it_leaves_simulated_whatever_the_rate_of_the_sensor(freq_hz, every):
    """Also above half the sensor's rate, where the loop answers at other frequencies than the line's."""
    loop, controller = on_a_line(freq_hz, every)
    theory = linear.stationary(linear.close(loop, controller))
    found = ensemble.simulate(loop, controller, Span(2.0, 1.0, 1), 64)
    assert_allclose(found.radial_rms_rad, theory.radial_rms_rad, rtol=1e-4)
    assert found.radial_rms_rad > 0.2 * URAD


@pytest.mark.parametrize("every", [1, 2])
def test_a_line_drives_the_mirror_in_theory_as_it_does_simulated(every):
    loop, controller = on_a_line(300.0, every, timing=Timing(2e-4, 1, 1))
    traced = traces.trace(loop, controller, Span(2.0, 0.0, 1))
    theory = linear.stationary(linear.close(loop, controller))
    assert_allclose(np.mean(traced.drive_v[5000:] ** 2, axis=0), theory.drive, rtol=1e-4)
    assert_allclose(np.mean(traced.error_rad[5000:] ** 2, axis=0), theory.error, rtol=1e-4)


def test_lines_and_noise_of_several_disturbances_add_up_on_two_axes_behind_a_slow_sensor():
    """Against an ensemble, and each line's part against that of the line alone."""
    lines = disturbance.wheels(80.0, (1.0, 2.0), (0.7e-9, 0.2e-9), convention="per-axis")
    shaking = (disturbance.olympus(), lines, disturbance.body_pointing(300 * URAD, 3, 0.5))
    loop = coupled(disturbances=(shaking, shaking), optical=OpticalSensor(URAD, inf, 0.0, 2, 0))
    controller = pi_for(loop, 100.0)
    theory = linear.stationary(linear.close(loop, controller))
    found = ensemble.simulate(loop, controller, Span(1.3, 0.3, 4), 64)
    assert_allclose(found.axis_rms_rad, np.sqrt(theory.error), rtol=0.01)
    alone = linear.stationary(linear.close(replace(quiet(loop), disturbances=((lines,), (lines,))), controller))
    assert_allclose(theory.error_by_source["reaction wheel"], alone.error, rtol=1e-9)
    assert np.all(alone.error > 0.1 * theory.error)


# ------------------------------------------------------------------------------------------------ 5. spectrum


@pytest.mark.promise("pointing-98")
@pytest.mark.parametrize(
    "variant", [pytest.param("one axis", marks=ENDURANCE), "resonance damped by the gauge", "two coupled axes"]
)
def test_the_residual_spectrum_is_that_of_the_ensemble_within_its_interval(variant):
    """Averaged over bands of 8 bins and more, each of which has 320 periodograms of 64 runs."""
    loop, controller = VARIANTS[variant]()
    segments = 5
    found = ensemble.simulate(loop, controller, Span(0.3 + segments * 2048 * loop.timing.period_s, 0.3, 5), 64)
    assert found.freq_hz.size == 1025
    predicted = residual_spectrum(linear.close(loop, controller), found.freq_hz)
    ratio = (found.psd_rad2_hz / predicted)[4:-1]  # the window takes in neighbours at the lowest frequencies
    edges = np.unique(np.geomspace(8, len(ratio), 25).astype(int))
    sigma = 1 / sqrt(64 * segments)
    assert_allclose(np.std(ratio), sigma, rtol=0.1)
    for axis in range(loop.axes):
        for low, high in pairwise(edges):
            band = np.mean(ratio[low:high, axis])
            assert abs(band - 1) < 4.5 * sigma * sqrt(1.95 / (high - low)), (
                axis,
                low,
                high,
            )  # 1.95: Hann's bins overlap
    width = found.freq_hz[1]
    assert_allclose(np.sum(found.psd_rad2_hz, axis=0) * width, found.axis_rms_rad**2, rtol=0.02)


@pytest.mark.parametrize("variant", [v for v in VARIANTS if v != "sensor every third sample"])
def test_the_residual_spectrum_has_the_variance_of_the_control_samples(variant):
    loop, controller = VARIANTS[variant]()
    freq = np.concatenate([[0.0], np.geomspace(1e-3, 0.5 / loop.timing.period_s, 3000)])
    spectrum = residual_spectrum(linear.close(loop, controller), freq)
    at_samples = sum(both[1] for both in marched(variant).values())
    assert_allclose(np.trapezoid(spectrum, freq, axis=0), at_samples, rtol=1e-4)


def test_the_residual_spectrum_leaves_lines_out_and_refuses_a_slow_sensor():
    lines = disturbance.wheels(50.0, (1.0, 2.0), (1e-9, 1e-9), convention="per-axis")
    loop, controller = VARIANTS["one axis"]()
    shaken = replace(loop, disturbances=((*loop.disturbances[0], lines),))
    freq = np.array([1.0, 50.0, 100.0, 2500.0])
    without = residual_spectrum(linear.close(loop, controller), freq)
    assert_allclose(residual_spectrum(linear.close(shaken, controller), freq), without, rtol=1e-9)
    slow = linear.close(*VARIANTS["sensor every third sample"]())
    with pytest.raises(ValueError, match="a residual spectrum needs an optical reading at every control sample"):
        residual_spectrum(slow, freq)


# ------------------------------------------------------------------------------------------------ 6. design plant


def closed_by_hand(plant, axis):
    """Variances of the residual by white input: squared answers of plant and controller, summed over a second."""
    s, c = plant.system, axis.system
    A, Bu, Bw, Cm, Dw = s.A, s.B[:, :1], s.B[:, 1:], s.C[1:], s.D[1:, 1:]
    both = np.block([[A + Bu @ c.D @ Cm, Bu @ c.C], [c.B @ Cm, c.A]])
    noises = np.vstack([Bw + Bu @ c.D @ Dw, c.B @ Dw])
    read = np.concatenate([s.C[0], np.zeros(c.order)])
    total = np.zeros(noises.shape[1])
    for _ in range(round(1.0 / plant.period_s)):  # OLYMPUS's own second
        total += (read @ noises) ** 2
        noises = both @ noises
    return total


def an_axis(variant):
    """A variant with one axis, and its controller of one axis."""
    loop, _ = VARIANTS[variant]()
    if variant == "resonance damped by the gauge":
        return loop, control.RESONANT_DAMPING.build(design_plant(loop), np.array([150.0, 800.0, 1.0, 0.4]))
    return loop, pi_axis(fine.nominal_axis_gain(loop), loop.timing.period_s, 100.0, 1500.0)


ONE_AXIS = (
    "one axis",
    "sensor 70 % of a sample late",
    "resonance damped by the gauge",
    "two and a half samples of delay",
)
one_axis = pytest.mark.parametrize("variant", ONE_AXIS)


@pytest.mark.promise("pointing-11", "sampled-loop-2")
@one_axis
def test_the_design_plant_closed_by_hand_leaves_the_variance_of_the_control_samples(variant):
    loop, axis = an_axis(variant)
    plant = design_plant(loop)
    found = closed_by_hand(plant, axis)
    plain = Plain(loop, fine.assemble(axis.name, loop, axis)).variances()
    assert found.size == plant.disturbances + 2
    assert_allclose(np.sum(found[: plant.disturbances]), plain["OLYMPUS"][1], rtol=2e-5)
    assert_allclose(found[-2:], [plain["optical sensor noise"][1, 0], plain["gauge noise"][1, 0]], rtol=1e-7)
    assert_allclose(plant.gain_rad_v, abs(fine.in_band_gain(loop.mirror)[0, 0]), rtol=1e-12)
    assert (plant.has_gauge, plant.period_s) == (True, loop.timing.period_s)


def test_the_design_plant_closed_by_hand_is_the_stationary_loop_where_a_sample_has_one_step():
    loop = scenario(1, resonant_mirror(), timing=Timing(1e-4, 1, 2), optical=OpticalSensor(URAD, inf, 0.0, 1, 1))
    loop = replace(loop, optics=np.array([[0.5]]), gauge=StrainGauge(2 * URAD, 0.0))
    axis = pi_axis(fine.nominal_axis_gain(loop), 1e-4, 40.0, 1e4)
    reads = AxisController(
        "with gauge", replace(axis.system, D=axis.system.D + np.array([[0.0, -900.0]])), axis.anti_windup
    )
    stationary = linear.stationary(close_axis(loop, reads))
    found = closed_by_hand(design_plant(loop), reads)
    by_name = stationary.error_by_source
    assert_allclose(np.sum(found), stationary.error, rtol=1e-7)
    assert_allclose(found[-2:], [by_name["optical sensor noise"][0], by_name["gauge noise"][0]], rtol=1e-7)
    assert found[-1] > 0.001 * np.sum(found)


@pytest.mark.promise("sampled-loop-2")
@one_axis
def test_the_loop_gain_of_the_design_plant_is_that_of_the_linear_loop(variant):
    """L = -P_o C_o / (1 - C_g P_g), with P from the command to both readings."""
    loop, axis = an_axis(variant)
    freq = np.geomspace(1.0, 2400.0, 40)
    P = lti.frequency_response(design_plant(loop).from_command, freq, loop.timing.period_s)
    C = lti.frequency_response(axis.system, freq, loop.timing.period_s)
    by_hand = -P[:, 0, 0] * C[:, 0, 0] / (1 - C[:, 0, 1] * P[:, 1, 0])
    closed = close_axis(loop, axis)
    assert_allclose(linear.loop_response(closed, freq)[:, 0, 0], by_hand, rtol=1e-8)
    assert_allclose(linear.sensitivity(closed, freq)[:, 0, 0], 1 / (1 + by_hand), rtol=1e-8)
    assert abs(by_hand[0]) > 50


def test_a_design_plant_without_gauge_says_so_and_one_of_two_axes_is_refused():
    plant = design_plant(scenario(gauge=None))
    assert not plant.has_gauge
    assert_array_equal(plant.system.C[2], 0.0)
    assert_array_equal(plant.system.D[2], 0.0)
    with pytest.raises(ValueError, match="of one axis with one actuator, not of 2 with 2: design each axis by itself"):
        design_plant(scenario(2))


def test_a_filter_ahead_of_the_plant_multiplies_its_response_and_nothing_else():
    loop = scenario()
    plant, path = design_plant(loop), fine.ReferenceFilter(800.0).discrete(loop.timing.period_s)
    behind = behind_filter(plant, path)
    freq = np.geomspace(1.0, 2400.0, 30)
    alone = lti.frequency_response(plant.system, freq, plant.period_s)
    both = lti.frequency_response(behind.system, freq, plant.period_s)
    through = lti.frequency_response(path, freq, plant.period_s)[:, 0, 0]
    assert_allclose(both[:, :, 0], alone[:, :, 0] * through[:, None], rtol=1e-9)
    assert_allclose(both[:, :, 1:], alone[:, :, 1:], rtol=1e-12, atol=1e-300)
    assert replace(behind, system=plant.system) == plant


@pytest.mark.parametrize("optics", [[[-1.0]], [[-0.25]], [[2.0]]])
def test_a_design_plant_rises_with_its_command_whichever_way_the_mirror_turns(optics):
    loop = scenario(optics=np.array(optics))
    axis = pi_axis(fine.nominal_axis_gain(loop), loop.timing.period_s, 100.0, 1500.0)
    plant = design_plant(loop)
    slow = lti.frequency_response(plant.from_command, np.array([0.2]), plant.period_s)[0, :, 0].real
    assert slow[0] < 0 < slow[1]
    freq = np.array([10.0, 200.0])
    loop_gain = -lti.frequency_response(lti.series(plant_input(axis), plant.from_command), freq, plant.period_s)[
        :, 0, 0
    ]
    assert_allclose(linear.loop_response(close_axis(loop, axis), freq)[:, 0, 0], loop_gain, rtol=1e-8)


def plant_input(axis):
    """The controller from its optical reading alone."""
    return lti.StateSpace(axis.system.A, axis.system.B[:, :1], axis.system.C, axis.system.D[:, :1])


def test_a_slow_sensor_is_designed_for_as_a_later_one_with_the_noise_that_its_hold_spreads():
    """The design's residual by source against that of the loop whose sensor delivers every third sample."""
    loop, axis = an_axis("one axis")
    slow = replace(loop, optical=OpticalSensor(URAD, inf, 0.0, 3, 0))
    designed, exact = (
        closed_by_hand(design_plant(slow), axis),
        linear.stationary(close_axis(slow, axis)).error_by_source,
    )
    at_each_sample = np.sum(closed_by_hand(design_plant(loop), axis)[:-2])
    assert_allclose(np.sum(designed[:-2]), exact["OLYMPUS"], rtol=0.02)
    assert at_each_sample < 0.9 * exact["OLYMPUS"]
    assert_allclose(designed[-2], exact["optical sensor noise"], rtol=0.15)


def test_a_narrow_band_has_the_variance_of_its_line_at_its_frequency():
    line_hz, amplitude = 137.0, 2 * URAD
    lines = disturbance.wheels(
        line_hz, (1.0, 2.0), (amplitude / line_hz**2, 0.1 * amplitude / line_hz**2), convention="per-axis"
    )
    shaken = disturbance.combine(disturbance.olympus(), lines)
    banded = narrow_band(shaken)
    assert not banded.lines
    assert_allclose(banded.variance_rad2, shaken.variance_rad2, rtol=1e-12)
    assert_allclose(narrow_band(lines).variance_rad2, 0.5 * 1.01 * amplitude**2, rtol=1e-12)
    freq = line_hz + line_hz * LINE_DAMPING * np.linspace(-3, 3, 601)
    density = disturbance.psd(narrow_band(lines), freq)
    assert_allclose(freq[np.argmax(density)], line_hz, rtol=1e-4)
    assert_allclose(np.max(density) / density[[200, 400]], 2.0, rtol=0.01)  # half its height one damping ratio away
    bands = disturbance.band_rms(banded, [0.95 * line_hz, 1.05 * line_hz])
    assert 0.95 * amplitude**2 / 2 < bands[0] ** 2 < 1.02 * amplitude**2 / 2
    assert narrow_band(disturbance.olympus()) == disturbance.olympus()


# ------------------------------------------------------------------------------------------------ 7. refusals


@pytest.mark.promise("pointing-31")
def test_an_unstable_loop_is_refused_with_its_pole_its_frequency_and_the_control_period():
    loop = fast(1e-3, disturbances=((),))
    unstable = fine.assemble("fast integral", loop, integral(2.5 / fine.nominal_axis_gain(loop)))  # pole at 1 - 2.5
    with pytest.raises(ValueError) as refused:
        linear.stationary(linear.close(loop, unstable))
    words = str(refused.value)
    assert "the loop under 'fast integral' is unstable: a pole at |z| = 1.500000 (the limit is 1)" in words
    assert "and 500 Hz, for a control period of 0.001 s; lower its gains or delay" in words
    linear.refuse_unstable(
        linear.close(loop, fine.assemble("slower", loop, integral(1.9 / fine.nominal_axis_gain(loop))))
    )


def test_an_unstable_resonance_is_named_by_its_own_frequency():
    loop = scenario(1, resonant_mirror(400.0, 0.03))
    size, freq_hz = linear.close(loop, pi_for(loop, 50.0, 20e3)).worst_pole()
    assert 1.0 < size < 1.05
    assert_allclose(freq_hz, 400.0, rtol=0.06)
    with pytest.raises(ValueError, match=f"and {freq_hz:.4g} Hz"):
        linear.stationary(linear.close(loop, pi_for(loop, 50.0, 20e3)))


def test_the_worst_pole_of_a_slow_sensor_is_counted_by_control_sample():
    """e[k+3] = (1 - g) e[k] - 2 g... with an integrator that steps three times on each held reading: pole 1 - 3 g."""
    loop = fast(1e-3, disturbances=((),), optical=OpticalSensor(0.0, inf, 0.0, 3, 0))
    for g in (0.1, 0.2):
        closed = linear.close(loop, fine.assemble("integral", loop, integral(g / fine.nominal_axis_gain(loop))))
        assert_allclose(closed.worst_pole()[0], (1 - 3 * g) ** (1 / 3), rtol=1e-9)


@pytest.mark.promise("pointing-31")
@pytest.mark.parametrize("key", ["A", "B", "C", "D", "L"])
@pytest.mark.parametrize("bad", [nan, inf])
def test_a_controller_with_a_number_that_is_not_finite_is_refused_by_the_matrix(key, bad):
    loop, controller = VARIANTS["two coupled axes"]()
    if key == "L":
        spoiled = replace(controller, anti_windup=with_one(controller.anti_windup, bad))
    else:
        matrix = with_one(getattr(controller.system, key), bad)
        spoiled = replace(controller, system=replace(controller.system, **{key: matrix}))
    kernel_arrays.check_controller(loop, controller)
    with pytest.raises(ValueError, match=f"controller 'PI': matrix {key} holds a number that is not finite"):
        ensemble.simulate(loop, spoiled, Span(0.1, 0.0, 1), 1)


def with_one(matrix, value):
    changed = matrix.copy()
    changed[-1, -1] = value
    return changed


@pytest.mark.promise("pointing-31")
def test_a_controller_of_the_wrong_size_is_refused_by_the_matrix_and_the_size_that_would_do():
    loop, one = scenario(2), scenario(1)
    with pytest.raises(ValueError) as refused:
        traces.trace(loop, pi_for(one), Span(0.1, 0.0, 1))
    words = "controller 'PI': matrix B has the shape (1, 3), the loop needs (1, 6)"
    assert words + " (2 optical, 2 gauge and 2 reference inputs; 2 outputs)" in str(refused.value)
    s = pi_for(loop).system
    for key, wrong in (("C", s.C[:1]), ("D", s.D[:, :5])):
        shaped = replace(pi_for(loop), system=replace(s, **{key: wrong}))
        with pytest.raises(ValueError, match=rf"matrix {key} has the shape \({wrong.shape[0]}, {wrong.shape[1]}\)"):
            kernel_arrays.check_controller(loop, shaped)


@pytest.mark.parametrize(("key", "shape"), [("A", "(2, 3)"), ("L", "(1, 2)"), ("L", "(2, 1)"), ("L", "(2, 3)")])
def test_a_controller_whose_state_matrix_or_anti_windup_does_not_fit_is_refused(key, shape):
    loop = scenario(2)
    good = pi_for(loop)
    wrong = np.zeros(tuple(int(n) for n in shape[1:-1].split(", ")))
    given = {"anti_windup": wrong} if key == "L" else {"system": replace(good.system, A=wrong)}
    with pytest.raises(ValueError, match=rf"matrix {key} has the shape \({shape[1:-1]}\), the loop needs \(2, 2\)"):
        kernel_arrays.check_controller(loop, replace(good, **given))


def test_a_controller_that_reads_a_gauge_that_is_not_there_is_refused():
    loop, axis = an_axis("resonance damped by the gauge")
    with pytest.raises(
        ValueError, match="'resonant damping' reads a strain gauge, and this loop has none: give it one"
    ):
        fine.assemble(axis.name, replace(loop, gauge=None), axis)
    assert fine.assemble(axis.name, loop, axis).system.order == 3


def test_a_run_without_anything_behind_its_settling_time_is_refused():
    loop, controller = VARIANTS["one axis"]()
    message = "a run of 0.5 s has nothing left behind a settling time of 0.5 s: make the run longer"
    with pytest.raises(ValueError, match=message):
        ensemble.simulate(loop, controller, Span(0.5, 0.5, 1), 1)
    with pytest.raises(ValueError, match="make the run longer"):
        traces.trace(loop, controller, Span(0.1, -0.1, 1))


@pytest.mark.parametrize("runs", [0, -3])
def test_an_ensemble_without_a_run_is_refused(runs):
    loop, controller = VARIANTS["one axis"]()
    with pytest.raises(ValueError, match=f"an ensemble of {runs} runs has no statistics: ask for 1 run or more"):
        ensemble.simulate(loop, controller, Span(0.1, 0.0, 1), runs)


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_a_run_of_a_few_samples_has_finite_statistics(samples):
    loop, controller = VARIANTS["one axis"]()
    found = ensemble.simulate(loop, controller, Span(0.1 + samples * 2e-4, 0.1, 1), 2)
    assert found.samples == found.histogram.sum(axis=1)[0] == samples
    assert np.all(np.isfinite(found.psd_rad2_hz))
    assert found.psd_rad2_hz.shape[0] == found.freq_hz.size


def test_two_disturbances_of_one_name_on_an_axis_are_refused():
    loop, controller = VARIANTS["one axis"]()
    twice = replace(loop, disturbances=((disturbance.olympus(), disturbance.olympus()),))
    with pytest.raises(ValueError, match="share a name: OLYMPUS, OLYMPUS; give each its own"):
        ensemble.simulate(twice, controller, Span(0.1, 0.0, 1), 1)
    with pytest.raises(ValueError, match="share a name"):
        traces.trace(twice, controller, Span(0.1, 0.0, 1))


def test_two_disturbances_whose_names_come_to_the_same_random_numbers_are_refused():
    loop, controller = VARIANTS["one axis"]()
    one, other = (replace(disturbance.olympus(), name=name) for name in ("drive x", "gyro x"))
    assert kernel_arrays.purpose_of(one.name, 0) == kernel_arrays.purpose_of(other.name, 0)
    message = "'drive x' and 'gyro x' of one axis would take the same random numbers.*change one of the names"
    with pytest.raises(ValueError, match=message):
        ensemble.simulate(replace(loop, disturbances=((one, other),)), controller, Span(0.1, 0.0, 1), 1)
    two = replace(scenario(2), disturbances=((one,), (other,)))  # an axis has its own
    assert np.unique(kernel_arrays.combined_shaping(two).purpose).size == 2


def test_a_disturbance_out_of_modal_form_is_refused():
    dense = Disturbance(
        "dense",
        np.array([[-1.0, 0.0, 0.0], [0.5, -2.0, 0.0], [0.0, 0.5, -3.0]]),
        np.array([[1.0], [0.0], [0.0]]),
        np.array([[0.0, 0.0, URAD]]),
        (),
        "test",
        "test",
    )
    loop, controller = VARIANTS["one axis"]()
    with pytest.raises(ValueError, match="states do not come in pairs: give its filter in modal form"):
        ensemble.simulate(replace(loop, disturbances=((dense,),)), controller, Span(0.1, 0.0, 1), 1)


def test_a_response_by_frequency_of_a_slow_sensor_is_refused():
    closed = linear.close(*VARIANTS["sensor every third sample"]())
    for response in (linear.sensitivity, linear.loop_response):
        with pytest.raises(ValueError, match="delivers every 3 control samples, and a response by frequency needs one"):
            response(closed, np.array([10.0]))


# ------------------------------------------------------------------------------------------------ 8. statistics


def noisy(axes=2):
    """The paper's mirror with its hysteresis, everything that the ensemble counts, and every kind of disturbance."""
    lines = disturbance.wheels(40.0, (1.0, 2.5), (1e-9, 4e-10), convention="per-axis")
    body = disturbance.body_pointing(300 * URAD, 3, 0.5)
    loop = PointingLoop(
        mirror=mirror.combine(*[paper_mirror()] * axes) if axes > 1 else paper_mirror(),
        optics=np.eye(axes),
        drive=Drive(-6.0, 6.0, 1e3, 1e6 / 15, 0.3e-3, 0.0),
        timing=Timing(2e-4, 2, 2),
        disturbances=((disturbance.olympus(), lines, body),) * axes,
        optical=OpticalSensor(URAD, 2e-3, 0.01 * URAD, 1, 0),
        gauge=StrainGauge(0.1 * URAD, 0.0),
        references=(Reference(71 * URAD, 2.55 * URAD, 0.1),) * axes,
        drive_range_v=(-3.0, 3.0),
    )
    return loop, pi_for(loop)


FIELDS = ("rms_rad", "mean_rad", "largest_rad", "histogram", "counts", "psd_rad2_hz")


@pytest.mark.promise("readme-12", "readme-19")
@pytest.mark.promise("sampled-loop-16")
@pytest.mark.promise("pointing-10", "pointing-97", "sampled-loop-16")
def test_results_are_those_of_the_run_whatever_the_threads_and_the_number_of_runs():
    loop, controller = noisy()
    span, told = Span(0.2, 0.05, 7), []
    many = ensemble.simulate(loop, controller, span, 150, threads=1, on_progress=lambda *a: told.append(a))
    assert told == [(64, 150, "PI"), (128, 150, "PI"), (150, 150, "PI")]
    assert many.rms_rad.shape == (150, 2)
    assert (many.samples, many.steps) == (750, 1500)
    for runs, threads in ((150, 2), (70, 2), (3, 1)):
        other = ensemble.simulate(loop, controller, span, runs, threads=threads)
        for field in FIELDS:
            mine, theirs = getattr(many, field), getattr(other, field)
            assert_array_equal(mine if field == "psd_rad2_hz" else mine[:runs], theirs)
    assert np.unique(many.rms_rad).size == many.rms_rad.size


def test_cases_that_share_what_they_draw_are_the_runs_that_each_would_be_alone():
    """Other controllers, mirrors, noises and references share; another disturbance or clock does not, among them."""
    loop, controller = noisy()
    straight, slow = fine.without_hysteresis(loop), pi_for(loop, 30.0)
    silent = replace(loop, optical=replace(loop.optical, noise_rad=0.0), gauge=None)
    moved = replace(loop, references=(Reference(-50 * URAD, 0.0, 0.1),) * 2)
    calm = replace(loop, disturbances=tuple(several[:1] for several in loop.disturbances))
    quick = replace(loop, timing=Timing(2e-4, 4, 4))
    loops = (loop, straight, silent, moved, calm, quick)
    cases = [ensemble.Case(each, with_it) for each in loops for with_it in (controller, slow)]
    cases[3] = replace(cases[3], spectrum=False)
    span = Span(0.2, 0.05, 7)
    for case, found in zip(cases, ensemble.simulate_cases(cases, span, 70), strict=True):
        alone = ensemble.simulate(case.loop, case.controller, span, 70)
        for field in FIELDS:
            if field == "psd_rad2_hz" and not case.spectrum:
                assert np.all(np.isnan(found.psd_rad2_hz)) and not np.any(np.isnan(alone.psd_rad2_hz))
            else:
                assert_array_equal(getattr(found, field), getattr(alone, field))


@pytest.mark.promise("readme-19")
@pytest.mark.promise("pointing-10")
def test_another_seed_gives_other_numbers_and_the_same_seed_the_same():
    loop, controller = noisy()
    first, again, other, high = (
        ensemble.simulate(loop, controller, Span(0.1, 0.0, seed), 64).rms_rad for seed in (1, 1, 2, 1 + (1 << 32))
    )
    assert_array_equal(first, again)
    for another in (other, high):
        assert np.all(first != another)
        assert abs(np.corrcoef(first[:, 0], another[:, 0])[0, 1]) < 0.45  # 64 pairs


@pytest.mark.promise("pointing-98")
@pytest.mark.parametrize("run", [0, 5, 66])
def test_a_trace_is_the_run_of_its_number(run):
    """One plant step a sample: rms, mean and largest are those of the samples behind the settling time."""
    loop, controller = noisy()
    loop = replace(loop, timing=Timing(2e-4, 1, 1))
    found = ensemble.simulate(loop, controller, Span(0.4, 0.1, 3), 70)
    traced = traces.trace(loop, controller, Span(0.4002, 0.1, 3), run)
    errors = traced.error_rad[501:2001]
    radial = np.hypot(*errors.T)
    assert_allclose(found.rms_rad[run], np.sqrt(np.mean(errors**2, axis=0)), rtol=1e-12)
    assert_allclose(found.mean_rad[run], np.mean(errors, axis=0), rtol=1e-9, atol=1e-12 * URAD)
    assert_allclose(found.largest_rad[run], np.max(radial), rtol=1e-12)
    assert_array_equal(found.histogram[run], np.histogram(radial, ensemble.bin_edges_rad())[0])
    assert found.seconds == 1500 * 2e-4


@pytest.mark.promise("pointing-98")
def test_the_mean_is_that_of_the_control_samples_and_the_rms_that_of_all_plant_steps():
    loop, controller = noisy(1)
    found = ensemble.simulate(loop, controller, Span(0.2, 0.1, 1), 1)
    errors = traces.trace(loop, controller, Span(0.2002, 0.1, 1)).error_rad[501:]
    assert_allclose(found.mean_rad[0], np.mean(errors, axis=0), rtol=1e-9)
    assert_allclose(found.rms_rad[0], np.sqrt(np.mean(errors**2, axis=0)), rtol=0.01)
    assert not np.allclose(found.rms_rad[0], np.sqrt(np.mean(errors**2, axis=0)), rtol=1e-9, atol=0)


@pytest.mark.promise("pointing-8")
@pytest.mark.parametrize("axes", [1, 2])
def test_what_no_controller_knows_is_a_reference_to_one_that_looks_at_none(axes):
    """To the last bit; and one that feeds its reference forward takes only what it knows."""
    course = tuple(Misalignment(offset, rate) for offset, rate in ((20 * URAD, 30 * URAD), (-5 * URAD, 0.0)))[:axes]
    loop = replace(scenario(axes, optical=OpticalSensor(URAD, inf, 0.0, 1, 10)), references=(STILL,) * axes)
    period, span = loop.timing.period_s, Span(0.3, 0.1, 4)
    as_reference = tuple(SampledReference(each.at(period * np.arange(4000)), period) for each in course)
    known, unknown = replace(loop, references=as_reference), replace(loop, unknown=course)
    of = pi_for(loop)
    seen, unseen = (traces.trace(each, of, span) for each in (known, unknown))
    assert_array_equal(seen.error_rad, unseen.error_rad)
    assert_array_equal(seen.drive_v, unseen.drive_v)
    assert_allclose(unseen.disturbance_rad, seen.disturbance_rad + seen.reference_rad, rtol=0, atol=1e-18)
    assert not unseen.reference_rad.any()
    assert np.array_equal(*(ensemble.simulate(each, of, span, 2).histogram for each in (known, unknown)))
    s = of.system
    forward = replace(of, system=replace(s, D=s.D + np.pad(np.eye(axes), ((0, 0), (2 * axes, 0)))))
    seen, unseen = (traces.trace(each, forward, span) for each in (known, unknown))
    assert np.ptp(seen.drive_v - unseen.drive_v) > 0.0
    assert_array_equal(unseen.error_rad, traces.trace(unknown, of, span).error_rad)


def test_a_controller_with_an_integrator_takes_an_offset_off_and_lags_behind_a_drift():
    """By its rate over 2 pi times the frequency of the integral: the final value."""
    loop = quiet(scenario(of=static_mirror(), unknown=(Misalignment(20 * URAD, 500 * URAD),)))
    error = traces.trace(loop, pi_for(loop, integral_hz=200.0), Span(0.4, 0.1, 1)).error_rad[:, 0]
    assert error[0] == pytest.approx(20 * URAD)
    assert error[-1] == pytest.approx(500 * URAD / (2 * pi * 200.0), rel=1e-3, abs=0.0)


def test_runs_side_by_side_have_references_of_their_own():
    """Each is the run of its number with those references, to the last bit; also where the controller sees them."""
    loop, _ = VARIANTS["two coupled axes"]()
    axis = pi_axis(fine.nominal_axis_gain(loop), loop.timing.period_s, 200.0, 1500.0)
    path = fine.ReferenceFilter(300.0)
    controller = fine.with_inverse("ahead", loop, axis, control.inverse(loop.mirror), path, in_series=False)
    each = [
        (Reference(k * 3 * URAD, k * URAD, 1.0 + k), Reference(-k * URAD, 0.0, 1.0)) for k in range(kernels.LANES + 2)
    ]
    span = Span(0.02, 0.0, 5)
    errors, turned = traces.side_by_side(loop, controller, span, each, first_run=7)
    for k in (0, 1, kernels.LANES - 1, kernels.LANES, kernels.LANES + 1):
        alone = traces.trace(replace(loop, references=each[k]), controller, span, 7 + k)
        assert_array_equal(errors[k], alone.error_rad)
        assert_array_equal(turned[k], alone.mirror_rad)
    assert not np.allclose(errors[0], errors[1], rtol=0.0, atol=URAD)


@pytest.mark.promise("pointing-8")
def test_a_trace_adds_up():
    """Reference and disturbance less the mirror is the error; the sensor reads it with its noise, one sample late."""
    loop, controller = VARIANTS["two coupled axes"]()
    loop = replace(loop, optical=OpticalSensor(URAD, inf, 0.0, 1, 10), references=(Reference(7 * URAD, 0, 1), STILL))
    traced = traces.trace(loop, controller, Span(1.0, 0.0, 1), 3)
    assert_allclose(traced.time_s, np.arange(5000) * 2e-4, rtol=1e-12)
    assert_allclose(traced.reference_rad, np.tile([7 * URAD, 0.0], (5000, 1)), rtol=1e-12)
    line_of_sight = traced.mirror_rad @ loop.optics.T
    least = 2.0 ** (1 - lti.EXACT_BITS) * np.max(np.abs(traced.error_rad))  # to that the kernel's optics are rounded
    assert_allclose(traced.error_rad, traced.reference_rad + traced.disturbance_rad - line_of_sight, rtol=0, atol=least)
    noise = (traced.measured_rad[1:] - traced.error_rad[:-1]) / URAD
    assert_allclose(np.std(noise, axis=0), 1.0, rtol=0.04)  # 5000 numbers: 4 standard deviations
    assert abs(np.corrcoef(noise.T)[0, 1]) < 0.06
    assert abs(np.corrcoef(noise[1:, 0], noise[:-1, 0])[0, 1]) < 0.06


@pytest.mark.promise("pointing-10", "sampled-loop-16")
def test_disturbances_of_the_two_axes_and_of_two_runs_are_independent():
    loop, controller = noisy()
    loop = replace(loop, disturbances=((disturbance.first_order(1e-12, 200.0, convention="per-axis"),),) * 2)
    one, other = (traces.trace(loop, controller, Span(2.0, 0.0, 1), run).disturbance_rad for run in (0, 1))
    for a, b in ((one[:, 0], one[:, 1]), (one[:, 0], other[:, 0])):
        assert abs(np.corrcoef(a, b)[0, 1]) < 0.1  # 10 000 samples of 0.8 ms correlation: 4 standard deviations
    assert_array_equal(one, traces.trace(loop, controller, Span(2.0, 0.0, 1), 0).disturbance_rad)


def test_a_disturbance_of_many_inputs_shares_no_random_numbers_with_the_next_axis():
    several = [disturbance.first_order(1e-12, 3.0 * 1.3**i, convention="per-axis", name=f"{i}") for i in range(20)]
    broad = replace(disturbance.combine(*several), name="broad")
    loop = scenario(2, disturbances=((broad,), (broad,)))
    purposes = kernel_arrays.combined_shaping(loop).purpose
    assert np.unique(purposes).size == purposes.size


@pytest.mark.promise("pointing-9")
def test_a_disturbance_line_starts_at_another_phase_in_each_run_and_axis():
    line = disturbance.wheels(250.0, (1.0,), (URAD / 250.0**2,), convention="per-axis")
    loop = quiet(scenario(2))
    loop = replace(loop, disturbances=((line,), (line,)))
    runs = [traces.trace(loop, pi_for(loop), Span(0.004, 0.0, 1), run).disturbance_rad for run in range(40)]
    turned = np.mean(np.array(runs) * np.exp(-0.1j * pi * np.arange(20))[:, None], axis=1)  # 250 Hz: one turn
    assert_allclose(np.abs(turned), 0.5 * URAD, rtol=1e-9)
    phases = np.angle(turned).ravel() / (2 * pi) + 0.5
    assert kstest(phases, "uniform").pvalue > 0.01
    assert np.min(np.diff(np.sort(phases))) > 1e-6


def test_a_late_sensor_reads_the_error_at_the_begin_until_it_has_others():
    loop = replace(scenario(optical=OpticalSensor(0.0, inf, 0.0, 1, 23)), references=(Reference(7 * URAD, 0, 1),))
    traced = traces.trace(loop, pi_for(loop, 60.0), Span(0.01, 0.0, 1))
    assert_array_equal(traced.measured_rad[:3], np.broadcast_to(traced.error_rad[0], (3, 1)))
    assert abs(traced.error_rad[0, 0] - 7 * URAD) > URAD  # OLYMPUS is in it
    assert traced.measured_rad[4, 0] != traced.error_rad[0, 0]


def test_without_hysteresis_each_element_keeps_its_own_slow_gain():
    """Bouc-Wen elements and plays in one mirror, in either order."""
    plays = mirror.assemble("plays", "static", None, PrandtlIshlinskii((0.0, 1.0), (30e-6, 12e-6)))
    for both in (mirror.combine(paper_mirror(), plays), mirror.combine(plays, paper_mirror())):
        straightened = fine.without_hysteresis(scenario(2, static_mirror(), mirror=both)).mirror
        assert not straightened.plays
        for key in "ABCD":
            assert_allclose(getattr(straightened.linear_loop, key), getattr(both.linear_loop, key), rtol=1e-12)
        assert_allclose(fine.in_band_gain(straightened), fine.in_band_gain(both), rtol=1e-12)


@pytest.mark.promise("pointing-10", "sampled-loop-16")
def test_leaving_a_disturbance_out_changes_nothing_of_the_others():
    """In a linear loop the traces of its parts add up to that of the whole, to rounding."""
    lines = disturbance.wheels(40.0, (1.0, 2.5), (1e-9, 4e-10), convention="per-axis")
    body = disturbance.body_pointing(300 * URAD, 3, 0.5)
    shaking = (disturbance.olympus(), lines, body)
    loop = scenario(2, disturbances=(shaking, shaking[::-1]), references=(Reference(71 * URAD, 0, 1), STILL))
    controller = pi_for(loop)

    def traced(loop):
        found = traces.trace(loop, controller, Span(0.3, 0.0, 11), 2)
        return np.hstack([found.error_rad, found.disturbance_rad, found.drive_v])

    silent = quiet(replace(loop, references=(STILL, STILL)))
    parts = [traced(replace(silent, disturbances=((each,), (each,)))) for each in shaking]
    parts.append(traced(replace(silent, optical=loop.optical)))
    parts.append(traced(replace(silent, references=loop.references)))
    whole = traced(loop)
    assert_allclose(sum(parts), whole, rtol=0, atol=1e-9 * np.max(np.abs(whole)))
    for part in parts[:3]:
        assert np.max(np.abs(part[:, 2:4])) > URAD


@pytest.mark.promise("pointing-13")
def test_what_is_simulated_is_made_of_numbers_of_32_bits():
    loop, controller = noisy()
    p = kernel_arrays.arrays(loop, controller, 1)
    found = {name: getattr(p, name) for name in ("By", "E", "H", "Cy", "Dy", "Ky", "coupling", "optics")}
    assert lti.EXACT_BITS == 32
    for name, values in found.items():
        mantissa = np.frexp(np.asarray(values, dtype=float))[0] * 2.0**32
        assert_array_equal(mantissa, np.rint(mantissa), err_msg=name)
    assert sum(np.count_nonzero(values) for values in found.values()) > 10


@pytest.mark.promise("pointing-98")
def test_quantiles_from_the_histogram_are_those_of_the_trace_within_1_percent():
    loop, controller = noisy()
    found = ensemble.simulate(loop, controller, Span(4.1, 0.1, 3), 1)
    traced = traces.trace(loop, controller, Span(4.1002, 0.1, 3), 0)
    radial = np.hypot(*traced.error_rad[501:].T)
    assert radial.size == found.samples == found.histogram.sum()
    for share in (0.01, 0.1, 0.5, 0.9, 0.99, 0.997):
        assert_allclose(found.quantile_rad(share), np.quantile(radial, share), rtol=0.01)
    assert found.quantile_rad(0.997) < found.largest_rad[0]
    # Two compilations of one stable loop: without fused multiply-add they differ by a few roundings of 2e-16.
    assert found.largest_rad[0] >= np.max(radial) * (1.0 - 1e-13)


@pytest.mark.promise("pointing-98")
def test_the_quantile_of_a_uniform_square_is_its_share():
    """Radial errors whose squares are uniform: the quantile is the largest times sqrt(share)."""
    largest = 13 * URAD
    errors = largest * np.sqrt((np.arange(200_000) + 0.5) / 200_000)
    edges = ensemble.bin_edges_rad()
    assert np.max(edges[2:-1] / edges[1:-2]) < 1.031
    counts = np.histogram(errors, edges)[0]
    for share in (0.01, 0.25, 0.5, 0.9, 0.98):
        assert_allclose(ensemble.histogram_quantile(counts, share), largest * sqrt(share), rtol=1e-4)
    assert np.isnan(ensemble.histogram_quantile(np.zeros_like(counts), 0.5))


def test_the_ends_of_a_histogram_have_quantiles_too():
    counts = np.zeros(kernels.BINS, dtype=np.int64)
    counts[[300, 301]] = 5
    low, high = ensemble.bin_edges_rad()[[300, 302]]
    assert_allclose([ensemble.histogram_quantile(counts, 0.0), ensemble.histogram_quantile(counts, 1.0)], [low, high])


def test_one_run_has_an_infinite_interval_and_two_have_a_finite_one():
    loop, controller = VARIANTS["one axis"]()
    one, two = (ensemble.simulate(loop, controller, Span(0.1, 0.05, 1), runs) for runs in (1, 2))
    assert one.radial_rms_interval_rad() == inf
    assert 0.0 < two.radial_rms_interval_rad() < inf


def test_the_interval_of_the_rms_is_the_spread_of_other_ensembles():
    """99 % intervals of 20 seeds cover the Lyapunov value as they should, and are as wide as the seeds differ."""
    loop, controller = VARIANTS["two and a half samples of delay"]()
    theory = linear.stationary(linear.close(loop, controller)).radial_rms_rad
    found = [ensemble.simulate(loop, controller, Span(0.15, 0.1, seed), 64) for seed in range(20)]
    away = np.array([each.radial_rms_rad - theory for each in found])
    half = np.array([each.radial_rms_interval_rad(1.0) for each in found])
    assert 0.7 < np.std(away) / np.mean(half) < 1.4
    assert np.sum(np.abs(away) < SIGMAS_99 * half) >= 18
    assert_allclose(found[0].radial_rms_interval_rad(), SIGMAS_99 * half[0], rtol=1e-12)


# ------------------------------------------------------------------------------------------------ 10. saturation


@dataclass(frozen=True)
class Excursion:
    """A reference that steps far out for a while and back to zero."""

    size_rad: float
    begin_s: float
    end_s: float

    def at(self, time_s):
        time = np.asarray(time_s)
        return np.where((time >= self.begin_s) & (time < self.end_s), self.size_rad, 0.0)


OUT_S, BACK_S = 0.1, 0.4


def excursion(size, **changes):
    """The paper's mirror without noise, its reference out to a share of the stroke and back; trace and statistics."""
    loop, _ = noisy(1)
    drive = Drive(-6.0, 6.0, 1e3, 2e4, 0.0, 0.0)
    given = {"drive": drive, "optical": OpticalSensor(0.0, inf, 0.0, 1, 0), "gauge": None, "disturbances": ((),)}
    loop = replace(loop, **{**given, **changes})
    loop = replace(loop, references=(Excursion(size * 6.0 * fine.nominal_axis_gain(loop), OUT_S, BACK_S),))
    return loop, pi_for(loop)


@pytest.mark.parametrize("samples", [2, 64, 128])
def test_a_spectrum_holds_the_power_of_its_window(samples):
    """Parseval, with the constant and the fastest line once and all others twice."""
    residual = np.random.default_rng(samples).standard_normal((samples, 2, 3))
    residual[:, 0, :] += 3.0 * (-1.0) ** np.arange(samples)[:, None]
    found = ensemble._periodogram(residual, 2e-4)
    window = np.hanning(samples + 1)[:-1]
    power = np.mean(np.sum((residual * window[:, None, None]) ** 2, axis=0), axis=1) / np.sum(window**2)
    assert_allclose(found.sum(axis=0) / (samples * 2e-4), power, rtol=1e-12)


def test_the_interval_of_the_rms_is_that_of_the_scatter_of_its_square():
    """Two runs with squares of 1 and 9: their mean is known to 4, the root of it to 4 / (2 sqrt 5)."""
    loop, controller = excursion(1.0)
    found = ensemble.simulate(loop, controller, Span(0.01, 0.0, 1), 2)
    rms = np.zeros_like(found.rms_rad)
    rms[:, 0] = 1.0, 3.0
    assert replace(found, rms_rad=rms).radial_rms_interval_rad(1.0) == pytest.approx(2.0 / np.sqrt(5.0), rel=1e-12)
    assert replace(found, rms_rad=rms[:1]).radial_rms_interval_rad() == inf


@pytest.mark.promise("readme-18")
@pytest.mark.promise("sampled-loop-15")
@pytest.mark.promise("pointing-98", "sampled-loop-15")
def test_each_counter_is_a_share_of_what_it_counts():
    """Saturation and the inverse's rate by control sample, lost spots by reading, the rest by plant step."""
    loop, controller = excursion(1.0)
    found = ensemble.simulate(loop, controller, Span(0.01, 0.0, 1), 2)
    found = replace(found, counts=np.full_like(found.counts, 60.0), samples=100, steps=500, readings=20)
    of = {kernels.COUNT_SATURATED: 100, kernels.COUNT_INVERSE_CLAMPED: 100, kernels.COUNT_LOST: 20}
    steps = (kernels.COUNT_SLEW, kernels.COUNT_CLAMPED, kernels.COUNT_OUTSIDE)
    for counter, times in (of | dict.fromkeys(steps, 500)).items():
        assert found.share(counter) == 60 / times, counter


@pytest.mark.promise("pointing-9", "sampled-loop-15")
@pytest.mark.parametrize("size", [3.0, -30.0])
def test_beyond_its_stroke_the_loop_counts_stays_bounded_and_recovers(size):
    """20 ms behind an excursion beyond the stroke the error is that of one that stays within; windup would not end."""
    loop, controller = excursion(size)
    span = Span(0.6, 0.0, 1)
    found, traced = ensemble.simulate(loop, controller, span, 1), traces.trace(loop, controller, span)
    out = slice(600, 2000)
    assert_allclose(traced.drive_v[out], 6.0 * np.sign(size), rtol=1e-9)
    assert np.max(np.abs(traced.drive_v)) <= 6.0
    assert_allclose(found.counts[0, kernels.COUNT_SATURATED], 1500, atol=5)
    assert_allclose(found.share(kernels.COUNT_SATURATED), 0.5, atol=0.01)
    assert_allclose(found.share(kernels.COUNT_OUTSIDE), 0.5, atol=0.01)  # beyond 3 V either way
    assert found.counts[0, kernels.COUNT_SLEW] > 0
    assert np.max(np.abs(traced.drive_v[1:] - traced.drive_v[:-1])) <= 2e4 * 2e-4 * (1 + 1e-12)
    within = traces.trace(excursion(0.9 * np.sign(size))[0], controller, span)
    late = slice(2100, None)
    assert np.max(np.abs(traced.error_rad[late] - within.error_rad[late])) < 0.05 * URAD
    assert np.max(np.abs(traced.error_rad[late])) < 0.05 * URAD
    winding = replace(controller, anti_windup=np.zeros_like(controller.anti_windup))
    assert np.min(np.abs(traces.trace(loop, winding, span).error_rad[late])) > 400 * URAD


def test_within_its_stroke_nothing_is_counted():
    loop, controller = excursion(0.3, drive=Drive(-6.0, 6.0, 1e3, 1e6, 0.0, 0.0))
    found = ensemble.simulate(loop, controller, Span(0.6, 0.0, 1), 1)
    assert_array_equal(found.counts, 0.0)
    assert np.all(np.abs(traces.trace(loop, controller, Span(0.4, 0.0, 1)).error_rad[1600:]) < 0.05 * URAD)


def test_what_happens_while_the_loop_settles_is_not_counted():
    loop, controller = excursion(3.0)
    found = ensemble.simulate(loop, controller, Span(0.6, 0.45, 1), 1)
    assert_array_equal(found.counts, 0.0)
    assert found.largest_rad[0] < URAD
    assert found.histogram.sum() == found.samples == 750


@pytest.mark.parametrize(
    ("every", "settle", "samples", "readings"),
    [
        (1, 600, 900, 900),
        (3, 600, 900, 300),
        (3, 601, 899, 299),
        (3, 602, 899, 300),
        (3, 599, 900, 300),
        (3, 601, 2, 0),
    ],
)
def test_a_sensor_that_never_sees_its_spot_loses_each_of_its_readings(every, settle, samples, readings):
    """Readings fall on multiples of the sensor's period, wherever the settling ends."""
    loop = scenario(optical=OpticalSensor(URAD, 1e-12, 0.0, every, 0))
    found = ensemble.simulate(loop, pi_for(loop, 50.0), Span((settle + samples) * 2e-4, settle * 2e-4, 1), 2)
    assert found.readings == readings
    assert_array_equal(found.counts[:, kernels.COUNT_LOST], readings)
    assert found.share(kernels.COUNT_LOST) == (1.0 if readings else 0.0)


def test_an_axis_beyond_its_stroke_leaves_the_other_as_it_is():
    loop = scenario(2, drive=Drive(-6.0, 6.0, 1e3, 2e4, 0.0, 0.0))
    away = replace(loop, references=(Excursion(2e-3, 0.01, 0.05), STILL))
    controller = pi_for(loop)
    near, far = (traces.trace(each, controller, Span(0.1, 0.0, 1)) for each in (loop, away))
    assert np.max(np.abs(far.drive_v[:, 0])) > 5.999
    assert np.max(np.abs(near.drive_v[:, 0])) < 1.0
    for field in ("error_rad", "drive_v", "measured_rad"):
        assert_array_equal(getattr(near, field)[:, 1], getattr(far, field)[:, 1])


def test_a_lost_spot_is_counted_its_last_reading_held_and_the_loop_recovers():
    """The reading from before the excursion stays for its 0.3 s; the loop integrates that, and is back 20 ms after."""
    seen = 200 * URAD
    loop, controller = excursion(0.6, optical=OpticalSensor(0.0, seen, 0.0, 1, 0))
    traced = traces.trace(loop, controller, Span(0.6, 0.0, 1))
    found = ensemble.simulate(loop, controller, Span(0.6, 0.0, 1), 1)
    lost = np.abs(traced.error_rad[:, 0]) > seen
    assert found.counts[0, kernels.COUNT_LOST] == np.sum(lost) > 1400
    assert_array_equal(traced.measured_rad[lost], traced.measured_rad[np.flatnonzero(lost) - 1])
    assert_array_equal(traced.measured_rad[~lost], traced.error_rad[~lost])
    assert np.max(np.abs(traced.error_rad[2100:])) < 0.05 * URAD
    assert ensemble.simulate(*excursion(0.6), Span(0.6, 0.0, 1), 1).counts[0, kernels.COUNT_LOST] == 0


# --------------------------------------------------------------------------------------------------- compiled ahead


def test_the_kernels_are_compiled_aside_for_loops_of_any_kind_where_the_cache_lacks_them(monkeypatch):
    heard = []
    monkeypatch.setattr(ensemble, "in_background", lambda job: heard.append(job) or "wait")
    monkeypatch.setattr(kernels, "is_compiled", lambda loop: loop is kernels.ensemble_loop)
    assert ensemble.compile_in_background(coupled)() is None
    assert heard == []
    monkeypatch.setattr(kernels, "is_compiled", lambda loop: loop is not kernels.ensemble_loop)
    assert ensemble.compile_in_background(coupled) == "wait"
    heard[0]()
    compiled = list(kernels.ensemble_loop.signatures)
    ensemble.simulate(scenario(), pi_for(scenario()), Span(0.01, 0.0, 1), 1)
    assert kernels.ensemble_loop.signatures == compiled != []


# ----------------------------------------------------------------------------- parts of numbers unlike each other
def an_ensemble():
    """Three runs of two axes, every number another one."""
    counts = np.arange(1.0, 3.0 * kernels.COUNT_FIELDS + 1).reshape(3, -1)
    histogram = np.zeros((3, kernels.BINS), dtype=np.int32)
    histogram[0, 100:103], histogram[1, 102], histogram[2, 110] = (5, 0, 7), 11, 13
    rms, mean = np.array([[3.0, 4.0], [1.0, 2.0], [2.0, 6.0]]), np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]])
    freq, spectrum = np.array([0.0, 5.0]), np.array([[1.0, 2.0], [3.0, 4.0]])
    return ensemble.Ensemble(
        "PI", 0.7, rms, mean, np.array([9.0, 8.0, 7.0]), histogram, counts, freq, spectrum, 36, 360, 12
    )


def test_statistics_of_several_runs_and_axes_are_means_of_their_squares():
    found = an_ensemble()
    squares = np.array([25.0, 5.0, 40.0])
    assert_allclose(found.axis_rms_rad, [sqrt(14 / 3), sqrt(56 / 3)], rtol=1e-12)
    assert found.radial_rms_rad == pytest.approx(sqrt(70 / 3), rel=1e-12)
    spread = np.std(squares, ddof=1) / sqrt(3)
    assert found.radial_rms_interval_rad(2.0) == pytest.approx(2.0 * spread / 2 / sqrt(70 / 3), rel=1e-12)
    assert found.part(1, 1).radial_rms_interval_rad() == inf
    part = found.part(1, 2)
    assert_allclose([*part.rms_rad[0], *part.mean_rad[1], *part.largest_rad], [1.0, 2.0, 0.5, 0.6, 8.0, 7.0])
    assert (part.histogram.sum(), part.counts[0, 0], part.seconds) == (24, 1.0 + kernels.COUNT_FIELDS, 0.7)
    assert part.psd_rad2_hz is found.psd_rad2_hz


@pytest.mark.parametrize("limit", ensemble.COUNTERS)
def test_a_limit_is_met_as_often_as_it_could_have_been(limit):
    counter = ensemble.COUNTERS[limit]
    times = {"saturated samples": 36, "inverse beyond the identified rate": 36, "samples without the spot": 12}
    expected = (counter + 1.0 + kernels.COUNT_FIELDS) / times.get(limit, 360)
    assert an_ensemble().share(counter) == pytest.approx(expected, rel=1e-12)
    short = replace(an_ensemble(), readings=0).share(counter)
    assert short == pytest.approx(expected * 12 if limit == "samples without the spot" else expected, rel=1e-12)


@pytest.mark.parametrize(
    ("share", "bin_", "inside"),
    [(0, 100, 0), (2.5 / 36, 100, 0.5), (5 / 36, 100, 1), (14 / 36, 102, 0.5), (23 / 36, 102, 1), (1, 110, 1)],
)
def test_a_quantile_of_bins_with_gaps_is_linear_in_the_square_and_beyond_it_lies_the_rest(share, bin_, inside):
    low, high = ensemble.bin_edges_rad()[bin_ : bin_ + 2] ** 2
    found = an_ensemble().quantile_rad(share)
    assert found == pytest.approx(sqrt(low + inside * (high - low)), rel=1e-12)
    assert an_ensemble().beyond(found) == pytest.approx(1.0 - share, abs=1e-9)


def test_of_no_samples_there_is_no_quantile_and_below_all_bins_lies_nothing():
    none = replace(an_ensemble(), histogram=np.zeros((3, kernels.BINS), dtype=np.int32))
    assert np.isnan([none.quantile_rad(0.5), none.beyond(1e-6)]).all()
    assert (an_ensemble().beyond(-1.0), an_ensemble().beyond(0.0), an_ensemble().beyond(inf)) == (1.0, 1.0, 0.0)


@pytest.mark.parametrize("samples", [8, 9, 1])
def test_a_periodogram_of_two_axes_is_the_mean_over_the_runs_under_a_hann_window(samples):
    residual = np.random.default_rng(3).standard_normal((samples, 2, 5))
    window = np.sin(np.pi * np.arange(samples) / samples) ** 2
    found = ensemble._periodogram(residual, 0.02)
    expected = np.zeros((samples // 2 + 1, 2))
    for axis, run in np.ndindex(2, 5):
        turned = np.exp(-2j * np.pi * np.outer(np.arange(samples // 2 + 1), np.arange(samples)) / samples)
        expected[:, axis] += np.abs(turned @ (window * residual[:, axis, run])) ** 2 / 5
    expected *= 0.04 / max(np.sum(window**2), 1e-300)
    expected[[0, -1]] /= 2.0
    assert_allclose(found, expected, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("period_s", [1e-3, 0.05])
def test_a_reference_filter_has_its_target_at_the_end_of_the_sample_and_the_rate_as_its_slope(period_s):
    """From rest, of a unit step: 1 - (1 + w t) e^-wt and w^2 t e^-wt."""
    s, w = fine.ReferenceFilter(7.0).discrete(period_s), 2 * pi * 7.0
    x = np.zeros((2, 1))
    for k in range(1, 6):
        target, rate = (s.C @ x + s.D)[:, 0]
        x, t = s.A @ x + s.B, k * period_s
        assert (target, rate) == pytest.approx((1 - (1 + w * t) * exp(-w * t), w * w * t * exp(-w * t)), rel=1e-9)


def test_drives_of_more_actuators_than_axes_leave_what_is_held_and_are_the_least_beside_it():
    """Four actuators without a model to invert, two angles and a held sum: against a constrained least squares."""
    rng = np.random.default_rng(6)
    optics, gain, held = rng.standard_normal((2, 3)), rng.standard_normal((3, 4)) * 1e-5, rng.standard_normal((1, 3))
    plain = lti.StateSpace(-np.eye(3), gain, np.eye(3), np.zeros((3, 4)))
    made = replace(mirror.Mirror.of_system(plain, "m"), inverse=())
    drive, sensor = Drive(-1.0, 1.0, inf, inf, 0.0, 0.0), OpticalSensor(0.0, inf, 0.0, 1, 0)
    still = (disturbance.NO_REFERENCE,) * 2
    given = PointingLoop(made, optics, drive, Timing(1e-3, 2, 0), ((), ()), sensor, None, still, held=held)
    for loop, rows in ((given, np.vstack([optics @ gain, held @ gain])), (replace(given, held=None), optics @ gain)):
        drives = np.linalg.pinv(rows)[:, :2]
        assert_allclose(fine._drives_for_angles(loop), drives, rtol=1e-6)
        assert fine.nominal_axis_gain(loop) == pytest.approx(1.0 / np.max(np.abs(drives)), rel=1e-6)
        assert_allclose(optics @ gain @ fine.decoupling(loop), np.eye(2) * fine.nominal_axis_gain(loop), atol=1e-12)


# ------------------------------------------------------------------------------------------------ arrays by hand
def unlike(**changes):
    """Two actuators of unlike gains behind unlike optics, and no two numbers alike."""
    of = mirror.combine(resonant_mirror(400.0, 0.03, 2e-4), resonant_mirror(700.0, 0.05, 1e-4))
    found = PointingLoop(
        mirror=of, optics=np.array([[1.0, 0.25], [-0.5, 0.75]]), drive=Drive(-3.0, 5.0, 800.0, 250.0, 2e-3, 7e-9),
        timing=Timing(2e-4, 4, 6), disturbances=((disturbance.olympus(),), ()),
        optical=OpticalSensor(3e-6, 4e-4, 6e-8, 3, 9), gauge=StrainGauge(8e-8, 1.5e-8),
        references=(Reference(7e-6, 2e-6, 0.4, 1e-6, 30.0), Reference(-4e-6, 0.0, 1.0)), drive_range_v=(-2.5, 4.5),
        unknown=(Misalignment(11e-6, 0.0), Misalignment(0.0, -500e-6)),
    )  # fmt: skip
    return replace(found, **changes)


def idle(loop, outputs=2):
    """A controller of one state that does nothing much."""
    s = lti.StateSpace(np.array([[0.5]]), np.full((1, 6), 0.25), np.full((outputs, 1), 0.125), np.zeros((outputs, 6)))
    return LoopController("idle", s, np.full((1, 2), 0.75))


@pytest.mark.parametrize(
    ("seed", "words"), [(5, [5, 0]), (2**32 + 7, [7, 1]), (2**64 + 3 * 2**32 + 9, [9, 3]), (2**32 - 1, [2**32 - 1, 0])]
)
def test_a_loop_has_each_of_its_numbers_in_the_kernels_arrays_and_64_bits_of_its_seed(seed, words):
    loop = unlike()
    p = kernel_arrays.arrays(loop, idle(loop), seed)
    assert p.seed.tolist() == words
    follow = 1 - exp(-2 * pi * 800.0 * 5e-5)
    assert_allclose(p.actuator, [[-3.0, 5.0, 2e-3, follow, 250.0 * 5e-5, -2.5, 4.5]] * 2, rtol=1e-12)
    numbers = (p.step_s, p.steps_per_sample, p.delay_steps, p.sensor_delay_steps, p.sensor_every)
    assert numbers == (pytest.approx(5e-5), 4, 6, 9, 3)
    assert p.optical_noise.tolist() == [3e-6] * 2
    assert (p.optical_resolution, p.field_of_view, p.gauge_noise, p.gauge_resolution) == (6e-8, 4e-4, 8e-8, 1.5e-8)
    assert p.optics.tolist() == [[1.0, 0.25], [-0.5, 0.75]]
    assert (p.A.tolist(), p.B.tolist(), p.L.tolist()) == ([[0.5]], [[0.25] * 6], [[0.75] * 2])
    assert (bool(p.feedforward), p.C.tolist()) == (False, [[0.125]] * 2)
    without = kernel_arrays.arrays(replace(loop, gauge=None), idle(loop), seed)
    assert (without.gauge_noise, without.gauge_resolution) == (0.0, 0.0)


@pytest.mark.parametrize(("name", "axis"), [("", 0), ("OLYMPUS", 1), ("reaction wheel", 0)])
def test_streams_of_random_numbers_go_by_a_name_and_an_axis(name, axis):
    code = np.uint32(0xFFFFFFFF)  # the check sum of ISO 3309, bit by bit
    for byte in name.encode():
        code ^= np.uint32(byte)
        for _ in range(8):
            code = (code >> np.uint32(1)) ^ (np.uint32(0xEDB88320) if code & np.uint32(1) else np.uint32(0))
    short = int(~code) % 65_536
    assert kernel_arrays.purpose_of(name, axis) == 256 * (4 * short + axis)
    assert kernel_arrays.purpose_of(name, axis + 1) - kernel_arrays.purpose_of(name, axis) == 256


@pytest.mark.parametrize("runs", [0, 1, 3])
def test_references_stand_with_what_is_unknown_first_and_of_missing_runs_with_those_of_the_last(runs):
    loop, time = unlike(), 2e-4 * np.arange(5, 9)
    several = [(Reference(k * 1e-6, 0.0, 1.0), Reference(0.0, k * 1e-6, 2.0)) for k in range(1, runs + 1)]
    found = kernel_arrays.reference(loop, 5, 8, several)
    assert found.shape == (4, 4, kernels.LANES if runs else 1)
    for lane in range(found.shape[2]):
        own = several[min(lane, runs - 1)] if runs else loop.references
        known = np.column_stack([r.at(time) for r in own])
        added = np.column_stack([np.full(4, 11e-6), -500e-6 * time])
        assert_allclose(found[:, :, lane], np.hstack([known + added, known]), rtol=1e-12, atol=1e-20)
    assert_allclose(kernel_arrays.reference(replace(loop, unknown=()), 5, 8, several), found[:, 2:], rtol=1e-12)


def test_disturbances_stand_at_even_states_each_with_its_own_streams_on_its_axis():
    line = disturbance.wheels(90.0, (1.0, 2.0), (1e-9, 2e-9), convention="per-axis")
    b = disturbance.first_order(1e-12, 9.0, convention="radial", name="b")
    both = disturbance.combine(disturbance.olympus(), b)
    loop = unlike(disturbances=((disturbance.olympus(), line), (both,)))
    found = kernel_arrays.combined_shaping(loop)
    parts = [disturbance.discretise(each, 5e-5) for each in (disturbance.olympus(), line, both)]
    assert [at for at, _, _ in found.parts] == [0, 2, 6]
    assert (found.diagonal.size, found.noise.shape, found.output.shape) == (8, (8, 3), (2, 8))
    assert_allclose(found.output[0], [parts[0].C[0, 0], 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0], rtol=1e-12)
    assert_allclose(found.output[1], [0.0] * 6 + parts[2].C[0].tolist(), rtol=1e-12)
    first = [kernel_arrays.purpose_of(n, i) for n, i in (("OLYMPUS", 0), ("OLYMPUS + b", 1))]
    assert found.purpose.tolist() == [first[0], first[1], first[1] + 1]
    assert [p for _, _, p in found.parts] == [first[0], kernel_arrays.purpose_of("reaction wheel", 0), first[1]]
    turned = 2 * pi * 90.0 * np.array([1.0, 2.0]) * 5e-5
    assert_allclose(found.diagonal[2:6], np.repeat(np.cos(turned), 2), rtol=1e-15)
    assert_allclose(found.coupling[2:6], np.repeat(np.sin(turned), 2) * [1, -1, 1, -1], rtol=1e-15)
    assert_allclose(found.noise[6:, 1:], parts[2].Bd, rtol=1e-12)


@pytest.mark.parametrize(("inverse", "adaptation", "outputs"), [(None, None, 2), (True, None, 6), (True, True, 8)])
def test_a_controller_has_an_output_for_each_drive_and_what_its_inverse_takes(inverse, adaptation, outputs):
    loop = unlike()
    made = replace(idle(loop, outputs), inverse=inverse, adaptation=adaptation)
    kernel_arrays.check_controller(loop, made)
    with pytest.raises(ValueError) as refused:
        kernel_arrays.check_controller(loop, replace(idle(loop, 3), inverse=inverse, adaptation=adaptation))
    assert str(refused.value) == (
        f"controller 'idle': matrix C has the shape (3, 1), the loop needs ({outputs}, 1) (2 optical, 2 gauge and 2 "
        f"reference inputs; {outputs} outputs)"
    )


def test_phases_are_uniform_in_the_probability_of_their_normal_numbers():
    assert_allclose(kernel_arrays.uniform(np.array([-40.0, 0.0, 1.0, 40.0])), [0.0, pi, 2 * pi * 0.841344746, 2 * pi])


@pytest.mark.parametrize(
    ("duration_s", "settle_s", "samples", "segment"),
    [(0.01, 0.0, (50, 0), 32), (0.0129, 0.0002, (64, 1), 32), (0.01309, 0.00022, (65, 1), 64),
     (1.0, 0.1, (5000, 500), 2048), (0.0002, 0.0, (1, 0), 1), (0.00045, 0.00009, (2, 0), 2)],
)  # fmt: skip
def test_a_run_is_counted_in_whole_control_samples_and_its_spectrum_in_segments_of_a_power_of_two(
    duration_s, settle_s, samples, segment
):
    loop, span = unlike(), Span(duration_s, settle_s, 1)
    assert ensemble.control_samples(loop, span) == samples
    assert ensemble._segment(loop, span) == segment


def test_runs_of_a_later_batch_are_told_by_their_number_and_have_no_spectrum():
    loop, controller = with_pi(scenario())
    said, beats = [], []
    whole = ensemble.simulate(loop, controller, Span(0.02, 0.005, 3), 70)
    found = ensemble.simulate(
        loop, controller, Span(0.02, 0.005, 3), 5, first_run=64, threads=1,
        on_progress=lambda *each: said.append(each), beat=lambda: beats.append(1),
    )  # fmt: skip
    assert_array_equal(found.rms_rad, whole.rms_rad[64:69])
    assert_array_equal(found.histogram, whole.histogram[64:69])
    assert np.isnan(found.psd_rad2_hz).all()
    assert not np.isnan(whole.psd_rad2_hz).any()
    assert (said[-1], len(beats) > 1) == ((5, 5, controller.name), True)
    assert (found.name, found.samples, found.steps, found.readings) == (controller.name, 75, 750, 75)
    assert found.seconds == pytest.approx(0.015)


def test_a_replay_is_the_run_of_its_number_with_what_the_controller_read_and_made_of_it():
    loop, controller = VARIANTS["two coupled axes"]()
    loop = replace(loop, references=(Reference(7 * URAD, URAD, 1.0), STILL), unknown=(Misalignment(3 * URAD, 0.0),) * 2)
    found = traces.replay(loop, controller, 40, 9, 3)
    traced = traces.trace(loop, controller, Span(40 * loop.timing.period_s, 0.0, 9), 3)
    assert_array_equal(found.error_rad, traced.error_rad)
    assert_allclose(found.disturbance_rad, traced.disturbance_rad, rtol=1e-12, atol=1e-20)
    assert_allclose(found.inputs[:, :2], traced.measured_rad, rtol=1e-12)
    assert_allclose(found.inputs[:, -2:], traced.reference_rad, rtol=1e-12)
    assert_allclose(found.inputs[1:, 2:4] - traced.mirror_rad[1:], 0.0, atol=6 * loop.gauge.noise_rad)
    s, x = controller.system, np.zeros((controller.system.order, 1))
    for row, command in zip(found.inputs, found.commands, strict=True):
        assert_allclose(command, (s.C @ x)[:, 0] + s.D @ row, rtol=1e-6, atol=1e-9)
        x = s.A @ x + s.B @ row[:, None]
    assert (found.commands.shape, found.counts.shape) == ((40, 2), (kernels.COUNT_FIELDS,))


# ------------------------------------------------------------------------------------------------ plants by hand
def test_a_driven_plant_is_the_loop_without_noise_from_each_drive_to_error_reading_and_mirror():
    loop = replace(unlike(), optical=OpticalSensor(3e-6, inf, 0.0, 1, 0), unknown=(), timing=Timing(2e-4, 4, 4))
    s = driven_plant(loop)
    assert (s.B.shape[1], s.C.shape[0]) == (2, 6)
    Ad, B0, B1, through = held_linearly(loop.mirror, loop.timing.step_s)
    follow = 1 - exp(-2 * pi * 800.0 * loop.timing.step_s)
    for drive in range(2):
        x, u, state, y = np.zeros(len(Ad)), np.zeros(2), np.zeros(s.order), np.zeros(2)
        for k in range(12):
            found = s.C @ state + s.D[:, drive]
            assert_allclose(found, np.concatenate([-loop.optics @ y, -loop.optics @ y, loop.optics @ y]), atol=1e-12)
            state = s.A @ state + s.B[:, drive]
            due = np.eye(2)[drive] * (k >= 1)  # a sample of delay
            for _ in range(4):
                before, u = u, u + follow * (due - u)
                x = Ad @ x + B0 @ before + B1 @ u
                y = loop.mirror.C @ x + through @ u


@pytest.mark.parametrize(
    ("every", "steps", "late", "reads_late"), [(1, 9, 3, 3), (2, 10, 3, 8), (4, 5, 0, 8), (3, 1, 2, 3)]
)
def test_a_slow_sensor_counts_as_one_that_is_later_by_half_of_its_hold(every, steps, late, reads_late):
    loop = scenario(optical=OpticalSensor(URAD, 2e-3, 1e-9, every, late), timing=Timing(2e-4, steps, 1))
    assert read_each_sample(loop).optical == OpticalSensor(URAD, 2e-3, 1e-9, 1, reads_late)


@pytest.mark.parametrize("every", [1, 3])
def test_a_mirror_of_a_stack_answers_in_the_loop_as_in_its_design_plant(every):
    loop = scenario(1, resonant_mirror(400.0, 0.03), optical=OpticalSensor(URAD, inf, 0.0, every, 4),
                    timing=Timing(2e-4, 10, 7), optics=np.array([[1.7]]))  # fmt: skip
    others = [resonant_mirror(f, z, g).linear_loop for f, z, g in ((400.0, 0.03, 1e-4), (650.0, 0.1, 3e-4))]
    stack = lti.StateSpace(*(np.stack([getattr(s, key) for s in others]) for key in "ABCD"))
    found = sampled_mirrors(loop, stack)
    freq = np.array([3.0, 380.0, 900.0, 2400.0])
    for i, of in enumerate((resonant_mirror(400.0, 0.03), resonant_mirror(650.0, 0.1, 3e-4))):
        plant = design_plant(replace(loop, mirror=of)).from_command
        own = lti.StateSpace(found.A[i], found.B[i], found.C[i], found.D)
        expected = lti.frequency_response(plant, freq, 2e-4)[:, :, 0]
        answers = lti.frequency_response(own, freq, 2e-4)[:, :, 0]
        sign = np.sign(fine.nominal_axis_gain(loop))
        assert_allclose(answers[:, 0], sign * expected[:, 0], rtol=1e-6)
        assert_allclose(1.7 * answers[:, 1], expected[:, 1], rtol=1e-6)


def test_the_slope_of_a_response_at_rest_is_minus_its_delay_times_its_gain():
    """Two outputs: 3 of a delay of two samples, and a first-order lag of gain 5 with a time constant of 20 ms."""
    keep, period = exp(-1e-3 / 20e-3), 1e-3
    A = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, keep]])
    B, C = np.array([[1.0], [0.0], [1.0 - keep]]), np.array([[0.0, 3.0, 0.0], [0.0, 0.0, 5.0]])
    found = slow_slope_s(lti.StateSpace(A, B, C, np.array([[0.0], [9.0]])), period)
    assert_allclose(found[:, 0], [-3.0 * 2e-3, -5.0 * period / (1.0 - keep)], rtol=1e-9)


def test_a_filter_with_a_way_of_its_own_stands_in_the_path_of_the_command_alone():
    plant = design_plant(scenario(1, resonant_mirror(400.0, 0.03)))
    low_pass = lti.StateSpace(np.array([[0.7]]), np.array([[0.4]]), np.array([[0.6], [9.0]]), np.array([[0.2], [8.0]]))
    found = behind_filter(plant, low_pass)
    freq = np.array([1.0, 120.0, 400.0, 2400.0])
    z = np.exp(2j * pi * freq * plant.period_s)
    before, after = (lti.frequency_response(p.system, freq, p.period_s) for p in (plant, found))
    assert_allclose(after[:, :, 0], before[:, :, 0] * (0.2 + 0.24 / (z - 0.7))[:, None], rtol=1e-9)
    assert_allclose(after[:, :, 1:], before[:, :, 1:], rtol=1e-9, atol=1e-18)
    assert (found.disturbances, found.gain_rad_v, found.system.order) == (
        plant.disturbances, plant.gain_rad_v, plant.system.order + 1
    )  # fmt: skip


@pytest.mark.parametrize("lines", [(), ((3e-6, 40.0),), ((3e-6, 40.0), (5e-7, 333.0))])
def test_lines_beside_a_filter_become_bands_of_a_thousandth_behind_its_states(lines):
    own = disturbance.combine(disturbance.olympus(), disturbance.body_pointing(3e-6, 3.0, 5.0))
    shaken = replace(own, lines=tuple(disturbance.SpectralLine(*each) for each in lines))
    found = narrow_band(shaken)
    n, w = own.B.shape
    more = 2 * len(lines)
    assert (found.lines, found.A.shape, found.B.shape) == ((), (n + more,) * 2, (n + more, w + more))
    assert_array_equal(found.A[:n, :n], own.A)
    assert_array_equal(found.B[:n, :w], own.B)
    assert found.variance_rad2 == pytest.approx(shaken.variance_rad2, rel=1e-9)
    for i, (amplitude, freq) in enumerate(lines):
        here = slice(n + 2 * i, n + 2 * i + 2)
        assert_allclose(np.linalg.eigvals(found.A[here, here]), 2 * pi * freq * np.array([-1e-3 + 1j, -1e-3 - 1j]))
        alone = replace(found, A=found.A[here, here], B=found.B[here], C=found.C[:, here])
        assert alone.variance_rad2 == pytest.approx(0.5 * amplitude**2, rel=1e-9)


def test_loops_of_one_disturbance_but_another_clock_or_mirror_are_the_runs_that_each_would_be_alone():
    """Two and four steps of the same length a sample, four shorter ones, and a third output behind the same axes."""
    base = scenario(2, static_mirror(), drive=Drive(-inf, inf, inf, inf, 0.0, 0.0))
    three = mirror.combine(*[static_mirror()] * 3)
    loops = [replace(base, timing=Timing(*each)) for each in ((2e-4, 4, 0), (1e-4, 2, 0), (1e-4, 4, 0))]
    loops.append(replace(loops[0], mirror=three, optics=np.array([[1.0, 0.0, 0.5], [0.0, 1.0, -0.5]])))
    assert all(loop.disturbances is base.disturbances for loop in loops)
    cases, span, told = [ensemble.Case(loop, pi_for(loop, 100.0)) for loop in loops], Span(0.02, 0.005, 7), []
    together = ensemble.simulate_cases(cases, span, 3, lambda *each: told.append(each))
    assert told[-1] == (4, 4)
    for case, found in zip(cases, together, strict=True):
        alone = ensemble.simulate(case.loop, case.controller, span, 3)
        for field in FIELDS:
            assert_array_equal(getattr(found, field), getattr(alone, field))
    assert [each.steps for each in together] == [300, 300, 600, 300]
    with pytest.raises(ValueError, match="an ensemble of 0 runs has no statistics: ask for 1 run or more"):
        ensemble.simulate_cases(cases, span, 0)


def test_a_pole_on_the_unit_circle_itself_is_unstable():
    """An integrator that nothing reads or drives."""
    loop = fast(2e-4)
    still = lti.StateSpace(np.eye(1), np.zeros((1, 2)), np.zeros((1, 1)), np.zeros((1, 2)))
    closed = close_axis(loop, AxisController("held", still, np.zeros((1, 1))))
    assert closed.worst_pole() == (1.0, 0.0)
    with pytest.raises(ValueError, match=r"the loop under 'held' is unstable: a pole at \|z\| = 1\.000000 \(the limit"):
        linear.stationary(closed)


def three_behind_two():
    """Three actuators, each with an output of its own, turn the line of sight about two axes."""
    each = [static_mirror(1e-4), static_mirror(2e-4), static_mirror(3e-4)]
    optics = np.array([[1.0, 0.25, 0.5], [-0.5, 0.75, 2.0]])
    loop = scenario(
        2, static_mirror(), mirror=mirror.combine(*each), optics=optics, timing=Timing(2e-4, 3, 4),
        references=(Reference(7 * URAD, URAD, 1.0), Reference(-3 * URAD, 0.0, 2.0)),
        unknown=(Misalignment(3 * URAD, 0.0), Misalignment(-2 * URAD, 0.0)),
    )  # fmt: skip
    return loop, pi_for(loop, 60.0)


def test_records_of_a_run_keep_axes_actuators_and_outputs_apart_where_their_numbers_differ():
    loop, controller = three_behind_two()
    span = Span(0.02, 0.0, 9)
    found, again = traces.trace(loop, controller, span, 3), traces.replay(loop, controller, 100, 9, 3)
    shapes = [getattr(found, name).shape for name in ("error_rad", "measured_rad", "drive_v", "mirror_rad")]
    assert shapes == [(100, 2), (100, 2), (100, 3), (100, 3)]
    gains = np.array([1e-4, 2e-4, 3e-4])
    assert_allclose(found.mirror_rad, gains * found.drive_v, rtol=1e-6, atol=1e-12)
    line_of_sight = found.mirror_rad @ loop.optics.T
    assert_allclose(found.error_rad, found.reference_rad + found.disturbance_rad - line_of_sight, rtol=0, atol=1e-11)
    assert_allclose(found.reference_rad[0], [7 * URAD, -3 * URAD], rtol=1e-12)
    assert_array_equal(again.error_rad, found.error_rad)
    assert (again.inputs.shape, again.commands.shape) == ((100, 2 + 3 + 2), (100, 3))
    assert_allclose(again.inputs[:, :2], found.measured_rad, rtol=1e-12)
    assert_allclose(again.inputs[:, 5:], found.reference_rad, rtol=1e-12)
    own = [(Reference(k * URAD, 0.0, 1.0), Reference(0.0, k * URAD, 1.0)) for k in (5, 2)]
    errors, turned = traces.side_by_side(loop, controller, span, own, first_run=4)
    assert (errors.shape, turned.shape) == ((2, 100, 2), (2, 100, 3))
    for k, references in enumerate(own):
        alone = traces.trace(replace(loop, references=references), controller, span, 4 + k)
        assert_array_equal(errors[k], alone.error_rad)
        assert_array_equal(turned[k], alone.mirror_rad)


def test_a_trace_of_four_outputs_three_actuators_and_two_axes_adds_up():
    """Two gains of the mirror behind unlike optics; the sensor reads the error of the sample before, without noise."""
    of = mirror.combine(*(resonant_mirror(f, 0.05, g) for f, g in ((400.0, 1e-4), (600.0, 2e-4), (900.0, 3e-4))))
    over = np.vstack([np.eye(3), [[0.5, -0.25, 0.75]]])
    of = replace(of, C=over @ of.C, D=over @ of.D, K=over @ of.K)
    optics = np.array([[1.0, 0.5, 0.25, 0.0], [0.0, 0.5, -0.75, 1.0]])
    loop = replace(
        coupled(), mirror=of, optics=optics, optical=OpticalSensor(0.0, inf, 0.0, 1, 10), gauge=None,
        references=(Reference(7 * URAD, 2 * URAD, 3.0), Reference(-3 * URAD, 0, 1.0)),
    )  # fmt: skip
    s = lti.StateSpace(np.eye(2), 20.0 * np.eye(2, 8), np.eye(3, 2), np.zeros((3, 8)))
    made = LoopController("own", s, np.zeros((2, 3)))
    found = traces.trace(loop, made, Span(0.1, 0.0, 1), 2)
    shapes = {key: getattr(found, f"{key}_rad").shape[1] for key in ("reference", "disturbance", "error", "measured")}
    assert (set(shapes.values()), found.drive_v.shape[1], found.mirror_rad.shape[1]) == ({2}, 3, 4)
    least = 2.0 ** (1 - lti.EXACT_BITS) * np.max(np.abs(found.mirror_rad))
    seen = found.mirror_rad @ optics.T
    assert_allclose(found.error_rad, found.reference_rad + found.disturbance_rad - seen, rtol=0, atol=4 * least)
    assert_allclose(found.mirror_rad[:, 3], found.mirror_rad[:, :3] @ [0.5, -0.25, 0.75], rtol=0, atol=4 * least)
    assert_allclose(found.measured_rad[1:], found.error_rad[:-1], rtol=0, atol=1e-15)
    assert not found.drive_v[:, 2].any() and np.ptp(found.drive_v[:, :2], axis=0).min() > 1e-3
    assert_allclose(np.ptp(found.reference_rad[:, 1]), 0.0, atol=1e-18)
    errors, turned = traces.side_by_side(loop, made, Span(0.1, 0.0, 1), [loop.references], 2)
    assert_array_equal(errors[0], found.error_rad)
    assert_array_equal(turned[0], found.mirror_rad)


@pytest.mark.parametrize(
    ("span", "words"),
    [
        ((0.123456789, 0.3456789), "a run of 0.123457 s has nothing left behind a settling time of 0.345679 s: make "
         "the "
         "run longer"),
        ((0.1, -1.5e-4), "a run of 0.1 s has nothing left behind a settling time of -0.00015 s: make the run longer"),
        ((0.1, -0.9e-4), None), ((1.1e-4, 0.9e-4), None),
        ((0.9e-4, 0.0), "a run of 9e-05 s has nothing left behind a settling time of 0 s: make the run longer"),
        ((-0.5, 0.0), "a run of -0.5 s has nothing left behind a settling time of 0 s: make the run longer"),
        ((inf, 0.25), "a run of inf s that settles for 0.25 s: give finite seconds"),
        ((0.123456789, nan), "a run of 0.123457 s that settles for nan s: give finite seconds"),
    ],
)  # fmt: skip
def test_a_run_settles_for_none_of_its_samples_or_for_some_but_not_for_all(span, words):
    """At 5 kHz, in whole samples."""
    loop, _ = VARIANTS["one axis"]()
    if words is None:
        total, settle = ensemble.control_samples(loop, Span(*span, 1))
        assert (total, settle) == (round(span[0] / 2e-4), 0)
        return
    with pytest.raises(ValueError) as refused:
        ensemble.control_samples(loop, Span(*span, 1))
    assert str(refused.value) == words


@pytest.mark.parametrize(
    "A",
    [[[-1.0, 0.0, 0.0], [0.5, -2.0, 0.0], [0.0, 0.5, -3.0]], [[-1.0, 0.0, 0.5], [0.0, -2.0, 0.0], [0.0, 0.0, -3.0]]],
)
def test_states_that_are_no_pairs_are_refused_behind_a_line_and_of_a_second_disturbance(A):
    dense = Disturbance(
        "dense", np.array(A), np.ones((3, 1)), np.array([[0.0, 0.0, URAD]]),
        (disturbance.SpectralLine(URAD, 30.0),), "test", "test",
    )  # fmt: skip
    with pytest.raises(ValueError) as refused:
        kernel_arrays.combined_shaping(scenario(1, disturbances=((disturbance.olympus(), dense),)))
    assert str(refused.value) == "a disturbance's states do not come in pairs: give its filter in modal form"


def test_batches_are_told_as_runs_up_to_their_number():
    told = []
    ensemble.simulate(
        *VARIANTS["one axis"](), Span(2e-3, 0.0, 1), 130, threads=1, on_progress=lambda *each: told.append(each)
    )
    name = told[0][2]
    assert [each for each in told if each[0]] == [(64, 130, name), (128, 130, name), (130, 130, name)]


def test_a_slow_state_keeps_its_time_constant_beside_a_line_that_is_turned_exactly():
    """A corner at 1 uHz, of which a step of 50 us takes 3e-10, behind a line of 0.7 Hz and a faster pair."""
    slow = disturbance.first_order(1e-12, 1e-6, convention="per-axis", name="slow")
    line = disturbance.wheels(0.7, (1.0,), (1e-9,), convention="per-axis")
    pair = Disturbance("pair", np.array([[-3.0, 40.0], [-40.0, -3.0]]), np.ones((2, 1)), np.ones((1, 2)), (), "", "")
    found = kernel_arrays.combined_shaping(unlike(disturbances=((slow,), (line, disturbance.combine(pair, slow)))))
    lost, turn = 1.0 - found.diagonal, 2 * pi * 0.7 * 5e-5
    for at in (0, 6):
        assert lost[at] == pytest.approx(2 * pi * 1e-6 * 5e-5, rel=1e-3)
    assert_array_equal(found.diagonal[2:4], [np.cos(turn)] * 2)
    assert_array_equal(found.coupling[2:4], [np.sin(turn), -np.sin(turn)])
    assert_allclose(found.diagonal[4:6], exp(-3.0 * 5e-5) * np.cos(2e-3), rtol=1e-9)
    assert_allclose(found.coupling[4:6], exp(-3.0 * 5e-5) * np.sin(2e-3) * np.array([1.0, -1.0]), rtol=1e-8)
    assert_array_equal(found.coupling[4:6], lti.to_bits(found.coupling[4:6], lti.EXACT_BITS))
    assert not found.coupling[[0, 1, 6, 7]].any()


@pytest.mark.parametrize(("cached", "told"), [(True, 0), (False, 1)])
def test_it_is_told_that_kernels_are_compiled_where_they_are(monkeypatch, cached, told):
    heard = []
    monkeypatch.setattr(kernels, "is_compiled", lambda loop: cached)
    monkeypatch.setattr(ensemble, "in_background", lambda job: lambda: None)
    monkeypatch.setattr(ensemble.compiling, "begins", lambda: heard.append("begins"))
    ensemble.compile_in_background(coupled)
    assert len(heard) == told


def test_looking_at_a_loop_by_frequency_leaves_it_as_it_is():
    closed = linear.close(*with_pi(scenario(2)))
    freq, kept = np.array([3.0, 40.0, 900.0]), [each.copy() for each in closed.samples]
    first = linear.loop_response(closed, freq)
    spectrum = linear.residual_spectrum(closed, freq)
    assert_array_equal(linear.loop_response(closed, freq), first)
    assert_array_equal(linear.residual_spectrum(closed, freq), spectrum)
    assert_allclose(linear.sensitivity(closed, freq) @ (np.eye(2) + first), np.tile(np.eye(2), (3, 1, 1)), atol=1e-12)
    for each, before in zip(closed.samples, kept, strict=True):
        assert_array_equal(each, before)
