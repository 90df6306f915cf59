"""Whether a file can be read at all, and which format it has by its content."""

import difflib
import hashlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from microrad.core.folder import read_bytes
from microrad.core.units import plain
from microrad.lab.recording.records import RecordingError

MAX_BYTES = 2_000_000_000
_UNPACKED_BYTES, _UNPACKED_TIMES = 256_000_000, 20
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


class _Format(NamedTuple):
    """A format: its name here and in words, the suffixes that it may have (the usual one first), how it begins."""

    name: str
    words: str
    suffixes: tuple[str, ...]
    begins: str = "its header"
    signature: bytes | None = None


_FORMATS = (
    _Format("tdms", "a LabVIEW TDMS file", (".tdms",), "'TDSm'", b"TDSm"),
    _Format("lvm", "a LabVIEW measurement file", (".lvm",)),
    _Format("mat", "a MATLAB file", (".mat",), "'MATLAB 5.0 MAT-file' or the HDF5 signature", b"MATLAB 5.0"),
    _Format("npy", "a NumPy array", (".npy",), "'NUMPY'", b"\x93NUMPY"),
    _Format("npz", "a NumPy archive", (".npz",), "a ZIP signature", b"PK\x03\x04"),
    _Format("hdf5", "an HDF5 file", (".h5", ".hdf5", ".hdf"), "the HDF5 signature", _HDF5_SIGNATURE),
    _Format("mat73", "a MATLAB v7.3 file", (".mat", ".h5", ".hdf5", ".hdf")),
    _Format("text", "text", (".csv", ".lvm")),
)
_BY_NAME = {each.name: each for each in _FORMATS}


def check_file(path: Path) -> None:
    """Check a file; raises RecordingError if it cannot be read, is empty or has more than `MAX_BYTES`."""
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
    """The first bytes of the file.

    Args:
        path: The file.
        size: Number of bytes read, fewer where the file is shorter.

    Raises:
        RecordingError: If the file cannot be read.
    """
    try:
        return read_bytes(path, size)
    except OSError as error:
        raise RecordingError(f"{path}: the file cannot be read ({error}); check its permissions.") from None


def most_unpacked(path: Path) -> int:
    """Largest number of bytes that an array of a file may unpack to, as a small file could claim to fill the memory."""
    return min(max(_UNPACKED_BYTES, _UNPACKED_TIMES * path.stat().st_size), MAX_BYTES)


def too_large(path: Path, shape: Sequence[int], itemsize: int) -> str:
    """Why an array cannot be read that states more than its file may unpack to; empty where it can.

    Args:
        path: The file.
        shape: Shape that the array states.
        itemsize: Bytes of one number.
    """
    size, most = math.prod(shape) * itemsize, most_unpacked(path)
    if size <= most:
        return ""
    return (
        f"states {plain(max(shape), 4)} samples, {plain(size / 1e6, 4)} MB in a file of "
        f"{plain(path.stat().st_size / 1e6)} MB, and at most {plain(most / 1e6, 4)} MB are unpacked "
        "from that; cut out the part that you need, or save it without compression"
    )


def sha256_of(path: Path) -> str:
    """SHA-256 of the file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def file_format(path: Path) -> str:
    """The format by content: tdms, lvm, mat, mat73, npy, npz, hdf5 or text.

    Raises RecordingError if content and suffix contradict each other, or if the file is an index, old or compressed.
    """
    head = read_head(path, 1024)
    found = _BY_NAME[_content(path, head)]
    suffix = path.suffix.lower()
    expected = [each for each in _FORMATS if suffix in each.suffixes and suffix != ".csv"]
    is_text = found.name in ("text", "lvm")
    renamed = f"{path.stem}{found.suffixes[0]}"
    if not expected and not is_text:
        raise RecordingError(
            f"{path}: the name ends in '{suffix}' and the content is {found.words}; rename the file to '{renamed}', so "
            "that nobody takes it for something else."
        )
    if expected and found not in expected:
        start = head[:24].decode("latin-1").encode("ascii", "backslashreplace").decode().splitlines()[0]
        advice = (
            f"if it is text, rename it to '{renamed}', else record again" if is_text else f"rename it to '{renamed}'"
        )
        raise RecordingError(
            f"{path}: the name says {expected[0].words}, which begins with {expected[0].begins}, and the first bytes "
            f"are '{start}'; {advice}."
        )
    return found.name


def _content(path: Path, head: bytes) -> str:
    if head.startswith(b"TDSh"):
        raise RecordingError(
            f"{path}: this is the index that LabVIEW writes beside a TDMS file, without the data; name the .tdms file."
        )
    if head.startswith((b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"7z\xbc\xaf")):
        raise RecordingError(f"{path}: the file is compressed; unpack it first.")
    if head.startswith(b"MATLAB 7.3") or (head.startswith(b"MATLAB") and _HDF5_SIGNATURE in head):
        return "mat73"
    for each in _FORMATS:
        if each.signature and head.startswith(each.signature):
            return each.name
    if head.removeprefix(b"\xef\xbb\xbf").lstrip(b'"').startswith(b"LabVIEW Measurement"):
        return "lvm"
    if path.suffix.lower() == ".mat" and b"\x00" in head[:20]:
        raise RecordingError(
            f"{path}: this is not a MATLAB file of version 5 or later; load it in MATLAB and save it with -v7."
        )
    return "text"
