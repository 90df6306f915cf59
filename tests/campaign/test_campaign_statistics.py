"""Statistics of rows: the sketch against exact quantiles, and every interval against how often it holds the truth."""

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from microrad.campaign.definition.outputs import OUTPUTS
from microrad.campaign.statistics.intervals import (
    Fold,
    Moments,
    mean_interval,
    moments,
    proportion_interval,
    quantile_interval,
    share_interval,
)
from microrad.campaign.statistics.sketch import LARGEST, RELATIVE_ERROR, SMALLEST, Sketch
from microrad.core.arrays import Floats
from truths import philox

SHARES = (0.0, 1e-3, 0.01, 0.3, 0.5, 0.9, 0.997, 0.9999, 1.0)


def sketched(values: Floats, weights: Floats | None = None) -> Sketch:
    sketch = Sketch()
    sketch.add(values, weights)
    return sketch


# --------------------------------------------------------------------------------------------------------------- sketch
DATA = {
    "normal about 0": lambda r: r.normal(size=30_000),
    "narrow about 12": lambda r: 12.0 + 0.001 * r.normal(size=5000),
    "twenty decades": lambda r: np.exp(10.0 * r.normal(size=20_000)),
    "counts": lambda r: r.poisson(2.0, 3000).astype(float),
    "negative": lambda r: -r.exponential(3e-6, 7000),
    "one": lambda r: np.array([-4.2e-6]),
}


@pytest.mark.parametrize("kind", DATA)
def test_quantiles_are_as_near_as_promised(kind: str) -> None:
    values = DATA[kind](philox(1))
    sketch = sketched(values)
    exact = np.quantile(values, SHARES, method="inverted_cdf")
    found = np.array([sketch.quantile(share) for share in SHARES])
    assert np.all(np.abs(found - exact) <= sketch.error * (1.0 + 1e-9) * np.abs(exact))
    assert sketch.error == RELATIVE_ERROR < 1e-3
    if kind == "narrow about 12":  # it is a sketch, not the values
        assert np.max(np.abs(found - exact)) > 0.0


def test_weighted_quantiles_are_those_of_repeated_values() -> None:
    values = philox(2).normal(size=500)
    weights = philox(3).integers(1, 9, 500).astype(float)
    weighted, repeated = sketched(values, weights), sketched(np.repeat(values, weights.astype(int)))
    for share in SHARES:
        assert weighted.quantile(share) == repeated.quantile(share)
    assert weighted.quantile(0.3) != sketched(values).quantile(0.3)
    assert weighted.weight == weights.sum()


def test_parts_merge_into_the_whole_without_loss() -> None:
    values = philox(4).normal(3.0, 2.0, 20_000)
    whole, merged, chunked = sketched(values), sketched(values[:77]), Sketch()
    merged.merge(sketched(values[77:9000]))
    merged.merge(sketched(values[9000:]))
    for begin in range(0, values.size, 64):
        chunked.add(values[begin : begin + 64])
    for other in (merged, chunked):
        assert other.bins == whole.bins
        assert all(other.quantile(share) == whole.quantile(share) for share in SHARES)
    assert sketched(values[:77]).quantile(0.5) != whole.quantile(0.5)


def test_bins_are_bounded_for_any_data() -> None:
    random = philox(5)
    sketch = Sketch()
    for _ in range(4):
        sketch.add(random.choice([-1.0, 1.0], 300_000) * 10.0 ** random.uniform(-40.0, 40.0, 300_000))
    most = sketch.bins
    assert 300_000 < most < 600_000
    narrow = sketched(random.normal(3.0, 0.1, 300_000))
    assert narrow.bins < 3000


def test_values_without_end_zeros_and_nothing() -> None:
    sketch = sketched(np.array([-math.inf, 0.0, 0.0, SMALLEST / 10.0, math.nan, 5.0, LARGEST * 10.0, math.inf]))
    assert sketch.weight == 7.0
    assert [sketch.quantile(share) for share in (0.0, 0.5, 1.0)] == [-math.inf, 0.0, math.inf]
    assert sketch.quantile(0.7) == pytest.approx(5.0, rel=RELATIVE_ERROR)
    edges, counts = sketch.histogram(5)
    assert (edges[0], counts.sum()) == (0.0, 4.0)
    assert edges[-1] == pytest.approx(5.0, rel=RELATIVE_ERROR)
    assert math.isnan(Sketch().quantile(0.5))
    assert Sketch().histogram(5)[0].size == 0
    assert sketched(np.array([math.inf])).histogram(5)[1].size == 0


@pytest.mark.parametrize("kind", ["normal about 0", "narrow about 12", "counts"])
def test_picture_has_all_rows_where_they_are(kind: str) -> None:
    values = DATA[kind](philox(6))
    edges, counts = sketched(values).histogram(8)
    assert_allclose(counts.sum(), values.size, rtol=1e-12)
    exact = np.histogram(values, edges + 1e-9 * np.array([-1.0, *[0.0] * 7, 1.0]))[0]
    tolerance = 0.35 if kind == "narrow about 12" else 0.005  # the first is hardly wider than a bin of the sketch
    if kind != "counts":  # whole numbers lie on edges
        assert np.max(np.abs(counts - exact)) < tolerance * values.size
    same, one = sketched(np.full(9, 3.3)).histogram(8)
    assert same[0] < 3.3 < same[1]
    assert one.tolist() == [9.0]


# -------------------------------------------------------------------------------------------------------------- moments
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


def test_weighted_moments_and_their_parts() -> None:
    values, weights = philox(8).normal(5.0, 2.0, 300), philox(9).exponential(size=300)
    whole, parts = moments(values, weights), Moments()
    for begin, end in pairwise((0, 1, 90, 91, 300)):
        parts = parts.merged(moments(values[begin:end], weights[begin:end]))
    for name in ("count", "weight", "weight_square", "mean", "spread", "square", "least", "most"):
        assert_allclose(getattr(parts, name), getattr(whole, name), rtol=1e-12)
    assert_allclose(whole.mean, np.average(values, weights=weights), rtol=1e-13)
    assert_allclose(whole.variance, np.cov(values, aweights=weights), rtol=1e-12)
    by_hand = np.sum((weights * (values - whole.mean)) ** 2) / weights.sum() ** 2 * 300 / 299
    assert_allclose([whole.mean_variance, parts.mean_variance], by_hand, rtol=1e-12)
    assert abs(whole.mean - values.mean()) > 1e-3


def test_moments_of_nothing_one_the_same_and_without_end() -> None:
    assert moments(np.array([math.nan])).count == 0
    assert Moments().merged(moments(np.array([2.0]))).mean == 2.0
    assert math.isnan(moments(np.array([2.0])).deviation)
    same = moments(np.full(7, 0.1)).merged(moments(np.full(5, 0.1)))
    assert (same.mean, same.deviation) == (0.1, 0.0)
    assert moments(np.array([1.0, -math.inf])).least == -math.inf
    assert math.isnan(moments(np.array([1.0, math.inf])).merged(moments(np.ones(2))).deviation)


# ------------------------------------------------------------------------------------------------------------ intervals
def test_mean_of_independent_rows_has_students_interval() -> None:
    values = philox(10).normal(size=12)
    found = mean_interval(moments(values), 0.9)
    exact = stats.ttest_1samp(values, 0.0).confidence_interval(0.9)
    assert_allclose([found.low, found.high], [exact.low, exact.high], rtol=1e-12)
    assert math.isnan(mean_interval(moments(values[:1]), 0.9).low)


def test_blocks_of_sobol_rows_give_a_narrower_interval_that_holds() -> None:
    held, narrower = 0, 0
    for seed in range(60):
        fold = Fold(block=32)
        for block in range(8):
            points = stats.qmc.Sobol(2, rng=1000 * seed + block).random(32)
            fold.add(block * 32, np.exp(points[:, 0]) + points[:, 1] ** 2)
        by_block, by_row = fold.mean(0.95), mean_interval(fold.moments, 0.95)
        held += by_block.low <= math.e - 1.0 + 1.0 / 3.0 <= by_block.high
        narrower += by_block.high - by_block.low < 0.2 * (by_row.high - by_row.low)
    assert 51 <= held <= 60
    assert narrower == 60


def test_shares_have_clopper_and_pearsons_interval() -> None:
    for hits, trials in ((0, 20), (3, 20), (20, 20), (1, 5000)):
        found = proportion_interval(hits, trials, 0.99)
        exact = stats.binomtest(hits, trials).proportion_ci(0.99)
        assert_allclose([found.value, found.low, found.high], [hits / trials, exact.low, exact.high], rtol=1e-9)
        rows = share_interval(moments((np.arange(trials) < hits).astype(float)), 0.99)
        assert_allclose([rows.low, rows.high], [exact.low, exact.high], rtol=1e-9)
    assert math.isnan(share_interval(Moments(), 0.99).value)


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


def test_quantile_interval_has_the_order_statistics_that_the_binomial_distribution_says() -> None:
    values = np.sort(philox(12).normal(size=200))
    for share in (0.1, 0.5, 0.9):
        found = quantile_interval(sketched(values), share, 0.95)
        low = int(stats.binom.ppf(0.025, 200, share)) - 1
        high = int(stats.binom.ppf(0.975, 200, share))
        assert_allclose([found.low, found.high], values[[low, high]], rtol=2e-3)
        assert found.low <= values[low]  # to the sketch's error outwards
        assert found.high >= values[high]
        assert values[low - 1] < found.low
        assert found.high < values[high + 1]


def test_an_end_that_few_rows_cannot_have_is_not_known() -> None:
    values = np.arange(1.0, 101.0)
    assert math.isnan(quantile_interval(sketched(values), 0.003, 0.95).low)
    assert not math.isnan(quantile_interval(sketched(values), 0.003, 0.95).high)
    assert math.isnan(quantile_interval(sketched(values), 0.99, 0.95).high)
    assert quantile_interval(sketched(values), 0.5, 0.95).low == pytest.approx(40.0, rel=1e-3)
    assert math.isnan(quantile_interval(Sketch(), 0.5, 0.95).value)


def test_interval_of_a_weighted_quantile_holds() -> None:
    held, widths = 0, []
    for seed in range(400):
        x = philox(1000 * 13 + seed).exponential(2.0, 400)
        found = quantile_interval(sketched(x, 2.0 * np.exp(-x / 2.0)), 0.9, 0.95)
        held += found.low <= math.log(10.0) <= found.high
        widths.append(found.high - found.low)
    assert 370 <= held <= 398
    assert np.median(widths) < 1.2


# ---------------------------------------------------------------------------------------------------------------- folds
def test_a_fold_does_not_depend_on_where_chunks_end() -> None:
    values = philox(14).normal(size=256)
    values[[3, 77]] = math.nan
    whole, parts = Fold(block=64), Fold(block=64)
    whole.add(0, values)
    for begin, end in pairwise((0, 10, 64, 70, 200, 256)):
        parts.add(begin, values[begin:end])
    assert (whole.blocks.count, parts.blocks.count) == (4, 4)
    assert_allclose(parts.mean(0.95).high, whole.mean(0.95).high, rtol=1e-13)
    summary = parts.summary(OUTPUTS["margin"], (0.5, 0.003), 0.95)
    assert (summary.rows, summary.counts.sum()) == (254, pytest.approx(254.0))
    assert summary.quantiles[0.5].low < summary.quantiles[0.5].value < summary.quantiles[0.5].high
    assert summary.sketch_error == RELATIVE_ERROR
    assert (summary.least, summary.most) == (np.nanmin(values), np.nanmax(values))


def test_a_block_with_missing_chunks_is_no_draw_of_the_mean() -> None:
    fold = Fold(block=64)
    fold.add(0, np.zeros(64))
    fold.add(64, np.ones(32))  # its second half and the first half of the next are missing
    fold.add(160, np.ones(32))
    assert fold.blocks.count == 1
    fold.add(192, np.ones(64))
    assert fold.blocks.count == 2
    assert fold.moments.count == 192


def test_a_fold_of_no_good_rows_has_a_summary() -> None:
    fold = Fold(block=16)
    fold.add(0, np.full(16, math.nan))
    summary = fold.summary(OUTPUTS["margin"], (0.5,), 0.95)
    assert summary.rows == summary.counts.size == 0
    assert math.isnan(summary.mean.value)
    assert math.isnan(summary.quantiles[0.5].value)


def test_values_that_repeat_are_their_own_quantiles():
    sketch = Sketch()
    sketch.add(np.repeat([0.0, 0.5, 1.0], [40, 10, 50]))
    assert [sketch.quantile(p) for p in (0.1, 0.45, 0.6, 0.999)] == [0.0, 0.5, 1.0, 1.0]
    other = Sketch()
    other.add(np.array([1.0 - 1e-5]))  # in the bin of 1, and no longer the same
    sketch.merge(other)
    assert 1.0 - 1e-5 <= sketch.quantile(0.6) < 1.0


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
