"""Keys at the pace of a scanner do nothing, those of a person are taken; with a clock that is given."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.tui.pace import APART_S, QUIET_S, Pace

SCANNED = ("W", "O", "-", "1", "0", "0", "2", "4", "enter")
LATER_S = QUIET_S + 0.01


def taken(*presses: tuple[float, str]) -> list[str]:
    """The actions that are taken of keys at these times, s; each is asked for as soon as it may be due."""
    pace, done = Pace[str](), list[str]()
    for at_s, key in presses:
        # The thread sleeps until something is due, or the next key comes.
        done += pace.due(at_s - 1e-6)
        pace.hold(key, key, at_s)
    return [*done, *pace.due(presses[-1][0] + 1.0)]


@pytest.mark.parametrize("gap_s", [0.0, 0.001, 0.008, 0.016, 0.03])
def test_of_a_scanned_number_nothing_is_taken_neither_its_first_key_nor_its_last(gap_s: float) -> None:
    assert taken(*((gap_s * n, key) for n, key in enumerate(SCANNED))) == []


@pytest.mark.parametrize("gap_s", [0.06, 0.1, 0.5])
def test_of_a_person_every_key_is_taken(gap_s: float) -> None:
    assert taken(*((gap_s * n, key) for n, key in enumerate(SCANNED))) == list(SCANNED)


@pytest.mark.parametrize("gap_s", [0.0, 0.01, 0.03, 0.09])
def test_a_key_that_is_held_down_is_no_scanner(gap_s: float) -> None:
    assert taken(*((gap_s * n, "down") for n in range(10))) == ["down"] * 10


def test_an_enter_that_a_slow_line_brings_behind_the_burst_is_not_taken() -> None:
    burst = [(0.0, "1"), (0.0, "4"), (0.2, "enter")]
    assert taken(*burst) == []
    assert taken(*burst, (LATER_S, "enter")) == ["enter"]


def test_two_keys_of_a_person_in_one_piece_are_pressed_again() -> None:
    assert taken((0.0, "down"), (0.0, "enter"), (LATER_S, "down"), (LATER_S + 0.2, "enter")) == ["down", "enter"]


def test_an_action_waits_until_it_is_known_to_have_come_alone() -> None:
    pace = Pace[str]()
    assert not pace.hold("4", "page 4", 10.0)
    assert pace.due(10.0 + 0.9 * APART_S) == []
    assert pace.wait_s(10.0, 0.1) == pytest.approx(APART_S)
    assert pace.due(10.0 + APART_S) == ["page 4"]
    assert pace.due(11.0) == []
    assert pace.wait_s(11.0, 0.1) == 0.1


def test_a_thread_that_was_held_up_takes_no_key_for_alone_before_it_has_read_the_rest() -> None:
    pace = Pace[str]()
    pace.hold("4", "4", 0.0)
    # It comes late: what it reads now may have come close behind.
    assert pace.hold("enter", "enter", 0.3)
    assert pace.due(1.0) == []


@pytest.mark.parametrize("apart_s", [0.0, 0.03])
def test_an_action_close_to_a_stop_is_not_taken(apart_s: float) -> None:
    before, behind = Pace[str](), Pace[str]()
    before.hold("f6", "f6", 0.0)
    assert before.hear("space", apart_s)
    assert before.due(1.0) == []
    behind.hear("space", 0.0)
    assert behind.hold("f6", "f6", apart_s)
    assert behind.due(1.0) == []


def test_what_a_scanner_writes_into_a_field_is_not_ended_by_its_enter() -> None:
    pace = Pace[str]()
    told = [pace.write(key, 0.01 * n, character=True) for n, key in enumerate("10024")]
    assert told == [False, False, True, True, True]
    assert pace.hold("enter", "enter", 0.05)
    assert pace.hold("enter", "enter", 0.05 + 0.9 * QUIET_S)
    assert not pace.hold("enter", "enter", 0.05 + LATER_S)


def test_what_a_person_writes_into_a_field_is_ended_by_enter() -> None:
    pace = Pace[str]()
    # Two characters in one piece: a slow line, or a fast hand.
    told = [pace.write(key, at_s, character=True) for key, at_s in zip("1314", (0.0, 0.1, 0.11, 0.2), strict=True)]
    assert told == [False] * 4
    assert not pace.hold("enter", "enter", 0.3)
    assert pace.due(0.4) == ["enter"]


def test_a_backspace_that_is_held_down_in_a_field_is_no_scanner() -> None:
    pace = Pace[str]()
    assert not any(pace.write("backspace", 0.03 * n, character=False) for n in range(20))


@given(st.lists(st.tuples(st.floats(0.0, 0.2), st.sampled_from("14jk"))))
def test_what_is_taken_had_no_other_key_close_to_it(gaps: list[tuple[float, str]]) -> None:
    pace, at_s, heard, done = Pace[tuple[str, float]](), 0.0, list[tuple[str, float]](), list[tuple[str, float]]()
    for gap_s, key in gaps:
        at_s += gap_s
        done += pace.due(at_s - 1e-6)
        pace.hold(key, (key, at_s), at_s)
        heard.append((key, at_s))
    done += pace.due(at_s + 1.0)
    for key, taken_s in done:
        assert all(other == key or abs(other_s - taken_s) > 0.9 * APART_S for other, other_s in heard)
