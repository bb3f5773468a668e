"""The file of the records is never stamped down nor written while damaged; what is left or killed is told."""

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
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from pytest import MonkeyPatch

from console.session.cut.alignment import problems
from console.session.data import kept_files, record_file, records, run_log
from console.session.data.record_file import FILE_NAME
from console.session.data.records import (
    FOLDER,
    LEFT_IN_PART,
    RESERVE_BYTES,
    RunRecord,
    killed_or_refused,
    killed_runs,
)
from console.session.data.run_reader import ended_early, story
from console.session.data.run_story import TELEMETRY_END
from console.session.errors import SessionError
from console.session.station.commands import ConfirmClamping, EnableDrives, Home, Retract, TakeControl
from console.text.catalogue import load
from drivers.cutting.planning import CutPlan
from drivers.lathe.snapshot import AxisName
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_job, load_machine
from tests.console.commands import Console, JobFile
from tests.console.consoles import MACHINE, WithStation, station_of

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


@pytest.mark.parametrize(
    ("act", "code", "word"),
    [(stamp_newer, "record.other_schema", "schema 3"), (damage, "record.damaged", "damaged")],
)
def test_a_newer_or_damaged_record_is_refused_and_stays(
    console: Console, job_file: JobFile, data: Path, act: Callable[[Path], None], code: str, word: str
) -> None:
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
    """It has no version of ours."""
    change(data, "PRAGMA user_version = 0")
    with pytest.raises(SessionError) as refused:
        RunRecord(data, RUN)
    assert codes(refused) == ["record.other_schema"]
    assert rows(data, "PRAGMA user_version") == [(0,)]


def replace_file(data: Path) -> None:
    shutil.copy(data / FILE_NAME, data / "copy")
    os.replace(data / "copy", data / FILE_NAME)


TAKE: dict[str, Callable[[Path], object]] = {
    "folder": shutil.rmtree,
    "file": lambda data: (data / FILE_NAME).unlink(),
    "journal": lambda data: (data / f"{FILE_NAME}-wal").unlink(),
    "replaced": replace_file,
}


@pytest.mark.parametrize("taken", TAKE)
def test_what_is_added_to_a_file_that_is_gone_is_told_as_lost(data: Path, taken: str) -> None:
    record = RunRecord(data, RUN)
    record.add("planned", {})
    TAKE[taken](data)
    with pytest.raises(SessionError) as lost:
        record.add("step", {})
    assert codes(lost) == ["record.lost"]
    assert "removed or replaced" in load("en").problem(lost.value.problems[0])
    record.close()


def test_a_run_whose_folder_is_taken_away_fails(
    console: Console, close: tuple[str, str], job_file: JobFile, tmp_path: Path, monkeypatch: MonkeyPatch
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


def test_a_run_that_was_killed_is_told_once_at_its_machine_and_gets_its_end(data: Path) -> None:
    with begins(data, "planned", "step") as living:
        assert killed_runs(data, "lathe", simulated=True) == (), "it goes on"
        run_id = killed(living)
    for machine, simulated in (("lathe", False), ("another", True)):
        assert killed_runs(data, machine, simulated=simulated) == ()
    (told,) = killed_runs(data, "lathe", simulated=True)
    assert (told.code, told.key) == ("record.killed", "ring")
    assert "UTC" in told.value and "killed" in load("en").problem(told)
    events = f"SELECT number, kind, data FROM events WHERE run_id = '{run_id}' ORDER BY number"
    assert rows(data, events)[2:] == [(3, "ended", '{"reason": "killed"}')]
    assert killed_runs(data, "lathe", simulated=True) == ()
    assert list((data / FOLDER).iterdir()) == []


@pytest.mark.parametrize("kinds", [("armed",), ("armed", "started", "cut"), ("armed", "started", "stopped")])
@pytest.mark.first(1)
def test_a_kill_beside_a_cut_has_left_none(data: Path, kinds: tuple[str, ...]) -> None:
    killed(begins(data, *kinds))
    assert killed_runs(data, "lathe", simulated=True) == ()
    assert list((data / FOLDER).iterdir()) == []


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


def test_a_clock_that_is_set_in_mid_run_changes_no_duration(tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
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


def test_what_other_writers_keep_out_is_written_when_they_let_it(tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
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


def test_how_a_run_ended_still_fits_on_a_full_disk(tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
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


ON_A_MACHINE = {
    **dict.fromkeys(("software", "job_sha256", "machine_sha256", "strategy", "program"), ""),
    "job": "ring",
    "machine": MACHINE,
    "simulated": 0,
}


def beside_another(data: Path) -> tuple[SimulatedLathe, WithStation]:
    """A console that looks on, because another one of this computer has the machine."""
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    station_of(sim, data)
    new = station_of(sim, data)
    assert not new.state.controls
    return sim, new


def cut_left(data: Path) -> RunRecord:
    record = RunRecord(data, ON_A_MACHINE)
    record.add("started", {})
    record.add("stopped", {"reason": "SIGHUP"})
    return record


def leave(record: RunRecord) -> None:
    record.add(LEFT_IN_PART, {})
    record.close(marked=True)


def test_whoever_takes_control_is_told_of_a_tool_that_was_left_in_the_part(tmp_path: Path) -> None:
    _, new = beside_another(tmp_path)
    leave(cut_left(tmp_path))
    assert "record.left_in_part" not in new.alarms
    new.do(TakeControl())
    assert new.state.controls
    (told,) = [alarm.problem for alarm in new.state.alarms if alarm.problem.code == "record.left_in_part"]
    assert told.key == "ring"


def test_a_console_that_is_still_ending_is_waited_for(tmp_path: Path) -> None:
    sim, new = beside_another(tmp_path)
    ending = cut_left(tmp_path)
    new.do(TakeControl())
    sim.wait(2.0)
    new.look()
    assert "record.left_in_part" not in new.alarms
    leave(ending)
    sim.wait(2.0)
    new.look()
    assert new.alarms.count("record.left_in_part") == 1
    sim.wait(2.0)
    new.look()
    assert new.alarms.count("record.left_in_part") == 1, "told once"


def test_a_console_that_starts_while_the_one_before_is_ending_is_told_too(tmp_path: Path) -> None:
    ending = cut_left(tmp_path)
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    new = station_of(sim, tmp_path)
    assert new.state.controls and "record.left_in_part" not in new.alarms
    leave(ending)
    sim.wait(2.0)
    new.look()
    assert new.alarms.count("record.left_in_part") == 1


def test_a_restart_remembers_that_the_last_cut_ended_early_until_a_clamping_is_confirmed(tmp_path: Path) -> None:
    cut_left(tmp_path).close()
    job = load_job("lee-2001-experiment-1").job
    new = station_of(SimulatedLathe(load_machine(MACHINE).machine), tmp_path)
    assert "alignment.ended_early" in [problem.code for problem in problems(new.state.alignment, job)]
    new.do(ConfirmClamping(job=job))
    assert new.state.alignment.clamping is not None
    assert "alignment.ended_early" not in [problem.code for problem in problems(new.state.alignment, job)]


def add_cut(data: Path, kinds: tuple[str, ...], **changes: object) -> None:
    record = RunRecord(data, {**ON_A_MACHINE, **changes})
    for kind in kinds:
        record.add(kind, {})
    record.close()


def test_a_cut_that_reached_its_end_or_no_part_leaves_nothing(tmp_path: Path) -> None:
    begun = ("armed", "started")
    cuts: tuple[tuple[dict[str, object], tuple[str, ...], bool], ...] = (
        *(({}, (*begun, end), True) for end in ("stopped", "held", "ended")),
        ({}, (*begun, "cut"), False),
        ({"stage": "air"}, (*begun, "stopped"), False),
        ({}, ("armed",), False),
        ({"machine": "another"}, (*begun, "stopped"), False),
        ({"simulated": 1}, (*begun, "stopped"), False),
    )
    for number, (run, kinds, early) in enumerate(cuts):
        add_cut(tmp_path / str(number), kinds, **run)
        assert ended_early(tmp_path / str(number), MACHINE) is early, (run, kinds)


def test_of_several_cuts_the_last_one_that_was_started_counts(tmp_path: Path) -> None:
    assert not ended_early(tmp_path, MACHINE)
    cuts: tuple[tuple[dict[str, object], tuple[str, ...], bool], ...] = (
        ({}, ("started", "stopped"), True),
        ({}, ("armed",), True),
        ({"stage": "air"}, ("started", "cut"), True),  # to look at what was wrong
        ({}, ("started", "cut"), False),
    )
    for run, kinds, early in cuts:
        add_cut(tmp_path, kinds, **run)
        assert ended_early(tmp_path, MACHINE) is early, kinds


def test_who_looks_on_at_a_cut_is_not_told_that_it_ended_early(tmp_path: Path) -> None:
    """It has no end yet, because it runs."""
    lathe = SimulatedLathe(load_machine(MACHINE).machine)
    first = station_of(lathe, tmp_path)
    assert first.state.controls
    record = RunRecord(tmp_path, ON_A_MACHINE)
    record.add("started", {})
    second = station_of(lathe, tmp_path)
    assert not second.state.controls
    job = load_job("lee-2001-experiment-1").job
    assert "alignment.ended_early" not in [problem.code for problem in problems(second.state.alignment, job)]
    record.close()


def test_homing_takes_the_tool_out_first_and_f8_never_moves_it_in(tmp_path: Path) -> None:
    """Nobody knows where the tool stands; no blank has to be confirmed that is not there."""
    cut_left(tmp_path).close()
    new = station_of(SimulatedLathe(load_machine(MACHINE).machine), tmp_path)
    new.do(EnableDrives())
    before = new.state.snapshot
    assert before is not None and not before.homed
    plan = SimpleNamespace(setup=SimpleNamespace(retracted=before.tool.position + 1.0e5), zero_row_z=None)
    new.context.plan = cast(CutPlan, plan)  # of the cut that was left, in the zero that is lost
    new.do(Retract())
    after = new.state.snapshot
    assert new.refusals == [] and after is not None
    assert after.tool.position < before.tool.position, "positive is toward the work"
    assert after.carriage.commanded_position == before.carriage.commanded_position
    moved: list[str] = []
    new.looks.append(
        lambda seen: moved.extend(a for a in AxisName if "desired_velocity_zero" not in seen.axis(a).flags)
    )
    new.do(Home())
    assert list(dict.fromkeys(moved)) == [AxisName.TOOL, AxisName.CARRIAGE, AxisName.SPINDLE]
    assert new.state.snapshot is not None and new.state.snapshot.homed
    assert "alignment.ended_early" in [problem.code for problem in new.state.alignment.lost], "as it was recorded"
    new.do(Retract())
    assert new.refusals == ["screen.tool_is_out"]
