"""The reference: what becomes a quantity, what counts as moved, and the line that the changelog owes to it."""

import json
import os
import runpy
import subprocess
import sys

import pytest

from microrad.cli import frame
from places import ROOT
from reference import cases, comparing
from reference.quantities import MOST, Quantity, flatten, quantities

REFERENCE = ROOT / "reference"
WAS = {
    "margin_db": Quantity(4.456, "dB", 0.01),
    "verdict": Quantity("no gap", "", 0.0),
    "closes": Quantity(True, "", 0.0),
    "rows": Quantity(256, "", 0.0),
}


def names(changes):
    return [change.name for change in changes]


# ---------------------------------------------------------------------------------------------------------- quantities
def test_a_quantity_has_its_dotted_name_and_the_unit_that_its_key_or_its_record_says():
    data = {
        "margins": {"phase_rad": 1.25, "delay": {"value": 1e-3, "unit": "s"}},
        "outputs": [{"name": "rms", "unit": "rad", "least": 1.0e-6, "rows": 256}, {"name": "margin", "least": 3.0}],
        "theory_rms_rad": {"gauge": 2.0e-6},
        "rate_bit_s": 3.0e8,
        "command_v_0": 0.5,
    }
    assert {found.name: found.unit for found in flatten(data)} == {
        "margins.phase_rad": "rad",
        "margins.delay.value": "s",
        "outputs.rms.least": "rad",
        "outputs.rms.rows": "",
        "outputs.margin.least": "",
        "theory_rms_rad.gauge": "rad",
        "rate_bit_s": "bit/s",
        "command_v_0": "V",
    }


def test_a_long_array_is_kept_as_what_tells_it_apart_and_a_short_one_whole():
    long = {"angle_rad": [float(i) for i in range(MOST + 1)]}
    found = {each.name: each.value for each in flatten(long)}
    assert found.pop("angle_rad.rms") == pytest.approx((sum(i * i for i in range(MOST + 1)) / (MOST + 1)) ** 0.5)
    assert found == {
        "angle_rad.count": MOST + 1,
        "angle_rad.first": 0.0,
        "angle_rad.last": 50.0,
        "angle_rad.min": 0.0,
        "angle_rad.max": 50.0,
        "angle_rad.mean": 25.0,
    }
    assert len(list(flatten({"angle_rad": long["angle_rad"][:-1]}))) == MOST
    records = [{"start_s": float(i), "cause": "Earth"} for i in range(MOST + 1)]
    assert {each.name for each in flatten(records)} >= {"start_s.first", "start_s.rms", "cause.count"}


def test_neither_paths_nor_times_of_this_machine_nor_prose_are_quantities():
    data = {"folder": "/tmp/x", "worst_step_ns": 90.0, "mission_sha256": "e8", "verdict": "closes" * 20, "closes": True}
    assert [(each.name, each.value) for each in flatten(data)] == [("closes", True)]


def test_a_tolerance_is_of_the_quantitys_kind_and_of_the_largest_in_its_array():
    tuned = quantities("design", {"tuned": {"zero": 283.79}, "margins": {"modulus": 0.5}, "count": 3})
    assert tuned["tuned.zero"].tolerance == tuned["count"].tolerance == 0.0
    assert tuned["margins.modulus"].tolerance == pytest.approx(5e-7)
    event = quantities("contacts", {"start_s": 80_000.0, "range_m": 4e7, "range_rate_m_s": 7e3})
    assert 1e-6 < event["start_s"].tolerance < 1e-5
    assert event["range_m"].tolerance == pytest.approx(0.4)
    assert event["range_rate_m_s"].tolerance == pytest.approx(7e-5)
    assert quantities("budget", {"loss_db": [0.0, 200.0]})["loss_db.0"].tolerance == pytest.approx(2e-7)


# ----------------------------------------------------------------------------------------------------------- comparing
def test_within_the_tolerance_nothing_moves_and_outside_of_it_by_name():
    within = WAS | {"margin_db": Quantity(4.4659, "dB", 0.01)}
    assert comparing.moved("mission", WAS, within) == []
    (change,) = comparing.moved("mission", WAS, WAS | {"margin_db": Quantity(4.4661, "dB", 0.01)})
    assert str(change) == "mission: margin_db: was 4.456 dB, is 4.4661 dB, by 0.0023; tolerance 0.01 dB"


@pytest.mark.parametrize(
    ("name", "now"),
    [
        ("margin_db", Quantity(4.456, "dBm", 0.01)),
        ("margin_db", Quantity("nan", "", 0.0)),
        ("margin_db", Quantity(None, "", 0.0)),
        ("verdict", Quantity("does not close", "", 0.0)),
        ("rows", Quantity(257, "", 0.0)),
        ("closes", Quantity(1, "", 0.0)),
    ],
)
def test_another_unit_word_count_or_no_number_has_moved(name, now):
    assert names(comparing.moved("mission", WAS, WAS | {name: now})) == [name]


def test_a_missing_and_a_new_quantity_are_named():
    now = {**WAS, "outage": Quantity(0.003, "", 1e-6)}
    del now["rows"]
    missing, new = sorted(comparing.moved("mission", WAS, now), key=lambda change: change.now is not None)
    assert str(missing) == "mission: rows: was 256, is gone"
    assert str(new) == "mission: outage: new, 0.003"


def test_what_is_written_anew_keeps_the_digits_of_what_did_not_move(tmp_path):
    now = {**WAS, "margin_db": Quantity(4.457, "dB", 0.01), "rows": Quantity(512, "", 0.0)}
    comparing.save(tmp_path / "mission.json", comparing.renewed(WAS, now))
    assert comparing.load(tmp_path / "mission.json") == WAS | {"rows": Quantity(512, "", 0.0)}
    assert (tmp_path / "mission.json").read_text(encoding="utf-8").splitlines() == [
        "{",
        '"closes": [true, "", 0.0],',
        '"margin_db": [4.456, "dB", 0.01],',
        '"rows": [512, "", 0.0],',
        '"verdict": ["no gap", "", 0.0]',
        "}",
    ]


# ----------------------------------------------------------------------------------------------------------- changelog
CHANGELOG = """# Changelog

## 0.2.0 (unreleased)

### Numbers that moved

{}

### Link

- mission: rows 1 -> 2: no line of that section

## 0.1.0

### Numbers that moved

- mission: rows 256 -> 512: a line of an older version
"""


def lacking(*said, **now):
    lines = comparing.lines(CHANGELOG.format("\n".join(said)))
    return list(comparing.unexplained("mission", WAS, WAS | now, lines))


def test_a_number_that_moved_demands_its_line():
    moved = {"margin_db": Quantity(4.9871, "dB", 0.01), "rows": Quantity(512, "", 0.0)}
    assert lacking(**moved) == [
        "### Numbers that moved of CHANGELOG.md lacks: - mission: margin_db 4.456 -> 4.987: why",
        "### Numbers that moved of CHANGELOG.md lacks: - mission: rows 256 -> 512: why",
    ]
    explained = (
        "- mission: margin_db 4.46 ->\n  4.99: the beam is cut at the aperture",
        "- mission: ro* 256 -> 512: why",
    )
    assert lacking(*explained, **moved) == []
    assert lacking() == []
    assert lacking(outage=Quantity(0.1, "", 0.0)) == []  # a new one does not move


@pytest.mark.parametrize(
    "said",
    [
        "- mission: rows 256 -> 511: why",
        "- mission: rows 255 -> 512: why",
        "- mission: * 1 -> 2: why",
    ],
)
def test_a_line_with_other_values_is_named(said):
    (fault,) = lacking(said, rows=Quantity(512, "", 0.0))
    assert fault.endswith("is no quantity that moved so")


@pytest.mark.parametrize(
    "said",
    [
        "- budget: rows 256 -> 512: why",
        "- mission: rows 256 -> 512",
        "- mission: row 256 -> 512: w",
        "- mission: rows 256 -> 512: ",
    ],
)
def test_a_line_of_another_case_or_quantity_or_without_a_reason_does_not_count(said):
    assert lacking(said, rows=Quantity(512, "", 0.0))[0].endswith("- mission: rows 256 -> 512: why")


def test_the_lines_of_an_older_version_do_not_count():
    assert [line.now for line in comparing.lines(CHANGELOG.format("- mission: rows 1 -> 3: why"))] == ["3"]
    assert comparing.lines(CHANGELOG.replace("### Numbers that moved\n\n{}", "")) == []


def test_a_word_that_changed_and_a_quantity_that_is_gone_have_lines_too():
    now = {name: each for name, each in WAS.items() if name != "rows"} | {"verdict": Quantity("no link", "", 0.0)}
    said = comparing.lines(
        CHANGELOG.format('- mission: verdict "no gap" -> "no link": w\n- mission: rows 256 -> gone: w')
    )
    assert list(comparing.unexplained("mission", WAS, now, said)) == []
    assert len(list(comparing.unexplained("mission", WAS, now, []))) == 2


# --------------------------------------------------------------------------------------------------------- the command
def test_a_case_that_moves_or_fails_is_named_and_one_that_cannot_run_here_is_skipped_by_name(monkeypatch, capsys):
    def fails(place):
        raise cases.CommandFailedError("microrad budget ended with 2")

    def cannot(place):
        raise cases.SkippedError("there is no C compiler (cc)")

    for name, measure in (("budget", fails), ("export-c", cannot), ("contacts", lambda place: {"duration_s": 1.0})):
        monkeypatch.setitem(cases.CASES, name, cases.Case(measure))
    check = runpy.run_path(str(ROOT / "scripts" / "numbers"))["check"]
    assert check(["export-c"]) == 0
    assert capsys.readouterr().out == "export-c: skipped: there is no C compiler (cc)\nno number moved\n"
    assert check(["budget"]) == 1
    assert capsys.readouterr().out.startswith("budget: microrad budget ended with 2\n1 ")
    assert check(["contacts"]) == 1
    assert "contacts: ... and " in capsys.readouterr().out


FORKS = """
import json, os
from pathlib import Path
from reference import warm

for words in (["presets", "--json"], ["budget", "no.toml"]):
    print(json.dumps(warm.run(words, Path.cwd(), os.environ | {"COLUMNS": "80"})))
"""


def test_a_command_in_a_fork_ends_and_says_what_the_plain_one_does(call, folder):
    """In a process of its own: one that has threads, as those of the tests have, must not be forked."""
    scripts = os.environ | {"PYTHONPATH": str(ROOT / "scripts"), "PYTHONUNBUFFERED": ""}
    ran = subprocess.run([sys.executable, "-c", FORKS], env=scripts, capture_output=True, text=True, check=True)
    listed, refused = (tuple(json.loads(line)) for line in ran.stdout.splitlines())
    assert listed == call("presets", "--json") and listed[0] == 0
    assert refused == call("budget", "no.toml") and refused[0] == 2
    assert "no.toml" in refused[2]


def test_what_is_said_beside_on_a_slow_machine_is_not_told(monkeypatch, tmp_path, capsys):
    frame._progress_lines(0.0)(32, 192, "4.86 rows/s, 33 s left, margin 1 %: 3.42 dB")
    progress = capsys.readouterr().err
    assert progress == "microrad: 32 of 192: 4.86 rows/s, 33 s left, margin 1 %: 3.42 dB\n"
    compiling = "microrad: compiling the loops for this processor: once, for about half a minute\n"
    said = f"{compiling}{progress}microrad: 2 of them are none.\n"
    monkeypatch.setattr(cases.warm, "run", lambda *_: (1, "found\n", said))
    told = cases.Place(tmp_path).told("campaign", "run")
    assert told == ["$ microrad campaign run", "found", "microrad: 2 of them are none.", "[1]"]


# ------------------------------------------------------------------------------------------------------- what is there
def test_each_case_has_its_file_sorted_and_small():
    assert {path.stem for path in REFERENCE.glob("*.json")} == set(cases.CASES)
    for path in REFERENCE.glob("*.json"):
        found = json.loads(path.read_text(encoding="utf-8"))
        assert list(found) == sorted(found)
        assert path.stat().st_size < 300_000, path


@pytest.mark.promise("releasing-2")
def test_the_release_is_kept_once_and_the_changelog_says_what_moved_since():
    (release,) = (
        path for path in REFERENCE.iterdir() if path.is_dir() and path.name not in ("told", "inside", "tests")
    )
    assert len(list(release.glob("*.json"))) > 20
    assert list(comparing.lacking(REFERENCE, (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))) == []
