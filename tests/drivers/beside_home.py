"""A lathe that stands just before its zeros when it is switched on: most of a homing is the way to them."""

from __future__ import annotations

from dataclasses import replace

from drivers.simulator.plant.true_parameters import TrueParameters, ideal
from profiles.machine import MachineProfile


def beside_home(machine: MachineProfile, true: TrueParameters | None = None) -> TrueParameters:
    """Return what a lathe is, with a tenth of the way to go: one that stands elsewhere on purpose stays there."""
    own = true or ideal(machine)
    usual = ideal(machine)
    if (own.tool_start_mm, own.carriage_start_mm, own.spindle_start_turns) != (
        usual.tool_start_mm,
        usual.carriage_start_mm,
        usual.spindle_start_turns,
    ):
        return own
    return replace(own, tool_start_mm=0.1, carriage_start_mm=0.2, spindle_start_turns=0.95)
