"""SPLINE, PVT and RAPID moves, and axes that roll over."""

from __future__ import annotations

from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import TURBO
from drivers.pmac.language.errors import PmacError
from drivers.pmac.requests import DwellRequest, LinearRequest, Request
from drivers.pmac.trajectory.jog import JogSettings, jog_to
from drivers.pmac.trajectory.pieces import velocity_at
from tests.drivers.trajectory.motion import (
    INTERRUPT_MS,
    Motion,
    assert_smooth,
    linear,
    motion,
    planner_for,
    pvt,
    rapid,
    splined,
)

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


def b_spline(points: list[float], times: list[float]) -> BSpline:
    """The cubic B-spline over the segments of `times` and one more, as long as its neighbour, at each end.

    It rests at both ends: the outermost points are threefold, and the knots beyond the ends are as far apart
    as the last ones inside.
    """
    from scipy.interpolate import BSpline

    spans = [times[0], *times, times[-1]]
    knots = [0.0, *accumulate(spans)]
    before = [-k * spans[0] for k in (3, 2, 1)]
    behind = [knots[-1] + k * spans[-1] for k in (1, 2, 3)]
    coefficients = [0.0, 0.0, 0.0, *points, points[-1], points[-1]]
    return BSpline(np.array([*before, *knots, *behind]), np.array(coefficients), 3)


def spline_motion(points: list[float], times: list[float], uniform: bool) -> Motion:
    requests = [splined(ms, uniform=uniform, X=p) for p, ms in zip(points, times, strict=True)]
    return motion(requests)


POINTS = st.lists(st.integers(-1000, 1000).map(float), min_size=1, max_size=8)


@given(points=POINTS, ms=st.integers(1, 200))
def test_spline1_is_the_uniform_cubic_b_spline(points: list[float], ms: int) -> None:
    times = [float(ms)] * len(points)
    made, expected = spline_motion(points, times, True), b_spline(points, times)
    stroke = max(1.0, *map(abs, points))
    for t in np.linspace(0.0, made.duration_ms, 101):
        assert made.at(t) == pytest.approx(float(expected(t)), abs=1e-9 * stroke)
    assert_smooth(made.pieces, (0.0,), stroke)


@given(moves=st.lists(st.tuples(st.integers(-1000, 1000).map(float), st.integers(1, 90)), min_size=1, max_size=8))
def test_spline2_is_the_non_uniform_cubic_b_spline(moves: list[tuple[float, int]]) -> None:
    points, times = [p for p, _ in moves], [float(ms) for _, ms in moves]
    made, expected = spline_motion(points, times, False), b_spline(points, times)
    stroke = max(1.0, *map(abs, points))
    assert made.duration_ms == pytest.approx(times[0] + sum(times) + times[-1])
    for t in np.linspace(0.0, made.duration_ms, 101):
        assert made.at(t) == pytest.approx(float(expected(t)), abs=1e-9 * stroke)
    assert_smooth(made.pieces, (0.0,), stroke)


@pytest.mark.parametrize("segments", [1, 2, 3, 4])
def test_n_segments_take_two_segment_times_more(segments: int) -> None:
    made = spline_motion([float(k) for k in range(1, segments + 1)], [25.0] * segments, True)
    assert made.duration_ms == pytest.approx((segments + 2) * 25.0)
    assert made.end() == pytest.approx(segments)


def test_when_the_time_changes_spline1_stops_and_spline2_goes_on() -> None:
    made = motion([splined(10, X=4.0), splined(10, X=8.0), splined(20, X=12.0)])
    assert made.duration_ms == pytest.approx(4 * 10 + 3 * 20)
    assert made.at(40.0) == pytest.approx(8.0, abs=1e-12)
    assert made.velocity(40.0) == pytest.approx(0.0, abs=1e-12)
    made = motion([splined(10, uniform=False, X=4.0), splined(20, uniform=False, X=8.0)])
    assert made.duration_ms == pytest.approx(10 + 10 + 20 + 20)
    assert min(made.velocity(t) for t in np.linspace(5.0, 50.0, 46)) > 0.01


def test_one_point_of_spline1_is_calculated_ahead_of_the_motion() -> None:
    """The segment that is laid with a point is the one before it, and the next point is asked for as it begins."""
    planner = planner_for([splined(10, X=6.0), splined(10, X=0.0)])
    first = planner.plan()
    assert [piece.calculates for piece in first.pieces] == [True]
    assert velocity_at(first.pieces[0].cubics[0], 10.0) == pytest.approx(6.0 / 20.0)


@pytest.mark.parametrize("other", [linear(X=9.0, tm=30), pvt(30, X=9.0), DwellRequest(duration_ms=30)])
def test_another_move_mode_lets_a_spline_come_to_rest_at_its_point(other: Request) -> None:
    made = motion([splined(10, X=6.0), other])
    assert made.at(30.0) == pytest.approx(6.0, abs=1e-12)
    assert made.velocity(30.0) == pytest.approx(0.0, abs=1e-12)


def test_a_segment_without_a_time_is_a_run_time_error() -> None:
    with pytest.raises(PmacError, match="0 ms"):
        motion([splined(0, X=6.0)])


# PVT segments against SciPy's Hermite splines and the distances of the manual's figure.


@given(
    segments=st.lists(
        st.tuples(st.integers(-1000, 1000), st.integers(-20, 20), st.integers(1, 300)), min_size=1, max_size=8
    )
)
def test_a_pvt_sequence_is_the_cubic_hermite_spline_of_its_points(segments: list[tuple[int, int, int]]) -> None:
    from scipy.interpolate import CubicHermiteSpline

    requests = [pvt(float(ms), float(v), X=float(p)) for p, v, ms in segments]
    rest = pvt(50.0, 0.0, X=0.0)
    made = motion([*requests, rest])
    points, speeds = [0, *(p for p, _, _ in segments), 0], [0, *(v for _, v, _ in segments), 0]
    times = [0, *accumulate([*(ms for _, _, ms in segments), 50])]
    expected = CubicHermiteSpline(times, points, speeds)
    stroke = max(1.0, *(abs(p) + abs(v) * ms for p, v, ms in segments))
    for t in np.linspace(0.0, times[-1], 101):
        assert made.at(t) == pytest.approx(float(expected(t)), abs=1e-9 * stroke)
    assert_smooth(made.pieces, (0.0,), stroke)


@pytest.mark.parametrize(
    ("before", "after", "share", "halfway"),
    [(0.0, 6.0, 1 / 2, 3.0), (0.0, 6.0, 1 / 3, 1.5), (0.0, 6.0, 2 / 3, 4.5), (6.0, 6.0, 1.0, 6.0)],
)
def test_the_manual_s_building_blocks(before: float, after: float, share: float, halfway: float) -> None:
    """Half of V t ramps the velocity straight, a third and two thirds bend it as parabolas, V t keeps it."""
    lead = [pvt(10.0, before, X=0.0)] if before else []
    start_ms = 10.0 * len(lead)
    made = motion([*lead, pvt(30.0, after, X=share * 6.0 * 30.0), pvt(30.0, 0.0, X=500.0)])
    assert made.velocity(start_ms + 15.0) == pytest.approx(halfway)


def test_a_pvt_sequence_needs_times_and_an_end_or_ramps_down() -> None:
    with pytest.raises(PmacError, match="at rest"):
        motion([pvt(10.0, 1.0, X=5.0), linear(X=9.0)])
    with pytest.raises(PmacError, match="0 ms"):
        motion([pvt(0.0, X=6.0)])
    planner = planner_for([pvt(10.0, 2.0, X=10.0)])
    planner.plan()
    (piece,) = planner.halt((0.5,))
    assert piece.duration_ms == pytest.approx(2.0 / 0.5)
    assert planner.target[0] == pytest.approx(10.0 + 2.0 * 4.0 / 2)
    assert planner.plan().finished


# RAPID moves against the jog of the slowest motor and the arithmetic of the manual.

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


def test_the_slowest_motor_goes_at_its_speed_on_a_straight_path() -> None:
    made = motion([rapid(X=1000.0, Y=250.0)], TWO, PLAIN)
    assert made.duration_ms == pytest.approx(100 + 10)
    assert made.peak_velocity(0) == pytest.approx(10.0)
    assert made.peak_velocity(1) == pytest.approx(2.5)
    for t in (3.0, 17.0, 60.0, 104.0):
        assert made.at(t, 1) == pytest.approx(made.at(t, 0) / 4)
    made = motion([rapid(X=1000.0, Y=900.0)], TWO, {**PLAIN, 222: 3.0})
    assert made.peak_velocity(1) == pytest.approx(3.0)
    assert made.peak_velocity(0) == pytest.approx(1000.0 / 300.0)


def test_times_are_equal_before_acceleration_which_counts_at_the_speed_that_is_given() -> None:
    """Motor 2 accelerates for 50 ms, motor 1 for 10: both take 100 ms and their own acceleration."""
    made = motion([rapid(X=1000.0, Y=500.0)], TWO, {**PLAIN, 220: 50.0})
    assert made.duration_ms == pytest.approx(100 + 50)
    assert made.at(110.0, 0) == pytest.approx(1000.0)
    assert made.velocity(120.0, 0) == 0.0
    alone = jog(500.0, speed=5.0, ta=50.0)
    for t in (0.0, 8.0, 30.0, 90.0, 130.0, 150.0):
        assert made.at(t, 1) == pytest.approx(alone.at(t), abs=1e-9)
    assert_smooth(made.pieces, (0.0, 0.0), 1000.0)
    # Ix19 = 0.05: 5 counts/ms, not the 10 of Ix22, in 100 ms.
    made = motion([rapid(X=2000.0, Y=1000.0)], TWO, {**PLAIN, 219: 0.05})
    assert made.duration_ms == pytest.approx(200 + 100)


def test_a_rapid_move_waits_for_all_motors_and_is_never_blended() -> None:
    requests: list[Request] = [rapid(X=1000.0, Y=500.0), linear(X=1100.0, Y=500.0, tm=100)]
    planner = planner_for(requests, TWO, {**PLAIN, 220: 50.0})
    first = planner.plan()
    assert not any(piece.calculates for piece in first.pieces)
    assert Motion(planner.plan().pieces).at(0.0) == pytest.approx(1000.0)
    requests = [linear(X=100.0, Y=0.0, tm=20), rapid(X=300.0, Y=0.0), rapid(X=0.0, Y=0.0)]
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


def test_a_rapid_move_begins_after_i12_and_takes_an_interrupt_at_least() -> None:
    made = motion([rapid(X=100.0)], settings={**PLAIN, 12: 10})
    assert made.duration_ms == pytest.approx(10 + 10 + 10)
    assert made.at(10.0) == 0.0
    assert made.at(20.0) == pytest.approx(50.0)
    settings = {**PLAIN, 192: 7.0, 292: 30.0, 190: 0, 290: 0}
    assert motion([rapid(X=100.0, Y=10.0)], TWO, settings, dialect=TURBO).duration_ms == pytest.approx(30 + 20)
    assert motion([rapid(X=100.0)], settings=settings, dialect=TURBO).duration_ms == pytest.approx(7 + 20)
    # A loop of such moves would never let go of the time.
    made = motion([rapid(X=0.0), rapid(X=0.0)], settings=PLAIN)
    assert made.duration_ms == pytest.approx(2 * INTERRUPT_MS)
    made = motion([rapid(X=100.0)], settings={**PLAIN, 120: 0.0})
    assert made.duration_ms == pytest.approx(10 + 1)


# Rotary axes: which way round an absolute move goes (Ix27).

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


def test_a_positive_ix27_takes_the_shorter_way_and_without_it_nothing_rolls_over() -> None:
    assert turned(350.0, 20.0, 210.0, 15.0, roll=36_000) == pytest.approx([-10.0, 20.0, -150.0, 15.0])
    assert turned(350.0, 20.0, roll=0) == pytest.approx([350.0, 20.0])


@pytest.mark.parametrize("axis", ["A", "B", "C"])
def test_only_a_b_and_c_roll_over(axis: str) -> None:
    assert turned(350.0, roll=36_000, definition=f"#1->100{axis}") == pytest.approx([-10.0])
    assert turned(350.0, roll=36_000, definition="#1->100Z") == pytest.approx([350.0])


def test_a_negative_ix27_takes_the_sign_as_the_direction() -> None:
    """A-90 is -90 degrees, which is +270, in the negative direction."""
    assert turned(90.0, -90.0, 45.0, -300.0, roll=-36_000) == pytest.approx([90.0, -90.0, 45.0, -300.0])
    assert turned(90.0, 0.0000001, roll=-36_000) == pytest.approx([90.0, 360.0])
    assert turned(90.0, -0.0000001, roll=-36_000) == pytest.approx([90.0, 0.0], abs=1e-6)
    assert turned(90.0, 0.0000001, roll=-36_000, definition="#1->-100C") == pytest.approx([-90.0, -360.0])


def test_a_motor_that_stands_there_stays_and_an_incremental_move_goes_as_far_as_it_says() -> None:
    assert turned(90.0, 90.0, 450.0, roll=-36_000) == pytest.approx([90.0, 90.0, 90.0])
    assert turned(90.0, 450.0, roll=36_000) == pytest.approx([90.0, 90.0])
    # To 350 by the shorter way, and 30 on: the program calls that 380, the motor is at 20.
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
