"""Reversals and rates of a drive, which hang on no single step or spike, and which samples of a record are used."""

import numpy as np
import pytest

import truths
from microrad.lab.identify import fit_prandtl_ishlinskii, identify, predict, records
from microrad.lab.identify.records import (
    IdentificationError,
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
