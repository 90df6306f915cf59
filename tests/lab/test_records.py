"""Reversals and rates of a drive, which hang on no single step or spike, and which samples of a record are used."""

import numpy as np
import pytest

import truths
from microrad.lab.identify import identify
from microrad.lab.identify.records import (
    IdentificationError,
    Units,
    fastest_rate,
    loop_rates,
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
def test_a_step_to_the_first_sample_of_a_sine_is_no_reason_to_refuse_it():
    output = truths.plays(FROM_REST, [0.0, 0.6, 1.9], [6e-5, 1.5e-5, 1e-5])
    found = identify([truths.recorded(FROM_REST, output, RATE)], models=("prandtl_ishlinskii",))
    assert found.score().held_out_rms_percent < 0.2  # the noise is 0.1 %
    assert found.rate_limit_v_per_s == pytest.approx(PEAK, rel=0.01)
    assert any("One loop rate only" in text for text in found.warnings)
    assert not any("noisy" in text for text in found.warnings)


@pytest.mark.parametrize("samples", [6400, 7000, 14_000])
def test_one_step_is_neither_the_rate_of_the_loops_nor_their_limit(samples):
    records = prepared(FROM_REST[:samples])
    assert np.abs(smoothed_rate(records[0].drive_v, 1 / RATE)).max() > 10 * PEAK
    assert fastest_rate(records) == pytest.approx(PEAK, rel=0.01)
    assert loop_rates(records) == pytest.approx((PEAK, PEAK), rel=0.01)


def test_one_spike_changes_nothing():
    drive = 5.0 + 4.0 * np.sin(2 * np.pi * 20 * TIME)
    spiked = drive.copy()
    spiked[5000] += 40.0
    assert turning_points(spiked).tolist() == pytest.approx(turning_points(drive).tolist(), abs=1)
    assert fastest_rate(prepared(spiked)) == pytest.approx(fastest_rate(prepared(drive)), rel=1e-3)
    assert loop_rates(prepared(spiked)) == pytest.approx(loop_rates(prepared(drive)), rel=1e-3)


def test_reversals_stand_where_the_drive_turns_and_noise_makes_none():
    drive = 5.0 + 4.0 * np.sin(2 * np.pi * 20 * TIME)
    turns = np.arange(250, 14_000, 500)  # a quarter of a period, then each half
    assert_close = pytest.approx(turns.tolist(), abs=40)
    for noise in (0.0, 0.05):
        found = turning_points(drive + noise * truths.philox(1).standard_normal(drive.size))
        assert found.tolist() == assert_close
    assert turning_points(np.linspace(0.0, 1.0, 500)).size == 0
    with pytest.raises(IdentificationError, match="never reverses"):
        prepared(np.linspace(0.0, 1.0, 500))


def test_fast_edges_of_a_staircase_keep_their_rate():
    """Edges of 3 V and 6 V in 5 ms, with 2 s of rest between them."""
    levels, time = [6, 9, 12, 6, 0, 6], np.arange(12_000) / 1000.0
    corners = [t for k in range(6) for t in (2 * k + 0.005 * (k > 0), 2 * k + 2)]
    drive = np.interp(time, corners, np.repeat(levels, 2))
    assert fastest_rate(prepared(drive, 1000.0)) == pytest.approx(1200.0, rel=0.01)
    assert loop_rates(prepared(drive, 1000.0))[1] == pytest.approx(1200.0, rel=0.01)


def test_noise_of_the_drive_is_told_by_its_median_size():
    drive = 5.0 + 4.0 * np.sin(2 * np.pi * 20 * TIME)
    assert noisiness(prepared(FROM_REST)) < 0.01
    noisy = drive + 0.01 * truths.philox(1).standard_normal(drive.size)
    assert noisiness(prepared(noisy)) == pytest.approx(np.sqrt(2) * 0.01 * RATE / PEAK, rel=0.15)
