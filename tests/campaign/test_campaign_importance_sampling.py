"""Tilted runs: their directions, levels and weights, against the tails of linear theory and against plain runs."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from microrad.campaign.rows import importance_sampling as sampling
from microrad.campaign.rows.importance_sampling import (
    PLAIN,
    Proposal,
    drawn,
    end_covariance,
    level_of,
    proposal,
    radius_of,
    runs,
)
from microrad.loop import disturbance
from microrad.loop.controller_study import designs, parts, scenario
from microrad.loop.pointing_loop import ensemble, linear, traces
from microrad.loop.pointing_loop.ensemble import Span
from microrad.loop.pointing_loop.kernel_arrays import LANES
from microrad.loop.pointing_loop.loop import assemble
from microrad.mission.file import load_mission
from scenes import scene_of
from shipped import SHIPPED

SPAN = Span(0.4, 0.05, 3)
BATCHES = 10


@pytest.fixture(scope="module")
def mission():
    return load_mission(SHIPPED)


@pytest.fixture(scope="module")
def scene(mission):
    return scene_of(mission)


@pytest.fixture(scope="module")
def tuned(scene, mission):
    return designs.tune("PI", scene.table, designs.plants(scene, 1)).controller


@pytest.fixture(scope="module")
def controller(scene, mission, tuned):
    return designs.build("PI", scene, tuned)


@pytest.fixture(scope="module")
def gaussian(scene):
    """The linear loop of both axes with the mission's noise alone."""
    return straight(scene.loop)


def straight(loop):
    return parts.without(loop, parts.REFERENCE, parts.HYSTERESIS, parts.QUANTISATION, parts.LIMITS)


def theory(loop, controller, span=SPAN):
    """Standard deviations of the error at the end of the span along its principal axes, the larger one first."""
    total, _ = ensemble.control_samples(loop, span)
    return np.sqrt(np.linalg.eigvalsh(end_covariance(linear.close(loop, controller), total))[::-1])


def many(loop, controller, by, span=SPAN, batches=BATCHES):
    """Radius and weight of so many batches of weighted runs."""
    found = [runs(loop, controller, span, by, LANES * batch) for batch in range(batches)]
    return np.concatenate([r for r, _ in found]), np.exp(np.concatenate([w for _, w in found]))


def beyond(radius, weight, x):
    """Probability of an error beyond x, and its standard error."""
    terms = weight * (radius > x)
    return float(np.mean(terms)), float(np.std(terms, ddof=1)) / math.sqrt(terms.size)


def assert_tail(radius, weight, sigma, probabilities):
    """The probabilities of the radii lie in the interval of 99.7 %, those of a loop with 5 % more error do not."""
    missed = 0
    for probability in probabilities:
        x = radius_of(np.array([-math.log(probability)]), sigma)[0]
        found, error = beyond(radius, weight, x)
        assert abs(found - probability) < 3.0 * error, probability
        assert error < 0.4 * probability
        missed += abs(found - math.exp(-level_of(np.array([x]), 1.05 * sigma)[0][0])) > 3.0 * error
    assert missed > 0


# ------------------------------------------------------------------------------------------------------------- levels


def test_levels_are_those_of_the_normal_and_the_rayleigh_distribution():
    x = np.array([1e-3, 0.5, 1.0, 3.0, 5.25, 8.0])
    assert_allclose(level_of(2.0 * x, np.array([2.0]))[0], -stats.norm.logsf(x) - math.log(2.0), rtol=1e-9, atol=1e-9)
    assert_allclose(level_of(2.0 * x, np.array([2.0, 2.0]))[0], 0.5 * x**2, rtol=1e-12)
    between = level_of(2.0 * x[1:], np.array([2.0, 1.0]))[0]
    assert np.all(between < level_of(2.0 * x[1:], np.array([2.0]))[0])
    assert np.all(between > level_of(2.0 * x[1:], np.array([2.0, 2.0]))[0])


def test_levels_of_unequal_axes_are_those_of_a_weighted_sum_of_squares():
    """P(s1^2 a^2 + s2^2 b^2 > x^2), the inner normal distribution integrated over the outer one."""
    from scipy.integrate import quad

    first, second, x = 2.0, 0.7, 5.0

    def given(a):
        rest = x**2 - (first * a) ** 2
        return stats.norm.pdf(a) * (2.0 * stats.norm.sf(math.sqrt(rest) / second) if rest > 0.0 else 1.0)

    edge = x / first
    wanted = 2.0 * sum(quad(given, *ends, epsabs=0.0, epsrel=1e-11)[0] for ends in ((0, 2), (2, edge), (edge, 12)))
    found = level_of(np.array([x]), np.array([first, second]))[0]
    assert_allclose(found, -math.log(wanted), rtol=1e-8)


@pytest.mark.parametrize("sigma", [[2e-6], [2e-6, 2e-6], [2e-6, 5e-7], [2e-6, 7e-8]])
def test_radius_is_the_inverse_of_the_level_and_the_slope_its_derivative(sigma):
    sigma, level = np.array(sigma), np.array([0.0, 1e-4, 0.1, 1.0, 13.8, 40.0])
    radius = radius_of(level, sigma)
    assert_allclose(level_of(radius, sigma)[0], level, rtol=1e-11, atol=1e-11)
    assert np.all(np.diff(radius) > 0.0)
    step = 1e-5 * radius[1:]
    up, down = (level_of(radius[1:] + move, sigma)[0] for move in (step, -step))
    assert_allclose(level_of(radius[1:], sigma)[1], (up - down) / (2.0 * step), rtol=1e-5)


@pytest.mark.parametrize(("begin", "end"), [(13.3, 14.8), (0.0, 1.5), (2.0, 9.0)])
def test_the_density_of_the_levels_is_one_and_no_weight_is_large(begin, end):
    by = Proposal(0, np.zeros((1, 1, 1)), np.zeros((1, 1, 1)), np.ones(1), begin, end)
    level = np.linspace(0.0, 60.0, 600_001)
    assert np.trapezoid(np.exp(by.log_density(level)), level) == pytest.approx(1.0, abs=1e-4)
    log_weight = -level - by.log_density(level)
    assert log_weight.max() <= -math.log(PLAIN) + 1e-12
    assert log_weight[level > end].max() < 1.0 - begin  # and far out they are as small as the probability


@pytest.mark.promise("campaigns-25")
@pytest.mark.parametrize("sigma", [[1.0], pytest.param([1.0, 1.0], marks=pytest.mark.endurance), [3.0, 1.0]])
def test_what_runs_have_along_the_directions_is_standard_normal_under_their_weights(sigma):
    """Its variances, in all and where one direction alone is rare, and its radius is that of the level."""
    by = Proposal(0, np.zeros((1, 1, 1)), np.zeros((1, 1, 1)), np.array(sigma), 6.0, 8.0)
    found = [drawn(by, 1, LANES * batch) for batch in range(200)]
    unit, weight = np.concatenate([u for u, _ in found], axis=1), np.exp(np.concatenate([w for _, w in found]))
    assert unit.shape == (len(sigma), 200 * LANES)
    for values in unit:
        for terms, wanted in ((weight * values**2, 1.0), (weight * (values > 1.0), stats.norm.sf(1.0))):
            error = np.std(terms) / math.sqrt(terms.size)
            assert abs(np.mean(terms) - wanted) < 4.0 * error
            assert error < 0.06 * wanted
    rare = weight * (unit[0] > 3.0)  # the larger of the two, where the aim is
    assert np.mean(rare) == pytest.approx(stats.norm.sf(3.0), rel=0.15)
    level = level_of(np.sqrt(np.sum((unit.T * by.sigma_rad) ** 2, axis=1)), by.sigma_rad)[0]
    inside = np.abs(level - by.begin) > 1e-6
    assert_allclose(np.log(weight)[inside], (-level - by.log_density(level))[inside], atol=1e-6)


# --------------------------------------------------------------------------------------------------------- directions


@pytest.mark.promise("campaigns-25")
def test_directions_are_orthonormal_and_make_the_error_of_the_linear_loop(gaussian, controller):
    """The runs' errors are those of their levels but for the thousandth of the variance that is left as drawn."""
    sigma = theory(gaussian, controller)
    by = proposal(gaussian, controller, SPAN, 6.0 * sigma[0])
    product = np.einsum("kwa,kwb->ab", by.step, by.step) + np.einsum("kwa,kwb->ab", by.sample, by.sample)
    assert_allclose(product, np.eye(2), atol=1e-12)
    assert_allclose(by.sigma_rad, sigma, rtol=1e-3)
    assert np.all(by.sigma_rad < sigma)
    radius, weight = many(gaussian, controller, by, batches=1)
    level = level_of(radius, by.sigma_rad)[0]
    far = (level > 4.0) & (np.abs(level - by.begin) > 1.0)  # where the density jumps a little is much
    assert 20 < np.sum(far) < LANES
    assert_allclose(np.log(weight[far]), (-level - by.log_density(level))[far], atol=1.0)
    assert np.std(np.log(weight[far])) > 3.0


def test_the_covariance_at_the_end_depends_on_when_the_sensor_last_delivered(scene, controller):
    slow = straight(replace(scene.loop, optical=replace(scene.loop.optical, every=2)))
    closed = linear.close(slow, controller)
    fresh, held = (float(np.trace(end_covariance(closed, total))) for total in (1001, 1002))
    assert fresh != pytest.approx(held, rel=1e-3, abs=0.0)
    assert end_covariance(closed, 1003)[0, 0] == pytest.approx(0.5 * fresh, rel=1e-9, abs=0.0)
    average = float(np.sum(linear.stationary(closed).error))
    assert 0.9 * average < 0.5 * (fresh + held) < 1.1 * average


# --------------------------------------------------------------------------------------------------------------- tails


@pytest.mark.promise("campaigns-25")
def test_the_tail_of_a_gaussian_loop_is_rayleigh(gaussian, controller):
    sigma = theory(gaussian, controller)
    radius, weight = many(gaussian, controller, proposal(gaussian, controller, SPAN, 5.256 * sigma[0]))
    assert_tail(radius, weight, sigma, [1e-1, 1e-3, 1e-5, 1e-6])
    found, error = beyond(radius, weight, 5.256 * sigma[0])
    assert error < 0.045 * found  # 1 / sqrt(640), where as many plain errors would have 40
    assert abs(np.mean(weight) - 1.0) < 3.0 * np.std(weight) / math.sqrt(weight.size)
    assert np.std(weight) < 3.0


def test_the_tail_of_one_axis_is_that_of_the_normal_distribution(scene, tuned):
    loop = straight(scene.axis)
    controller = assemble("PI", loop, tuned)
    sigma = theory(loop, controller)
    by = proposal(loop, controller, SPAN, 4.892 * sigma[0])
    assert by.step.shape[2] == 1
    assert_tail(*many(loop, controller, by), sigma, [1e-2, 1e-4, 1e-6])


def test_the_tail_of_unequal_axes(gaussian, controller):
    """Three times the vibration on one axis, none on the other."""
    louder = tuple(replace(each, C=3.0 * each.C) for each in gaussian.disturbances[0])
    loop = replace(gaussian, disturbances=(louder, ()))
    sigma = theory(loop, controller)
    assert sigma[1] < 0.6 * sigma[0]
    x = radius_of(np.array([-math.log(1e-6)]), sigma)[0]
    assert_tail(*many(loop, controller, proposal(loop, controller, SPAN, x)), sigma, [1e-2, 1e-4, 1e-6])


def test_the_tail_of_coupled_axes(gaussian, controller):
    """The errors of both axes share noise: half of what one mirror axis does turns the other."""
    loop = replace(gaussian, optics=np.array([[1.0, 0.5], [0.5, 1.0]]) @ gaussian.optics)
    covariance = end_covariance(linear.close(loop, controller), 2000)
    assert abs(covariance[0, 1]) > 0.04 * covariance[0, 0]
    sigma = theory(loop, controller)
    x = radius_of(np.array([-math.log(1e-6)]), sigma)[0]
    assert_tail(*many(loop, controller, proposal(loop, controller, SPAN, x)), sigma, [1e-2, 1e-4, 1e-6])


def test_the_tail_behind_a_slow_and_late_sensor(scene, controller):
    """The run ends on a sample without a reading, and one with it."""
    optical = replace(scene.loop.optical, every=2, delay_steps=3)
    loop = straight(replace(scene.loop, optical=optical))
    for samples in (2000, 2001):
        span = replace(SPAN, duration_s=samples * loop.timing.period_s)
        sigma = theory(loop, controller, span)
        x = radius_of(np.array([-math.log(1e-6)]), sigma)[0]
        assert_tail(*many(loop, controller, proposal(loop, controller, span, x), span), sigma, [1e-3, 1e-6])


def test_the_tail_with_a_line(gaussian, controller):
    """A line of random phase on one axis, under noise: by the mean over the phase of the noncentral chi-square."""
    wheel = disturbance.wheels(80.0, [1.0], [1e-9], convention="per-axis")
    loop = replace(gaussian, disturbances=((*gaussian.disturbances[0], wheel), gaussian.disturbances[1]))
    closed = linear.close(loop, controller)
    left = linear.stationary(closed).error_by_source[wheel.name]
    sigma = theory(loop, controller)
    amplitude = math.sqrt(2.0 * left[0]) / sigma[0]
    assert 0.5 < amplitude < 4.0
    x = 5.0 + 0.6 * amplitude
    shifts = (amplitude * np.cos(np.pi * (np.arange(200) + 0.5) / 200)) ** 2
    wanted = float(np.mean(stats.ncx2.sf(x**2, 2, shifts)))
    radius, weight = many(loop, controller, proposal(loop, controller, SPAN, x * sigma[0]), batches=12)
    found, error = beyond(radius, weight, x * sigma[0])
    assert abs(found - wanted) < 3.0 * error
    assert error < 0.3 * wanted
    assert math.exp(-0.5 * x**2) < 0.5 * (found - 3.0 * error)  # and the noise alone has less


@pytest.mark.promise("campaigns-28")
def test_with_hysteresis_and_limits_the_tail_is_that_of_plain_runs(scene, mission, controller):
    loop = scenario.with_mirror(scene.loop, scene.mirrors, "comparison")
    plain = ensemble.simulate(loop, controller, Span(1.6, 0.5, 8), 3 * LANES)
    counts = plain.histogram.astype(float)
    span = Span(1.0, 0.5, 3)
    edges = ensemble.bin_edges_rad()
    total = counts.sum(axis=0)[::-1].cumsum()[::-1] / counts.sum()
    aim = edges[np.searchsorted(-total, -1e-4)]
    radius, weight = many(loop, controller, proposal(loop, controller, span, aim), span)
    sigma, missed = theory(straight(loop), controller), 0
    for probability in (1e-1, 1e-2, 1e-3, 1e-4):
        bin_ = np.searchsorted(-total, -probability)
        share = counts[:, bin_:].sum(axis=1) / plain.samples
        error = np.std(share, ddof=1) / math.sqrt(share.size)
        found, known_error = beyond(radius, weight, edges[bin_])
        assert abs(found - np.mean(share)) < 3.0 * math.hypot(error, known_error), probability
        missed += found - math.exp(-level_of(edges[bin_ : bin_ + 1], sigma)[0][0]) > 3.0 * known_error
    assert missed > 0  # the linear loop has less


# ---------------------------------------------------------------------------------------------------------------- runs


def test_towards_no_error_the_runs_are_plain_bit_for_bit(scene, controller):
    """A trace has the error at the begin of each sample, so one that is a sample longer ends where the run ends."""
    plain = proposal(scene.loop, controller, SPAN, 0.0)
    radius, log_weight = runs(scene.loop, controller, SPAN, plain, 0)
    assert_array_equal(log_weight, np.zeros(LANES))
    longer = replace(SPAN, duration_s=SPAN.duration_s + scene.loop.timing.period_s)
    aimed, _ = runs(scene.loop, controller, SPAN, proposal(scene.loop, controller, SPAN, 5e-6), 0)
    for run in (0, 41):
        error = traces.trace(scene.loop, controller, longer, run).error_rad[-1]
        assert math.sqrt(np.sum(error**2)) == radius[run]
        assert aimed[run] != radius[run]


def test_a_run_does_not_depend_on_its_batch(gaussian, controller):
    by = proposal(gaussian, controller, SPAN, 5e-6)
    one, other = runs(gaussian, controller, SPAN, by, 0), runs(gaussian, controller, SPAN, by, 32)
    for ours, theirs in zip(one, other, strict=True):
        assert_array_equal(ours[32:], theirs[:32])
        assert np.any(ours[:32] != theirs[32:])
    assert len({*one[0].tolist(), *other[0].tolist()}) == 96
    elsewhere = runs(gaussian, controller, replace(SPAN, seed=4), by, 0)
    assert not np.any(elsewhere[0] == one[0])


def test_the_proposal_is_the_same_whatever_the_seed_but_for_its_levels(gaussian, controller):
    one, other = (proposal(gaussian, controller, replace(SPAN, seed=seed), 5e-6) for seed in (1, 2))
    assert_array_equal(one.step, other.step)
    assert one.begin == pytest.approx(other.begin, rel=0.05)


def test_a_beat_comes_between_slices_and_may_end_the_runs(gaussian, controller):
    def stop():
        raise KeyboardInterrupt

    by, beats = proposal(gaussian, controller, SPAN, 5e-6), []
    runs(gaussian, controller, replace(SPAN, duration_s=0.5), by, 0, lambda: beats.append(1))
    assert len(beats) == 2
    with pytest.raises(KeyboardInterrupt):
        runs(gaussian, controller, SPAN, by, 0, stop)


def test_a_loop_without_noise_and_an_unstable_one_are_refused(gaussian, controller):
    quiet = replace(gaussian, disturbances=((), ()), optical=replace(gaussian.optical, noise_rad=0.0), gauge=None)
    with pytest.raises(ValueError, match="no random noise reaches the line of sight"):
        proposal(quiet, controller, SPAN, 5e-6)
    system = controller.system
    wild = replace(controller, system=replace(system, C=30.0 * system.C, D=30.0 * system.D))
    with pytest.raises(ValueError, match="unstable: a pole at"):
        proposal(gaussian, wild, SPAN, 5e-6)
    assert proposal(replace(gaussian, gauge=None), controller, SPAN, 5e-6).sigma_rad.size == 2


def test_what_lines_leave_counts_both_axes(monkeypatch):
    left = {"wheel": np.array([1e-12, 3e-12]), "noise": np.array([9e-12, 9e-12]), "cooler": np.array([2e-12, 0.0])}
    monkeypatch.setattr(sampling.linear, "stationary", lambda closed: SimpleNamespace(error_by_source=left))
    lines = [SimpleNamespace(name=name) for name in ("wheel", "cooler", "wheel")]
    closed = SimpleNamespace(open=SimpleNamespace(lines=lines))
    assert sampling._lines_rad(closed) == pytest.approx(np.sqrt(2.0 * 6e-12), rel=1e-12)


def test_each_reading_beyond_the_fourth_has_a_word_of_the_next_stream(monkeypatch):
    """Two sources of five plant steps a sample, and six readings as of a mirror of four drives."""
    asked = []

    def projected(seed, runs, purpose, first, along):
        asked.append((seed, runs, int(purpose), first, along.tolist()))
        return np.full((2, LANES), float(len(asked)))

    monkeypatch.setattr(sampling, "_projected", projected)
    step, sample = np.arange(40.0).reshape(10, 2, 2), 100.0 + np.arange(24.0).reshape(2, 6, 2)
    by = Proposal(7, step, sample, np.array([2e-6, 1e-6]), 1.0, 2.0)
    p = SimpleNamespace(purpose=[30, 41], seed="seed", steps_per_sample=5)
    assert_array_equal(sampling._projections(p, by, "runs"), np.full((2, LANES), sum(range(1, 9))))
    sources = [("seed", "runs", purpose, 35, step[:, i].tolist()) for i, purpose in enumerate((30, 41))]
    assert asked[:2] == sources
    for reading, (seed, numbered, purpose, first, along) in enumerate(asked[2:]):
        stream, word = divmod(reading, 4)
        assert (seed, numbered, purpose, first) == ("seed", "runs", sampling.kernels.SENSOR_PURPOSE + stream, 28)
        wanted = np.zeros((8, 2))
        wanted[[word, 4 + word]] = sample[:, reading]
        assert along == wanted.tolist()


@pytest.mark.parametrize(("first", "count"), [(0, 8), (5, 1), (6, 19), (8, 16), (11, 30)])
def test_numbers_that_begin_and_end_within_a_slice_are_summed_once_each(monkeypatch, first, count):
    """Number k of run r is k + 100 r here, in slices of eight that begin with four numbers of a word."""
    words = []

    def numbers(seed, runs, purpose, word, found):
        words.append((seed, runs, purpose, word))
        found.reshape(-1, LANES)[:] = 4 * word + np.arange(8.0)[:, None] + 100.0 * np.arange(LANES)

    monkeypatch.setattr(sampling, "SLICE_SAMPLES", 8)
    monkeypatch.setattr(sampling.kernels, "gaussian_kernel", numbers)
    along = np.stack([1.0 + np.arange(count), 0.5 - np.arange(count) ** 2], axis=1)
    found = sampling._projected("seed", "runs", 9, first, along)
    k = first + np.arange(count)
    wanted = [[float(u @ (k + 100.0 * run)) for run in range(LANES)] for u in along.T]
    assert_allclose(found, wanted, rtol=1e-12)
    begin = first // 4
    assert words == [("seed", "runs", 9, word) for word in range(begin, (first + count - 1) // 4 + 1, 2)]


@pytest.mark.parametrize(
    ("total", "settle", "slices"),
    [
        (50, 20, [(0, 8), (8, 16), (16, 20), (20, 28)]),
        (23, 16, [(0, 8), (8, 16), (16, 23)]),
        (8, 0, [(0, 8)]),
        (5, 3, [(0, 3), (3, 5)]),
    ],
)
def test_a_pilot_keeps_the_errors_of_the_first_slice_behind_the_settling_time(monkeypatch, total, settle, slices):
    flown = []

    def fly(p, state, reference, error, trace, shift):
        flown.append(reference)
        assert (p, state, trace.size, shift) == (("arrays", 5), ("start", 0), 0, sampling.kernels.UNSHIFTED)
        if error.size:
            error[:] = np.arange(error.size).reshape(error.shape)
        assert (error.shape == (slices[-1][1] - settle, 3, LANES)) == (reference == slices[-1])

    arrays = SimpleNamespace(
        arrays=lambda loop, controller, seed: ("arrays", seed),
        start=lambda loop, p, run: ("start", run),
        reference=lambda loop, at, end: (at, end),
    )
    monkeypatch.setattr(sampling, "SLICE_SAMPLES", 8)
    monkeypatch.setattr(sampling, "kernel_arrays", arrays)
    monkeypatch.setattr(sampling.ensemble, "control_samples", lambda loop, span: (total, settle))
    monkeypatch.setattr(sampling.kernels, "ensemble_loop", fly)
    found = sampling._pilot(SimpleNamespace(axes=3), "controller", Span(1.0, 0.5, 5))
    assert flown == slices
    assert_array_equal(found.ravel(), np.arange(found.size))


def test_levels_are_aimed_by_the_loop_and_the_straight_one_with_the_same_numbers_of_another_seed(monkeypatch):
    taken, flown = [], []
    monkeypatch.setattr(sampling.parts, "without", lambda loop, *which: taken.append((loop, {*which})) or "straight")
    monkeypatch.setattr(sampling.linear, "straightened", lambda controller, loop: (controller, loop))
    monkeypatch.setattr(sampling.linear, "close", lambda loop, controller: (loop, controller))
    monkeypatch.setattr(sampling, "_lines_rad", lambda closed: ("lines", closed))
    monkeypatch.setattr(sampling, "_pilot", lambda *given: flown.append(given) or f"errors {len(flown)}")
    monkeypatch.setattr(sampling, "_levels", lambda *given: given)
    found = sampling._aim("loop", "controller", Span(0.4, 0.05, 3), 5e-6, "sigma")
    assert found == ("errors 1", "errors 2", ("lines", ("loop", "controller")), 5e-6, "sigma")
    other = Span(0.4, 0.05, 3 ^ 0x54494C54)
    assert flown == [("loop", "controller", other), ("straight", ("controller", "loop"), other)]
    assert taken == [("loop", {parts.REFERENCE, parts.HYSTERESIS, parts.QUANTISATION, parts.LIMITS})]


def test_what_a_number_does_to_the_end_of_a_run_is_what_it_does_step_by_step(monkeypatch):
    """Two phases of the sensor, three unlike plant steps of a sample, two sources, two readings and two axes."""
    draw = np.random.default_rng(5)
    steps = [0.5 * draw.normal(size=(4, 4)) for _ in range(3)]
    samples = [0.5 * draw.normal(size=(4, 4)) for _ in range(2)]
    noise, readings = draw.normal(size=(4, 2)), [draw.normal(size=(4, 2)) for _ in range(2)]
    error = draw.normal(size=(2, 3))
    closed = SimpleNamespace(
        open=SimpleNamespace(error=error, at=SimpleNamespace(order=3)),
        steps=steps, samples=samples, step_noise=noise, sample_noise=readings,
    )  # fmt: skip
    monkeypatch.setattr(sampling, "end_covariance", lambda closed, total: np.eye(2) * 1e9)
    total = 4
    by_step, by_sample = sampling._backwards(closed, total)
    assert (by_step.shape, by_sample.shape) == ((12, 2, 2), (4, 2, 2))

    def end(step=None, sample=None):
        x = np.zeros(4)
        for k in range(total):
            x = samples[k % 2] @ x
            if sample is not None and sample[0] == k:
                x = x + readings[k % 2][:, sample[1]]
            for j, each in enumerate(steps):
                x = each @ x
                if step is not None and step[0] == 3 * k + j:
                    x = x + noise[:, step[1]]
        return error @ x[:3]

    for source in (0, 1):
        for at in range(12):
            np.testing.assert_allclose(by_step[at, source], end(step=(at, source)), rtol=1e-9, atol=1e-12)
        for at in range(4):
            np.testing.assert_allclose(by_sample[at, source], end(sample=(at, source)), rtol=1e-9, atol=1e-12)
    found = float(np.sum(by_step[9:] ** 2) + np.sum(by_sample[3:] ** 2))
    kept = found / sampling.KEPT_VARIANCE / 2.0
    for covariance, length in ((kept * 0.999999, 1), (kept * 1.000001, 2)):
        monkeypatch.setattr(sampling, "end_covariance", lambda closed, total, c=covariance: np.eye(2) * c)
        short = sampling._backwards(closed, total)
        assert [len(each) for each in short] == [3 * length, length]
        np.testing.assert_array_equal(short[0], by_step[-3 * length :])
