"""All lessons: the bundled ones, then the user's own."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

from console.school.training.lesson import Lesson, lesson_paths, load_lesson
from profiles.problem import Problem, ProfileError

Shelved: TypeAlias = tuple[str, Lesson | tuple[Problem, ...]]
"""The name of a lesson with it, or with why it cannot be read."""


def own_folder(data: Path) -> Path:
    """Return where a user's own lessons are, in the data folder."""
    return data / "lessons"


def lessons(own: Path) -> tuple[Shelved, ...]:
    """Return all lessons, in the order of their places; those that cannot be read at the end."""
    found = [_load_lesson_file(path) for path in lesson_paths(own)]
    return tuple(sorted(found, key=lambda each: (_place(each), each[0])))


def _load_lesson_file(path: Path) -> Shelved:
    try:
        return path.stem, load_lesson(str(path), path.parent)
    except ProfileError as error:
        return path.stem, tuple(error.problems)


def _place(shelved: Shelved) -> int:
    lesson = shelved[1]
    return lesson.place if isinstance(lesson, Lesson) else 10_000
