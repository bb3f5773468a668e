"""The compensation tables of the controller, and the one that a host is filling.

DEFINE COMP reserves the memory; the constants that the same host sends next are the entries. A table counts in the
memory order as soon as it is defined, and corrects something once its last entry has come.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from drivers.pmac.buffer_text import BufferKind
from drivers.pmac.compensation.table import CompensationTable, TableDefinition, refuse_definition, refuse_deletion
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.requests import ADDRESS_OF_PROGRAMS, DefaultAddress

PENDING_LIMIT = 1024  # queued texts of one kind, the oldest are dropped: the controller needs no listener


@dataclass(frozen=True, slots=True, eq=False)
class _UnfilledTable:
    """A table that still expects entries from its `host`."""

    definition: TableDefinition
    host: object
    entries: list[int] = field(default_factory=list)


class TableMemory:
    """The complete `tables` by their motor, replaced as a whole; `revision` counts up with every change."""

    def __init__(self) -> None:
        self.tables: Mapping[int, CompensationTable] = {}
        self.revision = 0
        self._unfilled: dict[int, _UnfilledTable] = {}
        self._filling: _UnfilledTable | None = None

    @property
    def motors(self) -> frozenset[int]:
        """The motors that have a table, complete or not."""
        return frozenset((*self.tables, *self._unfilled))

    @property
    def entry_count(self) -> int:
        """Number of entries in all tables."""
        return sum(self.definition(motor).entry_count for motor in self.motors)

    def definition(self, motor: int) -> TableDefinition:
        """Return the definition of a motor's table. Raises PmacError: 003, it has none."""
        return self._table(motor).definition

    def entries(self, motor: int) -> Sequence[int]:
        """Return the entries of a motor's table received so far. Raises PmacError: 003, it has none."""
        return self._table(motor).entries

    def define(
        self, definition: TableDefinition, host: object, buffers: Collection[str], room_entries: int
    ) -> None:
        """DEFINE COMP: the entries that `host` sends next are this table's; one that it left unfilled stays so.

        Raises PmacError: those of `refuse_definition`.
        """
        refuse_definition(definition, self.motors, buffers, room_entries)
        self._filling = self._unfilled[definition.motor] = _UnfilledTable(definition, host)
        self.revision += 1

    def is_filled_by(self, host: object) -> bool:
        """Whether constants of a host are entries."""
        return self._filling is not None and self._filling.host is host

    def fill(self, entries: Sequence[int]) -> None:
        """Take the next entries of the table being filled. Raises PmacError: 003, too many: none is taken."""
        filling = self._filling
        if filling is None:
            raise PmacError(ErrorCode.DATA_ERROR, "no table is being filled")
        target = filling.definition.entry_count - len(filling.entries)
        if len(entries) > target:
            raise PmacError(ErrorCode.DATA_ERROR, f"{len(entries)} entries; the table waits for {target}")
        filling.entries.extend(entries)
        if len(entries) == target:
            motor = filling.definition.motor
            self.tables = {**self.tables, motor: filling.definition.fill_table(filling.entries)}
            del self._unfilled[motor]
            self._filling = None
        self.revision += 1

    def delete(self, motor: int, buffers: Collection[str]) -> None:
        """DELETE COMP; without a table it has no effect. Raises PmacError: those of `refuse_deletion`."""
        refuse_deletion(motor, self.motors, buffers)
        unfilled = self._unfilled.pop(motor, None)
        if unfilled is not None and unfilled is self._filling:
            self._filling = None
        self.tables = {number: table for number, table in self.tables.items() if number != motor}
        self.revision += 1

    def leave(self) -> None:
        """Stop filling, as after a reset; an incomplete table stays so."""
        self._filling = None

    def replace(self, tables: Iterable[CompensationTable]) -> None:
        """Hold exactly these tables, as after a reset."""
        self.tables = {table.definition.motor: table for table in tables}
        self._unfilled.clear()
        self._filling = None
        self.revision += 1

    def _table(self, motor: int) -> CompensationTable | _UnfilledTable:
        table = self._unfilled.get(motor) or self.tables.get(motor)
        if table is None:
            raise PmacError(ErrorCode.DATA_ERROR, f"motor {motor} has no table")
        return table


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenBuffer:
    """What is being filled, and the host that opened it: no other host may fill it.

    `number` is that of the program, PLC or coordinate system.
    """

    kind: BufferKind
    number: int
    owner: object

    def __str__(self) -> str:
        return self.kind.buffer_name(self.number)


class Password:
    """Initially none is set; it has to be entered again after every reset (Software Reference, PASSWORD).

    It is `locked` while it is set, and was not entered since the last reset.
    """

    def __init__(self, text: str = "") -> None:
        self.text = text
        self.locked = bool(text)

    def give(self, text: str) -> None:
        """Enter the password, or set another one if it is already entered. Raises PmacError: 002, it is wrong."""
        if not self.locked:
            self.text = text
        elif text == self.text:
            self.locked = False
        else:
            raise PmacError(ErrorCode.PASSWORD, "not the password")


class CardHost:
    """Messages and commands of programs and PLCs, until the ports and the background fetch them.

    `pending_commands` are the on-line commands of CMD with the letter of their port ("" for none) and their
    addressing, `host_messages` the texts of SEND with their port. `switch_plc` enables (True) or disables PLCs at
    once; its refusal is a run-time error of the program or PLC that asks for it.
    """

    def __init__(self, switch_plc: Callable[[bool, tuple[int, ...], bool], None]) -> None:
        self.pending_commands: deque[tuple[str, str, DefaultAddress]] = deque(maxlen=PENDING_LIMIT)
        self.host_messages: deque[tuple[str, str]] = deque(maxlen=PENDING_LIMIT)
        self._switch_plc = switch_plc

    def switch_plc(self, enable: bool, numbers: tuple[int, ...], keeping: bool = False) -> None:
        """ENABLE, DISABLE, RESUME and PAUSE PLC."""
        self._switch_plc(enable, numbers, keeping)

    def command(self, text: str, port: str, addressed: DefaultAddress = ADDRESS_OF_PROGRAMS) -> None:
        """CMD."""
        self.pending_commands.append((text, port, addressed))

    def send(self, text: str, port: str) -> None:
        """SEND."""
        self.host_messages.append((text, port))

    def display(self, text: str) -> None:
        """DISPLAY: the controller has no display."""
