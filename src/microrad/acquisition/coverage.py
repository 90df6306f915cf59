"""Probability that a Gaussian pointing error stays within a radius, and the radius for a probability."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from microrad.acquisition.limits import require_angle, require_inside, require_positive

_NODES = 256
_TAIL = 9.0  # standard deviations beyond which a Gaussian holds less than 3e-19


@dataclass(frozen=True, slots=True)
class PointingError:
    """Two independent Gaussian axes: standard deviation of each axis, and the bias of each.

    `sigma_cross_rad` is the standard deviation of the second axis; left out, both axes are alike.
    """

    sigma_rad: float
    sigma_cross_rad: float | None = None
    bias_rad: float = 0.0
    bias_cross_rad: float = 0.0

    def __post_init__(self) -> None:
        """Refuse standard deviations that are not positive and a bias that is not finite."""
        require_positive("the standard deviation of the pointing error", self.sigma_rad, "rad")
        require_positive("the standard deviation across", self.cross_rad, "rad")
        if not math.isfinite(self.bias_rad + self.bias_cross_rad):
            raise ValueError("a bias of the pointing error is not finite: give a finite angle in rad")

    @property
    def cross_rad(self) -> float:
        """Standard deviation of the second axis."""
        return self.sigma_rad if self.sigma_cross_rad is None else self.sigma_cross_rad


def coverage_probability(radius_rad: float, error: PointingError) -> float:
    """Probability that the radial error is below `radius_rad`, the radius within which the power suffices.

    Equal axes: Rayleigh without, Rice with a bias. Unequal axes: quadrature over one axis. Small angles: the radius is
    a length in the plane of the two axes. Raises `ValueError` unless the radius lies between 0 and pi/2 rad.
    """
    require_angle("the coverage radius", radius_rad)
    return float(radial_cumulative(np.array([radius_rad]), error)[0])


@lru_cache(maxsize=256)  # searches ask for the same one again and again
def coverage_radius(probability: float, error: PointingError) -> float:
    """Radius within which the radial error stays with `probability`, in rad.

    For equal axes without bias R = sigma sqrt(-2 ln(1 - P)). Raises `ValueError` for a probability outside (0, 1), and
    for a radius of pi/2 rad or more.
    """
    require_inside("the coverage probability", probability)
    bias = math.hypot(error.bias_rad, error.bias_cross_rad)
    if bias == 0.0 and error.cross_rad == error.sigma_rad:
        radius = error.sigma_rad * math.sqrt(-2.0 * math.log1p(-probability))
    else:
        from scipy.optimize import brentq  # slow to load

        largest = bias + max(error.sigma_rad, error.cross_rad) * (math.sqrt(-2.0 * math.log1p(-probability)) + 1.0)
        radius = float(
            brentq(lambda r: float(radial_cumulative(np.array([r]), error)[0]) - probability, 0.0, largest, xtol=1e-15)
        )
    require_angle("the radius that covers the pointing error", radius)
    return radius


def radial_cumulative(radius_rad: ArrayLike, error: PointingError) -> NDArray[np.float64]:
    """Cumulative probability of the radial error at each radius, same shape; zero at and below a radius of zero."""
    radius = np.maximum(np.asarray(radius_rad, dtype=np.float64), 0.0)
    bias = math.hypot(error.bias_rad, error.bias_cross_rad)
    if error.sigma_rad != error.cross_rad:
        return _unequal(radius, error)
    scaled = (radius / error.sigma_rad) ** 2
    if bias == 0.0:
        return np.asarray(-np.expm1(-scaled / 2.0), dtype=np.float64)
    from scipy.stats import ncx2  # slow to load

    return np.asarray(ncx2.cdf(scaled, 2, (bias / error.sigma_rad) ** 2), dtype=np.float64)


def _unequal(radius: NDArray[np.float64], error: PointingError) -> NDArray[np.float64]:
    from scipy.special import ndtr  # slow to load

    axes = ((error.sigma_rad, error.bias_rad), (error.cross_rad, error.bias_cross_rad))
    (narrow, offset), (wide, wide_offset) = sorted(axes)  # the narrow density is where the nodes are wanted
    node, weight = _nodes()
    safe = np.maximum(radius, 1e-300)[..., None]
    low = np.arcsin(np.clip((offset - _TAIL * narrow) / safe, -1.0, 1.0))
    high = np.arcsin(np.clip((offset + _TAIL * narrow) / safe, -1.0, 1.0))
    angle = (high + low) / 2.0 + (high - low) / 2.0 * node
    along, half = safe * np.sin(angle), safe * np.cos(angle)
    density = np.exp(-(((along - offset) / narrow) ** 2) / 2.0) / (narrow * math.sqrt(2.0 * math.pi))
    inside = ndtr((half - wide_offset) / wide) - ndtr((-half - wide_offset) / wide)
    total = np.sum(weight * density * inside * half, axis=-1) * (high - low)[..., 0] / 2.0
    return np.asarray(np.where(radius > 0.0, total, 0.0), dtype=np.float64)


@lru_cache(maxsize=1)  # an eigenvalue problem
def _nodes() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    return np.asarray(node, dtype=np.float64), np.asarray(weight, dtype=np.float64)
