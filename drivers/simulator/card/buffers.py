"""Program buffers: opening, filling, listing and deleting motion programs and PLCs."""

from __future__ import annotations

from contextlib import suppress

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.expressions import HIGHEST_PROGRAM, TRAILING_CLOSE
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.plc_statements import parse_plc_line, stored_lines
from drivers.simulator.card.controller import Controller
from drivers.simulator.card.program_buffer import OpenBuffer, PlcBuffer, ProgramBuffer
from drivers.simulator.context import Context

MAX_LINES = 20_000
"""Room for one program; a real controller has some tens of thousands of words for all."""

ROOM_LINES = 100_000
"""Room for all of them."""

_CHARACTERS_A_VALUE = 2
"""Lines stored in the time that a variable is read."""

PROTECTED_PROGRAMS = range(1000, HIGHEST_PROGRAM + 1)
PROTECTED_PLCS = range(16)
"""Programs that a password protects from opening and listing (Software Reference, PASSWORD)."""


def open_program(context: Context, number: int) -> None:
    """OPEN PROG n.

    Raises:
        PmacError: 001 while a program runs, 002 protected, 007 a buffer is open already.
    """
    controller = context.controller
    _refuse_open(controller)
    if controller.any_program_running:
        raise PmacError(ErrorCode.NOT_WHILE_RUNNING, "OPEN")
    refuse_protected(controller, number, PROTECTED_PROGRAMS)
    controller.programs.setdefault(number, ProgramBuffer())
    controller.open_buffer = OpenBuffer(program=number, owner=context)
    for system in controller.systems.values():
        # After any OPEN the pointers are lost: every system must be pointed at its program again.
        system.program_number = None


def open_plc(context: Context, number: int) -> None:
    """OPEN PLC n: it is disabled, until it is enabled again after CLOSE.

    Raises:
        PmacError: 002 protected, 007 a buffer is open already.
    """
    controller = context.controller
    _refuse_open(controller)
    refuse_protected(controller, number, PROTECTED_PLCS)
    controller.plcs.open(number)
    controller.open_buffer = OpenBuffer(plc=number, owner=context)


def clear(controller: Controller) -> None:
    """CLEAR the open buffer.

    Raises:
        PmacError: 005, none is open.
    """
    _open_buffer(controller).lines.clear()


def close(controller: Controller) -> None:
    """CLOSE whatever buffer is open, whoever opened it; without one this is no error."""
    controller.open_buffer = None


def delete_program(controller: Controller, number: int) -> None:
    """DELETE PROG n.

    Raises:
        PmacError: 001 while a program runs, 002 protected, 007 the program is open.
    """
    if controller.any_program_running:
        raise PmacError(ErrorCode.NOT_WHILE_RUNNING, "DELETE")
    opened = controller.open_buffer
    if opened is not None and opened.plc is None and opened.program == number:
        raise PmacError(ErrorCode.BUFFER_IN_USE, f"program {number} is open")
    refuse_protected(controller, number, PROTECTED_PROGRAMS)
    controller.programs.pop(number, None)


def delete_plc(controller: Controller, number: int) -> None:
    """DELETE PLC n.

    Raises:
        PmacError: 002 protected, 007 the PLC is open.
    """
    opened = controller.open_buffer
    if opened is not None and opened.plc == number:
        raise PmacError(ErrorCode.BUFFER_IN_USE, f"PLC {number} is open")
    refuse_protected(controller, number, PROTECTED_PLCS)
    controller.plcs.delete(number)


def delete_all(controller: Controller) -> None:
    """DELETE ALL programs, PLCs, compensation tables and the gather buffer.

    Raises:
        PmacError: 001 while a program runs, 002 one is protected, 007 a buffer is open or data are gathered.
    """
    _refuse_open(controller)
    if controller.any_program_running:
        raise PmacError(ErrorCode.NOT_WHILE_RUNNING, "DELETE ALL")
    for number in controller.programs:
        refuse_protected(controller, number, PROTECTED_PROGRAMS)
    for number in controller.plcs.buffers:
        refuse_protected(controller, number, PROTECTED_PLCS)
    controller.gather.delete()
    controller.programs.clear()
    for number in tuple(controller.plcs.buffers):
        controller.plcs.delete(number)
    controller.tables.clear()


def store(scanner: Scanner, context: Context) -> None:
    """Put the rest of the line into the open buffer; a CLOSE at its end is executed.

    Raises:
        PmacError: 003 not a program line, 006 no room.
    """
    controller = context.controller
    buffer = _open_buffer(controller)
    begin = scanner.position
    scanner.reset(scanner.mark() + len(scanner.rest))
    rest = context.text[begin : scanner.position]
    context.work += len(rest) // _CHARACTERS_A_VALUE
    closing = TRAILING_CLOSE.search(rest)
    text = rest[: closing.start()] if closing else rest
    if isinstance(buffer, PlcBuffer):
        plc_lines = stored_lines(parse_plc_line(text))
        _refuse_full(controller, buffer, len(plc_lines))
        buffer.lines.extend(plc_lines)
    else:
        line = parse_line(text)
        _refuse_full(controller, buffer, 1)
        if line:
            buffer.lines.append(line)
    if closing:
        close(controller)


def room_lines(controller: Controller) -> int:
    """Return how many more lines can be stored.

    An entry of a compensation table takes as much room as a line, and so does a gathered long word.
    """
    return ROOM_LINES - stored_lines_in(controller) - controller.tables.entry_count - controller.gather.size


def stored_lines_in(controller: Controller) -> int:
    """Return the number of lines in all programs and PLCs."""
    stored: list[ProgramBuffer | PlcBuffer] = [*controller.programs.values(), *controller.plcs.buffers.values()]
    return sum(len(buffer.lines) for buffer in stored)


def refuse_protected(controller: Controller, number: int, protected: range) -> None:
    """Check that a program may be read.

    Raises:
        PmacError: 002, a password is set and was not given.
    """
    if number in protected and controller.password.locked:
        raise PmacError(ErrorCode.PASSWORD, f"program {number} is protected")


def is_program_text(text: str) -> bool:
    """Whether the text would be accepted in the open buffer of a program or of a PLC."""
    with suppress(PmacError):
        return bool(parse_line(text))
    with suppress(PmacError):
        return bool(parse_plc_line(text))
    return False


def _refuse_full(controller: Controller, buffer: ProgramBuffer | PlcBuffer, more: int) -> None:
    if len(buffer.lines) + more > MAX_LINES or room_lines(controller) < more:
        raise PmacError(ErrorCode.NO_ROOM, f"{MAX_LINES} lines")


def _open_buffer(controller: Controller) -> ProgramBuffer | PlcBuffer:
    opened = controller.open_buffer
    if opened is None:
        raise PmacError(ErrorCode.NO_BUFFER_OPEN, "no buffer is open")
    return controller.programs[opened.program] if opened.plc is None else controller.plcs.buffers[opened.plc]


def _refuse_open(controller: Controller) -> None:
    opened = controller.open_buffer
    if opened is not None:
        name = f"program {opened.program}" if opened.plc is None else f"PLC {opened.plc}"
        raise PmacError(ErrorCode.BUFFER_IN_USE, f"{name} is open")
