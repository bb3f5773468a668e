"""The motion of a program with what a compensation table adds to it: what the loop of the target is told.

The card works the table out in every servo cycle; here the correction is put into cubics that are short against a
lobe. A source of a higher number than the target is seen as it was one servo cycle before. That the table is on is
taken for granted: a cam is switched where it adds nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from drivers.pmac.check import CheckedMove, CheckedProgram, extent, peak_velocity
from drivers.pmac.compensation.table import CompensationTable
from drivers.pmac.trajectory.pieces import Cubic, Piece, position_at

Floats = NDArray[np.float64]

COLUMNS_A_PIECE = 3.0
"""Of the table, at most, that a source goes along a row in one cubic."""

SLOPE_MS = 0.25
"""Half of the time over which the slope at the ends of a cubic is taken."""


def source_is_late(table: CompensationTable, source: int) -> bool:
    """Whether the card looks at a source only after the target: motors come in the order of their numbers."""
    return table.definition.sources[source].motor > table.definition.target


def with_table(checked: CheckedProgram, table: CompensationTable, servo_period_ms: float) -> CheckedProgram:
    """Return the motion with the correction in the target of the table, in its peaks and its extent as well."""
    target = checked.motors.index(table.definition.target)
    adder = _Adder(
        table=table,
        grid=np.array(table.grid),
        target=target,
        sources=tuple(checked.motors.index(source.motor) for source in table.definition.sources),
        late_ms=tuple(
            servo_period_ms if source_is_late(table, place) else 0.0
            for place in range(len(table.definition.sources))
        ),
    )
    moves = tuple(
        CheckedMove(record=move.record, pieces=tuple(part for piece in move.pieces for part in adder.parts(piece)))
        for move in checked.moves
    )
    pieces = [piece for move in moves for piece in move.pieces]
    low, high = extent(pieces, target)
    motor = table.definition.target
    return replace(
        checked,
        moves=moves,
        peak_velocity={**checked.peak_velocity, motor: peak_velocity(pieces, target)},
        lowest={**checked.lowest, motor: low},
        highest={**checked.highest, motor: high},
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Adder:
    table: CompensationTable
    grid: Floats
    target: int
    sources: tuple[int, ...]
    late_ms: tuple[float, ...]

    def parts(self, piece: Piece) -> list[Piece]:
        """Return a piece as shorter ones, the correction in the cubic of the target."""
        count = self._count(piece)
        step_ms = piece.duration_ms / count
        if step_ms == 0.0:
            return [piece]
        ends_ms = np.linspace(0.0, piece.duration_ms, count + 1)
        there = self._corrections(piece, ends_ms)
        slopes = (self._corrections(piece, ends_ms + SLOPE_MS) - self._corrections(piece, ends_ms - SLOPE_MS)) / (
            2.0 * SLOPE_MS
        )
        parts = []
        for k in range(count):
            cubics = [_shifted(cubic, float(ends_ms[k])) for cubic in piece.cubics]
            added = _between(there[k], slopes[k], there[k + 1], slopes[k + 1], step_ms)
            c0, c1, c2, c3 = cubics[self.target]
            cubics[self.target] = (c0 + added[0], c1 + added[1], c2 + added[2], c3 + added[3])
            parts.append(replace(piece, duration_ms=step_ms, cubics=tuple(cubics), calculates=False))
        return parts

    def _count(self, piece: Piece) -> int:
        """Return into how many parts a piece is cut."""
        most = 1.0
        for place, (source, size) in enumerate(zip(self.table.definition.sources, self._sizes, strict=False)):
            cubic = piece.cubics[self.sources[place]]
            way = abs(position_at(cubic, piece.duration_ms) - cubic[0])
            # Along the rows the correction is a wave; across them it grows, and a few cubics do for a row.
            share = COLUMNS_A_PIECE if place == 0 else 0.125
            most = max(most, way * size / source.span_counts / share)
        return math.ceil(most)

    @property
    def _sizes(self) -> tuple[int, int]:
        return self.table.definition.columns, self.table.definition.rows

    def _corrections(self, piece: Piece, instants_ms: Floats) -> Floats:
        places = []
        for place, (source, size) in enumerate(zip(self.table.definition.sources, self._sizes, strict=False)):
            cubic = piece.cubics[self.sources[place]]
            seen = np.polyval(cubic[::-1], instants_ms - self.late_ms[place])
            places.append(np.mod(seen, source.span_counts) * size / source.span_counts)
        column = places[0]
        left = np.minimum(column.astype(int), self.table.definition.columns - 1)
        if len(places) == 1:
            return _line(self.grid[0], left, column - left)
        row = places[1]
        above = np.minimum(row.astype(int), self.table.definition.rows - 1)
        upper = _row(self.grid, above, left, column - left)
        lower = _row(self.grid, above + 1, left, column - left)
        return np.asarray(upper + (lower - upper) * (row - above), dtype=np.float64)


def _line(line: Floats, left: NDArray[np.int_], share: Floats) -> Floats:
    return np.asarray(line[left] + (line[left + 1] - line[left]) * share, dtype=np.float64)


def _row(grid: Floats, row: NDArray[np.int_], left: NDArray[np.int_], share: Floats) -> Floats:
    before = grid[row, left]
    return np.asarray(before + (grid[row, left + 1] - before) * share, dtype=np.float64)


def _shifted(cubic: Cubic, by_ms: float) -> Cubic:
    """Return a cubic with its time counted from `by_ms` on."""
    _, c1, c2, c3 = cubic
    return (
        position_at(cubic, by_ms),
        c1 + (2.0 * c2 + 3.0 * c3 * by_ms) * by_ms,
        c2 + 3.0 * c3 * by_ms,
        c3,
    )


def _between(start: float, before: float, end: float, after: float, duration_ms: float) -> Cubic:
    slope = (end - start) / duration_ms
    c2 = (3.0 * slope - 2.0 * before - after) / duration_ms
    c3 = (before + after - 2.0 * slope) / duration_ms**2
    return float(start), float(before), float(c2), float(c3)
