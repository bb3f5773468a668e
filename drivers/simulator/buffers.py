"""Program buffers: opening, filling, listing and deleting motion programs."""

from __future__ import annotations

import re

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.text import format_line
from drivers.simulator.context import Context
from drivers.simulator.controller import OpenBuffer, ProgramBuffer

HIGHEST_PROGRAM = 32_767
MAX_LINES = 20_000
"""Room for one program; a real card has some tens of thousands of words for all."""

_TRAILING_CLOSE = re.compile(r"C\s*L\s*O\s*S\s*E\s*$", re.IGNORECASE)


def open_program(scanner: Scanner, context: Context) -> None:
    """OPEN PROG n.

    Raises:
        PmacError: 001 while a program runs, 003 a bad number, 007 a buffer is open already.
    """
    controller = context.controller
    number = _program_number(scanner)
    if controller.open_buffer is not None:
        raise PmacError(ErrorCode.BUFFER_IN_USE, f"program {controller.open_buffer.program} is open")
    if controller.any_program_running:
        raise PmacError(ErrorCode.NOT_WHILE_RUNNING, "OPEN")
    controller.programs.setdefault(number, ProgramBuffer())
    controller.open_buffer = OpenBuffer(program=number, owner=context)
    for system in controller.systems.values():
        # After any OPEN the pointers are lost: every system must be pointed at its program again.
        system.program_number = None


def clear_program(_: Scanner, context: Context) -> None:
    """CLEAR the open buffer.

    Raises:
        PmacError: 005, none is open.
    """
    _open_buffer(context).lines.clear()


def close_program(_: Scanner, context: Context) -> None:
    """CLOSE whatever buffer is open, whoever opened it; nothing to close is no error."""
    context.controller.open_buffer = None


def list_program(scanner: Scanner, context: Context) -> None:
    """LIST PROG n.

    Raises:
        PmacError: 003, there is no such program.
    """
    number = _program_number(scanner)
    buffer = context.controller.programs.get(number)
    if buffer is None:
        raise PmacError(ErrorCode.DATA_ERROR, f"program {number} does not exist")
    context.lines.extend(format_line(line) for line in buffer.lines)


def delete(scanner: Scanner, context: Context) -> None:
    """DELETE PROG n, or DELETE GATHER, which has nothing to delete here.

    Raises:
        PmacError: 001 while a program runs, 003 unknown, 007 the program is open.
    """
    if scanner.take_word(("GATHER", "GAT")) is not None:
        return
    scanner.expect("PROG")
    number = _program_number(scanner)
    controller = context.controller
    if controller.any_program_running:
        raise PmacError(ErrorCode.NOT_WHILE_RUNNING, "DELETE")
    if controller.open_buffer is not None and controller.open_buffer.program == number:
        raise PmacError(ErrorCode.BUFFER_IN_USE, f"program {number} is open")
    controller.programs.pop(number, None)


def store(scanner: Scanner, text: str, context: Context) -> None:
    """Put the rest of the line into the open buffer; a CLOSE at its end is carried out.

    Raises:
        PmacError: 003 not a program line, 006 no room.
    """
    buffer = _open_buffer(context)
    rest = text[scanner.position :].partition(";")[0]
    closing = _TRAILING_CLOSE.search(rest)
    line = parse_line(rest[: closing.start()] if closing else rest)
    if len(buffer.lines) >= MAX_LINES:
        raise PmacError(ErrorCode.NO_ROOM, f"{MAX_LINES} lines")
    if line:
        buffer.lines.append(line)
    if closing:
        close_program(scanner, context)
    scanner.reset(scanner.mark() + len(scanner.rest))


def is_program_text(text: str) -> bool:
    """Whether the text would be accepted in an open buffer."""
    try:
        return bool(parse_line(text))
    except PmacError:
        return False


def _open_buffer(context: Context) -> ProgramBuffer:
    opened = context.controller.open_buffer
    if opened is None:
        raise PmacError(ErrorCode.NO_BUFFER_OPEN, "no buffer is open")
    return context.controller.programs[opened.program]


def _program_number(scanner: Scanner) -> int:
    number = scanner.take_integer()
    if number is None or not 1 <= number <= HIGHEST_PROGRAM:
        raise PmacError(ErrorCode.DATA_ERROR, f"a program number, 1 to {HIGHEST_PROGRAM}")
    return number
