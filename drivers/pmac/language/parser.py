"""Parse the lines of a motion program: text in, statements out, or a refusal."""

from __future__ import annotations

from drivers.pmac.language.expressions import parse_expression, parse_variable
from drivers.pmac.language.gathering import gather_moves, may_be_argument
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.statements import READERS, parse_argument
from drivers.pmac.language.syntax import Assign, CallProgram, Line, Statement, VariableKind

_WORDS = tuple(READERS)
WORDS = tuple(word for word in _WORDS if len(word) > 1)
"""The words of motion programs, without the single letters that have another meaning on-line."""
_COMBINING = {"==": "", "&=": "&", "|=": "|", "^=": "^"}  # The signs of assignments that wait for the next move


def parse_line(text: str) -> Line:
    """Parse one line that is meant for a program buffer; a blank line or a comment is the empty line.

    The axis words of a line are one move, see `gather_moves`. Raises PmacError 003: something on the line
    is not a statement of a motion program; 004: a character above 127 outside a comment.
    """
    scanner = Scanner(text)
    statements: list[Statement] = []
    behind_call = False
    while not scanner.at_end:
        statement = parse_statement(scanner)
        if statement is None and behind_call:
            statement = parse_argument(scanner)
        if statement is None:
            raise scanner.refusal("no statement of a motion program")
        statements.append(statement)
        behind_call = isinstance(statement, CallProgram) or (behind_call and may_be_argument(statement))
    return gather_moves(statements)


def parse_statement(scanner: Scanner) -> Statement | None:
    """Parse one statement; None, with nothing consumed, if there is none at the cursor.

    A single axis word is returned as a move of its own, for `gather_moves` to join. A letter that is a word only
    with a value (`F`, `A`, `P1`) is no statement without it, so that a caller can try the on-line commands next.
    Raises PmacError 003: a statement that begins well and is malformed later.
    """
    mark = scanner.mark()
    statement = _assign(scanner)
    if statement is not None:
        return statement
    scanner.reset(mark)
    word = scanner.take_word(_WORDS)
    read = None if word is None else READERS[word](scanner, word)
    if read is None:
        scanner.reset(mark)
    return read


def _assign(scanner: Scanner) -> Assign | None:
    target = parse_variable(scanner)
    if target is None:
        return None
    if target.kind is VariableKind.M:
        sign = scanner.take_word(tuple(_COMBINING))
        if sign is not None:
            return Assign(target, parse_expression(scanner), synchronous=True, operator=_COMBINING[sign])
    if not scanner.accept("="):
        return None
    return Assign(target, parse_expression(scanner))
