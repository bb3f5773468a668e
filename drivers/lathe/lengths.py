"""Positions in the operator's units: mm from the axis zero, degrees for the spindle."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.lathe.snapshot import AxisName
from drivers.pmac.analysis.units import Unit, unit_of
from drivers.pmac.motor_settings import MotorSettings
from profiles.machine import MachineProfile

_DECIMALS = {AxisName.TOOL: 4, AxisName.CARRIAGE: 3, AxisName.SPINDLE: 2}


def motor_of(machine: MachineProfile, axis: AxisName) -> int:
    """Return the motor number of an axis."""
    return dict(zip(AxisName, machine.motors, strict=True))[axis]


def settings_of(machine: MachineProfile, axis: AxisName) -> MotorSettings:
    """Return the motor settings of an axis from the machine profile."""
    return MotorSettings(machine, motor_of(machine, axis))


@dataclass(frozen=True, slots=True)
class Lengths:
    """Formats axis positions, which the controller reports in counts."""

    machine: MachineProfile

    def unit(self, axis: AxisName) -> Unit:
        """Return the unit of an axis."""
        unit = unit_of(self.machine, motor_of(self.machine, axis))
        assert unit is not None, "every axis of a machine has a motor that it knows"
        return unit

    def format_position(self, axis: AxisName, counts: float) -> str:
        """Return a position with its unit, such as `41.618 mm` or `12.34 deg`."""
        return f"{self._number(axis, counts)} {self.unit(axis).name}"

    def format_range(self, axis: AxisName, low: float, high: float) -> str:
        """Return a range of positions with its unit."""
        return f"{self._number(axis, low)} to {self.format_position(axis, high)}"

    def format_tolerance(self, axis: AxisName, counts: float, band: float) -> str:
        """Return a position with its tolerance, both with their unit."""
        return f"{self._number(axis, counts)} ± {self.format_position(axis, band)}"

    def _number(self, axis: AxisName, counts: float) -> str:
        return f"{counts * self.unit(axis).per_count:z.{_DECIMALS[axis]}f}"
