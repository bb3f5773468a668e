"""Lines as the card lists them; the expected texts are those of listings of real cards."""

from __future__ import annotations

import pytest
from hypothesis import given

from drivers.pmac.language.listing import listed, stored_line, stored_plc_lines, without_end
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


@pytest.mark.parametrize(("typed", "texts"), PLC.items())
def test_a_line_of_a_plc(typed: str, texts: tuple[str, ...]) -> None:
    assert tuple(line.text for line in stored_plc_lines(typed)) == texts


@given(trees.lines)
def test_a_listed_line_is_the_line_that_was_typed(line: Line) -> None:
    kept = stored_line(format_line(line))
    assert kept.statements == line
    assert parse_line(kept.text) == line
    assert stored_line(kept.text).text == kept.text


@pytest.mark.parametrize("texts", [(), ("X1",), ("X1", "RETURN")])
def test_a_listing_that_is_sent_back_is_listed_the_same(texts: tuple[str, ...]) -> None:
    once = listed(texts)
    assert once[-1] == "RETURN"
    assert listed(once) == listed(without_end(once)) == once
