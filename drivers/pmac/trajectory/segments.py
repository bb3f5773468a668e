"""Motion of axes through the inverse kinematics: cut into segments, each a cubic for every motor.

At both ends of a segment the motors are where the inverse program puts them, at the velocity of the axes' path.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

from drivers.pmac.axes import AXIS_LETTERS, AxisDefinition
from drivers.pmac.trajectory.course import MOST_CUTS
from drivers.pmac.trajectory.linear import Limits
from drivers.pmac.trajectory.pieces import Piece, Vector, constant, hermite, position_at, velocity_at

SEGMENT_MS = 10.0  # of the last stop, where the setting is 0 by then
STEP_MS = 0.01  # along the path, to both sides, from which the velocity of a motor is taken
AXES_ALONE = tuple(
    AxisDefinition(motor=number, terms=((axis, 1.0),)) for number, axis in enumerate(AXIS_LETTERS, 1)
)
"""A motor for each axis, one count to a user unit: moves along the path of the axes are planned with them."""

STILL: Vector = tuple(0.0 for _ in AXES_ALONE)
NO_LIMITS = Limits(velocity=STILL, acceleration=STILL)

Solve = Callable[[Vector], Vector]
"""From axis positions, in the order of `AXIS_LETTERS`, to motor positions."""


def through_inverse(pieces: Iterable[Piece], segment_ms: float, solve: Solve) -> tuple[Piece, ...]:
    """Return the motion of motors for that of axes."""
    return tuple(part for piece in pieces for part in _cut(piece, segment_ms, solve))


def _cut(piece: Piece, segment_ms: float, solve: Solve) -> list[Piece]:
    if not any(any(cubic[1:]) for cubic in piece.cubics):
        here = solve(tuple(cubic[0] for cubic in piece.cubics))
        return [constant(here, tuple(0.0 for _ in here), piece.duration_ms)._replace(calculates=piece.calculates)]
    count = math.ceil(min(MOST_CUTS, piece.duration_ms / segment_ms)) or 1
    times = [piece.duration_ms * k / count for k in range(count + 1)]
    states = [_state(piece, instant, solve) for instant in times]
    return [
        hermite(*states[k], *states[k + 1], times[k + 1] - times[k], calculates=piece.calculates and k == 0)
        for k in range(count)
    ]


def _state(piece: Piece, instant_ms: float, solve: Solve) -> tuple[Vector, Vector]:
    """Return position and velocity of the motors; the last thing that is solved is where the axes are."""
    place = tuple(position_at(cubic, instant_ms) for cubic in piece.cubics)
    velocity = tuple(velocity_at(cubic, instant_ms) for cubic in piece.cubics)
    before = solve(tuple(p - STEP_MS * v for p, v in zip(place, velocity, strict=True)))
    after = solve(tuple(p + STEP_MS * v for p, v in zip(place, velocity, strict=True)))
    moving = tuple((a - b) / (2.0 * STEP_MS) for a, b in zip(after, before, strict=True))
    return solve(place), moving
