"""HDF5 files, MATLAB's version 7.3 among them; datasets are named `group/dataset`. No other file is ever opened."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from microrad.lab.recording.arrays import (
    RATE_NAMES,
    STEP_NAMES,
    UNIT_NAMES,
    ArraySource,
    Variable,
    channels_of,
    stated_rate,
)
from microrad.lab.recording.files import sha256_of
from microrad.lab.recording.hdf5_datasets import ELSEWHERE, attribute, check_pieces, matlab_class, unusable_dataset
from microrad.lab.recording.records import RecordingError
from microrad.lab.recording.sources import StatedRate, damaged, missing_library

_MOST_DEEP = 50


class Hdf5Source(ArraySource):
    """An HDF5 file. MATLAB stores arrays transposed: `matlab` turns their axes round."""

    def __init__(self, path: Path, matlab: bool = False) -> None:
        """List the datasets, and the scalars and attributes that state a rate."""
        try:
            import h5py
        except ImportError:
            raise missing_library(path, "an HDF5 file", "h5py") from None
        kind = "a MATLAB v7.3 file" if matlab else "an HDF5 file"
        self.variables = []
        unusable: dict[str, str] = {}
        stated: dict[str, list[StatedRate]] = {}
        try:
            with h5py.File(path, "r") as file:
                self._search(file, path, matlab, unusable, stated)
        except RecordingError:
            raise
        except Exception as error:  # a damaged file may raise OSError, KeyError, RuntimeError and more
            raise damaged(path, kind, error) from None
        channels = channels_of(self.variables, unusable)
        rates = {group: tuple(found) for group, found in stated.items()}
        super().__init__(path, kind.split(" ", 1)[1].removesuffix(" file"), channels, sha256_of(path), unusable, rates)

    def _search(
        self, file: Any, path: Path, matlab: bool, unusable: dict[str, str], stated: dict[str, list[StatedRate]]
    ) -> None:
        import h5py

        def visit(name: str, item: Any) -> None:
            _check_depth(path, name)
            if name.startswith("#"):  # MATLAB's store of cells and references
                return
            _note_rates(stated, name, item.attrs, name)
            if not isinstance(item, h5py.Dataset):
                return
            reason = unusable_dataset(path, item)
            if reason:
                unusable[name] = reason
                return
            self.variables.append(_variable(path, name, item, matlab))
            if item.size == 1 and item.dtype.kind in "iuf":
                check_pieces(path, name, item)
                _add(stated, name.rpartition("/")[0], stated_rate(name, item[()]))

        def visit_link(name: str, link: Any) -> None:
            _check_depth(path, name)
            if isinstance(link, h5py.ExternalLink):
                unusable[name] = f"is a link into another file, {ELSEWHERE}"

        _note_rates(stated, "", file.attrs, "")
        file.visititems(visit)
        file.visititems_links(visit_link)

    def rates(self, indices: Any) -> list[StatedRate]:
        """Rates of the dataset's own attributes, else of the nearest group above it."""
        found: list[StatedRate] = []
        for index in indices:
            at = self.names[index].partition("[")[0]
            while at and at not in self.stated:
                at = at.rpartition("/")[0]
            found.extend(self.stated.get(at, ()))
        return list(dict.fromkeys(found))


def _check_depth(path: Path, name: str) -> None:
    """Refuse what lies so deep that the library takes minutes to get there."""
    if name.count("/") > _MOST_DEEP:
        raise RecordingError(
            f"{path}: groups are nested more than {_MOST_DEEP} deep, which no recording needs; copy the datasets into "
            "a file of their own."
        )


def _add(stated: dict[str, list[StatedRate]], group: str, rate: StatedRate | None) -> None:
    if rate is not None:
        stated.setdefault(group, []).append(rate)


def _note_rates(stated: dict[str, list[StatedRate]], group: str, attributes: Mapping[str, Any], where: str) -> None:
    for name in attributes:
        if name.casefold() in RATE_NAMES | STEP_NAMES:
            _add(stated, group, stated_rate(f"{where}/{name}" if where else name, attribute(attributes, name)))


def _unit(attributes: Mapping[str, Any]) -> str:
    for name in UNIT_NAMES:
        value = attribute(attributes, name)
        if isinstance(value, bytes):
            return value.decode("utf-8", "replace")
        if isinstance(value, str):
            return value
    return ""


def _variable(path: Path, name: str, item: Any, matlab: bool) -> Variable:
    def load(key: tuple[int | slice, ...]) -> Any:
        import h5py

        with h5py.File(path, "r") as file:
            check_pieces(path, name, file[name])
            return file[name][key[::-1] if matlab else key]

    logical = matlab_class(item) == "logical" or (not matlab_class(item) and "MATLAB_int_decode" in item.attrs)
    dtype = np.dtype(bool) if logical and item.dtype.itemsize == 1 else item.dtype
    return Variable(name, item.shape[::-1] if matlab else item.shape, dtype, load, _unit(item.attrs))
