"""A mission being edited: one value changes and no other byte, and the faults are those of the command line."""

import hashlib
import os
import re
import stat
import tomllib
from pathlib import Path

import pytest

from microrad.mission.file import MissionError, load_mission
from microrad.mission.model import Mission
from microrad.mission.presets import preset_text
from microrad.mission.toml import Fault, scan, value_of
from microrad.studio.draft import draft as drafts
from microrad.studio.draft import tables
from microrad.studio.draft.draft import Draft, DraftError
from microrad.studio.draft.keys import key_of, keys_in, loose_toml, typed_from
from shipped import DEFAULT, SHIPPED, without_fine_pointing

TEXT = SHIPPED.read_text("utf-8")
APERTURE = "terminals.leo_aperture"


@pytest.fixture
def draft(tmp_path):
    """The paper's mission, read from a file."""
    (tmp_path / "m.toml").write_bytes(TEXT.encode())
    return Draft.open(tmp_path / "m.toml")


def changed_lines(before, after):
    """Numbers and new texts of the lines that differ between texts of as many lines."""
    pairs = zip(before.split("\n"), after.split("\n"), strict=True)
    return {number: new for number, (old, new) in enumerate(pairs, 1) if old != new}


# -------------------------------------------------------------------------------------------------------------- values
def test_the_shipped_mission_is_a_draft_without_faults(tmp_path):
    draft = Draft.shipped(tmp_path / "new.toml")
    assert (draft.text, draft.problems, draft.report, draft.changed) == (DEFAULT.read_text("utf-8"), (), "", True)
    assert draft.file().mission == load_mission(DEFAULT).mission


@pytest.mark.promise("readme-15")
@pytest.mark.promise("studio-12")
def test_every_value_has_its_text_its_source_and_what_it_may_hold(draft):
    sources = load_mission(SHIPPED).sources
    assert list(draft.values) == list(sources)
    for key, value in draft.values.items():
        source = sources[key]
        assert (value.comment, value.line) == (source.comment, source.line)
        assert " ".join(value.raw.split()) == source.value
        assert value.about is not None, key
        assert value.about.wanted
        assert value.problems == ()


@pytest.mark.parametrize(
    ("key", "typed", "kind", "unit", "least", "choices"),
    [
        ("terminals.leo_aperture", "5 cm", "quantity", "m", None, ()),
        ("beacon.strehl", "0.4", "number", "", 0.0, ()),
        ("acquisition.attempts", "5", "whole number", "", 1, ()),
        ("orbit.leo.limits.in_eclipse", "true", "switch", "", None, ()),
        ("conventions.strehl", "decibel", "choice", "", None, ("decibel", "ratio", "unused")),
        ("name", "LEO-to-GEO relay of a 100 kg satellite", "text", "", None, ()),
        ("orbit.epoch", "2026-03-20T12:00:00Z", "text", "", None, ()),
        ("orbit.leo.inclination", "sun-synchronous", "quantity", "rad", 0.0, ()),
        ("scenario.pid_frequencies", "1 Hz, 15 Hz", "list", "Hz", None, ()),
        ("fine_pointing.geometry.coupling", "1.0, 0.0, 0.0, 1.0", "list", "", -100.0, ()),
        ("mirror.linear.numerator", "1.979e11, 7.051e13, 2.973e13", "list", "", None, ()),
        ("pointing.lines.misalignment.error", "248 urad", "quantity", "rad", 0.0, ()),
        ("operations.downlink.stations.kiruna.mask", "5 deg", "quantity", "rad", 0.0, ()),
    ],
)
def test_a_form_is_built_from_the_models(draft, key, typed, kind, unit, least, choices):
    value = draft.values[key]
    about = value.about
    assert (value.typed, about.kind, about.unit, about.choices) == (typed, kind, unit, choices)
    assert (about.quantity.least if about.quantity else None) == least
    assert about.required == (
        key not in ("conventions.strehl", "beacon.strehl", "orbit.leo.inclination", "mirror.linear.numerator")
    )


def test_a_key_has_its_description_and_its_words(draft):
    about = draft.values["control.delay"].about
    assert about.description == "from sampling to the changed output"
    assert about.wanted == "a time with its unit, at least 0 s"
    assert key_of("requirement.residual_statistic").wanted == '"peak" or "rms"'
    assert (key_of("name").wanted, key_of("name").example) == ("text", "")
    assert key_of("terminals.leo_obscuration").required is False


@pytest.mark.parametrize("key", ["terminals", "terminals.leo", "pointing.lines", "a.b.c", "", "name.x", "mirror.file"])
def test_what_is_no_key_has_no_form(key):
    assert key_of(key) is None


def test_each_key_of_the_models_is_found_by_its_table():
    assert {key.key for key in keys_in("terminals")} >= {
        APERTURE,
        "terminals.geo_aperture",
        "terminals.leo_obscuration",
    }
    assert [key.key for key in keys_in("")] == ["name"]
    assert [key.key for key in keys_in("constellation.relays.anywhere")] == ["constellation.relays.anywhere.longitude"]
    assert keys_in("constellation.relays") == keys_in("nowhere") == ()


def test_absent_keys_are_those_that_a_table_may_still_have(draft):
    absent = {key.key for key in draft.absent}
    assert "terminals.leo_obscuration" in absent
    assert not absent & set(draft.values)
    assert not any(key.startswith("fine_pointing.wheels") for key in absent)
    assert APERTURE in {key.key for key in draft.without(APERTURE).absent}


# ----------------------------------------------------------------------------------------------------------------- set
@pytest.mark.promise("readme-15")
@pytest.mark.promise("studio-10")
@pytest.mark.parametrize(
    ("key", "typed", "raw"),
    [
        (APERTURE, "8 cm", '"8 cm"'),
        (APERTURE, '  "8 cm" ', '"8 cm"'),
        (APERTURE, "'8 cm'", "'8 cm'"),
        ("beacon.strehl", "0.5", "0.5"),
        ("beacon.strehl", "1", "1"),
        ("acquisition.attempts", "7", "7"),
        ("orbit.leo.limits.in_eclipse", "false", "false"),
        ("conventions.strehl", "ratio", '"ratio"'),
        ("name", 'a "b" \\ c', '"a \\"b\\" \\\\ c"'),
        ("name", "12", '"12"'),
        ("communication.data_rate", "largest", '"largest"'),
        ("orbit.epoch", "2026-04-20T12:00:00Z", '"2026-04-20T12:00:00Z"'),
        ("orbit.leo.inclination", "97.4 deg", '"97.4 deg"'),
        ("scenario.pid_frequencies", "1 Hz, 20 Hz", '["1 Hz", "20 Hz"]'),
        ("scenario.pid_frequencies", "[1 Hz, 20 Hz]", '["1 Hz", "20 Hz"]'),
        ("scenario.pid_frequencies", '["1 Hz", "20 Hz"]', '["1 Hz", "20 Hz"]'),
        ("scenario.pid_frequencies", '"1 Hz", "20 Hz"', '["1 Hz", "20 Hz"]'),
        ("fine_pointing.geometry.coupling", "1, 0.1, 0, 1", "[1, 0.1, 0, 1]"),
    ],
)
def test_one_value_changes_and_no_other_byte(draft, key, typed, raw):
    old = draft.values[key]
    new = draft.set(key, typed)
    assert new.problems == ()
    ((number, line),) = changed_lines(draft.text, new.text).items()
    assert number == old.line
    assert line == draft.text.split("\n")[number - 1].replace(old.raw, raw, 1)
    assert new.values[key].raw == raw
    assert new.set(key, old.raw).text == draft.text
    assert (draft.changed, new.changed) == (False, True)


def test_what_is_typed_as_it_stands_changes_nothing(draft):
    for key, value in draft.values.items():
        assert draft.set(key, value.typed) is draft
        assert draft.set(key, f" {value.raw} ") is draft


@pytest.mark.parametrize(
    ("key", "typed", "raw"),
    [
        ("mirror.uncertainty.parameters", "a, b", '["a", "b"]'),
        ("mirror.uncertainty.parameters", "1, 2", '["1", "2"]'),
        ("mirror.uncertainty.parameters", "[1, 2]", '["1", "2"]'),
        ("mirror.uncertainty.standard_errors", " 0.1, 0.2 ", "[0.1, 0.2]"),
        ("mirror.uncertainty.standard_errors", "a, 0.2", '["a", 0.2]'),
        ("scenario.pid_frequencies", "1 Hz,, 15 Hz, ", '["1 Hz", "15 Hz"]'),
        ("scenario.pid_frequencies", "1 Hz # slow, 15 Hz", '["1 Hz # slow", "15 Hz"]'),
        ("scenario.pid_frequencies", "1 Hz]\nx = [2", '["1 Hz]\\nx = [2"]'),
        ("scenario.pid_frequencies", "'1 Hz', '15 Hz'", "['1 Hz', '15 Hz']"),
        ("scenario.pid_frequencies", "'1 Hz', 15 Hz", "\"'1 Hz', 15 Hz\""),
        ("scenario.pid_frequencies", '["1 Hz", "15 Hz"] # no', '"[\\"1 Hz\\", \\"15 Hz\\"] # no"'),
        ("orbit.leo.limits.in_eclipse", " true ", "true"),
        ("orbit.leo.limits.in_eclipse", "yes", '"yes"'),
        ("name", "true", '"true"'),
        ("conventions.strehl", "'ratio'", "'ratio'"),
    ],
)
def test_what_is_typed_is_quoted_where_its_kind_asks_for_text(key, typed, raw):
    assert key_of(key).toml(typed) == raw


@pytest.mark.parametrize(
    ("typed", "raw"),
    [(" 5 ", "5"), ("a b", '"a b"'), ('"a"', '"a"'), ("[1, 2]", "[1, 2]"), ("1 # no", '"1 # no"'), ("", '""')],
)
def test_a_value_of_a_key_that_nobody_knows_stays_where_it_is_toml(typed, raw):
    assert loose_toml(typed) == raw


@pytest.mark.parametrize(
    ("raw", "typed"),
    [
        ("[true, false]", "true, false"),
        ("[1.50, 'a', 2]", "1.50, a, 2"),
        ("[[1], 2]", "[[1], 2]"),
        ("[]", ""),
        ("true", "true"),
        ("1e3", "1e3"),
        ("'a, b'", "a, b"),
        ("{a = 1}", "{a = 1}"),
    ],
)
def test_a_value_is_shown_as_one_types_it(raw, typed):
    assert typed_from(raw) == typed


@pytest.mark.promise("studio-12")
@pytest.mark.parametrize(
    ("key", "typed"),
    [
        (APERTURE, "8"),
        (APERTURE, "8 potatoes"),
        (APERTURE, ""),
        (APERTURE, '8" # no'),
        (APERTURE, '8 cm"\n[terminals.evil]\nx = "1'),
        ("beacon.strehl", "0,4"),
        ("beacon.strehl", "0.4 # a comment"),
        ("beacon.strehl", "1\nx = 2"),
        ("beacon.strehl", "nan"),
        ("acquisition.attempts", "2.5"),
        ("orbit.leo.limits.in_eclipse", "yes"),
        ("conventions.strehl", "decibels"),
        ("scenario.pid_frequencies", "20 Hz, 1 Hz"),
        ("scenario.pid_frequencies", '"1 Hz", 15 Hz'),
        ("scenario.pid_frequencies", ""),
        ("fine_pointing.geometry.coupling", "1 2 3 4"),
        ("name", "\x7f\x00"),
        ("name", ""),
    ],
)
def test_a_wrong_value_is_one_fault_on_its_line_in_the_words_of_the_command_line(draft, call, tmp_path, key, typed):
    new = draft.set(key, typed)
    value = new.values.get(key)
    if key == "name" and typed:
        assert (new.problems, value.typed) == ((), typed)  # escaped; a name may be anything
        return
    (fault,) = new.problems
    assert (fault.key, fault.line) == (key, draft.values[key].line)
    assert value.problems == (fault,)
    assert list(new.values) == list(draft.values)
    assert value.comment == draft.values[key].comment
    new.save()
    result = call("run", tmp_path / "m.toml")
    assert (result.code, result.err) == (2, f"microrad: {new.report}\n")


def test_a_comment_behind_an_edited_list_stays_and_one_inside_it_is_not_lost(tmp_path):
    text = TEXT.replace('["1 Hz", "15 Hz"] ', '[\n  "1 Hz", # slow\n  "15 Hz",\n] ')
    draft = Draft.shipped(tmp_path / "m.toml").with_text(text)
    assert draft.problems == ()
    with pytest.raises(DraftError, match=r"scenario.pid_frequencies holds comments between its items \(line \d+\)"):
        draft.set("scenario.pid_frequencies", "1 Hz")
    sharp = draft.with_text(TEXT.replace('["1 Hz", "15 Hz"] ', '["1 Hz", "15 Hz#"] '))
    assert '["1 Hz", "14 Hz"] ' in sharp.set("scenario.pid_frequencies", "1 Hz, 14 Hz").text
    open_end = draft.with_text(TEXT.replace('["1 Hz", "15 Hz"]', '["1 Hz", "15 Hz"'))
    assert len(open_end.problems) == 1
    assert open_end.set("scenario.pid_frequencies", "1 Hz, 15 Hz").text == TEXT
    plain = draft.with_text(text.replace(" # slow", ""))
    assert plain.set("scenario.pid_frequencies", "1 Hz").text == TEXT.replace('["1 Hz", "15 Hz"] ', '["1 Hz"] ')


@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_line_ends_and_a_byte_order_mark_stay(tmp_path, mark, ends):
    content = (mark + TEXT.replace("\n", ends)).encode()
    (tmp_path / "m.toml").write_bytes(content)
    draft = Draft.open(tmp_path / "m.toml")
    assert (draft.problems, draft.changed) == ((), False)
    draft.set(APERTURE, "8 cm").set("terminals.leo_obscuration", "0.2").save()
    added = f"leo_obscuration = 0.2{ends}".encode()
    after = (tmp_path / "m.toml").read_bytes()
    assert after.count(added) == 1
    assert after.replace(added, b"") == content.replace(b'leo_aperture = "5 cm"', b'leo_aperture = "8 cm"')
    assert draft.with_text(TEXT) is draft


@pytest.mark.parametrize(
    ("old", "typed", "new"),
    [
        ("\ufeffa = 1\n", "\ufeffa = 2\n", "\ufeffa = 2\n"),
        ("\ufeffa = 1\n", "a = 2\n", "\ufeffa = 2\n"),
        ("a = 1\n", "\ufeffa = 2\n", "\ufeffa = 2\n"),
        ("a = 1\r\nb = 1\r\n", "a = 2\nb = 1\n", "a = 2\r\nb = 1\r\n"),
        ("a = 1\r\nb = 1\n", "a = 2\nb = 1\n", "a = 2\nb = 1\n"),
        ("a = 1\r\n", "a = 2\r\nb = 1\n", "a = 2\r\nb = 1\n"),
        ("a = 1\n", "a = 2\nb = 1\n", "a = 2\nb = 1\n"),
    ],
)
def test_another_text_gets_the_line_ends_and_the_mark_of_the_file_where_those_are_clear(tmp_path, old, typed, new):
    assert Draft(old, tmp_path / "m.toml", ()).with_text(typed).text == new


def test_of_a_key_that_stands_twice_the_first_line_counts(draft):
    (value,) = (
        each
        for key, each in draft.with_text("[terminals]\nleo_aperture = 1\nleo_aperture = 2\n").values.items()
        if key == APERTURE
    )
    assert (value.raw, value.line) == ("1", 2)


@pytest.mark.parametrize(("text", "source"), [("x = 1 # a book", "a book"), ("x = 1", "")])
def test_a_value_has_a_source_where_it_has_a_comment(draft, text, source):
    assert draft.with_text(text).values["x"].source == source


def test_a_value_without_a_comment_keeps_the_line_end_behind_it(tmp_path):
    text = re.sub(r'^leo_aperture = "5 cm".*$', 'leo_aperture = "5 cm"', TEXT, flags=re.MULTILINE)
    content = text.replace("\n", "\r\n").encode()
    (tmp_path / "m.toml").write_bytes(content)
    Draft.open(tmp_path / "m.toml").set(APERTURE, "8 cm").save()
    after = (tmp_path / "m.toml").read_bytes()
    assert after == content.replace(b'leo_aperture = "5 cm"', b'leo_aperture = "8 cm"') != content


def test_mixed_line_ends_stay_too(tmp_path):
    lines = TEXT.split("\n")
    content = "".join(line + ("\r\n" if n % 3 else "\n") for n, line in enumerate(lines[:-1])).encode()
    (tmp_path / "m.toml").write_bytes(content)
    Draft.open(tmp_path / "m.toml").set("scenario.loop_amplitude", "5 V").save()
    wanted = content.replace(b'loop_amplitude = "6 V"', b'loop_amplitude = "5 V"')
    assert (tmp_path / "m.toml").read_bytes() == wanted != content


def test_a_key_that_its_table_may_have_gets_a_line_of_its_own(draft):
    new = draft.set("terminals.leo_obscuration", "0.2")
    assert new.problems == ()
    assert new.text == TEXT.replace(
        'geo_aperture = "15 cm"                # paper: Table 2\n',
        'geo_aperture = "15 cm"                # paper: Table 2\nleo_obscuration = 0.2\n',
    )
    assert new.without("terminals.leo_obscuration").text == TEXT


def test_a_list_over_several_lines_goes_with_all_of_them(tmp_path):
    line = next(each for each in TEXT.split("\n") if each.startswith("pid_frequencies"))
    items = tomllib.loads(line)["pid_frequencies"]
    broken = "\n".join(["pid_frequencies = [", *(f'    "{each}",' for each in items), "]"])
    (tmp_path / "m.toml").write_text(TEXT.replace(line, broken), "utf-8")
    new = Draft.open(tmp_path / "m.toml").without("scenario.pid_frequencies")
    assert new.text == TEXT.replace(f"{line}\n", "")


def test_a_line_is_added_at_the_end_of_a_text_that_has_no_last_line_end(tmp_path):
    draft = Draft.shipped(tmp_path / "m.toml").with_text('name = "x"\n[terminals]\nleo_aperture = "5 cm"')
    assert draft.set("terminals.geo_aperture", "5 cm").text.endswith('"5 cm"\ngeo_aperture = "5 cm"\n')
    assert draft.with_text("[terminals]").set("name", "x").text == 'name = "x"\n[terminals]'
    assert draft.with_text("").set("name", "x").text == 'name = "x"\n'


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("terminals.leo_apertur", r"terminals.leo_apertur is no key of \[terminals\], which has leo_aperture, geo_"),
        ("terminal.x", "terminal.x is no key of the mission"),
        ("fine_pointing.wheels.speed", r"needs the table \[fine_pointing.wheels\], which has no header in .*m.toml"),
    ],
)
def test_a_key_without_a_place_is_refused(draft, key, words):
    with pytest.raises(DraftError, match=words):
        draft.set(key, "1")


def test_a_key_in_an_inline_table_is_changed_in_the_text(tmp_path):
    start, end = TEXT.index("[orbit.geo.limits]"), TEXT.index("# ---", TEXT.index("[orbit.geo.limits]"))
    inline = TEXT[:start].rstrip() + '\nlimits = {attitude = "free"}\n' + TEXT[end:]
    draft = Draft.shipped(tmp_path / "m.toml").with_text(inline)
    assert {fault.key for fault in draft.problems} == {
        f"orbit.geo.limits.{key}" for key in ("slew_limit", "sun_exclusion", "in_eclipse")
    }
    with pytest.raises(DraftError, match=r"needs the table \[orbit.geo.limits\]"):
        draft.set("orbit.geo.limits.attitude", "nadir")
    value = draft.values["orbit.geo.limits"]
    assert (value.typed, value.about) == ('{attitude = "free"}', None)
    whole = '{attitude = "free", slew_limit = "1 deg/s", sun_exclusion = "5 deg", in_eclipse = true}'
    assert draft.set("orbit.geo.limits", whole).problems == ()


def test_a_list_may_be_typed_over_several_lines(draft):
    new = draft.set("scenario.pid_frequencies", '[\r\n  "1 Hz",\r\n  "20 Hz",\r\n]')
    assert new.problems == ()
    assert new.text == TEXT.replace('["1 Hz", "15 Hz"] ', '[\n  "1 Hz",\n  "20 Hz",\n] ')
    bare = draft.set("scenario.pid_frequencies", "1 Hz,\n20 Hz").values["scenario.pid_frequencies"]
    assert bare.raw == '["1 Hz", "20 Hz"]'


def test_an_unknown_key_of_the_text_can_be_put_right_or_removed(draft):
    text = TEXT.replace("leo_aperture = ", "leo_apertur = ")
    wrong = draft.with_text(text)
    (fault,) = wrong.problems
    assert fault.nearest == "leo_aperture"
    assert wrong.values["terminals.leo_apertur"].problems == (fault,)
    mended = wrong.without("terminals.leo_apertur").set(APERTURE, "5 cm")
    assert mended.problems == ()
    with pytest.raises(DraftError, match=r"x\.y has no line of its own"):
        draft.without("x.y")


def test_a_key_of_hundreds_of_thousands_of_parts_is_shown_as_it_stands(draft):
    """Parsing goes through all parts for each part: this took minutes, each time a page asked for the values."""
    long, allowed = "{a" + ".a" * 400_000 + " = 1}", "{a" + ".a" * 49 + " = 1}"
    assert value_of(long) is None
    assert list(value_of(allowed)) == ["a"]
    broken = draft.with_text(f"{TEXT}[more]\nx = {long}\n")
    assert broken.values["more.x"].typed == long
    assert broken.set("more.x", "1").values["more.x"].raw == "1"
    assert draft.set(APERTURE, long).values[APERTURE].raw == f'"{long}"'


def test_a_text_with_a_broken_line_is_edited_elsewhere(draft):
    broken = draft.with_text(TEXT.replace("[beacon]", "[beacon"))
    assert broken.problems
    with pytest.raises(MissionError) as refusal:
        broken.file()
    assert str(refusal.value) == broken.report
    new = broken.set(APERTURE, "8 cm")
    assert new.text == broken.text.replace('leo_aperture = "5 cm"', 'leo_aperture = "8 cm"')
    assert new.problems == broken.problems


def test_tables_come_and_go_by_text(draft):
    wheels = (
        '\n[fine_pointing.wheels]\nspeed = "50 Hz"\nharmonics = [1.0]\ncoefficients = ["0.1 nrad/Hz^2"]\n'
        'convention = "per-axis"\n'
    )
    more = draft.with_text(draft.text + wheels)
    assert more.problems == ()
    assert more.set("fine_pointing.wheels.speed", "60 Hz").file().mission.fine_pointing.wheels.speed_hz == 60.0
    assert more.with_text(TEXT).file().mission.fine_pointing.wheels is None


# ------------------------------------------------------------------------------------------------------------ problems
@pytest.mark.promise("readme-15")
def test_faults_of_many_kinds_are_those_of_the_command_line(draft, call, tmp_path):
    text = (
        TEXT.replace('leo_aperture = "5 cm"', "leo_aperture = 5")
        .replace("[amplifier]", "[amplifer]")
        .replace('divergence = "780 urad"', 'divergence = "1 urad"')
        .replace('rate = "50 kHz"', "rate = 50 kHz")
    )
    new = draft.with_text(text)
    assert len(new.problems) == 3
    new.save()
    for command in ("run", "budget"):
        assert call(command, tmp_path / "m.toml").err == f"microrad: {new.report}\n"
    with pytest.raises(MissionError) as refusal:
        load_mission(tmp_path / "m.toml")
    assert refusal.value.faults == new.problems


def test_a_mirror_file_is_looked_for_beside_the_mission(draft, tmp_path):
    start, end = TEXT.index("[mirror]"), TEXT.index("[amplifier]")
    new = draft.with_text(TEXT[:start] + '[mirror]\nfile = "lab.toml"\n\n' + TEXT[end:])
    (fault,) = new.problems
    assert fault.file == str(tmp_path / "lab.toml")
    (tmp_path / "lab.toml").write_text(TEXT[start:end].replace("[mirror]\n", "").replace("[mirror.", "["))
    assert new.set("mirror.file", "./lab.toml").problems == ()
    assert new.set("mirror.file", "./lab.toml").file().mission == load_mission(SHIPPED).mission


def test_a_text_of_links_alone_is_in_order_as_for_the_budget(tmp_path):
    draft = Draft.shipped(tmp_path / "m.toml").with_text(preset_text("click"))
    unknown = {fault.key for fault in draft.problems}
    assert unknown
    for key in unknown:
        draft = draft.set(key, key_of(key).example)
    with pytest.raises(MissionError, match="is missing"):
        draft.file()
    if not draft.problems:
        assert not isinstance(draft.link().mission, Mission)


@pytest.mark.parametrize(
    ("text", "words"),
    [("", "is empty"), ("\0", "holds binary data"), ("x = 1\n" * 10_001, "has more than 10000 lines")],
)
def test_a_text_that_is_no_mission_at_all_is_a_draft_that_says_so(draft, text, words):
    (fault,) = draft.with_text(text).problems
    assert words in str(fault)
    assert (fault.key, fault.line) == ("", 0)


# ---------------------------------------------------------------------------------------------------------------- disk
@pytest.mark.promise("readme-15")
@pytest.mark.promise("studio-1")
def test_a_saved_draft_is_the_file_that_the_command_line_reads(draft, tmp_path):
    new = draft.set(APERTURE, "8 cm").save()
    assert (new.changed, new.path) == (False, tmp_path / "m.toml")
    file = load_mission(tmp_path / "m.toml")
    assert file.text == new.text
    assert file.sha256 == new.sha256 == new.disk_sha256 == new.file().sha256
    assert file.mission == new.file().mission
    assert file.mission.terminals.leo_aperture_m == pytest.approx(0.08)
    assert tomllib.loads(new.text)["terminals"]["leo_aperture"] == "8 cm"


@pytest.mark.promise("studio-11")
def test_the_last_of_two_tabs_is_told(draft, tmp_path):
    one, two = draft.set(APERTURE, "8 cm"), draft.set(APERTURE, "9 cm")
    saved = one.save()
    with pytest.raises(DraftError, match=r"m.toml was changed since it was opened here, in another tab or by another"):
        two.save()
    assert load_mission(tmp_path / "m.toml").mission.terminals.leo_aperture_m == pytest.approx(0.08)
    assert not saved.set(APERTURE, "10 cm").save().changed
    elsewhere = two.save(tmp_path / "two.toml")
    assert elsewhere.path == tmp_path / "two.toml"
    assert not elsewhere.set(APERTURE, "11 cm").save().changed


def test_what_both_tabs_say_alike_is_saved_by_both(draft):
    one, two = draft.set(APERTURE, "8 cm"), draft.set(APERTURE, "8 cm")
    one.save()
    assert two.save().disk_sha256 == one.sha256


def test_a_file_that_is_there_is_not_replaced_by_another_name(draft, tmp_path):
    (tmp_path / "other.toml").write_text("mine")
    with pytest.raises(DraftError, match=r"other\.toml exists and is left as it is; choose another name"):
        draft.save(tmp_path / "other.toml")
    with pytest.raises(DraftError, match=r"other\.toml exists and is left as it is"):
        Draft.shipped(tmp_path / "other.toml").save()
    assert (tmp_path / "other.toml").read_text() == "mine"


def test_a_file_that_is_gone_is_written_again(draft, tmp_path):
    (tmp_path / "m.toml").unlink()
    draft.save()
    assert (tmp_path / "m.toml").read_text("utf-8") == TEXT


def test_who_may_read_a_file_stays_and_so_does_a_link(draft, tmp_path):
    (tmp_path / "m.toml").chmod(0o600)
    (tmp_path / "link.toml").symlink_to("m.toml")
    Draft.open(tmp_path / "link.toml").set(APERTURE, "8 cm").save()
    assert (tmp_path / "link.toml").is_symlink()
    assert stat.S_IMODE((tmp_path / "m.toml").stat().st_mode) == 0o600
    assert 'leo_aperture = "8 cm"' in (tmp_path / "m.toml").read_text("utf-8")


@pytest.mark.parametrize("name", ["none/m.toml", "."])
def test_a_place_that_cannot_be_written_is_told(draft, tmp_path, name):
    with pytest.raises(DraftError, match=r"cannot be written: (No such file|Is a directory)"):
        draft.save(tmp_path / name)


@pytest.mark.promise("studio-29")
def test_a_full_disk_leaves_the_file_as_it_was(draft, tmp_path, monkeypatch):
    def full(path, text, mode):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(drafts, "write_whole", full)
    with pytest.raises(DraftError, match="No space left on device; check free space and permissions, or save under"):
        draft.set(APERTURE, "8 cm").save()
    assert hashlib.sha256((tmp_path / "m.toml").read_bytes()).hexdigest() == draft.sha256


def test_a_fault_of_the_disk_that_has_no_number_is_told_in_its_own_words(draft, monkeypatch):
    def odd(path, text, mode):
        raise OSError("the disk is odd")

    monkeypatch.setattr(drafts, "write_whole", odd)
    with pytest.raises(DraftError, match=r"m\.toml cannot be written: the disk is odd; check free space"):
        draft.set(APERTURE, "8 cm").save()


def test_what_became_of_the_file_on_disk(draft, tmp_path):
    path, new = tmp_path / "m.toml", draft.set(APERTURE, "8 cm")
    assert (draft.on_disk(), new.on_disk()) == ("", "")
    path.write_bytes(new.text.encode())
    assert (draft.on_disk(), new.on_disk()) == ("changed", "")  # as it would be saved
    path.unlink()
    assert (draft.on_disk(), Draft.shipped(path).on_disk()) == ("gone", "")
    path.mkdir()
    assert (draft.on_disk(), Draft.shipped(path).on_disk()) == ("changed", "changed")


@pytest.mark.skipif(os.name != "posix", reason="POSIX has modes of files")
def test_a_file_whose_mode_cannot_be_kept_is_left_as_it_is(draft, tmp_path, monkeypatch):
    def refused(path, mode):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(Path, "chmod", refused)
    with pytest.raises(DraftError, match="cannot be written: Operation not permitted"):
        draft.set(APERTURE, "8 cm").save()
    assert hashlib.sha256((tmp_path / "m.toml").read_bytes()).hexdigest() == draft.sha256


@pytest.mark.parametrize("content", [None, b"\xff\xfe", b"a\0b", b"#" * 1_000_001])
def test_a_file_that_is_no_text_is_refused_as_on_the_command_line(tmp_path, call, content):
    if content is not None:
        (tmp_path / "m.toml").write_bytes(content)
    with pytest.raises(MissionError) as refusal:
        Draft.open(tmp_path / "m.toml")
    assert call("run", tmp_path / "m.toml").err == f"microrad: {refusal.value}\n"


def test_half_a_character_is_refused(draft):
    for change in (lambda: draft.set("name", "a\ud800"), lambda: draft.with_text("\ud800")):
        with pytest.raises(DraftError, match="holds half of a character"):
            change()


def test_a_mission_without_fine_pointing_is_a_draft_too(tmp_path):
    draft = Draft.shipped(tmp_path / "m.toml").with_text(without_fine_pointing(TEXT))
    assert draft.problems == ()
    assert not any(key.startswith("fine_pointing") for key in draft.values)


@pytest.mark.parametrize("name", ["operations.optical", "constellation.stations.svalbard"])
def test_stations_that_are_offered_make_a_mission_without_faults(tmp_path, name):
    draft = Draft.shipped(tmp_path / "m.toml")
    assert name in tables.offered(draft)
    added = tables.with_table(draft, name)
    assert added.problems == () and f"[{name}]" in added.text and name not in tables.offered(added)
    availability = f"{name}{'.stations.nemea' if 'optical' in name else ''}.availability"
    for typed in ("0.25", "[0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.25]"):
        assert added.set(availability, typed).problems == ()
    (fault,) = added.set(availability, "1.5").problems
    assert fault.key == availability and "a list of 12 such" in fault.expected


# ------------------------------------------------------------------------------------------- behind the first of a kind
def test_a_line_goes_behind_the_last_key_of_its_own_table_and_not_of_one_that_begins_alike(draft):
    text = "[beacon_of_mine]\nx = 1\n\n[beacon]\nstrehl = 0.5\nfoo = [\n  1,\n]\n# behind\n\n[beacon.inner]\ny = 2\n"
    got = draft.with_text(text).set("beacon.wavelength", "977 nm")
    assert got.text == text.replace("]\n# behind", ']\nwavelength = "977 nm"\n# behind')
    at_top = draft.with_text("# head\n\n[beacon]\nstrehl = 0.5\n").set("name", "n")
    assert at_top.text == 'name = "n"\n# head\n\n[beacon]\nstrehl = 0.5\n'
    empty = draft.with_text("[beacon]\n[answer]\n").set("answer.strehl", "0.25")
    assert empty.text == "[beacon]\n[answer]\nstrehl = 0.25\n"


@pytest.mark.parametrize(
    ("text", "key", "rest"),
    [
        ("a = 1\nb = [\n  1,\n  2,\n] # two\nc = 3\n", "b", "a = 1\nc = 3\n"),
        ("a = 1 # one\nb = 2\n", "a", "b = 2\n"),
        ("[x]\na = 1\n[y]\na = 2", "y.a", "[x]\na = 1\n[y]\n"),
        ("\ufeffa = 1\r\nb = 2\r\nc = 3\r\n", "b", "\ufeffa = 1\r\nc = 3\r\n"),
        ("\ufeffa = 1\r\nb = 2\nc = 3\r\n", "c", "\ufeffa = 1\r\nb = 2\n"),
    ],
)
def test_a_key_goes_with_all_of_its_own_lines_and_no_other(tmp_path, text, key, rest):
    assert Draft(text, tmp_path / "m.toml", ()).without(key).text == rest


@pytest.mark.parametrize(
    ("text", "key", "typed", "new"),
    [
        ("\ufeffa = 1\r\nb = 22\r\nc = 3\r\n", "b", "4", "\ufeffa = 1\r\nb = 4\r\nc = 3\r\n"),
        ("a = 1\r\nb = 22\nc = 3\r\n", "c", "[5]", "a = 1\r\nb = 22\nc = [5]\r\n"),
        ("\ufeffa = 1\nb = 'µ' # ü\nc = 3", "c", "true", "\ufeffa = 1\nb = 'µ' # ü\nc = true"),
        ("a = 1\r\n[t]\r\nb = 2\r\n", "t.b", "x", 'a = 1\r\n[t]\r\nb = "x"\r\n'),
    ],
)
def test_a_value_behind_other_lines_is_replaced_in_its_place(tmp_path, text, key, typed, new):
    assert Draft(text, tmp_path / "m.toml", ()).set(key, typed).text == new


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("nowhere", "nowhere has no line of its own in {path}; change it in the text"),
        ("terminals", "terminals has no line of its own in {path}; change it in the text"),
    ],
)
def test_a_key_without_a_line_cannot_go(draft, key, words):
    with pytest.raises(DraftError) as refusal:
        draft.without(key)
    assert str(refusal.value) == words.format(path=draft.path)


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("requirement.none", "requirement.none is no key of [requirement], which has margin, "),
        ("none.at.all", "none.at.all is no key of the mission"),
        ("channel.model", "channel.model "),
    ],
)
def test_a_key_that_cannot_be_set_says_where_it_would_belong(draft, key, words):
    with pytest.raises(DraftError) as refusal:
        draft.set(key, "1")
    assert str(refusal.value).startswith(words)


def test_a_key_of_a_table_that_is_missing_names_the_table_and_the_file(draft):
    bare = draft.with_text("name = 'a'\n")
    with pytest.raises(DraftError) as refusal:
        bare.set("beacon.strehl", "0.5")
    assert str(refusal.value) == (
        f"beacon.strehl needs the table [beacon], which has no header in {draft.path}; change the text"
    )


def test_half_a_character_is_named_by_its_place(draft):
    with pytest.raises(DraftError, match=r"^abc\\?.*holds half of a character at 4; type it again$"):
        draft.set("name", "abc\udc80d")


def test_every_fault_of_a_key_is_beside_its_value_and_no_other_one(draft):
    wrong = draft.set(APERTURE, "8").set("terminals.geo_aperture", "9 V").set("acquisition.attempts", "2.5")
    lines = {fault.key: fault.line for fault in wrong.problems}
    assert {*lines} == {APERTURE, "terminals.geo_aperture", "acquisition.attempts"}
    told = {key: [fault.key for fault in value.problems] for key, value in wrong.values.items() if value.problems}
    assert told == {key: [key] for key in lines}
    assert {key: wrong.values[key].line for key in lines} == lines
    assert wrong.report.count("line ") >= 3 and str(wrong.path) in wrong.report


@pytest.mark.parametrize(
    ("typed", "raw"),
    [
        ("1, 0.2, -3e-4", "[1, 0.2, -3e-4]"),
        ("[1,  2 ]", "[1,  2 ]"),
        ("", "[]"),
        ("[", "[]"),
        ("1, a b, 2", '[1, "a b", 2]'),
        ("true, 2", "[true, 2]"),
    ],
)
def test_a_list_of_plain_numbers_keeps_what_stands_alone(typed, raw):
    assert key_of("fine_pointing.geometry.coupling").toml(typed) == raw


@pytest.mark.parametrize(
    ("dotted", "kind", "required"),
    [
        ("terminals.leo_aperture", "quantity", True),
        ("beacon.strehl", "number", False),
        ("acquisition.attempts", "whole number", None),
        ("orbit.leo.limits.in_eclipse", "switch", None),
        ("conventions.strehl", "choice", None),
        ("pointing.lines.any_name_at_all.error", "quantity", True),
        ("operations.stations.somewhere.availability", None, None),
    ],
)
def test_a_key_of_a_table_with_a_name_of_its_own_is_found_like_any_other(dotted, kind, required):
    found = key_of(dotted)
    assert found is None if kind is None else found.kind == kind
    if required is not None:
        assert (found.key, found.required) == (dotted, required)


def test_a_table_of_names_is_no_table_of_keys():
    assert keys_in("pointing.lines") == ()
    assert {key.key for key in keys_in("pointing.lines.mine")} >= {"pointing.lines.mine.error"}
    assert key_of("pointing.lines") is None and key_of("pointing.lines.mine") is None
    assert key_of("terminals.leo_aperture.more") is None
    assert all("." not in key.key for key in keys_in(""))


def test_examples_come_with_their_inner_tables_and_in_the_order_of_their_depth():
    names = [*tables._examples()]
    assert [name.count(".") for name in names] == sorted(name.count(".") for name in names)
    blocks = {"a": "[a]\nx = 1", "ab": "[ab]", "a.b": "[a.b]", "a.b.c": "[a.b.c]", "b": "[b]"}
    assert tables._whole("a", blocks) == "[a]\nx = 1\n\n[a.b]\n\n[a.b.c]"
    assert tables._whole("a.b", blocks) == "[a.b]"
    named = {"o": "[o]", "o.stations.x": "[o.stations.x]", "o.other": "[o.other]", "o.stations.y": "[o.stations.y]"}
    assert tables._with_named("o", named) == "[o]\n\n[o.stations.x]\n\n[o.stations.y]"


def test_a_block_of_a_text_has_the_comment_right_above_its_header():
    text = (
        "# head\n\n# of a, one\n# of a, two\n[a]\nx = 1\ny = [\n  2,\n]\n# between\n"
        "# z = 3\n[b]\n\n# far\n\n# [d]\n# of c\n[c]\nz = 1\n# " + 30 * "-" + " rule\n[e]"
    )
    assert dict(tables._blocks(text)) == {
        "a": "# of a, one\n# of a, two\n[a]\nx = 1\ny = [\n  2,\n]",
        "b": "[b]",
        "c": "# of c\n[c]\nz = 1",
        "e": "[e]",
    }


@pytest.mark.parametrize(
    ("place", "written"),
    [
        ("sub/s.toml", "../sub/s.toml"),
        ("mission/s.toml", "s.toml"),
        ('mission/a "b".toml', 'a "b".toml'),
        ("mission/µ/s.toml", "µ/s.toml"),
    ],
)
def test_the_mirror_of_another_folder_is_named_as_seen_from_the_mission(tmp_path, place, written):
    draft = Draft("[mirror]\nname = 'a'\n[mirror.linear]\nx = 1\n[b]\n", tmp_path / "mission" / "m.toml", ())
    got = tables.with_mirror_file(draft, tmp_path / place).text
    assert tomllib.loads(got) == {"mirror": {"file": written}, "b": {}}
    assert (got.endswith("\n[b]\n") and "µ" in got) or "µ" not in place


def test_another_name_for_a_file_in_the_same_place_is_its_own(draft, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    new = draft.set(APERTURE, "8 cm").save("m.toml")
    assert (new.path, new.disk_sha256, new.changed) == (Path("m.toml"), new.sha256, False)
    assert 'leo_aperture = "8 cm"' in (tmp_path / "m.toml").read_text("utf-8")
    assert (draft.disk_sha256, draft.on_disk()) == (draft.sha256, "changed")


def test_a_file_that_cannot_be_read_is_not_written_over(draft, monkeypatch):
    def refuse(path, most):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(drafts, "read_bytes", refuse)
    with pytest.raises(DraftError) as refusal:
        draft.set(APERTURE, "8 cm").save()
    assert str(refusal.value) == f"{draft.path} cannot be written: Permission denied; choose another name"
    assert draft.on_disk() == "changed"


@pytest.mark.parametrize(
    ("text", "places"),
    [
        ("\ufeffa\r\nb\nc\r\n", [1, 2, 4, 5, 6, 7, 9]),
        ("a\r\nb\nc\r\n", [0, 1, 3, 4, 5, 6, 8]),
        ("\r\n\r\n", [0, 2, 4]),
        ("\ufeff", [1]),
        ("a\rb\r\n", [0, 1, 2, 3, 5]),
    ],
)
def test_each_character_of_a_plain_text_has_its_place_in_the_text_as_it_is(text, places):
    plain = drafts._plain(text)
    assert [drafts._as_written(text, place) for place in range(len(plain) + 1)] == places
    lines = plain.split("\n")
    begins = [sum(len(line) + 1 for line in lines[:n]) for n in range(len(lines))]
    found = [drafts._line_begin(plain, n + 1) for n in range(len(lines) + 2)]
    assert found == [*begins, len(plain), len(plain)]


@pytest.mark.parametrize(
    ("key", "unit", "wanted", "example"),
    [
        (APERTURE, "m", "a length with its unit, above 0 m, at most 100 m", "5 cm"),
        ("acquisition.attempts", "", "a whole number without quotes, from 1 to 1000", "2"),
        ("orbit.leo.limits.in_eclipse", "", "true or false, without quotes", "true"),
        ("conventions.strehl", "", '"decibel" or "ratio" or "unused"', "decibel"),
        (
            "scenario.pid_frequencies",
            "Hz",
            "a list, rising, each item a frequency with its unit, above 0 Hz, at most 1 THz",
            '["5 Hz"]',
        ),
        (
            "error_budget.sources.mine.gains",
            "",
            "a list, each item a number without quotes, at least -1e+06, at most 1e+06",
            "[5.0]",
        ),
        (
            "orbit.leo.inclination",
            "rad",
            'an angle with its unit, at least 0 deg, at most 180 deg, or "sun-synchronous"',
            "5 deg",
        ),
        ("pointing.confidence", "", "a number without quotes, above 0 and below 1", "0.5"),
    ],
)
def test_a_key_says_what_it_wants_with_an_example_that_is_taken(key, unit, wanted, example):
    found = key_of(key)
    assert (found.unit, found.wanted, found.example) == (unit, wanted, example)
    assert value_of(found.toml(example)) is not None


@pytest.mark.parametrize(
    ("place", "words"),
    [
        (
            "m.toml",
            "{path} was changed since it was opened here, in another tab or by another program, and is left as it "
            "is; save this text under another name, or open the file again and lose the changes made here",
        ),
        ("other.toml", "{path} exists and is left as it is; choose another name, or open that file instead"),
        (
            "no/m.toml",
            "{path} cannot be written: No such file or directory; check free space and permissions, or save "
            "under another name",
        ),
    ],
)
def test_a_text_that_cannot_be_saved_says_why_and_what_to_do(draft, tmp_path, place, words):
    (tmp_path / "m.toml").write_text("theirs", "utf-8")
    (tmp_path / "other.toml").write_text("theirs", "utf-8")
    path = tmp_path / place
    with pytest.raises(DraftError) as refusal:
        draft.set(APERTURE, "8 cm").save(path)
    assert str(refusal.value) == words.format(path=path)
    assert not path.exists() or path.read_text("utf-8") == "theirs"


@pytest.mark.parametrize(
    ("text", "mirror", "there"),
    [
        ("[mirror]\na=1\n[b]\n[mirror.x]\nc=[\n1,\n]\n# end\n", [1, 2, 4, 5, 6, 7], {"mirror", "mirror.x", "b"}),
        ("[mirrors]\na=1\n[mirror.x.y]\n# in\nb=1\n", [3, 4, 5], {"mirrors", "mirror", "mirror.x", "mirror.x.y"}),
        ("a = 1\n[[mirror]]\nb=1\n\n# between\n[[mirror]]\n", [2, 3, 4, 5, 6], {"mirror"}),
        ("mirror = 1\n[x]\nmirror.a = 2\n", [1], {"x"}),
    ],
)
def test_the_lines_of_a_mirror_are_those_of_its_tables(text, mirror, there):
    assert sorted(tables._lines_of_mirror(text)) == mirror
    assert tables._tables(text) == tables._tables(text.replace("\n", "\r\n")) == there


def test_a_key_has_each_of_its_faults(tmp_path):
    one, two, other = (Fault(key, "1", 2, reason, "") for key, reason in (("a.b", "x"), ("a.b", "y"), ("a.c", "z")))
    found = drafts._values("[a]\nb = 1\nc = 2\nd = 3\n", (one, other, two))
    assert {key: value.problems for key, value in found.items()} == {"a.b": (one, two), "a.c": (other,), "a.d": ()}


EXAMPLES = """
channel | zenith_transmission = 0.9; elevation = 30 deg
channel.turbulence | # Needs a station among the orbits, or channel.station and channel.height. Without it the air \
is still. | ground_strength = 1.7e-14; wind_rms = 21 m/s; fades = gamma-gamma; wander = dios-2004; tilt = zernike; \
corrected_modes = 0
jitter | # What fine pointing leaves, for a link that is budgeted without a simulated loop. | bias = 1 urad, 0 \
urad; rms = 2 urad, 2 urad; bandwidth = 50 Hz
communication.beam | # Needs conventions.pointing_loss = "pattern". Without this table the aperture is lit evenly. \
| profile = gaussian; radius = 2 cm; m_squared = 1.1
communication.receiver | # In place of communication.receiver_sensitivity, and of implementation_loss where that \
holds what is said here. | modulation = ook; detector = preamplified; bit_error_ratio = 1e-9; code_gain = 0 dB; \
code_rate = 1.0; bandwidth = 5 GHz; extinction_ratio = 20 dB; noise_figure = 4 dB; amplifier_gain = 35 dB; \
optical_bandwidth = 12.5 GHz
mirror.creep | # What the mirror goes on moving after a step, as parts with a time constant each. | time_constants \
= 5 s; weights = 1 urad/V
mirror.prandtl_ishlinskii | # In place of mirror.bouc_wen: hysteresis as a sum of play operators. | thresholds = 0 \
V, 1 V, 2 V, 4 V; weights = 60 urad/V, 10 urad/V, 8 urad/V, 6 urad/V
operations.optical | # An optical downlink to ground stations under clouds, beside the relay and the radio. | \
data_rate = 10 Gbit/s; setup = 60 s; delay = 1 s; weather = 6 h; correlation_length = 500 km
operations.optical.stations.tenerife | latitude = 28.30 deg; longitude = -16.51 deg; height = 2390 m; mask = 20 \
deg; availability = 0.7
operations.optical.stations.nemea | latitude = 37.85 deg; longitude = 22.62 deg; height = 300 m; mask = 20 deg; \
availability = 0.4, 0.4, 0.5, 0.5, 0.6, 0.8, 0.9, 0.9, 0.7, 0.6, 0.5, 0.4
constellation.stations.svalbard | # A ground station that the constellation shares beside its relays. | latitude = \
78.23 deg; longitude = 15.39 deg; height = 480 m; mask = 10 deg; data_rate = 1 Gbit/s; terminals = 2; availability \
= 0.6
"""


@pytest.mark.parametrize("example", EXAMPLES.strip().splitlines(), ids=lambda line: line.partition(" ")[0])
def test_an_optional_table_comes_with_its_values_and_says_that_they_are_examples(example):
    name, *remark, values = example.split(" | ")
    text = tables._examples()[name]
    text = text if "stations." in name else text.partition(f"\n\n[{name}.stations.")[0]
    found = [each for each in scan(text) if each.kind == "key"]
    assert "; ".join(f"{each.key[len(name) + 1 :]} = {typed_from(each.value)}" for each in found) == values
    assert text.splitlines()[: len(remark)] == remark
    assert all(each.comment.startswith("example: ") for each in found)


OUTERMOST = """pointing point_ahead terminals conventions beacon answer communication requirement acquisition orbit
operations constellation mirror amplifier control scenario fine_pointing channel jitter"""
INNER = """operations.downlink operations.contact mirror.linear mirror.bouc_wen channel.turbulence mirror.creep
mirror.prandtl_ishlinskii operations.optical mirror.comparison.bouc_wen operations.downlink.stations.kiruna
operations.optical.stations.tenerife operations.optical.stations.nemea"""


def test_examples_are_offered_in_the_order_of_the_shipped_mission_the_outermost_first():
    names = [*tables._examples()]
    assert [name for name in names if "." not in name] == OUTERMOST.split()
    assert [name for name in names if name.startswith(("channel.", "mirror.", "operations."))] == INNER.split()


def test_a_list_with_comments_between_its_items_is_named_by_its_first_line(tmp_path):
    draft = Draft("[a]\n\nx = [\n  1, # one\n  2,\n]\ny = 3\n", tmp_path / "m.toml", ())
    with pytest.raises(DraftError) as refusal:
        draft.set("a.x", "4")
    assert str(refusal.value) == "a.x holds comments between its items (line 3); change it in the text"
    assert draft.set("a.y", "4").text == draft.text.replace("y = 3", "y = 4")


def test_a_file_that_is_in_order_once_it_is_looked_at_again_is_to_be_opened_again(tmp_path, monkeypatch):
    monkeypatch.setattr(drafts, "load_link", lambda path: None)
    with pytest.raises(DraftError) as refusal:
        Draft.open(tmp_path / "m.toml")
    assert str(refusal.value) == f"{tmp_path / 'm.toml'} changed while it was read; open it again"


def test_a_number_is_kept_with_the_digits_that_were_typed(draft):
    key = "pointing.confidence"
    for typed in ("0.9970", "0.99700000000000000001"):
        assert draft.set(key, "0.997").set(key, typed).values[key].raw == typed
    assert draft.set(key, "0.997").set(key, " 0.997 ").values[key].raw == "0.997"


@pytest.mark.parametrize(("less", "opens"), [(0, True), (1, False)])
def test_a_file_of_just_the_most_bytes_is_opened_and_one_more_is_too_many(draft, monkeypatch, less, opens):
    monkeypatch.setattr(drafts, "MAX_BYTES", draft.path.stat().st_size - less)
    if opens:
        assert Draft.open(draft.path) == draft
        return
    with pytest.raises(DraftError, match=r"m\.toml changed while it was read; open it again"):
        Draft.open(draft.path)


@pytest.mark.parametrize("letters", [8, 119, 121, 300])
def test_a_key_of_any_length_has_its_fault_beside_it_and_is_named_in_few_letters(draft, letters):
    """Faults are of the key as it is shown: one of more than 120 letters by its first 60."""
    name = "k" * letters
    found = draft.with_text(draft.text.replace("[terminals]\n", f"[terminals]\n{name} = 1\n")).values[
        f"terminals.{name}"
    ]
    shown = f"terminals.{name}" if letters < 110 else f"terminals.{'k' * 50}…"
    assert [fault.key for fault in found.problems] == [shown]
    with pytest.raises(DraftError) as refusal:
        draft.set(f"terminals.{name}", "1")
    assert str(refusal.value).startswith(f"{shown} is no key of [terminals], which has leo_aperture, ")


@pytest.mark.parametrize("typed", ["a # b", "c", "'#'"])
def test_a_text_with_a_sign_of_comments_in_it_is_changed_like_any_other(tmp_path, typed):
    draft = Draft('name = "x # y" # why # not\n', tmp_path / "m.toml", ())
    written = typed if typed.startswith("'") else f'"{typed}"'
    assert draft.set("name", typed).text == f"name = {written} # why # not\n"


@pytest.mark.parametrize(
    "error", [FileNotFoundError(2, "No such file or directory"), PermissionError(13, "Permission denied")]
)
def test_a_file_that_is_there_again_once_it_is_looked_at_again_is_to_be_opened_again(draft, monkeypatch, error):
    def gone(path, most):
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(drafts, "read_bytes", gone)
        with pytest.raises(DraftError) as refusal:
            Draft.open(draft.path)
    assert str(refusal.value) == f"{draft.path} changed while it was read; open it again"
    assert Draft.open(draft.path) == draft
