"""Clouds over several sites: how cloudiness hangs together between them, drawn skies, and the share with any clear."""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np
from numpy.typing import NDArray

from microrad import orbit
from microrad.core.arrays import Floats
from microrad.core.earth import EARTH_RADIUS_M
from microrad.mission.fields import MONTHS
from microrad.orbit.earth.epoch import LAST_DAY

WEATHER = 2
"""Purpose of the random numbers of the weather, the top word of their counter; those of acquisitions have 0 there."""

_LATTICE = 2**14  # points of the quadrature
_LEAST_PIVOT = 1e-9  # of a site that others decide

Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Site:
    """A place under the sky: its share of the time without clouds, one number for all months or twelve from January."""

    name: str
    latitude_rad: float
    longitude_rad: float
    availability: tuple[float, ...]

    def in_month(self, month: int) -> float:
        """Share of a month without clouds; months count from 1."""
        return self.availability[(month - 1) % len(self.availability)]


@dataclass(frozen=True, slots=True, eq=False)
class Weather:
    """The weather over sites: how long it holds, and how it hangs together between them.

    ``epoch`` is the instant from which times count; the first weather begins there. ``correlation`` has the shape
    (sites, sites).
    """

    epoch: orbit.Epoch
    sites: tuple[Site, ...]
    holds_s: float
    correlation: Floats


# -------------------------------------------------------------------------------------------------------- correlations
def distances_m(sites: Sequence[Site]) -> Floats:
    """Great-circle distances of sites on a sphere of the Earth's equatorial radius, m, shape (sites, sites).

    By the haversine, which is exact for near sites, too.
    """
    latitude = np.array([s.latitude_rad for s in sites])
    longitude = np.array([s.longitude_rad for s in sites])
    up, along = (0.5 * (x[:, None] - x[None, :]) for x in (latitude, longitude))
    haversine = np.sin(up) ** 2 + np.cos(latitude)[:, None] * np.cos(latitude)[None, :] * np.sin(along) ** 2
    return np.asarray(2.0 * EARTH_RADIUS_M * np.arcsin(np.sqrt(np.clip(haversine, 0.0, 1.0))))


def correlation(sites: Sequence[Site], length_m: float) -> Floats:
    """Correlation of the normal variables behind the clouds of sites: exp(-distance / length), shape (sites, sites).

    With great-circle distances it is positive definite on the sphere for sites apart from each other, whatever the
    length (T. Gneiting, "Strictly and non-strictly positive definite functions on spheres", Bernoulli 19 (2013)
    1327-1349, table 1: powered exponentials up to exponent 1).

    Args:
        sites: The sites.
        length_m: Distance at which the correlation is 1/e, m; 0: none between any two sites.
    """
    if length_m == 0.0:
        return np.eye(len(sites))
    return np.asarray(np.exp(-distances_m(sites) / length_m))


def _root(correlation: Floats) -> Floats:
    """The symmetric square root: sites in another order give the same rows in that order. One site twice is allowed."""
    values, vectors = np.linalg.eigh(correlation)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


# --------------------------------------------------------------------------------------------------------------- months
def months(epoch: orbit.Epoch, span_s: Span) -> list[tuple[float, int]]:
    """When each month of a span begins, s since the epoch, and which it is, from 1; the first begins with the span.

    A month begins at 0h UTC of its first day.

    Args:
        epoch: Instant from which times count.
        span_s: Start and end of the span, s.

    Raises:
        OrbitError: For a time outside the tables of `Epoch`.
    """
    year, month = (int(part) for part in epoch.utc(span_s[0])[:7].split("-"))
    found = [(span_s[0], month)]
    while True:
        year, month = (year, month + 1) if month < MONTHS else (year + 1, 1)
        if date(year, month, 1) > LAST_DAY:
            return found
        begins = epoch.seconds_to(orbit.Epoch(f"{year}-{month:02d}-01T00:00:00Z"))
        if begins >= span_s[1]:
            return found
        if begins > span_s[0]:
            found.append((begins, month))


def shares(sites: Sequence[Site], epoch: orbit.Epoch, span_s: Span) -> tuple[Floats, Floats]:
    """Length of each month's part of a span, s, shape (months,), and the sites' availability in it, (sites, months).

    Args:
        sites: The sites.
        epoch: Instant from which times count.
        span_s: Start and end of the span, s.
    """
    begins = months(epoch, span_s)
    lengths = np.diff([*(begin for begin, _ in begins), span_s[1]])
    return lengths, np.array([[s.in_month(month) for _, month in begins] for s in sites]).reshape(len(sites), -1)


def mean_availability(site: Site, epoch: orbit.Epoch, span_s: Span) -> float:
    """Share of a span without clouds over a site, the mean of its months by their time in it."""
    lengths, of = shares((site,), epoch, span_s)
    return float(np.dot(lengths, of[0]) / (span_s[1] - span_s[0]))


# ---------------------------------------------------------------------------------------------------------------- drawn
def clear_spells(weather: Weather, span_s: Span, seed: int, run: int) -> tuple[Floats, ...]:
    """When each site is clear in one run: sorted, disjoint spans (k, 2) in s for each site; those that touch are one.

    A Gaussian copula: for each interval of the weather a normal variable for each site, correlated as the weather says.
    A site is clear where its variable lies below the quantile of its availability in the month of the moment. So a
    month that begins within an interval changes what counts as clear and draws nothing.

    The numbers of a site come from a Philox stream of the seed, the run, the purpose `WEATHER` and its name: neither
    other sites, nor their order, nor the length of the span change them, and they are no numbers of an acquisition.

    Args:
        weather: The weather over the sites.
        span_s: Start and end, s since the epoch.
        seed: Seed of the mission's operations.
        run: Number of the run.
    """
    first = math.floor(span_s[0] / weather.holds_s)
    count = math.ceil(span_s[1] / weather.holds_s) - first
    white = np.array([_normals(s.name, seed, run, first + count)[first:] for s in weather.sites])
    sky = _root(weather.correlation) @ white
    begins = months(weather.epoch, span_s)
    changes = weather.holds_s * np.arange(first, first + count)
    edges = np.unique(np.concatenate(([begin for begin, _ in begins], changes)))
    edges = np.concatenate(([span_s[0]], edges[(edges > span_s[0]) & (edges < span_s[1])], [span_s[1]]))
    middle = 0.5 * (edges[1:] + edges[:-1])
    interval = np.clip(np.floor(middle / weather.holds_s).astype(np.int64) - first, 0, count - 1)
    month = np.searchsorted([begin for begin, _ in begins], middle, side="right") - 1
    _, of = shares(weather.sites, weather.epoch, span_s)
    return tuple(_spells(edges, row) for row in sky[:, interval] < _quantile(of)[:, month])


def _normals(name: str, seed: int, run: int, count: int) -> Floats:
    """Standard normal numbers of a site in one run, from the first interval on."""
    word = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")
    stream = np.random.Philox(key=np.array([seed, run], dtype=np.uint64), counter=[0, 0, word, WEATHER])
    return np.random.Generator(stream).standard_normal(count)


def _quantile(share: Floats) -> Floats:
    from scipy.special import ndtri

    return np.asarray(ndtri(share))


def _spells(edges: Floats, clear: NDArray[np.bool_]) -> Floats:
    """The clear ones of neighbouring pieces, joined."""
    change = np.flatnonzero(np.diff(np.concatenate(([False], clear, [False])).astype(np.int8)))
    return np.asarray(edges[change].reshape(-1, 2))


# ------------------------------------------------------------------------------------------------------ any one of them
def any_clear(weather: Weather, span_s: Span) -> float:
    """Share of a span in which at least one of the sites is clear, without drawing: one less the share with none.

    All are cloudy where each normal variable is above its quantile, which by symmetry has the probability of the
    multivariate normal distribution below the negative quantiles (`normal_below`); months count by their time.

    Args:
        weather: The weather over the sites.
        span_s: Start and end of the span, s.
    """
    lengths, of = shares(weather.sites, weather.epoch, span_s)
    none = [normal_below(-_quantile(month), weather.correlation) for month in of.T]
    return 1.0 - float(np.dot(lengths, none) / np.sum(lengths))


def normal_below(limits: Floats, correlation: Floats) -> float:
    """Probability that correlated standard normal variables all lie below their limits.

    A. Genz, "Numerical computation of multivariate normal probabilities", J. Comput. Graph. Stat. 1 (1992) 141-149:
    with the Cholesky factor the integral is one over the unit cube, of one dimension less. It is summed over 2^14
    points of a Richtmyer lattice (multiples of the roots of primes), folded so that it is periodic. No number is drawn,
    so that all machines have the same digits; the error is about 5e-6 for two or three variables and below 1e-4 for
    twenty. Independent variables have their product, exactly.

    Args:
        limits: The limits, infinite ones allowed, shape (n,).
        correlation: Their correlation, positive semidefinite, shape (n, n).
    """
    from scipy.special import ndtr, ndtri

    if np.any(limits == -math.inf):
        return 0.0
    some = limits < math.inf
    limits, correlation = limits[some], correlation[np.ix_(some, some)]
    if not limits.size or np.array_equal(correlation, np.eye(limits.size)):
        return float(np.prod(ndtr(limits)))
    order = np.argsort(limits, kind="stable")  # the hardest first: what is left then varies least
    factor, limits = _factor(correlation[np.ix_(order, order)]), limits[order]
    points = np.arange(1, _LATTICE + 1)
    below, product, drawn = np.full(_LATTICE, ndtr(limits[0])), np.ones(_LATTICE), np.empty((limits.size, _LATTICE))
    for k, root in enumerate(_prime_roots(limits.size - 1)):
        product = product * below
        fold = np.abs(2.0 * ((points * root) % 1.0) - 1.0)
        drawn[k] = ndtri(np.clip(fold * below, 1e-300, 1.0 - 1e-16))
        below = ndtr((limits[k + 1] - factor[k + 1, : k + 1] @ drawn[: k + 1]) / factor[k + 1, k + 1])
    return float(np.mean(product * below))


def _factor(correlation: Floats) -> Floats:
    """The Cholesky factor, with a small pivot in place of none where two variables are one."""
    size = correlation.shape[0]
    factor = np.zeros((size, size))
    for row in range(size):
        for column in range(row):
            left = correlation[row, column] - factor[row, :column] @ factor[column, :column]
            whole = factor[column, column] > _LEAST_PIVOT
            factor[row, column] = left / factor[column, column] if whole else 0.0
        rest = 1.0 - float(factor[row, :row] @ factor[row, :row])
        factor[row, row] = max(math.sqrt(max(rest, 0.0)), _LEAST_PIVOT)
    return factor


def _prime_roots(count: int) -> list[float]:
    """Square roots of the first primes."""
    found: list[int] = []
    number = 2
    while len(found) < count:
        if all(number % prime for prime in found):
            found.append(number)
        number += 1
    return [math.sqrt(prime) for prime in found]
