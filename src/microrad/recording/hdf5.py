"""HDF5 files, MATLAB's version 7.3 among them; datasets are named `group/dataset`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from microrad.recording.arrays import (
    RATE_NAMES,
    STEP_NAMES,
    UNIT_NAMES,
    ArraySource,
    Variable,
    channels_of,
    stated_rate,
)
from microrad.recording.files import sha256_of
from microrad.recording.sources import StatedRate, damaged, missing_library


class Hdf5Source(ArraySource):
    """An HDF5 file. MATLAB stores arrays transposed: `matlab` turns their axes round."""

    def __init__(self, path: Path, matlab: bool = False) -> None:
        """List the datasets, and the scalars and attributes that state a rate."""
        try:
            import h5py
        except ImportError:
            raise missing_library(path, "an HDF5 file", "h5py") from None
        kind = "MATLAB v7.3" if matlab else "HDF5"
        self.variables = []
        self._path = path
        stated: dict[str, list[StatedRate]] = {}
        try:
            with h5py.File(path, "r") as file:
                _note_rates(stated, "", file.attrs, "")

                def visit(name: str, item: Any) -> None:
                    if name.startswith("#"):  # MATLAB's store of cells and references
                        return
                    is_dataset = isinstance(item, h5py.Dataset)
                    _note_rates(stated, name, item.attrs, name)
                    if is_dataset and not item.attrs.get("MATLAB_empty", 0):
                        self.variables.append(_variable(path, name, item, matlab))
                        if item.size == 1 and item.dtype.kind in "iuf":
                            _add(stated, name.rpartition("/")[0], stated_rate(name, item[()]))

                file.visititems(visit)
        except Exception as error:  # a damaged file may raise OSError, KeyError, RuntimeError and more
            raise damaged(path, f"an {kind} file" if kind == "HDF5" else f"a {kind} file", error) from None
        unusable: dict[str, str] = {}
        channels = channels_of(self.variables, unusable)
        rates = {group: tuple(found) for group, found in stated.items()}
        super().__init__(path, kind, channels, sha256_of(path), unusable, rates)

    def rates(self, indices: Any) -> list[StatedRate]:
        """Rates of the dataset's own attributes, else of the nearest group above it."""
        found: list[StatedRate] = []
        for index in indices:
            at = self.names[index].partition("[")[0]
            while at and at not in self.stated:
                at = at.rpartition("/")[0]
            found.extend(self.stated.get(at, ()))
        return list(dict.fromkeys(found))


def _add(stated: dict[str, list[StatedRate]], group: str, rate: StatedRate | None) -> None:
    if rate is not None:
        stated.setdefault(group, []).append(rate)


def _note_rates(stated: dict[str, list[StatedRate]], group: str, attributes: Mapping[str, Any], where: str) -> None:
    for name in attributes:
        if name.casefold() in RATE_NAMES | STEP_NAMES:
            _add(stated, group, stated_rate(f"{where}/{name}" if where else name, attributes[name]))


def _unit(attributes: Mapping[str, Any]) -> str:
    for name in UNIT_NAMES:
        value = attributes.get(name)
        if isinstance(value, bytes):
            return value.decode("utf-8", "replace")
        if isinstance(value, str):
            return value
    return ""


def _variable(path: Path, name: str, item: Any, matlab: bool) -> Variable:
    def load(key: tuple[int | slice, ...]) -> Any:
        import h5py

        with h5py.File(path, "r") as file:
            return file[name][key[::-1] if matlab else key]

    dtype = np.dtype(bool) if "MATLAB_int_decode" in item.attrs and item.dtype.itemsize == 1 else item.dtype
    if item.attrs.get("MATLAB_class") in (b"char", b"cell", b"string"):
        dtype = np.dtype(object) if item.attrs["MATLAB_class"] == b"cell" else np.dtype("S1")
    return Variable(name, item.shape[::-1] if matlab else item.shape, dtype, load, _unit(item.attrs))
