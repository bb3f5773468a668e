"""Every move as the checker reports it: the point really reached, the way made, the peaks.

The oracle of the property is no ramp: velocity steps convolved with two boxes of the widths TA - TS and TS,
integrated in closed form.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.analysis.moves import MoveAnalysis, analyse_moves
from drivers.pmac.analysis.timeline import Timeline
from drivers.pmac.analysis.walk import walk
from drivers.pmac.axes import read_definitions
from drivers.pmac.program_text import read_program

FREE = {190: 1000.0}
"""No limit of velocity or acceleration; speeds are per second."""


def analysed(
    lines: str, variables: dict[int, float] | None = None, axes: Sequence[str] = ("#1->X",)
) -> tuple[MoveAnalysis, ...]:
    definitions = read_definitions(axes)
    text = read_program(f"OPEN PROG 1\nCLEAR\n{lines}\nCLOSE")
    walked = walk(text, variables or FREE, definitions, {d.motor: 0.0 for d in definitions})
    assert walked.error is None
    return analyse_moves(walked, Timeline(walked.pieces))


def reached(moves: Sequence[MoveAnalysis]) -> list[float]:
    return [move.motors[0].reached for move in moves]


@pytest.mark.parametrize(("ts", "divisor"), [(0, 4), (10, 6)])
def test_a_zig_zag_turns_round_short_of_its_point(ts: int, divisor: int) -> None:
    """v TA/4 with straight ramps, v TA/6 with full S-curves; v = 300/40 counts/ms, TA 20 ms."""
    moves = analysed(f"INC TA20 TS{ts} TM40\n" + "X300\nX-300\n" * 3)
    short = 300 / 40 * 20 / divisor
    assert reached(moves[:-1]) == pytest.approx([300 - short, short, 300 - short, short, 300 - short])
    assert [move.motors[0].turns for move in moves] == [True] * 5 + [False]
    assert moves[2].motors[0].made == pytest.approx(300 - 2 * short)
    assert moves[2].motors[0].lost == pytest.approx(2 * short)


@pytest.mark.parametrize(("ts", "divisor"), [(0, 8), (10, 12)])
def test_a_blended_corner_is_passed_inside(ts: int, divisor: int) -> None:
    """(v2 - v1) TA/8 with straight ramps, TA/12 with full S-curves, at the nominal end."""
    moves = analysed(f"INC TA20 TS{ts} TM40\nX40\nX120")
    assert moves[0].motors[0].reached == pytest.approx(40 + (3 - 1) * 20 / divisor)
    assert not moves[0].motors[0].turns
    assert moves[1].motors[0].reached == 160


def test_peaks_of_one_move_are_those_of_the_manuals_figure() -> None:
    """X100 in TM100, TA40 TS10: 1 count/ms, 1/(TA - TS) counts/ms2, 1/((TA - TS) TS) counts/ms3."""
    (move,) = analysed("INC TA40 TS10 TM100\nX100")
    peaks = move.motors[0].peaks
    assert peaks.velocity == pytest.approx(1)
    assert peaks.acceleration == pytest.approx(1 / 30)
    assert peaks.jerk == pytest.approx(1 / 300)
    assert (move.begins_ms, move.ends_ms) == (20, 120)


def test_without_an_s_curve_the_jerk_has_no_value() -> None:
    (move,) = analysed("INC TA40 TS0 TM100\nX100")
    assert move.motors[0].peaks.jerk is None


def test_moves_that_are_not_blended_reach_their_points() -> None:
    moves = analysed("INC TA20 TS10 TM40\nX300\nDWELL0\nX-300\nDWELL10\nX50")
    assert reached(moves) == [300, 0, 50]
    assert [move.blended for move in moves] == [False, False, False]


def test_with_blending_switched_off_every_move_reaches_its_point() -> None:
    moves = analysed("INC TA20 TS10 TM40\nX300\nX-300\nX50", {**FREE, 192: 1.0})
    assert reached(moves) == [300, 0, 50]


def test_pvt_goes_through_its_points() -> None:
    moves = analysed("ABS PVT20\nX10:1\nX40:1\nX50:0")
    assert reached(moves) == pytest.approx([10, 40, 50])
    assert [move.mode for move in moves] == ["PVT"] * 3
    assert moves[1].motors[0].peaks.velocity == pytest.approx(1.5 * 30 / 20, rel=1e-3)


def test_a_spline_passes_inside_its_points() -> None:
    """The way-point of SPLINE1 is (P0 + 4 P1 + P2)/6: 0, 1, 0 gives 2/3."""
    moves = analysed("ABS TA20 SPLINE1\nX1\nX0")
    assert [move.mode for move in moves] == ["SPLINE", "SPLINE"]
    assert moves[0].motors[0].reached == pytest.approx(2 / 3)
    assert moves[1].motors[0].reached == 0


def test_a_rapid_move_reaches_its_point() -> None:
    variables = {**FREE, 116: 30.0, 119: 1.0, 120: 100.0, 121: 20.0, 122: 10.0}
    moves = analysed("INC RAPID X1000\nTA20 TS10 TM40 LINEAR X40\nX-40", variables)
    assert [move.mode for move in moves] == ["RAPID", "LINEAR", "LINEAR"]
    assert reached(moves)[0] == 1000
    assert moves[0].motors[0].peaks.velocity == pytest.approx(10)
    assert moves[1].motors[0].reached == pytest.approx(1040 - 1 * 20 / 6)


def test_a_rapid_move_has_its_own_peaks_in_front_of_a_spline() -> None:
    """Jogged at 10 counts/ms; the spline of 0, 0, 3000, 3000 is at 3/4 of 3000 counts in 20 ms in its middle."""
    variables = {**FREE, 119: 1.0, 120: 100.0, 121: 20.0, 122: 10.0}
    moves = analysed("INC RAPID X1000\nTA20 SPLINE1 X3000", variables)
    assert [move.mode for move in moves] == ["RAPID", "SPLINE"]
    assert moves[0].motors[0].peaks.velocity == pytest.approx(10)
    assert moves[1].motors[0].peaks.velocity == pytest.approx(0.75 * 3000 / 20)


def test_a_rapid_move_does_not_have_the_stop_of_the_move_before_it() -> None:
    """I12 = 0: the jog at 10 counts/ms follows the stop from 100 counts/ms at once."""
    variables = {**FREE, 12: 0.0, 119: 1.0, 120: 100.0, 121: 20.0, 122: 10.0}
    moves = analysed("INC TA20 TS10 TM40\nX4000\nRAPID X1000", variables)
    assert moves[0].motors[0].peaks.velocity == pytest.approx(100)
    assert moves[1].motors[0].peaks.velocity == pytest.approx(10)
    assert moves[1].begins_ms == pytest.approx(moves[0].ends_ms + 10)


def test_after_a_home_the_motor_is_at_zero() -> None:
    moves = analysed("INC TA20 TS10 TM40\nX300\nHOME1\nX100")
    assert [move.motors[0].target for move in moves] == [300, 100]
    assert moves[1].motors[0].commanded == moves[1].motors[0].made == 100


def test_after_a_preset_the_axis_counts_from_another_place() -> None:
    """The motor stands at 300 counts; that is X50 from now on, and X60 is 10 counts further."""
    moves = analysed("ABS TA20 TS10 TM40\nX300\nPSET X50\nX60")
    assert moves[1].motors[0].target == pytest.approx(310)
    assert moves[1].motors[0].commanded == pytest.approx(10)


def test_a_stop_in_the_program_is_gone_on_from() -> None:
    moves = analysed("INC TA20 TS10 TM40\nX300\nSTOP\nX100")
    assert reached(moves) == [300, 400]


def test_every_motor_has_its_own_point() -> None:
    moves = analysed("INC TA20 TS10 TM20\n" + "X275 Y1000\nX-275 Y1000\n" * 2, axes=("#1->X", "#2->Y"))
    tool, spindle = moves[1].motors
    assert (tool.motor, spindle.motor) == (1, 2)
    assert tool.made == pytest.approx(-275 * 2 / 3)
    assert spindle.made == pytest.approx(1000)
    assert not spindle.turns


def test_a_program_that_is_called_moves_too() -> None:
    text = read_program("OPEN PROG 1\nCLEAR\nINC TA20 TS10 TM40\nCALL 5\nX10\nCLOSE\nOPEN PROG 5\nX30\nCLOSE")
    definitions = read_definitions(["#1->X"])
    walked = walk(text, FREE, definitions, {1: 0.0})
    moves = analyse_moves(walked, Timeline(walked.pieces))
    assert [(move.program, move.line) for move in moves] == [(5, 0), (1, 2)]


def ramp_integral(t: float, ta: float, ts: float) -> float:
    """The way of a unit velocity step after two boxes of ta - ts and ts, at time t."""

    def power(x: float, n: int) -> float:
        return max(x, 0.0) ** n

    wide = ta - ts
    if ts == 0:
        return (power(t, 2) - power(t - wide, 2)) / (2 * wide)
    return (power(t, 3) - power(t - wide, 3) - power(t - ts, 3) + power(t - ta, 3)) / (6 * wide * ts)


def convolved(distances: Sequence[int], ta: float, ts: float, tm: float, t: float) -> float:
    """The position at a time from the start of motion."""
    return sum(
        d / tm * (ramp_integral(t - i * tm, ta, ts) - ramp_integral(t - (i + 1) * tm, ta, ts))
        for i, d in enumerate(distances)
    )


def turning_point(distances: Sequence[int], place: int, ta: float, ts: float, tm: float) -> float:
    """The extreme of the convolved path around the end of a move, by golden section."""
    sign, boundary = math.copysign(1, distances[place]), (place + 1) * tm + ta / 2
    low, high = boundary - ta / 2, boundary + ta / 2
    ratio = (5**0.5 - 1) / 2
    for _ in range(80):
        one, two = high - ratio * (high - low), low + ratio * (high - low)
        if sign * convolved(distances, ta, ts, tm, one) > sign * convolved(distances, ta, ts, tm, two):
            high = two
        else:
            low = one
    return convolved(distances, ta, ts, tm, (low + high) / 2)


@given(
    distances=st.lists(st.integers(-1000, 1000), min_size=1, max_size=6),
    ts=st.integers(0, 8),
    plateau=st.integers(1, 10),
    extra=st.integers(0, 20),
)
def test_reached_points_are_those_of_the_convolved_path(
    distances: list[int], ts: int, plateau: int, extra: int
) -> None:
    ta = 2 * ts + plateau
    tm = ta + extra
    moves = analysed(f"INC TA{ta} TS{ts} TM{tm}\n" + "\n".join(f"X{d}" for d in distances))
    expected = []
    for place, (distance, after) in enumerate(zip(distances, [*distances[1:], 0], strict=True)):
        boundary = (place + 1) * tm + ta / 2
        if place == len(distances) - 1:
            expected.append(float(sum(distances)))
        elif distance * after < 0:
            expected.append(turning_point(distances, place, ta, ts, tm))
        else:
            expected.append(convolved(distances, ta, ts, tm, boundary))
    assert reached(moves) == pytest.approx(expected, abs=1e-6)
    made = [b - a for a, b in zip([0.0, *expected], expected, strict=False)]
    assert [move.motors[0].made for move in moves] == pytest.approx(made, abs=1e-6)
