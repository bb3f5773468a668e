"""Cells that are not yet as they should be, by what is wrong there. One that has become right must leave."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tests.matrix.situations import Situation

STOPPING = Situation.STOPPING


@dataclass(frozen=True, kw_only=True)
class Wrong:
    """One thing that is wrong, and where."""

    what: str
    cells: tuple[tuple[str, Situation], ...]


def _cells(rows: tuple[str, ...], *situations: Situation) -> tuple[tuple[str, Situation], ...]:
    return tuple((row, situation) for row in rows for situation in situations)


WRONG: tuple[Wrong, ...] = (
    Wrong(
        what="A loop that trips, or that another host opens, between the last look and control-A is closed again.",
        cells=_cells(
            (
                *(f"amplifier-fault, {axis}" for axis in ("tool", "spindle", "carriage")),
                *("encoder-loss, spindle", "following-error-trip, spindle"),
                *("stranger-writes, ^K", "stranger-writes, $$$"),
            ),
            STOPPING,
        ),
    ),
)

KNOWN: Mapping[tuple[str, Situation], str] = {cell: wrong.what for wrong in WRONG for cell in wrong.cells}
"""By row and situation: what is wrong there."""
