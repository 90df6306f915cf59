"""NumPy arrays (.npy) and archives of them (.npz); pickled objects are never loaded."""

import io
import struct
import zipfile
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np

from microrad.lab.recording.files import sha256_of, too_large
from microrad.lab.recording.formats.arrays import ArraySource, Variable, channels_of, rates_of
from microrad.lab.recording.formats.source import StatedRate, damaged
from microrad.lab.recording.records import RecordingError

_LENGTHS = {(1, 0): "<H", (2, 0): "<I", (3, 0): "<I"}
_MOST_HEADER = 10_000  # NumPy's own bound, which it looks at once the header is read
_NO_OBJECTS = (
    "holds Python objects, which are pickled and not read, because loading them could run code; save them as plain "
    "numbers, array.astype(float)"
)


class NumpySource(ArraySource):
    """An .npy file, whose array is called `data`, or an .npz archive."""

    def __init__(self, path: Path, archive: bool) -> None:
        """Read the headers of the arrays, and the scalars that state a rate."""
        unusable: dict[str, str] = {}
        try:
            self.variables = _of_archive(path, unusable) if archive else [_of_file(path)]
        except RecordingError:
            raise
        except Exception as error:  # zipfile and numpy raise many kinds for a damaged file
            raise damaged(path, "a NumPy file", error) from None
        unusable |= {v.name: _NO_OBJECTS for v in self.variables if v.dtype.hasobject}
        self.variables = [v for v in self.variables if not v.dtype.hasobject]
        channels = channels_of(self.variables, unusable)
        rates: tuple[StatedRate, ...] = sum(rates_of(self.variables).values(), ())
        super().__init__(path, "NumPy", channels, sha256_of(path), unusable, {"": rates})


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type; a header states its own length, which is bounded before it is read."""
    version = np.lib.format.read_magic(file)
    if version not in _LENGTHS:
        raise ValueError(f"version {version[0]}.{version[1]} of the format is not known")
    stated = file.read(struct.calcsize(_LENGTHS[version]))
    (length,) = struct.unpack(_LENGTHS[version], stated)
    if length > _MOST_HEADER:
        raise ValueError(f"a header of {length} bytes, where {_MOST_HEADER} are enough for any array")
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(io.BytesIO(stated + file.read(length)))
    if not all(type(axis) is int and axis >= 0 for axis in shape):
        raise ValueError(f"the shape {shape} is none")
    return shape, dtype


def _of_file(path: Path) -> Variable:
    with path.open("rb") as file:
        shape, dtype = _header(file)
        needed = int(np.prod(shape, dtype=object)) * dtype.itemsize
        present = path.stat().st_size - file.tell()
    if needed > present and not dtype.hasobject:
        raise RecordingError(
            f"{path}: the array of shape {shape} needs {needed} bytes and {present} are there; the file is truncated: "
            "copy it again from its source."
        )
    return Variable("data", shape, dtype, lambda key: np.load(path, mmap_mode="r", allow_pickle=False)[key])


def _of_archive(path: Path, unusable: dict[str, str]) -> list[Variable]:
    variables = []
    with zipfile.ZipFile(path) as archive:
        for member in archive.infolist():
            name = member.filename.removesuffix(".npy")
            if name == member.filename:
                unusable[name] = "is no NumPy array; name another, or add it with numpy.savez"
                continue
            with archive.open(member) as file:
                shape, dtype = _header(file)
            # The pickle of objects has a size of its own; they are refused for what they are.
            if not dtype.hasobject and (reason := _unfit(path, shape, dtype.itemsize, member.file_size)):
                unusable[name] = reason
                continue
            variables.append(Variable(name, shape, dtype, partial(_load, path, name)))
    return variables


def _unfit(path: Path, shape: tuple[int, ...], itemsize: int, present: int) -> str:
    """Why an array of the archive cannot be read, in words; empty where it can."""
    if int(np.prod(shape, dtype=object)) * itemsize > present:
        return (
            f"is truncated, an array of shape {shape} does not fit into {present} bytes; copy the file again from its "
            "source"
        )
    return too_large(path, shape, itemsize)


def _load(path: Path, name: str, key: tuple[int | slice, ...]) -> Any:
    with np.load(path, allow_pickle=False) as archive:
        return archive[name][key]
