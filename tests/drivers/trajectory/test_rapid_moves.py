"""RAPID moves against the jog of the slowest motor and the arithmetic of the manual."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import TURBO
from drivers.pmac.requests import Request
from drivers.pmac.trajectory.jog import JogSettings, jog_to
from tests.drivers.trajectory.motion import (
    INTERRUPT_MS,
    Motion,
    assert_smooth,
    linear,
    motion,
    planner_for,
    rapid,
)

TWO = ("#1->X", "#2->Y")
PLAIN = {12: 0.0, 119: 0.0, 120: 10.0, 121: 0.0, 122: 10.0, 219: 0.0, 220: 10.0, 221: 0.0, 222: 10.0}
"""No delay; both motors: 10 ms of acceleration, 10 counts/ms."""


def jog(distance: float, *, speed: float, ta: float = 10.0, ts: float = 0.0, limit: float = 0.0) -> Motion:
    return Motion(jog_to(0.0, distance, JogSettings(acceleration=limit, ta_ms=ta, ts_ms=ts, speed=speed)))


@given(
    distance=st.integers(-5000, 5000),
    speed=st.integers(1, 40),
    ta=st.integers(0, 60),
    ts=st.integers(1, 40),
    limit=st.sampled_from([0.0, 0.02, 0.3]),
)
def test_the_rapid_move_of_one_motor_is_its_jog(distance: int, speed: int, ta: int, ts: int, limit: float) -> None:
    made = motion([rapid(X=float(distance))], settings={12: 0, 119: limit, 120: ta, 121: ts, 122: speed})
    expected = jog(float(distance), speed=speed, ta=ta, ts=ts, limit=limit)
    if distance == 0:
        assert made.duration_ms == pytest.approx(INTERRUPT_MS)
        return
    assert made.duration_ms == pytest.approx(expected.duration_ms)
    for k in range(51):
        t = expected.duration_ms * k / 50
        assert made.at(t) == pytest.approx(expected.at(t), abs=1e-9 * abs(distance))


def test_only_the_slowest_motor_goes_at_its_speed_and_the_path_is_straight() -> None:
    made = motion([rapid(X=1000.0, Y=250.0)], TWO, PLAIN)
    assert made.duration_ms == pytest.approx(100 + 10)
    assert made.peak_velocity(0) == pytest.approx(10.0)
    assert made.peak_velocity(1) == pytest.approx(2.5)
    for t in (3.0, 17.0, 60.0, 104.0):
        assert made.at(t, 1) == pytest.approx(made.at(t, 0) / 4)


def test_the_slowest_motor_is_the_one_with_the_longest_time_not_the_longest_way() -> None:
    made = motion([rapid(X=1000.0, Y=900.0)], TWO, {**PLAIN, 222: 3.0})
    assert made.peak_velocity(1) == pytest.approx(3.0)
    assert made.peak_velocity(0) == pytest.approx(1000.0 / 300.0)


def test_the_times_are_equal_before_acceleration_is_added() -> None:
    """Motor 2 accelerates for 50 ms, motor 1 for 10: both take 100 ms and their own acceleration."""
    made = motion([rapid(X=1000.0, Y=500.0)], TWO, {**PLAIN, 220: 50.0})
    assert made.duration_ms == pytest.approx(100 + 50)
    assert made.at(110.0, 0) == pytest.approx(1000.0)
    assert made.velocity(120.0, 0) == 0.0
    alone = jog(500.0, speed=5.0, ta=50.0)
    for t in (0.0, 8.0, 30.0, 90.0, 130.0, 150.0):
        assert made.at(t, 1) == pytest.approx(alone.at(t), abs=1e-9)
    assert_smooth(made.pieces, (0.0, 0.0), 1000.0)


def test_the_acceleration_limit_of_a_motor_counts_at_the_speed_that_it_is_given() -> None:
    """Ix19 = 0.05: 5 counts/ms, not the 10 of Ix22, in 100 ms."""
    made = motion([rapid(X=2000.0, Y=1000.0)], TWO, {**PLAIN, 219: 0.05})
    assert made.duration_ms == pytest.approx(200 + 100)


def test_the_next_line_waits_until_all_motors_have_finished() -> None:
    requests: list[Request] = [rapid(X=1000.0, Y=500.0), linear(X=1100.0, Y=500.0, tm=100)]
    planner = planner_for(requests, TWO, {**PLAIN, 220: 50.0})
    first = planner.plan()
    assert not any(piece.calculates for piece in first.pieces)
    assert Motion(planner.plan().pieces).at(0.0) == pytest.approx(1000.0)


def test_a_rapid_move_is_never_blended() -> None:
    requests: list[Request] = [linear(X=100.0, Y=0.0, tm=20), rapid(X=300.0, Y=0.0), rapid(X=0.0, Y=0.0)]
    made = motion(requests, TWO, PLAIN)
    for stop_ms, position in ((30.0, 100.0), (30.0 + 30.0, 300.0)):
        assert made.at(stop_ms) == pytest.approx(position)
        assert made.velocity(stop_ms) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("switch", "speed"), [(0, 10.0), (1, 25.0)])
def test_i50_chooses_between_the_jog_speed_and_the_program_speed(switch: int, speed: float) -> None:
    made = motion([rapid(X=1000.0, Y=0.0)], TWO, {**PLAIN, 50: switch, 116: 25.0})
    assert made.peak_velocity() == pytest.approx(speed)


@pytest.mark.parametrize(("switch", "speed"), [(0, 10.0), (1, 25.0)])
def test_on_a_turbo_each_motor_chooses_with_ixx90(switch: int, speed: float) -> None:
    settings = {**PLAIN, 92: 0.0, 192: 0.0, 190: switch, 116: 25.0}
    made = motion([rapid(X=1000.0)], settings=settings, dialect=TURBO)
    assert made.peak_velocity() == pytest.approx(speed)


def test_i12_passes_before_a_rapid_move_begins() -> None:
    made = motion([rapid(X=100.0)], settings={**PLAIN, 12: 10})
    assert made.duration_ms == pytest.approx(10 + 10 + 10)
    assert made.at(10.0) == 0.0
    assert made.at(20.0) == pytest.approx(50.0)


def test_on_a_turbo_the_longest_ixx92_of_the_moving_motors_passes_first() -> None:
    settings = {**PLAIN, 192: 7.0, 292: 30.0, 190: 0, 290: 0}
    assert motion([rapid(X=100.0, Y=10.0)], TWO, settings, dialect=TURBO).duration_ms == pytest.approx(30 + 20)
    assert motion([rapid(X=100.0)], settings=settings, dialect=TURBO).duration_ms == pytest.approx(7 + 20)


def test_a_rapid_move_of_no_distance_takes_an_interrupt() -> None:
    """A loop of such moves would never let go of the time."""
    made = motion([rapid(X=0.0), rapid(X=0.0)], settings=PLAIN)
    assert made.duration_ms == pytest.approx(2 * INTERRUPT_MS)


def test_acceleration_times_that_are_both_zero_count_as_one_millisecond() -> None:
    made = motion([rapid(X=100.0)], settings={**PLAIN, 120: 0.0})
    assert made.duration_ms == pytest.approx(10 + 1)
