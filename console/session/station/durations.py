"""How long a motion takes by the settings of the machine: jogs, the approach, homing of axes whose zero is known.

Pure. Times are those of the commanded trajectories, in seconds; an axis may settle some moments later.
"""

from __future__ import annotations

from drivers.lathe.lengths import settings_of
from drivers.lathe.snapshot import AxisName, Snapshot, driven_axes
from profiles.machine import MachineProfile

HOME_TURN_DEG = 360.0


def jog_s(machine: MachineProfile, axis: AxisName, distance: float) -> float:
    """Return the duration of a jog over a distance, mm or degrees."""
    return settings_of(machine, axis).jog_s(abs(distance))


def approach_s(machine: MachineProfile, now: Snapshot, over_counts: float, clear_counts: float) -> float:
    """Return the duration of the approach: tool out if it is further in, carriage over the part, tool in."""
    tool, carriage = (settings_of(machine, axis) for axis in (AxisName.TOOL, AxisName.CARRIAGE))
    out_counts = min(now.tool.position, clear_counts)
    return (
        tool.jog_s((now.tool.position - out_counts) / tool.counts_per_unit)
        + carriage.jog_s(abs(over_counts - now.carriage.position) / carriage.counts_per_unit)
        + tool.jog_s((clear_counts - out_counts) / tool.counts_per_unit)
    )


def home_s(machine: MachineProfile, now: Snapshot) -> float | None:
    """Return the longest that homing takes: from where the axes are, or over all their travel where nothing says.

    None for an axis without a homing speed.
    """
    tool, carriage = machine.tool, machine.carriage
    whole_mm = {
        AxisName.TOOL: tool.travel_max_mm - tool.travel_min_mm,
        AxisName.CARRIAGE: carriage.travel_max_mm - carriage.travel_min_mm,
    }
    total_s = 0.0
    for axis in driven_axes(machine):
        settings = settings_of(machine, axis)
        if not settings.home_speed:
            return None
        if axis is AxisName.SPINDLE:  # at most a turn to its next index, whichever way it searches
            from_zero = HOME_TURN_DEG
        elif now.homed:
            from_zero = now.axis(axis).position / settings.counts_per_unit
        else:
            from_zero = whole_mm[axis]
        total_s += abs(from_zero / settings.home_speed) + 2.0 * settings.home_braking_s
    return total_s
