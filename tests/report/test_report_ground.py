"""What is said and drawn of links to a station."""

import json
import math

import pytest

from microrad.link.pointing.outage import margin_db
from microrad.link.study import run_link_study
from microrad.mission.file import load_link
from microrad.mission.presets import preset_text
from microrad.report import registry
from microrad.report.links.budgets import links_csv, links_text
from microrad.report.links.data import links_data
from microrad.report.links.ground import ground_view

STILL = ("[channel.turbulence]", "[communication]")


def file_of(folder, *changes, still=False):
    text = preset_text("ground-downlink")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    if still:
        first, last = (text.index(each) for each in STILL)
        text = text[:first] + text[last:]
    path = folder / "ground.toml"
    path.write_text(text, encoding="utf-8")
    return load_link(path)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return run_link_study(file_of(tmp_path_factory.mktemp("ground")))


@pytest.mark.promise("link-113")
def test_the_section_has_the_margin_over_elevation_the_air_and_the_conventions(study):
    text = links_text(study, 80, verbose=True)
    assert max(map(len, text.splitlines())) <= 80
    section = text[text.index("Down to the station") :]
    for line in (
        "Communication over elevation",
        "20 deg",
        "90 deg",
        "Angle of arrival",
        "Beam wander",
        "andrews-phillips-2005",
    ):
        assert line in section, line
    assert "Down to the station" not in links_text(study, 80)


@pytest.mark.promise("link-112")
def test_margin_verdict_and_tornado_are_the_same_with_fades(study):
    at_mask = study.ground.elevations[0]
    assert at_mask.margin_db == pytest.approx(study.communication.margin_db, abs=1e-9)
    assert study.tornados[0].margin_db == pytest.approx(margin_db(study.data), abs=1e-9)
    assert study.communication.loss_db("Turbulence fade") == pytest.approx(at_mask.fade_db, abs=1e-9)
    assert "channel.turbulence.wind_rms" in {s.key for s in study.tornados[0].swings}
    assert study.under_jitter.margin_db == pytest.approx(study.communication.margin_db, abs=1e-9)


def test_every_number_of_a_link_to_a_station_is_registered(study):
    data = json.loads(json.dumps(links_data(study)))
    assert registry.unregistered(["budget." + name for name, _ in registry.flattened(data)]) == []
    first = data["ground"]["elevations"][0]
    assert first["elevation_rad"] == pytest.approx(math.radians(20.0))
    assert first["range_m"] == pytest.approx(study.data.range_m)


def test_the_lines_of_the_air_are_in_the_csv(study):
    rows = [line.split(",")[:2] for line in links_csv(study).splitlines()]
    assert ["Communication", "Turbulence fade"] in rows
    assert ["Answer", "Turbulence spread loss"] in rows
    assert ["Communication", "Turbulence spread loss"] not in rows


@pytest.mark.promise("link-20")
def test_still_air_has_no_turbulence_to_show_and_says_so(tmp_path):
    study = run_link_study(file_of(tmp_path, still=True))
    assert study.ground.beams == study.ground.conventions == ()
    (table,) = (
        block for block in ground_view(study).blocks if getattr(block, "title", "") == "Communication over elevation"
    )
    assert len(table.columns((0,)).rows) == 5
    assert any("turbulence is not in this budget" in warning for warning in study.warnings)
    assert math.isnan(study.ground.elevations[0].index)
    assert links_data(study)["ground"]["elevations"][0]["index"] is None


@pytest.mark.promise("link-114")
@pytest.mark.parametrize(
    ("change", "line", "said"),
    [
        (('mask = "20 deg"', 'mask = "12 deg"'), "Turbulence fade", "below 20 deg the air is not flat"),
        (
            ("ground_strength = 1.7e-14", "ground_strength = 5e-13"),
            "Turbulence fade",
            "turbulence: the Rytov variance is",
        ),
        (("corrected_modes = 0", "corrected_modes = 21"), "Turbulence spread loss", "the point-ahead angle is"),
    ],
)
def test_a_line_says_beyond_what_the_closed_forms_are_used(tmp_path, change, line, said):
    found = run_link_study(file_of(tmp_path, change))
    lines = [each for b in found.budgets for each in b.lines if each.name == line]
    assert any(said in each.warning for each in lines), [each.warning for each in lines]
    assert any(said in warning for warning in found.warnings)


@pytest.mark.promise("link-114")
def test_within_the_closed_forms_nothing_is_flagged(study):
    data = next(each for each in study.communication.lines if each.name == "Turbulence fade")
    assert data.warning == ""
