"""The outbox of a lathe: its run records, read in the order in which they were written.

The records are append-only, and SQLite has one writer at a time: rows have numbers without gaps, and what has
a lower number was there before. So how far they were sent is one number for each table, and nothing needs to
be kept at the lathe. A row is sent only when it is on the disk: a power cut cannot take away what the shop
already has.
"""

from __future__ import annotations

import hashlib
import os
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from console.session.data.record_file import (
    FILE_NAME,
    is_damage,
    opened_to_read,
    record_error,
    refuse_other_schema,
)
from profiles.files import open_regular


@dataclass(frozen=True, slots=True)
class SentTable:
    """A table: `columns` are the same at the lathe and in the shop. A `shared` one is not of one lathe alone."""

    name: str
    columns: tuple[str, ...]
    shared: bool = False


TEXTS = SentTable("texts", ("sha256", "content"), shared=True)
RUNS = SentTable(
    "runs",
    (
        *("run_id", "started_utc", "software", "job", "job_sha256", "machine", "machine_sha256", "simulated"),
        *("strategy", "program", "job_text_sha256", "machine_text_sha256", "python", "controller", "family"),
        *("stage", "compensation", "operator", "tolerance_um", "setup"),
    ),
)
EVENTS = SentTable("events", ("run_id", "number", "at_utc", "kind", "data"))
MEASUREMENTS = SentTable(
    "measurements",
    (
        *("run_id", "number", "at_utc", "part", "product", "ront_um", "tolerance_um", "passed", "diameter_mm"),
        *("nominal_diameter_mm", "diameter_tolerance_um", "lobe_um_pp", "trace_sha256", "trace_name", "data"),
    ),
)
TRACES = SentTable("traces", ("run_id", "number", "content"))
TELEMETRY = SentTable("telemetry", ("run_id", "number", "part", "kind", "begun_utc", "data"))

SENT = (TEXTS, RUNS, EVENTS, MEASUREMENTS, TRACES, TELEMETRY)


def mark_of(values: Sequence[Any]) -> str:
    """Return what tells a row from any other that could stand in its place: a hash of its values."""
    return hashlib.sha256(repr(tuple(values)).encode("utf-8", "backslashreplace")).hexdigest()[:16]


READ_TIMEOUT_S = 5.0

Row = tuple[Any, ...]
"""Number of the row, then its values."""


@dataclass(frozen=True, slots=True)
class Outbox:
    """The records of a folder as they are on the disk now.

    `file_id` is the id of the first run: a new file has another.
    """

    database: sqlite3.Connection
    file_id: str
    heads: Mapping[str, int]

    def rows(self, table: SentTable, after: int, limit: int) -> Iterator[Row]:
        """Yield rows behind a number, oldest first. sqlite3.Error."""
        query = (
            f"SELECT rowid, {', '.join(table.columns)} FROM {table.name}"
            " WHERE rowid > ? AND rowid <= ? ORDER BY rowid LIMIT ?"
        )
        yield from self.database.execute(query, (after, self.heads[table.name], limit))

    def mark(self, table: SentTable, number: int) -> str:
        """Return the mark of the row with a number, "" where there is none."""
        query = f"SELECT {', '.join(table.columns)} FROM {table.name} WHERE rowid = ?"
        found = self.database.execute(query, (number,)).fetchone()
        return "" if found is None else mark_of(found)


@contextmanager
def outbox(data: Path) -> Iterator[Outbox | None]:
    """Yield the outbox of a data folder, None while nothing is recorded.

    Raises SessionError: `record.other_schema`,
    `record.damaged`, `record.not_readable`.
    """
    path = data / FILE_NAME
    try:
        if not path.exists():
            yield None
            return
        with closing(opened_to_read(path, READ_TIMEOUT_S)) as database:
            yield _as_now(database, path)
    except (OSError, sqlite3.Error) as error:
        damaged = isinstance(error, sqlite3.Error) and is_damage(error)
        raise record_error("record.damaged" if damaged else "record.not_readable", path, error) from error


def _as_now(database: sqlite3.Connection, path: Path) -> Outbox | None:
    refuse_other_schema(database, path)
    database.execute("BEGIN")  # the heads are of one moment: no event without its run
    try:
        heads = {table.name: _head(database, table) for table in SENT}
        first = database.execute("SELECT run_id FROM runs ORDER BY rowid LIMIT 1").fetchone()
    finally:
        database.execute("COMMIT")
    if first is None:
        return None
    _on_disk(path.with_name(f"{FILE_NAME}-wal"))
    return Outbox(database, str(first[0]), heads)


def _head(database: sqlite3.Connection, table: SentTable) -> int:
    (found,) = database.execute(f"SELECT coalesce(max(rowid), 0) FROM {table.name}").fetchone()
    return int(found)


def _on_disk(journal: Path) -> None:
    """Wait until the journal is on the disk: its writers do not, and a power cut may take its last rows."""
    try:
        descriptor = open_regular(journal)
    except FileNotFoundError:
        return
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
