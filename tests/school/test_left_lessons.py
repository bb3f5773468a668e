"""A lesson that was left: what stays made, what has to be made again, and what is asked at the next start."""

from __future__ import annotations

import json
from argparse import Namespace
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from console.school.schooling import begin_attempt
from console.school.training.attempt import Attempt
from console.school.training.debrief import unacknowledged_times_s
from console.school.training.happenings import Happening, HappeningKind
from console.school.training.lesson import load_lesson
from console.school.training.tries import left_files, tries
from console.school.training.unfinished_try import (
    UnfinishedTry,
    continue_try,
    forget_left,
    keep_left,
    left_file,
    left_of,
    read_left,
)
from console.text.catalogue import load
from profiles.problem import ProfileError
from tests.console.floor import open_floor
from tests.school.test_debrief import Pupil
from tests.school.test_lessons import a_cut_that_fails, homes

OWN = Path("/nonexistent")


def after(name: str, made: int, **more: Any) -> Attempt:
    """A try of a bundled lesson, so many steps in, one each minute; left a minute after the last."""
    lesson = load_lesson(name, OWN)
    reached = tuple((step, 60.0 * at) for at, step in enumerate(lesson.steps[:made], start=1))
    given = frozenset(n for n, event in enumerate(lesson.events) if event.after in lesson.steps[:made])
    return replace(Attempt(lesson=lesson, began_s=0.0, seed=7, reached=reached, given=given), **more)


@pytest.mark.parametrize(
    ("name", "made", "kept"),
    [
        ("first-look", 2, 2),
        ("jaw-1", 2, 2),
        # A stop, a hold, a retract happen in a cut that is gone.
        ("stop-in-mid-cut", 3, 1),
        ("stop-in-mid-cut", 4, 1),
        ("feed-hold", 3, 1),
        # A part that is cut and not measured is gone, one that was measured is done.
        ("air-half-full", 2, 2),
        ("air-half-full", 3, 2),
        ("air-half-full", 4, 4),
        ("two-parts", 2, 1),
        ("two-parts", 3, 3),
        ("thin-ring", 3, 1),  # the debrief is about the part
        ("read-a-plot", 3, 1),  # and so is the question
        ("clamping-force", 2, 1),
        ("clamping-force", 3, 1),
        # What came by itself comes again, unless it was lived through.
        ("drive-fails", 5, 1),
        ("drive-fails", 6, 1),
        ("following-error", 3, 0),
        ("following-error", 5, 5),
        ("lost-index", 3, 0),
        ("lost-index", 4, 4),
        ("second-console", 5, 0),
        ("second-console", 6, 6),
    ],
)
def test_steps_stay_made_that_a_machine_after_power_up_can_go_on_from(name: str, made: int, kept: int) -> None:
    attempt = after(name, made)
    goes_on = continue_try(left_of(attempt, 60.0 * (made + 1)), attempt.lesson, 1000.0)
    assert (0 if goes_on is None else goes_on.step) == kept
    if goes_on is not None:
        assert goes_on.reached == attempt.reached[:kept] and goes_on.seed == 7
        assert goes_on.took_s(1000.0) == 60.0 * (made + 1) or goes_on.done
        comes_again = {
            n for n, event in enumerate(attempt.lesson.events) if event.after in attempt.lesson.steps[kept:]
        }
        assert not goes_on.given & comes_again


def test_a_kept_try_is_read_back_as_it_was_and_forgotten(tmp_path: Path) -> None:
    met = (Happening(at_s=61.0, what=HappeningKind.MET, word="jaws"),)
    attempt = after("thin-ring", 1, happened=met, answer=2)
    keep_left(tmp_path, attempt, 100.0)
    keep_left(tmp_path, attempt, 120.0)
    left = read_left(tmp_path, "", "thin-ring")
    assert left == left_of(attempt, 120.0)
    assert left is not None
    goes_on = continue_try(left, attempt.lesson, 500.0)
    assert goes_on is not None and goes_on.collision_kinds == ("jaws",), "a collision is not left behind"
    assert tries(tmp_path) == () and len(left_files(tmp_path, "")) == 1
    forget_left(tmp_path, "", "thin-ring")
    forget_left(tmp_path, "", "thin-ring")
    assert read_left(tmp_path, "", "thin-ring") is None


def test_nothing_is_kept_of_a_try_without_a_step_or_after_its_end(tmp_path: Path) -> None:
    keep_left(tmp_path, after("thin-ring", 0), 10.0)
    keep_left(tmp_path, after("thin-ring", 2).end_attempt(100.0), 120.0)
    assert read_left(tmp_path, "", "thin-ring") is None


def test_a_lesson_that_was_changed_begins_anew() -> None:
    left = left_of(after("thin-ring", 1), 100.0)
    assert continue_try(left, replace(load_lesson("thin-ring", OWN), steps=("homed", "measured")), 0.0) is None


@pytest.mark.parametrize("content", ["", "{", '{"schema": 1}', '{"schema": 9}'])
def test_a_damaged_file_is_told(content: str, tmp_path: Path) -> None:
    keep_left(tmp_path, after("thin-ring", 1), 100.0)
    left_file(tmp_path, "", "thin-ring").write_text(content, encoding="utf-8")
    with pytest.raises(ProfileError, match=r"thin-ring"):
        read_left(tmp_path, "", "thin-ring")


def test_an_alarm_ends_with_the_lathe_that_was_left() -> None:
    alarm = (Happening(at_s=30.0, what=HappeningKind.ALARM, word="machine.fault"),)
    left = left_of(after("thin-ring", 1, happened=alarm), 100.0)
    goes_on = continue_try(left, load_lesson("thin-ring", OWN), 5000.0)
    assert goes_on is not None and unacknowledged_times_s(goes_on, 9000.0) == (70.0,)


@pytest.mark.long
def test_a_fault_that_was_not_lived_through_comes_again_at_the_next_lathe(tmp_path: Path) -> None:
    lesson = load_lesson("drive-fails", OWN)
    first = Pupil(open_floor(tmp_path / "first", plant=lesson.plant), lesson)
    homes(first)
    first.tried = replace(first.tried, reached=(("touched_off", 1.0), ("in_cut", 2.0)), given=frozenset({0}))
    left = left_of(first.tried, first.floor.sim.now_s())
    second = Pupil(open_floor(tmp_path / "second", plant=lesson.plant), lesson)
    goes_on = continue_try(json_back(left, tmp_path), lesson, second.floor.sim.now_s())
    assert goes_on is not None and goes_on.step == 1 and not goes_on.given
    second.tried = goes_on
    a_cut_that_fails(second)
    second.floor.idle()
    assert second.tried.done and second.tried.given == {0}


def json_back(left: UnfinishedTry, data: Path) -> UnfinishedTry:
    """What was left, by way of its file."""
    file = left_file(data, "", "drive-fails")
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps(asdict(left)), encoding="utf-8")
    back = read_left(data, "", "drive-fails")
    assert back is not None
    return back


@pytest.mark.parametrize(
    ("made", "asked", "word"), [(5, "lesson_start.ask", "5"), (3, "lesson_start.anew", "none of them counts")]
)
def test_it_is_said_before_the_screens_when_a_lesson_continues_and_when_it_cannot(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    made: int,
    asked: str,
    word: str,
) -> None:
    text, questions = load("en"), list[str]()

    def enter(question: str) -> str:
        questions.append(question)
        return ""

    keep_left(tmp_path, after("following-error", made), 300.0)
    monkeypatch.setattr("builtins.input", enter)
    attempt = begin_attempt(Namespace(trainee="", lesson="following-error"), tmp_path, text)
    assert questions == [text(asked)]
    said = capsys.readouterr().out
    assert "after 5:00" in said and word in said
    assert attempt.continued == (5 if made == 5 else 0)


def test_a_lesson_that_was_changed_meanwhile_starts_over_and_says_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    attempt = after("first-look", 2)
    keep_left(tmp_path, replace(attempt, reached=(("skimmed", 60.0), ("homed", 120.0))), 300.0)
    monkeypatch.setattr("builtins.input", lambda _: "")
    assert begin_attempt(Namespace(trainee="", lesson="first-look"), tmp_path, load("en")).continued == 0
    assert "It has changed since" in capsys.readouterr().out
