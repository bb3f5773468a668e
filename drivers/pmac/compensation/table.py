"""A compensation table: a correction of a target motor's position, by the positions of one or two source motors.

Also used as an electronic cam: the whole motion of the target is then in the table. Sources: PMAC User Manual,
leadscrew compensation; PMAC and Turbo Software Reference, DEFINE COMP.

An entry is in sixteenths of a count of the target; between entries the correction is interpolated linearly. A
source beyond its span rolls over into it, and one below zero counts from the upper end. A table with one source
has its first entry one spacing from zero; at zero the last entry applies, which is zero unless a step is intended.

A table with two sources is a grid. The manual's names are crosswise: the row motor moves along a row, so its span
is divided by the columns, and the column motor selects the row. Entries come row by row; the one of the origin is
not sent and is zero. The edges at zero have entries of their own, so the table need not be the same at both ends.

The memory of tables is a stack: those of high motor numbers are defined first and deleted last. What lies after
them has to be deleted first, usually the data gathering buffer (also DELETE LOOKAHEAD in the Software Reference).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from itertools import product

from drivers.pmac.language.errors import ErrorCode, PmacError

PARTS_PER_COUNT = 16  # Entries are in sixteenths of a count of the target

BEHIND_TABLES = ("TCOMP", "BLCOMP", "TBUF", "ROTARY", "LOOKAHEAD", "GATHER")
"""The buffers that lie after the tables; LOOKAHEAD on Turbo only."""

Whereabouts = float | tuple[float, float] | None
"""Position range of a source, counts: a single position, from one to a higher one, or unrestricted."""


@dataclass(frozen=True, slots=True)
class TableSource:
    """A motor whose position selects the place in a table, actual or `desired`."""

    motor: int
    span_counts: int
    desired: bool = False


@dataclass(frozen=True, kw_only=True)
class TableDefinition:
    """The content of a DEFINE COMP line; the entries follow on lines of their own.

    `motor` is the one that the table belongs to. `sources` are one motor, or the row motor and the column motor;
    `rows` is 0 with one source.
    """

    motor: int
    sources: tuple[TableSource, ...]
    target: int
    columns: int
    rows: int = 0

    def __post_init__(self) -> None:
        if len(self.sources) not in (1, 2) or (self.rows > 0) != (len(self.sources) == 2):
            raise ValueError(f"{len(self.sources)} sources and {self.rows} rows; one source has no rows, two have")
        spans = [source.span_counts for source in self.sources]
        if min(self.columns, *spans) < 1:
            raise ValueError(f"{self.columns} columns over {spans} counts; both from 1")

    @property
    def entry_count(self) -> int:
        """Number of entries that follow the definition."""
        return (self.rows + 1) * (self.columns + 1) - 1

    def fill_table(self, entries: Sequence[int]) -> CompensationTable:
        """Return the table with these entries, sixteenths of a count in the order in which they are sent."""
        return CompensationTable(definition=self, entries=tuple(entries))


@dataclass(frozen=True, kw_only=True)
class CompensationTable:
    """A table with all its entries, sixteenths of a count of the target.

    `grid` are the corrections in counts, row by row, each with its value at zero first.
    """

    definition: TableDefinition
    entries: tuple[int, ...]
    grid: tuple[tuple[float, ...], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if len(self.entries) != self.definition.entry_count:
            raise ValueError(f"{len(self.entries)} entries; the definition asks for {self.definition.entry_count}")
        origin = 0 if self.definition.rows else self.entries[-1]
        counts = [entry / PARTS_PER_COUNT for entry in (origin, *self.entries)]
        width = self.definition.columns + 1
        grid = tuple(tuple(counts[first : first + width]) for first in range(0, len(counts), width))
        object.__setattr__(self, "grid", grid)  # frozen: this is how it is set

    def correction(self, *positions_counts: float) -> float:
        """Return the correction in counts of the target at these source positions."""
        definition = self.definition
        places = [
            position % source.span_counts * size / source.span_counts
            for position, source, size in zip(
                positions_counts, definition.sources, (definition.columns, definition.rows), strict=False
            )
        ]
        if not len(positions_counts) == len(places) == len(definition.sources):
            raise ValueError(f"{len(positions_counts)} positions for {len(definition.sources)} sources")
        return self.correction_at(*places)

    def corrections(self, tracks_counts: Sequence[list[float]]) -> list[float]:
        """Return the corrections along tracks of the sources, each as `correction` returns it."""
        definition = self.definition
        if definition.rows:
            return [self.correction(*places) for places in zip(*tracks_counts, strict=True)]
        # Written out for one source: a table is asked in every servo cycle.
        line, size, span = self.grid[0], definition.columns, definition.sources[0].span_counts
        last = size - 1
        found: list[float] = []
        for position in tracks_counts[0]:
            column = position % span * size / span
            left = int(column)
            left = left if left < last else last
            low = line[left]
            found.append(low + (line[left + 1] - low) * (column - left))
        return found

    def correction_at(self, column: float, row: float = 0.0) -> float:
        """Return the correction at a place of the grid, in spacings; its ends belong to their last interval."""
        left = min(int(column), self.definition.columns - 1)
        fraction = column - left
        above = min(int(row), max(0, self.definition.rows - 1))
        line = self.grid[above]
        found = line[left] + (line[left + 1] - line[left]) * fraction
        if not self.definition.rows:
            return found
        line = self.grid[above + 1]
        below = line[left] + (line[left + 1] - line[left]) * fraction
        return found + (below - found) * (row - above)


def step_counts(
    table: CompensationTable, positions_counts: Sequence[Whereabouts], held_counts: float = 0.0
) -> float:
    """Return the step of the target when I51 goes to 1 at these positions of the sources, counts.

    Where a source has a range of positions, the result is the worst case. `held_counts` is the value still in the
    correction register: I51 = 0 leaves the last correction in it. Switching a cam causes no step only where this
    is 0, for instance in a row of zeros.
    """
    return max(abs(correction - held_counts) for correction in correction_range(table, positions_counts))


def correction_range(table: CompensationTable, positions_counts: Sequence[Whereabouts]) -> tuple[float, float]:
    """Return the least and the greatest correction over these ranges of the sources, counts."""
    definition = table.definition
    if len(positions_counts) != len(definition.sources):
        raise ValueError(f"{len(positions_counts)} positions for {len(definition.sources)} sources")
    sizes = (definition.columns, definition.rows)
    places = [
        _turning_places(where, source.span_counts, size)
        for where, source, size in zip(positions_counts, definition.sources, sizes, strict=False)
    ]
    found = [table.correction_at(*place) for place in product(*places)]
    return min(found), max(found)


def _turning_places(where: Whereabouts, span: int, size: int) -> list[float]:
    """Return the places, in spacings, between which a correction is linear: the extremes are among them."""
    if isinstance(where, int | float):
        return [where % span * size / span]
    if where is None or where[1] - where[0] >= span:
        return [float(place) for place in range(size + 1)]
    begin = where[0] % span * size / span
    end = begin + (where[1] - where[0]) * size / span
    places = [begin, end if end < size else end - size]
    for knot in range(math.ceil(begin), math.floor(end) + 1):
        # The upper end and zero are one position with two entries, and a source that crosses it sees both.
        places += [float(size), 0.0] if knot == size else [float(knot % size)]
    return places


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

    Raises PmacError: 003, another buffer or table is in the way; 006, the remaining memory holds fewer entries.
    """
    _refuse_behind(definition.motor, tables, buffers)
    if definition.motor in tables:
        detail = f"motor {definition.motor} has a table already; DELETE COMP first"
        raise PmacError(ErrorCode.DATA_ERROR, detail)
    if definition.entry_count > room_entries:
        raise PmacError(ErrorCode.NO_ROOM, f"{definition.entry_count} entries; room for {room_entries}")


def refuse_deletion(motor: int, tables: Collection[int], buffers: Collection[str]) -> None:
    """Refuse DELETE COMP of a motor where the controller does; without a table there is nothing to refuse.

    Raises PmacError: 003, another buffer or table lies after this table.
    """
    if motor in tables:
        _refuse_behind(motor, tables, buffers)


def _refuse_behind(motor: int, tables: Collection[int], buffers: Collection[str]) -> None:
    lower = sorted(other for other in tables if other < motor)
    if lower:
        numbers = ", ".join(map(str, lower))
        raise TableOrderError(motor, numbers)
    after = [name for name in BEHIND_TABLES if name in buffers]
    if after:
        detail = f"table of motor {motor}: {', '.join(after)} behind it; DELETE {after[0]} first"
        raise PmacError(ErrorCode.DATA_ERROR, detail)
