"""However the console ends, the machine is brought to rest first, and nothing is left behind."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from console.session.station.link_thread import LEAVE_S
from tests.terminal import Terminal
from tests.trainee import Trainee, console, console_at, simulator_of

pytestmark = [pytest.mark.system, pytest.mark.long]

PROMPT_S = 6.0
"""For a console that is told to end in mid-motion: ramp, drives off, and the proof of rest after both."""

MORE_THAN_THE_LINE_HOLDS = ("?",) * 80
"""Lists of keys to be painted, one key as if it were held down, until the screen waits for a stalled line."""

SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
# What is said may have the remark before it that the machine is waited for.
ENDED = {
    "en": r"\A(console: waiting [^\n]*\n)?console: ended by (\w+); the machine is at rest\n*\Z",
    "ko": r"\A(console: 기계[^\n]*\n)?console: [^\n]*(SIG\w+)[^\n]*\n*\Z",
}


def ended_by(terminal: Terminal, number: signal.Signals, language: str = "en") -> None:
    """The program has said by what it ended, and nothing of a machine that might not rest; nothing is left."""
    assert terminal.wait_exit(PROMPT_S) == 1
    terminal.wait_alone(2.0)
    found = re.match(ENDED[language], terminal.text)
    assert found is not None and found[2] == number.name, terminal.text


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_in_motion_ends_the_console_with_the_machine_at_rest(
    number: signal.Signals, tmp_path: Path
) -> None:
    language = "ko" if number is signal.SIGTERM else "en"
    with console(tmp_path, language, 80, 24) as terminal:
        trainee = console_at(terminal, language)
        trainee.switches_on()
        trainee.starts_homing()
        terminal.signal(number)
        ended_by(terminal, number, language)


def test_a_signal_at_rest_ends_the_console(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = Trainee(terminal, "en")
        trainee.sees("activity.ready")
        terminal.signal(signal.SIGHUP)
        ended_by(terminal, signal.SIGHUP)


def test_signals_that_come_in_a_row_end_it_as_one_does(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        trainee.starts_homing()
        for _ in range(200):
            terminal.signal(signal.SIGTERM)
        ended_by(terminal, signal.SIGTERM)


def test_a_signal_while_it_starts_ends_it_in_one_line(tmp_path: Path) -> None:
    """At the first byte that is painted the machine is not yet there."""
    with console(tmp_path, "en", 80, 24) as terminal:
        terminal.wait_for(lambda _: terminal.bytes_seen > 0)
        terminal.signal(signal.SIGTERM)
        ended_by(terminal, signal.SIGTERM)


def test_the_terminal_is_as_it_was_after_a_signal(tmp_path: Path) -> None:
    """In a shell, which goes on: keys are echoed again, line by line."""
    words = f"{sys.executable} -m console --sim --data {tmp_path} --lang en; echo code $?; stty -a; echo END"
    with Terminal(["sh", "-c", words], columns=100, rows=30) as terminal:
        trainee = Trainee(terminal, "en")
        trainee.sees("activity.ready")
        (program,) = set(terminal.children()) - {simulator_of(terminal)}
        os.kill(program, signal.SIGTERM)
        terminal.wait_for("^END", PROMPT_S)
        assert "code 1" in terminal.text
        for mode in ("icanon", "echo", "isig", "icrnl", "ixon"):
            assert re.search(rf"(^|\s){mode}\b", terminal.text), mode
        assert terminal.wait_exit() == 0


def test_a_signal_ends_a_console_that_hangs_in_a_stalled_line(tmp_path: Path) -> None:
    with console(tmp_path, "en", 160, 48) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        trainee.starts_homing()
        terminal.stall()
        terminal.press(*MORE_THAN_THE_LINE_HOLDS)
        terminal.signal(signal.SIGTERM)
        assert terminal.wait_exit(PROMPT_S + LEAVE_S) == 1
        terminal.wait_alone(2.0)


def test_a_window_that_is_closed_in_motion_takes_all_with_it(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        trainee.starts_homing()
        terminal.hang_up()
        assert terminal.wait_exit(PROMPT_S) == 1
        terminal.wait_alone(2.0)


def test_a_console_that_is_killed_takes_the_simulator_with_it(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        trainee.starts_homing()
        terminal.signal(signal.SIGKILL)
        assert terminal.wait_exit() == -signal.SIGKILL
        terminal.wait_alone(3.0)


def test_a_machine_that_is_gone_is_told_at_once_and_can_be_left(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        trainee.starts_homing()
        os.kill(simulator_of(terminal), signal.SIGKILL)
        trainee.sees("activity.lost")
        trainee.sees("lost_link.for_ever", 1.0)
        terminal.wait_for("!!! .*(link|simulator)", 1.0)
        terminal.press("2")
        terminal.wait_for("Set-up: lee-2001", 2.0)
        terminal.press("ctrl+q")
        assert terminal.wait_exit(3.0) == 1
        assert "standstill is not confirmed" in terminal.text
        terminal.wait_alone(2.0)


def test_leaving_at_rest_asks_nothing_and_in_motion_is_refused(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        trainee.starts_homing()
        terminal.press("ctrl+q")
        trainee.sees("problem.screen.quit_moving")
        trainee.sees("align_page.next.jaw_enable", 30.0)
        terminal.press("ctrl+q")
        assert terminal.wait_exit(15.0) == 0
        assert terminal.text.strip() == ""
        terminal.wait_alone(1.0)


def test_a_console_that_was_suspended_goes_on_with_all_its_keys(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = console_at(terminal)
        for _ in range(3):
            terminal.signal(signal.SIGSTOP)
            terminal.signal(signal.SIGCONT)
            terminal.signal(signal.SIGTSTP)
        for _ in range(10):
            trainee.press("pagedown", "4")
            trainee.sees("align_page.next.clamp")
            terminal.press("2")
            trainee.sees("setup.next.ready")
        terminal.press("ctrl+q")
        assert terminal.wait_exit(15.0) == 0


@pytest.mark.parametrize("redirected", ["<&-", "</dev/null", "| cat", "2>&1 | cat"])
def test_without_a_terminal_it_says_so_and_ends(redirected: str, tmp_path: Path) -> None:
    """Also in a terminal of which only one stream is led elsewhere."""
    program = f"{sys.executable} -m console --sim --data {tmp_path} --lang en"
    words = f"set -o pipefail; {program} {redirected}; echo code $?"
    with Terminal(["bash", "-c", words], columns=100, rows=30) as terminal:
        terminal.wait_for("^code 1", 5.0)
        assert terminal.text.startswith("console: the screens need a terminal")
        assert terminal.text.split("\n")[1] == "code 1"


def test_without_any_terminal_it_says_so_in_one_line(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "console", "--sim", "--data", str(tmp_path), "--lang", "en"]
    done = subprocess.run(command, stdin=subprocess.PIPE, capture_output=True, text=True, timeout=20)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)
    assert done.stderr.startswith("console: the screens need a terminal")
