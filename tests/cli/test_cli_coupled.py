"""`microrad identify` for recordings of several channels: what is read, written and printed, and each refusal."""

import functools
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from microrad.cli import coupled as cli_coupled
from microrad.cli import recordings
from microrad.cli.coupled import refuse_options
from microrad.cli.frame import Refusal
from microrad.lab.identify import IdentificationError, coupled, response_from_records
from microrad.lab.identify.coupled.ladder import LadderOptions, identify_coupled
from microrad.lab.identify.coupled.wiring import check_wiring
from microrad.lab.recording import multisine_recordings
from microrad.mirror.coupled import Output, of
from microrad.mission.file import load_coupled_mirror

RATE_HZ, PERIOD = 2000.0, 512
AXES = ("--axes", "samples,channels,realisations,periods", "--rate", "2 kHz")


def experiment(seed=3, realisations=4):
    """Two drives and two displacements of a mirror of two modes: (samples, channels, realisations, periods)."""
    rng = np.random.Generator(np.random.Philox(seed))
    lines, freq = np.arange(1, 200), np.fft.rfftfreq(PERIOD, 1 / RATE_HZ)
    spectrum = np.zeros((freq.size, 2, realisations), dtype=complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.random((lines.size, 2, realisations)))
    drive = np.fft.irfft(spectrum, PERIOD, axis=0)
    scale = drive.std()
    s = 2j * np.pi * freq
    modes = [(2 * np.pi * f) ** 2 / (s**2 + 0.1 * (2 * np.pi * f) * s + (2 * np.pi * f) ** 2) for f in (180.0, 260.0)]
    shapes = np.array([[[3e-6, 1e-6], [1e-6, 0.5e-6]], [[-0.5e-6, 1e-6], [-1e-6, 4e-6]]])
    response = sum(mode[:, None, None] * shape for mode, shape in zip(modes, shapes, strict=True))
    output = np.fft.irfft(np.einsum("foi,fir->for", response, spectrum), PERIOD, axis=0)
    output = (output / scale)[..., None] + 2e-8 * rng.standard_normal((*output.shape, 2))
    return np.repeat((drive / scale)[..., None], 2, axis=3), output


U, Y = experiment()


@pytest.fixture
def quick(monkeypatch):
    """A ladder of two rungs, and a page without figures; what was identified, once it is."""
    found = []

    def short(*args, **options):
        found.append(identify_coupled(*args, options=LadderOptions(axis_orders=(2,), linear_orders=(4,)), **options))
        return found[-1]

    monkeypatch.setattr(coupled, "identify_coupled", short)
    monkeypatch.setattr("microrad.report.identification.coupled.coupled_figures", lambda found: {})
    return found


@pytest.fixture
def given(monkeypatch):
    """What would be identified from, in place of it."""
    taken = {}

    def take(recordings, **options):
        taken.update(options, recordings=recordings)
        raise KeyboardInterrupt

    monkeypatch.setattr(coupled, "identify_coupled", take)
    return taken


def arrays(folder, drive=U, output=Y, name="100mV"):
    np.save(folder / f"u_{name}.npy", drive)
    np.save(folder / f"y_{name}.npy", output)
    return f"u_{name}.npy", "--output-file", f"y_{name}.npy"


def table(folder, name="axes.csv", realisation=0):
    """One realisation, its periods one behind the other: drives in V and outputs in um."""
    columns = [np.moveaxis(a[:, :, realisation], 2, 0).reshape(-1, 2) for a in (U, 1e6 * Y)]
    rows = np.column_stack((np.arange(2 * PERIOD) / RATE_HZ, *columns))
    np.savetxt(folder / name, rows, delimiter=",", header='t,ux,"u,y",x (um),y (um)', comments="", fmt="%.9g")
    return name


PLAN = """name = "two axes"
formats = ["csv"]

[limits]
rate = "2 kHz"
drive_min = "0 V"
drive_max = "12 V"
slew = "20 V/ms"
samples_per_period = 4

[bench]
truth = "linear"
axes = 2
crosstalk = 0.1

[bench.amplifier]
gain = 15
output_min = "0 V"
output_max = "180 V"
bandwidth = "5 kHz"
slew = "1 V/us"

[bench.converters]
bits = 16
drive_min = "-4 V"
drive_max = "16 V"
output_min = "-1 mrad"
output_max = "2 mrad"

[bench.sensor]
noise = "0.2 urad"
mains = "0 urad"
mains_frequency = "50 Hz"
drift = "0 nrad/s"

"""


# -------------------------------------------------------------------------------------------------------- what is done
@pytest.mark.promise("mirror-file-1", "mirror-file-29")
@pytest.mark.promise("identify-38", "identify-46", "recordings-16", "recordings-23")
@pytest.mark.promise("readme-9")
def test_arrays_become_a_mirror_file_of_version_2(call, folder, quick):
    third = Y[:, :1] - 0.5 * Y[:, 1:]
    result = call("identify", *arrays(folder, output=np.concatenate((Y, third), axis=1)), *AXES, "--output-unit", "m",
                  "--position", "1 cm, 0 mm", "--position=-5 mm,8 mm", "--position=-5 mm, -8 mm",
                  "--name", "fsm 3")  # fmt: skip
    assert (result.code, result.err) == (0, "")
    lines = result.out.splitlines()
    assert lines[0] == "drive in V (assumed, --input-unit says otherwise), output in m (given)"
    assert len(lines) <= 25
    assert "u_100mV-mirror.toml written (coupled linear, order 4)." in result.out
    text = (folder / "u_100mV-mirror.toml").read_text(encoding="utf-8")
    assert text.startswith("# Mirror identified from 4 recording(s), model coupled linear, order 4.\n")
    assert "#   u_100mV.npy realisation 3 (held out)\n" in text
    assert "stopped" not in text
    mirror = of(load_coupled_mirror(folder / "u_100mV-mirror.toml"))
    assert mirror.mirror.name == "fsm 3"
    assert [output.position_m for output in mirror.outputs] == [(0.01, 0.0), (-0.005, 0.008), (-0.005, -0.008)]
    assert [actuator.name for actuator in mirror.actuators] == ["drive[0]", "drive[1]"]
    assert "fsm 3" in (folder / "u_100mV-mirror.html").read_text(encoding="utf-8")
    drive = np.tile(U[:, :, 3, 0], (3, 1))
    np.testing.assert_array_equal(mirror.response(drive), quick[0].candidate().model.response(drive))  # to the bit
    left = mirror.response(drive)[-PERIOD:, :2] - Y[:, :, 3].mean(axis=2)
    assert left.std() < 0.1 * Y.std()  # the drive of the truth is a sum of sines between its samples, too


@pytest.mark.promise("identify-38", "recordings-1")
@pytest.mark.promise("readme-9")
@pytest.mark.usefixtures("quick")
def test_columns_of_tables_and_json(call, folder):
    for r in range(4):
        table(folder, f"axes_{r}.csv", r)
    columns = ("--input", "ux", "--input", "u,y", "--output", 3, "--output", 4, "--period", PERIOD)
    result = call("identify", *(f"axes_{r}.csv" for r in range(3)), *columns, "--validate", "axes_3.csv", "--json")
    assert (result.code, result.err) == (0, "")
    data = json.loads(result.out)
    assert (data["mirror_file"], data["report_file"]) == ("axes-mirror.toml", "axes-mirror.html")
    assert (data["fitted"], data["held_out"]) == (["axes_0.csv", "axes_1.csv", "axes_2.csv"], ["axes_3.csv"])
    assert [output["name"] for output in data["outputs"]] == ["x (um)", "y (um)"]
    assert [actuator["name"] for actuator in data["actuators"]] == ["ux", "u,y"]
    assert data["output_rms_m"][0] == pytest.approx(Y[:, :, 3].std(axis=(0, 2)), rel=0.01)
    assert (folder / "axes-mirror.html").is_file()


@pytest.mark.promise("recordings-1", "recordings-16")
def test_arrays_for_validation(call, folder, given):
    fitted, other = arrays(folder), arrays(folder, *experiment(5, 1), "other")
    result = call("identify", *fitted, "--validate", *other, *AXES, "--output-unit", "um", "--input-unit", "mV")
    assert (result.code, result.err) == (130, "microrad: interrupted, nothing was written\n")
    assert [r.path for r in given["recordings"]] == [f"u_100mV.npy realisation {r}" for r in range(4)]
    assert [r.path for r in given["validation"]] == ["u_other.npy realisation 0"]
    np.testing.assert_array_equal(given["validation"][0].output[PERIOD:], np.load("y_other.npy")[:, :, 0, 1])
    assert (given["drive_unit"], given["output_unit"], given["signs"]) == ("mV", "um", None)


@pytest.mark.promise("identify-38", "recordings-19", "recordings-20", "recordings-21")
@pytest.mark.usefixtures("quick")
def test_a_list_with_validation(call, folder):
    drive, output = experiment(5, 1)
    arrays(folder)
    np.savez(folder / "other.npz", u=drive, y=1e6 * output)
    (folder / "bench.toml").write_text(
        """name = "from a list"
axes = ["samples", "channels", "realisations", "periods"]
rate = "2 kHz"
output_unit = "m"
signs = [[1, 1], [0, 1]]

[recording.multisines]
file = "u_100mV.npy"
output_file = "y_100mV.npy"

[recording.unseen]
file = "other.npz"
input = "u"
output = "y"
role = "validation"
output_unit = "um"
"""
    )
    message = call("identify", "bench.toml").err
    assert (
        "the files say different units of the output, m (u_100mV.npy realisation 0), um (other.npz realisation 0)"
        in message
    )
    np.savez(folder / "other.npz", u=drive, y=output)
    (folder / "bench.toml").write_text((folder / "bench.toml").read_text().replace('output_unit = "um"\n', ""))
    result = call("identify", "bench.toml", "--json")
    assert (result.code, result.err) == (0, "")
    data = json.loads(result.out)
    assert data["held_out"] == ["other.npz realisation 0"]
    assert len(data["fitted"]) == 4
    assert 'name = "from a list"' in (folder / "bench-mirror.toml").read_text(encoding="utf-8")


@pytest.mark.promise("identify-44")
@pytest.mark.usefixtures("quick")
def test_stopped_with_what_was_found_so_far(call, folder, monkeypatch):
    def stop(candidate):
        raise KeyboardInterrupt

    monkeypatch.setattr(coupled, "identify_coupled", functools.partial(coupled.identify_coupled, on_model=stop))
    result = call("identify", *arrays(folder), *AXES, "--output-unit", "m")
    assert (result.code, result.err) == (130, "microrad: stopped; the best model so far was written\n")
    assert "u_100mV-mirror.toml written (per axis, order 2 each)." in result.out
    text = (folder / "u_100mV-mirror.toml").read_text(encoding="utf-8")
    assert "# The identification was stopped before its end: larger models were not fitted.\n" in text
    assert of(load_coupled_mirror(folder / "u_100mV-mirror.toml")).mirror.name == "u_100mV"


@pytest.mark.usefixtures("given")
def test_stopped_before_the_first_model_nothing_is_written(call, folder):
    result = call("identify", *arrays(folder), *AXES, "--output-unit", "m")
    assert (result.code, result.out, result.err) == (130, "", "microrad: interrupted, nothing was written\n")
    assert sorted(path.name for path in folder.iterdir()) == ["u_100mV.npy", "y_100mV.npy"]


@pytest.mark.promise("readme-9")
@pytest.mark.usefixtures("quick")
def test_a_folder_of_the_virtual_bench_whose_drives_are_played_one_after_the_other(call, folder):
    plan = PLAN
    chirp = 'kind = "chirp"\nstart = "40 Hz"\nduration = "0.15 s"\namplitude = "1 V"\noffset = "6 V"\n'
    for axis, stop in ((1, 400), (2, 400), (1, 450), (2, 450)):
        plan += f'[excitation.axis-{axis}-{stop}]\n{chirp}stop = "{stop} Hz"\naxis = {axis}\n'
    (folder / "plan.toml").write_text(plan)
    assert call("bench", "plan.toml").code == 0
    result = call("identify", "plan-bench", "--json")
    assert (result.code, result.err) == (0, "")
    data = json.loads(result.out)
    assert (data["mirror_file"], len(data["actuators"]), len(data["outputs"])) == ("plan-bench-mirror.toml", 2, 2)
    assert data["held_out"] == ["plan-bench/axis-1-450.csv", "plan-bench/axis-2-450.csv"]
    page = (folder / "plan-bench-mirror.html").read_text(encoding="utf-8")
    assert "nothing here was measured on a mirror" in page


# ------------------------------------------------------------------------------------------------------------ refusals
@pytest.mark.promise("recordings-16", "recordings-23")
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--static"], "--static is for one drive and one output, and these recordings have 2 and 2: leave it out"),
        (["--measured-drive"], "--measured-drive is for one drive and one output"),
        (["--model", "bouc-wen"], "--model is for one drive and one output"),
        (["--admissible"], "--admissible is for one drive and one output"),
        (["--seed", "4"], "--seed is for one drive and one output"),
        (["--hold-out", "0.3"], "--hold-out is for one drive and one output"),
        (["--lever-arm", "50 mm"], "--lever-arm is for one drive and one output"),
        (["--output-file", "y.npy"], "--output-file is given 2 times and there are 1 files of drives"),
        (["--time", "t"], "--axes reads whole arrays, one of drives and one of outputs: leave out --time"),
        (["--input", "a", "--input", "b"], "leave out a second --input or --output"),
        (["--position", "1 mm"], "'1 mm' is no place; give x and y as '12 mm,-6 mm'"),
        (["--position", "1 mm,2 V"], "another kind of quantity"),
        (["--position", "1 mm,2 mm"], "--position is given 1 times and there are 2 outputs"),
        (
            ["--position", "1 mm,2 mm", "--position", "3 mm,4 mm", "--output-unit", "m"],
            "the positions do not give the tilts: 2 of 2 displacements",
        ),
        (["--position", "1 mm,2 mm", "--position", "3 mm,4 mm"], "the outputs are angles, which are alike"),
        (["--output-unit", "rad"], "moves by"),
        (["--period", "512"], "--axes (axes) says where the periods are; leave out --period"),
        (["--name", " "], "the mirror has no name"),
    ],
)
def test_what_means_nothing_for_several_channels(refused, folder, quick, options, words):
    output = 1e6 * Y if "rad" in options else Y
    message = refused("identify", *arrays(folder, output=output), *AXES, *options)
    assert words in " ".join(message.split())


@pytest.mark.promise("recordings-1")
def test_options_beside_a_list_are_refused(refused, folder):
    (folder / "list.toml").write_text("[recording.a]\nfile = 'a.npz'\n")
    for option in (
        ["--input", "u"],
        ["--output-file", "y.npy"],
        ["--rate", "2 kHz"],
        ["--lever-arm", "1 mm"],
        ["--input-unit", "mV"],
        ["--output-unit", "urad"],
    ):
        message = refused("identify", "list.toml", *option)
        assert f"list.toml is a list of recordings and {option[0]} is for files: write it into the list" in message
    message = refused("identify", table(folder), "list.toml", "--input", 1, "--output", 3)
    assert "list.toml is a list of recordings: give it alone, and name the other files in it" in message


def test_signs_of_one_channel_are_refused(refused, folder):
    listed = f'input = "ux"\noutput = 3\nsigns = [[1]]\n[recording.a]\nfile = "{table(folder)}"\n'
    (folder / "list.toml").write_text(listed)
    assert "positions and signs are for several outputs or drives" in refused("identify", "list.toml")


def test_positions_and_outputs_apart_of_one_channel_are_refused(refused, folder):
    name = table(folder)
    one = ("--input", "ux", "--output", "3", "--position", "1 mm,2 mm")
    assert "positions and signs are for several outputs or drives" in refused("identify", name, *one)
    message = refused("identify", name, "--input", "ux", "--output", "3", "--output-file", name)
    assert "--output-file is for whole arrays: say with --axes what their axes are" in message


def test_drives_that_cannot_be_told_apart_are_refused_by_all_recordings(refused, folder):
    tied = U.copy()
    tied[:, 1] = 2.0 * tied[:, 0]
    message = refused("identify", *arrays(folder, tied, 1e-6 * tied + 0.1 * Y), *AXES, "--output-unit", "m")
    assert "u_100mV.npy realisation 0 and 3 more: the input 'drive[1]' is a copy of the input 'drive[0]'" in message
    still = U.copy()
    still[:, 1] = 0.0
    message = refused("identify", *arrays(folder, still, 1e-6 * U + 0.1 * Y), *AXES, "--output-unit", "m")
    assert "the input 'drive[1]' moves in none of the recordings" in message


@pytest.mark.promise("recordings-25")
def test_an_actuator_that_moves_nothing(refused, folder):
    noise = np.random.Generator(np.random.Philox(2)).standard_normal(Y.shape)
    output = 1e-6 * U[:, :1] * np.array([1.0, 0.5])[:, None, None] + 1e-7 * noise
    message = refused("identify", *arrays(folder, output=output), *AXES, "--output-unit", "m")
    assert (
        "u_100mV.npy realisation 0: the drive 'drive[1]' moves nothing: the response of every output to it" in message
    )


def test_one_recording_for_fit_and_validation_is_refused(refused, folder):
    names = arrays(folder)
    message = refused("identify", *names, "--validate", *names, *AXES, "--output-unit", "m")
    assert "u_100mV.npy realisation 0: the same data as u_100mV.npy realisation 0; give each recording once" in message


@pytest.mark.promise("identify-39")
def test_amplitudes_of_other_lengths_rates_or_channels(refused, folder):
    whole, short = arrays(folder), arrays(folder, U[:300], Y[:300], "200mV")
    files = (whole[0], short[0], *whole[1:], *short[1:])
    message = refused("identify", *files, *AXES, "--output-unit", "m")
    assert (
        "u_200mV.npy realisation 0: 600 samples in periods of 300, where u_100mV.npy realisation 0 has 1024 s"
        in message
    )
    short = arrays(folder, U, Y[:, :1], "200mV")
    message = refused("identify", *files, *AXES, "--output-unit", "m")
    assert "u_200mV.npy realisation 0: 2 inputs and 1 output, where u_100mV.npy realisation 0 has 2 and 2" in message
    np.savez(folder / "slow.npz", u=2.0 * U, y=2.0 * Y, fs=500.0)
    (folder / "list.toml").write_text(
        """axes = ["samples", "channels", "realisations", "periods"]
output_unit = "m"
[recording.fast]
file = "u_100mV.npy"
output_file = "y_100mV.npy"
rate = "2 kHz"
[recording.slow]
file = "slow.npz"
input = "u"
output = "y"
"""
    )
    message = refused("identify", "list.toml")
    assert "slow.npz realisation 0: the sample rate is 500 Hz and that of u_100mV.npy realisation 0 2000 Hz" in message


@pytest.mark.promise("identify-48", "recordings-24")
@pytest.mark.parametrize(
    ("signs", "words"),
    [
        ("[[-1, -1], [0, 0]]", "it would agree where the output 'output[0]' is reversed: check the wiring"),
        ("[[-1, 1], [1, 1]]", "it would agree where the outputs 'output[0]' and 'output[1]' are swapped: check"),
        ("[[1, 1], [1, -1]]", "is reversed or the inputs 'drive[0]' and 'drive[1]' are swapped: check the wiring"),
        ("[[-1, 1], [0, -1]]", "no single sensor reversed or pair of channels swapped explains it"),
    ],
)
def test_signs_that_the_response_contradicts(refused, folder, signs, words):
    arrays(folder)
    (folder / "list.toml").write_text(
        f"""axes = ["samples", "channels", "realisations", "periods"]
rate = "2 kHz"
output_unit = "m"
signs = {signs}
[recording.all]
file = "u_100mV.npy"
output_file = "y_100mV.npy"
"""
    )
    message = refused("identify", "list.toml")
    assert "u_100mV.npy realisation 0: at low frequency the output 'output[" in message
    assert words in message


@pytest.mark.promise("identify-48", "recordings-24")
def test_a_sensor_that_four_places_show_to_be_reversed(refused, folder):
    """Four displacements of a flat mirror: a plane for each drive, but for the sensor that is wired the wrong way."""
    places = np.array([[10.0, 0.0], [0.0, 10.0], [-10.0, 1.0], [2.0, -10.0]])
    flat = np.column_stack([np.ones(4), places / 10.0]) @ np.array([[0.2, -0.1], [1.0, 0.3], [0.4, -1.2]])
    flat[2] *= -1
    output = 1e-6 * np.einsum("oi,sirp->sorp", flat, U) + 1e-8 * np.random.Generator(
        np.random.Philox(1)
    ).standard_normal((PERIOD, 4, 4, 2))
    options = [f"--position={x} mm,{y} mm" for x, y in places.tolist()]
    message = refused("identify", *arrays(folder, output=output), *AXES, "--output-unit", "m", *options)
    assert "% of what the outputs show is neither tilt nor piston of the positions that are stated" in message
    assert "it would agree where the output 'output[2]' is reversed" in message


@pytest.mark.promise("identify-48", "recordings-23", "recordings-24")
def test_places_of_three_sensors_agree_with_any_response_and_a_line_of_them_is_refused():
    third = Y[:, :1] - 0.5 * Y[:, 1:]
    output = np.concatenate((Y, -third), axis=1)  # as it is wired, and with each sensor turned round
    outputs = [
        Output(f"y{k}", "displacement", position_m=place)
        for k, place in enumerate([(0.01, 0), (0, 0.01), (-0.01, -0.01)])
    ]
    for turned in ((1, 1, 1), (-1, 1, 1), (1, 1, -1)):
        sign = np.array(turned)[:, None, None]
        check_wiring("u.npy", response_from_records(multisine_recordings(U, sign * output, RATE_HZ)), outputs, None)
    on_a_line = [replace(each, position_m=(0.01 * k, 0.02 * k)) for k, each in enumerate(outputs)]
    found = response_from_records(multisine_recordings(U, output, RATE_HZ))
    with pytest.raises(IdentificationError, match="do not give the tilts: all displacements lie on one line"):
        check_wiring("u.npy", found, on_a_line, None)


# --------------------------------------------------------------------------------------------------------------- names
@pytest.mark.parametrize(
    ("files", "name"),
    [
        (["loop.csv"], "loop"),
        (["lab/loop-60Hz.csv", "lab/loop-80Hz.csv"], "loop"),
        (["lab/60Hz.csv", "lab/80Hz.csv", "lab/chirp.csv"], "lab"),
        (["lab/u_100mV_train.npy", "lab/u_200mV_train.npy"], "lab"),
        (["lab/fsm3_1.csv", "lab/fsm3_2.csv"], "fsm3"),
        (["lab/fsm1.csv", "lab/fsm2.csv"], "fsm"),
        (["lab/mirror chirp.csv", "lab/mirror check.csv"], "mirror"),
        (["one/a.csv", "two/b.csv"], "a"),
        (["one/loop.csv", "two/loop.csv"], "loop"),
        (["/a.csv", "/b.csv"], "a"),
        (["mirror-characterisation-bench"], "mirror-characterisation-bench"),
        (["."], "bench"),
        (["./sub/.."], "bench"),
        ([".."], "here"),
    ],
)
def test_what_a_mirror_of_several_files_is_called(folder, monkeypatch, files, name):
    (folder / "here" / "bench" / "sub").mkdir(parents=True)
    monkeypatch.chdir(folder / "here" / "bench")
    assert recordings.common_name([Path(file) for file in files]) == name


def test_an_option_for_one_drive_and_one_output_is_refused_with_the_numbers_of_each():
    given = SimpleNamespace(channels=(3, 2))
    refuse_options(given, {"--static": False})
    with pytest.raises(
        Refusal, match="--seed is for one drive and one output, and these recordings have 3 and 2: leave"
    ):
        refuse_options(given, {"--static": False, "--seed": True})


@pytest.mark.parametrize(("stopped", "as_json"), [(False, False), (True, False), (False, True)])
def test_what_was_said_of_several_channels_is_handed_on_and_their_files_are_written_last(
    folder, monkeypatch, capsys, stopped, as_json
):
    from microrad import report

    steps = []
    given = recordings.Given(("fitted",), ("checked",), True, "listed", None, ((0.0, 1.0), (2.0, 3.0)), ("signs",))
    target = cli_coupled.Target(Path("m.toml"), Path("p.html"), "the title", True, lambda: steps.append("checked"))
    found = SimpleNamespace(stopped=stopped)
    files = {"mirror_file": target.mirror_file, "report_file": target.page}

    def identify(*fitted, **more):
        assert callable(more.pop("on_progress"))
        steps.append((fitted, more))
        return found

    def write(*given, **more):
        assert not (folder / "m.toml").exists()
        steps.append((given, more))

    monkeypatch.setenv("COLUMNS", "93")
    monkeypatch.setattr(coupled, "identify_coupled", identify)
    monkeypatch.setattr(
        "microrad.lab.identify.coupled.mirror_file.coupled_file_text", lambda found, every, title: f"# {every} {title}"
    )
    monkeypatch.setattr(
        report, "coupled_identification_text", lambda found, width, **more: f"{width} wide, {more == files}"
    )
    monkeypatch.setattr(report, "coupled_identification_data", lambda found, **more: {"same": more == files})
    monkeypatch.setattr(report, "write_coupled_identification", write)
    outcome = cli_coupled.identify_channels(given, ("mV", "um"), "said", target, as_json)
    assert outcome.code == (130 if stopped else 0)
    assert outcome.text == ('{\n  "same": true\n}' if as_json else "said\n\n93 wide, True")
    text = "# ('fitted', 'checked') the title"
    asked = {"drive_unit": "mV", "output_unit": "um", "positions_m": given.positions_m, "signs": ("signs",)}
    page = {
        "mirror_file": Path("m.toml"),
        "mirror_text": text,
        "title": "the title",
        "overwrite": True,
        "virtual": True,
    }
    first = (("fitted",),), {"validation": ("checked",), **asked}
    assert steps == [first, "checked", ((found, Path("p.html")), page)]
    assert (folder / "m.toml").read_text("utf-8") == text
    said = "microrad: stopped; the best model so far was written\n" if stopped else ""
    assert capsys.readouterr().err == said
