"""The order in which compensation tables are defined and deleted: the controller's memory is a stack.

Tables of high motor numbers are defined first and deleted last. Anything that lies after them in memory has to be
deleted first, usually the data gathering buffer. Sources: PMAC and Turbo Software Reference, DEFINE COMP, DELETE
LOOKAHEAD.
"""

from __future__ import annotations

from collections.abc import Collection

from drivers.pmac.compensation.table import TableDefinition
from drivers.pmac.language.errors import ErrorCode, PmacError

BEHIND_TABLES = ("TCOMP", "BLCOMP", "TBUF", "ROTARY", "LOOKAHEAD", "GATHER")
"""The buffers that lie after the tables; LOOKAHEAD on Turbo only."""


class TableOrderError(PmacError):
    """Tables of lower motors, `lower`, lie after the one of `motor`."""

    def __init__(self, motor: int, lower: str) -> None:
        detail = f"table of motor {motor}: those of lower motors ({lower}) lie behind it; delete them first"
        super().__init__(ErrorCode.DATA_ERROR, detail)
        self.motor = motor
        self.lower = lower


def refuse_definition(
    definition: TableDefinition, tables: Collection[int], buffers: Collection[str], room_entries: int
) -> None:
    """Refuse DEFINE COMP where the controller does.

    `tables` are the motors that have a table, `buffers` the names of `BEHIND_TABLES` that exist.

    Raises:
        PmacError: 003, another buffer or table is in the way; 006, the remaining memory holds fewer entries.
    """
    _refuse_behind(definition.motor, tables, buffers)
    if definition.motor in tables:
        detail = f"motor {definition.motor} has a table already; DELETE COMP first"
        raise PmacError(ErrorCode.DATA_ERROR, detail)
    if definition.entry_count > room_entries:
        raise PmacError(ErrorCode.NO_ROOM, f"{definition.entry_count} entries; room for {room_entries}")


def refuse_deletion(motor: int, tables: Collection[int], buffers: Collection[str]) -> None:
    """Refuse DELETE COMP of a motor where the controller does; without a table there is nothing to refuse.

    Raises:
        PmacError: 003, another buffer or table lies after this table.
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
