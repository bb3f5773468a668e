"""The begin of a lesson, before the first page: anew, or where it was left."""

from __future__ import annotations

import sys
import time
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from console.text.catalogue import Catalogue

if TYPE_CHECKING:
    from console.school.training.attempt import Attempt
    from console.school.training.lesson import Lesson

ANEW = ("n", "ㅜ")
MOST_QUESTIONS = 10


def begun(options: Namespace, data: Path, text: Catalogue) -> Attempt:
    """Return a try of a lesson that begins now, or is continued.

    Raises ProfileError: the lesson is unknown, or cannot be read, or the try that was left.
    """
    import random

    from console.school.training.attempt import Attempt
    from console.school.training.lesson import load_lesson
    from console.school.training.shelf import own_folder
    from console.school.training.tries import check_trainee
    from drivers.simulator.plant.presets import SEEDS

    trainee = options.trainee or ""
    check_trainee(trainee)
    lesson = load_lesson(options.lesson, own_folder(data))
    if (left := _continued(data, trainee, lesson, text)) is not None:
        return left
    seed = random.SystemRandom().randrange(SEEDS) if lesson.seed is None else lesson.seed
    return Attempt(lesson=lesson, began_s=time.monotonic(), seed=seed, trainee=trainee)


def _continued(data: Path, trainee: str, lesson: Lesson, text: Catalogue) -> Attempt | None:
    """Return the try that was left, where there is one that can be continued and is to be."""
    from dataclasses import replace

    from console.school.training.left import continued, is_the_same, read_left

    left = read_left(data, trainee, lesson.name)
    if left is None:
        return None
    attempt = continued(left, lesson, time.monotonic())
    minutes, seconds = divmod(int(left.took_s), 60)
    facts = {"made": len(left.reached), "steps": len(lesson.steps), "kept": attempt.continued if attempt else 0}
    if attempt is None:
        why = "lost" if is_the_same(left, lesson) else "changed"
        print(text(f"lesson_start.{why}", time=f"{minutes}:{seconds:02d}", **facts))
        _answer(text("lesson_start.anew"))
        return None
    print(text("lesson_start.left", time=f"{minutes}:{seconds:02d}", **facts))
    if _answer(text("lesson_start.ask")):
        return None
    return replace(attempt, began_s=time.monotonic() - left.took_s)  # reading the question takes none of its time


def _answer(question: str) -> str:
    """Ask on the terminal; return "" for Enter, or n. A terminal that ends interrupts."""
    for _ in range(MOST_QUESTIONS):
        try:
            answer = input(question).strip().lower()
        except EOFError:
            break
        if answer in ("", *ANEW):
            return answer
    sys.stdout.flush()
    raise KeyboardInterrupt
