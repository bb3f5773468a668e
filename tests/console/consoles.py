"""Several consoles of one simulated card, each with a line of its own, on a clock that is advanced."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from console.session.station.commands import Command
from console.session.station.context import StationContext
from console.session.station.owning import LOG_NAME, Owning, take_lock
from console.session.station.state import StationState
from console.session.station.station import Station
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import OWNER_ITEM, Ownership
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import ABORT_ALL, KILL_ALL, StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.store import LoadedMachine, load_machine
from tests.console.floor import LOCAL_TIME
from tests.drivers.commissioned import HeardPort

ADDRESS = "tcp:lathe:1025"
MACHINE = "lee-2001-lathe"
STOPS = ABORT_ALL + KILL_ALL
STOP_CHARACTERS = (ABORT_ALL, KILL_ALL)


@dataclass(kw_only=True)
class OneConsole:
    """A console behind a link of its own. `looks` are called with every look, before its station sees it."""

    sim: SimulatedLathe
    line: HeardPort
    client: PmacClient
    lathe: Lathe
    stop: StopPath
    owning: Owning
    looks: list[Callable[[Snapshot], None]] = field(default_factory=list)

    @property
    def number(self) -> int:
        assert self.lathe.ownership is not None
        return self.lathe.ownership.number

    @property
    def on_the_card(self) -> int:
        """The number of whoever controls the machine, as the card has it."""
        (held,) = self.client.numbers(OWNER_ITEM)
        return int(held)

    def hear(self) -> bytes:
        """Return what this console has said since the last time, and forget it."""
        said, self.line.heard = self.line.heard, b""
        return said


@dataclass(kw_only=True)
class WithStation(OneConsole):
    """The same with the station of a screen."""

    context: StationContext
    station: Station

    @property
    def state(self) -> StationState:
        return self.station.state

    def do(self, intent: Command) -> StationState:
        """Order something and have it carried out; it must be taken."""
        assert self.station.post(intent), self.state.refusals
        self.station.step()
        return self.state

    def look(self) -> StationState:
        """What a station does that has nothing to do."""
        self.station.step()
        return self.state

    @property
    def alarms(self) -> list[str]:
        return [alarm.problem.code for alarm in self.state.alarms if alarm.active]

    @property
    def refusals(self) -> list[str]:
        return [problem.code for problem in self.state.refusals]


def console_of(
    sim: SimulatedLathe, machine: MachineProfile, data: Path, *, locking: bool = True, name: str = ""
) -> OneConsole:
    """Connect a console. `data` is the folder of its user, where the lock and the log are."""
    line = HeardPort(port=sim.connect())
    link = MemoryLink(line, sim)
    client, stop = PmacClient(link, sim), StopPath(link)
    looks: list[Callable[[Snapshot], None]] = []

    def tell(snapshot: Snapshot) -> None:
        for each in tuple(looks):
            each(snapshot)

    lathe = Lathe(client, machine, sim, stop, tell, Heartbeat(client, sim, machine), Ownership(client))
    lock = partial(take_lock, data, ADDRESS) if locking else None
    owning = Owning(lathe, ADDRESS, data, lock, name=name)
    client.connect()
    return OneConsole(sim=sim, line=line, client=client, lathe=lathe, stop=stop, owning=owning, looks=looks)


def station_of(
    sim: SimulatedLathe,
    data: Path,
    *,
    locking: bool = True,
    name: str = "",
    loaded: LoadedMachine | None = None,
) -> WithStation:
    """Connect a console with a station, as a screen has it: it claims the machine, or looks on."""
    loaded = loaded or load_machine(MACHINE)
    alone = console_of(sim, loaded.machine, data, locking=locking, name=name)
    context = StationContext(
        lathe=alone.lathe,
        owning=alone.owning,
        loaded_machine=loaded,
        clock=sim,
        shop=None,
        records=data,
        local_time=lambda: LOCAL_TIME,
        client=alone.client,
    )
    context.tell(address=ADDRESS)
    station = Station(context)
    alone.looks.append(station.seen)
    made = WithStation(**vars(alone), context=context, station=station)
    assert station.connect()
    return made


def logged(data: Path) -> list[str]:
    """Return the lines of the log, without their times."""
    path = data / LOG_NAME
    if not path.exists():
        return []
    return [line.split(" ", 1)[1] for line in path.read_text(encoding="utf-8").splitlines()]
