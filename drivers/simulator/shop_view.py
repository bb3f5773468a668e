"""What an operator sees at the chuck of the simulated lathe, whatever the controller believes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ShopView:
    """A look at the chuck.

    `jaw_1_past_mark_deg` is how far the spindle is beyond the place at which jaw 1 meets the mark, in the
    direction of the cut, above -180 and up to 180. `tool_gap_mm` is the radial gap between the tool tip and the
    clamped surface in front of it, below 0 when the tip is inside; None when there is no part in front of it.
    `collision` is what has last met what since the blank was clamped, a value of `CollisionKind`; None when
    nothing has.
    """

    jaw_1_past_mark_deg: float
    tool_gap_mm: float | None
    collision: str | None = None
