"""A measured spectrum as two columns: read from a text file, and checked."""

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from microrad.core.arrays import Floats
from microrad.core.folder import read_bytes

Unit = Literal["rad^2/Hz", "mrad^2/Hz", "urad^2/Hz", "nrad^2/Hz"]

_SCALES = dict(zip(get_args(Unit), (1.0, 1e-6, 1e-12, 1e-18), strict=True))
_DENSITY = re.compile(r"(?<![a-z])([munµμ]?)rad(?:\^2|\*\*2|²|2)\s*(?:/|_|per)\s*hz", re.IGNORECASE)
_WRONG_FREQUENCY = re.compile(r"\b[kmg]hz\b|(?<![munµμ])rad\s*/\s*s\b", re.IGNORECASE)
_MAX_BYTES = 100_000_000


def read_table(path: str | Path, unit: Unit | None = None, data: bytes | None = None) -> tuple[Floats, Floats]:
    """Read frequencies (Hz) and one-sided densities (rad^2/Hz) from a text of two columns.

    Columns are separated by comma, semicolon, tab or white space; lines that begin with # and blank lines are skipped.
    The unit of the density stands in a heading line ("Hz, urad^2/Hz"), commented or not, or is given.

    Args:
        path: The file.
        unit: Unit of the density in the file, where its heading names none.
        data: Bytes of the file where they are at hand; it is not read then.

    Raises:
        ValueError: For a file that cannot be read, no unit or two that differ, a line without exactly two numbers, and
            rows that `checked` refuses, each with its line.
    """
    lines = _lines(Path(path), data)
    heading = [text for _, text in lines[: _first_numbers(lines)]]
    rows = [(number, text) for number, text in lines[_first_numbers(lines) :] if not text.startswith("#")]
    scale = _SCALES[_unit(path, heading, unit)]
    values = np.array([_two_numbers(path, number, text) for number, text in rows]).reshape(-1, 2)
    return checked(values[:, 0], scale * values[:, 1], str(path), [number for number, _ in rows])


def _lines(path: Path, data: bytes | None) -> list[tuple[int, str]]:
    """Line number and text of each line that is not blank."""
    if data is None and not path.is_file():
        raise ValueError(f"{path}: there is no such file; check the path of the table")
    if (path.stat().st_size if data is None else len(data)) > _MAX_BYTES:
        raise ValueError(f"{path}: more than {_MAX_BYTES // 10**6} MB; average the spectrum to fewer rows")
    try:
        text = (read_bytes(path, _MAX_BYTES) if data is None else data).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", error)
        raise ValueError(f"{path}: the table cannot be read as text ({reason}); save it as CSV in UTF-8") from None
    return [(i, line.strip()) for i, line in enumerate(text.splitlines(), 1) if line.strip()]


def _first_numbers(lines: list[tuple[int, str]]) -> int:
    """Index of the first line that begins as a number does; all before it is heading."""
    starts = (i for i, (_, text) in enumerate(lines) if text[0] in "+-.0123456789" or text.lower().startswith("nan"))
    return next(starts, len(lines))


def _unit(path: str | Path, heading: list[str], unit: Unit | None) -> Unit:
    """Unit of the density: the one in the heading, or the given one where the heading names none."""
    if unit is not None and unit not in _SCALES:
        raise ValueError(f'{path}: "{unit}" is no unit of a density; say one of {", ".join(_SCALES)}')
    text = "\n".join(heading)
    if wrong := _WRONG_FREQUENCY.search(text):
        raise ValueError(f'{path}: the heading says "{wrong[0]}"; give frequencies in Hz')
    found = {match[1].lower().replace("µ", "u").replace("μ", "u") for match in _DENSITY.finditer(text)}
    named = {known for known in get_args(Unit) if known.split("rad")[0] in found}
    if unit is not None:
        named.add(unit)
    if len(named) != 1:
        said = "no unit of the density is named" if not named else f"the units {' and '.join(sorted(named))} are named"
        raise ValueError(f'{path}: {said}; write one heading line such as "Hz, urad^2/Hz", or give the unit')
    one: Unit = named.pop()
    return one


def _two_numbers(path: str | Path, number: int, text: str) -> tuple[float, float]:
    delimiter = next((mark for mark in (";", "\t", ",") if mark in text), None)
    cells = [cell.strip() for cell in text.split(delimiter)]
    if len(cells) != 2:
        raise ValueError(
            f"{path}, line {number}: {len(cells)} columns; give two, frequency (Hz) and density, with a decimal point"
        )
    try:
        return float(cells[0]), float(cells[1])
    except ValueError:
        raise ValueError(f'{path}, line {number}: "{text[:60]}" is not two numbers; decimals take a point') from None


def checked(
    freq_hz: Floats, psd_rad2_hz: Floats, name: str, lines: Sequence[int] | None = None
) -> tuple[Floats, Floats]:
    """The two columns as they are, once they are seen to be a spectrum.

    Args:
        freq_hz: Frequencies, rising from 0 or above, shape (rows,) with three rows or more.
        psd_rad2_hz: One-sided densities, 0 or above, shape (rows,).
        name: What they are called in the message.
        lines: Line of each row in its file, for the message; the rows are counted where none are given.

    Raises:
        ValueError: For columns of unequal length or fewer than three rows, a number that is not finite, a negative
            frequency or density and a frequency that does not rise; names the row.
    """
    if freq_hz.ndim != 1 or freq_hz.shape != psd_rad2_hz.shape or freq_hz.size < 3:
        raise ValueError(
            f"{name}: {freq_hz.size} frequencies and {psd_rad2_hz.size} densities; give as many of both, three or more"
        )
    steps = np.diff(freq_hz, prepend=-math.inf)
    faults = (
        (~np.isfinite(freq_hz) | ~np.isfinite(psd_rad2_hz), "holds a number that is not finite", "remove the row"),
        (freq_hz < 0.0, "has a negative frequency", "give a one-sided spectrum, from 0 Hz up"),
        (psd_rad2_hz < 0.0, "has a negative density", "give rad^2/Hz, not decibels"),
        (~(steps > 0.0), "does not rise in frequency above the row before", "sort the rows and remove doubles"),
    )
    for fault, what, remedy in faults:
        if np.any(fault):
            row = int(np.argmax(fault))
            place = f"row {row + 1}" if lines is None else f"line {lines[row]}"
            raise ValueError(f"{name}, {place}: ({freq_hz[row]:g} Hz, {psd_rad2_hz[row]:g} rad^2/Hz) {what}; {remedy}")
    return freq_hz, psd_rad2_hz
