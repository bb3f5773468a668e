"""LINEAR moves against the manual's numbers, and against velocity steps convolved with two boxes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.axes import axis_positions, read_definitions
from drivers.pmac.dialect import PMAC
from drivers.pmac.execution.move_times import Modes
from drivers.pmac.execution.run import ProgramRun
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.structure import link
from drivers.pmac.requests import BlendBreak, DwellRequest, Halt, LinearRequest, Request
from drivers.pmac.trajectory.linear import (
    Limits,
    LinearMove,
    NoAccelerationTimeError,
    Timing,
    at_rest,
    effective_timing,
    lay,
    stop,
)
from drivers.pmac.trajectory.pieces import Piece, position_at, velocity_at
from drivers.pmac.trajectory.planner import MotionPlanner
from drivers.pmac.variables import VariableStore
from tests.drivers.trajectory.motion import (
    Motion,
    assert_smooth,
    circle,
    linear,
    motion,
    planner_for,
    plans,
    pvt,
    rapid,
    splined,
)

FREE = Limits(velocity=(0.0,), acceleration=(0.0,))


def trajectory(distances: list[float], ta: float, ts: float, tm: float, limits: Limits = FREE) -> list[Piece]:
    blend = at_rest((0.0,))
    pieces: list[Piece] = []
    for distance in distances:
        laid, blend, _ = lay(blend, LinearMove(distance=(distance,), ta_ms=ta, ts_ms=ts, tm_ms=tm), limits)
        pieces.extend(laid)
    pieces.extend(stop(blend, ta, ts, limits))
    return pieces


def sample(pieces: list[Piece], times: np.ndarray) -> np.ndarray:
    positions = np.empty_like(times)
    start = 0.0
    for piece in pieces:
        inside = (times >= start - 1e-12) & (times <= start + piece.duration_ms + 1e-12)
        positions[inside] = [position_at(piece.cubics[0], t - start) for t in times[inside]]
        start += piece.duration_ms
    return positions


def timing(ta: float, ts: float, tm: float, distance: float = 0.0, limits: Limits = FREE) -> Timing:
    return effective_timing(LinearMove(distance=(distance,), ta_ms=ta, ts_ms=ts, tm_ms=tm), (0.0,), limits)


def test_acceleration_times_are_two_s_curves_at_least_and_moves_are_no_shorter() -> None:
    assert timing(10, 10, 100).ta_ms == 20
    assert timing(0, 7, 100).ta_ms == 14
    assert timing(20, 5, 100).ta_ms == 20
    assert timing(10, 10, 10).tm_ms == 20
    assert timing(10, 5, 10).tm_ms == 10
    assert timing(10, 0, 25).tm_ms == 25
    with pytest.raises(NoAccelerationTimeError):
        timing(0, 0, 10)


@pytest.mark.parametrize("distance", [100_000, -100_000])
def test_ix16_stretches_the_move_time(distance: float) -> None:
    limits = Limits(velocity=(32.0,), acceleration=(0.0,))
    assert timing(10, 0, 1000, distance=distance, limits=limits).tm_ms == 3125


def test_ix16_stretches_the_move_time_and_slows_the_paper_spindle_to_192_rpm() -> None:
    limits = Limits(velocity=(32.0,), acceleration=(0.0,))
    used = timing(10, 10, 10, distance=10_000 / 6, limits=limits)
    assert used.tm_ms == pytest.approx(52.08, abs=0.01)
    assert 60_000 / (6 * used.tm_ms) == pytest.approx(192.0)


def test_ix17_lengthens_the_acceleration_even_for_the_stop_that_may_follow() -> None:
    limits = Limits(velocity=(0.0,), acceleration=(0.01,))
    used = timing(10, 0, 1000, distance=1000, limits=limits)
    assert used.ta_ms == pytest.approx(100)
    pieces = trajectory([1000], 10, 0, 1000, limits)
    peak = max(abs(2 * p.cubics[0][2] + 6 * p.cubics[0][3] * t) for p in pieces for t in (0, p.duration_ms))
    assert peak == pytest.approx(0.01)
    # At 1 count/ms before and in the move: the stop that may follow takes 1 / 0.01 ms.
    limits = Limits(velocity=(0.0,), acceleration=(0.01,))
    goes_on = LinearMove(distance=(1000.0,), ta_ms=10.0, ts_ms=0.0, tm_ms=1000.0)
    assert effective_timing(goes_on, (1.0,), limits).ta_ms == pytest.approx(100.0)


@pytest.mark.parametrize(("ta", "ts", "kept"), [(20, 10, 2 / 3), (20, 0, 1 / 2), (10, 5, 5 / 6), (10, 0, 3 / 4)])
def test_zig_zag_keeps_the_share_of_its_stroke_that_the_rules_leave(ta: float, ts: float, kept: float) -> None:
    """Peak to peak of alternating moves is 1 - TA/(3 TM) with full S-curves, 1 - TA/(2 TM) with ramps."""
    pieces = trajectory([275.0, -275.0] * 6, ta, ts, 20)
    times = np.linspace(60, 180, 24_001)
    positions = sample(pieces, times)
    assert np.ptp(positions) == pytest.approx(275 * kept, rel=1e-6)


def test_a_long_blend_is_cut_to_the_room_in_the_move_before_it() -> None:
    """TA(i+1) <= 2 (TM(i) - TA(i)/2)."""
    blend = at_rest((0.0,))
    _, blend, _ = lay(blend, LinearMove(distance=(10.0,), ta_ms=10, ts_ms=0, tm_ms=12), FREE)
    _, _, used = lay(blend, LinearMove(distance=(100.0,), ta_ms=50, ts_ms=20, tm_ms=200), FREE)
    assert used.ta_ms == pytest.approx(2 * (12 - 5))
    assert used.ts_ms == pytest.approx(7)


@given(
    moves=st.lists(
        st.tuples(st.integers(-500, 500), st.integers(1, 40), st.integers(0, 30), st.integers(1, 60)),
        min_size=1,
        max_size=8,
    )
)
def test_any_sequence_is_continuous_and_ends_where_it_was_told(moves: list[tuple[int, int, int, int]]) -> None:
    blend = at_rest((0.0,))
    pieces: list[Piece] = []
    for distance, ta, ts, tm in moves:
        move = LinearMove(distance=(float(distance),), ta_ms=ta, ts_ms=ts, tm_ms=tm)
        laid, blend, _ = lay(blend, move, FREE)
        pieces.extend(laid)
    pieces.extend(stop(blend, moves[-1][1], moves[-1][2], FREE))
    position, velocity = 0.0, 0.0
    for piece in pieces:
        assert piece.duration_ms > 0
        assert position_at(piece.cubics[0], 0.0) == pytest.approx(position, abs=1e-6)
        assert velocity_at(piece.cubics[0], 0.0) == pytest.approx(velocity, abs=1e-7)
        position = position_at(piece.cubics[0], piece.duration_ms)
        velocity = velocity_at(piece.cubics[0], piece.duration_ms)
    assert position == pytest.approx(sum(move[0] for move in moves), abs=1e-6)
    assert velocity == pytest.approx(0, abs=1e-7)


# LINEAR moves with constant TA and TS against velocity steps convolved with two boxes, in exact fractions.
#
# The velocity of a LINEAR sequence is the steps of its moves convolved with a box of TA - TS and one of TS. Each
# step of the velocity therefore adds its height times a fixed curve, which is written down below with truncated
# powers; nothing of it is in the planner.


def after(t: Fraction, power: int) -> Fraction:
    return t**power if t > 0 else Fraction(0)


def risen(t: Fraction, wide: int, narrow: int) -> Fraction:
    """The double integral of a step of velocity 1 at 0, convolved with boxes of these widths."""
    if narrow == 0:
        return (after(t, 2) - after(t - wide, 2)) / (2 * wide)
    corners = after(t, 3) - after(t - wide, 3) - after(t - narrow, 3) + after(t - wide - narrow, 3)
    return corners / (6 * wide * narrow)


def expected(distances: list[int], ta: int, ts: int, tms: list[int], t: Fraction) -> Fraction:
    position, boundary, before = Fraction(0), Fraction(0), Fraction(0)
    for distance, tm in zip(distances, tms, strict=True):
        velocity = Fraction(distance, tm)
        position += (velocity - before) * risen(t - boundary, ta - ts, ts)
        before, boundary = velocity, boundary + tm
    return position - before * risen(t - boundary, ta - ts, ts)


def sequence(distances: list[int], ta: int, ts: int, tms: list[int]) -> Motion:
    position, requests = 0, []
    for distance, tm in zip(distances, tms, strict=True):
        position += distance
        requests.append(linear(ta, ts, tm, X=float(position)))
    return motion(requests, settings={187: ta, 188: ts})


@given(
    moves=st.lists(st.tuples(st.integers(-1000, 1000), st.integers(0, 20)), min_size=1, max_size=7),
    ts=st.integers(0, 8),
    plateau=st.integers(0, 9),
)
def test_blending_is_steps_convolved_with_two_boxes(moves: list[tuple[int, int]], ts: int, plateau: int) -> None:
    ta = 2 * ts + plateau or 1
    distances, tms = [distance for distance, _ in moves], [ta + extra for _, extra in moves]
    made = sequence(distances, ta, ts, tms)
    stroke = max(1.0, sum(abs(distance) for distance in distances))
    total = sum(tms) + ta
    assert made.duration_ms == pytest.approx(total, abs=1e-9)
    for t in (Fraction(total * k, 40) for k in range(41)):
        assert made.at(float(t)) == pytest.approx(float(expected(distances, ta, ts, tms, t)), abs=1e-9 * stroke)
    assert_smooth(made.pieces, (0.0,), stroke)


@pytest.mark.parametrize(("ta", "ts"), [(20, 0), (20, 5), (20, 10)])
def test_rule_1_to_3_at_the_boundary_the_path_is_off_its_point_by_the_known_share(ta: int, ts: int) -> None:
    """(v2 - v1) [(TA - TS)/8 + TS^2 / (24 (TA - TS))]."""
    made = sequence([40, 120], ta, ts, [40, 40])
    off = (3.0 - 1.0) * ((ta - ts) / 8 + ts**2 / (24 * (ta - ts)))
    assert made.at(ta / 2 + 40) - 40.0 == pytest.approx(off, abs=1e-12)


def test_the_ta_in_force_shapes_the_stop_and_the_register_bounds_the_time_of_a_move() -> None:
    made = motion([linear(10, 0, 100, X=100.0)], settings={187: 50, 188: 0})
    assert made.duration_ms == pytest.approx(10 / 2 + 100 + 50 / 2)
    made = motion([linear(10, 0, 1e9, X=1.0)])
    assert made.duration_ms == pytest.approx(8_388_607 + 10)
    # TA/2 + sum of TM + TA/2, also when the times differ from move to move.
    made = motion([linear(10, 0, 30, X=1.0), linear(20, 5, 40, X=5.0)], settings={187: 20, 188: 5})
    assert made.duration_ms == pytest.approx(10 / 2 + 30 + 40 + 20 / 2)


# The worked numbers of the manuals, as the programs that they are about.

SHARP = {117: 0.0, 217: 0.0, 317: 0.0}
"""No Ix17, of which the worked numbers know nothing."""


def played(
    lines: Sequence[str], definitions: Sequence[str] = ("#1->X",), settings: Mapping[int, float] | None = None
) -> Motion:
    """A program from its text to its motion, from 0."""
    read = read_definitions(definitions)
    variables = VariableStore({**PMAC.factory, **SHARP, **(settings or {})})
    positions = axis_positions({d.motor: d for d in read}, {d.motor: 0.0 for d in read})
    run = ProgramRun(link(tuple(parse_line(line) for line in lines)), variables, Modes(), positions)
    planner = MotionPlanner(run, read, variables, tuple(0.0 for _ in read))
    return Motion(tuple(piece for planned in plans(planner) for piece in planned.pieces))


def test_numbers_2_and_6_a_triangle_and_a_move_that_ix16_stretches() -> None:
    """X1, TA10 TS0 TM10: 20 ms in all, 0.1 unit/ms at the peak."""
    made = played(["TA10 TS0 TM10", "X1"])
    assert made.duration_ms == pytest.approx(20.0)
    assert made.peak_velocity() == pytest.approx(0.1)
    # 1000 counts a unit, Ix16 32: X100 in TM1000 would be 100 counts/ms, so it takes 3125 ms.
    made = played(["TA10 TS0 TM1000", "X100"], ["#1->1000X"], {116: 32.0})
    assert made.duration_ms == pytest.approx(3125 + 10)
    assert made.peak_velocity() == pytest.approx(32.0)


@pytest.mark.parametrize(("ts", "peak"), [(0, 0.75), (5, 5 / 6)])
def test_number_4_a_reversal(ts: int, peak: float) -> None:
    """X1 then X-1, incremental, TA10 TM10: it turns at 0.75, or at 0.8333 with TS5, and takes 30 ms."""
    made = played([f"INC TA10 TS{ts} TM10", "X1", "X-1"])
    assert made.duration_ms == pytest.approx(30.0)
    assert made.at(15.0) == pytest.approx(peak)
    assert made.velocity(15.0) == pytest.approx(0.0, abs=1e-12)
    assert made.end() == pytest.approx(0.0, abs=1e-12)


def test_numbers_7_and_8_a_feedrate_and_the_way_points_of_a_spline() -> None:
    """FRAX(X,Y), INC X30 Y40 Z10 F100: 0.5 s, and X 60, Y 80, Z 20 units/s."""
    made = played(["FRAX(X,Y) INC TA10 TS0 F100", "X30 Y40 Z10"], ["#1->X", "#2->Y", "#3->Z"])
    assert made.duration_ms == pytest.approx(500 + 10)
    speeds = [1000.0 * made.velocity(255.0, motor) for motor in range(3)]
    assert speeds == pytest.approx([60.0, 80.0, 20.0])
    # 0, 1, 0: two thirds at the middle. Points that alternate between 1 and -1 come to a third.
    middle = played(["SPLINE1 TA10", "X1", "X0"])
    assert middle.at(20.0) == pytest.approx(2 / 3)
    alternating = played(["SPLINE1 TA10", *["X1", "X-1"] * 5])
    assert [alternating.at(10.0 * k) for k in (3, 4, 5)] == pytest.approx([-1 / 3, 1 / 3, -1 / 3])


def test_a_full_circle_by_its_centre_as_the_manual_programs_it() -> None:
    """Back to the start by an incremental vector; F counts along the circumference."""
    made = played(["NORMAL K-1 INC CIRCLE1 TA10 TS0 F10", "X0 Y0 I10"], ["#1->1000X", "#2->1000Y"], {13: 5.0})
    assert made.duration_ms == pytest.approx(2 * math.pi * 10.0 / 10.0 * 1000.0 + 10.0)
    top = made.at(5.0 + made.duration_ms / 4, 1)
    assert top == pytest.approx(10_000.0, abs=1.0)


def test_a_contour_of_rapid_straight_moves_and_arcs_takes_the_sum_of_its_times() -> None:
    """RAPID: I12, the way at Ix22 and 10 ms; the contour of 10, two quarters and the way back, at F, and TA."""
    lines = ["ABS RAPID X10 Y0", "LINEAR TA20 TS5 F20 X20", "CIRCLE2 X30 Y10 R10", "CIRCLE1 X40 Y20 I10"]
    jogs = {12: 10.0, 119: 0.0, 120: 10.0, 121: 0.0, 122: 50.0, 219: 0.0, 220: 10.0, 221: 0.0, 222: 50.0}
    made = played([*lines, "LINEAR X0 Y0"], ["#1->1000X", "#2->1000Y"], {13: 10.0, **jogs})
    length = 10 + 2 * 10 * math.pi / 2 + math.hypot(40, 20)
    assert made.duration_ms == pytest.approx(10 + 10_000 / 50 + 10 + length / 20 * 1000 + 20)
    assert (made.end(0), made.end(1)) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_a_program_goes_to_an_absolute_angle_by_the_shorter_way_and_an_incremental_one_as_told() -> None:
    """100 counts a degree, Ix27 36000: C350 is -10, INC C30 from there 20, ABS C300 then -60."""
    lines = ["TA10 TS0 TM100 C350", "DWELL10", "INC C30", "DWELL10", "ABS C300"]
    made = played(lines, ["#1->100C"], {127: 36_000.0})
    assert made.at(115.0) == pytest.approx(-1000.0)
    assert made.at(235.0) == pytest.approx(2000.0)
    assert made.end() == pytest.approx(-6000.0)


# Any move after any other, with errors and steps among them: the commanded motion never jumps.

TURNED = ("#1->866X-500Y+10", "#2->500X+866Y", "#3->-40C")
RATES = (0.5, 0.5, 0.5)

COORDINATES = st.integers(-50, 50).map(float)
TARGETS = st.fixed_dictionaries({"X": COORDINATES, "Y": COORDINATES, "C": st.integers(-400, 400).map(float)})
MS = st.integers(1, 120).map(float)
BLEND = st.fixed_dictionaries({"ta": st.integers(0, 60).map(float), "ts": st.integers(0, 30).map(float)})


def round_trip(request: LinearRequest, absolute: bool) -> LinearRequest:
    return LinearRequest(
        line=0,
        targets=request.targets,
        ta_ms=request.ta_ms,
        ts_ms=request.ts_ms,
        tm_ms=request.tm_ms,
        absolute=frozenset("C") if absolute else frozenset(),
    )


LINEAR = st.builds(
    lambda targets, blend, tm, absolute: round_trip(linear(tm=tm, **blend, **targets), absolute),
    TARGETS,
    BLEND,
    MS,
    st.booleans(),
)
CIRCLE = st.builds(
    lambda targets, blend, tm, i, j, clockwise: circle(
        targets, {"X": i, "Y": j}, tm=tm, clockwise=clockwise, **blend
    ),
    TARGETS,
    BLEND,
    MS,
    COORDINATES,
    COORDINATES,
    st.booleans(),
)
RADIUS = st.builds(lambda targets, radius, tm: circle(targets, radius=radius, tm=tm), TARGETS, COORDINATES, MS)
RAPID = st.builds(lambda targets: rapid(**targets), TARGETS)
SPLINE = st.builds(
    lambda targets, ms, uniform: splined(ms, uniform=uniform, **targets),
    TARGETS,
    st.sampled_from([0.0, 10.0, 10.0, 35.0]),
    st.booleans(),
)
PVT = st.builds(
    lambda targets, ms, velocity: pvt(ms, velocity, **targets), TARGETS, MS, st.sampled_from([0.0, 0.0, 0.3])
)
PAUSES = st.sampled_from([DwellRequest(duration_ms=0.0), DwellRequest(duration_ms=20.0), BlendBreak(), Halt()])


@given(
    requests=st.lists(st.one_of(LINEAR, LINEAR, CIRCLE, CIRCLE, RADIUS, RAPID, SPLINE, PVT, PAUSES), max_size=10),
    steps=st.sets(st.integers(0, 9)),
    variables=st.fixed_dictionaries(
        {
            13: st.sampled_from([0.0, 10.0]),
            11: st.sampled_from([0.0, 5.0]),
            192: st.sampled_from([0.0, 0.0, 1.0]),
            117: st.sampled_from([0.0, 2.0]),
            327: st.sampled_from([0.0, 14_400.0, -14_400.0]),
        }
    ),
)
def test_position_and_velocity_never_jump(
    requests: list[Request], steps: set[int], variables: dict[int, float]
) -> None:
    """A run-time error, here and there, halts the motion; the program is then run on, as after R."""
    planner = planner_for(requests, TURNED, variables)
    pieces: list[Piece] = []
    for number in range(len(requests) + 20):
        try:
            planned = planner.plan()
            pieces += planned.pieces
            if planned.finished:
                break
            if number in steps:
                pieces += planner.settle()
        except PmacError:
            pieces += planner.halt(RATES)
    else:
        pytest.fail("no end")
    assert_smooth(pieces, (10.0, 0.0, 0.0), 100_000.0)
