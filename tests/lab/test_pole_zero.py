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
from microrad.lab.identify.linear import axis, modal, pole_zero
from microrad.lab.identify.linear.axis import fit_axis
from microrad.lab.identify.linear.fit import OrderScore
from microrad.lab.identify.linear.modal import late
from microrad.lab.identify.linear.pole_zero import PoleZero, PoleZeroProblem, Root
from microrad.lab.identify.linear.response import response_from_periods, response_from_records
from microrad.lab.identify.records import Units
from microrad.lab.identify.selection.candidates import _fewer_poles, _without_spare_poles
from microrad.lab.recording import recording_from_arrays
from microrad.mirror import model as mirror
from microrad.mission.tables.fine_pointing import FinePointing
from truths import behind, behind_resonance, creep, philox, plays, recorded, two_sines

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
    output = GAIN * behind(system, moved, FINE * RATE, held=between == "zero-order")
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


# ------------------------------------------------------------------------------------------ numbers unlike each other
TURN = 2 * np.pi


def problem_of(lags=(0.02, 0.3), hold="first-order", lowest=2.0, highest=50.0, seed=1, lines=40):
    """A response of noise at forty lines, every number its own; errors and powers differ from line to line."""
    draw, freq = philox(seed), np.geomspace(lowest, highest, lines)
    values = (draw.standard_normal(lines) + 1j * draw.standard_normal(lines))[:, None, None]
    error = (0.1 + draw.random(lines))[:, None, None]
    response = SimpleNamespace(
        freq_hz=freq,
        response=values,
        standard_error=error,
        drive_power=(1.0 + draw.random(lines))[:, None, None] + 0j,
        hold=hold,
        rate_hz=200.0,
        excited_hz=(lowest, highest),
    )
    return PoleZeroProblem(response, lags, 4.0), response


AT = PoleZero((Root(30.0, 0.2), Root(12.0, None), Root(70.0, None)), (Root(-45.0, None), Root(20.0, -0.1)), 3e-3)


def test_numbers_of_a_search_are_those_of_poles_then_zeros_then_the_delay():
    problem, _ = problem_of()
    numbers = problem.pack(AT)
    expected = [math.log(0.6), 0.2, math.log(0.24), math.log(1.4), -50 / 45, math.log(0.4), -0.1, TURN * 50.0 * 3e-3]
    assert_allclose(numbers, expected)
    again = problem.unpack(numbers, AT)
    assert again.delay_s == pytest.approx(3e-3)
    for one, other in zip((*again.poles, *again.zeros), (*AT.poles, *AT.zeros), strict=True):
        assert one.frequency_hz == pytest.approx(other.frequency_hz) and one.damping == pytest.approx(other.damping)
    flat = problem.unpack(np.where(np.arange(8) == 4, -1e-12, numbers), AT)
    assert flat.zeros[0].frequency_hz == pytest.approx(-50e9)
    low, high = problem.bounds(AT)
    slow, far, near, real = 25.0, math.log(5.0), math.log(2 / 50), math.log(1 / (TURN * 0.02) / 50)
    assert_allclose(low, [near, 1e-4, real, real, -slow, near, -0.9999, -TURN * 50 / 200])
    assert_allclose(high, [far, 0.9999, far, far, slow, far, 0.9999, TURN * 0.5])
    assert AT.count == 8


def test_roots_have_their_states_their_delay_and_their_values():
    pair, real = Root(30.0, 0.6), Root(-5.0, None)
    assert (pair.states, real.states, pair.size_hz, real.size_hz) == (2, 1, 30.0, 5.0)
    assert pair.delay_s == pytest.approx(1.2 / (TURN * 30)) and real.delay_s == pytest.approx(-1 / (TURN * 5))
    assert_allclose(pole_zero.root_values([pair, real]), TURN * np.array([-18 + 24j, -18 - 24j, 5.0]))
    for root in (pair, real, Root(7.0, -0.25)):
        again = pole_zero._root(root.values[0])
        assert again.frequency_hz == pytest.approx(root.frequency_hz)
        assert again.damping == (None if root.damping is None else pytest.approx(root.damping))


def response_by_hand(at, freq, gain=1.0):
    """Product form, of gain 1 at rest, behind the delay."""
    s, found = 1j * TURN * freq, np.ones(freq.size, dtype=complex)
    for root in pole_zero.root_values(at.poles):
        found /= 1 - s / root
    for root in pole_zero.root_values(at.zeros):
        found *= 1 - s / root
    return gain * found * np.exp(-s * at.delay_s)


def test_a_response_of_poles_and_zeros_has_a_gain_of_one_at_rest_and_lags_beside_it():
    freq = np.array([0.0, 3.0, 25.0, 80.0])
    assert_allclose(pole_zero.sampled(AT, freq, "band-limited", None), response_by_hand(AT, freq), rtol=1e-10)
    model = pole_zero.modes_of(AT, -2.5, (0.3, -0.1), (0.02, 0.5))
    lags = 0.3 / (1 + 2j * np.pi * freq * 0.02) - 0.1 / (1 + 2j * np.pi * freq * 0.5)
    expected = response_by_hand(AT, freq, -2.5) + lags * np.exp(-2j * np.pi * freq * 3e-3)
    assert_allclose(model.response(freq)[:, 0, 0], expected, rtol=1e-10)
    assert (model.delay_s, model.order) == (3e-3, 6)
    assert pole_zero.modes_of(AT, 1.0, (), ()).order == 4


def test_what_is_left_of_a_response_is_the_least_over_gain_loss_and_lags_whose_weights_count():
    problem, response = problem_of()
    freq, values = response.freq_hz, response.response[:, 0, 0]
    shape = pole_zero.sampled(AT, freq, "first-order", 200.0)
    lags = pole_zero.modes_of(AT, 0.0, (1.0, 0.0), (0.02, 0.3)).response(freq, "first-order", 200.0)
    assert problem.values == 80
    weight = problem.root_weight
    columns = problem.columns(AT)
    assert columns.shape == (82, 4)
    assert_allclose(columns[:40, 0] + 1j * columns[40:80, 0], weight * shape)
    assert_allclose(columns[:40, 1] + 1j * columns[40:80, 1], 1j * weight * shape)
    undelayed = lags[:, 0, 0] * np.exp(2j * np.pi * freq * 3e-3)
    assert_allclose(columns[:40, 2] + 1j * columns[40:80, 2], weight * undelayed, rtol=1e-9)
    middle = np.median(np.abs(values))
    assert_allclose(columns[80:], [[0, 0, 1 / middle, 0], [0, 0, 0, 1 / middle]], atol=1e-12)
    target = np.concatenate([(weight * values).real, (weight * values).imag, [0.0, 0.0]])
    gains, *_ = np.linalg.lstsq(columns, target, rcond=None)
    assert_allclose(problem.linear(AT), gains, rtol=1e-8)
    assert_allclose(problem.residual(AT), target - columns @ gains, atol=1e-9)
    left = (target - columns @ gains)[:80].reshape(2, 40) / weight
    power = response.drive_power[:, 0, 0].real
    assert problem.output_error_rms(AT) == pytest.approx(np.sqrt(np.sum(left**2 * power)))
    twice = replace(AT, poles=(Root(30.0, None), Root(30.0, None), Root(40.0, None)), zeros=())
    with np.errstate(all="ignore"):
        assert_allclose(problem.residual(twice), target)


def test_the_noise_of_a_line_is_the_mean_of_its_neighbours_and_what_no_model_explains_makes_it_worth_less():
    problem, response = problem_of()
    freq, power = response.freq_hz, response.drive_power[:, 0, 0].real
    noise = response.standard_error[:, 0, 0] ** 2 * power

    def near(values, factor):
        found = []
        for k, f in enumerate(freq):
            inside = [j for j in range(40) if f / factor <= freq[j] <= f * factor or abs(j - k) <= 10]
            found.append(np.mean(values[min(inside) : max(inside) + 1]))
        return np.array(found)

    assert_allclose(problem.root_weight, np.sqrt(2 * power / near(noise, 1.1)), rtol=1e-9)
    less = problem.worth_less(AT)
    squares = np.sum(problem.residual(AT)[:80].reshape(2, 40) ** 2, axis=0) / 2
    assert_allclose(less.root_weight, problem.root_weight / np.sqrt(np.maximum(near(squares, 2.0), 1.0)), rtol=1e-9)
    assert_allclose(less.residual(AT) @ less.columns(AT), np.zeros(4), atol=1e-7)
    weighted = less.root_weight * response.response[:, 0, 0]
    target = np.concatenate([weighted.real, weighted.imag, [0.0, 0.0]])
    assert_allclose(less.linear(AT), np.linalg.lstsq(less.columns(AT), target, rcond=None)[0], rtol=1e-8)
    assert_allclose(problem.root_weight, problem_of()[0].root_weight)  # the first one stays


@pytest.mark.parametrize(
    ("pole", "shown"),
    [
        (Root(0.01, None), True),
        (Root(2.0, 0.06), False),  # rings for 1.33 s, and 4 s over pi are 1.27 s
        (Root(2.0, 0.07), True),
        (Root(7.9, 0.51), False),  # no faster than the fastest lag
        (Root(8.0, 0.51), True),
        (Root(7.9, 0.49), True),
    ],
)
def test_a_record_shows_a_pair_that_rings_out_in_it_and_is_no_creep(pole, shown):
    problem, _ = problem_of()
    assert problem.slowest_hz == pytest.approx(1 / (TURN * 0.02))
    assert problem.shows(pole) is shown
    fit = pole_zero.Fitted(problem, PoleZero((pole,), (), 0.0), 123.0)
    assert fit.parameters == pole.states + 1 + 4 and fit.freedom == 80 - fit.parameters
    assert fit.criterion == pytest.approx(123.0 + fit.parameters * math.log(80) + (0 if shown else 1e12))


def test_a_start_leaves_out_what_is_far_and_slow_poles_with_a_zero_and_moves_those_apart_that_coincide():
    problem, _ = problem_of()

    def rad(*hz):
        return [TURN * complex(each) for each in hz]

    start = problem.started(rad(-20, -20, -1, -260, -10 + 30j, -10 - 30j), rad(-1.5, -2.5, 251, 100, 40), 2e-3)
    assert [(p.frequency_hz, p.damping) for p in start.poles] == [
        (pytest.approx(20.0), None),
        (pytest.approx(20.02), None),
        (pytest.approx(np.sqrt(1000.0)), pytest.approx(10 / np.sqrt(1000.0))),
    ]
    assert [z.frequency_hz for z in start.zeros] == pytest.approx([2.5, -40.0, -100.0]) and start.delay_s == 2e-3
    few = problem.started(rad(-20, -30), rad(-25, 100), 0.0)
    assert [z.frequency_hz for z in few.zeros] == pytest.approx([25.0])


def test_what_is_taken_away_leaves_its_turn_of_phase_to_the_delay():
    less = pole_zero._less(AT, [0], [0])
    assert (less.poles, less.zeros) == (AT.poles[1:], AT.zeros[1:])
    assert less.delay_s == pytest.approx(3e-3 + 0.4 / (TURN * 30) + 1 / (TURN * 45))
    assert pole_zero._less(AT, [], []) == AT


def test_others_of_a_model_are_those_with_less_or_with_a_pole_for_a_zero():
    at = PoleZero((Root(30.0, 0.2), Root(12.0, None), Root(90.0, None)), (Root(60.0, None), Root(11.0, None)), 0.0)
    found = pole_zero._others(SimpleNamespace(at=at, problem=SimpleNamespace(highest_hz=100.0)))
    told = [
        ([p.frequency_hz for p in one.poles], [z.frequency_hz for z in one.zeros], [p.damping for p in one.poles])
        for one in found
    ]
    pair, one, two = 0.2, None, None
    assert told == [
        ([30.0, 12.0, 90.0], [11.0], [pair, one, two]),
        ([30.0, 12.0, 90.0], [60.0], [pair, one, two]),
        ([12.0, 90.0, 30.0], [60.0, 11.0], [None, None, None]),
        ([12.0, 90.0, 30.0], [11.0], [None, None, None]),
        ([12.0, 90.0], [11.0], [None, None]),
        ([12.0, 90.0], [], [None, None]),
        ([30.0, 90.0], [60.0, 11.0], [pair, None]),
        ([30.0, 90.0], [60.0], [pair, None]),
        ([30.0, 12.0], [60.0, 11.0], [pair, None]),
        ([30.0, 12.0], [11.0], [pair, None]),
        ([30.0, 12.0, 90.0, 100.0], [11.0], [pair, None, None, None]),
    ]
    turn = {len(o.poles): o.delay_s for o in found}
    assert turn[4] == pytest.approx(-1 / (TURN * 60) - 1 / (TURN * 100))


def test_the_covariance_of_numbers_is_that_of_their_slopes_with_the_gain_relative():
    problem, _ = problem_of(seed=3)
    fit = pole_zero.Fitted(problem, AT, 1.0)
    gains, numbers = problem.linear(AT), problem.pack(AT)
    columns = []
    for k in range(numbers.size):
        step = 1e-6 * (np.arange(numbers.size) == k)
        up, down = (problem.columns(problem.unpack(numbers + s, AT)) @ gains for s in (step, -step))
        columns.append((up - down) / 2e-6)
    own = problem.columns(AT)
    columns += [gains[0] * own[:, 0], gains[0] * own[:, 1], own[:, 2], own[:, 3]]
    J = np.column_stack(columns)
    assert_allclose(fit.covariance(), np.linalg.inv(J.T @ J), rtol=1e-4, atol=1e-9)
    assert_allclose(fit.gains, gains)
    assert (fit.modes().order, fit.modes(creep=True).order) == (4, 6)


@pytest.mark.parametrize("period", [None, 50])
def test_an_error_is_freed_of_creep_and_offset_whatever_size_they_have(period):
    """A lag of 10 ms and one of 100 ms are added to what a model makes; a drift where nothing repeats."""
    one, noise = np.ones((1, 1), dtype=complex), philox(5).standard_normal((200, 1))
    model = modal.ModalModel(np.array([-60.0 + 0j]), one, 60.0 * one, np.zeros((1, 1)))
    lags = modal.ModalModel(
        np.array([-100.0, -10.0]) + 0j, np.ones((2, 1)) + 0j, one * [[30.0, -2.0]], np.zeros((1, 1))
    )
    drive = noise if period is None else np.tile(noise[:50], (4, 1))
    if period is None:
        both = [modal.simulate(each, drive - drive[:1], 500.0, "first-order") for each in (model, lags)]
        both.append(0.3 * np.arange(200.0)[:, None])
    else:
        ones = [modal.simulate_periodic(each, drive[:50], 500.0, "first-order") for each in (model, lags)]
        both = [np.tile(each, (4, 1)) for each in ones]
    own = np.zeros((200, 1))
    own[77] = 1e-3
    record = replace(recording_from_arrays(drive, drive, 500.0), output=sum(both) + 5.0 + own)
    found = axis.axis_error(model, replace(record, period_samples=period), "first-order")
    assert found.shape == (200, 1) and int(np.argmax(np.abs(found))) == 77
    assert 0.9e-3 < found[77, 0] < 1e-3 and np.abs(np.delete(found[:, 0], 77)).max() < 1e-4


def test_a_reason_of_an_order_is_told_in_full():
    of = [
        OrderScore(n, 3 * n, chi, free, c, 0.0) for n, chi, free, c in ((1, 900.0, 90, 950.0), (4, 85.5, 84, 123.456))
    ]
    assert axis._reason(of[1], of) == (
        "order 4 has the least criterion, 123.5 (chi-square + parameters x ln values); squared distance over its "
        "variance, per degree of freedom, by order: 1: 10, 4: 1.02 (1 is what a true model leaves; what no order "
        "explains counts as noise); order 1 is worse by 827"
    )


@pytest.mark.parametrize(
    ("root", "size", "delay", "states", "values"),
    [
        (Root(5.0, None), 5.0, 1 / (10 * math.pi), 1, [-10 * math.pi]),
        (Root(-5.0, None), 5.0, -1 / (10 * math.pi), 1, [10 * math.pi]),
        (Root(2.0, 0.6), 2.0, 1.2 / (4 * math.pi), 2, [4 * math.pi * (-0.6 + 0.8j), 4 * math.pi * (-0.6 - 0.8j)]),
        (Root(2.0, -0.28), 2.0, -0.56 / (4 * math.pi), 2, [4 * math.pi * (0.28 + 0.96j), 4 * math.pi * (0.28 - 0.96j)]),
        (Root(1.0, 0.0), 1.0, 0.0, 2, [2j * math.pi, -2j * math.pi]),
    ],
)
def test_a_root_says_its_size_its_delay_its_states_and_its_values(root, size, delay, states, values):
    assert (root.size_hz, root.states) == (size, states)
    assert root.delay_s == pytest.approx(delay) and root.values == pytest.approx(values)


@pytest.mark.parametrize(
    ("lowest_hz", "lags"),
    [
        (200.0, ""),
        (150.0, "0.01"),
        (50.0, "0.01 0.0316227766"),
        (2.0, "0.01 0.0316227766 0.1 0.316227766"),
        (160.0, ""),
    ],
)
def test_lags_are_two_a_decade_up_to_ten_radians_of_the_lowest_frequency(lowest_hz, lags):
    found = axis._lags(SimpleNamespace(excited_hz=(lowest_hz, 999.0)))
    assert found == pytest.approx([float(v) for v in lags.split()])


@pytest.mark.parametrize(
    ("like", "low", "high"),
    [
        (PoleZero((Root(9.0, None),), (), 0.0), "real", "far"),
        (PoleZero((Root(9.0, 0.3),), (), 0.0), "near 1e-4", "far .9999"),
        (
            PoleZero((Root(9.0, 0.3), Root(5.0, None)), (Root(-8.0, None),), 0.0),
            "near 1e-4 real -slow",
            "far .9999 far slow",
        ),
        (PoleZero((Root(9.0, 0.3),), (Root(8.0, -0.2),), 0.0), "near 1e-4 near -.9999", "far .9999 far .9999"),
    ],
)
def test_each_number_of_a_search_has_bounds_of_its_kind(like, low, high):
    """A band of 2 to 50 Hz at 640 Hz with lags of 20 and 300 ms: no real pole is slower than the faster lag."""
    problem, *_ = problem_of()
    names = {
        "real": math.log(1 / (2 * math.pi * 0.02) / problem.highest_hz),
        "near": math.log(problem.lowest_hz / problem.highest_hz),
        "far": math.log(5.0),
        "slow": problem.highest_hz / problem.lowest_hz,
        "-slow": -problem.highest_hz / problem.lowest_hz,
    }
    found = problem.bounds(like)
    for own, words, delay in zip(
        found, (low, high), (-2 * math.pi * problem.highest_hz / problem.rate_hz, math.pi), strict=True
    ):
        assert own == pytest.approx([*(names[w] if w in names else float(w) for w in words.split()), delay])
    assert problem.pack(like).size == found[0].size


def test_an_order_with_a_pole_that_no_recording_shows_is_not_worse_by_a_price():
    of = [OrderScore(n, n, 10.0 * n, 100, c, 0.0) for n, c in ((1, 50.0), (2, 1e12 + 30.0), (3, 2e12))]
    assert axis._reason(of[0], of).endswith("noise); order 2 has a pole that no recording shows")
    assert axis._reason(of[0], [of[0], OrderScore(2, 2, 20.0, 100, 9e11, 0.0)]).endswith("is worse by 900000000000")


def test_of_zeros_beside_a_pole_one_of_its_own_kind_goes_with_it():
    """A real zero on the right stands beside a real pole, a pair beside a pair; of two beside a pole the first goes."""
    zeros = Roots((100.0, 101.0, 99.0, 102.0), (0.4, -1.0, 1.0, -0.3))
    linear = LinearPoles(Roots((100.0, 103.0, 1e3, 2e3, 3e3, 4e3), (1.0, 0.2, 1.0, 1.0, 1.0, 1.0)), zeros, 30.0, 1e-4)
    real, pair = _fewer_poles(fitted_to(linear, (2.0, 1.0, 1e-3, 1e-3, 1e-3, 1e-3)))
    assert real.poles.frequencies_hz[:2] == (103.0, 1e3) and pair.poles.frequencies_hz[:2] == (100.0, 1e3)
    assert real.zeros.frequencies_hz == (100.0, 99.0, 102.0)
    assert pair.zeros.frequencies_hz == (101.0, 99.0, 102.0)
    assert real.delay_s == pair.delay_s == 1e-4


@pytest.mark.parametrize(("period", "length_s"), [(50, 0.1), (None, 0.4)])
def test_a_pole_is_shown_by_a_period_of_what_repeats_and_else_by_a_whole_record(monkeypatch, period, length_s):
    """Two records of 200 samples at 500 Hz, and what the problem of their poles is made of."""

    class MadeError(Exception):
        pass

    def made(*given):
        raise MadeError(*given)

    monkeypatch.setattr(axis, "PoleZeroProblem", made)
    drives = [philox(k).standard_normal((period or 200, 1)) for k in (1, 2)]
    records = []
    for drive in drives:
        whole = np.tile(drive, (200 // len(drive), 1))
        record = recording_from_arrays(whole, whole, 500.0)
        records.append(replace(record, output=whole + 0.1 * np.roll(whole, 1, axis=0), period_samples=period))
    with pytest.raises(MadeError) as caught:
        fit_axis(records, hold="first-order")
    response, lags, length = caught.value.args
    expected = response_from_periods(records) if period else response_from_records(records, bands=500)
    assert length == pytest.approx(length_s) and response.hold == "first-order"
    assert lags == axis._lags(expected)
    assert_allclose(response.freq_hz, expected.freq_hz)
    assert_allclose(response.response, expected.response)


@pytest.mark.parametrize(("gain", "taken"), [(0.0009, False), (0.0011, True)])
def test_the_best_of_the_four_most_promising_changes_is_made_where_it_lowers_the_criterion(monkeypatch, gain, taken):
    """Of six changes, the worst first, the last four are fitted to their end, and there another one is the best.

    The first two would be better still in the end, but their rough fits are the worst.
    """
    rough = {"a": 60.0, "b": 50.0, "c": 40.0, "d": 30.0, "e": 20.0, "f": 10.0}
    settled = {"a": 0.0, "b": 0.0, "c": 7.0, "d": 5.0 - gain, "e": 6.0, "f": 8.0}
    asked = []

    class Problem:
        def fitted(self, start, evaluations=None):
            asked.append((start, evaluations))
            own = rough if evaluations is not None else settled
            return SimpleNamespace(problem=self, at=start, criterion=own[start])

    begin = SimpleNamespace(problem=Problem(), at="begin", criterion=5.0)
    monkeypatch.setattr(pole_zero, "_others", lambda fit: list(rough) if fit.at == "begin" else [])
    left = pole_zero.pruned(begin)
    assert (left.at == "d") is taken and (left is begin) is not taken
    assert asked == [*((one, 4) for one in "abcdef"), *((one, None) for one in "fedc")]


@pytest.mark.parametrize(
    ("poles_hz", "zeros_hz", "kept"),
    [
        ((-20, -30, -10 + 30j), (-25, 249), [25.0, -249.0]),
        ((-20, -30, -10 + 30j), (-25, 251), [25.0]),
        ((-1, -20, -30, -45), (-40,), [40.0]),
        ((-1, -20, -30, -45), (-15, -40), [40.0]),
        ((-1, -20, -30, -45), (-17, -40), [17.0, 40.0]),
        ((-1, -20, -30, -45), (9, -40), [40.0]),
        ((-1, -20, -30, -45, -47), (-1 + 3j, -40), [np.sqrt(10.0), 40.0]),
        ((-1, -2, -20, -30, -45), (-3, -5, -12), [12.0]),
        ((-9, -20, -30), (-8.5,), [8.5]),
    ],
)
def test_a_slow_pole_takes_one_slow_real_zero_along_and_what_is_far_is_left_out(poles_hz, zeros_hz, kept):
    """The slowest real pole is at 8 Hz, a zero beside it below 16 Hz; 250 Hz are five times the highest frequency."""
    problem, _ = problem_of()

    def rad(values):
        whole = [TURN * complex(each) for each in values]
        return whole + [each.conjugate() for each in whole if each.imag]

    start = problem.started(rad(poles_hz), rad(zeros_hz), 1e-3)
    assert [zero.frequency_hz for zero in start.zeros] == pytest.approx(kept)
    assert len(start.poles) == sum(abs(complex(pole)) > 8.0 for pole in poles_hz)


@pytest.mark.parametrize(("values", "freedom"), [(14, 3), (12, 1), (11, 1), (4, 1)])
def test_a_fit_of_as_many_numbers_as_values_counts_one_degree_of_freedom(values, freedom):
    """A pair, a real zero, a delay, gain and loss and five lags are eleven numbers."""
    problem = SimpleNamespace(values=values, lags_s=(1e-2, 2e-2, 3e-2, 4e-2, 5e-2))
    fit = pole_zero.Fitted(problem, PoleZero((Root(30.0, 0.2),), (Root(45.0, None),), 1e-3), 5.0)
    assert (fit.parameters, fit.freedom) == (11, freedom)


# ------------------------------------------------------------------------------------------ one axis, part by part
FALLING = np.array([-2.0, 0.5, 0.3, -0.1])  # gain, its imaginary part and the weights of two lags


def test_a_response_is_freed_of_delay_creep_and_the_loss_of_a_gain_that_falls():
    freq = np.array([1.0, 3.0, 25.0, 80.0])
    at_once = response_by_hand(replace(AT, delay_s=0.0), freq, FALLING[0])
    lags = 0.3 / (1 + 2j * np.pi * freq * 0.02) - 0.1 / (1 + 2j * np.pi * freq * 0.5)
    whole = ((1 - 0.25j) * at_once + lags) * np.exp(-2j * np.pi * freq * 3e-3)
    response = SimpleNamespace(freq_hz=freq, response=whole[:, None, None], hold="band-limited", rate_hz=None)
    fit = SimpleNamespace(at=AT, gains=FALLING, problem=SimpleNamespace(lags_s=(0.02, 0.5)))
    assert_allclose(axis._freed(fit, response)[:, 0, 0], at_once, rtol=1e-9)


@pytest.mark.parametrize(("chi_square", "inflated"), [(40.0, 4.0), (2.5, 1.0)])
def test_errors_of_an_axis_are_those_of_its_numbers_and_no_smaller_than_the_scatter(chi_square, inflated):
    """The gain falls; of the zeros the pair alone lies below half of the sample rate."""
    problem, _ = problem_of()
    top, numbers = problem.highest_hz, problem.pack(AT)
    sizes = np.array([0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 50.0, 60.0])
    covariance = np.diag(sizes**2)
    covariance[0, 1] = covariance[1, 0] = 0.5 * sizes[0] * sizes[1]
    fit = SimpleNamespace(
        problem=problem,
        at=AT,
        gains=FALLING,
        covariance=covariance.copy,
        chi_square=chi_square,
        freedom=10,
        modes=lambda: pole_zero.modes_of(AT, FALLING[0], (), ()),
    )
    modes, known = axis._known(fit, 7.0, 80.0)
    assert modes.delay_s == 3e-3
    pair, zero = AT.poles[0].values[0], AT.zeros[1].values[0]
    assert_allclose(known.poles_rad_s, [-TURN * 12, -TURN * 70, pair, pair.conjugate()], rtol=1e-12)
    assert_allclose(known.zeros_rad_s, [zero.conjugate(), zero], rtol=1e-12)

    def by_damping(root):
        return TURN * root.frequency_hz * complex(-1.0, -root.damping / math.sqrt(1.0 - root.damping**2))

    both = covariance[0, 1] * (pair * by_damping(AT.poles[0]).conjugate()).real
    of_pair = np.sqrt(abs(pair * 0.01) ** 2 + abs(by_damping(AT.poles[0]) * 0.02) ** 2 + 2 * both)
    of_zero = np.hypot(abs(zero) * 0.06, abs(by_damping(AT.zeros[1])) * 0.07)
    more = math.sqrt(inflated)
    expected = more * np.array([TURN * 12 * 0.03, TURN * 70 * 0.04, of_pair, of_pair])
    assert_allclose(known.poles_error_rad_s, expected, rtol=1e-6)
    assert_allclose(known.zeros_error_rad_s, more * np.array([of_zero, of_zero]), rtol=1e-6)
    assert known.delay_error_s == pytest.approx(more * 0.08 / (TURN * top), rel=1e-6)
    assert known.dc_gain[0, 0] == pytest.approx(-2.0) and known.dc_gain_error[0, 0] == pytest.approx(more * 2.0 * 0.09)

    def edge(step):
        moved = problem.unpack(numbers + step[:8], AT)
        return abs(response_by_hand(moved, np.array([7.0]), -2.0 * (1.0 + step[8]))[0])

    slope = np.array([(edge(s) - edge(-s)) / 2e-6 for s in 1e-6 * np.eye(9)])
    assert known.edge_gain[0, 0] == pytest.approx(edge(np.zeros(9)))
    error = more * math.sqrt(slope @ covariance[:9, :9] @ slope)
    assert known.edge_gain_error[0, 0] == pytest.approx(error, rel=1e-5)
    assert all(np.shape(v) == (1, 1) for v in (known.dc_gain, known.dc_gain_error, known.edge_gain))
    assert np.shape(known.edge_gain_error) == (1, 1)


def scored(poles, criterion, error):
    at = PoleZero(poles, (), 0.0)
    return SimpleNamespace(at=at, parameters=3, chi_square=7.0, freedom=5, criterion=criterion, output_error_rms=error)


@pytest.mark.parametrize(("criterion", "kept"), [(6.0, 0.2), (4.0, 0.9)])
def test_the_scan_of_an_axis_has_the_better_of_two_models_of_an_order_and_a_residual_without_loss(
    monkeypatch, criterion, kept
):
    """Orders 3 and 1 and then 3 once more; with creep a model makes all but the loss of what is measured."""
    freq = np.array([2.0, 5.0, 9.0])
    one = np.ones((1, 1), dtype=complex)
    own, whole = (modal.ModalModel(np.array([-p + 0j]), one, p * one, np.zeros((1, 1))) for p in (20.0, 30.0))
    fit = scored((Root(5.0, 0.1), Root(9.0, None)), criterion, 0.9)
    fit.gains, fit.modes = FALLING, lambda creep: whole if creep else None
    fits = [scored((Root(4.0, 0.1), Root(8.0, None)), 5.0, 0.2), scored((Root(3.0, None),), 50.0, 0.3)]
    left = np.array([0.1, 0.2j, -0.3])[:, None, None]
    measured = whole.response(freq) - 0.25j * own.response(freq) + left
    response = SimpleNamespace(
        freq_hz=freq, response=measured, hold="band-limited", rate_hz=150.0, excited_hz=(2.0, 9.0)
    )
    monkeypatch.setattr(axis, "_known", lambda *given: (own, given))
    monkeypatch.setattr(axis, "axis_error", lambda *given: given)
    monkeypatch.setattr(axis, "with_evidence", lambda *given: given)
    model, records, errors, of, residual, known, scan, reason = axis._linear_fit(["a", "b"], response, fit, fits)
    assert model is own and records == ["a", "b"] and of is response and known == (fit, 2.0, 150.0)
    assert errors == [(own, record, "band-limited") for record in "ab"]
    assert_allclose(residual, left, atol=1e-12)
    assert [(s.order, s.criterion, s.output_error_rms) for s in scan] == [
        (1, 50.0, 0.3),
        (3, min(criterion, 5.0), kept),
    ]
    assert reason.startswith("order 3 has the least criterion, ") and "order 1 is worse by" in reason
    assert len(axis._linear_fit([], response, fit, fits[1:])[6]) == 2


def test_what_an_estimate_adds_of_itself_is_taken_off_exactly_where_the_model_made_the_records():
    """Two drives that begin beside zero, from which the model begins at rest."""
    one = np.ones((1, 1), dtype=complex)
    model = modal.ModalModel(np.array([-3.0 + 40j]), one, (2.0 + 1j) * one, np.zeros((1, 1)))
    records = []
    for seed in (1, 2):
        drive = 5.0 * seed + philox(seed).standard_normal((1500, 1))
        record = recording_from_arrays(drive, drive, 100.0)
        output = modal.simulate(model, drive - drive[:1], 100.0, "first-order")
        records.append(replace(record, output=output))
    response = replace(response_from_records(records, bands=500), hold="first-order")
    true = model.response(response.freq_hz, "first-order", 100.0)
    assert np.abs(response.response / true - 1).max() > 1e-3
    found = axis._unbiased(records, response, SimpleNamespace(modes=lambda creep: model if creep else None))
    assert_allclose(found.response, true, rtol=1e-8)
    assert_allclose(found.standard_error, response.standard_error)


def test_a_zero_on_the_right_near_the_end_of_the_band_may_become_a_pole_there():
    at = PoleZero((Root(30.0, 0.2),), (Root(-60.0, None),), 1e-3)
    found = pole_zero._others(SimpleNamespace(at=at, problem=SimpleNamespace(highest_hz=100.0)))
    (turned,) = (one for one in found if len(one.poles) == 2)
    assert turned.poles == (Root(30.0, 0.2), Root(100.0, None)) and turned.zeros == ()
    assert turned.delay_s == pytest.approx(1e-3 + 1 / (TURN * 60) - 1 / (TURN * 100))
    low = replace(at, zeros=(Root(-49.0, None),))
    found = pole_zero._others(SimpleNamespace(at=low, problem=SimpleNamespace(highest_hz=100.0)))
    assert all(len(one.poles) == 1 for one in found) and len(found) == 2


@pytest.mark.parametrize("damping", [0.03, 0.4])
def test_a_pair_that_goes_leaves_the_turn_of_phase_of_its_damping_to_the_delay(damping):
    """At low frequencies a pair is late by twice its damping over its angular frequency."""
    linear = LinearPoles(Roots((400.0, 90.0), (damping, 0.1)), Roots((), ()), 30.0, 1e-4)
    (fewer,) = _fewer_poles(fitted_to(linear, (100.0, 0.1)))
    assert fewer.poles == Roots((90.0,), (0.1,)) and fewer.zeros == Roots((), ())
    assert fewer.delay_s == pytest.approx(1e-4 + 2 * damping / (2 * math.pi * 400.0))
