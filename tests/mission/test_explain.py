"""What `microrad explain` says of each key: from the tables, the shipped mission, and the modules that read it."""

import re
import tomllib
from importlib.util import find_spec

import pytest

from microrad.mission import explain
from microrad.mission.explain import FILES, explained
from places import ROOT

SHIPPED = ROOT / "src" / "microrad" / "mission" / "missions" / "leo-geo.toml"


def leaves(data, prefix=""):
    for key, value in data.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict):
            yield name, None
            yield from leaves(value, f"{name}.")
        else:
            yield name, value


@pytest.mark.promise("readme-5")
def test_every_key_says_what_it_means_and_holds_and_who_reads_it():
    keys = explain._keys()
    assert len(keys) > 400
    assert {key.file for key in keys} == set(FILES)
    for key in keys:
        assert len(key.meaning) > 5 or key.meaning == "0 is a circle", key.name
        assert key.holds, key.name
        assert key.read_by or key.name.endswith(".NAME"), key.name
        assert all(find_spec(module) for module in key.read_by), key.name


def test_every_key_of_the_shipped_mission_is_found_with_its_value_and_source():
    text = SHIPPED.read_text("utf-8")
    for name, value in leaves(tomllib.loads(text)):
        (key,) = [each for each in explained(name) if each.file == "mission file"]
        if value is None or key.name.endswith(".NAME") or ".NAME." in key.name:
            continue
        shown, sign, comment = key.shipped.partition(" # ")
        assert tomllib.loads(f"x = {shown}") == {"x": value}
        assert f"{sign.strip()} {comment}".strip() in text


@pytest.mark.parametrize(
    ("asked", "found"),
    [
        ("modulus_margin", ["fine_pointing.modulus_margin"]),
        ("fine_pointing.modulus_margin", ["fine_pointing.modulus_margin"]),
        ("fine_pointing", ["fine_pointing"]),
        ("pointing", ["pointing"]),
        ("terminals.leo_aperture", ["terminals.leo_aperture"]),
        ("pointing.lines.body_pointing.error", ["pointing.lines.NAME.error"]),
        ("pointing.lines.body_pointing", ["pointing.lines.NAME"]),
        ("bouc_wen.d1", ["bouc_wen.d1"]),
        ("mirror.bouc_wen.d1", ["mirror.bouc_wen.d1"]),
        ("actuators.tip.bias", ["actuators.NAME.bias"]),
        ("bias", ["mirror.bias", "bias", "actuators.NAME.bias"]),
    ],
)
def test_a_key_is_found_by_its_name_or_its_end(asked, found):
    names = [key.name for key in explained(asked)]
    assert names == found if asked != "bias" else set(names) <= set(found)


def test_units_bounds_and_defaults_are_those_of_the_table():
    (margin,) = explained("fine_pointing.modulus_margin")
    assert (margin.holds, margin.default) == ("a number without quotes, above 0 and below 1; as 0.5", "")
    (power,) = explained("beacon.transmit_power")
    assert power.holds.startswith("a power with its unit, above 0 W")
    (mask,) = explained("fine_pointing.mirror_file")
    assert mask.default == "nothing"
    (layout,) = explained("fine_pointing.geometry.layout")
    assert layout.holds == '"two-axis" or "tripod"'
    (table,) = explained("fine_pointing.geometry")
    assert "magnification" in table.inside


def test_who_reads_a_key_is_who_uses_it_beside_its_table():
    (margin,) = explained("fine_pointing.modulus_margin")
    assert "microrad.loop.coupled_study.designs" in margin.read_by
    assert not any(module.startswith(("microrad.orbit", "microrad.lab")) for module in margin.read_by)


def test_the_text_fits_its_columns():
    text = explain.text(explained("actuators.1.bias") + explained("fine_pointing"), 80)
    assert max(map(len, text.splitlines())) <= 80
    assert text.startswith("actuators.NAME.bias (mirror file of several axes)\n  means     drive about which")
    assert "\n\nfine_pointing (mission file)\n" in text


@pytest.mark.parametrize(
    ("asked", "hint"),
    [
        ("modulus_margn", "near it are modulus_margin"),
        ("", "microrad schema prints all keys"),
        ("x" * 1000, "microrad schema prints all keys"),
        ("fine_pointing.", "near it are fine_pointing"),
    ],
)
def test_a_name_that_no_key_has_is_refused_with_what_is_near(asked, hint):
    with pytest.raises(ValueError, match=re.escape(hint)) as told:
        explained(asked)
    assert str(told.value).startswith("no key of a mission or mirror file is called")
    assert len(str(told.value)) < 250


@pytest.mark.parametrize(
    ("asked", "name", "meaning", "holds", "default", "shipped"),
    [
        (
            "operations.rates",
            *("operations.rates", "stepped with range; absent: communication.data_rate alone"),
            *('a list, rising, each item a data rate with its unit, above 0 bit/s; as ["5 Mbit/s"]', "nothing", ""),
        ),
        (
            "constellation.relays",
            *("constellation.relays", "one table for each, [constellation.relays.NAME]"),
            *("a table for each, under a name of your own", "", ""),
        ),
        (
            "hysteresis.1.weights",
            *("hysteresis.NAME.weights", "of the plays, of either sign"),
            *("a list, each item a number without quotes; as [5.0]", "nothing", ""),
        ),
        (
            "bouc_wen.exponent",
            *("bouc_wen.exponent", "of h in the decay; left out, 1 as in Eq. 3"),
            *("a number without quotes, at least 1, at most 100; as 5.0", "1.0", ""),
        ),
        (
            "point_ahead.corrected",
            *("point_ahead.corrected", "false: both beams leave along the line of sight"),
            *("true or false, without quotes; as true", ""),
            "true # assumption: by the fine steering mirror; false leaves 71 urad in the pointing error",
        ),
        (
            "terminals.leo_name",
            *("terminals.leo_name", 'what budgets call it in place of "LEO"', "a text", "nothing", ""),
        ),
        (
            "operations.optical.stations.a.availability",
            "operations.optical.stations.NAME.availability",
            "share of the time without clouds, one number or twelve by month",
            "a number without quotes, at least 0, at most 1, or a list of 12 such, January to December; as 1.0",
            *("", ""),
        ),
        (
            "conventions.strehl",
            *("conventions.strehl", "decibel: a loss in dB; ratio: a number up to 1; unused: no beam states one"),
            *('"decibel" or "ratio" or "unused"', "unused"),
            next(k.shipped for k in explained("conventions.strehl")),
        ),
    ],
)
def test_a_key_is_explained_with_all_that_its_table_says(asked, name, meaning, holds, default, shipped):
    (found,) = explained(asked)
    assert (found.name, found.meaning, found.holds, found.default, found.shipped) == (
        name,
        meaning,
        holds,
        default,
        shipped,
    )


def test_a_key_for_a_terminal_has_a_line_for_each_fact():
    key = explain.Key("mission file", "a.b", "what it is", "a text", "", "", ("m.one", "m.two"), ("c", "d"))
    assert explain.text([key, key], 24) == "\n\n".join(
        [
            "a.b (mission file)\n  means     what it is\n  holds     a text\n  left out  it must be\n "
            "           there\n  keys      c, d\n  read by   m.one, m.two"
        ]
        * 2
    )


@pytest.mark.parametrize(
    ("value", "words"),
    [(None, "nothing"), ((), "nothing"), ({}, "nothing"), (0.0, "0.0"), (False, "false"), (True, "true"), ("a", "a")],
)
def test_what_counts_where_a_key_is_left_out_is_told_as_a_file_has_it(value, words):
    assert explain._default(value) == words


def test_blanks_about_the_parts_of_a_key_are_nothing():
    (found,) = explained(" requirement .\tmargin ")
    assert found == explained("requirement.margin")[0] and found.name == "requirement.margin"


def test_of_a_long_name_its_begin_is_held_against_the_keys():
    name = "fine_pointing.reference.line_of_sight_ra"
    assert len(name) == 40
    with pytest.raises(
        ValueError, match=rf"is called '{re.escape(name)}'; near it are fine_pointing\.reference\.line"
    ) as told:
        explained(f"{name}{'x' * 60}")
    assert "xx" not in str(told.value)


def test_of_modules_that_use_a_key_those_that_speak_of_its_table_read_it(monkeypatch):
    used = {
        "microrad.mission.tables.laser": {"gain_db", "Laser"}, "microrad.link.a": {"gain_db", "Laser"},
        "microrad.link.b": {"gain_db", "laser", "loss_db"}, "microrad.link.c": {"gain_db"},
        "microrad.link.d": {"Laser", "laser"}, "microrad.loop": {"loss_db", "Other"},
    }  # fmt: skip
    monkeypatch.setattr(explain, "_used", lambda: used)
    assert explain._readers("Laser", "laser", "gain_db") == ("microrad.link.a", "microrad.link.b")
    assert explain._readers("Laser", "", "loss_db") == ("microrad.link.b", "microrad.loop")
    assert explain._readers("Other", "laser", "loss_db") == ("microrad.link.b", "microrad.loop")
    del used["microrad.link.a"], used["microrad.link.b"]
    assert explain._readers("Laser", "laser", "gain_db") == ("microrad.link.c",)
    del used["microrad.link.c"]
    assert explain._readers("Laser", "laser", "gain_db") == ("microrad.mission.tables.laser",)
    assert explain._readers("Laser", "laser", "width_m") == ()


def test_a_module_uses_its_attributes_and_but_for_tables_its_names(tmp_path, monkeypatch):
    texts = {
        "link/__init__.py": "made(Laser)",
        "link/beam.py": "µ = source.gain_db + self.of.loss_db",
        "mission/tables/laser.py": "Laser(table.gain_db)",
        "mission/file.py": "def read(path):\n    return Laser",
        "top.py": "",
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.setattr(explain.resources, "files", lambda package: tmp_path)
    assert explain._used.__wrapped__() == {
        "microrad.link": {"made", "Laser"},
        "microrad.link.beam": {"μ", "source", "self", "of", "gain_db", "loss_db"},
        "microrad.mission.tables.laser": {"gain_db"},
        "microrad.mission.file": {"Laser"},
        "microrad.top": set(),
    }


def test_a_key_of_several_files_is_shipped_with_the_mission_alone_and_keys_of_a_name_are_inside_it():
    found = {(key.file, key.name): key for key in explained("name")}
    assert list(found) == [(file, "name") for file in FILES]
    assert [bool(key.shipped) for key in found.values()] == [True, False, False]
    (relays,), (relay,) = explained("constellation.relays"), explained("constellation.relays.east")
    assert (relays.inside, relay.inside) == ((), ("longitude",))
    assert (relay.name, relay.holds, relay.default, relay.shipped) == (
        *("constellation.relays.NAME", "a table", "nothing", ""),
    )
    assert [key.name for key in explained("bias")] == ["bias"]
    assert {key.name for key in explained("rate_limit")} == {"rate_limit"}
    errors = [key.name for key in explained("standard_errors")]
    assert errors == ["mirror.uncertainty.standard_errors", *["uncertainty.standard_errors"] * 2]


def test_a_table_within_another_is_told_by_its_own_first_line():
    (inner,) = explained("fine_pointing.geometry")
    (outer,) = (key for key in explained("fine_pointing") if key.name == "fine_pointing")
    assert inner.meaning == "From the mirror's outputs to the line of sight."
    assert outer.meaning.startswith("The fine-pointing loop and how it is judged")
