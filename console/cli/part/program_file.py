"""A file of programs of one's own: read with all that it includes, and checked; nothing is sent."""

from __future__ import annotations

import codecs
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from drivers.errors import DriverError
from drivers.pmac.analysis.program import ProgramCheck, check_program
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.program_text import ProgramText, RefusedLine, read_program
from drivers.simulator.commands.line import read_line
from profiles.files import printable, read_regular_file
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError

CAP_BYTES = 5_000_000
"""The whole of a full controller, with comments; each move costs a kilobyte while it is checked."""

_WIDE_ENCODINGS = {
    codecs.BOM_UTF32_LE: "UTF-32",  # starts with the UTF-16 mark
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}


def checked_file(
    path: Path,
    machine: MachineProfile,
    ta_ms: float | None = None,
    ts_ms: float | None = None,
    start: Mapping[str, float] | None = None,
) -> ProgramCheck:
    """Read a file and check it.

    Raises:
        ProblemError: `file.unreadable`, `file.too_large`; `program.encoding`; `program.refused`, there is nothing
            to check; `program.start_axis`, `program.start_too_far`.
    """
    program, where = _text(path), printable(str(path))
    on_line = partial(read_line, dialect=DIALECTS[machine.controller.family])
    try:
        return check_program(
            program, machine, ta_ms, ts_ms, start, partial(_read_included_file, path.parent), on_line
        )
    except PmacError as error:
        raise DriverError(Problem(code="program.refused", where=where, value=str(error))) from error


def read_file(path: Path, machine: MachineProfile) -> tuple[ProgramText, tuple[RefusedLine, ...]]:
    """Read a file that may have PLCs or kinematic programs alone; return it with the lines that are refused.

    Raises ProblemError: `file.unreadable`, `file.too_large`, `program.encoding`.
    """
    dialect, refused = DIALECTS[machine.controller.family], list[RefusedLine]()
    read = read_program(
        _text(path),
        refused,
        dialect.motor_count,
        partial(_read_included_file, path.parent),
        kinematic=dialect.kinematics is not None,
        on_line=partial(read_line, dialect=dialect),
        needs_program=False,
    )
    return read, tuple(refused)


def _text(path: Path) -> str:
    content = read_regular_file(path, cap_bytes=CAP_BYTES)
    if encoding := _wide_encoding(content):
        raise DriverError(Problem(code="program.encoding", where=printable(str(path)), value=encoding))
    # Invalid UTF-8 stays a character that the controller rejects; in a comment it does no harm.
    return content.decode("utf-8-sig", "replace")


def _read_included_file(folder: Path, name: str) -> str:
    """Return the text of a file that a program includes, from the folder of the program.

    Raises PmacError: 003, it cannot be read.
    """
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
