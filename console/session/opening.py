"""Opening a machine for the screen: today the simulated one, in a process of its own behind a serial line."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from console.session.link_thread import Opened
from console.session.station import Station
from console.session.workplace import Workplace
from drivers.clock import RealClock
from drivers.lathe import Lathe
from drivers.link.serial import SerialLink
from drivers.pmac.client import PmacClient
from drivers.simulator.process import SimulatorProcess
from drivers.snapshot import Snapshot
from drivers.stop import StopPath
from profiles.store import LoadedMachine


def open_simulated(machine: LoadedMachine, records: Path) -> Opened:
    """Start the simulated lathe and connect to it as to a real one.

    Raises:
        LinkError: `simulator.not_started`, `link.no_device`.
    """
    process = SimulatorProcess.start(machine.path)
    try:
        link = SerialLink(process.address)
    except BaseException:
        process.close()
        raise
    clock, stop = RealClock(), StopPath(link)
    # Looks come when station and lathe both stand; the first is made by `connect`.
    seen: list[Station] = []

    def tell(snapshot: Snapshot) -> None:
        for station in seen:
            station.seen(snapshot)

    lathe = Lathe(PmacClient(link, clock), machine.machine, clock, stop, tell)
    place = Workplace(
        lathe=lathe, machine=machine, clock=clock, shop=process, records=records, local_time=_local_time
    )
    place.tell(address=str(process.address))
    seen.append(Station(place))

    def close() -> None:
        link.close()
        process.close()

    return Opened(station=seen[0], stop=stop, close=close)


def _local_time() -> str:
    return datetime.now().astimezone().strftime("%H:%M")
