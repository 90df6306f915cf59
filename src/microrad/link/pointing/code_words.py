"""Code words that a link loses to pointing errors, from simulated runs of its loop.

A code averages the light over its word: it is lost where the mean received power over it is less than what the required
margin asks for. The word begins anew behind each other one, from the end of the settling on.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from microrad import link
from microrad.core.arrays import Floats
from microrad.core.intervals import Interval, clustered_band
from microrad.core.units import format_quantity
from microrad.link.pointing.light import Light
from microrad.link.pointing.outage import Exposure, like_gaussian_db
from microrad.loop.pointing_loop.ensemble import Span, control_samples
from microrad.loop.pointing_loop.loop import PointingLoop
from microrad.loop.pointing_loop.simulated_windows import CONFIDENCE, Question, Windows


@dataclass(frozen=True, slots=True)
class FadeMargin:
    """What a Gaussian beam may lose to pointing errors until less than the required margin is left.

    ``loss_db`` is what may be lost, below 0 where the margin is missed on the axis.
    """

    light: Light
    loss_db: float

    @classmethod
    def of(cls, data: link.DataLink) -> "FadeMargin":
        """That of a communication link, the same as that of its fades.

        Args:
            data: The communication link.

        Raises:
            ValueError: For a data rate that the receiver does not take.
        """
        under, light = Exposure.stated(data), Light.of(data)
        spare = under.on_axis_db - light.given_db - data.requirement.margin_db
        if spare <= 0.0:
            return cls(light, spare)
        like = like_gaussian_db(under.fall, spare)
        if light.end is None:
            return cls(light, like)
        # the beam may lose any part of it: a Gaussian one that has lost the same where all is lost
        return cls(replace(light, half_angle_rad=light.half_angle_rad * math.sqrt(like / spare)), spare)


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

    return Question(lambda: [_Lost(margin, length)], answer, margin.light.end is not None)


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
        power = self._margin.light.power(error)
        means = self._words.add(at, power) / self._words.length
        each = [means < self._least, power < self._least]
        self._hits = self._hits + np.array([np.sum(below, axis=0) for below in each])
        self._trials += [[len(below)] for below in each]

    @property
    def mean(self) -> Floats:
        """Both shares, shape (2, LANES)."""
        return np.asarray(self._hits / self._trials)
