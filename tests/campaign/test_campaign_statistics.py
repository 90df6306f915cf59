"""Statistics of rows: quantiles against those of NumPy, and every interval against how often it holds the truth."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from microrad.campaign.definition.outputs import OUTPUTS
from microrad.campaign.records import Progress
from microrad.campaign.statistics.intervals import (
    Moments,
    _tails,
    block_means,
    histogram,
    mean_interval,
    moments,
    ordered,
    output_summary,
    proportion_interval,
    quantile_interval,
    share_interval,
)
from microrad.campaign.statistics.summary import progress
from microrad.core.arrays import Floats
from truths import philox

SHARES = (0.0, 1e-3, 0.01, 0.3, 0.5, 0.9, 0.997, 0.9999, 1.0)


# ------------------------------------------------------------------------------------------------------------ quantiles
DATA = {
    "normal about 0": lambda r: r.normal(size=30_000),
    "narrow about 12": lambda r: 12.0 + 0.001 * r.normal(size=5000),
    "twenty decades": lambda r: np.exp(10.0 * r.normal(size=20_000)),
    "counts": lambda r: r.poisson(2.0, 3000).astype(float),
    "negative": lambda r: -r.exponential(3e-6, 7000),
    "one": lambda r: np.array([-4.2e-6]),
}


@pytest.mark.promise("campaigns-31")
@pytest.mark.parametrize("kind", DATA)
def test_quantiles_are_those_of_numpy(kind: str) -> None:
    values = DATA[kind](philox(1))
    exact = np.quantile(values, SHARES, method="inverted_cdf")
    assert [ordered(values).quantile(share) for share in SHARES] == exact.tolist()


def test_weighted_quantiles_are_those_of_repeated_values() -> None:
    values = philox(2).normal(size=500)
    weights = philox(3).integers(1, 9, 500).astype(float)
    weighted, repeated = ordered(values, weights), ordered(np.repeat(values, weights.astype(int)))
    for share in SHARES:
        assert weighted.quantile(share) == repeated.quantile(share)
    assert weighted.quantile(0.3) != ordered(values).quantile(0.3)
    assert weighted.weight[-1] == weights.sum()


def test_values_without_end_zeros_and_nothing() -> None:
    values = np.array([-math.inf, 0.0, 0.0, 1e-31, math.nan, 5.0, 1e31, math.inf])
    rows = ordered(values)
    assert rows.weight[-1] == rows.values.size == 7
    assert [rows.quantile(share) for share in (0.0, 0.4, 0.7, 1.0)] == [-math.inf, 0.0, 5.0, math.inf]
    edges, counts = histogram(values, np.ones(8), 5)
    assert (edges[0], edges[-1], counts.sum()) == (0.0, 1e31, 5.0)
    assert math.isnan(ordered(np.zeros(0)).quantile(0.5))
    assert histogram(np.zeros(0), np.zeros(0), 5)[0].size == 0
    assert histogram(np.array([math.inf]), np.ones(1), 5)[1].size == 0


@pytest.mark.parametrize("kind", ["normal about 0", "narrow about 12", "counts"])
def test_picture_has_all_rows_where_they_are(kind: str) -> None:
    values = DATA[kind](philox(6))
    edges, counts = histogram(values, np.full(values.size, 2.0), 8)
    assert (edges[0], edges[-1]) == (values.min(), values.max())
    assert counts.tolist() == (2.0 * np.histogram(values, edges)[0]).tolist()
    same, one = histogram(np.full(9, 3.3), np.ones(9), 8)
    assert same[0] < 3.3 < same[1]
    assert one.tolist() == [9.0]


@pytest.mark.parametrize("value", [3.3, -2e-6, 1e300])
def test_picture_of_values_a_step_of_rounding_apart_has_them_all(value: float) -> None:
    values = np.array([value, np.nextafter(value, math.inf), value])
    edges, counts = histogram(values, np.array([1.0, 2.0, 4.0]))
    assert (edges.size, counts.size) == (41, 40)
    assert (edges[0], edges[-1]) == (values.min(), values.max()) and edges[0] < edges[-1]
    assert np.all(np.diff(edges) >= 0.0)
    assert counts.sum() == 7.0


# -------------------------------------------------------------------------------------------------------------- moments
@pytest.mark.promise("campaigns-31")
def test_moments_are_those_of_numpy_even_far_from_zero() -> None:
    values = 1e9 + philox(7).normal(size=1000)
    found = moments(values)
    exact = np.var(values - 1e9, ddof=1)
    assert found.count == 1000
    assert_allclose(found.mean, np.mean(values), rtol=1e-15)
    assert_allclose(found.variance, exact, rtol=1e-6)
    assert_allclose(found.mean_variance, found.variance / 1000, rtol=1e-12)
    assert (found.least, found.most) == (values.min(), values.max())
    naive = np.mean(values**2) - np.mean(values) ** 2
    assert abs(naive - exact) > 0.1  # what a plain sum of squares would give


def test_weighted_moments() -> None:
    values, weights = philox(8).normal(5.0, 2.0, 300), philox(9).exponential(size=300)
    whole = moments(values, weights)
    assert_allclose(whole.mean, np.average(values, weights=weights), rtol=1e-13)
    assert_allclose(whole.variance, np.cov(values, aweights=weights), rtol=1e-12)
    by_hand = np.sum((weights * (values - whole.mean)) ** 2) / weights.sum() ** 2 * 300 / 299
    assert_allclose(whole.mean_variance, by_hand, rtol=1e-12)
    assert abs(whole.mean - values.mean()) > 1e-3


def test_moments_of_nothing_one_the_same_and_without_end() -> None:
    assert moments(np.array([math.nan])).count == 0
    assert moments(np.array([2.0])).mean == 2.0
    assert math.isnan(moments(np.array([2.0])).deviation)
    same = moments(np.full(12, 0.1))
    assert (same.mean, same.deviation) == (0.1, 0.0)
    assert moments(np.array([1.0, -math.inf])).least == -math.inf
    assert math.isnan(moments(np.array([1.0, math.inf, 1.0, 1.0])).deviation)


# ------------------------------------------------------------------------------------------------------------- progress
@pytest.mark.promise("campaigns-46")
@pytest.mark.parametrize(
    ("state", "written", "total", "left_s", "said"),
    [
        ("running", True, 2048, 384.0, "running"),
        ("running", False, 2048, 384.0, "stopped"),
        ("complete", False, 512, 0.0, "complete"),
    ],
)
def test_the_time_left_is_that_of_the_rows_that_are_not_done(state, written, total, left_s, said) -> None:
    found = progress(512, 2048, {"seconds": 128.0, "state": state}, written)
    assert found == Progress(512, total, 128.0, 4.0, left_s, said)


# ------------------------------------------------------------------------------------------------------------ intervals
@pytest.mark.promise("campaigns-32")
def test_mean_of_independent_rows_has_students_interval() -> None:
    values = philox(10).normal(size=12)
    found = mean_interval(moments(values), 0.9)
    exact = stats.ttest_1samp(values, 0.0).confidence_interval(0.9)
    assert_allclose([found.low, found.high], [exact.low, exact.high], rtol=1e-12)
    assert math.isnan(mean_interval(moments(values[:1]), 0.9).low)


@pytest.mark.promise("campaigns-21", "campaigns-32")
def test_blocks_of_sobol_rows_give_a_narrower_interval_that_holds() -> None:
    held, narrower = 0, 0
    for seed in range(60):
        points = np.concatenate([stats.qmc.Sobol(2, rng=1000 * seed + block).random(32) for block in range(8)])
        values = np.exp(points[:, 0]) + points[:, 1] ** 2
        by_row = mean_interval(moments(values), 0.95)
        by_block = mean_interval(moments(values), 0.95, block_means(np.arange(256.0), values, np.ones(256), 32))
        held += by_block.low <= math.e - 1.0 + 1.0 / 3.0 <= by_block.high
        narrower += by_block.high - by_block.low < 0.2 * (by_row.high - by_row.low)
    assert 51 <= held <= 60
    assert narrower == 60


@pytest.mark.promise("campaigns-32")
def test_shares_have_clopper_and_pearsons_interval() -> None:
    for hits, trials in ((0, 20), (3, 20), (20, 20), (1, 5000)):
        found = proportion_interval(hits, trials, 0.99)
        exact = stats.binomtest(hits, trials).proportion_ci(0.99)
        assert_allclose([found.value, found.low, found.high], [hits / trials, exact.low, exact.high], rtol=1e-9)
        rows = share_interval(moments((np.arange(trials) < hits).astype(float)), 0.99)
        assert_allclose([rows.low, rows.high], [exact.low, exact.high], rtol=1e-9)
    assert math.isnan(share_interval(Moments(), 0.99).value)


@pytest.mark.promise("campaigns-32")
def test_interval_of_a_weighted_share_holds_where_that_without_weights_does_not() -> None:
    held = plain = 0
    for seed in range(400):
        x = philox(1000 * 11 + seed).exponential(2.0, 500)  # drawn wider than it is distributed
        weights, hit = 2.0 * np.exp(-x / 2.0), (x > 2.0).astype(float)
        found = share_interval(moments(hit, weights), 0.95)
        held += found.low <= math.exp(-2.0) <= found.high
        narrow = proportion_interval(found.value * 1e4, 1e4, 0.95)
        plain += narrow.low <= math.exp(-2.0) <= narrow.high
    assert held >= 370
    assert plain < 300


@pytest.mark.promise("campaigns-32")
def test_quantile_interval_has_the_order_statistics_that_the_binomial_distribution_says() -> None:
    values = np.sort(philox(12).normal(size=200))
    for share in (0.1, 0.5, 0.9):
        found = quantile_interval(ordered(values), share, 0.95)
        low = int(stats.binom.ppf(0.025, 200, share)) - 1
        high = int(stats.binom.ppf(0.975, 200, share))
        assert [found.low, found.high] == values[[low, high]].tolist()


def test_an_end_that_few_rows_cannot_have_is_not_known() -> None:
    values = np.arange(1.0, 101.0)
    assert math.isnan(quantile_interval(ordered(values), 0.003, 0.95).low)
    assert not math.isnan(quantile_interval(ordered(values), 0.003, 0.95).high)
    assert math.isnan(quantile_interval(ordered(values), 0.99, 0.95).high)
    assert quantile_interval(ordered(values), 0.5, 0.95).low == pytest.approx(40.0, rel=1e-3)
    assert math.isnan(quantile_interval(ordered(np.zeros(0)), 0.5, 0.95).value)


def test_interval_of_a_weighted_quantile_holds() -> None:
    held, widths = 0, []
    for seed in range(400):
        x = philox(1000 * 13 + seed).exponential(2.0, 400)
        found = quantile_interval(ordered(x, 2.0 * np.exp(-x / 2.0)), 0.9, 0.95)
        held += found.low <= math.log(10.0) <= found.high
        widths.append(found.high - found.low)
    assert 370 <= held <= 398
    assert np.median(widths) < 1.2


@pytest.mark.parametrize("share", [0.003, 0.05, 0.5, 0.95, 0.997])
@pytest.mark.parametrize("drawn", [4.7, 5.0, 5.3])
def test_ends_of_a_weighted_quantile_are_those_of_a_look_at_each_rank(drawn: float, share: float) -> None:
    known = set()
    for seed in range(60):
        x = philox(1000 * 17 + seed).normal(drawn, 0.15, 5 + seed)
        weights = np.exp((((x - drawn) / 0.15) ** 2 - ((x - 5.0) / 0.15) ** 2) / 2.0)
        rows = ordered(x, weights)
        few, many = np.array([_tails(rows, rank, share) for rank in range(x.size + 1)]).T
        within = range(1, x.size)
        first = min((rank for rank in within if few[rank] >= 0.025), default=x.size)
        last = min((rank for rank in within if many[rank] < 0.025), default=x.size)
        low = rows.values[first - 1] if first > 1 or few[0] < 0.025 else math.nan
        high = rows.values[last - 1] if last < x.size or many[-1] < 0.025 else math.nan
        found = quantile_interval(rows, share, 0.95)
        np.testing.assert_array_equal([found.low, found.high], [low, high])
        known.add((math.isnan(low), math.isnan(high)))
    assert known - {(True, True)}


# ----------------------------------------------------------------------------------------------------------- one output
def columns(values: Floats, rows: Floats | None = None) -> dict[str, Floats]:
    numbers = np.arange(values.size, dtype=float) if rows is None else rows
    return {"row": numbers, "weight": np.ones(values.size), "margin": values}


@pytest.mark.promise("campaigns-21")
def test_an_output_has_a_summary() -> None:
    values = philox(14).normal(size=256)
    values[[3, 77]] = math.nan
    summary = output_summary(OUTPUTS["margin"], columns(values), (0.5, 0.003), 0.95, block=64)
    assert (summary.rows, summary.counts.sum()) == (254, 254.0)
    assert summary.quantiles[0.5].low < summary.quantiles[0.5].value < summary.quantiles[0.5].high
    assert (summary.least, summary.most) == (np.nanmin(values), np.nanmax(values))
    means = [np.nanmean(part) for part in values.reshape(4, 64)]
    exact = stats.ttest_1samp(means, 0.0).confidence_interval(0.95)
    assert_allclose(summary.mean.high - summary.mean.low, exact.high - exact.low, rtol=1e-12)


def test_a_block_with_missing_chunks_is_no_draw_of_the_mean() -> None:
    rows = np.r_[0:96, 160:256].astype(float)  # the second half of a block and the first half of the next are missing
    found = block_means(rows, np.where(rows < 64, 0.0, 1.0), np.ones(rows.size), 64)
    assert (found.count, found.mean) == (2, 0.5)


def test_no_good_rows_have_a_summary() -> None:
    summary = output_summary(OUTPUTS["margin"], columns(np.full(16, math.nan)), (0.5,), 0.95, block=16)
    assert summary.rows == summary.counts.size == 0
    assert math.isnan(summary.mean.value)
    assert math.isnan(summary.quantiles[0.5].value)


@pytest.mark.parametrize("seed", range(20))
def test_a_rare_share_does_not_hang_on_heavy_rows_far_from_it(seed: int) -> None:
    value = philox(seed).normal(4.4, 0.15, 1024)  # drawn for a normal of mean 5: rows near 5 weigh thousands
    weight = np.exp((((value - 4.4) / 0.15) ** 2 - ((value - 5.0) / 0.15) ** 2) / 2.0)
    hit, truth = (value < 4.56).astype(float), stats.norm.cdf(4.56, 5.0, 0.15)
    found, missed = share_interval(moments(hit, weight), 0.99), share_interval(moments(1.0 - hit, weight), 0.99)
    assert found.low < truth < found.high < 1.4 * truth
    assert missed.low < 1.0 - truth < missed.high and missed.value == pytest.approx(1.0 - found.value, abs=1e-15)
    alone = np.sum(weight * hit) / np.sum(weight)
    assert abs(found.value / truth - 1.0) < 0.25 and abs(alone / truth - 1.0) > abs(found.value / truth - 1.0)
