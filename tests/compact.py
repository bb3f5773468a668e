"""The bundled lathe with everything close together, for tests that are not about the ways of its axes.

Ten seconds of travel are half the time that a simulated cut takes: here the tool has 1.5 mm to go, the carriage 9.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from profiles.machine import MachineProfile
from profiles.store import LoadedMachine, load_machine


def close_together(machine: MachineProfile) -> MachineProfile:
    """Return a lathe whose tool is homed beside its part, and whose chuck is beside its carriage."""
    tool, carriage = replace(machine.tool, home_radius_mm=29.0), replace(machine.carriage, jaw_face_mm=40.0)
    return replace(machine, tool=tool, carriage=carriage)


@cache
def compact_machine() -> LoadedMachine:
    """The lathe of the paper, close together."""
    loaded = load_machine("lee-2001-lathe")
    return replace(loaded, machine=close_together(loaded.machine))
