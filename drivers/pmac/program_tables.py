"""The compensation tables that a text defines: `#1 DEFINE COMP ...` and the lines of entries after it."""

from __future__ import annotations

import re
from dataclasses import dataclass

from drivers.pmac.compensation.buffers import refuse_definition, refuse_deletion
from drivers.pmac.compensation.table import CompensationTable, TableDefinition
from drivers.pmac.compensation.table_text import scan_definition, scan_entries
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner

MOST_MOTORS = 32
"""Of the largest family; the target controller is not known when the text is read."""

_DEFINE = ("DEFINECOMP", "DEFCOMP")
_DELETE = ("DELETECOMP", "DELCOMP")
_ENTRIES = re.compile(r"[+-]?[\d.]")
_ADDRESS = re.compile(r"#\s*(\d+)(?!\d|\s*->)")


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """A table as a text sends it, from line `place` to line `last_place` (from 1); entries may be missing."""

    definition: TableDefinition
    entries: tuple[int, ...]
    place: int
    last_place: int

    @property
    def table(self) -> CompensationTable | None:
        """The table, None when entries are missing: then it corrects nothing."""
        full = len(self.entries) == self.definition.entry_count
        return self.definition.filled(self.entries) if full else None


@dataclass(slots=True)
class _Waiting:
    """A definition whose entries are being read; one that the controller has refused is skipped."""

    definition: TableDefinition
    place: int
    last_place: int
    refused: bool
    entries: list[int]

    @property
    def target(self) -> int:
        return self.definition.entry_count - len(self.entries)


class TableReader:
    """Extracts the table lines from a text, tracking the motor that was addressed last, initially #1."""

    def __init__(self, motor_count: int = MOST_MOTORS) -> None:
        self._motor_count = motor_count
        self._motor = 1
        self._tables: dict[int, TextTable] = {}
        self._waiting: _Waiting | None = None

    @property
    def tables(self) -> tuple[TextTable, ...]:
        """The tables that the controller holds after the text, in the order of their definition."""
        waiting = self._waiting
        return (*self._tables.values(), *([_kept(waiting)] if waiting and not waiting.refused else []))

    def take_entries(self, scanner: Scanner, place: int) -> bool:
        """Consume a line of entries; False when no table expects one, or it is another line.

        Raises:
            PmacError: 003, not entries, or more than the table expects; then none of them counts.
        """
        waiting = self._waiting
        if waiting is None or not waiting.target or not _ENTRIES.match(scanner.rest):
            return False
        entries = scan_entries(scanner)
        if len(entries) > waiting.target:
            raise PmacError(ErrorCode.DATA_ERROR, f"{len(entries)} entries; the table waits for {waiting.target}")
        waiting.entries += entries
        waiting.last_place = place
        return True

    def take_word(self, scanner: Scanner, place: int) -> bool:
        """Consume DEFINE COMP or DELETE COMP, with its address; False, with nothing consumed, without either.

        Raises:
            PmacError: 003, not a definition, or not in the order of memory allocation (`TableOrderError`).
        """
        mark = scanner.mark()
        motor = self._motor
        if scanner.accept("#"):
            motor = scanner.take_integer() or 0
        word = scanner.take_word((*_DEFINE, *_DELETE))
        if word is None:
            scanner.reset(mark)
            return False
        if not 1 <= motor <= self._motor_count:
            raise PmacError(ErrorCode.DATA_ERROR, f"motor {motor}, 1 to {self._motor_count}")
        self._motor = motor
        if word in _DEFINE:
            self._define(scan_definition(scanner, motor, self._motor_count), place)
        else:
            self._delete(motor)
        return True

    def address(self, text: str) -> None:
        """Record the motor that other commands leave addressed."""
        found = _ADDRESS.findall(text)
        if found:
            self._motor = int(found[-1])

    def _define(self, definition: TableDefinition, place: int) -> None:
        self._settle()
        waiting = _Waiting(definition, place, place, refused=True, entries=[])
        self._waiting = waiting
        refuse_definition(definition, self._tables, (), definition.entry_count)
        waiting.refused = False

    def _delete(self, motor: int) -> None:
        self._settle()
        refuse_deletion(motor, self._tables, ())
        self._tables.pop(motor, None)

    def _settle(self) -> None:
        """Finish the previous table: it gets no more entries."""
        waiting, self._waiting = self._waiting, None
        if waiting is not None and not waiting.refused:
            self._tables[waiting.definition.motor] = _kept(waiting)


def _kept(waiting: _Waiting) -> TextTable:
    return TextTable(
        definition=waiting.definition,
        entries=tuple(waiting.entries),
        place=waiting.place,
        last_place=waiting.last_place,
    )
