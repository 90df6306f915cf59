"""What a fitted disturbance leaves of the recording that it was fitted to: is it white, and was it stationary."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.units import plain

BY_CHANCE = 1e-3
"""Probability below which what is seen is no chance."""

WORTH_SAYING = 1.1
"""Ratio of the rms of two parts of a motion below which it counts as stationary, however sure the difference is."""

_LAGS = 20
_BLOCKS = 8
_ENDS = 50


@dataclass(frozen=True, slots=True)
class Whiteness:
    """Ljung and Box's test of the one-step-ahead residual: statistic over so many lags, and how often chance has it.

    ``largest`` is the largest autocorrelation among them, which says how much a small probability matters.
    """

    lags: int
    statistic: float
    p_value: float
    largest: float

    @property
    def white(self) -> bool:
        """Whether chance may have it."""
        return self.p_value >= BY_CHANCE


@dataclass(frozen=True, slots=True)
class BlockTest:
    """Variances of equal parts of a motion, ``of`` which kind, against what a stationary one of its spectrum has.

    ``ratio`` of the largest to the smallest, ``usual`` the ratio that chance exceeds once in a thousand, and
    ``growth`` the ratio of the last to the first on a trend through their logarithms; both with the probability that
    chance has as much.
    """

    of: str
    ratio: float
    usual: float
    ratio_p: float
    growth: float
    growth_p: float

    @property
    def verdict(self) -> str:
        """Why the motion is not stationary, "" where it is."""
        if self.ratio_p < BY_CHANCE and self.ratio > WORTH_SAYING**2:
            return (
                f"the variance of {self.of} in {_BLOCKS} equal parts differs {plain(self.ratio)} times, and stationary "
                f"motion of this spectrum stays within {plain(self.usual)} times"
            )
        if self.growth_p < BY_CHANCE and max(self.growth, 1.0 / self.growth) > WORTH_SAYING**2:
            word, times = ("grows", self.growth) if self.growth > 1.0 else ("falls", 1.0 / self.growth)
            return f"the variance of {self.of} {word} {plain(times)} times over the recording"
        return ""


@dataclass(frozen=True, slots=True)
class Stationarity:
    """The two tests: of the motion without lines, mean and drift, and of its fast part, the one-step-ahead residual."""

    motion: BlockTest
    fast: BlockTest

    @property
    def reason(self) -> str:
        """Why the motion is not stationary, "" where it is."""
        return self.fast.verdict or self.motion.verdict

    @property
    def stationary(self) -> bool:
        """Whether nothing speaks against it."""
        return not self.reason


def correlation_s(rest_rad: Floats, step_s: float) -> float:
    """First time (s) at which the autocorrelation of a motion without mean is below 1/e.

    Args:
        rest_rad: The motion (rad), shape (samples,).
        step_s: Between two samples (s).
    """
    from scipy.fft import irfft, next_fast_len, rfft

    length = next_fast_len(2 * rest_rad.size)
    found = irfft(np.abs(rfft(rest_rad, length)) ** 2, length)[: rest_rad.size]
    return float(np.argmax(found < found[0] / math.e)) * step_s


def one_step_residual(density_rad2_hz: Floats, rest_rad: Floats, step_s: float) -> Floats:
    """What a motion has beside the prediction by its own past under a spectrum, over its standard error.

    The motion is band-limited to the frequencies of the spectrum and sampled at twice the last of them. Its predictor's
    error is the motion behind the inverse of the spectrum's minimum-phase factor, which follows from the cepstrum
    (A. V. Oppenheim and R. W. Schafer, Discrete-Time Signal Processing, ch. 13). A fiftieth at each end is left out.

    Args:
        density_rad2_hz: One-sided density at the first frequencies of the motion's transform, shape (frequencies,).
        rest_rad: The motion without lines, mean and drift (rad), shape (samples,).
        step_s: Between two samples (s).
    """
    from scipy.fft import irfft, rfft
    from scipy.signal.windows import tukey

    last = density_rad2_hz.size - 1
    samples = 2 * last
    cepstrum = irfft(0.5 * np.log(density_rad2_hz), samples)
    cepstrum[1:last] *= 2.0
    cepstrum[last + 1 :] = 0.0
    factor = np.exp(rfft(cepstrum))
    moved = rfft(rest_rad * tukey(rest_rad.size, 2.0 / _ENDS))[: last + 1] / factor
    moved[last] = moved[last].real
    found = irfft(moved, samples) * math.sqrt(2.0 * step_s * samples / rest_rad.size)
    return np.asarray(found[samples // _ENDS : samples - samples // _ENDS])


def whiteness(residual: Floats, states: int) -> Whiteness:
    """Ljung and Box's test (Biometrika 65, 297, 1978) over twenty lags more than the filter has parameters.

    Args:
        residual: One-step-ahead residual, shape (samples,).
        states: States of the filter, each with two parameters.
    """
    from scipy.stats import chi2

    lags, count = _LAGS + 2 * states, residual.size
    middle = residual - np.mean(residual)
    correlation = np.array([middle[k:] @ middle[: count - k] for k in range(1, lags + 1)]) / (middle @ middle)
    statistic = count * (count + 2.0) * float(np.sum(correlation**2 / (count - np.arange(1, lags + 1))))
    return Whiteness(lags, statistic, float(chi2.sf(statistic, _LAGS)), float(np.max(np.abs(correlation))))


def stationarity(density_rad2_hz: Floats, rest_rad: Floats, residual: Floats) -> Stationarity:
    """Whether the variances of eight equal parts are those of a stationary motion.

    The mean square over a time T of Gaussian motion with the one-sided density S has the variance of a chi-square of
    2 T (integral of S)^2 / (integral of S^2) degrees of freedom; of the one-step-ahead residual S is its periodogram,
    whose square is twice as large by chance, so that white residuals have one for each sample. The ratio of the largest
    to the smallest is Hartley's (Biometrika 37, 308, 1950).

    Args:
        density_rad2_hz: The density that was fitted, at the first frequencies of the motion's transform, from 0 on.
        rest_rad: The motion without lines, mean and drift (rad), shape (samples,).
        residual: Its one-step-ahead residual, shape (samples,).
    """
    from scipy.fft import rfft

    slow, fast = density_rad2_hz, np.abs(rfft(residual)) ** 2
    of_motion, of_residual = (float(np.sum(S)) ** 2 / float(S @ S) * 2.0 / _BLOCKS for S in (slow, fast))
    return Stationarity(
        _block_test("the motion", rest_rad, of_motion), _block_test("its fast part", residual, 2.0 * of_residual)
    )


def _block_test(of: str, motion: Floats, freedom: float) -> BlockTest:
    from scipy.special import polygamma
    from scipy.stats import norm

    length = motion.size // _BLOCKS
    variances = np.mean(motion[: _BLOCKS * length].reshape(_BLOCKS, length) ** 2, axis=1)
    place = np.arange(_BLOCKS) - 0.5 * (_BLOCKS - 1)
    slope = float(place @ np.log(variances) / (place @ place))
    error = math.sqrt(float(polygamma(1, 0.5 * freedom)) / float(place @ place))
    ratio, chance_of = float(np.max(variances) / np.min(variances)), _chance_of_ratio(freedom)
    return BlockTest(
        of,
        ratio,
        _usual(chance_of),
        chance_of(ratio),
        math.exp(slope * (_BLOCKS - 1)),
        float(2.0 * norm.sf(abs(slope) / error)),
    )


def _chance_of_ratio(freedom: float) -> Callable[[float], float]:
    """Probability that the largest of eight independent chi-squares is so many times the smallest, or more."""
    from scipy.stats import chi2

    x = chi2.ppf(np.append(np.geomspace(1e-9, 1e-3, 200), np.linspace(1.1e-3, 1.0 - 1e-9, 4000)), freedom)
    density, below_x = chi2.pdf(x, freedom), chi2.cdf(x, freedom)

    def chance(ratio: float) -> float:
        inside = chi2.cdf(ratio * x, freedom) - below_x
        below = _BLOCKS * float(np.trapezoid(density * inside ** (_BLOCKS - 1), x))
        return min(max(1.0 - below, 0.0), 1.0)

    return chance


def _usual(chance_of: Callable[[float], float]) -> float:
    from scipy.optimize import brentq

    def beyond(logarithm: float) -> float:
        return chance_of(math.exp(logarithm)) - BY_CHANCE

    return math.exp(float(brentq(beyond, 1e-9, 60.0, xtol=1e-4)))
