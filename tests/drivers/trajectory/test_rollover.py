"""Rotary axes: which way round an absolute move goes (Ix27)."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.requests import LinearRequest
from tests.drivers.trajectory.motion import motion

C = "#1->100C"
"""360 deg are 36000 counts."""


def turned(*commands: float, roll: float, definition: str = C, start: float = 0.0) -> list[float]:
    """Where the motor stops, in degrees of its counts, after each absolute command."""
    letter = definition[-1]
    requests = [
        LinearRequest(
            line=0, targets={letter: command}, ta_ms=10, ts_ms=0, tm_ms=100, absolute=frozenset({letter})
        )
        for command in commands
    ]
    made = motion(requests, (definition,), {127: roll, 192: 1}, {1: start})
    return [made.at(110.0 * k) / 100.0 for k in range(1, len(commands) + 1)]


def test_a_positive_ix27_takes_the_shorter_way() -> None:
    assert turned(350.0, 20.0, 210.0, 15.0, roll=36_000) == pytest.approx([-10.0, 20.0, -150.0, 15.0])


def test_without_ix27_nothing_rolls_over() -> None:
    assert turned(350.0, 20.0, roll=0) == pytest.approx([350.0, 20.0])


@pytest.mark.parametrize("axis", ["A", "B", "C"])
def test_only_a_b_and_c_roll_over(axis: str) -> None:
    assert turned(350.0, roll=36_000, definition=f"#1->100{axis}") == pytest.approx([-10.0])
    assert turned(350.0, roll=36_000, definition="#1->100Z") == pytest.approx([350.0])


def test_with_a_negative_ix27_the_sign_is_the_direction_and_part_of_the_place() -> None:
    """A-90 is -90 degrees, which is +270, in the negative direction."""
    assert turned(90.0, -90.0, 45.0, -300.0, roll=-36_000) == pytest.approx([90.0, -90.0, 45.0, -300.0])


def test_a_tiny_number_says_in_which_direction_zero_is() -> None:
    assert turned(90.0, 0.0000001, roll=-36_000) == pytest.approx([90.0, 360.0])
    assert turned(90.0, -0.0000001, roll=-36_000) == pytest.approx([90.0, 0.0], abs=1e-6)


def test_the_direction_is_that_of_the_axis_when_its_motor_turns_the_other_way() -> None:
    assert turned(90.0, 0.0000001, roll=-36_000, definition="#1->-100C") == pytest.approx([-90.0, -360.0])


def test_a_motor_that_stands_there_stays() -> None:
    assert turned(90.0, 90.0, 450.0, roll=-36_000) == pytest.approx([90.0, 90.0, 90.0])
    assert turned(90.0, 450.0, roll=36_000) == pytest.approx([90.0, 90.0])


def test_an_incremental_move_goes_as_far_as_it_says() -> None:
    """To 350 by the shorter way, and 30 on: the program calls that 380, the motor is at 20."""
    absolute = LinearRequest(line=0, targets={"C": 350.0}, ta_ms=10, ts_ms=0, tm_ms=100, absolute=frozenset("C"))
    incremental = LinearRequest(line=1, targets={"C": 380.0}, ta_ms=10, ts_ms=0, tm_ms=100)
    made = motion([absolute, incremental], (C,), {127: 36_000})
    assert made.end() == pytest.approx(2000.0)


@given(
    commands=st.lists(st.floats(-2000.0, 2000.0), min_size=2, max_size=5), roll=st.sampled_from([36_000, -36_000])
)
def test_the_motor_always_ends_at_the_place_and_never_goes_too_far(commands: list[float], roll: float) -> None:
    stops = [0.0, *turned(*commands, roll=roll)]
    for command, before, after in zip(commands, stops, stops[1:], strict=False):
        off = (after - command) % 360.0
        assert min(off, 360.0 - off) == pytest.approx(0.0, abs=1e-6)
        assert abs(after - before) <= (180.0 if roll > 0 else 360.0) + 1e-6
        if roll < 0 and abs(after - before) > 1e-6:
            assert (after > before) == (command >= 0.0)
