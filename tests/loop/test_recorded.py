"""Recorded motion as a disturbance: played and fitted against a known spectrum, its lines, and what is left of it."""

import math
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter
from scipy.special import digamma, polygamma
from scipy.stats import chi2, kstest, norm

from microrad.loop.disturbance import (
    Disturbance,
    SampledReference,
    SpectralLine,
    combine,
    discretise,
    olympus,
    psd,
    recorded,
    recorded_fit,
    recorded_lines,
)
from microrad.loop.disturbance.recorded import density, edge_s, recorded_motion, resampled
from microrad.loop.disturbance.recorded_fit import fit_recording
from microrad.loop.disturbance.recorded_lines import find_lines
from microrad.loop.disturbance.recorded_tests import (
    BlockTest,
    Stationarity,
    Whiteness,
    correlation_s,
    one_step_residual,
    stationarity,
    whiteness,
)
from microrad.loop.disturbance.terms import Term, term_filter
from microrad.loop.pointing_loop import played
from microrad.loop.pointing_loop.ensemble import Span, simulate
from microrad.loop.pointing_loop.linear import close, stationary
from microrad.loop.pointing_loop.loop import nominal_axis_gain
from microrad.loop.pointing_loop.played import play, recorded_residual, refuse_short
from microrad.loop.pointing_loop.traces import side_by_side
from microrad.loop.workbench import Controller, Loop
from microrad.mirror.hysteresis import PrandtlIshlinskii
from microrad.mirror.model import Mirror
from microrad.mirror.model import combine as combine_mirrors

LINES = (SpectralLine(6e-6, 47.3), SpectralLine(3e-6, 160.21))
KNOWN = replace(olympus(), lines=LINES)
LAG = [1 / 3000**2, 2 * 0.1 / 3000, 1.0]
MIRROR = Mirror.of(50e-6, [1.0], LAG)
LOOP = Loop(mirror=MIRROR, rate_hz=2000.0, vibration=(KNOWN,), sensor_noise_rad=0.1e-6, delay_s=2e-4)
TRACKING = Controller.pid(0.0, 6e6, rate_hz=2000.0)
STEP = LOOP.parts.timing.step_s
SETTLE = 0.5


def drawn(rate_hz, duration_s, seed, lines=LINES):
    """OLYMPUS of an axis, sampled exactly, and lines."""
    random, count = np.random.default_rng(seed), round(rate_hz * duration_s)
    kept, rms = math.exp(-2.0 * math.pi / rate_hz), math.sqrt(40e-12 * math.pi)
    noise = rms * random.standard_normal(count) * math.sqrt(1.0 - kept**2)
    noise[0] /= math.sqrt(1.0 - kept**2)
    time = np.arange(count) / rate_hz
    turning = sum(x.amplitude_rad * np.sin(2 * math.pi * (x.freq_hz * time + random.uniform())) for x in lines)
    return lfilter([1.0], [1.0, -kept], noise) + turning


CASES = {"slower": (1600.0, 40.0, LINES), "faster": (25_000.0, 12.0, LINES), "spectrum alone": (3000.0, 40.0, ())}


@cache
def both(name):
    """A recording slower than the loop or faster than its plant, what the loop leaves of it, and the lines in it."""
    rate_hz, duration_s, lines = CASES[name]
    fit = fit_recording(drawn(rate_hz, duration_s, 3, lines) + 40e-6, 1.0 / rate_hz, name="jitter")
    return fit, recorded_residual(LOOP.parts, LOOP.assembled(TRACKING), fit, SETTLE), lines


@pytest.fixture(scope="module")
def small():
    """A small recording under a filter of a chosen order."""
    return fit_recording(drawn(250.0, 20.0, 13, ()), 4e-3, order=4, name="small")


@pytest.mark.promise("pointing-71")
def test_the_recordings_have_other_rates_than_the_loop():
    assert 1600.0 < LOOP.rate_hz < 1.0 / STEP < 25_000.0


@pytest.mark.promise("pointing-64", "pointing-65", "pointing-67", "pointing-71")
@pytest.mark.parametrize("name", [pytest.param(n, marks=[] if n == "slower" else pytest.mark.endurance) for n in CASES])
def test_played_and_fitted_agree_with_each_other_and_with_the_known_spectrum(name):
    """Within 5 %; chance is a third of that.

    The rms of Gaussian motion over a time T has the relative standard error 1 / sqrt(2 n), n = 2 T (integral of S)^2 /
    (integral of S^2). The loop leaves a band wider than 100 Hz, so that n > 2400 and the error < 1.5 % in 12 s; lines
    have none. A slower recording holds what is above 800 Hz folded below it.
    """
    fit, left, lines = both(name)
    known = replace(LOOP.parts, disturbances=((replace(KNOWN, lines=lines),),))
    theory = stationary(close(known, LOOP.assembled(TRACKING))).error_by_source
    exact = math.sqrt(float(theory["OLYMPUS"][0]))
    assert abs(left.difference) < 0.05 and left.reason == ""
    assert left.played.rms_rad == pytest.approx(exact, rel=0.05, abs=0.0)
    assert left.fitted_rms_rad == pytest.approx(exact, rel=0.05, abs=0.0)
    assert left.noise_rms_rad == pytest.approx(math.sqrt(float(theory["optical sensor noise"][0])), rel=1e-9, abs=0.0)
    assert left.played.least_rms_rad < left.played.rms_rad < left.played.most_rms_rad < 1.2 * left.played.rms_rad
    assert left.played.begin_s == pytest.approx(SETTLE, rel=1e-9, abs=0.0)
    assert fit.motion.duration_s - left.played.end_s <= edge_s(fit.motion, STEP) + 2.0 / LOOP.rate_hz


@pytest.mark.promise("pointing-67")
@pytest.mark.parametrize("name", [pytest.param(n, marks=[] if n == "slower" else pytest.mark.endurance) for n in CASES])
def test_the_fit_is_the_known_filter_and_leaves_white_and_stationary_motion(name):
    fit, _, _ = both(name)
    assert fit.order == 1 and not fit.band_limited and abs(fit.worst_db) < 3.0
    fast = np.geomspace(10.0, 0.4 / fit.motion.step_s, 30)
    assert_allclose(psd(fit.disturbance, fast), psd(olympus(), fast), rtol=0.03)
    assert fit.whiteness.white and fit.whiteness.largest < 0.02
    assert fit.stationarity.stationary and fit.stationarity.reason == ""
    assert 0.05 < fit.correlation_s < 0.3  # 1 / (2 pi 1 Hz) is 0.16 s


@pytest.mark.promise("pointing-67")
def test_lines_are_found_to_a_hundredth_of_their_amplitude_and_a_thousandth_of_their_frequency():
    """The standard error of an amplitude under a Hann window is sqrt(1.5 S / T): 0.4 % of each of these in 120 s."""
    lines, rest = find_lines(recorded_motion(drawn(1600.0, 120.0, 3), 1.0 / 1600.0).rest_rad, 1.0 / 1600.0)
    for found, known in zip(sorted(lines, key=lambda x: x.freq_hz), LINES, strict=True):
        assert found.amplitude_rad == pytest.approx(known.amplitude_rad, rel=0.01, abs=0.0)
        assert found.freq_hz == pytest.approx(known.freq_hz, rel=1e-3, abs=0.0)
    freq, power, _ = density(rest, 1.0 / 1600.0)
    around = (freq > 40.0) & (freq < 55.0)
    assert np.max(power[around]) < 5.0 * np.median(power[around])


@pytest.mark.parametrize("seed", range(5))
def test_a_steady_line_that_is_hidden_in_an_eighth_of_the_recording_is_found_in_the_whole(seed):
    """Sixty times the density in 16 s (A^2 N / 6 for white noise of 1 under a Hann window) is seven in an eighth."""
    count = 16_000
    amplitude, time = math.sqrt(60.0 * 6.0 / count), 1e-3 * np.arange(count)
    noise = np.random.default_rng(seed).standard_normal(count)
    (line,), _ = find_lines(noise + amplitude * np.sin(2 * math.pi * 61.7 * time), 1e-3)
    assert line.freq_hz == pytest.approx(61.7, abs=1.0 / 16.0)
    assert line.amplitude_rad == pytest.approx(amplitude, rel=0.4)


@pytest.mark.promise("pointing-67")
def test_a_narrow_resonance_and_noise_are_no_lines():
    """A resonance of 1.4 Hz stands far above the density around it, and turns; what is found is no tenth of its rms."""
    resonance = Disturbance("plate", *term_filter(Term("low-pass", 4e-12, 120.0, 0.006)), (), "", "test")
    model = discretise(combine(olympus(), resonance), 1e-3)
    random, x, samples = np.random.default_rng(5), np.zeros(3), []
    for noise in random.standard_normal((40_000, model.Bd.shape[1])):
        x = model.Ad @ x + model.Bd @ noise
        samples.append(float(model.C[0] @ x))
    lines, _ = find_lines(recorded_motion(samples, 1e-3).rest_rad, 1e-3)
    assert all(line.amplitude_rad < 0.2 * 2e-6 for line in lines)
    assert find_lines(recorded_motion(drawn(1000.0, 40.0, 6, ()), 1e-3).rest_rad, 1e-3)[0] == ()


def test_a_line_is_found_behind_a_stronger_peak_that_is_none():
    time = np.arange(40_000) / 1e3
    noise = np.random.default_rng(5).normal(0.0, 1e-6, time.size)
    burst = np.where(time < 20.0, 3e-6 * np.sin(2 * np.pi * 40.0 * time), 0.0)
    (line,), _ = find_lines(noise + burst + 0.3e-6 * np.sin(2 * np.pi * 123.0 * time), 1e-3)
    assert line.freq_hz == pytest.approx(123.0, abs=0.01)
    assert line.amplitude_rad == pytest.approx(0.3e-6, rel=0.1)


@pytest.mark.promise("pointing-67", "pointing-68")
def test_a_burst_is_said_not_to_be_stationary_and_what_the_loop_leaves_in_it():
    samples = drawn(1600.0, 15.0, 7, ())
    samples[12_000:13_500] += 4e-6 * np.random.default_rng(8).standard_normal(1500)
    fit = fit_recording(samples, 1.0 / 1600.0)
    assert not fit.stationarity.stationary
    assert "the variance of its fast part in 8 equal parts differs" in fit.stationarity.reason
    assert fit.stationarity.fast.ratio > 2.0 > fit.stationarity.fast.usual
    left = recorded_residual(LOOP.parts, LOOP.assembled(TRACKING), fit, SETTLE)
    assert left.played.most_rms_rad > 1.3 * left.played.rms_rad
    assert (abs(left.difference) > 0.05) == ("not stationary" in left.reason)


@pytest.mark.promise("pointing-67")
@pytest.mark.parametrize("states", [1, 4])
def test_white_residuals_of_a_fit_have_p_values_as_often_below_any_share(states):
    """Each fitted parameter takes the freedom of a lag: here those of an autoregression, fitted by squares."""
    p_values = []
    for seed in range(120):
        samples = np.random.default_rng(seed).standard_normal(2000)
        past = np.column_stack([samples[2 * states - k : -k] for k in range(1, 2 * states + 1)])
        now = samples[2 * states :]
        p_values.append(whiteness(now - past @ np.linalg.lstsq(past, now, rcond=None)[0], states).p_value)
    assert kstest(p_values, "uniform").pvalue > 1e-3
    assert kstest(np.array(p_values) ** 0.5, "uniform").pvalue < 1e-3  # which is no wide net


@pytest.mark.promise("pointing-67")
def test_a_motion_that_grows_is_not_stationary_for_its_trend():
    white = np.random.default_rng(9).standard_normal(20_000)
    density_of_white, still = np.ones(8001), stationarity(np.ones(8001), white, white)
    assert still.stationary and still.motion.usual == pytest.approx(still.fast.usual, rel=0.05, abs=0.0)
    grown = white * np.linspace(0.9, 1.1, white.size)
    found = stationarity(density_of_white, grown, grown)
    assert found.fast.growth == pytest.approx((1.1 / 0.9) ** 2, rel=0.25, abs=0.0)
    assert found.fast.growth_p < 1e-6 and "in 8 equal parts differs" in found.reason
    ratio_alone = replace(found.fast, ratio_p=0.5)
    assert "grows" in ratio_alone.verdict and "over the recording" in ratio_alone.verdict
    fallen = replace(ratio_alone, growth=1.0 / ratio_alone.growth)
    assert fallen.verdict == ratio_alone.verdict.replace("grows", "falls")
    assert replace(fallen, growth=0.9).verdict == ""
    assert " falls 1230 times " in replace(fallen, growth=1.0 / 1234.0).verdict
    assert " differs 4320 times, and " in replace(found.fast, ratio=4321.0).verdict


@pytest.mark.promise("pointing-67")
def test_the_numbers_of_a_fit_are_those_of_the_page():
    """Segments of an eighth, half overlapping; rows of 5 % up to 0.8; a line by chance; 10 % in rms are stationary."""
    white = np.random.default_rng(9).standard_normal(16_000)
    freq, power, segments = density(white, 1e-3)
    assert (freq[1], segments) == (pytest.approx(8.0 / 16.0), 15)
    assert np.sum(power) * freq[1] == pytest.approx(1.0, rel=0.05)
    assert (recorded_fit.FITTED, recorded_fit._BROAD) == (0.8, 0.05)
    assert (recorded_lines._BY_CHANCE, recorded_lines._PARTS) == (1e-6, 8)
    long = np.random.default_rng(10).standard_normal(400_000)
    for ends, is_steady in (((0.97, 1.03), True), ((0.9, 1.1), False)):
        grown = long * np.linspace(*ends, long.size)
        found = stationarity(np.ones(160_001), grown, grown)
        assert found.fast.growth_p < 1e-6 and found.stationary is is_steady


@pytest.mark.promise("pointing-65", "pointing-67")
def test_a_line_that_the_fit_misses_and_power_beyond_the_recording_are_named():
    fit, left, _ = both("slower")
    samples = fit.motion.samples_rad[: round(8.0 / fit.motion.step_s)]
    fit, lines = replace(fit, motion=recorded_motion(samples, fit.motion.step_s)), fit.disturbance.lines
    controller, fast = LOOP.assembled(TRACKING), min(lines, key=lambda x: x.amplitude_rad)
    without = replace(fit, disturbance=replace(fit.disturbance, lines=(fast,)))
    missed = recorded_residual(LOOP.parts, controller, without, SETTLE)
    assert missed.difference > 0.05 and "a line or a resonance that the fit misses" in missed.reason
    assert float(missed.reason.split()[1]) == pytest.approx(LINES[0].freq_hz, abs=1.0)
    hiss = Disturbance("hiss", *term_filter(Term("band-pass", left.fitted_rms_rad**2, 3000.0, 0.1)), (), "", "test")
    more = replace(combine(replace(fit.disturbance, lines=()), hiss), lines=lines)
    beyond = recorded_residual(LOOP.parts, controller, replace(fit, disturbance=more), SETTLE)
    assert beyond.difference < -0.05 and "above 800 Hz, where the recording has ended" in beyond.reason


@pytest.mark.promise("pointing-66", "pointing-67")
def test_simulated_without_hysteresis_a_recording_leaves_what_is_played_and_with_it_what_runs_of_its_spectrum_do():
    """Straight between control samples the motion lacks a little of what is faster: the margin of the first line."""
    fit, left, _ = both("slower")
    assert left.simulated_rms_rad == pytest.approx(left.played.rms_rad, rel=0.02, abs=0.0)
    plays = replace(LOOP, mirror=Mirror.of(PrandtlIshlinskii((0.0, 0.1, 0.4), (30e-6, 12e-6, 8e-6)), [1.0], LAG))
    controller = plays.assembled(TRACKING)
    found = recorded_residual(plays.parts, controller, fit, SETTLE).simulated_rms_rad
    quiet = replace(plays.parts, optical=replace(plays.parts.optical, noise_rad=0.0))
    runs = simulate(quiet, controller, Span(10.0, SETTLE, 1), 32)
    spread = float(np.std(runs.rms_rad))  # one recording against runs of 10 s
    assert abs(found - runs.axis_rms_rad[0]) < 3.0 * spread
    assert found > left.simulated_rms_rad + 6.0 * spread  # which is no wide net


@pytest.mark.parametrize(
    ("known_hz", "missing_rad2", "reason"),
    [
        ((100.0,), 0.0, "near 300"),
        ((300.0,), 0.0, "near 100"),
        ((100.0,), 1e-13, "near 300"),
        ((100.0, 300.0), -1.0, "near 20"),  # the fit's spectrum, which the motion lacks
        ((0.6, 300.0), 0.0, "near 100"),  # a line in one of the first bins
        ((100.0, 300.0), 1e-15, "the fit has"),
        ((100.0, 300.0), 1e-12, "near 20"),
        ((100.0, 300.0, 600.0), 1e-13, "near"),  # a line above half the rate is none of the spectrum there
    ],
)
def test_the_reason_names_what_the_fit_lacks_and_none_of_its_lines(known_hz, missing_rad2, reason):
    """A motion of two tones and a little noise that the loop leaves as it is, fitted with lines and a spectrum."""
    time = np.arange(20_000) * 1e-3
    amplitude = {100.0: 3e-6, 300.0: 2e-6, 0.6: 0.0, 600.0: 1e-6}
    moved = sum(amplitude[f] * np.sin(2.0 * math.pi * f * time) for f in (100.0, 300.0))
    moved = moved + 1e-9 * np.random.default_rng(3).standard_normal(time.size)
    lines = tuple(SpectralLine(amplitude[f], f) for f in known_hz)
    known = Disturbance("fit", *term_filter(Term("band-pass", 1e-14, 200.0, 0.3)), lines, "", "test")
    fit = SimpleNamespace(stationarity=SimpleNamespace(reason=""), motion=SimpleNamespace(half_rate_hz=500.0))
    assert played._reason(fit, known, moved, moved, 1e-3, missing_rad2).startswith(reason)


@pytest.mark.parametrize("step_s", [0.0, -1e-4, math.nan])
def test_a_motion_is_not_resampled_at_no_step(step_s, small):
    with pytest.raises(ValueError, match="the step of a resampled motion"):
        resampled(small.motion, step_s)


def test_each_frequency_that_sampling_folds_onto_another_is_counted_once():
    """Sampled at 1 kHz, 900, 1100, 1900, 2100 Hz and so on look like 100 Hz."""
    images = np.array(recorded_fit._images(np.array([100.0, 250.0]), 1000.0))
    assert images.shape == (2 * recorded_fit._FOLDED, 2)
    assert_allclose(images[:4, 0], [900.0, 1100.0, 1900.0, 2100.0])
    assert_allclose(images[:4, 1], [750.0, 1250.0, 1750.0, 2250.0])


@pytest.mark.parametrize("kept", [0.6, -0.6])
def test_what_the_past_of_a_motion_cannot_predict_is_what_drove_it(kept):
    """A motion that keeps a share of the sample before, with its spectrum: slow where positive, fast where negative."""
    driven, step = np.random.default_rng(5).standard_normal(4000), 1e-3
    moved = lfilter([3e-6], [1.0, -kept], driven)
    freq = np.fft.rfftfreq(driven.size, step)
    density_rad2_hz = 2.0 * step * 9e-12 / np.abs(1.0 - kept * np.exp(-2j * np.pi * freq * step)) ** 2
    found = one_step_residual(density_rad2_hz, moved, step)
    cut = driven.size // 50
    assert_allclose(found, driven[cut : driven.size - cut], atol=0.1)  # the tapered ends reach a little way in


def test_drift_that_the_loop_lets_through_is_named(small):
    """A loop without an integrator leaves most of a drift."""
    samples = small.motion.samples_rad + 100e-6 * small.motion.step_s * np.arange(small.motion.samples_rad.size)
    drifting = replace(small, motion=recorded_motion(samples, small.motion.step_s))
    proportional = LOOP.assembled(Controller.pid(100.0, 0.0, rate_hz=2000.0))
    left = recorded_residual(LOOP.parts, proportional, drifting, SETTLE)
    assert left.difference > 0.05 and left.reason.startswith("drift, and what settles slowly")
    assert left.played.mean_rad > 100e-6


def test_a_spectrum_that_no_small_filter_has_makes_no_motion_unsteady():
    """Behind a smooth filter of fifty samples the density falls by ten orders, and the fit is many decibels off."""
    samples = np.convolve(1e-6 * np.random.default_rng(16).standard_normal(8000), np.hanning(50), "same")
    fit = fit_recording(samples, 1e-3, order=2)
    assert abs(fit.worst_db) > 6.0 and not fit.whiteness.white
    assert fit.stationarity.stationary


@pytest.mark.promise("pointing-67")
def test_mean_and_drift_are_named_and_played():
    time = np.arange(32_000) / 1600.0
    samples = drawn(1600.0, 20.0, 10, ()) + 300e-6 + 5e-6 * (time - time.mean())
    motion = recorded_motion(samples, 1.0 / 1600.0)
    alone = recorded_motion(drawn(1600.0, 20.0, 10, ()), 1.0 / 1600.0)
    assert motion.mean_rad - alone.mean_rad == pytest.approx(300e-6, rel=1e-9, abs=0.0)
    assert motion.slope_rad_s - alone.slope_rad_s == pytest.approx(5e-6, rel=1e-9, abs=0.0)
    assert_allclose(motion.rest_rad, alone.rest_rad, atol=1e-15)
    moved, still = resampled(motion, STEP), resampled(alone, STEP)
    assert_allclose(moved - still, 300e-6 + 5e-6 * (STEP * np.arange(moved.size) - time.mean()), rtol=1e-9)


# ---------------------------------------------------------------------------------------------------------- resampling
def tone(rate_hz, freq_hz, count=20_000):
    return np.sin(2.0 * math.pi * freq_hz * np.arange(count) / rate_hz)


@pytest.mark.promise("pointing-67")
@pytest.mark.parametrize("freq_hz", [5030.0, 5400.0, 7100.0, 12000.0])
def test_what_is_above_half_of_the_new_rate_does_not_appear_below(freq_hz):
    rate_hz = 25_000.0
    moved = resampled(recorded_motion(tone(rate_hz, freq_hz), 1.0 / rate_hz), 1e-4)[100:-100]
    assert np.max(np.abs(moved)) < 1.1e-4  # -80 dB, and the ripple of a tone that is cut off at its ends


@pytest.mark.promise("pointing-67")
def test_a_slower_recording_has_no_images_above_half_of_its_rate():
    moved = resampled(recorded_motion(tone(1600.0, 600.0), 1.0 / 1600.0), 1e-4)[1000:-1000]
    freq, power, _ = density(moved, 1e-4)
    assert np.max(power[freq > 810.0]) < 1e-6 * np.max(power)
    assert math.sqrt(2.0 * float(np.mean(moved**2))) == pytest.approx(1.0, rel=1e-3, abs=0.0)


@pytest.mark.parametrize("rate_hz", [25_000.0, 4_000.0, 7_919.3])
def test_what_is_below_half_of_both_rates_is_where_it_was(rate_hz):
    moved = resampled(recorded_motion(tone(rate_hz, 333.0), 1.0 / rate_hz), 1e-4)
    inside = slice(500, moved.size - 500)
    assert_allclose(moved[inside], tone(10_000.0, 333.0, moved.size)[inside], atol=1e-3)


@pytest.mark.promise("pointing-67")
@pytest.mark.parametrize(("rate_hz", "freq_hz"), [(25_000.0, 4500.0), (1600.0, 720.0)])
def test_up_to_nine_tenths_of_half_of_the_lower_rate_nothing_is_changed(rate_hz, freq_hz):
    moved = resampled(recorded_motion(tone(rate_hz, freq_hz), 1.0 / rate_hz), 1e-4)
    inside = slice(1000, moved.size - 1000)
    assert_allclose(moved[inside], tone(10_000.0, freq_hz, moved.size)[inside], atol=1e-3)


@pytest.mark.promise("pointing-67")
def test_a_recording_at_the_loops_own_rate_is_itself():
    samples = drawn(1.0 / STEP, 1.0, 11)
    assert_allclose(resampled(recorded_motion(samples, STEP), STEP * (1.0 + 1e-12)), samples, rtol=1e-9, atol=0.0)
    assert edge_s(recorded_motion(samples, STEP), STEP) == 0.0


# ------------------------------------------------------------------------------------------------------------- playing
@pytest.mark.promise("pointing-65")
@pytest.mark.parametrize("every", [1, 2])
def test_a_motion_is_played_as_the_kernel_plays_a_reference(every):
    """A reference is straight between control samples, and so is this motion at the plant steps."""
    quiet = replace(LOOP, vibration=(), sensor_noise_rad=0.0).parts
    quiet = replace(quiet, optical=replace(quiet.optical, every=every))
    controller = LOOP.assembled(Controller.pid(0.0, 4e5, rate_hz=2000.0))
    samples = drawn(2000.0, 0.6, 12)
    wanted = [[SampledReference(samples, quiet.timing.period_s)]]
    error, _ = side_by_side(quiet, controller, Span(0.5, 0.0, 1), wanted)
    per_sample = quiet.timing.steps_per_sample
    steps = np.interp(np.arange(1000 * per_sample + 1) / per_sample, np.arange(samples.size), samples)
    played = play(close(quiet, controller), steps)
    assert_allclose(played[per_sample - 1 :: per_sample][:999], error[0, 1:, 0], rtol=0.0, atol=1e-9 * np.ptp(samples))


# ------------------------------------------------------------------------------------------------------------ refusals
@pytest.mark.promise("pointing-67")
def test_a_filter_of_a_chosen_order_has_so_many_states(small):
    assert small.order == small.disturbance.A.shape[0] == 4
    assert small.disturbance.rms_rad == pytest.approx(olympus().rms_rad, rel=0.3, abs=0.0)


@pytest.mark.parametrize(
    ("samples", "step_s", "words"),
    [
        (np.zeros((300, 2)), 1e-3, r"has the shape \(300, 2\): give one row of 200 samples or more"),
        (np.arange(199.0), 1e-3, r"has the shape \(199,\)"),
        (np.append(np.arange(300.0), np.nan), 1e-3, "sample 300 is nan, 1 such sample in all; cut the recording"),
        (np.full(300, 2e-6), 1e-3, "stands still at 2e-06 rad; name a channel that moves"),
        (np.arange(300.0), 0.0, 'the step of "jitter" is 0 s'),
    ],
)
def test_what_is_no_motion_is_refused(samples, step_s, words):
    with pytest.raises(ValueError, match=words):
        recorded_motion(samples, step_s, "jitter")


@pytest.mark.promise("pointing-69")
def test_other_orders_rates_and_lengths_are_refused(small, monkeypatch):
    samples = small.motion.samples_rad
    with pytest.raises(ValueError, match="a shaping filter of 0 states; give 1 to 24"):
        fit_recording(samples, 4e-3, order=0)
    with pytest.raises(ValueError, match="rates may differ 10000 times"):
        resampled(small.motion, 1e-8)
    monkeypatch.setattr(recorded, "_MOST_STEPS", 2 * samples.size)
    assert resampled(small.motion, 2e-3).size == 2 * samples.size - 1
    with pytest.raises(ValueError, match=r"are not played every 0\.0019 s: .* 10000 steps are the most; cut the"):
        resampled(small.motion, 1.9e-3)
    refuse_short(small, 10.0)
    with pytest.raises(ValueError, match=r'"small" lasts 20 s; the loop settles in 19 s, and ten times the .* record'):
        refuse_short(small, 19.0)
    long = replace(small, correlation_s=0.004)
    with pytest.raises(ValueError, match=r"are needed behind that: record 30\.1 s or more$"):  # 30.04 s
        refuse_short(long, 30.0)
    unstable = LOOP.assembled(Controller.pid(0.0, 1e8, rate_hz=2000.0))
    with pytest.raises(ValueError, match="is unstable: a pole at"):
        recorded_residual(LOOP.parts, unstable, small, 0.0)


MOVING = np.sin(0.37 * np.arange(400.0)) + 0.01 * np.arange(400.0)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: recorded_motion(MOVING.reshape(2, 200), 1e-3, "tracker"),
            ValueError,
            '"tracker" has the shape (2, 200): give one row of 200 samples or more, in rad',
        ),
        (
            lambda: recorded_motion(MOVING[:150], 1e-3, "tracker"),
            ValueError,
            '"tracker" has the shape (150,): give one row of 200 samples or more, in rad',
        ),
        (
            lambda: recorded_motion(np.where(np.arange(400) % 151 == 150, np.nan, MOVING), 1e-3, "tracker"),
            ValueError,
            (
                '"tracker": sample 150 is nan, 2 such samples in all; cut the recording to a part without '
                "them: a gap that is filled in is no motion that was measured"
            ),
        ),
        (
            lambda: recorded_motion(np.where(np.arange(400) == 37, -np.inf, MOVING), 1e-3, "tracker"),
            ValueError,
            (
                '"tracker": sample 37 is -inf, 1 such sample in all; cut the recording to a part without '
                "them: a gap that is filled in is no motion that was measured"
            ),
        ),
        (
            lambda: recorded_motion(np.full(400, 0.375), 1e-3, "tracker"),
            ValueError,
            '"tracker" stands still at 0.375 rad; name a channel that moves',
        ),
        (
            lambda: recorded_motion(MOVING, -1e-3, "tracker"),
            ValueError,
            'the step of "tracker" is -0.001 s; give a finite number above zero',
        ),
        (
            lambda: resampled(recorded_motion(MOVING, 1e-3, "tracker"), 2e-8),
            ValueError,
            (
                '"tracker": 400 samples, 0.001 s apart, are not played every 2e-08 s: rates may differ '
                "10000 times, and 50000000 steps are the most; cut the recording"
            ),
        ),
        (
            lambda: fit_recording(MOVING, 1e-3, order=25, name="tracker"),
            ValueError,
            '"tracker": a shaping filter of 25 states; give 1 to 24',
        ),
    ],
)
def test_a_refusal_of_a_recording_says_its_numbers(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


OWN = recorded_motion(MOVING, 2.5e-3, "tracker")


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [OWN.duration_s, OWN.half_rate_hz, OWN.mean_rad, OWN.slope_rad_s, *OWN.rest_rad[[0, 200,
            -1]], *OWN.trend_rad(np.array([0.0, 0.4]))],
     [
        0.9975, 200.0, 2.008388, 4.00018735, -0.013294555, -0.998534491, 0.0113707226, 0.013294555, 1.6133695,
    ]),
    (lambda: [resampled(OWN, 1e-3).size, *resampled(OWN, 1e-3)[[300, 501, 702]], resampled(OWN,
            7e-3).size, *resampled(OWN, 7e-3)[[40, 71]]],
     [998, 1.60565921, 1.05493825, 2.58641407, 143, 0.555947236, 1.02460104]),
    (lambda: [edge_s(OWN, 2.5e-3), edge_s(OWN, 1e-3), edge_s(OWN, 7e-3), recorded.beyond_rms(OWN, 30.0),
            density(OWN.rest_rad, 2.5e-3, 4)[2], *density(OWN.rest_rad, 2.5e-3, 4)[1][[5, 6, 7]]],
     [0.0, 0.127960762, 0.358290134, 0.264737888, 7, 0.0283884745, 0.082014822, 0.0145313989]),
    (lambda: [x for line in find_lines(OWN.rest_rad, 2.5e-3)[0][:1] for x in (line.amplitude_rad,
            line.freq_hz)],
     [1.00000063, 23.5549312]),
])  # fmt: skip
def test_parts_of_a_recording_of_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


# ------------------------------------------------------------------------------------- rates, lengths and tests unlike
@pytest.mark.parametrize(
    ("own_hz", "loop_hz", "up", "down"),
    [
        (622.08, 1000.0, 3125, 1944), (1000.0, 622.08, 1944, 3125), (1500.0, 1000.0, 2, 3), (3000.0, 1000.0, 1, 3),
        (1000.0, 1000.00005, 1, 1), (1000.0, 2000.0001, 2, 1), (1000.0, 1001.0, 1001, 1000), (30.0, math.pi, 710, 6780),
    ],
)  # fmt: skip
def test_a_ratio_of_rates_is_that_of_the_smallest_whole_numbers_that_clocks_tell_from_it(own_hz, loop_hz, up, down):
    assert recorded._in_whole_numbers(loop_hz / own_hz) == Fraction(up, down)


@pytest.mark.parametrize("loop_hz", [622.08, 400.0, 250.0, 1244.16, 90.0])
def test_a_drifting_sine_is_itself_at_any_rate_and_ends_with_the_recording(loop_hz):
    rate, count = 400.0, 1201

    def motion(time):
        return 3e-6 + 2e-6 * time + 1e-6 * np.sin(2 * np.pi * 13.7 * time + 0.4)

    found = resampled(recorded_motion(motion(np.arange(count) / rate), 1 / rate), 1 / loop_hz)
    assert found.size == math.floor((count - 1) / rate * loop_hz * (1 + 1e-9)) + 1
    edge = math.ceil(edge_s(recorded_motion(MOVING, 1 / rate), 1 / loop_hz) * loop_hz)
    inner = slice(edge, found.size - edge)
    time = np.arange(found.size) / loop_hz
    assert_allclose(found[inner], motion(time)[inner], rtol=0, atol=4e-10)


def test_mean_and_slope_of_an_even_number_of_samples_are_those_of_least_squares_about_the_middle():
    step, rad = 0.004, 1e-6 * np.cumsum(np.random.default_rng(4).standard_normal(206))
    found, time = recorded_motion(rad, step, "a"), 0.004 * np.arange(206)
    slope, at_begin = np.polyfit(time, rad, 1)
    assert (found.mean_rad, found.slope_rad_s) == pytest.approx((np.mean(rad), slope), rel=1e-9)
    assert_allclose(found.trend_rad(time), at_begin + slope * time, rtol=1e-9)
    assert_allclose(found.rest_rad, rad - at_begin - slope * time, rtol=0, atol=1e-15)
    assert (found.duration_s, found.half_rate_hz, found.name) == (pytest.approx(0.82), pytest.approx(125.0), "a")


@pytest.mark.parametrize(("count", "parts", "segments"), [(403, 8, 15), (400, 3, 4), (407, 1, 1), (401, 2, 3)])
def test_the_density_of_a_length_that_segments_do_not_divide_is_welchs(count, parts, segments):
    rad = np.random.default_rng(8).standard_normal(count)
    freq, power, number = density(rad, 2.5e-3, parts)
    length = count // parts
    window = np.hanning(length + 1)[:-1]
    cut = [rad[at : at + length] * window for at in range(0, count - length + 1, length - length // 2)]
    expected = 2 * 2.5e-3 * np.mean([np.abs(np.fft.rfft(each)) ** 2 for each in cut], axis=0) / np.sum(window**2)
    expected[[0] if length % 2 else [0, -1]] /= 2
    assert len(cut) == number == segments
    assert_allclose(power, expected, rtol=1e-9, atol=1e-12 * np.max(expected))
    assert_allclose(freq, np.arange(length // 2 + 1) / (length * 2.5e-3), rtol=1e-12)


MOVES = BlockTest("the gust", 3.4567, 2.3456, 5e-4, 0.4567, 5e-4)


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({}, "the variance of the gust in 8 equal parts differs 3.46 times, and stationary motion of this spectrum "
             "stays within 2.35 times"),
        ({"ratio_p": 1e-3}, "the variance of the gust falls 2.19 times over the recording"),
        ({"ratio": 1.21}, "the variance of the gust falls 2.19 times over the recording"),
        ({"ratio": 1.2, "growth": 2.6789}, "the variance of the gust grows 2.68 times over the recording"),
        ({"ratio_p": 0.5, "growth_p": 1e-3}, ""), ({"ratio_p": 0.5, "growth": 1.21}, ""),
        ({"ratio_p": 0.5, "growth": 1 / 1.2}, ""), ({"ratio": 1.2101, "growth_p": 0.9}, "the variance of the gust in 8 "
         "equal parts differs 1.21 times, and stationary motion of this spectrum stays within 2.35 times"),
    ],
)  # fmt: skip
def test_a_motion_is_unsteady_for_what_chance_has_less_than_once_in_a_thousand_and_ten_percent_of_rms(changes, verdict):
    found = replace(MOVES, **changes)
    assert found.verdict == verdict
    steady = replace(MOVES, ratio_p=0.5, growth_p=0.5)
    assert Stationarity(found, steady).reason == Stationarity(steady, found).reason == verdict
    assert Stationarity(found, steady).stationary is (verdict == "")
    fast = replace(MOVES, of="its fast part")
    assert Stationarity(found, fast).reason == fast.verdict


def test_a_residual_is_white_up_to_the_thousandth_and_ljung_and_boxs_by_hand():
    assert [Whiteness(20, 1.0, p, 0.1).white for p in (1e-3, 0.99e-3)] == [True, False]
    found, z = whiteness(MOVING[:97], 3), MOVING[:97] - np.mean(MOVING[:97])
    r = np.array([np.sum(z[k:] * z[:-k]) for k in range(1, 27)]) / np.sum(z**2)
    statistic = 97 * 99 * np.sum(r**2 / (97 - np.arange(1, 27)))
    assert (found.lags, found.statistic, found.largest) == (26, pytest.approx(statistic), pytest.approx(max(abs(r))))
    assert found.p_value == pytest.approx(chi2.sf(statistic, 20), rel=1e-6)


def test_growth_and_ratio_of_a_motion_whose_parts_have_known_variances():
    """Eight parts of +-s, and three samples behind them that no part has."""
    sizes = np.array([1.0, 1.2, 0.9, 1.5, 1.3, 1.8, 1.1, 1.6])
    motion = np.append(np.repeat(sizes, 60) * np.tile([1.0, -1.0], 240), [50.0] * 3)
    freq = np.arange(150.0)
    S = 1.0 / (1.0 + (freq / 40.0) ** 2)
    found = stationarity(S, motion, motion[:480]).motion
    freedom = 2.0 / 8.0 * np.sum(S) ** 2 / np.sum(S**2)
    slope = np.polyfit(np.arange(8), np.log(sizes**2), 1)[0]
    assert (found.of, found.ratio) == ("the motion", pytest.approx((1.8 / 0.9) ** 2))
    assert found.growth == pytest.approx(math.exp(7 * slope), rel=1e-9)
    assert found.growth_p == pytest.approx(
        2 * norm.sf(abs(slope) / math.sqrt(polygamma(1, freedom / 2) / 42)), rel=1e-6
    )
    drawn = np.random.default_rng(1).chisquare(freedom, (200_000, 8))
    beyond = np.max(drawn, axis=1) / np.min(drawn, axis=1)
    assert found.ratio_p == pytest.approx(np.mean(beyond > 4.0), abs=0.01)
    assert np.mean(beyond > found.usual) == pytest.approx(1e-3, abs=4e-4)


def test_a_motion_forgets_itself_where_its_correlation_first_falls_below_1_over_e():
    kept = 0.93
    rad = lfilter([1.0], [1.0, -kept], np.random.default_rng(6).standard_normal(60_000))
    r = np.array([rad[k:] @ rad[: rad.size - k] for k in range(40)])
    assert correlation_s(rad, 0.02) == pytest.approx(0.02 * np.argmax(r < r[0] / math.e), rel=1e-12)


def test_lines_of_a_recording_are_told_strongest_above_their_surroundings_first_with_what_is_left():
    rate, time = 500.0, np.arange(16_000) / 500.0
    noise = lfilter([1.0], [1.0, -0.95], np.random.default_rng(2).standard_normal(time.size)) * 1e-8
    waves = [3e-7 * np.sin(2 * np.pi * 31.71 * time + 1.0), 5e-7 * np.cos(2 * np.pi * 7.33 * time + 2.0)]
    lines, rest = find_lines(noise + sum(waves), 1 / rate)
    assert [line.freq_hz for line in lines] == pytest.approx([31.71, 7.33], rel=1e-5)
    assert [line.amplitude_rad for line in lines] == pytest.approx([3e-7, 5e-7], rel=5e-3)
    assert np.std(rest - noise) < 0.1 * np.std(noise)


# ------------------------------------------------------------------------------------------- a fit and a run by parts
@pytest.mark.parametrize("folded", [True, False])
def test_rows_of_a_recording_hold_the_density_about_them_and_what_sampling_folds_there(folded):
    """White noise behind 1/f^2 at its images: six of a density of 1 and, beyond them, 1/f^2 at three times the rate."""
    centre, width, error = np.array([2.0, 10.0, 30.0]), np.array([0.0, 1.0, 6.0]), np.array([0.01, 0.03, 0.2])
    rows = centre, width, np.array([5.0, 6.0, 7.0]), error
    samples, sure = recorded_fit._rows(*rows, SimpleNamespace(half_rate_hz=50.0), folded)
    images = [[abs(k * 100.0 + s * f) for k in (1, 2) for s in (-1, 1)] + [300.0] for f in centre]
    own = centre[:, None] + 0.3 * width[:, None] * [-1, 0, 1]
    nodes = np.hstack([own, images]) if folded else own
    assert_allclose(samples.nodes_hz, nodes.ravel(), rtol=1e-12)
    beyond = 2.0 * 9.0 * sum(1.0 / k**2 for k in range(3, 200_000))
    weights = [1 / 3] * 3 + ([1.0] * 4 + [beyond] if folded else [])
    assert_allclose(samples.weights, weights * 3, rtol=1e-4)
    assert samples.starts.tolist() == [0, len(weights), 2 * len(weights)]
    assert samples.wanted.tolist() == [5.0, 6.0, 7.0]
    assert_allclose(samples.trust, [1.0, 0.5, 0.075], rtol=1e-12)
    assert (sure.tolist(), samples.ceiling.any()) == ([True, True, False], np.False_)
    _, least = recorded_fit._rows(*rows[:3], error + 0.3, SimpleNamespace(half_rate_hz=50.0), folded)
    assert least.tolist() == [True, False, False]


@pytest.mark.parametrize(("segments", "below", "first", "last"), [(15, 0, 2, 100), (1, 8, 3, 16)])
def test_bins_of_a_density_are_averaged_with_the_error_of_hanns_window_and_of_a_mean_of_few(
    segments, below, first, last
):
    freq = 0.5 * np.arange(100)
    power = 1.0 + np.arange(100.0) ** 2
    centre, width, wanted, error = recorded_fit._averaged(freq, power, segments, below)
    used, places = freq[first:last], np.log(np.arange(first, last) / first)
    group = np.floor(places / (0.6 if below else 0.05))
    parts = [np.flatnonzero(group == g) for g in np.unique(group)]
    assert_allclose(centre, [np.mean(used[p]) for p in parts], rtol=1e-12)
    assert_allclose(width, [0.5 * (len(p) - 1) for p in parts], atol=1e-12)
    window = np.hanning(101)[:-1]
    turned = [np.exp(2j * np.pi * k * np.arange(100) / 100) for k in (1, 2)]
    shares = [abs(np.sum(window**2 * each) / np.sum(window**2)) ** 2 for each in turned]
    for p, e, w in zip(parts, error, wanted, strict=True):
        n = len(p)
        spread = (n + 2 * (n - 1) * shares[0] + 2 * max(n - 2, 0) * shares[1]) / n**2
        assert e == pytest.approx(math.sqrt(spread * (1.0 if segments == 1 else 1.0556 / segments)), rel=1e-9)
        few = math.exp(-math.log(e**2) - digamma(1 / e**2))
        assert w == pytest.approx(np.mean(power[first:last][p]) * few, rel=1e-9)


@pytest.mark.parametrize("band_limited", [True, False])
def test_the_density_of_samples_is_that_of_the_filter_and_of_what_sampling_folds(band_limited):
    motion = SimpleNamespace(samples_rad=np.zeros(1001), half_rate_hz=50.0)
    found = recorded_fit._spectrum(KNOWN, motion, band_limited)
    freq = np.arange(401) * 100.0 / 1001
    expected = psd(KNOWN, freq)
    if not band_limited:
        folded = np.abs(100.0 * np.arange(-4000, 4001)[:, None] + freq)
        expected = sum(psd(KNOWN, some.ravel()).reshape(some.shape).sum(axis=0) for some in np.array_split(folded, 80))
    assert found.size == 401
    assert_allclose(found, expected, rtol=2e-3)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_motion_is_played_to_the_axis_that_it_is_of(axis):
    loop = Loop(mirror=combine_mirrors(MIRROR, MIRROR), rate_hz=2000.0, optics=[[1.0, 0.3], [-0.2, 0.8]], delay_s=2e-4)
    both = Controller.pid(0.0, 6e6, rate_hz=2000.0, axes=2)
    slower = np.diag([1.0, 0.3])
    s = replace(both.system, B=both.system.B @ slower, D=both.system.D @ slower)
    controller = loop.assembled(replace(both, system=s))
    motion = np.interp(np.arange(1001) / 10, np.arange(101), drawn(2000.0, 0.0505, 3))
    found = play(close(loop.parts, controller), motion, axis)
    alone = Loop(mirror=MIRROR, rate_hz=2000.0, optics=[[nominal_axis_gain(loop.parts) / 50e-6]], delay_s=2e-4)
    own = Controller.pid(0.0, (6e6, 1.8e6)[axis], rate_hz=2000.0)
    expected = play(close(alone.parts, alone.assembled(own)), motion)
    assert_allclose(found, expected, rtol=0, atol=1e-6 * np.ptp(motion))


def test_what_is_played_is_told_about_its_mean_and_by_its_eighths():
    """Parts of plus and minus their size about a mean of 3, and three samples behind them that no part has."""
    sizes = np.array([1.0, 2.0, 0.5, 4.0, 3.0, 1.5, 2.5, 1.25])
    error = np.append(3.0 + np.repeat(sizes, 10) * np.tile([1.0, -1.0], 40), [3.0] * 3)
    found = played._played(error, 0.5, 9.5)
    assert (found.begin_s, found.end_s, found.mean_rad) == (0.5, 9.5, pytest.approx(3.0))
    assert found.rms_rad == pytest.approx(math.sqrt(10 * np.sum(sizes**2) / 83))
    assert (found.least_rms_rad, found.most_rms_rad) == pytest.approx((0.5, 4.0))
    residual = played.RecordedResidual(found, 2.0, 0.1, 1.0, 0.0, "")
    assert residual.difference == pytest.approx(found.rms_rad / 2.0 - 1.0)


@pytest.mark.parametrize(
    ("lasts_s", "settle_s", "correlation", "said"),
    [
        (3.0, 0.5, 0.25, None), (3.0, 0.5, 0.2501, "3.01 s"), (2.99, 0.5, 0.25, "3 s"), (1.3, 0.0, 0.25, "2.5 s"),
    ],
)  # fmt: skip
def test_a_recording_holds_ten_of_its_correlation_times_behind_what_settles(lasts_s, settle_s, correlation, said):
    fit = SimpleNamespace(motion=SimpleNamespace(name="tracker", duration_s=lasts_s), correlation_s=correlation)
    if said is None:
        refuse_short(fit, settle_s)
        return
    with pytest.raises(ValueError) as refused:
        refuse_short(fit, settle_s)
    start, end = str(refused.value).split(" s; the loop settles in ")
    assert (start.split(" lasts ")[0], end.rsplit(": record ")[1]) == ('"tracker"', f"{said} or more")


def test_a_power_beyond_a_frequency_is_the_sum_of_the_bins_above_it():
    """Of a sine within the bins: all of it below and none above, but for what a Hann window spreads."""
    rate = 256.0
    motion = recorded_motion(np.sin(2 * np.pi * 40.0 * np.arange(8 * 256) / rate), 1 / rate)
    assert recorded.beyond_rms(motion, 38.5) == pytest.approx(math.sqrt(0.5), rel=2e-3)
    assert recorded.beyond_rms(motion, 40.0) == pytest.approx(math.sqrt(0.5 / 6), rel=2e-2)
    assert recorded.beyond_rms(motion, 42.0) < 1e-2


def test_what_is_kept_of_a_recording_of_another_rate_begins_behind_its_edge_and_each_line_of_the_plant_counts(
    small, monkeypatch
):
    """Lines above half of the control rate and below half of the plant's; one beyond that is in no theory of it."""
    parts, controller = LOOP.parts, LOOP.assembled(TRACKING)
    motion = recorded_motion(small.motion.samples_rad[:1000], small.motion.step_s)
    monkeypatch.setattr(played, "_simulated", lambda *_: 0.0)
    monkeypatch.setattr(played, "_reason", lambda *_: "")
    edge, fast = edge_s(motion, STEP), SpectralLine(4e-6, 1500.0)
    assert 0.1 < edge < 0.3
    shaken = replace(small.disturbance, lines=(SpectralLine(9e-6, 20_000.0), fast))
    with_it, plain = (
        recorded_residual(parts, controller, replace(small, motion=motion, disturbance=each), settle_s)
        for each, settle_s in ((shaken, 0.1), (replace(shaken, lines=()), 0.3))
    )
    assert with_it.played.begin_s == pytest.approx(edge, abs=STEP)
    assert plain.played.begin_s == pytest.approx(0.3, abs=1e-9)
    assert [each.played.end_s for each in (with_it, plain)] == pytest.approx([motion.duration_s - edge] * 2, abs=STEP)
    line = replace(shaken, A=np.zeros((0, 0)), B=np.zeros((0, 1)), C=np.zeros((1, 0)), lines=(fast,))
    alone = stationary(close(replace(parts, disturbances=((line,),)), controller)).error_by_source[line.name][0]
    assert with_it.fitted_rms_rad**2 - plain.fitted_rms_rad**2 == pytest.approx(alone, rel=1e-6)
    assert alone > 0.1 * plain.fitted_rms_rad**2


def test_no_more_lines_are_told_than_a_recording_may_have_and_the_others_are_left_in_it(monkeypatch):
    time = 1e-3 * np.arange(4000)
    given = [SpectralLine(3e-6, 210.3), SpectralLine(9e-6, 47.2), SpectralLine(6e-6, 120.9), SpectralLine(1e-6, 333.3)]
    waves = [x.amplitude_rad * np.sin(2 * math.pi * x.freq_hz * time) for x in given]
    samples = sum(waves) + 1e-8 * np.random.default_rng(5).standard_normal(time.size)
    monkeypatch.setattr(recorded_lines, "_MOST_LINES", 2)
    found, rest = find_lines(samples, 1e-3)
    assert [(x.freq_hz, x.amplitude_rad) for x in found] == [
        pytest.approx((47.2, 9e-6), rel=1e-3), pytest.approx((120.9, 6e-6), rel=1e-3)
    ]  # fmt: skip
    assert_allclose(rest, waves[0] + waves[3], atol=2e-7)
    monkeypatch.setattr(recorded_lines, "_MOST_LINES", 4)
    assert len(find_lines(samples, 1e-3)[0]) == 4


@pytest.mark.parametrize(("order", "taken"), [(None, True), (1, True), (24, True), (0, False), (25, False)])
def test_a_filter_of_a_recording_has_1_to_24_states(monkeypatch, order, taken):
    def begun(*_):
        raise LookupError("begun")

    monkeypatch.setattr(recorded_fit, "find_lines", begun)
    said = "begun" if taken else f'"hum": a shaping filter of {order} states; give 1 to 24'
    with pytest.raises(LookupError if taken else ValueError) as ended:
        fit_recording(np.sin(np.arange(300.0)), 1e-3, order=order, name="hum")
    assert ended.value.args == (said,)


def test_a_recording_is_simulated_alone_without_any_noise_of_its_sensors_and_told_about_its_mean(monkeypatch):
    asked = []

    def simulate(loop, controller, span, runs):
        asked.append((loop, controller, span, runs))
        return SimpleNamespace(rms_rad=np.array([[5.0]]), mean_rad=np.array([[-3.0]]))

    monkeypatch.setattr(played, "simulate", simulate)
    parts = replace(LOOP, gauge_noise_rad=2e-7).parts
    parts = replace(
        parts, gauge=replace(parts.gauge, resolution_rad=3e-9), unknown=("anything",), references=("moved",)
    )
    moved = np.arange(45.0)
    assert played._simulated(parts, "controller", moved, "span") == 4.0
    ((loop, *others),) = asked
    assert others == ["controller", "span", 1]
    assert (loop.gauge.noise_rad, loop.gauge.resolution_rad, loop.optical.noise_rad) == (0.0, 3e-9, 0.0)
    assert (loop.optical, loop.disturbances) == (replace(parts.optical, noise_rad=0.0), ((),))
    (own,), (still,) = loop.unknown, loop.references
    period = parts.timing.period_s
    assert own.at(period * np.arange(6)).tolist() == [0.0, 10.0, 20.0, 30.0, 40.0, 40.0]
    assert still.at(np.array([0.0, 9.0])).tolist() == [0.0, 0.0]
    assert played._simulated(replace(parts, gauge=None), "controller", moved, "span") == 4.0
    assert asked[1][0].gauge is None


@pytest.mark.parametrize(
    ("step_s", "fits"), [(1e-4, True), (0.99e-4, False), (0.01, True), (0.0101, False), (1e300, False), (1e-300, False)]
)
def test_a_motion_is_played_so_many_times_slower_or_faster_and_no_more(monkeypatch, step_s, fits):
    monkeypatch.setattr(recorded, "_MOST_APART", 10.0)
    motion = recorded_motion(MOVING, 1e-3, "tracker")
    if fits:
        assert resampled(motion, step_s).size == math.floor(motion.duration_s / step_s * (1 + 1e-12)) + 1
        return
    with pytest.raises(ValueError) as refused:
        resampled(motion, step_s)
    assert str(refused.value) == (
        f'"tracker": 400 samples, 0.001 s apart, are not played every {step_s:g} s: rates may differ 10 times, and '
        "50000000 steps are the most; cut the recording"
    )


def test_a_recording_lasts_from_its_first_sample_to_its_last_and_its_drift_is_none_in_the_middle():
    motion = recorded_motion(MOVING, 2e-3, "tracker")
    assert (motion.duration_s, motion.half_rate_hz) == (pytest.approx(0.798), pytest.approx(250.0))
    assert motion.trend_rad(np.array([0.399])) == pytest.approx(np.mean(MOVING), rel=1e-12)
    ends = motion.trend_rad(np.array([0.0, 0.798]))
    assert ends - np.mean(MOVING) == pytest.approx(motion.slope_rad_s * np.array([-0.399, 0.399]), rel=1e-9)
    assert resampled(motion, 2e-3) is motion.samples_rad
    below = recorded_motion(-5.0 - 1e-9 * MOVING, 2e-3)
    assert below.mean_rad == pytest.approx(-5.0 - 1e-9 * np.mean(MOVING), rel=1e-12)
    with pytest.raises(ValueError, match=r'"recording" stands still at -5 rad'):
        recorded_motion(-5.0 - 1e-13 * np.sin(np.arange(300.0)), 2e-3)


@pytest.mark.parametrize(
    ("size", "edges"),
    [
        (101, [1, 49, 101]), (97, [1, 49, 97]), (96, [1, 96]), (98, [1, 49, 98]), (40, [1, 40]),
        (192, [1, 49, 97, 192]), (193, [1, 49, 97, 145, 193]), (194, [1, 49, 97, 145, 194]),
        (600, [1, 49, 97, 145, 193, 241, 289, 337, 385, 433, 481, 529, 600]),
        (640, [1, 49, 97, 145, 193, 241, 289, 337, 385, 433, 481, 529, 581, 640]),
    ],
)  # fmt: skip
def test_the_floor_goes_by_medians_of_bands_of_48_bins_or_a_tenth_and_the_last_one_takes_what_is_left(size, edges):
    moved = np.cumsum(np.random.default_rng(size).standard_normal(2 * size - 2))
    window = np.linspace(0.5, 1.5, moved.size)
    power, floor = recorded_lines._power_and_floor(moved, window)
    assert_allclose(power, np.abs(np.fft.rfft(window * moved)) ** 2, rtol=1e-9)
    middle, level = [], []
    for first, behind in pairwise(edges):
        middle.append((first + behind - 1) / 2)
        level.append(math.log(np.median(power[first:behind]) / math.log(2.0)))
    assert_allclose(np.log(floor), np.interp(np.arange(size), middle, level), rtol=1e-9)


@pytest.mark.parametrize(
    ("fitted", "drift", "reason"),
    [
        (0.6, 0.33, "drift, and what settles slowly behind the begin, are no part of the fit"),
        (0.6, 0.31, "another: -0.64"), (1.0, 9.0, ""), (2.0, 9.0, "another: 3"), (2.0, 0.0, "another: 3"),
    ],
)  # fmt: skip
def test_drift_is_the_reason_where_it_makes_more_than_half_of_what_is_left_beyond_the_fit(
    monkeypatch, fitted, drift, reason
):
    """A played residual of 1 rms, of which half of the excess over 0.6^2 is 0.32."""
    sign = np.where(np.arange(7981) % 2, 1.0, -1.0)
    asked = []
    given = iter([sign, math.sqrt(drift) * sign])
    theory = SimpleNamespace(error_by_source={KNOWN.name: [fitted**2], "sensor": [0.09], "gauge": [0.16]})
    monkeypatch.setattr(played, "close", lambda loop, controller: loop.disturbances)
    monkeypatch.setattr(played, "refuse_unstable", asked.append)
    monkeypatch.setattr(played, "edge_s", lambda motion, step_s: 0.0)
    monkeypatch.setattr(played, "resampled", lambda motion, step_s: np.zeros(7981))
    monkeypatch.setattr(played, "play", lambda closed, moved: next(given))
    monkeypatch.setattr(played, "stationary", lambda closed: asked.append(closed) or theory)
    monkeypatch.setattr(played, "_simulated", lambda loop, controller, moved, span: span)
    monkeypatch.setattr(played, "_reason", lambda fit, known, moved, error, step, missing: f"another: {missing:g}")
    fit = SimpleNamespace(motion=recorded_motion(MOVING, 1e-3, "tracker"), disturbance=KNOWN, correlation_s=0.01)
    found = recorded_residual(LOOP.parts, TRACKING, fit, 0.05)
    assert found.reason == reason
    assert (found.played.rms_rad, found.fitted_rms_rad) == (pytest.approx(1.0), pytest.approx(fitted))
    assert found.difference == pytest.approx(1.0 / fitted - 1.0)
    assert (found.played.begin_s, found.played.end_s) == (pytest.approx(0.05), pytest.approx(0.399))
    span = found.simulated_rms_rad
    assert (span.duration_s, span.settle_s, span.seed) == (pytest.approx(0.399), pytest.approx(0.05), 0)
    assert found.beyond_loop_rad == 0.0
    assert asked == [((),), ((KNOWN,),)]


@pytest.mark.parametrize("step_s", [9.9e-8, 10.1])
def test_a_recording_is_played_neither_ten_thousand_times_faster_nor_slower(step_s):
    motion = recorded_motion(MOVING, 1e-3, "tracker")
    with pytest.raises(ValueError, match=f"0.001 s apart, are not played every {step_s:g} s: rates may differ 10000"):
        resampled(motion, step_s)


@pytest.mark.parametrize("level", [-3e-6, 3e-6, 0.0])
@pytest.mark.parametrize("ripple", [0.0, 1e-13])
def test_a_motion_that_stands_still_is_refused_on_either_side_of_rest(level, ripple):
    samples = level * (1.0 + ripple * np.resize([1.0, -1.0], 300))
    with pytest.raises(ValueError, match=rf'^"own" stands still at {level:g} rad; name a channel that moves$'):
        recorded_motion(samples, 1e-3, "own")
    moves = level * (1.0 + 1e-11 * np.resize([1.0, -1.0], 300)) + (1e-20 * np.arange(300) if level == 0.0 else 0.0)
    assert recorded_motion(moves, 1e-3, "own").name == "own"


def test_looking_for_lines_leaves_the_motion_as_it_is():
    time = 1e-3 * np.arange(4000)
    rest = np.sin(2.0 * np.pi * 80.0 * time) + 0.05 * np.random.default_rng(2).standard_normal(time.size)
    kept = rest.copy()
    lines, left = find_lines(rest, 1e-3)
    assert len(lines) == 1 and np.array_equal(rest, kept)
    assert np.std(left) < 0.1 * np.std(rest)
