"""What tells somebody to act is whole on a real screen of 80 x 24, in Korean, whose letters take two columns."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from console.session.data.records import FOLDER
from console.text.catalogue import load
from profiles.problem import Problem
from tests.console.test_run_record import begins, killed
from tests.trainee import Trainee, console, console_at, simulator_of

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]

MISSING = (
    "alignment.no_clamping",
    "alignment.drives_off",
    "alignment.not_homed",
    "alignment.no_jaw",
    "alignment.no_touch_off",
)
"""Why a machine that was just switched on cuts nothing, in the order in which it is put right."""


def one_word(text: str) -> str:
    return "".join(text.split())


@pytest.mark.long
def test_a_refusal_and_a_stop_that_failed_are_on_the_screen_in_full(tmp_path: Path) -> None:
    text = load("ko")
    first, *others = (one_word(text.problem(Problem(code=code))) for code in MISSING)
    with console(tmp_path, "ko", 80, 24) as terminal:
        trainee = console_at(terminal, "ko")
        trainee.press("5", "f5")
        more = f"+{len(others)} {text('frame.all')}"
        terminal.wait_for(lambda _: more in terminal.row(1), 10.0)
        answer = f"{terminal.row(1).replace(more, '')}{terminal.row(2)}"
        assert one_word(answer) == f"–{first}"
        trainee.press("w")
        terminal.wait_for(lambda shown: all(each in one_word(shown) for each in (first, *others)), 5.0)
        trainee.press("end")
        trainee.sees("messages.close", 5.0)
        trainee.press("w")
        trainee.sees("run_page.checks", 5.0)

        os.kill(simulator_of(terminal), signal.SIGKILL)
        trainee.sees("activity.lost")
        trainee.press("space")
        failed = one_word(f"{text('frame.stop')} {text('frame.not_delivered')}")
        terminal.wait_for(lambda _: one_word(terminal.row(-2)) == failed, 5.0)
        assert one_word(text("run_page.lost.remedy")) in one_word(terminal.text.replace("│", ""))
        assert one_word(text("key.help")) in terminal.row(-1)


def test_a_cut_that_was_killed_with_its_console_is_told_at_the_next_start(tmp_path: Path) -> None:
    killed(begins(tmp_path, "armed", "started", machine="lee-2001-lathe"))
    with console(tmp_path, "en", 160, 48) as terminal:
        trainee = Trainee(terminal, "en")
        trainee.sees("activity.ready", 30.0)
        terminal.wait_for("the run of ring that started on", 5.0)
        assert list((tmp_path / FOLDER).iterdir()) == []
