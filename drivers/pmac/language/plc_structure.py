"""Link the lines of a PLC into instructions with jump targets, each condition in one piece."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import reduce

from drivers.pmac.language import syntax
from drivers.pmac.language.structure import Linker, structure_error

MOST_CONDITION_LINES = 100
"""Maximum lines of one condition; bounds the depth of its tree."""

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


def _joined(lines: list[tuple[str, syntax.Condition]]) -> syntax.Condition:
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
            whole = _joined(self.condition)
            self.instructions[-1] = syntax.While(whole) if self.blocks[-1].loop else syntax.If(whole)
        self.condition = []
