"""Order the statements of a line: which axis words move together, and which words apply to them."""

from __future__ import annotations

from collections.abc import Iterable

from drivers.pmac.language import syntax

_Modal = syntax.Set | syntax.SelectMode | syntax.Positioning | syntax.Feedrate
_Gathered = syntax.Move | syntax.Assign | syntax.Argument | _Modal


def gather_moves(statements: Iterable[syntax.Statement]) -> syntax.Line:
    """Join the axis words of a line into moves: axes named on one line move together.

    Modal words (F, TM, INC ...) apply to the moves of their line wherever they are, and so come first. An
    assignment between the axis words of a move comes before the move, one after them after it. A repeated axis
    letter starts a second move; a wait or a flow word ends a move and what belongs to it. After a call the words
    are arguments and keep their order; only neighbours are joined.
    """
    gathered: list[syntax.Statement] = []
    stretch: list[syntax.Statement] = []
    called = False
    for statement in statements:
        if isinstance(statement, _Gathered):
            stretch.append(statement)
            continue
        gathered += [*(_joined(stretch) if called else _arranged(stretch)), statement]
        stretch.clear()
        called = isinstance(statement, syntax.CallProgram)
    return (*gathered, *(_joined(stretch) if called else _arranged(stretch)))


def may_be_argument(statement: syntax.Statement) -> bool:
    """Whether a statement after a call belongs to the line of the call: READ may take it, or what follows it."""
    return isinstance(statement, _Gathered | syntax.CallProgram)


def _arranged(stretch: list[syntax.Statement]) -> list[syntax.Statement]:
    last_modal = max((i for i, statement in enumerate(stretch) if isinstance(statement, _Modal)), default=-1)
    # Assignments before a modal word keep their place before it, as in `P1=5 F(P1)`.
    arranged: list[syntax.Statement] = [
        statement for statement in stretch[: last_modal + 1] if not isinstance(statement, syntax.Move)
    ]
    words: list[syntax.AxisWord] = []
    behind: list[syntax.Statement] = []
    for place, statement in enumerate(stretch):
        if isinstance(statement, syntax.Move):
            for word in statement.words:
                if _repeats(word, words):
                    arranged.append(syntax.Move(tuple(words)))
                    words.clear()
                arranged += behind
                behind.clear()
                words.append(word)
        elif place > last_modal:
            behind.append(statement)
    if words:
        arranged.append(syntax.Move(tuple(words)))
    return arranged + behind


def _joined(stretch: list[syntax.Statement]) -> list[syntax.Statement]:
    joined: list[syntax.Statement] = []
    for statement in stretch:
        if not isinstance(statement, syntax.Move):
            joined.append(statement)
            continue
        for word in statement.words:
            last = joined[-1] if joined else None
            if isinstance(last, syntax.Move) and not _repeats(word, last.words):
                joined[-1] = syntax.Move((*last.words, word))
            else:
                joined.append(syntax.Move((word,)))
    return joined


def _repeats(word: syntax.AxisWord, earlier: Iterable[syntax.AxisWord]) -> bool:
    return any(word.axis == other.axis for other in earlier)
