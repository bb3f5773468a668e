"""Whether an axis has come to where it was sent."""

from __future__ import annotations

from collections.abc import Iterable

from drivers.snapshot import AxisName, Snapshot

ARRIVED_COUNTS = 2.0
"""How far from its target a jog may be commanded to rest; positions are told in tenths of a count."""


SETTLE_S = 15.0
"""How long an axis that rests near its target is given to be in position: thrice the servo's time constant."""

REST_S = 2.0
"""The same where nothing depends on it."""


class Settling:
    """Axes that come to rest, seen from look to look: in position, or the tool for some time within a band.

    Its servo is soft: what dry friction holds off is brought in position by the integrator alone, which may take a
    minute. Any other axis that does not arrive has a fault.
    """

    def __init__(self, axes: Iterable[AxisName], tool_band_counts: float, patience_s: float = SETTLE_S) -> None:
        """The tool may lag by `tool_band_counts` where it rests, once it did so for `patience_s`."""
        self._axes, self._tool_band_counts, self._patience_s = tuple(axes), tool_band_counts, patience_s
        self._near_since_s: float | None = None

    def is_over(self, snapshot: Snapshot) -> bool:
        """Whether they rest."""
        away = [axis for axis in self._axes if "in_position" not in snapshot.axis(axis).flags]
        if not away:
            return True
        if away != [AxisName.TOOL] or not nearly_arrived(snapshot, AxisName.TOOL, self._tool_band_counts):
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

    def __init__(self, axis: AxisName, tool_band_counts: float, braking_s: float = 0.0) -> None:
        """`tool_band_counts` is by how much the tool may lag at its zero, see `Settling`.

        An axis that searches needs `braking_s` to come to rest. `sudden` is whether this one rested on a zero
        sooner: somebody has called the place home at which it was (`HMZ`), and there is no zero there.
        """
        self.sudden = False
        self._axis, self._rests = axis, 0
        self._braking_s = braking_s
        self._searching: Snapshot | None = None
        self._settling = Settling((axis,), tool_band_counts, REST_S)

    def is_over(self, snapshot: Snapshot) -> bool:
        """Whether the zero was found, or the search has ended without one."""
        flags = snapshot.axis(self._axis).flags
        self._see_sudden(snapshot, flags)
        resting = "desired_velocity_zero" in flags and not {"home_search", "home_complete"} & flags
        self._rests = self._rests + 1 if resting else 0
        found = "home_complete" in flags and "home_search" not in flags
        return (found and self._settling.is_over(snapshot)) or self._rests >= self.RESTS

    def _see_sudden(self, snapshot: Snapshot, flags: frozenset[str]) -> None:
        before = self._searching
        self._searching = None
        if "home_search" in flags:
            self._searching = snapshot
        elif before is not None and {"home_complete", "desired_velocity_zero"} <= flags:
            self.sudden = snapshot.at_s - before.asked_s < self._braking_s


def nearly_arrived(snapshot: Snapshot, axis: AxisName, band_counts: float) -> bool:
    """Whether an axis is commanded to rest, and lags by no more than a band."""
    state = snapshot.axis(axis)
    return "desired_velocity_zero" in state.flags and abs(state.following_error) <= band_counts
