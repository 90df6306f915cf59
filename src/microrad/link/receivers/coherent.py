"""Receivers that measure the field of the light: DPSK behind an amplifier, BPSK and QPSK against an oscillator."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from microrad.core import phase_error
from microrad.core.arrays import Floats
from microrad.core.budget import Line
from microrad.core.units import format_limit
from microrad.link.receivers import base
from microrad.mission.fields import Quantity, Whole


@dataclass(frozen=True, slots=True, kw_only=True)
class DpskPreamplified(base.Receiver):
    """Differential phase-shift keying: preamplifier, matched optical filter, delay interferometer, balanced detection.

    BER = exp(-n / (n_sp + N)) / 2, n photons per symbol at the amplifier's input, N `background_photons_per_mode`:
    20.03 photons per bit at 1e-9 and n_sp = 1 (Humblet and Azizoglu 1991, J. Lightwave Technol. 9, 1576). Convention:
    n_sp = F / 2 at high gain, so that a noise figure of 3 dB is n_sp = 1. Exact for a matched filter, one polarisation
    (a polariser), no shot or thermal noise behind the amplifier, no phase error in laser or interferometer.
    """

    noise_figure_db: base.NoiseFigure
    background_photons_per_mode: base.PerMode = 0.0

    @property
    def _noise_photons(self) -> float:
        return base.spontaneous_photons(self.noise_figure_db) + self.background_photons_per_mode

    def _ratio(self, power: Floats, rate: Floats) -> Floats:
        return np.asarray(0.5 * np.exp(-power / (rate * self._photon_j * self._noise_photons)), dtype=np.float64)

    def _power_w(self, rate: Floats) -> Floats:
        photons = self._noise_photons * math.log(0.5 / self.bit_error_ratio)
        return photons * self._photon_j * rate

    def _noise(self, power: float, symbol_rate: float) -> tuple[Line, ...]:
        noise, regime = self._noise_photons, "matched filter; product of the fields of two symbols, so not Gaussian"
        signal = power / (symbol_rate * self._photon_j)
        return (
            Line("Signal-ASE beat noise", math.sqrt(signal * noise), "photon", "sqrt(n N)", base.SOURCE, regime),
            Line("ASE-ASE beat noise", noise / math.sqrt(2.0), "photon", "N / sqrt 2", base.SOURCE, regime),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _PhaseKeyed(base.Receiver):
    """Two or four phases against a strong local oscillator; n photons per symbol, q, N and the phase error as fields.

    In one quadrature of the field the signal squared is `_SIGNAL` q n, shot noise of the oscillator has the variance
    `_VACUUM`, the beat with background `_BACKGROUND` q N. With a bit of its own in each of `_BITS` quadratures

        BER = mean over phi of erfc(a (cos phi - [QPSK] sin phi) / sqrt 2) / 2, a^2 = signal^2 over variance.

    phi is Gaussian with the rms `phase_error_rad`, what the phase lock leaves in a symbol (`core.phase_error`). With
    two `polarisations` each carries half of the symbols and of the light, so the symbol rate halves and photons per
    bit stay. Exact for a matched filter, shot noise far above thermal noise, aligned polarisations, and a phase that
    rests during a symbol. A code gain holds for the power with the phase error in it: that is on the safe side, as a
    code works at larger error ratios, which a phase error raises less.
    """

    _BITS: ClassVar[int]
    _SIGNAL: ClassVar[float]
    _VACUUM: ClassVar[float]
    _BACKGROUND: ClassVar[float]

    quantum_efficiency: base.Efficiency
    background_photons_per_mode: base.PerMode = 0.0
    phase_error_rad: Annotated[float, Quantity("rad", least=0.0, most=phase_error.LARGEST_RAD)] = 0.0
    polarisations: Annotated[int, Whole("", least=1, most=2)] = 1

    def __post_init__(self) -> None:
        """Raises ValueError where no power reaches the bit error ratio."""
        base.Receiver.__post_init__(self)
        if phase_error.floor(self.phase_error_rad, self._BITS) >= self.bit_error_ratio:
            most = phase_error.largest_rms_rad(self.bit_error_ratio, self._BITS)
            raise ValueError(
                f"{type(self).__name__}.phase_error_rad is {self.phase_error_rad:g} rad: no power reaches a bit error "
                f"ratio of {self.bit_error_ratio:g} above {format_limit(most, '', 3)} rad rms"
            )

    @property
    def _symbols_per_bit(self) -> float:
        return 1.0 / (self._BITS * self.polarisations)

    @property
    def _signal_per_photon(self) -> float:
        """Squared signal over variance, for each photon in a bit."""
        q = self.quantum_efficiency
        return self._BITS * self._SIGNAL * q / (self._VACUUM + self._BACKGROUND * q * self.background_photons_per_mode)

    def _ratio(self, power: Floats, rate: Floats) -> Floats:
        amplitude = np.sqrt(self._signal_per_photon * power / (rate * self._photon_j))
        return phase_error.bit_error_ratio(amplitude, self.phase_error_rad, self._BITS)

    def _power_w(self, rate: Floats) -> Floats:
        amplitude = phase_error.amplitude_for(self.bit_error_ratio, self.phase_error_rad, self._BITS)
        return amplitude**2 / self._signal_per_photon * self._photon_j * rate

    def _noise(self, power: float, symbol_rate: float) -> tuple[Line, ...]:
        beat = math.sqrt(self._BACKGROUND * self.quantum_efficiency * self.background_photons_per_mode)
        size, unit = math.sqrt(self._VACUUM), "sqrt(photon)"
        regime = f"quadrature of the field, in which the signal is {_root(self._SIGNAL, 'q n')}; matched filter"
        basis = _root(self._BACKGROUND, "q N")
        return (
            Line("Shot noise of the local oscillator", size, unit, _root(self._VACUUM, ""), base.SOURCE, regime),
            Line("Background beat noise", beat, unit, basis, base.SOURCE, regime),
        )


def _root(share: float, of: str) -> str:
    """The root of a share of something, as text."""
    if not of:
        return "1/2" if share == 0.25 else f"sqrt(1 / {1.0 / share:g})"
    return f"sqrt({of})" if share == 1.0 else f"sqrt({of} / {1.0 / share:g})"


@dataclass(frozen=True, slots=True, kw_only=True)
class BpskHomodyne(_PhaseKeyed):
    """Binary phase-shift keying with homodyne detection: a local oscillator at the light's frequency, locked in phase.

    a^2 = 4 q n / (1 + 2 q N), without phase error BER = erfc(sqrt(2 q n / (1 + 2 q N))) / 2: 8.99 photons per bit at
    1e-9 (Agrawal, Fiber-Optic Communication Systems).
    """

    _BITS, _SIGNAL, _VACUUM, _BACKGROUND = 1, 1.0, 0.25, 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class BpskHeterodyne(_PhaseKeyed):
    """Binary phase-shift keying with heterodyne detection: an oscillator beside the light's frequency.

    The image band adds its own vacuum, and its background, as a sky is wider than the intermediate frequency:
    a^2 = 2 q n / (1 + 2 q N), 3 dB less than homodyne, so 17.99 photons per bit at 1e-9 (Agrawal, Fiber-Optic
    Communication Systems).
    """

    _BITS, _SIGNAL, _VACUUM, _BACKGROUND = 1, 1.0, 0.5, 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class QpskHomodyne(_PhaseKeyed):
    """Quaternary phase-shift keying with homodyne detection of both quadratures behind a hybrid of 90 degrees.

    The hybrid sends half of the light to each quadrature: a^2 = 2 q n_b / (1 + q N), n_b photons per bit. Two
    quadratures cannot be measured at once without that loss (Yuen and Shapiro 1980, IEEE Trans. Inf. Theory 26, 78), so
    the 3 dB of homodyne detection are those of one quadrature alone: 17.99 photons per bit at 1e-9.
    """

    _BITS, _SIGNAL, _VACUUM, _BACKGROUND = 2, 0.25, 0.25, 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class QpskHeterodyne(_PhaseKeyed):
    """Quaternary phase-shift keying with heterodyne detection, which sees both quadratures as it is.

    a^2 = 2 q n_b / (1 + 2 q N), n_b photons per bit, that of `BpskHeterodyne`: 17.99 photons per bit at 1e-9.
    """

    _BITS, _SIGNAL, _VACUUM, _BACKGROUND = 2, 0.5, 0.5, 1.0
