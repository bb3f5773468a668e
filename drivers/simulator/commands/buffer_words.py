"""Program buffer commands: OPEN, CLEAR, CLOSE, LIST, DELETE, SIZE, ENABLE PLC and DISABLE PLC."""

from __future__ import annotations

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.expressions import (
    CLEAR,
    CLOSE,
    HIGHEST_PLC,
    HIGHEST_PROGRAM,
    OPEN_PLC,
    OPEN_PROGRAM,
    PROGRAM,
)
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.parser import MESSAGE_READERS
from drivers.pmac.language.syntax import PlcSwitch
from drivers.pmac.language.text import format_line, format_plc_line
from drivers.simulator.card import buffers
from drivers.simulator.commands.handler import LINE_WORK, Handler, say
from drivers.simulator.context import Context

_NOT_HERE = ("TRACE", "ROTARY", "ROT", "TCOMP", "BLCOMP", "TBUF", "UBUFFER", "LOOKAHEAD")
"""Buffers that nothing here can define: there is never anything to delete."""


def _open_program(scanner: Scanner, context: Context) -> None:
    buffers.open_program(context, _program_number(scanner))


def _open_plc(scanner: Scanner, context: Context) -> None:
    buffers.open_plc(context, _plc_number(scanner))


def _clear(_: Scanner, context: Context) -> None:
    buffers.clear(context.controller)


def _close(scanner: Scanner, context: Context) -> None:
    scanner.accept("ALL")
    buffers.close(context.controller)


def _list_program(scanner: Scanner, context: Context) -> None:
    """`LIST PROG 1`, `LIST PROG 1,10` from line 10, `LIST PROG 1,10,5` five lines."""
    number = _program_number(scanner)
    controller = context.controller
    buffers.refuse_protected(controller, number, buffers.PROTECTED_PROGRAMS)
    buffer = controller.programs.get(number)
    if buffer is None:
        raise PmacError(ErrorCode.DATA_ERROR, f"program {number} does not exist")
    first = (scanner.take_integer() or 0) if scanner.accept(",") else 0
    count = scanner.take_integer() if scanner.accept(",") else None
    lines = buffer.lines[first : None if count is None else first + count]
    context.work += len(lines) * LINE_WORK
    context.lines.extend(map(format_line, lines))


def _list_plc(scanner: Scanner, context: Context) -> None:
    number = _plc_number(scanner)
    controller = context.controller
    buffers.refuse_protected(controller, number, buffers.PROTECTED_PLCS)
    buffer = controller.plcs.buffers.get(number)
    if buffer is None:
        raise PmacError(ErrorCode.DATA_ERROR, f"PLC {number} does not exist")
    context.work += len(buffer.lines) * LINE_WORK
    context.lines.extend(map(format_plc_line, buffer.lines))


def _delete(scanner: Scanner, context: Context) -> None:
    controller = context.controller
    if scanner.take_word(_NOT_HERE) is not None:
        return
    if scanner.accept("ALL"):
        buffers.delete_all(controller)
    elif scanner.take_word(PROGRAM) is not None:
        buffers.delete_program(controller, _program_number(scanner))
    else:
        scanner.expect("PLC")
        buffers.delete_plc(controller, _plc_number(scanner))


def _abbreviated(target: str) -> Handler:
    """`DEL GAT`: DEL alone is not a word, so that DELAY does not match."""

    def command(scanner: Scanner, context: Context) -> None:
        scanner.reset(scanner.mark() - len(target))
        _delete(scanner, context)

    return command


def _switch_plc(word: str) -> Handler:
    def command(scanner: Scanner, context: Context) -> None:
        switch = MESSAGE_READERS[word](scanner, word)
        assert isinstance(switch, PlcSwitch)
        context.controller.switch_plc(switch.enable, switch.numbers)

    return command


def _plc_text(scanner: Scanner, context: Context) -> None:
    """Prevent a PLC that is typed after a refused OPEN from aborting with `AND(`, or stepping with `SEND`."""
    raise PmacError(ErrorCode.NO_BUFFER_OPEN, context.text[:20])


def _size(context: Context) -> str:
    """Below 0 while a buffer is open."""
    room = buffers.room_lines(context.controller)
    return str(room if context.controller.open_buffer is None else -room)


def _program_number(scanner: Scanner) -> int:
    number = scanner.take_integer()
    if number is None or not 1 <= number <= HIGHEST_PROGRAM:
        raise PmacError(ErrorCode.DATA_ERROR, f"a program number, 1 to {HIGHEST_PROGRAM}")
    return number


def _plc_number(scanner: Scanner) -> int:
    number = scanner.take_integer()
    if number is None or number > HIGHEST_PLC:
        raise PmacError(ErrorCode.DATA_ERROR, f"a PLC number, 0 to {HIGHEST_PLC}")
    return number


WORDS: dict[str, Handler] = {
    **dict.fromkeys(OPEN_PROGRAM, _open_program),
    **dict.fromkeys(OPEN_PLC, _open_plc),
    **dict.fromkeys(CLEAR, _clear),
    **dict.fromkeys(CLOSE, _close),
    **{f"LIST{word}": _list_program for word in PROGRAM},
    "LISTPLC": _list_plc,
    "DELETE": _delete,
    **{f"DEL{target}": _abbreviated(target) for target in (*_NOT_HERE, "ALL", *PROGRAM, "PLC")},
    "SIZE": say(_size),
}

SHARED_WORDS: dict[str, Handler] = {
    **{word: _switch_plc(word) for word in ("ENABLEPLC", "ENAPLC", "DISABLEPLC", "DISPLC")},
    **dict.fromkeys(("AND(", "OR(", "ADDRESS", "ADR", "SEND"), _plc_text),
}
"""Programs have them too."""
