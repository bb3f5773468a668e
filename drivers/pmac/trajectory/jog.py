"""Jogs (Ix19 to Ix22) as cubic pieces, and RAPID moves, which jog every motor of a line. Units: ms, counts.

Source of RAPID: PMAC User Manual and Turbo User Manual, rapid-mode moves. The times are made equal before
acceleration is added, so that motors with different Ix19 to Ix21 finish at different times. With Ix20 and Ix21
both zero, NoAccelerationTimeError is raised.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

from drivers.pmac.trajectory.linear import Limits, LinearMove, at_rest, effective_timing, lay, stop
from drivers.pmac.trajectory.pieces import Cubic, Piece, Vector, position_at, ramp, velocity_at
from drivers.pmac.variables import VariableStore

SHORTEST_RAMP_MS = 1.0  # Minimum acceleration time, used when both acceleration times are zero
SLIVER_MS = 1e-9  # Ends of pieces this close to each other are one


@dataclass(frozen=True, slots=True, kw_only=True)
class JogSettings:
    """Ix19 maximum acceleration (counts/ms^2, 0 no limit), Ix20 and Ix21 times (ms), Ix22 speed (counts/ms)."""

    acceleration: float
    ta_ms: float
    ts_ms: float
    speed: float


def change_speed(position: float, before: float, after: float, settings: JogSettings) -> tuple[Piece, ...]:
    """Change velocity from `before` to `after` (counts/ms); used to start and to stop an indefinite jog."""
    timing = effective_timing(
        LinearMove(distance=(0.0,), ta_ms=settings.ta_ms, ts_ms=settings.ts_ms, tm_ms=0.0),
        (before - after,),
        Limits(velocity=(0.0,), acceleration=(settings.acceleration,)),
    )
    return ramp((position,), (before,), (after,), timing.ta_ms, timing.ts_ms)


def jog_to(position: float, target: float, settings: JogSettings) -> tuple[Piece, ...]:
    """Move from rest at `position` to rest at `target`.

    A jog is one unblended move at Ix22 whose acceleration time is lengthened where Ix19 requires it; a short one
    takes the acceleration time and stays slower.
    """
    return jog_in(position, target, settings, jog_time_ms(target - position, settings))


def jog_time_ms(distance: float, settings: JogSettings) -> float:
    """Return the duration of a jog before its acceleration is added, ms."""
    return abs(distance) / settings.speed if settings.speed > 0.0 else 0.0


def jog_in(position: float, target: float, settings: JogSettings, tm_ms: float) -> tuple[Piece, ...]:
    """Jog in a given time to which the acceleration is added, instead of at Ix22."""
    if target == position:
        return ()
    limits = Limits(velocity=(0.0,), acceleration=(settings.acceleration,))
    move = LinearMove(distance=(target - position,), ta_ms=settings.ta_ms, ts_ms=settings.ts_ms, tm_ms=tm_ms)
    pieces, blend, timing = lay(at_rest((position,)), move, limits)
    return pieces + stop(blend, timing.ta_ms, timing.ts_ms, limits)


def decelerate(position: float, velocity: float, rate: float) -> tuple[Piece, ...]:
    """Come to rest at `rate` (Ix15, counts/ms^2). A rate of 0 never stops the motor: it keeps moving for ever."""
    if velocity == 0.0:
        return ()
    if rate <= 0.0:  # as on the controller, where 0 is no rate; commissioning refuses such an Ix15
        return (Piece(float("inf"), ((position, velocity, 0.0, 0.0),)),)
    return ramp((position,), (velocity,), (0.0,), abs(velocity) / rate, 0.0)


def jog_settings(variables: VariableStore, motor: int, speed: int = 22) -> JogSettings:
    """Return the I-variable settings for a jog of a motor, at Ix22 or the variable `speed`.

    Ix20 and Ix21 are whole ms; both 0 count as 1 ms, where the controller would divide by zero.
    """
    ta_ms, ts_ms = (float(max(0, math.floor(variables.motor(motor, number) + 0.5))) for number in (20, 21))
    return JogSettings(
        acceleration=variables.motor(motor, 19),
        ta_ms=ta_ms or (0.0 if ts_ms else SHORTEST_RAMP_MS),
        ts_ms=ts_ms,
        speed=abs(variables.motor(motor, speed)),
    )


def rapid_time_ms(start: Vector, target: Vector, settings: Sequence[JogSettings]) -> float:
    """Return the time of the slowest motor, before acceleration is added."""
    return max(
        jog_time_ms(there - here, motor) for here, there, motor in zip(start, target, settings, strict=True)
    )


def rapid(start: Vector, target: Vector, settings: Sequence[JogSettings]) -> tuple[Piece, ...]:
    """Move from rest at `start` to rest at `target` (counts); a motor without a distance stands still."""
    tm_ms = rapid_time_ms(start, target, settings)
    tracks = [
        jog_in(here, there, motor, tm_ms) for here, there, motor in zip(start, target, settings, strict=True)
    ]
    return together(tracks, target)


def together(tracks: Sequence[Sequence[Piece]], rest: Vector) -> tuple[Piece, ...]:
    """Join tracks of one motor each, starting together, into pieces of all; a finished track stays at `rest`."""
    ends = sorted({end for track in tracks for end in accumulate(piece.duration_ms for piece in track)})
    times = [0.0]
    times += [end for end in ends if end - times[-1] > SLIVER_MS]
    return tuple(
        Piece(
            after - before,
            tuple(_cubic_at(track, before, still) for track, still in zip(tracks, rest, strict=True)),
        )
        for before, after in pairwise(times)
    )


def _cubic_at(track: Sequence[Piece], instant_ms: float, still: float) -> Cubic:
    """Return the active cubic at an instant, with its time counted from there."""
    begin_ms = 0.0
    for piece in track:
        end_ms = begin_ms + piece.duration_ms
        if end_ms - instant_ms > SLIVER_MS:
            return _shift_cubic(piece.cubics[0], instant_ms - begin_ms)
        begin_ms = end_ms
    return (still, 0.0, 0.0, 0.0)


def _shift_cubic(cubic: Cubic, t_ms: float) -> Cubic:
    """Return the same motion with its time counted from `t_ms` after its beginning."""
    _, _, c2, c3 = cubic
    return position_at(cubic, t_ms), velocity_at(cubic, t_ms), 3.0 * c3 * t_ms + c2, c3
