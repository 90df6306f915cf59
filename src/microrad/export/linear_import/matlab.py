"""MATLAB files of version 5 to 7: which linear system is meant, variables of their own or the fields of a structure."""

from pathlib import Path
from typing import Any

import numpy as np

from microrad.core.folder import read_bytes
from microrad.core.matlab_file import MatlabFile, MatlabFileError, Structure, Unread
from microrad.export.matrices.structure import LARGEST
from microrad.export.records import ExportError

FORMS = (("A", "B", "C", "D"), ("z", "p", "k"), ("num", "den"))
"""What makes a linear system, the first one that is whole counts."""

MOST_BYTES = 64_000_000
"""Bytes of a file, and of what it unpacks to, beyond which it holds no linear model."""
_SAVE = "s = struct('A', sys.A, 'B', sys.B, 'C', sys.C, 'D', sys.D, 'Ts', sys.Ts); save('model.mat', 's', '-v7')"


def load(path: Path) -> dict[str, Any]:
    """Variables by name: arrays of numbers, arrays of objects for cells, str, `Structure` and `Unread`.

    Raises:
        ExportError: For a file that cannot be read: missing, too large, damaged, nested too deep, version 7.3.
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


def select(path: Path, variable: str | None) -> tuple[str, dict[str, Any]]:
    """The linear system of a file: the name of its structure, and its fields by name.

    The name is "" where the system's matrices are variables of their own.

    Args:
        path: The MATLAB file, version 5 to 7.
        variable: Name of the structure, "" for variables of their own; None takes the only system.

    Raises:
        ExportError: For a file that cannot be read, that has no such system or several of which none is chosen, or that
            holds an object or an array of structures in place of one.
    """
    variables = load(path)
    systems = _systems(path, variables)
    if variable is not None:
        if variable not in systems:
            raise ExportError(f"{path} has no system {variable!r}; {_what_it_has(systems, variables)}")
        return variable, systems[variable]
    if len(systems) == 1:
        return next(iter(systems.items()))
    if systems:
        listed = ", ".join(repr(name) for name in systems)
        bare = " ('' has no structure)" if "" in systems else ""
        raise ExportError(f"{path} holds {len(systems)} systems, {listed}; choose one by its name{bare}")
    raise ExportError(f"{path} has no linear system; {_what_it_has(systems, variables)}")


def _what_it_has(systems: dict[str, Any], variables: dict[str, Any]) -> str:
    if [*systems] == [""]:
        return "it has one system, whose matrices are variables of their own: give no name of a variable"
    if systems:
        return f"it has {', '.join(repr(name) for name in systems)}; choose one of these"
    listed = ", ".join(list(variables)[:20]) or "nothing"
    return f"it holds {listed}, and none with A B C D, z p k or num den: save one of these forms"


def _systems(path: Path, variables: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Systems by the name of their structure, "" for variables of their own."""
    found = {"": variables} if form_of(variables) else {}
    for name, value in variables.items():
        if isinstance(value, Unread) and value.kind == "an object of MATLAB":
            raise ExportError(
                f"{path}: variable {name!r} is {value.kind}, which only MATLAB can read; save its matrices: "
                f"s = struct('A', {name}.A, 'B', {name}.B, 'C', {name}.C, 'D', {name}.D, 'Ts', {name}.Ts)"
            )
        if not isinstance(value, Structure) or not form_of(value.fields):
            continue
        if value.size != 1:
            raise ExportError(f"{path}: variable {name!r} is an array of {value.size} structures; save one of them")
        found[name] = value.fields
    return found


def form_of(fields: dict[str, Any]) -> tuple[str, ...]:
    """Names of the fields that make the system; none where they make no system."""
    return next((form for form in FORMS if all(key in fields for key in form)), ())


def numbers(fields: dict[str, Any], key: str, source: str, *, is_complex: bool = False) -> Any:
    """A field as an array of two axes, of floats or of complex numbers.

    Args:
        fields: The system's fields by name.
        key: Name of the field.
        source: What messages call the system.
        is_complex: Whether complex numbers are allowed.

    Raises:
        ExportError: For text, cells of several entries, objects, sparse matrices, complex numbers where there must be
            none, and numbers that are not finite or beyond `LARGEST`.
    """
    value = fields[key]
    if isinstance(value, np.ndarray) and value.dtype == object and value.size == 1:
        value = value.item()  # MATLAB's cell of the one entry
    if isinstance(value, np.ndarray) and value.dtype == object:
        raise ExportError(f"{source}: {key} has cells for {value.size} entries; choose one input and one output")
    if isinstance(value, Unread):
        raise ExportError(f"{source}: {key} is {value.kind}; {value.remedy}")
    if not isinstance(value, np.ndarray) or value.ndim != 2:
        raise ExportError(f"{source}: {key} is not a matrix of numbers; save numbers")
    if value.dtype.kind == "c" and not is_complex:
        raise ExportError(
            f"{source}: {key} holds complex numbers; a mirror's response to a real drive is real: save it real"
        )
    if not np.all(np.abs(value) <= LARGEST):
        raise ExportError(
            f"{source}: {key} holds a number that is not finite or beyond {LARGEST:g}; look for NaN or Inf in the model"
        )
    return value.astype(complex if is_complex else float)
