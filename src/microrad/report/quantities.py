"""How a value with its unit stands in tables."""

from microrad.core.units import format_quantity
from microrad.link.pointing.radial_error import SMALLEST_PROBABILITY

_NOTHING_DB = 1e-9  # what rounding leaves of a margin that is none


def apart(one: float, other: float, unit: str) -> tuple[str, str]:
    """Two values with as many more digits as it takes to tell them apart, seven at most."""
    texts = (quantity(one, unit), quantity(other, unit))
    for digits in range(4, 8):
        if one == other or texts[0] != texts[1]:
            break
        texts = (quantity(one, unit, digits), quantity(other, unit, digits))
    return texts


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """A value with its unit as it stands in tables: in three digits, decibels with two decimals, unless told else.

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
    return text.replace("-", "\u2212", 1) if text.startswith("-") else text  # a minus sign, not a hyphen


def signed(value: float, unit: str, digits: int = 3) -> str:
    """A margin, as `quantity` has it, with its sign."""
    text = quantity(value, unit, digits)
    return text if text.startswith("\u2212") else f"+{text}"
