"""Run record: one append-only SQLite file, safe against a kill at any instant."""

from __future__ import annotations

import json
import os
import sqlite3
import time
import uuid
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

from console.session.data.dates import utc_now
from console.session.data.record_file import FILE_NAME, opened, patiently, record_error
from console.session.data.running import RunMark
from drivers.cutting.plan import CutPlan
from profiles.store import LoadedMachine

OPEN_TIMEOUT_S = 30.0
"""How long to wait for other writers before anything has been started."""

DRIVES_ON_TIMEOUT_S = 5.0
"""The same where the drives may be enabled."""

GONE = "file gone"


def begin_record(
    folder: Path,
    job: str,
    job_sha256: str,
    machine: LoadedMachine,
    plan: CutPlan,
    *,
    simulated: bool,
    open_timeout_s: float = DRIVES_ON_TIMEOUT_S,
    patience_s: float = DRIVES_ON_TIMEOUT_S,
) -> RunRecord:
    """Begin the record of a run that cuts `plan`, with the name and the contents of its job.

    Raises:
        SessionError: as `RunRecord`.
    """
    described = {
        "software": f"trilobe {version('trilobe')}",
        "job": job,
        "job_sha256": job_sha256,
        "machine": machine.machine.name,
        "machine_sha256": machine.sha256,
        "simulated": int(simulated),
        "strategy": plan.strategy.value,
        "program": plan.text,
    }
    return RunRecord(folder, described, open_timeout_s=open_timeout_s, patience_s=patience_s)


class RunRecord:
    """The open record of one run."""

    def __init__(
        self,
        folder: Path,
        run: Mapping[str, object],
        *,
        open_timeout_s: float = DRIVES_ON_TIMEOUT_S,
        patience_s: float = DRIVES_ON_TIMEOUT_S,
    ) -> None:
        """Open the file in `folder`, which is created when missing, and begin a run.

        `run` gives software, job, job_sha256, machine, machine_sha256, simulated, strategy and program. Other
        writers are waited for up to `open_timeout_s` here, and up to `patience_s` at each event.

        Raises:
            SessionError: `record.unwritable`, `record.other_schema`, `record.damaged`; without a record no machine
                is started.
        """
        self._path = folder / FILE_NAME
        self.run_id = uuid.uuid4().hex
        self._count = 0
        self._patience_s = patience_s
        until_s = time.monotonic() + open_timeout_s
        self._database = opened(folder, until_s)
        try:
            self._mark = RunMark(folder, self.run_id)
        except OSError as error:
            self._database.close()
            raise record_error("record.unwritable", self._path, error) from error
        try:
            columns = ", ".join(("run_id", "started_utc", *run))
            marks = ", ".join("?" * (2 + len(run)))
            row = (self.run_id, utc_now(), *run.values())
            self._insert(f"INSERT INTO runs ({columns}) VALUES ({marks})", row, until_s)
            self._files = self._on_disk()
            if self._files[0] is None:
                raise OSError(GONE)
        except (OSError, sqlite3.Error) as error:
            self.close()
            raise record_error("record.unwritable", self._path, error) from error

    def add(self, kind: str, data: Mapping[str, object]) -> None:
        """Add an event; it is on disk when this returns.

        Raises:
            SessionError: `record.lost`; the run must not continue unrecorded.
        """
        self._count += 1
        row = (self.run_id, self._count, utc_now(), kind, _text(data))
        try:
            self._insert("INSERT INTO events VALUES (?, ?, ?, ?, ?)", row, time.monotonic() + self._patience_s)
        except sqlite3.Error as error:
            raise record_error("record.lost", self._path, error) from error
        self.refuse_lost()

    def refuse_lost(self) -> None:
        """Check that what was added is still where it can be found.

        Raises:
            SessionError: `record.lost`, the file or its folder was removed or replaced.
        """
        # SQLite keeps writing to a file that was unlinked.
        if self._on_disk() != self._files:
            raise record_error("record.lost", self._path, GONE)

    def close(self) -> None:
        """Close the file."""
        self._database.close()
        self._mark.close()

    def _insert(self, line: str, row: tuple[object, ...], until_s: float) -> None:
        patiently(lambda: self._database.execute(line, row), until_s)

    def _on_disk(self) -> tuple[tuple[int, int] | None, ...]:
        """Return device and inode of the database and of its journal, which holds the last lines."""
        return tuple(_identity(path) for path in (self._path, self._path.with_name(f"{FILE_NAME}-wal")))


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        status = os.stat(path)
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _text(data: Mapping[str, object]) -> str:
    shown = json.dumps(data, ensure_ascii=False)
    # A file name need not be valid text; escaped, it can be stored.
    return shown if shown.isprintable() else json.dumps(data)
