"""Arrays with axes for channels, realisations and periods: what is read of them, and each refusal with its message."""

import re

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from microrad.lab.identify import IdentificationError
from microrad.lab.identify.linear.response import response_from_periods
from microrad.lab.recording import AXES, RecordingError, multisine_recordings, read_arrays
from microrad.lab.recording.records import digest_of
from places import DATA, ROOT

RATE_HZ = 1000.0
SHAPE = (400, 2, 3, 2)  # samples, channels, realisations, periods


def experiment():
    rng = np.random.Generator(np.random.Philox(11))
    drive = np.repeat(rng.standard_normal((*SHAPE[:3], 1)), SHAPE[3], axis=3)
    mixed = np.stack([drive[:, 0] + 0.2 * drive[:, 1], drive[:, 1] - 0.1 * drive[:, 0], drive[:, 1]], axis=1)
    return drive, mixed + 0.01 * rng.standard_normal(mixed.shape)


U, Y = experiment()
WHOLE = multisine_recordings(U, Y, RATE_HZ)


def write_npz(path, **arrays):
    np.savez(path, **arrays)


def write_mat(path, **arrays):
    savemat(path, arrays)


def write_mat73(path, **arrays):
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in arrays.items():
            file.create_dataset(name, data=np.atleast_2d(values).T).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: test".ljust(116) + bytes(8) + b"\x00\x02IM")


def write_hdf5(path, **arrays):
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[f"run/{name}"] = values
        file["run/u"].attrs["units"] = "V"


WRITERS = {"a.npz": write_npz, "a.mat": write_mat, "b.mat": write_mat73, "a.h5": write_hdf5}


def refusal(*args, axes=AXES, **options):
    with pytest.raises(RecordingError) as caught:
        read_arrays(*args, axes=axes, **options)
    message = str(caught.value)
    assert message.startswith(f"{args[0]}")
    assert "\n" not in message
    return message


def check(read, expected=WHOLE):
    assert len(read) == len(expected)
    for one, other in zip(read, expected, strict=True):
        np.testing.assert_array_equal(one.drive, other.drive)
        np.testing.assert_array_equal(one.output, other.output)
        assert (one.rate_hz, one.period_samples) == (RATE_HZ, other.period_samples)
        assert not one.drive.flags.writeable


@pytest.mark.promise("recordings-15")
@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0), (2, 0, 3, 1)])
@pytest.mark.parametrize("name", WRITERS)
def test_each_format_and_order_gives_the_same_recordings(tmp_path, name, order):
    path, axes = tmp_path / name, [AXES[k] for k in order]
    WRITERS[name](path, u=np.transpose(U, order), y=np.transpose(Y, order), fs=RATE_HZ)
    read = read_arrays(path, "u", "y", axes=axes)
    check(read)
    assert [r.path for r in read] == [f"{path} realisation {k}" for k in range(3)]
    assert len({r.sha256 for r in read}) == 3
    group = "run/" if name == "a.h5" else ""
    assert (read[0].input_names, read[0].output_names[2]) == ((f"{group}u[0]", f"{group}u[1]"), f"{group}y[2]")
    assert read[0].input_units == (("V", "V") if group else ("", ""))


@pytest.mark.promise("recordings-16")
def test_outputs_in_a_file_of_their_own(tmp_path):
    np.save(tmp_path / "u.npy", U)
    np.save(tmp_path / "y.npy", Y)
    read = read_arrays(tmp_path / "u.npy", rate_hz=RATE_HZ, axes=AXES, output_path=tmp_path / "y.npy")
    check(read)
    assert (read[0].input_names, read[0].output_names) == (
        ("drive[0]", "drive[1]"),
        ("output[0]", "output[1]", "output[2]"),
    )


@pytest.mark.promise("recordings-33")
def test_the_example_of_the_page_reads_each_realisation(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("u_100mV.npy", U)
    np.save("y_100mV.npy", Y)
    page = (ROOT / "docs" / "recordings.md").read_text(encoding="utf-8")
    (code,) = (each for each in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "u_100mV.npy" in each)
    known = {}
    exec(code, known)
    assert len(known["realisations"]) == len(WHOLE) == SHAPE[2]
    for one, other in zip(known["realisations"], WHOLE, strict=True):
        np.testing.assert_array_equal(one.drive, other.drive)
        np.testing.assert_array_equal(one.output, other.output)
        assert (one.rate_hz, one.period_samples) == (6400.0, SHAPE[0])


def test_an_output_in_a_file_of_its_own_that_follows_no_drive(tmp_path):
    rng = np.random.Generator(np.random.Philox(12))
    drive = np.zeros((800, 2, 2))
    drive[:, 0, 0], drive[:, 1, 1] = rng.standard_normal((2, 800))  # one after the other
    output = drive.sum(axis=1, keepdims=True) + 0.01 * rng.standard_normal((800, 1, 2))
    np.save(tmp_path / "u.npy", drive)
    words = {"rate_hz": RATE_HZ, "axes": AXES[:3], "output_path": tmp_path / "y.npy"}
    np.save(tmp_path / "y.npy", output)
    assert len(read_arrays(tmp_path / "u.npy", **words)) == 2
    np.save(tmp_path / "y.npy", np.concatenate((output, rng.standard_normal(output.shape)), axis=1))
    assert "the output 'output[1]' follows the drives in none of the recordings" in refusal(tmp_path / "u.npy", **words)


@pytest.mark.promise("recordings-15", "recordings-16")
def test_axes_that_an_array_does_not_have(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, u=U[:, 0, 0, 0], y=Y[:, :1, 0, 0], wide=Y[:, :, 0, 0], fs=RATE_HZ)
    one = read_arrays(path, "u", "y", axes=["samples"])  # a column of length one is what MATLAB makes of it
    assert [(r.drive.shape, r.output.shape, r.period_samples) for r in one] == [((400, 1), (400, 1), None)]
    assert (one[0].path, one[0].input_names) == (str(path), ("u",))
    np.savez(path, u=U[:, :, :, 0], y=Y[:, :, :, 0], fs=RATE_HZ)
    three = read_arrays(path, "u", "y", axes=AXES[:3], period_samples=200)
    assert [(r.drive.shape, r.period_samples) for r in three] == [((400, 2), 200)] * 3


@pytest.mark.promise("recordings-20")
def test_a_part_of_each_realisation(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, u=U, y=Y, fs=RATE_HZ)
    read = read_arrays(path, "u", "y", axes=AXES, part_s=(0.4, None))
    np.testing.assert_array_equal(read[2].drive, U[:, :, 2, 1])
    assert read[2].path == f"{path} realisation 2 from 0.4 s"
    assert "0.4 s to 9 s is no part of a recording of 0.8 s" in refusal(path, "u", "y", part_s=(0.4, 9.0))


@pytest.mark.promise("recordings-15", "recordings-18")
@pytest.mark.parametrize(
    ("axes", "words"),
    [
        (("samples", "channels", "periods", "realisations"), "in each period: correct the order in --axes (axes)"),
        (
            ("channels", "samples", "realisations", "periods"),
            "that --axes (axes) calls samples has 2, and at least 200",
        ),
        (("samples", "channels", "periods"), "'u' has the shape (400, 2, 3, 2) and --axes (axes) names 3; name each"),
        (("sample", "channels"), "'sample' is no axis, samples is; name each axis of the array in its order, out of"),
        (("samples", "axis"), "'axis' is no axis; name each axis"),
        (("samples", "samples"), "samples stands twice"),
        (("channels", "periods"), "without samples"),
        ("samples", "give a sequence of words"),
    ],
)
def test_wrong_axes(tmp_path, axes, words):
    path = tmp_path / "a.npz"
    np.savez(path, u=U, y=Y, fs=RATE_HZ)
    assert words in refusal(path, "u", "y", axes=axes)


@pytest.mark.promise("recordings-18")
def test_periods_called_channels_are_copies_of_each_other(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, u=U, y=Y[:, :2], fs=RATE_HZ)
    message = refusal(path, "u", "y", axes=("samples", "realisations", "periods", "channels"))
    assert "differs from period 0 to 1 by" in message
    np.savez(path, u=U[:, :, 0], y=Y[:, :2, 0], fs=RATE_HZ)
    message = refusal(path, "u", "y", axes=("samples", "realisations", "channels"))
    assert "realisation 0 and 1 more: the input 'u[1]' is a copy of the input 'u[0]'" in message


@pytest.mark.promise("recordings-18")
def test_channels_and_realisations_that_are_exchanged_show_only_where_there_are_fewer_realisations(tmp_path):
    path, exchanged = tmp_path / "a.npz", ("samples", "realisations", "channels", "periods")
    np.savez(path, u=U, y=Y[:, :2], fs=RATE_HZ)
    wrong = read_arrays(path, "u", "y", axes=exchanged)
    assert [r.drive.shape for r in wrong] == [(800, 3)] * 2
    with pytest.raises(IdentificationError, match="2 records for 3 inputs: at least 3 realisations"):
        response_from_periods(wrong)
    np.savez(path, u=U[:, :, :2], y=Y[:, :2, :2], fs=RATE_HZ)
    assert response_from_periods(read_arrays(path, "u", "y", axes=exchanged)).response.shape[1:] == (2, 2)


@pytest.mark.promise("recordings-18")
@pytest.mark.parametrize(("change", "fits"), [(0.45, True), (0.55, False)])
def test_a_drive_may_differ_by_half_its_rms_from_period_to_period(tmp_path, change, fits):
    path = tmp_path / "a.npz"
    drive = U - U.mean(axis=0)
    other = np.roll(drive[..., 0], 37, axis=0)
    other -= drive[..., 0] * np.mean(other * drive[..., 0], axis=0) / np.mean(drive[..., 0] ** 2, axis=0)
    rms = [np.sqrt(np.mean(a**2, axis=(0, 2), keepdims=True)) for a in (other, drive[..., 0])]
    drive[..., 1] = drive[..., 0] + change * other * rms[1] / rms[0]
    np.savez(path, u=drive, y=Y, fs=RATE_HZ)
    if fits:
        assert len(read_arrays(path, "u", "y", axes=AXES)) == 3
    else:
        assert "differs from period 0 to 1 by" in refusal(path, "u", "y")


@pytest.mark.promise("recordings-16", "recordings-18")
def test_what_no_recordings_can_be_made_of(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, u=U, y=Y, short=Y[:300], fewer=Y[:, :, :2], text=np.array(["a"]), slow=np.array(3.0), fs=RATE_HZ)
    assert "'short' has 300 samples, where the drives, 'u' in" in refusal(path, "u", "short")
    assert "'fewer' has 2 realisations, where" in refusal(path, "u", "fewer")
    assert "input and output are both 'u'; name two arrays (--input, --output), or the file" in refusal(path, "u", "u")
    message = refusal(path, "u")
    assert "4 arrays have 4 axes" in message
    assert "name it (--output). The file holds 'u' of shape (400, 2, 3, 2), 'y' of shape" in message
    assert "no one array of inputs is named 'v'; the file holds 'u'" in refusal(path, "v", "y")
    message = refusal(path, axes=AXES[:3])
    assert "no array has 3 axes, as --axes (axes) says, so which one holds the inputs is not plain: name it" in message
    assert "(--input). The file holds 'u' of shape (400, 2, 3, 2), 'y' of shape" in message
    assert "leave out --period" in refusal(path, "u", "y", period_samples=200)
    assert "two sample rates" in refusal(path, "u", "y", rate_hz=500.0)
    np.savez(
        path, u=U, y=np.where(np.arange(2) == 1, np.where(np.arange(400) == 7, np.nan, 1.0)[:, None, None, None], 1) * Y
    )
    message = refusal(path, "u", "y", rate_hz=RATE_HZ)
    assert "realisation 0: sample 7 of period 1 of the output, y[0] is nan, 1 such sample" in message
    later = refusal(path, "u", "y", rate_hz=RATE_HZ, part_s=(0.1, None))  # the file's samples, not the part's
    assert "sample 7 of period 1 of the output, y[0] is nan" in later
    np.savez(path, u=U[..., 0], y=np.where(np.arange(400) == 7, np.nan, 1.0)[:, None, None] * Y[..., 0])
    message = refusal(path, "u", "y", axes=AXES[:3], rate_hz=RATE_HZ)
    assert "realisation 0: sample 7 of the output, y[0] is nan, 1 such sample" in message
    text = tmp_path / "a.csv"
    text.write_text("u,y\n" + "1,2\n" * 300)
    assert "--axes (axes) is for arrays (NPY, NPZ, MAT, HDF5) and this file holds columns" in refusal(text, "u", "y")


def test_a_file_whose_only_array_of_many_axes_is_empty_says_so(tmp_path):
    np.savez(tmp_path / "a.npz", x=np.zeros((0, 3, 4)))
    assert "no array has 3 axes" in refusal(tmp_path / "a.npz", axes=AXES[:3])
    assert "The file holds 'x' holds no samples; record again" in refusal(tmp_path / "a.npz", axes=AXES[:3])


@pytest.mark.parametrize("samples", [199, 200])
def test_the_axis_of_samples_has_two_hundred_at_least(tmp_path, samples):
    np.savez(tmp_path / "a.npz", u=U[:samples, :, 0, 0], y=Y[:samples, :, 0, 0], fs=RATE_HZ)
    if samples == 200:
        (read,) = read_arrays(tmp_path / "a.npz", "u", "y", axes=AXES[:2], period_samples=200)
        assert (read.samples, read.period_samples, read.output.shape) == (200, 200, (200, 3))
        (read,) = read_arrays(tmp_path / "a.npz", "u", "y", axes=AXES[:2], period_samples=2)
        assert read.period_samples == 2
        for period in (1, 201):
            message = refusal(tmp_path / "a.npz", "u", "y", axes=AXES[:2], period_samples=period)
            assert f"a period of {period} samples does not fit into 200 samples" in message
    else:
        message = refusal(tmp_path / "a.npz", "u", "y", axes=AXES[:2])
        assert "the axis of 'u' that --axes (axes) calls samples has 199, and at least 200 are needed" in message


@pytest.mark.parametrize(
    ("part_s", "words"),
    [
        ((0.2, 0.2), "from 0.2 s to 0.2 s is no part of a recording of 0.8 s"),
        ((0.3, 0.2), "from 0.3 s to 0.2 s is no part"),
        ((0.8, None), "from 0.8 s to the end is no part"),
        ((-0.1, 0.8), "from -0.1 s to 0.8 s is no part"),
        ((0.0, 0.801), "from 0 s to 0.801 s is no part"),
        ((np.nan, None), "from nan s to the end is no part"),
        ((0.0, np.nan), "from 0 s to nan s is no part"),
        ((0.0, np.inf), "from 0 s to inf s is no part"),
        ((0.0, 0.8), ""),
        ((0.4, 0.8), ""),
    ],
)
def test_a_part_lies_within_its_recording(tmp_path, part_s, words):
    np.savez(tmp_path / "a.npz", u=U, y=Y, fs=RATE_HZ)
    if words:
        assert words in refusal(tmp_path / "a.npz", "u", "y", part_s=part_s)
    else:
        read = read_arrays(tmp_path / "a.npz", "u", "y", axes=AXES, part_s=part_s, accept=["drift", "unexcited"])
        assert {each.samples for each in read} == {round((part_s[1] - part_s[0]) * RATE_HZ)}


def test_an_array_of_a_name_that_stands_twice_is_named_in_full(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["a/u"], file["b/u"], file["y"] = U, U, Y
    assert "no one array of inputs is named 'u'; the file holds 'a/u' of shape" in refusal(
        path, "u", "y", rate_hz=RATE_HZ
    )
    assert read_arrays(path, "b/u", "y", rate_hz=RATE_HZ, axes=AXES)[0].input_names == ("b/u[0]", "b/u[1]")


def test_two_files_of_other_rates_and_of_one_missing(tmp_path):
    np.savez(tmp_path / "u.npz", u=U, fs=RATE_HZ)
    np.savez(tmp_path / "y.npz", y=Y, fs=2 * RATE_HZ)
    assert "two sample rates: 1000 Hz (fs = 1000 Hz) and 2000 Hz" in refusal(
        tmp_path / "u.npz", axes=AXES, output_path=tmp_path / "y.npz"
    )
    with pytest.raises(RecordingError, match=r"z\.npz: there is no such file"):
        read_arrays(tmp_path / "u.npz", axes=AXES, output_path=tmp_path / "z.npz")


def test_arrays_that_would_fill_the_memory(tmp_path, monkeypatch):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, u=np.zeros((40_000, 1, 1, 2), np.int8), y=Y, fs=RATE_HZ)
    monkeypatch.setattr("microrad.lab.recording.files._UNPACKED_BYTES", 300_000)
    monkeypatch.setattr("microrad.lab.recording.files._UNPACKED_TIMES", 1)
    assert "'u' states 40000 samples, 0.64 MB in a file of" in refusal(path, "u", "y")


@pytest.mark.skipif(not DATA.is_dir(), reason=f"real recordings are not at {DATA}")
def test_real_arrays():
    u, y = (DATA / "cubespec" / f"{name}_200mV_train.npy" for name in "uy")
    read = read_arrays(u, rate_hz=6400.0, axes=AXES, output_path=y)
    assert [(r.drive.shape, r.output.shape, r.period_samples) for r in read] == [((16384, 3), (16384, 3), 8192)] * 6
    np.testing.assert_array_equal(read[4].output[8192:], np.load(y)[:, :, 4, 1])
    assert {f.kind for r in read for f in r.findings} == {"unexcited"}


def test_a_period_has_to_fit_into_the_part_that_is_read(tmp_path):
    """Where no axis counts the periods: a part of 0.3 s has 300 of the 400 samples, one behind the last included."""
    path = tmp_path / "a.npz"
    write_npz(path, u=U[..., 0], y=Y[..., 0], fs=RATE_HZ)
    options = {"axes": AXES[:3], "part_s": (0.0, 0.3), "alone": False}
    found = read_arrays(path, "u", "y", period_samples=250, **options)
    assert {each.period_samples for each in found} == {250}
    count = len(found[0].drive)
    assert 300 <= count <= 301
    told = refusal(path, "u", "y", period_samples=350, **options)
    assert f"a period of 350 samples does not fit into {count} samples" in told


# --------------------------------------------------------------------------------- arrays whose axes are all unlike
def unlike(seed=21):
    """Two drives and three outputs, five realisations of three periods of 230 samples."""
    rng = np.random.Generator(np.random.Philox(seed))
    drive = np.repeat(rng.standard_normal((230, 2, 5, 1)), 3, axis=3)
    mixed = np.stack([drive[:, 0] - 0.4 * drive[:, 1], 0.3 * drive[:, 0] + drive[:, 1], drive[:, 1]], axis=1)
    return drive, mixed + 0.01 * rng.standard_normal(mixed.shape)


FEW, SEEN = unlike()
TURNED = ("periods", "realisations", "samples", "channels")


def test_arrays_in_an_order_of_their_own_with_a_part_that_cuts_through_a_period(tmp_path):
    path, other = tmp_path / "u.npz", tmp_path / "y.h5"
    np.savez(path, both=FEW.transpose(3, 2, 0, 1), fs=622.08)
    with h5py.File(other, "w") as file:
        file["run/both"] = SEEN.transpose(3, 2, 0, 1)
        file["run/both"].attrs["unit"] = "um"
        file["run"].attrs["rate"] = 622.2
    read = read_arrays(path, axes=TURNED, output_path=other, part_s=(0.1, 1.0))
    kept = slice(round(0.1 * 622.08), round(622.08))
    assert len(read) == 5
    for number, one in enumerate(read):
        whole = [np.concatenate([each[:, :, number, p] for p in range(3)])[kept] for each in (FEW, SEEN)]
        np.testing.assert_array_equal(one.drive, whole[0])
        np.testing.assert_array_equal(one.output, whole[1])
        assert one.path == f"{path} realisation {number} from 0.1 s to 1 s"
        assert one.sha256 == digest_of(one.drive, one.output)
        assert (one.rate_hz, one.period_samples) == (622.08, 230)
        assert (one.input_units, one.output_units) == (("", ""), ("um",) * 3)
        assert one.input_names == ("both[0]", "both[1]")
        assert one.output_names == ("run/both[0]", "run/both[1]", "run/both[2]")
        assert not (one.drive.flags.writeable or one.output.flags.writeable)


@pytest.mark.parametrize(
    ("arrays", "axes", "words"),
    [
        (
            {"u": FEW, "y": SEEN[:, :, :4]},
            AXES,
            "'y' has 4 realisations, where the drives, 'u' in {path}, have 5; give arrays that were recorded together, "
            "and their axes in order (--axes).",
        ),
        (
            {"u": FEW, "y": SEEN[..., :2]},
            AXES,
            "'y' has 2 periods, where the drives, 'u' in {path}, have 3; give arrays that were recorded together, and "
            "their axes in order (--axes).",
        ),
        (
            {"u": FEW, "y": SEEN[:225]},
            AXES,
            "'y' has 225 samples, where the drives, 'u' in {path}, have 230; give arrays that were recorded together, "
            "and their axes in order (--axes).",
        ),
        (
            {"u": FEW, "y": SEEN},
            AXES[:3],
            "the input 'u' has the shape (230, 2, 5, 3) and --axes (axes) names 3; name each axis of the array once, "
            "in its order.",
        ),
        (
            {"u": FEW, "y": SEEN},
            ("channels", "samples", "realisations", "periods"),
            "the axis of 'u' that --axes (axes) calls samples has 2, and at least 200 are needed; correct the order of "
            "the axes, or record longer.",
        ),
        (
            {"u": FEW, "w": SEEN},
            AXES,
            "no one array of outputs is named 'y'; the file holds 'u' of shape (230, 2, 5, 3), 'w' of shape (230, 3, "
            "5, 3).",
        ),
        (
            {"u": FEW, "y": SEEN},
            ("samples", "channels", "realization", "periods"),
            "--axes (axes) is 'samples,channels,realization,periods': 'realization' is no axis, realisations is; name "
            "each axis of the array in its order, out of samples, channels, realisations, periods.",
        ),
        (
            {"u": FEW, "y": SEEN},
            ("samples", "channels", "channels", "periods"),
            "--axes (axes) is 'samples,channels,channels,periods': channels stands twice; name each axis of the array "
            "in its order, out of samples, channels, realisations, periods.",
        ),
        (
            {"u": FEW, "y": SEEN},
            ("channels", "periods"),
            "--axes (axes) is 'channels,periods', without samples; name each axis of the array in its order, out of "
            "samples, channels, realisations, periods.",
        ),
        (
            {"u": FEW, "y": SEEN},
            "samples",
            "--axes (axes) is 'samples'; give a sequence of words: name each axis of the array in its order, out of "
            "samples, channels, realisations, periods.",
        ),
        (
            {"u": FEW[:225], "y": SEEN},
            AXES,
            "'y' has 230 samples, where the drives, 'u' in {path}, have 225; give arrays that were recorded together, "
            "and their axes in order (--axes).",
        ),
        (
            {"u": FEW[:, :, :4], "y": SEEN},
            AXES,
            "'y' has 5 realisations, where the drives, 'u' in {path}, have 4; give arrays that were recorded together, "
            "and their axes in order (--axes).",
        ),
    ],
)
def test_arrays_that_do_not_fit_their_axes_are_told_in_all_words(tmp_path, arrays, axes, words):
    path = tmp_path / "a.npz"
    np.savez(path, **arrays, fs=RATE_HZ)
    assert refusal(path, "u", "y", axes=axes) == f"{path}: {words.format(path=path)}"


def test_which_array_is_meant_is_asked_with_all_that_there_are(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, u=FEW, y=SEEN, v=FEW, flat=np.arange(300.0), fs=RATE_HZ)
    shapes = "'u' of shape (230, 2, 5, 3), 'y' of shape (230, 3, 5, 3), 'v' of shape (230, 2, 5, 3), 'flat' of shape "
    assert refusal(path, "u") == (
        f"{path}: 3 arrays have 4 axes, as --axes (axes) says, so which one holds the outputs is not plain: name it "
        f"(--output). The file holds {shapes}(300,)."
    )
    assert refusal(path, None, "y", axes=("samples", "channels")) == (
        f"{path}: no array has 2 axes, as --axes (axes) says, so which one holds the inputs is not plain: name it "
        f"(--input). The file holds {shapes}(300,)."
    )
    assert refusal(path, "y", "y") == (
        f"{path}: input and output are both 'y'; name two arrays (--input, --output), or the file of the outputs "
        "(--output-file, output_path)."
    )
    assert refusal(path, "u", "y", period_samples=230) == (
        f"{path}: --axes (axes) says where the periods are; leave out --period (period_samples)."
    )
    assert refusal(path, "u", "y", accept="drift").startswith(f"{path}: accept = 'drift'; give a sequence of jitter,")
    assert refusal(path, "u", "y", rate_hz=-2.0) == (
        f"{path}: the sample rate is -2.0; give the samples per second as a positive number in Hz."
    )


def test_a_period_of_the_second_channel_that_differs_is_named_with_its_share(tmp_path):
    path = tmp_path / "a.npz"
    drive = FEW - FEW.mean(axis=0)
    drive[:, 1, :, 2] *= 1.75
    np.savez(path, u=drive, y=SEEN, fs=RATE_HZ)
    size = np.sqrt(np.mean((drive - drive.mean(axis=0))[:, 1] ** 2))
    share = 0.75 * np.sqrt(np.mean(drive[:, 1, :, 0] ** 2)) / size
    assert refusal(path, "u", "y") == (
        f"{path}: channel 1 of 'u' differs from period 0 to 2 by {100 * share:.0f} % of its rms, and a drive is the "
        "same in each period: correct the order in --axes (axes)."
    )


def test_a_bad_sample_of_an_output_in_another_file_is_named_with_realisation_period_and_file(tmp_path):
    path, other = tmp_path / "u.npy", tmp_path / "y.npy"
    np.save(path, FEW)
    bad = SEEN.copy()
    bad[7, 2, 3, 1] = bad[9, 2, 3, 2] = np.inf
    np.save(other, bad)
    for part_s, name in (((0.0, None), ""), ((0.2, None), " from 0.2 s")):
        assert refusal(path, axes=AXES, rate_hz=RATE_HZ, output_path=other, part_s=part_s) == (
            f"{path} realisation 3{name}: sample 7 of period 1 of the output, output[2] of {other} is inf, 2 such "
            "samples in all; remove or repair it, because hysteresis remembers what happened in a gap."
        )


def test_realisations_of_arrays_in_memory_are_named_and_joined_period_by_period():
    found = multisine_recordings(FEW, SEEN, 622.08, "bench 2")
    assert [each.path for each in found] == [f"bench 2 realisation {r}" for r in range(5)]
    assert {(each.rate_hz, each.period_samples, each.samples) for each in found} == {(622.08, 230, 690)}
    np.testing.assert_array_equal(found[4].output[460:, 2], SEEN[:, 2, 4, 2])
    none = (FEW[:, :, :0], SEEN[:, :, :0])
    for drive, output in ((FEW, SEEN[..., :2]), (FEW[:, :, :4], SEEN), (FEW[:225], SEEN), (FEW[..., 0], SEEN), none):
        with pytest.raises(RecordingError) as caught:
            multisine_recordings(drive, output, 622.08, "bench 2")
        assert str(caught.value) == (
            f"bench 2: drive has shape {drive.shape} and output {output.shape}; give (samples, channels, realisations, "
            "periods) with the same samples, realisations and periods, at least one of each."
        )


@pytest.mark.parametrize("alone", [True, False])
def test_one_realisation_has_to_do_by_itself_where_no_other_is_judged_with_it(tmp_path, alone):
    """Its second drive is twice the first."""
    drive = np.stack([U[:, 0, 0, 0], 2.0 * U[:, 0, 0, 0]], axis=1)
    np.savez(tmp_path / "a.npz", u=drive, y=drive[:, :1] + 0.1 * Y[:, :1, 0, 0])
    words = {"axes": ("samples", "channels"), "rate_hz": RATE_HZ, "alone": alone}
    if alone:
        assert "is a copy of the input" in refusal(tmp_path / "a.npz", "u", "y", **words)
    else:
        (read,) = read_arrays(tmp_path / "a.npz", "u", "y", **words)
        np.testing.assert_array_equal(read.drive, drive)


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        ("samples", "is 'samples'; give a sequence of words: "),
        (("sample", "channels"), "is 'sample,channels': 'sample' is no axis, samples is; "),
        (("samples", "q"), "is 'samples,q': 'q' is no axis; "),
        (("samples", "periods", "samples"), "is 'samples,periods,samples': samples stands twice; "),
        (("channels", "periods"), "is 'channels,periods', without samples; "),
        ((), "is '', without samples; "),
    ],
)
def test_axes_that_are_none_are_told_in_all_words(tmp_path, axes, words):
    with pytest.raises(RecordingError) as refused:
        read_arrays(tmp_path / "a.npz", axes=axes)
    advice = "name each axis of the array in its order, out of samples, channels, realisations, periods."
    assert str(refused.value) == f"{tmp_path / 'a.npz'}: --axes (axes) {words}{advice}"


@pytest.mark.parametrize(("sample", "words"), [(np.inf, "is inf"), (1e300, "its largest sample")])
def test_a_sample_of_a_drive_that_is_no_size_is_refused_without_a_warning(tmp_path, sample, words):
    drive = FEW.copy()
    drive[5, 1, 2, 1] = sample
    np.savez(tmp_path / "a.npz", u=drive, y=SEEN, fs=RATE_HZ)
    assert words in refusal(tmp_path / "a.npz", "u", "y")


def test_a_sample_of_outputs_in_a_file_of_their_own_is_named_with_that_file(tmp_path):
    broken = Y.copy()
    broken[17, 1, 2, 1] = np.inf
    np.save(tmp_path / "u.npy", U)
    np.save(tmp_path / "y.npy", broken)
    message = refusal(tmp_path / "u.npy", rate_hz=RATE_HZ, output_path=tmp_path / "y.npy")
    assert message.startswith(
        f"{tmp_path / 'u.npy'} realisation 2: sample 17 of period 1 of the output, output[1] of "
        f"{tmp_path / 'y.npy'} is inf, 1 such sample in all; "
    )
    broken[17, 1, 2, 1], U_broken = 0.0, U.copy()
    U_broken[3, 0, 1, :] = np.nan
    np.save(tmp_path / "u.npy", U_broken)
    message = refusal(tmp_path / "u.npy", rate_hz=RATE_HZ, output_path=tmp_path / "y.npy")
    assert " realisation 1: sample 3 of period 0 of the input, drive[0] is nan, 2 such samples in all; " in message


def test_what_a_check_finds_in_one_of_several_realisations_can_be_taken_on():
    """The second output of the second realisation is cut off at half of what it reaches."""
    time_s = np.arange(400) / RATE_HZ
    drive = np.stack([np.sin(2 * np.pi * f * time_s) for f in (10.0, 20.0)], axis=1)[:, None, :]
    drive = np.repeat(drive[..., None], 2, axis=3)
    output = np.concatenate([drive, 2.0 * drive], axis=1)
    output[:, 1, 1] = np.minimum(output[:, 1, 1], 1.0)
    with pytest.raises(RecordingError, match=r"^bench realisation 1: the output 1 is clipped at 1: ") as caught:
        multisine_recordings(drive, output, RATE_HZ, "bench")
    assert [(each.kind, each.output) for each in caught.value.findings] == [("clipping", 1)]
    found = multisine_recordings(drive, output, RATE_HZ, "bench", accept=("clipping",))
    assert [[each.kind for each in r.findings if each.refused] for r in found] == [[], ["clipping"]]
    assert [(r.path, r.period_samples) for r in found] == [("bench realisation 0", 400), ("bench realisation 1", 400)]


def test_of_a_file_with_many_arrays_twenty_are_listed(tmp_path):
    np.savez(tmp_path / "a.npz", **{f"c{k}": U[:, 0, 0, 0] for k in range(22)}, fs=RATE_HZ)
    message = refusal(tmp_path / "a.npz", axes=("samples",))
    assert "22 arrays have 1 axes, as --axes (axes) says, so which one holds the inputs is not plain" in message
    listed = ", ".join(f"'c{k}' of shape (400,)" for k in range(20))
    assert message.endswith(f"name it (--input). The file holds {listed}.")
