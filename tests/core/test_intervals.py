"""Intervals: what few clusters take off, by tables of Student's t."""

import math

import pytest

from microrad.core.intervals import counted, student


# quantiles of Student's t at 97.5 %, as printed in any table: one and four degrees of freedom, and the normal one
@pytest.mark.parametrize(("clusters", "quantile"), [(2, 12.7062), (5, 2.7764)])
def test_few_clusters_count_for_less_by_a_freedom_less_than_there_are_of_them(clusters, quantile):
    assert counted(clusters, 0.95) == pytest.approx((1.95996 / quantile) ** 2, rel=1e-4, abs=0.0)
    assert counted(1, 0.95) == 1.0
    assert student(0.95, math.inf) == pytest.approx(1.95996, rel=1e-5, abs=0.0)
