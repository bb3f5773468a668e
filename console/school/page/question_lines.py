"""The question of a lesson in lines, with the answer that is chosen."""

from __future__ import annotations

from console.school.training.lesson import Words
from console.tui.lines import BLANK, Line, dim, hanging, wrapped
from console.tui.theme import Token

_CHOSEN, _OTHER = ("▸ ", Token.KEY), dim("  ")


def question_lines(words: Words, choice: int, width: int) -> list[Line]:
    """Return the question, and each answer; the one of the number `choice`, from 0, is marked."""
    rows = [*wrapped(words.question, width, Token.STRONG), BLANK]
    for number, answer in enumerate(words.answers):
        chosen = number == choice
        rows += hanging(_CHOSEN if chosen else _OTHER, answer, width, Token.STRONG if chosen else Token.TEXT)
    return rows
