"""Texts as strangers would download them: settings, definitions, several buffers, comments and commands."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.syntax import Label, Return
from drivers.pmac.language.text import format_line
from drivers.pmac.program_text import read_program

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


def test_an_example_of_the_quick_reference_is_taken_apart() -> None:
    text = read_program(FULL_CIRCLE)
    assert text.number == 1
    assert list(map(format_line, text.program)) == [
        "INC",
        "INC(R)",
        "TA300",
        "TS0",
        "TM1000",
        "I13=10",
        "NORMAL K-1",
        "CIRCLE1",
        "X0 Y0 I10",
    ]
    assert text.commands == ("delete gather", "undefine all", "&1", "&1", "b1r")
    assert [(d.motor, str(d)) for d in text.definitions] == [(2, "2000Y")]
    assert text.lines[:6] == ("close", "delete gather", "undefine all", "&1", "#2->2000Y", "open prog1 clear")


def test_comments_stay_on_the_host_but_not_those_in_quotes() -> None:
    text = read_program('OPEN PROG 2 ; one\nCLEAR\nCMD"A;B" ; "two"\n; three\n\nCLOSE')
    assert text.lines == ("OPEN PROG 2", "CLEAR", 'CMD"A;B"', "CLOSE")


def test_blank_lines_and_comments_are_no_lines_of_the_program() -> None:
    assert len(read_program("OPEN PROG 2 CLEAR\n\nX1\n;\n\nX2\nCLOSE").program) == 2


def test_other_programs_of_a_text_are_subprograms_and_can_be_called() -> None:
    text = read_program(
        "OPEN PROG 1000 CLEAR\nN1000 RETURN\nCLOSE\nOPEN PROG 5 CLEAR\nG1\nCLOSE\nOPEN PROG 6\nX1 CLOSE"
    )
    assert text.number == 5
    assert sorted(text.subprograms) == [6, 1000]
    code = text.code(1000)
    assert code is not None and code.instructions == (Label(1000), Return())
    assert text.code(5) is not None and text.code(6) is not None
    assert text.code(7) is None


def test_a_text_of_code_programs_alone_has_the_first_of_them_as_its_program() -> None:
    assert read_program("OPEN PROG 1001 CLEAR\nRET\nCLOSE\nOPEN PROG 1000 CLEAR\nRET\nCLOSE").number == 1001


def test_clear_empties_the_open_program_and_without_it_lines_are_added() -> None:
    assert len(read_program("OPEN PROG 1\nX1\nCLOSE\nOPEN PROG 1\nX2\nCLOSE").program) == 2
    assert len(read_program("OPEN PROG 1\nX1\nCLEAR\nX2\nCLOSE\nCLR").program) == 1


def test_open_close_and_clear_may_share_lines_and_be_spelt_as_others_do() -> None:
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
    [
        "I20..44=0",
        "i5213,15,100=10",
        "M1->Y:$FFC2,8",
        "M1..8->*",
        "I100=*",
        "#1?",
        "#1J+",
        "B1R",
        "WX:$720,1",
        "$$$",
        "ENABLE PLC 1",
        "#1->",
        "DEFINE GATHER 100",
        "SAVE",
        "%100",
        "P1",
        "M1",
        "I100",
        "HOME",
        "PASSWORD=abc",
    ],
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
