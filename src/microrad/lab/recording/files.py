"""The file before its numbers: does it exist, how big is it, and what is it in truth?"""

import difflib
import hashlib
import math
from collections.abc import Sequence
from pathlib import Path

from microrad.core.folder import read_bytes
from microrad.lab.recording.records import RecordingError

MAX_BYTES = 2_000_000_000
_UNPACKED_BYTES, _UNPACKED_TIMES = 256_000_000, 20
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_FORMAT_NAMES = {
    "tdms": "a LabVIEW TDMS file",
    "lvm": "a LabVIEW measurement file",
    "mat": "a MATLAB file",
    "mat73": "a MATLAB v7.3 file",
    "npy": "a NumPy array",
    "npz": "a NumPy archive",
    "hdf5": "an HDF5 file",
    "text": "text",
}
_SUFFIXES = {
    ".tdms": ("tdms",),
    ".lvm": ("lvm", "text"),
    ".mat": ("mat", "mat73"),
    ".npy": ("npy",),
    ".npz": ("npz",),
    ".h5": ("hdf5", "mat73"),
    ".hdf5": ("hdf5", "mat73"),
    ".hdf": ("hdf5", "mat73"),
}
_RIGHT_SUFFIX = {"tdms": ".tdms", "mat": ".mat", "mat73": ".mat", "npy": ".npy", "npz": ".npz", "hdf5": ".h5"}
_STARTS = {
    "tdms": "'TDSm'",
    "mat": "'MATLAB 5.0 MAT-file' or the HDF5 signature",
    "npy": "'NUMPY'",
    "npz": "a ZIP signature",
    "hdf5": "the HDF5 signature",
}


def check_file(path: Path) -> None:
    """Refuse what is not a regular, readable file with a content of at most `MAX_BYTES`."""
    try:
        if path.is_dir():
            raise RecordingError(f"{path}: this is a directory; name one file in it.")
        if not path.exists():
            raise RecordingError(f"{path}: there is no such file; check the path{_nearest_file(path)}.")
        if not path.is_file():
            raise RecordingError(f"{path}: this is not a regular file; copy the data into a file first.")
        size = path.stat().st_size
    except (OSError, ValueError) as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(f"{path}: the file cannot be examined ({error}); check path and permissions.") from None
    if size == 0:
        raise RecordingError(f"{path}: the file is empty; record again or name another file.")
    if size > MAX_BYTES:
        raise RecordingError(
            f"{path}: the file has {size / 1e9:.1f} GB and at most {MAX_BYTES / 1e9:.0f} GB are read, because the "
            "columns are held in memory; cut out the part you need or keep every n-th sample."
        )


def _nearest_file(path: Path) -> str:
    try:
        names = [p.name for p in path.parent.iterdir()]
    except OSError:
        return ""
    near = difflib.get_close_matches(path.name, names, n=1)
    return f" (nearest name in that directory: '{near[0]}')" if near else ""


def read_head(path: Path, size: int) -> bytes:
    """The first bytes of the file."""
    try:
        return read_bytes(path, size)
    except OSError as error:
        raise RecordingError(f"{path}: the file cannot be read ({error}); check its permissions.") from None


def most_unpacked(path: Path) -> int:
    """Bytes that an array of a file may unpack to: no recording packs better, and a few kB could fill the memory."""
    return min(max(_UNPACKED_BYTES, _UNPACKED_TIMES * path.stat().st_size), MAX_BYTES)


def too_large(path: Path, shape: Sequence[int], itemsize: int) -> str:
    """Words for an array that states more than its file may unpack to; empty for any other."""
    size, most = math.prod(shape) * itemsize, most_unpacked(path)
    if size <= most:
        return ""
    return (
        f"states {max(shape):.4g} samples, {size / 1e6:.4g} MB in a file of {path.stat().st_size / 1e6:.3g} MB, and at "
        f"most {most / 1e6:.4g} MB are unpacked from that; cut out the part that you need, or save it without "
        "compression"
    )


def sha256_of(path: Path) -> str:
    """SHA-256 of the file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def file_format(path: Path) -> str:
    """The format by content: tdms, lvm, mat, mat73, npy, npz, hdf5 or text.

    Raises `RecordingError` where the content and the suffix of the name contradict each other, and for an index file,
    an old or a compressed one.
    """
    head = read_head(path, 1024)
    found = _content(path, head)
    suffix = path.suffix.lower()
    expected = _SUFFIXES.get(suffix)
    if expected is None:
        if found not in ("text", "lvm"):
            right = _RIGHT_SUFFIX[found]
            raise RecordingError(
                f"{path}: the name ends in '{suffix}' and the content is {_FORMAT_NAMES[found]}; rename the file to "
                f"'{path.stem}{right}', so that nobody takes it for something else."
            )
        return found
    if found not in expected:
        hint = f"; rename it to '{path.stem}{_RIGHT_SUFFIX[found]}'" if found in _RIGHT_SUFFIX else ""
        start = head[:24].decode("latin-1").encode("ascii", "backslashreplace").decode().splitlines()[0]
        if found in ("text", "lvm"):
            hint = (
                f"; if it is text, rename it to '{path.stem}.{'csv' if found == 'text' else 'lvm'}', else record again"
            )
        raise RecordingError(
            f"{path}: the name says {_FORMAT_NAMES[expected[0]]}, which begins with "
            f"{_STARTS.get(expected[0], 'its header')}, and the first bytes are '{start}'{hint}."
        )
    return found


def _content(path: Path, head: bytes) -> str:
    if head.startswith(b"TDSh"):
        raise RecordingError(
            f"{path}: this is the index that LabVIEW writes beside a TDMS file, without the data; name the .tdms file."
        )
    if head.startswith((b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"7z\xbc\xaf")):
        raise RecordingError(f"{path}: the file is compressed; unpack it first.")
    if head.startswith(b"MATLAB 7.3") or (head.startswith(b"MATLAB") and _HDF5_SIGNATURE in head):
        return "mat73"
    starts = {b"TDSm": "tdms", b"MATLAB 5.0": "mat", b"\x93NUMPY": "npy", b"PK\x03\x04": "npz", _HDF5_SIGNATURE: "hdf5"}
    for start, name in starts.items():
        if head.startswith(start):
            return name
    if head.removeprefix(b"\xef\xbb\xbf").lstrip(b'"').startswith(b"LabVIEW Measurement"):
        return "lvm"
    if path.suffix.lower() == ".mat" and b"\x00" in head[:20]:
        raise RecordingError(
            f"{path}: this is not a MATLAB file of version 5 or later; load it in MATLAB and save it with -v7."
        )
    return "text"
