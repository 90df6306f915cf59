"""What users give as an array of numbers: what is taken, and what is refused with which words."""

import math

import numpy as np
import pytest

from microrad.core.arrays import reals


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
