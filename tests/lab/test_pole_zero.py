"""The linear part of one axis: no pole more than the mirror has; delay, hold, creep and hysteresis are none of it."""

import itertools
import math
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import chirp, lsim

from microrad.lab.identify.hysteresis.joint import JointFit, fit_joint
from microrad.lab.identify.hysteresis.plant_fit import coloured_scatter, held
from microrad.lab.identify.hysteresis.structures import LinearPoles, Roots
from microrad.lab.identify.linear import axis, pole_zero
from microrad.lab.identify.linear.axis import fit_axis
from microrad.lab.identify.linear.fit import OrderScore
from microrad.lab.identify.linear.modal import late
from microrad.lab.identify.linear.pole_zero import PoleZero, PoleZeroProblem, Root
from microrad.lab.identify.linear.response import response_from_records
from microrad.lab.identify.records import Units
from microrad.lab.identify.selection.candidates import _fewer_poles, _without_spare_poles
from microrad.lab.recording import recording_from_arrays
from microrad.mirror import model as mirror
from microrad.mission.tables.fine_pointing import FinePointing
from truths import behind_resonance, creep, philox, plays, recorded, two_sines

NONE = np.zeros((0, 0))  # nothing of a record's own

RATE, FINE = 20_000.0, 4
GAIN = 8e-5


@pytest.mark.parametrize(("most", "marks"), [(9, None), (8, None), (4, [0, 2, 4, 6])])
def test_lines_are_merged_by_what_they_are_worth_where_there_are_more(most, marks):
    """Eight lines, of which every second one has twice the error: a quarter of the worth."""
    freq, error = np.geomspace(1.0, 128.0, 8), np.tile([0.1, 0.2], 4)
    values = freq * (1.0 + 0.5j)
    response = SimpleNamespace(
        freq_hz=freq,
        response=values[:, None, None],
        standard_error=error[:, None, None],
        drive_power=(2.0 + 0j) * np.arange(1.0, 9.0)[:, None, None],
    )
    found = pole_zero.merged(response, most)
    power = 2.0 * np.arange(1.0, 9.0)
    if marks is None:
        for one, other in zip(found, (freq, values, error, power), strict=True):
            assert_allclose(one, other, rtol=0)
        return
    worth = 1.0 / error**2
    total = np.add.reduceat(worth, marks)
    assert_allclose(found[0], np.add.reduceat(worth * freq, marks) / total)
    assert_allclose(found[1], np.add.reduceat(worth * values, marks) / total)
    assert_allclose(found[2], total**-0.5)
    assert_allclose(found[3], np.add.reduceat(power, marks))


def test_the_reason_of_an_order_names_the_next_best_where_there_is_one():
    of = [OrderScore(n, n, 10.0 * n, 100, c, 0.0) for n, c in ((1, 50.0), (2, 30.0), (3, 45.0))]
    assert axis._reason(of[1], of).endswith(
        "(1 is what a true model leaves; what no order explains counts as noise); order 3 is worse by 15"
    )
    assert axis._reason(of[1], of).startswith("order 2 has the least criterion, 30 (chi-square")
    assert axis._reason(of[1], of[1:2]).endswith(
        "by order: 2: 0.2 (1 is what a true model leaves; what no order explains counts as noise)"
    )


def swept(seconds=0.6, lowest=2.0, highest=2000.0, size=0.25):
    time = np.arange(round(seconds * RATE)) / RATE
    return 5.0 + size * chirp(time, lowest, seconds, highest, method="logarithmic", phi=-90)


def answer(drive, poles, *, between="first-order", delay_s=0.0, zeros=(), creeps=False, turned=None):
    """Output (rad) of poles and zeros (rad/s) with unit gain at rest, on a grid so fine that a delay is whole steps."""
    fine = np.arange((drive.size - 1) * FINE + 1) / FINE
    moved = drive - drive[0] if turned is None else turned(drive)
    moved = np.interp(fine, np.arange(drive.size), moved) if between == "first-order" else moved[fine.astype(int)]
    numerator, denominator = np.atleast_1d(np.real(np.poly(zeros))), np.real(np.poly(poles))
    system = (numerator * denominator[-1] / numerator[-1], denominator)
    output = GAIN * lsim(system, moved, fine / RATE, interp=between == "first-order")[1]
    if creeps:
        output += creep(moved, FINE * RATE, 10.0 ** np.arange(-1.75, 2.0, 0.5), 0.006 * GAIN)
    steps = round(delay_s * RATE * FINE)
    assert steps == pytest.approx(delay_s * RATE * FINE)
    return np.concatenate([np.zeros(steps), output[: output.size - steps]])[::FINE]


def measured(drive, output, noise=4e-4, name="chirp"):
    """Noise of 0.04 % of what the mirror moves for 10 V."""
    noisy = output + noise * 10 * GAIN * philox(3).standard_normal(output.size)
    return recording_from_arrays(drive, noisy, RATE, name)


def pair(natural_hz, damping):
    w = 2 * np.pi * natural_hz
    return [w * complex(-damping, s * np.sqrt(1 - damping**2)) for s in (1, -1)]


def found(fit):
    """Poles in Hz, of pairs the upper one, with their errors."""
    upper = fit.poles_rad_s.imag >= 0
    return fit.poles_rad_s[upper] / (2 * np.pi), fit.poles_error_rad_s[upper] / (2 * np.pi)


def assert_poles(fit, *poles):
    upper = [p / (2 * np.pi) for p in poles if p.imag >= 0]
    values, errors = found(fit)
    assert len(values) == len(upper), values
    for value, error in zip(values, errors, strict=True):
        nearest = min(upper, key=lambda p: abs(p - value))
        assert abs(value - nearest) < 4 * error
        assert error < 0.1 * abs(nearest)


# ------------------------------------------------------------------------------------------------------------- poles
@pytest.mark.promise("identify-7", "identify-14", "identify-17")
def test_a_resonance_with_creep_is_one_pair_of_poles():
    poles = pair(420.0, 0.025)
    drive = swept()
    record = measured(drive, answer(drive, poles, creeps=True))
    fit = fit_axis([record], hold="first-order")
    assert_poles(fit, *poles)
    assert fit.zeros_rad_s.size == 0
    assert abs(fit.delay_s) < 4 * fit.delay_error_s < 4e-6


@pytest.mark.promise("identify-7", "identify-12", "identify-13", "identify-17")
@pytest.mark.parametrize("between", ["zero-order", pytest.param("first-order", marks=pytest.mark.endurance)])
def test_a_delay_is_no_pole_and_the_hold_is_the_one_that_was_named(between):
    poles = pair(1200.0, 0.4)
    drive = swept(highest=2500.0)
    record = measured(drive, answer(drive, poles, between=between, delay_s=0.625e-4))
    fit = fit_axis([record], hold=between)
    assert_poles(fit, *poles)
    assert abs(fit.delay_s - 0.625e-4) < 4 * fit.delay_error_s < 4e-6
    other = fit_axis([record], hold="first-order" if between == "zero-order" else "zero-order")
    assert min(s.criterion for s in other.scan) > min(s.criterion for s in fit.scan) + 4.0


@pytest.mark.promise("identify-16")
def test_the_scan_ends_where_three_orders_in_a_row_gain_nothing():
    drive, told = swept(), []
    fit = fit_axis(
        [measured(drive, answer(drive, pair(420.0, 0.2)))],
        hold="first-order",
        on_progress=lambda *call: told.append(call),
    )
    assert [what for _, _, what in told if what.startswith("order")] == [f"order {n}" for n in range(1, 6)]
    assert fit.order == 2
    assert "criterion" in fit.reason and "chi-square + parameters x ln values" in fit.reason
    assert {total for _, total, _ in told} == {8 + 2}  # as many orders as are tried at most, and two steps behind them


@pytest.mark.promise("identify-16")
def test_what_a_record_cannot_show_is_no_pole():
    """A pair that rings for a third of the record, and a real pole slower than the fastest lag of creep."""
    drive = swept()
    found_response = response_from_records([measured(drive, answer(drive, pair(420.0, 0.2)))])
    with_creep = PoleZeroProblem(found_response, (0.01, 0.1), 0.6)
    assert with_creep.slowest_hz == pytest.approx(1 / (2 * math.pi * 0.01))  # 16 Hz
    assert PoleZeroProblem(found_response, (), 0.6).slowest_hz == pytest.approx(found_response.excited_hz[0])
    for rings_s, shown in ((0.18, True), (0.2, False)):
        assert with_creep.shows(Root(420.0, 1 / (2 * math.pi * 420.0 * rings_s))) == shown
    wrong = PoleZero((Root(300.0, 0.2),), (), 0.0)  # what it leaves at a frequency counts as noise there
    before, after = (
        float(np.mean(each.residual(wrong)[: each.values] ** 2)) for each in (with_creep, with_creep.worth_less(wrong))
    )
    assert before > 100.0
    assert 0.3 < after < 1.5
    fitted = with_creep.fitted(PoleZero((Root(420.0, 0.2),), (), 0.0))
    assert fitted.criterion == pytest.approx(fitted.chi_square + fitted.parameters * math.log(with_creep.values))


@pytest.mark.promise("identify-7", "identify-16")
def test_what_the_estimate_of_a_narrow_resonance_adds_of_itself_is_taken_off():
    drive = swept()
    record = recording_from_arrays(drive, answer(drive, pair(420.0, 0.01)), RATE, "chirp")
    rough = replace(response_from_records([record], bands=500), hold="first-order")
    fit = PoleZeroProblem(rough, (), 0.6).fitted(PoleZero((Root(421.0, 0.011),), (), 0.0))
    better = PoleZeroProblem(axis._unbiased([record], rough, fit), (), 0.6).fitted(fit.at)
    assert fit.at.poles[0].damping > 1.25 * 0.01  # smeared over a band
    assert better.at.poles[0].damping == pytest.approx(0.01, rel=0.05)


@pytest.mark.promise("identify-16")
def test_what_is_not_needed_is_taken_away_one_by_one_as_long_as_the_criterion_falls(monkeypatch):
    drive = swept()
    response = replace(response_from_records([measured(drive, answer(drive, pair(420.0, 0.2)))]), hold="first-order")
    spare = PoleZero((Root(420.0, 0.2), Root(60.0, None), Root(900.0, 0.5)), (Root(66.0, None), Root(950.0, 0.5)), 0.0)
    seen, others = [], pole_zero._others
    monkeypatch.setattr(pole_zero, "_others", lambda fit: seen.append(fit) or others(fit))
    first = PoleZeroProblem(response, (), 0.6).fitted(spare)
    left = pole_zero.pruned(first)
    sizes = [fit.parameters for fit in seen]
    assert seen[0] is first and seen[-1] is left and len(seen) > 2
    assert all(after < before for before, after in itertools.pairwise(sizes))
    assert all(after.criterion < before.criterion for before, after in itertools.pairwise(seen))
    assert [round(each.frequency_hz) for each in left.at.poles] == [420] and left.at.zeros == ()
    assert all(left.problem.fitted(other).criterion > left.criterion for other in others(left))


@pytest.mark.promise("identify-16")
def test_a_pole_and_a_zero_that_the_response_needs_stay():
    poles = [-2 * np.pi * 60.0 + 0j, *pair(1200.0, 0.3)]
    drive = swept()
    fit = fit_axis([measured(drive, answer(drive, poles, zeros=[-2 * np.pi * 66.0]))], hold="first-order")
    assert_poles(fit, *poles)
    assert abs(abs(fit.zeros_rad_s[0]) / (2 * np.pi) - 66.0) < 4 * fit.zeros_error_rad_s[0] / (2 * np.pi)


@pytest.mark.promise("identify-15")
def test_the_loss_of_small_loops_is_no_pole():
    poles = pair(420.0, 0.05)
    drive = swept(size=1.0)
    output = answer(drive, poles, turned=lambda u: plays(u, (0.0, 0.2, 0.5), (0.9, 0.06, 0.04)))
    fit = fit_axis([measured(drive, output)], hold="first-order")
    assert_poles(fit, *poles)


@pytest.mark.promise("identify-16")
def test_a_shift_between_samples():
    time = np.arange(300.0)[:, None]
    for samples in (0.0, 3.0, -2.0, 0.4, -1.3):
        shifted = late(np.sin(2 * np.pi * 0.1 * time), samples)
        away = np.abs(shifted - np.sin(2 * np.pi * 0.1 * (time - samples)))[10:-10].max()
        assert away < (1e-12 if samples == round(samples) else 1e-5)
    for frequency, holds in ((0.2, True), (0.4, False)):  # of the sample rate
        shifted, true = (np.sin(2 * np.pi * frequency * (time - by)) for by in (0.0, 0.4))
        assert (np.abs(late(shifted, 0.4) - true)[20:-20].max() < 1e-4) == holds
    assert_allclose(late(np.sin(time), 400.0)[:5], 0.0, atol=1e-12)  # it rests before its first sample


# ------------------------------------------------------------------------------------------------------ the joint fit
def test_a_held_drive_is_that_of_a_converter():
    drive = two_sines(400)
    linear = LinearPoles(Roots((150.0,), (0.35,)), Roots((), ()), 3.0)
    model = mirror.assemble("m", "cascade", linear.system, mirror_of_gain(), mirror_creep())
    plant = held(mirror.discretise(model, 1e-3))
    output = simulated(plant, drive)
    gain = behind_resonance(GAIN * (drive - drive[0]), 1e3, held=True)
    slow = lsim(([1.0], [0.1, 1.0]), drive - drive[0], np.arange(400) / 1e3, interp=False)[1]
    scale = linear.system  # of unit gain at 3 Hz, not at rest
    at_rest = float((scale.C @ np.linalg.solve(-scale.A, scale.B))[0, 0])
    assert_allclose(output, at_rest * gain + 1e-6 * slow, atol=1e-4 * np.ptp(output))


def mirror_of_gain():
    from microrad.mirror.hysteresis import PrandtlIshlinskii

    return PrandtlIshlinskii((0.0,), (GAIN,))


def mirror_creep():
    from microrad.mirror.hysteresis import Creep

    return Creep((1e-6,), (0.1,))


def simulated(plant, drive):
    from microrad.core import kernels

    output = np.empty((drive.size, 1))
    moved = (drive - drive[0])[:, None].copy()
    kernels.open_loop(plant, mirror.at_rest(plant), moved, output, np.empty((drive.size, 0)))
    return output[:, 0]


@pytest.mark.promise("identify-12")
def test_the_delay_is_fitted_with_the_poles_and_belongs_to_the_recording():
    drive = swept(seconds=0.6, lowest=5.0, size=3.0)
    poles = pair(700.0, 0.3)
    record = recording_from_arrays(drive, 1e3 * answer(drive, poles, delay_s=1e-4), RATE, "large chirp")
    start = LinearPoles(Roots((650.0,), (0.35,)), Roots((), ()), 10.0)
    fit = fit_joint([record], "linear", Units(), linear=start, free_linear=True, hold="first-order")
    assert fit.delay_s == pytest.approx(1e-4, abs=1e-6)
    assert fit.linear.poles.frequencies_hz[0] == pytest.approx(700.0, rel=2e-3)
    assert fit.fit.converged
    assert "delay_s" in FinePointing.model_fields  # a controller's own
    simulated_late = fit.response(drive, 1 / RATE)[0]
    at_once = replace(fit, linear=replace(fit.linear, delay_s=0.0)).response(drive, 1 / RATE)[0]
    assert_allclose(simulated_late[2:], at_once[:-2], atol=2e-3 * np.ptp(at_once))  # two samples later


@pytest.mark.promise("identify-24")
def test_the_error_of_a_sum_counts_the_colour_of_what_is_left():
    """Of a mean of correlated noise the variance is that of white noise times (1 + a) / (1 - a)."""
    a, n = 0.9, 4000
    white = philox(2).standard_normal((n, 40))
    coloured = np.zeros_like(white)
    for k in range(1, n):
        coloured[k] = a * coloured[k - 1] + white[k]
    fast = np.cos(np.pi * np.arange(n))  # where that noise is weakest
    columns = np.column_stack([np.ones(n), fast])
    scatter = [coloured_scatter(np.column_stack([r, columns]), 1, NONE, np.zeros((2, 2))) for r in coloured.T]
    slow_factor, fast_factor = (np.median([s[i, i] for s in scatter]) / n for i in (0, 1))
    assert slow_factor == pytest.approx(1 / (1 - a) ** 2, rel=0.35)
    assert fast_factor == pytest.approx(1 / (1 + a) ** 2, rel=0.35)
    plain = coloured_scatter(np.column_stack([white[:, 0], columns]), 1, NONE, np.zeros((2, 2)))
    assert_allclose(np.diag(plain) / n, 1.0, rtol=0.3)


@pytest.mark.promise("identify-24")
def test_what_a_fit_takes_out_of_a_residual_is_given_back():
    """Sines at the lowest ten lines and an offset, fitted to white noise: its variance there comes out as it is."""
    n = 400
    turns = 2 * np.pi * np.outer(np.arange(n), np.arange(1, 11)) / n
    columns = math.sqrt(2.0 / n) * np.hstack([np.cos(turns), np.sin(turns)])
    offset = np.full((n, 1), 1.0 / math.sqrt(n))
    basis = np.hstack([columns, offset])
    found = []
    for noise in philox(3).standard_normal((40, n)):
        rows = np.column_stack([noise - basis @ (basis.T @ noise), columns])
        given = coloured_scatter(rows, 1, offset, np.eye(20)), coloured_scatter(rows, 1, NONE, np.zeros((20, 20)))
        found.append([np.trace(each) / 20 for each in given])
    back, lost = np.mean(found, axis=0)
    assert 0.95 < back < 1.25  # the larger of two means
    assert lost < 0.8


def test_what_lies_between_samples_changes_nothing_without_a_linear_part():
    record = recorded(two_sines(), plays(two_sines(), (0.0, 1.0), (6e-5, 1e-5)))
    fits = [fit_joint([record], "prandtl_ishlinskii_rate", Units(), hold=h) for h in ("zero-order", "first-order")]
    assert_allclose(fits[0].fit.values, fits[1].fit.values, rtol=0, atol=0)


# -------------------------------------------------------------------------------------------- behind a hysteresis model
def fitted_to(linear, errors):
    """What of a joint fit is looked at: its linear part, and the standard error of each pole (Hz)."""
    named = [SimpleNamespace(name=f"pole {k}") for k in range(1, len(errors) + 1)]
    parts = {"structure": SimpleNamespace(parameters=named), "fit": SimpleNamespace(standard_errors=np.array(errors))}
    return JointFit(**(dict.fromkeys(f.name for f in fields(JointFit)) | parts | {"linear": linear}))


@pytest.mark.promise("identify-10")
def test_a_pole_with_its_zero_and_one_that_is_hardly_known_are_what_may_be_spare():
    """A slow real pair of pole and zero, a resonance that is known, and a pole far beyond the band."""
    linear = LinearPoles(Roots((11.0, 400.0, 20e3), (1.0, 0.03, 1.0)), Roots((11.5, 900.0), (1.0, 1.0)), 30.0, 1e-4)
    beyond, pair = _fewer_poles(fitted_to(linear, (0.1, 0.02, 9e3)))
    assert beyond.poles.frequencies_hz == (11.0, 400.0)
    assert beyond.zeros == linear.zeros
    assert beyond.delay_s == pytest.approx(1e-4 + 1 / (2 * np.pi * 20e3))  # the turn of phase it made stays
    assert pair.poles.frequencies_hz == (400.0, 20e3)
    assert pair.zeros.frequencies_hz == (900.0,)
    assert pair.delay_s == 1e-4
    assert _fewer_poles(fitted_to(LinearPoles(Roots((400.0,), (0.03,)), Roots((), ()), 30.0), (100.0,))) == []


@pytest.mark.promise("identify-10")
def test_poles_go_as_long_as_the_held_out_recordings_do_not_need_them():
    """Of three poles the recordings need one: without it what is left is ten times as large."""
    noise = philox(4).standard_normal(2000)

    def predicted(fit):
        return (
            SimpleNamespace(residual_rad=noise * (1.0 if 400.0 in fit.linear.poles.frequencies_hz else 10.0), split=0),
        )

    linear = LinearPoles(Roots((11.0, 400.0, 20e3), (1.0, 0.03, 1.0)), Roots((11.5,), (1.0,)), 30.0)
    asked = []

    def freed(begin, progress, evaluations):
        asked.append(begin.linear.poles.frequencies_hz)
        return fitted_to(begin.linear, [0.5 * f for f in begin.linear.poles.frequencies_hz])

    candidates = SimpleNamespace(freed=freed, predict=predicted)
    begin = fitted_to(linear, (0.1, 0.02, 9e3))
    fit = _without_spare_poles(candidates, begin, None)
    assert fit.linear.poles.frequencies_hz == (400.0,)
    assert fit.linear.zeros.frequencies_hz == ()
    assert asked == [(11.0, 400.0), (400.0,)]
    needed = fitted_to(linear, (0.1, 399.0, 9e3))
    assert _without_spare_poles(candidates, needed, None) is needed


def test_with_a_pole_goes_the_zero_that_is_nearest_to_it():
    poles, far = (Root(100.0, None), Root(3000.0, 0.1), Root(5000.0, 0.1)), (Root(900.0, None), Root(400.0, 0.1))
    at = PoleZero(poles, (far[0], Root(105.0, None), far[1]), 0.0)
    found = pole_zero._others(SimpleNamespace(at=at, problem=SimpleNamespace(highest_hz=1e4)))
    without = [one.zeros for one in found if one.poles == poles[1:]]
    assert without == [far, (far[0], Root(105.0, None))]


@pytest.mark.parametrize(
    ("poles_hz", "zeros_hz", "begun"),
    [
        ((0.5,), (), "slowest"),
        ((0.5, 3.0), (0.6,), "slowest"),
        ((30e3,), (), "highest"),
        ((0.5, 30e3), (0.7, 400.0), "highest"),
    ],
)
def test_a_fit_whose_poles_are_all_creep_or_far_beyond_the_band_begins_with_one_at_its_end(poles_hz, zeros_hz, begun):
    """As of a flat mirror; what comes of it is flat, too: nothing of the band is lost in the pole that is left."""
    drive = swept()
    flat = response_from_records([measured(drive, GAIN * (drive - drive[0]))])
    problem = PoleZeroProblem(replace(flat, hold="first-order"), (0.01,), 0.6)
    poles, zeros = ([complex(-2 * np.pi * hz) for hz in each] for each in (poles_hz, zeros_hz))
    start = problem.started(poles, zeros, 2e-5)
    end_hz = {"slowest": 1 / (2 * np.pi * 0.01), "highest": flat.excited_hz[1]}[begun]
    assert [(pole.frequency_hz, pole.damping) for pole in start.poles] == [(pytest.approx(end_hz), None)]
    assert start.zeros == () and start.delay_s == 2e-5
    if begun == "highest":
        fit = problem.fitted(start)
        assert fit.gains[0] == pytest.approx(GAIN, rel=2e-2)
        assert fit.at.poles[0].frequency_hz > 2 * flat.excited_hz[1]
