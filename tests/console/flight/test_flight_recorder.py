"""The last five minutes are there; an alarm and a stop freeze them; a bad disk costs nothing else."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest
from pytest import MonkeyPatch

from console.flight import frozen_recordings, ring
from console.flight.frozen_recordings import frozen_in
from console.flight.notes import WAITING, NoteKind
from console.flight.recorded_control import RecordedControl
from console.session.station.alarms import Priority
from console.session.station.commands import Acknowledge, Home
from console.session.station.state import Activity
from profiles.problem import Problem
from tests.console.flight.bench import BEGAN_S, FlightBench, reasons
from tests.tui.scenes import machine, signed
from tests.tui.stage import FixedControl


def files_in(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def test_the_last_five_minutes_before_an_alarm_and_five_seconds_after_it(tmp_path: Path) -> None:
    bench = FlightBench(tmp_path)
    bench.runs(400.0)
    bench.alarms()
    bench.runs(5.5)
    (recording,) = bench.frozen
    assert reasons(recording) == ["cut.spindle_stands"]
    before_s = BEGAN_S + 400.0 - recording.times_s[0]
    assert 300.0 <= before_s <= 331.0
    assert recording.times_s[-1] - (BEGAN_S + 400.0) == pytest.approx(5.0, abs=0.2)
    newest = recording.moments[-1].state
    assert newest.alarms == bench.state.alarms
    polls = round(10.0 * (recording.times_s[-1] - BEGAN_S))
    assert newest.snapshot is not None and newest.snapshot.tool.position == 243_827.0 + polls


def test_at_rest_once_a_second_in_motion_ten_times_and_what_else_changes_at_once(tmp_path: Path) -> None:
    bench = FlightBench(tmp_path)
    bench.runs(10.0)
    bench.state = replace(bench.state, activity=Activity.HOMING)
    bench.runs(10.0)
    bench.state = replace(bench.state, activity=Activity.READY)
    bench.runs(0.2)
    bench.page = "align"
    bench.runs(0.1)
    bench.alarms()
    bench.runs(6.0)
    (recording,) = bench.frozen
    at_rest = [at_s for at_s in recording.times_s if at_s <= BEGAN_S + 10.0]
    in_motion = [at_s for at_s in recording.times_s if BEGAN_S + 10.05 < at_s <= BEGAN_S + 20.05]
    assert (len(at_rest), len(in_motion)) == (10, 100)
    (turned,) = [
        at_s for at_s, moment in zip(recording.times_s, recording.moments, strict=True) if moment.page == "align"
    ][:1]
    assert turned == pytest.approx(BEGAN_S + 20.3, abs=0.01)


def test_the_ring_is_bounded_in_number_and_in_size(tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
    monkeypatch.setattr(ring, "MOST_BYTES", 20_000)
    bench = FlightBench(tmp_path)
    bench.runs(60.0, lambda: bench.inbox.put(">", b"#1J^%d\r" % bench.now_s * 100))
    files = files_in(tmp_path)
    assert len(files) == ring.SEGMENTS + 1  # and the lock
    assert sum(path.stat().st_size for path in files) < ring.SEGMENTS * (20_000 + 20_000)


def test_alarms_and_stops_within_a_minute_make_one_file_and_the_next_ones_another(tmp_path: Path) -> None:
    bench = FlightBench(tmp_path)
    bench.runs(1.0)
    bench.stops("space")
    bench.runs(8.0)
    assert [reasons(each) for each in bench.frozen] == [["stop space"]]
    bench.alarms()
    bench.runs(30.0)
    assert [reasons(each) for each in bench.frozen] == [["stop space", "cut.spindle_stands"]]
    bench.runs(40.0)
    bench.alarms(Problem(code="link.silent"), Priority.MEDIUM)
    bench.runs(6.0)
    assert [reasons(each) for each in bench.frozen][1:] == [["link.silent"]]


def test_nothing_is_frozen_for_a_low_alarm_nor_for_the_one_that_stands(tmp_path: Path) -> None:
    bench = FlightBench(tmp_path)
    bench.alarms(priority=Priority.LOW)
    bench.runs(10.0)
    assert frozen_in(tmp_path) == []
    bench.alarms(Problem(code="link.silent"))
    bench.runs(100.0, lambda: bench.alarms(Problem(code="link.silent")))
    assert len(frozen_in(tmp_path)) == 1


def test_keys_commands_and_stops_are_noted_and_the_stop_goes_first(tmp_path: Path) -> None:
    bench, order = FlightBench(tmp_path), []
    below = FixedControl(bench.state)
    below.stop = lambda reason: order.append(len(bench.inbox.take_entries()[0]))  # type: ignore[method-assign]
    control = RecordedControl(below, bench.inbox)
    control.stop("space")
    assert order == [0]
    control.post(Home())
    bench.inbox.put(NoteKind.KEY, "f4")
    bench.stops("space")
    bench.runs(6.0)
    notes = [(note.kind, note.text) for note in bench.frozen[0].notes]
    assert notes[:3] == [("stop", "space"), ("command", "Home"), ("key", "f4")]


def test_lines_of_the_link_are_noted_and_polls_counted(tmp_path: Path) -> None:
    bench = FlightBench(tmp_path)

    def polls() -> None:
        bench.inbox.put(">", b"M70=677 #1P F ? #2P F ? #3P F ? &1?? % P1000 P1004\r")
        bench.inbox.put("<", b"12\r3\r840000000400\r\x06")
        bench.inbox.put(">", b"M70=677 P1002\r")
        bench.inbox.put("<", b"7\r\x06")

    bench.runs(10.0, polls)
    bench.inbox.put(">", b"#1J^200\r")
    bench.inbox.put("<", b"\x06")
    bench.inbox.put("!", b"\x01")
    bench.stops("space")
    bench.runs(31.0)
    notes = [note.text for note in bench.frozen[0].notes if note.kind is NoteKind.LINK]
    assert notes == ["> #1J^200", "< [ACK]", "! [^A]"]
    bench.recorder.close("SIGTERM")
    bench.recorder._finish()
    counted = [note.text for note in bench.frozen[-1].notes if note.kind is NoteKind.LEFT_OUT]
    assert sum(int(words.split()[0].removeprefix("polls=")) for words in counted) == 200


def test_what_overruns_the_queue_is_lost_and_counted(tmp_path: Path) -> None:
    bench = FlightBench(tmp_path)
    for _ in range(WAITING + 7):
        bench.inbox.put(NoteKind.KEY, "x")
    bench.stops("space")
    bench.runs(6.0)
    notes = bench.frozen[0].notes
    assert len([note for note in notes if note.kind is NoteKind.KEY]) == WAITING
    assert [note.text for note in notes if note.kind is NoteKind.LOST] == ["7"]


def test_the_newest_files_are_kept_and_what_is_not_ours_stays(tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
    monkeypatch.setattr(frozen_recordings, "MOST_FILES", 3)
    folder = tmp_path / "flight"
    folder.mkdir()
    for name in ("20200101T000000Z-a-b.flight", "20210101T000000Z-a-b.flight", "mine.flight", "notes.txt"):
        (folder / name).write_bytes(b"x")
    bench = FlightBench(tmp_path)
    for _ in range(2):
        bench.runs(1.0)
        bench.stops("space")
        bench.runs(65.0)
    names = sorted(path.name for path in folder.iterdir() if path.is_file())
    assert len(names) == 5
    assert names[0] == "20210101T000000Z-a-b.flight"
    assert names[3:] == ["mine.flight", "notes.txt"]
    monkeypatch.setattr(frozen_recordings, "MOST_BYTES", 1)
    bench.stops("f12")
    bench.runs(6.0)
    (left,) = frozen_in(tmp_path)
    assert "stop-f12" in left.name  # the newest in any case


def test_a_full_disk_is_one_low_alarm_and_recording_resumes(tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
    bench, write = FlightBench(tmp_path, work=signed()), os.write
    bench.runs(5.0)

    def full(descriptor: int, data: bytes) -> int:
        return write(descriptor, data[: len(data) // 2])

    monkeypatch.setattr(os, "write", full)
    bench.runs(25.0)
    (alarm,) = bench.recorder.alarms
    assert (alarm.problem.code, alarm.priority, alarm.count) == ("flight.not_recorded", Priority.LOW, 1)
    monkeypatch.setattr(os, "write", write)
    bench.runs(11.0)
    control = RecordedControl(FixedControl(bench.state), bench.inbox)
    control.recorder = bench.recorder
    control.post(Acknowledge(shown=tuple(each.problem for each in control.state.alarms)))
    assert bench.recorder.alarms == ()
    bench.stops("space")
    bench.runs(6.0)
    (recording,) = bench.frozen
    assert recording.times_s[0] == pytest.approx(BEGAN_S + 0.1)  # what was there before the disk was full
    assert max(b - a for a, b in zip(recording.times_s, recording.times_s[1:], strict=False)) > 20.0


@pytest.mark.parametrize("bad", ["file", "removed"])
def test_a_folder_that_cannot_be_is_one_low_alarm(tmp_path: Path, bad: str) -> None:
    bench = FlightBench(tmp_path / "data")
    if bad == "file":
        (tmp_path / "data").write_text("")
    else:
        bench.runs(3.0)
        for path in files_in(tmp_path / "data"):
            path.unlink()
        bench.recorder._ring.folder.rmdir()  # type: ignore[union-attr]
    bench.runs(35.0)
    codes = [(alarm.problem.code, alarm.priority) for alarm in bench.recorder.alarms]
    assert codes == [("flight.not_recorded", Priority.LOW)]
    (tmp_path / "data").unlink() if bad == "file" else None
    bench.runs(11.0)
    bench.stops("space")
    bench.runs(6.0)
    assert len(bench.frozen) == 1


def test_an_operator_who_leaves_leaves_nothing_and_a_signal_or_a_stop_before_it_freezes(tmp_path: Path) -> None:
    bench = FlightBench(tmp_path)
    bench.runs(2.0)
    bench.recorder.leave()
    bench.stops("quit")
    bench.runs(1.0)
    bench.recorder._finish()
    assert files_in(tmp_path) == []
    other = FlightBench(tmp_path)
    other.runs(2.0)
    other.recorder.close("SIGHUP")
    other.recorder._finish()
    assert reasons(other.frozen[0]) == ["SIGHUP"]
    assert list((tmp_path / "flight" / "running").iterdir()) == []
    stopped = FlightBench(tmp_path / "stopped")
    stopped.stops("space")
    stopped.runs(1.0)
    stopped.recorder.leave()
    stopped.recorder._finish()
    assert reasons(stopped.frozen[0]) == ["stop space"]


def test_a_recorder_that_fails_says_so_and_the_rest_goes_on(tmp_path: Path) -> None:
    bench = FlightBench(tmp_path, state=replace(machine(Activity.READY), machine=object()))  # type: ignore[arg-type]
    bench.recorder.start()
    bench.recorder.close()
    (alarm,) = bench.recorder.alarms
    assert (alarm.problem.code, alarm.priority) == ("flight.not_recorded", Priority.LOW)
