"""The open-loop pointing budget: the paper's beacon covers the root sum square, and by how much."""

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from microrad import pointing
from microrad.budget import Line, root_sum_square, total_db
from microrad.missionfile import load_mission

FILE = load_mission(Path(__file__).parent.parent / "missions" / "leo-geo.toml")
MISSION, SOURCES = FILE.mission, FILE.sources
angles = st.floats(0.0, 1e-2)


def with_pointing(orbit, body, misalignment, divergence=780e-6, convention="full-1/e2"):
    tables = {
        "pointing": MISSION.pointing.model_copy(
            update={"orbit_knowledge_rad": orbit, "body_pointing_rad": body, "misalignment_rad": misalignment}
        ),
        "beacon": MISSION.beacon.model_copy(update={"divergence_rad": divergence}),
        "conventions": MISSION.conventions.model_copy(update={"divergence": convention}),
    }
    return MISSION.model_copy(update=tables)


def test_the_papers_beacon_just_covers_the_open_loop_errors():
    budget = pointing.open_loop_budget(MISSION, SOURCES)
    # paper, section 2.1: a 780 µrad beacon covers the root sum square of the three terms
    assert budget.required_divergence_rad == pytest.approx(780e-6, rel=1e-3)
    assert budget.rss_rad == pytest.approx(math.sqrt(300**2 + 24**2 + 248**2) * 1e-6, rel=1e-12)
    assert budget.beacon_half_angle_rad == pytest.approx(390e-6, rel=1e-12)
    assert budget.convention == "full-1/e2"
    assert budget.covers is True


def test_read_as_a_half_angle_the_same_beacon_has_twice_the_room():
    other = pointing.open_loop_budget(MISSION, SOURCES).other_reading
    assert other.convention == "half-1/e2"
    assert other.half_angle_rad == pytest.approx(780e-6, rel=1e-12)
    assert other.required_divergence_rad == pytest.approx(390e-6, rel=1e-3)
    assert other.covers is True


@pytest.mark.parametrize(
    ("body", "covers", "covers_as_half"), [(299e-6, True, True), (301e-6, False, True), (1e-3, False, False)]
)
def test_coverage_is_lost_at_the_half_angle(body, covers, covers_as_half):
    budget = pointing.open_loop_budget(with_pointing(24e-6, body, 248e-6), SOURCES)
    assert budget.covers is covers
    assert budget.other_reading.covers is covers_as_half


def test_each_line_says_where_it_comes_from():
    lines = {line.name: line for line in pointing.open_loop_budget(MISSION, SOURCES).lines}
    assert lines["Body pointing"].source.startswith("paper: section 2.1")
    assert lines["Orbit knowledge"].source.startswith("assumption:")
    assert lines["Misalignment"].source.startswith("assumption:")
    assert all(line.unit == "rad" and line.basis and line.regime for line in lines.values())
    assert pointing.open_loop_budget(MISSION, {}).lines[0].source == "not stated"


@settings(deadline=None)  # the machine may be busy
@given(angles, angles, angles, st.floats(1e-6, 1e-1), st.sampled_from(["full-1/e2", "half-1/e2"]))
def test_the_required_divergence_is_the_one_that_just_covers(orbit, body, misalignment, divergence, convention):
    budget = pointing.open_loop_budget(with_pointing(orbit, body, misalignment, divergence, convention), SOURCES)
    largest = max(orbit, body, misalignment)
    assert largest <= budget.rss_rad * (1 + 1e-12) <= math.sqrt(3) * largest * (1 + 1e-9)
    if budget.rss_rad > 1e-9:
        assert math.fsum(budget.variance_shares) == pytest.approx(1.0, rel=1e-9)
        required = budget.required_divergence_rad
        enough = with_pointing(orbit, body, misalignment, required * 1.001, convention)
        assert pointing.open_loop_budget(enough, SOURCES).covers
        short = with_pointing(orbit, body, misalignment, required * 0.999, convention)
        assert not pointing.open_loop_budget(short, SOURCES).covers


def test_shares_without_any_error_are_zero():
    assert pointing.open_loop_budget(with_pointing(0.0, 0.0, 0.0), SOURCES).variance_shares == (0.0, 0.0, 0.0)


def line(value, unit):
    return Line(f"{value} {unit}", value, unit, "", "", "")


def test_decibel_lines_add_up_and_others_are_refused():
    assert total_db([line(37.0, "dBm"), line(100.0, "dB"), line(-290.5, "dB")]) == pytest.approx(-153.5)
    assert total_db([]) == 0.0
    with pytest.raises(ValueError, match='"5 rad" is in rad'):
        total_db([line(1.0, "dB"), line(5, "rad")])
    with pytest.raises(ValueError, match="only one line of a sum in decibels may be a power level"):
        total_db([line(1.0, "dBm"), line(2.0, "dBW")])


def test_unlike_units_have_no_root_sum_square():
    assert root_sum_square([line(3.0, "rad"), line(-4.0, "rad")]) == 5.0
    with pytest.raises(ValueError, match="these are in m, rad"):
        root_sum_square([line(1.0, "rad"), line(1.0, "m")])
    with pytest.raises(ValueError, match="these are in dB"):
        root_sum_square([line(1.0, "dB")])
    with pytest.raises(ValueError, match="these are in none"):
        root_sum_square([])
