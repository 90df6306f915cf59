"""Code words that a link loses to pointing errors, from simulated runs of its loop.

A code averages the light over its word: it is lost where the mean received power over it is less than what the required
margin asks for. The word begins anew behind each other one, from the end of the settling on.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from microrad import link
from microrad.core.arrays import Floats
from microrad.core.intervals import Interval, clustered_band
from microrad.core.units import format_quantity
from microrad.link.pointing.outage import Exposure, like_gaussian_db
from microrad.link.pointing.statistics import transmission
from microrad.loop.pointing_loop.ensemble import Span, control_samples
from microrad.loop.pointing_loop.loop import PointingLoop
from microrad.loop.pointing_loop.simulated_windows import CONFIDENCE, Question, Windows


@dataclass(frozen=True, slots=True)
class FadeMargin:
    """What a Gaussian beam may lose to pointing errors until less than the required margin is left.

    ``half_angle_rad`` is that at 1/e2 of intensity, ``ahead_rad`` an uncorrected point-ahead, which is added to the
    length of every error, and ``loss_db`` what may be lost, below 0 where the margin is missed on the axis.
    """

    half_angle_rad: float
    ahead_rad: float
    loss_db: float

    @classmethod
    def of(cls, data: link.DataLink) -> "FadeMargin":
        """That of a communication link, the same as that of its fades.

        Args:
            data: The communication link.

        Raises:
            ValueError: For a data rate that the receiver does not take.
        """
        under = Exposure.stated(data)
        spare = under.on_axis_db - data.receive_pointing_db - data.requirement.margin_db
        loss = spare if spare < 0.0 else like_gaussian_db(under.fall, spare)
        return cls(under.fall.half_angle_rad, under.ahead_rad, loss)


@dataclass(frozen=True, slots=True)
class LostWords:
    """Share of the ``words`` of all runs that are lost, and share of the time with less than the required margin.

    Both with intervals of 99 %, from the spread between the runs.
    """

    code_word_s: float
    words: int
    lost: Interval
    time: Interval


def words_asked(margin: FadeMargin, code_word_s: float, loop: PointingLoop, span: Span) -> Question[LostWords]:
    """The question how many code words are lost in runs, at their control samples.

    Args:
        margin: What the link may lose.
        code_word_s: Length of a code word (s); it is rounded to whole control samples.
        loop: The loop.
        span: How long a run is, what is left out at its begin, and the seed.

    Raises:
        ValueError: For a code word of less than two control samples or longer than a run is behind its settling, and
            for a run that ends before it has settled.
    """
    total, settle = control_samples(loop, span)
    period, samples = loop.timing.period_s, total - settle
    length, word = round(code_word_s / period), format_quantity(code_word_s, "s")
    if length < 2:
        raise ValueError(
            f"a code word of {word} has less than two control samples, {format_quantity(period, 's')} apart: it sees "
            "the power of a moment, and the share of time is its own; leave code_word out"
        )
    if length > samples:
        left = format_quantity(samples * period, "s")
        raise ValueError(
            f"a code word of {word} is longer than a run, of which {left} are left behind its settling: make the runs "
            "longer"
        )
    words = samples // length

    def answer(found: Sequence[Floats]) -> LostWords:
        of_words, of_time = found[0].T
        return LostWords(code_word_s, len(of_words) * words, _share(of_words, words), _share(of_time, samples))

    return Question(lambda: [_Lost(margin, length)], answer)


def _share(by_run: Floats, each: int) -> Interval:
    """The share over all runs from that in each, of so many trials."""
    return Interval(float(np.mean(by_run)), *clustered_band(by_run, each, CONFIDENCE))


class _Lost:
    """Share of the words that are lost and of the samples below the margin, run by run."""

    def __init__(self, margin: FadeMargin, length: int) -> None:
        self._margin, self._words, self._least = margin, Windows(length), 10.0 ** (-0.1 * margin.loss_db)
        self._hits: Floats = np.zeros(1)
        self._trials = np.zeros((2, 1))

    def add(self, at: int, error: Floats) -> None:
        """Some control samples: see `Tally`."""
        radius = np.sqrt(np.sum(error**2, axis=1)) + self._margin.ahead_rad
        power = transmission(radius, self._margin.half_angle_rad)
        means = self._words.add(at, power) / self._words.length
        each = [means < self._least, power < self._least]
        self._hits = self._hits + np.array([np.sum(below, axis=0) for below in each])
        self._trials += [[len(below)] for below in each]

    @property
    def mean(self) -> Floats:
        """Both shares, shape (2, LANES)."""
        return np.asarray(self._hits / self._trials)
