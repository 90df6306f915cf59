"""The ledger of a campaign: one SQLite file that has each finished chunk with its checksum.

Write-ahead log and ``synchronous = FULL``: a chunk that `Ledger.put` returned from survives a kill and a power loss.
The log needs shared memory, so the file must be on a disk of this machine, not on a network file system. One process
writes: it holds a lock on the empty file ``<ledger>.lock``, which the operating system drops however the process ends;
the file itself stays, since taking it away would let two writers pass each other. Anybody may read meanwhile.
"""

import hashlib
import json
import os
import platform
import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from microrad.campaign import blob
from microrad.campaign.blob import Head
from microrad.campaign.records import CampaignError, Chunk, WorstTrace

FORMAT = blob.VERSION  # one number for both, so that what another microrad wrote is never mended into this format
_APPLICATION = 0x6D726164  # "mrad": SQLite's application_id, so that another program's file is told from a ledger
_HEADS = ("head", "head_again")  # two tables, so that no page has both
_PAGE = 4096
_NOT_DAMAGE = {
    *(sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_READONLY),
    *(sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_PERM, sqlite3.SQLITE_BUSY),
}
_GLANCE_S = 0.5  # longer than `is_written` holds the lock
_PATIENCE_S = 30.0  # how long another program may hold the file, such as a copy being made
_TABLES = """
CREATE TABLE head(payload BLOB NOT NULL);
CREATE TABLE head_again(payload BLOB NOT NULL);
CREATE TABLE chunks(cell INTEGER NOT NULL, number INTEGER NOT NULL, sha256 BLOB NOT NULL, payload BLOB NOT NULL,
    UNIQUE(cell, number));
CREATE TABLE traces(cell INTEGER NOT NULL, row INTEGER NOT NULL, output TEXT NOT NULL, payload BLOB NOT NULL,
    UNIQUE(cell, row, output));
CREATE TABLE notes(key TEXT NOT NULL UNIQUE, value TEXT NOT NULL, sha256 BLOB NOT NULL);
"""


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


class Ledger:
    """An open ledger; see `create` and `open`. Use it as a context manager, in one thread."""

    def __init__(self, path: Path, connection: sqlite3.Connection, lock: sqlite3.Connection | None) -> None:
        """For `create` and `open`, which see."""
        self.path = path
        self._connection = connection
        self._lock = lock
        self._columns = self.head.columns

    @classmethod
    def create(cls, path: Path, head: Head) -> Self:
        """A new ledger, open for writing. Raises `CampaignError` where there is already a file or none can be."""
        with _told(path, "create the ledger"):
            _refuse_existing(path)
            with closing(_locked(path)):
                draft = path.with_name(f".{path.name}.part")  # the lock is ours: what is there is a dead process's
                _new(draft)
                _put_head(draft, head)
                _refuse_existing(path)
                _install(draft, path)
        return cls.open(path, write=True)

    @classmethod
    def open(cls, path: Path, *, write: bool) -> Self:
        """The ledger in a file. Raises `CampaignError` where it is none, or where another process already writes."""
        if not path.is_file():
            raise CampaignError(f"there is no ledger {path}: begin the campaign with `microrad campaign run`")
        with _told(path, "open the ledger"), ExitStack() as undo:
            lock = undo.enter_context(closing(_locked(path))) if write else None
            ledger = cls(path, undo.enter_context(closing(_connected(path, write=write))), lock)
            if write:
                ledger.note("writer", _me())
            undo.pop_all()
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
        """
        self._check_chunk(cell, number, payload)
        with self._writing(f"keep chunk {number} of cell {cell}"):
            row = (cell, number, _digest(cell, number, payload), payload)
            added = self._connection.execute("INSERT OR IGNORE INTO chunks VALUES (?, ?, ?, ?)", row).rowcount
            if not added and self.get(cell, number) != payload:
                raise CampaignError(
                    f"{self.path}: chunk {number} of cell {cell} came out otherwise than when it was first done: the "
                    "workers do not compute the same; check that all run the same microrad and libraries"
                )

    def get(self, cell: int, number: int) -> bytes | None:
        """The bytes of a chunk, None where it is not done. Raises `CampaignError` where they are damaged."""
        with _told(self.path, f"read chunk {number} of cell {cell}"):
            wanted = "SELECT sha256, payload FROM chunks WHERE cell = ? AND number = ?"
            row = self._connection.execute(wanted, (cell, number)).fetchone()
        return None if row is None else self._sound(cell, number, *row)

    def done(self) -> set[tuple[int, int]]:
        """Cell and number of every chunk that is in."""
        with _told(self.path, "read what is done"):
            return set(self._connection.execute("SELECT cell, number FROM chunks"))

    def chunks(self, cell: int) -> Iterator[Chunk]:
        """The chunks of a cell in the order of their numbers, one at a time. Raises `CampaignError` if damaged."""
        with _told(self.path, f"read the chunks of cell {cell}"):
            wanted = "SELECT number, sha256, payload FROM chunks WHERE cell = ? ORDER BY number"
            for number, digest, payload in self._connection.execute(wanted, (cell,)):
                yield blob.unpack_chunk(self._sound(cell, number, digest, payload))

    def drop(self, cell: int, number: int) -> None:
        """Take a chunk out, so that it is done again."""
        with self._writing(f"drop chunk {number} of cell {cell}"):
            self._connection.execute("DELETE FROM chunks WHERE cell = ? AND number = ?", (cell, number))

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
        """What the ledger is of. Raises `CampaignError` when neither of its two copies is whole."""
        for table in _HEADS:
            with suppress(CampaignError, sqlite3.Error):
                return self._head(table)
        raise CampaignError(
            f"{self.path}: both copies of its head are damaged; begin the campaign anew in another file"
        )

    def put_trace(self, trace: WorstTrace) -> None:
        """Keep a trace, in place of one of the same row and output."""
        with self._writing(f"keep the trace of row {trace.row} of cell {trace.cell}"):
            row = (trace.cell, trace.row, trace.output, blob.pack_trace(trace))
            self._connection.execute("INSERT OR REPLACE INTO traces VALUES (?, ?, ?, ?)", row)

    def traces(self) -> tuple[WorstTrace, ...]:
        """All traces by cell, output and row."""
        with _told(self.path, "read the traces"):
            wanted = "SELECT payload FROM traces ORDER BY cell, output, row"
            return tuple(blob.unpack_trace(row[0]) for row in self._connection.execute(wanted))

    def drop_trace(self, trace: WorstTrace) -> None:
        """Take a trace out: it is no longer among the worst."""
        with self._writing(f"drop the trace of row {trace.row} of cell {trace.cell}"):
            wanted = "DELETE FROM traces WHERE cell = ? AND row = ? AND output = ?"
            self._connection.execute(wanted, (trace.cell, trace.row, trace.output))

    def note(self, key: str, value: Any) -> None:
        """Keep a JSON value by name, in place of the last one."""
        text = json.dumps(value, sort_keys=True)
        with self._writing(f"note {key!r}"):
            row = (key, text, _digest(key, text))
            kept = "ON CONFLICT(key) DO UPDATE SET value = excluded.value, sha256 = excluded.sha256"
            self._connection.execute(f"INSERT INTO notes VALUES (?, ?, ?) {kept}", row)

    def notes(self) -> dict[str, Any]:
        """All noted values by name; a damaged one is left out, as if it had not been noted."""
        with _told(self.path, "read the notes"):
            rows = self._connection.execute("SELECT key, value, sha256 FROM notes").fetchall()
        return {key: json.loads(text) for key, text, digest in rows if digest == _digest(key, text)}

    # ---------------------------------------------------------------------------------------------------------- checks
    def verify(self, expected: Iterable[tuple[int, int]] = ()) -> Verified:
        """Compute every checksum anew and have SQLite check its own structure; damage is found, not raised."""
        faults = [*self._structure(), *self._small_faults()]
        checked, damaged = 0, []
        try:
            for cell, number, digest, payload in self._connection.execute(_CHUNKS + " ORDER BY cell, number"):
                right = digest == _digest(cell, number, payload)
                checked += right
                damaged += [] if right else [(cell, number)]
            there = set(self._connection.execute("SELECT cell, number FROM chunks"))
        except sqlite3.Error as error:
            return Verified(checked, tuple(damaged), (), (*faults, f"the table of chunks cannot be read: {error}"))
        return Verified(checked, tuple(damaged), tuple(sorted(set(expected) - there)), tuple(faults))

    def _structure(self) -> list[str]:
        """What SQLite finds wrong with its file."""
        try:
            found = [str(row[0]) for row in self._connection.execute("PRAGMA integrity_check(20)")]
        except sqlite3.Error as error:
            return [f"SQLite cannot check its file: {error}"]
        return [f"SQLite: {each}" for each in found if each != "ok"]

    def _small_faults(self) -> list[str]:
        """What is wrong with the head, the traces and the notes."""
        faults = []
        for copy, table in enumerate(_HEADS, 1):
            try:
                self._head(table)
            except (CampaignError, sqlite3.Error) as error:
                faults.append(f"copy {copy} of the head: {error}")
        for table, keys in (("traces", 3), ("notes", 1)):
            columns, sound = _SALVAGED[table]
            try:
                rows = self._connection.execute(f"SELECT {columns} FROM {table}")
                faults += [f"damaged among the {table}: {row[:keys]}" for row in rows if not sound(row)]
            except sqlite3.Error as error:
                faults.append(f"the table of {table} cannot be read: {error}")
        return faults

    def _head(self, table: str) -> Head:
        row = self._connection.execute(f"SELECT payload FROM {table}").fetchone()
        return blob.unpack_head(b"" if row is None else row[0])

    def _sound(self, cell: int, number: int, digest: bytes, payload: bytes) -> bytes:
        """The payload of a chunk if its checksum is right."""
        if digest == _digest(cell, number, payload):
            return payload
        raise CampaignError(
            f"{self.path}: chunk {number} of cell {cell} is damaged, its checksum differs; "
            f"`microrad campaign verify {self.path}` takes it out, and resuming does it again"
        )

    def _check_chunk(self, cell: int, number: int, payload: bytes) -> None:
        chunk = blob.unpack_chunk(payload)
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
        with _told(self.path, what):
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._connection.execute("COMMIT")
            except BaseException:
                with suppress(sqlite3.Error):  # SQLite may have rolled back by itself
                    self._connection.execute("ROLLBACK")
                raise


def verify(path: Path, expected: Iterable[tuple[int, int]] = ()) -> Verified:
    """`Ledger.verify` of a file, however damaged: what keeps it from being opened is a fault, too.

    Raises `CampaignError` where there is no file, or where the file cannot be read for another reason than damage.
    """
    if not path.is_file():
        raise CampaignError(f"there is no ledger {path}")
    try:
        with Ledger.open(path, write=False) as ledger:
            return ledger.verify(expected)
    except CampaignError as error:
        if isinstance(error.__cause__, OSError) or _code(error.__cause__) in _NOT_DAMAGE:
            raise
        return Verified(0, (), (), (str(error),))


def mend(path: Path) -> int:
    """Take out what is damaged so that it is done again; how many chunks are kept.

    A fault of the file itself is mended by copying everything whole into a new file. Raises `CampaignError` when no
    copy of the head is whole; then nothing is changed.
    """
    found = verify(path)
    if found.faults:
        with _told(path, "mend the ledger"), closing(_locked(path)):
            _rebuild(path)
    with Ledger.open(path, write=True) as ledger:
        for cell, number in found.damaged:
            ledger.drop(cell, number)
        return len(ledger.done())


def _rebuild(path: Path) -> None:
    """Replace a ledger by a new one with all of it that is whole."""
    with tempfile.TemporaryDirectory(prefix=f".{path.name}-", suffix=".part", dir=path.parent) as folder:
        copy, draft = Path(folder, "damaged"), Path(folder, "mended")
        for old, new in zip(_files(path)[:2], _files(copy)[:2], strict=True):  # the file and its log
            if old.exists():
                shutil.copyfile(old, new)
        _new(draft)
        _renew_first_page(copy, draft)
        with closing(sqlite3.connect(copy, isolation_level=None)) as damaged:
            for pragma in ("journal_mode = OFF", "synchronous = OFF"):  # the log goes into the copy here
                damaged.execute(f"PRAGMA {pragma}")
            leaves = _leaves(copy)
            payloads = [row[0] for table in _HEADS for row in _rows(damaged, table, "payload", leaves)]
            heads = [blob.unpack_head(payload) for payload in payloads if _is_head(payload)]
            if not heads:
                raise CampaignError(f"{path}: no copy of its head is whole; begin the campaign anew in another file")
            _put_head(draft, heads[0])
            _salvage(damaged, draft, leaves)
        _install(draft, path)


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
    pages = max(-(-damaged.stat().st_size // _PAGE), len(new) // _PAGE)  # a file that was cut short gets empty pages
    with damaged.open("r+b") as file:
        file.truncate(pages * _PAGE)
        file.write(new[:28] + pages.to_bytes(4, "big") + bytes(8) + new[40:_PAGE])


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
        pages = iter(lambda: file.read(_PAGE), b"")
        return [number for number, page in enumerate(pages, 1) if page[0] == 13 and number > 1]


def is_written(path: Path) -> bool:
    """Whether a living process writes to a ledger."""
    lock = _lock_of(path)
    if not lock.exists():
        return False
    with closing(sqlite3.connect(f"{lock.absolute().as_uri()}?mode=rw", uri=True, timeout=0.0)) as glance:
        try:
            glance.execute("BEGIN IMMEDIATE")
        except sqlite3.Error as error:  # a lock that cannot be written to is nobody's
            return _code(error) == sqlite3.SQLITE_BUSY
    return False


def check_same(kept: Mapping[str, str], now: Mapping[str, str], path: Path) -> None:
    """Raise `CampaignError` with both hashes of all that differs between a ledger's head and the present."""
    differing = [name for name in sorted({*kept, *now}) if kept.get(name) != now.get(name)]
    if differing:
        lines = [f"  {name}: {kept.get(name)} in the ledger, {now.get(name)} now" for name in differing]
        raise CampaignError(
            f"{path} was begun with another {' and '.join(differing)}, so its rows would not belong together:\n"
            + "\n".join(lines)
            + "\nbring back what it was begun with, or begin the campaign anew in another file"
        )


_CHUNKS = "SELECT cell, number, sha256, payload FROM chunks"


def _digest(*parts: int | str | bytes) -> bytes:
    """SHA-256 over the parts, each with its length before it."""
    digest = hashlib.sha256()
    for part in parts:
        data = part if isinstance(part, bytes) else str(part).encode()
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.digest()


def _sound_chunk(row: tuple[Any, ...]) -> bool:
    cell, number, digest, payload = row
    return bool(digest == _digest(cell, number, payload))


def _is_head(payload: Any) -> bool:
    try:
        blob.unpack_head(payload)
    except CampaignError:
        return False
    return True


def _sound_trace(row: tuple[Any, ...]) -> bool:
    try:
        trace = blob.unpack_trace(row[-1])
    except CampaignError:
        return False
    return (trace.cell, trace.row, trace.output) == row[:-1]


def _sound_note(row: tuple[Any, ...]) -> bool:
    key, text, digest = row
    return bool(digest == _digest(key, text))


_SALVAGED: dict[str, tuple[str, Callable[[tuple[Any, ...]], bool]]] = {
    "chunks": ("cell, number, sha256, payload", _sound_chunk),
    "traces": ("cell, row, output, payload", _sound_trace),
    "notes": ("key, value, sha256", _sound_note),
}


# ---------------------------------------------------------------------------------------------------------- the file
def _new(path: Path) -> None:
    """Make a ledger without anything in it; what was there goes."""
    for name in _files(path):
        name.unlink(missing_ok=True)
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        for pragma in (f"page_size = {_PAGE}", f"application_id = {_APPLICATION}", f"user_version = {FORMAT}"):
            connection.execute(f"PRAGMA {pragma}")
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("BEGIN")
        for statement in _TABLES.split(";"):
            connection.execute(statement)
        connection.execute("COMMIT")


def _put_head(path: Path, head: Head) -> None:
    """Write both copies of the head: one would be all that stands between a flipped bit and the whole campaign."""
    payload = blob.pack_head(head)
    with closing(sqlite3.connect(path)) as connection, connection:
        for table in _HEADS:
            connection.execute(f"INSERT INTO {table} VALUES (?)", (payload,))


def _install(draft: Path, path: Path) -> None:
    """Put a closed ledger in its place for good: the name, too, has to survive a power loss."""
    for name in _files(path)[1:]:
        name.unlink(missing_ok=True)  # a log that is left over would be taken for the new file's
    draft.replace(path)
    if os.name == "posix":  # elsewhere a folder cannot be opened, and its entries need no sync
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def _files(path: Path) -> tuple[Path, ...]:
    """The files that SQLite keeps a ledger in."""
    return tuple(path.with_name(path.name + suffix) for suffix in ("", "-wal", "-shm", "-journal"))


def _refuse_existing(path: Path) -> None:
    if not path.parent.is_dir():
        raise CampaignError(f"there is no folder {path.parent} for {path.name}: make it, or choose another")
    if path.exists():
        raise CampaignError(f"there is already {path}: go on with `microrad campaign resume {path}`, or choose another")


def _connected(path: Path, *, write: bool) -> sqlite3.Connection:
    """A connection to a ledger, known to be one of this format."""
    try:
        return _opened(path, "mode=rw", write)
    except sqlite3.OperationalError:
        if write or os.access(path.parent, os.W_OK) or _files(path)[1].exists():
            raise
        return _opened(path, "immutable=1", write)  # where nobody can write, no log can be made and none is needed


def _opened(path: Path, mode: str, write: bool) -> sqlite3.Connection:
    """A connection, which to read only still takes the log in when it is the last to close, and leaves no files."""
    connection = sqlite3.connect(f"{path.absolute().as_uri()}?{mode}", uri=True, timeout=_PATIENCE_S)
    try:
        connection.isolation_level = None
        for pragma in ("synchronous = FULL", "fullfsync = ON", f"query_only = {not write}"):  # fullfsync is for macOS
            connection.execute(f"PRAGMA {pragma}")
        _check_format(path, connection)
        return connection
    except BaseException:
        connection.close()
        raise


def _check_format(path: Path, connection: sqlite3.Connection) -> None:
    """Raise unless this is a ledger of this format."""
    application, version = (
        connection.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version")
    )
    if application != _APPLICATION:
        raise CampaignError(
            f"{path} is an SQLite file, but no ledger of microrad, or its first page is damaged: choose another file"
        )
    if version != FORMAT:
        raise CampaignError(
            f"{path} is a ledger of format {version}, and this microrad knows {FORMAT}: use the microrad that began it"
        )


def _lock_of(path: Path) -> Path:
    return path.with_name(path.name + ".lock")


def _locked(path: Path) -> sqlite3.Connection:
    """The right to write, for as long as the connection is open and the process lives."""
    lock = sqlite3.connect(_lock_of(path), timeout=_GLANCE_S, isolation_level=None)
    try:
        lock.execute("PRAGMA journal_mode = MEMORY")  # no further file beside it
        lock.execute("BEGIN IMMEDIATE")
    except sqlite3.OperationalError as error:
        lock.close()
        if _code(error) != sqlite3.SQLITE_BUSY:
            raise
        raise CampaignError(
            f"{_writer(path)} already writes to {path}: wait for it or stop it; how far it is says "
            f"`microrad campaign status {path}`"
        ) from None
    return lock


def _me() -> dict[str, Any]:
    return {"pid": os.getpid(), "host": platform.node(), "since": datetime.now(UTC).isoformat(timespec="seconds")}


def _writer(path: Path) -> str:
    """Who writes to a ledger, as noted there."""
    with suppress(CampaignError, sqlite3.Error, KeyError), Ledger(path, _connected(path, write=False), None) as ledger:
        who = ledger.notes()["writer"]
        return f"process {who['pid']} on {who['host']}, since {who['since']},"
    return "another process"


def _code(error: BaseException | None) -> int:
    """SQLite's primary result code; 0 where the error is the module's own."""
    return int(getattr(error, "sqlite_errorcode", 0)) & 0xFF


@contextmanager
def _told(path: Path, what: str) -> Iterator[None]:
    """Turn the errors of SQLite and of the file system into words: what failed, what is in, what to do."""
    try:
        yield
    except sqlite3.Error as error:
        raise CampaignError(f"{path}: microrad could not {what}: {_words(error, path)}") from error
    except OSError as error:
        raise CampaignError(f"{path}: microrad could not {what}: {error.strerror or error}") from error


def _words(error: sqlite3.Error, path: Path) -> str:
    """What an error of SQLite means for the campaign, and what to do."""
    by_code = {
        sqlite3.SQLITE_FULL: ("the disk is full", "Free space"),
        sqlite3.SQLITE_IOERR: (f"the disk does not take or give the data ({error})", "Check the disk and its space"),
        sqlite3.SQLITE_READONLY: (str(error), "Make file and folder writable"),
        sqlite3.SQLITE_CANTOPEN: (str(error), "Make file and folder readable and writable"),
        sqlite3.SQLITE_PERM: (str(error), "Make file and folder readable and writable"),
        sqlite3.SQLITE_BUSY: (f"another program held the file for longer than {_PATIENCE_S:g} s", "Close that program"),
        sqlite3.SQLITE_CORRUPT: (f"the file is damaged ({error})", f"Mend it with `microrad campaign verify {path}`"),
        sqlite3.SQLITE_NOTADB: (
            "it is no ledger, or its first page is damaged",
            f"If it was one, mend it with `microrad campaign verify {path}`",
        ),
    }
    what, remedy = by_code.get(_code(error), (str(error), "See to that"))
    return f"{what}. {_safe(path)}{remedy}, then go on with `microrad campaign resume {path}`"


def _safe(path: Path) -> str:
    """How many chunks are in, if that can be told."""
    try:
        with closing(_connected(path, write=False)) as connection:
            count = connection.execute("SELECT count(*) FROM chunks").fetchone()[0]
    except (CampaignError, sqlite3.Error):
        return ""
    return f"{count} chunks are in and stay; only what was being written is lost. "
