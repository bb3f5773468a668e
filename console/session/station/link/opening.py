"""A machine that is opened: its link, its lathe, and the station on it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from console.session.data.calibrated_chuck import warnings_of
from console.session.data.records import killed_or_refused
from console.session.station.alarms import Priority
from console.session.station.context import StationContext, Training
from console.session.station.machine_connection import ConnectedMachine, commissioning, reach
from console.session.station.state import SessionStart
from console.session.station.station import Station
from drivers.clock import FreezeWatch, RealClock, TrainingClock
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.address import LinkAddress
from drivers.link.tracing import Tracing
from drivers.requests.side_line import LineTraffic, SideLine
from profiles.files import remove_all_left
from profiles.store import LoadedMachine


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenMachine:
    """An opened machine: its station, its stop, and a function that closes the link and what belongs to it."""

    station: Station
    stop: StopPath
    close: Callable[[], None]


def open_machine(
    machine: LoadedMachine,
    address: LinkAddress,
    data: Path,
    tracing: Tracing,
    begins: SessionStart | None = None,
    trained: TrainingClock | None = None,
) -> OpenMachine:
    """Connect to a machine; a simulated one is started first, and connected to like a real one.

    `begins` is how a simulated lathe that was placed so is taken over. With `trained` it is in the hands of an
    instructor, and that is its time.

    Raises:
        LinkError: a code for each kind of failure; `simulator.not_started`.
        DriverError: `safety.bad_input`, in the profile.
    """
    # Polls arrive once station and lathe both exist; `connect` makes the first.
    seen: list[Station] = []

    def tell(snapshot: Snapshot) -> None:
        for station in seen:
            station.take_poll(snapshot)

    heard = LineTraffic((trained or RealClock()).now_s)
    reached = reach(machine, address, data, tracing, tell, heard, trained)
    reached.stop.freezes = FreezeWatch()
    context = _context(reached, machine, data, heard, begins, trained)
    context.tell(address=reached.address)
    for problem in warnings_of(machine):
        context.alarm(problem, Priority.LOW)
    remove_all_left(data)
    for problem in killed_or_refused(data, machine.machine.name, simulated=reached.simulated):
        context.alarm(problem, Priority.MEDIUM)
    seen.append(Station(context))
    return OpenMachine(station=seen[0], stop=reached.stop, close=reached.close)


def _context(
    reached: ConnectedMachine,
    machine: LoadedMachine,
    data: Path,
    heard: LineTraffic,
    begins: SessionStart | None,
    trained: TrainingClock | None,
) -> StationContext:
    stop = reached.stop
    return StationContext(
        lathe=reached.lathe,
        owning=reached.owning,
        loaded_machine=machine,
        clock=reached.clock,
        shop=reached.shop,
        records=data,
        local_time=lambda: time.strftime("%H:%M"),
        side=SideLine(reached.client, reached.clock, heard, lambda: stop.reason is not None),
        client=reached.client,
        commissioned=commissioning(reached, machine, data),
        reopening=reached.reopening,
        onlookers=reached.onlookers,
        begins=begins,
        training=None if trained is None or reached.shop is None else Training(lathe=reached.shop, clock=trained),
    )
