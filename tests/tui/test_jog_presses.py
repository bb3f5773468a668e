"""Every press of a jog key is one step, in motion too, and a key that is held down is one press."""

from __future__ import annotations

from dataclasses import replace

import pytest

from console.session.station.state import Activity, StationState
from console.tui.align.align_jog import HELD_UP_S, MOST_WAITING, StepQueue
from console.tui.align.jog_presses import JogPresses
from profiles.problem import Problem

REST = StationState(activity=Activity.READY)
BUSY = StationState(activity=Activity.JOGGING)


def fingers(*pressed_s: float) -> tuple[int, bool]:
    """Presses that a finger made, of a key that comes at these times; and whether it is held at the end."""
    presses, now_s, left, counted = JogPresses(), 0.0, list(pressed_s), 0
    while now_s < pressed_s[-1] + 1.0:
        counted += presses.due(now_s) is not None
        while left and left[0] <= now_s:
            left.pop(0)
            counted += presses.due(now_s) is not None
            counted += presses.press("align.in", now_s)
        now_s += 0.005
    return counted, presses.held


@pytest.mark.parametrize("gap_s", [0.15, 0.2, 0.35, 0.45, 0.8, 1.5])
def test_ten_presses_are_ten_steps_at_any_pace_of_a_person(gap_s: float) -> None:
    assert fingers(*(gap_s * n for n in range(10))) == (10, False)


@pytest.mark.parametrize("delay_s", [0.25, 0.5, 0.66])
@pytest.mark.parametrize("period_s", [0.03, 0.04, 0.092])
def test_a_key_that_is_held_down_is_one_step(delay_s: float, period_s: float) -> None:
    assert fingers(0.0, *(delay_s + period_s * n for n in range(60))) == (1, True)


def test_presses_faster_than_a_hand_are_a_key_that_is_held_down() -> None:
    assert fingers(*(0.1 * n for n in range(10))) == (1, True)


def test_another_key_is_taken_at_once() -> None:
    presses = JogPresses()
    assert presses.press("align.in", 0.0)
    assert presses.press("align.out", 0.3)


def test_the_next_step_is_due_only_when_the_one_before_is_proven_in_position() -> None:
    queue = StepQueue()
    for n in range(3):
        queue.add("align.in", 0.1 * n)
    assert queue.is_due
    queue.posted(REST)
    # At rest again, but nobody has said that it arrived.
    for state in (REST, BUSY, REST):
        assert queue.follow(state, 0.3)
        assert not queue.is_due
    assert queue.follow(replace(REST, jogs=1), 0.4)
    assert (queue.is_due, queue.made, queue.asked) == (True, 1, 3)


def test_a_step_that_the_machine_refuses_ends_those_behind_it() -> None:
    queue = StepQueue()
    for _ in range(3):
        queue.add("align.in", 0.0)
    # What was refused before the step is no answer to it.
    before = replace(REST, refusals=(Problem(code="session.busy"),))
    queue.posted(before)
    assert queue.follow(before, 0.1)
    assert not queue.follow(replace(REST, refusals=(Problem(code="machine.beyond_travel"),)), 0.2)
    assert queue.left == 0


def test_a_screen_that_was_held_up_does_not_continue() -> None:
    queue = StepQueue()
    for _ in range(3):
        queue.add("align.in", 0.0)
    queue.posted(REST)
    assert not queue.follow(replace(REST, jogs=1), HELD_UP_S + 0.1)
    assert (queue.is_due, queue.left) == (False, 0)


def test_no_more_than_ten_steps_wait() -> None:
    """A terminal that repeats a held key five times a second would else drive long after it is let go."""
    queue = StepQueue()
    taken = [queue.add("align.in", 0.2 * n) for n in range(20)]
    assert (sum(taken), queue.waiting) == (MOST_WAITING, MOST_WAITING)


def test_what_is_pressed_later_or_is_another_key_is_counted_anew() -> None:
    queue = StepQueue()
    queue.add("align.in", 0.0)
    queue.posted(REST)
    queue.follow(replace(REST, jogs=1), 0.5)
    queue.add("align.in", 1.0)
    assert (queue.made, queue.asked) == (1, 2)
    queue.posted(replace(REST, jogs=1))
    queue.follow(replace(REST, jogs=2), 1.5)
    queue.add("align.in", 9.0)
    assert (queue.made, queue.asked) == (0, 1)
    queue.drop()
    queue.add("align.out", 9.1)
    assert (queue.made, queue.asked) == (0, 1)
