"""A list of recordings: what is read by it, and every fault of it at once, with its line."""

import re

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

from microrad.lab.recording import RecordingError
from microrad.lab.recording.list_file import ListTable, RecordingsError, RecordingTable, read_list
from microrad.mission.fields import MOST_ITEMS
from places import ROOT

N, RATE_HZ = 800, 1000.0
TIME_S = np.arange(N) / RATE_HZ
RNG = np.random.Generator(np.random.Philox(5))
DRIVE = np.column_stack((np.sin(2 * np.pi * 11 * TIME_S), np.cos(2 * np.pi * 17 * TIME_S)))
OUTPUT = DRIVE @ np.array([[1.0, -0.3], [0.2, 0.8]]) + 0.01 * RNG.standard_normal((N, 2))


def write_csv(path, names="t,u, x,u y,x,y"):
    table = np.column_stack((TIME_S, DRIVE, OUTPUT))
    path.write_text(names + "\n" + "".join(",".join(map(repr, row)) + "\n" for row in table.tolist()))


def write_list(folder, text):
    path = folder / "list.toml"
    path.write_text(text)
    return path


def faults(folder, text):
    with pytest.raises(RecordingsError) as caught:
        read_list(write_list(folder, text))
    return {(fault.key, fault.line): f"{fault.reason}; {fault.expected}" for fault in caught.value.faults}


def refusal(folder, text):
    with pytest.raises(RecordingError) as caught:
        read_list(write_list(folder, text))
    message = str(caught.value)
    assert message.startswith(str(folder / "list.toml"))
    return message


@pytest.mark.promise("recordings-19", "recordings-20", "recordings-21")
def test_columns_period_units_and_roles_by_file(tmp_path):
    write_csv(tmp_path / "both.csv", "t;ux, slow;uy;x;y".replace(";", ","))
    (tmp_path / "both.csv").write_text((tmp_path / "both.csv").read_text().replace("ux, slow", "ux"))
    np.savez(tmp_path / "again.npz", u=DRIVE[::-1], y=OUTPUT[::-1], fs=RATE_HZ)
    found = read_list(
        write_list(
            tmp_path,
            """
name = "fsm 3"
output = ["x", "y"]
output_unit = "um"
lever_arm = "50 mm"
positions = [["0 mm", "12 mm"], ["10 mm", "-6 mm"]]
signs = [[1, 0], [-1, 1]]

[recording.slow]
file = "both.csv"
input = ["ux", 2]
from = "0.1 s"
to = "0.5 s"
role = "loops"

[recording.rest]
file = "both.csv"
input = ["ux", "uy"]
from = "0.5 s"
role = "validation"

[recording.turned]
file = "again.npz"
input = "u"
output = "y"
axes = ["samples", "channels"]
period = 400
input_unit = "mV"
""",
        )
    )
    slow, turned = found.recordings
    (rest,) = found.validation
    assert [r.role for r in (slow, turned, rest)] == ["loops", "", "validation"]
    assert (slow.path, rest.path) == (f"{tmp_path}/both.csv from 0.1 s to 0.5 s", f"{tmp_path}/both.csv from 0.5 s")
    np.testing.assert_allclose(slow.drive, DRIVE[100:500])
    np.testing.assert_allclose(rest.output, OUTPUT[500:])
    np.testing.assert_array_equal(turned.output, OUTPUT[::-1])
    assert (slow.output_names, turned.output_names) == (("x", "y"), ("y[0]", "y[1]"))
    assert (slow.period_samples, turned.period_samples, slow.rate_hz) == (None, 400, RATE_HZ)
    assert (slow.output_units, turned.output_units) == (("um", "um"), ("um", "um"))
    assert (slow.input_units, turned.input_units) == (("", ""), ("mV", "mV"))
    assert len({r.sha256 for r in (slow, turned, rest)}) == 3
    assert (found.name, found.lever_arm_m, found.signs) == ("fsm 3", 0.05, ((1, 0), (-1, 1)))
    assert found.positions_m == ((0.0, 0.012), (0.01, -0.006))


def test_a_name_with_a_comma_is_one_column(tmp_path):
    np.savez(tmp_path / "a.npz", **{"u, x": DRIVE[:, 0], "y": OUTPUT[:, 0], "fs": RATE_HZ})
    found = read_list(write_list(tmp_path, '[recording.a]\nfile = "a.npz"\ninput = "u, x"\noutput = "y"\n'))
    assert found.recordings[0].input_names == ("u, x",)


@pytest.mark.promise("recordings-19")
def test_every_fault_is_told_at_once(tmp_path):
    found = faults(
        tmp_path,
        """input = ["u1", "u2"]
rate = "1 km"
positons = 3
signs = [[1, 2]]
[recording.a]
fil = "a.csv"
period = 3.5
axes = ["samples", "samples"]
[recording.b]
file = "a.csv"
output = [1, true]
role = "loop"
from = "3 s"
to = "2 s"
accept = ["noise"]
output_unit = "km"
[recording]
c = 3
""",
    )
    words = {
        ("rate", 2): "another kind of quantity",
        ("positons", 3): "is no key of the list of recordings",
        ("signs", 4): "has an item that is none of 1, -1 and 0; a list for each output, with 1, -1 or 0 for each",
        ("recording.a.fil", 6): "is no key of [recording.a]",
        ("recording.a.period", 7): "is not a whole number",
        ("recording.a.axes", 8): 'holds "samples", which stands twice',
        ("recording.b.output", 11): "holds true, which is no channel; the name of a channel, its number from 0",
        ("recording.b.role", 12): 'role = "loops" or role = "broadband" or role = "validation"',
        ("recording.b.to", 14): "is not above from",
        ("recording.b.accept", 15): 'holds "noise", which is none of them',
        ("recording.b.output_unit", 16): "is none of the choices",
        ("recording.c", 18): "is no table; [recording.c] with its file below it",
    }
    for place, text in words.items():
        assert text in found.get(place, ""), (place, found)
    assert len(found) == len(words)


@pytest.mark.promise("recordings-19", "recordings-20")
def test_what_does_not_fit_together(tmp_path):
    found = faults(
        tmp_path,
        """[recording.a]
file = "a.csv"
input = "u"
[recording.b]
file = "b.npz"
input = ["u", "v"]
axes = ["samples", "channels"]
time = "t"
[recording.c]
file = "c.npz"
input = "u"
output = "y"
output_file = "d.npz"
[recording.d]
file = "c.npz"
input = "u"
output = "y"
output_file = "d.npz"
axes = ["samples"]
from = "1 s"
to = "2 s"
role = "validation"
[recording.e]
file = "c.npz"
input = "u"
output_file = "d.npz"
axes = ["samples"]
from = "1.5 s"
""",
    )
    words = {
        ("recording.a.output", 1): "is missing; output = ",
        ("recording.b.input", 6): "names several arrays, beside axes",
        ("recording.b.time", 8): "is no column of this recording",
        ("recording.c.output_file", 13): "stands without axes",
        ("recording.d", 14): "takes samples for validation that [recording.e] fits",
    }
    for place, text in words.items():
        assert text in found.get(place, ""), (place, found)
    assert len(found) == len(words)


def test_what_is_not_fitted_may_stand_before_what_is(tmp_path):
    (tmp_path / "c.csv").write_text("u,y\n" + "".join(f"{u},{2 * u}\n" for u in np.sin(np.arange(3000) ** 1.4)))
    entry = '[recording.{name}]\nfile = "c.csv"\ninput = "u"\noutput = "y"\nrate = "1 kHz"\n'
    early = entry.format(name="a") + 'to = "1 s"\nrole = "validation"\n'
    found = read_list(write_list(tmp_path, early + entry.format(name="b") + 'from = "1 s"\n'))
    assert [each.samples for each in (*found.validation, *found.recordings)] == [1000, 2000]
    told = faults(tmp_path, early + entry.format(name="b") + 'from = "0.9 s"\n')
    assert "takes samples for validation that [recording.b] fits" in " ".join(told.values())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("name = 'x'\n", "a table [recording.NAME] for each recording, with its file"),
        ("recording = 3\n", "is no group of named tables"),
        ("recording = {}\n", "is no group of named tables; a table [recording.NAME] for each recording, with its file"),
        ("[recording.a\n", "is no table header"),
    ],
)
def test_what_is_no_list(tmp_path, text, words):
    assert any(words in told for told in faults(tmp_path, text).values())


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("input = 1.5", "is no list of that kind; the name of a channel, its number from 0, or a list of them"),
        ("input = []", "is no list of that kind; the name of a channel"),
        ("input = [1.5]", "holds 1.5, which is no channel"),
        ('input = ""', 'holds "", which is no channel'),
        ("input = true", "holds true, which is no channel"),
        ('time = ["t", "s"]', "is no column of this recording; one column, of a file without axes"),
        ('positions = [["0 mm"]]', "has a place that is no pair; a list of x and y for each output"),
        ('positions = [["0 mm", "1 mm", "2 mm"]]', "is no list of that kind; a list of x and y for each output"),
        ("positions = []", "is no list of that kind; a list of x and y for each output"),
        ("signs = [[true]]", "has an item that is none of 1, -1 and 0"),
        ("signs = [[]]", "is no list of that kind; a list for each output, with 1, -1 or 0 for each input"),
        ("signs = 1", "is no list of that kind; a list for each output"),
        ('axes = ["channels", "periods"]', "does not say which axis is samples; the axes of the array in their order"),
        (
            'axes = ["samples", "time"]',
            'holds "time", which is none of them; a list of different words out of samples,',
        ),
        ("period = 1", "is below 2"),
    ],
)
def test_what_is_no_value_of_its_key(tmp_path, line, words):
    common = {"input": "input = 1", "output": "output = 2"} | {line.partition(" ")[0]: line}
    found = faults(tmp_path, "\n".join(common.values()) + '\n[recording.a]\nfile = "a.csv"\n')
    (told,) = found.values()
    assert words in told


def test_a_key_takes_so_many_items_and_no_more(tmp_path):
    text = 'input = {}\noutput = 2\n[recording.a]\nfile = "a.csv"\n'
    assert "there is no such file" in refusal(tmp_path, text.format(list(range(MOST_ITEMS))))
    (told,) = faults(tmp_path, text.format(list(range(MOST_ITEMS + 1)))).values()
    assert "is no list of that kind" in told


def test_a_list_has_so_many_recordings_and_no_more(tmp_path):
    entries = [f'[recording.r{k}]\nfile = "a.csv"\n' for k in range(MOST_ITEMS + 1)]
    common = "input = 1\noutput = 2\n"
    assert "there is no such file" in refusal(tmp_path, common + "".join(entries[:-1]))
    (told,) = faults(tmp_path, common + "".join(entries)).values()
    assert told == "is no group of named tables; a table [recording.NAME] for each recording, with its file"


@pytest.mark.parametrize(("begin", "end"), [("2 s", "2 s"), ("2 s", "1.9 s")])
def test_a_part_that_does_not_begin_before_it_ends_is_no_part(tmp_path, begin, end):
    text = f'[recording.a]\nfile = "a.csv"\ninput = 1\noutput = 2\nfrom = "{begin}"\nto = "{end}"\n'
    assert faults(tmp_path, text) == {("recording.a.to", 6): "is not above from; a later time"}


def test_arrays_alone_in_their_files_need_no_names(tmp_path):
    np.save(tmp_path / "u.npy", DRIVE)
    np.save(tmp_path / "y.npy", OUTPUT)
    np.save(tmp_path / "z.npy", OUTPUT[::-1])
    entry = '[recording.{}]\nfile = "u.npy"\noutput_file = "{}.npy"\naxes = ["samples", "channels"]\nrate = "1 kHz"\n'
    held_out = entry.format("b", "z") + 'role = "validation"\n'  # the same drives, and outputs of another file
    found = read_list(write_list(tmp_path, entry.format("a", "y") + held_out))
    np.testing.assert_array_equal(found.recordings[0].output, OUTPUT)
    np.testing.assert_array_equal(found.validation[0].output, OUTPUT[::-1])
    told = faults(tmp_path, entry.format("a", "y") + held_out.replace("z.npy", "y.npy"))
    assert list(told) == [("recording.b", 6)]
    assert "takes samples for validation that [recording.a] fits" in told["recording.b", 6]


@pytest.mark.parametrize("time", ["3", '"clock"', '["clock"]'])
def test_the_time_may_be_a_column_that_is_not_called_so(tmp_path, time):
    rows = np.column_stack((DRIVE[:, 0], OUTPUT[:, 0], TIME_S * 3, TIME_S)).tolist()
    text = "u,y,other,clock\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows)
    (tmp_path / "a.csv").write_text(text)
    entry = '[recording.a]\nfile = "a.csv"\ninput = "u"\noutput = "y"\n'
    (found,) = read_list(write_list(tmp_path, f"{entry}time = {time}\n")).recordings
    assert found.rate_hz == pytest.approx(RATE_HZ)
    assert "give the rate" in refusal(tmp_path, entry)


@pytest.mark.parametrize("axes", ["", 'axes = ["samples"]\n'])
def test_what_a_check_finds_can_be_taken_on_in_a_list(tmp_path, axes):
    np.savez(tmp_path / "a.npz", u=DRIVE[:, 0], y=np.minimum(OUTPUT[:, 0], 0.5), fs=RATE_HZ)
    entry = f'[recording.a]\nfile = "a.npz"\ninput = "u"\noutput = "y"\n{axes}'
    message = refusal(tmp_path, entry)
    assert "To take it on as it is: --accept clipping" in message
    (found,) = read_list(write_list(tmp_path, f'{entry}accept = ["clipping"]\n')).recordings
    assert [each.kind for each in found.findings if each.refused] == ["clipping"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('positions = [["0 mm", "1 mm"], ["0 mm", "2 mm"]]', "positions has 2 places and there are 1 output, y; give"),
        (
            "signs = [[1], [1]]",
            "signs has rows of 1, 1 items and there are 1 output and 1 input; give a row for each",
        ),
        ("signs = [[1, 1]]", "signs has rows of 2 items and there are 1 output and 1 input; give a row for each"),
    ],
)
def test_places_and_signs_are_as_many_as_the_channels_of_a_single_axis(tmp_path, line, words):
    np.savez(tmp_path / "a.npz", u=DRIVE[:, 0], y=OUTPUT[:, 0], fs=RATE_HZ)
    entry = '[recording.a]\nfile = "a.npz"\ninput = "u"\noutput = "y"\n'
    assert words in refusal(tmp_path, f"{line}\n{entry}")
    fitting = 'positions = [["0 mm", "1 mm"]]\nsigns = [[-1]]\n'
    found = read_list(write_list(tmp_path, fitting + entry))
    assert (found.positions_m, found.signs) == (((0.0, 0.001),), ((-1,),))


@pytest.mark.parametrize(("output", "told"), [('"y"', False), ('["y", "x"]', True)])
def test_recordings_of_one_drive_are_judged_together_where_they_have_several_outputs(tmp_path, output, told):
    np.savez(tmp_path / "a.npz", u=DRIVE[:, 0], y=OUTPUT[:, 0], x=OUTPUT[::-1, 0] + OUTPUT[:, 0], fs=RATE_HZ)
    entry = f'[recording.{{}}]\nfile = "a.npz"\ninput = "u"\noutput = {output}\n'
    both = entry.format("a") + entry.format("b")
    if told:
        assert "a.npz: the same data as" in refusal(tmp_path, both)
    else:
        assert len(read_list(write_list(tmp_path, both)).recordings) == 2


@pytest.mark.parametrize(
    ("line", "missing"),
    [
        ("[recording.a", False),
        ("recording = 1 kHz", False),
        ("recording.a.file = a", False),
        ("rate = 1 kHz", True),
        ("recordings = 1 kHz", True),
    ],
)
def test_tables_are_missing_unless_their_own_line_is_broken(tmp_path, line, missing):
    told = faults(tmp_path, line + "\n").values()
    assert any("is missing; a table [recording.NAME]" in each for each in told) == missing
    assert any("is not TOML" in each or "is no table header" in each for each in told)


def test_a_list_that_does_not_exist(tmp_path):
    with pytest.raises(RecordingsError, match="the list of recordings does not exist"):
        read_list(tmp_path / "none.toml")


@pytest.mark.promise("recordings-14", "recordings-20")
def test_what_the_recordings_contradict(tmp_path):
    write_csv(tmp_path / "a.csv", "t,ux (mV),uy (mV),x (um),y (um)")
    start = "input = [1, 2]\noutput = [3, 4]\n"
    entry = '[recording.a]\nfile = "a.csv"\n'
    assert "there are 2 outputs, x (um), y (um); give one place" in refusal(
        tmp_path, f'{start}positions = [["0 mm", "1 mm"]]\n{entry}'
    )
    assert "signs has rows of 2 items and there are 2 outputs and 2 inputs" in refusal(
        tmp_path, f"{start}signs = [[1, 1]]\n{entry}"
    )
    message = refusal(tmp_path, f'{start}input_unit = "V"\n{entry}')
    assert "[recording.a]: " in message
    assert "the drive is to be read in V and the file says mV" in message
    assert "every recording is for validation" in refusal(tmp_path, f'{start}{entry}role = "validation"\n')
    assert "[recording.a]: " in refusal(tmp_path, f'{start}{entry}to = "0.9 s"\n')
    assert "no input column is named 'ux'" in refusal(tmp_path, f'{start}{entry}input = "ux"\n')
    message = refusal(tmp_path, f'input = [1, 2]\noutput = [3, 4]\n{entry}[recording.b]\nfile = "a.csv"\noutput = 3\n')
    assert "2 inputs and 1 output, where" in message


@pytest.mark.promise("recordings-20", "recordings-21", "recordings-31")
def test_the_list_of_the_documentation_is_read(tmp_path):
    page = (ROOT / "docs" / "recordings.md").read_text(encoding="utf-8")
    text = page.partition("```toml\n")[2].partition("```")[0]
    time_s = np.arange(6000) / 100.0
    drive = 5 + 5 * np.sin(time_s * (1.0 + 0.2 * time_s))
    rows = np.column_stack((time_s, drive, drive + 0.01 * RNG.standard_normal(time_s.size)))
    np.savetxt(tmp_path / "loops.csv", rows, delimiter=",", header="time,drive (V),sensor", comments="", fmt="%.9g")
    channels = [
        ChannelObject("bench", name, rows[:, k], {"wf_increment": 0.01}) for k, name in ((1, "drive"), (2, "sensor"))
    ]
    with TdmsWriter(tmp_path / "chirp.tdms") as file:
        file.write_segment(channels)
    found = read_list(write_list(tmp_path, text))
    assert [(r.role, r.samples) for r in found.recordings] == [("loops", 4000), ("broadband", 6000)]
    assert [(r.role, r.samples) for r in found.validation] == [("validation", 2000)]
    assert (found.name, found.lever_arm_m) == ("fsm 3", 0.05)
    keys = {info.alias or name for name, info in (ListTable.model_fields | RecordingTable.model_fields).items()}
    table = page.partition("| key | |")[2].partition("\n\n")[0]
    assert keys - {"recording"} <= set(re.findall(r"`(\w+)`", table))


@pytest.mark.parametrize(
    ("drives", "outputs", "message"),
    [
        ("mV", "um", ""),
        ("V", "um", "the drive is to be read in V and the file says mV"),
        ("mV", "mm", "the output is to be read in mm and the file says um"),
        ("mV", None, ""),
        (None, "mm", "the output is to be read in mm and the file says um"),
        (None, "um", ""),
    ],
)
def test_drives_and_outputs_are_each_held_against_their_own_unit(tmp_path, drives, outputs, message):
    write_csv(tmp_path / "a.csv", "t,ux (mV),uy (mV),x (um),y (um)")
    units = {"input_unit": drives, "output_unit": outputs}
    stated = "".join(f'{key} = "{unit}"\n' for key, unit in units.items() if unit is not None)
    text = f'input = [1, 2]\noutput = [3, 4]\n{stated}[recording.a]\nfile = "a.csv"\n'
    if message:
        assert message in refusal(tmp_path, text)
    else:
        (found,) = read_list(write_list(tmp_path, text)).recordings
        assert (found.input_units, found.output_units) == (("mV", "mV"), ("um", "um"))


# ------------------------------------------------------------------------------- several recordings in other folders
def two_folders(folder):
    """A list in one folder, recordings in two others, each of other channels and rates."""
    (folder / "one").mkdir()
    (folder / "two" / "deep").mkdir(parents=True)
    write_csv(folder / "one" / "a.csv", "t,ux (V),uy (V),x (um),y (um)")
    np.savez(folder / "two" / "u.npz", drives=DRIVE.T[:, ::-1][:, None, :], fs=2 * RATE_HZ)
    np.savez(folder / "two" / "deep" / "y.npz", sensors=OUTPUT.T[:, ::-1][:, None, :] + 7.0)


COMMON = """
rate = "1 kHz"
accept = ["drift", "lead"]
input = ["ux (V)", 2]
output = [4, "x (um)"]
output_unit = "um"

[recording.first]
file = "one/a.csv"
from = "0.1 s"
to = "0.45 s"
period = 50
role = "broadband"

[recording.held]
file = "one/a.csv"
from = "0.45 s"
role = "validation"
accept = ["drift"]

[recording.arrays]
file = "two/u.npz"
output_file = "two/deep/y.npz"
input = "drives"
output = "sensors"
axes = ["channels", "realisations", "samples"]
rate = "2 kHz"
period = 40
from = "0.05 s"
input_unit = "mV"
output_unit = "mrad"
role = "loops"
"""


def test_entries_take_what_is_common_unless_they_have_their_own(tmp_path):
    two_folders(tmp_path)
    found = read_list(write_list(tmp_path, COMMON))
    (first, arrays), (held,) = found.recordings, found.validation
    assert [each.role for each in (first, arrays, held)] == ["broadband", "loops", "validation"]
    assert first.path == f"{tmp_path / 'one' / 'a.csv'} from 0.1 s to 0.45 s"
    assert held.path == f"{tmp_path / 'one' / 'a.csv'} from 0.45 s"
    assert arrays.path == f"{tmp_path / 'two' / 'u.npz'} realisation 0 from 0.05 s"
    assert [each.rate_hz for each in (first, held, arrays)] == [1000.0, 1000.0, 2000.0]
    assert [each.period_samples for each in (first, held, arrays)] == [50, None, 40]
    assert (first.input_names, first.output_names) == (("ux (V)", "uy (V)"), ("y (um)", "x (um)"))
    assert (arrays.input_names, arrays.output_names) == (
        ("drives[0]", "drives[1]"),
        ("sensors[0]", "sensors[1]"),
    )
    assert (first.input_units, first.output_units) == (("V", "V"), ("um", "um"))
    assert (arrays.input_units, arrays.output_units) == (("mV", "mV"), ("mrad", "mrad"))
    np.testing.assert_allclose(first.output, OUTPUT[100:450, ::-1])
    np.testing.assert_allclose(held.drive, DRIVE[450:])
    np.testing.assert_allclose(arrays.drive, DRIVE[::-1][100:])
    np.testing.assert_allclose(arrays.output, OUTPUT[::-1][100:] + 7.0)
    assert (found.name, found.lever_arm_m, found.positions_m, found.signs) == (None, None, None, None)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'file = "one/a.csv"\nfrom = "0.1 s"',
            'file = "one/b.csv"\nfrom = "0.1 s"',
            "[recording.first]: {folder}/one/b.csv: there is no such file; check the path (nearest name in that "
            "directory: 'a.csv').",
        ),
        (
            'output_file = "two/deep/y.npz"',
            'output_file = "two/y.npz"',
            "[recording.arrays]: {folder}/two/y.npz: there is no such file; check the path (nearest name in that "
            "directory: 'u.npz').",
        ),
        (
            "period = 50",
            "period = 351",
            "[recording.first]: {folder}/one/a.csv from 0.1 s to 0.45 s: a period of 351 samples does not fit into 350 "
            "samples; give the length of one period in samples.",
        ),
        (
            'rate = "2 kHz"',
            'rate = "2.5 kHz"',
            "[recording.arrays]: {folder}/two/u.npz: two sample rates: 2500 Hz (given) and 2000 Hz (fs = 2000 Hz), 0.8 "
            "times as much; correct the wrong one (leave the rate out to use that of the file).",
        ),
        (
            'output_unit = "um"',
            'output_unit = "mm"',
            "[recording.first]: {folder}/one/a.csv from 0.1 s to 0.45 s: the output is to be read in mm and the file "
            "says um; give the unit that the file says, or convert its values.",
        ),
        (
            'accept = ["drift", "lead"]',
            'accept = ["drift", "lead"]\nsigns = [[1, 1, 0], [-1]]',
            "signs has rows of 3, 1 items and there are 2 outputs and 2 inputs; give a row for each output, with an "
            "item for each input.",
        ),
        (
            'accept = ["drift", "lead"]',
            'accept = ["drift", "lead"]\npositions = [["1 mm", "2 mm"], ["3 mm", "4 mm"], ["5 mm", "7 mm"]]',
            "positions has 3 places and there are 2 outputs, y (um), x (um); give one place for each, in their order.",
        ),
        (
            'output = [4, "x (um)"]',
            'output = [4, "ux (V)"]',
            "[recording.first]: {folder}/one/a.csv: input and output are both column 1 ('ux (V)'), so there is nothing "
            "to identify; give the drive as input and the sensor as output.",
        ),
    ],
)
def test_what_is_wrong_with_one_of_several_is_told_with_its_place_in_the_list(tmp_path, old, new, words):
    two_folders(tmp_path)
    assert old in COMMON
    text = COMMON.replace(old, new, 1)
    mark = ", " if words.startswith("[") else ": "
    assert refusal(tmp_path, text) == f"{tmp_path / 'list.toml'}{mark}{words.format(folder=tmp_path)}"


def test_findings_of_an_entry_are_kept_behind_its_place_in_the_list(tmp_path):
    two_folders(tmp_path)
    table = np.column_stack((TIME_S, DRIVE, OUTPUT[:, 0], np.minimum(OUTPUT[:, 1], 0.3)))
    text = "t,ux (V),uy (V),x (um),y (um)\n" + "".join(",".join(map(repr, row)) + "\n" for row in table.tolist())
    (tmp_path / "one" / "a.csv").write_text(text)
    with pytest.raises(RecordingError) as caught:
        read_list(write_list(tmp_path, COMMON))
    assert str(caught.value).startswith(
        f"{tmp_path / 'list.toml'}, [recording.first]: {tmp_path}/one/a.csv from 0.1 s to 0.45 s: the output, column 4 "
        "('y (um)') is clipped at 0.3: "
    )
    assert [(each.kind, each.output) for each in caught.value.findings] == [("clipping", 0)]
    both = COMMON.replace('["drift"', '["clipping", "drift"')
    assert [each.refused for r in read_list(write_list(tmp_path, both)).recordings for each in r.findings].count(True)


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (
            'accept = ["lead", "drift", "drift", "noise"]',
            'holds "drift", which stands twice; a list of different words out of jitter, clipping, dead, quantisation, '
            "drift, unexcited, lead",
        ),
        (
            'axes = ["samples", "period"]',
            'holds "period", which is none of them; a list of different words out of samples, channels, realisations, '
            "periods",
        ),
        (
            'input = ["u", ""]',
            'holds "", which is no channel; the name of a channel, its number from 0, or a list of them',
        ),
        (
            "output = [1, false]",
            "holds false, which is no channel; the name of a channel, its number from 0, or a list of them",
        ),
        (
            "signs = [[1, 0], [2, -1]]",
            "has an item that is none of 1, -1 and 0; a list for each output, with 1, -1 or 0 for each input",
        ),
        (
            'positions = [["1 mm", "2 mm"], ["3 mm"]]',
            "has a place that is no pair; a list of x and y for each output, as lengths",
        ),
    ],
)
def test_a_second_item_that_is_none_is_told_in_all_words(tmp_path, line, told):
    common = {"input": "input = 1", "output": "output = 2"} | {line.partition(" ")[0]: line}
    found = faults(tmp_path, "\n".join(common.values()) + '\n[recording.a]\nfile = "a.csv"\n')
    (reason,) = found.values()
    assert reason.startswith(told), reason


def test_the_second_of_two_validations_is_held_against_each_that_is_fitted(tmp_path):
    entry = '[recording.{}]\nfile = "{}"\ninput = 1\noutput = 2\nfrom = "{} s"\nto = "{} s"\n'
    held = 'role = "validation"\n'
    text = (
        entry.format("f", "a.csv", 0, 1)
        + entry.format("g", "a.csv", 2, 3)
        + entry.format("v", "a.csv", 1, 2)
        + held
        + entry.format("w", "a.csv", 2.5, 4)
        + held
        + entry.format("other", "b.csv", 0, 9)
        + held
    )
    assert faults(tmp_path, text) == {
        ("recording.w", 20): "takes samples for validation that [recording.g] fits; two parts of the file (from, to) "
        "without common samples"
    }


def test_for_a_list_that_is_missing_or_none_no_other_kind_of_file_is_asked(tmp_path):
    binary = tmp_path / "list.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    for path in (binary, tmp_path, tmp_path / "none.toml"):
        with pytest.raises(RecordingsError) as caught:
            read_list(path)
        (fault,) = caught.value.faults
        assert fault.expected == "a list of recordings, with a table [recording.NAME] for each"


GIVEN = 'input = "u"\noutput = "y"\n'
ROLES = 'role = "loops" or role = "broadband" or role = "validation"'
CHANNEL = '= "name of the channel", here or for all'


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            f'{GIVEN}[recording.x]\nfile = "a.csv"\nrate = 5',
            {
                (
                    "recording.x.rate",
                    5,
                ): 'is a number without a unit; a frequency with its unit; for example rate = "5 Hz"'
            },
        ),
        (
            f'{GIVEN}[recording.x]\nfile = "a.csv"\nfrom = "-1 s"',
            {("recording.x.from", 5): 'is below 0 s; a time with its unit, at least 0 s; for example from = "5 us"'},
        ),
        (
            f'{GIVEN}[recording.x]\nfile = "a.csv"\nto = "0 s"',
            {("recording.x.to", 5): 'is not above 0 s; a time with its unit, above 0 s; for example to = "5 us"'},
        ),
        (
            f'{GIVEN}[recording.x]\nfile = "a.csv"\nfrom = "2 s"\nto = "2 s"\nrole = "fit"',
            {
                ("recording.x.to", 6): "is not above from; a later time",
                ("recording.x.role", 7): f"is none of the choices; {ROLES}",
            },
        ),
        (
            f'{GIVEN}[recording.x]\nfile = "a.csv"\nfrom = "2 s"\nto = "2 s"',
            {("recording.x.to", 6): "is not above from; a later time"},
        ),
        (
            f"{GIVEN}[recording]\nx = 3",
            {("recording.x", 4): "is no table; [recording.x] with its file below it"},
        ),
        (
            f"{GIVEN}[recording]",
            {
                ("recording", 3): "is no group of named tables; a table [recording.NAME] for each recording, with its "
                "file"
            },
        ),
        (
            GIVEN,
            {("recording", 0): "is missing; a table [recording.NAME] for each recording, with its file"},
        ),
        (
            f'lever_arm = "0 mm"\n{GIVEN}[recording.x]\nfile = "a.csv"',
            {("lever_arm", 1): 'is not above 0 m; a length with its unit, above 0 m; for example lever_arm = "5 mm"'},
        ),
        (
            f'{GIVEN}period = 1\n[recording.x]\nfile = "a.csv"',
            {("period", 3): "is below 2; a whole number without quotes, from 2 to 1000000000; for example period = 2"},
        ),
        (
            f'{GIVEN}[recording.x]\nfile = "a.csv"\naxes = ["channels"]',
            {
                ("recording.x.axes", 5): "does not say which axis is samples; the axes of the array in their order; "
                'for example axes = ["samples", "channels", "realisations", "periods"]'
            },
        ),
        (
            '[recording.x]\nfile = "a.csv"\n[recording.y]\nfile = "b.csv"\noutput = 2',
            {
                ("recording.x.input", 1): f"is missing; input {CHANNEL}",
                ("recording.x.output", 1): f"is missing; output {CHANNEL}",
                ("recording.y.input", 3): f"is missing; input {CHANNEL}",
            },
        ),
        (
            f'{GIVEN}time = "t"\n[recording.x]\nfile = "a.npz"\naxes = ["samples"]\ninput = [1, 2]\n[recording.y]\n'
            'file = "b.csv"\ntime = ["t", "s"]\noutput_file = "c.csv"',
            {
                ("recording.x.input", 7): "names several arrays, beside axes; one array with all channels",
                ("recording.x.time", 4): "is no column of this recording; one column, of a file without axes",
                ("recording.y.time", 10): "is no column of this recording; one column, of a file without axes",
                ("recording.y.output_file", 11): "stands without axes; axes, which say what the arrays hold",
            },
        ),
        (
            f'{GIVEN}[recording.x]\nfile = "a.csv"\ninput_unit = "kV"\noutput_unit = "cm"',
            {
                ("recording.x.input_unit", 5): 'is none of the choices; input_unit = "V" or input_unit = "mV"',
                ("recording.x.output_unit", 6): "is none of the choices; "
                + " or ".join(f'output_unit = "{unit}"' for unit in ("rad", "mrad", "urad", "m", "mm", "um")),
            },
        ),
    ],
)
def test_what_is_wrong_with_an_entry_is_told_in_all_words_on_its_line(tmp_path, text, told):
    assert faults(tmp_path, text) == told


@pytest.mark.parametrize(
    ("one", "other", "apart"),
    [
        ((0.0, None), (0.0, None), False),
        ((0.0, 1.0), (1.0, None), True),
        ((1.0, 2.0), (0.0, 1.0), True),
        ((1.0, 2.0), (0.0, 1.25), False),
        ((0.0, 5.0), (1.0, 2.0), False),
        ((2.0, None), (3.0, 4.0), False),
        ((4.0, None), (3.0, 4.0), True),
    ],
)
def test_two_parts_of_a_file_are_apart_where_one_ends_before_the_other_begins(tmp_path, one, other, apart):
    lines = []
    for name, (begin, end), role in (("a", one, '"loops"'), ("b", other, '"validation"')):
        until = "" if end is None else f'to = "{end} s"\n'
        lines.append(
            f'[recording.{name}]\nfile = "a.csv"\ninput = 1\noutput = 2\nrole = {role}\nfrom = "{begin} s"\n{until}'
        )
    with pytest.raises((RecordingsError, RecordingError)) as refused:
        read_list(write_list(tmp_path, "".join(lines)))
    assert ("takes samples for validation that [recording.a] fits" in str(refused.value)) is not apart
    assert apart is ("there is no such file" in str(refused.value))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            'positions = [["0 mm", "1 mm"], ["2 mm", "3 mm"], ["4 mm", "5 mm"]]',
            "positions has 3 places and there are 2 outputs, x, y; give one place for each, in their order.",
        ),
        (
            "signs = [[1], [-1], [0]]",
            "signs has rows of 1, 1, 1 items and there are 2 outputs and 2 inputs; give a row for each output, with an "
            "item for each input.",
        ),
        (
            "signs = [[1, 0], [-1]]",
            "signs has rows of 2, 1 items and there are 2 outputs and 2 inputs; give a row for each output, with an "
            "item for each input.",
        ),
    ],
)
def test_places_and_signs_of_two_axes_are_counted_in_all_words(tmp_path, line, words):
    write_csv(tmp_path / "a.csv", "t,ux,uy,x,y")
    channels = 'input = ["ux", "uy"]\noutput = ["x", "y"]\naccept = ["drift", "lead"]'
    text = f'{line}\n{channels}\n[recording.a]\nfile = "a.csv"\n'
    assert refusal(tmp_path, text) == f"{tmp_path / 'list.toml'}: {words}"


@pytest.mark.parametrize("spelled", ["./a.csv", "../{folder}/a.csv", "{whole}/a.csv", "link.csv"])
def test_a_file_is_the_same_however_it_is_spelled(tmp_path, spelled):
    (tmp_path / "link.csv").symlink_to(tmp_path / "a.csv")
    name = spelled.format(folder=tmp_path.name, whole=tmp_path)
    entry = '[recording.{}]\nfile = "{}"\ninput = 1\noutput = 2\n'
    told = faults(tmp_path, entry.format("a", "a.csv") + entry.format("b", name) + 'role = "validation"\n')
    assert "takes samples for validation that [recording.a] fits" in told["recording.b", 5]


def test_the_name_of_a_file_that_is_empty_is_said_to_be_so(tmp_path):
    entry = '[recording.a]\nfile = ""\ninput = "u"\noutput = "y"\n'
    with pytest.raises(RecordingsError, match="is empty") as refused:
        read_list(write_list(tmp_path, entry))
    assert refused.value.faults[0].key == "recording.a.file"


def test_one_drive_and_two_outputs_have_a_unit_a_place_and_a_sign_for_each(tmp_path):
    np.savez(tmp_path / "a.npz", u=DRIVE[:, 0], y=OUTPUT[:, 0], x=OUTPUT[::-1, 0] + OUTPUT[:, 0], fs=RATE_HZ)
    entry = '[recording.a]\nfile = "a.npz"\ninput = "u"\noutput = ["y", "x"]\ninput_unit = "mV"\noutput_unit = "um"\n'
    found = read_list(write_list(tmp_path, f"signs = [[1], [-1]]\n{entry}"))
    assert found.signs == ((1,), (-1,))
    assert [(r.input_units, r.output_units) for r in found.recordings] == [(("mV",), ("um", "um"))]
    assert "signs has rows of 2 items and there are 2 outputs and 1 input; give a row for each" in refusal(
        tmp_path, f"signs = [[1, -1]]\n{entry}"
    )
    assert "positions has 1 places and there are 2 outputs, y, x; give one place for each, in their order." in refusal(
        tmp_path, f'positions = [["1 mm", "2 mm"]]\n{entry}'
    )


def test_recordings_of_one_drive_have_the_same_sensors_and_each_its_own_data(tmp_path):
    write_csv(tmp_path / "a.csv", "t,ux,uy,x,y")
    write_csv(tmp_path / "b.csv", "t,ux,uy,x,z")
    common = (
        'input = "ux"\naccept = ["drift", "lead", "dead"]\n\n[recording.a]\nfile = "a.csv"\noutput = ["x", "y"]\n\n'
    )
    second = '[recording.b]\nfile = "b.csv"\noutput = '
    (a, b), path = (tmp_path / "a.csv", tmp_path / "b.csv"), tmp_path / "list.toml"
    assert len(read_list(write_list(tmp_path, f'{common}{second}["x", "z"]')).recordings) == 2
    assert refusal(tmp_path, f'{common}{second}"x"') == (
        f"{path}: {b}: 1 input and 1 output, where {a} has 1 and 2; name the same channels in each recording, in the "
        "same order."
    )
    (tmp_path / "b.csv").write_bytes(a.read_bytes())
    assert refusal(tmp_path, f'{common}{second}["x", "y"]') == (
        f"{path}: {b}: the same data as {a}; give each recording once, and for validation one that is not fitted."
    )


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('positions = [["0 mm", "1 mm"]]', "positions has 1 place"),
        ('positions = [["0 mm", "1 mm"], ["0 mm", "2 mm"], ["1 mm", "2 mm"]]', "positions has 3 places"),
        ("signs = [[1]]", "signs has rows of 1 items and there are 2 outputs and 1 input; give a row for each"),
        ("signs = [[1], [1], [1]]", "signs has rows of 1, 1, 1 items and there are 2 outputs and 1 input"),
        ("signs = [[1, -1], [1]]", "signs has rows of 2, 1 items and there are 2 outputs and 1 input"),
        ("signs = [[1], [1, -1]]", "signs has rows of 1, 2 items and there are 2 outputs and 1 input"),
    ],
)
def test_fewer_or_more_places_and_signs_than_two_outputs_are_refused(tmp_path, line, words):
    np.savez(tmp_path / "a.npz", u=DRIVE[:, 0], y=OUTPUT[:, 0], x=-2.0 * OUTPUT[:, 0], fs=RATE_HZ)
    entry = '[recording.a]\nfile = "a.npz"\ninput = "u"\noutput = ["y", "x"]\n'
    assert words in refusal(tmp_path, f"{line}\n{entry}")


@pytest.mark.parametrize("order", [("one", "two"), ("two", "one")])
def test_recordings_of_other_channels_are_refused_whichever_comes_first(tmp_path, order):
    for name, drives in (("one", 1), ("two", 2)):
        np.savez(
            tmp_path / f"{name}.npz", **{f"u{k}": np.roll(DRIVE[:, 0], 9 * k) for k in range(drives)}, y=OUTPUT[:, 0]
        )
    entry = '[recording.{0}]\nfile = "{0}.npz"\ninput = [{1}]\noutput = "y"\nrate = "1 kHz"\n'
    of = {"one": entry.format("one", '"u0"'), "two": entry.format("two", '"u0", "u1"')}
    with pytest.raises(RecordingError, match="; name the same channels in each recording"):
        read_list(write_list(tmp_path, "".join(of[name] for name in order)))
