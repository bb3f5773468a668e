"""A compensation table: what is added to the position of a target motor, by the positions of one or two others.

Used as an electronic cam, too: the whole motion of the target is then in the table. Sources: PMAC User Manual,
leadscrew compensation; PMAC and Turbo Software Reference, DEFINE COMP.

An entry is in sixteenths of a count of the target; between entries the correction is a straight line. A source
beyond its span is rolled over into it, and one below zero counts from the upper end. A table with one source has
its first entry one spacing from zero; at zero the last entry counts, which is zero unless a step is wanted.

A table with two sources is a grid. The manual's names are crosswise: the row motor moves along a row, so its span
is divided by the columns, and the column motor chooses the row. Entries come row by row; the one of the origin is
not sent and is zero. The edges at zero have entries of their own, so the table need not be the same at both ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

PARTS_PER_COUNT = 16
"""Entries are in sixteenths of a count of the target."""


@dataclass(frozen=True, slots=True)
class TableSource:
    """A motor whose position chooses the place in a table, actual or `desired`."""

    motor: int
    span_counts: int
    desired: bool = False


@dataclass(frozen=True, kw_only=True)
class TableDefinition:
    """What DEFINE COMP says; the entries follow on lines of their own.

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
        """How many entries follow the definition."""
        return (self.rows + 1) * (self.columns + 1) - 1

    def filled(self, entries: Sequence[int]) -> CompensationTable:
        """Return the table with these entries, sixteenths of a count in the order in which they are sent."""
        return CompensationTable(definition=self, entries=tuple(entries))


@dataclass(frozen=True, kw_only=True)
class CompensationTable:
    """A table with all its entries, sixteenths of a count of the target."""

    definition: TableDefinition
    entries: tuple[int, ...]

    def __post_init__(self) -> None:
        if len(self.entries) != self.definition.entry_count:
            raise ValueError(f"{len(self.entries)} entries; the definition asks for {self.definition.entry_count}")

    @cached_property
    def grid(self) -> tuple[tuple[float, ...], ...]:
        """The corrections in counts, row by row, each with its value at zero in front."""
        origin = 0 if self.definition.rows else self.entries[-1]
        counts = [entry / PARTS_PER_COUNT for entry in (origin, *self.entries)]
        width = self.definition.columns + 1
        return tuple(tuple(counts[first : first + width]) for first in range(0, len(counts), width))

    def correction(self, *positions_counts: float) -> float:
        """Return the correction in counts of the target, where the sources are."""
        return self.corrections(*((position,) for position in positions_counts))[0]

    def corrections(self, *tracks_counts: Sequence[float]) -> list[float]:
        """Return the correction for each servo cycle of a block; one track of positions for each source."""
        sizes = (self.definition.columns, self.definition.rows)
        places = [
            [position % source.span_counts * size / source.span_counts for position in track]
            for source, size, track in zip(self.definition.sources, sizes, tracks_counts, strict=False)
        ]
        if len(tracks_counts) != len(self.definition.sources):
            raise ValueError(f"{len(tracks_counts)} tracks for {len(self.definition.sources)} sources")
        if len(places) == 1:
            return _along(self.grid[0], places[0])
        return [self.at(column, row) for column, row in zip(*places, strict=True)]

    def at(self, column: float, row: float = 0.0) -> float:
        """Return the correction at a place of the grid, in spacings; its ends belong to their last interval."""
        left = min(int(column), self.definition.columns - 1)
        share = column - left
        above = min(int(row), max(0, self.definition.rows - 1))
        lines = self.grid[above : above + 2]
        found = [line[left] + (line[left + 1] - line[left]) * share for line in lines]
        return found[0] + (found[-1] - found[0]) * (row - above)


def step_counts(
    table: CompensationTable, positions_counts: Sequence[float | None], held_counts: float = 0.0
) -> float:
    """Return by how much the target is thrown when I51 goes to 1 at these positions of the sources, counts.

    A source that turns, and may be anywhere, is None; then it is the worst that can happen. `held_counts` is what
    the register of the correction still holds: I51 = 0 leaves the last correction in it. A cam is switched without
    a step only where this is 0, for instance in a row of zeros.
    """
    sources = table.definition.sources
    if len(positions_counts) != len(sources):
        raise ValueError(f"{len(positions_counts)} positions for {len(sources)} sources")
    places = []
    for source, size, position in zip(
        sources, (table.definition.columns, table.definition.rows), positions_counts, strict=False
    ):
        everywhere = [float(place) for place in range(size + 1)]  # straight lines are worst where they meet
        span = source.span_counts
        places.append(everywhere if position is None else [position % span * size / span])
    return max(abs(table.at(*place) - held_counts) for place in product(*places))


def _along(knots: Sequence[float], places: Sequence[float]) -> list[float]:
    """Return what `at` does for a table with one source, as fast as a block of servo cycles needs it."""
    last = len(knots) - 2
    found = []
    for place in places:
        left = min(int(place), last)
        start = knots[left]
        found.append(start + (knots[left + 1] - start) * (place - left))
    return found
