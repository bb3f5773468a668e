"""Loss of home while nothing moves: an alarm at the next poll, whoever caused it."""

from __future__ import annotations

from console.session.station.context import StationContext
from console.session.station.state import MOVING, Activity, StationState
from drivers.lathe.guards import reset_problem
from drivers.lathe.snapshot import Snapshot


def watch_home(place: StationContext, before: StationState, snapshot: Snapshot) -> None:
    """Raise one alarm where an axis has lost its home since the last poll: a reset, or another host's home search.

    In motion, the wait for the motion stops the machine and raises the alarm; an axis that comes to rest after a
    stop is checked only here.
    """
    if before.snapshot is None or not before.controls:
        return
    homed = before.snapshot.homed_axes
    problem = reset_problem(homed, snapshot)
    stopping = before.activity is Activity.STOPPING
    # A stopped home search has lost the home of its own axis, and of no other.
    searched = stopping and len(homed - snapshot.homed_axes) == 1
    if before.activity in MOVING and (not stopping or searched):
        return
    if problem is not None:
        place.tell(armed=None)
        place.alarm(problem)
