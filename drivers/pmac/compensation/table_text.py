"""Compensation tables as text: the line DEFINE COMP, the entries that follow it, and all those in a program text.

`DEFINE COMP 8,#1,#2,4000` has 8 entries over 4000 counts of motor 1, for motor 2.
`DEFINE COMP 2.8,#1D,#3,#2,4000,900` has 2 rows and 8 columns: over 4000 counts of the desired position of motor 1,
the row motor, and over 900 of motor 3, the column motor. A motor that is omitted is the addressed one, to which
the table belongs. Sources: PMAC and Turbo Software Reference, DEFINE COMP.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from drivers.pmac.compensation.table import (
    CompensationTable,
    TableDefinition,
    TableSource,
    refuse_definition,
    refuse_deletion,
)
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.memory import WORD_BITS

GREATEST_ENTRY = (1 << (WORD_BITS - 1)) - 1  # An entry is a signed memory word; sixteenths of a count
_GREATEST_SIZE = (1 << 47) - 1  # A position is a signed 48-bit number: no source can roll over a longer span
LISTED_PER_LINE = 16
LONGEST_LINE = 240
"""Characters sent, below the limit of 255 of the controller. Each line costs a reply, whatever is in it."""
MOST_MOTORS = 32  # Of the largest family; the target controller is not known when the text is read

_DEFINE = ("DEFINECOMP", "DEFCOMP")
_DELETE = ("DELETECOMP", "DELCOMP")
_ENTRIES = re.compile(r"[+-]?[\d.]")
_ADDRESS = re.compile(r"#\s*(\d+)(?!\d|\s*->)")

_Motor = tuple[int, bool]  # A motor number, and whether its desired position is the source


def scan_definition(scanner: Scanner, addressed: int, motor_count: int) -> TableDefinition:
    """Parse what follows DEFINE COMP.

    Raises PmacError: 003, not a definition, a motor that does not exist, or a size or a span of 0.
    """
    first = _size(scanner)
    columns = _size(scanner) if scanner.accept(".") else None
    scanner.expect(",")
    motors = []
    while scanner.accept("#"):
        motors.append(_motor(scanner, motor_count))
        scanner.expect(",")
    spans = [_size(scanner)]
    if columns is None:
        return _definition(scanner, addressed, motors, spans, columns=first)
    if not motors:
        raise scanner.refusal("expected a row motor, as in #1, for a table with rows and columns")
    scanner.expect(",")
    spans.append(_size(scanner))
    return _definition(scanner, addressed, motors, spans, columns=columns, rows=first)


def scan_entries(scanner: Scanner) -> list[int]:
    """Parse a line of entries, sixteenths of a count.

    Raises PmacError: 003, something that is not a signed 24-bit integer.
    """
    entries = []
    while not scanner.at_end:
        negative = scanner.accept("-")
        if not negative:
            scanner.accept("+")
        digits = scanner.take_integer()
        if digits is None or digits > GREATEST_ENTRY + negative or scanner.peek("."):
            raise scanner.refusal(f"a whole number of sixteenths of a count, up to {GREATEST_ENTRY}")
        entries.append(-digits if negative else digits)
    return entries


def read_table(lines: Iterable[str], motor_count: int) -> CompensationTable:
    """Parse a table from the lines that send it, `#1 DEFINE COMP ...` first.

    Raises PmacError: 003, not such lines, or more or fewer entries than the definition requires.
    """
    first, *rest = lines
    scanner = Scanner(first)
    scanner.expect("#")
    addressed = _motor_number(scanner, motor_count)
    if scanner.take_word(("DEFINE", "DEF")) is None:
        raise scanner.refusal("expected DEFINE COMP")
    scanner.expect("COMP")
    definition = scan_definition(scanner, addressed, motor_count)
    if not scanner.at_end:
        raise scanner.refusal("expected the end of the line")
    entries = [entry for line in rest for entry in scan_entries(Scanner(line))]
    if len(entries) != definition.entry_count:
        detail = f"{len(entries)} entries; DEFINE COMP asks for {definition.entry_count}"
        raise PmacError(ErrorCode.DATA_ERROR, detail)
    return definition.fill_table(entries)


def table_lines(table: CompensationTable) -> list[str]:
    """Return the lines that send a table to a controller, within its maximum line length."""
    definition = table.definition
    entries = textwrap.wrap(" ".join(map(str, table.entries)), LONGEST_LINE, break_on_hyphens=False)
    return [f"#{definition.motor}DEFINE COMP {definition_text(definition)}", *entries]


def definition_text(definition: TableDefinition) -> str:
    """Return the text after DEFINE COMP, with every motor named."""
    rows = f"{definition.rows}." if definition.rows else ""
    sources = [f"#{source.motor}{'D' if source.desired else ''}" for source in definition.sources]
    spans = [str(source.span_counts) for source in definition.sources]
    return ",".join([f"{rows}{definition.columns}", *sources, f"#{definition.target}", *spans])


def entry_lines(entries: Sequence[int]) -> list[str]:
    """Return the entries as the lines of a listing."""
    starts = range(0, len(entries), LISTED_PER_LINE)
    return [" ".join(map(str, entries[start : start + LISTED_PER_LINE])) for start in starts]


def _definition(
    scanner: Scanner, addressed: int, motors: list[_Motor], spans: list[int], *, columns: int, rows: int = 0
) -> TableDefinition:
    """Fill in the addressed motor where none is named: sources first, the target last."""
    named = (*motors, *[(addressed, False)] * (len(spans) + 1 - len(motors)))
    *sources, (target, desired) = named
    if len(sources) != len(spans) or desired:
        raise scanner.refusal(f"expected {len(spans)} sources and a target without D, found {len(named)} motors")
    return TableDefinition(
        motor=addressed,
        sources=tuple(TableSource(motor, span, by) for (motor, by), span in zip(sources, spans, strict=True)),
        target=target,
        columns=columns,
        rows=rows,
    )


def _motor(scanner: Scanner, motor_count: int) -> _Motor:
    return _motor_number(scanner, motor_count), scanner.accept("D")


def _motor_number(scanner: Scanner, motor_count: int) -> int:
    motor = scanner.take_integer()
    if motor is None or not 1 <= motor <= motor_count:
        raise scanner.refusal(f"a motor from 1 to {motor_count}")
    return motor


def _size(scanner: Scanner) -> int:
    size = scanner.take_integer()
    if not size or size > _GREATEST_SIZE:
        raise scanner.refusal(f"a whole number, 1 to {_GREATEST_SIZE}")
    return size


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
        return self.definition.fill_table(self.entries) if full else None


@dataclass(slots=True)
class _PendingTable:
    """A definition whose entries are being read; one that the controller has refused is skipped."""

    definition: TableDefinition
    place: int
    last_place: int
    refused: bool = True
    entries: list[int] = field(default_factory=list)

    @property
    def missing(self) -> int:
        return self.definition.entry_count - len(self.entries)

    def to_table(self) -> TextTable:
        return TextTable(
            definition=self.definition, entries=tuple(self.entries), place=self.place, last_place=self.last_place
        )


class CompensationTableReader:
    """Extracts the table lines from a text, tracking the motor that was addressed last, initially #1."""

    def __init__(self, motor_count: int = MOST_MOTORS) -> None:
        self._motor_count = motor_count
        self._motor = 1
        self._tables: dict[int, TextTable] = {}
        self._waiting: _PendingTable | None = None

    @property
    def tables(self) -> tuple[TextTable, ...]:
        """The tables that the controller holds after the text, in the order of their definition."""
        waiting = self._waiting
        return (*self._tables.values(), *([waiting.to_table()] if waiting and not waiting.refused else []))

    def take_entries(self, scanner: Scanner, place: int) -> bool:
        """Consume a line of entries; False when no table expects one, or it is another line.

        Raises PmacError: 003, not entries, or more than the table expects; then none of them counts.
        """
        waiting = self._waiting
        if waiting is None or not waiting.missing or not _ENTRIES.match(scanner.rest):
            return False
        entries = scan_entries(scanner)
        if len(entries) > waiting.missing:
            raise PmacError(ErrorCode.DATA_ERROR, f"{len(entries)} entries; the table waits for {waiting.missing}")
        waiting.entries += entries
        waiting.last_place = place
        return True

    def take_word(self, scanner: Scanner, place: int) -> bool:
        """Consume DEFINE COMP or DELETE COMP, with its address; False, with nothing consumed, without either.

        Raises PmacError: 003, not a definition, or not in the order of memory allocation (`TableOrderError`).
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
        waiting = _PendingTable(definition, place, place)
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
            self._tables[waiting.definition.motor] = waiting.to_table()
