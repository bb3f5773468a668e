"""`console check-program`: what a controller program will really do, move by move, before it is sent."""

from __future__ import annotations

import codecs
from argparse import ArgumentTypeError, Namespace
from pathlib import Path

from console.cli.arguments import add_machine, milliseconds
from console.cli.library import profile_of
from console.cli.output import print_json
from console.cli.parser import Parser
from console.cli.part.check_program_fields import program_fields
from console.cli.part.check_program_lines import program_lines
from console.text.catalogue import Catalogue
from drivers.errors import DriverError
from drivers.pmac.analysis.findings import Level
from drivers.pmac.analysis.program import ProgramCheck, check_program
from drivers.pmac.analysis.start import read_start
from drivers.pmac.language.errors import PmacError
from profiles.files import printable, read_regular_file
from profiles.machine import MachineProfile
from profiles.problem import Problem

CAP_BYTES = 1_000_000
"""As much program text as a controller keeps; each move costs a kilobyte while it is checked."""

_MARKS_OF_ENCODINGS = (
    ("UTF-32", codecs.BOM_UTF32_LE),  # begins as UTF-16 does
    ("UTF-32", codecs.BOM_UTF32_BE),
    ("UTF-16", codecs.BOM_UTF16_LE),
    ("UTF-16", codecs.BOM_UTF16_BE),
)


def add(parser: Parser, text: Catalogue) -> None:
    """Add the program, the machine, where its motors start and what the operator changes at the machine."""
    parser.add_argument("file", metavar="FILE", help=text("help.program_file"))
    add_machine(parser, text)
    parser.add_argument("--from", metavar="X=N,Y=N", type=_start, dest="start", help=text("help.start"))
    parser.add_argument("--ta", metavar="MS", type=milliseconds, dest="ta_ms", help=text("help.other_ta"))
    parser.add_argument("--ts", metavar="MS", type=milliseconds, dest="ts_ms", help=text("help.other_ts"))


def _start(word: str) -> dict[str, float]:
    try:
        return read_start(word)
    except ValueError as error:
        raise ArgumentTypeError(Parser.text("usage.start", value=str(error))) from error


def main(options: Namespace, text: Catalogue) -> int:
    """Print what a program does; 1 when the controller or the machine would not put up with it."""
    machine = profile_of(options).machine
    checked = _checked(options, machine)
    if options.json:
        print_json(program_fields(options, machine, checked, text))
    else:
        print("\n".join(program_lines(options, machine, checked, text)))
    return 1 if checked.worst is Level.FAULT else 0


def _checked(options: Namespace, machine: MachineProfile) -> ProgramCheck:
    """Read the file and check it.

    Raises:
        ProblemError: `file.unreadable`, `file.too_large`; `program.encoding`; `program.refused`, there is nothing
            to look at; `program.start_axis`, `program.start_too_far`.
    """
    content = read_regular_file(Path(options.file), cap_bytes=CAP_BYTES)
    encoding = _wide_encoding(content)
    if encoding is not None:
        raise DriverError(Problem(code="program.encoding", where=printable(options.file), value=encoding))
    # What is no UTF-8 stays a character that the controller does not take; in a comment it does no harm.
    text = content.decode("utf-8-sig", "replace")
    try:
        return check_program(text, machine, options.ta_ms, options.ts_ms, options.start)
    except PmacError as error:
        problem = Problem(code="program.refused", where=printable(options.file), value=str(error))
        raise DriverError(problem) from error


def _wide_encoding(content: bytes) -> str | None:
    """Return the name of an encoding with several bytes for each character of a program; None for all others."""
    for encoding, mark in _MARKS_OF_ENCODINGS:
        if content.startswith(mark):
            return encoding
    # No program has a NUL; what is ASCII has one in every second byte there, and none in the others.
    empty, other = sorted((content[place::2].count(0) for place in (0, 1)), reverse=True)
    return "UTF-16" if empty > len(content) // 4 and not other else None
