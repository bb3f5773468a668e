"""Trajectories as cubic pieces: the building blocks of every PMAC move mode.

Positions are motor counts, times ms. A piece holds one cubic for each motor that moves together.
"""

from __future__ import annotations

from typing import NamedTuple

from drivers.pmac.requests import DeferredValue

Vector = tuple[float, ...]  # One number for each motor of a coordinate system, in its fixed order
Cubic = tuple[float, float, float, float]  # p(t) = c0 + c1 t + c2 t^2 + c3 t^3; counts and ms


class Piece(NamedTuple):  # a tuple is created three times as fast, and a program makes thousands
    """`duration_ms` of motion; `calculates` marks the instant at which the next move is calculated.

    A piece in `real_time` (a DWELL) runs at the servo clock rate whatever the time base is. `deferred` are the
    assignments that take effect when it begins.
    """

    duration_ms: float
    cubics: tuple[Cubic, ...]
    calculates: bool = False
    real_time: bool = False
    deferred: tuple[DeferredValue, ...] = ()


def position_at(cubic: Cubic, t_ms: float) -> float:
    """Return the position in counts, `t_ms` after the start of the piece."""
    c0, c1, c2, c3 = cubic
    return ((c3 * t_ms + c2) * t_ms + c1) * t_ms + c0


def velocity_at(cubic: Cubic, t_ms: float) -> float:
    """Return the velocity in counts/ms, `t_ms` after the start of the piece."""
    _, c1, c2, c3 = cubic
    return (3.0 * c3 * t_ms + 2.0 * c2) * t_ms + c1


def constant(position: Vector, velocity: Vector, duration_ms: float) -> Piece:
    """Return motion at constant velocity (counts/ms) from `position`."""
    return Piece(duration_ms, tuple([(position[at], velocity[at], 0.0, 0.0) for at in range(len(position))]))


def ramp(
    start: Vector, before: Vector, after: Vector, ta_ms: float, ts_ms: float, calculates: bool = True
) -> tuple[Piece, ...]:
    """Change velocity from `before` to `after` (counts/ms) in `ta_ms`, with S-curves of `ts_ms` at each end.

    The acceleration rises from zero to its peak (after - before)/(ta - ts) over `ts_ms`, is constant, and
    falls to zero over `ts_ms` (PMAC Software Reference, TS). Needs 0 <= 2 ts <= ta and ta > 0. The first
    piece is marked as the one at which the next move is calculated, unless `calculates` is False.
    """
    count, span_ms = len(start), ta_ms - ts_ms
    peak = [(after[at] - before[at]) / span_ms for at in range(count)]
    none = [0.0] * count
    jerk = [a / ts_ms for a in peak] if ts_ms > 0.0 else none
    phases = ((ts_ms, none, jerk), (ta_ms - 2.0 * ts_ms, peak, none), (ts_ms, peak, [-j for j in jerk]))
    pieces: list[Piece] = []
    position, velocity = list(start), list(before)
    for duration_ms, acceleration, slope in phases:
        if duration_ms <= 0.0:
            continue
        cubics = _phase(position, velocity, acceleration, slope, duration_ms)
        pieces.append(Piece(duration_ms, cubics, calculates and not pieces))
    return tuple(pieces)


def _phase(
    position: list[float], velocity: list[float], acceleration: list[float], jerk: list[float], duration_ms: float
) -> tuple[Cubic, ...]:
    """Return the motion of a phase, and let the motors be at its end."""
    cubics: list[Cubic] = []
    for at in range(len(position)):
        # As `position_at` and `velocity_at`, written out: a ramp of three motors has nine of them.
        c0, c1, c2, c3 = position[at], velocity[at], acceleration[at] / 2.0, jerk[at] / 6.0
        cubics.append((c0, c1, c2, c3))
        position[at] = ((c3 * duration_ms + c2) * duration_ms + c1) * duration_ms + c0
        velocity[at] = (3.0 * c3 * duration_ms + 2.0 * c2) * duration_ms + c1
    return tuple(cubics)


def hermite(
    start: Vector, before: Vector, end: Vector, after: Vector, duration_ms: float, calculates: bool = True
) -> Piece:
    """Return the cubic through both positions (counts) with both velocities (counts/ms): a PVT segment."""
    square = duration_ms * duration_ms
    cubics: list[Cubic] = []
    for at in range(len(start)):
        p0, v0, p1, v1 = start[at], before[at], end[at], after[at]
        slope = (p1 - p0) / duration_ms
        cubics.append((p0, v0, (3.0 * slope - 2.0 * v0 - v1) / duration_ms, (v0 + v1 - 2.0 * slope) / square))
    return Piece(duration_ms, tuple(cubics), calculates)
