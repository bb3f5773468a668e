"""The practice of a recorded event as a lesson: its steps, and when the event comes."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from console.school.practice.practice import Practice
from console.school.practice.practice_start import SET_UP
from console.school.training.event import LessonEvent
from console.school.training.lesson import EVENTS, Item, Lesson, Words
from profiles.words.sentences import LANGUAGES

MINUTES = 10.0
PLACE = 900
LONGEST_TITLE, LONGEST_GOAL = 60, 400

_LINK = ("link_lost", "reconnected", "drives_on")
_STOPPED = ("recovered", "drives_on")


def steps_of(practice: Practice, *, set_up: bool) -> tuple[str, ...]:
    """Return the steps to the event, and out of it; with `set_up` also those of the set-up that it had."""
    begin = practice.before
    if set_up:
        steps = [step for step, made in SET_UP.items() if made(practice.begins.alignment) or step in begin.missing]
    else:
        steps = [*(["drives_on"] if practice.begins.drives_on else []), *begin.missing]
    stopped = "stopped"
    if begin.of_cut:
        steps.append("armed")
        if begin.turn is not None:
            steps.append("in_cut")
            stopped = "stopped_in_cut"
    if practice.event.fault == "cut-cable":
        return (*steps, *_LINK)
    if practice.event.fault == "" or not begin.drives_then:
        return (*steps, stopped, "recovered")
    return (*steps, stopped, *_STOPPED)


def events_of_practice(practice: Practice, steps: tuple[str, ...]) -> tuple[LessonEvent, ...]:
    """Return the event of a practice, so long after one of these steps; none where nothing is like it."""
    like, begin = practice.event.like, practice.before
    if like is None:
        return ()
    after = "in_cut" if "in_cut" in steps else "armed" if "armed" in steps else _last(steps, tuple(SET_UP))
    # A flag that never comes is not noticed before it is looked for.
    wait_s = 0.0 if practice.event.fault == "index-lost" else begin.after_s
    return (LessonEvent(after=after, wait_s=round(wait_s, 2), fault=like.fault),)


def _last(steps: tuple[str, ...], among: tuple[str, ...]) -> str:
    """Return the last step of the set-up with which a lesson begins, "" without one."""
    found = ""
    for step in steps:
        if step not in among:
            break
        found = step
    return found


def lesson_of_practice(
    practice: Practice, words: Mapping[str, Words], *, plant: str, seed: int | None, set_up: bool = False
) -> Lesson:
    """Return the lesson; `words` are those of `steps_of` in each language."""
    steps = steps_of(practice, set_up=set_up)
    return Lesson(
        name=practice.recording.path.stem,
        place=PLACE,
        minutes=MINUTES,
        plant=plant,
        seed=seed,
        blind=False,
        job="" if practice.work is None else practice.work.job.name,
        steps=steps,
        counts=(Item.STEPS, Item.MET, Item.ALARMS, Item.REACTION, Item.TIME),
        events=events_of_practice(practice, steps),
        words=MappingProxyType(dict(words)),
    )


def lesson_text(lesson: Lesson, remarks: tuple[str, ...]) -> str:
    """Return a lesson as the text of its file, with remarks before it."""
    import tomlkit

    document = tomlkit.document()
    for remark in remarks:
        document.add(tomlkit.comment(remark))
    plain: dict[str, Any] = {"place": lesson.place, "minutes": lesson.minutes, "plant": lesson.plant}
    plain |= {} if lesson.seed is None else {"seed": lesson.seed}
    plain |= {"job": lesson.job} if lesson.job else {}
    plain |= {"steps": list(lesson.steps), "counts": [str(each) for each in lesson.counts]}
    for key, value in plain.items():
        document.add(key, tomlkit.item(value))
    if lesson.events:
        table = tomlkit.aot()
        for event in lesson.events:
            table.append(tomlkit.item({"after": event.after, "wait_s": event.wait_s, "fault": event.fault}))
        document.add(EVENTS, table)
    for language in LANGUAGES:
        said = lesson.words[language]
        document.add(language, tomlkit.item({"title": said.title, "goal": said.goal, "hints": list(said.hints)}))
    return tomlkit.dumps(document)
