"""The links against a standard, as the command prints them: terminal, page, spreadsheet and JSON say the same."""

import csv
import io
import json
import re
from dataclasses import replace
from html import unescape
from types import SimpleNamespace

import pytest

from drawn import one_text, outline
from link_files import data_with, received_with, written
from microrad.link import compliance
from microrad.link import study as link_study
from microrad.mission.file import load_link
from microrad.report import registry
from microrad.report.data import finite
from microrad.report.links import standard as shown
from microrad.report.links.budgets import COLUMNS, links_text
from microrad.report.links.data import links_data
from microrad.report.view import View
from microrad.studio.views import link as link_page
from report_pages import assert_sound

BARE = dict.fromkeys(("beacon", "answer", "acquisition", "point_ahead"))
COUNTED = {
    **received_with("apd ook", bandwidth="2 GHz"),
    "communication.distance": "600 km",
    "communication.wavelength": "1552.54 nm",
}
SDA = compliance.standard("sda")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A mission without a beacon: rows of each judgement."""
    return written(tmp_path_factory.mktemp("standard"), data_with({**BARE, **COUNTED}))


@pytest.fixture(scope="module")
def study(path):
    return link_study.run_link_study(load_link(path))


@pytest.fixture(scope="module")
def found(study):
    return compliance.compliance(study, SDA)


def cells(found, key):
    """The cells of one row of the view."""
    (table,) = (block for block in shown.standard_view(found).blocks if hasattr(block, "rows"))
    place = [each.asked.key for each in found.held].index(key)
    return [*map(str, table.rows[place])]


# --------------------------------------------------------------------------------------------------------- the command
@pytest.mark.promise("readme-7", "link-80")
def test_the_command_holds_the_links_against_a_standard(call, path, found):
    result = call("budget", path, "--standard", "sda")
    assert result.err == ""
    text = " ".join(result.out.split())
    assert "SDA Optical Communications Terminal (OCT) Standard Of 17 requirements that public" in text
    assert [found.count(word) for word in ("meets", "does not meet", "not said", "outside microrad")] == [6, 6, 2, 3]
    assert "6 are met and 6 are not; the mission does not say 2, and 3 are outside microrad." in text
    whole = " ".join(call("budget", path, "--standard", "sda", "--verbose").out.split())
    assert SDA.note in whole and "Creonic" in whole and "Creonic" not in text
    assert "Optical Communications Terminal" not in call("budget", path).out


@pytest.mark.promise("link-82")
@pytest.mark.parametrize("flags", [(), ("--json",), ("--csv",), ("--html",), ("--exit-on", "closes")])
def test_a_standard_does_not_change_the_exit_code(call, path, flags):
    plain = call("budget", path, *flags)
    assert call("budget", path, "--standard", "sda", *flags).code == plain.code == 0
    missed = call("budget", path, "--standard", "sda", "--data-rate", "1.6 Gbit/s", *flags)
    assert missed.code == call("budget", path, "--data-rate", "1.6 Gbit/s", *flags).code


@pytest.mark.promise("link-82")
def test_an_unknown_standard_is_refused_with_the_nearest_before_anything_is_read(call, tmp_path):
    result = call("budget", tmp_path / "none.toml", "--standard", "sdaa")
    assert (result.code, result.out) == (2, "")
    assert result.err == 'microrad: --standard: there is no standard "sdaa"; did you mean sda?\n'


@pytest.mark.promise("link-82")
def test_json_has_every_row_in_si_units(call, path, found):
    data = json.loads(call("budget", path, "--standard", "sda", "--json").out)["standard"]
    assert (data["name"], data["version"]) == ("sda", "4.0.0 (July 2024)")
    assert data["counts"] == {"meets": 6, "does_not_meet": 6, "not_said": 2, "outside_microrad": 3}
    by_name = {each["name"]: each for each in data["clauses"]}
    assert [*by_name] == [each.key for each in SDA.requirements]
    for held in found.held:
        row = by_name[held.asked.key]
        assert (row["value"], row["judgement"], row["why"]) == (held.value, held.judgement, held.why)
        assert row["limits"] == [*held.asked.values] and row["number"] == held.asked.number
    names = [name for name, _ in registry.flattened({"standard": data})]
    assert names and registry.unregistered(names) == []
    assert "standard" not in json.loads(call("budget", path, "--json").out)


@pytest.mark.promise("link-82")
def test_a_spreadsheet_has_every_row_behind_the_budgets(call, path, found):
    rows = [*csv.reader(io.StringIO(call("budget", path, "--standard", "sda", "--csv").out))]
    assert tuple(rows[0]) == COLUMNS and len({len(row) for row in rows}) == 1
    own = [row for row in rows if row[0] == SDA.title]
    assert rows[-len(own) :] == own and len(own) == len(SDA.requirements)
    for row, held in zip(own, found.held, strict=True):
        assert row[1] == held.asked.subject and row[6] == held.judgement and row[7] == held.why
        assert row[2] == (held.text if held.value is None else repr(held.value))
        assert row[4].endswith(held.asked.asks) and not row[4].startswith("\u2013")


@pytest.mark.promise("link-82")
def test_the_page_has_the_standard_behind_the_budgets(call, path):
    page = call("budget", path, "--standard", "sda", "--html").out
    assert_sound(page)
    text = unescape(re.sub(r"<[^>]+>", " ", page))
    assert text.index("Link budgets") < text.rindex(SDA.title) < text.rindex("sweetspotgov.com")
    assert SDA.title not in call("budget", path, "--html").out


@pytest.mark.promise("studio-12")
def test_the_studio_shows_it_folded_behind_the_links(study, found):
    *_, last = [block for block in link_page.blocks(study) if isinstance(block, View) and block.title == SDA.title]
    assert last.folded and last.blocks[0] == shown.summary(found)
    rows = [[*map(str, row)] for row in last.blocks[1].rows]
    assert [row[0] for row in rows] == [each.subject for each in SDA.requirements]


# ------------------------------------------------------------------------------------------------------------ its cells
@pytest.mark.promise("link-80")
def test_a_row_says_number_what_is_asked_what_the_mission_has_and_why(found):
    assert cells(found, "transmit_power")[:5] == ["Transmit power", "OCT-035 (3.2.0)", "at least 2.5 W", "5 W", "PASS"]
    assert cells(found, "largest_irradiance")[2:5] == ["at most 10 mW/m^2", "10.3 mW/m^2", "FAIL"]
    assert cells(found, "acquisition_irradiance")[1:5] == [
        *("unknown here", "at least 25 \u00b5W/m^2 at 5500 km", "\u2013", "not said")
    ]
    assert cells(found, "wavelength_band")[2] == "1.53 \u00b5m to 1.565 \u00b5m"
    assert cells(found, "wavelength_grid")[2:5] == ["193.1 THz + n \u00d7 100 GHz", "\u22121.94 GHz", "FAIL"]
    assert cells(found, "code_rate")[2:5] == ["11/13, 22/29, 2/3, 1/2, 1", "0.8", "FAIL"]
    assert cells(found, "modulation")[2:5] == ["ook", "ook", "PASS"]
    assert cells(found, "required_irradiance")[2].endswith(" at a bit error ratio of 1e-06")
    assert cells(found, "frame")[2:5] == ["\u2013", "\u2013", "outside microrad"]
    for each in found.held:
        assert cells(found, each.asked.key)[5:] == [each.asked.asks, each.why, each.asked.source]


def test_a_bound_and_what_misses_it_by_little_are_told_apart(path, tmp_path):
    near = written(tmp_path, data_with({**BARE, "communication.transmit_power": "2.49999 W"}))
    close = compliance.compliance(link_study.run_link_study(load_link(near)), SDA)
    assert cells(close, "transmit_power")[2:5] == ["at least 2.5 W", "2.49999 W", "FAIL"]


@pytest.mark.parametrize("width", [80, 120, 160])
def test_the_table_keeps_to_its_width(study, found, width):
    for verbose in (False, True):
        text = links_text(study, width, verbose=verbose, against=found)
        assert max(map(len, text.splitlines())) <= width and "\u2026" not in text


def test_what_never_ends_is_none_in_json(study, found):
    never = replace(found, held=(replace(found.held[0], value=float("inf")), *found.held[1:]))
    assert finite(links_data(study, against=never))["standard"]["clauses"][0]["value"] is None


# ------------------------------------------------------------------------------------- requirements unlike each other
def asked(comparison, values=(), texts=(), unit="", distance_m=None, ratio=None, outside="", number="7.1"):
    return compliance.Asked(
        *("a_key", number, "3.1" if number else "", "a subject", "what it is", comparison, values, texts, unit),
        *(distance_m, ratio, "a source", outside),
    )


ODD = [
    compliance.Held(asked("at least", (2.5e-6,), ("2.5",), "W/m^2", 5.5e6), "meets", 3.1e-6, "", "by the budget"),
    compliance.Held(asked("at most", (622.08e6,), ("622",), "bit/s", None, 1e-9), "does not meet", 622.09e6),
    compliance.Held(asked("at least", (0.25,), (), "W", 1.2345e6, 2e-5), "not said", None, "", "say it"),
    compliance.Held(asked("between", (1.53e-6, 1.565e-6), (), "m"), "meets", 1.5525e-6),
    compliance.Held(asked("on the grid", (193.1e12, 1e11), (), "Hz"), "not said", 193.12e12),
    compliance.Held(asked("one of", (), ("OOK", "DPSK"), number=""), "meets", None, "OOK"),
    compliance.Held(asked(None, outside="no model of it"), "outside microrad", None, "", "no model of it"),
    compliance.Held(asked("one of", (4.0, 8.0), ("4", "8")), "does not meet", 16.0),
]
TOLD = """
at least 2.5 µW/m^2 at 5500 km | 3.1 µW/m^2
at most 622.08 Mbit/s at a bit error ratio of 1e-09 | 622.09 Mbit/s
at least 250 mW at 1234 km at a bit error ratio of 2e-05 | –
1.53 µm to 1.565 µm | 1.55 µm
193.1 THz + n × 100 GHz | 193 THz
OOK, DPSK | OOK
– | –
4, 8 | 16
"""


def test_each_kind_of_requirement_is_told_with_where_it_is_asked():
    assert [" | ".join(shown._texts(each)) for each in ODD] == TOLD.strip().splitlines()
    odd = compliance.Compliance(replace(SDA, name="s", title="S", version="4.0", note="a note"), tuple(ODD))
    said, table, _ = shown.standard_view(odd).blocks
    assert said.startswith(
        "Of 8 requirements that public sources print of it, up to version 4.0, 3 are met and 2 are not; the mission "
        "does not say 2, and 1 is outside microrad."
    )
    assert [[str(cell) for cell in row] for row in table.rows[1:3]] == [
        [
            *("a subject", "7.1 (3.1)", "at most 622.08 Mbit/s at a bit error ratio of 1e-09", "622.09 Mbit/s", "FAIL"),
            *("what it is", "", "a source"),
        ],
        [
            *("a subject", "7.1 (3.1)", "at least 250 mW at 1234 km at a bit error ratio of 2e-05", "–", "not said"),
            *("what it is", "say it", "a source"),
        ],
    ]
    assert [str(row[1]) for row in table.rows[5:7]] == ["unknown here", "7.1 (3.1)"]
    assert [len(row) for row in shown.short_view(odd).blocks[1].rows] == [5] * 8
    rows = list(shown.standard_rows(odd))
    begins = "at least 2.5 µW/m^2 at 5500 km: what it is"
    assert rows[0] == ("S", "a subject", "3.1e-06", "W/m^2", begins, "7.1 (3.1); a source", "meets", "by the budget")
    assert rows[5][2:6] == ("OOK", "", "OOK, DPSK: what it is", "unknown here; a source")
    assert rows[6][2:] == ("", "", "what it is", "7.1 (3.1); a source", "outside microrad", "no model of it")
    data = shown.standard_data(odd)
    assert data["counts"] == {"meets": 3, "does_not_meet": 2, "not_said": 2, "outside_microrad": 1}
    assert [data[key] for key in ("name", "title", "version", "note")] == ["s", "S", "4.0", "a note"]
    assert data["clauses"][1] == {
        **{"name": "a_key", "limits": [622.08e6], "texts": ["622"], "number": "7.1", "numbered_in": "3.1"},
        **{"subject": "a subject", "asks": "what it is", "comparison": "at most", "unit": "bit/s", "distance_m": None},
        **{"bit_error_ratio": 1e-9, "source": "a source", "value": 622.09e6, "text": ""},
        **{"judgement": "does not meet", "why": ""},
    }


def test_a_standard_has_each_requirement_with_its_judgement_and_where_it_comes_from():
    standard = SimpleNamespace(title="A standard", version="3.1", note="a note", name="s")
    counts = {"meets": 2, "does not meet": 1, "not said": 3, "outside microrad": 1}
    of = SimpleNamespace(standard=standard, held=ODD[:3] + ODD[6:7], count=counts.__getitem__)
    assert outline(shown.standard_view(of)) == one_text("""
# A standard
Of 4 requirements that public sources print of it, up to version 3.1, 2 are met and 1 is not; the mission does not
  say 3, and 1 is outside microrad.
| -: requirement / number / asked / mission has /  / what it is / why / source [0, 1, 2, 4, 5, 6, 7] cards
a subject / 7.1 (3.1) / at least 2.5 µW/m^2 at 5500 km / 3.1 µW/m^2 / PASS / what it is / by the budget / a source
a subject / 7.1 (3.1) / at most 622.08 Mbit/s at a bit error ratio of 1e-09 / 622.09 Mbit/s / FAIL / what it is /  /
  a source
a subject / 7.1 (3.1) / at least 250 mW at 1234 km at a bit error ratio of 2e-05 / – / not said / what it is / say
  it / a source
a subject / 7.1 (3.1) / – / – / outside microrad / what it is / no model of it / a source
a note
""")
    short = shown.short_view(of)
    assert [type(block).__name__ for block in short.blocks] == ["str", "Table"]
    assert list(short.blocks[1].headings) == ["requirement", "number", "asked", "mission has", ""]
    assert list(short.blocks[1].words) == [0, 1, 2, 4]


@pytest.mark.parametrize(
    ("value", "said"), [(1.5296e-6, "1.5296 µm"), (1.5651e-6, "1.5651 µm"), (1.53e-6, "1.53 µm"), (1.5e-6, "1.5 µm")]
)
def test_what_misses_a_band_has_the_digits_that_tell_it_from_its_end(value, said):
    band = compliance.Held(asked("between", (1.53e-6, 1.565e-6), (), "m"), "does not meet", value)
    assert shown._texts(band) == ("1.53 µm to 1.565 µm", said)
