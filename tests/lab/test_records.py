"""Reversals and rates of a drive, which hang on no single step or spike, and which samples of a record are used."""

import math

import numpy as np
import pytest

import truths
from microrad.lab.identify import fit_prandtl_ishlinskii, identify, predict, records
from microrad.lab.identify.records import (
    IdentificationError,
    SiRecord,
    Units,
    centred,
    fastest_rate,
    loop_rates,
    memory,
    noisiness,
    si_records,
    smoothed_rate,
    turning_points,
)
from microrad.lab.recording import recording_from_arrays

RATE = 20_000.0
TIME = np.arange(14_000) / RATE
FROM_REST = np.where(TIME < 0.2, 5.0, 5.0 + 4.0 * np.sin(2 * np.pi * 20 * TIME + 2.5))  # a step of 2.4 V at 0.2 s
PEAK = 4.0 * 2 * np.pi * 20


def prepared(drive, rate_hz=RATE):
    return si_records([recording_from_arrays(drive, drive, rate_hz)], Units())


# ------------------------------------------------------------------------------------------------- reversals and rates
@pytest.mark.promise("identify-5")
def test_a_step_to_the_first_sample_of_a_sine_is_no_reason_to_refuse_it():
    output = truths.plays(FROM_REST, [0.0, 0.6, 1.9], [6e-5, 1.5e-5, 1e-5])
    found = identify([truths.recorded(FROM_REST, output, RATE)], models=("prandtl_ishlinskii",))
    assert found.score().held_out_rms_percent < 0.2  # the noise is 0.1 %
    assert found.rate_limit_v_per_s == pytest.approx(PEAK, rel=0.01)
    assert any("One loop rate only" in text for text in found.warnings)
    assert not any("noisy" in text for text in found.warnings)


@pytest.mark.promise("identify-5")
@pytest.mark.parametrize("samples", [6400, 7000, 14_000])
def test_one_step_is_neither_the_rate_of_the_loops_nor_their_limit(samples):
    record = prepared(FROM_REST[:samples])
    assert np.abs(smoothed_rate(record[0].drive_v, 1 / RATE)).max() > 10 * PEAK
    assert fastest_rate(record) == pytest.approx(PEAK, rel=0.01)
    assert loop_rates(record) == pytest.approx((PEAK, PEAK), rel=0.01)


@pytest.mark.promise("identify-5")
def test_one_spike_changes_nothing():
    drive = 5.0 + 4.0 * np.sin(2 * np.pi * 20 * TIME)
    spiked = drive.copy()
    spiked[5000] += 40.0
    assert turning_points(spiked).tolist() == pytest.approx(turning_points(drive).tolist(), abs=1)
    assert fastest_rate(prepared(spiked)) == pytest.approx(fastest_rate(prepared(drive)), rel=1e-3)
    assert loop_rates(prepared(spiked)) == pytest.approx(loop_rates(prepared(drive)), rel=1e-3)


@pytest.mark.promise("identify-5")
def test_reversals_stand_where_the_drive_turns_and_noise_makes_none():
    drive = 5.0 + 4.0 * np.sin(2 * np.pi * 20 * TIME)
    turns = np.arange(250, 14_000, 500)  # a quarter of a period, then each half
    assert_close = pytest.approx(turns.tolist(), abs=40)
    for noise in (0.0, 0.05):
        found = turning_points(drive + noise * truths.philox(1).standard_normal(drive.size))
        assert found.tolist() == assert_close
    for part, turns in ((0.04, 0), (0.06, 2)):  # a drive that goes back by a part of its range, and on
        back = np.concatenate(
            [np.linspace(0.0, 0.5, 200), np.linspace(0.5, 0.5 - part, 50), np.linspace(0.5 - part, 1.0, 300)]
        )
        assert turning_points(back).size == turns
    assert turning_points(np.linspace(0.0, 1.0, 500)).size == 0
    with pytest.raises(IdentificationError, match="never reverses"):
        prepared(np.linspace(0.0, 1.0, 500))


@pytest.mark.promise("identify-5")
def test_fast_edges_of_a_staircase_keep_their_rate():
    """Edges of 3 V and 6 V in 5 ms, with 2 s of rest between them."""
    levels, time = [6, 9, 12, 6, 0, 6], np.arange(12_000) / 1000.0
    corners = [t for k in range(6) for t in (2 * k + 0.005 * (k > 0), 2 * k + 2)]
    drive = np.interp(time, corners, np.repeat(levels, 2))
    assert fastest_rate(prepared(drive, 1000.0)) == pytest.approx(1200.0, rel=0.01)
    assert loop_rates(prepared(drive, 1000.0))[1] == pytest.approx(1200.0, rel=0.01)


@pytest.mark.promise("identify-6")
def test_noise_of_the_drive_is_told_by_its_median_size():
    drive = 5.0 + 4.0 * np.sin(2 * np.pi * 20 * TIME)
    assert noisiness(prepared(FROM_REST)) < 0.01
    noisy = drive + 0.01 * truths.philox(1).standard_normal(drive.size)
    assert noisiness(prepared(noisy)) == pytest.approx(np.sqrt(2) * 0.01 * RATE / PEAK, rel=0.15)


# ----------------------------------------------------------------------------------------------- what happened before
THRESHOLDS, WEIGHTS = (0.0, 0.6, 1.9, 3.2), (6e-5, 1.5e-5, 1e-5, 0.8e-5)
GROWING = np.repeat([1.0, 2.0, 3.0, 4.0], 2000) * np.sin(2 * np.pi * 2.0 * np.arange(8000) / 2000.0)


def remembered(drive, before, rate_hz=2000.0, noise=2e-4):
    """A record of plays that something went before: ``before`` is a drive that leads to the first one."""
    output = truths.plays(np.concatenate([before, drive]), THRESHOLDS, WEIGHTS)[len(before) :]
    return truths.recorded(drive, output, rate_hz, noise=noise)


@pytest.mark.promise("identify-18")
@pytest.mark.parametrize("before", [[], np.linspace(-6.0, 0.0, 50), np.linspace(4.5, 0.0, 50)])
def test_a_growing_loop_is_used_whole_whatever_the_mirror_remembers(before, monkeypatch):
    record = remembered(5.0 + GROWING, np.array(before) + 5.0)
    fit = fit_prandtl_ishlinskii([record], THRESHOLDS)
    assert fit.samples_used == record.samples - 400  # a twentieth
    assert 0.02 < fit.residual_rms_percent < 0.06  # the noise is 0.02 %
    assert np.max(fit.standard_errors_rad_per_v) < 2e-7
    np.testing.assert_array_less(abs(fit.weights_rad_per_v - WEIGHTS) / fit.standard_errors_rad_per_v, 4.0)
    prediction = predict(fit, record, 4000)
    assert prediction.start == 200  # a twentieth of what was fitted
    assert np.std(prediction.residual_rad[200:4000]) < 0.0006 * np.ptp(prediction.measured_rad)

    monkeypatch.setattr(records, "memory", lambda drive, known: np.zeros((drive.size, 1)))
    at_rest = fit_prandtl_ishlinskii([record], THRESHOLDS)
    assert (at_rest.residual_rms_percent > 5 * fit.residual_rms_percent) == (len(before) > 0)
    assert (np.max(abs(at_rest.weights_rad_per_v - WEIGHTS)) > 6e-7) == (len(before) > 0)


@pytest.mark.promise("identify-18")
def test_memory_is_a_function_of_the_range_swept_so_far():
    """Of plays that came from elsewhere, less those from rest: it stands still in each loop that is repeated."""
    ramps = memory(GROWING, GROWING.size)
    assert ramps.shape == (8000, 8)
    assert np.all(np.diff(ramps, axis=0) >= 0.0)
    assert ramps[0].tolist() == [0.0] * 8
    assert ramps[-1].tolist() == [1.0] * 8
    settled = slice(1500, 2000)  # the last of two periods of 1 V
    assert np.ptp(ramps[settled], axis=0).max() == 0.0
    assert ramps[1999].sum() == pytest.approx(2.0, abs=1e-3)  # 2 V of 8 V, in eighths
    away = remembered(GROWING, np.linspace(-6.0, 0.0, 50), noise=0.0).output - remembered(GROWING, [], noise=0.0).output
    own = np.column_stack([np.ones(8000), ramps])
    left = away[:, 0] - own @ np.linalg.lstsq(own, away[:, 0], rcond=None)[0]
    assert np.std(left) < 0.05 * np.std(away)
    assert memory(GROWING, 2000)[2000:].tolist() == memory(GROWING, 2000)[1999:2000].tolist() * 6000  # unknown beyond


@pytest.mark.promise("identify-18")
@pytest.mark.promise("readme-9")
def test_a_staircase_keeps_its_dwells_and_creep():
    """A level that nothing but the range swept tells from the one before is free; what creeps on it counts."""
    levels, time = [6, 9, 12, 6, 0, 6], np.arange(12_000) / 200.0
    drive = np.interp(time, [t for k in range(6) for t in (10 * k + 0.1 * (k > 0), 10 * k + 10)], np.repeat(levels, 2))
    (record,) = prepared(drive, 200.0)
    assert record.used == 11_400
    own = np.column_stack([np.ones(12_000), memory(drive, 12_000)])[record.start :]
    np.testing.assert_allclose(record.less_own(own), 0.0, atol=1e-9)
    assert record.own_count == np.linalg.matrix_rank(own)
    rest = time[record.start :] ** 2
    np.testing.assert_allclose(record.less_own(rest), rest - own @ np.linalg.lstsq(own, rest)[0], atol=1e-8)
    dwells = [round(200 * (10 * k + 5)) - record.start for k in range(6)]
    for level, known in ((9.0, False), (12.0, True)):  # back at 6 V the drive has swept no more than at 12 V
        there = centred(np.where(abs(record.drive_v - level) < 0.1, 1.0, 0.0)[record.start :], [record])
        assert (np.abs(there[dwells]).max() > 0.1) == known
    slope = centred(np.where(abs(record.drive_v - 9.0) < 0.1, time, 0.0)[record.start :], [record])
    assert np.std(slope[dwells[1] - 900 : dwells[1] + 900]) > 2.0  # how it moves meanwhile does


@pytest.mark.promise("identify-18")
def test_an_unseen_record_of_which_half_is_not_judged_is_told():
    known, unseen = remembered(5.0 + GROWING[::-1], []), remembered(5.0 + GROWING, [], noise=3e-4)
    found = identify([known], models=("prandtl_ishlinskii",), validation=[unseen])
    assert [p.start for p in found.predictions[0]] == [400, 4000]
    (told,) = [w for w in found.warnings if "are not judged" in w]
    assert "the first 4000 of 8000 samples" in told
    assert not any("set aside" in w for w in found.warnings)


# ------------------------------------------------------------------------------------------ numbers unlike each other
def told(function, *given, **words):
    with pytest.raises(IdentificationError) as caught:
        function(*given, **words)
    return str(caught.value)


@pytest.mark.parametrize(
    ("units", "message"),
    [
        (("kV", "deg"), "input unit 'kV' is not known; use one of V, mV."),
        (
            ("mV", "deg", 0.1),
            "output unit 'deg' is not known; use an angle (rad, mrad, urad) or a length (m, mm, um) with its lever "
            "arm.",
        ),
        (
            ("mV", "mm"),
            "the output is a length (mm) and a mirror model needs an angle: give the lever arm (--lever-arm, "
            "lever_arm_m), the distance in metres from the axis of rotation to the point measured (tilt = displacement "
            "/ lever arm).",
        ),
        (("V", "urad", -0.5), "the lever arm is -0.5 m; give a positive length in metres."),
        (
            ("V", "urad", 0.025),
            "a lever arm of 0.025 m was given for an output that is already an angle (urad); leave the lever arm out, "
            "or name the unit of length.",
        ),
    ],
)
def test_a_unit_that_cannot_be_used_is_told_in_full(units, message):
    assert told(Units, *units) == message


@pytest.mark.parametrize(
    ("units", "volts", "radians"),
    [
        (("V", "rad"), 1.0, 1.0),
        (("mV", "mrad"), 1e-3, 1e-3),
        (("V", "urad"), 1.0, 1e-6),
        (("mV", "m", 0.4), 1e-3, 2.5),
        (("V", "mm", 0.05), 1.0, 0.02),
        (("V", "um", 8.0), 1.0, 1.25e-7),
    ],
)
def test_each_unit_has_its_size_in_volts_and_radians(units, volts, radians):
    own = Units(*units)
    assert (own.volts, own.radians) == pytest.approx((volts, radians), rel=1e-12)


def of(drive, output, rate_hz=50.0, name="r"):
    columns = (np.asarray(v, dtype=float).reshape(len(v), -1) for v in (drive, output))
    return records.Recording(name, f"sha of {name}", *columns, rate_hz, ("u",), ("y",))


WAVE = np.sin(2 * np.pi * np.arange(247) / 60.0)


def test_records_in_volts_and_radians_keep_their_name_and_lose_a_twentieth():
    one, other = si_records(
        [of(WAVE, 3 * WAVE, name="a"), of(2 * WAVE[:199], WAVE[:199], 25.0, "b")], Units("mV", "um", 0.5)
    )
    assert (one.name, one.sha256, one.step_s, one.start, one.used) == ("a", "sha of a", 0.02, 12, 235)
    assert (other.name, other.sha256, other.step_s, other.start, other.used) == ("b", "sha of b", 0.04, 9, 190)
    np.testing.assert_allclose(one.drive_v, 1e-3 * WAVE)
    np.testing.assert_allclose(one.output_rad, 6e-6 * WAVE)
    thin = one.every(5)
    assert (thin.step_s, thin.start, thin.used, thin.name) == (pytest.approx(0.1), 3, 47, "a")
    np.testing.assert_array_equal(thin.output_rad, one.output_rad[::5])
    np.testing.assert_array_equal(thin.drive_v, one.drive_v[::5])
    assert records.span([other, one]) == pytest.approx(6e-6 * np.ptp(WAVE))


@pytest.mark.parametrize(
    ("drive", "output", "message"),
    [
        (
            np.ones((40, 3)),
            np.ones((40, 2)),
            "r: 3 drives and 2 outputs; one of each is identified here: choose one column, or identify all of them "
            "with coupled.identify_coupled.",
        ),
        (WAVE, 0 * WAVE + 4.0, "r: drive or output is constant in the part that is fitted."),
        (
            np.arange(40.0),
            np.arange(40.0),
            "r: the drive never reverses in the part that is fitted, and hysteresis shows only behind a reversal; "
            "record at least one full period of the drive.",
        ),
    ],
)
def test_the_second_of_two_records_that_cannot_be_used_is_told_in_full(drive, output, message):
    assert told(si_records, [of(WAVE, WAVE, name="good"), of(drive, output)], Units()) == message


def test_of_a_sweep_the_fastest_tenth_of_its_travel_counts_whichever_way_it_goes():
    """A hundred samples of 1 V each, twenty of 5 V, and fifty of 2 V: the tenth of 300 V goes fastest in six."""
    sweep = np.concatenate([[0.0], np.cumsum(np.repeat([1.0, 5.0, 2.0], [100, 20, 50]))])
    for each in (sweep, -sweep, 7.0 - 3 * sweep):
        volts, samples = records._fastest_tenth(each)
        assert volts == pytest.approx(30.0 * np.ptp(each) / 300.0) and samples == 6


def test_rates_of_sweeps_leave_out_short_ones_and_the_steepest():
    """Triangles of 10 V with one of 1 V between them; what lies before the first and behind the last turn is none."""
    corners = np.cumsum([0, 100, 50, 10, 10, 25, 200])
    drive = np.interp(np.arange(396), corners, [0.0, 10.0, 0.0, 1.0, 0.0, 10.0, 0.0])
    assert [samples for _, samples in records._sweeps(drive)] == pytest.approx([5, 3], abs=1)
    rates = records._sweep_rates(drive, 0.5)
    assert rates == pytest.approx([0.4, 0.8], rel=0.05)


def test_the_range_swept_and_where_95_per_cent_of_it_are():
    drive = np.array([5.0, 6.0, 4.0, 4.0, 10.0, 9.0, 24.0, 23.0, 25.0, *np.arange(10.0), 9.0])
    assert records._swept(drive).tolist() == [0, 1, 2, 2, 6, 6, 20, 20, 21, *[25] * 11]
    assert records.transient(drive) == 10
    assert records.transient(drive[:9]) == 4  # no more than half
    assert records.transient(np.array([0.0, 19.0, 20.0, 0.0, 0.0, 0.0])) == 2
    ramps = memory(drive, 5)
    assert ramps[4].tolist() == [1.0] * 8 and ramps[9].tolist() == [1.0] * 8
    assert ramps[2] == pytest.approx([1.0, 1.0, 2.0 / 0.75 - 2.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_rates_over_two_records_are_the_slowest_and_the_fastest_of_either():
    time = np.arange(4000) / 1000.0
    slow, fast = (of(a * np.sin(2 * np.pi * f * time), time**2, 1000.0) for a, f in ((2.0, 1.0), (3.0, 4.0)))
    both = si_records([fast, slow], Units())
    peaks = 2 * np.pi * np.array([2.0, 12.0])
    assert loop_rates(both) == pytest.approx(peaks, rel=0.01)
    assert fastest_rate(both) == fastest_rate(both[::-1]) == pytest.approx(peaks[1], rel=0.01)
    assert not records.one_rate_only(both) and records.one_rate_only(both[:1])


@pytest.mark.parametrize(
    ("second", "line", "steps"),
    [(0.0, 20, 20), (0.04, 20, 20), (0.06, 20, 2), (0.06, 8, 5), (-0.06, 8, 5), (0.06, 50, 1)],
)
def test_a_rate_is_smoothed_over_a_hundredth_of_the_period_of_the_highest_strong_line(second, line, steps):
    """Two periods of a sine in 4000 samples of 0.25 s, and a line of more or less than a twentieth of it."""
    turn = 2 * np.pi * np.arange(4000) / 4000
    drive = 7.0 + 3.0 * np.sin(2 * turn) + 3.0 * second * np.sin(line * turn)
    found = smoothed_rate(drive, 0.25)
    assert found.size == 4000 - steps
    inner = slice(1, 4000 - steps - 1)
    np.testing.assert_allclose(found[inner], (drive[steps:] - drive[:-steps])[inner] / (0.25 * steps), atol=3e-3)


def test_a_record_of_every_third_sample_keeps_its_name_and_begins_behind_its_start():
    made = SiRecord("r", "s", np.arange(20.0), 2.0 * np.arange(20.0), 0.5, 7)
    third = made.every(3)
    assert third.drive_v.tolist() == [0.0, 3.0, 6.0, 9.0, 12.0, 15.0, 18.0]
    assert third.output_rad.tolist() == [0.0, 6.0, 12.0, 18.0, 24.0, 30.0, 36.0]
    assert (third.name, third.sha256, third.step_s, third.start, third.used) == ("r", "s", 1.5, 3, 4)
    assert (made.every(7).start, made.every(8).start, made.every(1).start, made.used) == (1, 1, 7, 13)
    third.drive_v[0] = 5.0
    assert made.drive_v[0] == 0.0


@pytest.mark.parametrize(
    ("drive", "turns"),
    [
        ([0, 2, 4, 6, 8, 6, 4, 2, 0, 2, 4, 6, 8], [4, 8]),
        ([0, 2, 4, 6, 8, 8, 8, 6, 4, 2], [5]),
        ([0, 2, 4, 9, 4, 6, 8, 10, 12], []),
        ([8, 6, 4, 2, 0, 2, 4], [4]),
        ([1, 1, 1, 1, 1], []),
        ([0, 2, 4, 4, 3.9, 3.9, 4, 6, 8, 10], []),
        ([0, 2, 4, 4, 3.4, 3.4, 4, 6, 8, 10], [2, 4]),
    ],
)
def test_a_drive_reverses_where_it_goes_on_by_more_than_a_twentieth_of_its_range(drive, turns):
    assert records.turning_points(np.array(drive, dtype=float)).tolist() == turns


@pytest.mark.parametrize(
    ("drive", "first"),
    [
        ([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0], 10),
        ([0, 10, 5, 0, 10, 5, 0, 10, 5, 0], 2),
        ([5, 0, 9.5, 10, 0, 10, 0, 10, 0, 10], 3),
        ([5, 0, 9.4, 10, 0, 10, 0, 10, 0, 10], 4),
        ([3, 3, 3, 3], 1),
    ],
)
def test_a_record_is_judged_behind_where_its_drive_has_swept_95_per_cent_or_its_middle(drive, first):
    assert records.transient(np.array(drive, dtype=float)) == first


def test_of_many_sweeps_and_few_the_rates_of_the_few_count_in_either_order():
    """Two hundred sweeps at 157 V/s, three at 3 V/s and three at 314 V/s: each record's median is in the range."""
    time = np.arange(8000) / 2000.0
    many = of(np.sin(2 * np.pi * 25.0 * time), time**2, 2000.0)
    slow = of(np.sin(2 * np.pi * 0.5 * time), time**2, 2000.0)
    fast = of(10.0 * np.sin(2 * np.pi * 5.0 * time[:800]), time[:800] ** 2, 2000.0)
    for given in ([many, slow, fast], [slow, fast, many], [fast, many, slow]):
        assert loop_rates(si_records(given, Units())) == pytest.approx((np.pi, 100 * np.pi), rel=0.02)
    assert loop_rates(si_records([many], Units())) == pytest.approx((50 * np.pi, 50 * np.pi), rel=0.02)


def test_the_noisiest_of_two_drives_is_told_in_either_order():
    wave = 4.0 * np.sin(2 * np.pi * 20 * TIME)
    noise = 0.01 * truths.philox(1).standard_normal(wave.size)
    calm, noisy = (of(drive, wave, RATE, name) for name, drive in (("a", wave), ("b", wave + noise)))
    one, other = (noisiness(si_records(given, Units())) for given in ((calm, noisy), (noisy, calm)))
    assert one == other == pytest.approx(np.sqrt(2) * 0.01 * RATE / PEAK, rel=0.15)


@pytest.mark.parametrize(
    ("sweep", "fastest"),
    [([0.0, 5.0], (5.0, 1)), ([5.0, 0.0], (5.0, 1)), ([1.0, 7.0, 6.0], (6.0, 1)), ([7.0, 2.0, 3.0], (5.0, 1))],
)
def test_a_sweep_of_a_step_or_two_goes_from_its_first_sample_to_its_last(sweep, fastest):
    assert records._fastest_tenth(np.array(sweep)) == fastest


@pytest.mark.parametrize("arm", [0.0, -0.5, math.inf, -math.inf, math.nan])
@pytest.mark.parametrize("unit", ["mm", "urad"])
def test_a_lever_arm_is_a_length_above_nothing_with_an_end(unit, arm):
    assert told(Units, "V", unit, arm) == f"the lever arm is {arm!r} m; give a positive length in metres."


@pytest.mark.parametrize(("drive", "output"), [(0 * WAVE + 4.0, WAVE), (WAVE, 0 * WAVE), (0 * WAVE, 0 * WAVE)])
def test_a_drive_that_stands_still_is_refused_as_an_output_is(drive, output):
    assert told(si_records, [of(WAVE, WAVE, name="good"), of(drive, output)], Units()) == (
        "r: drive or output is constant in the part that is fitted."
    )
