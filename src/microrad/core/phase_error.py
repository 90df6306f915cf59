"""What a residual phase error does to two and four phases: error ratios averaged over a Gaussian error.

A coherent receiver that is off by phi sees cos phi of a bit of two phases (BPSK). Of four (QPSK) each bit sees
cos phi - sin phi in place of 1, for the other quadrature mixes in with either sign alike. The error ratio at a phase is
a normal tail of the signal a over its noise; its mean over phi is that of Prabhu (1976, IEEE Trans. AES-12, 275), here
as an integral of positive terms, which keeps the digits of small ratios that his series loses. More signal does not
bring it below the share of the time in which the sign is the wrong one: the floor.
"""

from __future__ import annotations

import math
from functools import lru_cache
from statistics import NormalDist
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from microrad.core.arrays import Floats

LARGEST_RAD = 1.0
"""Phase error (rms, rad) beyond which no loop is locked."""

_FARTHEST = 13.0  # standard deviations; beyond them lie 1e-38
_NODES = 16  # of each panel
_FINEST_RAD = 1e-7  # of the panels at a change of sign
_CHUNK = 256
_BISECTIONS = 60


def bit_error_ratio(amplitude: Floats, rms_rad: float, quadratures: int) -> Floats:
    """Bit error ratio of two or four phases under a Gaussian phase error.

    Args:
        amplitude: Signal of a bit over the standard deviation of its noise where the phase is right, any shape.
        rms_rad: Phase error, rms, in rad, from 0 to `LARGEST_RAD`; 0 gives the tail of the normal law.
        quadratures: 1 for BPSK, 2 for QPSK.
    """
    import numpy as np
    from scipy.special import ndtr

    if rms_rad == 0.0:
        return np.asarray(ndtr(-np.asarray(amplitude)), dtype=np.float64)
    seen, weight = _seen(rms_rad, quadratures)
    flat = np.ravel(amplitude)
    means = [ndtr(-flat[i : i + _CHUNK, None] * seen) @ weight for i in range(0, flat.size, _CHUNK)]
    return np.concatenate([np.empty(0), *means]).reshape(np.shape(amplitude))


@lru_cache(maxsize=1024)
def amplitude_for(ratio: float, rms_rad: float, quadratures: int) -> float:
    """Amplitude, as in `bit_error_ratio`, at which the ratio comes out; infinite where none is enough.

    Args:
        ratio: Bit error ratio, above 0 and below 0.5.
        rms_rad: Phase error, rms, in rad.
        quadratures: 1 for BPSK, 2 for QPSK.
    """
    import numpy as np
    from scipy.optimize import brentq

    clean = -NormalDist().inv_cdf(ratio)
    if rms_rad == 0.0:
        return clean
    if floor(rms_rad, quadratures) >= ratio:
        return math.inf

    def excess(log_amplitude: float) -> float:
        amplitude = np.asarray(math.exp(log_amplitude))
        return math.log(float(bit_error_ratio(amplitude, rms_rad, quadratures)) / ratio)

    low = high = math.log(clean)
    while excess(high) > 0.0:
        low, high = high, high + 1.0
        if high > math.log(1.0 / _FINEST_RAD):
            return math.inf
    return math.exp(brentq(excess, low - 1e-6, high, xtol=1e-13))


def floor(rms_rad: float, quadratures: int) -> float:
    """Bit error ratio that is left at any power: the share of the time in which a bit is seen with the wrong sign.

    Args:
        rms_rad: Phase error, rms, in rad.
        quadratures: 1 for BPSK, 2 for QPSK.
    """
    if rms_rad == 0.0:
        return 0.0
    total = 0.0
    for start in _wrong_from(quadratures):
        low, high = start / rms_rad, (start + math.pi) / rms_rad
        total += (math.erfc(low / math.sqrt(2.0)) - math.erfc(high / math.sqrt(2.0))) / 2.0
    return total


def largest_rms_rad(ratio: float, quadratures: int) -> float:
    """Phase error (rms, rad) whose floor is a bit error ratio: at any larger one no power reaches the ratio.

    Args:
        ratio: Bit error ratio, above 0 and below 0.5.
        quadratures: 1 for BPSK, 2 for QPSK.
    """
    low, high = 0.0, LARGEST_RAD
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        low, high = (low, middle) if floor(middle, quadratures) >= ratio else (middle, high)
    return low


def _wrong_from(quadratures: int) -> tuple[float, ...]:
    """Phases above 0 at which half turns of the wrong sign begin, seen from 0 to both sides."""
    turns = tuple(2.0 * math.pi * k for k in range(3))
    if quadratures == 1:
        return tuple(math.pi / 2.0 + turn for turn in turns for _ in range(2))
    return tuple(first + turn for turn in turns for first in (math.pi / 4.0, 3.0 * math.pi / 4.0))


@lru_cache(maxsize=64)
def _seen(rms_rad: float, quadratures: int) -> tuple[Floats, Floats]:
    """What a bit sees of its amplitude at the nodes of a quadrature over the phase error, and their weights.

    Panels of one standard deviation, finer towards each change of sign, where the tail falls within 1 / amplitude.
    """
    import numpy as np

    end = _FARTHEST * rms_rad
    signs = np.arange(-8, 9) * math.pi + (math.pi / 2.0 if quadratures == 1 else math.pi / 4.0)
    fine = _FINEST_RAD * 2.0 ** np.arange(24)
    beside = signs[:, None] + np.concatenate([-fine, [0.0], fine])
    edges = np.concatenate([np.arange(-_FARTHEST, _FARTHEST + 1.0) * rms_rad, beside.ravel()])
    edges = np.unique(edges[np.abs(edges) <= end])
    x, w = np.polynomial.legendre.leggauss(_NODES)
    half = np.diff(edges)[:, None] / 2.0
    phase = ((edges[:-1] + edges[1:])[:, None] / 2.0 + half * x).ravel()
    density = np.exp(-((phase / rms_rad) ** 2) / 2.0) / (math.sqrt(2.0 * math.pi) * rms_rad)
    seen = np.cos(phase) if quadratures == 1 else math.sqrt(2.0) * np.cos(phase + math.pi / 4.0)
    return seen, (half * w).ravel() * density
