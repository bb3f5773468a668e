"""Positions that are lost while nothing moves: an alarm at the next poll, whoever caused it."""

from __future__ import annotations

from console.session.station.context import StationContext
from console.session.station.state import MOVING, Activity, StationState
from drivers.lathe.guards import reset_problem
from drivers.lathe.snapshot import Snapshot


def watch_home(place: StationContext, before: StationState, snapshot: Snapshot) -> None:
    """Raise an alarm once where an axis has lost its zero since the poll before: a reset, or another host's home.

    While something moves, the wait for it stops the machine, and raises it; what comes to rest behind a stop is
    waited for by nobody else.
    """
    if before.snapshot is None or not before.controls:
        return
    homed = before.snapshot.homed_axes
    problem = reset_problem(homed, snapshot)
    stopping = before.activity is Activity.STOPPING
    # A home search that was stopped has taken its own axis its zero, and no other one.
    searched = stopping and len(homed - snapshot.homed_axes) == 1
    if before.activity in MOVING and (not stopping or searched):
        return
    if problem is not None:
        place.tell(armed=None)
        place.alarm(problem)
