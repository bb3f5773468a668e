"""The debrief of a try, in lines: the score, what counted, what to do next time, and what happened when."""

from __future__ import annotations

from collections.abc import Sequence

from console.session.station.alarms import collision_problems
from console.session.training.attempt import Attempt
from console.session.training.debrief import Debrief, Mark
from console.session.training.happened import Happening, What
from console.session.training.item import Item
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, Line, dim, hanging, line, wrapped
from console.tui.theme import Token

_DIGITS = {Item.JAW: 2, Item.ROUND: 2, Item.TOUCH_OFF: 1, Item.DIAMETER: 1, Item.TIME: 1}


def score_lines(debrief: Debrief, scores: Sequence[int], text: Catalogue, width: int) -> list[Line]:
    """Return the score, each mark with the points that it cost, and the trend over all tries."""
    rows = [line((text("debrief.score", score=debrief.score), Token.STRONG))]
    for mark in debrief.marks:
        good = mark.lost < 0.5
        points = () if good else (dim(f"-{mark.lost:.0f}"),)
        sign = ("✓ ", Token.OK) if good else ("✗ ", Token.WARNING)
        rows += hanging(sign, mark_words(mark, text), width, beside=points)
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


def mark_words(mark: Mark, text: Catalogue) -> str:
    """Return one mark: what it was, what is right, and what it leaves on the part."""
    digits = _DIGITS.get(mark.item, 0)
    said = text(f"debrief.{mark.item}", value=f"{mark.value:.{digits}f}", limit=f"{mark.limit:.{digits}f}")
    if mark.cost_um is None or mark.lost < 0.5:
        return said
    return f"{said}; {text('debrief.cost', um=f'{mark.cost_um:.1f}')}"


def happening_words(each: Happening, text: Catalogue) -> str:
    """Return what happened."""
    match each.what:
        case What.STEP:
            words = text(f"train_page.step.{each.word}")
        case What.STOP:
            words = text.reason(each.word)
        case What.FAULT:
            words = text(f"fault.{each.word.split()[0]}")
        case What.MET:
            words = text.problem(collision_problems([each.word])[0])
        case What.PART:
            words = each.word
        case _:
            words = each.word if each.problem is None else text.problem(each.problem)
    return text(f"debrief.what.{each.what}", words=words)


def clock(seconds: float) -> str:
    """Return minutes and seconds."""
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"
