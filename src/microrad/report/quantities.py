"""Numbers as text: values with their units, angles, shares, lengths of time and powers of ten."""

import math
import re

from microrad.core import units
from microrad.core.units import format_beyond, format_quantity
from microrad.link.radial_error import SMALLEST_PROBABILITY

counted = units.counted

MINUS = "\u2212"
"""The sign in front of a negative number, which is no hyphen."""
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_LESS = ("< 0.001", f"> {MINUS}0.001")  # above none, and below
_NOTHING_DB = 1e-9  # what rounding leaves of a margin that is none


def apart(one: float, other: float, unit: str) -> tuple[str, str]:
    """Two values with as many more digits as it takes to tell them apart, seven at most.

    Args:
        one: in SI units.
        other: in SI units.
        unit: the SI unit of both.
    """
    texts = (quantity(one, unit), quantity(other, unit))
    for digits in range(4, 8):
        if one == other or texts[0] != texts[1]:
            break
        texts = (quantity(one, unit, digits), quantity(other, unit, digits))
    return texts


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """A value with its unit as it stands in tables: in three digits, decibels with two decimals, unless told else.

    Args:
        value: in SI units.
        unit: its SI unit, which gets a prefix; "" for a share.
        digits: significant ones; decibels have one decimal less.

    A shortfall of decibels that two decimals would make none has as many as show it. A share, which has no unit, is no
    smaller than a Gaussian tail means anything.
    """
    if not unit and 0.0 < value < SMALLEST_PROBABILITY:
        return f"below {SMALLEST_PROBABILITY:g}"
    if unit.startswith("dB"):
        decimals = digits - 1
        while -0.5 * 10.0**-decimals <= value < -_NOTHING_DB:
            decimals += 1
        text = f"{value:.{decimals}f} {unit}"
        text = text.removeprefix("-") if -_NOTHING_DB <= value < 0 else text
    else:
        text = format_quantity(value, unit, digits)
    return f"{MINUS}{text[1:]}" if text.startswith("-") else text


def signed(value: float, unit: str, digits: int = 3) -> str:
    """A margin, as `quantity` has it, with its sign.

    Args:
        value: in SI units.
        unit: its SI unit.
        digits: significant ones; decibels have one decimal less.
    """
    text = quantity(value, unit, digits)
    return text if text.startswith(MINUS) else f"+{text}"


def minus(text: str) -> str:
    """A text with a minus sign in front of each negative number, in place of a hyphen."""
    return re.sub(r"(?<![\w.])-(?=\d|inf)", MINUS, text)


def plain(value: float, digits: int = 3) -> str:
    """A number without a power of ten, however large, with the sign of prose.

    Args:
        value: any.
        digits: significant ones.
    """
    return minus(units.plain(value, digits))


def power_text(number: float, digits: int = 3) -> str:
    """A number with its power of ten, as it is printed in books: 3×10⁻⁴.

    Args:
        number: any.
        digits: significant ones.
    """
    if not number:
        return "0"
    mantissa, _, exponent = f"{number:.{digits - 1}e}".partition("e")
    raised = f"10{str(int(exponent)).translate(_RAISED)}"
    mantissa = minus(f"{float(mantissa):g}")
    return {"1": raised, f"{MINUS}1": f"{MINUS}{raised}"}.get(mantissa, f"{mantissa}×{raised}")


# -------------------------------------------------------------------------------------------------------------- angles
def micro(value_rad: float) -> str:
    """An angle in microradians, three digits but no more than three decimals, without its unit; "" for nan."""
    value = 1e6 * value_rad
    if math.isnan(value):
        return ""
    if value == 0.0 or abs(value) >= 99.95:
        return minus(f"{value:.0f}")
    if abs(value) < 1e-3:
        return _LESS[int(value < 0.0)]
    size = float(f"{abs(value):.3g}")  # rounding may gain a digit
    return minus(f"{value:.{min(3, max(0, 2 - math.floor(math.log10(size))))}f}")


def angle(value_rad: float) -> str:
    """An angle as it was found: in microradians with the digits of the tables, from 1 mrad on in larger units."""
    return f"{micro(value_rad)} µrad" if float(f"{abs(value_rad):.3g}") < 1e-3 else format_quantity(value_rad, "rad", 3)


def given_angle(value_rad: float) -> str:
    """An angle as it was asked for, without digits that say nothing."""
    return format_quantity(value_rad, "rad")


# ----------------------------------------------------------------------------------------------------- shares and time
def percent(share: float, digits: int = 2) -> str:
    """A share in per cent: "2.3 %"; one that is not all is not told as all.

    Args:
        share: 1 for all of it.
        digits: significant ones, more where they would make it 100 %.
    """
    value = 100.0 * share
    if 0.0 < abs(value) < 1e-3:
        return f"{_LESS[int(value < 0.0)]} %"
    return minus(f"{format_beyond(value, 100.0, '', digits)} %")


def share_of_time(quantile: float) -> str:
    """A quantile as it was asked for: "99.7 %"."""
    return f"{100.0 * quantile:.15g} %"


def volume(bit: float) -> str:
    """An amount of data in bytes."""
    return quantity(bit / 8.0, "B")


def duration(time_s: float) -> str:
    """A length of time in the unit that reads best."""
    if math.isinf(time_s):
        return "never"
    for unit_s, unit in ((3600.0, "h"), (60.0, "min")):
        if abs(time_s) >= 2.0 * unit_s:
            return f"{plain(time_s / unit_s)} {unit}"
    return f"{plain(time_s)} s"


def are(number: int) -> str:
    """The verb behind a number of things: "1 is", "2 are"."""
    return "is" if number == 1 else "are"
