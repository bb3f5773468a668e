"""An operator's view of the chuck of the simulated lathe, independent of the controller."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class CollisionKind(StrEnum):
    """Kinds of collision."""

    STANDING_PART = "standing_part"
    """The tip entered the clamped surface while the spindle stood."""
    END_FACE = "end_face"
    """The tip entered material along Z faster than any feed."""
    TOO_DEEP = "too_deep"
    """The tip went deeper than the tool permits."""
    THROUGH_WALL = "through_wall"
    """The tip broke through the wall into the bore."""
    JAWS = "jaws"
    """The tip went beyond the jaw faces, within the outer radius of the jaws."""
    INFEED = "infeed"
    """The tip went deeper than its cut, by more per turn than the tool permits."""
    REVERSE = "reverse"
    """The tip was in material while the spindle turned backwards."""
    END_OF_TRAVEL = "end_of_travel"
    """The tool or the carriage hit the end of its travel."""


_SCRATCHES = (CollisionKind.STANDING_PART, CollisionKind.TOO_DEEP, CollisionKind.THROUGH_WALL)


@dataclass(frozen=True, slots=True, kw_only=True)
class Dials:
    """What is read at the lathe where the truth is not shown.

    `indicator_um` is the indicator at the mark, positive pushed in by the flank of a jaw, None while its stylus is
    free; at the end of its range it stays. `contact` is whether the tool is heard on the part,
    `tool_current_percent` the current of its motor. `micrometer_mm` is the diameter before the tool, None while
    nobody can measure it: the spindle turns, or the tool is near.
    """

    indicator_um: float | None
    contact: bool
    tool_current_percent: float
    micrometer_mm: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What is so at the lathe, for a debrief: nothing of it is shown before.

    `jaw_1_deg` is the spindle angle at which jaw 1 meets the mark, degrees from the index; `zero_radius_mm` the
    radius of the tool tip at motor position zero; `reachable_um` the RONt of this part where the lobe of its job
    is exactly aligned and followed: what lathe, chuck and gauge leave. Without a part it is what spindle and gauge
    leave. `nearest_jaws_mm` is how near the tool has come to the jaws since power-up, `contact_mm_per_s` the
    highest speed at which it has met a part that stood; None where it has not.
    """

    jaw_1_deg: float
    zero_radius_mm: float
    reachable_um: float
    nearest_jaws_mm: float | None = None
    contact_mm_per_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkshopView:
    """A view of the chuck.

    `jaw_1_past_mark_deg` is how far the spindle is beyond the place at which jaw 1 meets the mark, in the
    direction of the cut, above -180 and up to 180. `tool_gap_mm` is the radial gap between the tool tip and the
    clamped surface before it, below 0 when the tip is inside; None when there is no part before it. `collisions`
    are the kinds of collision since the blank was clamped, each value of `CollisionKind` once, in the order in
    which they began. With `dials` the lathe is seen as a real one is: the angle is what the eye makes of it, and
    no gap is known. `held_s` is by how much the lathe's time was held in all while its computer was busy.
    """

    jaw_1_past_mark_deg: float
    tool_gap_mm: float | None
    collisions: tuple[str, ...] = ()
    dials: Dials | None = None
    held_s: float = 0.0

    @property
    def in_scratch(self) -> bool:
        """Whether the tip is at the surface of a part that it has driven into since the blank was clamped."""
        return (
            self.tool_gap_mm is not None
            and self.tool_gap_mm <= 0.0
            and any(kind in _SCRATCHES for kind in self.collisions)
        )
