"""Schema of the run records, and the steps from each older one. Every table is append-only.

A step is one transaction: a kill in its middle leaves the old schema. A console of an older schema that has the
file open meanwhile can continue: columns are only added, at the end.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator

from profiles.strict_values import from_json, number

SCHEMA = 2

TELEMETRY_COLUMNS = (
    "time_s",
    "turn",
    "z_mm",
    "speed_rpm",
    "tool_error_um",
    "phase_error_deg",
    "following_error_um",
)
"""Columns of each row in a block of telemetry: float32, little-endian, NaN where a value is not known.

Time and turns are from the first status poll of the program, Z from the face of the part.
"""

GATHERED_COLUMNS = ("turn", "past_middle_mm", "infeed_um")
"""Columns of a gathered window: turn of the spindle, distance past the middle of the cut, infeed of the tool."""


def _kept(table: str) -> tuple[str, str]:
    """Return the triggers that make a table append-only."""
    return (
        f"CREATE TRIGGER {table}_stay BEFORE UPDATE ON {table} BEGIN SELECT RAISE(ABORT, 'append only'); END",
        f"CREATE TRIGGER {table}_are_kept BEFORE DELETE ON {table} BEGIN SELECT RAISE(ABORT, 'append only'); END",
    )


SCHEMA_1 = (
    """CREATE TABLE runs (
    run_id TEXT PRIMARY KEY, started_utc TEXT NOT NULL, software TEXT NOT NULL,
    job TEXT NOT NULL, job_sha256 TEXT NOT NULL, machine TEXT NOT NULL, machine_sha256 TEXT NOT NULL,
    simulated INTEGER NOT NULL, strategy TEXT NOT NULL, program TEXT NOT NULL
) STRICT""",
    """CREATE TABLE events (
    run_id TEXT NOT NULL REFERENCES runs(run_id), number INTEGER NOT NULL, at_utc TEXT NOT NULL,
    kind TEXT NOT NULL, data TEXT NOT NULL, PRIMARY KEY (run_id, number)
) STRICT""",
    *_kept("runs"),
    *_kept("events"),
)

_ADDED = {
    "job_text_sha256": "TEXT REFERENCES texts(sha256)",
    "machine_text_sha256": "TEXT REFERENCES texts(sha256)",
    "python": "TEXT",
    "controller": "TEXT",
    "family": "TEXT",
    "stage": "TEXT",
    "compensation": "INTEGER",
    "operator": "TEXT",
    "tolerance_um": "REAL",
    "setup": "TEXT",
}
"""Columns that schema 2 adds to a run; all are NULL in a run of schema 1."""

_TO_2 = (
    "CREATE TABLE texts (sha256 TEXT PRIMARY KEY, content TEXT NOT NULL) STRICT",
    *(f"ALTER TABLE runs ADD COLUMN {name} {kind}" for name, kind in _ADDED.items()),
    """CREATE TABLE measurements (
    run_id TEXT NOT NULL REFERENCES runs(run_id), number INTEGER NOT NULL, at_utc TEXT NOT NULL,
    part TEXT NOT NULL, product INTEGER NOT NULL, ront_um REAL NOT NULL, tolerance_um REAL, passed INTEGER,
    diameter_mm REAL, nominal_diameter_mm REAL, diameter_tolerance_um REAL, lobe_um_pp REAL,
    trace_sha256 TEXT, trace_name TEXT, data TEXT NOT NULL, PRIMARY KEY (run_id, number)
) STRICT""",
    """CREATE TABLE traces (
    run_id TEXT NOT NULL REFERENCES runs(run_id), number INTEGER NOT NULL, content BLOB NOT NULL,
    PRIMARY KEY (run_id, number)
) STRICT""",
    """CREATE TABLE telemetry (
    run_id TEXT NOT NULL REFERENCES runs(run_id), number INTEGER NOT NULL, part TEXT NOT NULL,
    kind TEXT NOT NULL, begun_utc TEXT NOT NULL, data BLOB NOT NULL, PRIMARY KEY (run_id, number)
) STRICT""",
    "CREATE INDEX events_by_kind ON events (kind, run_id)",
    "CREATE INDEX runs_by_job ON runs (job)",
    "CREATE INDEX runs_by_machine ON runs (machine)",
    "CREATE INDEX runs_by_start ON runs (started_utc)",
    "CREATE INDEX measurements_by_trace ON measurements (trace_sha256)",
    *(line for table in ("texts", "measurements", "traces", "telemetry") for line in _kept(table)),
)

Measured = tuple[str, int, str, str, float, float | None, int | None, float | None, str]


def create(database: sqlite3.Connection) -> None:
    """Create the tables of the present schema in an empty file, inside the caller's transaction."""
    for line in SCHEMA_1:
        database.execute(line)
    migrate(database, 1)


def migrate(database: sqlite3.Connection, found: int) -> None:
    """Bring the tables from an older schema to the present one, inside the caller's transaction."""
    for older in range(found, SCHEMA):
        _STEPS[older](database)
    database.execute(f"PRAGMA user_version = {SCHEMA}")


def _to_2(database: sqlite3.Connection) -> None:
    """Add what schema 2 keeps of a run; parts that schema 1 has as events become measurements too."""
    for line in _TO_2:
        database.execute(line)
    events = database.execute(
        "SELECT run_id, number, at_utc, kind, data FROM events WHERE kind IN ('measured', 'result')"
    ).fetchall()
    database.executemany(
        "INSERT INTO measurements (run_id, number, at_utc, part, product, ront_um, tolerance_um, passed,"
        " diameter_mm, data) VALUES (?, ?, ?, ?, 1, ?, ?, ?, ?, ?)",
        list(_measured_1(events)),
    )


OWN_TRIGGERS = frozenset((None, *(line for line in (*SCHEMA_1, *_TO_2) if line.startswith("CREATE TRIGGER"))))
"""All that a schema of ours has besides tables and indexes; None is what SQLite itself adds."""

_STEPS: dict[int, Callable[[sqlite3.Connection], None]] = {1: _to_2}


def _measured_1(events: list[tuple[str, int, str, str, str]]) -> Iterator[Measured]:
    """Yield the measured parts in events of schema 1; one written otherwise stays an event and no more."""
    for run_id, count, at_utc, kind, data in events:
        try:
            event = from_json(data)
            if kind == "measured":
                diameter = event.get("diameter_mm")
                diameter_mm = None if diameter is None else number(diameter)
                yield run_id, count, at_utc, "", number(event["ront_um"]), None, None, diameter_mm, data
            else:
                within = event["within_tolerance"]
                passed = int(within) if isinstance(within, bool) else None
                ront_um, limit_um = number(event["after"]["RONt_um"]), number(event["roundness_tolerance_um"])
                yield run_id, count, at_utc, "after", ront_um, limit_um, passed, None, data
        except (ValueError, TypeError, KeyError, AttributeError):
            continue
