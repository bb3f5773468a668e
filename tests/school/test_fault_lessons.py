"""Lessons with a fault: they can be made to their end by what their hints say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from console.school.training.lesson import load_lesson
from console.session.station.commands import (
    Acknowledge,
    Approach,
    ConfirmClamping,
    EnableDrives,
    Home,
    Jog,
    Measure,
    Recover,
    Retract,
    Start,
    TakeJaw,
    TakeTouchOff,
)
from drivers.cutting.planning import Strategy
from drivers.lathe.snapshot import AxisName
from tests.console.floor import open_floor
from tests.school.test_debrief import JOB, Pupil

LONG = replace(JOB, cut_length_mm=6.0)
Play = Callable[[Pupil], None]


def homes(pupil: Pupil) -> None:
    for order in (ConfirmClamping(job=JOB), EnableDrives(), Home()):
        pupil.floor.do(order)


def waits(pupil: Pupil, seconds: float) -> None:
    for _ in range(int(2 * seconds)):
        pupil.floor.idle(0.5)


def resets(pupil: Pupil) -> None:
    """Acknowledge every alarm, reset."""
    floor = pupil.floor
    floor.station.post(Acknowledge(shown=tuple(alarm.problem for alarm in floor.state.alarms)))
    floor.idle()
    floor.do(Recover())
    floor.idle()


def starts_a_cut(pupil: Pupil, strategy: Strategy = Strategy.PVT) -> None:
    armed = pupil.floor.arm(LONG, strategy)
    assert armed.armed is not None, armed.refusals
    pupil.floor.idle()
    pupil.floor.do(Start())


def an_alarm(pupil: Pupil) -> None:
    homes(pupil)
    waits(pupil, 8)
    resets(pupil)
    waits(pupil, 20)
    pupil.floor.do(EnableDrives())


def a_cut_that_fails(pupil: Pupil) -> None:
    pupil.aligns()
    starts_a_cut(pupil)
    resets(pupil)
    waits(pupil, 12)
    pupil.floor.do(EnableDrives())
    pupil.floor.do(Retract())


def a_jam(pupil: Pupil) -> None:
    homes(pupil)
    floor = pupil.floor
    for _ in range(2):
        seen = floor.idle().seen
        assert seen is not None
        floor.do(Jog(axis=AxisName.SPINDLE, distance=-seen.jaw_1_past_mark_deg))
    floor.do(TakeJaw())
    waits(pupil, 3)
    floor.do(Approach(job=JOB))
    resets(pupil)
    floor.do(EnableDrives())
    floor.idle()
    floor.do(Approach(job=JOB))
    floor.touch()
    floor.do(TakeTouchOff(radius_mm=JOB.radius_mm))


def a_lost_flag(pupil: Pupil) -> None:
    floor = pupil.floor
    floor.do(ConfirmClamping(job=JOB))
    floor.do(EnableDrives())
    floor.idle()
    floor.do(Home())
    assert not floor.state.alignment.homed, "there was a flag after all"
    resets(pupil)
    waits(pupil, 30)
    floor.do(EnableDrives())
    floor.do(Recover())
    floor.do(EnableDrives())
    floor.do(Home())


PLAYS: dict[str, Play] = {
    "alarm-that-matters": an_alarm,
    "drive-fails": a_cut_that_fails,
    "no-answer": a_cut_that_fails,
    "following-error": a_jam,
    "lost-index": a_lost_flag,
}


@pytest.mark.parametrize("name", PLAYS)
@pytest.mark.first(1)
def test_a_lesson_with_a_fault_is_made_by_its_hints_and_costs_nothing(name: str, tmp_path: Path) -> None:
    lesson = load_lesson(name, tmp_path)
    pupil = Pupil(open_floor(tmp_path, plant=lesson.plant), lesson)
    PLAYS[name](pupil)
    pupil.floor.idle()
    assert [step for step, _ in pupil.tried.reached] == list(lesson.steps)
    assert pupil.tried.given == {0}
    assert pupil.debriefed().score >= 95


@pytest.mark.long
def test_who_does_nothing_about_a_fault_makes_no_more_steps(tmp_path: Path) -> None:
    lesson = load_lesson("drive-fails", tmp_path)
    pupil = Pupil(open_floor(tmp_path, plant=lesson.plant), lesson)
    pupil.aligns()
    starts_a_cut(pupil)
    waits(pupil, 60)
    debrief = pupil.debriefed()
    lost = {str(mark.item): mark.lost for mark in debrief.marks}
    assert lost["alarms"] == 5.0 and lost["reaction"] > 0.0 and debrief.score < 60


@pytest.mark.long
def test_a_lobe_is_calibrated_by_a_part_cut_without_compensation(tmp_path: Path) -> None:
    lesson = load_lesson("calibrate-a-lobe", tmp_path)
    floor = open_floor(tmp_path, plant="mounted")
    pupil = Pupil(floor, lesson)
    pupil.aligns()
    starts_a_cut(pupil, Strategy.NONE)
    floor.do(Measure())
    floor.idle()
    assert [step for step, _ in pupil.tried.reached] == ["touched_off", "full_cut", "measured_plain"]
