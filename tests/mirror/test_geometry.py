"""The chain from mirror to line of sight against reflected rays and planes through points; stroke budgets by hand."""

import itertools
import math

import numpy as np
import pytest

from microrad.mirror import geometry
from microrad.mirror.geometry import Geometry, StrokeDemand, stroke_budget

small_tilt_rad = 1e-5
second_order = 1e-9  # a few times the square of that tilt

THIRDS = 2.0 * np.pi / 3.0 * np.arange(3)


def random_cases(seed, count=40):
    return np.random.Generator(np.random.Philox(seed)), range(count)


def reflected_angles(normal, incidence_rad):
    """Angles of the reflected ray from the ray off the untilted mirror, along x' (in the plane of incidence) and y'."""
    ray = np.array([math.sin(incidence_rad), 0.0, -math.cos(incidence_rad)])
    out = ray - 2.0 * (ray @ normal) * normal / (normal @ normal)
    in_plane = np.array([math.cos(incidence_rad), 0.0, -math.sin(incidence_rad)])
    across = np.array([0.0, 1.0, 0.0])
    ahead = np.array([math.sin(incidence_rad), 0.0, math.cos(incidence_rad)])
    return np.array([math.atan2(out @ in_plane, out @ ahead), math.atan2(out @ across, out @ ahead)])


# ---------------------------------------------------------------------------------------------- reflection
@pytest.mark.promise("pointing-9")
@pytest.mark.parametrize("incidence_deg", [0.0, 22.5, 45.0, 70.0])
def test_a_reflected_ray_turns_by_twice_the_tilt_in_the_plane_and_by_two_cosines_across(incidence_deg):
    incidence = math.radians(incidence_deg)
    matrix = geometry.line_of_sight_matrix(Geometry("mechanical", incidence_rad=incidence))
    for tilt in np.array([[1.0, 0.0], [0.0, 1.0], [-0.6, 0.8]]) * small_tilt_rad:
        seen = reflected_angles(np.array([*tilt, 1.0]), incidence)
        np.testing.assert_allclose(matrix @ tilt, seen, atol=second_order)
    np.testing.assert_allclose(matrix, np.diag([2.0, 2.0 * math.cos(incidence)]), rtol=1e-15)


def test_an_optical_output_is_already_the_beam_at_normal_incidence():
    np.testing.assert_array_equal(geometry.line_of_sight_matrix(Geometry("optical")), np.eye(2))
    oblique = geometry.line_of_sight_matrix(Geometry("optical", incidence_rad=math.pi / 4))
    np.testing.assert_allclose(oblique, np.diag([1.0, math.sqrt(0.5)]), rtol=1e-15)


@pytest.mark.promise("pointing-9")
def test_a_telescope_divides_the_angle_and_a_rotation_turns_x_towards_y():
    seen = geometry.line_of_sight_matrix(Geometry("mechanical", magnification=10.0, rotation_rad=math.pi / 2))
    np.testing.assert_allclose(seen @ [1.0, 0.0], [0.0, 0.2], atol=1e-16)
    np.testing.assert_allclose(seen @ [0.0, 1.0], [-0.2, 0.0], atol=1e-16)
    inverted = geometry.line_of_sight_matrix(Geometry("optical", magnification=4.0, rotation_rad=math.pi))
    np.testing.assert_allclose(inverted, -np.eye(2) / 4.0, atol=1e-16)


def test_coupling_says_what_the_drive_of_one_axis_moves_on_the_other():
    seen = geometry.line_of_sight_matrix(Geometry("optical", coupling=((1.0, 0.02), (-0.03, 1.0))))
    np.testing.assert_allclose(seen @ [1.0, 0.0], [1.0, -0.03], rtol=1e-15)  # the x drive on y
    np.testing.assert_allclose(seen @ [0.0, 1.0], [0.02, 1.0], rtol=1e-15)


# -------------------------------------------------------------------------------------------------- tripod
def test_pushed_actuators_lean_the_plate_through_their_three_ends():
    rng, cases = random_cases(seed=1)
    radius, incidence, magnification = 0.01, math.radians(30.0), 5.0
    tripod = Geometry("mechanical", incidence, magnification, layout="tripod", actuator_radius_m=radius)
    for _ in cases:
        strokes = rng.uniform(-1e-7, 1e-7, 3)
        ends = np.column_stack([radius * np.cos(THIRDS), radius * np.sin(THIRDS), strokes])
        normal = np.cross(ends[1] - ends[0], ends[2] - ends[0])
        seen = reflected_angles(normal, incidence) / magnification
        predicted = geometry.line_of_sight_matrix(tripod) @ (strokes / radius)
        np.testing.assert_allclose(predicted, seen, atol=second_order)
        assert np.max(np.abs(seen)) > 10 * second_order


def test_a_pushed_actuator_sends_the_beam_away_from_it_and_piston_moves_nothing():
    seen = geometry.line_of_sight_matrix(Geometry("mechanical", layout="tripod", actuator_radius_m=0.01))
    np.testing.assert_allclose(seen @ [1.0, 0.0, 0.0], [-4.0 / 3.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(seen @ [1.0, 1.0, 1.0], 0.0, atol=1e-15)
    optical = geometry.line_of_sight_matrix(Geometry("optical", layout="tripod", actuator_radius_m=0.01))
    np.testing.assert_allclose(optical, seen / 2.0, rtol=1e-15)


@pytest.mark.parametrize("angle", ["mechanical", "optical"])
def test_the_outputs_of_a_tripod_for_a_line_of_sight_make_it_and_sum_to_zero(angle):
    tripod = Geometry(angle, magnification=10.0, layout="tripod", actuator_radius_m=0.02)
    outputs = geometry.outputs_matrix(tripod)
    # 100 µrad outside is 1 mrad of beam, 0.5 mrad of tilt: actuator 1, 20 mm out, draws back by 10 µm
    strokes_m = outputs @ [100e-6, 0.0] * 0.02 / {"mechanical": 1.0, "optical": 2.0}[angle]
    np.testing.assert_allclose(strokes_m, [-10e-6, 5e-6, 5e-6], rtol=1e-12)
    np.testing.assert_allclose(outputs.sum(axis=0), 0.0, atol=1e-14)
    np.testing.assert_allclose(geometry.line_of_sight_matrix(tripod) @ outputs, np.eye(2), atol=1e-14)


# ------------------------------------------------------------------------------------------------ refusals
def test_a_singular_coupling_is_refused_with_the_direction_that_is_not_driven():
    both_move_the_diagonal = Geometry("optical", coupling=((1.0, 1.0), (1.0, 1.0 + 1e-6)))
    with pytest.raises(
        ValueError,
        match=r"^geometry: the two-axis mirror is singular: at 135\.0 degrees from x towards y it moves the line of "
        r"sight 4e\+06 times less than across that direction \(at most 10000 can be decoupled\); check coupling and "
        r"incidence_rad$",
    ):
        geometry.outputs_matrix(both_move_the_diagonal)
    with pytest.raises(ValueError, match=r"tripod mirror is singular: at 90\.0 degrees .* inf times less"):
        geometry.outputs_matrix(
            Geometry("optical", coupling=((1.0, 0.0), (0.0, 0.0)), layout="tripod", actuator_radius_m=0.01)
        )
    nearly = Geometry("optical", coupling=((1.0, 0.0), (0.0, 2e-4)))  # 5000 times, still invertible
    assert geometry.outputs_matrix(nearly)[1, 1] == pytest.approx(5000.0, rel=1e-9)


@pytest.mark.parametrize(
    ("coupling", "words"),
    [
        (((1.0, -1.0), (-1.0, 1.0 + 1e-6)), r"45\.0 degrees .* 4e\+06 times less"),
        (((-1.0, 1.0), (1.0, -1.0 - 1e-6)), r"45\.0 degrees .* 4e\+06 times less"),
        (((0.0, 0.0), (0.0, -1.0)), r"0\.0 degrees .* inf times less"),
        (((0.0, 0.0), (0.0, 0.0)), "[0-9.]+ degrees .* inf times less"),
    ],
)
def test_the_direction_that_is_not_driven_is_named_from_x_towards_y_in_a_half_turn(coupling, words):
    with pytest.raises(ValueError, match=f"mirror is singular: at {words}"):
        geometry.outputs_matrix(Geometry("optical", coupling=coupling))


def test_a_tripod_has_three_outputs_and_another_mirror_two():
    assert Geometry("optical", layout="tripod", actuator_radius_m=0.01).outputs == 3
    assert Geometry("optical", actuator_radius_m=0.01).outputs == Geometry("optical").outputs == 2


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"angle": "line of sight"}, 'angle is \'line of sight\'; choose "optical" or "mechanical"'),
        ({"layout": "hexapod"}, 'layout is \'hexapod\'; choose "two-axis" or "tripod"'),
        ({"incidence_rad": math.pi / 2}, r"incidence_rad is 1\.571 rad: .* below 1\.571 rad; .* the beam grazes"),
        ({"incidence_rad": -0.1}, "incidence_rad is -100 mrad"),
        ({"incidence_rad": math.nan}, "incidence_rad is nan"),
        ({"magnification": 0.0}, "magnification is 0: it must be finite, above 0; an inverted image is"),
        ({"magnification": math.nan}, "magnification is nan"),
        ({"rotation_rad": math.inf}, "rotation_rad is inf rad: it must be finite"),
        ({"coupling": ((1.0, 0.0), (0.0, math.nan))}, "coupling is .*nan.*; give two rows of two finite numbers"),
        ({"coupling": ((1.0, 0.0),)}, "coupling is .* for none"),
        ({"layout": "tripod"}, "actuator_radius_m is None; give the radius of the circle on which the tripod's three"),
        ({"layout": "tripod", "actuator_radius_m": 0.0}, "actuator_radius_m is 0.0; .*, in m and above 0$"),
        ({"layout": "tripod", "actuator_radius_m": math.inf}, "actuator_radius_m is inf"),
        ({"layout": "two-axis", "actuator_radius_m": -0.01}, "actuator_radius_m is -0.01"),
    ],
)
def test_what_is_no_geometry_is_refused(values, message):
    with pytest.raises(ValueError, match=f"^(geometry: |Geometry.){message}"):
        Geometry(**({"angle": "optical"} | values))


def random_geometry(rng, layout):
    return Geometry(
        angle=("optical", "mechanical")[rng.integers(2)],
        incidence_rad=rng.uniform(0.0, 1.2),
        magnification=rng.uniform(0.5, 40.0),
        rotation_rad=rng.uniform(-np.pi, np.pi),
        coupling=((rng.uniform(0.8, 1.2), rng.uniform(-0.4, 0.4)), (rng.uniform(-0.4, 0.4), rng.uniform(0.8, 1.2))),
        layout=layout,
        actuator_radius_m=0.01 if layout == "tripod" else None,
    )


# ------------------------------------------------------------------------------------------- stroke budget
def demand(body=(300e-6, 300e-6), ahead=(71e-6, 0.0), bias=(0.0, 0.0), lag=(0.0, 0.0), on_mirror=False):
    return StrokeDemand(body, ahead, bias, lag, point_ahead_on_mirror=on_mirror)


PAPER = {"travel_rad": 2.5e-3, "travel_angle": "optical"}


def test_the_papers_mirror_covers_300_urad_only_up_to_a_magnification_of_four():
    x, y = stroke_budget(Geometry("optical"), demand(), **PAPER)
    assert (x.name, y.name) == ("x", "y")
    assert [line.name for line in x.lines] == [
        "Body pointing",
        "Point-ahead",
        "Bias and alignment",
        "Line-of-sight rate lag",
    ]
    assert x.total_rad == pytest.approx(300e-6, rel=1e-12)
    assert x.available_rad == pytest.approx(1.25e-3, rel=1e-12)
    assert x.margin_rad == pytest.approx(950e-6, rel=1e-12)
    assert x.ratio == pytest.approx(1250 / 300, rel=1e-12)
    assert x.largest_magnification == pytest.approx(4.1667, rel=1e-4)
    assert x.fits
    assert not stroke_budget(Geometry("optical", magnification=4.2), demand(), **PAPER)[0].fits
    assert stroke_budget(Geometry("optical", magnification=4.16), demand(), **PAPER)[0].fits


def test_point_ahead_on_the_mirror_takes_its_share_on_its_axis_alone():
    x, y = stroke_budget(Geometry("optical"), demand(on_mirror=True), **PAPER)
    assert x.total_rad == pytest.approx(371e-6, rel=1e-12)
    assert x.total_rss_rad == pytest.approx(math.sqrt(300**2 + 71**2) * 1e-6, rel=1e-12)
    assert x.largest_magnification == pytest.approx(1250 / 371, rel=1e-12)
    assert y.total_rad == pytest.approx(300e-6, rel=1e-12)
    elsewhere = stroke_budget(Geometry("optical"), demand(on_mirror=False), **PAPER)[0].lines[1]
    assert elsewhere.value == 0.0  # a term made elsewhere is still a line
    assert elsewhere.basis == "half range at the line of sight: x 71 µrad, y 0 rad; made by another mirror"
    assert x.lines[1].basis == "half range at the line of sight: x 71 µrad, y 0 rad; along (1, 0)"
    assert y.lines[1].basis == "half range at the line of sight: x 71 µrad, y 0 rad; along (0, 1)"
    assert {line.regime for line in x.lines} == {"both axes at their worst together"}


def test_a_need_that_is_just_met_fits_and_the_least_more_does_not():
    """In the worst case and in the root sum square, each by its own sum."""
    wanted = demand(bias=(400e-6, 0.0))

    def on(travel_rad, usable_rad=None):
        return stroke_budget(
            Geometry("optical"), wanted, travel_rad=travel_rad, travel_angle="optical", usable_travel_rad=usable_rad
        )[0]

    needed, rss = on(1e-2).needed_rad, on(1e-2).needed_rss_rad
    assert (needed, rss) == (pytest.approx(700e-6, rel=1e-12), pytest.approx(500e-6, rel=1e-12))
    for x in (on(2.0 * needed), on(1e-2, 2.0 * needed), on(2.0 * needed, 2.0 * needed)):
        assert (x.margin_rad, x.fits, x.fits_rss) == (0.0, True, True)
    for x in (on(2.0 * rss), on(1e-2, 2.0 * rss)):
        assert (x.margin_rss_rad, x.fits, x.fits_rss) == (0.0, False, True)
    assert not on(1.999 * needed).fits
    assert not on(1.999 * rss).fits_rss


def test_the_budget_of_a_tripod_is_that_of_its_actuators():
    tripod = Geometry("mechanical", layout="tripod", actuator_radius_m=0.02)
    budgets = stroke_budget(tripod, demand(), travel_rad=2.5e-3, travel_angle="mechanical")
    assert [b.name for b in budgets] == [b.label for b in budgets] == ["actuator 1", "actuator 2", "actuator 3"]
    assert [b.label for b in stroke_budget(Geometry("optical"), demand(), **PAPER)] == ["axis x", "axis y"]
    # 300 µrad outside along x are 150 µrad of tilt, and as much of actuator 1's extension over the radius
    assert budgets[0].needed_rad == pytest.approx(150e-6, rel=1e-12)


def test_magnification_multiplies_and_a_mechanical_angle_halves():
    wanted = demand(bias=(50e-6, 20e-6), lag=(25.5e-6, 0.0), on_mirror=True)  # sums to 446.5 and 320 µrad
    telescope = Geometry("optical", magnification=6.0)
    optical = stroke_budget(telescope, wanted, **PAPER)
    mechanical = stroke_budget(telescope, wanted, travel_rad=2.5e-3, travel_angle="mechanical")
    assert [b.needed_rad for b in optical] == pytest.approx([2679e-6, 1920e-6], rel=1e-12)
    assert [b.needed_rad for b in mechanical] == pytest.approx([1339.5e-6, 960e-6], rel=1e-12)
    assert [b.fits for b in optical] == [False, False]
    assert [b.fits for b in mechanical] == [False, True]
    assert mechanical[0].margin_rad == pytest.approx(-89.5e-6, rel=1e-9)
    rss = math.sqrt(300**2 + 71**2 + 50**2 + 25.5**2) * 1e-6
    assert mechanical[0].needed_rss_rad == pytest.approx(3.0 * rss, rel=1e-12)
    assert mechanical[0].fits_rss  # the worst case does not, the root sum square does
    assert mechanical[0].margin_rss_rad == pytest.approx(1.25e-3 - 3.0 * rss, rel=1e-12)
    assert mechanical[0].largest_magnification == pytest.approx(1.25e-3 / (446.5e-6 / 2.0), rel=1e-12)
    assert mechanical[0].largest_magnification_rss == pytest.approx(1.25e-3 / (rss / 2.0), rel=1e-12)
    assert mechanical[0].ratio_rss == pytest.approx(1.25e-3 / (3.0 * rss), rel=1e-12)


@pytest.mark.promise("mirror-file-8")
def test_the_travel_is_counted_by_its_own_convention_whatever_the_model_counts():
    as_optical, as_mechanical = (
        stroke_budget(Geometry(angle, magnification=3.0), demand(), **PAPER) for angle in ("optical", "mechanical")
    )
    assert as_optical[0].needed_rad == pytest.approx(as_mechanical[0].needed_rad, rel=1e-12)


def test_a_limited_drive_leaves_a_share_of_the_travel():
    # the paper's drive: 12 V at 0.089 mrad/V reach 1.068 of the 2.5 mrad
    x = stroke_budget(Geometry("optical"), demand(), **PAPER, usable_travel_rad=1.068e-3)[0]
    assert x.usable_share == pytest.approx(0.4272, rel=1e-12)
    assert x.available_rad == pytest.approx(534e-6, rel=1e-12)
    assert x.margin_rad == pytest.approx(234e-6, rel=1e-12)
    assert x.largest_magnification == pytest.approx(1.78, rel=1e-12)
    assert stroke_budget(Geometry("optical"), demand(), **PAPER)[0].usable_share == 1.0


@pytest.mark.parametrize("layout", ["two-axis", "tripod"])
def test_no_corner_of_the_demand_needs_more_than_the_budget_and_one_needs_all_of_it(layout):
    rng, cases = random_cases(seed=3)
    for _ in cases:
        g = random_geometry(rng, layout)
        pairs = rng.uniform(0.0, 1e-4, (4, 2))
        wanted = StrokeDemand(*(tuple(pair) for pair in pairs.tolist()), point_ahead_on_mirror=True)
        budgets = stroke_budget(g, wanted, travel_rad=1e-2, travel_angle=g.angle)
        corners = np.array(list(itertools.product([-1.0, 1.0], repeat=2))) * pairs.sum(axis=0)
        # least strokes for a line of sight, found by a general solver: without piston for a tripod of equal actuators
        outputs = np.linalg.lstsq(geometry.line_of_sight_matrix(g), corners.T, rcond=None)[0]
        np.testing.assert_allclose([b.needed_rad for b in budgets], np.max(np.abs(outputs), axis=1), rtol=1e-9)


def test_a_mirror_turned_by_45_degrees_needs_more_for_the_same_box():
    square = stroke_budget(Geometry("optical", rotation_rad=math.pi / 4), demand(), **PAPER)
    assert [b.total_rad for b in square] == pytest.approx([300e-6 * math.sqrt(2.0)] * 2, rel=1e-12)
    assert "along (0.707, 0.707)" in square[0].lines[0].basis


def test_oblique_incidence_costs_stroke_on_the_axis_across():
    x, y = stroke_budget(Geometry("optical", incidence_rad=math.pi / 3), demand(), **PAPER)
    assert (x.needed_rad, y.needed_rad) == pytest.approx((300e-6, 600e-6), rel=1e-12)


def test_lines_carry_their_sources_and_no_demand_leaves_any_magnification():
    nothing = demand(body=(0.0, 0.0), ahead=(0.0, 0.0))
    x = stroke_budget(Geometry("optical"), nothing, **PAPER, sources={"body_pointing_rad": "paper: section 2.1"})[0]
    assert (x.ratio, x.ratio_rss, x.largest_magnification) == (math.inf, math.inf, math.inf)
    assert x.fits
    assert [line.source for line in x.lines[:2]] == ["paper: section 2.1", "not stated"]
    assert all(line.unit == "rad" and line.basis and line.regime for line in x.lines)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"travel_rad": 0.0}, "travel_rad is 0; give the range from stop to stop, above 0 rad"),
        ({"travel_rad": math.nan}, "travel_rad is nan"),
        ({"travel_rad": math.inf}, "travel_rad is inf"),
        (
            {"usable_travel_rad": 3e-3},
            r"usable_travel_rad is 3 mrad, of a travel of 2\.5 mrad from stop to stop; give what the drive range "
            "leaves of that travel, above 0 rad and not beyond it$",
        ),
        ({"usable_travel_rad": 0.0}, "usable_travel_rad is 0 rad, of a travel"),
        ({"usable_travel_rad": math.nan}, "usable_travel_rad is nan"),
        ({"travel_angle": "line-of-sight"}, 'travel_angle is \'line-of-sight\'; choose "optical" or "mechanical"'),
    ],
)
def test_a_travel_without_meaning_is_refused(changes, message):
    with pytest.raises(ValueError, match=f"^stroke budget: {message}"):
        stroke_budget(Geometry("optical"), demand(), **(PAPER | changes))


@pytest.mark.parametrize("pair", [(-1e-6, 0.0), (math.nan, 0.0), (0.0, math.inf), (1e-6,)])
def test_a_half_range_without_meaning_is_refused(pair):
    with pytest.raises(ValueError, match=r"^stroke budget: bias_rad is .*; give two half ranges \(x, y\) in rad"):
        demand(bias=pair)


def test_a_budget_of_numbers_that_are_all_unlike_has_each_in_its_place():
    """An oblique turned mirror with coupling and a telescope: what each output has to do, from its rows by hand."""
    wanted = StrokeDemand((3e-3, 1e-3), (7e-5, 2e-5), (4e-4, 5e-4), (6e-6, 8e-6), point_ahead_on_mirror=False)
    seen = Geometry("optical", math.radians(40.0), 6.0, 0.3, ((1.0, 0.05), (-0.02, 0.9)))
    x, y = stroke_budget(
        seen,
        wanted,
        travel_rad=0.05,
        travel_angle="mechanical",
        usable_travel_rad=0.03,
        sources={"bias_rad": "alignment", "rate_lag_rad": "orbit"},
    )
    turn = np.array([[math.cos(0.3), -math.sin(0.3)], [math.sin(0.3), math.cos(0.3)]])
    chain = turn @ np.diag([2.0, 2.0 * math.cos(math.radians(40.0))]) @ [[1.0, 0.05], [-0.02, 0.9]] / 6.0
    for budget, row, along in (
        (x, np.linalg.inv(chain)[0], "0.974, 0.226"),
        (y, np.linalg.inv(chain)[1], "0.281, 0.96"),
    ):
        size = math.hypot(*row)
        values = [(abs(row[0]) * a + abs(row[1]) * b) / size for a, b in ((3e-3, 1e-3), (4e-4, 5e-4), (6e-6, 8e-6))]
        assert [line.value for line in budget.lines] == pytest.approx([values[0], 0.0, *values[1:]], rel=1e-12)
        assert [line.source for line in budget.lines] == ["not stated", "not stated", "alignment", "orbit"]
        assert [line.basis for line in budget.lines] == [
            f"half range at the line of sight: x 3 mrad, y 1 mrad; along ({along})",
            "half range at the line of sight: x 70 µrad, y 20 µrad; made by another mirror",
            f"half range at the line of sight: x 400 µrad, y 500 µrad; along ({along})",
            f"half range at the line of sight: x 6 µrad, y 8 µrad; along ({along})",
        ]
        assert (budget.travel_angle, budget.travel_rad, budget.usable_travel_rad) == ("mechanical", 0.05, 0.03)
        assert budget.magnification == 6.0
        assert budget.mirror_per_line_of_sight == pytest.approx(size, rel=1e-12)
        assert budget.needed_rss_rad == pytest.approx(size * math.hypot(*values), rel=1e-12)
        assert budget.margin_rss_rad == pytest.approx(0.015 - size * math.hypot(*values), rel=1e-12)
        assert budget.largest_magnification_rss == pytest.approx(6.0 * 0.015 / (size * math.hypot(*values)), rel=1e-12)
    assert [x.needed_rad, y.needed_rad] == pytest.approx([0.0109919010, 0.0104497693], rel=1e-8)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"coupling": ((1.0, 2.0), (1.0, 2.0001)), "rotation_rad": 0.2, "magnification": 3.0},
            "the two-axis mirror is singular: at 146.5 degrees from x towards y it moves the line of sight 1e+05 times "
            "less than across that direction (at most 10000 can be decoupled); check coupling and incidence_rad",
        ),
        (
            {"incidence_rad": 1.57079, "rotation_rad": 2.5},
            "the two-axis mirror is singular: at 53.2 degrees from x towards y it moves the line of sight 1.58e+05 "
            "times less than across that direction (at most 10000 can be decoupled); check coupling and incidence_rad",
        ),
        (
            {"layout": "tripod", "actuator_radius_m": 0.03, "coupling": ((2.0, 0.0), (1.0, 1e-5))},
            "the tripod mirror is singular: at 116.6 degrees from x towards y it moves the line of sight 2.5e+05 times "
            "less than across that direction (at most 10000 can be decoupled); check coupling and incidence_rad",
        ),
    ],
    ids=["turned", "grazing", "tripod"],
)
def test_the_weak_direction_of_a_turned_mirror_is_that_of_the_line_of_sight(changes, words):
    with pytest.raises(ValueError) as refused:
        geometry.outputs_matrix(Geometry("mechanical", **changes))
    assert str(refused.value) == f"geometry: {words}"


@pytest.mark.parametrize("key", ["body_pointing_rad", "point_ahead_rad", "bias_rad", "rate_lag_rad"])
@pytest.mark.parametrize("pair", [(2e-6, -1e-9), (math.inf, 0.0), (1e-6, 2e-6, 3e-6)])
def test_each_half_range_is_checked_on_both_axes_under_its_own_name(key, pair):
    ranges = dict.fromkeys(("body_pointing_rad", "point_ahead_rad", "bias_rad", "rate_lag_rad"), (1e-6, 2e-6))
    with pytest.raises(ValueError) as refused:
        StrokeDemand(**ranges | {key: pair}, point_ahead_on_mirror=True)
    assert str(refused.value) == (
        f"stroke budget: {key} is {pair}; give two half ranges (x, y) in rad, each finite and at least 0"
    )


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"coupling": ((1, 0, 0), (0, 1, 0))},
            "coupling is ((1, 0, 0), (0, 1, 0)); give two rows of two finite numbers, ((1, 0), (0, 1)) for none",
        ),
        (
            {"coupling": ((1, -math.inf), (0, 1)), "actuator_radius_m": 0.5},
            "coupling is ((1, -inf), (0, 1)); give two rows of two finite numbers, ((1, 0), (0, 1)) for none",
        ),
        (
            {"layout": "tripod", "actuator_radius_m": math.nan},
            "actuator_radius_m is nan; give the radius of the circle on which the tripod's three actuators stand, in m "
            "and above 0",
        ),
    ],
)
def test_a_geometry_is_refused_in_all_words(values, message):
    with pytest.raises(ValueError) as refused:
        Geometry(**({"angle": "mechanical"} | values))
    assert str(refused.value) == f"geometry: {message}"


def test_a_turned_tripod_behind_a_telescope_is_seen_through_all_of_its_parts():
    """The first actuator alone by 1: a tilt of -2/3 in x, seen twice, in both axes by coupling, then turned."""
    tripod = Geometry("mechanical", 0.7, 5.0, -0.4, ((0.9, 0.2), (0.1, 1.1)), "tripod", 0.04)
    x, y = 2.0 * -0.6, 2.0 * math.cos(0.7) * -2.0 / 30.0
    expected = [(math.cos(0.4) * x + math.sin(0.4) * y) / 5.0, (-math.sin(0.4) * x + math.cos(0.4) * y) / 5.0]
    np.testing.assert_allclose(geometry.line_of_sight_matrix(tripod) @ [1.0, 0.0, 0.0], expected, rtol=1e-12)
    second = np.array([-0.9 * -0.5 - 0.2 * math.sqrt(0.75), -0.1 * -0.5 - 1.1 * math.sqrt(0.75)]) * 2.0 / 3.0
    turned = np.array([[math.cos(0.4), math.sin(0.4)], [-math.sin(0.4), math.cos(0.4)]])
    seen = turned @ (second * [2.0, 2.0 * math.cos(0.7)]) / 5.0
    np.testing.assert_allclose(geometry.line_of_sight_matrix(tripod) @ [0.0, 1.0, 0.0], seen, rtol=1e-12)


def test_an_item_that_is_not_of_the_choices_is_named_with_where_it_stands():
    with pytest.raises(ValueError) as refused:
        Geometry("optical", layout="three-axis")
    assert str(refused.value) == 'geometry: layout is \'three-axis\'; choose "two-axis" or "tripod"'


def budget(**changes):
    lines = tuple(geometry.Line(name, value, "rad", "b", "s", "r") for name, value in (("one", 3e-4), ("two", 4e-4)))
    own = {
        "name": "x",
        "lines": lines,
        "magnification": 8.0,
        "mirror_per_line_of_sight": 2.5,
        "travel_angle": "optical",
    }
    return geometry.StrokeBudget(**own | {"travel_rad": 5e-3, "usable_travel_rad": 4e-3} | changes)


@pytest.mark.parametrize(
    ("changes", "numbers", "fits"),
    [
        ({}, "7e-4 5e-4 1.75e-3 1.25e-3 2e-3 .8 2.5e-4 7.5e-4 1.142857142857 1.6 9.142857142857 12.8", (True, True)),
        (
            {"mirror_per_line_of_sight": 4.0},
            "7e-4 5e-4 2.8e-3 2e-3 2e-3 .8 -8e-4 0 .714285714286 1 5.714285714286 8",
            (False, True),
        ),
        (
            {"usable_travel_rad": 2e-3, "magnification": 3.0},
            "7e-4 5e-4 1.75e-3 1.25e-3 1e-3 .4 -7.5e-4 -2.5e-4 .571428571429 .8 1.714285714286 2.4",
            (False, False),
        ),
        (
            {"mirror_per_line_of_sight": 0.0},
            "7e-4 5e-4 0 0 2e-3 .8 2e-3 2e-3 inf inf inf inf",
            (True, True),
        ),
    ],
)
def test_what_a_budget_of_two_lines_says_in_numbers(changes, numbers, fits):
    own = budget(**changes)
    names = (
        "total_rad total_rss_rad needed_rad needed_rss_rad available_rad usable_share margin_rad margin_rss_rad ratio "
        "ratio_rss largest_magnification largest_magnification_rss"
    )
    found = [getattr(own, name) for name in names.split()]
    assert found == pytest.approx([float(v) for v in numbers.split()], rel=1e-9, abs=1e-18)
    assert (own.fits, own.fits_rss) == fits


@pytest.mark.parametrize(
    ("name", "label"), [("x", "axis x"), ("y", "axis y"), ("actuator 2", "actuator 2"), ("left", "left")]
)
def test_an_axis_is_called_one_and_an_actuator_by_its_name(name, label):
    assert budget(name=name).label == label


@pytest.mark.parametrize("angle", ["optical", "mechanical"])
def test_the_budget_of_a_turned_tripod_has_the_lines_of_each_actuator(angle):
    """From the rows of the pseudo-inverse: what each actuator does for a line of sight, without piston."""
    wanted = StrokeDemand((3e-4, 1e-4), (7e-5, 2e-5), (4e-5, 5e-5), (6e-6, 8e-6), point_ahead_on_mirror=True)
    tripod = Geometry("mechanical", 0.6, 5.0, 0.35, ((1.0, 0.1), (-0.05, 0.9)), "tripod", 0.04)
    found = stroke_budget(tripod, wanted, travel_rad=0.02, travel_angle=angle)
    turn = np.array([[math.cos(0.35), -math.sin(0.35)], [math.sin(0.35), math.cos(0.35)]])
    seen = turn @ np.diag([2.0, 2.0 * math.cos(0.6)]) @ [[1.0, 0.1], [-0.05, 0.9]] / 5.0
    tilts = -2.0 / 3.0 * np.array([np.cos(THIRDS), np.sin(THIRDS)])
    rows = np.linalg.pinv(tilts) @ np.linalg.inv(seen) * (2.0 if angle == "optical" else 1.0)
    assert [each.name for each in found] == ["actuator 1", "actuator 2", "actuator 3"] == [e.label for e in found]
    for each, row in zip(found, rows, strict=True):
        size = np.hypot(*row)
        along = np.abs(row) / size
        assert each.mirror_per_line_of_sight == pytest.approx(size, rel=1e-9)
        values = [along @ pair for pair in ((3e-4, 1e-4), (7e-5, 2e-5), (4e-5, 5e-5), (6e-6, 8e-6))]
        assert [line.value for line in each.lines] == pytest.approx(values, rel=1e-9)
        assert [line.name for line in each.lines] == [
            *("Body pointing", "Point-ahead", "Bias and alignment", "Line-of-sight rate lag")
        ]
        assert {line.regime for line in each.lines} == {"both axes at their worst together"}
        assert each.lines[1].basis == (
            f"half range at the line of sight: x 70 µrad, y 20 µrad; along ({along[0]:.3g}, {along[1]:.3g})"
        )
        assert (each.travel_angle, each.travel_rad, each.usable_travel_rad) == (angle, 0.02, 0.02)


def test_a_usable_travel_a_hair_beyond_the_travel_is_told_in_digits():
    with pytest.raises(ValueError, match=r"usable_travel_rad is 10\.0000001 mrad, of a travel of 10 mrad from stop"):
        stroke_budget(
            Geometry("optical"), demand(), travel_rad=0.01, travel_angle="optical", usable_travel_rad=0.0100000001
        )
