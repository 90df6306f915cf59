"""Evidence: what is compared, with what, how far apart the two may be, and why that far."""

import math
from dataclasses import dataclass
from enum import StrEnum


class Referent(StrEnum):
    """What a figure is compared with."""

    MEASUREMENT = "measurement"
    """Of a real device, on a bench or in flight."""
    PUBLISHED = "published output"
    """Of another tool or a standard's worked example."""
    INDEPENDENT = "independent method"
    """Other mathematics or other code, which shares none of that which is checked."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """One figure and what it was compared with.

    Args:
        quantity: Dotted name of the figure, as the registry knows it; "" for what no command prints but others rest on.
        what: In words.
        expected: By the referent, in the unit.
        obtained: By this installation, in the unit.
        tolerance: How far they may be apart, in the unit.
        unit: "" for a share or a count.
        basis: Where the tolerance comes from.
    """

    quantity: str
    what: str
    expected: float
    obtained: float
    tolerance: float
    unit: str
    basis: str

    @property
    def holds(self) -> bool:
        """Whether both are finite and no farther apart than the tolerance, which rounding may exceed by a billionth."""
        apart = abs(self.obtained - self.expected)
        return math.isfinite(apart) and apart <= self.tolerance * (1.0 + 1e-9)


class NotHereError(Exception):
    """Something that a check needs is not on this machine; the text says what, and how to give it."""
