"""Each press of a jog key is one step at rest, none in motion, and a key that is held down is one press."""

from __future__ import annotations

import pytest

from console.tui.pages.align_jog import JogPresses

STEP_S = 0.27
"""What a step takes on the machine of the paper: its ramps are 0.2 s long."""


def jogged(*pressed_s: float, step_s: float = STEP_S) -> JogPresses:
    """Press one key at these times on a machine that takes `step_s` for a step; look each 5 ms."""
    presses, ends_s, now_s, left = JogPresses(), 0.0, 0.0, list(pressed_s)
    while now_s < pressed_s[-1] + 1.0:
        at_rest = now_s >= ends_s
        if presses.due(now_s, at_rest=at_rest) is not None:
            ends_s = now_s + step_s
        while left and left[0] <= now_s:
            left.pop(0)
            if presses.press("align.in", now_s, at_rest=now_s >= ends_s):
                ends_s = now_s + step_s
        now_s += 0.005
    return presses


@pytest.mark.parametrize("gap_s", [0.35, 0.45, 0.8, 1.5])
def test_every_press_at_the_pace_of_a_person_is_a_step(gap_s: float) -> None:
    presses = jogged(*(gap_s * n for n in range(10)))
    assert (presses.taken, presses.missed, presses.held) == (10, 0, False)


def test_a_press_while_it_moves_is_no_step_and_counted() -> None:
    presses = jogged(*(0.2 * n for n in range(10)))
    assert 0 < presses.taken < 10
    assert presses.taken + presses.missed == 10


@pytest.mark.parametrize("delay_s", [0.25, 0.5, 0.66])
@pytest.mark.parametrize("period_s", [0.03, 0.033, 0.04])
def test_a_key_that_is_held_down_is_one_step(delay_s: float, period_s: float) -> None:
    presses = jogged(0.0, *(delay_s + period_s * n for n in range(60)))
    assert (presses.taken, presses.held) == (1, True)


def test_presses_faster_than_a_hand_are_a_key_that_is_held_down() -> None:
    presses = jogged(*(0.1 * n for n in range(10)))
    assert (presses.taken, presses.held) == (1, True)


def test_no_press_waits_for_the_end_of_a_motion() -> None:
    presses = JogPresses()
    assert presses.press("align.in", 0.0, at_rest=True)
    presses.press("align.in", 0.3, at_rest=False)
    assert presses.due(0.4, at_rest=False) is None
    assert presses.due(0.5, at_rest=True) is None
    assert (presses.taken, presses.missed) == (1, 1)


def test_another_key_counts_anew_and_is_taken_at_once() -> None:
    presses = JogPresses()
    presses.press("align.in", 0.0, at_rest=True)
    assert presses.press("align.out", 0.3, at_rest=True)
    assert presses.taken == 1
