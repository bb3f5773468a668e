"""Whether an axis has come to where it was sent."""

from __future__ import annotations

from drivers.snapshot import AxisName, Snapshot

ARRIVED_COUNTS = 2.0
"""How far from its target a jog may be commanded to rest; positions are told in tenths of a count."""


def arrived(snapshot: Snapshot, axis: AxisName, flag: str) -> bool:
    """Whether an axis is in position, with this flag set, and no search for its zero is under way."""
    flags = snapshot.axis(axis).flags
    return flag in flags and "in_position" in flags and "home_search" not in flags


class HomeSearch:
    """A search for the zero of an axis, seen from look to look.

    On its way back to the zero the axis rests for an instant: only `RESTS` in a row are an end without one.
    """

    RESTS = 3

    def __init__(self, axis: AxisName) -> None:
        self._axis, self._rests = axis, 0

    def is_over(self, snapshot: Snapshot) -> bool:
        """Whether the zero was found, or the search has ended without one."""
        flags = snapshot.axis(self._axis).flags
        resting = "desired_velocity_zero" in flags and not {"home_search", "home_complete"} & flags
        self._rests = self._rests + 1 if resting else 0
        return arrived(snapshot, self._axis, "home_complete") or self._rests >= self.RESTS


def nearly_arrived(snapshot: Snapshot, axis: AxisName, band_counts: float) -> bool:
    """Whether an axis is commanded to rest, and lags by no more than a band."""
    state = snapshot.axis(axis)
    return "desired_velocity_zero" in state.flags and abs(state.following_error) <= band_counts
