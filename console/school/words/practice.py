"""Sentences for the practice of a recorded event: what comes when, and what is not as it was."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

from console.text.catalogue import Catalogue
from console.text.recorded_words import alarm_words

if TYPE_CHECKING:
    from console.school.practice.practice import Practice
    from console.school.training.lesson import Words

LONGEST_TITLE, LONGEST_GOAL = 60, 400
OF_THE_BEGINNING = frozenset(
    f"practice.{what}"
    for what in ("at_start", "tool_out", "as_found", "not_homed", "spindle_stands", "other_blank", "fresh_blank")
)
"""What differs where a practice begins."""


def practice_lines(practice: Practice, text: Catalogue, *, set_up: bool = False) -> list[str]:
    """Return what is said before a practice begins; of a lesson that is `set_up` anew, without where it begins."""
    event, begin = practice.event, practice.before
    begins = text("practice.begins", seconds=f"{event.at_s - begin.at_s:.0f}")
    lines = [
        text("practice.head", event=event_words(practice, text)),
        where_words(practice, text),
        "",
        text("practice.from_the_start") if set_up else begins,
        comes_words(practice, text),
    ]
    said = [each for each in practice.otherwise if not (set_up and each.code in OF_THE_BEGINNING)]
    otherwise = [f"- {text.problem(each)}" for each in said]
    return [*lines, *(["", text("practice.otherwise"), *otherwise] if otherwise else [])]


def event_words(practice: Practice, text: Catalogue) -> str:
    """Return the event: what its alarm said was the case, or why the machine was stopped."""
    event = practice.event
    if event.problem is not None:
        return text.problem(event.problem).partition(";")[0]
    kind, _, key = event.reason.partition(" ")
    if kind == "stop" and key:
        return text("replay.reason.stop", value=text.reason(key))
    if event.reason in ("killed", "crash"):
        return text(f"replay.reason.{event.reason}")
    if "." in event.reason:
        return text("replay.reason.alarm", value=alarm_words(event.reason, text))
    return text("replay.reason.signal", value=event.reason)


def where_words(practice: Practice, text: Catalogue) -> str:
    """Return when and on which machine it was."""
    header = practice.recording.header
    at = datetime.fromtimestamp(header.utc_of(practice.event.at_s), UTC)
    key = "practice.where" if header.simulated else "practice.where_real"
    sim = f"{text('sim')} " if header.simulated else ""
    return text(key, at=f"{at:%Y-%m-%d %H:%M:%S} UTC", machine=f"{sim}{header.machine.name}")


def comes_words(practice: Practice, text: Catalogue) -> str:
    """Return when which fault comes."""
    event, begin = practice.event, practice.before
    if event.like is None:
        return text("practice.comes_not")
    fault, seconds = text(f"fault.{event.fault}"), f"{begin.after_s:.1f}"
    if begin.turn is not None:
        return text("practice.comes_at_turn", turn=f"{begin.turn:.1f}", fault=fault)
    if begin.of_cut:
        return text("practice.comes_after_arming", seconds=seconds, fault=fault)
    if event.fault == "index-lost":
        return text("practice.comes_at_once", fault=fault)
    if begin.missing:
        step = text(f"train_page.step.{begin.missing[-1]}")
        return text("practice.comes_after_step", step=step, seconds=seconds, fault=fault)
    return text("practice.comes_after", seconds=seconds, fault=fault)


def lesson_words(practice: Practice, steps: tuple[str, ...], text: Catalogue) -> Words:
    """Return the words of the lesson with these steps."""
    from console.school.training.lesson import Words

    fault = practice.event.fault
    what = text(f"fault.{fault}") if fault else event_words(practice, text)
    goal = text(
        "practice.goal",
        where=where_words(practice, text),
        event=f"{event_words(practice, text).rstrip('.')}.",
        comes=comes_words(practice, text),
    )
    return Words(
        title=_shorten_words(text("practice.title", what=what), LONGEST_TITLE),
        goal=_shorten_words(goal, LONGEST_GOAL),
        hints=tuple(text(f"practice.hint.{step}") for step in steps),
    )


def _shorten_words(words: str, longest: int) -> str:
    return words if len(words) <= longest else f"{words[: longest - 1].rstrip()}…"
