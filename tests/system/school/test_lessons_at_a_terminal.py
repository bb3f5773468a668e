"""Lessons at a real terminal: begun, made by their hints, debriefed, kept."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest

from tests.compact import save_compact
from tests.terminal import Terminal
from tests.trainee import Trainee

pytestmark = [pytest.mark.system, pytest.mark.timeout(180)]

LANGUAGES = ("en", pytest.param("ko", marks=pytest.mark.long))


def lesson_at(data: Path, name: str, language: str, *more: str) -> Terminal:
    """The screens on the lathe of a lesson, with its axes close together."""
    machine = save_compact(data)
    command = [sys.executable, "-m", "console", "--sim", "--lesson", name, "--data", str(data), *machine, *more]
    return Terminal([*command, "--lang", language], columns=80, rows=24)


def begins(trainee: Trainee) -> None:
    """From the page Train to the first job."""
    trainee.sees("train_page.hint")
    trainee.sees("activity.ready", 30.0)
    trainee.press("1")
    trainee.press("enter")
    trainee.sees("setup.next.ready")


def debriefed(trainee: Trainee) -> int:
    """End the lesson, and read the score."""
    trainee.press("9")
    trainee.sees("train_page.next.done")
    trainee.press("enter")
    found = trainee.sees("debrief.score")
    number = re.search(r"\d+", found[0])
    assert number is not None
    return int(number[0])


def kept(data: Path, trainee: str) -> list[dict[str, object]]:
    return [json.loads(file.read_text(encoding="utf-8")) for file in (data / "training" / trainee).glob("*.json")]


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.long
def test_a_first_lesson_is_made_debriefed_and_kept(language: str, tmp_path: Path) -> None:
    with lesson_at(tmp_path, "first-look", language, "--trainee", "Kim") as terminal:
        trainee = Trainee(terminal, language)
        begins(trainee)
        trainee.switches_on()
        trainee.starts_homing()
        trainee.sees("align_page.next.jaw_enable", 30.0)
        assert debriefed(trainee) == 100
        assert "SIM" in terminal.row(0)
        trainee.press("ctrl+q")
        assert terminal.wait_exit(15.0) == 0
    (one,) = kept(tmp_path, "Kim")
    assert (one["lesson"], one["score"], one["trainee"]) == ("first-look", 100, "Kim")


@pytest.mark.long
@pytest.mark.parametrize("language", ("en", "ko"))
def test_a_cable_that_is_cut_by_the_lesson_is_lived_through(language: str, tmp_path: Path) -> None:
    with lesson_at(tmp_path, "cable-cut", language) as terminal:
        trainee = Trainee(terminal, language)
        begins(trainee)
        trainee.aligns()
        trainee.starts_the_cut()
        trainee.sees("activity.lost", 30.0)
        trainee.sees("frame.recover", 60.0)
        trainee.press("f2")
        trainee.sees("run_page.next.align", 30.0)
        trainee.press("4")
        trainee.sees("align_page.next.drives")
        trainee.does_step("align_page.valid_title")
        assert debriefed(trainee) >= 90
        trainee.press("w")
        trainee.sees("fault.cut-cable")
        trainee.press("ctrl+q")
        assert terminal.wait_exit(15.0) == 0
    (one,) = kept(tmp_path, "-")
    assert [each["word"] for each in one["happened"] if each["what"] == "fault"] == ["cut-cable for=10"]  # type: ignore[attr-defined]


def test_the_options_of_a_lesson_are_refused_without_one(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "console", "--sim", "--trainee", "Kim", "--data", str(tmp_path)]
    with Terminal(command, columns=80, rows=24) as terminal:
        terminal.wait_for("--trainee", 10.0)
        assert terminal.wait_exit(15.0) == 2
