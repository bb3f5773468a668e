"""The bundled lathe with everything close together, for tests that are not about the ways of its axes.

Ten seconds of travel are half the time that a simulated cut takes: here the tool has 1.5 mm to go, the carriage 9.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

from drivers.simulator.plant.true_parameters import as_simulated
from profiles.machine import MachineProfile
from profiles.store import BUNDLED_MACHINES, LoadedMachine, load_machine

CLOSE_TOGETHER = {"home_radius_mm = 76.0": "home_radius_mm = 29.0", "jaw_face_mm = 200.0": "jaw_face_mm = 40.0"}
"""What the same is in the file of the lathe."""


def close_together(machine: MachineProfile, home_radius_mm: float = 29.0) -> MachineProfile:
    """Return a lathe whose tool is homed beside its part, and whose chuck is beside its carriage."""
    tool = replace(machine.tool, home_radius_mm=home_radius_mm)
    carriage = replace(machine.carriage, jaw_face_mm=40.0)
    return replace(machine, tool=tool, carriage=carriage)


@cache
def compact_machine(home_radius_mm: float = 29.0) -> LoadedMachine:
    """The lathe of the paper, close together; a part larger than that of the paper needs the tool farther out."""
    loaded = load_machine("lee-2001-lathe")
    return replace(loaded, machine=as_simulated(close_together(loaded.machine, home_radius_mm), None))


def save_compact(data: Path) -> tuple[str, str]:
    """Save that lathe in the data folder of an operator; return the words of a command that works it."""
    text = (BUNDLED_MACHINES / "lee-2001-lathe.toml").read_text(encoding="utf-8")
    for usual, near in CLOSE_TOGETHER.items():
        assert usual in text
        text = text.replace(usual, near)
    own = data / "machines" / "lee-2001-lathe.toml"  # its name is that of the machine in it
    own.parent.mkdir(parents=True, exist_ok=True)
    own.write_text(text, encoding="utf-8")
    return "--machine", own.stem
