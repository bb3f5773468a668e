"""The operator's units of an axis: mm, or degrees of the spindle."""

from __future__ import annotations

from drivers.snapshot import AxisName
from profiles.machine import MachineProfile


def counts_per_unit(machine: MachineProfile, axis: AxisName) -> float:
    """Return the counts of a millimetre, or of a degree of the spindle."""
    match axis:
        case AxisName.TOOL:
            return machine.tool.counts_per_mm
        case AxisName.CARRIAGE:
            return machine.carriage.counts_per_mm
        case AxisName.SPINDLE:
            return machine.spindle.counts_per_rev / 360.0
