"""A record of schema 1 becomes one of schema 2 in one step: nothing is lost; a kill leaves either of the two."""

from __future__ import annotations

import json
import os
import re
import signal
import sqlite3
import time
from contextlib import closing
from pathlib import Path

import pytest

from console.session.data import record_file, record_schema
from console.session.data.record_file import FILE_NAME, opened
from console.session.data.records import RunRecord, add_to_run
from console.session.data.run_reader import How, measured_parts, runs, story

SCHEMA_1 = """
CREATE TABLE runs (
    run_id TEXT PRIMARY KEY, started_utc TEXT NOT NULL, software TEXT NOT NULL,
    job TEXT NOT NULL, job_sha256 TEXT NOT NULL, machine TEXT NOT NULL, machine_sha256 TEXT NOT NULL,
    simulated INTEGER NOT NULL, strategy TEXT NOT NULL, program TEXT NOT NULL
) STRICT;
CREATE TABLE events (
    run_id TEXT NOT NULL REFERENCES runs(run_id), number INTEGER NOT NULL, at_utc TEXT NOT NULL,
    kind TEXT NOT NULL, data TEXT NOT NULL, PRIMARY KEY (run_id, number)
) STRICT;
CREATE TRIGGER runs_stay BEFORE UPDATE ON runs BEGIN SELECT RAISE(ABORT, 'append only'); END;
CREATE TRIGGER runs_are_kept BEFORE DELETE ON runs BEGIN SELECT RAISE(ABORT, 'append only'); END;
CREATE TRIGGER events_stay BEFORE UPDATE ON events BEGIN SELECT RAISE(ABORT, 'append only'); END;
CREATE TRIGGER events_are_kept BEFORE DELETE ON events BEGIN SELECT RAISE(ABORT, 'append only'); END;
PRAGMA user_version = 1;
PRAGMA journal_mode = WAL;
"""
"""As the console before wrote it."""

NAMES = "run_id, started_utc, software, job, job_sha256, machine, machine_sha256, simulated, strategy, program"

MADE = {"strategy": "pvt", "stage": "full", "compensation": 2, "inverted": "model", "cut_jaw_1_deg": None}
RESULT = {
    **MADE,
    "compensation": None,
    "after": {"RONt_um": 3.5},
    "roundness_tolerance_um": 5.0,
    "within_tolerance": True,
}
EVENTS: dict[str, list[tuple[str, object]]] = {
    "a" * 32: [
        ("armed", {"force_n": 1314.0, **MADE}),
        ("started", {"strategy": "pvt"}),
        ("cut", {"turn": 16.0, **MADE}),
        ("measured", {"job": "ring", "strategy": "pvt", "ront_um": 2.5, "diameter_mm": 51.8}),
    ],
    "b" * 32: [("planned", {"warnings": []}), ("result", RESULT)],
    "c" * 32: [("planned", {}), ("ended", {"reason": "killed"})],
    "d" * 32: [("armed", {}), ("started", {}), ("ended_early", {"turns": 7, "reasons": ["cut.ended_early"]})],
    "e" * 32: [
        ("armed", {}),
        ("started", {}),
        ("measured", {"ront_um": "x"}),
        ("stopped", {"reason": "space"}),
    ],
    "f" * 32: [("armed", {})],
}
HOW = [How.NOT_STARTED, How.STOPPED, How.EARLY, How.KILLED, How.DONE, How.DONE]


def write_schema_1(folder: Path) -> Path:
    """A record of six runs, as the console before has written them."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / FILE_NAME
    with closing(sqlite3.connect(path, isolation_level=None)) as database:
        database.executescript(SCHEMA_1)
        for day, (run_id, events) in enumerate(EVENTS.items(), start=1):
            date = f"2026-05-{day:02d}T08:00:00.000Z"
            row = (run_id, date, "trilobe 0.1.0", "ring", "1" * 64, "lathe", "2" * 64, 1, "pvt", "OPEN PROG 2")
            database.execute("INSERT INTO runs VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", row)
            for number, (kind, data) in enumerate(events, start=1):
                line = (run_id, number, date, kind, json.dumps(data))
                database.execute("INSERT INTO events VALUES (?, ?, ?, ?, ?)", line)
    return path


def content(path: Path) -> list[object]:
    """What schema 1 has, whatever the schema of the file."""
    with closing(sqlite3.connect(path)) as database:
        found = [database.execute(f"SELECT {NAMES} FROM runs ORDER BY rowid").fetchall()]
        return [*found, database.execute("SELECT * FROM events ORDER BY rowid").fetchall()]


def schema(path: Path) -> int:
    with closing(sqlite3.connect(path)) as database:
        assert database.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        return int(database.execute("PRAGMA user_version").fetchone()[0])


def check_read(folder: Path) -> None:
    listed = runs(folder)
    assert [row.run_id[0] for row in listed] == list("fedcba")
    assert [row.ended.how for row in listed] == HOW
    assert [row.operator for row in listed] == [None] * 6
    assert [(row.ront_um, row.tolerance_um, row.passed) for row in listed[-2:]] == [
        (3.5, 5.0, True),
        (2.5, None, None),
    ]
    assert [(row.stage, row.compensation) for row in listed[-2:]] == [("full", "none"), ("full", "2")]
    assert (listed[2].ended.turn, listed[2].ended.reason, listed[1].ended.reason) == (
        7.0,
        "cut.ended_early",
        "space",
    )
    told = story(folder, "a")
    assert [event.kind for event in told.events] == [kind for kind, _ in EVENTS["a" * 32]]
    assert (told.job_text, told.telemetry, told.complete, told.damaged) == (None, (), None, ())
    assert [point.ront_um for point in measured_parts(folder, "ring", "lathe", True)] == [2.5, 3.5]


def test_schema_1_is_read_as_it_is_and_left_as_it_is(tmp_path: Path) -> None:
    path = write_schema_1(tmp_path)
    before = path.read_bytes()
    check_read(tmp_path)
    assert path.read_bytes() == before and schema(path) == 1


def test_the_next_cut_makes_it_schema_2_and_loses_nothing(tmp_path: Path) -> None:
    path = write_schema_1(tmp_path)
    before = content(path)
    opened(tmp_path, time.monotonic() + 5.0).close()
    assert (schema(path), content(path)) == (2, before)
    check_read(tmp_path)


def test_a_console_of_schema_1_that_has_the_file_open_meanwhile_writes_on(tmp_path: Path) -> None:
    path = write_schema_1(tmp_path)
    with closing(sqlite3.connect(path, isolation_level=None)) as older:
        older.execute("SELECT * FROM runs").fetchall()
        opened(tmp_path, time.monotonic() + 5.0).close()
        started = ("f" * 32, 2, "2026-05-06T08:00:00.000Z", "started", "{}")
        older.execute("INSERT INTO events VALUES (?, ?, ?, ?, ?)", started)
        run = ("a0", "2026-05-07T08:00:00.000Z", "", "bar", "", "lathe", "", 1, "", "")
        older.execute(f"INSERT INTO runs ({NAMES}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", run)
    assert runs(tmp_path)[0].job == "bar"
    assert runs(tmp_path)[1].ended.how is How.OPEN


@pytest.mark.first(5)
@pytest.mark.parametrize("statement", range(1, 40, 3))
def test_a_kill_in_the_middle_of_a_migration_leaves_schema_1_or_2(tmp_path: Path, statement: int) -> None:
    path = write_schema_1(tmp_path)
    before = content(path)
    if not (child := os.fork()):
        killed_at(tmp_path, statement)
    _, status = os.waitpid(child, 0)
    assert os.WTERMSIG(status) == signal.SIGKILL
    assert (schema(path), content(path)) == (1, before)
    record = RunRecord(tmp_path, {**dict.fromkeys(RUN, ""), "simulated": 1})
    record.close()
    assert schema(path) == 2 and content(path)[1] == before[1]
    add_to_run(tmp_path, record.run_id, "measured", {})


RUN = ("software", "job", "job_sha256", "machine", "machine_sha256", "strategy", "program")


def killed_at(folder: Path, statement: int) -> None:
    """Begin to migrate, and be killed at a statement of it."""
    left = [statement]

    def count(_: str) -> None:
        left[0] -= 1
        if left[0] <= 0:
            os.kill(os.getpid(), signal.SIGKILL)

    original = record_schema.migrate

    def migrate(database: sqlite3.Connection, found: int) -> None:
        database.set_trace_callback(count)
        original(database, found)
        os.kill(os.getpid(), signal.SIGKILL)  # all is done but the COMMIT

    setattr(record_file, "migrate", migrate)  # noqa: B010
    try:
        opened(folder, time.monotonic() + 5.0)
    finally:
        os._exit(0)


def test_the_queries_of_the_document_work(tmp_path: Path) -> None:
    opened(tmp_path, time.monotonic() + 5.0).close()
    document = (Path(__file__).parents[2] / "docs" / "records.md").read_text(encoding="utf-8")
    queries = re.findall(r"^```sql\n(.*?)^```", document, re.MULTILINE | re.DOTALL)
    assert len(queries) == 4
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as database:
        for query in queries:
            assert database.execute(query).fetchall() == []
