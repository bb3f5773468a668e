"""Keys that come faster than from a person, and as fast as from one, at the real program in a real terminal."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

import pytest

from console.tui.gate import SETTLED_S
from tests.trainee import Trainee, console, console_at

pytestmark = [pytest.mark.system, pytest.mark.timeout(120), pytest.mark.long]

SCANNED = "WO-10024\r"
"""A work order, as a scanner types it: its digits are those of pages, its Enter is that of a confirmation."""

CHARACTER_S = 0.01
"""Between two characters of a scanner that is slow."""


def next_step(trainee: Trainee) -> str:
    """What the page asks for, which tells how far its work has come."""
    return trainee.terminal.row(-3)


def scans_slowly(trainee: Trainee) -> None:
    for character in SCANNED:
        trainee.terminal.type(character)
        time.sleep(CHARACTER_S)
    trainee.scans("")


def test_a_scanner_confirms_nothing_on_any_page_and_shows_no_other(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = console_at(terminal)
        for page, seen in (
            ("1", "Enter opens"),
            ("2", "Set-up: lee-2001"),
            ("3", "Margins|Strategy"),
            ("4", "Clamp the blank with"),
            ("5", "Before the start"),
            ("6", "Inspect"),
        ):
            trainee.press(page)
            terminal.wait_for(seen, 10.0)
            trainee.sees("frame.no_alarms")
            before = next_step(trainee)
            trainee.scans(SCANNED)
            trainee.sees("problem.screen.scanned", 2.0)
            terminal.wait_for(seen, 2.0)
            assert next_step(trainee) == before, page
        trainee.press("4")
        trainee.sees("align_page.next.clamp", 2.0)
        scans_slowly(trainee)
        trainee.sees("problem.screen.scanned", 2.0)
        trainee.sees("align_page.next.clamp")
        # The same by hand.
        trainee.press("enter")
        trainee.sees("align_page.next.drives")
        # Escape closes the list of keys, once it is known that nothing was ordered that has not begun.
        time.sleep(SETTLED_S)
        trainee.press("?")
        trainee.sees("key_help.align.enable", 2.0)
        trainee.press("escape")
        terminal.wait_for("C spindle", 2.0)  # the page is seen again
        assert "STOPPED" not in terminal.text


def test_what_a_scanner_writes_is_read_before_it_is_taken_and_its_stop_is_one(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = console_at(terminal)
        trainee.press("down", "enter")
        trainee.sees("setup.next.entry", 2.0)
        trainee.scans(SCANNED)
        trainee.sees("problem.screen.too_fast_entry", 2.0)
        assert "-10024" in terminal.text
        trainee.press("u")
        terminal.wait_for(r"D 52\.000", 2.0)
        assert "edited" not in terminal.text
        trainee.press("s")
        trainee.sees("setup.next.naming", 2.0)
        trainee.scans(SCANNED)
        trainee.sees("problem.screen.too_fast_entry", 2.0)
        trainee.sees("setup.next.naming")
        trainee.press("enter")
        terminal.wait_for("Set-up: WO-10024", 2.0)
        trainee.scans("WO 10024\r")
        trainee.sees("problem.screen.scanned_stopped", 2.0)
        trainee.sees("activity.ready", 5.0)


def test_each_press_is_a_step_at_whatever_pace_they_come(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        trainee.starts_homing()
        # Looking at another page stops nothing, nor does a scanner while the axes are on their way.
        trainee.press("5")
        terminal.wait_for("Before the start", 2.0)
        trainee.press("4")
        trainee.sees("align_page.next.jaw_enable", 30.0)
        trainee.press("j")
        trainee.sees("align_page.next.jaw", 2.0)
        trainee.press(*["left"] * 10, pace_s=0.45)
        made = steps_made(trainee)
        terminal.wait_for(rf"Z carr\.\s+{0.01 * made:.3f} mm", 2.0)
        trainee.press(*["right"] * 10, pace_s=0.15)  # a step takes longer: the presses wait for it
        terminal.wait_for(r"\d of \d+ steps", 5.0)
        back = steps_made(trainee)
        terminal.wait_for(rf"Z carr\.\s+{0.01 * (made - back):.3f} mm", 2.0)


def steps_made(trainee: Trainee) -> int:
    """How many steps ten presses have made, as the panel tells when none is left; two may have come as one."""
    with suppress(AssertionError):
        trainee.terminal.wait_for("✓ steps: 10", 10.0)
        return 10
    trainee.terminal.wait_for("✓ steps: 9", 1.0)
    return 9
