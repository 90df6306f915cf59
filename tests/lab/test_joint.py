"""The joint fit on mirrors made without the kernels: recovery, phase lag counted once, creep, weights, predictions."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from microrad.core import kernels
from microrad.lab import bench
from microrad.lab.identify import (
    FORMS,
    IdentificationError,
    Units,
    fit_bouc_wen,
    fit_joint,
    fit_prandtl_ishlinskii,
    predict,
)
from microrad.lab.identify.hysteresis import joint
from microrad.lab.identify.hysteresis.joint import thin_record, time_constants
from microrad.lab.identify.hysteresis.plant_fit import FitRecord, PlantProblem, fit_plant, fit_records
from microrad.lab.identify.hysteresis.prandtl_ishlinskii import threshold_grid
from microrad.lab.identify.hysteresis.structures import LinearPoles, Roots, one_axis, poles_of
from microrad.lab.identify.linear.modal import late
from microrad.lab.identify.records import SiRecord, centred, memory, si_records
from microrad.lab.identify.statistics import propagated
from microrad.lab.recording import read_recording
from microrad.mirror import model as mirror
from microrad.mirror.hysteresis import BoucWen, Creep, PrandtlIshlinskii
from places import DATA
from truths import behind_resonance, bouc_wen, creep, plays, recorded, small_multisine, two_sines

UNITS = Units()
RESONANCE = LinearPoles(Roots((150.0,), (0.35,)), Roots((), ()), 3.0)
DRIVE = two_sines()
GRID = threshold_grid(np.ptp(DRIVE), 15)
THRESHOLDS, WEIGHTS = (0.0, GRID[2], GRID[6]), (6e-5, 1.5e-5, 1e-5)
CREEP_TIMES, CREEP = (0.01, 0.1, 1.0), 4e-6
EQ3 = (8e-5, 1e-5, -3e-5, 4e-3, 1.5, 0.4)
REAL = DATA / "piezo_1hz/Model_Vi_Do.dat"
needs_real = pytest.mark.skipif(not REAL.exists(), reason=f"real recording piezo_1hz absent: {REAL}")


def fitted(fit):
    """Values and standard errors by name."""
    names = [p.name for p in fit.structure.parameters]
    return {n: (v, e) for n, v, e in zip(names, fit.fit.values, fit.fit.standard_errors, strict=True)}


def assert_recovered(fit, sigmas=4.0, **truth):
    """Each parameter within its standard errors, which are small beside it."""
    found = fitted(fit)
    for name, value in truth.items():
        got, error = found[name.replace("_", " ")]
        assert abs(got - value) < sigmas * error, (name, got, value, error)
        assert error < 0.1 * abs(value), (name, error, value)


def assert_plays_recovered(fit, thresholds=THRESHOLDS, weights=WEIGHTS):
    """Weights at the thresholds of the truth, and none to speak of elsewhere."""
    given = dict(zip(thresholds, weights, strict=True))
    errors = fit.fit.standard_errors[: len(fit.model.thresholds_v)]
    for r, w, error in zip(fit.model.thresholds_v, fit.model.weights_rad_v, errors, strict=True):
        nearest = min(given, key=lambda t: abs(t - r))
        expected = given[nearest] if abs(nearest - r) < 1e-3 else 0.0
        assert abs(w - expected) < 4 * error + 2e-9
        assert error < 0.05 * sum(weights)
    for threshold in thresholds:
        assert min(abs(r - threshold) for r in fit.model.thresholds_v) < 1e-3


def loop_width(model, drive):
    """Width of a loop of slow plays in its middle, over its height."""
    slow = plays(drive, model.thresholds_v, model.weights_rad_v)
    middle = (drive.max() + drive.min()) / 2
    up, down = (np.diff(drive, prepend=drive[0]) * s > 0 for s in (1, -1))
    late = np.arange(drive.size) > drive.size // 2
    near = np.abs(drive - middle) < 0.1 * np.ptp(drive)
    slope = np.polyfit(drive, slow, 1)[0]
    straight = slow - slope * drive
    return abs(float(straight[up & late & near].mean() - straight[down & late & near].mean())) / np.ptp(slow)


def sine(freq_hz, samples=3000, rate_hz=1000.0):
    return 5.0 + 4.5 * np.sin(2 * np.pi * freq_hz * np.arange(samples) / rate_hz)


# ---------------------------------------------------------------------------------------- plays, linear part, widening
@pytest.mark.promise("identify-19", "identify-20")
def test_plays_behind_a_resonance_are_recovered():
    record = recorded(DRIVE, behind_resonance(plays(DRIVE, THRESHOLDS, WEIGHTS), 1000.0))
    fit = fit_joint([record], "prandtl_ishlinskii_joint", UNITS, linear=RESONANCE, hold="first-order")
    assert_plays_recovered(fit)
    assert 0.09 < fit.residual_rms_percent < 0.11  # the noise is 0.1 %
    assert fit.linear == RESONANCE
    static = fit_joint([record], "prandtl_ishlinskii_joint", UNITS)
    assert static.residual_rms_percent > 2 * fit.residual_rms_percent


@pytest.mark.promise("identify-10")
def test_the_linear_part_moves_with_the_rest_where_it_is_free():
    drives = (two_sines(), two_sines(freq_hz=10.0))
    loops = [
        recorded(d, behind_resonance(plays(d, THRESHOLDS, WEIGHTS), 1000.0), seed=k, name=f"loop{k}")
        for k, d in enumerate(drives)
    ]
    small = small_multisine()
    wide = recorded(small, behind_resonance(plays(small, THRESHOLDS, WEIGHTS), 1000.0), noise=3e-3, name="wide")
    off = LinearPoles(Roots((152.0,), (0.34,)), Roots((), ()), 3.0)
    held = fit_joint(loops, "prandtl_ishlinskii_joint", UNITS, linear=off, hold="first-order")
    words = {"linear": off, "free_linear": True, "hold": "first-order"}
    free = fit_joint(loops, "prandtl_ishlinskii_joint", UNITS, broadband=[wide], **words)
    assert held.linear == off
    assert_recovered(free, pole_1=150.0, pole_1_damping=0.35)
    assert fitted(free)["pole 1"][1] < 0.5
    assert free.residual_rms_percent < held.residual_rms_percent
    assert len(free.fit.residuals) == 3
    assert free.samples_used == held.samples_used  # the residual is that of the loops
    by_hand = np.concatenate([r[:, 0] for r in free.fit.residuals[:2]])
    assert free.residual_rms_rad == pytest.approx(float(np.sqrt(np.mean(by_hand**2))), rel=1e-12)


@pytest.mark.promise("choose-3")
@pytest.mark.promise("identify-20")
@pytest.mark.promise("hysteresis-20")
def test_phase_lag_is_not_counted_twice():
    """A lag of the linear part looks like hysteresis that grows with frequency, and is none."""
    truth = loop_width(fit_like(THRESHOLDS, WEIGHTS), sine(0.5))
    joint_widths, static_widths = [], []
    for freq_hz in (2.0, 20.0):
        drive = sine(freq_hz)
        record = recorded(drive, behind_resonance(plays(drive, THRESHOLDS, WEIGHTS), 1000.0))
        both = fit_joint([record], "prandtl_ishlinskii_joint", UNITS, linear=RESONANCE, hold="first-order")
        joint_widths.append(loop_width(both.model, sine(0.5)))
        alone = fit_prandtl_ishlinskii([record])
        static_widths.append(loop_width(fit_like(alone.thresholds_v, alone.weights_rad_per_v), sine(0.5)))
    assert_allclose(joint_widths, truth, rtol=0.02)
    assert static_widths[0] < 1.3 * truth
    assert static_widths[1] > 2.0 * truth


def fit_like(thresholds, weights):
    from microrad.mirror.hysteresis import PrandtlIshlinskii

    return PrandtlIshlinskii(tuple(thresholds), tuple(weights))


@pytest.mark.promise("choose-3")
@pytest.mark.promise("identify-19")
def test_widening_is_recovered_from_two_rates():
    drives = [two_sines(freq_hz=f) for f in (1.0, 8.0)]
    records = [recorded(d, plays(d, THRESHOLDS, WEIGHTS, widening=1e-3), seed=k) for k, d in enumerate(drives)]
    fit = fit_joint(records, "prandtl_ishlinskii_rate", UNITS)
    assert_recovered(fit, widening=1e-3)
    assert fit.model.widening_s == fitted(fit)["widening"][0]
    average = fit_prandtl_ishlinskii(records)
    assert average.residual_rms_percent > 2 * fit.residual_rms_percent
    none = fit_joint(
        [recorded(d, plays(d, THRESHOLDS, WEIGHTS), seed=k) for k, d in enumerate(drives)],
        "prandtl_ishlinskii_rate",
        UNITS,
    )
    assert fitted(none)["widening"][0] < 3e-5


def test_two_sample_rates_make_one_model():
    fast, slow = two_sines(), two_sines(1500, 500.0)
    records = [
        recorded(d, behind_resonance(plays(d, THRESHOLDS, WEIGHTS), rate), rate, seed=k)
        for k, (d, rate) in enumerate(((fast, 1000.0), (slow, 500.0)))
    ]
    fit = fit_joint(records, "prandtl_ishlinskii_joint", UNITS, linear=RESONANCE, hold="first-order")
    assert_plays_recovered(fit)
    wrong = [records[0], replace(records[1], rate_hz=1000.0)]
    other = fit_joint(wrong, "prandtl_ishlinskii_joint", UNITS, linear=RESONANCE, hold="first-order")
    assert other.residual_rms_rad > 2 * fit.residual_rms_rad


# --------------------------------------------------------------------------------------------------------------- creep
def crept(before, noise=1e-3, seed=0):
    output = plays(DRIVE, THRESHOLDS, WEIGHTS) + creep(DRIVE, 1000.0, CREEP_TIMES, CREEP, before)
    return recorded(DRIVE, output, noise=noise, seed=seed)


def assert_creep_recovered(fit, weights=(CREEP,) * 3):
    """Each lag within its standard errors, which are small beside it."""
    found = [fitted(fit)[f"creep at {tau:g} s"] for tau in CREEP_TIMES]
    assert fit.creep.weights_rad_v == tuple(value for value, _ in found)
    for (value, error), weight in zip(found, weights, strict=True):
        assert abs(value - weight) < 4 * error
        assert error < 0.3 * CREEP


@pytest.mark.promise("identify-19", "identify-20")
@pytest.mark.promise("hysteresis-16")
def test_each_lag_of_the_creep_has_a_weight_of_its_own():
    weights = (6e-6, 0.0, -3e-6)
    output = plays(DRIVE, THRESHOLDS, WEIGHTS)
    output += sum(creep(DRIVE, 1000.0, (tau,), weight) for tau, weight in zip(CREEP_TIMES, weights, strict=True))
    fit = fit_joint([recorded(DRIVE, output, noise=3e-4)], "prandtl_ishlinskii_creep", UNITS)
    assert_creep_recovered(fit, weights)
    assert any(name == "creep at 0.1 s" for name, _ in fit.not_identified)  # it is none
    slower = [why for name, why in fit.not_identified if name == "creep that is slower"]
    assert len(slower) == 1
    assert slower[0].startswith(
        "no record lasts long enough for a lag beyond 1 s; over a short record creep looks like"
    )
    assert not any(name == "creep at 0.01 s" for name, _ in fit.not_identified)


@pytest.mark.promise("identify-9", "identify-14", "identify-19")
def test_creep_is_recovered_whatever_went_before_the_record():
    for before in (None, 9.0):
        fit = fit_joint([crept(before)], "prandtl_ishlinskii_creep", UNITS)
        assert fit.creep.time_constants_s == CREEP_TIMES
        assert_creep_recovered(fit)
        assert_plays_recovered(fit)


def test_without_its_tail_an_older_creep_would_bias_the_weights():
    """With an offset alone beside it, the same structure leaves twice the noise and moves a weight by many errors."""
    record = crept(0.0)
    fit = fit_joint([record], "prandtl_ishlinskii_creep", UNITS)
    (prepared,) = si_records([record], UNITS)
    offset_only = fit_records([replace(record, output=1e-3 * record.output)], drop=prepared.start)
    without = fit_plant(fit.structure, offset_only)
    assert without.residual_rms[0, 0] > 2 * fit.residual_rms_rad
    assert np.max(np.abs(without.values - fit.fit.values) / fit.fit.standard_errors) > 10
    assert_plays_recovered(fit)


def test_creep_beside_a_resonance():
    output = behind_resonance(plays(DRIVE, THRESHOLDS, WEIGHTS), 1000.0) + creep(DRIVE, 1000.0, CREEP_TIMES, CREEP, 7.0)
    fit = fit_joint([recorded(DRIVE, output)], "prandtl_ishlinskii_creep", UNITS, linear=RESONANCE, hold="first-order")
    assert_creep_recovered(fit)
    assert_plays_recovered(fit)


@pytest.mark.promise("identify-20", "identify-52")
@pytest.mark.promise("hysteresis-16")
def test_time_constants_are_decades_that_the_records_show():
    def times(samples, rate_hz):
        drive = two_sines(samples, rate_hz, 10 * rate_hz / samples)
        return time_constants(si_records([recorded(drive, drive * 1e-4, rate_hz)], UNITS))

    assert times(3000, 1000.0) == (0.01, 0.1, 1.0)
    assert times(9000, 1000.0) == (0.01, 0.1, 1.0)  # a slower lag has hardly begun
    assert times(11_000, 1000.0) == (0.01, 0.1, 1.0, 10.0)
    assert times(4014, 200.0) == (0.1, 1.0, 10.0)  # not below ten samples
    assert times(1000, 50_000.0) == (0.01,)


# ----------------------------------------------------------------------------------------------------------- Bouc-Wen
@pytest.fixture(scope="module")
def generalised():
    drives = [two_sines(freq_hz=f) for f in (1.0, 8.0)]
    outputs = [bouc_wen(d, 1000.0, EQ3, gamma=0.25, eta=-0.15) for d in drives]
    return [recorded(d, y, seed=k, name=f"loop{k}") for k, (d, y) in enumerate(zip(drives, outputs, strict=True))]


@pytest.fixture(scope="module")
def asymmetric(generalised):
    return fit_joint(generalised, "bouc_wen_asymmetric", UNITS)


@pytest.mark.promise("identify-19")
def test_asymmetric_parameters_are_recovered(generalised, asymmetric):
    d1, d2, epsilon, delta, alpha, beta = EQ3
    assert_recovered(
        asymmetric,
        d1=d1,
        d2=d2,
        epsilon=epsilon,
        delta=delta,
        alpha=alpha,
        beta_over_alpha=beta / alpha,
        gamma_over_alpha=0.25 / alpha,
        eta_over_alpha=-0.15 / alpha,
    )
    assert asymmetric.model.gamma_1_v == pytest.approx(0.25, rel=0.1)
    assert 0.09 < asymmetric.residual_rms_percent < 0.11
    assert fit_bouc_wen(generalised, starts=4).residual_rms_percent > 5 * asymmetric.residual_rms_percent


def test_a_falling_sensor_turns_the_signs(generalised, asymmetric):
    turned = [replace(r, output=5.0 - r.output) for r in generalised]
    fit = fit_joint(turned, "bouc_wen_asymmetric", UNITS)
    assert fit.model.d1_rad_v == pytest.approx(-asymmetric.model.d1_rad_v, rel=1e-4)
    for name, sign in (
        ("epsilon_rad_v", -1),
        ("beta_1_v", -1),
        ("gamma_1_v", -1),
        ("eta_1_v", 1),
        ("alpha_1_v", 1),
        ("delta_s_v", 1),
    ):
        assert getattr(fit.model, name) == pytest.approx(sign * getattr(asymmetric.model, name), rel=1e-3), name
    assert fit.admissible == asymmetric.admissible
    drive = two_sines()
    assert_allclose(fit.response(drive, 1e-3)[0], -asymmetric.response(drive, 1e-3)[0], atol=1e-8)


@pytest.mark.promise("identify-22")
def test_falling_plays_have_falling_weights():
    record = recorded(DRIVE, -behind_resonance(plays(DRIVE, THRESHOLDS, WEIGHTS), 1000.0))
    fit = fit_joint([record], "prandtl_ishlinskii_joint", UNITS, linear=RESONANCE, hold="first-order")
    assert max(fit.model.weights_rad_v) <= 0.0
    assert sum(fit.model.weights_rad_v) == pytest.approx(-sum(WEIGHTS), rel=0.01)
    assert fit.admissible


@pytest.mark.promise("identify-19")
def test_the_classical_exponent_is_recovered():
    drive = two_sines(1200, 400.0)
    classical = (EQ3[0], 0.0, EQ3[2], 0.0, *EQ3[4:])
    fits = [
        fit_joint([recorded(drive, bouc_wen(drive, 400.0, classical, exponent=n), 400.0)], "bouc_wen_classical", UNITS)
        for n in (2.0, 1.0)
    ]
    assert_recovered(fits[0], exponent=2.0, d1=EQ3[0], epsilon=EQ3[2], alpha=EQ3[4])
    assert fits[0].model.delta_s_v == fits[0].model.d2_s_v == 0.0
    assert fits[1].model.exponent < 1.1  # where the truth is the bound itself
    assert fits[1].model.exponent >= 1.0


# ------------------------------------------------------------------------------------------------------- admissibility
@pytest.fixture(scope="module")
def paper_loops():
    plan = bench.load_plan("paper-experiment")
    whole = bench.play(bench.select_records(plan, ["loop-60hz", "loop-100hz"]), seed=1)
    return [replace(r, drive=r.drive[:2000], output=r.output[:2000]) for r in whole]


def lowest_slope(fit, drive, step_s):
    """Least slope of the output against the drive (rad/V); d2 is a lag, not a wrong way, and is left out."""
    still = replace(fit, mirror=mirror.assemble("still", "static", None, replace(fit.model, d2_s_v=0.0)))
    output, _ = still.response(drive, step_s)
    travel = np.diff(drive)
    moving = np.abs(travel) > 1e-6 * np.ptp(drive)
    return float(np.min((np.diff(output)[moving] / travel[moving])[drive.size // 4 :]))


@pytest.mark.promise("identify-22")
def test_an_admissible_fit_never_moves_the_wrong_way(paper_loops, monkeypatch):
    """Behind a slow reversal; at 100 Hz delta steepens h again, which the bound does not count."""
    monkeypatch.setattr(joint, "_EVALUATIONS", 15)  # the bound holds on the way, too
    free, bound = (
        fit_joint(paper_loops, "bouc_wen_asymmetric", UNITS, admissible=admissible, starts=1)
        for admissible in (False, True)
    )
    assert not free.admissible
    assert bound.admissible
    slow = 6.0 + 6.0 * np.sin(2 * np.pi * np.arange(8000) / 4000)
    d1 = free.model.d1_rad_v
    assert lowest_slope(free, slow, 2e-4) < -5 * d1
    assert lowest_slope(bound, slow, 2e-4) > -0.01 * d1
    fast = paper_loops[1]
    assert lowest_slope(free, fast.drive[:, 0], fast.step_s) < -5 * d1
    assert lowest_slope(bound, fast.drive[:, 0], fast.step_s) > -2.0 * d1  # -0.8 d1 at the optimum
    assert bound.residual_rms_percent > free.residual_rms_percent


# ------------------------------------------------------------------------------------------------- weights and thinning
@pytest.mark.promise("identify-20")
def test_a_long_record_does_not_drown_a_short_one():
    """Two gains cannot both be right, and each relative residual counts alike.

    So g minimises a (1 - g)^2 + b (1 - g/1.2)^2 with the shares a and b of each output that are not the record's own.
    """
    long, short = two_sines(6000), two_sines(600, freq_hz=8.0)
    records = [recorded(long, 1e-4 * long, noise=1e-4), recorded(short, 1.2e-4 * short, noise=1e-4)]
    fit = fit_joint(records, "linear", UNITS)
    known = [(r, r.output_rad[r.start :]) for r in si_records(records, UNITS)]
    a, b = (np.mean(centred(output, [r]) ** 2) / np.var(output) for r, output in known)
    assert 0.8 < b < 0.9 < a < 1.0
    assert sum(fit.model.weights_rad_v) == pytest.approx(1e-4 * (a + 1.2 * b / 1.44) / (a + b / 1.44), rel=1e-3)
    assert sum(fit_prandtl_ishlinskii(records).weights_rad_per_v) < 1.03e-4  # every sample counts there


def test_a_held_drive_that_was_thinned_is_as_late_as_its_steps_are_on_the_mean():
    """Steps that a converter holds for 1 ms, of which each eighth is kept: their fundamental comes behind its sine."""
    thinned = FitRecord("thinned", np.zeros((3, 1)), np.zeros((3, 1)), 8e-3, 1, 0, np.zeros((3, 0)))
    freq_hz, time_s = 5.0, (np.arange(20_000) + 0.5) * 1e-5
    held = np.sin(2.0 * np.pi * freq_hz * 1e-3 * np.floor(time_s / 1e-3))
    turned = np.angle(1j * held @ np.exp(-2j * np.pi * freq_hz * time_s))
    found = joint._between(thinned, "zero-order", 1e-3)
    assert found.hold == "first-order"
    assert found.late_s == pytest.approx(-turned / (2.0 * np.pi * freq_hz), rel=1e-3)


def test_thinning_keeps_the_fit_and_never_bends_the_drive(monkeypatch):
    drive = two_sines(20_000, 10_000.0)
    record = recorded(drive, plays(drive, THRESHOLDS, WEIGHTS), 10_000.0, noise=1e-4)
    (prepared,) = si_records([record], UNITS)
    whole = fit_joint([record], "prandtl_ishlinskii_joint", UNITS)
    assert thin_record(prepared, 20_000, 2e-3).drive_v.size == 20_000

    monkeypatch.setattr(joint, "_MOST_SAMPLES", 2500)
    fewer = thin_record(prepared, 2500, 2e-3)
    assert fewer.drive_v.size == 2500
    assert fewer.step_s == pytest.approx(8e-4)
    assert fewer.start == math.ceil(prepared.start / 8)
    assert np.array_equal(fewer.output_rad, prepared.output_rad[::8])
    between = np.interp(np.arange(drive.size - 7), np.arange(0, drive.size, 8), fewer.drive_v)
    assert np.sqrt(np.mean((between - drive[:-7]) ** 2)) <= 2e-3 * drive.std()
    part = fit_joint([record], "prandtl_ishlinskii_joint", UNITS)
    assert part.samples_used < whole.samples_used / 7
    responses = [fit.response(DRIVE, 1e-3)[0] for fit in (whole, part)]
    assert 0 < np.max(np.abs(responses[0] - responses[1])) < 2e-4 * np.ptp(responses[0])

    rough = two_sines(20_000, 10_000.0, freq_hz=300.0)
    (kept,) = si_records([recorded(rough, rough * 1e-4, 10_000.0)], UNITS)
    assert thin_record(kept, 2500, 2e-3).drive_v.size == 20_000
    corner = 5.0 + np.abs((np.arange(20_000) / 100) % 2 - 1)  # a triangle of 200 samples a period
    (kept,) = si_records([recorded(corner, corner * 1e-4, 10_000.0)], UNITS)
    assert thin_record(kept, 2500, 2e-3).drive_v.size in (10_000, 5_000, 2_500)


def test_starts_on_fewer_samples_lead_to_the_same_fit(monkeypatch):
    drive = two_sines(8000, 2000.0)
    record = recorded(drive, bouc_wen(drive, 2000.0, EQ3, pieces=3), 2000.0)
    screened = fit_joint([record], "bouc_wen_joint", UNITS)
    monkeypatch.setattr(joint, "_SCREENED_SAMPLES", 8000)
    whole = fit_joint([record], "bouc_wen_joint", UNITS)
    assert min(screened.fit.start_costs) != min(whole.fit.start_costs)
    assert 0.0 < np.max(np.abs(screened.fit.values - whole.fit.values) / whole.fit.standard_errors) < 1e-3
    assert screened.fit.agreeing_starts == whole.fit.agreeing_starts == 2


@pytest.mark.promise("identify-51", "identify-52")
def test_parameters_in_which_the_output_is_linear():
    """Their derivatives take one simulation, whatever the step; those by two are the same."""
    fit = fit_joint([crept(None)], "prandtl_ishlinskii_rate_creep", UNITS)
    marked = [p.name for p in fit.structure.parameters if p.linear]
    assert marked == [p.name for p in fit.structure.parameters if p.name != "widening"]
    parameters = tuple(replace(parameter, linear=False) for parameter in fit.structure.parameters)
    unmarked = replace(fit.structure, parameters=parameters, beside=())
    records = fit_records([crept(None)])
    at = fit.fit.values / np.array([p.scale for p in fit.structure.parameters]) + 0.1
    one, two = (PlantProblem(s, records).slopes(at, central=True) for s in (fit.structure, unmarked))
    assert_allclose(one.T @ one, two.T @ two, rtol=1e-7)


# --------------------------------------------------------------------------------------------------------- predictions
@pytest.mark.promise("identify-9")
def test_what_a_record_adds_comes_from_its_known_part_alone():
    fit = fit_joint([crept(None)], "prandtl_ishlinskii_creep", UNITS)
    record = crept(9.0, seed=4)
    known = predict(fit, record, 1500)
    bent = record.output.copy()
    bent[1500:] += 100.0
    assert np.array_equal(predict(fit, replace(record, output=bent), 1500).model_rad, known.model_rad)
    unseen = known.residual_rad[1500:]
    assert 0.0009 < np.sqrt(np.mean(unseen**2)) / np.ptp(record.output * 1e-3) < 0.0015  # the noise is 0.1 %
    moved = record.output.copy()
    moved[known.start : 1500] += 100.0
    assert predict(fit, replace(record, output=moved), 1500).model_rad.mean() > known.model_rad.mean() + 0.05


@pytest.mark.promise("identify-9")
def test_a_split_of_zero_says_that_all_is_unseen():
    fit = fit_joint([crept(None)], "prandtl_ishlinskii_creep", UNITS)
    record = crept(9.0, seed=4)
    unseen, default = predict(fit, record, 0), predict(fit, record)
    assert unseen.split == unseen.start > 0
    assert default.split == record.samples
    assert unseen.start > 4 * default.start > 0
    apart = (unseen.model_rad - default.model_rad)[unseen.start :]  # its offset and tail are its own
    assert 0.0 < np.sqrt(np.mean(apart**2)) < 1e-4 * np.ptp(unseen.measured_rad)
    for split in (-5, 1, record.samples + 1):
        with pytest.raises(IdentificationError, match=rf"split {split} does not lie within the 3000 samples"):
            predict(fit, record, split)


def test_states_are_carried_through():
    fit = fit_joint([crept(None)], "prandtl_ishlinskii_creep", UNITS)
    drive = crept(None).drive[:, 0]
    whole = fit.response(drive, 1e-3)[0]
    fresh = fit.response(drive[1700:], 1e-3)[0]
    assert np.ptp(fresh - whole[1700:]) > 1e-6
    oracle = plays(drive, fit.model.thresholds_v, fit.model.weights_rad_v)
    oracle += sum(creep(drive, 1e3, (tau,), w) for tau, w in zip(CREEP_TIMES, fit.creep.weights_rad_v, strict=True))
    assert_allclose(whole, oracle, atol=1e-9)


@needs_real
def test_creep_is_what_a_real_record_needs(monkeypatch):
    """Fitted on the first half, judged on the second, states carried through: at most 0.70 % of peak-to-peak (rms)."""
    monkeypatch.setattr(joint, "_MOST_SAMPLES", 2007)  # every second sample is fitted, and all are judged
    record = read_recording(REAL, 0, 4, 200.0)
    units = Units("V", "um", 0.02)
    head = replace(record, drive=record.drive[:4014], output=record.output[:4014])
    span = np.ptp(head.output) * units.radians

    def unseen_percent(name, admissible=False):
        fit = fit_joint([head], name, units, admissible=admissible, starts=1)
        residual = predict(fit, record, 4014).residual_rad[4014:]
        return 100 * float(np.sqrt(np.mean(residual**2))) / span, fit.admissible

    assert 0.5 < (plain := unseen_percent("prandtl_ishlinskii_creep"))[0] < 0.70
    assert plain[1]
    assert 0.3 < (bound := unseen_percent("bouc_wen_creep", True))[0] < 0.60
    assert bound[1]
    assert unseen_percent("prandtl_ishlinskii_joint")[0] > 0.80
    assert unseen_percent("prandtl_ishlinskii_rate")[0] > 0.80


# ------------------------------------------------------------------------------------------------- parts of the whole
@pytest.mark.promise("identify-19")
def test_every_form_can_be_fitted_and_run():
    record = recorded(DRIVE[:1500], plays(DRIVE[:1500], THRESHOLDS, WEIGHTS))
    for name in ("linear", "bouc_wen_joint", "prandtl_ishlinskii_rate_creep"):
        fit = fit_joint([record], name, UNITS, starts=1)
        assert fit.name == name
        assert fit.form == FORMS[name]
        assert fit.fit.converged
        assert 0.05 < fit.residual_rms_percent < 10
    assert len(FORMS) == 9


def test_poles_of_a_linear_part_and_back():
    system = LinearPoles(Roots((40.0, 150.0), (1.0, 0.35)), Roots((60.0,), (1.0,)), 3.0).system
    found = poles_of(system, (1.0, 400.0), 1000.0)
    assert_allclose(found.poles.frequencies_hz, (40.0, 150.0), rtol=1e-9)
    assert_allclose(found.poles.dampings, (1.0, 0.35), rtol=1e-9)
    assert_allclose(found.zeros.frequencies_hz, (60.0,), rtol=1e-6)
    assert found.normalise_at_hz == pytest.approx(math.sqrt(1.0 * 15.0))
    far = LinearPoles(Roots((40.0, 150.0), (1.0, 0.35)), Roots((5000.0,), (1.0,)), 3.0).system
    assert poles_of(far, (1.0, 400.0), 1000.0).zeros.frequencies_hz == ()
    assert poles_of(far, (1.0, 400.0), 5050.0).zeros.frequencies_hz == pytest.approx((5000.0,), rel=1e-6)


def test_errors_are_propagated():
    values, covariance = np.array([2.0, 5.0]), np.array([[0.04, 0.01], [0.01, 0.09]])
    (product,) = propagated(lambda v: np.array([v[0] * v[1]]), values, covariance)
    gradient = np.array([5.0, 2.0])
    assert product == pytest.approx(math.sqrt(gradient @ covariance @ gradient), rel=1e-6)


def test_standard_errors_match_the_scatter():
    fits = [fit_joint([crept(9.0, seed=s)], "prandtl_ishlinskii_creep", UNITS) for s in range(8)]
    scatter = np.std([f.creep.weights_rad_v[0] for f in fits], ddof=1)
    reported = np.median([fitted(f)["creep at 0.01 s"][1] for f in fits])
    assert 0.5 < scatter / reported < 2.0
    totals = np.std([sum(f.model.weights_rad_v) for f in fits], ddof=1)
    assert 0 < totals < 5e-7


# ------------------------------------------------------------------------------------------ numbers unlike each other
def made_of(**parts):
    """What of a joint fit is looked at."""
    fit = object.__new__(joint.JointFit)
    for key, value in parts.items():
        object.__setattr__(fit, key, value)
    return fit


def test_why_numbers_of_a_joint_fit_are_not_known_is_told_by_their_kind():
    named = (
        "weight at 2 V",
        "widening",
        "creep at 0.1 s",
        "d1",
        "d2",
        "delta",
        "exponent",
        "delay",
        "pole 2 damping",
        "zero 1",
    )
    found = [(name, f"fact {k}") for k, name in enumerate((*named, "gamma over alpha"))]
    fit = made_of(fit=SimpleNamespace(not_identified=tuple(found)), creep=Creep((1.0, 2.0), (2.5, 0.5)))
    beyond = "a pole and a zero side by side nearly cancel, and one beyond the band is a flank only"
    rate = "the loops widen too little with the rate to tell; record faster loops"
    why = (
        "neighbouring thresholds do nearly the same; loops of more amplitudes tell them apart",
        rate,
        "over a short record creep looks like gain; record a staircase with long dwells",
        "a large hysteresis or creep looks like gain; larger loops or longer records tell them apart",
        "its effect on the output is below what is left; faster loops would show it",
        rate,
        "only the shape of the branches fixes it; record loops of several amplitudes",
        "poles and zeros beyond the band turn the phase as a delay does",
        beyond,
        beyond,
        "loops fix the settled hysteresis, only the samples behind a reversal its parts; record small loops",
    )
    expected = [(name, f"{fact}; {reason}") for (name, fact), reason in zip(found, why, strict=True)]
    slow = f"no record lasts long enough for a lag beyond 2.5 s; {why[2]}"
    assert fit.not_identified == (*expected, ("creep that is slower", slow))
    assert made_of(fit=fit.fit, creep=Creep((), ())).not_identified == tuple(expected)
    linear = LinearPoles(Roots((150.0,), (0.35,)), Roots((), ()), 3.0, 7e-4)
    assert (made_of(linear=linear).delay_s, made_of(linear=None).delay_s) == (7e-4, 0)
    assert made_of(structure=SimpleNamespace(parameters=(1, 2, 3))).parameter_count == 3


@pytest.mark.parametrize("hold", ["zero-order", "first-order"])
def test_a_response_of_a_joint_fit_is_about_the_first_drive_value_and_behind_its_delay(hold):
    """A gain behind one lag of 20 ms, four samples and a half later; a drive of steps."""
    linear = LinearPoles(Roots((1 / (2 * math.pi * 0.02),), (1.0,)), Roots((), ()), 1e-6, 4.5e-3)
    plant = mirror.assemble("m", "cascade", linear.system, PrandtlIshlinskii((0.0,), (3.0,)))
    fit = made_of(mirror=plant, linear=linear, hold=hold, model=PrandtlIshlinskii((0.0,), (3.0,)))
    drive = 7.0 + np.sin(np.arange(300) / 25.0) + 0.3 * np.sin(np.arange(300) / 11.0)
    found, clamped = fit.response(drive, 1e-3)
    keep, state, output = math.exp(-1 / 20), 0.0, []
    for u, ahead in zip(drive - drive[0], [*(drive[1:] - drive[0]), 0.0], strict=True):
        output.append(state)
        if hold == "zero-order":
            state = keep * state + (1 - keep) * u
        else:  # a straight line: its end, less what lags of its slope
            slope = 20 * (ahead - u)
            state = keep * (state - u + slope) + ahead - slope
    plain = 3.0 * np.array(output)
    between = late(plain[:, None], 4.5)[:, 0]
    assert_allclose(found[20:280], between[20:280], atol=2e-4)
    assert found.shape == (300,) and clamped == 0


def record_of(samples=400, step_s=0.01, name="r"):
    drive = 4.0 + np.sin(np.arange(samples) / 9.0) * np.linspace(0.5, 2.0, samples)
    return SiRecord(name, "", drive, 1e-4 * drive**2 + 1e-6 * np.arange(samples), step_s, samples // 20)


def test_what_a_record_may_add_is_an_offset_its_memory_and_the_tail_of_all_lags():
    record = record_of()
    found = joint._nuisance(record.drive_v, 0.01, (0.1, 2.0), 300)
    time = 0.01 * np.arange(400)
    assert_allclose(found[:, 0], 1.0)
    assert_allclose(found[:, 1:9], memory(record.drive_v, 300))
    assert_allclose(found[:, 9], np.exp(-time / 0.1) + np.exp(-time / 2.0))
    assert joint._nuisance(record.drive_v, 0.01, (), 400).shape == (400, 9)
    assert_allclose(made_of(creep=Creep((1.0, 1.0), (0.1, 2.0))).nuisance(record.drive_v, 0.01, 300), found)


def test_a_record_of_a_fit_is_about_its_first_drive_value_and_counts_by_its_used_output():
    record = record_of()
    run = joint._fit_record(record, (0.5,))
    assert (run.name, run.step_s, run.stride, run.first, run.hold, run.late_s) == ("r", 0.01, 1, 20, "first-order", 0.0)
    assert_allclose(run.drive[:, 0], record.drive_v - record.drive_v[0])
    assert_allclose(run.output[:, 0], record.output_rad)
    used = record.output_rad[20:]
    assert run.weight == pytest.approx(1 / (np.std(used) * math.sqrt(380)))
    columns = joint._nuisance(record.drive_v, 0.01, (0.5,), 400)[20:]
    own = columns @ np.linalg.lstsq(columns, used, rcond=None)[0]
    assert_allclose(run.target[:, 0], used - own, atol=1e-9 * np.ptp(used))
    held = joint._between(run, "zero-order", 0.01)
    assert (held.hold, held.late_s) == ("zero-order", 0.0)
    thinned = joint._between(run, "zero-order", 0.0025)
    assert (thinned.hold, thinned.late_s) == ("first-order", 0.00125)
    straight = joint._between(run, "first-order", 0.0025)
    assert (straight.hold, straight.late_s) == ("first-order", 0.0)


def test_records_are_weighed_by_what_is_left_of_each_where_the_search_begins():
    """Plays of one weight leave the squares of what two outputs have beyond it: of both the sum becomes 1 together."""
    structure = one_axis("plays", PrandtlIshlinskii((0.0,), (2e-4,)))
    runs = [joint._fit_record(record_of(n, step, name), ()) for n, step, name in ((400, 0.01, "a"), (260, 0.02, "b"))]
    runs[1] = replace(runs[1], output=3.0 * runs[1].output)
    weighed = joint._weighed(structure, runs)
    total = 0.0
    for before, after in zip(runs, weighed, strict=True):
        modelled = 2e-4 * before.drive[before.first :, 0]
        left = modelled - before.output[before.first :, 0]
        left = left - before.nuisance @ (before.nuisance.T @ left)
        assert after.weight == pytest.approx(1 / (np.sqrt(np.mean(left**2)) * math.sqrt(380 + 247)), rel=1e-6)
        assert (after.name, after.first, after.step_s) == (before.name, before.first, before.step_s)
        total += np.sum((after.weight * left) ** 2)
    assert total == pytest.approx(1.0)


def test_starts_are_scattered_in_epsilon_and_alpha_alone_and_by_their_seed():
    parameters = [SimpleNamespace(name=name, start=start) for name, start in NAMED_STARTS]
    one = joint._scattered_starts(SimpleNamespace(parameters=parameters), 4, 11)
    assert len(one) == 3
    rng = np.random.Generator(np.random.Philox(11))
    for found in one:
        moved = rng.standard_normal(5)
        assert_allclose(
            found,
            [3.0, -2.0 * np.exp(0.3 * moved[1]), 0.5 * np.exp(0.3 * moved[2]), 0.25, 0.7 * np.exp(0.3 * moved[4])],
        )
    assert joint._scattered_starts(SimpleNamespace(parameters=parameters), 1, 11) == []


NAMED_STARTS = (
    ("d1", 3.0),
    ("epsilon", -2.0),
    ("alpha", 0.5),
    ("beta over alpha", 0.25),
    ("epsilon over its limit", 0.7),
)


def test_plays_begin_at_their_least_squares_with_creep_and_the_sign_of_the_output():
    """Of two records one is three times as large; both count alike, and all weights have one sign."""
    records = [record_of(400, 0.01, "a"), replace(record_of(300, 0.01, "b"), start=15)]
    thresholds = threshold_grid(max(np.ptp(r.drive_v) for r in records), 15)
    given = []
    for record, size in zip(records, (1.0, 3.0), strict=True):
        drive = record.drive_v - record.drive_v[0]
        plays_of = kernels.play_response(drive, thresholds, np.zeros(15))
        lag = kernels.lag_response(drive, 0.01, np.array([0.5]), np.zeros(1))
        output = -size * (plays_of[:, 0] * 5e-5 + plays_of[:, 4] * 2e-5 + lag[:, 0] * 1e-5)
        given.append(replace(record, output_rad=output if size == 1.0 else output / 3.0))
    runs = [joint._fit_record(record, (0.5,)) for record in given]
    model, creep = joint._play_start(FORMS["prandtl_ishlinskii_creep"], tuple(given), runs, None, (0.5,))
    expected = np.zeros(15)
    expected[[0, 4]] = -5e-5, -2e-5
    assert_allclose(model.weights_rad_v, expected, atol=2e-9)
    assert creep == (pytest.approx(-1e-5, rel=1e-3),) and model.widening_s == 0.0
    assert_allclose(model.thresholds_v, thresholds)
    line, none = joint._play_start(FORMS["linear"], tuple(given), runs, None, ())
    assert line.thresholds_v == (0.0,) and len(line.weights_rad_v) == 1 and none == ()


@pytest.mark.parametrize(
    ("samples", "most", "bent", "kept"),
    [
        (1000, 1000, 1.0, 1000),
        (1001, 500, 1.0, 334),
        (1000, 250, 1.0, 250),
        (1000, 250, 0.0, 1000),
        (999, 300, 0.01, 500),
        (1000, 150, 0.045, 334),
    ],
)
def test_a_record_is_thinned_by_halves_until_straight_lines_make_its_drive(samples, most, bent, kept):
    drive = np.sin(2 * np.pi * np.arange(samples) / 40.0)
    record = SiRecord("r", "", drive, drive, 0.01, 50)
    found = thin_record(record, most, bent)
    assert found.drive_v.size == kept
    assert found.step_s == pytest.approx(0.01 * math.ceil(samples / kept))


@pytest.mark.parametrize(
    ("records", "decades"),
    [
        ([(1000, 1e-3)], [-2, -1, 0]),
        ([(999, 1e-3)], [-2, -1]),
        ([(100_000, 1e-4)], [-2, -1, 0, 1]),
        ([(50, 1.0)], [1]),
        ([(3, 1.0)], [0]),
        ([(30, 5e-3), (9000, 5e-2)], [-1, 0, 1, 2]),
        ([(2000, 1e-5), (20, 1e-3)], [-2]),
    ],
)
def test_decades_of_creep_are_between_ten_of_the_shortest_steps_and_the_longest_record(records, decades):
    given = [SimpleNamespace(drive_v=np.zeros(samples), step_s=step) for samples, step in records]
    assert time_constants(given) == pytest.approx([10.0**k for k in decades])


@pytest.mark.parametrize(
    ("model", "admissible", "falling"),
    [
        (PrandtlIshlinskii((0.0, 1.0), (3.0, 0.0)), True, False),
        (PrandtlIshlinskii((0.0, 1.0), (3.0, -1.0)), False, False),
        (PrandtlIshlinskii((0.0, 1.0), (-3.0, -1.0)), True, True),
        (BoucWen(2e-5, 0.0, -1e-5, 0.0, 1.0, 0.0), True, False),
        (BoucWen(2e-5, 0.0, -1.0009e-5, 0.0, 1.0, 0.0), True, False),
        (BoucWen(2e-5, 0.0, -1.0011e-5, 0.0, 1.0, 0.0), False, False),
        (BoucWen(-2e-5, 0.0, 1e-5, 0.0, 1.0, 0.0), True, True),
        (BoucWen(-2e-5, 0.0, 1.2e-5, 0.0, 1.0, 0.0), False, True),
    ],
)
def test_a_joint_fit_is_admissible_to_a_thousandth_of_its_gain_whichever_way_it_runs(model, admissible, falling):
    fit = made_of(model=model, linear=None, structure=SimpleNamespace(parameters=(1, 2, 3)))
    assert (fit.admissible, fit.falling, fit.delay_s, fit.parameter_count) == (admissible, falling, 0.0, 3)


def test_forms_have_their_family_their_extras_and_what_they_need():
    rows = [
        f"{name}: {form.family} [{' '.join(form.free)}]{' creep' * form.creep}{' linear' * form.needs_linear}"
        for name, form in FORMS.items()
    ]
    assert rows == [
        "linear: linear [] linear",
        "bouc_wen_classical: bouc_wen [exponent]",
        "bouc_wen_joint: bouc_wen [d2 delta] linear",
        "bouc_wen_asymmetric: bouc_wen [d2 delta gamma eta]",
        "bouc_wen_creep: bouc_wen [d2 delta] creep",
        "prandtl_ishlinskii_joint: prandtl_ishlinskii [] linear",
        "prandtl_ishlinskii_rate: prandtl_ishlinskii [widening]",
        "prandtl_ishlinskii_creep: prandtl_ishlinskii [] creep",
        "prandtl_ishlinskii_rate_creep: prandtl_ishlinskii [widening] creep",
    ]


@pytest.mark.parametrize("hold", ["first-order", "zero-order"])
@pytest.mark.parametrize(("delay_s", "late_s"), [(0.0, 0.0), (2e-3, 0.0), (1e-3, 1e-3)])
def test_columns_behind_a_linear_part_are_late_by_both_delays(hold, delay_s, late_s):
    """A lag of 20 ms of two ramps and a sine from rest, each a column of its own."""
    linear = LinearPoles(Roots((1 / (2 * math.pi * 0.02),), (1.0,)), Roots((), ()), 1e-6, delay_s)
    run = FitRecord("r", np.zeros((9, 1)), np.zeros((9, 1)), 1e-3, 1, 0, np.zeros((9, 0)), hold=hold, late_s=late_s)
    time = np.arange(200)
    columns = np.column_stack([np.sin(time / 25.0), 0.01 * time, -0.03 * time])
    found = joint.behind_linear_part(columns, linear, run)
    expected, keep = np.zeros_like(columns), math.exp(-1 / 20)
    for k in range(199):
        u, slope = columns[k], 20.0 * (columns[k + 1] - columns[k]) * (hold == "first-order")
        expected[k + 1] = keep * (expected[k] - u + slope) + u + slope / 20.0 - slope
    shift = round((delay_s + late_s) / 1e-3)
    assert_allclose(found[40:], expected[40 - shift : 200 - shift], rtol=1e-6)
    assert joint.behind_linear_part(columns, None, run) is columns


def test_the_lags_of_creep_are_those_that_the_thinned_records_show(monkeypatch):
    given = []

    def seen(records):
        given.extend(records)
        raise RuntimeError("seen")

    monkeypatch.setattr(joint, "time_constants", seen)
    monkeypatch.setattr(joint, "_MOST_SAMPLES", 500)
    drive = np.sin(np.linspace(0.0, 9.0, 2000))
    with pytest.raises(RuntimeError, match="seen"):
        fit_joint([recorded(drive, 5e-5 * drive, 1e3)], "prandtl_ishlinskii_creep", UNITS)
    assert [(record.drive_v.size, record.step_s) for record in given] == [(500, 4e-3)]


@pytest.mark.parametrize(
    ("damping", "expected"),
    [(0.6, [-6 + 8j, -6 - 8j]), (-0.6, [6 + 8j, 6 - 8j]), (1.0, [-10]), (-1.0, [10])],
)
def test_roots_keep_their_half_plane(damping, expected):
    roots = Roots((10.0 / (2.0 * math.pi),), (damping,))
    assert_allclose(np.sort_complex(roots.values), np.sort_complex(np.array(expected, dtype=complex)), rtol=1e-12)
    assert Roots.of(roots.values).dampings == pytest.approx(roots.dampings)


def asked_of_fit_plant(monkeypatch, recordings, name, **words):
    """A joint fit whose search ends where it begins, and what it was asked for."""
    asked = {}

    def kept(structure, records, **given):
        values = np.array([p.start for p in structure.parameters])
        asked.update(given, records=records)
        left = tuple(np.full((r.output.shape[0] - r.first, 1), 1e-6 * (k + 1)) for k, r in enumerate(records))
        return SimpleNamespace(values=values, residuals=left, mirror=structure.build(values))

    monkeypatch.setattr(joint, "fit_plant", kept)
    return fit_joint(recordings, name, UNITS, **words), asked


def loops_of(*sizes):
    """Loops of unlike length, rate and first drive value."""
    drives = [4.0 + 3.0 * k + (3.0 + 2.0 * k) * np.sin(np.arange(n) / 20.0) for k, n in enumerate(sizes)]
    return [recorded(d, 7e-5 * d, 500.0 * (k + 1), name=f"l{k}") for k, d in enumerate(drives)]


STATIC_FIT = SimpleNamespace(model=BoucWen(*EQ3, rate_limit_v_s=90.0))


@pytest.mark.parametrize(
    ("name", "rates", "free"),
    [
        ("bouc_wen_creep", True, ["d2", "delta"]),
        ("bouc_wen_asymmetric", True, ["d2", "delta", "gamma over alpha", "eta over alpha"]),
        ("bouc_wen_classical", False, ["exponent"]),
    ],
)
@pytest.mark.parametrize("admissible", [False, True])
def test_a_joint_fit_of_eq_3_begins_at_its_static_fit_about_the_mean_of_the_first_drives(
    monkeypatch, name, rates, free, admissible
):
    words = {"static": STATIC_FIT, "admissible": admissible, "starts": 3, "seed": 4}
    fit, asked = asked_of_fit_plant(monkeypatch, loops_of(900, 1400), name, **words)
    creep_on = name.endswith("creep")
    epsilon = "epsilon over its limit" if admissible else "epsilon"
    names = [p.name for p in fit.structure.parameters]
    assert names[: 4 + len(free)] == ["d1", epsilon, "alpha", "beta over alpha", *free]
    assert fit.model.bias_v == pytest.approx(5.5)
    assert fit.model.rate_limit_v_s == fit.rate_limit_v_per_s == 90.0
    assert (fit.model.d2_s_v, fit.model.delta_s_v) == ((1e-5, 4e-3) if rates else (0.0, 0.0))
    assert fit.creep == (Creep((8e-8,) * 3, (0.01, 0.1, 1.0)) if creep_on else Creep())
    assert len(asked["starts"]) == 2 and asked["tolerance"] == 1e-9 and asked["most_evaluations"] == 200
    assert [r.name for r in asked["records"]] == ["l0", "l1"] == [r.name for r in asked["screen"]]
    assert {r.hold for r in asked["records"]} == {"first-order"}  # nothing lags behind the hysteresis
    used = [len(r.output) - r.first for r in asked["records"]]
    rms = 1e-6 * math.sqrt((used[0] + 4 * used[1]) / sum(used))
    assert fit.residual_rms_rad == pytest.approx(rms) and fit.samples_used == sum(used)
    assert fit.residual_rms_percent == pytest.approx(100 * rms / max(np.ptp(r.output) for r in asked["records"]))
    assert (fit.linear, fit.delay_s, fit.hold, fit.begun) == (None, 0.0, "first-order", False)


def test_recordings_of_the_linear_part_belong_to_a_fit_of_it_and_two_of_their_periods_say_all(monkeypatch):
    drive = small_multisine(period=300, periods=5)
    wide = [recorded(drive, 7e-5 * drive, name=name, period=n) for name, n in (("periodic", 300), ("chirp", None))]
    words = {"linear": RESONANCE, "free_linear": True, "broadband": wide, "hold": "zero-order", "evaluations": 7}
    fit, asked = asked_of_fit_plant(monkeypatch, loops_of(900, 1400), "bouc_wen_joint", static=STATIC_FIT, **words)
    runs = asked["records"]
    assert [(r.name, len(r.output), r.step_s) for r in runs] == [
        *(("l0", 900, 2e-3), ("l1", 1400, 1e-3)),
        *(("periodic", 600, 1e-3), ("chirp", 1500, 1e-3)),
    ]
    assert {r.hold for r in runs} == {"zero-order"} and asked["screen"] == ()
    assert (asked["tolerance"], asked["most_evaluations"]) == (1e-10, 7)
    assert fit.samples_used == sum(len(r.output) - r.first for r in runs[:2]) and fit.linear == RESONANCE
    assert [p.name for p in fit.structure.parameters][-3:] == ["pole 1", "pole 1 damping", "delay"]


def test_a_joint_fit_that_begins_at_another_of_its_form_scatters_no_starts_and_weighs_by_what_that_leaves(monkeypatch):
    model = BoucWen(*EQ3, rate_limit_v_s=55.0)
    begin = SimpleNamespace(model=model, creep=Creep((2e-7, 3e-7, 4e-7), (0.01, 0.1, 1.0)))
    weigh = []
    monkeypatch.setattr(joint, "_weighed", lambda structure, runs: weigh.append(structure) or runs[::-1])
    words = {"linear": RESONANCE, "begin": begin, "hold": "first-order"}
    fit, asked = asked_of_fit_plant(monkeypatch, loops_of(900, 1400), "bouc_wen_creep", **words)
    assert fit.begun and fit.model == model and fit.creep == begin.creep and fit.rate_limit_v_per_s == 55.0
    assert asked["starts"] == () and weigh == [fit.structure]
    assert [r.name for r in asked["records"]] == ["l1", "l0"]
    assert fit.linear is RESONANCE and [p.name for p in fit.structure.parameters][-1] == "creep at 1 s"
