"""Collisions on a lathe: the tool with a standing part, with too much of it, or with the jaws; and near misses.

After a collision the simulation continues as commanded. Damage is not simulated, only the collision reported.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from drivers.simulator.plant.workshop_view import CollisionKind
from profiles.job import Job

TOUCH_MM = 0.05  # depth of the tip in a standing part up to which it is a mere touch that marks, not a crash
CLEAR_MM = 0.005  # out of a surface by this much the tip no longer touches it
TOOL_TAKES_MM = 1.0  # permitted depth beyond the job's cut, on the radius: a choice, for finishing
MOST_FEED_MM_PER_TURN = 1.0  # largest feed of a job; a tool that enters material faster does not cut
STANDS_TURNS = 1e-5  # a spindle that turns less than this in a servo cycle stands: 1.4 rpm at 442 us


BACK_TURNS = 0.05  # permitted backward rotation in the cut: after a hard stop a servo comes back by 6 deg


@dataclass(frozen=True, slots=True, kw_only=True)
class Collision:
    """One collision at its start: radius and Z of the tool tip, the spindle from its index, simulated time."""

    kind: CollisionKind
    radius_mm: float
    z_mm: float
    angle_deg: float
    time_ms: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampedBlank:
    """A blank in the chuck. `deepest_mm` is the least radius that the tool may cut, `bore_mm` that of the wall."""

    radius_mm: float
    bore_mm: float
    deepest_mm: float
    free_end_mm: float


class Track(NamedTuple):  # created three times as fast, in every block
    """The path of the tip: radius, spindle turns since the index and Z, one servo cycle apart up to `end_ms`."""

    radius_mm: Sequence[float]
    turns: Sequence[float]
    z_mm: Sequence[float]
    end_ms: float
    cycle_ms: float


SurfaceAt = Callable[[float, float], float]  # the radius of the clamped surface at a place: spindle turns and Z


def clamp_job_blank(job: Job, jaw_face_mm: float) -> ClampedBlank:
    """Return the blank of a job, clamped before the jaw faces."""
    cut_mm = job.depth_of_cut_mm + job.lobe_amplitude_um / 1000.0
    return ClampedBlank(
        radius_mm=job.radius_mm,
        bore_mm=job.radius_mm - job.wall_thickness_mm,
        deepest_mm=job.radius_mm - cut_mm - TOOL_TAKES_MM,
        free_end_mm=jaw_face_mm - job.overhang_mm,
    )


def _kind_of(turned: float, back: float, fed_mm: float, infed_mm: float) -> CollisionKind | None:
    """Return the collision of such a motion in material, in a servo cycle; None for a cut.

    The spindle has `turned` in this cycle, and is `back` from its furthest position in this material.
    """
    pace = abs(turned)
    if pace < STANDS_TURNS:
        return CollisionKind.STANDING_PART
    if turned < 0.0 and back > BACK_TURNS:
        return CollisionKind.REVERSE
    if fed_mm > MOST_FEED_MM_PER_TURN * pace:
        return CollisionKind.END_FACE
    return CollisionKind.INFEED if infed_mm > max(TOOL_TAKES_MM * pace, 0.0) else None


class CollisionWatch:
    """Detects each kind of collision once, from the clamping of a blank to that of the next.

    Since power-up: `nearest_jaws_mm` is the least distance of the tip from the jaws, from a box about each block
    of its path, `contact_mm_per_s` the highest speed at which it met a part that stood; None where it never did.
    """

    def __init__(self, jaw_face_mm: float, jaw_outer_mm: float) -> None:
        self.found: tuple[Collision, ...] = ()
        self.nearest_jaws_mm: float | None = None
        self.contact_mm_per_s: float | None = None
        self._touches = False
        self._jaw_face_mm = jaw_face_mm
        self._jaw_outer_mm = jaw_outer_mm
        self._part: ClampedBlank | None = None
        self._surface_at: SurfaceAt = lambda turns, z_mm: 0.0
        self._before: tuple[float, float, float] | None = None  # turns, Z and radius of the last sample
        self._furthest: float | None = None  # turns, since the tip went into the part

    def clamp(self, part: ClampedBlank, surface_at: SurfaceAt) -> None:
        """Restart with a blank, whose surface is queried before a track has cut it."""
        self._part, self._surface_at, self.found = part, surface_at, ()

    def release(self) -> None:
        """Remove the part."""
        self._part = None

    def misses(self, least_mm: float, most_z_mm: float) -> bool:
        """Whether a tip that stays outside `least_mm` and before `most_z_mm` can meet neither part nor jaws."""
        before_mm, outside_mm = self._jaw_face_mm - most_z_mm, least_mm - self._jaw_outer_mm
        off_mm = (
            math.hypot(before_mm, outside_mm) if min(before_mm, outside_mm) > 0.0 else max(before_mm, outside_mm)
        )
        if self.nearest_jaws_mm is None or off_mm < self.nearest_jaws_mm:
            self.nearest_jaws_mm = off_mm
        if self._part is not None and least_mm < self._part.radius_mm:
            return False
        return most_z_mm <= self._jaw_face_mm or least_mm > self._jaw_outer_mm

    def pass_by(self, track: Track) -> None:
        """Note where a path has ended that misses everything."""
        self._furthest, self._touches = None, False
        self._before = (track.turns[-1], track.z_mm[-1], track.radius_mm[-1])

    def look(self, track: Track, *, at_end: bool = False) -> None:
        """Check a track, before it cuts; `at_end` is whether an axis is held by the end of its travel."""
        if at_end:
            self._report(CollisionKind.END_OF_TRAVEL, track, len(track.radius_mm) - 1)
        least_mm, part = min(track.radius_mm), self._part
        if max(track.z_mm) > self._jaw_face_mm and least_mm <= self._jaw_outer_mm:
            for at, (radius_mm, z_mm) in enumerate(zip(track.radius_mm, track.z_mm, strict=True)):
                if z_mm > self._jaw_face_mm and radius_mm <= self._jaw_outer_mm:
                    self._report(CollisionKind.JAWS, track, at)
                    break
        if part is not None and least_mm < part.radius_mm:
            self._note_contact(track, part)
        if part is not None and least_mm < part.radius_mm - TOUCH_MM:
            self._check_part(track, part)
        else:
            self._furthest = None
        self._before = (track.turns[-1], track.z_mm[-1], track.radius_mm[-1])

    def _note_contact(self, track: Track, part: ClampedBlank) -> None:
        """Note how fast the tip comes to a standing surface; in a turning part it is there already."""
        turns, z_mm = track.turns[-1], track.z_mm[-1]
        if abs(turns - track.turns[0]) > STANDS_TURNS * len(track.turns):
            self._touches = True
            return
        surface_mm = self._surface_at(turns, z_mm) if part.free_end_mm <= z_mm <= self._jaw_face_mm else 0.0
        before_mm = track.radius_mm[0] if self._before is None else self._before[2]
        for radius_mm in track.radius_mm:
            if radius_mm < surface_mm and not self._touches:
                self._touches = True
                speed = (before_mm - radius_mm) / track.cycle_ms * 1000.0
                self.contact_mm_per_s = max(speed, self.contact_mm_per_s or 0.0)
            elif radius_mm > surface_mm + CLEAR_MM:
                self._touches = False
            before_mm = radius_mm

    def _check_part(self, track: Track, part: ClampedBlank) -> None:
        """Check the cheap conditions first: in a cut, radius and feed decide all of them."""
        turns_before, z_before, radius_before = self._before or (track.turns[0], track.z_mm[0], track.radius_mm[0])
        surface_mm, end_mm, face_mm = part.radius_mm - TOUCH_MM, part.free_end_mm, self._jaw_face_mm
        shallow_mm = part.deepest_mm + TOOL_TAKES_MM - TOUCH_MM
        for at, (radius_mm, turns, z_mm) in enumerate(zip(track.radius_mm, track.turns, track.z_mm, strict=True)):
            turned, fed_mm, infed_mm = turns - turns_before, abs(z_mm - z_before), radius_before - radius_mm
            turns_before, z_before, radius_before = turns, z_mm, radius_mm
            if radius_mm >= surface_mm or not end_mm <= z_mm <= face_mm:
                self._furthest = None
                continue
            if self._furthest is None or turns > self._furthest:
                self._furthest = turns
            if radius_mm < part.bore_mm:
                self._report(CollisionKind.THROUGH_WALL, track, at)
            if radius_mm < part.deepest_mm:
                self._report(CollisionKind.TOO_DEEP, track, at)
            # Within the job's cut, or a touch deeper, any infeed is permitted.
            infed_mm = infed_mm if radius_mm < shallow_mm else 0.0
            kind = _kind_of(turned, self._furthest - turns, fed_mm, infed_mm)
            if kind is not None and not self._knows(kind):
                if radius_mm < self._surface_at(turns, z_mm) - TOUCH_MM:
                    self._report(kind, track, at)

    def _knows(self, kind: CollisionKind) -> bool:
        return any(collision.kind is kind for collision in self.found)

    def _report(self, kind: CollisionKind, track: Track, at: int) -> None:
        if self._knows(kind):
            return
        after = len(track.radius_mm) - 1 - at
        collision = Collision(
            kind=kind,
            radius_mm=track.radius_mm[at],
            z_mm=track.z_mm[at],
            # Twice: the remainder of a tiny negative number is a whole turn.
            angle_deg=360.0 * (track.turns[at] % 1.0) % 360.0,
            time_ms=track.end_ms - after * track.cycle_ms,
        )
        self.found = (*self.found, collision)
