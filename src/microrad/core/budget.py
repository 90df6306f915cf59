"""A budget is a list of lines: each term with its value, its formula, its source and where it holds."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

_LEVELS = ("dBm", "dBW")


@dataclass(frozen=True, slots=True)
class Line:
    """One term of a budget.

    `value` is in `unit`; in decibels a gain is positive and a loss negative, so that a total is a sum. `basis` is the
    formula or measurement, `source` says who gave the inputs, `regime` says where the formula holds. `warning` says
    that it does not hold here, or that nothing was given for it; "" when there is nothing to say.
    """

    name: str
    value: float
    unit: str
    basis: str
    source: str
    regime: str
    warning: str = ""


def total_db(lines: Iterable[Line]) -> float:
    """Sum of the lines: in dB, or in dBm (dBW) when one of them is a level in dBm (dBW).

    Raises:
        ValueError: For a line in another unit and for a second level: two powers do not add in decibels.
    """
    lines = tuple(lines)
    for line in lines:
        if line.unit not in ("dB", *_LEVELS):
            raise ValueError(f'"{line.name}" is in {line.unit}: only lines in dB, dBm or dBW add up in decibels')
    levels = [line.name for line in lines if line.unit in _LEVELS]
    if len(levels) > 1:
        raise ValueError(f"{', '.join(levels)}: only one line of a sum in decibels may be a power level")
    return math.fsum(line.value for line in lines)


def root_sum_square(lines: Iterable[Line]) -> float:
    """Root of the sum of the squared lines, in their common unit.

    Right for standard deviations of uncorrelated terms: ECSS-E-ST-60-10C, 4.2.3, does not add means or bounds so.

    Raises:
        ValueError: When there is no line, when units differ and for decibels.
    """
    lines = tuple(lines)
    units = sorted({line.unit for line in lines})
    if len(units) != 1 or units[0] in ("dB", *_LEVELS):
        raise ValueError(f"a root sum square needs lines in one linear unit, these are in {', '.join(units) or 'none'}")
    return math.hypot(*(line.value for line in lines))
