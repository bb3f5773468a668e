"""What the checker finds in programs that are not the paper's."""

from __future__ import annotations

import math

import pytest

from drivers.pmac.analysis.findings import Code, ProgramFinding
from drivers.pmac.analysis.moves import fold
from drivers.pmac.analysis.program import ProgramCheck, check_program
from profiles.findings import Severity
from profiles.machine import MachineProfile

HEAD = "OPEN PROG 1\nCLEAR\nLINEAR INC\n"


def checked(
    lines: str,
    machine: MachineProfile,
    before: str = "",
    ta_ms: float | None = None,
    ts_ms: float | None = None,
) -> ProgramCheck:
    return check_program(f"{before}{HEAD}{lines}\nCLOSE\n", machine, ta_ms, ts_ms)


def only(found: ProgramCheck, code: Code) -> ProgramFinding:
    (finding,) = [finding for finding in found.findings if finding.code is code]
    return finding


def codes(found: ProgramCheck) -> set[Code]:
    return {finding.code for finding in found.findings}


def zig_zag(turns: int, lobes: int = 3, tm: float = 20) -> str:
    """A cut of whole turns: two moves for each lobe."""
    per_move = f"(10000/{2 * lobes})"
    return f"TA10 TS0 TM{tm}\n" + f"X100 Y{per_move}\nX-100 Y{per_move}\n" * (lobes * turns)


def test_a_clean_program_has_no_finding(machine: MachineProfile) -> None:
    found = checked("TA100 TS20 TM500\nX1000\nDWELL10\nX-1000", machine)
    assert found.findings == ()
    assert found.worst is Severity.OK
    assert found.explanation == ()


def test_ix16_stretches_a_move(machine: MachineProfile) -> None:
    """X100000 in 100 ms asks for 1000 counts/ms; I116 is 500."""
    finding = only(checked("TA20 TS0 TM100\nX100000\nX-100000", machine), Code.STRETCHED_BY_VELOCITY)
    assert (finding.severity, finding.values["variable"]) == (Severity.WARNING, "I116")
    assert finding.values["asked_ms"] == 100
    assert finding.values["used_ms"] == pytest.approx(200)


def test_ix17_lengthens_the_acceleration(machine: MachineProfile) -> None:
    """The spindle from 0 to 200 counts/ms at 39.79 counts/ms2 takes 5.03 ms, TA1 is asked for."""
    found = checked("TA1 TS0 TM100\nY20000", machine)
    assert only(found, Code.RAMP_LENGTHENED).values["used_ms"] == pytest.approx(200 / 39.79)
    found = checked("TA1 TS0 TM3\nY600", machine)
    assert only(found, Code.STRETCHED_BY_ACCELERATION).values["used_ms"] == pytest.approx(200 / 39.79)


def test_a_blend_without_room_is_shortened(machine: MachineProfile) -> None:
    """TA(i+1) <= 2 (TM(i) - TA(i)/2) = 2 (12 - 5)."""
    finding = only(checked("TA10 TS0 TM12\nX10\nTA50 TS0 TM200\nX100\nTA10", machine), Code.RAMP_SHORTENED)
    assert finding.values["used_ms"] == pytest.approx(14)


def test_software_limits(machine: MachineProfile) -> None:
    """I113 is 375000 counts, I114 -10000."""
    found = checked("TA100 TS0 TM2000\nX380000\nDWELL0\nX-400000", machine)
    beyond = [finding for finding in found.findings if finding.code is Code.BEYOND_LIMIT]
    assert [(f.values["variable"], f.values["counts"]) for f in beyond] == [("I113", 380_000), ("I114", -20_000)]
    assert [f.lines for f in beyond] == [(5,), (7,)]
    assert found.worst is Severity.REFUSAL


def test_the_machine_ends_where_no_software_limit_is(machine: MachineProfile) -> None:
    found = checked("TA100 TS0 TM9000\nX380000", machine, before="I113=0\n")
    assert only(found, Code.BEYOND_TRAVEL).values["mm"] == pytest.approx(76)


def test_the_carriage_stays_clear_of_the_jaws(machine: MachineProfile) -> None:
    """Jaws at 200 mm, 2 mm clear; the software limit at 199 mm would come too late."""
    found = checked("TA100 TS0 TM9000\nZ198500", machine)
    assert only(found, Code.BEYOND_TRAVEL).values["limit_mm"] == pytest.approx(198)


def test_pvt_is_not_held_back_by_ix16(machine: MachineProfile) -> None:
    """The cubic through 0 and 12000 counts in 20 ms with rest at both ends is at 900 counts/ms in the middle."""
    finding = only(checked("PVT20\nX12000", machine), Code.TOO_FAST)
    assert finding.values["counts_per_ms"] == pytest.approx(1.5 * 12_000 / 20)


def test_what_the_iron_bears(machine: MachineProfile) -> None:
    """6 D/T^2 = 3000 counts/ms2 is 600 m/s2, and 1.5 D/T is 0.3 m/s; the spindle from rest to 3600 rpm in 1 ms."""
    quick = checked("PVT2\nX2000\nX-2000", machine)
    assert only(quick, Code.ACCELERATION_OVER_ENCODER).values["value"] == pytest.approx(600)
    assert only(quick, Code.FORCE_OVER_DRIVE).values["value"] == pytest.approx(4.74 * 600 + 201.6 * 0.3)
    over = checked("PVT1\nY300:600000\nPVT100\nY60000:600000\nPVT1\nY300", machine)
    assert only(over, Code.SPEED_OVER_SPINDLE).values["value"] == pytest.approx(3600)
    torque = 0.002 * 600e3 / 10_000 * 2 * math.pi * 1e3
    assert only(over, Code.TORQUE_OVER_SPINDLE).values["value"] == pytest.approx(torque)


def test_times_are_rounded(machine: MachineProfile) -> None:
    finding = only(checked("TA8.4 TS4 TM20\nX10", machine), Code.TIME_ROUNDED)
    assert (finding.lines, finding.values) == ((4,), {"word": "TA", "asked_ms": 8.4, "used_ms": 8.0})
    assert only(checked("PVT(10/3)\nX10", machine), Code.TIME_ROUNDED).values["used_ms"] == 3


def test_a_dwell_in_the_cut(machine: MachineProfile) -> None:
    found = checked(zig_zag(3) + "DWELL0\n" + zig_zag(3), machine)
    assert only(found, Code.DWELL_IN_CUT).lines == (23,)
    assert Code.DWELL_IN_CUT not in codes(checked(zig_zag(3) + "DWELL0\nX-500", machine))


def test_a_wait_in_the_cut_stops_it(machine: MachineProfile) -> None:
    found = checked("P1=0\n" + zig_zag(3) + "STOP\n" + zig_zag(3), machine)
    assert Code.STOP_IN_CUT in codes(found)


def test_a_feedrate_in_the_cut(machine: MachineProfile) -> None:
    """F is the speed along the path of X and Y together: the way of the tool slows the spindle down."""
    text = zig_zag(4).replace("TM20", "F100000")
    finding = only(checked(text, machine), Code.FEEDRATE_IN_CUT)
    assert finding.values["most_ms"] == pytest.approx((100**2 + (10_000 / 6) ** 2) ** 0.5 / 100)


def test_a_stretched_move_in_the_cut_changes_the_speed(machine: MachineProfile) -> None:
    odd = zig_zag(3) + "TM15\nTA30 X100 Y(10000/6)\nTA10 TM20\nX-100 Y(10000/6)\n" + zig_zag(3)
    finding = only(checked(odd, machine), Code.SPEED_CHANGES)
    assert finding.values["usual_rpm"] == pytest.approx(500)
    assert finding.values["slowest_rpm"] == pytest.approx(500 * 20 / 30)
    assert Code.SPEED_CHANGES not in codes(checked(zig_zag(6), machine))


@pytest.mark.parametrize(("counts", "per_turn"), [(1666, -4), (1667, 2), (1666.5, -1)])
def test_drift_a_turn(machine: MachineProfile, counts: float, per_turn: float) -> None:
    text = "TA10 TS5 TM20\n" + f"X100 Y{counts}\nX-100 Y{counts}\n" * 30
    finding = only(checked(text, machine), Code.DRIFT)
    assert finding.values["counts_per_turn"] == pytest.approx(per_turn, rel=2e-3)


def test_segments_that_do_not_fit_the_turn(machine: MachineProfile) -> None:
    """Seven moves a turn are three lobes and a half."""
    text = "TA10 TS5 TM20\n" + "X100 Y(10000/7)\nX-100 Y(10000/7)\n" * 30
    assert only(checked(text, machine), Code.NO_WHOLE_LOBES).values["lobes"] == pytest.approx(3.5)


def test_a_sampled_sine_that_closes_does_not_drift(machine: MachineProfile) -> None:
    loop = "P1=0\nTA2 TS1 TM4\nWHILE(P1<1800)\nP1=P1+7.2\nX(100*SIN(3*P1)-P2) Y200\nP2=100*SIN(3*P1)\nENDW\nX-500"
    assert codes(checked(loop, machine)) & {Code.DRIFT, Code.NO_WHOLE_LOBES} == set()
    drifting = loop.replace("Y200", "Y201")
    assert only(checked(drifting, machine), Code.DRIFT).values["counts_per_turn"] == pytest.approx(50, rel=0.02)


def test_a_zig_zag_of_splines_has_no_ramps_to_explain(machine: MachineProfile) -> None:
    """Uniform splines keep a third of a zig-zag: (P0 + 4 P1 + P0)/6 at both ends."""
    found = checked("TA20 SPLINE1\n" + "X300\nX-300\n" * 6, machine)
    assert only(found, Code.STROKE_LOST).values["kept_percent"] == pytest.approx(100 / 3)
    assert found.explanation == ()


def test_a_tool_that_is_left_in(machine: MachineProfile) -> None:
    assert only(checked("TA100 TS0 TM200\nX500", machine), Code.ENDS_DEEPER).values["counts"] == 500
    out = checked(zig_zag(3) + "TM100\nX-1000", machine)
    assert codes(out) & {Code.ENDS_DEEPER, Code.PLUNGE} == set()


def test_a_tool_that_is_left_in_by_a_move_until_a_trigger(machine: MachineProfile) -> None:
    finding = only(checked("RAPID X500^-5", machine), Code.ENDS_DEEPER)
    assert (finding.values["counts"], finding.lines) == (500, (4,))


def test_a_run_time_error_is_told_with_its_line(machine: MachineProfile) -> None:
    found = checked("TA10 TS5 TM20\nX100\nGOTO77\nX200", machine)
    finding = only(found, Code.RUN_TIME_ERROR)
    assert (finding.lines, finding.severity) == ((6,), Severity.REFUSAL)
    assert [move.motors[0].target for move in found.moves] == [100]


def test_a_calculation_without_a_result_is_told_as_the_controller_takes_it(
    machine: MachineProfile,
) -> None:
    """It stops nothing there, so that it is no run-time error."""
    found = checked("TA10 TS5 TM20\nX100\nP1=1/P2\nX200", machine)
    finding = only(found, Code.DIVIDED_BY_ZERO)
    assert (finding.lines, finding.severity) == ((6,), Severity.WARNING)
    assert finding.values["error"] == "a division by 0; the controller continues with its largest number, 2^47"
    assert [move.motors[0].target for move in found.moves] == [100, 300]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("X(P2/0+100)", 2.0**47),  # beyond the registers: a run-time error
        ("P1=0-3/0\nX(0-P1/2E12)".replace("2E12", "2000000000000"), 2.0**47 / 2e12),
        ("X(5%P2+7)", 7.0),
        ("X(SQRT(0-4)+9)", 9.0),
        ("IF(1/P2>5)\nX11\nELSE\nX12\nENDIF", 11.0),
        ("WHILE(P3<4/P2 AND P3<2)\nP3=P3+1\nX(P3)\nENDW", 3.0),
    ],
)
def test_the_walk_goes_on_with_what_the_controller_takes(
    machine: MachineProfile, line: str, expected: float
) -> None:
    found = checked(f"TA10 TS5 TM20\n{line}", machine)
    assert {Code.DIVIDED_BY_ZERO, Code.NO_RESULT} & set(codes(found))
    if expected < 1e9:
        assert found.moves[-1].motors[0].target == pytest.approx(expected)
    else:
        assert Code.RUN_TIME_ERROR in codes(found)


def test_each_place_is_told_once_and_settings_too(machine: MachineProfile) -> None:
    loop = "TA10 TS5 TM20\nWHILE(P1<50)\nP1=P1+1\nP2=1/0\nX(P1)\nENDW"
    found = checked(loop, machine, before="P7=1/P8\n")
    assert sorted(f.lines for f in found.findings if f.code is Code.DIVIDED_BY_ZERO) == [(1,), (8,)]


def test_a_program_without_motion(machine: MachineProfile) -> None:
    assert codes(checked("P1=1", machine)) == {Code.NO_MOTION}


def test_the_operators_times_replace_those_of_the_text(machine: MachineProfile) -> None:
    found = checked("TA10 TS10 TM20\nX100\nTA30\nX100", machine, ta_ms=12, ts_ms=3)
    assert {(move.asked.ta_ms, move.asked.ts_ms) for move in found.moves} == {(12, 3)}
    without = checked("TM20\nX100", machine, ta_ms=12, ts_ms=3)
    assert (without.moves[0].used.ta_ms, without.moves[0].used.ts_ms) == (12, 3)


def test_axes_of_the_text_replace_those_of_the_machine(machine: MachineProfile) -> None:
    found = checked("TA100 TS20 TM500\nX2", machine, before="&1\n#1->5000X\n")
    assert found.moves[0].motors[0].target == 10_000


def test_lines_are_those_of_the_file(machine: MachineProfile) -> None:
    found = checked("; a remark\n\nTA10 TS10 TM20\n\n\nX100 ; here\nX-100", machine)
    assert found.places == (9, 10)


def test_repeated_moves_are_folded(machine: MachineProfile) -> None:
    found = checked("TA20 TS10 TM40\n" + "X300\nX-300\n" * 10 + "X700", machine)
    folded = fold(found.moves)
    # Every line of the text is a line of its own: what is written out is not folded.
    assert {each.times for each in folded} == {1}
    looped = checked("TA20 TS10 TM40\nWHILE(P1<10)\nP1=P1+1\nX300\nX-300\nENDW\nX700", machine)
    assert [(len(each.moves), each.times) for each in fold(looped.moves)] == [(1, 1), (2, 9), (1, 1), (1, 1)]
    assert sum(len(each.moves) * each.times for each in fold(looped.moves)) == len(looped.moves)


def test_a_tool_that_is_taken_out_by_a_home_is_not_left_in(machine: MachineProfile) -> None:
    """The last move goes to 500 counts and HOME to 0."""
    assert Code.ENDS_DEEPER not in codes(checked("TA100 TS0 TM200\nX500\nHOME1", machine))


def test_a_home_that_leaves_the_tool_further_in_is_named(machine: MachineProfile) -> None:
    text = f"; starts at X-5000\n{HEAD}TA100 TS0 TM200\nX500\nHOME1\nCLOSE\n"
    finding = only(check_program(text, machine), Code.ENDS_DEEPER)
    assert (finding.values["counts"], finding.lines) == (5000, (7,))


@pytest.mark.parametrize("rest", ["WHILE(1=1)\nX10\nX10\nENDW\nX-9000", "GOTO77\nX-9000"])
def test_where_a_program_leaves_the_tool_is_not_said_of_one_that_was_not_followed_to_its_end(
    machine: MachineProfile, rest: str
) -> None:
    found = codes(checked(f"TA100 TS0 TM200\nX500\n{rest}", machine))
    assert found & {Code.ENDLESS_WITHOUT_FLAG, Code.RUN_TIME_ERROR}
    assert found & {Code.ENDS_DEEPER, Code.PLUNGE} == set()


def test_a_circle_without_segments_is_a_straight_line(machine: MachineProfile) -> None:
    """A half turn about 500 counts goes 500 counts off the line between its ends, and a straight line does not."""
    text = "TA10 TS0 TM500\nCIRCLE1\nX1000 Z0 I500 K0 NORMAL J-1\n".replace(" NORMAL J-1", "")
    plane = "NORMAL J-1\n"
    straight, arc = (checked(plane + text, machine, before=f"I13={ms}\n") for ms in (0, 10))
    finding = only(straight, Code.CIRCLE_STRAIGHT)
    assert (finding.severity, finding.lines) == (Severity.WARNING, (8,))
    assert finding.values == {"moves": 1, "variable": "I13"}
    assert Code.CIRCLE_STRAIGHT not in codes(arc)
    assert straight.moves[0].motors[2].peaks.velocity == 0
    assert arc.moves[0].motors[2].peaks.velocity > 1


def test_a_circle_is_judged_by_i13_as_it_was_then(machine: MachineProfile) -> None:
    text = "NORMAL K-1 TA10 TS0 TM500\nI13=0\nCIRCLE1 X100 I50\nDWELL10\nI13=10\nX100 I50"
    assert only(checked(text, machine), Code.CIRCLE_STRAIGHT).lines == (6,)


def test_values_have_the_types_of_what_they_are(machine: MachineProfile) -> None:
    found = checked("TA10 TS5 TM20\nWHILE(M26=0)\nX10\nX-10\nENDW\nGOTO77", machine)
    assert repr(only(found, Code.ENDLESS_LOOP).values["repeats"]) == "True"
    number = only(found, Code.RUN_TIME_ERROR).values["number"]
    assert type(number) is int
