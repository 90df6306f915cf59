"""Roots beside those of SciPy, to the last bit."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from microrad.core.roots import root

SHAPES: list[Callable[[float], float]] = [
    lambda x: math.exp(x) - 1.5,
    lambda x: x**9,
    lambda x: math.atan(7.0 * x) - 0.3,
    lambda x: math.copysign(1.0, x - 0.2),
    lambda x: x * abs(x) - 1e-9,
]


@given(
    of=st.sampled_from(SHAPES),
    low=st.floats(-9.0, 1.0),
    high=st.floats(-1.0, 9.0),
    tolerance=st.sampled_from([{}, {"xtol": 1e-9}, {"xtol": 1e-6, "rtol": 1e-3}]),
)
def test_the_same_bits_as_scipy(
    of: Callable[[float], float], low: float, high: float, tolerance: dict[str, float]
) -> None:
    if min(of(low), of(high)) <= 0.0 <= max(of(low), of(high)):
        assert root(of, low, high, **tolerance) == brentq(of, low, high, maxiter=1000, **tolerance)
    else:
        with pytest.raises(ValueError, match="no sign changes"):
            root(of, low, high, **tolerance)


def test_an_end_that_is_the_root_and_a_function_that_is_nan() -> None:
    assert root(lambda x: x, 0.0, 1.0) == root(lambda x: x, -1.0, 0.0) == 0.0
    with pytest.raises(ValueError, match="nan at 1"):
        root(lambda x: x if x < 1.0 else math.nan, -1.0, 1.0)
