"""An operator's view of the chuck of the simulated lathe, independent of the controller."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkshopView:
    """A view of the chuck.

    `jaw_1_past_mark_deg` is how far the spindle is beyond the place at which jaw 1 meets the mark, in the
    direction of the cut, above -180 and up to 180. `tool_gap_mm` is the radial gap between the tool tip and the
    clamped surface before it, below 0 when the tip is inside; None when there is no part before it. `collisions`
    are the kinds of collision since the blank was clamped, each value of `CollisionKind` once, in the order in
    which they began.
    """

    jaw_1_past_mark_deg: float
    tool_gap_mm: float | None
    collisions: tuple[str, ...] = ()
