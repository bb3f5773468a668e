"""Opening of a machine for the screen: its link, its lathe, and the station that runs them."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from console.session.data.calibrated_chuck import warnings_of
from console.session.data.killed_runs import killed_or_refused
from console.session.station.alarms import Priority
from console.session.station.commissioned import Commissioned
from console.session.station.context import StationContext
from console.session.station.link_thread import Opened
from console.session.station.reaching import reach
from console.session.station.station import Station
from drivers.lathe.snapshot import Snapshot
from drivers.link.address import LinkAddress
from drivers.link.tracing import Tracing
from profiles.files import remove_all_left
from profiles.store import LoadedMachine


def open_machine(machine: LoadedMachine, address: LinkAddress, data: Path, tracing: Tracing) -> Opened:
    """Connect to a machine; a simulated one is started first, and connected to like a real one.

    Raises:
        LinkError: a code for each kind of failure; `simulator.not_started`.
        DriverError: `safety.bad_input`, in the profile.
    """
    # Polls arrive once station and lathe both exist; `connect` makes the first.
    seen: list[Station] = []

    def tell(snapshot: Snapshot) -> None:
        for station in seen:
            station.seen(snapshot)

    reached = reach(machine, address, data, tracing, tell)
    place = StationContext(
        lathe=reached.lathe,
        owning=reached.owning,
        machine=machine,
        clock=reached.clock,
        shop=reached.shop,
        records=data,
        local_time=_local_time,
        commissioned=Commissioned(
            reached.client, reached.heartbeat, machine.machine, data, simulated=reached.simulated
        ),
    )
    place.tell(address=reached.address)
    for problem in warnings_of(machine):
        place.alarm(problem, Priority.LOW)
    remove_all_left(data)
    for problem in killed_or_refused(data, machine.machine.name, simulated=reached.simulated):
        place.alarm(problem, Priority.MEDIUM)
    seen.append(Station(place))
    return Opened(station=seen[0], stop=reached.stop, close=reached.close)


def _local_time() -> str:
    return datetime.now().astimezone().strftime("%H:%M")
