"""`console check-program`: what a controller program will do, move by move, before it is sent."""

from __future__ import annotations

import codecs
from argparse import ArgumentTypeError, Namespace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from console.cli.arguments import add_shared, milliseconds
from console.cli.parser import Parser
from console.text.catalogue import Catalogue
from drivers.errors import DriverError
from profiles.files import printable, read_regular_file
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError

if TYPE_CHECKING:
    from drivers.pmac.analysis.program import ProgramCheck

CAP_BYTES = 1_000_000
"""Program memory of a controller; each move costs a kilobyte while it is checked."""

_WIDE_ENCODINGS = {
    codecs.BOM_UTF32_LE: "UTF-32",  # starts with the UTF-16 mark
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}


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
    from profiles.findings import Severity

    machine = profile_of(options).machine
    checked = _checked_file(options, machine)
    show(
        options,
        lambda: program_fields(options, machine, checked, text),
        lambda: program_lines(options, machine, checked, text),
    )
    return 1 if checked.worst is Severity.REFUSAL else 0


def _checked_file(options: Namespace, machine: MachineProfile) -> ProgramCheck:
    """Read the file and check it.

    Raises:
        ProblemError: `file.unreadable`, `file.too_large`; `program.encoding`; `program.refused`, there is nothing
            to check; `program.start_axis`, `program.start_too_far`.
    """
    from drivers.pmac.analysis.program import check_program
    from drivers.pmac.dialect import DIALECTS
    from drivers.pmac.language.errors import PmacError
    from drivers.simulator.commands.line import read_line

    content, where = read_regular_file(Path(options.file), cap_bytes=CAP_BYTES), printable(options.file)
    if encoding := _wide_encoding(content):
        raise DriverError(Problem(code="program.encoding", where=where, value=encoding))
    # Invalid UTF-8 stays a character that the controller rejects; in a comment it does no harm.
    program = content.decode("utf-8-sig", "replace")
    try:
        included = partial(_included, Path(options.file).parent)
        return check_program(
            program,
            machine,
            options.ta_ms,
            options.ts_ms,
            options.start,
            included,
            partial(read_line, dialect=DIALECTS[machine.controller.family]),
        )
    except PmacError as error:
        raise DriverError(Problem(code="program.refused", where=where, value=str(error))) from error


def _included(folder: Path, name: str) -> str:
    """Return the text of a file that a program includes, from the folder of the program.

    Raises PmacError: 003, it cannot be read.
    """
    from drivers.pmac.language.errors import ErrorCode, PmacError

    try:
        content = read_regular_file(folder / name.replace("\\", "/"), cap_bytes=CAP_BYTES)
    except ProblemError as error:
        raise PmacError(ErrorCode.DATA_ERROR, f"#include {printable(name)}: no file that can be read") from error
    return content.decode("utf-8-sig", "replace")


def _wide_encoding(content: bytes) -> str | None:
    """Return the name of a multi-byte encoding of the program text; None for all others."""
    for mark, encoding in _WIDE_ENCODINGS.items():
        if content.startswith(mark):
            return encoding
    # A program has no NUL; ASCII text in such an encoding has one in every second byte.
    empty, other = sorted((content[place::2].count(0) for place in (0, 1)), reverse=True)
    return "UTF-16" if empty > len(content) // 4 and not other else None
