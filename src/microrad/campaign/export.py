"""The rows of a campaign as one table: netCDF, Parquet or CSV, each with units, and with checksums where there are any.

The columns are ``cell`` (number of the combination of the grid), the grid's keys as text, ``row``, ``weight``, the
drawn inputs and the outputs in SI units, and ``failed``: why a row has no results, empty for a good one. The rows are
ordered by cell and row. The files hold no time and no machine's name, so the same rows give the same bytes; memory does
not grow with the number of rows.
"""

import csv
import io
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from microrad.campaign.ledger import Head, Ledger
from microrad.campaign.records import CampaignError, Chunk
from microrad.core.folder import whole_file
from microrad.core.installing import advice
from microrad.orbit.operations import spreadsheet_text

_ROWS = 16384  # written at once: a row group of Parquet, a chunk of netCDF


class _Field(NamedTuple):
    """A column of the table, and of what kind its values are."""

    name: str
    unit: str
    meaning: str
    kind: Literal["int", "float", "text"]


_Block = dict[str, NDArray[Any]]


def export_rows(ledger: Ledger, path: Path) -> int:
    """Write the rows that are done to a table; how many they are.

    Args:
        ledger: an open ledger.
        path: the file, .nc, .parquet or .csv; what was in it is replaced once the new table is whole.

    Raises `CampaignError` for another suffix, a missing library, a damaged chunk, no rows, and a file that cannot be
    written.
    """
    writers: dict[str, Callable[[Ledger, Path], int]] = {".nc": _netcdf, ".parquet": _parquet, ".csv": _csv}
    writer = writers.get(path.suffix.lower())
    if writer is None:
        raise CampaignError(f"{path}: microrad exports to {', '.join(writers)}, not to {path.suffix or 'no suffix'!r}")
    if not path.parent.is_dir():
        raise CampaignError(f"{path}: there is no folder {path.parent}: make it, or choose another")
    with ledger.still():
        if not ledger.done():
            raise CampaignError(f"{ledger.path} has no rows yet: run or resume the campaign first")
        with _whole_file(path) as part:
            return writer(ledger, part)


@contextmanager
def _whole_file(path: Path) -> Iterator[Path]:
    """A file beside ``path`` to write; it becomes ``path`` at the end, or vanishes on any error."""
    try:
        with whole_file(path) as part:
            yield part
            with part.open("r+b") as file:
                os.fsync(file.fileno())
    except (OSError, RuntimeError) as error:  # RuntimeError is what HDF5 says of a full disk when it closes a file
        raise CampaignError(
            f"{path} could not be written ({error}), so nothing is: free space, or choose another"
        ) from error


# --------------------------------------------------------------------------------------------------------- the table
def _fields(head: Head) -> list[_Field]:
    """The columns in their order."""
    keys = list(dict.fromkeys(key for cell in head.cells for key in cell))
    return [
        _Field("cell", "", "number of the combination of the grid", "int"),
        *(_Field(key, "", f"{key} in the grid", "text") for key in keys),
        *(_Field(*column, "int" if column.name == "row" else "float") for column in head.columns),
        _Field("failed", "", "why the row has no results, empty for a good one", "text"),
    ]


def _blocks(ledger: Ledger) -> Iterator[tuple[int, _Block]]:
    """Number of rows and values by column, `_ROWS` rows at a time and fewer in the last."""
    fields, held, count = _fields(ledger.head), list[_Block](), 0
    for cell, texts in enumerate(ledger.head.cells):
        for chunk in ledger.chunks(cell):
            held.append(_block(chunk, texts, fields))
            count += len(chunk.columns["row"])
            while count >= _ROWS:
                whole = _joined(held)
                yield _ROWS, {name: values[:_ROWS] for name, values in whole.items()}
                held, count = [{name: values[_ROWS:] for name, values in whole.items()}], count - _ROWS
    if count:
        yield count, _joined(held)


def _joined(blocks: list[_Block]) -> _Block:
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def _block(chunk: Chunk, texts: dict[str, str], fields: list[_Field]) -> _Block:
    """The rows of a chunk."""
    rows = chunk.columns["row"].astype(np.int64)
    reasons = {each.row: _clean(each.reason) or "without a reason" for each in chunk.failed}
    fixed: _Block = {key: np.full(rows.size, _clean(text), dtype=object) for key, text in texts.items()}
    failed = np.array([reasons.get(row, "") for row in rows.tolist()], dtype=object)
    cell = np.full(rows.size, chunk.cell)
    values: _Block = {**chunk.columns, **fixed, "row": rows, "cell": cell, "failed": failed}
    return {field.name: values[field.name] for field in fields}


def _clean(text: str) -> str:
    """Text that every format can keep: no half of a surrogate pair, no null."""
    return text.encode("utf-8", "backslashreplace").decode().replace("\0", "\\0")


def _origin(head: Head) -> dict[str, str]:
    """What the table comes from, in words."""
    hashes = {f"{name}_sha256": value for name, value in head.hashes.items()}
    versions = json.dumps(head.versions, sort_keys=True)
    title = {"title": head.mission_name, "campaign": head.campaign_name, "seed": str(head.seed)}
    return {**title, **hashes, "versions": versions}


# ------------------------------------------------------------------------------------------------------- the formats
def _csv(ledger: Ledger, part: Path) -> int:
    """Units in the head row, every digit of a number, nan where a row failed, and no text that begins a formula."""
    fields, rows = _fields(ledger.head), 0
    with part.open("x", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([f"{field.name} [{field.unit}]" if field.unit else field.name for field in fields])
        for count, block in _blocks(ledger):
            columns = [_csv_texts(field, block[field.name]) for field in fields]
            writer.writerows(zip(*columns, strict=True))
            rows += count
    return rows


def _csv_texts(field: _Field, values: NDArray[Any]) -> list[str]:
    return [spreadsheet_text(text) for text in values] if field.kind == "text" else list(map(repr, values.tolist()))


def _parquet(ledger: Ledger, part: Path) -> int:
    """Page checksums on; the unit and meaning of a column are metadata of its field, as is the table's origin."""
    try:
        import pyarrow as pa
        from pyarrow.parquet import ParquetWriter
    except ImportError:
        raise CampaignError(
            f"Parquet needs pyarrow: export to .nc or .csv, or install it {advice('parquet')}"
        ) from None
    fields = _fields(ledger.head)
    kinds = {"int": pa.int64(), "float": pa.float64(), "text": pa.string()}
    typed = [
        pa.field(f.name, kinds[f.kind], nullable=False, metadata={"unit": f.unit, "long_name": f.meaning})
        for f in fields
    ]
    schema = pa.schema(typed, metadata=_origin(ledger.head))
    rows = 0
    repeated = [field.name for field in fields if field.kind != "float"]
    with ParquetWriter(part, schema, write_page_checksum=True, use_dictionary=repeated) as writer:
        for count, block in _blocks(ledger):
            columns = [pa.array(block[field.name], type=kinds[field.kind]) for field in fields]
            writer.write_table(pa.Table.from_arrays(columns, schema=schema), row_group_size=_ROWS)
            rows += count
    return rows


def _netcdf(ledger: Ledger, part: Path) -> int:
    """One dimension ``index``, Fletcher-32 checksums on; text as characters, as checksums leave out HDF5's strings."""
    import h5netcdf

    fields = _fields(ledger.head)
    rows, widths = _extent(ledger, fields)
    with _Disk(part, "x+") as disk:
        with h5netcdf.File(disk, "w") as file:
            file.attrs.update(_origin(ledger.head))
            file.dimensions = {"index": rows, **{_characters_of(name): width for name, width in widths.items()}}
            variables = {field.name: _variable(file, field, widths, rows) for field in fields}
            at = 0
            for count, block in _blocks(ledger):
                for field in fields:
                    values = block[field.name]
                    width = widths.get(field.name)
                    variables[field.name][at : at + count] = values if width is None else _characters(values, width)
                at += count
        if disk.error is not None:
            raise disk.error
    return rows


class _Disk(io.FileIO):
    """A file that keeps its first error to itself: HDF5 cannot close a file on a full disk, and crashes at exit."""

    error: OSError | None = None

    def write(self, data: Any) -> int:
        """Write all of it, or take it as written after an error."""
        rest = memoryview(data).cast("B")
        size = len(rest)
        try:
            while len(rest):
                rest = rest[super().write(rest) :]
        except OSError as error:
            self.error = self.error or error
            self.seek(len(rest), io.SEEK_CUR)
        return size

    def truncate(self, size: int | None = None) -> int:
        """Make it as long as that, or take it as that long after an error."""
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = self.error or error
            return self.tell() if size is None else size

    def readinto(self, data: Any) -> int:
        """Read, with zeros for what could not be written."""
        count = super().readinto(data)
        if self.error is not None and count < len(data):
            data[count:] = bytes(len(data) - count)
            return len(data)
        return count


def _extent(ledger: Ledger, fields: list[_Field]) -> tuple[int, dict[str, int]]:
    """The number of rows, and of bytes of the longest text in each column of text."""
    rows, widths = 0, {field.name: 1 for field in fields if field.kind == "text"}
    for count, block in _blocks(ledger):
        rows += count
        for name, width in widths.items():
            widths[name] = max(width, *(len(text.encode()) for text in set(block[name].tolist())))
    return rows, widths


def _characters(texts: NDArray[Any], width: int) -> NDArray[np.bytes_]:
    """Texts as rows of single bytes of UTF-8, filled up with nulls."""
    whole = np.array([text.encode() for text in texts.tolist()], dtype=f"S{width}")
    return whole.view("S1").reshape(len(texts), width)


def _name(key: str) -> str:
    """A key as HDF5 can name it: a slash would be a group."""
    return key.replace("/", "|")


def _characters_of(key: str) -> str:
    """The dimension of a text's characters."""
    return f"{_name(key)} characters"


def _variable(file: Any, field: _Field, widths: dict[str, int], rows: int) -> Any:
    """A variable for a column; what is not a float is mostly the same again and again, and is compressed."""
    dims, chunk = ["index"], [min(rows, _ROWS)]
    options: dict[str, Any] = {"fletcher32": True}
    if field.kind == "text":
        dims, chunk = [*dims, _characters_of(field.name)], [*chunk, widths[field.name]]
    if field.kind != "float":
        options |= {"compression": "gzip", "compression_opts": 1, "shuffle": True}
    kind = {"int": "i8", "float": "f8", "text": "S1"}[field.kind]
    variable = file.create_variable(_name(field.name), tuple(dims), kind, chunks=tuple(chunk), **options)
    variable.attrs["long_name"] = field.meaning
    if field.kind == "text":
        variable.attrs["_Encoding"] = "utf-8"
    else:
        variable.attrs["units"] = field.unit or "1"
    return variable
