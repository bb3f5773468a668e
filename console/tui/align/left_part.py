"""Words for a part that a cut may have left the tool in: who opens the chuck gets the tool out first.

Without a home nobody knows where the tool stands. What then takes it out is the home search: the tool first, and
outward.
"""

from __future__ import annotations

from console.session.cut.alignment import ENDED_EARLY
from console.session.station.state import StationState
from drivers.lathe.lengths import settings_of
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.machine import MachineProfile


def drives_are_on(state: StationState) -> bool:
    """Whether a loop is closed, or may be: while nothing is known, hands stay out."""
    return state.snapshot is None or not state.snapshot.loops_open


def ended_early(state: StationState) -> bool:
    """Whether the last cut ended early, and no clamping was confirmed since."""
    return state.alignment.clamping is None and any(each.code == ENDED_EARLY for each in state.alignment.lost)


def may_be_in_part(state: StationState) -> bool:
    """Whether the drives are off after a last cut that ended early: to take the tool out they have to be on."""
    return ended_early(state) and not drives_are_on(state)


def homes_first(state: StationState) -> bool:
    """Whether the home search is what takes the tool out: the drives hold it, and nobody knows where it stands."""
    closed = state.snapshot is not None and state.snapshot.loops_closed
    return ended_early(state) and closed and not state.alignment.homed


def stands_at_home(snapshot: Snapshot | None, machine: MachineProfile) -> bool:
    """Whether the drives hold the tool at its home, where it is clear of every part, or further out."""
    if snapshot is None or not snapshot.loops_closed or "home_complete" not in snapshot.tool.flags:
        return False
    return snapshot.tool.position <= settings_of(machine, AxisName.TOOL).in_position_counts


def left_word(state: StationState, machine: MachineProfile) -> str:
    """Return the words for a chuck that is not to be opened yet; empty where a blank may be clamped."""
    if drives_are_on(state):
        if not ended_early(state) or stands_at_home(state.snapshot, machine):
            return "clamp_drives_on"
        return "clamp_left_on_unhomed" if homes_first(state) else "clamp_left_on"
    if not ended_early(state):
        return ""
    return "clamp_left" if state.alignment.homed else "clamp_left_unhomed"
