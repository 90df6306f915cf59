"""What the modules of the day share: the refusal, and the checks of numbers and spans."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class OperationsError(ValueError):
    """A contact, rate, store, schedule or plan that makes no sense; the message says which value and what to give."""


def check_number(value: float, what: str, unit: str, *, least: float = 0.0, infinite: bool = False) -> None:
    """Refuse a number that is nan, below `least`, or infinite unless that is allowed."""
    if not value >= least or (math.isinf(value) and not infinite):
        allowed = "inf allowed" if infinite else "finite"
        raise OperationsError(f"{what} is {value:g} {unit}; give at least {least:g} {unit}, {allowed}")


def check_positive(value: float, what: str, unit: str, *, infinite: bool = False) -> None:
    """Refuse a number that is nan, not above 0, or infinite unless that is allowed."""
    if not value > 0.0 or (math.isinf(value) and not infinite):
        allowed = "inf allowed" if infinite else "finite"
        raise OperationsError(f"{what} is {value:g} {unit}; give more than 0 {unit}, {allowed}")


def check_span(span: tuple[float, float], what: str) -> None:
    """Refuse a span whose ends are not finite, or whose end is not after its start."""
    start, end = span
    if not (math.isfinite(start) and math.isfinite(end)):
        raise OperationsError(f"{what} runs from {start:g} s to {end:g} s; give finite times")
    if end <= start:
        raise OperationsError(f"{what} ends at {end:.9g} s, not after its start at {start:.9g} s; give the start first")


def vector(values: ArrayLike, what: str) -> Floats:
    """`values` as floats of shape (n,), all finite."""
    found = np.asarray(values, dtype=np.float64)
    if found.ndim != 1:
        raise OperationsError(f"{what} has the shape {found.shape}; give one row of numbers, shape (n,)")
    bad = np.flatnonzero(~np.isfinite(found))
    if bad.size:
        raise OperationsError(f"{what}: number {bad[0]} is {found[bad[0]]:g}; give finite numbers")
    return found
