"""Distributions of pointing errors by their characteristic functions, and of sums of them: no central limit.

A part is a mixture of cases. In each of them the error about all axes together is a mean, a Gaussian, an even spread
along one direction and a sinusoid of random phase, added up, so that the characteristic function of a case is

    exp(i u'm - u'Cu / 2) sinc(u'h) J0(abs(u'a)),  sinc x = sin x / x.

Those of independent parts multiply. What lies within a limit follows from the Fourier series of the density on a range
that holds it all but for less than 1e-9.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Complexes, Floats, Integers

_SIGMAS = 8.0  # of the Gaussian part that the range of the series holds on each side
_OF_ALL = 10.0  # of all parts together, where their bounds add up to more
_NEGLIGIBLE = 1e-11  # characteristic function at which the series ends
_CHUNK, _MOST, _MOST_PLANE, _MOST_OF_OTHERS = 16, 1 << 14, 256, 128  # terms at a time, and at most along an axis
_BLOCK = 2_000_000  # numbers of an intermediate array
_KERNELS = 64  # that a grid keeps
_TAPER = 6.0  # width of the taper that ends a series of the most terms
_ENDED = 1e-6  # characteristic function at the last terms of a series, below which no taper has to end it
_LAST = 2e-5  # taper of those
_FAR_OFF = 0.012  # deviation beside the length of a mean, up to which only its direction counts
_NO_SPREAD = 1e-12  # standard deviation beside the mean below which all is taken as constant
_SURE = np.ones(1)
_HALVES = 2.0  # points of a plane for which one of half of it stands: itself and its conjugate


@dataclass(frozen=True, slots=True)
class Part:
    """An error about each of n axes as a mixture of cases, k of them.

    Args:
        weight: Probability of each case, shape (k,); they add up to 1.
        mean: Mean (rad), shape (k, n).
        covariance: Covariance of the Gaussian (rad^2), shape (k, n, n).
        half_width: Half of an even spread along one direction (rad), shape (k, n).
        amplitude: Complex amplitude of a sinusoid (rad), shape (k, n): its phases are those of the axes to each other.
    """

    weight: Floats
    mean: Floats
    covariance: Floats
    half_width: Floats
    amplitude: Complexes

    @property
    def axes(self) -> int:
        """Number of axes."""
        return int(self.mean.shape[1])

    @property
    def whole_mean(self) -> Floats:
        """Mean of all cases (rad), shape (n,)."""
        return np.asarray(self.weight @ self.mean)

    def times(self, factor: float) -> "Part":
        """The same error, so many times as large."""
        return Part(
            self.weight, self.mean * factor, self.covariance * factor**2, self.half_width * factor,
            self.amplitude * factor,
        )  # fmt: skip


def _squares(vectors: Floats) -> Floats:
    return np.asarray(vectors[:, :, None] * vectors[:, None])


def case(
    axes: int,
    *,
    mean: Floats | None = None,
    covariance: Floats | None = None,
    half_width: Floats | None = None,
    amplitude: Complexes | None = None,
    weight: Floats = _SURE,
) -> Part:
    """A part of one case, or of as many as `weight` has; what is not given is zero.

    Args:
        axes: Number of axes.
        mean: Mean (rad), shape (k, n), or (n,) of one case; the rest alike.
        covariance: Covariance of the Gaussian (rad^2).
        half_width: Half of an even spread (rad).
        amplitude: Complex amplitude of a sinusoid (rad).
        weight: Probability of each case.
    """
    cases = len(weight)
    none = np.zeros((cases, axes))
    return Part(
        weight,
        none if mean is None else mean.reshape(cases, axes),
        np.zeros((cases, axes, axes)) if covariance is None else covariance.reshape(cases, axes, axes),
        none if half_width is None else half_width.reshape(cases, axes),
        none.astype(complex) if amplitude is None else amplitude.reshape(cases, axes),
    )


def mixture(parts: Sequence[Part], weight: Floats) -> Part:
    """One of several parts, each with its probability.

    Args:
        parts: The parts.
        weight: Probability of each, shape (parts,).
    """
    if len(parts) == 1:
        return parts[0]
    joined = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("mean", "covariance", "half_width", "amplitude")
    )
    return Part(np.concatenate([w * part.weight for w, part in zip(weight, parts, strict=True)]), *joined)


@dataclass(frozen=True, slots=True)
class Bundle:
    """The cases of several parts, one behind the other; part p has those from begin[p] on."""

    cases: Part
    begin: Integers

    @classmethod
    def of(cls, parts: Sequence[Part]) -> "Bundle":
        """Gather them.

        Args:
            parts: The parts, of the same axes, at least one.
        """
        sizes = [len(part.weight) for part in parts]
        return cls(mixture(parts, np.ones(len(parts))), np.cumsum([0, *sizes[:-1]]))

    def about(self, axes: tuple[int, ...]) -> "Sum":
        """The sum of the parts about one axis, or about two for the radial error.

        Args:
            axes: Places of the axes.
        """
        of, at = self.cases, list(axes)
        chosen = Part(
            of.weight, of.mean[:, at], of.covariance[:, at][:, :, at], of.half_width[:, at], of.amplitude[:, at]
        )
        return Sum(Bundle(chosen, self.begin))


class Sum:
    """The sum of independent parts about one axis, or about two for the radial error.

    Args:
        bundle: The parts, all about one axis or all about two.
    """

    def __init__(self, bundle: Bundle) -> None:
        """Gather moments, and what the series has to hold."""
        of, begin = bundle.cases, bundle.begin
        self._bundle, self.axes = bundle, of.axes

        def by_part(values: Floats) -> Floats:
            return np.add.reduceat(values, begin, axis=0)

        weight = of.weight[:, None]
        means = by_part(weight * of.mean)
        turned = (of.amplitude[:, :, None] * of.amplitude[:, None].conj()).real
        each = of.covariance + _squares(of.half_width) / 3.0 + 0.5 * turned + _squares(of.mean)
        spread = by_part(weight[:, :, None] * each) - _squares(means)
        self.mean, self.covariance = np.asarray(means.sum(axis=0)), np.asarray(spread.sum(axis=0))
        counts = np.diff([*begin, len(of.weight)])
        off = np.abs(of.mean - np.repeat(means, counts, axis=0)) + np.abs(of.half_width) + np.abs(of.amplitude)
        bounds = np.maximum.reduceat(off, begin, axis=0)
        gaussian = np.maximum.reduceat(np.diagonal(of.covariance, axis1=1, axis2=2), begin, axis=0).sum(axis=0)
        every = bounds.sum(axis=0) + _SIGMAS * np.sqrt(gaussian)
        reach = np.minimum(every, _OF_ALL * self.sigma + bounds.max(axis=0))
        self._centre = self.mean
        if self.axes == 2:  # a circle about zero has to lie within the square of the series
            self._centre, reach = np.zeros(2), math.sqrt(2.0) * (reach + np.abs(self.mean))
        self._range = float(np.max(reach))

        alone = np.repeat(counts == 1, counts)
        self._mean, self._gaussian = of.mean[alone].sum(axis=0) - self._centre, of.covariance[alone].sum(axis=0)
        self._even = of.half_width[alone & of.half_width.any(axis=1)]
        self._turning = of.amplitude[alone & of.amplitude.any(axis=1)]
        self._mixed = Part(of.weight[~alone], of.mean[~alone], of.covariance[~alone], of.half_width[~alone],
                           of.amplitude[~alone])  # fmt: skip
        self._begin = np.cumsum([0, *counts[counts > 1][:-1]]) if (counts > 1).any() else np.zeros(0, dtype=int)

    @property
    def sigma(self) -> Floats:
        """Standard deviation about each axis (rad), shape (n,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    def characteristic(self, u: Floats) -> Complexes:
        """Characteristic function about the centre at some points (1/rad), shape (points, n); returns shape (points,).

        Where the parts of one case leave less than 1e-11, it is taken as 0.
        """
        from scipy.special import j0

        found = np.exp(1j * (u @ self._mean) - 0.5 * np.einsum("pi,ij,pj->p", u, self._gaussian, u))
        if len(self._even):
            found *= np.prod(np.sinc(u @ self._even.T / np.pi), axis=1)
        if len(self._turning):
            found *= np.prod(j0(np.abs(u @ self._turning.T)), axis=1)
        some = np.flatnonzero(np.abs(found) >= _NEGLIGIBLE)
        found[np.abs(found) < _NEGLIGIBLE] = 0.0
        if len(self._begin):
            block = max(_BLOCK // len(self._mixed.weight), 1)
            for first in range(0, len(some), block):
                at = some[first : first + block]
                found[at] *= self._of_mixed(u[at])
        return np.asarray(found)

    def at(self, u: Floats) -> Complexes:
        """Characteristic function about zero at some points (1/rad), shape (points, n); returns shape (points,)."""
        return np.asarray(self.characteristic(u) * np.exp(1j * (u @ self._centre)))

    def _of_mixed(self, u: Floats) -> Complexes:
        """Product over the parts of several cases, shape (points,)."""
        from scipy.special import j0

        of = self._mixed
        each = _turns(u, of.mean) * of.weight
        for some, factor in (
            (of.covariance.any(axis=(1, 2)), lambda at: np.exp(-0.5 * _quadratic(u, of.covariance[at]))),
            (of.half_width.any(axis=1), lambda at: np.sinc(u @ of.half_width[at].T / np.pi)),
            (of.amplitude.any(axis=1), lambda at: j0(np.abs(u @ of.amplitude[at].T))),
        ):
            if some.all():
                each *= factor(some)
            elif some.any():
                each[:, some] *= factor(some)
        return np.asarray(np.prod(np.add.reduceat(each, self._begin, axis=1), axis=1))

    def quantile(self, share: float) -> float:
        """Size of the error, radial for two axes, that is not exceeded with a probability (rad).

        Args:
            share: The probability, above 0 and below 1.
        """
        if self.constant:
            return float(np.linalg.norm(self.mean))
        return (self._along_the_mean() if self.is_far_off(_FAR_OFF) else self).series().quantile(share)

    def is_far_off(self, most: float) -> bool:
        """Whether its mean is so long that only its direction counts: no deviation is more than a part of it."""
        return self.axes == 2 and float(np.max(self.sigma)) < most * float(np.linalg.norm(self.mean))

    def within(self, size_rad: Floats) -> Floats:
        """Probability that the error, radial for two axes, is not above a size, shape (sizes,).

        Args:
            size_rad: The sizes (rad), shape (sizes,).
        """
        if self.constant:
            return np.asarray(np.linalg.norm(self.mean) <= size_rad, dtype=float)
        series = (self._along_the_mean() if self.is_far_off(_FAR_OFF) else self).series()
        reach = series.grid.reach + abs(series.grid.centre)
        found = [1.0 if size >= reach else series.within(size) for size in size_rad.tolist()]
        return np.clip(found, 0.0, 1.0)

    def _along_the_mean(self) -> "Sum":
        """The same in the direction of the mean alone: what lies across it hardly makes a large mean longer."""
        return self.along(self.mean / np.linalg.norm(self.mean))

    def along(self, u: Floats) -> "Sum":
        """The same in a direction alone, a unit vector of shape (n,)."""
        of = self._bundle.cases
        along = Part(
            of.weight,
            (of.mean @ u)[:, None],
            np.einsum("i,kij,j->k", u, of.covariance, u)[:, None, None],
            (of.half_width @ u)[:, None],
            (of.amplitude @ u)[:, None],
        )
        return Sum(Bundle(along, self._bundle.begin))

    @property
    def constant(self) -> bool:
        """Whether nothing of it is spread."""
        return float(np.max(self.sigma)) <= _NO_SPREAD * float(np.linalg.norm(self.mean)) or self._range == 0.0

    def series(self, reach_rad: float = 0.0) -> "Series":
        """The series of the density, for a range that reaches at least so far (rad)."""
        reach = max(self._range, reach_rad)
        step = math.pi / reach
        if self.axes == 1:
            terms = self._terms(step)
            u = step * np.arange(1.0, len(terms) + 1.0)[:, None]
            return Series.of(Grid(u, float(self._centre[0]), reach), terms)
        count = _count(lambda u: np.abs(self.characteristic(u)), step, _MOST_PLANE)
        u, taper = _plane(step, count, _MOST_PLANE)
        terms = _HALVES * self.characteristic(u)
        keep = np.abs(terms) > _NEGLIGIBLE  # the kernels of the others are not needed
        return Series.of(Grid(u[keep], 0.0, reach), terms[keep], None if taper is None else taper[keep])

    def _terms(self, step: float) -> Complexes:
        """Characteristic function of one axis at 1, 2, ... steps, up to where it is negligible."""
        found, count = np.zeros(0, dtype=complex), 2 * _CHUNK
        while True:
            more = self.characteristic(step * np.arange(len(found) + 1.0, count + 1.0)[:, None])
            found = np.concatenate([found, more])
            if np.max(np.abs(more[-_CHUNK:])) < _NEGLIGIBLE:
                return found
            if count >= _MOST:
                return np.asarray(found * _taper(np.arange(1, count + 1) / count))
            count = min(max(count + _CHUNK, count * 3 // 2), _MOST)


def _quadratic(u: Floats, covariance: Floats) -> Floats:
    """u'Cu of each case, shape (points, cases)."""
    return np.asarray(np.einsum("pi,kij,pj->pk", u, covariance, u))


def _turns(u: Floats, mean: Floats) -> Complexes:
    """exp(i u'm) of each case, shape (points, cases); one behind the other where the points are evenly spaced."""
    step = u[-1] - u[-2] if len(u) > 1 else u[0]
    if u.shape[1] > 1 or not np.allclose(np.diff(u[:, 0]), step, rtol=1e-9, atol=0.0):
        return np.asarray(np.exp(1j * (u @ mean.T)))
    found = np.empty((len(u), len(mean)), dtype=complex)
    found[0], found[1:] = np.exp(1j * (mean @ u[0])), np.exp(1j * (mean @ step))
    return np.multiply.accumulate(found, axis=0, out=found)


class Grid:
    """Where the characteristic function of an error is known, and what of it lies within a size.

    Args:
        u: The points (1/rad), shape (points, axes), the origin left out.
        centre: Centre of the range, of one axis (rad); 0 for two.
        reach: Half of the range (rad).
    """

    def __init__(self, u: Floats, centre: float, reach: float) -> None:
        """Keep the points."""
        self.u, self.centre, self.reach = u, centre, reach
        self._at = np.hypot(*u.T) if u.shape[1] == 2 else u[:, 0]
        self._known: dict[float, tuple[float, Complexes | Floats]] = {}

    def kernel(self, size_rad: float) -> tuple[float, Complexes | Floats]:
        """Share of the range that lies within a size, and the weight of each term."""
        if size_rad not in self._known:
            if len(self._known) > _KERNELS:
                self._known.clear()
            self._known[size_rad] = self._kernel(size_rad)
        return self._known[size_rad]

    def _kernel(self, size_rad: float) -> tuple[float, Complexes | Floats]:
        from scipy.special import j1

        at = self._at
        if self.u.shape[1] == 2:
            area = (2.0 * self.reach) ** 2
            return math.pi * size_rad**2 / area, 2.0 * math.pi * size_rad / area * j1(at * size_rad) / at
        low, high = max(-size_rad - self.centre, -self.reach), min(size_rad - self.centre, self.reach)
        if high <= low:
            return 0.0, np.zeros(at.shape)
        waves = (np.exp(-1j * at * low) - np.exp(-1j * at * high)) / (1j * at)
        return 0.5 * (high - low) / self.reach, waves / self.reach


@dataclass(frozen=True, slots=True)
class Series:
    """Fourier series of the density of an error.

    Args:
        grid: Where characteristic functions are known.
        terms: The error's where it is not negligible, shape (kept,).
        kept: Which points of the grid these are, shape (kept,).
        taper: What ends the terms where they do not go on until they are negligible, shape (kept,); None where they do.
    """

    grid: Grid
    terms: Complexes
    kept: Integers
    taper: Floats | None = None

    @classmethod
    def of(cls, grid: Grid, terms: Complexes, taper: Floats | None = None) -> "Series":
        """Keep the terms that count.

        Args:
            grid: The grid.
            terms: The characteristic function at all of its points.
            taper: What ends them where further ones are missing.
        """
        kept = np.flatnonzero(np.abs(terms) > _NEGLIGIBLE)
        return cls(grid, terms[kept], kept, None if taper is None else taper[kept])

    @property
    def whole(self) -> bool:
        """Whether the terms go on until they are negligible."""
        return self.taper is None

    @property
    def u(self) -> Floats:
        """Where the terms stand (1/rad), shape (kept, axes)."""
        return np.asarray(self.grid.u[self.kept])

    def within(self, size_rad: float, factor: Complexes | float = 1.0) -> float:
        """Probability that the error, radial for two axes, is not above a size.

        Args:
            size_rad: The size (rad).
            factor: Characteristic function of a further part at `u`, shape (kept,).
        """
        flat, kernel = self.grid.kernel(size_rad)
        terms = self.terms * factor
        if self.taper is not None and np.max(np.abs(terms[self.taper < _LAST]), initial=0.0) > _ENDED:
            terms = terms * self.taper
        return float(flat + (terms @ kernel[self.kept]).real)

    def quantile(self, share: float, rel: float = 1e-11) -> float:
        """Size that is not exceeded with a probability (rad).

        Args:
            share: The probability.
            rel: Part of the range to which it is found.
        """
        from scipy.optimize import brentq

        most = self.grid.reach + abs(self.grid.centre)
        if self.within(most) <= share:
            return most
        return float(brentq(lambda size: self.within(size) - share, 0.0, most, xtol=rel * most, rtol=1e-11))


def _count(size: Callable[[Floats], Floats], step: float, most: int) -> int:
    """Steps along each of two axes, beyond which a characteristic function is negligible in all directions."""
    count = 2 * _CHUNK
    while count < most:
        edge = np.arange(-count, count + 1.0)
        side = np.full(edge.shape, float(count))
        ring = np.concatenate([np.stack([side, edge], axis=1), np.stack([edge, side], axis=1)])
        if np.max(size(step * ring)) < _NEGLIGIBLE:
            return count
        count = min(count * 3 // 2, most)
    return count


def _plane(step: float, count: int, most: int) -> tuple[Floats, Floats | None]:
    """Points of half a plane without the origin, and the taper of a series that ends too early there."""
    plane = np.stack(np.meshgrid(np.arange(count + 1.0), np.arange(-count, count + 1.0), indexing="ij"), axis=-1)
    half = plane.reshape(-1, 2)
    half = half[(half[:, 0] > 0) | (half[:, 1] > 0)]
    return step * half, _taper(half[:, 0] / count) * _taper(half[:, 1] / count) if count >= most else None


def each_without(sums: Sequence[Sum], reach_rad: float) -> list[Series]:
    """Series of all parts but one, for each of them, about zero, on one grid.

    Args:
        sums: The parts, each by itself, about the same one or two axes.
        reach_rad: How far the range reaches (rad).
    """
    step = math.pi / reach_rad
    if sums[0].axes == 2:
        most = _MOST_OF_OTHERS
        count = _count(lambda u: np.abs(_others(sums, u)), step, most)
        u, taper = _plane(step, count, most)
        each = _HALVES * _others(sums, u)
    else:
        most, count = _MOST, 4 * _CHUNK
        while count < _MOST and np.max(np.abs(_others(sums, step * _last(count)))) >= _NEGLIGIBLE:
            count = min(2 * count, _MOST)
        u = step * np.arange(1.0, count + 1.0)[:, None]
        taper = _taper(np.arange(1, count + 1) / count) if count >= _MOST else None
        each = _others(sums, u)
    grid = Grid(u, 0.0, reach_rad)
    return [Series.of(grid, rest, taper) for rest in each]


def _last(count: int) -> Floats:
    return np.arange(count - _CHUNK, count + 1.0)[:, None]


def _others(sums: Sequence[Sum], u: Floats) -> Complexes:
    """Product of the characteristic functions of all but one, for each, shape (sums, points)."""
    each = np.array([one.at(u) for one in sums])
    before, behind = np.ones_like(each), np.ones_like(each)
    np.cumprod(each[:-1], axis=0, out=before[1:])
    np.cumprod(each[:0:-1], axis=0, out=behind[-2::-1])
    return np.asarray(before * behind)


def _taper(share: Floats) -> Floats:
    """Factors of the terms of a series that ends too early, by their place in it.

    They blur the density with a kernel of no variance and no fourth moment, so that quantiles hardly move.
    """
    x = 0.5 * (_TAPER * share) ** 2
    return np.asarray(np.exp(-x) * (1.0 + x + 0.5 * x**2))
