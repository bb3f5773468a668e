"""Loading and checking a controller program from a file."""

from __future__ import annotations

import codecs
from argparse import Namespace
from pathlib import Path

from drivers.errors import DriverError
from drivers.pmac.analysis.program import ProgramCheck, check_program
from drivers.pmac.language.errors import PmacError
from profiles.files import printable, read_regular_file
from profiles.machine import MachineProfile
from profiles.problem import Problem

CAP_BYTES = 1_000_000
"""Program memory of a controller; each move costs a kilobyte while it is checked."""

_MARKS_OF_ENCODINGS = (
    ("UTF-32", codecs.BOM_UTF32_LE),  # starts with the UTF-16 mark
    ("UTF-32", codecs.BOM_UTF32_BE),
    ("UTF-16", codecs.BOM_UTF16_LE),
    ("UTF-16", codecs.BOM_UTF16_BE),
)


def checked_file(options: Namespace, machine: MachineProfile) -> ProgramCheck:
    """Read the file and check it.

    Raises:
        ProblemError: `file.unreadable`, `file.too_large`; `program.encoding`; `program.refused`, there is nothing
            to check; `program.start_axis`, `program.start_too_far`.
    """
    content = read_regular_file(Path(options.file), cap_bytes=CAP_BYTES)
    encoding = _wide_encoding(content)
    if encoding is not None:
        raise DriverError(Problem(code="program.encoding", where=printable(options.file), value=encoding))
    # Invalid UTF-8 stays a character that the controller rejects; in a comment it does no harm.
    text = content.decode("utf-8-sig", "replace")
    try:
        return check_program(text, machine, options.ta_ms, options.ts_ms, options.start)
    except PmacError as error:
        problem = Problem(code="program.refused", where=printable(options.file), value=str(error))
        raise DriverError(problem) from error


def _wide_encoding(content: bytes) -> str | None:
    """Return the name of a multi-byte encoding of the program text; None for all others."""
    for encoding, mark in _MARKS_OF_ENCODINGS:
        if content.startswith(mark):
            return encoding
    # A program has no NUL; ASCII text in such an encoding has one in every second byte.
    empty, other = sorted((content[place::2].count(0) for place in (0, 1)), reverse=True)
    return "UTF-16" if empty > len(content) // 4 and not other else None
