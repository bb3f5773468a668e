"""Lessons with a question, with a lathe that was drawn, with another console, and with another force."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.school.training.lesson import FOLDER, Item, Lesson, lesson_of, load_lesson
from console.school.training.tries import try_of
from console.session.station.commands import Acknowledge, DisableDrives, Jog, Measure, Start, TakeControl, TakeJaw
from drivers.cutting.planning import Strategy
from drivers.lathe.console_role import ConsoleRole
from drivers.lathe.snapshot import AxisName
from profiles.problem import ProfileError
from profiles.store import load_job
from tests.compact import compact_machine
from tests.console.floor import open_floor
from tests.school.test_debrief import Pupil, marks_of
from tests.school.test_lessons import homes, waits

WORDS: dict[str, Any] = {"title": "t", "goal": "g", "hints": ["a"], "question": "q", "answers": ["x", "y", "z"]}
ASKING: dict[str, Any] = {"minutes": 5, "steps": ["answered"], "answer": 2, "en": WORDS, "ko": WORDS}


def plot_lesson() -> Lesson:
    return load_lesson("read-a-plot", Path("/nonexistent"))


def pupil_at(data: Path, name: str, seed: int = 1) -> Pupil:
    lesson = load_lesson(name, data)
    floor = open_floor(data, seed, plant=lesson.plant_of(seed), owned=name == "second-console")
    return Pupil(floor, lesson, seed)


@pytest.mark.parametrize(
    ("change", "code", "key"),
    [
        ({"steps": ["homed"]}, "lesson.no_question", "en.question"),
        ({"answer": None}, "lesson.right_answer", "answer"),
        ({"answer": 4}, "lesson.answers", "en.answers"),
        ({"answer": 0}, "value.out_of_range", "answer"),
        ({"answer": None, "lathes": ["lathes/overtone", "lathes/jaw-harder"]}, "lesson.answers", "ko.answers"),
        ({"lathes": ["lathes/overtone", "lathes/jaw-harder", "lathes/overtone"]}, "lesson.right_answer", "answer"),
        ({"answer": None, "lathes": ["lathes/nowhere"]}, "file.unreadable", ""),
        ({"en": {**WORDS, "question": ""}}, "key.missing", "en.question"),
        ({"ko": {**WORDS, "answers": ["x"]}}, "lesson.answers", "ko.answers"),
    ],
)
def test_a_question_that_cannot_be_asked_is_refused(change: dict[str, Any], code: str, key: str) -> None:
    table = {name: value for name, value in {**ASKING, **change}.items() if value is not None}
    with pytest.raises(ProfileError) as refused:
        lesson_of(table, "mine", "mine.toml")
    found = [(problem.code, problem.key) for problem in refused.value.problems]
    assert (code, key) in found or (code.startswith("file.") and found[0][0].startswith("file.")), found


def test_an_answer_is_given_once_when_it_is_due_and_counts(tmp_path: Path) -> None:
    for answer, lost in ((1, 0.0), (2, 30.0)):
        pupil = Pupil(open_floor(tmp_path / str(answer)), lesson_of(ASKING, "mine", "mine.toml"))
        assert pupil.tried.asks and pupil.tried.asks_now
        pupil.tried = pupil.tried.answer_question(answer)
        waits(pupil, 1)
        assert pupil.tried.done and not pupil.tried.asks
        assert pupil.tried.answer_question(0).answer == answer, "there is no second try"
        debrief = pupil.debriefed()
        assert marks_of(debrief)[Item.ANSWER] == lost and debrief.score == 100 - lost


def test_a_question_that_is_not_due_is_not_answered(tmp_path: Path) -> None:
    pupil = pupil_at(tmp_path, "read-a-plot")
    assert pupil.tried.asks and pupil.tried.answer_question(1).answer is None


def test_the_seed_draws_each_of_the_lathes_and_the_same_one_again() -> None:
    lesson = plot_lesson()
    drawn = [lesson.right_answer(seed) for seed in range(60)]
    assert set(drawn) == set(range(len(lesson.lathes))) and drawn == [
        lesson.right_answer(seed) for seed in range(60)
    ]
    assert all(Path(lesson.plant_of(seed)).parent == FOLDER / "lathes" for seed in range(5))


@pytest.mark.parametrize(
    ("lathe", "orders", "from_jaw_deg"),
    [
        # A lobe at its place stands on the jaws; a turned one between jaw and gap, 30 degrees from either.
        ("lobe-turned", {3}, 30.0),
        ("lobe-larger", {3}, 0.0),
        ("jaw-harder", {2}, 0.0),
        ("overtone", {6}, 0.0),
        ("spindle-runs-out", {2, 3, 4, 5, 7}, None),
    ],
)
@pytest.mark.long
def test_each_error_of_the_plot_lesson_can_be_read_off_its_plot(
    lathe: str, orders: set[int], from_jaw_deg: float | None, tmp_path: Path
) -> None:
    lesson = plot_lesson()
    place = [Path(each).stem for each in lesson.lathes].index(lathe)
    seed = next(seed for seed in range(99) if lesson.right_answer(seed) == place)
    pupil = pupil_at(tmp_path, "read-a-plot", seed)
    pupil.aligns()
    pupil.cuts()
    measured = pupil.floor.state.measured
    assert measured is not None and pupil.tried.asks_now
    spectrum = 2.0 * np.fft.rfft(measured.trace.deviation_um) / measured.trace.deviation_um.size
    tall = {order for order in range(2, 50) if abs(spectrum[order]) > 1.0}
    assert tall == orders
    if from_jaw_deg is not None:
        (order,) = orders
        high_deg = -np.degrees(np.angle(spectrum[order])) / order - measured.jaw_1_deg
        off_deg = abs((high_deg + 180.0 / order) % (360.0 / order) - 180.0 / order)
        assert off_deg == pytest.approx(from_jaw_deg, abs=8.0 if from_jaw_deg else 1.0)
    pupil.tried = pupil.tried.answer_question(place)
    assert pupil.debriefed().score >= 95
    assert try_of(pupil.tried, pupil.debriefed(), 0.0).plant == lathe


def test_another_console_takes_control_at_rest_and_it_is_taken_back(tmp_path: Path) -> None:
    pupil = pupil_at(tmp_path, "second-console")
    floor = pupil.floor
    homes(pupil)
    waits(pupil, 5)
    assert not pupil.tried.given and floor.state.controls
    waits(pupil, 3)
    observing = floor.state
    assert observing.standing is ConsoleRole.OUSTED and observing.held_by is not None
    assert (observing.held_by.name, observing.held_by.host) == ("park", "office")
    assert not floor.station.post(TakeJaw()), "an observer orders nothing"
    waits(pupil, 4)
    floor.station.post(Acknowledge(shown=tuple(alarm.problem for alarm in floor.state.alarms)))
    floor.idle()
    pupil.tried = pupil.tried.answer_question(1)
    waits(pupil, 1)
    floor.do(TakeControl())
    floor.do(DisableDrives())
    pupil.aligns()
    assert [step for step, _ in pupil.tried.reached] == list(pupil.tried.lesson.steps)
    debrief = pupil.debriefed()
    assert debrief.score >= 95
    reaction = next(mark for mark in debrief.marks if mark.item is Item.REACTION)
    assert 3.0 < reaction.value < 10.0, "that control was lost is no act of the trainee"


def test_another_console_waits_until_nothing_moves(tmp_path: Path) -> None:
    pupil = pupil_at(tmp_path, "second-console")
    homes(pupil)
    waits(pupil, 5)
    given: list[bool] = []
    pupil.floor.looks.append(lambda _: given.append(bool(pupil.tried.given)))
    pupil.floor.do(Jog(axis=AxisName.SPINDLE, distance=360.0))
    homed_s = dict(pupil.tried.reached)["homed"]
    assert pupil.floor.sim.now_s() - pupil.tried.began_s - homed_s > 6.0, "the event is due in the jog"
    assert given and not any(given)
    waits(pupil, 1)
    assert pupil.tried.given and not pupil.floor.state.controls


@pytest.mark.long
def test_a_ring_that_is_clamped_with_less_force_is_rounder(tmp_path: Path) -> None:
    lesson = load_lesson("clamping-force", tmp_path)
    floor = open_floor(tmp_path, plant=lesson.plant, machine=compact_machine(home_radius_mm=34.0))
    pupil = Pupil(floor, lesson)
    job = replace(load_job(lesson.job).job, cut_length_mm=0.5)
    for force_n in (900.0, 300.0):
        # What the form does: the lobe of the model goes with the force.
        lobe_um = job.lobe_error_um_pp * force_n / job.chucking_force_n
        part = replace(job, chucking_force_n=force_n, lobe_error_um_pp=lobe_um)
        floor.set_up(part)
        assert floor.arm(part, Strategy.NONE).armed is not None, floor.state.refusals
        floor.idle()
        floor.do(Start())
        floor.do(Measure())
        floor.idle()
    assert [step for step, _ in pupil.tried.reached] == list(lesson.steps)
