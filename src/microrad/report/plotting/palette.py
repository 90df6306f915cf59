"""Colours, and fewer points of a curve: what both forms of a figure have in common."""

import numpy as np
from numpy.typing import NDArray

from microrad.core.arrays import Floats

# Okabe and Ito's palette: told apart by colour-blind readers. Line styles differ too, for print in grey.
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION = "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00"
PURPLE = "#CC79A7"
WHITE, GREY = "#ffffff", "#777777"

MOST_POINTS = 1200  # of a curve; extremes are kept
LOG_STRETCHES = 480  # of a logarithmic axis, each as wide as a dot of a screen or less
_PICKS = 5  # of a stretch: lowest and highest of both coordinates, and a gap
# cividis, at even steps: rising in lightness, and the same to the colour-blind.
CIVIDIS = (
    "#00224e", "#002e6a", "#1a386f", "#32436d", "#434e6c", "#535a6d", "#61656f", "#6f7073", "#7d7c78", "#8c8878",
    "#9b9476", "#aba072", "#bcae6c", "#cdbb63", "#dec958", "#f0d846", "#fee838",
)  # fmt: skip


def colour_at(share: float) -> str:
    """The colour of a value, from 0 for the lowest to 1 for the highest; beyond them those of the ends."""
    steps = len(CIVIDIS) - 1
    at = min(max(share, 0.0), 1.0) * steps
    first = min(int(at), steps - 1)
    part = at - first
    low, high = (_parts(CIVIDIS[k]) for k in (first, first + 1))
    return "#" + "".join(f"{round(a + part * (b - a)):02x}" for a, b in zip(low, high, strict=True))


def clear(colour: str, opacity: float) -> str:
    """A colour with its opacity; "" for none.

    Args:
        colour: "#rrggbb", or "".
        opacity: 0 to 1.
    """
    if not colour or opacity == 1.0:
        return colour
    red, green, blue = _parts(colour)
    return f"rgba({red},{green},{blue},{opacity:.3g})"


def _parts(colour: str) -> tuple[int, int, int]:
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def thinned(x: Floats, y: Floats, most: int = MOST_POINTS) -> NDArray[np.int64]:
    """Places of the points to keep: both ends, and the lowest and highest of each stretch.

    Gaps (nan) stay gaps.

    Args:
        x: (n,).
        y: (n,).
        most: so many places at most, but for those at gaps.
    """
    if x.size <= most:
        return np.arange(x.size)
    for picks in range(2, _PICKS + 1):  # a stretch of a smooth curve has two extremes, its ends
        kept = _of_stretches(x, y, max((most - 2) // picks, 1))
        if kept.size <= most:
            break
    return kept


def _of_stretches(x: Floats, y: Floats, count: int) -> NDArray[np.int64]:
    """Both ends, and of each of ``count`` stretches its extremes and its first gap; of one that is a gap, its first.

    Where x rises throughout, its extremes say nothing: twice as many stretches fit.
    """
    edges = np.linspace(0, x.size, count + 1, dtype=np.int64)
    first, gaps = edges[:-1], np.isnan(x) | np.isnan(y)
    stretch = np.repeat(np.arange(count), np.diff(edges))
    broken = np.add.reduceat(gaps.astype(np.int64), first) == np.diff(edges)
    picked = [_firsts(gaps, stretch)]
    for values in (y,) if np.all(np.diff(x) > 0.0) else (x, y):
        for extreme in (np.fmin, np.fmax):
            found = _firsts(values == extreme.reduceat(values, first)[stretch], stretch)
            picked.append(found[~broken[stretch[found]]])
    return np.unique(np.concatenate([[0, x.size - 1], *picked]))


def thinned_by_logarithm(x: Floats, y: Floats, count: int = LOG_STRETCHES) -> NDArray[np.int64]:
    """Places of the points to keep on a logarithmic axis: both ends, and the lowest and highest of each stretch of it.

    A rising x at even steps keeps each point where there are few.

    Args:
        x: (n,), finite and above 0.
        y: (n,), finite.
        count: of the stretches, equal on that axis.
    """
    if x.size <= 2:
        return np.arange(x.size)
    share = np.log(x / x[0]) / np.log(x[-1] / x[0])
    stretch = np.minimum((count * share).astype(np.int64), count - 1)
    first = np.flatnonzero(np.diff(stretch, prepend=-1))
    own = np.repeat(np.arange(first.size), np.diff(first, append=x.size))
    picked = [_firsts(y == extreme.reduceat(y, first)[own], own) for extreme in (np.fmin, np.fmax)]
    return np.unique(np.concatenate([[0, x.size - 1], *picked]))


def _firsts(held: NDArray[np.bool_], stretch: NDArray[np.int64]) -> NDArray[np.int64]:
    """Place of the first point of each stretch at which it holds."""
    places = np.flatnonzero(held)
    return places[np.unique(stretch[places], return_index=True)[1]]
