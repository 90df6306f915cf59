"""MATLAB files of version 5 to 7, for the few kinds of variable that a linear model is made of."""

from pathlib import Path
from typing import Any

from microrad.core.folder import read_bytes
from microrad.core.matlab_file import MatlabFile, MatlabFileError, Structure, Unread
from microrad.export.records import ExportError

__all__ = ["MOST_BYTES", "Structure", "Unread", "load"]

MOST_BYTES = 64_000_000
"""Bytes of a file, and of what it unpacks to, beyond which it holds no linear model."""
_SAVE = "s = struct('A', sys.A, 'B', sys.B, 'C', sys.C, 'D', sys.D, 'Ts', sys.Ts); save('model.mat', 's', '-v7')"


def load(path: Path) -> dict[str, Any]:
    """Variables by name: arrays of numbers, arrays of objects for cells, str, `Structure` and `Unread`.

    Raises ExportError for a file that cannot be read: missing, too large, damaged, nested too deep, version 7.3.
    """
    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise ExportError(f"{path} has {size} bytes; a linear model has at most {MOST_BYTES}: is it a recording?")
        head = read_bytes(path, 10)
        if head == b"MATLAB 7.3" or head[:8] == b"\x89HDF\r\n\x1a\n":
            raise ExportError(f"{path} is of version 7.3; save it as version 7: {_SAVE}")
        return MatlabFile(path, MOST_BYTES, whole=True).variables
    except OSError as error:
        raise ExportError(f"{path} cannot be read ({error.strerror or error}); check the path") from error
    except MatlabFileError as error:
        raise ExportError(f"{path} is no MATLAB file that can be read: {error}. Save it again: {_SAVE}") from error
