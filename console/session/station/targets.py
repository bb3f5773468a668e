"""Targets of a go-to: the range of an axis, what stands in the way, and how far an axis is from its limits.

Pure, by the machine profile and the alignment: the page shows it and the station refuses with it. Z is mm from the
carriage's zero, positive towards the chuck; C is degrees from the index, reached the shorter way round.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from console.session.cut.alignment import Alignment
from console.session.station.jogging import counts_per_unit, least_gap_mm, speed_problem, tool_in_part
from drivers.lathe.lengths import settings_of
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.machine import MachineProfile
from profiles.problem import Problem

TURN_DEG = 360.0
GO_TO = (AxisName.CARRIAGE, AxisName.SPINDLE)
"""Axes that go to a typed target. The tool does not: it is brought to the work by steps alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Travel:
    """Position of an axis between its software limits, mm from its zero; None for a limit that is not set."""

    at_mm: float
    low_mm: float | None
    high_mm: float | None

    @property
    def fraction(self) -> float | None:
        """Position between the limits, 0 to 1; None without both. Beyond a limit it is that limit's."""
        if self.low_mm is None or self.high_mm is None or self.high_mm <= self.low_mm:
            return None
        return min(max((self.at_mm - self.low_mm) / (self.high_mm - self.low_mm), 0.0), 1.0)

    @property
    def to_limit_mm(self) -> float | None:
        """Distance to the nearer limit, negative beyond it; None without any."""
        ways = [
            *([] if self.low_mm is None else [self.at_mm - self.low_mm]),
            *([] if self.high_mm is None else [self.high_mm - self.at_mm]),
        ]
        return min(ways, default=None)


def travel_of(snapshot: Snapshot, machine: MachineProfile, axis: AxisName) -> Travel:
    """Return where an axis is between its software limits."""
    settings, per_mm = settings_of(machine, axis), counts_per_unit(machine, axis)
    low, high = settings.lowest_counts, settings.highest_counts
    return Travel(
        at_mm=snapshot.axis(axis).position / per_mm,
        low_mm=None if low is None else low / per_mm,
        high_mm=None if high is None else high / per_mm,
    )


def target_range(machine: MachineProfile, axis: AxisName) -> tuple[float, float]:
    """Return the lowest and the highest target: the carriage clear of the jaws, the spindle within a turn."""
    if axis is AxisName.SPINDLE:
        return 0.0, TURN_DEG
    settings, carriage = settings_of(machine, axis), machine.carriage
    ends = (settings.lowest_counts, carriage.travel_min_mm), (settings.highest_counts, carriage.travel_max_mm)
    lows, highs = ([mm] if at is None else [mm, at / carriage.counts_per_mm] for at, mm in ends)
    return max(lows), min(*highs, carriage.jaw_face_mm - carriage.jaw_clearance_mm)


def distance_to(snapshot: Snapshot, machine: MachineProfile, axis: AxisName, target: float) -> float:
    """Return the distance of a jog to a target, signed, mm or degrees; of the spindle at most half a turn."""
    away = target - snapshot.axis(axis).commanded_position / counts_per_unit(machine, axis)
    if axis is not AxisName.SPINDLE:
        return away
    return (away + TURN_DEG / 2.0) % TURN_DEG - TURN_DEG / 2.0


def target_problems(
    snapshot: Snapshot, machine: MachineProfile, alignment: Alignment, axis: AxisName, target: float
) -> tuple[Problem, ...]:
    """Return why an axis may not go to a target: out of range, a tool in the way, faster than set-up allows."""
    low, high = target_range(machine, axis)
    unit = "°" if axis is AxisName.SPINDLE else "mm"
    within = low <= target < high if axis is AxisName.SPINDLE else low <= target <= high
    if not within:
        value, limit = f"{target:.3f} {unit}", f"{low:.3f} … {high:.3f} {unit}"
        return (Problem(code="machine.target_out_of_range", key=axis, value=value, limit=limit),)
    distance = distance_to(snapshot, machine, axis, target)
    in_the_way = _in_the_way(snapshot, machine, alignment, axis, distance)
    too_fast = speed_problem(machine, axis, distance)
    return tuple(problem for problem in (in_the_way, too_fast) if problem is not None)


def _in_the_way(
    snapshot: Snapshot, machine: MachineProfile, alignment: Alignment, axis: AxisName, distance: float
) -> Problem | None:
    """Return what the tool could run into; steps, which are short and watched, are allowed more."""
    clamping = alignment.clamping
    if clamping is None:
        toward_chuck = axis is AxisName.CARRIAGE and distance > 0.0
        return Problem(code="machine.nothing_clamped_known", key=axis) if toward_chuck else None
    in_part = tool_in_part(snapshot, machine, alignment)
    if axis is AxisName.CARRIAGE and distance > 0.0 and not in_part:
        in_part = tool_in_part(_move_carriage(snapshot, machine, distance), machine, alignment)
    if in_part is False:
        return None
    return Problem(code="machine.tool_in_the_way", key=axis, limit=f"{least_gap_mm(alignment):g} mm")


def _move_carriage(snapshot: Snapshot, machine: MachineProfile, distance_mm: float) -> Snapshot:
    """Return the state of the machine with its carriage at the end of a jog."""
    carriage = snapshot.carriage
    position = carriage.position + distance_mm * machine.carriage.counts_per_mm
    return replace(snapshot, carriage=replace(carriage, position=position))
