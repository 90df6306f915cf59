"""Arrays with their unit and what they are, in groups, as netCDF."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Variable:
    """An array by its dimensions, with its unit and its meaning. Texts are of dtype object."""

    dims: tuple[str, ...]
    values: NDArray[Any]
    units: str
    long_name: str


@dataclass(frozen=True, slots=True)
class Group:
    """Variables by name, coordinates by the dimension that they number, and attributes of the whole."""

    variables: Mapping[str, Variable]
    coordinates: Mapping[str, Variable] = field(default_factory=dict)
    attributes: Mapping[str, object] = field(default_factory=dict)


def variable(dims: tuple[str, ...], values: object, units: str, long_name: str) -> Variable:
    """An array with its unit and its meaning."""
    array = np.asarray(values)
    return Variable(dims, array.astype(object) if array.dtype.kind == "U" else array, units, long_name)


def coordinate(dimension: str, values: Sequence[str], long_name: str) -> dict[str, Variable]:
    """A coordinate of names."""
    return {dimension: variable((dimension,), np.asarray(values, dtype=object), "1", long_name)}


def netcdf(groups: Mapping[str, Group], attributes: Mapping[str, str]) -> bytes:
    """The content of a netCDF file of these groups; where a number is missing it is nan."""
    import h5netcdf
    import h5py

    content = io.BytesIO()
    with h5netcdf.File(content, "w") as file:
        file.attrs.update(attributes)
        for path, each in groups.items():
            group = file.create_group(path)
            group.attrs.update(each.attributes)
            for name, of in {**each.coordinates, **each.variables}.items():
                for dimension, length in zip(of.dims, of.values.shape, strict=True):
                    if dimension not in group.dimensions:
                        group.dimensions[dimension] = length
                kind = h5py.string_dtype() if of.values.dtype == object else of.values.dtype
                missing = np.nan if of.values.dtype.kind == "f" and name not in each.coordinates else None
                made = group.create_variable(name, of.dims, kind, data=of.values, fillvalue=missing)
                made.attrs.update({"units": of.units, "long_name": of.long_name})
    return content.getvalue()
