"""`console replay FILE --lesson OUT.toml`: a recorded event as a lesson, from the bare lathe to the event."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from console.cli.output import show
from console.flight.recording import read_recording
from console.school.practice.as_lesson import lesson_of_practice, lesson_text, steps_of
from console.school.practice.practice import practice_of
from console.school.training.lesson import lesson_of
from console.school.words.practice import lesson_words, practice_lines
from console.text.catalogue import LANGUAGES, Catalogue, load
from profiles.files import parse_toml, write_atomically
from profiles.problem import Problem

WRONG_USAGE = 2
PLANT = "mounted"


def write_lesson(options: Namespace, recorded: Path | None, text: Catalogue) -> int:
    """Write the event of a recording as a lesson; what differs from what was recorded is in it, and printed.

    Raises:
        ProblemError: those of `read_recording` and `practice_of`; `file.exists`, `file.not_writable`.
    """
    if recorded is None or not options.lesson_file.endswith(".toml"):
        print(f"console replay: {text('usage.lesson_form')}", file=sys.stderr)
        return WRONG_USAGE
    practice = practice_of(read_recording(recorded))
    steps = steps_of(practice, set_up=True)
    words = {language: lesson_words(practice, steps, load(language)) for language in LANGUAGES}
    lesson = lesson_of_practice(practice, words, plant=PLANT, seed=None, set_up=True)
    machine = practice.recording.header.machine.name
    remarks = [*practice_lines(practice, text, set_up=True), text("practice.on_machine", machine=machine)]
    if practice.work is not None:
        remarks.append(text.problem(Problem(code="practice.job_elsewhere", key=practice.work.job.name)))
    content = lesson_text(lesson, tuple(row for row in remarks if row))
    path = Path(options.lesson_file)
    lesson_of(parse_toml(content.encode(), str(path)), path.stem, str(path))  # what is written can be read
    write_atomically(path, content.encode(), overwrite=False)
    said = [text("practice.written", file=str(path)), text("practice.how", name=path.stem)]
    show(
        options,
        lambda: {"file": str(path), "steps": list(steps), "remarks": remarks},
        lambda: [*remarks, "", *said],
    )
    return 0
