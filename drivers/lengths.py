"""Where an axis is, in the operator's units: mm from its zero, the spindle in degrees."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.snapshot import AxisName
from profiles.machine import MachineProfile


@dataclass(frozen=True, slots=True)
class Lengths:
    """Writes positions of the axes of a machine, which the controller counts."""

    machine: MachineProfile

    def at(self, axis: AxisName, counts: float) -> str:
        """Return a position with its unit, such as `41.618 mm` or `12.34 deg`."""
        return f"{self._number(axis, counts)} {_UNIT[axis]}"

    def between(self, axis: AxisName, low: float, high: float) -> str:
        """Return a range of positions with its unit."""
        return f"{self._number(axis, low)} to {self._number(axis, high)} {_UNIT[axis]}"

    def around(self, axis: AxisName, counts: float, band: float) -> str:
        """Return a position and how far off it may be, with their unit."""
        return f"{self._number(axis, counts)} ± {self._number(axis, band)} {_UNIT[axis]}"

    def _number(self, axis: AxisName, counts: float) -> str:
        machine = self.machine
        match axis:
            case AxisName.TOOL:
                return f"{counts / machine.tool.counts_per_mm:z.4f}"
            case AxisName.CARRIAGE:
                return f"{counts / machine.carriage.counts_per_mm:z.3f}"
            case AxisName.SPINDLE:
                return f"{360.0 * counts / machine.spindle.counts_per_rev:z.2f}"


_UNIT = {AxisName.TOOL: "mm", AxisName.CARRIAGE: "mm", AxisName.SPINDLE: "deg"}
