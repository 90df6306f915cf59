"""How a value with its unit stands in tables."""

from microrad.units import format_quantity


def apart(one: float, other: float, unit: str) -> tuple[str, str]:
    """Two values with as many more digits as it takes to tell them apart, seven at most."""
    texts = (quantity(one, unit), quantity(other, unit))
    for digits in range(4, 8):
        if one == other or texts[0] != texts[1]:
            break
        texts = (quantity(one, unit, digits), quantity(other, unit, digits))
    return texts


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """A value with its unit as it stands in tables: in three digits, decibels with two decimals, unless told else."""
    text = f"{value:.{digits - 1}f} {unit}" if unit.startswith("dB") else format_quantity(value, unit, digits)
    return text.replace("-", "\u2212", 1) if value < 0 else text  # a minus sign, not a hyphen
