"""`console check-program`: what a controller program will do, move by move, before it is sent."""

from __future__ import annotations

from argparse import ArgumentTypeError, Namespace
from pathlib import Path

from console.cli.arguments import add_shared, milliseconds
from console.cli.parser import Parser
from console.text.catalogue import Catalogue


def add(parser: Parser, text: Catalogue) -> None:
    """Add the program, the machine, the start positions of its motors, and changes made at the machine."""
    parser.add_argument("file", metavar="FILE", help=text("help.program_file"))
    add_shared(parser, text, "machine")
    parser.add_argument("--from", metavar="X=N,Y=N", type=_start, dest="start", help=text("help.start"))
    parser.add_argument("--ta", metavar="MS", type=milliseconds, dest="ta_ms", help=text("help.other_ta"))
    parser.add_argument("--ts", metavar="MS", type=milliseconds, dest="ts_ms", help=text("help.other_ts"))


def _start(word: str) -> dict[str, float]:
    from drivers.pmac.analysis.start import read_start

    try:
        return read_start(word)
    except ValueError as error:
        raise ArgumentTypeError(Parser.text("usage.start", value=str(error))) from error


def main(options: Namespace, text: Catalogue) -> int:
    """Print what a program does; 1 when the controller or the machine would refuse it."""
    from console.cli.library import profile_of
    from console.cli.output import show
    from console.cli.part.check_program_report import program_fields, program_lines
    from console.cli.part.program_file import checked_file
    from profiles.findings import Severity

    machine = profile_of(options).machine
    checked = checked_file(Path(options.file), machine, options.ta_ms, options.ts_ms, options.start)
    show(
        options,
        lambda: program_fields(options, machine, checked, text),
        lambda: program_lines(options, machine, checked, text),
    )
    return 1 if checked.worst is Severity.REFUSAL else 0
