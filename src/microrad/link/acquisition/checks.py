"""Checks shared by the acquisition modules; each error says what is wrong, the value, and its limit."""

import math

from microrad.core.units import format_quantity


def require_positive(name: str, value: float, unit: str) -> None:
    """Check that a value is finite and above zero.

    Args:
        name: What the value is, in the words of the message.
        value: The value, in `unit`.
        unit: SI unit for the message, empty for a plain number.

    Raises:
        ValueError: Unless the value is finite and above zero.
    """
    if not (math.isfinite(value) and value > 0.0):
        zero = f"0 {unit}".strip()
        raise ValueError(f"{name} is {format_quantity(value, unit).strip()}: it must be above {zero} and finite")


def require_not_negative(name: str, value: float, unit: str) -> None:
    """Check that a value is finite and zero or more.

    Args:
        name: What the value is, in the words of the message.
        value: The value, in `unit`.
        unit: SI unit for the message, empty for a plain number.

    Raises:
        ValueError: Unless the value is finite and zero or more.
    """
    if not (math.isfinite(value) and value >= 0.0):
        zero = f"0 {unit}".strip()
        raise ValueError(f"{name} is {format_quantity(value, unit).strip()}: it must be {zero} or more and finite")


def require_angle(name: str, value: float) -> None:
    """Check that an angle from the line of sight lies between 0 and pi/2 rad.

    Args:
        name: What the angle is, in the words of the message.
        value: The angle, in rad.

    Raises:
        ValueError: Unless the angle is above 0 and below pi/2 rad.
    """
    if not 0.0 < value < math.pi / 2:
        raise ValueError(
            f"{name} is {format_quantity(value, 'rad')}: it must lie above 0 rad and below pi/2 rad (1.571 rad);"
            " an angle from the line of sight is meant"
        )


def require_overlap(value: float) -> None:
    """Check the overlap of neighbouring tracks; raises ValueError unless it is 0 or more and below 1."""
    if not 0.0 <= value < 1.0:
        raise ValueError(f"the overlap is {value:g}: it must be 0 or more and below 1, a share of a diameter")


def require_inside(name: str, value: float) -> None:
    """Check that a probability lies strictly between 0 and 1.

    Args:
        name: What the probability is, in the words of the message.
        value: The probability.

    Raises:
        ValueError: Unless the probability is above 0 and below 1.
    """
    if not 0.0 < value < 1.0:
        raise ValueError(f"{name} is {value:g}: it must lie above 0 and below 1; Gaussian errors have no edge")


def require_probability(name: str, value: float) -> None:
    """Check that a probability lies above 0 and is at most 1.

    Args:
        name: What the probability is, in the words of the message.
        value: The probability.

    Raises:
        ValueError: Unless the probability is above 0 and at most 1.
    """
    if not 0.0 < value <= 1.0:
        raise ValueError(f"{name} is {value:g}: it must lie above 0 and be 1 or less")


def require_count(name: str, value: int) -> None:
    """Check that a number of things is at least 1.

    Args:
        name: What is counted, in the words of the message.
        value: The number.

    Raises:
        ValueError: If the number is below 1.
    """
    if value < 1:
        raise ValueError(f"{name} is {value}: it must be 1 or more")
