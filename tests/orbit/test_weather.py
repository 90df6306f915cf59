"""Clouds over several sites: correlations, months, drawn skies, the share with any clear; against scipy and by hand."""

import itertools
import math

import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import multivariate_normal

from microrad import orbit
from microrad.core.earth import EARTH_RADIUS_M
from microrad.orbit.day import weather as skies
from microrad.orbit.day.weather import Site, Weather

EPOCH = orbit.Epoch("2026-03-20T12:00:00Z")
HOLDS_S, MANY = 60.0, 40_000


def site(name, latitude_deg, longitude_deg, *availability):
    return Site(name, math.radians(latitude_deg), math.radians(longitude_deg), availability)


TENERIFE = site("tenerife", 28.3, -16.5, 0.7)
CALERN = site("calern", 43.75, 6.9, 0.5)
NEMEA = site("nemea", 37.9, 22.6, 0.3)
THREE = (TENERIFE, CALERN, NEMEA)


def weather(sites, length_m=2e6, epoch=EPOCH, holds_s=HOLDS_S):
    return Weather(epoch, tuple(sites), holds_s, skies.correlation(sites, length_m))


def clear_in(spells, time_s):
    """Whether each moment lies in one of the spans."""
    return np.any((spells[:, :1] <= time_s) & (time_s < spells[:, 1:]), axis=0)


def drawn(of, count=MANY, seed=1, run=0):
    """Whether each site is clear in each interval, (sites, count)."""
    spells = skies.clear_spells(of, (0.0, count * of.holds_s), seed, run)
    middle = (np.arange(count) + 0.5) * of.holds_s
    found = np.zeros((len(of.sites), count), dtype=bool)
    for row, spans in zip(found, spells, strict=True):
        edges = np.searchsorted(middle, spans)
        for first, last in edges:
            row[first:last] = True
    return found


# -------------------------------------------------------------------------------------------------------- correlations
def test_distances_are_arcs_of_a_great_circle():
    sites = [
        site("a", 0.0, 0.0),
        site("b", 0.0, 90.0),
        site("c", 90.0, 17.0),
        site("d", 0.0, -180.0),
        site("e", 0.0, 1e-6),
    ]
    quarter = 0.5 * math.pi * EARTH_RADIUS_M
    found = skies.distances_m(sites)
    assert found[0, 1:4] == pytest.approx([quarter, quarter, 2.0 * quarter], rel=1e-12)
    assert found[0, 4] == pytest.approx(math.radians(1e-6) * EARTH_RADIUS_M, rel=1e-9)
    assert np.array_equal(found, found.T) and np.all(np.diag(found) == 0.0)


def test_clouds_at_one_length_apart_are_correlated_by_one_over_e():
    one_length = [site("a", 0.0, 0.0), site("b", 0.0, math.degrees(1e6 / EARTH_RADIUS_M))]
    assert skies.correlation(one_length, 1e6)[0, 1] == pytest.approx(math.exp(-1.0), rel=1e-12)
    assert skies.correlation(one_length, 2e6)[0, 1] == pytest.approx(math.exp(-0.5), rel=1e-12)
    assert np.array_equal(skies.correlation(one_length, 0.0), np.eye(2))


@pytest.mark.parametrize("length_m", [1e4, 1e6, 2e7, 1e9])
def test_the_correlation_is_positive_definite_wherever_sites_stand(length_m):
    draw = np.random.default_rng(1)
    latitudes, longitudes = np.degrees(np.arcsin(draw.uniform(-1.0, 1.0, 60))), draw.uniform(-180.0, 180.0, 60)
    latitudes, longitudes = np.append(latitudes, [90.0, -90.0, 0.0, 0.0]), np.append(longitudes, [0.0, 0.0, 0.0, 180.0])
    sites = [site(str(k), *each) for k, each in enumerate(zip(latitudes, longitudes, strict=True))]
    values = np.linalg.eigvalsh(skies.correlation(sites, length_m))
    assert values[0] > 0.0
    # its opposite, a wider hat, is not: the test can fail
    square = np.exp(-((skies.distances_m(sites) / 2e7) ** 2))
    assert np.linalg.eigvalsh(square)[0] < 0.0


# --------------------------------------------------------------------------------------------------------------- drawn
def test_each_site_is_clear_as_often_as_its_availability_says():
    found = drawn(weather(THREE)).mean(axis=1)
    for share, each in zip(found, THREE, strict=True):
        (p,) = each.availability
        assert abs(share - p) < 5.0 * math.sqrt(p * (1.0 - p) / MANY)
    assert len(set(found)) == 3


@pytest.mark.parametrize("length_m", [0.0, 1e6, 1e7])
def test_two_sites_are_clear_together_as_often_as_the_normal_distribution_says(length_m):
    of = weather(THREE, length_m)
    found = drawn(of)
    for a, b in itertools.combinations(range(3), 2):
        limits, pair = ndtri([THREE[k].availability[0] for k in (a, b)]), of.correlation[np.ix_((a, b), (a, b))]
        p = float(multivariate_normal.cdf(limits, cov=pair))
        assert abs(np.mean(found[a] & found[b]) - p) < 5.0 * math.sqrt(p * (1.0 - p) / MANY)
        alone = math.prod(THREE[k].availability[0] for k in (a, b))
        assert (p - alone > 1e-3) == (length_m > 0.0)


def test_no_interval_says_anything_of_the_next():
    found = drawn(weather([TENERIFE]))[0]
    both = float(np.mean(found[1:] & found[:-1]))
    assert abs(both - 0.49) < 5.0 * math.sqrt(0.49 * 0.51 / MANY) * 2.0
    assert np.any(found[1:] != found[:-1])


def test_a_seed_repeats_and_another_seed_or_run_does_not():
    of = weather(THREE)
    first = drawn(of, 50)
    assert np.array_equal(first, drawn(of, 50))
    assert not np.array_equal(first, drawn(of, 50, seed=2))
    assert not np.array_equal(first, drawn(of, 50, run=1))
    assert not np.array_equal(drawn(of, 50, seed=2), drawn(of, 50, run=2))


def test_neither_the_order_of_sites_nor_the_length_of_the_span_changes_the_weather():
    first = drawn(weather(THREE), 200)
    turned = drawn(weather((NEMEA, TENERIFE, CALERN)), 200)
    assert np.array_equal(first, turned[[1, 2, 0]])
    assert np.array_equal(first, drawn(weather(THREE), 400)[:, :200])
    assert not np.array_equal(first[0], first[1])


def test_independent_sites_keep_their_weather_when_another_joins():
    two = drawn(weather((TENERIFE, CALERN), 0.0), 200)
    assert np.array_equal(two, drawn(weather(THREE, 0.0), 200)[:2])
    assert not np.array_equal(two, drawn(weather(THREE, 1e7), 200)[:2])


def test_two_sites_at_one_place_have_one_sky():
    twin = site("twin", 28.3, -16.5, 0.7)
    found = drawn(weather((TENERIFE, twin)), 2000)
    assert np.array_equal(found[0], found[1])
    apart = drawn(weather((TENERIFE, twin), 0.0), 2000)
    assert not np.array_equal(apart[0], apart[1])


def test_always_and_never_clear_are_that():
    always, never = site("a", 0.0, 0.0, 1.0), site("b", 1.0, 1.0, 0.0)
    spells = skies.clear_spells(weather((always, never)), (0.0, 86400.0), 1, 0)
    assert spells[0].tolist() == [[0.0, 86400.0]]
    assert spells[1].shape == (0, 2)


# -------------------------------------------------------------------------------------------------------------- months
WINTER_ONLY = (*[1.0] * 3, *[0.0] * 8, 1.0)  # January to March, and December


def test_a_month_begins_at_midnight_of_its_first_day():
    of = weather([site("a", 0.0, 0.0, *WINTER_ONLY)], epoch=orbit.Epoch("2026-03-31T22:00:00Z"), holds_s=7 * 3600.0)
    (spells,) = skies.clear_spells(of, (0.0, 86400.0), 1, 0)
    assert spells.tolist() == [[0.0, 7200.0]]


def test_a_month_waits_for_the_leap_second():
    autumn = (*[0.0] * 11, 1.0)
    of = weather([site("a", 0.0, 0.0, *autumn)], epoch=orbit.Epoch("2016-12-31T23:00:00Z"), holds_s=1e5)
    (spells,) = skies.clear_spells(of, (0.0, 86400.0), 1, 0)
    assert spells.tolist() == [[0.0, 3601.0]]


def test_months_of_a_span_by_the_calendar():
    begins = skies.months(orbit.Epoch("2027-11-15T00:00:00Z"), (0.0, 100 * 86400.0))
    assert begins == [(0.0, 11), (16 * 86400.0, 12), (47 * 86400.0, 1), (78 * 86400.0, 2)]
    later = skies.months(orbit.Epoch("2027-11-15T00:00:00Z"), (20 * 86400.0, 47 * 86400.0))
    assert later == [(20 * 86400.0, 12)]
    from_the_first = skies.months(orbit.Epoch("2027-11-15T00:00:00Z"), (16 * 86400.0, 47 * 86400.0 + 1.0))
    assert from_the_first == [(16 * 86400.0, 12), (47 * 86400.0, 1)]


def test_the_last_month_of_the_tables_has_no_next_one():
    assert skies.months(orbit.Epoch("2050-12-30T00:00:00Z"), (0.0, 86400.0)) == [(0.0, 12)]


def test_the_mean_of_a_span_counts_months_by_their_time():
    one = site("a", 0.0, 0.0, *(0.1 * month for month in range(1, 11)), 1.0, 0.0)
    epoch = orbit.Epoch("2026-03-31T18:00:00Z")
    assert skies.mean_availability(one, epoch, (0.0, 86400.0)) == pytest.approx(0.25 * 0.3 + 0.75 * 0.4, rel=1e-12)
    assert skies.mean_availability(TENERIFE, epoch, (0.0, 86400.0)) == pytest.approx(0.7, rel=1e-12)


# ------------------------------------------------------------------------------------------------ any one of the sites
@pytest.mark.parametrize(("count", "error"), [(2, 1e-5), (3, 1e-5), (6, 3e-5), (12, 1e-4)])
def test_the_probability_below_limits_is_that_of_scipy(count, error):
    draw = np.random.default_rng(count)
    places = zip(draw.uniform(-60.0, 60.0, count), draw.uniform(-180.0, 180.0, count), strict=True)
    sites = [site(str(k), *each) for k, each in enumerate(places)]
    limits = draw.normal(0.8, 0.5, count)
    for length_m in (2e6, 5e7):
        cov = skies.correlation(sites, length_m)
        found = skies.normal_below(limits, cov)
        expected = multivariate_normal.cdf(limits, cov=cov, abseps=1e-6, releps=1e-6, maxpts=300_000)
        assert found == pytest.approx(expected, abs=error)
        assert abs(found - np.prod([multivariate_normal.cdf(x) for x in limits])) > 1e-4


def test_limits_that_are_none_and_limits_that_nothing_meets():
    cov = np.array([[1.0, 0.6, 0.2], [0.6, 1.0, 0.3], [0.2, 0.3, 1.0]])
    assert skies.normal_below(np.array([0.2, -math.inf, 1.0]), cov) == 0.0
    assert skies.normal_below(np.array([math.inf] * 3), cov) == 1.0
    two = skies.normal_below(np.array([0.2, 0.5]), cov[:2, :2])
    assert skies.normal_below(np.array([0.2, 0.5, math.inf]), cov) == two
    assert 0.0 < two < 1.0


def test_one_variable_twice_counts_once():
    same = np.ones((2, 2))
    assert skies.normal_below(np.array([0.3, 0.3]), same) == pytest.approx(multivariate_normal.cdf(0.3), abs=2e-4)
    assert skies.normal_below(np.array([0.3, 2.0]), same) == pytest.approx(multivariate_normal.cdf(0.3), abs=2e-4)


def test_one_variable_twice_beside_another_counts_once():
    pair = np.array([[1.0, 0.5], [0.5, 1.0]])
    same = np.array([[1.0, 1.0, 0.5], [1.0, 1.0, 0.5], [0.5, 0.5, 1.0]])
    two = skies.normal_below(np.array([0.3, 1.0]), pair)
    assert skies.normal_below(np.array([0.3, 0.3, 1.0]), same) == pytest.approx(two, abs=2e-4)
    np.testing.assert_allclose(skies._factor(same)[2], [0.5, 0.0, math.sqrt(0.75)], atol=1e-12)


def test_independent_sites_leave_the_product_of_their_clouds():
    share = skies.any_clear(weather(THREE, 0.0), (0.0, 86400.0))
    assert share == pytest.approx(1.0 - 0.3 * 0.5 * 0.7, rel=1e-12)


@pytest.mark.parametrize("length_m", [0.0, 1e6, 1e7])
def test_the_share_with_any_clear_is_that_of_the_drawn_skies(length_m):
    of = weather(THREE, length_m)
    share = skies.any_clear(of, (0.0, MANY * HOLDS_S))
    assert abs(np.mean(drawn(of).any(axis=0)) - share) < 5.0 * math.sqrt(share * (1.0 - share) / MANY)
    assert (share < 0.89) == (length_m > 0.0)


def test_correlated_clouds_make_a_network_worth_less():
    shares = [skies.any_clear(weather(THREE, length_m), (0.0, 86400.0)) for length_m in (0.0, 1e6, 1e7, 1e9)]
    assert shares == sorted(shares, reverse=True)
    assert shares[-1] > 0.7 - 1e-3  # never less than the best alone
    assert shares[-1] < 0.72


def test_the_share_with_any_clear_counts_months_by_their_time():
    epoch = orbit.Epoch("2026-03-31T18:00:00Z")
    sites = site("a", 0.0, 0.0, *([0.5] * 3 + [0.2] * 9)), site("b", 40.0, 0.0, 0.5)
    found = skies.any_clear(weather(sites, 0.0, epoch), (0.0, 86400.0))
    assert found == pytest.approx(0.25 * 0.75 + 0.75 * 0.6, rel=1e-12)


MONTHLY = Site("monthly", 0.49, -0.29, tuple(0.05 + 0.07 * k for k in range(12)))
APART = Weather(
    orbit.Epoch("2026-02-27T06:00:00Z"),
    (MONTHLY, CALERN, NEMEA),
    7200.0,
    skies.correlation((MONTHLY, CALERN, NEMEA), 9e5),
)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: [*skies.distances_m((MONTHLY, CALERN, NEMEA)).ravel()],
            [0.0, 2728633.17, 3790754.45, 2728633.17, 0.0, 1470888.14, 3790754.45, 1470888.14, 0.0],
        ),
        (
            lambda: [*APART.correlation.ravel()],
            [1.0, 0.0482280423, 0.0148174553, 0.0482280423, 1.0, 0.195084953, 0.0148174553, 0.195084953, 1.0],
        ),
        (
            lambda: [MONTHLY.in_month(month) for month in (1, 2, 11, 12)] + [CALERN.in_month(7)],
            [0.05, 0.12, 0.75, 0.82, 0.5],
        ),
        (
            lambda: [x for each in skies.months(APART.epoch, (-3.6e6, 3e6)) for x in each],
            [-3600000.0, 1, -2268000.0, 2, 151200.0, 3, 2829600.0, 4],
        ),
        (
            lambda: [x for each in skies.months(orbit.Epoch("2050-11-30T06:00:00Z"), (-9e4, 2.2e6)) for x in each],
            [-90000.0, 11, 64800.0, 12],
        ),
        (
            lambda: [x for each in skies.shares((MONTHLY, CALERN), APART.epoch, (-3600.0, 3e5)) for x in each.ravel()],
            [154800.0, 148800.0, 0.12, 0.19, 0.5, 0.5],
        ),
        (
            lambda: [skies.mean_availability(each, APART.epoch, (-3600.0, 3e5)) for each in APART.sites],
            [0.1543083, 0.5, 0.3],
        ),
        (
            lambda: [skies.any_clear(APART, (-3600.0, 3e5)), skies.any_clear(APART, (2e5, 3e5))],
            [0.677292458, 0.690176404],
        ),
        (
            lambda: [x for spells in skies.clear_spells(APART, (5000.0, 47_000.0), 3, 2) for x in spells.ravel()],
            [36000.0, 43200.0, 7200.0, 14400.0, 21600.0, 28800.0, 43200.0, 47000.0, 28800.0, 36000.0],
        ),
        (
            lambda: [x for spells in skies.clear_spells(APART, (130_000.0, 170_000.0), 5, 1) for x in spells.ravel()],
            [165600.0, 170000.0, 151200.0, 165600.0],
        ),
        (
            lambda: [
                skies.normal_below(np.array([0.7, -0.4, 1.3, 0.2]), skies.correlation((*THREE, MONTHLY), 7e5)),
                skies.normal_below(np.array([0.7, math.inf, -0.4]), skies.correlation(THREE, 3e6)),
            ],
            [0.186901781, 0.292758515],
        ),
        (lambda: skies._prime_roots(6), [1.41421356, 1.73205081, 2.23606798, 2.64575131, 3.31662479, 3.60555128]),
        (
            lambda: [*skies._factor(APART.correlation).ravel()],
            [1.0, 0.0, 0.0, 0.0482280423, 0.998836351, 0.0, 0.0148174553, 0.194596778, 0.980771399],
        ),
    ],
)
def test_skies_of_sites_and_months_unlike_each_other(found, expected):
    assert list(found()) == pytest.approx(expected, rel=1e-6, abs=0.0, nan_ok=True)


def test_places_on_opposite_sides_of_the_earth_are_half_a_turn_apart():
    for latitude in (-1.495, -1.465, -1.455, -1.451, -1.441, -1.437, -1.399, -1.39, -0.5, 0.0, 0.7):
        pair = [Site("a", latitude, 0.0, (0.5,)), Site("b", -latitude, -math.pi, (0.5,))]
        found = skies.distances_m([*pair, Site("c", math.pi / 2.0, 0.0, (0.5,))])
        # near the half turn an angle is known to the root of the last digit
        assert found[0, 1] == found[1, 0] == pytest.approx(math.pi * EARTH_RADIUS_M, abs=1.0)
        assert found[0, 2] == pytest.approx((math.pi / 2.0 - latitude) * EARTH_RADIUS_M, abs=1.0)
        assert np.all(np.diag(found) == 0.0)


def test_no_seed_has_the_weather_of_another_in_one_of_its_runs():
    of = weather(THREE)
    skies_of = [drawn(of, 20, seed=seed, run=run).tobytes() for seed in range(3) for run in range(3)]
    assert len(set(skies_of)) == 9
