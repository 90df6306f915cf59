"""What no code can beat: the largest net gain for each modulation with its detector, from the channel's capacity.

A code of rate R carries R bits of information with each bit of the line. Behind its decoder a share p of them may be
wrong; then each holds 1 - h(p), h the binary entropy, and r = R (1 - h(p)) is at most the capacity (Shannon 1948, and
1959 for p above 0). That leaves a least power. The largest net gain is what the uncoded receiver needs over it, both
for each bit of information: efficiency and noise figure stand in both and cancel. Where noise makes both differ, the
power without a code is taken from above and the least one from below, so that nothing is refused that a code could do.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist

_LOWEST_RATE = 1e-4  # gains have come to their limit, by 0.001 dB
_BISECTIONS = 100
_SIGN_STEP = 0.02
_SURE = 1e-9  # share of a bit that is left unsaid below which the capacity has no digits


def excess_noise_factor(gain: float, ionisation_ratio: float) -> float:
    """Excess noise factor k M + (1 - k) (2 - 1/M) of an avalanche photodiode (McIntyre 1966, IEEE T-ED 13, 164).

    Args:
        gain: Avalanche gain M, at least 1.
        ionisation_ratio: Ratio k of the two carriers' ionisation rates, from 0 to 1.
    """
    return ionisation_ratio * gain + (1.0 - ionisation_ratio) * (2.0 - 1.0 / gain)


@dataclass(frozen=True, slots=True)
class Code:
    """A code by its rate R and the bit error ratio p behind its decoder; its largest gains, as ratios of power."""

    rate: float
    bit_error_ratio: float

    def ppm_counting(self, order: int = 2, background: float | None = None) -> float:
        """Pulse-position modulation with a photon counter; without background the same for each order M.

        A pulse of n counts is missed with exp(-n), and without background nothing else goes wrong: an erasure channel
        with (1 - exp(-n)) log2 M bits for each word (Massey 1981, IEEE Trans. Commun. 29, 1615). So n is at least
        -ln(1 - r), which is n / (R log2 M) for each bit; without a code it is ln(1 / 2p). Background asks for more
        of both, and leaves less gain: the least counts are then those of the capacity with soft decisions, and without
        a code the counts are at most those that Bhattacharyya's bound and the union over M - 1 slots ask for.

        Args:
            order: Number M of slots in a word.
            background: Counts without signal for each bit of information; None is for any background.
        """
        from microrad.core.pulse_capacity import least_pulse_counts

        said = self._said
        least = -math.log1p(-said) if said < 0.5 else -math.log(self._unsaid)
        dark = self._rate * self._natural / least
        if not background or 1.0 - said < _SURE:
            return dark
        slot = background * math.log2(order) / order  # of the line without a code; with it, a slot is shorter by R
        union = math.log(order / (2.0 * self.bit_error_ratio))
        uncoded = union + 2.0 * math.sqrt(slot * union)
        return min(dark, self._rate * uncoded / least_pulse_counts(order, said, slot * self._rate))

    def ook_counting(self, mark: float, space: float, background: float | None = None) -> float:
        """Largest gain of on-off keying with a photon counter, marks and spaces equally likely.

        Without a code Chernoff's bound, exact for dark spaces without background, asks for BER = exp(-C) / 2 at most: C
        is c ln(c / dim) - c + dim at c = (bright - dim) / ln(bright / dim), of the mean counts in a mark and a space.
        The least counts are those of the two bounds below. In any background C is at least half of how far the laws lie
        apart, which grows at least as fast as the signal: the gain is at most the ratio of the two.

        Args:
            mark: Power of a mark over the average power.
            space: Power of a space over the average power.
            background: Counts without signal for each bit of information; None is for any background.
        """
        if background is None:
            return 2.0 * self._natural / self._apart
        line = _OnOff(mark, space)
        most = line.counts(2.0 * self._natural, background)
        uncoded = _rising(lambda n: line.exponent(n, background), self._natural, most)
        return uncoded / max(self._least_dark_counts, line.counts(self._apart, background))

    def ook_current(self, mark: float, space: float, excess_noise: float = 1.0) -> float:
        """Largest gain of on-off keying with a PIN or avalanche photodiode, in the Gaussian noise of its model.

        Without a code the power is at most the sum of what shot noise asks for alone, F Q^2 / (sqrt mark - sqrt
        space)^2 electrons, and of what noise of one size asks for alone. The first is held against the least counts; in
        the second the power goes as Q, and the noise as the root of the line's rate: the root of the gain in Q^2.

        Args:
            mark: Power of a mark over the average power.
            space: Power of a space over the average power.
            excess_noise: Excess noise factor F of the photodiode; 1 for PIN.
        """
        shot = _OnOff(mark, space).counts(excess_noise * self._q**2, 0.0)
        least = max(self._least_dark_counts, _OnOff(mark, space).counts(self._apart, 0.0))
        return shot / least + math.sqrt(self._gaussian(self._q**2))

    def ook_preamplified(self) -> float:
        """On-off keying behind an optical amplifier, as `ook_current` with the signal's beats in place of shot noise.

        They alone ask for Q^2 N / (sqrt mark - sqrt space)^2 photons, N noise photons in the mode. The two fields lie
        in one quadrature with half of the noise and differ by (sqrt mark - sqrt space) sqrt n, whose variance is a
        quarter of its square: a signal over noise of n (sqrt mark - sqrt space)^2 / 2 N, half of the uncoded Q^2.
        """
        return self._gaussian(self._q**2 / 2.0) + math.sqrt(self._gaussian(self._q**2))

    def phases(self) -> float:
        """Two or four phases against an oscillator, each quadrature with a sign of its own in Gaussian noise.

        Without a code the signal over noise of a quadrature is Q^2. With one it is at least that at which a sign, with
        soft decisions, leaves as much untold as the code and its errors do.
        """
        return self._rate * self._q**2 / _least_snr(self._unsaid)

    def dpsk_preamplified(self) -> float:
        """Phase differences behind an optical amplifier: n / N is ln(1 / 2p) without a code.

        The two fields are opposite, in one quadrature with half of the N noise photons: a signal over noise of 2 n / N.
        """
        return self._gaussian(2.0 * self._natural)

    @property
    def _least_dark_counts(self) -> float:
        """Least counts for each bit of information by on-off keying with dark spaces and no background.

        A mark is missed with e = exp(-2 n), a Z-channel: n solves h((1 + e) / 2) - h(e) / 2 = r. Light in the spaces,
        of whichever source, only takes away from that.
        """
        missed = _rising(lambda e: _one_less_entropy(e) + entropy(e) / 2.0, self._unsaid, 1.0)
        return -math.log(missed) / 2.0 / self._rate

    @property
    def _apart(self) -> float:
        """How far the laws of two symbols must lie apart, -2 ln z of their overlap z, for each bit of information.

        z is the sum of the roots of the products of their probabilities. An outcome leaves an error q, and z is the
        mean of 2 sqrt(q (1 - q)), of which h(q) is a convex function: no more than 1 - h(q) at the mean is told.
        """
        crossed = _rising(entropy, self._unsaid, 0.5)
        return -math.log(4.0 * crossed * (1.0 - crossed)) / self._rate

    @property
    def _rate(self) -> float:
        return max(self.rate, _LOWEST_RATE)

    @property
    def _said(self) -> float:
        return self._rate * _one_less_entropy(1.0 - 2.0 * self.bit_error_ratio)

    @property
    def _unsaid(self) -> float:
        return 1.0 - self._rate + self._rate * entropy(self.bit_error_ratio)

    @property
    def _natural(self) -> float:
        return math.log(0.5 / self.bit_error_ratio)

    @property
    def _q(self) -> float:
        return -NormalDist().inv_cdf(self.bit_error_ratio)

    def _gaussian(self, snr: float) -> float:
        """From the signal over noise of a real symbol without a code to 2^2r - 1, Shannon's r = log2(1 + snr) / 2."""
        return self._rate * snr / math.expm1(2.0 * math.log(2.0) * self._said)


@dataclass(frozen=True, slots=True)
class _OnOff:
    """Poisson counts of marks and spaces: n signal counts on average, `mark` n and `space` n with a background."""

    mark: float
    space: float

    def counts(self, apart: float, background: float) -> float:
        """Signal counts at which -2 ln of the overlap, (sqrt bright - sqrt dim)^2 of the mean counts, takes a value.

        Args:
            apart: What -2 ln of the overlap is to be, above 0.
            background: Counts without signal, in the unit of the signal's.
        """
        swing = (self.mark - self.space) ** 2
        return 2.0 * apart / swing * (1.0 + math.sqrt(self.mark * self.space + swing * background / apart))

    def exponent(self, counts: float, background: float) -> float:
        """Chernoff's exponent of the error between a mark and a space.

        Args:
            counts: Signal counts on average.
            background: Counts without signal.
        """
        bright, dim = self.mark * counts + background, self.space * counts + background
        if dim <= 0.0:
            return bright
        level = (bright - dim) / math.log1p((bright - dim) / dim) if bright > dim else dim
        return level * math.log(level / dim) - level + dim


def entropy(share: float) -> float:
    """Binary entropy of a share in bits."""
    return -(share * math.log(share) + (1.0 - share) * math.log1p(-share)) / math.log(2.0) if 0.0 < share < 1.0 else 0.0


def untold_of_a_sign(snr: float) -> float:
    """Bits that a real symbol of either sign in Gaussian noise leaves untold with soft decisions: 1 - its capacity.

    The mean of log2(1 + exp(-2 a y)) over y, normal about a = sqrt(snr). It is summed in equal steps: the singularities
    nearest to the real axis are pi / 2a away from it, which leaves an error of exp(-pi^2 / (a step)).

    Args:
        snr: Signal squared over the variance of the noise, from 0 to about 100.
    """
    import numpy as np

    a = math.sqrt(snr)
    y = np.arange(-12.0, 12.0 + _SIGN_STEP, _SIGN_STEP)
    density = np.exp(-(y**2) / 2.0) / math.sqrt(2.0 * math.pi)
    return float((density * np.logaddexp(0.0, -2.0 * a * (y + a))).sum()) * _SIGN_STEP / math.log(2.0)


@lru_cache(maxsize=1024)
def _least_snr(untold: float) -> float:
    low, high = 0.0, 100.0
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if untold_of_a_sign(middle) > untold else (low, middle)
    return high


def _one_less_entropy(lean: float) -> float:
    """1 - h((1 + lean) / 2), with its digits where the two are nearly equal."""
    if lean >= 1.0:
        return 1.0
    return ((1.0 + lean) * math.log1p(lean) + (1.0 - lean) * math.log1p(-lean)) / (2.0 * math.log(2.0))


def _rising(function: Callable[[float], float], value: float, most: float) -> float:
    """Where a function that rises from 0 takes a value, up to `most`; the end below it."""
    low, high = 0.0, most
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if function(middle) < value else (low, middle)
    return high
