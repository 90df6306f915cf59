"""Distributions of drawn inputs: the tables of a campaign file that describe them, and what is drawn from them."""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from microrad.campaign.definition.values import text_of
from microrad.core.arrays import Floats
from microrad.core.units import format_quantity
from microrad.mission.fields import Table


class NormalTable(Table):
    """A normal distribution."""

    distribution: Literal["normal"]
    mean: Any
    deviation: Any
    drawn_as: Any = None


class RangeTable(Table):
    """Evenly between two values, or on a logarithmic scale."""

    distribution: Literal["uniform", "log-uniform"]
    low: Any
    high: Any
    drawn_as: Any = None


class ListTable(Table):
    """One of some values, each with its weight."""

    distribution: Literal["table"]
    values: Any
    weights: Any = None
    drawn_as: Any = None


class IdentifiedTable(Table):
    """The covariance that an identification wrote into the mirror file."""

    distribution: Literal["identified"]


TABLES: dict[str, type[Table]] = {
    "normal": NormalTable,
    "uniform": RangeTable,
    "log-uniform": RangeTable,
    "table": ListTable,
    "identified": IdentifiedTable,
}
"""The tables of a campaign file by the word that their key `distribution` has."""

AnyTable = NormalTable | RangeTable | ListTable | IdentifiedTable


@dataclass(frozen=True, slots=True)
class Normal:
    """Normal, with mean and standard deviation, in the SI unit of the key that is drawn."""

    mean: float
    deviation: float

    def at(self, share: Floats) -> Floats:
        """Values that a share of all draws stays below."""
        return self.mean + self.deviation * standard_normal(share)

    def log_density(self, value: Floats) -> Floats:
        """Logarithm of the density."""
        scaled = (value - self.mean) / self.deviation
        return np.asarray(-0.5 * scaled**2 - math.log(self.deviation) - 0.5 * math.log(2.0 * math.pi))

    def words(self, unit: str) -> str:
        """In words."""
        return f"normal, mean {quantity(self.mean, unit)}, deviation {quantity(self.deviation, unit)}"


@dataclass(frozen=True, slots=True)
class Uniform:
    """Evenly from low to high."""

    low: float
    high: float

    def at(self, share: Floats) -> Floats:
        """Values that a share of all draws stays below."""
        # rounding must not leave the bounds, which may be those of the key
        return np.clip(self.low + (self.high - self.low) * share, self.low, self.high)

    def log_density(self, value: Floats) -> Floats:
        """Logarithm of the density."""
        inside = (value >= self.low) & (value <= self.high)
        return np.where(inside, -math.log(self.high - self.low), -math.inf)

    def words(self, unit: str) -> str:
        """In words."""
        return f"uniform, {quantity(self.low, unit)} to {quantity(self.high, unit)}"


@dataclass(frozen=True, slots=True)
class LogUniform:
    """Evenly from low to high on a logarithmic scale."""

    low: float
    high: float

    def at(self, share: Floats) -> Floats:
        """Values that a share of all draws stays below."""
        return np.clip(self.low * np.exp(math.log(self.high / self.low) * share), self.low, self.high)

    def log_density(self, value: Floats) -> Floats:
        """Logarithm of the density."""
        inside = (value >= self.low) & (value <= self.high)
        safe = np.where(inside, value, self.low)
        return np.where(inside, -np.log(safe) - math.log(math.log(self.high / self.low)), -math.inf)

    def words(self, unit: str) -> str:
        """In words."""
        return f"log-uniform, {quantity(self.low, unit)} to {quantity(self.high, unit)}"


@dataclass(frozen=True, slots=True)
class OneOf:
    """One of some values, with probabilities that sum to 1.

    ``written`` are the values as the campaign file has them. Where they are words, ``values`` are their places in the
    list, from 1, and ``is_words`` says so.
    """

    values: tuple[float, ...]
    probabilities: tuple[float, ...]
    written: tuple[Any, ...]
    is_words: bool

    def at(self, share: Floats) -> Floats:
        """Values that a share of all draws stays below."""
        return np.array(self.values)[self._place(share)]

    def _place(self, share: Floats) -> NDArray[np.intp]:
        rises = np.cumsum(self.probabilities)
        return np.minimum(np.searchsorted(rises, share, side="right"), len(self.values) - 1)

    def log_density(self, value: Floats) -> Floats:
        """Logarithm of the probability."""
        same = np.asarray(value)[..., None] == np.array(self.values)
        with np.errstate(divide="ignore"):  # a value that is none of them
            return np.asarray(np.log(same @ np.array(self.probabilities)))

    def words(self, unit: str) -> str:
        """In words; a list of words is numbered as its column is."""
        numbers = [f"{i} = {text_of(word)}" for i, word in enumerate(self.written, 1)]
        names = numbers if self.is_words else [quantity(value, unit) for value in self.values]
        even = len(set(self.probabilities)) == 1
        shares = "" if even else f", weights {', '.join(f'{p:.3g}' for p in self.probabilities)}"
        return f"one of {', '.join(names)}{shares}"


Distribution = Normal | Uniform | LogUniform | OneOf


def standard_normal(share: Floats) -> Floats:
    """Value that a share of all standard normal draws stays below."""
    from scipy.special import ndtri

    return np.asarray(ndtri(share), dtype=float)


def quantity(value: float, unit: str) -> str:
    """A value to read.

    Args:
        value: the value in the SI unit.
        unit: that unit, "" for a plain number.
    """
    return format_quantity(value, unit) if unit else f"{value:.6g}"


def _has_all(drawn: OneOf, wanted: OneOf) -> bool:
    """Whether a list has all values of another; words have to stand in the same places, which are what is drawn."""
    if drawn.is_words or wanted.is_words:
        return drawn.written == wanted.written
    return set(wanted.values) <= set(drawn.values)


def uncovered(wanted: Distribution, drawn: Distribution) -> str:
    """Why draws from one distribution cannot be weighted to stand for another; "" where they can.

    Args:
        wanted: the input's own distribution.
        drawn: the one that is drawn from.
    """
    if isinstance(wanted, Normal):
        if not isinstance(drawn, Normal):
            return "never draws far out, where the normal distribution still has values"
        if 2.0 * drawn.deviation**2 <= wanted.deviation**2:
            return "is too narrow: its weights would have no finite variance"
        return ""
    if isinstance(wanted, OneOf) or isinstance(drawn, OneOf):
        alike = isinstance(wanted, OneOf) and isinstance(drawn, OneOf) and _has_all(drawn, wanted)
        return "" if alike else "does not draw every value of the table"
    ends = np.array([wanted.low, wanted.high])
    if not np.all(np.isfinite(drawn.log_density(ends))):
        return "does not reach every value"
    return ""
