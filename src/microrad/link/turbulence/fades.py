"""Fades of a scintillating light: how often its power is below a share of its mean."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.mission.fields import Bounded, Quantity, Share

_LEAST_VARIANCE = 1e-12
_NOTHING = 45.0  # exponent of a density of which nothing is left
_SCALES, _MOST_SCALES, _POINTS = 120, 4000, 400  # of the wider scale, and of the spline
_LEAST_SHARE = 1e-18
_MOST_EXPONENT = 600.0  # of a power that is still a number
_EDGES = (0.0, 1.0, 2.0, 3.5, 5.0, 7.0, 9.0, 11.5, 14.0, 17.0, 21.0, 28.0, 50.0)  # of -ln U: 2e-22 lies beyond


@dataclass(frozen=True, slots=True)
class Fades(Bounded, ABC):
    """Power over its mean."""

    @abstractmethod
    def below(self, power: ArrayLike) -> Floats:
        """Share of the time with less power than each (over the mean)."""

    def loss_db(self, outage: float) -> float:
        """Loss against the mean power (dB) that is exceeded for a share of the time.

        Args:
            outage: The share, above 0 and below 1.

        Raises:
            ValueError: For a share that is not.
        """
        from scipy.optimize import brentq

        Share("", above=0.0, below=1.0).check("the outage", outage)
        wanted = math.log(outage)

        def beyond(loss: float) -> float:
            return math.log(max(float(self.below(10.0 ** (-loss / 10.0))), 1e-300)) - wanted

        low, high = -20.0, 10.0
        while beyond(low) < 0.0:
            low = 2.0 * low
        while beyond(high) > 0.0:
            low, high = high, 2.0 * high
        return float(brentq(beyond, low, high, xtol=1e-12))


@dataclass(frozen=True, slots=True)
class LogNormal(Fades):
    """Log-normal power, in weak turbulence and behind large apertures: its logarithm has the variance ln(1 + index).

    ``index`` is the scintillation index, the variance of the power over the square of its mean.

    Raises ValueError for an index below 0.
    """

    index: Annotated[float, Quantity("", least=0.0)]

    def below(self, power: ArrayLike) -> Floats:
        """See `Fades.below`."""
        from scipy.special import ndtr

        variance = max(math.log1p(self.index), _LEAST_VARIANCE)
        with np.errstate(divide="ignore"):
            log = np.log(np.asarray(power, dtype=np.float64))
        return np.asarray(ndtr((log + variance / 2.0) / math.sqrt(variance)))

    def loss_db(self, outage: float) -> float:
        """See `Fades.loss_db`."""
        from scipy.special import ndtri

        Share("", above=0.0, below=1.0).check("the outage", outage)
        variance = math.log1p(self.index)
        return 10.0 / math.log(10.0) * (variance / 2.0 - math.sqrt(variance) * float(ndtri(outage)))


@dataclass(frozen=True, slots=True)
class GammaGamma(Fades):
    """Gamma-gamma power, from weak to strong turbulence: the product of a large and a small scale, each Gamma.

    Al-Habash, Andrews and Phillips 2001, Opt. Eng. 40, 1554. ``large`` and ``small`` are their parameters alpha and
    beta; the scintillation index is 1 / alpha + 1 / beta + 1 / (alpha beta).

    Raises ValueError for a parameter not above 0.
    """

    large: Annotated[float, Quantity("", above=0.0)]
    small: Annotated[float, Quantity("", above=0.0)]

    @classmethod
    def of_plane_wave(cls, rytov: float) -> "GammaGamma":
        """That of a plane wave at a point, with neither inner nor outer scale.

        alpha = 1 / (exp(0.49 s / (1 + 1.11 s^(6/5))^(7/6)) - 1) and beta = 1 / (exp(0.51 s / (1 + 0.69 s^(6/5))^(5/6))
        - 1), s the Rytov variance (Andrews and Phillips 2005, chapter 9).

        Args:
            rytov: Rytov variance of a plane wave, above 0.

        Raises:
            ValueError: For a variance not above 0.
        """
        Quantity("", above=0.0).check("the Rytov variance", rytov)
        root = rytov**1.2
        of_large = 0.49 * rytov / (1.0 + 1.11 * root) ** (7.0 / 6.0)
        of_small = 0.51 * rytov / (1.0 + 0.69 * root) ** (5.0 / 6.0)
        return cls(1.0 / math.expm1(of_large), 1.0 / math.expm1(of_small))

    @classmethod
    def of_index(cls, index: float) -> "GammaGamma":
        """That of a scintillation index, split between the scales as that of a weak plane wave is, 0.49 to 0.51.

        alpha = 1 / (exp(0.49 s) - 1) and beta = 1 / (exp(0.51 s) - 1) with s = ln(1 + index), so that the index is met.

        Args:
            index: The scintillation index, above 0.

        Raises:
            ValueError: For an index not above 0.
        """
        Quantity("", above=0.0).check("the scintillation index", index)
        spread = math.log1p(index)
        return cls(1.0 / math.expm1(0.49 * spread), 1.0 / math.expm1(0.51 * spread))

    @property
    def index(self) -> float:
        """Scintillation index."""
        return 1.0 / self.large + 1.0 / self.small + 1.0 / (self.large * self.small)

    def below(self, power: ArrayLike) -> Floats:
        """See `Fades.below`: by a spline of the logarithm, and a power law where it is below 1e-18."""
        low, high, spline = _gamma_gamma(*sorted((self.large, self.small)))
        with np.errstate(divide="ignore"):
            log = np.log(np.asarray(power, dtype=np.float64))
        inside = spline(np.clip(log, low, high)) + min(self.large, self.small) * np.minimum(log - low, 0.0)
        return np.asarray(np.minimum(np.exp(inside), 1.0))


@lru_cache(maxsize=256)  # most inputs of a link leave its fades alone
def _gamma_gamma(wide: float, narrow: float) -> tuple[float, float, Callable[[Floats], Floats]]:
    """Logarithms of the power from and to, and the logarithm of the share below it as a spline over that.

    The share is the mean of the narrower scale's law over the wider one, by equal steps of the logarithm, which is as
    exact as the integrand is smooth.
    """
    from scipy.interpolate import CubicSpline
    from scipy.optimize import brentq
    from scipy.special import gammainc, gammaln

    def falls(log: float) -> float:
        return wide * (math.expm1(log) - log) - _NOTHING

    edges = brentq(falls, -_NOTHING / wide - 2.0, 0.0), brentq(falls, 0.0, math.log(_NOTHING / wide + 2.0) + 2.0)
    steps = 3.0 * math.sqrt(narrow) * (edges[1] - edges[0])  # the narrower law is a step as wide as 1 / sqrt(narrow)
    scale = np.linspace(*edges, min(max(_SCALES, int(steps)), _MOST_SCALES))
    density = np.exp(wide * (math.log(wide) + scale) - wide * np.exp(scale) - gammaln(wide))
    weight = density / np.sum(density)
    spread = math.sqrt(math.log1p(1.0 / wide) + math.log1p(1.0 / narrow))
    log = np.linspace(-42.0 / wide - 9.0 * spread, 9.5 * spread, _POINTS)
    share = gammainc(narrow, narrow * np.exp(np.subtract.outer(log, scale))) @ weight
    there = share > _LEAST_SHARE
    return float(log[there][0]), float(log[-1]), CubicSpline(log[there], np.log(share[there]))


@dataclass(frozen=True, slots=True)
class Wandering(Fades):
    """Power at a satellite of a beam that scintillates and, independently of that, wanders.

    ``still`` are the fades of the beam that does not wander. ``beam`` is the square of its half angle at 1/e2 over
    twice the mean square of the radial wander. The wander is normal about both axes, so that the power is U^(1 / beam)
    with an even U, and its mean is beam / (beam + 1).

    Raises ValueError for a ratio not above 0.
    """

    still: Fades
    beam: Annotated[float, Quantity("", above=0.0)]

    def below(self, power: ArrayLike) -> Floats:
        """See `Fades.below`: the mean over the logarithm of U, by Gauss and Legendre."""
        node, weight = np.polynomial.legendre.leggauss(24)
        edges = np.array(_EDGES)
        half = np.diff(edges)[:, None] / 2.0
        rare = (edges[:-1, None] + half * (node + 1.0)).ravel()  # -ln U
        share = (half * weight).ravel() * np.exp(-rare)
        mean = self.beam / (self.beam + 1.0)
        needed = mean * np.exp(np.minimum(rare / self.beam, _MOST_EXPONENT))
        at = np.multiply.outer(np.asarray(power, dtype=np.float64), needed)
        return np.asarray(self.still.below(at) @ (share / np.sum(share)))
