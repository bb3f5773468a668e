"""Motor counts in the units of the moved axis, where the machine profile defines them."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.pmac.analysis.findings import Value
from profiles.machine import MachineProfile


@dataclass(frozen=True, slots=True)
class Unit:
    """One count in a unit of length or angle, and the units of its derivatives.

    `velocity` converts counts/ms to `velocity_unit`; `acceleration` (counts/ms^2) and `jerk` (counts/ms^3) alike.
    """

    name: str
    per_count: float
    velocity_unit: str
    velocity: float
    acceleration_unit: str
    acceleration: float
    jerk_unit: str
    jerk: float


def unit_of(machine: MachineProfile, motor: int) -> Unit | None:
    """Return the unit of a motor, None for one that the machine profile does not know."""
    if motor == machine.spindle.motor:
        turn = machine.spindle.counts_per_rev
        return Unit("deg", 360.0 / turn, "rpm", 60_000.0 / turn, "deg/s2", 360e6 / turn, "deg/s3", 360e9 / turn)
    for axis in (machine.tool, machine.carriage):
        if motor == axis.motor:
            mm = axis.counts_per_mm
            return Unit("mm", 1.0 / mm, "mm/s", 1e3 / mm, "m/s2", 1e3 / mm, "m/s3", 1e6 / mm)
    return None


def shown_length(machine: MachineProfile, motor: int, counts: float) -> dict[str, Value]:
    """Return a length for a sentence: um for the tool, mm or deg for other known motors, counts for the rest."""
    unit = unit_of(machine, motor)
    if unit is None:
        return {"length": counts, "unit": "counts"}
    if motor == machine.tool.motor:
        return {"length": counts * machine.tool.count_um, "unit": "um"}
    return {"length": counts * unit.per_count, "unit": unit.name}
