"""On-off keying with a current in noise: PIN and avalanche photodiodes, and behind an optical amplifier."""

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.budget import Line
from microrad.core.units import ELEMENTARY_CHARGE_C
from microrad.link.receivers import base
from microrad.mission.fields import Quantity, Whole

_BANDWIDTH_PER_SYMBOL = 0.5  # one-sided noise bandwidth over the symbol rate of a filter matched to rectangular symbols


class _Term(NamedTuple):
    """Variance of the current in A^2: `per_signal` for each watt in the symbol, plus `fixed`."""

    name: str
    basis: str
    per_signal: Floats
    fixed: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class _OnOffCurrent(base.Receiver):
    extinction_ratio: base.Extinction = math.inf

    @abstractmethod
    def _signal_a_w(self) -> float:
        """Current for each watt at the detector."""

    @abstractmethod
    def _terms(self, bandwidth: Floats) -> tuple[_Term, ...]:
        """Terms of the noise in the electrical (noise-equivalent, one-sided) bandwidth."""

    def _variance(self, rate: Floats) -> tuple[Floats, Floats]:
        terms = self._terms(_BANDWIDTH_PER_SYMBOL * rate)
        return sum((t.per_signal for t in terms), np.zeros(())), sum((t.fixed for t in terms), np.zeros(()))

    def _ratio(self, power: Floats, rate: Floats) -> Floats:
        from scipy.special import ndtr

        (mark, space), (per_signal, fixed) = base.mark_and_space(self.extinction_ratio), self._variance(rate)
        swing = self._signal_a_w() * (mark - space) * power
        sigmas = np.sqrt(fixed + per_signal * mark * power) + np.sqrt(fixed + per_signal * space * power)
        # without any noise nothing is wrong, unless there is no signal either
        q = np.divide(swing, sigmas, out=np.where(swing > 0.0, np.inf, 0.0), where=sigmas > 0.0)
        return np.asarray(ndtr(-q), dtype=np.float64)

    def _power_w(self, rate: Floats) -> Floats:
        # Q (s1 + s0) = R (P1 - P0) with s^2 = fixed + per_signal P is quadratic in P1 - P0
        (mark, space), (per_signal, fixed) = base.mark_and_space(self.extinction_ratio), self._variance(rate)
        slope = self._signal_a_w() / base.normal_deviate(self.bit_error_ratio)
        share = mark / (mark - space)
        root = np.sqrt(per_signal**2 * share * (share - 1.0) + slope**2 * fixed)
        swing = 2.0 * (per_signal * (share - 0.5) + root) / slope**2
        return np.asarray(swing / (mark - space), dtype=np.float64)

    def _noise(self, power: float, symbol_rate: float) -> tuple[Line, ...]:
        regime = f"Gaussian noise in {_BANDWIDTH_PER_SYMBOL:g} of the symbol rate"
        lines = []
        for term in self._terms(np.asarray(_BANDWIDTH_PER_SYMBOL * symbol_rate)):
            cases = [("", 0.0)]
            if np.any(term.per_signal):
                cases = list(zip((", marks", ", spaces"), base.mark_and_space(self.extinction_ratio), strict=True))
            for case, share in cases:
                rms = math.sqrt(float(term.fixed + term.per_signal * share * power))
                lines.append(Line(term.name + case, rms, "A", term.basis, base.SOURCE, regime))
        return tuple(lines)


@dataclass(frozen=True, slots=True, kw_only=True)
class OokPin(_OnOffCurrent):
    """On-off keying with a PIN photodiode and an amplifier.

    `quantum_efficiency` is electrons per photon; `thermal_noise_a_sqrt_hz` the amplifier's current noise at its input,
    one-sided; `dark_current_a` and `background_power_w` (see `background_power_w`) add shot noise;
    `extinction_ratio` is mark over space. The filter is matched: its one-sided noise bandwidth is half the symbol rate.

    BER = erfc(Q / sqrt 2) / 2, Q = (i1 - i0) / (s1 + s0) (Agrawal, Fiber-Optic Communication Systems; Personick 1973).
    Holds where shot noise is Gaussian: many electrons in each symbol, as thermal noise demands of a PIN. With dark
    spaces and little thermal noise it is *not* the quantum limit: without any noise but the signal's it gives
    Q^2 / 2 = 18.0 photons per bit at 1e-9, where counting needs 10.0. No intersymbol interference; the threshold is
    the best one, and it follows the power.
    """

    quantum_efficiency: base.Efficiency
    thermal_noise_a_sqrt_hz: Annotated[float, Quantity("A/sqrt(Hz)", least=0.0)]
    dark_current_a: Annotated[float, Quantity("A", least=0.0)] = 0.0
    background_power_w: base.Power = 0.0

    def _responsivity_a_w(self) -> float:
        return self.quantum_efficiency * ELEMENTARY_CHARGE_C / self._photon_j

    def _gain_and_excess(self) -> tuple[float, float]:
        return 1.0, 1.0

    def _signal_a_w(self) -> float:
        return self._gain_and_excess()[0] * self._responsivity_a_w()

    def _terms(self, bandwidth: Floats) -> tuple[_Term, ...]:
        gain, excess = self._gain_and_excess()
        shot, none = 2.0 * ELEMENTARY_CHARGE_C * gain**2 * excess * bandwidth, np.zeros(())
        responsivity = self._responsivity_a_w()
        return (
            _Term("Signal shot noise", "sqrt(2 e M^2 F R P B)", shot * responsivity, none),
            _Term(
                "Background shot noise", "sqrt(2 e M^2 F R P B)", none, shot * responsivity * self.background_power_w
            ),
            _Term("Dark current shot noise", "sqrt(2 e M^2 F I B)", none, shot * self.dark_current_a),
            _Term("Thermal noise", "density sqrt(B)", none, self.thermal_noise_a_sqrt_hz**2 * bandwidth),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class OokApd(OokPin):
    """On-off keying with an avalanche photodiode: `OokPin` with a mean `gain` M and McIntyre's excess noise.

    `dark_current_a` is the primary one, multiplied like the light; `ionisation_ratio` as in
    `apd_excess_noise_factor`. Below Geiger mode. The Gaussian approximation ignores the long upper tail of the
    avalanche's gain (McIntyre 1972, IEEE T-ED 19, 703): the fewer electrons start it in a symbol, the less it holds.
    """

    gain: base.AvalancheGain
    ionisation_ratio: base.IonisationRatio

    def _gain_and_excess(self) -> tuple[float, float]:
        return self.gain, base.apd_excess_noise_factor(self.gain, self.ionisation_ratio)


@dataclass(frozen=True, slots=True, kw_only=True)
class OokPreamplified(_OnOffCurrent):
    """On-off keying with an optical preamplifier, an optical filter and a PIN photodiode.

    Power is at the amplifier's input. The noise figure F is that of high gain, F = 2 n_sp, at least 3 dB, so that the
    amplified spontaneous emission has G F h f / 2 in W/Hz and polarisation; `background_photons_per_mode` adds
    G N h f. `polarisations` is 2, or 1 behind a polariser. The filter is a rectangle of `optical_bandwidth_hz`, which
    must hold twice the electrical bandwidth, the symbol rate: this bounds the rate as well. `gain_db` G sets how far
    shot noise lies below the beats; what the photodiode misses and adds counts as nothing behind it.

    BER by Q as for `OokPin`, beats as in Agrawal (Fiber-Optic Communication Systems, preamplified receivers) and
    Olsson 1989 (J. Lightwave Technol. 7, 1071): Gaussian, where the photocurrent is chi-square. The ideal receiver
    (F = 3 dB, one polarisation, filter as wide as the symbol rate) comes out at 41.2 photons per bit at 1e-9, where
    the chi-square laws give 38.3. With a filter of 1 to 20 symbol rates it needs 0.18 to 0.33 dB too much.
    """

    noise_figure_db: base.NoiseFigure
    gain_db: Annotated[float, Quantity("dB", least=10.0), "high gain is meant"]
    optical_bandwidth_hz: Annotated[float, Quantity("Hz", above=0.0)]
    background_photons_per_mode: base.PerMode = 0.0
    polarisations: Annotated[int, Whole("", least=1, most=2)] = 2

    @property
    def _symbol_rate_limit_hz(self) -> float:
        return min(self.bandwidth_hz, self.optical_bandwidth_hz / (2.0 * _BANDWIDTH_PER_SYMBOL))

    def _signal_a_w(self) -> float:
        return ELEMENTARY_CHARGE_C / self._photon_j * float(10.0 ** (self.gain_db / 10.0))

    def _terms(self, bandwidth: Floats) -> tuple[_Term, ...]:
        signal, none = self._signal_a_w(), np.zeros(())
        noise_photons = base.spontaneous_photons(self.noise_figure_db) + self.background_photons_per_mode
        emission = signal * noise_photons * self._photon_j  # A/Hz in each polarisation
        optical, shot = self.optical_bandwidth_hz, 2.0 * ELEMENTARY_CHARGE_C * bandwidth
        beat = 2.0 * self.polarisations * emission**2 * bandwidth * (optical - bandwidth / 2.0)
        total = self.polarisations * emission * optical
        return (
            _Term("Signal-ASE beat noise", "sqrt(4 I S B), S in A/Hz", 4.0 * signal * emission * bandwidth, none),
            _Term("ASE-ASE beat noise", "sqrt(2 p S^2 B (Bo - B/2)), S in A/Hz", none, beat),
            _Term("Signal shot noise", "sqrt(2 e I B)", shot * signal, none),
            _Term("ASE shot noise", "sqrt(2 e p S Bo B), S in A/Hz", none, shot * total),
        )
