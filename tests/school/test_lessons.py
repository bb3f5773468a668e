"""Lessons: each can be read and made, in both languages; a broken one says what is wrong; steps come in order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from console.school.training.attempt import Attempt
from console.school.training.lesson import FOLDER, MILESTONES, Lesson, lesson_of, lessons, load_lesson
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
from console.text.catalogue import load
from drivers.cutting.planning import Strategy
from drivers.lathe.snapshot import AxisName
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.problem import ProfileError
from profiles.store import load_job
from tests.compact import compact_machine
from tests.console.floor import Floor, experiment_1, open_floor
from tests.school.test_debrief import JOB, Pupil

Console = Callable[..., Any]

GOOD: dict[str, Any] = {
    "minutes": 5,
    "steps": ["clamped", "homed"],
    "en": {"title": "t", "goal": "g", "hints": ["a", "b"]},
    "ko": {"title": "t", "goal": "g", "hints": ["a", "b"]},
}


def test_every_bundled_lesson_can_be_read_and_its_job_is_there(tmp_path: Path) -> None:
    shelved = lessons(tmp_path)
    assert len(shelved) == len(list(FOLDER.glob("*.toml")))
    for name, lesson in shelved:
        assert isinstance(lesson, Lesson), (name, lesson)
        assert 3.0 <= lesson.minutes <= 15.0
        load_job(lesson.job)
    places = [lesson.place for _, lesson in shelved if isinstance(lesson, Lesson)]
    assert places == sorted(places)


@pytest.mark.parametrize("language", ["en", "ko"])
def test_every_milestone_has_its_words(language: str) -> None:
    text = load(language)
    for name in MILESTONES:
        assert text(f"train_page.step.{name}")


@pytest.mark.parametrize(
    ("change", "code", "key"),
    [
        ({"schema": 2}, "schema.unsupported", "schema"),
        ({"minutes": 0}, "value.out_of_range", "minutes"),
        ({"minuts": 5}, "key.unknown", "minuts"),
        ({"plant": "mine"}, "value.not_choice", "plant"),
        ({"steps": ["clamped", "danced"]}, "value.not_choice", "steps"),
        ({"steps": ["clamped"]}, "lesson.hints", "en.hints"),
        ({"ko": {}}, "key.missing", "ko.title"),
        ({"en": {"title": "t" * 80, "goal": "g", "hints": ["a", "b"]}}, "value.not_text", "en.title"),
        ({"en": "text"}, "key.missing", "en.goal"),
    ],
)
def test_a_lesson_that_cannot_be_is_refused(change: dict[str, Any], code: str, key: str) -> None:
    with pytest.raises(ProfileError) as refused:
        lesson_of({**GOOD, **change}, "mine", "mine.toml")
    assert (code, key) in [(problem.code, problem.key) for problem in refused.value.problems]


def test_an_own_lesson_is_listed_and_goes_before_a_bundled_one(tmp_path: Path) -> None:
    whole = (FOLDER / "first-look.toml").read_text(encoding="utf-8")
    (tmp_path / "first-look.toml").write_text(whole.replace("minutes = 5", "minutes = 7"), encoding="utf-8")
    (tmp_path / "broken.toml").write_text("minutes = 5\n", encoding="utf-8")
    assert load_lesson("first-look", tmp_path).minutes == 7.0
    name, problems = lessons(tmp_path)[-1]
    assert name == "broken" and not isinstance(problems, Lesson)
    with pytest.raises(ProfileError, match=r"lesson.unknown.*first-look"):
        load_lesson("nix", tmp_path)


def made(floor: Floor, attempt: Attempt) -> list[Attempt]:
    """Follow a try by every state of the station."""
    tries = [attempt.see_state(floor.state, floor.sim.now_s())]
    floor.looks.append(lambda _: tries.append(tries[-1].see_state(floor.state, floor.sim.now_s())))
    return tries


def test_steps_are_reached_in_their_order_at_their_times(tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    lesson = load_lesson("first-look", tmp_path)
    tries = made(floor, Attempt(lesson=lesson, began_s=floor.sim.now_s()))
    floor.do(EnableDrives())
    floor.do(Home())
    assert tries[-1].reached == (), "nobody has said that the blank is clamped"
    floor.set_up(experiment_1())
    floor.idle()
    names, times_s = zip(*tries[-1].reached, strict=True)
    assert names == lesson.steps and list(times_s) == sorted(times_s) and tries[-1].done
    assert tries[-1].left_s(floor.sim.now_s()) == lesson.minutes * 60.0 - times_s[-1]


def test_a_stop_and_a_collision_are_counted_once(tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    floor.set_up(experiment_1())
    tries = made(floor, Attempt(lesson=load_lesson("stop-in-mid-cut", tmp_path), began_s=floor.sim.now_s()))
    floor.arm(experiment_1())
    floor.idle()
    floor.when(
        lambda _: floor.state.cut is not None and floor.state.cut.turn > 5.0, lambda: floor.stop.stop("space")
    )
    floor.do(Start())
    for _ in range(3):
        floor.idle()
    last = tries[-1]
    assert (last.stops, [name for name, _ in last.reached]) == (1, ["touched_off", "armed", "stopped_in_cut"])
    view = WorkshopView(jaw_1_past_mark_deg=0.0, tool_gap_mm=None, collisions=("jaws", "too_deep"))
    rammed = last.see_state(replace(floor.state, seen=view), floor.sim.now_s())
    again = rammed.see_state(replace(floor.state, seen=view, at_s=1.0), floor.sim.now_s())
    assert (last.collision_kinds, rammed.collision_kinds, again.collision_kinds) == (
        (),
        ("jaws", "too_deep"),
        ("jaws", "too_deep"),
    )


def test_the_command_lists_lessons_and_shows_one(console: Console) -> None:
    listed = console("lessons")
    assert listed.code == 0 and "jaw-1" in listed.out and "Find jaw 1 by indicator" in listed.out
    whole = console("lessons", "jaw-1", "--lang", "ko")
    assert whole.code == 0 and "인디케이터로 조 1 찾기" in whole.out
    assert console("lessons", "nix").code == 1


@pytest.mark.parametrize("name", ["thin-ring", "paper-experiment-1"])
@pytest.mark.long
def test_a_lesson_of_one_part_comes_to_its_end_by_its_own_job(tmp_path: Path, name: str) -> None:
    lesson = load_lesson(name, tmp_path)
    floor = open_floor(tmp_path, plant=lesson.plant, machine=compact_machine(home_radius_mm=34.0))
    job = replace(load_job(lesson.job).job, cut_length_mm=0.5)
    tries = made(floor, Attempt(lesson=lesson, began_s=floor.sim.now_s()))
    floor.set_up(job)
    armed = floor.arm(job, Strategy.PAPER if name == "paper-experiment-1" else Strategy.PVT)
    assert armed.armed is not None, armed.refusals
    floor.idle()
    floor.do(Start())
    floor.do(Measure())
    floor.idle()
    assert [step for step, _ in tries[-1].reached] == list(lesson.steps)


# Lessons with a fault: they can be made to their end by what their hints say.


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
