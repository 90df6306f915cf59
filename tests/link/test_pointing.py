"""The open-loop pointing budget of a mission: what the beacon covers, point-ahead, and missions without a beacon."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import budgets
from microrad import link
from microrad.core.budget import Line, root_sum_square, total_db
from microrad.link.pointing.error_classes import ErrorTerm, StatedError, error_term
from microrad.link.pointing.open_loop import open_loop_budget
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


@settings(deadline=None, max_examples=40)  # the machine may be busy
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


# ------------------------------------------------------------------------------------------- lines unlike each other
EACH_CLASS = {
    "body_jitter": ("31 urad", "random", "2-sigma", "radial"),
    "orbit-knowledge": ("17 urad", "drift", "bound", "per-axis"),
    "mis alignment": ("53 urad", "bias", "1-sigma", "per-axis"),
    "thermal": ("11 urad", "transient", "3-sigma", "radial"),
    "noise": ("23 urad", "random", "bound", "radial"),
}


GAUSSIAN = {"temporal": [True, False, True, True, False, True], "mixed": [True, False, True, True, False, False]}


@pytest.mark.parametrize(("interpretation", "expected", "words"), [
    ("temporal",
     [0.0, 0.0, 1.09601551e-05, 1.09601551e-05, 8.5e-06, 8.5e-06, 4.90747729e-06, 4.90747729e-06, 0.000159, 0.000159,
     0.0, 0.0, 7.77817459e-06, 7.77817459e-06, 0.0, 0.0, 0.0, 0.0, 1.15e-05, 1.15e-05, 4.94974747e-06,
     4.94974747e-06, 0.0, 0.0, 6.89782574e-05, 0.000120060784, 0.000212816314, 0.000300967718, 4.06987752e-05,
     0.00028274482, 0.20197562, 0.0607398066, 0.590374107, 0.0254308533, 0.111181169, 0.0102984447, 6.89782574e-05,
     0.000180227922, 0.000180227922, 1.66270362e-05, 1.66270362e-05, 0.000125, 0.000137956515, 1.96569839e-15,
     0.00056548964, 0.00025, 6.89782574e-05, 0.372022344, 0.00028274482, 6.20429217e-05, 0.000137956515,
     0.00056548964],
     ["random, 2-sigma, radial: mean 0, standard deviation error / (2 sqrt(2)) over time",
      "drift, bound, about each axis: ramp from zero to error, mean 1/2 and standard deviation 1/sqrt(12) of it; "
      "worst-case satellite (temporal)",
      "bias, 1-sigma, about each axis: mean 3 error, constant; worst-case satellite (temporal)",
      "transient, 3-sigma, radial: mean error / sqrt(2) about each axis, counted as always present; worst-case "
      "satellite (temporal)",
      "random, bound, radial: mean 0, standard deviation error / 2, evenly over a disc over time",
      "what correcting 62 µrad leaves; bias, bound, radial: mean error / sqrt(2) about each axis, constant; "
      "worst-case satellite (temporal)"]),
    ("mixed",
     [0.0, 0.0, 1.09601551e-05, 1.09601551e-05, 0.0, 0.0, 5.66666667e-06, 5.66666667e-06, 0.0, 0.0, 5.3e-05, 5.3e-05,
     0.0, 0.0, 2.59272486e-06, 2.59272486e-06, 0.0, 0.0, 1.15e-05, 1.15e-05, 0.0, 0.0, 3.5e-06, 3.5e-06,
     6.89782574e-05, 0.000120060784, 0.000109345235, 0.000154637515, 0.000136558353, 0.000136558353, 0.20197562,
     0.0607398066, 0.590374107, 0.0254308533, 0.111181169, 0.0102984447, 6.89782574e-05, 0.0, 0.0, 5.57894106e-05,
     5.57894106e-05, 0.000125, 0.000137956515, 0.918737755, 0.000273116706, 0.00025, 6.89782574e-05, 0.999956393,
     0.000136558353, 6.20429217e-05, 0.000137956515, 0.000273116706],
     ["random, 2-sigma, radial: mean 0, standard deviation error / (2 sqrt(2)); random satellite at a random time "
      "(mixed)",
      "drift, bound, about each axis: mean 0, standard deviation error / sqrt(3) / sqrt(3), evenly up to the bound, "
      "ramp from zero; random satellite at a random time (mixed)",
      "bias, 1-sigma, about each axis: mean 0, standard deviation error / 1; random satellite at a random time (mixed)",
      "transient, 3-sigma, radial: mean 0, standard deviation error / (3 sqrt(2)), counted as always present; random "
      "satellite at a random time (mixed)",
      "random, bound, radial: mean 0, standard deviation error / 2, evenly over a disc; random satellite at a random "
      "time (mixed)",
      "what correcting 62 µrad leaves; bias, bound, radial: mean 0, standard deviation error / 2, evenly over a "
      "disc; random satellite at a random time (mixed)"]),
])  # fmt: skip
def test_errors_of_each_class_are_told_and_summed_as_they_mean(interpretation, expected, words):
    mission = with_lines(0.95, **EACH_CLASS)
    tables = {"point_ahead": with_point_ahead("9.3 km/s", True, "7 urad").point_ahead}
    tables["beacon"] = MISSION.beacon.model_copy(update={"divergence_rad": 250e-6})
    found = budgets.open_loop(mission.model_copy(update=tables), SOURCES, interpretation=interpretation)
    assert [line.name for line in found.lines] == [
        "Body jitter", "Orbit knowledge", "Mis alignment", "Thermal", "Noise", "Point-ahead"
    ]  # fmt: skip
    numbers = [x for t in found.terms for x in (*t.mean_rad, *t.sigma_rad)]
    numbers += [each.total_rad for each in found.summations]
    numbers += [*found.variance_shares, found.rss_rad, *found.error.bias_rad, *found.error.rms_rad]
    for each in (found.reading, found.counter_reading):
        numbers += [each.half_angle_rad, each.required_divergence_rad, each.coverage, each.confident_divergence_rad]
    numbers += [found.point_ahead.angle_rad, found.required_divergence_rad, found.confident_divergence_rad]
    assert numbers == pytest.approx(expected, rel=1e-6, abs=1e-15)
    assert [line.basis for line in found.lines] == words
    own = "; our own formula, ECSS-E-ST-60-10C has no such class"
    regimes = [f"uncorrelated with the other lines{more}" for more in ("", own, "", own, "", "")]
    assert [line.regime for line in found.lines] == regimes
    assert [t.gaussian for t in found.terms] == GAUSSIAN[interpretation]


NONE_OF = 'no interpretation "spatial"; give one of temporal, mixed'


@pytest.mark.parametrize(("call", "words"), [
    (lambda: StatedError("Body", -2e-6, "bias", "bound", "x"), "Body: the error is -2 µrad"),
    (lambda: StatedError("Body", math.inf, "bias", "bound", "x"), "Body: the error is inf"),
    (lambda: StatedError("Body", 2e-6, "noise", "bound", "x"), 'Body: no kind "noise"; give one of '),
    (lambda: StatedError("Body", 2e-6, "bias", "4-sigma", "x"), 'Body: no statistic "4-sigma"; give one of '),
    (lambda: StatedError("Body", 2e-6, "bias", "bound", "y"), 'Body: no axes "y"; give one of per-axis, radial, x'),
    (lambda: ErrorTerm("Body", "bias", 1e-6, (0.0, math.nan), (0.0, 0.0)), "Body: the mean"),
    (lambda: ErrorTerm("Body", "bias", 1e-6, (0.0, 0.0), (0.0, -1e-6)), "Body: the standard deviation"),
    (lambda: error_term(StatedError("Body", 2e-6, "bias", "bound", "x"), "spatial"), NONE_OF),
    (lambda: budgets.open_loop(without_beacon(), SOURCES).covers, "the mission has no beacon, so nothing is covered; "
     "give it a table [beacon]"),
    (lambda: budgets.open_loop(MISSION.model_copy(update={"pointing": None}), SOURCES), "the mission states no "
     "pointing errors; give it the table [pointing]"),
])  # fmt: skip
def test_a_refusal_of_an_error_says_which_and_what_to_give(call, words):
    with pytest.raises(ValueError, match="^" + re.escape(words)):
        call()


@pytest.mark.parametrize(
    ("terms", "found"),
    [
        ([("a", 30.5, "dBW"), ("b", -2.25, "dB"), ("c", 7.0, "dB")], 35.25),
        ([("b", -2.25, "dB"), ("a", -41.0, "dBm")], -43.25), ([], 0.0),
        ([("one", 3.0, "dBm"), ("b", 1.0, "dB"), ("two", 4.0, "dBW"), ("three", 5.0, "dBm")],
         "one, two, three: only one line of a sum in decibels may be a power level"),
        ([("a", 3.0, "dB"), ("rate", 4.0, "Hz"), ("b", 5.0, "W")],
         '"rate" is in Hz: only lines in dB, dBm or dBW add up in decibels'),
    ],
)  # fmt: skip
def test_decibels_add_up_to_one_level_at_most(terms, found):
    lines = (Line(name, value, unit, "", "", "") for name, value, unit in terms)
    if isinstance(found, float):
        assert total_db(lines) == found
        return
    with pytest.raises(ValueError) as refused:
        total_db(lines)
    assert str(refused.value) == found


@pytest.mark.parametrize(
    ("units", "said"),
    [(("rad", "m", "rad"), "m, rad"), (("dB",), "dB"), (("dBm", "dBm"), "dBm"), (("dBW",), "dBW"), ((), "none")],
)
def test_a_root_sum_square_takes_one_linear_unit_and_names_those_that_it_got(units, said):
    with pytest.raises(ValueError) as refused:
        root_sum_square(Line("x", 1.0, unit, "", "", "") for unit in units)
    assert str(refused.value) == f"a root sum square needs lines in one linear unit, these are in {said}"
    assert root_sum_square(Line("x", value, "A", "", "", "") for value in (2.0, -3.0, 6.0)) == pytest.approx(
        7.0, rel=1e-12
    )


@pytest.mark.parametrize("key", ["point_ahead", "point-ahead", "Point-Ahead"])
def test_a_line_for_the_point_ahead_beside_its_table_is_refused_by_its_key(key):
    line = next(iter(MISSION.pointing.lines.values()))
    table = MISSION.pointing.model_copy(update={"lines": {"bench": line, key: line}})
    shared = link.Shared.of(MISSION)
    with pytest.raises(ValueError) as refused:
        open_loop_budget(table, shared, None, {})
    assert str(refused.value) == (
        f"pointing.lines.{key} stands beside the table point_ahead, which is a line of the budget already; remove one "
        "of the two"
    )
    alone = open_loop_budget(table, replace(shared, point_ahead=None), None, {})
    assert [each.name for each in alone.stated] == ["Bench", "Point ahead"]
