"""Words, expressions and blocks: how they are taken apart and calculated."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.language.errors import ErrorCode, EvaluationError, PmacError
from drivers.pmac.language.evaluate import compile_condition, compile_expression, evaluate, holds
from drivers.pmac.language.expressions import parse_condition, parse_data, parse_expression, parse_variable
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.structure import ExecutableProgram, link
from drivers.pmac.language.syntax import (
    Assign,
    Call,
    Else,
    EndWhile,
    If,
    Negate,
    Number,
    Variable,
    VariableKind,
    While,
)


class Values:
    """Variables by name; anything else is 0."""

    def __init__(self, **values: float) -> None:
        self.values = values

    def get(self, kind: VariableKind, index: int) -> float:
        return self.values.get(f"{kind}{index}", 0.0)


def value(text: str, *, degrees: bool = True, strict: bool = True, **values: float) -> float:
    scanner = Scanner(text)
    expression = parse_expression(scanner)
    assert scanner.at_end
    return evaluate(expression, Values(**values), degrees, strict=strict)


def truth(text: str, **values: float) -> bool:
    scanner = Scanner(text)
    condition = parse_condition(scanner)
    assert scanner.at_end
    return holds(condition, Values(**values))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("10*2/3", 6.666666667),
        ("10*(2/3)", 6.666666667),
        ("11%4", 3),
        ("-11%4", 1),
        ("11%-4", 3),
        ("-11%-4", -3),
        ("3%2.5", 0.5),
        ("-3%2.5", 2),
        ("3%-2.5", -2),
        ("-3%-2.5", 2),
        ("2^1", 3),
        ("2^2", 0),
        ("5^7", 2),
        ("$AA^$55", 0xFF),
        ("3^-3", -2),
        ("0.5^0.875", 0.375),
        ("INT(2.5)", 2),
        ("INT(-2.5)", -3),
        ("SIN(30)", 0.5),
    ],
)
def test_the_examples_of_the_software_reference(text: str, expected: float) -> None:
    assert value(text) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1+2*3", 7),
        ("(1+2)*3", 9),
        ("8/4/2", 1),
        ("8-4-2", 2),
        ("8-(4-2)", 6),
        ("1|2+4", 7),
        ("6&3+1", 3),
        ("1+6&3", 3),
        ("7^1|8", 14),
        ("-2*3", -6),
        ("2*-3", -6),
        ("2--3", 5),
        ("-(1+2)", -3),
        ("--2", 2),
        ("10000/6", 1666.6666666666667),
        ("1/(2* 103*50)", 1 / 10300),
        ("ABS(-3)+SQRT(16)+EXP(0)+LN(1)", 8),
        ("ATAN(1)", 45),
        ("ASIN(1)-ACOS(1)", 90),
        ("TAN(45)", 1),
        ("12&10|1", 9),
    ],
)
def test_operators_bind_in_two_levels_from_left_to_right(text: str, expected: float) -> None:
    assert value(text) == pytest.approx(expected)


def test_variables_are_read_by_number_and_angles_as_asked() -> None:
    assert value("P(P1+1)+I15+Q3*M26", P1=1, P2=5, I15=7, Q3=2, M26=10) == 32
    assert value("SIN(P1)", degrees=False, P1=math.pi / 6) == pytest.approx(0.5)
    assert value("ATAN(1)", degrees=False) == pytest.approx(math.pi / 4)


@pytest.mark.parametrize(("sine", "cosine", "angle"), [(1, 1, 45), (1, -1, 135), (-1, -1, -135), (0, 1, 0)])
def test_the_four_quadrant_arc_tangent_takes_its_cosine_from_q0(sine: float, cosine: float, angle: float) -> None:
    assert value("ATAN2(P1)", P1=sine, Q0=cosine) == pytest.approx(angle)


@pytest.mark.parametrize(
    "text",
    ["1/0", "1/P1", "5%0", "SQRT(-1)", "LN(0)", "ASIN(2)", "EXP(1000)", "P2*P2", "1/(P2*P2)", "ATAN(P2*P2)"],
)
def test_a_calculation_without_a_result_is_an_error(text: str) -> None:
    with pytest.raises(EvaluationError):
        value(text, P2=1e200)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("1/0", 2.0**47), ("-1/0", -(2.0**47)), ("7%0", 0), ("LN(0)", 0), ("SQRT(-1)", 0), ("ACOS(2)", 0)],
)
def test_the_controller_goes_on_with_a_substitute(text: str, expected: float) -> None:
    assert value(text, strict=False) == expected


def test_an_overflow_is_an_error_even_for_the_controller() -> None:
    with pytest.raises(EvaluationError):
        value("P2*P2", strict=False, P2=1e200)


@pytest.mark.parametrize(
    "text", ["", "+1", "P1+", "(1", "SIN 1)", "SIN30", "*2", "P", "()", "1+*2", "P()", "FOO(1)", "R1", "P1=2)"[4:]]
)
def test_what_is_no_expression_is_refused(text: str) -> None:
    scanner = Scanner(text)
    with pytest.raises(PmacError) as refusal:
        parse_expression(scanner)
        if not scanner.at_end:
            raise scanner.refusal("left over")
    assert refusal.value.code == ErrorCode.DATA_ERROR


@pytest.mark.parametrize(
    "text", ["(" * 200 + "1" + ")" * 200, "-" * 1000 + "1", "P(" * 500, "1" + "+1" * 5000, "SIN(" * 90]
)
def test_endless_nesting_is_refused(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        parse_expression(Scanner(text))
    assert refusal.value.code == ErrorCode.DATA_ERROR


def test_ten_levels_of_parentheses_are_accepted() -> None:
    assert value("(" * 10 + "1" + ")" * 10) == 1


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("500", Number(500)),
        ("-500", Number(-500)),
        ("$1F", Number(31)),
        ("(P500)", Variable(VariableKind.P, Number(500))),
        ("(-P500)", Negate(Variable(VariableKind.P, Number(500)))),
        ("(SIN(30))", Call("SIN", Number(30))),
        ("-0", Number(0)),
    ],
)
def test_data_is_a_constant_or_stands_in_parentheses(text: str, expected: object) -> None:
    assert parse_data(Scanner(text)) == expected


@pytest.mark.parametrize("text", ["P1", "-P1", "-(P1)", "+5", "(P1", "()", "", "SIN(1)"])
def test_data_without_parentheses_is_only_a_constant(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        parse_data(Scanner(text))
    assert refusal.value.code == ErrorCode.DATA_ERROR


@pytest.mark.parametrize("text", ["X1", "PVT5", "IF(P1=1)", "INC", "P", "M->", ""])
def test_no_variable_leaves_the_cursor_where_it_was(text: str) -> None:
    scanner = Scanner(text)
    assert parse_variable(scanner) is None
    assert scanner.rest == text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1<2", True),
        ("P1>5000", False),
        ("SIN(P2-P1)!>P300/1000", True),
        ("P1>-20 AND P1<20", True),
        ("P80=0 OR I120>300 AND I120<400", True),
        ("P80!=0 OR I120>300 AND I120<400", False),
        ("Q16!<Q17 AND Q16!>Q18 OR M136<256 AND M137<256", True),
        ("1=1 OR 1=1 AND 1=2", True),
        ("1=2 AND 1=1 OR 1=1", True),
        ("1~1.9", True),
        ("1~2", False),
        ("1!~2", True),
        ("1!~1.5", False),
        ("2!>2", True),
        ("2!<2", True),
        ("(P1+2)*3=6", True),
        ("M26=0 AND P620<P621", False),
        ("P1=$0 AND P2=0", True),
    ],
)
def test_conditions(text: str, expected: bool) -> None:
    assert truth(text) is expected


@pytest.mark.parametrize(
    "text", ["P1", "P1<=2", "P1>=2", "P1=<2", "P1==2", "(P1>-20) AND (P1<20)", "P1=1 AND", "OR P1=1", "!P1=1"]
)
def test_what_is_no_condition_is_refused(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        parse_condition(Scanner(text))
    assert refusal.value.code == ErrorCode.DATA_ERROR


def test_the_second_comparison_is_not_evaluated_when_the_first_decides() -> None:
    assert not truth("P1=1 AND 1/P1=1")
    assert truth("P1=0 OR 1/P1=1")


# The scanner: loose spelling, numbers, comments and refusals.

ONLINE = ("I", "P", "V", "F", "M", "?", "??", "???", "#", "&", "%")


def test_a_poll_without_any_space_is_taken_word_by_word() -> None:
    scanner = Scanner("i65???&1??%#1?PVFm190p99")
    taken: list[str | int] = []
    while not scanner.at_end:
        word = scanner.take_word(ONLINE)
        assert word is not None
        taken.append(word)
        number = scanner.take_integer()
        if number is not None:
            taken.append(number)
    expected = ["I", 65, "???", "&", 1, "??", "%", "#", 1, "?", "P", "V", "F", "M", 190, "P", 99]
    assert taken == expected


@pytest.mark.parametrize("text", ["ENDWHILE", "End While", "e n d\tw h i l e", " EndWhile ; End"])
def test_case_and_white_space_do_not_matter_inside_a_word(text: str) -> None:
    scanner = Scanner(text)
    assert scanner.accept("ENDWHILE")
    assert scanner.at_end


@pytest.mark.parametrize(
    ("text", "value"),
    [("12", 12.0), ("12.5", 12.5), (".5", 0.5), ("10.", 10.0), ("$1F", 31.0), ("$ff", 255.0), ("007", 7.0)],
)
def test_a_number_is_decimal_or_hexadecimal(text: str, value: float) -> None:
    scanner = Scanner(text)
    assert scanner.take_number() == value
    assert scanner.at_end


@pytest.mark.parametrize("text", ["-1", "+1", "$", ".", "E5", "", "$G"])
def test_a_number_has_no_sign_and_at_least_one_digit(text: str) -> None:
    scanner = Scanner(text)
    assert scanner.take_number() is None
    assert scanner.rest == text


def test_a_number_ends_before_a_range_white_space_and_an_exponent() -> None:
    scanner = Scanner("1E5")
    assert scanner.take_number() == 1.0
    assert scanner.rest == "E5"
    scanner = Scanner("1..3")
    assert scanner.take_number() == 1.0
    assert scanner.accept("..")
    assert scanner.take_number() == 3.0
    scanner = Scanner("$1 F100")
    assert scanner.take_number() == 1.0
    assert scanner.accept("F")
    assert scanner.take_number() == 100.0


def test_what_is_too_large_or_unfinished_is_refused_with_its_column() -> None:
    for digits in ("9" * 400, "$" + "F" * 400):
        with pytest.raises(PmacError) as refusal:
            Scanner(digits).take_number()
        assert refusal.value.code == ErrorCode.DATA_ERROR
    scanner = Scanner('"Ready')
    with pytest.raises(PmacError) as refusal:
        scanner.take_string()
    assert refusal.value.code == ErrorCode.DATA_ERROR
    error = Scanner("  X1").refusal("no")
    assert str(error) == "ERR003: column 3: no, found X1"
    assert str(PmacError(5)) == "ERR005"


def test_the_longest_word_wins_and_strings_and_comments_keep_what_they_hold() -> None:
    assert Scanner("ATAN2(1)").take_word(("ATAN", "ATAN2")) == "ATAN2"
    assert Scanner("ATAN(2)").take_word(("ATAN", "ATAN2")) == "ATAN"
    assert Scanner("X1").take_word(("ATAN", "ATAN2")) is None
    scanner = Scanner('send "Ready; go" ; comment')
    assert scanner.accept("SEND")
    assert scanner.take_string() == "Ready; go"
    assert scanner.at_end
    korean = "X1 ;공구이송축\x00\x07\x0b\x85".encode().decode("latin-1")
    scanner = Scanner(korean)
    assert scanner.rest == "X1"


@pytest.mark.parametrize("text", ["X1 공", "µ", "X\x80", '"é"', "\xa0X1"])
def test_a_high_character_outside_a_comment_is_illegal(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        Scanner(text)
    assert refusal.value.code == 4


def test_the_position_is_the_column_as_it_was_typed() -> None:
    scanner = Scanner("  X 1 0 ; end")
    assert scanner.position == 2
    assert scanner.accept("X")
    assert scanner.position == 4
    mark = scanner.mark()
    scanner.take_number()
    assert scanner.position == 6
    scanner.reset(mark)
    assert scanner.position == 4


# Linked programs: who jumps where, and what is refused. The branches are the manual's examples.


class Store:
    """Variables that a program can set."""

    def __init__(self, **values: float) -> None:
        self.values = dict(values)

    def get(self, kind: VariableKind, index: int) -> float:
        return self.values.get(f"{kind}{index}", 0.0)


def code_of(text: str) -> ExecutableProgram:
    return link(tuple(parse_line(line) for line in text.split("\n")))


def run(text: str, **values: float) -> dict[str, float]:
    """Run the assignments of a program and return its variables."""
    code, store = code_of(text), Store(**values)
    counter = steps = 0
    while counter < len(code.instructions):
        steps += 1
        assert steps < 1000
        statement, target = code.instructions[counter], code.jumps[counter]
        counter += 1
        if isinstance(statement, Assign):
            index = int(compile_expression(statement.target.index)(store))
            store.values[f"{statement.target.kind}{index}"] = compile_expression(statement.value)(store)
        elif isinstance(statement, While | If):
            counter = counter if compile_condition(statement.condition)(store) else target
        elif isinstance(statement, EndWhile | Else):
            counter = target
    return store.values


def test_the_jumps_of_loops_and_branches() -> None:
    code = code_of("WHILE(P1<3)\n\nP1=P1+1\nENDW\nX1")
    assert code.jumps == (3, -1, 0, -1)
    assert code.line_of == (0, 2, 3, 4)
    code = code_of("IF(P1=0)\nX1\nELSE\nX2\nENDIF\nX3")
    assert code.jumps == (3, -1, 5, -1, -1, -1)
    assert run("WHILE(P1<10)\nP1=P1+1\nENDWHILE\nP2=P1")["P2"] == 10
    assert run("WHILE(P1<10) P1=P1+1\nP2=P1")["P2"] == 10


MULTI_MULTI = "IF (M11=1)\nP1=17\nP2=13\nELSE\nP1=13\nP2=17\nENDIF\nP3=1"
MULTI_SINGLE = "IF (M11=1)\nP1=17\nP2=13\nELSE P1=13 P2=17\nP3=1"
SINGLE_MULTI = "IF (M11=1) P1=17 P2=13\n; comment\nELSE\nP1=13\nP2=17\nENDIF\nP3=1"
SINGLE_SINGLE = "IF (M11=1) P1=17 P2=13\nELSE P1=13 P2=17\nP3=1"
ONE_LINE = "IF (M11=1) P1=17 P2=13 ELSE P1=13 P2=17\nP3=1"


@pytest.mark.parametrize("text", [MULTI_MULTI, MULTI_SINGLE, SINGLE_MULTI, SINGLE_SINGLE, ONE_LINE])
def test_the_forms_of_a_branch(text: str) -> None:
    chosen = run(text, M11=1)
    assert (chosen["P1"], chosen["P2"], chosen["P3"]) == (17, 13, 1)
    chosen = run(text, M11=0)
    assert (chosen["P1"], chosen["P2"], chosen["P3"]) == (13, 17, 1)


def test_branches_end_with_their_line_and_implied_ends_belong_to_the_line_they_close() -> None:
    assert run("IF(P9=1) P1=1\nP2=2") == {"P2": 2}
    assert run("IF(P9=1) P1=1 ENDIF\nP2=2") == {"P2": 2}
    text = "IF(P8=1)\nIF(P9=1) P1=1\nELSE P1=2\nENDIF"
    assert run(text, P8=0) == {"P8": 0}
    assert run(text, P8=1)["P1"] == 2
    assert run("IF(P8=1) IF(P9=1) P1=1\nELSE P1=2", P8=0) == {"P8": 0}
    text = "WHILE(P1<4)\nP1=P1+1\nIF(P1%2=0) P2=P2+1\nELSE\nWHILE(P3<P1) P3=P3+1\nENDIF\nENDW"
    values = run(text)
    assert (values["P1"], values["P2"], values["P3"]) == (4, 2, 3)
    code = code_of("WHILE(P1<3) P1=P1+1\nX1")
    assert code.line_of == (0, 0, 0, 1)
    assert code.instructions[2] == EndWhile()


def test_labels_are_found_and_an_empty_program_has_no_instructions() -> None:
    code = code_of("X1\nN10 X2\nN10 X3\nIF(P1=0)\nN20 X4\nENDIF")
    assert [code.find(label) for label in (10, 20, 0, 30)] == [1, 6, 0, None]
    assert code_of("X1\nN0 X2").find(0) == 1
    assert code_of("").find(0) == 0
    assert code_of("\n\n") == ExecutableProgram((), (), ())


@pytest.mark.parametrize(
    "text",
    [
        "ENDW",
        "ENDIF",
        "ELSE",
        "WHILE(P1=0)\nENDIF",
        "IF(P1=0)\nENDW\nENDIF",
        "IF(P1=0)\nELSE\nELSE\nENDIF",
        "WHILE(P1=0)\nELSE\nENDW",
        "WHILE(P1=0) X1\nENDW",
        "IF(P1=0) X1\nX2\nELSE X3",
        "IF(P1=0) WHILE(P2=0)\nX1\nENDW",
        "IF(P1=0) X1\nELSE X2\nELSE X3",
    ],
)
def test_an_end_without_its_beginning_is_a_structural_error(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        code_of(text)
    assert refusal.value.code == 9


@pytest.mark.parametrize("text", ["WHILE(P1=0)\nX1", "IF(P1=0)", "IF(P1=0) X1\nELSE\nX2", "WHILE(P1=0)"])
def test_a_missing_end_is_an_improper_structure(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        code_of(text)
    assert refusal.value.code == 16


SHAPES = ["", "X1", "WHILE(P1=0)", "ENDW", "IF(P1=0)", "ELSE", "ENDIF", "IF(P1=0) X1", "ELSE X2", "WHILE(P1=0) X1"]
SHAPES += ["IF(P1=0) WHILE(P2=0) X1", "WHILE(P1=0) IF(P2=0) X1", "IF(P1=0) X1 ELSE X2", "IF(P1=0) IF(P2=0)"]


@given(st.lists(st.sampled_from(SHAPES), max_size=12).map("\n".join))
def test_any_program_is_linked_or_refused(text: str) -> None:
    try:
        code = code_of(text)
    except PmacError as refusal:
        assert refusal.code in (9, 16)
        return
    assert len(code.instructions) == len(code.line_of) == len(code.jumps)
    for place, (statement, jump) in enumerate(zip(code.instructions, code.jumps, strict=True)):
        if isinstance(statement, EndWhile):
            assert isinstance(code.instructions[jump], While) and jump < place
        elif isinstance(statement, While | If | Else):
            assert place < jump <= len(code.instructions)
        else:
            assert jump == -1
    assert list(code.line_of) == sorted(code.line_of)
