"""Numbers of a campaign in words: values, shares and intervals, each with the digits that it is worth."""

import math

from microrad.campaign.records import Interval, Limit
from microrad.report.day_words import duration, volume
from microrad.report.quantities import quantity

_UNKNOWN = "not known"
_LEAST_LOW = 1e-12
"""Lower end of a probability below which it reads 0."""
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
        return power(probability)
    rest = 1.0 - probability
    if 0.0 < rest < 0.1:
        return f"{100.0 * probability:.{min(max(1 - math.floor(math.log10(100.0 * rest)), 1), 8)}f} %"
    return f"{100.0 * probability:.3g} %"


def power(number: float) -> str:
    """A number in two digits with its power of ten: "1.3e-6"."""
    mantissa, _, exponent = f"{number:.1e}".partition("e")
    return f"{mantissa.removesuffix('.0')}e{int(exponent)}"


def is_share(name: str, unit: str) -> bool:
    """Whether an output is a share of something, shown as a probability."""
    return unit in ("", "1") and (name in ("outage", "short") or name.endswith("_share"))


def value(number: float, unit: str, name: str = "") -> str:
    """An estimate of the output ``name`` with its unit, in three digits also where the last are 0: "4.10 µrad"."""
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
    """A value that was given, such as a limit, with its unit: "10 µrad"."""
    if math.isnan(number):
        return _UNKNOWN
    if is_share(name, unit):
        return share(number)
    if unit in ("", "1"):
        return f"{number:.4g}"
    by_unit = {"s": duration, "bit": volume}
    return by_unit[unit](number) if unit in by_unit else quantity(number, unit)


def ends(interval: Interval, unit: str, name: str = "") -> str:
    """The interval alone: "3.1 dB to 3.3 dB", "at least 3.1 dB" where one end is not known, "" where neither is."""
    low, high = (value(end, unit, name) for end in (interval.low, interval.high))
    if is_share(name, unit) and 0.0 <= interval.low < _LEAST_LOW:
        low = "0 %" if high.endswith("%") else "0"
    if math.isnan(interval.low):
        return "" if math.isnan(interval.high) else f"at most {high}"
    return f"at least {low}" if math.isnan(interval.high) else f"{low} to {high}"


def with_ends(interval: Interval, unit: str, name: str = "") -> str:
    """The estimate with its interval."""
    found = ends(interval, unit, name)
    return value(interval.value, unit, name) + (f" ({found})" if found else "")


def share_ends(interval: Interval) -> str:
    """A probability with its interval."""
    return with_ends(interval, "", "outage")


def limit_text(limit: Limit, unit: str) -> str:
    """What an output has to keep, as an inequality."""
    both = [
        f"{SYMBOL[side]} {bound(at, unit, limit.output)}"
        for side in ("least", "most")
        if (at := getattr(limit, side)) is not None
    ]
    return f"{label(limit.output)} {' and '.join(both)}"


def complement(missed: Interval) -> Interval:
    """The probability of the opposite."""
    return Interval(1.0 - missed.value, 1.0 - missed.high, 1.0 - missed.low, missed.confidence)
