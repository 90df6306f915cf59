"""A recorded motion of the line of sight from the files of a laboratory: its axes, its unit, and what is refused."""

import hashlib

import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose

from microrad.lab.recording import RecordingError, read_motion
from microrad.lab.recording.reader import read_signal

COUNT = 400
TIME = np.arange(COUNT) / 500.0
X, Y = np.sin(TIME), np.cos(3.0 * TIME)


def csv(path, heading, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=heading, comments="", fmt="%.12g")
    return path


@pytest.mark.promise("pointing-64")
def test_columns_but_the_time_are_axes_in_the_unit_that_each_states(tmp_path):
    motion = read_motion(csv(tmp_path / "jitter.csv", "time (s),x (urad),y [arcsec]", TIME, X, Y))
    assert motion.names == ("x (urad)", "y [arcsec]") and motion.rate_hz == pytest.approx(500.0, rel=1e-6)
    assert_allclose(motion.samples_rad[:, 0], 1e-6 * X, rtol=1e-9, atol=1e-18)
    assert_allclose(motion.samples_rad[:, 1], np.radians(Y / 3600.0), rtol=1e-9, atol=1e-18)


@pytest.mark.promise("pointing-64")
def test_an_array_has_the_rate_and_the_unit_that_are_given(tmp_path):
    np.save(tmp_path / "jitter.npy", np.column_stack([X, Y]))
    motion = read_motion(tmp_path / "jitter.npy", ("1",), 500.0, unit="mrad")
    assert motion.samples_rad.shape == (COUNT, 1)
    assert_allclose(motion.samples_rad[:, 0], 1e-3 * Y, rtol=1e-12)


@pytest.mark.promise("pointing-69")
@pytest.mark.parametrize(
    ("heading", "options", "words"),
    [
        ("time,x (V),y (urad)", {}, "column 1 ('x (V)') is in 'V', which is no angle; name channels of angles"),
        ("time,x (urad),y", {}, "column 2 ('y'): no unit is stated; give it (--unit, unit), 'urad' for example"),
        ("time,x (urad),y", {"axes": ("1",)}, None),
        ("time,x (urad),y (urad)", {"unit": "mrad"}, "is in 'urad' and mrad is given; leave out the unit"),
        ("time,x (urad),y (urad)", {"rate_hz": 400.0}, "two sample rates"),
        ("a (urad),b (urad),c (urad)", {}, "does not say how fast it was sampled; give the rate (--rate, rate_hz)"),
        ("time,x (urad),y (urad)", {"axes": ("x (urad)", "x (urad)")}, "2 channels ('x (urad)', 'x (urad)') as axes"),
        ("time,x (urad),y (urad)", {"axes": ("z",)}, "no axis"),
        ("time,x (urad),y", {"axes": ("2",), "unit": "V"}, "('y') is in 'V', which is no angle; name channels of"),
        ("time,Time (ms),sec", {}, "0 channels () as axes; name one to three that differ (--axes, axes)"),
    ],
)
def test_what_is_no_motion_of_the_line_of_sight_is_refused(tmp_path, heading, options, words):
    path = csv(tmp_path / "jitter.csv", heading, TIME, X, Y)
    if words is None:
        assert read_motion(path, **options).names == ("x (urad)",)
        return
    with pytest.raises(RecordingError) as refused:
        read_motion(path, **options)
    assert words in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.promise("pointing-64", "pointing-69")
def test_more_than_three_axes_gaps_and_samples_that_are_no_number_are_refused(tmp_path):
    four = csv(tmp_path / "four.csv", "a (urad),b (urad),c (urad),d (urad)", X, Y, X, Y)
    with pytest.raises(RecordingError, match=r"4 channels \('a \(urad\)', .*\) as axes; name one to three"):
        read_motion(four, rate_hz=500.0)
    gap = csv(tmp_path / "gap.csv", "time,x (urad)", np.where(TIME > 0.3, TIME + 0.1, TIME), X)
    with pytest.raises(RecordingError, match=r"1 gap, about 50 samples lost\. Cut the recording there"):
        read_motion(gap)
    np.save(tmp_path / "nan.npy", np.where(np.arange(COUNT) == 7, np.nan, X))
    with pytest.raises(RecordingError, match=r"sample 7 of .* is nan, 1 such sample in all; cut out a part"):
        read_motion(tmp_path / "nan.npy", rate_hz=500.0, unit="urad")
    shaken = csv(tmp_path / "shaken.csv", "time,x (urad)", TIME + 3e-4 * np.sin(40 * np.arange(COUNT)), X)
    with pytest.raises(RecordingError, match=r"the steps scatter by .* resample to a constant step"):
        read_motion(shaken)
    hardly = csv(tmp_path / "hardly.csv", "time,x (urad)", TIME + 3e-5 * np.sin(40 * np.arange(COUNT)), X)
    assert read_motion(hardly).rate_hz == pytest.approx(500.0, rel=1e-3)


@pytest.mark.promise("pointing-64")
@pytest.mark.parametrize("time", ["clock", 1])
def test_a_time_that_is_named_is_no_axis(tmp_path, time):
    path = csv(tmp_path / "jitter.csv", "x (urad),clock,y (urad),z (urad)", X, TIME, Y, X + Y)
    motion = read_motion(path, time=time)
    assert motion.names == ("x (urad)", "y (urad)", "z (urad)") and motion.rate_hz == pytest.approx(500.0, rel=1e-6)
    assert read_motion(path, (3, 0), time=time).names == ("z (urad)", "x (urad)")


@pytest.mark.promise("pointing-64")
def test_the_name_of_an_array_says_its_unit_and_the_number_of_a_column_does_not(tmp_path):
    np.savez(tmp_path / "a.npz", **{"x (arcsec)": X, "both": np.column_stack([X, Y])})
    motion = read_motion(tmp_path / "a.npz", ("x (arcsec)",), 500.0)
    assert_allclose(motion.samples_rad[:, 0], np.radians(X / 3600.0), rtol=1e-9, atol=1e-18)
    with pytest.raises(RecordingError, match=r"\('both\[1\]'\): no unit is stated; give it"):
        read_motion(tmp_path / "a.npz", ("both[1]",), 500.0)
    motion = read_motion(tmp_path / "a.npz", ("both[1]", "both[0]"), 500.0, unit="urad")
    assert_allclose(motion.samples_rad, 1e-6 * np.column_stack([Y, X]), rtol=1e-9, atol=1e-18)


def test_one_of_several_channels_is_read_as_a_signal_by_its_name(tmp_path):
    path = csv(tmp_path / "a.csv", "time,power (W),angle (urad)", TIME, X, Y)
    for channel in ("angle (urad)", 2, "2"):
        signal = read_signal(path, channel)
        assert (signal.name, signal.unit, signal.rate_hz) == ("angle (urad)", "urad", pytest.approx(500.0))
        assert_allclose(signal.samples, Y, atol=1e-11)
    with pytest.raises(
        RecordingError, match=r"the file has 2 channels beside its time \('power \(W\)', 'angle \(urad\)'\); name"
    ):
        read_signal(path)
    alone = read_signal(csv(tmp_path / "b.csv", "power (W)", X))
    assert (alone.name, alone.unit, alone.rate_hz) == ("power (W)", "W", None)
    assert read_signal(csv(tmp_path / "b.csv", "power (W)", X), rate_hz=40.0).rate_hz == 40.0


# -------------------------------------------------------------------------------------------------- refusals in full
@pytest.mark.parametrize(
    ("heading", "options", "words"),
    [
        (
            "time,x (urad),y (V)",
            {"axes": ("2",)},
            "column 2 ('y (V)') is in 'V', which is no angle; name channels of angles (--axes, axes), in urad or "
            "arcsec for example, or convert it.",
        ),
        (
            "time,x (urad),y",
            {"axes": (1, 2)},
            "column 2 ('y'): no unit is stated; give it (--unit, unit), 'urad' for example.",
        ),
        (
            "time,x (urad),y (mrad)",
            {"axes": (2, 1), "unit": "mrad"},
            "column 1 ('x (urad)') is in 'urad' and mrad is given; leave out the unit, or correct the file.",
        ),
        (
            "time,x (urad),y (urad)",
            {"axes": (2, 1, 2)},
            "3 channels ('y (urad)', 'x (urad)', 'y (urad)') as axes; name one to three that differ (--axes, axes).",
        ),
        (
            "time,x (urad),y (urad)",
            {"axes": (1, 2), "time": 1},
            "column 1 ('x (urad)') is the time and a signal; name another one.",
        ),
        (
            "time,x (urad),y (urad)",
            {"rate_hz": 622.08},
            "two sample rates: 622.08 Hz (given) and 500 Hz (column 0 ('time'): 400 samples in 0.798 s), 0.8038 times "
            "as much; correct the wrong one (leave the rate out to use that of the file).",
        ),
        (
            "a,x (urad),y (urad)",
            {"axes": (1,)},
            "the file does not say how fast it was sampled; give the rate (--rate, rate_hz) in Hz, or name the time "
            "column (time).",
        ),
        (
            "time,x (urad),y (urad)",
            {"rate_hz": 0},
            "the sample rate is 0; give the samples per second as a positive number in Hz.",
        ),
    ],
)
def test_a_motion_is_refused_in_all_words(tmp_path, heading, options, words):
    path = csv(tmp_path / "jitter.csv", heading, TIME, X, Y)
    with pytest.raises(RecordingError) as refused:
        read_motion(path, **options)
    assert str(refused.value) == f"{path}: {words}"


def test_units_that_are_one_by_other_names_agree_and_each_axis_has_its_own(tmp_path):
    path = csv(tmp_path / "jitter.csv", "time (ms),x (urad),y (mrad),z", 1e3 * TIME, X, Y, X + Y)
    motion = read_motion(path, (2, 1), rate_hz=500.2)
    assert (motion.names, motion.rate_hz, motion.path) == (("y (mrad)", "x (urad)"), 500.2, str(path))
    assert_allclose(motion.samples_rad, np.column_stack([1e-3 * Y, 1e-6 * X]), rtol=1e-9, atol=1e-18)
    alone = read_motion(path, ("z",), unit="arcsec")
    assert_allclose(alone.samples_rad[:, 0], np.radians((X + Y) / 3600.0), rtol=1e-9, atol=1e-18)
    assert read_motion(path, ("x (urad)",), unit="urad").rate_hz == pytest.approx(500.0, rel=1e-6)
    assert motion.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_a_gap_of_the_second_axis_is_named_by_its_line_and_counted(tmp_path):
    np.savez(tmp_path / "a.npz", x=X, y=np.where(np.isin(np.arange(COUNT), (31, 90, 91)), np.inf, Y), fs=500.0)
    with pytest.raises(RecordingError) as refused:
        read_motion(tmp_path / "a.npz", unit="urad")
    assert str(refused.value) == (
        f"{tmp_path / 'a.npz'}: sample 31 of channel 1 ('y') is inf, 3 such samples in all; cut out a part without "
        "them: what is filled in was not measured."
    )


def test_of_a_file_with_many_channels_ten_are_listed(tmp_path):
    np.savez(tmp_path / "a.npz", **{f"c{k}": X for k in range(12)}, fs=500.0)
    listed = ", ".join(f"'c{k}'" for k in range(10))
    with pytest.raises(RecordingError) as refused:
        read_motion(tmp_path / "a.npz", unit="urad")
    assert str(refused.value) == (
        f"{tmp_path / 'a.npz'}: 12 channels ({listed}) as axes; name one to three that differ (--axes, axes)."
    )
    with pytest.raises(RecordingError) as refused:
        read_signal(tmp_path / "a.npz")
    assert str(refused.value) == (
        f"{tmp_path / 'a.npz'}: the file has 12 channels beside its time ({listed}); name the one."
    )


def test_a_signal_has_the_rate_and_the_unit_of_its_own_channel(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["one/p"], file["two/p [mW]"] = X, Y[:30]
        file["one"].attrs["fs"], file["two"].attrs["dt"] = 40.0, 0.005
        file["one/p"].attrs["units"] = " W "
    first, second = read_signal(path, "one/p"), read_signal(path, "p [mW]")
    assert (first.name, first.unit, first.rate_hz, first.samples.size) == ("one/p", "W", 40.0, COUNT)
    assert (second.name, second.unit, second.rate_hz, second.samples.size) == ("two/p [mW]", "mW", 200.0, 30)
    assert_allclose(second.samples, Y[:30])
    assert not second.samples.flags.writeable and first.path == str(path)
    with pytest.raises(
        RecordingError, match=r"two sample rates: 41 Hz .given. and 40 Hz .one/fs = 40 Hz., 0.9756 times"
    ):
        read_signal(path, "one/p", 41.0)


def test_a_file_of_a_time_alone_has_no_signal(tmp_path):
    path = csv(tmp_path / "a.csv", "time (ms)", 1e3 * TIME)
    with pytest.raises(RecordingError) as refused:
        read_signal(path)
    assert str(refused.value) == f"{path}: the file has 0 channels beside its time (none); name the one."


@pytest.mark.parametrize("separator", [";", "\t", "  "])
def test_a_signal_beside_others_may_have_any_separator(tmp_path, separator):
    path = tmp_path / "a.csv"
    np.savetxt(path, np.column_stack([TIME, X, Y]), delimiter=separator, header=separator.join("tpq"), comments="")
    signal = read_signal(path, "q")
    assert (signal.name, signal.rate_hz) == ("q", pytest.approx(500.0))
    assert_allclose(signal.samples, Y)


def test_a_time_that_is_named_has_to_be_numbers_though_the_rate_is_given(tmp_path):
    path = tmp_path / "a.csv"
    rows = "".join(f"12:00:{t:06.3f},{x!r}\n" for t, x in zip(TIME, X.tolist(), strict=True))
    path.write_text("time,x (urad)\n" + rows)
    assert read_motion(path, ("x (urad)",), 400.0).rate_hz == 400.0  # what is only called so is passed over
    with pytest.raises(RecordingError, match=r"a\.csv: line 2, column 0 \('time'\): '12:00:00\.000' is not a number"):
        read_motion(path, ("x (urad)",), 400.0, time="time")
