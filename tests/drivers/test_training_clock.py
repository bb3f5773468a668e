"""Machine time of a lathe in training: scaled, paused, never going back."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.clock import TrainingClock

STEP_S = st.floats(min_value=0.0, max_value=100.0)


class Real:
    """Real time, advanced by hand and by sleeping."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds


def clock_of(real: Real) -> TrainingClock:
    return TrainingClock(lambda: real.now_s, real.sleep)


@given(st.lists(st.tuples(st.sampled_from((0.0, 0.25, 1.0, 4.0)), STEP_S)))
def test_it_is_the_sum_of_what_passed_at_each_speed(steps: list[tuple[float, float]]) -> None:
    real = Real()
    clock, expected_s, before_s = clock_of(real), 1000.0, 1000.0
    for speed, seconds in steps:
        clock.set_speed(speed)
        real.now_s += seconds
        expected_s += speed * seconds
        assert clock.now_s() == pytest.approx(expected_s)
        assert clock.now_s() >= before_s
        before_s = clock.now_s()


@pytest.mark.parametrize(("speed", "real_s"), [(0.25, 4.0), (1.0, 1.0), (4.0, 0.25)])
def test_a_wait_is_of_machine_time(speed: float, real_s: float) -> None:
    real = Real()
    clock = clock_of(real)
    clock.set_speed(speed)
    before_s = clock.now_s()
    clock.wait(1.0)
    assert clock.now_s() - before_s == pytest.approx(1.0)
    assert real.now_s == pytest.approx(1000.0 + real_s)


def test_a_wait_in_a_pause_ends() -> None:
    real = Real()
    clock = clock_of(real)
    clock.set_speed(0.0)
    clock.wait(1.0)
    assert clock.paused
    assert clock.now_s() == 1000.0
