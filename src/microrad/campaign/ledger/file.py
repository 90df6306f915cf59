"""The SQLite file that a ledger is kept in: making, opening and locking it, its errors in words, its checksums."""

import hashlib
import json
import os
import platform
import shlex
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

from microrad.campaign.ledger import chunk_format
from microrad.campaign.ledger.chunk_format import Head
from microrad.campaign.records import CampaignError
from microrad.core.folder import path_argument

FORMAT = chunk_format.VERSION
_APPLICATION = 0x6D726164  # "mrad": SQLite's application_id, so that another program's file is told from a ledger
HEADS = ("head", "head_again")  # two tables, so that no page has both
_GLANCE_S = 0.5  # longer than `is_written` holds the lock
PATIENCE_S = 30.0  # how long another program may hold the file, such as a copy being made
_OTHER = "name the file that `microrad campaign run` wrote, or, if it is this one, begin the campaign anew in another"
_TABLES = """
CREATE TABLE head(payload BLOB NOT NULL);
CREATE TABLE head_again(payload BLOB NOT NULL);
CREATE TABLE chunks(cell INTEGER NOT NULL, number INTEGER NOT NULL, sha256 BLOB NOT NULL, payload BLOB NOT NULL,
    UNIQUE(cell, number));
CREATE TABLE traces(cell INTEGER NOT NULL, row INTEGER NOT NULL, output TEXT NOT NULL, payload BLOB NOT NULL,
    UNIQUE(cell, row, output));
CREATE TABLE notes(key TEXT NOT NULL UNIQUE, value TEXT NOT NULL, sha256 BLOB NOT NULL);
"""


def make_empty(path: Path) -> None:
    """Make a ledger without anything in it; what was there goes."""
    for name in files(path):
        name.unlink(missing_ok=True)
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("BEGIN")
        for pragma in (f"application_id = {_APPLICATION}", f"user_version = {FORMAT}"):
            connection.execute(f"PRAGMA {pragma}")
        for statement in _TABLES.split(";"):
            connection.execute(statement)
        connection.execute("COMMIT")


def put_head(path: Path, head: Head, notes: Mapping[str, Any]) -> None:
    """Write both copies of the head: one would be all that stands between a flipped bit and the whole campaign.

    Args:
        path: an empty ledger.
        head: what it is of.
        notes: what is noted from the begin, by name.
    """
    payload = chunk_format.pack_head(head)
    with closing(sqlite3.connect(path)) as connection, connection:
        for table in HEADS:
            connection.execute(f"INSERT INTO {table} VALUES (?)", (payload,))
        for key, value in notes.items():
            put_note(connection, key, value)


def install(draft: Path, path: Path) -> None:
    """Put a closed ledger in its place for good: the name, too, has to survive a power loss.

    It has a log from here on alone: a log is taken in as a file is closed, and nobody hears where that fails.

    Args:
        draft: where it was made.
        path: its place.
    """
    with closing(sqlite3.connect(draft, isolation_level=None)) as connection:
        connection.execute("PRAGMA journal_mode = WAL")
    for name in (*files(draft)[1:], *files(path)[1:]):
        name.unlink(missing_ok=True)  # a log that is left over would be taken for the new file's
    draft.replace(path)
    if os.name == "posix":  # elsewhere a folder cannot be opened, and its entries need no sync
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def draft_of(path: Path) -> Path:
    """Where a ledger is made before it is installed: what is there when the lock is free is a dead process's."""
    return path.with_name(f".{path.name}.part")


def files(path: Path) -> tuple[Path, ...]:
    """The files that SQLite keeps a ledger in."""
    return tuple(path.with_name(path.name + suffix) for suffix in ("", "-wal", "-shm", "-journal"))


def argument(path: Path) -> str:
    """A path as it is typed into a command line, in quotes where it needs them."""
    return shlex.quote(path_argument(path))


def refuse_existing(path: Path) -> None:
    """Raises `CampaignError` if no new ledger can be made here."""
    if not path.parent.is_dir():
        raise CampaignError(f"there is no folder {path.parent} for {path.name}: make it, or choose another")
    if is_ledger(path):
        raise CampaignError(
            f"there is already {path}: go on with `microrad campaign resume {argument(path)}`, or name another with "
            "--ledger"
        )
    if os.path.lexists(path):
        raise CampaignError(f"there is already {path}, which is no ledger, and it stays: name another with --ledger")


def is_ledger(path: Path) -> bool:
    """Whether a file is one of SQLite's. Raises `CampaignError` where that cannot be read.

    Only SQLite opens it: to close it otherwise would drop the locks that other connections of this process hold on it
    (SQLite, How To Corrupt, 2.2).
    """
    try:
        if not path.is_file() or not path.stat().st_size:
            return False
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True)) as probe:
            probe.execute("PRAGMA application_id")
        return True
    except UnicodeDecodeError:  # an error of SQLite that quotes a damaged name
        return True
    except (OSError, sqlite3.Error) as error:
        if code_of(error) in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB):
            return code_of(error) == sqlite3.SQLITE_CORRUPT
        raise CampaignError(
            f"{path}: microrad cannot read whether it is a ledger ({getattr(error, 'strerror', None) or error}): make "
            "file and folder readable, or name a file elsewhere, its path shorter than 500 bytes"
        ) from error


def refuse_foreign(path: Path) -> None:
    """Raises `CampaignError` if this is no file of SQLite's."""
    if is_ledger(path):
        return
    if path.is_dir():
        raise CampaignError(f"{path} is a folder, not a ledger: name the file that `microrad campaign run` wrote")
    if not path.is_file():
        raise CampaignError(f"there is no ledger {path}: begin the campaign with `microrad campaign run`")
    begin = f"begin it with `microrad campaign run {argument(path)}`, or name the file that this wrote"
    remedy = begin if path.suffix == ".toml" else _OTHER
    raise CampaignError(f"{path} is no ledger, or its first page is damaged: {remedy}")


def connected(path: Path, *, write: bool) -> sqlite3.Connection:
    """A connection to a ledger, known to be one of this format.

    Args:
        path: the ledger.
        write: whether to write to it.
    """
    try:
        return _opened(path, "mode=rw", write)
    except sqlite3.OperationalError:
        if write or os.access(path.parent, os.W_OK) or files(path)[1].exists():
            raise
        return _opened(path, "immutable=1", write)  # where nobody can write, no log can be made and none is needed


def _opened(path: Path, mode: str, write: bool) -> sqlite3.Connection:
    """A connection, which to read only still takes the log in when it is the last to close, and leaves no files."""
    connection = sqlite3.connect(f"{path.absolute().as_uri()}?{mode}", uri=True, timeout=PATIENCE_S)
    try:
        connection.isolation_level = None
        settings = "trusted_schema = OFF", "synchronous = FULL", "fullfsync = ON"  # the last is for macOS
        for pragma in (*settings, f"query_only = {not write}"):
            connection.execute(f"PRAGMA {pragma}")
        _check_format(path, connection)
        _check_schema(path, connection)
        return connection
    except BaseException:
        connection.close()
        raise


def _check_format(path: Path, connection: sqlite3.Connection) -> None:
    """Raises `CampaignError` if this is no ledger of this format."""
    application, version = (
        connection.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version")
    )
    if application != _APPLICATION:
        raise CampaignError(
            f"{path} is an SQLite file, but no ledger of microrad, or its first page is damaged: {_OTHER}"
        )
    if version != FORMAT:
        raise CampaignError(
            f"{path} is a ledger of format {version}, and this microrad knows {FORMAT}: use the microrad that began it"
        )


_SCHEMA = "SELECT type, name, tbl_name, sql FROM sqlite_master ORDER BY name"


@cache
def _schema() -> tuple[tuple[str, ...], ...]:
    """All that a ledger defines, in SQLite's words."""
    with closing(sqlite3.connect(":memory:")) as empty:
        empty.executescript(_TABLES)
        return tuple(empty.execute(_SCHEMA))


def _check_schema(path: Path, connection: sqlite3.Connection) -> None:
    """Raises `CampaignError` if the file defines anything but the tables of a ledger: a view may compute for ever."""
    found = connection.execute(_SCHEMA).fetchmany(len(_schema()) + 1)
    if tuple(found) != _schema():
        odd = next((row for row in found if row not in _schema()), None)
        what = f"the {odd[0]} {str(odd[1])[:60]!r}, which no ledger has" if odd else "not all tables of a ledger"
        raise CampaignError(
            f"{path} defines {what}, so nothing in it is read: another program has changed it, or it is damaged; begin "
            "the campaign anew in another file"
        )


# -------------------------------------------------------------------------------------------------------- what is in it
def digest(*parts: int | str | bytes) -> bytes:
    """SHA-256 over the parts, each with its length before it."""
    digest = hashlib.sha256()
    for part in parts:
        data = part if isinstance(part, bytes) else str(part).encode()
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.digest()


def head_in(connection: sqlite3.Connection, table: str) -> Head:
    """The head in one of the tables `HEADS`. Raises `CampaignError` if it is damaged.

    Args:
        connection: to a ledger.
        table: which of the two copies.
    """
    row = connection.execute(f"SELECT payload FROM {table}").fetchone()
    return chunk_format.unpack_head(b"" if row is None else row[0])


def whole_head(path: Path, connection: sqlite3.Connection) -> Head:
    """The head of a ledger. Raises `CampaignError` if neither of its two copies is whole.

    Args:
        path: the ledger, as messages call it.
        connection: to it.
    """
    for table in HEADS:
        with suppress(CampaignError, sqlite3.Error):
            return head_in(connection, table)
    raise CampaignError(f"{path}: both copies of its head are damaged; begin the campaign anew in another file")


def put_note(connection: sqlite3.Connection, key: str, value: Any) -> None:
    """Note a JSON value by name, in place of the last one.

    Args:
        connection: to a ledger.
        key: the name.
        value: anything that JSON has.
    """
    text = json.dumps(value, sort_keys=True)
    kept = "ON CONFLICT(key) DO UPDATE SET value = excluded.value, sha256 = excluded.sha256"
    connection.execute(f"INSERT INTO notes VALUES (?, ?, ?) {kept}", (key, text, digest(key, text)))


def notes_in(connection: sqlite3.Connection) -> dict[str, Any]:
    """All noted values by name; a damaged one is left out, as if it had not been noted."""
    rows = connection.execute("SELECT key, value, sha256 FROM notes").fetchall()
    return {key: json.loads(text) for key, text, kept in rows if kept == digest(key, text)}


# ------------------------------------------------------------------------------------------------------------- the lock
def lock_of(path: Path) -> Path:
    """The file whose lock is the right to write."""
    return path.with_name(path.name + ".lock")


def locked(path: Path) -> sqlite3.Connection:
    """The right to write, for as long as the connection is open and the process lives.

    Raises:
        CampaignError: another process has it.
    """
    lock = sqlite3.connect(lock_of(path), timeout=_GLANCE_S, isolation_level=None)
    try:
        lock.execute("PRAGMA journal_mode = MEMORY")  # no further file beside it
        lock.execute("BEGIN IMMEDIATE")
    except sqlite3.OperationalError as error:
        lock.close()
        if code_of(error) != sqlite3.SQLITE_BUSY:
            raise
        raise CampaignError(
            f"{_writer(path)} already writes to {path}: wait for it or stop it; how far it is says "
            f"`microrad campaign status {argument(path)}`"
        ) from None
    return lock


def this_process() -> dict[str, Any]:
    """This process, as a ledger notes who writes to it."""
    return {"pid": os.getpid(), "host": platform.node(), "since": datetime.now(UTC).isoformat(timespec="seconds")}


def _writer(path: Path) -> str:
    """Who writes to a ledger, as noted there."""
    with suppress(CampaignError, sqlite3.Error, KeyError), closing(connected(path, write=False)) as connection:
        who = notes_in(connection)["writer"]
        return f"process {who['pid']} on {who['host']}, since {who['since']},"
    return "another process"


def is_written(path: Path) -> bool:
    """Whether a living process writes to a ledger."""
    lock = lock_of(path)
    if not lock.exists():
        return False
    with closing(sqlite3.connect(f"{lock.absolute().as_uri()}?mode=rw", uri=True, timeout=0.0)) as glance:
        try:
            glance.execute("PRAGMA journal_mode = MEMORY")  # to look leaves no file
            glance.execute("BEGIN IMMEDIATE")
        except sqlite3.Error as error:  # a lock that cannot be written to is nobody's
            return code_of(error) == sqlite3.SQLITE_BUSY
    return False


# ------------------------------------------------------------------------------------------------------ errors in words
def code_of(error: BaseException | None) -> int:
    """SQLite's primary result code; 0 where the error is the module's own."""
    return int(getattr(error, "sqlite_errorcode", 0)) & 0xFF


@contextmanager
def errors_in_words(path: Path, what: str) -> Iterator[None]:
    """Turn the errors of SQLite and of the file system into words: what failed, what is in, what to do.

    Args:
        path: the ledger.
        what: what is being done, behind "could not".

    Raises:
        CampaignError: in place of an error of SQLite or of the file system.
    """
    try:
        yield
    except sqlite3.Error as error:
        raise CampaignError(f"{path}: microrad could not {what}: {_words(error, path)}") from error
    except UnicodeDecodeError as error:  # a text of the file, or an error of SQLite that quotes it
        raise CampaignError(f"{path}: microrad could not {what}: {_damaged('a text in it is none', path)}") from error
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
        sqlite3.SQLITE_BUSY: (f"another program held the file for longer than {PATIENCE_S:g} s", "Close that program"),
    }
    if code_of(error) == sqlite3.SQLITE_CORRUPT:
        return _damaged(str(error), path)
    what, remedy = by_code.get(code_of(error), (str(error), "See to that"))
    return f"{what}. {_safe(path)}{remedy}, then go on with `microrad campaign resume {argument(path)}`"


def _damaged(what: str, path: Path) -> str:
    return (
        f"the file is damaged ({what}). `microrad campaign resume {argument(path)}` goes on with what can be "
        "read of it; where nothing can, begin the campaign anew in another file"
    )


def _safe(path: Path) -> str:
    """How many chunks are in, if that can be told."""
    try:
        with closing(connected(path, write=False)) as connection:
            count = connection.execute("SELECT count(*) FROM chunks").fetchone()[0]
    except (CampaignError, sqlite3.Error):
        return ""
    return f"{count} chunks are in and stay; only what was being written is lost. "
