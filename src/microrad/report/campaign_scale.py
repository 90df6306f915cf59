"""Scales of a campaign's figures, whatever draws them: the prefix of a unit that suits the values."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from microrad.core.units import UnitError, format_quantity, parse_quantity
from microrad.report.campaign_numbers import is_share


class Scale(NamedTuple):
    """How values of an axis are shown: multiplied by ``factor``, then in the unit ``label``."""

    factor: float
    label: str

    def title(self, name: str) -> str:
        """The axis's title."""
        return f"{name} ({self.label})" if self.label else name


def scale_of(values: NDArray[np.float64], unit: str, name: str = "") -> Scale:
    """The prefix of the unit, or per cent, that suits the largest of the values."""
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
