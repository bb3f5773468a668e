"""Link the lines of a program into instructions with jump targets, for a program counter to run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.syntax import Else, EndIf, EndWhile, If, Label, Line, Program, Statement, While

NO_JUMP = -1


@dataclass(frozen=True, slots=True)
class Code:
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


def link(program: Program) -> Code:
    """Find the ends of every loop and branch.

    A single-line WHILE or IF ends with its line; an IF waits for an ELSE at the beginning of the next line
    that is not blank (PMAC Software Reference, ELSE). Raises PmacError 009: an end or an ELSE without its
    beginning, or a block that opens inside a single-line statement; 016: a block without its end.
    """
    linker = _Linker()
    for number, line in enumerate(program):
        linker.add(number, line)
    return linker.finish()


@dataclass(slots=True)
class _Block:
    """A loop or a branch that is still open."""

    head: int
    """The While or If."""
    line: int
    """The line that it began in, or its ELSE."""
    loop: bool
    inline: bool
    alternative: int | None = None
    """The Else."""


@dataclass(slots=True)
class _Linker:
    instructions: list[Statement] = field(default_factory=list)
    line_of: list[int] = field(default_factory=list)
    jumps: list[int] = field(default_factory=list)
    labels: dict[int, int] = field(default_factory=dict)
    blocks: list[_Block] = field(default_factory=list)

    def add(self, number: int, line: Line) -> None:
        if not line:
            return
        if not isinstance(line[0], Else):
            self._close_inline()
        for statement in line:
            self._add_statement(number, statement)
        self._end_line(number)

    def finish(self) -> Code:
        self._close_inline()
        if self.blocks:
            block = self.blocks[-1]
            word = "WHILE" if block.loop else "IF"
            raise PmacError(ErrorCode.BAD_STRUCTURE_RUNNING, f"line {block.line + 1}: {word} without its end")
        return Code(tuple(self.instructions), tuple(self.line_of), tuple(self.jumps), self.labels)

    def _add_statement(self, number: int, statement: Statement) -> None:
        match statement:
            case While() | If():
                block = _Block(len(self.instructions), number, isinstance(statement, While), statement.inline)
                self.blocks.append(block)
                self._emit(number, statement)
            case Else():
                self._add_else(number, statement)
            case EndWhile() | EndIf():
                self._end(number, statement)
            case Label():
                self.labels.setdefault(statement.number, len(self.instructions))
                self._emit(number, statement)
            case _:
                self._emit(number, statement)

    def _add_else(self, number: int, statement: Else) -> None:
        block = self.blocks[-1] if self.blocks else None
        if block is None or block.loop or block.alternative is not None:
            raise _structure(number, "ELSE without IF")
        block.alternative = len(self.instructions)
        block.inline = statement.inline
        block.line = number
        self._emit(number, statement)
        self.jumps[block.head] = len(self.instructions)

    def _end(self, number: int, statement: EndWhile | EndIf) -> None:
        loop = isinstance(statement, EndWhile)
        if not self.blocks or self.blocks[-1].loop is not loop:
            raise _structure(number, "ENDWHILE without WHILE" if loop else "ENDIF without IF")
        self._close(number, statement)

    def _close(self, number: int, statement: EndWhile | EndIf) -> None:
        block = self.blocks.pop()
        self._emit(number, statement)
        behind = len(self.instructions)
        if block.loop:
            self.jumps[-1] = block.head
        self.jumps[block.head if block.alternative is None else block.alternative] = behind

    def _end_line(self, number: int) -> None:
        """Close what ends with this line, except an IF that an ELSE may still follow."""
        while self.blocks and self.blocks[-1].inline:
            block = self.blocks[-1]
            if not block.loop and block.alternative is None:
                return
            self._close_implied()
        if any(block.inline for block in self.blocks):
            raise _structure(number, "a block cannot begin inside a single-line statement")

    def _close_inline(self) -> None:
        while self.blocks and self.blocks[-1].inline:
            self._close_implied()

    def _close_implied(self) -> None:
        block = self.blocks[-1]
        self._close(self.line_of[-1], EndWhile() if block.loop else EndIf())

    def _emit(self, number: int, statement: Statement) -> None:
        self.instructions.append(statement)
        self.line_of.append(number)
        self.jumps.append(NO_JUMP)


def _structure(number: int, detail: str) -> PmacError:
    return PmacError(ErrorCode.STRUCTURE, f"line {number + 1}: {detail}")
