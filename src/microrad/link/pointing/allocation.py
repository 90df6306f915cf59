"""What a fixed total leaves for each line of the pointing budget."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from microrad.core.units import format_quantity
from microrad.link.pointing.error_classes import Interpretation, StatedError, error_term
from microrad.link.pointing.summation import TOTALS, Rule


@dataclass(frozen=True, slots=True)
class Allocation:
    """What a fixed total leaves for one line while all others stay as they are.

    `largest_rad` is the largest half width, stated as the line's own, that still meets the total. It is 0 when the
    others alone miss the total, by `missing_rad`, and `note` says so; "" otherwise.
    """

    name: str
    stated_rad: float
    largest_rad: float
    missing_rad: float
    note: str


def allocate(
    stated: Sequence[StatedError],
    total_rad: float,
    *,
    rule: Rule,
    confidence: float,
    interpretation: Interpretation = "temporal",
) -> tuple[Allocation, ...]:
    """For each line, the largest half width with which the total by `rule` just meets `total_rad`.

    Totals grow with each line, so that there is one. `confidence` does not matter to the rules of stated half widths.
    Raises `ValueError` for a total not above 0, an unknown rule, and as `error_term` and the rule do.
    """
    if not (math.isfinite(total_rad) and total_rad > 0.0):
        shown = format_quantity(total_rad, "rad")
        raise ValueError(f"a total of {shown} leaves nothing to allocate; give an angle above 0 rad")
    if rule not in TOTALS:
        raise ValueError(f'no rule "{rule}" to allocate by; give one of {", ".join(TOTALS)}')

    def total_with(index: int, error_rad: float, alone: bool = False) -> float:
        lines = [] if alone else [*stated[:index], *stated[index + 1 :]]
        terms = [error_term(line, interpretation) for line in (*lines, stated[index].with_error(error_rad))]
        return TOTALS[rule](terms, confidence)

    def one(index: int) -> Allocation:
        line, others = stated[index], total_with(index, 0.0)
        if others > total_rad:
            missing = others - total_rad
            note = f"nothing is left: the other lines alone exceed the total by {format_quantity(missing, 'rad')}"
            return Allocation(line.name, line.error_rad, 0.0, missing, note)
        # alone it would reach the total here; totals are in proportion to a line that is alone
        highest = total_rad / total_with(index, 1.0, alone=True)
        from scipy.optimize import brentq  # here: slow to load

        low, high = 0.0, highest * (1.0 + 1e-6)
        largest = brentq(lambda error: total_with(index, error) - total_rad, low, high, xtol=1e-9 * highest)
        return Allocation(line.name, line.error_rad, float(largest), 0.0, "")

    return tuple(one(index) for index in range(len(stated)))
