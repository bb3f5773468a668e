"""Presses of a jog key at the real program in a real terminal: each is a step, and a stop leaves none of them."""

from __future__ import annotations

import re
import time
from pathlib import Path

import pytest

from tests.trainee import Trainee, console, console_at

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]

PRESSES = 6
PRESS_S = 0.3
"""Between two presses: well above what the console takes for a held key (0.12 s), on a busy computer too."""
STEP_DEG, LONGER_DEG, LONGER = 1.0, 30.0, 5
RESOLUTION_DEG = 0.05
"""A count of the spindle is 0.036 deg; its servo rests within one of them."""


def angle_deg(trainee: Trainee) -> float:
    found = re.search(r"C spindle\s+([\d.]+) °", trainee.terminal.text)
    assert found is not None, trainee.terminal.text
    return float(found[1])


def turned_deg(trainee: Trainee, before: float) -> float:
    return (angle_deg(trainee) - before + 180.0) % 360.0 - 180.0


@pytest.mark.long
def test_every_press_is_a_step_and_a_stop_leaves_none(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24, short_ways=True) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        trainee.starts_homing()
        trainee.sees("align_page.next.jaw_enable", 30.0)
        trainee.press("j", "+")
        terminal.wait_for(r"\[1\.00\]", 5.0)

        before = angle_deg(trainee)
        trainee.press(*["pageup"] * PRESSES, pace_s=PRESS_S)
        terminal.wait_for(rf"✓ steps: {PRESSES}", 20.0)
        terminal.wait_for(lambda _: abs(turned_deg(trainee, before) - PRESSES * STEP_DEG) < RESOLUTION_DEG, 5.0)

        trainee.press("+", "+", *["pageup"] * LONGER)
        terminal.wait_for(r"\d of \d steps", 5.0)
        trainee.press("space")
        # In a step it asks for F2; between two of them there was nothing to stop but what waited.
        terminal.wait_for(lambda text: "F2 resets" in text or "j enables the jog; turn" in text, 10.0)
        if "F2 resets" in terminal.text:
            trainee.press("f2")
        trainee.sees("align_page.next.jaw_enable", 10.0)
        stopped = angle_deg(trainee)  # less than a turn further on
        assert turned_deg(trainee, before) < PRESSES * STEP_DEG + LONGER * LONGER_DEG - RESOLUTION_DEG
        # The jog, enabled again, does not continue with what was left.
        trainee.press("j")
        terminal.wait_for(r"jog enabled, 2\d s left", 5.0)
        assert abs(turned_deg(trainee, stopped)) < RESOLUTION_DEG


REPEAT_S, FIRST_S = 0.03, 0.4
"""Of the keyboard in this test: as in most settings."""

PAGE_UP = "\x1b[5~"


def holds(trainee: Trainee, typed: str, for_s: float) -> None:
    """Hold a key down: its first press, after a while its repeats, and then nothing."""
    ends_s = time.monotonic() + for_s
    trainee.terminal.type(typed)
    time.sleep(FIRST_S)
    while time.monotonic() < ends_s:
        trainee.terminal.type(typed)
        time.sleep(REPEAT_S)


@pytest.mark.long
def test_a_held_key_runs_once_the_terminal_is_measured_and_ends_with_its_release(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24, short_ways=True) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        trainee.starts_homing()
        trainee.sees("align_page.next.jaw_enable", 30.0)
        for _ in range(4):  # on a busy computer a repeat may come late: then the jog stays step only, and says so
            holds(trainee, "h", 3.3)
            terminal.wait_for(lambda text: "the terminal repeats" in text or "do not repeat" in text, 5.0)
            if "the terminal repeats" in terminal.text:
                break
            time.sleep(1.0)
        terminal.wait_for(r"Jog, hold: ≤ [\d.]+° over", 5.0)
        shown = re.search(r"Jog, hold: ≤ ([\d.]+)° over", terminal.text)
        assert shown is not None
        time.sleep(1.0)  # what comes at once behind a repeat is no key of a person
        trainee.press("j")
        terminal.wait_for("jog enabled", 5.0)
        before = angle_deg(trainee)
        holds(trainee, PAGE_UP, 2.0)
        released = angle_deg(trainee)
        time.sleep(1.5)
        rested = angle_deg(trainee)
        # Steps of 0.1 degrees; the screen is up to a step behind.
        assert turned_deg(trainee, before) >= 0.2 - RESOLUTION_DEG
        assert turned_deg(trainee, released) <= float(shown[1]) + 0.1 + RESOLUTION_DEG
        time.sleep(1.0)
        assert abs(turned_deg(trainee, rested)) < RESOLUTION_DEG
