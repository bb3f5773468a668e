"""Where the tool tip is against the blank that is in the chuck: one rule for orders, pages and stops.

By what the controller reports, the touch-off and the clamping, never by the job that happens to be on the screen.
"""

from __future__ import annotations

from console.session.alignment import Alignment, aligned_machine
from drivers.snapshot import Snapshot
from profiles.machine import MachineProfile
from profiles.problem import Problem

CLEAR_MM = 0.2
"""Radial way from the part from which the tool counts as clear: many times what a drive that is off may drift."""


TOUCH_OFF_BAND_MM = 1.5
"""How far a touch-off may be from the tool radius that the profile states: less than the retract distance."""


def tool_gap_mm(snapshot: Snapshot, machine: MachineProfile, alignment: Alignment) -> float | None:
    """Return the radial way from the tip to the surface of the clamped blank, negative inside.

    None where it is not known: nothing is clamped, or the axes have no zero.
    """
    if alignment.clamping is None or not snapshot.homed:
        return None
    tool = aligned_machine(machine, alignment).tool
    radius_mm = tool.home_radius_mm - snapshot.tool.position / tool.counts_per_mm
    return radius_mm - 0.5 * alignment.clamping.diameter_mm


def tool_in_part(snapshot: Snapshot, machine: MachineProfile, alignment: Alignment) -> bool | None:
    """Return whether the tip is over the clamped blank and not clear of it; None where that is not known.

    Before the touch-off the tip is only known to the band in which that may find it.
    """
    gap_mm = tool_gap_mm(snapshot, machine, alignment)
    if gap_mm is None or alignment.clamping is None:
        return None
    if not over_part(snapshot, machine, alignment.clamping.overhang_mm):
        return False
    if gap_mm < CLEAR_MM:
        return True
    return None if alignment.touch_off is None and gap_mm < CLEAR_MM + TOUCH_OFF_BAND_MM else False


def over_part(snapshot: Snapshot, machine: MachineProfile, overhang_mm: float) -> bool:
    """Return whether any of the tool's flat is between the face of a part and the jaws."""
    return behind_face_mm(snapshot, machine, overhang_mm) + 0.5 * machine.tool.wiper_land_mm > 0.0


def behind_face_mm(snapshot: Snapshot, machine: MachineProfile, overhang_mm: float) -> float:
    """Return how far the tool stands behind the face of a part, along Z; negative in front of it."""
    carriage = machine.carriage
    return snapshot.carriage.position / carriage.counts_per_mm - (carriage.jaw_face_mm - overhang_mm)


def no_retract(snapshot: Snapshot | None, machine: MachineProfile, alignment: Alignment) -> Problem | None:
    """Return why the tool cannot be taken out, with what is known of where it stands; None where it can be.

    Nothing holds a tool whose drive is off: it is not called out, wherever it was seen. Where its place is not
    known that is said, and not that it stands in the part.
    """
    if snapshot is None:
        return Problem(code="screen.nothing_known")
    if snapshot.loops_closed:
        return None
    match tool_in_part(snapshot, machine, alignment):
        case True:
            return Problem(code="machine.retract_not_possible")
        case False:
            return Problem(code="alignment.drives_off")
        case None:
            return Problem(code="machine.tool_unknown")
