"""Run record: one append-only SQLite file, safe against a kill at any instant, and the marks of active runs.

The record of a killed run has no end; its console has left its mark, and the next start on its machine reports it,
once.
"""

from __future__ import annotations

import json
import os
import sqlite3
import time
import uuid
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from importlib.metadata import version
from pathlib import Path

from console.session.data.kept_files import utc_now
from console.session.data.record_file import FILE_NAME, is_damage, opened, record_error, retrying
from console.session.errors import SessionError
from drivers.cutting.plan import CutPlan
from profiles.files import made_locked, make_private_folder, printable, taken_if_left
from profiles.folder_rights import rights_in
from profiles.problem import Problem
from profiles.store import LoadedMachine

OPEN_TIMEOUT_S = 30.0  # how long to wait for other writers before anything has been started
DRIVES_ON_TIMEOUT_S = 5.0  # the same where the drives may be enabled
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
    timeout_s: float = DRIVES_ON_TIMEOUT_S,
) -> RunRecord:
    """Begin the record of a run that cuts `plan`, with the name and the contents of its job, as `RunRecord`."""
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
    return RunRecord(folder, described, open_timeout_s=open_timeout_s, timeout_s=timeout_s)


class RunRecord:
    """The open record of one run."""

    def __init__(
        self,
        folder: Path,
        run: Mapping[str, object],
        *,
        open_timeout_s: float = DRIVES_ON_TIMEOUT_S,
        timeout_s: float = DRIVES_ON_TIMEOUT_S,
    ) -> None:
        """Open the file in `folder`, which is created when missing, and begin a run.

        `run` gives software, job, job_sha256, machine, machine_sha256, simulated, strategy and program. Other
        writers are waited for up to `open_timeout_s` here, and up to `timeout_s` at each event.

        Raises:
            SessionError: `record.unwritable`, `record.other_schema`, `record.damaged`; without a record no machine
                is started.
        """
        self._path = folder / FILE_NAME
        self.run_id = uuid.uuid4().hex
        self._count = 0
        self._timeout_s = timeout_s
        until_s = time.monotonic() + open_timeout_s
        self._database = opened(folder, until_s)
        try:
            self._mark = RunMark(folder, self.run_id)
        except OSError as error:
            self._database.close()
            raise record_error("record.unwritable", self._path, error) from error
        try:
            row = {"run_id": self.run_id, "started_utc": utc_now(), **run}
            columns, marks = ", ".join(row), ", ".join("?" * len(row))
            self._insert(f"INSERT INTO runs ({columns}) VALUES ({marks})", tuple(row.values()), until_s)
            self._files = self._on_disk()
            if self._files[0] is None:
                raise OSError(GONE)
        except (OSError, sqlite3.Error) as error:
            self.close()
            raise record_error("record.unwritable", self._path, error) from error

    def add(self, kind: str, data: Mapping[str, object]) -> None:
        """Add an event; it is on disk when this returns. SessionError `record.lost`: the run must not continue."""
        self._count += 1
        shown = json.dumps(data, ensure_ascii=False)
        if not shown.isprintable():  # a file name need not be valid text; escaped, it can be stored
            shown = json.dumps(data)
        row = (self.run_id, self._count, utc_now(), kind, shown)
        try:
            self._insert("INSERT INTO events VALUES (?, ?, ?, ?, ?)", row, time.monotonic() + self._timeout_s)
        except sqlite3.Error as error:
            raise record_error("record.lost", self._path, error) from error
        self.refuse_lost()

    def refuse_lost(self) -> None:
        """Refuse (`record.lost`) where the file or its folder was removed or replaced since."""
        # SQLite keeps writing to a file that was unlinked.
        if self._on_disk() != self._files:
            raise record_error("record.lost", self._path, GONE)

    def close(self) -> None:
        """Close the file."""
        self._database.close()
        self._mark.close()

    def _insert(self, line: str, row: tuple[object, ...], until_s: float) -> None:
        retrying(lambda: self._database.execute(line, row), until_s)

    def _on_disk(self) -> tuple[tuple[int, int] | None, ...]:
        """Return device and inode of the database and of its journal, which holds the last lines."""
        found: list[tuple[int, int] | None] = []
        for path in (self._path, self._path.with_name(f"{FILE_NAME}-wal")):
            try:
                status = os.stat(path)
                found.append((status.st_dev, status.st_ino))
            except OSError:
                found.append(None)
        return tuple(found)


def add_to_run(folder: Path, run_id: str, kind: str, data: Mapping[str, object]) -> None:
    """Add an event to a run that has ended, such as a measurement of its part.

    Raises SessionError: `record.unwritable`, `record.other_schema`, `record.damaged`.
    """
    until_s = time.monotonic() + TIMEOUT_S
    with closing(opened(folder, until_s)) as database:
        row = (run_id, utc_now(), kind, json.dumps(data), run_id)
        try:
            retrying(lambda: database.execute(_LATER, row), until_s)
        except sqlite3.Error as error:
            raise record_error("record.unwritable", folder / FILE_NAME, error) from error


FOLDER = "running"
TIMEOUT_S = 5.0

_BEGUN, _ENDED = {"planned", "started"}, {"result", "cut", "held", "ended", "ended_early", "stopped"}

_RUN = "SELECT started_utc, job FROM runs WHERE run_id = ? AND machine = ? AND simulated = ?"
_ANY = "SELECT count(*) FROM runs WHERE run_id = ?"
_KINDS = "SELECT kind FROM events WHERE run_id = ?"
_LATER = "INSERT INTO events SELECT ?, 1 + coalesce(max(number), 0), ?, ?, ? FROM events WHERE run_id = ?"
_END = "INSERT INTO events SELECT ?, 1 + coalesce(max(number), 0), ?, 'ended', ? FROM events WHERE run_id = ?"


class RunMark:
    """Mark of an active run, removed at its end."""

    def __init__(self, data: Path, run_id: str) -> None:
        """Create the mark in the data folder; OSError where it cannot be made."""
        self._path = data / FOLDER / run_id
        make_private_folder(self._path.parent)
        mode = rights_in(self._path.parent).file
        self._descriptor: int | None = made_locked(self._path, mode)
        with suppress(OSError):  # whatever the umask
            os.fchmod(self._descriptor, mode)

    def close(self) -> None:
        """Remove the mark."""
        if self._descriptor is not None:
            with suppress(OSError):
                self._path.unlink()
            os.close(self._descriptor)
            self._descriptor = None


def killed_runs(data: Path, machine: str, *, simulated: bool) -> tuple[Problem, ...]:
    """Return `record.killed` for each run on this machine whose console is gone, and record its end.

    Those on another machine wait for a start on that one. Where there is no record, none is made.

    Raises:
        SessionError: `record.other_schema`, `record.damaged`, `record.unwritable`, of a record that is there.
    """
    if not (data / FILE_NAME).exists():
        return ()
    with closing(opened(data, time.monotonic() + TIMEOUT_S)) as database:
        try:
            with _left_marks(data) as marks:
                ended = [each for mark in marks for each in _ended(database, mark, machine, simulated=simulated)]
        except sqlite3.Error as error:
            code = "record.damaged" if is_damage(error) else "record.unwritable"
            raise record_error(code, data / FILE_NAME, error) from error
    return tuple(ended)


def killed_or_refused(data: Path, machine: str, *, simulated: bool) -> tuple[Problem, ...]:
    """Return the same for a screen, which must open: instead of raising, return why no cut can be recorded."""
    try:
        return killed_runs(data, machine, simulated=simulated)
    except SessionError as refused:
        return tuple(refused.problems)


@contextmanager
def _left_marks(data: Path) -> Iterator[list[Path]]:
    """Yield the marks that killed runs have left, locked against other consoles."""
    try:
        found = sorted((data / FOLDER).iterdir())
    except OSError:  # it is made with the first run
        found = []
    left = []
    with ExitStack() as locks:
        for path in found:
            descriptor = taken_if_left(path)
            if descriptor is not None:
                locks.callback(os.close, descriptor)
                left.append(path)
        yield left


def _ended(database: sqlite3.Connection, mark: Path, machine: str, *, simulated: bool) -> list[Problem]:
    """End the run of a mark and remove the mark; return the problem to report."""
    run_id = mark.name
    run = database.execute(_RUN, (run_id, machine, int(simulated))).fetchone()
    if run is None:
        if not database.execute(_ANY, (run_id,)).fetchone()[0]:
            mark.unlink(missing_ok=True)
        return []
    kinds = {kind for (kind,) in database.execute(_KINDS, (run_id,))}
    if not kinds & _ENDED:
        end = (run_id, utc_now(), json.dumps({"reason": "killed"}), run_id)
        retrying(lambda: database.execute(_END, end), time.monotonic() + TIMEOUT_S)
    mark.unlink(missing_ok=True)
    if kinds & _ENDED or not kinds & _BEGUN:
        return []
    began, job = (printable(each, 60) for each in run)
    return [Problem(code="record.killed", key=job, value=f"{began[:16].replace('T', ' ')} UTC")]
