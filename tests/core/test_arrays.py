"""What users give as an array of numbers: what is taken, and what is refused with which words."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from microrad.core.arrays import reals
from microrad.core.budget import Line, root_sum_square, total_db
from microrad.core.earth import place_m
from microrad.core.labelled import TEXT, Group, variables


@pytest.mark.parametrize(
    "values",
    [
        3,
        True,
        [],
        [1e30, -1e30],
        [math.nan, math.inf, -math.inf],
        [[1, 2], [3, 4]],
        np.arange(3, dtype=np.uint8),
        range(4),
    ],
)
def test_numbers_up_to_the_largest_are_taken_and_what_is_not_finite_passes(values):
    made = reals(values, "drive")
    assert made.dtype == np.float64
    np.testing.assert_array_equal(made, np.asarray(values))


@pytest.mark.parametrize("values", [1.001e30, [0.0, -1.001e30], [math.nan, 2e30], [-math.inf, 10**40]])
def test_a_number_beyond_the_largest_is_refused_beside_any(values):
    with pytest.raises(
        ValueError, match=r"^drive: a number is beyond 1e\+30, which nothing here is in SI units; check unit"
    ):
        reals(values, "drive")
    assert np.shape(reals(values, "drive", most=math.inf)) == np.shape(values)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_largest_number_is_that_which_is_asked_for(sign):
    assert reals([sign * 5.0], "drive", most=5.0).tolist() == [sign * 5.0]
    with pytest.raises(KeyError, match="a number is beyond 5, which"):
        reals([sign * 5.001], "drive", KeyError, most=5.0)


@pytest.mark.parametrize(
    "values",
    [
        "1",
        ["1"],
        [b"1"],
        [1j],
        [None, object()],
        [[1.0], [1.0, 2.0]],
        np.zeros(2, "M8[s]"),
        np.zeros(2, "m8[s]"),
        10**400,
        {},
    ],
)
def test_what_is_no_array_of_real_numbers_is_refused(values):
    with pytest.raises(
        ValueError, match=r"^drive: no array of real numbers; give numbers, or lists of them that are eq"
    ):
        reals(values, "drive")


@pytest.mark.parametrize(("latitude", "height_m", "axis_m", "north_m"), [
    (0.0, 0.0, 6378137.0, 0.0), (90.0, 100.0, 0.0, 6356852.314245), (-90.0, -50.0, 0.0, -6356702.314245),
    (45.0, 0.0, 4517590.878849, 4487348.408866), (-45.0, 1000.0, 4518297.985631, -4488055.515647),
])  # fmt: skip
def test_a_place_on_the_ellipsoid_lies_north_or_south_of_the_equator(latitude, height_m, axis_m, north_m):
    assert place_m(math.radians(latitude), height_m) == pytest.approx((axis_m, north_m), rel=1e-10, abs=1e-6)


def test_variables_are_of_attributes_functions_and_arrays_with_none_as_nan_and_texts_as_they_are():
    of = [SimpleNamespace(a=1.5, b=None, c="x", d=3), SimpleNamespace(a=2.5, b=4.0, c="yy", d=-7)]
    found = variables(
        "row", of, a=("m", "length", "a"), b=("s", "time", "b"), c=(TEXT, "name", "c"),
        d=("1", "twice", lambda each: 2 * each.d), e=("W", "power", [7, 8]), f=(TEXT, "both", ("p", "qq")),
    )  # fmt: skip
    assert [*found] == [*"abcdef"]
    assert [v.values.dtype.kind for v in found.values()] == [*"ffOiiO"]
    assert [v.units for v in found.values()] == ["m", "s", "1", "1", "W", "1"]
    assert [v.dims for v in found.values()] == [("row",)] * 6
    np.testing.assert_array_equal(found["b"].values, [math.nan, 4.0])
    assert [found[k].values.tolist() for k in "acdef"] == [[1.5, 2.5], ["x", "yy"], [6, -14], [7, 8], ["p", "qq"]]
    assert found["d"].attributes == {"units": "1", "long_name": "twice"}
    assert variables("x y", z=("m", "map", np.ones((2, 3))))["z"].dims == ("x", "y")


def test_a_group_is_a_data_set_with_its_coordinates_and_attributes():
    part = variables("t", x=("m", "place", [3.0, 5.0])), variables("t", t=("s", "time", [0.5, 0.75]))
    made = Group(*part, {"title": "both", "n": 3}).to_xarray()
    assert (list(made.data_vars), list(made.coords), made.attrs) == (["x"], ["t"], {"title": "both", "n": 3})
    assert (made.x.attrs, made.t.attrs) == ({"units": "m", "long_name": "place"}, {"units": "s", "long_name": "time"})
    assert (made.x.values.tolist(), made.t.values.tolist()) == ([3.0, 5.0], [0.5, 0.75])
    assert Group({}) == Group({}, {}, {})


LINES = {
    "a": (3.0, "dB"),
    "b": (-7.5, "dB"),
    "c": (30.0, "dBm"),
    "d": (2.0, "dBW"),
    "e": (4.0, "urad"),
    "f": (3, "urad"),
}
LINES |= {"g": (1.0, "s")}


@pytest.mark.parametrize(
    ("function", "names", "expected"),
    [
        (total_db, "ab", -4.5), (total_db, "acb", 25.5), (total_db, "bd", -5.5), (total_db, "", 0.0),
        (total_db, "aeb", '"e" is in urad: only lines in dB, dBm or dBW add up in decibels'),
        (total_db, "acbd", "c, d: only one line of a sum in decibels may be a power level"),
        (total_db, "cc", "c, c: only one line of a sum in decibels may be a power level"),
        (total_db, "cdg", '"g" is in s: only lines in dB, dBm or dBW add up in decibels'),
        (root_sum_square, "ef", 5.0), (root_sum_square, "eee", 48.0**0.5), (root_sum_square, "g", 1.0),
        (root_sum_square, "", "a root sum square needs lines in one linear unit, these are in none"),
        (root_sum_square, "gef", "a root sum square needs lines in one linear unit, these are in s, urad"),
        (root_sum_square, "ab", "a root sum square needs lines in one linear unit, these are in dB"),
        (root_sum_square, "cc", "a root sum square needs lines in one linear unit, these are in dBm"),
        (root_sum_square, "d", "a root sum square needs lines in one linear unit, these are in dBW"),
    ],
)  # fmt: skip
def test_lines_of_a_budget_add_up_in_their_unit_or_not_at_all(function, names, expected):
    lines = (Line(name, *LINES[name], "", "", "") for name in names)
    if isinstance(expected, float):
        assert function(lines) == pytest.approx(expected)
        return
    with pytest.raises(ValueError) as refused:
        function(lines)
    assert str(refused.value) == expected
