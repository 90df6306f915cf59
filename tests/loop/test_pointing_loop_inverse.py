"""The inverse of hysteresis in the fine-pointing loop: ahead of it and in series, inside its range and beyond it."""

from dataclasses import dataclass, replace
from math import inf, pi

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.signal import StateSpace, lsim

from microrad.core import kernels, lti
from microrad.loop import control, disturbance
from microrad.loop.control import AxisController, Drive, Inverse, Timing
from microrad.loop.disturbance import Reference
from microrad.loop.pointing_loop import ensemble, linear, traces
from microrad.loop.pointing_loop import loop as fine
from microrad.loop.pointing_loop.ensemble import Span
from microrad.loop.pointing_loop.loop import PointingLoop, ReferenceFilter, with_inverse
from microrad.loop.sensor import OpticalSensor
from microrad.mirror import model as mirror
from microrad.mirror.geometry import Geometry, line_of_sight_matrix
from microrad.mirror.hysteresis import NO_CREEP, BoucWen, Creep, PrandtlIshlinskii, slow_gain

URAD = 1e-6
RATE_LIMIT_V_S = 3770.0
STILL = Reference(0.0, 0.0, 1.0)
FILTER = ReferenceFilter(1000.0)

BOUC_WEN = BoucWen(89e-6, -2.96e-7, -22e-6, 4.7e-4, 2.4, 0.6, RATE_LIMIT_V_S, 6.0)  # never moves the wrong way
PRINTED = replace(BOUC_WEN, epsilon_rad_v=-48e-6, alpha_1_v=38.421, beta_1_v=34.635)
PLAYS = PrandtlIshlinskii((0.0, 0.1, 0.4, 1.0, 2.0), (50e-6, 12e-6, 12e-6, 8e-6, 7e-6))
WIDENING = replace(PLAYS, widening_s=1e-4, rate_limit_v_s=RATE_LIMIT_V_S)
CREEP = Creep((4e-6, 4e-6), (0.01, 0.1))
MODELS = {
    "Bouc-Wen": (BOUC_WEN, NO_CREEP),
    "Bouc-Wen as printed": (PRINTED, NO_CREEP),
    "generalised Bouc-Wen": (replace(BOUC_WEN, gamma_1_v=0.4, eta_1_v=-0.3), NO_CREEP),
    "Bouc-Wen of exponent 2": (replace(BOUC_WEN, exponent=2.0), NO_CREEP),
    "Bouc-Wen with creep": (BOUC_WEN, CREEP),
    "Prandtl-Ishlinskii": (PLAYS, NO_CREEP),
    "Prandtl-Ishlinskii with creep": (PLAYS, CREEP),
    "widening Prandtl-Ishlinskii": (WIDENING, NO_CREEP),
    "widening Prandtl-Ishlinskii with creep": (WIDENING, CREEP),
}
models = pytest.mark.parametrize("model", [m for m in MODELS if "exponent" not in m])  # which takes seconds


# ------------------------------------------------------------------------------------------------ loops


@dataclass(frozen=True)
class Sweep:
    """A smooth reference from rest with inner loops: two sines in the ratio of 2.7 that grow for 50 ms."""

    amplitude_rad: float = 200 * URAD
    freq_hz: float = 15.0

    def at(self, time_s):
        t = np.asarray(time_s)
        wave = 0.5 * (1 - np.cos(2 * pi * self.freq_hz * t)) + 0.3 * np.sin(5.4 * pi * self.freq_hz * t)
        return self.amplitude_rad * wave * np.minimum(1.0, (t / 0.05) ** 2)


@dataclass(frozen=True)
class Step:
    """A reference out to an angle at a time and back to zero at another."""

    size_rad: float
    begin_s: float = 0.01
    end_s: float = inf

    def at(self, time_s):
        time = np.asarray(time_s)
        return np.where((time >= self.begin_s) & (time < self.end_s), self.size_rad, 0.0)


def static(model):
    return mirror.assemble(model, "static", None, *MODELS[model])


def loop_of(model, **changes):
    """A static mirror behind an amplifier of 20 kHz, control at 50 kHz without delay, nothing random."""
    loop = PointingLoop(
        mirror=static(model),
        optics=np.eye(1),
        drive=Drive(-inf, inf, 20e3, inf, 0.0, 0.0),
        timing=Timing(20e-6, 1, 0),
        disturbances=((),),
        optical=OpticalSensor(0.0, inf, 0.0, 1, 0),
        gauge=None,
        references=(Sweep(),),
    )
    return replace(loop, **changes)


def axis_of(order, A, B, C, D):
    """A controller of one axis that reads its error alone."""
    none = np.zeros((order, 1))
    return AxisController(
        "feedback", lti.StateSpace(A, np.hstack([B, none]), C, np.hstack([D, [[0.0]]])), B / D if order else B
    )


NO_FEEDBACK = axis_of(0, np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.zeros((1, 1)))


def pi_axis(loop, integral_hz=100.0, zero_hz=1500.0):
    ki = 2 * pi * integral_hz / fine.nominal_axis_gain(loop)
    s = control.pid(control.Gains(ki / (2 * pi * zero_hz), ki, 0.0, 0.0), loop.timing.period_s)
    return axis_of(1, s.A, s.B, s.C, s.D)


def gain_alone(loop):
    """What the inverse is held against: the reciprocal of the slow gain."""
    return Inverse(tuple(1.0 / slow_gain(model) for model in loop.mirror.inverse))


def ahead(loop, inverse, axis=NO_FEEDBACK):
    return with_inverse("ahead", loop, axis, inverse, FILTER, in_series=False)


def filtered(reference, time_s):
    """The reference and its rate behind w^2 / (s + w)^2, held from sample to sample, by SciPy: (samples, 2)."""
    w = 2 * pi * FILTER.bandwidth_hz
    system = StateSpace([[0.0, 1.0], [-w * w, -2 * w]], [[0.0], [w * w]], np.eye(2), np.zeros((2, 1)))
    return lsim(system, reference.at(time_s), time_s, interp=False)[1]


# ------------------------------------------------------------------------------------------------ reference filter


@pytest.mark.promise("hysteresis-17", "pointing-22")
def test_the_filter_gives_the_target_and_its_rate_at_the_end_of_each_sample():
    """The rate is the target's derivative: differences of it agree to (w T)^2 / 12, which holding the input brings."""
    period = 5e-6
    path, reference, time = FILTER.discrete(period), Sweep(), np.arange(20_001) * period
    x, found = np.zeros(2), []
    for r in reference.at(time[:-1]):
        found.append(path.C @ x + path.D[:, 0] * r)
        x = path.A @ x + path.B[:, 0] * r
    target, rate = np.array(found).T
    wanted = filtered(reference, time)[1:].T
    assert_allclose(target, wanted[0], rtol=0, atol=1e-9 * np.max(target))
    assert_allclose(rate, wanted[1], rtol=0, atol=1e-9 * np.max(rate))
    differences = (target[2:] - target[:-2]) / (2 * period)
    assert_allclose(differences, rate[1:-1], rtol=0, atol=1e-4 * np.max(rate))
    late = (target[1:] - target[:-1]) / period  # a difference of the last two samples is half a sample late
    assert np.max(np.abs(late - rate[1:])) > 5e-4 * np.max(rate)


def test_the_filter_is_critically_damped_and_has_unit_gain():
    """Half power at (sqrt 2 - 1)^(1/2) of its bandwidth, a quarter there; a step never overshoots."""
    period = 1e-6
    path = FILTER.discrete(period)
    freq = FILTER.bandwidth_hz * np.array([1e-4, np.sqrt(np.sqrt(2) - 1), 1.0])
    response = lti.frequency_response(path, freq, period)
    assert_allclose(np.abs(response[:, 0, 0]) ** 2, [1.0, 0.5, 0.25], rtol=1e-4)
    assert_allclose(response[:, 1, 0], 2j * pi * freq * response[:, 0, 0], rtol=0.01)
    x, target = np.zeros(2), []
    for _ in range(3000):
        x = path.A @ x + path.B[:, 0]
        target.append(x[0])
    assert np.all(np.diff(target) >= 0.0)
    assert_allclose(target[-1], 1.0, rtol=1e-6)


@pytest.mark.promise("pointing-22")
@pytest.mark.parametrize("layout", ["two-axis", "tripod"])
def test_the_controller_drives_each_inverse_with_its_mirrors_angle_and_its_rate(layout):
    """Two coupled axes: targets are the filtered references turned back through the optics; rates their derivatives."""
    optics, period = optics_of(layout), 5e-6
    mirrors = optics.shape[1]
    bent = mirror.combine(*[static("Prandtl-Ishlinskii")] * mirrors)
    loop = loop_of("Prandtl-Ishlinskii", mirror=bent, optics=optics, timing=Timing(period, 1, 0))
    loop = replace(loop, disturbances=((), ()), references=(STILL, STILL))
    s = ahead(loop, control.inverse(bent)).system
    references, time = (Sweep(), Sweep(90 * URAD, 22.0)), np.arange(8001) * period
    x, found = np.zeros(s.order), []
    for now in np.stack([r.at(time[:-1]) for r in references], axis=1):
        measured = np.concatenate([np.zeros(2 + mirrors), now])
        found.append(s.C @ x + s.D @ measured)
        x = s.A @ x + s.B @ measured
    volts, target, rate = np.split(np.array(found), 3, axis=1)
    smooth = np.stack([filtered(r, time)[1:] for r in references], axis=2)
    wanted = smooth @ np.linalg.pinv(optics).T
    assert_allclose(target, wanted[:, 0], rtol=0, atol=1e-9 * np.max(np.abs(wanted[:, 0])))
    assert_allclose(rate, wanted[:, 1], rtol=0, atol=1e-9 * np.max(np.abs(wanted[:, 1])))
    slopes = (target[2:] - target[:-2]) / (2 * period)
    assert_allclose(slopes, rate[1:-1], rtol=0, atol=2e-4 * np.max(np.abs(rate)))
    assert_array_equal(volts, 0.0)


def optics_of(layout):
    radius = 0.01 if layout == "tripod" else None
    coupling = ((1.0, 0.1), (-0.2, 0.9))
    return line_of_sight_matrix(
        Geometry("mechanical", rotation_rad=0.5, coupling=coupling, layout=layout, actuator_radius_m=radius)
    )


# ------------------------------------------------------------------------------------------------ ahead of the mirror

FACTORS = {  # rms, peak of the error with the slow gain alone over those with the inverse
    "Bouc-Wen": (5.0, 4.0),
    "Bouc-Wen as printed": (3.0, 1.3),  # its peaks are at reversals, where it moves the wrong way
    "generalised Bouc-Wen": (5.0, 3.8),
    "Bouc-Wen of exponent 2": (5.0, 3.0),
    "Bouc-Wen with creep": (7.0, 7.0),
    "Prandtl-Ishlinskii": (500.0, 400.0),
    "Prandtl-Ishlinskii with creep": (500.0, 500.0),
    "widening Prandtl-Ishlinskii": (80.0, 60.0),
    "widening Prandtl-Ishlinskii with creep": (80.0, 60.0),
}


SPAN = Span(0.2, 0.0, 1)


def following_error(loop, controller):
    """Mirror less the filtered reference (rad) behind the first 50 ms, and the trace."""
    traced = traces.trace(loop, controller, SPAN)
    wanted = filtered(loop.references[0], traced.time_s)[:, 0]
    return (traced.mirror_rad[:, 0] - wanted)[traced.time_s > 0.05], traced


@pytest.mark.promise("pointing-22")
@pytest.mark.parametrize(
    "model", [pytest.param(m, marks=pytest.mark.endurance if "exponent" in m else []) for m in MODELS]
)
def test_without_feedback_the_mirror_follows_the_filtered_reference_with_the_inverse(model):
    """At least these factors nearer than with the slow gain; plays to below 0.1 % of the stroke, Bouc-Wen to 1.5 %."""
    loop = loop_of(model)
    exact = ahead(loop, control.inverse(loop.mirror))
    with_it, _ = following_error(loop, exact)
    with_gain, traced = following_error(loop, ahead(loop, gain_alone(loop)))
    rms, peak = FACTORS[model]
    assert np.std(with_gain) > 5 * URAD
    assert np.sqrt(np.mean(with_gain**2) / np.mean(with_it**2)) > rms
    assert np.max(np.abs(with_gain)) / np.max(np.abs(with_it)) > peak
    stroke = np.ptp(traced.mirror_rad)
    assert np.sqrt(np.mean(with_it**2)) < (0.001 if "Prandtl" in model else 0.015) * stroke
    assert_array_equal(ensemble.simulate(loop, exact, SPAN, 1).counts[0, kernels.COUNT_INVERSE_CLAMPED], 0.0)


@pytest.mark.parametrize("model", [m for m in MODELS if "creep" in m])
def test_creep_is_taken_off_and_left_in_it_shows(model):
    loop = loop_of(model)
    inverse = control.inverse(loop.mirror)
    forgotten = replace(inverse, creep=())
    with_it, without = (following_error(loop, ahead(loop, each))[0] for each in (inverse, forgotten))
    assert np.sqrt(np.mean(without**2)) > 4 * np.sqrt(np.mean(with_it**2))


@pytest.mark.parametrize("layout", ["two-axis", "tripod"])
def test_coupled_axes_follow_their_filtered_references_without_feedback(layout):
    optics = optics_of(layout)
    bent = mirror.combine(*[static("Prandtl-Ishlinskii")] * optics.shape[1])
    references = (Sweep(), Sweep(90 * URAD, 22.0))
    loop = loop_of("Prandtl-Ishlinskii", mirror=bent, optics=optics, disturbances=((), ()), references=references)
    traced = traces.trace(loop, ahead(loop, control.inverse(bent)), Span(0.2, 0.0, 1))
    wanted = np.stack([filtered(r, traced.time_s)[:, 0] for r in references], axis=1)
    away = traced.mirror_rad @ optics.T - wanted
    assert np.max(np.abs(away)) < 0.1 * URAD
    assert np.min(np.max(np.abs(wanted), axis=0)) > 80 * URAD


# ------------------------------------------------------------------------------------------------ noise


@pytest.mark.promise("pointing-22")
@models
def test_sensor_noise_does_not_reach_an_inverse_that_the_reference_drives(model):
    """Without feedback the drive is the same to the last bit, whatever the sensor reads."""
    quiet, loud = loop_of(model), loop_of(model, optical=OpticalSensor(10 * URAD, inf, 0.0, 1, 0))
    controller = ahead(quiet, control.inverse(quiet.mirror))
    one, other = (traces.trace(each, controller, Span(0.1, 0.0, 1)) for each in (quiet, loud))
    assert_array_equal(one.drive_v, other.drive_v)
    assert np.std(other.measured_rad - one.measured_rad) > 9 * URAD


@models
def test_with_feedback_and_noise_the_drive_chatters_no_more_than_under_feedback_alone(model):
    """Drive from sample to sample: rms of its second difference, and no sample of the inverse beyond the range."""
    loop = loop_of(model, optical=OpticalSensor(URAD, inf, 0.0, 1, 0), references=(STILL,))
    alone = fine.assemble("PI", loop, pi_axis(loop))
    both = ahead(loop, control.inverse(loop.mirror), pi_axis(loop))
    swept = replace(loop, references=(Sweep(),))
    span = Span(0.2, 0.0, 1)
    still, driven = traces.trace(loop, alone, span), traces.trace(swept, both, span)
    chatter, base = (np.std(np.diff(each.drive_v[:, 0], 2)) for each in (driven, still))
    assert 0.9 < chatter / base < 1.1
    assert ensemble.simulate(swept, both, span, 1).counts[0, kernels.COUNT_INVERSE_CLAMPED] == 0
    series = with_inverse("series", swept, pi_axis(loop), control.inverse(loop.mirror), FILTER, in_series=True)
    assert not np.array_equal(traces.trace(swept, series, span).drive_v, driven.drive_v)


# ------------------------------------------------------------------------------------------------ outside the range


RATE_DEPENDENT = (
    "Bouc-Wen as printed",
    "generalised Bouc-Wen",
    "Bouc-Wen with creep",
    *(m for m in MODELS if "wid" in m),
)


@pytest.mark.promise("mirror-file-12")
@pytest.mark.promise("hysteresis-17")
@pytest.mark.promise("hysteresis-17", "pointing-23")
@pytest.mark.parametrize("model", RATE_DEPENDENT)
@pytest.mark.parametrize("freq_hz", [400.0, 3000.0])
def test_a_reference_faster_than_the_identified_rate_is_counted_and_the_drive_stays_bounded(model, freq_hz):
    """One count for each sample whose filtered rate over the slow gain is beyond the limit, and no other."""
    reference = Sweep(300 * URAD, freq_hz)
    loop = loop_of(model, references=(reference,))
    controller, span = ahead(loop, control.inverse(loop.mirror)), Span(0.1, 0.0, 1)
    traced = traces.trace(loop, controller, span)
    gain = slow_gain(loop.mirror.inverse[0])
    rate = filtered(reference, np.append(traced.time_s, 0.1))[1:, 1] / gain
    beyond = np.sum(np.abs(rate) > RATE_LIMIT_V_S)
    found = ensemble.simulate(loop, controller, span, 1)
    assert 50 < beyond < found.samples
    assert found.counts[0, kernels.COUNT_INVERSE_CLAMPED] == beyond
    assert_allclose(found.share(kernels.COUNT_INVERSE_CLAMPED), beyond / traced.time_s.size, rtol=1e-12)
    assert np.max(np.abs(traced.drive_v)) < 1.5 * np.max(np.abs(traced.reference_rad)) / gain
    assert np.max(np.abs(traced.mirror_rad)) < 1.5 * np.max(np.abs(traced.reference_rad))


def test_without_a_rate_limit_the_same_drive_leaves_all_bounds():
    """What the clamp is for: exp(delta rate) of a rate that nothing was identified at."""
    free = replace(BOUC_WEN, rate_limit_v_s=inf)
    loop = loop_of("Bouc-Wen", references=(Step(3e-3),))
    inverse = control.inverse(loop.mirror)
    largest = [
        np.max(np.abs(traces.trace(loop, ahead(loop, each), Span(0.02, 0.0, 1)).drive_v))
        for each in (inverse, replace(inverse, bouc_wen=(free,)))
    ]
    assert largest[0] < 1.1 * 3e-3 / 89e-6
    assert largest[1] > 10 * largest[0]


@models
def test_a_step_of_the_reference_is_bounded_and_ends_where_it_should(model):
    """The filter makes a ramp of it, beyond the identified rate where that is limited; it settles in 100 ms."""
    loop = loop_of(model, references=(Step(1e-3),))
    controller = ahead(loop, control.inverse(loop.mirror))
    traced = traces.trace(loop, controller, Span(0.11, 0.0, 1))
    assert np.max(np.abs(traced.drive_v)) < 1.2e-3 / slow_gain(loop.mirror.inverse[0])
    assert_allclose(traced.mirror_rad[-1], 1e-3, rtol=0.05)
    counted = ensemble.simulate(loop, controller, Span(0.11, 0.0, 1), 1).counts[0, kernels.COUNT_INVERSE_CLAMPED]
    assert (counted > 0) == (not model.startswith("Prandtl"))


@pytest.mark.promise("pointing-23")
def test_a_drive_beyond_the_identified_range_is_counted_at_each_plant_step():
    loop = loop_of("Prandtl-Ishlinskii", drive_range_v=(-0.5, 2.0))
    controller, span = ahead(loop, control.inverse(loop.mirror)), Span(0.2, 0.0, 1)
    drive = traces.trace(loop, controller, span).drive_v
    found = ensemble.simulate(loop, controller, span, 1)
    share = np.mean((drive < -0.5) | (drive > 2.0))
    assert 0.1 < share < 0.9
    assert_allclose(found.share(kernels.COUNT_OUTSIDE), share, atol=2e-3)
    wide = replace(loop, drive_range_v=(-20.0, 20.0))
    assert ensemble.simulate(wide, controller, span, 1).counts[0, kernels.COUNT_OUTSIDE] == 0


# ------------------------------------------------------------------------------------------------ in series

LINES_HZ = (10.0, 30.0, 70.0, 150.0, 310.0, 600.0, 1000.0, 1600.0, 2200.0)
PATH = ReferenceFilter(2000.0)


def sampled(model, **changes):
    """5 kHz, one sample of delay, an amplifier of 5 kHz."""
    given = {"timing": Timing(2e-4, 10, 10), "drive": Drive(-inf, inf, 5e3, inf, 0.0, 0.0), "references": (STILL,)}
    return loop_of(model, **{**given, **changes})


def in_series(loop, inverse):
    return with_inverse("series", loop, pi_axis(loop), inverse, PATH, in_series=True)


def measured_sensitivity(loop, controller, amplitude_rad):
    """Error over disturbance at `LINES_HZ`: lines of a wheel that stands, all of one amplitude; the reference rests."""
    lines = disturbance.wheels(1.0, LINES_HZ, (amplitude_rad,) * len(LINES_HZ), convention="per-axis")
    traced = traces.trace(replace(loop, disturbances=((lines,),)), controller, Span(0.6, 0.0, 1))
    last = slice(-1000, None)  # two periods of the slowest line
    at = np.rint(np.array(LINES_HZ) * 0.2).astype(int)
    error, shaken = (np.fft.rfft(a[last, 0])[at] for a in (traced.error_rad, traced.disturbance_rad))
    return error / shaken


SERIES = [  # model, amplitude of each line, |S| with the inverse within, and at least so far off without it
    ("Prandtl-Ishlinskii", 1 * URAD, 0.001, 0.6),
    ("Prandtl-Ishlinskii", 20 * URAD, 0.001, 0.25),
    ("widening Prandtl-Ishlinskii", 1 * URAD, 0.001, 0.6),
    ("widening Prandtl-Ishlinskii", 20 * URAD, 0.02, 0.25),
    ("Prandtl-Ishlinskii with creep", 20 * URAD, 0.04, 0.25),
    ("Bouc-Wen", 1 * URAD, 0.1, 0.25),
]


@pytest.mark.promise("pointing-22")
@pytest.mark.parametrize(("model", "amplitude_rad", "within", "without"), SERIES)
def test_an_inverse_in_series_gives_the_loop_gain_of_the_straight_mirror(model, amplitude_rad, within, without):
    loop = sampled(model)
    straight = in_series(loop, control.inverse(loop.mirror))
    theory = np.abs(linear.sensitivity(linear.close(loop, straight), np.array(LINES_HZ))[:, 0, 0])
    with_it = np.abs(measured_sensitivity(loop, straight, amplitude_rad)) / theory - 1
    bent = np.abs(measured_sensitivity(loop, in_series(loop, gain_alone(loop)), amplitude_rad)) / theory - 1
    assert np.max(np.abs(with_it)) < within
    assert np.max(np.abs(bent)) > without
    assert theory[0] < 0.2
    assert np.max(theory) > 1.1


def test_a_series_inverse_of_a_mirror_without_hysteresis_leaves_the_lyapunov_value():
    """Filter, delay and gain of the inverse as the linear loop takes them: an ensemble with OLYMPUS and noise."""
    shaken = {"disturbances": ((disturbance.olympus(),),), "optical": OpticalSensor(URAD, inf, 0.0, 1, 0)}
    loop = fine.without_hysteresis(sampled("Bouc-Wen", **shaken))
    controller = in_series(loop, control.inverse(loop.mirror))
    found = ensemble.simulate(loop, controller, Span(1.3, 0.3, 1), 64)
    theory = linear.stationary(linear.close(loop, controller)).radial_rms_rad
    assert_allclose(found.radial_rms_rad, theory, rtol=0.01)
    plain = linear.stationary(linear.close(loop, fine.assemble("PI", loop, pi_axis(loop)))).radial_rms_rad
    assert abs(found.radial_rms_rad - theory) < found.radial_rms_interval_rad() < abs(plain - theory)


def test_a_series_inverse_at_its_stroke_is_counted_and_recovers():
    loop = sampled(
        "Prandtl-Ishlinskii", drive=Drive(-6.0, 6.0, 5e3, inf, 0.0, 0.0), references=(Step(2e-3, 0.05, 0.2),)
    )
    controller, span = in_series(loop, control.inverse(loop.mirror)), Span(0.4, 0.0, 1)
    traced, found = traces.trace(loop, controller, span), ensemble.simulate(loop, controller, span, 1)
    assert_allclose(traced.drive_v[260:1000], 6.0, rtol=1e-6)
    assert_allclose(found.counts[0, kernels.COUNT_SATURATED], 750, atol=20)
    assert np.max(np.abs(traced.error_rad[1100:])) < 0.1 * URAD


# ------------------------------------------------------------------------------------------------ refusals


@pytest.mark.promise("export-27")
def test_a_mirror_that_names_no_hysteresis_to_invert_is_refused():
    loop = loop_of("Bouc-Wen")
    stiff = replace(loop, mirror=replace(loop.mirror, inverse=(), inverse_creep=()))
    with pytest.raises(ValueError) as refused:
        ahead(stiff, control.inverse(stiff.mirror))
    words = "controller 'ahead': mirror 'Bouc-Wen' has no inverse: its hysteresis lies in a stiffness"
    assert words in str(refused.value)
    assert "use with_feedforward, which runs it forward" in str(refused.value)


@pytest.mark.promise("mirror-file-21")
def test_plays_that_stand_still_behind_a_reversal_are_refused():
    loop = loop_of("Prandtl-Ishlinskii")
    stuck = mirror.assemble("stuck", "static", None, PrandtlIshlinskii((0.1, 1.0), (50e-6, 30e-6)))
    with pytest.raises(ValueError, match="no weight at threshold 0: it stands still after each reversal"):
        ahead(replace(loop, mirror=stuck), control.inverse(stuck))
