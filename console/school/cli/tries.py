"""`console tries`: the tries of lessons that were kept, by trainee: list, show, export, delete them."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from console.cli.library import data_of
from console.cli.output import show
from console.cli.parser import Parser
from console.escaping import csv_table
from console.session.errors import SessionError
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.problem import Problem, ProfileError

if TYPE_CHECKING:
    from console.school.training.tries import Try

COLUMNS = ("date", "trainee", "lesson", "score", "took_s", "plant", "seed", "blind")


def add(parser: Parser, text: Catalogue) -> None:
    """Add the name of a lesson, of a trainee, and what to do with the tries."""
    parser.add_argument("lesson", metavar="NAME", nargs="?", help=text("help.tries_lesson"))
    parser.add_argument("--trainee", metavar="NAME", help=text("help.tries_trainee"))
    one = parser.add_mutually_exclusive_group()
    one.add_argument("--show", action="store_true", help=text("help.tries_show"))
    one.add_argument("--export", metavar="FILE.csv", help=text("help.tries_export"))
    one.add_argument("--delete", action="store_true", help=text("help.tries_delete"))


def main(options: Namespace, text: Catalogue) -> int:
    """List the tries, write them into a file, or delete them."""
    from console.school.training.tries import delete, files_of, left_files, tries

    data = data_of(options)
    if options.delete and options.trainee is None:
        raise SessionError(Problem(code="training.delete_whose"))
    if options.delete:
        number = delete(files_of(data, options.trainee, options.lesson))
        delete(left_files(data, options.trainee, options.lesson))
        show(options, lambda: {"deleted": number}, lambda: [text("tries.deleted", count=number)])
        return 0
    found = tries(data, options.trainee, options.lesson)
    if options.show:
        _show_newest(options, found, text)
        return 0
    if options.export is not None:
        from profiles.files import write_atomically

        write_atomically(Path(options.export), _table(found).encode(), overwrite=False)
        fields = {"file": options.export, "tries": len(found)}
        show(options, lambda: fields, lambda: [text("tries.exported", count=len(found), file=options.export)])
        return 0
    show(options, lambda: {"tries": [_fields(each) for each in found]}, lambda: _lines(found, text))
    return 0


def _show_newest(options: Namespace, found: tuple[Try, ...], text: Catalogue) -> None:
    """Show the debrief of the newest of these tries."""
    if not found:
        show(options, lambda: {"tries": []}, lambda: [text("tries.none")])
        return
    one = found[-1]
    fields = {**_fields(one), "marks": list(one.marks), "happened": list(one.happened)}
    show(
        options,
        lambda: fields,
        lambda: [*_lines(found[-1:], text), "", *_debrief(one, _answers(one, options, text), text)],
    )


def _answers(one: Try, options: Namespace, text: Catalogue) -> tuple[str, ...]:
    """Return the answers to the question of the lesson, none where it is not there any more."""
    from console.school.training.lesson import load_lesson, own_folder

    try:
        return load_lesson(one.lesson, own_folder(data_of(options))).words[text.language].answers
    except ProfileError:
        return ()


def _debrief(one: Try, answers: tuple[str, ...], text: Catalogue) -> list[str]:
    """Return the debrief as the page Train showed it: marks with their points, advice, what happened when."""
    from console.school.training.tries import told_again
    from console.school.words.debrief import clock, happening_words, mark_words

    debrief, happened = told_again(one)
    marks = [
        (f"-{mark.lost:.0f}" if mark.lost >= 0.5 else "✓", mark_words(mark, text, answers))
        for mark in debrief.marks
    ]
    advice = text("debrief.next.none" if debrief.worst is None else f"debrief.next.{debrief.worst.item}")
    times = [(clock(each.at_s), happening_words(each, text)) for each in happened]
    return [*table(marks, numeric=(0,)), "", advice, "", *table(times, numeric=(0,))]


def _fields(one: Try) -> dict[str, object]:
    return {name: getattr(one, name) for name in COLUMNS}


def _table(found: tuple[Try, ...]) -> str:
    return csv_table(COLUMNS, (_fields(each).values() for each in found))


def _lines(found: tuple[Try, ...], text: Catalogue) -> list[str]:
    if not found:
        return [text("tries.none")]
    return table(
        [
            (each.date[:16].replace("T", " "), each.trainee or "-", each.lesson, str(each.score), _minutes(each))
            for each in found
        ],
        numeric=(3, 4),
    )


def _minutes(one: Try) -> str:
    return f"{one.took_s / 60.0:.1f} min"
