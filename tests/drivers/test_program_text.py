"""Texts of programs: taken apart, preprocessed, and checked with their compensation tables."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.analysis.findings import FindingCode, ProgramFinding
from drivers.pmac.analysis.program import ProgramCheck, check_program
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.syntax import Label, Return
from drivers.pmac.language.text import format_line
from drivers.pmac.preprocessor import MOST_LINES, preprocess
from drivers.pmac.program_text import read_program
from profiles.findings import Severity
from profiles.machine import MachineProfile
from tests.drivers.wire_card import wire

FULL_CIRCLE = """\
close
delete gather
undefine all
&1
#2->2000Y ;X is phantom
open prog1 clear
inc
inc (r)
ta300
ts0
tm1000 ;TA+TM is period
i13=10
normal k-1 ;X-Y plane
circle1 ;clockwise
x0 y0 i10 ;complete circle
close
&1b1r
"""
"""An example of the Quick Reference Guide."""


def refusal(text: str) -> PmacError:
    with pytest.raises(PmacError) as refused:
        read_program(text)
    return refused.value


def test_an_example_of_the_quick_reference_is_taken_apart_without_its_comments() -> None:
    text = read_program(FULL_CIRCLE)
    assert text.number == 1
    assert list(
        map(format_line, text.program)
    ) == "INC | INC(R) | TA300 | TS0 | TM1000 | I13=10 | NORMAL K-1 | CIRCLE1 | X0 Y0 I10".split(" | ")
    assert text.commands == ("delete gather", "undefine all", "&1", "&1", "b1r")
    assert [(d.motor, str(d)) for d in text.definitions] == [(2, "2000Y")]
    assert text.lines[:6] == ("close", "delete gather", "undefine all", "&1", "#2->2000Y", "open prog1 clear")
    text = read_program('OPEN PROG 2 ; one\nCLEAR\nCMD"A;B" ; "two"\n; three\n\nCLOSE')
    assert text.lines == ("OPEN PROG 2", "CLEAR", 'CMD"A;B"', "CLOSE")
    assert len(read_program("OPEN PROG 2 CLEAR\n\nX1\n;\n\nX2\nCLOSE").program) == 2


def test_programs_of_a_text_are_taken_apart() -> None:
    text = read_program(
        "OPEN PROG 1000 CLEAR\nN1000 RETURN\nCLOSE\nOPEN PROG 5 CLEAR\nG1\nCLOSE\nOPEN PROG 6\nX1 CLOSE"
    )
    assert text.number == 5
    assert sorted(text.subprograms) == [6, 1000]
    code = text.code(1000)
    assert code is not None and code.instructions == (Label(1000), Return())
    assert text.code(5) is not None and text.code(6) is not None
    assert text.code(7) is None
    assert read_program("OPEN PROG 1001 CLEAR\nRET\nCLOSE\nOPEN PROG 1000 CLEAR\nRET\nCLOSE").number == 1001
    assert len(read_program("OPEN PROG 1\nX1\nCLOSE\nOPEN PROG 1\nX2\nCLOSE").program) == 2
    assert len(read_program("OPEN PROG 1\nX1\nCLEAR\nX2\nCLOSE\nCLR").program) == 1
    text = read_program("Close Open Program 3 Clear X1\nX2 Close")
    assert (text.number, len(text.program)) == (3, 2)
    text = read_program("CLS\nOPEN PROGRAM 3 CLR\nX1\nX2 c l s\nP1=1\nOPEN PLC 2\nP1=1\nCLS\nP2=1")
    assert (text.number, len(text.program), len(text.settings)) == (3, 2, 2)
    assert text.plcs == {2: ("P1=1",)}


def test_settings_and_definitions_may_share_a_line_with_an_address() -> None:
    text = read_program("&1 #1->X #2->-10Y+5 I130=5 P1=I130*2\n#1->0\nOPEN PROG 1\nCLOSE")
    assert [len(line) for line in text.settings] == [2]
    assert [(d.motor, str(d)) for d in text.definitions] == [(2, "-10Y+5")]
    assert text.commands == ("&1",)


@pytest.mark.parametrize(
    "command",
    (
        "I20..44=0 | i5213,15,100=10 | M1->Y:$FFC2,8 | M1..8->* | I100=* | #1? | #1J+ | B1R | WX:$720,1 | $$$ | "
        "ENABLE PLC 1 | #1-> | DEFINE GATHER 100 | SAVE | %100 | P1 | M1 | I100 | HOME | PASSWORD=abc"
    ).split(" | "),
)
def test_other_on_line_commands_are_kept_as_text(command: str) -> None:
    assert read_program(f"{command}\nOPEN PROG 1\nCLOSE").commands == (command,)


def test_plc_programs_are_kept_as_text() -> None:
    text = read_program("OPEN PLC 3 CLEAR\nIF (M11=1)\nAND (M12=1) ; both\nENDIF\nCLOSE\nOPEN PROG 1\nCLOSE")
    assert text.plcs == {3: ("IF (M11=1)", "AND (M12=1)", "ENDIF")}


@pytest.mark.parametrize(
    ("text", "code", "place"),
    [
        ("OPEN PROG 1\nFOO\nCLOSE", 3, "line 2"),
        ("OPEN PROG 1\nX\xb51\nCLOSE", 4, "line 2"),
        ("P1=\nOPEN PROG 1\nCLOSE", 3, "line 1"),
        ("X10\nOPEN PROG 1\nCLOSE", 5, "line 1"),
        ("OPEN PROG 1\nCLOSE\nTA10", 5, "line 3"),
        ("OPEN PROG 1\nOPEN PROG 2\nCLOSE", 7, "line 2"),
        ("OPEN PROG 0", 3, "line 1"),
        ("OPEN PROG 32768", 3, "line 1"),
        ("OPEN ROT", 3, "line 1"),
        ("OPEN PLC 32", 3, "line 1"),
        ("#1->FOO\nOPEN PROG 1\nCLOSE", 3, "line 1"),
    ],
)
def test_what_the_card_would_refuse_is_refused_with_its_line(text: str, code: int, place: str) -> None:
    refused = refusal(text)
    assert refused.code == code
    assert place in refused.detail


@pytest.mark.parametrize("directive", ["#include <gcodes.pmc>", "# IFDEF X", "#if 1"])
def test_directives_that_cannot_be_carried_out_are_refused_with_their_line(directive: str) -> None:
    refused = refusal(f"{directive}\nOPEN PROG 1\nCLOSE")
    assert (refused.code, "line 1: #" in refused.detail) == (3, True)


def test_a_text_without_a_program_is_refused() -> None:
    assert refusal("P1=5\n").code == 5


fragments = st.sampled_from(
    [
        "OPEN PROG 1",
        "OPEN PLC 1",
        "CLEAR",
        "CLOSE",
        "\n",
        "\n",
        "X1",
        "P1=1",
        "#1->X",
        "&1",
        ";",
        '"',
        "#define",
        "B1R",
    ]
)


@given(st.lists(fragments | st.text(max_size=8), max_size=20).map(" ".join))
def test_any_text_is_taken_apart_or_refused(text: str) -> None:
    try:
        read_program(text)
    except PmacError as refused:
        assert refused.code in (3, 4, 5, 7)


# Texts of other people's editors: their comments and names are understood, and each line keeps its place.


def sent(text: str) -> list[tuple[int, str]]:
    lines = list(preprocess(text))
    assert not [line.error for line in lines if line.error is not None]
    return [(int(line.place), line.text) for line in lines]


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("X1 // to the part", [(1, "X1")]),
        ("X1 /* there */ Y2", [(1, "X1   Y2")]),
        ("/* one\ntwo ; three // four\n*/ X1\nY2", [(3, "X1"), (4, "Y2")]),
        ("/*/ not closed yet\n*/X1", [(2, "X1")]),
        ('CMD"#1J/" // a slash and quotes', [(1, 'CMD"#1J/"')]),
        ('SEND"a // b /* c ; d"', [(1, 'SEND"a // b /* c ; d"')]),
        ("P1=6/2 ; half", [(1, "P1=6/2")]),
        ('// "one quote\nX1', [(2, "X1")]),
    ],
)
def test_comments_of_an_editor_are_not_sent(text: str, kept: list[tuple[int, str]]) -> None:
    assert sent(text) == kept


@given(st.lists(st.sampled_from(["/*", "*/", "//", ";", '"', "X1", "/", "*", "\n", "CMD"]), max_size=12))
def test_no_comment_breaks_the_reader(pieces: list[str]) -> None:
    lines = list(preprocess("".join(pieces)))
    assert all(line.text and int(line.place) >= 1 for line in lines)


def test_an_open_comment_is_told_and_the_longest_name_is_replaced() -> None:
    (last,) = [line for line in preprocess("X1\n/* for ever\nX2") if line.error is not None]
    assert last.place == 2 and "without" in str(last.error)
    assert sent("#define Ax 5\n#define Ax1 7\nP1=Ax1 P2=Ax2") == [(3, "P1=7 P2=52")]


@pytest.mark.parametrize(
    ("line", "becomes"),
    [
        ("M1->X:$VarAdr30,4", "M1->X:$6030,4"),
        ("P1=Var2", "P1=Var2"),
        ("P1=VarAdr", "P1=60"),
        ("P1=VarAdrX", "P1=VarAdrX"),
    ],
)
def test_a_name_is_replaced_in_front_of_digits(line: str, becomes: str) -> None:
    assert sent(f"#define VarAdr 60\n{line}") == [(2, becomes)]


def test_the_backup_of_a_full_controller_is_read() -> None:
    text = "\n".join(["OPEN PROG1", *("X1" for _ in range(150_095)), "CLOSE"])
    assert len(sent(text)) == 150_097
    refused = list(preprocess("X1\n" * (MOST_LINES + 1)))[-1]
    assert refused.error is not None and str(MOST_LINES) in str(refused.error)


# What the checker finds in texts with compensation tables: motor 1 is the tool, 2 the spindle, 3 the carriage.

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
    findings = [f for f in found.findings if f.code in (FindingCode.TABLE_THROWS, FindingCode.TABLE_THROWS_OTHER)]
    return sorted((f.lines[0], round(float(f.values["counts"]), 6)) for f in findings)


def only(found: ProgramCheck, code: FindingCode) -> ProgramFinding:
    (finding,) = [finding for finding in found.findings if finding.code is code]
    return finding


def test_a_table_throws_only_while_it_is_switched(machine: MachineProfile) -> None:
    assert checked("Y2500 Z1000\nDWELL10", machine).findings == ()
    turn = "Y10000\n"
    cut = f"{turn}I51=1\n{turn}Y10000 Z1000\n{turn}Y10000 Z-1000\n"
    assert thrown(checked(f"{cut}{turn * 3}I51=0\n{turn}I51=1\n{turn}", machine)) == []
    # Two moves ahead the carriage may still be on its way.
    assert [line for line, _ in thrown(checked(f"{cut}{turn}I51=0\n{turn}I51=1\n{turn}", machine))] == [FIRST + 9]


def test_a_throw_is_told_in_counts_and_um_also_by_i51_before_the_program(machine: MachineProfile) -> None:
    """At rest at a quarter of a turn and Z1000: 800/16 = 50 counts of 0.2 um."""
    found = checked("Y2500 Z1000\nDWELL10\nI51=1\nDWELL10", machine)
    finding = only(found, FindingCode.TABLE_THROWS)
    assert (finding.severity, finding.lines) == (Severity.WARNING, (FIRST + 2,))
    assert finding.values == {"motor": 1, "counts": 50, "length": pytest.approx(10), "unit": "um"}
    # One source, of which nothing is known: 640/16 = 40 counts, in the line that comes last.
    table = "#1DEFINE COMP 4,#2,#1,10000\n0 640 0 0\n"
    assert thrown(checked("X100", machine, f"{table}I51=1\n")) == [(3, 40)]
    assert thrown(checked("X100", machine, f"I51=1\n{table}")) == [(3, 40)]
    assert thrown(checked("X100", machine, f"I51=1\n{table}I51=0\n")) == []


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


def test_a_throw_is_a_share_between_rows_and_counts_what_is_left_in_the_register(machine: MachineProfile) -> None:
    """Z400 is 0.4 of the way to the row of 50 counts."""
    assert thrown(checked("Y2500 Z400\nDWELL10\nI51=1\nDWELL10", machine)) == [(FIRST + 2, 20)]
    # Off at 50 counts; on again in a row of zeros, where it falls back by 50; on where it was left: nothing.
    off = "I51=1\nY2500 Z1000\nDWELL10\nI51=0\nDWELL10\n"
    assert thrown(checked(f"{off}I51=1\nDWELL10", machine)) == []
    assert thrown(checked(f"{off}Z-1000\nDWELL10\nI51=1\nDWELL10", machine)) == [(FIRST + 7, 50)]
    # From 50 at a quarter to -20 at three quarters of a turn.
    assert thrown(checked(f"{off}Y5000\nDWELL10\nI51=1\nDWELL10", machine)) == [(FIRST + 7, 70)]


def test_a_source_may_be_anywhere_on_its_moves_unless_homed_or_started(machine: MachineProfile) -> None:
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
    # The spindle turns by itself, by a jog: the worst of its row, 50 counts.
    assert thrown(checked("Z1000\nDWELL10\nI51=1\nDWELL10", machine)) == [(FIRST + 2, 50)]
    assert thrown(checked("Z3000\nDWELL10\nI51=1\nDWELL10", machine)) == []
    assert thrown(checked("HOME3\nI51=1\nDWELL10", machine)) == []
    assert thrown(checked("I51=1\nDWELL10", machine)) == [(FIRST, 50)]
    text = f"; starts at Y7500 Z1500\n{CAM}I51=1\n{OPEN}Y100 Z100\nCLOSE\n"
    assert thrown(check_program(text, machine)) == [(7, 20)]


def test_contributions_add_and_the_same_line_is_told_once(machine: MachineProfile) -> None:
    two = "#2DEFINE COMP 2,#3,#1,2000\n160 0\n#1DEFINE COMP 2,#2,#1,10000\n320 0\n"
    found = checked("Y5000 Z500\nDWELL10\nI51=1\nDWELL10", machine, two)
    assert thrown(found) == [(10, 20 + 5)]
    found = checked("Y5000\nDWELL10\nI51=1\nDWELL10", machine, "#5DEFINE COMP 2,#2,#5,10000\n320 0\n")
    assert only(found, FindingCode.TABLE_THROWS_OTHER).values["counts"] == 20
    # -20, 50 (half of it at 1250) and 0 counts, each time from a register that was left at zero.
    program = "Z1000\nP1=0\nWHILE(P1<4)\nY1250\nDWELL10\nI51=1\nDWELL10\nY-1250\nDWELL10\nI51=0\nP1=P1+1\nENDWHILE"
    assert thrown(checked(program, machine)) == [(FIRST + 5, 25)]


def test_what_a_table_has_to_hold(machine: MachineProfile) -> None:
    found = checked("X100", machine, "#1 DEFINE COMP 4,#2,#1,10000\n0 160 0\n-40\n")
    finding = only(found, FindingCode.TABLE_LAST_ENTRY)
    assert (finding.severity, finding.lines) == (Severity.WARNING, (3,))
    assert finding.values["counts"] == -2.5
    assert finding.values["length"] == pytest.approx(-0.5)
    assert checked("Y100", machine, "#1DEFINE COMP 1.1,#2,#3,#1,10000,3000\n0 0 160\n").findings == ()
    found = checked("X100\nI51=1\nX100", machine, "#1DEFINE COMP 4,#2,#1,10000\n640 640\n")
    finding = only(found, FindingCode.TABLE_UNFILLED)
    assert finding.lines == (1,)
    assert finding.values == {"motor": 1, "entries": 2, "wanted": 4}
    assert thrown(found) == []


def test_tables_are_defined_from_high_to_low_and_deleted_from_low_to_high(machine: MachineProfile) -> None:
    low = "#1DEFINE COMP 2,#2,#1,10000\n16 0\n"
    high = "#4DEFINE COMP 2,#2,#4,10000\n16 0\n"
    assert checked("Y100", machine, high + low).findings == ()
    found = checked("Y100", machine, low + high)
    (finding,) = found.findings
    assert (finding.code, finding.severity, finding.lines) == (FindingCode.TABLE_ORDER, Severity.REFUSAL, (3,))
    assert (finding.values["motor"], finding.values["lower"]) == (4, "1")
    deleted = f"{low}#1DELETE COMP\n{high}"
    assert checked("Y100", machine, deleted).findings == ()
    both = "#4DEFINE COMP 1,100\n0\n#1DEFINE COMP 1,100\n0\n"
    assert only(checked("X100", machine, f"{both}#4DELETE COMP\n"), FindingCode.TABLE_ORDER).lines == (5,)


@pytest.mark.parametrize(
    "line", ["1 2 3 4", "1.5", "9999999", "#9DEFINE COMP 1,100", "#1DEFINE COMP 0,100", "#0DELETE COMP"]
)
def test_what_the_card_does_not_take_is_told(machine: MachineProfile, line: str) -> None:
    found = checked("X100", machine, f"#1DEFINE COMP 3,#2,#1,10000\n{line}\n0 0 0\n")
    assert only(found, FindingCode.LINE_REFUSED).lines == (2,)
    assert FindingCode.TABLE_UNFILLED not in {finding.code for finding in found.findings}


def test_the_address_of_another_line_holds(machine: MachineProfile) -> None:
    found = checked("X100", machine, "#1J/#3J/\nDEFINE COMP 1,100\n8\n")
    assert only(found, FindingCode.TABLE_LAST_ENTRY).values["motor"] == 3


def test_a_text_keeps_its_tables_apart_from_its_other_lines() -> None:
    read = read_program(f"P5=1 ; a remark\n{CAM}I51=0 #2 DELETE COMP\n{OPEN}CLOSE\n")
    (sent,) = read.tables
    assert sent.table is not None
    assert sent.table.correction(2500, 1500) == 50
    assert (sent.place, sent.last_place) == (3, 6)
    assert read.commands == ("#1",)
    assert read.setting_places == (1, 7)
    assert read.lines[:3] == ("P5=1", "#1", "DEFINE COMP 3.4,#2,#3,#1,10000,3000")
