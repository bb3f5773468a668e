"""Runs whose console was killed: their record has no end; the next start on their machine reports it, once."""

from __future__ import annotations

import json
import sqlite3
import time
from pathlib import Path

from console.session.data.dates import utc_now
from console.session.data.record_file import FILE_NAME, is_damage, opened, patiently, record_error
from console.session.data.running import left_runs
from console.session.errors import SessionError
from profiles.files import printable
from profiles.problem import Problem

PATIENCE_S = 5.0

_BEGUN, _ENDED = {"planned", "started"}, {"result", "cut", "held", "ended", "ended_early", "stopped"}

_RUN = "SELECT started_utc, job FROM runs WHERE run_id = ? AND machine = ? AND simulated = ?"
_ANY = "SELECT count(*) FROM runs WHERE run_id = ?"
_KINDS = "SELECT kind FROM events WHERE run_id = ?"
_END = "INSERT INTO events SELECT ?, 1 + coalesce(max(number), 0), ?, 'ended', ? FROM events WHERE run_id = ?"


def killed_runs(data: Path, machine: str, *, simulated: bool) -> tuple[Problem, ...]:
    """Return `record.killed` for each run on this machine whose console is gone, and record its end.

    Those on another machine wait for a start on that one. Where there is no record, none is made.

    Raises:
        SessionError: `record.other_schema`, `record.damaged`, `record.unwritable`, of a record that is there.
    """
    if not (data / FILE_NAME).exists():
        return ()
    database = opened(data, time.monotonic() + PATIENCE_S)
    try:
        with left_runs(data) as marks:
            ended = [each for mark in marks for each in _ended(database, mark, machine, simulated=simulated)]
    except sqlite3.Error as error:
        code = "record.damaged" if is_damage(error) else "record.unwritable"
        raise record_error(code, data / FILE_NAME, error) from error
    finally:
        database.close()
    return tuple(ended)


def killed_or_refused(data: Path, machine: str, *, simulated: bool) -> tuple[Problem, ...]:
    """Return the same for a screen, which must open: instead of raising, return why no cut can be recorded."""
    try:
        return killed_runs(data, machine, simulated=simulated)
    except SessionError as refused:
        return tuple(refused.problems)


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
        patiently(lambda: database.execute(_END, end), time.monotonic() + PATIENCE_S)
    mark.unlink(missing_ok=True)
    if kinds & _ENDED or not kinds & _BEGUN:
        return []
    began, job = (printable(each, 60) for each in run)
    return [Problem(code="record.killed", key=job, value=f"{began[:16].replace('T', ' ')} UTC")]
