"""Compensation table commands: DEFINE COMP with its entries, LIST COMP, LIST COMP DEF and DELETE COMP."""

from __future__ import annotations

import re

from drivers.pmac.compensation.table_text import definition_text, entry_lines, scan_definition, scan_entries
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.simulator.card import buffers
from drivers.simulator.commands.handler import LINE_WORK, Handler
from drivers.simulator.context import Context

_CONSTANT = re.compile(r"[+-]?[\d.]")
"""First characters of a line of entries; `$` is a command."""


def fill(scanner: Scanner, context: Context) -> bool:
    """Take a line of constants for the table that its host is filling; False when it is not such a line.

    Raises:
        PmacError: 003, an invalid entry, or more than the table expects; then none of the line is accepted.
    """
    tables = context.controller.tables
    if not tables.is_filled_by(context) or context.fills_buffer or not _CONSTANT.match(scanner.rest):
        return False
    entries = scan_entries(scanner)
    context.work += len(entries)
    tables.fill(entries)
    return True


def _define(scanner: Scanner, context: Context) -> None:
    controller = context.controller
    if controller.open_buffer is not None:
        # The open buffer lies in the memory that the table would take.
        raise PmacError(ErrorCode.BUFFER_IN_USE, "a buffer is open; CLOSE first")
    definition = scan_definition(scanner, context.motor_number, context.dialect.motor_count)
    room = buffers.room_lines(controller)
    controller.tables.define(definition, context, _buffers_behind(context), room)


def _delete(_: Scanner, context: Context) -> None:
    context.controller.tables.delete(context.motor_number, _buffers_behind(context))


def _list_entries(_: Scanner, context: Context) -> None:
    lines = entry_lines(context.controller.tables.entries(context.motor_number))
    context.work += len(lines) * LINE_WORK
    context.lines.extend(lines)


def _list_definition(_: Scanner, context: Context) -> None:
    context.lines.append(definition_text(context.controller.tables.definition(context.motor_number)))


def _buffers_behind(context: Context) -> tuple[str, ...]:
    return ("GATHER",) if context.controller.gather.defined else ()


WORDS: dict[str, Handler] = {
    **dict.fromkeys(("DEFINECOMP", "DEFCOMP"), _define),
    **dict.fromkeys(("DELETECOMP", "DELCOMP"), _delete),
    "LISTCOMP": _list_entries,
    "LISTCOMPDEF": _list_definition,
}
