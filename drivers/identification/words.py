"""The words of a motor in a program: the letter of its axis, and its counts in units of that axis."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.pmac.axes import read_definitions
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisWord:
    """One motor with an axis of its own: `scale` counts per unit, zero at `offset` counts."""

    letter: str
    scale: float
    offset: float

    def position(self, counts: float) -> float:
        """Return a position of the motor in units of the axis."""
        return (counts - self.offset) / self.scale

    def length(self, counts: float) -> float:
        """Return a distance, or a speed, in units of the axis."""
        return counts / self.scale


def axis_word(machine: MachineProfile, motor: int) -> AxisWord:
    """Return the axis of a motor.

    Raises:
        ProfileError: `identify.axis`, the motor has none of its own.
    """
    definitions = read_definitions(machine.controller.axis_definitions)
    found = [each for each in definitions if each.motor == motor]
    if not found or len(found[0].terms) != 1 or not found[0].scale:
        value = str(found[0]) if found else "-"
        raise ProfileError(Problem(code="identify.axis", key="axis_definitions", where=f"#{motor}", value=value))
    return AxisWord(letter=found[0].axis, scale=found[0].scale, offset=found[0].offset)
