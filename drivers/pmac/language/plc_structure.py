"""Link the lines of a PLC into instructions with jump targets, each condition in one piece."""

from __future__ import annotations

from dataclasses import dataclass, field

from drivers.pmac.language import syntax
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.structure import NO_JUMP

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

    Raises:
        PmacError: 009, an end or an ELSE without its beginning, an AND or OR that does not stand directly after a
            condition, or a condition of too many lines; 016, a loop or branch without its end.
    """
    linker = _Linker()
    for number, line in enumerate(program):
        for statement in line:
            linker.add(number, statement)
    return linker.finish()


def joined(lines: list[tuple[str, syntax.Condition]]) -> syntax.Condition:
    """Join the conditions of several lines: each is a unit, and between them AND binds tighter than OR.

    (Turbo PMAC User Manual, Multiple-Line Conditions.) The operator of the first line is ignored.
    """
    groups: list[syntax.Condition] = []
    for operator, condition in lines:
        if groups and operator == "AND":
            groups[-1] = syntax.Junction("AND", groups[-1], condition)
        else:
            groups.append(condition)
    whole = groups[0]
    for group in groups[1:]:
        whole = syntax.Junction("OR", whole, group)
    return whole


@dataclass(slots=True)
class _Block:
    """A loop or a branch that is still open: its While or If, and the Else if it had one."""

    head: int
    loop: bool
    alternative: int | None = None


@dataclass(slots=True)
class _Linker:
    instructions: list[PlcInstruction] = field(default_factory=list)
    line_of: list[int] = field(default_factory=list)
    jumps: list[int] = field(default_factory=list)
    blocks: list[_Block] = field(default_factory=list)
    condition: list[tuple[str, syntax.Condition]] = field(default_factory=list)
    """The lines of the condition that the next line may continue."""

    def add(self, number: int, statement: syntax.PlcStatement) -> None:
        if isinstance(statement, syntax.FurtherCondition):
            self._go_on(number, statement)
            return
        self._finish_condition()
        match statement:
            case syntax.While() | syntax.If():
                self.blocks.append(_Block(len(self.instructions), isinstance(statement, syntax.While)))
                self.condition = [("", statement.condition)]
                self._emit(number, statement)
            case syntax.Else():
                self._alternative(number, statement)
            case syntax.EndWhile() | syntax.EndIf():
                self._end(number, statement)
            case _:
                self._emit(number, statement)

    def finish(self) -> PlcCode:
        self._finish_condition()
        if self.blocks:
            block = self.blocks[-1]
            word = "WHILE" if block.loop else "IF"
            line = self.line_of[block.head]
            raise PmacError(ErrorCode.BAD_STRUCTURE_RUNNING, f"line {line + 1}: {word} without its end")
        return PlcCode(tuple(self.instructions), tuple(self.line_of), tuple(self.jumps))

    def _go_on(self, number: int, statement: syntax.FurtherCondition) -> None:
        if not self.condition:
            raise _structure(number, f"{statement.operator} without IF or WHILE in front of it")
        if len(self.condition) == MOST_CONDITION_LINES:
            raise _structure(number, f"a condition of more than {MOST_CONDITION_LINES} lines")
        self.condition.append((statement.operator, statement.condition))

    def _finish_condition(self) -> None:
        if len(self.condition) > 1:
            whole = joined(self.condition)
            loop = self.blocks[-1].loop
            self.instructions[-1] = syntax.While(whole) if loop else syntax.If(whole)
        self.condition = []

    def _alternative(self, number: int, statement: syntax.Else) -> None:
        block = self.blocks[-1] if self.blocks else None
        if block is None or block.loop or block.alternative is not None:
            raise _structure(number, "ELSE without IF")
        block.alternative = len(self.instructions)
        self._emit(number, statement)
        self.jumps[block.head] = len(self.instructions)

    def _end(self, number: int, statement: syntax.EndWhile | syntax.EndIf) -> None:
        loop = isinstance(statement, syntax.EndWhile)
        if not self.blocks or self.blocks[-1].loop is not loop:
            raise _structure(number, "ENDWHILE without WHILE" if loop else "ENDIF without IF")
        block = self.blocks.pop()
        self._emit(number, statement)
        if loop:
            self.jumps[-1] = block.head
        self.jumps[block.head if block.alternative is None else block.alternative] = len(self.instructions)

    def _emit(self, number: int, statement: PlcInstruction) -> None:
        self.instructions.append(statement)
        self.line_of.append(number)
        self.jumps.append(NO_JUMP)


def _structure(number: int, detail: str) -> PmacError:
    return PmacError(ErrorCode.STRUCTURE, f"line {number + 1}: {detail}")
