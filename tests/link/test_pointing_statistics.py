"""Bias and jitter against closed forms, other quadrature, a million draws and simulated motion; and the refusals."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import erfc, gammainc
from scipy.stats import norm
from scipy.stats import t as student

from microrad.link.pointing import fading as pf
from microrad.link.pointing import statistics as ps
from microrad.link.radial_error import Jitter, radial_survival

URAD = 1e-6
THETA = 10.0 * URAD
EQUAL = Jitter((0.0, 0.0), (3.0 * URAD, 3.0 * URAD))
UNEQUAL = Jitter((0.0, 0.0), (1.0 * URAD, 4.0 * URAD))
BIASED = Jitter((-3.0 * URAD, 5.0 * URAD), (2.5 * URAD, 1.0 * URAD))
ONE_AXIS = Jitter((2.0 * URAD, 1.0 * URAD), (0.0, 3.0 * URAD))
STILL = Jitter((3.0 * URAD, -4.0 * URAD), (0.0, 0.0))
KINDS = {"equal": EQUAL, "unequal": UNEQUAL, "biased": BIASED, "one axis": ONE_AXIS}
each_kind = pytest.mark.parametrize("jitter", KINDS.values(), ids=KINDS.keys())
one_in_a_billion = 1e-9  # relative
db_per_square = 8.685889638065036


def swapped(jitter):
    return Jitter(jitter.bias_rad[::-1], jitter.rms_rad[::-1])


def random(key):
    return np.random.Generator(np.random.Philox(key=key))


# ---- numbers from outside
def test_the_mean_of_equal_axes_is_one_over_one_plus_four_squared_ratios():
    theta = np.array([0.1, 2.0, 10.0, 300.0]) * URAD
    wanted = 1.0 / (1.0 + 4.0 * (3.0 * URAD / theta) ** 2)
    np.testing.assert_allclose(ps.mean_transmission(EQUAL, theta), wanted, rtol=1e-13)


def test_the_mean_comes_out_as_checked_by_hand():
    small = Jitter((0.0, 0.0), (0.7206 * URAD, 0.7206 * URAD))
    assert round(float(ps.mean_transmission(small, THETA)), 5) == 0.97965


def test_equal_axes_follow_the_power_law_of_toyoshima():
    h = np.array([1e-6, 1e-3, 0.1, 0.5, 0.9, 0.999])
    beta = THETA**2 / (4.0 * (3.0 * URAD) ** 2)
    np.testing.assert_allclose(ps.outage_probability(EQUAL, THETA, -10.0 * np.log10(h)), h**beta, rtol=1e-12)


@pytest.mark.parametrize("p", [1e-12, 1e-3, 0.3])
def test_the_best_divergence_for_an_outage_is_two_rms_times_a_root_and_loses_4_343_db(p):
    best = ps.best_divergence_for_outage(EQUAL, p)
    assert best.half_angle_rad == pytest.approx(2.0 * 3.0 * URAD * math.sqrt(math.log(1.0 / p)), rel=one_in_a_billion)
    assert round(best.loss_db, 3) == 4.343
    assert float(ps.outage_loss_db(EQUAL, best.half_angle_rad, p)) == pytest.approx(best.loss_db, rel=one_in_a_billion)
    assert not best.at_limit and best.current_excess_db is None


def test_the_best_divergence_for_a_static_error_is_root_two_times_it():
    best = ps.best_divergence_for_static_error(7.0 * URAD)
    assert best.half_angle_rad == pytest.approx(math.sqrt(2.0) * 7.0 * URAD, rel=1e-14)
    assert round(best.loss_db, 3) == 4.343


def test_a_static_error_loses_8_686_db_times_its_square():
    assert float(ps.mean_loss_db(STILL, THETA)) == pytest.approx(8.686 * 0.25, rel=2e-5)
    assert float(ps.outage_loss_db(STILL, THETA, 0.01)) == pytest.approx(8.686 * 0.25, rel=2e-5)
    assert float(-10.0 * np.log10(ps.transmission(THETA / 2, THETA))) == pytest.approx(8.686 * 0.25, rel=2e-5)


# ---- a million draws
@pytest.mark.promise("link-37", "link-38")
@each_kind
def test_a_million_draws_agree_within_the_99_percent_interval(jitter):
    draws = 1_000_000
    error = jitter.bias_rad + random(7).standard_normal((draws, 2)) * jitter.rms_rad
    radius = np.hypot(error[:, 0], error[:, 1])
    h = np.exp(-2.0 * (radius / THETA) ** 2)
    loss = -10.0 * np.log10(h)
    # the interval covers the 4 figures of a case together
    wide = norm.isf(0.005 / 4)

    def near(measured, wanted, variance):
        assert np.all(np.abs(measured - wanted) <= wide * np.sqrt(variance / draws))

    near(np.mean(h), ps.mean_transmission(jitter, THETA), np.var(h))
    for margin in (1.0, 3.0, 6.0):
        p = ps.outage_probability(jitter, THETA, margin)
        near(np.mean(loss > margin), p, p * (1.0 - p))


# ---- other quadrature
@pytest.mark.promise("link-37")
@each_kind
def test_the_loss_of_an_outage_turns_the_outage_of_a_loss_round_and_shapes_are_kept(jitter):
    p = np.array([1e-20, 1e-12, 1e-3])
    loss = ps.outage_loss_db(jitter, 2 * THETA, p)
    np.testing.assert_allclose(ps.outage_probability(jitter, 2 * THETA, loss), p, rtol=one_in_a_billion)
    assert ps.outage_probability(jitter, np.full((4, 1), THETA), [0.0, 1.0, 3.0]).shape == (4, 3)


@pytest.mark.promise("link-37")
@pytest.mark.parametrize("ratio", [1e-5, 0.1, 1.0, 30.0])
def test_the_mean_agrees_with_quadrature_per_axis(ratio):
    jitter = Jitter((0.4 * ratio * URAD, 0.0), (0.5 * ratio * URAD, ratio * URAD))
    theta = 2.0 * URAD

    product = 1.0
    for bias, rms in zip(jitter.bias_rad, jitter.rms_rad, strict=True):
        x = lambda n, b=bias, s=rms: math.exp(-2.0 * ((b + n * s) / theta) ** 2)  # noqa: E731
        edges = [-9.0, -0.9, -0.05, 0.05, 9.0]
        product *= sum(
            quad(lambda n, x=x: norm.pdf(n) * x(n), *pair, epsabs=0.0, epsrel=1e-10, limit=200)[0]
            for pair in pairwise(edges)
        )
    assert float(ps.mean_transmission(jitter, theta)) == pytest.approx(product, rel=one_in_a_billion)


# ---- best divergence
@pytest.mark.promise("link-37")
def test_the_best_divergence_for_an_outage_of_biased_axes_is_the_best_of_a_sweep():
    best = ps.best_divergence_for_outage(BIASED, 1e-3, current_half_angle_rad=THETA)
    sweep = np.geomspace(1.0, 100.0, 2001) * URAD
    gain = 10.0 * np.log10(8.0 / sweep**2) - ps.outage_loss_db(BIASED, sweep, 1e-3)
    assert best.half_angle_rad == pytest.approx(sweep[np.argmax(gain)], rel=2e-3)
    assert np.max(gain) <= best.gain_db < np.max(gain) + 1e-3
    excess = best.gain_db - (10.0 * math.log10(8.0 / THETA**2) - float(ps.outage_loss_db(BIASED, THETA, 1e-3)))
    assert best.current_excess_db == pytest.approx(excess, abs=1e-9)
    assert excess > 0.0


def test_a_smallest_half_angle_binds_only_from_above_the_best():
    wide = ps.best_divergence_for_static_error(5 * URAD, smallest_half_angle_rad=7.1 * URAD)
    assert (wide.at_limit, wide.half_angle_rad) == (True, 7.1 * URAD)
    assert wide.loss_db == pytest.approx(db_per_square * (5 / 7.1) ** 2)
    free = ps.best_divergence_for_static_error(5 * URAD, smallest_half_angle_rad=7.0 * URAD)
    assert (free.at_limit, free.half_angle_rad) == (False, pytest.approx(math.sqrt(50.0) * URAD))
    at_it = ps.best_divergence_for_static_error(
        3 * URAD, smallest_half_angle_rad=7 * URAD, current_half_angle_rad=7 * URAD
    )
    assert (at_it.at_limit, at_it.current_excess_db) == (True, 0.0)


def test_what_a_larger_aperture_would_allow_is_kept_beside_the_limit():
    for error in (0.0, 3e-6, 5e-6):
        for limit in (7.0 * URAD, 7.1 * URAD, 20.0 * URAD):
            best = ps.best_divergence_for_static_error(error, smallest_half_angle_rad=limit)
            assert best.wanted_half_angle_rad == pytest.approx(math.sqrt(2.0) * error, abs=0.0)
            assert best.half_angle_rad == max(limit, best.wanted_half_angle_rad)


# ---- what the fluctuation costs
def exponential(target):
    a = math.log(0.5 / target)
    return lambda power: 0.5 * np.exp(-a * power)


@pytest.mark.parametrize("rms", [0.3 * URAD, 1.0 * URAD, 2.0 * URAD])
def test_the_uncoded_penalty_meets_the_closed_form_of_an_exponential_error_ratio(rms):
    target, jitter = 1e-9, Jitter((0.0, 0.0), (rms, rms))
    extra = pf.uncoded_penalty_db(jitter, THETA, exponential(target))
    beta, scaled = THETA**2 / (4.0 * rms**2), math.log(0.5 / target) * 10.0 ** (extra / 10.0)
    # mean of exp(-A h) / 2 over the density beta h^(beta - 1)
    log_mean = math.log(0.5 * beta) - beta * math.log(scaled) + math.lgamma(beta) + math.log(gammainc(beta, scaled))
    assert log_mean == pytest.approx(math.log(target), abs=2e-4)
    assert extra > float(ps.mean_loss_db(jitter, THETA))


@pytest.mark.promise("link-37")
def test_the_uncoded_penalty_of_biased_axes_meets_a_sum_over_both_axes():
    def curve(power):
        return 0.5 * erfc(np.sqrt(10.0 * power))

    extra = pf.uncoded_penalty_db(BIASED, 2 * THETA, curve)
    n = np.linspace(-9.0, 9.0, 721)
    x, y = (b + n * s for b, s in zip(BIASED.bias_rad, BIASED.rms_rad, strict=True))
    weight = np.outer(norm.pdf(n), norm.pdf(n)) * (n[1] - n[0]) ** 2
    h = np.exp(-2.0 * (x[:, None] ** 2 + y[None, :] ** 2) / (2 * THETA) ** 2)
    assert np.sum(weight * curve(10.0 ** (extra / 10.0) * h)) == pytest.approx(float(curve(1.0)), rel=1e-4)
    assert pf.mean_error_ratio(BIASED, 2 * THETA, extra, curve) == pytest.approx(float(curve(1.0)), rel=1e-8)
    one_axis = pf.uncoded_penalty_db(ONE_AXIS, 2 * THETA, curve)
    h = np.exp(-2.0 * ((2.0 * URAD) ** 2 + (1.0 * URAD + n * 3.0 * URAD) ** 2) / (2 * THETA) ** 2)
    mean = np.sum(norm.pdf(n) * (n[1] - n[0]) * curve(10.0 ** (one_axis / 10.0) * h))
    assert mean == pytest.approx(float(curve(1.0)), rel=1e-4)


def test_only_a_target_beyond_any_power_is_refused_as_such():
    with pytest.raises(pf.NoPowerError, match="even with 100 dB more power"):
        pf.uncoded_penalty_db(EQUAL, URAD, exponential(1e-9))
    for curve in (lambda p: 1.1 + 0.0 * p, lambda p: 0.1 * p, lambda p: np.nan * p):
        with pytest.raises(ValueError, match="bit error ratio") as refused:
            pf.uncoded_penalty_db(EQUAL, URAD, curve)
        assert not isinstance(refused.value, pf.NoPowerError)


def test_a_ratio_that_has_lost_its_digits_is_no_curve_that_grows():
    falling = np.array([5e-324, 1e-320, 9e-321, 1e-9, 0.5])  # over falling power

    def curve(power):
        return np.interp(np.linspace(0.0, 4.0, power.size), np.arange(5.0), falling)

    assert pf.mean_error_ratio(EQUAL, THETA, 0.0, curve) >= 0.0


def test_without_jitter_every_penalty_is_the_static_loss():
    static = db_per_square * 0.25
    assert pf.uncoded_penalty_db(STILL, THETA, exponential(1e-9)) == pytest.approx(static, abs=1e-8)
    assert pf.uncoded_penalty_db(Jitter((0.0, 0.0), (0.0, 0.0)), THETA, exponential(1e-9)) == 0.0


@pytest.mark.parametrize("rms", [0.1 * URAD, 0.2 * URAD, 0.3 * URAD, 0.5 * URAD])
def test_a_curve_that_is_flat_where_the_power_moves_costs_nothing(rms):
    jitter = Jitter((0.0, 0.0), (rms, 0.5 * rms))
    assert pf.uncoded_penalty_db(jitter, THETA, lambda power: np.where(power > 0.1, 1e-3, 0.5)) == pytest.approx(0.0)


# ---- fades
def test_the_velocity_of_a_known_spectrum_is_its_second_moment():
    freq = np.linspace(0.0, 60.0, 6001)
    psd = np.exp(-((freq / 10.0) ** 2))
    motion = pf.motion_of_spectrum(freq, np.stack([psd, 4.0 * psd]) * 1e-12)
    area = 0.5 * math.sqrt(math.pi) * 10.0
    assert motion.rms_rad == pytest.approx([math.sqrt(area) * URAD, 2.0 * math.sqrt(area) * URAD], rel=1e-6)
    speed = 2.0 * math.pi * math.sqrt(area * 10.0**2 / 2.0) * URAD
    assert motion.velocity_rms_rad_s == pytest.approx([speed, 2.0 * speed], rel=1e-6)
    assert motion.highest_hz == 60.0
    assert max(motion.top_octave_share) < 0.01 and motion.warning == ""


def test_the_top_octave_is_shared_out_as_the_integral_says_on_any_grid():
    # (2 pi f)^2 S is flat from 1 Hz to 9 Hz: half the highest frequency, 4.5 Hz, is no point of the grid
    freq = np.arange(1.0, 10.0)
    motion = pf.motion_of_spectrum(freq, np.stack([freq**-2.0, 0.0 * freq]))
    assert motion.top_octave_share == pytest.approx([4.5 / 8.0, 0.0])
    narrow = pf.motion_of_spectrum([6.0, 9.0], [[1.0, 1.0], [1.0, 1.0]])
    assert narrow.top_octave_share == pytest.approx([1.0, 1.0])


@pytest.mark.promise("link-40")
@pytest.mark.parametrize(("power", "warned"), [(3.0, True), (6.0, False)])
def test_a_spectrum_that_falls_no_faster_than_the_third_power_is_warned_of(power, warned):
    freq = np.geomspace(0.01, 1000.0, 4001)
    psd = 1e-12 / (1.0 + (freq / 3.0) ** power)
    motion = pf.motion_of_spectrum(freq, np.stack([psd, 0.0 * psd]))
    assert ("extend it" in motion.warning) == warned
    further = np.geomspace(0.01, 8000.0, 4001)
    longer = pf.motion_of_spectrum(further, np.stack([1e-12 / (1.0 + (further / 3.0) ** power), 0.0 * further]))
    assert (longer.velocity_rms_rad_s[0] / motion.velocity_rms_rad_s[0] > 1.05) == warned


def test_fades_of_equal_axes_follow_the_rayleigh_level_crossings_of_rice():
    rms, speed = 3.0 * URAD, 200.0 * URAD
    radius = np.array([0.0, 0.01, 1.0, 6.0, 20.0]) * URAD
    rate = pf.level_crossing_rate_hz(EQUAL, (speed, speed), radius)
    wanted = speed / math.sqrt(2.0 * math.pi) * radius / rms**2 * np.exp(-0.5 * (radius / rms) ** 2)
    np.testing.assert_allclose(rate, wanted, rtol=1e-11)
    got = pf.fades(EQUAL, (speed, speed), THETA, db_per_square * (radius / THETA) ** 2)
    np.testing.assert_allclose(got.per_second, wanted, rtol=1e-11)
    np.testing.assert_allclose(got.share_of_time, np.exp(-0.5 * (radius / rms) ** 2), rtol=1e-11)
    duration = math.sqrt(2.0 * math.pi) * rms**2 / (speed * radius[1:])
    np.testing.assert_allclose(got.mean_duration_s[1:], duration, rtol=1e-10)
    assert got.mean_duration_s[0] == math.inf


@pytest.mark.parametrize("order", [lambda jitter: jitter, swapped], ids=["as is", "swapped"])
def test_the_crossing_rate_is_the_integral_round_the_circle(order):
    jitter, velocity = order(BIASED), (70.0 * URAD, 300.0 * URAD)
    a = np.arange(20_000) * 2.0 * math.pi / 20_000
    for radius in np.array([2.0, 6.0, 15.0]) * URAD:
        density = radius * 2.0 * math.pi / a.size
        for trig, b, s in zip((np.cos(a), np.sin(a)), jitter.bias_rad, jitter.rms_rad, strict=True):
            density = density * norm.pdf(radius * trig, b, s)
        outward = np.hypot(velocity[0] * np.cos(a), velocity[1] * np.sin(a)) / math.sqrt(2.0 * math.pi)
        rate = float(pf.level_crossing_rate_hz(jitter, velocity, radius))
        assert rate == pytest.approx(np.sum(density * outward), rel=1e-10)


def test_the_crossing_rate_of_one_axis_is_that_of_a_hardly_moving_other():
    radius = np.array([1.9, 2.5, 5.0, 9.0]) * URAD
    rate = pf.level_crossing_rate_hz(ONE_AXIS, (0.0, 1e-4), radius)
    hardly = Jitter(ONE_AXIS.bias_rad, (1e-5 * URAD, 3.0 * URAD))
    np.testing.assert_allclose(rate, pf.level_crossing_rate_hz(hardly, (1e-12, 1e-4), radius), rtol=1e-6)
    assert rate[0] == 0.0 < rate[1]


def test_a_beam_that_stands_still_never_fades_or_always():
    got = pf.fades(STILL, (0.0, 0.0), THETA, [1.0, 3.0])  # the static loss is 2.17 dB
    assert got.per_second.tolist() == [0.0, 0.0]
    assert got.mean_duration_s.tolist() == [math.inf, 0.0]
    assert got.share_of_time.tolist() == [1.0, 0.0]


def simulated(jitter, corners_hz, key, samples=2**19, step_s=0.004):
    """Errors of two axes with one-sided spectra proportional to exp(-(f / corner)^2), lines drawn at random."""
    freq = np.fft.rfftfreq(samples, step_s)
    noise = random(key).standard_normal((2, 2, freq.size))
    axes = []
    for (re, im), corner, bias, rms in zip(noise, corners_hz, jitter.bias_rad, jitter.rms_rad, strict=True):
        shape = np.exp(-((freq / corner) ** 2))
        shape[0] = 0.0
        # S df is the variance of a line: amplitudes of the two quadratures have it each
        amplitude = rms * np.sqrt(shape / np.sum(shape))
        axes.append(bias + np.fft.irfft(amplitude * (re + 1j * im) * samples / 2.0, samples))
    return np.array(axes)


@pytest.mark.promise("link-37")
@pytest.mark.parametrize("jitter", [UNEQUAL, BIASED, Jitter((1 * URAD, 2 * URAD), (0.0, 3 * URAD))])
def test_simulated_motion_fades_as_often_and_as_long_within_its_99_percent_interval(jitter):
    corners, step_s, blocks, margin_db = (3.0, 1.5), 0.004, 64, 2.5
    freq = np.linspace(0.0, 20.0, 20_001)
    psd = [
        (2.0 * s / (math.sqrt(math.pi) * c)) * s * np.exp(-((freq / c) ** 2))
        for s, c in zip(jitter.rms_rad, corners, strict=True)
    ]
    motion = pf.motion_of_spectrum(freq, psd)
    assert motion.rms_rad == pytest.approx(jitter.rms_rad, rel=1e-6)
    wanted = pf.fades(jitter, motion.velocity_rms_rad_s, THETA, margin_db)

    x, y = simulated(jitter, corners, key=11)
    lost = db_per_square * (x**2 + y**2) / THETA**2 > margin_db
    begins = np.concatenate(([False], ~lost[:-1] & lost[1:]))
    rate = begins.reshape(blocks, -1).mean(axis=1) / step_s
    share = lost.reshape(blocks, -1).mean(axis=1)
    wide = student.isf(0.005, blocks - 1) / math.sqrt(blocks)
    assert abs(rate.mean() - wanted.per_second) <= wide * rate.std(ddof=1)
    assert abs(share.mean() - wanted.share_of_time) <= wide * share.std(ddof=1)
    duration = share.mean() / rate.mean()
    spread = np.std(share - duration * rate, ddof=1) / rate.mean()
    assert abs(duration - wanted.mean_duration_s) <= wide * spread
    assert wide * rate.std(ddof=1) < 0.08 * rate.mean()  # an interval that could tell


# ---- refusals
@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ps.mean_loss_db(EQUAL, 0.0), r"the half angle is 0 rad: it must be finite, above 0 rad"),
        (lambda: ps.mean_transmission(EQUAL, [1e-6, math.nan]), r"the half angle is nan rad: .* above 0 rad"),
        (lambda: ps.mean_loss_db(EQUAL, -1e-6), r"the half angle is -1 µrad: it must be finite, above 0 rad"),
        (lambda: ps.transmission(-1e-6, THETA), r"the radial error is -1 µrad: it must be finite, at least 0 rad"),
        (lambda: ps.outage_loss_db(EQUAL, THETA, math.nan), r"the probability is nan: .* below 1"),
        (lambda: ps.outage_loss_db(EQUAL, 0.0, 0.1), r"the half angle is 0 rad: it must be finite, above 0 rad"),
        (lambda: ps.outage_probability(EQUAL, THETA, -0.1), r"the loss is -0\.1 dB: it must be finite, at least 0 dB"),
        (lambda: ps.outage_probability(EQUAL, -THETA, 1.0), r"the half angle is -10 µrad: .* above 0 rad"),
        (lambda: ps.best_divergence_for_static_error(-1e-6), r"the radial error is -1 µrad: .* at least 0 rad"),
        (lambda: ps.best_divergence_for_static_error(0.0), "give the smallest half angle"),
        (lambda: ps.best_divergence_for_outage(EQUAL, 0.0), r"the probability is 0: .* below 1"),
        (lambda: ps.best_divergence_for_static_error(0.0), "give the smallest half angle"),
        (
            lambda: ps.best_divergence_for_static_error(0.0, smallest_half_angle_rad=-1e-6),
            r"the smallest half angle is -1 µrad: it must be finite, at least 0 rad",
        ),
        (
            lambda: ps.best_divergence_for_static_error(
                1e-6, smallest_half_angle_rad=5e-6, current_half_angle_rad=4.9e-6
            ),
            "the current half angle of 4.9 µrad is below the smallest, 5 µrad",
        ),
        (lambda: ps.best_divergence_for_static_error(1e-6, current_half_angle_rad=0.0), r"the half angle is 0 rad"),
        (lambda: pf.mean_error_ratio(EQUAL, 0.0, 0.0, exponential(1e-9)), r"the half angle is 0 rad: .* above 0 rad"),
        (
            lambda: pf.mean_error_ratio(EQUAL, 1e-200, 0.0, exponential(1e-9)),
            r"the half angle is below 1e-\d+ rad, which",
        ),
        (lambda: pf.mean_error_ratio(EQUAL, THETA, 0.0, lambda p: 0.5), "one value from 0 to 1 for each power"),
        (lambda: pf.mean_error_ratio(EQUAL, THETA, 0.0, lambda p: 1.1 + 0.0 * p), "one value from 0 to 1"),
        (lambda: pf.mean_error_ratio(EQUAL, THETA, 0.0, lambda p: np.nan * p), "one value from 0 to 1"),
        (lambda: pf.mean_error_ratio(EQUAL, THETA, 0.0, lambda p: 0.1 * p), "grows with the power"),
        (lambda: pf.uncoded_penalty_db(EQUAL, THETA, lambda p: 0.0 * p), "the bit error ratio at power 1 is 0;"),
        (lambda: pf.uncoded_penalty_db(EQUAL, URAD, exponential(1e-9)), "even with 100 dB more power"),
        (lambda: pf.motion_of_spectrum([1.0], [[1.0], [1.0]]), "do not fit"),
        (lambda: pf.motion_of_spectrum([1.0, 2.0], [1.0, 1.0]), "do not fit"),
        (lambda: pf.motion_of_spectrum([[1.0, 2.0]], [[1.0, 1.0]] * 2), r"frequencies of shape \(1, 2\) and"),
        (lambda: pf.motion_of_spectrum([1.0, 1.0], [[1.0, 1.0]] * 2), "the frequencies do not rise"),
        (lambda: pf.motion_of_spectrum([-1.0, 1.0], [[1.0, 1.0]] * 2), "the frequencies do not rise"),
        (lambda: pf.motion_of_spectrum([1.0, math.inf], [[1.0, 1.0]] * 2), "the frequencies do not rise"),
        (lambda: pf.motion_of_spectrum([1.0, 2.0], [[1.0, -1.0]] * 2), r"the spectral density is -1 rad\^2/Hz"),
        (lambda: pf.motion_of_spectrum([1.0, 2.0], [[1.0, math.nan]] * 2), r"the spectral density is nan rad\^2/Hz"),
        (lambda: pf.fades(EQUAL, (1e-4, -1e-4), THETA, 3.0), "the velocity rms of axis y is -100 µrad/s"),
        (lambda: pf.fades(EQUAL, (math.nan, 1e-4), THETA, 3.0), "the velocity rms of axis x is nan"),
        (lambda: pf.fades(EQUAL, (1e-4, 0.0), THETA, 3.0), "axis y has a jitter rms of 3 µrad and a velocity rms of 0"),
        (lambda: pf.fades(ONE_AXIS, (1e-4, 1e-4), THETA, 3.0), "axis x has a jitter rms of 0 rad"),
        (lambda: pf.fades(EQUAL, (1e-4, 1e-4), THETA, -3.0), r"the loss is -3 dB: it must be finite, at least 0 dB"),
        (lambda: pf.level_crossing_rate_hz(EQUAL, (1e-4, 1e-4), -1e-6), r"the radial error is -1 µrad"),
    ],
)
def test_what_is_not_possible_is_refused_in_words(call, message):
    with pytest.raises(ValueError, match=message):
        call()


SKEW = Jitter((1.3 * URAD, -2.6 * URAD), (0.9 * URAD, 2.1 * URAD))
SPEED = (0.7e-3, 1.9e-3)
SPECTRUM = pf.motion_of_spectrum(
    [0.5, 2.0, 7.0, 30.0, 80.0], [[3e-13, 2e-13, 5e-14, 3e-15, 1e-16], [7e-13, 1e-13, 9e-14, 1e-14, 3e-15]]
)
ENDS = (
    pf.MovingEnd(SKEW, SPEED, 9.0 * URAD),
    pf.MovingEnd(Jitter((0.4e-6, 0.2e-6), (0.6e-6, 0.3e-6)), (0.2e-3, 0.1e-3), 7.0 * URAD),
)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [*(x * 1e6 for x in SPECTRUM.rms_rad), *(x * 1e6 for x in SPECTRUM.velocity_rms_rad_s),
            *SPECTRUM.top_octave_share, SPECTRUM.highest_hz],
     [1.29884564, 1.59687194, 77.3383928, 185.50526, 0.386518708, 0.693839564, 80.0]),
    (lambda: pf.level_crossing_rate_hz(SKEW, SPEED, [1.0 * URAD, 4.0 * URAD, 8.0 * URAD]),
     [57.9980205, 129.429629, 6.54188395]),
    (lambda: [float(x) for each in [pf.fades(SKEW, SPEED, 9.0 * URAD, [1.5,
            4.0])] for part in (each.per_second, each.mean_duration_s,
            each.share_of_time) for x in part],
     [138.14806, 42.7153959, 0.00263227695, 0.00139327573, 0.363643955, 0.0595143242]),
    (lambda: [float(x) for each in [pf.fades_of_both(*ENDS, 3.0)] for x in (each.per_second,
            each.mean_duration_s, each.share_of_time)],
     [78.8807903, 0.00172822609, 0.13632384]),
    (lambda: [pf.mean_error_ratio(SKEW, 9.0 * URAD, 1.5, lambda power: 0.5 * np.exp(-6.0 * power)),
            pf.uncoded_penalty_db(SKEW, 9.0 * URAD, lambda power: 0.5 * np.exp(-6.0 * power))],
     [0.00447568531, 3.21807978]),
    (lambda: [*ps.mean_loss_db(SKEW, [6e-6, 9e-6]), *ps.outage_probability(SKEW, 9e-6, [0.5, 4.0]),
            *ps.outage_loss_db(SKEW, 9e-6, [0.02, 0.6])],
     [2.52179263, 1.28252258, 0.737415981, 0.0595143242, 5.42622405, 0.79030147]),
    (lambda: [*ps.transmission([2e-6, 5e-6], 9e-6), *ps.radius_of_loss_rad(9e-6, [0.7, 3.0])],
     [0.905955191, 0.539407507, 2.55496159e-06, 5.289273e-06]),
])  # fmt: skip
def test_motions_and_fades_of_numbers_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: pf.motion_of_spectrum([0.5, 2.0, 7.0], [[3e-13, 2e-13, 5e-14]]),
            ValueError,
            (
                "frequencies of shape (3,) and spectral densities of shape (1, 3) do not fit; give "
                "(freqs,) with at least 2 of them, and (2, freqs)"
            ),
        ),
        (
            lambda: pf.motion_of_spectrum([0.5, 7.0, 2.0], [[3e-13, 2e-13, 5e-14]] * 2),
            ValueError,
            "the frequencies do not rise from 0 Hz or above; sort them, each once",
        ),
        (
            lambda: pf.motion_of_spectrum([0.5, 2.0, 7.0], [[3e-13, -2e-13, 5e-14]] * 2),
            ValueError,
            "the spectral density is -2e-13 rad^2/Hz: it must be finite, at least 0 rad^2/Hz",
        ),
        (
            lambda: pf.level_crossing_rate_hz(SKEW, (0.7e-3, 0.0), 1e-6),
            ValueError,
            (
                "axis y has a jitter rms of 2.1 µrad and a velocity rms of 0 rad/s; give both above 0, or "
                "both 0 and the standing error as its bias"
            ),
        ),
        (
            lambda: pf.level_crossing_rate_hz(SKEW, (0.7e-3, -1e-3), 1e-6),
            ValueError,
            "the velocity rms of axis y is -1 mrad/s: it must be finite, at least 0 rad/s",
        ),
        (
            lambda: pf.uncoded_penalty_db(SKEW, 9.0 * URAD, lambda power: 0.0 * power),
            ValueError,
            "the bit error ratio at power 1 is 0; it is the target and must be between 0 and 1",
        ),
        (
            lambda: pf.uncoded_penalty_db(SKEW, 9.0 * URAD, lambda power: 1.0 - np.exp(-power)),
            ValueError,
            "the bit error ratio grows with the power; give a curve that falls",
        ),
        (
            lambda: pf.uncoded_penalty_db(SKEW, 9.0 * URAD, lambda power: 2.0 + 0.0 * power),
            ValueError,
            "the bit error ratio does not give one value from 0 to 1 for each power; correct the curve",
        ),
        (
            lambda: Jitter((1e-6, 2e-6), (1e-6, -2.5e-6)),
            ValueError,
            "the jitter rms is -2.5 µrad: it must be finite, at least 0 rad",
        ),
        (
            lambda: Jitter((1e-6, 2e-6, 3e-6), (1e-6, 2.5e-6)),
            ValueError,
            "the bias is (1e-06, 2e-06, 3e-06) rad; give two values, for axis x and axis y",
        ),
        (lambda: Jitter((1e-6, math.nan), (1e-6, 2.5e-6)), ValueError, "the bias is nan rad: it must be finite"),
    ],
)
def test_a_refusal_of_motions_and_fades_says_its_numbers(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


STOOD = pf.MovingEnd(Jitter((0.3e-6, 1.1e-6), (0.0, 1.4e-6)), (0.0, 0.6e-3), 8.0 * URAD)


def falling(power):
    return 0.5 * np.exp(-4.5 * power)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: [*(m := pf.motion_of_spectrum([0.0, 1.0, 4.0], [[2e-12, 1e-12, 3e-13], [0.0, 0.0, 0.0]])).rms_rad,
            *m.top_octave_share],
     "1.85741756e-06 0 0.768115942 0"),
    (lambda: [*pf.motion_of_spectrum([6.0, 10.0], [[1e-12, 2e-12], [3e-12, 1e-12]]).top_octave_share], "1 1"),
    (lambda: pf.level_crossing_rate_hz(Jitter((1e-6, 2e-6), (0.0, 3e-6)), (0.0, 1e-3), [0.5e-6, 1e-6, 4e-6]),
     "0 0 51.4646313"),
    (lambda: pf.level_crossing_rate_hz(Jitter((1e-6, 2e-6), (3e-6, 0.0)), (1e-3, 0.0), [1.9e-6, 4e-6]), "0 55.3958744"),
    (lambda: pf.level_crossing_rate_hz(Jitter((1e-6, 2e-6), (0.0, 0.0)), (0.0, 0.0), [2e-6]), "0"),
    (lambda: [(f := pf.fades(Jitter((3e-6, 0.0), (0.0, 0.0)), (0.0, 0.0), 9e-6, m)).per_second + f.mean_duration_s +
            f.share_of_time for m in (0.5, 2.0)],
     "inf 0"),
    (lambda: [float((f := pf.fades_of_both(*ENDS[::-1], 3.0)).per_second), float(f.mean_duration_s),
            float(f.share_of_time)],
     "78.8807903 0.00172822609 0.13632384"),
    (lambda: [float((f := pf.fades_of_both(STOOD, ENDS[1], 6.0)).per_second), float(f.mean_duration_s),
            float(f.share_of_time)],
     "0.0331418783 0.00141409509 4.68657672e-05"),
    (lambda: [*STOOD.moved.jitter.rms_rad, *STOOD.moved.velocity_rms_rad_s, STOOD.moved.half_angle_rad],
     "1.4e-08 1.4e-06 6e-06 0.0006 8e-06"),
    (lambda: [pf.mean_error_ratio(Jitter((3e-6, 4e-6), (0.0, 0.0)), 9e-6, 2.0, falling)], "0.0106711444"),
    (lambda: [pf.uncoded_penalty_db(Jitter((3e-6, 4e-6), (0.0, 0.0)), 9e-6, falling),
            pf.uncoded_penalty_db(Jitter((0.0, 0.0), (0.0, 0.0)), 9e-6, falling)],
     "2.68083014 0"),
    (lambda: [pf.penalty_db(np.array([1.5, 0.7]), np.array([0.25, 0.75]), falling), pf.penalty_db(np.array([3.0,
            2.0]), np.array([0.5, 0.5]), falling)],
     "1.26488147 0"),
    (lambda: [(b := ps.best_divergence_for_outage(SKEW, 0.02)).half_angle_rad, b.loss_db, b.gain_db,
            b.wanted_half_angle_rad, b.at_limit],
     "1.00600286e-05 4.34294482 104.635971 1.00600286e-05 0"),
    (lambda: [(b := ps.best_divergence_for_static_error(2e-6, smallest_half_angle_rad=9e-6,
            current_half_angle_rad=1.1e-5)).gain_db, b.current_excess_db, b.at_limit, b.loss_db],
     "109.517117 1.60120754 1 0.428932822"),
    (lambda: [(b := ps.best_divergence_for_static_error(0.0, smallest_half_angle_rad=9e-6)).half_angle_rad, b.loss_db,
            b.wanted_half_angle_rad],
     "9e-06 0 0"),
    (lambda: [ps.mean_loss_db(Jitter((0.0, 0.0), (2e-6, 2e-6)), 7e-6), ps.mean_transmission(Jitter((1e-6, -3e-6),
            (2e-6, 0.0)), 7e-6)],
     "1.22717277 0.583098207"),
    (lambda: [ps.outage_probability(Jitter((0.0, 0.0), (2e-6, 2e-6)), 7e-6, 3.0), ps.outage_loss_db(Jitter((0.0, 0.0),
            (2e-6, 2e-6)), 7e-6, 0.1)],
     "0.120572981 3.26530612"),
    (lambda: ps.transmission([0.0, 7e-6], 7e-6), "1 0.135335283"),
])  # fmt: skip
def test_motions_and_fades_at_their_edges_have_these_numbers(found, expected):
    assert list(found()) == pytest.approx([float(each) for each in expected.split()], rel=1e-6, abs=0.0, nan_ok=True)


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: pf.motion_of_spectrum([1.0], [[1.0], [1.0]]),
     "frequencies of shape (1,) and spectral densities of shape (2, 1) do not fit; give (freqs,) with at least 2 "
     "of them, and (2, freqs)"),
    (lambda: pf.motion_of_spectrum([1.0, 2.0], [[1.0, 1.0]]),
     "frequencies of shape (2,) and spectral densities of shape (1, 2) do not fit; give (freqs,) with at least 2 "
     "of them, and (2, freqs)"),
    (lambda: pf.motion_of_spectrum([1.0, 1.0], [[1.0, 1.0], [1.0, 1.0]]),
     "the frequencies do not rise from 0 Hz or above; sort them, each once"),
    (lambda: pf.motion_of_spectrum([-1.0, 1.0], [[1.0, 1.0], [1.0, 1.0]]),
     "the frequencies do not rise from 0 Hz or above; sort them, each once"),
    (lambda: pf.motion_of_spectrum([0.0, math.inf], [[1.0, 1.0], [1.0, 1.0]]),
     "the frequencies do not rise from 0 Hz or above; sort them, each once"),
    (lambda: pf.motion_of_spectrum([0.0, 1.0], [[1.0, -1.0], [1.0, 1.0]]),
     "the spectral density is -1 rad^2/Hz: it must be finite, at least 0 rad^2/Hz"),
    (lambda: pf.level_crossing_rate_hz(SKEW, (0.7e-3, 0.0), 1e-6),
     "axis y has a jitter rms of 2.1 µrad and a velocity rms of 0 rad/s; give both above 0, or both 0 and the "
     "standing error as its bias"),
    (lambda: pf.level_crossing_rate_hz(SKEW, (0.7e-3, -1e-3), 1e-6),
     "the velocity rms of axis y is -1 mrad/s: it must be finite, at least 0 rad/s"),
    (lambda: pf.level_crossing_rate_hz(Jitter((0.0, 0.0), (0.0, 1e-6)), (2e-3, 1e-3), 1e-6),
     "axis x has a jitter rms of 0 rad and a velocity rms of 2 mrad/s; give both above 0, or both 0 and the "
     "standing error as its bias"),
    (lambda: pf.level_crossing_rate_hz(SKEW, SPEED, -1e-6),
     "the radial error is -1 µrad: it must be finite, at least 0 rad"),
    (lambda: pf.mean_error_ratio(SKEW, 9e-6, 0.0, lambda power: power[:3]),
     "the bit error ratio does not give one value from 0 to 1 for each power; correct the curve"),
    (lambda: pf.mean_error_ratio(SKEW, 9e-6, 0.0, lambda power: 1.5 - power),
     "the bit error ratio does not give one value from 0 to 1 for each power; correct the curve"),
    (lambda: pf.mean_error_ratio(SKEW, 9e-6, 0.0, lambda power: 0.2 + 0.1 * power),
     "the bit error ratio grows with the power; give a curve that falls"),
    (lambda: pf.penalty_db(np.ones(1), np.ones(1), lambda power: 0.0 * power),
     "the bit error ratio at power 1 is 0; it is the target and must be between 0 and 1"),
    (lambda: pf.penalty_db(np.ones(1), np.ones(1), lambda power: 1.0 + 0.0 * power),
     "the bit error ratio at power 1 is 1; it is the target and must be between 0 and 1"),
    (lambda: pf.penalty_db(np.array([1.0, 0.0]), np.array([0.5, 0.5]), falling),
     "the mean bit error ratio stays above 0.0055545 even with 100 dB more power; widen the beam or reduce the "
     "jitter"),
    (lambda: ps.best_divergence_for_static_error(0.0),
     "the received power grows without end as the beam narrows (half angle 0 rad); give the smallest half angle, "
     "the diffraction limit of the aperture"),
    (lambda: ps.best_divergence_for_static_error(-1e-6),
     "the radial error is -1 µrad: it must be finite, at least 0 rad"),
    (lambda: ps.best_divergence_for_static_error(1e-6, smallest_half_angle_rad=9e-6, current_half_angle_rad=8e-6),
     "the current half angle of 8 µrad is below the smallest, 9 µrad; correct one of them"),
    (lambda: ps.best_divergence_for_static_error(1e-6, current_half_angle_rad=0.0),
     "the half angle is 0 rad: it must be finite, above 0 rad; it is that of a beam at 1/e^2"),
    (lambda: ps.best_divergence_for_outage(SKEW, 0.0),
     "the probability is 0: it must be finite, at least 1e-20 and below 1"),
    (lambda: ps.radius_of_loss_rad(9e-6, -0.1), "the loss is -0.1 dB: it must be finite, at least 0 dB"),
    (lambda: ps.transmission(1e-6, 0.0),
     "the half angle is 0 rad: it must be finite, above 0 rad; it is that of a beam at 1/e^2"),
    (lambda: ps.mean_loss_db(SKEW, -1e-6),
     "the half angle is -1 µrad: it must be finite, above 0 rad; it is that of a beam at 1/e^2"),
])  # fmt: skip
def test_a_refusal_of_a_motion_or_a_divergence_is_one_whole_sentence(found, expected):
    with pytest.raises((ValueError, ArithmeticError)) as refused:
        found()
    assert str(refused.value) == expected


@pytest.mark.parametrize(("found", "expected"), [
    (lambda: SPECTRUM.warning,
     "69 % of the velocity variance lies in the octave below 80 Hz: rate and duration of fades hang on where the "
     "spectrum ends; extend it until it falls faster than 1/f^3, or state the bandwidth that counts"),
    (lambda: pf.SpectralMotion((1e-6, 1e-6), (1.0, 1.0), (0.1, 0.05), 80.0).warning, ""),
    (lambda: pf.SpectralMotion((1e-6, 1e-6), (1.0, 1.0), (0.02, 0.126), 1234.5).warning,
     "13 % of the velocity variance lies in the octave below 1.234 kHz: rate and duration of fades hang on where "
     "the spectrum ends; extend it until it falls faster than 1/f^3, or state the bandwidth that counts"),
])  # fmt: skip
def test_a_spectrum_that_ends_too_early_says_how_much_of_its_motion_that_is(found, expected):
    assert found() == expected


@pytest.mark.parametrize("rms_urad", [(3.0, 0.0), (0.0, 3.0), (3.0, 1.5), (2.0, 2.0)])
def test_neither_the_side_of_a_bias_nor_the_order_of_the_axes_counts(rms_urad):
    """Of an axis that stands still, too; its velocity goes with each axis."""
    bias, speed = (1.2, 2.1), tuple(100.0 * rms * (1.0 + axis) for axis, rms in enumerate(rms_urad))
    radius = np.array([0.5, 1.9, 2.5, 4.0, 9.0]) * URAD

    def found(x, y, first=0):
        order = [first, 1 - first]
        of_axes = [[values[axis] * URAD for axis in order] for values in ((x * bias[0], y * bias[1]), rms_urad, speed)]
        jitter, velocity = Jitter(tuple(of_axes[0]), tuple(of_axes[1])), tuple(of_axes[2])
        return np.array([pf.level_crossing_rate_hz(jitter, velocity, radius), radial_survival(jitter, radius)])

    wanted = found(1.0, 1.0)
    assert np.count_nonzero(wanted[0]) >= 3
    for x, y in ((1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
        np.testing.assert_allclose(found(x, y), wanted, rtol=1e-9, atol=1e-300)
        np.testing.assert_allclose(found(x, y, 1), wanted, rtol=1e-9, atol=1e-300)


@pytest.mark.parametrize(("margin_db", "rms_urad", "speed", "lasting_s"), [
    (4000.0, (2.0, 0.3), 1e-4, 0.0),  # no error comes so far
    (1.0, (4.0, 4.0), 0.0, math.inf),  # nothing moves
])  # fmt: skip
def test_fades_of_both_ends_that_never_begin_last_for_ever_or_are_not_there(margin_db, rms_urad, speed, lasting_s):
    ends = [pf.MovingEnd(Jitter((1e-7, 0.0), (rms * URAD, rms * URAD)), (speed, speed), 9.0 * URAD) for rms in rms_urad]
    found = pf.fades_of_both(*ends, margin_db)
    assert (float(found.per_second), float(found.mean_duration_s)) == (0.0, lasting_s)
    assert float(found.share_of_time) > 0.9 if lasting_s else float(found.share_of_time) == 0.0


@pytest.mark.parametrize(
    "curve",
    [
        lambda power: -0.1 + 0.0 * power,
        lambda power: np.where(power < 0.5, 0.2, -1e-3),
        lambda power: np.where(power < 0.5, 1.001, 0.1),
        lambda power: np.append(0.0 * power, 0.0),
        lambda power: (0.0 * power)[1:],
    ],
)
def test_a_curve_of_errors_has_one_ratio_for_each_power_neither_below_nothing_nor_above_one(curve):
    with pytest.raises(
        ValueError, match="the bit error ratio does not give one value from 0 to 1 for each power; corr"
    ):
        pf.mean_error_ratio(SKEW, 9.0 * URAD, 0.0, curve)


@pytest.mark.parametrize(
    ("freq_hz", "psd", "said"),
    [
        ([1.0, 2.0, 3.0], [[1.0] * 4] * 2, "frequencies of shape (3,) and spectral densities of shape (2, 4) do not"),
        ([1.0, 2.0, 3.0], [[1.0] * 2] * 2, "frequencies of shape (3,) and spectral densities of shape (2, 2) do not"),
        ([1.0, 2.0], [[1.0] * 2] * 3, "frequencies of shape (2,) and spectral densities of shape (3, 2) do not fit"),
        ([[1.0, 2.0]], [[1.0] * 2] * 2, "frequencies of shape (1, 2) and spectral densities of shape (2, 2) do not"),
        ([1.0, math.nan], [[1.0] * 2] * 2, "the frequencies do not rise from 0 Hz or above; sort them, each once"),
        ([-math.inf, 1.0], [[1.0] * 2] * 2, "the frequencies do not rise from 0 Hz or above; sort them, each once"),
        ([1.0, 2.0], [[1.0] * 2, [1.0, math.inf]], "the spectral density is inf rad^2/Hz: it must be finite"),
    ],
)
def test_a_spectrum_of_too_many_or_too_few_rows_or_of_no_numbers_is_refused(freq_hz, psd, said):
    with pytest.raises(ValueError) as refused:
        pf.motion_of_spectrum(freq_hz, psd)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("rms", "velocity", "axis"),
    [((3.0, 2.0), (0.0, 1e-4), "x"), ((3.0, 2.0), (1e-4, 0.0), "y"), ((0.0, 2.0), (1e-4, 1e-4), "x"),
     ((3.0, 0.0), (1e-4, 1e-4), "y")],
)  # fmt: skip
def test_an_axis_that_moves_has_a_velocity_and_one_that_does_not_has_none(rms, velocity, axis):
    jitter = Jitter((0.0, 0.0), tuple(each * URAD for each in rms))
    with pytest.raises(ValueError, match=f"^axis {axis} has a jitter rms of .*; give both above 0, or both 0"):
        pf.fades(jitter, velocity, THETA, 3.0)


@pytest.mark.parametrize(("freq", "share"), [([5.0, 10.0], 1.0), ([5.0, 7.0, 10.0], 1.0), ([4.0, 5.0, 10.0], None)])
def test_a_grid_with_a_point_at_half_its_highest_frequency_has_all_of_the_top_octave(freq, share):
    """Of a density of one value: its speed rises as the square of the frequency, and is straight between the points."""
    motion = pf.motion_of_spectrum(freq, np.full((2, len(freq)), 1e-12))
    if share is None:
        below, above = (4.0**2 + 5.0**2) / 2, 5.0 * (5.0**2 + 10.0**2) / 2
        share = above / (below + above)
    assert motion.top_octave_share == pytest.approx([share, share], rel=1e-12)
