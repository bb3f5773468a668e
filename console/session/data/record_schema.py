"""Schema of the run records. Every table is append-only."""

from __future__ import annotations

import sqlite3

SCHEMA = 1

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


def _append_only_triggers(table: str) -> tuple[str, str]:
    """Return the triggers that make a table append-only."""
    return (
        f"CREATE TRIGGER {table}_stay BEFORE UPDATE ON {table} BEGIN SELECT RAISE(ABORT, 'append only'); END",
        f"CREATE TRIGGER {table}_are_kept BEFORE DELETE ON {table} BEGIN SELECT RAISE(ABORT, 'append only'); END",
    )


_TABLES = (
    """CREATE TABLE runs (
    run_id TEXT PRIMARY KEY, started_utc TEXT NOT NULL, software TEXT NOT NULL,
    job TEXT NOT NULL, job_sha256 TEXT NOT NULL, machine TEXT NOT NULL, machine_sha256 TEXT NOT NULL,
    simulated INTEGER NOT NULL, strategy TEXT NOT NULL, program TEXT NOT NULL,
    job_text_sha256 TEXT REFERENCES texts(sha256), machine_text_sha256 TEXT REFERENCES texts(sha256),
    python TEXT, controller TEXT, family TEXT, stage TEXT, compensation INTEGER, operator TEXT,
    tolerance_um REAL, setup TEXT
) STRICT""",
    """CREATE TABLE events (
    run_id TEXT NOT NULL REFERENCES runs(run_id), number INTEGER NOT NULL, at_utc TEXT NOT NULL,
    kind TEXT NOT NULL, data TEXT NOT NULL, PRIMARY KEY (run_id, number)
) STRICT""",
    "CREATE TABLE texts (sha256 TEXT PRIMARY KEY, content TEXT NOT NULL) STRICT",
    """CREATE TABLE measurements (
    run_id TEXT NOT NULL REFERENCES runs(run_id), number INTEGER NOT NULL, at_utc TEXT NOT NULL,
    part TEXT NOT NULL, product INTEGER NOT NULL, ront_um REAL, tolerance_um REAL, passed INTEGER,
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
)
_INDEXES = (
    "CREATE INDEX events_by_kind ON events (kind, run_id)",
    "CREATE INDEX runs_by_job ON runs (job)",
    "CREATE INDEX runs_by_machine ON runs (machine)",
    "CREATE INDEX runs_by_start ON runs (started_utc)",
    "CREATE INDEX measurements_by_trace ON measurements (trace_sha256)",
)
_TRIGGERS = tuple(
    line
    for table in ("texts", "runs", "events", "measurements", "traces", "telemetry")
    for line in _append_only_triggers(table)
)
OWN_TRIGGERS = frozenset((None, *_TRIGGERS))
"""All that a schema of ours has besides tables and indexes; None is what SQLite itself adds."""


_DEMANDED = "ront_um REAL NOT NULL"  # of a part, by earlier versions
MAY_LACK_ROUNDNESS = (
    "PRAGMA writable_schema = ON",
    f"UPDATE sqlite_schema SET sql = replace(sql, '{_DEMANDED}', 'ront_um REAL') WHERE name = 'measurements'",
    "PRAGMA writable_schema = RESET",
)
"""Lifts that demand by the only way of SQLite that rewrites no table (its page on ALTER TABLE, section 7)."""


def create(database: sqlite3.Connection) -> None:
    """Create the tables in an empty file, inside the caller's transaction."""
    for line in (*_TABLES, *_INDEXES, *_TRIGGERS):
        database.execute(line)
    database.execute(f"PRAGMA user_version = {SCHEMA}")
