"""Arrays: names by what is in them, whose shapes stand where they are used, and what users give as one."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from microrad.core.units import MOST

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Integers = NDArray[np.int64]


def reals(values: ArrayLike, what: str, refusal: type[ValueError] = ValueError, *, most: float = MOST) -> Floats:
    """Values as an array of floats; nan and infinities pass.

    Args:
        values: The values, of any shape.
        what: What they are, for the message.
        refusal: The error that is raised.
        most: Largest size of a number, in SI units.

    Raises:
        ValueError: For complex numbers, text, lists of unequal length, and numbers beyond that size.
    """
    try:
        given = np.asarray(values)
        made = np.array([], dtype=np.float64) if given.dtype.kind in "cSUMmV" else given.astype(np.float64)
    except (OverflowError, TypeError, ValueError):
        made, given = np.array([], dtype=np.float64), np.array([None])
    if made.shape != given.shape:
        raise refusal(f"{what}: no array of real numbers; give numbers, or lists of them that are equally long")
    if np.any(np.isfinite(made) & (np.abs(made) > most)):
        raise refusal(f"{what}: a number is beyond {most:g}, which nothing here is in SI units; check unit and scale")
    return made
