"""What is shown of a link to a station: text, page, JSON, CSV and figure, against the records they are made from."""

import csv
import io
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from drawn import one_text, outline
from ground_files import STILL, TYPED, UP, ground_file
from microrad import link
from microrad.core.budget import Line
from microrad.link import study as link_study
from microrad.link.ground import AtElevation, GroundLink, OtherConvention, ground_link
from microrad.report.links import ground
from microrad.report.links.budgets import links_csv, links_text
from microrad.report.links.data import links_data
from microrad.report.links.figures import link_figures
from microrad.report.links.views import links_page
from microrad.report.quantities import quantity, signed
from microrad.report.view import views_text

deg = math.pi / 180.0
QUICK = {"channel.turbulence.fades": "log-normal"}
FLYING = {"orbit.geo": {"kind": "geostationary", "longitude": "0 deg"}, "operations": None}
BESIDE = {"channel.elevation": "20 deg", "channel.station": "geo", "channel.height": "0 m"}
FAR = {"communication.distance": "900 km", "answer.distance": "900 km"}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return link_study.run_link_study(ground_file(tmp_path_factory.mktemp("ground"), QUICK))


def of_file(folder, *changes):
    """What there is to say of a mission's links to a station, and its budget, without all else of a study."""
    file = ground_file(folder, QUICK, *changes)
    data = link.of(file.mission)
    return ground_link(file.mission, file.sources, data), link.communication_budget(data, file.sources)


def with_ground(study, g):
    """A study with another record of its links to a station."""
    return SimpleNamespace(file=study.file, ground=g)


def one_line(text):
    return " ".join(text.split())


# ---------------------------------------------------------------------------------------------------------- the text
def test_a_terminal_of_80_columns_has_the_section(study):
    text = links_text(study, 80, verbose=True)
    assert max(len(row) for row in text.split("\n")) <= 80
    section = text[text.index("Down to the station") : text.index("What pointing costs the link")]
    first, last = study.ground.elevations[0], study.ground.elevations[-1]
    said = one_line(section)
    assert "The links are budgeted at 20 deg of elevation, 1200 km from Tenerife." in said
    gained = quantity(last.margin_db - first.margin_db, "dB")
    assert f"The communication link has {gained} more at 90 deg." in said
    for each in study.ground.elevations:
        row = next(line for line in section.split("\n") if line.startswith(f" {each.elevation_rad / deg:.0f} deg"))
        shown = (quantity(each.air_db, "dB"), quantity(each.fade_db, "dB"), signed(each.margin_db, "dB"))
        assert all(value in row for value in shown)
    for title in ("Communication over elevation", "Turbulence on the path: Communication", "path: Answer"):
        assert title in section
    assert "What other conventions would change" in section
    assert "clouds are outside" in said
    brief = one_line(links_text(study, 80))
    assert "with the fades of the air" in brief and f"has {gained} more at 90 deg" in brief


def test_the_budgets_lines_stand_in_the_csv_in_full(study):
    rows = list(csv.DictReader(io.StringIO(links_csv(study))))
    values = {(row["budget"], row["line"]): row for row in rows}
    fade = values["Communication", "Turbulence fade"]
    assert float(fade["value"]) == -study.data.fade_db
    assert "exceeded for 1 % of the time" in fade["basis"]
    spread = values["Answer", "Turbulence spread loss"]
    assert -0.5 < float(spread["value"]) < 0.0 and "D0 = sqrt(8) W0" in spread["basis"]
    assert ("Communication", "Turbulence spread loss") not in values
    assert "1198 km at 20 deg of elevation" in values["Communication", "Free-space loss"]["basis"]
    assert "wander of" in values["Answer", "Turbulence fade"]["basis"]
    assert values["Answer", "Clear-sky loss"]["warning"] == ""


def test_the_json_has_the_records_values(study):
    found = links_data(study)["ground"]
    assert set(found) == {"end", "station", "elevations", "beams", "conventions"}
    assert (found["end"], found["station"]) == ("geo", "Tenerife")
    names = {"elevation_rad", "range_m", "air_db", "fade_db", "fried_m", "isoplanatic_rad", "rytov", "index"}
    for row, record in zip(found["elevations"], study.ground.elevations, strict=True):
        assert row == {name: getattr(record, name) for name in (*names, "margin_db")}
    lines = {each["name"]: {line["name"]: line["value"] for line in each["lines"]} for each in found["beams"]}
    assert list(lines) == ["Communication", "Answer"]
    assert lines["Communication"]["Fried's parameter"] == study.data.turbulent.path.fried_m
    assert "Angle of arrival" in lines["Communication"] and "Beam wander" in lines["Answer"]
    assert [each["key"] for each in found["conventions"]] == [
        f"channel.turbulence.{name}" for name in ("fades", "wander", "wander", "tilt")
    ]
    assert all(set(each["gained_db"]) == {"Communication", "Answer"} for each in found["conventions"])


def test_the_page_has_the_figure_and_its_columns_are_the_margins(study):
    figure = next(each for each in link_figures(study) if each.name == ground.OVER_ELEVATION)
    wanted = [each.margin_db for each in study.ground.elevations]
    assert figure.columns["margin (dB)"] == pytest.approx(wanted, abs=0.0)
    assert figure.columns["elevation (deg)"] == pytest.approx([20.0, 30.0, 45.0, 60.0, 90.0])
    assert figure.columns["lost to fades (dB)"] == pytest.approx([each.fade_db for each in study.ground.elevations])
    (panel,) = figure.sheet.panels
    assert panel.y.title == "margin (dB)", "a longer one is wrapped, and covers the ticks"
    margin, without = panel.marks[:2]
    assert np.asarray(without.y) - np.asarray(margin.y) == pytest.approx(figure.columns["lost to fades (dB)"])
    page = links_page(study)
    assert "Down to the station" in page and "Margin over elevation" in page


# ------------------------------------------------------------------------------------------------------- other missions
def test_a_station_that_sends_has_its_section_under_another_name(study, tmp_path):
    g, budget = of_file(tmp_path, UP)
    shown = views_text([ground.ground_view(with_ground(study, g))], 80)
    assert "Up from the station" in shown and "Down to the station" not in shown
    assert "Turbulence spread loss" in {line.name for line in budget.lines}


def test_still_air_shows_no_turbulence(study, tmp_path):
    g, budget = of_file(tmp_path, STILL)
    shown = views_text([ground.ground_view(with_ground(study, g))], 80)
    assert "Communication over elevation" in shown
    assert not any(word in shown for word in ("r0", "index", "Turbulence on the path", "convention", "fades  "))
    (sky,) = [line for line in budget.lines if line.name == "Clear-sky loss"]
    assert sky.warning == "turbulence is not in this budget: scintillation and beam wander come on top"
    assert "no turbulence" in sky.regime
    rows = ground.ground_data(g)["elevations"]
    assert all(row["index"] is None and row["fried_m"] is None and row["rytov"] is None for row in rows)
    assert all(row["fade_db"] == 0.0 and row["air_db"] > 0.0 for row in rows)


def test_a_link_that_closes_only_higher_up_says_from_where(study, tmp_path):
    g, _ = of_file(tmp_path, {"communication.transmit_power": "80 mW"})
    said = ground.sentences(with_ground(study, g), g)
    first = next(each for each in g.elevations if each.margin_db >= 3.0)
    assert first is not g.elevations[0]
    at = f"{first.elevation_rad / deg:.0f} deg"
    assert said[2] == f"Of the elevations below it has the required 3 dB from {at} on."
    weak, _ = of_file(tmp_path, {"communication.transmit_power": "1 mW"})
    assert ground.sentences(with_ground(study, weak), weak)[2] == "At no elevation has it the required 3 dB."


def at_elevations(*margins_db, fade_db=0.0, conventions=()):
    """Links to a station at 20, 30, 40 deg … with these margins; 900 km away."""
    steps = enumerate(margins_db)
    found = [AtElevation((20 + 10 * k) * deg, 900e3, 1.0, fade_db, *[math.nan] * 4, margin) for k, margin in steps]
    return GroundLink("geo", "Teide", tuple(found), (), conventions)


BUDGETED = "The links are budgeted at 20 deg of elevation, 900 km from Teide."


@pytest.mark.parametrize(
    ("margins_db", "said"),
    [
        ((1.0,), []),  # one elevation is known
        ((3.0, 4.0), ["The communication link has 1.00 dB more at 30 deg."]),  # the requirement itself
        (
            (2.0, 3.0, 5.0),
            [
                "The communication link has 3.00 dB more at 40 deg.",
                "Of the elevations below it has the required 3 dB from 30 deg on.",
            ],
        ),
        (
            (2.0, 2.9),
            ["The communication link has 0.90 dB more at 30 deg.", "At no elevation has it the required 3 dB."],
        ),
    ],
)
def test_the_required_margin_is_there_from_the_elevation_that_just_has_it(study, margins_db, said):
    g = at_elevations(*margins_db)
    assert ground.sentences(with_ground(study, g), g) == [BUDGETED, *said]


@pytest.mark.parametrize(
    ("gained", "said"),
    [
        (({"Communication": 0.0},), []),
        (({"Communication": 0.1, "Answer": -0.3}, {"Communication": 0.2}), ["answer by 0.30 dB."]),
        (({"Communication": 0.1}, {"Communication": -0.2}), ["communication by 0.20 dB."]),
    ],
)
def test_a_convention_is_named_by_the_size_of_what_it_moves_and_only_where_it_moves_any(study, gained, said):
    conventions = tuple(OtherConvention(f"k{n}", "a", "b", each) for n, each in enumerate(gained))
    g = at_elevations(1.0, conventions=conventions)
    first, *more = ground.sentences(with_ground(study, g), g)
    assert first == BUDGETED
    assert [each.partition(" moves the margin of ")[2] for each in more] == said
    assert all(f"k{len(gained) - 1 if 'communication' in said[0] else 0} matters most" in each for each in more)


@pytest.mark.parametrize(
    ("fade_db", "labels"), [(0.0, ["margin", "required"]), (0.5, ["margin", "without", "required"])]
)
def test_the_margin_without_fades_is_drawn_only_where_there_are_fades(study, fade_db, labels):
    g = at_elevations(1.0, 2.0, fade_db=fade_db)
    marks = ground.over_elevation(with_ground(study, g), g).sheet.panels[0].marks
    assert [mark.label.split()[0] for mark in marks] == labels


def test_the_convention_that_matters_most_is_named_with_what_it_moves(study, tmp_path):
    g, _ = of_file(tmp_path, UP, {"terminals.leo_aperture": "10 cm", "terminals.geo_obscuration": None})
    wander = next(each for each in g.conventions if each.other == "andrews-phillips-2005")
    cost = quantity(abs(wander.gained_db["Communication"]), "dB")
    assert ground.sentences(with_ground(study, g), g)[-1] == (
        "Of the conventions that the literature leaves open, channel.turbulence.wander matters most: "
        f'"andrews-phillips-2005" in place of "dios-2004" moves the margin of communication by {cost}.'
    )


def test_a_typed_elevation_has_its_range_and_says_the_keys_that_it_follows_from(tmp_path):
    g, budget = of_file(tmp_path, TYPED)
    (space,) = [line for line in budget.lines if line.name == "Free-space loss"]
    assert "R = 1188 km at 20 deg of elevation" in space.basis
    assert space.source.count("mission file") == 2 and space.warning == ""
    assert len(g.elevations) == 5
    given, budget = of_file(tmp_path, TYPED, {"channel.altitude": None, **FAR})
    (space,) = [line for line in budget.lines if line.name == "Free-space loss"]
    # 900 km at 20 deg are 363 km up, by the law of cosines
    own = 6378137.0 + 2393.0
    up = math.sqrt(own**2 + 900e3**2 + 2.0 * own * 900e3 * math.sin(20.0 * deg)) - 6378137.0
    assert f"R = 900 km: {up / 1e3:.1f} km up, at the elevation of the channel" in space.basis
    assert len(given.elevations) == 1


def test_an_elevation_typed_beside_flying_orbits_is_flagged_with_the_range(tmp_path):
    _, budget = of_file(tmp_path, FLYING, BESIDE, FAR)
    (space,) = [line for line in budget.lines if line.name == "Free-space loss"]
    assert "typed beside the table orbit" in space.warning
    assert "from 500 km up the range at 20 deg is 1193 km" in space.warning
    assert any("1193 km" in each for each in budget.warnings)


def test_links_to_a_station_through_turbulent_air_have_each_number_of_an_elevation():
    elevations = [
        AtElevation(
            (20 + 15 * k) * deg,
            9e5 - 1e5 * k,
            1.5 - k / 4,
            2.5 - k,
            0.05 + k / 100,
            1.2e-5 + k * 1e-6,
            0.375 - k / 8,
            0.25,
            2.0 + 2.5 * k,
        )
        for k in range(2)
    ]
    conventions = (
        OtherConvention("channel.conventions.wind", "one", "two", {"Communication": -0.5, "Beacon": 0.25}),
        OtherConvention("channel.conventions.scale", "in", "out", {"Communication": 0.125, "Beacon": -0.75}),
    )
    line = Line("Rytov variance", 0.25, "", "a basis", "a source", "a regime")
    g = GroundLink("geo", "Teide", tuple(elevations), (("Beacon", (line,)),), conventions)
    requirement = SimpleNamespace(margin_db=3.0)
    study = SimpleNamespace(ground=g, file=SimpleNamespace(mission=SimpleNamespace(requirement=requirement)))
    pictures = [SimpleNamespace(name=name) for name in ("other", ground.OVER_ELEVATION)]
    assert outline(ground.ground_view(study, pictures)) == one_text("""
# Down to the station
- The links are budgeted at 20 deg of elevation, 900 km from Teide.
- The communication link has 2.50 dB more at 35 deg.
- Of the elevations below it has the required 3 dB from 35 deg on.
- Of the conventions that the literature leaves open, channel.conventions.scale matters most: "out" in place of "in"
  moves the margin of beacon by 0.75 dB.
| Communication over elevation: elevation / range / air / fades / r0 / isoplanatic / index / margin [0] brief [0, 1,
  2, 3, 6, 7]
20 deg / 900 km / 1.50 dB / 2.50 dB / 50 mm / 12 µrad / 0.25 / +2.00 dB
35 deg / 800 km / 1.25 dB / 1.50 dB / 60 mm / 13 µrad / 0.25 / +4.50 dB
[margin-over-elevation]
| Turbulence on the path: Beacon: line / value / basis / source / holds for [0, 2, 3, 4]
Rytov variance / 0.25 / a basis / a source / a regime
| What other conventions would change: convention / as given / read as / communication / beacon [0, 1, 2]
wind / one / two / −0.50 dB / +0.25 dB
scale / in / out / +0.12 dB / −0.75 dB
Closed forms over flat air; a scintillation index is that of any strength, spread and wander those of weak
  turbulence; clouds are outside. Lost in the air is the mean power, by absorption, scattering, a wider beam and a
  wavefront that a fibre takes less of; to fades is lost what they add for the mission's outage.
""")
    assert [ground.ground_data(g)[key] for key in ("conventions", "beams")] == [
        [{"key": c.key, "given": c.given, "other": c.other, "gained_db": c.gained_db} for c in conventions],
        [
            {
                "name": "Beacon",
                "lines": [
                    {"name": "Rytov variance", "value": 0.25, "unit": "", "basis": "a basis", "source": "a source"}
                ],
            }
        ],
    ]
    up = replace(
        g, end="leo", elevations=tuple(replace(e, index=math.nan) for e in elevations), beams=(), conventions=()
    )
    assert outline(ground.ground_view(SimpleNamespace(ground=up, file=study.file))) == one_text("""
# Up from the station
- The links are budgeted at 20 deg of elevation, 900 km from Teide.
- The communication link has 2.50 dB more at 35 deg.
- Of the elevations below it has the required 3 dB from 35 deg on.
| Communication over elevation: elevation / range / air / margin [0]
20 deg / 900 km / 1.50 dB / +2.00 dB
35 deg / 800 km / 1.25 dB / +4.50 dB
Flat and still air without clouds. Lost in it is what absorption and scattering take.
""")


def test_a_margin_without_fades_is_drawn_where_they_cost_something_at_a_single_elevation(study):
    given = at_elevations(1.0, 2.0, 4.0)
    faded = tuple(replace(e, fade_db=db) for e, db in zip(given.elevations, (0.0, 0.75, 0.0), strict=True))
    figure = ground.over_elevation(with_ground(study, given), replace(given, elevations=faded))
    margin, without, required = figure.sheet.panels[0].marks
    assert (margin.label, without.label) == ("margin", "without fades of the air")
    np.testing.assert_allclose([margin.x, without.x], [[20.0, 30.0, 40.0]] * 2)
    np.testing.assert_allclose([margin.y, without.y], [[1.0, 2.0, 4.0], [1.0, 2.75, 4.0]])
    assert (required.at, required.upright) == (3.0, False)
    assert [[*np.round(of, 9)] for of in figure.columns.values()] == [
        [20.0, 30.0, 40.0],
        [1.0, 2.0, 4.0],
        [0.0, 0.75, 0.0],
    ]
