"""Playing a plan: noise, converters and sensor as the plan says, and its files as libraries read them."""

import errno
import hashlib
import json
import math
import zlib
from dataclasses import replace
from pathlib import Path

import h5py
import lvm_read
import numpy as np
import pytest
import scipy.io
from nptdms import TdmsFile

from bench_of_two_axes import LIMITS_AND_BENCH
from microrad.core.folder import FolderError
from microrad.lab.bench import folder as bench_folder
from microrad.lab.bench import load_plan, play, select_records, write_folder
from microrad.lab.bench.mirrors import bouc_wen_output, linear_output
from microrad.lab.bench.plan import FORMATS, PlanError
from microrad.lab.bench.play import BenchError, Converter, _check_range, true_output
from microrad.lab.recording import Recording, RecordingError, read_recording

SEED = 5


@pytest.fixture(scope="module")
def paper():
    return load_plan("paper-experiment")


@pytest.fixture(scope="module")
def short(paper):
    """One quick record of the paper's experiment."""
    return select_records(paper, ["loop-100hz"])


def with_sensor(plan, **changes):
    """The plan with other keys of its bench; those of the sensor and the converters by prefix."""
    sensor = {k[7:]: v for k, v in changes.items() if k.startswith("sensor_")}
    converters = {k[11:]: v for k, v in changes.items() if k.startswith("converters_")}
    parts = {
        "sensor": plan.bench.sensor.model_copy(update=sensor),
        "converters": plan.bench.converters.model_copy(update=converters),
    }
    return replace(plan, bench=plan.bench.model_copy(update=parts))


def quiet(plan):
    return with_sensor(plan, sensor_noise_rad=0.0, sensor_mains_rad=0.0, sensor_drift_rad_s=0.0)


# ---- what a recording holds
@pytest.mark.promise("bench-1", "bench-2", "bench-13")
def test_a_recording_is_in_volts_and_mrad_with_its_names(short):
    (recording,) = play(short, SEED)
    assert (recording.path, recording.input_names, recording.output_names) == ("loop-100hz", ("drive",), ("angle",))
    assert (recording.rate_hz, recording.samples, recording.period_samples) == (50e3, 6000, 500)
    assert recording.drive.shape == recording.output.shape == (6000, 1)
    assert not recording.drive.flags.writeable
    assert not recording.output.flags.writeable
    assert 0.95 < recording.output[1000:].max() < 1.15
    digest = hashlib.sha256(recording.drive.tobytes() + recording.output.tobytes()).hexdigest()
    assert recording.sha256 == digest


@pytest.mark.promise("bench-8")
def test_the_same_seed_gives_the_same_samples_and_another_one_others(paper):
    plan = select_records(paper, ["loop-60hz", "loop-100hz"])
    one, again, other = play(plan, 1), play(plan, 1), play(plan, 2)
    for a, b, c in zip(one, again, other, strict=True):
        assert np.array_equal(a.drive, b.drive)
        assert np.array_equal(a.output, b.output)
        assert np.array_equal(a.drive, c.drive)
        assert not np.array_equal(a.output, c.output)
    (alone,) = play(select_records(paper, ["loop-100hz"]), 1)
    assert np.array_equal(alone.output, one[1].output)  # a record's noise does not depend on the others
    noise = [r.output[:6000] - true_output(plan, p)[1][:6000] for r, p in zip(one, plan.records, strict=True)]
    assert abs(np.corrcoef(noise[0][:, 0], noise[1][:, 0])[0, 1]) < 0.1
    with pytest.raises(BenchError, match="the seed is -1; give a whole number of at least 0"):
        play(plan, -1)


# ---- sensor and converters
@pytest.mark.promise("bench-5")
def test_noise_is_a_share_of_the_outputs_rms_about_its_mean(paper):
    plan = select_records(paper, ["chirp"])
    (recording,) = play(plan, SEED)
    truth = true_output(plan, plan.records[0])[1]
    share = np.std(recording.output - truth) / np.std(truth)
    assert 0.0298 < share < 0.0302
    assert abs(np.mean(recording.output - truth)) < 4 * 0.03 * np.std(truth) / math.sqrt(truth.size)
    spectrum = np.abs(np.fft.rfft((recording.output - truth)[:, 0])[1:]) ** 2
    low, high = spectrum[: spectrum.size // 2].mean(), spectrum[spectrum.size // 2 :].mean()
    assert 0.97 < low / high < 1.03  # white


@pytest.mark.promise("bench-5")
def test_noise_is_absolute_where_the_plan_says_so(short):
    for rms_rad in (1e-6, 5e-6):
        plan = with_sensor(short, sensor_noise_rad=rms_rad)
        (recording,) = play(plan, SEED)
        noise = recording.output - true_output(plan, plan.records[0])[1]
        assert 0.96 < np.std(noise) / (rms_rad * 1e3) < 1.04


@pytest.mark.promise("bench-5")
def test_both_converters_have_the_bits_and_ranges_of_the_plan(short):
    plan = quiet(with_sensor(short, converters_bits=10))
    (recording,) = play(plan, SEED)
    for values, low, span in ((recording.drive, -4.0, 20.0), (recording.output, -1.0, 3.0)):
        codes = (values - low) / (span / 1024)
        assert np.allclose(codes, np.round(codes), atol=1e-9)
        assert np.unique(codes).size > 100
    asked = plan.records[0].excitation.drive
    error = np.abs(recording.drive - asked).max()
    assert 0.9 * 10 / 1024 < error <= 10 / 1024 * (1 + 1e-9)
    error = np.abs(recording.output - true_output(plan, plan.records[0])[1]).max()
    assert 0.9 * 1.5 / 1024 < error <= 1.5 / 1024 * (1 + 1e-9)
    fine = play(quiet(with_sensor(short, converters_bits=24)), SEED)[0]
    assert 0.0 < np.abs(fine.drive - asked).max() < 1e-6


@pytest.mark.promise("bench-5")
def test_mains_and_drift_are_seen_in_the_output(short):
    plain = play(with_sensor(quiet(short), converters_bits=24), SEED)[0].output
    hum = play(with_sensor(quiet(short), converters_bits=24, sensor_mains_rad=2e-6), SEED)[0].output - plain
    line = np.abs(np.fft.rfft(hum[:, 0])) * 2 / hum.size
    assert line[6] * 1e3 == pytest.approx(2.0, rel=1e-3)  # 50 Hz in 0.12 s
    assert np.delete(line, 6).max() < 1e-6
    drifted = play(with_sensor(quiet(short), converters_bits=24, sensor_drift_rad_s=1e-6), SEED)[0].output - plain
    assert drifted[-1, 0] * 1e3 == pytest.approx(0.12, rel=1e-2)


@pytest.mark.promise("bench-10")
def test_an_output_beyond_its_converter_is_refused(short):
    plan = with_sensor(short, converters_output_max_rad=1e-3)
    with pytest.raises(
        BenchError, match=r"'loop-100hz' moves the mirror over .* mrad, but .*take in -1 mrad to 1 mrad; w"
    ):
        play(plan, SEED)
    with pytest.raises(BenchError, match=r"take in 500 .rad to 2 mrad; widen output_min and output_max, or drive less"):
        play(with_sensor(short, converters_output_min_rad=5e-4), SEED)


@pytest.mark.parametrize(
    ("low_mrad", "high_mrad", "taken"), [(-1.0, 2.0, True), (-1.001, 2.0, False), (-1.0, 2.001, False)]
)
def test_an_output_may_fill_the_range_of_its_converter(short, low_mrad, high_mrad, taken):
    plan = with_sensor(short, converters_output_min_rad=-1e-3, converters_output_max_rad=2e-3)
    measured = np.array([[0.5], [low_mrad], [high_mrad]])
    if taken:
        _check_range(plan, plan.records[0], measured)
        return
    with pytest.raises(
        BenchError, match=r"moves the mirror over -1(\.001)? mrad to 2(\.001)? mrad, but .* -1 mrad to 2 mrad"
    ):
        _check_range(plan, plan.records[0], measured)


@pytest.mark.promise("bench-5", "bench-7", "bench-8", "bench-11")
def test_axes_answer_their_own_drive_and_some_of_the_others(tmp_path, paper):
    text = paper.text.replace('truth = "bench"', 'axes = 2\ncrosstalk = 0.05\ntruth = "bench"', 1)
    text = text.partition("[excitation.chirp]")[0] + (
        '[excitation.m]\nkind = "multisine"\nlines = "odd"\nstart = "10 Hz"\nstop = "1 kHz"\nperiod = "0.1 s"\n'
        'rms = "0.2 V"\noffset = "6 V"\nperiods = 2\nrealisations = 2\nseed = 1\n'
        '[excitation.s]\nkind = "sines"\nfrequencies = ["100 Hz"]\namplitudes = ["3 V"]\nperiods = 4\noffset = "6 V"\n'
        "axis = 2\n"
    )
    path = tmp_path / "two.toml"
    path.write_text(text, encoding="utf-8")
    plan = load_plan(path)
    assert [r.excitation.name for r in plan.records] == ["m-1", "m-2", "s"]
    recordings = play(plan, SEED)
    assert recordings[0].input_names == ("drive1", "drive2")
    assert recordings[0].output_names == ("angle1", "angle2")
    moved = np.ptp(recordings[2].output, axis=0)
    assert moved[0] / moved[1] == pytest.approx(0.05, rel=0.3)
    assert np.ptp(recordings[2].drive, axis=0)[0] == 0.0
    clean = true_output(plan, plan.records[2])[1]
    assert np.allclose(clean[:, 0] - clean[0, 0], 0.05 * (clean[:, 1] - clean[0, 1]))
    (tmp_path / "three.toml").write_text(text.replace("axis = 2", "axis = 3"), encoding="utf-8")
    with pytest.raises(PlanError, match=r"(?s)excitation.s.axis = 3.*bench has 2 inputs"):
        load_plan(tmp_path / "three.toml")


@pytest.mark.promise("bench-7", "bench-12")
def test_lines_and_steps_of_a_record_are_in_the_manifest(tmp_path, paper):
    text = paper.text.partition("[excitation.chirp]")[0] + (
        '[excitation.m]\nkind = "multisine"\nlines = "odd"\nstart = "10 Hz"\nstop = "100 Hz"\nperiod = "0.1 s"\n'
        'rms = "0.2 V"\noffset = "6 V"\nperiods = 2\nrealisations = 1\nseed = 1\ntruth = "linear"\n'
        '[excitation.s]\nkind = "staircase"\nlevels = ["2 V", "8 V"]\ndwell = "0.5 s"\nrise = "5 ms"\nrate = "1 kHz"\n'
        'truth = "linear"\n'
    )
    (tmp_path / "plan.toml").write_text(text, encoding="utf-8")
    plan = load_plan(tmp_path / "plan.toml")
    write_folder(plan, tmp_path / "records", SEED)
    lines, steps = json.loads((tmp_path / "records" / "manifest.json").read_text(encoding="utf-8"))["records"]
    assert (lines["files"], steps["files"]) == (["m.tdms"], ["s.tdms"])
    assert (lines["lines"], lines["step_samples"]) == ([1, 3, 5, 7, 9], [])
    assert (steps["lines"], steps["step_samples"], steps["rest_v"], steps["rate_hz"]) == ([], [505], 2.0, 1e3)


@pytest.mark.promise("bench-5", "bench-10")
def test_an_amplifier_stands_before_the_benchs_own_mirror_alone(paper):
    """Its slew is that of its output: with twice the gain twice as much is the same."""

    def played(truth, **changes):
        plan = select_records(paper, ["loop-100hz"])
        amplifier = plan.bench.amplifier.model_copy(update=changes)
        plan = replace(plan, bench=plan.bench.model_copy(update={"amplifier": amplifier}))
        record = replace(plan.records[0], truth=truth)
        return true_output(plan, record)[1]

    usual, slow = {}, {"bandwidth_hz": 50.0}
    assert np.array_equal(played("linear", **usual), played("linear", **slow))
    assert np.array_equal(played("bouc-wen", **usual), played("bouc-wen", **slow))
    assert np.abs(played("bench", **usual) - played("bench", **slow)).max() > 0.01
    limited = {"gain": 15.0, "slew_v_s": 30e3}
    assert np.array_equal(played("bench", **limited), played("bench", gain=30.0, slew_v_s=60e3))
    assert np.abs(played("bench", **usual) - played("bench", **limited)).max() > 0.01


def test_progress_names_each_record(paper):
    seen = []
    play(select_records(paper, ["loop-60hz", "loop-80hz"]), SEED, lambda *told: seen.append(told))
    assert seen == [(0, 2, "loop-60hz"), (1, 2, "loop-80hz"), (2, 2, paper.name)]


# ---- files
def from_csv(path):
    first, second, *_ = path.read_text(encoding="utf-8").split("\n")
    assert (first, second) == ("time,drive,angle", "s,V,mrad")
    table = np.loadtxt(path, delimiter=",", skiprows=2)
    assert np.allclose(np.diff(table[:, 0]), 2e-5, rtol=1e-6)
    return table[:, 1], table[:, 2]


def from_lvm(path):
    data = lvm_read.read(str(path), read_from_pickle=False, dump_file=False)
    segment = data[0]
    assert data["Segments"] == 1
    assert segment["Delta_X"] == [2e-5, 2e-5]
    assert segment["Samples"] == [6000, 6000]
    assert segment["Y_Unit_Label"] == ["V", "mrad"]
    assert {str(each) for each in [data["Date"], *np.ravel(segment["Date"])]} == {"1904/01/01"}
    assert segment["Channel names"] == ["X_Value", "drive", "angle"]
    assert np.allclose(np.diff(segment["data"][:, 0]), 2e-5, rtol=1e-6)
    return segment["data"][:, 1], segment["data"][:, 2]


def from_tdms(path):
    group = TdmsFile.read(path)["bench"]
    assert group.properties["rate_hz"] == 50e3
    for channel, unit in (("drive", "V"), ("angle", "mrad")):
        assert group[channel].properties["unit_string"] == unit
        assert group[channel].properties["wf_increment"] == 2e-5
        assert group[channel].time_track()[-1] == pytest.approx(5999 * 2e-5)
    return group["drive"][:], group["angle"][:]


def from_mat(path):
    data = scipy.io.loadmat(path)
    assert data["drive"].shape == (6000, 1)
    assert data["rate_hz"] == 50e3
    assert data["period_samples"] == 500
    return data["drive"][:, 0], data["angle"][:, 0]


def from_mat73(path):
    head = path.read_bytes()[:128]
    assert head.startswith(b"MATLAB 7.3 MAT-file")
    assert head[116:] == bytes(8) + b"\x00\x02IM"
    with pytest.raises(NotImplementedError):  # SciPy knows it for what it is
        scipy.io.loadmat(path)
    with h5py.File(path) as file:
        assert file["drive"].attrs["MATLAB_class"] == b"double"
        assert (file["rate_hz"][0, 0], file["period_samples"][0, 0]) == (50e3, 500)
        return file["drive"][0], file["angle"][0]


def from_npz(path):
    with np.load(path, allow_pickle=False) as data:
        assert data["rate_hz"] == 50e3
        assert data["period_samples"] == 500
        return data["drive"], data["angle"]


def from_hdf5(path):
    with h5py.File(path) as file:
        assert (file.attrs["rate_hz"], file.attrs["period_samples"]) == (50e3, 500)
        assert file["angle"].attrs["units"] == "mrad"
        return file["drive"][:], file["angle"][:]


READERS = {
    "csv": ("loop-100hz.csv", from_csv),
    "lvm": ("loop-100hz.lvm", from_lvm),
    "tdms": ("loop-100hz.tdms", from_tdms),
    "mat": ("loop-100hz.mat", from_mat),
    "mat73": ("loop-100hz-v73.mat", from_mat73),
    "npz": ("loop-100hz.npz", from_npz),
    "hdf5": ("loop-100hz.h5", from_hdf5),
}


@pytest.fixture(scope="module")
def folder(short, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench") / "records"
    files = write_folder(replace(short, formats=FORMATS), folder, SEED)
    assert [path.name for path in files] == [READERS[form][0] for form in FORMATS]
    return folder


@pytest.mark.promise("bench-1", "bench-5", "bench-11")
@pytest.mark.promise("gallery-6", "readme-10")
@pytest.mark.parametrize("form", FORMATS)
def test_a_file_holds_what_was_played(folder, short, form):
    name, read = READERS[form]
    drive, angle = read(folder / name)
    (recording,) = play(short, SEED)
    exact = form not in ("csv", "lvm")
    for found, expected in ((drive, recording.drive[:, 0]), (angle, recording.output[:, 0])):
        assert np.array_equal(found, expected) if exact else np.allclose(found, expected, rtol=1e-8, atol=1e-9)


@pytest.mark.promise("bench-2", "bench-12", "bench-13")
def test_the_folder_holds_plan_and_manifest(folder, short):
    assert (folder / "plan.toml").read_text(encoding="utf-8") == short.text
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    (record,) = manifest["records"]
    assert (manifest["seed"], manifest["plan"]["sha256"]) == (SEED, short.sha256)
    assert (record["use"], record["kind"], record["truth"]) == ("identification", "sines", "bouc-wen")
    assert (record["rate_hz"], record["period_samples"], record["rest_v"]) == (50e3, 500, 6.0)
    assert (record["lines"], record["step_samples"]) == ([], [])
    assert set(manifest["versions"]) == {"python", "microrad", "numpy", "scipy", "numba"}
    assert record["files"] == [name for name, _ in READERS.values()]
    for name, digest in manifest["files_sha256"].items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest
    assert set(manifest["files_sha256"]) == {*record["files"], "plan.toml"}
    assert not [path for path in folder.parent.iterdir() if path != folder]


def test_a_folder_is_not_replaced_unless_asked_and_ours(short, tmp_path):
    folder = tmp_path / "out"
    (first,) = write_folder(short, folder, 1)
    before = first.read_bytes()
    with pytest.raises(FolderError, match="already holds recordings: choose another --output, or replace them with"):
        write_folder(short, folder, 2)
    assert first.read_bytes() == before
    write_folder(short, folder, 2, overwrite=True)
    assert first.read_bytes() != before
    write_folder(short, folder, 1, overwrite=True)
    assert first.read_bytes() == before
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "thesis.tex").write_text("years of work", encoding="utf-8")
    with pytest.raises(FolderError, match="holds files that are not recordings of microrad"):
        write_folder(short, foreign, 1, overwrite=True)
    with pytest.raises(FolderError, match="is a file, not a folder"):
        write_folder(short, first, 1, overwrite=True)
    assert (foreign / "thesis.tex").exists()


@pytest.mark.promise("bench-12")
def test_a_folder_is_never_half_written(short, tmp_path):
    folder = tmp_path / "out"
    bad = with_sensor(short, converters_output_max_rad=1e-3)
    with pytest.raises(BenchError, match="widen output_min"):
        write_folder(bad, folder, SEED)
    assert list(tmp_path.iterdir()) == []
    write_folder(short, folder, SEED)
    names = sorted(path.name for path in folder.iterdir())
    with pytest.raises(BenchError, match="widen output_min"):
        write_folder(bad, folder, SEED, overwrite=True)
    assert sorted(path.name for path in folder.iterdir()) == names
    assert list(tmp_path.iterdir()) == [folder]


@pytest.mark.parametrize("form", ["mat73", "hdf5"])
def test_hdf5_is_whole_before_a_disk_can_be_full(short, tmp_path, monkeypatch, form):
    """HDF5 cannot close a file on a full disk: its errors came one behind the other, and the process crashed."""

    def full(path, content):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(bench_folder.Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space left") as caught:
        write_folder(replace(short, formats=(form,)), tmp_path / "bench", SEED)
    assert caught.value.filename == str(tmp_path / "bench")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.promise("licences-1")
def test_a_format_without_its_library_says_what_to_install(short, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "nptdms", None)
    with pytest.raises(BenchError, match=r"needs npTDMS, which is not installed: .* constraints.txt '\.\[lab\]'"):
        write_folder(short, tmp_path / "out", SEED)
    assert list(tmp_path.iterdir()) == []


# ---- two axes at a rate with digits
TWO_AXES = f"""
name = "two axes"
formats = ["csv", "lvm", "tdms", "mat", "mat73", "npz", "hdf5"]
{LIMITS_AND_BENCH}drift = "7 urad/s"
[excitation.m]
kind = "multisine"
lines = "all"
start = "3 Hz"
stop = "9 Hz"
period = "1 s"
rms = "0.5 V"
offset = "2.5 V"
periods = 2
realisations = 2
seed = 5
rate = "500 Hz"
[excitation.c]
kind = "chirp"
start = "0.7 Hz"
stop = "33 Hz"
duration = "1.1 s"
amplitude = "1.5 V"
offset = "2.25 V"
axis = 2
use = "validation"
noise_share = 0.05
truth = "bouc-wen"
"""


@pytest.fixture(scope="module")
def two_axes(tmp_path_factory):
    path = tmp_path_factory.mktemp("plan") / "two.toml"
    path.write_text(TWO_AXES, encoding="utf-8")
    return load_plan(path)


def test_what_the_sensor_adds_is_mains_and_drift_on_all_axes_and_noise_of_each_ones_share(two_axes):
    for record, recording, share in zip(two_axes.records, play(two_axes, 3), (0.02, 0.02, 0.05), strict=True):
        drive, angle = true_output(two_axes, record)
        rate_hz = record.excitation.rate_hz
        stream = np.random.SeedSequence(3, spawn_key=(zlib.crc32(record.excitation.name.encode()),))
        rng = np.random.Generator(np.random.Philox(stream))
        time_s, phase = np.arange(len(angle)) / rate_hz, 2 * math.pi * rng.random()
        common = 3e-3 * np.sin(2 * math.pi * 60 * time_s + phase) + 7e-3 * time_s
        measured = angle + common[:, None] + share * angle.std(axis=0) * rng.standard_normal(angle.shape)
        step = 5.0 / 2**14
        np.testing.assert_allclose(recording.output, -2.0 + step * np.round((measured + 2.0) / step), atol=1e-9)
        np.testing.assert_array_equal(recording.drive, drive)
        codes = (drive + 3.5) / (13.0 / 2**14)
        np.testing.assert_allclose(codes, np.round(codes), atol=1e-6)
        assert np.abs(drive - record.excitation.drive).max() <= 6.5 / 2**14 * (1 + 1e-9)
        assert (recording.input_names, recording.output_names) == (("drive1", "drive2"), ("angle1", "angle2"))
        assert (recording.input_units, recording.output_units) == (("V", "V"), ("mrad", "mrad"))


def test_each_axis_answers_its_own_drive_less_a_quarter_of_the_other(two_axes):
    record = two_axes.records[1]
    drive, angle = true_output(two_axes, record)
    rest_v = -3.5 + 13.0 / 2**14 * np.round((2.5 + 3.5) / (13.0 / 2**14))
    alone = [linear_output(np.ascontiguousarray(column), rest_v, 500.0) for column in drive.T]
    np.testing.assert_allclose(angle[:, 0], alone[0] - 0.25 * alone[1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(angle[:, 1], alone[1] - 0.25 * alone[0], rtol=0, atol=1e-12)
    chirped = true_output(two_axes, two_axes.records[2])[1]
    own = bouc_wen_output(np.ascontiguousarray(true_output(two_axes, two_axes.records[2])[0][:, 1]), 2.25, 622.08)
    assert np.ptp(chirped[:, 0]) == pytest.approx(0.25 * np.ptp(chirped[:, 1]), rel=0.05)
    assert np.ptp(chirped[:, 1]) == pytest.approx(np.ptp(own), rel=0.02)


@pytest.fixture(scope="module")
def two_axes_folder(two_axes, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench") / "two"
    files = write_folder(two_axes, folder, 3)
    suffixes = (".csv", ".lvm", ".tdms", ".mat", "-v73.mat", ".npz", ".h5")
    assert [path.name for path in files] == [f"{name}{each}" for name in ("m-1", "m-2", "c") for each in suffixes]
    return folder


@pytest.mark.parametrize("suffix", [".csv", ".lvm", ".tdms", ".mat", "-v73.mat", ".npz", ".h5"])
def test_each_file_of_two_axes_is_read_as_it_was_played(two_axes, two_axes_folder, suffix):
    for played in play(two_axes, 3)[1:]:
        path = two_axes_folder / f"{played.path}{suffix}"
        found = read_recording(path, ("drive2", "drive1"), ("angle2", "angle1"), accept=("lead",), alone=False)
        atol = 1e-8 if suffix in (".csv", ".lvm") else 0.0
        np.testing.assert_allclose(found.drive, played.drive[:, ::-1], rtol=0, atol=atol)
        np.testing.assert_allclose(found.output, played.output[:, ::-1], rtol=0, atol=atol)
        assert found.rate_hz == pytest.approx(played.rate_hz, rel=1e-7)
        if suffix in (".csv", ".lvm", ".tdms", ".h5"):
            assert (found.input_units, found.output_units) == (("V", "V"), ("mrad", "mrad"))


def test_the_texts_of_two_axes_have_their_heads_and_times_line_by_line(two_axes, two_axes_folder):
    played = play(two_axes, 3)[2]
    lines = (two_axes_folder / "c.csv").read_text(encoding="utf-8").split("\n")
    assert lines[:2] == ["time,drive1,drive2,angle1,angle2", "s,V,V,mrad,mrad"]
    values = [*played.drive[3], *played.output[3]]
    assert lines[5] == f"{3 / 622.08:.7f}," + ",".join(f"{value:.9g}" for value in values)
    assert (len(lines), lines[-1]) == (played.samples + 3, "")
    head, _, rest = (two_axes_folder / "c.lvm").read_text(encoding="utf-8").partition("***End_of_Header***\t\n\t\n")
    assert head.split("\n") == [
        *("LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab", "Decimal_Separator\t."),
        *("Multi_Headings\tNo", "X_Columns\tOne", "Time_Pref\tRelative", "Date\t1904/01/01", "Time\t00:00:00", ""),
    ]
    assert rest.split("\n")[:10] == [
        "Channels\t4",
        "Samples" + "\t684" * 4,
        "Date" + "\t1904/01/01" * 4,
        "Time" + "\t00:00:00" * 4,
        "Y_Unit_Label\tV\tV\tmrad\tmrad",
        "X_Dimension" + "\tTime" * 4,
        "X0" + "\t0.0" * 4,
        "Delta_X" + f"\t{1 / 622.08:.15g}" * 4,
        "***End_of_Header***\t",
        "X_Value\tdrive1\tdrive2\tangle1\tangle2",
    ]
    assert rest.split("\n")[13] == lines[5].replace(",", "\t")


def test_the_manifest_of_two_axes_has_each_record_in_full(two_axes, two_axes_folder):
    manifest = json.loads((two_axes_folder / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["plan"] == {
        "name": "two axes",
        "file": "plan.toml",
        "source": "two.toml",
        "sha256": hashlib.sha256(TWO_AXES.encode()).hexdigest(),
    }
    assert (manifest["seed"], manifest["drive_unit"], manifest["output_unit"]) == (3, "V", "mrad")
    suffixes = (".csv", ".lvm", ".tdms", ".mat", "-v73.mat", ".npz", ".h5")
    channels = {"inputs": ["drive1", "drive2"], "outputs": ["angle1", "angle2"], "step_samples": []}
    lined = {"period_samples": 500, "rest_v": 2.5, "lines": list(range(3, 10)), "rate_hz": 500.0, "samples": 1000}
    swept = {"period_samples": None, "rest_v": 2.25, "lines": [], "rate_hz": 622.08, "samples": 684}
    assert manifest["records"] == [
        {
            **{"name": name, "kind": kind, "use": use, "truth": truth},
            **{"files": [f"{name}{suffix}" for suffix in suffixes], **channels, **own},
        }
        for name, kind, use, truth, own in (
            ("m-1", "multisine", "identification", "linear", lined),
            ("m-2", "multisine", "identification", "linear", lined),
            ("c", "chirp", "validation", "bouc-wen", swept),
        )
    ]
    assert list(manifest["versions"]) == ["python", "microrad", "numpy", "scipy", "numba"]
    assert manifest["files_sha256"] == {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(two_axes_folder.iterdir())
        if path.name != "manifest.json"
    }


def test_a_folder_of_two_axes_is_read_with_uses_and_periods_from_its_first_format(two_axes, two_axes_folder):
    found = bench_folder.read_folder(two_axes_folder, ("lead",))
    assert [use for _, use in found] == ["identification", "identification", "validation"]
    assert [each.path for each, _ in found] == [str(two_axes_folder / f"{name}.csv") for name in ("m-1", "m-2", "c")]
    assert [each.period_samples for each, _ in found] == [500, 500, None]
    assert {each.output_names for each, _ in found} == {("angle1", "angle2")}


@pytest.mark.parametrize(
    "text", [None, "{", "[]", "{}", '{"records": 3}', '{"records": [{}]}', '{"records": [{"files": []}]}']
)
def test_a_folder_without_a_whole_manifest_is_none_of_a_bench(tmp_path, text):
    if text is not None:
        (tmp_path / "manifest.json").write_text(text, encoding="utf-8")
    with pytest.raises(BenchError) as refused:
        bench_folder.read_folder(tmp_path)
    assert str(refused.value) == (
        f"{tmp_path}: no manifest.json of microrad bench in it; name the recordings themselves (--input, --output)"
    )


def test_a_mirror_that_moves_beyond_its_converter_is_told_with_both_ranges(two_axes):
    measured = np.array([[0.5, -2.25], [3.5, 1.0]])
    with pytest.raises(BenchError) as refused:
        _check_range(two_axes, two_axes.records[2], measured)
    assert str(refused.value) == (
        f"{two_axes.path}: excitation 'c' moves the mirror over -2.25 mrad to 3.5 mrad, but bench.converters take in "
        "-2 mrad to 3 mrad; widen output_min and output_max, or drive less"
    )
    with pytest.raises(BenchError) as refused:
        play(two_axes, -2)
    assert str(refused.value) == "the seed is -2; give a whole number of at least 0"


@pytest.mark.parametrize(
    ("value", "code"),
    [(-9.0, 0), (-2.0, 0), (-1.88, 0), (-1.87, 1), (-1.75, 1), (0.0, 8), (1.63, 15), (1.75, 15), (2.0, 15), (9.0, 15)],
)
def test_a_converter_gives_its_nearest_code_and_holds_the_first_and_the_last(value, code):
    assert Converter(-2.0, 0.25, 16).convert(np.array([value, 0.1])).tolist() == [-2.0 + 0.25 * code, 0.0]


@pytest.mark.parametrize(
    ("rate_hz", "second"),
    [
        (0.5, "2.0000"),
        (1.0, "1.0000"),
        (1.5, "0.66667"),
        (10.0, "0.10000"),
        (622.08, "0.0016075"),
        (50e3, "0.000020000"),
    ],
)
def test_the_times_of_a_text_have_four_digits_below_the_step(rate_hz, second):
    values = np.array([[1.0, -2.0], [0.123456789012, 1e-7]])
    made = Recording("r", "", values, 3.0 * values[:, :1], rate_hz, ("u", "v"), ("y",), None, ("V", "mV"), ("mrad",))
    first, row = "".join(bench_folder._rows(made, ";")).splitlines()
    assert first.split(";")[1:] == ["1", "-2", "3"] and float(first.split(";")[0]) == 0.0
    assert row == f"{second};0.123456789;1e-07;0.370370367"
    assert [(name, unit, v.tolist()) for name, unit, v in bench_folder._channels(made)] == [
        ("u", "V", [1.0, 0.123456789012]),
        ("v", "mV", [-2.0, 1e-7]),
        ("y", "mrad", [3.0, 3 * 0.123456789012]),
    ]
    assert bench_folder._facts(made) == {"rate_hz": rate_hz}
    assert bench_folder._facts(replace(made, period_samples=2)) == {"rate_hz": rate_hz, "period_samples": 2}


def test_a_record_without_noise_has_none_though_the_sensor_has_a_share_of_it(two_axes):
    """A share of 0 in an excitation stands instead of that of the sensor: hum and drift alone are left."""
    record = replace(two_axes.records[0], noise_share=0.0)
    (recording,) = play(replace(two_axes, records=(record,)), 3)
    angle = true_output(two_axes, record)[1]
    time_s, added = np.arange(1000) / 500.0, recording.output - angle - 7e-3 * (np.arange(1000) / 500.0)[:, None]
    hum = np.abs(np.exp(-2j * np.pi * 60 * time_s) @ added) * 2 / 1000
    np.testing.assert_allclose(hum, 3e-3, rtol=0.02)
    assert np.abs(added).max() < 3e-3 + 0.5 * 5.0 / 2**14 * (1 + 1e-9)


def test_rows_of_a_text_go_on_from_block_to_block(monkeypatch):
    values = np.arange(22.0).reshape(11, 2)
    made = Recording("r", "", values, values[:, :1] ** 2, 8.0, ("u", "v"), ("y",), None, ("V", "V"), ("mrad",))
    whole = "".join(bench_folder._rows(made, ","))
    monkeypatch.setattr(bench_folder, "_ROWS", 4)
    assert [part.count("\n") for part in bench_folder._rows(made, ",")] == [4, 4, 3]
    assert "".join(bench_folder._rows(made, ",")) == whole
    assert whole.splitlines()[9] == "1.12500,18,19,324"


def test_what_a_check_finds_in_a_folder_can_be_taken_on(tmp_path):
    time_s = np.arange(1000) / 500.0
    drive = np.sin(2 * np.pi * 3.0 * time_s)
    np.savez(tmp_path / "a.npz", u=drive, y=drive, rate_hz=500.0)
    np.savez(tmp_path / "b.npz", u=drive, y=np.minimum(drive, 0.6), rate_hz=500.0)
    entry = {"inputs": ["u"], "outputs": ["y"], "period_samples": None}
    records = [{**entry, "files": [f"{name}.npz"], "use": use} for name, use in (("a", "identification"), ("b", "x"))]
    (tmp_path / "manifest.json").write_text(json.dumps({"records": records}), encoding="utf-8")
    with pytest.raises(RecordingError, match=r"b\.npz: the output, channel 1 \('y'\) is clipped at 0\.6: "):
        bench_folder.read_folder(tmp_path)
    found = bench_folder.read_folder(tmp_path, ("clipping",))
    assert [(Path(each.path).name, use) for each, use in found] == [("a.npz", "identification"), ("b.npz", "x")]
    assert [[f.kind for f in each.findings if f.refused] for each, _ in found] == [[], ["clipping"]]


def test_binary_files_of_two_axes_say_of_what_record_and_in_what_units_they_are(two_axes, two_axes_folder):
    for played in play(two_axes, 3)[1:]:
        facts = {"rate_hz": played.rate_hz} | ({"period_samples": 500} if played.path == "m-2" else {})
        names = ["drive1", "drive2", "angle1", "angle2"]
        units = dict(zip(names, ["V", "V", "mrad", "mrad"], strict=True))
        tdms = TdmsFile.read(two_axes_folder / f"{played.path}.tdms")
        assert tdms.properties == {"name": played.path}
        (group,) = tdms.groups()
        assert (group.name, group.properties) == ("bench", facts)
        clock = {"wf_start_offset": 0.0, "wf_increment": played.step_s, "wf_samples": played.samples}
        for channel, (name, unit) in zip(group.channels(), units.items(), strict=True):
            assert channel.name == name
            assert channel.properties == {**clock, "wf_xname": "Time", "wf_xunit_string": "s", "unit_string": unit}
        with h5py.File(two_axes_folder / f"{played.path}.h5") as file:
            assert dict(file.attrs) == facts
            assert {name: file[name].attrs["units"] for name in file} == units
        with h5py.File(two_axes_folder / f"{played.path}-v73.mat") as file:
            assert {name: item.shape for name, item in file.items()} == {
                **dict.fromkeys(names, (1, played.samples)),
                **dict.fromkeys(facts, (1, 1)),
            }
            assert {item.attrs["MATLAB_class"] for item in file.values()} == {b"double"}
        head = (two_axes_folder / f"{played.path}-v73.mat").read_bytes()[:116]
        assert head == b"MATLAB 7.3 MAT-file, Platform: microrad, HDF5 schema 1.00 .".ljust(116)
        mat = scipy.io.whosmat(two_axes_folder / f"{played.path}.mat")
        assert sorted(mat) == sorted(
            [(name, (played.samples, 1), "double") for name in names]
            + [(name, (1, 1), "double" if name == "rate_hz" else "int64") for name in facts]
        )


def test_a_manifest_is_a_text_in_the_letters_of_the_plan(two_axes, tmp_path):
    plan = replace(two_axes, name="Möhre µ", formats=("npz",), records=two_axes.records[2:])
    files = write_folder(plan, tmp_path / "made", 3)
    text = (tmp_path / "made" / "manifest.json").read_text(encoding="utf-8")
    assert files == (tmp_path / "made" / "c.npz",)
    assert text.startswith('{\n  "plan": {\n    "name": "Möhre µ",\n    "file": "plan.toml",\n')
    assert text.endswith("\n  }\n}\n")
