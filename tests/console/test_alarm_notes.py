"""Alarms of the screens in the log of the program: number, what happened, the sentence; nobody waits for them."""

from __future__ import annotations

import threading
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import pytest

from console.session import alarm_notes
from console.session.alarm_notes import AlarmNotes
from console.session.program_log import FILE, FOLDER
from console.session.station.alarms import Priority, cleared, raised
from console.session.station.history.session_log import LogEntry, LogKind
from console.session.station.state import StationState
from console.tui.application.logged_control import LoggedControl
from profiles.problem import Problem
from tests.tui.stage import FixedControl

AT = datetime(2026, 3, 1, 12, 0, 0)
LOST = Problem(code="link.lost", where="tcp:lathe:1", value="the cable is cut")


def entry(kind: LogKind, number: int = 7) -> LogEntry:
    return LogEntry(at=AT, kind=kind, problem=LOST, number=number)


def test_an_alarm_and_its_end_are_in_the_log_of_the_program(tmp_path: Path) -> None:
    notes = AlarmNotes(tmp_path, "lathe 3", simulated=True)
    notes([entry(LogKind.RAISED), entry(LogKind.ACKNOWLEDGED), LogEntry(at=AT, kind=LogKind.STOPPED, word="key")])
    notes([entry(LogKind.ENDED)])
    notes.close()
    raised, ended = (tmp_path / FOLDER / FILE).read_text(encoding="utf-8").splitlines()
    assert " WARNING " in raised and " INFO " in ended
    assert f"alarm 7 raised  SIM lathe 3  {LOST}  [link.lost · tcp:lathe:1" in raised
    assert "alarm 7 ended  SIM lathe 3" in ended


def test_without_an_alarm_there_is_neither_a_log_nor_a_thread(tmp_path: Path) -> None:
    notes = AlarmNotes(tmp_path, "lathe", simulated=False)
    before = threading.active_count()
    notes([LogEntry(at=AT, kind=LogKind.COMMAND, word="Jog")])
    assert threading.active_count() == before
    notes.close()
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_does_not_answer_holds_nobody_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stuck, over = threading.Event(), threading.Event()

    def noted(*_: object, **__: object) -> None:
        stuck.wait(30.0)
        over.set()

    monkeypatch.setattr(alarm_notes, "note", noted)
    monkeypatch.setattr(alarm_notes, "CLOSE_S", 0.05)
    notes = AlarmNotes(tmp_path, "lathe", simulated=False)
    notes([entry(LogKind.RAISED, number) for number in range(1000)])
    notes.close()
    assert not over.is_set(), "it was waited for"
    stuck.set()


def test_the_screens_hand_over_each_alarm_once_when_it_comes_and_when_it_ends() -> None:
    handed: list[LogEntry] = []
    control = FixedControl(StationState())
    logged = LoggedControl(control, lambda: AT, handed.extend)
    quiet = control.state
    standing = raised(quiet.alarms, LOST, Priority.HIGH, 1.0)
    for alarms in (quiet.alarms, standing, standing, cleared(standing, LOST.code), cleared(standing, LOST.code)):
        logged.followed(replace(quiet, alarms=alarms), (), typed=False)
    assert [(each.kind, each.number) for each in handed] == [(LogKind.RAISED, 1), (LogKind.ENDED, 1)]
