"""Hysteresis models by themselves: arrays in, arrays out, beside the slow twins of the kernels and the whole mirror."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import oracles
from microrad import mirror
from microrad.core.units import LEAST, MOST
from microrad.mirror.hysteresis import BoucWen, Creep, PrandtlIshlinskii, secant_gain, steepest_slope
from oracles import bouc_wen_response, lag_response, widening_play_response

BOUC_WEN = BoucWen(50e-6, 0.0, -8e-6, 4e-4, 0.3, 0.1, rate_limit_v_s=2000.0, bias_v=5.0)
PLAYS = PrandtlIshlinskii((0.0, 1.0, 3.0), (40e-6, 6e-6, 4e-6))
WIDENING = replace(PLAYS, widening_s=1e-3, rate_limit_v_s=3000.0, polynomial_rad=(1e-6, 2e-6, -3e-6), reach_v=8.0)
STEP = 1e-4
DRIVE = 6.0 * np.sin(2 * np.pi * 60 * STEP * np.arange(400)) + np.linspace(0.0, 2.0, 400)


def on_a_mirror(model):
    """The output of a mirror that is this model and nothing else."""
    plant = mirror.discretise(mirror.assemble("model", "static", None, model), STEP)
    output, bank = np.empty((DRIVE.size, 1)), np.empty((DRIVE.size, 1))
    mirror.respond(plant, mirror.at_rest(plant), DRIVE[:, None], output, bank)
    return output[:, 0]


@pytest.mark.parametrize("model", [BOUC_WEN, replace(BOUC_WEN, exponent=1.5, gamma_1_v=0.05), PLAYS, WIDENING])
def test_a_model_by_itself_answers_as_a_mirror_of_it_alone(model):
    alone = model.response(DRIVE, STEP)
    assert_allclose(alone, on_a_mirror(model), rtol=0, atol=1e-12 * np.ptp(alone))
    straight = DRIVE * np.ptp(alone) / np.ptp(DRIVE)
    assert np.max(np.abs(alone - straight)) > 1e-3 * np.ptp(alone)


@pytest.mark.promise("mirror-file-16", "mirror-file-19", "mirror-file-22", "hysteretic-stiffness-1")
@pytest.mark.promise("mirror-file-59")
def test_responses_are_those_of_the_slow_twins():
    rest = np.concatenate([[0.0], DRIVE])
    slow = bouc_wen_response(rest, STEP, oracles.BoucWen(*BOUC_WEN.row[:8]))[0][1:]
    assert_allclose(BOUC_WEN.response(DRIVE, STEP), slow, rtol=0, atol=1e-9 * np.ptp(slow))
    states, _ = widening_play_response(rest, STEP, PLAYS.thresholds_v, 1e-3, 3000.0, [0.0] * 3)
    widened = replace(PLAYS, widening_s=1e-3, rate_limit_v_s=3000.0).response(DRIVE, STEP)
    assert_allclose(widened, (states @ np.array(PLAYS.weights_rad_v))[1:], rtol=1e-12, atol=1e-18)
    creep = Creep((1e-6, 2e-6), (0.01, 0.1))
    lags = lag_response(rest, STEP, np.array([0.01, 0.1]), np.zeros(2))
    assert_allclose(creep.response(DRIVE, STEP), (lags @ np.array([1e-6, 2e-6]))[1:], rtol=1e-9)


@pytest.mark.parametrize("model", [BOUC_WEN, replace(BOUC_WEN, bias_v=0.0, epsilon_rad_v=20e-6), PLAYS])
def test_the_response_to_the_inverse_is_what_was_wanted(model):
    wanted = 200e-6 * np.sin(2 * np.pi * 20 * STEP * np.arange(1000)) * np.linspace(0.2, 1.0, 1000)
    reached = model.response(model.inverse(wanted, STEP), STEP)
    assert_allclose(reached, wanted, rtol=0, atol=1e-11 * np.ptp(wanted))
    gain = model.d1_rad_v if isinstance(model, BoucWen) else sum(model.weights_rad_v)
    assert np.max(np.abs(model.response(wanted / gain, STEP) - wanted)) > 0.01 * np.ptp(wanted)


def test_a_lag_with_the_rate_is_left_by_the_inverse_in_part():
    model = replace(BOUC_WEN, d2_s_v=-3e-7)
    wanted = 200e-6 * np.sin(2 * np.pi * 20 * STEP * np.arange(1000))
    left = np.max(np.abs(model.response(model.inverse(wanted, STEP), STEP) - wanted)) / np.ptp(wanted)
    assert 1e-6 < left < 1e-3


@pytest.mark.promise("hysteresis-15")
def test_a_widening_operator_is_nearly_inverted():
    model = replace(PLAYS, widening_s=1e-4)
    wanted = 200e-6 * np.sin(2 * np.pi * 20 * STEP * np.arange(1000))
    reached = model.response(model.inverse(wanted, STEP), STEP)
    frozen = model.response(PLAYS.inverse(wanted, STEP), STEP)
    assert 0.0 < np.max(np.abs(reached - wanted)) < 0.2 * np.max(np.abs(frozen - wanted))


@pytest.mark.promise("hysteresis-11", "hysteresis-12")
def test_only_a_model_that_never_turns_is_admissible():
    assert BOUC_WEN.admissible
    assert not replace(BOUC_WEN, epsilon_rad_v=-40e-6).admissible
    assert replace(BOUC_WEN, d1_rad_v=-50e-6, epsilon_rad_v=8e-6).admissible
    assert PLAYS.admissible
    for sign in (1.0, -1.0):
        of = {
            weights: tuple(sign * w for w in weights)
            for weights in ((4.0, -3.0, 1.0), (4.0, -4.0, 1.0), (4.0, -5.0, 3.0))
        }
        assert [replace(PLAYS, weights_rad_v=weights).admissible for weights in of.values()] == [True, True, False]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("epsilon", "stays"), [(-7.5, True), (-8.0, True), (-8.5, False), (8.0, True)])
def test_a_model_that_only_just_stands_still_behind_a_reversal_is_admissible(sign, epsilon, stays):
    """Both decays are 1 per volt, so that h turns by twice epsilon: at 8 of 16 nothing is left of the slope."""
    model = BoucWen(16.0 * sign, 0.0, epsilon * sign, 0.0, 1.0, 0.0)
    assert model.reversal_slope_rad_v() == sign * (16.0 + 2.0 * epsilon)
    assert model.admissible is stays


def test_a_model_that_only_just_stands_still_has_no_wrong_way_and_no_rate_to_spare():
    model = BoucWen(16.0, 0.0, -8.0, 0.0, 1.0, 0.0)
    assert (model.wrong_way_rad, model.admissible_rate_v_s) == (0.0, math.inf)
    assert replace(model, delta_s_v=1e-3).admissible_rate_v_s == 0.0
    assert replace(model, epsilon_rad_v=-4.0, delta_s_v=1e-3).admissible_rate_v_s == pytest.approx(1e3 * math.log(2.0))
    assert replace(model, epsilon_rad_v=-4.0, delta_s_v=-1e-3).admissible_rate_v_s == math.inf


@pytest.mark.parametrize(("gamma_1_v", "eta_1_v"), [(0.5, 0.2), (-0.5, 0.2), (0.1, -0.6)])
@pytest.mark.parametrize("epsilon", [-1.0, -0.55, -0.4, -0.25, 0.4])
def test_an_asymmetric_model_is_as_admissible_turned_over(epsilon, gamma_1_v, eta_1_v):
    """A sensor turned over turns the signs of d1, epsilon, beta and gamma: the same mirror."""
    model = BoucWen(1.0, 0.0, epsilon, 0.0, 1.0, 0.2, gamma_1_v=gamma_1_v, eta_1_v=eta_1_v)
    turned = BoucWen(-1.0, 0.0, -epsilon, 0.0, 1.0, -0.2, gamma_1_v=-gamma_1_v, eta_1_v=eta_1_v)
    assert_allclose(turned.response(DRIVE, STEP), -model.response(DRIVE, STEP), rtol=1e-12)
    assert model.admissible is turned.admissible is (model.reversal_slope_rad_v() >= 0.0)
    assert model.wrong_way_rad == turned.wrong_way_rad
    assert (model.wrong_way_rad > 0.0) == (not model.admissible)
    for delta in (0.0, 1e-3):
        rates = {replace(each, delta_s_v=delta).admissible_rate_v_s for each in (model, turned)}
        assert len(rates) == 1 and (rates == {0.0}) == (not model.admissible)


@pytest.mark.parametrize("gain", [50e-6, -50e-6])
def test_a_gain_by_itself_turns_with_its_drive_at_once(gain):
    """Nothing is divided by the decays, which are 0."""
    straight = mirror.Mirror.of(gain).bouc_wen[0]
    assert straight.admissible
    assert straight.reversal_slope_rad_v(1e3) == gain
    assert (straight.settled_rad, straight.wrong_way_rad, straight.admissible_rate_v_s) == (
        0.0,
        0.0,
        math.inf,
    )
    assert steepest_slope(straight) == 50e-6
    assert replace(straight, exponent=2.0).settled_rad == 0.0


def test_the_steepest_slope_of_h_where_a_decay_is_0():
    """h grows by epsilon a volt where it does not decay, and is taken within a volt; then it falls with its decay."""
    model = BoucWen(1.0, 0.0, -0.5, 0.0, 0.0, 0.0)
    assert steepest_slope(model) == 1.5
    assert steepest_slope(replace(model, alpha_1_v=1.0, beta_1_v=1.0)) == 1.0 + 0.5 * (1.0 + 2.0)
    assert steepest_slope(replace(model, alpha_1_v=1.0)) == 1.0 + 0.5 * 2.0
    growing = replace(model, alpha_1_v=1.0, beta_1_v=2.0)  # decays 3 and -1
    assert steepest_slope(growing) == pytest.approx(1.0 + 0.5 * (1.0 + 3.0 * (math.e - 1.0)))
    assert steepest_slope(replace(model, beta_1_v=1.0)) == pytest.approx(1.0 + 0.5 * math.e)


def test_where_plays_lose_their_slope_the_secant_is_the_slow_gain():
    """Behind 2 rad the operator holds, or falls: no drive makes a larger output."""
    assert secant_gain(PrandtlIshlinskii((0.0, 1.0), (2.0, -2.0)), 3.0) == 0.0
    assert secant_gain(PrandtlIshlinskii((0.0, 1.0), (2.0, -3.0)), 3.0) == -1.0
    assert secant_gain(PrandtlIshlinskii((0.0, 1.0), (2.0, -3.0)), 1.0) == 2.0


@pytest.mark.parametrize("least", [True, False])
def test_steps_and_loops_are_taken_at_the_ends_of_what_a_number_may_be(least):
    end, beyond = (LEAST, 0.5 * LEAST) if least else (MOST, 2.0 * MOST)
    assert PLAYS.response([1.0, 2.0], end)[1] == pytest.approx(86e-6)
    assert PLAYS.loop(1.0, end, 8).freq_hz == end
    assert np.ptp(PLAYS.loop(end, 1.0, 8).output_rad) > 0.0
    for call in (
        lambda: PLAYS.response([1.0], beyond),
        lambda: PLAYS.loop(1.0, beyond),
        lambda: PLAYS.loop(beyond, 1.0),
    ):
        with pytest.raises(
            ValueError, match=r"step_s is .* above 0|of a loop is .* (V|Hz): give a finite number above 0"
        ):
            call()
    with pytest.raises(ValueError, match=r"^amplitude_v of a loop is .* V: "):
        PLAYS.loop(beyond, 1.0)
    with pytest.raises(ValueError, match=r"^a loop of 7 samples a period has no shape: give 8 or more, better 500$"):
        PLAYS.loop(1.0, 1.0, 7)


def test_a_loop_that_does_not_settle_is_that_of_the_period_1024():
    model = BoucWen(0.0, 0.0, 8e-6, 0.0, 1e-4, 0.0, gamma_1_v=1e-5)
    one = np.sin(2.0 * np.pi * np.arange(1, 9) / 8)
    run = model.response(np.tile(one, 4096), 1.0 / 8)
    found = model.loop(1.0, 1.0, 8).output_rad
    assert_allclose(found, run[1023 * 8 : 1024 * 8], rtol=0, atol=1e-9 * np.ptp(found))
    assert np.max(np.abs(run[-8:] - found)) > 1e-3 * np.ptp(found)


@pytest.mark.promise("choose-3")
@pytest.mark.promise("hysteresis-17")
def test_what_a_model_cannot_take_is_refused():
    with pytest.raises(ValueError, match=r"drive_v has shape \(2, 2\): give one row of finite samples"):
        BOUC_WEN.response(np.ones((2, 2)), STEP)
    with pytest.raises(ValueError, match="finite samples"):
        PLAYS.response([0.0, np.nan], STEP)
    with pytest.raises(ValueError, match=r"output_rad has shape \(0,\)"):
        PLAYS.inverse([], STEP)
    with pytest.raises(ValueError, match=r"step_s is 0\.0 s: give the time between two samples"):
        Creep((1e-6,), (1.0,)).response([1.0], 0.0)
    with pytest.raises(ValueError, match=r"freq_hz of a loop is 0\.0 Hz: give a finite number above 0"):
        PLAYS.loop(1.0, 0.0)
    with pytest.raises(ValueError, match="4 samples a period has no shape"):
        BOUC_WEN.loop(1.0, 1.0, 4)
    with pytest.raises(ValueError, match=r"thresholds \(0\.0, 1\.0\) V with 1 weights make no Prandtl"):
        PrandtlIshlinskii((0.0, 1.0), (1e-6,))
    with pytest.raises(ValueError, match="give thresholds that rise from 0 V"):
        PrandtlIshlinskii((1.0, 0.0), (1e-6, 1e-6))
    with pytest.raises(ValueError, match=r"thresholds \(-1\.0, 1\.0\) V with 2 weights make no Prandtl"):
        PrandtlIshlinskii((-1.0, 1.0), (1e-6, 1e-6))
    for constants in ((1.0,), (1.0, 0.0)):
        with pytest.raises(ValueError, match=r"creep of 2 weights .*: give as many weights, and time constants"):
            Creep((1e-6, 1e-6), constants).response([1.0], STEP)
    with pytest.raises(ValueError, match=r"thresholds cannot widen by -1\.0 s"):
        PrandtlIshlinskii((0.0,), (1e-6,), widening_s=-1.0)
    with pytest.raises(ValueError, match="d1 = 0 has no inverse"):
        replace(BOUC_WEN, d1_rad_v=0.0).inverse([0.0, 1e-6], STEP)
    backwards = replace(BOUC_WEN, epsilon_rad_v=-120e-6)
    with pytest.raises(ValueError, match=r"no drive was found.*slope of the model is -.*fit it with admissible=True"):
        backwards.inverse(200e-6 * np.sin(np.linspace(0.0, 20.0, 300)), STEP)


def test_a_loop_of_microradians_that_settles_slowly_is_run_until_it_is_symmetric():
    """With beta = 0 h falls towards epsilon / alpha by the way that the drive goes, so its peaks are known."""
    amplitude_v, alpha_1_v, epsilon_rad_v = 1.0, 0.05, 8e-6
    model = BoucWen(0.0, 0.0, epsilon_rad_v, 0.0, alpha_1_v, 0.0)
    peak = epsilon_rad_v / alpha_1_v * math.tanh(alpha_1_v * amplitude_v)
    loop = model.loop(amplitude_v, 1.0)
    assert_allclose([loop.output_rad.max(), loop.output_rad.min()], [peak, -peak], rtol=1e-4)


@pytest.mark.promise("hysteretic-stiffness-1")
@pytest.mark.parametrize("model", [BOUC_WEN, replace(PLAYS, widening_s=2e-3)])
def test_a_loop_is_a_period_of_a_long_run_and_closes(model):
    loop = model.loop(6.0, 50.0, 400)
    drive = 6.0 * np.sin(2 * np.pi * np.arange(1, 4001) / 400)
    run = model.response(drive, 1 / 50 / 400)
    assert_allclose(loop.output_rad, run[-400:], rtol=0, atol=2e-6 * np.ptp(run))
    around = np.append(loop.output_rad[-1], loop.output_rad)
    assert np.max(np.abs(np.diff(around))) < 0.03 * np.ptp(run)
    slow = model.loop(6.0, 0.5, 400)
    assert loop.width > 1.02 * slow.width


NO_NUMBERS = {
    "a parameter that is none": lambda: replace(BOUC_WEN, alpha_1_v=np.nan).response(DRIVE, STEP),
    "a complex parameter": lambda: replace(BOUC_WEN, alpha_1_v=0.3j).response(DRIVE, STEP),
    "a weight that is none": lambda: replace(PLAYS, weights_rad_v=(40e-6, np.inf, 4e-6)).loop(5.0, 10.0),
    "a weight of nothing at 0": lambda: replace(PLAYS, weights_rad_v=(1e-320, 6e-6, 4e-6)).inverse(1e-6 * DRIVE, STEP),
    "a weight beyond all": lambda: replace(PLAYS, weights_rad_v=(1e300, 6e-6, 4e-6)).response(DRIVE, STEP),
    "a growth beyond all": lambda: replace(BOUC_WEN, delta_s_v=1.0, rate_limit_v_s=np.inf).response(DRIVE, 1e-9),
    "a limit that is none": lambda: replace(BOUC_WEN, rate_limit_v_s=np.nan).response(DRIVE, STEP),
    "a limit below all": lambda: replace(PLAYS, reach_v=-np.inf).response(DRIVE, STEP),
    "a threshold beyond all": lambda: replace(PLAYS, thresholds_v=(0.0, 1.0, np.inf)).response(DRIVE, STEP),
    "a time constant of 0": lambda: Creep((1e-6,), (0.0,)).response(DRIVE, STEP),
    "fewer time constants than weights": lambda: Creep((1e-6, 1e-6), (0.1,)).response(DRIVE, STEP),
    "a complex drive": lambda: PLAYS.response(DRIVE + 0j, STEP),
    "a drive of unequal lists": lambda: PLAYS.response([[1.0], [1.0, 2.0]], STEP),
    "a drive beyond all": lambda: PLAYS.response(1e200 * DRIVE, STEP),
    "a step of nothing": lambda: PLAYS.response(DRIVE, 1e-320),
}


@pytest.mark.parametrize("call", NO_NUMBERS.values(), ids=NO_NUMBERS)
def test_what_makes_no_numbers_is_refused_without_a_warning(call):
    """They came out as nan, or with warnings of NumPy, an error of the compiler or the imaginary part cut off."""
    with pytest.raises(ValueError, match=r"give|look for|beyond|no inverse") as caught:
        call()
    assert "\n" not in str(caught.value)


def test_the_first_sample_without_a_number_is_named():
    """At 1000 V/s, where exp(delta |rate|) is beyond all numbers."""
    steep = replace(BOUC_WEN, delta_s_v=1.0, rate_limit_v_s=np.inf)
    with pytest.raises(
        ValueError, match=r"^the model gives no number at sample 2: look for a parameter or a rate that"
    ):
        steep.response([0.0, 0.01, 1.01, 1.02, 1.03], 1e-3)


def test_whole_parameters_compile_nothing_of_their_own():
    """A row of whole numbers was one of another type."""
    assert_allclose(
        BoucWen(1, 0, -1, 0, 1, 0).response(DRIVE, STEP),
        BoucWen(*map(float, (1, 0, -1, 0, 1, 0))).response(DRIVE, STEP),
    )


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda: mirror.Mirror.of([[50e-6, 3e-6], [2e-6, 40e-6]], [1.0], [1e-8, 1e-4, 1.0]),
            "d1_rad_v of the Bouc-Wen model has shape (2, 2): give one number",
        ),
        (
            lambda: BoucWen(1.0, [0.0], 0.0, 0.0, 0.0, 0.0).check(),
            "d2_s_v of the Bouc-Wen model has shape (1,): give one",
        ),
        (lambda: Creep(1.0, (2.0,)).check(), "weights_rad_v of the creep model has shape (): give a row of numbers"),
    ],
)
def test_a_parameter_is_one_number_or_a_row(call, said):
    with pytest.raises(ValueError, match=f"^{re.escape(said)}"):
        call()
