"""What counted in a try of a lesson, and what happened in it, in words."""

from __future__ import annotations

from collections.abc import Sequence

from console.school.training.debrief import ScoreItem
from console.school.training.happenings import Happening, HappeningKind
from console.school.training.lesson import Item
from console.session.station.alarms import collision_problems
from console.text.catalogue import Catalogue

_DIGITS = {
    Item.NEAR: 1,
    Item.CONTACT: 2,
    Item.JAW: 2,
    Item.ROUND: 2,
    Item.TOUCH_OFF: 1,
    Item.DIAMETER: 1,
    Item.TIME: 1,
}


def mark_words(mark: ScoreItem, text: Catalogue, answers: Sequence[str] = ()) -> str:
    """Return one mark: what it was, what is right, and what it leaves on the part.

    `answers` are those to the question of the lesson; without them an answer is its number.
    """
    if mark.item is Item.ANSWER:
        given, right = (answers[int(each) - 1] if answers else f"{each:.0f}" for each in (mark.value, mark.limit))
        return text("debrief.answer" if mark.lost else "debrief.answer_right", value=given, limit=right)
    digits = _DIGITS.get(mark.item, 0)
    said = text(f"debrief.{mark.item}", value=f"{mark.value:.{digits}f}", limit=f"{mark.limit:.{digits}f}")
    if mark.cost_um is None or mark.lost < 0.5:
        return said
    return f"{said}; {text('debrief.cost', um=f'{mark.cost_um:.1f}')}"


def happening_words(each: Happening, text: Catalogue) -> str:
    """Return what happened."""
    match each.what:
        case HappeningKind.STEP:
            words = text(f"train_page.step.{each.word}")
        case HappeningKind.STOP:
            words = text.reason(each.word)
        case HappeningKind.FAULT:  # its settings are not for people
            words = text(f"fault.{each.word.split()[0]}")
        case HappeningKind.MET:
            words = text.problem(collision_problems([each.word])[0])
        case HappeningKind.PART:
            words = each.word
        case _:
            words = each.word if each.problem is None else text.problem(each.problem)
    return text(f"debrief.what.{each.what}", words=words)


def clock(seconds: float) -> str:
    """Return minutes and seconds."""
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"
