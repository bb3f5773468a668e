"""The order in which compensation tables are defined and deleted: the memory of the card is a stack.

Tables of high motor numbers come first and go last. Anything that lies behind them in memory has to be deleted
first, of which the buffer of data gathering is the usual one. Sources: PMAC and Turbo Software Reference, DEFINE
COMP, DELETE LOOKAHEAD.
"""

from __future__ import annotations

from collections.abc import Collection

from drivers.pmac.compensation.table import TableDefinition
from drivers.pmac.language.errors import ErrorCode, PmacError

BEHIND_TABLES = ("TCOMP", "BLCOMP", "TBUF", "ROTARY", "LOOKAHEAD", "GATHER")
"""The buffers that lie behind the tables; LOOKAHEAD on Turbo only."""


class TableOrderError(PmacError):
    """Tables of lower motors, `lower`, lie behind the one of `motor`."""

    def __init__(self, motor: int, lower: str) -> None:
        detail = f"table of motor {motor}: those of lower motors ({lower}) lie behind it; delete them first"
        super().__init__(ErrorCode.DATA_ERROR, detail)
        self.motor = motor
        self.lower = lower


def refuse_definition(
    definition: TableDefinition, tables: Collection[int], buffers: Collection[str], room_entries: int
) -> None:
    """Refuse DEFINE COMP where the card does.

    `tables` are the motors that have a table, `buffers` the names of `BEHIND_TABLES` that exist.

    Raises:
        PmacError: 003, something lies in the way; 006, the memory that is left takes fewer entries.
    """
    _refuse_behind(definition.motor, tables, buffers)
    if definition.motor in tables:
        detail = f"motor {definition.motor} has a table already; DELETE COMP first"
        raise PmacError(ErrorCode.DATA_ERROR, detail)
    if definition.entry_count > room_entries:
        raise PmacError(ErrorCode.NO_ROOM, f"{definition.entry_count} entries; room for {room_entries}")


def refuse_deletion(motor: int, tables: Collection[int], buffers: Collection[str]) -> None:
    """Refuse DELETE COMP of a motor where the card does; without a table there is nothing to refuse.

    Raises:
        PmacError: 003, something lies behind the table.
    """
    if motor in tables:
        _refuse_behind(motor, tables, buffers)


def _refuse_behind(motor: int, tables: Collection[int], buffers: Collection[str]) -> None:
    lower = sorted(other for other in tables if other < motor)
    if lower:
        numbers = ", ".join(map(str, lower))
        raise TableOrderError(motor, numbers)
    met = [name for name in BEHIND_TABLES if name in buffers]
    if met:
        detail = f"table of motor {motor}: {', '.join(met)} behind it; DELETE {met[0]} first"
        raise PmacError(ErrorCode.DATA_ERROR, detail)
