"""Distribution of a time as a list of times with their probabilities; what is missing to 1 is failure."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from microrad.core.units import format_input, format_limit
from microrad.mission.fields import Quantity

_MOST = 4096  # times kept; more are merged into equal bins, each at its mean
_FEW = 1024  # each of two distributions when they are convolved
_MOST_PAIRS = _FEW**2
_SAME_S = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class TimeDistribution:
    """Times of success, ascending, and the probability of each; their sum is the probability of success."""

    time_s: NDArray[np.float64]
    weight: NDArray[np.float64]

    @property
    def probability(self) -> float:
        """Probability that success comes at all."""
        return float(np.sum(self.weight))

    @property
    def mean_s(self) -> float:
        """Mean time given success; raises ValueError when success never comes."""
        return float(np.dot(self.time_s, self.weight)) / self._certain()

    @property
    def std_s(self) -> float:
        """Standard deviation of the time given success."""
        square = float(np.dot((self.time_s - self.mean_s) ** 2, self.weight)) / self._certain()
        return math.sqrt(square)

    def cumulative(self, time_s: float) -> float:
        """Probability of success at or before `time_s`, failure counted: the most is `probability`."""
        return float(np.sum(self.weight[self.time_s <= time_s + _SAME_S]))

    def quantile(self, probability: float) -> float:
        """Earliest time by which success has come with `probability`, failure counted, in s.

        Raises ValueError for a probability that is not above 0 or is above the probability of success.
        """
        if not 0.0 < probability <= self.probability * (1.0 + 1e-12):
            raise ValueError(
                f"no time has the probability {format_input(probability, '')}: it must lie above 0 and be at most"
                f" {format_limit(self.probability, '')}, the probability of success"
            )
        index = int(np.searchsorted(np.cumsum(self.weight), probability * (1.0 - 1e-12)))
        return float(self.time_s[min(index, self.time_s.size - 1)])

    def given_success(self) -> "TimeDistribution":
        """The same times with probabilities that sum to 1."""
        return TimeDistribution(self.time_s, self.weight / self._certain())

    def scaled(self, factor: float) -> "TimeDistribution":
        """The same times, each with its probability multiplied by a factor."""
        return TimeDistribution(self.time_s, self.weight * factor)

    def shifted(self, delay_s: float) -> "TimeDistribution":
        """The distribution with every time later by `delay_s`."""
        return TimeDistribution(self.time_s + delay_s, self.weight)

    def followed_by(self, other: "TimeDistribution") -> "TimeDistribution":
        """Distribution of the sum of two independent times, this one and then the other: their convolution."""
        if other.time_s.size == 1:
            return self.shifted(float(other.time_s[0])).scaled(float(other.weight[0]))
        first, second = self, other
        if self.time_s.size * other.time_s.size > _MOST_PAIRS:
            first, second = (merged(d.time_s, d.weight, _FEW) for d in (self, other))
        time = np.add.outer(first.time_s, second.time_s).ravel()
        return merged(time, np.multiply.outer(first.weight, second.weight).ravel())

    def _certain(self) -> float:
        total = self.probability
        if total <= 0.0:
            raise ValueError("there is no time of success: its probability is 0; lengthen the time-out or the coverage")
        return total


def fixed_time(time_s: float, probability: float = 1.0) -> TimeDistribution:
    """Distribution of one time that is certain, or has a probability.

    Args:
        time_s: The time, in s, at least 0.
        probability: Probability of it; what is missing to 1 is failure.

    Raises:
        ValueError: If the time is negative or not finite.
    """
    Quantity("s", least=0.0).check("a time", time_s)
    return TimeDistribution(np.array([time_s]), np.array([probability]))


def merged(time_s: NDArray[np.float64], weight: NDArray[np.float64], most: int = _MOST) -> TimeDistribution:
    """Times in any order as a distribution, equal ones joined.

    More times than `most` are put into equal bins, each at its mean. The probability and the mean stay exact; a
    quantile is off by at most one bin, the span over `most`.

    Args:
        time_s: The times, in s, shape (times,).
        weight: Probability of each time, shape (times,); those of 0 are left out.
        most: Largest number of times kept.
    """
    used = weight > 0.0
    time, weights = time_s[used], weight[used]
    if time.size == 0:
        return TimeDistribution(np.zeros(0), np.zeros(0))
    step = _SAME_S
    if time.size > most:
        step = max(float(np.ptp(time)) / most, _SAME_S)
        label = np.minimum(((time - time.min()) / step).astype(np.int64), most - 1)
    else:
        order = np.argsort(time, kind="stable")
        time, weights = time[order], weights[order]
        label = np.concatenate(([0], np.cumsum(np.diff(time) > step)))
    total = np.asarray(np.bincount(label, weights), dtype=np.float64)
    moment = np.bincount(label, weights * time)
    kept = total > 0.0
    return TimeDistribution(moment[kept] / total[kept], total[kept])


def joined(parts: list[TimeDistribution]) -> TimeDistribution:
    """Distribution of a time that comes from one of several parts, which exclude each other."""
    return merged(np.concatenate([p.time_s for p in parts]), np.concatenate([p.weight for p in parts]))
