"""The panel of an entry of the page Align: how what is typed is understood, and what to press."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from console.tui.align.asked import AXES, CLAMPING, Answer, Asked, Question
from console.tui.align.clamp_answer import clamp_answer, clamp_lines
from console.tui.align.force_answer import force_answer, force_lines
from console.tui.align.measured_answer import diameter_answer, diameter_lines
from console.tui.align.target_answer import target_answer, target_lines
from console.tui.lines import BLANK, Line, first_fitting, hanging, wrapped
from console.tui.pages.fields import named
from console.tui.theme import Token


def answered(question: Question) -> Answer:
    """Return how the entry is understood; nothing typed is no problem yet."""
    if question.asked in AXES:
        return target_answer(question)
    if question.asked in CLAMPING:
        return clamp_answer(question)
    return diameter_answer(question) if question.asked is Asked.DIAMETER else force_answer(question)


def asked_title(text: Catalogue, asked: Asked) -> str:
    """Return the title of the panel of an entry."""
    return text(f"align_page.asked.{asked}")


def asked_lines(text: Catalogue, question: Question, width: int, height: int | None) -> list[Line]:
    """Return the panel of an entry; what is against it comes before what to press."""
    of_force = question.asked in (Asked.TORQUE, Asked.FORCE)
    lines = target_lines if question.asked in AXES else force_lines if of_force else diameter_lines
    lines = clamp_lines if question.asked in CLAMPING else lines
    rows, keys = lines(text, question, width), "target" if question.asked in AXES else question.asked
    for problem in answered(question).problems:
        rows += hanging(("✗ ", Token.WARNING), text.problem(named(problem, text)), width)
    hint = wrapped(text(f"align_page.{keys}_keys"), width, Token.DIM)
    return first_fitting(height, text("panel.more"), [*rows, BLANK, *hint], [*rows, *hint])
