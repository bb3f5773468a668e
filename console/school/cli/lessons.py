"""`console lessons`: the lessons of the simulated lathe."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from console.cli.library import data_of
from console.cli.output import show
from console.cli.parser import Parser
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.problem import Problem

if TYPE_CHECKING:
    from console.school.training.lesson import Lesson, Shelved


def add(parser: Parser, text: Catalogue) -> None:
    """Add the name of a lesson."""
    parser.add_argument("name", metavar="NAME", nargs="?", help=text("help.lesson_name"))


def main(options: Namespace, text: Catalogue) -> int:
    """List every lesson by the name that --lesson takes, or show one."""
    from console.school.training.lesson import lessons, load_lesson, own_folder

    own = own_folder(data_of(options))
    if options.name is not None:
        lesson = load_lesson(options.name, own)
        show(options, lambda: _fields((lesson.name, lesson), text), lambda: _describe_lesson(lesson, text))
        return 0
    found = lessons(own)
    show(options, lambda: {"lessons": [_fields(each, text) for each in found]}, lambda: _lines(found, text))
    return 0


def _fields(shelved: Shelved, text: Catalogue) -> dict[str, object]:
    name, lesson = shelved
    if isinstance(lesson, tuple):
        return {"name": name, "problems": [text.problem(problem) for problem in lesson]}
    words = lesson.words[text.language]
    return {
        "name": name,
        "title": words.title,
        "minutes": lesson.minutes,
        "goal": words.goal,
        "plant": lesson.plant,
        "seed": lesson.seed,
        "blind": lesson.blind,
        "job": lesson.job,
        "steps": list(lesson.steps),
        "hints": list(words.hints),
    }


def _lines(found: tuple[Shelved, ...], text: Catalogue) -> list[str]:
    return table([(name, _line(lesson, text)) for name, lesson in found])


def _line(lesson: Lesson | tuple[Problem, ...], text: Catalogue) -> str:
    if isinstance(lesson, tuple):
        return "; ".join(text.problem(problem) for problem in lesson)
    return text("lessons.line", minutes=f"{lesson.minutes:g}", title=lesson.words[text.language].title)


def _describe_lesson(lesson: Lesson, text: Catalogue) -> list[str]:
    """Return a lesson with its steps, each with its hint."""
    words = lesson.words[text.language]
    steps = [
        line
        for number, (name, hint) in enumerate(zip(lesson.steps, words.hints, strict=True), start=1)
        for line in (f"{number}. {text(f'train_page.step.{name}')}", f"   {hint}")
    ]
    return [_line(lesson, text), words.goal, "", *steps]
