"""Numbers of a campaign: values, shares and intervals with the digits that they are worth, and scales of axes."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from microrad.campaign.records import Interval, Limit
from microrad.core.units import UnitError, format_quantity, parse_quantity
from microrad.report.quantities import duration, plain, power_text, quantity, volume

_UNKNOWN = "not known"
_LEAST_LOW = 1e-12
"""Lower end of a probability below which it reads 0."""
_MOST_BELOW_ALL = 99.999_999_99
"""Per cent that a probability reads at most where it is not 1."""
SYMBOL = {"least": "≥", "most": "≤"}
_LABELS = {"data_rate": "data_rate (possible)"}  # not to be taken for the mission's communication.data_rate


def label(name: str) -> str:
    """The output's name as it stands in tables and figures."""
    return _LABELS.get(name, name)


def share(probability: float) -> str:
    """A probability: in per cent with the digits that tell it from 0 and 1, below a thousandth as a power of ten."""
    if math.isnan(probability):
        return _UNKNOWN
    if 0.0 < probability < 1e-3:
        return power_text(probability, 2)
    rest = 1.0 - probability
    if 0.0 < rest < 0.1:
        decimals = max(1 - math.floor(math.log10(100.0 * rest)), 1)
        return f"{min(100.0 * probability, _MOST_BELOW_ALL):.{min(decimals, 8)}f} %"
    return f"{plain(100.0 * probability)} %"


def is_share(name: str, unit: str) -> bool:
    """Whether an output is a share of something, shown as a probability.

    Args:
        name: name of the output.
        unit: its SI unit; "" or "1" where it has none.
    """
    return unit in ("", "1") and (name in ("outage", "short") or name.endswith("_share"))


def value(number: float, unit: str, name: str = "") -> str:
    """An estimate of an output with its unit, in three digits also where the last are 0: "4.10 µrad".

    Args:
        number: the estimate, in SI units; nan is not known.
        unit: its SI unit; "" or "1" where it has none.
        name: name of the output, which tells whether it is a share (`is_share`).
    """
    text = bound(number, unit, name)
    if not math.isfinite(number) or unit in ("", "1") or unit.startswith("dB"):
        return text
    digits, _, of = text.partition(" ")
    return f"{_three(digits)} {of}" if of else text


def _three(digits: str) -> str:
    """A number with zeros behind it, up to three significant digits."""
    missing = 3 - len(digits.lstrip("\u22120.").replace(".", ""))
    if missing <= 0 or not digits.strip("\u22120."):
        return digits
    return digits + ("" if "." in digits else ".") + "0" * missing


def bound(number: float, unit: str, name: str = "") -> str:
    """A value that was given, such as a limit, with its unit: "10 µrad".

    Args:
        number: what was given, in SI units; nan is not known.
        unit: its SI unit; "" or "1" where it has none.
        name: name of the output, which tells whether it is a share (`is_share`).
    """
    if math.isnan(number):
        return _UNKNOWN
    if is_share(name, unit):
        return share(number)
    if unit in ("", "1"):
        return plain(number, 4)
    by_unit = {"s": duration, "bit": volume}
    return by_unit[unit](number) if unit in by_unit else quantity(number, unit)


def ends(interval: Interval, unit: str, name: str = "") -> str:
    """The interval alone: "3.1 dB to 3.3 dB", "at least 3.1 dB" where one end is not known, "" where neither is.

    Args:
        interval: the interval, in SI units; an end that is nan is not known.
        unit: its SI unit; "" or "1" where it has none.
        name: name of the output, which tells whether it is a share (`is_share`).
    """
    low, high = (value(end, unit, name) for end in (interval.low, interval.high))
    if is_share(name, unit) and 0.0 <= interval.low < _LEAST_LOW:
        low = "0 %" if high.endswith("%") or math.isnan(interval.high) else "0"
    if math.isnan(interval.low):
        return "" if math.isnan(interval.high) else f"at most {high}"
    return f"at least {low}" if math.isnan(interval.high) else f"{low} to {high}"


def with_ends(interval: Interval, unit: str, name: str = "") -> str:
    """The estimate with its interval.

    Args:
        interval: the estimate and its interval, in SI units.
        unit: their SI unit; "" or "1" where they have none.
        name: name of the output, which tells whether it is a share (`is_share`).
    """
    found = ends(interval, unit, name)
    return value(interval.value, unit, name) + (f" ({found})" if found else "")


def share_ends(interval: Interval) -> str:
    """A probability with its interval."""
    return with_ends(interval, "", "outage")


def limit_text(limit: Limit, unit: str) -> str:
    """What an output has to keep, as an inequality.

    Args:
        limit: the limit, one side or both.
        unit: SI unit of its output.
    """
    both = [
        f"{SYMBOL[side]} {bound(at, unit, limit.output)}"
        for side in ("least", "most")
        if (at := getattr(limit, side)) is not None
    ]
    return f"{label(limit.output)} {' and '.join(both)}"


def complement(missed: Interval) -> Interval:
    """The probability of the opposite."""
    return Interval(1.0 - missed.value, 1.0 - missed.high, 1.0 - missed.low, missed.confidence)


# --------------------------------------------------------------------------------------------------------------- scales
class Scale(NamedTuple):
    """How values of an axis are shown: multiplied by ``factor``, then in the unit ``label``."""

    factor: float
    label: str

    def title(self, name: str) -> str:
        """The axis's title."""
        return f"{name} ({self.label})" if self.label else name


def scale_of(values: NDArray[np.float64], unit: str, name: str = "") -> Scale:
    """The prefix of the unit, or per cent, that suits the largest of the values.

    Args:
        values: what is shown, in SI units, of any shape; what is not finite does not count.
        unit: their SI unit; "" or "1" where they have none.
        name: name of the output, which tells whether it is a share (`is_share`).
    """
    finite = np.abs(values[np.isfinite(values)])
    largest = float(finite.max()) if finite.size else 0.0
    if is_share(name, unit):
        return Scale(100.0, "%") if largest >= 1e-3 else Scale(1.0, "share")
    if unit in ("", "1") or unit.startswith("dB"):
        return Scale(1.0, unit if unit != "1" else "")
    if unit == "s":
        seconds, label = next(((s, u) for s, u in ((3600.0, "h"), (60.0, "min")) if largest >= 2.0 * s), (1.0, "s"))
        return Scale(1.0 / seconds, label)
    factor, unit = (0.125, "B") if unit == "bit" else (1.0, unit)
    label = format_quantity(factor * largest, unit).partition(" ")[2]
    try:
        return Scale(factor / parse_quantity(f"1 {label}", unit), label)
    except UnitError:
        return Scale(factor, unit)
