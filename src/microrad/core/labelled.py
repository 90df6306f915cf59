"""Arrays by the names of their dimensions, each with its unit and its meaning: for results.nc and for xarray."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray

Dataset: TypeAlias = "xarray.Dataset"
"""That of xarray, which is loaded when one is made."""

TEXT = "text"
"""In place of a unit."""


@dataclass(frozen=True, slots=True)
class Variable:
    """An array by its dimensions, with its unit and its meaning. Texts are of dtype object."""

    dims: tuple[str, ...]
    values: NDArray[Any]
    units: str
    long_name: str

    @property
    def attributes(self) -> dict[str, str]:
        """Unit and meaning, as files of netCDF name them."""
        return {"units": self.units, "long_name": self.long_name}


Variables = Mapping[str, Variable]


@dataclass(frozen=True, slots=True)
class Group:
    """Variables by name, coordinates by the dimension that they number, and attributes of the whole."""

    variables: Variables
    coordinates: Variables = field(default_factory=dict)
    attributes: Mapping[str, object] = field(default_factory=dict)

    def to_xarray(self) -> Dataset:
        """The same as a data set of xarray; unit and meaning are the attributes ``units`` and ``long_name``."""
        import xarray

        def parts(given: Variables) -> dict[str, Any]:
            return {name: (v.dims, v.values, v.attributes) for name, v in given.items()}

        return xarray.Dataset(parts(self.variables), parts(self.coordinates), dict(self.attributes))


def variables(dims: str, of: Sequence[Any] = (), /, **columns: tuple[str, str, Any]) -> dict[str, Variable]:
    """Variables by name.

    Args:
        dims: the names of their dimensions, blanks between.
        of: records, one for each place in the variables.
        columns: unit, meaning, and what the values are: an attribute of the records, a function of one, or an array.
    """
    found = {}
    for name, (units, meaning, what) in columns.items():
        pick = attrgetter(what) if isinstance(what, str) else what
        values = [pick(each) for each in of] if callable(pick) else pick
        array = np.array(values, dtype=object) if units == TEXT else np.asarray(values)
        if array.dtype == object and units != TEXT:  # None is nan
            array = array.astype(float)
        found[name] = Variable(tuple(dims.split()), array, "1" if units == TEXT else units, meaning)
    return found
