"""What the page that looks on is shown of a fit: two periods of each loop, and the extremes of its residual."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from microrad.lab import live_fit
from microrad.lab.identify.selection.predictions import Prediction
from microrad.lab.recording import Recording

STEP_S = 0.01


def judged(periods=5, samples=100, start=20, split=60, count=1):
    """A sine of some periods in each recording; the model leaves a ramp, and 9 rad before it counts."""
    time = np.arange(samples) / samples
    drive = 3.0 + np.sin(2.0 * np.pi * periods * time)
    left = np.where(np.arange(samples) < start, 9.0, 1e-3 * np.arange(samples))
    made = [
        Recording(f"folder/r{k}.csv", "", drive[:, None], drive[:, None], 1.0 / STEP_S, ("u",), ("y",))
        for k in range(count)
    ]
    predictions = tuple(Prediction(5.0 * drive, 5.0 * drive + left, start, split, 0) for _ in range(count))
    score = SimpleNamespace(fit_rms_percent=1.5, held_out_rms_percent=2.5)
    return SimpleNamespace(model="plays", score=score, predictions=predictions, recordings=tuple(made))


@pytest.mark.parametrize(("periods", "shown"), [(5, 40), (4, 50), (2, 100), (1, 100)])
def test_the_last_two_periods_of_the_drive_are_shown(periods, shown):
    of = judged(periods)
    (loop,) = live_fit.thin_fit(of).loops
    assert loop.name == "r0.csv"
    assert loop.drive == pytest.approx(of.recordings[0].drive[-shown:, 0], rel=1e-6)
    assert loop.measured_rad == pytest.approx(of.predictions[0].measured_rad[-shown:], rel=1e-6)
    assert loop.model_rad == pytest.approx(of.predictions[0].model_rad[-shown:], rel=1e-6)


def test_the_residual_is_shown_from_where_it_counts_with_its_times():
    (loop,) = live_fit.thin_fit(judged()).loops
    assert loop.time_s == pytest.approx(STEP_S * np.arange(20, 100))
    assert loop.residual_rad == pytest.approx(1e-3 * np.arange(20, 100), rel=1e-6)
    assert loop.split_s == pytest.approx(0.6)


def test_six_recordings_are_shown_with_the_errors_of_the_model():
    of = judged(count=8)
    of.predictions = tuple(replace(each, split=60 + k) for k, each in enumerate(of.predictions))
    found = live_fit.thin_fit(of)
    assert [loop.split_s for loop in found.loops] == pytest.approx([0.6, 0.61, 0.62, 0.63, 0.64, 0.65])
    assert [loop.name for loop in found.loops] == [f"r{k}.csv" for k in range(6)]
    assert (found.model, found.fit_rms_percent, found.held_out_rms_percent) == ("plays", 1.5, 2.5)


@pytest.mark.parametrize("samples", [9, 10, 11, 1000])
def test_of_a_long_column_the_extremes_of_each_stretch_are_kept_and_a_short_one_whole(samples):
    falling, spiked = -np.arange(samples, dtype=float), np.zeros(samples)
    spiked[samples // 2], spiked[samples // 3] = 7.0, -7.0
    rows = live_fit.extremes([falling, spiked], 10)
    if samples <= 10:
        assert rows.tolist() == list(range(samples))
        return
    assert np.all(np.diff(rows) > 0) and {0, samples - 1, samples // 2, samples // 3} <= {*rows.tolist()}
    assert len(rows) <= 2 * 10 + 2
    inner = np.where(np.arange(samples) == 1, 3.0, np.where(np.arange(samples) == samples - 2, -3.0, 0.0))
    inner[0], inner[-1] = 1.0, -1.0  # neither end is an extreme of a long stretch
    inner[2:-2] -= np.linspace(1.0, 0.9, samples - 4)
    assert {0, 1, samples - 2, samples - 1} <= {*live_fit.extremes([inner], 10).tolist()}
    edges = np.linspace(0, samples, 6).astype(int)
    assert {*edges[:-1].tolist(), *(edges[1:] - 1).tolist()} <= {*rows.tolist()}


def test_a_fit_is_added_to_the_file_beside_the_progress_and_nowhere_without_one(tmp_path):
    live_fit.live_fit_writer(None)(judged())
    live_fit.live_fit_writer("")(judged())
    write = live_fit.live_fit_writer(str(tmp_path / "progress"))
    for _ in range(2):
        write(judged())
    assert [path.name for path in tmp_path.iterdir()] == [live_fit.LIVE_FITS]
    first, second = (tmp_path / live_fit.LIVE_FITS).read_text(encoding="ascii").splitlines()
    assert first == second and '"model": "plays"' in first
    live_fit.live_fit_writer(str(tmp_path / "missing" / "progress"))(judged())
    assert not Path(tmp_path / "missing").exists()


def test_digits_of_a_curve_are_seven():
    assert live_fit._digits([1.23456789, -0.00012345678]) == (1.234568, -0.0001234568)


def test_a_drive_about_a_large_bias_has_its_own_period_and_a_long_one_is_thinned():
    """Of 4000 samples in 4 periods the last 2000, of which 600 are shown."""
    of = judged(4, samples=4000, start=100, split=3000)
    of.recordings[0].drive[:] += 1000.0
    (loop,) = live_fit.thin_fit(of).loops
    rows = np.unique(np.linspace(2000, 3999, 600).astype(int))
    assert loop.drive == pytest.approx(of.recordings[0].drive[rows, 0], rel=1e-6)
    assert loop.model_rad == pytest.approx(of.predictions[0].model_rad[rows], rel=1e-6)
    assert (loop.time_s[0], loop.time_s[-1]) == pytest.approx((1.0, 39.99))
    assert (loop.residual_rad[0], loop.residual_rad[-1]) == pytest.approx((0.1, 3.999))
    assert 500 < len(loop.time_s) == len(loop.residual_rad) <= 602 and loop.split_s == pytest.approx(30.0)


def test_extremes_of_two_columns_are_those_of_either():
    one, other = np.zeros(40), np.zeros(40)
    one[[3, 25]], other[[6, 33]] = (5.0, -5.0), (-4.0, 4.0)
    assert {3, 6, 25, 33} <= {*live_fit.extremes([one, other], 4).tolist()}
    assert live_fit.extremes([one, other], 4).tolist() == [0, 3, 6, 20, 25, 33, 39]


def test_a_line_of_the_file_has_every_number_of_each_loop_by_its_name(tmp_path):
    """Two loops of five periods of twenty samples; what is drawn has seven digits."""
    one = judged(count=2)
    one.recordings = (one.recordings[0], replace(one.recordings[1], path="b/other.csv", rate_hz=50.0))
    one.predictions = (one.predictions[0], replace(one.predictions[1], start=10, split=90))
    write = live_fit.live_fit_writer(str(tmp_path / "progress"))
    write(one)
    write(judged(count=1))
    first, second = (json.loads(line) for line in (tmp_path / "fits").read_text(encoding="ascii").splitlines())
    assert list(first) == ["model", "fit_rms_percent", "held_out_rms_percent", "loops"]
    assert [first[key] for key in list(first)[:3]] == ["plays", 1.5, 2.5]
    keys = ["name", "drive", "measured_rad", "model_rad", "time_s", "residual_rad", "split_s"]
    assert [list(loop) for loop in first["loops"]] == [keys, keys]
    assert [(loop["name"], loop["split_s"]) for loop in first["loops"]] == [("r0.csv", 0.6), ("other.csv", 1.8)]
    assert [(loop["time_s"][0], loop["time_s"][-1]) for loop in first["loops"]] == [(0.2, 0.99), (0.2, 1.98)]
    assert first["loops"][1]["residual_rad"] == [*[9.0] * 10, *(float(f"{1e-3 * k:.7g}") for k in range(20, 100))]
    assert first["loops"][0]["drive"] == [float(f"{3 + np.sin(0.1 * np.pi * k):.7g}") for k in range(60, 100)]
    assert len(second["loops"]) == 1


def test_a_drive_of_many_samples_and_its_residual_are_thinned_to_six_hundred_with_both_ends():
    one = judged(periods=2, samples=5000, start=100)
    residual = np.zeros(5000)
    residual[[99, 101, 2345, 4998]] = 7.0, -3.0, 5.0, 2.0
    one.predictions = (replace(one.predictions[0], model_rad=one.predictions[0].measured_rad - residual),)
    (loop,) = live_fit.thin_fit(one).loops
    assert len(loop.drive) == len(loop.model_rad) == 600
    assert loop.drive[0] == 3.0 and loop.drive[-1] == float(f"{one.recordings[0].drive[-1, 0]:.7g}")
    at = dict(zip(loop.time_s, loop.residual_rad, strict=True))
    assert [round(each, 9) for each in at.values() if abs(each) > 1e-9] == [-3.0, 5.0, 2.0]
    assert at[1.01] == pytest.approx(-3.0) and at[23.45] == pytest.approx(5.0) and at[49.98] == pytest.approx(2.0)
    assert (min(at), max(at)) == (1.0, 49.99)


@pytest.mark.parametrize(("samples", "points"), [(10, 10), (11, 10), (12, 4), (0, 4), (1, 4), (13, 5), (601, 600)])
def test_of_a_column_that_stays_where_it_is_the_ends_and_the_begins_of_its_stretches_are_kept(samples, points):
    rows = live_fit.extremes([np.zeros(samples)], points)
    edges = np.linspace(0, samples, points // 2 + 1).astype(int)[:-1]
    expected = set(range(samples)) if samples <= points else {*edges.tolist(), samples - 1}
    assert rows.tolist() == sorted(expected)
