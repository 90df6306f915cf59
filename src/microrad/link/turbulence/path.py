"""What turbulence does along the path between a ground station and a satellite.

The air is flat and Kolmogorov's spectrum has no inner and no outer scale; the beam is that of weak turbulence (Rytov).
With the spectrum 0.033 Cn2 kappa^(-11/3) all integrals over the spectrum are closed, and one over height is left.
"""

import math
from abc import ABC
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, get_args

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.link.gains import checked
from microrad.link.turbulence.fades import GammaGamma
from microrad.link.turbulence.profile import BuftonWind, HufnagelValley, heights
from microrad.mission.fields import Bounded, Quantity
from microrad.mission.tables.channel import Tilt, Wander

WEAK = 0.3
"""Rytov variance up to which turbulence is weak, and the closed forms of an index hold."""
LOWEST_RAD = math.radians(20.0)
"""Elevation down to which flat air and weak turbulence hold as a rule."""

_SPECTRUM = 0.033
_RYTOV = 4.0 * math.pi**2 * _SPECTRUM * 1.2 * math.gamma(1.0 / 6.0)  # |Gamma(-5/6)| is 6/5 Gamma(1/6)
_PHASE = 0.423  # of Fried's parameter, and ...
_ANGLE = 2.914  # ... of the isoplanatic angle
_GREENWOOD = 0.1022
_ZERNIKE, _GRADIENT = 0.18164, 0.16997  # of (lambda / D)^2 (D / r0)^(5/3), about one axis
_WANDER: dict[str, float] = {"dios-2004": 2.07, "itu-r-p1622": 2.08**2 / math.cbrt(2.0), "andrews-phillips-2005": 7.25}
_ACROSS = (1e-5, 60.0, 601)  # of the table of the angle of arrival: pi D f / v from, to, and how many


@dataclass(frozen=True, slots=True)
class SlantPath(Bounded):
    """A path through turbulence, from the ground up.

    Raises ValueError for a wavelength, elevation or range out of bounds.
    """

    profile: HufnagelValley
    wavelength_m: Annotated[float, Quantity("m", least=1e-7, most=1e-4)]
    elevation_rad: Annotated[
        float, Quantity("rad", least=math.radians(5.0), most=math.pi / 2.0), "lower air is not flat"
    ]
    range_m: Annotated[float, Quantity("m", least=1e5, most=1e12)]

    @property
    def wavenumber(self) -> float:
        """k = 2 pi / lambda (rad/m)."""
        return 2.0 * math.pi / self.wavelength_m

    def layers(self) -> tuple[Floats, Floats, Floats]:
        """Heights, distances from the station along the path (both m), and Cn2 times each layer's length (m^(1/3)).

        None lies beyond the satellite.
        """
        longer = 1.0 / math.sin(self.elevation_rad)
        height, weight = (each[heights()[0] * longer < self.range_m] for each in heights())
        return height, height * longer, self.profile.strength(height) * weight * longer

    def moment(self, power: float) -> float:
        """Integral of Cn2 z^power along the path, z from the station (m)."""
        _, distance, strength = self.layers()
        return float(strength @ distance**power)

    @property
    def fried_m(self) -> float:
        """Fried's parameter r0 of a plane wave (m): (0.423 k^2 times the integral of Cn2)^(-3/5) (Fried 1966)."""
        return math.pow(_PHASE * self.wavenumber**2 * self.moment(0.0), -0.6)

    @property
    def isoplanatic_rad(self) -> float:
        """Isoplanatic angle (rad): (2.914 k^2 times the integral of Cn2 z^(5/3))^(-3/5) (Fried 1982)."""
        return math.pow(_ANGLE * self.wavenumber**2 * self.moment(5.0 / 3.0), -0.6)

    @property
    def rytov(self) -> float:
        """Rytov variance of a plane wave from above: 2.25 k^(7/6) times the integral of Cn2 z^(5/6)."""
        return 2.25 * math.pow(self.wavenumber, 7.0 / 6.0) * self.moment(5.0 / 6.0)

    @property
    def spherical_rytov(self) -> float:
        """Rytov variance of a spherical wave from the ground, with z (1 - z / L) in place of z."""
        _, distance, strength = self.layers()
        between = distance * (1.0 - distance / self.range_m)
        return 2.25 * math.pow(self.wavenumber, 7.0 / 6.0) * float(strength @ between ** (5.0 / 6.0))

    def greenwood_hz(self, wind: BuftonWind) -> float:
        """Greenwood's frequency (Hz): (0.102 k^2 times the integral of Cn2 v^(5/3))^(3/5) (Greenwood 1977).

        Args:
            wind: Speed of the air across the path.
        """
        height, _, strength = self.layers()
        return float((_GREENWOOD * self.wavenumber**2 * (strength @ wind.speed_m_s(height) ** (5.0 / 3.0))) ** 0.6)

    @property
    def regimes(self) -> tuple[str, ...]:
        """Where the closed forms end on this path, in words; nothing where they hold."""
        said = []
        if self.rytov > WEAK:
            kind = "strong" if self.rytov > 1.0 else "moderate"
            said.append(
                f"{kind} turbulence: the Rytov variance is {self.rytov:.3g}, above {WEAK:g}; an index is that for any "
                "strength (Andrews and Phillips), but spread and wander are those of weak turbulence"
            )
        if self.elevation_rad < LOWEST_RAD:
            low, least = (f"{math.degrees(each):.3g} deg" for each in (self.elevation_rad, LOWEST_RAD))
            said.append(f"an elevation of {low}: below {least} the air is not flat, and refraction bends the path")
        return tuple(said)


@dataclass(frozen=True, slots=True)
class _OnPath(ABC):
    """Light on a path."""

    path: SlantPath

    def _closed(self, damping: Floats, phase: Floats) -> Floats:
        """Variance of the logarithm of the power that a layer of strength 1 makes.

        8.70 k^2 (Re (a + i b)^(5/6) - a^(5/6)) is 8 pi^2 k^2 times the integral of 0.033 kappa^(-8/3) exp(-a kappa^2)
        (1 - cos(b kappa^2)).
        """
        both = damping + 1j * phase
        return np.asarray(_RYTOV * self.path.wavenumber**2 * ((both ** (5.0 / 6.0)).real - damping ** (5.0 / 6.0)))


@dataclass(frozen=True, slots=True)
class Downlink(_OnPath):
    """Light from the satellite at the station: a plane wave above the air."""

    @property
    def at_point(self) -> GammaGamma:
        """Fades at a point, from weak to strong turbulence."""
        return GammaGamma.of_plane_wave(self.path.rytov)

    def variance(self, diameter_m: float) -> float:
        """Variance of the logarithm of the power in an aperture, by the theory of weak turbulence.

        The aperture is taken as Gaussian of the same area's filter, exp(-(kappa D)^2 / 16) (Andrews and Phillips 2005,
        chapter 12).

        Args:
            diameter_m: Diameter D (m), 0 for a point.

        Raises:
            ValueError: For a negative diameter.
        """
        Quantity("m", least=0.0).check("the aperture", diameter_m)
        _, distance, strength = self.path.layers()
        damping = np.full(distance.shape, diameter_m**2 / 16.0)
        return float(strength @ self._closed(damping, distance / self.path.wavenumber))

    def index(self, diameter_m: float) -> float:
        """Scintillation index of the power in an aperture, from weak to strong turbulence: `saturated` of its variance.

        Args:
            diameter_m: Diameter D (m), 0 for a point.

        Raises:
            ValueError: For a negative diameter.
        """
        return saturated(self.variance(diameter_m), 1.11)

    def arrival_rms_rad(self, diameter_m: float, tilt: Tilt = "zernike") -> float:
        """Angle of arrival in an aperture about one axis, rms (rad).

        0.182 (lambda / D)^2 (D / r0)^(5/3) for the plane that fits best (Noll 1976), 0.170 for the mean slope (Tyler
        1994).

        Args:
            diameter_m: Diameter D (m).
            tilt: Which angle.

        Raises:
            ValueError: For a diameter not above 0 and a tilt of none.
        """
        _known("tilt", tilt, get_args(Tilt))
        Quantity("m", above=0.0).check("the aperture", diameter_m)
        factor = _ZERNIKE if tilt == "zernike" else _GRADIENT
        over_r0 = math.pow(diameter_m / self.path.fried_m, 5.0 / 6.0)
        return math.sqrt(factor) * self.path.wavelength_m / diameter_m * over_r0

    def arrival_psd_rad2_hz(
        self, freq_hz: ArrayLike, diameter_m: float, wind: BuftonWind, tilt: Tilt = "zernike"
    ) -> Floats:
        """One-sided spectral density of the angle of arrival about one axis (rad^2/Hz), the mean of both axes.

        Air that does not change is carried past (Taylor). Of a layer with the speed v it is 4 pi^2 0.033 (D / 2)^(2/3)
        / v times the integral over y of (x^2 + y^2)^(-5/6) times the aperture's filter at sqrt(x^2 + y^2), x = pi f D /
        v: the filter is (8 J2(x) / x^2)^2 for the plane that fits best, (2 J1(x) / x)^2 for the mean slope.

        Args:
            freq_hz: Frequencies f (Hz), above 0, any shape.
            diameter_m: Diameter D (m).
            wind: Speed of the air across the path.
            tilt: Which angle.

        Raises:
            ValueError: For a frequency or diameter not above 0, a tilt of none, and air at rest.
        """
        _known("tilt", tilt, get_args(Tilt))
        Quantity("m", above=0.0).check("the aperture", diameter_m)
        freq = checked("the frequency", freq_hz, Quantity("Hz", above=0.0))
        height, _, strength = self.path.layers()
        speed = wind.speed_m_s(height)
        Quantity("m/s", above=0.0).check("the slowest wind", float(np.min(speed)), "air at rest has no spectrum")
        across = _across(math.pi * diameter_m * np.multiply.outer(freq, 1.0 / speed), tilt)
        factor = 4.0 * math.pi**2 * _SPECTRUM * (diameter_m / 2.0) ** (2.0 / 3.0)
        return np.asarray(factor * (across @ (strength / speed)))


@dataclass(frozen=True, slots=True)
class Uplink(_OnPath, Bounded):
    """A Gaussian beam from the station, collimated at its waist.

    ``waist_m`` is its radius there at 1/e2 of intensity.

    Raises ValueError for a waist not above 0.
    """

    waist_m: Annotated[float, Quantity("m", above=0.0, most=100.0)]

    @property
    def _fresnel(self) -> float:
        """Lambda_0 = 2 L / (k W0^2)."""
        return 2.0 * self.path.range_m / (self.path.wavenumber * self.waist_m**2)

    @property
    def radius_m(self) -> float:
        """Radius of the beam at the satellite without turbulence, at 1/e2 of intensity (m)."""
        return self.waist_m * math.hypot(1.0, self._fresnel)

    @property
    def spread_db(self) -> float:
        """Loss of the mean power on the axis by the spread of the beam (dB): 12 lg(1 + (D0 / r0)^(5/3)), D0^2 = 8 W0^2.

        Andrews and Phillips 2005, chapter 12; wander is part of it. It holds for beams that the air can carry as a
        whole.
        """
        widened = (math.sqrt(8.0) * self.waist_m / self.path.fried_m) ** (5.0 / 3.0)
        return 12.0 * math.log10(1.0 + widened)

    def index(self) -> float:
        """Scintillation index on the axis, from weak to strong turbulence: `saturated` of its variance."""
        return saturated(self.variance(), 0.56 * (1.0 + 1.0 / (1.0 + self._fresnel**2)))

    def variance(self, off_axis: float = 0.0) -> float:
        """Variance of the logarithm of the intensity at the satellite in weak turbulence, of a beam without wander.

        With Lambda and Theta of the beam at the satellite and xi = 1 - z / L the exponents are a = Lambda L xi^2 / k
        and b = L xi (1 - (1 - Theta) xi) / k; off the axis by r the index grows by 8.70 k^2 times the integral of Cn2
        a^(5/6) (1 - 1F1(-5/6; 1; 2 r^2 / W^2)) (Andrews and Phillips 2005, chapter 12).

        Args:
            off_axis: How far the satellite is off the axis, over the beam's radius there.

        Raises:
            ValueError: For a negative distance.
        """
        from scipy.special import hyp1f1

        Quantity("", least=0.0).check("the distance off the axis", off_axis)
        _, distance, strength = self.path.layers()
        k, length, fresnel = self.path.wavenumber, self.path.range_m, self._fresnel
        theta, width = 1.0 / (1.0 + fresnel**2), fresnel / (1.0 + fresnel**2)
        left = 1.0 - distance / length
        damping = width * length * left**2 / k
        # 1 - (1 - theta) xi, with its digits where theta is nearly 0
        variance = strength @ self._closed(damping, length * left * (distance / length + theta * left) / k)
        more = (
            _RYTOV
            * k**2
            * float(strength @ damping ** (5.0 / 6.0))
            * (1.0 - hyp1f1(-5.0 / 6.0, 1.0, 2.0 * off_axis**2))
        )
        return float(variance + more)

    def wander_rms_rad(self, convention: Wander) -> float:
        """How far the beam's middle wanders, radial rms angle as seen from the station (rad).

        Its square is c times the integral of Cn2 (1 - z / L)^2 W(z)^(-1/3), W the beam's radius without turbulence: c
        is 2.07 (Dios et al. 2004, Appl. Opt. 43, 3866), 2.08^2 2^(-1/3) (ITU-R P.1622, of the diameter 2 W) or 7.25
        (Andrews and Phillips 2005, chapter 12).

        Args:
            convention: Which constant.

        Raises:
            ValueError: For a convention of none.
        """
        _known("convention", convention, get_args(Wander))
        _, distance, strength = self.path.layers()
        radius = self.waist_m * np.hypot(1.0, self._fresnel * distance / self.path.range_m)
        left = 1.0 - distance / self.path.range_m
        return math.sqrt(_WANDER[convention] * float(strength @ (left**2 * radius ** (-1.0 / 3.0))))

    def anisoplanatic_rad2(self, point_ahead_rad: float) -> float:
        """Phase variance (rad^2) against light that came from so far beside: (angle / isoplanatic angle)^(5/3).

        Args:
            point_ahead_rad: The angle (rad).

        Raises:
            ValueError: For a negative angle.
        """
        Quantity("rad", least=0.0).check("the point-ahead angle", point_ahead_rad)
        return float((point_ahead_rad / self.path.isoplanatic_rad) ** (5.0 / 3.0))


def saturated(variance: float, large: float) -> float:
    """Scintillation index from weak to strong turbulence, of the variance that the theory of weak turbulence has.

    exp(0.49 s / (1 + c s^(6/5))^(7/6) + 0.51 s / (1 + 0.69 s^(6/5))^(5/6)) - 1, s the variance (Andrews and Phillips
    2005, chapter 12): it is s where turbulence is weak, and falls towards 1 where it is strong.

    Args:
        variance: The variance s.
        large: The constant c of the large scales: 1.11 of a plane wave, 0.56 (1 + Theta) of an uplink.
    """
    root = math.pow(variance, 1.2)
    of_large = 0.49 * variance / math.pow(1.0 + large * root, 7.0 / 6.0)
    return math.expm1(of_large + 0.51 * variance / math.pow(1.0 + 0.69 * root, 5.0 / 6.0))


def _known(what: str, name: str, names: tuple[str, ...]) -> None:
    if name not in names:
        raise ValueError(f'the {what} "{name}" is none of {", ".join(names)}')


def _across(x: Floats, tilt: Tilt) -> Floats:
    """The integral over the other direction in the spectrum of the angle of arrival, at x = pi f D / v.

    Far out the square of the Bessel function is 1 / (pi x) on average; near 0 it goes as x^(-2/3).
    """
    from scipy.special import gamma

    known, table = _arrival_table(tilt)
    log = np.log(x)
    near = table[0] - 2.0 / 3.0 * (log - known[0])
    factor, falls = (64.0, 20.0 / 3.0) if tilt == "zernike" else (4.0, 14.0 / 3.0)
    tail = factor / math.pi * math.sqrt(math.pi) * gamma(falls / 2.0 - 0.5) / gamma(falls / 2.0)
    far = math.log(tail) - (falls - 1.0) * log
    middle = np.interp(log, known, table)
    return np.asarray(np.exp(np.where(log < known[0], near, np.where(log > known[-1], far, middle))))


@lru_cache(maxsize=2)
def _arrival_table(tilt: Tilt) -> tuple[Floats, Floats]:
    """Logarithms of x and of that integral."""
    from scipy.special import jv

    low, high, count = _ACROSS
    x, y = np.geomspace(low, high, count), np.geomspace(1e-2 * low, 20.0 * high, 4000)
    radius = np.hypot.outer(x, y)
    filtered = (8.0 * jv(2, radius) / radius**2) ** 2 if tilt == "zernike" else (2.0 * jv(1, radius) / radius) ** 2
    return np.log(x), np.log(2.0 * np.trapezoid(radius ** (-5.0 / 3.0) * filtered * y, np.log(y), axis=1))
