"""Positions that are lost while nothing moves: an alarm at the next poll, whoever caused it."""

from __future__ import annotations

from console.session.state import MOVING, StationState
from console.session.workplace import Workplace
from drivers.guards import reset_problem
from drivers.snapshot import Snapshot


def watch_home(place: Workplace, before: StationState, snapshot: Snapshot) -> None:
    """Raise an alarm once where an axis has lost its zero since the poll before: a reset, or another host's home.

    While something moves, the wait for it stops the machine, and raises it.
    """
    if before.snapshot is None or not before.controls or before.activity in MOVING:
        return
    problem = reset_problem(before.snapshot.homed_axes, snapshot)
    if problem is not None:
        place.tell(armed=None)
        place.alarm(problem)
