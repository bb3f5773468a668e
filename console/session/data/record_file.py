"""File of the run records: opened only where it is sound and of this schema; shared with other writers."""

from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, TypeVar

from console.session.data.kept_files import path_exists
from console.session.data.record_schema import OWN_TRIGGERS, SCHEMA, create
from console.session.errors import SessionError
from profiles.files import make_private_folder, printable, require_regular, write_atomically
from profiles.problem import Problem, ProfileError

FILE_NAME = "records.sqlite3"
BESIDE_RECORDS = tuple(f"{FILE_NAME}-{each}" for each in ("wal", "shm", "journal"))
MOST_VALUE_BYTES = 100_000_000  # above any value that is recorded; one that SQLite makes up itself ends here
CHECKED_TABLES = ("runs", "events", "measurements")
"""Tables whose integrity is checked when the file is opened; telemetry and traces are where it would take long."""

WAIT_S = 0.1
"""How long SQLite itself waits for another writer; in some states it does not, so calls are retried."""

PAUSE_S = 0.02

Result = TypeVar("Result")

_BUSY = frozenset((sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED, sqlite3.SQLITE_PROTOCOL))
_FULL = frozenset((sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR))


def is_busy(error: sqlite3.Error) -> bool:
    """Whether other writers have kept the file for as long as was waited for them."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in _BUSY


def is_full(error: sqlite3.Error) -> bool:
    """Whether the disk may be full."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in _FULL


def open_records(folder: Path, until_s: float, *, checked: bool = True) -> sqlite3.Connection:
    """Open the records in a folder for writing; create both where they are missing.

    Other writers are waited for until the deadline, in the time of `time.monotonic`. To have the tables `checked`
    takes longer the more runs there are; without it, damage is found where it is touched.

    Raises:
        SessionError: `record.other_schema`, of a newer console, or not ours; `record.damaged`; `record.empty`;
            nothing was written. `record.unwritable`.
    """
    path = folder / FILE_NAME
    try:
        make_private_folder(folder)
        _make_file(path)
        database = connect_records(path, "rw", WAIT_S)
    except (OSError, sqlite3.Error) as error:
        raise record_error("record.unwritable", path, error) from error
    try:
        with damage_as_error():
            retrying(lambda: _check(database, path, checked=checked), until_s)
            # Records need the journal: a kill at any instant leaves them whole.
            retrying(lambda: database.execute("PRAGMA journal_mode=WAL"), until_s)
    except sqlite3.Error as error:
        database.close()
        code = "record.damaged" if is_damage(error) else "record.unwritable"
        raise record_error(code, path, error) from error
    except BaseException:
        database.close()
        raise
    return database


def connect_records(path: Path, mode: str, timeout_s: float) -> sqlite3.Connection:
    """Connect to an existing file of records, which may be somebody else's, for reading (`ro`) or writing (`rw`).

    Raises sqlite3.Error; SessionError `record.empty`: opened, it would count as new, and its journal be removed.
    """
    try:
        for each in (path, *map(path.with_name, BESIDE_RECORDS)):
            require_regular(each)
        is_empty = path.exists() and not path.stat().st_size
    except OSError as error:
        unusable = sqlite3.OperationalError(error.strerror or str(error))
        unusable.sqlite_errorcode = sqlite3.SQLITE_CANTOPEN
        raise unusable from error
    if is_empty:
        raise SessionError(Problem(code="record.empty", where=printable(str(path))))
    uri = f"{path.resolve().as_uri()}?mode={mode}"
    database = sqlite3.connect(uri, uri=True, timeout=timeout_s, isolation_level=None)
    database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_VALUE_BYTES)
    database.execute("PRAGMA trusted_schema=OFF")
    return database


def _make_file(path: Path) -> None:
    """Put a file with its tables in place, in one step: so one of 0 bytes is not new, it has lost what it had."""
    if path.exists():
        return
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as new:
        create(new)
        content = new.serialize()
    try:
        write_atomically(path, content, overwrite=False, private=True)  # files beside it get the same mode
    except ProfileError as error:
        (problem,) = error.problems
        if problem.code != "file.exists":  # otherwise another console was quicker
            raise record_error("record.unwritable", path, problem.value) from error


def rows(folder: Path, query: str, keys: tuple[object, ...], timeout_s: float) -> list[Any]:
    """Return the rows of a query, none without records; SessionError `record.other_schema`, sqlite3.Error."""
    path = folder / FILE_NAME
    if not path_exists(path):
        return []
    with closing(opened_to_read(path, timeout_s)) as database:
        refuse_other_schema(database, path)
        return database.execute(query, keys).fetchall()


_NO_COORDINATION = (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY)
"""How SQLite says that it cannot put the file by which it coordinates with writers beside the records."""


def opened_to_read(path: Path, timeout_s: float) -> sqlite3.Connection:
    """Open an existing file for reading alone; other writers are not locked out. sqlite3.Error.

    In a folder that cannot be written, SQLite cannot coordinate with writers; without a journal there are none.
    """
    database = connect_records(path, "ro", timeout_s)
    try:
        with damage_as_error():
            database.execute("SELECT count(*) FROM sqlite_schema").fetchone()
    except sqlite3.OperationalError as error:
        database.close()
        journal = path.with_name(f"{FILE_NAME}-wal")
        if (
            error.sqlite_errorcode & 0xFF not in _NO_COORDINATION
            or journal.exists()
            or not os.access(path, os.R_OK)
        ):
            raise
        return connect_records(path, "ro&immutable=1", timeout_s)
    except BaseException:
        database.close()
        raise
    return database


def retrying(work: Callable[[], Result], until_s: float) -> Result:
    """Run a database operation; wait for other writers until the deadline, also where SQLite would not."""
    while True:
        try:
            return work()
        except sqlite3.OperationalError as error:
            if not is_busy(error) or time.monotonic() > until_s:
                raise
            time.sleep(PAUSE_S)


def transaction(database: sqlite3.Connection, statements: Sequence[tuple[str, tuple[object, ...]]]) -> None:
    """Carry out statements, all or none of them. sqlite3.Error."""
    database.execute("BEGIN IMMEDIATE")
    try:
        for line, keys in statements:
            database.execute(line, keys)
        database.execute("COMMIT")
    except BaseException:
        if database.in_transaction:
            database.execute("ROLLBACK")
        raise


@contextmanager
def damage_as_error() -> Iterator[None]:
    """Raise damage as sqlite3.Error: where SQLite names a spoilt part of the schema, that may be no text."""
    try:
        yield
    except UnicodeDecodeError as unreadable:
        error = sqlite3.DatabaseError("malformed database schema")
        error.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
        raise error from unreadable


def is_damage(error: sqlite3.Error) -> bool:
    """Whether an error means that the file is not as SQLite has written it."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


def record_error(code: str, path: Path, error: object) -> SessionError:
    """Return the refusal of a file of records."""
    return SessionError(Problem(code=code, where=printable(str(path)), value=printable(str(error))))


def _check(database: sqlite3.Connection, path: Path, *, checked: bool) -> None:
    refuse_other_schema(database, path)
    for table in CHECKED_TABLES if checked else ():
        (found,) = database.execute(f"PRAGMA quick_check({table})").fetchone()
        if found != "ok":
            raise record_error("record.damaged", path, " ".join(str(found).split()))


def refuse_other_schema(database: sqlite3.Connection, path: Path) -> None:
    """Raise SessionError `record.other_schema`; `record.damaged`, there is something in it that is not ours."""
    (found,) = database.execute("PRAGMA user_version").fetchone()
    if found != SCHEMA:
        where = printable(str(path))
        raise SessionError(Problem(code="record.other_schema", where=where, value=str(found), limit=str(SCHEMA)))
    for name, made in database.execute("SELECT type || ' ' || name, sql FROM sqlite_schema"):
        # A view or a trigger of others could do anything when a table is touched.
        if made not in OWN_TRIGGERS and not made.startswith(("CREATE TABLE ", "CREATE INDEX ")):
            raise record_error("record.damaged", path, name)
