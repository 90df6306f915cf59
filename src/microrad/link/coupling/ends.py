"""What takes the light in the focus of a telescope: a single-mode fibre, a multi-mode fibre, or a detector.

A share is of the light that passes the open area of the aperture. Errors are of the receiving telescope's line of
sight, in rad on the sky.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.link.coupling.pupil import Pupil
from microrad.mission.fields import Quantity, Share

FLOOR = 1e-15
"""Share of the light below which there is none: a null is 150 dB deep and no more."""

_STEP = 0.05  # of the tables by angle, times pi D / lambda
_FIRST = 32.0  # how far a table reaches, and twice that, and so on
_EDGE = 96  # nodes across the edge of a disk
_FURTHEST = 256.0  # of a disk's radius and an error, times pi D / lambda: hardly any light lies beyond
_DIRECTIONS = 64
_CHUNK = 1024  # angles of a disk at once


@dataclass(frozen=True, slots=True)
class End(ABC):
    """What takes the light that a pupil brings to its focus.

    ``offset_rad`` is how far it lies off the axis, over the focal length, along the axis x of the aberrations.
    """

    pupil: Pupil
    offset_rad: float = 0.0

    @property
    def is_round(self) -> bool:
        """Whether the direction of a pointing error does not count."""
        return self.pupil.is_round and self.offset_rad == 0.0

    @property
    def _furthest(self) -> float:
        """Largest angle times pi D / lambda that is told from a larger one."""
        return _FURTHEST

    @property
    def _reach_rad(self) -> float:
        """Angle (rad) beyond which no more is lost."""
        return self._furthest / self.pupil.per_rad

    @abstractmethod
    def by_direction(self, x: Floats) -> Floats:
        """Share at angles from the axis times pi D / lambda, shape (angles,).

        By direction psi it is the sum of the n-th row times cos(n psi); shape (rows, angles).
        """

    def share(self, x_rad: ArrayLike, y_rad: ArrayLike = 0.0) -> Floats:
        """Share of the light that is taken at each pointing error of the receiving telescope.

        Args:
            x_rad: Error along the axis x (rad).
            y_rad: Error along the other axis (rad); broadcast against the first.
        """
        x, y = np.broadcast_arrays(np.asarray(x_rad, dtype=np.float64) + self.offset_rad, np.asarray(y_rad, np.float64))
        return self._share(self.pupil.per_rad * np.hypot(x, y), np.arctan2(y, x))

    def _share(self, angle: Floats, direction_rad: Floats) -> Floats:
        """Share at angles times pi D / lambda; beyond the furthest as there."""
        at = np.minimum(angle, self._furthest).ravel()
        reach = _FIRST * 2.0 ** max(math.ceil(math.log2(max(float(np.max(at, initial=0.0)), _FIRST) / _FIRST)), 0)
        rows = _table(self, reach)(at)
        if rows.shape[1] > 1:
            rows *= np.cos(np.multiply.outer(direction_rad.ravel(), np.arange(rows.shape[1])))
        return np.asarray(np.maximum(np.sum(rows, axis=1), FLOOR).reshape(angle.shape))

    def loss_db(self, x_rad: ArrayLike, y_rad: ArrayLike = 0.0) -> Floats:
        """Loss in dB, positive, at each pointing error; as `share`."""
        return np.asarray(-10.0 * np.log10(self.share(x_rad, y_rad)))

    def worst_loss_db(self, radius_rad: float) -> float:
        """Loss in dB at a radial error in its worst direction."""
        angle = 2.0 * math.pi * np.arange(1 if self.is_round else _DIRECTIONS) / _DIRECTIONS
        return float(np.max(self.loss_db(radius_rad * np.cos(angle), radius_rad * np.sin(angle))))

    def error_rad(self, loss_db: float) -> float:
        """Smallest radial error whose mean loss over all directions, without that on the axis, is so large (dB)."""
        from scipy.optimize import brentq

        angle = 2.0 * math.pi * np.arange(1 if self.is_round else _DIRECTIONS) / _DIRECTIONS
        along, across, still = np.cos(angle), np.sin(angle), float(self.loss_db(0.0))

        def beyond(radius_rad: float) -> float:
            return float(np.mean(self.loss_db(radius_rad * along, radius_rad * across))) - still - loss_db

        reach = 1.0 / self.pupil.per_rad
        while beyond(reach) < 0.0 and reach < self._reach_rad:
            reach *= 1.5
        return float(brentq(beyond, 0.0, reach, xtol=1e-15)) if beyond(reach) > 0.0 else math.inf


@lru_cache(maxsize=64)
def _table(end: End, reach: float) -> Any:
    """Share by direction, between angles by a spline of fifth order."""
    from scipy.interpolate import make_interp_spline

    x = np.linspace(0.0, reach, round(reach / _STEP) + 1)
    return make_interp_spline(x, end.by_direction(x).T, k=5)


@dataclass(frozen=True, slots=True)
class SingleModeFibre(End):
    """A fibre of one Gaussian mode: the overlap of its field with that of the light.

    The pupil's ``truncation`` is the radius of the aperture over that of the mode in it at 1/e2 of intensity. Its
    ``shift`` is how far the mode lies off the middle: the fibre's own angle times the focal length. Without obscuration
    and aberrations 2 (1 - exp(-a^2))^2 / a^2 of the light are taken (Ruilier 1998, Proc. SPIE 3350, 319).

    Raises ValueError for a mode without a radius.
    """

    def __post_init__(self) -> None:
        """Raises ValueError for a truncation that is not above 0."""
        Quantity("", above=0.0).check("the truncation", self.pupil.truncation, "the mode of a fibre has a radius")

    def by_direction(self, x: Floats) -> Floats:
        """See `End.by_direction`."""
        return 4.0 * self.pupil.truncation**2 / self.pupil.open_area * self.pupil.intensity(x)


def best_truncation(obscuration: float = 0.0) -> float:
    """Truncation of the single-mode fibre that takes most of a plane wave: 1.12091 without obscuration, for 0.814529.

    Args:
        obscuration: Diameter of the central obscuration over that of the aperture.

    Raises:
        ValueError: For an obscuration that is not from 0 to below 1.
    """
    from scipy.optimize import brentq

    Share("", least=0.0).check("the obscuration", obscuration)
    hole = obscuration**2

    def slope(square: float) -> float:  # sign of that of (exp(-a^2 e^2) - exp(-a^2))^2 / a^2
        gap = math.expm1(square * (1.0 - hole))
        return 2.0 * square * (1.0 - hole - hole * gap) - gap

    return math.sqrt(brentq(slope, 0.1, 2.0, xtol=1e-15))


def truncation_of_mode(pupil: Pupil, mode_radius_m: float, focal_length_m: float) -> float:
    """Truncation of a single-mode fibre: the mode of radius w in the focus has lambda f / (pi w) in the aperture.

    Args:
        pupil: The aperture.
        mode_radius_m: Radius of the fibre's mode at 1/e2 of intensity (m).
        focal_length_m: Focal length of the telescope with what stands behind it (m).
    """
    return math.pi * mode_radius_m * pupil.diameter_m / (2.0 * pupil.wavelength_m * focal_length_m)


def turbulent_share(truncation: float, areas: float) -> float:
    """Mean share of a turbulent plane wave that a single-mode fibre takes.

    It is 8 a^2 times the double integral of exp(-(a^2 + A) (u^2 + v^2)) I0(2 A u v) u v over u and v from 0 to 1
    (Dikmelik and Davidson 2005, Appl. Opt. 44, 4946), for a Gaussian coherence of the field.

    Args:
        truncation: Radius of the aperture over that of the fibre's mode in it, a.
        areas: Area of the aperture over that of a coherent cell of the light, A = A_R / A_C; 0 is a plane wave.

    Raises:
        ValueError: For a truncation not above 0, and a negative ratio of areas.
    """
    from scipy.special import i0e

    Quantity("", above=0.0).check("the truncation", truncation)
    Quantity("", least=0.0).check("the ratio of the areas", areas)
    node, weight = np.polynomial.legendre.leggauss(200)
    u, weight = (node + 1.0) / 2.0, weight / 2.0 * (node + 1.0) / 2.0
    # exp(-A (u - v)^2) times the Bessel function scaled by its own growth
    apart = np.exp(-areas * np.subtract.outer(u, u) ** 2) * i0e(2.0 * areas * np.multiply.outer(u, u))
    mode = weight * np.exp(-((truncation * u) ** 2))
    return float(8.0 * truncation**2 * (mode @ apart @ mode))


@dataclass(frozen=True, slots=True)
class Disk(End):
    """A round detector, or the core of a multi-mode fibre: all light that falls on it.

    ``radius_rad`` is its radius over the focal length. The core of a fibre takes light within the fibre's cone, which
    is the pupil's ``stop``, and it is taken to have so many modes that it takes all of that.

    Raises ValueError for a radius not above 0.
    """

    radius_rad: float = 0.0

    def __post_init__(self) -> None:
        """Raises ValueError for a radius that is not above 0."""
        Quantity("rad", above=0.0).check("the radius", self.radius_rad)

    @property
    def _furthest(self) -> float:
        """As far beyond the edge of the disk as a fibre reaches from its axis."""
        return min(self.pupil.per_rad * self.radius_rad, _FURTHEST) + _FURTHEST

    @property
    def _reach_rad(self) -> float:
        """Angle (rad) beyond which no more is lost."""
        return self.radius_rad + _FURTHEST / self.pupil.per_rad

    def _share(self, angle: Floats, direction_rad: Floats) -> Floats:
        """Share at angles times pi D / lambda: of a disk beyond the tables, by how far its edge is from the light."""
        beyond = max(self.pupil.per_rad * self.radius_rad - _FURTHEST, 0.0)
        taken = End._share(self, np.maximum(angle - beyond, 0.0), direction_rad)
        if beyond == 0.0:
            return taken
        # light far out falls off as its aperture has edges: 2 / (pi x) of a whole circle lie beyond x
        edges = 2.0 * (self.pupil.stop + self.pupil.obscuration) / (math.pi * 2.0 * self.pupil.open_area)
        more = edges * (1.0 / _FURTHEST - 1.0 / (_FURTHEST + beyond))
        return np.asarray(taken * (1.0 + more))  # nearly all of it is taken where that counts

    def by_direction(self, x: Floats) -> Floats:
        """See `End.by_direction`."""
        from scipy.interpolate import make_interp_spline

        radius = min(self.pupil.per_rad * self.radius_rad, _FURTHEST)
        reach = radius + float(x[-1]) + _STEP
        at = np.linspace(0.0, reach, round(reach / _STEP) + 1)
        intensity = self.pupil.intensity(at)
        light = make_interp_spline(at, intensity.T, k=5)
        whole = make_interp_spline(at, intensity[0] * at, k=5).antiderivative()
        node, weight = np.polynomial.legendre.leggauss(_EDGE + int(min(radius, float(x[-1]))))
        parts = [
            self._crossed(each, radius, (node, weight), light, whole)
            for each in np.array_split(x, 1 + x.size // _CHUNK)
        ]
        return np.concatenate(parts, axis=1) / self.pupil.open_area

    @staticmethod
    def _crossed(x: Floats, radius: float, quadrature: tuple[Floats, Floats], light: Any, whole: Any) -> Floats:
        """Light on a disk of a radius at each distance x of its middle, by direction."""
        node, weight = quadrature
        turn = math.pi * (node + 1.0) / 2.0
        inner, middle, width = np.abs(radius - x), np.maximum(radius, x), np.minimum(radius, x)
        # circles that the disk's edge cuts, from the innermost to the outermost; ends without a root's slope
        circle = middle[:, None] - width[:, None] * np.cos(turn)
        area = math.pi / 2.0 * weight * width[:, None] * np.sin(turn) * circle
        cosine = (circle**2 + x[:, None] ** 2 - radius**2) / np.maximum(2.0 * circle * x[:, None], 1e-300)
        half = np.arccos(np.clip(cosine, -1.0, 1.0))
        rows = light(circle)
        found = [np.sum(area * half * rows[..., 0], axis=1) / math.pi + np.where(x < radius, whole(inner), 0.0)]
        found += [
            np.sum(area * np.sin(n * half) / (n * math.pi) * rows[..., n], axis=1) for n in range(1, rows.shape[-1])
        ]
        return np.asarray(found)


def narrowed(pupil: Pupil, numerical_aperture: float, focal_length_m: float) -> Pupil:
    """The part of a pupil that lies within the cone of a fibre in its focus.

    Args:
        pupil: The aperture.
        numerical_aperture: Sine of the half angle of the cone.
        focal_length_m: Focal length of the telescope (m).

    Raises:
        ValueError: For a cone within the obscuration.
    """
    wide = 2.0 * focal_length_m * math.tan(math.asin(numerical_aperture))
    return replace(pupil, stop=min(wide / pupil.diameter_m, 1.0))
