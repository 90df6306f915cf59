"""How turbulence and wind lie over height."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.mission.fields import Bounded, Quantity

_EDGES_M = (0.0, 30.0, 100.0, 300.0, 1e3, 3e3, 6e3, 10e3, 15e3, 20e3, 30e3, 45e3, 70e3, 110e3)
"""Between these the nodes of an integral over height lie; above, the profile is 1e-28 of its largest value."""
_NODES = 24
_JET_FROM_M, _JET_TO_M = 5e3, 20e3


@dataclass(frozen=True, slots=True)
class HufnagelValley(Bounded):
    """Structure parameter Cn2 of the index of refraction over height.

    0.00594 (v / 27)^2 (1e-5 h)^10 exp(-h / 1000) + 2.7e-16 exp(-h / 1500) + A exp(-h / 100), h in m (Hufnagel 1974,
    Valley 1980; Andrews and Phillips 2005, chapter 12). A = 1.7e-14 and v = 21 m/s are "5/7": at 0.5 um r0 is 5 cm and
    the isoplanatic angle 7 urad. Heights are above the ground where ``ground_m`` is 0; else the layer of A lies on the
    ground and the others keep their height above the sea.

    Raises ValueError for a negative ground strength or wind, and a ground outside of -500 to 9000 m.
    """

    ground_strength: Annotated[float, Quantity("", least=0.0)] = 1.7e-14
    wind_rms_m_s: Annotated[float, Quantity("m/s", least=0.0, most=200.0)] = 21.0
    ground_m: Annotated[float, Quantity("m", least=-500.0, most=9000.0)] = 0.0

    def strength(self, height_m: ArrayLike) -> Floats:
        """Cn2 (m^(-2/3)) at heights above the ground (m)."""
        above = np.asarray(height_m, dtype=np.float64)
        sea = np.maximum(above + self.ground_m, 0.0)
        jet = 0.00594 * (self.wind_rms_m_s / 27.0) ** 2 * (1e-5 * sea) ** 10 * np.exp(-sea / 1000.0)
        free = 2.7e-16 * np.exp(-sea / 1500.0)
        return np.asarray(jet + free + self.ground_strength * np.exp(-above / 100.0))


@dataclass(frozen=True, slots=True)
class BuftonWind(Bounded):
    """Wind speed over height: ground + jet exp(-((h - peak) / width)^2) (Bufton 1973; Andrews and Phillips 2005).

    ``slew_rad_s`` is how fast the line of sight turns: the air then crosses it faster by that times the height.

    Raises ValueError for a negative speed or slew, and a width not above 0.
    """

    ground_m_s: Annotated[float, Quantity("m/s", least=0.0, most=200.0)] = 5.0
    jet_m_s: Annotated[float, Quantity("m/s", least=0.0, most=200.0)] = 30.0
    peak_m: Annotated[float, Quantity("m", least=0.0, most=30e3)] = 9400.0
    width_m: Annotated[float, Quantity("m", above=0.0, most=30e3)] = 4800.0
    slew_rad_s: Annotated[float, Quantity("rad/s", least=0.0, most=1.0)] = 0.0

    def speed_m_s(self, height_m: ArrayLike) -> Floats:
        """Speed (m/s) of the air across the line of sight at heights above the ground (m)."""
        height = np.asarray(height_m, dtype=np.float64)
        jet = self.jet_m_s * np.exp(-(((height - self.peak_m) / self.width_m) ** 2))
        return np.asarray(self.ground_m_s + jet + self.slew_rad_s * height)

    @property
    def rms_m_s(self) -> float:
        """Root mean square of the speed from 5 to 20 km, which is the wind v of the profile (m/s)."""
        height, weight = heights((_JET_FROM_M, _JET_TO_M))
        return math.sqrt(float(weight @ self.speed_m_s(height) ** 2) / (_JET_TO_M - _JET_FROM_M))


@lru_cache(maxsize=8)
def heights(edges_m: tuple[float, ...] = _EDGES_M) -> tuple[Floats, Floats]:
    """Nodes of an integral over height and their weights (m), by Gauss and Legendre between edges.

    Args:
        edges_m: Rising heights (m), from the first of which to the last it is integrated.
    """
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    low, high = np.array(edges_m[:-1])[:, None], np.array(edges_m[1:])[:, None]
    half = (high - low) / 2.0
    return (low + half * (node + 1.0)).ravel(), (half * weight).ravel()
