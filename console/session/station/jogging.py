"""Jog steps: their length, the stopping distance of an axis, and how near to the work it may go.

Pure, by the machine profile. Steps are mm of the tool and the carriage, degrees of the spindle. Where the tool tip
is against the blank follows from what the controller reports, the touch-off and the clamping, never from the job
that happens to be on the screen: one rule for commands, pages and stops.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from console.session.cut.alignment import Alignment, aligned_machine, touch_off_here
from console.session.station.state import Activity, StationState
from drivers.lathe.lengths import settings_of
from drivers.lathe.motion import LINK_LATENCY_MS
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.machine import MachineProfile
from profiles.problem import Problem

STEPS_MM = (0.001, 0.01, 0.1, 1.0, 10.0)
STEPS_DEG = (0.01, 0.1, 1.0, 10.0, 30.0)
"""Two step ladders, each with its own selection."""

FIRST_RUNG = 1
IDLE_S = 30.0
"""How long jogging stays enabled without a jog."""

BLIND_STEP_MM = 1.0
"""Longest step toward the work while its position is unknown: half of the usual retract distance."""

APPROACH_STEP_MM = 0.1  # longest step toward the work where its surface may already be
FEELING_STEP_MM = 0.01  # longest step toward a surface that should already be in contact
STEP_TOLERANCE_MM = 0.0005
"""Tolerance on the step limit: what is shown with three decimals must agree with what is allowed."""

DEG_PER_S_OF_AN_RPM = 6.0
SPEED_TOLERANCE = 0.001  # jog speeds are whole numbers of counts/ms: 16.667 of them are 100.002 rpm

CLEAR_MM = 0.2
"""Radial distance from the part at which the tool counts as clear: many times the drift of a disabled drive."""

SETUP_MM_PER_S, SETUP_RPM = 2000.0 / 60.0, 100.0
"""Highest speeds of a jog in set-up, axes and spindle. Our choice: 2 m/min is the usual figure for the axes of a
lathe; the standard for the machine at hand may ask for less, and then its own jog speed (Ix22) has to be lower."""

TOUCH_OFF_BAND_MM = 1.5
"""Allowed distance of a touch-off from the tool radius in the profile: less than the retract distance."""


def counts_per_unit(machine: MachineProfile, axis: AxisName) -> float:
    """Return the counts per millimetre, or per degree of the spindle."""
    match axis:
        case AxisName.TOOL:
            return machine.tool.counts_per_mm
        case AxisName.CARRIAGE:
            return machine.carriage.counts_per_mm
        case AxisName.SPINDLE:
            return machine.spindle.counts_per_rev / 360.0


@dataclass(frozen=True, slots=True, kw_only=True)
class JogEnable:
    """Enabled jogging: when it was last used (machine time), and how many stops were settled before."""

    used_s: float
    stops: int

    def left_s(self, now_s: float) -> float:
        """Return the remaining time without a jog."""
        return IDLE_S - (now_s - self.used_s)

    def holds(self, state: StationState, now_s: float) -> bool:
        """Whether it is still valid: not after its timeout, a stop, or the loss of the machine."""
        stopped = state.stop is not None or state.stops != self.stops or state.activity is Activity.LOST
        return not stopped and self.left_s(now_s) > 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """Selected rungs of the two ladders."""

    mm: int = FIRST_RUNG
    deg: int = FIRST_RUNG

    def step_length(self, axis: AxisName) -> float:
        """Return the length of a step of an axis, mm or degrees."""
        return STEPS_DEG[self.deg] if axis is AxisName.SPINDLE else STEPS_MM[self.mm]

    def change_step(self, axis: AxisName, by: int) -> Steps:
        """Return the selection with the ladder of an axis moved by so many rungs, within its ends."""
        name, ladder = ("deg", STEPS_DEG) if axis is AxisName.SPINDLE else ("mm", STEPS_MM)
        return replace(self, **{name: min(max(getattr(self, name) + by, 0), len(ladder) - 1)})


def tool_radius_mm(position_counts: float, machine: MachineProfile, alignment: Alignment) -> float:
    """Return the radius of the tool tip, by the touch-off or, before it, by the machine profile."""
    tool = aligned_machine(machine, alignment).tool
    return tool.home_radius_mm - position_counts / tool.counts_per_mm


def longest_in_mm(gap_mm: float | None) -> float:
    """Return the longest allowed step toward the work; `gap_mm` is None if it is unknown."""
    return BLIND_STEP_MM if gap_mm is None else max(gap_mm, FEELING_STEP_MM)


def longest_toward_mm(snapshot: Snapshot | None, machine: MachineProfile, alignment: Alignment) -> float:
    """Return the longest step of the tool toward the work: to the clamped part, as far as that is known.

    Without a touch-off the surface is somewhere in the touch-off band about its place by the profile: there steps
    are short, and none leads beyond the band.
    """
    gap_mm = None if snapshot is None else tool_gap_mm(snapshot, machine, alignment)
    if snapshot is None or gap_mm is None or alignment.clamping is None:
        return longest_in_mm(None)
    if touch_off_here(alignment) is not None:
        return longest_in_mm(gap_mm)
    if not over_part(snapshot, machine, alignment.clamping.overhang_mm):
        return BLIND_STEP_MM
    longest_mm = min(max(gap_mm - TOUCH_OFF_BAND_MM, APPROACH_STEP_MM), BLIND_STEP_MM)
    return max(min(longest_mm, gap_mm + TOUCH_OFF_BAND_MM), 0.0)


def step_problem(
    step_mm: float, snapshot: Snapshot | None, machine: MachineProfile, alignment: Alignment
) -> Problem | None:
    """Return why a step of the tool toward the work is refused, else None. Nothing is shortened."""
    longest_mm = longest_toward_mm(snapshot, machine, alignment)
    if not is_too_long(step_mm, longest_mm):
        return None
    if snapshot is not None and is_too_long(STEPS_MM[0], longest_mm):
        deep_mm = -(tool_gap_mm(snapshot, machine, alignment) or 0.0)
        limit = f"{TOUCH_OFF_BAND_MM:.3f} mm"
        return Problem(code="machine.below_surface", key="tool", value=f"{deep_mm:.3f} mm", limit=limit)
    value, limit = f"{step_mm:.3f} mm", f"<= {longest_mm:.3f} mm"
    return Problem(code="machine.step_too_long", key="tool", value=value, limit=limit)


def is_too_long(step_mm: float, longest_mm: float) -> bool:
    """Return whether a step is longer than it may be."""
    return step_mm > longest_mm + STEP_TOLERANCE_MM


def step_speed(machine: MachineProfile, axis: AxisName, distance: float) -> float:
    """Return an upper bound of the speed of a jog over a distance, mm/s, or rpm of the spindle."""
    speed = settings_of(machine, axis).step_speed(abs(distance))
    return speed / DEG_PER_S_OF_AN_RPM if axis is AxisName.SPINDLE else speed


def setup_speed(axis: AxisName) -> float:
    """Return the highest speed of a jog in set-up, mm/s, or rpm of the spindle."""
    return SETUP_RPM if axis is AxisName.SPINDLE else SETUP_MM_PER_S


def speed_problem(machine: MachineProfile, axis: AxisName, distance: float) -> Problem | None:
    """Return why a jog over a distance is too fast for set-up, else None. Nothing is slowed down."""
    speed, most = step_speed(machine, axis, distance), setup_speed(axis)
    if speed <= most * (1.0 + SPEED_TOLERANCE):
        return None
    unit = "rpm" if axis is AxisName.SPINDLE else "mm/s"
    value, limit = f"{speed:.1f} {unit}", f"<= {most:.1f} {unit}"
    return Problem(code="machine.setup_speed", key=axis, value=value, limit=limit)


def stopping_distance(machine: MachineProfile, axis: AxisName, step: float) -> float:
    """Return the stopping distance: the longest way from a stop in mid-step to rest, mm or degrees.

    The controller obeys a stop once in a background period. Infinite where the axis has no abort rate.
    """
    late_s = (machine.controller.background_ms + LINK_LATENCY_MS) / 1000.0
    return settings_of(machine, axis).step_stopping_distance(abs(step), late_s)


def tool_gap_mm(snapshot: Snapshot, machine: MachineProfile, alignment: Alignment) -> float | None:
    """Return the radial distance from the tip to the surface of the clamped blank, negative inside.

    None if it is not known: nothing is clamped, or the axes are not homed.
    """
    if alignment.clamping is None or not snapshot.homed:
        return None
    radius_mm = tool_radius_mm(snapshot.tool.position, machine, alignment)
    return radius_mm - 0.5 * alignment.clamping.diameter_mm


def tool_in_part(snapshot: Snapshot, machine: MachineProfile, alignment: Alignment) -> bool | None:
    """Return whether the tip is over the clamped blank and not clear of it; None if that is unknown.

    Before the touch-off the tip position is only known to within the touch-off band.
    """
    gap_mm = tool_gap_mm(snapshot, machine, alignment)
    if gap_mm is None or alignment.clamping is None:
        return None
    if not over_part(snapshot, machine, alignment.clamping.overhang_mm):
        return False
    if gap_mm < CLEAR_MM:
        return True
    return None if gap_mm < least_gap_mm(alignment) else False


def least_gap_mm(alignment: Alignment) -> float:
    """Return the gap from which on the tool counts as clear of the part, by where its tip is believed to be."""
    return CLEAR_MM if touch_off_here(alignment) is not None else CLEAR_MM + TOUCH_OFF_BAND_MM


def over_part(snapshot: Snapshot, machine: MachineProfile, overhang_mm: float) -> bool:
    """Return whether any of the tool's flat is between the face of a part and the jaws."""
    return behind_face_mm(snapshot, machine, overhang_mm) + 0.5 * machine.tool.wiper_land_mm > 0.0


def behind_face_mm(snapshot: Snapshot, machine: MachineProfile, overhang_mm: float) -> float:
    """Return how far the tool stands behind the face of a part, along Z; negative in front of it."""
    carriage = machine.carriage
    return snapshot.carriage.position / carriage.counts_per_mm - (carriage.jaw_face_mm - overhang_mm)


def clears_tables(snapshot: Snapshot | None, alignment: Alignment) -> bool:
    """Whether F8 clears tables that were left on, in place of a retract: no home, and the drives are killed."""
    return bool(alignment.tables) and snapshot is not None and snapshot.loops_open and not snapshot.homed


def no_retract(snapshot: Snapshot | None, machine: MachineProfile, alignment: Alignment) -> Problem | None:
    """Return why the tool cannot be retracted, with its position as far as known; None if it can be.

    A disabled drive does not hold the tool: it does not count as out, wherever it was seen. An unknown position is
    reported as unknown, and not as a tool in the part.
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
