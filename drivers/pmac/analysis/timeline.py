"""A whole motion on one time axis: its steps, the position of a motor at an instant, its extremes between two.

Everything is exact from the cubics; nothing is sampled. Positions are counts, times ms from the start.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import NamedTuple

from drivers.pmac.requests import Request
from drivers.pmac.trajectory.pieces import Cubic, Piece, Vector, position_at, velocity_at
from drivers.pmac.trajectory.planned_pieces import PlannedPieces

SAME_COUNTS = 1e-6  # Motions that differ by less are the same within rounding

NOTHING = 1e-9  # Counts, and counts in ms to any power, below which a value is only arithmetic rounding
_SAME = 1e-9  # Fraction of the greatest acceleration below which a jump of it is only arithmetic rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class Peaks:
    """Greatest absolute values: counts/ms, counts/ms^2, counts/ms^3.

    The jerk is None where the acceleration jumps: there it has no value.
    """

    velocity: float
    acceleration: float
    jerk: float | None


class Timeline:
    """The pieces of a motion in their order; `begins_ms[i]` is the start of piece i."""

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self.pieces = tuple(pieces)
        *self.begins_ms, self.ends_ms = accumulate((piece.duration_ms for piece in self.pieces), initial=0.0)

    def position(self, index: int, instant_ms: float) -> float:
        """Return the position of the motor at place `index`; before the start and after the end it is at rest."""
        cubic, inside_ms = self._cubic_at(index, instant_ms)
        return position_at(cubic, inside_ms)

    def velocity(self, index: int, instant_ms: float) -> float:
        """Return the velocity of a motor, counts/ms."""
        cubic, inside_ms = self._cubic_at(index, instant_ms)
        return velocity_at(cubic, inside_ms)

    def _cubic_at(self, index: int, instant_ms: float) -> tuple[Cubic, float]:
        """Return the cubic of a motor at an instant, and the time inside it."""
        place = self._place(instant_ms)
        piece = self.pieces[place]
        return piece.cubics[index], min(max(instant_ms - self.begins_ms[place], 0.0), piece.duration_ms)

    def extent(self, index: int, from_ms: float, to_ms: float) -> tuple[float, float]:
        """Return the lowest and the highest position of a motor between two instants."""
        values = [self.position(index, from_ms), self.position(index, to_ms)]
        for piece, begin_ms, end_ms in self._pieces_between(from_ms, to_ms):
            cubic = piece.cubics[index]
            turning = (t for t in turning_points(cubic) if begin_ms < t < end_ms)
            values += [position_at(cubic, t) for t in (begin_ms, end_ms, *turning)]
        return min(values), max(values)

    def peaks(self, index: int, from_ms: float, to_ms: float) -> Peaks:
        """Return the greatest velocity, acceleration and jerk of a motor between two instants."""
        velocity = acceleration = jerk = jump = 0.0
        before = self._acceleration_before(index, from_ms)
        for piece, begin_ms, end_ms in self._pieces_between(from_ms, to_ms):
            cubic = piece.cubics[index]
            velocity = max(velocity, *(abs(velocity_at(cubic, t)) for t in _fastest(cubic, begin_ms, end_ms)))
            first, last = acceleration_at(cubic, begin_ms), acceleration_at(cubic, end_ms)
            acceleration = max(acceleration, abs(first), abs(last))
            jerk = max(jerk, 6.0 * abs(cubic[3]))
            jump = max(jump, abs(first - before))
            before = last
        if to_ms >= self.ends_ms:
            jump = max(jump, abs(before))
        jumps = jump > max(_SAME * acceleration, NOTHING)
        return Peaks(velocity=velocity, acceleration=acceleration, jerk=None if jumps else jerk)

    def _acceleration_before(self, index: int, instant_ms: float) -> float:
        """Return the acceleration just before an instant; before the start there was rest."""
        place = bisect_left(self.begins_ms, instant_ms) - 1
        if place < 0:
            return 0.0
        piece = self.pieces[place]
        return acceleration_at(piece.cubics[index], min(instant_ms - self.begins_ms[place], piece.duration_ms))

    def _place(self, instant_ms: float) -> int:
        return max(0, bisect_right(self.begins_ms, instant_ms) - 1)

    def _pieces_between(self, from_ms: float, to_ms: float) -> Iterator[tuple[Piece, float, float]]:
        """Yield the pieces that touch a stretch, each with the part of it that lies inside, from its own start."""
        for place in range(self._place(from_ms), len(self.pieces)):
            piece, begins_ms = self.pieces[place], self.begins_ms[place]
            if begins_ms >= to_ms:
                return
            begin_ms, end_ms = max(from_ms - begins_ms, 0.0), min(to_ms - begins_ms, piece.duration_ms)
            if end_ms > begin_ms:
                yield piece, begin_ms, end_ms


def acceleration_at(cubic: Cubic, t_ms: float) -> float:
    """Return the acceleration in counts/ms^2, `t_ms` after the start of the piece."""
    return 6.0 * cubic[3] * t_ms + 2.0 * cubic[2]


def turning_points(cubic: Cubic) -> tuple[float, ...]:
    """Return the instants, inside the piece or not, at which the velocity is zero."""
    _, c1, c2, c3 = cubic
    if c3 == 0.0:
        return (-c1 / (2.0 * c2),) if c2 else ()
    discriminant = c2 * c2 - 3.0 * c1 * c3
    if discriminant < 0.0:
        return ()
    root = discriminant**0.5
    return ((-c2 + root) / (3.0 * c3), (-c2 - root) / (3.0 * c3))


def _fastest(cubic: Cubic, begin_ms: float, end_ms: float) -> tuple[float, ...]:
    """Return the instants at which a cubic can be fastest: its ends, and where the acceleration is zero."""
    _, _, c2, c3 = cubic
    instant = -c2 / (3.0 * c3) if c3 else begin_ms
    return (begin_ms, end_ms, instant) if begin_ms < instant < end_ms else (begin_ms, end_ms)


class ProgramStep(NamedTuple):
    """One request of a program with its motion, from `begins_ms` to `ends_ms`; the motors are then `at` (counts).

    `line` is that of `program`, `main_line` that of the program that was started, which may have called it.
    `by_move_time`: TM, not F, was modal; `segment_ms` is I13 at that time. `place` is `ProgramRun.place` after the
    request.
    """

    program: int
    line: int
    main_line: int
    place: tuple[int, ...]
    request: Request
    by_move_time: bool
    planned: PlannedPieces
    segment_ms: float
    begins_ms: float
    ends_ms: float
    at: Vector

    def ramp_begins_ms(self) -> float:
        """Return when the ramp into the move begins: the next move is calculated there. Without one, the end."""
        instant_ms = self.begins_ms
        for piece in self.planned.pieces:
            if piece.calculates:
                break
            instant_ms += piece.duration_ms
        return instant_ms


def same_motion(one: Sequence[ProgramStep], other: Sequence[ProgramStep]) -> bool:
    """Return whether two stretches come from the same lines and move alike, wherever they begin."""
    if [(step.program, step.line) for step in one] != [(step.program, step.line) for step in other]:
        return False
    first, second = ([piece for step in steps for piece in step.planned.pieces] for steps in (one, other))
    return len(first) == len(second) and all(map(_is_same_cubic, first, second))


def _is_same_cubic(one: Piece, other: Piece) -> bool:
    time_ms = one.duration_ms
    if abs(time_ms - other.duration_ms) > SAME_COUNTS * time_ms:
        return False
    # Scale each coefficient to its effect over the time of the piece, in counts.
    powers = (time_ms, time_ms**2, time_ms**3)
    return all(
        abs(a - b) * power <= SAME_COUNTS * max(1.0, abs(a) * power)
        for first, second in zip(one.cubics, other.cubics, strict=True)
        for a, b, power in zip(first[1:], second[1:], powers, strict=True)
    )
