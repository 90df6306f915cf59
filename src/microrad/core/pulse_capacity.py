"""Capacity of pulse-position modulation with Poisson counts and soft decisions, with and without background.

One of M slots holds a pulse: n counts on average beside b of background, the others b alone. A slot with k counts has
the likelihood ratio L = exp(-n) (1 + n/b)^k between both, and a symbol carries

    C = log2 M + E log2 L(pulse) - E log2 (sum of L over all M slots)

bits (Moision and Hamkins 2003, IPN Progress Report 42-154). The last mean is taken over M independent slots. By
ln x = integral of (exp(-t) - exp(-t x)) / t dt it becomes one integral over products of means over single slots. In
ln t the integrand is smooth, so equal steps leave an error far below the rounding.
"""

import math
from functools import lru_cache

import numpy as np

from microrad.core.arrays import Floats

_STEP = 0.25  # in ln t, and at most of ln L between neighbouring counts: the error is about exp(-pi^2 / step)
_ROUNDING = 1e-12
_NONE = 1e-16  # counts in a slot that are none
_TAIL = 45.0  # probabilities below exp(-45) are left out


def noiseless_bits(order: int, pulse_counts: float) -> float:
    """Capacity without background, (1 - exp(-n)) log2 M bits a symbol: an erasure channel (Massey 1981).

    Args:
        order: Slots M in a symbol.
        pulse_counts: Mean counts n of the pulse.
    """
    return -math.expm1(-pulse_counts) * math.log2(order)


def soft_bits(order: int, pulse_counts: float, background_counts: float) -> float:
    """Capacity in bits a symbol where the decoder sees the counts of every slot.

    Args:
        order: Slots M in a symbol, at least 2.
        pulse_counts: Mean counts n of the pulse, without background, at least 0.
        background_counts: Mean counts b of background and dark counts in each slot, at least 0.
    """
    n, b = pulse_counts, background_counts
    if n <= 0.0:
        return 0.0
    if b <= _NONE:
        return noiseless_bits(order, n)
    rise = math.log1p(n / b)
    level = (n + b) * rise - n  # E ln L in the pulse's slot
    return (math.log(order) + level - _mean_log_sum(order, n, b, rise)) / math.log(2.0)


@lru_cache(maxsize=4096)
def least_pulse_counts(order: int, share: float, background_counts: float) -> float:
    """Mean counts of the pulse at which the capacity is a share of log2 M: no code does with fewer.

    Args:
        order: Slots M in a symbol.
        share: Bits of information for each bit on the line, above 0 and below 1: the rate of a code.
        background_counts: Mean counts of background and dark counts in each slot.
    """
    from scipy.optimize import brentq

    bits = share * math.log2(order)
    low = -math.log1p(-share)
    if background_counts <= _NONE:
        return low
    high = 2.0 * low
    while soft_bits(order, high, background_counts) < bits:
        low, high = high, 2.0 * high
    return float(math.exp(brentq(_excess, math.log(low), math.log(high), (order, bits, background_counts), _ROUNDING)))


def _excess(log_counts: float, order: int, bits: float, background_counts: float) -> float:
    return soft_bits(order, math.exp(log_counts), background_counts) - bits


def _mean_log_sum(order: int, n: float, b: float, rise: float) -> float:
    """E ln of the sum of L over a symbol."""
    empty, lit = (_law(mean, n, b, rise) for mean in (b, n + b))
    counts = np.concatenate([empty[0], lit[0]])
    lowest, highest = float(counts.min()) * rise - n, float(counts.max()) * rise - n + math.log(order)
    log_t = np.arange(-highest - _TAIL, math.log(_TAIL) - min(lowest, 0.0) + _STEP, _STEP)
    missing = [_one_less(log_t, k * rise - n, p) for k, p in (empty, lit)]
    # an absent slot leaves 1; the pulse's own slot comes once
    product = np.exp((order - 1.0) * np.log1p(-np.minimum(missing[0], 1.0 - 1e-16))) * (1.0 - missing[1])
    return float(((np.exp(-np.exp(log_t)) - product) * _STEP).sum())


def _law(mean: float, n: float, b: float, rise: float) -> tuple[Floats, Floats]:
    """Counts of a Poisson law with their probabilities, in steps where many counts are alike."""
    from scipy.special import gammaln

    # Bernstein: beyond both ends with exp(-45)
    first, last = (
        mean - math.sqrt(2.0 * _TAIL * mean),
        mean + _TAIL / 3.0 + math.sqrt(_TAIL**2 / 9.0 + 2.0 * _TAIL * mean),
    )
    step = max(math.floor(min(math.sqrt(b) / 2.0, _STEP / rise)), 1.0)
    k = np.arange(max(math.floor(first), 0.0), math.ceil(last) + step, step)
    p = np.exp(k * math.log(mean) - mean - gammaln(k + 1.0))
    return k, p / p.sum()


def _one_less(log_t: Floats, log_ratio: Floats, probability: Floats) -> Floats:
    """1 - E exp(-t L) for each t."""
    product = np.exp(np.minimum(log_t[:, None] + log_ratio[None, :], _TAIL))  # beyond, exp(-t L) is 0
    return np.asarray(-np.expm1(-product) @ probability, dtype=np.float64)
