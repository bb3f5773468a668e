"""Run record: one append-only SQLite file, safe against a kill at any instant, and the marks of active runs.

The record of a killed run has no end; its console has left its mark, and the next start on its machine reports it,
once.
"""

from __future__ import annotations

import errno
import hashlib
import os
import platform
import sqlite3
import tempfile
import time
import uuid
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from console.session.data.kept_files import utc_now
from console.session.data.measured_part import AIR, PART_COLUMNS, RecordedPart
from console.session.data.record_file import (
    FILE_NAME,
    is_damage,
    is_full,
    open_records,
    record_error,
    retrying,
    transaction,
)
from console.session.data.record_schema import MAY_LACK_ROUNDNESS
from console.session.data.run_log import CLOSE_TIMEOUT_S, RunLog, event_json, event_statement
from console.session.data.run_story import MACHINE_S, RunStory
from console.session.data.version_control import VERSIONED, cut_from, is_clone
from console.session.errors import SessionError
from console.session.operator import operator_name
from console.session.part_identity import IDENTIFIED, PartIdentity, identity_of, next_identity, products_of
from drivers.clock import boot_s
from drivers.cutting.planning import CutPlan
from profiles.files import made_locked, make_private_folder, printable, rights_in, taken_if_left
from profiles.job import Job
from profiles.problem import Problem
from profiles.store import LoadedMachine

OPEN_TIMEOUT_S = 30.0  # how long to wait for other writers before anything has been started
DRIVES_ON_TIMEOUT_S = 5.0  # the same where the drives may be enabled
GONE = "file gone"


PATIENCE_S = 60.0  # at the end of a simulated run: nothing that moves waits for it
RESERVE_BYTES = 262_144  # of a run: for how it ends, where the disk becomes full in it
LEAST_FREE_BYTES = 50_000_000
"""Free space without which no run begins: some hundred times what a long cut needs, as others write, too."""


Statement = tuple[str, tuple[object, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFacts:
    """What a run rests on. `job_text` is the TOML of the job as cut, `job_sha256` that of the file it is from.

    `job_path` is that file, None for a job that was edited and not saved. `compensation` is the learned version,
    None the model's. `controller` is kind and version as the controller
    reports them, None before it was asked. `setup` has the forces and the alignment. `identity` are the fields of
    `PartIdentity` that were stated for this run; the others are those of the part before.
    """

    job: Job
    job_sha256: str
    job_text: str
    stage: str
    compensation: int | None
    controller: str | None = None
    job_path: Path | None = None
    setup: Mapping[str, object] = field(default_factory=dict)
    identity: Mapping[str, Any] = field(default_factory=dict)


def begin_record(
    folder: Path,
    facts: RunFacts,
    machine: LoadedMachine,
    plan: CutPlan,
    *,
    simulated: bool,
    open_timeout_s: float = DRIVES_ON_TIMEOUT_S,
    timeout_s: float = DRIVES_ON_TIMEOUT_S,
    now_s: Callable[[], float] = boot_s,
) -> RunRecord:
    """Begin the record of a run that cuts `plan`; `now_s` is machine time.

    Raises SessionError: `record.no_space`; as `RunRecord`.
    """
    refuse_full(folder)
    identity = _identity_of(folder, facts, simulated=simulated)
    described = {
        "software": f"trilobe {version('trilobe')}",
        "job": facts.job.name,
        "job_sha256": facts.job_sha256,
        "machine": machine.machine.name,
        "machine_sha256": machine.sha256,
        "simulated": int(simulated),
        "strategy": plan.strategy.value,
        "program": plan.text,
        "job_text_sha256": facts.job_text,
        "machine_text_sha256": machine.text,
        "python": platform.python_version(),
        "controller": facts.controller,
        "family": machine.machine.controller.family,
        "stage": facts.stage,
        "compensation": facts.compensation,
        "operator": operator_name(),
        "tolerance_um": facts.job.roundness_tolerance_um,
        "setup": event_json(facts.setup),
    }
    # The file was checked when the console started; that takes too long where polls must not wait.
    record = RunRecord(
        folder, described, open_timeout_s=open_timeout_s, timeout_s=timeout_s, checked=False, now_s=now_s
    )
    if is_clone(folder):
        texts = {"job": (facts.job_path, facts.job_text), "machine": (machine.path, machine.text)}
        record.log.event_of(VERSIONED, lambda: cut_from(folder, texts))
    if identity is not None:
        record.identity = identity
        record.log.event(IDENTIFIED, identity.event())
    return record


def _identity_of(folder: Path, facts: RunFacts, *, simulated: bool) -> PartIdentity | None:
    """Return the identity of the part that a run cuts; None if none is stated. An air cut is of no next part."""
    if facts.stage == AIR and not facts.identity:
        return None
    try:
        clamped_at = facts.setup.get("clamped_at")
        found = next_identity(folder, facts.job.name, simulated=simulated, clamped_at=clamped_at)
    except sqlite3.Error as error:
        code = "record.damaged" if is_damage(error) else "record.unreadable"
        raise record_error(code, folder / FILE_NAME, error) from error
    return replace(found or PartIdentity(), **facts.identity) if facts.identity else found


def refuse_full(folder: Path) -> None:
    """Refuse to begin a run where the disk is nearly full; SessionError `record.no_space`."""
    there = next((each for each in (folder, *folder.parents) if each.exists()), None)
    if there is None:
        return  # found out when the folder is made
    try:
        found = os.statvfs(there)
    except OSError as error:
        raise record_error("record.unwritable", folder / FILE_NAME, error) from error
    free = found.f_bavail * found.f_frsize
    if free < LEAST_FREE_BYTES:
        value, limit = f"{free / 1e6:.1f} MB", f"{LEAST_FREE_BYTES / 1e6:g} MB"
        raise SessionError(Problem(code="record.no_space", where=printable(str(folder)), value=value, limit=limit))


class RunRecord:
    """The open record of one run."""

    def __init__(
        self,
        folder: Path,
        run: Mapping[str, object],
        *,
        open_timeout_s: float = DRIVES_ON_TIMEOUT_S,
        timeout_s: float = DRIVES_ON_TIMEOUT_S,
        checked: bool = True,
        now_s: Callable[[], float] = boot_s,
    ) -> None:
        """Open the file in `folder`, which is created when missing, and begin a run.

        `run` gives the columns of a run; those of `TEXTS` are given as the texts themselves. Other writers are
        waited for up to `open_timeout_s` here, and up to `timeout_s` at each event. `now_s` is machine time.

        Raises:
            SessionError: `record.unwritable`, `record.other_schema`, `record.damaged`; without a record no machine
                is started.
        """
        self._path = folder / FILE_NAME
        self.run_id = uuid.uuid4().hex
        self.identity: PartIdentity | None = None
        self._timeout_s = timeout_s
        waits_s = PATIENCE_S if run.get("simulated") else CLOSE_TIMEOUT_S
        self.log = RunLog(folder, self.run_id, waits_s=waits_s, now_s=now_s)
        until_s = time.monotonic() + open_timeout_s
        self._database = open_records(folder, until_s, checked=checked)
        try:
            self._mark = RunMark(folder, self.run_id)
            self._reserve: int | None = _reserve_room(folder)
        except OSError as error:
            self._database.close()
            raise record_error("record.unwritable", self._path, error) from error
        try:
            # The log's thread tidies up the journal; who cuts never waits for that.
            self._database.execute("PRAGMA wal_autocheckpoint=0")
            self._write(_run({"run_id": self.run_id, "started_utc": self.log.dates.now(), **run}), until_s)
            self._files = self._on_disk()
            if self._files[0] is None:
                raise OSError(GONE)
        except (OSError, sqlite3.Error) as error:
            self.close()
            damaged = isinstance(error, sqlite3.Error) and is_damage(error)
            raise record_error("record.damaged" if damaged else "record.unwritable", self._path, error) from error

    def add(self, kind: str, data: Mapping[str, object], part: RecordedPart | None = None) -> None:
        """Add an event, and the measurement that it is of; they are on disk when this returns.

        Raises SessionError: `record.lost`, the run must not continue.
        """
        try:
            at_utc = self.log.dates.now()
            event = event_statement(self.run_id, at_utc, kind, {MACHINE_S: self.log.dates.machine_s(), **data})
            statements = [event, *_measurement(self.run_id, at_utc, part)]
            self._write(statements, time.monotonic() + self._timeout_s)
        except sqlite3.Error as error:
            raise record_error("record.lost", self._path, error) from error
        self.refuse_lost()

    def refuse_lost(self) -> None:
        """Refuse (`record.lost`) where the file or its folder was removed or replaced since."""
        if self._reserve is None:
            raise record_error("record.lost", self._path, os.strerror(errno.ENOSPC))
        # SQLite keeps writing to a file that was unlinked.
        if self._on_disk() != self._files:
            raise record_error("record.lost", self._path, GONE)

    def close(self, *, marked: bool = False) -> None:
        """Write what the log still has, and close the file. `marked`: the next start tells of this run."""
        self.log.close()
        self._database.close()
        self._mark.close(stays=marked)
        self._free_reserve()

    def _free_reserve(self) -> None:
        if self._reserve is not None:
            os.close(self._reserve)
        self._reserve = None

    def _write(self, statements: Sequence[Statement], until_s: float) -> None:
        try:
            retrying(lambda: transaction(self._database, statements), until_s)
        except sqlite3.Error as error:
            if not is_full(error) or self._reserve is None:
                raise
            # What ends the run, now that it has to, needs less than this.
            self._free_reserve()
            retrying(lambda: transaction(self._database, statements), until_s)

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


def add_to_run(
    folder: Path,
    run_id: str,
    kind: str,
    data: Mapping[str, object],
    part: RecordedPart | None = None,
    *,
    timeout_s: float = DRIVES_ON_TIMEOUT_S,
) -> None:
    """Add an event to a run that has ended, such as a measurement of its part.

    Raises SessionError: `record.unwritable`, `record.other_schema`, `record.damaged`.
    """
    until_s = time.monotonic() + timeout_s
    with closing(open_records(folder, until_s, checked=False)) as database:
        at_utc = utc_now()
        statements = [event_statement(run_id, at_utc, kind, data), *_measurement(run_id, at_utc, part)]
        try:
            retrying(lambda: transaction(database, statements), until_s)
        except sqlite3.Error as error:
            raise record_error("record.unwritable", folder / FILE_NAME, error) from error


def identify_part(folder: Path, story: RunStory, values: Mapping[str, Any]) -> None:
    """Keep what is stated of the last product of a run that has ended; the other fields stay. As `add_to_run`."""
    identity = identity_of(story, values)
    assert identity is not None
    event = {**identity.event(products_of(story)), "by": operator_name()}
    add_to_run(folder, story.row.run_id, IDENTIFIED, event)


def _reserve_room(folder: Path) -> int:
    """Return a file without a name, so that a kill leaves nothing, whose room is free once it is closed."""
    with tempfile.TemporaryFile(dir=folder) as file:
        with suppress(OSError):  # nearly full already, or a file system that cannot: then there is none
            os.posix_fallocate(file.fileno(), 0, RESERVE_BYTES)
        return os.dup(file.fileno())


TEXTS = ("job_text_sha256", "machine_text_sha256")
"""Columns of a run that refer to a text, which is kept once for all runs."""


def _run(row: Mapping[str, object]) -> list[Statement]:
    """Return the statements that keep a run and its texts."""
    texts = {column: str(row[column]) for column in TEXTS if row.get(column)}
    sums = {column: hashlib.sha256(content.encode()).hexdigest() for column, content in texts.items()}
    values = {**row, **{column: sums.get(column) for column in TEXTS if column in row}}
    columns, marks = ", ".join(values), ", ".join("?" * len(values))
    return [
        *(("INSERT OR IGNORE INTO texts VALUES (?, ?)", (sums[each], texts[each])) for each in texts),
        (f"INSERT INTO runs ({columns}) VALUES ({marks})", tuple(values.values())),
    ]


_NEXT = "SELECT coalesce(max(number), 0) FROM measurements WHERE run_id = ?"
_INSERT = (
    f"INSERT INTO measurements (run_id, number, at_utc, trace_sha256, data, {', '.join(PART_COLUMNS)})"
    f" SELECT ?, 1 + ({_NEXT}), ?, ?, ?, {', '.join('?' * len(PART_COLUMNS))}"
)


def _measurement(run_id: str, at_utc: str, part: RecordedPart | None) -> list[Statement]:
    """Return the statements that keep a part; none without one."""
    if part is None:
        return []
    trace, values = part.trace or b"", (getattr(part, name) for name in PART_COLUMNS)
    plain = tuple(int(value) if isinstance(value, bool) else value for value in values)
    sha256 = hashlib.sha256(trace).hexdigest()
    lifted = MAY_LACK_ROUNDNESS if part.ront_um is None else ()
    return [
        *((line, ()) for line in lifted),
        (_INSERT, (run_id, run_id, at_utc, sha256, event_json(part.data), *plain)),
        (f"INSERT INTO traces SELECT ?, ({_NEXT}), ?", (run_id, run_id, zlib.compress(trace, 6))),
    ]


FOLDER = "running"
TIMEOUT_S = 5.0

LEFT_IN_PART = "left_in_part"  # the console was left with the tool in the part, or where nobody knew
_BEGUN, _ENDED = {"planned", "started"}, {"result", "cut", "held", "ended", "ended_early", "stopped"}

_RUN = "SELECT started_utc, job FROM runs WHERE run_id = ? AND machine = ? AND simulated = ?"
_ANY = "SELECT count(*) FROM runs WHERE run_id = ?"
_KINDS = "SELECT kind FROM events WHERE run_id = ?"


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

    def close(self, *, stays: bool = False) -> None:
        """Give the mark up, and remove it unless it stays."""
        if self._descriptor is not None:
            if not stays:
                with suppress(OSError):
                    self._path.unlink()
            os.close(self._descriptor)
            self._descriptor = None


def killed_runs(data: Path, machine: str, *, simulated: bool, checked: bool = True) -> tuple[Problem, ...]:
    """Return `record.killed` for each run on this machine whose console is gone, and record its end.

    `record.left_in_part` is of one whose console was left while the tool was in the part, as far as it knew.
    Those on another machine wait for a start on that one. Where there is no record, none is made. Its file is
    `checked` as a whole, except where polls must not wait.

    Raises:
        SessionError: `record.other_schema`, `record.damaged`, `record.unwritable`, of a record that is there.
    """
    if not (data / FILE_NAME).exists():
        return ()
    with closing(open_records(data, time.monotonic() + TIMEOUT_S, checked=checked)) as database:
        try:
            with _left_marks(data) as marks:
                ended = [
                    each
                    for mark in marks
                    for each in _end_marked_run(database, mark, machine, simulated=simulated)
                ]
        except sqlite3.Error as error:
            code = "record.damaged" if is_damage(error) else "record.unwritable"
            raise record_error(code, data / FILE_NAME, error) from error
    return tuple(ended)


def killed_or_refused(data: Path, machine: str, *, simulated: bool, checked: bool = True) -> tuple[Problem, ...]:
    """Return the same for a screen, which must open: instead of raising, return why no cut can be recorded."""
    try:
        return killed_runs(data, machine, simulated=simulated, checked=checked)
    except SessionError as refused:
        return tuple(refused.problems)


def held_marks(data: Path) -> frozenset[str]:
    """Return the runs whose consoles still hold their marks, as one that is just ending does."""
    held = set()
    for path in _marks(data):
        descriptor = taken_if_left(path)
        if descriptor is None:
            held.add(path.name)
        else:
            os.close(descriptor)
    return frozenset(held)


def _marks(data: Path) -> list[Path]:
    try:
        return sorted((data / FOLDER).iterdir())
    except OSError:  # it is made with the first run
        return []


@contextmanager
def _left_marks(data: Path) -> Iterator[list[Path]]:
    """Yield the marks that killed runs have left, locked against other consoles."""
    left = []
    with ExitStack() as locks:
        for path in _marks(data):
            descriptor = taken_if_left(path)
            if descriptor is not None:
                locks.callback(os.close, descriptor)
                left.append(path)
        yield left


def _end_marked_run(database: sqlite3.Connection, mark: Path, machine: str, *, simulated: bool) -> list[Problem]:
    """End the run of a mark and remove the mark; return the problem to report."""
    run_id = mark.name
    run = database.execute(_RUN, (run_id, machine, int(simulated))).fetchone()
    if run is None:
        if not database.execute(_ANY, (run_id,)).fetchone()[0]:
            mark.unlink(missing_ok=True)
        return []
    kinds = {kind for (kind,) in database.execute(_KINDS, (run_id,))}
    if not kinds & _ENDED:
        end = event_statement(run_id, utc_now(), "ended", {"reason": "killed"})
        retrying(lambda: transaction(database, [end]), time.monotonic() + TIMEOUT_S)
    mark.unlink(missing_ok=True)
    code = "record.left_in_part" if LEFT_IN_PART in kinds else "record.killed"
    if code == "record.killed" and (kinds & _ENDED or not kinds & _BEGUN):
        return []
    began, job = (printable(each, 60) for each in run)
    return [Problem(code=code, key=job, value=f"{began[:16].replace('T', ' ')} UTC")]
