"""What codes make of the powers that their symbols had: the convolutional code of CCSDS, and codes by a threshold.

BPSK with coherent detection, the channel's state known: a symbol at relative power h has the signal over noise Es/N0 =
snr h.
"""

import math
import tomllib
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from microrad.core.arrays import Floats

NAMES = ("ccsds-k7-1-2",)
"""Codes by name."""

_ANGLES = 6
_SINES: Floats = np.sin((2.0 * np.arange(1, _ANGLES) + 1.0) * math.pi / (4.0 * _ANGLES)) ** -2.0
_GRID_DB: Floats = np.linspace(-40.0, 12.0, 1041)


class CodeModel(Protocol):
    """A code as far as powers in time matter to it.

    ``word_bits`` are the bits of information that it decides on together: a code word, or the memory of a decoder.
    ``parts`` are functions of a symbol's signal over noise whose means over the symbols of a word are all that the code
    knows of them.
    """

    @property
    def name(self) -> str:
        """What it is called."""

    @property
    def word_bits(self) -> int:
        """Bits of information that it decides on together."""

    def parts(self, snr: Floats) -> list[Floats]:
        """What is averaged over the symbols of a word, each of the shape of the signal over noise (Es/N0)."""

    def ratio(self, means: list[Floats]) -> Floats:
        """The error ratio of each word by those means."""

    def snr_for(self, ratio: float) -> float:
        """Signal over noise (Es/N0) that leaves an error ratio at constant power."""


@dataclass(frozen=True)
class Convolutional:
    """A convolutional code, decoded for the most likely sequence by soft values: its bit error ratio.

    Two paths that differ in d symbols are mistaken with Q(sqrt(2 sum Es/N0)) over these. By Craig's form Q(sqrt(2 a))
    is half of the mean of exp(-a / sin^2) over angles: over symbols of independent powers each factor is the mean of
    its own, Z = mean exp(-snr h / sin^2), and the product Z^d (Craig 1991, MILCOM, 571; Viterbi 1971, IEEE Trans.
    Commun. Technol. 19, 751). So the powers of a window do as well as the constant power whose nearest paths,
    ``distance`` apart, are mistaken as often. That holds where errors are rare. Where there are many, the mutual
    information of the symbols tells more: of the way in dB from the one power to that of the same mutual information a
    share is gone, which the bit-true simulation of four kinds of powers gave (``share_db``, the latter power as Es/N0,
    and ``share``). Behind it stands the decoder's own table at constant power, ``table_db`` with ``table_ratio``;
    beyond its end the union bound, ``weights`` wrong bits at each of ``distances``, in proportion. The sources stand in
    the file of the code.
    """

    name: str
    rate: float
    word_bits: int
    distances: tuple[int, ...]
    weights: tuple[float, ...]
    table_db: tuple[float, ...]
    table_ratio: tuple[float, ...]
    share_db: tuple[float, ...]
    share: tuple[float, ...]

    def parts(self, snr: Floats) -> list[Floats]:
        """Factors of the pairwise error at each angle, and the mutual information."""
        return [*(np.exp(-each * snr) for each in _SINES), mutual_information(snr)]

    def ratio(self, means: list[Floats]) -> Floats:
        """Bit error ratio over symbols spread at random over windows."""
        *factors, told = means
        pairs, mutual = self._of_level
        by_pairs = np.interp(-np.log(np.maximum(self._pairs(factors), 1e-300)), pairs, _GRID_DB)
        by_mutual = np.interp(told, mutual, _GRID_DB)
        share = np.interp(by_mutual, self.share_db, self.share)
        return self._at_level(by_pairs - share * (by_pairs - by_mutual))

    def at(self, snr: ArrayLike) -> Floats:
        """Bit error ratio at constant signal over noise (Es/N0)."""
        return self._at_level(10.0 * np.log10(np.maximum(np.asarray(snr, dtype=np.float64), 1e-12)))

    def snr_for(self, ratio: float) -> float:
        """Signal over noise (Es/N0) that leaves a bit error ratio at constant power."""
        level = np.interp(-math.log(ratio), -self._log_ratio, _GRID_DB)
        return float(10.0 ** (0.1 * level))

    def _at_level(self, snr_db: Floats) -> Floats:
        return np.asarray(np.exp(np.interp(snr_db, _GRID_DB, self._log_ratio)))

    def _pairs(self, factors: list[Floats]) -> Floats:
        """How often the nearest paths are mistaken."""
        total = np.zeros_like(factors[0])
        for each in factors:
            total += each ** self.distances[0]
        return total / (2.0 * _ANGLES)

    @cached_property
    def _of_level(self) -> tuple[Floats, Floats]:
        """At constant power: minus the logarithm of how often the nearest paths are mistaken; mutual information."""
        *factors, told = self.parts(10.0 ** (0.1 * _GRID_DB))
        return -np.log(self._pairs(factors)), told

    @cached_property
    def _log_ratio(self) -> Floats:
        """Logarithm of the bit error ratio at constant power, on the grid of levels."""
        from scipy.interpolate import PchipInterpolator
        from scipy.special import log_ndtr

        snr = 10.0 ** (0.1 * _GRID_DB)
        pairs = [log_ndtr(-np.sqrt(2.0 * each * snr)) for each in self.distances]
        bound = np.logaddexp.reduce([math.log(w) + each for w, each in zip(self.weights, pairs, strict=True)])
        last, known = self.table_db[-1], np.log(np.array([0.5, *self.table_ratio]))
        table = PchipInterpolator([_GRID_DB[0], *self.table_db], known)
        beyond = bound + known[-1] - np.interp(last, _GRID_DB, bound)
        return np.asarray(np.where(last >= _GRID_DB, table(np.minimum(_GRID_DB, last)), beyond))


@dataclass(frozen=True)
class Threshold:
    """A block code that is lost where the mean mutual information of its symbols is less than at its threshold.

    ``threshold_snr`` is the Es/N0 of the threshold at constant power. Long words of good codes fail so (Divsalar et
    al., and Lapidoth and Shamai's outage: the words of a block-fading channel, Ozarow, Shamai and Wyner 1994, IEEE
    Trans. Veh. Technol. 43, 359). The mutual information of BPSK is J(sqrt(8 Es/N0)), Brannstrom, Rasmussen and Grant
    2005 (IEEE Trans. Inf. Theory 51, 3107).
    """

    name: str
    rate: float
    word_bits: int
    threshold_snr: float

    def parts(self, snr: Floats) -> list[Floats]:
        """Mutual information of a symbol in bits."""
        return [mutual_information(snr)]

    def ratio(self, means: list[Floats]) -> Floats:
        """1 for a word that is lost, 0 for one that is not."""
        return np.where(means[0] < mutual_information(np.array(self.threshold_snr)), 1.0, 0.0)

    def snr_for(self, ratio: float) -> float:
        """The threshold, whatever the ratio."""
        return self.threshold_snr


def mutual_information(snr: Floats) -> Floats:
    """Mutual information of a BPSK symbol in white Gaussian noise, in bits, to 0.001.

    Args:
        snr: Es/N0, any shape.

    Source: F. Brannstrom, L. K. Rasmussen, A. J. Grant, IEEE Trans. Inf. Theory 51 (2005) 3107, equation 15.
    """
    variance = 8.0 * np.asarray(snr, dtype=np.float64)
    return np.asarray((1.0 - 2.0 ** (-0.3073 * variance**0.8935)) ** 1.1064)


@cache
def code(name: str) -> Convolutional:
    """A code by its name.

    Raises:
        ValueError: For a name of none.
    """
    if name not in NAMES:
        raise ValueError(f'no code is called "{name}"; there is {", ".join(NAMES)}')
    text = files("microrad.link.fade_series").joinpath(f"{name}.toml").read_text(encoding="utf-8")
    data: dict[str, Any] = tomllib.loads(text)
    columns = [tuple(zip(*data[name], strict=True)) for name in ("spectrum", "error_ratio", "share")]
    return Convolutional(name, data["rate"], data["word_bits"], *(each for pair in columns for each in pair))
