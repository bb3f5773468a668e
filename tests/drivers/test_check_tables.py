"""What the checker finds in texts with compensation tables: motor 1 is the tool, 2 the spindle, 3 the carriage."""

from __future__ import annotations

import pytest

from drivers.pmac.analysis.findings import Code, ProgramFinding
from drivers.pmac.analysis.program import ProgramCheck, check_program
from drivers.pmac.program_text import read_program
from profiles.findings import Severity
from profiles.machine import MachineProfile
from tests.drivers.wire_card import wire

CAM = """#1
DEFINE COMP 3.4,#2,#3,#1,10000,3000
0 0 0 0
0 800 0 -320 0  0 800 0 -320 0
0 0 0 0 0
"""
"""Zero at Z 0 and 3000, between 1000 and 2000 50 counts at a quarter of a turn and -20 at three quarters."""

OPEN = "OPEN PROG 1\nCLEAR\nLINEAR INC TA10 TS0 TM100\n"
FIRST = 9
"""The line of the file behind CAM and OPEN."""


def checked(lines: str, machine: MachineProfile, before: str = CAM) -> ProgramCheck:
    return check_program(f"{before}{OPEN}{lines}\nCLOSE\n", machine)


def thrown(found: ProgramCheck) -> list[tuple[int, float]]:
    """The lines at which a motor is thrown, and by how many counts."""
    findings = [f for f in found.findings if f.code in (Code.TABLE_THROWS, Code.TABLE_THROWS_OTHER)]
    return sorted((f.lines[0], round(float(f.values["counts"]), 6)) for f in findings)


def only(found: ProgramCheck, code: Code) -> ProgramFinding:
    (finding,) = [finding for finding in found.findings if finding.code is code]
    return finding


def test_a_table_that_is_never_switched_on_throws_nothing(machine: MachineProfile) -> None:
    assert checked("Y2500 Z1000\nDWELL10", machine).findings == ()


def test_in_a_row_of_zeros_a_cam_may_be_switched_while_the_spindle_turns(machine: MachineProfile) -> None:
    turn = "Y10000\n"
    cut = f"{turn}I51=1\n{turn}Y10000 Z1000\n{turn}Y10000 Z-1000\n"
    assert thrown(checked(f"{cut}{turn * 3}I51=0\n{turn}I51=1\n{turn}", machine)) == []
    # Two moves ahead the carriage may still be on its way.
    assert [line for line, _ in thrown(checked(f"{cut}{turn}I51=0\n{turn}I51=1\n{turn}", machine))] == [FIRST + 9]


def test_a_throw_is_told_in_counts_and_um(machine: MachineProfile) -> None:
    """At rest at a quarter of a turn and Z1000: 800/16 = 50 counts of 0.2 um."""
    found = checked("Y2500 Z1000\nDWELL10\nI51=1\nDWELL10", machine)
    finding = only(found, Code.TABLE_THROWS)
    assert (finding.severity, finding.lines) == (Severity.WARNING, (FIRST + 2,))
    assert finding.values == {"motor": 1, "counts": 50, "length": pytest.approx(10), "unit": "um"}


def test_the_card_throws_as_far_as_the_checker_says(machine: MachineProfile) -> None:
    """Off at 50 counts, on again at three quarters of a turn, where the table says -20."""
    lines = "I51=1\nY2500 Z1000\nDWELL100\nI51=0\nDWELL10\nY5000\nDWELL100\nP1=1\nWHILE(P1=1)\nDWELL10\nENDWHILE\n"
    last = "I51=1\nDWELL10"
    ((_, counts),) = thrown(checked(f"{lines}{last}", machine))
    card = wire(machine)
    card.tell(*CAM.splitlines(), *OPEN.splitlines(), *lines.splitlines(), *last.splitlines(), "CLOSE")
    card.tell("#1J/#2J/#3J/", "B1R")
    card.sim.wait(2.0)
    before = card.card.motors[1].correction
    card.tell("P1=0")
    card.settle()
    after = card.card.motors[1].correction
    assert before == pytest.approx(50, abs=0.1)
    assert abs(after - before) == pytest.approx(counts, abs=0.1)


def test_between_two_rows_it_is_a_share(machine: MachineProfile) -> None:
    """Z400 is 0.4 of the way to the row of 50 counts."""
    assert thrown(checked("Y2500 Z400\nDWELL10\nI51=1\nDWELL10", machine)) == [(FIRST + 2, 20)]


def test_what_i51_0_left_in_the_register_counts(machine: MachineProfile) -> None:
    """Off at 50 counts; on again in a row of zeros, where it falls back by 50; on where it was left: nothing."""
    off = "I51=1\nY2500 Z1000\nDWELL10\nI51=0\nDWELL10\n"
    assert thrown(checked(f"{off}I51=1\nDWELL10", machine)) == []
    assert thrown(checked(f"{off}Z-1000\nDWELL10\nI51=1\nDWELL10", machine)) == [(FIRST + 7, 50)]
    # From 50 at a quarter to -20 at three quarters of a turn.
    assert thrown(checked(f"{off}Y5000\nDWELL10\nI51=1\nDWELL10", machine)) == [(FIRST + 7, 70)]


def test_a_source_that_turns_may_be_anywhere_on_its_moves(machine: MachineProfile) -> None:
    """From the ramp into the move but one to the ramp into the next; a ramp begins TA/2 = 5 ms too early.

    Up to 1250 - 5 x 12.5 = 1187.5 counts of the spindle it is 50 x 1187.5 / 2500; from 5000 - 5 x 50 = 4750 to
    7500 - 5 x 12.5 = 7437.5 it goes from 5 to -20 x 2437.5 / 2500.
    """
    slow = "Z1000\nDWELL10\nY1250\nI51=1\nY1250\nDWELL10\n"
    assert thrown(checked(slow, machine)) == [(FIRST + 3, 23.75)]
    fast = "Z1000\nDWELL10\nY2500\nY2500\nI51=1\nY2500\nDWELL10\n"
    assert thrown(checked(fast, machine)) == [(FIRST + 4, 50)]
    late = "Z1000\nDWELL10\nY5000\nY1250\nY1250\nI51=1\nY1250\nDWELL10\n"
    assert thrown(checked(late, machine)) == [(FIRST + 5, 19.5)]


def test_a_source_that_the_program_does_not_move_may_be_anywhere(machine: MachineProfile) -> None:
    """The spindle turns by itself, by a jog: the worst of its row, 50 counts."""
    assert thrown(checked("Z1000\nDWELL10\nI51=1\nDWELL10", machine)) == [(FIRST + 2, 50)]
    assert thrown(checked("Z3000\nDWELL10\nI51=1\nDWELL10", machine)) == []


def test_a_motor_that_was_sent_home_is_at_zero(machine: MachineProfile) -> None:
    assert thrown(checked("HOME3\nI51=1\nDWELL10", machine)) == []
    assert thrown(checked("I51=1\nDWELL10", machine)) == [(FIRST, 50)]


def test_i51_before_the_program(machine: MachineProfile) -> None:
    """One source, of which nothing is known: 640/16 = 40 counts, in the line that comes last."""
    table = "#1DEFINE COMP 4,#2,#1,10000\n0 640 0 0\n"
    assert thrown(checked("X100", machine, f"{table}I51=1\n")) == [(3, 40)]
    assert thrown(checked("X100", machine, f"I51=1\n{table}")) == [(3, 40)]
    assert thrown(checked("X100", machine, f"I51=1\n{table}I51=0\n")) == []


def test_what_the_start_says_of_a_source_counts(machine: MachineProfile) -> None:
    text = f"; starts at Y7500 Z1500\n{CAM}I51=1\n{OPEN}Y100 Z100\nCLOSE\n"
    assert thrown(check_program(text, machine)) == [(7, 20)]


def test_contributions_to_one_target_add(machine: MachineProfile) -> None:
    two = "#2DEFINE COMP 2,#3,#1,2000\n160 0\n#1DEFINE COMP 2,#2,#1,10000\n320 0\n"
    found = checked("Y5000 Z500\nDWELL10\nI51=1\nDWELL10", machine, two)
    assert thrown(found) == [(10, 20 + 5)]


def test_a_motor_that_the_machine_does_not_know_is_told_in_counts(machine: MachineProfile) -> None:
    found = checked("Y5000\nDWELL10\nI51=1\nDWELL10", machine, "#5DEFINE COMP 2,#2,#5,10000\n320 0\n")
    assert only(found, Code.TABLE_THROWS_OTHER).values["counts"] == 20


def test_the_same_line_is_told_once_with_its_worst(machine: MachineProfile) -> None:
    """-20, 50 (half of it at 1250) and 0 counts, each time from a register that was left at zero."""
    program = "Z1000\nP1=0\nWHILE(P1<4)\nY1250\nDWELL10\nI51=1\nDWELL10\nY-1250\nDWELL10\nI51=0\nP1=P1+1\nENDWHILE"
    assert thrown(checked(program, machine)) == [(FIRST + 5, 25)]


def test_the_last_entry_of_a_cam_is_zero(machine: MachineProfile) -> None:
    found = checked("X100", machine, "#1 DEFINE COMP 4,#2,#1,10000\n0 160 0\n-40\n")
    finding = only(found, Code.TABLE_LAST_ENTRY)
    assert (finding.severity, finding.lines) == (Severity.WARNING, (3,))
    assert finding.values["counts"] == -2.5
    assert finding.values["length"] == pytest.approx(-0.5)


def test_the_last_row_of_a_grid_may_be_anything(machine: MachineProfile) -> None:
    assert checked("Y100", machine, "#1DEFINE COMP 1.1,#2,#3,#1,10000,3000\n0 0 160\n").findings == ()


def test_a_table_that_is_not_full_corrects_nothing(machine: MachineProfile) -> None:
    found = checked("X100\nI51=1\nX100", machine, "#1DEFINE COMP 4,#2,#1,10000\n640 640\n")
    finding = only(found, Code.TABLE_UNFILLED)
    assert finding.lines == (1,)
    assert finding.values == {"motor": 1, "entries": 2, "wanted": 4}
    assert thrown(found) == []


def test_tables_are_defined_from_high_to_low(machine: MachineProfile) -> None:
    low = "#1DEFINE COMP 2,#2,#1,10000\n16 0\n"
    high = "#4DEFINE COMP 2,#2,#4,10000\n16 0\n"
    assert checked("Y100", machine, high + low).findings == ()
    found = checked("Y100", machine, low + high)
    (finding,) = found.findings
    assert (finding.code, finding.severity, finding.lines) == (Code.TABLE_ORDER, Severity.REFUSAL, (3,))
    assert (finding.values["motor"], finding.values["lower"]) == (4, "1")
    deleted = f"{low}#1DELETE COMP\n{high}"
    assert checked("Y100", machine, deleted).findings == ()


def test_a_table_is_deleted_from_low_to_high(machine: MachineProfile) -> None:
    both = "#4DEFINE COMP 1,100\n0\n#1DEFINE COMP 1,100\n0\n"
    assert only(checked("X100", machine, f"{both}#4DELETE COMP\n"), Code.TABLE_ORDER).lines == (5,)


@pytest.mark.parametrize(
    "line", ["1 2 3 4", "1.5", "9999999", "#9DEFINE COMP 1,100", "#1DEFINE COMP 0,100", "#0DELETE COMP"]
)
def test_what_the_card_does_not_take_is_told(machine: MachineProfile, line: str) -> None:
    found = checked("X100", machine, f"#1DEFINE COMP 3,#2,#1,10000\n{line}\n0 0 0\n")
    assert only(found, Code.LINE_REFUSED).lines == (2,)
    assert Code.TABLE_UNFILLED not in {finding.code for finding in found.findings}


def test_the_address_of_another_line_holds(machine: MachineProfile) -> None:
    found = checked("X100", machine, "#1J/#3J/\nDEFINE COMP 1,100\n8\n")
    assert only(found, Code.TABLE_LAST_ENTRY).values["motor"] == 3


def test_a_text_keeps_its_tables_apart_from_its_other_lines() -> None:
    read = read_program(f"P5=1 ; a remark\n{CAM}I51=0 #2 DELETE COMP\n{OPEN}CLOSE\n")
    (sent,) = read.tables
    assert sent.table is not None
    assert sent.table.correction(2500, 1500) == 50
    assert (sent.place, sent.last_place) == (3, 6)
    assert read.commands == ("#1",)
    assert read.setting_places == (1, 7)
    assert read.lines[:3] == ("P5=1", "#1", "DEFINE COMP 3.4,#2,#3,#1,10000,3000")
