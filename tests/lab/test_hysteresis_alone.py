"""One call from a recording to a hysteresis model with its errors, and to a measured response."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from microrad.core.kernels import bouc_wen_response
from microrad.lab.identify import IdentificationError, Units, fit_hysteresis, measure_frequency_response
from microrad.lab.identify.hysteresis import alone, bouc_wen, prandtl_ishlinskii
from microrad.lab.identify.hysteresis.alone import STATIC_FORMS
from microrad.lab.identify.records import SiRecord
from microrad.lab.recording import recording_from_arrays
from microrad.mirror.hysteresis import BoucWen, Creep, PrandtlIshlinskii

RATE = 10e3
TIME = np.arange(6000) / RATE
DRIVE = 30.0 + 5.0 * np.sin(2 * np.pi * 10 * TIME) * np.linspace(0.2, 1.0, TIME.size)
NOISE = 1e-7 * np.random.default_rng(1).standard_normal(TIME.size)
BOUC_WEN = BoucWen(50e-6, 0.0, -2e-6, 4e-4, 0.3, 0.1, rate_limit_v_s=2000.0, bias_v=30.0)
PLAYS = PrandtlIshlinskii((0.0, 1.0, 2.0), (40e-6, 6e-6, 4e-6))


def recorded(output):
    return recording_from_arrays(DRIVE, output, RATE)


@pytest.mark.promise("choose-3")
def test_the_parameters_of_a_known_model_come_back_within_their_errors():
    fit = fit_hysteresis(recorded(BOUC_WEN.response(DRIVE - 30.0, 1 / RATE) + NOISE), output_unit="rad")
    truth = {"d1": 50e-6, "d2": 0.0, "epsilon": -2e-6, "delta": 4e-4, "alpha": 0.3, "beta": 0.1}
    assert fit.values.keys() == truth.keys() == fit.standard_errors.keys()
    for name, value in truth.items():
        assert abs(fit.values[name] - value) < 4.5 * fit.standard_errors[name], name
    assert fit.standard_errors["d1"] < 1e-3 * 50e-6
    assert fit.bias_v == 30.0 and fit.admissible and fit.samples == 5700
    left = fit.response(DRIVE, 1 / RATE) - BOUC_WEN.response(DRIVE - 30.0, 1 / RATE)
    assert np.std(left) < 0.2e-7


@pytest.mark.promise("choose-3")
@pytest.mark.parametrize("name", [form for form in STATIC_FORMS if form.startswith("prandtl")])
def test_plays_follow_a_mirror_of_plays(name):
    fit = fit_hysteresis(recorded(PLAYS.response(DRIVE - 30.0, 1 / RATE) + NOISE), name, output_unit="rad")
    assert fit.residual_rms_percent < 0.05
    assert isinstance(fit.model, PrandtlIshlinskii)
    assert_allclose(sum(fit.model.weights_rad_v), 50e-6, rtol=0.05 if "creep" in name else 3e-3)
    assert (fit.creep.weights_rad_v != ()) == ("creep" in name)
    assert all(key.startswith(("weight at ", "widening", "creep at ")) for key in fit.values)


@pytest.mark.promise("choose-3")
def test_creep_is_told_from_hysteresis():
    dwell = np.repeat([0.0, 3.0, 6.0, 3.0, 0.0, -3.0, 0.0], 2000)
    drive = np.convolve(dwell, np.ones(50) / 50, mode="same")
    creep = Creep((2e-6, 2e-6), (0.1, 1.0))
    output = PLAYS.response(drive, 1e-3) + creep.response(drive, 1e-3)
    noise = 1e-7 * np.random.default_rng(2).standard_normal(drive.size)
    staircase = recording_from_arrays(drive, output + noise, 1e3)
    fit = fit_hysteresis(staircase, "prandtl_ishlinskii_creep", output_unit="rad")
    found = dict(zip(fit.creep.time_constants_s, fit.creep.weights_rad_v, strict=True))
    assert found[0.1] == pytest.approx(2e-6, rel=0.25) and found[1.0] == pytest.approx(2e-6, rel=0.25)


def test_units_and_several_recordings():
    loop = PLAYS.response(DRIVE - 30.0, 1 / RATE) + NOISE
    halves = [recording_from_arrays(1e3 * d, 1e6 * y, RATE) for d, y in ((DRIVE, loop), (DRIVE, loop + 5e-6))]
    fit = fit_hysteresis(halves, "prandtl_ishlinskii", input_unit="mV", output_unit="urad")
    assert_allclose(sum(fit.model.weights_rad_v), 50e-6, rtol=3e-3)
    assert fit.bias_v == pytest.approx(30.0)


def test_weights_of_an_output_that_falls_with_the_drive_are_negative_in_model_and_values():
    fit = fit_hysteresis(
        recorded(NOISE - PLAYS.response(DRIVE - 30.0, 1 / RATE)), "prandtl_ishlinskii", output_unit="rad"
    )
    assert sum(fit.values.values()) == pytest.approx(-50e-6, rel=3e-3)
    assert sum(fit.model.weights_rad_v) == pytest.approx(-50e-6, rel=3e-3)


def test_models_that_are_none_are_refused():
    with pytest.raises(
        IdentificationError, match="no hysteresis model is called 'preisach'; there are bouc_wen, prandtl"
    ):
        fit_hysteresis(recorded(DRIVE * 1e-6), "preisach", output_unit="rad")


def test_a_measured_response_holds_the_truth_within_its_errors():
    rng = np.random.default_rng(1)
    drive = rng.standard_normal(20_000)
    taps = np.array([0.0, 0.4, 0.3, 0.2, 0.1])
    output = np.convolve(drive, taps)[:20_000] + 0.05 * rng.standard_normal(20_000)
    measured = measure_frequency_response(recording_from_arrays(drive, output, RATE))
    truth = np.exp(-2j * np.pi * np.outer(measured.freq_hz / RATE, np.arange(5))) @ taps
    score = np.abs(measured.response[:, 0, 0] - truth) / measured.standard_error[:, 0, 0]
    assert 0.5 < np.sqrt(np.mean(score**2)) < 1.5
    narrow = measure_frequency_response([recording_from_arrays(drive, output, RATE)], band_hz=(100.0, 1000.0), bands=20)
    assert narrow.freq_hz[0] > 100.0 and narrow.freq_hz[-1] < 1000.0


def test_periods_are_averaged_and_cut_to_a_band():
    lines = np.arange(1, 200)
    phases = np.random.default_rng(3).uniform(0, 2 * np.pi, lines.size)
    one = np.sum(np.cos(2 * np.pi * np.outer(np.arange(1000) / 1000, lines) + phases), axis=1)
    drive = np.tile(one, 6)
    output = 0.5 * np.roll(drive, 1) + 1e-3 * np.random.default_rng(4).standard_normal(drive.size)
    periodic = recording_from_arrays(drive, output, 1000.0, period_samples=1000)
    whole = measure_frequency_response(periodic)
    assert_allclose(np.abs(whole.response[:, 0, 0]), 0.5, rtol=0.02)
    cut = measure_frequency_response(periodic, band_hz=(20.0, 50.0))
    inside = (whole.freq_hz >= 20.0) & (whole.freq_hz <= 50.0)
    assert_allclose(cut.response, whole.response[inside], rtol=1e-12)
    assert cut.standard_error.shape == cut.response.shape and 0 < cut.freq_hz.size < whole.freq_hz.size
    with pytest.raises(IdentificationError, match=r"no excited line lies between 900 and 950 Hz; widen the band"):
        measure_frequency_response(periodic, band_hz=(900.0, 950.0))
    with pytest.raises(IdentificationError, match="some recordings state their period and others do not"):
        measure_frequency_response([periodic, recording_from_arrays(drive, output, 1000.0)])
    with pytest.raises(IdentificationError, match="no recording was given"):
        measure_frequency_response([])


def test_a_model_that_is_none_is_told_with_all_that_there_are_and_a_length_is_no_angle():
    with pytest.raises(IdentificationError) as caught:
        fit_hysteresis(recorded(DRIVE * 1e-6), "linear", output_unit="rad")
    assert str(caught.value) == (
        "no hysteresis model is called 'linear'; there are bouc_wen, prandtl_ishlinskii, bouc_wen_classical, "
        "bouc_wen_asymmetric, bouc_wen_creep, prandtl_ishlinskii_rate, prandtl_ishlinskii_creep, "
        "prandtl_ishlinskii_rate_creep."
    )
    with pytest.raises(IdentificationError, match=r"^the output unit is 'mm'; use an angle"):
        fit_hysteresis(recorded(DRIVE * 1e-6), "prandtl_ishlinskii", output_unit="mm")


def test_each_model_is_asked_for_with_its_options_and_its_numbers_are_named(monkeypatch):
    """Two records in mV that begin at 30 V and at 10 V."""
    given = {}

    def kept(name, fit):
        monkeypatch.setattr(alone, name, lambda *args, **words: given.update({name: (args, words)}) or fit)

    known = {"name": "own", "residual_rms_percent": 0.25, "rate_limit_v_per_s": 7.0, "samples_used": 11}
    known["not_identified"] = [("a", "because"), ("b", "of it")]
    kept(
        "fit_bouc_wen",
        SimpleNamespace(model=BOUC_WEN, values=np.arange(6.0), standard_errors=np.arange(6.0) / 10, **known),
    )
    weights = {"thresholds_v": np.array([0.0, 1.23456]), "weights_rad_per_v": np.array([3.0, 4.0]), "sign": -1}
    kept(
        "fit_prandtl_ishlinskii",
        SimpleNamespace(model=PLAYS, standard_errors_rad_per_v=np.array([0.5, np.nan]), **weights, **known),
    )
    joint = object.__new__(alone.JointFit)
    numbers = SimpleNamespace(values=np.array([8.0, 9.0]), standard_errors=np.array([0.8, 0.9]), not_identified=())
    structure = SimpleNamespace(parameters=[SimpleNamespace(name=name) for name in ("weight at 0 V", "creep at 1 s")])
    parts = {"fit": numbers, "structure": structure, "model": PLAYS, "creep": Creep((2e-6,), (1.0,))}
    for key, value in (parts | {name: known[name] for name in known if name != "not_identified"}).items():
        object.__setattr__(joint, key, value)
    kept("fit_joint", joint)
    both = [
        replace(recording_from_arrays(1e3 * DRIVE, DRIVE, RATE), drive=1e3 * (DRIVE + at)[:, None])
        for at in (0.0, -20.0)
    ]
    words = {"output_unit": "urad", "input_unit": "mV", "admissible": True, "seed": 5, "on_progress": print}
    units = Units("mV", "urad")
    fit = fit_hysteresis(both, "bouc_wen", **words)
    asked = {"seed": 5, "admissible": True, "on_progress": print, "units": units}
    assert given.pop("fit_bouc_wen") == ((both,), asked) and given == {}
    assert fit.values == {"d1": 0.0, "d2": 1.0, "epsilon": 2.0, "delta": 3.0, "alpha": 4.0, "beta": 5.0}
    assert fit.standard_errors["beta"] == 0.5 and fit.bias_v == pytest.approx(20.0)
    assert fit.model == replace(BOUC_WEN, bias_v=fit.bias_v) and fit.creep == Creep((), ())
    assert (fit.name, fit.residual_rms_percent, fit.rate_limit_v_s, fit.samples) == ("own", 0.25, 7.0, 11)
    assert fit.not_identified == (("a", "because"), ("b", "of it"))
    fit = fit_hysteresis(both[0], "prandtl_ishlinskii", **words)
    assert given.pop("fit_prandtl_ishlinskii") == ((both[:1],), {"units": units}) and given == {}
    assert fit.values == {"weight at 0 V": -3.0, "weight at 1.235 V": -4.0}
    assert fit.standard_errors["weight at 0 V"] == 0.5 and np.isnan(fit.standard_errors["weight at 1.235 V"])
    assert fit.bias_v == pytest.approx(30.0) and fit.model is PLAYS
    fit = fit_hysteresis(both, "prandtl_ishlinskii_rate", **words)
    asked = {"admissible": True, "seed": 5, "on_progress": print}
    assert given.pop("fit_joint") == ((both, "prandtl_ishlinskii_rate", units), asked) and given == {}
    assert (fit.values, fit.standard_errors["creep at 1 s"]) == ({"weight at 0 V": 8.0, "creep at 1 s": 9.0}, 0.9)
    assert fit.creep == Creep((2e-6,), (1.0,))
    assert [name for name, _ in fit.not_identified] == ["creep that is slower"]


def test_a_response_begins_at_rest_at_the_bias_and_has_creep_in_it():
    creep = Creep((3e-6, 1e-6), (0.01, 0.2))
    fit = alone.HysteresisFit("n", PLAYS, creep, 30.0, {}, {}, (), 0.1, 5.0, 9)
    moved = DRIVE - 30.0
    assert_allclose(fit.response(DRIVE, 1 / RATE), PLAYS.response(moved, 1 / RATE) + creep.response(moved, 1 / RATE))
    assert fit.admissible is PLAYS.admissible


# ------------------------------------------------------------------------------------------ numbers of Eq. 3 by hand
EQ3 = np.array([7e-5, 2e-4, -2e-5, 3e-3, 1.5, 0.4])
PARTS = (
    "loops fix the settled hysteresis |epsilon| / (alpha + sign(epsilon) beta), and only the few samples behind each "
    "reversal separate its parts{}; record small loops with many reversals"
)
LARGE = (
    "a large hysteresis that settles soon after each reversal looks like part of the linear slope; larger loops tell "
    "them apart"
)
ONE_RATE = "the recordings hold loops of one rate only; record the same loop at two more frequencies"


def problem_of(share=np.inf, falls=False):
    """Two records of unlike steps that Eq. 3 makes, each with its offset."""
    time = 1e-3 * np.arange(400)
    drives = (
        3.0 + np.sin(10 * np.pi * time) * np.linspace(0.5, 2.0, 400),
        1.5 * np.sin(0.036 * np.pi * np.arange(300)),
    )
    records = [
        SiRecord(name, "", drive, 1e-6 * drive, step_s, drive.size // 20)
        for name, drive, step_s in zip("ab", drives, (1e-3, 2e-3), strict=True)
    ]
    row = np.array([*EQ3, bouc_wen.BoucWenProblem(tuple(records), share).rate_limit, 0.0])
    made = [(-1.0 if falls else 1.0) * bouc_wen_response(r.drive_v, r.step_s, row, 0.0)[0] + 1e-4 for r in records]
    given = tuple(replace(r, output_rad=output) for r, output in zip(records, made, strict=True))
    return bouc_wen.BoucWenProblem(given, share)


@pytest.mark.parametrize(
    ("name", "one_rate", "at_bound", "reason"),
    [
        ("d1", True, True, LARGE),
        ("d2", True, False, ONE_RATE),
        ("d2", False, True, "its effect on the output is below the noise; faster loops would show it"),
        ("delta", True, True, ONE_RATE),
        ("delta", False, False, "the loops widen too little with rate to tell; record faster loops"),
        ("epsilon", True, False, PARTS.format("")),
        ("alpha", False, True, PARTS.format(" (on the bound of the admissible slope)")),
        ("beta", True, True, PARTS.format(" (on the bound of the admissible slope)")),
    ],
)
def test_why_a_number_of_eq_3_is_not_known_is_told_by_its_name_the_rates_and_the_bound(
    name, one_rate, at_bound, reason
):
    relative = {each: 0.6 if each == name else 0.01 for each in bouc_wen.PARAMETERS}
    covariance = np.diag((EQ3 * list(relative.values())) ** 2)
    assert bouc_wen._not_identified(EQ3, covariance, one_rate, at_bound) == (
        (name, f"relative standard error 60 %: {reason}"),
    )


@pytest.mark.parametrize(
    ("pair", "between", "told"),
    [
        ((0, 2), 0.96, ["d1: correlation 0.960 with epsilon", "epsilon: correlation 0.960 with d1"]),
        ((3, 5), -0.9876, ["delta: correlation 0.988 with beta", "beta: correlation 0.988 with delta"]),
        ((1, 4), 0.949, []),
        ((1, 4), 0.951, ["d2: correlation 0.951 with alpha", "alpha: correlation 0.951 with d2"]),
    ],
)
def test_two_numbers_of_eq_3_that_go_together_are_told_of_one_another(pair, between, told):
    errors = np.abs(EQ3) * 0.1
    covariance = np.diag(errors**2)
    covariance[pair] = covariance[pair[::-1]] = between * errors[pair[0]] * errors[pair[1]]
    found = bouc_wen._not_identified(EQ3, covariance, False, False)
    assert [f"{name}: {reason.split(': ')[0]}" for name, reason in found] == told


@pytest.mark.parametrize(
    ("signs", "lowest", "settled", "gradient"),
    [
        ((1, 1, 1), 1.0420747e-05, 1.1, "1.1131725e4 0 3.8961039e4 0 0.18890201 -0.70838253"),
        ((-1, -1, -1), 1.0420747e-05, 1.1, "-1.1131725e4 0 -3.8961039e4 0 0.18890201 0.70838253"),
        ((1, 1, -1), 3.5748988e-05, 1.9, "6.4446831e3 0 2.2556391e4 0 -0.063316185 -0.23743569"),
    ],
    ids=["rising", "falling", "beta below 0"],
)
def test_slope_decay_and_bound_of_eq_3_in_numbers_whichever_way_it_runs(signs, lowest, settled, gradient):
    d1, epsilon, beta = signs
    values = EQ3 * [d1, 1, epsilon, 1, 1, beta]
    assert bouc_wen.lowest_slope(problem_of(1.0), values) == pytest.approx(lowest, rel=1e-6)
    assert bouc_wen.k_settled(values) == pytest.approx(settled, rel=1e-12)
    assert bouc_wen._bound_gradient(values) == pytest.approx([float(v) for v in gradient.split()], rel=1e-6, abs=1e-9)
    assert bouc_wen.made_rising(BoucWen(*values)).d1_rad_v == 7e-5


@pytest.mark.parametrize("falls", [False, True])
def test_searched_numbers_of_two_records_give_back_the_six_they_were_made_of(falls):
    """The decays are alpha less beta and alpha with it, as epsilon is below 0, both in the range of the drives."""
    problem = problem_of(falls=falls)
    span, limit = max(np.ptp(r.drive_v) for r in problem.records), problem.rate_limit
    assert (problem.drive_span_v, limit) == (pytest.approx(span), pytest.approx(84.770305, rel=1e-6))
    theta = np.array([2e-4 * limit, 3e-3 * limit, np.log(1.1 * span), np.log(1.9 * span)])
    assert problem.physical(theta) == pytest.approx((2e-4, 3e-3, 1.1, 1.9))
    sign = -1.0 if falls else 1.0
    assert_allclose(problem.solve(theta), EQ3 * [sign, 1, sign, 1, 1, sign], rtol=1e-6)
    assert np.linalg.norm(problem.residual(theta)) < 1e-9
    assert problem_of(0.5).bound(theta) == pytest.approx(0.5 * 1.1 / 3.0)
    off = problem.residual([*theta, 0.0, 0.0, 0.1, 0.0])
    modelled = problem.columns([*theta, 0.0, 0.0, 0.1, 0.0])
    left = problem.target - modelled @ np.linalg.lstsq(modelled, problem.target, rcond=None)[0]
    assert_allclose(off, left / (problem.output_span_rad * np.sqrt(665)), atol=1e-12)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([0.0, 2.0, 1.0], "[0.0, 2.0, 1.0]"),
        ([0.0, 1.0, 1.0], "[0.0, 1.0, 1.0]"),
        ([0.5, 1.0], "[0.5, 1.0]"),
        ([0.0, np.inf], "[0.0, inf]"),
        ([], "[]"),
        ([[0.0, 1.0]], "[[0.0, 1.0]]"),
        ([0.0, 2.5], "[0.0, 2.5]"),
        (-1.0, "[-1.0]"),
    ],
)
def test_thresholds_of_plays_are_refused_with_half_of_the_largest_drive(given, words):
    small = SiRecord("a", "", np.array([0.0, 1.0, 0.0]), np.zeros(3), 1.0, 0)
    with pytest.raises(IdentificationError) as refused:
        prandtl_ishlinskii._thresholds((small, replace(small, drive_v=np.array([1.0, 6.0, 1.0]))), given, 9)
    assert str(refused.value) == (
        f"the thresholds {words} V cannot be used; they must start at 0, increase strictly and stay below half of the "
        "drive's peak-to-peak, 2.5 V, or an operator never moves both ways."
    )


@pytest.mark.parametrize(
    ("given", "operators", "expected"),
    [
        (None, 1, [0.0]),
        (None, 3, [0.0, 1.175, 2.35]),
        (0.0, 9, [0.0]),
        ([0, 2.4999], 9, [0.0, 2.4999]),
        ((0.0, 0.5, 1.5), 2, [0.0, 0.5, 1.5]),
    ],
)
def test_thresholds_of_plays_are_those_given_or_spread_evenly(given, operators, expected):
    record = SiRecord("a", "", np.array([1.0, 6.0, 1.0]), np.zeros(3), 1.0, 0)
    assert prandtl_ishlinskii._thresholds((record,), given, operators).tolist() == pytest.approx(expected)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("weights", "count"), [([3e-5, 0.0, 2e-5], 2), ([0.0, 0.0, 1e-5], 1), ([0.0] * 3, 0)])
def test_a_fit_of_plays_answers_from_its_first_drive_value_by_the_weights_in_use(sign, weights, count):
    fit = prandtl_ishlinskii.PrandtlIshlinskiiFit(
        np.array([0.0, 0.5, 1.0]), np.array(weights), np.zeros(3), sign, (0.0,), 40.0, Units(), 1.0, 1.0, 0.1, 99
    )
    drive = np.array([2.0, 3.5, 1.0, 4.0])  # the play of 1 V stands at 2, 2.5, 2, 3; that of 0 follows
    expected = sign * (weights[0] * drive + weights[2] * np.array([2.0, 2.5, 2.0, 3.0]))
    found, clamped = fit.response(drive, 0.1)
    assert_allclose(found, expected, atol=1e-18)
    assert (clamped, fit.parameter_count, fit.falling, fit.name) == (0, count, sign < 0, "prandtl_ishlinskii")
    assert fit.model == PrandtlIshlinskii((0.0, 0.5, 1.0), tuple(sign * w for w in weights), rate_limit_v_s=40.0)
    assert fit.admissible is True and fit.not_identified == ()


def test_the_unit_of_the_output_is_that_of_an_angle():
    with pytest.raises(IdentificationError) as caught:
        fit_hysteresis(recorded(DRIVE * 1e-6), "bouc_wen", output_unit="um")
    assert str(caught.value) == (
        "the output unit is 'um'; use an angle (rad, mrad, urad): a displacement over its lever arm is one."
    )
