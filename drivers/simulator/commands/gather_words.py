"""Data gathering commands: DEFINE, GATHER, ENDGATHER, LIST and DELETE."""

from __future__ import annotations

from drivers.pmac.gathering.gather import listing
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.simulator.card import buffers
from drivers.simulator.commands.handler import LINE_WORK, Handler
from drivers.simulator.context import Context

_GATHER = ("GATHER", "GAT")


def _define(scanner: Scanner, context: Context) -> None:
    """`DEFINE GATHER 1000` long words; without a number all available memory, leaving none for programs."""
    controller = context.controller
    if controller.open_buffer is not None:
        # The open buffer lies in the memory that this one would take.
        raise PmacError(ErrorCode.BUFFER_IN_USE, "a buffer is open; CLOSE first")
    room = buffers.room_lines(controller) + controller.gather.size
    size = scanner.take_integer()
    if size is None:
        size = room
    if size > room or not room:
        raise PmacError(ErrorCode.NO_ROOM, f"{size} long words, room for {room}")
    controller.gather.define(size)


def _gather(scanner: Scanner, context: Context) -> None:
    if scanner.accept("TRIGGER"):
        raise PmacError(ErrorCode.DATA_ERROR, "GATHER TRIGGER: this card has no input that starts it; GATHER")
    context.controller.gather.start()


def _end(_: Scanner, context: Context) -> None:
    context.controller.gather.stop()


def _list(scanner: Scanner, context: Context) -> None:
    """`LIST GATHER`, `LIST GATHER 100` from long word 100, `LIST GATHER 100,50` fifty of them."""
    first = scanner.take_integer() or 0
    count = scanner.take_integer() if scanner.accept(",") else None
    lines = listing(context.controller.gather.long_words(first, count))
    context.work += len(lines) * LINE_WORK
    context.lines.extend(lines)


def _delete(_: Scanner, context: Context) -> None:
    context.controller.gather.delete()


WORDS: dict[str, Handler] = {
    **{f"{define}{word}": _define for define in ("DEFINE", "DEF") for word in _GATHER},
    **dict.fromkeys(_GATHER, _gather),
    **dict.fromkeys(("ENDGATHER", "ENDG"), _end),
    **{f"LIST{word}": _list for word in _GATHER},
    **{f"{delete}{word}": _delete for delete in ("DELETE", "DEL") for word in _GATHER},
}
