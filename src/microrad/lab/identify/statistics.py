"""What is said of estimates: covariance and correlation, the colour of residuals, how many digits are known."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from microrad.core.arrays import Floats


class Estimate:
    """Something that was estimated, with the covariance of its parameters."""

    covariance: Floats

    @property
    def standard_errors(self) -> Floats:
        """Standard errors of the parameters, in their order."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def correlation(self) -> Floats:
        """Correlation matrix of the parameters."""
        return correlation(self.covariance)


def colour_inflation(residuals: Sequence[Floats]) -> float:
    """Factor (1 for white noise) by which correlation between samples inflates the variance of an estimate.

    1 + 2 sum of autocorrelations, summed over pairs of lags until a pair turns negative (Geyer's initial positive
    sequence), the largest over the records.
    """
    return max(_inflation(residual) for residual in residuals)


def _inflation(residual: Floats) -> float:
    n = residual.size
    spectrum = np.abs(np.fft.rfft(residual - residual.mean(), 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[: 2 * (n // 4)]
    if correlation[0] <= 0:
        return 1.0
    pairs = (correlation / correlation[0]).reshape(-1, 2).sum(axis=1)
    negative = np.flatnonzero(pairs < 0)
    last = int(negative[0]) if negative.size else pairs.size
    return max(1.0, float(2 * pairs[:last].sum() - 1))


def may_be_chance(losses: Sequence[Floats], best: Sequence[Floats]) -> bool:
    """Whether the mean difference of squared residuals is below two of its standard errors, noise colour counted.

    F. X. Diebold and R. S. Mariano, Comparing predictive accuracy, J. Business & Economic Statistics 13 (1995) 253.

    Args:
        losses: Squared residuals of a model, for each recording.
        best: Those of the model with the lowest mean, on the same samples.
    """
    differences = [a - b for a, b in zip(losses, best, strict=True)]
    difference = np.concatenate(differences)
    if not difference.any():
        return True
    colour = colour_inflation(differences)
    return float(difference.mean()) <= 2 * math.sqrt(colour * float(difference.var()) / difference.size)


def correlation(covariance: Floats) -> Floats:
    """Correlation matrix of a covariance: nothing for what does not vary, and 1 at most in spite of rounding."""
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0)) + 1e-150
    with np.errstate(over="ignore"):
        return np.asarray(np.clip(covariance / np.outer(deviation, deviation), -1.0, 1.0))


def central_differences(quantity: Callable[[Floats], np.ndarray], at: Floats, steps: Floats) -> np.ndarray:
    """Derivative of a quantity by each parameter, along the last axis.

    Args:
        quantity: What is computed from the parameters, any shape.
        at: The parameters.
        steps: Step of each, to either side.
    """
    columns = [(quantity(at + move) - quantity(at - move)) / (2 * move.sum()) for move in np.diag(steps)]
    return np.stack(columns, axis=-1)


def propagated(quantity: Callable[[Floats], Floats], values: Floats, covariance: Floats) -> Floats:
    """Standard errors of what is computed from estimates, to first order.

    Args:
        quantity: What is computed, shape (quantities,).
        values: The estimates.
        covariance: Their covariance.
    """
    steps = np.maximum(1e-4 * np.sqrt(np.diag(covariance)), 1e-9 * np.abs(values))
    jacobian = central_differences(quantity, values, np.where(steps > 0.0, steps, 1e-12))
    return np.asarray(np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian), 0.0)))


def percent(residual: Floats, span_rad: float) -> tuple[float, float]:
    """Rms and peak of a residual in per cent of a peak-to-peak span.

    Args:
        residual: The residual, in rad, any shape.
        span_rad: The peak-to-peak span, in rad.
    """
    return 100 * float(np.sqrt(np.mean(residual**2))) / span_rad, 100 * float(np.max(np.abs(residual))) / span_rad


def rounded_to_error(value: float, standard_error: float) -> str:
    """A fitted value as it is printed: no digits beyond the two of its standard error, and five at most.

    Further digits would tell nothing and differ between processors. A value without error (nan or 0) has five digits.

    Args:
        value: The value, in any unit.
        standard_error: Its standard error, in the same unit.
    """
    if 0.0 < standard_error < math.inf:
        decimals = 1 - math.floor(math.log10(float(f"{standard_error:.2g}")))
        value = round(value, decimals) + 0.0  # no -0
    return f"{value:.5g}"
