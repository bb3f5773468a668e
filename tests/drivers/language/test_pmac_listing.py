"""Lines as the card lists them; the expected texts are those of listings of real cards."""

from __future__ import annotations

import pytest
from hypothesis import given

from drivers.pmac.language.listing import stored_line, stored_plc_lines, with_end, without_end
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.syntax import Line
from drivers.pmac.language.text import format_line
from tests.drivers.language import trees

PROGRAM = {
    "x(p1) y(p2)": "X(P1)Y(P2)",
    "ta10 ts0": "TA10TS0",
    "if (p1 = 1 and m2 = 0)": "IF(P1=1ANDM2=0)",
    'cmd "#1j+"': 'COMMAND"#1j+"',
    "CMD^A": "COMMAND^A",
    "dwe 20": "DWELL20",
    "dly(p1)": "DELAY(P1)",
    "end while": "ENDWHILE",
    "ENDW": "ENDWHILE",
    "hmz 25..27": "HOMEZ25..27",
    "home 1..3, 5": "HOME1..3,5",
    "enable plc 2": "ENABLEPLC2",
    "dis plc 2..31": "DISABLEPLC2..31",
    "P1=((P2+1))*(3)": "P1=((P2+1))*(3)",
    "X10 F5 Y20": "X10F5Y20",
    "X0.50 Y.5 Z10.": "X0.5Y0.5Z10",
    "P1=$F P2=007": "P1=15P2=7",
    "lin": "LINEAR",
    "cir2 X1 Y2 R5": "CIRCLE2X1Y2R5",
    'send "a b; C"': 'SEND"a b; C"',
    "ret": "RETURN",
    "O5 X1": "N5X1",
    "gos 100": "GOSUB100",
    "pau plc 3": "PAUSEPLC3",
}
SHORT = {
    # The manuals give both spellings, or use the short one in an example.
    'command"#1j+"': 'CMD"#1j+"',
    'commands"p1"': 'CMDS"p1"',
    "command^a": "CMD^A",
    "dwell 20": "DWE20",
    "end while": "ENDW",
    "linear": "LIN",
    "return": "RET",
    # Spellings that public readers of listings know.
    "delay(p1)": "DLY(P1)",
    "end if": "ENDI",
    "home 1..3, 5": "HM1..3,5",
    "homez 25..27": "HMZ25..27",
    "rapid x1": "RPDX1",
    "circle2 X1 Y2 R5": "CIR2X1Y2R5",
    "normal k-1": "NRMK-1",
    "blockstart": "BSTART",
    "enable plc 2": "ENAPLC2",
    "disable plc 2..31": "DISPLC2..31",
    "pause plc 3": "PAUPLC3",
    "resume plc 3": "RESPLC3",
    # Chosen to stay whole: no listing is known that shortens them.
    "gosub 100": "GOSUB100",
    'disp "x"': 'DISPLAY"x"',
    "if (p1=1) spline1": "IF(P1=1)SPLINE1",
    'send "linear"': 'SEND"linear"',
}
PLC = {
    "if (p1=1) adr&2#4": ("IF(P1=1)", "ADDRESS&2#4"),
    "disable plc 2..31": ("DISABLEPLC2..31",),
    "enaplc 2": ("ENABLEPLC2",),
    "return": (),
}


@pytest.mark.parametrize(("typed", "text"), PROGRAM.items())
def test_a_line_of_a_program(typed: str, text: str) -> None:
    assert stored_line(typed).text == text


@pytest.mark.parametrize(("typed", "text"), SHORT.items())
def test_a_line_in_short(typed: str, text: str) -> None:
    kept = stored_line(typed)
    assert kept.listed(in_full=False) == text
    assert stored_line(text) == kept


@pytest.mark.parametrize(("typed", "texts"), PLC.items())
def test_a_line_of_a_plc(typed: str, texts: tuple[str, ...]) -> None:
    assert tuple(line.text for line in stored_plc_lines(typed)) == texts


@given(trees.lines)
def test_a_listed_line_is_the_line_that_was_typed(line: Line) -> None:
    kept = stored_line(format_line(line))
    assert kept.statements == line
    assert parse_line(kept.text) == line
    assert stored_line(kept.text).text == kept.text


@given(trees.lines)
def test_a_line_that_is_listed_in_short_is_read_back_as_the_same_line(line: Line) -> None:
    kept = stored_line(format_line(line))
    assert stored_line(kept.listed(in_full=False)) == kept


@pytest.mark.parametrize(
    "typed", ["ENDIF F100", "ENDI", "LINEAR X1", "ENDIF ENDIF F(P1)", "RETURN N5", "ELSE ENDIF I5"]
)
def test_a_short_word_is_not_taken_for_the_beginning_of_a_longer_one(typed: str) -> None:
    kept = stored_line(typed)
    assert parse_line(kept.listed(in_full=False)) == parse_line(kept.text) == kept.statements


@pytest.mark.parametrize("in_full", [True, False])
@pytest.mark.parametrize("typed", [(), ("X1",), ("X1", "RETURN"), ("X1", "ret")])
def test_a_listing_that_is_sent_back_is_listed_the_same(typed: tuple[str, ...], in_full: bool) -> None:
    def listed(texts: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(line.listed(in_full=in_full) for line in with_end([stored_line(text) for text in texts]))

    once = listed(typed)
    assert once[-1] == ("RETURN" if in_full else "RET")
    assert listed(once) == listed(without_end(once)) == once
