"""Format statements as text that a controller accepts, with no more parentheses than the tree needs."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import zip_longest

from drivers.pmac.language import syntax
from drivers.pmac.language.expressions import PRODUCTS
from drivers.pmac.language.lexer import DECIMALS as DECIMALS
from drivers.pmac.language.lexer import format_constant as format_constant
from drivers.pmac.language.lexer import format_number as format_number
from drivers.pmac.language.parser import ARGUMENTS, control_letter, gather_moves, is_control, may_be_argument

_WORDS: Mapping[type, str] = {
    syntax.EndWhile: "ENDWHILE",
    syntax.EndIf: "ENDIF",
    syntax.Else: "ELSE",
    syntax.Return: "RETURN",
    syntax.Pause: "WAIT",
    syntax.Stop: "STOP",
}
"""The statements without parts."""

_SWITCHES = {(True, False): "ENABLE", (False, False): "DISABLE", (True, True): "RESUME", (False, True): "PAUSE"}

_LARGEST_PLAIN_INDEX = 10**15
_SUM, _PRODUCT, _OPERAND = range(3)

# Which junction may be inside which without parentheses.
_ON_THE_LEFT = {("OR", "OR"), ("OR", "AND"), ("AND", "AND")}
_ON_THE_RIGHT = {("OR", "AND")}


def format_expression(expression: syntax.Expression) -> str:
    """Format an expression."""
    match expression:
        case syntax.Number(value):
            return format_constant(value)
        case syntax.Variable(kind, syntax.Number(value)) if (
            value == int(value) and 0 <= value < _LARGEST_PLAIN_INDEX
        ):
            return f"{kind}{int(value)}"
        case syntax.Variable(kind, index):
            return f"{kind}({format_expression(index)})"
        case syntax.Call(name, argument):
            return f"{name}({format_expression(argument)})"
        case syntax.Negate(operand):
            return f"-{_operand(operand, _OPERAND)}"
        case syntax.Binary(operator, left, right):
            level = _level(expression)
            return f"{_operand(left, level)}{operator}{_operand(right, level + 1)}"


def format_data(value: syntax.Expression) -> str:
    """Format the data after a word: a bare constant, or anything else in parentheses."""
    text = format_expression(value)
    return text if isinstance(value, syntax.Number) else f"({text})"


def format_condition(condition: syntax.Condition) -> str:
    """Format a condition without the parentheses around the whole.

    Raises ValueError: an OR inside an AND, or a junction on the right, which cannot be written on one line.
    """
    if not isinstance(condition, syntax.Junction):
        left, right = format_expression(condition.left), format_expression(condition.right)
        return f"{left}{condition.comparator}{right}"
    for inner, allowed in ((condition.left, _ON_THE_LEFT), (condition.right, _ON_THE_RIGHT)):
        if isinstance(inner, syntax.Junction) and (condition.operator, inner.operator) not in allowed:
            raise ValueError("the language has no parentheses around part of a condition")
    return f"{format_condition(condition.left)} {condition.operator} {format_condition(condition.right)}"


def format_statement(statement: syntax.Statement | syntax.PlcStatement) -> str:  # noqa: C901 - one branch a case
    """Format one statement. Raises ValueError as `format_condition` does."""
    match statement:
        case syntax.Assign(target, value, synchronous, operator):
            sign = f"{operator or '='}=" if synchronous else "="
            return f"{format_expression(target)}{sign}{format_expression(value)}"
        case syntax.Set(word, value) | syntax.Wait(word, value) | syntax.Argument(word, value):
            return f"{word}{format_data(value)}"
        case syntax.Message(word, text, port, place):
            quoted = f"^{control_letter(text)}" if is_control(text) else f'"{text}"'
            return f"{word}{port}{'' if place is None else place}{quoted}"
        case syntax.While(condition):
            return f"WHILE({format_condition(condition)})"
        case syntax.If(condition):
            return f"IF({format_condition(condition)})"
        case syntax.FurtherCondition(operator, condition):
            return f"{operator}({format_condition(condition)})"
        case syntax.Label(number):
            return f"N{number}"
        case syntax.Goto(label):
            return f"GOTO{format_data(label)}"
        case syntax.Gosub(label):
            return f"GOSUB{format_data(label)}"
        case syntax.CallProgram(target, code):
            return f"{code or 'CALL'}{format_data(target)}"
        case syntax.Read(letters):
            return f"READ({','.join(letters)})"
        case syntax.Address(motor, system):
            return f"ADDRESS{_format_address('#', motor)}{_format_address('&', system)}"
        case syntax.PlcSwitch(enable, numbers, keeping):
            return f"{_SWITCHES[enable, keeping]} PLC {','.join(map(str, numbers))}"
        case _:
            return _format_motion(statement)


def _format_motion(statement: syntax.Statement) -> str:
    match statement:
        case syntax.SelectMode(mode):
            return mode
        case syntax.Positioning(incremental, axes):
            return f"{'INC' if incremental else 'ABS'}{_in_parentheses(axes)}"
        case syntax.Feedrate(axes, none):
            return "NOFRAX" if none else f"FRAX{_in_parentheses(axes)}"
        case syntax.Normal(words):
            return f"NORMAL {_axis_words(words)}"
        case syntax.Move(words):
            return _axis_words(words)
        case syntax.Preset(words):
            return f"PSET {_axis_words(words)}"
        case syntax.HomeMotors(motors, zero):
            return f"{'HOMEZ' if zero else 'HOME'}{','.join(map(str, motors))}"
        case syntax.Block(begins):
            return "BLOCKSTART" if begins else "BLOCKSTOP"
        case _:
            return _WORDS[type(statement)]


def format_line(line: syntax.Line) -> str:
    """Format a line without a line end.

    Raises ValueError: the line would be read back as another one (moves that `gather_moves` would join or
    move, words that the statement before them would take as its own, `inline` in contradiction to what
    follows, a condition that `format_condition` refuses).
    """
    if gather_moves(line) != line:
        raise ValueError("the moves of this line would be joined or moved: use more lines")
    _check_neighbours(line)
    for place, statement in enumerate(line):
        last = place == len(line) - 1
        if isinstance(statement, syntax.While | syntax.If | syntax.Else) and statement.inline is last:
            raise ValueError("inline means that the statement is followed by another on its line")
    return " ".join(map(format_statement, line))


def format_plc_line(line: syntax.PlcLine) -> str:
    """Format a line of a PLC without a line end. Raises ValueError as `format_condition` does."""
    return " ".join(map(format_statement, line))


def _check_neighbours(line: syntax.Line) -> None:
    after_call = False
    for statement, following in zip_longest(line, line[1:]):
        if isinstance(statement, syntax.Argument) and statement.letter in ARGUMENTS and not after_call:
            raise ValueError("an argument without a call on its line")
        after_call = isinstance(statement, syntax.CallProgram) or (after_call and may_be_argument(statement))
        if isinstance(statement, syntax.Normal | syntax.Preset) and isinstance(following, syntax.Move):
            own = {word.axis for word in statement.words}
            vector = isinstance(statement, syntax.Normal)
            first = following.words[0].axis
            if first not in own and (first in syntax.VECTOR if vector else first in syntax.AXES):
                raise ValueError(f"{first} would be read as part of the statement before it: use more lines")


def _in_parentheses(letters: tuple[str, ...]) -> str:
    return f"({','.join(letters)})" if letters else ""


def _axis_words(words: tuple[syntax.AxisWord, ...]) -> str:
    return " ".join(
        f"{word.axis}{format_data(word.value)}{_suffix(':', word.velocity)}{_suffix('^', word.past_trigger)}"
        for word in words
    )


def _suffix(sign: str, value: syntax.Expression | None) -> str:
    return "" if value is None else f"{sign}{format_data(value)}"


def _format_address(sign: str, number: int | syntax.Variable | None) -> str:
    if number is None:
        return ""
    return f"{sign}{format_expression(number) if isinstance(number, syntax.Variable) else number}"


def _operand(expression: syntax.Expression, level: int) -> str:
    text = format_expression(expression)
    return f"({text})" if _level(expression) < level else text


def _level(expression: syntax.Expression) -> int:
    """How tightly the outermost operator binds; a sign binds as tightly as an operand."""
    if not isinstance(expression, syntax.Binary):
        return _OPERAND
    return _PRODUCT if expression.operator in PRODUCTS else _SUM
