"""Receivers that measure the field of the light: DPSK behind an amplifier, BPSK by homodyne detection."""

import math
from dataclasses import dataclass

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.budget import Line
from microrad.link.receivers import base


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
class BpskHomodyne(base.Receiver):
    """Binary phase-shift keying with homodyne detection: a strong local oscillator, locked in phase.

    BER = erfc(sqrt(2 q n / (1 + 2 q N))) / 2, q `quantum_efficiency` (with mixing efficiency), n photons per symbol, N
    `background_photons_per_mode`: 8.99 photons per bit at 1e-9 (Agrawal, Fiber-Optic Communication Systems). Exact for
    a matched filter, shot noise of the oscillator far above thermal noise, no phase error.
    """

    quantum_efficiency: base.Efficiency
    background_photons_per_mode: base.PerMode = 0.0

    @property
    def _signal_per_photon(self) -> float:
        """Squared signal over variance, for each photon in a symbol."""
        return 4.0 * self.quantum_efficiency / (1.0 + 2.0 * self.quantum_efficiency * self.background_photons_per_mode)

    def _ratio(self, power: Floats, rate: Floats) -> Floats:
        from scipy.special import ndtr

        photons = power / (rate * self._photon_j)
        return np.asarray(ndtr(-np.sqrt(self._signal_per_photon * photons)), dtype=np.float64)

    def _power_w(self, rate: Floats) -> Floats:
        photons = base.normal_deviate(self.bit_error_ratio) ** 2 / self._signal_per_photon
        return photons * self._photon_j * rate

    def _noise(self, power: float, symbol_rate: float) -> tuple[Line, ...]:
        beat = math.sqrt(self.quantum_efficiency * self.background_photons_per_mode / 2.0)
        regime = "quadrature of the field, in which the signal is sqrt(q n); matched filter"
        return (
            Line("Shot noise of the local oscillator", 0.5, "sqrt(photon)", "1/2", base.SOURCE, regime),
            Line("Background beat noise", beat, "sqrt(photon)", "sqrt(q N / 2)", base.SOURCE, regime),
        )
