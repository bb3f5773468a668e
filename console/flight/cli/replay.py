"""`console replay`: a frozen recording of the flight recorder, on the pages, as lines, or listed."""

from __future__ import annotations

from argparse import Namespace
from importlib import import_module
from pathlib import Path

from console.cli.parser import Parser
from console.rings import is_installed
from console.text.catalogue import Catalogue

LESSON = "console.school.cli.replay_lesson"


def add(parser: Parser, text: Catalogue) -> None:
    """Add the file, and what is printed instead of the pages. The pages are drawn by the screens."""
    parser.add_argument("file", metavar="FILE", nargs="?", help=text("help.replay.file"))
    forms = parser.add_mutually_exclusive_group()
    forms.add_argument("--list", action="store_true", help=text("help.replay.list"))
    forms.add_argument("--text", action="store_true", help=text("help.replay.text"))
    if is_installed(LESSON):
        forms.add_argument("--lesson", metavar="OUT.toml", dest="lesson_file", help=text("help.replay.lesson"))
    parser.set_defaults(plot=True, lesson_file=None)


def main(options: Namespace, text: Catalogue) -> int:
    """Print the recordings that there are, or what happened in one."""
    from console.cli.library import data_of
    from console.cli.output import show, tell
    from console.flight.cli.replay_report import list_recordings, listed_lines, replay_fields, replay_lines
    from console.flight.frozen_recordings import frozen_in
    from console.flight.recording import read_recording

    if options.lesson_file is not None:
        code: int = import_module(LESSON).write_lesson(
            options, None if options.file is None else path_of(options), text
        )
        return code
    if options.file is None or options.list:
        found = list_recordings(frozen_in(data_of(options)))
        tell([problem for entry in found for problem in entry.problems], text)
        show(
            options,
            lambda: {"recordings": [entry.fields() for entry in found if entry.header is not None]},
            lambda: listed_lines(found, text),
        )
        return 0
    recording = read_recording(path_of(options))
    show(options, lambda: replay_fields(recording, text), lambda: replay_lines(recording, text))
    return 0


def path_of(options: Namespace) -> Path:
    """Return the file that is meant: a path, or a name from the list."""
    from console.cli.library import data_of

    return path_named(options.file, data_of(options))


def path_named(file: str, data: Path) -> Path:
    """Return the recording of a path, or of a name in the list of a data folder."""
    from console.flight.frozen_recordings import SUFFIX
    from console.flight.ring import FOLDER

    given = Path(file)
    if given.exists() or given.name != file:
        return given
    named = data / FOLDER / file
    return next((each for each in (named, Path(f"{named}{SUFFIX}")) if each.exists()), given)
