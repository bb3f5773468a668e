"""A console at a simulated lathe, a new one or one that another console has left; heartbeat and owner included."""

from __future__ import annotations

from pathlib import Path

from console.session.station.context import StationContext
from console.session.station.owning import Owning
from console.session.station.station import Station
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from tests.compact import compact_machine
from tests.console.floor import LOCAL_TIME, Floor


def opened_floor(records: Path, seed: int, sim: SimulatedLathe | None = None) -> Floor:
    """Connect a console; without a lathe to a new one, with chuck and tool mounted by the chance of a seed."""
    machine = compact_machine()
    sim = sim or SimulatedLathe(
        machine.machine, plant_named("mounted", machine.machine, seed, mounted_by_hand=True)
    )
    link = MemoryLink(sim.connect(), sim)
    stop, client = StopPath(link), PmacClient(link, sim)
    made: list[Floor] = []

    def seen(snapshot: Snapshot) -> None:
        for floor in made:
            for look in tuple(floor.looks):
                look(snapshot)
            floor.station.seen(snapshot)

    lathe = Lathe(
        client, machine.machine, sim, stop, seen, Heartbeat(client, sim, machine.machine), Ownership(client)
    )
    context = StationContext(
        lathe=lathe,
        owning=Owning(lathe, link.address, records),
        loaded_machine=machine,
        clock=sim,
        shop=sim,
        records=records,
        local_time=lambda: LOCAL_TIME,
        client=client,
    )
    floor = Floor(sim=sim, lathe=lathe, stop=stop, link=link, station=Station(context), context=context)
    made.append(floor)
    floor.station.connect()
    return floor
