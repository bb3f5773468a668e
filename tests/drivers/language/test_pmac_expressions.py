"""Expressions and conditions: binding, refusals, and values against the manual's examples."""

from __future__ import annotations

import math

import pytest

from drivers.pmac.language.errors import ErrorCode, EvaluationError, PmacError
from drivers.pmac.language.evaluate import evaluate, holds
from drivers.pmac.language.expressions import parse_condition, parse_data, parse_expression, parse_variable
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.syntax import Call, Negate, Number, Variable, VariableKind


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


def test_variables_are_read_by_constant_and_by_computed_number() -> None:
    assert value("P(P1+1)+I15+Q3*M26", P1=1, P2=5, I15=7, Q3=2, M26=10) == 32


def test_angles_are_in_radians_when_asked() -> None:
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
    "text",
    ["", "+1", "P1+", "(1", "SIN 1)", "SIN30", "*2", "P", "()", "1+*2", "P()", "FOO(1)", "R1", "P1=2)"[4:]],
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
