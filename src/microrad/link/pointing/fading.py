"""Fades of a Gaussian beam's link by jitter: how often, how long, and what the fluctuating power costs.

The motion of each axis is a stationary Gaussian process, independent of the other axis.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.core.units import format_quantity
from microrad.link.gains import checked
from microrad.link.pointing.statistics import outage_probability, radius_of_loss_rad, transmission
from microrad.link.radial_error import RADIUS, Jitter, density_on_circle, radial_survival
from microrad.mission.fields import Quantity

ErrorRatio = Callable[[Floats], Floats]
"""Bit error ratio over received power; the power 1 is what the target needs without pointing error."""

MOST_TOP_OCTAVE_SHARE = 0.1
"""Above this share of the velocity variance in the top octave, the rate of fades is the grid's rather than nature's."""
MOST_POWER_DB = 100.0
"""Extra power beyond which the search for a mean bit error ratio gives up."""

_REACH = 12.0  # standard deviations about the bias that a mean over the pointing error takes in
_RADII = 4001  # edges of its steps of the radial error
_CIRCLES = 192  # of the receiver's error, in fades of two ends
_SECTORS = 32  # of directions that have nearly one speed
_STILL = 0.01


class NoPowerError(ValueError):
    """Not even `MOST_POWER_DB` more power bring the mean bit error ratio back to its target."""


# ----------------------------------------------------------------------------------------------------- from a spectrum
@dataclass(frozen=True, slots=True)
class SpectralMotion:
    """What a spectrum says of the motion of axis x and axis y.

    `rms_rad` and `velocity_rms_rad_s` cover the frequencies of the grid only. `top_octave_share` is the share of the
    velocity variance that lies between half the highest frequency and the highest, `highest_hz`.
    """

    rms_rad: tuple[float, float]
    velocity_rms_rad_s: tuple[float, float]
    top_octave_share: tuple[float, float]
    highest_hz: float

    @property
    def warning(self) -> str:
        """In words, that the velocity hangs on the highest frequency; nothing when it does not.

        A spectrum that does not fall faster than 1/f^3 has no finite velocity variance: the rate of fades then grows
        with the highest frequency and their mean duration shrinks.
        """
        share = max(self.top_octave_share)
        if share <= MOST_TOP_OCTAVE_SHARE:
            return ""
        return (
            f"{100.0 * share:.0f} % of the velocity variance lies in the octave below "
            f"{format_quantity(self.highest_hz, 'Hz')}: rate and duration of fades hang on where the spectrum ends; "
            "extend it until it falls faster than 1/f^3, or state the bandwidth that counts"
        )


def motion_of_spectrum(freq_hz: ArrayLike, psd_rad2_hz: ArrayLike) -> SpectralMotion:
    """Angle and velocity of the axes from their one-sided power spectral densities, by the trapezoidal rule.

    The velocity variance is the integral of (2 pi f)^2 S. The grid must resolve the peaks of the spectrum.

    Args:
        freq_hz: Rising frequencies f, in Hz, shape (freqs,).
        psd_rad2_hz: One-sided density S of the angle about each axis, in rad^2/Hz, shape (2, freqs), axis x first.

    Raises:
        ValueError: For a grid that does not rise or is negative, a density that is negative or of another shape, and
            values that are not finite.
    """
    freq, psd = _checked_spectrum(freq_hz, psd_rad2_hz)
    speed = (2.0 * math.pi * freq) ** 2 * psd
    total = np.trapezoid(speed, freq, axis=-1)
    split = 0.5 * freq[-1]
    top = freq[freq > split]
    if freq[0] <= split:
        top = np.concatenate(([split], top))
    in_top = np.array([np.trapezoid(np.interp(top, freq, one), top) for one in speed])
    share = np.divide(in_top, total, out=np.zeros(2), where=total > 0.0)
    return SpectralMotion(
        _pair(np.sqrt(np.trapezoid(psd, freq, axis=-1))), _pair(np.sqrt(total)), _pair(share), float(freq[-1])
    )


def _pair(values: Floats) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _checked_spectrum(freq_hz: ArrayLike, psd_rad2_hz: ArrayLike) -> tuple[Floats, Floats]:
    freq, psd = np.asarray(freq_hz, dtype=np.float64), np.asarray(psd_rad2_hz, dtype=np.float64)
    if freq.ndim != 1 or freq.size < 2 or psd.shape != (2, freq.size):
        raise ValueError(
            f"frequencies of shape {freq.shape} and spectral densities of shape {psd.shape} do not fit; "
            "give (freqs,) with at least 2 of them, and (2, freqs)"
        )
    if not np.all(np.isfinite(freq)) or freq[0] < 0.0 or np.any(np.diff(freq) <= 0.0):
        raise ValueError("the frequencies do not rise from 0 Hz or above; sort them, each once")
    return freq, checked("the spectral density", psd, Quantity("rad^2/Hz", least=0.0))


# --------------------------------------------------------------------------------------------------------------- fades
@dataclass(frozen=True, slots=True)
class Fades:
    """Fades deeper than a margin, one entry for each half angle and margin given.

    `share_of_time` is the outage probability, `per_second` how often a fade begins, `mean_duration_s` the one over the
    other. With no fade at all the duration is 0; where there is no other time than the fade's it is infinite.
    """

    per_second: Floats
    mean_duration_s: Floats
    share_of_time: Floats


def level_crossing_rate_hz(jitter: Jitter, velocity_rms_rad_s: tuple[float, float], radius_rad: ArrayLike) -> Floats:
    """How often in a second the radial error rises through each radius R.

    The integral round the circle of the joint density times the mean outward speed, sv_n / sqrt(2 pi) with
    sv_n^2 = cos^2 sv_x^2 + sin^2 sv_y^2 (Rice 1944, for two axes): velocity and angle at the same instant are
    independent. Equal axes without bias give sv / sqrt(2 pi) R / s^2 exp(-R^2 / (2 s^2)).

    Args:
        jitter: Bias and rms of the pointing error about each axis, in rad.
        velocity_rms_rad_s: Rms velocity sv of each axis, in rad/s.
        radius_rad: Radii R, in rad, any shape, at least 0.

    Raises:
        ValueError: For a velocity that is negative or not finite, an axis that moves without jitter or jitters without
            moving, and a negative radius.
    """
    _check_velocity(jitter, velocity_rms_rad_s)
    radius = checked("the radial error", radius_rad, RADIUS)
    if min(jitter.rms_rad) > 0.0:
        square_x, square_y, density = density_on_circle(jitter, radius)
        speed = np.sqrt(square_x * velocity_rms_rad_s[0] ** 2 + square_y * velocity_rms_rad_s[1] ** 2)
        return np.asarray(np.sum(density * speed, axis=-1) / math.sqrt(2.0 * math.pi))
    return _one_axis_rate(jitter, velocity_rms_rad_s, radius)


def _check_velocity(jitter: Jitter, velocity: tuple[float, float]) -> None:
    for axis, rms, speed in zip("xy", jitter.rms_rad, velocity, strict=True):
        Quantity("rad/s", least=0.0).check(f"the velocity rms of axis {axis}", speed)
        if (rms > 0.0) != (speed > 0.0):
            raise ValueError(
                f"axis {axis} has a jitter rms of {format_quantity(rms, 'rad')} and a velocity rms of "
                f"{format_quantity(speed, 'rad/s')}; give both above 0, or both 0 and the standing error as its bias"
            )


def _one_axis_rate(jitter: Jitter, velocity: tuple[float, float], radius: Floats) -> Floats:
    """One axis stands still: the other leaves the chord of the circle at either end."""
    moving = int(np.argmax(jitter.rms_rad))
    rms, bias, still = jitter.rms_rad[moving], jitter.bias_rad[moving], abs(jitter.bias_rad[1 - moving])
    if rms == 0.0:
        return np.zeros(radius.shape)
    chord = np.sqrt(np.maximum((radius - still) * (radius + still), 0.0))
    ends = np.exp(-0.5 * ((chord - bias) / rms) ** 2) + np.exp(-0.5 * ((chord + bias) / rms) ** 2)
    # density of the angle at either end times the mean outward speed
    return np.asarray(np.where(radius > still, ends * velocity[moving] / (2.0 * math.pi * rms), 0.0))


def fades(
    jitter: Jitter, velocity_rms_rad_s: tuple[float, float], half_angle_rad: ArrayLike, margin_db: ArrayLike
) -> Fades:
    """Rate, length and share of the fades by more than a margin below the power on axis.

    A velocity rms from a spectrum that ends too early makes the fades too few and too long: see
    `SpectralMotion.warning`.

    Args:
        jitter: Bias and rms of the pointing error about each axis, in rad.
        velocity_rms_rad_s: Rms velocity of each axis, in rad/s.
        half_angle_rad: Half angle of the beam at 1/e2, in rad; broadcast against the margin.
        margin_db: Fade margin, in dB, at least 0.

    Raises:
        ValueError: As `level_crossing_rate_hz` and `outage_probability`.
    """
    rate = level_crossing_rate_hz(jitter, velocity_rms_rad_s, radius_of_loss_rad(half_angle_rad, margin_db))
    share = outage_probability(jitter, half_angle_rad, margin_db)
    never = np.where(share > 0.0, math.inf, 0.0)
    return Fades(rate, np.divide(share, rate, out=never, where=rate > 0.0), share)


@dataclass(frozen=True, slots=True)
class MovingEnd:
    """One end of a link: its jitter, the rms velocity of its axes (rad/s), and the half angle at 1/e2 of its beam."""

    jitter: Jitter
    velocity_rms_rad_s: tuple[float, float]
    half_angle_rad: float

    @property
    def moved(self) -> "MovingEnd":
        """The end with an axis that stands still moving by a hundredth of the other, which has both be one case."""
        rms, speed = self.jitter.rms_rad, self.velocity_rms_rad_s
        rms = (max(rms[0], _STILL * rms[1]), max(rms[1], _STILL * rms[0]))
        speed = (max(speed[0], _STILL * speed[1]), max(speed[1], _STILL * speed[0]))
        return MovingEnd(Jitter(self.jitter.bias_rad, rms), speed, self.half_angle_rad)


def fades_of_both(sent: MovingEnd, received: MovingEnd, margin_db: float) -> Fades:
    """Rate, length and share of the fades where two independent ends together lose more than a margin.

    Given the error of the receiver, the transmitter may lose what is left: its circle is crossed with the speed of both
    losses (Rice 1944, for four axes). An axis that stands still counts as moving by a hundredth of the other.

    Args:
        sent: The transmitter, whose errors have a distribution.
        received: The receiver, whose errors have a distribution.
        margin_db: Fade margin, in dB, above 0.
    """
    # the end whose errors are the smaller ones against its beam is looked at circle by circle
    inner, outer = sorted((sent.moved, received.moved), key=lambda end: max(end.jitter.rms_rad) / end.half_angle_rad)
    farthest, widest = (float(radius_of_loss_rad(end.half_angle_rad, margin_db)) for end in (inner, outer))
    static, reach = inner.jitter.static_rad, _REACH * max(inner.jitter.rms_rad)
    first, last = (math.asin(min(max(at / farthest, 0.0), 1.0)) for at in (static - reach, static + reach))
    node, weight = np.polynomial.legendre.leggauss(_CIRCLES)
    turn, width = first + (last - first) * (node + 1.0) / 2.0, (last - first) / 2.0 * weight
    at, left = (
        farthest * np.sin(turn),
        widest * np.cos(turn),
    )  # circles of the one end, and what they leave to the other
    width = width * farthest * np.cos(turn)
    (fast, share), (other, other_share) = _speeds(outer, left), _speeds(inner, at)
    # by how much faster the other end has to move for the same change of loss
    ratio = np.tan(turn)[:, None, None] * outer.half_angle_rad / inner.half_angle_rad
    speed = np.sqrt(fast[:, :, None] + ratio**2 * other[:, None, :])
    rate = float(np.einsum("r,ri,rj,rij", width, share, other_share, speed)) / math.sqrt(2.0 * math.pi)
    lost = radial_survival(outer.jitter, left)
    faded = float(radial_survival(inner.jitter, farthest) + np.sum(width * np.sum(other_share, axis=1) * lost))
    never = math.inf if faded > 0.0 else 0.0
    return Fades(np.asarray(rate), np.asarray(faded / rate if rate > 0.0 else never), np.asarray(faded))


def _speeds(end: MovingEnd, radius: Floats) -> tuple[Floats, Floats]:
    """Outward variances (rad^2/s^2) round circles, and the density of each (1/rad); like directions together."""
    square_x, _, density = density_on_circle(end.jitter, radius)
    bins = np.minimum((square_x * _SECTORS).astype(int), _SECTORS - 1)
    along_x = (np.arange(_SECTORS) + 0.5) / _SECTORS
    together, exact = np.zeros((radius.size, _SECTORS)), np.zeros((radius.size, _SECTORS))
    rows = np.arange(radius.size)[:, None]
    np.add.at(together, (rows, bins), density)
    np.add.at(exact, (rows, bins), density * square_x)
    along_x = np.where(together > 0.0, exact / np.where(together > 0.0, together, 1.0), along_x)
    fast_x, fast_y = (each**2 for each in end.velocity_rms_rad_s)
    return along_x * fast_x + (1.0 - along_x) * fast_y, together


# ------------------------------------------------------------------------------------- power that the fluctuation costs
def mean_error_ratio(jitter: Jitter, half_angle_rad: float, extra_power_db: float, error_ratio: ErrorRatio) -> float:
    """Mean bit error ratio over the pointing error, at the received power 10^(extra / 10) h.

    Args:
        jitter: Bias and rms of the pointing error about each axis, in rad.
        half_angle_rad: Half angle of the beam at 1/e2, in rad.
        extra_power_db: Power added to the link, in dB.
        error_ratio: Bit error ratio for each received power, that on axis without extra power counted as 1.

    Raises:
        ValueError: When `error_ratio` does not give one ratio from 0 to 1 for each power, or one that grows with the
            power, and for a half angle not above 0.
    """
    power, share = _power_shares(jitter, half_angle_rad)
    return _mean_over(power, share, extra_power_db, error_ratio)


def _power_shares(jitter: Jitter, half_angle_rad: float) -> tuple[Floats, Floats]:
    """Transmissions, falling, and the share of time about each, in radial steps that are small against the jitter."""
    static, reach = jitter.static_rad, _REACH * max(jitter.rms_rad)
    if reach == 0.0:
        return transmission([static], half_angle_rad), np.ones(1)
    edges = np.linspace(max(static - reach, 0.0), static + reach, _RADII)
    share: Floats = -np.diff(radial_survival(jitter, edges))
    return transmission(0.5 * (edges[1:] + edges[:-1]), half_angle_rad), share


def _mean_over(power: Floats, share: Floats, extra_db: float, error_ratio: ErrorRatio) -> float:
    ratio = np.asarray(error_ratio(10.0 ** (extra_db / 10.0) * power), dtype=np.float64)
    if ratio.shape != power.shape or not np.all((ratio >= 0.0) & (ratio <= 1.0)):
        raise ValueError("the bit error ratio does not give one value from 0 to 1 for each power; correct the curve")
    if np.any(np.diff(ratio) < -1e-9 * ratio[:-1] - 1e-300):  # smaller ratios have lost their digits
        raise ValueError("the bit error ratio grows with the power; give a curve that falls")
    return float(np.sum(share * ratio))


def uncoded_penalty_db(jitter: Jitter, half_angle_rad: float, error_ratio: ErrorRatio) -> float:
    """Extra power in dB, above the power on axis, that brings the mean bit error ratio back to the target.

    For a link without code, or with code words so short that the power stands still over each, where the figure to keep
    is the bit error ratio over a long time.

    Args:
        jitter: Bias and rms of the pointing error about each axis, in rad.
        half_angle_rad: Half angle of the beam at 1/e2, in rad.
        error_ratio: Bit error ratio at constant power, behind the decoder if there is one, over the power relative to
            what the target needs without pointing error; its value at 1 is the target.

    Raises:
        NoPowerError: When `MOST_POWER_DB` do not reach the target.
        ValueError: When the target is not between 0 and 1, and as `mean_error_ratio`.
    """
    return penalty_db(*_power_shares(jitter, half_angle_rad), error_ratio)


def penalty_db(power: Floats, share: Floats, error_ratio: ErrorRatio) -> float:
    """Extra power in dB that brings the mean bit error ratio over fluctuating power back to the target.

    Args:
        power: Received powers over that without pointing error, falling.
        share: The share of the time of each.
        error_ratio: As for `uncoded_penalty_db`.

    Raises:
        NoPowerError: As `uncoded_penalty_db`.
        ValueError: As `uncoded_penalty_db`.
    """
    target = _mean_over(np.ones(1), np.ones(1), 0.0, error_ratio)
    if not 0.0 < target < 1.0:
        raise ValueError(f"the bit error ratio at power 1 is {target:g}; it is the target and must be between 0 and 1")

    def missed(extra_db: float) -> float:
        return math.log(max(_mean_over(power, share, extra_db, error_ratio), 1e-300) / target)

    if missed(0.0) <= 1e-12:  # nothing but rounding
        return 0.0
    if missed(MOST_POWER_DB) > 0.0:
        raise NoPowerError(
            f"the mean bit error ratio stays above {target:g} even with {MOST_POWER_DB:g} dB more power; "
            "widen the beam or reduce the jitter"
        )
    from scipy.optimize import brentq

    return float(brentq(missed, 0.0, MOST_POWER_DB, xtol=1e-9))
