"""Motor counts in the units of the moved axis, where the machine profile defines them."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.pmac.analysis.findings import Value
from profiles.machine import MachineProfile


@dataclass(frozen=True, slots=True, kw_only=True)
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
    if motor == machine.tool.motor:
        return _millimetres(machine.tool.counts_per_mm)
    if motor == machine.carriage.motor:
        return _millimetres(machine.carriage.counts_per_mm)
    if motor == machine.spindle.motor:
        return _degrees(machine.spindle.counts_per_rev)
    return None


def shown_length(machine: MachineProfile, motor: int, counts: float) -> dict[str, Value]:
    """Return a length for a sentence: um for the tool, mm or deg for other known motors, counts for the rest."""
    unit = unit_of(machine, motor)
    if unit is None:
        return {"length": counts, "unit": "counts"}
    if motor == machine.tool.motor:
        return {"length": counts * machine.tool.count_um, "unit": "um"}
    return {"length": counts * unit.per_count, "unit": unit.name}


def _millimetres(counts_per_mm: float) -> Unit:
    return Unit(
        name="mm",
        per_count=1.0 / counts_per_mm,
        velocity_unit="mm/s",
        velocity=1e3 / counts_per_mm,
        acceleration_unit="m/s2",
        acceleration=1e3 / counts_per_mm,
        jerk_unit="m/s3",
        jerk=1e6 / counts_per_mm,
    )


def _degrees(counts_per_rev: float) -> Unit:
    return Unit(
        name="deg",
        per_count=360.0 / counts_per_rev,
        velocity_unit="rpm",
        velocity=60_000.0 / counts_per_rev,
        acceleration_unit="deg/s2",
        acceleration=360e6 / counts_per_rev,
        jerk_unit="deg/s3",
        jerk=360e9 / counts_per_rev,
    )
