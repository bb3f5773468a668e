"""Blended moves along a curve: an arc, and the ramps between arcs and straight moves.

As in a LINEAR blend, every move runs along its own path with a speed that rises in the ramp into it and falls in
the ramp out of it, and the displacements of two moves in a ramp are added. The motion is cut into cubics of at
most the segmentation time, exact in position and velocity where they meet. Between two straight moves the same
rule gives `linear.lay`, which needs no segmentation and is used there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from drivers.pmac.trajectory.circle import Arc
from drivers.pmac.trajectory.linear import (
    Blend,
    Limits,
    LinearMove,
    Timing,
    effective_timing,
    lay,
    room_for_ramp,
    stop,
    stopping,
)
from drivers.pmac.trajectory.pieces import Piece, Vector, constant, hermite

MOST_CUTS = 4096
"""Maximum number of cubics in one stretch; a turn in so many is exact to the last digit, however long it takes."""

SLIVER_MS = 1e-9  # Instants this close to each other are one: a cubic between them would be all rounding
State = tuple[Vector, Vector]  # Position (counts) and velocity (counts/ms)


@dataclass(frozen=True, slots=True)
class StraightMove:
    """A move at one velocity, counts/ms."""

    velocity: Vector

    def state_after(self, elapsed_ms: float) -> State:
        """Return the displacement from the start of the move, by its own time, and the velocity."""
        return tuple(v * elapsed_ms for v in self.velocity), self.velocity

    def before_end(self, left_ms: float) -> State:
        """Return the displacement from the end of the move (negative), and the velocity."""
        return tuple(-v * left_ms for v in self.velocity), self.velocity


@dataclass(frozen=True, slots=True)
class ArcMove:
    """A move along an arc in a given time, to be cut into segments."""

    arc: Arc
    tm_ms: float
    segment_ms: float

    def state_after(self, elapsed_ms: float) -> State:
        """Return the displacement from the start of the move, by its own time, and the velocity."""
        fraction = elapsed_ms / self.tm_ms
        return self.arc.displacement(fraction), tuple(s / self.tm_ms for s in self.arc.slope(fraction))

    def before_end(self, left_ms: float) -> State:
        """Return the displacement from the end of the move (negative), and the velocity."""
        way, velocity = self.state_after(self.tm_ms - left_ms)
        return tuple(w - e for w, e in zip(way, self.arc.displacement(1.0), strict=True)), velocity


Course = StraightMove | ArcMove


@dataclass(frozen=True, slots=True, kw_only=True)
class CurvedBlend(Blend):
    """A blend whose newest move is along a curve; `velocity` is that at its end."""

    curve: ArcMove


def lay_course(
    blend: Blend, move: LinearMove, arc: Arc | None, limits: Limits, segment_ms: float
) -> tuple[tuple[Piece, ...], Blend, Timing]:
    """Blend into a move: return the pieces, the new state and the timing used.

    Without an `arc` the move is straight; an arc is cut into `segment_ms`, above 0.
    """
    if arc is None and not isinstance(blend, CurvedBlend):
        return lay(blend, move, limits)
    timing = effective_timing(move, blend.velocity, limits)
    ta_ms, ts_ms = room_for_ramp(blend, timing.ta_ms, timing.ts_ms)
    target = tuple(t + d for t, d in zip(blend.target, move.distance, strict=True))
    room_ms = timing.tm_ms - 0.5 * ta_ms
    after: Blend
    if arc is None:
        velocity = tuple(distance / timing.tm_ms for distance in move.distance)
        course: Course = StraightMove(velocity)
        after = Blend(target=target, velocity=velocity, room_ms=room_ms, at_rest=False)
    else:
        course = ArcMove(arc, timing.tm_ms, segment_ms)
        _, velocity = course.before_end(0.0)
        after = CurvedBlend(target=target, velocity=velocity, room_ms=room_ms, at_rest=False, curve=course)
    pieces = _change_course(blend, course, ta_ms, ts_ms)
    return pieces, after, Timing(ta_ms=ta_ms, ts_ms=ts_ms, tm_ms=timing.tm_ms)


def stop_course(blend: Blend, ta_ms: float, ts_ms: float, limits: Limits) -> tuple[Piece, ...]:
    """Come to rest at the end of a straight move or a curve with the modal TA and TS."""
    if not isinstance(blend, CurvedBlend):
        return stop(blend, ta_ms, ts_ms, limits)
    still, ta_ms, ts_ms = stopping(blend, ta_ms, ts_ms, limits)
    return _change_course(blend, StraightMove(still), ta_ms, ts_ms, calculates=False)


def _change_course(
    blend: Blend, new: Course, ta_ms: float, ts_ms: float, calculates: bool = True
) -> tuple[Piece, ...]:
    """Continue to half a ramp before the boundary, then ramp; from rest the ramp begins at once."""
    old = blend.curve if isinstance(blend, CurvedBlend) else StraightMove(blend.velocity)

    def running(elapsed_ms: float) -> State:
        way, velocity = old.before_end(blend.room_ms - elapsed_ms)
        return _sum(blend.target, way), velocity

    def turning(elapsed_ms: float) -> State:
        gone_ms, fraction = _ramp_progress(elapsed_ms, ta_ms, ts_ms)
        way_out, before = old.before_end(0.5 * ta_ms - elapsed_ms + gone_ms)
        way_in, after = new.state_after(gone_ms)
        velocity = tuple((1.0 - fraction) * b + fraction * a for b, a in zip(before, after, strict=True))
        return _sum(_sum(blend.target, way_out), way_in), velocity

    segment_ms = min(course.segment_ms for course in (old, new) if isinstance(course, ArcMove))
    run_ms = 0.0 if blend.at_rest else blend.room_ms - 0.5 * ta_ms
    pieces: tuple[Piece, ...] = ()
    if run_ms > 0.0 and (isinstance(old, StraightMove) or run_ms < SLIVER_MS):
        pieces = (constant(*running(0.0), run_ms),)
    elif run_ms > 0.0:
        pieces = _cut_motion(running, (0.0, run_ms), segment_ms, calculates=False)
    phases = (0.0, *(mark for mark in (ts_ms, ta_ms - ts_ms) if SLIVER_MS < mark < ta_ms - SLIVER_MS), ta_ms)
    return pieces + _cut_motion(turning, phases, segment_ms, calculates=calculates)


def _ramp_progress(elapsed_ms: float, ta_ms: float, ts_ms: float) -> tuple[float, float]:
    """Return the progress of a ramp: the time gained by the rising move, ms, and its fraction of its speed."""
    if elapsed_ms > 0.5 * ta_ms:
        gone_ms, fraction = _ramp_progress(ta_ms - elapsed_ms, ta_ms, ts_ms)
        return elapsed_ms - 0.5 * ta_ms + gone_ms, 1.0 - fraction
    peak = 1.0 / (ta_ms - ts_ms)
    if elapsed_ms < ts_ms:
        fraction = 0.5 * peak * elapsed_ms * elapsed_ms / ts_ms
        return fraction * elapsed_ms / 3.0, fraction
    linear_ms = elapsed_ms - ts_ms
    fraction = peak * (0.5 * ts_ms + linear_ms)
    return peak * (ts_ms * ts_ms / 6.0 + 0.5 * linear_ms * (ts_ms + linear_ms)), fraction


def _cut_motion(
    motion: Callable[[float], State], marks: Sequence[float], segment_ms: float, calculates: bool
) -> tuple[Piece, ...]:
    """Return cubics between instants at most `segment_ms` apart, the marks among them."""
    times = [marks[0]]
    for before, after in pairwise(marks):
        if after - before <= SLIVER_MS:
            continue
        count = math.ceil(min(MOST_CUTS, (after - before) / segment_ms))
        times += [before + (after - before) * k / count for k in range(1, count + 1)]
    states = [motion(instant) for instant in times]
    return tuple(
        hermite(*states[k], *states[k + 1], times[k + 1] - times[k], calculates=calculates and k == 0)
        for k in range(len(times) - 1)
    )


def _sum(a: Vector, b: Vector) -> Vector:
    return tuple(p + q for p, q in zip(a, b, strict=True))
