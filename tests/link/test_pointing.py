"""The open-loop pointing budget of a mission: what the beacon covers, point-ahead, and missions without a beacon."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import budgets
from microrad.core.budget import Line, root_sum_square, total_db
from microrad.link.pointing.error_classes import error_term
from microrad.link.pointing.summation import radial_total_rad
from microrad.mission.file import load_mission
from microrad.mission.model import LinkMission
from microrad.mission.tables.pointing import PointAhead, PointingLine
from places import ROOT

FILE = load_mission(ROOT / "missions" / "paper.toml")
MISSION, SOURCES = FILE.mission, FILE.sources
URAD = 1e-6
angles = st.floats(0.0, 1e-2)


def with_pointing(orbit, body, misalignment, divergence=780e-6, convention="full-1/e2"):
    errors = {"orbit_knowledge": orbit, "body_pointing": body, "misalignment": misalignment}
    lines = {key: MISSION.pointing.lines[key].model_copy(update={"error_rad": value}) for key, value in errors.items()}
    tables = {
        "pointing": MISSION.pointing.model_copy(update={"lines": lines}),
        "beacon": MISSION.beacon.model_copy(update={"divergence_rad": divergence}),
        "conventions": MISSION.conventions.model_copy(update={"divergence": convention}),
        "point_ahead": None,
    }
    return MISSION.model_copy(update=tables)


def with_lines(confidence=0.997, **lines):
    made = {
        key: PointingLine.model_validate({"error": error, "class": kind, "statistic": statistic, "axes": axes})
        for key, (error, kind, statistic, axes) in lines.items()
    }
    table = MISSION.pointing.model_copy(update={"lines": made, "confidence": confidence})
    return MISSION.model_copy(update={"pointing": table, "point_ahead": None})


def with_point_ahead(velocity, corrected, error="1 urad"):
    table = PointAhead.model_validate({"transverse_velocity": velocity, "corrected": corrected, "error": error})
    return MISSION.model_copy(update={"point_ahead": table})


def without_beacon():
    tables = {name: getattr(MISSION, name) for name in LinkMission.model_fields}
    return LinkMission.model_construct(**{**tables, "beacon": None})


# ---- the paper's reading
def test_the_papers_beacon_just_covers_the_root_sum_square():
    budget = budgets.open_loop(MISSION, SOURCES)
    # paper, section 2.1: a 780 µrad beacon covers the root sum square of the three terms
    assert budget.required_divergence_rad == pytest.approx(780e-6, rel=1e-3)
    assert budget.rss_rad == pytest.approx(math.sqrt(300**2 + 24**2 + 248**2 + 1**2) * URAD, rel=1e-12)
    assert budget.beacon_half_angle_rad == pytest.approx(390e-6, rel=1e-12)
    assert budget.convention == budget.reading.convention == "full-1/e2"
    assert budget.covers is True
    assert budget.total_rad("rss") == budget.rss_rad


def test_read_as_a_half_angle_the_same_beacon_has_twice_the_room():
    other = budgets.open_loop(MISSION, SOURCES).other_reading
    assert other.convention == "half-1/e2"
    assert other.half_angle_rad == pytest.approx(780e-6, rel=1e-12)
    assert other.required_divergence_rad == pytest.approx(390e-6, rel=1e-3)
    assert other.covers is True


@pytest.mark.parametrize(
    ("body", "covers", "covers_as_half"), [(299e-6, True, True), (301e-6, False, True), (1e-3, False, False)]
)
def test_the_root_sum_square_is_no_longer_covered_beyond_the_half_angle(body, covers, covers_as_half):
    budget = budgets.open_loop(with_pointing(24e-6, body, 248e-6), SOURCES)
    assert budget.covers is covers
    assert budget.other_reading.covers is covers_as_half


@settings(deadline=None)  # the machine may be busy
@given(angles, angles, angles, st.floats(1e-6, 1e-1), st.sampled_from(["full-1/e2", "half-1/e2"]))
def test_the_required_divergence_is_the_one_that_just_covers(orbit, body, misalignment, divergence, convention):
    budget = budgets.open_loop(with_pointing(orbit, body, misalignment, divergence, convention), SOURCES)
    largest = max(orbit, body, misalignment)
    assert largest <= budget.rss_rad * (1 + 1e-12) <= math.sqrt(3) * largest * (1 + 1e-9)
    if budget.rss_rad > 1e-9:
        assert math.fsum(budget.variance_shares) == pytest.approx(1.0, rel=1e-9)
        required = budget.required_divergence_rad
        enough = with_pointing(orbit, body, misalignment, required * 1.001, convention)
        assert budgets.open_loop(enough, SOURCES).covers
        short = with_pointing(orbit, body, misalignment, required * 0.999, convention)
        assert not budgets.open_loop(short, SOURCES).covers


@settings(deadline=None, max_examples=30)
@given(angles, st.floats(1e-6, 1e-2), angles, st.sampled_from(["full-1/e2", "half-1/e2"]))
def test_the_confident_divergence_is_covered_with_just_the_confidence(orbit, body, misalignment, convention):
    needed = budgets.open_loop(with_pointing(orbit, body, misalignment, 1e-3, convention), SOURCES)
    mission = with_pointing(orbit, body, misalignment, needed.confident_divergence_rad, convention)
    budget = budgets.open_loop(mission, SOURCES)
    assert budget.reading.coverage == pytest.approx(0.997, abs=1e-6)
    assert budget.reading.confident_divergence_rad == needed.confident_divergence_rad
    assert budget.total_rad("exact") == pytest.approx(budget.beacon_half_angle_rad, rel=1e-12)


# ---- lines
@pytest.mark.promise("link-30")
def test_each_line_says_where_it_comes_from_and_what_it_means():
    lines = {line.name: line for line in budgets.open_loop(MISSION, SOURCES).lines}
    assert list(lines) == ["Body pointing", "Orbit knowledge", "Misalignment", "Point-ahead"]
    assert lines["Body pointing"].source.startswith("paper: section 2.1")
    assert lines["Orbit knowledge"].source.startswith("assumption: 1 km")
    assert lines["Misalignment"].source.startswith("derived: what beacon.divergence leaves")
    assert lines["Point-ahead"].source.startswith("assumption: orbit knowledge and calibration")
    assert all(line.unit == "rad" and line.basis and line.regime for line in lines.values())
    assert "random, 3-sigma, about each axis: mean 0, standard deviation error / 3" in lines["Body pointing"].basis
    assert "ramp from zero" in lines["Orbit knowledge"].basis
    assert "our own formula" in lines["Orbit knowledge"].regime
    assert "our own" not in lines["Misalignment"].regime
    assert "worst-case satellite (temporal)" in lines["Misalignment"].basis
    assert budgets.open_loop(MISSION, {}).lines[0].source == "not stated"


@pytest.mark.promise("link-30", "link-31", "link-32")
def test_the_papers_lines_have_the_means_and_deviations_of_their_classes():
    budget = budgets.open_loop(MISSION, SOURCES)
    body, orbit, misalignment, ahead = budget.terms
    assert (body.mean_rad, body.sigma_rad) == ((0.0, 0.0), pytest.approx((100 * URAD, 100 * URAD)))
    assert orbit.mean_rad == pytest.approx((12 * URAD, 12 * URAD))
    assert orbit.sigma_rad == pytest.approx((24 * URAD / math.sqrt(12),) * 2)
    assert (misalignment.mean_rad, misalignment.sigma_rad) == ((248 * URAD, 248 * URAD), (0.0, 0.0))
    assert math.hypot(*ahead.mean_rad) == pytest.approx(1 * URAD)
    sigma = math.hypot(100, 24 / math.sqrt(12))
    mean = 248 + 12 + 1 / math.sqrt(2)
    assert budget.total_rad("ecss-axis") == pytest.approx((mean + 2.967738 * sigma) * URAD, rel=1e-6)
    assert budget.total_rad("ecss-radial") == pytest.approx(math.sqrt(2) * (mean + 2.967738 * sigma) * URAD, rel=1e-6)
    assert budget.total_rad("esa-1993") == pytest.approx((300 + 24 + math.hypot(248, 1)) * URAD, rel=1e-12)


@pytest.mark.promise("link-31")
def test_over_all_satellites_a_constant_error_spreads():
    budget = budgets.open_loop(MISSION, SOURCES, interpretation="mixed")
    assert budget.error.bias_rad == (0.0, 0.0)
    assert budget.error.rms_rad[0] == pytest.approx(math.sqrt(100**2 + 64 / 3 + 248**2 / 3 + 0.25) * URAD, rel=1e-12)
    assert budget.total_rad("exact") < budgets.open_loop(MISSION, SOURCES).total_rad("exact")
    assert budget.interpretation == "mixed"
    assert budget.rss_rad == budgets.open_loop(MISSION, SOURCES).rss_rad


def test_shares_without_any_error_are_zero():
    budget = budgets.open_loop(with_pointing(0.0, 0.0, 0.0), SOURCES)
    assert budget.variance_shares == (0.0, 0.0, 0.0)
    assert budget.reading.coverage == 1.0
    assert budget.confident_divergence_rad == 0.0


# ---- coverage
@pytest.mark.promise("report-8")
@pytest.mark.promise("link-33")
def test_the_beacon_covers_as_often_as_drawn_errors_lie_in_its_cone():
    budget = budgets.open_loop(MISSION, SOURCES)
    draw, count = np.random.Generator(np.random.Philox(key=5)), 400_000
    # Gaussian body, orbit knowledge along its ramp, and what is constant
    x, y = (100 * draw.standard_normal(count) + 24 * draw.random(count) + 248 + math.sqrt(0.5) for axis in ("x", "y"))
    radial = np.hypot(x, y) * URAD
    for radius in (390e-6, 600e-6, 780e-6):
        share = np.mean(radial < radius)
        half_interval = 2.576 * math.sqrt(share * (1 - share) / count)
        assert abs(float(budget.coverage(radius)) - share) < half_interval
    assert budget.reading.coverage == pytest.approx(0.5314, abs=5e-4)
    assert budget.other_reading.coverage > 0.9999
    assert budget.coverage([0.0, 1.0]).tolist() == [0.0, 1.0]


def test_without_a_beacon_the_errors_still_add_up_but_nothing_is_covered():
    budget, whole = budgets.open_loop(without_beacon(), SOURCES), budgets.open_loop(MISSION, SOURCES)
    assert budget.reading is None and budget.counter_reading is None
    assert budget.summations == whole.summations
    assert budget.required_divergence_rad == whole.required_divergence_rad
    assert float(budget.coverage(390e-6)) == whole.reading.coverage
    for name in ("covers", "beacon_half_angle_rad", "other_reading"):
        with pytest.raises(ValueError, match=r"the mission has no beacon.*give it a table \[beacon\]"):
            getattr(budget, name)


# ---- point-ahead
@pytest.mark.promise("link-29")
def test_point_ahead_left_alone_is_a_bias_of_71_microradians_about_one_axis():
    budget = budgets.open_loop(with_point_ahead("10.65 km/s", False), SOURCES)
    line, term = budget.lines[-1], budget.terms[-1]
    assert line.name == "Point-ahead"
    assert line.value == budget.point_ahead.angle_rad == pytest.approx(71e-6, abs=0.5e-6)
    assert "not corrected" in line.basis
    assert line.source.startswith("assumption: most from a 500 km")
    assert (term.mean_rad, term.sigma_rad) == ((line.value, 0.0), (0.0, 0.0))
    assert not budget.covers  # the paper's beacon has no room for it
    assert budget.reading.coverage < budgets.open_loop(MISSION, SOURCES).reading.coverage


@pytest.mark.promise("link-4", "link-29")
def test_a_corrected_point_ahead_leaves_its_error():
    budget = budgets.open_loop(with_point_ahead("10.65 km/s", True, "7 urad"), SOURCES)
    assert budget.point_ahead.corrected is True
    assert budget.lines[-1].value == budget.point_ahead.error_rad == pytest.approx(7e-6)
    assert math.hypot(*budget.terms[-1].mean_rad) == pytest.approx(7e-6)


def test_a_mission_without_point_ahead_has_no_such_line():
    budget = budgets.open_loop(MISSION.model_copy(update={"point_ahead": None}), SOURCES)
    assert budget.point_ahead is None
    assert [line.name for line in budget.lines] == ["Body pointing", "Orbit knowledge", "Misalignment"]


@pytest.mark.parametrize("key", ["point_ahead", "Point-Ahead"])
def test_point_ahead_is_not_counted_twice(key):
    mission = with_lines(**{key: ("71 urad", "bias", "bound", "radial")})
    assert budgets.open_loop(mission, SOURCES).lines[0].name == "Point ahead"
    both = mission.model_copy(update={"point_ahead": MISSION.point_ahead})
    with pytest.raises(ValueError, match=f"pointing.lines.{key} stands beside the table point_ahead.*remove one"):
        budgets.open_loop(both, SOURCES)


# ---- allocation
@pytest.mark.parametrize("rule", ["rss", "esa-1993", "ecss-axis", "ecss-radial", "exact"])
def test_what_is_left_for_a_line_brings_the_mission_to_the_total(rule):
    total = 900e-6
    for each in budgets.open_loop(MISSION, SOURCES).allocation(total, rule):
        if each.name == "Point-ahead":
            mission = with_point_ahead("10.65 km/s", True, f"{each.largest_rad / URAD!r} urad")
        else:
            lines = dict(MISSION.pointing.lines)
            key = each.name.lower().replace(" ", "_")
            lines[key] = lines[key].model_copy(update={"error_rad": each.largest_rad})
            mission = MISSION.model_copy(update={"pointing": MISSION.pointing.model_copy(update={"lines": lines})})
        assert budgets.open_loop(mission, SOURCES).total_rad(rule) == pytest.approx(total, rel=1e-6)
        assert each.note == "" and each.missing_rad == 0.0


def test_a_total_by_an_unknown_rule_is_refused():
    with pytest.raises(ValueError, match=r'no rule "mean"; give one of rss, esa-1993, ecss-axis.*exact'):
        budgets.open_loop(MISSION, SOURCES).total_rad("mean")


# ---- lines of a budget
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


def test_what_is_left_for_a_line_over_all_satellites_is_by_their_budget():
    of, total = budgets.open_loop(MISSION, SOURCES, interpretation="mixed"), 900e-6
    for each in of.allocation(total):
        lines = [line.with_error(each.largest_rad) if line.name == each.name else line for line in of.stated]
        assert radial_total_rad([error_term(line, "mixed") for line in lines], of.confidence) == pytest.approx(total)
