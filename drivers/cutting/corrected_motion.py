"""The commands of the servo loops: the program's motion plus a compensation table and an external spindle.

The controller evaluates the table in every servo cycle; here the correction is represented by cubics that are
short compared with a lobe. A source with a higher motor number than the target is read one servo cycle late.
The table is assumed to be on: a cam is switched on and off where it adds nothing.

A spindle that is not an axis of the program turns at constant speed, and is added to the other motors. Where it
is the clock of the program, program times are stretched to the speed of the cut.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from drivers.pmac.check import CheckedMove, CheckedProgram
from drivers.pmac.compensation.table import CompensationTable
from drivers.pmac.trajectory.cubics import CubicMotion, Floats, interpolate_cubics, shift_cubics
from drivers.pmac.trajectory.linear import Timing
from drivers.pmac.trajectory.pieces import Cubic, Piece, Vector
from drivers.pmac.trajectory.planned_pieces import MoveRecord

Whole = NDArray[np.int_]

COLUMNS_A_PIECE = 3.0  # table columns, at most, that a source travels along a row in one cubic
SLOPE_MS = 0.25  # half of the interval over which the slope at the ends of a cubic is taken


def source_is_late(table: CompensationTable, source: int) -> bool:
    """Whether the controller reads the source only after the target: it serves motors in numerical order."""
    return table.definition.sources[source].motor > table.definition.target


def with_table(checked: CheckedProgram, table: CompensationTable, servo_period_ms: float) -> CheckedProgram:
    """Return the motion with the correction added to the target of the table, to its peaks and extent too."""
    motor, sizes = table.definition.target, (table.definition.columns, table.definition.rows)
    sources = tuple(
        _Source(
            place=checked.motors.index(source.motor),
            span_counts=source.span_counts,
            size=sizes[number],
            late_ms=servo_period_ms * source_is_late(table, number),
        )
        for number, source in enumerate(table.definition.sources)
    )
    adder = _Adder(grid=np.array(table.grid), target=checked.motors.index(motor), sources=sources)
    pieces = [piece for move in checked.moves for piece in move.pieces]
    counts, parts, motion = adder.parts(pieces)
    part, count = iter(parts), iter(counts)
    moves = tuple(
        CheckedMove(record=move.record, pieces=tuple(islice(part, sum(islice(count, len(move.pieces))))))
        for move in checked.moves
    )
    low, high = motion.extent()
    return replace(
        checked,
        moves=moves,
        peak_velocity={**checked.peak_velocity, motor: motion.peak_velocity()},
        lowest={**checked.lowest, motor: low},
        highest={**checked.highest, motor: high},
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Source:
    """A source of the table: its place among the motors, and its columns or rows per span."""

    place: int
    span_counts: float
    size: int
    late_ms: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Adder:
    grid: Floats
    target: int
    sources: tuple[_Source, ...]

    def parts(self, pieces: Sequence[Piece]) -> tuple[list[int], Iterator[Piece], CubicMotion]:
        """Split pieces into shorter ones with the correction added to the target's cubics, all at once.

        Returns:
            The number of parts of each piece, the parts, and the motion of the target.
        """
        duration_ms = np.array([piece.duration_ms for piece in pieces])
        motors = np.array([piece.cubics for piece in pieces]).transpose(1, 2, 0)
        counts = self._counts(motors, duration_ms)
        whole = np.repeat(np.arange(len(pieces)), counts)
        number = np.arange(whole.size) - np.repeat(np.cumsum(counts) - counts, counts)
        step_ms = (duration_ms / counts)[whole]
        begin_ms = number * step_ms
        end_ms = np.where(number + 1 == counts[whole], duration_ms[whole], begin_ms + step_ms)
        cubics = motors[:, :, whole]
        moved = np.array([shift_cubics(cubic, begin_ms) for cubic in cubics])
        moved[self.target] += self._add_to_cubics(cubics, begin_ms, end_ms, step_ms)
        of_motors = zip(*(zip(*cubic.tolist(), strict=True) for cubic in moved), strict=True)
        parts = map(_part, (pieces[place] for place in whole.tolist()), step_ms.tolist(), of_motors)
        motion = CubicMotion(cubics=moved[self.target], duration_ms=step_ms)
        return counts.tolist(), parts, motion

    def _counts(self, motors: Floats, duration_ms: Floats) -> Whole:
        most = np.ones_like(duration_ms)
        # Along the rows the correction oscillates; across them it grows, and a few cubics per row suffice.
        for source, fraction in zip(self.sources, (COLUMNS_A_PIECE, 0.125), strict=False):
            motion = CubicMotion(cubics=motors[source.place], duration_ms=duration_ms)
            way = np.abs(motion.positions_at(duration_ms) - motion.cubics[0])
            most = np.maximum(most, way * source.size / source.span_counts / fraction)
        return np.ceil(most).astype(int)

    def _add_to_cubics(self, cubics: Floats, begin_ms: Floats, end_ms: Floats, step_ms: Floats) -> Floats:
        """Return what is added to the target's cubics, shape (4, n); a piece of no duration adds nothing."""

        def value_and_slope(instants_ms: Floats) -> tuple[Floats, Floats]:
            before, after = (self._corrections(cubics, instants_ms + each) for each in (-SLOPE_MS, SLOPE_MS))
            return self._corrections(cubics, instants_ms), (after - before) / (2.0 * SLOPE_MS)

        there, slope = value_and_slope(begin_ms)
        then, later = value_and_slope(end_ms)
        timed = step_ms > 0.0
        return np.where(timed, interpolate_cubics(there, slope, then, later, np.where(timed, step_ms, 1.0)), 0.0)

    def _corrections(self, cubics: Floats, instants_ms: Floats) -> Floats:
        """Return the corrections at given times, each counted from the start of the piece with these cubics."""
        places = []
        for source in self.sources:
            motion = CubicMotion(cubics=cubics[source.place], duration_ms=instants_ms)
            seen = motion.positions_at(instants_ms - source.late_ms)
            places.append(np.mod(seen, source.span_counts) * source.size / source.span_counts)
        column = places[0]
        left = np.minimum(column.astype(int), self.sources[0].size - 1)
        if len(places) == 1:
            return _row(self.grid, np.zeros_like(left), left, column - left)
        row = places[1]
        above = np.minimum(row.astype(int), self.sources[1].size - 1)
        upper = _row(self.grid, above, left, column - left)
        lower = _row(self.grid, above + 1, left, column - left)
        return np.asarray(upper + (lower - upper) * (row - above), dtype=np.float64)


def _part(piece: Piece, step_ms: float, cubics: tuple[Cubic, ...]) -> Piece:
    if step_ms == 0.0:
        return piece
    return Piece(step_ms, cubics, False, piece.real_time, piece.deferred)


def _row(grid: Floats, row: Whole, left: Whole, fraction: Floats) -> Floats:
    before = grid[row, left]
    return np.asarray(before + (grid[row, left + 1] - before) * fraction, dtype=np.float64)


def with_spindle(
    checked: CheckedProgram, motor: int, counts_per_ms: float, first_counts: float = 0.0, stretch: float = 1.0
) -> CheckedProgram:
    """Add a spindle at `counts_per_ms` from `first_counts` on; moves take `stretch` times as long."""
    motors = tuple(sorted((*checked.motors, motor)))
    place = motors.index(motor)
    moves = []
    here = first_counts
    for move in checked.moves:
        pieces = []
        for piece in move.pieces:
            pieces.append(_correct_piece(piece, place, (here, counts_per_ms, 0.0, 0.0), stretch))
            here += counts_per_ms * pieces[-1].duration_ms
        moves.append(CheckedMove(record=_record(move.record, place, here, stretch), pieces=tuple(pieces)))
    peak = {each: speed / stretch for each, speed in checked.peak_velocity.items()}
    return CheckedProgram(
        motors=motors,
        moves=tuple(moves),
        duration_ms=checked.duration_ms * stretch,
        peak_velocity={**peak, motor: abs(counts_per_ms)},
        lowest={**checked.lowest, motor: min(first_counts, here)},
        highest={**checked.highest, motor: max(first_counts, here)},
    )


def _correct_piece(piece: Piece, place: int, turning: Cubic, stretch: float) -> Piece:
    cubics = piece.cubics
    if stretch != 1.0:
        square, cube = stretch**2, stretch**3
        cubics = tuple([(c0, c1 / stretch, c2 / square, c3 / cube) for c0, c1, c2, c3 in cubics])
    beside = (*cubics[:place], turning, *cubics[place:])
    return Piece(piece.duration_ms * stretch, beside, piece.calculates, piece.real_time, piece.deferred)


def _record(record: MoveRecord, place: int, here: float, stretch: float) -> MoveRecord:
    target: Vector = record.target
    return MoveRecord(
        line=record.line,
        target=(*target[:place], here, *target[place:]),
        asked=_longer(record.asked, stretch),
        timing=None if record.timing is None else _longer(record.timing, stretch),
    )


def _longer(timing: Timing, stretch: float) -> Timing:
    return Timing(ta_ms=timing.ta_ms * stretch, ts_ms=timing.ts_ms * stretch, tm_ms=timing.tm_ms * stretch)
