"""LINEAR blended moves: the rules of TA, TS, TM, Ix16 and Ix17, and the resulting ramps.

Pure and incremental: a `Blend` holds the state of the planned motion, `lay` adds one move and `stop` ends the
sequence. Sources: PMAC User Manual, motion trajectories; Software Reference, TA, TS, TM, Ix16, Ix17; Quick
Reference, formula for the limited blend. The numbers of the rules are those of docs/pmac-emulation.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.trajectory.pieces import Piece, Vector, constant, ramp

MOVE_TIME_MAX_MS = 8_388_607.0
"""Longest LINEAR move (rule 6); a feedrate move that would take longer is done in this time."""


class NoAccelerationTimeError(PmacError):
    """TA and TS of a move or a stop are both zero, which the controller cannot divide by (rule 5)."""

    def __init__(self) -> None:
        super().__init__(ErrorCode.DATA_ERROR, "TA and TS are both zero")


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Ix16 (counts/ms) and Ix17 (counts/ms^2) for each motor; 0 is no limit."""

    velocity: Vector
    acceleration: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearMove:
    """One commanded move: distance in counts for each motor, and the modal times, as commanded."""

    distance: Vector
    ta_ms: float
    ts_ms: float
    tm_ms: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """The actual times that the controller derives from the commanded ones."""

    ta_ms: float
    ts_ms: float
    tm_ms: float


@lru_cache(maxsize=64)
def timing_of(ta_ms: float, ts_ms: float, tm_ms: float) -> Timing:
    """Return a timing: thousands of moves of a program have the same one."""
    return Timing(ta_ms=ta_ms, ts_ms=ts_ms, tm_ms=tm_ms)


@dataclass(frozen=True, slots=True, kw_only=True)
class Blend:
    """The end of the planned trajectory: inside the newest move, just after the ramp into it.

    `target` is the nominal end of that move, `room_ms` the time left until then; at rest the velocity is
    zero, the target is the position and there is no limit to the next ramp.
    """

    target: Vector
    velocity: Vector
    room_ms: float
    at_rest: bool


def at_rest(position: Vector) -> Blend:
    """Return the state of motors at rest at `position` (counts)."""
    return Blend(target=position, velocity=(0.0,) * len(position), room_ms=0.0, at_rest=True)


def effective_timing(move: LinearMove, before: Vector, limits: Limits) -> Timing:
    """Apply rules 1, 2, 5, 6 with Ix16 and Ix17 to a move that follows velocity `before` (counts/ms)."""
    ta_ms = max(move.ta_ms, 2.0 * move.ts_ms)  # rule 1
    if ta_ms <= 0.0:
        raise NoAccelerationTimeError
    tm_ms = move.tm_ms
    for at, distance in enumerate(move.distance):
        limit = limits.velocity[at]
        if limit > 0.0:
            tm_ms = max(tm_ms, abs(distance) / limit)  # Ix16: all axes slow together
    tm_ms = min(tm_ms, MOVE_TIME_MAX_MS)  # rule 6
    nominal_ms = max(tm_ms, ta_ms)
    for at, distance in enumerate(move.distance):
        was, limit = before[at], limits.acceleration[at]
        if limit > 0.0:
            # Ix17 limits the change into this move, and the stop that may follow it.
            velocity = distance / nominal_ms
            change = max(abs(velocity - was), abs(velocity))
            # A ramp is steepest in its middle: change / (TA - TS).
            ta_ms = max(ta_ms, min(change / limit + move.ts_ms, MOVE_TIME_MAX_MS))
    return timing_of(ta_ms, move.ts_ms, max(tm_ms, ta_ms))  # rule 2


def lay(blend: Blend, move: LinearMove, limits: Limits) -> tuple[tuple[Piece, ...], Blend, Timing]:
    """Blend into `move`: return the pieces up to the end of that ramp, the new state and the timing used."""
    timing = effective_timing(move, blend.velocity, limits)
    velocity = tuple([distance / timing.tm_ms for distance in move.distance])
    ta_ms, ts_ms = room_for_ramp(blend, timing.ta_ms, timing.ts_ms)
    pieces = _change_velocity(blend, velocity, ta_ms, ts_ms)
    after = Blend(
        target=tuple([blend.target[at] + move.distance[at] for at in range(len(velocity))]),
        velocity=velocity,
        room_ms=timing.tm_ms - 0.5 * ta_ms,  # TM counts between the middles of the two ramps
        at_rest=False,
    )
    return pieces, after, timing_of(ta_ms, ts_ms, timing.tm_ms)


def room_for_ramp(blend: Blend, ta_ms: float, ts_ms: float) -> tuple[float, float]:
    """Rule 3: two ramps, each centred on its boundary, must not overlap inside the move between them."""
    if not blend.at_rest:
        ta_ms = min(ta_ms, 2.0 * blend.room_ms)
    return ta_ms, min(ts_ms, 0.5 * ta_ms)


def stop(blend: Blend, ta_ms: float, ts_ms: float, limits: Limits) -> tuple[Piece, ...]:
    """Come to rest at the target with the modal TA and TS (rule 8); nothing when already at rest."""
    if blend.at_rest:
        return ()
    still, ta_ms, ts_ms = stopping(blend, ta_ms, ts_ms, limits)
    return _change_velocity(blend, still, ta_ms, ts_ms, calculates=False)


def stopping(blend: Blend, ta_ms: float, ts_ms: float, limits: Limits) -> tuple[Vector, float, float]:
    """Return the velocity of rest, and the actual times of the ramp to it."""
    still = (0.0,) * len(blend.velocity)
    move = LinearMove(distance=still, ta_ms=ta_ms, ts_ms=ts_ms, tm_ms=0.0)
    timing = effective_timing(move, blend.velocity, limits)
    return still, *room_for_ramp(blend, timing.ta_ms, timing.ts_ms)


def _change_velocity(
    blend: Blend, velocity: Vector, ta_ms: float, ts_ms: float, calculates: bool = True
) -> tuple[Piece, ...]:
    """Continue to half a ramp before the boundary, then ramp; from rest the ramp begins at once."""
    if blend.at_rest:
        return ramp(blend.target, blend.velocity, velocity, ta_ms, ts_ms)
    half_ms = 0.5 * ta_ms
    run_ms = blend.room_ms - half_ms
    target, before = blend.target, blend.velocity
    start = tuple([target[at] - before[at] * half_ms for at in range(len(target))])
    ramps = ramp(start, before, velocity, ta_ms, ts_ms, calculates)
    if run_ms <= 0.0:
        return ramps
    run = constant(tuple([target[at] - before[at] * blend.room_ms for at in range(len(target))]), before, run_ms)
    return (run, *ramps)
