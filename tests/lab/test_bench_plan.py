"""Plan files: what is read from a good one, and what a bad one is told, every fault at once."""

import contextlib
import hashlib
import re
import tomllib
import zlib
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from bench_of_two_axes import LIMITS_AND_BENCH
from microrad.lab import bench
from microrad.lab.bench import load_plan, plan
from microrad.lab.bench.plan import PlanError, packaged_plans
from places import ROOT

PLANS = Path(bench.__file__).parent.parent / "plans"
PAPER = PLANS / "paper-experiment.toml"
TEXT = PAPER.read_text(encoding="utf-8")


@pytest.fixture
def refuse(tmp_path):
    """Write a text, load it, and return the error, checked for what every error owes its reader."""

    def load(text):
        path = tmp_path / "bad.toml"
        path.write_text(text, encoding="utf-8")
        with pytest.raises(PlanError) as refused:
            load_plan(path)
        error = refused.value
        assert isinstance(error, ValueError)
        assert error.path == path
        for fault in error.faults:
            assert fault.expected
            assert all(part in str(error) for part in (fault.key, fault.value, fault.reason, fault.expected))
            assert fault.file == str(path)
        assert "pydantic" not in str(error)
        return error

    return load


def changed(old, new, text=TEXT):
    assert len(re.findall(old, text, re.MULTILINE)) == 1, old
    return re.sub(old, new, text, flags=re.MULTILINE)


# ---- packaged plans
@pytest.mark.promise("bench-2", "bench-3", "bench-13")
def test_the_packaged_plans_are_found_by_name():
    assert packaged_plans() == ("mirror-characterisation", "paper-experiment")
    for name in packaged_plans():
        plan = load_plan(name)
        assert plan.path.name == f"{name}.toml"
        assert plan.sha256 == hashlib.sha256((PLANS / f"{name}.toml").read_bytes()).hexdigest()


@pytest.mark.promise("bench-3")
@pytest.mark.parametrize("path", sorted(PLANS.glob("*.toml")), ids=lambda p: p.stem)
def test_every_value_of_a_packaged_plan_says_where_it_comes_from(path):
    for line in path.read_text(encoding="utf-8").split("\n"):
        if "=" in line and not line.startswith(("#", "name")):
            assert re.search(r" # (paper|assumption): \S", line), line


@pytest.mark.promise("bench-3", "bench-5", "bench-6", "bench-8")
@pytest.mark.promise("readme-10")
@pytest.mark.promise("bench-7")
def test_the_papers_experiment_is_read_in_si():
    plan = load_plan(PAPER)
    assert (plan.limits.rate_hz, plan.limits.drive_max_v, plan.limits.slew_v_s) == (50e3, 12.0, 20e3)
    assert (plan.bench.amplifier.gain, plan.bench.converters.bits, plan.bench.axes) == (15, 16, 1)
    assert (plan.bench.sensor.noise_rad, plan.bench.sensor.noise_share) == (1e-6, None)
    chirp, *loops = plan.records
    assert (chirp.kind, chirp.truth, chirp.noise_share, chirp.use) == ("chirp", "linear", 0.03, "identification")
    assert chirp.excitation.samples == 500_000
    assert [loop.excitation.name for loop in loops] == ["loop-60hz", "loop-80hz", "loop-100hz"]
    assert {loop.truth for loop in loops} == {"bouc-wen"}
    for loop, freq_hz in zip(loops, (60, 80, 100), strict=True):
        time_s = np.arange(loop.excitation.samples) / 50e3
        assert np.allclose(loop.excitation.drive[:, 0], 6 * np.sin(2 * np.pi * freq_hz * time_s) + 6, atol=1e-9)


@pytest.mark.promise("bench-3")
def test_the_characterisation_holds_records_out():
    plan = load_plan("mirror-characterisation")
    uses = {record.excitation.name: record.use for record in plan.records}
    assert {name for name, use in uses.items() if use == "validation"} == {"held-out-sine", "held-out-multisine"}
    assert {record.kind for record in plan.records} == {"multisine", "chirp", "sines", "staircase"}
    assert {record.truth for record in plan.records} == {"bench"}
    creep = next(record.excitation for record in plan.records if record.kind == "staircase")
    assert creep.rate_hz == 1e3
    assert len(creep.step_samples) == 5
    loops = [record.excitation for record in plan.records if record.kind == "sines" and record.use == "identification"]
    assert len({each.name.rpartition("-")[2] for each in loops}) == len(loops) == 4
    for each in loops:
        tops = [part.max() - 6.0 for part in np.array_split(each.drive[:, 0], 3)]
        assert tops[0] < tops[1] < tops[2], each.name
    small = {r.kind: np.ptp(r.excitation.drive) for r in plan.records if r.use == "identification"}
    assert max(small["multisine"], small["chirp"]) < 2.0 < min(np.ptp(each.drive) for each in loops)


PAGE = (ROOT / "docs" / "bench.md").read_text(encoding="utf-8")


def keys(table):
    return {info.alias or name for name, info in table.model_fields.items()}


@pytest.mark.promise("bench-5")
def test_the_page_has_the_keys_of_the_plan_and_their_defaults():
    rows = re.findall(r"^\| (`.+?) \| (.+) \|$", PAGE.partition("| `kind` |")[0], re.MULTILINE)
    found = {}
    for first, meaning in rows:
        table = re.match(r"`((?:\w+\.)*)", first)[1]
        names = re.findall(r"`(?:\w+\.)*(\w+|\*)`", first)
        found.setdefault(table, set()).update(re.findall(r"`(\w+)`", meaning) if names == ["*"] else names)
    amplifier, converters, sensor = (
        plan.BenchTable.model_fields[name].annotation for name in ("amplifier", "converters", "sensor")
    )
    assert found == {
        "": keys(plan.PlanTable) - {"limits", "bench", "excitation"},
        "limits.": keys(plan.LimitsTable),
        "bench.": keys(plan.BenchTable) - {"amplifier", "converters", "sensor"},
        "bench.amplifier.": keys(amplifier),
        "bench.converters.": keys(converters),
        "bench.sensor.": keys(sensor),
    }
    listed = dict(rows)
    assert tuple(re.findall(r"`(\w+)`", listed["`formats`"])) == plan.FORMATS
    assert re.findall(r"\((\d)\)", listed["`bench.axes`, `bench.crosstalk`"]) == ["1", "0"]
    assert [plan.BenchTable.model_fields[name].default for name in ("axes", "crosstalk")] == [1, 0.0]
    truths = re.findall(r"`([a-z-]+)`", listed["`bench.truth`"])
    assert truths == ["bench", "linear", "bouc-wen"] == list(get_args(plan.BenchTable.model_fields["truth"].annotation))


@pytest.mark.promise("bench-7", "bench-8")
def test_the_page_has_the_keys_of_each_kind_of_excitation():
    rows = re.findall(r"^\| `(\w+)` \| (`.+) \| (.+) \|$", PAGE.partition("| `kind` |")[2], re.MULTILINE)
    assert [kind for kind, _, _ in rows] == list(plan.KINDS)
    common = keys(plan.ExcitationTable)
    for kind, named, _ in rows:
        lines = set() if kind != "multisine" else {"all", "odd"}  # what the key `lines` may say
        assert set(re.findall(r"`(\w+)`", named)) - lines == keys(plan.KINDS[kind]) - common - {"kind", "axis"}
        assert ("axis" in keys(plan.KINDS[kind])) == (kind != "multisine")
    assert common == {"use", "rate", "truth", "noise_share"}


@pytest.mark.promise("bench-6", "bench-7", "bench-8")
def test_records_are_named_after_their_excitation(tmp_path):
    text = changed("^frequencies = .*", 'frequencies = ["100 Hz"]') + (
        '[excitation.m]\nkind = "multisine"\nlines = "odd"\nstart = "10 Hz"\nstop = "1 kHz"\nperiod = "0.1 s"\n'
        'rms = "0.2 V"\noffset = "6 V"\nperiods = 2\nrealisations = 2\nseed = 1\nnoise_share = 0.1\n'
        '[excitation.s]\nkind = "staircase"\nlevels = ["2 V", "8 V"]\ndwell = "1 s"\nrise = "5 ms"\nrate = "1 kHz"\n'
        'use = "validation"\naxis = 1\n'
    )
    path = tmp_path / "plan.toml"
    path.write_text(text, encoding="utf-8")
    *_, loop, one, two, steps = load_plan(path).records
    assert [r.excitation.name for r in (loop, one, two, steps)] == ["loop", "m-1", "m-2", "s"]
    assert (steps.use, steps.truth, steps.excitation.rate_hz, steps.noise_share) == ("validation", "bench", 1e3, None)
    assert (two.use, two.noise_share, two.excitation.rate_hz) == ("identification", 0.1, 50e3)
    assert steps.excitation.rest_v == 2.0


def test_a_plan_can_be_cut_down():
    plan = load_plan(PAPER)
    kept = bench.select_records(plan, ["loop-60hz", "chirp"])
    assert [r.excitation.name for r in kept.records] == ["chirp", "loop-60hz"]
    with pytest.raises(ValueError, match=r"no record is named 'loop'; the plan has chirp, loop-60hz"):
        bench.select_records(plan, ["loop"])


# ---- faults
@pytest.mark.promise("bench-4", "bench-5")
@pytest.mark.parametrize(
    ("old", "new", "key", "message"),
    [
        ("^stop = .*", 'stop = "5 kHzz"', "excitation.chirp.stop", 'no unit is called "kHzz"'),
        ("^stop = .*", "stop = 5000", "excitation.chirp.stop", r'number without a unit.*\n.*stop = "5000 Hz"'),
        ("^stop = .*", "", "excitation.chirp.stop", "is missing"),
        ("^stop = ", "stopp = ", "excitation.chirp.stopp", "did you mean stop"),
        ("^rate = ", "rates = ", "limits.rates", "did you mean rate"),
        ('^kind = "chirp"', 'kind = "chrip"', "excitation.chirp.kind", 'did you mean "chirp"'),
        ('^kind = "chirp".*', "", "excitation.chirp.kind", "is missing\n.*expected: kind = "),
        ('^truth = "linear"', 'truth = "lineer"', "excitation.chirp.truth", 'did you mean "linear"'),
        ("^periods = 12", "periods = 12.5", "excitation.loop.periods", "is not a whole number"),
        ("^periods = 12", "periods = 10", "excitation.loop.periods", "60 Hz: 10 of them fill .*\n.*a multiple of 3"),
        ('^amplitudes = .*', 'amplitudes = ["7 V"]', "excitation.loop.amplitudes", "13 V, limits.drive_max is 12 V"),
        ("^bits = 16", "bits = 2", "bench.converters.bits", "is below 4"),
        ('^formats = .*', 'formats = ["xls"]', "formats", "csv, lvm, tdms, mat, mat73, npz, hdf5"),
        ('^formats = .*', 'formats = []', "formats", "is no list of different file formats"),
        ('^formats = .*', 'formats = ["csv", "csv"]', "formats", "is no list of different file formats"),
        ("^samples_per_period = 10", "samples_per_period = 2", "limits.samples_per_period", "is not above 2"),
        ("^samples_per_period = 10", "samples_per_period = 11", "excitation.chirp.stop", "at most 4.545 kHz"),
        ('^noise = .*', "", "bench.sensor", "noise and noise_share are both missing"),
        ('^noise = .*', 'noise = "1 urad"\nnoise_share = 0.1', "bench.sensor", "are both given"),
        ('^output_max = "180 V"', 'output_max = "150 V"', "limits.drive_max", "the amplifier, 0 V to 10 V at the"),
        ('^drive_max = "16 V"', 'drive_max = "10 V"', "limits.drive_max", "the converters, -4 V to 10 V at the drive"),
        ('^drive_min = "0 V"', 'drive_min = "-5 V"', "limits.drive_min", "the converters, -4 V to 16 V at the drive"),
        ('^output_min = "-?[^"]*mrad"', 'output_min = "9 mrad"', "bench.converters.output_max", "not above output_min"),
        ('^drive_max = "16 V"', 'drive_max = "-4 V"', "bench.converters.drive_max", "drive_min.*\n.*above -4 V"),
        ('^drive_max = "12 V"', 'drive_max = "-1 V"', "limits.drive_max", "is not above drive_min"),
        ('^drive_max = "12 V"', 'drive_max = "0 V"', "limits.drive_max", r"drive_min \(0 V\)\n.*a voltage above 0 V"),
        (r"^\[excitation.chirp\]", "[excitation.'a b']", "excitation.a b", "is no name that a file can have"),
        (r"^\[excitation.chirp\]", "[excitation.'']", "excitation.", "is no name that a file can have"),
        (r"^\[excitation.chirp\]", f"[excitation.{'a' * 61}]", f"excitation.{'a' * 61}", "is no name that a file can"),
        (r"^\[excitation.chirp\]", "[excitation.loop-60hz]", "excitation", 'two records named "loop-60hz"'),
        (r"^\[excitation.chirp\]", "[excitation.Loop-60Hz]", "excitation", 'named "loop-60hz"\n.*names that stay diff'),
        (r"^\[excitation.chirp\]", "[excitations.chirp]", "excitations", "did you mean excitation"),
        (r'^offset = "6 V"  .*about.*', 'offset = "6 V', "excitation.chirp.offset", "is not TOML"),
    ],
)  # fmt: skip
def test_a_fault_is_told_with_its_key_and_line(refuse, old, new, key, message):
    text = changed(old, new)
    error = refuse(text)
    fault = next(f for f in error.faults if f.key == key)
    assert re.search(message, str(fault)), str(fault)


NUMBER = re.compile(r'^(\w+ = )(?:"(-?[\d.]+) ([^"]+)"|(\d[\d.]*))(?=\s)', re.MULTILINE)


BEYOND = [(plan, number) for plan in packaged_plans() for number in ("1e308", "1e-308", "-1e308", "0")]
OFTEN = [each for each in BEYOND if each[0] != PAPER.stem and each[1] != "1e308"]  # of the longer plan one is enough


@pytest.mark.parametrize(
    ("plan", "number"),
    [pytest.param(*each, marks=pytest.mark.endurance if each in OFTEN else ()) for each in BEYOND],
)
def test_a_number_beyond_all_measure_is_told_or_borne(tmp_path, plan, number):
    text, path = (PLANS / f"{plan}.toml").read_text(encoding="utf-8"), tmp_path / "plan.toml"
    places = list(NUMBER.finditer(text))
    assert len(places) > 15
    for place in places:
        value = f'"{number} {place[3]}"' if place[3] else number
        path.write_text(f"{text[: place.start()]}{place[1]}{value}{text[place.end() :]}", encoding="utf-8")
        with contextlib.suppress(PlanError):
            load_plan(path)


THOUSAND = ".a" * 999


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        (f'kind{THOUSAND} = "chirp"', "is a key of 2019 characters"),
        (f"kind = {{a{THOUSAND} = 1}}", "holds a key of more than 50 parts"),
        (f"kind = [[{{'a'{THOUSAND} = 1}}]]", "holds a key of more than 50 parts"),
        (f'kind = "a{THOUSAND}"', "is none of the choices"),
    ],
    ids=["key", "table", "list", "text"],
)
def test_a_kind_of_a_thousand_parts_is_told(refuse, kind, reason):
    """It was a traceback."""
    assert reason in {fault.reason for fault in refuse(changed('^kind = "chirp"', kind)).faults}


@pytest.mark.parametrize("table", ["limits", "bench", "bench.sensor", "excitation.chirp"])
def test_a_list_in_place_of_a_table_is_told(refuse, table):
    text = changed(rf"^\[{re.escape(table)}\]", f"[[{table}]]")
    fault = next(f for f in refuse(text).faults if f.key == table)
    assert "expected: a table with the keys" in str(fault) or "is no table" in str(fault)


@pytest.mark.promise("bench-4")
@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("^periods = 12", "periods = 10", "periods = 10"),  # found by the design
        ("^bits = 16", "bits = 2", "bits = 2"),  # by a table inside a table
        ("^amplitude = .*", "", "[excitation.chirp]"),  # missing: the table it should stand in
        ('^drive_max = "16 V"', 'drive_max = "10 V"', 'drive_max = "12 V"'),  # between tables
    ],
)
def test_a_fault_stands_on_its_line(refuse, old, new, part):
    text = changed(old, new)
    (fault,) = refuse(text).faults
    assert text.split("\n")[fault.line - 1].startswith(part)


@pytest.mark.promise("bench-4")
def test_faults_of_all_kinds_are_told_at_once(refuse):
    text = changed("^rate = .*", 'rate = "50 kHz"')
    text = changed("^gain = 15", 'gain = "15 V"', text)
    text = changed('^start = "1 Hz"', 'start = "9 kHz"', text)
    text = changed("^frequencies = .*", 'frequencies = ["60 V"]', text)
    text = changed("^bits = 16", "bit = 16", text)
    keys = [fault.key for fault in refuse(text).faults]
    assert {"bench.amplifier.gain", "bench.converters.bit", "excitation.loop.frequencies"} <= set(keys)
    text = changed("^periods = 12", "periods = 10", changed('^start = "1 Hz"', 'start = "9 kHz"'))
    assert {f.key for f in refuse(text).faults} == {"excitation.chirp.stop", "excitation.loop.periods"}


def test_limits_are_held_against_the_excitations_also_when_something_else_is_wrong(refuse):
    text = changed("^formats = .*", 'formats = "csv"', changed("^periods = 12", "periods = 10"))
    assert {f.key for f in refuse(text).faults} == {"formats", "excitation.loop.periods"}
    text = changed("^bits = 16", "bits = 2", changed("^periods = 12", "periods = 10"))
    assert {f.key for f in refuse(text).faults} == {"bench.converters.bits", "excitation.loop.periods"}
    text = changed('^slew = "20 V/ms"', 'slew = "20 V"', changed("^periods = 12", "periods = 10"))
    assert {f.key for f in refuse(text).faults} == {"limits.slew"}  # without limits there is nothing to hold against
    text = changed('^truth = "bench"', 'axes = 5\ntruth = "bench"', changed("^periods = 12", "periods = 10"))
    assert {f.key for f in refuse(text).faults} == {"bench.axes"}  # nor without a number of axes that there may be


@pytest.mark.parametrize(
    ("ending", "reason"),
    [
        ("", "is missing"),
        ("[excitation]\n", "is not a group of named tables"),
        ("[[excitation]]\nkind = 'chirp'\n", "is not a group of named tables"),
        ("excitation = 5\n", "is not a group of named tables"),
    ],
)
def test_a_plan_without_excitations_is_refused(refuse, ending, reason):
    head = TEXT.partition("[excitation.chirp]")[0]
    text = ending + head if ending.startswith("exc") else head + ending
    error = refuse(text)
    assert reason in {fault.reason for fault in error.faults if fault.key == "excitation"}
    assert "[excitation.NAME]" in str(error)


@pytest.mark.parametrize(
    ("line", "missing"),
    [
        ("excitation = 5 V", False),
        ("excitation.a = chirp", False),
        ("[excitation.a", False),
        ("excitations = 5 V", True),
        ("[excitations.a", True),
    ],
)
def test_excitations_are_missing_unless_their_own_line_is_broken(refuse, line, missing):
    head = TEXT.partition("[excitation.chirp]")[0]
    error = refuse(f"{head}{line}\n" if line.startswith("[") else f"{line}\n{head}")
    assert any("[excitation.NAME]" in fault.expected for fault in error.faults) == missing
    assert len(error.faults) == 1 + missing


def test_a_file_that_is_not_there_is_told_with_the_packaged_plans(tmp_path):
    with pytest.raises(PlanError, match=r"(?s)the plan file does not exist.*mirror-characterisation, paper-experiment"):
        load_plan(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\0\1")
    with pytest.raises(PlanError, match="the plan file holds binary data"):
        load_plan(tmp_path / "binary.toml")


@pytest.mark.promise("bench-2", "bench-13")
def test_a_file_goes_before_a_packaged_plan_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("paper-experiment").write_text(changed("^name = .*", 'name = "ours"'), encoding="utf-8")
    assert load_plan("paper-experiment").name == "ours"


# ---- sizes
SINES = """
[excitation.many]
kind = "sines"
use = "validation"
frequencies = [{}]
amplitudes = ["1 V"]
periods = {}
offset = "6 V"
"""


def test_records_that_would_fill_the_memory_are_refused_before_they_are_designed(refuse):
    """Each frequency alone has fewer samples than a record may have."""
    several = ", ".join(f'"{2 + n / 10:g} Hz"' for n in range(100))
    (fault,) = refuse(TEXT + SINES.format(several, 300)).faults
    assert fault.key == "excitation.many.frequencies" and "makes a record of" in fault.reason


def four_axes(tmp_path):
    """The records of the paper's experiment on as many axes as there may be, its first excitation with a long name."""
    text = changed('^truth = "bench"', 'axes = 4\ntruth = "bench"')
    text = changed(r"^\[excitation.chirp\]", f"[excitation.{'a' * 60}]", text)
    (tmp_path / "plan.toml").write_text(changed("^duration = .*", 'duration = "0.1 s"', text), encoding="utf-8")
    return load_plan(tmp_path / "plan.toml").records


def test_a_plan_has_so_many_samples_in_all(refuse, monkeypatch, tmp_path):
    whole = sum(record.excitation.drive.size for record in four_axes(tmp_path))
    monkeypatch.setattr(plan, "_MOST_SAMPLES", 100_000)
    (fault,) = refuse(TEXT).faults
    assert fault.reason == "makes a plan of more than 0.1 million samples"
    monkeypatch.setattr(plan, "_MOST_SAMPLES", whole)
    assert len(four_axes(tmp_path)) == 4
    monkeypatch.setattr(plan, "_MOST_SAMPLES", whole - 1)
    with pytest.raises(PlanError, match=r"excitation\.loop\n +makes a plan of more than .* million samples"):
        four_axes(tmp_path)


def test_a_plan_may_have_as_many_excitations_as_it_may_and_no_more(monkeypatch):
    there = len(tomllib.loads((PLANS / "mirror-characterisation.toml").read_text(encoding="utf-8"))["excitation"])
    monkeypatch.setattr(plan, "_MOST_EXCITATIONS", there)
    assert load_plan("mirror-characterisation").records
    monkeypatch.setattr(plan, "_MOST_EXCITATIONS", there - 1)
    with pytest.raises(PlanError, match=f"has {there} tables") as caught:
        load_plan("mirror-characterisation")
    assert f"at most {there - 1}" in str(caught.value)


# ---- a plan of two axes with numbers all unlike
TWO_AXES = f"""
name = "two axes"
formats = ["npz", "csv"]
{LIMITS_AND_BENCH}drift = "7 nrad/s"
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
[excitation.s]
kind = "sines"
frequencies = ["12.4416 Hz", "24.8832 Hz"]
amplitudes = ["0.5 V", "1.25 V"]
periods = 3
offset = "1.5 V"
axis = 2
truth = "bouc-wen"
[excitation.t]
kind = "staircase"
levels = ["2 V", "-1 V", "5 V"]
dwell = "0.1 s"
rise = "20 ms"
truth = "bench"
"""


def test_each_record_of_a_plan_of_two_axes_has_what_is_its_own(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(TWO_AXES, encoding="utf-8")
    found = load_plan(path)
    assert (found.name, found.formats, found.path) == ("two axes", ("npz", "csv"), path)
    assert found.sha256 == hashlib.sha256(TWO_AXES.encode()).hexdigest() and found.text == TWO_AXES
    told = [(r.excitation.name, r.kind, r.use, r.truth, r.noise_share, r.excitation.rate_hz) for r in found.records]
    assert told == [
        ("c", "chirp", "validation", "linear", 0.05, 622.08),
        ("m-1", "multisine", "identification", "linear", None, 500.0),
        ("m-2", "multisine", "identification", "linear", None, 500.0),
        ("s-12.4416hz", "sines", "identification", "bouc-wen", None, 622.08),
        ("s-24.8832hz", "sines", "identification", "bouc-wen", None, 622.08),
        ("t", "staircase", "identification", "bench", None, 622.08),
    ]
    moved = [np.ptp(record.excitation.drive, axis=0) > 0.0 for record in found.records]
    assert [each.tolist() for each in moved] == [
        *([False, True], [True, True], [True, True]),
        *([False, True], [False, True], [True, False]),
    ]
    assert [record.excitation.rest_v for record in found.records] == [2.25, 2.5, 2.5, 1.5, 1.5, 2.0]
    assert [record.excitation.samples for record in found.records] == [684, 1000, 1000, 300, 150, 211]
    assert [record.stream for record in found.records] == [zlib.crc32(each[0].encode()) for each in told]
    kept = bench.select_records(found, ["t", "m-2"])
    assert [record.excitation.name for record in kept.records] == ["m-2", "t"]
    with pytest.raises(ValueError) as refused:
        bench.select_records(found, ["t", "m", "x"])
    assert str(refused.value) == (
        f"{path}: no record is named 'm'; the plan has c, m-1, m-2, s-12.4416hz, s-24.8832hz, t."
    )


@pytest.mark.parametrize(
    ("changes", "faults"),
    [
        (
            [('drive_min = "-3 V"', 'drive_min = "-4.5 V"'), ('drive_max = "9 V"', 'drive_max = "11 V"')],
            [
                (
                    "limits.drive_min",
                    "is below the range of the converters, -3.5 V to 9.5 V at the drive",
                    "within -3.5 V to 9.5 V",
                ),
                (
                    "limits.drive_min",
                    "is below the range of the amplifier, -4 V to 10 V at the drive",
                    "within -4 V to 10 V",
                ),
                (
                    "limits.drive_max",
                    "is above the range of the converters, -3.5 V to 9.5 V at the drive",
                    "within -3.5 V to 9.5 V",
                ),
                (
                    "limits.drive_max",
                    "is above the range of the amplifier, -4 V to 10 V at the drive",
                    "within -4 V to 10 V",
                ),
            ],
        ),
        (
            [('drive_max = "9.5 V"', 'drive_max = "-3.5 V"'), ('output_max = "3 mrad"', 'output_max = "-2.5 mrad"')],
            [
                ("bench.converters.drive_max", "is not above drive_min", "above -3.5 V"),
                ("bench.converters.output_max", "is not above output_min", "above -2 mrad"),
            ],
        ),
        (
            [('drive_max = "9.5 V"', 'drive_max = "8.9996 V"')],
            [
                (
                    "limits.drive_max",
                    "is above the range of the converters, -3.5 V to 8.999 V at the drive",
                    "within -3.5 V to 8.999 V",
                )
            ],
        ),
        (
            [('drive_max = "9 V"', 'drive_max = "-3 V"')],
            [("limits.drive_max", "is not above drive_min (-3 V)", "a voltage above -3 V")],
        ),
        (
            [("noise_share = 0.02", 'noise_share = 0.02\nnoise = "2 urad"')],
            [
                (
                    "bench.sensor",
                    "noise and noise_share are both given",
                    'one of them: noise = "1 urad" or noise_share = 0.03',
                )
            ],
        ),
        (
            [("noise_share = 0.02", "")],
            [
                (
                    "bench.sensor",
                    "noise and noise_share are both missing",
                    'one of them: noise = "1 urad" or noise_share = 0.03',
                )
            ],
        ),
        (
            [('formats = ["npz", "csv"]', 'formats = ["npz", "csv", "npz"]')],
            [
                (
                    "formats",
                    "is no list of different file formats",
                    'a list with some of csv, lvm, tdms, mat, mat73, npz, hdf5; for example formats = ["csv"]',
                )
            ],
        ),
        (
            [("axis = 2\nuse", "axis = 3\nuse"), ("realisations = 2", "realisations = 3")],
            [
                ("excitation.c.axis", "is 3, but the bench has 2 inputs", "1 to 2"),
                (
                    "excitation.m.realisations",
                    "is 3, no multiple of the 2 inputs, so no orthogonal set",
                    "a multiple of 2",
                ),
            ],
        ),
        (
            [('kind = "staircase"', 'kind = "stairs"'), ('truth = "bench"', 'truth = "table"')],
            [
                (
                    "excitation.t.kind",
                    "is none of the choices",
                    'kind = "chirp" or kind = "multisine" or kind = "sines" or kind = "staircase"',
                )
            ],
        ),
    ],
)
def test_faults_of_a_plan_of_two_axes_are_told_in_all_words(refuse, changes, faults):
    text = TWO_AXES
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    told = [(fault.key, fault.reason, fault.expected) for fault in refuse(text).faults]
    assert told == faults


def test_a_record_beyond_the_limits_of_a_plan_of_two_axes_stands_on_its_own_line(refuse):
    text = TWO_AXES.replace('levels = ["2 V", "-1 V", "5 V"]', 'levels = ["2 V", "-3.25 V", "5 V"]')
    (fault,) = refuse(text).faults
    assert (fault.key, fault.reason, fault.expected) == (
        "excitation.t.levels",
        "has -3.25 V, outside limits.drive_min to limits.drive_max",
        "-3 V to 9 V",
    )
    assert fault.line == 1 + text[: text.index("levels =")].count("\n")


WRONG = """
kind = "chirp" => kind = 3 | excitation.c.kind | is none of the choices
kind = "chirp"\\n =>  | excitation.c.kind | is missing
axis = 2\\nuse => axis = 0\\nuse | excitation.c.axis | is below 1
periods = 2 => periods = 2.5 | excitation.m.periods | is not a whole number
seed = 5 => seed = -1 | excitation.m.seed | is below 0
rms = "0.5 => rms = "0 | excitation.m.rms | is not above 0 V
["0.5 V", "1.25 V"] => ["1.25 V", "1.25 V"] | excitation.s.amplitudes | does not rise from item to item
use = "validation" => use = "check" | excitation.c.use | is none of the choices
share = 0.05 => share = 11 | excitation.c.noise_share | is above 10
crosstalk = -0.25 => crosstalk = -0.75 | bench.crosstalk | is below -0.5
axes = 2 => axes = 5 | bench.axes | is above 4
bits = 14 => bits = 3 | bench.converters.bits | is below 4
bits = 14 => bits = 33 | bench.converters.bits | is above 32
period = 4.5 => period = 2 | limits.samples_per_period | is not above 2
"3 urad" => "-3 urad" | bench.sensor.mains | is below 0 rad
truth = "linear" => truth = "plan" | bench.truth | is none of the choices
["npz", "csv"] => "csv" | formats | is no list of different file formats
["npz", "csv"] => [] | formats | is no list of different file formats
["npz", "csv"] => ["npz", 3] | formats | is no list of different file formats
"2.5 V" => "2.5 mrad" | excitation.m.offset | is in "mrad", another kind of quantity
["2 V", "-1 V", "5 V"] => ["2 V"] | excitation.t.levels | has one item, which is no step
[excitation.t] => [excitation."t t"] | excitation.t t | is no name that a file can have
[excitation.t] => [excitation.C] | excitation | makes two records named "C"
[excitation.t] => [excitation.M-2] | excitation | makes two records named "M-2"
["12.4416 Hz",  => ["30 Hz",  | excitation.s.frequencies | does not rise from item to item
"1.1 s" => "1.1 s"\\nspeed = 3 | excitation.c.speed | is no key of [excitation.c]
lines = "all" => lines = "even" | excitation.m.lines | is none of the choices
"0.1 s" => 0.1 | excitation.t.dwell | is a number without a unit
"7 nrad/s" => "7 nrad" | bench.sensor.drift | is in "nrad", another kind of quantity
"3 mrad" => "-2 mrad" | bench.converters.output_max | is not above output_min
stop = "33 Hz" => stop = "0.7 Hz" | excitation.c.stop | is not above start
"""
EXPECTED = """
excitation.c.kind | kind = "chirp" or kind = "multisine" or kind = "sines" or kind = "staircase"
excitation.c.axis | a whole number without quotes, from 1 to 1000000; for example axis = 2
excitation.m.periods | a whole number without quotes, from 1 to 1000000; for example periods = 2
excitation.m.seed | a whole number without quotes, from 0 to 9223372036854775807; for example seed = 2
excitation.m.rms | a voltage with its unit, above 0 V; for example rms = "5 V"
excitation.s.amplitudes | a list, rising, each item a voltage with its unit, above 0 V
excitation.c.use | use = "identification" or use = "validation"
excitation.c.noise_share | a number without quotes, at least 0, at most 10; for example noise_share = 5.0
bench.crosstalk | a number without quotes, at least -0.5, at most 0.5; for example crosstalk = 0.5
bench.axes | a whole number without quotes, from 1 to 4; for example axes = 2
bench.converters.bits | a whole number without quotes, from 4 to 32; for example bits = 4
limits.samples_per_period | a number without quotes, above 2; for example samples_per_period = 5.0
bench.sensor.mains | an angle with its unit, at least 0 rad, at most 1.571 rad; for example mains = "5 urad"
bench.truth | truth = "bench" or truth = "linear" or truth = "bouc-wen"
formats | a list with some of csv, lvm, tdms, mat, mat73, npz, hdf5; for example formats = ["csv"]
excitation.m.offset | a voltage with its unit; for example offset = "5 V"
excitation.t.levels | at least two levels
excitation.t t | a table [excitation.NAME] for each, NAME of letters, digits, - and _
excitation | names that stay different
excitation.s.frequencies | a list, rising, each item a frequency with its unit, above 0 Hz, at most 1 THz
excitation.c.speed | one of use, rate, truth, noise_share, kind, start, stop, duration, amplitude, offset, axis
excitation.m.lines | lines = "all" or lines = "odd" or lines = "odd-random"
excitation.t.dwell | a time with its unit; for example dwell = "0.1 us"
bench.sensor.drift | an angular rate with its unit; for example drift = "5 nrad/s"
bench.converters.output_max | above -2 mrad
excitation.c.stop | a frequency above 700 mHz
"""


@pytest.mark.parametrize("line", WRONG.strip().split("\n"))
def test_a_value_of_a_plan_that_is_none_is_told_in_all_words_on_its_line(refuse, line):
    change, key, reason = line.split(" | ")
    old, new = change.replace("\\n", "\n").split(" => ")
    expected = dict(row.split(" | ") for row in EXPECTED.strip().split("\n"))[key]
    assert TWO_AXES.count(old) == 1
    text = TWO_AXES.replace(old, new)
    (fault,) = refuse(text).faults
    assert (fault.key, fault.reason, fault.expected) == (key, reason, expected)
    changed_line = next(
        n for n, pair in enumerate(zip(TWO_AXES.split("\n"), text.split("\n"), strict=False), 1) if len(set(pair)) > 1
    )
    first = text.split("\n").index(next(row for row in text.split("\n") if row.startswith("[excitation."))) + 1
    assert fault.line == (first if key == "excitation" else changed_line - (reason == "is missing"))


@pytest.mark.parametrize(
    ("kind", "nearest"),
    [
        ('"chrip"', '"chirp"'),
        ('"sine"', '"sines"'),
        ('"stairs"', '"staircase"'),
        ('"step"', ""),
        ("3", ""),
        ('"CHIRP"', ""),
    ],
)
def test_a_kind_that_is_none_is_told_with_the_nearest_that_is(refuse, kind, nearest):
    (fault,) = refuse(TWO_AXES.replace('kind = "chirp"', f"kind = {kind}")).faults
    assert (fault.value, fault.nearest) == (kind, nearest)


def test_what_an_excitation_says_of_its_own_goes_to_its_design(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(TWO_AXES, encoding="utf-8")
    found = load_plan(path)
    limits = dict(found.limits)
    assert limits == {
        "rate_hz": 622.08,
        "drive_min_v": -3.0,
        "drive_max_v": 9.0,
        "slew_v_s": 700.0,
        "samples_per_period": 4.5,
    }
    converters, sensor, amplifier = found.bench.converters, found.bench.sensor, found.bench.amplifier
    assert (converters.bits, converters.drive_min_v, converters.drive_max_v) == (14, -3.5, 9.5)
    assert (converters.output_min_rad, converters.output_max_rad) == pytest.approx((-2e-3, 3e-3))
    assert (sensor.noise_rad, sensor.noise_share, sensor.mains_frequency_hz) == (None, 0.02, 60.0)
    assert (sensor.mains_rad, sensor.drift_rad_s) == pytest.approx((3e-6, 7e-9))
    assert (amplifier.gain, amplifier.output_min_v, amplifier.output_max_v) == (12.5, -50.0, 125.0)
    assert (amplifier.bandwidth_hz, amplifier.slew_v_s) == pytest.approx((4e3, 0.5e6))
    assert (found.bench.truth, found.bench.axes, found.bench.crosstalk) == ("linear", 2, -0.25)
    kept = plan.select_records(found, ["t", "c"])
    assert [record.excitation.name for record in kept.records] == ["c", "t"] and kept.sha256 == found.sha256
    with pytest.raises(ValueError) as refused:
        plan.select_records(found, ["c", "m", "x"])
    assert (
        str(refused.value) == f"{path}: no record is named 'm'; the plan has c, m-1, m-2, s-12.4416hz, s-24.8832hz, t."
    )


@pytest.mark.parametrize(("formats", "told"), [('["mat", "mat73"]', True), ('["mat73", "npz"]', False)])
def test_two_records_do_not_write_one_file(refuse, tmp_path, formats, told):
    text = TWO_AXES.replace("[excitation.t]", "[excitation.C-V73]").replace('["npz", "csv"]', formats)
    if told:
        (fault,) = refuse(text).faults
        assert (fault.key, fault.reason) == ("excitation", 'writes two records to "c-v73.mat", as mat and as mat73')
        assert fault.expected == "names that stay different, or one of the two formats"
    else:
        path = tmp_path / "plan.toml"
        path.write_text(text, encoding="utf-8")
        assert load_plan(path).formats == ("mat73", "npz")


def test_for_a_plan_that_is_binary_no_other_plan_is_offered_and_for_one_that_is_missing_those_that_there_are(tmp_path):
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe\x00")
    for name, reason, expected in (
        ("a.toml", "the plan file holds binary data", "a TOML file, plain text in UTF-8"),
        (
            "b.toml",
            "the plan file does not exist",
            "a plan file, or one of mirror-characterisation, paper-experiment",
        ),
    ):
        with pytest.raises(PlanError) as refused:
            load_plan(tmp_path / name)
        (fault,) = refused.value.faults
        assert (fault.reason, fault.expected, fault.file) == (reason, expected, str(tmp_path / name))
