"""Arrays with their unit and what they are, for datasets."""

from collections.abc import Sequence

import numpy as np
import xarray as xr


def variable(dims: tuple[str, ...], values: object, units: str, long_name: str) -> xr.Variable:
    """An array with its unit and its meaning."""
    return xr.Variable(dims, np.asarray(values), attrs={"units": units, "long_name": long_name})


def coordinate(dimension: str, values: Sequence[str], long_name: str) -> dict[str, xr.Variable]:
    """A coordinate of names."""
    return {dimension: variable((dimension,), np.asarray(values, dtype=object), "1", long_name)}
