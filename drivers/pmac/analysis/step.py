"""One step of a walk through a program: its request, and the resulting motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from drivers.pmac.requests import Request
from drivers.pmac.trajectory.pieces import Piece, Vector
from drivers.pmac.trajectory.planned import Planned

SAME_COUNTS = 1e-6  # Motions that differ by less are the same within rounding


class Step(NamedTuple):
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
    planned: Planned
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


def same_motion(one: Sequence[Step], other: Sequence[Step]) -> bool:
    """Return whether two stretches come from the same lines and move alike, wherever they begin."""
    if [(step.program, step.line) for step in one] != [(step.program, step.line) for step in other]:
        return False
    first, second = ([piece for step in steps for piece in step.planned.pieces] for steps in (one, other))
    return len(first) == len(second) and all(map(_alike, first, second))


def _alike(one: Piece, other: Piece) -> bool:
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
