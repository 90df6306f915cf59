"""The joint fit on the Bouc-Wen benchmark, against an oracle that knows nothing of the kernels, and its uncertainty."""

import pickle
from dataclasses import astuple, replace
from math import pi
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from microrad.core import lti
from microrad.lab.identify import IdentificationError
from microrad.lab.identify.hysteresis import plant_fit, structures
from microrad.lab.identify.hysteresis.bouc_wen import made_rising
from microrad.lab.identify.hysteresis.plant_fit import (
    FitRecord,
    Parameter,
    PlantProblem,
    Structure,
    _covariance,
    _scatter,
    fit_plant,
    fit_records,
    simulate_record,
    upsampled,
)
from microrad.lab.identify.hysteresis.structures import LinearPoles, Roots, hysteretic_oscillator, one_axis, poles_of
from microrad.lab.identify.statistics import colour_inflation
from microrad.lab.recording import Recording, read_recording, recording_from_arrays
from microrad.mirror import model as mirror
from microrad.mirror.hysteresis import BoucWen, Creep, PrandtlIshlinskii
from microrad.mirror.model import Mirror
from places import DATA
from truths import philox, plays, recorded, two_sines

BENCHMARK = DATA / "boucwen" / "train.h5"
needs_benchmark = pytest.mark.skipif(not BENCHMARK.exists(), reason=f"recording boucwen absent: {BENCHMARK}")

# Noël and Schoukens (2016): m, c, k, alpha, beta gamma, beta delta with exponent 1
PUBLISHED = np.array([2.0, 10.0, 5e4, 5e4, 800.0, -1100.0])
RATE_HZ, FINE = 750.0, 20
NAMES = ("mass", "damping", "stiffness", "slope", "decay", "asymmetry")


def test_the_change_of_order_one_is_a_size_or_the_start_or_one():
    assert Parameter("p", "", -3.0).scale == 3.0
    assert Parameter("p", "", -3.0, size=2.0).scale == 2.0
    assert Parameter("p", "", 0.0, size=2.0).scale == 2.0
    assert Parameter("p", "", 0.0).scale == 1.0


@pytest.mark.parametrize(
    ("sign", "bounds"), [(1.0, (0.0, np.inf)), (-1.0, (-np.inf, 0.0)), (0.0, (0.0, np.inf)), (-0.0, (0.0, np.inf))]
)
def test_weights_of_plays_stay_on_the_side_where_they_begin(sign, bounds):
    """The size of one that begins at nothing is a hundredth of the sum, or of 1 rad/V where there is none."""
    model = PrandtlIshlinskii((0.0, 2.0), (sign * 5e-5, 0.0))
    first, second = one_axis("plays", model).parameters
    assert [(p.lower, p.upper) for p in (first, second)] == [bounds] * 2
    assert (first.name, second.name, first.unit) == ("weight at 0 V", "weight at 2 V", "rad/V")
    assert (first.scale, second.scale) == pytest.approx((5e-5, 5e-7) if sign else (0.01, 0.01))


@pytest.mark.parametrize(
    ("thresholds", "limit", "most"), [((0.0, 4.0), 200.0, 0.02), ((0.0, 4.0), np.inf, 4.0), ((0.0,), np.inf, 1.0)]
)
def test_a_widening_is_searched_up_to_three_times_the_largest_threshold_over_the_fastest_rate(thresholds, limit, most):
    model = PrandtlIshlinskii(thresholds, (5e-5,) * len(thresholds), rate_limit_v_s=limit)
    found = one_axis("plays", model, free=("widening",)).parameters[-1]
    assert (found.name, found.unit, found.lower) == ("widening", "s", 0.0)
    assert (found.start, found.upper, found.scale) == pytest.approx((0.01 * most, 3.0 * most, 0.1 * most))
    wide = one_axis("plays", replace(model, widening_s=0.5 * most), free=("widening",)).parameters[-1]
    assert wide.start == 0.5 * most


def periodic_record(periods, tail=0, off=0.0):
    """Periods of 100 samples, of which the second is off by a share of the largest drive."""
    one = np.sin(2 * pi * np.arange(100) / 100)
    drive = np.concatenate([np.tile(one, periods), one[:tail]])
    drive[125:126] += off
    column = drive[:, None]
    return Recording("periodic", "", column, column.copy(), 1000.0, ("u",), ("y",), 100)


@pytest.mark.parametrize(
    ("record", "repeats"),
    [
        (periodic_record(2), True),
        (periodic_record(3, 50), True),
        (periodic_record(1, 99), False),
        (replace(periodic_record(3), period_samples=None), False),
        (periodic_record(2, off=0.5e-6), True),
        (periodic_record(2, off=2e-6), False),
    ],
)
def test_two_whole_periods_of_one_drive_become_one(record, repeats):
    (run,) = fit_records([record])
    assert (len(run.drive), run.first) == ((200, 100) if repeats else (record.samples, 0))


def test_a_record_of_which_all_is_left_out_is_refused():
    record = replace(periodic_record(2), period_samples=None)
    assert fit_records([record], drop=198)[0].first == 198
    for drop in (199, 200):
        with pytest.raises(
            IdentificationError, match=rf"^periodic: 200 samples, of which the first {drop} are left out"
        ):
            fit_records([record], drop=drop)


def started(factors):
    return hysteretic_oscillator(**dict(zip(NAMES, (PUBLISHED * factors).tolist(), strict=True)))


def runge_kutta(drive_at_half_steps, step_s, parameters=PUBLISHED):
    """The oscillator by the classical Runge-Kutta method, scalar by scalar; the drive is given twice a step."""
    m, c, k, a, bg, bd = (float(p) for p in parameters)

    def slope(y, v, z, u):
        return v, (u - c * v - k * y - z) / m, a * v - bg * abs(v) * z - bd * v * abs(z)

    y = v = z = 0.0
    found = [y]
    u = drive_at_half_steps.tolist()
    for i in range(0, len(u) - 2, 2):
        y1, v1, z1 = slope(y, v, z, u[i])
        y2, v2, z2 = slope(y + step_s / 2 * y1, v + step_s / 2 * v1, z + step_s / 2 * z1, u[i + 1])
        y3, v3, z3 = slope(y + step_s / 2 * y2, v + step_s / 2 * v2, z + step_s / 2 * z2, u[i + 1])
        y4, v4, z4 = slope(y + step_s * y3, v + step_s * v3, z + step_s * z3, u[i + 2])
        y += step_s / 6 * (y1 + 2 * y2 + 2 * y3 + y4)
        v += step_s / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
        z += step_s / 6 * (z1 + 2 * z2 + 2 * z3 + z4)
        found.append(y)
    return np.array(found)


def multisine(samples, seed):
    """A random-phase multisine of 50 N rms, 5 to 150 Hz, over one period of ``samples`` at the record's rate."""
    rng = np.random.Generator(np.random.Philox(seed))
    f = np.fft.rfftfreq(samples, 1 / RATE_HZ)
    drive = np.fft.irfft(np.where((f >= 5) & (f <= 150), np.exp(2j * pi * rng.random(f.size)), 0.0))
    return 50.0 * drive / drive.std()


def fine_multisine(samples, times, seed):
    spectrum = np.fft.rfft(multisine(samples, seed))
    return np.fft.irfft(spectrum, samples * times) * times


def predicted(fit, drive, step_s):
    run = FitRecord("unseen", drive[:, None].copy(), np.zeros((drive.size, 1)), step_s, 1, 0, np.zeros((drive.size, 0)))
    return simulate_record(mirror.discretise(fit.mirror, step_s), run)[:, 0]


@pytest.fixture(scope="module")
def benchmark():
    return fit_records([read_benchmark()], factor=FINE, hold="band-limited")


def read_benchmark():
    return read_recording(BENCHMARK, "multisine/u", "multisine/y", RATE_HZ, period_samples=8192)


@needs_benchmark
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.endurance)])
def test_the_benchmark_is_fitted_to_its_noise_and_predicts_what_it_has_not_seen(benchmark, seed):
    """From starts off by ± 30 %; the noise is what differs between periods that share their drive."""
    factors = 1 + 0.3 * np.random.Generator(np.random.Philox(seed)).choice([-1.0, 1.0], 6)
    fit = fit_plant(started(factors), benchmark)

    record = read_benchmark()
    periods = record.output[:, 0].reshape(5, 8192)
    noise = np.sqrt(np.mean((periods - periods.mean(axis=0)) ** 2) * 5 / 4)
    modelled = periods[1:].mean(axis=0) - fit.residuals[0][:, 0]
    left = np.sqrt(np.mean((periods[1:] - modelled - np.mean(periods[1:] - modelled)) ** 2))
    assert 7.2e-6 < noise < 7.6e-6
    assert 0.97 * noise < left < 1.003 * noise
    assert_allclose(fit.values, PUBLISHED, rtol=0.01)
    assert np.all(np.abs(fit.values - PUBLISHED) < 4 * fit.standard_errors)

    twice = 2 * FINE
    unseen = fine_multisine(2048, twice, seed=77)
    step = 1 / RATE_HZ / FINE
    oracle = runge_kutta(np.append(unseen, unseen[0]), step)[:-1]
    error = oracle - predicted(fit, unseen[::2], step)
    assert 1e-8 < np.sqrt(np.mean(error**2)) <= 1e-6
    assert np.sqrt(np.mean(oracle**2)) > 5e-4

    time = np.arange(2 * 30_000 + 1) * step / 2
    sweep = 40.0 * np.sin(2 * pi * (20.0 * time + 30.0 / time[-1] * time**2 / 2))
    oracle = runge_kutta(sweep, step)
    error = oracle - predicted(fit, sweep[::2], step)
    assert 1e-8 < np.sqrt(np.mean(error**2)) <= 1e-6
    assert np.sqrt(np.mean(oracle**2)) > 3e-4


def test_the_oracle_has_converged():
    drive = fine_multisine(512, 8 * FINE, seed=3)
    step = 1 / RATE_HZ / FINE
    coarse = runge_kutta(drive[::4], step)
    fine = runge_kutta(drive, step / 4)[::4][: coarse.size]
    assert 1e-12 < np.sqrt(np.mean((coarse - fine) ** 2)) < 3e-8


# ------------------------------------------------------------------------------------------------- a small problem
def low_pass(seed=0, noise=1e-3, samples=2000):
    """A mass on a linear spring, recorded with noise; slope 0 leaves no hysteresis."""
    rng = np.random.Generator(np.random.Philox(seed))
    drive = np.cumsum(rng.standard_normal(samples)) * 0.3
    drive -= drive[0]
    truth = hysteretic_oscillator(2.0, 300.0, 5e4, 2e4, 300.0, 100.0)
    run = FitRecord("", drive[:, None].copy(), np.zeros((samples, 1)), 1e-3, 1, 0, np.zeros((samples, 0)))
    plant = mirror.discretise(truth.build(np.array([p.start for p in truth.parameters])), 1e-3)
    output = simulate_record(plant, run)[:, 0]
    return recording_from_arrays(drive, output + 5.0 + noise * output.std() * rng.standard_normal(samples), 1000.0)


def test_standard_errors_match_the_scatter():
    truth = np.array([2.0, 300.0, 5e4, 2e4, 300.0, 100.0])
    structure = hysteretic_oscillator(*(1.1 * truth).tolist())
    fits = [fit_plant(structure, fit_records([low_pass(seed, 0.01)], drop=20)) for seed in range(8)]
    scatter = (np.array([f.values for f in fits]) - truth) / np.array([f.standard_errors for f in fits])
    assert 0.5 < np.sqrt(np.mean(scatter**2)) < 1.6
    assert all(f.agreeing_starts == 1 for f in fits)


def test_the_offset_of_a_sensor_is_no_parameter_and_drops_out():
    structure = hysteretic_oscillator(2.2, 270.0, 5.5e4, 1.8e4, 330.0, 90.0)
    with_offset = fit_plant(structure, fit_records([low_pass(1, 0.0)]))
    assert_allclose(with_offset.values, [2.0, 300.0, 5e4, 2e4, 300.0, 100.0], rtol=1e-4)
    held = fit_plant(structure, fit_records([low_pass(1, 0.0)], offset=False))
    assert np.max(np.abs(held.values / with_offset.values - 1)) > 0.01


@pytest.mark.promise("identify-50")
def test_a_structure_of_two_drives_and_two_outputs_is_fitted():
    """Two actuators behind plays of their own, each of which turns the mirror about both axes."""
    truth, thresholds = np.array([3e-5, 2e-5, 5e-6, -4e-6]), (0.5, 0.9)

    def build(values):
        return Mirror(
            name="two axes",
            A=np.zeros((0, 0)),
            B=np.zeros((0, 2)),
            E=np.zeros((0, 2)),
            F=np.zeros((2, 0)),
            G=np.eye(2),
            C=np.zeros((2, 0)),
            D=np.zeros((2, 2)),
            K=np.array([[values[0], values[2]], [values[3], values[1]]]),
            bouc_wen=(),
            plays=tuple(PrandtlIshlinskii((0.0, r), (1.0, 0.3)) for r in thresholds),
            inverse=(),
        )

    names = ("x", "y", "x from y", "y from x")
    structure = Structure("two axes", tuple(map(Parameter, names, ("rad/V",) * 4, 1.2 * truth)), build)
    drive = np.column_stack([two_sines(1200), two_sines(1200, freq_hz=3.1)]) - 5.0
    run = FitRecord("", drive.copy(), np.zeros((1200, 2)), 1e-3, 1, 0, np.zeros((1200, 0)))
    output = simulate_record(mirror.discretise(build(truth), 1e-3), run)
    output = output + 1e-7 * np.random.Generator(np.random.Philox(6)).standard_normal(output.shape)
    fit = fit_plant(structure, fit_records([recording_from_arrays(drive, output, 1000.0)]))
    assert np.max(np.abs(fit.values - truth) / fit.standard_errors) < 4.0
    assert np.max(fit.standard_errors / np.abs(truth)) < 0.01


def test_what_is_not_identified_is_named():
    """Two parameters that only appear as a sum."""
    base = hysteretic_oscillator(2.0, 300.0, 5e4, 2e4, 300.0, 100.0)

    def build(values):
        return base.build(np.array([*values[:2], values[2] + values[6], *values[3:6]]))

    twins = Structure("twins", (*base.parameters, Parameter("second stiffness", "N/m", 1e3)), build)
    fit = fit_plant(twins, fit_records([low_pass(2)]))
    named = dict(fit.not_identified)
    assert "second stiffness" in named
    assert fit.condition_number > 1e5
    single = fit_plant(base, fit_records([low_pass(2)]))
    assert "mass" not in dict(single.not_identified)
    assert single.condition_number < 1e3


def test_several_starts_are_counted():
    structure = hysteretic_oscillator(2.0, 300.0, 5e4, 2e4, 300.0, 100.0)
    near = np.array([2.1, 290.0, 5.2e4, 1.9e4, 320.0, 90.0])
    calls = []
    fit = fit_plant(
        structure, fit_records([low_pass(3)]), starts=[near, 1.05 * near], on_progress=lambda *a: calls.append(a)
    )
    assert len(fit.start_costs) == 3
    assert fit.agreeing_starts == 3
    assert [c[:2] for c in calls] == [(1, 3), (2, 3), (3, 3)]


def test_a_start_that_cannot_be_simulated_is_refused():
    structure = hysteretic_oscillator(1e-9, 1.0, 5e4, 5e9, 300.0, 100.0)
    frozen = Structure(
        structure.name,
        tuple(Parameter(p.name, p.unit, p.start) for p in structure.parameters[:0]),
        lambda _: structure.build(np.array([p.start for p in structure.parameters])),
    )
    with pytest.raises(
        IdentificationError, match=r"cannot be simulated from any start at a step of 0\.001 s; begin nearer"
    ):
        fit_plant(
            Structure("stiff", structure.parameters, lambda _: frozen.build(np.zeros(0))), fit_records([low_pass(4)])
        )


def test_what_a_search_sees_has_the_gradient_and_the_curvature_of_the_residual():
    problem = PlantProblem(hysteretic_oscillator(2.0, 300.0, 5e4, 2e4, 300.0, 100.0), fit_records([low_pass(3)]))
    point = np.array([1.1, 0.9, 1.05, 0.95, 1.0, 1.1])
    residual = problem.modelled(point) - problem.measured
    steps = 1e-5 * np.eye(6)
    columns = [(problem.modelled(point + s) - problem.modelled(point - s)) / 2e-5 for s in steps]
    seen, slopes = problem.residual(point), problem.slopes(point, central=True)
    assert seen @ seen == pytest.approx(residual @ residual, rel=1e-12)
    assert_allclose(slopes.T @ seen, np.array(columns) @ residual, rtol=1e-9)
    assert_allclose(slopes.T @ slopes, np.array(columns) @ np.array(columns).T, rtol=1e-9)
    rough = problem.slopes(point, central=False)
    assert 1e-9 < np.max(np.abs(np.linalg.norm(rough, axis=0) / np.linalg.norm(slopes, axis=0) - 1)) < 1e-3


def test_a_slope_that_is_no_number_is_refused_and_no_fault_of_the_program():
    problem = PlantProblem(hysteretic_oscillator(2.0, 300.0, 5e4, 2e4, 300.0, 100.0), fit_records([low_pass(3)]))
    slopes = np.ones((20, 6))
    assert np.isfinite(_covariance([slopes[:5], slopes[5:]], np.eye(6), problem)[0]).all()
    slopes[:, 2] = 0.0
    errors = np.sqrt(np.diag(_covariance([slopes], np.diag(np.sum(slopes**2, axis=0)), problem)[0]))
    assert errors[2] == 1e3 * problem.scale[2]  # nothing is known of what nothing depends on
    slopes[3, 2] = 1e200
    with np.errstate(over="ignore", invalid="ignore"):
        assert not _scatter(problem, [np.column_stack([np.ones(20), slopes])]).any()
    with pytest.raises(IdentificationError, match="nothing can be said of their errors; record loops over the whole"):
        _covariance([slopes[:5], slopes[5:]], np.eye(6), problem)


def test_nothing_left_to_fit_is_refused():
    with pytest.raises(IdentificationError, match="2000 samples, of which the first 2000 are left out"):
        fit_records([low_pass(0)], drop=2000)


@pytest.mark.parametrize("hold", ["linear", "band-limited"])
def test_a_drive_between_its_samples(hold):
    coarse = np.sin(2 * pi * np.arange(16) / 16)[:, None]
    fine = upsampled(coarse, 4, hold)[:, 0]
    assert_allclose(fine[4], coarse[1, 0], atol=1e-12)
    expected = {
        "linear": (coarse[0, 0] + coarse[1, 0]) / 2,
        "band-limited": np.sin(pi / 16),
    }
    assert_allclose(fine[2], expected[hold], atol=1e-12)


def test_what_is_at_its_bound_is_held_until_it_would_gain_by_leaving():
    """Two of three weights begin at 0: the one that the record needs comes up, the other stays there exactly."""
    drive = two_sines(1200)
    record = recorded(drive, plays(drive, (0.0, 1.0), (6e-5, 2e-5)), noise=1e-4)
    structure = one_axis("m", PrandtlIshlinskii((0.0, 1.0, 2.0), (8e-5, 0.0, 0.0), 0.0, 100.0))
    (run,) = fit_records([replace(record, output=1e-3 * record.output)])
    fit = fit_plant(structure, [run])
    assert fit.converged
    assert fit.values[:2] == pytest.approx([6e-5, 2e-5], rel=0.01)
    assert 0.0 <= fit.values[2] < 3 * fit.standard_errors[2]
    below = fit_plant(one_axis("m", PrandtlIshlinskii((0.0, 1.0, 2.0), (6e-5, 2e-5, 0.0), 0.0, 100.0)), [_less(run)])
    assert below.values[2] == 0.0  # it would be negative


def _less(run):
    """The record less a play of 2 V, so that its weight would be below 0."""
    less = plays(run.drive[:, 0] + 5.0, (2.0,), (1e-5,))[:, None]
    return replace(run, output=run.output - less)


PERIOD = 8


def repeated(periods, more=0, period=PERIOD):
    """A ramp drive of some periods, the output another one in each of them."""
    drive = np.tile(np.arange(PERIOD, dtype=float), periods + 1)[: periods * PERIOD + more]
    output = drive + 10.0 * np.floor(np.arange(drive.size) / PERIOD)
    return recording_of(drive, output, period)


def recording_of(drive, output, period):
    return Recording("made up", "", drive[:, None], output[:, None], 100.0, ("u",), ("y",), period)


@pytest.mark.parametrize(
    ("periods", "more", "period", "repeats"),
    [
        (2, 0, PERIOD, True),
        (3, 5, PERIOD, True),
        (1, PERIOD - 1, PERIOD, False),
        (3, 0, None, False),
        (3, 0, PERIOD - 1, False),
    ],
)
@pytest.mark.parametrize("hold", ["band-limited", "linear"])
def test_of_a_drive_that_repeats_itself_the_mean_period_behind_the_first_is_fitted(
    periods, more, period, repeats, hold
):
    recording = repeated(periods, more, period)
    (made,) = fit_records([recording], factor=4, hold=hold, drop=3, offset=True)
    if not repeats:
        from_rest = replace(recording, drive=recording.drive + 5.0)  # the first value is where it rests
        assert_allclose(fit_records([from_rest], factor=4, hold=hold)[0].drive, made.drive, atol=1e-12)
        assert (made.first, len(made.output)) == (3, recording.samples)
        assert made.nuisance.shape == (recording.samples - 3, 1)
        return
    assert (made.first, made.output.shape, made.drive.shape[0]) == (PERIOD, (2 * PERIOD, 1), 2 * PERIOD * 4)
    middle = 10.0 * np.mean(np.arange(1, periods))  # of the periods behind the first one
    assert_allclose(made.output[PERIOD:, 0], np.arange(PERIOD) + middle)
    assert_allclose(made.drive[: PERIOD * 4], made.drive[PERIOD * 4 :])
    if hold == "linear":  # back to 0 V at the next period
        assert_allclose(made.drive[::4, 0], np.tile(np.arange(PERIOD), 2))
        assert_allclose(made.drive[PERIOD * 4 - 4 : PERIOD * 4].ravel(), [7.0, 5.25, 3.5, 1.75])
    assert_allclose(made.nuisance, 1.0 / np.sqrt(PERIOD))


@pytest.mark.parametrize(("off", "repeats"), [(0.0, True), (5e-6, True), (9e-6, False)])
def test_a_drive_repeats_itself_to_a_millionth_of_its_largest(off, repeats):
    recording = repeated(2)
    drive = recording.drive.copy()
    drive[PERIOD + 3] += off  # of at most 7
    (made,) = fit_records([recording_of(drive[:, 0], recording.output[:, 0], PERIOD)])
    assert (made.first == PERIOD) is repeats


@pytest.mark.parametrize(("drop", "left"), [(13, True), (14, True), (15, False), (16, False)])
def test_a_recording_of_which_all_but_one_sample_is_left_out_is_refused(drop, left):
    recording = repeated(2, period=None)
    if left:
        assert len(fit_records([recording], drop=drop)[0].nuisance) == 16 - drop
    else:
        with pytest.raises(
            IdentificationError, match=f"16 samples, of which the first {drop} are left out: nothing is"
        ):
            fit_records([recording], drop=drop)


MODEL = BoucWen(3e-5, 1e-6, -2e-5, -2e-6, 0.5, 0.2, 400.0, 6.0, 0.1, -0.05, 2.0)
RATES = ("d2", "delta")
SHAPES = ("gamma", "eta", "exponent")


@pytest.mark.parametrize("free", [(), RATES, SHAPES, RATES + SHAPES])
@pytest.mark.parametrize("admissible", [False, True])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_model_is_what_its_parameters_make_of_it_whatever_is_free(free, admissible, sign):
    """What is not free stays; what is free moves by itself, and ratios to alpha go with it."""
    model = replace(MODEL, d1_rad_v=sign * 3e-5, epsilon_rad_v=sign * -2e-5)
    parameters, make = structures._bouc_wen_part(model, free, admissible)
    assert [p.name.split()[0] for p in parameters] == ["d1", "epsilon", "alpha", "beta", *free]
    values = np.array([p.start for p in parameters])
    if not admissible:
        assert parameters[1].scale == 2e-5  # the size of a slope does not hang on its sign
        again = make(values)
        assert_allclose(astuple(again), astuple(model), rtol=1e-12)
    assert all(p.lower <= p.start <= p.upper for p in parameters)
    values[2] *= 2.0
    moved = make(values)
    assert moved.alpha_1_v == pytest.approx(1.0) and moved.beta_1_v == pytest.approx(0.4)
    for name in ("gamma", "eta"):
        kept = getattr(model, f"{name}_1_v")
        assert getattr(moved, f"{name}_1_v") == pytest.approx(kept * (2.0 if name in free else 1.0))
    assert (moved.d2_s_v, moved.delta_s_v, moved.exponent) == (model.d2_s_v, model.delta_s_v, model.exponent)


@pytest.mark.parametrize(("limit_v_s", "most"), [(400.0, 1.0 / 400.0), (np.inf, 1.0)])
def test_what_depends_on_the_rate_is_searched_as_far_as_the_fastest_drive_shows_it(limit_v_s, most):
    parameters, _ = structures._bouc_wen_part(replace(MODEL, rate_limit_v_s=limit_v_s), RATES, False)
    d2, delta = parameters[-2:]
    assert (d2.lower, d2.upper) == pytest.approx((-most, most))
    assert (delta.lower, delta.upper) == pytest.approx((-3.0 * most, 10.0 * most))


# ------------------------------------------------------------------------------------------ numbers unlike each other
def test_the_oscillator_is_built_of_its_numbers_each_in_its_place():
    structure = hysteretic_oscillator(2.0, 10.0, 300.0, 70.0, 8.0, -11.0)
    assert [(p.name, p.unit, p.start, p.lower, p.upper) for p in structure.parameters] == [
        ("mass", "kg", 2.0, 0.1, np.inf),
        ("damping", "N s/m", 10.0, 0.0, np.inf),
        ("stiffness", "N/m", 300.0, 0.0, np.inf),
        ("slope", "N/m", 70.0, -np.inf, np.inf),
        ("decay", "1/m", 8.0, 0.0, np.inf),
        ("asymmetry", "1/m", -11.0, -np.inf, np.inf),
    ]
    plant = structure.build(np.array([4.0, 6.0, 100.0, 71.0, 9.0, -12.0]))
    assert (plant.name, structure.name) == ("hysteretic oscillator", "hysteretic oscillator")
    assert (plant.A.tolist(), plant.B.tolist()) == ([[0.0, 1.0], [-25.0, -1.5]], [[0.0], [0.25]])
    assert (plant.E.tolist(), plant.F.tolist(), plant.C.tolist()) == ([[0.0], [-0.25]], [[1.0, 0.0]], [[1.0, 0.0]])
    assert [m.tolist() for m in (plant.G, plant.D, plant.K)] == [[[0.0]]] * 3
    assert plant.bouc_wen == (BoucWen(0.0, 0.0, 71.0, 0.0, 9.0, -12.0),) and (plant.plays, plant.inverse) == ((), ())


LINEAR = LinearPoles(Roots((80.0, 30.0), (0.2, 1.0)), Roots((60.0, 45.0), (-0.4, -1.0)), 3.0, 2e-3, 1e-4)


def test_every_pole_zero_and_the_delay_is_searched_by_its_own_number():
    parameters, make = structures._linear_part(LINEAR, True)
    found = [(p.name, p.unit, p.start, p.lower, p.upper, p.scale) for p in parameters]
    fastest = 1 / (2 * pi * 80.0)
    assert found == [
        ("pole 1", "Hz", 80.0, 4.0, 1600.0, 80.0),
        ("pole 1 damping", "", 0.2, 1e-4, 0.9999, pytest.approx(0.02)),
        ("pole 2", "Hz", 30.0, 1.5, 600.0, 30.0),
        ("zero 1", "Hz", 60.0, 3.0, 1200.0, 60.0),
        ("zero 1 damping", "", -0.4, -0.9999, 0.9999, pytest.approx(0.04)),
        ("zero 2", "Hz", 45.0, 2.25, 900.0, 45.0),
        ("delay", "s", 2e-3, pytest.approx(1.6e-3), pytest.approx(2.4e-3), pytest.approx(fastest)),
    ]
    made = make(np.array([81.0, 0.21, 31.0, 61.0, -0.41, 46.0, 2.1e-3]))
    assert made == replace(
        LINEAR, poles=Roots((81.0, 31.0), (0.21, 1.0)), zeros=Roots((61.0, 46.0), (-0.41, -1.0)), delay_s=2.1e-3
    )
    assert structures._linear_part(LINEAR, False)[1](None) is LINEAR
    assert structures._linear_part(None, True)[0] == () and structures._linear_part(None, True)[1](None) is None


@pytest.mark.parametrize(
    ("delay_s", "error_s", "reach"),
    [
        (0.0, np.inf, 10 / (2 * pi * 80.0)),
        (-5e-3, np.inf, 0.05),
        (1e-3, 1e-2, 10 / (2 * pi * 80.0)),
        (1e-3, 1e-5, 4e-5),
    ],
)
def test_a_delay_is_searched_ten_times_its_size_or_four_of_its_errors_far(delay_s, error_s, reach):
    found = structures._linear_part(replace(LINEAR, delay_s=delay_s, delay_error_s=error_s), True)[0][-1]
    assert (found.lower, found.upper) == pytest.approx((delay_s - reach, delay_s + reach))


def test_roots_are_told_by_frequency_and_damping_from_slow_to_fast():
    roots = Roots.of(2 * pi * np.array([-3 + 4j, -3 - 4j, -2.0, 7.0, 1 + 10j, 1 - 10j, 6j, -6j]))
    assert roots.frequencies_hz == pytest.approx((2.0, 5.0, 6.0, 7.0, np.sqrt(101)))
    assert roots.dampings == pytest.approx((1.0, 0.6, 0.0, -1.0, -1 / np.sqrt(101)))
    assert roots.without(1, 3) == Roots(
        (roots.frequencies_hz[0], *roots.frequencies_hz[2::2]), (1.0, *roots.dampings[2::2])
    )
    assert_allclose(np.sort_complex(Roots((5.0, 2.0), (0.6, 1.0)).values), 2 * pi * np.array([-3 - 4j, -3 + 4j, -2.0]))


def test_an_axis_is_made_of_the_parts_of_its_values_and_lags_stand_beside_it():
    plays_of = PrandtlIshlinskii((0.0, 1.5, 4.0), (-5e-5, -2e-5, -1e-5), 2e-3, 250.0)
    lags = Creep((-1e-6, 3e-9), (0.1, 2.5))
    proper = replace(LINEAR, zeros=Roots((60.0,), (-0.4,)))
    axis = one_axis("own", plays_of, linear=proper, creep=lags, free=("widening",), free_linear=True)
    assert [p.name for p in axis.parameters[3:7]] == ["widening", "creep at 0.1 s", "creep at 2.5 s", "pole 1"]
    assert [(p.unit, p.start, p.linear) for p in axis.parameters[4:6]] == [
        ("rad/V", -1e-6, True),
        ("rad/V", 3e-9, True),
    ]
    assert [p.scale for p in axis.parameters[4:6]] == pytest.approx([1e-6, 8e-8])
    values = np.array([-6e-5, 0.0, -3e-5, 4e-3, -2e-6, 0.0, 81.0, 0.21, 31.0, 61.0, -0.41, 7e-4])
    made = axis.parts(values)
    assert made.model == PrandtlIshlinskii((0.0, 1.5, 4.0), (-6e-5, 0.0, -3e-5), 4e-3, 250.0)
    assert made.creep == Creep((-2e-6, 0.0), (0.1, 2.5))
    assert (made.linear.poles.frequencies_hz, made.linear.delay_s, axis.late(values)) == ((81.0, 31.0), 7e-4, 7e-4)
    built = axis.build(values)
    assert built.plays == (PrandtlIshlinskii((0.0, 4.0), (-6e-5, -3e-5), 4e-3, 250.0),)
    assert [number for number, _ in axis.beside] == [4, 5]
    assert_allclose([lag.A[0, 0] for _, lag in axis.beside], [-10.0, -0.4])
    again = pickle.loads(pickle.dumps(axis))
    assert [p.name for p in again.parameters] == [p.name for p in axis.parameters] and again.name == "own"
    assert again.parts(values) == made
    static = one_axis("static", plays_of)
    assert static.late(np.zeros(3)) == 0.0 and static.build(np.array([-1e-5, 0.0, 0.0])).A.size == 0
    assert len(static.parameters) == 3 and static.parts(np.array([-1e-5, -2e-5, 0.0])).model.widening_s == 2e-3


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_admissible_model_takes_the_share_of_its_limit_that_is_searched(sign):
    """d1 = 30, and behind a reversal epsilon counts 2 alpha / k_settled times."""
    model = BoucWen(sign * 3e-5, 0.0, sign * -1e-5, 0.0, 0.5, 0.2)
    parameters, make = structures._bouc_wen_part(model, (), True)
    share = parameters[1]
    assert (share.name, share.lower, share.upper, share.scale) == ("epsilon over its limit", -10.0, 1.0, 0.1)
    assert share.start == pytest.approx(min(1e-5 * model.reversal_swing / 3e-5, 0.95))
    assert [p.linear for p in parameters] == [False] * 4
    edge = make(np.array([sign * 4e-5, 1.0, 0.5, 0.4]))
    assert made_rising(edge).reversal_slope_rad_v() == pytest.approx(0.0, abs=1e-18)
    inside = make(np.array([sign * 4e-5, 0.25, 0.5, 0.4]))
    assert made_rising(inside).reversal_slope_rad_v() == pytest.approx(3e-5)
    assert structures._bouc_wen_part(replace(model, epsilon_rad_v=sign * -9e-5), (), True)[0][1].start == 0.95


def test_parameters_of_a_bouc_wen_model_have_their_bounds_and_sizes():
    parameters, _ = structures._bouc_wen_part(MODEL, RATES + SHAPES, False)
    assert [(p.name, p.unit, p.start, p.lower, p.upper, p.scale, p.linear) for p in parameters] == [
        ("d1", "rad/V", 3e-5, -np.inf, np.inf, 3e-5, True),
        ("epsilon", "rad/V", -2e-5, -np.inf, np.inf, 2e-5, False),
        ("alpha", "1/V", 0.5, 5e-4, 15.0, 0.5, False),
        ("beta over alpha", "", 0.4, -0.999, 0.999, 0.1, False),
        ("d2", "s/V", 1e-6, -1 / 400, 1 / 400, pytest.approx(0.01 / 400), False),
        ("delta", "s/V", -2e-6, pytest.approx(-3 / 400), pytest.approx(10 / 400), pytest.approx(0.1 / 400), False),
        ("gamma over alpha", "", 0.2, -0.999, 0.999, 0.1, False),
        ("eta over alpha", "", -0.1, -0.999, 0.999, 0.1, False),
        ("exponent", "", 2.0, 1.0, 10.0, 10.0, False),
    ]


def test_why_numbers_are_not_identified_is_told_of_each_with_its_unit():
    given = [
        Parameter("low", "V", 1.0, lower=0.5),
        Parameter("high", "", 1.0, upper=2.0),
        Parameter("zero", "rad/V", 1.0),
        Parameter("vague", "s", 1.0),
        Parameter("one", "s", 1.0),
        Parameter("other", "s", 1.0),
        Parameter("known", "s", 1.0),
    ]
    size = np.array([0.1, 0.1, 3.456, 1.5, 0.2, 0.3, 0.1])
    between = np.eye(7)
    between[4, 5] = between[5, 4] = -0.9876
    between[6, 0] = between[0, 6] = 0.94
    found = plant_fit._not_identified(
        Structure("s", tuple(given), None),
        np.array([0.5, 2.0, -3.0, -2.0, 5.0, 7.0, 9.0]),
        size[:, None] * between * size,
    )
    assert found == [
        ("low", "at its bound, 0.5 V"),
        ("high", "at its bound, 2"),
        ("zero", "not told from 0: standard error 3.5 rad/V"),
        ("vague", "relative standard error 75 %"),
        ("one", "correlation 0.988 with other"),
        ("other", "correlation 0.988 with one"),
    ]


@pytest.mark.parametrize("samples", [64, 65])
def test_the_scatter_of_white_noise_is_its_variance_times_the_columns_of_both_outputs(samples):
    """With no power but at one line the mean counts; of an even number of samples the last line counts once."""
    turn = np.arange(samples)[:, None, None]
    columns = np.concatenate([np.ones((samples, 2, 1)), np.where(turn % 2, 1.0, -1.0) * [[[2.0], [3.0]]]], axis=2)
    residual = philox(4).standard_normal((samples, 2, 1))
    rows = np.concatenate([residual, columns], axis=2).reshape(2 * samples, 3)
    found = plant_fit.coloured_scatter(rows, 2, np.zeros((samples, 0)), np.zeros((2, 2)))
    expected = np.zeros((2, 2))
    for k in range(2):
        lines = np.fft.rfft(residual[:, k, 0])
        power = np.abs(lines) ** 2
        own = np.fft.rfft(columns[:, k], axis=0)
        size = np.linalg.norm(columns[:, k], axis=0)
        worth = np.sum(np.abs(own / size) ** 2, axis=1)
        worth = worth + plant_fit._AS_GOOD_AS_NONE * worth.mean()
        twice = np.full(len(lines), 2.0)
        twice[0] = 1.0
        if samples == 64:
            twice[-1] = 1.0
        for n in range(len(lines)):
            half = max(plant_fit._LINES, n // 10)
            near = slice(max(n - half, 0), n + half + 1)
            mean = max(np.mean(power[near]), np.sum(worth[near] * power[near]) / np.sum(worth[near]))
            expected += twice[n] * mean * np.outer(own[n].conj(), own[n]).real / samples**2
    assert_allclose(found, expected, rtol=1e-9)


def test_a_run_of_several_steps_a_sample_is_late_by_both_delays_and_every_fourth_is_an_output():
    """Of a gain of 2: the drive, two steps and three later."""
    drive = np.sin(np.arange(400) / 40.0)[:, None] * np.linspace(0, 1, 400)[:, None] ** 2
    plant = mirror.discretise(mirror.assemble("gain", "static", None, PrandtlIshlinskii((0.0,), (2.0,))), 0.01)
    run = FitRecord("r", drive, np.zeros((100, 1)), 0.01, 4, 0, np.zeros((100, 0)), late_s=0.02)
    assert_allclose(simulate_record(plant, replace(run, late_s=0.0)), 2.0 * drive[::4], atol=1e-12)
    later = simulate_record(plant, run, delay_s=0.03)
    assert later.shape == (100, 1)
    assert_allclose(later[2:, 0], 2.0 * drive[3:395:4][: len(later) - 2, 0], atol=1e-9)


@pytest.mark.parametrize(
    ("poles", "zeros", "band_hz", "frequencies", "dampings", "left", "at_hz"),
    [
        ([-3, -500 + 2000j], [-4], (1.0, 400.0), [328.106321], [0.242535625], [], 5.72805657),
        ([-3, -500 + 2000j], [-4, -9e4], (1.0, 400.0), [328.106321], [0.242535625], [], 5.72805657),
        ([-3, -500 + 2000j], [-900], (1.0, 400.0), [0.477464829, 328.106321], [1.0, 0.242535625], [900], 5.72805657),
        ([-300, -800], [-900], (2.0, 30.0), [47.7464829, 127.323954], [1.0, 1.0], [900], np.sqrt(60.0)),
        ([-2 + 1j, -50 + 4000j], [-3, -1.5], (0.5, 300.0), [636.669506], [0.0124990236], [], 5.64211621),
        (
            [-50 + 40j, -700],
            [],
            (20.0, 90.0),
            [np.sqrt(4100) / (2 * pi), 350 / pi],
            [50 / np.sqrt(4100), 1.0],
            [],
            20.0,
        ),
    ],
    ids=["creep and its zero", "zero beyond", "pole alone", "real", "slow pair", "pair below"],
)
def test_slow_poles_with_as_many_slow_zeros_and_zeros_above_the_rate_are_left_out(
    poles, zeros, band_hz, frequencies, dampings, left, at_hz
):
    every = np.array([q for p in poles for q in ((p, np.conj(p)) if np.imag(p) else (p,))], dtype=complex)
    found = poles_of(lti.modal_from_roots(np.array(zeros, dtype=complex), every, 5.0), band_hz, 2000.0)
    assert found.poles.frequencies_hz == pytest.approx(frequencies, rel=1e-6)
    assert found.poles.dampings == pytest.approx(dampings, rel=1e-6)
    assert found.zeros.frequencies_hz == pytest.approx([each / (2 * np.pi) for each in left], rel=1e-6)
    assert found.zeros.dampings == (1.0,) * len(left)
    assert found.normalise_at_hz == pytest.approx(at_hz, rel=1e-6)
    assert (found.delay_s, found.delay_error_s) == (0.0, np.inf)


@pytest.mark.parametrize(
    ("places", "kept"),
    [((), [0, 1, 2]), ((0,), [1, 2]), ((2, 0), [1]), ((1,), [0, 2]), ((0, 1, 2), []), ((7,), [0, 1, 2])],
)
def test_roots_without_some_keep_each_frequency_with_its_damping(places, kept):
    roots = Roots((3.0, 5.0, 8.0), (0.1, 1.0, -0.4))
    assert roots.without(*places) == Roots(
        tuple((3.0, 5.0, 8.0)[k] for k in kept), tuple((0.1, 1.0, -0.4)[k] for k in kept)
    )


LEVELS = np.array([[0.0, 1.0], [2.0, 5.0], [1.0, -1.0], [3.0, 0.5]])
BETWEEN = {
    ("linear", 1): ("0 2 1", "1 5 -1"),
    ("linear", 2): ("0 1 2 1.5 1", "1 3 5 2 -1"),
    ("linear", 4): ("0 .5 1 1.5 2 1.75 1.5 1.25 1", "1 2 3 4 5 3.5 2 .5 -1"),
}


@pytest.mark.parametrize(("hold", "factor"), BETWEEN)
def test_a_drive_of_two_actuators_is_straight_between_its_samples(hold, factor):
    expected = [[float(v) for v in row.split()] for row in BETWEEN[hold, factor]]
    np.testing.assert_allclose(upsampled(LEVELS[:3], factor, hold).T, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("hold", "drive"),
    [
        ("linear", ["0 1 2 1.5 1 2 3 1.5", "1 3 5 2 -1 -.25 .5 .75"]),
        (
            "band-limited",
            [
                "0 .79289322 2 1.5 1 2.2071068 3 1.5",
                "1 3.6730970 5 2.2588835 -1 -.92309699 .5 .49111652",
            ],
        ),
    ],
)
@pytest.mark.parametrize("offset", [True, False])
def test_periods_of_two_actuators_become_two_of_the_drive_and_the_mean_of_those_behind_the_first(hold, drive, offset):
    """Three periods and a sample: the last sample belongs to none."""
    output = np.arange(26.0).reshape(13, 2) ** 1.5
    record = Recording("p", "", np.vstack([LEVELS] * 3 + [LEVELS[:1]]), output, 100.0, ("a", "b"), ("x", "y"), 4)
    (run,) = fit_records([record], factor=2, hold=hold, offset=offset, drop=3)
    one = np.array([[float(v) for v in row.split()] for row in drive]).T
    np.testing.assert_allclose(run.drive, np.vstack([one, one]), atol=1e-6)
    mean = (output[4:8] + output[8:12]) / 2
    np.testing.assert_allclose(run.output, np.vstack([np.zeros((4, 2)), mean]), rtol=1e-12)
    assert (run.name, run.step_s, run.stride, run.first, run.weight) == ("p", 0.005, 2, 4, 1.0)
    assert (run.hold, run.late_s, run.nuisance.shape) == ("first-order", 0.0, (4, int(offset)))
    np.testing.assert_allclose(run.target, mean - mean.mean(axis=0) * offset, atol=1e-12)


@pytest.mark.parametrize(("factor", "drop", "offset"), [(3, 2, True), (1, 0, False), (2, 5, True)])
def test_a_recording_without_a_period_begins_at_rest_at_its_first_drive_value(factor, drop, offset):
    drive, output = np.vstack([LEVELS, LEVELS[::-1]]), np.arange(16.0).reshape(8, 2) ** 1.5
    record = Recording("q", "", drive, output, 50.0, ("a", "b"), ("x", "y"))
    (run,) = fit_records([record], factor=factor, drop=drop, offset=offset)
    np.testing.assert_allclose(run.drive[::factor], drive - drive[0], atol=1e-12)
    np.testing.assert_allclose(run.drive[1], (drive[1] - drive[0]) / factor, atol=1e-12)
    assert len(run.drive) == 7 * factor + 1
    assert (run.step_s, run.stride, run.first) == (pytest.approx(0.02 / factor), factor, drop)
    used = output[drop:]
    np.testing.assert_allclose(run.target, used - used.mean(axis=0) * offset, atol=1e-12)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ([0.0, 5.0, 3.0], ["a: at its bound, 0 V"]),
        ([9.0, 5.0, 3.0], ["a: at its bound, 9 V"]),
        ([2.0, 5.0, 3.0], []),
        ([2.0, 0.9, 3.0], ["b: not told from 0: standard error 1"]),
        ([2.0, 1.9, 3.0], ["b: relative standard error 53 %"]),
        ([0.3, 5.0, 0.5], ["a: not told from 0: standard error 0.4 V", "c: not told from 0: standard error 0.6 1/s"]),
        ([0.7, 2.0, 1.1], ["a: relative standard error 57 %", "c: relative standard error 55 %"]),
    ],
)
def test_a_number_at_its_bound_or_with_a_large_error_is_told_with_its_unit(values, told):
    parameters = (Parameter("a", "V", 1.0, 0.0, 9.0), Parameter("b", "", 1.0), Parameter("c", "1/s", 1.0, -1.0))
    found = plant_fit._not_identified(
        Structure("s", parameters, lambda v: None), np.array(values), np.diag(np.array([0.4, 1.0, 0.6]) ** 2)
    )
    assert [f"{name}: {fact}" for name, fact in found] == told


@pytest.mark.parametrize("admissible", [False, True])
def test_an_operator_becomes_no_play_that_no_sample_sees_bend(admissible):
    alpha = structures._bouc_wen_part(MODEL, (), admissible)[0][2]
    assert (alpha.name, alpha.lower, alpha.upper) == ("alpha", pytest.approx(5e-4), pytest.approx(15.0))


@pytest.mark.parametrize("free_linear", [True, False])
@pytest.mark.parametrize("admissible", [True, False])
def test_an_axis_for_another_process_is_the_same_axis(free_linear, admissible):
    """What is free, what is held and what is bounded goes with it."""
    linear = LinearPoles(Roots((80.0, 30.0), (0.2, 1.0)), Roots((60.0,), (1.0,)), 3.0, 6e-4, 1e-4)
    words = {"linear": linear, "creep": Creep((1e-6, 2e-6), (0.1, 2.5)), "free": ("delta", "eta")}
    axis = structures.one_axis("own", MODEL, **words, free_linear=free_linear, admissible=admissible)
    again = pickle.loads(pickle.dumps(axis))
    assert again.parameters == axis.parameters and again.name == "own"
    assert len(axis.parameters) == 6 + 2 + 5 * free_linear
    assert (axis.parameters[1].name == "epsilon over its limit") is admissible
    values = np.array([1.01 * p.start for p in axis.parameters])
    assert again.parts(values) == axis.parts(values) and again.late(values) == axis.late(values)
    assert [number for number, _ in again.beside] == [6, 7]


def test_a_search_goes_on_from_the_best_of_its_starts_wherever_that_stands(monkeypatch):
    """Three starts of which the second is the best, on fewer samples first; steps are counted of the searches since."""
    asked = []

    def search(problem, start, tolerance, most, *, central):
        asked.append((problem.name, start.tolist(), tolerance, most, central))
        at = float(start[0])
        return SimpleNamespace(x=start + 0.5, cost=abs(at - 2.0), nfev=len(asked))

    made = []
    monkeypatch.setattr(plant_fit, "_search", search)
    monkeypatch.setattr(
        plant_fit,
        "PlantProblem",
        lambda structure, records: SimpleNamespace(name=records, scale=np.array([2.0]), size=10, far=1.0),
    )
    monkeypatch.setattr(plant_fit, "_report", lambda problem, best, costs: made.append((problem.name, best, costs)))
    structure = SimpleNamespace(parameters=[SimpleNamespace(start=10.0)], name="of one")
    told = []
    for screen in ("few", ()):
        asked.clear()
        plant_fit.fit_plant(
            structure,
            "all",
            screen=screen,
            starts=[np.array([5.0]), np.array([12.0])],
            tolerance=1e-11,
            most_evaluations=20,
            on_progress=lambda *args: told.append(args),
        )
        ending, first = (1e-5, "few") if screen else (1e-8, "all")
        assert asked[:3] == [(first, [at], ending, 20, False) for at in (5.0, 2.5, 6.0)]
        on = [("all", [3.0], 1e-8, 20, False), ("all", [3.5], 1e-11, 16, True)] if screen else []
        assert asked[3:] == (on or [("all", [3.0], 1e-11, 18, True)])
        name, best, costs = made.pop()
        assert (name, costs) == ("all", [3.0, 0.5, 4.0])
        assert best.nfev == (5 + 4 if screen else 4 + 2)
    assert told == [(1, 3, "of one"), (2, 3, "of one"), (3, 3, "of one")] * 2


def test_what_a_search_leaves_is_told_of_each_run_in_the_units_of_its_recording(monkeypatch):
    """Two runs of two outputs with weights of their own, and four starts of which two ended alike."""
    left = [philox(1).standard_normal((40, 2)) * [1.0, 3.0], np.cumsum(philox(2).standard_normal((30, 2)), axis=0)]
    targets = [5.0 + philox(k).standard_normal(part.shape) for k, part in enumerate(left)]
    runs = [SimpleNamespace(weight=w) for w in (2.0, 0.25)]
    rows = [np.column_stack([part.ravel(), np.full((part.size, 2), k + 1.0)]) for k, part in enumerate(left)]
    asked, cleared = [], []
    problem = SimpleNamespace(
        structure="structure",
        scale=np.array([10.0, 0.5]),
        runs=runs,
        targets=targets,
        edges=[80],
        modelled=lambda x: np.concatenate(
            [r.weight * (t - e).ravel() for r, t, e in zip(runs, targets, left, strict=True)]
        ),
        rows=lambda x, central: asked.append((x.tolist(), central)) or rows,
        simulated=SimpleNamespace(cache_clear=lambda: cleared.append(True)),
    )
    monkeypatch.setattr(plant_fit, "_scatter", lambda of, given: ("scatter", of is problem, given is rows))
    monkeypatch.setattr(plant_fit, "_covariance", lambda slopes, scatter, of: ((slopes, scatter), 123.0))
    monkeypatch.setattr(
        plant_fit, "_not_identified", lambda structure, values, covariance: [(structure, values.tolist())]
    )
    best = SimpleNamespace(x=np.array([0.3, 4.0]), nfev=17, status=0)
    fit = plant_fit._report(problem, best, [3.0, 1.0, 1.0009, 1.0011])
    assert fit.values.tolist() == [3.0, 2.0] and fit.not_identified == (("structure", [3.0, 2.0]),)
    for found, part in zip(fit.residuals, left, strict=True):
        assert_allclose(found, part, atol=1e-12)
    assert_allclose(fit.residual_rms, [np.sqrt(np.mean(part**2, axis=0)) for part in left])
    assert fit.colour_inflation == pytest.approx(colour_inflation(list(left[1].T)))  # what wanders has the more colour
    assert fit.colour_inflation > colour_inflation(list(left[0].T))
    (slopes, scatter), told = fit.covariance, asked
    assert [part[0].tolist() for part in slopes] == [[1.0, 1.0], [2.0, 2.0]] and scatter == ("scatter", True, True)
    assert told == [([0.3, 4.0], True)] and cleared == [True]
    assert (fit.condition_number, fit.start_costs, fit.agreeing_starts) == (123.0, (3.0, 1.0, 1.0009, 1.0011), 2)
    assert (fit.evaluations, fit.converged) == (17, False)


def problem_of(modelled, *, linear, lower, upper, beside=()):
    """A problem whose outputs are a function of its point, asked for nothing beyond the bounds."""
    asked = []
    problem = object.__new__(PlantProblem)
    problem.linear, problem.beside = np.array(linear), dict.fromkeys(beside)
    problem.lower, problem.upper, problem.scale = np.array(lower), np.array(upper), np.ones(len(linear))
    problem.structure = SimpleNamespace(late=lambda values: 1e-3 * float(values.sum()))
    problem.used_beside = lambda number, delay_s: np.array([number, delay_s, 7.0])
    problem.measured, problem.edges = np.array([1.0, 2.0, 4.0]), [2]

    def at(point):
        asked.append(point.copy())
        return modelled(point)

    problem.modelled = at
    return problem, asked


@pytest.mark.parametrize("central", [True, False])
def test_a_slope_at_either_bound_is_that_of_the_side_within(central):
    """The three numbers stand at the upper bound, at the lower one and in between; each acts with its square."""
    point = np.array([2.0, -3.0, 0.5])
    problem, asked = problem_of(
        lambda p: np.array([p[0] ** 2, 10.0 * p[1] ** 2, 100.0 * p[2] ** 2 + p[0]]),
        linear=[False] * 3,
        lower=[0.0, -3.0, 0.0],
        upper=[2.0, 5.0, 1.0],
    )
    step = plant_fit._DIFFERENCE
    inner = 100.0 * (0.0 if central else step)
    expected = [[4.0 - step, 0.0, 1.0], [0.0, 10.0 * (-6.0 + step), 0.0], [0.0, 0.0, 100.0 + inner]]
    first, second = problem.rows(point, central=central)
    found = np.vstack([first, second])
    assert_allclose(found[:, 0], problem.modelled(point) - problem.measured)
    assert_allclose(found[:, 1:], np.transpose(expected), atol=1e-8)
    assert first.shape == (2, 4) and second.shape == (1, 4)
    assert all((problem.lower <= p).all() and (p <= problem.upper).all() for p in asked)
    some = np.vstack(problem.rows(point, central=central, free=[2, 0]))
    assert_allclose(some[:, 1:], found[:, [3, 1]])


def test_a_slope_near_a_bound_is_taken_as_far_as_that_to_one_side():
    step = plant_fit._DIFFERENCE
    problem, asked = problem_of(
        lambda p: np.array([p[0] ** 2, p[1] ** 2, 0.0]),
        linear=[False, False],
        lower=[-9.0, -1.0],
        upper=[1.0, 9.0],
    )
    found = np.vstack(problem.rows(np.array([1.0 - step / 4, -1.0 + step / 4]), central=True))
    # of steps of 1/4 and 1: the slope of a square in the middle between both ends, 3/8 of a step away
    assert_allclose(found[0, 1], 2.0 * (1.0 - step / 4 - 3 * step / 8), atol=1e-9)
    assert_allclose(found[1, 2], -2.0 * (1.0 - step / 4 - 3 * step / 8), atol=1e-9)
    assert max(p[0] for p in asked) <= 1.0 and min(p[1] for p in asked) >= -1.0


def test_of_several_numbers_in_which_the_output_is_linear_each_is_simulated_without_the_others():
    """One alone is simulated from where it is; what stands beside the rest is not, and known for the point's delay."""
    point = np.array([2.0, 3.0, 4.0, 5.0])

    def asked_of(linear, beside):
        problem, asked = problem_of(
            lambda p: np.array([p[0] ** 2 + 3.0 * p[1], 5.0 * p[2] + p[1], p[0] * p[1]]),
            linear=linear,
            lower=[-9.0] * 4,
            upper=[9.0] * 4,
            beside=beside,
        )
        found = np.vstack(problem.rows(point, central=True))
        assert_allclose(found[:, 2:4], [[3.0, 0.0], [1.0, 5.0], [2.0, 0.0]], atol=1e-9)
        assert_allclose(found[:, 4], [3.0, 14e-3, 7.0] if beside else [0.0] * 3, atol=1e-12)
        return sorted(p.tolist() for p in asked if p[0] == 2.0 and p[1] in (0.0, 1.0, 3.0))

    whole, nothing = point.tolist(), [2.0, 0.0, 0.0, 0.0]
    each = [nothing, [2.0, 0.0, 1.0, 0.0], [2.0, 1.0, 0.0, 0.0], whole]
    assert asked_of([False, True, True, True], [3]) == each
    assert asked_of([False, True, True, True], []) == [nothing, [2.0, 0.0, 0.0, 1.0], *each[1:]]
    assert asked_of([False, False, True, True], [3]) == [whole, whole, [2.0, 3.0, 5.0, 5.0]]


def test_what_stands_at_either_bound_leaves_it_where_it_is_pulled_inward_and_gains_enough():
    """Pulls are 2, -2, 2 and -2 at lower, lower, upper and upper bound, and 2 in between; each is worth 2."""
    lower, upper = np.array([0.0, 0.0, -9.0, -9.0, 0.0, -1.0]), np.array([9.0, 9.0, 1.0, 1.0, 9.0, -0.5])
    point = np.array([5e-8, 0.0, 1.0, 1.0 - 5e-8, 4.0, -0.5])
    asked = []

    def slopes(at, *, central, free):
        asked.append((at is point, central, free))
        return np.diag([1.0, -1.0, 1.0, -1.0, 1e-200])

    problem = SimpleNamespace(lower=lower, upper=upper, slopes=slopes, residual=lambda at: np.full(5, -2.0))
    found = plant_fit._would_leave(problem, point, 1.99)
    assert found.tolist() == [True, False, False, True, False, False] and asked == [(True, False, [0, 1, 2, 3, 5])]
    assert not plant_fit._would_leave(problem, point, 2.01).any()
    free = SimpleNamespace(lower=np.full(2, -np.inf), upper=np.full(2, np.inf))
    assert plant_fit._would_leave(free, np.zeros(2), 0.0).tolist() == [False, False]


@pytest.mark.parametrize(
    ("start", "most", "rounds", "leaving", "points", "end", "evaluations"),
    [
        (  # all are at their bounds behind the first round, and then all are free
            [-3.0, 0.0, 7.0],
            100,
            [
                ([0.0, 0.0, 2.0], [1], 100, [1.0 - 3e-8], 8.0, 10),
                ([0.0, 1.0, 2.0], [0, 1, 2], 90, [2e-8, 0.5, 1.0], 6.0, 7),
                ([0.0, 0.5, 1.0], [0, 1, 2], 83, [0.5, 0.25, 1.5], 5.0, 3),
            ],
            [[False] * 3, [True, False, False], [False] * 3],
            [[0.0, 1.0, 2.0], [0.0, 0.5, 1.0], [0.5, 0.25, 1.5]],
            [0.5, 0.25, 1.5],
            20,
        ),
        (  # as many as are allowed
            [-3.0, 0.0, 7.0],
            10,
            [([0.0, 0.0, 2.0], [1], 10, [1.0 - 3e-8], 8.0, 10)],
            [[False] * 3],
            [[0.0, 1.0, 2.0]],
            [0.0, 1.0, 2.0],
            10,
        ),
        (  # what would not leave where it is not at its bound is told for nothing
            [0.0, 0.0, 1.0],
            50,
            [
                ([0.0, 0.0, 1.0], [1, 2], 50, [0.5, 1.5], 4.0, 1),
                ([0.0, 0.5, 1.5], [0, 1, 2], 49, [0.1, -5.0 + 2e-8, 1.5], 3.0, 2),
                ([0.1, -5.0, 1.5], [0, 2], 47, [0.2, 1.25], 2.0, 4),
            ],
            [[True, True, True], [True, False, True], [True, False, True]],
            [[0.0, 0.5, 1.5], [0.1, -5.0, 1.5], [0.2, -5.0, 1.25]],
            [0.2, -5.0, 1.25],
            7,
        ),
    ],
)
def test_a_search_puts_what_is_at_a_bound_there_and_goes_on_with_what_would_leave(
    monkeypatch, start, most, rounds, leaving, points, end, evaluations
):
    """Rounds of a search: where each begins, what is free in it, how many steps it may take, and where it ends."""
    problem = SimpleNamespace(lower=np.array([0.0, -5.0, -np.inf]), upper=np.array([np.inf, 1.0, 2.0]))
    asked, judged = [], []

    def searched(of, point, free, tolerance, left, *, central):
        assert of is problem and tolerance == 1e-3 and central is True
        *_, x, cost, nfev = rounds[len(asked)]
        asked.append((point.tolist(), free.tolist(), left))
        return SimpleNamespace(x=np.array(x), cost=cost, nfev=nfev)

    def would_leave(of, point, gain):
        judged.append((point.tolist(), gain))
        return np.array(leaving[len(judged) - 1])

    monkeypatch.setattr(plant_fit, "_search_free", searched)
    monkeypatch.setattr(plant_fit, "_would_leave", would_leave)
    found = plant_fit._search(problem, np.array(start), 1e-3, most, central=True)
    assert asked == [each[:3] for each in rounds]
    assert [point for point, _ in judged] == points
    assert [gain for _, gain in judged] == pytest.approx([1e-3 * each[4] for each in rounds])
    assert (found.x.tolist(), found.nfev) == (end, evaluations)


@pytest.mark.parametrize("samples", [25, 60, 61, 900])
def test_the_power_about_a_line_is_a_mean_over_a_tenth_of_its_number_and_thirty_lines_at_least(samples):
    """To either side, as far as there are any; each line counts by its worth, and by what the fit has left of it."""
    draw = philox(samples)
    residual = draw.standard_normal(samples) + 1j * draw.standard_normal(samples)
    left, worth = draw.uniform(0.1, 1.0, samples), draw.uniform(0.2, 3.0, samples)
    expected = []
    for k in range(samples):
        half = max(30, k // 10)
        near = slice(max(k - half, 0), k + half + 1)
        expected.append(np.sum(worth[near] * np.abs(residual[near]) ** 2) / np.sum(worth[near] * left[near]))
    assert_allclose(plant_fit._mean_power(residual, left, worth), expected, rtol=1e-9)


def test_what_a_fit_takes_out_of_a_run_counts_the_variances_of_all_runs(monkeypatch):
    """Two runs of unlike noise: T = 2 G - G J'VJ G / v of each; numbers of sizes far apart."""
    draw = philox(5)
    sizes = np.array([1.0, 1e4, 1e-3])
    jacobians = [draw.standard_normal((n, 3)) * sizes for n in (40, 30)]
    left = [0.5 * draw.standard_normal(40), 3.0 * draw.standard_normal(30)]
    rows = [np.column_stack([r, J]) for r, J in zip(left, jacobians, strict=True)]
    problem = SimpleNamespace(
        targets=[np.zeros((20, 2)), np.zeros((30, 1))], runs=[SimpleNamespace(nuisance=k) for k in ("one", "two")]
    )
    asked = []

    def scatter(part, outputs, nuisance, taken):
        asked.append((part, outputs, nuisance, taken))
        return np.full((3, 3), float(outputs))

    monkeypatch.setattr(plant_fit, "coloured_scatter", scatter)
    assert_allclose(_scatter(problem, rows), np.full((3, 3), 3.0))
    asked.sort(key=lambda each: each[2])
    assert [(each[0] is part, *each[1:3]) for each, part in zip(asked, rows, strict=True)] == [
        (True, 2, "one"),
        (True, 1, "two"),
    ]
    G = np.linalg.inv(sum((J / sizes).T @ (J / sizes) for J in jacobians))
    variances = [np.mean(r**2) for r in left]
    middle = sum(v * (J / sizes).T @ (J / sizes) for v, J in zip(variances, jacobians, strict=True))
    for v, (*_, taken) in zip(variances, asked, strict=True):
        assert_allclose(taken * np.outer(sizes, sizes), 2 * G - G @ middle @ G / v, rtol=1e-8, atol=1e-12)
