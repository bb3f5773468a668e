"""Trajectories as cubic pieces: the building blocks of every PMAC move mode.

Positions are motor counts, times ms. A piece holds one cubic for each motor that moves together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drivers.pmac.requests import Deferred

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
    deferred: tuple[Deferred, ...] = ()


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
    return Piece(duration_ms, tuple([(p, v, 0.0, 0.0) for p, v in zip(position, velocity, strict=True)]))


def ramp(
    start: Vector, before: Vector, after: Vector, ta_ms: float, ts_ms: float, calculates: bool = True
) -> tuple[Piece, ...]:
    """Change velocity from `before` to `after` (counts/ms) in `ta_ms`, with S-curves of `ts_ms` at each end.

    The acceleration rises from zero to its peak (after - before)/(ta - ts) over `ts_ms`, is constant, and
    falls to zero over `ts_ms` (PMAC Software Reference, TS). Needs 0 <= 2 ts <= ta and ta > 0. The first
    piece is marked as the one at which the next move is calculated, unless `calculates` is False.
    """
    peak = [(b - a) / (ta_ms - ts_ms) for a, b in zip(before, after, strict=True)]
    none = [0.0] * len(peak)
    jerk = [a / ts_ms for a in peak] if ts_ms > 0.0 else none
    plateau_ms = ta_ms - 2.0 * ts_ms
    phases = ((ts_ms, none, jerk), (plateau_ms, peak, none), (ts_ms, peak, [-j for j in jerk]))
    pieces: list[Piece] = []
    position, velocity = start, before
    for duration_ms, acceleration, slope in phases:
        if duration_ms <= 0.0:
            continue
        states = zip(position, velocity, acceleration, slope, strict=True)
        cubics = tuple([(p, v, a / 2.0, j / 6.0) for p, v, a, j in states])
        pieces.append(Piece(duration_ms, cubics, calculates=calculates and not pieces))
        position = tuple([position_at(cubic, duration_ms) for cubic in cubics])
        velocity = tuple([velocity_at(cubic, duration_ms) for cubic in cubics])
    return tuple(pieces)


def hermite(
    start: Vector, before: Vector, end: Vector, after: Vector, duration_ms: float, calculates: bool = True
) -> Piece:
    """Return the cubic through both positions (counts) with both velocities (counts/ms): a PVT segment."""
    square = duration_ms * duration_ms
    cubics = []
    for p0, v0, p1, v1 in zip(start, before, end, after, strict=True):
        slope = (p1 - p0) / duration_ms
        cubics.append((p0, v0, (3.0 * slope - 2.0 * v0 - v1) / duration_ms, (v0 + v1 - 2.0 * slope) / square))
    return Piece(duration_ms, tuple(cubics), calculates=calculates)


Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """The cubics of one motor, coefficients of shape (4, n), and the duration of each, ms, of shape (n,)."""

    cubics: Floats
    duration_ms: Floats

    def at(self, t_ms: Floats) -> Floats:
        """Return the positions at these times after the start of each cubic, counts."""
        c0, c1, c2, c3 = self.cubics
        return np.asarray(((c3 * t_ms + c2) * t_ms + c1) * t_ms + c0, dtype=np.float64)

    def extent(self) -> tuple[float, float]:
        """Return the lowest and highest position: at an end, or where the velocity passes zero; counts."""
        _, c1, c2, c3 = self.cubics
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(c2 * c2 - 3.0 * c1 * c3)
            cubic = ((-c2 + root) / (3.0 * c3), (-c2 - root) / (3.0 * c3))
            instants = [np.where(c3 == 0.0, -c1 / (2.0 * c2), each) for each in cubic]
        places = [self.at(self._within(each)) for each in (*instants, self.duration_ms)]
        places.append(self.cubics[0])
        return float(np.min(places)), float(np.max(places))

    def peak_velocity(self) -> float:
        """Return the greatest speed: at an end, or where the acceleration passes zero; counts/ms."""
        _, c1, c2, c3 = self.cubics
        with np.errstate(divide="ignore", invalid="ignore"):
            instant = self._within(-c2 / (3.0 * c3))
        instants = np.array([np.zeros_like(instant), instant, self.duration_ms])
        return float(np.max(np.abs((3.0 * c3 * instants + 2.0 * c2) * instants + c1)))

    def _within(self, t_ms: Floats) -> Floats:
        """Return instants, or the start of the cubic for one that is outside it, or nan."""
        return np.where((t_ms >= 0.0) & (t_ms <= self.duration_ms), t_ms, 0.0)


def motion_of(pieces: Sequence[Piece], index: int) -> Motion:
    """Return the motion of one motor over some pieces."""
    return Motion(
        cubics=np.array([piece.cubics[index] for piece in pieces]).T,
        duration_ms=np.array([piece.duration_ms for piece in pieces]),
    )


def shifted(cubic: Floats, by_ms: Floats) -> Floats:
    """Return cubics, shape (4, n), with their time counted from `by_ms` on."""
    c0, c1, c2, c3 = cubic
    return np.array(
        [
            ((c3 * by_ms + c2) * by_ms + c1) * by_ms + c0,
            c1 + (2.0 * c2 + 3.0 * c3 * by_ms) * by_ms,
            c2 + 3.0 * c3 * by_ms,
            c3,
        ]
    )


def between(start: Floats, before: Floats, end: Floats, after: Floats, duration_ms: Floats) -> Floats:
    """Return the cubics, shape (4, n), through both values with both slopes."""
    slope = (end - start) / duration_ms
    c2 = (3.0 * slope - 2.0 * before - after) / duration_ms
    c3 = (before + after - 2.0 * slope) / duration_ms**2
    return np.array([start, before, c2, c3])
