"""HDF5 files, MATLAB's version 7.3 among them; datasets are named `group/dataset`. No other file is ever opened."""

import math
import mmap
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from microrad.lab.recording.files import sha256_of, too_large
from microrad.lab.recording.formats.arrays import (
    RATE_NAMES,
    STEP_NAMES,
    UNIT_NAMES,
    ArraySource,
    Variable,
    channels_of,
    stated_rate,
)
from microrad.lab.recording.formats.source import StatedRate, damaged
from microrad.lab.recording.records import RecordingError

ELSEWHERE = "and no other file is opened; copy the values into this one"
"""What is done about data that stand in another file."""
_DEFLATE, _SHUFFLE, _FLETCHER32, _LZF = 1, 2, 3, 32000
_FILTERS = frozenset({_DEFLATE, _SHUFFLE, _FLETCHER32, _LZF})
_UNCHECKED = frozenset({4, 5, 6})  # szip, n-bit and scale-offset: how much a piece holds is known once it is unpacked
_PACKERS = frozenset({_DEFLATE, _LZF})
_MATLAB_NUMBERS = frozenset(
    ["double", "single", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "logical"]
)


def unusable_dataset(path: Path, item: Any) -> str:
    """Why a dataset is no channel and what to do, in words that follow its name; empty for one that may be.

    Args:
        path: The file.
        item: The dataset as h5py gives it.
    """
    # The order matters: the shape of a virtual dataset may ask for its files.
    if item.external or item.is_virtual:
        return f"takes its values from other files, {ELSEWHERE}"
    return _by_matlab(item) or _by_type(item) or _foreign_filter(item) or _too_large(path, item)


def attribute(attributes: Mapping[str, Any], name: str) -> Any:
    """An attribute's value; None where there is none or it is of a type that NumPy does not know.

    Args:
        attributes: The attributes as h5py gives them.
        name: Name of the one wanted.
    """
    try:
        return attributes.get(name)
    except TypeError:
        return None


def matlab_class(item: Any) -> str:
    """The class that MATLAB's version 7.3 states of a variable, else nothing."""
    value = attribute(item.attrs, "MATLAB_class")
    return value.decode("ascii", "replace") if isinstance(value, bytes) else str(value or "")


def _by_matlab(item: Any) -> str:
    """By what MATLAB states beside its values."""
    if attribute(item.attrs, "MATLAB_empty"):
        return _EMPTY
    if attribute(item.parent.attrs, "MATLAB_sparse") is not None:
        return "is part of a sparse matrix; save it as full"
    kind = matlab_class(item)
    return "" if not kind or kind in _MATLAB_NUMBERS else _MATLAB_WORDS.get(kind, _OBJECT)


def _by_type(item: Any) -> str:
    try:
        dtype = item.dtype
    except TypeError as error:
        return f"has a type that is not read ({error}); save it as floating-point numbers"
    if h5py.check_string_dtype(dtype):
        return _TEXT
    if h5py.check_ref_dtype(dtype):
        return "holds references to other data (cells, or an array of structures, in MATLAB); save these as arrays"
    if dtype.hasobject:
        return "holds rows of different lengths; save each as an array"
    return _EMPTY if item.shape is None or 0 in item.shape else ""


_EMPTY = "holds no samples; record again, or name another"
_TEXT = "holds text, not real numbers; save numbers, or name another"
_OBJECT = "is an object of MATLAB, which only MATLAB reads; save its numbers as arrays"
_MATLAB_WORDS = {"char": _TEXT, "cell": "holds cells; save the numbers of each cell as an array"}


def _filters(item: Any) -> list[tuple[int, str]]:
    """Numbers and names of the filters that pack a dataset, in their order."""
    made = item.id.get_create_plist()
    found = (made.get_filter(number) for number in range(made.get_nfilters()))
    return [(code, name.decode("ascii", "replace").split(";")[0]) for code, _, _, name in found]


def _foreign_filter(item: Any) -> str:
    filters = _filters(item)
    for code, name in filters:
        if code in _UNCHECKED:
            return f"is packed by the filter {code} ({name}), whose pieces cannot be checked; {_REPACK}"
        if code not in _FILTERS or not h5py.h5z.filter_avail(code):
            return (
                f"is packed by the filter {code}{f' ({name})' if name else ''}, which is none of HDF5's own; {_REPACK}"
            )
    return f"is packed twice over; {_REPACK}" if sum(code in _PACKERS for code, _ in filters) > 1 else ""


_REPACK = "pack it with gzip or not at all (h5repack -f GZIP=1 old.h5 new.h5)"


def _too_large(path: Path, item: Any) -> str:
    """Of the values, and of the pieces that they are stored in: a piece is unpacked whole."""
    size = item.dtype.itemsize
    whole = too_large(path, item.shape, size)
    piece = too_large(path, item.chunks, size) if item.chunks else ""
    return whole or (f"is stored in pieces, each of which {piece}" if piece else "")


def check_pieces(path: Path, name: str, item: Any) -> None:
    """Check that each piece of a dataset unpacks to the number of bytes that it states.

    For a piece that holds more the library would make room for all of it; behind one that holds less it would read on
    in the memory.

    Args:
        path: The file, for the message.
        name: Name of the dataset, for the message.
        item: The dataset as h5py gives it.

    Raises:
        RecordingError: If a piece unpacks to another number of bytes.
    """
    if item.chunks is None:
        return
    codes = [code for code, _ in _filters(item)]
    stated = math.prod(item.chunks) * item.id.get_type().get_size()
    offsets: list[tuple[int, ...]] = []
    item.id.chunk_iter(lambda piece: offsets.append(piece.chunk_offset))
    for offset in offsets:
        mask, data = item.id.read_direct_chunk(offset)
        # A bit of the mask leaves a filter out.
        active = [code for number, code in enumerate(codes) if not mask >> number & 1]
        found = _unpacked_bytes(data, active, stated)
        if found != stated:
            amount = "more" if found > stated else "less"
            raise RecordingError(
                f"{path}: '{name}' has a piece, from sample {offset} on, that unpacks to {amount} than the {stated} "
                "bytes that it states; the file is damaged, or made to do harm: copy it again from its source."
            )


def _unpacked_bytes(data: bytes, filters: Sequence[int], stated: int) -> int:
    """Bytes that a piece unpacks to, counted up to one more than it states."""
    size = len(data)
    for code in reversed(filters):
        if code == _FLETCHER32:
            size -= 4
        elif code == _DEFLATE:
            size = _inflated_bytes(data[: max(size, 0)], stated)
        elif code == _LZF:
            size = _lzf_bytes(data[: max(size, 0)])
    return size


def _inflated_bytes(data: bytes, stated: int) -> int:
    stream = zlib.decompressobj()
    try:
        size = len(stream.decompress(data, stated + 1))
    except zlib.error:
        return 0
    return size if stream.eof or size > stated else 0  # cut off: nobody knows how much it was


def _lzf_bytes(data: bytes) -> int:
    """Bytes that LZF unpacks to: runs of 1 to 32 bytes as they are, and copies of 3 to 264 bytes that were before."""
    place = size = 0
    while place < len(data):
        control = data[place]
        if control < 32:
            place += control + 2
            size += control + 1
            continue
        length, far = control >> 5, (control & 31) << 8
        place += 1
        if length == 7:
            length += data[place] if place < len(data) else 0
            place += 1
        far += (data[place] if place < len(data) else 0) + 1
        place += 1
        if far > size:
            return 0
        size += length + 2
    return size if place == len(data) else 0


_HEAP = b"GCOL\x01\0\0\0"


def check_heaps(path: Path, length_bytes: int) -> None:
    """Check that each global heap, where texts and rows of various lengths are stored, has an end.

    In one with a free space of no bytes, or with an entry longer than the file, the library may look for the next entry
    for ever. Source: HDF5 File Format Specification 3.0, III.E, "Global Heap".

    Args:
        path: The file.
        length_bytes: Bytes of a length in it, which its head states.

    Raises:
        RecordingError: If a heap has no end.
    """
    header = 8 + -(-length_bytes // 8) * 8  # of a heap, and of each entry
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:

        def number(place: int, size: int) -> int:
            return int.from_bytes(content[place : place + size], "little")

        heap = content.find(_HEAP)
        while heap >= 0:
            place, end = heap + header, min(heap + number(heap + 8, length_bytes), len(content))
            while place + header <= end:
                size = number(place + 8, length_bytes)
                size = header + size if number(place, 2) else size  # entry 0 is the free space, its header included
                if not 0 < size <= len(content):
                    raise RecordingError(
                        f"{path}: a store of texts in it, at byte {heap}, has no end; the file is damaged, or made to "
                        "do harm: copy it again from its source."
                    )
                place += -(-size // 8) * 8
            heap = content.find(_HEAP, heap + 1)


_MOST_DEEP = 50


class Hdf5Source(ArraySource):
    """An HDF5 file. MATLAB stores arrays transposed: `matlab` turns their axes round."""

    def __init__(self, path: Path, matlab: bool = False) -> None:
        """List the datasets, and the scalars and attributes that state a rate."""
        kind = "a MATLAB v7.3 file" if matlab else "an HDF5 file"
        self.variables = []
        unusable: dict[str, str] = {}
        stated: dict[str, tuple[StatedRate, ...]] = {}
        try:
            with h5py.File(path, "r") as file:
                check_heaps(path, file.id.get_create_plist().get_sizes()[1])
                self._search(file, path, matlab, unusable, stated)
        except RecordingError:
            raise
        except Exception as error:  # a damaged file may raise OSError, KeyError, RuntimeError and more
            raise damaged(path, kind, error) from None
        channels = channels_of(self.variables, unusable)
        super().__init__(path, kind.split(" ", 1)[1].removesuffix(" file"), channels, sha256_of(path), unusable, stated)

    def _search(
        self, file: Any, path: Path, matlab: bool, unusable: dict[str, str], stated: dict[str, tuple[StatedRate, ...]]
    ) -> None:
        def note(group: str, name: str, value: Any) -> None:
            if rate := stated_rate(name, value):
                stated[group] = (*stated.get(group, ()), rate)

        def note_attributes(group: str, attributes: Mapping[str, Any]) -> None:
            for name in attributes:
                if name.casefold() in RATE_NAMES | STEP_NAMES:
                    note(group, f"{group}/{name}" if group else name, attribute(attributes, name))

        def visit(name: str, item: Any) -> None:
            _check_depth(path, name)
            if name.startswith("#"):  # MATLAB's store of cells and references
                return
            note_attributes(name, item.attrs)
            if not isinstance(item, h5py.Dataset):
                return
            if reason := unusable_dataset(path, item):
                unusable[name] = reason
                return
            self.variables.append(_variable(path, name, item, matlab))
            if item.size == 1 and item.dtype.kind in "iuf":
                check_pieces(path, name, item)
                note(name.rpartition("/")[0], name, item[()])

        def visit_link(name: str, link: Any) -> None:
            _check_depth(path, name)
            if isinstance(link, h5py.ExternalLink):
                unusable[name] = f"is a link into another file, {ELSEWHERE}"

        note_attributes("", file.attrs)
        file.visititems(visit)
        file.visititems_links(visit_link)


def _check_depth(path: Path, name: str) -> None:
    """Raises RecordingError if groups are so deep that the library would take minutes to get there."""
    if name.count("/") > _MOST_DEEP:
        raise RecordingError(
            f"{path}: groups are nested more than {_MOST_DEEP} deep, which no recording needs; copy the datasets into "
            "a file of their own."
        )


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
        with h5py.File(path, "r") as file:
            check_pieces(path, name, file[name])
            return file[name][key[::-1]].T if matlab else file[name][key]

    logical = matlab_class(item) == "logical" or (not matlab_class(item) and "MATLAB_int_decode" in item.attrs)
    dtype = np.dtype(bool) if logical and item.dtype.itemsize == 1 else item.dtype
    return Variable(name, item.shape[::-1] if matlab else item.shape, dtype, load, _unit(item.attrs))
