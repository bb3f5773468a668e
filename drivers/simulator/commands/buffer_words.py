"""Buffer commands: OPEN, CLEAR, CLOSE, LIST, DELETE, SIZE and DEFINE; of programs, tables and gathered data.

Entries of a compensation table are the constants that its host sends after DEFINE COMP.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.pmac.buffer_text import BufferKind
from drivers.pmac.compensation.table_text import definition_text, entry_lines, scan_definition, scan_entries
from drivers.pmac.execution.kinematics import KINDS
from drivers.pmac.gathering.gather import listing
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.expressions import (
    CLEAR,
    CLOSE,
    HIGHEST_PLC,
    HIGHEST_PROGRAM,
    PROGRAM,
    parse_number,
)
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.listing import KeptText, addresses, with_end
from drivers.pmac.language.parser import MESSAGE_READERS
from drivers.pmac.language.syntax import PlcSwitch
from drivers.pmac.memory import Pointer
from drivers.simulator.card import buffers
from drivers.simulator.context import Context, Handler, LineContext, Step, act, say

_LOOKAHEAD, _USER_BUFFER = ("LOOKAHEAD", "LOOK"), ("UBUFFER", "UBUF")
_NOT_HERE = ("TRACE", "ROTARY", "ROT", "TCOMP", "BLCOMP", "TBUF", *_LOOKAHEAD)  # never defined
_PLC_SWITCHES = ("ENABLEPLC", "ENAPLC", "DISABLEPLC", "DISPLC", "PAUSEPLC", "PAUPLC", "RESUMEPLC", "RESPLC")
_GATHER = ("GATHER", "GAT")
_KINDS = {
    **dict.fromkeys(PROGRAM, BufferKind.PROGRAM),
    "PLC": BufferKind.PLC,
    **{word: BufferKind(kind) for word, kind in KINDS.items()},
}
_NUMBERS = {BufferKind.PROGRAM: (1, HIGHEST_PROGRAM), BufferKind.PLC: (0, HIGHEST_PLC)}
_CONSTANT = re.compile(r"[+-]?[\d.]")  # first characters of a line of entries; `$` is a command


def _take_number(scanner: Scanner, reading: LineContext, kind: BufferKind) -> Callable[[Context], int]:
    """Consume the number of a program or PLC; a kinematic program has that of the addressed system."""
    if kind.of_system:
        if reading.dialect.kinematics is None:
            raise PmacError(ErrorCode.DATA_ERROR, "this family has no kinematic programs")
        return lambda context: context.system_number
    number = parse_number(scanner, *_NUMBERS[kind])
    return lambda context: number


def _open(kind: BufferKind) -> Handler:
    def command(scanner: Scanner, reading: LineContext) -> Step:
        number = _take_number(scanner, reading, kind)
        reading.filling = kind  # of the text after it on its line; a refusal ends the line
        return lambda context: buffers.open_buffer(context, kind, number(context))

    return command


def _close(scanner: Scanner, reading: LineContext) -> Step:
    scanner.accept("ALL")
    reading.filling = None
    return lambda context: buffers.close(context.controller)


@dataclass(frozen=True, slots=True)
class WordRange:
    """`,10` from word 10 of the buffer, `,10,5` what begins in five words, `,,5` in the first five.

    `addressed` when there is either.
    """

    first: int = 0
    count: int | None = None
    addressed: bool = False

    def of(self, lines: Sequence[KeptText], context: Context) -> list[str]:
        """Return the lines of it, with their addresses. Raises PmacError: 003, it is behind the end."""
        whole, in_full = with_end(lines), context.in_full
        if not self.addressed:
            return [line.list_line(in_full=in_full) for line in whole]
        *starts, end = addresses(whole)
        if self.first >= end:
            raise PmacError(ErrorCode.DATA_ERROR, f"{end} words")
        last = end if self.count is None else self.first + self.count
        part = range(bisect_left(starts, self.first), bisect_left(starts, last))
        return [f"{starts[place]}:{whole[place].list_line(in_full=in_full)}" for place in part]


def _take_range(scanner: Scanner) -> WordRange:
    """Consume the part of a listing that is asked for; without one, all of it."""
    if not scanner.accept(","):
        return WordRange()
    first = scanner.take_integer() or 0
    return WordRange(first, scanner.take_integer() if scanner.accept(",") else None, addressed=True)


def _list(kind: BufferKind) -> Handler:
    """`LIST PROG 1`, `LIST PROG 1,10` from word 10, `LIST PROG 1,10,5` what begins in five words."""

    def command(scanner: Scanner, reading: LineContext) -> Step:
        number, part = _take_number(scanner, reading, kind), _take_range(scanner)

        def step(context: Context) -> None:
            lines = buffers.lines_of(context.controller, kind, number(context))
            context.list_lines(part.of(lines, context))

        return step

    return command


def _delete(kind: BufferKind) -> Handler:
    def command(scanner: Scanner, reading: LineContext) -> Step:
        number = _take_number(scanner, reading, kind)
        return lambda context: buffers.delete_buffer(context.controller, kind, number(context))

    return command


def _switch_plc(word: str) -> Handler:
    def command(scanner: Scanner, reading: LineContext) -> Step:
        switch = MESSAGE_READERS[word](scanner, word)
        assert isinstance(switch, PlcSwitch)
        return lambda context: context.controller.switch_plc(switch.enable, switch.numbers, switch.keeping)

    return command


def _plc_text(scanner: Scanner, reading: LineContext) -> Step:
    """Prevent a PLC that is typed without its OPEN from aborting with `AND(`, or stepping with `SEND`."""
    raise PmacError(ErrorCode.NO_BUFFER_OPEN, reading.text[:20])


def _size(context: Context) -> str:
    """Below 0 while a buffer is open."""
    room = buffers.room_lines(context.controller)
    return str(room if context.controller.open_buffer is None else -room)


def _refuse_open(context: Context) -> None:
    """An open buffer lies in the memory that a new one would take."""
    if context.controller.open_buffer is not None:
        raise PmacError(ErrorCode.BUFFER_IN_USE, "a buffer is open; CLOSE first")


def _define_gather(scanner: Scanner, reading: LineContext) -> Step:
    """`DEFINE GATHER 1000` long words; without a number all available memory, leaving none for programs."""
    wanted = scanner.take_integer()

    def step(context: Context) -> None:
        _refuse_open(context)
        gather = context.controller.gather
        room = buffers.room_lines(context.controller) + gather.size
        size = room if wanted is None else wanted
        if size > room or not room:
            raise PmacError(ErrorCode.NO_ROOM, f"{size} long words, room for {room}")
        gather.define(size)

    return step


def _define_lookahead(scanner: Scanner, reading: LineContext) -> Step:
    """DEFINE LOOKAHEAD 1000,100: accepted, and changes nothing: moves are calculated as without lookahead."""
    if scanner.take_integer() is None:
        raise scanner.refusal("a size as in DEFINE LOOKAHEAD 1000,100")
    if scanner.accept(","):
        scanner.take_integer()
    return _refuse_open


def _define_user_buffer(scanner: Scanner, reading: LineContext) -> Step:
    """DEFINE UBUFFER 256: the last words of the buffer storage, plain memory as before, reported by the family."""
    size = scanner.take_integer()
    if size is None:
        raise scanner.refusal("a size as in DEFINE UBUFFER 256")

    def step(context: Context) -> None:
        _refuse_open(context)
        _place_user_buffer(context, size)

    return step


def _place_user_buffer(context: Context, size: int) -> None:
    """Report where a user buffer of this size begins. Raises PmacError: 006, more words than there are."""
    place, variables = context.dialect.user_buffer, context.controller.variables
    if place is None:
        return
    end = place.ends[0]
    if size > end - place.start:
        raise PmacError(ErrorCode.NO_ROOM, f"{size} words, room for {end - place.start}")
    if place.setting is not None:
        variables.report(place.setting, float(end - size))
    if place.x_address is not None and variables.memory is not None:
        variables.memory.write(Pointer(space="X", address=place.x_address, width=24), float(end - size))


def _gather(scanner: Scanner, reading: LineContext) -> Step:
    if scanner.accept("TRIGGER"):
        raise PmacError(ErrorCode.DATA_ERROR, "GATHER TRIGGER: this card has no input that starts it; GATHER")
    return lambda context: context.controller.gather.start()


def _end_gather(context: Context) -> None:
    context.controller.gather.running = False


def _list_gather(scanner: Scanner, reading: LineContext) -> Step:
    """`LIST GATHER`, `LIST GATHER 100` from long word 100, `LIST GATHER 100,50` fifty of them."""
    first = scanner.take_integer() or 0
    count = scanner.take_integer() if scanner.accept(",") else None
    return lambda context: context.list_lines(listing(context.controller.gather.long_words(first, count)))


def fill_table(scanner: Scanner, reading: LineContext) -> Step | None:
    """Take a line of constants for the table that its host is filling; None when it is not such a line.

    Raises PmacError: 003, an invalid entry. More than the table expects is refused, and none of the line accepted.
    """
    if reading.fills or not _CONSTANT.match(scanner.rest):
        return None
    entries = scan_entries(scanner)

    def step(context: Context) -> None:
        context.work += len(entries)
        context.controller.tables.fill(entries)

    return step


def _define_table(scanner: Scanner, reading: LineContext) -> Step:
    text, motor_count = scanner.rest, reading.dialect.motor_count
    scan_definition(scanner, 1, motor_count)  # once without effect: the addressed motor is known when it acts

    def step(context: Context) -> None:
        _refuse_open(context)
        definition = scan_definition(Scanner(text), context.motor_number, motor_count)
        room = buffers.room_lines(context.controller)
        context.controller.tables.define(definition, context, _buffers_after(context), room)

    return step


def _delete_table(context: Context) -> None:
    context.controller.tables.delete(context.motor_number, _buffers_after(context))


def _list_table(context: Context) -> None:
    context.list_lines(entry_lines(context.controller.tables.entries(context.motor_number)))


def _table_definition(context: Context) -> str:
    return definition_text(context.controller.tables.definition(context.motor_number))


def _buffers_after(context: Context) -> tuple[str, ...]:
    """Return the buffers that lie after the tables in memory."""
    return ("GATHER",) if context.controller.gather.size else ()


def _delete_nothing(context: Context) -> None:
    """DELETE of a buffer that nothing here defines."""


_DELETED: dict[str, Handler] = {
    **dict.fromkeys(_NOT_HERE, act(_delete_nothing)),
    "ALL": act(lambda context: buffers.delete_all(context.controller)),
    **{word: _delete(kind) for word, kind in _KINDS.items()},
    **dict.fromkeys(_GATHER, act(lambda context: context.controller.gather.delete())),
    "COMP": act(_delete_table),
    **dict.fromkeys(_USER_BUFFER, act(lambda context: _place_user_buffer(context, 0))),
    # The temporary buffers; of those there is only the one to gather into.
    **dict.fromkeys(("TEMPS", "TEMPORARY"), act(lambda context: context.controller.gather.delete())),
}

WORDS: dict[str, Handler] = {
    **{f"OPEN{word}": _open(kind) for word, kind in _KINDS.items()},
    **dict.fromkeys(CLEAR, act(lambda context: buffers.clear(context.controller))),
    **dict.fromkeys(CLOSE, _close),
    **{f"LIST{word}": _list(kind) for word, kind in _KINDS.items()},
    **{f"{delete}{word}": handler for delete in ("DELETE", "DEL") for word, handler in _DELETED.items()},
    "SIZE": say(_size),
    **{f"{define}{word}": _define_gather for define in ("DEFINE", "DEF") for word in _GATHER},
    **dict.fromkeys(_GATHER, _gather),
    **dict.fromkeys(("ENDGATHER", "ENDG"), act(_end_gather)),
    **{f"LIST{word}": _list_gather for word in _GATHER},
    **{f"{define}{word}": _define_lookahead for define in ("DEFINE", "DEF") for word in _LOOKAHEAD},
    **{f"{define}{word}": _define_user_buffer for define in ("DEFINE", "DEF") for word in _USER_BUFFER},
    **dict.fromkeys(("DEFINECOMP", "DEFCOMP"), _define_table),
    "LISTCOMP": act(_list_table),
    "LISTCOMPDEF": say(_table_definition),
}

SHARED_WORDS: dict[str, Handler] = {
    **{word: _switch_plc(word) for word in _PLC_SWITCHES},
    **dict.fromkeys(("AND(", "OR(", "ADDRESS", "ADR", "SEND"), _plc_text),
}
"""Programs have them too."""
