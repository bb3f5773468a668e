"""An armed cut is what was read in its summary: disarm it at the poll that shows anything else."""

from __future__ import annotations

from console.session.station.context import StationContext
from drivers.lathe.snapshot import REAL_TIME_PERCENT, Snapshot
from profiles.problem import Problem

OVERRIDE_BAND_PERCENT = 0.5


def watch_armed(context: StationContext, snapshot: Snapshot) -> None:
    """Disarm once a poll differs from what was armed: alignment, drives, home; somebody moves an axis."""
    armed = context.state.armed
    if armed is None:
        return
    changed = None
    if context.state.alignment != armed.alignment:
        changed = Problem(code="session.arm_realigned")
    elif snapshot.moving:
        changed = Problem(code="session.arm_moved")
    elif abs(snapshot.override_percent - REAL_TIME_PERCENT) > OVERRIDE_BAND_PERCENT:
        changed = Problem(code="session.arm_override")
    if changed is not None:
        context.tell(armed=None, refusals=(changed,))
