"""The lines of a PLC: text in, statements out, and linked into instructions with jump targets.

A PLC has branches, loops, assignments and messages like a motion program, conditions that continue over several
lines, and addresses of its own; it has no motion, no labels, jumps or calls, and no `M1==1`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import reduce

from drivers.pmac.language import syntax
from drivers.pmac.language.expressions import parse_expression, parse_number, parse_variable
from drivers.pmac.language.lexer import Scanner, longest_of
from drivers.pmac.language.parser import HIGHEST_MOTOR, MESSAGE_READERS, parse_enclosed_condition
from drivers.pmac.language.structure import Linker, structure_error

HIGHEST_SYSTEM = 16  # Of the largest family; a missing one is detected when the statement is executed

_Reader = Callable[[Scanner, str], syntax.PlcStatement | None]


def parse_plc_line(text: str) -> syntax.PlcLine:
    """Parse one line that is meant for a PLC; a blank line or a comment is the empty line.

    Nothing in it is `inline`: what follows an IF on its line waits for the ENDIF like the lines below.

    Raises PmacError: 003, something on the line is not a statement of a PLC; 004, a character above 127 outside a
    comment.
    """
    return tuple(plc_statements_of(Scanner(text)))


def plc_statements_of(scanner: Scanner) -> Iterator[syntax.PlcStatement]:
    """Yield the statements of a line. Raises as `parse_plc_line` does."""
    while not scanner.at_end:
        statement = parse_plc_statement(scanner)
        if statement is None:
            raise scanner.refusal("no statement of a PLC")
        yield statement


def parse_plc_statement(scanner: Scanner) -> syntax.PlcStatement | None:
    """Parse one statement; None, with nothing consumed, if there is none at the cursor.

    Raises PmacError: 003, a statement that begins well and is malformed later.
    """
    mark = scanner.mark()
    target = parse_variable(scanner)
    if target is not None and scanner.accept("="):
        return syntax.Assign(target, parse_expression(scanner))
    scanner.reset(mark)
    word = scanner.take(_WORDS)
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
    """Parse `#1`, `&2` or both, in either order; a number may be a variable, as in `#P5`."""
    motor: int | syntax.Variable | None = None
    system: int | syntax.Variable | None = None
    while (motor is None and scanner.peek("#")) or (system is None and scanner.peek("&")):
        if scanner.accept("#"):
            motor = parse_variable(scanner) or parse_number(scanner, 1, HIGHEST_MOTOR)
        else:
            scanner.expect("&")
            system = parse_variable(scanner) or parse_number(scanner, 1, HIGHEST_SYSTEM)
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
PLC_WORDS = tuple(_READERS)
"""The words of a PLC, beside its assignments."""

_WORDS = longest_of(PLC_WORDS)


MOST_CONDITION_LINES = 100  # Maximum lines of one condition; bounds the depth of its tree

PlcInstruction = (
    syntax.While
    | syntax.EndWhile
    | syntax.If
    | syntax.Else
    | syntax.EndIf
    | syntax.Assign
    | syntax.Message
    | syntax.PlcSwitch
    | syntax.Address
)


@dataclass(frozen=True, slots=True)
class PlcCode:
    """A PLC ready to run; the three tuples run in parallel.

    `jumps` is where to continue: for a While whose condition is false, after its end; for an EndWhile, at its
    While (the only way back); for an If whose condition is false, in its alternative or after its end; for an Else
    that is reached, after the end; NO_JUMP for anything else.
    """

    instructions: tuple[PlcInstruction, ...]
    line_of: tuple[int, ...]
    jumps: tuple[int, ...]


def link_plc(program: syntax.PlcProgram) -> PlcCode:
    """Find the ends of every loop and branch, and combine conditions of several lines.

    Raises PmacError: 009, an end or an ELSE without its beginning, an AND or OR that does not stand directly after
    a condition, or a condition of too many lines; 016, a loop or branch without its end.
    """
    linker = _PlcLinker()
    for number, line in enumerate(program):
        for statement in line:
            linker.add(number, statement)
    return linker.finish()


def _join_conditions(lines: list[tuple[str, syntax.Condition]]) -> syntax.Condition:
    """Join the conditions of several lines: each is a unit, and between them AND binds tighter than OR.

    (Turbo PMAC User Manual, Multiple-Line Conditions.) The operator of the first line is ignored.
    """
    groups: list[syntax.Condition] = []
    for operator, condition in lines:
        if groups and operator == "AND":
            groups[-1] = syntax.Junction("AND", groups[-1], condition)
        else:
            groups.append(condition)
    return reduce(lambda whole, group: syntax.Junction("OR", whole, group), groups)


@dataclass(slots=True)
class _PlcLinker(Linker[PlcInstruction]):
    condition: list[tuple[str, syntax.Condition]] = field(default_factory=list)
    """The lines of the condition that the next line may continue."""

    def add(self, number: int, statement: syntax.PlcStatement) -> None:
        if isinstance(statement, syntax.FurtherCondition):
            self._continue(number, statement)
            return
        self._finish_condition()
        match statement:
            case syntax.While() | syntax.If():
                self.condition = [("", statement.condition)]
                self.begin(number, statement, loop=isinstance(statement, syntax.While))
            case syntax.Else():
                self.divide(number, statement)
            case syntax.EndWhile() | syntax.EndIf():
                self.end(number, statement, loop=isinstance(statement, syntax.EndWhile))
            case _:
                self.emit(number, statement)

    def finish(self) -> PlcCode:
        self._finish_condition()
        self.refuse_open()
        return PlcCode(tuple(self.instructions), tuple(self.line_of), tuple(self.jumps))

    def _continue(self, number: int, statement: syntax.FurtherCondition) -> None:
        if not self.condition:
            raise structure_error(number, f"{statement.operator} without IF or WHILE in front of it")
        if len(self.condition) == MOST_CONDITION_LINES:
            raise structure_error(number, f"a condition of more than {MOST_CONDITION_LINES} lines")
        self.condition.append((statement.operator, statement.condition))

    def _finish_condition(self) -> None:
        if len(self.condition) > 1:
            whole = _join_conditions(self.condition)
            self.instructions[-1] = syntax.While(whole) if self.blocks[-1].loop else syntax.If(whole)
        self.condition = []
