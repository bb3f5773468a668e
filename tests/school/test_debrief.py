"""Events, score and debrief of lessons: what a trainee did, what it cost, and what is kept of it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from console.school.schooling import follow_attempt
from console.school.training.attempt import Attempt
from console.school.training.debrief import Debrief, debrief_of
from console.school.training.happenings import HappeningKind
from console.school.training.lesson import Item, Lesson, lesson_of
from console.school.training.tries import Try, check_trainee, files_of, keep_try, told_again, tries, try_of
from console.session.station.commands import (
    Acknowledge,
    Approach,
    AskTruth,
    ConfirmClamping,
    EnableDrives,
    Home,
    InjectFault,
    Jog,
    Measure,
    Recover,
    Start,
    TakeJaw,
    TakeTouchOff,
)
from drivers.lathe.snapshot import AxisName
from profiles.problem import ProfileError
from tests.console.floor import Floor, experiment_1, open_floor

Console = Callable[..., Any]

WORDS = {"title": "t", "goal": "g", "hints": ["a", "b", "c"]}
PART: dict[str, Any] = {
    "minutes": 5,
    "plant": "easy",
    "steps": ["touched_off", "full_cut", "measured"],
    "en": WORDS,
    "ko": WORDS,
}
JOB = replace(experiment_1(), roundness_tolerance_um=4.0)


def part_lesson(**more: Any) -> Lesson:
    return lesson_of({**PART, **more}, "part", "part.toml")


@dataclass
class Control:
    """A floor as a page controls it."""

    floor: Floor

    @property
    def state(self) -> Any:
        return self.floor.state

    def now_s(self) -> float:
        return self.floor.sim.now_s()

    def post(self, intent: Any) -> bool:
        return self.floor.station.post(intent)


class Pupil:
    """A try that is followed at every look of the station."""

    def __init__(self, floor: Floor, lesson: Lesson, seed: int = 1) -> None:
        self.floor, control = floor, Control(floor)
        self.tried = Attempt(lesson=lesson, began_s=floor.sim.now_s(), seed=seed)

        def look(_: object) -> None:
            self.tried = follow_attempt(self.tried, control)  # type: ignore[arg-type]

        self.look = look
        look(None)
        floor.looks.append(look)

    def aligns(self, off_deg: float = 0.0, off_mm: float = 0.0) -> None:
        """Set up as the chuck shows it, but so far off: jaw 1, and the tip (positive: short of the part)."""
        floor = self.floor
        floor.do(ConfirmClamping(job=JOB))
        floor.do(EnableDrives())
        floor.do(Home())
        for _ in range(2):
            seen = floor.idle().seen
            assert seen is not None
            floor.do(Jog(axis=AxisName.SPINDLE, distance=off_deg - seen.jaw_1_past_mark_deg))
        floor.do(TakeJaw())
        floor.do(Approach(job=JOB))
        floor.touch(off_mm)
        floor.do(TakeTouchOff(radius_mm=JOB.radius_mm))

    def cuts(self) -> None:
        """Arm, cut, measure."""
        armed = self.floor.arm(JOB)
        assert armed.armed is not None, armed.refusals
        self.floor.idle()
        self.floor.do(Start())
        self.floor.do(Measure())
        self.floor.idle()

    def debriefed(self) -> Debrief:
        self.look(None)
        if self.floor.state.stop is not None:
            self.floor.do(Recover())
        self.tried = self.tried.end_attempt(self.floor.sim.now_s())
        truth = self.floor.do(AskTruth()).truth
        assert truth is not None
        return debrief_of(self.tried, truth, self.floor.sim.now_s())


def marks_of(debrief: Debrief) -> dict[Item, float]:
    return {mark.item: mark.lost for mark in debrief.marks}


# Three trainees -------------------------------------------------------------------------------------------------


def robot(data: Path, seed: int) -> Debrief:
    """Sets up by what it sees, cuts, measures."""
    pupil = Pupil(open_floor(data, seed, plant="easy"), part_lesson())
    pupil.aligns()
    pupil.cuts()
    return pupil.debriefed()


def careless(data: Path, seed: int) -> Debrief:
    """Takes jaw 1 by a glance, the tip by guess; stops for no reason; looks at no alarm."""
    pupil = Pupil(open_floor(data, seed, plant="easy"), part_lesson())
    pupil.aligns(off_deg=12.0, off_mm=0.15)
    for _ in range(2):
        pupil.floor.stop.stop("space")
        pupil.floor.idle()
        pupil.floor.do(Recover())
    pupil.floor.idle(400.0)
    pupil.cuts()
    return pupil.debriefed()


def lucky(data: Path, seed: int) -> Debrief:
    """Knows the angle of jaw 1 on one lathe by heart, and turns to it on any other."""
    known = open_floor(data / "known", 1, plant="easy").sim.truth().jaw_1_deg
    floor = open_floor(data, seed, plant="easy")
    pupil = Pupil(floor, part_lesson())
    pupil.aligns(off_deg=(known - floor.sim.truth().jaw_1_deg + 180.0) % 360.0 - 180.0)
    pupil.cuts()
    return pupil.debriefed()


@pytest.mark.long
@pytest.mark.timeout(180)
def test_a_perfect_trainee_scores_near_100_a_careless_one_below_50_a_lucky_one_only_once(tmp_path: Path) -> None:
    scores = {
        who.__name__: [who(tmp_path / who.__name__ / str(seed), seed).score for seed in (1, 2)]
        for who in (robot, careless, lucky)
    }
    assert min(scores["robot"]) >= 95, scores
    assert max(scores["careless"]) < 50, scores
    assert scores["lucky"][0] >= 95 and scores["lucky"][1] < 80, scores


def test_the_debrief_says_what_the_alignment_was_off_by_and_what_that_leaves(tmp_path: Path) -> None:
    pupil = Pupil(open_floor(tmp_path, plant="easy"), part_lesson())
    pupil.aligns(off_deg=2.0, off_mm=0.05)
    pupil.cuts()
    marks = {mark.item: mark for mark in pupil.debriefed().marks}
    # The jog goes by whole counts, and what is seen of the jaw is rounded to a hundredth.
    assert marks[Item.JAW].value == pytest.approx(2.0, abs=0.05)
    # The blank runs out and is oval: the tool touches one place of it.
    assert marks[Item.TOUCH_OFF].value == pytest.approx(50.0, abs=12.0)
    # A lobe of 55 um, cancelled by one turned 2 degrees: 2 * 55 * sin(3 degrees) is left.
    assert marks[Item.JAW].cost_um == pytest.approx(5.76, abs=0.15)


# Events ---------------------------------------------------------------------------------------------------------


def test_a_fault_comes_after_its_step_and_what_was_done_about_it_counts(tmp_path: Path) -> None:
    event = [{"after": "touched_off", "wait_s": 2.0, "fault": "amplifier-fault motor=tool for=1"}]
    pupil = Pupil(open_floor(tmp_path), part_lesson(event=event))
    pupil.aligns()
    pupil.floor.idle(1.0)
    assert not pupil.tried.given
    for _ in range(6):
        pupil.floor.idle(0.5)
    assert pupil.tried.given == {0}
    assert pupil.floor.state.alarms, "the fault is at the machine"
    pupil.floor.idle(5.0)
    pupil.floor.station.post(Acknowledge(shown=tuple(alarm.problem for alarm in pupil.floor.state.alarms)))
    pupil.floor.idle()
    kinds = [each.what for each in pupil.tried.happened]
    assert kinds.index(HappeningKind.FAULT) < kinds.index(HappeningKind.ALARM) < kinds.index(HappeningKind.SEEN)
    reaction = next(mark for mark in pupil.debriefed().marks if mark.item is Item.REACTION)
    assert 4.0 < reaction.value < 12.0


@pytest.mark.parametrize(
    ("event", "code", "key"),
    [
        ({"fault": "lightning"}, "lesson.fault", "event 1: fault fault"),
        ({"fault": "hang for=-1"}, "lesson.fault", "event 1: fault for"),
        ({"fault": "hang colour=red"}, "lesson.fault", "event 1: fault parameter"),
        ({"fault": ""}, "lesson.event", "event 1: fault"),
        ({"fault": "hang", "console": "kim@office"}, "lesson.event", "event 1: fault"),
        ({"fault": "hang", "after": "danced"}, "value.not_choice", "event 1: after"),
        ({"fault": "hang", "wait_s": -1.0}, "value.out_of_range", "event 1: wait_s"),
        ("hang", None, None),
    ],
)
def test_an_event_that_cannot_be_is_refused(event: Any, code: str | None, key: str | None) -> None:
    if code is None:
        assert part_lesson(event=event).events[0].fault == "hang"
        return
    with pytest.raises(ProfileError) as refused:
        part_lesson(event=[event])
    found = [(problem.code, problem.key) for problem in refused.value.problems]
    assert [each for each in found if each[1] == key] and found[0][0] in (code, "value.blank"), found


def test_a_fault_that_cannot_be_is_an_alarm_and_nothing_else(tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    assert floor.station.post(InjectFault(line="inject lightning"))
    floor.idle()
    assert [alarm.problem.code for alarm in floor.state.alarms] == ["simulator.fault"]


def test_a_real_lathe_gets_no_fault(tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    floor.context.shop = None
    assert not floor.station.post(InjectFault(line="inject hang"))
    assert [problem.code for problem in floor.state.refusals] == ["session.not_simulated"]


def test_what_comes_after_the_end_does_not_count(tmp_path: Path) -> None:
    pupil = Pupil(open_floor(tmp_path), part_lesson(event=[{"fault": "hang for=1", "wait_s": 60}]))
    pupil.debriefed()
    pupil.floor.idle(70.0)
    pupil.aligns()
    assert pupil.tried.reached == () and not pupil.tried.given


# What is kept ---------------------------------------------------------------------------------------------------


def kept_try(data: Path, trainee: str, score: int) -> Path:
    attempt = Attempt(lesson=part_lesson(), began_s=0.0, trainee=trainee).end_attempt(60.0)
    return keep_try(data, try_of(attempt, Debrief(score=score, marks=()), 60.0))


def test_tries_are_kept_by_trainee_and_read_back(tmp_path: Path) -> None:
    for trainee, score in (("Kim", 54), ("Kim", 71), ("../Lee", 88), ("", 40)):
        kept_try(tmp_path, trainee, score)
    assert [each.score for each in tries(tmp_path, "Kim", "part")] == [54, 71]
    assert [each.score for each in tries(tmp_path, "../Lee")] == [88]
    assert len(tries(tmp_path)) == 4 and len(files_of(tmp_path, lesson="other")) == 0
    assert all(file.resolve().is_relative_to(tmp_path.resolve()) for file in files_of(tmp_path))


@pytest.mark.parametrize("name", ["a" * 41, "tab\t", " blank", "line\n"])
def test_a_name_that_no_list_can_show_is_refused(name: str) -> None:
    with pytest.raises(ProfileError, match=r"training.trainee"):
        check_trainee(name)


@pytest.mark.parametrize("content", ["", "{", "[]", '{"schema": 1}', '{"schema": 2}'])
def test_a_damaged_try_is_told_with_its_file(tmp_path: Path, content: str) -> None:
    path = kept_try(tmp_path, "Kim", 54)
    path.write_text(content, encoding="utf-8")
    with pytest.raises(ProfileError, match=path.name):
        tries(tmp_path)


def test_tries_are_listed_exported_and_deleted_by_the_command(tmp_path: Path, console: Console) -> None:
    data = tmp_path / "data"
    for trainee, score in (("Kim", 54), ("Lee", 88)):
        kept_try(data, trainee, score)
    listed = console("tries", "--data", str(data))
    assert listed.code == 0 and "Kim" in listed.out and "88" in listed.out
    exported = console("tries", "--export", str(tmp_path / "t.csv"), "--trainee", "Kim", "--data", str(data))
    assert exported.code == 0
    lines = (tmp_path / "t.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 2 and ",Kim,part,54," in lines[1]
    assert console("tries", "--export", str(tmp_path / "t.csv"), "--data", str(data)).code != 0, "not overwritten"
    assert console("tries", "--delete", "--data", str(data)).code != 0 and len(tries(data)) == 2, "whose?"
    assert console("tries", "--delete", "--trainee", "Kim", "--data", str(data)).code == 0
    assert [each.trainee for each in tries(data)] == ["Lee"]


def test_a_try_has_its_lathe_and_every_happening(tmp_path: Path) -> None:
    pupil = Pupil(open_floor(tmp_path), part_lesson())
    pupil.aligns()
    debrief = pupil.debriefed()
    one = try_of(pupil.tried, debrief, pupil.floor.sim.now_s())
    keep_try(tmp_path, one)
    (back,) = tries(tmp_path)
    assert isinstance(back, Try) and (back.seed, back.plant, back.lesson) == (1, "easy", "part")
    assert [each["word"] for each in back.happened if each["what"] == "step"] == ["touched_off"]


def test_the_debrief_of_a_try_is_read_again(tmp_path: Path, console: Console) -> None:
    pupil = Pupil(open_floor(tmp_path / "floor"), part_lesson())
    pupil.aligns(off_deg=2.0)
    debrief = pupil.debriefed()
    keep_try(tmp_path, try_of(pupil.tried, debrief, pupil.floor.sim.now_s()))
    (one,) = tries(tmp_path)
    assert told_again(one) == (debrief, pupil.tried.happened)
    for language, words in (("en", ("jaw 1 off by", "step made: touch off", "-8")), ("ko", ("조 1 오차",))):
        shown = console("tries", "part", "--show", "--data", str(tmp_path), "--lang", language)
        assert shown.code == 0 and all(word in shown.out for word in words), shown.out


@pytest.mark.parametrize("marks", [[{"item": "luck", "value": 1, "limit": 1, "lost": 0}], [{"item": "jaw"}]])
def test_a_try_whose_marks_are_damaged_is_told(marks: Any, tmp_path: Path, console: Console) -> None:
    path = kept_try(tmp_path, "Kim", 54)
    path.write_text(json.dumps({**json.loads(path.read_text(encoding="utf-8")), "marks": marks}), encoding="utf-8")
    shown = console("tries", "part", "--show", "--data", str(tmp_path))
    assert shown.code == 1 and "Traceback" not in shown.out + shown.err
