"""MATLAB files of version 5 to 7; the fields of a structure are named `structure/field`. Version 7.3 is HDF5."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from microrad.recording.arrays import ArraySource, Variable, channels_of, stated_rate
from microrad.recording.files import sha256_of
from microrad.recording.records import RecordingError
from microrad.recording.sources import StatedRate, damaged

_NUMBERS = frozenset(["double", "single", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"])


class MatlabSource(ArraySource):
    """A .mat file before version 7.3."""

    def __init__(self, path: Path) -> None:
        """List the variables without loading the arrays; structures and scalars are loaded."""
        from scipy.io import whosmat

        _check_structure(path)
        try:
            listed = whosmat(str(path))
            small = [name for name, shape, kind in listed if kind == "struct" or (kind in _NUMBERS and max(shape) == 1)]
            loaded = _load(path, small) if small else {}
            self.variables = [v for name, shape, kind in listed for v in _variables(path, name, shape, kind, loaded)]
        except Exception as error:  # scipy raises many kinds for a damaged file
            raise damaged(path, "a MATLAB file", error) from None
        unusable: dict[str, str] = {}
        channels = channels_of(self.variables, unusable)
        stated: dict[str, tuple[StatedRate, ...]] = {}
        for variable in self.variables:
            if variable.dtype.kind in "iuf" and all(n == 1 for n in variable.shape):
                rate = stated_rate(variable.name, variable.load((0,) * len(variable.shape)))
                group = variable.name.rpartition("/")[0]
                stated[group] = (*stated.get(group, ()), *([rate] if rate else []))
        super().__init__(path, "MATLAB", channels, sha256_of(path), unusable, stated)

    def rates(self, indices: Any) -> list[StatedRate]:
        """Rates of the channels' structure, else of the file."""
        found: list[StatedRate] = []
        for index in indices:
            group = self.names[index].partition("[")[0].rpartition("/")[0]
            while group and not self.stated.get(group):
                group = group.rpartition("/")[0]
            found.extend(self.stated.get(group, ()))
        return list(dict.fromkeys(found))


def _check_structure(path: Path) -> None:
    """Follow the variables to the end of the file: the library stops without a word where one is cut off.

    Each is a tag of type and size behind a header of 128 bytes ("MAT-File Format", MathWorks, chapter 1).
    """
    size, position = path.stat().st_size, 128
    with path.open("rb") as file:
        order = "<" if file.read(128)[126:128] == b"IM" else ">"
        while position < size:
            file.seek(position)
            tag = file.read(8)
            position += 8 + (struct.unpack(f"{order}II", tag)[1] if len(tag) == 8 else 8)
    if position > size:
        raise RecordingError(
            f"{path}: the last variable of the MATLAB file lacks {position - size} bytes; the file is damaged or "
            "truncated: copy it again from its source."
        )


def _load(path: Path, names: list[str]) -> dict[str, Any]:
    from scipy.io import loadmat

    values: dict[str, Any] = loadmat(str(path), variable_names=names, struct_as_record=True)
    return values


def _variables(path: Path, name: str, shape: tuple[int, ...], kind: str, loaded: dict[str, Any]) -> Iterator[Variable]:
    if kind == "struct":
        yield from _fields(name, loaded[name])
    elif kind in _NUMBERS:
        # The type of complex numbers shows on loading; the cast to float64 refuses them then.
        yield Variable(name, tuple(shape), np.dtype(float), _loader(path, name))
    else:
        other = np.dtype({"char": "S1", "logical": "?"}.get(kind, "O"))
        yield Variable(name, tuple(shape), other, _loader(path, name))


def _loader(path: Path, name: str) -> Callable[[tuple[int | slice, ...]], Any]:
    def load(key: tuple[int | slice, ...]) -> Any:
        values = _load(path, [name])[name]
        if np.iscomplexobj(values):
            raise ValueError("it holds complex numbers; save the real signal")
        return values[key]

    return load


def _fields(name: str, value: Any) -> Iterator[Variable]:
    """Arrays in a structure of one element, and in the structures within it."""
    names = value.dtype.names
    if names is None or value.size != 1:
        yield Variable(name, value.shape, value.dtype, lambda key: value[key])
        return
    for field in names:
        inner = value.reshape(-1)[0][field]
        if isinstance(inner, np.ndarray):
            yield from _fields(f"{name}/{field}", inner)
