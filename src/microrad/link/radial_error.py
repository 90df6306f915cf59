"""Distribution of the radial error of a direction whose two axes are Gaussian, each with a bias and an rms of its own.

Small angles: a radius is a length in the plane of the two axes.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.core.units import LEAST
from microrad.link.gains import checked
from microrad.mission.fields import Quantity, Share

SMALLEST_PROBABILITY = 1e-20
"""Below it the quadrature of the tails is no longer relied on."""

RADIUS = Quantity("rad", least=0.0)
_REACH = 12.0  # standard deviations about the bias that are integrated; 4e-33 lies beyond
_STEPS = 4000  # of a radial error whose distribution is known
_ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(96)


def two_axes(name: str, values: tuple[float, float], rule: Quantity) -> None:
    """Check the values of axis x and axis y.

    Args:
        name: What they are, in the words of the message.
        values: The values, in the unit of the rule.
        rule: The bounds of each.

    Raises:
        ValueError: For more or less than two values, and one that is not finite or out of bounds.
    """
    if len(values) != 2:
        raise ValueError(f"{name} is {values} {rule.unit}; give two values, for axis x and axis y")
    checked(name, values, rule)


@dataclass(frozen=True, slots=True)
class Jitter:
    """Pointing error of two axes, x and y, at the line of sight: independent Gaussians about a static bias.

    `rms_rad` is the standard deviation per axis about `bias_rad`, not the radial one. The axes may differ, and either
    rms may be 0. Turn the axes until the errors are uncorrelated. Raises ValueError for a value that
    is not finite, or a negative rms.

    Example:
        ```python
        import microrad

        jitter = microrad.Jitter(bias_rad=(1e-6, 0.0), rms_rad=(2e-6, 2e-6))
        print(microrad.outage_loss_db(jitter, half_angle_rad=10e-6, probability=[0.1, 0.003]))
        ```
    """

    bias_rad: tuple[float, float]
    rms_rad: tuple[float, float]

    def __post_init__(self) -> None:
        """Raises ValueError if a value is not finite or an rms negative."""
        two_axes("the bias", self.bias_rad, Quantity("rad"))
        two_axes("the jitter rms", self.rms_rad, RADIUS)

    @property
    def static_rad(self) -> float:
        """Radial bias (rad)."""
        return math.hypot(*self.bias_rad)


# --------------------------------------------------------------------------------------------------------- distribution
def _outside(limit: Floats, bias: float, rms: float) -> Floats:
    """P(|v| > limit) of one axis; without digits lost in the tail."""
    from scipy.special import ndtr

    return np.asarray(ndtr((abs(bias) - limit) / rms) + ndtr((-abs(bias) - limit) / rms))


def _inside(limit: Floats, bias: float, rms: float) -> Floats:
    from scipy.special import ndtr

    return np.asarray(ndtr((limit - abs(bias)) / rms) - ndtr((-limit - abs(bias)) / rms))


def _axes(jitter: Jitter) -> tuple[float, float, float, float]:
    """Bias and rms of the axis with the smaller rms, then of the other; an rms that nobody could tell from 0 is 0."""
    rms = [each if each >= LEAST else 0.0 for each in jitter.rms_rad]
    (first, second) = sorted(zip(rms, jitter.bias_rad, strict=True), key=lambda axis: axis[0])
    return first[1], first[0], second[1], second[0]


def _is_rayleigh(jitter: Jitter) -> bool:
    return jitter.static_rad == 0.0 and jitter.rms_rad[0] == jitter.rms_rad[1] >= LEAST


def _other_leg(radius: Floats, leg: Floats) -> Floats:
    return np.asarray(np.sqrt(np.maximum((radius - leg) * (radius + leg), 0.0)))


def _arc(radius: Floats, u: tuple[float, float], v: tuple[float, float]) -> tuple[Floats, Floats]:
    """Angles and weights (rad) over the arc of the quadrant u = R sin, v = R cos that has u and v in their ranges.

    Outside the ranges, `_REACH` standard deviations about the bias, the density is negligible: the nodes go where it
    is not, however narrow an axis is against the radius.
    """
    u_low, u_high = (np.clip(limit, 0.0, radius) for limit in u)
    v_low, v_high = (np.clip(limit, 0.0, radius) for limit in v)
    start = np.maximum(np.arctan2(u_low, _other_leg(radius, u_low)), np.arctan2(_other_leg(radius, v_high), v_high))
    stop = np.minimum(np.arctan2(u_high, _other_leg(radius, u_high)), np.arctan2(_other_leg(radius, v_low), v_low))
    half = 0.5 * np.maximum(stop - start, 0.0)[..., None]
    return start[..., None] + half * (1.0 + _NODES), half * _WEIGHTS


def _range(bias: float, rms: float) -> tuple[float, float]:
    return bias - _REACH * rms, bias + _REACH * rms


def _normal(value: Floats, bias: float, rms: float) -> Floats:
    return np.asarray(np.exp(-0.5 * ((value - bias) / rms) ** 2) / (math.sqrt(2.0 * math.pi) * rms))


def _probability_of(jitter: Jitter, radius: Floats, beyond: bool) -> Floats:
    """P(r > R), or P(r < R): the axis with the smaller rms by quadrature along the circle, the other in closed form.

    Either is a sum of positive terms, so that a small probability keeps its digits.
    """
    bias_u, rms_u, bias_v, rms_v = _axes(jitter)
    if _is_rayleigh(jitter):
        exponent = -0.5 * np.minimum(radius / rms_v, 1e3) ** 2  # exp is 0 long before
        return np.asarray(np.exp(exponent) if beyond else -np.expm1(exponent))
    if rms_v == 0.0:
        static = jitter.static_rad
        return np.asarray(np.where(static > radius if beyond else static < radius, 1.0, 0.0))
    of_axis = _outside if beyond else _inside
    if rms_u == 0.0:
        return of_axis(_other_leg(radius, np.minimum(radius, abs(bias_u))), bias_v, rms_v)
    span = _range(abs(bias_v), rms_v)
    # where v alone decides, u is left in closed form: v is surely outside the chord, or surely inside
    sure = np.clip(span[0] if beyond else span[1], 0.0, radius)
    total = of_axis(_other_leg(radius, sure), bias_u, rms_u)
    for side in (1.0, -1.0):
        angle, weight = _arc(radius, _range(side * bias_u, rms_u), span)
        chord = radius[..., None] * np.cos(angle)
        along_u = _normal(radius[..., None] * np.sin(angle), side * bias_u, rms_u)
        total = total + np.sum(weight * chord * along_u * of_axis(chord, bias_v, rms_v), axis=-1)
    return np.asarray(np.minimum(total, 1.0))


def radial_survival(jitter: Jitter, radius_rad: ArrayLike) -> Floats:
    """Probability P(r > R) that the radial pointing error r exceeds each radius R.

    Exact for unequal and biased axes, by 96-point Gauss-Legendre quadrature over one axis. Equal axes s without bias
    have the Rayleigh distribution, exp(-R^2 / (2 s^2)).

    Args:
        jitter: Bias and rms of the pointing error about each axis, in rad.
        radius_rad: Radii R, in rad, any shape.

    Raises:
        ValueError: For a negative radius.
    """
    return _probability_of(jitter, checked("the radial error", radius_rad, RADIUS), beyond=True)


def radial_cdf(jitter: Jitter, radius_rad: ArrayLike) -> Floats:
    """Probability P(r < R) that the radial pointing error r stays below each radius R.

    It is 1 - `radial_survival`, but a small probability keeps its digits here.

    Args:
        jitter: Bias and rms of the pointing error about each axis, in rad.
        radius_rad: Radii R, in rad, any shape.

    Raises:
        ValueError: For a negative radius.
    """
    return _probability_of(jitter, checked("the radial error", radius_rad, RADIUS), beyond=False)


def density_on_circle(jitter: Jitter, radius: Floats) -> tuple[Floats, Floats, Floats]:
    """Joint density of the errors on a circle, ready to be summed round it over the last axis.

    Returns squared direction cosines of the nodes towards x and y, and density times arc length (1/rad); the sum of the
    latter is the density of the radial error.

    Args:
        jitter: Bias and rms of the pointing error about each axis, in rad; both rms above 0.
        radius: Radii of the circles, in rad, any shape.
    """
    bias_u, rms_u, bias_v, rms_v = _axes(jitter)
    towards_v, parts = [], []
    for side_u, side_v in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
        angle, weight = _arc(radius, _range(side_u * bias_u, rms_u), _range(side_v * bias_v, rms_v))
        density = _normal(radius[..., None] * np.sin(angle), side_u * bias_u, rms_u)
        density = density * _normal(radius[..., None] * np.cos(angle), side_v * bias_v, rms_v)
        towards_v.append(np.cos(angle) ** 2)
        parts.append(radius[..., None] * weight * density)
    v = np.concatenate(towards_v, axis=-1)
    x_is_u = jitter.rms_rad[0] <= jitter.rms_rad[1]
    return (1.0 - v if x_is_u else v), (v if x_is_u else 1.0 - v), np.concatenate(parts, axis=-1)


def radial_quantile(jitter: Jitter, probability: ArrayLike) -> Floats:
    """Radial error (rad) that is exceeded with each probability p: the root R of P(r > R) = p.

    Args:
        jitter: Bias and rms of the pointing error about each axis, in rad.
        probability: Probabilities p, any shape.

    Raises:
        ValueError: Unless p is from `SMALLEST_PROBABILITY` to below 1.
    """
    p = checked("the probability", probability, Share("", least=SMALLEST_PROBABILITY))
    widest = max(jitter.rms_rad)
    if widest == 0.0:
        return np.full(p.shape, jitter.static_rad)
    if _is_rayleigh(jitter):
        return np.asarray(widest * np.sqrt(-2.0 * np.log(p)))
    from scipy.optimize import brentq

    def missed(radius: float, p: float) -> float:
        return math.log(max(float(_probability_of(jitter, np.asarray(radius), beyond=True)), 1e-300) / p)

    def root(p: float) -> float:
        # r is at most the bias plus a Rayleigh variable of the wider axis
        highest = (jitter.static_rad + widest * math.sqrt(-2.0 * math.log(p))) * (1.0 + 1e-6)
        return float(brentq(missed, 0.0, highest, args=(p,), xtol=1e-300, rtol=_ROUNDING))

    return np.array([root(each) for each in p.ravel().tolist()]).reshape(p.shape)


@lru_cache(maxsize=64)  # both ends of a link, its budget and each input that is moved ask for the same
def radial_steps(jitter: Jitter) -> tuple[Floats, Floats]:
    """Radial errors (rad) in steps that are small against their distribution, and the share of the time of each.

    Args:
        jitter: Bias and rms of the pointing error about each axis, in rad.
    """
    reach = jitter.static_rad + _REACH * max(jitter.rms_rad)
    if reach == jitter.static_rad:
        radius, share = np.array([reach]), np.ones(1)
    else:
        edges = np.linspace(0.0, reach, _STEPS + 1)
        share = np.maximum(-np.diff(radial_survival(jitter, edges)), 0.0)
        radius, share = (edges[1:] + edges[:-1]) / 2.0, share / np.sum(share)
    for each in (radius, share):
        each.setflags(write=False)  # it is shared
    return radius, share
