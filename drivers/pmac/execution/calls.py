"""Calls of subprograms: the program line that a G1 calls, and the arguments on the calling line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.expressions import HIGHEST_PROGRAM
from drivers.pmac.language.parser import CODES, gather_moves
from drivers.pmac.language.syntax import Argument, CallProgram, Expression, Line, Move, Set, Statement

FIRST_CODE_PROGRAM = 1000
HIGHEST_CODE = 1000
"""Codes are below this: G0 to G999.999."""

_LABELS_PER_PROGRAM = 100_000
_LABELS_PER_CODE = 1000


def target_of(call: CallProgram, value: float) -> tuple[int, int]:
    """Return program and label: `CALL 35.1` is N10000 of program 35, `G1` N1000 of 1000, `M115` N15000 of 1011.

    Raises PmacError: 003, no such code or program.
    """
    if call.code:
        if not 0 <= value < HIGHEST_CODE:
            raise PmacError(ErrorCode.DATA_ERROR, f"{call.code}{value:g}, 0 to 999.999")
        hundreds, rest = divmod(value, 100.0)
        return FIRST_CODE_PROGRAM + 10 * int(hundreds) + CODES.index(call.code), round(rest * _LABELS_PER_CODE)
    if not 1 <= value < HIGHEST_PROGRAM + 1:
        raise PmacError(ErrorCode.DATA_ERROR, f"CALL{value:g}, 1 to {HIGHEST_PROGRAM}")
    return divmod(round(value * _LABELS_PER_PROGRAM), _LABELS_PER_PROGRAM)


@dataclass(frozen=True, eq=False)
class CallingLine:
    """The rest of the line after a call: arguments, then statements to execute after the return."""

    line: int
    statements: Sequence[Statement]

    @cached_property
    def words(self) -> Sequence[Statement]:
        """The arguments one by one: a move has as many as it has words."""
        words: list[Statement] = []
        for statement in self.statements:
            words += [Move((word,)) for word in statement.words] if isinstance(statement, Move) else [statement]
        return words

    def rest(self, taken: int) -> Line:
        """Return the words after the first `taken` ones, as a line of its own."""
        return gather_moves(self.words[taken:])


@dataclass(slots=True)
class Arguments:
    """Read position of one call's subprograms in its line."""

    calling: CallingLine
    taken: int = 0

    def take(self, letters: tuple[str, ...]) -> tuple[str, Expression] | None:
        """Take the next word if it has one of the letters; otherwise None, and nothing is taken."""
        words = self.calling.words
        if self.taken == len(words):
            return None
        word = _read_letter_argument(words[self.taken])
        if word is None or word[0] not in letters:
            return None
        self.taken += 1
        return word


def _read_letter_argument(statement: Statement) -> tuple[str, Expression] | None:
    match statement:
        case Move(words):
            return words[0].axis, words[0].value
        case Argument(letter, value) | Set("F" as letter, value):
            return letter, value
        case CallProgram(target, code) if code:
            return code, target
        case _:
            return None
