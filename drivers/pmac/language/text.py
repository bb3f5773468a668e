"""Writing statements as the text a controller accepts, with no more parentheses than the tree needs."""

from __future__ import annotations

from decimal import Decimal

from drivers.pmac.language.expressions import PRODUCTS
from drivers.pmac.language.parser import gather_moves
from drivers.pmac.language.syntax import (
    Assign,
    AxisWord,
    Binary,
    Call,
    Condition,
    Else,
    EndIf,
    EndWhile,
    Expression,
    If,
    Junction,
    Line,
    Move,
    Negate,
    Number,
    Positioning,
    Program,
    SelectMode,
    Set,
    Statement,
    Variable,
    Wait,
    While,
)

DECIMALS = 10
"""The most decimals that `format_number` writes."""

_LARGEST_PLAIN_INDEX = 10**15
_SUM, _PRODUCT, _OPERAND = range(3)

# Which junction may stand inside which without parentheses.
_ON_THE_LEFT = {("OR", "OR"), ("OR", "AND"), ("AND", "AND")}
_ON_THE_RIGHT = {("OR", "AND")}


def format_number(value: float) -> str:
    """Write a number rounded to 10 decimals: never an exponent, a trailing zero or `-0`."""
    return _plain(f"{value:.{DECIMALS}f}")


def format_constant(value: float) -> str:
    """Write a number with as many decimals as it takes to read the same number back; no exponent."""
    short = format_number(value)
    return short if float(short) == value else _plain(f"{Decimal(repr(float(value))):f}")


def format_expression(expression: Expression) -> str:
    """Write an expression."""
    match expression:
        case Number(value):
            return format_constant(value)
        case Variable(kind, Number(value)) if value == int(value) and 0 <= value < _LARGEST_PLAIN_INDEX:
            return f"{kind}{int(value)}"
        case Variable(kind, index):
            return f"{kind}({format_expression(index)})"
        case Call(name, argument):
            return f"{name}({format_expression(argument)})"
        case Negate(operand):
            return f"-{_operand(operand, _OPERAND)}"
        case Binary(operator, left, right):
            level = _level(expression)
            return f"{_operand(left, level)}{operator}{_operand(right, level + 1)}"


def format_data(value: Expression) -> str:
    """Write the data after a word: a bare constant, or anything else in parentheses."""
    text = format_expression(value)
    return text if isinstance(value, Number) else f"({text})"


def format_condition(condition: Condition) -> str:
    """Write a condition without the parentheses around the whole.

    Raises ValueError: an OR inside an AND, or a junction on the right, which cannot be written on one line.
    """
    if not isinstance(condition, Junction):
        left, right = format_expression(condition.left), format_expression(condition.right)
        return f"{left}{condition.comparator}{right}"
    for inner, allowed in ((condition.left, _ON_THE_LEFT), (condition.right, _ON_THE_RIGHT)):
        if isinstance(inner, Junction) and (condition.operator, inner.operator) not in allowed:
            raise ValueError("the language has no parentheses around part of a condition")
    return f"{format_condition(condition.left)} {condition.operator} {format_condition(condition.right)}"


def format_statement(statement: Statement) -> str:
    """Write one statement. Raises ValueError as `format_condition` does."""
    match statement:
        case Assign(target, value):
            return f"{format_expression(target)}={format_expression(value)}"
        case Set(word, value) | Wait(word, value):
            return f"{word}{format_data(value)}"
        case SelectMode(mode):
            return mode
        case Positioning(incremental, axes):
            listed = f"({','.join(axes)})" if axes else ""
            return f"{'INC' if incremental else 'ABS'}{listed}"
        case Move(words):
            return " ".join(_axis_word(word) for word in words)
        case While(condition):
            return f"WHILE({format_condition(condition)})"
        case If(condition):
            return f"IF({format_condition(condition)})"
        case EndWhile():
            return "ENDWHILE"
        case Else():
            return "ELSE"
        case EndIf():
            return "ENDIF"


def format_line(line: Line) -> str:
    """Write a line without a line end.

    Raises ValueError: the line would be read back as another one (moves that `gather_moves` would join or
    move, `inline` in contradiction to what follows, a condition that `format_condition` refuses).
    """
    if gather_moves(line) != line:
        raise ValueError("the moves of this line would be joined or moved: use more lines")
    for place, statement in enumerate(line):
        last = place == len(line) - 1
        if isinstance(statement, While | If | Else) and statement.inline is last:
            raise ValueError("inline means that the statement is followed by another on its line")
    return " ".join(map(format_statement, line))


def format_program(program: Program) -> str:
    """Write a program, every line closed by a line feed. Raises ValueError as `format_line` does."""
    return "".join(f"{format_line(line)}\n" for line in program)


def _plain(digits: str) -> str:
    if "." in digits:
        digits = digits.rstrip("0").rstrip(".")
    return "0" if digits == "-0" else digits


def _axis_word(word: AxisWord) -> str:
    velocity = f":{format_data(word.velocity)}" if word.velocity is not None else ""
    return f"{word.axis}{format_data(word.value)}{velocity}"


def _operand(expression: Expression, level: int) -> str:
    text = format_expression(expression)
    return f"({text})" if _level(expression) < level else text


def _level(expression: Expression) -> int:
    """How tightly the outermost operator binds; a sign binds as tightly as an operand."""
    if not isinstance(expression, Binary):
        return _OPERAND
    return _PRODUCT if expression.operator in PRODUCTS else _SUM
