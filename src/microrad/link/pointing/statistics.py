"""What a static bias and jitter of the pointing do to the link of a Gaussian beam, far field.

Transmission h = exp(-2 r^2 / theta^2), theta the half angle at 1/e^2 of the intensity, r the radial pointing error.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.core.units import format_quantity
from microrad.link.gains import checked
from microrad.link.radial_error import RADIUS, Jitter, radial_quantile, radial_survival
from microrad.mission.fields import Quantity

_DB_PER_SQUARE = 20.0 / math.log(10.0)  # loss in dB is 8.686 (r / theta)^2


# ------------------------------------------------------------------------------------------------------------- checks
def _half_angle(values: ArrayLike) -> Floats:
    return checked("the half angle", values, Quantity("rad", above=0.0), "it is that of a beam at 1/e^2")


# ---------------------------------------------------------------------------------------------------------------- mean
def transmission(radius_rad: ArrayLike, half_angle_rad: ArrayLike) -> Floats:
    """Received power h = exp(-2 r^2 / theta^2) at a radial error, the power on axis taken as 1.

    Args:
        radius_rad: Radial errors r, in rad, at least 0; broadcast against the half angle.
        half_angle_rad: Half angle theta of the beam at 1/e2, in rad.

    Raises:
        ValueError: For a negative error or a half angle not above 0.
    """
    radius = checked("the radial error", radius_rad, RADIUS)
    return np.asarray(np.exp(-2.0 * (radius / _half_angle(half_angle_rad)) ** 2))


def _squares(jitter: Jitter, half_angle_rad: ArrayLike) -> tuple[Floats, Floats]:
    """4 rms^2 / theta^2 and 2 bias^2 / theta^2 per axis, the axis last."""
    theta = _half_angle(half_angle_rad)[..., None]
    return 4.0 * (np.asarray(jitter.rms_rad) / theta) ** 2, 2.0 * (np.asarray(jitter.bias_rad) / theta) ** 2


def mean_loss_db(jitter: Jitter, half_angle_rad: ArrayLike) -> Floats:
    """Loss of mean power in dB (positive) against a beam pointed without error, -10 lg E[h]; see `mean_transmission`.

    Args:
        jitter: Bias and rms of the pointing error about each axis, in rad.
        half_angle_rad: Half angles of the beam at 1/e2, in rad, any shape.

    Raises:
        ValueError: For a half angle that is not above 0.
    """
    spread, offset = _squares(jitter, half_angle_rad)
    nepers = np.sum(0.5 * np.log1p(spread) + offset / (1.0 + spread), axis=-1)
    return np.asarray(10.0 / math.log(10.0) * nepers)


def mean_transmission(jitter: Jitter, half_angle_rad: ArrayLike) -> Floats:
    """Mean received power E[h], the power on axis taken as 1.

    It is the product over the axes of exp(-2 b^2 / (theta^2 + 4 s^2)) / sqrt(1 + 4 s^2 / theta^2). Equal axes without
    bias give 1 / (1 + 4 s^2 / theta^2), as the density beta h^(beta - 1), beta = theta^2 / (4 s^2), of Toyoshima et al.
    (2002).

    Args:
        jitter: Bias b and rms s of the pointing error about each axis, in rad.
        half_angle_rad: Half angles theta of the beam at 1/e2, in rad, any shape.

    Raises:
        ValueError: For a half angle that is not above 0.
    """
    return np.asarray(10.0 ** (-0.1 * mean_loss_db(jitter, half_angle_rad)))


# -------------------------------------------------------------------------------------------------------- distribution
def outage_probability(jitter: Jitter, half_angle_rad: ArrayLike, margin_db: ArrayLike) -> Floats:
    """Share of the time in which the pointing loss exceeds a fade margin below the power on axis.

    Equal axes without bias give P(h < x) = x^beta, beta as in `mean_transmission`.

    Args:
        jitter: Bias and rms of the pointing error about each axis, in rad.
        half_angle_rad: Half angles of the beam at 1/e2, in rad; broadcast against the margins.
        margin_db: Fade margins, in dB, positive.

    Raises:
        ValueError: For a negative margin or a half angle not above 0.
    """
    return radial_survival(jitter, radius_of_loss_rad(half_angle_rad, margin_db))


def outage_loss_db(jitter: Jitter, half_angle_rad: ArrayLike, probability: ArrayLike) -> Floats:
    """Pointing loss in dB that is exceeded with each probability: the fade margin that this outage needs.

    Args:
        jitter: Bias and rms of the pointing error about each axis, in rad.
        half_angle_rad: Half angles of the beam at 1/e2, in rad; broadcast against the probabilities.
        probability: Probabilities of the outage.

    Raises:
        ValueError: As `radial_quantile`, and for a half angle not above 0.

    Example:
        ```python
        import microrad

        jitter = microrad.Jitter(bias_rad=(0.0, 0.0), rms_rad=(2e-6, 2e-6))
        print(microrad.outage_loss_db(jitter, half_angle_rad=10e-6, probability=0.003))
        ```
    """
    return np.asarray(_DB_PER_SQUARE * (radial_quantile(jitter, probability) / _half_angle(half_angle_rad)) ** 2)


def radius_of_loss_rad(half_angle_rad: ArrayLike, loss_db: ArrayLike) -> Floats:
    """Radial error (rad) at which the pointing loss has each value, from loss = 8.686 dB (r / theta)^2.

    Args:
        half_angle_rad: Half angles theta of the beam at 1/e2, in rad; broadcast against the losses.
        loss_db: Pointing losses, in dB, positive.

    Raises:
        ValueError: For a negative loss or a half angle not above 0.
    """
    loss = checked("the loss", loss_db, Quantity("dB", least=0.0))
    return np.asarray(_half_angle(half_angle_rad) * np.sqrt(loss / _DB_PER_SQUARE))


# ----------------------------------------------------------------------------------------------------- best divergence
@dataclass(frozen=True, slots=True)
class BestDivergence:
    """Half angle at 1/e^2 that gives the most received power under a criterion.

    `loss_db` is the pointing loss that the criterion counts, at this half angle; `gain_db` the transmit gain 8/theta^2
    less that loss. `wanted_half_angle_rad` is the best one without a smallest: what a larger aperture would allow, 0
    where there is no error to be wide for. `at_limit` says that the smallest half angle binds: the beam would be
    narrower if it could. `current_excess_db` is what the current half angle loses against the best, if one was given.
    """

    half_angle_rad: float
    loss_db: float
    gain_db: float
    wanted_half_angle_rad: float
    at_limit: bool
    current_excess_db: float | None


def best_divergence_for_outage(
    jitter: Jitter,
    probability: float,
    *,
    smallest_half_angle_rad: float = 0.0,
    current_half_angle_rad: float | None = None,
) -> BestDivergence:
    """Half angle with the most power at the loss exceeded with a probability: sqrt(2) times that radial error.

    The loss there is 4.343 dB whatever the bias and the axes, unless the limit binds. Equal axes s without bias give 2
    s sqrt(ln(1/p)).

    Args:
        jitter: Bias and rms of the pointing error about each axis, in rad.
        probability: Probability p of the outage.
        smallest_half_angle_rad: Smallest half angle at 1/e2 that the aperture allows, in rad; 0 for no limit.
        current_half_angle_rad: Half angle to compare with, in rad, None for no comparison.

    Raises:
        ValueError: As `best_divergence_for_static_error` and `radial_quantile`.

    Example:
        ```python
        import microrad

        jitter = microrad.Jitter(bias_rad=(0.0, 0.0), rms_rad=(2e-6, 2e-6))
        best = microrad.best_divergence(jitter, probability=0.003, current_half_angle_rad=10e-6)
        print(best.half_angle_rad, best.loss_db, best.current_excess_db)
        ```
    """
    radius = float(radial_quantile(jitter, probability))
    return best_divergence_for_static_error(
        radius, smallest_half_angle_rad=smallest_half_angle_rad, current_half_angle_rad=current_half_angle_rad
    )


def best_divergence_for_static_error(
    error_rad: float, *, smallest_half_angle_rad: float = 0.0, current_half_angle_rad: float | None = None
) -> BestDivergence:
    """Half angle with the most power at a static radial error: sqrt(2) times it, where 8/theta^2 h is largest.

    Args:
        error_rad: Radial error, in rad.
        smallest_half_angle_rad: Smallest half angle at 1/e2 that the aperture allows, in rad; 0 for no limit.
        current_half_angle_rad: Half angle to compare with, in rad, None for no comparison.

    Raises:
        ValueError: For a negative error, a current half angle below the smallest, or no error and no limit.
    """
    error = float(checked("the radial error", error_rad, RADIUS))
    limit = float(checked("the smallest half angle", smallest_half_angle_rad, RADIUS))
    wanted = math.sqrt(2.0) * error
    best, current = max(wanted, limit), current_half_angle_rad
    if best == 0.0:
        raise ValueError(
            "the received power grows without end as the beam narrows (half angle 0 rad); "
            "give the smallest half angle, the diffraction limit of the aperture"
        )
    if current is not None and float(_half_angle(current)) < limit:
        raise ValueError(
            f"the current half angle of {format_quantity(current, 'rad')} is below the smallest, "
            f"{format_quantity(limit, 'rad')}; correct one of them"
        )

    def loss_db(half_angle: float) -> float:
        return _DB_PER_SQUARE * (error / half_angle) ** 2

    def gain_db(half_angle: float) -> float:
        return 10.0 * math.log10(8.0 / half_angle**2) - loss_db(half_angle)

    excess = None if current is None else gain_db(best) - gain_db(current)
    return BestDivergence(best, loss_db(best), gain_db(best), wanted, best == limit, excess)
