"""A list of pointing error sources as a table of a spreadsheet, CSV or XLSX: one row each, checked as in a mission."""

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from pydantic import ValidationError

from microrad.core.errors import MicroradError
from microrad.core.folder import read_bytes
from microrad.core.installing import advice
from microrad.core.units import UnitError
from microrad.mission.fields import ProblemsError
from microrad.mission.tables.error_budget import BudgetSource

_AXES = ("x", "y", "z")
_KEYS = {info.alias or name for name, info in BudgetSource.model_fields.items()} - {"gains"}
COLUMNS = ("name", *(info.alias or name for name, info in BudgetSource.model_fields.items() if name != "gains"))
"""Columns of a list beside those of the axes, x, y and z, and the origin."""

_MOST_BYTES, _MOST_UNPACKED_BYTES, _MOST_ROWS, _MOST_SHOWN = 20_000_000, 100_000_000, 10_000, 60


class SourceListError(MicroradError):
    """A list of sources that cannot be taken as it is."""


@dataclass(frozen=True, slots=True)
class ListedSource:
    """A source of a list, and where the list says that it comes from."""

    name: str
    source: BudgetSource
    origin: str


def read_sources(path: Path) -> tuple[ListedSource, ...]:
    """Read a list of sources.

    Its first row names the columns: name, class, size (or rate), statistic, axes, then x, y and, for three axes, z,
    which hold the gains, whatever the class needs, and origin. Cells hold what a mission file holds, without quotes.

    Args:
        path: A text in UTF-8, its cells separated by commas, semicolons or tabs, or a workbook (.xlsx), whose first
            sheet is read.

    Raises:
        SourceListError: For a file that cannot be read or has another form, and for a row that is no source.
    """
    rows = _of_workbook(path) if path.suffix.lower() == ".xlsx" else _of_text(path)
    head = [cell.strip().lower() for cell in next(rows, [])]
    _check_head(path, head)
    found: list[ListedSource] = []
    for number, cells in enumerate(rows, 2):
        if number > _MOST_ROWS:
            raise SourceListError(f"{path}: more than {_MOST_ROWS} rows; give fewer sources")
        if extra := next(
            (cell for place, cell in enumerate(cells) if cell.strip() and not "".join(head[place : place + 1])), ""
        ):
            raise SourceListError(
                f'{path}, row {number}: "{_short(extra)}" stands in a column without a name; name it, or remove it'
            )
        row = {key: cell.strip() for key, cell in zip(head, cells, strict=False) if key and cell.strip()}
        if row:
            found.append(_source(f"{path}, row {number}", row, {each.name for each in found}))
    if not found:
        raise SourceListError(f"{path}: holds no source; give a row for each below the names of the columns")
    return tuple(found)


def _check_head(path: Path, head: Sequence[str]) -> None:
    known = {*_KEYS, *_AXES, "name", "origin"}
    wrong = [key for key in head if key and key not in known]
    lacking = [key for key in ("name", "class", "statistic", "axes", "x") if key not in head]
    if wrong or lacking:
        what = f'no column is called "{_short(wrong[0])}"' if wrong else f'it has no column "{lacking[0]}"'
        raise SourceListError(
            f"{path}: {what}; its first row names columns out of {', '.join([*COLUMNS, *_AXES])}, origin"
        )
    if len(set(filter(None, head))) < len(list(filter(None, head))):
        raise SourceListError(f"{path}: two columns have one name; rename one of them")


def _source(where: str, row: dict[str, str], taken: set[str]) -> ListedSource:
    name = row.pop("name", "")
    if not name or name in taken:
        raise SourceListError(f"{where}: {'has no name' if not name else f'is a second {_short(name)!r}'}; give it one")
    origin = row.pop("origin", where)
    gains = [row.pop(axis, "") for axis in _AXES]
    last = max((place for place, cell in enumerate(gains) if cell), default=0)
    if empty := [axis for axis, cell in zip(_AXES, gains[:last], strict=False) if not cell]:
        raise SourceListError(
            f"{where}, {_short(name)}: {empty[0]} is empty before {_AXES[last]}; give 0 where nothing gets there"
        )
    data: dict[str, Any] = {
        **row,
        "gains": [_number(where, axis, cell) for axis, cell in zip(_AXES, gains, strict=True) if cell],
    }
    try:
        return ListedSource(name, BudgetSource.model_validate(data), origin)
    except ValidationError as error:
        raise SourceListError(f"{where}, {_short(name)}: {_reason(error)}") from None


def _number(where: str, axis: str, cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        raise SourceListError(f'{where}, {axis}: "{_short(cell)}" is no number; give the gain to that axis') from None


def _reason(error: ValidationError) -> str:
    """What is wrong, in one line: the first fault."""
    detail = error.errors(include_url=False)[0]
    cause, key = detail.get("ctx", {}).get("error"), ".".join(str(each) for each in detail["loc"])
    if isinstance(cause, ProblemsError):
        problem = cause.problems[0]
        return f"{problem.key or key} {problem.reason}; expected {problem.expected}"
    if isinstance(cause, UnitError):
        return f"{key} {cause.reason}; expected {cause.expected}, for example {cause.example}"
    if detail["type"] == "missing":
        return f"{key} is missing"
    return f'{key} is "{_short(str(detail["input"]))}": {detail["msg"].lower()}'


def _short(text: str) -> str:
    """The begin of a cell in one line."""
    text = " ".join(text.split())
    return text if len(text) <= _MOST_SHOWN else f"{text[: _MOST_SHOWN - 1]}…"


def _of_text(path: Path) -> Iterator[list[str]]:
    try:
        text = _bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise SourceListError(f"{path}: is no text in UTF-8; save it as CSV in UTF-8, or as .xlsx") from None
    first = text.partition("\n")[0]
    separator = max(";\t,", key=first.count)
    try:
        yield from csv.reader(io.StringIO(text), delimiter=separator, strict=True)
    except csv.Error as error:
        raise SourceListError(f"{path}: is no table of cells ({error}); save it as CSV in UTF-8") from None


def _of_workbook(path: Path) -> Iterator[list[str]]:
    try:
        from openpyxl import load_workbook
    except ImportError:
        raise SourceListError(
            f"{path}: reading a workbook needs the library openpyxl, which is not installed; install it "
            f"{advice('xlsx')}, or save the sheet as CSV"
        ) from None
    data = io.BytesIO(_bytes(path))
    try:
        with ZipFile(data) as parts:
            size = sum(each.file_size for each in parts.infolist())
        if size > _MOST_UNPACKED_BYTES:
            raise ValueError(f"it unpacks to {size // 10**6} MB")
        for row in load_workbook(data, read_only=True, data_only=True).worksheets[0].iter_rows(values_only=True):
            yield ["" if cell is None else str(cell) for cell in row]
    except SourceListError:
        raise
    except Exception as error:  # whatever a damaged one raises in there
        what = _short(" ".join(str(error).split()) or type(error).__name__)
        raise SourceListError(f"{path}: is no workbook ({what}); save it again as .xlsx, or as CSV") from None


def _bytes(path: Path) -> bytes:
    try:
        data = read_bytes(path, _MOST_BYTES + 1)
    except OSError as error:
        raise SourceListError(f"{path}: cannot be read ({error.strerror}); check the path") from None
    if len(data) > _MOST_BYTES:
        raise SourceListError(f"{path}: is larger than {_MOST_BYTES // 10**6} MB; give the list alone")
    return data
