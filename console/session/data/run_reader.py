"""Read the run records: the list of runs page by page, one run in full, and the measured parts of a job.

Nothing here writes, or locks out a console that records a cut. A file of an older schema is read as it is.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from console.session.data.measured_part import PART_COLUMNS, RecordedPart, column_values
from console.session.data.record_file import (
    FILE_NAME,
    damage_as_error,
    is_damage,
    opened_to_read,
    record_error,
    refuse_other_schema,
)
from console.session.data.run_rows import (
    COMPLETE,
    FAILED,
    FORM,
    MODEL,
    RunRow,
    date_of,
    inverted_of,
    rows_where,
    table_of,
)
from console.session.data.run_story import RunStory, story_of
from console.session.errors import SessionError
from console.session.operator import account_name
from profiles.files import printable
from profiles.problem import Problem

READ_TIMEOUT_S = 0.5
"""How long to wait for a console that is just closing the file."""

LIST_LIMIT = 50
SHOWN_IDS = 4


_LAST = """
SELECT run_id FROM runs WHERE machine = ? AND simulated = 0 AND stage IS NOT 'air'
    AND EXISTS (SELECT 1 FROM events WHERE events.run_id = runs.run_id
        AND (kind IN ('started', 'result') OR kind = 'step' AND data LIKE '%"step": "cut"%'))
    ORDER BY rowid DESC LIMIT 1
"""
_COMPLETE = f"SELECT 1 FROM events WHERE kind IN {COMPLETE} AND run_id = ? LIMIT 1"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFilters:
    """Which runs to list; None is any. `since` is included, `until` is not; both with a time zone."""

    job: str | None = None
    machine: str | None = None
    simulated: bool | None = None
    since: datetime | None = None
    until: datetime | None = None
    failed: bool = False


def runs(
    folder: Path, filters: RunFilters | None = None, before: str | None = None, limit: int = LIST_LIMIT
) -> tuple[RunRow, ...]:
    """Return recorded runs, newest first in the order in which they were recorded; none without a record.

    `before` is the id of the last run of the page before. The cost grows with the runs returned.

    Raises:
        SessionError: `record.other_schema`; `record.not_readable`, damaged or locked as a whole.
    """
    conditions, keys = _conditions(filters or RunFilters())
    if before is not None:
        conditions.append("runs.rowid < (SELECT rowid FROM runs WHERE run_id = ?)")
        keys.append(before)
    with _reading(folder) as database:
        if database is None:
            return ()
        return tuple(rows_where(database, " AND ".join(conditions) or "1", keys, limit))


def ended_early(folder: Path, machine: str) -> bool:
    """Whether the last cut on a real machine has no end as planned in the record: its part may be cut in part.

    A cut in air has touched nothing: the cut before it counts. False where the record cannot
    be read; its own check reports that.
    """
    with suppress(SessionError), _reading(folder) as database:
        found = None if database is None else database.execute(_LAST, (machine,)).fetchone()
        if database is not None and found is not None:
            return database.execute(_COMPLETE, found).fetchone() is None
    return False


def story(folder: Path, run_id_prefix: str) -> RunStory:
    """Return everything of one run, given by the beginning of its id.

    Raises:
        SessionError: `record.no_run`; `record.ambiguous_run`, several begin so; as `runs`.
    """
    prefix = run_id_prefix.strip().lower()
    with _reading(folder) as database:
        # Hexadecimal: "g" is behind every digit.
        condition = "runs.run_id >= ? AND runs.run_id < ? || 'g'"
        found = [] if database is None else rows_where(database, condition, (prefix, prefix), SHOWN_IDS)
        if database is None or not found or not prefix:
            raise SessionError(Problem(code="record.no_run", value=printable(run_id_prefix, 60)))
        if len(found) > 1:
            limit = " | ".join(row.run_id[: len(prefix) + 4] for row in found)
            raise SessionError(Problem(code="record.ambiguous_run", value=prefix, limit=limit))
        return story_of(database, found[0])


_MEASURED = f"""
SELECT measurements.run_id, measurements.at_utc, strategy, stage, compensation, setup, runs.tolerance_um, {FORM},
    {", ".join(f"measurements.{name}" for name in PART_COLUMNS)}
FROM runs JOIN measurements ON measurements.run_id = runs.run_id
WHERE product = 1 AND ront_um IS NOT NULL AND job = ? AND machine = ? AND simulated = ?
AND number = (SELECT max(number) FROM measurements AS again WHERE again.run_id = measurements.run_id
    AND again.part = measurements.part AND again.ront_um IS NOT NULL)
ORDER BY runs.rowid DESC, number DESC LIMIT ?
"""


def measured_parts(
    folder: Path, job: str, machine: str, simulated: bool, limit: int = 500
) -> tuple[RecordedPart, ...]:
    """Return the last measured products of a job on a machine, oldest first; the last measurement of each.

    Those of which no roundness is known are left out.

    Raises SessionError: as `runs`.
    """
    with _reading(folder) as database:
        if database is None:
            return ()
        found = database.execute(_MEASURED, (job, machine, int(simulated), limit)).fetchall()
    return tuple(_point(each) for each in reversed(found))


def _point(found: Sequence[Any]) -> RecordedPart:
    run_id, at_utc, strategy, stage, version, setup, of_run, form, *columns = found
    values = column_values(columns)
    if values["tolerance_um"] is None:
        values["tolerance_um"] = of_run
    return RecordedPart(
        run_id=run_id,
        at=date_of(at_utc)[0],
        strategy=strategy,
        stage=stage,
        compensation=None if stage is None else MODEL if version is None else str(version),
        inverted=inverted_of(setup),
        data=table_of(form or ""),
        **values,
    )


def run_of_trace(folder: Path, trace_sha256: str, other_than: str | None = None) -> str | None:
    """Return the newest run, `other_than` one, whose part has the trace with this hash; None without one.

    Raises SessionError: as `runs`.
    """
    query = (
        "SELECT run_id FROM measurements WHERE trace_sha256 = ? AND run_id IS NOT ? ORDER BY rowid DESC LIMIT 1"
    )
    with _reading(folder) as database:
        found = None if database is None else database.execute(query, (trace_sha256, other_than)).fetchone()
    return None if found is None else str(found[0])


def strategy_of_trace(folder: Path, trace_sha256: str) -> str | None:
    """Return how the newest part with this trace was cut, "none" for a plain one; None without one; as `runs`."""
    query = """
    SELECT iif(product, strategy, 'none') FROM measurements JOIN runs USING (run_id) WHERE trace_sha256 = ?
    ORDER BY measurements.rowid DESC LIMIT 1
    """
    with _reading(folder) as database:
        found = None if database is None else database.execute(query, (trace_sha256,)).fetchone()
    return None if found is None else str(found[0])


def cuts_of_run(folder: Path, run_id: str) -> list[tuple[str, str, str]]:
    """Return kind, data and date of the cuts of a run that came to their end, newest first; as `run_of_trace`."""
    query = """
    SELECT kind, data, at_utc FROM events WHERE run_id = ? AND kind IN ('result', 'cut') ORDER BY rowid DESC
    """
    with _reading(folder) as database:
        return [] if database is None else database.execute(query, (run_id,)).fetchall()


def _conditions(filters: RunFilters) -> tuple[list[str], list[object]]:
    conditions, keys = [], list[object]()
    for column, value in (("job", filters.job), ("machine", filters.machine)):
        if value is not None:
            conditions.append(f"runs.{column} = ?")
            keys.append(value)
    if filters.simulated is not None:
        conditions.append("runs.simulated = ?")
        keys.append(int(filters.simulated))
    for sign, date in ((">=", filters.since), ("<", filters.until)):
        if date is not None:
            conditions.append(f"runs.started_utc {sign} ?")
            keys.append(recorded_date(date))
    if filters.failed:
        conditions.append(FAILED)
    return conditions, keys


def recorded_date(date: datetime) -> str:
    """Return a date as the records have it: as text in the order of time."""
    return date.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


@contextmanager
def _reading(folder: Path) -> Iterator[sqlite3.Connection | None]:
    """Yield the database of a folder, None without one; errors of the file are refusals."""
    path = folder / FILE_NAME
    try:
        if not path.exists():
            yield None
            return
        with damage_as_error(), closing(opened_to_read(path, READ_TIMEOUT_S)) as database:
            refuse_other_schema(database, path)
            yield database
    except (OSError, sqlite3.Error) as error:
        if not os.access(path, os.R_OK):
            closed = Problem(code="data.closed", where=printable(str(path)), value=account_name())
            raise SessionError(closed) from error
        code = "record.damaged" if isinstance(error, sqlite3.Error) and is_damage(error) else "record.not_readable"
        raise record_error(code, path, error) from error
