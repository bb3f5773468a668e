"""The question of a lesson: answered on the page Train, where its step `answered` is due. Pure.

The right answer is a number in the file, or the place of the lathe that was drawn for the try.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from random import Random
from typing import Any

from drivers.simulator.plant.presets import plant_problems
from profiles.fields import Field, Kind
from profiles.problem import Problem

STEP = "answered"
LEAST_ANSWERS, MOST_ANSWERS = 2, 6
QUESTION_CAP, ANSWER_CAP = 120, 70

QUESTION_FIELDS = (
    Field(key="lathes", kind=Kind.TEXTS, default=()),
    Field(key="answer", kind=Kind.WHOLE, at_least=1, at_most=MOST_ANSWERS, optional=True),
)
"""Of the lesson: files of lathes of which one is drawn, or the number of the right answer."""

QUESTION_WORDS = (
    Field(key="question", kind=Kind.TEXT, default="", longest=QUESTION_CAP),
    Field(key="answers", kind=Kind.TEXTS, default=(), longest=ANSWER_CAP),
)
"""Of each language."""


def question_problems(
    values: Mapping[str, Any], words: Mapping[str, Mapping[str, Any]], where: str
) -> list[Problem]:
    """Return what is wrong with a question: it goes with its step, and with as many answers in each language."""
    if STEP not in values["steps"]:
        given = [f"{language}.question" for language, said in words.items() if said["question"] or said["answers"]]
        return [Problem(code="lesson.no_question", where=where, key=key, limit=STEP) for key in given]
    lathes, answer = values["lathes"], values["answer"]
    problems = []
    if (answer is None) == (not lathes):
        problems.append(Problem(code="lesson.right_answer", where=where, key="answer", limit="lathes | answer"))
    least, most = (len(lathes),) * 2 if lathes else (max(answer or 0, LEAST_ANSWERS), MOST_ANSWERS)
    for language, said in words.items():
        if not said["question"]:
            problems.append(Problem(code="key.missing", where=where, key=f"{language}.question"))
        if not least <= len(said["answers"]) <= most:
            value, limit = str(len(said["answers"])), f"{least} - {most}" if most > least else str(least)
            key = f"{language}.answers"
            problems.append(Problem(code="lesson.answers", where=where, key=key, value=value, limit=limit))
    return problems


def lathe_files(names: Sequence[str], folder: Path) -> tuple[tuple[str, ...], list[Problem]]:
    """Return the files of lathes beside a lesson, and why those cannot be used that cannot."""
    files = tuple(str(folder / f"{name}.toml") for name in names)
    return files, [problem for file in files for problem in plant_problems(file)]


def drawn_number(seed: int | None, lathes: Sequence[str]) -> int:
    """Return which of the lathes a try is on, from 0."""
    return Random(f"{seed} lathe of the lesson").randrange(len(lathes))
