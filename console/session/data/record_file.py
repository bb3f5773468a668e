"""File of the run records: opened only where it is sound and of this schema; shared with other writers."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any, TypeVar

from console.session.errors import SessionError
from profiles.files import make_private_file, make_private_folder, printable
from profiles.problem import Problem

FILE_NAME = "records.sqlite3"
SCHEMA = 1

WAIT_S = 0.1
"""How long SQLite itself waits for another writer; in some states it does not, so calls are retried."""

PAUSE_S = 0.02

Result = TypeVar("Result")

_TABLES = (
    """CREATE TABLE runs (
    run_id TEXT PRIMARY KEY, started_utc TEXT NOT NULL, software TEXT NOT NULL,
    job TEXT NOT NULL, job_sha256 TEXT NOT NULL, machine TEXT NOT NULL, machine_sha256 TEXT NOT NULL,
    simulated INTEGER NOT NULL, strategy TEXT NOT NULL, program TEXT NOT NULL
) STRICT""",
    """CREATE TABLE events (
    run_id TEXT NOT NULL REFERENCES runs(run_id), number INTEGER NOT NULL, at_utc TEXT NOT NULL,
    kind TEXT NOT NULL, data TEXT NOT NULL, PRIMARY KEY (run_id, number)
) STRICT""",
    "CREATE TRIGGER runs_stay BEFORE UPDATE ON runs BEGIN SELECT RAISE(ABORT, 'append only'); END",
    "CREATE TRIGGER runs_are_kept BEFORE DELETE ON runs BEGIN SELECT RAISE(ABORT, 'append only'); END",
    "CREATE TRIGGER events_stay BEFORE UPDATE ON events BEGIN SELECT RAISE(ABORT, 'append only'); END",
    "CREATE TRIGGER events_are_kept BEFORE DELETE ON events BEGIN SELECT RAISE(ABORT, 'append only'); END",
    f"PRAGMA user_version = {SCHEMA}",
)

_BUSY = frozenset((sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED, sqlite3.SQLITE_PROTOCOL))


def opened(folder: Path, until_s: float) -> sqlite3.Connection:
    """Open the records in a folder for writing; create both where they are missing.

    Other writers are waited for until the deadline, in the time of `time.monotonic`.

    Raises:
        SessionError: `record.other_schema`, of a newer console, or not ours; `record.damaged`; nothing was
            written. `record.unwritable`.
    """
    path = folder / FILE_NAME
    try:
        make_private_folder(folder)
        make_private_file(path)  # SQLite gives the files beside it the same mode
        database = sqlite3.connect(path, timeout=WAIT_S, isolation_level=None)
    except (OSError, sqlite3.Error) as error:
        raise record_error("record.unwritable", path, error) from error
    try:
        retrying(lambda: _made_ready(database, path), until_s)
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


def rows(folder: Path, query: str, keys: tuple[object, ...], timeout_s: float) -> list[Any]:
    """Return the rows of a query, none without records; SessionError `record.other_schema`, sqlite3.Error."""
    path = folder / FILE_NAME
    if not path.is_file():
        return []
    read_only = f"{path.resolve().as_uri()}?mode=ro"
    with closing(sqlite3.connect(read_only, uri=True, timeout=timeout_s)) as database:
        _refuse_other_schema(database, path)
        return database.execute(query, keys).fetchall()


def retrying(work: Callable[[], Result], until_s: float) -> Result:
    """Run a database operation; wait for other writers until the deadline, also where SQLite would not."""
    while True:
        try:
            return work()
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF not in _BUSY or time.monotonic() > until_s:
                raise
            time.sleep(PAUSE_S)


def is_damage(error: sqlite3.Error) -> bool:
    """Whether an error means that the file is not as SQLite has written it."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


def record_error(code: str, path: Path, error: object) -> SessionError:
    """Return the refusal of a file of records."""
    return SessionError(Problem(code=code, where=printable(str(path)), value=printable(str(error))))


def _made_ready(database: sqlite3.Connection, path: Path) -> None:
    """Check an existing file, and create the tables in an empty one."""
    if not _refuse_other_schema(database, path):
        database.execute("BEGIN IMMEDIATE")
        try:
            if not _refuse_other_schema(database, path):  # another console may have created them meanwhile
                for line in _TABLES:
                    database.execute(line)
            database.execute("COMMIT")
        except BaseException:
            if database.in_transaction:
                database.execute("ROLLBACK")
            raise
    (found,) = database.execute("PRAGMA integrity_check(1)").fetchone()  # less than 0.1 s for some thousand runs
    if found != "ok":
        raise record_error("record.damaged", path, " ".join(str(found).split()))


def _refuse_other_schema(database: sqlite3.Connection, path: Path) -> bool:
    """Refuse a file of another schema, which is never downgraded; return whether there is one of this."""
    # In this order: another console may create the tables, with their version, between the two.
    (things,) = database.execute("SELECT count(*) FROM sqlite_schema").fetchone()
    (found,) = database.execute("PRAGMA user_version").fetchone()
    if found == SCHEMA or (found == 0 and things == 0):
        return bool(found == SCHEMA)
    where = printable(str(path))
    raise SessionError(Problem(code="record.other_schema", where=where, value=str(found), limit=str(SCHEMA)))
