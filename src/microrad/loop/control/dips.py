"""Minima of a distance between the points of a grid of frequencies; they move smoothly with what the distance is of.

A parabola through a minimum and its neighbours tells where it is. What is near the least of all is looked at again
there, more closely each time.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats

NEAR_LEAST = 1.3
"""Dips within this factor of the deepest one are followed between the grid's points."""

CLOSER = (0.05, 0.0025)
"""Half widths, over the grid's step, of the three points through which the parabola is laid again and again."""


class Dips(NamedTuple):
    """Local minima by their row, their place on the grid, their frequency (Hz), and the square that the distance has.

    ``width_hz`` is the smaller of the two steps of the grid beside each.
    """

    row: NDArray[np.intp]
    at: NDArray[np.intp]
    freq_hz: Floats
    squared: Floats
    width_hz: Floats


def on_grid(squared: Floats, freq_hz: Floats) -> Dips:
    """The local minima of rows of a distance.

    Args:
        squared: Squares of the distance, shape (rows, frequencies).
        freq_hz: The grid, or several one behind the other: no minimum is sought where it falls.
    """
    steps = np.diff(freq_hz)
    before, after = steps[:-1], steps[1:]
    change = squared[:, 1:] - squared[:, :-1]
    within = (before > 0.0) & (after > 0.0)
    row, at = np.nonzero((change[:, :-1] * before < 0.0) & (change[:, 1:] * after > 0.0) & within)
    before, after = before[at], after[at]
    left, right = change[row, at] / before, change[row, at + 1] / after
    slope, curvature = (left * after + right * before) / (before + after), (right - left) / (before + after)
    lowest = squared[row, at + 1] - slope**2 / (4.0 * curvature)
    return Dips(row, at + 1, freq_hz[at + 1] - slope / (2.0 * curvature), lowest, np.minimum(before, after))


def followed(
    squared_at: Callable[[Floats], Floats], freq_hz: Floats, width_hz: Floats, closer: Sequence[float] = CLOSER
) -> Floats:
    """Squares of the minima near some frequencies, shape (minima,).

    Args:
        squared_at: Squares of the distance at frequencies (Hz), both of the shape (minima, 3), a row for each minimum.
        freq_hz: Where the minima are about, in Hz, shape (minima,).
        width_hz: How far from there they are sought, in Hz, shape (minima,).
        closer: Half widths of the parabolas, over the width, each smaller than the one before.
    """
    least = np.zeros(freq_hz.size)
    for share in closer if freq_hz.size else ():
        step = share * width_hz
        low, middle, high = squared_at(freq_hz[:, None] + step[:, None] * np.array([-1.0, 0.0, 1.0])).T
        slope, curvature = 0.5 * (high - low), high - 2.0 * middle + low
        moved = np.where(curvature > 0.0, -slope / np.where(curvature > 0.0, curvature, 1.0), 0.0)
        moved = np.clip(moved, -0.5 / share, 0.5 / share)  # within the width
        freq_hz = freq_hz + moved * step
        least = middle + moved * (slope + 0.5 * moved * curvature)
    return least
