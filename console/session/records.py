"""The run record: one SQLite file to which lines are only ever added, safe against a kill at any instant."""

from __future__ import annotations

import json
import sqlite3
import uuid
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

from console.session.errors import SessionError
from profiles.files import make_private_file, make_private_folder
from profiles.problem import Problem

FILE_NAME = "records.sqlite3"
LOCK_TIMEOUT_S = 1.0
"""How long another writer is waited for: the drives may be on meanwhile."""

_SCHEMA = """
PRAGMA user_version = 1;
CREATE TABLE IF NOT EXISTS runs (
    run_id TEXT PRIMARY KEY, started_utc TEXT NOT NULL, software TEXT NOT NULL,
    job TEXT NOT NULL, job_sha256 TEXT NOT NULL, machine TEXT NOT NULL, machine_sha256 TEXT NOT NULL,
    simulated INTEGER NOT NULL, strategy TEXT NOT NULL, program TEXT NOT NULL
) STRICT;
CREATE TABLE IF NOT EXISTS events (
    run_id TEXT NOT NULL REFERENCES runs(run_id), number INTEGER NOT NULL, at_utc TEXT NOT NULL,
    kind TEXT NOT NULL, data TEXT NOT NULL, PRIMARY KEY (run_id, number)
) STRICT;
CREATE TRIGGER IF NOT EXISTS runs_stay BEFORE UPDATE ON runs BEGIN SELECT RAISE(ABORT, 'append only'); END;
CREATE TRIGGER IF NOT EXISTS runs_are_kept BEFORE DELETE ON runs BEGIN SELECT RAISE(ABORT, 'append only'); END;
CREATE TRIGGER IF NOT EXISTS events_stay BEFORE UPDATE ON events BEGIN SELECT RAISE(ABORT, 'append only'); END;
CREATE TRIGGER IF NOT EXISTS events_are_kept BEFORE DELETE ON events BEGIN SELECT RAISE(ABORT, 'append only'); END;
"""


class RunRecord:
    """The open record of one run."""

    def __init__(self, folder: Path, run: Mapping[str, object]) -> None:
        """Open the file in `folder`, which is made when it is missing, and begin a run.

        `run` gives software, job, job_sha256, machine, machine_sha256, simulated, strategy and program.

        Raises:
            SessionError: `record.unwritable`; without a record no machine is started.
        """
        self._path = folder / FILE_NAME
        self.run_id = uuid.uuid4().hex
        self._count = 0
        try:
            make_private_folder(folder)
            make_private_file(self._path)  # the files beside it become like it
            self._database = sqlite3.connect(self._path, timeout=LOCK_TIMEOUT_S)
            self._database.execute("PRAGMA journal_mode=WAL")
            self._database.executescript(_SCHEMA)
            columns = ", ".join(("run_id", "started_utc", *run))
            marks = ", ".join("?" * (2 + len(run)))
            with self._database:
                self._database.execute(
                    f"INSERT INTO runs ({columns}) VALUES ({marks})", (self.run_id, _now(), *run.values())
                )
        except (OSError, sqlite3.Error) as error:
            raise self._error("record.unwritable", error) from error

    def add(self, kind: str, data: Mapping[str, object]) -> None:
        """Add an event; it is on the disk when this returns.

        Raises:
            SessionError: `record.lost`; the run is not to go on unrecorded.
        """
        self._count += 1
        row = (self.run_id, self._count, _now(), kind, json.dumps(data, ensure_ascii=False))
        try:
            with self._database:
                self._database.execute("INSERT INTO events VALUES (?, ?, ?, ?, ?)", row)
        except sqlite3.Error as error:
            raise self._error("record.lost", error) from error

    def close(self) -> None:
        """Let go of the file."""
        self._database.close()

    def _error(self, code: str, error: Exception) -> SessionError:
        return SessionError(Problem(code=code, where=str(self._path), value=str(error)))


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
