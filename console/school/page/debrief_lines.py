"""The debrief of a try, in lines: the score, what counted, what to do next time, and what happened when."""

from __future__ import annotations

from collections.abc import Sequence

from console.school.training.attempt import Attempt
from console.school.training.debrief import Debrief
from console.school.training.happened import What
from console.school.words.debrief import clock, happening_words, mark_words
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, Line, dim, hanging, line, wrapped
from console.tui.theme import Token


def score_lines(
    debrief: Debrief, scores: Sequence[int], text: Catalogue, width: int, answers: Sequence[str]
) -> list[Line]:
    """Return the score, each mark with the points that it cost, and the trend over all tries.

    `answers` are those to the question of the lesson.
    """
    rows = [line((text("debrief.score", score=debrief.score), Token.STRONG))]
    for mark in debrief.marks:
        good = mark.lost < 0.5
        points = () if good else (dim(f"-{mark.lost:.0f}"),)
        sign = ("✓ ", Token.OK) if good else ("✗ ", Token.WARNING)
        rows += hanging(sign, mark_words(mark, text, answers), width, beside=points)
    if len(scores) > 1:
        shown = " ".join(str(score) for score in scores[-12:])
        rows += [BLANK, *wrapped(text("debrief.trend", scores=shown), width, Token.DIM)]
    return rows


def advice_lines(debrief: Debrief, text: Catalogue, width: int) -> list[Line]:
    """Return what to do next time, about what cost most."""
    worst = debrief.worst
    return wrapped(text("debrief.next.none" if worst is None else f"debrief.next.{worst.item}"), width)


def happened_lines(attempt: Attempt, text: Catalogue, width: int) -> list[Line]:
    """Return what happened when, oldest first."""
    rows: list[Line] = []
    for each in attempt.happened:
        token = Token.DIM if each.what is What.STEP else Token.TEXT
        rows += hanging(dim(f"{clock(each.at_s)} "), happening_words(each, text), width, token)
    return rows
