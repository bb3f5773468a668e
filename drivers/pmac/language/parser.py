"""Reading the lines of a motion program: text in, statements out, or a refusal."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from drivers.pmac.language.expressions import (
    at_data,
    parse_condition,
    parse_data,
    parse_expression,
    parse_variable,
)
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.syntax import (
    Assign,
    AxisWord,
    Condition,
    Else,
    EndIf,
    EndWhile,
    If,
    Line,
    Move,
    Positioning,
    SelectMode,
    Set,
    Statement,
    Wait,
    While,
)

AXES = ("A", "B", "C", "U", "V", "W", "X", "Y", "Z")

_Modal = Set | SelectMode | Positioning
_SETTINGS = ("TA", "TS", "TM", "F", "PVT")
_WAITS = {"DWELL": "DWELL", "DWE": "DWELL", "DELAY": "DELAY", "DLY": "DELAY"}


def parse_line(text: str) -> Line:
    """Read one line that is meant for a program buffer; a blank line or a comment is the empty line.

    The axis words of a line are one move, see `gather_moves`. Raises PmacError 003: something on the line
    is not a statement of a motion program; 004: a character above 127 outside a comment.
    """
    scanner = Scanner(text)
    statements: list[Statement] = []
    while not scanner.at_end:
        statement = parse_statement(scanner)
        if statement is None:
            raise scanner.refusal("no statement of a motion program")
        statements.append(statement)
    return gather_moves(statements)


def parse_statement(scanner: Scanner) -> Statement | None:
    """Read one statement; None, with nothing consumed, if none stands at the cursor.

    A single axis word comes back as a move of its own, for `gather_moves` to join. A letter that is a
    word only with a value (`F`, `A`, `P1`) is no statement without it, so that a caller can try the on-line
    commands next. Raises PmacError 003: a statement that begins well and goes wrong.
    """
    mark = scanner.mark()
    word = scanner.take_word(tuple(_READERS))
    statement = _READERS[word](scanner, word) if word is not None else _assign(scanner)
    if statement is None:
        scanner.reset(mark)
    return statement


def gather_moves(statements: Iterable[Statement]) -> Line:
    """Join the axis words of a line into moves: axes named on one line move together.

    Modal words (F, TM, INC ...) hold for the moves of their line wherever they stand, and so come first. An
    assignment between the axis words of a move comes before the move, one behind them after it. A repeated
    axis letter starts a second move; a wait or a flow word ends a move and what belongs to it.
    """
    gathered: list[Statement] = []
    stretch: list[Statement] = []
    for statement in statements:
        if isinstance(statement, Move | Assign | _Modal):
            stretch.append(statement)
        else:
            gathered += [*_arranged(stretch), statement]
            stretch.clear()
    return (*gathered, *_arranged(stretch))


def _arranged(stretch: list[Statement]) -> list[Statement]:
    last_modal = max((i for i, statement in enumerate(stretch) if isinstance(statement, _Modal)), default=-1)
    # Assignments before a modal word keep their place before it, as in `P1=5 F(P1)`.
    arranged: list[Statement] = [
        statement for statement in stretch[: last_modal + 1] if not isinstance(statement, Move)
    ]
    words: list[AxisWord] = []
    behind: list[Statement] = []
    for place, statement in enumerate(stretch):
        if isinstance(statement, Move):
            for word in statement.words:
                if any(word.axis == earlier.axis for earlier in words):
                    arranged.append(Move(tuple(words)))
                    words.clear()
                arranged += behind
                behind.clear()
                words.append(word)
        elif place > last_modal:
            behind.append(statement)
    if words:
        arranged.append(Move(tuple(words)))
    return arranged + behind


def _assign(scanner: Scanner) -> Assign | None:
    target = parse_variable(scanner)
    if target is None or not scanner.accept("="):
        return None
    return Assign(target, parse_expression(scanner))


def _set(scanner: Scanner, word: str) -> Set | None:
    return Set(word, parse_data(scanner)) if at_data(scanner) else None


def _axis(scanner: Scanner, word: str) -> Move | None:
    if not at_data(scanner):
        return None
    value = parse_data(scanner)
    velocity = parse_data(scanner) if scanner.accept(":") else None
    return Move((AxisWord(word, value, velocity),))


def _wait(scanner: Scanner, word: str) -> Wait | None:
    return Wait(_WAITS[word], parse_data(scanner)) if at_data(scanner) else None


def _positioning(scanner: Scanner, word: str) -> Positioning:
    axes: list[str] = []
    if scanner.accept("("):
        axes.append(_axis_letter(scanner))
        while scanner.accept(","):
            axes.append(_axis_letter(scanner))
        scanner.expect(")")
    return Positioning(word == "INC", tuple(axes))


def _axis_letter(scanner: Scanner) -> str:
    letter = scanner.take_word(AXES)
    if letter is None:
        raise scanner.refusal("expected an axis")
    return letter


def _while(scanner: Scanner, word: str) -> While:
    condition = _enclosed_condition(scanner)
    return While(condition, inline=not scanner.at_end)


def _if(scanner: Scanner, word: str) -> If:
    condition = _enclosed_condition(scanner)
    return If(condition, inline=not scanner.at_end)


def _enclosed_condition(scanner: Scanner) -> Condition:
    scanner.expect("(")
    condition = parse_condition(scanner)
    scanner.expect(")")
    return condition


_READERS: dict[str, Callable[[Scanner, str], Statement | None]] = {
    **dict.fromkeys(_SETTINGS, _set),
    **dict.fromkeys(AXES, _axis),
    **dict.fromkeys(_WAITS, _wait),
    **dict.fromkeys(("ABS", "INC"), _positioning),
    **dict.fromkeys(("LINEAR", "LIN"), lambda scanner, word: SelectMode("LINEAR")),
    "WHILE": _while,
    "IF": _if,
    **dict.fromkeys(("ENDWHILE", "ENDW"), lambda scanner, word: EndWhile()),
    "ELSE": lambda scanner, word: Else(inline=not scanner.at_end),
    **dict.fromkeys(("ENDIF", "ENDI"), lambda scanner, word: EndIf()),
}
