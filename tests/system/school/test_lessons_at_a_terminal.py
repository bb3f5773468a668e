"""Lessons at a real terminal: begun, made by their hints, debriefed, kept."""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import time
from pathlib import Path

import pytest

from console.school.training.lesson import FOLDER
from console.text.catalogue import load
from profiles.problem import Problem
from tests.compact import save_compact
from tests.preloaded import completed
from tests.school.lesson_plays import PLAYS
from tests.school.walk_lessons import CARELESS, LUCKY, PERFECT, UNLUCKY, Walk, score
from tests.terminal import Terminal
from tests.trainee import Trainee

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

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


# A lesson that was left at a real terminal is offered to be continued, on the same lathe.


@pytest.mark.long
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_lesson_whose_terminal_was_closed_goes_on_with_its_steps(language: str, tmp_path: Path) -> None:
    with lesson_at(tmp_path, "first-look", language, "--trainee", "Kim") as terminal:
        trainee = Trainee(terminal, language)
        begins(trainee)
        trainee.switches_on()
        terminal.hang_up()
        terminal.wait_exit(20.0)
    with lesson_at(tmp_path, "first-look", language, "--trainee", "Kim") as terminal:
        trainee = Trainee(terminal, language)
        trainee.sees("lesson_start.ask")
        assert ": 2." in terminal.text, "steps that stay made"
        trainee.press("x", "enter", "enter")  # no answer, then yes
        terminal.wait_for(lambda text: text.count("✓ ") == 2, 20.0)
        begins(trainee)
        trainee.switches_on()
        trainee.starts_homing()
        trainee.sees("align_page.next.jaw_enable", 30.0)
        assert debriefed(trainee) == 100
        trainee.press("ctrl+q")
        assert terminal.wait_exit(15.0) == 0
    (one,) = kept(tmp_path, "Kim")
    words = [each["word"] for each in one["happened"] if each["what"] == "step"]  # type: ignore[attr-defined]
    assert words == ["clamped", "drives_on", "homed"]
    with lesson_at(tmp_path, "first-look", language, "--trainee", "Kim") as terminal:
        Trainee(terminal, language).sees("train_page.hint")
        assert "lesson_start" not in terminal.text, "what was debriefed is not offered again"


# Lessons walked at a real terminal by scripted trainees; `python -m tests.school.walk_lessons` walks all.


def test_there_is_a_way_through_every_bundled_lesson() -> None:
    assert set(PLAYS) == {path.stem for path in FOLDER.glob("*.toml")}


@pytest.mark.long
def test_a_perfect_trainee_lives_through_a_second_console() -> None:
    assert score(Walk("second-console", PERFECT, "ko")) >= 95


@pytest.mark.long
def test_a_careless_trainee_scores_below_50() -> None:
    assert score(Walk("first-chucking", CARELESS, "en")) < 50


@pytest.mark.long
def test_luck_is_told_from_skill_by_a_second_lathe() -> None:
    assert score(Walk("read-a-plot", LUCKY, "en")) >= 95
    assert score(Walk("read-a-plot", UNLUCKY, "en")) < 80


# An instructor beside a trainee at real terminals: orders are seen at once, and the trainee is never stuck.


def address(data: Path) -> str:
    return f"unix:{data / 's'}"


def trainee_at(data: Path, language: str, *more: str) -> Terminal:
    """The screens on a lathe with its axes close together, open to an instructor."""
    command = [
        sys.executable,
        "-m",
        "console",
        "--sim",
        "--data",
        str(data),
        "--lang",
        language,
        *save_compact(data),
    ]
    return Terminal([*command, "--instructor", address(data), *more], columns=80, rows=24)


class Instructor:
    """Gives one order after the other, each from a program of its own."""

    def __init__(self, data: Path, language: str) -> None:
        self._words = ["instruct", "--json", "--lang", language, "--data", str(data), address(data)]

    def __call__(self, order: str) -> list[str]:
        """Give an order that is carried out; return the lines of the answer."""
        ended = completed([*self._words, *order.split()], 60.0)
        assert ended.returncode == 0, ended.stderr
        return list(json.loads(ended.stdout)["answer"])

    def refused(self, order: str) -> str:
        """Give an order that is refused; return why."""
        ended = completed([*self._words, *order.split()], 60.0)
        assert ended.returncode == 1
        return str(json.loads(ended.stdout)["refused"])


def paused(terminal: Terminal) -> None:
    terminal.wait_for(lambda _: re.search(r"SIM (paused|멈춤)", terminal.row(0)) is not None, 10.0)


def is_back(terminal: Terminal, name: str) -> None:
    """It is told at the bottom, where the keys are, with what is valid."""
    terminal.wait_for(rf"▶ \D+ {name} \([^▶]*F2", 30.0)
    assert "SIM" in terminal.row(0)


def runs_on(terminal: Terminal) -> None:
    terminal.wait_for(lambda _: re.search(r"SIM (paused|멈춤)", terminal.row(0)) is None, 10.0)


@pytest.mark.long
@pytest.mark.parametrize("language", LANGUAGES)
def test_faults_the_screen_and_the_log(language: str, tmp_path: Path) -> None:
    with trainee_at(tmp_path, language, "--plant", "mounted") as terminal:
        trainee = Trainee(terminal, language)
        trainee.opens_the_first_job()
        instructor = Instructor(tmp_path, language)
        instructor("pause")
        paused(terminal)
        assert [row.rstrip() for row in instructor("screen")] == terminal.text.split("\n")
        instructor("resume")
        (described,) = instructor("inject amplifier-fault motor=tool")
        assert described.startswith("amplifier-fault motor=tool")
        assert instructor("active") == [described]
        assert any("inject amplifier-fault motor=tool" in row for row in instructor("log"))
        trainee.press("0", "l")
        trainee.sees("alarms_page.log_title")
        assert "amplifier-fault" not in terminal.text
        instructor("clear")
        assert "drop" in instructor.refused("drop")
        trainee.press("ctrl+q")
        assert terminal.wait_exit(15.0) == 0
    assert not Path(tmp_path / "s").exists()
    assert not list((tmp_path / "instructor").iterdir())


@pytest.mark.long
@pytest.mark.parametrize("language", ("en", "ko"))
def test_a_cut_is_paused_runs_on_and_is_stopped_in_a_pause(language: str, tmp_path: Path) -> None:
    with trainee_at(tmp_path, language, "--plant", "mounted") as terminal:
        trainee = Trainee(terminal, language)
        trainee.opens_the_first_job()
        instructor = Instructor(tmp_path, language)
        trainee.aligns()
        instructor("speed 0.5")
        trainee.starts_the_cut()
        terminal.wait_for("SIM x0.5", 10.0)
        instructor("pause")
        paused(terminal)
        trainee.sees("frame.instructor_paused")
        before = terminal.text
        time.sleep(3.0)  # longer than any watchdog
        assert re.sub(r"\d\d:\d\d", "", terminal.text) == re.sub(r"\d\d:\d\d", "", before)
        instructor("resume")
        runs_on(terminal)
        trainee.sees("activity.cutting")
        time.sleep(0.5)
        trainee.sees("activity.cutting")  # no watchdog has tripped
        instructor("pause")
        paused(terminal)
        trainee.press("space")
        trainee.sees("frame.stop_waits")
        instructor("resume")
        trainee.sees("activity.stopped", 30.0)
        assert "SIM x0.5" in terminal.row(0)
        trainee.press("f2")
        trainee.sees("activity.ready", 30.0)
        trainee.press("ctrl+q")
        assert terminal.wait_exit(15.0) == 0


@pytest.mark.long
def test_a_trainee_goes_on_without_the_instructor(tmp_path: Path) -> None:
    """Killed at his terminal; gone after a single order; or the trainee leaves in the pause."""
    with trainee_at(tmp_path, "en") as terminal:
        trainee = Trainee(terminal, "en")
        trainee.opens_the_first_job()
        command = [sys.executable, "-m", "console", "instruct", "--data", str(tmp_path), address(tmp_path)]
        with Terminal(command, columns=80, rows=24) as desk:
            desk.wait_for("SIM>", 30.0)
            desk.type("pause\r")
            paused(terminal)
            os.kill(desk.pid, signal.SIGKILL)
            runs_on(terminal)
        instructor = Instructor(tmp_path, "en")
        instructor("pause")
        paused(terminal)
        trainee.press("4", "enter")
        trainee.sees("frame.instructor_paused")
        trainee.press("f2")
        runs_on(terminal)
        instructor("pause")
        paused(terminal)
        trainee.press("ctrl+q")
        assert terminal.wait_exit(15.0) == 0


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--link", "tcp:127.0.0.1:1"], "--instructor goes with --sim"),
        (["--sim", "jobs"], "goes with the screens"),
    ],
)
def test_only_the_screens_on_a_simulated_lathe_have_an_instructor(
    more: list[str], said: str, tmp_path: Path
) -> None:
    command = [sys.executable, "-m", "console", "--instructor", address(tmp_path), "--data", str(tmp_path), *more]
    with Terminal(command, columns=80, rows=24) as terminal:
        terminal.wait_for(said, 20.0)
        assert terminal.wait_exit(15.0) == 2


@pytest.mark.long
@pytest.mark.parametrize("language", ("en", "ko"))
def test_a_trainee_is_put_back_to_a_checkpoint_and_goes_on_from_there(language: str, tmp_path: Path) -> None:
    """Out of a cut, to before it; then the same part is cut, and measured. Then to before anything was aligned."""
    with trainee_at(tmp_path, language, "--plant", "mounted") as terminal:
        trainee = Trainee(terminal, language)
        trainee.opens_the_first_job()
        instructor = Instructor(tmp_path, language)
        instructor("checkpoint begin")
        trainee.aligns()
        instructor("checkpoint aligned")
        trainee.starts_the_cut()
        assert load(language).problem(Problem(code="instruct.not_at_rest")) == instructor.refused("checkpoint")
        instructor("return aligned")
        is_back(terminal, "aligned")
        trainee.press("f2")
        trainee.sees("activity.ready", 30.0)
        trainee.press("k", "4")
        trainee.sees("align_page.next.drives")
        trainee.does_step("align_page.valid_title")
        trainee.starts_the_cut()
        trainee.waits_for_the_end_of_the_cut()
        trainee.measures()
        instructor("return begin")
        is_back(terminal, "begin")
        trainee.press("w")
        trainee.sees("lost_link.returned_title")
        assert load(language).problem(Problem(code="controller.was_reset"))[:20] not in terminal.text
        trainee.press("f2")
        trainee.sees("activity.ready", 30.0)
        trainee.press("4")
        trainee.sees("align_page.next.clamp")
        assert [row.split()[0] for row in instructor("checkpoints")] == ["begin", "aligned"]
        assert "begin" in instructor.refused("return nowhere")
        trainee.press("ctrl+q")
        assert terminal.wait_exit(15.0) == 0
