"""How a value with its unit stands in tables."""

from microrad.units import format_quantity


def quantity(value: float, unit: str) -> str:
    """A value with its unit as it stands in tables: decibels with two decimals, the rest in three digits."""
    text = f"{value:.2f} {unit}" if unit.startswith("dB") else format_quantity(value, unit, 3)
    return text.replace("-", "\u2212", 1) if value < 0 else text  # a minus sign, not a hyphen
