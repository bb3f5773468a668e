"""The worked numbers of the manuals, as the programs that they are about."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import pytest

from drivers.pmac.axes import axis_positions, read_definitions
from drivers.pmac.dialect import PMAC
from drivers.pmac.execution.move_times import Modes
from drivers.pmac.execution.run import ProgramRun
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.structure import link
from drivers.pmac.trajectory.planner import MotionPlanner
from drivers.pmac.variables import VariableStore
from tests.drivers.trajectory.motion import Motion, plans

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


def test_number_2_a_single_triangle_move() -> None:
    """X1, TA10 TS0 TM10: 20 ms in all, 0.1 unit/ms at the peak."""
    made = played(["TA10 TS0 TM10", "X1"])
    assert made.duration_ms == pytest.approx(20.0)
    assert made.peak_velocity() == pytest.approx(0.1)


@pytest.mark.parametrize(("ts", "peak"), [(0, 0.75), (5, 5 / 6)])
def test_number_4_a_reversal(ts: int, peak: float) -> None:
    """X1 then X-1, incremental, TA10 TM10: it turns at 0.75, or at 0.8333 with TS5, and takes 30 ms."""
    made = played([f"INC TA10 TS{ts} TM10", "X1", "X-1"])
    assert made.duration_ms == pytest.approx(30.0)
    assert made.at(15.0) == pytest.approx(peak)
    assert made.velocity(15.0) == pytest.approx(0.0, abs=1e-12)
    assert made.end() == pytest.approx(0.0, abs=1e-12)


def test_number_6_ix16_stretches_the_move() -> None:
    """1000 counts a unit, Ix16 32: X100 in TM1000 would be 100 counts/ms, so it takes 3125 ms."""
    made = played(["TA10 TS0 TM1000", "X100"], ["#1->1000X"], {116: 32.0})
    assert made.duration_ms == pytest.approx(3125 + 10)
    assert made.peak_velocity() == pytest.approx(32.0)


def test_number_7_a_feedrate_is_that_of_its_axes() -> None:
    """FRAX(X,Y), INC X30 Y40 Z10 F100: 0.5 s, and X 60, Y 80, Z 20 units/s."""
    made = played(["FRAX(X,Y) INC TA10 TS0 F100", "X30 Y40 Z10"], ["#1->X", "#2->Y", "#3->Z"])
    assert made.duration_ms == pytest.approx(500 + 10)
    speeds = [1000.0 * made.velocity(255.0, motor) for motor in range(3)]
    assert speeds == pytest.approx([60.0, 80.0, 20.0])


def test_number_8_the_way_points_of_a_spline() -> None:
    """0, 1, 0: two thirds at the middle. Points that alternate between 1 and -1 come to a third."""
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
    lines = [
        "ABS RAPID X10 Y0",
        "LINEAR TA20 TS5 F20 X20",
        "CIRCLE2 X30 Y10 R10",
        "CIRCLE1 X40 Y20 I10",
        "LINEAR X0 Y0",
    ]
    jogs = {12: 10.0, 119: 0.0, 120: 10.0, 121: 0.0, 122: 50.0, 219: 0.0, 220: 10.0, 221: 0.0, 222: 50.0}
    made = played(lines, ["#1->1000X", "#2->1000Y"], {13: 10.0, **jogs})
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
