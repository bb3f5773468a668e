"""Whether an axis has come to where it was sent."""

from __future__ import annotations

from collections.abc import Mapping

from drivers.snapshot import AxisName, Snapshot

ARRIVED_COUNTS = 2.0
"""How far from its target a jog may be commanded to rest; positions are told in tenths of a count."""


SETTLE_S = 15.0
"""How long an axis that rests near its target is given to be in position: thrice the servo's time constant."""

REST_S = 2.0
"""The same where nothing depends on it."""


class Settling:
    """Axes that come to rest, seen from look to look: in position, or for some time within their bands.

    What dry friction holds off is brought in position by the integrator alone, which may take a minute.
    """

    def __init__(self, bands_counts: Mapping[AxisName, float], patience_s: float = SETTLE_S) -> None:
        """`bands_counts` are the axes with what each may lag by where it rests, for `patience_s` at least."""
        self._bands_counts, self._patience_s = bands_counts, patience_s
        self._near_since_s: float | None = None

    def is_over(self, snapshot: Snapshot) -> bool:
        """Whether they rest."""
        if all("in_position" in snapshot.axis(axis).flags for axis in self._bands_counts):
            return True
        if not all(nearly_arrived(snapshot, axis, band) for axis, band in self._bands_counts.items()):
            self._near_since_s = None
            return False
        if self._near_since_s is None:
            self._near_since_s = snapshot.at_s
        return snapshot.at_s - self._near_since_s >= self._patience_s


class HomeSearch:
    """A search for the zero of an axis, seen from look to look.

    On its way back to the zero the axis rests for an instant: only `RESTS` in a row are an end without one.
    """

    RESTS = 3

    def __init__(self, axis: AxisName, band_counts: float) -> None:
        """`band_counts` is by how much it may lag at its zero, see `Settling`."""
        self._axis, self._rests = axis, 0
        self._settling = Settling({axis: band_counts}, REST_S)

    def is_over(self, snapshot: Snapshot) -> bool:
        """Whether the zero was found, or the search has ended without one."""
        flags = snapshot.axis(self._axis).flags
        resting = "desired_velocity_zero" in flags and not {"home_search", "home_complete"} & flags
        self._rests = self._rests + 1 if resting else 0
        found = "home_complete" in flags and "home_search" not in flags
        return (found and self._settling.is_over(snapshot)) or self._rests >= self.RESTS


def nearly_arrived(snapshot: Snapshot, axis: AxisName, band_counts: float) -> bool:
    """Whether an axis is commanded to rest, and lags by no more than a band."""
    state = snapshot.axis(axis)
    return "desired_velocity_zero" in state.flags and abs(state.following_error) <= band_counts
