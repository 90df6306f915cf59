"""Receivers that count photons: on-off keying and pulse-position modulation."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats
from microrad.core.budget import Line
from microrad.core.capacity import entropy
from microrad.core.pulse_capacity import least_pulse_counts
from microrad.link.receivers import base
from microrad.mission.fields import Quantity

_MANY = 1e5  # counts from which asymptotic series are exact to 1e-11
_ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
_NO_POWER = "no power was found for a bit error ratio; please report the receiver"
_CHUNK = 4096  # rows of a table of counts held at once


@dataclass(frozen=True, slots=True, kw_only=True)
class _Counter(base.Receiver):
    detection_efficiency: base.Efficiency
    dark_count_rate_hz: Annotated[float, Quantity("Hz", least=0.0)] = 0.0
    background_power_w: base.Power = 0.0

    @property
    def _counts_per_joule(self) -> float:
        return self.detection_efficiency / self._photon_j

    def _floor(self, slot_rate: Floats) -> Floats:
        """Mean counts in a slot without signal."""
        counts = self._counts_per_joule * self.background_power_w + self.dark_count_rate_hz
        return np.asarray(np.maximum(counts / slot_rate, base.LEAST_COUNT), dtype=np.float64)

    def _count_lines(self, pulses: dict[str, float], slot_rate: float) -> tuple[Line, ...]:
        background = self._counts_per_joule * self.background_power_w / slot_rate
        terms = {**pulses, "Background shot noise": background, "Dark counts": self.dark_count_rate_hz / slot_rate}
        return tuple(
            Line(
                name,
                math.sqrt(mean),
                "count",
                "sqrt(mean counts in a slot)",
                base.SOURCE,
                "Poisson counts, no dead time",
            )
            for name, mean in terms.items()
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class OokCounting(_Counter):
    """On-off keying with an ideal photon counter: Poisson counts in each symbol against the likeliest threshold.

    `detection_efficiency` is counts per photon; `dark_count_rate_hz` and `background_power_w` (at the detector) count
    in marks and spaces; `extinction_ratio` is mark over space. The threshold is a whole number of counts and follows
    power and background. Without background BER = exp(-2 q n) / 2: 10.0 photons per bit at 1e-9, averaged over marks
    and spaces. No dead time, afterpulsing or saturation: valid up to count rates far below the detector's own limit.
    """

    extinction_ratio: base.Extinction = math.inf

    def _ratio(self, power: Floats, rate: Floats) -> Floats:
        return self._ratio_of_counts(power * self._counts_per_joule / rate, self._floor(rate))

    def _ratio_of_counts(self, counts: Floats, floor: Floats) -> Floats:
        """Bit error ratio from the mean signal counts in a symbol and the counts without signal."""
        bright, dim = base.mark_and_space(self.extinction_ratio)
        space, swing = dim * counts + floor, (bright - dim) * counts
        mark = space + swing
        # more than (l1 - l0) / log(l1 / l0) counts are likelier from a mark; few beside the floor keep their digits
        log_ratio = np.log1p(swing / space)
        threshold = np.divide(swing, log_ratio, out=np.array(space), where=log_ratio > 0.0)
        whole = np.floor(threshold)
        return np.asarray(0.5 * (_tail(whole, mark, above=False) + _tail(whole, space, above=True)), dtype=np.float64)

    def _power_w(self, rate: Floats) -> Floats:
        floor, target = self._floor(rate), self.bit_error_ratio
        mark, space = base.mark_and_space(self.extinction_ratio)
        natural = math.log(0.5 / target)
        # Bhattacharyya: BER <= exp(-(sqrt l1 - sqrt l0)^2 / 2) / 2, and sqrt l1 + sqrt l0 <= 2 sqrt l1
        swing = (mark - space) ** 2 / natural
        highest = 4.0 * mark / swing + np.sqrt((4.0 * mark / swing) ** 2 + 8.0 * floor / swing)
        counts = _counts_at(self._ratio_of_counts, target, np.asarray(natural / 2.0), highest, floor)
        return counts * rate / self._counts_per_joule

    def _noise(self, power: float, symbol_rate: float) -> tuple[Line, ...]:
        counts = power * self._counts_per_joule / symbol_rate
        mark, space = base.mark_and_space(self.extinction_ratio)
        pulses = {"Signal shot noise, marks": mark * counts, "Signal shot noise, spaces": space * counts}
        return self._count_lines(pulses, symbol_rate)


@dataclass(frozen=True, slots=True, kw_only=True)
class PpmCounting(_Counter):
    """Pulse-position modulation of `order` M slots with an ideal photon counter: the slot with most counts wins.

    log2 M bits per word, one pulse in M slots, ties broken at random, which is the likeliest word for Poisson counts.
    BER = M / (2 (M - 1)) Ps. Without background Ps = (M - 1) / M exp(-n), n counts in the pulse; with
    `background_power_w` and `dark_count_rate_hz` it is summed over the counts (Hamkins 1999, TMO Progress Report
    42-138, Eq. 6), to about 1e-20. Empty slots carry no signal; fields otherwise as in `OokCounting`. Hard decisions on
    words: a code that uses the counts themselves gains more, which belongs into `code_gain_db`. No dead time, no slot
    jitter.

    `code_gap_db` stands for a code in place of `code_gain_db`: the power that it needs over what the capacity with soft
    decisions asks for at its rate, in the background that there is at the data rate (`core.pulse_capacity`).
    """

    order: int
    code_gap_db: Annotated[float | None, Quantity("dB", least=0.0), "no code does with less than capacity"] = None

    def __post_init__(self) -> None:
        """Raises ValueError if the order is no power of two."""
        _Counter.__post_init__(self)
        if self.order < 2 or not math.log2(self.order).is_integer():
            raise ValueError(
                f"the order of the pulse-position modulation is {self.order:g}: it is a power of two above 1"
            )
        if self.code_gap_db is not None and self.code_gain_db:
            raise ValueError("code_gain_db stands beside code_gap_db: a code has one of both")

    @property
    def _symbols_per_bit(self) -> float:
        return self.order / math.log2(self.order)

    @property
    def _bit_per_word_error(self) -> float:
        return self.order / (2.0 * (self.order - 1.0))

    def _ratio(self, power: Floats, rate: Floats) -> Floats:
        slot_rate = (rate * self._symbols_per_bit).ravel()
        floor = self._floor(slot_rate)
        counts = power.ravel() * self.order * self._counts_per_joule / slot_rate
        words = [
            _MostCounts.of(floor[i : i + _CHUNK], self.order).error_ratio(counts[i : i + _CHUNK], slice(None))
            for i in range(0, floor.size, _CHUNK)
        ]
        return np.concatenate([np.empty(0), *words]).reshape(rate.shape) * self._bit_per_word_error

    def _power_w(self, rate: Floats) -> Floats:
        slot_rate = (rate * self._symbols_per_bit).ravel()
        floor = self._floor(slot_rate)
        pulses = [self._pulse_counts(floor[i : i + _CHUNK]) for i in range(0, floor.size, _CHUNK)]
        counts = np.concatenate([np.empty(0), *pulses])
        return (counts * slot_rate / (self.order * self._counts_per_joule)).reshape(rate.shape)

    def _pulse_counts(self, floor: Floats) -> Floats:
        table, target = _MostCounts.of(floor, self.order), self.bit_error_ratio / self._bit_per_word_error
        lowest = math.log((self.order - 1.0) / (self.order * target))
        # Bhattacharyya and the union over M - 1 slots: Ps <= (M - 1) exp(-(sqrt l1 - sqrt l0)^2)
        union = math.log((self.order - 1.0) / target)
        highest = union + 2.0 * np.sqrt(floor * union)
        row = np.arange(float(floor.size))
        return _counts_at(lambda n, i: table.error_ratio(n, i.astype(int)), target, np.asarray(lowest), highest, row)

    def _gain(self, rate: Floats) -> Floats:
        if self.code_gap_db is None:
            return base.Receiver._gain(self, rate)
        slot_rate = np.asarray(self.symbol_rate_hz(rate))
        share = self.code_rate * (1.0 - entropy(self.bit_error_ratio))
        floors = self._floor(slot_rate)
        least = [least_pulse_counts(self.order, share, float(floor)) for floor in floors.ravel()]
        counts = np.reshape(least, slot_rate.shape) * 10.0 ** (self.code_gap_db / 10.0)
        per_watt = self.order * self._counts_per_joule / (counts * slot_rate)
        return np.asarray(self._power_w(rate) * per_watt, dtype=np.float64)

    def _noise(self, power: float, symbol_rate: float) -> tuple[Line, ...]:
        pulse = power * self.order * self._counts_per_joule / symbol_rate
        return self._count_lines({"Signal shot noise, pulse": pulse}, symbol_rate)


class _MostCounts(NamedTuple):
    """Tables over counts (columns) of slots with the mean `floor` (rows): what a pulse of k counts still loses."""

    floor: Floats
    counts: Floats
    log_weight: Floats  # logarithm of P(k | no pulse), times the step between columns
    loss: Floats  # probability that M - 1 empty slots beat, or tie and win against, k counts

    @classmethod
    def of(cls, floor: Floats, order: int) -> "_MostCounts":
        """The tables for slots without a pulse.

        Args:
            floor: Mean counts of a slot without a pulse, shape (rows,).
            order: Number of slots in a symbol.
        """
        b = floor[:, None]
        # Bernstein: beyond `last` an empty slot comes with exp(-45); the sum may step by half a standard deviation
        first, last = np.floor(np.maximum(b - 10.0 * np.sqrt(b), 0.0)), b + 15.0 + np.sqrt(225.0 + 90.0 * b)
        step = np.maximum(np.floor(np.sqrt(b) / 2.0), 1.0)
        k = first + step * np.arange(np.ceil(np.max((last - first) / step, initial=0.0)) + 1.0)
        log_p = _log_poisson(k, b)
        above, here = _tail(k, b, above=True), np.exp(log_p)
        # win = integral of (1 - above - here t)^(M-1) over t from 0 to 1: the ties
        below = np.maximum(1.0 - above, here)
        power, share = order * np.log(below), np.minimum(here / below, 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            win = -np.exp(power) * np.expm1(order * np.log1p(-share)) / (order * here)
        few = (order - 1.0) * (above + here / 2.0)
        return cls(b, k, log_p + np.log(step), np.where(few < 1e-7, few, 1.0 - win))

    def error_ratio(self, pulse: Floats, row: slice | NDArray[np.int64]) -> Floats:
        """Word error ratio for pulses of given strength, one for each of some rows.

        Args:
            pulse: Mean signal counts of the pulse, shape (chosen rows,).
            row: The rows of the tables, a slice or their numbers.
        """
        signal, b = pulse[:, None], self.floor[row]
        probability = np.exp(self.log_weight[row] - signal + self.counts[row] * np.log1p(signal / b))
        return np.asarray((probability * self.loss[row]).sum(axis=1), dtype=np.float64)


def _log_poisson(count: Floats, mean: Floats) -> Floats:
    """Logarithm of P(N = count) of a Poisson law."""
    from scipy.special import gammaln

    result = np.asarray(count * np.log(mean) - mean - gammaln(count + 1.0), dtype=np.float64)
    if np.any(many := count > _MANY):
        n, x = count[many], np.broadcast_to(mean, count.shape)[many]
        result[many] = -_deviance(n, x) - 0.5 * np.log(2.0 * math.pi * n) - 1.0 / (12.0 * n)  # Stirling
    return result


def _tail(count: Floats, mean: Floats, above: bool) -> Floats:
    """P(N > count) of a Poisson law, or P(N <= count): an incomplete gamma function.

    For many counts it is Temme's expansion (DLMF 8.12.3-8.12.4, two terms), which errs by 1e-8 at 1e4 counts and 8
    standard deviations, and 1e-11 at 1e5. scipy's lower function misses 29 % at 1e8 counts and 6 standard deviations.
    """
    from scipy.special import erfc, gammainc, gammaincc

    incomplete_gamma, sign = (gammainc, -1.0) if above else (gammaincc, 1.0)
    a, x = np.broadcast_arrays(count + 1.0, mean)
    result = np.asarray(incomplete_gamma(a, np.where(a > _MANY, 0.0, x)), dtype=np.float64)
    if not np.any(many := a > _MANY):
        return result
    a_many, x_many = a[many], x[many]
    squared = _deviance(a_many, x_many)
    eta = np.copysign(np.sqrt(2.0 * squared / a_many), x_many - a_many)
    first = -1.0 / 3.0 + eta * (1.0 / 12.0 + eta * (-2.0 / 135.0 + eta / 864.0))
    second = -1.0 / 540.0 - eta / 288.0
    rest = np.exp(-squared) / np.sqrt(2.0 * math.pi * a_many) * (first + second / a_many)
    # where erfc underflows, the rest may leave less than nothing
    result[many] = np.maximum(0.5 * erfc(sign * np.copysign(np.sqrt(squared), eta)) + sign * rest, 0.0)
    return result


def _deviance(count: Floats, mean: Floats) -> Floats:
    """mean - count - count log(mean / count), without cancellation."""
    excess = (mean - count) / count
    series = excess**2 * np.polyval([-1 / 9, 1 / 8, -1 / 7, 1 / 6, -1 / 5, 1 / 4, -1 / 3, 1 / 2], excess)
    return np.asarray(count * np.where(np.abs(excess) < 0.05, series, excess - np.log(mean / count)), dtype=np.float64)


def _counts_at(
    ratio: Callable[[Floats, Floats], Floats], target: float, lowest: Floats, highest: Floats, row: Floats
) -> Floats:
    """Counts at which `ratio`, falling in them, is `target`."""
    from scipy.optimize import brentq, elementwise

    def excess(log_counts: Floats, row: Floats) -> Floats:
        return np.asarray(np.log(np.maximum(ratio(np.exp(log_counts), row), 1e-300) / target), dtype=np.float64)

    # a little wider, for a root on the bound itself
    ends = np.log(lowest * 0.999), np.log(highest * 1.001)
    if row.size == 1:  # many at once cost little more than one, and one by itself costs a quarter this way
        low, high = (np.broadcast_to(end, row.shape).item() for end in ends)
        try:
            x = brentq(lambda x: excess(np.full(row.shape, x), row).item(), low, high, xtol=1e-300, rtol=_ROUNDING)
        except ValueError:  # no root between them
            raise ArithmeticError(_NO_POWER) from None
        return np.full(row.shape, math.exp(x))
    found = elementwise.find_root(excess, ends, args=(row,))
    if not np.all(found.success):
        raise ArithmeticError(_NO_POWER)
    return np.asarray(np.exp(found.x), dtype=np.float64)
