"""Whether an axis has come to where it was sent."""

from __future__ import annotations

from drivers.snapshot import AxisName, Snapshot

ARRIVED_COUNTS = 2.0
"""How far from its target a jog may be commanded to rest; positions are told in tenths of a count."""


def arrived(snapshot: Snapshot, axis: AxisName, flag: str) -> bool:
    """Whether an axis is in position, with this flag set, and no search for its zero is under way."""
    flags = snapshot.axis(axis).flags
    return flag in flags and "in_position" in flags and "home_search" not in flags


def nearly_arrived(snapshot: Snapshot, axis: AxisName, band_counts: float) -> bool:
    """Whether an axis is commanded to rest, and lags by no more than a band."""
    state = snapshot.axis(axis)
    return "desired_velocity_zero" in state.flags and abs(state.following_error) <= band_counts
