"""Program buffers: opening, filling, listing and deleting motion programs, PLCs and kinematic programs."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from drivers.pmac.buffer_text import BufferKind
from drivers.pmac.execution.kinematics import stored_kinematic_line
from drivers.pmac.families.family import BufferDirectory
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.expressions import HIGHEST_PROGRAM, TRAILING_CLOSE
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.listing import KeptText, addresses, stored_line, stored_plc_lines
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.plc_statements import parse_plc_line
from drivers.simulator.card.controller import SimulatedController
from drivers.simulator.card.table_memory import OpenBuffer
from drivers.simulator.context import Context, LineContext, Step

MAX_LINES = 20_000  # room for one program; a real controller has some tens of thousands of words for all
ROOM_LINES = 100_000  # room for all of them
_CHARACTERS_A_VALUE = 2  # lines stored in the time that a variable is read
_PLC_OFF = 1 << 22  # the bit of a PLC that is off, in memory
_PROTECTED = {BufferKind.PROGRAM: range(1000, HIGHEST_PROGRAM + 1), BufferKind.PLC: range(16)}
"""What a password protects from opening and listing, beside kinematic programs (Software Reference, PASSWORD)."""


def open_buffer(context: Context, kind: BufferKind, number: int) -> None:
    """OPEN; a PLC is disabled until it is enabled again.

    Raises PmacError: 001 while a program runs, but for a PLC, 002 protected, 007 a buffer is open already.
    """
    controller = context.controller
    _refuse_open(controller)
    _refuse_running(controller, "OPEN", kind)
    _refuse_protected(controller, kind, number)
    if kind is BufferKind.PLC:
        controller.plcs.forget(number)
    held, key = _held(controller, kind, number)
    held.setdefault(key, [])
    controller.open_buffer = OpenBuffer(kind=kind, number=number, owner=context)
    if kind is BufferKind.PROGRAM:
        for system in controller.systems.values():
            # After any OPEN the pointers are lost: every system must be pointed at its program again.
            system.program_number = None


def clear(controller: SimulatedController) -> None:
    """CLEAR the open buffer. Raises PmacError: 005, none is open."""
    _open_lines(controller).clear()


def close(controller: SimulatedController) -> None:
    """CLOSE the open buffer, whichever host opened it; without one this is no error."""
    controller.open_buffer = None


def delete_buffer(controller: SimulatedController, kind: BufferKind, number: int) -> None:
    """DELETE. Raises PmacError: 001 while a program runs, but for a PLC, 002 protected, 007 it is open."""
    _refuse_running(controller, "DELETE", kind)
    opened = controller.open_buffer
    if opened is not None and (opened.kind, opened.number) == (kind, number):
        raise PmacError(ErrorCode.BUFFER_IN_USE, f"{opened} is open")
    _refuse_protected(controller, kind, number)
    if kind is BufferKind.PLC:
        controller.plcs.forget(number)
    held, key = _held(controller, kind, number)
    held.pop(key, None)


def lines_of(controller: SimulatedController, kind: BufferKind, number: int) -> Sequence[KeptText]:
    """Return the lines of a buffer. Raises PmacError: 002 protected, 003 there is none."""
    _refuse_protected(controller, kind, number)
    held, key = _held(controller, kind, number)
    if key not in held:
        raise PmacError(ErrorCode.DATA_ERROR, f"{kind.buffer_name(number)} does not exist")
    return held[key]


def delete_all(controller: SimulatedController) -> None:
    """DELETE ALL programs, PLCs, compensation tables and the gather buffer.

    Raises PmacError: 001 while a program runs, 002 one is protected, 007 a buffer is open or data are gathered.
    """
    _refuse_open(controller)
    _refuse_running(controller, "DELETE ALL")
    for kind in _PROTECTED:
        for number in _held(controller, kind, 0)[0]:
            _refuse_protected(controller, kind, number)
    controller.gather.delete()
    controller.programs.clear()
    for system in controller.systems.values():
        system.kinematic_lines.clear()
    for number in controller.plcs.buffers:
        controller.plcs.forget(number)
    controller.plcs.buffers.clear()
    controller.tables.replace(())


def read_stored(scanner: Scanner, reading: LineContext) -> Step:
    """Read the rest of the line as program text; a CLOSE at its end is executed.

    Raises PmacError: 003 no program; the step, 006 no room.
    """
    begin = scanner.position
    scanner.reset(scanner.mark() + len(scanner.rest))
    rest = reading.text[begin : scanner.position]
    closing = TRAILING_CLOSE.search(rest)
    text = rest[: closing.start()] if closing else rest
    lines = _read_lines(reading.filling, text)

    def step(context: Context) -> None:
        context.work += len(rest) // _CHARACTERS_A_VALUE
        stored = _open_lines(context.controller)
        _refuse_full(context.controller, len(stored), len(lines))
        stored += lines
        if closing:
            close(context.controller)

    return step


def _read_lines(kind: BufferKind | None, text: str) -> Sequence[KeptText]:
    if kind is BufferKind.PLC:
        return stored_plc_lines(text)
    if kind is BufferKind.PROGRAM:
        line = stored_line(text)
    elif text.strip().upper() in ("RETURN", "RET"):
        return ()
    else:
        line = stored_kinematic_line(text)
    return (line,) if line.statements else ()


def room_lines(controller: SimulatedController) -> int:
    """Return how many more lines can be stored; table entries and gathered long words take room like them."""
    return ROOM_LINES - stored_lines_in(controller) - controller.tables.entry_count - controller.gather.size


def stored_lines_in(controller: SimulatedController) -> int:
    """Return the number of lines in all programs and PLCs."""
    programs, plcs = controller.programs.values(), controller.plcs.buffers.values()
    kinematic = (lines for system in controller.systems.values() for lines in system.kinematic_lines.values())
    return sum(map(len, programs)) + sum(map(len, plcs)) + sum(map(len, kinematic))


def _refuse_protected(controller: SimulatedController, kind: BufferKind, number: int) -> None:
    """Check that a buffer may be read. Raises PmacError: 002, a password is set and was not given."""
    if controller.password.locked and (kind.of_system or number in _PROTECTED[kind]):
        raise PmacError(ErrorCode.PASSWORD, f"{kind.buffer_name(number)} is protected")


def is_program_text(text: str) -> bool:
    """Whether the text would be accepted in the open buffer of a program or of a PLC."""
    with suppress(PmacError):
        return bool(parse_line(text))
    with suppress(PmacError):
        return bool(parse_plc_line(text))
    return False


def _held(
    controller: SimulatedController, kind: BufferKind, number: int
) -> tuple[dict[Any, list[Any]], int | str]:
    """Return the buffers among which one is kept, each with lines of its kind, and its key there."""
    if kind is BufferKind.PROGRAM:
        return controller.programs, number
    if kind is BufferKind.PLC:
        return controller.plcs.buffers, number
    return controller.systems[number].kinematic_lines, str(kind)


def _open_lines(controller: SimulatedController) -> list[Any]:
    opened = controller.open_buffer
    if opened is None:
        raise PmacError(ErrorCode.NO_BUFFER_OPEN, "no buffer is open")
    held, key = _held(controller, opened.kind, opened.number)
    return held.setdefault(key, [])


def _refuse_full(controller: SimulatedController, stored: int, more: int) -> None:
    if stored + more > MAX_LINES or room_lines(controller) < more:
        raise PmacError(ErrorCode.NO_ROOM, f"{MAX_LINES} lines")


def _refuse_running(controller: SimulatedController, command: str, kind: BufferKind | None = None) -> None:
    if kind is not BufferKind.PLC and controller.any_program_running:
        raise PmacError(ErrorCode.NOT_WHILE_RUNNING, command)


def _refuse_open(controller: SimulatedController) -> None:
    if controller.open_buffer is not None:
        raise PmacError(ErrorCode.BUFFER_IN_USE, f"{controller.open_buffer} is open")


class StoredBuffers:
    """What memory shows of stored programs, as far as a family is known to show it.

    A program begins behind the words of those before it.
    """

    def __init__(self, controller: SimulatedController) -> None:
        self._controller = controller
        self._places = controller.dialect.buffer_directory

    def word(self, space: str, address: int) -> int | None:
        """Return a word of the directory; None outside it."""
        places = self._places
        if places is None:
            return None
        if address in places.programs:
            return self._program(space, address - places.programs.start, places)
        if address in places.plcs:
            return self._plc(space, address - places.plcs.start, places)
        return None

    def _program(self, space: str, entry: int, places: BufferDirectory) -> int:
        """X the number, Y where it begins; in the order in which they were opened."""
        programs = list(self._controller.programs.items())
        if entry >= len(programs):
            return 0
        if space == "X":
            return programs[entry][0]
        return places.storage + sum(addresses(lines)[-1] for _, lines in programs[:entry])

    def _plc(self, space: str, number: int, places: BufferDirectory) -> int:
        plcs = self._controller.plcs
        begins = places.storage + sum(addresses(lines)[-1] for lines in self._controller.programs.values())
        begins += sum(addresses(lines)[-1] for n, lines in plcs.buffers.items() if n < number)
        stored = number in plcs.buffers
        off = 0 if stored and number in plcs.switches.enabled else _PLC_OFF
        return (begins if stored else 0) | (off if space == "Y" else 0)
