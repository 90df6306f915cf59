"""What recordings serve for, where they are split, and what is said of what no fit has seen."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import truths
from microrad.lab.identify import IdentificationError, identify
from microrad.lab.identify.selection.predictions import Evidence, Prediction, evidence
from microrad.lab.identify.selection.roles import roles
from microrad.lab.identify.selection.splits import split_points, split_warnings
from microrad.lab.identify.selection.warnings import use_warnings
from microrad.lab.recording import Recording, recording_from_arrays

RATE = 2000.0
PLAYS = ("prandtl_ishlinskii",)


def loop(periods, freq_hz=2.0, name="loop", noise=2e-4):
    """One to nine volts and back, `periods` times, from the middle upwards."""
    time = np.arange(round(periods * RATE / freq_hz)) / RATE
    drive = 5.0 + 4.0 * np.sin(2 * np.pi * freq_hz * time)
    return truths.recorded(drive, truths.plays(drive, [0.0, 0.8, 2.1], [6e-5, 2e-5, 1e-5]), RATE, noise, name=name)


def growing(amplitudes, name="growing"):
    sines = np.sin(2 * np.pi * 2.0 * np.arange(2000) / RATE)  # two periods
    drive = 5.0 + np.concatenate([amplitude * sines for amplitude in amplitudes])
    return truths.recorded(drive, truths.plays(drive, [0.0, 0.8, 2.1], [6e-5, 2e-5, 1e-5]), RATE, 2e-4, name=name)


def wide(periods=3, name="wide", rate_hz=RATE, seed=5):
    drive = truths.small_multisine(rate_hz, 2000, periods, rms=0.05, highest=0.3, seed=seed)
    output = 8e-5 * truths.behind_resonance(drive, rate_hz, held=True)
    return truths.recorded(drive, output, rate_hz, 2e-3, name=name, period=2000)


# -------------------------------------------------------------------------------------------------------------- splits
@pytest.mark.promise("identify-8")
def test_one_period_is_split_where_the_drive_has_swept_its_range():
    """Its first half goes from 5 V to 9 V and back, and says nothing of 1 V."""
    one = loop(1)
    found = identify([one], models=PLAYS)
    assert (round(found.drive_min_v, 1), round(found.drive_max_v, 1)) == (1.1, 9.0)
    (source,) = found.sources
    assert 0.7 * one.samples < source.fitted < 0.75 * one.samples
    (told,) = [w for w in found.warnings if "are held out instead of half" in w]
    assert told.startswith("loop: the last 28 %")
    half = identify([one], models=PLAYS, hold_out=0.5)
    assert half.drive_min_v == pytest.approx(5.0, abs=0.1)
    (told,) = [w for w in half.warnings if "the fitted part sweeps" in w]
    assert "sweeps 5 V to 9 V of the 1 V to 9 V that were recorded; hold less out" in told


@pytest.mark.promise("identify-8")
def test_a_growing_loop_is_split_behind_its_largest_sweep_and_others_in_the_middle():
    assert split_points([growing([1, 2, 3, 4])], None, validated=False) == [pytest.approx(6000 + 720, abs=30)]
    assert split_points([growing([4, 3, 2, 1]), loop(7)], None, validated=False) == [4000, 3500]
    assert split_points([growing([1, 2, 3, 4])], 0.5, validated=False) == [4000]
    assert split_points([growing([1, 2, 3, 4])], None, validated=True) == [8000]
    late = np.concatenate([np.ones(9900), np.full(100, 4.0)])
    too_late = recording_from_arrays(late, late, RATE)
    assert split_points([too_late], None, validated=False) == [5000]
    found = identify([growing([1, 2, 3, 4])], models=PLAYS)
    assert not any("lie outside the fitted drive range" in w for w in found.warnings)


def of_drive(drive):
    """A recording of any length, unchecked."""
    column = np.asarray(drive, dtype=float)[:, None]
    return Recording("record", "", column, column.copy(), RATE, ("u",), ("y",))


@pytest.mark.parametrize(
    ("samples", "hold_out", "validated", "split"),
    [
        (200, 0.5, False, 100),
        (199, 0.5, False, None),
        (198, 0.5, False, None),
        (1000, 0.1, False, 900),
        (1000, 0.101, False, 899),
        (999, 0.1, False, 899),
        (900, 0.1, False, None),
        (1000, 0.9, False, 100),
        (990, 0.9, False, None),
        (100, 0.0, True, 100),
        (99, 0.0, True, None),
    ],
)
def test_each_part_has_a_hundred_samples_or_the_split_is_refused(samples, hold_out, validated, split):
    record = of_drive(np.sin(np.arange(samples)))
    if split is not None:
        assert split_points([record], hold_out, validated=validated) == [split]
        return
    with pytest.raises(IdentificationError, match=r"^record: \d+ samples to fit and \d+ to check; each part needs at "):
        split_points([record], hold_out, validated=validated)


@pytest.mark.parametrize("validated", [False, True])
@pytest.mark.parametrize("hold_out", [-0.1, 0.0, 1.0, 1.5, float("nan")])
def test_a_share_that_is_none_is_refused_and_nothing_is_one_beside_validation(hold_out, validated):
    record = of_drive(np.sin(np.arange(1000)))
    if validated and hold_out == 0.0:
        assert split_points([record], hold_out, validated=True) == [1000]
        return
    with pytest.raises(IdentificationError, match=r"^--hold-out \(hold_out\) is .*; give the share of each recording"):
        split_points([record], hold_out, validated=validated)


@pytest.mark.parametrize(
    ("drive", "split"),
    [
        ([0, *[9] * 1999, *[10] * 2000], 2000),  # nine tenths by the middle are enough
        ([0, *[8.99] * 1999, *[10] * 2000], 2001),
        ([0, *[8.9] * 1999, *[9.89] * 500, *[9.9] * 500, *[10] * 1000], 2501),  # it ends where 99 % are swept
        ([0, *[5] * 3798, *[10] * 201], 3800),  # a twentieth is left to judge by
        ([0, *[5] * 3799, *[10] * 200], 2000),
        ([0, *[5] * 898, *[10] * 101], 900),  # a hundred samples are left
        ([0, *[5] * 899, *[10] * 100], 500),
    ],
)
def test_the_split_waits_for_nine_tenths_of_the_range_while_enough_is_left(drive, split):
    assert split_points([of_drive(drive)], None, validated=False) == [split]


def test_a_split_behind_the_middle_is_told_and_so_is_a_part_of_the_range():
    def told(drive, split, volts=1.0):
        return split_warnings([of_drive(drive)], [split], volts)

    late = [0, *[5] * 2498, *[10] * 1501]
    assert split_points([of_drive(late)], None, validated=False) == [2500]
    assert told(late, 2500) == [
        "record: the last 38 % are held out instead of half, because only then has the drive swept its range in the "
        "fitted part."
    ]
    assert told(late, 2499) == [
        "record: the fitted part sweeps 0 V to 5 V of the 0 V to 10 V that were recorded; hold less out, record more "
        "periods, or give another recording for validation."
    ]
    assert "sweeps 0 V to 0.005 V of the 0 V to 0.01 V" in told(late, 2499, 1e-3)[0]
    assert told(late, 3000) == []  # as it was asked for
    assert told([0, *[8.9] * 1999, *[10] * 2000], 2001) == []  # a sample behind the middle is no other split
    assert told(late, 4000) == []  # nothing is held out
    nine_tenths = [0, *[9] * 1999, *[10] * 2000]
    assert told(nine_tenths, 2000) == told(nine_tenths, 1000) == []
    assert len(told([0, *[8.99] * 1999, *[10] * 2000], 2000)) == 1


# --------------------------------------------------------------------------------------------------------------- roles
@pytest.mark.promise("identify-3")
def test_a_role_goes_before_what_the_drive_looks_like():
    sine, small, large = loop(4), wide(), replace(wide(), path="large", drive=wide().drive * 30)
    assert roles([sine, small]).broadband == [small]
    as_loop = replace(small, role="loops")
    assert roles([sine, as_loop]) == ([], [], [sine, as_loop])
    as_wide = replace(large, role="broadband")
    assert roles([sine, large]).broadband == []
    assert roles([sine, as_wide]).response == [as_wide]
    assert roles([as_wide, small]) == ([as_wide, small], [as_wide, small], [small])


@pytest.mark.promise("identify-3")
def test_a_role_that_a_drive_contradicts_is_refused():
    with pytest.raises(IdentificationError, match=r"loop: its role is broadband and its drive is a sine.* role loops"):
        roles([replace(loop(4), role="broadband"), growing([1, 4])])
    with pytest.raises(IdentificationError, match=r"wide: every recording has the role broadband.*leave the role of"):
        roles([replace(wide(), role="broadband")])
    with pytest.raises(IdentificationError, match=r"loop: every recording has the role validation"):
        identify([replace(loop(4), role="validation")])
    with pytest.raises(IdentificationError, match=r"loop: it is given for validation and its role is loops"):
        identify([growing([1, 4])], validation=[replace(loop(4), role="loops")])


@pytest.mark.promise("identify-8")
def test_a_recording_for_validation_is_seen_by_no_fit():
    found = identify([growing([1, 4]), replace(loop(4), role="validation")], models=PLAYS)
    assert [(s.path, s.role, s.fitted, s.held_out) for s in found.sources] == [
        ("growing", "loops", 4000, 0),
        ("loop", "validation", 0, 4000),
    ]


@pytest.mark.promise("identify-3")
def test_a_narrow_drive_may_be_broadband_by_its_role_and_is_told():
    """A multisine of half a decade about a resonance."""
    time = np.arange(8000) / RATE
    lines = range(100, 320, 20)
    drive = 5.0 + 0.02 * sum(np.cos(2 * np.pi * f * time + 0.3 * f**1.5) for f in lines)
    narrow = truths.recorded(drive, 8e-5 * truths.behind_resonance(drive, RATE, held=True), RATE, name="narrow")
    assert roles([loop(4), narrow]).broadband == []
    served = roles([loop(4), replace(narrow, role="broadband")])
    assert [r.path for r in served.response] == ["narrow"]
    (told,) = use_warnings(served, linear=True)
    assert told.startswith("narrow: broadband as its role says, though its drive does not fill a decade")


# ------------------------------------------------------------------------------------------------- what no fit has seen
@pytest.mark.promise("identify-3")
def test_what_is_fitted_by_nothing_is_told():
    slow = wide(name="slow", rate_hz=1000.0)
    served = roles([loop(4), wide(), slow])
    (told,) = use_warnings(served, linear=True)
    assert told.startswith("slow: broadband, and fitted by nothing: only recordings at the highest sample rate")
    unasked = use_warnings(served, linear=False)
    assert [t.partition(":")[0] for t in unasked] == ["wide", "slow"]
    assert all("no model with a linear part was asked for" in t for t in unasked)
    assert use_warnings(roles([loop(4), wide(), wide(name="twin", seed=6)]), linear=True) == []
    found = identify([loop(4), wide()], models=PLAYS)
    assert any(w.startswith("wide: broadband, and fitted by nothing") for w in found.warnings)


@pytest.mark.promise("identify-4")
def test_one_period_of_a_multisine_is_fitted_as_a_drive_that_does_not_repeat():
    found = identify([loop(6), wide(1)], models=("linear",))
    assert found.linear.fit_percent[0] > 90
    assert found.linear.response.freq_hz.size > 30
    (told,) = [w for w in found.warnings if "one period only" in w]
    assert told.startswith("wide: one period only, so it is fitted as a drive that does not repeat; record two periods")
    assert {s.path: s.fitted for s in found.sources}["wide"] == 2000
    pair = roles([loop(6), wide(1), wide(1, name="twin", seed=6)])
    assert use_warnings(pair, linear=True) == []


@pytest.mark.promise("identify-9")
def test_the_choice_says_what_it_rests_on_and_names_the_worst_recording():
    quiet, noisy = loop(4, name="a/quiet.csv"), loop(8, freq_hz=4.0, name="b/noisy.csv", noise=3e-3)
    found = identify([quiet, noisy], models=PLAYS)
    assert "It rests on 2 s of 2 recordings, quiet.csv (1 s) and noisy.csv (1 s); the worst of all" in found.reason
    error = 1e6 * np.std(found.predictions[0][1].residual_rad[found.predictions[0][1].start :])
    assert f"the worst of all recordings is noisy.csv, with {error:.3g} µrad rms and " in found.reason
    four = [replace(quiet, path=f"{k}") for k in range(4)]
    ends = Prediction(np.zeros(4000), np.full(4000, 1e-6), 0, 3000, 0)
    assert evidence(four, [ends] * 4).text == "2 s of 4 recordings"
    assert evidence(four[:2], [replace(ends, split=4000), ends]).text == "0.5 s of 1 recording, 1 (0.5 s)"


def test_an_identification_goes_to_another_process_whole():
    found = identify([loop(6), wide()], models=("prandtl_ishlinskii", "linear"))
    again = pickle.loads(pickle.dumps(found))
    assert again.reason == found.reason
    assert again.scores == found.scores
    assert again.warnings == found.warnings
    for a, b in zip(again.fits, found.fits, strict=True):
        drive = found.recordings[0].drive[:, 0]
        np.testing.assert_array_equal(a.response(drive, 1 / RATE)[0], b.response(drive, 1 / RATE)[0])
    np.testing.assert_array_equal(again.predictions[1][0].model_rad, found.predictions[1][0].model_rad)


def test_a_share_that_leaves_too_little_of_the_second_record_is_told_in_full():
    long, short = of_drive(np.sin(np.arange(1000))), replace(of_drive(np.sin(np.arange(333))), path="short")
    with pytest.raises(IdentificationError) as caught:
        split_points([long, short], 0.25, validated=True)
    assert str(caught.value) == (
        "short: 250 samples to fit and 83 to check; each part needs at least 100; record longer or choose hold_out "
        "nearer to 0.5."
    )
    with pytest.raises(IdentificationError) as caught:
        split_points([long], 1.25, validated=True)
    assert str(caught.value) == (
        "--hold-out (hold_out) is 1.25; give the share of each recording kept for the check, between 0 and 1, "
        "e.g. 0.5, or 0 with recordings for validation."
    )
    assert split_points([long, replace(short, path="other")], 0.4, validated=False) == [600, 200]


def test_of_two_records_only_the_one_split_too_early_is_told_with_its_own_drives():
    wave = 5.0 + 4.0 * np.sin(2 * np.pi * np.arange(1000) / 100)
    rising = np.concatenate([wave[:600] / 2, -3.0 * wave[600:]])
    assert split_warnings([of_drive(wave), replace(of_drive(rising), path="rising")], [500, 600], 0.001) == [
        "rising: the fitted part sweeps 0.0005 V to 0.0045 V of the -0.027 V to 0.0045 V that were recorded; hold less "
        "out, record more periods, or give another recording for validation."
    ]


def test_the_worst_recording_is_the_one_of_the_largest_rms_from_where_it_counts():
    """The second one is farthest off before its first 10 samples, the third one has the largest peak."""
    given = [replace(of_drive(np.arange(100.0)), path=f"in/{name}.csv", rate_hz=rate) for name, rate in OF_RATES]
    left = np.zeros((4, 100))
    left[0, 20:], left[1, :10], left[2, 50], left[3] = 2e-6, 1.0, 9e-6, 1e-6
    seen = [Prediction(np.zeros(100), each, 10, split, 0) for each, split in zip(left, (60, 100, 80, 0), strict=True)]
    found = evidence(given, seen)
    assert found.judged == (("a.csv", pytest.approx(0.4)), ("c.csv", pytest.approx(0.4)), ("d.csv", pytest.approx(0.5)))
    assert found.text == "1.3 s of 3 recordings, a.csv (0.4 s) and c.csv (0.4 s) and d.csv (0.5 s)"
    assert (found.worst, found.worst_peak_rad) == ("a.csv", pytest.approx(2e-6))
    assert found.worst_rms_rad == pytest.approx(2e-6 * np.sqrt(80 / 90))


OF_RATES = ("a", 100.0), ("b", 10.0), ("c", 50.0), ("d", 200.0)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        ((2.0,), "2 s of 1 recording, r0 (2 s)"),
        ((2.0, 0.25), "2.25 s of 2 recordings, r0 (2 s) and r1 (0.25 s)"),
        ((1.0, 2.0, 4.0), "7 s of 3 recordings, r0 (1 s) and r1 (2 s) and r2 (4 s)"),
        ((1.0, 2.0, 4.0, 8.0), "15 s of 4 recordings"),
    ],
)
def test_what_is_judged_is_named_up_to_three_recordings(seconds, text):
    assert Evidence(tuple((f"r{k}", each) for k, each in enumerate(seconds)), "r0", 1.0, 2.0).text == text


@pytest.mark.parametrize(("hold_out", "validated"), [(1.5, False), (0.0, False), (-0.25, True)])
def test_a_share_that_is_none_is_told_in_all_words(hold_out, validated):
    with pytest.raises(IdentificationError) as refused:
        split_points([of_drive(np.sin(np.arange(1000)))], hold_out, validated=validated)
    assert str(refused.value) == (
        f"--hold-out (hold_out) is {hold_out}; give the share of each recording kept for the check, between 0 and 1, "
        "e.g. 0.5, or 0 with recordings for validation."
    )


@pytest.mark.parametrize(("rest", "split", "told"), [(499, 500, False), (500, 501, False), (501, 502, True)])
def test_a_split_one_sample_behind_the_middle_is_still_in_the_middle(rest, split, told):
    """A drive that is at 10 V for the first time behind so many samples."""
    drive = of_drive([0] * rest + [10] * (1000 - rest))
    assert split_points([drive], None, validated=False) == [split]
    words = (
        "record: the last 50 % are held out instead of half, because only then has the drive swept its range in the "
    )
    assert split_warnings([drive], [split], 1.0) == ([f"{words}fitted part."] if told else [])
