"""Plan files: what is read from a good one, and what a bad one is told, every fault at once."""

import contextlib
import hashlib
import re
from pathlib import Path

import numpy as np
import pytest

from microrad.lab import bench
from microrad.lab.bench import load_plan, plan
from microrad.lab.bench.plan import PlanError, packaged_plans

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
def test_the_packaged_plans_are_found_by_name():
    assert packaged_plans() == ("mirror-characterisation", "paper-experiment")
    for name in packaged_plans():
        plan = load_plan(name)
        assert plan.path.name == f"{name}.toml"
        assert plan.sha256 == hashlib.sha256((PLANS / f"{name}.toml").read_bytes()).hexdigest()


@pytest.mark.parametrize("path", sorted(PLANS.glob("*.toml")), ids=lambda p: p.stem)
def test_every_value_of_a_packaged_plan_says_where_it_comes_from(path):
    for line in path.read_text(encoding="utf-8").split("\n"):
        if "=" in line and not line.startswith(("#", "name")):
            assert re.search(r" # (paper|assumption): \S", line), line


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


def test_the_characterisation_holds_records_out():
    plan = load_plan("mirror-characterisation")
    uses = {record.excitation.name: record.use for record in plan.records}
    assert {name for name, use in uses.items() if use == "validation"} == {"held-out-sine", "held-out-multisine"}
    assert {record.kind for record in plan.records} == {"multisine", "chirp", "sines", "staircase"}
    assert {record.truth for record in plan.records} == {"bench"}
    creep = next(record.excitation for record in plan.records if record.kind == "staircase")
    assert creep.rate_hz == 1e3
    assert len(creep.step_samples) == 5


def test_a_plan_can_be_cut_down():
    plan = load_plan(PAPER)
    kept = bench.select_records(plan, ["loop-60hz", "chirp"])
    assert [r.excitation.name for r in kept.records] == ["chirp", "loop-60hz"]
    with pytest.raises(ValueError, match=r"no record is named 'loop'; the plan has chirp, loop-60hz"):
        bench.select_records(plan, ["loop"])


# ---- faults
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
        ("^samples_per_period = 10", "samples_per_period = 2", "limits.samples_per_period", "is not above 2"),
        ("^samples_per_period = 10", "samples_per_period = 11", "excitation.chirp.stop", "at most 4.545 kHz"),
        ('^noise = .*', "", "bench.sensor", "noise and noise_share are both missing"),
        ('^noise = .*', 'noise = "1 urad"\nnoise_share = 0.1', "bench.sensor", "are both given"),
        ('^output_max = "180 V"', 'output_max = "150 V"', "limits.drive_max", "the amplifier, 0 V to 10 V at the"),
        ('^drive_max = "16 V"', 'drive_max = "10 V"', "limits.drive_max", "the converters, -4 V to 10 V at the drive"),
        ('^drive_max = "12 V"', 'drive_max = "-1 V"', "limits.drive_max", "is not above drive_min"),
        (r"^\[excitation.chirp\]", "[excitation.'a b']", "excitation.a b", "is no name that a file can have"),
        (r"^\[excitation.chirp\]", "[excitation.loop-60hz]", "excitation", 'two records named "loop-60hz"'),
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


@pytest.mark.parametrize("ending", ["", "[[excitation]]\nkind = 'chirp'\n", "excitation = 5\n"])
def test_a_plan_without_excitations_is_refused(refuse, ending):
    head = TEXT.partition("[excitation.chirp]")[0]
    text = ending + head if ending.startswith("exc") else head + ending
    error = refuse(text)
    assert "excitation" in {fault.key for fault in error.faults}
    assert "[excitation.NAME]" in str(error)


def test_a_file_that_is_not_there_is_told_with_the_packaged_plans(tmp_path):
    with pytest.raises(PlanError, match=r"(?s)the plan file does not exist.*mirror-characterisation, paper-experiment"):
        load_plan(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\0\1")
    with pytest.raises(PlanError, match="the plan file holds binary data"):
        load_plan(tmp_path / "binary.toml")


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


def test_a_plan_has_so_many_samples_in_all(refuse, monkeypatch):
    monkeypatch.setattr(plan, "_MOST_SAMPLES", 100_000)
    (fault,) = refuse(TEXT).faults
    assert fault.reason == "makes a plan of more than 0.1 million samples"
