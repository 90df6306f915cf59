"""The templates of exported code: C, make files and XML with the numbers of a design in them."""

import math
import textwrap
from collections.abc import Iterable
from functools import cache
from typing import Any, Literal

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from microrad.export.records import ExportError

Precision = Literal["double", "single"]

Terms = list[tuple[int, int, float]]
"""Numbers of a matrix: row, column, value."""

LINE = 112
"""Longest line of a table or of words."""


def real(x: float, precision: Precision = "double") -> str:
    """A number as the shortest C literal that reads back to it; infinity becomes the largest finite number.

    What is too small for the precision becomes 0 (a compiler warns of such a literal).

    Args:
        x: A constant of the code, in any unit.
        precision: "double", at most 17 significant digits, or "single", at most 9 and the suffix f.

    Raises:
        ExportError: For nan, and for a finite number that is too large for the precision.
    """
    range_of = np.finfo(np.float64 if precision == "double" else np.float32)
    largest = float(range_of.max)
    if math.isnan(x):
        raise ExportError("a number of the exported code is nan: no literal of C stands for it; look for its origin")
    if abs(x) > largest and not math.isinf(x):
        raise ExportError(
            f"{float(x)!r} is beyond single precision, which ends at {largest:.4g}: export double precision"
        )
    held = min(max(float(x), -largest), largest)
    held = 0.0 if abs(held) < float(range_of.smallest_normal) else held
    text = repr(held) if precision == "double" else str(np.float32(held))
    text = text if "." in text or "e" in text else text + ".0"
    return text if precision == "double" else text + "f"


def table(matrix: Any, precision: Precision = "double") -> str:
    """Numbers as a C initialiser: ``{a, b}`` of one dimension, a braced line for each row of two.

    Args:
        matrix: The numbers, of one or two axes.
        precision: Precision of the code.

    Raises:
        ExportError: For a number that has no literal in the precision.
    """
    numbers = np.asarray(matrix, dtype=float)
    if numbers.ndim == 1:
        return "{" + ", ".join(real(float(x), precision) for x in numbers) + "}"
    return "{\n    " + ",\n    ".join(table(row, precision) for row in numbers) + ",\n}"


def whole(numbers: Iterable[int]) -> str:
    """Whole numbers as a C initialiser."""
    return "{" + ", ".join(str(int(n)) for n in numbers) + "}"


def terms(of: Terms, precision: Precision = "double") -> str:
    """Numbers of a matrix as braced rows, columns and values; each row of the matrix begins a line.

    Args:
        of: The numbers, row by row.
        precision: Precision of the code.

    Raises:
        ExportError: For a number that has no literal in the precision.
    """
    lines: list[str] = []
    last = -1
    for row, column, value in of:
        text = f"{{{row}, {column}, {real(value, precision)}}},"
        if row == last and len(lines[-1]) + 1 + len(text) <= LINE:
            lines[-1] += f" {text}"
        else:
            lines.append(text)
        last = row
    return "\n    ".join(lines)


def entries(matrix: Any) -> list[tuple[int, int, Any]]:
    """Row, column and value of each number of a matrix that is not 0, row by row."""
    return [(int(i), int(j), matrix[i, j].item()) for i, j in np.argwhere(matrix)]


def comment(text: str, prefix: str = "") -> str:
    """Text for a comment of C, broken into lines: nothing in it can end the comment or hide code.

    Args:
        text: The text, with any characters.
        prefix: What each line but the first begins with.
    """
    plain = "".join(c if c.isprintable() else " " for c in text).replace("\\", "/")
    for pair in ("??", "*/", "/*"):
        while pair in plain:
            plain = plain.replace(pair, " ".join(pair))
    return f"\n{prefix}".join(textwrap.wrap(plain, LINE) or [""])


def render(template: str, **values: Any) -> str:
    """A file of the folder `templates` with the values filled in.

    Args:
        template: Name of the file.
        values: What stands for each name in it.

    Raises:
        jinja2.UndefinedError: A name of the template has no value.
    """
    return _environment().get_template(template).render(**values)


@cache
def _environment() -> Environment:
    made = Environment(
        loader=PackageLoader("microrad.export", "templates"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # C, not HTML; templates of XML escape what they put in
    )
    made.filters.update(real=real, table=table, whole=whole, terms=terms, comment=comment)
    return made
