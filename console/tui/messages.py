"""Every message in full: all alarms, all answers to the last key, all texts of the page."""

from __future__ import annotations

from collections.abc import Sequence

from console.tui.frame import MARKS, Frame, answer_of
from console.tui.lines import BLANK, Line, dim, hanging, line
from console.tui.pages.fields import named
from console.tui.theme import Token


def message_lines(frame: Frame, of_page: Sequence[Line], width: int) -> list[Line]:
    """Return the current messages, uncut: the alarms, the answers to the last key, the page."""
    text, alarms, answers = frame.text, frame.state.alarms, answer_of(frame)
    rows = [line((text("messages.alarms", count=len(alarms)), Token.TITLE))]
    for alarm in sorted(alarms, key=lambda each: (each.acknowledged, each.priority, each.at_s)):
        token = Token.WARNING if alarm.acknowledged else Token.ALARM
        rows += hanging((f"{MARKS[alarm.priority]} ", token), text.problem(alarm.problem), width, token)
    if answers:
        rows += [BLANK, line((text("messages.answers", count=len(answers)), Token.TITLE))]
    for problem in answers:
        rows += hanging(("– ", Token.WARNING), text.problem(named(problem, text)), width, Token.WARNING)
    if of_page:
        rows += [BLANK, line((text(f"page.{frame.page}"), Token.TITLE)), *of_page]
    return [*rows, BLANK, line(dim(text("messages.close")))]
