"""Link the lines of a program into instructions with jump targets, for a program counter to run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.syntax import Else, EndIf, EndWhile, If, Label, Line, Program, Statement, While

NO_JUMP = -1

Instruction = TypeVar("Instruction")


@dataclass(frozen=True, slots=True)
class ExecutableProgram:
    """A program ready to run; the three tuples run in parallel.

    `line_of` is the index of the line in the program (an implied end belongs to the last line in it). `jumps` is
    where to continue: for a While whose condition is false, after its end; for an EndWhile, at its While; for an
    If whose condition is false, at the first instruction of the alternative or after the end; for an Else that is
    reached, after the end; NO_JUMP for anything else. `labels` are the instructions that carry a line number; of
    two with the same number the first one counts.
    """

    instructions: tuple[Statement, ...]
    line_of: tuple[int, ...]
    jumps: tuple[int, ...]
    labels: Mapping[int, int] = field(default_factory=dict)

    def find(self, label: int) -> int | None:
        """Return the instruction with a label; the beginning of a program is N0 unless another line is."""
        return self.labels.get(label, 0 if label == 0 else None)


def link(program: Program) -> ExecutableProgram:
    """Find the ends of every loop and branch.

    A single-line WHILE or IF ends with its line; an IF waits for an ELSE at the beginning of the next line
    that is not blank (PMAC Software Reference, ELSE). Raises PmacError 009: an end or an ELSE without its
    beginning, or a block that opens inside a single-line statement; 016: a block without its end.
    """
    linker = _ProgramLinker()
    for number, line in enumerate(program):
        linker.add(number, line)
    return linker.finish()


@dataclass(slots=True)
class OpenBlock:
    """A loop or a branch that is still open: its While or If, and the Else if it had one.

    `line` is the one that it began in, or that of its ELSE.
    """

    head: int
    line: int
    loop: bool
    inline: bool = False
    alternative: int | None = None


@dataclass(slots=True)
class Linker(Generic[Instruction]):
    """The instructions so far with their jumps, and the blocks that are open; of a motion program or a PLC."""

    instructions: list[Instruction] = field(default_factory=list)
    line_of: list[int] = field(default_factory=list)
    jumps: list[int] = field(default_factory=list)
    blocks: list[OpenBlock] = field(default_factory=list)

    def emit(self, number: int, statement: Instruction) -> None:
        """Add an instruction of line `number`."""
        self.instructions.append(statement)
        self.line_of.append(number)
        self.jumps.append(NO_JUMP)

    def begin(self, number: int, statement: Instruction, *, loop: bool, inline: bool = False) -> None:
        """Open a loop or a branch."""
        self.blocks.append(OpenBlock(len(self.instructions), number, loop, inline))
        self.emit(number, statement)

    def divide(self, number: int, statement: Instruction) -> OpenBlock:
        """Begin the alternative of a branch; return its block. Raises PmacError: 009, an ELSE without its IF."""
        block = self.blocks[-1] if self.blocks else None
        if block is None or block.loop or block.alternative is not None:
            raise structure_error(number, "ELSE without IF")
        block.alternative = len(self.instructions)
        self.emit(number, statement)
        self.jumps[block.head] = len(self.instructions)
        return block

    def end(self, number: int, statement: Instruction, *, loop: bool) -> None:
        """Close the innermost block. Raises PmacError: 009, an end without its beginning."""
        if not self.blocks or self.blocks[-1].loop is not loop:
            raise structure_error(number, "ENDWHILE without WHILE" if loop else "ENDIF without IF")
        block = self.blocks.pop()
        self.emit(number, statement)
        if loop:
            self.jumps[-1] = block.head
        self.jumps[block.head if block.alternative is None else block.alternative] = len(self.instructions)

    def refuse_open(self) -> None:
        """Refuse a program whose last block is open. Raises PmacError: 016."""
        if self.blocks:
            block = self.blocks[-1]
            word = "WHILE" if block.loop else "IF"
            raise PmacError(ErrorCode.BAD_STRUCTURE_RUNNING, f"line {block.line + 1}: {word} without its end")


@dataclass(slots=True)
class _ProgramLinker(Linker[Statement]):
    labels: dict[int, int] = field(default_factory=dict)

    def add(self, number: int, line: Line) -> None:
        if not line:
            return
        if not isinstance(line[0], Else):
            self._close_inline()
        for statement in line:
            self._add_statement(number, statement)
        self._end_line(number)

    def finish(self) -> ExecutableProgram:
        self._close_inline()
        self.refuse_open()
        return ExecutableProgram(tuple(self.instructions), tuple(self.line_of), tuple(self.jumps), self.labels)

    def _add_statement(self, number: int, statement: Statement) -> None:
        match statement:
            case While() | If():
                self.begin(number, statement, loop=isinstance(statement, While), inline=statement.inline)
            case Else():
                block = self.divide(number, statement)
                block.inline, block.line = statement.inline, number
            case EndWhile() | EndIf():
                self.end(number, statement, loop=isinstance(statement, EndWhile))
            case _:
                if isinstance(statement, Label):
                    self.labels.setdefault(statement.number, len(self.instructions))
                self.emit(number, statement)

    def _end_line(self, number: int) -> None:
        """Close what ends with this line, except an IF that an ELSE may still follow."""
        while self.blocks and self.blocks[-1].inline:
            block = self.blocks[-1]
            if not block.loop and block.alternative is None:
                return
            self._close_implied(block)
        if any(block.inline for block in self.blocks):
            raise structure_error(number, "a block cannot begin inside a single-line statement")

    def _close_inline(self) -> None:
        while self.blocks and self.blocks[-1].inline:
            self._close_implied(self.blocks[-1])

    def _close_implied(self, block: OpenBlock) -> None:
        self.end(self.line_of[-1], EndWhile() if block.loop else EndIf(), loop=block.loop)


def structure_error(number: int, detail: str) -> PmacError:
    """Return the refusal 009 of a line, which counts from 0."""
    return PmacError(ErrorCode.STRUCTURE, f"line {number + 1}: {detail}")
