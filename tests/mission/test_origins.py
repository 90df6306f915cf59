"""A comment that was written for another value is not its source any more."""

import pytest

import budgets
from microrad.mission import origins
from microrad.mission.file import assumptions, changed_from_shipped, load_link, load_mission
from microrad.mission.presets import preset_text, presets
from microrad.mission.toml import scan
from microrad.studio.draft.draft import Draft
from shipped import SHIPPED

TEXT = SHIPPED.read_text("utf-8")
TABLE_2 = "paper: Table 2"


@pytest.mark.promise("mirror-file-6")
@pytest.mark.parametrize(
    ("key", "comment", "value", "was"),
    [
        ("terminals.leo_aperture", TABLE_2, '"6 cm"', '"5 cm"'),
        ("terminals.leo_aperture", TABLE_2, '"5 m"', '"5 cm"'),
        ("terminals.leo_aperture", TABLE_2, '"5 cm"', ""),
        ("terminals.leo_aperture", TABLE_2, '"50 mm"', ""),
        ("terminals.leo_aperture", TABLE_2, '"0.05 m"', ""),
        ("terminals.leo_aperture", TABLE_2, "5", '"5 cm"'),
        ("terminals.leo_aperture", TABLE_2, '"5 cm', '"5 cm"'),  # no TOML
        ("terminals.leo_aperture", "measured: 2026-03, on our bench", '"6 cm"', ""),
        ("terminals.leo_aperture", "", '"6 cm"', ""),
        ("terminals.relay_aperture", TABLE_2, '"6 cm"', ""),
        ("beacon.strehl", "paper: Table 2; decibel or ratio as conventions.strehl says", "0.40", ""),
        ("beacon.strehl", "paper: Table 2; decibel or ratio as conventions.strehl says", "0.5", "0.4"),
        ("beacon.strehl", "paper: Table 2; decibel or ratio as conventions.strehl says", '"0.4 dB"', "0.4"),
    ],
)
def test_a_comment_belongs_to_the_value_that_it_was_shipped_with(key, comment, value, was):
    assert origins.written_for(key, comment, value) == was


def test_a_value_with_a_key_of_hundreds_of_thousands_of_parts_is_another_one_at_once():
    """Parsing it takes minutes."""
    long = "{a" + ".a" * 400_000 + " = 1}"
    assert origins.written_for("terminals.leo_aperture", TABLE_2, long) == '"5 cm"'
    assert origins.of_paper("terminals.leo_aperture", long) == '"5 cm"'


def test_lists_and_switches_are_compared_by_what_they_mean():
    shipped = {s.key: s for s in scan(TEXT) if s.kind == "key"}

    def was(key, value):
        return origins.written_for(key, shipped[key].comment, value)

    frequencies = shipped["scenario.pid_frequencies"]
    assert was(frequencies.key, '["1000 mHz",  # slow\n "15 Hz"]') == ""
    assert was(frequencies.key, '["1 Hz", "16 Hz"]') == frequencies.value
    assert was(frequencies.key, '["1 Hz"]') == frequencies.value
    assert was("point_ahead.corrected", "true") == ""
    assert was("point_ahead.corrected", "false") == was("point_ahead.corrected", "1") == "true"


@pytest.mark.promise("index-2")
def test_everything_that_is_shipped_keeps_its_source():
    file = load_mission(SHIPPED)
    assert {key: s.was for key, s in file.sources.items() if s.was} == {}
    for preset in presets():
        said = [s for s in scan(preset.text) if s.kind == "key"]
        assert {s.key for s in said if origins.written_for(s.key, s.comment, s.value)} == set()


@pytest.mark.promise("mirror-file-6")
def test_a_budget_says_what_was_changed_and_from_what(tmp_path):
    line = TEXT[: TEXT.index("leo_aperture")].count("\n") + 1
    path = tmp_path / "mission.toml"
    path.write_text(TEXT.replace('leo_aperture = "5 cm"', 'leo_aperture = "6 cm"'), "utf-8")
    file = load_link(path)
    rows = {term.name: term.source for term in budgets.communication(file.mission, file.sources).lines}
    changed = f"mission file, line {line}, in place of 5 cm ({TABLE_2})"
    assert rows["LEO aperture gain"] == f"{changed}; {TABLE_2}"
    assert rows["GEO aperture gain"].split("; ")[0] == TABLE_2


def test_an_assumption_of_another_value_stays_one_and_is_told(tmp_path):
    path = tmp_path / "mission.toml"
    path.write_text(TEXT.replace('error = "24 urad"', 'error = "30 urad"'), "utf-8")
    found = {key: (value, told) for key, value, told in assumptions(load_mission(path).sources)}
    value, told = found["pointing.lines.orbit_knowledge.error"]
    assert value == '"30 urad"'
    assert told.startswith("mission file, line ") and "in place of 24 urad (assumption: 1 km" in told


def test_a_key_that_no_source_prints_is_told_as_given():
    text = preset_text("leo-hicali")
    (given,) = [s for s in scan(text) if s.key == "terminals.leo_aperture"]
    assert origins.written_for(given.key, given.comment, '"2 cm"') == '"unknown"'


def test_a_draft_says_it_as_the_budget_does(tmp_path):
    draft = Draft.shipped(tmp_path / "mission.toml")
    assert draft.values["terminals.leo_aperture"].source == TABLE_2
    changed = draft.set("terminals.leo_aperture", "6 cm").values["terminals.leo_aperture"]
    assert changed.source == f"mission file, line {changed.line}, in place of 5 cm ({TABLE_2})"
    assert changed.comment == TABLE_2  # the text keeps it
    assert draft.set("terminals.leo_aperture", "50 mm").values["terminals.leo_aperture"].source == TABLE_2
    assert draft.values["name"].source == ""


def test_what_names_the_paper_is_held_against_the_papers_mission_by_its_key_alone(tmp_path):
    path = tmp_path / "mission.toml"
    for comment in ("paper: Fig. 3", "paper:  Table 2"):
        line = f'leo_aperture = "6 cm" # {comment}\n'
        path.write_text(TEXT.replace(TEXT[TEXT.index("leo_aperture = ") :].partition("\n")[0] + "\n", line), "utf-8")
        assert changed_from_shipped(load_mission(path).sources) == (("terminals.leo_aperture", '"6 cm"', '"5 cm"'),)
        path.write_text(path.read_text("utf-8").replace('"6 cm"', '"50 mm"'), "utf-8")
        assert changed_from_shipped(load_mission(path).sources) == ()


def test_a_comment_that_is_shipped_with_several_values_speaks_of_none():
    said = {s.value for p in presets() for s in scan(p.text) if s.key == "terminals.leo_name"}
    assert len(said) > 2
    assert origins.written_for("terminals.leo_name", "assumption: what budgets call it", '"MYSAT"') == ""


@pytest.mark.parametrize(
    ("value", "other", "same"),
    [
        ('["1 km", 2, true]', '["1000 m", 2.0, true]', True),
        ('["1 km", 2]', '["1000 m", 3]', False),
        ("[1]", "[1, 2]", False),
        ("1", "true", False),
        ('"a b"', '"a  b"', False),
        ('"5 W"', '"5 m"', False),
        ('"5 W"', "5", False),
        ("x", "x", True),
        ("x", "y", False),
        ('"622.08 Mbit/s"', '"0.62208 Gbit/s"', True),
    ],
)
def test_two_values_are_one_where_they_mean_the_same(value, other, same):
    assert origins._same(value, other) is same
    assert origins._same(other, value) is same


def test_a_value_is_shipped_for_its_own_key_alone():
    assert origins.is_shipped("terminals.leo_aperture", '"50 mm"')
    assert not origins.is_shipped("terminals.geo_aperture", '"5 cm"')
    assert not origins.is_shipped("terminals.leo_apertures", '"5 cm"')
    assert origins.of_paper("terminals.leo_aperture", '"6 cm"') == '"5 cm"'
    assert origins.of_paper("terminals.leo_aperture", '"50 mm"') == origins.of_paper("terminals.none", '"6 cm"') == ""


def test_a_shipped_value_of_several_lines_is_told_in_one(monkeypatch):
    before = "[\n  1.5,\n  2.5,\n]"
    monkeypatch.setattr(origins, "_paper", lambda: {"a.b": before, "c": "1"})
    monkeypatch.setattr(origins, "_shipped", lambda: {("a.b", "paper: Table 1"): (before, "[1.5, 2.50]")})
    assert origins.of_paper("a.b", "[1.5]") == origins.written_for("a.b", "paper: Table 1", "[1.5]") == "[ 1.5, 2.5, ]"
    assert origins.of_paper("a.b", "[1.50, 2.5]") == origins.written_for("a.b", "paper: Table 1", "[1.50, 2.5]") == ""
    assert origins.written_for("a.b", "", "[1.5]") == origins.written_for("a", "paper: Table 1", "[1.5]") == ""
    assert origins.is_shipped("a.b", "[1.5, 2.5]") and not origins.is_shipped("c", "1")


@pytest.mark.parametrize(
    ("value", "other"), [('["a", "b"]', '"ab"'), ("[2]", "2"), ("[]", '""'), ("[[1]]", "[1]"), ('["5 W"]', '"5 W"')]
)
def test_a_list_is_no_text_and_no_number_whatever_is_in_it(value, other):
    assert origins._same(value, other) is origins._same(other, value) is False
    assert origins._same(value, value) is origins._same(other, other) is True
