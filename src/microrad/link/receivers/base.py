"""What every receiver of a laser link has: bit error ratio from optical power, and the power that a data rate needs.

Light beside the signal, which a filter and a field of view let through of a sky, stands here, too.

Powers are averages over marks and spaces (or slots) at the detector; rates are information bits per second.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from statistics import NormalDist
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from microrad.core import capacity
from microrad.core.arrays import Floats
from microrad.core.budget import Line
from microrad.core.units import PLANCK_J_S, SPEED_OF_LIGHT_M_S, format_limit, format_quantity
from microrad.link.gains import checked, photon_energy_j
from microrad.mission.fields import Bounded, Quantity, Share

SOURCE = "receiver and power as given"
LEAST_RATIO = 1e-18  # sums over Poisson counts are cut at about 1e-22
LEAST_COUNT = 1e-30  # stands for none, so that logarithms exist


Efficiency = Annotated[float, Quantity("", above=0.0, most=1.0), "one count or electron for each photon at the most"]
_POWER = Quantity("W", least=0.0)
Power = Annotated[float, _POWER]
PerMode = Annotated[float, Quantity("photon", least=0.0)]
Extinction = Annotated[float, Quantity("", above=1.0), "the power of a mark over that of a space (inf: dark spaces)"]
NoiseFigure = Annotated[
    float,
    Quantity("dB", least=3.0),
    "3 dB is the quantum limit of an amplifier of both quadratures at high gain",
]
_GAIN, _RATIO = Quantity("", least=1.0), Quantity("", least=0.0, most=1.0)
_INVERSE = "take the inverse when the other carrier starts the avalanche"
AvalancheGain = Annotated[float, _GAIN]
IonisationRatio = Annotated[float, _RATIO, _INVERSE]
_RADIANCE = Quantity("W/(m^2 sr m)", least=0.0)


def normal_deviate(ratio: float) -> float:
    """The number Q of standard deviations beyond which the tail of a normal distribution is `ratio`."""
    return -NormalDist().inv_cdf(ratio)


def mark_and_space(extinction_ratio: float) -> tuple[float, float]:
    """Power of a mark and of a space over the average."""
    space = 2.0 / (extinction_ratio + 1.0)
    return 2.0 - space, space


def spontaneous_photons(noise_figure_db: float) -> float:
    """Spontaneous-emission factor n_sp = F / 2 of an amplifier at high gain; "3 dB" is taken as 10 log10 2."""
    return max(float(10.0 ** (noise_figure_db / 10.0)) / 2.0, 1.0)


def background_power_w(
    spectral_radiance_w_m2_sr_m: float, aperture_area_m2: float, field_of_view_rad: float, filter_bandwidth_m: float
) -> float:
    """Power in W that a uniform sky sends through aperture, field stop and filter, both polarisations, before any loss.

    It is L A pi sin^2(field/2) d. 1 W/(m^2 sr um) is 1e6 W/(m^2 sr m).

    Args:
        spectral_radiance_w_m2_sr_m: Radiance L of the sky per metre of wavelength, in W/(m^2 sr m).
        aperture_area_m2: Area A of the aperture, in m^2.
        field_of_view_rad: Full angle of the round field of view, in rad, filled by the sky.
        filter_bandwidth_m: Full width d of the filter in wavelength, in m.

    Raises:
        ValueError: For a negative value and a field of more than pi rad.
    """
    _RADIANCE.check("the spectral radiance", spectral_radiance_w_m2_sr_m)
    Quantity("m^2", least=0.0).check("the aperture's area", aperture_area_m2)
    Quantity("m", least=0.0).check("the filter's bandwidth", filter_bandwidth_m)
    full = Quantity("rad", least=0.0, most=math.pi)
    full.check("the field of view", field_of_view_rad, "it is the full angle, up to pi rad (a half space)")
    projected_solid_angle_sr = math.pi * math.sin(field_of_view_rad / 2.0) ** 2
    return spectral_radiance_w_m2_sr_m * aperture_area_m2 * projected_solid_angle_sr * filter_bandwidth_m


def background_photons_per_mode(spectral_radiance_w_m2_sr_m: float, wavelength_m: float) -> float:
    """Mean photons in one spatial mode and one polarisation, L lambda^5 / (2 h c^2), of an unpolarised sky.

    What a single-mode receiver takes from a source that fills its mode, before any loss: about 1e-6 from a bright sky
    at 1.55 um, 0.25 from the sun.

    Args:
        spectral_radiance_w_m2_sr_m: Radiance L of the sky per metre of wavelength, in W/(m^2 sr m).
        wavelength_m: Wavelength lambda, in m.

    Raises:
        ValueError: For a negative radiance or a wavelength not above 0 m.
    """
    _RADIANCE.check("the spectral radiance", spectral_radiance_w_m2_sr_m)
    Quantity("m", above=0.0).check("the wavelength", wavelength_m)
    return spectral_radiance_w_m2_sr_m * wavelength_m**5 / (2.0 * PLANCK_J_S * SPEED_OF_LIGHT_M_S**2)


def apd_excess_noise_factor(gain: float, ionisation_ratio: float) -> float:
    """Excess noise factor k M + (1 - k) (2 - 1/M) of an avalanche photodiode (McIntyre 1966, IEEE T-ED 13, 164).

    It holds for thick multiplication layers; thin ones have less noise.

    Args:
        gain: Mean gain M, at least 1.
        ionisation_ratio: Ratio k of holes to electrons where electrons start the avalanche (its inverse where holes
            do), from 0 to 1.

    Raises:
        ValueError: For a gain below 1, and a ratio outside 0 to 1.
    """
    _GAIN.check("the gain of the avalanche photodiode", gain)
    _RATIO.check("the ionisation ratio", ionisation_ratio, _INVERSE)
    return capacity.excess_noise_factor(gain, ionisation_ratio)


class RateError(ValueError):
    """A data rate above what the receiver's bandwidth takes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Receiver(Bounded, ABC):
    """What every receiver has.

    `bit_error_ratio` is the target, at the decoder's output if there is a code. `bandwidth_hz` is the highest rate of
    symbols that the receiver takes (slots for PPM); the line carries data rate / `code_rate` bits per second.

    `code_gain_db` is the net gain: by how much less optical power per *information* bit the coded link needs than the
    uncoded one, both at the same information rate and at the target ratio after the decoder. The check bits are
    already paid for: a gross gain, stated at equal line rate, is not it, and a gain stated in electrical decibels
    (20 log10 Q) counts half in optical power for a receiver limited by thermal noise. The gain is one number: at
    another ratio than the target, `bit_error_ratio_at` takes it as unchanged.

    Raises ValueError for a value without meaning.
    """

    wavelength_m: Annotated[float, Quantity("m", above=0.0)]
    bit_error_ratio: Annotated[float, Share("", least=LEAST_RATIO, below=0.5), "0.5 is a guess"]
    bandwidth_hz: Annotated[float, Quantity("Hz", above=0.0)]
    code_gain_db: Annotated[float, Quantity("dB", least=0.0), "a code that costs power is better left out"] = 0.0
    code_rate: Annotated[float, Quantity("", above=0.0, most=1.0)] = 1.0

    def bit_error_ratio_at(self, power_w: ArrayLike, data_rate_bit_s: ArrayLike) -> Floats:
        """Bit error ratio, after the decoder, at a received power and a data rate.

        Args:
            power_w: Average received power, in W; broadcast against the data rate.
            data_rate_bit_s: Data rate, in bit/s, without the check bits of a code.

        Raises:
            ValueError: For a negative power and a rate that is not positive.
            RateError: For a rate above the bandwidth.
        """
        powers, rates = checked("the received power", power_w, _POWER), self._rates(data_rate_bit_s)
        power, rate = np.broadcast_arrays(powers * self._gain(rates), rates)
        return np.asarray(self._ratio(power, rate), dtype=np.float64)

    def required_power_w(self, data_rate_bit_s: ArrayLike) -> Floats:
        """Average power that reaches the target bit error ratio at each data rate.

        Raises ValueError for a rate that is not positive, `RateError` for one above the bandwidth.
        """
        rate = self._rates(data_rate_bit_s)
        return np.asarray(self._power_w(rate) / self._gain(rate), dtype=np.float64)

    def photons_per_bit(self, data_rate_bit_s: ArrayLike) -> Floats:
        """Photons at the detector for each information bit, at the required power; errors as of `required_power_w`."""
        rate = np.asarray(data_rate_bit_s, dtype=np.float64)
        return np.asarray(self.required_power_w(rate) / (rate * self._photon_j), dtype=np.float64)

    def net_gain_db(self, data_rate_bit_s: ArrayLike) -> Floats:
        """What the code gains at each data rate, in dB per bit of information; errors as of `required_power_w`."""
        return np.asarray(10.0 * np.log10(self._gain(self._rates(data_rate_bit_s))), dtype=np.float64)

    def symbol_rate_hz(self, data_rate_bit_s: ArrayLike) -> Floats:
        """Symbols (for PPM: slots) per second on the line at each data rate."""
        line_rate = np.asarray(data_rate_bit_s, dtype=np.float64) / self.code_rate
        return np.asarray(line_rate * self._symbols_per_bit, dtype=np.float64)

    @property
    def highest_data_rate_bit_s(self) -> float:
        """Highest data rate that the receiver takes."""
        return self._symbol_rate_limit_hz * self.code_rate / self._symbols_per_bit

    def noise_lines(self, power_w: float, data_rate_bit_s: float) -> tuple[Line, ...]:
        """The independent terms of the noise at this power, each a standard deviation in one symbol of the line.

        The symbols are those on the line, code included.

        Args:
            power_w: Average received power, in W.
            data_rate_bit_s: Data rate, in bit/s, without the check bits of a code.

        Raises:
            ValueError: As `bit_error_ratio_at`.
            RateError: As `bit_error_ratio_at`.
        """
        power = float(checked("the received power", power_w, _POWER))
        rate = float(self._rates(data_rate_bit_s))
        return self._noise(power, float(self.symbol_rate_hz(rate)))

    @property
    def _photon_j(self) -> float:
        return photon_energy_j(self.wavelength_m)

    def _gain(self, rate: Floats) -> Floats:
        """What the code gains at each data rate, as a ratio of power."""
        return np.asarray(10.0 ** (self.code_gain_db / 10.0))

    @property
    def _symbols_per_bit(self) -> float:
        return 1.0

    @property
    def _symbol_rate_limit_hz(self) -> float:
        return self.bandwidth_hz

    def _rates(self, data_rate_bit_s: ArrayLike) -> Floats:
        rates = checked("the data rate", data_rate_bit_s, Quantity("bit/s", above=0.0))
        symbols, limit = self.symbol_rate_hz(rates), self._symbol_rate_limit_hz
        if np.any(symbols > limit * (1.0 + 1e-12)):
            highest = float(rates.max())
            raise RateError(
                f"the data rate is {format_quantity(highest, 'bit/s')}, which is "
                f"{format_quantity(float(symbols.max()), 'Hz')} of symbols or slots on the line: the receiver takes "
                f"{format_limit(limit, 'Hz')}, so at most "
                f"{format_limit(highest * limit / float(symbols.max()), 'bit/s')} of data"
            )
        return rates

    @abstractmethod
    def _ratio(self, power: Floats, rate: Floats) -> Floats:
        """Uncoded bit error ratio."""

    @abstractmethod
    def _power_w(self, rate: Floats) -> Floats:
        """Power that the uncoded receiver needs."""

    @abstractmethod
    def _noise(self, power: float, symbol_rate: float) -> tuple[Line, ...]:
        """Terms at this power and rate of symbols on the line."""
