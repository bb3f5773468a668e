"""Program buffers: opening, filling, listing and deleting motion programs and PLCs."""

from __future__ import annotations

from contextlib import suppress

from drivers.pmac.execution.kinematics import stored_kinematic_line
from drivers.pmac.families.family import BufferDirectory
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.expressions import HIGHEST_PROGRAM, TRAILING_CLOSE
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.listing import StoredLine, StoredPlcLine, addresses, stored_line, stored_plc_lines
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.plc_statements import parse_plc_line
from drivers.simulator.card.controller import SimulatedController
from drivers.simulator.card.table_memory import OpenBuffer
from drivers.simulator.context import Context, FillTarget, LineContext, Step

MAX_LINES = 20_000  # room for one program; a real controller has some tens of thousands of words for all
ROOM_LINES = 100_000  # room for all of them
_CHARACTERS_A_VALUE = 2  # lines stored in the time that a variable is read
_PLC_OFF = 1 << 22  # the bit of a PLC that is off, in memory
PROTECTED_PROGRAMS = range(1000, HIGHEST_PROGRAM + 1)
PROTECTED_PLCS = range(16)
"""Programs that a password protects from opening and listing (Software Reference, PASSWORD)."""


def open_program(context: Context, number: int) -> None:
    """OPEN PROG n. Raises PmacError: 001 while a program runs, 002 protected, 007 a buffer is open already."""
    controller = context.controller
    _refuse_open(controller)
    _refuse_running(controller, "OPEN")
    refuse_protected(controller, number, PROTECTED_PROGRAMS)
    controller.programs.setdefault(number, [])
    controller.open_buffer = OpenBuffer(program=number, owner=context)
    for system in controller.systems.values():
        # After any OPEN the pointers are lost: every system must be pointed at its program again.
        system.program_number = None


def open_plc(context: Context, number: int) -> None:
    """OPEN PLC n: disable it, until it is enabled again. Raises PmacError: 002 protected, 007 a buffer is open."""
    controller = context.controller
    _refuse_open(controller)
    refuse_protected(controller, number, PROTECTED_PLCS)
    controller.plcs.open(number)
    controller.open_buffer = OpenBuffer(plc=number, owner=context)


def open_kinematic(context: Context, kind: str) -> None:
    """OPEN INVERSE or FORWARD of the addressed system. Raises PmacError: as `open_program`."""
    controller = context.controller
    _refuse_open(controller)
    _refuse_running(controller, "OPEN")
    refuse_locked(controller)
    context.system.kinematic_lines.setdefault(kind, [])
    controller.open_buffer = OpenBuffer(kinematic=(context.system_number, kind), owner=context)


def delete_kinematic(context: Context, kind: str) -> None:
    """DELETE INVERSE or FORWARD. Raises PmacError: 001 while a program runs, 002 protected, 007 it is open."""
    controller = context.controller
    _refuse_running(controller, "DELETE")
    opened = controller.open_buffer
    if opened is not None and opened.kinematic == (context.system_number, kind):
        raise PmacError(ErrorCode.BUFFER_IN_USE, f"{opened} is open")
    refuse_locked(controller)
    context.system.kinematic_lines.pop(kind, None)


def clear(controller: SimulatedController) -> None:
    """CLEAR the open buffer. Raises PmacError: 005, none is open."""
    opened = _require_open_buffer(controller)
    if opened.program is not None:
        controller.programs[opened.program].clear()
    elif opened.plc is not None:
        controller.plcs.buffers[opened.plc].clear()
    elif opened.kinematic is not None:
        _kinematic_lines(controller, opened.kinematic).clear()


def close(controller: SimulatedController) -> None:
    """CLOSE the open buffer, whichever host opened it; without one this is no error."""
    controller.open_buffer = None


def delete_program(controller: SimulatedController, number: int) -> None:
    """DELETE PROG n. Raises PmacError: 001 while a program runs, 002 protected, 007 the program is open."""
    _refuse_running(controller, "DELETE")
    opened = controller.open_buffer
    if opened is not None and opened.program == number:
        raise PmacError(ErrorCode.BUFFER_IN_USE, f"{opened} is open")
    refuse_protected(controller, number, PROTECTED_PROGRAMS)
    controller.programs.pop(number, None)


def delete_plc(controller: SimulatedController, number: int) -> None:
    """DELETE PLC n. Raises PmacError: 002 protected, 007 the PLC is open."""
    opened = controller.open_buffer
    if opened is not None and opened.plc == number:
        raise PmacError(ErrorCode.BUFFER_IN_USE, f"{opened} is open")
    refuse_protected(controller, number, PROTECTED_PLCS)
    controller.plcs.delete(number)


def delete_all(controller: SimulatedController) -> None:
    """DELETE ALL programs, PLCs, compensation tables and the gather buffer.

    Raises PmacError: 001 while a program runs, 002 one is protected, 007 a buffer is open or data are gathered.
    """
    _refuse_open(controller)
    _refuse_running(controller, "DELETE ALL")
    for number in controller.programs:
        refuse_protected(controller, number, PROTECTED_PROGRAMS)
    for number in controller.plcs.buffers:
        refuse_protected(controller, number, PROTECTED_PLCS)
    controller.gather.delete()
    controller.programs.clear()
    for system in controller.systems.values():
        system.kinematic_lines.clear()
    for number in tuple(controller.plcs.buffers):
        controller.plcs.delete(number)
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
    plc_lines: tuple[StoredPlcLine, ...] = ()
    line: StoredLine | None = None
    if reading.filling is FillTarget.PLC:
        plc_lines = stored_plc_lines(text)
    elif reading.filling is FillTarget.KINEMATIC:
        line = None if text.strip().upper() in ("RETURN", "RET") else stored_kinematic_line(text)
    else:
        line = stored_line(text)

    def step(context: Context) -> None:
        context.work += len(rest) // _CHARACTERS_A_VALUE
        _store(context.controller, line, plc_lines)
        if closing:
            close(context.controller)

    return step


def _store(controller: SimulatedController, line: StoredLine | None, plc_lines: tuple[StoredPlcLine, ...]) -> None:
    opened = _require_open_buffer(controller)
    if opened.program is not None:
        lines = controller.programs[opened.program]
        _refuse_full(controller, len(lines), 1)
        lines += [line] if line is not None and line.statements else []
    elif opened.kinematic is not None:
        lines = _kinematic_lines(controller, opened.kinematic)
        _refuse_full(controller, len(lines), 1)
        lines += [line] if line is not None and line.statements else []
    elif opened.plc is not None:
        stored = controller.plcs.buffers[opened.plc]
        _refuse_full(controller, len(stored), len(plc_lines))
        stored += plc_lines


def room_lines(controller: SimulatedController) -> int:
    """Return how many more lines can be stored; table entries and gathered long words take room like them."""
    return ROOM_LINES - stored_lines_in(controller) - controller.tables.entry_count - controller.gather.size


def stored_lines_in(controller: SimulatedController) -> int:
    """Return the number of lines in all programs and PLCs."""
    programs, plcs = controller.programs.values(), controller.plcs.buffers.values()
    kinematic = (lines for system in controller.systems.values() for lines in system.kinematic_lines.values())
    return sum(map(len, programs)) + sum(map(len, plcs)) + sum(map(len, kinematic))


def refuse_locked(controller: SimulatedController) -> None:
    """Check that kinematic programs may be read. Raises PmacError: 002, a password is set and was not given."""
    if controller.password.locked:
        raise PmacError(ErrorCode.PASSWORD, "kinematic programs are protected")


def refuse_protected(controller: SimulatedController, number: int, protected: range) -> None:
    """Check that a program may be read. Raises PmacError: 002, a password is set and was not given."""
    if number in protected and controller.password.locked:
        raise PmacError(ErrorCode.PASSWORD, f"program {number} is protected")


def is_program_text(text: str) -> bool:
    """Whether the text would be accepted in the open buffer of a program or of a PLC."""
    with suppress(PmacError):
        return bool(parse_line(text))
    with suppress(PmacError):
        return bool(parse_plc_line(text))
    return False


def _kinematic_lines(controller: SimulatedController, which: tuple[int, str]) -> list[StoredLine]:
    system, kind = which
    return controller.systems[system].kinematic_lines.setdefault(kind, [])


def _refuse_full(controller: SimulatedController, stored: int, more: int) -> None:
    if stored + more > MAX_LINES or room_lines(controller) < more:
        raise PmacError(ErrorCode.NO_ROOM, f"{MAX_LINES} lines")


def _refuse_running(controller: SimulatedController, command: str) -> None:
    if controller.any_program_running:
        raise PmacError(ErrorCode.NOT_WHILE_RUNNING, command)


def _refuse_open(controller: SimulatedController) -> None:
    if controller.open_buffer is not None:
        raise PmacError(ErrorCode.BUFFER_IN_USE, f"{controller.open_buffer} is open")


def _require_open_buffer(controller: SimulatedController) -> OpenBuffer:
    if controller.open_buffer is None:
        raise PmacError(ErrorCode.NO_BUFFER_OPEN, "no buffer is open")
    return controller.open_buffer


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
