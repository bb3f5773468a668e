"""Lines of programs: how they are read, written and listed."""

from __future__ import annotations

import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.parser import parse_line, parse_statement
from drivers.pmac.language.structure import link
from drivers.pmac.language.syntax import (
    Assign,
    AxisWord,
    Binary,
    Comparison,
    Else,
    EndIf,
    EndWhile,
    If,
    Junction,
    Line,
    Move,
    Negate,
    Number,
    Positioning,
    SelectMode,
    Set,
    Statement,
    Variable,
    VariableKind,
    Wait,
    While,
)
from drivers.pmac.language.text import (
    format_condition,
    format_constant,
    format_expression,
    format_line,
    format_number,
)
from tests.drivers.language.trees import lines

PROG_1 = """\

 
;x:공구이송축, y:공작물이송축
P100=1000 ;1000rpm set
P200=2500 ;Rotary encoder pulse
P300=10000/6 ;1/6 회전
P400=1/(2* 103*50) ;50Hz 일때의 x 축 move time
P500= 275 ;55μm 보상시 x 축 이송변위
; (55μm*0.2=275)
; 실험 2 의 경우는 P500=165

close
OPEN PROG 1
CLEAR
INC
M26=0

ta10 ts10 f50000
x500 ;척삭깊이 0.1mm(500count*0.2μm)
; 실험 2 의 경우는 x300

WHILE(M26=0)
P1=((P100*P200)/60*4) F(P1) Y(P300) tm(P400) X(P500) ;
공구 1 회 전진, 공작물 1/6 회전
P1=((P100*P200)/60*4) F(P1) Y(P300) tm(P400) X(-P500) ;
공구 1 회 후퇴, 공작물 1/6 회전
ENDW

ta10 ts10 f50000 x10000
CLOSE
    
"""  # noqa: W293 - as printed
WRAPPED_COMMENTS = ("공구 1 회 전진, 공작물 1/6 회전", "공구 1 회 후퇴, 공작물 1/6 회전")
ONLINE_ONLY = ("close", "OPEN PROG 1", "CLEAR", "CLOSE")


def p(index: int) -> Variable:
    return Variable(VariableKind.P, Number(index))


def on_the_wire(line: str) -> str:
    return line.encode().decode("latin-1")


def refusal_of(text: str) -> int:
    with pytest.raises(PmacError) as refusal:
        parse_line(text)
    return refusal.value.code


def test_the_published_program_reads_as_it_is_meant() -> None:
    lines = PROG_1.split("\n")
    body = lines[lines.index("INC") : lines.index("CLOSE")]
    program = tuple(parse_line(on_the_wire(line)) for line in body if line not in WRAPPED_COMMENTS)
    speed = Binary("*", Binary("/", Binary("*", p(100), p(200)), Number(60)), Number(4))
    preamble = (Set("TA", Number(10)), Set("TS", Number(10)), Set("F", Number(50000)))

    def stroke(x: Variable | Negate) -> tuple[Statement, ...]:
        move = Move((AxisWord("Y", p(300)), AxisWord("X", x)))
        return (Assign(p(1), speed), Set("F", p(1)), Set("TM", p(400)), move)

    assert [line for line in program if line] == [
        (Positioning(incremental=True),),
        (Assign(Variable(VariableKind.M, Number(26)), Number(0)),),
        preamble,
        (Move((AxisWord("X", Number(500)),)),),
        (While(Comparison("=", Variable(VariableKind.M, Number(26)), Number(0))),),
        stroke(p(500)),
        stroke(Negate(p(500))),
        (EndWhile(),),
        (*preamble, Move((AxisWord("X", Number(10000)),))),
    ]
    code = link(program)
    loop = next(i for i, statement in enumerate(code.instructions) if isinstance(statement, While))
    end = next(i for i, statement in enumerate(code.instructions) if isinstance(statement, EndWhile))
    assert (code.jumps[loop], code.jumps[end]) == (end + 1, loop)


def test_the_published_program_line_by_line() -> None:
    for line in PROG_1.split("\n"):
        text = on_the_wire(line)
        if line in WRAPPED_COMMENTS:
            assert refusal_of(text) == ErrorCode.ILLEGAL_CHARACTER
        elif line in ONLINE_ONLY:
            assert refusal_of(text) == ErrorCode.DATA_ERROR
        else:
            parse_line(text)


@pytest.mark.parametrize("text", ["", "   ", ";", "; X10", "\r\n"])
def test_a_line_without_statements_is_empty(text: str) -> None:
    assert parse_line(text) == ()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("ta10ts10tm(P400)", (Set("TA", Number(10)), Set("TS", Number(10)), Set("TM", p(400)))),
        ("LIN", (SelectMode("LINEAR"),)),
        ("LinEar", (SelectMode("LINEAR"),)),
        ("ABS", (Positioning(False),)),
        ("INC(X,Y)", (Positioning(True, ("X", "Y")),)),
        ("PVT20", (Set("PVT", Number(20)),)),
        ("X10:-5", (Move((AxisWord("X", Number(10), Number(-5)),)),)),
        ("X(P1):(P2)", (Move((AxisWord("X", p(1), p(2)),)),)),
        ("DWE100", (Wait("DWELL", Number(100)),)),
        ("delay(P1)", (Wait("DELAY", p(1)),)),
        ("DLY5", (Wait("DELAY", Number(5)),)),
        ("P(P1)=$F F5", (Assign(Variable(VariableKind.P, p(1)), Number(15)), Set("F", Number(5)))),
        ("endw", (EndWhile(),)),
        ("End If", (EndIf(),)),
        ("ENDI", (EndIf(),)),
        ("else", (Else(),)),
        ("ELSE DWELL 500", (Else(inline=True), Wait("DWELL", Number(500)))),
        ("I5213=10", (Assign(Variable(VariableKind.I, Number(5213)), Number(10)),)),
        ("A1 B2 C-3", (Move((AxisWord("A", Number(1)), AxisWord("B", Number(2)), AxisWord("C", Number(-3)))),)),
    ],
)
def test_statements(text: str, expected: tuple[Statement, ...]) -> None:
    assert parse_line(text) == expected


@pytest.mark.parametrize(
    ("text", "canonical"),
    [
        ("RPD", "RAPID"),
        ("cir 1", "CIRCLE1"),
        ("DWE 5", "DWELL5"),
        ("HM 1..3,5", "HOME1,2,3,5"),
        ("HMZ2", "HOMEZ2"),
        ("PSETX0Y(P1)", "PSET X0 Y(P1)"),
        ("NRM I1 K-1", "NORMAL I1 K-1"),
        ("BSTART", "BLOCKSTART"),
        ("BSTOP", "BLOCKSTOP"),
        ("Go Sub 101", "GOSUB101"),
        ("RET", "RETURN"),
        ("O 100", "N100"),
        ("END WHILE", "ENDWHILE"),
        ("while(m11=0)wait", "WHILE(M11=0) WAIT"),
        ("G01X5", "G1 X5"),
        ('COMMANDP"#1J+"', 'CMDP"#1J+"'),
        ('DISP"a"', 'DISPLAY"a"'),
        ("DIS PLC 1..3", "DISABLE PLC 1,2,3"),
        ("M 1 = = 5", "M1==5"),
    ],
)
def test_each_statement_has_one_spelling_when_it_is_listed(text: str, canonical: str) -> None:
    assert format_line(parse_line(text)) == canonical


def test_behind_a_call_and_a_condition_words_keep_their_order() -> None:
    assert format_line(parse_line("X1 F5 G1 Y2 F100 Z3 X4")) == "F5 X1 G1 Y2 F100 Z3 X4"
    assert axes_of("NORMAL K-1 X10 I5") == ["Normal", "XI"]
    assert axes_of("PSET X10 Y5 F3 Z4") == ["Preset", "Set", "Z"]
    condition = Comparison("!<", p(1), Number(5))
    x10 = Move((AxisWord("X", Number(10)),))
    assert parse_line("IF (P1 !< 5) X10") == (If(condition, inline=True), x10)
    assert parse_line("IF (P1 !< 5) ; X10") == (If(condition),)
    assert parse_line("WHILE(P1!<5)X10") == (While(condition, inline=True), x10)


def axes_of(text: str) -> list[str]:
    """Write the statements down by kind, moves by their letters."""
    return [
        "".join(word.axis for word in statement.words) if isinstance(statement, Move) else type(statement).__name__
        for statement in parse_line(text)
    ]


def test_the_axis_words_of_a_line_move_together_between_modal_words_and_assignments() -> None:
    assert axes_of("X1 Y2 Z3") == ["XYZ"]
    assert axes_of("X1 TM5 Y2") == ["Set", "XY"]
    assert axes_of("X1 P1=2 INC Y2 LINEAR") == ["Assign", "Positioning", "SelectMode", "XY"]
    assert axes_of("X1 F100") == ["Set", "X"]
    assert axes_of("X1 X2 TM5") == ["Set", "X", "X"]
    assert axes_of("X1 P1=5 F(P1)") == ["Assign", "Set", "X"]
    assert axes_of("X(P1) P1=P1+1") == ["X", "Assign"]
    assert axes_of("X(P1) P1=P1+1 Y(P1)") == ["Assign", "XY"]
    assert axes_of("X(P1) P1=P1+1 X(P1)") == ["X", "Assign", "X"]


def test_a_repeated_axis_or_a_wait_begins_another_move() -> None:
    assert axes_of("X1 X2") == ["X", "X"]
    assert axes_of("X1 Y1 X2 Z2") == ["XY", "XZ"]
    assert axes_of("X1 DWELL5 Y2") == ["X", "Wait", "Y"]
    assert axes_of("X1 IF(P1=1) Y2") == ["X", "If", "Y"]


@pytest.mark.parametrize(
    "text",
    [
        "J+",
        "X",
        "XP1",
        "X 1 0",
        "X+5",
        "F",
        "P1",
        "P1=",
        "P1==2",
        "M1->Y:$FFC2,8",
        "I130..135",
        "FOO",
        "5",
        "X10 5",
        "X(P1",
        "X10)",
        "INC(Q)",
        "INC(X",
        "INC(X,)",
        "WHILE P1=0",
        "WHILE(P1)",
        "WHILE(P1<=2)",
        "IF((P1=0) AND (P2=1))",
        "X10:",
        "X1:2:3",
        "TA",
        "DWELL",
        "SPLINE",
        '"X1"',
        "X10,Y10",
        "X\x071",
        "N-1",
        "GOTO",
        "CALL",
        "HOME33",
        "HOME3..1",
        "PSET",
        "PSET P1",
        "NORMAL",
        "NORMAL X1",
        "FRAX(R)",
        "INC(I)",
        "SPLINE3",
        "CIRCLE3",
        "READ(TA)",
        "ADDRESS#1",
        "M1=",
        "M1==",
        "I100==1",
        "Q1|=1",
    ],
)
def test_anything_else_is_a_data_error(text: str) -> None:
    assert refusal_of(text) == 3


ON_LINE = ["J+", "F", "A", "B", "P1", "P(P1)", "I130..135", "M1->", "OPEN", "?", "", "Q", "R", "S", "O", "HM", "K"]
ON_LINE += "HOME I100,3,2 M1..8 M1,3,2 M1->* G N CMD SEND ENABLE DATE TYPE #1".split()


@pytest.mark.parametrize("text", ON_LINE)
def test_an_on_line_command_is_left_to_the_caller(text: str) -> None:
    scanner = Scanner(text)
    assert parse_statement(scanner) is None
    assert scanner.rest == text


def test_statements_can_be_taken_one_by_one() -> None:
    scanner = Scanner("P1=1 F100 #1J+")
    assert parse_statement(scanner) == Assign(p(1), Number(1))
    assert parse_statement(scanner) == Set("F", Number(100))
    assert parse_statement(scanner) is None
    assert scanner.rest == "#1J+"


# Text from trees: what is written is read back as the same tree.


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


def test_an_expression_is_written_alone_and_without_needless_parentheses() -> None:
    assert format_line(parse_line("P1=((P100*P200)/60*4)")) == "P1=P100*P200/60*4"
    assert format_expression(Binary("*", Binary("+", Number(1), Number(2)), Number(3))) == "(1+2)*3"


def test_a_condition_or_sign_that_would_be_read_as_something_else_is_not_written() -> None:
    x, y = Move((AxisWord("X", Number(1)),)), Move((AxisWord("Y", Number(1)),))
    one = Comparison("=", Number(1), Number(1))
    for line in ((x, y), (x, Set("TM", Number(1))), (If(one), x), (If(one, inline=True),)):
        with pytest.raises(ValueError, match=r"line"):
            format_line(line)
    either = Junction("OR", one, one)
    for condition in (Junction("AND", either, one), Junction("AND", one, either), Junction("OR", one, either)):
        with pytest.raises(ValueError, match="parentheses"):
            format_condition(condition)
    assert format_condition(Junction("OR", either, one)) == "1=1 OR 1=1 OR 1=1"
