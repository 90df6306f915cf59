"""Chunks, traces and the head of a campaign as bytes: what a worker sends and the ledger keeps.

Layout, little-endian: ``microrad``, version (u16), kind (u16), length of the header (u32), the header (JSON, keys
sorted, UTF-8), the arrays one after another as float64, and the SHA-256 of everything before it. An array is stored
without the runs of equal values at its ends, which is most of a survival curve; the header says how long they are. The
same record gives the same bytes on any machine: that is why nothing is compressed by a library.
"""

import hashlib
import json
import math
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

import numpy as np

from microrad.campaign.records import CampaignError, Chunk, Failed, WorstTrace
from microrad.core.arrays import Floats

VERSION = 1
_MAGIC = b"microrad"
_PREFIX = struct.Struct("<8sHHI")
_DIGEST = 32
_KINDS = {"chunk": 1, "trace": 2, "head": 3}
_MOST_VALUES = 2**25  # in all arrays of one record: ten times a trace of as many samples as a mission may have


class Column(NamedTuple):
    """A column of the table of rows: its name, its SI unit ("" for a plain number) and what it means."""

    name: str
    unit: str
    meaning: str


@dataclass(frozen=True, slots=True)
class Head:
    """What a ledger is of: enough to resume the campaign and to export its rows with no other file at hand.

    ``bundle`` are all its files and controllers, which the ledger does not look into; ``hashes`` by what they are of
    ("campaign", "mission", "code"); ``versions`` by library; ``created`` is the time in ISO 8601, UTC. ``cells`` are
    the texts of the grid's keys, one dict for each cell ({} without a grid). ``columns`` are those of every chunk, in
    their order.
    """

    campaign_name: str
    campaign_text: str
    mission_name: str
    seed: int
    hashes: dict[str, str]
    versions: dict[str, str]
    created: str
    cells: tuple[dict[str, str], ...]
    columns: tuple[Column, ...]
    bundle: bytes = field(repr=False)


class Unpacked(NamedTuple):
    """What bytes hold: a header of JSON values, arrays by name in their order, and bytes that nobody looks into."""

    header: dict[str, Any]
    arrays: dict[str, Floats]
    rest: bytes


def pack_chunk(chunk: Chunk) -> bytes:
    """The chunk as bytes. Raises `CampaignError` for columns of unequal length or more than one dimension."""
    _check_columns(chunk)
    failed = [[each.row, each.seed, each.attempts, each.reason] for each in chunk.failed]
    header = {"cell": chunk.cell, "number": chunk.number, "columns": list(chunk.columns), "failed": failed}
    curves = {"survival": chunk.survival, "survival_square": chunk.survival_square}
    return pack("chunk", header, {f"column {name}": column for name, column in chunk.columns.items()} | curves)


def _check_columns(chunk: Chunk) -> None:
    rows = {values.shape for values in chunk.columns.values()}
    if len(rows) > 1 or any(len(shape) != 1 for shape in rows):
        raise CampaignError(f"chunk {chunk.number} of cell {chunk.cell} has columns of shapes {sorted(rows)}, not one")


def unpack_chunk(data: bytes) -> Chunk:
    """The chunk that `pack_chunk` made bytes of. Raises `CampaignError` for any others."""
    header, arrays, _ = unpack("chunk", data)
    with _ours("chunk"):
        chunk = Chunk(
            cell=header["cell"],
            number=header["number"],
            columns={name: arrays[f"column {name}"] for name in header["columns"]},
            failed=tuple(Failed(*each) for each in header["failed"]),
            survival=arrays["survival"],
            survival_square=arrays["survival_square"],
        )
    _check_columns(chunk)
    return chunk


def pack_trace(trace: WorstTrace) -> bytes:
    """The trace as bytes."""
    header = {"cell": trace.cell, "row": trace.row, "output": trace.output}
    arrays = {"time": trace.time_s, "error": trace.error_rad, "drive": trace.drive_v}
    return pack("trace", header, {"value": np.array(trace.value), **arrays})


def unpack_trace(data: bytes) -> WorstTrace:
    """The trace that `pack_trace` made bytes of. Raises `CampaignError` for any others."""
    header, arrays, _ = unpack("trace", data)
    with _ours("trace"):
        return WorstTrace(
            **header,
            value=float(arrays["value"]),
            time_s=arrays["time"],
            error_rad=arrays["error"],
            drive_v=arrays["drive"],
        )


def pack_head(head: Head) -> bytes:
    """The head as bytes."""
    cells = [list(cell.items()) for cell in head.cells]  # lists, since the order of the grid's keys is that of columns
    header = {**asdict(head), "columns": [list(each) for each in head.columns], "cells": cells}
    del header["bundle"]
    return pack("head", header, {}, head.bundle)


def unpack_head(data: bytes) -> Head:
    """The head that `pack_head` made bytes of. Raises `CampaignError` for any others."""
    header, _, bundle = unpack("head", data)
    with _ours("head"):
        cells, columns = tuple(map(dict, header.pop("cells"))), tuple(Column(*each) for each in header.pop("columns"))
        return Head(**header, cells=cells, columns=columns, bundle=bundle)


def pack(kind: str, header: Mapping[str, Any], arrays: Mapping[str, Floats], rest: bytes = b"") -> bytes:
    """Header, arrays and further bytes as one run of bytes of this kind.

    Args:
        kind: "chunk", "trace" or "head".
        header: JSON values.
        arrays: arrays of any shape by name, kept in their order.
        rest: further bytes, which nobody looks into.
    """
    values = {name: np.ascontiguousarray(array, dtype="<f8").reshape(np.shape(array)) for name, array in arrays.items()}
    ends = {name: _ends(array.ravel().view("<u8")) for name, array in values.items()}
    table = [[name, list(array.shape), *ends[name]] for name, array in values.items()]
    text = json.dumps({"arrays": table, "rest": len(rest), "header": header}, sort_keys=True, allow_nan=False)
    words = text.encode("utf-8", "surrogatepass")
    parts = [_PREFIX.pack(_MAGIC, VERSION, _KINDS[kind], len(words)), words]
    parts += [array.ravel()[_held(array.size, *ends[name])].tobytes() for name, array in values.items()]
    body = b"".join([*parts, rest])
    return body + hashlib.sha256(body).digest()


def unpack(kind: str, data: bytes) -> Unpacked:
    """What `pack` made bytes of; the arrays are copies. Raises `CampaignError` for damaged or other bytes.

    Args:
        kind: "chunk", "trace" or "head".
        data: the bytes.
    """
    _check(kind, data)
    body = memoryview(data)[:-_DIGEST]
    length = _PREFIX.unpack_from(body)[3]
    at = _PREFIX.size + length
    with _ours(kind):
        table = json.loads(bytes(body[_PREFIX.size : at]).decode("utf-8", "surrogatepass"))
        arrays = {}
        _check_sizes(table["arrays"])
        for name, shape, lead, trail in table["arrays"]:
            size = math.prod(shape)
            held = _held(size, lead, trail)
            stored, whole = np.frombuffer(body, "<f8", held.stop - held.start, at), np.empty(size)
            if size:
                whole[: held.start], whole[held], whole[held.stop :] = stored[0], stored, stored[-1]
            arrays[name] = whole.reshape(shape)
            at += stored.nbytes
        return Unpacked(dict(table["header"]), arrays, bytes(body[at : at + table["rest"]]))


@contextmanager
def _ours(kind: str) -> Iterator[None]:
    """Anyone may write bytes with the right checksum: raises `CampaignError` where they are laid out otherwise."""
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
        raise CampaignError(f"a {kind} is laid out as microrad never does: leave its file alone") from error


def _check_sizes(table: list[tuple[str, list[int], int, int]]) -> None:
    """Raises `ValueError` if there are more values than a record has: runs of equal ones take no room in the bytes."""
    left = _MOST_VALUES
    for _, shape, lead, trail in table:
        size = math.prod(shape)
        whole = [type(each) is int and 0 <= each <= left for each in (*shape, lead, trail, size)]
        if not all(whole) or lead + trail > size:
            raise ValueError("sizes")
        left -= size


def _check(kind: str, data: bytes) -> None:
    """Raises `CampaignError` if these are not whole bytes of this version and kind; a damaged ledger may give text."""
    if not isinstance(data, bytes) or len(data) < _PREFIX.size + _DIGEST or not data.startswith(_MAGIC):
        raise CampaignError(f"this is no {kind} of microrad: resume the campaign")
    if hashlib.sha256(memoryview(data)[:-_DIGEST]).digest() != data[-_DIGEST:]:
        raise CampaignError(f"a {kind} of {len(data)} bytes is damaged, its checksum differs: resume the campaign")
    _, version, number, _ = _PREFIX.unpack_from(data)
    if version != VERSION:
        raise CampaignError(f"a {kind} has format {version}, and this microrad reads {VERSION}: use the same microrad")
    if number != _KINDS[kind]:
        found = next((name for name, code in _KINDS.items() if code == number), f"kind {number}")
        raise CampaignError(f"these bytes are a {found}, not a {kind}: the worker runs another microrad")


def _ends(bits: "np.ndarray[Any, np.dtype[np.uint64]]") -> tuple[int, int]:
    """Lengths of the runs of equal values at both ends, compared bit by bit; the second is 0 when all are equal."""
    other = np.flatnonzero(bits[1:] != bits[:-1]) + 1
    return (int(other[0]), int(bits.size - other[-1])) if other.size else (int(bits.size), 0)


def _held(size: int, lead: int, trail: int) -> slice:
    """The part of an array that is stored: with one value left of the run at each end."""
    return slice(max(lead - 1, 0), size - max(trail - 1, 0))
