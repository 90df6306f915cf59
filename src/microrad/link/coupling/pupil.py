"""The field in the focus of a telescope: a pupil with its obscuration and low-order aberrations, by harmonics.

Angles are on the sky, from the telescope's axis. By reciprocity the light that a receiver takes from a plane wave off
its axis is the far field of what the receiver would send, so that one integral serves fibres and detectors.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Annotated

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.mission.fields import Bounded, Quantity, Share

_RADII, _STEP = 64, 32  # nodes along the radius of the aperture, more of them for a larger angle
_ANGLES = 64
_TAIL = 40.0  # of the exponent of a mode's field: nothing lies beyond
_LEAST_HARMONIC = 1e-10  # of the field: harmonics below it do not count
_TILTED = "a mode so far off the middle for its width takes no light to speak of, or is not resolved"
_CHUNK = 4096  # angles that the integral is held for at once

MOST_TILT = 8.0
"""Largest truncation times shift: a mode as wide as the aperture has lost all light there, and a narrow one that lies
further off the middle is not resolved around the aperture."""

MOST_WAVES = 0.5
"""Largest coefficient of an aberration, over the wavelength: light with more has no core to couple."""


@dataclass(frozen=True, slots=True)
class Aberrations(Bounded):
    """Low-order wavefront errors of a receiver, each the coefficient of a Zernike polynomial in metres.

    The polynomials are those of Noll (1976, J. Opt. Soc. Am. 66, 207), numbers 4, 6, 8 and 11, over the whole circle of
    the aperture: without obscuration each coefficient is the rms of its error. Astigmatism and coma
    lie along the axis x.

    Raises ValueError for a value that is not finite.
    """

    defocus_m: Annotated[float, Quantity("m")] = 0.0
    astigmatism_m: Annotated[float, Quantity("m")] = 0.0
    coma_m: Annotated[float, Quantity("m")] = 0.0
    spherical_m: Annotated[float, Quantity("m")] = 0.0

    @property
    def is_round(self) -> bool:
        """Whether the errors are the same in each direction."""
        return self.astigmatism_m == 0.0 and self.coma_m == 0.0

    def wavefront_m(self, rho: Floats, angle_rad: Floats) -> Floats:
        """Wavefront error (m) at places of the aperture.

        Args:
            rho: Radius over that of the aperture.
            angle_rad: Direction from the axis x (rad); broadcast against the radius.
        """
        square, along = rho**2, np.cos(angle_rad)
        return np.asarray(
            self.defocus_m * math.sqrt(3.0) * (2.0 * square - 1.0)
            + self.astigmatism_m * math.sqrt(6.0) * square * np.cos(2.0 * angle_rad)
            + self.coma_m * math.sqrt(8.0) * (3.0 * square - 2.0) * rho * along
            + self.spherical_m * math.sqrt(5.0) * (6.0 * square**2 - 6.0 * square + 1.0)
        )


PERFECT = Aberrations()


@dataclass(frozen=True, slots=True)
class Pupil(Bounded):
    """A round aperture with a central obscuration that receives a plane wave.

    ``truncation`` weighs the aperture by exp(-(a rho)^2), a Gaussian mode that is sent backwards; 0 is an even weight.
    ``shift`` is how far that Gaussian lies off the middle along x, over the radius of the aperture. ``stop`` is the
    diameter up to which light is taken, over that of the aperture.

    Raises ValueError for a value without meaning, a stop within the obscuration, a mode that is tilted out of the
    aperture, and more than half a wavelength of an aberration.
    """

    diameter_m: Annotated[float, Quantity("m", above=0.0)]
    wavelength_m: Annotated[float, Quantity("m", above=0.0)]
    obscuration: Annotated[float, Share("", least=0.0)] = 0.0
    aberrations: Aberrations = PERFECT
    truncation: Annotated[float, Quantity("", least=0.0)] = 0.0
    shift: Annotated[float, Quantity("", least=0.0)] = 0.0
    stop: Annotated[float, Quantity("", above=0.0, most=1.0)] = 1.0

    def __post_init__(self) -> None:
        """Raises ValueError if a value is out of range, or the stop lets no light pass."""
        Bounded.__post_init__(self)
        Quantity("", above=self.obscuration).check("the stop", self.stop, "the obscuration is as wide: no light passes")
        Quantity("", most=MOST_TILT).check("truncation times shift", self.truncation * self.shift, _TILTED)
        most = self.wavelength_m * MOST_WAVES
        for each in fields(self.aberrations):
            rule, value = Quantity("m", least=-most, most=most), getattr(self.aberrations, each.name)
            rule.check(each.name, value, "half a wavelength, beyond which the light has no core")

    @property
    def is_round(self) -> bool:
        """Whether the field falls off alike in each direction."""
        return self.aberrations.is_round and self.shift * self.truncation == 0.0

    @property
    def per_rad(self) -> float:
        """What an angle on the sky is multiplied with to be the argument of a Bessel function, pi D / lambda."""
        return math.pi * self.diameter_m / self.wavelength_m

    @property
    def open_area(self) -> float:
        """Area that is not obscured, over 2 pi times the square of the aperture's radius."""
        return (1.0 - self.obscuration**2) / 2.0

    def intensity(self, x: Floats) -> Floats:
        """Square of the field in the focus, over that of 2 pi times the square of the aperture's radius.

        Args:
            x: Angles off the axis, times ``per_rad``, shape (angles,).

        Returns:
            By direction psi from the axis x: the sum over n of the n-th row times cos(n psi); shape (rows, angles).
        """
        numbers, field = self._field(x)
        if self.is_round:
            return np.abs(field) ** 2
        angle = 2.0 * math.pi * np.arange(2 * _ANGLES) / (2 * _ANGLES)
        square = np.abs(field.T @ np.cos(np.multiply.outer(numbers, angle))) ** 2
        rows = np.fft.rfft(square, axis=1).real.T / angle.size
        rows[1:] *= 2.0
        counts = np.max(np.abs(rows), axis=1) > _LEAST_HARMONIC * np.max(rows[0])
        kept = 1 + int(np.max(np.flatnonzero(counts), initial=0))
        return np.asarray(rows[:kept])

    def _field(self, x: Floats) -> tuple[Floats, Complexes]:
        """Numbers m of the harmonics cos(m psi) of the field, and their values at each angle."""
        node, share = _gauss_legendre(_STEP * math.ceil((_RADII + 0.6 * float(np.max(x, initial=0.0))) / _STEP))
        width = (self._lit_to - self.obscuration) / 2.0
        rho = self.obscuration + width * (node + 1.0)
        numbers, light = self._light(rho)
        light = light * (width * share * rho)
        found = np.empty((numbers.size, x.size), dtype=np.complex128)
        for columns in np.array_split(np.arange(x.size), 1 + x.size // _CHUNK):
            bessel = _bessel(numbers, np.multiply.outer(x[columns], rho))
            found[:, columns] = [1j**m * (each @ own) for m, each, own in zip(numbers, bessel, light, strict=True)]
        return numbers, found

    @property
    def _lit_to(self) -> float:
        """Radius up to which there is light, over that of the aperture: a mode may be narrow in it."""
        if self.truncation == 0.0 or self.shift > 0.0:
            return self.stop
        return min(self.stop, math.sqrt(self.obscuration**2 + _TAIL / self.truncation**2))

    def _light(self, rho: Floats) -> tuple[Floats, Complexes]:
        """Harmonics cos(m phi) of the light in the aperture: their numbers, and their values at each radius."""
        angle = 2.0 * math.pi * np.arange(1 if self.is_round else _ANGLES) / _ANGLES
        phase = 2.0 * math.pi / self.wavelength_m * self.aberrations.wavefront_m(rho[:, None], angle)
        off = rho[:, None] ** 2 - 2.0 * self.shift * rho[:, None] * np.cos(angle) + self.shift**2
        # all of it is even in the angle from the axis x
        light = (
            np.fft.fft(np.exp(-(self.truncation**2) * off + 1j * phase), axis=1).T[: 1 + angle.size // 2] / angle.size
        )
        light[1:] *= 2.0
        strongest = np.max(np.abs(light))
        if strongest == 0.0:  # the mode lies within the obscuration, or beside the aperture
            return np.zeros(1), np.asarray(light[:1])
        kept = np.flatnonzero(np.max(np.abs(light), axis=1) > _LEAST_HARMONIC * strongest)
        return kept.astype(np.float64), np.asarray(light[kept])


def _bessel(numbers: Floats, x: Floats) -> Iterator[Floats]:
    """Bessel functions of rising integer orders; where that keeps all digits, each from the two before it."""
    from scipy.special import j0, j1, jv

    last = int(numbers[-1])
    small = x < 1.5 * last
    before, now = j0(x), j1(x) if last else x
    for order in range(last + 1):
        if order in numbers:
            yield before
        if order < last:
            before, now = now, 2.0 * (order + 1) / np.where(small, 1.0, x) * now - before
            now[small] = jv(order + 2, x[small])


@lru_cache(maxsize=16)
def _gauss_legendre(nodes: int) -> tuple[Floats, Floats]:
    node, weight = np.polynomial.legendre.leggauss(nodes)
    return node, weight
