"""The kinds of collision on a lathe, which the console names without the simulation of one."""

from __future__ import annotations

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
