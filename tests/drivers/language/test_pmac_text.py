"""Text from trees: what is written is read back as the same tree."""

from __future__ import annotations

import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.syntax import (
    AxisWord,
    Binary,
    Comparison,
    If,
    Junction,
    Line,
    Move,
    Number,
    Set,
)
from drivers.pmac.language.text import (
    format_condition,
    format_constant,
    format_expression,
    format_line,
    format_number,
)
from tests.drivers.language.trees import lines


@given(lines)
def test_a_written_line_is_read_back_as_the_same_tree(line: Line) -> None:
    assert parse_line(format_line(line)) == line


@given(lines, st.randoms(use_true_random=False))
def test_case_and_white_space_between_symbols_change_nothing(line: Line, random: object) -> None:
    choice = random.choice  # type: ignore[attr-defined]
    text = format_line(line)
    loose, quoted_text = "", False
    for here, following in zip(text, f"{text} "[1:], strict=True):
        quoted_text ^= here == '"'
        loose += here if quoted_text else choice([here.upper(), here.lower()])
        # Inside a number white space would end it, inside quotes it is text.
        if not quoted_text and not (here in string.digits + "." and following in string.digits + "."):
            loose += choice(["", "", " ", "\t", "  "])
    assert parse_line(loose + choice(["", ";", " ; X1 (", ";\xb0\x00"])) == line


def parses_or_refuses(text: str) -> None:
    try:
        line = parse_line(text)
    except PmacError as refusal:
        assert refusal.code in (3, 4)
    else:
        assert parse_line(format_line(line)) == line


@given(st.binary(max_size=300))
def test_any_bytes_are_read_or_refused(noise: bytes) -> None:
    parses_or_refuses(noise.decode("latin-1"))


fragments = ["P1", "=", "X", "(", ")", "10", ".5", "$F", "-", "WHILE", "IF", "ELSE", "ENDW", "AND", "OR", "<"]
fragments += ["G1", "CALL", "READ", "RET", "N", "PSET", "HOME", "CMD", "SEND^", "I5", "K", "PLC", "ENA", "..", "S"]
fragments += ["TA", "F", "INC", ":", ",", "SIN", "*", "&", " ", "M", "~", "!", "DWELL", '"', "1e5", "9" * 30]


@given(st.lists(st.sampled_from(fragments), max_size=60).map("".join))
def test_any_jumble_of_words_is_read_or_refused(text: str) -> None:
    parses_or_refuses(text)


@given(st.text(alphabet="XP10()-+=", max_size=400))
def test_any_jumble_of_symbols_is_read_or_refused(text: str) -> None:
    parses_or_refuses(text)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (-0.0, "0"),
        (-1e-12, "0"),
        (100.0, "100"),
        (1e15, "1000000000000000"),
        (0.1, "0.1"),
        (-27.5, "-27.5"),
        (1 / 3, "0.3333333333"),
        (1e-7, "0.0000001"),
        (10000 / 6, "1666.6666666667"),
    ],
)
def test_a_number_has_no_exponent_and_at_most_ten_decimals(value: float, text: str) -> None:
    assert format_number(value) == text


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_constant_is_written_without_loss(value: float) -> None:
    text = format_constant(value)
    assert float(text) == value
    assert set(text) <= set("-.0123456789")


@pytest.mark.parametrize(
    "text",
    [
        "P1=P100*P200/60*4 F(P1) TM(P400) Y(P300) X(-P500)",
        "P1=P2-(P3-P4) Q(P1+1)=-(P1+P2)*3",
        "P1=3^-3-(P2|P3)&7",
        "WHILE(M26=0 AND P620<P621)",
        "IF(P1!~5 OR P2=1 AND P3!<2) DWELL100",
        "INC(X,Y)",
        "PVT20 X10:-5 Y(P1):(P2)",
        "P1=SIN(30)*ATAN2(P5)",
        "NORMAL K-1",
        "CIRCLE1 X10 Y(P1) I5 J-2.5",
        "X10 R-4",
        "K33.333",
        "FRAX(X,Y)",
        "INC(R)",
        "PSET X0 Y(P1)",
        "HOMEZ1,2,3",
        "WHILE(M11=0) WAIT",
        "N101 X5 RETURN",
        "GOSUB(P1) GOTO20",
        "CALL500.1 X10 Y5 F3 Z7",
        "G4 P2000 M3 S1800",
        "READ(X,Y,P)",
        'CMD"&1A;" CMD^A SENDS"Part done" DISPLAY8"P 1"',
        "DISABLE PLC 1,2,3",
        "M1==1 M2&=254 M(P1)^=3",
    ],
)
def test_canonical_text_is_written_as_it_was_read(text: str) -> None:
    assert format_line(parse_line(text)) == text


def test_needless_parentheses_are_dropped() -> None:
    assert format_line(parse_line("P1=((P100*P200)/60*4)")) == "P1=P100*P200/60*4"


def test_what_would_be_read_as_something_else_is_not_written() -> None:
    x, y = Move((AxisWord("X", Number(1)),)), Move((AxisWord("Y", Number(1)),))
    condition = Comparison("=", Number(1), Number(1))
    for line in ((x, y), (x, Set("TM", Number(1))), (If(condition), x), (If(condition, inline=True),)):
        with pytest.raises(ValueError, match=r"line"):
            format_line(line)


def test_a_condition_that_needs_inner_parentheses_is_not_written() -> None:
    one = Comparison("=", Number(1), Number(1))
    either = Junction("OR", one, one)
    for condition in (
        Junction("AND", either, one),
        Junction("AND", one, either),
        Junction("OR", one, either),
    ):
        with pytest.raises(ValueError, match="parentheses"):
            format_condition(condition)
    assert format_condition(Junction("OR", either, one)) == "1=1 OR 1=1 OR 1=1"


def test_an_expression_is_written_alone() -> None:
    assert format_expression(Binary("*", Binary("+", Number(1), Number(2)), Number(3))) == "(1+2)*3"
