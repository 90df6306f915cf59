"""What every receiver refuses, and the few numbers that they share."""

import math
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.core.units import format_quantity

SOURCE = "receiver and power as given"
LEAST_RATIO = 1e-18  # sums over Poisson counts are cut at about 1e-22
LEAST_COUNT = 1e-30  # stands for none, so that logarithms exist


def normal_deviate(ratio: float) -> float:
    """Q for which the normal tail is `ratio`."""
    return -NormalDist().inv_cdf(ratio)


def mark_and_space(extinction_ratio: float) -> tuple[float, float]:
    """Power of a mark and of a space over the average."""
    space = 2.0 / (extinction_ratio + 1.0)
    return 2.0 - space, space


def spontaneous_photons(noise_figure_db: float) -> float:
    """n_sp = F / 2 at high gain; "3 dB" is taken as 10 log10 2."""
    return max(float(10.0 ** (noise_figure_db / 10.0)) / 2.0, 1.0)


def checked_powers(power_w: ArrayLike) -> Floats:
    """The powers as an array; refuses one that is negative or not finite."""
    powers = np.asarray(power_w, dtype=np.float64)
    for power in powers[~((powers >= 0.0) & (powers < math.inf))].flat[:1]:
        require_zero_or_more("the received power", float(power), "W")
    return powers


def shown(value: float, unit: str) -> str:
    """A value with its unit for a message."""
    return format_quantity(value, unit).rstrip()


def require(holds: bool, what: str, value: float, unit: str, limit: str) -> None:
    """Refuse a value that does not hold: what it is, and its limit."""
    if not holds:
        raise ValueError(f"{what} is {shown(value, unit)}: {limit}")


def require_zero_or_more(what: str, value: float, unit: str, advice: str = "") -> None:
    """Refuse a value below zero or not finite."""
    zero = f"0 {unit}".rstrip()
    require(0.0 <= value < math.inf, what, value, unit, f"it must be finite and not below {zero}{advice}")


def require_above_zero(what: str, value: float, unit: str) -> None:
    """Refuse a value that is not above zero, or not finite."""
    require(0.0 < value < math.inf, what, value, unit, f"it must be finite and above 0 {unit}")


def require_efficiency(what: str, value: float) -> None:
    """Refuse an efficiency outside 0 to 1."""
    require(0.0 < value <= 1.0, what, value, "", "it must lie above 0, up to 1 (one count or electron for each photon)")


def require_extinction(ratio: float) -> None:
    """Refuse a mark that is no brighter than a space."""
    limit = "it is the power of a mark over that of a space, as a ratio and above 1 (inf: dark spaces)"
    require(ratio > 1.0, "the extinction ratio", ratio, "", limit)


def require_noise_figure(noise_figure_db: float) -> None:
    """Refuse an amplifier below the quantum limit."""
    limit = "it must be at least 3 dB, the quantum limit of an amplifier of both quadratures at high gain"
    require(3.0 <= noise_figure_db < math.inf, "the noise figure", noise_figure_db, "dB", limit)
