"""The file of the records is never stamped down nor written while damaged; what is lost or killed is told."""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import closing
from datetime import datetime, timedelta, tzinfo
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.session.data import kept_files, record_file, records, run_log
from console.session.data.record_file import FILE_NAME
from console.session.data.records import FOLDER, RESERVE_BYTES, RunRecord, killed_or_refused, killed_runs
from console.session.data.run_reader import story
from console.session.data.run_story import TELEMETRY_END
from console.session.errors import SessionError
from console.text.catalogue import load
from tests.console.commands import Console, JobFile

RUN = {
    **dict.fromkeys(("software", "job_sha256", "machine_sha256", "strategy", "program"), ""),
    "job": "ring",
    "machine": "lathe",
    "simulated": 1,
}
BEGINS = f"""
import signal, sys
from pathlib import Path
from console.session.data.records import RunRecord
data, machine, *kinds = sys.argv[1:]
record = RunRecord(Path(data), {{**{RUN!r}, "machine": machine}}, open_timeout_s=60.0, timeout_s=60.0)
for kind in kinds:
    record.add(kind, {{}})
print(record.run_id, flush=True)
signal.pause() if kinds != ["many"] else record.close()
"""


def begins(data: Path, *kinds: str, machine: str = "lathe") -> subprocess.Popen[str]:
    """A process that begins a run, adds events of these kinds, and lives on."""
    command = [sys.executable, "-c", BEGINS, str(data), machine, *kinds]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def killed(process: subprocess.Popen[str]) -> str:
    """Kill it once it has begun; return the run."""
    assert process.stdout is not None
    run_id = process.stdout.readline().strip()
    process.send_signal(signal.SIGKILL)
    process.communicate()
    return run_id


def rows(data: Path, query: str) -> list[Any]:
    with closing(sqlite3.connect(data / FILE_NAME)) as database:
        return database.execute(query).fetchall()


def change(data: Path, line: str) -> None:
    with closing(sqlite3.connect(data / FILE_NAME)) as database:
        database.execute(line)
        database.commit()


def codes(error: pytest.ExceptionInfo[SessionError]) -> list[str]:
    return [problem.code for problem in error.value.problems]


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A data folder with the record of a run in it."""
    folder = tmp_path / "kept"
    RunRecord(folder, RUN).close()
    return folder


def damage(data: Path) -> None:
    """Write over a page in the middle, as a bad disk does."""
    path = data / FILE_NAME
    content = bytearray(path.read_bytes())
    content[4096:8192] = bytes(range(256)) * 16
    path.write_bytes(content)


def stamp_newer(data: Path) -> None:
    change(data, "CREATE TABLE parts (anything TEXT)")
    change(data, "PRAGMA user_version = 3")


def stamp_away(data: Path) -> None:
    """What another program has made has no version of ours."""
    change(data, "PRAGMA user_version = 0")


REFUSED = {
    "record.other_schema": (stamp_newer, "schema 3"),
    "record.damaged": (damage, "damaged"),
}


@pytest.mark.parametrize("code", REFUSED)
def test_a_record_that_is_newer_or_damaged_is_refused_and_left_as_it_is(
    console: Console, job_file: JobFile, data: Path, code: str
) -> None:
    act, word = REFUSED[code]
    act(data)
    before = (data / FILE_NAME).read_bytes()
    with pytest.raises(SessionError) as refused:
        RunRecord(data, RUN)
    assert codes(refused) == [code]
    said = console("run", str(job_file(roundness_tolerance_um="10.0")), "--sim", "--data", str(data))
    assert (said.code, said.out, said.err.count("\n")) == (1, "", 1)
    assert word in said.err and "Nothing was written" in said.err and "--data" in said.err
    assert [problem.code for problem in killed_or_refused(data, "lathe", simulated=True)] == [code]
    assert (data / FILE_NAME).read_bytes() == before


def test_a_database_of_another_program_gets_no_tables_of_ours(data: Path) -> None:
    stamp_away(data)
    with pytest.raises(SessionError) as refused:
        RunRecord(data, RUN)
    assert codes(refused) == ["record.other_schema"]
    assert rows(data, "PRAGMA user_version") == [(0,)]


def take_folder(data: Path) -> None:
    shutil.rmtree(data)


def take_file(data: Path) -> None:
    (data / FILE_NAME).unlink()


def take_journal(data: Path) -> None:
    (data / f"{FILE_NAME}-wal").unlink()


def replace_file(data: Path) -> None:
    shutil.copy(data / FILE_NAME, data / "copy")
    os.replace(data / "copy", data / FILE_NAME)


@pytest.mark.parametrize("take", [take_folder, take_file, take_journal, replace_file])
def test_what_is_added_to_a_file_that_is_gone_is_told_as_lost(data: Path, take: Callable[[Path], None]) -> None:
    record = RunRecord(data, RUN)
    record.add("planned", {})
    take(data)
    with pytest.raises(SessionError) as lost:
        record.add("step", {})
    assert codes(lost) == ["record.lost"]
    assert "removed or replaced" in load("en").problem(lost.value.problems[0])
    record.close()


def test_a_run_whose_folder_is_taken_away_fails(
    console: Console, close: tuple[str, str], job_file: JobFile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = tmp_path / "kept"
    original = RunRecord.add

    def add(self: RunRecord, kind: str, told: dict[str, object]) -> None:
        if told.get("step") == "cut":
            shutil.rmtree(kept)
        original(self, kind, told)

    monkeypatch.setattr(RunRecord, "add", add)
    job = str(job_file(cut_length_mm="1.0"))
    shutil.copytree(tmp_path / "data" / "trilobe", kept)
    said = console("run", job, "--sim", *close, "--data", str(kept))
    assert said.code == 1
    assert "run record is lost" in said.err and "measure" not in said.out


@pytest.mark.long
def test_many_that_begin_at_once_wait_for_each_other(tmp_path: Path) -> None:
    many = [begins(tmp_path / "new", "many") for _ in range(6)]
    ended = [(*process.communicate(timeout=60), process.returncode) for process in many]
    assert [(err, code) for _, err, code in ended] == [("", 0)] * len(many)
    assert rows(tmp_path / "new", "SELECT count(*) FROM runs")[0][0] == len(many)
    assert list((tmp_path / "new" / FOLDER).iterdir()) == []


def test_a_writer_that_takes_longer_than_a_second_is_waited_for(data: Path) -> None:
    """At the beginning of a run, and at an event in the midst of it."""
    record = RunRecord(data, RUN)
    other = sqlite3.connect(data / FILE_NAME, isolation_level=None, check_same_thread=False)
    with closing(other):
        acts: tuple[Callable[[], object], ...] = (
            lambda: RunRecord(data, RUN).close(),
            lambda: record.add("step", {}),
        )
        for act in acts:
            other.execute("BEGIN IMMEDIATE")
            release = threading.Timer(1.2, other.execute, ("ROLLBACK",))
            release.start()
            act()
            release.join()
    record.close()
    assert len(rows(data, "SELECT run_id FROM runs")) == 3


def test_a_run_that_was_killed_is_told_once_and_gets_its_end(data: Path) -> None:
    run_id = killed(begins(data, "planned", "step"))
    (told,) = killed_runs(data, "lathe", simulated=True)
    assert (told.code, told.key) == ("record.killed", "ring")
    assert "UTC" in told.value and "killed" in load("en").problem(told)
    events = f"SELECT number, kind, data FROM events WHERE run_id = '{run_id}' ORDER BY number"
    assert rows(data, events)[2:] == [(3, "ended", '{"reason": "killed"}')]
    assert killed_runs(data, "lathe", simulated=True) == ()
    assert list((data / FOLDER).iterdir()) == []


@pytest.mark.parametrize(("machine", "simulated"), [("lathe", False), ("another", True)])
def test_a_run_that_was_killed_is_told_where_its_machine_is_worked(
    data: Path, machine: str, simulated: bool
) -> None:
    killed(begins(data, "started"))
    assert killed_runs(data, machine, simulated=simulated) == ()
    assert len(killed_runs(data, "lathe", simulated=True)) == 1


@pytest.mark.parametrize("kinds", [("armed",), ("armed", "started", "cut"), ("armed", "started", "stopped")])
@pytest.mark.first(1)
def test_a_console_that_was_killed_beside_a_cut_has_left_none_without_an_end(
    data: Path, kinds: tuple[str, ...]
) -> None:
    killed(begins(data, *kinds))
    assert killed_runs(data, "lathe", simulated=True) == ()
    assert list((data / FOLDER).iterdir()) == []


def test_a_run_that_goes_on_is_not_told_as_killed(data: Path) -> None:
    with begins(data, "planned") as living:
        assert living.stdout is not None
        run_id = living.stdout.readline().strip()
        assert killed_runs(data, "lathe", simulated=True) == ()
        living.kill()
    assert [mark.name for mark in (data / FOLDER).iterdir()] == [run_id]


def test_the_next_run_tells_of_one_that_was_killed(
    console: Console, close: tuple[str, str], job_file: JobFile, data_folder: Path
) -> None:
    job, data = str(job_file(cut_length_mm="0.5")), data_folder / "trilobe"
    words = ("run", job, "--sim", *close, "--strategy", "none", "--json")
    first = console(*words)
    assert first.code == 0 and "was killed" not in first.err
    for _ in range(2):
        killed(begins(data, "planned", machine=first.json["machine"]))
    said = console(*words)
    assert said.code == 0 and said.err.count("was killed") == 2
    assert sum("was killed" in warning for warning in said.json["warnings"]) == 2
    assert "was killed" not in console(*words).err


def test_a_clock_that_is_set_in_mid_run_changes_no_duration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An hour ahead, and back: by the time signal of a plant, or by hand."""
    hours = cycle((0, 1, -1))

    class Clock(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> Any:
            return real.now(tz) + timedelta(hours=next(hours))

    real = datetime
    monkeypatch.setattr(kept_files, "datetime", Clock)
    run = RunRecord(tmp_path, RUN)
    run.log.event("armed", {})
    run.add("started", {})
    run.log.event("step", {"step": "cut"})
    run.add("cut", {"turn": 10.0})
    run.close()
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as database:
        dates = [real.fromisoformat(at) for (at,) in database.execute("SELECT at_utc FROM events ORDER BY number")]
    assert len(dates) == 4 and max(dates) - min(dates) < timedelta(minutes=1)


def test_what_other_writers_keep_out_is_written_when_they_let_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two hundred commands at once had lost a tenth of the telemetry of the runs they made."""
    monkeypatch.setattr(run_log, "WRITE_TIMEOUT_S", 0.0)
    tries, write = threading.Semaphore(0), run_log.RunLog._write

    def tried(log: run_log.RunLog, statements: Any) -> None:
        tries.release()
        write(log, statements)

    monkeypatch.setattr(run_log.RunLog, "_write", tried)
    run = RunRecord(tmp_path, RUN)
    with closing(sqlite3.connect(tmp_path / FILE_NAME, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        run.log.begin_cut("", lambda polls: np.array(polls, dtype=float))
        for number in range(30):
            run.log.poll((float(number),) * 7)
        for _ in range(2):
            assert tries.acquire(timeout=20.0)
        other.execute("ROLLBACK")
    run.log.end_cut()
    run.close()
    assert run.log.problem is None
    (end,) = [event.data for event in story(tmp_path, run.run_id).events if event.kind == TELEMETRY_END]
    assert (end["rows"], end["lost"]) == (30, 0)


def test_how_a_run_ended_still_fits_on_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = RunRecord(tmp_path, RUN)
    assert os.fstat(run._reserve or 0).st_blocks * 512 >= RESERVE_BYTES, "room that nobody else can take"
    write = record_file.transaction

    def full(database: sqlite3.Connection, statements: Any) -> None:
        if run._reserve is not None:
            error = sqlite3.OperationalError("database or disk is full")
            error.sqlite_errorcode = sqlite3.SQLITE_FULL
            raise error
        write(database, statements)

    monkeypatch.setattr(records, "transaction", full)
    with pytest.raises(SessionError) as lost:
        run.add("stopped", {"reason": "space"})
    assert [problem.code for problem in lost.value.problems] == ["record.lost"], "it does not go on"
    run.close()
    assert [event.kind for event in story(tmp_path, run.run_id).events] == ["stopped"]
