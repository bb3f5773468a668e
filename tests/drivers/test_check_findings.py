"""What the checker finds in programs that are not the paper's."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from drivers.cutting.planning import Strategy, plan_cut
from drivers.pmac.analysis.endless import find_loops
from drivers.pmac.analysis.findings import FindingCode, ProgramFinding
from drivers.pmac.analysis.moves import fold
from drivers.pmac.analysis.program import ProgramCheck, check_program
from drivers.pmac.analysis.start import StartSource, read_start, start_comment
from drivers.pmac.analysis.walk import Walk, WalkEnding, walk
from drivers.pmac.axes import read_definitions
from drivers.pmac.program_text import read_program
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.store import load_job

HEAD = "OPEN PROG 1\nCLEAR\nLINEAR INC\n"


def checked(
    lines: str, machine: MachineProfile, before: str = "", ta_ms: float | None = None, ts_ms: float | None = None
) -> ProgramCheck:
    return check_program(f"{before}{HEAD}{lines}\nCLOSE\n", machine, ta_ms, ts_ms)


def only(found: ProgramCheck, code: FindingCode) -> ProgramFinding:
    (finding,) = [finding for finding in found.findings if finding.code is code]
    return finding


def codes(found: ProgramCheck) -> set[FindingCode]:
    return {finding.code for finding in found.findings}


def zig_zag(turns: int, lobes: int = 3, tm: float = 20) -> str:
    """A cut of whole turns: two moves for each lobe."""
    per_move = f"(10000/{2 * lobes})"
    return f"TA10 TS0 TM{tm}\n" + f"X100 Y{per_move}\nX-100 Y{per_move}\n" * (lobes * turns)


def test_a_program_without_a_fault_and_one_without_motion(machine: MachineProfile) -> None:
    found = checked("TA100 TS20 TM500\nX1000\nDWELL10\nX-1000", machine)
    assert found.findings == ()
    assert found.worst is Severity.OK
    assert found.explanation == ()
    assert codes(checked("P1=1", machine)) == {FindingCode.NO_MOTION}


def test_ix16_and_ix17_stretch_moves_and_ramps_that_have_no_room_are_shortened(machine: MachineProfile) -> None:
    """X100000 in 100 ms asks for 1000 counts/ms; I116 is 500."""
    finding = only(checked("TA20 TS0 TM100\nX100000\nX-100000", machine), FindingCode.STRETCHED_BY_VELOCITY)
    assert (finding.severity, finding.values["variable"]) == (Severity.WARNING, "I116")
    assert finding.values["asked_ms"] == 100
    assert finding.values["used_ms"] == pytest.approx(200)
    # The spindle from 0 to 200 counts/ms at 39.79 counts/ms2 takes 5.03 ms, TA1 is asked for.
    found = checked("TA1 TS0 TM100\nY20000", machine)
    assert only(found, FindingCode.RAMP_LENGTHENED).values["used_ms"] == pytest.approx(200 / 39.79)
    found = checked("TA1 TS0 TM3\nY600", machine)
    assert only(found, FindingCode.STRETCHED_BY_ACCELERATION).values["used_ms"] == pytest.approx(200 / 39.79)
    # TA(i+1) <= 2 (TM(i) - TA(i)/2) = 2 (12 - 5).
    finding = only(checked("TA10 TS0 TM12\nX10\nTA50 TS0 TM200\nX100\nTA10", machine), FindingCode.RAMP_SHORTENED)
    assert finding.values["used_ms"] == pytest.approx(14)


def test_travel_ends_at_software_limits_at_the_machine_and_clear_of_the_jaws(machine: MachineProfile) -> None:
    """I113 is 375000 counts, I114 -10000."""
    found = checked("TA100 TS0 TM2000\nX380000\nDWELL0\nX-400000", machine)
    beyond = [finding for finding in found.findings if finding.code is FindingCode.BEYOND_LIMIT]
    assert [(f.values["variable"], f.values["counts"]) for f in beyond] == [("I113", 380_000), ("I114", -20_000)]
    assert [f.lines for f in beyond] == [(5,), (7,)]
    assert found.worst is Severity.REFUSAL
    found = checked("TA100 TS0 TM9000\nX380000", machine, before="I113=0\n")
    assert only(found, FindingCode.BEYOND_TRAVEL).values["mm"] == pytest.approx(76)
    # Jaws at 200 mm, 2 mm clear; the software limit at 199 mm would come too late.
    found = checked("TA100 TS0 TM9000\nZ198500", machine)
    assert only(found, FindingCode.BEYOND_TRAVEL).values["limit_mm"] == pytest.approx(198)


def test_what_the_iron_bears(machine: MachineProfile) -> None:
    """The cubic through 0 and 12000 counts in 20 ms with rest at both ends is at 900 counts/ms in the middle."""
    finding = only(checked("PVT20\nX12000", machine), FindingCode.TOO_FAST)
    assert finding.values["counts_per_ms"] == pytest.approx(1.5 * 12_000 / 20)
    # 6 D/T^2 = 3000 counts/ms2 is 600 m/s2, and 1.5 D/T is 0.3 m/s; the spindle from rest to 3600 rpm in 1 ms.
    quick = checked("PVT2\nX2000\nX-2000", machine)
    assert only(quick, FindingCode.ACCELERATION_OVER_ENCODER).values["value"] == pytest.approx(600)
    assert only(quick, FindingCode.FORCE_OVER_DRIVE).values["value"] == pytest.approx(4.74 * 600 + 201.6 * 0.3)
    over = checked("PVT1\nY300:600000\nPVT100\nY60000:600000\nPVT1\nY300", machine)
    assert only(over, FindingCode.SPEED_OVER_SPINDLE).values["value"] == pytest.approx(3600)
    torque = 0.002 * 600e3 / 10_000 * 2 * math.pi * 1e3
    assert only(over, FindingCode.TORQUE_OVER_SPINDLE).values["value"] == pytest.approx(torque)


def test_times_are_rounded(machine: MachineProfile) -> None:
    finding = only(checked("TA8.4 TS4 TM20\nX10", machine), FindingCode.TIME_ROUNDED)
    assert (finding.lines, finding.values) == ((4,), {"word": "TA", "asked_ms": 8.4, "used_ms": 8.0})
    assert only(checked("PVT(10/3)\nX10", machine), FindingCode.TIME_ROUNDED).values["used_ms"] == 3


def test_what_stops_or_slows_the_cut(machine: MachineProfile) -> None:
    found = checked(zig_zag(3) + "DWELL0\n" + zig_zag(3), machine)
    assert only(found, FindingCode.DWELL_IN_CUT).lines == (23,)
    assert FindingCode.DWELL_IN_CUT not in codes(checked(zig_zag(3) + "DWELL0\nX-500", machine))
    found = checked("P1=0\n" + zig_zag(3) + "STOP\n" + zig_zag(3), machine)
    assert FindingCode.STOP_IN_CUT in codes(found)
    # F is the speed along the path of X and Y together: the way of the tool slows the spindle down.
    text = zig_zag(4).replace("TM20", "F100000")
    finding = only(checked(text, machine), FindingCode.FEEDRATE_IN_CUT)
    assert finding.values["most_ms"] == pytest.approx((100**2 + (10_000 / 6) ** 2) ** 0.5 / 100)
    odd = zig_zag(3) + "TM15\nTA30 X100 Y(10000/6)\nTA10 TM20\nX-100 Y(10000/6)\n" + zig_zag(3)
    finding = only(checked(odd, machine), FindingCode.SPEED_CHANGES)
    assert finding.values["usual_rpm"] == pytest.approx(500)
    assert finding.values["slowest_rpm"] == pytest.approx(500 * 20 / 30)
    assert FindingCode.SPEED_CHANGES not in codes(checked(zig_zag(6), machine))


@pytest.mark.parametrize(("counts", "per_turn"), [(1666, -4), (1667, 2), (1666.5, -1)])
def test_drift_a_turn(machine: MachineProfile, counts: float, per_turn: float) -> None:
    text = "TA10 TS5 TM20\n" + f"X100 Y{counts}\nX-100 Y{counts}\n" * 30
    finding = only(checked(text, machine), FindingCode.DRIFT)
    assert finding.values["counts_per_turn"] == pytest.approx(per_turn, rel=2e-3)


def test_segments_close_the_turn_or_drift(machine: MachineProfile) -> None:
    """Seven moves a turn are three lobes and a half."""
    text = "TA10 TS5 TM20\n" + "X100 Y(10000/7)\nX-100 Y(10000/7)\n" * 30
    assert only(checked(text, machine), FindingCode.NO_WHOLE_LOBES).values["lobes"] == pytest.approx(3.5)
    loop = "P1=0\nTA2 TS1 TM4\nWHILE(P1<1800)\nP1=P1+7.2\nX(100*SIN(3*P1)-P2) Y200\nP2=100*SIN(3*P1)\nENDW\nX-500"
    assert codes(checked(loop, machine)) & {FindingCode.DRIFT, FindingCode.NO_WHOLE_LOBES} == set()
    drifting = loop.replace("Y200", "Y201")
    assert only(checked(drifting, machine), FindingCode.DRIFT).values["counts_per_turn"] == pytest.approx(
        50, rel=0.02
    )


def test_a_zig_zag_of_splines_and_values_of_findings_are_what_they_are(machine: MachineProfile) -> None:
    """Uniform splines keep a third of a zig-zag: (P0 + 4 P1 + P0)/6 at both ends."""
    found = checked("TA20 SPLINE1\n" + "X300\nX-300\n" * 6, machine)
    assert only(found, FindingCode.STROKE_LOST).values["kept_percent"] == pytest.approx(100 / 3)
    assert found.explanation == ()
    found = checked("TA10 TS5 TM20\nWHILE(M26=0)\nX10\nX-10\nENDW\nGOTO77", machine)
    assert repr(only(found, FindingCode.ENDLESS_LOOP).values["repeats"]) == "True"
    number = only(found, FindingCode.RUN_TIME_ERROR).values["number"]
    assert type(number) is int


def test_a_tool_that_is_left_in_by_a_move_or_a_home(machine: MachineProfile) -> None:
    assert only(checked("TA100 TS0 TM200\nX500", machine), FindingCode.ENDS_DEEPER).values["counts"] == 500
    out = checked(zig_zag(3) + "TM100\nX-1000", machine)
    assert codes(out) & {FindingCode.ENDS_DEEPER, FindingCode.PLUNGE} == set()
    finding = only(checked("RAPID X500^-5", machine), FindingCode.ENDS_DEEPER)
    assert (finding.values["counts"], finding.lines) == (500, (4,))
    # The last move goes to 500 counts and HOME to 0.
    assert FindingCode.ENDS_DEEPER not in codes(checked("TA100 TS0 TM200\nX500\nHOME1", machine))
    text = f"; starts at X-5000\n{HEAD}TA100 TS0 TM200\nX500\nHOME1\nCLOSE\n"
    finding = only(check_program(text, machine), FindingCode.ENDS_DEEPER)
    assert (finding.values["counts"], finding.lines) == (5000, (7,))


def test_errors_are_told_once_a_place_with_their_line(machine: MachineProfile) -> None:
    found = checked("TA10 TS5 TM20\nX100\nGOTO77\nX200", machine)
    finding = only(found, FindingCode.RUN_TIME_ERROR)
    assert (finding.lines, finding.severity) == ((6,), Severity.REFUSAL)
    assert [move.motors[0].target for move in found.moves] == [100]
    # It stops nothing there, so that it is no run-time error.
    found = checked("TA10 TS5 TM20\nX100\nP1=1/P2\nX200", machine)
    finding = only(found, FindingCode.DIVIDED_BY_ZERO)
    assert (finding.lines, finding.severity) == ((6,), Severity.WARNING)
    assert finding.values["error"] == "a division by 0; the controller continues with its largest number, 2^47"
    assert [move.motors[0].target for move in found.moves] == [100, 300]
    loop = "TA10 TS5 TM20\nWHILE(P1<50)\nP1=P1+1\nP2=1/0\nX(P1)\nENDW"
    found = checked(loop, machine, before="P7=1/P8\n")
    assert sorted(f.lines for f in found.findings if f.code is FindingCode.DIVIDED_BY_ZERO) == [(1,), (8,)]


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
def test_the_walk_goes_on_with_the_controllers_values(machine: MachineProfile, line: str, expected: float) -> None:
    found = checked(f"TA10 TS5 TM20\n{line}", machine)
    assert {FindingCode.DIVIDED_BY_ZERO, FindingCode.NO_RESULT} & set(codes(found))
    if expected < 1e9:
        assert found.moves[-1].motors[0].target == pytest.approx(expected)
    else:
        assert FindingCode.RUN_TIME_ERROR in codes(found)


def test_times_axes_and_lines_of_the_text(machine: MachineProfile) -> None:
    found = checked("TA10 TS10 TM20\nX100\nTA30\nX100", machine, ta_ms=12, ts_ms=3)
    assert {(move.asked.ta_ms, move.asked.ts_ms) for move in found.moves} == {(12, 3)}
    without = checked("TM20\nX100", machine, ta_ms=12, ts_ms=3)
    assert (without.moves[0].used.ta_ms, without.moves[0].used.ts_ms) == (12, 3)
    found = checked("TA100 TS20 TM500\nX2", machine, before="&1\n#1->5000X\n")
    assert found.moves[0].motors[0].target == 10_000
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


@pytest.mark.parametrize("rest", ["WHILE(1=1)\nX10\nX10\nENDW\nX-9000", "GOTO77\nX-9000"])
def test_of_a_program_without_its_end_no_last_place_is_told(machine: MachineProfile, rest: str) -> None:
    found = codes(checked(f"TA100 TS0 TM200\nX500\n{rest}", machine))
    assert found & {FindingCode.ENDLESS_WITHOUT_FLAG, FindingCode.RUN_TIME_ERROR}
    assert found & {FindingCode.ENDS_DEEPER, FindingCode.PLUNGE} == set()


def test_a_circle_without_segments_is_a_straight_line(machine: MachineProfile) -> None:
    """A half turn about 500 counts goes 500 counts off the line between its ends, and a straight line does not."""
    text = "TA10 TS0 TM500\nCIRCLE1\nX1000 Z0 I500 K0 NORMAL J-1\n".replace(" NORMAL J-1", "")
    plane = "NORMAL J-1\n"
    straight, arc = (checked(plane + text, machine, before=f"I13={ms}\n") for ms in (0, 10))
    finding = only(straight, FindingCode.CIRCLE_STRAIGHT)
    assert (finding.severity, finding.lines) == (Severity.WARNING, (8,))
    assert finding.values == {"moves": 1, "variable": "I13"}
    assert FindingCode.CIRCLE_STRAIGHT not in codes(arc)
    assert straight.moves[0].motors[2].peaks.velocity == 0
    assert arc.moves[0].motors[2].peaks.velocity > 1
    text = "NORMAL K-1 TA10 TS0 TM500\nI13=0\nCIRCLE1 X100 I50\nDWELL10\nI13=10\nX100 I50"
    assert only(checked(text, machine), FindingCode.CIRCLE_STRAIGHT).lines == (6,)


# Loops that nothing in a program ends: found, watched, and left as a host would leave them.

SETTINGS = {187: 20.0, 188: 10.0, 189: 1000.0, 190: 1000.0, 8: 2.0, 10: 3_713_707.0}


def walked(lines: str, turn: float | None = None, before: str = "") -> Walk:
    text = read_program(f"{before}\nOPEN PROG 1\nCLEAR\nINC TA20 TS10 TM20\n{lines}\nCLOSE")
    definitions = read_definitions(["#1->X", "#2->Y"])
    turns = {} if turn is None else {2: turn}
    return walk(text, SETTINGS, definitions, {1: 0.0, 2: 0.0}, counts_per_turn=turns)


def flags(found: Walk) -> list[dict[str, float]]:
    return [{f"{kind}{index}": value for (kind, index), value in left.flags.items()} for left in found.left]


def moves_of(found: Walk) -> list[int]:
    return [step.line for step in found.steps if step.planned.record is not None]


def test_the_flag_of_a_loop_is_set_and_its_motion_watched_for_some_turns() -> None:
    found = walked("M26=0\nWHILE(M26=0)\nX10\nX-10\nENDW\nX-500")
    assert found.ending is WalkEnding.FINISHED
    assert flags(found) == [{"M26": 1.0}]
    assert found.left[0].circle.period == 2
    assert moves_of(found)[-1] == 6
    assert found.steps[-1].at[0] == -500
    # A pass makes 1000 counts of a turn of 10000: three turns are 30 passes at least.
    found = walked("WHILE(M26=0)\nX10 Y500\nX-10 Y500\nENDW", turn=10_000.0)
    left = found.left[0]
    assert left.circle.passes >= 30
    assert left.circle.passes < 40
    assert found.steps[-1].at[1] > 30_000


@pytest.mark.parametrize(
    ("condition", "flag"),
    [
        ("M26!=1", {"M26": 1.0}),
        ("P5!>3", {"P5": 4.0}),
        ("P5<7", {"P5": 8.0}),
        ("M1=0 OR M2=0", {"M1": 1.0, "M2": 1.0}),
        ("M1=0 AND M2=0", {"M1": 1.0}),
        ("Q7~2", {"Q7": 1.0}),
    ],
)
def test_the_flag_that_ends_a_condition_is_found(condition: str, flag: dict[str, float]) -> None:
    found = walked(f"Q7=2\nWHILE({condition})\nX10 X-10\nENDW\nX5")
    assert found.ending is WalkEnding.FINISHED
    assert flags(found) == [flag]


def test_a_loop_that_counts_or_sets_its_flag_is_no_endless_one() -> None:
    found = walked("WHILE(P1<50)\nP1=P1+1\nX10\nX-10\nENDW")
    assert found.left == ()
    assert len(moves_of(found)) == 100
    found = walked("WHILE(M26=0)\nP1=P1+1\nIF(P1=20) M26=1\nX10\nX-10\nENDW")
    assert found.left == ()
    assert len(moves_of(found)) == 40
    found = walked("WHILE(M26=0)\nP1=P1+1\nX10\nX-10\nENDW")
    assert flags(found) == [{"M26": 1.0}]


def test_a_motion_that_grows_and_a_wait_are_left_too() -> None:
    found = walked("WHILE(M26=0)\nP1=P1+1\nX(P1)\nX(-P1)\nENDW")
    assert found.left[0].circle.period is None
    assert found.ending is WalkEnding.FINISHED
    found = walked("WHILE(M1=0) WAIT\nX10")
    assert flags(found) == [{"M1": 1.0}]
    assert moves_of(found) == [2]


@pytest.mark.parametrize("body", ["", "P2=1\n", "P2=P2+1\n", "IF(P2=3)\nP4=1\nENDIF\n"])
def test_a_wait_of_several_lines_is_the_same_wait(body: str) -> None:
    found = walked(f"LINEAR\nP3=1\nWHILE(M1=0)\n{body}ENDWHILE\nX10")
    assert flags(found) == [{"M1": 1.0}]
    assert found.steps[-1].at[0] == pytest.approx(10)


def test_without_a_flag_the_program_is_stopped_there() -> None:
    found = walked("WHILE(1=1)\nX10\nX-10\nENDW\nX500")
    assert found.ending is WalkEnding.ENDLESS
    assert flags(found) == [{}]
    assert 500 not in {step.at[0] for step in found.steps}
    found = walked("N10\nX10\nX-10\nGOTO10")
    assert found.ending is WalkEnding.ENDLESS
    assert found.left[0].circle.loop is None
    found = walked("N5 GOSUB100\nGOTO5\nRETURN\nN100 X10 X-10\nRETURN")
    assert found.ending is WalkEnding.ENDLESS


def test_a_goto_leads_out_and_a_flag_that_is_put_back_is_not_set_for_ever() -> None:
    found = walked("WHILE(M26=0)\nP1=P1+1\nX10\nX-10\nIF(P1=30) GOTO99\nENDW\nN99 X7")
    assert found.left == ()
    assert len(moves_of(found)) == 61
    found = walked("WHILE(M26=0)\nX10\nX-10\nM26=0\nENDW")
    assert found.ending is WalkEnding.ENDLESS
    assert [bool(each) for each in flags(found)] == [True, False]


def test_loops_inside_each_other_are_left_one_after_the_other() -> None:
    found = walked("WHILE(M1=0)\nX5\nWHILE(M2=0)\nX10\nX-10\nENDW\nENDW\nX7")
    assert found.ending is WalkEnding.FINISHED
    assert flags(found) == [{"M2": 1.0}, {"M1": 1.0}]
    found = walked("WHILE(M26=0)\nP2=0\nWHILE(P2<20)\nP2=P2+1\nX10\nX-10\nENDW\nX100\nENDW")
    assert flags(found) == [{"M26": 1.0}]
    assert found.left[0].circle.period == 41


def test_what_is_no_circle() -> None:
    found = walked("GOSUB100\n" * 6 + "RETURN\nN100 X10 X-10\nRETURN")
    assert found.left == ()
    assert len(moves_of(found)) == 12
    found = walked("X10 " * 30 + "\nX7")
    assert found.left == ()
    assert len(moves_of(found)) == 31
    found = walked("WHILE(M26=0)\nX10 X-10\nENDW")
    assert found.left[0].circle.period == 2


def test_an_endless_loop_that_calls_a_program_is_left() -> None:
    text = read_program(
        "OPEN PROG 1\nINC TA20 TS10 TM20\nWHILE(M26=0)\nX100\nCALL500\nX-133\nENDW\nX7\nCLOSE\n"
        "OPEN PROG 500\nX33\nRETURN\nCLOSE"
    )
    found = walk(text, SETTINGS, read_definitions(["#1->X"]), {1: 0.0})
    assert found.ending is WalkEnding.FINISHED
    assert found.left[0].circle.period == 3


@pytest.mark.parametrize("called", ["GOSUB100", "CALL500"])
def test_an_endless_loop_may_move_in_what_it_calls_alone(called: str) -> None:
    text = read_program(
        f"OPEN PROG 1\nINC TA20 TS10 TM20\nWHILE(M26=0)\n{called}\nENDW\nX7\nRETURN\nN100 X100 X-100\nRETURN\n"
        "CLOSE\nOPEN PROG 500\nX33 X-33\nRETURN\nCLOSE"
    )
    found = walk(text, SETTINGS, read_definitions(["#1->X"]), {1: 0.0})
    assert found.ending is WalkEnding.FINISHED
    assert flags(found) == [{"M26": 1.0}]


def test_a_flag_of_a_subroutine_is_not_free_and_a_long_program_is_looked_at_so_far() -> None:
    text = read_program("OPEN PROG 1\nWHILE(M26=0)\nGOSUB100\nENDW\nRETURN\nN100 M26=1\nRETURN\nN200 P1=1\nCLOSE")
    (loop,) = find_loops(text.program)
    assert not loop.endless
    text = read_program("OPEN PROG 1\nINC TA20 TS10 TM20\nWHILE(P1<1000)\nP1=P1+1\nX1\nENDW\nCLOSE")
    found = walk(text, SETTINGS, read_definitions(["#1->X"]), {1: 0.0}, most_steps=50)
    assert found.ending is WalkEnding.TOO_LONG
    assert found.steps[-1].at[0] == pytest.approx(50)


# Where a checked program starts: as the operator says, as a comment of its text says, or at home.

TEXT = "OPEN PROG 1\nABS TA100 TS20 TM2000\nX1000 Y0 Z500\nCLOSE\n"


def ways(text: str, machine: MachineProfile, start: dict[str, float] | None = None) -> list[float]:
    (move,) = check_program(text, machine, start=start).moves
    return [motor.commanded for motor in move.motors]


def test_a_program_starts_at_home_at_its_comment_or_where_the_operator_says(machine: MachineProfile) -> None:
    assert ways(TEXT, machine) == [1000, 0, 500]
    assert check_program(TEXT, machine).start.source is StartSource.HOME
    text = f"; mine\n; starts at X900 Z-20.5\n{TEXT}; starts at X1\n"
    assert ways(text, machine) == [100, 0, 520.5]
    start = check_program(text, machine).start
    assert (start.source, start.line, str(start)) == (StartSource.COMMENT, 2, "X900 Y0 Z-20.5")
    assert ways(f"; starts at X900 Z20\n{TEXT}", machine, {"X": 400}) == [600, 0, 500]


@pytest.mark.parametrize(
    "comment", ["; starts at the surface", "; starts at X", "; starts at X5 of the part", "X1 ; starts at X5"]
)
def test_other_comments_say_nothing(machine: MachineProfile, comment: str) -> None:
    assert check_program(f"{TEXT}{comment}\n", machine).start.source is StartSource.HOME


def test_positions_are_read_in_the_units_of_the_axes(machine: MachineProfile) -> None:
    """#1->5000X+10: X2 is 10010 counts. An axis that is not named is at home, 0 counts, X-0.002."""
    text = "&1\n#1->5000X+10\nOPEN PROG 1\nABS TA100 TS20 TM500\nX3\nCLOSE\n"
    assert ways(text, machine, {"X": 2}) == pytest.approx([5000, 0, 0])
    assert ways(text, machine, {"Y": 7}) == pytest.approx([15_010, 0, 0])
    assert check_program(text, machine).start.positions == pytest.approx({"X": -0.002, "Y": 0, "Z": 0})
    assert read_start("x=240000, Y=-0.5,Z=+.25") == {"X": 240_000, "Y": -0.5, "Z": 0.25}


@pytest.mark.parametrize(
    ("start", "code"), [({"U": 5.0}, "program.start_axis"), ({"X": 1e20}, "program.start_too_far")]
)
def test_a_start_that_cannot_be_is_refused(machine: MachineProfile, start: dict[str, float], code: str) -> None:
    with pytest.raises(ProblemError) as refused:
        check_program(TEXT, machine, start=start)
    assert [problem.code for problem in refused.value.problems] == [code]


@pytest.mark.parametrize("text", ["", "X", "X=", "X5", "X=1e5", "X=nan", "Q=1", "X=1,X=2", "X=1,,Y=2", "X=1;Y=2"])
def test_what_is_no_position_is_refused(text: str) -> None:
    with pytest.raises(ValueError):
        read_start(text)


@pytest.mark.first(5)
@pytest.mark.parametrize("name", ["lee-2001-experiment-1", "lee-2001-experiment-2"])
@pytest.mark.parametrize("strategy", list(Strategy))
def test_the_programs_of_the_project_have_no_fault(machine: MachineProfile, name: str, strategy: Strategy) -> None:
    plan = plan_cut(replace(load_job(name).job, cut_length_mm=0.5), machine, strategy)
    counts = {1: plan.tool_start, 2: plan.spindle_start, 3: plan.carriage_start}
    comment = start_comment(read_definitions(machine.controller.axis_definitions), counts)
    checked = check_program(f"{comment}\n{plan.text}", machine)
    assert [finding for finding in checked.findings if finding.severity is Severity.REFUSAL] == []
    assert FindingCode.ENDS_DEEPER not in {finding.code for finding in checked.findings}


@pytest.mark.parametrize(
    ("line", "motors"),
    [
        ("UNDEFINE ALL", (4,)),
        ("&1 undef", (4,)),
        ("#2->0", (1, 2, 3, 4)),
        ("#2->0 #2->100Y", (1, 2, 3, 4)),
        ("", (1, 2, 3, 4)),
    ],
)
def test_axes_that_a_text_clears_are_gone(machine: MachineProfile, line: str, motors: tuple[int, ...]) -> None:
    text = f"{line}\n#4->W\nOPEN PROG 1 CLEAR\nTA10 TS0 TM20 W5\nCLOSE\n"
    assert check_program(text, machine).motors == motors
