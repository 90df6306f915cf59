"""Checks of a ledger byte by byte, and mending: what is whole is kept, the rest is done again."""

import shutil
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from microrad.campaign.ledger import chunk_format, log
from microrad.campaign.ledger.file import (
    HEADS,
    code_of,
    connected,
    digest,
    errors_in_words,
    files,
    head_in,
    install,
    locked,
    make_empty,
    put_head,
    refuse_damaged_log,
    refuse_foreign,
    whole_head,
)
from microrad.campaign.ledger.ledger import Ledger
from microrad.campaign.ledger.log import LEAF, PAGE
from microrad.campaign.records import CampaignError
from microrad.core.folder import scratch

_NOT_DAMAGE = {
    *(sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_READONLY),
    *(sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_PERM, sqlite3.SQLITE_BUSY),
}


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
        path: the ledger. What keeps it from being opened is a fault, too.
        expected: cell and number of the chunks that should be there.

    Raises `CampaignError` if there is no file or what never was a ledger, or if the file cannot be read for another
    reason than damage.
    """
    with errors_in_words(path, "open the ledger"):
        try:
            refuse_damaged_log(path)
        except CampaignError as error:
            return Verified(0, (), (), (str(error),))
        refuse_foreign(path)
    try:
        with errors_in_words(path, "open the ledger"), closing(connected(path, write=False)) as connection:
            whole_head(path, connection)
            return _checked(connection, expected)
    except CampaignError as error:
        if isinstance(error.__cause__, OSError) or code_of(error.__cause__) in _NOT_DAMAGE:
            raise
        return Verified(0, (), (), (str(error),))


def _checked(connection: sqlite3.Connection, expected: Iterable[tuple[int, int]]) -> Verified:
    """The check of a ledger whose head is known to be whole."""
    faults = [*_structure(connection), *_small_faults(connection)]
    checked, damaged = 0, []
    try:
        wanted = "SELECT cell, number, sha256, payload FROM chunks ORDER BY cell, number"
        for row in connection.execute(wanted):
            if _sound_chunk(row):
                checked += 1
            else:
                damaged.append(row[:2])
        there = set(connection.execute("SELECT cell, number FROM chunks"))
    except sqlite3.Error as error:
        return Verified(checked, tuple(damaged), (), (*faults, f"the table of chunks cannot be read: {error}"))
    return Verified(checked, tuple(damaged), tuple(sorted(set(expected) - there)), tuple(faults))


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
    for copy, table in enumerate(HEADS, 1):
        try:
            head_in(connection, table)
        except (CampaignError, sqlite3.Error) as error:
            faults.append(f"copy {copy} of the head: {error}")
    for table, keys in (("traces", 3), ("notes", 1)):
        columns, sound = _SALVAGED[table]
        try:
            rows = connection.execute(f"SELECT {columns} FROM {table}")
            faults += [f"damaged among the {table}: {row[:keys]}" for row in rows if not sound(row)]
        except sqlite3.Error as error:
            faults.append(f"the table of {table} cannot be read: {error}")
    return faults


def _sound_chunk(row: tuple[Any, ...]) -> bool:
    cell, number, sha256, payload = row
    return bool(sha256 == digest(cell, number, payload))


def _sound_trace(row: tuple[Any, ...]) -> bool:
    try:
        trace = chunk_format.unpack_trace(row[-1])
    except CampaignError:
        return False
    return (trace.cell, trace.row, trace.output) == row[:-1]


def _sound_note(row: tuple[Any, ...]) -> bool:
    key, text, sha256 = row
    return bool(sha256 == digest(key, text))


_SALVAGED: dict[str, tuple[str, Callable[[tuple[Any, ...]], bool]]] = {
    "chunks": ("cell, number, sha256, payload", _sound_chunk),
    "traces": ("cell, row, output, payload", _sound_trace),
    "notes": ("key, value, sha256", _sound_note),
}


# -------------------------------------------------------------------------------------------------------------- mending
def mend(path: Path) -> int:
    """Take out what is damaged so that it is done again; how many chunks are kept.

    A fault of the file itself is mended by copying everything whole into a new file. Raises `CampaignError` when no
    copy of the head is whole; then nothing is changed.
    """
    found = verify(path)
    if found.faults:
        with errors_in_words(path, "mend the ledger"), closing(locked(path)):
            _rebuild(path)
    with Ledger.open(path, write=True) as ledger:
        for cell, number in found.damaged:
            ledger.drop(cell, number)
        return len(ledger.done())


def _rebuild(path: Path) -> None:
    """Replace a ledger by a new one with all of it that is whole."""
    with scratch("mend", path) as folder:
        copy, draft = folder / "damaged", folder / "mended"
        shutil.copyfile(path, copy)
        log.replay(files(path)[1], copy)
        make_empty(draft)
        _renew_first_page(copy, draft)
        with closing(sqlite3.connect(copy, isolation_level=None)) as damaged:
            for pragma in ("journal_mode = OFF", "synchronous = OFF"):
                damaged.execute(f"PRAGMA {pragma}")
            leaves = _leaves(copy)
            payloads = [row[0] for table in HEADS for row in _rows(damaged, table, "payload", leaves)]
            for payload in payloads:
                with suppress(CampaignError):
                    put_head(draft, chunk_format.unpack_head(payload))
                    break
            else:
                raise CampaignError(f"{path}: no copy of its head is whole; begin the campaign anew in another file")
            _salvage(damaged, draft, leaves)
        install(draft, path)


def _salvage(damaged: sqlite3.Connection, draft: Path, leaves: Sequence[int]) -> None:
    """Copy all that is whole; a note or trace that only a lost leaf has may be an old one, and is left behind."""
    with closing(sqlite3.connect(draft)) as mended, mended:
        for table, (columns, sound) in _SALVAGED.items():
            marks = ", ".join("?" * len(columns.split(",")))
            rows = _rows(damaged, table, columns, leaves if table == "chunks" else ())
            whole = (row for row in rows if sound(row))
            mended.executemany(f"INSERT OR IGNORE INTO {table} ({columns}) VALUES ({marks})", whole)


def _renew_first_page(damaged: Path, fresh: Path) -> None:
    """Give a damaged ledger the first page of a new one.

    It holds SQLite's own header and the definitions of the tables (SQLite, Database File Format, 1.3): they are the
    same in every ledger, but for the number of pages (byte 28) and the list of free ones (bytes 32 to 39), which may
    be forgotten.
    """
    new = fresh.read_bytes()
    pages = max(-(-damaged.stat().st_size // PAGE), len(new) // PAGE)  # a file that was cut short gets empty pages
    with damaged.open("r+b") as file:
        file.truncate(pages * PAGE)
        file.write(new[:28] + pages.to_bytes(4, "big") + bytes(8) + new[40:PAGE])


def _rows(damaged: sqlite3.Connection, table: str, columns: str, leaves: Sequence[int]) -> Iterator[tuple[Any, ...]]:
    """Every row that can still be read, most of them twice: in order as far as that goes, then from each leaf.

    A leaf of a tree is a small tree by itself, so SQLite reads it as if it were the whole table. It does so for those
    of other tables, too: what comes out has to be checked.
    """
    with suppress(sqlite3.Error):
        yield from damaged.execute(f"SELECT {columns} FROM {table} NOT INDEXED")
    for leaf in leaves:
        damaged.execute("PRAGMA writable_schema = ON")
        damaged.execute("UPDATE sqlite_master SET rootpage = ? WHERE name = ?", (leaf, table))
        damaged.execute("PRAGMA writable_schema = RESET")
        with suppress(sqlite3.Error):
            yield from damaged.execute(f"SELECT {columns} FROM {table} NOT INDEXED")


def _leaves(path: Path) -> list[int]:
    """Numbers of the pages that begin as a leaf of a table does (SQLite, Database File Format, 1.6)."""
    with path.open("rb") as file:
        pages = iter(lambda: file.read(PAGE), b"")
        return [number for number, page in enumerate(pages, 1) if page[0] == LEAF and number > 1]
