"""SPLINE1 and SPLINE2: cubic B-splines of the programmed points, one segment at a time.

Source: PMAC User Manual and Turbo User Manual, splined moves: at the end of segment i the commanded point is
(P(i-1) + 4 P(i) + P(i+1)) / 6, the velocity (P(i+1) - P(i-1)) / (2 T), a cubic joins them, and a segment of zero
distance is added at both ends. That is the uniform cubic B-spline; for unequal times the manuals only say that the
calculation is similar, and the non-uniform cubic B-spline is used, in which each distance is spread over its own
segment and its two neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.pmac.trajectory.pieces import Piece, Vector, hermite


@dataclass(frozen=True, slots=True, kw_only=True)
class Spline:
    """A spline planned up to `position` with `velocity`, where the segment to `point` begins.

    `distance` is that of the segment to `point`, `duration_ms` its time, `before_ms` that of the one before it.
    """

    uniform: bool
    point: Vector
    distance: Vector
    before_ms: float
    duration_ms: float
    position: Vector
    velocity: Vector

    def goes_on(self, duration_ms: float, uniform: bool) -> bool:
        """Whether a segment belongs to this spline; SPLINE1 begins again when its time changes."""
        return self.uniform == uniform and (duration_ms == self.duration_ms or not uniform)


def begin(start: Vector, duration_ms: float, uniform: bool) -> Spline:
    """Begin at rest: a segment of zero distance comes first, as long as the first programmed one."""
    still = tuple(0.0 for _ in start)
    first = {"before_ms": duration_ms, "duration_ms": duration_ms}
    return Spline(uniform=uniform, point=start, distance=still, position=start, velocity=still, **first)


def add(spline: Spline, target: Vector, duration_ms: float, next_ms: float) -> tuple[Piece, Spline]:
    """Add a segment to `target` that is followed by one of `next_ms`.

    Returns:
        The motion of the segment before it, which can now be played, and the extended spline.
    """
    distance = tuple(t - p for t, p in zip(target, spline.point, strict=True))
    here_ms = spline.duration_ms
    joint_ms = here_ms + duration_ms
    early = duration_ms / (joint_ms * (spline.before_ms + joint_ms))
    late = here_ms / (joint_ms * (joint_ms + next_ms))
    pairs = tuple(zip(spline.distance, distance, strict=True))
    velocity = tuple(3.0 * (early * before + late * after) for before, after in pairs)
    position = tuple(
        point - early * duration_ms * before + late * here_ms * after
        for point, (before, after) in zip(spline.point, pairs, strict=True)
    )
    piece = hermite(spline.position, spline.velocity, position, velocity, here_ms)
    longer = Spline(
        uniform=spline.uniform,
        point=target,
        distance=distance,
        before_ms=here_ms,
        duration_ms=duration_ms,
        position=position,
        velocity=velocity,
    )
    return piece, longer


def end(spline: Spline) -> tuple[Piece, ...]:
    """Come to rest at the last point: its segment, and one of zero distance and equal duration."""
    duration_ms = spline.duration_ms
    last, rest = add(spline, spline.point, duration_ms, duration_ms)
    still, _ = add(rest, spline.point, duration_ms, duration_ms)
    return last._replace(calculates=False), still._replace(calculates=False)
