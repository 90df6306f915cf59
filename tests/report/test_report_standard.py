"""The links against a standard, as the command prints them: terminal, page, spreadsheet and JSON say the same."""

import csv
import io
import json
import re
from dataclasses import replace
from html import unescape

import pytest

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
