"""How far ahead of a slow line bytes are handed to it. A character is ten bits."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.link.serial import Pace

STOP_WITHIN_S = 0.020


class Line:
    """A serial line: a character leaves when the one before has left."""

    def __init__(self, baud_rate: int) -> None:
        self.character_s = 10.0 / baud_rate
        self.clear_at_s = 0.0

    def take(self, count: int, now_s: float) -> None:
        self.clear_at_s = max(self.clear_at_s, now_s) + count * self.character_s


@given(
    st.sampled_from([600, 9600, 19_200, 38_400, 76_800, 115_200]),
    st.lists(st.tuples(st.integers(1, 300), st.floats(0.0, 0.1)), min_size=1, max_size=30),
)
def test_a_stop_at_any_time_is_on_the_wire_within_20_ms(baud_rate: int, lines: list[tuple[int, float]]) -> None:
    pace, line, now_s = Pace(baud_rate), Line(baud_rate), 0.0
    for length, pause_s in lines:
        left = length
        while left:
            count = min(pace.room(now_s), left)
            if count:
                pace.handed(count, now_s)
                line.take(count, now_s)
                left -= count
            assert line.clear_at_s + line.character_s - now_s <= max(STOP_WITHIN_S, 2.01 * line.character_s)
            now_s += pace.wait_s(now_s) if left else pause_s


@pytest.mark.parametrize(("baud_rate", "ahead"), [(9600, 9), (38_400, 38), (115_200, 115), (300, 1)])
def test_what_may_wait_is_10_ms_of_the_line_and_one_character_at_least(baud_rate: int, ahead: int) -> None:
    assert Pace(baud_rate).ahead == ahead
    assert Pace(baud_rate).room(5.0) == ahead


def test_a_long_text_takes_as_long_as_the_line_and_no_longer() -> None:
    """9600 baud are 960 characters a second."""
    pace, now_s, left = Pace(9600), 0.0, 960
    while left:
        count = min(pace.room(now_s), left)
        if count:
            pace.handed(count, now_s)
        left -= count
        now_s += pace.wait_s(now_s)
    assert now_s == pytest.approx(1.0, abs=0.011)


def test_a_line_that_rested_does_not_save_up_for_later() -> None:
    pace = Pace(9600)
    pace.handed(9, 0.0)
    assert pace.room(0.001) == 0
    assert pace.room(1000.0) == 9
