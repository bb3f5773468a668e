"""Parse the lines of a PLC: text in, statements out, or a refusal.

A PLC has branches, loops, assignments and messages like a motion program, conditions that continue over several
lines, and addresses of its own; it has no motion, no labels, jumps or calls, and no `M1==1`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from drivers.pmac.language import syntax
from drivers.pmac.language.expressions import parse_expression, parse_number, parse_variable
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.statements import HIGHEST_MOTOR, MESSAGE_READERS, parse_enclosed_condition

HIGHEST_SYSTEM = 16
"""Of the largest family; a missing one is detected when the statement is executed."""

_Reader = Callable[[Scanner, str], syntax.PlcStatement | None]


def parse_plc_line(text: str) -> syntax.PlcLine:
    """Parse one line that is meant for a PLC; a blank line or a comment is the empty line.

    Nothing in it is `inline`: what follows an IF on its line waits for the ENDIF like the lines below.

    Raises PmacError: 003, something on the line is not a statement of a PLC; 004, a character above 127 outside a
    comment.
    """
    scanner = Scanner(text)
    statements: list[syntax.PlcStatement] = []
    while not scanner.at_end:
        statement = parse_plc_statement(scanner)
        if statement is None:
            raise scanner.refusal("no statement of a PLC")
        statements.append(statement)
    return tuple(statements)


def parse_plc_statement(scanner: Scanner) -> syntax.PlcStatement | None:
    """Parse one statement; None, with nothing consumed, if there is none at the cursor.

    Raises PmacError: 003, a statement that begins well and is malformed later.
    """
    mark = scanner.mark()
    target = parse_variable(scanner)
    if target is not None and scanner.accept("="):
        return syntax.Assign(target, parse_expression(scanner))
    scanner.reset(mark)
    word = scanner.take_word(_WORDS)
    read = None if word is None else _READERS[word](scanner, word)
    if read is None:
        scanner.reset(mark)
    return read


def stored_lines(line: syntax.PlcLine) -> tuple[syntax.PlcLine, ...]:
    """Return the lines that a PLC stores for it: what follows a condition or an ELSE moves to the next one."""
    lines: list[syntax.PlcLine] = []
    rest: list[syntax.PlcStatement] = []
    for statement in line:
        if isinstance(statement, syntax.FurtherCondition) and rest:
            lines.append(tuple(rest))
            rest = []
        rest.append(statement)
        if isinstance(statement, syntax.If | syntax.While | syntax.Else | syntax.FurtherCondition):
            lines.append(tuple(rest))
            rest = []
    return (*lines, tuple(rest)) if rest else tuple(lines)


def _address(scanner: Scanner, word: str) -> syntax.Address:
    """Parse `#1`, `&2` or both, in either order."""
    motor: int | None = None
    system: int | None = None
    while (motor is None and scanner.peek("#")) or (system is None and scanner.peek("&")):
        if scanner.accept("#"):
            motor = parse_number(scanner, 1, HIGHEST_MOTOR)
        else:
            scanner.expect("&")
            system = parse_number(scanner, 1, HIGHEST_SYSTEM)
    if motor is None and system is None:
        raise scanner.refusal("expected a motor or a coordinate system as in ADDRESS#1&2")
    return syntax.Address(motor, system)


def _message(scanner: Scanner, word: str) -> syntax.PlcStatement | None:
    statement = MESSAGE_READERS[word](scanner, word)
    assert statement is None or isinstance(statement, syntax.Message | syntax.PlcSwitch)
    return statement


_READERS: Mapping[str, _Reader] = {
    "IF": lambda scanner, word: syntax.If(parse_enclosed_condition(scanner)),
    "WHILE": lambda scanner, word: syntax.While(parse_enclosed_condition(scanner)),
    **dict.fromkeys(
        ("AND", "OR"), lambda scanner, word: syntax.FurtherCondition(word, parse_enclosed_condition(scanner))
    ),
    "ELSE": lambda scanner, word: syntax.Else(),
    **dict.fromkeys(("ENDIF", "ENDI"), lambda scanner, word: syntax.EndIf()),
    **dict.fromkeys(("ENDWHILE", "ENDW"), lambda scanner, word: syntax.EndWhile()),
    **dict.fromkeys(("ADDRESS", "ADR"), _address),
    **dict.fromkeys(MESSAGE_READERS, _message),
}
_WORDS = tuple(_READERS)
