"""Identification: recoveries, uncertainty, held-out honesty, and mirror files, each against known parameters."""

import math
import os
import re
import subprocess
import sys
import tomllib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.optimize
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from microrad.core.kernels import bouc_wen_response, play_response
from microrad.lab.identify import (
    FORMS,
    STATIC,
    BoucWenFit,
    IdentificationError,
    JointFit,
    Units,
    fit_bouc_wen,
    fit_prandtl_ishlinskii,
    identify,
    mirror_file,
    mirror_file_text,
    predict,
    statistics,
)
from microrad.lab.identify.hysteresis import bouc_wen as bouc_wen_of
from microrad.lab.identify.hysteresis import prandtl_ishlinskii as prandtl_of
from microrad.lab.identify.hysteresis.bouc_wen import PARAMETERS, _bound_gradient, _not_identified
from microrad.lab.identify.hysteresis.plant_fit import PlantFit
from microrad.lab.identify.hysteresis.plant_fit import _not_identified as _not_identified_jointly
from microrad.lab.identify.hysteresis.prandtl_ishlinskii import PrandtlIshlinskiiFit
from microrad.lab.identify.hysteresis.structures import LinearPoles, Roots, one_axis
from microrad.lab.identify.mirror_file import _names
from microrad.lab.identify.records import (
    SiRecord,
    centred,
    fastest_rate,
    lead,
    memory,
    si_records,
    transient,
    turning_points,
)
from microrad.lab.identify.selection import candidates, choice, predictions
from microrad.lab.identify.selection.choice import choose_best
from microrad.lab.identify.selection.warnings import _FLIPPED
from microrad.lab.identify.statistics import colour_inflation, may_be_chance
from microrad.lab.recording import Recording, read_recording, recording_from_arrays
from microrad.mirror.hysteresis import NO_CREEP, BoucWen, Creep, PrandtlIshlinskii
from microrad.mission.file import load_mirror
from places import DATA, ROOT

RATE_HZ = 50_000.0
D1, D2, EPSILON, DELTA, ALPHA, BETA = PAPER = (0.089e-3, -2.96e-7, -0.048e-3, 0.00047, 38.421, 34.635)
SETTLED = abs(EPSILON) / (ALPHA - BETA)
REAL = DATA / "piezo_1hz/Model_Vi_Do.dat"
needs_real = pytest.mark.skipif(not REAL.exists(), reason=f"real recording piezo_1hz absent: {REAL}")
UM = {"output_unit": "um", "lever_arm_m": 0.02}


def philox(seed):
    return np.random.Generator(np.random.Philox(seed))


def sine(freq_hz, seconds=0.1):
    return 6 * np.sin(2 * np.pi * freq_hz * np.arange(round(seconds * RATE_HZ)) / RATE_HZ) + 6


def record(freq_hz, seed=0, noise=0.01, seconds=0.1, values=PAPER):
    """The paper's record: mrad over V, with noise as a fraction of the peak-to-peak output."""
    drive = sine(freq_hz, seconds)
    output = 1e3 * bouc_wen_response(drive, 1 / RATE_HZ, np.array([*values, math.inf, 0.0]), 0.0)[0]
    output = output + noise * np.ptp(output) * philox(seed).standard_normal(output.size)
    return recording_from_arrays(drive, output, RATE_HZ, f"{freq_hz}Hz")


def independent_output_rad(freq_hz):
    """Eq. 3 by an adaptive solver that knows nothing of the kernels; the drive and its rate are exact."""
    omega = 2 * np.pi * freq_hz

    def rhs(t, h):
        rate = 6 * omega * math.cos(omega * t)
        forcing = EPSILON * math.exp(DELTA * abs(rate)) * rate
        return [forcing - BETA * rate * abs(h[0]) - ALPHA * abs(rate) * h[0]]

    t = np.arange(5000) / RATE_HZ
    h = solve_ivp(rhs, (0, t[-1]), [0.0], t_eval=t, rtol=1e-9, atol=1e-14, max_step=1e-4).y[0]
    return D1 * np.exp(-D2 * 6 * omega * np.cos(omega * t)) * sine(freq_hz) + h


def play_record(weights, thresholds, sign=1, seed=0, noise=0.002, rate_hz=1000.0):
    t = np.arange(4000) / rate_hz
    drive = 5 + 3.5 * np.sin(2 * np.pi * t) + 1.5 * np.sin(2 * np.pi * 3.1 * t)
    states = play_response(drive, np.array(thresholds), np.full(len(thresholds), drive[0]))
    output = sign * states @ np.array(weights) + 0.3
    output = output + noise * np.ptp(output) * philox(seed).standard_normal(output.size)
    return recording_from_arrays(drive, output, rate_hz, "play")


@pytest.fixture(scope="module")
def fit_100hz():
    return fit_bouc_wen([record(100)])


@pytest.fixture(scope="module")
def fit_trio():
    return fit_bouc_wen([record(60, 1), record(80, 2), record(100, 3)])


@pytest.fixture(scope="module")
def identification():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(candidates, "_STARTS", 4)
        return identify([record(100, 5), record(60, 6)], models=STATIC)


# -------------------------------------------------------------------------------------------------- recovery, Bouc-Wen
@pytest.mark.promise("identify-19")
def test_recovers_the_paper_from_100_hz(fit_100hz):
    assert abs(fit_100hz.model.d1_rad_v / D1 - 1) < 0.002
    assert abs(fit_100hz.model.delta_s_v / DELTA - 1) < 0.05
    ratio = abs(fit_100hz.model.epsilon_rad_v) / (fit_100hz.model.alpha_1_v - fit_100hz.model.beta_1_v)
    assert abs(ratio / SETTLED - 1) < 0.08
    assert fit_100hz.settled_hysteresis_rad[0] == pytest.approx(ratio, rel=1e-12)
    assert fit_100hz.model.epsilon_rad_v < 0 < fit_100hz.model.d1_rad_v
    assert 0.9 < fit_100hz.residual_rms_percent < 1.0  # the noise is 1 % of the clean span, which noise widens
    np.testing.assert_array_less(abs(fit_100hz.values - PAPER) / fit_100hz.standard_errors, 3.5)


@pytest.mark.parametrize("freq_hz", [60, 80])
def test_100_hz_predicts_other_frequencies(fit_100hz, freq_hz):
    prediction = predict(fit_100hz, record(freq_hz, noise=0.0))
    residual = prediction.residual_rad[prediction.start :]
    rms_percent = 100 * np.sqrt(np.mean(residual**2)) / np.ptp(prediction.measured_rad)
    assert 0 < rms_percent < 0.3
    assert prediction.clamped == 0


@pytest.mark.promise("identify-29")
def test_a_rate_beyond_the_fitted_one_is_clamped_and_counted(fit_100hz):
    assert fit_100hz.rate_limit_v_per_s == pytest.approx(6 * 2 * np.pi * 100, rel=0.01)
    fast = record(140, noise=0.0)
    rate = np.abs(np.diff(fast.drive[:, 0])) * RATE_HZ
    prediction = predict(fit_100hz, fast)
    assert prediction.clamped == pytest.approx(np.sum(rate > fit_100hz.rate_limit_v_per_s), abs=50)
    assert prediction.clamped > 1000
    free = replace(fit_100hz, model=replace(fit_100hz.model, rate_limit_v_s=math.inf))
    assert np.abs(free.response(fast.drive[:, 0], fast.step_s)[0] - prediction.model_rad).max() > 1e-6


@pytest.mark.promise("identify-23")
def test_residuals_are_in_per_cent_of_the_largest_fitted_output():
    small = play_record([0.05, 0.02], [0.0, 1.0])
    large = replace(small, drive=2.0 * small.drive, output=2.0 * small.output, path="large", sha256="large")
    found = identify([small, large], 0.5, models=("prandtl_ishlinskii",))
    assert found.span_rad == pytest.approx(1e-3 * np.ptp(large.output[:2000]))
    left = np.concatenate([p.residual_rad[p.split :] for p in found.predictions[0]])
    assert found.score().held_out_rms_percent == pytest.approx(100 * np.sqrt(np.mean(left**2)) / found.span_rad)


@pytest.mark.promise("identify-24")
@pytest.mark.parametrize(
    ("error", "between", "named"), [(0.48, 0.0, False), (0.52, 0.0, True), (0.1, 0.94, False), (0.1, -0.96, True)]
)
def test_what_counts_as_not_identified(error, between, named):
    values = np.array(PAPER)
    size = np.where(np.arange(6) == 0, error, 0.01) * np.abs(values)
    correlation = np.eye(6)
    correlation[0, 1] = correlation[1, 0] = between
    covariance = size[:, None] * correlation * size
    assert ("d1" in {each.name for each in _not_identified(values, covariance, False, False)}) == named
    structure = SimpleNamespace(
        parameters=[SimpleNamespace(name=f"p{k}", lower=-math.inf, upper=math.inf, unit="") for k in range(6)]
    )
    assert ("p0" in dict(_not_identified_jointly(structure, values, covariance))) == named
    structure.parameters[3].upper = values[3]
    assert "at its bound" in dict(_not_identified_jointly(structure, values, covariance))["p3"]


@pytest.mark.parametrize(
    ("value", "error", "fact"),
    [
        (2.0, 1.0, None),
        (2.0, 1.25, "relative standard error 62 %"),
        (-2.0, 1.25, "relative standard error 62 %"),
        (-2.0, 2.0, "relative standard error 100 %"),
        (2.0, 2.5, "not told from 0: standard error 2.5 mm"),
        (-3.0, 0.5, "at its bound, -3 mm"),
        (3.0, 0.5, "at its bound, 3 mm"),
    ],
)
def test_why_a_parameter_of_a_mirror_is_not_identified(value, error, fact):
    """Half of the size is enough, and all of it is still more than nothing; a bound goes before either."""
    structure = SimpleNamespace(parameters=[SimpleNamespace(name="p", lower=-3.0, upper=3.0, unit="mm")])
    found = _not_identified_jointly(structure, np.array([value]), np.array([[error**2]]))
    assert found == ([] if fact is None else [("p", fact)])


def test_why_a_parameter_of_eq_3_is_not_identified():
    values = np.array(PAPER)
    size = 0.01 * np.abs(values)

    def found(one_rate=False, at_bound=False, **errors):
        own = np.where([name in errors for name in PARAMETERS], [errors.get(name, 0.0) for name in PARAMETERS], 0.01)
        spread = own * np.abs(values)
        return dict(_not_identified(values, np.diag(spread**2), one_rate, at_bound))

    assert found(d1=0.6)["d1"].startswith("relative standard error 60 %: a large hysteresis that settles soon after")
    assert found(d2=0.6)["d2"].startswith("relative standard error 60 %: its effect on the output is below the noise")
    assert found(delta=0.6)["delta"].startswith("relative standard error 60 %: the loops widen too little with rate")
    one_rate = found(one_rate=True, d2=0.6, delta=0.6, alpha=0.6)
    assert "hold loops of one rate only" in one_rate["d2"] and "hold loops of one rate only" in one_rate["delta"]
    assert "hold loops of one rate only" not in one_rate["alpha"]
    for name in ("epsilon", "alpha", "beta"):
        assert "separate its parts; record small loops" in found(**{name: 0.6})[name]
        bound = found(at_bound=True, **{name: 0.6})[name]
        assert "separate its parts (on the bound of the admissible slope); record small loops" in bound
    between = np.eye(6)
    between[4, 5] = between[5, 4] = -0.97
    told = dict(_not_identified(values, size[:, None] * between * size, False, False))
    assert set(told) == {"alpha", "beta"}
    assert told["alpha"].startswith("correlation 0.970 with beta: loops fix the settled hysteresis")


@pytest.mark.promise("identify-27")
@pytest.mark.endurance
def test_other_processors_find_the_same_parameters():
    """Other kernels of BLAS move the parameters of a chosen model by less than a hundredth of their errors."""
    code = (
        "import sys; sys.path[:0] = ['tests', 'tests/lab']\n"
        "import numpy as np, truths\n"
        "from microrad.lab.identify import identify\n"
        "def of(drive, seed, name, **words):\n"
        "    strain = truths.plays(drive, (0.0, 0.6, 1.9), (6e-5, 1.5e-5, 1e-5))\n"
        "    output = truths.behind_resonance(strain, 4000.0, held=True)\n"
        "    return truths.recorded(drive, output, 4000.0, seed=seed, name=name, **words)\n"
        "loops = [of(truths.two_sines(6000, 4000.0, f), k, f'{f}') for k, f in enumerate((2.0, 12.0))]\n"
        "wide = of(truths.small_multisine(4000.0, 4000, 2), 0, 'wide', noise=3e-3, period=4000)\n"
        "fit = identify([wide, *loops], models=('linear', 'prandtl_ishlinskii_joint')).fit().fit\n"
        "print(*fit.values.tolist(), *fit.standard_errors.tolist())"
    )
    found = []
    for kernels in ("Prescott", "Haswell"):
        environment = {**os.environ, "OPENBLAS_CORETYPE": kernels, "OPENBLAS_NUM_THREADS": "1"}
        ran = subprocess.run(
            [sys.executable, "-c", code], env=environment, cwd=ROOT, capture_output=True, text=True, check=True
        )
        found.append(np.array(list(map(float, ran.stdout.split()))).reshape(2, -1))
    (one, errors), (other, _) = found
    assert np.all(np.abs(one - other) <= 0.01 * errors) and np.all(errors >= 0.0) and one.size > 5


def test_recovers_from_an_independent_generator():
    output = 1e3 * independent_output_rad(100)
    noisy = output + 0.01 * np.ptp(output) * philox(7).standard_normal(output.size)
    fit = fit_bouc_wen([recording_from_arrays(sine(100), noisy, RATE_HZ)], starts=3)
    assert abs(fit.model.d1_rad_v / D1 - 1) < 3.5 * fit.standard_errors[0] / D1 < 0.01
    assert abs(fit.model.delta_s_v / DELTA - 1) < 0.05
    assert abs(fit.settled_hysteresis_rad[0] / SETTLED - 1) < 0.08
    for freq_hz in (60,):
        truth = 1e3 * independent_output_rad(freq_hz)
        prediction = predict(fit, recording_from_arrays(sine(freq_hz), truth, RATE_HZ))
        residual = prediction.residual_rad[prediction.start :]
        assert 0 < np.sqrt(np.mean(residual**2)) < 0.01 * np.ptp(prediction.measured_rad)


def test_clean_data_give_the_parameters_back():
    fit = fit_bouc_wen([record(100, noise=0.0), record(60, noise=0.0)], starts=2)
    # The rate limit is the 99.5 % quantile of the smoothed rate, 0.02 % below the peak: it clamps the last of delta.
    np.testing.assert_allclose(fit.values, PAPER, rtol=5e-3)
    assert fit.residual_rms_percent < 1e-3
    assert fit.agreeing_starts == 2


def test_several_records_know_more(fit_100hz, fit_trio):
    np.testing.assert_array_less(fit_trio.standard_errors, fit_100hz.standard_errors)
    np.testing.assert_array_less(abs(fit_trio.values - PAPER) / fit_trio.standard_errors, 3.5)
    assert abs(fit_trio.model.d1_rad_v / D1 - 1) < 0.002
    assert len(fit_trio.offsets_rad) == 3
    assert fit_trio.samples_used < 15_000


@pytest.mark.promise("identify-6")
def test_offsets_are_found_per_record():
    records = [record(100, 1), record(60, 2)]
    shifted = [replace(r, output=r.output + c) for r, c in zip(records, (0.5, -2.0), strict=True)]
    before, after = fit_bouc_wen(records, starts=1), fit_bouc_wen(shifted, starts=1)
    np.testing.assert_allclose(np.subtract(after.offsets_rad, before.offsets_rad), [0.5e-3, -2e-3], rtol=1e-3)
    np.testing.assert_allclose(after.values, before.values, rtol=1e-3)


def test_falling_output_turns_the_signs(fit_100hz):
    rising = record(100)
    fit = fit_bouc_wen([replace(rising, output=-rising.output)], starts=2)
    turned = fit_100hz.values * [-1, 1, -1, 1, 1, -1]
    np.testing.assert_allclose(fit.values, turned, rtol=1e-3)
    assert fit.slope_after_reversal_rad_per_v == pytest.approx(fit_100hz.slope_after_reversal_rad_per_v, rel=1e-3)


def test_bounded_hysteresis(fit_100hz, fit_trio):
    for fit in (fit_100hz, fit_trio):
        assert fit.model.alpha_1_v > abs(fit.model.beta_1_v) > 0


# ---------------------------------------------------------------------------------------------------- starts and seeds
@pytest.mark.promise("identify-26")
def test_starts_are_reported(fit_100hz):
    costs = np.array(fit_100hz.start_rms_percent)
    assert costs.shape == (12,)
    assert 6 <= fit_100hz.agreeing_starts <= 12
    assert fit_100hz.agreeing_starts == np.sum(costs <= costs.min() * math.sqrt(1.001))


@pytest.mark.promise("identify-26")
def test_a_start_in_a_wrong_minimum_is_not_counted():
    fit = fit_bouc_wen([record(100)], admissible=True)
    assert 1 <= fit.agreeing_starts < 12
    assert max(fit.start_rms_percent) > 1.005 * min(fit.start_rms_percent)


def test_same_seed_same_fit():
    recordings = [record(60, 1), record(100, 3)]
    one, again = (fit_bouc_wen(recordings, starts=3) for _ in range(2))
    np.testing.assert_array_equal(again.values, one.values)
    assert again.start_rms_percent == one.start_rms_percent
    other = fit_bouc_wen(recordings, starts=3, seed=1)
    assert other.start_rms_percent[1:] != one.start_rms_percent[1:]
    np.testing.assert_allclose(other.values, one.values, rtol=1e-3)


def test_progress_is_called_per_start():
    calls = []
    fit_bouc_wen([record(100)], starts=3, on_progress=lambda *args: calls.append(args))
    assert [call[:2] for call in calls] == [(1, 3), (2, 3), (3, 3)]


# --------------------------------------------------------------------------------------------------------- uncertainty
@pytest.mark.promise("identify-24")
def test_standard_errors_match_the_scatter():
    fits = [fit_bouc_wen([record(100, 10 + seed)], starts=1) for seed in range(12)]
    scatter = np.std([fit.values for fit in fits], axis=0, ddof=1)
    reported = np.median([fit.standard_errors for fit in fits], axis=0)
    np.testing.assert_array_less(scatter, 2 * reported)
    np.testing.assert_array_less(reported, 2 * scatter)
    settled = np.array([fit.settled_hysteresis_rad for fit in fits])
    assert 0.5 < np.std(settled[:, 0], ddof=1) / np.median(settled[:, 1]) < 2


def test_condition_and_correlation(fit_100hz, fit_trio):
    assert 2000 < fit_100hz.condition_number < 5000
    assert 2000 < fit_trio.condition_number < 5000
    np.testing.assert_allclose(np.diag(fit_100hz.correlation), 1.0)
    assert fit_100hz.correlation[4, 5] > 0.95
    np.testing.assert_allclose(fit_100hz.covariance, fit_100hz.covariance.T)


@pytest.mark.promise("identify-24")
def test_parameters_not_identified_are_named_with_reason(fit_100hz, fit_trio):
    reasons = {item.name: item.reason for item in fit_100hz.not_identified}
    assert {"alpha", "beta", "d2"} <= set(reasons)
    assert "delta" not in reasons
    assert "one rate only" in reasons["d2"]
    assert "settled hysteresis" in reasons["alpha"]
    assert "correlation 0.99" in reasons["alpha"]
    assert not any("one rate only" in item.reason for item in fit_trio.not_identified)


def test_delta_is_not_identified_from_a_triangle_of_one_rate():
    t = np.arange(5000) / RATE_HZ
    drive = 12 * np.abs((100 * t + 0.25) % 1 * 2 - 1)
    output = 1e3 * bouc_wen_response(drive, 1 / RATE_HZ, np.array([*PAPER, math.inf, 0.0]), 0.0)[0]
    output += 0.01 * np.ptp(output) * philox(4).standard_normal(output.size)
    fit = fit_bouc_wen([recording_from_arrays(drive, output, RATE_HZ)], starts=4)
    reasons = {item.name: item.reason for item in fit.not_identified}
    assert "one rate only" in reasons["delta"]


@pytest.mark.promise("identify-24")
def test_coloured_residuals_inflate_the_errors():
    white = philox(1).standard_normal(20_000)
    assert 1.0 <= colour_inflation([white]) < 1.2
    coloured = np.empty_like(white)
    coloured[0] = white[0]
    for k in range(1, white.size):
        coloured[k] = 0.9 * coloured[k - 1] + white[k]
    assert colour_inflation([coloured]) == pytest.approx(19.0, rel=0.25)  # (1 + 0.9) / (1 - 0.9)
    assert colour_inflation([white, coloured]) == colour_inflation([coloured])


def test_a_difference_of_models_may_be_chance_where_the_noise_is_coloured():
    """Three standard errors of white noise are less than one of noise of which only one sample in 19 is new."""
    white = philox(1).standard_normal(20_000)
    coloured = lfilter([1.0], [1.0, -0.9], white)
    for noise, chance in ((white, False), (coloured, True)):
        difference = noise - noise.mean() + 3.0 * noise.std() / math.sqrt(noise.size)
        assert may_be_chance([difference], [np.zeros(noise.size)]) is chance
    assert may_be_chance([white], [white])


def test_residuals_of_nothing_and_of_one_pair_have_a_colour_too():
    assert colour_inflation([np.zeros(100)]) == 1.0
    assert colour_inflation([np.array([1.0, 1.0, -1.0, -1.0])]) == pytest.approx(1.5)  # lags 0 and 1: 1 and 1 / 4
    assert colour_inflation([np.array([1.0, -1.0, 1.0, -1.0])]) == 1.0  # never less than white


def test_a_residual_of_one_step_is_not_taken_round_from_its_end_to_its_begin():
    """Halves of -1 and 1 have the autocorrelation 1 - 3 k / n up to the middle, whose sum to n / 3 is n / 6."""
    step = np.repeat([-1.0, 1.0], 600)
    assert colour_inflation([step]) == pytest.approx(1200 / 3, rel=0.01)


# -------------------------------------------------------------------------------------------------------- admissibility
def test_slope_after_reversal_against_a_slow_loop():
    """The printed set turns against the drive, dh/du = -0.974 mrad/V in the limit of no rate; seen in a simulation."""
    fit = fit_bouc_wen([record(100, noise=0.0)], starts=1)
    exact = D1 - 2 * ALPHA * SETTLED
    assert fit.slope_after_reversal_rad_per_v == pytest.approx(exact, rel=5e-3)
    drive = np.concatenate([np.linspace(0, 12, 200_001), np.linspace(12, 11.9, 100_001)])
    output, _ = replace(fit, model=replace(fit.model, delta_s_v=0.0)).response(drive, 1.0)
    measured = (output[200_100] - output[200_000]) / (drive[200_100] - drive[200_000])
    assert measured == pytest.approx(exact, rel=0.02)
    assert not fit.admissible


def test_lowest_slope_is_that_of_the_modelled_output(fit_100hz):
    prediction = predict(fit_100hz, record(100, noise=0.0))
    drive = sine(100)[prediction.start :]
    model = prediction.model_rad[prediction.start :]
    numeric = np.diff(model)[np.diff(drive) != 0] / np.diff(drive)[np.diff(drive) != 0]
    assert fit_100hz.lowest_slope_rad_per_v < 0
    assert numeric.min() < 0
    assert fit_100hz.lowest_slope_rad_per_v <= numeric.min()  # the slope eases within the step behind a reversal


@pytest.mark.promise("identify-19", "identify-22")
@pytest.mark.parametrize("freqs", [pytest.param((100,), marks=pytest.mark.endurance), (60, 80, 100)])
def test_admissible_fit_never_turns_against_the_drive(freqs):
    recordings = [record(f, i) for i, f in enumerate(freqs)]
    free, bound = (fit_bouc_wen(recordings, starts=2, admissible=admissible) for admissible in (False, True))
    assert not free.admissible
    assert bound.admissible
    assert bound.constrained
    assert bound.residual_rms_percent > free.residual_rms_percent
    for r in recordings:
        drive = r.drive[:, 0]
        start = transient(drive)
        lowest = []
        for fit in (free, bound):
            model, _ = replace(fit, model=replace(fit.model, d2_s_v=0.0)).response(
                drive, r.step_s
            )  # d2 is a lag, not a wrong way
            travel = np.diff(drive[start:])
            moving = np.abs(travel) > 1e-9
            lowest.append(np.min(np.diff(model[start:])[moving] / travel[moving]))
        assert lowest[0] < -2 * D1
        assert lowest[1] > -2e-3 * D1


def test_admissible_set_is_recognised():
    gentle = (D1, D2, -0.022e-3, DELTA, 2.4, 0.6)
    fit = fit_bouc_wen([record(60, noise=0.0, values=gentle)], starts=2)
    assert fit.slope_after_reversal_rad_per_v == pytest.approx(D1 - 0.022e-3 * 4.8 / 1.8, rel=1e-2)
    assert fit.admissible


# --------------------------------------------------------------------------------------------------- play operators
@pytest.mark.promise("identify-19")
def test_play_weights_are_recovered():
    thresholds, weights = [0.0, 0.5, 1.0, 2.0], [0.05, 0.01, 0.0, 0.03]
    fit = fit_prandtl_ishlinskii([play_record(weights, thresholds)], thresholds)
    errors = np.nan_to_num(fit.standard_errors_rad_per_v, nan=5e-7)
    np.testing.assert_array_less(abs(fit.weights_rad_per_v - 1e-3 * np.array(weights)), 4 * errors)
    assert np.nanmax(fit.standard_errors_rad_per_v) < 5e-7
    assert np.array_equal(np.isnan(fit.standard_errors_rad_per_v), fit.weights_rad_per_v == 0)
    assert 0.15 < fit.residual_rms_percent < 0.25
    assert fit.sign == 1


def test_play_standard_errors_match_the_scatter():
    thresholds, weights = [0.0, 0.5, 2.0], [0.05, 0.02, 0.03]
    fits = [fit_prandtl_ishlinskii([play_record(weights, thresholds, seed=s)], thresholds) for s in range(20)]
    scatter = np.std([fit.weights_rad_per_v for fit in fits], axis=0, ddof=1)
    reported = np.median([fit.standard_errors_rad_per_v for fit in fits], axis=0)
    np.testing.assert_array_less(scatter, 2 * reported)
    np.testing.assert_array_less(reported, 2 * scatter)


def test_falling_play_is_fitted_by_its_sign():
    thresholds, weights = [0.0, 0.5, 2.0], [0.05, 0.02, 0.03]
    rising = fit_prandtl_ishlinskii([play_record(weights, thresholds, noise=0)], thresholds)
    falling = fit_prandtl_ishlinskii([play_record(weights, thresholds, sign=-1, noise=0)], thresholds)
    assert (rising.sign, falling.sign) == (1, -1)
    np.testing.assert_allclose(falling.weights_rad_per_v, rising.weights_rad_per_v, rtol=1e-9)


def test_a_threshold_from_half_of_the_drive_on_is_refused_with_that_half():
    record = play_record([0.05, 0.02], [0.0, 1.0])
    half = np.ptp(record.drive) / 2.0
    with pytest.raises(IdentificationError, match=f"below half of the drive's peak-to-peak, {half:g} V, or"):
        fit_prandtl_ishlinskii([record], [0.0, half])
    assert fit_prandtl_ishlinskii([record], [0.0, 0.999 * half]).thresholds_v[1] == 0.999 * half


@pytest.mark.promise("identify-51")
def test_default_thresholds():
    fit = fit_prandtl_ishlinskii([play_record([0.05, 0.03], [0.0, 1.0])], operators=7)
    assert fit.thresholds_v.size == 7
    assert fit.thresholds_v[0] == 0
    assert 0.4 < fit.thresholds_v[-1] / np.ptp(play_record([0.05], [0.0]).drive) < 0.5


@pytest.mark.promise("identify-51")
@pytest.mark.parametrize("thresholds", [[0.5, 1.0], [0.0, 1.0, 1.0], [0.0, 50.0], [0.0, math.nan], [[0.0, 1.0]], []])
def test_thresholds_are_refused(thresholds):
    with pytest.raises(IdentificationError, match="must start at 0"):
        fit_prandtl_ishlinskii([play_record([0.05], [0.0])], thresholds)


# --------------------------------------------------------------------------------------------------- shared machinery
@pytest.mark.promise("identify-18")
def test_what_a_mirror_remembers_is_ramps_over_what_the_drive_has_swept():
    """Eighths of the range up to the last known sample; where that is nothing, of 1 V."""
    found = memory(np.array([1.0, 5.0, 9.0, 3.0, -7.0]), 4)
    np.testing.assert_array_equal(found.sum(axis=1), [0.0, 4.0, 8.0, 8.0, 8.0])
    np.testing.assert_array_equal(found[1], [1.0] * 4 + [0.0] * 4)
    still = memory(np.array([2.0, 2.0, 3.5]), 2)
    np.testing.assert_array_equal(still[:, :2], [[0.0, 0.0], [0.0, 0.0], [1.0, 0.5]])
    assert turning_points(np.full(50, 3.0)).size == 0


def test_transient_is_one_sweep_of_the_range():
    assert transient(sine(100)) == pytest.approx(500 * 0.6782, abs=2)  # up from the middle, then down to -0.9
    assert transient(np.linspace(0, 1, 1000)) == 500  # never more than half


@pytest.mark.promise("identify-29")
def test_fastest_rate_ignores_spikes_and_noise():
    exact = 6 * 2 * np.pi * 100
    clean = record(100)
    drive = clean.drive[:, 0] + 0.003 * philox(2).standard_normal(clean.samples)
    drive[1000] += 2.0
    for r in (clean, replace(clean, drive=drive[:, None])):
        assert fastest_rate(si_records([r], Units())) == pytest.approx(exact, rel=0.02)
    assert np.max(np.abs(np.diff(drive))) * RATE_HZ > 10 * exact


@pytest.mark.parametrize("unit, factor", [("rad", 1e-3), ("urad", 1e3), ("m", 2e-5), ("mm", 2e-2), ("um", 20.0)])
def test_output_units(fit_100hz, unit, factor):
    """0.02 m of lever arm turns 1 mrad into 20 um."""
    original = record(100)
    scaled = replace(original, output=original.output * factor, drive=original.drive * 1e3)
    arm = 0.02 if unit in ("m", "mm", "um") else None
    fit = fit_bouc_wen([scaled], starts=1, units=Units("mV", unit, arm))
    np.testing.assert_allclose(fit.values, fit_100hz.values, rtol=1e-3)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"output_unit": "um"}, "--lever-arm, lever_arm_m"),
        ({"output_unit": "um", "lever_arm_m": 0.0}, "positive length"),
        ({"output_unit": "um", "lever_arm_m": math.nan}, "positive length"),
        ({"output_unit": "um", "lever_arm_m": math.inf}, r"the lever arm is inf m; give a positive length in metres\."),
        ({"output_unit": "mrad", "lever_arm_m": 0.1}, "already an angle"),
        ({"output_unit": "deg"}, "output unit 'deg'"),
        ({"input_unit": "kV"}, "input unit 'kV'"),
    ],
)
def test_units_are_refused(words, message):
    with pytest.raises(IdentificationError, match=message):
        identify([record(100)], **words)


@pytest.mark.promise("identify-8")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"hold_out": 0.0}, "hold_out\\) is 0.0"),
        ({"hold_out": 1.0}, "hold_out\\) is 1.0"),
        ({"hold_out": 0.999}, "5 samples to fit and 4995 to check"),
        ({"hold_out": 0.001}, "4995 samples to fit and 5 to check"),
        ({"models": ("preisach",)}, "preisach"),
        ({"models": ()}, "cannot be used"),
        ({"models": ("bouc_wen", "bouc_wen")}, "each once"),
    ],
)
def test_identify_refuses(words, message):
    with pytest.raises(IdentificationError, match=message):
        identify([record(100)], **words)


def test_other_refusals(fit_100hz):
    with pytest.raises(IdentificationError, match="no recording"):
        fit_bouc_wen([])
    with pytest.raises(IdentificationError, match="no recording was given; name at least one"):
        identify([])
    with pytest.raises(IdentificationError, match="0 starts"):
        fit_bouc_wen([record(100)], starts=0)
    with pytest.raises(IdentificationError, match="0 play operators"):
        fit_prandtl_ishlinskii([record(100)], operators=0)
    assert fit_prandtl_ishlinskii([record(100)], operators=1).thresholds_v.tolist() == [0.0]
    ramp = np.linspace(0, 1, 500)
    with pytest.raises(IdentificationError, match="never reverses"):
        fit_bouc_wen([recording_from_arrays(ramp, ramp**2, 100.0)])
    for split in (-1, 1, 5001):
        with pytest.raises(IdentificationError, match=f"split {split} "):
            predict(fit_100hz, record(100), split)
    assert [predict(fit_100hz, record(100), split).split for split in (2, 5000)] == [2, 5000]
    with pytest.raises(IdentificationError, match="no recording was given"):
        identify([], models=candidates.MODELS)  # all of them may be asked for at once
    for models in ((), ("bouc_wen", "bouc_wen"), ("bouc_wen", "other")):
        with pytest.raises(IdentificationError, match=r"cannot be used; name each once, out of prandtl_ishlinskii, "):
            identify([], models=models)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"drive": np.zeros((5000, 2))}, "2 drives and 1 output; one of each is identified here"),
        ({"output": np.zeros((5000, 2))}, "1 drive and 2 outputs; one of each is identified here"),
        ({"drive": np.ones((5000, 1))}, "drive or output is constant in the part that is fitted"),
        ({"output": np.ones((5000, 1))}, "drive or output is constant in the part that is fitted"),
    ],
)
def test_a_record_that_no_hysteresis_is_fitted_to(change, message):
    with pytest.raises(IdentificationError, match=message):
        fit_prandtl_ishlinskii([replace(record(100), **change)])


def test_records_without_a_digest_may_be_given_twice():
    twice = [record(100), replace(record(100), path="again")]
    with pytest.raises(IdentificationError, match="again: the same data as "):
        identify(twice, hold_out=1.0)
    with pytest.raises(IdentificationError, match=r"hold_out\) is 1\.0"):
        identify([replace(each, sha256="") for each in twice], hold_out=1.0)


def test_a_drive_of_steps_has_a_rate(monkeypatch):
    monkeypatch.setattr(candidates, "_STARTS", 2)
    drive = np.where(np.sin(2 * np.pi * 7 * np.arange(2000) / 1000) > 0, 1.0, 0.0)
    assert fastest_rate(si_records([recording_from_arrays(drive, drive, 1000.0)], Units())) > 100
    assert identify([recording_from_arrays(drive, drive + 0.01 * philox(1).standard_normal(2000), 1000.0)]).warnings


# ----------------------------------------------------------------------------------------------------------- held out
@pytest.mark.promise("identify-1", "identify-11")
def test_choice_on_held_out_samples(identification):
    by_name = {score.model: score for score in identification.scores}
    assert identification.chosen == "bouc_wen"
    assert 0.85 < by_name["bouc_wen"].held_out_rms_percent < 1.05
    assert by_name["prandtl_ishlinskii"].held_out_rms_percent > 1.3 * by_name["bouc_wen"].held_out_rms_percent
    assert identification.straight_line.held_out_rms_percent > 2 * by_name["prandtl_ishlinskii"].held_out_rms_percent
    for score in (*identification.scores, identification.straight_line):
        assert score.fit_peak_percent > 2 * score.fit_rms_percent
        assert score.held_out_peak_percent > 2 * score.held_out_rms_percent
        assert f"{score.held_out_rms_percent:.3g} %" in identification.reason


@pytest.mark.promise("identify-23")
def test_straight_line_is_the_least_squares_line():
    r = play_record([0.05, 0.03], [0.0, 1.0])
    result = identify([r], 0.5, models=("prandtl_ishlinskii",))
    drive, output = r.drive[:, 0], r.output[:, 0]
    start = lead(2000)
    line = np.polyfit(drive[start:2000], output[start:2000], 1)
    residual = output - np.polyval(line, drive)
    span = np.ptp(output[:2000])
    assert result.straight_line.fit_rms_percent == pytest.approx(100 * np.std(residual[start:2000]) / span, rel=1e-9)
    held_out = 100 * np.sqrt(np.mean(residual[2000:] ** 2)) / span
    assert result.straight_line.held_out_rms_percent == pytest.approx(held_out, rel=1e-9)


@pytest.mark.promise("identify-8", "identify-9")
def test_held_out_samples_are_not_seen_by_the_fit(monkeypatch):
    monkeypatch.setattr(candidates, "_STARTS", 2)
    original = record(100, 5, seconds=0.2)
    drive, output = original.drive.copy(), original.output.copy()
    drive[5000:] = 3 * drive[5000:][::-1]
    output[5000:] = 7 + philox(9).standard_normal((5000, 1))
    changed = replace(original, drive=drive, output=output)
    a, b = (identify([r], 0.5) for r in (original, changed))
    for x, y in zip(a.fits, b.fits, strict=True):
        for name in ("values", "covariance") if isinstance(x, BoucWenFit) else ("weights_rad_per_v", "thresholds_v"):
            np.testing.assert_array_equal(getattr(x, name), getattr(y, name))
        assert x.offsets_rad == y.offsets_rad
        assert x.rate_limit_v_per_s == y.rate_limit_v_per_s
    assert [s.fit_rms_percent for s in a.scores] == [s.fit_rms_percent for s in b.scores]
    assert b.scores[0].held_out_rms_percent > 50 * a.scores[0].held_out_rms_percent
    assert a.unsupported == ""
    assert "on the held-out samples, where a straight line does as well" in b.unsupported
    assert b.unsupported.endswith("and another recording to judge by.")
    assert "belong together" not in b.unsupported
    assert any("held-out samples lie outside" in w for w in b.warnings)
    assert any("The residual grows" in w for w in b.warnings)


@pytest.mark.promise("identify-9")
def test_states_are_carried_into_the_held_out_part():
    r = play_record([0.05, 0.05], [0.0, 2.0], noise=0)
    fit = fit_prandtl_ishlinskii([r], [0.0, 2.0])
    whole = predict(fit, r, 1700)
    assert np.max(np.abs(whole.residual_rad[whole.start :])) < 1e-12
    drive = r.drive[:, 0]
    fresh = fit.response(drive[1700:], r.step_s)[0] - fit.response(drive, r.step_s)[0][1700:]
    assert np.max(np.abs(fresh)) > 1e-6


@pytest.mark.promise("identify-1", "identify-29")
def test_warnings_of_two_rates(identification):
    text = "\n".join(identification.warnings)
    assert "drives from 0 V to 12 V" in text
    assert re.search(r"Not valid above 37[67]\d V/s", text)
    assert re.search(r"at (99\.9\d|100) Hz", text)
    assert "Not admissible" in text
    for absent in ("One loop rate only", "drifts", "noisy"):
        assert absent not in text
    assert identification.bias_v == pytest.approx(6.0, abs=1e-3)
    assert identification.travel_rad == pytest.approx(1.07e-3, rel=0.02)


@pytest.mark.promise("identify-6")
@pytest.mark.promise("identify-54")
def test_warnings_of_one_rate_drift_and_noise(monkeypatch):
    monkeypatch.setattr(candidates, "_STARTS", 2)
    r = record(100, 3, seconds=0.2)
    trend = 0.05 * np.ptp(r.output) * np.linspace(0, 1, r.samples)[:, None]
    drive = r.drive + 0.03 * philox(8).standard_normal((r.samples, 1))
    result = identify([replace(r, output=r.output + trend, drive=drive)])
    text = "\n".join(result.warnings)
    assert "One loop rate only" in text
    assert "The drive is noisy" in text
    assert "the residual drifts by" in text
    assert result.drift_rad == pytest.approx(0.05 * result.span_rad, rel=0.2)


@pytest.mark.promise("identify-11")
@pytest.mark.parametrize(("extra", "best"), [(0.1, 1), (0.5, 0)])
def test_a_tie_goes_to_the_admissible_model(fit_100hz, extra, best):
    """Extra residuals of 0.1 rms raise the mean square by 1 %, which 1000 samples cannot tell; 0.5 rms they can."""
    admissible = replace(fit_100hz, admissible=True)
    noise, other = philox(1).standard_normal((2, 1000))
    good, near, bad = [noise], [noise + extra * other], [noise + 2 * other]
    assert np.sum(good[0] ** 2) < np.sum(near[0] ** 2)
    assert choose_best([fit_100hz, admissible, admissible], [good, near, bad]) == best
    assert choose_best([admissible, fit_100hz, admissible], [good, near, bad]) == 0
    assert choose_best([fit_100hz, fit_100hz], [near, good]) == 1


def test_progress_of_the_whole():
    calls = []
    identify([record(100)], on_progress=lambda *args: calls.append(args))
    assert [call[0] for call in calls] == list(range(1, 14))
    assert {call[1] for call in calls} == {13}


# ------------------------------------------------------------------------------------------------------ real recording
@needs_real
def test_real_recording(monkeypatch):
    monkeypatch.setattr(candidates, "_STARTS", 4)
    recording, evaluations = read_recording(REAL, 0, 4, 200.0), []

    def counted(residual, *args, real=scipy.optimize.least_squares, **options):
        return real(lambda values: (evaluations.append(1), residual(values))[1], *args, **options)

    monkeypatch.setattr(scipy.optimize, "least_squares", counted)
    assert recording.samples == 8027
    result = identify([recording], models=STATIC, **UM)
    assert 80 < len(evaluations) / 4 < 500  # of each start
    scores = {score.model: score for score in result.scores}
    assert 0.6 < scores["prandtl_ishlinskii"].fit_rms_percent < 0.75
    assert 0.75 < scores["prandtl_ishlinskii"].held_out_rms_percent < 0.9
    assert 0.75 < scores["bouc_wen"].held_out_rms_percent < 0.9
    assert 6.5 < result.straight_line.held_out_rms_percent < 7.5
    assert not result.fit("bouc_wen").admissible
    assert result.fit().name == "prandtl_ishlinskii" or result.fit().admissible
    assert "then those with fewer parameters" in result.reason
    text = "\n".join(result.warnings)
    assert "One loop rate only" in text
    assert "the residual drifts by" in text
    assert 0.3 < abs(result.drift_rad) * 0.02e6 < 0.8  # um; 0.55 um is known from other work on this record


# --------------------------------------------------------------------------------------------------------- mirror file
def number(text, unit):
    value, found = text.split(" ", 1)
    assert found == unit
    return float(value)


@pytest.mark.promise("mirror-file-1")
@pytest.mark.promise("readme-9")
@pytest.mark.parametrize("model", STATIC)
def test_mirror_file_reads_back(identification, model):
    text = mirror_file_text(identification, 'A "mirror" \\ µ', model=model)
    table = tomllib.loads(text)
    family = "prandtl_ishlinskii" if model == "prandtl_ishlinskii" else "bouc_wen"
    general = {"name", "travel", "composition", "rate_limit", "bias", "drive_min", "drive_max"}
    assert set(table) == general | {family, "uncertainty"}
    assert all(key.startswith(f"{family}.") for key in table["uncertainty"]["parameters"])
    assert (table["name"], table["composition"]) == ('A "mirror" \\ µ', "static")
    assert number(table["travel"], "mrad") == pytest.approx(1e3 * identification.travel_rad, rel=1e-3)
    fit = identification.fit(model)
    assert number(table["rate_limit"], "V/s") == fit.rate_limit_v_per_s
    assert number(table["bias"], "V") == identification.bias_v
    assert (number(table["drive_min"], "V"), number(table["drive_max"], "V")) == (
        identification.drive_min_v,
        identification.drive_max_v,
    )
    if family == "bouc_wen":
        units = {"d1": "mrad/V", "d2": "s/V", "epsilon": "mrad/V", "delta": "s/V", "alpha": "1/V", "beta": "1/V"}
        read = [number(table[family][key], unit) for key, unit in units.items()]
        np.testing.assert_allclose(np.array(read) * [1e-3, 1, 1e-3, 1, 1, 1], fit.values, rtol=1e-12)
        return
    thresholds = [number(t, "V") for t in table[family]["thresholds"]]
    weights = [number(w, "mrad/V") for w in table[family]["weights"]]
    keep = (fit.weights_rad_per_v > 0) | (fit.thresholds_v == 0)
    assert thresholds == fit.thresholds_v[keep].tolist()
    np.testing.assert_allclose(np.array(weights) * 1e-3, fit.weights_rad_per_v[keep], rtol=1e-12)
    assert thresholds[0] == 0
    assert np.all(np.diff(thresholds) > 0)
    assert min(weights[1:]) > 0


@pytest.mark.promise("identify-24")
def test_mirror_file_carries_its_origin(identification):
    text = mirror_file_text(identification, "m")
    for source in identification.sources:
        assert f"sha256 {source.sha256}" in text
        assert f"{source.fitted} samples fitted, {source.held_out} held out" in text
    assert identification.reason in text
    for warning in identification.warnings:
        assert f"# Warning: {warning}" in text
    error = 1e3 * identification.fit().standard_errors[0]
    assert f"# identified: ± standard error {error:.2g} mrad/V, from 100Hz, 60Hz" in text
    for line in text.splitlines():
        assert re.match(r"#|\[|name|parameters|correlation|  -?[01]\.", line) or not line or "# identified: " in line
    assert "Not admissible" not in mirror_file_text(identification, "m", model="bouc_wen_admissible")


def test_hostile_names_stay_inside_their_line():
    original = play_record([0.05, 0.03], [0.0, 1.0])
    result = identify([replace(original, path='a\n[x]\ny = 1 # "\u2028.csv')], models=("prandtl_ishlinskii",))
    table = tomllib.loads(mirror_file_text(result, "name\nwith \x7f break"))
    assert table["name"] == "name\nwith \x7f break"
    general = {"name", "travel", "composition", "rate_limit", "bias", "drive_min", "drive_max"}
    assert set(table) == general | {"prandtl_ishlinskii", "uncertainty"}
    with pytest.raises(IdentificationError, match="no name"):
        mirror_file_text(result, "  ")
    with pytest.raises(IdentificationError, match="no model 'bouc_wen'"):
        mirror_file_text(result, "m", model="bouc_wen")


def test_threshold_zero_stays_first_without_weight():
    result = identify([play_record([0.0, 0.05, 0.02], [0.0, 0.5, 2.0])], models=("prandtl_ishlinskii",))
    fit = replace(result.fit(), weights_rad_per_v=np.where(np.arange(15) < 2, 0.0, 1e-5))
    table = tomllib.loads(mirror_file_text(replace(result, fits=(fit,)), "m"))["prandtl_ishlinskii"]
    assert (table["thresholds"][0], table["weights"][0]) == ("0.0 V", "0.0 mrad/V")
    assert len(table["thresholds"]) == len(table["weights"]) == 14


def test_a_mirror_that_does_not_move_is_refused():
    r = play_record([0.05], [0.0])
    result = identify([r], models=("prandtl_ishlinskii",))
    still = replace(result, fits=(replace(result.fit(), weights_rad_per_v=np.zeros(15)),))
    with pytest.raises(IdentificationError, match="every play operator has weight 0"):
        mirror_file_text(still, "m")


@pytest.mark.parametrize("model", STATIC)
def test_a_mission_accepts_the_mirror_file(identification, model, tmp_path):
    path = tmp_path / "mirror.toml"
    path.write_text(mirror_file_text(identification, "m", model=model), encoding="utf-8")
    mirror = load_mirror(path).mirror
    assert mirror.bias_v == identification.bias_v
    assert (mirror.bouc_wen is None) == (model == "prandtl_ishlinskii")
    if mirror.bouc_wen is not None:
        assert mirror.bouc_wen.epsilon_rad_v == pytest.approx(identification.fit(model).model.epsilon_rad_v, rel=1e-12)


@pytest.mark.promise("mirror-file-7")
@pytest.mark.promise("identify-6")
@pytest.mark.parametrize("model", STATIC[:2])
def test_falling_sensor_gives_a_rising_mirror(model):
    rising = record(100, 3)
    texts = [
        mirror_file_text(identify([r], models=(model,)), "m")
        for r in (rising, replace(rising, output=5 - rising.output))
    ]
    up, down = (tomllib.loads(text) for text in texts)
    assert ["sign was flipped" in text for text in texts] == [False, True]
    for key, values in up[model].items():
        for a, b in zip(np.atleast_1d(values), np.atleast_1d(down[model][key]), strict=True):
            assert float(a.split()[0]) == pytest.approx(float(b.split()[0]), rel=2e-3)


@pytest.mark.parametrize("epsilon", [-0.03, 0.02])
def test_the_gradient_of_the_bound_is_that_of_differences(epsilon):
    """Of epsilon 2 alpha / (d1 (alpha + sign(epsilon) beta)), which an active bound holds constant."""
    values = np.array([0.09, -3e-6, epsilon, 4e-4, 5.0, 1.2])

    def bound(v):
        return v[2] * 2 * v[4] / (v[0] * (v[4] + np.sign(v[2]) * v[5]))

    steps = np.diag(1e-6 * np.abs(values))
    slopes = [(bound(values + s) - bound(values - s)) / (2 * s.sum()) for s in steps]
    np.testing.assert_allclose(_bound_gradient(values), slopes, rtol=1e-7, atol=1e-12)


def test_more_than_three_recordings_are_counted_behind_the_first():
    assert _names(["x/a.csv", "b.csv", "c.csv"]) == "a.csv, b.csv, c.csv"
    assert _names(["x/a.csv", "b.csv", "c.csv", "d.csv"]) == "a.csv and 3 more"


# ------------------------------------------------------------------------------------------ estimates, by hand
def test_the_colour_of_a_residual_is_that_of_its_mean_free_part_and_the_largest_of_all():
    """The first pair of lags is 69 over 60, and the second one is below 0."""
    values = np.array([4.0, 1.0, -2.0, -3.0, 2.0, 3.0, -1.0, -4.0, 0.0])
    lags = [sum(values[k:] * values[: 9 - k]) / sum(values**2) for k in range(4)]
    pairs = [lags[0] + lags[1], lags[2] + lags[3]]
    expected = max(1.0, 2 * sum(p for k, p in enumerate(pairs) if min(pairs[: k + 1]) >= 0) - 1)
    for offset in (0.0, 100.0):
        assert colour_inflation([values + offset]) == pytest.approx(expected, rel=1e-9)
    slow = np.repeat([1.0, -1.0, 1.0, -1.0], 8)
    white = np.tile([1.0, -1.0, -1.0, 1.0, -1.0], 5)
    assert colour_inflation([white, slow, white]) == colour_inflation([slow]) > 2.0


def test_losses_of_two_records_of_unlike_length_count_by_their_samples():
    """A mean of 1 and a variance of 9 over 144 samples: two standard errors are 0.5; of 24 they are 1.22."""
    wave = np.where(np.arange(120) % 2, 3.0, -3.0)
    for samples, mean, chance in ((144, 0.49, True), (144, 0.51, False), (24, 1.2, True), (24, 1.25, False)):
        parts = [mean + wave[: samples // 3], mean + wave[: samples - samples // 3]]
        best = [philox(k).standard_normal(part.size) for k, part in enumerate(parts)]
        assert statistics.may_be_chance([a + b for a, b in zip(parts, best, strict=True)], best) is chance


def test_derivatives_have_a_step_of_their_own_and_errors_add_up():
    at, steps = np.array([2.0, 3.0, 5.0]), np.array([1e-3, 2e-3, 4e-3])

    def products(v):
        return np.array([[v[0] * v[1], v[1] * v[2]], [v[0] ** 2, 7.0 * v[2]]])

    found = statistics.central_differences(products, at, steps)
    expected = [[[3.0, 2.0, 0.0], [0.0, 5.0, 3.0]], [[4.0, 0.0, 0.0], [0.0, 0.0, 7.0]]]
    assert found.shape == (2, 2, 3)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    covariance = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, -0.02], [0.0, -0.02, 0.01]])
    errors = statistics.propagated(lambda v: products(v).ravel(), at, covariance)
    slopes = np.reshape(expected, (4, 3))
    np.testing.assert_allclose(errors, np.sqrt(np.diag(slopes @ covariance @ slopes.T)), rtol=1e-6)


def test_what_is_computed_from_a_number_without_error_has_none_and_one_of_nothing_has_a_step():
    covariance = np.diag([0.0, 0.25, 0.0])
    errors = statistics.propagated(
        lambda v: np.array([3.0 * v[0], 2.0 * v[1] + v[2]]), np.array([5.0, 0.0, 0.0]), covariance
    )
    np.testing.assert_allclose(errors, [0.0, 1.0], rtol=1e-6)


def test_a_correlation_is_signed_and_that_of_its_own_pair():
    own = statistics.correlation(np.array([[4.0, -3.0, 0.5], [-3.0, 9.0, 0.75], [0.5, 0.75, 0.25]]))
    np.testing.assert_allclose(own, [[1.0, -0.5, 0.5], [-0.5, 1.0, 0.5], [0.5, 0.5, 1.0]])


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (123.456789, 0.0, "123.46"),
        (123.456789, math.nan, "123.46"),
        (123.456789, math.inf, "123.46"),
        (123.456789, 3.21, "123.5"),
        (123.456789, 0.0321, "123.46"),
        (0.00123456789, 0.0000996, "0.00123"),
        (0.00123456789, 0.000099, "0.001235"),
        (0.00123456789, 0.00000995, "0.0012346"),
        (-0.004, 0.9, "0"),
        (87654.321, 4321.0, "87700"),
        (-1234.5678, 0.96, "-1234.6"),
        (-1234.5678, 99.6, "-1230"),
    ],
)
def test_a_value_is_printed_with_two_digits_of_its_error_and_five_at_most(value, error, text):
    assert statistics.rounded_to_error(value, error) == text


def test_per_cent_of_a_span_are_of_the_rms_and_of_the_largest_size():
    assert statistics.percent(np.array([[3.0, -7.0], [1.0, 5.0]]), 40.0) == pytest.approx(
        (100 * np.sqrt(21) / 40, 17.5)
    )


# ------------------------------------------------------------------------------------------ a mirror file, line by line
def static_identification(fit, **changes):
    """What the texts of a mirror file need of an identification of two loops, one for validation and one broadband."""
    uses = [
        choice.RecordingUse("in/a.csv", "aa", 600, 400),
        choice.RecordingUse("in/b.csv", "bb", 700, 300),
        choice.RecordingUse("in/w.csv", "ww", 500, 0, "broadband"),
        choice.RecordingUse("in/v.csv", "vv", 0, 900, "validation"),
    ]
    given = {
        "fits": (fit,),
        "scores": (predictions.Score(fit.name, 0.12345, 1.2345, 0.54321, 5.4321),),
        "straight_line": predictions.Score("straight line", 2.3456, 6.7, 3.4567, 8.9),
        "chosen": fit.name,
        "reason": "it is\nthe best.",
        "warnings": ("one.", "two."),
        "sources": tuple(uses),
        "linear": None,
        "travel_rad": 1.23456789e-3,
        "drive_min_v": -1.5,
        "drive_max_v": 8.25,
    }
    own = object.__new__(choice.Identification)
    vars(own).update(given | changes)
    return own


def test_a_mirror_file_of_plays_is_line_by_line_what_was_found():
    fit = PrandtlIshlinskiiFit(
        thresholds_v=np.array([0.0, 0.5, 1.5, 3.0]),
        weights_rad_per_v=np.array([0.0, 2e-4, 0.0, 5e-5]),
        standard_errors_rad_per_v=np.array([np.nan, 1.234e-6, np.nan, 4.567e-7]),
        sign=-1,
        offsets_rad=(0.0, 0.0),
        rate_limit_v_per_s=432.1,
        units=Units(),
        colour_inflation=1.0,
        condition_number=1.0,
        residual_rms_percent=0.1,
        samples_used=1300,
    )
    given = [play_record((1e-3,), (0.0,), seed=k) for k in (1, 2)]
    seen = tuple(predictions.Prediction(np.zeros(4000), np.zeros(4000), 0, split, 0) for split in (2400, 2800))
    lines = mirror_file_text(static_identification(fit, recordings=given, predictions=(seen,)), "of two").split("\n")
    assert lines[: lines.index("[uncertainty]")] == [
        "# Mirror identified from 4 recording(s), model prandtl_ishlinskii.",
        "#   in/a.csv (loops): 600 samples fitted, 400 held out",
        "#   sha256 aa",
        "#   in/b.csv (loops): 700 samples fitted, 300 held out",
        "#   sha256 bb",
        "#   in/w.csv (broadband): 500 samples fitted, 0 held out",
        "#   sha256 ww",
        "#   in/v.csv (validation): 0 samples fitted, 900 held out",
        "#   sha256 vv",
        "# 1300 samples used, behind the initial transient of each recording.",
        "# Residual in % of the peak-to-peak output, rms (peak):",
        "#   prandtl_ishlinskii: 0.123 (1.23) on the fitted samples, 0.543 (5.43) on the held-out samples",
        "#   straight line: 2.346 (6.70) on the fitted samples, 3.457 (8.90) on the held-out samples",
        "# Choice: it is the best.",
        "# Warning: one.",
        "# Warning: two.",
        f"# Warning: {_FLIPPED}",
        'name = "of two"',
        'travel = "1.235 mrad"                        # identified: fitted range, from a.csv, b.csv',
        'composition = "static"                       # identified: the linear dynamics of the mirror were not '
        "identified",
        'rate_limit = "432.1 V/s"                     # identified: fastest rate of the drive, from a.csv, b.csv',
        'bias = "3.375 V"                             # identified: middle of the drive range, from a.csv, b.csv',
        'drive_min = "-1.5 V"                         # identified: lowest drive, from a.csv, b.csv',
        'drive_max = "8.25 V"                         # identified: highest drive, from a.csv, b.csv',
        "",
        "[prandtl_ishlinskii]",
        'thresholds = ["0.0 V", "0.5 V", "3.0 V"] # identified: chosen, not fitted; from a.csv, b.csv',
        'weights = ["0.0 mrad/V", "0.2 mrad/V", "0.05 mrad/V"] # identified: ± standard error at 0, 0.0012, 0.00046 '
        "mrad/V, from a.csv, b.csv",
        "",
    ]
    assert lines[lines.index("[uncertainty]") + 1 : -3] == [
        'parameters = ["prandtl_ishlinskii.weights.2", "prandtl_ishlinskii.weights.3"] # identified: those not held or '
        "at a bound",
        "standard_errors = [0.00617, 0.00913] # identified: relative to the values, at most 1 in any combination, from "
        "a.csv, b.csv",
        "correlation = [",
    ]
    assert lines[-2:] == [
        "] # identified: of the values, lower triangle row by row; a sum may be known far better than its parts",
        "",
    ]


def eq_3_fit(sign, covariance, not_identified):
    """A fit of Eq. 3 that rises (1) or falls (-1) with the drive."""
    return BoucWenFit(
        model=BoucWen(8e-5 * sign, 3e-7, -4e-5 * sign, 5e-4, 40.0, 30.0, 777.0),
        offsets_rad=(0.0,),
        units=Units(),
        covariance=covariance,
        colour_inflation=1.0,
        condition_number=1.0,
        not_identified=not_identified,
        residual_rms_percent=0.1,
        start_rms_percent=(0.1,),
        agreeing_starts=1,
        slope_after_reversal_rad_per_v=1e-6,
        lowest_slope_rad_per_v=1e-6,
        admissible=True,
        constrained=False,
        samples_used=987,
    )


def test_a_mirror_file_of_eq_3_that_falls_has_its_signs_and_their_errors_turned():
    """d1, epsilon and beta are counted the other way, and so is what they have to do with the others."""
    sizes = np.array([4e-6, 2e-7, 3e-6, 5e-5, 2.0, 1.5])
    between = np.eye(6)
    between[0, 1] = between[1, 0] = 0.5
    between[0, 2] = between[2, 0] = -0.25
    between[4, 5] = between[5, 4] = 0.75
    fit = eq_3_fit(-1, sizes[:, None] * between * sizes, (("delta", "of a reason"), ("d2", "of another")))
    text = mirror_file_text(static_identification(fit), 'the "one"')
    lines = text.split("\n")
    assert lines[14:19] == [
        "# Warning: one.",
        "# Warning: two.",
        f"# Warning: {_FLIPPED}",
        "# Not identified: delta, of a reason",
        "# Not identified: d2, of another",
    ]
    assert lines[19] == 'name = "the \\"one\\""'
    at = lines.index("[bouc_wen]")
    named = (
        ("d1", "0.08 mrad/V", "0.004 mrad/V"),
        ("d2", "3e-07 s/V", "2e-07 s/V"),
        ("epsilon", "-0.04 mrad/V", "0.003 mrad/V"),
    )
    named += ("delta", "0.0005 s/V", "5e-05 s/V"), ("alpha", "40.0 1/V", "2 1/V"), ("beta", "-30.0 1/V", "1.5 1/V")
    assert [re.split(" +# ", line) for line in lines[at + 1 : at + 7]] == [
        [f'{key} = "{value}"', f"identified: ± standard error {error}, from a.csv, b.csv"]
        for key, value, error in named
    ]
    read = tomllib.loads(text)
    assert read["uncertainty"]["parameters"] == [f"bouc_wen.{key}" for key in PARAMETERS]
    assert read["uncertainty"]["standard_errors"] == pytest.approx([0.05, 2 / 3, 0.075, 0.1, 0.05, 0.05], rel=1e-2)
    rows = [[float(v) for v in line.strip(" ,").split(",")] for line in lines[-7:-2]]
    np.testing.assert_allclose(rows[0], [-0.5], atol=1e-3)
    np.testing.assert_allclose(rows[1], [-0.25, 0.0], atol=1e-3)
    np.testing.assert_allclose(rows[4], [0.0, 0.0, 0.0, 0.0, -0.75], atol=1e-3)


# ------------------------------------------------------------------------------------------ Eq. 3 and plays, by hand
def told_of(function, *given, **words):
    with pytest.raises(IdentificationError) as caught:
        function(*given, **words)
    return str(caught.value)


def problem_of(share=math.inf, rate_limit=250.0):
    """Two records of unlike length, step and range."""
    drives = [5.0 + 2.0 * np.sin(np.arange(300) / 15.0), 4.0 + 3.0 * np.sin(np.arange(200) / 10.0)]
    outputs = [1e-4 * drives[0] ** 2, 2e-4 * drives[1]]
    records = [
        SiRecord(name, "", drive, output, step, start)
        for name, drive, output, step, start in zip("ab", drives, outputs, (0.01, 0.002), (15, 10), strict=True)
    ]
    return bouc_wen_of.BoucWenProblem(tuple(records), share, rate_limit)


THETA = np.array([0.25, -2.0, math.log(3.0), math.log(0.5)])


def test_searched_numbers_are_counted_in_the_rate_and_the_range_of_the_drives():
    problem = problem_of()
    span_v = np.ptp(problem.records[1].drive_v)
    assert problem.drive_span_v == span_v and problem.output_span_rad == np.ptp(problem.records[0].output_rad)
    assert problem.physical(THETA) == pytest.approx((0.001, -0.008, 3.0 / span_v, 0.5 / span_v))
    assert problem.bound(THETA) == math.inf and problem_of(0.7).bound(THETA) == pytest.approx(0.7 * 3.0 / 3.5)
    assert problem.scale == pytest.approx(1 / (problem.output_span_rad * math.sqrt(285 + 190)))
    own = fastest_rate(problem.records)
    assert bouc_wen_of.BoucWenProblem(problem.records, 0.5).rate_limit == own


@pytest.mark.parametrize("share", [math.inf, 0.02])
def test_the_best_of_d1_and_epsilon_lies_on_the_bound_where_it_would_take_back_more(share):
    problem = problem_of(share)
    columns = problem.columns(THETA)
    if share < math.inf:
        problem.target = columns @ [1e-4, -5e-5] + centred(1e-6 * philox(1).standard_normal(475), problem.records)
    d1, epsilon = problem.linear(columns, THETA)
    free = np.linalg.lstsq(columns, problem.target, rcond=None)[0]
    if share == math.inf:
        assert_allclose((d1, epsilon), free, rtol=1e-6)
        expected = problem.target - columns @ free
    else:
        bound = share * 3.0 / 3.5
        assert free[1] / free[0] < -bound
        joint = columns[:, 0] - bound * columns[:, 1]
        expected = problem.target - joint * (joint @ problem.target) / (joint @ joint)
        assert epsilon == pytest.approx(-bound * d1)
    assert_allclose(problem.residual(THETA), expected * problem.scale, atol=1e-9)
    values = problem.solve(THETA)
    _, _, settled, reversal = problem.physical(THETA)
    assert_allclose(values[:5], [d1, 0.001, epsilon, -0.008, (settled + reversal) / 2])
    assert values[5] == pytest.approx(math.copysign((settled - reversal) / 2, epsilon * (settled - reversal)))
    assert bouc_wen_of.k_settled(values) == pytest.approx(settled)
    by_row = bouc_wen_of.stacked_output(problem, values)
    own = [r.drive_v.size - r.start for r in problem.records]
    assert by_row.size == sum(own)
    assert_allclose(centred(by_row, problem.records), columns @ (d1, epsilon), atol=1e-12)


def test_the_lowest_slope_is_that_of_all_records_at_a_limited_rate_in_the_direction_of_d1():
    problem = problem_of()
    values = np.array([-8e-5, 3e-3, 6e-5, 4e-3, 2.0, 1.0])
    lowest = math.inf
    for record in problem.records:
        h = bouc_wen_response(record.drive_v, record.step_s, np.array([*values, 250.0, 0.0]), 0.0)[1]
        for k in range(record.start, record.drive_v.size - 1):
            rate = (record.drive_v[k + 1] - record.drive_v[k]) / record.step_s
            near = min(max(rate, -250.0), 250.0)
            slope = -8e-5 * math.exp(-3e-3 * near) + 6e-5 * math.exp(4e-3 * abs(near))
            slope -= 1.0 * abs(h[k]) + 2.0 * math.copysign(1.0, rate) * h[k]
            lowest = min(lowest, -slope)
    assert bouc_wen_of.lowest_slope(problem, values) == pytest.approx(lowest, rel=1e-9)
    slow = bouc_wen_of.BoucWenProblem(problem.records, math.inf, 20.0)
    assert bouc_wen_of.lowest_slope(slow, values) != pytest.approx(lowest, rel=1e-3)


def test_starts_are_the_best_of_the_grid_in_turn_and_scattered_about_them():
    problem = problem_of()
    starts = bouc_wen_of._starts(problem, 6, 3)
    costs = {}
    for delta in (0.0, 1.0, 2.0, 4.0):
        for settled in (2.0, 8.0, 30.0, 120.0):
            for ratio in (0.3, 1.0, 4.0, 20.0):
                theta = (0.0, delta, math.log(settled), math.log(settled * ratio))
                costs[theta] = float(np.sum(problem.residual(np.array(theta)) ** 2))
    best = sorted(costs, key=costs.get)[:4]
    scatter = 0.4 * np.random.Generator(np.random.Philox(3)).standard_normal((6, 4))
    for k, start in enumerate(starts):
        centre, moved = np.array(best[k % 4]), scatter[k] * (k > 0)
        expected = centre + moved * [0.1, 1.0, 1.0, 1.0]
        expected[1] = max(centre[1], 0.2) * math.exp(moved[1])
        assert_allclose(start, np.clip(expected, bouc_wen_of._LOWER + 1e-6, bouc_wen_of._UPPER - 1e-6))


def test_the_settled_hysteresis_of_a_fit_has_the_error_of_its_parts():
    sizes = np.array([1e-6, 1e-7, 2e-6, 1e-4, 0.5, 0.25])
    between = np.eye(6)
    between[2, 4] = between[4, 2] = 0.4
    between[4, 5] = between[5, 4] = -0.6
    covariance = sizes[:, None] * between * sizes
    for epsilon, settled in ((4e-5, 40.0 + 30.0), (-4e-5, 40.0 - 30.0)):
        fit = object.__new__(BoucWenFit)
        vars(fit).update(model=BoucWen(8e-5, 3e-7, epsilon, 5e-4, 40.0, 30.0, 777.0), covariance=covariance)
        value, error = fit.settled_hysteresis_rad
        assert value == pytest.approx(4e-5 / settled)
        found = statistics.propagated(
            lambda v: np.array([abs(v[2]) / (v[4] + math.copysign(v[5], v[2]))]), fit.values, covariance
        )
        assert error == pytest.approx(found[0], rel=1e-6)
        assert fit.rate_limit_v_per_s == 777.0 and fit.falling is False
        drive = 2.0 + np.sin(np.arange(50) / 3.0)
        output, clamped = fit.response(drive, 1e-3)
        expected, _, count = bouc_wen_response(drive, 1e-3, np.array([*fit.values, 777.0, 0.0]), 0.0)
        assert_allclose(output, expected)
        assert clamped == count
    assert [vars(fit).update(constrained=c) or fit.name for c in (True, False)] == ["bouc_wen_admissible", "bouc_wen"]


def test_sizes_of_parameters_are_their_own_or_what_matters_at_the_fastest_rate():
    problem = problem_of()
    values = np.array([-8e-5, 0.0, 1e-20, -1e-9, 2.0, 1e-5])
    assert_allclose(bouc_wen_of._sizes(problem, values), [8e-5, 4e-6, 8e-14, 4e-5, 2.0, 2e-3])
    assert_allclose(bouc_wen_of._sizes(problem, 10.0 * np.ones(6)), 10.0)


def test_on_a_bound_the_covariance_is_that_along_it():
    """Across the bound nothing moves, and along it what the slopes say."""
    draw = philox(6)
    values, sizes = np.array([8e-5, 1e-4, -4e-5, 1e-3, 3.0, 1.0]), np.array([1e-5, 1e-4, 1e-5, 1e-3, 1.0, 1.0])
    jacobian = draw.standard_normal((200, 6)) / sizes
    free = bouc_wen_of._covariance(jacobian, sizes, 0.04, None)
    assert_allclose(free, 0.04 * np.linalg.inv(jacobian.T @ jacobian), rtol=1e-8)
    bounded = bouc_wen_of._covariance(jacobian, sizes, 0.04, values)
    normal = _bound_gradient(values) * sizes
    basis = np.linalg.svd(normal[None])[2][1:].T
    own = jacobian * sizes @ basis
    expected = sizes[:, None] * (basis @ (0.04 * np.linalg.inv(own.T @ own)) @ basis.T) * sizes
    assert_allclose(bounded, expected, rtol=1e-7, atol=1e-12 * np.abs(expected).max())
    assert abs(normal / sizes @ bounded @ (normal / sizes)) < 1e-12 * abs(normal / sizes @ free @ (normal / sizes))


def test_thresholds_that_cannot_be_used_are_told_in_full():
    records = si_records([play_record([1.0], [0.0])], Units())
    half = np.ptp(records[0].drive_v) / 2
    for given in ([0.0, 1.0, 1.0], [0.5, 1.0], [0.0, math.nan], [0.0, half]):
        assert told_of(prandtl_of._thresholds, records, given, 3) == (
            f"the thresholds {np.array(given).tolist()} V cannot be used; they must start at 0, increase strictly "
            f"and stay below half of the drive's peak-to-peak, {half:g} V, or an operator never moves both ways."
        )
    assert told_of(prandtl_of._thresholds, records, None, -2) == (
        "-2 play operators were asked for; give at least 1, better 10 or more."
    )
    assert_allclose(prandtl_of._thresholds(records, None, 4), 0.94 * half * np.arange(4) / 3)
    assert prandtl_of._thresholds(records, 0, 9).tolist() == [0.0]


def test_a_fit_of_plays_that_falls_has_the_sign_in_its_model_and_its_response():
    drive = 3.0 + np.sin(np.arange(90) / 4.0)
    fit = PrandtlIshlinskiiFit(
        np.array([0.0, 0.25, 0.5]), np.array([2.0, 0.0, 0.75]), np.zeros(3), -1, (), 12.5, Units(), 1.0, 1.0, 1.0, 9
    )
    states = play_response(drive, np.array([0.0, 0.5]), np.full(2, drive[0]))
    output, clamped = fit.response(drive, 1.0)
    assert_allclose(output, -2.0 * states[:, 0] - 0.75 * states[:, 1])
    assert (clamped, fit.parameter_count, fit.falling, fit.name) == (0, 2, True, "prandtl_ishlinskii")
    assert fit.model.weights_rad_v == (-2.0, 0.0, -0.75) and fit.model.thresholds_v == (0.0, 0.25, 0.5)
    assert fit.model.rate_limit_v_s == 12.5 and fit.model.widening_s == 0.0


def test_errors_of_weights_are_those_of_the_columns_in_use():
    draw = philox(8)
    states = draw.standard_normal((60, 4)) @ np.diag([1.0, 5.0, 2.0, 0.1])
    errors, condition = prandtl_of._errors(states, np.array([1.0, 0.0, 3.0, 2.0]), 0.09)
    own = states[:, [0, 2, 3]]
    expected = np.sqrt(0.09 * np.diag(np.linalg.inv(own.T @ own)))
    assert np.isnan(errors[1])
    assert_allclose(errors[[0, 2, 3]], expected)
    assert condition == pytest.approx(np.linalg.cond(own))
    none, undefined = prandtl_of._errors(states, np.zeros(4), 0.09)
    assert np.isnan(none).all() and math.isnan(undefined)


def test_two_records_of_plays_have_offsets_of_their_own_and_count_by_their_samples():
    """By least squares over both, each with an offset and a memory; every weight is in use."""
    records = [play_record([5e-5, 2e-5], [0.0, 1.0], seed=k, noise=0.02) for k in (1, 2)]
    records[1] = replace(records[1].first(2500), output=records[1].output[:2500] + 0.7, sha256="other")
    fit = fit_prandtl_ishlinskii(records, [0.0, 1.0], units=Units("V", "rad"))
    prepared = si_records(records, Units("V", "rad"))
    blocks, target, plays_of = [], [], []
    for k, r in enumerate(prepared):
        states = play_response(r.drive_v, np.array([0.0, 1.0]), np.full(2, r.drive_v[0]))[r.start :]
        own = np.column_stack([np.ones(r.drive_v.size), memory(r.drive_v, r.drive_v.size)])[r.start :]
        wide = np.zeros((len(own), 18))
        wide[:, 9 * k : 9 * k + 9] = own
        blocks.append(np.hstack([states, wide]))
        plays_of.append(states)
        target.append(r.output_rad[r.start :])
    matrix, output = np.vstack(blocks), np.concatenate(target)
    solved = np.linalg.lstsq(matrix, output, rcond=None)[0]
    assert_allclose(fit.weights_rad_per_v, solved[:2], rtol=1e-6)
    assert_allclose(
        fit.offsets_rad, [np.mean(t - s @ solved[:2]) for t, s in zip(target, plays_of, strict=True)], rtol=1e-5
    )
    left = output - matrix @ solved
    assert fit.residual_rms_percent == pytest.approx(
        100 * np.sqrt(np.mean(left**2)) / np.ptp(prepared[0].output_rad), rel=1e-3
    )
    parts = np.split(left, [prepared[0].used])
    assert fit.colour_inflation == pytest.approx(colour_inflation(parts), rel=1e-3)
    free = left.size - 2 - sum(r.own_count for r in prepared)
    variance = fit.colour_inflation * left @ left / free
    errors = np.sqrt(variance * np.diag(np.linalg.pinv(matrix.T @ matrix))[:2])
    assert_allclose(fit.standard_errors_rad_per_v, errors, rtol=1e-3)
    assert (fit.samples_used, fit.sign) == (3800 + 2375, 1)


# ------------------------------------------------------------------------------------------ a joint fit, line by line
ERRORS = 0.04, 0.07, 0.02, 0.05, 0.03, 0.06, 0.025, 0.015, 0.045, 0.035, 0.055, 0.065, 0.08


def joint_identification(name, model, values, errors, *, linear=None, creep=NO_CREEP, free_linear=True, band=None):
    """An identification by a joint fit of such values, each with a relative error of its own, neighbours correlated."""
    structure = one_axis("m", model, linear=linear, creep=creep, free=FORMS[name].free, free_linear=free_linear)
    values = np.array(values)
    size = np.abs(values) * np.array(errors)
    between = np.eye(values.size) + 0.25 * (np.eye(values.size, k=1) + np.eye(values.size, k=-1))
    axis = structure.parts(values)
    fit = object.__new__(JointFit)
    plant_fit = object.__new__(PlantFit)
    known = {"covariance": size[:, None] * between * size, "not_identified": (("widening", "of a reason"),)}
    vars(plant_fit).update({"values": values, "converged": True, "evaluations": 9} | known)
    given = {"name": name, "form": FORMS[name], "structure": structure, "fit": plant_fit, "hold": "first-order"}
    given |= {"model": axis.model, "creep": axis.creep, "linear": axis.linear, "units": Units(), "samples_used": 1234}
    for key, value in ({"rate_limit_v_per_s": 56.78} | given).items():
        object.__setattr__(fit, key, value)
    return static_identification(fit, linear=band)


def tables_of(identification):
    """The tables of a mirror file as lines, with the names of its sources abridged, and its correlations."""
    text = mirror_file_text(identification, "joint").replace("from a.csv, b.csv", "from loops")
    lines = [re.sub(" +# identified: ", " | ", line) for line in text.split("\n")[:-1]]
    at = lines.index("correlation = [")
    rows = [[float(v) for v in line.strip(" ,").split(", ")] for line in lines[at + 1 : -1]]
    return lines, lines[lines.index("") + 1 : at], rows


JOINT_LINEAR = LinearPoles(Roots((40.0, 150.0), (1.0, 0.3)), Roots((60.0,), (1.0,)), 3.0, 2e-4, 1e-4)
OF_LINEAR = [41.0, 151.0, 0.31, 61.0, 3e-4]
EXCITED = SimpleNamespace(excited_hz=(2.5, 333.0))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_mirror_file_of_joint_plays_is_line_by_line_what_was_found(sign):
    model = PrandtlIshlinskii((0.0, 0.5, 2.0), (6e-5 * sign, 0.0, 2e-5 * sign), 2e-3, 56.78)
    values = [*(sign * np.array([6.25e-5, 1e-18, 2.5e-5])), 3e-3, sign * 5e-7, sign * 2.5e-7, *OF_LINEAR]
    creep = Creep((3e-7 * sign, 3e-7 * sign), (0.01, 1.0))
    given = "prandtl_ishlinskii_rate_creep", model, values, ERRORS[: len(values)]
    lines, tables, rows = tables_of(joint_identification(*given, linear=JOINT_LINEAR, creep=creep, band=EXCITED))
    flipped = [f"# Warning: {_FLIPPED}"] if sign < 0.0 else []
    assert lines[9] == "# 1234 samples used, behind the initial transient of each recording."
    assert lines[16 : 22 + len(flipped)] == [
        *flipped,
        "# Not identified: widening, of a reason; the loops widen too little with the rate to tell; record faster "
        "loops",
        "# Not identified: creep that is slower, no record lasts long enough for a lag beyond 1 s; over a short record "
        "creep looks like gain; record a staircase with long dwells",
        'name = "joint"',
        'travel = "1.235 mrad" | fitted range, from loops',
        'composition = "cascade" | hysteresis drives the linear part below; both were fitted together',
        'rate_limit = "56.78 V/s" | fastest rate of the drive, from loops',
    ]
    assert tables == [
        "[prandtl_ishlinskii]",
        'thresholds = ["0.0 V", "0.5 V", "2.0 V"] | chosen, not fitted; from loops',
        'weights = ["0.0625 mrad/V", "0.0 mrad/V", "0.025 mrad/V"] | ± standard error 0.0025, 7e-17, 0.0005 mrad/V, '
        "from loops",
        'widening = "0.003 s" | ± standard error 0.00015 s, from loops',
        "",
        "[creep]",
        'time_constants = ["0.01 s", "1.0 s"] | decades that the recordings cover; from loops',
        'weights = ["0.0005 mrad/V", "0.00025 mrad/V"] | ± standard error 1.5e-05, 1.5e-05 mrad/V, from loops',
        "",
        "[linear]",
        'poles = ["41.0 Hz", "151.0 Hz"] | ± standard error 1, 2.3 Hz, from w.csv',
        "pole_dampings = [1.0, 0.31] | 1 is a real pole; from w.csv",
        'zeros = ["61.0 Hz"] | ± standard error 2.1 Hz, from w.csv',
        "zero_dampings = [1.0] | 1 is a real zero; from w.csv",
        "# recording: drive straight between samples, output 0.0003 ± 1.6e-05 s late, a delay that belongs to the "
        "recording chain and is no part of the mirror",
        'normalise_at = "3.0 Hz" | where the linear part has the magnitude 1',
        'excited_from = "2.5 Hz" | lowest frequency with a drive in it, from w.csv',
        'excited_to = "333.0 Hz" | highest frequency with a drive in it, from w.csv',
        "",
        "[uncertainty]",
        'parameters = ["prandtl_ishlinskii.weights.1", "prandtl_ishlinskii.weights.3", "prandtl_ishlinskii.widening", '
        '"creep.weights.1", "creep.weights.2", "linear.poles.1", "linear.poles.2", "linear.pole_dampings.2", '
        '"linear.zeros.1"] | those not held or at a bound',
        "standard_errors = [0.04, 0.02, 0.05, 0.03, 0.06, 0.025, 0.015, 0.045, 0.035] | relative to the values, at "
        "most 1 in any combination, from loops",
    ]
    near = [0.0, 0.25 * sign, 0.25 * sign, 0.25, 0.25 * sign, 0.25, 0.25, 0.25]
    for k, (row, last) in enumerate(zip(rows, near, strict=True)):
        assert row == pytest.approx([*[0.0] * k, last], abs=1e-6)


EQ_3_FREE = [
    *('d1 = "0.08 mrad/V" | ± standard error 0.0032 mrad/V', 'd2 = "2e-05 s/V" | ± standard error 6e-07 s/V'),
    *(
        'epsilon = "-0.03125 mrad/V" | ± standard error 0.0022 mrad/V',
        'delta = "0.005 s/V" | ± standard error 0.0003 s/V',
    ),
    *('alpha = "1.5 1/V" | ± standard error 0.03 1/V', 'beta = "0.375 1/V" | ± standard error 0.022 1/V'),
]


@pytest.mark.parametrize(
    ("name", "model", "values", "linear", "written", "errors"),
    [
        (
            "bouc_wen_asymmetric",
            BoucWen(8e-5, 1e-5, -3e-5, 4e-3, 1.4, 0.4, 100.0),
            [8e-5, -3.125e-5, 1.5, 0.25, 2e-5, 5e-3, 0.25, -0.125],
            None,
            [
                *EQ_3_FREE,
                'gamma = "0.375 1/V" | ± standard error 0.012 1/V',
                'eta = "-0.1875 1/V" | ± standard error 0.0047 1/V',
            ],
            [0.04, 0.03, 0.07, 0.06, 0.02, 0.0583, 0.032, 0.025],
        ),
        (
            "bouc_wen_classical",
            BoucWen(8e-5, 0.0, -3e-5, 0.0, 1.4, 0.4, 100.0, exponent=1.5),
            [8e-5, -3.125e-5, 1.5, 0.25, 2.0],
            None,
            [
                *(EQ_3_FREE[0], 'd2 = "0.0 s/V" | held, not fitted', EQ_3_FREE[2]),
                *('delta = "0.0 s/V" | held, not fitted', *EQ_3_FREE[4:]),
                "exponent = 2.0 | ± standard error 0.06",
            ],
            [0.04, 0.07, 0.02, 0.0583, 0.03],
        ),
        (
            "bouc_wen_joint",
            BoucWen(8e-5, 1e-5, -3e-5, 4e-3, 1.4, 0.4, 100.0),
            [8e-5, -3.125e-5, 1.5, 0.25, 2e-5, 5e-3],
            JOINT_LINEAR,
            EQ_3_FREE,
            [0.04, 0.03, 0.07, 0.06, 0.02, 0.0583],
        ),
    ],
)
def test_a_mirror_file_of_a_joint_eq_3_has_what_is_free_and_what_is_held(name, model, values, linear, written, errors):
    given = name, model, values, ERRORS[: len(values)]
    made = joint_identification(*given, linear=linear, free_linear=False, band=EXCITED if linear else None)
    lines, tables, _ = tables_of(made)
    assert tables[: 1 + len(written)] == [
        "[bouc_wen]",
        *(f"{line}, from loops" for line in written),
    ]
    rest = tables[1 + len(written) :]
    assert rest[-1].startswith(f"standard_errors = [{', '.join(f'{e:g}' for e in errors)}] | relative to the values")
    composition = next(line for line in lines if line.startswith("composition"))
    if linear is None:
        assert composition == 'composition = "static" | the linear dynamics of the mirror were not identified'
        assert rest[:2] == ["", "[uncertainty]"]
        return
    assert composition == 'composition = "cascade" | hysteresis drives the linear part below; both were fitted together'
    held = "from the frequency response, held in the joint fit, from w.csv"
    assert rest[1:7] == [
        *(
            "[linear]",
            f'poles = ["40.0 Hz", "150.0 Hz"] | {held}',
            "pole_dampings = [1.0, 0.3] | 1 is a real pole; from w.csv",
        ),
        *(f'zeros = ["60.0 Hz"] | {held}', "zero_dampings = [1.0] | 1 is a real zero; from w.csv"),
        "# recording: drive straight between samples, output 0.0002 s late, a delay that belongs to the recording "
        "chain and is no part of the mirror",
    ]


def test_a_static_model_beside_a_linear_part_does_not_use_it_and_a_search_that_stopped_is_told():
    model = PrandtlIshlinskii((0.0, 1.0), (6e-5, 2e-5))
    made = joint_identification("prandtl_ishlinskii_creep", model, [5e-5, 2.5e-5], ERRORS[:2], band=EXCITED)
    vars(made.fits[0].fit).update(converged=False, evaluations=77)
    lines, tables, rows = tables_of(made)
    assert 'composition = "static" | the linear dynamics of the mirror are not used by this model' in lines
    assert lines[14:17] == [
        *("# Warning: one.", "# Warning: two."),
        "# Warning: The search for the parameters stopped after 77 evaluations, before it had settled: the model is "
        "what the scores say, but its standard errors are those of a point that is no minimum.",
    ]
    assert tables[2] == 'weights = ["0.05 mrad/V", "0.025 mrad/V"] | ± standard error 0.002, 0.0018 mrad/V, from loops'
    assert rows == [[pytest.approx(0.25, abs=1e-5)]]
    vars(made)["sources"] = tuple(choice.RecordingUse(f"in/{n}.csv", n, 9, 9) for n in "klmn")
    assert 'drive_min = "-1.5 V" | lowest drive, from k.csv and 3 more' in tables_of(made)[0]
    with pytest.raises(IdentificationError) as refused:
        mirror_file_text(made, " \t")
    assert str(refused.value) == ("the mirror has no name; give one, it stands in the mirror file and in the report.")


def test_the_error_of_an_idle_play_goes_to_its_nearest_neighbour_at_work():
    key = "prandtl_ishlinskii.weights."
    sizes = {
        f"{key}1": 0.0,
        f"{key}2": 5.0,
        f"{key}3": 0.001,
        f"{key}4": 0.002,
        f"{key}5": 3.0,
        f"{key}6": 0.0,
        "creep": 0.0,
    }
    expected = np.diag([0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0])
    expected[1, 0] = expected[1, 2] = expected[4, 3] = expected[4, 5] = 1.0
    np.testing.assert_array_equal(mirror_file._with_neighbours(sizes), expected)
    sizes[f"{key}3"] = 0.0081  # more than a thousandth of the sum
    assert mirror_file._with_neighbours(sizes)[2].tolist() == [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    np.testing.assert_array_equal(
        mirror_file._with_neighbours({f"{key}1": 0.0, f"{key}2": 0.0}), [[0.0, 0.0], [0.0, 0.0]]
    )


def test_what_is_held_leaves_to_the_others_what_they_do_not_share_with_it():
    covariance = np.array([[4.0, 1.0, 2.0], [1.0, 9.0, -3.0], [2.0, -3.0, 16.0]])
    found = mirror_file._holding(covariance, np.array([False, False, True]))
    apart = covariance[:2, :2] - np.outer(covariance[:2, 2], covariance[:2, 2]) / 16.0
    np.testing.assert_allclose(found[:2, :2], apart, rtol=1e-12)
    assert not found[2].any() and not found[:, 2].any()
    covariance[0] = covariance[:, 0] = 0.0
    np.testing.assert_allclose(mirror_file._holding(covariance, np.zeros(3, bool)), covariance, rtol=1e-12)


def test_numbers_that_are_known_but_for_an_error_have_it_relative_to_their_size():
    """b falls, c is lost in its error, d is known exactly, e is 0; a and b go together, f is open."""
    numbers = {"a": 2.0, "b": -4.0, "c": 0.01, "d": 7.0, "e": 0.0, "f": 0.5}
    covariance = np.diag([0.04, 0.16, 1.1, 0.0, 0.0, 1.0])
    covariance[0, 1] = covariance[1, 0] = 0.02
    keys, found = mirror_file._relative(numbers, covariance)
    assert keys == ["a", "b", "f"]
    np.testing.assert_allclose(found, [[0.01, 0.0025, 0.0], [0.0025, 0.01, 0.0], [0.0, 0.0, 1.0]], atol=1e-12)
    numbers["c"] = 0.0106
    assert mirror_file._relative(numbers, covariance)[0] == ["a", "b", "c", "f"]
    assert mirror_file._relative({"a": 2.0}, np.array([[1e-24]]))[0] == []
    assert mirror_file._relative({"a": 2.0}, np.array([[1e-23]]))[0] == ["a"]


@pytest.mark.parametrize(
    ("covariance", "errors", "between"),
    [
        ([[0.0123456789**2]], ["0.0123"], [["1.000000"]]),
        (
            [[4e-4, -1e-4], [-1e-4, 1e-2]],
            ["0.02", "0.1"],
            [["1.000000", "-0.050000"], ["-0.050000", "1.000000"]],
        ),
        (
            [[1e-2, 0.9999999e-2], [0.9999999e-2, 1e-2]],
            ["0.1", "0.1"],
            [["1.00000000", "0.99999990"], ["0.99999990", "1.00000000"]],
        ),
    ],
)
def test_a_covariance_is_printed_with_the_digits_that_each_combination_of_it_needs(covariance, errors, between):
    assert mirror_file._rounded(np.array(covariance)) == (errors, between)


@pytest.mark.parametrize(
    ("text", "quoted", "line"),
    [
        ("µm é", '"µm é"', "µm é"),
        ("a\x7fb", '"a\\u007fb"', "a b"),
        ('a"b\\', '"a\\"b\\\\"', 'a"b\\'),
        ("a\nb\tc", '"a\\nb\\tc"', "a b c"),
        ("", '""', ""),
    ],
)
def test_a_text_in_a_mirror_file_stays_within_its_quotes_and_its_line(text, quoted, line):
    assert mirror_file._quoted(text) == quoted and tomllib.loads(f"a = {quoted}") == {"a": text}
    assert mirror_file._one_line(text) == line


def test_the_colour_of_a_residual_of_one_step_is_the_sum_of_its_correlations_until_a_pair_is_negative():
    """(80 - 3 k) / 80 at lag k: the pair of lags 26 and 27 is the last that is positive."""
    step = np.repeat([-1.0, 1.0], 40)
    assert colour_inflation([step]) == pytest.approx(26.65, rel=1e-9)
    assert colour_inflation([step[:40:2], np.tile([1.0, -1.0], 30), step, step[20:60]]) == pytest.approx(
        26.65, rel=1e-9
    )
    assert colour_inflation([np.tile([1.0, -1.0], 30)]) == 1.0
    assert colour_inflation([np.zeros(9)]) == 1.0


@pytest.mark.parametrize(
    ("losses", "best", "chance"),
    [
        ([[1.0, 2.0, 3.0]], [[1.0, 2.0, 3.0]], True),
        ([[1.0, 2.0, 3.0, 9.0]], [[1.0, 2.0, 3.0, 1.0]], True),
        ([np.tile([2.5, 1.0], 50)], [np.tile([1.0, 2.2], 50)], True),
        ([np.tile([4.0, 1.0], 50)], [np.tile([1.0, 1.9], 50)], False),
        ([np.tile([1.0, 1.9], 50)], [np.tile([4.0, 1.0], 50)], True),
        ([[2.0] * 20], [[1.0] * 20], False),
    ],
)
def test_a_difference_of_two_standard_errors_is_no_chance(losses, best, chance):
    assert may_be_chance([np.array(each) for each in losses], [np.array(each) for each in best]) is chance


@pytest.mark.parametrize(
    ("uses", "loops", "wide"),
    [
        ("loops loops validation broadband broadband", "0.csv, 1.csv", "3.csv, 4.csv"),
        ("loops validation loops", "0.csv, 2.csv", "0.csv, 2.csv"),
        ("broadband validation loops broadband", "2.csv", "0.csv, 3.csv"),
    ],
)
def test_a_linear_part_comes_from_the_broadband_recordings_or_from_all_that_were_fitted(uses, loops, wide):
    model = PrandtlIshlinskii((0.0, 1.0), (6e-5, 2e-5))
    values = [5e-5, 2.5e-5, *OF_LINEAR]
    given = "prandtl_ishlinskii_joint", model, values, ERRORS[: len(values)]
    made = joint_identification(*given, linear=JOINT_LINEAR, band=EXCITED)
    vars(made)["sources"] = tuple(
        choice.RecordingUse(f"in/{k}.csv", f"{k}", 9 * (role != "validation"), 9, role)
        for k, role in enumerate(uses.split())
    )
    text = mirror_file_text(made, "m")
    sources = {line.partition(" = ")[0]: line.rpartition("from ")[2] for line in text.split("\n") if " = " in line}
    assert [sources[key] for key in ("travel", "thresholds", "bias", "standard_errors")] == [loops] * 4
    keys = ("poles", "pole_dampings", "zeros", "zero_dampings", "excited_from", "excited_to")
    assert [sources[key] for key in keys] == [wide] * 6


def test_many_samples_of_several_records_are_thinned_alike_to_twelve_thousand():
    sizes = {"a": 20_000, "b": 4_001, "c": 12_000}
    records = [SiRecord(name, "", np.arange(n) % 7.0, np.arange(n) % 5.0, 0.01, 5) for name, n in sizes.items()]
    problem = bouc_wen_of.BoucWenProblem(tuple(records[:2]), 0.5, 250.0)
    thin = bouc_wen_of._thin_problem(problem)
    assert [r.drive_v.size for r in thin.records] == [6667, 1334]  # every third sample
    assert [r.step_s for r in thin.records] == pytest.approx([0.03, 0.03])
    assert (thin.share, thin.rate_limit) == (0.5, 250.0)
    few = bouc_wen_of.BoucWenProblem((records[2],), 0.5, 250.0)
    assert bouc_wen_of._thin_problem(few) is few


@pytest.mark.parametrize("turned", [False, True])
def test_a_mirror_file_of_a_model_that_was_not_chosen_has_the_score_and_the_warnings_of_that_model(turned):
    """Of plays and Eq. 3 one falls with the drive, the chosen one or the other."""
    sign = 1 if turned else -1
    plays_fit = PrandtlIshlinskiiFit(
        thresholds_v=np.array([0.0, 1.5]),
        weights_rad_per_v=np.array([2e-4, 5e-5]),
        standard_errors_rad_per_v=np.array([np.nan, np.nan]),
        sign=sign,
        offsets_rad=(0.0,),
        rate_limit_v_per_s=432.1,
        units=Units(),
        colour_inflation=1.0,
        condition_number=1.0,
        residual_rms_percent=0.1,
        samples_used=1300,
    )
    eq_3 = eq_3_fit(-sign, np.zeros((6, 6)), ())
    scores = (
        predictions.Score("prandtl_ishlinskii", 0.1, 1.0, 0.5, 5.0),
        predictions.Score("bouc_wen", 0.2, 2.0, 0.7, 7.0),
    )
    general = ("one.", "two.")
    both = static_identification(
        plays_fit,
        fits=(plays_fit, eq_3),
        scores=scores,
        warnings=general if turned else (*general, _FLIPPED),
        recordings=[],
        predictions=((),),
    )
    lines = mirror_file_text(both, "m", model="bouc_wen").split("\n")
    assert lines[0] == "# Mirror identified from 4 recording(s), model bouc_wen."
    assert lines[9:14] == [
        "# 987 samples used, behind the initial transient of each recording.",
        "# Residual in % of the peak-to-peak output, rms (peak):",
        "#   bouc_wen: 0.200 (2.00) on the fitted samples, 0.700 (7.00) on the held-out samples",
        "#   straight line: 2.346 (6.70) on the fitted samples, 3.457 (8.90) on the held-out samples",
        "# Choice: it is the best.",
    ]
    warned = [line for line in lines if line.startswith("# Warning")]
    assert warned == [f"# Warning: {w}" for w in (*general, *([_FLIPPED] if turned else []))]
    assert 'rate_limit = "777.0 V/s"' in "\n".join(lines) and "[uncertainty]" not in lines


def test_what_is_said_of_a_fit_of_eq_3_counts_both_records_and_what_each_adds_by_itself():
    problem = problem_of(rate_limit=250.0)
    values = np.array([1e-4, 2e-4, -2e-5, 3e-3, 1.5, 0.4])
    costs = np.array([3.0, 2.0, 2.0015, 2.01])
    fit = bouc_wen_of._report(problem, values, Units("mV", "mrad"), costs, False)
    row = np.array([*values, 250.0, 0.0])

    def modelled(at):
        given = np.array([*at, 250.0, 0.0])
        return [bouc_wen_response(r.drive_v, r.step_s, given, 0.0)[0][r.start :] for r in problem.records]

    left = [r.output_rad[r.start :] - own for r, own in zip(problem.records, modelled(row[:6]), strict=True)]
    assert_allclose(fit.offsets_rad, [part.mean() for part in left])
    rest = centred(np.concatenate(left), problem.records)
    parts = np.split(rest, [285])
    assert fit.samples_used == rest.size == 285 + 190
    largest = max(np.ptp(r.output_rad[r.start :]) for r in problem.records)
    assert fit.residual_rms_percent == pytest.approx(100 * np.sqrt(np.mean(rest**2)) / largest, rel=1e-9)
    assert fit.colour_inflation == pytest.approx(colour_inflation(parts))
    steps = np.diag(1e-5 * np.abs(values))
    ahead, behind = ([np.concatenate(modelled(values + way * s)) for s in steps] for way in (1.0, -1.0))
    jacobian = centred((np.array(ahead) - np.array(behind)).T / (2 * np.diag(steps)), problem.records)
    size = np.linalg.norm(jacobian, axis=0)
    free = rest.size - 6 - sum(r.own_count for r in problem.records)
    inverse = np.linalg.inv((jacobian / size).T @ (jacobian / size)) / np.outer(size, size)
    expected = fit.colour_inflation * (rest @ rest) / free * inverse
    assert_allclose(np.diag(fit.covariance), np.diag(expected), rtol=1e-4)  # of differences with steps of their own
    assert fit.model == BoucWen(*values.tolist(), 250.0) and fit.units == Units("mV", "mrad")
    assert_allclose(fit.start_rms_percent, 100 * np.sqrt(2 * costs))
    assert fit.agreeing_starts == 2 and fit.constrained is False and fit.name == "bouc_wen"
    assert fit.slope_after_reversal_rad_per_v == pytest.approx(1e-4 - 2e-5 * 2 * 1.5 / 1.1)
    assert fit.lowest_slope_rad_per_v == pytest.approx(bouc_wen_of.lowest_slope(problem, values))


def test_plays_are_correlated_over_what_was_fitted_alone():
    """Two loops up to their splits; a record for validation, of which nothing was fitted, adds nothing to them."""
    time = np.arange(600) * 0.05
    fit = PrandtlIshlinskiiFit(
        thresholds_v=np.array([0.0, 0.5, 1.5, 3.0]),
        weights_rad_per_v=np.array([0.0, 2e-4, 1e-4, 5e-5]),
        standard_errors_rad_per_v=np.array([np.nan, 1e-6, 3e-6, 2e-6]),
        sign=1,
        offsets_rad=(0.0, 0.0),
        rate_limit_v_per_s=4.0,
        units=Units(),
        colour_inflation=1.0,
        condition_number=1.0,
        residual_rms_percent=1.0,
        samples_used=1,
    )

    def covariance(*given):
        loops = [Recording("r", "", u[:, None], u[:, None], 50.0, ("u",), ("y",)) for u, _, _ in given]
        seen = [predictions.Prediction(u, u, start, split, 0) for u, start, split in given]
        return mirror_file._play_covariance(fit, SimpleNamespace(recordings=loops, predictions=[seen]))

    one, two = 4.0 * np.sin(time), 2.0 + 3.0 * np.sin(1.7 * time)
    jump = np.concatenate([one[:400], 50.0 * one[400:]])
    numbers, found = covariance((one, 20, 400), (two, 30, 500))
    assert numbers == {f"prandtl_ishlinskii.weights.{k}": w for k, w in ((2, 2e-4), (3, 1e-4), (4, 5e-5))}
    assert_allclose(np.diag(found), [1e-12, 9e-12, 4e-12])
    again, same = covariance((jump, 20, 400), (two, 30, 500), (9.0 * two, 100, 0))
    assert again == numbers
    assert_allclose(same, found, rtol=1e-9)
    assert np.abs(covariance((one, 20, 400), (two, 30, 300))[1] - found).max() > 1e-14


@pytest.mark.parametrize("d1", [4.0, -4.0])
def test_the_share_of_a_bound_is_lowered_by_what_the_lowest_slope_lacks_until_it_is_within_its_tolerance(
    monkeypatch, d1
):
    """The slopes are -2, -10 and -0.0006 of d1, then one within half a thousandth."""
    slopes, searched = [-8.0, -40.0, -2.4e-3, -1.6e-3], []

    def search(problem, start):
        searched.append((problem.share, start))
        return SimpleNamespace(x=start + 1)

    monkeypatch.setattr(bouc_wen_of, "lowest_slope", lambda problem, values: slopes.pop(0))
    monkeypatch.setattr(bouc_wen_of, "_search", search)
    problem = SimpleNamespace(share=0.9, solve=lambda best: np.array([d1, best, 7.0]))
    found, best = bouc_wen_of.with_tightened_bound(problem, 100)
    assert found is problem and best == 103 and slopes == []
    shares = np.cumprod([0.9, 0.995 / 3.0, 0.3, 0.995 / 1.0006])[1:]
    assert [start for _, start in searched] == [100, 101, 102]
    assert [share for share, _ in searched] == pytest.approx(shares)


def test_the_best_of_the_starts_on_fewer_samples_is_polished_on_all_of_them(monkeypatch):
    """The second of three starts comes to the least cost; it is no better than the others before its search."""
    asked, told = [], []

    def search(problem, start):
        asked.append((problem, start))
        return SimpleNamespace(x=start + 0.5, cost={1.0: 3.0, 2.0: 0.25, 3.0: 4.0}.get(start, 0.125))

    monkeypatch.setattr(bouc_wen_of, "_thin_problem", lambda problem: f"thin {problem}")
    monkeypatch.setattr(
        bouc_wen_of, "_starts", lambda problem, starts, seed: asked.append((problem, starts, seed)) or [1.0, 2.0, 3.0]
    )
    monkeypatch.setattr(bouc_wen_of, "_search", search)
    costs, best = bouc_wen_of.search_from_starts("all", 3, 17, lambda *args: told.append(args))
    assert costs.tolist() == [3.0, 0.25, 4.0] and best == 3.0
    assert asked == [("thin all", 3, 17), *(("thin all", start) for start in (1.0, 2.0, 3.0)), ("all", 2.5)]
    assert told == [(done, 3, "Bouc-Wen starts") for done in (1, 2, 3)]


@pytest.mark.parametrize("starts", [0, -2])
def test_a_fit_without_a_start_is_refused_before_its_recordings_are_looked_at(starts):
    with pytest.raises(IdentificationError) as refused:
        fit_bouc_wen([], starts=starts)
    assert str(refused.value) == f"{starts} starts were asked for; give at least 1, better 10 or more."


@pytest.mark.parametrize("admissible", [True, False])
def test_a_fit_of_eq_3_is_searched_from_its_starts_and_tightened_where_it_is_to_be_admissible(monkeypatch, admissible):
    asked = []

    class Problem:
        def __init__(self, records, share):
            self.said = (records, share)

        def solve(self, best):
            return ("solved", best, self)

    def searched(problem, *given):
        asked.append((problem.said, *given[:2]))
        given[2](1, 5, "told")
        return "costs", "best"

    other = Problem("tightened", 0.3)
    monkeypatch.setattr(bouc_wen_of, "si_records", lambda recordings, units: (recordings, units))
    monkeypatch.setattr(bouc_wen_of, "BoucWenProblem", Problem)
    monkeypatch.setattr(bouc_wen_of, "search_from_starts", searched)
    monkeypatch.setattr(bouc_wen_of, "with_tightened_bound", lambda problem, best: (other, f"{best} tightened"))
    monkeypatch.setattr(bouc_wen_of, "_report", lambda *given: given)
    told, units = [], Units("mV", "mrad")
    words = {"starts": 1, "seed": 7, "admissible": admissible, "units": units}
    problem, values, *rest = fit_bouc_wen("recordings", on_progress=lambda *given: told.append(given), **words)
    assert asked == [((("recordings", units), 1.0 if admissible else math.inf), 1, 7)] and told == [(1, 5, "told")]
    assert values == ("solved", "best tightened" if admissible else "best", problem)
    assert (problem is other) is admissible and rest == [units, "costs", admissible]
    fit_bouc_wen("recordings")
    assert asked[-1] == ((("recordings", Units()), math.inf), 12, 0) and len(told) == 1


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("epsilon", "bounded"), [(-0.5, True), (-0.015, False), (0.3, False)])
def test_what_epsilon_may_take_back_of_d1_is_bounded_whichever_way_the_output_goes(sign, epsilon, bounded):
    problem = problem_of(0.02)
    columns, bound = problem.columns(THETA), problem.bound(THETA)
    assert 0.015 < bound < 0.5
    problem.target = columns @ (sign * 1e-4 * np.array([1.0, epsilon]))
    d1, found = problem.linear(columns, THETA)
    if bounded:
        assert sign * d1 > 0.0 and found == pytest.approx(-bound * d1)
    else:
        assert (d1, found) == pytest.approx((sign * 1e-4, sign * 1e-4 * epsilon), rel=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("epsilon", "lowest", "admissible"),
    [(0.2, -0.9e-3, True), (0.2, -1.1e-3, False), (0.2, 0.5e-3, True), (0.45, 0.5, False), (0.3665, 0.5, True)],
)
def test_a_fit_of_eq_3_is_admissible_to_a_thousandth_of_its_gain_along_its_records_and_behind_a_reversal(
    monkeypatch, sign, epsilon, lowest, admissible
):
    """Behind a slow reversal the slope is 1 - 3 / 1.1 times epsilon, in d1: above 0 up to 0.3667."""
    values = np.array([sign * 1e-4, 2e-4, -sign * epsilon * 1e-4, 3e-3, 1.5, sign * 0.4])
    monkeypatch.setattr(bouc_wen_of, "lowest_slope", lambda problem, given: lowest * 1e-4)
    fit = bouc_wen_of._report(problem_of(rate_limit=250.0), values, Units("V", "mrad"), np.ones(1), False)
    assert fit.slope_after_reversal_rad_per_v == pytest.approx(1e-4 * (1.0 - epsilon * 3.0 / 1.1), abs=1e-12)
    assert (fit.lowest_slope_rad_per_v, fit.admissible) == (lowest * 1e-4, admissible)
    assert fit.falling is (sign < 0.0)
