"""The text of PLC programs: what may stand in them, how it is listed, and what belongs to motion programs only."""

from __future__ import annotations

import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.plc_statements import parse_plc_line, stored_lines
from drivers.pmac.language.syntax import PlcLine
from drivers.pmac.language.text import format_plc_line
from tests.drivers.language.plc_trees import plc_lines


@given(plc_lines)
def test_a_listed_line_is_read_back_as_the_same_line(line: PlcLine) -> None:
    assert parse_plc_line(format_plc_line(line)) == line


@given(plc_lines, st.randoms(use_true_random=False))
def test_case_and_white_space_change_nothing(line: PlcLine, random: object) -> None:
    choice = random.choice  # type: ignore[attr-defined]
    text = format_plc_line(line)
    loose, quoted_text = "", False
    for here, following in zip(text, f"{text} "[1:], strict=True):
        quoted_text ^= here == '"'
        loose += here if quoted_text else choice([here.upper(), here.lower()])
        if not quoted_text and not (here in string.digits + "." and following in string.digits + "."):
            loose += choice(["", "", " ", "\t"])
    assert parse_plc_line(loose + choice(["", " ; AND(", ";\xb0"])) == line


@given(plc_lines)
def test_what_is_stored_says_the_same_and_is_listed_line_by_line(line: PlcLine) -> None:
    kept = stored_lines(line)
    assert sum(kept, ()) == line
    for part in kept:
        assert stored_lines(parse_plc_line(format_plc_line(part))) == (part,)


def reads_or_refuses(text: str) -> None:
    try:
        line = parse_plc_line(text)
    except PmacError as refusal:
        assert refusal.code in (3, 4)
    else:
        assert parse_plc_line(format_plc_line(line)) == line


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(noise: bytes) -> None:
    reads_or_refuses(noise.decode("latin-1"))


fragments = [
    "P1",
    "=",
    "IF",
    "WHILE",
    "AND",
    "OR",
    "(",
    ")",
    "1",
    "ADR",
    "#",
    "&",
    "CMD",
    "^",
    "ELSE",
    "ENDI",
    "ENDW",
]
fragments += ["ENA", "PLC", "SEND", '"', "X", "I5", " ", "-", "ADDRESS", "9" * 30]


@given(st.lists(st.sampled_from(fragments), max_size=40).map("".join))
def test_any_jumble_of_words_is_read_or_refused(text: str) -> None:
    reads_or_refuses(text)


@pytest.mark.parametrize(
    "text",
    [
        "IF(M11=1 OR M12=1)",
        "AND(M13=1 OR M14=1)",
        "OR(P1!>5)",
        "WHILE(I5111>0)",
        "ENDWHILE",
        "ELSE",
        "ENDIF",
        "P(P1+1)=SIN(Q3)*2",
        "I5111=P1*8388608/I10",
        "ADDRESS#1",
        "ADDRESS&2",
        "ADDRESS#8&3",
        'CMD"#1J/" CMD^A SENDS"Lease lost" DISPLAY8"P 1"',
        "ENABLE PLC 1,2,3",
        "DISABLE PLC 3",
    ],
)
def test_plc_text_is_listed_as_it_was_written(text: str) -> None:
    assert format_plc_line(parse_plc_line(text)) == text


def test_the_short_words_are_listed_in_full() -> None:
    assert format_plc_line(parse_plc_line("adr & 2 # 4")) == "ADDRESS#4&2"
    assert format_plc_line(parse_plc_line("endi endw dis plc 2..4")) == "ENDIF ENDWHILE DISABLE PLC 2,3,4"


@pytest.mark.parametrize(
    "text",
    [
        "X10",
        "LINEAR",
        "F100",
        "TA50",
        "DWELL10",
        "HOME1",
        "WAIT",
        "STOP",
        "N100",
        "GOTO100",
        "GOSUB100",
        "CALL500",
        "M3",
        "G1",
        "RETURN",
        "READ(X)",
        "S1000",
        "BLOCKSTART",
        "M1==1",
        "M1&=1",
        "P1=2 X10",
        "IF(P1)",
        "AND P1=1",
        "AND(P1=1",
        "ADDRESS",
        "ADDRESS#",
        "ADDRESS#0",
        "ADDRESS#33",
        "ADDRESS&17",
        "ADDRESS#1#2",
        "ENABLE PLC 32",
    ],
)
def test_anything_else_is_refused_as_err003(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        parse_plc_line(text)
    assert refusal.value.code == 3


@pytest.mark.parametrize("text", ["AND(P1=1)", "OR(P1=1)", "ADDRESS#1", "ADR&2", "IF(P1=1) AND(P2=1)"])
def test_none_of_this_is_legal_in_a_motion_program(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        parse_line(text)
    assert refusal.value.code == 3


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("IF(P1=1) P2=3 P4=5", ["IF(P1=1)", "P2=3 P4=5"]),
        ("WHILE(P1=1) ENDWHILE", ["WHILE(P1=1)", "ENDWHILE"]),
        ("ENDIF ELSE P1=2", ["ENDIF ELSE", "P1=2"]),
        ("IF(P1=1) AND(P2=1) OR(P3=1) P4=1", ["IF(P1=1)", "AND(P2=1)", "OR(P3=1)", "P4=1"]),
        ("P1=1 P2=2", ["P1=1 P2=2"]),
        ("; nothing", []),
    ],
)
def test_what_stands_behind_a_condition_goes_to_the_next_line(text: str, kept: list[str]) -> None:
    """Software Reference, ELSE: a PLC puts it there and expects an ENDIF."""
    assert [format_plc_line(line) for line in stored_lines(parse_plc_line(text))] == kept
