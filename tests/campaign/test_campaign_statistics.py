"""Statistics of rows: quantiles against those of NumPy, and every interval against how often it holds the truth."""

import math
import re
from contextlib import nullcontext
from dataclasses import astuple, replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from microrad.campaign.definition.outputs import OUTPUTS
from microrad.campaign.records import Chunk, Failed, Interval, Limit, Progress
from microrad.campaign.statistics import interim, summary, tails
from microrad.campaign.statistics.cell import CellRows, _missed
from microrad.campaign.statistics.interim import _order
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
from microrad.campaign.statistics.sensitivity import sensitivity
from microrad.campaign.statistics.summary import _sample, progress
from microrad.core.arrays import Floats
from microrad.core.intervals import binomial_band, counted, student
from microrad.mirror import Variant
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
    assert math.isnan(moments(np.array([2.0])).mean_variance) and math.isnan(moments(np.zeros(0)).mean_variance)
    assert moments(np.array([2.0, 4.0])).mean_variance == 1.0
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
    two = mean_interval(moments(np.array([2.0, 4.0])), 0.9)
    assert (two.value, two.high) == (3.0, pytest.approx(3.0 + stats.t.ppf(0.95, 1), rel=1e-9))
    assert two.low == pytest.approx(6.0 - two.high, rel=1e-9)
    assert mean_interval(moments(values), 0.9, Moments()).value == moments(values).mean
    assert math.isnan(mean_interval(moments(values), 0.9, moments(values[:1])).low)


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


# ------------------------------------------------------------------------------------------------ of a whole campaign
@pytest.mark.parametrize(
    ("done", "notes", "written", "wanted"),
    [
        (0, {}, False, Progress(0, 64, 0.0, math.nan, math.nan, "waiting")),
        (0, {"seconds": 2.0, "state": "running"}, True, Progress(0, 64, 2.0, 0.0, math.nan, "running")),
        (64, {"seconds": 8.0, "state": "running"}, True, Progress(64, 64, 8.0, 8.0, 0.0, "running")),
        (80, {"seconds": 8.0, "state": "stopped"}, False, Progress(80, 80, 8.0, 10.0, 0.0, "stopped")),
        (80, {"seconds": 8.0, "state": "complete"}, True, Progress(80, 80, 8.0, 10.0, 0.0, "complete")),
        (32, {"seconds": 8.0, "state": "stopped"}, True, Progress(32, 64, 8.0, 4.0, 8.0, "stopped")),
        (32, {"seconds": 0.0, "state": "waiting"}, False, Progress(32, 64, 0.0, math.nan, math.nan, "waiting")),
    ],
)
def test_the_pace_is_that_of_the_rows_in_their_time(done, notes, written, wanted) -> None:
    found = progress(done, 64, notes, written)
    for name in ("rows_done", "rows_total", "seconds", "rows_per_s", "left_s", "state"):
        assert getattr(found, name) == getattr(wanted, name) or math.isnan(getattr(wanted, name)), name
        assert str(getattr(found, name)) == str(getattr(wanted, name))


def a_chunk(number: int, rows, failed=(), weight=None, survival=(), **columns) -> Chunk:
    size = len(rows)
    weights = np.ones(size) if weight is None else np.array(weight, dtype=float)
    given = {name: np.array(each, dtype=float) for name, each in columns.items()}
    sums = np.array(survival, dtype=float)
    lost = tuple(Failed(row, 1, 1, "lost") for row in failed)
    return Chunk(0, number, {"row": np.array(rows, dtype=float), "weight": weights, **given}, lost, sums, sums**2)


def a_campaign(outputs=("margin",), **changes):
    table = {"tail": None, "loop": None, "sampling": "random", "precision": None}
    given = {
        "cells": [SimpleNamespace(values={"distance": "40000 km"}), SimpleNamespace(values={})],
        "outputs": [OUTPUTS[name] for name in outputs],
        "limits": (Limit("margin", 3.0, None, "campaign file"),),
        "inputs": (SimpleNamespace(key="power"),),
        "block": 2,
        "half_width": 0.0,
        "warnings": (),
        "draws": (),
    }
    return SimpleNamespace(**(given | changes), table=SimpleNamespace(**table))


def test_chunks_in_any_order_are_the_rows_of_a_cell_in_theirs() -> None:
    parts = [
        a_chunk(1, [4, 5], [5], margin=[4.0, math.nan], survival=[1.0, 2.0]),
        a_chunk(0, [0, 2], [2], margin=[1.0, math.nan], survival=[10.0, 20.0]),
        a_chunk(2, [1, 9], [9, 1], margin=[2.0, 3.0]),  # without a run in time
    ]
    for order in ((0, 1, 2), (2, 1, 0), (1, 2, 0)):
        cell = CellRows(a_campaign(), 0, [parts[k] for k in order])
        whole = cell.whole()
        assert whole is not None
        assert whole.columns["row"].tolist() == [0, 1, 2, 4, 5, 9]
        np.testing.assert_array_equal(whole.columns["margin"], [1.0, 2.0, math.nan, 4.0, math.nan, 3.0])
        assert [each.row for each in whole.failed] == [1, 2, 5, 9]
        assert (whole.survival.tolist(), whole.survival_square.tolist()) == ([11.0, 22.0], [101.0, 404.0])
        assert (cell.rows, cell.failed) == (6, 4)
        cell.take(a_chunk(3, [10], margin=[7.0], survival=[0.0, 1.0]))
        again = cell.whole()
        assert again is not None and again.columns["row"].tolist() == [0, 1, 2, 4, 5, 9, 10]
        assert again.survival.tolist() == [11.0, 23.0]
    assert CellRows(a_campaign(), 0).whole() is None
    assert CellRows(a_campaign(), 0).rows == CellRows(a_campaign(), 0).failed == CellRows(a_campaign(), 0).worth == 0


@pytest.mark.parametrize(
    ("least", "most", "missed"),
    [
        (3.0, None, [1.0, 0.0, 0.0, math.nan]),
        (None, 3.0, [0.0, 0.0, 1.0, math.nan]),
        (3.0, 3.5, [1.0, 0.0, 1.0, math.nan]),
        (None, None, [0.0, 0.0, 0.0, math.nan]),
    ],
)
def test_a_value_at_its_limit_keeps_it(least, most, missed) -> None:
    values = np.array([2.9, 3.0, 4.0, math.nan])
    np.testing.assert_array_equal(_missed(Limit("margin", least, most, ""), values), missed)


def test_a_row_misses_its_limits_where_it_misses_any_of_them() -> None:
    limits = (Limit("margin", 3.0, None, ""), Limit("data_rate", None, 5.0, ""))
    campaign = a_campaign(("margin", "data_rate"), limits=limits)
    chunk = a_chunk(0, range(5), [4], margin=[2, 4, 4, 2, math.nan], data_rate=[4, 6, 4, 6, math.nan])
    found = CellRows(campaign, 0, [chunk]).summary()
    assert (found.missed.value, found.missed_by["margin"].value, found.missed_by["data_rate"].value) == (0.75, 0.5, 0.5)
    assert (found.rows, found.failed, found.values, found.tail) == (5, 1, {"distance": "40000 km"}, None)
    assert list(found.outputs) == ["margin", "data_rate"]
    assert CellRows(campaign, 0, [chunk]).summary(()).outputs == {}
    nothing = CellRows(campaign, 1).summary()
    assert (nothing.rows, nothing.outputs, nothing.missed_by, nothing.label) == (0, {}, {}, "")
    assert math.isnan(nothing.missed.value)


def test_rows_are_worth_their_weights_over_the_heaviest() -> None:
    chunk = a_chunk(0, range(4), [3], weight=[1.0, 2.0, 2.0, 9.0], margin=[1.0, 2.0, 3.0, math.nan])
    assert CellRows(a_campaign(), 0, [chunk]).worth == pytest.approx(25.0 / 9.0)
    lost = a_chunk(0, [0], [0], margin=[math.nan])
    assert CellRows(a_campaign(), 0, [lost]).worth == 0.0


def test_a_quantile_is_precise_up_to_its_half_width() -> None:
    chunk = a_chunk(0, range(400), margin=philox(23).normal(size=400))
    in_order = ordered(chunk.columns["margin"])
    band = quantile_interval(in_order, 0.9, 0.95)
    half = (band.high - band.low) / 2.0
    for asked, enough in ((half, True), (half * (1 - 1e-9), False), (half * 2, True)):
        campaign = a_campaign(half_width=asked)
        campaign.table.precision = SimpleNamespace(output="margin", quantile=0.9, confidence=0.95)
        cell = CellRows(campaign, 0, [chunk])
        assert cell.is_precise() is enough
        said = cell.precision_words()
        assert said.startswith("90 % quantile of margin with distance = 40000 km: ")
        assert ("NOT as precise" in said) is not enough and "at 95 % confidence" in said
        assert not CellRows(campaign, 0).is_precise() and CellRows(campaign, 0).precision_words() == ""
        lost = CellRows(campaign, 0, [a_chunk(0, [0], [0], margin=[math.nan])])
        assert not lost.is_precise() and lost.precision_words() == ""
        few = CellRows(campaign, 0, [a_chunk(0, range(3), margin=[1.0, 2.0, 3.0])])
        assert not few.is_precise() and "unknown" in few.precision_words()  # so few rows have no upper end
    assert not CellRows(a_campaign(), 0, [chunk]).is_precise()
    assert CellRows(a_campaign(), 0, [chunk]).precision_words() == ""


@pytest.mark.parametrize(("each", "every"), [(2000, 1), (2001, 2), (4000, 2), (4001, 3)])
def test_a_sample_is_of_every_so_many_rows_of_each_cell(each, every) -> None:
    campaign = a_campaign()
    cells = [CellRows(campaign, k, [a_chunk(0, range(each), margin=np.arange(each) + k)]) for k in range(2)]
    found = _sample(cells)
    rows = np.arange(0, each, every)
    np.testing.assert_array_equal(found["row"], np.tile(rows, 2))
    np.testing.assert_array_equal(found["cell"], np.repeat([0.0, 1.0], rows.size))
    np.testing.assert_array_equal(found["margin"], np.concatenate([rows, rows + 1]))
    assert _sample([CellRows(campaign, 0)]) == {}
    alone = _sample([CellRows(campaign, 0), cells[1]])  # the other cell has no rows yet
    assert set(alone["cell"]) == {1.0} and alone["row"].size == math.ceil(each / max(math.ceil(each / 4000), 1))


def test_sensitivities_are_of_limited_outputs_over_equal_rows_of_drawn_inputs(monkeypatch) -> None:
    monkeypatch.setattr(summary, "sensitivity", lambda inputs, values, name: (name, *inputs, values.sum()))
    chunk = a_chunk(0, range(3), margin=[1, 2, 3], data_rate=[4, 5, 6], power=[7, 8, 9])
    twice = (*(Limit(name, 1.0, None, "") for name in ("data_rate", "margin", "data_rate")),)
    campaign = a_campaign(("margin", "data_rate"), limits=twice)

    def found(of, *chunks):
        return summary._sensitivities(of, CellRows(of, 0, chunks))

    assert found(campaign, chunk) == (("data_rate", "power", 15.0), ("margin", "power", 6.0))
    assert found(campaign) == found(a_campaign(limits=()), chunk) == found(a_campaign(inputs=()), chunk) == ()
    weighted = replace(chunk, columns={**chunk.columns, "weight": np.array([1.0, 1.0, 1.1])})
    assert found(campaign, weighted) == ()


@pytest.mark.parametrize(
    ("limits", "rows"),
    [
        ((), [3, 2, 1, 4]),
        ((Limit("margin", 1.0, None, ""),), [3, 2, 1, 4]),
        ((Limit("residual", None, 1.0, ""), Limit("margin", 1.0, None, "")), [1, 2, 3, 4]),
        ((Limit("margin", 1.0, 2.0, ""),), [3, 2, 1, 4]),
        ((Limit("margin", 1.0, None, ""), Limit("residual", None, 1.0, "")), [3, 2, 1, 4]),
    ],
)
def test_the_worst_is_the_largest_where_the_first_limit_is_a_most(limits, rows) -> None:
    traces = [
        SimpleNamespace(cell=c, row=r, value=v) for c, r, v in ((1, 4, 0.5), (0, 2, 2.0), (0, 3, 1.0), (0, 1, 3.0))
    ]
    found = summary._worst_first(limits, traces)
    assert [(each.cell, each.row) for each in found] == [(int(row == 4), row) for row in rows]
    same = [SimpleNamespace(cell=0, row=r, value=1.0) for r in (5, 2, 9)]
    assert [each.row for each in summary._worst_first(limits, same)] == [2, 5, 9]


def test_what_is_said_of_rows_lost_extrapolated_and_weighted() -> None:
    campaign = a_campaign(warnings=("of the file",))
    plain = CellRows(campaign, 0, [a_chunk(0, range(3), margin=[1, 2, 3], outside_share=[0, 0, 0])])
    assert summary._warnings(campaign, [plain]) == ("of the file",)
    lost = CellRows(campaign, 1, [a_chunk(0, range(2), [1], margin=[1, math.nan], outside_share=[0, 0.1])])
    _, failed, outside = summary._warnings(campaign, [plain, lost])
    assert failed == "1 of 5 rows have no result; the figures are those of the others."
    assert "the drive leaves the range" in outside
    fast = CellRows(campaign, 0, [a_chunk(0, range(2), margin=[1, 2], beyond_rate_share=[0, 1e-9])])
    assert [("moves faster" in each) for each in summary._warnings(campaign, [fast])] == [False, True]
    drawn = a_campaign(draws=(SimpleNamespace(drawn_as=None), SimpleNamespace(drawn_as=object())))
    whole = a_chunk(0, range(2), [1], margin=[1, math.nan])
    cells = [CellRows(drawn, 0, [a_chunk(0, range(4), margin=[1, 2, 3, 4])]), CellRows(drawn, 1, [whole])]
    assert "worth 1 equal ones" in summary._warnings(drawn, cells)[-1]  # the cell that is worth least
    none = CellRows(drawn, 1, [a_chunk(0, [0], [0], margin=[math.nan])])
    assert "worth 4 equal ones" in summary._warnings(drawn, [cells[0], none])[-1]  # not one without a row
    many = CellRows(drawn, 0, [a_chunk(0, range(1234), margin=[*range(1234)])])
    assert summary._warnings(drawn, [many])[-1].endswith("are worth 1230 equal ones.")
    even = a_campaign(draws=(SimpleNamespace(drawn_as=None),))
    assert summary._warnings(even, [plain]) == ()


@pytest.mark.parametrize(
    ("axes", "mirror", "runs", "words"),
    [
        ("one", Variant.GIVEN, 1, "PI, one axis, 1 run a row"),
        ("both", Variant.COMPARISON, 2, "PI, both axes, mirror: comparison, 2 runs a row"),
        ("both", Variant.STRAIGHT, 64, "PI, both axes, mirror: no hysteresis, 64 runs a row"),
    ],
)
def test_the_loop_of_a_campaign_in_words(axes, mirror, runs, words) -> None:
    assert summary._loop_words(SimpleNamespace(controller="PI", axes=axes, mirror=mirror), runs) == words


@pytest.mark.parametrize("value", [-2.0, 2.0])
def test_values_that_are_all_the_same_have_one_bin_about_them_whatever_their_sign(value):
    edges, counts = histogram(np.full(3, value), np.ones(3))
    assert edges == pytest.approx([value - 2e-3, value + 2e-3], abs=1e-12)
    assert counts.tolist() == [3.0]


VALUES = np.array([2.0, math.nan, 5.0, -1.0, 7.0, 5.0])
WEIGHTS = np.array([0.5, 3.0, 1.25, 2.0, 0.75, 0.25])


def ends(found) -> list[float]:
    return [found.value, found.low, found.high, found.confidence]


def test_weighted_moments_leave_out_what_is_not_known_with_its_weight() -> None:
    found, known = moments(VALUES, WEIGHTS), ~np.isnan(VALUES)
    x, w = VALUES[known], WEIGHTS[known]
    mean = np.average(x, weights=w)
    off = x - mean
    wanted = (5, w.sum(), (w**2).sum(), mean, (w * off**2).sum(), (w**2 * off).sum(), ((w * off) ** 2).sum(), -1.0, 7.0)
    assert astuple(found) == pytest.approx(wanted, rel=1e-12)
    variance = (w * off**2).sum() / (w.sum() - (w**2).sum() / w.sum())
    assert (found.variance, found.deviation) == pytest.approx((variance, math.sqrt(variance)), rel=1e-12)
    assert found.mean_variance == pytest.approx(((w * off) ** 2).sum() / w.sum() ** 2 * 5 / 4, rel=1e-12)


def test_an_endless_value_leaves_its_ends_and_no_spread() -> None:
    found = moments(np.array([2.0, math.inf, math.nan, 3.0]))
    assert (found.count, found.weight, found.mean, found.least, found.most) == (3, 3.0, math.inf, 2.0, math.inf)
    assert math.isnan(found.spread) and math.isnan(found.variance)


def test_the_mean_of_weighted_rows_has_the_spread_of_its_blocks_where_there_are_any() -> None:
    rows = moments(VALUES, WEIGHTS)
    half = student(0.9, 4) * math.sqrt(rows.mean_variance)
    assert ends(mean_interval(rows, 0.9)) == pytest.approx([rows.mean, rows.mean - half, rows.mean + half, 0.9])
    blocks = moments(np.array([1.0, 4.0, 2.5]))
    half = student(0.9, 2) * math.sqrt(2.25 / 3.0)
    assert ends(mean_interval(rows, 0.9, blocks)) == pytest.approx([rows.mean, rows.mean - half, rows.mean + half, 0.9])
    alone = ends(mean_interval(rows, 0.9, moments(np.array([1.0]))))
    assert alone[0] == rows.mean and np.isnan(alone[1:3]).all()


@pytest.mark.parametrize(
    ("hits", "weights", "found"),
    [
        ([1, 0, 0, 0, 0, 0], [0.25, 1.5, 1.0, 2.0, 0.5, 0.75], [0.04166667, 0.001913722, 0.1875991, 0.9]),
        ([0, 1, 1, 1, 1, 1], [0.25, 1.5, 1.0, 2.0, 0.5, 0.75], [0.9583333, 0.8124009, 0.9980863, 0.9]),
        ([1, 0, 1, 0, 1, 0], [2.0, 1.0, 3.0, 0.5, 2.5, 1.0], [0.5833333, 0.2098502, 0.8950893, 0.9]),
        ([1, 1, 1], [2.0, 1.0, 4.0], [1.0, 0.2769591, 1.0, 0.9]),
        ([0, 0, 0], [2.0, 1.0, 4.0], [0.0, 0.0, 0.7230409, 0.9]),
        ([1, 0, 1, 1], [1.0, 1.0, 1.0, 1.0], [0.75, 0.2486046, 0.9872585, 0.9]),
    ],
)
def test_a_weighted_share_is_told_by_its_rarer_side(hits, weights, found) -> None:
    share = share_interval(moments(np.array(hits, dtype=float), np.array(weights)), 0.9)
    assert ends(share) == pytest.approx(found, rel=1e-6)


def test_a_share_of_nothing_is_not_known() -> None:
    assert np.isnan(ends(share_interval(Moments(), 0.9))[:3]).all()
    assert ends(proportion_interval(2.5, 8.0, 0.9)) == pytest.approx([0.3125, 0.07631499, 0.6571747, 0.9], rel=1e-6)


@pytest.mark.parametrize(
    ("probability", "found"),
    [
        (0.05, [9.0, 4.0, 25.0, 0.8]),
        (0.3, [144.0, 36.0, 324.0, 0.8]),
        (0.5, [400.0, 169.0, 676.0, 0.8]),
        (0.9, [1156.0, 1024.0, 1521.0, 0.8]),
        (0.99, [1521.0, 1444.0, math.nan, 0.8]),
    ],
)
def test_a_quantile_of_rows_of_other_weights_has_its_own_ends(probability, found) -> None:
    rows = ordered(np.arange(40.0) ** 2, 0.25 + np.arange(40.0) % 7)
    assert ends(quantile_interval(rows, probability, 0.8)) == pytest.approx(found, nan_ok=True)


def test_an_output_of_weighted_blocks_has_all_of_its_summary() -> None:
    rows, margin = np.array([0.0, 1, 4, 5, 6, 7, 9]), np.array([3.0, 5.0, 4.0, math.nan, 8.0, 2.0, 6.0])
    weight = np.array([0.5, 2.0, 1.0, 1.5, 0.75, 1.25, 3.0])
    given = {"row": rows, "weight": weight, "margin": margin}
    found = output_summary(OUTPUTS["margin"], given, (0.25, 0.75), 0.9, 2)
    known = moments(margin, weight)
    assert (found.name, found.unit, found.rows, found.least, found.most) == ("margin", "dB", 6, 2.0, 8.0)
    assert found.meaning == OUTPUTS["margin"].meaning
    assert found.deviation == known.deviation
    # blocks of two rows from row 0: rows 0 and 1, 4 and 5 (one of which has failed), 6 and 7; that of 9 is not whole
    means = moments(np.array([(1.5 + 10.0) / 2.5, 4.0, (6.0 + 2.5) / 2.0]))
    assert ends(found.mean) == pytest.approx(ends(mean_interval(known, 0.9, means)), rel=1e-12)
    assert [q.value for q in found.quantiles.values()] == [4.0, 6.0]
    assert list(found.quantiles) == [0.25, 0.75]
    assert found.counts.sum() == pytest.approx(8.5) and found.counts[-1] == 0.75 and found.counts[0] == 1.25
    assert (found.edges[0], found.edges[-1], found.edges.size) == (2.0, 8.0, 41)


def test_a_value_on_an_edge_is_in_the_bin_above_it_and_the_last_in_the_last() -> None:
    edges, counts = histogram(
        np.array([1.0, 2.0, 2.0, 3.5, 5.0, math.nan]), np.array([0.5, 1.0, 0.25, 2.0, 4.0, 9.0]), 4
    )
    assert (edges.tolist(), counts.tolist()) == ([1.0, 2.0, 3.0, 4.0, 5.0], [0.5, 1.25, 2.0, 4.0])


def test_a_precision_is_told_with_every_number_in_the_unit_of_its_output() -> None:
    campaign = a_campaign(("data_rate", "outage"), half_width=2.5e6)
    campaign.table.precision = SimpleNamespace(output="data_rate", quantile=0.975, confidence=0.8)
    rate = 622.08e6 + 1e5 * np.arange(400.0)
    chunk = a_chunk(0, range(400), data_rate=rate, outage=rate / 1e12)
    assert CellRows(campaign, 0, [chunk]).precision_words() == (
        "97.5 % quantile of data_rate with distance = 40000 km: 661 Mbit/s, 660.6 Mbit/s to 661.5 Mbit/s at 80 % "
        "confidence; as precise as asked for (± 2.5 Mbit/s)."
    )
    campaign.half_width, campaign.table.precision.output = 1e-7, "outage"
    assert CellRows(campaign, 1, [chunk]).precision_words() == (
        "97.5 % quantile of outage: 0.000661, 0.0006606 to 0.0006615 at 80 % confidence; NOT "
        "as precise as asked for (± 1e-07)."
    )


def test_the_cell_that_misses_least_comes_first_and_one_without_a_row_last() -> None:
    def cell(rows, failed, missed):
        return SimpleNamespace(rows=rows, failed=failed, missed=SimpleNamespace(value=missed))

    cells = [cell(4, 4, 0.0), cell(4, 1, math.nan), cell(4, 0, 0.5), cell(9, 8, 0.25)]
    assert sorted(range(4), key=lambda k: _order(cells[k])) == [3, 2, 1, 0]


@pytest.mark.parametrize(
    ("rank", "probability", "few", "many"),
    [
        (3, 0.4, 0.7464352, 0.6161208),
        (5, 0.4, 0.9962403, 0.04079052),
        (0, 0.3, 0.2374178, 1.0),
        (6, 0.3, 1.0, 0.007798596),
    ],
)
def test_the_tails_of_a_rank_go_by_the_rows_that_its_weights_are_worth(rank, probability, few, many) -> None:
    rows = ordered(np.arange(6.0), np.array([2.0, 0.5, 1.0, 3.0, 0.25, 1.25]))
    assert _tails(rows, rank, probability) == pytest.approx((few, many), rel=1e-6)


def test_a_summary_of_several_cells_has_the_rows_that_failed_of_each_and_no_more_than_are_listed(monkeypatch) -> None:
    monkeypatch.setattr(summary, "MOST_FAILED", 4)
    campaign = a_campaign(fixed={"link.power": "5 W"}, realisations=3, warnings=("of the file",))
    campaign.table.sampling = "sobol"
    campaign.table.loop = SimpleNamespace(controller="LQG", axes="both", mirror=Variant.GIVEN)
    found = [a_chunk(number, rows, rows[1:], margin=rows) for number, rows in enumerate(([0, 1, 2], [3, 4]))]
    cells = [CellRows(campaign, 0, found), CellRows(campaign, 1, [a_chunk(5, [7, 8, 9], [8, 9], margin=[1, 2, 3])])]
    for cell, words in zip(cells, ("", "the second is imprecise"), strict=True):
        monkeypatch.setattr(cell, "precision_words", lambda words=words: words)
    head = SimpleNamespace(campaign_name="c", mission_name="m", hashes={"code": "x"}, seed=41)
    whole = summary.assembled(head, campaign, cells, ["first", "second"], "pace")
    assert (whole.name, whole.mission_name, whole.hashes, whole.seed, whole.sampling) == (
        "c", "m", {"code": "x"}, 41, "sobol"
    )  # fmt: skip
    assert [(cell, each.row) for cell, each in whole.failed] == [(0, 1), (0, 2), (0, 4), (1, 8)]
    assert (whole.loop, whole.cells, whole.progress) == ("LQG, both axes, 3 runs a row", ("first", "second"), "pace")
    assert (whole.inputs, whole.fixed, whole.limits) == (campaign.inputs, campaign.fixed, campaign.limits)
    assert whole.warnings == ("of the file", "5 of 8 rows have no result; the figures are those of the others.")
    assert whole.findings == ("the second is imprecise",)
    assert (whole.sensitivities, whole.sample, whole.worst) == ((), {}, ())


def test_a_campaign_is_as_far_as_the_first_round_of_all_its_cells(monkeypatch, tmp_path) -> None:
    campaign = a_campaign(limits=(Limit("margin", None, 3.0, ""),))
    chunks = [[a_chunk(0, [0, 1], margin=[1.0, 5.0])], [a_chunk(0, [0, 1, 2], margin=[2.0, 7.0, 3.0])]]
    traces = [SimpleNamespace(cell=c, row=r, value=v) for c, r, v in ((1, 0, 2.0), (0, 1, 5.0), (1, 1, 7.0))]
    book = SimpleNamespace(
        head=SimpleNamespace(bundle="bundle", campaign_name="c", mission_name="m", hashes={}, seed=1),
        notes=lambda: {"seconds": 10.0, "state": "running"}, traces=lambda: traces, chunks=lambda cell: chunks[cell],
        still=nullcontext,
    )  # fmt: skip
    asked = []
    opened = lambda path, write: asked.append((path, write)) or nullcontext(book)  # noqa: E731
    monkeypatch.setattr(summary.Ledger, "open", opened)
    monkeypatch.setattr(
        summary.bundle,
        "opened",
        lambda of, any_code: asked.append((of, any_code)) or SimpleNamespace(campaign=campaign),
    )
    monkeypatch.setattr(summary, "planned", lambda of: SimpleNamespace(rounds=(10, 40)))
    monkeypatch.setattr(summary, "is_written", lambda path: path == tmp_path)
    monkeypatch.setattr(summary, "_sensitivities", lambda of, cell: ("of", cell.rows))
    campaign.table.sampling, campaign.fixed = "sobol", {}
    found = summary.summarise_campaign(tmp_path)
    assert asked == [(tmp_path, False), ("bundle", True)]
    assert found.progress == Progress(5, 20, 10.0, 0.5, 30.0, "running")
    assert ([cell.rows for cell in found.cells], found.sensitivities) == ([2, 3], ("of", 2))
    assert [(t.cell, t.row) for t in found.worst] == [(0, 1), (1, 1), (1, 0)]
    assert found.sample["margin"].tolist() == [1.0, 5.0, 2.0, 7.0, 3.0]
    assert found.sample["cell"].tolist() == [0.0, 0.0, 1.0, 1.0, 1.0]


# -------------------------------------------------------------------------------------------------- looked at meanwhile
class Growing(SimpleNamespace):
    """A ledger that chunks come into: each with its mark, and what is noted of it."""

    def count(self):
        return len(self.inside)

    def notes(self):
        return dict(self.noted)

    def added(self, mark):
        return ((at, chunk) for at, chunk in self.inside if at > mark)


@pytest.fixture
def growing(monkeypatch):
    """An empty ledger of two cells, how it is looked at, and what was asked for."""
    asked, campaign = [], a_campaign(limits=(Limit("margin", 3.0, None, ""),))
    book = Growing(inside=[], noted={"state": "waiting"}, head=SimpleNamespace(bundle=b"first"))
    opened = lambda path, write: asked.append((path, write)) or nullcontext(book)  # noqa: E731
    monkeypatch.setattr(interim.Ledger, "open", opened)
    unpacked = lambda of, any_code: asked.append((of, any_code)) or SimpleNamespace(campaign=campaign)  # noqa: E731
    monkeypatch.setattr(interim.bundle, "opened", unpacked)
    monkeypatch.setattr(interim, "planned", lambda of: SimpleNamespace(rounds=(6, 40), chunk_rows=4))
    told = lambda *given: SimpleNamespace(head=given[0], campaign=given[1], cells=given[3], progress=given[4])  # noqa: E731
    monkeypatch.setattr(interim.summary, "assembled", told)
    return book, interim.Interim("a ledger"), asked, campaign


def of_cell(cell: int, number: int, rows, margin, failed=()) -> Chunk:
    return replace(a_chunk(number, rows, failed, margin=margin), cell=cell)


def test_a_look_reads_each_chunk_once_and_gives_the_same_where_nothing_is_new(growing) -> None:
    book, look, asked, campaign = growing
    empty = look.look()
    assert (asked, empty.head, empty.campaign) == ([("a ledger", False), (b"first", True)], book.head, campaign)
    assert [cell.rows for cell in empty.cells] == [0, 0]
    assert (empty.progress.rows_done, empty.progress.rows_total, empty.progress.state) == (0, 12, "waiting")
    assert look.look() is empty
    book.inside += [
        (3, of_cell(1, 0, range(4), [1.0, 2.0, 5.0, 7.0])),
        (5, of_cell(0, 1, [4, 5], [2.0, math.nan], [5])),
    ]
    book.noted |= {"state": "running", "seconds": 3.0}
    some = look.look()
    assert [(cell.rows, cell.failed, cell.missed.value) for cell in some.cells] == [(2, 1, 1.0), (4, 0, 0.5)]
    assert [list(cell.outputs) for cell in some.cells] == [[], ["margin"]], "that of the cell that misses least alone"
    assert some.progress == Progress(6, 12, 3.0, 2.0, 3.0, "running")
    assert look.look() is some
    book.inside.append((6, of_cell(0, 0, range(4), [4.0, 4.5, 5.0, 6.0])))
    more = look.look()
    assert [(cell.rows, cell.missed.value) for cell in more.cells] == [(6, 0.2), (4, 0.5)]
    assert [list(cell.outputs) for cell in more.cells] == [["margin"], []]
    book.noted["state"] = "complete"
    assert look.look().progress == Progress(10, 10, 3.0, 10.0 / 3.0, 0.0, "complete")
    assert [each for each in asked if each[0] == b"first"] == [(b"first", True)], "opened once"


def test_a_look_without_patience_reads_one_chunk_and_counts_the_others_as_whole(growing) -> None:
    book, look, _, _ = growing
    book.inside += [(k + 1, of_cell(0, k, range(4 * k, 4 * k + 4), [1.0, 2.0, 3.0, 4.0])) for k in range(3)]
    seen = [look.look(-1.0) for _ in range(4)]
    assert [each.cells[0].rows for each in seen] == [4, 8, 12, 12]
    assert [each.progress.rows_done for each in seen] == [12, 12, 12, 12]
    assert seen[3] is seen[2]


@pytest.mark.parametrize("change", ["another head", "fewer chunks"])
def test_a_ledger_that_is_another_by_now_is_read_from_its_begin(growing, change) -> None:
    book, look, asked, _ = growing
    book.inside += [(1, of_cell(0, 0, range(4), [1.0, 2.0, 3.0, 4.0])), (2, of_cell(1, 0, range(4), [5.0] * 4))]
    before = look.look()
    if change == "another head":
        book.head = SimpleNamespace(bundle=b"second")
    else:
        book.inside.pop(0)
    after = look.look()
    assert after is not before and after.head is book.head
    assert [cell.rows for cell in after.cells] == ([4, 4] if change == "another head" else [0, 4])
    assert [each[0] for each in asked if each[1] is True] == [b"first", book.head.bundle]


def test_a_summary_of_a_cell_has_the_limits_that_any_row_misses_over_its_good_rows() -> None:
    limits = (Limit("margin", 3.0, 9.0, ""), Limit("outage", None, 0.25, ""))
    campaign = a_campaign(("margin", "outage"), limits=limits)
    given = {"margin": [2.0, 3.0, 9.0, 9.5, math.nan, 4.0], "outage": [0.5, 0.25, 0.26, 0.0, math.nan, 0.1]}
    cell = CellRows(campaign, 0, [a_chunk(0, range(6), [4], **given)])
    found = cell.summary((0.25, 0.75))
    assert (found.values, found.rows, found.failed, found.tail) == ({"distance": "40000 km"}, 6, 1, None)
    assert found.missed == proportion_interval(3.0, 5.0, 0.95)
    assert found.missed_by == {name: proportion_interval(2.0, 5.0, 0.95) for name in ("margin", "outage")}
    assert [(o.name, o.rows, o.least, o.most, list(o.quantiles)) for o in found.outputs.values()] == [
        ("margin", 5, 2.0, 9.5, [0.25, 0.75]),
        ("outage", 5, 0.0, 0.5, [0.25, 0.75]),
    ]
    assert ends(found.outputs["margin"].mean) == pytest.approx(
        ends(mean_interval(moments(np.array(given["margin"])), 0.95))
    )
    bare = cell.summary(())
    assert (bare.outputs, bare.tail, bare.missed) == ({}, None, found.missed)
    campaign.table.sampling = "sobol"
    blocks = block_means(np.arange(6.0), np.array(given["margin"]), np.ones(6), 2)
    assert cell.summary().outputs["margin"].mean == mean_interval(moments(np.array(given["margin"])), 0.95, blocks)


@pytest.mark.parametrize("loop", [False, True])
def test_a_cell_of_no_rows_says_that_nothing_is_known(loop) -> None:
    campaign = a_campaign()
    campaign.table.loop = object() if loop else None
    for cell in (CellRows(campaign, 1), CellRows(campaign, 1, [a_chunk(0, [0, 1], [0, 1], margin=[math.nan] * 2)])):
        found = cell.summary()
        assert (found.values, found.tail, found.rows == found.failed) == ({}, None, True)
        assert math.isnan(found.missed.value) and cell.worth == 0.0 and not cell.is_precise()
        assert cell.precision_words() == ""


def test_the_tail_of_a_cell_is_that_of_its_good_rows_or_of_its_weighted_draws(monkeypatch) -> None:
    asked = []
    monkeypatch.setattr(
        tails, "tail_of_time", lambda *given: asked.append(given) or SimpleNamespace(wanted={0.125: "w"})
    )
    monkeypatch.setattr(tails, "tail_weighted", lambda *given: asked.append(given))
    campaign = a_campaign()
    campaign.table.loop = object()
    chunks = [a_chunk(0, [0, 1], [1], survival=[1.5, 0.25], margin=[4, math.nan]), a_chunk(1, [2], margin=[5])]
    CellRows(campaign, 0, [chunks[0], replace(chunks[0], number=1)]).summary()
    (sums, squares, good, edges, shares, confidence), _ = asked.pop(), asked.clear()
    assert (sums.tolist(), squares.tolist(), good, confidence) == ([3.0, 0.5], [4.5, 0.125], 2, 0.99)
    assert edges.size > 100 and shares == (0.1, 0.01, 0.003, 1e-3, 1e-4, 1e-5, 1e-6)
    campaign.table.precision = SimpleNamespace(output="radius", quantile=0.875, confidence=0.8)
    assert CellRows(campaign, 0, chunks)._precision() == "w"
    assert (asked[0][2], asked[0][4], asked.pop()[5]) == (2, (0.125,), 0.8)
    campaign.table.tail, campaign.limits = SimpleNamespace(error_rad=2e-5, probability=1e-7), ()
    campaign.outputs = []
    CellRows(
        campaign, 0, [a_chunk(0, [0, 1, 2], tail_radius=[1e-6, math.nan, 3e-6], tail_log_weight=[-1, -2, -4])]
    ).summary()
    ((radius, log_weight, *rest),) = asked
    assert (radius.tolist(), log_weight.tolist(), rest) == ([1e-6, 3e-6], [-1.0, -4.0], [(1e-7,), 0.99, (2e-5,)])


@pytest.mark.parametrize(
    ("limits", "order"),
    [
        ((), [(0, 2), (0, 5), (0, 1), (1, 0)]),
        ((Limit("margin", 3.0, None, ""),), [(0, 2), (0, 5), (0, 1), (1, 0)]),
        ((Limit("margin", 3.0, 9.0, ""),), [(0, 2), (0, 5), (0, 1), (1, 0)]),
        ((Limit("margin", None, 9.0, ""), Limit("outage", 0.0, None, "")), [(0, 1), (0, 2), (0, 5), (1, 0)]),
    ],
)
def test_traces_of_equal_values_stand_by_their_rows(limits, order) -> None:
    traces = [
        SimpleNamespace(cell=c, row=r, value=v) for c, r, v in ((1, 0, 0.5), (0, 5, 2.0), (0, 1, 7.5), (0, 2, 2.0))
    ]
    assert [(t.cell, t.row) for t in summary._worst_first(limits, traces)] == order


@pytest.mark.parametrize(
    ("failed", "beyond", "outside", "weights", "told"),
    [
        ([], 0.0, 0.0, None, []),
        ([1], 0.0, 1e-9, None, ["1 of 3 rows have no", "In some rows the drive leaves"]),
        ([], 0.5, 0.0, [1.0, 1.0, 4.0], ["In some rows the mirror moves faster", "worth 2 equal ones."]),
    ],
)
def test_each_warning_of_rows_has_its_own_cause(failed, beyond, outside, weights, told) -> None:
    names = ("margin", "beyond_rate_share", "outside_share")
    draw = SimpleNamespace(drawn_as=None if weights is None else object())
    campaign = a_campaign(names, draws=(SimpleNamespace(drawn_as=None), draw))
    margin = [math.nan if row in failed else 4.0 for row in range(3)]
    given = {"margin": margin, "beyond_rate_share": [0.0, 0.0, beyond], "outside_share": [0.0, outside, 0.0]}
    found = summary._warnings(
        campaign, [CellRows(campaign, 0), CellRows(campaign, 1, [a_chunk(0, range(3), failed, weights, **given)])]
    )
    assert [words in each for words, each in zip(told, found, strict=True)] == [True] * len(told)


@pytest.mark.parametrize(
    ("share", "size", "rows", "low_at", "high_at"),
    [
        ([1.0, 0.5, 0.25, 0.0], [math.nan, 40.0, 30.0, math.nan], 20, 0, 3),
        ([0.75, 0.75, 1e-3], [9.0, 8.0, 7.0], 3, 1, 2),
    ],
)
def test_a_band_has_the_events_of_its_sizes_with_the_correction_for_few_rows(
    share, size, rows, low_at, high_at
) -> None:
    share, size = np.array(share), np.array(size)
    band = tails._band(share, size, rows, 0.9)
    worth = np.where(np.isnan(size), rows, size)
    few = counted(rows, 0.9)
    low, high = binomial_band(share * worth * few, worth * few, 0.9)
    assert (band.share.tolist(), band.size.tolist()) == (share.tolist(), worth.tolist())
    assert band.low[low_at] == pytest.approx(max(low[low_at:])) and band.high[high_at] == pytest.approx(
        min(high[: high_at + 1])
    )


@pytest.mark.parametrize(
    ("values", "weights", "share", "found"),
    [
        ([3.0, 1.0, 2.0], None, 0.34, 2.0),
        ([3.0, 1.0, 2.0], None, 1 / 3, 1.0),
        ([3.0, 1.0, 2.0], [5.0, 1.0, 2.0], 0.375, 2.0),
        ([3.0, 1.0, 2.0], [5.0, 1.0, 2.0], 0.376, 3.0),
        ([3.0, math.nan, 2.0], [5.0, 90.0, 2.0], 0.0, 2.0),
        ([-math.inf, 1.0], None, 0.5, -math.inf),
        ([math.nan], None, 0.5, math.nan),
        ([4.0], [0.25], 1.0, 4.0),
    ],
)
def test_a_quantile_is_the_least_value_that_its_share_of_the_weight_is_up_to(values, weights, share, found) -> None:
    rows = ordered(np.array(values), None if weights is None else np.array(weights))
    assert rows.quantile(share) == found or (math.isnan(found) and math.isnan(rows.quantile(share)))


@pytest.mark.parametrize(
    ("rows", "block", "count", "mean"),
    [
        ([0, 1, 2, 3, 4], 2, 2, 2.5),
        ([1, 2, 3, 4, 5], 2, 2, 3.5),
        ([2, 3, 4, 5, 9], 4, 0, math.nan),
        ([4, 5, 6, 7, 8], 4, 1, 2.5),
        ([0, 1, 2, 3, 4], 1, 5, 3.0),
    ],
)
def test_blocks_begin_at_multiples_of_their_rows_whichever_row_is_first(rows, block, count, mean) -> None:
    values = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    found = block_means(np.array(rows, dtype=float), values, np.ones(5), block)
    assert found.count == count and (found.mean == mean or math.isnan(mean))


def test_the_mean_of_weighted_rows_is_worth_its_squares() -> None:
    """By the definition of each field, with numbers unlike each other."""
    x, w = np.array([2.0, -1.0, 5.0, 0.5]), np.array([0.5, 2.0, 1.25, 4.0])
    found, mean = moments(x, w), float(np.sum(x * w) / np.sum(w))
    off = x - mean
    assert astuple(found) == pytest.approx(
        (4, 7.75, 21.8125, mean, np.sum(w * off**2), np.sum(w**2 * off), np.sum((w * off) ** 2), -1.0, 5.0), rel=1e-12
    )
    assert found.variance == pytest.approx(np.sum(w * off**2) / (7.75 - 21.8125 / 7.75), rel=1e-12)
    assert found.mean_variance == pytest.approx(np.sum((w * off) ** 2) / 7.75**2 * 4.0 / 3.0, rel=1e-12)
    assert found.deviation == math.sqrt(found.variance)
    lone = moments(np.array([3.0]), np.array([0.5]))
    assert math.isnan(lone.variance) and math.isnan(lone.mean_variance) and lone.mean == 3.0


def test_of_rows_that_have_all_failed_no_figure_is_spoken_of() -> None:
    drawn = a_campaign(draws=(SimpleNamespace(drawn_as=object()),))
    lost = CellRows(drawn, 0, [a_chunk(0, range(3), [0, 1, 2], margin=[math.nan] * 3)])
    assert summary._warnings(drawn, [lost]) == ("No row has a result: there are no figures.",)


@pytest.mark.parametrize(
    ("share", "told"), [(0.9999999, "99.99999 %"), (0.57, "57 %"), (0.123456789, "12.3456789 %"), (1e-4, "0.01 %")]
)
def test_a_share_of_a_precision_is_told_with_every_digit_that_it_has(share, told) -> None:
    campaign = a_campaign(("data_rate",), half_width=1e6)
    campaign.table.precision = SimpleNamespace(output="data_rate", quantile=share, confidence=share)
    words = CellRows(campaign, 0, [a_chunk(0, range(400), data_rate=1e8 + np.arange(400.0))]).precision_words()
    assert words.startswith(f"{told} quantile of ") and f" at {told} confidence; " in words


def test_rows_of_unlike_weights_miss_their_limits_and_know_their_quantile_by_their_weight() -> None:
    limits = (Limit("margin", 3.0, None, ""), Limit("outage", None, 0.5, ""))
    campaign = a_campaign(("margin", "outage"), limits=limits, half_width=1.0)
    campaign.table.precision = SimpleNamespace(output="margin", quantile=0.5, confidence=0.5)
    weight = [0.25, 3.0, 0.25, 0.5]
    chunk = a_chunk(0, range(4), weight=weight, margin=[2.0, 4.0, 5.0, 1.0], outage=[0.0, 0.0, 0.75, 0.75])
    found = CellRows(campaign, 0, [chunk]).summary((0.5,))
    assert found.missed.value == pytest.approx(1.0 / 4.0)  # rows 0, 2 and 3
    shares = {name: each.value for name, each in found.missed_by.items()}
    assert shares == pytest.approx({"margin": 0.75 / 4.0, "outage": 0.75 / 4.0})
    assert found.outputs["margin"].quantiles[0.5].value == 4.0  # of equal rows it would be 2
    assert found.outputs["margin"].mean.value == pytest.approx((0.5 + 12.0 + 1.25 + 0.5) / 4.0)
    many = a_chunk(0, range(400), weight=np.tile(weight, 100), margin=np.tile([2.0, 4.0, 5.0, 1.0], 100))
    cell = CellRows(campaign, 1, [many])
    assert cell.is_precise()
    assert cell.precision_words().startswith(
        "50 % quantile of margin: 4 dB, 4 dB to 4 dB at 50 % confidence; as precise"
    )


def test_a_radius_is_told_with_its_cell_and_with_what_is_not_known_of_it(monkeypatch) -> None:
    wanted = {0.125: Interval(2e-5, 1.5e-5, math.nan, 0.8)}
    monkeypatch.setattr(tails, "tail_of_time", lambda *given: SimpleNamespace(wanted=wanted))
    campaign = a_campaign(half_width=2.5e-6)
    campaign.cells[1].values = {"a.b": "1 W", "c": "x"}
    campaign.table.precision = SimpleNamespace(output="radius", quantile=0.875, confidence=0.8)
    cell = CellRows(campaign, 1, [a_chunk(0, range(3), margin=[1, 2, 3], survival=[1.0])])
    told = "87.5 % quantile of radius with a.b = 1 W with c = x: 20 µrad, 15 µrad to {} at 80 % confidence; {} as asked"
    assert cell.precision_words() == f"{told.format('unknown', 'NOT as precise')} for (± 2.5 µrad)."
    assert not cell.is_precise()
    wanted[0.125] = Interval(1.75e-5, 1.5e-5, 1.8e-5, 0.8)
    assert cell.precision_words() == (
        f"{told.replace('20 µrad', '17.5 µrad').format('18 µrad', 'as precise')} for (± 2.5 µrad)."
    )
    assert cell.is_precise()


def test_inputs_that_go_against_each_other_are_not_independent_either() -> None:
    """Of four inputs of which one is held, behind a pair that goes together less."""
    x = philox(35).random((300, 3))
    inputs = {"a": x[:, 0], "held": np.ones(300), "b": 0.3 * x[:, 0] + x[:, 1], "c": 0.1 * x[:, 2] - x[:, 1]}
    found = sensitivity(inputs, x[:, 0] + x[:, 2], "y")
    assert found.total == {}
    assert re.fullmatch(r"no total indices: b and c are not independent \(rank correlation -0\.9\d\)", found.note), (
        found.note
    )
