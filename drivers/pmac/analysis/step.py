"""One step of a walk through a program: what it asked for, and the motion that this gave."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from drivers.pmac.requests import Request
from drivers.pmac.trajectory.pieces import Piece, Vector
from drivers.pmac.trajectory.planned import Planned

SAME_COUNTS = 1e-6
"""Motions that differ by less are the same but for rounding."""


class Step(NamedTuple):
    """One request of a program with its motion, from `begins_ms` to `ends_ms`; the motors are then `at` (counts).

    `line` is that of `program`, `main_line` that of the program that was started, which may have called it.
    `by_move_time` says whether TM, and not F, was in force, `segment_ms` is I13 as it then was. `place` is
    `ProgramRun.place` behind the request.
    """

    program: int
    line: int
    main_line: int
    place: tuple[int, ...]
    request: Request
    planned: Planned
    by_move_time: bool
    segment_ms: float
    begins_ms: float
    ends_ms: float
    at: Vector


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
    # Each coefficient by what it does in the time of the piece, in counts.
    powers = (time_ms, time_ms**2, time_ms**3)
    return all(
        abs(a - b) * power <= SAME_COUNTS * max(1.0, abs(a) * power)
        for first, second in zip(one.cubics, other.cubics, strict=True)
        for a, b, power in zip(first[1:], second[1:], powers, strict=True)
    )
