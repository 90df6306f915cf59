"""MATLAB files of version 5 to 7; the fields of a structure are named `structure/field`. Version 7.3 is HDF5.

The structures of an array are numbered from 0, `structure[1]/field`.
"""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from microrad.core.matlab_file import Left, MatlabFile, MatlabFileError, Structure, Unread
from microrad.lab.recording.files import most_unpacked, sha256_of
from microrad.lab.recording.formats.arrays import ArraySource, Variable, channels_of, rates_of
from microrad.lab.recording.formats.source import damaged
from microrad.lab.recording.records import RecordingError


class MatlabSource(ArraySource):
    """A .mat file before version 7.3."""

    def __init__(self, path: Path) -> None:
        """List the variables; the numbers of all but short arrays stay in the file until they are asked for."""
        try:
            file = MatlabFile(path, most_unpacked(path))
        except MatlabFileError as error:
            if not error.remedy:
                raise damaged(path, "a MATLAB file", error) from None
            raise RecordingError(f"{path}: this cannot be read as a MATLAB file ({error}); {error.remedy}.") from None
        except OSError as error:
            raise damaged(path, "a MATLAB file", error) from None
        unusable: dict[str, str] = {}
        self.variables = [v for name, value in file.variables.items() for v in _variables(file, name, value, unusable)]
        channels = channels_of(self.variables, unusable)
        super().__init__(path, "MATLAB", channels, sha256_of(path), unusable, rates_of(self.variables))


def _variables(file: MatlabFile, name: str, value: Any, unusable: dict[str, str]) -> Iterator[Variable]:
    """The arrays of a variable, and of the structures within it."""
    if isinstance(value, Unread):
        unusable[name] = f"holds {value.kind}; {value.remedy}"
    elif isinstance(value, Structure):
        if not value.elements:
            unusable[name] = "is a structure without fields; name another variable"
        for number, fields in enumerate(value.elements):
            group = name if value.size == 1 else f"{name}[{number}]"
            for field, inner in fields.items():
                yield from _variables(file, f"{group}/{field}", inner, unusable)
    else:
        yield Variable(name, value.shape, value.dtype, partial(_load, file, value))


def _load(file: MatlabFile, value: Any, key: tuple[int | slice, ...]) -> Any:
    values = file.numbers(value) if isinstance(value, Left) else value
    return np.array(values[key])  # a copy lets go of the other columns
