"""Terminals that differ at the real program: wide signs, function keys, what `console terminal` says of them."""

from __future__ import annotations

import sys
import unicodedata
from pathlib import Path

import pytest

from tests.terminal import KittyTerminal, Terminal
from tests.trainee import Trainee, console

pytestmark = [pytest.mark.system]

MEASURED = b"\x1b[6n"
FRAMES = "─│╭╮╰╯▶·°"


class WideTerminal(Terminal):
    """One that is set to show ambiguous characters in two cells, and says so where its cursor is."""

    sign_cells = 2

    def _answer(self, data: bytes) -> bytes:
        return b"\x1b[2;%dR" % (1 + 4 * self.sign_cells) * data.count(MEASURED)


class NarrowTerminal(WideTerminal):
    """One that answers as well, and shows them in one cell."""

    sign_cells = 1


@pytest.mark.parametrize("language", ["ko", "en"])
def test_on_a_terminal_with_wide_signs_no_row_is_longer_than_the_screen(tmp_path: Path, language: str) -> None:
    made = console(tmp_path, language, 80, 24, kind=WideTerminal)
    with made as terminal:
        terminal.wait_for("SIM", 10.0)
        terminal.wait_for(lambda text: "+--" in text and not set(FRAMES) & set(text), 10.0)
        widths = [
            sum(2 if unicodedata.east_asian_width(sign) in "WFA" else 1 for sign in row)
            for row in terminal.text.split("\n")
        ]
        assert max(widths) <= 80


def test_on_another_one_the_signs_stay(tmp_path: Path) -> None:
    with console(tmp_path, "ko", 80, 24, kind=NarrowTerminal) as terminal:
        terminal.wait_for("SIM", 10.0)
        terminal.wait_for("▶", 10.0)
        assert "+--" not in terminal.text


def test_a_key_that_may_be_another_one_does_nothing_and_says_what_to_press(tmp_path: Path) -> None:
    """PuTTY, set to SCO: F5 arrives as F2 of kitty's protocol. Set to Xterm R6: F4, or Minus of its keypad."""
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = Trainee(terminal, "en")
        trainee.sees("activity.ready")
        terminal.type("\x1b[>0;136;0c\x1b]11;rgb:0000/0000/0000\x07")
        trainee.scans("")
        trainee.press("4")
        terminal.wait_for("F4", 5.0)
        terminal.type("\x1b[Q")
        terminal.wait_for("no key: the terminal sent", 3.0)
        terminal.type("\x1bOS")
        terminal.wait_for("press F1 once", 3.0)
        trainee.sees("align_page.drives_off")
        terminal.type("\x1bOP")
        trainee.scans("")
        trainee.press("escape")  # closes the help
        trainee.scans("")
        terminal.type("\x1bOS")
        trainee.sees("align_page.drives_on", 10.0)


@pytest.mark.parametrize(
    ("kind", "typed", "line"),
    [
        (Terminal, "\x1bOT", r"ESC OT +f5"),
        (Terminal, "\x1b[Q", r"ESC \[Q +unreadable"),
        (Terminal, " ", r"^ +space"),
        (Terminal, "\x1b[>0;136;0c", r"ESC \[>0;136;0c +\(an answer"),
        (KittyTerminal, "\x1b[Q", r"ESC \[Q +f2"),
        (KittyTerminal, "\x1b[57442;5u", r"ESC \[57442;5u +left_control"),
    ],
)
def test_the_command_shows_what_a_key_sends_and_what_is_read(kind: type[Terminal], typed: str, line: str) -> None:
    with kind([sys.executable, "-m", "console", "terminal", "--lang", "en"], columns=80, rows=24) as terminal:
        terminal.wait_for("Ctrl-C ends", 10.0)
        if kind is KittyTerminal:
            terminal.wait_for(r"ESC \[\?25u +\(an answer", 5.0)
        terminal.type(typed)
        terminal.wait_for(line, 5.0)
        terminal.type("\x03")
        assert terminal.wait_exit(5.0) == 0


def test_the_command_needs_a_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    from console.__main__ import main

    assert main(["terminal", "--lang", "en"]) == 1
    assert "this is none" in capfd.readouterr().err
