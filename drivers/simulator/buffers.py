"""Program buffers: opening, filling, listing and deleting motion programs and PLCs."""

from __future__ import annotations

import re
from collections.abc import Sequence

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.syntax import (
    AxisWord,
    Feedrate,
    Home,
    Line,
    Move,
    Normal,
    Positioning,
    Preset,
    SelectMode,
    Set,
    Wait,
)
from drivers.pmac.language.text import format_line
from drivers.simulator.context import Context
from drivers.simulator.controller import Controller
from drivers.simulator.program_buffer import OpenBuffer, ProgramBuffer

HIGHEST_PROGRAM = 32_767
HIGHEST_PLC = 31
MAX_LINES = 20_000
"""Room for one program; a real card has some tens of thousands of words for all."""

ROOM_LINES = 100_000
"""Room for all of them."""

PROTECTED_PROGRAMS = range(1000, HIGHEST_PROGRAM + 1)
PROTECTED_PLCS = range(16)
"""What a password keeps from being opened and listed (Software Reference, PASSWORD)."""

_MOTION = (AxisWord, Feedrate, Home, Move, Normal, Positioning, Preset, SelectMode, Set, Wait)
"""Statements that no PLC can have."""

_TRAILING_CLOSE = re.compile(r"C\s*L\s*O\s*S\s*E\s*$", re.IGNORECASE)


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
    """OPEN PLC n: it is switched off.

    Raises:
        PmacError: 002 protected, 007 a buffer is open already.
    """
    controller = context.controller
    _refuse_open(controller)
    refuse_protected(controller, number, PROTECTED_PLCS)
    controller.plcs.setdefault(number, ProgramBuffer())
    controller.plc_enabled.discard(number)
    controller.open_buffer = OpenBuffer(plc=number, owner=context)


def clear(controller: Controller) -> None:
    """CLEAR the open buffer.

    Raises:
        PmacError: 005, none is open.
    """
    _open_buffer(controller).lines.clear()


def close(controller: Controller) -> None:
    """CLOSE whatever buffer is open, whoever opened it; nothing to close is no error."""
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
    controller.plcs.pop(number, None)
    controller.plc_enabled.discard(number)


def delete_all(controller: Controller) -> None:
    """DELETE ALL programs and PLCs.

    Raises:
        PmacError: 001 while a program runs, 002 one is protected, 007 a buffer is open.
    """
    _refuse_open(controller)
    if controller.any_program_running:
        raise PmacError(ErrorCode.NOT_WHILE_RUNNING, "DELETE ALL")
    for number in controller.programs:
        refuse_protected(controller, number, PROTECTED_PROGRAMS)
    for number in controller.plcs:
        refuse_protected(controller, number, PROTECTED_PLCS)
    controller.programs.clear()
    controller.plcs.clear()
    controller.plc_enabled.clear()


def store(scanner: Scanner, context: Context) -> None:
    """Put the rest of the line into the open buffer; a CLOSE at its end is carried out.

    Raises:
        PmacError: 003 not a program line, 006 no room.
    """
    controller = context.controller
    buffer = _open_buffer(controller)
    begin = scanner.position
    scanner.reset(scanner.mark() + len(scanner.rest))
    rest = context.text[begin : scanner.position]
    closing = _TRAILING_CLOSE.search(rest)
    line = parse_line(rest[: closing.start()] if closing else rest)
    opened = controller.open_buffer
    if opened is not None and opened.plc is not None and any(isinstance(statement, _MOTION) for statement in line):
        raise PmacError(ErrorCode.DATA_ERROR, f"motion in a PLC: {rest[:20]}")
    if len(buffer.lines) >= MAX_LINES or room_lines(controller) <= 0:
        raise PmacError(ErrorCode.NO_ROOM, f"{MAX_LINES} lines")
    if line:
        buffer.lines.append(line)
    if closing:
        close(controller)


def listing(lines: Sequence[Line], first: int, count: int | None) -> list[str]:
    """Return the text of `count` lines (all, if None) from line `first`, which is counted from 0."""
    end = None if count is None else first + count
    return [format_line(line) for line in lines[first:end]]


def room_lines(controller: Controller) -> int:
    """Return how many lines more can be stored."""
    stored = (*controller.programs.values(), *controller.plcs.values())
    return ROOM_LINES - sum(len(buffer.lines) for buffer in stored)


def refuse_protected(controller: Controller, number: int, protected: range) -> None:
    """Make sure that a program may be seen.

    Raises:
        PmacError: 002, a password is set and was not given.
    """
    if number in protected and controller.password.locked:
        raise PmacError(ErrorCode.PASSWORD, f"program {number} is protected")


def is_program_text(text: str) -> bool:
    """Whether the text would be accepted in an open buffer."""
    try:
        return bool(parse_line(text))
    except PmacError:
        return False


def _open_buffer(controller: Controller) -> ProgramBuffer:
    opened = controller.open_buffer
    if opened is None:
        raise PmacError(ErrorCode.NO_BUFFER_OPEN, "no buffer is open")
    return controller.programs[opened.program] if opened.plc is None else controller.plcs[opened.plc]


def _refuse_open(controller: Controller) -> None:
    opened = controller.open_buffer
    if opened is not None:
        name = f"program {opened.program}" if opened.plc is None else f"PLC {opened.plc}"
        raise PmacError(ErrorCode.BUFFER_IN_USE, f"{name} is open")
