"""What is recorded of a run is read again: page by page, in full, with what is damaged left out."""

from __future__ import annotations

import hashlib
import os
import pwd
import re
import sqlite3
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest import MonkeyPatch

from console.session.cut.run import roundness_of
from console.session.data import records
from console.session.data.history import last_results
from console.session.data.measured_part import RecordedPart
from console.session.data.record_file import FILE_NAME, open_records
from console.session.data.records import RunRecord, add_to_run
from console.session.data.run_log import RunLog
from console.session.data.run_reader import RunFilters, measured_parts, run_of_trace, runs, story
from console.session.data.run_rows import RunOutcome, RunRow
from console.session.data.run_story import ACCEPTED
from console.session.errors import SessionError
from console.session.learning.part_learning import accept, record_accepted
from console.session.station.alarms import Priority, acknowledge_alarms
from console.session.station.commands import Acknowledge, DisableDrives, EndCut, Measure, Start
from profiles.problem import Problem
from profiles.store import load_job
from profiles.traces import parse_trace
from tests.console.floor import Floor, experiment_1

RUN = {
    **dict.fromkeys(("software", "job_sha256", "machine_sha256", "strategy", "program"), ""),
    "job": "ring",
    "machine": "lathe",
    "simulated": 1,
    "stage": "full",
    "python": "3",
}
USER = pwd.getpwuid(os.getuid()).pw_name


def record(folder: Path, *ums: float, **changes: Any) -> str:
    """A run with measured parts; of 5 um or less they are good."""
    run = RunRecord(folder, {**RUN, **changes})
    run.add("started", {})
    for um in ums:
        run.add("measured", {"ront_um": um}, part(um))
    if ums:
        run.add("cut", {"turn": 9.0})
    run.close()
    return run.run_id


def part(um: float, **changes: Any) -> RecordedPart:
    made = RecordedPart(ront_um=um, trace=b"# state: free\n", data={}, tolerance_um=5.0, passed=um <= 5.0)
    return replace(made, **changes)


def codes(error: pytest.ExceptionInfo[SessionError]) -> list[str]:
    return [problem.code for problem in error.value.problems]


def test_a_cut_on_the_screens_is_told_in_full(aligned: Floor) -> None:
    folder, job = aligned.context.records, experiment_1()
    aligned.arm(job)
    aligned.do(Start())
    alarm = Problem(code="machine.fault", key="rest", value="tool: amplifier_fault")
    aligned.context.alarm(alarm, Priority.HIGH)
    aligned.station.post(Acknowledge())
    aligned.context.end_alarms("machine.fault")
    aligned.do(Measure())
    (row,) = runs(folder)
    assert (row.job, row.simulated, row.operator, row.stage, row.compensation) == (
        job.name,
        True,
        USER,
        "full",
        "none",
    )
    assert (row.ended.how, row.passed, row.tolerance_um, row.damaged) == (RunOutcome.DONE, True, 5.0, False)
    assert row.ended.turn == pytest.approx(job.cut_length_mm / job.feed_mm_per_rev)
    assert row.diameter_mm == pytest.approx(2.0 * job.finished_radius_mm, abs=0.02)
    told = story(folder, row.run_id[:6])
    assert told.row == row and told.complete and told.damaged == ()
    machine = aligned.context.loaded_machine
    assert told.machine_text == machine.path.read_text(encoding="utf-8") and told.machine_sha256 == machine.sha256
    assert told.job_text is not None and f"cut_length_mm = {job.cut_length_mm}" in told.job_text
    assert told.controller == aligned.state.controller and told.family == machine.machine.controller.family
    assert "OPEN PROG" in told.program and told.software.startswith("trilobe ")
    assert told.setup["force_n"] == job.chucking_force_n and told.setup["jaw_1_at"] == "21 Nov 10:00"
    assert abs(told.setup["zero_radius_mm"] - machine.machine.tool.home_radius_mm) < 1.0
    assert [each.data["command"] for each in told.commands] == ["Arm", "Start", "Acknowledge", "Measure"]
    assert {each.data["by"] for each in told.commands} == {USER}
    (stood,) = told.alarms
    assert stood.problem == alarm and stood.priority == "high"
    assert stood.acknowledged is not None and stood.ended is not None and stood.raised <= stood.acknowledged
    check_telemetry(aligned, told.telemetry[0])
    (measured,) = told.parts
    assert measured.trace is not None
    trace = parse_trace(measured.trace)
    again = roundness_of(trace)
    assert again.ront_um == measured.ront_um == row.ront_um  # to the last bit
    assert [h["amplitude_um"] for h in measured.data["harmonics"]] == [h.amplitude_um for h in again.harmonics]
    assert trace.meta["strategy"] == "pvt" and trace.meta["simulated"] == "yes"
    assert run_of_trace(folder, hashlib.sha256(measured.trace).hexdigest()) == row.run_id
    check_append_only(folder)


def check_telemetry(floor: Floor, telemetry: Any) -> None:
    """A row for each poll, some 0.1 s apart on this lathe, of the cut as planned: speed, phase, feed, length."""
    job, cut = experiment_1(), floor.state.cut
    at_s, turn = telemetry.column("time_s"), telemetry.column("turn")
    assert at_s[0] == 0.0 and 0.0 < np.diff(at_s).min() and np.diff(at_s).max() < 0.13
    z_mm = telemetry.column("z_mm")
    inside = (z_mm > 0.3) & (z_mm < job.cut_length_mm - 0.3)
    assert inside.sum() >= 8 and z_mm.max() >= job.cut_length_mm - 0.05
    # Z advances by the feed of the job in each turn.
    assert np.polyfit(turn[inside], z_mm[inside], 1)[0] == pytest.approx(job.feed_mm_per_rev, rel=0.01)
    assert telemetry.column("speed_rpm")[inside] == pytest.approx(job.spindle_speed_rpm, rel=0.01)
    assert cut is not None and cut.figures is not None
    assert abs(telemetry.column("tool_error_um")[inside]).max() <= cut.figures.tool_error_um + 1e-3
    assert np.nanmax(abs(telemetry.column("phase_error_deg")[inside])) < 0.5
    assert abs(telemetry.column("following_error_um")[inside]).max() <= cut.figures.following_error_um + 1e-3


def check_append_only(folder: Path) -> None:
    with closing(sqlite3.connect(folder / FILE_NAME)) as database:
        for table in ("runs", "events", "texts", "measurements", "traces", "telemetry"):
            assert database.execute(f"SELECT count(*) FROM {table}").fetchone()[0]
            for change in (f"UPDATE {table} SET rowid = rowid + 1000", f"DELETE FROM {table}"):
                with pytest.raises(sqlite3.IntegrityError, match="append only"):
                    database.execute(change)


@pytest.mark.long
def test_a_cut_that_the_operator_ends_and_one_that_is_stopped_say_so(aligned: Floor) -> None:
    for end in ("hold", "space"):
        aligned.arm(experiment_1())
        act = (lambda: aligned.stop.stop("space")) if end == "space" else (lambda: aligned.station.post(EndCut()))
        aligned.when(lambda _: aligned.state.cut is not None and aligned.state.cut.turn > 5.0, act)  # type: ignore[arg-type]
        aligned.do(Start())
        aligned.looks.clear()
    aligned.context.end_record()
    stopped, held = runs(aligned.context.records)
    assert (held.ended.how, stopped.ended.how, stopped.ended.reason) == (
        RunOutcome.HELD,
        RunOutcome.STOPPED,
        "space",
    )
    assert stopped.ended.by == USER and held.failed and stopped.failed
    assert held.ended.turn is not None and held.ended.turn > 5.0
    assert stopped.ended.turn is not None and 5.0 < stopped.ended.turn < 8.0
    assert "EndCut" in [each.data["command"] for each in story(aligned.context.records, held.run_id).commands]


@pytest.mark.long
def test_an_accepted_learning_step_joins_the_run_of_its_part(aligned: Floor) -> None:
    loaded, folder = load_job("lee-2001-experiment-1"), aligned.context.records
    short = replace(loaded, job=replace(loaded.job, cut_length_mm=1.5))
    aligned.arm(short.job, loaded=short)
    aligned.do(Start())
    measured = aligned.do(Measure()).measured
    assert measured is not None and measured.learning is not None and measured.run_id is not None
    proposed = story(folder, measured.run_id).parts[0].data["learning"]
    assert proposed["version"] == 1 and proposed["strategy"] == "pvt"
    kept = accept(measured.learning, folder)
    assert record_accepted(folder, measured.run_id, kept) == ()
    (event,) = story(folder, measured.run_id).accepted_steps
    assert (event.kind, event.data["version"], event.data["by"]) == (ACCEPTED, 1, USER)


def test_telemetry_that_cannot_be_written_ends_no_cut_and_is_told_once(
    aligned: Floor, monkeypatch: MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    aligned.arm(experiment_1())
    monkeypatch.setattr(RunLog, "_write", full)
    state = aligned.do(Start())
    assert state.cut_done and state.stop is None
    aligned.do(Measure())
    assert [alarm.problem.code for alarm in aligned.state.alarms] == ["record.incomplete"]
    (row,) = runs(aligned.context.records)
    told = story(aligned.context.records, row.run_id)
    assert (row.ended.how, row.passed, told.complete) == (RunOutcome.DONE, True, False)


def test_a_cut_does_not_wait_for_a_disk_that_takes_its_time(aligned: Floor, monkeypatch: MonkeyPatch) -> None:
    begun, free, write = threading.Event(), threading.Event(), RunLog._write

    def slow(*given: Any) -> None:
        begun.set()
        assert free.wait(30.0)
        write(*given)

    monkeypatch.setattr(RunLog, "_write", slow)
    aligned.arm(experiment_1())
    assert begun.wait(30.0)  # that of the command itself hangs in the disk from here on
    assert aligned.do(Start()).cut_done and not free.is_set()
    free.set()
    aligned.do(Measure())
    (row,) = runs(aligned.context.records)
    assert story(aligned.context.records, row.run_id).complete and aligned.state.alarms == ()


def test_an_alarm_that_was_over_before_the_run_is_not_in_its_record(aligned: Floor) -> None:
    context = aligned.context
    for code in ("cut.out_of_phase", "record.incomplete"):
        context.alarm(Problem(code=code))
    context.end_alarms("cut.out_of_phase")
    aligned.arm(experiment_1())
    context.change_alarms(acknowledge_alarms)
    context.end_record()
    (row,) = runs(context.records)
    assert [alarm.problem.code for alarm in story(context.records, row.run_id).alarms] == ["record.incomplete"]


def test_without_free_space_nothing_is_armed(aligned: Floor, monkeypatch: MonkeyPatch) -> None:
    monkeypatch.setattr(records, "LEAST_FREE_BYTES", 10**18)
    state = aligned.arm(experiment_1())
    assert state.armed is None and [problem.code for problem in state.refusals] == ["record.no_space"]
    assert runs(aligned.context.records) == ()
    aligned.do(DisableDrives())


def test_pages_follow_each_other_and_every_filter_holds(tmp_path: Path) -> None:
    jobs = ["ring", "bar", "cup"]
    for number in range(60):
        job, um = jobs[number % 3], 9.0 if number % 10 == 0 else 1.0
        record(tmp_path, um, job=job, machine=f"lathe {number % 2}", simulated=number % 4 // 2)
    stopped = record(tmp_path)  # begun, with no end yet
    every = runs(tmp_path, limit=100)
    assert len(every) == 61 and every[0].run_id == stopped
    pages: list[RunRow] = []
    before: str | None = None
    while page := runs(tmp_path, before=before, limit=7):
        pages += page
        before = page[-1].run_id
    assert tuple(pages) == every

    def kept(**filters: Any) -> list[str]:
        return [row.run_id for row in runs(tmp_path, RunFilters(**filters), limit=100)]

    for column in ("job", "machine", "simulated"):
        for value in {getattr(row, column) for row in every}:
            assert kept(**{column: value}) == [r.run_id for r in every if getattr(r, column) == value] != []
    assert kept(failed=True) == [row.run_id for row in every if row.failed] and len(kept(failed=True)) == 6
    middle = every[30].started
    assert kept(since=middle) == [row.run_id for row in every if row.started >= middle]
    assert kept(until=middle) == [row.run_id for row in every if row.started < middle]
    assert kept(since=datetime.now(UTC) + timedelta(days=1)) == []
    points = measured_parts(tmp_path, "ring", "lathe 0", simulated=False)
    assert [point.run_id for point in points] == kept(job="ring", machine="lathe 0", simulated=False)[::-1] != []


def test_a_part_that_was_measured_again_counts_once_by_its_last_trace(tmp_path: Path) -> None:
    run_id = record(tmp_path, 9.0)
    add_to_run(tmp_path, run_id, "measured", {}, part(4.0))
    assert [(row.ront_um, row.failed) for row in runs(tmp_path)] == [(4.0, False)]
    assert runs(tmp_path, RunFilters(failed=True)) == ()
    assert [point.ront_um for point in measured_parts(tmp_path, "ring", "lathe", simulated=True)] == [4.0]
    assert [each.ront_um for each in story(tmp_path, run_id).parts] == [9.0, 4.0]


def test_a_run_is_named_by_the_beginning_of_its_id(tmp_path: Path) -> None:
    ids = [record(tmp_path) for _ in range(17)]
    assert story(tmp_path, ids[3].upper()).row.run_id == ids[3]
    common = next(x[0] for x in ids if sum(y[0] == x[0] for y in ids) > 1)  # 17 ids, 16 digits
    for prefix, code in ((common, "record.ambiguous_run"), ("xyz", "record.no_run"), ("", "record.no_run")):
        with pytest.raises(SessionError) as refused:
            story(tmp_path, prefix)
        assert codes(refused) == [code]


def test_without_a_record_there_are_no_runs_and_nothing_is_made(tmp_path: Path) -> None:
    assert runs(tmp_path / "new") == () == measured_parts(tmp_path / "new", "ring", "lathe", simulated=True)
    assert not (tmp_path / "new").exists()


def execute(folder: Path, line: str, keys: tuple[object, ...]) -> None:
    with closing(sqlite3.connect(folder / FILE_NAME, isolation_level=None)) as database:
        database.execute(line, keys)


def page_of(path: Path, table: str) -> tuple[int, int]:
    """The first page of a table, and the size of pages."""
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        (root,) = database.execute("SELECT rootpage FROM sqlite_schema WHERE name = ?", (table,)).fetchone()
        return root, database.execute("PRAGMA page_size").fetchone()[0]


@pytest.mark.parametrize("table", ["events", "events_by_kind", "measurements", "telemetry", "traces", "texts"])
def test_a_damaged_page_never_breaks_the_list(tmp_path: Path, table: str) -> None:
    run_id = record(tmp_path, 1.0, job_text_sha256="name = 'ring'")
    execute(tmp_path, "INSERT INTO telemetry VALUES (?, 1, '', 'poll', '', zeroblob(28))", (run_id,))
    path = tmp_path / FILE_NAME
    root, size = page_of(path, table)
    with open(path, "r+b") as file:
        file.seek((root - 1) * size)
        file.write(bytes(range(256)) * (size // 256))
    (row,) = runs(tmp_path)
    assert row.run_id == run_id and row.damaged == (table in ("events", "events_by_kind", "measurements"))
    told = story(tmp_path, run_id)
    assert told.row == row and (told.damaged or row.damaged)


def test_data_that_is_no_data_is_passed_over(tmp_path: Path) -> None:
    record(tmp_path, 1.0)
    run = RunRecord(tmp_path, {**RUN, "setup": "{"})
    run.close()
    execute(tmp_path, "INSERT INTO events VALUES (?, 1, 'yesterday', 'cut', '[')", (run.run_id,))
    execute(tmp_path, "INSERT INTO telemetry VALUES (?, 1, '', 'poll', '', x'010203')", (run.run_id,))
    columns = "run_id, number, at_utc, part, product, ront_um, data"
    execute(tmp_path, f"INSERT INTO measurements ({columns}) VALUES (?, 1, '', '', 1, 2.0, '[')", (run.run_id,))
    execute(tmp_path, "INSERT INTO traces VALUES (?, 1, x'010203')", (run.run_id,))
    assert [row.ended.how for row in runs(tmp_path)] == [RunOutcome.DONE, RunOutcome.DONE]
    told = story(tmp_path, run.run_id)
    assert (told.setup, told.telemetry, told.damaged) == ({}, (), ("trace 1", "telemetry"))


def test_whoever_reads_neither_waits_for_a_writer_nor_keeps_one_waiting(tmp_path: Path) -> None:
    run = RunRecord(tmp_path, RUN)
    with closing(sqlite3.connect(tmp_path / FILE_NAME, isolation_level=None)) as writer:
        writer.execute("BEGIN IMMEDIATE")
        assert len(runs(tmp_path)) == 1
        writer.execute("ROLLBACK")
    uri = f"{(tmp_path / FILE_NAME).as_uri()}?mode=ro"
    with closing(sqlite3.connect(uri, uri=True, isolation_level=None)) as reader:
        reader.execute("BEGIN")
        reader.execute("SELECT * FROM runs").fetchall()
        run.add("step", {})
    run.close()


@contextmanager
def small_disk(folder: Path, size: str) -> Iterator[None]:
    """A file system of its own, of that size."""
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    if os.geteuid() or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("only root can make a small file system, and not in every container")
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def test_a_disk_that_gets_full_is_told_and_what_was_recorded_stays(
    tmp_path: Path, monkeypatch: MonkeyPatch
) -> None:
    folder = tmp_path / "disk"
    with small_disk(folder, "2m"):
        with pytest.raises(SessionError) as refused:
            records.refuse_full(folder)
        assert codes(refused) == ["record.no_space"]
        run = RunRecord(folder, RUN)
        run.add("started", {})
        run.log.event("command", {"command": "Start"})
        other = os.open(folder / "other", os.O_WRONLY | os.O_CREAT)
        with suppress(OSError):
            while os.write(other, bytes(4096)):
                pass
        os.close(other)
        with pytest.raises(SessionError) as lost:
            for number in range(10_000):
                run.add("step", {"number": number, "detail": "x" * 1000})
        assert codes(lost) == ["record.lost"]
        with pytest.raises(SessionError):
            run.add("stopped", {"reason": "record.lost"})
        run.close()
        assert run.log.problem is None
        os.unlink(folder / "other")
        RunRecord(folder, RUN).close()
        kinds = [event.kind for event in story(folder, run.run_id).events]
        assert kinds[0] == "started" and kinds[-1] == "stopped" and "command" in kinds
        subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True)
        assert len(runs(folder)) == 2
        with pytest.raises(SessionError) as unwritable:
            RunRecord(folder, RUN)
        assert codes(unwritable) == ["record.unwritable"]


def test_a_folder_in_the_place_of_the_record_is_no_empty_record(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).mkdir()
    with pytest.raises(SessionError) as caught:
        runs(tmp_path, RunFilters())
    assert [each.code for each in caught.value.problems] == ["record.not_readable"]


def test_the_queries_of_the_document_work(tmp_path: Path) -> None:
    open_records(tmp_path, time.monotonic() + 5.0).close()
    document = (Path(__file__).parents[2] / "docs" / "records.md").read_text(encoding="utf-8")
    queries = re.findall(r"^```sql\n(.*?)^```", document, re.MULTILINE | re.DOTALL)
    assert len(queries) == 4
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as database:
        for query in queries:
            assert database.execute(query).fetchall() == []


def run(folder: Path, *measured: dict[str, object], simulated: bool = True) -> None:
    record = RunRecord(
        folder,
        {
            "software": "test",
            "job": "",
            "job_sha256": "",
            "machine": "",
            "machine_sha256": "",
            "simulated": int(simulated),
            "strategy": "pvt",
            "program": "",
        },
    )
    record.add("started", {"job": "ring", "ront_um": 99.0})
    for data in measured:
        record.add("measured", data)
    record.close()


def test_the_last_measured_part_of_its_kind_is_the_one_that_is_told(tmp_path: Path) -> None:
    run(tmp_path, {"job": "ring", "ront_um": 7.0}, simulated=False)
    run(tmp_path, {"job": "ring", "ront_um": 55.0, "strategy": "none"}, {"job": "bar", "ront_um": 1.5})
    strange: list[dict[str, object]] = [{"job": "ring", "ront_um": value} for value in ("much", "9.9", True)]
    run(tmp_path, {"job": "ring", "ront_um": 2.6, "strategy": "pvt"}, {"job": "ring"}, *strange)
    results = last_results(tmp_path, simulated=True)
    assert sorted(results) == ["bar", "ring"]
    ring = results["ring"]
    assert (ring.ront_um, ring.strategy, ring.parts) == (2.6, "pvt", 2), (
        "what another version wrote is passed over"
    )
    assert ring.measured_at.tzinfo is not None
    assert last_results(tmp_path, simulated=False)["ring"].ront_um == 7.0


def test_without_a_record_or_with_a_broken_one_nothing_is_known_and_nothing_is_made(tmp_path: Path) -> None:
    assert last_results(tmp_path / "new", simulated=True) == {}
    assert not (tmp_path / "new").exists()
    for content in (b"", b"no database" * 500):
        (tmp_path / FILE_NAME).write_bytes(content)
        assert last_results(tmp_path, simulated=True) == {}


def test_a_locked_record_says_nothing(tmp_path: Path) -> None:
    run(tmp_path, {"job": "ring", "ront_um": 2.6})
    writer = sqlite3.connect(tmp_path / FILE_NAME, isolation_level=None)
    writer.execute("PRAGMA journal_mode=DELETE")
    writer.execute("BEGIN EXCLUSIVE")
    assert last_results(tmp_path, simulated=True) == {}
    writer.execute("ROLLBACK")
    assert "ring" in last_results(tmp_path, simulated=True)
    writer.close()
