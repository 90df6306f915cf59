"""The models as records: what their scalars say against simulations of them, and what their inverses leave over."""

from dataclasses import replace
from itertools import product
from math import exp, inf, log, nan, pi

import numpy as np
import pytest
from numpy.testing import assert_allclose

from loops import IDEAL_DRIVE, side_by_side
from microrad.core import kernels
from microrad.loop import control
from microrad.loop import sine_run as simulate
from microrad.mirror import hysteresis
from microrad.mirror import model as mirror
from microrad.mirror.hysteresis import NO_CREEP, BoucWen, Creep, PrandtlIshlinskii

PRINTED = BoucWen(0.089e-3, -2.96e-7, -0.048e-3, 4.7e-4, 38.421, 34.635, 3770.0, 6.0)  # section 3.3 of the paper
ADMISSIBLE = replace(PRINTED, epsilon_rad_v=-0.022e-3, alpha_1_v=2.4, beta_1_v=0.6)
PLAYS = PrandtlIshlinskii((0.0, 0.4, 1.5), (0.06e-3, 0.02e-3, 0.009e-3))
WIDENING = replace(PLAYS, widening_s=1e-3)
SYMMETRIC, ASYMMETRIES = (0.0, 0.0), [(0.5, -0.7), (-0.6, 0.4), (0.9, 0.0), (0.0, 0.9)]
EXPONENTS = [1.0, 1.5, 2.0, 3.0]
PERIOD = 20e-6
SIGNS = (1.0, -1.0)


def asymmetric(model, gamma_eta, exponent=1.0):
    return replace(model, gamma_1_v=gamma_eta[0], eta_1_v=gamma_eta[1], exponent=exponent)


def respond(model, drive, step_s, h0=0.0):
    """Output and hysteresis of the compiled model; without d2, which is a lag, and about a bias of 0."""
    row = np.array(replace(model, d2_s_v=0.0, bias_v=0.0).row)
    return kernels.bouc_wen_response(np.asarray(drive, dtype=float), step_s, row, h0)[:2]


def slowest_decay(model):
    return min(model.decay_1_v(rising, sign) for rising, sign in product(SIGNS, SIGNS))


def branch(model, rising, rate_v_s=1e-3):
    """h at the end of a ramp that is long enough for every model here."""
    ramp = rising * np.linspace(0.0, 40.0 / slowest_decay(model), 4001)
    return respond(model, ramp, abs(ramp[1]) / rate_v_s)[1][-1]


def numerical_reversal_slope(model, rising, rate_v_s=1e-3):
    travel = 1e-7
    y, _ = respond(model, [0.0, -rising * travel], travel / rate_v_s, branch(model, rising, rate_v_s))
    return (y[1] - y[0]) / (-rising * travel)


by_exponent = pytest.mark.parametrize("exponent", EXPONENTS)
by_asymmetry = pytest.mark.parametrize("gamma_eta", [SYMMETRIC, *ASYMMETRIES], ids=str)
by_epsilon = pytest.mark.parametrize("epsilon", [-0.022e-3, 0.022e-3])


# ------------------------------------------------------------------------------------------------ branches and slopes


@pytest.mark.promise("hysteresis-3", "hysteresis-10")
@by_exponent
@by_asymmetry
@by_epsilon
def test_both_branches_settle_where_the_record_says(epsilon, gamma_eta, exponent):
    model = asymmetric(replace(ADMISSIBLE, epsilon_rad_v=epsilon), gamma_eta, exponent)
    found = [branch(model, rising) for rising in SIGNS]
    assert_allclose([model.settled_branch_rad(rising) for rising in SIGNS], found, rtol=1e-6)
    assert_allclose(model.settled_rad, np.max(np.abs(found)), rtol=1e-6)
    assert (abs(found[0] + found[1]) > 1e-7) == (gamma_eta != SYMMETRIC)


@by_exponent
@by_asymmetry
@by_epsilon
@pytest.mark.parametrize("rate_v_s", [1e-3, 900.0, 9000.0])
def test_the_slope_behind_a_reversal_is_the_lower_of_both_directions(epsilon, gamma_eta, exponent, rate_v_s):
    model = asymmetric(replace(ADMISSIBLE, epsilon_rad_v=epsilon), gamma_eta, exponent)
    found = [numerical_reversal_slope(model, rising, rate_v_s) for rising in SIGNS]
    assert_allclose(model.reversal_slope_rad_v(rate_v_s), min(found), rtol=1e-4, atol=1e-9)
    assert (abs(found[0] - found[1]) > 1e-6) == (gamma_eta != SYMMETRIC)


@by_exponent
@pytest.mark.parametrize("gamma_eta", ASYMMETRIES, ids=str)
def test_the_fastest_admissible_reversal_of_an_asymmetric_model(gamma_eta, exponent):
    """In one of the two directions the slope passes through 0 at that rate; in the other it is still positive."""
    model = asymmetric(ADMISSIBLE, gamma_eta, exponent)
    swing = model.d1_rad_v - model.reversal_slope_rad_v()
    model = replace(model, epsilon_rad_v=0.5 * model.d1_rad_v / swing * model.epsilon_rad_v)
    rate = model.admissible_rate_v_s
    assert_allclose(rate, log(2) / 4.7e-4, rtol=1e-12)  # where the growth doubles a swing of half d1
    below, above = (min(numerical_reversal_slope(model, r, share * rate) for r in SIGNS) for share in (0.99, 1.01))
    assert below > 1e-8
    assert above < -1e-8
    assert max(numerical_reversal_slope(model, r, rate) for r in SIGNS) > 1e-7


def test_a_model_that_is_admissible_in_one_direction_only_is_not():
    model = asymmetric(replace(ADMISSIBLE, epsilon_rad_v=-0.03e-3), (0.5, -0.7))
    slopes = [numerical_reversal_slope(model, rising) for rising in SIGNS]
    assert min(slopes) < -1e-6
    assert max(slopes) > 1e-6
    assert model.admissible_rate_v_s == 0.0
    assert model.wrong_way_rad > 0.0


# ------------------------------------------------------------------------------------------------ the wrong way


def wrong_way(model):
    """How far the output moves against a slow drive behind a settled branch, the worse of both, by simulation."""
    found = []
    for rising in SIGNS:
        back = 12.0 / slowest_decay(model) * np.linspace(0.0, 1.0, 10_001) ** 2  # closer where it turns
        y, _ = respond(replace(model, delta_s_v=0.0), -rising * back, 1e3, branch(model, rising))
        found.append(np.max(rising * (y - y[0])))
    return max(found)


def random_models(exponent, count=25):
    """Models of any asymmetry that stay bounded, the drive term from a twentieth of d1 to seven times it."""
    rng = np.random.default_rng(7)
    while count:
        alpha = 10 ** rng.uniform(0, 1.5)
        beta, gamma, eta = rng.uniform(-1, 1, 3) * alpha
        model = BoucWen(0.089e-3, 0.0, -(10 ** rng.uniform(-5.3, -3.2)), 0.0, alpha, beta)
        model = asymmetric(model, (gamma, eta), exponent)
        if slowest_decay(model) > 0.05 * alpha:
            count -= 1
            yield model


@pytest.mark.parametrize(
    "exponent",
    [pytest.param(e, marks=pytest.mark.endurance if e in (1.5, 3.0) else ()) for e in EXPONENTS],
)
def test_how_far_an_asymmetric_model_moves_the_wrong_way(exponent):
    found, wrong = [], []
    for model in random_models(exponent):
        found.append(model.wrong_way_rad / model.settled_rad)
        wrong.append(wrong_way(model) / model.settled_rad)
        assert (found[-1] > 0.0) == (model.reversal_slope_rad_v() < 0.0)
    print(f"wrong way over settled size: {min(wrong):.3f} to {max(wrong):.3f}")
    assert_allclose(found, wrong, rtol=0, atol=1e-5)
    assert min(wrong) < 1e-9
    assert max(wrong) > 0.5


# ------------------------------------------------------------------------------------------------ the steepest slope


def steepest_found(model, rng, trials=100):
    """Largest |dz/dq| at constant rate met by a random walk of rates within the limit, settled branches included."""
    row, little = np.array(model.row), 1e-6
    h, steepest = 0.0, 0.0
    for _ in range(trials):
        rates = model.rate_limit_v_s * np.array([rng.choice([1.0, rng.uniform(), 1e-4]) for _ in range(2)])
        travel = rng.choice(SIGNS) * 10 ** rng.uniform(-3, 1.5)
        h = kernels.bouc_wen_response(np.array([0.0, travel]), abs(travel) / rates[0], row, h)[1][-1]
        drive = rng.choice(SIGNS) * little * np.arange(3)
        z, _, _ = kernels.bouc_wen_response(drive, little / rates[1], row, h)
        steepest = max(steepest, abs(z[2] - z[1]) / little)
    return steepest


@pytest.mark.parametrize("delta", [4.7e-4, 0.0, -4.7e-4])
def test_no_slope_in_any_loop_is_above_the_steepest(delta):
    rng, shares = np.random.default_rng(17), []
    for exponent in EXPONENTS:
        for model in random_models(exponent, 8):
            fast = replace(model, delta_s_v=delta, d2_s_v=-1e-5, rate_limit_v_s=3000.0)
            shares.append(steepest_found(fast, rng) / hysteresis.steepest_slope(fast))
    print(f"steepest slope found: {min(shares):.3f} to {max(shares):.3f} of the bound")
    assert max(shares) <= 1.0 + 1e-6
    assert max(shares) > 0.7  # a bound, and not far off


def test_the_steepest_slope_of_plays_is_met_when_all_move():
    """Positive weights: all plays engaged. A negative weight counts by its size."""
    drive = np.linspace(0.0, 5.0, 501)
    z = kernels.play_response(drive, np.array(PLAYS.thresholds_v), np.zeros(3)) @ np.array(PLAYS.weights_rad_v)
    assert_allclose(np.max(np.diff(z)) / drive[1], hysteresis.steepest_slope(PLAYS), rtol=1e-9)
    mixed = replace(PLAYS, weights_rad_v=(0.06e-3, -0.02e-3, 0.009e-3))
    assert hysteresis.steepest_slope(mixed) == pytest.approx(0.089e-3)


def test_plays_that_depend_on_the_rate_have_no_steepest_slope():
    with pytest.raises(ValueError, match="that is fed back cannot depend on the rate: within a step it has no slope"):
        hysteresis.steepest_slope(replace(PLAYS, widening_s=1e-3))


def test_a_polynomial_adds_to_the_steepest_slope_what_it_has_at_its_reach():
    bent = replace(PLAYS, polynomial_rad=(2e-5, -1e-5, 3e-5), reach_v=2.0)
    added = hysteresis.steepest_slope(bent) - hysteresis.steepest_slope(PLAYS)
    q = np.linspace(-3.0, 3.0, 60001)
    s = np.clip(q / 2.0, -1.0, 1.0)
    slopes = np.gradient(2e-5 * s**2 - 1e-5 * np.abs(s) * s + 3e-5 * s**3, q)
    assert added == pytest.approx((2 * 2e-5 + 2 * 1e-5 + 3 * 3e-5) / 2.0)
    assert 0.4 * added < np.abs(slopes).max() <= added
    twice = hysteresis.scaled(bent, 2.0)
    assert twice.polynomial_rad == (4e-5, -2e-5, 6e-5) and twice.reach_v == 2.0


@pytest.mark.promise("hysteretic-stiffness-2", "mirror-file-48", "mirror-file-49")
def test_a_polynomial_is_added_to_the_plays_and_keeps_its_value_beyond_its_reach():
    """Of either sign it hardens or softens; far beyond its reach it is what it was there."""
    drive = np.array([0.5, 1.0, 2.0, 2.5, 40.0, -1.0, -2.0, -9.0])
    plain = PLAYS.response(drive, 1e-3)
    for c1, c2, c3 in ((2e-5, -1e-5, 3e-5), (-2e-5, 1e-5, -3e-5)):
        bent = replace(PLAYS, polynomial_rad=(c1, c2, c3), reach_v=2.0)
        s = np.clip(drive / 2.0, -1.0, 1.0)
        added = bent.response(drive, 1e-3) - plain
        assert_allclose(added, c1 * s**2 + c2 * np.abs(s) * s + c3 * s**3, rtol=0, atol=1e-17)
        assert added[2] == pytest.approx(added[4]) and abs(added[4]) == pytest.approx(4e-5)
    middle = replace(PLAYS, weights_rad_v=(0.0,) * 3, polynomial_rad=(0.0, -1e-5, 0.0), reach_v=2.0)
    softer = middle.response(drive[:3], 1e-3) / drive[:3]
    assert_allclose(softer / softer[0], [1.0, 2.0, 4.0], rtol=1e-12)  # in proportion to the amplitude


def test_without_rate_limit_a_rate_dependent_model_has_no_steepest_slope():
    with pytest.raises(ValueError, match="depends on rate needs a finite rate limit"):
        hysteresis.steepest_slope(replace(PRINTED, rate_limit_v_s=inf))
    assert hysteresis.steepest_slope(replace(PRINTED, rate_limit_v_s=inf, delta_s_v=0.0, d2_s_v=0.0)) < 2e-3


# ------------------------------------------------------------------------------------------------ records


@pytest.mark.promise("hysteresis-8", "hysteresis-9")
def test_the_growth_with_the_rate_means_nothing_beyond_the_rates_that_were_recorded():
    """What the rate of a sine of 6 V multiplies epsilon by, at 100 Hz and at 1 kHz, and held at the limit."""
    free = replace(PRINTED, rate_limit_v_s=inf)
    swing = free.reversal_slope_rad_v() - free.d1_rad_v

    def growth(model, freq_hz):
        return (model.reversal_slope_rad_v(2 * pi * freq_hz * 6.0) - model.d1_rad_v) / swing

    assert_allclose([growth(free, 100.0), growth(free, 1000.0)], [5.9, 5e7], rtol=0.02)
    assert_allclose(growth(PRINTED, 1000.0), 5.9, rtol=0.02)


@pytest.mark.promise("hysteresis-13")
def test_of_epsilon_alpha_and_beta_a_slow_record_fixes_one_combination():
    """epsilon / (alpha - beta), where h settles, by the errors of least squares in equal noise on three slow sines."""
    drive = np.concatenate([np.sin(2 * pi * np.arange(1, 401) / 200) * amplitude for amplitude in (2.0, 4.0, 6.0)])
    names = ("epsilon_rad_v", "alpha_1_v", "beta_1_v")

    def h(**factors):
        return respond(replace(PRINTED, **{n: f * getattr(PRINTED, n) for n, f in factors.items()}), drive, 1.0)[1]

    slopes = np.column_stack([(h(**{name: 1.001}) - h(**{name: 0.999})) / 0.002 for name in names])
    covariance = np.linalg.inv(slopes.T @ slopes)  # of relative errors, times the noise's variance
    difference = PRINTED.alpha_1_v - PRINTED.beta_1_v
    combined = np.array([1.0, -PRINTED.alpha_1_v / difference, PRINTED.beta_1_v / difference])
    errors = np.sqrt(np.diag(covariance))
    assert np.sqrt(combined @ covariance @ combined) < 0.2 * np.min(errors)
    assert np.max(np.abs(np.triu(covariance / np.outer(errors, errors), 1))) > 0.9


@by_exponent
def test_a_scaled_model_has_its_output_scaled(exponent):
    model = asymmetric(ADMISSIBLE, (0.5, -0.7), exponent)
    drive = 6 * np.sin(2 * pi * 80 * PERIOD * np.arange(2000))
    output, twice = (respond(m, drive, PERIOD)[0] for m in (model, hysteresis.scaled(model, 2.0)))
    assert_allclose(twice, 2 * output, rtol=1e-9, atol=1e-15)
    assert np.ptp(output) > 1e-4


def test_a_row_is_in_the_order_of_the_kernels_columns():
    model = asymmetric(PRINTED, (2.0, -1.0), 2.5)
    row = np.array(model.row)
    for column, value in {
        kernels.D1: 0.089e-3, kernels.D2: -2.96e-7, kernels.EPSILON: -0.048e-3, kernels.DELTA: 4.7e-4,
        kernels.ALPHA: 38.421, kernels.BETA: 34.635, kernels.RATE_LIMIT: 3770.0, kernels.BIAS: 6.0,
        kernels.GAMMA: 2.0, kernels.ETA: -1.0, kernels.POWER: 1.5, kernels.PER_SIZE: 38.421 / 0.048e-3,
    }.items():  # fmt: skip
        assert row[column] == pytest.approx(value, rel=1e-15)
    assert row.size == 12
    assert replace(model, epsilon_rad_v=0.0).row[kernels.PER_SIZE] == 0.0


# ------------------------------------------------------------------------------------------------ inverses


def feedforward_alone(model, reference, inverse=True, creep=NO_CREEP, invert_creep=True):
    """A static mirror under a feedforward without feedback, behind an ideal amplifier: error of each sample, trace.

    ``inverse`` False divides by the slow gain, and a model in its place inverts that model.
    """
    m = mirror.assemble("static", "static", None, model, creep)
    if inverse is False:
        feedforward = control.Inverse(direct=(1.0 / hysteresis.slow_gain(model),))
    else:
        inverted = model if inverse is True else inverse
        kept = creep if invert_creep else NO_CREEP
        feedforward = control.inverse(replace(m, inverse=(inverted,), inverse_creep=(kept,)))
    setup = simulate.Setup(
        IDEAL_DRIVE, control.Timing(PERIOD, 1, 0), control.pid(control.Gains(0.0, 0.0, 0.0, 1e-4), PERIOD)
    )
    trace = simulate.track("alone", m, setup, feedforward, np.asarray(reference)[:, None], slice(None))
    return trace.output_rad[1:, 0] - trace.reference_rad[:-1, 0], trace


def triangle(amplitude, samples, periods=3.25):
    """From 0 up, with turns at the amplitude; ``samples`` a period."""
    phase = np.arange(round(periods * samples)) / samples
    return amplitude * (4 * np.abs((phase + 0.75) % 1 - 0.5) - 1)


@pytest.mark.promise("hysteresis-15")
def test_the_inverse_of_widening_plays_is_exact_at_a_constant_rate():
    """A triangle: exact on each flank once all plays move, where drive and reference over slow gain have one rate.

    Behind a turn the first plays alone move, so that the drive is faster than the inverse takes it to be.
    """
    samples, amplitude = 2000, 6 * hysteresis.slow_gain(WIDENING)
    reference = triangle(amplitude, samples)
    rate = 4 * 6 / (samples * PERIOD)  # V/s on a flank
    # a play of threshold r moves again after 2 (r + widening rate) of drive; the mean slope until then is at least w0
    travelled = 2 * (1.5 + WIDENING.widening_s * rate)
    engaged = travelled / 24 + 0.02  # share of a period
    since_turn = ((np.arange(reference.size) / samples + 0.25) % 0.5)[:-1]
    late = (since_turn > engaged) & (np.arange(reference.size - 1) > samples)
    residual = {
        name: np.abs(feedforward_alone(WIDENING, reference, inverse)[0]) / amplitude
        for name, inverse in {"with": True, "without widening": PLAYS, "without": False}.items()
    }
    turned = ~late & (np.arange(reference.size - 1) > samples)
    for name, error in residual.items():
        print(f"{name}: {np.max(error[late]):.1e} on the flanks, {np.max(error[turned]):.1e} behind the turns")
    assert np.mean(late) > 0.2
    assert np.max(residual["with"][late]) < 1e-12
    assert np.min(residual["without widening"][late]) > 0.01
    assert np.min(residual["without"][late]) > 0.05
    assert 1e-3 < np.max(residual["with"][turned]) < 0.5 * np.max(residual["without widening"][turned])


def test_the_inverse_of_widening_plays_is_exact_where_both_rates_are_clamped():
    """Beyond the limit the thresholds stand at r + widening limit in model and inverse: exact on any reference."""
    model = replace(WIDENING, rate_limit_v_s=300.0)
    rng = np.random.default_rng(3)
    moves = rng.uniform(0.02, 0.2, 400) * rng.choice(SIGNS, 400) * hysteresis.slow_gain(model)
    error, trace = feedforward_alone(model, np.cumsum(moves))
    assert np.max(np.abs(error)) < 1e-17
    assert trace.counts.clamped == trace.counts.inverse_clamped == 400
    other, _ = feedforward_alone(model, np.cumsum(moves), PLAYS)
    assert np.max(np.abs(other)) > 1e-6


def test_the_inverse_of_widening_plays_on_a_sine():
    """The rate of a sine changes all the time: most of the hysteresis is gone, and not all of it."""
    reference = 0.3e-3 * np.sin(2 * pi * 25 * PERIOD * np.arange(4000))
    left = {
        name: np.max(np.abs(feedforward_alone(WIDENING, reference, inverse)[0][2000:])) / 0.3e-3
        for name, inverse in {"with": True, "without widening": PLAYS, "without": False}.items()
    }
    print({name: f"{100 * share:.2f} %" for name, share in left.items()})
    assert left["without"] > 0.1
    assert left["without widening"] > 0.3 * left["without"]
    assert 1e-3 < left["with"] < 0.1 * left["without widening"]


@pytest.mark.parametrize(
    ("gamma_eta", "exponent", "percents"),
    [
        ((0.3, 0.2), 1.0, (1.10, 1.29, 4.97)),
        ((0.3, 0.2), 2.0, (1.05, 1.34, 3.89)),
        ((0.5, -0.7), 1.0, (4.64, 8.97, 13.43)),
        ((0.5, -0.7), 2.0, (1.53, 2.28, 6.56)),
    ],
)
def test_the_inverse_undoes_an_asymmetric_model(gamma_eta, exponent, percents):
    """Eq. 4 drives its h by r / d1, not by u, so that it leaves about the square of the hysteresis's share."""
    model = asymmetric(ADMISSIBLE, gamma_eta, exponent)
    reference = 0.3e-3 * np.sin(2 * pi * 15 * PERIOD * np.arange(10_000))
    eq_3 = replace(model, gamma_1_v=0.0, eta_1_v=0.0, exponent=1.0)
    left = {}
    for name, inverse in {"with": True, "as Eq. 3": eq_3, "without": False}.items():
        error, trace = feedforward_alone(model, reference, inverse)
        left[name] = 100 * np.max(np.abs(error[5000:])) / 0.3e-3
        assert (trace.counts.clamped, trace.counts.inverse_clamped) == (0, 0)
    print({name: f"{share:.3f} %" for name, share in left.items()})
    assert_allclose(list(left.values()), percents, rtol=0.01)
    assert left["with"] < 0.36 * left["without"]
    assert left["with"] < 0.9 * left["as Eq. 3"]


CREEP = Creep((0.004e-3, 0.003e-3, 0.002e-3), (0.02, 0.1, 0.5))
STAIRS = np.repeat([0.1e-3, 0.3e-3, 0.2e-3, -0.1e-3, 0.0], 10_000)  # of 0.2 s


def test_creep_is_taken_off_a_staircase():
    """What is left is half a sample of the lags: the amplifier ramps over the sample that the inverse holds."""
    left, late = {}, np.arange(STAIRS.size - 1) % 10_000 > 9_000  # before the next stair
    for name, invert in {"with": True, "without": False}.items():
        error, _ = feedforward_alone(PLAYS, STAIRS, creep=CREEP, invert_creep=invert)
        left[name] = np.abs(error) / 0.3e-3
    print({name: f"{100 * np.max(e):.4f} %, late {100 * np.max(e[late]):.5f} %" for name, e in left.items()})
    assert_allclose(np.max(left["without"]), 0.0909, rtol=0.01)
    assert 1e-6 < np.max(left["with"]) < 5e-5
    assert np.max(left["without"][late]) > 0.08
    assert np.max(left["with"][late]) < 2e-5


def test_creep_is_taken_off_beside_a_bouc_wen_model():
    """Here it is the hysteresis's own residual that is left; no growth with the rate, which stairs would meet."""
    model = asymmetric(replace(ADMISSIBLE, delta_s_v=0.0), (0.2, -0.3))
    left = {
        name: np.max(np.abs(feedforward_alone(model, STAIRS, creep=creep, invert_creep=invert)[0])) / 0.3e-3
        for name, creep, invert in (("with", CREEP, True), ("without", CREEP, False), ("no creep", NO_CREEP, True))
    }
    print({name: f"{100 * share:.3f} %" for name, share in left.items()})
    assert left["without"] > 0.09
    assert left["no creep"] < left["with"] < 0.15 * left["without"]


def test_creep_approaches_its_weight_with_its_time_constants():
    """A step held for long, without any inverse: drive x (gain + sum of weight (1 - exp(-t / tau)))."""
    straight = hysteresis.gain_only(PLAYS)
    step = np.full(40_000, 0.2e-3)
    error, trace = feedforward_alone(straight, step, creep=CREEP, invert_creep=False)
    volts = 0.2e-3 / straight.d1_rad_v
    time = PERIOD * (np.arange(step.size - 1) + 0.5)  # the drive ramps over its first sample
    expected = volts * sum(
        w * (1.0 - np.exp(-time / tau)) for w, tau in zip(CREEP.weights_rad_v, CREEP.time_constants_s, strict=True)
    )
    assert_allclose(error, expected, rtol=1e-6, atol=1e-12)
    assert error[-1] > 0.9 * volts * sum(CREEP.weights_rad_v[:2])
    assert_allclose(trace.command_v, volts, rtol=1e-12)


def test_the_inverse_of_a_mirror_carries_creep_and_widening_by_actuator():
    parts = [
        mirror.assemble("plays", "static", None, replace(WIDENING, rate_limit_v_s=500.0), CREEP),
        mirror.assemble("Bouc-Wen", "static", None, ADMISSIBLE),
        mirror.assemble("plays", "static", None, PLAYS, Creep((1e-6,), (1.0,))),
    ]
    inverse = control.inverse(mirror.combine(*parts))
    slow = hysteresis.slow_gain(WIDENING)
    assert_allclose(inverse.widening, [(0.06e-3 * 1e-3 / slow, 500.0 * slow), (0.0, inf), (0.0, inf)])
    assert inverse.creep == (CREEP, NO_CREEP, Creep((1e-6,), (1.0,)))
    loop = simulate.assemble(
        mirror.combine(*parts),
        simulate.Setup(
            IDEAL_DRIVE,
            control.Timing(PERIOD, 1, 0),
            side_by_side(*[control.pid(control.Gains(0.0, 1.0, 0.0, 1e-4), PERIOD)] * 3),
        ),
        inverse,
    )
    assert loop.inverse_lag_actuator.tolist() == [0, 0, 0, 2]
    assert_allclose(loop.inverse_lag_keep, [exp(-PERIOD / tau) for tau in (0.02, 0.1, 0.5, 1.0)], rtol=1e-14)
    assert simulate.at_rest(loop).inverse_clamped.size == 1 + 3


# ------------------------------------------------------------------------------------- models of numbers all unlike
UNLIKE = BoucWen(7e-5, -2e-7, -1.3e-5, 3e-4, 2.5, -0.7, 900.0, 4.0, 0.3, -0.2, 1.6)
OPERATOR = PrandtlIshlinskii((0.0, 0.5, 2.0), (4e-5, 1e-5, -3e-6), 2e-4, 800.0, (1e-6, -2e-6, 3e-6), 5.0)


@pytest.mark.parametrize(
    ("rising", "sign", "decay"), [(1.0, 1.0, 1.9), (1.0, -1.0, 2.7), (-1.0, 1.0, 3.7), (-1.0, -1.0, 1.7)]
)
def test_each_side_of_each_branch_decays_by_its_own_sum(rising, sign, decay):
    assert UNLIKE.decay_1_v(rising, sign) == pytest.approx(decay, rel=1e-12)


def test_scalars_of_a_model_with_a_falling_and_a_rising_branch_that_differ():
    """epsilon is below 0: the rising branch settles below 0 with the decay 2.7, the falling one above with 3.7."""
    size = 1.3e-5 / 2.5
    up, down = -size * (2.5 / 2.7) ** (1 / 1.6), size * (2.5 / 3.7) ** (1 / 1.6)
    assert UNLIKE.settled_branch_rad(1.0) == pytest.approx(up, rel=1e-12)
    assert UNLIKE.settled_branch_rad(-1.0) == pytest.approx(down, rel=1e-12)
    assert UNLIKE.settled_rad == pytest.approx(-up, rel=1e-12)
    swing = 1 + 1.7 / 2.7  # behind the rising branch; behind the falling one 1 + 1.9 / 3.7
    assert UNLIKE.reversal_swing == pytest.approx(swing, rel=1e-12)
    for rate_v_s, growth in ((0.0, 1.0), (-500.0, exp(0.15)), (5e3, exp(0.27))):
        slope = 7e-5 - 1.3e-5 * growth * swing
        assert UNLIKE.reversal_slope_rad_v(rate_v_s) == pytest.approx(slope, rel=1e-12)
    assert UNLIKE.admissible_rate_v_s == pytest.approx(log(7e-5 / (1.3e-5 * swing)) / 3e-4, rel=1e-12)
    assert UNLIKE.wrong_way_rad == 0.0 and UNLIKE.admissible
    turned = hysteresis.sign_reversed(UNLIKE)
    assert turned == replace(UNLIKE, d1_rad_v=-7e-5, epsilon_rad_v=1.3e-5, beta_1_v=0.7, gamma_1_v=-0.3)
    assert turned.admissible_rate_v_s == pytest.approx(UNLIKE.admissible_rate_v_s, rel=1e-12)
    assert (*UNLIKE.row[:8], *UNLIKE.row[8:10]) == (7e-5, -2e-7, -1.3e-5, 3e-4, 2.5, -0.7, 900.0, 4.0, 0.3, -0.2)
    assert UNLIKE.row[10:] == pytest.approx((0.6, 2.5 / 1.3e-5), rel=1e-12)


@pytest.mark.parametrize(
    ("model", "slope"),
    [
        (UNLIKE, 7e-5 * exp(1.8e-4) + 1.3e-5 * exp(0.27) * (1 + 3.7 / 1.7)),
        (replace(UNLIKE, delta_s_v=-3e-4), 7e-5 * exp(1.8e-4) + 1.3e-5 * (1 + 3.7 / 1.7)),
        (replace(UNLIKE, delta_s_v=0.0, d2_s_v=0.0, rate_limit_v_s=inf), 7e-5 + 1.3e-5 * (1 + 3.7 / 1.7)),
        (replace(UNLIKE, alpha_1_v=0.9, delta_s_v=0.0), 7e-5 * exp(1.8e-4) + 1.3e-5 * (1 + 2.1 / 0.1)),
        (replace(UNLIKE, alpha_1_v=0.2), 7e-5 * exp(1.8e-4) + 1.3e-5 * exp(0.27) * (1 + (exp(1) - 1) * 1.4 / 0.6)),
        (replace(UNLIKE, alpha_1_v=-0.9), 7e-5 * exp(1.8e-4) + 1.3e-5 * exp(0.27) * exp(1)),
        (replace(OPERATOR, widening_s=0.0), 5.3e-5 + (2 * 3e-6 + 3 * 3e-6) / 5.0),
    ],
    ids=["rate", "slower", "no rate", "positive", "hardening", "softening", "plays"],
)
def test_the_steepest_slope_of_numbers_all_unlike(model, slope):
    assert hysteresis.steepest_slope(model) == pytest.approx(slope, rel=1e-12)


def test_gains_of_an_operator_with_a_weight_below_0():
    assert hysteresis.slow_gain(OPERATOR) == pytest.approx(4.7e-5, rel=1e-12)
    assert hysteresis.rest_gain(OPERATOR) == pytest.approx(4e-5, rel=1e-12)
    assert hysteresis.rest_gain(UNLIKE) == pytest.approx(5.7e-5, rel=1e-12)
    assert hysteresis.output_amplitude(OPERATOR, 3.0) == pytest.approx(3 * 4e-5 + 2.5 * 1e-5 - 3e-6, rel=1e-12)
    assert hysteresis.output_amplitude(UNLIKE, 3.0) == pytest.approx(2.1e-4, rel=1e-12)
    # amplitudes below the first threshold, between both and above: the plays end at 0.5 V with 20 and at 2 V with 95
    for output_rad, drive_v in ((1e-5, 0.25), (6e-5, 0.5 + 40 / 50), (1e-3, 2.0 + 905 / 47)):
        assert hysteresis.secant_gain(OPERATOR, output_rad) == pytest.approx(output_rad / drive_v, rel=1e-12)
    assert hysteresis.secant_gain(OPERATOR, inf) == pytest.approx(4.7e-5, rel=1e-12)
    assert hysteresis.gain_only(OPERATOR, 6e-5) == BoucWen(pytest.approx(6e-5 / 1.3), 0.0, 0.0, 0.0, 0.0, 0.0)


def test_a_model_seen_from_behind_has_each_of_its_outputs_turned():
    scaled = hysteresis.scaled(OPERATOR, -2.0)
    assert scaled == replace(OPERATOR, weights_rad_v=(-8e-5, -2e-5, 6e-6), polynomial_rad=(-2e-6, 4e-6, -6e-6))
    turned = hysteresis.scaled(UNLIKE, -3.0)
    assert turned == replace(UNLIKE, d1_rad_v=-3.0 * 7e-5, epsilon_rad_v=3.0 * 1.3e-5)


def test_an_operator_that_widens_has_the_inverse_of_its_own_numbers():
    found = replace(OPERATOR, reach_v=inf).inverted()
    assert found.thresholds_v == pytest.approx((0.0, 2e-5, 2 * 4e-5 + 1.5 * 1e-5), rel=1e-12)
    assert found.weights_rad_v == pytest.approx((1 / 4e-5, 1 / 5e-5 - 1 / 4e-5, 1 / 4.7e-5 - 1 / 5e-5), rel=1e-12)
    assert found.widening_s == pytest.approx(4e-5 * 2e-4 / 4.7e-5, rel=1e-12)
    assert found.rate_limit_v_s == pytest.approx(800.0 * 4.7e-5, rel=1e-12)
    assert (found.polynomial_rad, found.reach_v) == ((0.0, 0.0, 0.0), inf)


@pytest.mark.parametrize("model", [UNLIKE, OPERATOR], ids=["bouc-wen", "plays"])
def test_a_loop_counts_the_samples_of_a_period_that_are_faster_than_the_limit(model):
    loop = replace(model, rate_limit_v_s=300.0).loop(3.0, 20.0, 48)
    wave = 3.0 * np.sin(2 * pi * np.arange(49) / 48)
    assert loop.clamped == int(np.sum(np.abs(np.diff(wave)) * 960.0 > 300.0)) > 0
    assert (loop.freq_hz, loop.drive_v.size, loop.output_rad.size, loop.hysteresis_rad.size) == (20.0, 48, 48, 48)
    assert_allclose(loop.drive_v, wave[1:], atol=1e-15)
    width = np.ptp(loop.hysteresis_rad) / np.ptp(loop.output_rad)
    assert repr(loop) == f"<HysteresisLoop at 20 Hz: 48 samples, {100 * width:.2f}% wide>"
    found = loop.to_xarray()
    assert found.attrs == {"frequency_hz": 20.0, "width": loop.width, "clamped": loop.clamped}
    for name, values in (("drive", loop.drive_v), ("output", loop.output_rad), ("hysteresis", loop.hysteresis_rad)):
        assert_allclose(found[name].values, values, rtol=1e-12)
        assert found[name].attrs["units"] == ("V" if name == "drive" else "rad")


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (
            lambda: PrandtlIshlinskii((0.0, 1.0), (1e-6,)),
            "thresholds (0.0, 1.0) V with 1 weights make no Prandtl-Ishlinskii operator: give thresholds that rise "
            "from 0 V or above, and a weight for each",
        ),
        (
            lambda: PrandtlIshlinskii((-0.5, 1.0), (1e-6, 2e-6)),
            "thresholds (-0.5, 1.0) V with 2 weights make no Prandtl-Ishlinskii operator: give thresholds that rise "
            "from 0 V or above, and a weight for each",
        ),
        (
            lambda: PrandtlIshlinskii((0.0,), (1e-6,), -1e-3),
            "thresholds cannot widen by -0.001 s: give 0 s, or more for a rate",
        ),
        (lambda: UNLIKE.loop(0.0, 3.0), "amplitude_v of a loop is 0.0 V: give a finite number above 0"),
        (lambda: OPERATOR.loop(1.0, inf), "freq_hz of a loop is inf Hz: give a finite number above 0"),
        (lambda: UNLIKE.loop(1.0, 2.0, 7), "a loop of 7 samples a period has no shape: give 8 or more, better 500"),
        (
            lambda: UNLIKE.response([1.0, inf], 1e-3),
            "drive_v has shape (2,): give one row of finite samples, shape (samples,)",
        ),
        (
            lambda: UNLIKE.inverse([[1e-6, 2e-6]], 1e-3),
            "output_rad has shape (1, 2): give one row of finite samples, shape (samples,)",
        ),
        (lambda: OPERATOR.response([1.0], -0.5), "step_s is -0.5 s: give the time between two samples, above 0"),
        (
            lambda: replace(UNLIKE, eta_1_v=float("nan")).response([1.0], 1.0),
            "eta_1_v of the Bouc-Wen model is nan: give finite numbers",
        ),
        (
            lambda: replace(OPERATOR, polynomial_rad=(0.0, inf, 0.0)).response([1.0], 1.0),
            "polynomial_rad of the Prandtl-Ishlinskii model is [ 0. inf  0.]: give finite numbers",
        ),
        (
            lambda: replace(UNLIKE, alpha_1_v=-500.0, delta_s_v=1.0).response(np.arange(9.0), 1e-3),
            "the model gives no number at sample 1: look for a parameter or a rate that it was not fitted to",
        ),
        (
            lambda: Creep((1e-6, 2e-6), (0.1, 0.0)).response([1.0], 0.1),
            "creep of 2 weights and the time constants (0.1, 0.0) s: give as many weights, and time constants above 0",
        ),
        (
            lambda: replace(UNLIKE, d1_rad_v=0.0).inverse([1e-6], 0.1),
            "a Bouc-Wen model with d1 = 0 has no inverse: its output does not follow the drive",
        ),
        (
            lambda: hysteresis.steepest_slope(replace(UNLIKE, rate_limit_v_s=inf, delta_s_v=0.0)),
            "a Bouc-Wen element that is fed back and depends on rate needs a finite rate limit",
        ),
    ],
)
def test_what_a_model_cannot_do_is_said_in_all_words(ask, message):
    with pytest.raises(ValueError) as refused:
        ask()
    assert str(refused.value) == message


@pytest.mark.parametrize(
    ("drive", "step_s", "message"),
    [
        ([[1.0]], 0.1, "drive_v has shape (1, 1): give one row of finite samples, shape (samples,)"),
        ([], 0.1, "drive_v has shape (0,): give one row of finite samples, shape (samples,)"),
        ([0.5, -inf], 0.1, "drive_v has shape (2,): give one row of finite samples, shape (samples,)"),
        ([1.0, "a"], 0.1, "drive_v: no array of real numbers; give numbers, or lists of them that are equally long"),
        ([1.0], 0.0, "step_s is 0.0 s: give the time between two samples, above 0"),
        ([1.0], inf, "step_s is inf s: give the time between two samples, above 0"),
    ],
)
@pytest.mark.parametrize("model", [Creep((1e-6, 2e-6), (0.1, 2.0)), OPERATOR, UNLIKE], ids=["creep", "plays", "bw"])
def test_a_drive_that_is_none_is_told_by_its_name_whatever_is_asked(model, drive, step_s, message):
    with pytest.raises(ValueError) as refused:
        model.response(drive, step_s)
    assert str(refused.value) == message


def fields_of(*models):
    return [(model, each) for model in models for each in model.__dataclass_fields__.values()]


@pytest.mark.parametrize(
    ("model", "each"), fields_of(UNLIKE, OPERATOR, Creep((1e-6,), (0.1,))), ids=lambda v: getattr(v, "name", "")
)
def test_each_number_of_a_model_is_checked_under_its_own_name(model, each):
    """Of another shape, or not finite; a limit and a reach may be infinite, if they lie above."""
    one = each.type is float
    cls = type(model)
    spoilt = object.__new__(cls)

    def told(value):
        for name in cls.__dataclass_fields__:
            object.__setattr__(spoilt, name, value if name == each.name else getattr(model, name))
        with pytest.raises(ValueError) as refused:
            spoilt.check()
        return str(refused.value)

    wanted = "has shape (2,): give one number" if one else "has shape (): give a row of numbers"
    assert told((1.0, 2.0) if one else 1.0) == f"{each.name} of the {cls.KIND} model {wanted}"
    for value in (nan, -inf) if each.name in ("rate_limit_v_s", "reach_v") else (nan, -inf, inf):
        shown = f"{value}" if one else f"[{value}]"
        assert (
            told(value if one else (value,)) == f"{each.name} of the {cls.KIND} model is {shown}: give finite numbers"
        )


@pytest.mark.parametrize(
    ("model", "drives"),
    [
        (UNLIKE, "-0.17192932 -0.63108927 -0.26227943 -0.44021441"),
        (replace(UNLIKE, d2_s_v=0.0, exponent=1.0), "-0.1672039 -0.62282173 -0.25868306 -0.43846743"),
        (replace(UNLIKE, d1_rad_v=-7e-5), "0.1208394 0.50719716 0.27724332 0.39921269"),
        (replace(OPERATOR, reach_v=inf, widening_s=0.0), "-0.25 -0.9 -0.4 -0.65"),
    ],
    ids=["rate", "no rate", "falling", "plays"],
)
def test_an_output_below_0_has_its_inverse_as_one_above(model, drives):
    wanted = np.array([-1.0, -4.0, -2.0, -3.0]) * 1e-5
    found = model.inverse(wanted, 1e-3)
    assert_allclose(found, [float(v) for v in drives.split()], rtol=1e-6)
    assert_allclose(model.response(found, 1e-3), wanted, atol=6e-9)


@pytest.mark.parametrize(
    ("epsilon", "exponent", "wrong_way", "settled", "slope"),
    [
        (-3e-5, 1.0, 1.774998e-06, 2.307692e-05, -3.153846e-05),
        (-3e-5, 1.7, 8.595673e-07, 1.762942e-05, -3.153846e-05),
        (-6e-5, 1.0, 1.887763e-05, 4.615385e-05, -1.330769e-04),
        (-6e-5, 1.7, 1.080452e-05, 3.525885e-05, -1.330769e-04),
        (-9e-5, 1.0, 4.274649e-05, 6.923077e-05, -2.346154e-04),
        (-9e-5, 1.7, 2.999442e-05, 5.288827e-05, -2.346154e-04),
        (-2e-4, 1.7, 1.248409e-04, 1.175295e-04, -6.069231e-04),
    ],
)
def test_the_worse_of_two_unlike_branches_says_how_far_a_model_moves_the_wrong_way(
    epsilon, exponent, wrong_way, settled, slope
):
    """With epsilon beyond d1 and below it; the same turned over."""
    model = BoucWen(7e-5, 0.0, epsilon, 0.0, 2.5, 0.7, inf, 0.0, 0.3, -0.2, exponent)
    for each, sign in ((model, 1.0), (hysteresis.sign_reversed(model), -1.0)):
        assert each.wrong_way_rad == pytest.approx(wrong_way, rel=1e-6)
        assert each.settled_rad == pytest.approx(settled, rel=1e-6)
        assert sign < 0.0 or each.reversal_slope_rad_v() == pytest.approx(slope, rel=1e-6)
        assert each.admissible_rate_v_s == 0.0 and not each.admissible


@pytest.mark.parametrize(
    ("output_rad", "gain"),
    [
        (0.0, 0.0),
        (1e-6, 1e-6 / 0.525),
        (2e-5, 2e-5 / 1.0),
        (4e-5, 4e-5 / 1.4),
        (1.2e-4, 1.2e-4 / 3.0),
        (1.3e-4, 1.3e-4 / (3.0 + 1e-5 / 5.5e-5)),
        (inf, 5.5e-5),
    ],
)
def test_plays_without_a_gain_at_rest_have_the_secant_of_each_piece(output_rad, gain):
    """Thresholds of 0.5, 1 and 3 V end at 0, 20 and 120 urad."""
    model = PrandtlIshlinskii((0.5, 1.0, 3.0), (4e-5, 1e-5, 5e-6))
    assert hysteresis.secant_gain(model, output_rad) == pytest.approx(gain, rel=1e-12)
    assert hysteresis.gain_only(model, output_rad).d1_rad_v == pytest.approx(gain, rel=1e-12)
    assert hysteresis.rest_gain(model) == 0.0


@pytest.mark.parametrize(
    ("model", "amplitude_v", "freq_hz", "samples", "numbers"),
    [
        (UNLIKE, 0.4, 3.0, 8, "0.1649825 0 4.806966e-05 1.446134e-06 3.659743e-06"),
        (UNLIKE, 3.0, 20.0, 48, "0.02357656 0 4.10766e-04 9.974149e-05 -5.236239e-06"),
        (UNLIKE, 11.0, 70.0, 33, "0.006992283 29 1.5281e-03 5.256401e-04 -5.866792e-06"),
        (OPERATOR, 3.0, 20.0, 48, "0.05595372 0 2.83787e-04 7.101798e-05 6.525741e-07"),
        (OPERATOR, 11.0, 70.0, 33, "0.01755408 29 1.035545e-03 3.586508e-04 1.88e-06"),
        (replace(OPERATOR, widening_s=0.0), 11.0, 70.0, 33, "0.0159017 29 1.036829e-03 3.597708e-04 3e-06"),
    ],
)
def test_loops_of_few_samples_within_and_beyond_the_limit_in_numbers(model, amplitude_v, freq_hz, samples, numbers):
    loop = model.loop(amplitude_v, freq_hz, samples)
    width, clamped, size, fourth, sixth = (float(v) for v in numbers.split())
    assert (loop.width, np.ptp(loop.output_rad)) == pytest.approx((width, size), rel=1e-6)
    assert (loop.output_rad[3], loop.hysteresis_rad[5]) == pytest.approx((fourth, sixth), rel=1e-6)
    assert loop.clamped == clamped and loop.drive_v.size == samples


@pytest.mark.parametrize(
    ("changes", "size"),
    [
        ({"exponent": 1.0}, 0.0),
        ({"epsilon_rad_v": 0.0}, 0.0),
        ({}, 2.5 / 1.3e-5),
        ({"epsilon_rad_v": 4e-5, "alpha_1_v": 0.5}, 1.25e4),
        ({"exponent": 3.0}, 2.5 / 1.3e-5),
    ],
)
def test_the_size_of_h_goes_to_the_kernel_where_an_exponent_needs_it(changes, size):
    model = replace(UNLIKE, **changes)
    assert model.row[10:] == pytest.approx((model.exponent - 1.0, size), rel=1e-12)
    assert model.row[:10] == tuple(getattr(model, name) for name in list(model.__dataclass_fields__)[:10])


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (
            PrandtlIshlinskii((0.5, 1.0), (1e-5, 2e-5)),
            "the Prandtl-Ishlinskii model has no weight at threshold 0: it stands still after each reversal and has no "
            "inverse; identify it again with more samples near the reversals",
        ),
        (
            PrandtlIshlinskii((0.0, 1.0), (0.0, 2e-5)),
            "the Prandtl-Ishlinskii model has no weight at threshold 0: it stands still after each reversal and has no "
            "inverse; identify it again with more samples near the reversals",
        ),
        (
            PrandtlIshlinskii((), ()),
            "the Prandtl-Ishlinskii model has no weight at threshold 0: it stands still after each reversal and has no "
            "inverse; identify it again with more samples near the reversals",
        ),
        (
            PrandtlIshlinskii((0.0, 1.0, 2.0), (4e-5, -5e-5, 3e-5)),
            "the slope of the Prandtl-Ishlinskii model turns, or is 0, at its threshold of 1 V, where the weights add "
            "up to -1e-05 rad/V: it has no inverse; give weights whose sums keep the sign of the first one",
        ),
        (
            PrandtlIshlinskii((0.0, 1.0, 2.0), (-4e-5, 2e-5, 2e-5)),
            "the slope of the Prandtl-Ishlinskii model turns, or is 0, at its threshold of 2 V, where the weights add "
            "up to 0 rad/V: it has no inverse; give weights whose sums keep the sign of the first one",
        ),
        (
            PrandtlIshlinskii((0.0, 1.0), (1e-5, 2e-5), polynomial_rad=(1e-6, 0.0, 0.0), reach_v=3.0),
            "the Prandtl-Ishlinskii model has a polynomial beside its plays, and the inverse knows plays alone; "
            "identify the axis without one",
        ),
    ],
)
def test_plays_without_an_inverse_say_why_and_what_to_do(model, message):
    for ask in (model.inverted, lambda: model.inverse([1e-6], 0.1)):
        with pytest.raises(ValueError) as refused:
            ask()
        assert str(refused.value) == message


@pytest.mark.parametrize(
    ("freq_hz", "words"), [(1234.567, "1234.57 Hz: 9"), (0.25, "0.25 Hz: 9"), (2e6, "2e+06 Hz: 9"), (20.0, "20 Hz: 9")]
)
def test_a_loop_says_its_frequency_its_samples_and_its_width(freq_hz, words):
    loop = BoucWen(7e-5, 0.0, -1.3e-5, 0.0, 2.5, -0.7).loop(1.0, freq_hz, 9)
    assert repr(loop) == f"<HysteresisLoop at {words} samples, {100 * loop.width:.2f}% wide>"
    found = loop.to_xarray()
    assert dict(found.sizes) == {"sample": 9}
    assert [found[name].attrs["long_name"] for name in ("drive", "output", "hysteresis")] == [
        *("drive about the bias", "output about the bias", "hysteresis h")
    ]


@pytest.mark.parametrize("widening_s", [0.0, 1e-3])
def test_an_operator_that_falls_has_the_inverse_of_its_mirror_image(widening_s):
    rises, falls = (
        PrandtlIshlinskii((0.0, 1.0, 2.0), weights, widening_s, 500.0)
        for weights in ((4e-5, 1e-5, -2e-5), (-4e-5, -1e-5, 2e-5))
    )
    wanted = 2e-4 * np.sin(np.linspace(0.0, 20.0, 400))
    assert_allclose(falls.inverse(wanted, 1e-3), -rises.inverse(wanted, 1e-3), rtol=1e-12)
    left = falls.response(falls.inverse(wanted, 1e-3), 1e-3) - wanted
    assert np.max(np.abs(left)) < (1e-15 if not widening_s else 4e-5)


@pytest.mark.parametrize(("output_rad", "gain"), [(0.0, 4e-5), (1e-9, 4e-5), (4e-5, 4e-5), (9e-5, 4.5e-5), (inf, 5e-5)])
def test_the_secant_gain_begins_with_that_at_rest(output_rad, gain):
    assert hysteresis.secant_gain(PrandtlIshlinskii((0.0, 1.0), (4e-5, 1e-5)), output_rad) == pytest.approx(
        gain, rel=1e-12
    )


@pytest.mark.parametrize("model", [PrandtlIshlinskii((0.0, 1.0), (4e-5, 1e-5)), BoucWen(4e-5, 0, 0, 0, 0, 0)])
@pytest.mark.parametrize("output_rad", [-1e-6, nan])
def test_a_secant_gain_at_no_amplitude_is_refused(model, output_rad):
    with pytest.raises(
        ValueError, match=f"output_rad is {output_rad} rad: give an amplitude of the output, 0 or above"
    ):
        hysteresis.gain_only(model, output_rad)


def test_an_operator_without_plays_has_no_gain_at_any_amplitude():
    assert [hysteresis.secant_gain(PrandtlIshlinskii((), ()), y) for y in (0.0, 1e-6, inf)] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("parameters", "settled", "slope", "wrong_way"),
    [
        ((1e-5, 0, 2e-6, 0, 0, 0), inf, 1.2e-5, 0.0),
        ((1e-5, 0, -2e-6, 0, 0, 0), inf, 8e-6, 0.0),
        ((1e-5, 0, -2e-5, 0, 0, 0), inf, -1e-5, inf),
        ((1e-5, 0, 2e-6, 0, 0.5, -0.5), inf, inf, 0.0),
        ((1e-5, 0, -2e-6, 0, 0.5, 0.5), inf, -inf, inf),
        ((1e-5, 0, -2e-6, 0, 0, -0.5), 4e-6, 1e-5, 0.0),
    ],
)
def test_h_without_a_decay_never_settles(parameters, settled, slope, wrong_way):
    model = BoucWen(*parameters)
    assert (model.settled_rad, model.wrong_way_rad) == pytest.approx((settled, wrong_way))
    assert model.reversal_slope_rad_v() == pytest.approx(slope)
    assert model.admissible == (slope >= 0.0)
    assert model.admissible_rate_v_s == (inf if slope >= 0.0 else 0.0)


def test_h_whose_exponent_leaves_it_no_decay_never_settles():
    assert BoucWen(1e-5, 0, -2e-6, 0, 0, -0.5, exponent=2.0).settled_rad == inf


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("model", [BoucWen(0, 0, 0, 0, 0, 0), PrandtlIshlinskii((2.0,), (1e-5,))])
def test_a_loop_whose_output_stands_still_is_not_wide(model):
    loop = model.loop(1.0, 1.0)
    assert loop.width == 0.0
    assert repr(loop) == "<HysteresisLoop at 1 Hz: 500 samples, 0.00% wide>"


@pytest.mark.parametrize(
    ("thresholds", "weights"),
    [((0.0,), 2), ((0.0, 1.0, 2.0), 2), ((), 1), ((0.0, 2.0, 1.0), 3), ((0.0, nan), 2), ((-1.0,), 1)],
)
def test_plays_have_a_weight_for_each_threshold_and_none_to_spare(thresholds, weights):
    with pytest.raises(ValueError, match=r"V with .* weights make no Prandtl-Ishlinskii operator|give finite numbers"):
        PrandtlIshlinskii(thresholds, (1e-6,) * weights)
    assert PrandtlIshlinskii((0.0, 1.0), (1e-6, 2e-6)).thresholds_v == (0.0, 1.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_output_that_no_drive_makes_is_told_with_the_slope_at_the_fastest_rate_whichever_way_that_is(sign):
    """It goes up by 1 V a step of 1 ms and back by 2 V, over and over: the faster way is the other one for -1."""
    model = BoucWen(50e-6, 0.0, -40e-6, 2e-4, 0.3, 0.1)
    up, down = np.arange(0.0, 10.0, 1.0), np.arange(10.0, 0.0, -2.0)
    output = sign * 50e-6 * np.tile(np.concatenate([up, down]), 6)
    slope = 50e-6 - 40e-6 * exp(2e-4 * 2000.0) * 2 * 0.3 / (0.3 - 0.1)
    with pytest.raises(ValueError) as refused:
        model.inverse(output, 1e-3)
    assert str(refused.value) == (
        "no drive was found in 300 steps that makes this output: behind a reversal the slope of the model is "
        f"{slope:.3g} rad/V at its fastest rate, and its inverse needs one above 0; fit it with admissible=True, or "
        "take a Prandtl-Ishlinskii model"
    )
