"""The ledger of a campaign: one SQLite file that has each finished chunk with its checksum.

Write-ahead log and ``synchronous = FULL``: a chunk that `Ledger.put` returned from survives a kill and a power loss.
The log needs shared memory, so the file must be on a disk of this machine, not on a network file system. One process
writes: it holds a lock on the empty file ``<ledger>.lock``, which the operating system drops however the process ends;
the file itself stays, since taking it away would let two writers pass each other. Anybody may read meanwhile.

The file itself is in `file`; checks of every byte and mending are in `mending`.
"""

import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any, Self

from microrad.campaign.ledger import chunk_format, file
from microrad.campaign.ledger.chunk_format import Head
from microrad.campaign.records import CampaignError, Chunk, WorstTrace


class Ledger:
    """An open ledger; see `create` and `open`. Use it as a context manager, in one thread."""

    def __init__(self, path: Path, connection: sqlite3.Connection, lock: sqlite3.Connection | None) -> None:
        """For `create` and `open`, which see.

        Args:
            path: the file.
            connection: to it.
            lock: the right to write, None to read only.
        """
        self.path = path
        self._connection = connection
        self._lock = lock
        self._columns = self.head.columns

    @classmethod
    def create(cls, path: Path, head: Head, notes: Mapping[str, Any] = MappingProxyType({})) -> Self:
        """A new ledger, open for writing. Raises `CampaignError` if there is already a file or none can be.

        Args:
            path: the file.
            head: what the ledger is of.
            notes: JSON values that are noted from the begin, by name.
        """
        with file.errors_in_words(path, "create the ledger"):
            file.refuse_existing(path)
            with closing(file.locked(path)):
                draft = file.draft_of(path)
                file.make_empty(draft)
                file.put_head(draft, head, notes)
                file.refuse_existing(path)
                file.install(draft, path)
        return cls.open(path, write=True)

    @classmethod
    def open(cls, path: Path, *, write: bool) -> Self:
        """The ledger in a file.

        Args:
            path: the file.
            write: whether to write to it, which one process at a time may.

        Raises `CampaignError` if it is no ledger, or if another process already writes to it.
        """
        with file.errors_in_words(path, "open the ledger"):
            file.refuse_foreign(path)
            lock = file.locked(path) if write else None
            try:
                ledger = cls(path, file.connected(path, write=write), lock)
            except BaseException:
                if lock is not None:
                    lock.close()
                raise
            try:
                if write:
                    ledger.note("writer", file.this_process())
            except BaseException:
                ledger.close()
                raise
            return ledger

    def __enter__(self) -> Self:
        """The ledger itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""
        self.close()

    def close(self) -> None:
        """Close the file and give up the right to write; may be called twice."""
        with suppress(sqlite3.Error):  # a full disk or damage: every chunk that is in stays in, in the log if need be
            self._connection.close()
        if self._lock is not None:
            self._lock.close()

    # --------------------------------------------------------------------------------------------------------- chunks
    def put(self, cell: int, number: int, payload: bytes) -> None:
        """Keep a chunk for good. The same chunk once more changes nothing.

        Raises `CampaignError` for bytes that are not this chunk, a chunk that is in with other content, columns that
        are not the head's, and for any trouble of the file; then the ledger is as it was before.

        Args:
            cell: the cell of the grid.
            number: the chunk's number in it.
            payload: the bytes that `chunk_format.pack_chunk` made of it.
        """
        self._check_chunk(cell, number, payload)
        with self._writing(f"keep chunk {number} of cell {cell}"):
            row = (cell, number, file.digest(cell, number, payload), payload)
            added = self._connection.execute("INSERT OR IGNORE INTO chunks VALUES (?, ?, ?, ?)", row).rowcount
            if not added and self.get(cell, number) != payload:
                raise CampaignError(
                    f"{self.path}: chunk {number} of cell {cell} came out otherwise than when it was first done: the "
                    "workers do not compute the same; check that all run the same microrad and libraries"
                )

    def get(self, cell: int, number: int) -> bytes | None:
        """The bytes of a chunk, None where it is not done. Raises `CampaignError` if they are damaged.

        Args:
            cell: the cell of the grid.
            number: the chunk's number in it.
        """
        with file.errors_in_words(self.path, f"read chunk {number} of cell {cell}"):
            wanted = "SELECT sha256, payload FROM chunks WHERE cell = ? AND number = ?"
            row = self._connection.execute(wanted, (cell, number)).fetchone()
        return None if row is None else self._sound(cell, number, *row)

    def done(self) -> set[tuple[int, int]]:
        """Cell and number of every chunk that is in."""
        with file.errors_in_words(self.path, "read what is done"):
            return set(self._connection.execute("SELECT cell, number FROM chunks"))

    def chunks(self, cell: int) -> Iterator[Chunk]:
        """The chunks of a cell in the order of their numbers, one at a time. Raises `CampaignError` if damaged."""
        with file.errors_in_words(self.path, f"read the chunks of cell {cell}"):
            wanted = "SELECT number, sha256, payload FROM chunks WHERE cell = ? ORDER BY number"
            for number, sha256, payload in self._connection.execute(wanted, (cell,)):
                yield chunk_format.unpack_chunk(self._sound(cell, number, sha256, payload))

    def added(self, mark: int) -> Iterator[tuple[int, Chunk]]:
        """The chunks that came in behind a mark, 0 for all, in that order, each with its own mark.

        Raises `CampaignError` if damaged.
        """
        with file.errors_in_words(self.path, "read what was added"):
            wanted = "SELECT rowid, cell, number, sha256, payload FROM chunks WHERE rowid > ? ORDER BY rowid"
            for at, cell, number, sha256, payload in self._connection.execute(wanted, (mark,)):
                yield at, chunk_format.unpack_chunk(self._sound(cell, number, sha256, payload))

    def count(self) -> int:
        """How many chunks are in."""
        with file.errors_in_words(self.path, "count what is done"):
            return int(self._connection.execute("SELECT count(*) FROM chunks").fetchone()[0])

    @contextmanager
    def still(self) -> Iterator[None]:
        """Within it, what is read is as it was when the first thing was, whatever is written meanwhile."""
        self._connection.execute("BEGIN")
        try:
            yield
        finally:
            self._connection.execute("COMMIT")

    # ------------------------------------------------------------------------------------------------ all that is small
    @property
    def head(self) -> Head:
        """What the ledger is of. Raises `CampaignError` if neither of its two copies is whole."""
        return file.whole_head(self.path, self._connection)

    def put_trace(self, trace: WorstTrace) -> None:
        """Keep a trace, in place of one of the same row and output."""
        with self._writing(f"keep the trace of row {trace.row} of cell {trace.cell}"):
            row = (trace.cell, trace.row, trace.output, chunk_format.pack_trace(trace))
            self._connection.execute("INSERT OR REPLACE INTO traces VALUES (?, ?, ?, ?)", row)

    def traces(self) -> tuple[WorstTrace, ...]:
        """All traces by cell, output and row."""
        with file.errors_in_words(self.path, "read the traces"):
            wanted = "SELECT payload FROM traces ORDER BY cell, output, row"
            return tuple(chunk_format.unpack_trace(row[0]) for row in self._connection.execute(wanted))

    def drop_trace(self, trace: WorstTrace) -> None:
        """Take a trace out: it is no longer among the worst."""
        with self._writing(f"drop the trace of row {trace.row} of cell {trace.cell}"):
            wanted = "DELETE FROM traces WHERE cell = ? AND row = ? AND output = ?"
            self._connection.execute(wanted, (trace.cell, trace.row, trace.output))

    def note(self, key: str, value: Any) -> None:
        """Keep a JSON value by name, in place of the last one.

        Args:
            key: the name.
            value: anything that JSON has.
        """
        with self._writing(f"note {key!r}"):
            file.put_note(self._connection, key, value)

    def notes(self) -> dict[str, Any]:
        """All noted values by name; a damaged one is left out, as if it had not been noted."""
        with file.errors_in_words(self.path, "read the notes"):
            return file.notes_in(self._connection)

    def _sound(self, cell: int, number: int, sha256: bytes, payload: bytes) -> bytes:
        """The payload of a chunk if its checksum is right."""
        if sha256 == file.digest(cell, number, payload):
            return payload
        raise CampaignError(
            f"{self.path}: chunk {number} of cell {cell} is damaged, its checksum differs; "
            f"`microrad campaign resume {file.argument(self.path)}` does it again"
        )

    def _check_chunk(self, cell: int, number: int, payload: bytes) -> None:
        chunk = chunk_format.unpack_chunk(payload)
        if (chunk.cell, chunk.number) != (cell, number):
            raise CampaignError(f"chunk {chunk.number} of cell {chunk.cell} came for chunk {number} of cell {cell}")
        wanted = tuple(column.name for column in self._columns)
        if tuple(chunk.columns) != wanted:
            raise CampaignError(
                f"chunk {number} of cell {cell} has the columns {', '.join(chunk.columns)}, and the ledger is of "
                f"{', '.join(wanted)}: its worker runs another microrad"
            )

    @contextmanager
    def _writing(self, what: str) -> Iterator[None]:
        """One transaction: all of it is kept, or nothing."""
        if self._lock is None:
            raise CampaignError(f"{self.path} is open for reading, so microrad cannot {what}")
        with file.errors_in_words(self.path, what):
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._connection.execute("COMMIT")
            except BaseException:
                with suppress(sqlite3.Error):  # SQLite may have rolled back by itself
                    self._connection.execute("ROLLBACK")
                raise


def check_same(kept: Mapping[str, str], now: Mapping[str, str], path: Path) -> None:
    """Raises `CampaignError`, with both hashes of all that differs, if a ledger is of something else than is there now.

    Args:
        kept: the hashes in the ledger's head, by what they are of.
        now: those of what is there now.
        path: the ledger.
    """
    differing = [name for name in sorted({*kept, *now}) if kept.get(name) != now.get(name)]
    if differing:
        lines = [f"  {name}: {kept.get(name)} in the ledger, {now.get(name)} now" for name in differing]
        raise CampaignError(
            f"{path} was begun with another {' and '.join(differing)}, so its rows would not belong together:\n"
            + "\n".join(lines)
            + "\nbring back what it was begun with, or begin the campaign anew in another file"
        )
