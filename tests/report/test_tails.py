"""The tail of the radial error: quantiles with intervals that hold, and how many samples correlated ones are worth."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from microrad.loop.controller_study import Residual
from microrad.loop.pointing_loop.ensemble import bin_edges_rad
from microrad.report.fine_pointing import tails

RUNS, SAMPLES, KEPT = 48, 1500, 0.9
SIGMA_RAD = 2e-6  # of each axis


def residual(seed, kept=KEPT, runs=RUNS):
    """Two Gaussian axes of first order, binned as an ensemble bins them, with its interval of the rms."""
    rng = np.random.default_rng(seed)
    white = rng.standard_normal((runs, 2, SAMPLES + 200)) * math.sqrt(1.0 - kept**2)
    axes = SIGMA_RAD * lfilter([1.0], [1.0, -kept], white)[..., 200:]
    squares = np.sum(axes**2, axis=1)
    by_run = squares.mean(axis=1)
    rms = math.sqrt(by_run.mean())
    half = 2.576 * np.std(by_run, ddof=1) / math.sqrt(runs) / (2.0 * rms) if runs > 1 else math.inf
    counts = np.histogram(np.sqrt(squares), bin_edges_rad())[0]
    return Residual(rms, float(half), (), (), counts, 0.0, float(np.sqrt(squares.max())), {})


def true_quantile_rad(share):
    """Of a Rayleigh distribution."""
    return SIGMA_RAD * math.sqrt(-2.0 * math.log(1.0 - share))


def test_correlated_samples_are_worth_what_their_squares_are():
    """The squares of a first-order process have the correlation kept^2 a step: (1 + kept^2)/(1 - kept^2) for one."""
    found = np.array([tails.independent_samples(residual(seed)) for seed in range(20)])
    expected = RUNS * SAMPLES * (1.0 - KEPT**2) / (1.0 + KEPT**2)
    assert np.median(found) == pytest.approx(expected, rel=0.15)
    white = [tails.independent_samples(residual(seed, kept=0.0)) for seed in range(20)]
    assert np.median(white) == pytest.approx(RUNS * SAMPLES, rel=0.15)
    assert max(white) <= RUNS * SAMPLES


@pytest.mark.promise("report-6")
def test_intervals_hold_the_true_quantile_and_are_not_idle():
    shares, inside, widths = (0.5, 0.9, 0.99), [], []
    for seed in range(60):
        left = residual(seed)
        for share in shares:
            q = tails.quantile(left, share)
            assert q.low_rad < q.value_rad < q.high_rad
            inside.append(q.low_rad <= true_quantile_rad(share) <= q.high_rad)
            widths.append((q.high_rad - q.low_rad) / q.value_rad)
    assert np.mean(inside) >= 0.97
    assert max(widths) < 0.12


def test_what_too_few_samples_cannot_tell_is_not_told():
    left = residual(1)
    rare = 1.0 - 0.5 * tails.LEAST_BEYOND / tails.independent_samples(left)
    q = tails.quantile(left, rare)
    assert math.isnan(q.low_rad)
    assert q.value_rad > true_quantile_rad(0.99)
    assert tails.cell(q).splitlines()[1] == "too few samples"
    single = residual(1, runs=1)
    assert math.isnan(tails.independent_samples(single))
    assert math.isnan(tails.quantile(single, 0.5).low_rad)


@pytest.mark.promise("report-6")
def test_the_time_beyond_a_radius_has_an_interval_even_where_none_was_seen():
    left = residual(2)
    share, low, high = tails.beyond(left, true_quantile_rad(0.99))
    assert low < 0.01 < high
    assert low < share < high
    none = tails.beyond(left, 20.0 * SIGMA_RAD)
    assert none[:2] == (0.0, 0.0)
    n = tails.independent_samples(left)
    assert none[2] == pytest.approx(2.576**2 / (n + 2.576**2), rel=1e-9)  # Wilson's upper end for none of n
    assert tails._share(none).startswith("none seen, at most 0.")
    assert tails._share((0.0, math.nan, math.nan)) == "none seen"
    assert tails._share((0.01, 0.008, 0.012)) == "1 % (0.8 % to 1.2 %)"


def test_the_curve_falls_to_the_last_sample_seen():
    left = residual(3)
    radius, share = tails.survival(left)
    assert np.all(np.diff(share) <= 0.0)
    assert np.all(np.diff(radius) > 0.0)
    assert 0.0 < share[-1] < 30.0 / left.radial_counts.sum()
    at = np.searchsorted(radius, true_quantile_rad(0.9))
    assert share[at] == pytest.approx(0.1, abs=0.02)
    wider = replace(left, radial_counts=np.roll(left.radial_counts, 16))  # an octave of the square
    assert tails.survival(wider)[0] == pytest.approx(radius * math.sqrt(2.0), rel=1e-12)


def test_without_a_scatter_or_samples_nothing_is_known_of_the_tail():
    left = residual(4)
    none = replace(left, radial_counts=np.zeros_like(left.radial_counts))
    for blind in (none, replace(left, rms_interval_rad=0.0), replace(left, rms_interval_rad=math.nan)):
        assert math.isnan(tails.independent_samples(blind))
    blind = replace(left, rms_interval_rad=math.inf)
    share, *ends = tails.beyond(blind, true_quantile_rad(0.9))
    assert share == pytest.approx(0.1, abs=0.05) and all(math.isnan(end) for end in ends)
    sure = replace(left, rms_interval_rad=1e-20)
    assert tails.independent_samples(sure) == left.radial_counts.sum()  # no more than there are


@pytest.mark.parametrize(("independent", "known"), [(20.0, True), (19.9, False), (math.nan, False)])
def test_a_quantile_has_an_interval_from_ten_samples_beyond_it_on(monkeypatch, independent, known):
    monkeypatch.setattr(tails, "independent_samples", lambda left: independent)
    q = tails.quantile(residual(5, runs=2), 0.5)
    assert math.isnan(q.low_rad) is not known
    assert math.isnan(q.high_rad) is not known


def test_what_is_not_known_of_a_tail_is_said_shortly():
    assert tails._share((0.01, math.nan, math.nan)) == "1 %"
    assert (tails._count(math.nan), tails._count(12345.0)) == ("unknown", "12000")
    assert tails.cell(tails.Quantile(0.5, 1e-6, 0.5e-6, 2e-6)) == "1.00\n0.500 to 2.00"
