"""What a coded link makes of a series of received power: error ratio, code words lost, and what the fades cost."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.core.intervals import Interval, clustered_band, student
from microrad.core.units import format_quantity
from microrad.link.fade_series.codes import CodeModel
from microrad.link.fade_series.records import Fades, FadeSeries, FadeSeriesError, check
from microrad.mission.fields import Quantity

Interleaving = Literal["none", "block", "convolutional"]
"""How symbols are spread: not, over blocks that stand behind each other, or over a window that slides along."""

CONFIDENCE = 0.99
SPANS = 13
MOST_POWER_DB = 60.0
"""Extra power, or less power, beyond which no more is looked for."""

_CLUSTERS = 16
_SAME = 1e-6  # what the table's interpolation leaves at constant power


@dataclass(frozen=True, slots=True)
class SpanPenalty:
    """Extra power in dB by the span of the interleaver; infinite where no power makes up for the fades."""

    span_s: tuple[float, ...]
    penalty_db: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class CodedFading:
    """A coded link over a series at the power that is there.

    ``margin_db`` is by how much power 1 of the series is above what the code needs for ``target``, its error ratio at
    constant power. ``ratio`` is the mean error ratio, and ``lost`` the share of ``words`` whose own one is above the
    target, both with intervals of 99 % from the spread between sixteen parts of the series. ``penalty_db`` is the extra
    power over constant power 1 that brings the mean back to the target, negative where the series has more than that,
    infinite where no power does. ``curve`` has that penalty against the span. ``fades`` are those below what the code
    needs where the mean is at the target.
    """

    code: str
    source: str
    target: float
    margin_db: float
    interleaving: Interleaving
    span_s: float
    window_s: float
    words: int
    ratio: Interval
    lost: Interval
    penalty_db: float
    fades: Fades
    curve: SpanPenalty

    @property
    def margin_left_db(self) -> float:
        """Margin under the fades."""
        return self.margin_db - self.penalty_db


@dataclass(frozen=True)
class CodedLink:
    """A code over a series of powers, its symbols spread over a window.

    Without an interleaver, and with one shorter than a sample, each bit sees the power of its time. With one, the
    symbols of two paths that a decoder may mistake, or those of a code word, fall at random into a window of
    ``span_s``: blocks that stand behind each other, or one that slides along. Long against the fades each word sees all
    powers there are.

    Raises:
        FadeSeriesError: For a series that is shorter than a window, and for an interleaver without a span or a span
            without one, and a data rate that is not above 0.
    """

    code: CodeModel
    series: FadeSeries
    data_rate_bit_s: float
    interleaving: Interleaving = "none"
    span_s: float = 0.0

    def __post_init__(self) -> None:
        """Check the window."""
        if self.interleaving not in get_args(Interleaving):
            raise FadeSeriesError(
                f"the interleaving is {self.interleaving!r}; give one of {', '.join(get_args(Interleaving))}."
            )
        check("the data rate", self.data_rate_bit_s, Quantity("bit/s", above=0.0), self.series.source)
        check("the span of the interleaver", self.span_s, Quantity("s", least=0.0), self.series.source)
        if (self.interleaving == "none") != (self.span_s == 0.0):
            raise FadeSeriesError(
                f"interleaving is {self.interleaving!r} and its span {format_quantity(self.span_s, 's')}; give a span "
                'above 0 s, or interleaving "none" without one.'
            )
        self.series.at_least_as_long_as(self.word_s, f"a code word, {self.code.word_bits} bits, lasts")
        self.series.at_least_as_long_as(self.span_s, "the interleaver spans")

    @property
    def word_s(self) -> float:
        """How long the bits last that the code decides on together."""
        return self.code.word_bits / self.data_rate_bit_s

    @property
    def window(self) -> int:
        """Samples that a word sees."""
        return max(1, round(max(self.span_s, self.word_s) / self.series.period_s))

    def ratios(self, snr: float) -> Floats:
        """Error ratio of each window.

        Args:
            snr: Es/N0 at power 1.
        """
        return self._ratios(self.code.parts(snr * self.series.power), self.window)

    def mean_ratio(self, snr: float) -> float:
        """Mean error ratio over the series.

        Args:
            snr: Es/N0 at power 1.
        """
        return float(np.mean(self.ratios(snr)))

    def penalty_db(self, target: float) -> float:
        """Extra power over constant power 1, in dB, that brings the mean back to an error ratio; infinite for none.

        Args:
            target: The error ratio.
        """
        needed = self.code.snr_for(target)
        return _falling(lambda db: self.mean_ratio(needed * 10.0 ** (0.1 * db)), target)

    def curve(self, target: float, spans: int = SPANS) -> SpanPenalty:
        """That penalty against the span of the interleaver, from one that spans nothing to a quarter of the series.

        Args:
            target: The error ratio.
            spans: How many spans, evenly spread in decades.
        """
        kind: Interleaving = "block" if self.interleaving == "none" else self.interleaving
        first, last = 2, max(self.series.power.size // 4, 2)
        lengths = sorted({round(each) for each in np.geomspace(first, last, spans)})
        several = [replace(self, interleaving=kind, span_s=each * self.series.period_s) for each in lengths]
        alone = replace(self, interleaving="none", span_s=0.0)
        found = tuple(each.penalty_db(target) for each in (alone, *several))
        return SpanPenalty((0.0, *(each.span_s for each in several)), found)

    def _ratios(self, parts: list[Floats], length: int) -> Floats:
        if length == 1:
            return self.code.ratio(parts)
        slides = self.interleaving == "convolutional"
        return self.code.ratio([(_sliding if slides else _blocks)(each, length) for each in parts])


def coded_fading(link: CodedLink, margin_db: float, target: float) -> CodedFading:
    """What a coded link makes of a series.

    Args:
        link: The code over the series.
        margin_db: By how much power 1 of the series is above what the code needs at constant power, in dB.
        target: Error ratio that is wanted.

    Raises:
        FadeSeriesError: For a series that is sampled slower than its fades, and a target that is no error ratio.
    """
    check("the error ratio", target, Quantity("", above=0.0, most=1.0), link.series.source)
    penalty, curve = cost(link, target)
    level = 10.0 ** (-0.1 * (penalty if math.isfinite(penalty) else margin_db))
    fades = link.series.resolves(level)
    ratios = link.ratios(link.code.snr_for(target) * 10.0 ** (0.1 * margin_db))
    return CodedFading(
        code=link.code.name,
        source=link.series.source,
        target=target,
        margin_db=margin_db,
        interleaving=link.interleaving,
        span_s=link.span_s,
        window_s=link.window * link.series.period_s,
        words=ratios.size,
        ratio=_interval(ratios),
        lost=_share(ratios > target * (1.0 + _SAME)),
        penalty_db=penalty,
        fades=fades,
        curve=curve,
    )


def cost(link: CodedLink, target: float) -> tuple[float, SpanPenalty]:
    """Extra power that the fades cost a coded link, in dB, and that against the span of its interleaver.

    Args:
        link: The code over the series.
        target: Error ratio that is wanted.
    """
    word_s = max(1, round(link.word_s / link.series.period_s)) * link.series.period_s
    return _cost(replace(link, data_rate_bit_s=link.code.word_bits / word_s), target)


@lru_cache(maxsize=16)  # rows of a campaign and steps of a slider ask again and again, at data rates that do not matter
def _cost(link: CodedLink, target: float) -> tuple[float, SpanPenalty]:
    return link.penalty_db(target), link.curve(target)


def _interval(values: Floats) -> Interval:
    """The mean of values in time, none below 0, with its interval."""
    mean, parts = float(np.mean(values)), _parts(values)
    if parts.size < 2:
        return Interval(mean, 0.0, math.inf)
    half = student(CONFIDENCE, parts.size - 1) * float(np.std(parts, ddof=1)) / math.sqrt(parts.size)
    return Interval(mean, max(mean - half, 0.0), mean + half)


def _share(lost: NDArray[np.bool_]) -> Interval:
    """The share of words that are lost, with its interval."""
    parts = _parts(lost.astype(np.float64))
    return Interval(float(np.mean(lost)), *clustered_band(parts, max(lost.size // _CLUSTERS, 1), CONFIDENCE))


def _parts(values: Floats) -> Floats:
    """Means over as many parts, of equal length, as an interval is told from; few values are parts by themselves."""
    each = max(values.size // _CLUSTERS, 1)
    return _blocks(values, each)


def _blocks(values: Floats, length: int) -> Floats:
    """Means over windows behind each other; what is left at the end is in none."""
    whole = values.size // length
    return np.asarray(values[: whole * length].reshape(whole, length).mean(axis=1))


def _sliding(values: Floats, length: int) -> Floats:
    """Means over each window of so many samples."""
    sums = np.cumsum(values)
    windows = sums[length - 1 :].copy()
    windows[1:] -= sums[:-length]
    return np.asarray(np.maximum(windows, 0.0) / length)


def _falling(function: Callable[[float], float], value: float) -> float:
    """Where a function that falls takes a value; infinite where it does not up to `MOST_POWER_DB`."""
    low, high = -MOST_POWER_DB, 3.0
    if function(low) <= value:
        return low
    while function(high) > value:
        if high >= MOST_POWER_DB:
            return math.inf
        low, high = high, min(2.0 * high, MOST_POWER_DB)
    from scipy.optimize import brentq

    return float(brentq(lambda db: math.log(max(function(db), 1e-300) / value), low, high, xtol=1e-9, rtol=1e-12))
