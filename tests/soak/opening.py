"""A console at a simulated lathe, a new one or one that another console has left; heartbeat and owner included."""

from __future__ import annotations

from pathlib import Path

from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from tests.compact import compact_machine
from tests.console.floor import Floor, floor_at


def opened_floor(records: Path, seed: int, sim: SimulatedLathe | None = None) -> Floor:
    """Connect a console; without a lathe to a new one, with chuck and tool mounted by the chance of a seed."""
    machine = compact_machine()
    sim = sim or SimulatedLathe(
        machine.machine, plant_named("mounted", machine.machine, seed, mounted_by_hand=True)
    )
    floor = floor_at(sim, records, machine, owned=True)
    floor.station.connect()
    return floor
