import math
import re
import tomllib
from importlib import resources

import pytest

import budgets
from microrad.core.units import UnitError
from microrad.mission.fields import NOT_PUBLISHED, UNKNOWN, ProblemsError, Quantity, Several, Share, Switch, Whole
from microrad.mission.file import load_link, load_mission
from microrad.mission.presets import PAPER, preset_text, presets
from microrad.mission.toml import MissionError
from places import ROOT
from preset_files import EXAMPLES, NAMES, as_file, completed, statements
from shipped import DEFAULT, SHIPPED

# values that let a file be read; they are no estimates of the terminals


def value_of(name, key):
    for part in key.split("."):
        name = (tomllib.loads(preset_text(name)) if isinstance(name, str) else name)[part]
    return name


def test_presets_stand_by_name_and_their_names_are_those_of_their_files():
    folder = resources.files("microrad.mission") / "missions" / "presets"
    assert tuple(each.name for each in presets()) == NAMES
    assert {f"{name}.toml" for name in NAMES} == {each.name for each in folder.iterdir()}
    assert all(each.text == preset_text(each.name) for each in presets())


@pytest.mark.promise("readme-7")
def test_eleven_of_them_are_of_the_literature():
    assert len([name for name in NAMES if name not in ("crosslink", "ground-downlink", "sda-crosslink")]) == 11
    assert "to be changed into one's own" in next(each.title for each in presets() if each.name == "crosslink")
    assert "The presets hold eleven links from the literature" in (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.promise("readme-4")
def test_the_shipped_mission_has_what_the_paper_prints_and_a_source_for_all_else():
    paper, own = (load_mission(path).sources for path in (SHIPPED, DEFAULT))
    printed = {key: each.value for key, each in paper.items() if each.comment.startswith("paper")}
    assert len(printed) > 40
    assert {key: own[key].value for key in printed} == printed
    assert [key for key, each in own.items() if not each.comment] == ["name", "mirror.name"]


@pytest.mark.parametrize("name", NAMES)
def test_a_preset_is_told_by_its_first_comment_line(name):
    preset = next(each for each in presets() if each.name == name)
    assert preset.text.startswith(f"# {preset.title}\n")
    assert ":" in preset.title or " to " in preset.title


@pytest.mark.promise("gallery-17", "readme-7")
@pytest.mark.promise("link-3", "link-55")
@pytest.mark.parametrize("name", NAMES)
def test_every_unknown_key_and_nothing_else_is_a_fault(tmp_path, name):
    preset = next(each for each in presets() if each.name == name)
    path = as_file(tmp_path, name, preset.text)
    if not preset.unknown:
        assert load_link(path).mission.name
        return
    with pytest.raises(MissionError) as caught:
        load_link(path)
    assert sorted(fault.key for fault in caught.value.faults) == sorted(preset.unknown)
    for fault in caught.value.faults:
        assert (fault.reason, fault.value) == (NOT_PUBLISHED, f'"{UNKNOWN}"')
        assert fault.key in str(caught.value)
        assert fault.line == next(each.line for each in statements(preset.text) if each.key == fault.key)


@pytest.mark.parametrize("name", NAMES)
def test_known_and_unknown_values_are_all_values(name):
    preset = next(each for each in presets() if each.name == name)
    found = statements(preset.text)
    assert preset.known + len(preset.unknown) == len(found)
    assert set(preset.unknown) == {each.key for each in found if each.value == f'"{UNKNOWN}"'}
    assert len(set(preset.unknown)) == len(preset.unknown)


@pytest.mark.promise("readme-7")
@pytest.mark.promise("link-54", "link-55")
@pytest.mark.parametrize("name", NAMES)
def test_each_value_says_where_it_comes_from_and_no_unknown_one_claims_a_source(name):
    for each in statements(preset_text(name)):
        if each.key in ("name", "mirror.name"):
            continue
        unknown = UNKNOWN in each.value
        kind, _, rest = each.comment.partition(": ")
        assert kind == "unknown" if unknown else kind in ("literature", "paper", "assumption", "derived"), each.key
        assert len(rest) > 5, each.key
        if kind == "literature":  # a year or a place to look it up
            assert re.search(r"\b(19|20)\d\d\b|eoPortal|ESA's Kiruna station", rest), each.key


@pytest.mark.parametrize("name", NAMES)
def test_a_preset_with_its_unknown_values_given_is_a_link(tmp_path, name):
    preset = next(each for each in presets() if each.name == name)
    assert set(EXAMPLES[name]) == set(preset.unknown)
    file = completed(tmp_path, name)
    assert math.isfinite(budgets.communication(file.mission, file.sources).margin_db)
    kinds = {key: source.kind for key, source in file.sources.items() if key not in preset.unknown}
    assert set(kinds.values()) <= {"literature", "paper", "assumption", "derived", ""}
    assert [key for key, kind in kinds.items() if not kind] == (["name", "mirror.name"] if preset.whole else ["name"])


@pytest.mark.promise("link-55")
@pytest.mark.parametrize("name", NAMES)
def test_one_value_left_unknown_is_still_refused(tmp_path, name):
    for key in EXAMPLES[name]:
        with pytest.raises(MissionError) as caught:
            completed(tmp_path, name, **{key.replace(".", "__"): f'"{UNKNOWN}"'})
        assert [fault.key for fault in caught.value.faults] == [key]


@pytest.mark.promise("link-54")
def test_a_crosslink_begins_with_less_than_25_lines(tmp_path):
    """Whole, with its comments: it is the file that one changes into one's own link."""
    text = preset_text("crosslink")
    assert len(text.splitlines()) == 24
    path = tmp_path / "crosslink.toml"
    path.write_text(text, encoding="utf-8")
    m = load_link(path).mission
    assert {m.pointing, m.beacon, m.answer, m.acquisition, m.jitter, m.channel, m.point_ahead} == {None}
    assert (m.conventions.strehl, m.conventions.divergence) == ("unused", "unused")
    terminals = m.terminals
    assert (terminals.leo_name, terminals.geo_name) == ("A", "B")


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("paper", "crosslink")])
def test_conventions_and_the_required_margin_are_no_facts(name):
    choices = ("conventions.", "requirement.margin", "requirement.outage", "pointing.confidence")
    found = [each for each in statements(preset_text(name)) if each.key.startswith(choices)]
    assert len(found) == 6
    assert all(each.comment.startswith("assumption: ") for each in found)


@pytest.mark.promise("link-57")
def test_luce_has_its_power_and_the_on_axis_intensity_that_was_measured(tmp_path):
    text = preset_text("oicets-artemis")
    assert value_of("oicets-artemis", "communication.transmit_power") == "90 mW"
    assert "9.4 urad full angle at 1/e2" in text
    file = completed(tmp_path, "oicets-artemis", communication__pointing_error='"0 urad"')
    beam = file.mission.communication
    half_rad = beam.wavelength_m / (math.pi * beam.beam.radius_m)
    assert 2 * half_rad == pytest.approx(9.4e-6, rel=1e-3)
    budget = budgets.communication(file.mission, file.sources)
    assert budget.irradiance_w_m2 * 4e7**2 == pytest.approx(560e6, rel=5e-3)
    assert budget.radiant_intensity_w_sr == pytest.approx(560e6, rel=5e-3)
    assert budget.irradiance_w_m2 == pytest.approx(350e-9, rel=5e-3)


@pytest.mark.promise("link-84")
@pytest.mark.parametrize(
    ("name", "key", "value", "comment"),
    [
        ("sentinel1-edrs", "communication.data_rate", "1.8 Gbit/s", "Seel et al."),
        ("sentinel1-edrs", "communication.distance", "45000 km", "longest range"),
        ("oicets-artemis", "communication.data_rate", "49.3724 Mbit/s", "usually rounded to 50 Mbit/s"),
        ("tbird", "jitter.rms", ["35 urad", "35 urad"], "20 to 35 urad rms per axis"),
        ("dsoc", "communication.transmit_power", "4 W", "on average"),
        ("dsoc", "communication.receiver.modulation", "ppm", "abstract"),
        ("llcd", "terminals.geo_aperture", "80 cm", "four of 40 cm"),
        ("llcd", "communication.receiver.modulation", "ppm", "Grein et al."),
        ("qpsk-crosslink", "communication.receiver.modulation", "qpsk", "PM-QPSK"),
        ("qpsk-crosslink", "communication.receiver.polarisations", 2, "PM-QPSK"),
        ("sda-crosslink", "communication.receiver.bit_error_ratio", 1e-6, "OCT-039"),
        ("click", "communication.data_rate", "20 Mbit/s", "17.7 Mbit/s at 520 km"),
    ],
)
def test_what_is_published_of_a_flown_link_stands_in_its_preset(name, key, value, comment):
    assert value_of(name, key) == value
    (line,) = [each for each in statements(preset_text(name)) if each.key == key]
    assert line.comment.startswith("literature: ")
    assert comment in line.comment


@pytest.mark.parametrize(
    ("name", "width_rad"), [("tbird", 380e-6), ("click", math.radians(14.6 / 3600)), ("sda-crosslink", 15e-6)]
)
def test_beams_published_at_half_of_their_maximum_have_half_of_it_there(tmp_path, name, width_rad):
    loss = [
        budgets.communication(file.mission, file.sources, pointing_error_rad=angle).margin_db
        for file in [completed(tmp_path, name)]
        for angle in (0.0, width_rad / 2)
    ]
    assert loss[0] - loss[1] == pytest.approx(10 * math.log10(2), abs=0.05)


def test_the_beacon_of_click_is_converted_from_its_width_at_half_of_the_maximum(tmp_path):
    half_rad = completed(tmp_path, "click").mission.beacon.divergence_rad / 2
    assert math.exp(-2 * (math.radians(0.75) / 2 / half_rad) ** 2) == pytest.approx(0.5, rel=1e-3)


@pytest.mark.promise("readme-4")
@pytest.mark.promise("link-54")
def test_the_paper_is_a_whole_mission_whose_links_are_read_alone_too(tmp_path):
    assert [preset.name for preset in presets() if preset.whole] == [PAPER]
    link = load_link(as_file(tmp_path, PAPER, preset_text(PAPER)))
    whole = load_mission(SHIPPED)
    margin = budgets.communication(link.mission, link.sources).margin_db
    assert margin == budgets.communication(whole.mission, whole.sources).margin_db
    assert margin == pytest.approx(3.0, abs=0.01)


def test_each_terminal_of_a_flown_link_has_its_own_name(tmp_path):
    names = [
        completed(tmp_path, name).mission.terminals
        for name in NAMES
        if name not in ("paper", "crosslink", "ground-downlink", "qpsk-crosslink", "sda-crosslink")
    ]
    assert [(each.called("leo"), each.called("geo")) for each in names] == [
        ("CLICK-B", "CLICK-C"),
        ("DSOC", "Palomar"),
        ("CubeSat", "HICALI"),
        ("LLCD", "LLGT"),
        ("OICETS", "ARTEMIS"),
        ("OPALS", "OCTL"),
        ("Sentinel-1A", "EDRS-A"),
        ("SPOT-4", "ARTEMIS"),
        ("TBIRD", "OCTL"),
    ]


def test_a_name_that_no_preset_has_is_refused_with_the_nearest():
    with pytest.raises(ValueError, match=r'no preset "oicets"; did you mean oicets-artemis'):
        preset_text("oicets")
    with pytest.raises(ValueError, match="did you mean tbird"):
        preset_text("TBIRDS")
    with pytest.raises(ValueError, match=f"there are {', '.join(NAMES)}"):
        preset_text("")
    with pytest.raises(ValueError, match="no preset"):
        preset_text("../leo-geo")


@pytest.mark.parametrize(
    "rule",
    [Quantity("W"), Quantity(""), Whole("", least=1, most=9), Share(""), Switch("")],
    ids=repr,
)
def test_a_single_value_of_every_kind_can_be_unknown(rule):
    with pytest.raises(UnitError, match=NOT_PUBLISHED):
        rule.read(UNKNOWN)


def test_a_list_can_be_unknown():
    with pytest.raises(ProblemsError, match=NOT_PUBLISHED):
        Several(Quantity("rad")).read(UNKNOWN)


@pytest.mark.parametrize(
    "key",
    [
        "conventions.strehl",
        "point_ahead.corrected",
        "acquisition.attempts",
        "acquisition.lock_probability",
        "pointing.lines.misalignment.class",
        "acquisition.scan.pattern",
    ],
)
def test_choices_switches_and_counts_of_a_file_can_be_unknown(tmp_path, key):
    text = preset_text("paper").split("\n")
    line = next(each.line for each in statements(preset_text("paper")) if each.key == key)
    text[line - 1] = f'{key.rpartition(".")[2]} = "{UNKNOWN}"'
    with pytest.raises(MissionError) as caught:
        load_link(as_file(tmp_path, "paper", "\n".join(text)))
    assert [(fault.key, fault.reason) for fault in caught.value.faults] == [(key, NOT_PUBLISHED)]


@pytest.mark.parametrize("table", ["channel", "jitter", "beacon", "communication.beam", "acquisition.sensor"])
def test_a_table_can_be_unknown(tmp_path, table):
    holder, _, name = table.rpartition(".")
    lines = preset_text("paper").split("\n")
    for each in statements(preset_text("paper")):
        if each.key.startswith(f"{table}."):
            lines[each.line - 1] = ""
    lines = [line for line in lines if line.strip() != f"[{table}]"]
    lines.insert(lines.index(f"[{holder}]") + 1 if holder else 0, f'{name} = "{UNKNOWN}"')
    with pytest.raises(MissionError) as caught:
        load_link(as_file(tmp_path, "paper", "\n".join(lines)))
    assert [(fault.key, fault.reason) for fault in caught.value.faults] == [(table, NOT_PUBLISHED)]


@pytest.mark.parametrize(
    ("value", "example"),
    [(-1, "5 W"), (0, "5 W"), (2, "2 W"), (0.25, "0.25 W"), (30.0, "5 W"), ("-3", "5 W"), ("4 m", "5 W")],
)
def test_an_example_without_its_unit_is_the_number_where_that_is_allowed(value, example):
    with pytest.raises(UnitError, match=f'for example "{re.escape(example)}"$'):
        Quantity("W", above=0.0, most=20.0).read(value)


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("oicets", "did you mean oicets-artemis?"),
        ("TBIRDS", "did you mean tbird or dsoc?"),
        ("z" * 61, f"there are {', '.join(NAMES)}"),
    ],
)
def test_a_preset_that_is_none_is_told_with_those_near_or_with_all(name, hint):
    with pytest.raises(ValueError) as refused:
        preset_text(name)
    assert str(refused.value) == f'there is no preset "{name[:60]}"; {hint}'
