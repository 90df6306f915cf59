"""What a fitted disturbance leaves of the recording that it was fitted to: is it white, and was it stationary."""

import math
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.loop.disturbance.discrete import noise_covariance
from microrad.loop.disturbance.records import Disturbance, psd

BY_CHANCE = 1e-3
"""Probability below which what is seen is no chance."""

WORTH_SAYING = 1.1
"""Ratio of the rms of two parts of a motion below which it counts as stationary, however sure the difference is."""

_LAGS = 20
_BLOCKS = 8


@dataclass(frozen=True, slots=True)
class Whiteness:
    """Ljung and Box's test of the one-step-ahead residual: its statistic over so many lags, and how often chance has it.

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
                f"the variance of {self.of} in {_BLOCKS} equal parts differs {self.ratio:.3g} times, and stationary "
                f"motion of this spectrum stays within {self.usual:.3g} times"
            )
        if self.growth_p < BY_CHANCE and max(self.growth, 1.0 / self.growth) > WORTH_SAYING**2:
            word = "grows" if self.growth > 1.0 else "falls"
            return f"the variance of {self.of} {word} {max(self.growth, 1.0 / self.growth):.3g} times over the recording"
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


def one_step_residual(disturbance: Disturbance, rest_rad: Floats, step_s: float) -> Floats:
    """What a motion has beside the prediction by its own past under a shaping filter (rad), but for its begin.

    The predictor is the stationary Kalman filter of the filter at the motion's steps, without measurement noise, as a
    cascade of second-order sections: its zeros are the filter's poles.

    Args:
        disturbance: The shaping filter; its lines are not used.
        rest_rad: The motion without lines (rad), shape (samples,).
        step_s: Between two samples (s).
    """
    from scipy.linalg import expm, solve_discrete_are
    from scipy.signal import sosfilt, zpk2sos

    A, C = np.asarray(expm(disturbance.A * step_s)), disturbance.C
    scale = math.sqrt(float(np.mean(rest_rad**2)))
    Q = noise_covariance(disturbance.A, disturbance.B / scale, step_s)
    P = np.asarray(solve_discrete_are(A.T, C.T, Q, np.zeros((1, 1))))
    gain = A @ P @ C.T / (C @ P @ C.T)
    sections = zpk2sos(np.linalg.eigvals(A), np.linalg.eigvals(A - gain @ C), 1.0)
    found = sosfilt(sections, rest_rad)
    return np.asarray(found[found.size // 50 :])


def whiteness(residual_rad: Floats, states: int) -> Whiteness:
    """Ljung and Box's test (Biometrika 65, 297, 1978) over twenty lags more than the filter has parameters.

    Args:
        residual_rad: One-step-ahead residual (rad), shape (samples,).
        states: States of the filter, each with two parameters.
    """
    from scipy.stats import chi2

    lags, count = _LAGS + 2 * states, residual_rad.size
    middle = residual_rad - np.mean(residual_rad)
    correlation = np.array([middle[k:] @ middle[: count - k] for k in range(1, lags + 1)]) / (middle @ middle)
    statistic = count * (count + 2.0) * float(np.sum(correlation**2 / (count - np.arange(1, lags + 1))))
    return Whiteness(lags, statistic, float(chi2.sf(statistic, _LAGS)), float(np.max(np.abs(correlation))))


def stationarity(disturbance: Disturbance, rest_rad: Floats, residual_rad: Floats, step_s: float) -> Stationarity:
    """Whether the variances of eight equal parts are those of a stationary motion.

    The mean square over a time T of Gaussian motion with the one-sided density S has the variance of a chi-square of
    2 T (integral of S)^2 / (integral of S^2) degrees of freedom, and of the one-step-ahead residual of its number of
    samples. The ratio of the largest to the smallest is Hartley's (Biometrika 37, 308, 1950).

    Args:
        disturbance: The shaping filter that was fitted; its lines are not used.
        rest_rad: The motion without lines (rad), shape (samples,).
        residual_rad: Its one-step-ahead residual (rad), shape (samples,).
        step_s: Between two samples (s).
    """
    length = rest_rad.size // _BLOCKS
    freq = np.append(0.0, np.geomspace(0.01 / (length * step_s), 0.5 / step_s, 4000))
    S = psd(disturbance, freq)
    freedom = 2.0 * length * step_s * float(np.trapezoid(S, freq)) ** 2 / float(np.trapezoid(S**2, freq))
    return Stationarity(
        _block_test("the motion", rest_rad, min(freedom, float(length))),
        _block_test("its fast part", residual_rad, float(residual_rad.size // _BLOCKS)),
    )


def _block_test(of: str, motion: Floats, freedom: float) -> BlockTest:
    from scipy.special import polygamma
    from scipy.stats import norm

    length = motion.size // _BLOCKS
    variances = np.mean(motion[: _BLOCKS * length].reshape(_BLOCKS, length) ** 2, axis=1)
    place = np.arange(_BLOCKS) - 0.5 * (_BLOCKS - 1)
    slope = float(place @ np.log(variances) / (place @ place))
    error = math.sqrt(float(polygamma(1, 0.5 * freedom)) / float(place @ place))
    ratio = float(np.max(variances) / np.min(variances))
    return BlockTest(
        of,
        ratio,
        _usual_ratio(freedom),
        _chance_of_ratio(ratio, freedom),
        math.exp(slope * (_BLOCKS - 1)),
        float(2.0 * norm.sf(abs(slope) / error)),
    )


def _chance_of_ratio(ratio: float, freedom: float) -> float:
    """Probability that the largest of eight independent chi-squares is so many times the smallest, or more."""
    from scipy.stats import chi2

    x = chi2.ppf(np.append(np.geomspace(1e-9, 1e-3, 200), np.linspace(1.1e-3, 1.0 - 1e-9, 4000)), freedom)
    inside = chi2.cdf(ratio * x, freedom) - chi2.cdf(x, freedom)
    below = _BLOCKS * float(np.trapezoid(chi2.pdf(x, freedom) * inside ** (_BLOCKS - 1), x))
    return min(max(1.0 - below, 0.0), 1.0)


def _usual_ratio(freedom: float) -> float:
    from scipy.optimize import brentq

    def beyond(logarithm: float) -> float:
        return _chance_of_ratio(math.exp(logarithm), freedom) - BY_CHANCE

    return math.exp(float(brentq(beyond, 1e-9, 60.0, xtol=1e-4)))
