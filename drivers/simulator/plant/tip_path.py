"""The path of the tool tip, from the machine positions of the axes: exact where it matters, a bound elsewhere.

Most of the time the tip is far from everything. Then neither the radial error of the spindle nor that of the scale
has to be computed for each servo cycle.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from drivers.simulator.plant.collision import Track
from drivers.simulator.plant.spindle import RadialError
from drivers.simulator.plant.true_parameters import TrueParameters
from drivers.simulator.plant.workpiece import OVERLAP
from profiles.machine import MachineProfile

FAR_MM = 0.5  # much more than the tip moves in some servo cycles: a cubic through such places stays outside
ROUNDING_MM = 1e-6
Floats = NDArray[np.float64]
Block = tuple[Sequence[float], Sequence[float], Sequence[float]]  # tool, spindle and carriage, machine counts


class TipPath:
    """Machine counts of tool, spindle and carriage to radius and Z of the tip, and turns since the index."""

    def __init__(self, machine: MachineProfile, true: TrueParameters, wander: RadialError | None) -> None:
        self._true = true
        self.drifted_mm = 0.0  # how much further in the machine has brought the tip since it was cold
        self._wander = wander
        self._cycle_ms = machine.controller.servo_period_ms
        self._turns_per_count = 1.0 / (machine.spindle.counts_per_rev * true.belt_ratio)
        self._mm_per_carriage_count = 1.0 / machine.carriage.counts_per_mm
        self._mm_per_tool_count = 1.0 / machine.tool.counts_per_mm
        most_wander_mm = wander.most_mm if wander is not None else 0.0
        self._most_off_mm = most_wander_mm + abs(true.scale_error_um) / 1000.0 + ROUNDING_MM

    @property
    def _home_mm(self) -> float:
        return self._true.home_radius_mm - self.drifted_mm

    def track(self, block: Block, end_ms: float) -> Track:
        """Return the path in a block of servo cycles."""
        tool, spindle, carriage = block
        per_turn, per_z, wander = self._turns_per_count, self._mm_per_carriage_count, self._wander
        turns = [y * per_turn for y in spindle]
        radius_mm = self.tips_mm(tool)
        if wander is not None:
            radius_mm = [tip - wander.at_mm(turn) for tip, turn in zip(radius_mm, turns, strict=True)]
        z_mm = [z * per_z for z in carriage]
        return Track(radius_mm=radius_mm, turns=turns, z_mm=z_mm, end_ms=end_ms, cycle_ms=self._cycle_ms)

    def tips_mm(self, counts: Sequence[float]) -> list[float]:
        """Return the radius of the tool tip at a reading of the tool's scale."""
        true, per_mm, home_mm = self._true, self._mm_per_tool_count, self._home_mm
        if not true.scale_error_um:
            return [home_mm - x * per_mm for x in counts]
        return [home_mm - x * per_mm - true.scale_wrong_mm(x * per_mm) for x in counts]

    def least_radius_mm(self, tool: Sequence[float]) -> float:
        """Return a radius that is not above that of the tip anywhere in a block."""
        return self._home_mm - max(tool) * self._mm_per_tool_count - self._most_off_mm

    def most_z_mm(self, carriage: Sequence[float]) -> float:
        """Return the largest Z in a block."""
        return max(carriage) * self._mm_per_carriage_count

    def samples(self, blocks: Sequence[Block], outside_mm: float) -> tuple[Floats, Floats, Floats]:
        """Return radius, turns and Z of many blocks; inexact only where all that is far outside `outside_mm`.

        Its ends are exact, for what joins on to them.
        """
        # All the numbers at once: an array for each of the short tracks would cost more than the cut itself.
        tool, spindle, carriage = (
            np.fromiter(chain.from_iterable([block[axis] for block in blocks]), np.float64) for axis in range(3)
        )
        turns = spindle * self._turns_per_count
        if self._true.scale_error_um:
            radius_mm = np.array(self.tips_mm(tool.tolist()))
        else:
            radius_mm = self._home_mm - tool * self._mm_per_tool_count
        if self._wander is not None:
            far = float(radius_mm.min()) - self._wander.most_mm - FAR_MM > outside_mm and len(tool) > 2 * OVERLAP
            exact = (slice(OVERLAP), slice(-OVERLAP, None)) if far else (slice(None),)
            for part in exact:
                # Python's own sine, as `track` has it: another may differ in the last bit.
                radius_mm[part] -= [self._wander.at_mm(turn) for turn in turns[part].tolist()]
        return radius_mm, turns, carriage * self._mm_per_carriage_count
