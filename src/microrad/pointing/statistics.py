"""What a static bias and jitter of the pointing do to the link of a Gaussian beam, far field.

Transmission h = exp(-2 r^2 / theta^2), theta the half angle at 1/e^2 of the intensity, r the radial pointing error.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from microrad.units import format_quantity

Floats = NDArray[np.float64]

SMALLEST_PROBABILITY = 1e-20
"""Below it the quadrature of the tails is no longer relied on."""

_DB_PER_SQUARE = 20.0 / math.log(10.0)  # loss in dB is 8.686 (r / theta)^2
_REACH = 12.0  # standard deviations about the bias that are integrated; 4e-33 lies beyond
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(96)


@dataclass(frozen=True, slots=True)
class Jitter:
    """Pointing error of two axes, x and y, at the line of sight: independent Gaussians about a static bias.

    `rms_rad` is the standard deviation per axis about `bias_rad`, not the radial one. The axes may differ, and either
    rms may be 0. Errors that are correlated need the axes in which they are not. Raises `ValueError` for a value that
    is not finite, or a negative rms.
    """

    bias_rad: tuple[float, float]
    rms_rad: tuple[float, float]

    def __post_init__(self) -> None:
        """Refuse what is no bias and no rms."""
        for name, values in (("bias", self.bias_rad), ("jitter rms", self.rms_rad)):
            if len(values) != 2 or not all(math.isfinite(value) for value in values):
                raise ValueError(f"the {name} is {values} rad; give two finite values, for axis x and axis y")
        if min(self.rms_rad) < 0.0:
            shown = format_quantity(min(self.rms_rad), "rad")
            raise ValueError(f"a jitter rms of {shown} is below 0; give the standard deviation per axis")

    @property
    def static_rad(self) -> float:
        """Radial bias (rad)."""
        return math.hypot(*self.bias_rad)


# ------------------------------------------------------------------------------------------------------------- checks
def _at_least_zero(values: ArrayLike, name: str, unit: str) -> Floats:
    array = np.asarray(values, dtype=np.float64)
    wrong = array[~(np.isfinite(array) & (array >= 0.0))]
    if wrong.size:
        raise ValueError(f"a {name} of {format_quantity(wrong[0], unit)} is not possible; give at least 0 {unit}")
    return array


def _half_angle(values: ArrayLike) -> Floats:
    array = np.asarray(values, dtype=np.float64)
    wrong = array[~(np.isfinite(array) & (array > 0.0))]
    if wrong.size:
        shown = format_quantity(wrong[0], "rad")
        raise ValueError(f"a half angle of {shown} is no beam; give the half angle at 1/e^2, above 0 rad")
    return array


def _probability(values: ArrayLike) -> Floats:
    array = np.asarray(values, dtype=np.float64)
    wrong = array[~((array >= SMALLEST_PROBABILITY) & (array < 1.0))]
    if wrong.size:
        raise ValueError(f"a probability of {wrong[0]:g} is out of range; give {SMALLEST_PROBABILITY:g} to below 1")
    return array


# --------------------------------------------------------------------------------------------------- mean and variance
def transmission(radius_rad: ArrayLike, half_angle_rad: ArrayLike) -> Floats:
    """h = exp(-2 r^2 / theta^2), the power on axis taken as 1; radial error and half angle are broadcast."""
    radius = _at_least_zero(radius_rad, "radial error", "rad")
    return np.asarray(np.exp(-2.0 * (radius / _half_angle(half_angle_rad)) ** 2))


def _squares(jitter: Jitter, half_angle_rad: ArrayLike) -> tuple[Floats, Floats]:
    """4 rms^2 / theta^2 and 2 bias^2 / theta^2 per axis, the axis last."""
    theta = _half_angle(half_angle_rad)[..., None]
    return 4.0 * (np.asarray(jitter.rms_rad) / theta) ** 2, 2.0 * (np.asarray(jitter.bias_rad) / theta) ** 2


def mean_loss_db(jitter: Jitter, half_angle_rad: ArrayLike) -> Floats:
    """Loss of mean power in dB against a beam pointed without error, -10 lg E[h]; see `mean_transmission`."""
    spread, offset = _squares(jitter, half_angle_rad)
    nepers = np.sum(0.5 * np.log1p(spread) + offset / (1.0 + spread), axis=-1)
    return np.asarray(10.0 / math.log(10.0) * nepers)


def mean_transmission(jitter: Jitter, half_angle_rad: ArrayLike) -> Floats:
    """Mean E[h]: the product over the axes of exp(-2 b^2 / (theta^2 + 4 s^2)) / sqrt(1 + 4 s^2 / theta^2).

    b is the bias and s the rms of the axis (the Gaussian integral, done). Equal axes without bias give
    1 / (1 + 4 s^2 / theta^2), as the density beta h^(beta - 1), beta = theta^2 / (4 s^2), of Toyoshima et al. (2002).
    Raises `ValueError` for a half angle that is not above 0.
    """
    return np.asarray(10.0 ** (-0.1 * mean_loss_db(jitter, half_angle_rad)))


def transmission_variance(jitter: Jitter, half_angle_rad: ArrayLike) -> Floats:
    """Variance of h. E[h^2] is the mean at the half angle theta / sqrt(2); no digits are lost at small jitter."""
    spread, offset = _squares(jitter, half_angle_rad)
    # ln(E[h^2] / E[h]^2), as a sum of positive terms
    excess = 0.5 * np.log1p(spread**2 / (1.0 + 2.0 * spread))
    excess += 2.0 * offset * spread / ((1.0 + spread) * (1.0 + 2.0 * spread))
    return np.asarray(mean_transmission(jitter, half_angle_rad) ** 2 * np.expm1(np.sum(excess, axis=-1)))


# -------------------------------------------------------------------------------------------------------- distribution
def _outside(limit: Floats, bias: float, rms: float) -> Floats:
    """P(|v| > limit) of one axis; without digits lost in the tail."""
    from scipy.special import ndtr  # here: slow to load

    return np.asarray(ndtr((abs(bias) - limit) / rms) + ndtr((-abs(bias) - limit) / rms))


def _inside(limit: Floats, bias: float, rms: float) -> Floats:
    from scipy.special import ndtr  # here: slow to load

    return np.asarray(ndtr((limit - abs(bias)) / rms) - ndtr((-limit - abs(bias)) / rms))


def _axes(jitter: Jitter) -> tuple[float, float, float, float]:
    """Bias and rms of the axis with the smaller rms, then of the other."""
    (first, second) = sorted(zip(jitter.rms_rad, jitter.bias_rad, strict=True), key=lambda axis: axis[0])
    return first[1], first[0], second[1], second[0]


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
    """P(r > R) of the radial pointing error, for each radius R.

    Exact for unequal and biased axes, by 96-point Gauss-Legendre quadrature over one axis. Equal axes s without bias
    give the Rayleigh distribution exp(-R^2 / (2 s^2)), and P(h < x) = x^beta. Raises `ValueError` for a
    negative radius.
    """
    return _probability_of(jitter, _at_least_zero(radius_rad, "radial error", "rad"), beyond=True)


def radial_cdf(jitter: Jitter, radius_rad: ArrayLike) -> Floats:
    """P(r < R) of the radial pointing error, as `radial_survival`; a small probability keeps its digits here."""
    return _probability_of(jitter, _at_least_zero(radius_rad, "radial error", "rad"), beyond=False)


def density_on_circle(jitter: Jitter, radius: Floats) -> tuple[Floats, Floats, Floats]:
    """Joint density of the errors on the circle of `radius`, ready to be summed round it over the last axis.

    Returns squared direction cosines of the nodes towards x and y, and density times arc length (1/rad); the sum of
    the latter is the density of the radial error. Both rms must be above 0.
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
    """Radial error (rad) that is exceeded with `probability`: the root R of P(r > R) = p.

    Raises `ValueError` unless p is from `SMALLEST_PROBABILITY` to below 1.
    """
    p = _probability(probability)
    widest = max(jitter.rms_rad)
    if widest == 0.0:
        return np.full(p.shape, jitter.static_rad)
    from scipy.optimize import elementwise  # here: slow to load

    def missed(radius: Floats, p: Floats) -> Floats:
        return np.asarray(np.log(np.maximum(_probability_of(jitter, radius, beyond=True), 1e-300) / p))

    # r is at most the bias plus a Rayleigh variable of the wider axis
    highest = (jitter.static_rad + widest * np.sqrt(-2.0 * np.log(p))) * (1.0 + 1e-6)
    found = elementwise.find_root(missed, (np.zeros(p.shape), highest), args=(p,))
    if not np.all(found.success):
        raise RuntimeError(f"no radial error was found for the probabilities {p}")
    return np.asarray(found.x, dtype=np.float64)


def outage_probability(jitter: Jitter, half_angle_rad: ArrayLike, margin_db: ArrayLike) -> Floats:
    """P(pointing loss > margin): the share of time that a fade margin above the power on axis does not cover.

    Half angle and margin are broadcast. Raises `ValueError` for a negative margin or a half angle not above 0.
    """
    return _probability_of(jitter, radius_of_loss_rad(half_angle_rad, margin_db), beyond=True)


def loss_cdf(jitter: Jitter, half_angle_rad: ArrayLike, loss_db: ArrayLike) -> Floats:
    """P(pointing loss < `loss_db`), the distribution of the loss in dB; arguments as for `outage_probability`."""
    return _probability_of(jitter, radius_of_loss_rad(half_angle_rad, loss_db), beyond=False)


def outage_loss_db(jitter: Jitter, half_angle_rad: ArrayLike, probability: ArrayLike) -> Floats:
    """Pointing loss in dB not exceeded but for `probability`: the fade margin that this outage needs."""
    return np.asarray(_DB_PER_SQUARE * (radial_quantile(jitter, probability) / _half_angle(half_angle_rad)) ** 2)


def radius_of_loss_rad(half_angle_rad: ArrayLike, loss_db: ArrayLike) -> Floats:
    """Radial error (rad) at which the pointing loss is `loss_db`, from loss = 8.686 dB (r / theta)^2."""
    loss = _at_least_zero(loss_db, "loss", "dB")
    return np.asarray(_half_angle(half_angle_rad) * np.sqrt(loss / _DB_PER_SQUARE))


# ----------------------------------------------------------------------------------------------------- best divergence
@dataclass(frozen=True, slots=True)
class BestDivergence:
    """Half angle at 1/e^2 that gives the most received power under a criterion.

    `loss_db` is the pointing loss that the criterion counts, at this half angle; `gain_db` the transmit gain 8/theta^2
    less that loss. `at_limit` says that the smallest half angle binds: the beam would be narrower if it could.
    `current_excess_db` is what the current half angle loses against the best, if one was given.
    """

    half_angle_rad: float
    loss_db: float
    gain_db: float
    at_limit: bool
    current_excess_db: float | None


def best_divergence_for_outage(
    jitter: Jitter,
    probability: float,
    *,
    smallest_half_angle_rad: float = 0.0,
    current_half_angle_rad: float | None = None,
) -> BestDivergence:
    """Half angle with the most power at the loss exceeded with `probability`: sqrt(2) times that radial error.

    The loss there is 4.343 dB whatever the bias and the axes, unless the limit binds. Equal axes s without bias give
    2 s sqrt(ln(1/p)). Raises `ValueError` as `best_divergence_for_static_error` and `radial_quantile`.
    """
    radius = float(radial_quantile(jitter, probability))
    return best_divergence_for_static_error(
        radius, smallest_half_angle_rad=smallest_half_angle_rad, current_half_angle_rad=current_half_angle_rad
    )


def best_divergence_for_static_error(
    error_rad: float, *, smallest_half_angle_rad: float = 0.0, current_half_angle_rad: float | None = None
) -> BestDivergence:
    """Half angle with the most power at a static radial error: sqrt(2) times it, where 8/theta^2 h is largest.

    Raises `ValueError` for a negative error, a current half angle below the smallest, or no error and no limit.
    """
    error = float(_at_least_zero(error_rad, "radial error", "rad"))
    wanted = math.sqrt(2.0) * error
    return _best(
        wanted,
        lambda half_angle: _DB_PER_SQUARE * (error / half_angle) ** 2,
        smallest_half_angle_rad,
        current_half_angle_rad,
    )


def best_divergence_for_mean(
    jitter: Jitter, *, smallest_half_angle_rad: float = 0.0, current_half_angle_rad: float | None = None
) -> BestDivergence:
    """Half angle with the most mean power, the largest 8/theta^2 E[h].

    Without bias the mean power grows as the beam narrows, down to the smallest half angle: jitter alone has no best
    divergence by this criterion. Equal axes s have one for a radial bias b above sqrt(2) s, at
    theta^2 = 2 b^2 - 4 s^2. Raises `ValueError` when there is none and no limit, or the current half angle is below it.
    """
    limit = float(_at_least_zero(smallest_half_angle_rad, "smallest half angle", "rad"))
    candidates = [limit**2, *(square for square in _stationary_squares(jitter) if square > limit**2)]
    wanted = math.sqrt(max(candidates, key=lambda square: _log_mean_gain(jitter, square)))
    return _best(wanted, lambda half_angle: float(mean_loss_db(jitter, half_angle)), limit, current_half_angle_rad)


def _stationary_squares(jitter: Jitter) -> list[float]:
    """theta^2 > 0 where the mean gain is stationary: the sum of (2 b^2 - T / 2) / T^2 over the axes is 0.

    T = theta^2 + 4 s^2, so it is a cubic in theta^2. It is solved in units of the largest angle.
    """
    unit = max(*(abs(bias) for bias in jitter.bias_rad), *jitter.rms_rad)
    if unit == 0.0:
        return []
    polynomial = np.polynomial.Polynomial
    t_x, t_y = (polynomial([4.0 * (rms / unit) ** 2, 1.0]) for rms in jitter.rms_rad)
    b_x, b_y = (polynomial([2.0 * (bias / unit) ** 2]) for bias in jitter.bias_rad)
    cubic = (b_x - 0.5 * t_x) * t_y**2 + (b_y - 0.5 * t_y) * t_x**2
    roots = [complex(root) for root in cubic.roots()]
    # real parts will do: a candidate that is no maximum is outdone by one that is
    return [root.real * unit**2 for root in roots if root.real > 0.0]


def _log_mean_gain(jitter: Jitter, square: float) -> float:
    """ln of E[h] / theta^2 at theta^2 = `square`, its limit where that is 0 and an axis does not jitter."""
    total = 0.0
    for bias, rms in zip(jitter.bias_rad, jitter.rms_rad, strict=True):
        width = square + 4.0 * rms**2
        if width == 0.0 and bias != 0.0:
            return -math.inf
        total += math.inf if width == 0.0 else -0.5 * math.log(width) - 2.0 * bias**2 / width
    return total


def _best(wanted: float, loss_db: Callable[[float], float], smallest: float, current: float | None) -> BestDivergence:
    limit = float(_at_least_zero(smallest, "smallest half angle", "rad"))
    if max(wanted, limit) == 0.0:
        raise ValueError(
            "the received power grows without end as the beam narrows (half angle 0 rad); "
            "give the smallest half angle, the diffraction limit of the aperture"
        )
    if current is not None and float(_half_angle(current)) < limit:
        raise ValueError(
            f"the current half angle of {format_quantity(current, 'rad')} is below the smallest, "
            f"{format_quantity(limit, 'rad')}; correct one of them"
        )

    def gain_db(half_angle: float) -> float:
        return 10.0 * math.log10(8.0 / half_angle**2) - loss_db(half_angle)

    best = max(wanted, limit)
    excess = None if current is None else gain_db(best) - gain_db(current)
    return BestDivergence(best, loss_db(best), gain_db(best), wanted <= limit, excess)
