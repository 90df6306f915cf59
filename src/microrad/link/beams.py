"""What leaves an aperture: its gain on the axis, and its loss off it."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Protocol

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.link.gains import DB_PER_NEPER, aperture_gain_db
from microrad.mission.fields import Bounded, Quantity, Share
from microrad.mission.tables.link import narrowest_radius

BEST_TRUNCATION = 1.1209
"""Aperture radius over 1/e2 beam radius with the most gain on the axis, 0.81453 of the uniform one (Klein and Degnan
1974)."""

_NODES = 96  # of the radial integral, enough for ...
_NEAR = 120.0  # ... this largest argument of its Bessel function; beyond it the edges alone count
_EDGE_TERMS = 6
_ANYWHERE = 1e9  # argument that stands for all larger ones, infinite included
_DARK = 40.0  # exponent of the field beyond which there is no light to integrate
_FLOOR = 1e-15  # of the field: a null of the pattern is 300 dB deep and no more
_ROUND_DB = 1e-6  # loss up to which every beam is the Gaussian of its curvature
_FAR = (128, 512)  # of the errors at which it is looked for: where what comes last begins
_CHUNK = 8192  # errors that the integral is held for at once


class OffAxis(Protocol):
    """How a beam falls off from its axis."""

    @property
    def half_angle_rad(self) -> float:
        """Half angle at 1/e2 of the Gaussian beam that falls off as this one does near the axis."""

    def loss_db(self, error_rad: ArrayLike) -> Floats:
        """Loss at each radial error, relative to the axis."""

    def error_rad(self, loss_db: float) -> float:
        """Smallest radial error with this loss."""


@dataclass(frozen=True, slots=True)
class GaussianFall:
    """Falls off as exp(-2 (error / theta)^2), theta the half angle at 1/e2 of intensity."""

    half_angle_rad: float

    def loss_db(self, error_rad: ArrayLike) -> Floats:
        """Loss at each radial error, 8.686 (error / theta)^2 dB."""
        error: Floats = np.asarray(error_rad, dtype=np.float64) / self.half_angle_rad
        return 2.0 * DB_PER_NEPER * error**2

    def error_rad(self, loss_db: float) -> float:
        """Error with this loss, the inverse of `loss_db`; 0 for no loss."""
        return self.half_angle_rad * math.sqrt(max(loss_db, 0.0) / (2.0 * DB_PER_NEPER))


@dataclass(frozen=True, slots=True)
class LitAperture(Bounded):
    """A circular aperture with a central obscuration, lit by a Gaussian beam or evenly; its exact far field.

    ``truncation`` is the aperture's radius over the beam's radius at 1/e2 of intensity; 0 is an even light.
    ``obscuration`` is the ratio of the diameters. ``m_squared`` widens the far field: angles grow with it and the gain
    falls with its square, as for an embedded Gaussian. Gain as of Klein and Degnan, Appl. Opt. 13, 2134 (1974).

    Raises ValueError for a value without meaning, and for a beam that the obscuration stops but for 1 %.
    """

    diameter_m: Annotated[float, Quantity("m", above=0.0)]
    wavelength_m: Annotated[float, Quantity("m", above=0.0)]
    truncation: Annotated[float, Quantity("", least=0.0), "0 is an even light"]
    obscuration: Annotated[float, Share("", least=0.0)]
    m_squared: Annotated[float, Quantity("", least=1.0), "1 is an ideal beam"] = 1.0

    def __post_init__(self) -> None:
        """Raises ValueError if a value is out of range, or the obscuration stops the beam."""
        Bounded.__post_init__(self)
        if self.obscuration > 0.0:
            most = Quantity("", most=1.0 / narrowest_radius(self.obscuration))
            why = f"an obscuration of {self.obscuration:g} stops the rest of the beam"
            most.check("truncation", self.truncation, why)

    @property
    def efficiency(self) -> float:
        """Gain on the axis over that of the whole aperture lit evenly, light cut off included, without M squared.

        2 / a^2 (exp(-a^2) - exp(-a^2 e^2))^2 with a the truncation and e the obscuration; 1 - e^2 for an even light.
        """
        a2, e2 = self.truncation**2, self.obscuration**2
        if a2 == 0.0:
            return 1.0 - e2
        # exp(-a2 e2) - exp(-a2), by its factor, so that little truncation does not cancel
        return 2.0 / a2 * (math.exp(-a2 * e2) * math.expm1(-a2 * (1.0 - e2))) ** 2

    @property
    def passed(self) -> float:
        """Share of the beam's power that the aperture lets through; an even light is that of the open area."""
        a2, e2 = 2.0 * self.truncation**2, self.obscuration**2
        return 1.0 if a2 == 0.0 else -math.exp(-a2 * e2) * math.expm1(-a2 * (1.0 - e2))

    @property
    def gain_db(self) -> float:
        """Gain on the axis, relative to the power of the beam before the aperture."""
        uniform = aperture_gain_db(self.diameter_m, self.wavelength_m)
        return uniform + 10.0 * math.log10(self.efficiency) - 20.0 * math.log10(self.m_squared)

    def loss_db(self, error_rad: ArrayLike) -> Floats:
        """Loss off the axis by the diffraction integral; the pattern's nulls are deep, not infinite."""
        error = np.asarray(error_rad, dtype=np.float64)
        field = np.maximum(np.abs(self._field(error.ravel())), _FLOOR)
        loss: Floats = (0.0 - 20.0 * np.log10(field)).reshape(error.shape)
        return loss

    def _field(self, error_rad: Floats) -> Floats:
        """Field at each of the errors over that on the axis; it changes sign from lobe to lobe."""
        from scipy.special import j0

        rho, weight = self._quadrature()
        x, total = np.minimum(self._scale * error_rad, _ANYWHERE), np.sum(weight)
        field = np.empty(x.shape)
        near = x * self._outer <= _NEAR
        field[~near] = self._edges(x[~near])
        for rows in np.array_split(np.flatnonzero(near), 1 + x.size // _CHUNK):
            field[rows] = j0(x[rows, None] * rho) @ weight
        field[x == 0.0] = total  # to the last bit: no loss on the axis
        return np.asarray(field / total, dtype=np.float64)

    def _edges(self, x: Floats) -> Floats:
        """The integral far out, by parts: sum over k of (2 a^2 / x)^k rho^(k + 1) field J_(k + 1)(x rho) / x."""
        from scipy.special import jv

        terms = np.arange(_EDGE_TERMS)
        total = np.zeros(x.shape)
        for sign, rho in ((1.0, self._outer), (-1.0, self.obscuration)):
            bessel = jv(terms + 1.0, x[:, None] * rho) * (2.0 * self.truncation**2 / x[:, None]) ** terms
            total += sign * self._light(rho) * (bessel @ rho ** (terms + 1.0)) / x
        return total

    @property
    def _scale(self) -> float:
        """What turns an error into the argument of the Bessel function at the aperture's edge."""
        return math.pi * self.diameter_m / (self.wavelength_m * self.m_squared)

    @property
    def _outer(self) -> float:
        """Radius over the aperture's up to which there is light."""
        return 1.0 if self.truncation == 0.0 else min(1.0, math.hypot(self.obscuration, _DARK**0.5 / self.truncation))

    def _light(self, rho: ArrayLike) -> Floats:
        """Field in the aperture, over that at the edge of the obscuration."""
        r = np.asarray(rho, dtype=np.float64)
        return np.asarray(np.exp(-(self.truncation**2) * (r**2 - self.obscuration**2)), dtype=np.float64)

    def _quadrature(self) -> tuple[Floats, Floats]:
        """Radii over the aperture's, and the field there times the area that each stands for."""
        node, weight = _gauss_legendre()
        width = (self._outer - self.obscuration) / 2.0
        rho = self.obscuration + width * (node + 1.0)
        return rho, width * weight * rho * self._light(rho)

    @property
    def half_angle_rad(self) -> float:
        """Half angle at 1/e2 of the Gaussian beam with the same curvature on the axis; it stands for 3 dB or so."""
        rho, weight = self._quadrature()
        # J0(x) = 1 - x^2/4: intensity falls as 1 - scale^2 <rho^2> error^2 / 2, a Gaussian's as 1 - 2 (error/theta)^2
        return 2.0 / (self._scale * math.sqrt(float(weight @ rho**2 / np.sum(weight))))

    def _first_below(self, wanted: float, error_rad: Floats) -> int | None:
        """Number of the first of rising errors with no more field than wanted, None where there is none."""
        begin = 0
        for part in np.split(error_rad, _FAR):  # most are not far out
            below = np.flatnonzero(self._field(part) <= wanted)
            if below.size:
                return begin + int(below[0])
            begin += part.size
        return None

    @lru_cache(maxsize=256)  # noqa: B019  not of beams, which are values: of what most rows of a campaign share
    def error_rad(self, loss_db: float) -> float:
        """Smallest error with this loss, within the main lobe; infinite beyond the 300 dB of a null."""
        from scipy.optimize import brentq

        half = self.half_angle_rad
        if loss_db <= _ROUND_DB:
            return GaussianFall(half).error_rad(loss_db)
        # the field is above the one looked for up to there, and below it beyond, null or not
        wanted, outwards = 10.0 ** (-loss_db / 20.0), np.linspace(0.0, 40.0 * half, 2001)
        first = None if wanted < _FLOOR else self._first_below(wanted, outwards)
        if first is None:
            return math.inf
        lower, upper = outwards[first - 1], outwards[first]
        return float(brentq(lambda e: float(self._field(np.array([e]))[0]) - wanted, lower, upper, xtol=1e-13 * half))


@lru_cache(maxsize=1)
def _gauss_legendre() -> tuple[Floats, Floats]:
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    return node, weight
