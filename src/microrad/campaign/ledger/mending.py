"""Checks of a ledger byte by byte, and mending: what can be read and is whole is kept, the rest is done again."""

import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from microrad.campaign.ledger import chunk_format, file
from microrad.campaign.records import CampaignError


@dataclass(frozen=True, slots=True)
class Verified:
    """What a check of every byte found: ``faults`` are of the file itself, in words; `mend` takes care of all.

    ``checked`` is the number of chunks with a right checksum. ``damaged`` are chunks with a wrong one, ``missing``
    those expected that are not there; both (cell, number).
    """

    checked: int
    damaged: tuple[tuple[int, int], ...]
    missing: tuple[tuple[int, int], ...]
    faults: tuple[str, ...]

    @property
    def sound(self) -> bool:
        """Whether nothing is damaged; chunks may be missing, as in a campaign that is not finished."""
        return not self.damaged and not self.faults


def verify(path: Path, expected: Iterable[tuple[int, int]] = ()) -> Verified:
    """Compute every checksum anew and have SQLite check its own structure; damage is found, not raised.

    Args:
        path: the ledger.
        expected: cell and number of the chunks that should be there.

    Raises `CampaignError` if there is no ledger, or one that cannot be opened or has no whole head.
    """
    with file.errors_in_words(path, "open the ledger"):
        file.refuse_foreign(path)
        with closing(file.connected(path, write=False)) as connection:
            file.whole_head(path, connection)
            faults = [*_structure(connection), *_small_faults(connection)]
            right, there = dict[tuple[int, int], bool](), set[tuple[int, int]]()
            try:
                for row in connection.execute(f"SELECT {_KEPT['chunks'][0]} FROM chunks ORDER BY cell, number"):
                    right[row[:2]] = _sound_chunk(row)
                there = set(connection.execute("SELECT cell, number FROM chunks"))
            except sqlite3.Error as error:
                faults.append(f"the table of chunks cannot be read: {error}")
    damaged = tuple(key for key, is_right in right.items() if not is_right)
    return Verified(len(right) - len(damaged), damaged, tuple(sorted({*expected} - there)), tuple(faults))


def _structure(connection: sqlite3.Connection) -> list[str]:
    """What SQLite finds wrong with its file."""
    try:
        found = [str(row[0]) for row in connection.execute("PRAGMA integrity_check(20)")]
    except sqlite3.Error as error:
        return [f"SQLite cannot check its file: {error}"]
    return [f"SQLite: {each}" for each in found if each != "ok"]


def _small_faults(connection: sqlite3.Connection) -> list[str]:
    """What is wrong with the head, the traces and the notes."""
    faults = []
    for copy, table in enumerate(file.HEADS, 1):
        try:
            file.head_in(connection, table)
        except (CampaignError, sqlite3.Error) as error:
            faults.append(f"copy {copy} of the head: {error}")
    for table, keys in (("traces", 3), ("notes", 1)):
        columns, sound = _KEPT[table]
        try:
            rows = connection.execute(f"SELECT {columns} FROM {table}")
            faults += [f"damaged among the {table}: {row[:keys]}" for row in rows if not sound(row)]
        except sqlite3.Error as error:
            faults.append(f"the table of {table} cannot be read: {error}")
    return faults


def _sound_chunk(row: tuple[Any, ...]) -> bool:
    cell, number, sha256, payload = row
    return bool(sha256 == file.digest(cell, number, payload))


def _sound_trace(row: tuple[Any, ...]) -> bool:
    try:
        trace = chunk_format.unpack_trace(row[-1])
    except CampaignError:
        return False
    return (trace.cell, trace.row, trace.output) == row[:-1]


def _sound_note(row: tuple[Any, ...]) -> bool:
    key, text, sha256 = row
    return bool(sha256 == file.digest(key, text))


_KEPT: dict[str, tuple[str, Callable[[tuple[Any, ...]], bool]]] = {
    "chunks": ("cell, number, sha256, payload", _sound_chunk),
    "traces": ("cell, row, output, payload", _sound_trace),
    "notes": ("key, value, sha256", _sound_note),
}


# -------------------------------------------------------------------------------------------------------------- mending
def mend(path: Path) -> None:
    """Replace a damaged ledger by a new one with all that can be read of it and is whole.

    Raises `CampaignError` where SQLite cannot open it or no copy of the head is whole; then nothing is changed.
    """
    with file.errors_in_words(path, "mend the ledger"), closing(file.locked(path)):
        file.refuse_foreign(path)
        draft = file.draft_of(path)
        with closing(file.connected(path, write=False)) as damaged:
            file.make_empty(draft)
            file.put_head(draft, file.whole_head(path, damaged), {})
            with closing(sqlite3.connect(draft)) as mended, mended:
                for table, (columns, _) in _KEPT.items():
                    marks = ", ".join("?" * len(columns.split(",")))
                    whole = _whole_rows(damaged, table)
                    mended.executemany(f"INSERT OR IGNORE INTO {table} (rowid, {columns}) VALUES (?, {marks})", whole)
        file.install(draft, path)


def _whole_rows(damaged: sqlite3.Connection, table: str) -> Iterator[tuple[Any, ...]]:
    """Rows with a right checksum, each behind its number: from the first on, then from the last where SQLite fails."""
    columns, sound = _KEPT[table]
    for order in ("ASC", "DESC"):
        with suppress(sqlite3.Error):
            rows = damaged.execute(f"SELECT rowid, {columns} FROM {table} ORDER BY rowid {order}")
            yield from (row for row in rows if sound(row[1:]))
            return
