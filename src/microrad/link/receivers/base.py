"""What every receiver of a laser link has: bit error ratio from optical power, and the power that a data rate needs.

Powers are averages over marks and spaces (or slots) at the detector; rates are information bits per second.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats
from microrad.core.budget import Line
from microrad.core.units import format_quantity
from microrad.link.gains import photon_energy_j

SOURCE = "receiver and power as given"
LEAST_RATIO = 1e-18  # sums over Poisson counts are cut at about 1e-22
LEAST_COUNT = 1e-30  # stands for none, so that logarithms exist


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


def checked_powers(power_w: ArrayLike) -> Floats:
    """The powers as an array; raises ValueError if one is negative or not finite."""
    powers = np.asarray(power_w, dtype=np.float64)
    for power in powers[~((powers >= 0.0) & (powers < math.inf))].flat[:1]:
        require_zero_or_more("the received power", float(power), "W")
    return powers


def shown(value: float, unit: str) -> str:
    """A value with its unit for a message.

    Args:
        value: The value, in `unit`.
        unit: Its SI unit, empty for a plain number.
    """
    return format_quantity(value, unit).rstrip()


def require(holds: bool, what: str, value: float, unit: str, limit: str) -> None:
    """Check a condition on a value; the message names the value and its limit.

    Args:
        holds: Whether the condition holds.
        what: What the value is, in the words of the message.
        value: The value, in `unit`.
        unit: Its SI unit, empty for a plain number.
        limit: The condition in words.

    Raises:
        ValueError: Unless the condition holds.
    """
    if not holds:
        raise ValueError(f"{what} is {shown(value, unit)}: {limit}")


def require_zero_or_more(what: str, value: float, unit: str, advice: str = "") -> None:
    """Check that a value is finite and zero or more.

    Args:
        what: What the value is, in the words of the message.
        value: The value, in `unit`.
        unit: Its SI unit, empty for a plain number.
        advice: Words put behind the limit in the message.

    Raises:
        ValueError: If the value is below zero or not finite.
    """
    zero = f"0 {unit}".rstrip()
    require(0.0 <= value < math.inf, what, value, unit, f"it must be finite and not below {zero}{advice}")


def require_above_zero(what: str, value: float, unit: str) -> None:
    """Check that a value is finite and above zero.

    Args:
        what: What the value is, in the words of the message.
        value: The value, in `unit`.
        unit: Its SI unit, empty for a plain number.

    Raises:
        ValueError: If the value is not above zero, or not finite.
    """
    require(0.0 < value < math.inf, what, value, unit, f"it must be finite and above 0 {unit}")


def require_efficiency(what: str, value: float) -> None:
    """Check that an efficiency is above 0 and at most 1.

    Args:
        what: What the efficiency is, in the words of the message.
        value: The efficiency, in counts or electrons per photon.

    Raises:
        ValueError: If the efficiency is not above 0 and at most 1.
    """
    require(0.0 < value <= 1.0, what, value, "", "it must lie above 0, up to 1 (one count or electron for each photon)")


def require_extinction(ratio: float) -> None:
    """Check that a mark is brighter than a space; raises ValueError."""
    limit = "it is the power of a mark over that of a space, as a ratio and above 1 (inf: dark spaces)"
    require(ratio > 1.0, "the extinction ratio", ratio, "", limit)


def require_noise_figure(noise_figure_db: float) -> None:
    """Check that a noise figure is not below the quantum limit; raises ValueError."""
    limit = "it must be at least 3 dB, the quantum limit of an amplifier of both quadratures at high gain"
    require(3.0 <= noise_figure_db < math.inf, "the noise figure", noise_figure_db, "dB", limit)


class RateError(ValueError):
    """A data rate above what the receiver's bandwidth takes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Receiver(ABC):
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

    wavelength_m: float
    bit_error_ratio: float
    bandwidth_hz: float
    code_gain_db: float = 0.0
    code_rate: float = 1.0

    def __post_init__(self) -> None:
        """Raises ValueError if a value is outside the limits that the class names."""
        require_above_zero("the wavelength", self.wavelength_m, "m")
        require(
            LEAST_RATIO <= self.bit_error_ratio < 0.5,
            "the target bit error ratio",
            self.bit_error_ratio,
            "",
            f"it must be at least {LEAST_RATIO:g} and below 0.5, which is a guess",
        )
        require_above_zero("the receiver's bandwidth", self.bandwidth_hz, "Hz")
        require_zero_or_more(
            "the net code gain", self.code_gain_db, "dB", "; a code that costs power is better left out"
        )
        require(0.0 < self.code_rate <= 1.0, "the code rate", self.code_rate, "", "it must lie above 0, up to 1")

    def bit_error_ratio_at(self, power_w: ArrayLike, data_rate_bit_s: ArrayLike) -> Floats:
        """Bit error ratio, after the decoder, at a received power and a data rate.

        Args:
            power_w: Average received power, in W; broadcast against the data rate.
            data_rate_bit_s: Data rate, in bit/s, without the check bits of a code.

        Raises:
            ValueError: For a negative power and a rate that is not positive.
            RateError: For a rate above the bandwidth.
        """
        powers = checked_powers(power_w)
        power, rate = np.broadcast_arrays(powers * self._code_gain, self._rates(data_rate_bit_s))
        return np.asarray(self._ratio(power, rate), dtype=np.float64)

    def required_power_w(self, data_rate_bit_s: ArrayLike) -> Floats:
        """Average power that reaches the target bit error ratio at each data rate.

        Raises ValueError for a rate that is not positive, `RateError` for one above the bandwidth.
        """
        rate = self._rates(data_rate_bit_s)
        return np.asarray(self._power_w(rate) / self._code_gain, dtype=np.float64)

    def photons_per_bit(self, data_rate_bit_s: ArrayLike) -> Floats:
        """Photons at the detector for each information bit, at the required power; errors as of `required_power_w`."""
        rate = np.asarray(data_rate_bit_s, dtype=np.float64)
        return np.asarray(self.required_power_w(rate) / (rate * self._photon_j), dtype=np.float64)

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
        power, rate = float(checked_powers(power_w)), float(self._rates(data_rate_bit_s))
        return self._noise(power, float(self.symbol_rate_hz(rate)))

    @property
    def _photon_j(self) -> float:
        return photon_energy_j(self.wavelength_m)

    @property
    def _code_gain(self) -> float:
        return float(10.0 ** (self.code_gain_db / 10.0))

    @property
    def _symbols_per_bit(self) -> float:
        return 1.0

    @property
    def _symbol_rate_limit_hz(self) -> float:
        return self.bandwidth_hz

    def _rates(self, data_rate_bit_s: ArrayLike) -> Floats:
        rates = np.asarray(data_rate_bit_s, dtype=np.float64)
        for rate in rates[~((rates > 0.0) & (rates < math.inf))].flat[:1]:
            require_above_zero("the data rate", rate, "bit/s")
        symbols, limit = self.symbol_rate_hz(rates), self._symbol_rate_limit_hz
        if np.any(symbols > limit * (1.0 + 1e-12)):
            highest = float(rates.max())
            raise RateError(
                f"the data rate is {shown(highest, 'bit/s')}, which is {shown(float(symbols.max()), 'Hz')} of "
                f"symbols or slots on the line: the receiver takes {shown(limit, 'Hz')}, "
                f"so at most {shown(highest * limit / float(symbols.max()), 'bit/s')} of data"
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
