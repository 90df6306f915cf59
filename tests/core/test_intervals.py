"""Intervals: what few clusters take off, by tables of Student's t."""

import math

import numpy as np
import pytest
from scipy.stats import beta, norm, t

from microrad.core.intervals import binomial_band, clustered_band, counted, student


# quantiles of Student's t at 97.5 %, as printed in any table: one and four degrees of freedom, and the normal one
@pytest.mark.parametrize(("clusters", "quantile"), [(2, 12.7062), (5, 2.7764)])
def test_few_clusters_count_for_less_by_a_freedom_less_than_there_are_of_them(clusters, quantile):
    assert counted(clusters, 0.95) == pytest.approx((1.95996 / quantile) ** 2, rel=1e-4, abs=0.0)
    assert counted(1, 0.95) == 1.0
    assert student(0.95, math.inf) == pytest.approx(1.95996, rel=1e-5, abs=0.0)


@pytest.mark.parametrize(
    ("hits", "trials", "confidence"), [(3, 17, 0.9), (0, 12, 0.95), (9, 9, 0.99), (2.5, 40.25, 0.8)]
)
def test_a_share_lies_between_where_as_many_hits_or_as_few_are_as_rare_as_asked(hits, trials, confidence):
    (low, *_), (high, *_) = binomial_band(np.array([hits, 1.0]), np.array([trials, 2.0]), confidence)
    beyond = (1 - confidence) / 2
    assert low == pytest.approx(beta.ppf(beyond, hits, trials - hits + 1) if hits else 0.0, rel=1e-9)
    assert high == pytest.approx(beta.ppf(1 - beyond, hits + 1, trials - hits) if hits < trials else 1.0, rel=1e-9)


@pytest.mark.parametrize(
    ("shares", "each", "trials"),
    [
        ([0.2, 0.5, 0.35, 0.15], 60, None), ([0.3, 0.3001, 0.2999], 50, 150.0), ([0.0, 0.0], 7, 14.0),
        ([1.0, 1.0, 1.0], 5, 15.0),
    ],
)  # fmt: skip
def test_clusters_that_scatter_count_as_the_trials_that_would_scatter_so_and_no_more_than_all(shares, each, trials):
    found, mean = clustered_band(np.array(shares), each, 0.95), np.mean(shares)
    if trials is None:
        spread = np.sum((np.array(shares) - mean) ** 2) / 3 / 4
        trials = mean * (1 - mean) / spread * (norm.ppf(0.975) / t.ppf(0.975, 3)) ** 2
        assert trials < 240
    low, high = binomial_band(np.array([mean * trials]), np.array([trials]), 0.95)
    assert found == pytest.approx((low[0], high[0]), rel=1e-12)
    assert clustered_band(np.array([shares[0]]), each, 0.95) == (0.0, 1.0)


@pytest.mark.parametrize(("confidence", "freedom"), [(0.9, 3), (0.99, 7.5), (0.5, 1)])
def test_students_half_width_is_its_quantile_on_both_sides(confidence, freedom):
    assert student(confidence, freedom) == pytest.approx(t.ppf(0.5 + confidence / 2, freedom), rel=1e-9)
